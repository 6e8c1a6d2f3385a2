//! What the formats of meshes share: vertices, cells and attributes, checked and named in errors.

mod attributes;
mod cells;
mod structured;
mod surface;
mod vertices;

use std::path::Path;

use volact_core::{LoadError, Progress, Warning, WarningCode};

use crate::{payload::advance, storage::Storage};

pub(crate) use attributes::{Attributes, Named, merge};
pub(crate) use cells::{CellArrays, CellLayout, Cells, codes, mesh_of};
pub(crate) use structured::{Blanking, GHOST_CELL, GHOSTS, HIDDEN_POINT, flags, hexahedra, structured};
pub(crate) use surface::Triangles;
pub(crate) use vertices::{Joined, check_count, finite_points};

/// A warning about a file's content.
pub(crate) fn note(file: &str, message: impl Into<String>) -> Warning {
    Warning::new(WarningCode::FileContent, file, message)
}

/// Progress in equal steps, counted in the file's bytes.
pub(crate) struct Meter<'a> {
    path: &'a Path,
    progress: &'a dyn Progress,
    total: u64,
    steps: u64,
    done: u64,
}

impl<'a> Meter<'a> {
    pub(crate) fn new(
        storage: &Storage,
        path: &'a Path,
        progress: &'a dyn Progress,
        steps: usize,
    ) -> Result<Self, LoadError> {
        Ok(Self { path, progress, total: storage.length(path)?, steps: steps.max(1) as u64, done: 0 })
    }

    /// A step is done.
    pub(crate) fn step(&mut self) -> Result<(), LoadError> {
        self.done = (self.done + 1).min(self.steps);
        self.tell(0, 1)
    }

    /// So many of the file's bytes are read.
    pub(crate) fn at(&self, bytes: usize) -> Result<(), LoadError> {
        self.tell(bytes as u64, self.total.max(1) + 1)
    }

    /// So much of the step under way is done.
    pub(crate) fn tell(&self, part: u64, of: u64) -> Result<(), LoadError> {
        let share = self.done as f64 + part.min(of) as f64 / of.max(1) as f64;
        let done = (self.total as f64 * share / self.steps as f64) as u64;
        let done = if self.done == self.steps { self.total } else { done.min(self.total) };
        advance(self.path, self.progress, done, self.total)
    }
}
