//! A ray as a shape sees it: in world and object space, and what clips leave of it.
//!
//! A ray's numbers, transforms and planes are taken as the exact f64 that core hands over. An
//! anchor near the middle of the shape is carried from space to space in double-double, and
//! positions are counted from there: `p(t) = p_a + t·d`, so that neither a distant camera nor a
//! distant scene costs digits.

use volact_core::{
    Clip, Ray,
    geometry::ClipRegion,
    glam::{DAffine3, DVec3},
};

use super::{
    dd::Dd,
    line::{map_point, map_vector},
    mark::{FINE, Mark, Stretches},
};

/// A straight line in some space: `at + t·step`, counted from an anchor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Path {
    pub at: [Dd; 3],
    pub step: [Dd; 3],
    /// Sizes of the numbers that `at` and `step` come from: their errors are `FINE` times these.
    pub at_size: [f64; 3],
    pub step_size: [f64; 3],
}

/// How a line meets a plane.
#[derive(Clone, Copy, Debug)]
pub(super) enum Crossing {
    /// It comes from behind.
    Enter(Mark),
    /// It comes from the front.
    Leave(Mark),
    /// It keeps in front of it or in it.
    Front,
    /// It keeps in it.
    Inside,
    /// It keeps behind it.
    Behind,
}

/// A ray in a shape's spaces.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// The ray's `t` from which paths are counted.
    pub anchor: f64,
    pub world: Path,
    pub object: Path,
}

impl Path {
    /// The same line in another space.
    pub fn mapped(&self, map: &DAffine3) -> Self {
        let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis];
        let size = |v: &[f64; 3]| [0, 1, 2].map(|a| (0..3).map(|c| v[c] * columns[c][a].abs()).sum::<f64>());
        let (at_size, step_size, step) = (size(&self.at_size), size(&self.step_size), map_vector(map, self.step));
        // What is nothing to double-double precision is nothing.
        let tidy = |a: usize| if step[a].hi.abs() <= FINE * step_size[a] { Dd::default() } else { step[a] };
        Self {
            at: map_point(map, self.at),
            step: [0, 1, 2].map(tidy),
            at_size: [0, 1, 2].map(|a| at_size[a] + map.translation[a].abs()),
            step_size,
        }
    }

    /// A coordinate at `t`, and a bound on its error.
    pub fn coordinate(&self, axis: usize, t: Dd) -> (Dd, f64) {
        let error = FINE * (self.at_size[axis] + t.hi.abs() * self.step_size[axis]);
        (self.at[axis].add(self.step[axis].times(t)), error)
    }

    /// Meets the plane of the points p with `normal·p = offset`.
    pub fn meet(&self, anchor: f64, normal: DVec3, offset: f64) -> Crossing {
        let along = |v: &[Dd; 3]| (0..3).fold(Dd::default(), |sum, a| sum.add(v[a].scale(normal[a])));
        let size = |v: &[f64; 3]| FINE * (0..3).map(|a| v[a] * normal[a].abs()).sum::<f64>();
        let (distance, slope) = (along(&self.at).add(Dd::new(-offset)), along(&self.step));
        let (distance_error, slope_error) = (size(&self.at_size) + FINE * offset.abs(), size(&self.step_size));
        if slope.hi.abs() <= slope_error {
            return match distance.hi {
                d if d.abs() <= distance_error => Crossing::Inside,
                d if d > 0.0 => Crossing::Front,
                _ => Crossing::Behind,
            };
        }
        let t = distance.negate().over(slope);
        let reach = t.hi.abs();
        let error = (distance_error + reach * slope_error) / slope.hi.abs() + FINE * (reach + anchor.abs());
        // A plane that is all but parallel is crossed somewhere.
        let most = |v: &[f64; 3]| v.iter().fold(0.0, |m: f64, v| m.max(*v));
        let fine = error <= 1e-20 * (reach + anchor.abs() + most(&self.at_size) / most(&self.step_size));
        let mark = Mark { t: Dd::new(anchor).add(t), error, fine };
        if slope.hi > 0.0 { Crossing::Enter(mark) } else { Crossing::Leave(mark) }
    }
}

impl Sight {
    /// A ray in a space of which `center` is about the middle; `None` where numbers overflow.
    pub fn new(ray: &Ray, to_object: &DAffine3, center: DVec3) -> Option<Self> {
        let direction = to_object.transform_vector3(ray.direction);
        let from = to_object.transform_point3(ray.origin);
        let anchor = (center - from).dot(direction) / direction.length_squared();
        let (origin, way) = (ray.origin.to_array(), ray.direction.to_array());
        let world = Path {
            at: [0, 1, 2].map(|a| Dd::new(origin[a]).add(Dd::product(anchor, way[a]))),
            step: way.map(Dd::new),
            at_size: [0, 1, 2].map(|a| origin[a].abs() + (anchor * way[a]).abs()),
            step_size: way.map(f64::abs),
        };
        anchor.is_finite().then(|| Self { anchor, world, object: world.mapped(to_object) })
    }

    /// What two clips leave of stretches: one in object and one in world space.
    pub fn clip(&self, object: &Clip, world: &Clip, stretches: &mut Stretches) {
        for (clip, path) in [(object, &self.object), (world, &self.world)] {
            for region in clip.regions() {
                match (self.inside(path, region), region.keeps_inside()) {
                    (Some([a, b]), true) => stretches.keep(a, b),
                    (None, true) => stretches.clear(),
                    (Some([a, b]), false) => stretches.cut(a, b),
                    (None, false) => {}
                }
            }
        }
    }

    /// The stretch inside a region, ends included; as in core, a ray in a plane of it is inside.
    fn inside(&self, path: &Path, region: &ClipRegion) -> Option<[Mark; 2]> {
        let mut all = Stretches::between(Mark::exact(f64::NEG_INFINITY), Mark::exact(f64::INFINITY));
        for plane in region.bounding_planes() {
            let [start, end] = self.front(path, plane.normal(), plane.offset())?;
            all.keep(start, end);
        }
        all.as_slice().first().copied()
    }

    /// The stretch in front of a plane or in it.
    pub fn front(&self, path: &Path, normal: DVec3, offset: f64) -> Option<[Mark; 2]> {
        let (start, end) = (Mark::exact(f64::NEG_INFINITY), Mark::exact(f64::INFINITY));
        match path.meet(self.anchor, normal, offset) {
            Crossing::Enter(mark) => Some([mark, end]),
            Crossing::Leave(mark) => Some([start, mark]),
            Crossing::Front | Crossing::Inside => Some([start, end]),
            Crossing::Behind => None,
        }
    }
}
