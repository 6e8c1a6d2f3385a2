//! A lookup table as integrals over the number, so that what a stretch of any length adds is two
//! lookups.
//!
//! Along a stretch of length L on which the number runs from v₀ to v₁, the optical depth is
//! L·(S(v₁) − S(v₀))/(v₁ − v₀) with S = ∫σ dv, and its mean colour is
//! (Q(v₁) − Q(v₀))/(S(v₁) − S(v₀)) with Q = ∫σc dv. Both are linear between nodes. Where v₁ ≈ v₀
//! the extinction in the middle does.
//!
//! Intervals between nodes in which the look is far from linear (steps, thin spikes, nearly opaque
//! numbers) are *rough*: their S is NaN at any number inside, and who meets it integrates exactly
//! instead.

use super::{bend::Bends, exact::Look};

/// Intervals over the numbers that differ in looks.
const NODES: usize = 4096;

/// How wrong extinction, as a part of itself, and colour may be between two nodes.
const ROUGH: f64 = 1e-4;

/// How wrong the light of a stretch may be because its colour is not linear in optical depth.
pub const BENT: f32 = 1.5e-5;

/// Abscissae on 0 to 1 and weights of Gauss's rule with four points.
const GAUSS: [[f64; 2]; 4] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_87, 0.326_072_577_431_273_07],
    [0.669_990_521_792_428_1, 0.326_072_577_431_273_07],
    [0.930_568_155_797_026_3, 0.173_927_422_568_726_93],
];

/// An interval: S at its beginning and its change, Q at its beginning, and the mean colour.
/// Lengths of numbers count in intervals.
pub type Entry = [f32; 8];

/// A lookup table for stretches.
#[derive(Clone, Debug)]
pub struct Table {
    /// The number at which the first interval begins, and intervals a unit of it.
    first: f64,
    scale: f64,
    /// One an interval.
    pub entries: Vec<Entry>,
    /// At each node, the ends included: extinction and colour.
    pub nodes: Vec<[f32; 4]>,
    /// Opaque intervals before each interval and after all; empty where there is none.
    pub opaque: Vec<u32>,
    /// How far from linear colours are.
    pub bends: Bends,
    /// The most that extinction and a colour change over an interval that is not rough.
    pub steps: [f32; 2],
    /// What rounding to f32 takes from a difference of S or Q, as a rule at most.
    pub rounding: f32,
    /// The same, exactly.
    pub look: Look,
}

/// S, Q and colour of an interval.
#[derive(Default)]
struct Interval {
    sums: [f64; 4],
    color: [f64; 3],
    rough: bool,
    opaque: bool,
}

impl Table {
    /// The integrals over numbers `range` that occur. `middle` is one near which most are: there
    /// digits count most. `diagonal` is the longest way through the mesh.
    pub fn new(look: Look, range: [f64; 2], middle: f64, diagonal: f64) -> Self {
        let ends = [look.points().first(), look.points().last()].map(|p| p.map_or(0.0, |p| p.value));
        let (low, high) = (range[0].max(ends[0]), range[1].min(ends[1]));
        let [low, high] = if low < high { [low, high] } else { range };
        let step = high / NODES as f64 - low / NODES as f64;
        let step = if step.recip().is_finite() && step > 0.0 { step } else { 1.0 };
        // One more interval at each end goes on with the look at the end.
        let first = low - step;
        let value = |i: usize| first + step * i as f64;
        let intervals: Vec<_> = (0..NODES + 2).map(|i| interval(&look, [value(i), value(i + 1)], diagonal)).collect();
        let center = ((middle - first) / step).clamp(0.0, (NODES + 1) as f64) as usize;
        let node = |i: usize| {
            let [r, g, b, a] = look.classify(value(i));
            [sigma(a, look.unit()), r, g, b].map(|v| v as f32)
        };
        let nodes: Vec<_> = (0..NODES + 3).map(node).collect();
        let smooth = (0..NODES + 2).filter(|&i| !intervals[i].rough).map(|i| change(&nodes, i));
        let steps = smooth.fold([0f32; 2], |[a, b], [s, c]| [a.max(s), b.max(c)]);
        let opaque = count_opaque(&intervals);
        let known: Vec<_> = intervals.iter().map(|i| (i.sums, i.color)).collect();
        let bends = Bends::new(&known, diagonal, f64::from(BENT));
        let entries = sum(&intervals, center);
        let most = entries.iter().map(|e| e[0].abs()).fold(0.0, f32::max);
        // Each of both is off by half a unit in its last place at most, and by a quarter as a rule.
        let rounding = most * 0.5 * f32::EPSILON;
        Self { first, scale: step.recip(), entries, nodes, opaque, bends, steps, rounding, look }
    }

