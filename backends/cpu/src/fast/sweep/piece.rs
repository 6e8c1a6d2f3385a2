//! Stretches of a ray on which opacity and colour are linear, and their integrals in f64.

use volact_core::table::ResolvedTable;

/// Optical depth of a part that is integrated at once.
const PART: f64 = 0.25;
/// Halvings at most.
const HALVINGS: u32 = 40;
/// What is behind less than this left to see is not looked at.
const UNSEEN: f64 = 1e-13;
/// How many times as much transparency a smooth part may have at one end as at the other.
const SMOOTH: f64 = 1.1;

/// A part of a ray through one shape: opacity and straight colour linear in `t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Where it is.
    pub t: [f64; 2],
    /// Opacity over one `unit` at both ends.
    pub opacity: [f64; 2],
    /// Colour at both ends.
    pub color: [[f64; 3]; 2],
    /// The length over which opacity is the fraction absorbed.
    pub unit: f64,
}

/// What a ray has seen so far.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Premultiplied RGBA.
    pub color: [f64; 4],
    /// `t` at which the threshold is reached.
    pub depth: f64,
    /// The opacity at which depth is taken.
    pub threshold: f64,
}

/// Something without thickness that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Where.
    pub t: f64,
    /// Premultiplied RGBA.
    pub color: [f64; 4],
}

impl Piece {
    /// A part on which nothing changes.
    pub fn even(t: [f64; 2], opacity: f64, color: [f64; 3], unit: f64) -> Self {
        Self { t, opacity: [opacity; 2], color: [color; 2], unit }
    }

    fn is_even(&self) -> bool {
        self.opacity[0] == self.opacity[1] && self.color[0] == self.color[1]
    }

    /// The part between two places inside.
    pub fn within(&self, t: [f64; 2]) -> Self {
        if self.is_even() {
            return Self { t, ..*self };
        }
        let length = self.t[1] - self.t[0];
        let place = t.map(|t| ((t - self.t[0]) / length).clamp(0.0, 1.0));
        let mix = |[a, b]: [f64; 2], at: f64| a + at * (b - a);
        let opacity = place.map(|at| mix(self.opacity, at));
        let color = place.map(|at| [0, 1, 2].map(|c| mix([self.color[0][c], self.color[1][c]], at)));
        Self { t, opacity, color, unit: self.unit }
    }

    /// Extinction at one end.
    fn sigma(&self, end: usize) -> f64 {
        let a = self.opacity[end];
        if a >= 1.0 { f64::INFINITY } else { -(-a).ln_1p() / self.unit }
    }

    /// Optical depth.
    fn depth(&self) -> f64 {
        (self.t[1] - self.t[0]) / self.unit * mean_log(self.opacity)
    }

    /// Whether it is opaque over its length.
    fn is_solid(&self) -> bool {
        self.opacity[0] >= 1.0 && self.opacity[1] >= 1.0
    }
}

/// The mean of −ln(1 − a) where a runs linearly between two opacities; infinite where both are 1.
pub fn mean_log([a, b]: [f64; 2]) -> f64 {
    if a >= 1.0 && b >= 1.0 {
        return f64::INFINITY;
    }
    let (x, half) = (1.0 - 0.5 * (a + b), 0.5 * (b - a));
    let q = (half / x).powi(2);
    if q < 0.05 {
        // The mean of ln(1 + r·y) over −1 ≤ y ≤ 1 is −Σ r²ᵏ/(2k(2k + 1)).
        let series = q * (1.0 / 6.0 + q * (1.0 / 20.0 + q * (1.0 / 42.0 + q * (1.0 / 72.0 + q / 110.0))));
        return series - (-0.5 * (a + b)).ln_1p();
    }
    // The antiderivative of −ln x is x − x·ln x.
    let anti = |x: f64| if x > 0.0 { x - x * x.ln() } else { 0.0 };
    (anti(1.0 - b) - anti(1.0 - a)) / (a - b)
}

impl Sight {
    /// Opacity left to see.
    pub fn left(&self) -> f64 {
        1.0 - self.color[3]
    }

    /// Adds premultiplied colour behind; `place` tells where in an interval of optical depth the
    /// threshold was reached.
    fn add(&mut self, color: [f64; 4], place: impl Fn(f64) -> f64) {
        let before = self.color[3];
        for (have, add) in self.color.iter_mut().zip(color) {
            *have += (1.0 - before) * add;
        }
        if before < self.threshold && self.color[3] >= self.threshold {
            self.depth = place(-((1.0 - self.threshold) / (1.0 - before)).ln());
        }
    }

