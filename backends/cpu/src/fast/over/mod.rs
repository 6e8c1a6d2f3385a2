//! Emission and absorption of one shape, front to back, sixteen rays at once.
//!
//! Whole segments are looked up in a table made for the sample distance; the cut segments at the
//! ends of a ray's interval take the power of their true length.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

mod ends;
mod kernels;

use volact_core::lattice::Lattice;

use super::{
    bounds::Emptiness,
    classify::SegmentTable,
    direct::Direct,
    fetch::{Fetch, Voxels},
    packet::{Cuts, Packet},
    preintegrate::SegmentPairs,
    simd::{LANES, Simd, Unit},
    walk::{Counts, walk},
};

pub use ends::{classify, entries, pair_entries};
use kernels::{DirectKernel, PairKernel, SampleKernel};
pub use kernels::{clear_around, stored};

/// One shape to draw.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// The vector unit.
    pub unit: Unit,
    /// Its voxels.
    pub voxels: Voxels<'a>,
    /// The frame's lattice.
    pub lattice: Lattice,
    /// What whole segments add.
    pub classes: Classes<'a>,
    /// What can be skipped.
    pub empty: Option<&'a Emptiness>,
    /// Rays end where less than this is left to see.
    pub termination: f32,
    /// Opacity at which depth is taken.
    pub threshold: f32,
}

/// What whole segments add.
#[derive(Clone, Copy, Debug)]
pub enum Classes<'a> {
    /// By the value in their middle.
    Middle(&'a SegmentTable),
    /// By the values at their ends.
    Ends(&'a SegmentPairs),
    /// By the voxels around their middle.
    Direct(&'a Direct),
}

/// What sixteen rays have seen so far.
#[derive(Clone, Debug)]
pub struct Pixels {
    /// Premultiplied RGBA.
    pub color: [[f32; 4]; LANES],
    /// `t` at which the threshold is reached.
    pub depth: [f64; LANES],
}

impl Default for Pixels {
    fn default() -> Self {
        Self { color: [[0.0; 4]; LANES], depth: [f64::INFINITY; LANES] }
    }
}

impl Pixels {
    /// Lanes with less than `termination` left to see.
    #[inline(always)]
    pub fn done(&self, termination: f32) -> u32 {
        let mut done = 0;
        for (l, color) in self.color.iter().enumerate() {
            done |= u32::from(1.0 - color[3] < termination) << l;
        }
        done
    }
}

/// Draws a packet behind what its rays have seen: whole segments by `whole`, which returns the
/// lanes that are done, between the cut ones.
pub fn draw(
    job: &Job<'_>,
    packet: &Packet,
    pixels: &mut Pixels,
    counts: &mut Counts,
    whole: impl FnOnce(&Cuts, u32, &mut Pixels, &mut Counts) -> u32,
) {
    let cuts = packet.split(job.lattice.step);
    let done = pixels.done(job.termination);
    counts.lattice += cuts.count();
    ends::add(job, packet, &cuts.front, done, pixels, counts);
    let done = whole(&cuts, done, pixels, counts);
    ends::add(job, packet, &cuts.back, done, pixels, counts);
}

/// Draws the whole segments of a packet that is classified by single numbers; returns the lanes
/// that are done.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it; `F` is the voxels' access.
#[inline(always)]
pub unsafe fn draw_numbers<S: Simd, F: Fetch>(
    job: &Job<'_>,
    (packet, cuts): (&Packet, &Cuts),
    done: u32,
    pixels: &mut Pixels,
    counts: &mut Counts,
) -> u32 {
    let (step, at) = (job.lattice.step, (&job.voxels, packet, cuts));
    let blocks = job.empty.map(|e| e.blocks);
    // SAFETY: the caller's promises.
    unsafe {
        match job.classes {
            Classes::Middle(table) => {
                let mut kernel = SampleKernel::<S, F>::new(job, table, pixels, done);
                walk::<S, _>(&mut kernel, at, step, blocks, done, counts);
                kernel.finish()
            }
            Classes::Ends(pairs) => {
                let mut kernel = PairKernel::<S, F>::new(job, pairs, pixels, done);
                walk::<S, _>(&mut kernel, at, step, blocks, done, counts);
                kernel.finish()
            }
            Classes::Direct(_) => done,
        }
    }
}

/// The same for one that is classified by the voxels around.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn draw_direct<S: Simd>(
    job: &Job<'_>,
    (packet, cuts): (&Packet, &Cuts),
    done: u32,
    pixels: &mut Pixels,
    counts: &mut Counts,
) -> u32 {
    let (step, at) = (job.lattice.step, (&job.voxels, packet, cuts));
    // SAFETY: the caller's promises.
    unsafe {
        let mut kernel = DirectKernel::<S>::new(job, pixels, done);
        walk::<S, _>(&mut kernel, at, step, job.empty.map(|e| e.blocks), done, counts);
        kernel.finish()
    }
}

/// What a share of a segment adds, given what a whole one does: 1 − (1 − α)^share.
pub fn power(whole: [f32; 4], share: f32) -> [f32; 4] {
    let a = whole[3];
    if a <= 0.0 || a >= 1.0 {
        return whole;
    }
    let alpha = if a < 0.02 {
        // The binomial series, exact to f32 here.
        let (s, x) = (share, a);
        s * x * (1.0 + (1.0 - s) / 2.0 * x * (1.0 + (2.0 - s) / 3.0 * x * (1.0 + (3.0 - s) / 4.0 * x)))
    } else {
        -(share * (-a).ln_1p()).exp_m1()
    };
    let scale = alpha / a;
    [whole[0] * scale, whole[1] * scale, whole[2] * scale, alpha]
}

/// c + (1 − c.a)·e.
pub fn under(c: [f32; 4], e: [f32; 4]) -> [f32; 4] {
    let left = 1.0 - c[3];
    std::array::from_fn(|i| c[i] + left * e[i])
}

/// The part of a segment of opacity `alpha` behind opacity `before` after which `threshold` is
/// reached.
pub fn part_of(before: f32, alpha: f32, threshold: f32) -> f32 {
    if alpha >= 1.0 {
        return 0.0;
    }
    let needed = ((1.0 - threshold) / (1.0 - before)).ln();
    (needed / (-alpha).ln_1p()).clamp(0.0, 1.0)
}
