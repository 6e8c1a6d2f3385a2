//! What a frame says about how it was made.

use volact_core::{Compositing, LookupTable, Method, TableInterpolation, Warning, WarningCode, resolve::ResolvedShape};

use super::{
    check::caps,
    options::{Classification, Settings},
    plan::Plan,
    resources::{Resources, Tables},
    shaded,
};

/// How the shapes drawn were made into a picture.
pub fn method(drawn: &[&ResolvedShape], plan: &Plan, resources: &Resources, settings: &Settings) -> Method {
    let voxels = drawn.iter().any(|s| s.first_volume().is_some() || shaded::wanted(s));
    let cells = drawn.iter().any(|s| s.attribute("scalars").is_some());
    let walls = drawn.iter().any(|s| s.state.geometry.as_surface().is_some());
    let sampling = [
        // A frame without shapes says what would have been done.
        (voxels || !(cells || walls)).then_some("ray casting, midpoint lattice"),
        cells.then_some("cell by cell"),
        walls.then_some("nearest triangle"),
    ];
    let mut classification: Vec<&str> = Vec::new();
    let mut formats: Vec<String> = Vec::new();
    for shape in drawn.iter().filter(|s| s.state.geometry.as_surface().is_none()) {
        let pre_integrated = resources.tables(shape.id).is_some_and(|t| t.pre_integrated());
        let table = shape.table("lookup_table").map(LookupTable::interpolation);
        classification.push(match (shape.compositing(), table) {
            (c, _) if shaded::wanted(shape) => evaluated(c, resources.shader(shape.id)),
            _ if shape.attribute("scalars").is_some() => "linear in each cell",
            (Compositing::Over, Some(TableInterpolation::Pre)) => "pre-interpolated",
            (Compositing::Over, None) => "components",
            (Compositing::Over, _) if pre_integrated => "pre-integrated",
            _ => "post-interpolated",
        });
        formats.extend(shape.first_volume().map(|v| v.volume().desc().scalar.to_string()));
        formats.extend(shape.attribute("scalars").map(|a| a.scalar.to_string()));
    }
    classification.dedup();
    formats.dedup();
    let width = drawn.iter().filter_map(|s| resources.tables(s.id)).map(|t| t.width()).max();
    Method {
        sampling: sampling.into_iter().flatten().collect::<Vec<_>>().join(", "),
        sample_distance: if voxels || drawn.is_empty() { plan.step } else { 0.0 },
        classification: classification.join(", "),
        table_width: width.unwrap_or(0),
        texture_format: formats.join(", "),
        filter: "f32, exact weights".into(),
        blend: "f32".into(),
        termination: settings.termination,
        device: caps(settings).device,
    }
}

/// How a shader's source is evaluated.
fn evaluated(compositing: Compositing, shader: Option<&shaded::Shader>) -> &'static str {
    match compositing {
        Compositing::First => "crossings found by the shader's values",
        Compositing::Over if shader.is_some_and(shaded::Shader::pre_integrates) => "shader evaluated over segments",
        _ => "shader evaluated in the middle of segments",
    }
}

/// Shapes whose segments are too long for what they absorb.
pub fn coarse(drawn: &[&ResolvedShape], step: f64, resources: &Resources) -> Vec<Warning> {
    let saturated = |s: &&&ResolvedShape| resources.tables(s.id).is_some_and(Tables::saturated);
    let warn = |s: &&ResolvedShape| {
        let unit = s.float("unit_distance").unwrap_or(1.0);
        let message = format!(
            "sample_distance {step:?} is {:.1} unit distances: segments are all but opaque, and where the shape \
             ends inside one it is drawn as if it filled it; take a shorter one",
            step / unit
        );
        Warning::new(WarningCode::CoarseSampling, &s.name, message)
    };
    drawn.iter().filter(saturated).map(warn).collect()
}

/// Shapes whose tables have spikes between the entries that they are drawn with.
pub fn lost(drawn: &[&ResolvedShape], resources: &Resources) -> Vec<Warning> {
    let loses = |s: &&ResolvedShape| resources.tables(s.id).filter(|t| t.loses_spikes()).map(Tables::width);
    let warn = |s: &&ResolvedShape| {
        let message = format!(
            "the lookup table has a spike narrower than the distance of the {} entries that it is drawn with, which \
             is not seen; widen it, narrow the table to the values around it, or draw with the action reference",
            loses(s)?
        );
        Some(Warning::new(WarningCode::CoarseSampling, &s.name, message))
    };
    drawn.iter().filter_map(warn).collect()
}

/// Settings asked for that a shape's way of drawing has no use for.
pub fn adjusted(drawn: &[&ResolvedShape], resources: &Resources, settings: &Settings) -> Vec<Warning> {
    let asked = settings.classification == Classification::PreIntegrated;
    let tabled = |s: &&&ResolvedShape| {
        s.compositing() == Compositing::Over && s.volume("volume").is_some() && s.table("lookup_table").is_some()
    };
    let without = |s: &&&ResolvedShape| resources.tables(s.id).is_none_or(|t| !t.pre_integrated());
    let warn = |s: &&ResolvedShape| {
        let message = "classification pre-integrated is not done for overlapping shapes, deformed meshes, \
                       pre-interpolated tables and the nearest filter; it is drawn without";
        Warning::new(WarningCode::SettingAdjusted, &s.name, message)
    };
    drawn.iter().filter(|_| asked).filter(tabled).filter(without).map(warn).collect()
}