    /// Adds hits of one place.
    pub fn meet(&mut self, hits: &[Hit]) {
        let Some(first) = hits.first() else { return };
        let mut color = first.color;
        if hits.len() > 1 {
            let left: f64 = hits.iter().map(|h| 1.0 - h.color[3]).product();
            let mut sum = [0.0; 4];
            for hit in hits {
                (0..4).for_each(|c| sum[c] += hit.color[c]);
            }
            // Colours that absorb nothing are light alone.
            let scale = if sum[3] > 0.0 { (1.0 - left) / sum[3] } else { 1.0 };
            color = [sum[0] * scale, sum[1] * scale, sum[2] * scale, 1.0 - left];
        }
        self.add(color, |_| first.t);
    }

    /// Adds all pieces, which cover the same stretch, at once.
    pub fn pass(&mut self, pieces: &[Piece]) {
        let Some(first) = pieces.first() else { return };
        let [start, end] = first.t;
        if pieces.iter().any(Piece::is_solid) {
            let solid = || pieces.iter().filter(|p| p.is_solid());
            let count = solid().count() as f64;
            let color = [0, 1, 2].map(|c| solid().map(|p| p.color[0][c]).sum::<f64>() / count);
            self.add([color[0], color[1], color[2], 1.0], |_| start);
        } else if pieces.iter().all(Piece::is_even) {
            self.even(pieces);
        } else {
            self.uneven(pieces, [start, end], HALVINGS);
        }
    }

    fn even(&mut self, pieces: &[Piece]) {
        let [start, end] = pieces[0].t;
        let sigma: f64 = pieces.iter().map(|p| p.sigma(0)).sum();
        if sigma <= 0.0 {
            return;
        }
        let depth = sigma * (end - start);
        let alpha = -(-depth).exp_m1();
        let mean = |c: usize| pieces.iter().map(|p| p.sigma(0) * p.color[0][c]).sum::<f64>() / sigma;
        let color = [0, 1, 2].map(|c| alpha * mean(c));
        let place = |needed: f64| start + (end - start) * (needed / depth).clamp(0.0, 1.0);
        self.add([color[0], color[1], color[2], alpha], place);
    }

    fn uneven(&mut self, pieces: &[Piece], [start, end]: [f64; 2], halvings: u32) {
        let parts = |t: [f64; 2]| pieces.iter().map(move |p| p.within(t));
        let depth: f64 = parts([start, end]).map(|p| p.depth()).sum();
        if depth <= 0.0 || self.left() < UNSEEN {
            return;
        }
        // Near an opacity of 1 extinction has a logarithm's pole: only parts over which
        // transparency hardly changes are smooth.
        let steep = |p: Piece| {
            let [a, b] = p.opacity.map(|a| 1.0 - a);
            a.max(b) > SMOOTH * a.min(b) && a.min(b) < 0.03
        };
        let smooth = depth <= PART && (pieces.len() == 1 || depth < 1e-5 || !parts([start, end]).any(steep));
        let middle = 0.5 * (start + end);
        if !smooth && halvings > 0 && start < middle && middle < end {
            self.uneven(pieces, [start, middle], halvings - 1);
            self.uneven(pieces, [middle, end], halvings - 1);
            return;
        }
        let alpha = -(-depth).exp_m1();
        let color = match pieces {
            [one] => alone(&one.within([start, end]), depth),
            _ => mixed(pieces, [start, end]),
        };
        self.add([color[0], color[1], color[2], alpha], |needed| find(pieces, [start, end], depth, needed));
    }
}

/// Where on a stretch an optical depth is reached, of `whole` over all of it: by Newton's steps,
/// and where one leaves what is known, by halves.
fn find(pieces: &[Piece], [start, end]: [f64; 2], whole: f64, needed: f64) -> f64 {
    let length = end - start;
    let (mut low, mut high, mut at) = (0.0, 1.0, (needed / whole).clamp(0.0, 1.0));
    for _ in 0..60 {
        let t = start + length * at;
        let over = pieces.iter().map(|p| p.within([start, t]).depth()).sum::<f64>() - needed;
        if over < 0.0 {
            low = at
        } else {
            high = at
        }
        let slope = length * pieces.iter().map(|p| p.within([t, t]).sigma(0)).sum::<f64>();
        let next = at - over / slope;
        // Where extinction is infinite, a step of nothing tells nothing.
        if (next - at).abs() < 1e-12 && slope.is_finite() || high - low < 1e-12 {
            break;
        }
        at = if next > low && next < high { next } else { 0.5 * (low + high) };
    }
    start + length * at
}

/// Nodes and weights of Gauss and Legendre over 0 to 1.
const GAUSS: [[f64; 2]; 4] = [
    [0.069_431_844_202_973_71, 0.173_927_422_568_726_93],
    [0.330_009_478_207_571_9, 0.326_072_577_431_273_07],
    [0.669_990_521_792_428_1, 0.326_072_577_431_273_07],
    [0.930_568_155_797_026_3, 0.173_927_422_568_726_93],
];

