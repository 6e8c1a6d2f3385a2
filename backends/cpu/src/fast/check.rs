//! What `cpu` draws, and the errors for what it does not.

use volact_core::{ActionError, Caps, Compositing, resolve::ResolvedShape};

use super::options::Settings;

/// The action's name.
pub const NAME: &str = "cpu";
const SHADERS: [&str; 6] = ["simple", "lut", "mip", "minip", "average", "xray"];

/// What it can do.
pub fn caps(settings: &Settings) -> Caps {
    Caps {
        shaders: Some(SHADERS.map(str::to_owned).to_vec()),
        geometries: Some(vec!["block".into()]),
        compositing: vec![
            Compositing::Over,
            Compositing::Maximum,
            Compositing::Minimum,
            Compositing::Average,
            Compositing::Add,
        ],
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
    if !SHADERS.contains(&shader) {
        return unsupported(format!("shader {shader:?}"), &format!("it draws {}", SHADERS.join(", ")));
    }
    if shape.state.geometry.as_block().is_none() {
        return unsupported(format!("geometry {:?}", shape.state.geometry.name()), "it draws blocks");
    }
    if let Some(texture) = shape.volume("volume") {
        let components = texture.volume().desc().components;
        let wanted = shape.int("component").unwrap_or(0);
        if wanted >= components as i64 {
            return unsupported(
                format!("component {wanted} of a volume with {components}"),
                &format!("name one of 0 to {}", components - 1),
            );
        }
    }
    if matches!(shape.compositing(), Compositing::First) {
        return unsupported("compositing first".into(), "it draws over, maximum, minimum, average and add");
    }
    Ok(())
}
