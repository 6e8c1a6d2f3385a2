//! Maximum, minimum and mean of the value along a ray's interval, sixteen rays at once.
#![expect(unsafe_code, reason = "kernels of a vector unit")]
#![expect(clippy::needless_range_loop, reason = "a lane indexes several arrays")]

use std::marker::PhantomData;

use volact_core::{Compositing, lattice::Lattice, mutated};

use super::{
    bounds::{Emptiness, Peaks},
    fetch::{Base, Fetch, Voxels},
    packet::Packet,
    simd::{LANES, Simd},
    walk::{ALL, CHUNK, Counts, Kernel, Positions, around, walk},
};

/// One shape to reduce.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// Its voxels.
    pub voxels: Voxels<'a>,
    /// The frame's lattice.
    pub lattice: Lattice,
    /// Maximum, minimum, average or add.
    pub compositing: Compositing,
    /// What blocks hold at best, to skip what cannot change a maximum or minimum.
    pub peaks: Option<&'a Peaks>,
    /// The lowest and highest number of the data, where known.
    pub range: Option<[f32; 2]>,
    /// Blocks that are zero throughout, to skip where values are added.
    pub empty: Option<&'a Emptiness>,
}

/// What came of a ray.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reduced {
    /// The extreme number, or the integral of the number over world length.
    pub value: f64,
    /// World length over which there was a number; 0 for a ray that met none.
    pub length: f64,
}

/// Reduces a packet, on top of what came of its rays before.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it; `F` is the voxels' access.
#[inline(always)]
pub unsafe fn reduce<S: Simd, F: Fetch>(
    job: &Job<'_>,
    packet: &Packet,
    out: &mut [Reduced; LANES],
    counts: &mut Counts,
) {
    let step = job.lattice.step;
    let cuts = packet.split(step);
    counts.lattice += cuts.count();
    // The cut segments first: a maximum does not mind, a sum neither.
    for cut in [&cuts.front, &cuts.back] {
        // SAFETY: the caller's promises.
        let number = unsafe { numbers::<S, F>(job, packet, cut) };
        for l in 0..LANES {
            let [start, end] = cut[l];
            if start < end {
                counts.samples += 1;
                counts.lattice += 1;
                merge(&mut out[l], job.compositing, number[l], end - start);
            }
        }
    }
    // SAFETY: the caller's promises.
    unsafe {
        match job.compositing {
            Compositing::Maximum | Compositing::Minimum => {
                let mut kernel = Extreme::<S, F>::new(job, out);
                let blocks = job.peaks.map(|p| p.blocks);
                walk::<S, _>(&mut kernel, (&job.voxels, packet, &cuts), step, blocks, 0, counts);
                kernel.finish(out);
            }
            _ => {
                let mut kernel = Sum::<S, F>::new(job);
                let blocks = job.empty.map(|e| e.blocks);
                walk::<S, _>(&mut kernel, (&job.voxels, packet, &cuts), step, blocks, 0, counts);
                for l in 0..LANES {
                    let whole = cuts.to[l] - cuts.from[l] - f64::from(kernel.missing[l]);
                    out[l].value += kernel.total[l] * step;
                    out[l].length += whole * step;
                }
            }
        }
    }
}

/// Adds a number that holds over a length.
pub fn merge(into: &mut Reduced, compositing: Compositing, number: f32, length: f64) {
    if number.is_nan() {
        return;
    }
    let number = f64::from(number);
    let first = into.length == 0.0;
    into.value = match compositing {
        Compositing::Maximum if first && mutated!("maximum_from_zero") => number.max(0.0),
        Compositing::Maximum if first => number,
        Compositing::Minimum if first => number,
        Compositing::Maximum => into.value.max(number),
        Compositing::Minimum => into.value.min(number),
        _ => into.value + number * length,
    };
    into.length += length;
}

/// The numbers in the middle of cut segments.
#[inline(always)]
unsafe fn numbers<S: Simd, F: Fetch>(job: &Job<'_>, packet: &Packet, cut: &[[f64; 2]; LANES]) -> [f32; LANES] {
    let middle = |l: usize| 0.5 * (cut[l][0] + cut[l][1]);
    let lead = (0..LANES).find(|&l| cut[l][0] < cut[l][1]).unwrap_or(0);
    let base = Base::new(&job.voxels, packet.at(lead, middle(lead)));
    let mut p = [[0f32; LANES]; 3];
    for a in 0..3 {
        let from = f64::from(base.at[a]);
        for l in 0..LANES {
            p[a][l] = (packet.origin[a][l] + packet.direction[a][l] * middle(l) - from) as f32;
        }
    }
    let mut out = [0f32; LANES];
    // SAFETY: the caller's promises.
    unsafe {
        let p = [S::load(&p[0]), S::load(&p[1]), S::load(&p[2])];
        S::store(F::fetch::<S>(&job.voxels, &base, p), &mut out);
    }
    out
}

/// Maximum; a minimum is the maximum of the negated numbers.
struct Extreme<'a, S: Simd, F: Fetch> {
    job: &'a Job<'a>,
    voxels: PhantomData<F>,
    sign: f32,
    best: S::F,
    /// The number that cannot be passed.
    limit: f32,
}