/// Premultiplied colour of one piece: by parts, ∫T·σ·c ds = c₀ − c₁·T₁ + c'·∫T ds.
fn alone(piece: &Piece, depth: f64) -> [f64; 3] {
    let [start, end] = piece.t;
    let past = (-depth).exp();
    // 1 − T is summed, so that thin pieces keep their digits.
    let absorbed = |part: f64| -(-piece.within([start, start + part * (end - start)]).depth()).exp_m1();
    let mean: f64 = GAUSS.iter().map(|[x, w]| w * absorbed(*x)).sum();
    let alpha = 1.0 - past;
    [0, 1, 2].map(|c| {
        let [a, b] = [piece.color[0][c], piece.color[1][c]];
        // c₀ − c₁(1 − α) + (c₁ − c₀)(1 − mean)
        (b * alpha - (b - a) * mean).max(0.0)
    })
}

/// Premultiplied colour of several pieces on one stretch.
fn mixed(pieces: &[Piece], [start, end]: [f64; 2]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for [x, w] in GAUSS {
        let t = start + x * (end - start);
        let before: f64 = pieces.iter().map(|p| p.within([start, t]).depth()).sum();
        let weight = w * (end - start) * (-before).exp();
        for piece in pieces {
            let here = piece.within([t, t]);
            // Rounding may make an opacity 1 that is only nearly so.
            let sigma = here.sigma(0).min(64.0 / piece.unit);
            (0..3).for_each(|c| sum[c] += weight * sigma * here.color[0][c]);
        }
    }
    sum
}

/// A number that runs linearly along a stretch, and the table that classifies it.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// The number at both ends.
    pub value: [f64; 2],
    /// What classifies it.
    pub table: &'a ResolvedTable,
}

impl Run<'_> {
    /// Where on the stretch, from 0 to 1, the number passes a control point.
    fn knots(&self, cuts: &mut Vec<f64>) {
        let [a, b] = self.value;
        let (lo, hi) = (a.min(b), a.max(b));
        let points = self.table.points();
        let first = points.partition_point(|p| p.value <= lo);
        let inside = points[first..].iter().take_while(|p| p.value < hi);
        cuts.extend(inside.map(|p| (p.value - a) / (b - a)));
    }

    /// Colour and opacity at both ends of a part between control points.
    fn ends(&self, [from, to]: [f64; 2]) -> [[f64; 4]; 2] {
        let [a, b] = self.value;
        let at = |part: f64| a + part * (b - a);
        let points = self.table.points();
        let after = points.partition_point(|p| p.value <= at(0.5 * (from + to)));
        let rgba = |i: usize| {
            let p = &points[i];
            [p.color[0], p.color[1], p.color[2], p.opacity]
        };
        if after == 0 || after == points.len() {
            return [rgba(after.min(points.len() - 1)); 2];
        }
        let (low, high) = (rgba(after - 1), rgba(after));
        let (from_value, to_value) = (points[after - 1].value, points[after].value);
        [from, to].map(|part| {
            let s = ((at(part) - from_value) / (to_value - from_value)).clamp(0.0, 1.0);
            // Exact at both ends, and where both are the same.
            let mix = |a: f64, b: f64| if s < 0.5 { a + s * (b - a) } else { b - (1.0 - s) * (b - a) };
            [0, 1, 2, 3].map(|c| mix(low[c], high[c]))
        })
    }
}

/// Cuts a stretch at control points into pieces; colour comes from one number and opacity from
/// the same or another.
pub fn cut(
    t: [f64; 2],
    color: Run<'_>,
    opacity: Option<Run<'_>>,
    unit: f64,
    cuts: &mut Vec<f64>,
    out: &mut Vec<Piece>,
) {
    cuts.clear();
    color.knots(cuts);
    if let Some(opacity) = &opacity {
        opacity.knots(cuts);
    }
    cuts.push(1.0);
    cuts.sort_by(f64::total_cmp);
    let at = |part: f64| if part >= 1.0 { t[1] } else { t[0] + part * (t[1] - t[0]) };
    let mut from = 0.0;
    for &to in cuts.iter() {
        let stretch = [at(from), at(to)];
        if stretch[0] >= stretch[1] {
            continue;
        }
        let [a, b] = color.ends([from, to]);
        let seen = opacity.map_or([a[3], b[3]], |run| run.ends([from, to]).map(|rgba| rgba[3]));
        if seen != [0.0; 2] {
            let rgb = [a, b].map(|c| [c[0], c[1], c[2]]);
            out.push(Piece { t: stretch, opacity: seen, color: rgb, unit });
        }
        from = to;
    }
}
