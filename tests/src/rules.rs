//! Plain integration rules in f64 for one ray, the wrong ones included: to know that the tests
//! would see them, and for truth where a field is not a grid.

/// Opacity over one unit distance and grey at a place of the ray.
pub type Medium<'a> = &'a dyn Fn(f64) -> [f64; 2];

/// A way to sum up a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// The middle of each segment, exact exponential: second order.
    Midpoint,
    /// The start of each segment, exact exponential: first order.
    Left,
    /// The middle of each segment, α ≈ τh: first order, though it looks right.
    Linearised,
    /// Linear between the ends of each segment, which dims itself: second order.
    PreIntegrated,
    /// The same, whose light is not dimmed within its own segment: first order.
    Unattenuated,
}

/// Parts of a segment in which what is linear between its ends is integrated.
const PARTS: usize = 32;

/// Premultiplied grey and opacity of `n` equal segments over `0..length`.
pub fn march(rule: Rule, medium: Medium<'_>, length: f64, n: usize) -> [f64; 2] {
    let h = length / n as f64;
    let mut out = [0.0, 0.0];
    for k in 0..n {
        if matches!(rule, Rule::PreIntegrated | Rule::Unattenuated) {
            let ends = [medium(k as f64 * h), medium((k + 1) as f64 * h)];
            let [light, alpha] = segment(ends, h, rule == Rule::PreIntegrated);
            out = [out[0] + (1.0 - out[1]) * light, out[1] + (1.0 - out[1]) * alpha];
            continue;
        }
        let at = if rule == Rule::Left { k as f64 * h } else { (k as f64 + 0.5) * h };
        let [grey, a] = medium(at);
        let tau = -(-a).ln_1p() * h;
        let alpha = if rule == Rule::Linearised { tau.min(1.0) } else { -(-tau).exp_m1() };
        let share = (1.0 - out[1]) * alpha;
        out = [out[0] + share * grey, out[1] + share];
    }
    out
}

/// Light and opacity of one segment whose grey and opacity a unit are linear between its ends.
fn segment([front, back]: [[f64; 2]; 2], h: f64, attenuated: bool) -> [f64; 2] {
    let (mut light, mut depth) = (0.0, 0.0f64);
    for i in 0..PARTS {
        let t = (i as f64 + 0.5) / PARTS as f64;
        let [grey, a] = [0, 1].map(|c| front[c] + t * (back[c] - front[c]));
        let tau = -(-a).ln_1p() * h / PARTS as f64;
        light += if attenuated { (-depth).exp() * -(-tau).exp_m1() * grey } else { tau * grey };
        depth += tau;
    }
    [light, -(-depth).exp_m1()]
}

/// The integral itself, by Richardson extrapolation of the midpoint rule on a smooth medium.
pub fn smooth(medium: Medium<'_>, length: f64) -> [f64; 2] {
    let (a, b) = (march(Rule::Midpoint, medium, length, 2048), march(Rule::Midpoint, medium, length, 4096));
    [0, 1].map(|c| (4.0 * b[c] - a[c]) / 3.0)
}
