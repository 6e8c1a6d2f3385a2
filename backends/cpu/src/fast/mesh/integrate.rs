//! Emission and absorption along the stretches of sixteen rays.
//!
//! In a stretch of optical depth τ with mean colour c̄ (by optical depth) and colours c₀, c₁ at
//! its ends, what is seen is c̄(1 − e^(−τ)) + (c₁ − c₀)·((1 − e^(−τ))/τ − 1 + (1 − e^(−τ))/2),
//! exact where colour is linear in the optical depth passed. Where that is too far off, or the
//! table is rough, the stretch is integrated exactly.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use super::{
    super::{
        over::Pixels,
        simd::{LANES, Simd},
    },
    exact::Light,
    project::Slopes,
    table::{BENT, Entry, Table},
    walk::Along,
};

/// How wrong what a stretch adds may be.
const WRONG: f32 = 1e-4;

/// What is common to all packets.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// The look of numbers.
    pub table: &'a Table,
    /// Rays end where less than this is left to see.
    pub termination: f32,
    /// Opacity at which depth is taken.
    pub threshold: f32,
}

/// The table's sums at numbers.
#[derive(Clone, Copy)]
struct Sums<S: Simd> {
    /// The interval of the number.
    interval: S::I,
    depth: S::F,
    light: [S::F; 3],
    color: [S::F; 3],
}

/// Sixteen rays on their way.
pub struct Colours<'a, S: Simd> {
    job: &'a Job<'a>,
    slopes: &'a Slopes,
    pixels: &'a mut Pixels,
    color: [S::F; 3],
    left: S::F,
    length: S::F,
    last: Sums<S>,
    /// Lanes whose depth is known.
    reached: u32,
}

impl<'a, S: Simd> Colours<'a, S> {
    /// Goes on from what pixels hold.
    ///
    /// # Safety
    /// As for all functions here: called from a function compiled for `S` on a machine with it.
    #[inline(always)]
    pub unsafe fn new(job: &'a Job<'a>, slopes: &'a Slopes, pixels: &'a mut Pixels) -> Self {
        let (mut color, mut left, mut length) = ([[0f32; LANES]; 3], [0f32; LANES], [0f32; LANES]);
        let mut reached = 0;
        for l in 0..LANES {
            let pixel = pixels.color[l];
            (0..3).for_each(|c| color[c][l] = pixel[c]);
            left[l] = 1.0 - pixel[3];
            length[l] = slopes.length[l] as f32;
            reached |= u32::from(pixel[3] >= job.threshold) << l;
        }
        // SAFETY: the caller's promises.
        unsafe {
            let (zero, interval) = (S::splat(0.0), S::splat_int(0));
            let last = Sums { interval, depth: zero, light: [zero; 3], color: [zero; 3] };
            let color = [S::load(&color[0]), S::load(&color[1]), S::load(&color[2])];
            let (left, length) = (S::load(&left), S::load(&length));
            Self { job, slopes, pixels, color, left, length, last, reached }
        }
    }

    /// Gives the pixels what has been gathered.
    ///
    /// # Safety
    /// As above.
    #[inline(always)]
    pub unsafe fn finish(self) {
        let (mut color, mut left) = ([[0f32; LANES]; 3], [0f32; LANES]);
        // SAFETY: the caller's promises.
        unsafe {
            (0..3).for_each(|c| S::store(self.color[c], &mut color[c]));
            S::store(self.left, &mut left);
        }
        for l in 0..LANES {
            self.pixels.color[l] = [color[0][l], color[1][l], color[2][l], 1.0 - left[l]];
        }
    }

    /// Looks up sums at numbers.
    #[inline(always)]
    unsafe fn look(&self, number: S::F) -> Sums<S> {
        let entries = &self.job.table.entries;
        let mut index = [0i32; LANES];
        // SAFETY: the caller's promises; indices are kept inside the table, also those of NaN.
        unsafe {
            let last = S::splat((entries.len() - 1) as f32);
            let interval = S::to_int(S::min(S::max(number, S::splat(0.0)), last));
            S::store_int(S::shl::<1>(interval), &mut index);
            let base = entries.as_ptr().cast::<u8>();
            let [sum, change, r, g] = S::rows(base, &index);
            let [b, x, y, z] = S::rows(base.add(size_of::<Entry>() / 2), &index);
            let part = S::mul(S::sub(number, S::to_float(interval)), change);
            let light = [S::fma(part, x, r), S::fma(part, y, g), S::fma(part, z, b)];
            Sums { interval, depth: S::add(sum, part), light, color: [x, y, z] }
        }
    }

