//! True pictures, made when asked for and kept for the run: across actions on one lattice, too.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

use volact_core::{FrameDesc, Registry, Shape, glam::DAffine3, glam::DVec3, resolve::ResolvedShape};
use volact_cpu::reference::{ReferencePicture, integrate};

use crate::method::Lattice;

/// Pictures by case, label, lattice and shift.
#[derive(Debug, Default)]
pub struct Truths {
    kept: Mutex<HashMap<String, Arc<ReferencePicture>>>,
}

impl Truths {
    /// The true picture of shapes, moved by `shift` in the world, under a key that no other scene has.
    ///
    /// # Errors
    /// If the reference does not draw them, in words.
    pub fn get(
        &self,
        key: &str,
        registry: &Registry,
        (shapes, desc): (&[Shape], &FrameDesc),
        lattice: Lattice,
        shift: DVec3,
    ) -> Result<Arc<ReferencePicture>, String> {
        let key = format!("{key} {lattice:?} {shift:?}");
        if let Some(found) = self.lock().get(&key) {
            return Ok(Arc::clone(found));
        }
        let picture = Arc::new(draw(registry, shapes, desc, lattice, shift)?);
        self.lock().insert(key, Arc::clone(&picture));
        Ok(picture)
    }

    /// How many pictures were made.
    pub fn len(&self) -> usize {
        self.lock().len()
    }

    /// Whether none was made.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, HashMap<String, Arc<ReferencePicture>>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn draw(
    registry: &Registry,
    shapes: &[Shape],
    desc: &FrameDesc,
    lattice: Lattice,
    shift: DVec3,
) -> Result<ReferencePicture, String> {
    let resolve = |shape: &Shape| {
        let mut resolved = ResolvedShape::new(shape, registry.shaders()).map_err(|e| chain(&e))?;
        if shift != DVec3::ZERO {
            resolved.state.transform = DAffine3::from_translation(shift) * resolved.state.transform;
            resolved.to_object = resolved.state.transform.inverse();
        }
        Ok(resolved)
    };
    let resolved = shapes.iter().map(resolve).collect::<Result<Vec<_>, String>>()?;
    integrate(&resolved, desc, &lattice.options()).map_err(|e| chain(&e))
}

/// An error with its causes on one line.
pub fn chain(error: &dyn std::error::Error) -> String {
    match error.source() {
        Some(cause) => format!("{error}: {}", chain(cause)),
        None => error.to_string(),
    }
}
