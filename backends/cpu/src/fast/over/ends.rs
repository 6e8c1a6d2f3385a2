//! Segments one at a time: the cut ones at the ends of intervals, and classification of sixteen
//! positions.
#![expect(clippy::needless_range_loop, reason = "a lane indexes several arrays")]

use super::{Classes, Job, Pixels, part_of, power, under};
use volact_core::mutated;

use crate::fast::{
    classify::SegmentTable,
    dispatch,
    fetch::{Base, Fetch, Voxels},
    packet::Packet,
    preintegrate::SegmentPairs,
    simd::{LANES, Simd},
    walk::Counts,
};

/// Positions of sixteen lanes relative to a base.
type Local = (Base, [[f32; LANES]; 3]);

/// Adds the cut segments of all lanes that are not done.
pub fn add(
    job: &Job<'_>,
    packet: &Packet,
    cut: &[[f64; 2]; LANES],
    done: u32,
    pixels: &mut Pixels,
    counts: &mut Counts,
) {
    let (entries, wanted) = entries(job, packet, cut, done, counts);
    if wanted == 0 {
        return;
    }
    let inverse = 1.0 / job.lattice.step;
    for l in 0..LANES {
        if entries[l][3] <= 0.0 {
            continue;
        }
        let [start, end] = cut[l];
        let before = pixels.color[l][3];
        let add = power(entries[l], ((end - start) * inverse) as f32);
        pixels.color[l] = under(pixels.color[l], add);
        if before < job.threshold && pixels.color[l][3] >= job.threshold {
            let part = part_of(before, add[3], job.threshold);
            pixels.depth[l] = start + (end - start) * f64::from(part);
        }
    }
}

/// What whole segments would add by what cut segments hold, and the lanes in which there is one to
/// take.
pub fn entries(
    job: &Job<'_>,
    packet: &Packet,
    cut: &[[f64; 2]; LANES],
    done: u32,
    counts: &mut Counts,
) -> ([[f32; 4]; LANES], u32) {
    let mut wanted = 0u32;
    for l in 0..LANES {
        wanted |= u32::from(cut[l][0] < cut[l][1]) << l;
    }
    wanted &= !done;
    let mut out = [[0f32; 4]; LANES];
    if wanted == 0 {
        return (out, 0);
    }
    counts.samples += u64::from(wanted.count_ones());
    counts.lattice += u64::from(wanted.count_ones());
    let lead = wanted.trailing_zeros() as usize;
    let at = |t: &dyn Fn(usize) -> f64| local(&job.voxels, packet, lead, t);
    if let Classes::Ends(pairs) = job.classes {
        let number = |(base, p): Local| {
            let mut number = [0f32; LANES];
            dispatch::numbers(job.unit, &job.voxels, &base, &p, &mut number);
            number
        };
        let (front, back) = (number(at(&|l| cut[l][0])), number(at(&|l| cut[l][1])));
        dispatch::pairs(job.unit, pairs, [&front, &back], wanted, &mut out);
    } else {
        let (base, p) = at(&|l| 0.5 * (cut[l][0] + cut[l][1]));
        dispatch::classify(job.unit, job, &base, &p, wanted, &mut out);
    }
    (out, wanted)
}

/// The positions at one `t` a lane.
fn local(voxels: &Voxels<'_>, packet: &Packet, lead: usize, t: impl Fn(usize) -> f64) -> Local {
    let base = Base::new(voxels, packet.at(lead, t(lead)));
    let mut p = [[0f32; LANES]; 3];
    for a in 0..3 {
        let from = f64::from(base.at[a]);
        for l in 0..LANES {
            p[a][l] = (packet.origin[a][l] + packet.direction[a][l] * t(l) - from) as f32;
        }
    }
    (base, p)
}

