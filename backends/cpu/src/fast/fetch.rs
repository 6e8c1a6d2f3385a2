//! Reading voxels: trilinear interpolation for sixteen positions at once.
//!
//! Positions are in sample coordinates, local to a whole-numbered base near the packet, so that
//! f32 keeps their fractions. One 32-bit gather brings a voxel and its right neighbour for 8-bit
//! and 16-bit types; f32 takes two. Other types, several components and sizes that 32-bit offsets
//! cannot reach go through [`Scattered`], lane by lane.
#![expect(unsafe_code, reason = "gathers of voxels")]

use volact_core::{Filter, ScalarType, VolumeTexture};

use super::simd::{LANES, Simd, fused};

/// What kernels know of a volume's voxels. Offsets are in voxels of one component.
#[derive(Clone, Copy, Debug)]
pub struct Voxels<'a> {
    /// The bytes, native byte order.
    pub bytes: &'a [u8],
    /// Type of each number.
    pub scalar: ScalarType,
    /// Numbers a voxel.
    pub components: usize,
    /// The component read.
    pub component: usize,
    /// Samples along each axis of the whole data.
    pub dims: [usize; 3],
    /// First sample of the data ROI.
    pub min: [usize; 3],
    /// Last sample of the data ROI.
    pub max: [usize; 3],
    /// Nearest instead of trilinear.
    pub nearest: bool,
    /// What `Scattered` makes of a stored number: `(stored − origin) · gain`.
    pub origin: f64,
    /// See `origin`.
    pub gain: f64,
    /// Whether offsets between any two voxels are exact in f32: at most 2²⁴ voxels.
    pub small: bool,
}

/// How voxels can be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// 32-bit gathers of 8-bit numbers, unsigned.
    U8,
    /// The same, signed.
    I8,
    /// 32-bit gathers of 16-bit numbers, unsigned.
    U16,
    /// The same, signed.
    I16,
    /// 32-bit gathers of f32.
    F32,
    /// Lane by lane.
    Scattered,
}

impl<'a> Voxels<'a> {
    /// The voxels of a texture's component.
    pub fn new(texture: &'a VolumeTexture, component: usize) -> Self {
        let (volume, roi) = (texture.volume(), texture.data_roi());
        Self {
            bytes: volume.data().bytes(),
            scalar: volume.desc().scalar,
            components: volume.desc().components,
            component,
            dims: volume.dims(),
            min: roi.min,
            max: roi.max,
            nearest: texture.filter() == Filter::Nearest,
            origin: 0.0,
            gain: 1.0,
            small: volume.dims().iter().product::<usize>() <= 1 << 24,
        }
    }

    /// The fastest way to read them.
    pub fn access(&self) -> Access {
        let [nx, ny, _] = self.dims;
        let reach = self.bytes.len() <= i32::MAX as usize && self.bytes.len() >= 4 && nx.max(ny) < 1 << 20;
        let pairs = self.max[0] > self.min[0] || self.scalar == ScalarType::F32;
        if self.components != 1 || self.nearest || !reach || !pairs || !self.stored() {
            return Access::Scattered;
        }
        match self.scalar {
            ScalarType::U8 => Access::U8,
            ScalarType::I8 => Access::I8,
            ScalarType::U16 => Access::U16,
            ScalarType::I16 => Access::I16,
            ScalarType::F32 => Access::F32,
            _ => Access::Scattered,
        }
    }

    /// Whether numbers are fetched as they are stored.
    pub fn stored(&self) -> bool {
        self.origin == 0.0 && self.gain == 1.0
    }

    /// Where a voxel's first number is.
    #[inline]
    pub fn index(&self, x: usize, y: usize, z: usize) -> usize {
        ((z * self.dims[1] + y) * self.dims[0] + x) * self.components
    }

    /// The number at an index as `(stored − origin) · gain`.
    #[inline]
    pub fn number(&self, index: usize) -> f32 {
        ((self.scalar.read(self.bytes, index) - self.origin) * self.gain) as f32
    }

