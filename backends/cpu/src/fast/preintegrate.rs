//! Pre-integration: what a whole segment adds when the value runs linearly from one number at its
//! front to another at its back (Engel, Kraus, Ertl 2001), attenuation inside the segment included.
//!
//! With the antiderivatives over the value Σ = ∫σ, K = ∫σc and M = ∫σcΣ, a segment of length h
//! between values u and v has
//! optical depth T = h (Σ(v) − Σ(u))/(v − u), colour without attenuation
//! K̄ = h (K(v) − K(u))/(v − u), and first moment
//! m = ∫ σc τ ds = (h/(v − u))² (M(v) − M(u) − Σ(u)(K(v) − K(u))).
//! Its colour is K̄ (1 − e⁻ᵀ)/T − (m − K̄T/2) g(T), exact where colour is linear in optical depth,
//! with g(T) = 12 (T/2 (1 − e⁻ᵀ) − 1 + e⁻ᵀ(1 + T)) / T³. Segments of some depth are cut first.

use super::classify::{SegmentTable, Units, aligned};
use volact_core::table::ResolvedTable;

/// Optical depth of one piece.
const PIECE: f64 = 0.25;
/// Most pieces of a segment.
const MOST_PIECES: usize = 24;
/// Optical depth over one unit distance at which opacity counts as 1.
const OPAQUE: f64 = 36.0;

/// What a whole segment adds, by the values at its front and back.
#[derive(Clone, Debug)]
pub struct SegmentPairs {
    /// `nodes + 1` rows (front) of `nodes + 1` entries (back); the last row and column repeat;
    /// then two transparent rows.
    pub entries: Vec<[f32; 4]>,
    /// Nodes along each axis.
    pub nodes: usize,
    /// Node coordinate = number × scale + offset.
    pub scale: f32,
    /// See `scale`.
    pub offset: f32,
}

/// Antiderivatives at a node: Σ, and K and M for each colour.
#[derive(Clone, Copy, Debug, Default)]
struct Node {
    sigma: f64,
    k: [f64; 3],
    m: [f64; 3],
}

impl SegmentPairs {
    /// The most nodes that `bytes` can hold.
    pub fn most_nodes(bytes: usize) -> usize {
        ((bytes / 16) as f64).sqrt() as usize - 2
    }

    /// Tabulates `table` for segments of `h` unit distances with at most `most` nodes. The grid
    /// spans the domain of `fine` and all numbers that occur: a segment that begins or ends beyond
    /// the table's own values is inside them for a part of its length only.
    pub fn new(
        table: &ResolvedTable,
        units: Units,
        (fine, occurring): (&SegmentTable, Option<[f64; 2]>),
        h: f64,
        most: usize,
        threads: usize,
    ) -> Self {
        let [a, b] = occurring.unwrap_or(fine.domain);
        let [lo, hi] = [fine.domain[0].min(a), fine.domain[1].max(b)];
        let marks: Vec<f64> = table.points().iter().map(|p| units.number(p.value)).collect();
        // The finest grid with its nodes on the control points, where one has so few.
        let base = if lo < hi { aligned(&marks, [lo, hi]).filter(|&n| n < most) } else { Some(1) };
        let intervals = base.map_or(most - 1, |n| n * ((most - 1) / n)).max(1);
        let nodes = intervals + 1;
        let width = (hi - lo) / intervals as f64;
        let cumulative = antiderivatives(table, units, [lo, width], nodes);
        let diagonal: Vec<[f64; 4]> = (0..nodes).map(|i| density(table, units.data(lo + i as f64 * width))).collect();
        let stride = nodes + 1;
        let mut entries = vec![[0f32; 4]; stride * (nodes + 3)];
        let rows = nodes.div_ceil(threads.max(1));
        std::thread::scope(|scope| {
            for (t, part) in entries[..stride * nodes].chunks_mut(stride * rows).enumerate() {
                let (cumulative, diagonal) = (&cumulative, &diagonal);
                scope.spawn(move || {
                    for (r, row) in part.chunks_mut(stride).enumerate() {
                        let i = t * rows + r;
                        for (j, entry) in row.iter_mut().enumerate() {
                            *entry = pair(cumulative, diagonal, i, j.min(nodes - 1), h).map(|v| v as f32);
                        }
                    }
                });
            }
        });
        let (last, spare) = ((nodes - 1) * stride, nodes * stride);
        entries.copy_within(last..spare, spare);
        let scale = if hi > lo { 1.0 / width } else { 0.0 };
        Self { entries, nodes, scale: scale as f32, offset: (-lo * scale) as f32 }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.entries.len() * 16
    }

