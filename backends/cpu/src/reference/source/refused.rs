//! What of shapes with a program is not drawn.

use volact_core::{
    ActionError, Compositing, ParameterType, ParameterValue, SliceStyle, TableInterpolation, resolve::ResolvedShape,
};
use volact_shaders::Program;

use crate::reference::{
    options::NAME,
    prepare::{check_attributes, tessellate},
};

/// Refuses what cannot be drawn.
///
/// # Errors
/// [`ActionError::Unsupported`], by name and with a cure, or if an attribute does not go with the
/// vertices.
pub(in crate::reference) fn check(shape: &ResolvedShape, program: &Program) -> Result<(), ActionError> {
    match refused(shape, program) {
        Some((what, cure)) => {
            Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure: cure.into() })
        }
        None if shape.state.geometry.vertex_count().is_none() && has_attributes(shape) => {
            check_attributes(shape, &tessellate(shape)?)
        }
        None => Ok(()),
    }
}

/// Whether a shape has numbers at vertices.
pub(super) fn has_attributes(shape: &ResolvedShape) -> bool {
    shape.parameters.values().any(|v| v.kind() == ParameterType::Attribute)
}

fn refused(shape: &ResolvedShape, program: &Program) -> Option<(String, &'static str)> {
    let (name, compositing) = (&shape.shader.declaration.name, program.compositing());
    let geometry = &shape.state.geometry;
    let declares = |kind: ParameterType| program.declaration().parameters.iter().any(|p| p.types.contains(&kind));
    let before =
        |v: &ParameterValue| matches!(v, ParameterValue::Table(t) if t.interpolation() == TableInterpolation::Pre);
    if shape.parameters.values().any(before) {
        let what = format!("a pre-interpolated table in the evaluated shader {name:?}");
        return Some((what, "let it apply after interpolation, or use the shader lut and the option recognise"));
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
        let count = match value {
            ParameterValue::Volume(texture) => texture.volume().desc().components,
            ParameterValue::Attribute(attribute) => attribute.components,
            _ => return None,
        };
        let what = format!("component {wanted} of parameter {name:?} with {count}");
        (wanted >= count).then_some((what, "name a component that is there"))
    })
}
