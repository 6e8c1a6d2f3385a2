//! What `wgpu` draws, and the errors for what it does not.

use volact_core::{
    ActionError, Caps, Compositing, ParameterType, ParameterValue, SliceStyle, TableInterpolation,
    resolve::ResolvedShape,
};
use volact_shaders::Program;

/// The action's name.
pub const NAME: &str = "wgpu";

/// The most stretches that clips may leave of a ray.
pub const SPANS: u32 = 16;

/// What it can do.
pub fn caps(device: &str) -> Caps {
    let builtin = volact_shaders::builtin().unwrap_or_default();
    Caps {
        shaders: Some(builtin.into_iter().map(|s| s.declaration.name).filter(|n| n != "attribute").collect()),
        sources: true,
        geometries: Some(vec!["block".into()]),
        compositing: vec![
            Compositing::Over,
            Compositing::Maximum,
            Compositing::Minimum,
            Compositing::Average,
            Compositing::Add,
            Compositing::First,
        ],
        overlap: true,
        depth: true,
        device: device.into(),
    }
}

/// Refuses what cannot be drawn.
///
/// # Errors
/// [`ActionError::Unsupported`], by name and with a cure.
pub fn check(shape: &ResolvedShape, program: &Program) -> Result<(), ActionError> {
    match refused(shape, program) {
        None => Ok(()),
        Some((what, cure)) => {
            Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure: cure.into() })
        }
    }
}

fn refused(shape: &ResolvedShape, program: &Program) -> Option<(String, &'static str)> {
    let (name, compositing) = (&shape.shader.declaration.name, program.compositing());
    let geometry = &shape.state.geometry;
    let declares = |kind: ParameterType| program.declaration().parameters.iter().any(|p| p.types.contains(&kind));
    if geometry.as_block().is_none() {
        return Some((format!("geometry {:?}", geometry.name()), "draw it with the action cpu, or take a block"));
    }
    for (parameter, value) in &shape.parameters {
        match value {
            ParameterValue::Table(t) if t.interpolation() == TableInterpolation::Pre => {
                return Some((
                    format!("the pre-interpolated table {parameter:?}"),
                    "let it apply after interpolation, or draw with the action cpu",
                ));
            }
            ParameterValue::Attribute(_) => {
                return Some((format!("the attribute {parameter:?}"), "draw it with the action cpu"));
            }
            _ => {}
        }
    }
    if compositing == Compositing::First && !declares(ParameterType::Table) {
        let what = format!("shader {name:?} of compositing first without a table");
        return Some((what, "declare a table whose control points are the values that are crossed"));
    }
    if let Some(slices) = geometry.slices() {
        if compositing != Compositing::Over {
            let what = format!("slice planes with shader {name:?} of compositing {}", compositing.name());
            return Some((what, "draw them with a shader of compositing over"));
        }
        let length = program.declaration().parameter("unit_distance").is_some();
        if slices.style == SliceStyle::Blended && !length {
            let what = format!("blended slice planes with shader {name:?}, which declares no unit_distance");
            return Some((what, "declare unit_distance: a plane is as opaque as that length of its medium"));
        }
    }
    let component = shape.int("component").filter(|_| program.declaration().parameter("component").is_some());
    let wanted = component.map_or(0, |c| usize::try_from(c).unwrap_or(usize::MAX));
    shape.parameters.iter().find_map(|(name, value)| {
        let ParameterValue::Volume(texture) = value else { return None };
        let count = texture.volume().desc().components;
        let what = format!("component {wanted} of parameter {name:?} with {count}");
        (wanted >= count).then_some((what, "name a component that is there"))
    })
}