    /// One number as `(stored − origin) · gain`.
    #[inline]
    pub fn at(&self, x: usize, y: usize, z: usize) -> f32 {
        self.number(self.index(x, y, z) + self.component)
    }
}

/// A packet's frame of reference: positions are relative to a whole-numbered sample.
#[derive(Clone, Copy, Debug)]
pub struct Base {
    /// The sample at local position 0.
    pub at: [i32; 3],
    /// Local positions of the data ROI's first and last samples.
    pub lo: [f32; 3],
    /// See `lo`.
    pub hi: [f32; 3],
}

impl Base {
    /// A base at a sample, which is moved into the data ROI.
    #[inline(always)]
    pub fn new(voxels: &Voxels<'_>, at: [f64; 3]) -> Self {
        let at = std::array::from_fn(|a| at[a].clamp(voxels.min[a] as f64, voxels.max[a] as f64).floor() as i32);
        let local = |v: [usize; 3]| std::array::from_fn(|a| (v[a] as i64 - i64::from(at[a])) as f32);
        Self { at, lo: local(voxels.min), hi: local(voxels.max) }
    }
}

/// Interpolated values at sixteen local positions.
///
/// # Safety
/// The unit's contract of [`Simd`]; `base` was made for `voxels`, whose access is the implementer's.
#[expect(clippy::missing_safety_doc, reason = "the contract stands above")]
pub trait Fetch: 'static {
    /// The values, in stored units (`Scattered`: after origin and gain). NaN where a NaN sample
    /// has weight.
    unsafe fn fetch<S: Simd>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3]) -> S::F;
}

/// Cell and fraction along one axis.
#[inline(always)]
unsafe fn cell<S: Simd>(p: S::F, lo: f32, hi: f32) -> (S::F, S::F) {
    // SAFETY: the caller keeps the unit's contract.
    unsafe {
        let x = S::min(S::max(p, S::splat(lo)), S::splat(hi));
        let whole = S::min(S::floor(x), S::splat((hi - 1.0).max(lo)));
        (whole, S::sub(x, whole))
    }
}

/// a + t·(b − a).
///
/// # Safety
/// The contract of [`Simd`].
#[inline(always)]
pub unsafe fn lerp<S: Simd>(a: S::F, b: S::F, t: S::F) -> S::F {
    // SAFETY: the caller keeps the unit's contract.
    unsafe { S::fma(t, S::sub(b, a), a) }
}

/// As `lerp`, but `a` alone where `t` is 0: a NaN without weight does not count.
///
/// # Safety
/// The contract of [`Simd`].
#[inline(always)]
pub unsafe fn lerp_nan<S: Simd>(a: S::F, b: S::F, t: S::F) -> S::F {
    // SAFETY: the caller keeps the unit's contract.
    unsafe { S::where_zero(t, a, lerp::<S>(a, b, t)) }
}

/// Bytes from row to row and from slab to slab.
#[inline(always)]
pub fn strides(voxels: &Voxels<'_>, size: i32) -> [i32; 2] {
    let row = (voxels.dims[0] as i32).wrapping_mul(size);
    [row, row.wrapping_mul(voxels.dims[1] as i32)]
}

/// Byte offsets of voxels, relative to the base's.
///
/// # Safety
/// The contract of [`Simd`].
#[inline(always)]
pub unsafe fn offset<S: Simd>(voxels: &Voxels<'_>, [x, y, z]: [S::F; 3], size: i32) -> S::I {
    // SAFETY: the caller keeps the unit's contract.
    unsafe {
        if voxels.small {
            // Offsets in voxels stay below 2²⁴: exact in f32, and cheaper than integer products.
            let row = S::splat(voxels.dims[0] as f32);
            let slab = S::splat((voxels.dims[0] * voxels.dims[1]) as f32);
            let start = S::to_int(S::fma(z, slab, S::fma(y, row, x)));
            return match size {
                1 => start,
                2 => S::shl::<1>(start),
                _ => S::shl::<2>(start),
            };
        }
        let ([row, slab], (x, y, z)) = (strides(voxels, size), (S::to_int(x), S::to_int(y), S::to_int(z)));
        S::add_int(
            S::mul_int(x, S::splat_int(size)),
            S::add_int(S::mul_int(y, S::splat_int(row)), S::mul_int(z, S::splat_int(slab))),
        )
    }
}

