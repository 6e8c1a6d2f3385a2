//! Slices: a shape on planes, which have no thickness.
//!
//! Where a ray meets a plane inside the shape's stretches, ends included, the value is classified
//! once. A ray in a plane does not meet it.

use volact_core::{SliceStyle, Slices};

use super::{
    carried::{Carried, Cells, Part, Way, What},
    dd::Dd,
    hit::Hit,
    line::EPS,
    mark::{Mark, Stretches},
    medium::Voxels,
    mesh::distance,
    point::{self, Shade},
    prepare::{GridBody, Prepared},
    sight::{Crossing, Sight},
};
use std::cmp::Ordering;

/// Where a ray meets planes.
fn places(slices: &Slices, sight: &Sight) -> impl Iterator<Item = Mark> {
    slices.planes.iter().filter_map(|plane| match sight.object.meet(sight.anchor, plane.normal(), plane.offset()) {
        Crossing::Enter(mark) | Crossing::Leave(mark) => Some(mark),
        _ => None,
    })
}

/// A slice's hit from what is seen there.
fn hit(style: SliceStyle, mark: Mark, sure: bool, shade: &Shade) -> Hit {
    let alpha = if style == SliceStyle::Opaque { [1.0; 2] } else { shade.alpha };
    let made = Hit::new(mark, shade.color, alpha);
    if sure && !shade.doubt { made } else { made.doubtful() }
}

/// The hits of a volume's slices.
pub(super) fn of_grid(shape: &Prepared, body: &GridBody, sight: &Sight, left: &Stretches, hits: &mut Vec<Hit>) {
    let Some(slices) = &shape.slices else { return };
    let voxels = Voxels::new(&body.texture);
    let path = sight.object.mapped(&body.place.to_index);
    for mark in places(slices, sight) {
        let held = left.hold(&mark);
        if held == Some(false) {
            continue;
        }
        let t = mark.t.add(Dd::new(-sight.anchor));
        let at = [0, 1, 2].map(|a| {
            let (x, error) = path.coordinate(a, t);
            (x, error + mark.error * path.step[a].hi.abs())
        });
        if let Some((values, doubt)) = point::values(&shape.medium, &voxels, at) {
            hits.push(hit(
                slices.style,
                mark,
                held.is_some(),
                &point::shade(&shape.medium, &values, doubt, shape.brightest),
            ));
        }
    }
}

/// The hits of slices through what a mesh carries: of cells that overlap each has its own.
pub(super) fn of_cells(shape: &Prepared, cells: &Cells, sight: &Sight, way: &Way, hits: &mut Vec<Hit>) {
    let Some(slices) = &shape.slices else { return };
    for mark in places(slices, sight) {
        let held = |part: &&Part| {
            let order = [part.ends[0].compare(&mark), mark.compare(&part.ends[1])];
            order.iter().all(|o| o.is_none_or(Ordering::is_le))
        };
        for part in way.tracks.iter().filter_map(|track| track.iter().find(held)) {
            let sure = part.ends[0].compare(&mark).is_some() && mark.compare(&part.ends[1]).is_some();
            if let Some((values, doubt)) = values(shape, cells, part, &mark) {
                let shade = point::shade(&shape.medium, &values, doubt, shape.brightest);
                hits.push(hit(slices.style, mark, sure, &shade));
            }
        }
    }
}

/// Bounds on the fields at a place on a part of a mesh.
fn values(shape: &Prepared, cells: &Cells, part: &Part, mark: &Mark) -> Option<([[f64; 2]; 4], bool)> {
    let [start, end] = &part.ends;
    let (t, length) = (distance(start, mark), distance(start, end));
    let error = mark.error + start.error.max(end.error);
    match (&part.what, &cells.carried) {
        (What::Volume(line), Carried::Volume(volume)) => {
            let at = [0, 1, 2].map(|a| {
                let moved = Dd::product(line.step[a], t);
                (line.index[a].add(moved), line.dp[a] + error * line.step[a].abs())
            });
            point::values(&shape.medium, &Voxels::new(&volume.texture), at)
        }
        (What::Numbers(linear), _) => {
            let along = (t / length).clamp(0.0, 1.0);
            let loose = (error / length + 4.0 * EPS).min(1.0);
            let bounds = linear.each_ref().map(|l| {
                let [a, b] = l.values;
                if a == b && l.error == 0.0 {
                    return [a; 2];
                }
                let value = a + (b - a) * along;
                let wrong = l.error + (b - a).abs() * loose + 4.0 * EPS * a.abs().max(b.abs());
                [value - wrong, value + wrong]
            });
            Some((bounds, false))
        }
        _ => None,
    }
}
