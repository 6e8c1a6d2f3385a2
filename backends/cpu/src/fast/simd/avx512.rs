//! AVX-512: one vector of sixteen.
#![expect(unsafe_code, reason = "vector intrinsics and gathers")]
#![expect(clippy::needless_range_loop, reason = "a lane indexes several arrays")]

use std::arch::x86_64::*;

use super::{LANES, Simd};

/// AVX-512.
#[derive(Clone, Copy)]
pub struct Avx512;

// SAFETY (all functions): the caller runs on a machine with AVX-512 F, BW, DQ and VL; loads
// and stores go to references of the right size; gathers as the trait's contract says.
macro_rules! avx512 {
    ($(fn $name:ident $(<const $n:ident>)? ($($arg:ident: $t:ty),*) $(-> $r:ty)? { $e:expr })*) => {
        $(#[inline(always)]
        unsafe fn $name $(<const $n: u32>)? ($($arg: $t),*) $(-> $r)? {
            // SAFETY: see above.
            unsafe { $e }
        })*
    };
}

impl Simd for Avx512 {
    type F = __m512;
    type I = __m512i;

    avx512! {
        fn splat(v: f32) -> __m512 { _mm512_set1_ps(v) }
        fn load(v: &[f32; LANES]) -> __m512 { _mm512_loadu_ps(v.as_ptr()) }
        fn store(v: __m512, out: &mut [f32; LANES]) { _mm512_storeu_ps(out.as_mut_ptr(), v) }
        fn add(a: __m512, b: __m512) -> __m512 { _mm512_add_ps(a, b) }
        fn sub(a: __m512, b: __m512) -> __m512 { _mm512_sub_ps(a, b) }
        fn mul(a: __m512, b: __m512) -> __m512 { _mm512_mul_ps(a, b) }
        fn div(a: __m512, b: __m512) -> __m512 { _mm512_div_ps(a, b) }
        fn sqrt(a: __m512) -> __m512 { _mm512_sqrt_ps(a) }
        fn fma(a: __m512, b: __m512, c: __m512) -> __m512 { _mm512_fmadd_ps(a, b, c) }
        fn min(a: __m512, b: __m512) -> __m512 { _mm512_min_ps(a, b) }
        fn max(a: __m512, b: __m512) -> __m512 { _mm512_max_ps(a, b) }
        fn where_zero(t: __m512, a: __m512, b: __m512) -> __m512 {
            _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(t, _mm512_setzero_ps()), b, a)
        }
        fn lt_bits(a: __m512, b: __m512) -> u32 { u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b)) }
        fn eq_bits(a: __m512, b: __m512) -> u32 { u32::from(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a, b)) }
        fn nan_bits(a: __m512) -> u32 { u32::from(_mm512_cmp_ps_mask::<_CMP_UNORD_Q>(a, a)) }
        fn select(bits: u32, a: __m512, b: __m512) -> __m512 { _mm512_mask_blend_ps(bits as u16, b, a) }
        fn floor(a: __m512) -> __m512 { _mm512_roundscale_ps::<9>(a) }
        fn to_int(a: __m512) -> __m512i { _mm512_cvttps_epi32(a) }
        fn to_float(a: __m512i) -> __m512 { _mm512_cvtepi32_ps(a) }
        fn reduce_min(a: __m512) -> f32 { _mm512_reduce_min_ps(a) }
        fn splat_int(v: i32) -> __m512i { _mm512_set1_epi32(v) }
        fn store_int(v: __m512i, out: &mut [i32; LANES]) { _mm512_storeu_si512(out.as_mut_ptr().cast(), v) }
        fn add_int(a: __m512i, b: __m512i) -> __m512i { _mm512_add_epi32(a, b) }
        fn sub_int(a: __m512i, b: __m512i) -> __m512i { _mm512_sub_epi32(a, b) }
        fn mul_int(a: __m512i, b: __m512i) -> __m512i { _mm512_mullo_epi32(a, b) }
        fn min_int(a: __m512i, b: __m512i) -> __m512i { _mm512_min_epi32(a, b) }
        fn max_int(a: __m512i, b: __m512i) -> __m512i { _mm512_max_epi32(a, b) }
        fn and_int(a: __m512i, b: __m512i) -> __m512i { _mm512_and_si512(a, b) }
        fn shr<const N>(a: __m512i) -> __m512i { _mm512_srli_epi32::<N>(a) }
        fn sar<const N>(a: __m512i) -> __m512i { _mm512_srai_epi32::<N>(a) }
        fn shl<const N>(a: __m512i) -> __m512i { _mm512_slli_epi32::<N>(a) }
        fn shr_by(a: __m512i, bits: __m512i) -> __m512i { _mm512_srlv_epi32(a, bits) }
        fn select_int(bits: u32, a: __m512i, b: __m512i) -> __m512i { _mm512_mask_blend_epi32(bits as u16, b, a) }
        fn eq_int_bits(a: __m512i, b: __m512i) -> u32 { u32::from(_mm512_cmpeq_epi32_mask(a, b)) }
        fn as_int(a: __m512) -> __m512i { _mm512_castps_si512(a) }
        fn as_float(a: __m512i) -> __m512 { _mm512_castsi512_ps(a) }
        fn gather(base: *const u8, offset: __m512i) -> __m512i {
            _mm512_i32gather_epi32::<1>(offset, base.cast())
        }
    }

    #[inline(always)]
    unsafe fn rows(base: *const u8, index: &[i32; LANES]) -> [__m512; 4] {
        // SAFETY: the caller's rows can be read.
        unsafe {
            turned([
                every_fourth(base, index, 0),
                every_fourth(base, index, 1),
                every_fourth(base, index, 2),
                every_fourth(base, index, 3),
            ])
        }
    }
    #[inline(always)]
    unsafe fn between_rows(base: *const u8, index: &[i32; LANES], fraction: __m512) -> [__m512; 4] {
        // SAFETY: the caller's rows can be read.
        unsafe {
            // Without closures: those are not compiled for the unit.
            let a = every_fourth_between(base, index, 0, _mm512_permute_ps::<0x00>(fraction));
            let b = every_fourth_between(base, index, 1, _mm512_permute_ps::<0x55>(fraction));
            let c = every_fourth_between(base, index, 2, _mm512_permute_ps::<0xaa>(fraction));
            let d = every_fourth_between(base, index, 3, _mm512_permute_ps::<0xff>(fraction));
            turned([a, b, c, d])
        }
    }

    type Quads = [__m512; 4];
    #[inline(always)]
    unsafe fn load_quads(v: &[[f32; 4]; LANES]) -> Self::Quads {
        // SAFETY: four lanes of four are sixteen f32.
        unsafe {
            let at = v.as_ptr().cast::<f32>();
            [_mm512_loadu_ps(at), _mm512_loadu_ps(at.add(16)), _mm512_loadu_ps(at.add(32)), _mm512_loadu_ps(at.add(48))]
        }
    }
    #[inline(always)]
    unsafe fn store_quads(v: Self::Quads, out: &mut [[f32; 4]; LANES]) {
        let at = out.as_mut_ptr().cast::<f32>();
        for (q, v) in v.into_iter().enumerate() {
            // SAFETY: as above.
            unsafe { _mm512_storeu_ps(at.add(16 * q), v) }
        }
    }
    #[inline(always)]
    unsafe fn under(
        mut c: Self::Quads,
        table: *const u8,
        index: &[i32; LANES],
        fraction: &[f32; LANES],
    ) -> Self::Quads {
        // SAFETY: the caller's indices lie inside the table, which has an entry after each.
        unsafe {
            let fraction = Self::load(fraction);
            for q in 0..4 {
                let (a, b) = (four(table, index, q), four(table.add(16), index, q));
                c[q] = blend(c[q], mix(a, b, spread(fraction, q)));
            }
        }
        c
    }
    #[inline(always)]
    unsafe fn under_pairs(
        mut c: Self::Quads,
        table: *const u8,
        stride: usize,
        index: &[i32; LANES],
        front: &[f32; LANES],
        back: &[f32; LANES],
    ) -> Self::Quads {
        // SAFETY: as `under`, with a row after each, too.
        unsafe {
            let (front, back) = (Self::load(front), Self::load(back));
            let next = table.add(stride);
            for q in 0..4 {
                let g = spread(back, q);
                let x = mix(four(table, index, q), four(table.add(16), index, q), g);
                let y = mix(four(next, index, q), four(next.add(16), index, q), g);
                c[q] = blend(c[q], mix(x, y, spread(front, q)));
            }
        }
        c
    }
}

