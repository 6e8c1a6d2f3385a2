//! What of a shape no action can draw by the source of its shader.

use volact_core::{
    Compositing, Filter, LookupTable, ParameterType, ParameterValue, SliceStyle, VolumeTexture, mutated,
    resolve::ResolvedShape,
};

/// Numbers that single precision must tell apart between the ends of what a shape shows.
const TOLD_APART: f64 = 4096.0;

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
        (wanted >= count && !mutated!("component_unchecked")).then(|| (what, format!("name one of 0 to {}", count - 1)))
    })
}

/// What of a shape single precision has no digits for, where its source computes with values in data
/// units, and the cure; `None` where it has them.
///
/// Values are compared with the tables that they go through and with one another: fine detail on a large
/// offset (a table from 4e9 to 4e9 + 100, where neighbouring numbers of single precision are 256 apart)
/// would be a picture of few colours. At least 4096 numbers must lie between the ends of each table, and
/// between the lowest and the highest value of each volume; labels, looked up at the nearest sample, must
/// be numbers that single precision has.
pub fn blunt(shape: &ResolvedShape) -> Option<(String, String)> {
    let range = shape.parameters.values().find_map(|value| match value {
        ParameterValue::Volume(texture) => Some(texture.range()),
        _ => None,
    });
    shape.parameters.iter().find_map(|(name, value)| {
        let [low, high] = match value {
            ParameterValue::Volume(texture) => shown(texture)?,
            ParameterValue::Table(table) => ends(table, range.unwrap_or([0.0, 1.0]))?,
            _ => return None,
        };
        let apart = spacing(low.abs().max(high.abs()));
        let what = format!(
            "parameter {name:?} with detail from {low} to {high} in a shader that is evaluated in single precision, \
             whose numbers are {apart} apart there"
        );
        let cure = "take the offset off the values and off the table, or draw with the action reference";
        (high - low < TOLD_APART * apart).then(|| (what, cure.into()))
    })
}

/// The lowest and the highest value of a volume; `None` where single precision has each of its values.
fn shown(texture: &VolumeTexture) -> Option<[f64; 2]> {
    let desc = texture.volume().desc();
    let narrow = desc.scalar.size() <= 2 && desc.intercept.abs() <= 65_536.0 * desc.slope.abs();
    if narrow {
        return None;
    }
    let [low, high] = texture.volume().value_range()?;
    let whole = texture.filter() == Filter::Nearest && low.abs().max(high.abs()) <= f64::from(1 << 24);
    (low < high && !whole).then_some([low, high])
}

/// The first and the last position of a table; `None` where it has but one.
fn ends(table: &LookupTable, range: [f64; 2]) -> Option<[f64; 2]> {
    let points = table.points(range);
    let [low, high] = [points.first()?.value, points.last()?.value];
    (low < high).then_some([low, high])
}

/// From a number to the next one of single precision (IEEE 754 binary32, 24 digits).
fn spacing(value: f64) -> f64 {
    value.max(f64::from(f32::MIN_POSITIVE)).log2().floor().exp2() * f64::from(f32::EPSILON)
}

#[cfg(test)]
mod tests {
    use super::spacing;

    #[test]
    fn spacing_is_that_of_single_precision() {
        for value in [1.0f32, 1.5, 16_777_215.0, 1e7, 4e9, 3e-30, 1e30] {
            let next = f32::from_bits(value.to_bits() + 1);
            assert_eq!(spacing(f64::from(value)), f64::from(next) - f64::from(value), "{value}");
        }
    }
}
