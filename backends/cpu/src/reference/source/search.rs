//! The value along a stretch, looked at ever more closely where that matters: for its extremes and
//! for where it crosses given values.
//!
//! A part is known at five points. By how much it may leave what they show is estimated by
//! second differences: a parabola leaves them by an eighth of that at most, and eight times as
//! much is allowed for.

use super::{
    ask::Asker,
    program::{Course, Sample},
};
use crate::reference::line::EPS;

/// Parts are halved at least this often.
const LEAST: u8 = 1;
/// And at most this often.
const MOST: u8 = 56;
/// The most parts that are looked at, beyond some for each cut.
const PARTS: usize = 1 << 15;
/// The parts for each cut.
const EACH: usize = 64;
/// Up to this level one crossing is looked at more closely unless the value is plainly monotone.
const PLAIN: u8 = 4;
/// How far around a crossing the slope is looked at.
const NEAR: f64 = 1e-7;
/// Points inside a bracket in one round.
const INNER: usize = 7;

/// A part of a stretch with the values at five points, of which the outer ones lie just inside.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part {
    pub t: [f64; 2],
    level: u8,
    at: [f64; 5],
    pub v: [f64; 5],
}

impl Part {
    /// By how much the value may leave what is seen, by estimate.
    fn margin(&self) -> f64 {
        let v = &self.v;
        let bends = (1..4).map(|i| (v[i - 1] - 2.0 * v[i] + v[i + 1]).abs());
        let known = bends.filter(|b| !b.is_nan()).fold(0.0, f64::max);
        // Where there is nothing at some points, it may begin anywhere between.
        let some = v.iter().filter(|v| !v.is_nan()).count();
        if some == 0 || some == 5 { known } else { known + self.spread() }
    }

    fn spread(&self) -> f64 {
        let [low, high] = self.range();
        if low < high { high - low } else { 0.0 }
    }

    fn range(&self) -> [f64; 2] {
        self.v.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(*v), b.max(*v)])
    }

    /// Whether it has to be halved to know where it crosses a value.
    fn unclear(&self, value: f64) -> bool {
        let changes = self.v.windows(2).filter(|w| crosses(w[0], w[1], value)).count();
        let nearest = self.v.iter().map(|v| (v - value).abs()).fold(f64::INFINITY, f64::min);
        let rises = self.v.windows(2).all(|w| w[1] >= w[0]) || self.v.windows(2).all(|w| w[1] <= w[0]);
        match changes {
            0 => self.margin() > 0.0 && nearest <= self.margin(),
            1 => !rises && self.level < PLAIN,
            _ => true,
        }
    }

    fn halves(&self) -> [([f64; 2], u8); 2] {
        let middle = 0.5 * (self.t[0] + self.t[1]);
        [([self.t[0], middle], self.level + 1), ([middle, self.t[1]], self.level + 1)]
    }
}

/// Whether a value lies between two others, or is the higher one.
pub(super) fn crosses(a: f64, b: f64, value: f64) -> bool {
    !a.is_nan() && !b.is_nan() && (a >= value) != (b >= value)
}

fn evaluate(asker: &mut Asker<'_>, course: &Course<'_>, parts: &[([f64; 2], u8)]) -> Vec<Part> {
    let places = |t: &[f64; 2]| {
        let (width, most) = (t[1] - t[0], t[0].abs().max(t[1].abs()));
        let inside = (1e-12 * width).max(4.0 * EPS * most).min(0.125 * width);
        [t[0] + inside, t[0] + 0.25 * width, t[0] + 0.5 * width, t[0] + 0.75 * width, t[1] - inside]
    };
    let samples: Vec<Sample> =
        parts.iter().flat_map(|(t, _)| places(t)).map(|t| Sample { t, ..Sample::default() }).collect();
    let values = asker.values(course, &samples);
    let part = |((t, level), v): (&([f64; 2], u8), &[f64])| Part {
        t: *t,
        level: *level,
        at: places(t),
        v: [v[0], v[1], v[2], v[3], v[4]],
    };
    parts.iter().zip(values.chunks_exact(5)).map(part).collect()
}

/// Halves parts of a stretch, level by level, as long as `wanted` says so of them; `begin` is told
/// each level before. Parts that are halved no more are given to `done`, with whether they should
/// have been.
fn refine(
    asker: &mut Asker<'_>,
    course: &Course<'_>,
    cuts: &[f64],
    mut begin: impl FnMut(&[Part]),
    mut wanted: impl FnMut(&Part) -> bool,
    mut done: impl FnMut(Part, bool),
) {
    let whole: Vec<_> = cuts.windows(2).map(|w| ([w[0], w[1]], 0)).collect();
    let scale = cuts.iter().fold(course.at.abs().max_element(), |m, t| m.max(t.abs()));
    let (mut parts, mut count) = (evaluate(asker, course, &whole), whole.len());
    while !parts.is_empty() {
        let mut next = Vec::new();
        begin(&parts);
        for part in &parts {
            let again = part.level < LEAST || wanted(part);
            let last =
                part.level >= MOST || count > PARTS + EACH * cuts.len() || part.t[1] - part.t[0] <= 64.0 * EPS * scale;
            if again && !last {
                next.extend(part.halves());
            } else {
                done(*part, again);
            }
        }
        count += next.len();
        parts = evaluate(asker, course, &next);
    }
}

