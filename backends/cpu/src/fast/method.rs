//! What a frame says about how it was made.

use volact_core::{Compositing, LookupTable, Method, TableInterpolation, Warning, WarningCode, resolve::ResolvedShape};

use super::{
    check::caps,
    options::{Classification, Settings},
    plan::{Plan, uses_general},
    resources::Resources,
};

/// How the shapes drawn were made into a picture.
pub fn method(drawn: &[&ResolvedShape], plan: &Plan, resources: &Resources, settings: &Settings) -> Method {
    let mut classification: Vec<&str> = Vec::new();
    let mut width = 0;
    let mut formats: Vec<String> = Vec::new();
    for shape in drawn {
        let tables = resources.tables(shape.id);
        let general = plan.general && shape.compositing() == Compositing::Over;
        let word = match (shape.compositing(), shape.table("lookup_table").map(LookupTable::interpolation)) {
            (Compositing::Over, Some(TableInterpolation::Pre)) => "pre-interpolated",
            (Compositing::Over, None) => "components",
            (Compositing::Over, _) if !general && tables.is_some_and(|t| t.pairs.is_some()) => "pre-integrated",
            _ => "post-interpolated",
        };
        classification.push(word);
        if let Some(t) = tables.filter(|_| !general) {
            width = width.max(t.pairs.as_ref().map_or(t.table.nodes, |p| p.nodes));
        }
        formats.extend(shape.volume("volume").map(|v| v.volume().desc().scalar.to_string()));
    }
    classification.dedup();
    formats.dedup();
    Method {
        sampling: "ray casting, midpoint lattice".into(),
        sample_distance: plan.step,
        classification: classification.join(", "),
        table_width: width,
        texture_format: formats.join(", "),
        filter: "f32, exact weights".into(),
        blend: if uses_general(drawn) { "f64" } else { "f32" }.into(),
        termination: settings.termination,
        device: caps(settings).device,
    }
}

/// Settings asked for that a shape's way of drawing has no use for.
pub fn adjusted(drawn: &[&ResolvedShape], resources: &Resources, settings: &Settings) -> Vec<Warning> {
    let asked = settings.classification == Classification::PreIntegrated;
    let tabled = |s: &&&ResolvedShape| s.compositing() == Compositing::Over && s.table("lookup_table").is_some();
    let without = |s: &&&ResolvedShape| resources.tables(s.id).is_none_or(|t| t.pairs.is_none());
    let warn = |s: &&ResolvedShape| {
        let message = "classification pre-integrated is not done for overlapping shapes, \
                       pre-interpolated tables and the nearest filter; it is drawn without";
        Warning::new(WarningCode::SettingAdjusted, &s.name, message)
    };
    drawn.iter().filter(|_| asked).filter(tabled).filter(without).map(warn).collect()
}
