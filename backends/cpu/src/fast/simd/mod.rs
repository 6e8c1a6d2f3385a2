//! Vectors of sixteen lanes, one lane a ray.
//!
//! [`Simd`] is what the kernels are written in; [`Avx512`], [`Avx2`] and [`Plain`] do the same
//! arithmetic in the same order. `Plain` is arrays that the compiler vectorises for the target's
//! baseline: SSE2 on x86-64, NEON on aarch64. Units with fused multiply-add give the same bits;
//! plain x86-64, which has none, differs by rounding.
#![expect(unsafe_code, reason = "vector intrinsics and gathers")]
#![expect(clippy::missing_safety_doc, reason = "the contract of all functions stands at the trait")]

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod plain;

pub use plain::Plain;
#[cfg(target_arch = "x86_64")]
pub use {avx2::Avx2, avx512::Avx512};

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
    /// a / b.
    unsafe fn div(a: Self::F, b: Self::F) -> Self::F;
    /// √a.
    unsafe fn sqrt(a: Self::F) -> Self::F;
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
    /// Bit *l* set where lane *l* of both is equal.
    unsafe fn eq_bits(a: Self::F, b: Self::F) -> u32;
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
    /// Bit *l* set where lane *l* of both is equal.
    unsafe fn eq_int_bits(a: Self::I, b: Self::I) -> u32;
    /// The same bits as f32.
    unsafe fn as_float(a: Self::I) -> Self::F;
    /// The same bits as i32.
    unsafe fn as_int(a: Self::F) -> Self::I;
    /// Four f32 at `base + 16·index` of every lane, which must be readable: all first ones, all
    /// second ones, and so on. Indices are unsigned.
    unsafe fn rows(base: *const u8, index: &[i32; LANES]) -> [Self::F; 4];
    /// The same at `fraction` of the way from there to the four that follow; NaN where that is NaN.
    #[inline(always)]
    unsafe fn between_rows(base: *const u8, index: &[i32; LANES], fraction: Self::F) -> [Self::F; 4] {
        // SAFETY: the caller's rows can be read.
        unsafe {
            let (from, to) = (Self::rows(base, index), Self::rows(base.add(16), index));
            let mut numbers = from;
            for c in 0..4 {
                numbers[c] = Self::fma(fraction, Self::sub(to[c], from[c]), from[c]);
            }
            numbers
        }
    }
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
unsafe fn under_lane(
    fma: impl Fn(f32, f32, f32) -> f32,
    c: [f32; 4],
    table: *const u8,
    index: i32,
    fraction: f32,
) -> [f32; 4] {
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
                c[l] = unsafe { $crate::fast::simd::under_lane($fma, c[l], table, index[l], fraction[l]) };
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
                c[l] = unsafe {
                    $crate::fast::simd::under_pairs_lane($fma, c[l], table, stride, index[l], [front[l], back[l]])
                };
            }
            c
        }
    };
}
use quads_by_lane;
