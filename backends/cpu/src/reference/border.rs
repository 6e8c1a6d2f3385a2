//! Pieces next to a control point, where the true value may lie in the next segment.
//!
//! Near an end of its segment, on a stretch of measure z on which the value is within 2ε of the
//! control point, what a piece says may be that of the wrong segment:
//! - continuous table: wrong by the steeper slope times ε;
//! - step: wrong by the step, but on the measure z only (`edge`);
//! - next segment opaque: whether the ray ends here is in doubt, unless the next piece shows it.
//!
//! The measure z follows from the derivative at the end or, where that is too small, from Remez's
//! inequality: a cubic with |p| ≤ t on a set E of an interval of length W has
//! max |p| ≤ t·T₃(2W/|E| − 1) ≤ t·(4W/|E|)³/2, hence |E| ≤ 4W·(t / 2 max |p|)^⅓. The same turned
//! round bounds the integral of −ln |p| over any small set, wherever p vanishes.

use super::{
    cubic::{self, Cubic},
    knots::{Knots, Segment},
    piece::{Local, Piece},
};

/// Remez: on a set of measure `w` of an interval of measure 2, −ln |p| of a cubic p with maximum
/// `most` integrates to at most this.
pub(super) fn log_bound(w: f64, most: f64) -> f64 {
    if w <= 0.0 {
        return 0.0;
    }
    if most <= 0.0 {
        return f64::INFINITY;
    }
    (w * (-(2.0 * most).ln() + 3.0 * (8.0 / w).ln() + 3.0)).max(0.0)
}

/// How far inside its segment the value gets, counted from the ends that data can pass.
pub(super) fn depth_inside(local: &Local<'_>, segment: &Segment, [lo, hi]: [f64; 2]) -> f64 {
    let above_lo = if local.range[0] < segment.lo { hi - segment.lo } else { f64::INFINITY };
    let below_hi = if local.range[1] > segment.hi { segment.hi - lo } else { f64::INFINITY };
    above_lo.min(below_hi)
}

/// Accounts for the next segment where the value comes near to it.
pub(super) fn look_across(
    made: &mut Piece,
    local: &Local<'_>,
    number: usize,
    upward: bool,
    value: &Cubic,
    [lo, hi]: [f64; 2],
    error: f64,
) {
    let knots: &Knots = &local.field.knots;
    let segment = knots.segment(number);
    let (knot, near, reachable) = if upward {
        (segment.hi, hi + 2.0 * error >= segment.hi, local.range[1] > segment.hi)
    } else {
        (segment.lo, lo - 2.0 * error <= segment.lo, local.range[0] < segment.lo)
    };
    if !near || !reachable {
        return;
    }
    let Some(next) = knots.neighbour(number, upward) else { return };
    let far = (lo - knot).abs().max((hi - knot).abs());
    let zone = zone(value, if upward == (value[1] >= 0.0) { 1.0 } else { -1.0 }, far, error);
    made.doubt |= next.hi - next.lo < 4.0 * error;
    let (here, there) = if upward { (segment.at_end, next.at_base) } else { (segment.at_base, next.at_end) };
    let opacity = local.field.drives[3].then_some([here[3], there[3]]);
    if let Some([own, other]) = opacity {
        made.doubt |= next.is_opaque() && !segment.is_opaque();
        let slope = next.slope[3].abs();
        let step = (own - other).abs();
        let alike = slope <= 4.0 * segment.slope[3].abs() || slope * error <= 1e-13 * (1.0 - own);
        if step == 0.0 && alike {
            made.opacity_error = made.opacity_error.max(slope * error);
        } else if !segment.is_opaque() && !next.is_opaque() {
            made.edge += edge([own, other], [segment.slope[3].abs(), slope], error, zone, far);
        } else if !segment.is_opaque() {
            made.edge += edge([own, own], [segment.slope[3].abs(); 2], error, zone, far);
        }
        if slope > 0.0 && segment.slope[3] != 0.0 {
            made.ratio = made.ratio.min(slope / segment.slope[3].abs());
        } else if other < 1.0 {
            made.floor = made.floor.min(1.0 - other);
        }
    }
    for c in (0..3).filter(|&c| local.field.drives[c]) {
        let wrong = next.slope[c].abs() * error + (here[c] - there[c]).abs();
        if wrong <= 1e-12 {
            made.color_error = made.color_error.max(wrong);
        } else {
            let [own, other] = opacity.unwrap_or([0.5; 2]);
            let log = edge([own, other], [segment.slope[3].abs(), next.slope[3].abs()], error, zone, far);
            made.edge_color += wrong * if log.is_finite() { log } else { zone };
        }
    }
}

/// Bound on the measure of y on which the value is within 2ε of a control point.
fn zone(value: &Cubic, end: f64, far: f64, error: f64) -> f64 {
    let steep = cubic::slope(value, end).abs();
    let bend = 2.0 * value[2].abs() + 6.0 * value[3].abs();
    let z = 6.0 * error / steep;
    if z.is_finite() && bend * z <= 0.5 * steep {
        return z.min(2.0);
    }
    if far <= 8.0 * error { 2.0 } else { (8.0 * (3.0 * error / (2.0 * far)).cbrt()).min(2.0) }
}

/// Bound on ∫ (|ln(1 − a)| + |ln(1 − a')|) dy over a zone at a control point with opacities a, a'.
fn edge(opacity: [f64; 2], slope: [f64; 2], error: f64, zone: f64, far: f64) -> f64 {
    let one = |a: f64, slope: f64| {
        let least = 1.0 - a - 4.0 * slope * error;
        if least > 0.5 * (1.0 - a) { -zone * least.ln() } else { log_bound(zone, slope * far * 0.5) }
    };
    one(opacity[0], slope[0]) + one(opacity[1], slope[1])
}