    /// Extinction and colour at numbers.
    #[inline(always)]
    unsafe fn medium(&self, number: S::F) -> [S::F; 4] {
        let nodes = &self.job.table.nodes;
        let mut index = [0i32; LANES];
        // SAFETY: the caller's promises; there is a node after each interval.
        unsafe {
            let end = S::splat((nodes.len() - 1) as f32);
            let number = S::min(S::max(number, S::splat(0.0)), end);
            let interval = S::to_int(S::min(number, S::splat((nodes.len() - 2) as f32)));
            S::store_int(interval, &mut index);
            let base = nodes.as_ptr().cast::<u8>();
            let (a, b) = (S::rows(base, &index), S::rows(base.add(16), &index));
            let part = S::sub(number, S::to_float(interval));
            [
                mix::<S>(part, a[0], b[0]),
                mix::<S>(part, a[1], b[1]),
                mix::<S>(part, a[2], b[2]),
                mix::<S>(part, a[3], b[3]),
            ]
        }
    }

    /// Lanes that pass numbers which are opaque over some length.
    #[inline(always)]
    unsafe fn passes_opaque(&self, next: S::I) -> u32 {
        let counts = &self.job.table.opaque;
        if counts.is_empty() {
            return 0;
        }
        // SAFETY: there is a count for each interval and one after.
        unsafe {
            let low = S::min_int(self.last.interval, next);
            let high = S::add_int(S::max_int(self.last.interval, next), S::splat_int(1));
            let base = counts.as_ptr().cast();
            !S::eq_int_bits(S::gather(base, S::shl::<2>(low)), S::gather(base, S::shl::<2>(high)))
        }
    }

    /// Lanes in which the same bounds for the stretch itself are too large, too. See
    /// [`bend`](super::bend); ends are off by up to half of what changes between their two nodes.
    #[inline(never)]
    unsafe fn bent(&self, lanes: u32, number: [S::F; 2], [tau, by, left]: [S::F; 3]) -> u32 {
        let (mut numbers, mut each) = ([[0f32; LANES]; 2], [[0f32; LANES]; 3]);
        // SAFETY: the caller's promises.
        unsafe {
            (0..2).for_each(|i| S::store(number[i], &mut numbers[i]));
            S::store(tau, &mut each[0]);
            S::store(by, &mut each[1]);
            S::store(left, &mut each[2]);
        }
        let table = self.job.table;
        let is_bent = |l: &usize| {
            let numbers = numbers.map(|n| n[*l]);
            let [tau, by, left] = each.map(|v| v[*l]);
            let [a, b] = numbers.map(|n| table.step(n));
            let bend = table.bends.at(numbers) + (a[1] + b[1]) / 24.0;
            let past = (-tau).exp();
            let depth = by * (past * (a[0] + b[0]) / 8.0 + table.rounding * (1.0 - past) / tau.max(1e-6));
            left * (tau * tau.min(1.0) * bend + depth) > BENT
        };
        (0..LANES).filter(|l| lanes >> l & 1 == 1).filter(is_bent).fold(0, |bent, l| bent | 1 << l)
    }

