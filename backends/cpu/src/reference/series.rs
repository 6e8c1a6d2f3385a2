//! The integral over one smooth piece, by power series with bounds on what is left out.
//!
//! On a stretch y = −1 to 1 of half length κ (in unit distances) opacity is a cubic, so with
//! Q = 1 − a = Q₀(1 + r(y)), r = r₁y + r₂y² + r₃y³:
//!
//! - ln(1 + r) = Σ Lₙyⁿ,   n·Lₙ = n·rₙ − Σ_k k·L_k·r_{n−k}   (from L'(1 + r) = r')
//! - optical depth F(y) = ∫₀ʸ S, S = κ(−ln Q₀ − Σ Lₙyⁿ)
//! - G = e^{−F},   n·Gₙ = −Σ_k S_{k−1}·G_{n−k}   (from G' = −S·G)
//!
//! and the transmittance from y = −1 is e^{F(−1)}·G(y). The colour integral ∫ T σ c is
//! c(−1) − T c(1) + ∫ T c' by parts (N. Max, *Optical models for direct volume rendering*, 1995,
//! gives the integral), so that a logarithmic pole of σ does no harm.
//!
//! # What is left out
//! With g = max(2.5|r₁|, (5|r₂|)^½, (10|r₃|)^⅓) the majorant |r₁|R + |r₂|R² + |r₃|R³ is at most
//! 0.4 + 0.2 + 0.1 = 0.7 at R = 1/g, hence |Lₙ| ≤ −ln 0.3·gⁿ < 1.21·gⁿ (Cauchy's estimate on the
//! majorant). With g' = max(g, κ·ℓ₀/1.5, (0.8·κ·g)^½) the majorant of F at 1/g' is at most
//! 1.5 + 0.76 (the majorant of ln is convex), hence |Gₙ| ≤ 10·g'ⁿ. Tails are geometric series.
//! Rounding: every coefficient comes from fewer than 8(n + 4) roundings of terms that its
//! majorant bounds; the bounds used here count twice that.

use super::{cubic::Cubic, line::EPS};

/// The most coefficients beyond the constant one.
pub(super) const ORDER: usize = 18;

/// What a tail may add to an optical depth or a colour.
const TAIL: f64 = 1e-14;

/// One medium on a stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Term {
    /// Half the stretch's length over the unit distance.
    pub kappa: f64,
    /// −ln Q₀.
    pub log: f64,
    /// r₁, r₂, r₃.
    pub ratio: [f64; 3],
    /// Reciprocal of the radius up to which the majorant is bounded.
    pub growth: f64,
    /// Bound on the error of the optical depth from the error of opacity.
    pub error: f64,
    /// The colours as polynomials of y.
    pub color: [Cubic; 3],
}

impl Term {
    /// From the opacity in the middle and 1 − opacity as a polynomial.
    /// `None` where the series would converge too slowly, or the error of opacity is not small
    /// against Q: then the stretch has to be halved.
    pub fn new(opacity: f64, rest: &Cubic, opacity_error: f64, color: [Cubic; 3], kappa: f64) -> Option<Self> {
        let [rest, linear, square, cube] = *rest;
        let ratio = [linear / rest, square / rest, cube / rest];
        let [a, b, c] = ratio.map(f64::abs);
        let mut growth = 2.5 * a;
        if 5.0 * b > growth * growth {
            growth = (5.0 * b).sqrt();
        }
        if 10.0 * c > growth * growth * growth {
            growth = (10.0 * c).cbrt();
        }
        let growth = growth * (1.0 + 4.0 * EPS);
        let least = rest * (1.0 - (a + b + c));
        let usable = rest > 0.0 && growth < 0.6 && opacity_error < 0.4 * least;
        // |ln(1 − e/Q)| ≤ 1.28·e/Q for e/Q < 0.4; roundings of Q in proportion to what differs from 1.
        let round = 16.0 * EPS * (opacity.abs().min(1.0) + a + b + c) / (1.0 - (a + b + c)).max(0.01);
        let error = 2.0 * kappa * (1.3 * opacity_error / least + round);
        let log = if opacity < 0.5 { -(-opacity).ln_1p() } else { -rest.ln() };
        usable.then_some(Self { kappa, log, ratio, growth, error, color })
    }
}

