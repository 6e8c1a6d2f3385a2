//! What tabulating a lookup table may cost a picture, from the number of nodes that a frame reports.
//!
//! Let α(v) = 1 − (1 − a(v))^(h/unit) be what a segment adds, and cα(v) its light. Linear
//! interpolation over nodes Δ apart, with nodes on the control points, is off by at most
//! δ(v) = Δ²/8·|f″|. A pixel sums T·δ over its segments. As T·α sums up to at most 1, this is at most
//! max δ/α where the table has some opacity, and n·max δ where it has next to none; the threshold
//! between the two is chosen to make the sum smallest. Pre-integrated pairs of nodes are off by twice
//! as much, and by a quarter of Δ times the change of slope at control points beside the diagonal.
//! Shaders that are `evaluated` look up extinction to 1e-6 of an optical depth over a unit.

use volact_core::{Compositing, ControlPoint, LookupTable, Method, ParameterValue, Shape, table::ResolvedTable};

use crate::{method::Lattice, tolerance::Sizes};

/// Places looked at in each piece between control points.
const PLACES: usize = 48;

/// What is tabulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// What a segment adds.
    Nodes,
    /// What a segment adds, by the values at both of its ends.
    Pairs,
    /// Extinction, for a program.
    Program,
}

/// How wrong optical depth over a unit may be in tables of programs.
const PROGRAM: f64 = 1e-6;

/// The part of a tolerance that tables take.
pub fn tabulated(shapes: &[Shape], method: &Method, lattice: Lattice) -> f64 {
    let Some(step) = lattice.step() else { return 0.0 };
    let evaluated = method.classification.contains("evaluated");
    if method.table_width < 2 && !evaluated {
        return 0.0;
    }
    let segments = (Sizes::of(shapes).diagonal / step).max(1.0);
    let pairs = matches!(lattice, Lattice::Rays { segments: true, .. } | Lattice::Planes { segments: true, .. });
    let kind = match (evaluated, pairs) {
        (true, _) => Kind::Program,
        (_, true) => Kind::Pairs,
        _ => Kind::Nodes,
    };
    let part = |shape: &Shape| of_shape(shape, method.table_width, (step, segments), kind);
    // Each segment's light is some shape's: the shares T·α of all together sum up to at most 1.
    shapes.iter().map(part).fold(0.0, f64::max)
}

fn of_shape(shape: &Shape, width: usize, (step, segments): (f64, f64), kind: Kind) -> f64 {
    let state = shape.state();
    if state.geometry.slices().is_some_and(|s| !s.volume) {
        // Planes are classified one by one.
        return 0.0;
    }
    let table = state.parameters.get("lookup_table");
    let unit = state.parameters.get("unit_distance").and_then(ParameterValue::as_float).unwrap_or(1.0);
    let over = volact_core::shader::builtin()
        .iter()
        .any(|e| e.declaration.name == state.shader && e.compositing == Compositing::Over);
    match table {
        Some(ParameterValue::Table(table)) if (over || kind == Kind::Program) && unit > 0.0 => {
            let range = state.volume().map_or([0.0, 1.0], |v| v.range());
            worst(table, range, width, (step / unit, segments), kind)
        }
        _ => 0.0,
    }
}

/// What a segment of `h` units adds: light and opacity.
fn added(rgba: [f64; 4], h: f64) -> [f64; 4] {
    let alpha = -(h * (-rgba[3]).ln_1p()).exp_m1();
    [rgba[0] * alpha, rgba[1] * alpha, rgba[2] * alpha, alpha]
}

fn worst(table: &LookupTable, range: [f64; 2], width: usize, (h, segments): (f64, f64), kind: Kind) -> f64 {
    let points = table.points(range);
    let (Some(first), Some(last)) = (points.first(), points.last()) else { return 0.0 };
    let delta = (last.value - first.value) / (width.max(2) - 1) as f64;
    let resolved = table.resolve(range);
    // Error and opacity at each place.
    let mut places: Vec<[f64; 2]> = points.windows(2).flat_map(|p| piece(&resolved, p, delta, h, kind)).collect();
    if kind == Kind::Pairs {
        places.extend(corners(&resolved, &points, delta, h));
    }
    places.sort_by(|a, b| a[1].total_cmp(&b[1]));
    let after: Vec<f64> = places
        .iter()
        .rev()
        .scan(0.0f64, |most, [error, alpha]| {
            *most = most.max(if *alpha > 0.0 { error / alpha } else { f64::INFINITY });
            Some(*most)
        })
        .collect();
    let (mut below, mut least) = (0.0f64, f64::INFINITY);
    for i in 0..=places.len() {
        let above = if i < places.len() { after[places.len() - 1 - i] } else { 0.0 };
        least = least.min(above + segments * below);
        below = below.max(places.get(i).map_or(0.0, |p| p[0]));
    }
    if least.is_finite() { least } else { 0.0 }
}

/// Errors of curvature within a piece between two control points.
fn piece(table: &ResolvedTable, ends: &[ControlPoint], delta: f64, h: f64, kind: Kind) -> Vec<[f64; 2]> {
    let (a, b) = (ends[0].value, ends[1].value);
    let d = (b - a) / (PLACES + 1) as f64;
    if d <= 0.0 {
        return Vec::new();
    }
    let place = |i: usize| {
        let at = |k: usize| added(table.classify((a + d * k as f64).clamp(a, b - 1e-9 * (b - a))), h);
        let (before, here, after) = (at(i - 1), at(i), at(i + 1));
        let bend = (0..4).map(|c| (before[c] - 2.0 * here[c] + after[c]).abs()).fold(0.0, f64::max) / (d * d);
        let error = match kind {
            Kind::Nodes => bend * delta * delta / 8.0,
            Kind::Pairs => bend * delta * delta / 4.0,
            // What is opaque is not tabulated, and what is transparent is so exactly.
            Kind::Program if here[3] > 0.0 => PROGRAM * h * (1.0 - here[3]),
            Kind::Program => 0.0,
        };
        [error, here[3]]
    };
    (1..=PLACES).map(place).collect()
}

/// Errors of changes of slope at control points.
fn corners(table: &ResolvedTable, points: &[ControlPoint], delta: f64, h: f64) -> Vec<[f64; 2]> {
    let corner = |p: &ControlPoint| {
        let at = |v: f64| added(table.classify(v), h);
        let (before, here, after) = (at(p.value - delta), at(p.value), at(p.value + delta));
        let change = (0..4).map(|c| (before[c] - 2.0 * here[c] + after[c]).abs()).fold(0.0, f64::max);
        [0.25 * change, here[3].max(before[3]).max(after[3])]
    };
    points.iter().map(corner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::greys;

    #[test]
    fn four_times_as_many_nodes_cost_a_sixteenth() {
        let table = greys(&[(0.0, 0.2, 0.05), (100.0, 0.9, 0.8)]);
        let [coarse, fine] = [65usize, 257].map(|w| worst(&table, [0.0, 1.0], w, (0.5, 50.0), Kind::Nodes));
        assert!(coarse > 1e-7 && (coarse / fine - 16.0).abs() < 0.5, "{coarse} {fine}");
    }

    #[test]
    fn a_segment_of_one_unit_of_one_grey_is_linear_and_costs_nothing() {
        let table = greys(&[(0.0, 0.5, 0.1), (100.0, 0.5, 0.8)]);
        assert!(worst(&table, [0.0, 1.0], 65, (1.0, 50.0), Kind::Nodes) < 1e-9);
    }
}
