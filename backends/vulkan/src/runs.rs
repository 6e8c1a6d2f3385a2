//! Runs: slabs of one shape, one behind the other, between which no other shape comes.

use bytemuck::{Pod, Zeroable};
use volact_core::{
    glam::DVec2,
    slicing::{Order, Slicing},
};

use crate::stream::Polygon;

/// Rays may end where slabs of these numbers begin, and so do runs.
const WHOLE: i64 = 32;

/// Slabs of one shape.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Run {
    shape: usize,
    first: i64,
    end: i64,
    levels: [f64; 2],
}

/// A corner of a run's polygon, as the vertex stage reads it.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Corner {
    place: [f32; 2],
    /// The shape, its first slab, and the one after its last.
    run: [i32; 3],
    rest: f32,
}

/// The runs of a plan from front to back, as polygons of corners. Slabs are counted from `base`; `rest`
/// is where that one begins, seen from the anchor.
pub fn corners(slicing: &Slicing<'_>, base: i64, rest: f64) -> (Vec<Corner>, Vec<Polygon>) {
    let size = slicing.pixel_map().size();
    let (mut all, mut polygons, mut hull) = (Vec::new(), Vec::new(), Vec::new());
    for run in runs(slicing) {
        slicing.cover(run.shape, run.levels, &mut hull);
        if hull.len() < 3 {
            continue;
        }
        polygons.push(Polygon { first: all.len() as u32, count: hull.len() as u32 });
        let numbers = [run.shape as i32, (run.first - base) as i32, (run.end - base) as i32];
        all.extend(hull.iter().map(|p| {
            let place = 2.0 * *p / size - DVec2::ONE;
            Corner { place: place.as_vec2().to_array(), run: numbers, rest: rest as f32 }
        }));
    }
    (all, polygons)
}

fn runs(slicing: &Slicing<'_>) -> Vec<Run> {
    let mut made: Vec<Run> = Vec::new();
    let mut sweep = slicing.sweep(Order::FrontToBack);
    while let Some(slice) = sweep.next_slice() {
        let (shape, number) = (slice.shape, slice.number);
        match made.last_mut() {
            Some(run) if run.shape == shape && run.end == number && number % WHOLE != 0 => {
                run.end += 1;
                run.levels[1] = slice.slab[1];
            }
            _ => made.push(Run { shape, first: number, end: number + 1, levels: slice.slab }),
        }
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{
        Appearance, FrameDesc, Registry, ScalarType, Shape, View, Volume, VolumeDesc,
        glam::{DAffine3, DVec3},
        resolve::ResolvedShape,
        slicing::{Rate, Sampling, Solid},
    };

    fn solids(shifts: &[DVec3]) -> (Vec<Solid>, FrameDesc) {
        let volume = Volume::new(VolumeDesc::new([9; 3], ScalarType::U8, 1), vec![0u8; 729]).unwrap();
        let shape = |shift: &DVec3| {
            let shape = Shape::around(&volume, Appearance::new("simple"));
            shape.set_transform(DAffine3::from_translation(*shift));
            shape
        };
        let shapes: Vec<Shape> = shifts.iter().map(shape).collect();
        let frame = FrameDesc::fit_all(&shapes, View::Iso, 64, 48);
        let registry = Registry::with_core();
        let solid = |s: &Shape| {
            let resolved = ResolvedShape::new(s, registry.shaders()).unwrap();
            Solid::new(&resolved, None).unwrap().unwrap()
        };
        (shapes.iter().map(solid).collect(), frame)
    }

    #[test]
    fn runs_of_one_shape_end_where_rays_may() {
        let (solids, frame) = solids(&[DVec3::ZERO]);
        let sampling = Sampling { rate: Rate::Distance(0.1), ..Sampling::default() };
        let slicing = Slicing::new(solids.iter().collect(), &frame, &sampling).unwrap();
        let all = runs(&slicing);
        assert!(all.windows(2).all(|r| r[0].end == r[1].first && r[1].first % WHOLE == 0));
        let slabs: i64 = all.iter().map(|r| r.end - r.first).sum();
        assert_eq!(slabs as usize, slicing.step().planes);
        let (corners, polygons) = corners(&slicing, 64, 0.25);
        assert_eq!(polygons.len(), all.len());
        assert!(corners.iter().all(|c| c.place.iter().all(|v| v.abs() < 1.1) && c.rest == 0.25));
        assert_eq!(i64::from(corners[0].run[1]), all[0].first - 64);
    }

    #[test]
    fn shapes_that_overlap_take_turns() {
        let (solids, frame) = solids(&[DVec3::ZERO, DVec3::splat(0.4)]);
        let sampling = Sampling { rate: Rate::Distance(0.1), ..Sampling::default() };
        let slicing = Slicing::new(solids.iter().collect(), &frame, &sampling).unwrap();
        let all = runs(&slicing);
        assert!(all.len() > 50 && all.windows(2).filter(|r| r[0].shape != r[1].shape).count() > 50);
        for shape in 0..2 {
            let own: Vec<&Run> = all.iter().filter(|r| r.shape == shape).collect();
            assert!(own.windows(2).all(|r| r[0].end == r[1].first));
        }
    }
}
