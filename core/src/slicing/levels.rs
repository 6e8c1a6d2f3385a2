//! Levels: the number that is the same all over a sampling surface, and the slabs between them.

use glam::DVec3;

use crate::{Ray, lattice::Lattice};

/// What sampling surfaces are: the points of equal level, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Levels {
    /// Planes: the level is `normal·(p − origin)`.
    Planes {
        /// Unit normal.
        normal: DVec3,
        /// Where the level is 0.
        origin: DVec3,
    },
    /// Shells around the eye: the level is the distance from it.
    Shells {
        /// The eye.
        center: DVec3,
    },
}

impl Levels {
    /// The level of a point in world space.
    pub fn at(&self, point: DVec3) -> f64 {
        match *self {
            Self::Planes { normal, origin } => normal.dot(point - origin),
            Self::Shells { center } => point.distance(center),
        }
    }

    /// A point of level 0.
    pub fn origin(&self) -> DVec3 {
        match *self {
            Self::Planes { origin, .. } => origin,
            Self::Shells { center } => center,
        }
    }

    /// The level along a ray that leaves the eye, as `[a, b]` of `a + b·t`.
    pub fn along(&self, ray: &Ray) -> [f64; 2] {
        match *self {
            Self::Planes { normal, origin } => [normal.dot(ray.origin - origin), normal.dot(ray.direction)],
            Self::Shells { .. } => [0.0, 1.0],
        }
    }

    /// The stretch of a ray between two levels, in its `t`; `None` where there is none. A ray along
    /// the planes is between them all the way, or nowhere.
    pub fn cut(&self, ray: &Ray, slab: [f64; 2]) -> Option<[f64; 2]> {
        let [offset, slope] = self.along(ray);
        if slope == 0.0 {
            return (slab[0] <= offset && offset < slab[1]).then_some([f64::NEG_INFINITY, f64::INFINITY]);
        }
        let [a, b] = slab.map(|level| (level - offset) / slope);
        Some([a.min(b), a.max(b)])
    }

    /// The length of a ray between surfaces `spacing` apart: 1/cosθ of it on planes, `spacing`
    /// itself on shells.
    ///
    /// `gradient` is the level's where the surface was made flat, cell by cell: see
    /// [`Face::gradient`](super::Face). On planes it is their normal.
    pub fn length(spacing: f64, gradient: DVec3, direction: DVec3) -> f64 {
        spacing / gradient.dot(direction).abs()
    }

    /// The direction in which levels rise at a point.
    pub fn gradient(&self, point: DVec3) -> DVec3 {
        match *self {
            Self::Planes { normal, .. } => normal,
            Self::Shells { center } => (point - center).try_normalize().unwrap_or(DVec3::Z),
        }
    }
}

/// Slabs between levels: number *k* from `anchor + k·step` to `anchor + (k+1)·step`. In the sampling
/// space `ViewVolume` the anchor is 0 for all shapes, and these are the segments of the frame's
/// [`Lattice`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slabs {
    /// Where number 0 begins.
    pub anchor: f64,
    /// How thick they are, positive.
    pub step: f64,
}

impl Slabs {
    /// Where a slab begins and ends.
    pub fn slab(&self, number: i64) -> [f64; 2] {
        [number as f64 * self.step + self.anchor, (number + 1) as f64 * self.step + self.anchor]
    }

    /// The level of the plane that stands for a slab: its middle.
    pub fn middle(&self, number: i64) -> f64 {
        (number as f64 + 0.5) * self.step + self.anchor
    }

    /// Numbers of the first slab that `[low, high]` reaches into, and of the one after the last.
    pub fn touched(&self, low: f64, high: f64) -> [i64; 2] {
        Lattice { step: self.step }.touched(low - self.anchor, high - self.anchor)
    }

    /// Numbers of the first slab whose middle lies above `low`, and of the one after the last whose
    /// middle lies at most at `high`: those that cut a cell of these levels, by the rule that a
    /// vertex on a plane lies above it.
    pub(super) fn cutting(&self, low: f64, high: f64) -> [i64; 2] {
        // The quotient is rounded; the comparison with the level itself decides.
        let first = |bound: f64, above: &dyn Fn(f64) -> bool| {
            let near = ((bound - self.anchor) / self.step - 0.5).floor();
            let mut k = near as i64;
            // Beyond, numbers are not told apart, and plans are refused.
            if near.is_nan() || near.abs() > 1e15 {
                return k;
            }
            while above(self.middle(k)) {
                k -= 1;
            }
            while !above(self.middle(k)) {
                k += 1;
            }
            k
        };
        [first(low, &|level| level > low), first(high, &|level| level > high)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn slabs_that_cut_are_those_between(low in -9.0..9.0f64, size in 0.0..5.0f64, step in 0.01..3.0f64, anchor in -2.0..2.0f64) {
            let slabs = Slabs { anchor, step };
            let [a, b] = slabs.cutting(low, low + size);
            for k in a - 3..b + 3 {
                let middle = slabs.middle(k);
                prop_assert_eq!((a..b).contains(&k), low < middle && middle <= low + size);
            }
        }

        #[test]
        fn rays_are_cut_where_their_level_says(n in prop::array::uniform3(-1.0..1.0f64), d in prop::array::uniform3(-1.0..1.0f64), level in -2.0..2.0f64) {
            let normal = DVec3::from(n).try_normalize().unwrap_or(DVec3::X);
            let direction = DVec3::from(d).try_normalize().unwrap_or(DVec3::Y);
            prop_assume!(normal.dot(direction).abs() > 1e-3);
            let origin = DVec3::new(0.3, -0.2, 0.7);
            let ray = Ray { origin: DVec3::ONE, direction, near: 0.0, far: 9.0, depth_zero: 0.0 };
            let levels = Levels::Planes { normal, origin };
            let [a, b] = levels.cut(&ray, [level, level + 0.5]).unwrap();
            prop_assert!((b - a - Levels::length(0.5, normal, direction)).abs() < 1e-9 * (b - a));
            let ends = [levels.at(ray.at(a)), levels.at(ray.at(b))];
            prop_assert!((ends[0].min(ends[1]) - level).abs() < 1e-9 && (ends[0].max(ends[1]) - level - 0.5).abs() < 1e-9);
        }
    }

    #[test]
    fn shells_carry_no_cosine() {
        let levels = Levels::Shells { center: DVec3::ONE };
        let direction = DVec3::new(0.6, 0.0, 0.8);
        let ray = Ray { origin: DVec3::ONE, direction, near: 0.0, far: 9.0, depth_zero: 0.0 };
        assert_eq!(levels.cut(&ray, [2.0, 2.5]), Some([2.0, 2.5]));
        assert!((Levels::length(0.5, levels.gradient(ray.at(2.0)), direction) - 0.5).abs() < 1e-15);
        assert_eq!(Levels::length(0.5, DVec3::Z, direction), 0.625);
    }
}
