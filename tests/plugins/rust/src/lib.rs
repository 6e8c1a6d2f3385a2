//! Plugins in Rust for the tests of the boundary: each kind once, and each call that can panic.

mod action;
mod loader;

use std::{any::Any, sync::Arc};

use volact_plugin::{
    Aabb, Compositing, Declaration, Geometry, ParameterDecl, ParameterType, Points, Registry, ShaderEntry,
    Tessellation,
    geometry::GeometryError,
    glam::DVec3,
    parameter::{Kind, ParameterMap},
    registry::RegisterError,
};

/// What panics with a payload whose drop panics, too.
pub struct Bomb;

impl Drop for Bomb {
    fn drop(&mut self) {
        panic!("in the payload's drop");
    }
}

/// Panics where `mode` names the place: with words, or with a payload that panics when dropped.
pub fn panic_at(mode: &str, place: &str) {
    if mode == place {
        panic!("in {place}");
    }
    if mode.strip_suffix("-bomb") == Some(place) {
        std::panic::panic_any(Bomb);
    }
}

/// The words of a choice.
pub fn word(parameters: &ParameterMap, name: &str) -> String {
    match parameters.get(name) {
        Some(volact_plugin::ParameterValue::Choice(word)) => word.clone(),
        _ => String::new(),
    }
}

/// The option that says what panics.
pub fn mode() -> ParameterDecl {
    ParameterDecl::new("mode", ParameterType::Choice, "what panics").default("nothing")
}

/// A pyramid over a square, cut by hand.
#[derive(Debug)]
struct Pyramid {
    height: f64,
    mode: String,
}

impl Geometry for Pyramid {
    fn name(&self) -> &str {
        "pyramid"
    }

    fn bounds(&self) -> Aabb {
        panic_at(&self.mode, "bounds");
        Aabb::new(DVec3::ZERO, DVec3::new(1.0, 1.0, self.height))
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        panic_at(&self.mode, "tessellate");
        let [o, x, y, z] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z * self.height];
        let vertices = Points::from(vec![o, x, x + y, y, z]);
        let tetrahedra = vec![[0, 1, 2, 4], [0, 2, 3, 4]];
        if self.mode == "damaged" {
            return Err(GeometryError::invalid("pyramid", "mode", "damaged", "another"));
        }
        Ok(Tessellation { vertices, tetrahedra, ..Tessellation::default() })
    }

    fn vertex_count(&self) -> Option<usize> {
        Some(5)
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

fn make_pyramid(parameters: &ParameterMap) -> Result<Arc<dyn Geometry>, GeometryError> {
    let mode = word(parameters, "mode");
    panic_at(&mode, "make");
    let height = parameters["height"].as_float().unwrap_or(f64::NAN);
    if height <= 0.0 {
        return Err(GeometryError::invalid("pyramid", "height", height, "a positive number"));
    }
    Ok(Arc::new(Pyramid { height, mode }))
}

fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    panic_at(&std::env::var("MENAGERIE").unwrap_or_default(), "register");
    let version = env!("CARGO_PKG_VERSION");
    let height = ParameterDecl::new("height", ParameterType::Float, "its height").default(1.0).bounds(-1e9, 1e9);
    let pyramid = Declaration::new(Kind::Geometry, "pyramid", version, "a pyramid").with(height).with(mode());
    registry.add_geometry(pyramid, Arc::new(make_pyramid))?;
    let volume = ParameterDecl::new("volume", ParameterType::Volume, "the data").required();
    let declaration = Declaration::new(Kind::Shader, "glow", version, "the data, glowing").with(volume);
    let entry = ShaderEntry { declaration, compositing: Compositing::Maximum, source: None };
    registry.add_shader_source(entry, include_str!("glow.wgsl"))?;
    action::register(registry)?;
    loader::register(registry)
}

volact_plugin::export!(register);
