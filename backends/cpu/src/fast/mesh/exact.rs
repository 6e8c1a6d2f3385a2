//! Emission and absorption along a stretch on which numbers are linear, piece by piece in f64.
//!
//! Between control points opacity a and colour c are linear along the ray, and extinction is
//! σ = −ln(1 − a)/unit. The mean of −ln(1 − a) has a closed form, so
//! the optical depth u has. Integration by parts leaves one integral for all colours:
//!
//! ∫ c·e^(−u) du = c₀ − c₁·e^(−τ) + (c₁ − c₀)·∫₀¹ e^(−u(s)) ds.

use volact_core::{ControlPoint, table::ResolvedTable};

use super::super::sweep::piece::mean_log;

/// Optical depth behind which nothing is seen.
const DARK: f64 = 45.0;
/// Optical depth of the parts that are integrated by five points, and how many times what passes
/// may change over them: extinction is a logarithm of it, which grows without bounds towards 0.
const PART: f64 = 0.7;
const RATIO: f64 = 4.0;
/// Optical depth of parts in which nothing of that matters.
const THIN: f64 = 1e-7;
/// The same for two points.
const SMALL: f64 = 0.02;
const SMALL_RATIO: f64 = 1.2;
/// Abscissae on 0 to 1 and weights of Gauss's rules with two and five points.
const TWO: [[f64; 2]; 2] = [[0.211_324_865_405_187_1, 0.5], [0.788_675_134_594_812_9, 0.5]];
const FIVE: [[f64; 2]; 5] = [
    [0.046_910_077_030_668, 0.118_463_442_528_094_54],
    [0.230_765_344_947_158_45, 0.239_314_335_249_683_24],
    [0.5, 0.284_444_444_444_444_44],
    [0.769_234_655_052_841_5, 0.239_314_335_249_683_24],
    [0.953_089_922_969_332, 0.118_463_442_528_094_54],
];

/// What numbers look like.
#[derive(Clone, Debug)]
pub struct Look {
    color: Vec<ControlPoint>,
    /// The table of the opacity, where it is another one or of other numbers.
    opacity: Option<Vec<ControlPoint>>,
    /// World length over which opacity is the part absorbed.
    unit: f64,
}

/// What has been gathered along a ray.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    /// Premultiplied colour.
    pub color: [f64; 3],
    /// What is left to see.
    pub left: f64,
}

impl Default for Light {
    fn default() -> Self {
        Self { color: [0.0; 3], left: 1.0 }
    }
}

/// A part of a stretch within which colour and opacity are linear.
struct Piece {
    /// The part of the stretch, between 0 and 1.
    ends: [f64; 2],
    color: [[f64; 3]; 2],
    opacity: [f64; 2],
    /// Its length over the unit.
    units: f64,
}

impl Look {
    /// Colours and, unless `opacity` is another table, opacities of a table.
    pub fn new(color: &ResolvedTable, opacity: Option<&ResolvedTable>, unit: f64) -> Self {
        Self { color: color.points().to_vec(), opacity: opacity.map(|t| t.points().to_vec()), unit }
    }

    /// Goes on along a stretch of some world length. `values` are the numbers at its ends that
    /// give colour, `others` those that give opacity. Returns at which part of the stretch what
    /// is left falls to `threshold`, where it does.
    pub fn add(
        &self,
        light: &mut Light,
        values: [f64; 2],
        others: [f64; 2],
        length: f64,
        threshold: f64,
    ) -> Option<f64> {
        if values.iter().chain(&others).any(|v| !v.is_finite()) || length.is_nan() || length <= 0.0 {
            return None;
        }
        let mut reached = None;
        self.pieces(values, others, |ends, looks| {
            if light.left == 0.0 {
                return;
            }
            let piece = Piece {
                ends,
                color: looks.map(|[r, g, b, _]| [r, g, b]),
                opacity: looks.map(|c| c[3]),
                units: length * (ends[1] - ends[0]) / self.unit,
            };
            let before = light.left;
            let depth = piece.add(light);
            if before > threshold && light.left <= threshold && reached.is_none() {
                reached = Some(piece.find(depth, (before / threshold).ln()));
            }
        });
        reached
    }

