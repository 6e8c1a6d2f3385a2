//! A span of a ray with the media at Gauss's four points, and what it does to light.
//!
//! With y = −1 to 1 on the span, σ and c are the cubics through the points. Optical depths are the
//! antiderivative of σ, and by parts
//!
//! ∫ T σ c = c(−1) − T(1)·c(1) + ∫ T c' dy,
//!
//! with the last integral by Gauss's rule on the same points. Cubics through these points miss a
//! smooth function by what is orthogonal to all cubics (P. J. Davis, P. Rabinowitz, *Methods of
//! Numerical Integration*, 1984, 2.7), so that integrals over the span are off by the ninth power
//! of its length and not the fifth.
//!
//! The rule has no points at the ends, where a step may hide. So there is one just inside of each
//! end, which counts for nothing: by what the cubics miss it is the span's `miss`. Of a smooth
//! function a half misses a sixteenth of what the whole does, of a step as much.

use super::program::Medium;
use crate::reference::{
    cubic::{self, Cubic},
    line::EPS,
    piece::{Kind, Piece},
};

/// The points, and the weights of the rule.
pub(super) const POINTS: [f64; 4] =
    [-0.861_136_311_594_052_6, -0.339_981_043_584_856_3, 0.339_981_043_584_856_3, 0.861_136_311_594_052_6];
pub(super) const WEIGHTS: [f64; 4] =
    [0.347_854_845_137_453_85, 0.652_145_154_862_546_1, 0.652_145_154_862_546_1, 0.347_854_845_137_453_85];

/// The optical depth of a piece over its unit: small, so that opacity is next to linear in σ, and
/// large against rounding.
const DEPTH: f64 = 0.02;

/// The points of a span with those at its ends.
pub(super) const ALL: usize = 6;

/// A span.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub t: [f64; 2],
    /// How often it was halved.
    pub level: u8,
    /// The media at its points, without those at its ends.
    media: [Medium; 4],
    /// At how many points, with those at its ends, nothing is let through.
    opaque: usize,
    /// How far the cubics miss the points at the ends, times half of the length.
    pub miss: f64,
    /// Its optical depth.
    pub depth: f64,
    /// What it emits: ∫ T σ c.
    pub light: [f64; 3],
    /// Bounds on relative errors of its transmittance and on its light, by estimate.
    pub error: [f64; 2],
    pub done: bool,
}

/// Where the points of a span lie: one inside of its beginning, four of the rule, one inside of its
/// end.
pub(super) fn places([start, end]: [f64; 2]) -> [f64; ALL] {
    let (middle, half) = (0.5 * (start + end), 0.5 * (end - start));
    let [a, b, c, d] = POINTS.map(|y| middle + half * y);
    let (least, most) = (4.0 * EPS * start.abs().max(end.abs()), 0.0625 * half);
    let inside = (2e-12 * half).max(least).min(most);
    [start + inside, a, b, c, d, end - inside]
}

/// What a cubic misses of the numbers at the ends of a span.
pub(super) fn miss(cubic: &Cubic, [start, end]: [f64; 2]) -> f64 {
    (cubic::eval(cubic, -1.0) - start).abs().max((cubic::eval(cubic, 1.0) - end).abs())
}

/// The cubic through numbers at the points.
pub(super) fn through([a, b, c, d]: [f64; 4]) -> Cubic {
    if a == b && a == c && a == d {
        return [a, 0.0, 0.0, 0.0];
    }
    let (far, near) = (POINTS[3], POINTS[2]);
    let apart = far * far - near * near;
    let (even_far, even_near) = (0.5 * (a + d), 0.5 * (b + c));
    let (odd_far, odd_near) = (0.5 * (d - a) / far, 0.5 * (c - b) / near);
    let (square, cube) = ((even_far - even_near) / apart, (odd_far - odd_near) / apart);
    [even_near - square * near * near, odd_near - cube * near * near, square, cube]
}