/// What a stretch does to light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sum {
    /// Number of coefficients beyond the constant.
    order: usize,
    /// Optical depth from end to end.
    pub depth: f64,
    /// Bound on its error anywhere on the stretch.
    pub error: f64,
    /// Transmittance from the front to the middle.
    front: f64,
    s: [f64; ORDER + 1],
    g: [f64; ORDER + 1],
    /// Bound on the error of G on the stretch.
    g_error: f64,
}

impl Sum {
    /// Adds up the optical depths of all terms. With `color_size` above 0 transmittance within
    /// the stretch is wanted, too, to be multiplied by numbers of that size. `None` where more
    /// coefficients were needed than there are.
    pub fn new(terms: &[Term], color_size: f64) -> Option<Self> {
        let mut growth = 0f64;
        let (mut flat, mut bent, mut error) = (0.0, 0.0, 0.0);
        for term in terms {
            growth = growth.max(term.growth);
            flat += term.kappa * term.log;
            bent += term.kappa * term.growth;
            error += term.error;
        }
        let inner = if color_size > 0.0 { growth.max(flat / 1.5).max((0.8 * bent).sqrt()) } else { growth };
        if inner >= 0.6 {
            return None;
        }
        let kappa: f64 = terms.iter().map(|t| t.kappa).sum();
        let (mut order, mut power, mut power_g) = (0, growth, inner);
        let (depth_tail, g_tail) = loop {
            let depth_tail = 2.0 * 1.21 * kappa * power / (1.0 - growth);
            let g_tail = if color_size > 0.0 { 10.0 * power_g / (1.0 - inner) } else { 0.0 };
            if depth_tail <= TAIL && g_tail * color_size <= TAIL {
                break (depth_tail, g_tail);
            }
            if order == ORDER {
                return None;
            }
            order += 1;
            power *= growth;
            power_g *= inner;
        };
        let round = 16.0 * (order + 4) as f64 * EPS;
        let mut sum = Self {
            order,
            depth: 0.0,
            error: error + depth_tail + 2.0 * round * (flat + 1.21 * bent),
            front: 1.0,
            s: [0.0; ORDER + 1],
            g: [0.0; ORDER + 1],
            g_error: g_tail + 10.0 * round,
        };
        terms.iter().for_each(|t| sum.add_logarithm(t));
        sum.add_up(color_size > 0.0);
        Some(sum)
    }

    fn add_logarithm(&mut self, term: &Term) {
        let l = logarithm(&term.ratio, self.order);
        self.s[0] += term.kappa * term.log;
        for (s, l) in self.s.iter_mut().zip(l).skip(1) {
            *s -= term.kappa * l;
        }
    }

    fn add_up(&mut self, inside: bool) {
        let (mut even, mut odd) = (0.0, 0.0);
        for n in (0..=self.order).rev() {
            let f = self.s[n] / (n + 1) as f64;
            if n % 2 == 0 { even += f } else { odd += f }
        }
        // F(±1) = ±even + odd.
        self.depth = (2.0 * even).max(0.0);
        if inside {
            self.front = (odd - even).exp();
            self.g[0] = 1.0;
            for n in 1..=self.order {
                let product: f64 = (1..=n).map(|k| self.s[k - 1] * self.g[n - k]).sum();
                self.g[n] = -product / n as f64;
            }
        }
    }

    /// Optical depth from the front to y.
    pub fn depth_to(&self, y: f64) -> f64 {
        let (mut at, mut start) = (0.0, 0.0);
        for n in (0..=self.order).rev() {
            let f = self.s[n] / (n + 1) as f64;
            at = f + at * y;
            start = f - start;
        }
        at * y + start
    }

    /// ∫ T p dy for a polynomial p, and the bound on its error.
    pub fn weigh(&self, p: &[f64]) -> [f64; 2] {
        let mut total = 0.0;
        for (k, &coefficient) in p.iter().enumerate().filter(|(_, c)| **c != 0.0) {
            let moment: f64 = (k % 2..=self.order).step_by(2).map(|n| self.g[n] * 2.0 / (n + k + 1) as f64).sum();
            total += coefficient * moment;
        }
        let size: f64 = p.iter().map(|c| c.abs()).sum();
        [self.front * total, 2.0 * size * (self.front * self.g_error + 1.1 * self.error + 8.0 * EPS)]
    }
}

