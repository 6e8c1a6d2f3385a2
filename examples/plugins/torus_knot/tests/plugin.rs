//! Links the plugin as a host does and measures what it makes.

use std::{f64::consts::TAU, sync::Arc};

use volact_plugin::{Geometry, Registry, geometry::GeometryError, parameter::ParameterMap, plugin::host};

fn knot(parameters: &[(&str, f64)]) -> Result<Arc<dyn Geometry>, GeometryError> {
    let mut registry = Registry::with_core();
    // SAFETY: the entry is made by the macro `export!`.
    unsafe { host::link(torus_knot::volact_plugin, &mut registry) }.unwrap();
    let value =
        |(name, value): &(&str, f64)| match value.fract() == 0.0 && !["radius", "swing", "thickness"].contains(name) {
            true => (name.to_string(), (*value as i64).into()),
            false => (name.to_string(), (*value).into()),
        };
    registry.geometry("torus-knot", &parameters.iter().map(value).collect::<ParameterMap>())
}

/// A tube's volume is its cross-section times its length (Pappus), whatever its bends.
#[test]
fn volume_is_cross_section_times_length() {
    let knot = knot(&[("steps", 4000.0), ("thickness", 0.1)]).unwrap();
    let cut = knot.tessellate().unwrap();
    let found: f64 = (0..cut.tetrahedra.len()).map(|t| cut.volume(t)).sum();
    let point = |i: usize| {
        let (t, r) = (TAU * i as f64 / 100_000.0, 0.45);
        let reach = 1.0 + r * (3.0 * t).cos();
        [reach * (2.0 * t).cos(), reach * (2.0 * t).sin(), r * (3.0 * t).sin()]
    };
    let step = |i: usize| (0..3).map(|a| (point(i + 1)[a] - point(i)[a]).powi(2)).sum::<f64>().sqrt();
    let length: f64 = (0..100_000).map(step).sum();
    let section = 16.0 / 2.0 * 0.1 * 0.1 * (TAU / 16.0).sin();
    // The cross-section turns along the curve, so that the sides are not flat, and the diagonals that cut them into
    // triangles all lean the same way: that takes a little however fine the steps are.
    assert!((found / (section * length) - 1.0).abs() < 1e-3, "{found}, wanted {}", section * length);
    assert_eq!((cut.collapsed, cut.inverted, cut.folded), (0, 0, 0));
    assert_eq!(knot.name(), "torus-knot");
}

#[test]
fn what_is_no_knot_is_refused() {
    for (parameters, wanted) in [
        (&[("turns", 2.0), ("windings", 4.0)], "turns and windings is 2 and 4, wanted two without a common divisor"),
        (&[("thickness", -1.0), ("turns", 2.0)], "thickness"),
    ] {
        let words = knot(parameters).unwrap_err().to_string();
        assert!(words.contains(wanted), "{words}");
    }
}