/// Four numbers each of the lanes `e`, `4 + e`, `8 + e` and `12 + e`.
#[inline(always)]
unsafe fn every_fourth(base: *const u8, index: &[i32; LANES], e: usize) -> __m512 {
    // SAFETY: the caller's rows can be read.
    unsafe {
        let row = |l: usize| _mm_loadu_ps(base.add(16 * index[l] as u32 as usize).cast());
        let v = _mm512_castps128_ps512(row(e));
        let v = _mm512_mask_broadcast_f32x4(v, 0x00f0, row(4 + e));
        let v = _mm512_mask_broadcast_f32x4(v, 0x0f00, row(8 + e));
        _mm512_mask_broadcast_f32x4(v, 0xf000, row(12 + e))
    }
}

/// Four numbers each of the lanes `e`, `4 + e`, `8 + e` and `12 + e`, between a row and the one after.
#[inline(always)]
unsafe fn every_fourth_between(base: *const u8, index: &[i32; LANES], e: usize, t: __m512) -> __m512 {
    // SAFETY: the caller's rows can be read, and those after them.
    unsafe {
        let rows = |l: usize| _mm256_loadu_pd(base.add(16 * index[l] as u32 as usize).cast());
        let near = _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(rows(e)), rows(4 + e));
        let far = _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(rows(8 + e)), rows(12 + e));
        let (near, far) = (_mm512_castpd_ps(near), _mm512_castpd_ps(far));
        let from = _mm512_shuffle_f32x4::<0b10_00_10_00>(near, far);
        mix(from, _mm512_shuffle_f32x4::<0b11_01_11_01>(near, far), t)
    }
}

