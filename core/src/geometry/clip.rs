//! Clipping: planes and boxes that cut shapes and scenes, and the stretches of a ray they leave.

use glam::{DAffine3, DVec3};

use super::{Aabb, GeometryError};

/// A plane: the points `p` with `normal·p = offset`. In front of it is `normal·p > offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    normal: DVec3,
    offset: f64,
}

impl Plane {
    /// A plane through a point; `normal` points to its front and has any length but zero.
    ///
    /// # Errors
    /// If a number is not finite or the normal has no length.
    pub fn new(point: DVec3, normal: DVec3) -> Result<Self, GeometryError> {
        if !point.is_finite() {
            return Err(GeometryError::invalid("plane", "point", point, "finite numbers"));
        }
        let Some(normal) = normal.try_normalize() else {
            return Err(GeometryError::invalid("plane", "normal", normal, "a finite direction with a length"));
        };
        Ok(Self { normal, offset: normal.dot(point) })
    }

    /// A plane of numbers that another plane had; `None` where they are none.
    pub(crate) fn from_numbers([x, y, z, offset]: [f64; 4]) -> Option<Self> {
        let normal = DVec3::new(x, y, z);
        let good = (normal.length_squared() - 1.0).abs() <= 1e-9 && offset.is_finite();
        good.then_some(Self { normal, offset })
    }

    /// The unit normal.
    pub fn normal(&self) -> DVec3 {
        self.normal
    }

    /// The signed distance of the plane from the origin along the normal.
    pub fn offset(&self) -> f64 {
        self.offset
    }

    /// The signed distance of a point, positive in front.
    pub fn distance(&self, point: DVec3) -> f64 {
        self.normal.dot(point) - self.offset
    }

    /// Where the line `origin + t·direction` meets the plane; `None` where it is parallel.
    pub fn meets(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let slope = self.normal.dot(direction);
        let t = -self.distance(origin) / slope;
        (slope != 0.0 && t.is_finite()).then_some(t)
    }
}

/// A convex region between planes, and which side of it is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct ClipRegion {
    planes: Vec<Plane>,
    keep: bool,
}

impl ClipRegion {
    /// Keeps what is in front of a plane.
    pub fn plane(plane: Plane) -> Self {
        Self { planes: vec![plane], keep: true }
    }

    /// Keeps what is in front of all planes.
    pub fn planes(planes: impl IntoIterator<Item = Plane>) -> Self {
        Self { planes: planes.into_iter().collect(), keep: true }
    }

    /// A region of planes that keeps its inside, or its outside.
    pub(crate) fn from_planes(planes: Vec<Plane>, keep: bool) -> Self {
        Self { planes, keep }
    }

    /// Keeps the inside of a box: a crop box.
    pub fn crop(bounds: Aabb) -> Self {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let plane = |normal: DVec3, offset| Plane { normal, offset };
        let low = axes.iter().enumerate().map(|(a, &n)| plane(n, bounds.min[a]));
        let high = axes.iter().enumerate().map(|(a, &n)| plane(-n, -bounds.max[a]));
        Self { planes: low.chain(high).collect(), keep: true }
    }

    /// The other way round: cuts the inside away and keeps the rest.
    pub fn cut(self) -> Self {
        Self { keep: !self.keep, ..self }
    }

    /// The planes whose fronts meet in the region.
    pub fn bounding_planes(&self) -> &[Plane] {
        &self.planes
    }

    /// Whether the inside is kept.
    pub fn keeps_inside(&self) -> bool {
        self.keep
    }

    /// The stretch of the line `origin + t·direction` inside the region.
    fn inside(&self, origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        let (mut t0, mut t1) = (f64::NEG_INFINITY, f64::INFINITY);
        for plane in &self.planes {
            let (slope, distance) = (plane.normal.dot(direction), plane.distance(origin));
            if slope == 0.0 {
                if distance < 0.0 {
                    return None;
                }
            } else if slope > 0.0 {
                t0 = t0.max(-distance / slope);
            } else {
                t1 = t1.min(-distance / slope);
            }
        }
        (t0 < t1).then_some([t0, t1])
    }
}

