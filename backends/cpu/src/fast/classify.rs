//! Tables made for one sample distance: classification of whole segments.
//!
//! A [`SegmentTable`] holds, at equidistant values, what a whole segment of the lattice adds:
//! opacity α = 1 − (1 − a)^(h/unit) and premultiplied colour. Its nodes fall on the control points
//! wherever a grid of at most 2¹⁶ intervals can; it is refined until linear interpolation between
//! nodes is within 1e-6 of the exact exponential, and [`SegmentTable::error`] says what was reached.

use volact_core::{mutated, table::ResolvedTable};

/// Interpolation error that a table is refined to.
const WANTED_ERROR: f64 = 1e-6;
/// Unit distances in a segment from which a table may be saturated, and what is then left of light.
const SATURATED: (f64, f64) = (4.0, 1e-5);
/// What a segment must be off by for a lost spike to count: half an 8-bit step.
const SEEN: f64 = 0.5 / 255.0;
/// Most intervals that are tried.
const MOST: usize = 1 << 16;
/// Most intervals for accuracy where nodes miss control points anyway.
const ENOUGH: usize = 1 << 13;

/// From the numbers that kernels fetch to data units, and back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// data = number × scale + offset.
    pub scale: f64,
    /// See `scale`.
    pub offset: f64,
}

impl Units {
    /// To data units.
    pub fn data(&self, number: f64) -> f64 {
        number * self.scale + self.offset
    }

    /// Whether what is fetched is in data units.
    pub fn are_stored(&self) -> bool {
        self.scale == 1.0 && self.offset == 0.0
    }

    /// Numbers to data units, in place.
    #[inline(always)]
    pub fn apply(&self, numbers: &mut [f32]) {
        numbers.iter_mut().for_each(|v| *v = self.data(f64::from(*v)) as f32);
    }

    /// From data units.
    pub fn number(&self, data: f64) -> f64 {
        (data - self.offset) / self.scale
    }
}

/// What a whole segment adds, by value.
#[derive(Clone, Debug)]
pub struct SegmentTable {
    /// Premultiplied red, green, blue and opacity; after the last node its copy, then two
    /// transparent entries.
    pub entries: Vec<[f32; 4]>,
    /// Number of nodes.
    pub nodes: usize,
    /// Node coordinate = number × scale + offset.
    pub scale: f32,
    /// See `scale`.
    pub offset: f32,
    /// Node coordinates below this are exactly transparent.
    pub dark: f32,
    /// Largest interpolation error found, in premultiplied colour or opacity.
    pub error: f64,
    /// First and last number on the grid.
    pub domain: [f64; 2],
    /// Whether segments of several unit distances hide here how dense they are: next to opaque, they
    /// cannot be cut to a part.
    pub saturated: bool,
    /// Whether nodes pass over a control point both of whose neighbours are nearer than they are: a
    /// spike that is not there.
    pub lost: bool,
    /// How many nodes up to each have any opacity at or just after them.
    seen: Vec<u32>,
}

impl SegmentTable {
    /// Tabulates `table` for segments of `h` unit distances, over those numbers that occur.
    pub fn new(table: &ResolvedTable, units: Units, occurring: Option<[f64; 2]>, h: f64) -> Self {
        let domain = domain(table, units, occurring);
        let segment = |number: f64| segment(table.classify(units.data(number)), h);
        let marks: Vec<f64> = table.points().iter().map(|p| units.number(p.value)).collect();
        let base = aligned(&marks, domain);
        let mut intervals = base.unwrap_or(1024);
        while intervals < 256 && domain[0] < domain[1] {
            intervals *= 2;
        }
        let (mut nodes, mut error) = tabulate(&segment, domain, intervals);
        let most = if base.is_some() { MOST } else { ENOUGH };
        while error > WANTED_ERROR && intervals * 2 <= most {
            intervals *= 2;
            (nodes, error) = tabulate(&segment, domain, intervals);
        }
        let number = |i: usize| domain[0] + (domain[1] - domain[0]) * i as f64 / (nodes.len().max(2) - 1) as f64;
        let hides = |i: usize| table.classify(units.data(number(i)))[3] < 1.0 && 1.0 - nodes[i][3] < SATURATED.1;
        let saturated = h >= SATURATED.0 && (0..nodes.len()).any(hides);
        let made = Self::from_nodes(nodes, error, domain, |lo, hi| {
            let (a, b) = (units.data(lo), units.data(hi));
            table.max_opacity(a.min(b), a.max(b)) > 0.0
        });
        let lost = made.loses(&marks, segment);
        Self { saturated, lost, ..made }
    }

