//! The walk along sixteen rays: where samples are taken and what is skipped, for every way of
//! putting them together.
//!
//! Chunks of 32 segments begin at multiples of 32 of the lattice; positions are computed anew in
//! f64 at each, and rays end there and only there. So neither what is skipped nor how rays are
//! grouped changes a bit of the picture.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use super::{
    bounds::BLOCK,
    fetch::{Base, Fetch, Voxels},
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

/// What is made of the samples.
///
/// # Safety
/// Functions keep the contract of [`Simd`].
pub trait Kernel<S: Simd> {
    /// Where in a segment its position lies: 0.5, or 0 where the kernel takes both ends.
    const AT: f64;

    /// Takes the number at a segment's front, before a run of segments; only where `AT` is 0.
    unsafe fn start(&mut self, value: S::F);

    /// Takes the number of segment `row` of the chunk in the lanes of `live`.
    unsafe fn take(&mut self, value: S::F, live: u32, row: usize);

    /// Ends the chunk that begins with segment `first`; returns the lanes that are done.
    unsafe fn end(&mut self, first: i64) -> u32;

    /// How far around blocks nothing counts for each lane, in blocks (0: the block itself counts),
    /// given the blocks' indices; `None` where nothing is ever skipped.
    unsafe fn clear(&self, block: S::I) -> Option<S::F>;
}

/// Blocks along each axis, for a walk that skips.
pub type Blocks = Option<[usize; 3]>;

/// Visits all whole segments of a packet.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it; `F` is the voxels' access.
#[inline(always)]
pub unsafe fn walk<S: Simd, F: Fetch, K: Kernel<S>>(
    kernel: &mut K,
    voxels: &Voxels<'_>,
    packet: &Packet,
    cuts: &Cuts,
    step: f64,
    blocks: Blocks,
    mut done: u32,
    counts: &mut Counts,
) {
    let Some([first, last]) = cuts.whole() else { return };
    let mut k = first;
    while k < last {
        let chunk = k.div_euclid(CHUNK as i64) * CHUNK as i64;
        // SAFETY: the caller's promises.
        unsafe {
            let rows = Rows::<S>::new::<K>(voxels, packet, cuts, step, chunk, done);
            if rows.finished == ALL {
                return;
            }
            let end = (last - chunk).min(CHUNK as i64) as usize;
            k = chunk + rows.visit::<F, K>(kernel, voxels, (k - chunk) as usize, end, blocks, counts) as i64;
            done |= kernel.end(chunk);
        }
    }
}

/// Positions and live lanes of one chunk.
struct Rows<S: Simd> {
    base: Base,
    position: [S::F; 3],
    advance: [S::F; 3],
    /// Rows a sample coordinate.
    inverse: [S::F; 3],
    from: S::F,
    to: S::F,
    /// Rows in which every lane is live.
    full: [usize; 2],
    /// Lanes that have nothing more to take.
    finished: u32,
    done: u32,
}

impl<S: Simd> Rows<S> {
    #[inline(always)]
    unsafe fn new<K: Kernel<S>>(
        voxels: &Voxels<'_>,
        packet: &Packet,
        cuts: &Cuts,
        step: f64,
        chunk: i64,
        done: u32,
    ) -> Self {
        let t = (chunk as f64 + K::AT) * step;
        let lead = (0..LANES).find(|l| packet.active >> l & 1 == 1).unwrap_or(0);
        let base = Base::new(voxels, packet.at(lead, t + 0.5 * CHUNK as f64 * step));
        let mut position = [[0f32; LANES]; 3];
        let mut advance = [[0f32; LANES]; 3];
        let mut inverse = [[0f32; LANES]; 3];
        for a in 0..3 {
            for l in 0..LANES {
                let at = packet.origin[a][l] + packet.direction[a][l] * t;
                position[a][l] = (at - f64::from(base.at[a])) as f32;
                advance[a][l] = (packet.direction[a][l] * step) as f32;
                inverse[a][l] = (1.0 / advance[a][l]).clamp(-1e30, 1e30);
            }
        }
        let mut from = [0f32; LANES];
        let mut to = [0f32; LANES];
        let mut full = [0usize, CHUNK];
        let mut finished = done;
        for l in 0..LANES {
            let (a, b) = (cuts.from[l] - chunk, cuts.to[l] - chunk);
            let (a, b) = (a.clamp(0, CHUNK as i64), if a < b { b.clamp(0, CHUNK as i64) } else { 0 });
            (from[l], to[l]) = (a as f32, b as f32);
            full = [full[0].max(a as usize), full[1].min(b as usize)];
            if cuts.to[l] <= chunk || cuts.from[l] >= cuts.to[l] {
                finished |= 1 << l;
            }
        }
        // SAFETY: the caller's promises.
        unsafe {
            Self {
                base,
                position: [S::load(&position[0]), S::load(&position[1]), S::load(&position[2])],
                advance: [S::load(&advance[0]), S::load(&advance[1]), S::load(&advance[2])],
                inverse: [S::load(&inverse[0]), S::load(&inverse[1]), S::load(&inverse[2])],
                from: S::load(&from),
                to: S::load(&to),
                full: if done == 0 { full } else { [CHUNK, 0] },
                finished,
                done,
            }
        }
    }

    #[inline(always)]
    unsafe fn at(&self, row: f32) -> [S::F; 3] {
        // SAFETY: the caller's promises.
        unsafe {
            let r = S::splat(row);
            let (p, d) = (self.position, self.advance);
            [S::add(p[0], S::mul(r, d[0])), S::add(p[1], S::mul(r, d[1])), S::add(p[2], S::mul(r, d[2]))]
        }
    }

    /// Takes rows `first..end`; returns the row after those that are known to be empty, too, which
    /// may lie behind `end`.
    #[inline(always)]
    unsafe fn visit<F: Fetch, K: Kernel<S>>(
        &self,
        kernel: &mut K,
        voxels: &Voxels<'_>,
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
                    kernel.start(F::fetch::<S>(voxels, &self.base, self.at(row as f32)));
                    fresh = false;
                }
                let stop = if blocks.is_some() { (row + GROUP).min(end) } else { end };
                while row < stop {
                    let live = self.live(row);
                    let at = row as f32 + if K::AT == 0.0 { 1.0 } else { 0.0 };
                    let value = F::fetch::<S>(voxels, &self.base, self.at(at));
                    kernel.take(value, live, row);
                    counts.samples += u64::from(live.count_ones());
                    row += 1;
                }
            }
        }
        row.max(CHUNK.min(end))
    }

    #[inline(always)]
    unsafe fn live(&self, row: usize) -> u32 {
        if row >= self.full[0] && row < self.full[1] {
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
            let Some(clear) = kernel.clear(index) else { return 0 };
            let size = S::splat(BLOCK as f32);
            let mut rows = S::splat(f32::INFINITY);
            for a in 0..3 {
                let low = S::mul(S::sub(S::add(block[a], S::splat(1.0)), clear), size);
                let high = S::mul(S::add(block[a], clear), size);
                let below = S::mul(S::sub(S::add(low, S::splat(MARGIN)), q[a]), self.inverse[a]);
                let above = S::mul(S::sub(S::sub(high, S::splat(MARGIN)), q[a]), self.inverse[a]);
                rows = S::min(rows, S::max(below, above));
            }
            let rows = S::where_zero(clear, S::splat(-1.0), rows);
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
