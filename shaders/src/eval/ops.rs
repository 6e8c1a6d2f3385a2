//! What each instruction does to one number: WGSL's semantics, with every case defined.
//!
//! Integers wrap; `x / 0` is `x` and `x % 0` is 0, as are the quotients that overflow; shifts take
//! the amount modulo 32; conversions to integers clamp, NaN to 0 (WGSL, "Arithmetic expressions",
//! "Bit expressions", "Conversion expressions"). Truth values are all bits set, or none.

use super::real::Real;

/// Truth as a number.
pub const TRUE: u32 = u32::MAX;

/// Truth as a number.
#[inline(always)]
pub fn truth(value: bool) -> u32 {
    u32::from(value).wrapping_neg()
}

macro_rules! operations {
    ($(#[$doc:meta])* $name:ident { $($op:ident),* $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[expect(missing_docs, reason = "WGSL's names")]
        pub enum $name {
            $($op),*
        }

        impl $name {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$op),*];
        }
    };
}

operations! {
    /// From a float to a float.
    Float1 {
        Negate, Abs, Floor, Ceil, Round, Trunc, Fract, Sqrt, InverseSqrt, Sin, Cos, Tan, Asin, Acos, Atan, Sinh,
        Cosh, Tanh, Asinh, Acosh, Atanh, Exp, Exp2, Log, Log2, Sign, Saturate, Radians, Degrees, Frexp, Absorption,
    }
}

operations! {
    /// From two floats to a float.
    Float2 { Add, Subtract, Multiply, Divide, Remainder, Min, Max, Pow, Atan2, Step }
}

operations! {
    /// From three floats to a float.
    Float3 { Fma, Clamp, Mix, SmoothStep }
}

operations! {
    /// From an integer or a truth value to one.
    Bits1 {
        Negate, Not, Abs, Sign, CountOnes, LeadingZeros, TrailingZeros, Reverse, FirstLeadingSigned,
        FirstLeadingUnsigned, FirstTrailing,
    }
}

operations! {
    /// From two integers or truth values to one. Comparisons give truth values.
    Bits2 {
        Add, Subtract, Multiply, DivideSigned, DivideUnsigned, RemainderSigned, RemainderUnsigned, And, Or, Xor,
        AndNot, ShiftLeft, ShiftRightSigned, ShiftRightUnsigned, MinSigned, MaxSigned, MinUnsigned, MaxUnsigned,
        Equal, NotEqual, LessSigned, LessUnsigned, LessEqualSigned, LessEqualUnsigned, FieldMask,
    }
}

operations! {
    /// From three integers to one.
    Bits3 { ExtractSigned, ExtractUnsigned }
}

operations! {
    /// From two floats to a truth value.
    Compare { Equal, NotEqual, Less, LessEqual }
}

operations! {
    /// From a float to an integer or truth value.
    ToBits { Signed, Unsigned, Truth, Pattern, Exponent }
}

operations! {
    /// From an integer or truth value to a float.
    ToFloat { Signed, Unsigned, Truth, Pattern }
}

/// One float of another.
#[inline(always)]
pub fn float1<F: Real>(op: Float1, x: F) -> F {
    let (zero, one) = (F::from_f32(0.0), F::from_f32(1.0));
    match op {
        Float1::Negate => -x,
        Float1::Abs => x.abs(),
        Float1::Floor => x.floor(),
        Float1::Ceil => x.ceil(),
        Float1::Round => x.round_ties_even(),
        Float1::Trunc => x.trunc(),
        Float1::Fract => x - x.floor(),
        Float1::Sqrt => x.sqrt(),
        Float1::InverseSqrt => one / x.sqrt(),
        Float1::Sin => x.sin(),
        Float1::Cos => x.cos(),
        Float1::Tan => x.tan(),
        Float1::Asin => x.asin(),
        Float1::Acos => x.acos(),
        Float1::Atan => x.atan(),
        Float1::Sinh => x.sinh(),
        Float1::Cosh => x.cosh(),
        Float1::Tanh => x.tanh(),
        Float1::Asinh => x.asinh(),
        Float1::Acosh => x.acosh(),
        Float1::Atanh => x.atanh(),
        Float1::Exp => x.exp(),
        Float1::Exp2 => x.exp2(),
        Float1::Log => x.ln(),
        Float1::Log2 => x.log2(),
        // Neither above nor below zero: zero, or NaN, which is told on.
        Float1::Sign => select(x > zero, one, select(x < zero, -one, x)),
        Float1::Saturate => clamp(x, zero, one),
        Float1::Radians => x * F::from_f64(std::f64::consts::PI / 180.0),
        Float1::Degrees => x * F::from_f64(180.0 / std::f64::consts::PI),
        Float1::Frexp => x.frexp().0,
        // −ln(1 − a): the optical depth of an opacity (contract, "Opacity").
        Float1::Absorption => -((-x).ln_1p()),
    }
}

