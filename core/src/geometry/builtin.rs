//! The geometries that come with this crate by name: `block`, `sphere` and `cylinder`.

use std::sync::Arc;

use glam::DVec3;

use super::GeometryError;
use crate::{
    Block, Cylinder, Declaration, Geometry, ParameterDecl, ParameterType, ParameterValue, Sphere,
    parameter::{Kind, ParameterMap},
    registry::GeometryFactory,
};

/// All of them, with what makes them.
pub(crate) fn builtin() -> [(Declaration, GeometryFactory); 3] {
    [
        (block_declaration(), Arc::new(make_block)),
        (sphere_declaration(), Arc::new(make_sphere)),
        (cylinder_declaration(), Arc::new(make_cylinder)),
    ]
}

fn block_declaration() -> Declaration {
    let vec3 = |name, text| ParameterDecl::new(name, ParameterType::Vec3, text).unit("object units").required();
    Declaration::new(Kind::Geometry, "block", env!("CARGO_PKG_VERSION"), "a box along the axes of object space")
        .with(vec3("offset", "its lowest corner"))
        .with(vec3("dimensions", "its lengths"))
}

fn vec3(parameters: &ParameterMap, name: &str) -> DVec3 {
    match parameters.get(name) {
        Some(ParameterValue::Vec3(v)) => *v,
        _ => DVec3::NAN,
    }
}

fn number(parameters: &ParameterMap, name: &str) -> f64 {
    parameters.get(name).and_then(ParameterValue::as_float).unwrap_or(f64::NAN)
}

fn make_block(parameters: &ParameterMap) -> Result<Arc<dyn Geometry>, GeometryError> {
    Ok(Arc::new(Block::new(vec3(parameters, "offset"), vec3(parameters, "dimensions"))?))
}

fn round_declaration(name: &str, text: &str) -> Declaration {
    Declaration::new(Kind::Geometry, name, env!("CARGO_PKG_VERSION"), text)
        .with(ParameterDecl::new("radius", ParameterType::Float, "its radius").unit("object units").required())
        .with(
            ParameterDecl::new("segments", ParameterType::Int, "flat faces around its axis")
                .default(64i64)
                .bounds(3.0, 1024.0),
        )
}

fn sphere_declaration() -> Declaration {
    let text = "a ball, as a polyhedron whose vertices lie on it";
    round_declaration("sphere", text)
        .with(ParameterDecl::new("center", ParameterType::Vec3, "its centre").unit("object units").required())
}

fn make_sphere(parameters: &ParameterMap) -> Result<Arc<dyn Geometry>, GeometryError> {
    let (center, radius) = (vec3(parameters, "center"), number(parameters, "radius"));
    Ok(Arc::new(Sphere::new(center, radius, number(parameters, "segments") as u32)?))
}

fn cylinder_declaration() -> Declaration {
    let text = "a cylinder, as a prism whose edges lie on it";
    let end = |name, text| ParameterDecl::new(name, ParameterType::Vec3, text).unit("object units").required();
    round_declaration("cylinder", text)
        .with(end("start", "one end of its axis"))
        .with(end("end", "the other end of its axis"))
}

fn make_cylinder(parameters: &ParameterMap) -> Result<Arc<dyn Geometry>, GeometryError> {
    let (ends, radius) = ([vec3(parameters, "start"), vec3(parameters, "end")], number(parameters, "radius"));
    Ok(Arc::new(Cylinder::new(ends, radius, number(parameters, "segments") as u32)?))
}