    /// Entries of a row.
    pub fn stride(&self) -> usize {
        self.nodes + 1
    }

    /// What a whole segment adds.
    pub fn lookup(&self, front: f32, back: f32) -> [f32; 4] {
        if front.is_nan() || back.is_nan() {
            return [0.0; 4];
        }
        let node = |v: f32| {
            let u = (v * self.scale + self.offset).max(0.0).min((self.nodes - 1) as f32);
            (u as usize, u - (u as usize) as f32)
        };
        let ((i, f), (j, g)) = (node(front), node(back));
        let at = i * self.stride() + j;
        let row = |at: usize| -> [f32; 4] {
            std::array::from_fn(|c| self.entries[at][c] + g * (self.entries[at + 1][c] - self.entries[at][c]))
        };
        let (a, b) = (row(at), row(at + self.stride()));
        std::array::from_fn(|c| a[c] + f * (b[c] - a[c]))
    }
}

/// Extinction per unit distance and straight colour at a value.
fn density(table: &ResolvedTable, value: f64) -> [f64; 4] {
    let [r, g, b, a] = table.classify(value);
    let sigma = if a >= 1.0 { OPAQUE } else { (-(-a).ln_1p()).min(OPAQUE) };
    [r, g, b, sigma]
}

/// Σ, K and M at every node, in units of one node distance: four Gauss points an interval, cut at
/// the control points that fall inside.
fn antiderivatives(table: &ResolvedTable, units: Units, [lo, width]: [f64; 2], nodes: usize) -> Vec<Node> {
    const X: [f64; 4] =
        [0.069_431_844_202_973_71, 0.330_009_478_207_571_9, 0.669_990_521_792_428_1, 0.930_568_155_797_026_3];
    const W: [f64; 4] =
        [0.173_927_422_568_726_93, 0.326_072_577_431_273_07, 0.326_072_577_431_273_07, 0.173_927_422_568_726_93];
    let mut marks: Vec<f64> =
        table.points().iter().map(|p| (units.number(p.value) - lo) / width).filter(|m| m.is_finite()).collect();
    marks.sort_by(f64::total_cmp);
    let mut sum = Node::default();
    let mut out = vec![sum];
    for i in 0..nodes.saturating_sub(1) {
        let (start, end) = (i as f64, (i + 1) as f64);
        let first = marks.partition_point(|&m| m <= start);
        let cuts = marks[first..].iter().copied().take_while(|&m| m < end).chain([end]);
        let mut from = start;
        for to in cuts {
            let length = to - from;
            for q in 0..4 {
                let [r, g, b, sigma] = density(table, units.data(lo + (from + length * X[q]) * width));
                let weight = W[q] * length;
                // Σ at the Gauss point: what lies before it plus half of its own weight.
                let middle = sum.sigma + 0.5 * weight * sigma;
                for (c, color) in [r, g, b].into_iter().enumerate() {
                    sum.k[c] += weight * sigma * color;
                    sum.m[c] += weight * sigma * color * middle;
                }
                sum.sigma += weight * sigma;
            }
            from = to;
        }
        out.push(sum);
    }
    out
}

fn pair(nodes: &[Node], diagonal: &[[f64; 4]], i: usize, j: usize, h: f64) -> [f64; 4] {
    if i == j {
        let [r, g, b, sigma] = diagonal[i];
        let alpha = -(-sigma * h).exp_m1();
        return [r * alpha, g * alpha, b * alpha, alpha];
    }
    let per_node = h / i.abs_diff(j) as f64;
    let depth = per_node * (nodes[j].sigma - nodes[i].sigma).abs();
    let pieces = ((depth / PIECE) as usize + 1).min(MOST_PIECES).min(i.abs_diff(j));
    let mut out = [0f64; 4];
    let mut from = i;
    for p in 1..=pieces {
        let to = if j > i { i + (j - i) * p / pieces } else { i - (i - j) * p / pieces };
        let add = piece(&nodes[from], &nodes[to], per_node, j < i);
        let left = 1.0 - out[3];
        out = std::array::from_fn(|c| out[c] + left * add[c]);
        from = to;
    }
    out
}

