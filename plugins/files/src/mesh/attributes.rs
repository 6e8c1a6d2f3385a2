//! Attributes: numbers of the vertices, of as many tuples as there are vertices.

use std::path::Path;

use volact_core::{Attribute, LoadError, Warning};

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
