//! Labels for which a table has no entry: they are not drawn, and their user is told.

use std::collections::BTreeSet;

use volact_core::{ParameterType, ShaderEntry, Warning, WarningCode, resolve::ResolvedShape};

use crate::{
    signatures::kind_of,
    tokens::{Kind, tokens},
};

/// The most labels that a warning names.
const MOST_NAMED: usize = 8;

/// What to tell of shapes whose shader looks labels up in a table (`TABLE_entry` with the
/// `VOLUME_nearest` of one volume) that has no entry for some: each such shape with the labels.
/// The label 0 is by custom the background, and is expected to have none. Volumes are read once and
/// to a bound ([`Volume::labels`](volact_core::Volume::labels)).
pub fn without_entry(shapes: &[&ResolvedShape]) -> Vec<Warning> {
    shapes.iter().flat_map(|shape| of_shape(shape)).collect()
}

fn of_shape(shape: &ResolvedShape) -> Vec<Warning> {
    let (volumes, tables) = asked(&shape.shader);
    let [volume] = volumes.as_slice() else { return Vec::new() };
    tables.iter().filter_map(|table| of_table(shape, volume, table)).collect()
}

fn of_table(shape: &ResolvedShape, volume: &str, table: &str) -> Option<Warning> {
    let texture = shape.volume(volume)?;
    let range = shape.first_volume()?.range();
    let component = shape.int("component").map_or(0, |c| usize::try_from(c).unwrap_or(usize::MAX));
    if component >= texture.volume().desc().components {
        return None;
    }
    let entries = shape.table(table)?.resolve(range);
    let labels = texture.volume().labels(component);
    let missing = labels.found.iter().copied().filter(|label| *label != 0 && !entries.has_entry(*label as f64));
    let missing: Vec<i64> = missing.collect();
    let (which, are) = match missing.as_slice() {
        [] => return None,
        [one] => (format!("label {one}"), ["has", "is"]),
        all => (format!("labels {}", named(all)), ["have", "are"]),
    };
    let part = if labels.complete { "" } else { " (not all samples were looked at)" };
    let (name, [have, are]) = (texture.volume().name(), are);
    let message = format!("{which} of {name:?} {have} no entry in {table:?} and {are} not drawn{part}");
    Some(Warning::new(WarningCode::LabelWithoutEntry, &shape.name, message))
}

fn named(labels: &[i64]) -> String {
    let (some, rest) = labels.split_at(labels.len().min(MOST_NAMED));
    let some = some.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    if rest.is_empty() { some } else { format!("{some} and {} more", rest.len()) }
}

/// Names of the volumes and of the tables that a source looks labels up in.
fn asked(shader: &ShaderEntry) -> (Vec<&str>, Vec<&str>) {
    let Some(source) = shader.source.as_ref().filter(|s| s.text.contains("_entry")) else {
        return (Vec::new(), Vec::new());
    };
    let tokens = tokens(&source.text);
    let words: BTreeSet<&str> =
        tokens.iter().filter(|t| t.kind == Kind::Word).filter_map(|t| source.text.get(t.range.clone())).collect();
    let of = |kind: ParameterType, ending: &str| {
        let parameters = shader.declaration.parameters.iter().filter(move |p| kind_of(p) == Some(kind));
        let used = parameters.filter(|p| words.contains(format!("{}{ending}", p.name).as_str()));
        used.map(|p| p.name.as_str()).collect()
    };
    (of(ParameterType::Volume, "_nearest"), of(ParameterType::Table, "_entry"))
}