    fn loses(&self, marks: &[f64], segment: impl Fn(f64) -> [f64; 4]) -> bool {
        let [lo, hi] = self.domain;
        let apart = (hi - lo) / (self.nodes.max(2) - 1) as f64;
        let differs = |at: f64| {
            let (exact, held) = (segment(at), self.lookup(at as f32));
            (0..4).any(|c| (exact[c] - f64::from(held[c])).abs() > SEEN)
        };
        let narrow = |m: &[f64]| (m[2] - m[0]).abs() < apart && m[0] != m[1] && m[1] != m[2];
        marks.windows(3).any(|m| (lo..=hi).contains(&m[1]) && narrow(m) && differs(m[1]))
    }

    fn from_nodes(nodes: Vec<[f64; 4]>, error: f64, domain: [f64; 2], opaque: impl Fn(f64, f64) -> bool) -> Self {
        let count = nodes.len();
        let width = domain[1] - domain[0];
        let scale = if count > 1 { (count - 1) as f64 / width } else { 0.0 };
        let number = |i: usize| domain[0] + i as f64 / scale.max(f64::MIN_POSITIVE);
        let mut seen = vec![0u32];
        for i in 0..count {
            let here = if count == 1 { nodes[0][3] > 0.0 } else { opaque(number(i), number((i + 1).min(count - 1))) };
            seen.push(seen[i] + u32::from(here));
        }
        let mut entries: Vec<_> = nodes.iter().map(|e| e.map(|v| v as f32)).collect();
        entries.extend([entries[count - 1], [0.0; 4], [0.0; 4]]);
        let offset = (-domain[0] * scale) as f32;
        let first = entries.iter().take(count).position(|e| e[3] > 0.0).unwrap_or(count + 1);
        // Coordinates are compared before they are clamped: what the first node makes visible is so
        // below it, too.
        let dark = if first == 0 { f32::NEG_INFINITY } else { first as f32 - 1.0 };
        Self {
            entries,
            nodes: count,
            scale: scale as f32,
            offset,
            dark,
            error,
            domain,
            saturated: false,
            lost: false,
            seen,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.entries.len() * 16 + self.seen.len() * 4
    }

    /// Index of the transparent entry.
    pub fn transparent(&self) -> usize {
        self.nodes + 1
    }

    /// Node coordinate of a number, as the kernels compute it.
    pub fn coordinate(&self, number: f32) -> f32 {
        (number * self.scale + self.offset).max(0.0).min((self.nodes - 1) as f32)
    }

    /// Whether the end can be seen that all numbers of an interval are clamped to; `None` where
    /// some are not, or rounding might let them in.
    pub fn beyond(&self, lo: f32, hi: f32) -> Option<bool> {
        let place = |v: f32| v * self.scale + self.offset;
        let margin = 0.01 + 1e-5 * self.offset.abs();
        let (first, last) = (self.entries[0][3], self.entries[self.nodes - 1][3]);
        if place(hi) < -margin {
            Some(first > 0.0)
        } else if place(lo) > (self.nodes - 1) as f32 + margin {
            Some(last > 0.0)
        } else {
            None
        }
    }

    /// Whether any number of an interval can be seen, through the interpolated table.
    pub fn sees(&self, lo: f32, hi: f32) -> bool {
        if let Some(end) = self.beyond(lo, hi) {
            return end;
        }
        let node = |v: f32| self.coordinate(v) as usize;
        let (first, last) = (node(lo), node(hi));
        // An interval of nodes counts its own left end to its right neighbour; one more either
        // way keeps rounding of coordinates inside.
        let (first, last) = (first.saturating_sub(1), (last + 1).min(self.nodes - 1));
        self.seen[last + 1] > self.seen[first]
    }

    /// What a whole segment adds at a number.
    pub fn lookup(&self, number: f32) -> [f32; 4] {
        if number.is_nan() {
            return [0.0; 4];
        }
        let u = self.coordinate(number);
        let i = u as usize;
        let f = u - i as f32;
        std::array::from_fn(|c| self.entries[i][c] + f * (self.entries[i + 1][c] - self.entries[i][c]))
    }
}

/// Premultiplied colour and opacity of a segment of `h` unit distances.
pub fn segment([r, g, b, a]: [f64; 4], h: f64) -> [f64; 4] {
    let h = if mutated!("opacity_exponent") { 1.0 } else { h };
    let alpha = if a >= 1.0 { 1.0 } else { -(h * (-a).ln_1p()).exp_m1() };
    let alpha = if mutated!("linear_opacity") { (-(-a).ln_1p() * h).min(1.0) } else { alpha };
    if mutated!("straight_colour") {
        return [r, g, b, alpha];
    }
    [r * alpha, g * alpha, b * alpha, alpha]
}

/// The numbers over which the table varies and that occur; a single one where it does not vary.
fn domain(table: &ResolvedTable, units: Units, occurring: Option<[f64; 2]>) -> [f64; 2] {
    let points = table.points();
    let ends = [points[0].value, points[points.len() - 1].value].map(|v| units.number(v));
    let (mut lo, mut hi) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    if let Some([a, b]) = occurring {
        // Keep the control points that enclose what occurs, so that nodes can fall on them.
        let marks = || points.iter().map(|p| units.number(p.value));
        let below = marks().filter(|&m| m <= a).fold(f64::NEG_INFINITY, f64::max);
        let above = marks().filter(|&m| m >= b).fold(f64::INFINITY, f64::min);
        let whole = |v: f64| v == v.round();
        let clip = |end: f64, mark: f64| if whole(end) && marks().all(whole) || !mark.is_finite() { end } else { mark };
        lo = lo.max(clip(a, below).min(hi));
        hi = hi.min(clip(b, above).max(lo));
    }
    beyond_steps(table, units, occurring, [lo, hi])
}

/// Widens a domain that ends at a step, so that both sides of the step have nodes.
fn beyond_steps(table: &ResolvedTable, units: Units, occurring: Option<[f64; 2]>, [lo, hi]: [f64; 2]) -> [f64; 2] {
    let points = table.points();
    let step = |at: f64| points.windows(2).any(|p| p[0].value == p[1].value && units.number(p[0].value) == at);
    let span = occurring.map_or(0.0, |[a, b]| b - a).max(hi - lo);
    // A whole number keeps nodes on whole numbers.
    let width = if span >= 64.0 { (span / 2048.0).ceil() } else { span.max(f64::MIN_POSITIVE) / 64.0 };
    let width = if span > 0.0 { width } else { lo.abs().max(1.0) };
    [if step(lo) { lo - width } else { lo }, if step(hi) { hi + width } else { hi }]
}

/// The fewest intervals over `domain` whose nodes meet all marks.
pub fn aligned(marks: &[f64], [lo, hi]: [f64; 2]) -> Option<usize> {
    if lo >= hi {
        return Some(1);
    }
    let inner: Vec<f64> = marks.iter().filter(|&&m| lo < m && m < hi).map(|m| (m - lo) / (hi - lo)).collect();
    let meets = |n: usize| {
        let n = n as f64;
        inner.iter().all(|m| (m * n - (m * n).round()).abs() < 1e-6)
    };
    let many = inner.len() + 1;
    let candidates = [many].into_iter().chain(1..=ENOUGH).chain([(hi - lo) as usize]);
    candidates.filter(|n| (1..=MOST).contains(n)).find(|&n| meets(n))
}

fn tabulate(segment: &impl Fn(f64) -> [f64; 4], [lo, hi]: [f64; 2], intervals: usize) -> (Vec<[f64; 4]>, f64) {
    if lo >= hi {
        return (vec![segment(lo)], 0.0);
    }
    let at = |i: f64| {
        let t = i / intervals as f64;
        lo * (1.0 - t) + hi * t
    };
    let nodes: Vec<[f64; 4]> = (0..=intervals).map(|i| segment(at(i as f64))).collect();
    let mut error = 0f64;
    for (i, pair) in nodes.windows(2).enumerate() {
        let exact = segment(at(i as f64 + 0.5));
        for c in 0..4 {
            error = error.max((exact[c] - 0.5 * (pair[0][c] + pair[1][c])).abs());
        }
    }
    (nodes, error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{ControlPoint, LookupTable};

    fn table(points: &[(f64, f64)]) -> ResolvedTable {
        let point = |&(value, opacity): &(f64, f64)| ControlPoint { value, color: [1.0, 0.5, 0.0], opacity };
        LookupTable::from_points(points.iter().map(point).collect::<Vec<_>>()).unwrap().resolve([0.0, 1.0])
    }

    const PLAIN: Units = Units { scale: 1.0, offset: 0.0 };

    #[test]
    fn nodes_fall_on_control_points() {
        let t = table(&[(0.0, 0.0), (70.0, 0.0), (128.0, 0.03), (150.0, 0.002), (255.0, 0.1)]);
        let s = SegmentTable::new(&t, PLAIN, Some([0.0, 255.0]), 1.0);
        assert_eq!((s.nodes - 1) % 255, 0);
        for p in t.points() {
            let got = s.lookup(p.value as f32)[3];
            assert!((f64::from(got) - p.opacity).abs() < 1e-7, "{p:?} {got}");
        }
        assert!(s.error < 1e-6);
    }

    #[test]
    fn zero_stays_exactly_zero_and_is_not_seen() {
        let t = table(&[(0.0, 0.0), (70.0, 0.0), (128.0, 0.5), (255.0, 0.0)]);
        let s = SegmentTable::new(&t, PLAIN, Some([0.0, 255.0]), 0.3);
        assert!(!s.sees(0.0, 68.0));
        assert!(s.sees(0.0, 71.0));
        assert!(s.sees(200.0, 254.9));
        assert_eq!(s.lookup(68.9), [0.0; 4]);
        assert_eq!(s.lookup(f32::NAN), [0.0; 4]);
    }

    #[test]
    fn opacity_scales_with_the_segment() {
        let t = table(&[(0.0, 0.0), (100.0, 1.0)]);
        let s = SegmentTable::new(&t, PLAIN, None, 2.0);
        assert!((s.lookup(50.0)[3] - 0.75).abs() < 2e-6);
        assert_eq!(s.lookup(100.0)[3], 1.0);
    }

    #[test]
    fn spikes_between_nodes_are_known() {
        let lost = |points: &[(f64, f64)]| SegmentTable::new(&table(points), PLAIN, None, 1.0).lost;
        let spike =
            |width: f64, a: f64| [(0.0, 0.0), (0.537, 0.0), (0.537 + width, a), (0.537 + 2.0 * width, 0.0), (1.0, 0.0)];
        assert!(lost(&spike(1e-6, 0.9)) && lost(&spike(1e-5, 0.1)));
        assert!(!lost(&spike(0.01, 0.9)) && !lost(&spike(1e-6, 1e-3)));
        // Steps are between nodes, too, and are there.
        assert!(!lost(&[(0.0, 0.0), (0.537, 0.0), (0.537, 0.6), (1.0, 0.6)]));
    }

    #[test]
    fn segments_that_hide_how_dense_they_are_are_known() {
        let saturated =
            |opacity: f64, h: f64| SegmentTable::new(&table(&[(0.0, 0.0), (100.0, opacity)]), PLAIN, None, h).saturated;
        assert!(saturated(0.7, 40.0) && saturated(1.0, 5.0) && saturated(0.95, 4.0));
        assert!(!saturated(0.7, 4.0) && !saturated(1.0, 2.0) && !saturated(0.01, 40.0));
        // A step to opaque is opaque over any length.
        let step = table(&[(0.0, 0.0), (50.0, 0.1), (50.0, 1.0), (100.0, 1.0)]);
        assert!(!SegmentTable::new(&step, PLAIN, None, 40.0).saturated);
    }

    #[test]
    fn slope_below_zero_is_right() {
        let t = table(&[(-10.0, 0.0), (10.0, 0.8)]);
        let units = Units { scale: -1.0, offset: 0.0 };
        let s = SegmentTable::new(&t, units, None, 1.0);
        assert!((s.lookup(5.0)[3] - 0.2).abs() < 1e-6);
    }
}
