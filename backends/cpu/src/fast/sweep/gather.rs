//! What the segments of one chunk would add by one shape alone, kept to be put together with those
//! of others.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use crate::fast::{
    dispatch,
    over::{Classes, Job, clear_around, stored},
    packet::{Cuts, Packet},
    preintegrate::SegmentPairs,
    simd::{LANES, Simd},
    walk::{CHUNK, Counts, Kernel, Positions, walk_chunk},
};

/// Entries of sixteen rays.
pub type Row = [[f32; 4]; LANES];

/// What the segments of a chunk add by one shape.
#[derive(Clone, Debug)]
pub struct Chunk {
    /// Rows in which something can be seen, as bits; others are not to be read.
    pub rows: u32,
    /// Premultiplied colour and opacity by row and lane.
    pub entries: [Row; CHUNK],
}

impl Default for Chunk {
    fn default() -> Self {
        Self { rows: 0, entries: [[[0.0; 4]; LANES]; CHUNK] }
    }
}

impl Chunk {
    /// Puts a row in, beside what other stretches of the same shape have in other lanes.
    #[inline(always)]
    pub fn put(&mut self, row: usize, entries: &Row) {
        if entries.iter().all(|e| e[3] <= 0.0) {
            return;
        }
        let there = &mut self.entries[row];
        if self.rows >> row & 1 == 0 {
            *there = *entries;
            self.rows |= 1 << row;
            return;
        }
        for (to, from) in there.iter_mut().zip(entries).filter(|(_, from)| from[3] > 0.0) {
            *to = *from;
        }
    }
}

/// Gathers the whole segments of one stretch in the chunk that begins with segment `first`;
/// returns the next segment in which there may be something.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn gather<S: Simd>(
    job: &Job<'_>,
    (packet, cuts): (&Packet, &Cuts),
    first: i64,
    done: u32,
    chunk: &mut Chunk,
    counts: &mut Counts,
) -> i64 {
    let (at, blocks) = ((&job.voxels, packet, cuts), job.empty.map(|e| e.blocks));
    let place = (job.lattice.step, first);
    // SAFETY: the caller's promises.
    unsafe {
        if let Classes::Ends(pairs) = job.classes {
            let mut kernel = Ends { job, pairs, chunk, last: [0.0; LANES] };
            walk_chunk::<S, _>(&mut kernel, at, place, blocks, done, counts)
        } else {
            walk_chunk::<S, _>(&mut Middle { job, chunk }, at, place, blocks, done, counts)
        }
    }
}

/// Classification in the middle of segments.
struct Middle<'a> {
    job: &'a Job<'a>,
    chunk: &'a mut Chunk,
}

impl<S: Simd> Kernel<S> for Middle<'_> {
    const AT: f64 = 0.5;

    #[inline(always)]
    unsafe fn start(&mut self, _: Positions<'_, S>) {}

    #[inline(always)]
    unsafe fn take(&mut self, (base, p): Positions<'_, S>, live: u32, row: usize) {
        let mut entries = [[0f32; 4]; LANES];
        // SAFETY: the caller's promises.
        let local = unsafe { stored::<S>(p) };
        dispatch::classify(self.job.unit, self.job, base, &local, live, &mut entries);
        self.chunk.put(row, &entries);
    }

    #[inline(always)]
    unsafe fn end(&mut self, _: i64) -> u32 {
        0
    }

    #[inline(always)]
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]) {
        // SAFETY: the caller's promises.
        unsafe { clear_around::<S>(self.job.empty, block, index) }
    }
}

/// Classification by both ends of segments.
struct Ends<'a> {
    job: &'a Job<'a>,
    pairs: &'a SegmentPairs,
    chunk: &'a mut Chunk,
    last: [f32; LANES],
}

impl Ends<'_> {
    /// The numbers at positions.
    #[inline(always)]
    unsafe fn numbers<S: Simd>(&self, (base, p): Positions<'_, S>) -> [f32; LANES] {
        let mut number = [0f32; LANES];
        // SAFETY: the caller's promises.
        let local = unsafe { stored::<S>(p) };
        dispatch::numbers(self.job.unit, &self.job.voxels, base, &local, &mut number);
        number
    }
}

impl<S: Simd> Kernel<S> for Ends<'_> {
    const AT: f64 = 0.0;

    #[inline(always)]
    unsafe fn start(&mut self, at: Positions<'_, S>) {
        // SAFETY: the caller's promises.
        self.last = unsafe { self.numbers::<S>(at) };
    }

    #[inline(always)]
    unsafe fn take(&mut self, at: Positions<'_, S>, live: u32, row: usize) {
        let mut entries = [[0f32; 4]; LANES];
        // SAFETY: the caller's promises.
        let number = unsafe { self.numbers::<S>(at) };
        dispatch::pairs(self.job.unit, self.pairs, [&self.last, &number], live, &mut entries);
        self.last = number;
        self.chunk.put(row, &entries);
    }

    #[inline(always)]
    unsafe fn end(&mut self, _: i64) -> u32 {
        0
    }

    #[inline(always)]
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]) {
        // SAFETY: the caller's promises.
        unsafe { clear_around::<S>(self.job.empty, block, index) }
    }
}