    /// At which part of a stretch an optical depth is reached; the end where it is not.
    pub fn find(&self, values: [f64; 2], others: [f64; 2], length: f64, wanted: f64) -> f64 {
        let (mut passed, mut found) = (0.0, None);
        self.pieces(values, others, |ends, looks| {
            let units = length * (ends[1] - ends[0]) / self.unit;
            let piece = Piece { ends, color: [[0.0; 3]; 2], opacity: looks.map(|c| c[3]), units };
            let depth = if piece.opacity == [1.0; 2] { f64::INFINITY } else { piece.depth(1.0) };
            if found.is_none() && passed + depth >= wanted {
                found = Some(piece.find(depth, wanted - passed));
            }
            passed += depth;
        });
        found.unwrap_or(1.0)
    }

    /// Cuts a stretch where it passes control points; visits the ends of each piece, as parts of
    /// the stretch, and colour and opacity there.
    pub fn pieces(&self, values: [f64; 2], others: [f64; 2], mut visit: impl FnMut([f64; 2], [[f64; 4]; 2])) {
        let mut look = |ends| {
            let mut looks = line(&self.color, values, ends);
            if let Some(points) = &self.opacity {
                let opacity = line(points, others, ends);
                (0..2).for_each(|i| looks[i][3] = opacity[i][3]);
            }
            visit(ends, looks);
        };
        let mut cuts = Vec::new();
        add_cuts(&mut cuts, &self.color, values);
        if let Some(points) = &self.opacity {
            add_cuts(&mut cuts, points, others);
        }
        if cuts.is_empty() {
            return look([0.0, 1.0]);
        }
        cuts.extend([0.0, 1.0]);
        cuts.sort_by(f64::total_cmp);
        cuts.windows(2).map(|w| [w[0], w[1]]).filter(|[a, b]| a < b).for_each(look);
    }

    /// Colour and opacity at a number of both.
    pub fn classify(&self, value: f64) -> [f64; 4] {
        let mut rgba = line(&self.color, [value; 2], [0.0, 1.0])[0];
        if let Some(points) = &self.opacity {
            rgba[3] = line(points, [value; 2], [0.0, 1.0])[0][3];
        }
        rgba
    }

    /// The control points of the colour.
    pub fn points(&self) -> &[ControlPoint] {
        &self.color
    }

    /// Whether opacity has a table or numbers of its own.
    pub fn is_mixed(&self) -> bool {
        self.opacity.is_some()
    }

    /// The world length over which opacity is the part absorbed.
    pub fn unit(&self) -> f64 {
        self.unit
    }
}

/// Adds where numbers between two ends pass control points.
fn add_cuts(cuts: &mut Vec<f64>, points: &[ControlPoint], [v0, v1]: [f64; 2]) {
    let (low, high) = (v0.min(v1), v0.max(v1));
    let first = points.partition_point(|p| p.value <= low);
    let last = points.partition_point(|p| p.value < high);
    let between = points.get(first..last).unwrap_or_default();
    cuts.extend(between.iter().map(|p| ((p.value - v0) / (v1 - v0)).clamp(0.0, 1.0)));
}

/// Colour and opacity at the ends of a part without control points inside.
fn line(points: &[ControlPoint], [v0, v1]: [f64; 2], ends: [f64; 2]) -> [[f64; 4]; 2] {
    let value = |s: f64| v0 * (1.0 - s) + v1 * s;
    let rgba = |p: &ControlPoint| [p.color[0], p.color[1], p.color[2], p.opacity];
    let middle = value(0.5 * (ends[0] + ends[1]));
    let after = points.partition_point(|p| p.value <= middle);
    match (after.checked_sub(1).and_then(|i| points.get(i)), points.get(after)) {
        (Some(a), Some(b)) => ends.map(|s| {
            let t = ((value(s) - a.value) / (b.value - a.value)).clamp(0.0, 1.0);
            let (a, b) = (rgba(a), rgba(b));
            [0, 1, 2, 3].map(|c| a[c] * (1.0 - t) + b[c] * t)
        }),
        (Some(only), None) | (None, Some(only)) => [rgba(only); 2],
        (None, None) => [[0.0; 4]; 2],
    }
}

