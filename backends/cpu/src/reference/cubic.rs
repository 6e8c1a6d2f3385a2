//! Cubic polynomials: what a trilinear field is along a straight line through a cell.
//!
//! With the fractions along the axes `x₀ + Δx·s`, … for `s` in 0 to 1, interpolation along x gives
//! four linear polynomials of `s`, along y two quadratic ones, along z one cubic.

/// Coefficients of 1, s, s², s³.
pub(super) type Cubic = [f64; 4];

/// The trilinear interpolant of eight corners (x fastest) along `from + step·s`.
pub(super) fn along_line(corner: &[f64; 8], from: [f64; 3], step: [f64; 3]) -> Cubic {
    let [x, y, z] = from;
    let [dx, dy, dz] = step;
    let edge = |i: usize| {
        let d = corner[i + 1] - corner[i];
        [corner[i] + d * x, d * dx]
    };
    let face = |i: usize| {
        let (a, b) = (edge(i), edge(i + 2));
        let d = [b[0] - a[0], b[1] - a[1]];
        [a[0] + d[0] * y, a[1] + d[1] * y + d[0] * dy, d[1] * dy]
    };
    let (a, b) = (face(0), face(4));
    let d = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
    [a[0] + d[0] * z, a[1] + d[1] * z + d[0] * dz, a[2] + d[2] * z + d[1] * dz, d[2] * dz]
}

/// The value at `s`.
pub(super) fn eval(p: &Cubic, s: f64) -> f64 {
    p[0] + s * (p[1] + s * (p[2] + s * p[3]))
}

/// The first derivative at `s`.
pub(super) fn slope(p: &Cubic, s: f64) -> f64 {
    p[1] + s * (2.0 * p[2] + s * 3.0 * p[3])
}

/// `p(middle + half·y)` as a polynomial of `y`.
pub(super) fn restrict(p: &Cubic, middle: f64, half: f64) -> Cubic {
    let second = p[2] + 3.0 * p[3] * middle;
    [eval(p, middle), slope(p, middle) * half, second * half * half, p[3] * half * half * half]
}

/// The integral over 0 to 1.
pub(super) fn integral(p: &Cubic) -> f64 {
    p[0] + p[1] / 2.0 + p[2] / 3.0 + p[3] / 4.0
}

/// Where the derivative vanishes strictly between 0 and 1, in rising order; unused places NaN.
pub(super) fn critical_points(p: &Cubic) -> [f64; 2] {
    let (a, b, c) = (3.0 * p[3], 2.0 * p[2], p[1]);
    let inside = |s: f64| if s > 0.0 && s < 1.0 { s } else { f64::NAN };
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 || (a == 0.0 && b == 0.0) {
        return [f64::NAN; 2];
    }
    // Both roots without cancellation (W. Kahan).
    let w = -0.5 * (b + discriminant.sqrt().copysign(b));
    let (first, second) = (inside(w / a), inside(c / w));
    if first <= second || second.is_nan() { [first, second] } else { [second, first] }
}

/// Lowest and highest value over 0 to 1.
pub(super) fn range(p: &Cubic) -> [f64; 2] {
    let ends = [p[0], eval(p, 1.0)];
    let inner = critical_points(p).into_iter().filter(|s| !s.is_nan()).map(|s| eval(p, s));
    inner.fold([ends[0].min(ends[1]), ends[0].max(ends[1])], |[lo, hi], v| [lo.min(v), hi.max(v)])
}

/// Where `p` takes `value` between `a` and `b`, on which it is monotone and takes it: Newton's
/// steps, kept inside a bracket that bisection shrinks.
pub(super) fn crossing(p: &Cubic, value: f64, mut a: f64, mut b: f64) -> f64 {
    let rising = eval(p, b) >= eval(p, a);
    let mut s = 0.5 * (a + b);
    for _ in 0..100 {
        let miss = eval(p, s) - value;
        if miss == 0.0 {
            return s;
        }
        if (miss < 0.0) == rising {
            a = s;
        } else {
            b = s;
        }
        let newton = s - miss / slope(p, s);
        let next = if newton > a && newton < b { newton } else { 0.5 * (a + b) };
        if (next - s).abs() <= f64::EPSILON * 0.5 * s.abs() || b - a <= f64::EPSILON * b.abs() {
            return next;
        }
        s = next;
    }
    s
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn cubic_is_the_trilinear_field(
            corner in prop::array::uniform8(-9.0..9.0f64),
            from in prop::array::uniform3(0.0..1.0f64),
            to in prop::array::uniform3(0.0..1.0f64),
            s in 0.0..1.0f64,
        ) {
            let step = [0, 1, 2].map(|a| to[a] - from[a]);
            let p = along_line(&corner, from, step);
            let f = [0, 1, 2].map(|a| from[a] + step[a] * s);
            let weight = |i: usize| (0..3).map(|a| if i >> a & 1 == 1 { f[a] } else { 1.0 - f[a] }).product::<f64>();
            let truth: f64 = (0..8).map(|i| corner[i] * weight(i)).sum();
            prop_assert!((eval(&p, s) - truth).abs() < 1e-13);
            let q = restrict(&p, 0.25, 0.25);
            prop_assert!((eval(&q, 4.0 * s - 1.0) - eval(&p, s)).abs() < 1e-12);
        }

        #[test]
        fn crossings_are_found(p in prop::array::uniform4(-5.0..5.0f64), part in 0.0..1.0f64) {
            let mut cuts = vec![0.0];
            cuts.extend(critical_points(&p).into_iter().filter(|s| !s.is_nan()));
            cuts.push(1.0);
            for w in cuts.windows(2) {
                let value = eval(&p, w[0]) * (1.0 - part) + eval(&p, w[1]) * part;
                let s = crossing(&p, value, w[0], w[1]);
                prop_assert!(s >= w[0] && s <= w[1]);
                prop_assert!((eval(&p, s) - value).abs() < 1e-13);
            }
        }
    }
}
