//! Logarithms, exponentials and powers of sixteen numbers.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use super::simd::Simd;

/// The natural logarithm of positive, normal numbers.
///
/// Cephes' polynomial (S. Moshier, `logf`) on a number between √½ and √2, times a power of two; to
/// `add` more near 1, before what is rounded there.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn log<S: Simd>(u: S::F, add: S::F) -> S::F {
    const SERIES: [f32; 9] = [
        7.037_683_6e-2,
        -1.151_461e-1,
        1.167_699_8e-1,
        -1.242_014_1e-1,
        1.424_932_3e-1,
        -1.666_805_8e-1,
        2.000_071_4e-1,
        -2.499_999_4e-1,
        3.333_333e-1,
    ];
    // SAFETY: the caller's promise.
    unsafe {
        let half = S::splat_int(std::f32::consts::FRAC_1_SQRT_2.to_bits() as i32);
        let power = S::sar::<23>(S::sub_int(S::as_int(u), half));
        let m = S::as_float(S::sub_int(S::as_int(u), S::shl::<23>(power)));
        let (f, e) = (S::sub(m, S::splat(1.0)), S::to_float(power));
        let mut series = S::splat(SERIES[0]);
        for c in &SERIES[1..] {
            series = S::fma(series, f, S::splat(*c));
        }
        let square = S::mul(f, f);
        let mut log = S::mul(S::mul(square, f), series);
        log = S::fma(e, S::splat(-2.121_944_4e-4), log);
        log = S::fma(S::splat(-0.5), square, log);
        log = S::add(f, S::add(log, add));
        S::fma(e, S::splat(0.693_359_4), log)
    }
}

/// e^y − 1 = 2ⁿ·(less + 1) − 1 for y between −87 and 88: 2ⁿ and `less` = e^r − 1 with y = n·ln 2 + r, by
/// Taylor's series to r⁷, to 1e-8 for |r| ≤ ln 2 / 2.
///
/// # Safety
/// As [`log()`].
#[inline(always)]
pub unsafe fn exp_parts<S: Simd>(y: S::F) -> (S::F, S::F) {
    // SAFETY: the caller's promise.
    unsafe {
        let n = S::floor(S::fma(y, S::splat(std::f32::consts::LOG2_E), S::splat(0.5)));
        let rest = S::fma(n, S::splat(-0.693_359_4), y);
        let rest = S::fma(n, S::splat(2.121_944_4e-4), rest);
        let mut series = S::splat(1.0 / 5040.0);
        for factorial in [720.0, 120.0, 24.0, 6.0, 2.0] {
            series = S::fma(series, rest, S::splat(1.0 / factorial));
        }
        let less = S::fma(S::mul(rest, rest), series, rest);
        (S::as_float(S::shl::<23>(S::add_int(S::to_int(n), S::splat_int(127)))), less)
    }
}

/// Numbers of 0 to 1 to a power that is not negative: e^(y·ln x); 0⁰ = 1.
///
/// # Safety
/// As [`log()`].
#[inline(always)]
pub unsafe fn power<S: Simd>(x: S::F, exponent: f32) -> S::F {
    // SAFETY: the caller's promise; what is too small to be seen is not taken further down.
    unsafe {
        let least = S::splat(f32::MIN_POSITIVE);
        let y = S::mul(S::splat(exponent), log::<S>(S::max(x, least), S::splat(0.0)));
        let (power, less) = exp_parts::<S>(S::max(y, S::splat(-87.0)));
        let zero = S::lt_bits(x, least);
        S::select(zero, S::splat(if exponent == 0.0 { 1.0 } else { 0.0 }), S::fma(power, less, power))
    }
}

#[cfg(test)]
mod tests {
    use crate::fast::{
        dispatch,
        simd::{LANES, Unit},
    };

    #[test]
    fn powers_are_those_of_f64() {
        let numbers: [f32; LANES] =
            [0.0, 1e-40, 1e-30, 1e-9, 1e-3, 0.1, 0.3, 0.5, 0.7, 0.71, 0.9, 0.99, 0.9999, 0.999_999, 1.0, 0.25];
        for unit in [Unit::Plain, Unit::Avx2, Unit::Avx512].into_iter().filter(|u| u.available()) {
            for exponent in [0.0, 0.3, 1.0, 10.0, 64.0, 300.0] {
                let mut found = [0f32; LANES];
                dispatch::power(unit, &numbers, exponent, &mut found);
                for (x, found) in numbers.iter().zip(found) {
                    let wanted = f64::from(*x).powf(f64::from(exponent));
                    let error = (f64::from(found) - wanted).abs();
                    assert!(error < 4e-6 * wanted + 1e-12, "{unit:?}: {x}^{exponent} = {found}, wanted {wanted}");
                }
            }
        }
    }
}
