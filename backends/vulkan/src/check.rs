//! What `vulkan` draws, and the errors for what it does not.

use volact_core::{ActionError, Caps, Compositing, ParameterValue, TableInterpolation, resolve::ResolvedShape};
use volact_shaders::{blunt, unfit};

/// The action's name.
pub const NAME: &str = "vulkan";

const INSTEAD: &str = "draw it with the action cpu";

/// What it can do.
pub fn caps(device: &str) -> Caps {
    let builtin = volact_shaders::builtin().unwrap_or_default();
    Caps {
        shaders: Some(builtin.into_iter().map(|s| s.declaration.name).filter(|n| n != "attribute").collect()),
        sources: true,
        geometries: Some(vec!["block".into()]),
        compositing: Compositing::ALL.to_vec(),
        overlap: true,
        depth: true,
        device: device.into(),
    }
}

/// Refuses what cannot be drawn.
///
/// # Errors
/// [`ActionError::Unsupported`], by name and with a cure.
pub fn check(shape: &ResolvedShape) -> Result<(), ActionError> {
    match refused(shape) {
        None => Ok(()),
        Some((what, cure)) => {
            Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure })
        }
    }
}

fn refused(shape: &ResolvedShape) -> Option<(String, String)> {
    let geometry = &shape.state.geometry;
    if geometry.as_block().is_none() {
        return Some((format!("geometry {:?}", geometry.name()), INSTEAD.into()));
    }
    for (parameter, value) in &shape.parameters {
        match value {
            ParameterValue::Table(t) if t.interpolation() == TableInterpolation::Pre => {
                let cure = "let it apply after interpolation, or draw with the action cpu";
                return Some((format!("the pre-interpolated table {parameter:?}"), cure.into()));
            }
            ParameterValue::Attribute(_) => return Some((format!("the attribute {parameter:?}"), INSTEAD.into())),
            _ => {}
        }
    }
    unfit(shape).or_else(|| blunt(shape))
}

/// The error of a limit that is passed.
pub fn limit(what: String, found: String, wanted: String) -> ActionError {
    ActionError::Limit { action: NAME.into(), what, found, wanted }
}
