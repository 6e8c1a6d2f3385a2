//! Floating-point numbers that shaders are evaluated in: `f32` for speed, `f64` for the reference.

use std::{
    fmt::Debug,
    ops::{Add, Div, Mul, Neg, Rem, Sub},
};

/// A floating-point type.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialEq
    + PartialOrd
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Rem<Output = Self>
    + Neg<Output = Self>
{
    /// The nearest number of the type.
    fn from_f64(value: f64) -> Self;
    /// The number, exactly.
    fn to_f64(self) -> f64;
    /// A number of a shader's text, exactly.
    fn from_f32(value: f32) -> Self;
    /// The nearest `f32`.
    fn to_f32(self) -> f32;
    /// The nearest number.
    fn from_i32(value: i32) -> Self;
    /// The nearest number.
    fn from_u32(value: u32) -> Self;
    /// Towards zero, clamped to the range; zero for NaN.
    fn to_i32(self) -> i32;
    /// Towards zero, clamped to the range; zero for NaN.
    fn to_u32(self) -> u32;
    /// All bits, by which constants are told apart.
    fn bits(self) -> u64;
    /// The one where all bits of the mask are set, the other where none is: without a branch, which
    /// keeps loops over rows from being vectorised.
    fn choose(mask: u32, accept: Self, reject: Self) -> Self;
    /// `self · 2^exponent`, rounded once.
    fn ldexp(self, exponent: i32) -> Self;
    /// The fraction of magnitude in [0.5, 1) and the exponent such that `fraction · 2^exponent`
    /// is the number; zero, infinities and NaN with exponent 0.
    fn frexp(self) -> (Self, i32);
    /// `self · factor + term`, rounded once.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// The angle of the point (x, self).
    fn atan2(self, x: Self) -> Self;
    /// `self` to a power.
    fn powf(self, power: Self) -> Self;
    /// `ln(1 + self)`, exact also near 0.
    fn ln_1p(self) -> Self;
    /// To the nearest whole number, halves to the even one.
    fn round_ties_even(self) -> Self;
    /// Magnitude.
    fn abs(self) -> Self;
    /// Largest whole number not above.
    fn floor(self) -> Self;
    /// Smallest whole number not below.
    fn ceil(self) -> Self;
    /// Whole number towards zero.
    fn trunc(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Sine of radians.
    fn sin(self) -> Self;
    /// Cosine of radians.
    fn cos(self) -> Self;
    /// Tangent of radians.
    fn tan(self) -> Self;
    /// Arc sine.
    fn asin(self) -> Self;
    /// Arc cosine.
    fn acos(self) -> Self;
    /// Arc tangent.
    fn atan(self) -> Self;
    /// Hyperbolic sine.
    fn sinh(self) -> Self;
    /// Hyperbolic cosine.
    fn cosh(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Inverse of the hyperbolic sine.
    fn asinh(self) -> Self;
    /// Inverse of the hyperbolic cosine.
    fn acosh(self) -> Self;
    /// Inverse of the hyperbolic tangent.
    fn atanh(self) -> Self;
    /// e to the power.
    fn exp(self) -> Self;
    /// Two to the power.
    fn exp2(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Logarithm to base two.
    fn log2(self) -> Self;
}

macro_rules! forward {
    ($($name:ident)*) => {
        $(#[inline(always)]
        fn $name(self) -> Self {
            Self::$name(self)
        })*
    };
}

macro_rules! real {
    ($t:ident, $bits:ident, $mantissa:literal, $bias:literal) => {
        impl Real for $t {
            forward!(ln_1p round_ties_even abs floor ceil trunc sqrt sin cos tan asin acos atan sinh cosh tanh asinh
                acosh atanh exp exp2 ln log2);

            #[inline(always)]
            fn from_f64(value: f64) -> Self {
                value as Self
            }

            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }

            #[inline(always)]
            fn from_f32(value: f32) -> Self {
                Self::from(value)
            }

            #[inline(always)]
            fn to_f32(self) -> f32 {
                self as f32
            }

            #[inline(always)]
            fn from_i32(value: i32) -> Self {
                value as Self
            }

            #[inline(always)]
            fn from_u32(value: u32) -> Self {
                value as Self
            }

            #[inline(always)]
            fn to_i32(self) -> i32 {
                self as i32
            }

            #[inline(always)]
            fn to_u32(self) -> u32 {
                self as u32
            }

            #[inline(always)]
            fn bits(self) -> u64 {
                u64::from(self.to_bits())
            }

            #[inline(always)]
            fn choose(mask: u32, accept: Self, reject: Self) -> Self {
                // A mask of the type's own width, by its sign.
                let mask = i64::from(mask as i32) as $bits;
                Self::from_bits((accept.to_bits() & mask) | (reject.to_bits() & !mask))
            }

            fn ldexp(self, exponent: i32) -> Self {
                // As musl's scalbn: a factor that could round to a subnormal number leaves a last
                // one below 2^-mantissa, so that what was rounded is lost altogether.
                let power = |e: i32| $t::from_bits((($bias + e) as $bits) << $mantissa);
                let (mut rest, mut x) = (exponent.clamp(-3 * $bias, 3 * $bias), self);
                while rest > $bias {
                    x *= power($bias);
                    rest -= $bias;
                }
                while rest < 1 - $bias {
                    x *= power(2 - $bias + $mantissa);
                    rest -= 2 - $bias + $mantissa;
                }
                x * power(rest)
            }

            fn frexp(self) -> (Self, i32) {
                if self == 0.0 || !self.is_finite() {
                    return (self, 0);
                }
                // Subnormal numbers are brought up first.
                let (scaled, shift) =
                    if self.abs() < $t::MIN_POSITIVE { (self * ((1u64 << 54) as $t), 54) } else { (self, 0) };
                let exponent = ((scaled.to_bits() >> $mantissa) & (2 * $bias + 1)) as i32 - ($bias - 1);
                (scaled.ldexp(-exponent), exponent - shift)
            }

            #[inline(always)]
            fn mul_add(self, factor: Self, term: Self) -> Self {
                Self::mul_add(self, factor, term)
            }

            #[inline(always)]
            fn atan2(self, x: Self) -> Self {
                Self::atan2(self, x)
            }

            #[inline(always)]
            fn powf(self, power: Self) -> Self {
                Self::powf(self, power)
            }
        }
    };
}

real!(f32, u32, 23, 127);
real!(f64, u64, 52, 1023);

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_number_is_its_fraction_and_exponent(x in any::<f32>(), y in any::<f64>()) {
            let (f, e) = x.frexp();
            prop_assert!(!(x.is_normal()) || (0.5..1.0).contains(&f.abs()), "{x} {f}");
            prop_assert!(x.is_nan() || f.ldexp(e).to_bits() == x.to_bits(), "{x} {f} {e}");
            let (f, e) = y.frexp();
            prop_assert!(y.is_nan() || f.ldexp(e).to_bits() == y.to_bits(), "{y} {f} {e}");
        }

        #[test]
        fn ldexp_rounds_once(x in any::<f32>(), e in -400i32..400) {
            // In f64 there is room for every intermediate result but the last.
            let expected = (f64::from(x) * 2f64.powi(e)) as f32;
            let found = Real::ldexp(x, e);
            prop_assert!(x.is_nan() || found.to_bits() == expected.to_bits(), "{x} {e}: {found} {expected}");
        }
    }
}
