//! Whether a table is too sharp for a sample distance and the data.
//!
//! At fixed places of the volume, the opacity and colour that a segment gets from the value in its
//! middle are compared with those of the value running linearly between its ends. The places and
//! directions depend on nothing but the data ROI, so that the answer does not flicker while the
//! camera moves.

use volact_core::{glam::DVec3, table::ResolvedTable};

use super::{
    classify::{SegmentTable, Units, segment},
    fetch::Voxels,
};

/// Places looked at.
const PLACES: usize = 4096;
/// Error of a pixel, as estimated, from which a shape is pre-integrated: a quarter of an 8-bit step.
const LIMIT: f64 = 0.25 / 255.0;

/// Estimates the error of a pixel from classifying at the middle of segments: the mean error of a
/// segment that can be seen adds up along a ray, the scatter by the square root.
pub fn estimate(
    voxels: &Voxels<'_>,
    table: &ResolvedTable,
    fine: &SegmentTable,
    units: Units,
    h: f64,
    step: DVec3,
) -> f64 {
    let size: [f64; 3] = std::array::from_fn(|a| (voxels.max[a] - voxels.min[a]) as f64);
    let mut seen = 0usize;
    let (mut square, mut visible_depth) = (0f64, 0f64);
    for n in 0..PLACES {
        // Additive recurrence with the plastic number in three dimensions (Roberts 2018).
        let at = |a: usize, g: f64| voxels.min[a] as f64 + (0.5 + g * (n + 1) as f64).fract() * size[a];
        let p = [at(0, 0.819_172_513_396_164_4), at(1, 0.671_043_606_703_789_2), at(2, 0.549_700_477_901_933_7)];
        let mut half = [0f64; 3];
        half[n % 3] = 0.5 * step[n % 3];
        let value = |s: f64| plain(voxels, std::array::from_fn(|a| p[a] + s * half[a]));
        let (front, middle, back) = (value(-1.0), value(0.0), value(1.0));
        if [front, middle, back].iter().any(|v| v.is_nan())
            || !fine.sees(front.min(back).min(middle), front.max(back).max(middle))
        {
            continue;
        }
        let post = segment(table.classify(units.data(f64::from(middle))), h);
        let exact = integrated(table, units, f64::from(front), f64::from(back), h);
        let error = (0..4).map(|c| (post[c] - exact[c]).powi(2)).fold(0.0, f64::max);
        square += error;
        visible_depth += exact[3];
        seen += 1;
    }
    if seen == 0 {
        return 0.0;
    }
    let rms = (square / seen as f64).sqrt();
    let mean_alpha = visible_depth / seen as f64;
    // As many segments of a ray as can be seen: those in the volume, but no more than are before
    // it is opaque.
    let along = size.iter().zip(step.to_array()).map(|(n, s)| n / s.max(1e-9)).fold(0.0, f64::max);
    let count = (along * seen as f64 / PLACES as f64).min(1.0 / mean_alpha.max(1e-9)).max(1.0);
    rms * count.sqrt()
}

/// A segment of linearly running value, by sixteen equal parts.
fn integrated(table: &ResolvedTable, units: Units, front: f64, back: f64, h: f64) -> [f64; 4] {
    const PARTS: usize = 16;
    let mut out = [0f64; 4];
    for i in 0..PARTS {
        let v = front + (back - front) * (i as f64 + 0.5) / PARTS as f64;
        let add = segment(table.classify(units.data(v)), h / PARTS as f64);
        let left = 1.0 - out[3];
        out = std::array::from_fn(|c| out[c] + left * add[c]);
    }
    out
}

/// Whether to pre-integrate for that estimate.
pub fn too_sharp(estimate: f64) -> bool {
    estimate > LIMIT
}

/// Trilinear interpolation at sample coordinates.
fn plain(voxels: &Voxels<'_>, at: [f64; 3]) -> f32 {
    let mut low = [0usize; 3];
    let mut next = [0usize; 3];
    let mut f = [0f32; 3];
    for a in 0..3 {
        let x = at[a].clamp(voxels.min[a] as f64, voxels.max[a] as f64);
        low[a] = (x as usize).min(voxels.max[a].saturating_sub(1)).max(voxels.min[a]);
        next[a] = (low[a] + 1).min(voxels.max[a]);
        f[a] = (x - low[a] as f64) as f32;
    }
    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
    let line = |y, z| mix(voxels.at(low[0], y, z), voxels.at(next[0], y, z), f[0]);
    let plane = |z| mix(line(low[1], z), line(next[1], z), f[1]);
    mix(plane(low[2]), plane(next[2]), f[2])
}