/// From what [`every_fourth`] gives of each, to all first numbers, all second ones, and so on: turning
/// each block of four by four gives lanes in order.
#[inline(always)]
unsafe fn turned([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    // SAFETY: AVX-512 as above.
    unsafe {
        let pair = |a: __m512, b: __m512| [_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b)];
        let ([p, q], [r, s]) = (pair(a, b), pair(c, d));
        let double = |a: __m512, b: __m512| {
            let (a, b) = (_mm512_castps_pd(a), _mm512_castps_pd(b));
            [_mm512_castpd_ps(_mm512_unpacklo_pd(a, b)), _mm512_castpd_ps(_mm512_unpackhi_pd(a, b))]
        };
        let ([first, second], [third, fourth]) = (double(p, r), double(q, s));
        [first, second, third, fourth]
    }
}

/// Four entries of 16 bytes, one for each of the lanes `4q..4q + 4`.
#[inline(always)]
unsafe fn four(table: *const u8, index: &[i32; LANES], q: usize) -> __m512 {
    // SAFETY: the caller's indices lie inside the table.
    unsafe {
        let entry = |l: usize| _mm_loadu_ps(table.offset(index[4 * q + l] as isize).cast());
        let low = _mm512_castps128_ps512(entry(0));
        let low = _mm512_mask_broadcast_f32x4(low, 0x00f0, entry(1));
        let low = _mm512_mask_broadcast_f32x4(low, 0x0f00, entry(2));
        _mm512_mask_broadcast_f32x4(low, 0xf000, entry(3))
    }
}

/// The four lanes `4q..4q + 4`, each four times.
#[inline(always)]
unsafe fn spread(v: __m512, q: usize) -> __m512 {
    // SAFETY: AVX-512 as above.
    unsafe {
        let first = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
        _mm512_permutexvar_ps(_mm512_add_epi32(first, _mm512_set1_epi32(4 * q as i32)), v)
    }
}

/// a + t·(b − a).
#[inline(always)]
unsafe fn mix(a: __m512, b: __m512, t: __m512) -> __m512 {
    // SAFETY: AVX-512 as above.
    unsafe { _mm512_fmadd_ps(t, _mm512_sub_ps(b, a), a) }
}

/// c + (1 − c.a)·e.
#[inline(always)]
unsafe fn blend(c: __m512, e: __m512) -> __m512 {
    // SAFETY: AVX-512 as above.
    unsafe {
        let alpha = _mm512_permute_ps::<0xff>(c);
        let left = _mm512_sub_ps(_mm512_set1_ps(1.0), alpha);
        _mm512_fmadd_ps(left, e, c)
    }
}
