//! From extinction to the opacity of a length, sixteen at once.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use super::field::sixteen;
use crate::fast::{
    power::exp_parts,
    simd::{LANES, Simd},
    sweep::gather::Row,
};

/// Opacities of lengths of sixteen media, and in which lanes there is something: nowhere that a
/// number is NaN, or the extinction not positive.
///
/// α = 1 − e^(−σ·length), as −2ⁿ·(e^r − 1) − (2ⁿ − 1) with −σ·length = n·ln 2 + r, so that small
/// opacities keep their digits.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
unsafe fn opacity<S: Simd>([r, g, b, sigma]: [S::F; 4], length: S::F) -> (S::F, u32) {
    // SAFETY: the caller's promise.
    unsafe {
        let zero = S::splat(0.0);
        // `inf − inf` is NaN, too, but colours are not infinite where they can be seen.
        let unknown = S::nan_bits(S::add(S::add(r, g), S::add(b, sigma)));
        let depth = S::mul(sigma, length);
        let seen = S::lt_bits(zero, depth) & !unknown;
        // Beyond, nothing is left in f32.
        let y = S::sub(zero, S::min(depth, S::splat(80.0)));
        let (power, less) = exp_parts::<S>(y);
        let alpha = S::sub(S::sub(S::splat(1.0), power), S::mul(power, less));
        (S::select(seen, alpha, zero), seen)
    }
}

/// Premultiplied colour and opacity of a `length` of sixteen media: red, green, blue and
/// extinction by lane.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn absorb<S: Simd>(medium: &[&[f32; LANES]; 4], length: f32, out: &mut Row) {
    // SAFETY: the caller's promise.
    unsafe {
        let medium = [S::load(medium[0]), S::load(medium[1]), S::load(medium[2]), S::load(medium[3])];
        let (alpha, seen) = opacity::<S>(medium, S::splat(length));
        if seen == 0 {
            *out = [[0.0; 4]; LANES];
            return;
        }
        let mut rows = [[0f32; LANES]; 4];
        for c in 0..3 {
            S::store(S::select(seen, S::mul(medium[c], alpha), S::splat(0.0)), &mut rows[c]);
        }
        S::store(alpha, &mut rows[3]);
        for (l, entry) in out.iter_mut().enumerate() {
            *entry = [rows[0][l], rows[1][l], rows[2][l], rows[3][l]];
        }
    }
}

/// Lays rows of media, front to back, behind what sixteen rays have seen: premultiplied colour and
/// opacity by number and lane. Rows are given by the lanes that count and by lengths: one of each
/// row, or one of all. `alphas` takes the rows' opacities.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn composite<S: Simd>(
    live: &[u32],
    lengths: &[[f32; LANES]],
    medium: &[&[f32]; 4],
    seen: &mut [[f32; LANES]; 4],
    alphas: &mut [[f32; LANES]],
) {
    // SAFETY: the caller's promise.
    unsafe {
        let (zero, one) = (S::splat(0.0), S::splat(1.0));
        let mut sum = [S::load(&seen[0]), S::load(&seen[1]), S::load(&seen[2]), S::load(&seen[3])];
        let each = usize::from(lengths.len() > 1);
        for (i, (live, kept)) in live.iter().zip(alphas).enumerate() {
            let mut numbers = [zero; 4];
            for c in 0..4 {
                numbers[c] = S::load(sixteen(medium[c], i * LANES));
            }
            let (alpha, some) = opacity::<S>(numbers, S::load(&lengths[i * each]));
            let some = some & live;
            let alpha = S::select(some, alpha, zero);
            S::store(alpha, kept);
            let weight = S::mul(S::sub(one, sum[3]), alpha);
            for c in 0..3 {
                sum[c] = S::fma(weight, S::select(some, numbers[c], zero), sum[c]);
            }
            sum[3] = S::add(sum[3], weight);
        }
        for c in 0..4 {
            S::store(sum[c], &mut seen[c]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fast::{dispatch, simd::Unit};

    #[test]
    fn opacities_are_those_of_lengths() {
        let depths =
            [0.0, 1e-30, 1e-7, 1e-4, 0.01, 0.2, 0.34, 0.35, 0.69, 0.7, 1.0, 3.0, 16.0, 90.0, 1e30, f32::INFINITY];
        for unit in [Unit::Plain, Unit::Avx2, Unit::Avx512].into_iter().filter(|u| u.available()) {
            for length in [1.0, 0.37, 1e4] {
                let sigma = depths.map(|d| d / length);
                let colors = [[0.5; LANES], [1.0; LANES], [0.0; LANES]];
                let mut out = [[0.0; 4]; LANES];
                dispatch::absorb(unit, &[&colors[0], &colors[1], &colors[2], &sigma], length, &mut out);
                for (found, sigma) in out.iter().zip(sigma) {
                    let wanted = -(-f64::from(sigma) * f64::from(length)).exp_m1();
                    let error = (f64::from(found[3]) - wanted).abs();
                    assert!(error <= 3e-7 * wanted, "{unit:?}: {sigma} over {length}: {}, wanted {wanted}", found[3]);
                    assert_eq!((found[0], found[1], found[2]), (0.5 * found[3], found[3], 0.0));
                }
            }
            let bad = [[f32::NAN; LANES], [1.0; LANES], [-1.0; LANES]];
            for (color, sigma) in [(0, 1), (1, 0), (1, 2)] {
                let mut out = [[9.0; 4]; LANES];
                dispatch::absorb(unit, &[&bad[color], &bad[1], &bad[1], &bad[sigma]], 1.0, &mut out);
                assert_eq!(out, [[0.0; 4]; LANES]);
            }
        }
    }
}