/// Byte offsets of the four rows of a cell, relative to the base's voxel, and fractions.
#[inline(always)]
unsafe fn rows<S: Simd>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3], size: i32) -> ([S::I; 4], [S::F; 3]) {
    // SAFETY: the caller keeps the unit's contract.
    unsafe {
        let (x, fx) = cell::<S>(p[0], base.lo[0], base.hi[0]);
        let (y, fy) = cell::<S>(p[1], base.lo[1], base.hi[1]);
        let (z, fz) = cell::<S>(p[2], base.lo[2], base.hi[2]);
        let (start, [row, slab]) = (offset::<S>(voxels, [x, y, z], size), strides(voxels, size));
        let dy = S::splat_int(if voxels.max[1] > voxels.min[1] { row } else { 0 });
        let dz = S::splat_int(if voxels.max[2] > voxels.min[2] { slab } else { 0 });
        let next = S::add_int(start, dz);
        ([start, S::add_int(start, dy), next, S::add_int(next, dy)], [fx, fy, fz])
    }
}

/// The base voxel's byte offset.
#[inline(always)]
pub fn origin(voxels: &Voxels<'_>, base: &Base, size: usize) -> usize {
    let [x, y, z] = base.at.map(|v| v as usize);
    ((z * voxels.dims[1] + y) * voxels.dims[0] + x) * size
}

#[inline(always)]
unsafe fn bilinear<S: Simd>(a: [S::F; 4], b: [S::F; 4], f: [S::F; 3]) -> S::F {
    // SAFETY: the caller keeps the unit's contract.
    unsafe {
        let front = lerp::<S>(lerp::<S>(a[0], b[0], f[0]), lerp::<S>(a[1], b[1], f[0]), f[1]);
        let back = lerp::<S>(lerp::<S>(a[2], b[2], f[0]), lerp::<S>(a[3], b[3], f[0]), f[1]);
        lerp::<S>(front, back, f[2])
    }
}

macro_rules! small {
    ($name:ident, $size:literal, $doc:literal, |$raw:ident| $low:expr, $high:expr) => {
        #[doc = $doc]
        pub struct $name;

        impl Fetch for $name {
            #[inline(always)]
            unsafe fn fetch<S: Simd>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3]) -> S::F {
                // SAFETY: cells lie inside the data ROI, so that a voxel and its right neighbour
                // exist; `tail` keeps the four bytes of the last 8-bit pairs inside.
                unsafe {
                    let (rows, f) = rows::<S>(voxels, base, p, $size);
                    let start = origin(voxels, base, $size);
                    let pointer = voxels.bytes.as_ptr().add(start);
                    let end = (voxels.bytes.len() as i64 - 4 - start as i64) as i32;
                    let mut a = [f[0]; 4];
                    let mut b = [f[0]; 4];
                    // Only the last row of a cell can end at the last byte, unless an axis is flat.
                    let flat = voxels.max[1] == voxels.min[1] || voxels.max[2] == voxels.min[2];
                    for i in 0..4 {
                        let $raw = if $size == 1 && (i == 3 || flat) {
                            tail::<S>(pointer, rows[i], end)
                        } else {
                            S::gather(pointer, rows[i])
                        };
                        a[i] = S::to_float($low);
                        b[i] = S::to_float($high);
                    }
                    bilinear::<S>(a, b, f)
                }
            }
        }
    };
}

/// Gathers four bytes; where they would pass the end, the last four shifted into place.
#[inline(always)]
unsafe fn tail<S: Simd>(pointer: *const u8, offset: S::I, end: i32) -> S::I {
    // SAFETY: the caller's offsets lie inside; `end` is the last that four bytes can be read at.
    unsafe {
        let inside = S::min_int(offset, S::splat_int(end));
        let past = S::sub_int(offset, inside);
        S::shr_by(S::gather(pointer, inside), S::shl::<3>(past))
    }
}

