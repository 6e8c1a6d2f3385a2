//! What of shapes with a program is not drawn.

use volact_core::{ActionError, ParameterType, ParameterValue, TableInterpolation, resolve::ResolvedShape};
use volact_shaders::unfit;

use crate::reference::{
    options::NAME,
    prepare::{check_attributes, tessellate},
};

/// Refuses what cannot be drawn.
///
/// # Errors
/// [`ActionError::Unsupported`], by name and with a cure, or if an attribute does not go with the
/// vertices.
pub(in crate::reference) fn check(shape: &ResolvedShape) -> Result<(), ActionError> {
    match refused(shape) {
        Some((what, cure)) => {
            Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure })
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

fn refused(shape: &ResolvedShape) -> Option<(String, String)> {
    let name = &shape.shader.declaration.name;
    let before =
        |v: &ParameterValue| matches!(v, ParameterValue::Table(t) if t.interpolation() == TableInterpolation::Pre);
    if shape.parameters.values().any(before) {
        let what = format!("a pre-interpolated table in the evaluated shader {name:?}");
        return Some((what, "let it apply after interpolation, or use the shader lut and the option recognise".into()));
    }
    unfit(shape)
}
