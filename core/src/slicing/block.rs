//! The direct way for blocks: a box cut by a plane, and between two.

use glam::{DAffine3, DVec3};

use super::{
    levels::Levels,
    polygon::{mix, mix_places, precedes},
};
use crate::{Aabb, Tessellation};

/// A block's corners in object and world space, with their levels; x changes fastest.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BlockCorners {
    object: [DVec3; 8],
    world: [DVec3; 8],
    levels: [f64; 8],
}

/// The ends of a box's edges: those that differ in one bit.
const EDGES: [[usize; 2]; 12] = [
    [0, 1],
    [2, 3],
    [4, 5],
    [6, 7], //
    [0, 2],
    [1, 3],
    [4, 6],
    [5, 7],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];

/// Pieces along each axis of a block on shells.
const FACETS: usize = 8;

/// A block as tetrahedra that are small enough for shells to be flat in them.
pub(super) fn facets(block: Aabb) -> Tessellation {
    let n = FACETS + 1;
    let at = |i: usize| {
        let t = DVec3::new((i % n) as f64, (i / n % n) as f64, (i / n / n) as f64) / FACETS as f64;
        DVec3::from_array([0, 1, 2].map(|a| mix(block.min[a], block.max[a], t[a])))
    };
    let steps = [1, n, n * n];
    let corner = |base: usize, c: usize| (base + (0..3).map(|a| steps[a] * (c >> a & 1)).sum::<usize>()) as u32;
    let inner = |i: &usize| [1, n, n * n].iter().all(|s| i / s % n < FACETS);
    // As a block is cut: six around the diagonal.
    let paths = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
    let six = |i: usize| paths.map(|[a, b]| [0, a, b, 7].map(|c| corner(i, c)));
    let tetrahedra = (0..n * n * n).filter(inner).flat_map(six).collect();
    Tessellation { vertices: (0..n * n * n).map(at).collect(), tetrahedra, ..Tessellation::default() }
}

impl BlockCorners {
    /// The corners of a block that `transform` places in the world.
    pub fn new(block: Aabb, transform: &DAffine3, levels: &Levels) -> Self {
        let object = block.corners();
        let world = object.map(|c| transform.transform_point3(c));
        Self { object, world, levels: world.map(|p| levels.at(p)) }
    }

    /// The corners in the world.
    pub fn world(&self) -> &[DVec3; 8] {
        &self.world
    }

