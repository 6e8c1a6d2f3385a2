//! Shapes drawn from a shader's text, and the ways to draw them.

use std::sync::Arc;

use volact_core::{
    ActionError, Appearance, Block, Compositing, Declaration, FrameDesc, ParameterDecl, ParameterType, Registry,
    ShaderEntry, ShaderText, Shape, glam::DVec3, parameter::Kind, resolve::ResolvedShape,
};
use volact_cpu::reference::{Method, ReferenceOptions, ReferencePicture, integrate};

/// A shader of a text and the types of its parameters, all needed.
pub fn shader(name: &str, compositing: Compositing, parameters: &[(&str, ParameterType)], text: &str) -> ShaderEntry {
    let needed = |(name, kind): &(&str, ParameterType)| ParameterDecl::new(name, *kind, "a parameter").required();
    let parameters = parameters.iter().map(needed).collect();
    ShaderEntry {
        declaration: Declaration { parameters, ..Declaration::new(Kind::Shader, name, "0", "a test") },
        compositing,
        source: Some(Arc::new(ShaderText { file: format!("{name}.wgsl"), text: text.into() })),
    }
}

/// The shaders of core, those that come as sources and some more.
pub fn registry(more: &[ShaderEntry]) -> Registry {
    let mut registry = Registry::with_core();
    for entry in volact_shaders::builtin().unwrap() {
        if registry.shaders().get(&entry.declaration.name).is_none() {
            registry.add_shader(entry).unwrap();
        }
    }
    more.iter().for_each(|entry| registry.add_shader(entry.clone()).unwrap());
    registry
}

/// A block from a corner to another with a look.
pub fn block(min: DVec3, max: DVec3, look: Appearance) -> Shape {
    Shape::new(Block::new(min, max - min).unwrap(), look)
}

/// Options that evaluate every source.
pub fn evaluated() -> ReferenceOptions {
    ReferenceOptions { recognise: false, ..ReferenceOptions::default() }
}

/// Options of a lattice along rays that evaluate every source.
pub fn lattice(step: f64) -> ReferenceOptions {
    ReferenceOptions { method: Method::Rays, sample_distance: step, ..evaluated() }
}

pub fn try_draw(
    registry: &Registry,
    shapes: &[Shape],
    frame: &FrameDesc,
    options: &ReferenceOptions,
) -> Result<ReferencePicture, ActionError> {
    let resolved: Result<Vec<_>, _> = shapes.iter().map(|s| ResolvedShape::new(s, registry.shaders())).collect();
    integrate(&resolved?, frame, options)
}

pub fn draw(registry: &Registry, shapes: &[Shape], frame: &FrameDesc, options: &ReferenceOptions) -> ReferencePicture {
    try_draw(registry, shapes, frame, options).unwrap_or_else(|e| panic!("{}", told(&e)))
}

/// An error with its causes.
pub fn told(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}

/// The colours of two pictures are the same to `tolerance`.
#[track_caller]
pub fn alike(found: &[[f64; 4]], wanted: &[[f64; 4]], tolerance: f64) {
    assert_eq!(found.len(), wanted.len());
    for (i, (found, wanted)) in found.iter().zip(wanted).enumerate() {
        let off = (0..4).map(|c| (found[c] - wanted[c]).abs()).fold(0.0, f64::max);
        assert!(off <= tolerance, "pixel {i}: {found:?}, wanted {wanted:?}, off by {off:e}");
    }
}

/// The one pixel is the truth to a tolerance, within its enclosure, which is no wider than twice that.
#[track_caller]
pub fn is(found: &ReferencePicture, truth: [f64; 4], tolerance: f64) {
    alike(&found.color[..1], &[truth], tolerance);
    for (c, truth) in truth.into_iter().enumerate() {
        let (low, high) = (found.lower[0][c], found.upper[0][c]);
        assert!(low <= truth + 1e-15 && truth - 1e-15 <= high, "channel {c}: {} not in {low} to {high}", truth);
        assert!(high - low <= 2.0 * tolerance, "channel {c} is {:e} wide", high - low);
    }
}
