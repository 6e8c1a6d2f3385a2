//! A shape composited by first: surfaces where its program's value crosses given values.
//!
//! Values are taken at the ends of the lattice's segments. Between two that lie on different sides
//! of a given value there is a crossing, which is closed in on by the Illinois variant of regula
//! falsi (M. Dowell, P. Jarratt, *A modified regula falsi method*, BIT 11, 1971). What is crossed
//! twice within a segment is not seen.

use volact_core::{ActionError, ParameterValue, VolumeTexture, resolve::ResolvedShape};
use volact_shaders::Entry;

use super::{
    Shader,
    batch::{Evaluator, ROWS, Rays, Worker},
    flat::premultiplied,
    rows::Row,
};
use crate::fast::{
    packet::{Lanes, Packet},
    simd::{LANES, Unit},
    sweep::piece::Hit,
    walk::{CHUNK, Counts},
};

/// Times that a crossing is closed in on, at most.
const ROUNDS: usize = 16;
/// A crossing is found where the value is as near as this part of its change over the segment.
const NEAR: f64 = 1e-7;

/// The program of such a shape.
#[derive(Debug)]
pub struct Crossings<'a> {
    value: Evaluator<'a>,
    shade: Evaluator<'a>,
    /// The values to cross, rising.
    levels: Vec<f64>,
    step: f64,
    termination: f32,
}

/// A bracket around a crossing of a lane.
#[derive(Clone, Copy, Debug)]
struct Bracket {
    lane: usize,
    level: f64,
    t: [f64; 2],
    /// Value minus level at both ends, of different signs; halved where an end stays twice.
    off: [f64; 2],
    /// The end that was moved last.
    moved: Option<usize>,
    /// How near is near enough.
    near: f64,
    found: Option<f64>,
}

/// Where the rays are: the last place of each with its value.
struct Last {
    t: Lanes,
    value: [f64; LANES],
}

impl<'a> Crossings<'a> {
    /// A shape of which the program was compiled; `None` if it has no values or nothing to cross.
    pub fn new(shape: &'a ResolvedShape, shader: &'a Shader, step: f64, termination: f32, unit: Unit) -> Option<Self> {
        let tables = shape.shader.declaration.parameters.iter().filter_map(|p| shape.parameters.get(&p.name));
        let table = tables.into_iter().find_map(|value| match value {
            ParameterValue::Table(table) => Some(table),
            _ => None,
        })?;
        let range = shape.first_volume().map_or([0.0, 1.0], VolumeTexture::range);
        let mut levels: Vec<f64> = table.resolve(range).points().iter().map(|p| p.value).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        Some(Self {
            value: Evaluator::new(shape, shader, (Entry::Value, shader.value.as_ref()?), unit),
            shade: Evaluator::new(shape, shader, (Entry::Shade, &shader.shade), unit),
            levels,
            step,
            termination,
        })
    }

