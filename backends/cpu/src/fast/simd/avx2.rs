//! AVX2 with fused multiply-add: two vectors of eight.
#![expect(unsafe_code, reason = "vector intrinsics and gathers")]

use std::arch::x86_64::*;

use super::{LANES, Plain, Simd, quads_by_lane};

/// AVX2: two vectors of eight.
#[derive(Clone, Copy)]
pub struct Avx2;

// SAFETY (all functions): as for AVX-512, on a machine with AVX2.
macro_rules! both {
    (|$($arg:ident),*| $e:expr) => {
        // SAFETY: see above.
        unsafe { [{ $(let $arg = $arg[0];)* $e }, { $(let $arg = $arg[1];)* $e }] }
    };
}

impl Avx2 {
    #[inline(always)]
    unsafe fn mask(bits: u32) -> [__m256; 2] {
        // SAFETY: as above.
        unsafe {
            let select = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let half = |bits: u32| {
                let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), select);
                _mm256_castsi256_ps(_mm256_cmpeq_epi32(set, select))
            };
            [half(bits & 255), half(bits >> 8)]
        }
    }
}

impl Simd for Avx2 {
    type F = [__m256; 2];
    type I = [__m256i; 2];

    #[inline(always)]
    unsafe fn splat(v: f32) -> Self::F {
        // SAFETY: as above; so for the rest.
        unsafe { [_mm256_set1_ps(v); 2] }
    }
    #[inline(always)]
    unsafe fn load(v: &[f32; LANES]) -> Self::F {
        // SAFETY: as above.
        unsafe { [_mm256_loadu_ps(v.as_ptr()), _mm256_loadu_ps(v.as_ptr().add(8))] }
    }
    #[inline(always)]
    unsafe fn store(v: Self::F, out: &mut [f32; LANES]) {
        // SAFETY: as above.
        unsafe {
            _mm256_storeu_ps(out.as_mut_ptr(), v[0]);
            _mm256_storeu_ps(out.as_mut_ptr().add(8), v[1]);
        }
    }
    #[inline(always)]
    unsafe fn add(a: Self::F, b: Self::F) -> Self::F {
        both!(|a, b| _mm256_add_ps(a, b))
    }
    #[inline(always)]
    unsafe fn sub(a: Self::F, b: Self::F) -> Self::F {
        both!(|a, b| _mm256_sub_ps(a, b))
    }
    #[inline(always)]
    unsafe fn mul(a: Self::F, b: Self::F) -> Self::F {
        both!(|a, b| _mm256_mul_ps(a, b))
    }
    #[inline(always)]
    unsafe fn div(a: Self::F, b: Self::F) -> Self::F {
        both!(|a, b| _mm256_div_ps(a, b))
    }
    #[inline(always)]
    unsafe fn sqrt(a: Self::F) -> Self::F {
        both!(|a| _mm256_sqrt_ps(a))
    }
    #[inline(always)]
    unsafe fn fma(a: Self::F, b: Self::F, c: Self::F) -> Self::F {
        both!(|a, b, c| _mm256_fmadd_ps(a, b, c))
    }
    #[inline(always)]
    unsafe fn min(a: Self::F, b: Self::F) -> Self::F {
        both!(|a, b| _mm256_min_ps(a, b))
    }
    #[inline(always)]
    unsafe fn max(a: Self::F, b: Self::F) -> Self::F {
        both!(|a, b| _mm256_max_ps(a, b))
    }
    #[inline(always)]
    unsafe fn where_zero(t: Self::F, a: Self::F, b: Self::F) -> Self::F {
        both!(|t, a, b| _mm256_blendv_ps(b, a, _mm256_cmp_ps::<_CMP_EQ_OQ>(t, _mm256_setzero_ps())))
    }
    #[inline(always)]
    unsafe fn lt_bits(a: Self::F, b: Self::F) -> u32 {
        let m = both!(|a, b| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)));
        m[0] as u32 | (m[1] as u32) << 8
    }
    #[inline(always)]
    unsafe fn eq_bits(a: Self::F, b: Self::F) -> u32 {
        let m = both!(|a, b| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(a, b)));
        m[0] as u32 | (m[1] as u32) << 8
    }
    #[inline(always)]
    unsafe fn nan_bits(a: Self::F) -> u32 {
        let m = both!(|a| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_UNORD_Q>(a, a)));
        m[0] as u32 | (m[1] as u32) << 8
    }
    #[inline(always)]
    unsafe fn select(bits: u32, a: Self::F, b: Self::F) -> Self::F {
        // SAFETY: as above.
        let m = unsafe { Self::mask(bits) };
        both!(|m, a, b| _mm256_blendv_ps(b, a, m))
    }
    #[inline(always)]
    unsafe fn floor(a: Self::F) -> Self::F {
        both!(|a| _mm256_floor_ps(a))
    }
    #[inline(always)]
    unsafe fn to_int(a: Self::F) -> Self::I {
        both!(|a| _mm256_cvttps_epi32(a))
    }
    #[inline(always)]
    unsafe fn to_float(a: Self::I) -> Self::F {
        both!(|a| _mm256_cvtepi32_ps(a))
    }
    #[inline(always)]
    unsafe fn reduce_min(a: Self::F) -> f32 {
        let mut out = [0.0; LANES];
        // SAFETY: as above.
        unsafe {
            Self::store(a, &mut out);
            Plain::reduce_min(out)
        }
    }
    #[inline(always)]
    unsafe fn splat_int(v: i32) -> Self::I {
        // SAFETY: as above.
        unsafe { [_mm256_set1_epi32(v); 2] }
    }
    #[inline(always)]
    unsafe fn store_int(v: Self::I, out: &mut [i32; LANES]) {
        // SAFETY: as above.
        unsafe {
            _mm256_storeu_si256(out.as_mut_ptr().cast(), v[0]);
            _mm256_storeu_si256(out.as_mut_ptr().add(8).cast(), v[1]);
        }
    }
    #[inline(always)]
    unsafe fn add_int(a: Self::I, b: Self::I) -> Self::I {
        both!(|a, b| _mm256_add_epi32(a, b))
    }
    #[inline(always)]
    unsafe fn sub_int(a: Self::I, b: Self::I) -> Self::I {
        both!(|a, b| _mm256_sub_epi32(a, b))
    }
    #[inline(always)]
    unsafe fn mul_int(a: Self::I, b: Self::I) -> Self::I {
        both!(|a, b| _mm256_mullo_epi32(a, b))
    }
    #[inline(always)]
    unsafe fn min_int(a: Self::I, b: Self::I) -> Self::I {
        both!(|a, b| _mm256_min_epi32(a, b))
    }
    #[inline(always)]
    unsafe fn max_int(a: Self::I, b: Self::I) -> Self::I {
        both!(|a, b| _mm256_max_epi32(a, b))
    }
    #[inline(always)]
    unsafe fn and_int(a: Self::I, b: Self::I) -> Self::I {
        both!(|a, b| _mm256_and_si256(a, b))
    }
    #[inline(always)]
    unsafe fn shr<const N: u32>(a: Self::I) -> Self::I {
        both!(|a| _mm256_srl_epi32(a, _mm_cvtsi32_si128(N as i32)))
    }
    #[inline(always)]
    unsafe fn sar<const N: u32>(a: Self::I) -> Self::I {
        both!(|a| _mm256_sra_epi32(a, _mm_cvtsi32_si128(N as i32)))
    }
    #[inline(always)]
    unsafe fn shl<const N: u32>(a: Self::I) -> Self::I {
        both!(|a| _mm256_sll_epi32(a, _mm_cvtsi32_si128(N as i32)))
    }
    #[inline(always)]
    unsafe fn shr_by(a: Self::I, bits: Self::I) -> Self::I {
        both!(|a, bits| _mm256_srlv_epi32(a, bits))
    }
    #[inline(always)]
    unsafe fn select_int(bits: u32, a: Self::I, b: Self::I) -> Self::I {
        // SAFETY: as above.
        let m = unsafe { Self::mask(bits) };
        both!(|m, a, b| _mm256_blendv_epi8(b, a, _mm256_castps_si256(m)))
    }
    #[inline(always)]
    unsafe fn eq_int_bits(a: Self::I, b: Self::I) -> u32 {
        let m = both!(|a, b| _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(a, b))));
        m[0] as u32 | (m[1] as u32) << 8
    }
    #[inline(always)]
    unsafe fn as_int(a: Self::F) -> Self::I {
        both!(|a| _mm256_castps_si256(a))
    }
    #[inline(always)]
    unsafe fn rows(base: *const u8, index: &[i32; LANES]) -> [Self::F; 4] {
        // SAFETY: the caller's rows can be read.
        unsafe {
            let row = |l: usize| _mm_loadu_ps(base.add(16 * index[l] as u32 as usize).cast());
            let half = |first: usize| {
                let two = |e: usize| _mm256_set_m128(row(first + 4 + e), row(first + e));
                let (a, b, c, d) = (two(0), two(1), two(2), two(3));
                let pair = |a: __m256, b: __m256| [_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b)];
                let ([p, q], [r, s]) = (pair(a, b), pair(c, d));
                let double = |a: __m256, b: __m256| {
                    let (a, b) = (_mm256_castps_pd(a), _mm256_castps_pd(b));
                    [_mm256_castpd_ps(_mm256_unpacklo_pd(a, b)), _mm256_castpd_ps(_mm256_unpackhi_pd(a, b))]
                };
                let ([first, second], [third, fourth]) = (double(p, r), double(q, s));
                [first, second, third, fourth]
            };
            let (low, high) = (half(0), half(8));
            [0, 1, 2, 3].map(|i| [low[i], high[i]])
        }
    }
    #[inline(always)]
    unsafe fn as_float(a: Self::I) -> Self::F {
        both!(|a| _mm256_castsi256_ps(a))
    }
    #[inline(always)]
    unsafe fn gather(base: *const u8, offset: Self::I) -> Self::I {
        both!(|offset| _mm256_i32gather_epi32::<1>(base.cast(), offset))
    }

    quads_by_lane!(f32::mul_add);
}
