//! What any action on a GPU says and refuses in the same words.

use volact_core::{ActionError, Caps, Compositing, resolve::ResolvedShape};

use super::{
    mesh::surface::{self, is_surface},
    scene,
};
use crate::Programs;

/// What an action on a device can do.
pub fn caps(device: &str) -> Caps {
    let builtin = crate::builtin().unwrap_or_default();
    Caps {
        shaders: Some(builtin.into_iter().map(|s| s.declaration.name).chain(["surface".into()]).collect()),
        sources: true,
        geometries: None,
        compositing: Compositing::ALL.to_vec(),
        overlap: true,
        depth: true,
        device: device.into(),
    }
}

/// Refuses what an action cannot draw.
///
/// # Errors
/// [`ActionError::Unsupported`], by name and with a cure, or what is wrong with the shader.
pub fn check(action: &str, shape: &ResolvedShape, programs: &Programs) -> Result<(), ActionError> {
    if is_surface(shape) {
        return surface::check(action, shape);
    }
    programs.of(shape)?;
    match scene::unfit(shape) {
        None => Ok(()),
        Some((what, cure)) => {
            Err(ActionError::Unsupported { action: action.into(), shape: shape.name.clone(), what, cure })
        }
    }
}

/// How shapes were sampled: volumes as `volumes` says, surfaces at their nearest triangle.
pub fn sampling(drawn: &[&ResolvedShape], volumes: &str) -> String {
    let mut all = Vec::new();
    if drawn.iter().any(|s| !is_surface(s)) || drawn.is_empty() {
        all.push(volumes);
    }
    if drawn.iter().any(|s| is_surface(s)) {
        all.push("nearest triangle");
    }
    all.join(", ")
}

/// The names of textures' formats, each once.
pub fn formats(names: impl Iterator<Item = String>) -> String {
    let mut all: Vec<_> = names.collect();
    all.sort();
    all.dedup();
    all.join(", ")
}