/// One float of two.
#[inline(always)]
pub fn float2<F: Real>(op: Float2, x: F, y: F) -> F {
    match op {
        Float2::Add => x + y,
        Float2::Subtract => x - y,
        Float2::Multiply => x * y,
        Float2::Divide => x / y,
        Float2::Remainder => x % y,
        Float2::Min => select(y < x, y, x),
        Float2::Max => select(x < y, y, x),
        Float2::Pow => x.powf(y),
        Float2::Atan2 => x.atan2(y),
        Float2::Step => select(x <= y, F::from_f32(1.0), F::from_f32(0.0)),
    }
}

/// One float of three.
#[inline(always)]
pub fn float3<F: Real>(op: Float3, x: F, y: F, z: F) -> F {
    let one = F::from_f32(1.0);
    match op {
        Float3::Fma => x.mul_add(y, z),
        Float3::Clamp => clamp(x, y, z),
        Float3::Mix => x * (one - z) + y * z,
        Float3::SmoothStep => {
            let t = clamp((z - x) / (y - x), F::from_f32(0.0), one);
            t * t * (F::from_f32(3.0) - F::from_f32(2.0) * t)
        }
    }
}

/// A function of its own: one that calls itself is not taken into the loops over rows.
#[inline(always)]
fn clamp<F: Real>(x: F, low: F, high: F) -> F {
    let x = select(x < low, low, x);
    select(high < x, high, x)
}

#[inline(always)]
fn select<T>(condition: bool, accept: T, reject: T) -> T {
    if condition { accept } else { reject }
}

/// One integer of another.
#[inline(always)]
pub fn bits1(op: Bits1, x: u32) -> u32 {
    let signed = x as i32;
    match op {
        Bits1::Negate => x.wrapping_neg(),
        Bits1::Not => !x,
        Bits1::Abs => signed.wrapping_abs() as u32,
        Bits1::Sign => signed.signum() as u32,
        Bits1::CountOnes => x.count_ones(),
        Bits1::LeadingZeros => x.leading_zeros(),
        Bits1::TrailingZeros => x.trailing_zeros(),
        Bits1::Reverse => x.reverse_bits(),
        // The highest bit that differs from the sign; −1 where none does.
        Bits1::FirstLeadingSigned => 31u32.wrapping_sub(select(signed < 0, !x, x).leading_zeros()),
        Bits1::FirstLeadingUnsigned => 31u32.wrapping_sub(x.leading_zeros()),
        Bits1::FirstTrailing => select(x == 0, u32::MAX, x.trailing_zeros()),
    }
}

/// One integer of two.
#[inline(always)]
pub fn bits2(op: Bits2, x: u32, y: u32) -> u32 {
    let (a, b) = (x as i32, y as i32);
    match op {
        Bits2::Add => x.wrapping_add(y),
        Bits2::Subtract => x.wrapping_sub(y),
        Bits2::Multiply => x.wrapping_mul(y),
        Bits2::DivideSigned => a.checked_div(b).unwrap_or(a) as u32,
        Bits2::DivideUnsigned => x.checked_div(y).unwrap_or(x),
        Bits2::RemainderSigned => a.checked_rem(b).unwrap_or(0) as u32,
        Bits2::RemainderUnsigned => x.checked_rem(y).unwrap_or(0),
        Bits2::And => x & y,
        Bits2::Or => x | y,
        Bits2::Xor => x ^ y,
        Bits2::AndNot => x & !y,
        Bits2::ShiftLeft => x << (y & 31),
        Bits2::ShiftRightSigned => (a >> (y & 31)) as u32,
        Bits2::ShiftRightUnsigned => x >> (y & 31),
        Bits2::MinSigned => a.min(b) as u32,
        Bits2::MaxSigned => a.max(b) as u32,
        Bits2::MinUnsigned => x.min(y),
        Bits2::MaxUnsigned => x.max(y),
        Bits2::Equal => truth(x == y),
        Bits2::NotEqual => truth(x != y),
        Bits2::LessSigned => truth(a < b),
        Bits2::LessUnsigned => truth(x < y),
        Bits2::LessEqualSigned => truth(a <= b),
        Bits2::LessEqualUnsigned => truth(x <= y),
        Bits2::FieldMask => field(x, y).2,
    }
}

/// One integer of three: bits of `x` from `offset` on.
#[inline(always)]
pub fn bits3(op: Bits3, x: u32, offset: u32, count: u32) -> u32 {
    let (offset, count, mask) = field(offset, count);
    if count == 0 {
        return 0;
    }
    match op {
        Bits3::ExtractUnsigned => (x & mask) >> offset,
        Bits3::ExtractSigned => ((x << (32 - offset - count)) as i32 >> (32 - count)) as u32,
    }
}