/// What cuts a shape (in object space) or a scene (in world space): what all regions keep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Clip {
    regions: Vec<ClipRegion>,
}

impl Clip {
    /// Nothing is cut.
    pub const NONE: Self = Self { regions: Vec::new() };

    /// Cuts by regions, any number.
    pub fn new(regions: impl IntoIterator<Item = ClipRegion>) -> Self {
        Self { regions: regions.into_iter().collect() }
    }

    /// Adds a region.
    pub fn with(mut self, region: ClipRegion) -> Self {
        self.regions.push(region);
        self
    }

    /// Whether nothing is cut.
    pub fn is_none(&self) -> bool {
        self.regions.is_empty()
    }

    /// The regions.
    pub fn regions(&self) -> &[ClipRegion] {
        &self.regions
    }

    /// Takes away from `spans` of the line `origin + t·direction` what is clipped.
    pub fn apply(&self, origin: DVec3, direction: DVec3, spans: &mut Spans) {
        for region in &self.regions {
            match (region.inside(origin, direction), region.keep) {
                (Some([a, b]), true) => spans.keep(a, b),
                (None, true) => spans.clear(),
                (Some([a, b]), false) => spans.cut(a, b),
                (None, false) => {}
            }
        }
    }

    /// Whether a point is left; on the border it is.
    pub fn contains(&self, point: DVec3) -> bool {
        self.regions.iter().all(|r| {
            let inside = r.planes.iter().all(|p| p.distance(point) >= 0.0);
            let deep = r.planes.iter().all(|p| p.distance(point) > 0.0);
            if r.keep { inside } else { !deep }
        })
    }

    /// The same clip as seen through an affine map: a point `map(p)` is kept by the result where
    /// `p` is kept by this one. For a shape's transform: object to world space.
    pub fn transformed(&self, map: &DAffine3) -> Self {
        let inverse = map.inverse();
        // Normals go with the inverse transpose; lengths are made one again.
        let plane = |p: &Plane| {
            let normal = inverse.matrix3.transpose() * p.normal;
            let offset = p.offset - p.normal.dot(inverse.translation);
            let length = normal.length();
            Plane { normal: normal / length, offset: offset / length }
        };
        let region = |r: &ClipRegion| ClipRegion { planes: r.planes.iter().map(plane).collect(), keep: r.keep };
        Self { regions: self.regions.iter().map(region).collect() }
    }
}

impl FromIterator<ClipRegion> for Clip {
    fn from_iter<I: IntoIterator<Item = ClipRegion>>(regions: I) -> Self {
        Self::new(regions)
    }
}

/// Stretches of a line, apart and in order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spans(Vec<[f64; 2]>);

impl Spans {
    /// Nothing.
    pub const EMPTY: Self = Self(Vec::new());

    /// One stretch; nothing where it has no length.
    pub fn one(start: f64, end: f64) -> Self {
        Self(if start < end { vec![[start, end]] } else { Vec::new() })
    }

    /// Stretches of any order, merged where they touch or overlap.
    pub fn union(stretches: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let mut all: Vec<_> = stretches.into_iter().filter(|[a, b]| a < b).collect();
        all.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut merged: Vec<[f64; 2]> = Vec::with_capacity(all.len());
        for [a, b] in all {
            match merged.last_mut() {
                Some(last) if a <= last[1] => last[1] = last[1].max(b),
                _ => merged.push([a, b]),
            }
        }
        Self(merged)
    }

    /// Keeps what lies between two places.
    pub fn keep(&mut self, start: f64, end: f64) {
        self.0.iter_mut().for_each(|s| *s = [s[0].max(start), s[1].min(end)]);
        self.0.retain(|[a, b]| a < b);
    }

