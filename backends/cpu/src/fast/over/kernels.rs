//! What is made of a packet's samples, chunk by chunk.
#![expect(clippy::needless_range_loop, reason = "a lane indexes several arrays")]

use std::marker::PhantomData;

use super::{
    Job, Pixels,
    ends::{pair_slots, slots},
    part_of,
};
use crate::fast::{
    bounds::Emptiness,
    classify::SegmentTable,
    dispatch,
    fetch::Fetch,
    preintegrate::SegmentPairs,
    simd::{LANES, Simd},
    walk::{ALL, CHUNK, Kernel, Positions, around},
};

/// Colours, depths and the end of rays, for both kernels.
pub struct Shared<'a, S: Simd> {
    job: &'a Job<'a>,
    pixels: &'a mut Pixels,
    color: S::Quads,
    before: [f32; LANES],
    done: u32,
    /// Lanes whose depth is known.
    reached: u32,
}

impl<'a, S: Simd> Shared<'a, S> {
    #[inline(always)]
    unsafe fn new(job: &'a Job<'a>, pixels: &'a mut Pixels, done: u32) -> Self {
        let before = pixels.color.map(|c| c[3]);
        let reached = (0..LANES).fold(0, |bits, l| bits | u32::from(before[l] >= job.threshold) << l);
        // SAFETY: the caller's promises.
        let color = unsafe { S::load_quads(&pixels.color) };
        Self { job, pixels, color, before, done, reached }
    }

    /// Ends a chunk; `depth(lane, opacity before)` finds where the threshold was reached.
    #[inline(always)]
    unsafe fn end(&mut self, depth: impl Fn(usize, f32) -> f64) -> u32 {
        // SAFETY: the caller's promises.
        unsafe { S::store_quads(self.color, &mut self.pixels.color) };
        for l in 0..LANES {
            let opacity = self.pixels.color[l][3];
            if opacity >= self.job.threshold && self.reached >> l & 1 == 0 {
                self.reached |= 1 << l;
                self.pixels.depth[l] = depth(l, self.before[l]);
            }
            if 1.0 - opacity < self.job.termination {
                self.done |= 1 << l;
            }
            self.before[l] = opacity;
        }
        self.done
    }

    #[inline(always)]
    unsafe fn finish(self) -> u32 {
        // SAFETY: the caller's promises.
        unsafe { S::store_quads(self.color, &mut self.pixels.color) };
        self.done
    }
}

/// Finds where a lane reached the threshold among the rows of a chunk.
fn find_depth(
    rows: usize,
    row_of: &[u8; CHUNK],
    entry: impl Fn(usize) -> f32,
    mut opacity: f32,
    job: &Job<'_>,
    first: i64,
) -> f64 {
    for i in 0..rows {
        let alpha = entry(i);
        let after = opacity + (1.0 - opacity) * alpha;
        if after >= job.threshold {
            let part = f64::from(part_of(opacity, alpha, job.threshold));
            return ((first + i64::from(row_of[i])) as f64 + part) * job.lattice.step;
        }
        opacity = after;
    }
    // Rounding of the vector unit's order cannot differ from this one; the last row it is.
    ((first + i64::from(row_of[rows.saturating_sub(1)])) as f64 + 1.0) * job.lattice.step
}

/// Classification at the middle of each segment.
pub struct SampleKernel<'a, S: Simd, F: Fetch> {
    voxels: PhantomData<F>,
    shared: Shared<'a, S>,
    table: &'a SegmentTable,
    rows: usize,
    row_of: [u8; CHUNK],
    index: [[i32; LANES]; CHUNK],
    fraction: [[f32; LANES]; CHUNK],
}

impl<'a, S: Simd, F: Fetch> SampleKernel<'a, S, F> {
    #[inline(always)]
    pub unsafe fn new(job: &'a Job<'a>, table: &'a SegmentTable, pixels: &'a mut Pixels, done: u32) -> Self {
        // SAFETY: the caller's promises.
        let shared = unsafe { Shared::new(job, pixels, done) };
        let (index, fraction) = ([[0; LANES]; CHUNK], [[0.0; LANES]; CHUNK]);
        Self { voxels: PhantomData, shared, table, rows: 0, row_of: [0; CHUNK], index, fraction }
    }

    /// Ends the walk; returns the lanes that are done.
    #[inline(always)]
    pub unsafe fn finish(self) -> u32 {
        // SAFETY: the caller's promises.
        unsafe { self.shared.finish() }
    }
}

