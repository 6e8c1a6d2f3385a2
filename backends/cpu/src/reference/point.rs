//! What a volume shows at a point, with bounds: for slices, which have no thickness.
//!
//! Sample coordinates are double-double. Where they lie in a face between cells to that precision
//! they are in it, and samples off the face have no weight. Where they are known less well, all
//! cells that may hold the point are looked at.

use super::{
    cubic,
    dd::Dd,
    line::EPS,
    medium::{Medium, Voxels},
};

/// A coordinate that is known better than this is in a face or off it.
const SHARP: f64 = 1e-20;

/// A coordinate that is known worse than this says nothing.
const VAGUE: f64 = 1e-3;

/// Bounds on colour and opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shade {
    pub color: [[f64; 2]; 3],
    pub alpha: [f64; 2],
    /// Whether a sample that may have weight is NaN, or the place is not known at all.
    pub doubt: bool,
}

/// Where a coordinate may lie along an axis.
struct Along {
    /// Cells, with the fraction in each, and 1 where it counts.
    cells: [(usize, f64, usize); 2],
    count: usize,
    error: f64,
}

/// Bounds on the fields at a point whose sample coordinates are given with bounds on their errors;
/// `None` where it is transparent. Tells whether that is in doubt.
pub(super) fn values(medium: &Medium, voxels: &Voxels<'_>, at: [(Dd, f64); 3]) -> Option<([[f64; 2]; 4], bool)> {
    if at.iter().any(|(_, error)| error.is_nan() || *error > VAGUE) {
        return Some(([[f64::NEG_INFINITY, f64::INFINITY]; 4], true));
    }
    let along = [0, 1, 2].map(|a| locate(at[a], [voxels.roi.min[a], voxels.roi.max[a]], voxels.nearest));
    let error: f64 = along.iter().map(|a| a.error).sum::<f64>() + 64.0 * EPS;
    let mut all = [[f64::INFINITY, f64::NEG_INFINITY]; 4];
    let (mut some, mut none) = (false, false);
    for number in 0..along.iter().map(|a| a.count).product() {
        let pick = [number % along[0].count, number / along[0].count % along[1].count];
        let pick = [pick[0], pick[1], number / (along[0].count * along[1].count)];
        let cell = [0, 1, 2].map(|a| along[a].cells[pick[a]]);
        let Some(corners) = medium.corners(voxels, cell.map(|c| c.0), cell.map(|c| c.2)) else {
            none = true;
            continue;
        };
        some = true;
        for (bounds, corner) in all.iter_mut().zip(&corners) {
            let [lo, hi] = corner.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| [a.min(v), b.max(v)]);
            let middle = cubic::along_line(&corner.map(|v| v - corner[0]), cell.map(|c| c.1), [0.0; 3])[0] + corner[0];
            let wrong = if lo == hi { 0.0 } else { error * (hi - lo) + 4.0 * EPS * lo.abs().max(hi.abs()) };
            *bounds = [bounds[0].min(middle - wrong), bounds[1].max(middle + wrong)];
        }
    }
    some.then_some((all, none))
}

/// Classifies bounds on the fields.
pub(super) fn shade(medium: &Medium, values: &[[f64; 2]; 4], doubt: bool, brightest: f64) -> Shade {
    let mut channels = [[0.0; 2], [0.0; 2], [0.0; 2], [1.0; 2]];
    for (field, [lo, hi]) in medium.fields.iter().zip(values) {
        let bounds = field.knots.bounds(*lo, *hi);
        // A constant channel has its numbers to the bit; others a few roundings.
        let number = field.knots.segment_of(*lo);
        let flat = |c: usize| number == field.knots.segment_of(*hi) && field.knots.segment(number).slope[c] == 0.0;
        for c in (0..4).filter(|&c| field.drives[c]) {
            let size = if c < 3 { brightest } else { 1.0 };
            let round = if flat(c) { 0.0 } else { 8.0 * EPS * size };
            channels[c] = [(bounds[c][0] - round).max(0.0), (bounds[c][1] + round).min(size)];
        }
    }
    let [r, g, b, alpha] = channels;
    Shade { color: [r, g, b], alpha, doubt }
}

fn locate((x, error): (Dd, f64), roi: [usize; 2], nearest: bool) -> Along {
    let [lo, hi] = roi.map(|v| v as f64);
    let one = |cell| Along { cells: [cell; 2], count: 1, error };
    if nearest {
        let sample = |e: f64| (x.add(Dd::new(0.5 + e)).hi.floor().clamp(lo, hi)) as usize;
        // On the border to double-double precision it is the upper one.
        let [a, b] = if error <= SHARP {
            [upper(x.add(Dd::new(0.5)), error, lo, hi); 2]
        } else {
            [sample(-error), sample(error)]
        };
        return Along { cells: [(a, 0.0, 0), (b, 0.0, 0)], count: if a == b { 1 } else { 2 }, error: 0.0 };
    }
    if roi[0] == roi[1] || x.minus(lo) <= error.min(SHARP) {
        return one((roi[0], 0.0, 0));
    }
    if x.minus(hi) >= -error.min(SHARP) {
        return one((roi[1], 0.0, 0));
    }
    let base = upper(x, error, lo, hi - 1.0);
    let from = x.minus(base as f64);
    let mut made = one((base, from.clamp(0.0, 1.0), 1));
    if error <= SHARP {
        return if from.abs() <= error { one((base, 0.0, 0)) } else { made };
    }
    if from < error && base > roi[0] {
        (made.cells[1], made.count) = ((base - 1, 1.0, 1), 2);
    } else if 1.0 - from < error && base + 1 < roi[1] {
        (made.cells[1], made.count) = ((base + 1, 0.0, 1), 2);
    }
    made
}

/// The whole number below a coordinate, or the one that it is to its precision.
fn upper(x: Dd, error: f64, lo: f64, hi: f64) -> usize {
    let near = x.hi.round();
    let whole = if x.minus(near).abs() <= error.min(SHARP) || x.minus(near) > 0.0 { near } else { near - 1.0 };
    whole.clamp(lo, hi) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_are_located_in_cells_and_faces() {
        let at = |hi: f64, lo: f64, error: f64| {
            let made = locate((Dd { hi, lo }, error), [2, 6], false);
            made.cells[..made.count].to_vec()
        };
        assert_eq!(at(3.25, 0.0, 1e-30), [(3, 0.25, 1)]);
        assert_eq!(at(4.0, 1e-32, 1e-30), [(4, 0.0, 0)]);
        assert_eq!(at(4.0, -1e-28, 1e-30), [(3, 1.0, 1)]);
        assert_eq!(at(6.0, 1e-28, 1e-30), [(6, 0.0, 0)]);
        assert_eq!(at(1.5, 0.0, 1e-30), [(2, 0.0, 0)]);
        assert_eq!(at(4.0, 0.0, 1e-9), [(4, 0.0, 1), (3, 1.0, 1)]);
        let nearest = |x: f64, error: f64| locate((Dd::new(x), error), [2, 6], true);
        assert_eq!((nearest(3.5, 1e-30).cells[0].0, nearest(3.5, 1e-30).count), (4, 1));
        assert_eq!((nearest(3.5, 1e-9).count, nearest(9.0, 1e-30).cells[0].0), (2, 6));
    }
}