impl Span {
    /// A span of media at its points.
    pub fn new(t: [f64; 2], level: u8, all: [Medium; ALL]) -> Self {
        let [first, a, b, c, d, last] = all;
        let media = [a, b, c, d];
        let opaque = all.iter().filter(|m| m[3].is_infinite()).count();
        let (depth, light, error) = (0.0, [0.0; 3], [0.0; 2]);
        let mut made = Self { t, level, media, opaque, miss: 0.0, depth, light, error, done: false };
        let (half, color) = (0.5 * (t[1] - t[0]), made.color());
        let start = color.map(|c| cubic::eval(&c, -1.0));
        match opaque {
            ALL => (made.depth, made.light) = (f64::INFINITY, start),
            0 => {
                let sigma = through(media.map(|m| m[3]));
                let glow =
                    |c: usize| miss(&through(media.map(|m| m[c] * m[3])), [first[c] * first[3], last[c] * last[3]]);
                made.miss = half * miss(&sigma, [first[3], last[3]]).max(glow(0)).max(glow(1)).max(glow(2));
                let depth_to = |y: f64| {
                    let up = |y: f64| y * (sigma[0] + y * (sigma[1] / 2.0 + y * (sigma[2] / 3.0 + y * sigma[3] / 4.0)));
                    half * (up(y) - up(-1.0))
                };
                made.depth = half * (0..4).map(|k| WEIGHTS[k] * media[k][3]).sum::<f64>();
                let left = POINTS.map(|y| (-depth_to(y)).exp());
                made.light = [0, 1, 2].map(|c| {
                    let change: f64 = (0..4).map(|k| WEIGHTS[k] * left[k] * cubic::slope(&color[c], POINTS[k])).sum();
                    start[c] - (-made.depth).exp() * cubic::eval(&color[c], 1.0) + change
                });
            }
            // Nothing can be said; it is halved.
            _ => {
                made.depth = 0.25 * half * media.iter().map(|m| if m[3].is_finite() { m[3] } else { 0.0 }).sum::<f64>()
            }
        }
        made
    }

    /// Whether it is opaque in parts.
    pub fn is_mixed(&self) -> bool {
        !matches!(self.opaque, 0 | ALL)
    }

    /// The colours as cubics.
    fn color(&self) -> [Cubic; 3] {
        [0, 1, 2].map(|c| through(self.media.map(|m| m[c])))
    }

    /// As a piece to march through. One that is opaque in parts is so throughout: it is as short
    /// as can be.
    pub fn piece(&self) -> Piece {
        let first = self.media.iter().find(|m| m[3].is_infinite());
        let most = self.media.iter().map(|m| m[3]).fold(0.0, f64::max);
        if let Some([r, g, b, _]) = first {
            let flat = Piece::constant(self.t, [*r, *g, *b, 1.0], 1.0);
            return if self.opaque == ALL { Piece { color: self.color(), ..flat } } else { flat };
        }
        if most == 0.0 {
            return Piece::constant(self.t, [0.0; 4], 1.0);
        }
        let length = self.t[1] - self.t[0];
        let even = self.media.iter().all(|m| m[3] == most);
        let unit = if even { std::f64::consts::LN_2 } else { DEPTH } / most;
        let mut made = Piece::constant(self.t, [0.0, 0.0, 0.0, 0.5], unit);
        made.color = self.color();
        if !even {
            made.opacity = through(self.media.map(|m| -(-m[3] * unit).exp_m1()));
            made.rest = made.opacity.map(|v| -v);
            made.rest[0] += 1.0;
        }
        made.kind = Kind::Smooth;
        // Both are counted over half of the length in units.
        made.edge = self.error[0] * 2.0 * unit / length;
        made.edge_color = self.error[1] * 2.0 * unit / length;
        made.color_error = 8.0 * EPS * self.brightest();
        made
    }

    /// The largest number of any colour on it.
    fn brightest(&self) -> f64 {
        self.color().iter().map(|c| c.iter().map(|v| v.abs()).sum()).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cubics_go_through_their_points() {
        let cubic = [0.3, -1.2, 0.7, 2.0];
        let made = through(POINTS.map(|y| cubic::eval(&cubic, y)));
        (0..4).for_each(|k| assert!((made[k] - cubic[k]).abs() < 1e-14, "{made:?}"));
        assert!((WEIGHTS.iter().sum::<f64>() - 2.0).abs() < 1e-15);
    }

    /// σ = t, c = 1 − t/2 on 0 to 1: ∫ e^{−t²/2} t (1 − t/2) dt, by parts with the error function's
    /// ∫₀¹ e^{−t²/2} = 0.855624391892149.
    #[test]
    fn light_of_a_span_is_the_integral() {
        let media = places([0.0, 1.0]).map(|t| [1.0 - 0.5 * t, 1.0, 0.0, t]);
        let span = Span::new([0.0, 1.0], 0, media);
        assert!(span.miss < 1e-11, "{}", span.miss);
        let left = (-0.5f64).exp();
        let truth = 1.0 - 0.5 * left - 0.5 * 0.855_624_391_892_149;
        assert!((span.depth - 0.5).abs() < 1e-15);
        assert!((span.light[0] - truth).abs() < 1e-8, "{} {truth}", span.light[0]);
        assert!((span.light[1] - (1.0 - left)).abs() < 1e-15);
    }
}