    /// The lowest and the highest level of a corner.
    pub fn range(&self) -> [f64; 2] {
        self.levels.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], l| [a.min(*l), b.max(*l)])
    }

    /// Visits the points, in object and world space, in which a plane of a level cuts the block: 3 to
    /// 6 in order around it, or none. A corner on the plane lies above it.
    pub fn cut(&self, level: f64, normal: DVec3, mut visit: impl FnMut(DVec3, DVec3)) {
        let mut points = [(DVec3::ZERO, DVec3::ZERO); 12];
        let mut count = 0;
        for [a, b] in EDGES {
            if (self.levels[a] >= level) != (self.levels[b] >= level) {
                points[count] = self.cross([a, b], level);
                count += 1;
            }
        }
        let points = &mut points[..count];
        let center = points.iter().map(|p| p.1).sum::<DVec3>() / count.max(1) as f64;
        let (u, v) = normal.any_orthonormal_pair();
        let angle = |p: DVec3| (p - center).dot(v).atan2((p - center).dot(u));
        points.sort_by(|a, b| angle(a.1).total_cmp(&angle(b.1)));
        if count >= 3 {
            points.iter().for_each(|(object, world)| visit(*object, *world));
        }
    }

    /// Writes the corners of the block's part between two levels, in world space and in no order.
    pub fn between(&self, slab: [f64; 2], out: &mut Vec<DVec3>) {
        out.clear();
        let inside = |i: &usize| slab[0] <= self.levels[*i] && self.levels[*i] <= slab[1];
        out.extend((0..8).filter(inside).map(|i| self.world[i]));
        for level in slab {
            for [a, b] in EDGES {
                if (self.levels[a] > level) != (self.levels[b] > level) {
                    out.push(self.cross([a, b], level).1);
                }
            }
        }
    }

    fn cross(&self, edge: [usize; 2], level: f64) -> (DVec3, DVec3) {
        let [a, b] = if precedes(self.world[edge[1]], self.world[edge[0]]) { [edge[1], edge[0]] } else { edge };
        let (fa, fb) = (self.levels[a] - level, self.levels[b] - level);
        let t = fa / (fa - fb);
        (mix_places(self.object[a], self.object[b], t), mix_places(self.world[a], self.world[b], t))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn corners(normal: DVec3, transform: &DAffine3) -> BlockCorners {
        let levels = Levels::Planes { normal, origin: DVec3::ZERO };
        BlockCorners::new(Aabb::new(DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)), transform, &levels)
    }

    fn cut(corners: &BlockCorners, level: f64, normal: DVec3) -> Vec<DVec3> {
        let mut points = Vec::new();
        corners.cut(level, normal, |_, world| points.push(world));
        points
    }

    fn area(points: &[DVec3]) -> f64 {
        let fan = (1..points.len().max(2) - 1).map(|i| (points[i] - points[0]).cross(points[i + 1] - points[0]));
        fan.sum::<DVec3>().length() / 2.0
    }

    #[test]
    fn facets_fill_their_block() {
        let made = facets(Aabb::new(DVec3::ONE, DVec3::new(2.0, 3.0, 5.0)));
        assert_eq!(made.validate("facets"), Ok(()));
        let total: f64 = (0..made.tetrahedra.len()).map(|t| made.volume(t)).sum();
        assert!((total - 8.0).abs() < 1e-9);
    }

    proptest! {
        #[test]
        fn a_plane_cuts_a_block_in_three_to_six_points(
            n in prop::array::uniform3(-1.0..1.0f64), level in -4.0..4.0f64, whole in any::<bool>(), round in any::<bool>(),
        ) {
            // Whole numbers put corners on planes and make them parallel to faces.
            let n = if round { n.map(f64::round) } else { n };
            let normal = DVec3::from(n).try_normalize().unwrap_or(DVec3::Z);
            let level = if whole { level.round() } else { level };
            let made = corners(normal, &DAffine3::from_rotation_y(if round { 0.0 } else { 0.4 }));
            let points = cut(&made, level, normal);
            prop_assert!(points.is_empty() || (3..=6).contains(&points.len()), "{points:?}");
            let [low, high] = made.range();
            prop_assert_eq!(points.is_empty(), !(low < level && level <= high));
            prop_assert!(points.iter().all(|p| (normal.dot(*p) - level).abs() < 1e-9));
            // In order around: all turns of the same sense.
            let n = points.len();
            for i in 0..n {
                let [a, b, c] = [0, 1, 2].map(|j| points[(i + j) % n]);
                prop_assert!((b - a).cross(c - b).dot(normal) >= -1e-9);
            }
        }

        #[test]
        fn areas_times_spacing_add_up_to_the_volume(n in prop::array::uniform3(-1.0..1.0f64), turn in -3.0..3.0f64) {
            let normal = DVec3::from(n).try_normalize().unwrap_or(DVec3::Z);
            let transform = DAffine3::from_rotation_z(turn) * DAffine3::from_scale(DVec3::new(1.0, -0.5, 2.0));
            let made = corners(normal, &transform);
            let step = 0.01;
            let sum: f64 = (-1000..1000).map(|k| area(&cut(&made, (f64::from(k) + 0.5) * step, normal)) * step).sum();
            // The area is piecewise quadratic in the level: the midpoint rule is off by h² at most
            // but where a face is parallel to the planes, where it is off by half a plane.
            prop_assert!((sum - 6.0).abs() < 0.02 * 6.0, "{sum}");
        }

        #[test]
        fn slabs_hold_what_lies_between_their_levels(
            n in prop::array::uniform3(-1.0..1.0f64), level in -3.0..3.0f64, at in prop::array::uniform3(0.0..1.0f64),
        ) {
            let normal = DVec3::from(n).try_normalize().unwrap_or(DVec3::Z);
            let (made, slab) = (corners(normal, &DAffine3::IDENTITY), [level, level + 0.3]);
            let mut points = Vec::new();
            made.between(slab, &mut points);
            prop_assert!(points.iter().all(|p| normal.dot(*p) > slab[0] - 1e-9 && normal.dot(*p) < slab[1] + 1e-9));
            // A point of the slab is in no direction beyond all of its corners.
            let p = DVec3::from(at) * DVec3::new(1.0, 2.0, 3.0);
            if (slab[0]..slab[1]).contains(&normal.dot(p)) {
                for i in 0..60 {
                    let (s, c) = (f64::from(i) * 0.7).sin_cos();
                    let d = DVec3::new(s, c, (f64::from(i) * 1.3).sin());
                    prop_assert!(points.iter().any(|q| (*q - p).dot(d) > -1e-9));
                }
            }
        }
    }
}
