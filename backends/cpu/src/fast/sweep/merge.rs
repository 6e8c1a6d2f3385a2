//! Puts together what several shapes add in the same segments, sixteen rays at once.
//!
//! Extinctions add, so that 1 − α = Π(1 − αᵢ) and the colour is the mean of the shapes' colours
//! weighted by −ln(1 − αᵢ). Where one shape alone can be seen its entry is taken as it is, to the
//! last bit: shapes that are skipped and shapes that are transparent leave no trace.
#![expect(unsafe_code, reason = "kernels of a vector unit")]
#![expect(clippy::needless_range_loop, reason = "a channel indexes several arrays")]

use super::gather::{Chunk, Row};
use crate::fast::{
    simd::{LANES, Simd},
    walk::ALL,
};
use volact_core::mutated;

/// What sixteen rays have seen so far.
#[derive(Clone, Debug)]
pub struct Sights {
    /// Premultiplied red, green, blue and opacity, by lane.
    pub color: [[f32; LANES]; 4],
    /// `t` at which the threshold is reached.
    pub depth: [f64; LANES],
    /// Lanes whose depth is known.
    pub reached: u32,
    /// The opacity at which depth is taken.
    pub threshold: f32,
}

/// The rows to add: `rows` of the chunk that begins with segment `first` of a lattice of `step`.
#[derive(Clone, Copy, Debug)]
pub struct Rows {
    /// First row, and one after the last.
    pub rows: [usize; 2],
    /// Lanes to add to.
    pub lanes: u32,
    /// The chunk's first segment.
    pub first: i64,
    /// The lattice's step.
    pub step: f64,
}

/// Shapes that are put together at once.
const GROUP: usize = 8;

/// Adds rows in order, but for `special` lanes in the last one.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn merge<S: Simd>(chunks: &[&Chunk], which: Rows, special: u32, sights: &mut Sights) {
    let [start, end] = which.rows;
    let visible = chunks.iter().fold(0, |all, c| all | c.rows);
    // SAFETY: the caller's promises.
    unsafe {
        let planes = &sights.color;
        let mut color = [S::load(&planes[0]), S::load(&planes[1]), S::load(&planes[2]), S::load(&planes[3])];
        for row in (start..end).filter(|row| visible >> row & 1 == 1) {
            let mut entry = [S::splat(0.0); 4];
            // Groups depend on nothing but the shapes, so that what is skipped changes no bit.
            for group in chunks.chunks(GROUP) {
                let mut rows = [None::<&Row>; GROUP];
                for (row_of, chunk) in rows.iter_mut().zip(group) {
                    if chunk.rows >> row & 1 == 1 {
                        *row_of = Some(&chunk.entries[row]);
                    }
                }
                entry = mixture::<S>(entry, &rows);
            }
            let lanes = which.lanes & if row + 1 == end { !special } else { ALL };
            let before = color[3];
            let left = S::sub(S::splat(1.0), before);
            for c in 0..4 {
                entry[c] = S::select(lanes, entry[c], S::splat(0.0));
                color[c] = S::fma(left, entry[c], color[c]);
            }
            let fresh = !S::lt_bits(color[3], S::splat(sights.threshold)) & !sights.reached & ALL;
            if fresh != 0 {
                let (mut opacity, mut alpha) = ([0f32; LANES], [0f32; LANES]);
                S::store(before, &mut opacity);
                S::store(entry[3], &mut alpha);
                sights.reach(fresh, &opacity, &alpha, (which.first + row as i64) as f64 * which.step, which.step);
            }
        }
        for (plane, have) in sights.color.iter_mut().zip(color) {
            S::store(have, plane);
        }
    }
}

impl Sights {
    fn reach(&mut self, lanes: u32, before: &[f32; LANES], alpha: &[f32; LANES], start: f64, step: f64) {
        self.reached |= lanes;
        for l in (0..LANES).filter(|l| lanes >> l & 1 == 1) {
            let part = crate::fast::over::part_of(before[l], alpha[l], self.threshold);
            self.depth[l] = start + step * f64::from(part);
        }
    }
}