impl Piece {
    /// Adds what is seen of it; returns its optical depth.
    fn add(&self, light: &mut Light) -> f64 {
        let [c0, c1] = self.color;
        if self.opacity == [1.0; 2] {
            (0..3).for_each(|c| light.color[c] += light.left * c0[c]);
            light.left = 0.0;
            return f64::INFINITY;
        }
        let depth = self.depth(1.0);
        if depth <= 0.0 {
            return 0.0;
        }
        let left = (-depth).exp();
        let mean = if c0 == c1 { 0.0 } else { self.mean_left([0.0, 1.0], [0.0, depth], 0) };
        for c in 0..3 {
            light.color[c] += light.left * (c0[c] - c1[c] * left + (c1[c] - c0[c]) * mean);
        }
        light.left *= left;
        depth
    }

    /// Optical depth of the first part `s` of the piece.
    fn depth(&self, s: f64) -> f64 {
        let [a, b] = self.opacity;
        self.units * s * mean_log([a, a + (b - a) * s])
    }

    /// ∫ e^(−u) ds over a part of the piece, between optical depths `u`.
    fn mean_left(&self, [s0, s1]: [f64; 2], u: [f64; 2], level: u32) -> f64 {
        if u[0] > DARK {
            return 0.0;
        }
        let depth = u[1] - u[0];
        let clear = |s: f64| 1.0 - self.opacity[0] - (self.opacity[1] - self.opacity[0]) * s;
        let (low, high) = (clear(s0).min(clear(s1)), clear(s0).max(clear(s1)));
        if (depth > PART || high > RATIO * low && depth > THIN) && level < 48 {
            let middle = 0.5 * (s0 + s1);
            let at = self.depth(middle);
            let half = |s, u| self.mean_left(s, u, level + 1);
            return half([s0, middle], [u[0], at]) + half([middle, s1], [at, u[1]]);
        }
        let rule: &[[f64; 2]] = if depth < SMALL && high < SMALL_RATIO * low { &TWO } else { &FIVE };
        let term = |&[x, w]: &[f64; 2]| w * (-self.depth(s0 + (s1 - s0) * x)).exp();
        (s1 - s0) * rule.iter().map(term).sum::<f64>()
    }