    /// Integrates lanes exactly.
    #[inline(never)]
    unsafe fn exactly(&mut self, lanes: u32, depth: [S::F; 2], number: [S::F; 2], before: S::F) {
        let (mut depths, mut numbers) = ([[0f32; LANES]; 2], [[0f32; LANES]; 2]);
        let (mut color, mut left) = ([[0f32; LANES]; 3], [0f32; LANES]);
        let mut first = [0f32; LANES];
        // SAFETY: the caller's promises.
        unsafe {
            for i in 0..2 {
                S::store(depth[i], &mut depths[i]);
                S::store(number[i], &mut numbers[i]);
            }
            (0..3).for_each(|c| S::store(self.color[c], &mut color[c]));
            S::store(self.left, &mut left);
            S::store(before, &mut first);
        }
        for l in (0..LANES).filter(|l| lanes >> l & 1 == 1) {
            let values = [0, 1].map(|i| self.job.table.value(numbers[i][l]));
            let mut light = Light { color: [0, 1, 2].map(|c| f64::from(color[c][l])), left: f64::from(first[l]) };
            let length = f64::from(depths[1][l] - depths[0][l]) * self.slopes.length[l];
            self.job.table.look.add(&mut light, values, values, length, 0.0);
            (0..3).for_each(|c| color[c][l] = light.color[c] as f32);
            left[l] = light.left as f32;
        }
        // SAFETY: the caller's promises.
        unsafe {
            self.color = [S::load(&color[0]), S::load(&color[1]), S::load(&color[2])];
            self.left = S::load(&left);
        }
    }

    /// Finds the depths of lanes that have reached the threshold.
    #[inline(never)]
    unsafe fn reach(&mut self, lanes: u32, depth: [S::F; 2], number: [S::F; 2], before: S::F) {
        let (mut depths, mut numbers, mut first) = ([[0f32; LANES]; 2], [[0f32; LANES]; 2], [0f32; LANES]);
        // SAFETY: the caller's promises.
        unsafe {
            for i in 0..2 {
                S::store(depth[i], &mut depths[i]);
                S::store(number[i], &mut numbers[i]);
            }
            S::store(before, &mut first);
        }
        self.reached |= lanes;
        for l in (0..LANES).filter(|l| lanes >> l & 1 == 1) {
            let values = [0, 1].map(|i| self.job.table.value(numbers[i][l]));
            let [from, to] = [0, 1].map(|i| self.slopes.zero[l] + self.slopes.length[l] * f64::from(depths[i][l]));
            let wanted = (f64::from(first[l]) / (1.0 - f64::from(self.job.threshold))).ln();
            let part = self.job.table.look.find(values, values, to - from, wanted);
            self.pixels.depth[l] = from + (to - from) * part;
        }
    }
}

