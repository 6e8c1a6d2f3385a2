//! The unit that every machine has: arrays, vectorised by the compiler.
#![expect(unsafe_code, reason = "reads at pointers")]

use super::{LANES, Simd, fused, quads_by_lane};

/// Arrays.
#[derive(Clone, Copy)]
pub struct Plain;

#[inline(always)]
fn map<U>(f: impl Fn(usize) -> U) -> [U; LANES] {
    std::array::from_fn(f)
}

macro_rules! lanes {
    (|$i:ident| $e:expr) => {
        map(|$i| $e)
    };
}

impl Simd for Plain {
    type F = [f32; LANES];
    type I = [i32; LANES];

    #[inline(always)]
    unsafe fn splat(v: f32) -> Self::F {
        [v; LANES]
    }
    #[inline(always)]
    unsafe fn load(v: &[f32; LANES]) -> Self::F {
        *v
    }
    #[inline(always)]
    unsafe fn store(v: Self::F, out: &mut [f32; LANES]) {
        *out = v;
    }
    #[inline(always)]
    unsafe fn add(a: Self::F, b: Self::F) -> Self::F {
        lanes!(|i| a[i] + b[i])
    }
    #[inline(always)]
    unsafe fn sub(a: Self::F, b: Self::F) -> Self::F {
        lanes!(|i| a[i] - b[i])
    }
    #[inline(always)]
    unsafe fn mul(a: Self::F, b: Self::F) -> Self::F {
        lanes!(|i| a[i] * b[i])
    }
    #[inline(always)]
    unsafe fn div(a: Self::F, b: Self::F) -> Self::F {
        lanes!(|i| a[i] / b[i])
    }
    #[inline(always)]
    unsafe fn sqrt(a: Self::F) -> Self::F {
        lanes!(|i| a[i].sqrt())
    }
    #[inline(always)]
    unsafe fn fma(a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        lanes!(|i| fused(a[i], b[i], c[i]))
    }
    #[inline(always)]
    unsafe fn min(a: Self::F, b: Self::F) -> Self::F {
        lanes!(|i| if a[i] < b[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    unsafe fn max(a: Self::F, b: Self::F) -> Self::F {
        lanes!(|i| if a[i] > b[i] { a[i] } else { b[i] })
    }
    #[inline(always)]
    unsafe fn where_zero(t: Self::F, a: Self::F, b: Self::F) -> Self::F {
        lanes!(|i| if t[i] == 0.0 { a[i] } else { b[i] })
    }
    #[inline(always)]
    unsafe fn lt_bits(a: Self::F, b: Self::F) -> u32 {
        (0..LANES).fold(0, |bits, i| bits | u32::from(a[i] < b[i]) << i)
    }
    #[inline(always)]
    unsafe fn eq_bits(a: Self::F, b: Self::F) -> u32 {
        (0..LANES).fold(0, |bits, i| bits | u32::from(a[i] == b[i]) << i)
    }
    #[inline(always)]
    unsafe fn nan_bits(a: Self::F) -> u32 {
        (0..LANES).fold(0, |bits, i| bits | u32::from(a[i].is_nan()) << i)
    }
    #[inline(always)]
    unsafe fn select(bits: u32, a: Self::F, b: Self::F) -> Self::F {
        lanes!(|i| if bits >> i & 1 == 1 { a[i] } else { b[i] })
    }
    #[inline(always)]
    unsafe fn floor(a: Self::F) -> Self::F {
        lanes!(|i| {
            let whole = a[i] as i32 as f32;
            if whole > a[i] { whole - 1.0 } else { whole }
        })
    }
    #[inline(always)]
    unsafe fn to_int(a: Self::F) -> Self::I {
        lanes!(|i| a[i] as i32)
    }
    #[inline(always)]
    unsafe fn to_float(a: Self::I) -> Self::F {
        lanes!(|i| a[i] as f32)
    }
    #[inline(always)]
    unsafe fn reduce_min(a: Self::F) -> f32 {
        a.iter().fold(f32::INFINITY, |m, &v| if v < m { v } else { m })
    }
    #[inline(always)]
    unsafe fn splat_int(v: i32) -> Self::I {
        [v; LANES]
    }
    #[inline(always)]
    unsafe fn store_int(v: Self::I, out: &mut [i32; LANES]) {
        *out = v;
    }
    #[inline(always)]
    unsafe fn add_int(a: Self::I, b: Self::I) -> Self::I {
        lanes!(|i| a[i].wrapping_add(b[i]))
    }
    #[inline(always)]
    unsafe fn sub_int(a: Self::I, b: Self::I) -> Self::I {
        lanes!(|i| a[i].wrapping_sub(b[i]))
    }
    #[inline(always)]
    unsafe fn mul_int(a: Self::I, b: Self::I) -> Self::I {
        lanes!(|i| a[i].wrapping_mul(b[i]))
    }
    #[inline(always)]
    unsafe fn min_int(a: Self::I, b: Self::I) -> Self::I {
        lanes!(|i| a[i].min(b[i]))
    }
    #[inline(always)]
    unsafe fn max_int(a: Self::I, b: Self::I) -> Self::I {
        lanes!(|i| a[i].max(b[i]))
    }
    #[inline(always)]
    unsafe fn and_int(a: Self::I, b: Self::I) -> Self::I {
        lanes!(|i| a[i] & b[i])
    }
    #[inline(always)]
    unsafe fn shr<const N: u32>(a: Self::I) -> Self::I {
        lanes!(|i| ((a[i] as u32) >> N) as i32)
    }
    #[inline(always)]
    unsafe fn sar<const N: u32>(a: Self::I) -> Self::I {
        lanes!(|i| a[i] >> N)
    }
    #[inline(always)]
    unsafe fn shl<const N: u32>(a: Self::I) -> Self::I {
        lanes!(|i| a[i] << N)
    }
    #[inline(always)]
    unsafe fn shr_by(a: Self::I, bits: Self::I) -> Self::I {
        lanes!(|i| (a[i] as u32).checked_shr(bits[i] as u32).unwrap_or(0) as i32)
    }
    #[inline(always)]
    unsafe fn select_int(bits: u32, a: Self::I, b: Self::I) -> Self::I {
        lanes!(|i| if bits >> i & 1 == 1 { a[i] } else { b[i] })
    }
    #[inline(always)]
    unsafe fn eq_int_bits(a: Self::I, b: Self::I) -> u32 {
        (0..LANES).fold(0, |bits, i| bits | u32::from(a[i] == b[i]) << i)
    }
    #[inline(always)]
    unsafe fn as_int(a: Self::F) -> Self::I {
        lanes!(|i| a[i].to_bits() as i32)
    }
    #[inline(always)]
    unsafe fn rows(base: *const u8, index: &[i32; LANES]) -> [Self::F; 4] {
        // SAFETY: the caller's rows can be read.
        let row = |i: usize| unsafe { base.add(16 * index[i] as u32 as usize).cast::<[f32; 4]>().read_unaligned() };
        let rows: [[f32; 4]; LANES] = map(row);
        [0, 1, 2, 3].map(|c| lanes!(|i| rows[i][c]))
    }
    #[inline(always)]
    unsafe fn as_float(a: Self::I) -> Self::F {
        lanes!(|i| f32::from_bits(a[i] as u32))
    }
    #[inline(always)]
    unsafe fn gather(base: *const u8, offset: Self::I) -> Self::I {
        // SAFETY: the caller promises that every offset can be read.
        lanes!(|i| unsafe { base.offset(offset[i] as isize).cast::<i32>().read_unaligned() })
    }

    quads_by_lane!(fused);
}