    /// A number as the walk carries it: counted in intervals.
    pub fn number(&self, value: f64) -> f32 {
        if value.is_infinite() {
            return f32::NAN;
        }
        // What lies far outside looks like the ends, but f32 has to hold it.
        ((value - self.first) * self.scale).clamp(-1e30, 1e30) as f32
    }

    /// The number that is carried so.
    pub fn value(&self, number: f32) -> f64 {
        self.first + f64::from(number) / self.scale
    }

    /// What extinction and colour change over the interval of a number, as it is carried.
    pub fn step(&self, number: f32) -> [f32; 2] {
        change(&self.nodes, (number.max(0.0) as usize).min(self.nodes.len() - 2))
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(self.entries.as_slice())
            + size_of_val(self.nodes.as_slice())
            + 4 * self.opaque.len()
            + self.bends.bytes()
    }
}

/// Entries whose sums count from the beginning of an interval.
fn sum(intervals: &[Interval], center: usize) -> Vec<Entry> {
    let mut sums = [0f64; 4];
    for interval in &intervals[..center] {
        (0..4).for_each(|c| sums[c] -= interval.sums[c]);
    }
    let mut entries = Vec::with_capacity(intervals.len());
    for interval in intervals {
        let [s, q, r, t] = sums.map(|v| v as f32);
        let [x, y, z] = interval.color.map(|v| v as f32);
        let change = if interval.rough { f32::NAN } else { interval.sums[0] as f32 };
        entries.push([s, change, q, r, t, x, y, z]);
        (0..4).for_each(|c| sums[c] += interval.sums[c]);
    }
    entries
}

/// What extinction changes over an interval, and the colour that changes most.
fn change(nodes: &[[f32; 4]], i: usize) -> [f32; 2] {
    let [a, b] = [nodes[i], nodes[i + 1]];
    [(b[0] - a[0]).abs(), (1..4).map(|c| (b[c] - a[c]).abs()).fold(0.0, f32::max)]
}

fn count_opaque(intervals: &[Interval]) -> Vec<u32> {
    let mut counts = vec![0];
    counts.extend(intervals.iter().scan(0, |n, i| {
        *n += u32::from(i.opaque);
        Some(*n)
    }));
    if counts.last() == Some(&0) { Vec::new() } else { counts }
}

fn sigma(opacity: f64, unit: f64) -> f64 {
    if opacity < 1.0 { -(-opacity).ln_1p() / unit } else { f64::INFINITY }
}

/// Integrates over an interval of numbers, and looks how far from linear it is.
fn interval(look: &Look, values: [f64; 2], diagonal: f64) -> Interval {
    let mut made = Interval::default();
    let mut plain = [0.0; 3];
    let ends = values.map(|v| look.classify(v));
    look.pieces(values, values, |[s0, s1], [from, to]| {
        made.opaque |= from[3] >= 1.0 && to[3] >= 1.0;
        let at = |x: f64| [0, 1, 2, 3].map(|c| from[c] + (to[c] - from[c]) * x);
        for [x, weight] in GAUSS {
            let here = at(x);
            let (density, part) = (sigma(here[3], look.unit()), weight * (s1 - s0));
            made.sums[0] += part * density;
            for c in 0..3 {
                made.sums[c + 1] += part * density * here[c];
                plain[c] += part * here[c];
            }
        }
        for x in [0.0, 0.5, 1.0] {
            made.rough |= is_rough(at(x), ends, s0 + (s1 - s0) * x, look.unit(), diagonal);
        }
    });
    made.rough |= made.opaque || !made.sums.iter().all(|s| s.is_finite());
    made.color = if made.sums[0] > 0.0 { [1, 2, 3].map(|c| made.sums[c] / made.sums[0]) } else { plain };
    if !made.sums.iter().all(|s| s.is_finite()) {
        (made.sums, made.color) = ([0.0; 4], plain);
    }
    made
}

