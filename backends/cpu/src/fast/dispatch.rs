//! From the vector unit and voxel type found at run time to the kernel compiled for them.
#![expect(unsafe_code, reason = "calls kernels of a vector unit that was found")]

use super::{
    fetch::{self, Access},
    over::{self, Pixels},
    packet::{Packet, Rays},
    reduce::{self, Reduced},
    simd::{LANES, Plain, Simd, Unit},
    walk::Counts,
};

/// A packet's place in the picture.
#[derive(Clone, Copy, Debug)]
pub struct At {
    /// Its first pixel in the viewport.
    pub pixel: [usize; 2],
    /// The viewport's size.
    pub size: [usize; 2],
}

/// Runs `$call` with `F` bound to the fetcher of an access.
macro_rules! by_access {
    ($access:expr, $F:ident => $call:expr) => {
        match $access {
            Access::U8 => {
                type $F = fetch::U8;
                $call
            }
            Access::I8 => {
                type $F = fetch::I8;
                $call
            }
            Access::U16 => {
                type $F = fetch::U16;
                $call
            }
            Access::I16 => {
                type $F = fetch::I16;
                $call
            }
            Access::F32 => {
                type $F = fetch::F32;
                $call
            }
            Access::Scattered => {
                type $F = fetch::Scattered;
                $call
            }
        }
    };
}

#[inline(always)]
unsafe fn over_by<S: Simd>(job: &over::Job<'_>, rays: &Rays, at: At, counts: &mut Counts) -> Option<Pixels> {
    let packet = Packet::new(rays, at.pixel, at.size);
    if packet.active == 0 {
        return None;
    }
    // SAFETY: the caller's promises.
    Some(by_access!(job.voxels.access(), F => unsafe { over::draw::<S, F>(job, &packet, counts) }))
}

#[inline(always)]
unsafe fn reduce_by<S: Simd>(
    job: &reduce::Job<'_>,
    rays: &Rays,
    at: At,
    counts: &mut Counts,
) -> Option<[Reduced; LANES]> {
    let packet = Packet::new(rays, at.pixel, at.size);
    if packet.active == 0 {
        return None;
    }
    // SAFETY: the caller's promises.
    Some(by_access!(job.voxels.access(), F => unsafe { reduce::reduce::<S, F>(job, &packet, counts) }))
}

macro_rules! for_unit {
    ($over:ident, $reduce:ident, $unit:ty $(, $features:literal)?) => {
        $(#[target_feature(enable = $features)])?
        unsafe fn $over(job: &over::Job<'_>, rays: &Rays, at: At, counts: &mut Counts) -> Option<Pixels> {
            // SAFETY: compiled for the unit; the caller has found it.
            unsafe { over_by::<$unit>(job, rays, at, counts) }
        }

        $(#[target_feature(enable = $features)])?
        unsafe fn $reduce(job: &reduce::Job<'_>, rays: &Rays, at: At, counts: &mut Counts) -> Option<[Reduced; LANES]> {
            // SAFETY: as above.
            unsafe { reduce_by::<$unit>(job, rays, at, counts) }
        }
    };
}

#[cfg(target_arch = "x86_64")]
for_unit!(over_avx512, reduce_avx512, super::simd::Avx512, "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma");
#[cfg(target_arch = "x86_64")]
for_unit!(over_avx2, reduce_avx2, super::simd::Avx2, "avx2,fma");
for_unit!(over_plain, reduce_plain, Plain);

/// Draws a packet of an `over` shape; `None` where no ray meets it.
///
/// # Panics
/// If the machine has not the unit.
pub fn draw(unit: Unit, job: &over::Job<'_>, rays: &Rays, at: At, counts: &mut Counts) -> Option<Pixels> {
    debug_assert!(unit.available());
    // SAFETY: units are only made by `Unit::detect` or after `Unit::available`.
    unsafe {
        match unit {
            #[cfg(target_arch = "x86_64")]
            Unit::Avx512 => over_avx512(job, rays, at, counts),
            #[cfg(target_arch = "x86_64")]
            Unit::Avx2 => over_avx2(job, rays, at, counts),
            _ => over_plain(job, rays, at, counts),
        }
    }
}

/// Reduces a packet of a shape composited by maximum, minimum, average or add; `None` where no ray
/// meets it.
pub fn reduce(unit: Unit, job: &reduce::Job<'_>, rays: &Rays, at: At, counts: &mut Counts) -> Option<[Reduced; LANES]> {
    debug_assert!(unit.available());
    // SAFETY: as in `draw`.
    unsafe {
        match unit {
            #[cfg(target_arch = "x86_64")]
            Unit::Avx512 => reduce_avx512(job, rays, at, counts),
            #[cfg(target_arch = "x86_64")]
            Unit::Avx2 => reduce_avx2(job, rays, at, counts),
            _ => reduce_plain(job, rays, at, counts),
        }
    }
}