    /// The part of the whole stretch at which this optical depth of the piece is reached.
    fn find(&self, depth: f64, wanted: f64) -> f64 {
        let [a, b] = self.ends;
        if depth.is_infinite() {
            return a;
        }
        // Newton's steps; where one leaves what is known, halves.
        let (mut low, mut high, mut at) = (0.0, 1.0, wanted / depth);
        for _ in 0..60 {
            let error = self.depth(at) - wanted;
            if error < 0.0 {
                low = at
            } else {
                high = at
            }
            let [a, b] = self.opacity;
            let next = at + error / (self.units * (-(a + (b - a) * at)).ln_1p());
            if (next - at).abs() < 1e-10 || high - low < 1e-12 {
                break;
            }
            at = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        a + (b - a) * at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::LookupTable;

    fn look(points: &[[f64; 3]], unit: f64) -> (Look, ResolvedTable) {
        let point =
            |&[value, grey, opacity]: &[f64; 3]| ControlPoint { value, color: [grey, 1.0 - grey, 0.25], opacity };
        let points: Vec<_> = points.iter().map(point).collect();
        let table = LookupTable::from_points(points).unwrap().resolve([0.0, 1.0]);
        (Look::new(&table, None, unit), table)
    }

    /// By steps so small that they are right: between control points, finer towards them, where
    /// extinction may be infinite.
    fn numeric(table: &ResolvedTable, [v0, v1]: [f64; 2], length: f64, unit: f64) -> Light {
        let mut light = Light::default();
        let mut cuts = vec![0.0, 1.0];
        add_cuts(&mut cuts, table.points(), [v0, v1]);
        cuts.sort_by(f64::total_cmp);
        let steps = 20_000;
        for cut in cuts.windows(2).filter(|cut| cut[0] < cut[1]) {
            let place = |i: i32| {
                let x = f64::from(i) / f64::from(steps);
                cut[0] + (cut[1] - cut[0]) * x * x * (3.0 - 2.0 * x)
            };
            for i in 0..steps {
                let (from, to) = (place(i), place(i + 1));
                let [r, g, b, a] = table.classify(v0 + (v1 - v0) * 0.5 * (from + to));
                let left = (1.0 - a).powf(length * (to - from) / unit);
                for (sum, c) in light.color.iter_mut().zip([r, g, b]) {
                    *sum += light.left * (1.0 - left) * c;
                }
                light.left *= left;
            }
        }
        light
    }

    #[test]
    fn stretches_are_what_many_small_steps_give() {
        let tables: [&[[f64; 3]]; 6] = [
            &[[0.0, 0.0, 0.0], [1.0, 1.0, 0.8]],
            &[[0.0, 0.0, 0.2], [0.3, 1.0, 0.999], [0.5, 0.2, 0.0], [1.0, 1.0, 0.1]],
            &[[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.401, 1.0, 0.9], [0.402, 0.0, 0.0], [1.0, 1.0, 0.3]],
            &[[0.0, 0.0, 0.1], [0.5, 0.0, 0.1], [0.5, 1.0, 0.6], [1.0, 0.5, 0.6]],
            &[[0.0, 0.3, 0.0], [0.5, 0.6, 1.0], [1.0, 0.9, 0.0]],
            &[[0.0, 1.0, 1.0 - 1e-9], [0.5, 0.0, 1.0 - 1e-10], [1.0, 0.9, 0.0]],
        ];
        let mut worst = 0f64;
        for (i, points) in tables.into_iter().enumerate() {
            for ends in [[0.0, 1.0], [0.9, 0.1], [0.35, 0.45], [0.7, 0.7], [-1.0, 2.0]] {
                for length in [0.002, 0.05, 1.0, 7.0] {
                    let (look, table) = look(points, 1.0);
                    let mut light = Light::default();
                    look.add(&mut light, ends, ends, length, 0.0);
                    let wanted = numeric(&table, ends, length, 1.0);
                    let error = light.color.iter().zip(wanted.color).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    let error = error.max((light.left - wanted.left).abs());
                    worst = worst.max(error);
                    assert!(error < 1e-6, "{i} {ends:?} {length} {light:?} {wanted:?}");
                }
            }
        }
        assert!(worst > 0.0, "steps are never exact");
    }

    /// Constant extinction: the depth is ln 2/σ. With opacity 1 − e^(−s) extinction would be linear;
    /// with a linear opacity the closed form is that of its integral, (1 − a)·ln(1 − a) + a.
    #[test]
    fn depths_have_their_closed_forms() {
        let (even, _) = look(&[[0.0, 0.5, 0.3]], 2.0);
        let sigma = -0.7f64.ln() / 2.0;
        let wanted = std::f64::consts::LN_2;
        assert!((even.find([0.0; 2], [0.0; 2], 9.0, wanted) - wanted / sigma / 9.0).abs() < 1e-12);
        let (ramp, _) = look(&[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], 1.0);
        for length in [1.0, 2.0, 30.0] {
            let s = ramp.find([0.0, 1.0], [0.0, 1.0], length, wanted);
            let reached = length * ((1.0 - s) * (-s).ln_1p() + s);
            assert!((reached - wanted).abs() < 1e-9, "{length}: {s}, {reached}");
            let mut light = Light::default();
            assert!((ramp.add(&mut light, [0.0, 1.0], [0.0, 1.0], length, 0.5).unwrap() - s).abs() < 1e-9);
        }
    }

    #[test]
    fn constants_have_their_closed_form() {
        let (look, _) = look(&[[0.0, 0.5, 0.3]], 2.0);
        let mut light = Light::default();
        let at = look.add(&mut light, [4.0, 9.0], [4.0, 9.0], 3.0, 0.7);
        let left = 0.7f64.powf(1.5);
        assert!((light.left - left).abs() < 1e-15 && (light.color[2] - 0.25 * (1.0 - left)).abs() < 1e-15);
        assert!((at.unwrap() - 2.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn rays_end_where_opacity_is_one_over_a_length() {
        let (look, _) = look(&[[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 1.0, 1.0], [1.0, 0.0, 1.0]], 1.0);
        let mut light = Light::default();
        let at = look.add(&mut light, [0.0, 1.0], [0.0, 1.0], 1.0, 0.5);
        assert_eq!((light.left, light.color, at), (0.0, [1.0, 0.0, 0.25], Some(0.5)));
    }
}
