//! From extinction to the opacity of a length, sixteen at once.
#![expect(unsafe_code, reason = "a kernel of a vector unit")]

use crate::fast::{
    simd::{LANES, Simd},
    sweep::gather::Row,
};

/// Premultiplied colour and opacity of a `length` of sixteen media: red, green, blue and
/// extinction by lane. Nothing where any of it is NaN, or the extinction not positive.
///
/// α = 1 − e^(−σ·length), as −2ⁿ·(e^r − 1) − (2ⁿ − 1) with −σ·length = n·ln 2 + r, so that small
/// opacities keep their digits; e^r − 1 by Taylor's series to r⁷, to 1e-8 for |r| ≤ ln 2 / 2.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn absorb<S: Simd>(medium: &[&[f32; LANES]; 4], length: f64, out: &mut Row) {
    // SAFETY: the caller's promise.
    unsafe {
        let [r, g, b, sigma] = medium.map(|row| S::load(row));
        let unknown = S::nan_bits(S::add(S::add(r, g), S::add(b, sigma)));
        // `inf − inf` is NaN, too, but colours are not infinite where they can be seen.
        let depth = S::mul(sigma, S::splat(length as f32));
        let seen = S::lt_bits(S::splat(0.0), depth) & !unknown;
        if seen == 0 {
            *out = [[0.0; 4]; LANES];
            return;
        }
        // Beyond, nothing is left in f32.
        let y = S::sub(S::splat(0.0), S::min(depth, S::splat(80.0)));
        let n = S::floor(S::fma(y, S::splat(std::f32::consts::LOG2_E), S::splat(0.5)));
        let rest = S::fma(n, S::splat(-0.693_359_4), y);
        let rest = S::fma(n, S::splat(2.121_944_4e-4), rest);
        let mut series = S::splat(1.0 / 5040.0);
        for factorial in [720.0, 120.0, 24.0, 6.0, 2.0] {
            series = S::fma(series, rest, S::splat(1.0 / factorial));
        }
        let less = S::fma(S::mul(rest, rest), series, rest);
        let power = S::as_float(S::shl::<23>(S::add_int(S::to_int(n), S::splat_int(127))));
        let alpha = S::sub(S::sub(S::splat(1.0), power), S::mul(power, less));
        let alpha = S::select(seen, alpha, S::splat(0.0));
        let mut rows = [[0f32; LANES]; 4];
        for (row, c) in rows.iter_mut().zip([r, g, b]) {
            S::store(S::select(seen, S::mul(c, alpha), S::splat(0.0)), row);
        }
        S::store(alpha, &mut rows[3]);
        for (l, entry) in out.iter_mut().enumerate() {
            *entry = [rows[0][l], rows[1][l], rows[2][l], rows[3][l]];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fast::{dispatch, simd::Unit};

    #[test]
    fn opacities_are_those_of_lengths() {
        let depths = [0.0, 1e-30, 1e-7, 1e-4, 0.01, 0.2, 0.34, 0.35, 0.69, 0.7, 1.0, 3.0, 16.0, 90.0, 1e30, f32::INFINITY];
        for unit in [Unit::Plain, Unit::Avx2, Unit::Avx512].into_iter().filter(|u| u.available()) {
            for length in [1.0, 0.37, 1e4] {
                let sigma = depths.map(|d| (f64::from(d) / length) as f32);
                let colors = [[0.5; LANES], [1.0; LANES], [0.0; LANES]];
                let mut out = [[0.0; 4]; LANES];
                dispatch::absorb(unit, &[&colors[0], &colors[1], &colors[2], &sigma], length, &mut out);
                for (found, sigma) in out.iter().zip(sigma) {
                    let wanted = -(-f64::from(sigma) * length).exp_m1();
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