    /// The first failure of the program.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        self.value.check()?;
        self.shade.check()
    }

    /// Adds the hits of rays on stretches, front to back.
    pub fn hits<'r>(
        &self,
        rays: Rays<'_>,
        stretches: impl Iterator<Item = &'r Packet>,
        hits: &mut [Vec<Hit>; LANES],
        counts: &mut Counts,
    ) {
        let mut left = [1f32; LANES];
        for packet in stretches {
            self.stretch(rays, packet, &mut left, hits, counts);
        }
    }

    /// One stretch of each ray, a chunk of the lattice at once.
    fn stretch(
        &self,
        rays: Rays<'_>,
        packet: &Packet,
        left: &mut [f32; LANES],
        hits: &mut [Vec<Hit>; LANES],
        counts: &mut Counts,
    ) {
        let step = self.step;
        let lanes = || (0..LANES).filter(|l| packet.active >> l & 1 == 1);
        let chunk = CHUNK as i64;
        let first =
            lanes().map(|l| (packet.start[l] / step).floor() as i64).min().unwrap_or(0).div_euclid(chunk) * chunk;
        let end = lanes().map(|l| (packet.end[l] / step).ceil() as i64).max().unwrap_or(0);
        let mut last = Last { t: packet.start, value: [f64::NAN; LANES] };
        for k in (first..=end).step_by(CHUNK) {
            let done = (0..LANES).fold(0, |done, l| done | u32::from(left[l] < self.termination) << l);
            let live = packet.active & !done;
            if live == 0 {
                return;
            }
            let brackets = self.value.with(|worker| self.sample(packet, (k, live), rays, worker, &mut last, counts));
            if !brackets.is_empty() {
                self.meet(rays, brackets, left, hits);
            }
        }
    }

    /// Takes values at the ends of segments, from `k` on; returns what lies between.
    fn sample(
        &self,
        packet: &Packet,
        (k, live): (i64, u32),
        rays: Rays<'_>,
        worker: &mut Worker<'a>,
        last: &mut Last,
        counts: &mut Counts,
    ) -> Vec<Bracket> {
        let mut brackets = Vec::new();
        for row in 0..CHUNK {
            // The place that the segment ends at, where that is inside; the ends of the stretch take
            // the place of those that are not.
            let [from, to] = [k + row as i64, k + row as i64 + 1].map(|k| k as f64 * self.step);
            let (mut wanted, mut t) = (0, [0.0; LANES]);
            for l in (0..LANES).filter(|l| live >> l & 1 == 1) {
                let [start, end] = [packet.start[l], packet.end[l]];
                if from < end && start < to {
                    (wanted, t[l]) = (wanted | 1 << l, to.min(end));
                }
            }
            if wanted == 0 {
                continue;
            }
            let begins = (0..LANES).fold(0, |b, l| b | u32::from(wanted >> l & 1 == 1 && from <= packet.start[l]) << l);
            for (lanes, t) in [(begins, packet.start), (wanted, t)].into_iter().filter(|(lanes, _)| *lanes != 0) {
                if worker.rows.len() == ROWS {
                    self.read(rays, worker, last, &mut brackets, counts);
                }
                worker.rows.push(Row::new(0, lanes, t, [self.step as f32; LANES]));
            }
        }
        self.read(rays, worker, last, &mut brackets, counts);
        brackets
    }

    /// Evaluates the places at hand, and finds what was crossed on the way to each.
    fn read(
        &self,
        rays: Rays<'_>,
        worker: &mut Worker<'a>,
        last: &mut Last,
        brackets: &mut Vec<Bracket>,
        counts: &mut Counts,
    ) {
        if self.value.run(rays, worker) {
            for (row, values) in worker.rows.iter().zip(worker.output(0).as_chunks::<LANES>().0) {
                counts.samples += u64::from(row.live.count_ones());
                counts.lattice += u64::from(row.live.count_ones());
                for l in (0..LANES).filter(|l| row.live >> l & 1 == 1) {
                    let (from, to) = (last.value[l], f64::from(values[l]));
                    // A value that is met exactly lies above.
                    let crossed = |level: &&f64| (from < **level) != (to < **level) && !from.is_nan() && !to.is_nan();
                    let bracket = |level: &f64| Bracket {
                        lane: l,
                        level: *level,
                        t: [last.t[l], row.t(l)],
                        off: [from - level, to - level],
                        moved: None,
                        near: NEAR * (to - from).abs(),
                        found: None,
                    };
                    brackets.extend(self.levels.iter().filter(crossed).map(bracket));
                    (last.t[l], last.value[l]) = (row.t(l), to);
                }
            }
        }
        worker.rows.clear();
    }

    /// Closes in on crossings, and adds what is seen there.
    fn meet(&self, rays: Rays<'_>, mut brackets: Vec<Bracket>, left: &mut [f32; LANES], hits: &mut [Vec<Hit>; LANES]) {
        for _ in 0..ROUNDS {
            let mut open: Vec<&mut Bracket> = brackets.iter_mut().filter(|b| b.found.is_none()).collect();
            if open.is_empty() {
                break;
            }
            self.close(rays, &mut open);
        }
        let place = |b: &Bracket| b.found.unwrap_or_else(|| b.guess());
        brackets.sort_by(|a, b| place(a).total_cmp(&place(b)));
        let places: Vec<(usize, f64, f64)> = brackets.iter().map(|b| (b.lane, place(b), b.level)).collect();
        each_of_lanes(
            &places,
            |p| p.0,
            |some| {
                self.shade.with(|worker| {
                    worker.rows.extend(some.iter().map(|lanes| {
                        let (mut live, mut at, mut value) = (0, [0.0; LANES], [0.0; LANES]);
                        for &&(l, t, level) in lanes {
                            (live, at[l], value[l]) = (live | 1 << l, t, level as f32);
                        }
                        Row::new(0, live, at, [self.step as f32; LANES]).with_value(value)
                    }));
                    if !self.shade.run(rays, worker) {
                        return;
                    }
                    for (i, lanes) in some.iter().enumerate() {
                        for &&(l, t, _) in lanes {
                            let color = premultiplied([0, 1, 2, 3].map(|c| worker.output(c)[i * LANES + l]));
                            if color[3] > 0.0 {
                                left[l] *= 1.0 - color[3];
                                hits[l].push(Hit { t, color: color.map(f64::from) });
                            }
                        }
                    }
                });
            },
        );
    }

    /// One round.
    fn close(&self, rays: Rays<'_>, open: &mut [&mut Bracket]) {
        let guesses: Vec<(usize, usize, f64)> = open.iter().enumerate().map(|(i, b)| (i, b.lane, b.guess())).collect();
        let mut values = vec![f64::NAN; open.len()];
        each_of_lanes(
            &guesses,
            |g| g.1,
            |some| {
                self.value.with(|worker| {
                    worker.rows.extend(some.iter().map(|lanes| {
                        let (mut live, mut at) = (0, [0.0; LANES]);
                        lanes.iter().for_each(|&&(_, l, t)| (live, at[l]) = (live | 1 << l, t));
                        Row::new(0, live, at, [self.step as f32; LANES])
                    }));
                    if self.value.run(rays, worker) {
                        for (i, lanes) in some.iter().enumerate() {
                            lanes.iter().for_each(|g| values[g.0] = f64::from(worker.output(0)[i * LANES + g.1]));
                        }
                    }
                });
            },
        );
        for ((bracket, (_, _, t)), value) in open.iter_mut().zip(&guesses).zip(values) {
            bracket.close(*t, value);
        }
    }
}

