//! The modules that draw over an application's own picture.

use bytemuck::{Pod, Zeroable};
use naga::{Module, valid::ModuleInfo};
use volact_core::{
    camera::DepthRange,
    glam::{DMat4, DVec4},
};

use super::{
    Anchor, ComposeError,
    compose::{RAY, parse, validate},
};

/// How depths of a buffer become places on rays (`VolactDepths` of limits.wgsl).
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
#[expect(missing_docs, reason = "limits.wgsl says it")]
pub struct DepthNumbers {
    pub z: [f32; 4],
    pub w: [f32; 4],
    pub corner: [u32; 2],
    pub rest: [u32; 2],
}

impl DepthNumbers {
    /// For a buffer that was drawn with a map from world to clip space.
    pub fn new(anchor: &Anchor, world_to_clip: &DMat4, range: DepthRange, corner: [u32; 2]) -> Self {
        let local = *world_to_clip * DMat4::from_translation(anchor.point);
        // Buffers hold 0 to 1 in any case.
        let (z, w) = (local.row(2), local.row(3));
        let z = if range == DepthRange::MinusOneToOne { 0.5 * (z + w) } else { z };
        let single = |v: DVec4| v.as_vec4().to_array();
        Self { z: single(z), w: single(w), corner, rest: [0; 2] }
    }
}

/// The module of the entry point `volact_find_limits`.
///
/// # Errors
/// Never: a test composes it.
pub fn limits() -> Result<(Module, ModuleInfo), ComposeError> {
    made(&[RAY, include_str!("../../wgsl/gpu/limits.wgsl")])
}

/// The module of the entry points `volact_cover` and `volact_lay`.
///
/// # Errors
/// Never: a test composes it.
pub fn onto() -> Result<(Module, ModuleInfo), ComposeError> {
    made(&[include_str!("../../wgsl/gpu/onto.wgsl")])
}

fn made(texts: &[&str]) -> Result<(Module, ModuleInfo), ComposeError> {
    let module = parse("", texts)?;
    let info = validate(&module)?;
    Ok((module, info))
}
