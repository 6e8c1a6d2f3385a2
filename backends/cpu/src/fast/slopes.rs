//! Central differences of the interpolated field: six values around a position from the rows of
//! voxels that they share, sixteen at once.
//!
//! The field one voxel before and after along x, y and z needs 32 voxels, in four rows of four and
//! eight of two; six interpolations on their own read 48.
#![expect(unsafe_code, reason = "gathers of voxels")]

use super::{
    fetch::{Base, F32, Fetch, I8, I16, Scattered, U8, U16, Voxels, lerp, lerp_nan, offset, origin, strides},
    simd::Simd,
    walk::ALL,
};

/// Differences of the field, after minus before, by axis.
///
/// # Safety
/// The contract of [`Fetch`].
#[expect(clippy::missing_safety_doc, reason = "the contract stands above")]
pub trait Slopes: Fetch {
    /// The value one voxel after a position minus that one voxel before, by axis; values beyond the
    /// base's bounds are those at the bounds.
    unsafe fn slopes<S: Simd>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3]) -> [S::F; 3];
}

/// Neighbouring voxels along x.
///
/// # Safety
/// The unit's contract of [`Simd`]; the voxels exist.
trait Runs: Fetch {
    /// Bytes of a voxel.
    const SIZE: i32;
    /// Two at byte offsets, beyond which two bytes more can be read.
    unsafe fn pair<S: Simd>(pointer: *const u8, at: S::I) -> [S::F; 2];
    /// Four at byte offsets.
    unsafe fn four<S: Simd>(pointer: *const u8, at: S::I) -> [S::F; 4];
    /// a + t·(b − a).
    unsafe fn between<S: Simd>(a: S::F, b: S::F, t: S::F) -> S::F;
}

/// Each value on its own.
#[inline(always)]
unsafe fn apart<S: Simd, F: Fetch>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3]) -> [S::F; 3] {
    let mut slopes = p;
    // SAFETY: the caller's promises.
    unsafe {
        let one = S::splat(1.0);
        for a in 0..3 {
            let (mut after, mut before) = (p, p);
            after[a] = S::add(p[a], one);
            before[a] = S::sub(p[a], one);
            slopes[a] = S::sub(F::fetch::<S>(voxels, base, after), F::fetch::<S>(voxels, base, before));
        }
    }
    slopes
}

/// The same from shared rows, where all of them lie inside.
#[inline(always)]
unsafe fn shared<S: Simd, F: Runs>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3]) -> [S::F; 3] {
    // SAFETY: the caller's promises; cells are moved to where a voxel before and two after exist.
    unsafe {
        let (mut inside, mut cell, mut f) = (ALL, p, p);
        for a in 0..3 {
            let (low, high) = (base.lo[a] + 1.0, base.hi[a] - 2.0);
            if low > high {
                return apart::<S, F>(voxels, base, p);
            }
            let whole = S::floor(p[a]);
            inside &= !(S::lt_bits(whole, S::splat(low)) | S::lt_bits(S::splat(high), whole));
            cell[a] = S::min(S::max(whole, S::splat(low)), S::splat(high));
            f[a] = S::sub(p[a], cell[a]);
        }
        let (start, [row, slab]) = (offset::<S>(voxels, cell, F::SIZE), strides(voxels, F::SIZE));
        let pointer = voxels.bytes.as_ptr().add(origin(voxels, base, F::SIZE as usize));
        let [fx, fy, fz] = f;
        // Where x is: the four rows of the cell, then those before and after in y and in z.
        let mut here = [[fx; 2]; 2];
        let mut along = [[fx; 2]; 2];
        for k in 0..2 {
            for j in 0..2 {
                let at = j as i32 * row + k as i32 * slab - F::SIZE;
                let [a, b, c, d] = F::four::<S>(pointer, S::add_int(start, S::splat_int(at)));
                here[k][j] = F::between::<S>(b, c, fx);
                along[k][j] = S::sub(F::between::<S>(c, d, fx), F::between::<S>(a, b, fx));
            }
        }
        let mut sides = [[fx; 2]; 4];
        for (side, (away, beside)) in
            sides.iter_mut().zip([(-row, slab), (2 * row, slab), (-slab, row), (2 * slab, row)])
        {
            let first = S::add_int(start, S::splat_int(away));
            let [b, c] = F::pair::<S>(pointer, first);
            side[0] = F::between::<S>(b, c, fx);
            let [b, c] = F::pair::<S>(pointer, S::add_int(first, S::splat_int(beside)));
            side[1] = F::between::<S>(b, c, fx);
        }
        let mut y = [fx; 2];
        let mut z = [fx; 2];
        for i in 0..2 {
            let (before, after) = (sides[0][i], sides[1][i]);
            y[i] = S::sub(F::between::<S>(here[i][1], after, fy), F::between::<S>(before, here[i][0], fy));
            let (before, after) = (sides[2][i], sides[3][i]);
            z[i] = S::sub(F::between::<S>(here[1][i], after, fz), F::between::<S>(before, here[0][i], fz));
        }
        let front = F::between::<S>(along[0][0], along[0][1], fy);
        let back = F::between::<S>(along[1][0], along[1][1], fy);
        let slopes =
            [F::between::<S>(front, back, fz), F::between::<S>(y[0], y[1], fz), F::between::<S>(z[0], z[1], fy)];
        if inside & ALL == ALL {
            return slopes;
        }
        let border = apart::<S, F>(voxels, base, p);
        let mut both = slopes;
        for a in 0..3 {
            both[a] = S::select(inside, slopes[a], border[a]);
        }
        both
    }
}

