//! Emission and absorption of one shape, front to back, sixteen rays at once.
//!
//! Whole segments are looked up in a table made for the sample distance; the cut segments at the
//! ends of a ray's interval take the power of their true length.
#![expect(unsafe_code, reason = "kernels of a vector unit")]
#![expect(clippy::needless_range_loop, reason = "a lane indexes several arrays")]

use volact_core::lattice::Lattice;

use super::{
    bounds::Emptiness,
    classify::SegmentTable,
    fetch::{Base, Fetch, Voxels},
    packet::Packet,
    preintegrate::SegmentPairs,
    simd::{LANES, Simd},
    walk::{ALL, CHUNK, Counts, Kernel, around, walk},
};

/// One shape to draw.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// Its voxels.
    pub voxels: Voxels<'a>,
    /// The frame's lattice.
    pub lattice: Lattice,
    /// What whole segments add, by the value in their middle.
    pub table: &'a SegmentTable,
    /// What they add by the values at their ends; used where there is one.
    pub pairs: Option<&'a SegmentPairs>,
    /// What can be skipped.
    pub empty: Option<&'a Emptiness>,
    /// Rays end where less than this is left to see.
    pub termination: f32,
    /// Opacity at which depth is taken.
    pub threshold: f32,
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

/// Draws a packet behind what its rays have seen.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it; `F` is the voxels' access.
#[inline(always)]
pub unsafe fn draw<S: Simd, F: Fetch>(job: &Job<'_>, packet: &Packet, pixels: &mut Pixels, counts: &mut Counts) {
    let cuts = packet.split(job.lattice.step);
    let done = pixels.done(job.termination);
    counts.lattice += cuts.count();
    let blocks = job.empty.map(|e| e.blocks);
    // SAFETY: the caller's promises.
    unsafe {
        ends::<S, F>(job, packet, &cuts.front, done, pixels, counts);
        let (step, at) = (job.lattice.step, (&job.voxels, packet, &cuts));
        let done = if let Some(pairs) = job.pairs {
            let mut kernel = PairKernel::<S>::new(job, pairs, pixels, done);
            walk::<S, F, _>(&mut kernel, at, step, blocks, done, counts);
            kernel.shared.finish()
        } else {
            let mut kernel = SampleKernel::<S>::new(job, pixels, done);
            walk::<S, F, _>(&mut kernel, at, step, blocks, done, counts);
            kernel.shared.finish()
        };
        ends::<S, F>(job, packet, &cuts.back, done, pixels, counts);
    }
}

