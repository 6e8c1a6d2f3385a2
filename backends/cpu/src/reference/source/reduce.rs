//! One number a ray: the highest, the lowest, the mean, the integral of the value; and what is
//! seen of it.
//!
//! Mean and integral are by Gauss's rule of four points on parts that are halved until two agree.
//! Where there is no value there is no length, either.

use volact_core::Compositing;

use super::{
    ask::Asker,
    fit::{ALL, WEIGHTS, miss, places, through},
    program::{Course, Sample},
    search,
};
use crate::reference::{line::EPS, march::Light};

/// Parts are halved at least this often.
const LEAST: u8 = 1;
/// And at most this often.
const MOST: u8 = 56;
/// The most parts of a stretch, beyond some for each cut.
const PARTS: usize = 1 << 15;
/// The parts for each cut.
const EACH: usize = 64;

/// What was gathered of a value along a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gathered {
    /// Highest, and highest negative, with the errors.
    extremes: [[f64; 2]; 2],
    integral: f64,
    length: f64,
    error: f64,
}

impl Gathered {
    /// Nothing yet.
    pub const NONE: Self = Self { extremes: [[f64::NEG_INFINITY, 0.0]; 2], integral: 0.0, length: 0.0, error: 0.0 };

    /// A segment with the values at its ends, or twice that in its middle.
    pub fn add(&mut self, [a, b]: [f64; 2], length: f64) {
        if !a.is_nan() && !b.is_nan() {
            let most = [a.max(b), (-a).max(-b)];
            (0..2).for_each(|i| self.extremes[i][0] = self.extremes[i][0].max(most[i]));
            self.integral += 0.5 * (a + b) * length;
            self.length += length;
        }
    }

    /// A stretch that is cut at `cuts`, by search or quadrature.
    pub fn add_stretch(
        &mut self,
        asker: &mut Asker<'_>,
        course: &Course<'_>,
        cuts: &[f64],
        compositing: Compositing,
        tolerance: f64,
    ) {
        let signs = [(Compositing::Maximum, 0, 1.0), (Compositing::Minimum, 1, -1.0)];
        if let Some((_, i, sign)) = signs.into_iter().find(|s| s.0 == compositing) {
            let [best, error] = search::highest(asker, course, cuts, sign);
            if best > f64::NEG_INFINITY {
                self.extremes[i] = [self.extremes[i][0].max(best), self.extremes[i][1].max(error)];
                self.length += cuts[cuts.len() - 1] - cuts[0];
            }
            return;
        }
        let [integral, length, error] = integrate(asker, course, cuts, tolerance);
        self.integral += integral;
        self.length += length;
        self.error += error;
    }

    /// The number and the bound on its error; `None` where there is none.
    pub fn value(&self, compositing: Compositing, unit: f64) -> Option<[f64; 2]> {
        let made = match compositing {
            _ if self.length <= 0.0 => return None,
            Compositing::Maximum => self.extremes[0],
            Compositing::Minimum => [-self.extremes[1][0], self.extremes[1][1]],
            Compositing::Average => [self.integral / self.length, self.error / self.length],
            _ => [self.integral / unit, self.error / unit],
        };
        let error = made[1] + 8.0 * EPS * made[0].abs();
        (!made[0].is_nan()).then_some([made[0], if error.is_finite() { error } else { 0.0 }])
    }
}

/// What a value shows: its medium and those at the ends of its error.
pub(super) fn light(asker: &mut Asker<'_>, course: &Course<'_>, sample: Sample, error: f64) -> Light {
    let at = |value: f64| Sample { value, ..sample };
    let media = asker.media(course, &[at(sample.value), at(sample.value - error), at(sample.value + error)]);
    let mut light = Light { lower: [f64::INFINITY; 4], upper: [f64::NEG_INFINITY; 4], ..Light::NONE };
    for [r, g, b, opacity] in media {
        let alpha = opacity.clamp(0.0, 1.0);
        for (c, v) in [r * alpha, g * alpha, b * alpha, alpha].into_iter().enumerate() {
            let round = 8.0 * EPS * v.abs();
            light.lower[c] = light.lower[c].min(v - round);
            light.upper[c] = light.upper[c].max(v + round);
        }
    }
    light.lower[3] = light.lower[3].max(0.0);
    light.upper[3] = light.upper[3].min(1.0);
    light
}

