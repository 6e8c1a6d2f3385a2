//! What `vulkan` draws, and the errors for what it does not.

use volact_core::{ActionError, Caps, Compositing, resolve::ResolvedShape};
use volact_shaders::{
    Programs,
    gpu::{mesh::surface, scene},
};

/// The action's name.
pub const NAME: &str = "vulkan";

/// What it can do.
pub fn caps(device: &str) -> Caps {
    let builtin = volact_shaders::builtin().unwrap_or_default();
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

/// Refuses what cannot be drawn.
///
/// # Errors
/// [`ActionError::Unsupported`], by name and with a cure, or what is wrong with the shader.
pub fn check(shape: &ResolvedShape, programs: &Programs) -> Result<(), ActionError> {
    if surface::is_surface(shape) {
        return surface::check(NAME, shape);
    }
    programs.of(shape)?;
    match scene::unfit(shape) {
        None => Ok(()),
        Some((what, cure)) => {
            Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure })
        }
    }
}

/// The error of a limit that is passed.
pub fn limit(what: String, found: String, wanted: String) -> ActionError {
    ActionError::Limit { action: NAME.into(), what, found, wanted }
}
