//! Cuts from the command line: `--clip` and `--slice`.

use std::str::FromStr;

use volact::{
    Aabb, Clip, ClipRegion, Plane,
    core::{
        glam::{DAffine3, DVec3},
        scene,
    },
};

/// Where along an axis a plane stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    axis: usize,
    /// In world units, or as a part of what is drawn.
    at: f64,
    part: bool,
}

impl Place {
    /// The plane, with its front to the higher side.
    fn plane(self, bounds: &Aabb) -> anyhow::Result<Plane> {
        let Self { axis, at, part } = self;
        let at = if part { bounds.min[axis] + at * (bounds.max[axis] - bounds.min[axis]) } else { at };
        let normal = [DVec3::X, DVec3::Y, DVec3::Z][axis];
        Ok(Plane::new(normal * at, normal)?)
    }

    fn parse(text: &str, sign: char) -> Option<Self> {
        let (axis, at) = text.split_once(sign)?;
        let axis = ["x", "y", "z"].iter().position(|name| *name == axis.trim())?;
        let at = at.trim();
        let (number, part) = at.strip_suffix('%').map_or((at, false), |number| (number, true));
        let number: f64 = number.trim().parse().ok().filter(|v: &f64| v.is_finite())?;
        Some(Self { axis, at: if part { number / 100.0 } else { number }, part })
    }
}

/// What is kept: `x<0.5`, `z>40%`, or a region as scenes write it.
#[derive(Clone, Debug)]
pub enum Cut {
    /// Below a place.
    Below(Place),
    /// Above it.
    Above(Place),
    /// Any region.
    Region(ClipRegion),
}

impl FromStr for Cut {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let below = Place::parse(text, '<').map(Self::Below);
        let above = || Place::parse(text, '>').map(Self::Above);
        if let Some(cut) = below.or_else(above) {
            return Ok(cut);
        }
        let hint = "wanted x<NUMBER, z>40% or a region such as Box(min: (0, 0, 0), max: (1, 1, 1))";
        scene::parse_region(text).map(Self::Region).map_err(|problems| format!("{hint}; {problems}"))
    }
}

impl Cut {
    /// The region that is kept, of a scene with these bounds.
    pub fn region(&self, bounds: &Aabb) -> anyhow::Result<ClipRegion> {
        Ok(match self {
            Self::Below(place) => ClipRegion::plane(place.plane(bounds)?).cut(),
            Self::Above(place) => ClipRegion::plane(place.plane(bounds)?),
            Self::Region(region) => region.clone(),
        })
    }
}

/// A plane to draw on: `x=0.5`, `z=40%`, or `Plane(…)` as scenes write it.
#[derive(Clone, Debug)]
pub enum Slice {
    /// Across an axis.
    At(Place),
    /// Any plane.
    Plane(Plane),
}

impl FromStr for Slice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some(place) = Place::parse(text, '=') {
            return Ok(Self::At(place));
        }
        let hint = "wanted x=NUMBER, z=40% or Plane(point: (0, 0, 0), normal: (0, 0, 1))";
        scene::parse_plane(text).map(Self::Plane).map_err(|problems| format!("{hint}; {problems}"))
    }
}

impl Slice {
    /// The plane in world space, through a shape with these world bounds.
    pub fn plane(&self, bounds: &Aabb) -> anyhow::Result<Plane> {
        match self {
            Self::At(place) => place.plane(bounds),
            Self::Plane(plane) => Ok(*plane),
        }
    }
}

/// A plane of world space in a shape's object space, to which `to_object` leads.
pub fn to_object(plane: Plane, to_object: &DAffine3) -> anyhow::Result<Plane> {
    let clip = Clip::new([ClipRegion::plane(plane)]).transformed(to_object);
    let plane = clip.regions().first().and_then(|region| region.bounding_planes().first()).copied();
    plane.ok_or_else(|| anyhow::anyhow!("the plane cannot be carried into the shape's space"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Aabb = Aabb { min: DVec3::ZERO, max: DVec3::new(2.0, 4.0, 8.0) };

    fn keeps(text: &str, point: DVec3) -> bool {
        let cut: Cut = text.parse().unwrap();
        Clip::new([cut.region(&BOUNDS).unwrap()]).contains(point)
    }

    #[test]
    fn cuts_are_places_or_regions() {
        let point = DVec3::new(0.5, 3.0, 5.0);
        let kept = ["x<0.6", "x < 30%", "y>2.9", "z>50%", "Cut(Box(min: (1, 0, 0), max: (2, 4, 8)))"];
        let cut = ["x<0.4", "x<20%", "y>80%", "z>5.5", "Plane(point: (1, 0, 0), normal: (1, 0, 0))"];
        assert!(kept.iter().all(|text| keeps(text, point)));
        assert!(cut.iter().all(|text| !keeps(text, point)));
        for text in ["", "x", "w<3", "x<a", "x<inf", "x=3", "Box()", "Cut(3)"] {
            let error = text.parse::<Cut>().map(|_| "no error").unwrap_err();
            assert!(error.starts_with("wanted x<NUMBER"), "{text}: {error}");
        }
    }

    #[test]
    fn slices_are_carried_into_the_shape() {
        let slice: Slice = "z=25%".parse().unwrap();
        let plane = slice.plane(&BOUNDS).unwrap();
        assert_eq!((plane.normal(), plane.offset()), (DVec3::Z, 2.0));
        let map = DAffine3::from_translation(DVec3::Z) * DAffine3::from_scale(DVec3::splat(0.5));
        let inside = to_object(plane, &map.inverse()).unwrap();
        assert!((inside.distance(DVec3::new(7.0, 7.0, 2.0))).abs() < 1e-12);
        assert!("x<3".parse::<Slice>().is_err());
        assert!("Plane(point: (0, 0, 0), normal: (1, 1, 0))".parse::<Slice>().is_ok());
    }
}