/// What shapes add together to `first`, which is transparent unless there are many.
#[inline(always)]
unsafe fn mixture<S: Simd>(first: [S::F; 4], rows: &[Option<&Row>]) -> [S::F; 4] {
    const EACH: [i32; LANES] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
    // SAFETY: the caller's promises; a row holds sixteen entries.
    unsafe {
        let (zero, one) = (S::splat(0.0), S::splat(1.0));
        let mut sum = first;
        let mut left = S::sub(one, first[3]);
        // Lanes in which something was seen, and more than one thing.
        let mut some = S::lt_bits(zero, first[3]);
        let mut several = 0;
        for row in rows.iter().flatten() {
            let entry = S::rows(row.as_ptr().cast(), &EACH);
            let seen = S::lt_bits(zero, entry[3]);
            several |= some & seen;
            some |= seen;
            for c in 0..3 {
                sum[c] = S::add(sum[c], entry[c]);
            }
            // α + (1 − α)·αᵢ keeps the digits of thin ones.
            sum[3] = S::fma(left, entry[3], sum[3]);
            left = S::sub(one, sum[3]);
        }
        if several == 0 || mutated!("overlap_unweighted") {
            return sum;
        }
        let mut parts = Parts::<S> { mean: [zero; 3], weight: zero, solid: [zero; 4] };
        parts.add(first);
        for row in rows.iter().flatten() {
            parts.add(S::rows(row.as_ptr().cast(), &EACH));
        }
        let Parts { mean, weight, solid } = parts;
        let scale = S::div(sum[3], S::max(weight, S::splat(f32::MIN_POSITIVE)));
        let opaque = S::lt_bits(zero, solid[3]);
        let share = S::div(one, S::max(solid[3], one));
        for c in 0..3 {
            let mixed = S::select(opaque, S::mul(solid[c], share), S::mul(mean[c], scale));
            sum[c] = S::select(several, mixed, sum[c]);
        }
        sum[3] = S::select(opaque & several, one, sum[3]);
        sum
    }
}

/// What a mixture is made of.
struct Parts<S: Simd> {
    /// Colours weighted by −ln(1 − α), and the sum of weights.
    mean: [S::F; 3],
    weight: S::F,
    /// Colours of what is opaque, and how many there are.
    solid: [S::F; 4],
}

impl<S: Simd> Parts<S> {
    #[inline(always)]
    unsafe fn add(&mut self, entry: [S::F; 4]) {
        // SAFETY: the caller's promises.
        unsafe {
            let (zero, one) = (S::splat(0.0), S::splat(1.0));
            let factor = log_factor::<S>(entry[3]);
            let opaque = !S::lt_bits(entry[3], one) & ALL;
            for c in 0..3 {
                self.mean[c] = S::fma(factor, entry[c], self.mean[c]);
                self.solid[c] = S::add(self.solid[c], S::select(opaque, entry[c], zero));
            }
            self.weight = S::fma(factor, entry[3], self.weight);
            self.solid[3] = S::add(self.solid[3], S::select(opaque, one, zero));
        }
    }
}

/// −ln(1 − α)/α, which is 1 where α is 0; of any size where α is 1.
///
/// With u = 1 − α as rounded, ln(u)/(u − 1) is that to rounding (W. Kahan's trick); the logarithm
/// is twice the series of artanh((u − 1)/(u + 1)), after a power of two is taken out.
#[inline(always)]
unsafe fn log_factor<S: Simd>(alpha: S::F) -> S::F {
    // SAFETY: the caller's promises.
    unsafe {
        let one = S::splat(1.0);
        let u = S::max(S::sub(one, alpha), S::splat(1e-30));
        // The power of two that brings u between √½ and √2.
        let bits = S::as_int(u);
        let shifted = S::sub_int(bits, S::splat_int(std::f32::consts::FRAC_1_SQRT_2.to_bits() as i32));
        let power = S::sar::<23>(shifted);
        let m = S::as_float(S::sub_int(bits, S::shl::<23>(power)));
        let s = S::div(S::sub(m, one), S::add(m, one));
        let q = S::mul(s, s);
        let mut series = S::splat(2.0 / 9.0);
        for odd in [7.0f32, 5.0, 3.0, 1.0] {
            series = S::fma(series, q, S::splat(2.0 / odd));
        }
        // ln(m)/(m − 1) = 2·(…)/(m + 1) needs no difference of near numbers.
        let near = S::div(series, S::add(m, one));
        let power = S::to_float(power);
        let log = S::fma(power, S::splat(std::f32::consts::LN_2), S::mul(s, series));
        let far = S::div(log, S::sub(u, one));
        S::select(S::eq_bits(power, S::splat(0.0)), near, far)
    }
}