/// Whether a look is far from what lies on the line between those at both ends.
fn is_rough(here: [f64; 4], ends: [[f64; 4]; 2], s: f64, unit: f64, diagonal: f64) -> bool {
    let mix = |a: f64, b: f64| a * (1.0 - s) + b * s;
    let density = sigma(here[3], unit);
    let error = (density - mix(sigma(ends[0][3], unit), sigma(ends[1][3], unit))).abs();
    let color = (0..3).map(|c| (here[c] - mix(ends[0][c], ends[1][c])).abs()).fold(0.0, f64::max);
    // As a part of itself, or of what can be seen at all along the longest way.
    let fine = error <= ROUGH * density || error * diagonal <= ROUGH;
    !(fine && (color <= ROUGH || color * density * diagonal <= ROUGH))
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{ControlPoint, LookupTable};

    fn table(points: &[[f64; 3]], range: [f64; 2]) -> Table {
        let point = |&[value, grey, opacity]: &[f64; 3]| ControlPoint { value, color: [grey; 3], opacity };
        let points: Vec<_> = points.iter().map(point).collect();
        let resolved = LookupTable::from_points(points).unwrap().resolve(range);
        Table::new(Look::new(&resolved, None, 1.0), range, range[0], 10.0)
    }

    #[test]
    fn sums_are_integrals_of_extinction_and_go_on_beyond_the_ends() {
        let table = table(&[[0.0, 0.0, 0.0], [2.0, 1.0, 0.8]], [-1.0, 5.0]);
        let s = |v: f64| {
            let u = f64::from(table.number(v));
            let i = u.floor().clamp(0.0, (NODES + 1) as f64);
            let e = table.entries[i as usize];
            f64::from(e[0]) + (u - i) * f64::from(e[1])
        };
        let per_node = 2.0 / NODES as f64;
        // ∫ −ln(1 − a) da = a + (1 − a) ln(1 − a).
        let whole = (0.8 + 0.2 * 0.2f64.ln()) / 0.8 * 2.0;
        assert!(((s(2.0) - s(0.0)) * per_node - whole).abs() < 1e-6);
        assert!((s(0.0) - s(-1.0)).abs() < 1e-6);
        assert!(((s(5.0) - s(2.0)) * per_node + 3.0 * 0.2f64.ln()).abs() < 1e-5);
        assert!(table.number(f64::NAN).is_nan() && table.number(f64::INFINITY).is_nan());
        assert!((table.value(table.number(1.3)) - 1.3).abs() < 1e-6);
    }

    #[test]
    fn only_what_is_far_from_linear_is_rough() {
        let rough = |t: &Table| t.entries.iter().filter(|e| e[1].is_nan()).count();
        assert_eq!(rough(&table(&[[0.0, 0.0, 0.0], [1.0, 1.0, 0.8]], [0.0, 1.0])), 0);
        let spike = table(&[[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5001, 1.0, 0.9], [0.5002, 0.0, 0.0]], [0.0, 1.0]);
        assert!((1..8).contains(&rough(&spike)) && spike.opaque.is_empty());
        let opaque = table(&[[0.0, 0.0, 0.1], [0.5, 0.0, 1.0], [0.6, 1.0, 1.0], [0.6, 0.0, 0.0]], [0.0, 1.0]);
        // Intervals reach from 0 to the last point, 0.6; a sixth of them is opaque.
        let width = opaque.opaque[opaque.opaque.len() - 1] as usize;
        let sixth = NODES / 6;
        assert!((sixth..sixth + 3).contains(&width), "{width}");
        // k intervals before opacity 1 the line is off by 1/(8k²) of a logarithm above 6: less than
        // ROUGH of it from k = 15 on.
        assert!((width..width + 18).contains(&rough(&opaque)), "{}", rough(&opaque));
    }
}