impl<'a, S: Simd, F: Fetch> Extreme<'a, S, F> {
    #[inline(always)]
    unsafe fn new(job: &'a Job<'a>, ends: &[Reduced; LANES]) -> Self {
        let sign = if job.compositing == Compositing::Maximum { 1.0 } else { -1.0 };
        let least = if mutated!("maximum_from_zero") { 0.0 } else { f32::NEG_INFINITY };
        let best = ends.map(|e| if e.length > 0.0 { sign * e.value as f32 } else { least });
        let range = job.range.filter(|_| !job.voxels.scalar.is_float());
        let limit = range.map_or(f32::INFINITY, |[lo, hi]| if sign > 0.0 { hi } else { -lo });
        // SAFETY: the caller's promises.
        unsafe { Self { job, voxels: PhantomData, sign, best: S::load(&best), limit } }
    }

    #[inline(always)]
    unsafe fn finish(self, out: &mut [Reduced; LANES]) {
        let mut best = [0f32; LANES];
        // SAFETY: the caller's promises.
        unsafe { S::store(self.best, &mut best) };
        for l in 0..LANES {
            if best[l] > f32::NEG_INFINITY {
                out[l] = Reduced { value: f64::from(self.sign * best[l]), length: 1.0 };
            }
        }
    }
}

impl<S: Simd, F: Fetch> Kernel<S> for Extreme<'_, S, F> {
    const AT: f64 = 0.5;

    #[inline(always)]
    unsafe fn start(&mut self, _: Positions<'_, S>) {}

    #[inline(always)]
    unsafe fn take(&mut self, (base, p): Positions<'_, S>, live: u32, _: usize) {
        // SAFETY: the caller's promises.
        unsafe {
            // `max` gives its second argument where the first is NaN.
            let value = S::mul(F::fetch::<S>(&self.job.voxels, base, p), S::splat(self.sign));
            self.best = S::select(live, S::max(value, self.best), self.best);
        }
    }

    #[inline(always)]
    unsafe fn end(&mut self, _: i64) -> u32 {
        // SAFETY: the caller's promises.
        unsafe { !S::lt_bits(self.best, S::splat(self.limit)) & ALL }
    }

    #[inline(always)]
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]) {
        // SAFETY: the caller's promises.
        unsafe {
            let nothing = S::splat(0.0);
            let Some(peaks) = self.job.peaks else { return around::<S>(block, nothing) };
            let near = S::select(self.worse(peaks, &peaks.near, index), S::splat(Peaks::NEAR as f32), nothing);
            let far = self.worse(peaks, &peaks.far, index);
            around::<S>(block, S::select(far, S::splat(Peaks::FAR as f32), near))
        }
    }
}

impl<S: Simd, F: Fetch> Extreme<'_, S, F> {
    /// Lanes whose best number no value around their block passes. Bounds are taken a
    /// ten-thousandth wider, so that rounding here cannot make them narrower than they are.
    #[inline(always)]
    unsafe fn worse(&self, peaks: &Peaks, steps: &[u8], index: S::I) -> u32 {
        // SAFETY: indices are inside, and the lists are padded by four bytes.
        unsafe {
            let step = S::to_float(S::and_int(S::gather(steps.as_ptr(), index), S::splat_int(255)));
            let bound = S::fma(step, S::splat(peaks.step * 1.0001), S::splat(peaks.start));
            let endless = if peaks.open { S::lt_bits(S::splat(254.5), step) } else { 0 };
            !S::lt_bits(self.best, bound) & !endless & ALL
        }
    }
}

/// Sum over whole segments.
struct Sum<'a, S: Simd, F: Fetch> {
    job: &'a Job<'a>,
    voxels: PhantomData<F>,
    chunk: S::F,
    total: [f64; LANES],
    missing: [u32; LANES],
    rows: usize,
}

impl<'a, S: Simd, F: Fetch> Sum<'a, S, F> {
    #[inline(always)]
    unsafe fn new(job: &'a Job<'a>) -> Self {
        // SAFETY: the caller's promises.
        let chunk = unsafe { S::splat(0.0) };
        Self { job, voxels: PhantomData, chunk, total: [0.0; LANES], missing: [0; LANES], rows: 0 }
    }
}

impl<S: Simd, F: Fetch> Kernel<S> for Sum<'_, S, F> {
    const AT: f64 = 0.5;

    #[inline(always)]
    unsafe fn start(&mut self, _: Positions<'_, S>) {}

    #[inline(always)]
    unsafe fn take(&mut self, (base, p): Positions<'_, S>, live: u32, _: usize) {
        // SAFETY: the caller's promises.
        unsafe {
            let value = F::fetch::<S>(&self.job.voxels, base, p);
            let mut live = live;
            if self.job.voxels.scalar.is_float() {
                let nan = S::nan_bits(value) & live;
                live &= !nan;
                for l in 0..LANES {
                    self.missing[l] += nan >> l & 1;
                }
            }
            let zero = S::splat(0.0);
            self.chunk = S::add(self.chunk, S::select(live, value, zero));
            self.rows += 1;
        }
    }

    #[inline(always)]
    unsafe fn end(&mut self, _: i64) -> u32 {
        let mut sum = [0f32; LANES];
        debug_assert!(self.rows <= CHUNK);
        self.rows = 0;
        // SAFETY: the caller's promises.
        unsafe {
            S::store(self.chunk, &mut sum);
            self.chunk = S::splat(0.0);
        }
        for l in 0..LANES {
            self.total[l] += f64::from(sum[l]);
        }
        0
    }

    #[inline(always)]
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]) {
        // SAFETY: block indices are inside, and the map is padded by four bytes.
        unsafe {
            let distance = match self.job.empty {
                Some(empty) => S::to_float(S::and_int(S::gather(empty.distance.as_ptr(), index), S::splat_int(255))),
                None => S::splat(0.0),
            };
            around::<S>(block, distance)
        }
    }
}