/// Adds the cut segments of all lanes that are not done.
#[inline(always)]
unsafe fn ends<S: Simd, F: Fetch>(
    job: &Job<'_>,
    packet: &Packet,
    cut: &[[f64; 2]; LANES],
    done: u32,
    pixels: &mut Pixels,
    counts: &mut Counts,
) {
    let mut wanted = 0u32;
    for l in 0..LANES {
        wanted |= u32::from(cut[l][0] < cut[l][1]) << l;
    }
    wanted &= !done;
    if wanted == 0 {
        return;
    }
    counts.samples += u64::from(wanted.count_ones());
    counts.lattice += u64::from(wanted.count_ones());
    let lead = wanted.trailing_zeros() as usize;
    let mut entries = [[0f32; 4]; LANES];
    // SAFETY: the caller's promises; indices lie in the tables.
    unsafe {
        let clear = S::load_quads(&entries);
        let quads = if let Some(pairs) = job.pairs {
            let front = numbers::<S, F>(job, packet, lead, |l| cut[l][0]);
            let back = numbers::<S, F>(job, packet, lead, |l| cut[l][1]);
            let (index, front, back) = pair_slots::<S>(pairs, front, back, wanted);
            S::under_pairs(clear, pairs.entries.as_ptr().cast(), 16 * pairs.stride(), &index, &front, &back)
        } else {
            let middle = numbers::<S, F>(job, packet, lead, |l| 0.5 * (cut[l][0] + cut[l][1]));
            let (index, fraction) = slots::<S>(job, middle, wanted);
            S::under(clear, job.table.entries.as_ptr().cast(), &index, &fraction)
        };
        S::store_quads(quads, &mut entries);
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

/// The numbers at one `t` a lane.
#[inline(always)]
unsafe fn numbers<S: Simd, F: Fetch>(job: &Job<'_>, packet: &Packet, lead: usize, t: impl Fn(usize) -> f64) -> S::F {
    let base = Base::new(&job.voxels, packet.at(lead, t(lead)));
    let mut p = [[0f32; LANES]; 3];
    for a in 0..3 {
        let from = f64::from(base.at[a]);
        for l in 0..LANES {
            p[a][l] = (packet.origin[a][l] + packet.direction[a][l] * t(l) - from) as f32;
        }
    }
    // SAFETY: the caller's promises.
    unsafe { F::fetch::<S>(&job.voxels, &base, [S::load(&p[0]), S::load(&p[1]), S::load(&p[2])]) }
}

/// Byte indices and fractions of numbers in the table; the transparent entry where not `live`.
#[inline(always)]
unsafe fn slots<S: Simd>(job: &Job<'_>, value: S::F, live: u32) -> ([i32; LANES], [f32; LANES]) {
    let table = job.table;
    let (mut index, mut fraction) = ([0i32; LANES], [0f32; LANES]);
    // SAFETY: the caller's promises.
    unsafe {
        let live = if job.voxels.scalar.is_float() { live & !S::nan_bits(value) } else { live };
        let (node, f) = node::<S>(value, table.scale, table.offset, table.nodes);
        let nothing = S::splat_int(16 * table.transparent() as i32);
        S::store_int(S::select_int(live, S::shl::<4>(node), nothing), &mut index);
        S::store(f, &mut fraction);
    }
    (index, fraction)
}

/// The same for pairs.
#[inline(always)]
unsafe fn pair_slots<S: Simd>(
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

/// Colours, depths and the end of rays, for both kernels.
struct Shared<'a, S: Simd> {
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
struct SampleKernel<'a, S: Simd> {
    shared: Shared<'a, S>,
    rows: usize,
    row_of: [u8; CHUNK],
    index: [[i32; LANES]; CHUNK],
    fraction: [[f32; LANES]; CHUNK],
}

impl<'a, S: Simd> SampleKernel<'a, S> {
    #[inline(always)]
    unsafe fn new(job: &'a Job<'a>, pixels: &'a mut Pixels, done: u32) -> Self {
        // SAFETY: the caller's promises.
        let shared = unsafe { Shared::new(job, pixels, done) };
        Self { shared, rows: 0, row_of: [0; CHUNK], index: [[0; LANES]; CHUNK], fraction: [[0.0; LANES]; CHUNK] }
    }
}

impl<S: Simd> Kernel<S> for SampleKernel<'_, S> {
    const AT: f64 = 0.5;

    #[inline(always)]
    unsafe fn start(&mut self, _: S::F) {}

    #[inline(always)]
    unsafe fn take(&mut self, value: S::F, live: u32, row: usize) {
        // SAFETY: the caller's promises.
        unsafe {
            let table = self.shared.job.table;
            // Below the first node that can be seen everything is exactly zero.
            let number = S::fma(value, S::splat(table.scale), S::splat(table.offset));
            if S::lt_bits(number, S::splat(table.dark)) | !live & ALL == ALL {
                return;
            }
            (self.index[self.rows], self.fraction[self.rows]) = slots::<S>(self.shared.job, value, live);
        }
        self.row_of[self.rows] = row as u8;
        self.rows += 1;
    }

    #[inline(always)]
    unsafe fn end(&mut self, first: i64) -> u32 {
        if self.rows == 0 {
            return self.shared.done;
        }
        let entries = &self.shared.job.table.entries;
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
        unsafe { around::<S>(block, distance::<S>(self.shared.job, index)) }
    }
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

/// Distances of blocks to what can be seen.
#[inline(always)]
unsafe fn distance<S: Simd>(job: &Job<'_>, index: S::I) -> S::F {
    // SAFETY: block indices are inside, and the map is padded by four bytes.
    unsafe {
        match job.empty {
            Some(empty) => S::to_float(S::and_int(S::gather(empty.distance.as_ptr(), index), S::splat_int(255))),
            None => S::splat(0.0),
        }
    }
}

/// Pre-integrated classification by the numbers at both ends of each segment.
struct PairKernel<'a, S: Simd> {
    shared: Shared<'a, S>,
    pairs: &'a SegmentPairs,
    rows: usize,
    row_of: [u8; CHUNK],
    index: [[i32; LANES]; CHUNK],
    front: [[f32; LANES]; CHUNK],
    back: [[f32; LANES]; CHUNK],
    last: S::F,
}

impl<'a, S: Simd> PairKernel<'a, S> {
    #[inline(always)]
    unsafe fn new(job: &'a Job<'a>, pairs: &'a SegmentPairs, pixels: &'a mut Pixels, done: u32) -> Self {
        let zero = [[0.0; LANES]; CHUNK];
        // SAFETY: the caller's promises.
        unsafe {
            Self {
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
}

impl<S: Simd> Kernel<S> for PairKernel<'_, S> {
    const AT: f64 = 0.0;

    #[inline(always)]
    unsafe fn start(&mut self, value: S::F) {
        self.last = value;
    }

    #[inline(always)]
    unsafe fn take(&mut self, value: S::F, live: u32, row: usize) {
        let r = self.rows;
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
        unsafe { around::<S>(block, distance::<S>(self.shared.job, index)) }
    }
}
