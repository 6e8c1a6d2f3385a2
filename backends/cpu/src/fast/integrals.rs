//! Integrals of a table over its values: what a stretch adds along which the value runs linearly.
//!
//! Between two control points opacity a is linear in the value, and with F(a) = (1 − a) ln(1 − a) + a the
//! mean of σ = −ln(1 − a) over any part is (F(a₁) − F(a₀))/(a₁ − a₀), finite up to a = 1. Sums up to each
//! point make any stretch two look-ups, however narrow what it crosses. Colour is linear in a, and
//! ∫ −a ln(1 − a) da = (1 − a²) ln(1 − a)/2 + a/2 + a²/4.

use volact_core::{ControlPoint, table::ResolvedTable};

/// Extinction over one unit distance where opacity is 1.
const OPAQUE: f64 = 1e5;

/// A value, with the integrals from the first control point up to it.
#[derive(Clone, Copy, Debug)]
pub struct End {
    value: f64,
    sum: [f64; 4],
}

/// Integrals of σ·colour and of σ, from the first control point to each.
#[derive(Debug)]
pub struct Integrals<'a> {
    points: &'a [ControlPoint],
    sums: Vec<[f64; 4]>,
}

impl<'a> Integrals<'a> {
    /// Those of a table.
    pub fn of(table: &'a ResolvedTable) -> Self {
        let points = table.points();
        let mut sum = [0.0; 4];
        let mut sums = vec![sum];
        for pair in points.windows(2) {
            let whole = piece(&pair[0], &pair[1], 1.0);
            sum = std::array::from_fn(|c| sum[c] + whole[c]);
            sums.push(sum);
        }
        Self { points, sums }
    }

    /// A value as the end of stretches.
    pub fn end(&self, value: f64) -> End {
        End { value, sum: self.up_to(value) }
    }

    /// The means of σ·colour and of σ over values that run linearly from one to another.
    pub fn mean(&self, from: &End, to: &End) -> [f64; 4] {
        let change = to.value - from.value;
        if change.abs() <= 1e-12 * (from.value.abs() + to.value.abs()) {
            return self.at(from.value);
        }
        std::array::from_fn(|c| ((to.sum[c] - from.sum[c]) / change).max(0.0))
    }

    /// From the first control point to a value; outside, the table is what it is at its end.
    fn up_to(&self, value: f64) -> [f64; 4] {
        let after = self.points.partition_point(|p| p.value <= value);
        if after > 0 && after < self.points.len() {
            let (a, b) = (&self.points[after - 1], &self.points[after]);
            let part = piece(a, b, (value - a.value) / (b.value - a.value));
            return std::array::from_fn(|c| self.sums[after - 1][c] + part[c]);
        }
        let end = after.saturating_sub(1);
        let (point, beyond) = (&self.points[end], value - self.points[end].value);
        let outside = density([point.color; 2], [point.opacity; 2]);
        std::array::from_fn(|c| self.sums[end][c] + beyond * outside[c])
    }

    /// σ·colour and σ at a value.
    fn at(&self, value: f64) -> [f64; 4] {
        let after = self.points.partition_point(|p| p.value <= value);
        let (a, b) = (&self.points[after.saturating_sub(1)], &self.points[after.min(self.points.len() - 1)]);
        let t = if after > 0 && b.value > a.value { (value - a.value) / (b.value - a.value) } else { 0.0 };
        density([mixed(a, b, t); 2], [mix(a.opacity, b.opacity, t); 2])
    }
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a * (1.0 - t) + b * t
}

fn mixed(a: &ControlPoint, b: &ControlPoint, t: f64) -> [f64; 3] {
    std::array::from_fn(|c| mix(a.color[c], b.color[c], t))
}

/// Means of σ·colour and of σ where opacity and colour run linearly from one end to the other.
fn density([from, to]: [[f64; 3]; 2], [a, b]: [f64; 2]) -> [f64; 4] {
    let change = b - a;
    if change.abs() <= 1e-4 * (1.0 - a.max(b)) {
        // Extinction is as good as linear, too.
        let [p, q] = [a, b].map(|a| (-(-a).ln_1p()).min(OPAQUE));
        let mean = |c: f64, d: f64| (p * (2.0 * c + d) + q * (c + 2.0 * d)) / 6.0;
        return [mean(from[0], to[0]), mean(from[1], to[1]), mean(from[2], to[2]), 0.5 * (p + q)];
    }
    // The integrals of σ and of a·σ over a.
    let first = |a: f64| if a < 1.0 { (1.0 - a) * (-a).ln_1p() + a } else { 1.0 };
    let second = |a: f64| if a < 1.0 { 0.5 * (1.0 - a * a) * (-a).ln_1p() + 0.5 * a + 0.25 * a * a } else { 0.75 };
    let sigma = (first(b) - first(a)) / change;
    // How far along σ lies on average: 0.5 where it is constant.
    let along = ((second(b) - second(a)) / change - a * sigma) / change;
    let mean = |c: usize| from[c] * sigma + (to[c] - from[c]) * along;
    [mean(0), mean(1), mean(2), sigma]
}

