//! Light along a ray: transmittance and colour as enclosures, piece after piece.
//!
//! Transmittance T is kept as an interval, and colour as D = C + c·T with the colour c of where
//! the ray is: by parts dD = T dc, so that an uncertain T does harm only where the colour changes
//! later. C = D − c·T at the end. Where shapes overlap, dC = T Σσᵢcᵢ ds is integrated as it is.
//!
//! A stretch on which the series do not converge is halved. Halving towards a zero of 1 − a (a
//! peak that touches 1) shrinks geometrically; the last bit is bounded by Remez's inequality.

mod meet;

use super::{
    border::log_bound,
    cubic,
    line::EPS,
    piece::{Kind, Piece},
    series::{Sum, Term},
};

/// What a last bit next to a zero of 1 − a may add to the optical depth's uncertainty.
const REST: f64 = 1e-12;

/// The brightness left at which a ray ends; it is added to the enclosure.
const DARK: f64 = 1e-12;

/// A ray's light.
#[derive(Clone, Debug)]
pub(super) struct March {
    /// Lowest and highest transmittance.
    t: [f64; 2],
    /// The likely one, for depth.
    likely: f64,
    /// D and the bound on its error.
    d: [f64; 3],
    error: [f64; 3],
    /// The colour in D.
    color: [f64; 3],
    /// An opaque stretch may have begun where the last piece ended.
    pending: bool,
    end_of_last: f64,
    /// Transmittance below which depth is taken.
    threshold: f64,
    depth: f64,
    brightest: f64,
    /// The lowest number of any colour: below 0 only where the application's is.
    darkest: f64,
    terms: Vec<Term>,
    /// Stretches evaluated.
    pub stretches: u64,
}

/// What came of a ray: premultiplied colour and opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Light {
    pub lower: [f64; 4],
    pub upper: [f64; 4],
    /// Where accumulated opacity reaches the threshold, in the pieces' `t`.
    pub depth: f64,
}

impl Light {
    /// No light at all.
    pub const NONE: Self = Self { lower: [0.0; 4], upper: [0.0; 4], depth: f64::INFINITY };
}

impl March {
    /// A ray whose depth is taken at an accumulated opacity, through colours between these.
    pub fn new(depth_threshold: f64, [darkest, brightest]: [f64; 2]) -> Self {
        Self {
            t: [1.0; 2],
            likely: 1.0,
            d: [0.0; 3],
            error: [0.0; 3],
            color: [0.0; 3],
            pending: false,
            end_of_last: f64::NEG_INFINITY,
            threshold: 1.0 - depth_threshold,
            depth: f64::INFINITY,
            brightest,
            darkest,
            terms: Vec::new(),
            stretches: 0,
        }
    }

    /// Goes on through pieces that share one stretch; `false` when nothing behind can be seen.
    pub fn advance(&mut self, pieces: &[Piece]) -> bool {
        let [start, end] = pieces[0].t;
        let certain = pieces.iter().any(|p| p.kind == Kind::Opaque { certain: true });
        if self.pending && !(certain && start == self.end_of_last) {
            self.t[0] = 0.0;
        }
        self.pending = false;
        self.end_of_last = end;
        if pieces.iter().any(|p| matches!(p.kind, Kind::Opaque { .. })) {
            return self.meet_opaque(pieces, certain);
        }
        // Wherever exactly a piece begins, its colour meets the transmittance before it.
        if let [Piece { kind: Kind::Smooth, color, .. }] = pieces {
            self.jump(color.each_ref().map(|c| cubic::eval(c, -1.0)));
        }
        self.loosen(pieces);
        let absorbs = pieces.iter().any(|p| p.kind == Kind::Smooth);
        let goes_on = !absorbs || self.integrate(pieces);
        self.pending = pieces.iter().any(|p| p.doubt);
        goes_on
    }

