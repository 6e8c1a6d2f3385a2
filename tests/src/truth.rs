//! True pictures, made when asked for and kept for the run: across actions on one lattice, too.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, PoisonError},
};

use volact_core::{FrameDesc, Registry, Shape, glam::DAffine3, glam::DVec3, resolve::ResolvedShape};
use volact_cpu::reference::{ReferencePicture, integrate};

use crate::{method::Lattice, voxels::Noise};

/// What is changed of a scene, to see what that does to its picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Change {
    /// Shapes are moved by this, in the world.
    pub shift: DVec3,
    /// Voxels are moved by this.
    pub noise: Option<Noise>,
}

/// Pictures by case, label, lattice and change.
#[derive(Debug, Default)]
pub struct Truths {
    kept: Mutex<HashMap<String, Arc<ReferencePicture>>>,
}

impl Truths {
    /// The true picture of shapes that are changed, under a key that no other scene has.
    ///
    /// # Errors
    /// If the reference does not draw them, in words.
    pub fn get(
        &self,
        key: &str,
        registry: &Registry,
        (shapes, desc): (&[Shape], &FrameDesc),
        lattice: Lattice,
        change: &Change,
    ) -> Result<Arc<ReferencePicture>, String> {
        let key = format!("{key} {lattice:?} {change:?}");
        if let Some(found) = self.lock().get(&key) {
            return Ok(Arc::clone(found));
        }
        let picture = Arc::new(draw(registry, shapes, desc, lattice, change)?);
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
    change: &Change,
) -> Result<ReferencePicture, String> {
    let resolve = |shape: &Shape| {
        let mut resolved = ResolvedShape::new(shape, registry.shaders()).map_err(|e| chain(&e))?;
        if let Some(noise) = &change.noise {
            noise.add(&mut resolved);
        }
        if change.shift != DVec3::ZERO {
            resolved.state.transform = DAffine3::from_translation(change.shift) * resolved.state.transform;
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