/// The highest value on a stretch, and by how much it may be wrong; −∞ where there is none.
/// With `sign` −1 the highest of the values' negatives.
pub(super) fn highest(asker: &mut Asker<'_>, course: &Course<'_>, cuts: &[f64], sign: f64) -> [f64; 2] {
    let top = |p: &Part| p.v.iter().map(|v| sign * v).filter(|v| !v.is_nan()).fold(f64::NEG_INFINITY, f64::max);
    let best = std::cell::Cell::new(f64::NEG_INFINITY);
    let mut above = f64::NEG_INFINITY;
    let tiny = |best: f64| if best.is_finite() { 16.0 * EPS * best.abs() } else { 0.0 };
    let begin = |all: &[Part]| best.set(all.iter().map(top).fold(best.get(), f64::max));
    let wanted = |part: &Part| top(part) + part.margin() > best.get() + tiny(best.get());
    refine(asker, course, cuts, begin, wanted, |part, open| {
        if open {
            above = above.max(top(&part) + part.margin());
        }
    });
    let best = best.get();
    let wrong = (above - best).max(tiny(best));
    [best, if best.is_finite() { wrong.max(0.0) } else { 0.0 }]
}

/// The places where the value crosses one of `values`, in order: place, bound on its error, value.
pub(super) fn crossings(
    asker: &mut Asker<'_>,
    course: &Course<'_>,
    cuts: &[f64],
    values: &[f64],
) -> Vec<(f64, f64, f64)> {
    let mut known: Vec<(f64, f64)> = Vec::new();
    let near = |part: &Part| {
        let ([low, high], margin) = (part.range(), part.margin());
        let first = values.partition_point(|v| *v < low - margin);
        let last = values.partition_point(|v| *v <= high + margin);
        first..last.max(first)
    };
    let wanted = |part: &Part| values[near(part)].iter().any(|v| part.unclear(*v));
    refine(asker, course, cuts, |_| {}, wanted, |part, _| known.extend(part.at.into_iter().zip(part.v)));
    known.sort_by(|a, b| a.0.total_cmp(&b.0));
    let scale = cuts.iter().fold(0.0, |m: f64, t| m.max(t.abs())).max(course.at.abs().max_element());
    between(asker, course, &known, values, scale)
}

/// The places where the value crosses one of `values` between neighbouring samples of it.
pub(super) fn between(
    asker: &mut Asker<'_>,
    course: &Course<'_>,
    samples: &[(f64, f64)],
    values: &[f64],
    scale: f64,
) -> Vec<(f64, f64, f64)> {
    let mut brackets = Vec::new();
    for w in samples.windows(2) {
        let [(a, va), (b, vb)] = [w[0], w[1]];
        let crossed = values.iter().filter(|v| crosses(va, vb, **v));
        brackets.extend(crossed.map(|v| Bracket { t: [a, b], above: va >= *v, value: *v }));
    }
    while brackets.iter().any(|b| b.is_open(scale)) {
        let open: Vec<usize> = (0..brackets.len()).filter(|i| brackets[*i].is_open(scale)).collect();
        let at: Vec<Sample> = open.iter().flat_map(|i| brackets[*i].inner()).map(at).collect();
        let found = asker.values(course, &at);
        for (i, values) in open.into_iter().zip(found.chunks_exact(INNER)) {
            brackets[i].narrow(values);
        }
    }
    let around: Vec<_> = brackets.iter().flat_map(|b| [b.t[0] - NEAR * scale, b.t[1] + NEAR * scale]).map(at).collect();
    let slopes = asker.values(course, &around);
    let place = |(b, v): (&Bracket, &[f64])| (0.5 * (b.t[0] + b.t[1]), b.error([v[0], v[1]], scale), b.value);
    let mut found: Vec<_> = brackets.iter().zip(slopes.chunks_exact(2)).map(place).collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

fn at(t: f64) -> Sample {
    Sample { t, ..Sample::default() }
}

/// Two places between which the value crosses another.
struct Bracket {
    t: [f64; 2],
    /// Whether it is above at the first.
    above: bool,
    value: f64,
}

impl Bracket {
    fn is_open(&self, scale: f64) -> bool {
        self.t[1] - self.t[0] > 8.0 * EPS * scale
    }

    /// How far off it may be, given the values around it: a rounding of the value moves the place
    /// the more, the flatter the value runs.
    fn error(&self, around: [f64; 2], scale: f64) -> f64 {
        let width = self.t[1] - self.t[0];
        let slope = (around[1] - around[0]).abs() / (2.0 * NEAR * scale + width);
        let size = around.iter().fold(self.value.abs(), |m, v| m.max(v.abs()));
        let moved = 16.0 * EPS * size / slope;
        width + if moved.is_nan() { 0.0 } else { moved.min(NEAR * scale) }
    }

    fn inner(&self) -> [f64; INNER] {
        std::array::from_fn(|k| self.t[0] + (self.t[1] - self.t[0]) * (k + 1) as f64 / (INNER + 1) as f64)
    }

    /// Leaves the first of the parts at whose ends the value lies on different sides. Where there
    /// is nothing, it is taken to be where it was.
    fn narrow(&mut self, values: &[f64]) {
        let inner = self.inner();
        let crossed = values.iter().position(|v| !v.is_nan() && (*v >= self.value) != self.above);
        let [start, end] = self.t;
        self.t = match crossed {
            Some(0) => [start, inner[0]],
            Some(k) => [inner[k - 1], inner[k]],
            None => [inner[INNER - 1], end],
        };
    }
}