/// Offset and count of a field within 32 bits (WGSL, `extractBits`), and its bits.
#[inline(always)]
fn field(offset: u32, count: u32) -> (u32, u32, u32) {
    let offset = offset.min(32);
    let count = count.min(32 - offset);
    let low = u32::MAX.checked_shr(32 - count).unwrap_or(0);
    (offset, count, low.checked_shl(offset).unwrap_or(0))
}

/// A truth value of two floats.
#[inline(always)]
pub fn compare<F: Real>(op: Compare, x: F, y: F) -> u32 {
    truth(match op {
        Compare::Equal => x == y,
        Compare::NotEqual => x != y,
        Compare::Less => x < y,
        Compare::LessEqual => x <= y,
    })
}

/// An integer or truth value of a float.
#[inline(always)]
pub fn to_bits<F: Real>(op: ToBits, x: F) -> u32 {
    match op {
        ToBits::Signed => x.to_i32() as u32,
        ToBits::Unsigned => x.to_u32(),
        ToBits::Truth => truth(x != F::from_f32(0.0)),
        ToBits::Pattern => x.to_f32().to_bits(),
        ToBits::Exponent => x.frexp().1 as u32,
    }
}

/// A float of an integer or truth value.
#[inline(always)]
pub fn to_float<F: Real>(op: ToFloat, x: u32) -> F {
    match op {
        ToFloat::Signed => F::from_i32(x as i32),
        ToFloat::Unsigned => F::from_u32(x),
        ToFloat::Truth => F::from_u32(x & 1),
        ToFloat::Pattern => F::from_f32(f32::from_bits(x)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_have_no_undefined_cases() {
        let int = |op, a: i32, b: i32| bits2(op, a as u32, b as u32) as i32;
        assert_eq!(int(Bits2::DivideSigned, 7, 0), 7);
        assert_eq!(int(Bits2::DivideSigned, i32::MIN, -1), i32::MIN);
        assert_eq!(int(Bits2::RemainderSigned, 7, 0), 0);
        assert_eq!(int(Bits2::RemainderSigned, i32::MIN, -1), 0);
        assert_eq!(int(Bits2::RemainderSigned, -7, 3), -1);
        assert_eq!(bits2(Bits2::DivideUnsigned, 7, 0), 7);
        assert_eq!(bits2(Bits2::ShiftLeft, 1, 33), 2);
        assert_eq!(int(Bits2::ShiftRightSigned, -8, 1), -4);
        assert_eq!(int(Bits2::Multiply, i32::MAX, 2), -2);
    }

    /// The examples of the WGSL specification's section on bit functions.
    #[test]
    fn bit_fields_are_clamped_to_the_number() {
        assert_eq!(bits3(Bits3::ExtractUnsigned, 0xABCD_EF01, 8, 8), 0xEF);
        assert_eq!(bits3(Bits3::ExtractSigned, 0xABCD_EF01, 8, 8), 0xFFFF_FFEF);
        for (offset, count) in [(0, 0), (32, 5), (40, 40)] {
            assert_eq!(bits3(Bits3::ExtractSigned, u32::MAX, offset, count), 0);
            assert_eq!(bits2(Bits2::FieldMask, offset, count), 0);
        }
        assert_eq!(bits3(Bits3::ExtractUnsigned, u32::MAX, 30, 40), 3);
        assert_eq!(bits3(Bits3::ExtractSigned, u32::MAX, 0, 32), u32::MAX);
        assert_eq!(bits2(Bits2::FieldMask, 0, 32), u32::MAX);
        assert_eq!(bits1(Bits1::FirstLeadingSigned, -1i32 as u32), u32::MAX);
        assert_eq!(bits1(Bits1::FirstLeadingSigned, -256i32 as u32), 7);
        assert_eq!(bits1(Bits1::FirstLeadingUnsigned, 0), u32::MAX);
        assert_eq!(bits1(Bits1::FirstTrailing, 0), u32::MAX);
    }

    #[test]
    fn conversions_clamp() {
        assert_eq!(to_bits(ToBits::Signed, 3e9f32) as i32, i32::MAX);
        assert_eq!(to_bits(ToBits::Unsigned, -1.5f64), 0);
        assert_eq!(to_bits(ToBits::Unsigned, f32::NAN), 0);
        assert_eq!(to_bits(ToBits::Signed, -2.9f64) as i32, -2);
        assert_eq!(to_float::<f32>(ToFloat::Truth, TRUE), 1.0);
    }

    /// WGSL: `min(a, b)` is b if b < a, otherwise a; so a NaN first stays, and second does not.
    #[test]
    fn nan_is_chosen_as_wgsl_says() {
        assert!(float2(Float2::Min, f32::NAN, 1.0).is_nan());
        assert_eq!(float2(Float2::Min, 1.0, f32::NAN), 1.0);
        assert_eq!(float2(Float2::Max, 1.0, f64::NAN), 1.0);
        assert!(float1(Float1::Sign, f64::NAN).is_nan());
        assert_eq!(float1(Float1::Round, 2.5f32), 2.0);
    }
}
