//! What a slab of a block covers in the picture: the convex hull of its corners.
//!
//! A hull need only cover: each of its fragments cuts its own segment, which is empty beside the
//! slab. So it is grown by a margin, and faces that are seen edge-on, where the rasteriser's rule
//! and that of rays differ, are decided by rays alone.

use glam::{DVec2, DVec3};

use super::view::PixelMap;

/// By how much hulls are grown, in pixels: enough for positions in f32.
pub const MARGIN: f64 = 1.0 / 64.0;

/// Writes the hull of points in world space, clipped to the viewport, in pixels and in order around.
/// Where a point lies beside or behind the eye it is the whole viewport.
pub fn hull(map: &PixelMap, points: &[DVec3], out: &mut Vec<DVec2>) {
    out.clear();
    let rim = [DVec2::splat(-1.0), map.size() + 1.0];
    if points.is_empty() {
        return;
    }
    let places = points.iter().map(|p| map.homogeneous(*p));
    let [low, high] = places.clone().fold([f64::INFINITY, 0.0f64], |[a, b], p| [a.min(p.z), b.max(p.z)]);
    if !(low > 1e-9 * high && places.clone().all(|p| p.is_finite())) {
        out.extend([rim[0], DVec2::new(rim[1].x, rim[0].y), rim[1], DVec2::new(rim[0].x, rim[1].y)]);
        return;
    }
    out.extend(places.map(|p| p.truncate() / p.z));
    around(out);
    let count = out.len();
    for i in 0..count {
        let p = out[i];
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
        out.extend(corners.map(|c| p + MARGIN * DVec2::from(c)));
    }
    out.drain(..count);
    around(out);
    for axis in 0..2 {
        keep(out, |p| p[axis] - rim[0][axis]);
        keep(out, |p| rim[1][axis] - p[axis]);
    }
}

/// Leaves the corners of the convex hull, counterclockwise where y points up (A. M. Andrew, *Another
/// efficient algorithm for convex hulls in two dimensions*, 1979).
fn around(points: &mut Vec<DVec2>) {
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return;
    }
    let turns = |a: DVec2, b: DVec2, c: DVec2| (b - a).perp_dot(c - a) > 0.0;
    let mut chain: Vec<DVec2> = Vec::with_capacity(points.len() + 1);
    let mut link = |along: &mut dyn Iterator<Item = &DVec2>| {
        let start = chain.len();
        for &p in along {
            while chain.len() >= start + 2 && !turns(chain[chain.len() - 2], chain[chain.len() - 1], p) {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
    };
    link(&mut points.iter());
    link(&mut points.iter().rev());
    points.clear();
    points.append(&mut chain);
}

/// Leaves the part of a convex polygon where `distance` is not negative.
fn keep(polygon: &mut Vec<DVec2>, distance: impl Fn(DVec2) -> f64) {
    if polygon.iter().all(|p| distance(*p) >= 0.0) {
        return;
    }
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (da, db) = (distance(a), distance(b));
        if da >= 0.0 {
            kept.push(a);
        }
        if (da >= 0.0) != (db >= 0.0) {
            kept.push(a + (b - a) * (da / (da - db)));
        }
    }
    *polygon = kept;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Viewport};
    use proptest::prelude::*;

    fn map() -> PixelMap {
        let viewport = Viewport { x: 0, y: 0, width: 64, height: 48 };
        let rays = Camera::perspective(DVec3::NEG_Y * 4.0, DVec3::ZERO, DVec3::Z, 40.0).rays(&viewport).unwrap();
        PixelMap::new(&rays, &viewport).unwrap()
    }

    proptest! {
        #[test]
        fn hulls_hold_all_points_and_are_convex(points in prop::collection::vec(prop::array::uniform3(-2.0..2.0f64), 1..24)) {
            let points: Vec<DVec3> = points.into_iter().map(DVec3::from).collect();
            let (map, mut out) = (map(), Vec::new());
            hull(&map, &points, &mut out);
            let inside = |p: DVec2| (0..out.len()).all(|i| {
                let (a, b) = (out[i], out[(i + 1) % out.len()]);
                (b - a).perp_dot(p - a) >= -1e-9
            });
            let seen = |p: &DVec2| p.cmpge(DVec2::ZERO).all() && p.cmple(map.size()).all();
            let pixels: Vec<DVec2> = points.iter().filter_map(|p| map.pixel(*p)).collect();
            for p in pixels.iter().filter(|p| seen(p)) {
                prop_assert!(out.len() >= 3 && inside(*p), "{p} {out:?}");
            }
            // Convex: each corner lies on the inner side of all edges.
            prop_assert!(out.iter().all(|p| inside(*p)), "{out:?}");
            // A convex combination of points in the picture is covered, too.
            for p in pixels.iter().filter(|p| seen(p)) {
                for q in pixels.iter().filter(|q| seen(q)) {
                    prop_assert!(inside(p.midpoint(*q)));
                }
            }
        }
    }

    #[test]
    fn points_behind_the_eye_cover_everything() {
        let mut out = Vec::new();
        hull(&map(), &[DVec3::ZERO, DVec3::NEG_Y * 5.0, DVec3::ONE], &mut out);
        assert_eq!(out.len(), 4);
        hull(&map(), &[DVec3::splat(f64::NAN)], &mut out);
        assert_eq!(out.len(), 4);
        hull(&map(), &[], &mut out);
        assert!(out.is_empty());
    }

    #[test]
    fn a_point_alone_covers_its_margin() {
        let mut out = Vec::new();
        hull(&map(), &[DVec3::ZERO], &mut out);
        assert_eq!(out.len(), 4);
        assert!((out[0] - DVec2::new(32.0, 24.0)).length() < 2.0 * MARGIN);
        hull(&map(), &[DVec3::X * 50.0], &mut out);
        assert!(out.is_empty(), "{out:?}");
    }
}
