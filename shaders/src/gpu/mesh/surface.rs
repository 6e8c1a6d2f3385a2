//! Surfaces as rows: triangles under a tree, and where vertices have them, normals.

use volact_core::{
    ActionError, Clip, ParameterValue, Surface,
    glam::{DAffine3, DVec3},
    parameter::{ParameterProblem, ProblemKind},
    resolve::ResolvedShape,
};

use super::{
    Meshes, Row,
    tree::{self, row},
};
use crate::gpu::{Anchor, SHAPE_ROWS, pack};

/// Whether a shape is opaque triangles.
pub fn is_surface(shape: &ResolvedShape) -> bool {
    shape.state.shader == "surface" || shape.state.geometry.as_surface().is_some()
}

/// Refuses a surface without the shader `surface`, that with anything else, and light from nowhere.
///
/// # Errors
/// [`ActionError::Unsupported`] of an action, or the parameter that is wrong.
pub fn check(action: &str, shape: &ResolvedShape) -> Result<(), ActionError> {
    let (shader, geometry) = (shape.state.shader.clone(), &shape.state.geometry);
    if geometry.as_surface().is_none() || shader != "surface" {
        return Err(ActionError::Unsupported {
            action: action.into(),
            shape: shape.name.clone(),
            what: format!("geometry {:?} with shader {shader:?}", geometry.name()),
            cure: "a surface goes with the shader \"surface\", and that with nothing else".into(),
        });
    }
    match shape.parameters.get("lightdir") {
        Some(ParameterValue::Vec3(v)) if v.try_normalize().is_none() => {
            let kind = ProblemKind::Mistyped { found: "without length".into(), wanted: "a direction".into() };
            let problems = vec![ParameterProblem { name: "lightdir".into(), kind }];
            Err(ActionError::Parameters { shape: shape.name.clone(), shader, problems })
        }
        _ => Ok(()),
    }
}

/// A surface's rows, in the space of `unit`.
pub(super) fn packed(surface: &Surface, unit: &DAffine3) -> Vec<Row> {
    let single = |v: DVec3| v.as_vec3().to_array();
    let places: Vec<[f32; 3]> = surface.points().iter().map(|v| single(unit.transform_point3(v))).collect();
    let mut rows = tree::triangles(surface.triangles(), &places);
    rows[1][3] = rows.len() as u32;
    // Normals are covectors: they go by the inverse transpose.
    let to_mesh = unit.matrix3.inverse().transpose();
    let normals: Vec<DVec3> = surface.normals().into_iter().flat_map(|n| n.iter()).map(|n| to_mesh * n).collect();
    // They keep their lengths against each other, by which they count between vertices.
    let longest = normals.iter().fold(0.0, |m: f64, n| m.max(n.length()));
    let scale = if longest > 0.0 && longest.is_finite() { 1.0 / longest } else { 0.0 };
    rows.extend(normals.into_iter().map(|n| row(single(n * scale), 0)));
    rows
}

/// Writes surfaces behind other rows; gives their numbers: the first, and the one after the last.
pub fn write(
    rows: &mut Vec<Row>,
    surfaces: &[&ResolvedShape],
    anchor: &Anchor,
    clip: &Clip,
    meshes: &Meshes,
) -> [u32; 2] {
    let each = SHAPE_ROWS as usize;
    rows.resize(rows.len().next_multiple_of(each), [0; 4]);
    let first = rows.len() / each;
    rows.resize(rows.len() + each * surfaces.len(), [0; 4]);
    for (i, shape) in surfaces.iter().enumerate() {
        if let Some(placed) = meshes.placed(shape) {
            let bounds = shape.state.world_bounds();
            let origin = 0.5 * (bounds.min + bounds.max);
            let own = own_rows(shape, anchor, origin, &placed);
            let at = each * (first + i);
            rows[at..at + each].copy_from_slice(&own);
            rows[at + 4] =
                pack::write_clips(rows, &[&shape.state.clip.transformed(&shape.state.transform), clip], origin);
        }
    }
    [first as u32, (first + surfaces.len()) as u32]
}

fn own_rows(shape: &ResolvedShape, anchor: &Anchor, origin: DVec3, placed: &super::Placed) -> [Row; 8] {
    let mut own = [[0; 4]; 8];
    own[0] = pack::float3(anchor.point - origin, shape.float("ambient").unwrap_or(0.2));
    pack::write_affine(&mut own, 1, &(placed.unit * shape.to_object * DAffine3::from_translation(origin)));
    let color = match shape.parameters.get("color") {
        Some(ParameterValue::Color([r, g, b, _])) => DVec3::new(*r, *g, *b),
        _ => DVec3::splat(0.8),
    };
    let light = match shape.parameters.get("lightdir") {
        Some(ParameterValue::Vec3(v)) => v.try_normalize(),
        _ => None,
    };
    own[5] = pack::float3(color, f64::from(u8::from(light.is_some())));
    own[6] = pack::float3(light.unwrap_or_default(), 0.0);
    let smooth = shape.state.geometry.as_surface().is_some_and(|s| s.normals().is_some());
    own[7] = [0, placed.row, u32::from(smooth), 0];
    own
}