/// What whole segments add whose middles have sixteen numbers, in the lanes of `live`.
///
/// # Safety
/// The contract of [`Simd`]; `F` is the voxels' access.
#[inline(always)]
pub unsafe fn classify<S: Simd, F: Fetch>(
    job: &Job<'_>,
    table: &SegmentTable,
    (base, p): (&Base, &[[f32; LANES]; 3]),
    live: u32,
    out: &mut [[f32; 4]; LANES],
) {
    // SAFETY: the caller's promises; indices lie in the table.
    unsafe {
        let p = [S::load(&p[0]), S::load(&p[1]), S::load(&p[2])];
        let value = F::fetch::<S>(&job.voxels, base, p);
        let (index, fraction) = slots::<S>(job, table, value, live);
        let clear = S::load_quads(&[[0.0; 4]; LANES]);
        S::store_quads(S::under(clear, table.entries.as_ptr().cast(), &index, &fraction), out);
    }
}

/// What whole segments add between sixteen pairs of numbers, in the lanes of `live`.
///
/// # Safety
/// The contract of [`Simd`].
#[inline(always)]
pub unsafe fn pair_entries<S: Simd>(
    pairs: &SegmentPairs,
    [front, back]: [&[f32; LANES]; 2],
    live: u32,
    out: &mut [[f32; 4]; LANES],
) {
    // SAFETY: the caller's promises; indices lie in the table.
    unsafe {
        let clear = S::load_quads(&[[0.0; 4]; LANES]);
        let (index, front, back) = pair_slots::<S>(pairs, S::load(front), S::load(back), live);
        let table = pairs.entries.as_ptr().cast();
        S::store_quads(S::under_pairs(clear, table, 16 * pairs.stride(), &index, &front, &back), out);
    }
}

/// Byte indices and fractions of numbers in the table; the transparent entry where not `live`.
#[inline(always)]
pub unsafe fn slots<S: Simd>(
    job: &Job<'_>,
    table: &SegmentTable,
    value: S::F,
    live: u32,
) -> ([i32; LANES], [f32; LANES]) {
    let (mut index, mut fraction) = ([0i32; LANES], [0f32; LANES]);
    // SAFETY: the caller's promises.
    unsafe {
        let known = mutated!("nan_is_a_number");
        let live = if job.voxels.scalar.is_float() && !known { live & !S::nan_bits(value) } else { live };
        let (node, f) = node::<S>(value, table.scale, table.offset, table.nodes);
        let nothing = S::splat_int(16 * table.transparent() as i32);
        S::store_int(S::select_int(live, S::shl::<4>(node), nothing), &mut index);
        S::store(f, &mut fraction);
    }
    (index, fraction)
}

/// The same for pairs.
#[inline(always)]
pub unsafe fn pair_slots<S: Simd>(
    pairs: &SegmentPairs,
    front: S::F,
    back: S::F,
    live: u32,
) -> ([i32; LANES], [f32; LANES], [f32; LANES]) {
    let (mut index, mut f_out, mut g_out) = ([0i32; LANES], [0f32; LANES], [0f32; LANES]);
    // SAFETY: the caller's promises.
    unsafe {
        let live = live & !S::nan_bits(front) & !S::nan_bits(back);
        let (i, f) = node::<S>(front, pairs.scale, pairs.offset, pairs.nodes);
        let (j, g) = node::<S>(back, pairs.scale, pairs.offset, pairs.nodes);
        let stride = pairs.stride() as i32;
        let at = S::shl::<4>(S::add_int(S::mul_int(i, S::splat_int(stride)), j));
        let nothing = S::splat_int(16 * (pairs.nodes as i32 + 1) * stride);
        S::store_int(S::select_int(live, at, nothing), &mut index);
        S::store(f, &mut f_out);
        S::store(g, &mut g_out);
    }
    (index, f_out, g_out)
}

/// Node and fraction of a number.
#[inline(always)]
unsafe fn node<S: Simd>(value: S::F, scale: f32, offset: f32, nodes: usize) -> (S::I, S::F) {
    // SAFETY: the caller's promises.
    unsafe {
        let u = S::fma(value, S::splat(scale), S::splat(offset));
        let u = S::min(S::max(u, S::splat(0.0)), S::splat((nodes - 1) as f32));
        let i = S::to_int(u);
        (i, S::sub(u, S::to_float(i)))
    }
}
