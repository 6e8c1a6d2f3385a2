//! Vectors of sixteen lanes, one lane a ray.
//!
//! [`Simd`] is what the kernels are written in; [`Avx512`], [`Avx2`] and [`Plain`] do the same
//! arithmetic in the same order. `Plain` is arrays that the compiler vectorises for the target's
//! baseline: SSE2 on x86-64, NEON on aarch64. Units with fused multiply-add give the same bits;
//! plain x86-64, which has none, differs by rounding.
#![expect(unsafe_code, reason = "vector intrinsics and gathers")]

/// Lanes of a vector.
pub const LANES: usize = 16;

/// The vector unit in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// 512-bit vectors with gathers.
    Avx512,
    /// 256-bit vectors with gathers, two at a time.
    Avx2,
    /// Whatever the compiler makes of arrays.
    Plain,
}

impl Unit {
    /// The widest unit of this machine.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if ["avx512f", "avx512bw", "avx512dq", "avx512vl"].iter().all(|f| has(f)) {
                return Self::Avx512;
            }
            if has("avx2") && has("fma") {
                return Self::Avx2;
            }
        }
        Self::Plain
    }

    /// Whether this machine has the unit.
    pub fn available(self) -> bool {
        match (self, Self::detect()) {
            (Self::Plain, _) | (_, Self::Avx512) => true,
            (unit, widest) => unit == widest,
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Avx512 => "AVX-512",
            Self::Avx2 => "AVX2",
            Self::Plain if cfg!(target_arch = "aarch64") => "NEON (compiler)",
            Self::Plain => "plain",
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn has(feature: &str) -> bool {
    match feature {
        "avx512f" => is_x86_feature_detected!("avx512f"),
        "avx512bw" => is_x86_feature_detected!("avx512bw"),
        "avx512dq" => is_x86_feature_detected!("avx512dq"),
        "avx512vl" => is_x86_feature_detected!("avx512vl"),
        "fma" => is_x86_feature_detected!("fma"),
        _ => is_x86_feature_detected!("avx2"),
    }
}

/// Sixteen lanes of f32 and i32.
///
/// # Safety
/// Every function may only be called on a machine that has the unit, from a function compiled
/// for it. `gather*` read 4 bytes at `base + offset` of every lane, which must be readable.
pub trait Simd: Copy + 'static {
    /// Sixteen f32.
    type F: Copy;
    /// Sixteen i32.
    type I: Copy;

    /// All lanes alike.
    unsafe fn splat(v: f32) -> Self::F;
    /// From memory.
    unsafe fn load(v: &[f32; LANES]) -> Self::F;
    /// To memory.
    unsafe fn store(v: Self::F, out: &mut [f32; LANES]);
    /// a + b.
    unsafe fn add(a: Self::F, b: Self::F) -> Self::F;
    /// a − b.
    unsafe fn sub(a: Self::F, b: Self::F) -> Self::F;
    /// a · b.
    unsafe fn mul(a: Self::F, b: Self::F) -> Self::F;
    /// a · b + c, rounded once (twice on plain x86-64).
    unsafe fn fma(a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// The smaller; `b` where `a` is NaN.
    unsafe fn min(a: Self::F, b: Self::F) -> Self::F;
    /// The larger; `b` where `a` is NaN.
    unsafe fn max(a: Self::F, b: Self::F) -> Self::F;
    /// `a` where `t` is zero, else `b`.
    unsafe fn where_zero(t: Self::F, a: Self::F, b: Self::F) -> Self::F;
    /// Bit *l* set where lane *l* of `a` is below that of `b`.
    unsafe fn lt_bits(a: Self::F, b: Self::F) -> u32;
    /// Bit *l* set where lane *l* is NaN.
    unsafe fn nan_bits(a: Self::F) -> u32;
    /// `a` in the lanes whose bit is set, else `b`.
    unsafe fn select(bits: u32, a: Self::F, b: Self::F) -> Self::F;
    /// The whole number below.
    unsafe fn floor(a: Self::F) -> Self::F;
    /// Towards zero.
    unsafe fn to_int(a: Self::F) -> Self::I;
    /// Exact below 2²⁴.
    unsafe fn to_float(a: Self::I) -> Self::F;
    /// The smallest lane.
    unsafe fn reduce_min(a: Self::F) -> f32;

    /// All lanes alike.
    unsafe fn splat_int(v: i32) -> Self::I;
    /// To memory.
    unsafe fn store_int(v: Self::I, out: &mut [i32; LANES]);
    /// a + b, wrapping.
    unsafe fn add_int(a: Self::I, b: Self::I) -> Self::I;
    /// a − b, wrapping.
    unsafe fn sub_int(a: Self::I, b: Self::I) -> Self::I;
    /// a · b, wrapping.
    unsafe fn mul_int(a: Self::I, b: Self::I) -> Self::I;
    /// The smaller, signed.
    unsafe fn min_int(a: Self::I, b: Self::I) -> Self::I;
    /// The larger, signed.
    unsafe fn max_int(a: Self::I, b: Self::I) -> Self::I;
    /// Bitwise and.
    unsafe fn and_int(a: Self::I, b: Self::I) -> Self::I;
    /// Logical shift right by a constant.
    unsafe fn shr<const N: u32>(a: Self::I) -> Self::I;
    /// Arithmetic shift right by a constant.
    unsafe fn sar<const N: u32>(a: Self::I) -> Self::I;
    /// Shift left by a constant.
    unsafe fn shl<const N: u32>(a: Self::I) -> Self::I;
    /// Logical shift right by a number of bits in each lane.
    unsafe fn shr_by(a: Self::I, bits: Self::I) -> Self::I;
    /// `a` in the lanes whose bit is set, else `b`.
    unsafe fn select_int(bits: u32, a: Self::I, b: Self::I) -> Self::I;
    /// The same bits as f32.
    unsafe fn as_float(a: Self::I) -> Self::F;
    /// Four bytes at each byte offset, unaligned.
    unsafe fn gather(base: *const u8, offset: Self::I) -> Self::I;

    /// Sixteen premultiplied colours with opacity.
    type Quads: Copy;
    /// From memory.
    unsafe fn load_quads(v: &[[f32; 4]; LANES]) -> Self::Quads;
    /// To memory.
    unsafe fn store_quads(v: Self::Quads, out: &mut [[f32; 4]; LANES]);
    /// Lays one sample a lane behind what is there: `c + (1 − c.a)·e`, where e is interpolated at
    /// `fraction` between the entries at `table + index` (in bytes) and the one after it.
    unsafe fn under(c: Self::Quads, table: *const u8, index: &[i32; LANES], fraction: &[f32; LANES]) -> Self::Quads;
    /// The same with e interpolated in both directions of a table of pairs, whose rows are
    /// `stride` bytes: `back` along a row, `front` from row to row.
    unsafe fn under_pairs(
        c: Self::Quads,
        table: *const u8,
        stride: usize,
        index: &[i32; LANES],
        front: &[f32; LANES],
        back: &[f32; LANES],
    ) -> Self::Quads;
}

/// a · b + c, fused where the target has that.
#[inline(always)]
pub fn fused(a: f32, b: f32, c: f32) -> f32 {
    if cfg!(any(target_feature = "fma", target_arch = "aarch64")) { a.mul_add(b, c) } else { a * b + c }
}

/// `under` of one lane, with a unit's multiply-add.
#[inline(always)]
unsafe fn under_lane(fma: impl Fn(f32, f32, f32) -> f32, c: [f32; 4], table: *const u8, index: i32, fraction: f32) -> [f32; 4] {
    // SAFETY: the caller's indices lie inside the table, which has an entry after each.
    let [a, b] = unsafe { table.offset(index as isize).cast::<[[f32; 4]; 2]>().read_unaligned() };
    let left = 1.0 - c[3];
    [0, 1, 2, 3].map(|i| fma(left, fma(fraction, b[i] - a[i], a[i]), c[i]))
}

/// `under_pairs` of one lane.
#[inline(always)]
unsafe fn under_pairs_lane(
    fma: impl Fn(f32, f32, f32) -> f32,
    c: [f32; 4],
    table: *const u8,
    stride: usize,
    index: i32,
    [front, back]: [f32; 2],
) -> [f32; 4] {
    // SAFETY: the caller's indices lie inside the table, which has an entry and a row after each.
    let ([a, b], [p, q]) = unsafe {
        let at = table.offset(index as isize);
        let row = |at: *const u8| at.cast::<[[f32; 4]; 2]>().read_unaligned();
        (row(at), row(at.add(stride)))
    };
    let left = 1.0 - c[3];
    [0, 1, 2, 3].map(|i| {
        let (x, y) = (fma(back, b[i] - a[i], a[i]), fma(back, q[i] - p[i], p[i]));
        fma(left, fma(front, y - x, x), c[i])
    })
}

macro_rules! quads_by_lane {
    ($fma:expr) => {
        type Quads = [[f32; 4]; LANES];
        #[inline(always)]
        unsafe fn load_quads(v: &[[f32; 4]; LANES]) -> Self::Quads {
            *v
        }
        #[inline(always)]
        unsafe fn store_quads(v: Self::Quads, out: &mut [[f32; 4]; LANES]) {
            *out = v;
        }
        #[inline(always)]
        unsafe fn under(
            mut c: Self::Quads,
            table: *const u8,
            index: &[i32; LANES],
            fraction: &[f32; LANES],
        ) -> Self::Quads {
            for l in 0..LANES {
                // SAFETY: the caller's.
                c[l] = unsafe { super_under($fma, c[l], table, index[l], fraction[l]) };
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
            for l in 0..LANES {
                // SAFETY: the caller's.
                c[l] = unsafe { super_under_pairs($fma, c[l], table, stride, index[l], [front[l], back[l]]) };
            }
            c
        }
    };
}
use {under_lane as super_under, under_pairs_lane as super_under_pairs};

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

#[cfg(target_arch = "x86_64")]
pub use x86::{Avx2, Avx512};

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{LANES, Simd, super_under, super_under_pairs};
    use std::arch::x86_64::*;

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
            fn fma(a: __m512, b: __m512, c: __m512) -> __m512 { _mm512_fmadd_ps(a, b, c) }
            fn min(a: __m512, b: __m512) -> __m512 { _mm512_min_ps(a, b) }
            fn max(a: __m512, b: __m512) -> __m512 { _mm512_max_ps(a, b) }
            fn where_zero(t: __m512, a: __m512, b: __m512) -> __m512 {
                _mm512_mask_blend_ps(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(t, _mm512_setzero_ps()), b, a)
            }
            fn lt_bits(a: __m512, b: __m512) -> u32 { u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b)) }
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
            fn as_float(a: __m512i) -> __m512 { _mm512_castsi512_ps(a) }
            fn gather(base: *const u8, offset: __m512i) -> __m512i {
                _mm512_i32gather_epi32::<1>(offset, base.cast())
            }
        }

        type Quads = [__m512; 4];
        #[inline(always)]
        unsafe fn load_quads(v: &[[f32; 4]; LANES]) -> Self::Quads {
            // SAFETY: four lanes of four are sixteen f32.
            unsafe {
                let at = v.as_ptr().cast::<f32>();
                [
                    _mm512_loadu_ps(at),
                    _mm512_loadu_ps(at.add(16)),
                    _mm512_loadu_ps(at.add(32)),
                    _mm512_loadu_ps(at.add(48)),
                ]
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
                super::Plain::reduce_min(out)
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
        unsafe fn as_float(a: Self::I) -> Self::F {
            both!(|a| _mm256_castsi256_ps(a))
        }
        #[inline(always)]
        unsafe fn gather(base: *const u8, offset: Self::I) -> Self::I {
            both!(|offset| _mm256_i32gather_epi32::<1>(base.cast(), offset))
        }

        quads_by_lane!(|a, b, c| f32::mul_add(a, b, c));
    }
}