impl Bracket {
    /// Where the straight line between the ends crosses.
    fn guess(&self) -> f64 {
        let [a, b] = self.off;
        let part = a / (a - b);
        // Infinite ends give no line.
        let part = if part.is_finite() { part } else { 0.5 };
        self.t[0] + part.clamp(0.0, 1.0) * (self.t[1] - self.t[0])
    }

    fn close(&mut self, t: f64, value: f64) {
        let off = value - self.level;
        if off.is_nan() || off.abs() <= self.near || t <= self.t[0] || t >= self.t[1] {
            self.found = Some(t);
            return;
        }
        // The side of a value met exactly is that above, as before.
        let end = usize::from((off < 0.0) != (self.off[0] < 0.0));
        (self.t[end], self.off[end]) = (t, off);
        if self.moved.replace(end) == Some(end) {
            self.off[1 - end] *= 0.5;
        }
    }
}

/// Calls `take` with batches of at most [`ROWS`] rows, each with one item of a lane at most; items
/// of a lane keep their order.
fn each_of_lanes<T>(items: &[T], lane: impl Fn(&T) -> usize, mut take: impl FnMut(&[Vec<&T>])) {
    let mut rows: Vec<Vec<&T>> = Vec::new();
    let mut next = [0; LANES];
    for item in items {
        let row = &mut next[lane(item)];
        if *row == rows.len() {
            rows.push(Vec::new());
        }
        rows[*row].push(item);
        *row += 1;
    }
    rows.chunks(ROWS).for_each(&mut take);
}