macro_rules! runs {
    ($($name:ident $size:literal |$at:ident, $pointer:ident, $S:ident| $pair:expr, $four:expr, $between:ident;)*) => {$(
        impl Runs for $name {
            const SIZE: i32 = $size;
            #[inline(always)]
            unsafe fn pair<$S: Simd>($pointer: *const u8, $at: $S::I) -> [$S::F; 2] {
                // SAFETY: the caller's promises.
                unsafe { $pair }
            }
            #[inline(always)]
            unsafe fn four<$S: Simd>($pointer: *const u8, $at: $S::I) -> [$S::F; 4] {
                // SAFETY: the caller's promises.
                unsafe { $four }
            }
            #[inline(always)]
            unsafe fn between<$S: Simd>(a: $S::F, b: $S::F, t: $S::F) -> $S::F {
                // SAFETY: the caller's promises.
                unsafe { $between::<$S>(a, b, t) }
            }
        }

        impl Slopes for $name {
            #[inline(always)]
            unsafe fn slopes<S: Simd>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3]) -> [S::F; 3] {
                // SAFETY: the caller's promises.
                unsafe { shared::<S, Self>(voxels, base, p) }
            }
        }
    )*};
}

/// Bytes 0 to 3 of gathered words as numbers.
macro_rules! bytes {
    ($S:ident, $raw:expr, signed) => {{
        let raw = $raw;
        [$S::shl::<24>(raw), $S::shl::<16>(raw), $S::shl::<8>(raw), raw].map(|v| $S::to_float($S::sar::<24>(v)))
    }};
    ($S:ident, $raw:expr, unsigned) => {{
        let raw = $raw;
        let low = $S::splat_int(255);
        [
            $S::to_float($S::and_int(raw, low)),
            $S::to_float($S::and_int($S::shr::<8>(raw), low)),
            $S::to_float($S::and_int($S::shr::<16>(raw), low)),
            $S::to_float($S::shr::<24>(raw)),
        ]
    }};
}

/// Both halves of gathered words as numbers.
macro_rules! halves {
    ($S:ident, $raw:expr, signed) => {{
        let raw = $raw;
        [$S::to_float($S::sar::<16>($S::shl::<16>(raw))), $S::to_float($S::sar::<16>(raw))]
    }};
    ($S:ident, $raw:expr, unsigned) => {{
        let raw = $raw;
        [$S::to_float($S::and_int(raw, $S::splat_int(0xffff))), $S::to_float($S::shr::<16>(raw))]
    }};
}

#[inline(always)]
unsafe fn further<S: Simd>(at: S::I, bytes: i32) -> S::I {
    // SAFETY: the caller's promises.
    unsafe { S::add_int(at, S::splat_int(bytes)) }
}

/// One f32 at byte offsets.
#[inline(always)]
unsafe fn one<S: Simd>(pointer: *const u8, at: S::I, bytes: i32) -> S::F {
    // SAFETY: the caller's promises.
    unsafe { S::as_float(S::gather(pointer, further::<S>(at, bytes))) }
}

/// The first two of four.
#[inline(always)]
fn two<T>([a, b, _, _]: [T; 4]) -> [T; 2] {
    [a, b]
}

/// Two pairs.
#[inline(always)]
fn joined<T>([a, b]: [T; 2], [c, d]: [T; 2]) -> [T; 4] {
    [a, b, c, d]
}

