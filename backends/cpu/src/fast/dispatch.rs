//! From the vector unit and voxel type found at run time to the kernel compiled for them.
#![expect(unsafe_code, reason = "calls kernels of a vector unit that was found")]

use volact_core::camera::LinearRays;

use super::{
    fetch::{self, Access},
    over::{self, Pixels},
    packet::{Bundle, Packet, Place, Span},
    reduce::{self, Reduced},
    simd::{LANES, Plain, Simd, Unit},
    walk::Counts,
};

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
unsafe fn over_by<S: Simd>(job: &over::Job<'_>, packet: &Packet, pixels: &mut Pixels, counts: &mut Counts) {
    // SAFETY: the caller's promises.
    by_access!(job.voxels.access(), F => unsafe { over::draw::<S, F>(job, packet, pixels, counts) })
}

#[inline(always)]
unsafe fn reduce_by<S: Simd>(job: &reduce::Job<'_>, packet: &Packet, out: &mut [Reduced; LANES], counts: &mut Counts) {
    // SAFETY: the caller's promises.
    by_access!(job.voxels.access(), F => unsafe { reduce::reduce::<S, F>(job, packet, out, counts) })
}

/// Functions compiled for each unit, and the one that chooses.
macro_rules! by_unit {
    ($(#[$doc:meta])* $name:ident($($arg:ident: $t:ty),*) $(-> $r:ty)?, $($S:ident)? => $call:expr) => {
        $(#[$doc])*
        pub fn $name(unit: Unit, $($arg: $t),*) $(-> $r)? {
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma")]
            unsafe fn avx512($($arg: $t),*) $(-> $r)? {
                $(type $S = super::simd::Avx512;)?
                // SAFETY: compiled for the unit; the caller has found it.
                unsafe { $call }
            }
            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            unsafe fn avx2($($arg: $t),*) $(-> $r)? {
                $(type $S = super::simd::Avx2;)?
                // SAFETY: as above.
                unsafe { $call }
            }
            unsafe fn plain($($arg: $t),*) $(-> $r)? {
                $(type $S = Plain;)?
                // SAFETY: as above.
                unsafe { $call }
            }
            debug_assert!(unit.available());
            // SAFETY: units are only made by `Unit::detect` or after `Unit::available`.
            unsafe {
                match unit {
                    #[cfg(target_arch = "x86_64")]
                    Unit::Avx512 => avx512($($arg),*),
                    #[cfg(target_arch = "x86_64")]
                    Unit::Avx2 => avx2($($arg),*),
                    _ => plain($($arg),*),
                }
            }
        }
    };
}

/// # Safety
/// None of its own: it is unsafe so that it is called like the kernels.
#[inline(always)]
unsafe fn bundle_by(rays: &LinearRays, pixel: [usize; 2], size: [usize; 2]) -> Bundle {
    Bundle::new(rays, pixel, size)
}

/// # Safety
/// As above.
#[inline(always)]
unsafe fn aim_by(bundle: &Bundle, span: &Span, place: &Place) -> Packet {
    Packet::new(bundle, span, place)
}

by_unit! {
    /// The rays of sixteen pixels of a viewport of `size`.
    bundle(rays: &LinearRays, pixel: [usize; 2], size: [usize; 2]) -> Bundle,
    => bundle_by(rays, pixel, size)
}

by_unit! {
    /// The rays of a bundle inside a shape's box, where `span` holds them.
    aim(bundle: &Bundle, span: &Span, place: &Place) -> Packet,
    => aim_by(bundle, span, place)
}

by_unit! {
    /// Draws a packet of an `over` shape behind what is there.
    draw(job: &over::Job<'_>, packet: &Packet, pixels: &mut Pixels, counts: &mut Counts),
    S => over_by::<S>(job, packet, pixels, counts)
}

by_unit! {
    /// Reduces a packet of a shape composited by maximum, minimum, average or add.
    reduce(job: &reduce::Job<'_>, packet: &Packet, out: &mut [Reduced; LANES], counts: &mut Counts),
    S => reduce_by::<S>(job, packet, out, counts)
}
