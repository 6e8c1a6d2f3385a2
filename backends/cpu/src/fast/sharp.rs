//! Whether a table is too sharp for a sample distance and the data.
//!
//! At fixed places of the volume, what a segment adds by the value in its middle, and by values
//! running linearly between its ends, is compared with what it adds by the values along it: linear
//! from part to part, and each part by the [integral](super::integrals) of the table over its values,
//! so that no spike is too narrow to be seen. The places and directions depend on nothing but the data
//! ROI, so that the answer does not flicker while the camera moves.

use volact_core::{glam::DVec3, table::ResolvedTable};

use super::{
    classify::{SegmentTable, Units, segment},
    fetch::Voxels,
    integrals::Integrals,
    preintegrate::SegmentPairs,
};

/// Parts of a segment; an even number.
const PARTS: usize = 12;
/// Places looked at.
const PLACES: usize = 2048;
/// Error of a pixel, as estimated, from which a shape is pre-integrated: a quarter of an 8-bit step.
const LIMIT: f64 = 0.25 / 255.0;

/// Estimated errors of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Classified in the middle of segments.
    pub post: f64,
    /// Pre-integrated.
    pub pre: f64,
    /// The largest change of the number along a segment that can be seen.
    pub change: f64,
}

impl Estimate {
    /// Whether the error in the middle of segments matters.
    pub fn matters(self) -> bool {
        self.post > LIMIT
    }

    /// Whether pre-integration is better by more than the estimate's own uncertainty.
    pub fn helps(self) -> bool {
        self.pre < 0.8 * self.post
    }
}

/// Estimates the errors for segments of `h` unit distances and `step` samples along each axis;
/// that of pre-integration for the pairs given.
/// Errors of segments are taken as independent: they add up along a ray by the square root.
pub fn estimate(
    voxels: &Voxels<'_>,
    table: &ResolvedTable,
    (fine, pairs): (&SegmentTable, Option<&SegmentPairs>),
    units: Units,
    h: f64,
    step: DVec3,
) -> Estimate {
    let size: [f64; 3] = std::array::from_fn(|a| (voxels.max[a] - voxels.min[a]) as f64);
    let integrals = Integrals::of(table);
    let mut seen = 0usize;
    let (mut post, mut pre, mut opacity, mut change) = (0f64, 0f64, 0f64, 0f64);
    for n in 0..PLACES {
        // Additive recurrence with the plastic number in three dimensions (Roberts 2018).
        let at = |a: usize, g: f64| voxels.min[a] as f64 + (0.5 + g * (n + 1) as f64).fract() * size[a];
        let p = [at(0, 0.819_172_513_396_164_4), at(1, 0.671_043_606_703_789_2), at(2, 0.549_700_477_901_933_7)];
        let mut half = [0f64; 3];
        half[n % 3] = 0.5 * step[n % 3];
        let value = |s: f64| plain(voxels, std::array::from_fn(|a| p[a] + s * half[a]));
        let along: [f32; PARTS + 1] = std::array::from_fn(|i| value(2.0 * i as f64 / PARTS as f64 - 1.0));
        let (front, middle, back) = (along[0], along[PARTS / 2], along[PARTS]);
        let all = || along.iter().copied();
        let (lo, hi) = (all().fold(f32::INFINITY, f32::min), all().fold(f32::NEG_INFINITY, f32::max));
        if all().any(f32::is_nan) || !fine.sees(lo, hi) {
            continue;
        }
        let classify = |v: f64| table.classify(units.data(v));
        let ends = along.map(|v| integrals.end(units.data(f64::from(v))));
        let exact = composite(|i| integrals.mean(&ends[i], &ends[i + 1]), h);
        let linear = pairs.map_or([0.0; 4], |p| p.lookup(front, back).map(f64::from));
        let whole = segment(classify(f64::from(middle)), h);
        let error = |e: [f64; 4]| (0..4).map(|c| (e[c] - exact[c]).powi(2)).fold(0.0, f64::max);
        post += error(whole);
        pre += error(linear);
        opacity += exact[3];
        change = change.max(f64::from(hi) - f64::from(lo));
        seen += 1;
    }
    if seen == 0 {
        return Estimate::default();
    }
    // As many segments of a ray as can be seen: those in the volume, but no more than are before
    // it is opaque.
    let along = size.iter().zip(step.to_array()).map(|(n, s)| n / s.max(1e-9)).fold(0.0, f64::max);
    let opaque = seen as f64 / opacity.max(1e-9);
    let count = (along * seen as f64 / PLACES as f64).min(opaque).max(1.0);
    let pixel = |square: f64| (square / seen as f64 * count).sqrt();
    Estimate { post: pixel(post), pre: pixel(pre), change }
}

/// A segment of equal parts, each with its means of emission and extinction.
fn composite(density: impl Fn(usize) -> [f64; 4], h: f64) -> [f64; 4] {
    let mut out = [0f64; 4];
    for i in 0..PARTS {
        let [r, g, b, sigma] = density(i);
        let alpha = -(-sigma * h / PARTS as f64).exp_m1();
        let share = if sigma > 0.0 { (1.0 - out[3]) * alpha / sigma } else { 0.0 };
        out = [out[0] + share * r, out[1] + share * g, out[2] + share * b, out[3] + share * sigma];
    }
    out
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
