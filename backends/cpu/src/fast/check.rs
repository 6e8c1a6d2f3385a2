//! What `cpu` draws, and the errors for what it does not.

use volact_core::{ActionError, Caps, Compositing, mutated, resolve::ResolvedShape};

use super::{options::Settings, shaded};

/// The action's name.
pub const NAME: &str = "cpu";
/// Shaders that kernels of their own draw.
pub const SHADERS: [&str; 8] = ["simple", "lut", "mip", "minip", "average", "xray", "attribute", "surface"];

/// What it can do.
pub fn caps(settings: &Settings) -> Caps {
    Caps {
        shaders: Some(SHADERS.map(str::to_owned).to_vec()),
        sources: true,
        geometries: None,
        compositing: Compositing::ALL.to_vec(),
        overlap: true,
        depth: true,
        device: format!("{}, {} threads", settings.unit.name(), settings.threads),
    }
}

/// Refuses what cannot be drawn.
///
/// # Errors
/// [`ActionError::Unsupported`], by name and with a cure.
pub fn check(shape: &ResolvedShape) -> Result<(), ActionError> {
    let unsupported = |what: String, cure: &str| {
        Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure: cure.into() })
    };
    let shader = shape.shader.declaration.name.as_str();
    if shaded::wanted(shape) {
        return match shaded::refused(shape) {
            Some((what, cure)) => unsupported(what, &cure),
            None => Ok(()),
        };
    }
    if !SHADERS.contains(&shader) {
        return unsupported(format!("shader {shader:?}"), &format!("it draws {}", SHADERS.join(", ")));
    }
    let geometry = &shape.state.geometry;
    let (found, is_surface) = (geometry.name(), geometry.as_surface().is_some());
    if (shader == "surface") != is_surface {
        return unsupported(
            format!("geometry {found:?} with shader {shader:?}"),
            "a surface goes with the shader \"surface\", and that with nothing else",
        );
    }
    if geometry.slices().is_some() && shape.compositing() != Compositing::Over {
        return unsupported(
            format!("slice planes with shader {shader:?}"),
            "draw them with a shader of compositing over, such as lut",
        );
    }
    let components = shape
        .volume("volume")
        .map(|t| ("a volume", t.volume().desc().components))
        .or_else(|| shape.attribute("scalars").map(|a| ("scalars", a.components)));
    let wanted = shape.int("component").unwrap_or(0);
    if let Some((what, count)) =
        components.filter(|(_, count)| wanted >= *count as i64 && !mutated!("component_unchecked"))
    {
        return unsupported(
            format!("component {wanted} of {what} with {count}"),
            &format!("name one of 0 to {}", count - 1),
        );
    }
    Ok(())
}
