//! From the vector unit and voxel type found at run time to the kernel compiled for them.
#![expect(unsafe_code, reason = "calls kernels of a vector unit that was found")]

use volact_core::camera::LinearRays;

use super::{
    fetch::{self, Access, Base, Fetch, Voxels},
    over::{self, Classes, Pixels},
    packet::{Bundle, Cuts, Lanes, Packet, Place, Span},
    preintegrate::SegmentPairs,
    reduce::{self, Reduced},
    shaded::{
        self, Skip,
        field::{self, Field, Places},
        lookup::{self, Lookup},
        rows,
    },
    simd::{LANES, Plain, Simd, Unit},
    slopes::Slopes,
    sweep::{
        gather::{self, Chunk, Row},
        merge::{self, Rows, Sights},
    },
    walk::Counts,
};

/// Positions by axis and lane, relative to a base.
type Local = [[f32; LANES]; 3];

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
unsafe fn whole_by<S: Simd>(
    job: &over::Job<'_>,
    at: (&Packet, &Cuts),
    done: u32,
    pixels: &mut Pixels,
    counts: &mut Counts,
) -> u32 {
    // SAFETY: the caller's promises.
    unsafe {
        if let Classes::Direct(_) = job.classes {
            return over::draw_direct::<S>(job, at, done, pixels, counts);
        }
        by_access!(job.voxels.access(), F => over::draw_numbers::<S, F>(job, at, done, pixels, counts))
    }
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
    /// Draws the whole segments of an `over` shape behind what is there; returns the lanes that are
    /// done.
    whole(
        job: &over::Job<'_>,
        at: (&Packet, &Cuts),
        done: u32,
        pixels: &mut Pixels,
        counts: &mut Counts
    ) -> u32,
    S => whole_by::<S>(job, at, done, pixels, counts)
}

/// Draws a packet of an `over` shape behind what is there.
pub fn draw(job: &over::Job<'_>, packet: &Packet, pixels: &mut Pixels, counts: &mut Counts) {
    over::draw(job, packet, pixels, counts, |cuts, done, pixels, counts| {
        whole(job.unit, job, (packet, cuts), done, pixels, counts)
    });
}

#[inline(always)]
unsafe fn classify_by<S: Simd>(job: &over::Job<'_>, base: &Base, local: &Local, live: u32, out: &mut Row) {
    match job.classes {
        // SAFETY: the caller's promises.
        Classes::Middle(table) => by_access!(job.voxels.access(), F => unsafe {
            over::classify::<S, F>(job, table, (base, local), live, out);
        }),
        Classes::Direct(direct) => direct.entries((job.unit, &job.voxels), base, local, live, out),
        Classes::Ends(_) => *out = [[0.0; 4]; LANES],
    }
}

