//! The walk along sixteen rays: where samples are taken and what is skipped, for every way of
//! putting them together.
//!
//! Chunks of 32 segments begin at multiples of 32 of the lattice; positions are computed anew in
//! f64 at each, and rays end there and only there. So neither what is skipped nor how rays are
//! grouped changes a bit of the picture.
#![expect(unsafe_code, reason = "kernels of a vector unit")]
#![expect(clippy::needless_range_loop, reason = "a lane indexes several arrays")]

use super::{
    bounds::BLOCK,
    fetch::{Base, Voxels},
    packet::{Cuts, Packet},
    simd::{LANES, Simd},
};

/// Segments of a chunk.
pub const CHUNK: usize = 32;
/// Segments taken between two looks at what can be skipped.
const GROUP: usize = 4;
/// How much farther than what is known transparent a position must keep, in samples.
const MARGIN: f32 = 1e-3;
/// All lanes.
pub const ALL: u32 = 0xffff;

/// Counts of what was done.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Rays with an interval.
    pub rays: u64,
    /// Samples evaluated.
    pub samples: u64,
    /// Samples of the lattice.
    pub lattice: u64,
}

impl Counts {
    /// Adds another's.
    pub fn add(&mut self, other: Self) {
        self.rays += other.rays;
        self.samples += other.samples;
        self.lattice += other.lattice;
    }
}

/// Sixteen positions relative to a base.
pub type Positions<'a, S> = (&'a Base, [<S as Simd>::F; 3]);

/// What is made of the samples.
///
/// # Safety
/// Functions keep the contract of [`Simd`]; positions were made for the voxels that the kernel
/// reads.
#[expect(clippy::missing_safety_doc, reason = "the contract stands above")]
pub trait Kernel<S: Simd> {
    /// Where in a segment its position lies: 0.5, or 0 where the kernel takes both ends.
    const AT: f64;

    /// Takes a segment's front, before a run of segments; only where `AT` is 0.
    unsafe fn start(&mut self, at: Positions<'_, S>);

    /// Takes segment `row` of the chunk in the lanes of `live`.
    unsafe fn take(&mut self, at: Positions<'_, S>, live: u32, row: usize);

    /// Ends the chunk that begins with segment `first`; returns the lanes that are done.
    unsafe fn end(&mut self, first: i64) -> u32;

    /// Where nothing counts around each lane: the lanes whose own block can be skipped, and the
    /// region around it, in blocks from `low` up to `high`. `block` are the blocks' coordinates,
    /// `index` their indices.
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]);
}

/// The region of a distance in blocks around a block.
///
/// # Safety
/// The contract of [`Simd`].
#[inline(always)]
pub unsafe fn around<S: Simd>(block: [S::F; 3], distance: S::F) -> (u32, [S::F; 3], [S::F; 3]) {
    // SAFETY: the caller's promises.
    unsafe {
        let back = S::sub(S::splat(1.0), distance);
        let low = [S::add(block[0], back), S::add(block[1], back), S::add(block[2], back)];
        let high = [S::add(block[0], distance), S::add(block[1], distance), S::add(block[2], distance)];
        (S::lt_bits(S::splat(0.0), distance), low, high)
    }
}

/// Blocks along each axis, for a walk that skips.
pub type Blocks = Option<[usize; 3]>;