impl<S: Simd, F: Fetch> Kernel<S> for SampleKernel<'_, S, F> {
    const AT: f64 = 0.5;

    #[inline(always)]
    unsafe fn start(&mut self, _: Positions<'_, S>) {}

    #[inline(always)]
    unsafe fn take(&mut self, (base, p): Positions<'_, S>, live: u32, row: usize) {
        // SAFETY: the caller's promises.
        unsafe {
            let value = F::fetch::<S>(&self.shared.job.voxels, base, p);
            let table = self.table;
            // Below the first node that can be seen everything is exactly zero.
            let number = S::fma(value, S::splat(table.scale), S::splat(table.offset));
            if S::lt_bits(number, S::splat(table.dark)) | !live & ALL == ALL {
                return;
            }
            (self.index[self.rows], self.fraction[self.rows]) = slots::<S>(self.shared.job, table, value, live);
        }
        self.row_of[self.rows] = row as u8;
        self.rows += 1;
    }

    #[inline(always)]
    unsafe fn end(&mut self, first: i64) -> u32 {
        if self.rows == 0 {
            return self.shared.done;
        }
        let entries = &self.table.entries;
        let (index, fraction, row_of, rows) = (&self.index, &self.fraction, &self.row_of, self.rows);
        // SAFETY: indices lie in the table, which has an entry after each.
        unsafe {
            let mut color = self.shared.color;
            for i in 0..rows {
                color = S::under(color, entries.as_ptr().cast(), &index[i], &fraction[i]);
            }
            self.shared.color = color;
            let job = self.shared.job;
            self.rows = 0;
            self.shared.end(|l, before| {
                let alpha = |i: usize| {
                    let at = index[i][l] as usize / 16;
                    let (a, b) = (entries[at][3], entries[at + 1][3]);
                    a + fraction[i][l] * (b - a)
                };
                find_depth(rows, row_of, alpha, before, job, first)
            })
        }
    }

    #[inline(always)]
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]) {
        // SAFETY: the caller's promises.
        unsafe { clear_around::<S>(self.shared.job.empty, block, index) }
    }
}

/// What can be skipped around blocks of these coordinates and indices.
///
/// # Safety
/// The contract of [`Kernel::clear`].
#[inline(always)]
pub unsafe fn clear_around<S: Simd>(
    empty: Option<&Emptiness>,
    block: [S::F; 3],
    index: S::I,
) -> (u32, [S::F; 3], [S::F; 3]) {
    // SAFETY: block indices are inside, and the map is padded by four bytes.
    unsafe {
        let distance = match empty {
            Some(empty) => S::to_float(S::and_int(S::gather(empty.distance.as_ptr(), index), S::splat_int(255))),
            None => S::splat(0.0),
        };
        around::<S>(block, distance)
    }
}

/// Pre-integrated classification by the numbers at both ends of each segment.
pub struct PairKernel<'a, S: Simd, F: Fetch> {
    voxels: PhantomData<F>,
    shared: Shared<'a, S>,
    pairs: &'a SegmentPairs,
    rows: usize,
    row_of: [u8; CHUNK],
    index: [[i32; LANES]; CHUNK],
    front: [[f32; LANES]; CHUNK],
    back: [[f32; LANES]; CHUNK],
    last: S::F,
}

impl<'a, S: Simd, F: Fetch> PairKernel<'a, S, F> {
    #[inline(always)]
    pub unsafe fn new(job: &'a Job<'a>, pairs: &'a SegmentPairs, pixels: &'a mut Pixels, done: u32) -> Self {
        let zero = [[0.0; LANES]; CHUNK];
        // SAFETY: the caller's promises.
        unsafe {
            Self {
                voxels: PhantomData,
                shared: Shared::new(job, pixels, done),
                pairs,
                rows: 0,
                row_of: [0; CHUNK],
                index: [[0; LANES]; CHUNK],
                front: zero,
                back: zero,
                last: S::splat(0.0),
            }
        }
    }

    /// Ends the walk; returns the lanes that are done.
    #[inline(always)]
    pub unsafe fn finish(self) -> u32 {
        // SAFETY: the caller's promises.
        unsafe { self.shared.finish() }
    }
}