by_unit! {
    /// What whole segments add whose middles lie at positions relative to a base. Not for
    /// classification by both ends.
    classify(job: &over::Job<'_>, base: &Base, local: &Local, live: u32, out: &mut Row),
    S => classify_by::<S>(job, base, local, live, out)
}

by_unit! {
    /// What whole segments add between sixteen pairs of numbers.
    pairs(pairs: &SegmentPairs, ends: [&[f32; LANES]; 2], live: u32, out: &mut Row),
    S => over::pair_entries::<S>(pairs, ends, live, out)
}

#[inline(always)]
unsafe fn numbers_by<S: Simd>(voxels: &Voxels<'_>, base: &Base, local: &Local, out: &mut [f32; LANES]) {
    // SAFETY: the caller's promises.
    unsafe {
        let p = [S::load(&local[0]), S::load(&local[1]), S::load(&local[2])];
        by_access!(voxels.access(), F => S::store(F::fetch::<S>(voxels, base, p), out));
    }
}

by_unit! {
    /// The numbers at positions relative to a base.
    numbers(voxels: &Voxels<'_>, base: &Base, local: &Local, out: &mut [f32; LANES]),
    S => numbers_by::<S>(voxels, base, local, out)
}

#[inline(always)]
unsafe fn slopes_by<S: Simd>(voxels: &Voxels<'_>, base: &Base, local: &Local, out: &mut Local) {
    // SAFETY: the caller's promises.
    unsafe {
        let p = [S::load(&local[0]), S::load(&local[1]), S::load(&local[2])];
        let slopes = by_access!(voxels.access(), F => F::slopes::<S>(voxels, base, p));
        for a in 0..3 {
            S::store(slopes[a], &mut out[a]);
        }
    }
}

by_unit! {
    /// By axis, the numbers one voxel after positions relative to a base minus those one before.
    slopes(voxels: &Voxels<'_>, base: &Base, local: &Local, out: &mut Local),
    S => slopes_by::<S>(voxels, base, local, out)
}

by_unit! {
    /// Gathers a chunk of one stretch; returns the next segment in which there may be something.
    gather(
        job: &over::Job<'_>,
        at: (&Packet, &Cuts),
        first: i64,
        done: u32,
        chunk: &mut Chunk,
        counts: &mut Counts
    ) -> i64,
    S => gather::gather::<S>(job, at, first, done, chunk, counts)
}

#[inline(always)]
unsafe fn values_by<S: Simd>(of: &Field<'_>, p: Places<'_>, out: &mut [f32]) {
    // SAFETY: the caller's promises.
    by_access!(of.voxels().access(), F => unsafe { field::values::<S, F>(of, p, out) });
}

/// # Safety
/// None of its own: it is unsafe so that it is called like the kernels.
#[inline(always)]
unsafe fn places_by(lines: &[[&Lanes; 2]; 3], rows: &[rows::Row], shift: f64, out: [&mut [f32]; 3]) {
    rows::places(lines, rows, shift, out);
}

by_unit! {
    /// The positions of rows of samples along lines, by axis.
    places(lines: &[[&Lanes; 2]; 3], rows: &[rows::Row], shift: f64, out: [&mut [f32]; 3]),
    => places_by(lines, rows, shift, out)
}

by_unit! {
    /// Lays the media of rows behind what sixteen rays have seen.
    composite(
        live: &[u32],
        lengths: &[[f32; LANES]],
        medium: &[&[f32]; 4],
        seen: &mut [[f32; LANES]; 4],
        alphas: &mut [[f32; LANES]]
    ),
    S => shaded::composite::<S>(live, lengths, medium, seen, alphas)
}

by_unit! {
    /// Values of a volume at places, in data units.
    field_values(of: &Field<'_>, p: Places<'_>, out: &mut [f32]),
    S => values_by::<S>(of, p, out)
}

by_unit! {
    /// Gradients of a volume at places, in data units a world unit.
    field_gradients(of: &Field<'_>, p: Places<'_>, out: &mut [&mut [f32]]),
    S => field::gradients::<S>(of, p, out)
}

by_unit! {
    /// What a table says of values.
    classified(table: &Lookup, values: &[f32], out: &mut [&mut [f32]], medium: bool),
    S => lookup::classified::<S>(table, values, out, medium)
}

by_unit! {
    /// Lit media at values and places, seen along directions.
    lit(of: &shaded::Lit<'_>, values: &[f32], places: [&[f32]; 3], along: &[Lanes; 3], out: &mut [Vec<f32>; 4]),
    S => shaded::lit::<S>(of, values, places, along, out)
}

#[cfg(test)]
#[inline(always)]
unsafe fn power_by<S: Simd>(numbers: &[f32; LANES], exponent: f32, out: &mut [f32; LANES]) {
    // SAFETY: the caller's promises.
    unsafe { S::store(super::power::power::<S>(S::load(numbers), exponent), out) }
}

#[cfg(test)]
by_unit! {
    /// Numbers of 0 to 1 to a power.
    power(numbers: &[f32; LANES], exponent: f32, out: &mut [f32; LANES]),
    S => power_by::<S>(numbers, exponent, out)
}

by_unit! {
    /// What lengths of sixteen media add: red, green, blue and extinction by lane.
    absorb(medium: &[&[f32; LANES]; 4], length: f32, out: &mut Row),
    S => shaded::absorb::<S>(medium, length, out)
}

#[inline(always)]
unsafe fn visible_by<S: Simd>(
    skip: &Skip<'_>,
    at: (&Packet, &Cuts),
    place: (f64, i64),
    done: u32,
    found: &mut shaded::Rows,
    counts: &mut Counts,
) -> i64 {
    // SAFETY: the caller's promises.
    by_access!(skip.voxels.access(), F => unsafe { shaded::visible::<S, F>(skip, at, place, done, found, counts) })
}

by_unit! {
    /// Finds the rows of a chunk in which a program may be seen, and values there; returns the next segment in which
    /// there may be something.
    visible(
        skip: &Skip<'_>,
        at: (&Packet, &Cuts),
        place: (f64, i64),
        done: u32,
        found: &mut shaded::Rows,
        counts: &mut Counts
    ) -> i64,
    S => visible_by::<S>(skip, at, place, done, found, counts)
}

#[inline(always)]
unsafe fn visit_by<S: Simd>(
    skip: &Skip<'_>,
    at: (&Packet, &Cuts),
    step: f64,
    done: u32,
    (found, take): (&mut shaded::Rows, &mut shaded::Take<'_>),
    counts: &mut Counts,
) {
    // SAFETY: the caller's promises.
    by_access!(skip.voxels.access(), F => unsafe { shaded::visit::<S, F>(skip, at, step, done, (found, take), counts) })
}

by_unit! {
    /// Visits the rows of a packet in which a program may be seen, chunk by chunk, with values there.
    visit(
        skip: &Skip<'_>,
        at: (&Packet, &Cuts),
        step: f64,
        done: u32,
        to: (&mut shaded::Rows, &mut shaded::Take<'_>),
        counts: &mut Counts
    ),
    S => visit_by::<S>(skip, at, step, done, to, counts)
}

by_unit! {
    /// Puts together what several shapes add.
    merge(chunks: &[&Chunk], rows: Rows, special: u32, sights: &mut Sights),
    S => merge::merge::<S>(chunks, rows, special, sights)
}

by_unit! {
    /// Reduces a packet of a shape composited by maximum, minimum, average or add.
    reduce(job: &reduce::Job<'_>, packet: &Packet, out: &mut [Reduced; LANES], counts: &mut Counts),
    S => reduce_by::<S>(job, packet, out, counts)
}