/// Σ over terms of S·c as polynomials, one a colour channel, and a bound on their coefficients'
/// sum of magnitudes.
pub(super) fn emission(terms: &[Term], order: usize) -> ([[f64; ORDER + 4]; 3], f64) {
    let mut emission = [[0.0; ORDER + 4]; 3];
    let mut size = 0f64;
    for term in terms {
        let l = logarithm(&term.ratio, order);
        let bright = term.color.iter().map(|c| c.iter().map(|v| v.abs()).sum::<f64>()).fold(0.0, f64::max);
        size += bright * term.kappa * (term.log + 1.21 * term.growth);
        for (channel, c) in emission.iter_mut().zip(&term.color) {
            for n in 0..=order {
                let s = term.kappa * if n == 0 { term.log } else { -l[n] };
                for (k, v) in c.iter().enumerate() {
                    channel[n + k] += s * v;
                }
            }
        }
    }
    (emission, size)
}

impl Sum {
    /// ∫ T Σ σᵢcᵢ, a colour channel each, and the bound on their errors.
    pub fn emit(&self, terms: &[Term]) -> ([f64; 3], f64) {
        let (emission, size) = emission(terms, self.order);
        let mut color = [0.0; 3];
        let mut error = 0f64;
        for (c, p) in color.iter_mut().zip(&emission) {
            let [value, wrong] = self.weigh(p);
            *c = value;
            error = error.max(wrong);
        }
        let bright = terms.iter().flat_map(|t| t.color).map(|c| c.iter().map(|v| v.abs()).sum::<f64>());
        let round = 32.0 * (self.order + 8) as f64 * EPS;
        (color, error + bright.fold(0.0, f64::max) * self.error * 1.1 + size * round)
    }
}

/// Coefficients of ln(1 + r₁y + r₂y² + r₃y³) up to an order.
fn logarithm(ratio: &[f64; 3], order: usize) -> [f64; ORDER + 1] {
    // k·L_k, by the recurrence of the module's head.
    let [r1, r2, r3] = *ratio;
    let mut scaled = [0.0; ORDER + 1];
    for n in 1..=order {
        let mut v = match n {
            1 => r1,
            2 => 2.0 * r2,
            3 => 3.0 * r3,
            _ => 0.0,
        };
        v -= r1 * scaled[n - 1];
        if n > 1 {
            v -= r2 * scaled[n - 2];
        }
        if n > 2 {
            v -= r3 * scaled[n - 3];
        }
        scaled[n] = v;
    }
    for (n, v) in scaled.iter_mut().enumerate().skip(1) {
        *v /= n as f64;
    }
    scaled
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn optical_depth_and_transmittance_keep_their_bounds(
            bend in prop::array::uniform3(-0.1..0.1f64),
            middle in 0.0..0.99f64,
            kappa in 0.01..0.5f64,
        ) {
            let scale = 1.0 - middle;
            let opacity = [middle, bend[0] * scale, bend[1] * scale, bend[2] * scale * 0.1];
            let rest = [scale, -opacity[1], -opacity[2], -opacity[3]];
            let Some(term) = Term::new(middle, &rest, 0.0, [[0.0; 4]; 3], kappa) else { return Ok(()) };
            let Some(sum) = Sum::new(&[term], 1.0) else { return Ok(()) };
            let sigma = |y: f64| -kappa * (-(opacity[0] + y * (opacity[1] + y * (opacity[2] + y * opacity[3])))).ln_1p();
            // Simpson's rule, fine enough to be exact to rounding.
            let simpson = |f: &dyn Fn(f64) -> f64, b: f64| {
                let n = 400;
                let h = (b + 1.0) / n as f64;
                let weight = |i: usize| if i == 0 || i == n { 1.0 } else if i % 2 == 1 { 4.0 } else { 2.0 };
                (0..=n).map(|i| weight(i) * f(-1.0 + i as f64 * h)).sum::<f64>() * h / 3.0
            };
            prop_assert!((simpson(&sigma, 1.0) - sum.depth).abs() < sum.error + 1e-11);
            prop_assert!((simpson(&sigma, 0.3) - sum.depth_to(0.3)).abs() < sum.error + 1e-11);
            let [weighed, error] = sum.weigh(&[0.5, 1.0, -0.25]);
            let truth = simpson(&|y| (-sum.depth_to(y)).exp() * (0.5 + y - 0.25 * y * y), 1.0);
            prop_assert!((weighed - truth).abs() < error + 1e-11, "{weighed} {truth} {error}");
            prop_assert!(error < 1e-11);
        }
    }
}