impl<S: Simd> Along<S> for Colours<'_, S> {
    #[inline(always)]
    unsafe fn start(&mut self, lanes: u32, number: S::F) {
        // SAFETY: the caller's promises.
        unsafe {
            let new = self.look(number);
            let last = &mut self.last;
            last.interval = S::select_int(lanes, new.interval, last.interval);
            last.depth = S::select(lanes, new.depth, last.depth);
            for c in 0..3 {
                last.light[c] = S::select(lanes, new.light[c], last.light[c]);
                last.color[c] = S::select(lanes, new.color[c], last.color[c]);
            }
        }
    }

    #[inline(always)]
    unsafe fn take(&mut self, lanes: u32, depth: [S::F; 2], number: [S::F; 2]) -> u32 {
        // SAFETY: the caller's promises.
        unsafe {
            let length = S::mul(S::sub(depth[1], depth[0]), self.length);
            let next = self.look(number[1]);
            let last = self.last;
            let change = S::sub(number[1], number[0]);
            let by = S::div(length, change);
            let sum = S::sub(next.depth, last.depth);
            let mut tau = S::mul(by, sum);
            let mut light = [
                S::mul(by, S::sub(next.light[0], last.light[0])),
                S::mul(by, S::sub(next.light[1], last.light[1])),
                S::mul(by, S::sub(next.light[2], last.light[2])),
            ];
            let small = S::lt_bits(magnitude::<S>(change), S::splat(1.0));
            if small & lanes != 0 {
                let middle = S::mul(S::add(number[0], number[1]), S::splat(0.5));
                let [sigma, r, g, b] = self.medium(middle);
                // The sum is not looked at but for being NaN.
                let own = S::fma(sum, S::splat(0.0), S::mul(sigma, length));
                tau = S::select(small, own, tau);
                light[0] = S::select(small, S::mul(r, own), light[0]);
                light[1] = S::select(small, S::mul(g, own), light[1]);
                light[2] = S::select(small, S::mul(b, own), light[2]);
            }
            let left = self.left;
            let mut rough = (S::nan_bits(tau) | self.passes_opaque(next.interval)) & lanes;
            let slope = [
                S::sub(next.color[0], last.color[0]),
                S::sub(next.color[1], last.color[1]),
                S::sub(next.color[2], last.color[2]),
            ];
            // How far the mean colour is from the middle of those at the ends, times τ² and what
            // is left.
            let mut off = S::splat(0.0);
            for c in 0..3 {
                let middle = S::fma(slope[c], S::splat(0.5), last.color[c]);
                off = S::max(off, magnitude::<S>(S::sub(light[c], S::mul(tau, middle))));
            }
            rough |= S::lt_bits(S::splat(WRONG), S::mul(S::mul(off, tau), left)) & lanes;
            // What the mean does not tell, by bounds for the whole table first: how much the colour
            // may bend, and what extinction and colour taken even between two nodes may cost.
            let table = self.job.table;
            let by = S::select(small, S::splat(0.0), magnitude::<S>(by));
            let weight = S::mul(tau, S::min(tau, S::splat(1.0)));
            let most = S::min(S::mul(magnitude::<S>(change), S::splat(table.bends.steep)), S::splat(table.bends.most));
            let most = S::fma(
                weight,
                S::add(most, S::splat(table.steps[1] / 12.0)),
                S::mul(by, S::splat(table.steps[0] / 4.0 + table.rounding)),
            );
            let bent = S::lt_bits(S::splat(BENT), S::mul(most, left)) & lanes & !rough;
            if bent != 0 {
                rough |= self.bent(bent, number, [tau, by, left]);
            }
            let plain = lanes & !rough;
            let tau = S::max(S::select(plain, tau, S::splat(0.0)), S::splat(0.0));
            let [alpha, ratio] = absorbed::<S>(tau);
            let weight = S::fma(alpha, S::splat(0.5), S::sub(ratio, S::splat(1.0)));
            for c in 0..3 {
                let light = S::select(plain, light[c], S::splat(0.0));
                let seen = S::fma(light, ratio, S::mul(slope[c], weight));
                self.color[c] = S::fma(left, seen, self.color[c]);
            }
            self.left = S::fma(S::sub(S::splat(0.0), left), alpha, left);
            self.last = next;
            if rough != 0 {
                self.exactly(rough, depth, number, left);
            }
            let reached = !S::lt_bits(S::splat(1.0 - self.job.threshold), self.left) & lanes & !self.reached;
            if reached != 0 {
                self.reach(reached, depth, number, left);
            }
            S::lt_bits(self.left, S::splat(self.job.termination)) & lanes
        }
    }
}

/// a + t·(b − a).
#[inline(always)]
unsafe fn mix<S: Simd>(t: S::F, a: S::F, b: S::F) -> S::F {
    // SAFETY: the caller's promises.
    unsafe { S::fma(t, S::sub(b, a), a) }
}

#[inline(always)]
unsafe fn magnitude<S: Simd>(a: S::F) -> S::F {
    // SAFETY: the caller's promises.
    unsafe { S::max(a, S::sub(S::splat(0.0), a)) }
}

/// 1 − e^(−τ), and the same over τ; τ is not negative.
#[inline(always)]
unsafe fn absorbed<S: Simd>(tau: S::F) -> [S::F; 2] {
    // SAFETY: the caller's promises.
    unsafe {
        let x = S::max(S::sub(S::splat(0.0), tau), S::splat(-87.0));
        let n = S::floor(S::fma(x, S::splat(std::f32::consts::LOG2_E), S::splat(0.5)));
        // ln 2 in two parts (W. J. Cody, W. Waite, 1980).
        let r = S::fma(n, S::splat(-0.693_359_4), x);
        let r = S::fma(n, S::splat(2.121_944_4e-4), r);
        let mut series = S::splat(1.0 / 5040.0);
        for term in [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0] {
            series = S::fma(series, r, S::splat(term));
        }
        let less = S::mul(series, r);
        let power = S::as_float(S::shl::<23>(S::add_int(S::to_int(n), S::splat_int(127))));
        let alpha = S::sub(S::sub(S::splat(1.0), power), S::mul(power, less));
        [alpha, S::where_zero(tau, S::splat(1.0), S::div(alpha, tau))]
    }
}
