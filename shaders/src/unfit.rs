//! What of a shape no action can draw by the source of its shader.

use volact_core::{Compositing, ParameterType, ParameterValue, SliceStyle, resolve::ResolvedShape};

/// What of a shape does not go with its shader's source, whoever draws it, and the cure; `None` where
/// all does.
pub fn unfit(shape: &ResolvedShape) -> Option<(String, String)> {
    let (declaration, compositing) = (&shape.shader.declaration, shape.compositing());
    let name = &declaration.name;
    let declares = |kind: ParameterType| declaration.parameters.iter().any(|p| p.types.contains(&kind));
    if compositing == Compositing::First && !declares(ParameterType::Table) {
        let what = format!("shader {name:?} of compositing first without a table");
        return Some((what, "declare a table whose control points are the values that are crossed".into()));
    }
    if let Some(slices) = shape.state.geometry.slices() {
        if compositing != Compositing::Over {
            let what = format!("slice planes with shader {name:?} of compositing {}", compositing.name());
            return Some((what, "draw them with a shader of compositing over".into()));
        }
        let length = declaration.parameter("unit_distance").is_some();
        if slices.style == SliceStyle::Blended && !length {
            let what = format!("blended slice planes with shader {name:?}, which declares no unit_distance");
            return Some((what, "declare unit_distance: a plane is as opaque as that length of its medium".into()));
        }
    }
    let component = shape.int("component").filter(|_| declaration.parameter("component").is_some());
    let wanted = component.map_or(0, |c| usize::try_from(c).unwrap_or(usize::MAX));
    shape.parameters.iter().find_map(|(name, value)| {
        let count = match value {
            ParameterValue::Volume(texture) => texture.volume().desc().components,
            ParameterValue::Attribute(attribute) => attribute.components,
            _ => return None,
        };
        let what = format!("component {wanted} of parameter {name:?} with {count}");
        (wanted >= count).then(|| (what, format!("name one of 0 to {}", count - 1)))
    })
}