/// The integral over a part of a piece, from its lower end.
fn piece(a: &ControlPoint, b: &ControlPoint, part: f64) -> [f64; 4] {
    let width = (b.value - a.value) * part;
    density([a.color, mixed(a, b, part)], [a.opacity, mix(a.opacity, b.opacity, part)]).map(|v| width * v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::LookupTable;

    fn table(points: &[(f64, f64)]) -> ResolvedTable {
        let point = |&(value, opacity): &(f64, f64)| ControlPoint { value, color: [1.0, 0.5, 0.0], opacity };
        LookupTable::from_points(points.iter().map(point).collect::<Vec<_>>()).unwrap().resolve([0.0, 1.0])
    }

    fn mean(integrals: &Integrals<'_>, ends: [f64; 2]) -> [f64; 4] {
        let [from, to] = ends.map(|v| integrals.end(v));
        integrals.mean(&from, &to)
    }

    #[test]
    fn a_spike_counts_by_its_area_however_narrow_or_high() {
        for (width, a) in [(0.1, 0.2f64), (1e-3, 0.9), (1e-9, 0.2), (1e-5, 1e-7)] {
            let table = table(&[(0.5, 0.0), (0.5 + width, a), (0.5 + 2.0 * width, 0.0)]);
            let [red, green, blue, sigma] = mean(&Integrals::of(&table), [0.0, 1.0]);
            // The midpoint rule of -ln(1 - at) over 0..1, for each flank.
            let mean = (0..10_000).map(|i| -(-a * (f64::from(i) + 0.5) / 1e4).ln_1p()).sum::<f64>() / 1e4;
            assert!((sigma / (2.0 * width * mean) - 1.0).abs() < 1e-6, "{width} {a}: {sigma}");
            assert!((red / sigma - 1.0).abs() < 1e-9 && (green / sigma - 0.5).abs() < 1e-9 && blue == 0.0);
        }
        let full = table(&[(0.0, 0.0), (1.0, 1.0)]);
        assert!((mean(&Integrals::of(&full), [0.0, 1.0])[3] - 1.0).abs() < 1e-12, "the mean of -ln(1 - t) is 1");
    }

    #[test]
    fn steps_ends_and_single_values_are_what_the_table_says() {
        let table = table(&[(0.0, 0.0), (0.5, 0.0), (0.5, 0.6), (1.0, 0.6)]);
        let integrals = Integrals::of(&table);
        let full = -(0.4f64.ln());
        for (ends, wanted) in
            [([0.0, 0.4], 0.0), ([0.4, 0.6], 0.5 * full), ([2.0, 3.0], full), ([-3.0, 0.0], 0.0), ([0.7, 0.7], full)]
        {
            for ends in [ends, [ends[1], ends[0]]] {
                let found = mean(&integrals, ends)[3];
                assert!((found - wanted).abs() < 1e-9, "{ends:?}: {found}, wanted {wanted}");
            }
        }
    }

    #[test]
    fn colour_is_weighed_by_extinction_over_any_stretch() {
        let point = |value, a: f64, red| ControlPoint { value, color: [red, 0.5, 0.0], opacity: a };
        let points = vec![point(0.0, 0.1, 0.0), point(1.0, 0.9, 1.0), point(2.0, 1e-3, 0.2), point(3.0, 1e-3, 0.8)];
        let table = LookupTable::from_points(points).unwrap().resolve([0.0, 3.0]);
        let integrals = Integrals::of(&table);
        for ends in [[0.3, 0.31], [0.0, 1.0], [0.8, 1.7], [1.9999, 2.5], [0.55, 0.550_01], [2.1, 2.9]] {
            // The midpoint rule.
            let at = |i: i32| table.classify(ends[0] + (ends[1] - ends[0]) * (f64::from(i) + 0.5) / 2e4);
            let wanted = (0..20_000).map(|i| -at(i)[0] * (-at(i)[3]).ln_1p()).sum::<f64>() / 2e4;
            let found = mean(&integrals, ends)[0];
            assert!((found / wanted - 1.0).abs() < 1e-5, "{ends:?}: {found}, wanted {wanted}");
        }
    }
}