small!(
    U8,
    1,
    "8-bit, unsigned.",
    |raw| S::and_int(raw, S::splat_int(255)),
    S::and_int(S::shr::<8>(raw), S::splat_int(255))
);
small!(I8, 1, "8-bit, signed.", |raw| S::sar::<24>(S::shl::<24>(raw)), S::sar::<24>(S::shl::<16>(raw)));
small!(U16, 2, "16-bit, unsigned.", |raw| S::and_int(raw, S::splat_int(0xffff)), S::shr::<16>(raw));
small!(I16, 2, "16-bit, signed.", |raw| S::sar::<16>(S::shl::<16>(raw)), S::sar::<16>(raw));

/// f32.
pub struct F32;

impl Fetch for F32 {
    #[inline(always)]
    unsafe fn fetch<S: Simd>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3]) -> S::F {
        // SAFETY: cells lie inside the data ROI; an axis of one sample has no neighbour read.
        unsafe {
            let (rows, f) = rows::<S>(voxels, base, p, 4);
            let pointer = voxels.bytes.as_ptr().add(origin(voxels, base, 4));
            let right = S::splat_int(if voxels.max[0] > voxels.min[0] { 4 } else { 0 });
            let mut x = [f[0]; 4];
            for i in 0..4 {
                let a = S::as_float(S::gather(pointer, rows[i]));
                let b = S::as_float(S::gather(pointer, S::add_int(rows[i], right)));
                x[i] = lerp_nan::<S>(a, b, f[0]);
            }
            let front = lerp_nan::<S>(x[0], x[1], f[1]);
            lerp_nan::<S>(front, lerp_nan::<S>(x[2], x[3], f[1]), f[2])
        }
    }
}

/// Any type, lane by lane; nearest, too.
pub struct Scattered;

impl Fetch for Scattered {
    #[inline(always)]
    unsafe fn fetch<S: Simd>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3]) -> S::F {
        let mut local = [[0f32; LANES]; 3];
        // SAFETY: the caller keeps the unit's contract.
        unsafe {
            for a in 0..3 {
                S::store(p[a], &mut local[a]);
            }
        }
        let value: [f32; LANES] = std::array::from_fn(|l| scattered(voxels, base, local.map(|p| p[l])));
        // SAFETY: as above.
        unsafe { S::load(&value) }
    }
}

/// The lowest voxel of the cell at a local position, steps to its neighbours and fractions; where
/// the filter is nearest, that voxel and no fractions.
#[inline(always)]
pub fn cell_of(voxels: &Voxels<'_>, base: &Base, local: [f32; 3]) -> ([usize; 3], [usize; 3], [f32; 3]) {
    let mut i = [0usize; 3];
    let mut f = [0f32; 3];
    let mut step = [0usize; 3];
    for a in 0..3 {
        let x = local[a].max(base.lo[a]).min(base.hi[a]);
        let sample = |whole: f32| (i64::from(base.at[a]) + whole as i64) as usize;
        if voxels.nearest {
            i[a] = sample((x + 0.5).floor().min(base.hi[a]));
        } else if voxels.max[a] > voxels.min[a] {
            let whole = x.floor().min(base.hi[a] - 1.0);
            (i[a], f[a], step[a]) = (sample(whole), x - whole, 1);
        } else {
            i[a] = voxels.min[a];
        }
    }
    (i, step, f)
}

fn scattered(voxels: &Voxels<'_>, base: &Base, local: [f32; 3]) -> f32 {
    let (i, step, f) = cell_of(voxels, base, local);
    if voxels.nearest {
        return voxels.at(i[0], i[1], i[2]);
    }
    let mix = |a: f32, b: f32, t: f32| if t == 0.0 { a } else { fused(t, b - a, a) };
    let line = |y, z| mix(voxels.at(i[0], y, z), voxels.at(i[0] + step[0], y, z), f[0]);
    let plane = |z| mix(line(i[1], z), line(i[1] + step[1], z), f[1]);
    mix(plane(i[2]), plane(i[2] + step[2]), f[2])
}