/// Visits all whole segments of a packet, but for lanes that are done.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it, with the kernel's voxels.
#[inline(always)]
pub unsafe fn walk<S: Simd, K: Kernel<S>>(
    kernel: &mut K,
    (voxels, packet, cuts): (&Voxels<'_>, &Packet, &Cuts),
    step: f64,
    blocks: Blocks,
    done: u32,
    counts: &mut Counts,
) {
    let Some([first, last]) = cuts.whole() else { return };
    // SAFETY: the caller's promises.
    unsafe {
        let mut rows = Rows::<S>::new(voxels, packet, cuts, step, first);
        rows.done = done;
        let mut k = first;
        while k < last {
            let chunk = k.div_euclid(CHUNK as i64) * CHUNK as i64;
            rows.begin::<K>(voxels, packet, step, chunk, chunk - first);
            if rows.finished() == ALL {
                return;
            }
            let end = (last - chunk).min(CHUNK as i64) as usize;
            k = chunk + rows.visit(kernel, (k - chunk) as usize, end, blocks, counts) as i64;
            rows.done |= kernel.end(chunk);
        }
    }
}

/// Visits the whole segments of a packet in the chunk that begins with segment `chunk`, but for
/// lanes that are done; returns the next segment in which there may be something.
///
/// # Safety
/// As [`walk`].
#[inline(always)]
pub unsafe fn walk_chunk<S: Simd, K: Kernel<S>>(
    kernel: &mut K,
    (voxels, packet, cuts): (&Voxels<'_>, &Packet, &Cuts),
    (step, chunk): (f64, i64),
    blocks: Blocks,
    done: u32,
    counts: &mut Counts,
) -> i64 {
    let Some([first, last]) = cuts.whole() else { return i64::MAX };
    if last <= chunk {
        return i64::MAX;
    }
    let start = first.max(chunk);
    if start >= chunk + CHUNK as i64 {
        return start;
    }
    // SAFETY: the caller's promises.
    unsafe {
        let mut rows = Rows::<S>::new(voxels, packet, cuts, step, first);
        rows.done = done;
        rows.begin::<K>(voxels, packet, step, chunk, chunk - first);
        let end = (last - chunk).min(CHUNK as i64) as usize;
        let next = chunk + rows.visit(kernel, (start - chunk) as usize, end, blocks, counts) as i64;
        if next >= last { i64::MAX } else { next }
    }
}

/// Positions and live lanes of one chunk.
struct Rows<S: Simd> {
    base: Base,
    position: [S::F; 3],
    advance: [S::F; 3],
    /// Rows a sample coordinate.
    inverse: [S::F; 3],
    /// Whole segments of each lane, counted from the packet's first.
    whole: [S::F; 2],
    /// The same, counted from the chunk's first.
    from: S::F,
    to: S::F,
    /// Segments in which every lane is live, counted from the packet's first.
    all_live: [i64; 2],
    /// Rows in which every lane is live.
    full: [i64; 2],
    lead: usize,
    done: u32,
}

impl<S: Simd> Rows<S> {
    #[inline(always)]
    unsafe fn new(voxels: &Voxels<'_>, packet: &Packet, cuts: &Cuts, step: f64, first: i64) -> Self {
        let mut advance = [[0f32; LANES]; 3];
        let mut inverse = [[0f32; LANES]; 3];
        for a in 0..3 {
            for l in 0..LANES {
                let d = (packet.direction[a][l] * step) as f32;
                let i = 1.0 / d;
                advance[a][l] = d;
                inverse[a][l] = i.clamp(-1e30, 1e30);
            }
        }
        let mut from = [0f32; LANES];
        let mut to = [0f32; LANES];
        let mut all_live = [f32::NEG_INFINITY, f32::INFINITY];
        for l in 0..LANES {
            let some = cuts.from[l] < cuts.to[l];
            from[l] = if some { (cuts.from[l] - first as f64) as f32 } else { 0.0 };
            to[l] = if some { (cuts.to[l] - first as f64) as f32 } else { 0.0 };
            all_live = [all_live[0].max(from[l]), all_live[1].min(to[l])];
        }
        let lead = (packet.active.trailing_zeros() as usize).min(LANES - 1);
        // SAFETY: the caller's promises.
        unsafe {
            let zero = S::splat(0.0);
            Self {
                base: Base::new(voxels, [0.0; 3]),
                position: [zero; 3],
                advance: [S::load(&advance[0]), S::load(&advance[1]), S::load(&advance[2])],
                inverse: [S::load(&inverse[0]), S::load(&inverse[1]), S::load(&inverse[2])],
                whole: [S::load(&from), S::load(&to)],
                from: zero,
                to: zero,
                all_live: all_live.map(|v| v as i64),
                full: [0, 0],
                lead,
                done: 0,
            }
        }
    }

    /// Moves to the chunk that begins with segment `chunk`, `ahead` after the packet's first.
    #[inline(always)]
    unsafe fn begin<K: Kernel<S>>(&mut self, voxels: &Voxels<'_>, packet: &Packet, step: f64, chunk: i64, ahead: i64) {
        let t = (chunk as f64 + K::AT) * step;
        self.base = Base::new(voxels, packet.at(self.lead, t + 0.5 * CHUNK as f64 * step));
        let mut position = [[0f32; LANES]; 3];
        for a in 0..3 {
            let base = f64::from(self.base.at[a]);
            for l in 0..LANES {
                position[a][l] = (packet.origin[a][l] + packet.direction[a][l] * t - base) as f32;
            }
        }
        // SAFETY: the caller's promises.
        unsafe {
            self.position = [S::load(&position[0]), S::load(&position[1]), S::load(&position[2])];
            let ahead = S::splat(ahead as f32);
            (self.from, self.to) = (S::sub(self.whole[0], ahead), S::sub(self.whole[1], ahead));
        }
        self.full = if self.done == 0 { self.all_live.map(|v| v - ahead) } else { [0, 0] };
    }

    /// Lanes that have nothing more to take.
    #[inline(always)]
    unsafe fn finished(&self) -> u32 {
        // SAFETY: the caller's promises.
        unsafe { self.done | !S::lt_bits(S::splat(0.0), self.to) & ALL }
    }

    #[inline(always)]
    unsafe fn at(&self, row: f32) -> [S::F; 3] {
        // SAFETY: the caller's promises.
        unsafe {
            let r = S::splat(row);
            let (p, d) = (self.position, self.advance);
            [S::fma(r, d[0], p[0]), S::fma(r, d[1], p[1]), S::fma(r, d[2], p[2])]
        }
    }

    /// Takes rows `first..end`; returns the row after those that are known to be empty, too, which
    /// may lie behind `end`.
    #[inline(always)]
    unsafe fn visit<K: Kernel<S>>(
        &self,
        kernel: &mut K,
        first: usize,
        end: usize,
        blocks: Blocks,
        counts: &mut Counts,
    ) -> usize {
        let mut row = first;
        let mut fresh = true;
        // SAFETY: the caller's promises.
        unsafe {
            while row < end {
                if let Some(blocks) = blocks {
                    let skip = self.skip(kernel, row, blocks);
                    if skip > 0 {
                        row += skip;
                        fresh = true;
                        continue;
                    }
                }
                if K::AT == 0.0 && fresh {
                    kernel.start((&self.base, self.at(row as f32)));
                    fresh = false;
                }
                let stop = if blocks.is_some() { (row + GROUP).min(end) } else { end };
                while row < stop {
                    let live = self.live(row);
                    let at = row as f32 + if K::AT == 0.0 { 1.0 } else { 0.0 };
                    kernel.take((&self.base, self.at(at)), live, row);
                    counts.samples += u64::from(live.count_ones());
                    row += 1;
                }
            }
        }
        row.max(CHUNK.min(end))
    }

    #[inline(always)]
    unsafe fn live(&self, row: usize) -> u32 {
        if row as i64 >= self.full[0] && (row as i64) < self.full[1] {
            return ALL;
        }
        // SAFETY: the caller's promises.
        unsafe {
            let r = S::splat(row as f32);
            S::lt_bits(r, self.to) & !S::lt_bits(r, self.from) & !self.done
        }
    }

    /// Segments from `row` on of which no lane has anything to take.
    #[inline(always)]
    unsafe fn skip<K: Kernel<S>>(&self, kernel: &K, row: usize, blocks: [usize; 3]) -> usize {
        // SAFETY: the caller's promises; block indices are clamped to those that exist.
        unsafe {
            let r = S::splat(row as f32);
            let p = self.at(row as f32);
            let mut q = p;
            let mut block = [S::splat(0.0); 3];
            for a in 0..3 {
                let clamped = S::min(S::max(p[a], S::splat(self.base.lo[a])), S::splat(self.base.hi[a]));
                q[a] = S::sub(clamped, S::splat(self.base.lo[a]));
                let last = S::splat((blocks[a] - 1) as f32);
                block[a] = S::min(S::floor(S::mul(q[a], S::splat(1.0 / BLOCK as f32))), last);
            }
            let (x, y, z) = (S::to_int(block[0]), S::to_int(block[1]), S::to_int(block[2]));
            let index = S::add_int(
                x,
                S::mul_int(
                    S::splat_int(blocks[0] as i32),
                    S::add_int(y, S::mul_int(S::splat_int(blocks[1] as i32), z)),
                ),
            );
            let (clear, low, high) = kernel.clear(block, index);
            let size = S::splat(BLOCK as f32);
            let mut rows = S::splat(f32::INFINITY);
            for a in 0..3 {
                let low = S::add(S::mul(low[a], size), S::splat(MARGIN));
                let high = S::sub(S::mul(high[a], size), S::splat(MARGIN));
                let below = S::mul(S::sub(low, q[a]), self.inverse[a]);
                let above = S::mul(S::sub(high, q[a]), self.inverse[a]);
                rows = S::min(rows, S::max(below, above));
            }
            let rows = S::select(clear, rows, S::splat(-1.0));
            let ends = if K::AT == 0.0 { 0.0 } else { 1.0 };
            let rows = S::add(S::floor(rows), S::splat(ends));
            // Lanes that are done or past their end never wait; those before it wait that long.
            let before = S::lt_bits(r, self.from);
            let past = !S::lt_bits(r, self.to) | self.done;
            let rows = S::select(before, S::sub(self.from, r), rows);
            let rows = S::select(past & ALL, S::splat(1e9), rows);
            let least = S::reduce_min(rows);
            if least >= 1.0 { (least as usize).min(1 << 20) } else { 0 }
        }
    }
}
