//! Attributes: numbers of the vertices, of as many tuples as there are vertices.

use std::path::Path;

use volact_core::{Attribute, LoadError, Points, Warning};

use super::note;
use crate::numbers::Numbers;

/// Numbers with a name, so many to a vertex.
pub(crate) struct Named {
    pub(crate) name: String,
    pub(crate) components: usize,
    pub(crate) numbers: Numbers,
}

/// Collects attributes under names of their own.
pub(crate) struct Attributes<'a> {
    path: &'a Path,
    file: &'a str,
    all: Vec<Attribute>,
}

impl<'a> Attributes<'a> {
    pub(crate) fn new(path: &'a Path, file: &'a str) -> Self {
        Self { path, file, all: Vec::new() }
    }

    /// Takes numbers for `vertices` vertices. A name that is taken already is left out.
    pub(crate) fn add(&mut self, named: Named, vertices: usize, warnings: &mut Vec<Warning>) -> Result<(), LoadError> {
        let Named { mut name, components, numbers } = named;
        if name.is_empty() {
            name = format!("attribute {}", self.all.len());
        }
        // That there are no vertices is said where there should be cells.
        if vertices == 0 {
            return Ok(());
        }
        let wanted = vertices.saturating_mul(components);
        if components == 0 || numbers.len() != wanted {
            let (what, wanted) =
                (format!("length of attribute {name:?}"), format!("{vertices} vertices of {components}"));
            return Err(LoadError::invalid(self.path, what, format!("{} numbers", numbers.len()), wanted));
        }
        if self.all.iter().any(|a| a.name == name) {
            warnings.push(note(self.file, format!("a second attribute called {name:?} is left out")));
            return Ok(());
        }
        self.all.push(numbers.attribute(self.path, self.file, &name, components, warnings)?);
        Ok(())
    }

    pub(crate) fn finish(self) -> Vec<Attribute> {
        self.all
    }
}

type Merged = (Points, Vec<Attribute>);

/// The vertices and attributes of all pieces of a file, one after another. An attribute that is
/// not the same in all pieces is left out.
pub(crate) fn merge(
    path: &Path,
    file: &str,
    mut parts: Vec<(Points, Vec<Named>)>,
    warnings: &mut Vec<Warning>,
) -> Result<Merged, LoadError> {
    let mut attributes = Attributes::new(path, file);
    if parts.len() == 1 {
        let (points, all) = parts.remove(0);
        for named in all {
            attributes.add(named, points.len(), warnings)?;
        }
        return Ok((points, attributes.finish()));
    }
    let names: Vec<String> = parts[0].1.iter().map(|a| a.name.clone()).collect();
    let vertices = parts.iter().map(|(points, _)| points.len()).sum();
    for name in names {
        let mut joined: Option<Named> = None;
        let mut bytes = Vec::new();
        for (_, all) in &parts {
            let found = all.iter().find(|a| a.name == name);
            let same = |a: &&Named| {
                joined.as_ref().is_none_or(|j| (j.components, j.numbers.kind) == (a.components, a.numbers.kind))
            };
            let Some(found) = found.filter(same) else {
                warnings.push(note(file, format!("attribute {name:?} is left out: not the same in all pieces")));
                joined = None;
                break;
            };
            bytes.extend_from_slice(found.numbers.data.bytes());
            let (name, components, numbers) = (name.clone(), found.components, found.numbers.clone());
            joined = Some(Named { name, components, numbers });
        }
        if let Some(mut joined) = joined {
            joined.numbers = Numbers::from_native(joined.numbers.kind, bytes);
            attributes.add(joined, vertices, warnings)?;
        }
    }
    let points = parts.iter().flat_map(|(points, _)| points.iter()).collect();
    Ok((points, attributes.finish()))
}