/// One piece, by the formula at the top.
fn piece(a: &Node, b: &Node, per_node: f64, falling: bool) -> [f64; 4] {
    let depth = per_node * (b.sigma - a.sigma).abs();
    if depth <= 0.0 {
        return [0.0; 4];
    }
    let alpha = -(-depth).exp_m1();
    let (share, g) = (alpha / depth, moment_weight(depth));
    let color = |c: usize| {
        let k = per_node * (b.k[c] - a.k[c]).abs();
        let inner = if falling {
            a.sigma * (a.k[c] - b.k[c]) - (a.m[c] - b.m[c])
        } else {
            b.m[c] - a.m[c] - a.sigma * (b.k[c] - a.k[c])
        };
        let moment = per_node * per_node * inner;
        (k * share - (moment - 0.5 * k * depth) * g).max(0.0)
    };
    [color(0), color(1), color(2), alpha]
}

/// g(T), by its series near 0: 1 − T/2 + 3T²/20 − T³/30 + …
fn moment_weight(t: f64) -> f64 {
    if t < 0.02 {
        return 1.0 - t / 2.0 + 3.0 * t * t / 20.0 - t * t * t / 30.0;
    }
    let e = (-t).exp();
    12.0 * (0.5 * t * (1.0 - e) - 1.0 + e * (1.0 + t)) / (t * t * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{ControlPoint, LookupTable};

    fn spiky() -> ResolvedTable {
        let p = |value, r, opacity| ControlPoint { value, color: [r, 0.3, 1.0 - r], opacity };
        let points = [p(0.0, 0.0, 0.0), p(40.0, 0.1, 0.0), p(44.0, 1.0, 0.6), p(48.0, 0.2, 0.0), p(100.0, 0.9, 0.3)];
        LookupTable::from_points(points).unwrap().resolve([0.0, 1.0])
    }

    /// The integral by very many small midpoint steps.
    fn truth(table: &ResolvedTable, from: f64, to: f64, h: f64) -> [f64; 4] {
        let n = 200_000;
        let mut out = [0f64; 4];
        for i in 0..n {
            let v = from + (to - from) * (i as f64 + 0.5) / n as f64;
            let [r, g, b, a] = table.classify(v);
            let alpha = -(h / n as f64 * (-a).ln_1p()).exp_m1();
            let left = 1.0 - out[3];
            for (o, add) in out.iter_mut().zip([r * alpha, g * alpha, b * alpha, alpha]) {
                *o += left * add;
            }
        }
        out
    }

    #[test]
    fn pairs_match_the_integral() {
        let table = spiky();
        let units = Units { scale: 1.0, offset: 0.0 };
        for h in [0.5, 2.0, 8.0] {
            let fine = SegmentTable::new(&table, units, None, h);
            let pairs = SegmentPairs::new(&table, units, (&fine, None), h, 401, 2);
            for (from, to) in [(0.0, 100.0), (100.0, 0.0), (30.0, 60.0), (47.0, 41.0), (44.0, 44.0), (80.0, 20.0)] {
                let (got, want) = (pairs.lookup(from as f32, to as f32), truth(&table, from, to, h));
                for c in 0..4 {
                    let error = (f64::from(got[c]) - want[c]).abs();
                    assert!(error < 2e-4 * h.max(1.0), "h {h}, {from} to {to}: {got:?} {want:?}");
                }
            }
        }
    }

    #[test]
    fn segment_through_a_narrow_table_counts_the_part_inside() {
        let p = |value, opacity| ControlPoint { value, color: [1.0; 3], opacity };
        let table = LookupTable::from_points([p(50.0, 0.0), p(55.0, 0.5), p(60.0, 0.0)]).unwrap().resolve([0.0, 1.0]);
        let units = Units { scale: 1.0, offset: 0.0 };
        let fine = SegmentTable::new(&table, units, Some([0.0, 200.0]), 1.0);
        let pairs = SegmentPairs::new(&table, units, (&fine, Some([0.0, 200.0])), 1.0, 401, 1);
        let (got, want) = (pairs.lookup(0.0, 200.0), truth(&table, 0.0, 200.0, 1.0));
        assert!((f64::from(got[3]) - want[3]).abs() < 1e-4, "{got:?} {want:?}");
    }

    #[test]
    fn moment_weight_series_meets_the_formula() {
        let t = 0.02;
        let e = f64::exp(-t);
        let formula = 12.0 * (0.5 * t * (1.0 - e) - 1.0 + e * (1.0 + t)) / (t * t * t);
        assert!((moment_weight(0.02 - 1e-9) - formula).abs() < 1e-6);
    }
}