impl<S: Simd, F: Fetch> Kernel<S> for PairKernel<'_, S, F> {
    const AT: f64 = 0.0;

    #[inline(always)]
    unsafe fn start(&mut self, (base, p): Positions<'_, S>) {
        // SAFETY: the caller's promises.
        self.last = unsafe { F::fetch::<S>(&self.shared.job.voxels, base, p) };
    }

    #[inline(always)]
    unsafe fn take(&mut self, (base, p): Positions<'_, S>, live: u32, row: usize) {
        let r = self.rows;
        // SAFETY: the caller's promises.
        let value = unsafe { F::fetch::<S>(&self.shared.job.voxels, base, p) };
        // SAFETY: the caller's promises.
        unsafe {
            (self.index[r], self.front[r], self.back[r]) = pair_slots::<S>(self.pairs, self.last, value, live);
        }
        self.last = value;
        self.row_of[self.rows] = row as u8;
        self.rows += 1;
    }

    #[inline(always)]
    unsafe fn end(&mut self, first: i64) -> u32 {
        if self.rows == 0 {
            return self.shared.done;
        }
        let pairs = self.pairs;
        let (index, front, back, row_of, rows) = (&self.index, &self.front, &self.back, &self.row_of, self.rows);
        // SAFETY: indices lie in the table, which has an entry and a row after each.
        unsafe {
            let mut color = self.shared.color;
            let table = pairs.entries.as_ptr().cast();
            for i in 0..rows {
                color = S::under_pairs(color, table, 16 * pairs.stride(), &index[i], &front[i], &back[i]);
            }
            self.shared.color = color;
            let job = self.shared.job;
            self.rows = 0;
            self.shared.end(|l, before| {
                let alpha = |i: usize| {
                    let at = index[i][l] as usize / 16;
                    let e = |at: usize| pairs.entries[at][3];
                    let mix = |a: f32, b: f32, t: f32| a + t * (b - a);
                    let x = mix(e(at), e(at + 1), back[i][l]);
                    let y = mix(e(at + pairs.stride()), e(at + pairs.stride() + 1), back[i][l]);
                    mix(x, y, front[i][l])
                };
                find_depth(rows, row_of, alpha, before, job, first)
            })
        }
    }

    #[inline(always)]
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]) {
        // SAFETY: the caller's promises.
        unsafe { clear_around::<S>(self.shared.job.empty, block, index) }
    }
}

/// Vectors as arrays.
///
/// # Safety
/// The contract of [`Simd`].
#[inline(always)]
pub unsafe fn stored<S: Simd>(p: [S::F; 3]) -> [[f32; LANES]; 3] {
    let mut out = [[0f32; LANES]; 3];
    // SAFETY: the caller's promises.
    unsafe { (0..3).for_each(|a| S::store(p[a], &mut out[a])) };
    out
}

/// Classification by the voxels around the middle of each segment.
pub struct DirectKernel<'a, S: Simd> {
    shared: Shared<'a, S>,
    rows: usize,
    row_of: [u8; CHUNK],
    /// One more than lanes: `under` reads an entry and the one after it.
    entries: [[[f32; 4]; LANES + 1]; CHUNK],
}

impl<'a, S: Simd> DirectKernel<'a, S> {
    #[inline(always)]
    pub unsafe fn new(job: &'a Job<'a>, pixels: &'a mut Pixels, done: u32) -> Self {
        // SAFETY: the caller's promises.
        let shared = unsafe { Shared::new(job, pixels, done) };
        let entries = [[[0.0; 4]; LANES + 1]; CHUNK];
        Self { shared, rows: 0, row_of: [0; CHUNK], entries }
    }

    /// Ends the walk; returns the lanes that are done.
    #[inline(always)]
    pub unsafe fn finish(self) -> u32 {
        // SAFETY: the caller's promises.
        unsafe { self.shared.finish() }
    }
}

impl<S: Simd> Kernel<S> for DirectKernel<'_, S> {
    const AT: f64 = 0.5;

    #[inline(always)]
    unsafe fn start(&mut self, _: Positions<'_, S>) {}

    #[inline(always)]
    unsafe fn take(&mut self, (base, p): Positions<'_, S>, live: u32, row: usize) {
        let (job, mut entries) = (self.shared.job, [[0f32; 4]; LANES]);
        // SAFETY: the caller's promises.
        let local = unsafe { stored::<S>(p) };
        dispatch::classify(job.unit, job, base, &local, live, &mut entries);
        if entries.iter().any(|e| e[3] > 0.0) {
            self.entries[self.rows][..LANES].copy_from_slice(&entries);
            self.row_of[self.rows] = row as u8;
            self.rows += 1;
        }
    }

    #[inline(always)]
    unsafe fn end(&mut self, first: i64) -> u32 {
        if self.rows == 0 {
            return self.shared.done;
        }
        let (entries, row_of, rows) = (&self.entries, &self.row_of, self.rows);
        let index: [i32; LANES] = std::array::from_fn(|l| 16 * l as i32);
        // SAFETY: a row holds an entry after the last lane's.
        unsafe {
            let mut color = self.shared.color;
            for row in &entries[..rows] {
                color = S::under(color, row.as_ptr().cast(), &index, &[0.0; LANES]);
            }
            self.shared.color = color;
            self.rows = 0;
            let job = self.shared.job;
            self.shared.end(|l, before| find_depth(rows, row_of, |i| entries[i][l][3], before, job, first))
        }
    }

    #[inline(always)]
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]) {
        // SAFETY: the caller's promises.
        unsafe { clear_around::<S>(self.shared.job.empty, block, index) }
    }
}