/// A part with its integral and its length, as far as there is a value.
#[derive(Clone, Copy)]
struct Part {
    t: [f64; 2],
    level: u8,
    sums: [f64; 2],
    /// How far the cubic misses the values at the ends, times half of the length.
    miss: f64,
}

/// Integral, length and the error of the integral.
fn integrate(asker: &mut Asker<'_>, course: &Course<'_>, cuts: &[f64], tolerance: f64) -> [f64; 3] {
    let whole: Vec<_> = cuts.windows(2).map(|w| ([w[0], w[1]], 0)).collect();
    let (mut parts, mut most) = (Vec::new(), 0.0);
    evaluate(asker, course, &whole, &mut parts, &mut most);
    let all = cuts[cuts.len() - 1] - cuts[0];
    let scale = cuts.iter().fold(course.at.abs().max_element(), |m, t| m.max(t.abs()));
    let (mut total, mut count) = ([0.0; 3], parts.len());
    while !parts.is_empty() {
        let halves: Vec<_> = parts.iter().flat_map(halves).collect();
        let mut made = Vec::with_capacity(halves.len());
        evaluate(asker, course, &halves, &mut made, &mut most);
        count += made.len();
        let mut next = Vec::new();
        for (part, two) in parts.iter().zip(made.chunks_exact(2)) {
            let sums = [0, 1].map(|i| two[0].sums[i] + two[1].sums[i]);
            let wrong = (sums[0] - part.sums[0]).abs() + (sums[1] - part.sums[1]).abs() * most;
            let wanted = (tolerance * most * all).max(4.0 * EPS * sums[0].abs());
            let miss = two[0].miss.max(two[1].miss);
            let smooth = miss <= 0.25 * part.miss || miss <= wanted;
            let enough = part.level >= LEAST && smooth && wrong <= wanted;
            let last =
                part.level >= MOST || count > PARTS + EACH * cuts.len() || part.t[1] - part.t[0] <= 128.0 * EPS * scale;
            if enough || last {
                total = [total[0] + sums[0], total[1] + sums[1], total[2] + wrong];
            } else {
                next.extend_from_slice(two);
            }
        }
        parts = next;
    }
    total
}

fn halves(part: &Part) -> [([f64; 2], u8); 2] {
    let middle = 0.5 * (part.t[0] + part.t[1]);
    [([part.t[0], middle], part.level + 1), ([middle, part.t[1]], part.level + 1)]
}

fn evaluate(
    asker: &mut Asker<'_>,
    course: &Course<'_>,
    parts: &[([f64; 2], u8)],
    made: &mut Vec<Part>,
    most: &mut f64,
) {
    let samples: Vec<Sample> =
        parts.iter().flat_map(|(t, _)| places(*t)).map(|t| Sample { t, ..Sample::default() }).collect();
    let values = asker.values(course, &samples);
    for ((t, level), v) in parts.iter().zip(values.chunks_exact(ALL)) {
        let half = 0.5 * (t[1] - t[0]);
        let (ends, v) = ([v[0], v[ALL - 1]], &v[1..ALL - 1]);
        let known = || v.iter().zip(WEIGHTS).filter(|(v, _)| !v.is_nan());
        let sums = [known().map(|(v, w)| half * w * v).sum(), known().map(|(_, w)| half * w).sum()];
        *most = known().map(|(v, _)| v.abs()).filter(|v| v.is_finite()).fold(*most, f64::max);
        // Where there is no value, one is made up: only that it begins or ends counts.
        let full = |v: f64| if v.is_nan() { -*most - 1.0 } else { v };
        let cubic = through([v[0], v[1], v[2], v[3]].map(full));
        made.push(Part { t: *t, level: *level, sums, miss: half * miss(&cubic, ends.map(full)) });
    }
}