    /// The colour of a ray that goes no further.
    pub fn finish(mut self) -> Light {
        if self.pending {
            self.t[0] = 0.0;
        }
        let mut light = Light { depth: self.depth, ..Light::NONE };
        self.jump([0.0; 3]);
        // What lies behind a ray that was ended early.
        let dark = if self.t[1] <= DARK { self.t[1] * self.brightest } else { 0.0 };
        for c in 0..3 {
            let wrong = self.error[c] * (1.0 + 1e-3) + 8.0 * EPS * self.d[c].abs();
            light.lower[c] = (self.d[c] - wrong - if self.darkest < 0.0 { dark } else { 0.0 }).max(self.darkest);
            light.upper[c] = (self.d[c] + wrong + dark).min(self.brightest);
        }
        let absorbed_less = if self.t[1] <= DARK { 0.0 } else { self.t[0] };
        light.lower[3] = (1.0 - self.t[1] - 2.0 * EPS).max(0.0);
        light.upper[3] = if absorbed_less == 1.0 { 0.0 } else { (1.0 - absorbed_less + 2.0 * EPS).min(1.0) };
        light
    }

    fn meet_opaque(&mut self, pieces: &[Piece], certain: bool) -> bool {
        let opaque = pieces.iter().filter(|p| matches!(p.kind, Kind::Opaque { .. }));
        let count = opaque.clone().count() as f64;
        let mut mean = [0.0; 3];
        let (mut wrong, mut spread) = (0f64, 0f64);
        // Whether several begin at the same place is known where it is the face of one block.
        let tie = count > 1.0 && !pieces.iter().all(|p| p.entry.is_some() && p.entry == pieces[0].entry);
        for p in opaque {
            wrong = wrong.max(p.color_error);
            for (mean, c) in mean.iter_mut().zip(&p.color) {
                *mean += cubic::eval(c, -1.0) / count;
                spread = spread.max(2.0 * variation(c));
            }
        }
        if tie {
            let start = |p: &Piece| p.color.each_ref().map(|c| cubic::eval(c, -1.0));
            let far = pieces.iter().map(start).flat_map(|c| (0..3).map(move |i| (c[i] - mean[i]).abs()));
            wrong += far.fold(0.0, f64::max);
        }
        self.jump(mean);
        self.add_error(self.t[1] * (wrong + 4.0 * EPS * self.brightest));
        if self.depth.is_infinite() {
            self.depth = pieces[0].t[0];
        }
        if certain {
            self.t = [0.0; 2];
            return false;
        }
        self.t[0] = 0.0;
        self.add_error(self.t[1] * if count < pieces.len() as f64 { self.brightest } else { spread });
        true
    }

    /// Changes the colour in D from where the ray is.
    fn jump(&mut self, to: [f64; 3]) {
        let (middle, half) = (0.5 * (self.t[0] + self.t[1]), 0.5 * (self.t[1] - self.t[0]));
        for (c, to) in to.iter().enumerate() {
            let step = to - self.color[c];
            if step != 0.0 {
                self.d[c] += step * middle;
                self.error[c] += step.abs() * (half + 4.0 * EPS * middle) + 2.0 * EPS * self.d[c].abs();
            }
        }
        self.color = to;
    }

    fn add_error(&mut self, wrong: f64) {
        self.error.iter_mut().for_each(|e| *e += wrong);
    }

    fn fade(&mut self, depth: f64, error: f64) {
        let factor = (-depth).exp();
        let wrong = (if error < 1.0 { error + error * error } else { f64::INFINITY }) + 8.0 * EPS;
        let lowest = if wrong < 1.0 { factor * (1.0 - wrong) } else { 0.0 };
        // A depth far beyond its error leaves nothing, however large the error.
        let highest = if error < 1.0 { factor * (1.0 + wrong) } else { (error - depth).exp() * (1.0 + 8.0 * EPS) };
        self.t = [self.t[0] * lowest, self.t[1] * highest.min(1.0)];
        self.likely *= factor;
    }

    /// Takes the uncertain ends of pieces into the enclosures.
    fn loosen(&mut self, pieces: &[Piece]) {
        let (mut error, mut color) = (0.0, 0.0);
        for p in pieces {
            let half = 0.5 * (p.t[1] - p.t[0]) / p.unit;
            error += half * p.edge;
            color += half * p.edge_color;
        }
        if error > 0.0 {
            let wrong = if error < 1.0 { error + error * error } else { f64::INFINITY };
            self.t = [self.t[0] * (1.0 - wrong).max(0.0), (self.t[1] * (1.0 + wrong)).min(1.0)];
            if pieces.len() > 1 {
                self.add_error(self.t[1] * error.min(1.0) * 2.0 * self.brightest);
            }
        }
        if color > 0.0 {
            self.add_error(self.t[1] * color.min(self.brightest));
        }
    }