runs! {
    U8 1 |at, pointer, S| two(bytes!(S, S::gather(pointer, at), unsigned)), bytes!(S, S::gather(pointer, at), unsigned), lerp;
    I8 1 |at, pointer, S| two(bytes!(S, S::gather(pointer, at), signed)), bytes!(S, S::gather(pointer, at), signed), lerp;
    U16 2 |at, pointer, S| halves!(S, S::gather(pointer, at), unsigned), joined(
        halves!(S, S::gather(pointer, at), unsigned),
        halves!(S, S::gather(pointer, further::<S>(at, 4)), unsigned)
    ), lerp;
    I16 2 |at, pointer, S| halves!(S, S::gather(pointer, at), signed), joined(
        halves!(S, S::gather(pointer, at), signed),
        halves!(S, S::gather(pointer, further::<S>(at, 4)), signed)
    ), lerp;
    F32 4 |at, pointer, S| [one::<S>(pointer, at, 0), one::<S>(pointer, at, 4)], [
        one::<S>(pointer, at, 0),
        one::<S>(pointer, at, 4),
        one::<S>(pointer, at, 8),
        one::<S>(pointer, at, 12),
    ], lerp_nan;
}

impl Slopes for Scattered {
    #[inline(always)]
    unsafe fn slopes<S: Simd>(voxels: &Voxels<'_>, base: &Base, p: [S::F; 3]) -> [S::F; 3] {
        // SAFETY: the caller's promises.
        unsafe { apart::<S, Self>(voxels, base, p) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fast::{
        dispatch,
        simd::{LANES, Unit},
    };
    use volact_core::{ScalarType, Volume, VolumeDesc, VolumeTexture};

    /// Positions everywhere in and around a volume, with whole numbers and borders.
    fn positions(dims: [usize; 3]) -> Vec<[f32; 3]> {
        let along = |n: usize| (-3..=2 * n as i32 + 2).map(|i| i as f32 * 0.5 - 0.13 * (i % 3) as f32);
        let mut all = Vec::new();
        for z in along(dims[2]) {
            for y in along(dims[1]) {
                all.extend(along(dims[0]).map(|x| [x, y, z]));
            }
        }
        while all.len() % LANES != 0 {
            all.push([1.0; 3]);
        }
        all
    }

    #[test]
    fn shared_rows_give_the_differences_of_single_values() {
        for (scalar, dims) in [
            (ScalarType::U8, [6, 5, 7]),
            (ScalarType::I8, [5, 5, 4]),
            (ScalarType::U16, [7, 4, 5]),
            (ScalarType::I16, [4, 6, 5]),
            (ScalarType::F32, [5, 6, 4]),
            (ScalarType::F64, [5, 4, 4]),
            (ScalarType::U8, [3, 5, 5]),
            (ScalarType::F32, [5, 1, 5]),
        ] {
            let count = dims.iter().product::<usize>();
            let number = |i: usize| {
                (i * 37 % 101) as i64 - if matches!(scalar, ScalarType::U8 | ScalarType::U16) { 0 } else { 50 }
            };
            let mut bytes = Vec::new();
            for i in 0..count {
                match scalar {
                    ScalarType::F32 => bytes.extend((number(i) as f32).to_ne_bytes()),
                    ScalarType::F64 => bytes.extend((number(i) as f64).to_ne_bytes()),
                    _ => bytes.extend(&number(i).to_le_bytes()[..scalar.size()]),
                }
            }
            let volume = Volume::new(VolumeDesc::new(dims, scalar, 1), bytes).unwrap();
            let texture = VolumeTexture::new(&volume);
            let voxels = Voxels::new(&texture, 0);
            let base = Base::new(&voxels, [1.5; 3]);
            for unit in [Unit::Plain, Unit::Avx2, Unit::Avx512].into_iter().filter(|u| u.available()) {
                for some in positions(dims).as_chunks::<LANES>().0 {
                    let off = |a: usize, l: usize| some[l][a] - base.at[a] as f32;
                    let at: [[f32; LANES]; 3] = std::array::from_fn(|a| std::array::from_fn(|l| off(a, l)));
                    let mut found = [[0f32; LANES]; 3];
                    dispatch::slopes(unit, &voxels, &base, &at, &mut found);
                    for a in 0..3 {
                        let [mut after, mut before] = [at; 2];
                        after[a].iter_mut().for_each(|v| *v += 1.0);
                        before[a].iter_mut().for_each(|v| *v -= 1.0);
                        let [mut high, mut low] = [[0f32; LANES]; 2];
                        dispatch::numbers(unit, &voxels, &base, &after, &mut high);
                        dispatch::numbers(unit, &voxels, &base, &before, &mut low);
                        for l in 0..LANES {
                            let wanted = high[l] - low[l];
                            let error = (found[a][l] - wanted).abs();
                            assert!(
                                error < 1e-4,
                                "{scalar:?}, {unit:?}, {:?}: {} wanted {wanted}",
                                some[l],
                                found[a][l]
                            );
                        }
                    }
                }
            }
        }
    }
}