    /// Cuts away what lies between two places.
    pub fn cut(&mut self, start: f64, end: f64) {
        let around = |&[a, b]: &[f64; 2]| [[a, b.min(start)], [a.max(end), b]];
        let left = self.0.iter().flat_map(around).filter(|[a, b]| a < b);
        self.0 = if start < end { left.collect() } else { return };
    }

    /// Leaves nothing.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Whether nothing is left.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// The stretches in order.
    pub fn as_slice(&self) -> &[[f64; 2]] {
        &self.0
    }

    /// The sum of their lengths.
    pub fn length(&self) -> f64 {
        self.0.iter().map(|[a, b]| b - a).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cut_box() -> Clip {
        Clip::NONE.with(ClipRegion::crop(Aabb::new(DVec3::ZERO, DVec3::ONE)).cut())
    }

    #[test]
    fn cutting_a_box_leaves_both_sides() {
        let mut spans = Spans::one(-5.0, 5.0);
        cut_box().apply(DVec3::new(0.0, 0.5, 0.5), DVec3::X, &mut spans);
        assert_eq!(spans.as_slice(), [[-5.0, 0.0], [1.0, 5.0]]);
    }

    #[test]
    fn a_region_of_no_planes_is_all_of_space() {
        for (region, left) in [(ClipRegion::planes([]), 2.0), (ClipRegion::planes([]).cut(), 0.0)] {
            let clip = Clip::new([region]);
            let mut spans = Spans::one(-1.0, 1.0);
            clip.apply(DVec3::ZERO, DVec3::X, &mut spans);
            assert_eq!((spans.length(), clip.contains(DVec3::ZERO)), (left, left > 0.0));
        }
    }

    #[test]
    fn a_ray_along_a_plane_is_kept_on_it_and_cut_behind() {
        let clip = Clip::NONE.with(ClipRegion::plane(Plane::new(DVec3::ZERO, DVec3::Y).unwrap()));
        for (y, left) in [(0.0, 2.0), (1.0, 2.0), (-1e-9, 0.0)] {
            let mut spans = Spans::one(-1.0, 1.0);
            clip.apply(DVec3::new(0.0, y, 0.0), DVec3::X, &mut spans);
            assert_eq!(spans.length(), left, "{y}");
        }
    }

    proptest! {
        #[test]
        fn spans_hold_the_points_that_the_clip_contains(
            planes in prop::collection::vec((prop::array::uniform3(-1.0..1.0f64), prop::array::uniform3(-1.0..1.0f64), any::<bool>()), 0..10),
            origin in prop::array::uniform3(-1.0..1.0f64),
            direction in prop::array::uniform3(-1.0..1.0f64),
            turn in -3.0..3.0f64,
        ) {
            let regions = planes.into_iter().filter_map(|(p, n, keep)| {
                let region = ClipRegion::plane(Plane::new(p.into(), n.into()).ok()?);
                Some(if keep { region } else { region.cut() })
            });
            let clip = Clip::new(regions).with(ClipRegion::crop(Aabb::new(DVec3::splat(-0.3), DVec3::splat(0.4))).cut());
            let (origin, direction) = (DVec3::from(origin), DVec3::from(direction));
            let mut spans = Spans::one(-2.0, 2.0);
            clip.apply(origin, direction, &mut spans);
            let map = DAffine3::from_rotation_z(turn) * DAffine3::from_scale(DVec3::new(-2.0, 1.0, 0.5));
            let moved = clip.transformed(&map);
            for i in 0..200 {
                let t = -2.0 + 4.0 * (f64::from(i) + 0.5) / 200.0;
                let near = spans.as_slice().iter().flatten().any(|e| (e - t).abs() < 1e-9);
                let inside = spans.as_slice().iter().any(|[a, b]| *a <= t && t <= *b);
                let p = origin + direction * t;
                prop_assert!(near || inside == clip.contains(p), "{t}");
                prop_assert!(near || inside == moved.contains(map.transform_point3(p)), "{t}");
            }
        }
    }
}