    fn integrate(&mut self, pieces: &[Piece]) -> bool {
        let mut stack = [[0.0; 2]; 128];
        stack[0] = [-1.0, 1.0];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let [a, b] = stack[top];
            if self.stretch(pieces, [a, b]) {
                if self.t[1] * self.brightest.max(1.0) < DARK {
                    return false;
                }
                continue;
            }
            let middle = 0.5 * (a + b);
            stack[top] = [middle, b];
            stack[top + 1] = [a, middle];
            top += 2;
        }
        true
    }

    /// Goes through a part of the pieces; `false` where it has to be halved.
    fn stretch(&mut self, pieces: &[Piece], [a, b]: [f64; 2]) -> bool {
        let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
        let length = 0.5 * (pieces[0].t[1] - pieces[0].t[0]);
        self.stretches += 1;
        self.terms.clear();
        let mut color_error = 0f64;
        for p in pieces.iter().filter(|p| p.kind == Kind::Smooth) {
            let (opacity, rest) = (cubic::eval(&p.opacity, middle), cubic::restrict(&p.rest, middle, half));
            let color = p.color.each_ref().map(|c| cubic::restrict(c, middle, half));
            // A polynomial's roundings go with its coefficients, whatever its value.
            let round = 16.0 * EPS * p.rest.iter().map(|v| v.abs()).sum::<f64>();
            let opacity_error = p.opacity_error + if variation(&p.rest) == 0.0 { 0.0 } else { round };
            color_error = color_error.max(p.color_error);
            let Some(term) = Term::new(opacity, &rest, opacity_error, color, length * half / p.unit) else {
                return self.last_bit(pieces, [a, b]);
            };
            self.terms.push(term);
        }
        let alone = self.terms.len() == 1;
        let size = if alone {
            let c = &self.terms[0].color;
            c.iter().map(variation).fold(0.0, f64::max) * 6.0
        } else {
            self.brightest
        };
        let Some(sum) = Sum::new(&self.terms, size) else { return self.last_bit(pieces, [a, b]) };
        self.find_depth(&sum, pieces[0].t[0] + length * (a + 1.0), length * half);
        if alone {
            self.by_parts(&sum);
        } else {
            self.emit(&sum);
        }
        self.add_error(self.t[1] * color_error * (sum.depth + sum.error).min(1.0));
        let color = self.terms[0].color;
        self.fade(sum.depth, sum.error);
        if alone {
            self.color = color.map(|c| cubic::eval(&c, 1.0));
        }
        true
    }

    fn by_parts(&mut self, sum: &Sum) {
        let color = self.terms[0].color;
        self.jump(color.map(|c| cubic::eval(&c, -1.0)));
        let (middle, half) = (0.5 * (self.t[0] + self.t[1]), 0.5 * (self.t[1] - self.t[0]));
        for (channel, c) in color.iter().enumerate() {
            if variation(c) > 0.0 {
                let [value, wrong] = sum.weigh(&[c[1], 2.0 * c[2], 3.0 * c[3]]);
                self.d[channel] += middle * value;
                self.error[channel] += half * value.abs() + self.t[1] * wrong;
            }
            self.error[channel] += 8.0 * EPS * (self.d[channel].abs() + self.t[1] * c[0].abs());
        }
    }

    fn emit(&mut self, sum: &Sum) {
        let (color, wrong) = sum.emit(&self.terms);
        let (middle, half) = (0.5 * (self.t[0] + self.t[1]), 0.5 * (self.t[1] - self.t[0]));
        let absorbed = -(-sum.depth).exp_m1();
        for (c, gained) in color.into_iter().enumerate() {
            let gain = gained - self.color[c] * absorbed;
            self.d[c] += middle * gain;
            let inner = wrong + self.color[c].abs() * (1.1 * sum.error + 4.0 * EPS);
            self.error[c] += half * gain.abs() + self.t[1] * inner + 8.0 * EPS * self.d[c].abs();
        }
    }

    /// Bounds a stretch that is too short to be halved again, or so dense that the errors of opacity
    /// alone are depths; `false` if it is neither.
    fn last_bit(&mut self, pieces: &[Piece], [a, b]: [f64; 2]) -> bool {
        let width = b - a;
        let (mut depth, mut others, mut least, mut noise) = (0.0, 0.0, 0.0, 0.0);
        let (mut worst, mut chosen) = (-1.0, pieces[0]);
        let (mut hopeless, mut nothing) = (true, true);
        for p in pieces.iter().filter(|p| p.kind == Kind::Smooth) {
            let rest = |y: f64| cubic::eval(&p.rest, y);
            let wrong = p.opacity_error + 16.0 * EPS * p.rest.iter().map(|v| v.abs()).sum::<f64>();
            let most = rest(-1.0).max(rest(0.0)).max(rest(1.0)) - wrong;
            let bound = log_bound(width, most * p.ratio) - width * p.floor.ln();
            let scale = 0.5 * (p.t[1] - p.t[0]) / p.unit;
            let own = scale * bound;
            depth += own;
            others += if own > worst { worst.max(0.0) } else { own };
            if own > worst {
                (worst, chosen) = (own, *p);
            }
            let here = cubic::restrict(&p.rest, 0.5 * (a + b), 0.5 * width);
            let highest = here[0] + variation(&here) + wrong;
            least += scale * width * -highest.clamp(f64::MIN_POSITIVE, 1.0).ln();
            noise += scale * width * wrong;
            hopeless &= rest(a).max(rest(b)).max(here[0]) <= 4.0 * wrong;
            nothing &= here[0] - variation(&here) >= 1.0 - 4.0 * wrong;
        }
        let moved = chosen.color.map(|c| variation(&cubic::restrict(&c, 0.5 * (a + b), 0.5 * width)));
        let moved = moved.into_iter().fold(0.0, f64::max);
        let short = width <= 0.25 && (depth <= REST || width <= 1e-14 || hopeless);
        let gone = self.t[1] * (-least).exp() < DARK && self.t[1] * moved <= REST;
        if !(short || (noise > 1.0 && (gone || nothing))) {
            return false;
        }
        let at = |y: f64| chosen.color.map(|c| cubic::eval(&c, y));
        self.jump(at(a));
        let other = others.min(1.0) * 2.0 * self.brightest;
        let wrong = chosen.color_error * depth.min(1.0);
        self.add_error(self.t[1] * (wrong + other + 8.0 * EPS * self.brightest));
        let length = 0.5 * (chosen.t[1] - chosen.t[0]);
        if self.depth.is_infinite() && self.likely * (-depth).exp() <= self.threshold {
            self.depth = chosen.t[0] + length * (a + 1.0);
        }
        self.t[0] *= (-depth).exp() * (1.0 - 8.0 * EPS);
        self.likely *= (-0.5 * depth).exp();
        // T lies in its interval all along, so by parts ∫ T dc is T's middle times the change of c
        // but for half the interval's width times the variation.
        self.add_error((self.t[1] - self.t[0]) * moved);
        self.jump(at(b));
        self.t[1] = (self.t[1] * (-least).exp() * (1.0 + 8.0 * EPS)).min(1.0);
        true
    }

    /// Depth: where the optical depth reaches that of the threshold, by bisection.
    fn find_depth(&mut self, sum: &Sum, start: f64, half: f64) {
        if self.depth.is_finite() || self.likely * (-sum.depth).exp() > self.threshold {
            return;
        }
        let wanted = (self.likely / self.threshold).ln();
        let (mut lo, mut hi) = (-1.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (lo + hi);
            if sum.depth_to(middle) < wanted { lo = middle } else { hi = middle }
        }
        self.depth = start + half * (hi + 1.0);
    }
}

/// Bound on how far a cubic of y = −1 to 1 gets from its value in the middle.
fn variation(c: &[f64; 4]) -> f64 {
    c[1].abs() + c[2].abs() + c[3].abs()
}
