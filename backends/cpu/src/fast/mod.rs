//! The action `cpu`: f32 ray casting on all cores.
//!
//! - Midpoint lattice and exact exponential, or pre-integration where the table is too sharp for
//!   the step and the data ([`sharp`]).
//! - Sixteen rays at once on the widest vector unit found ([`simd`]); the same bits on every
//!   unit with fused multiply-add, and for any number of threads.
//! - Transparent space is skipped ([`bounds`]) and rays end when nothing is left to see; neither
//!   skipping nor its absence changes a bit.
//! - A ray may have several stretches in a shape ([`stretches`]): clips cut them, and meshes
//!   carve them ([`part`]). Surfaces and the application's picture end rays ([`limits`]).
//! - Shapes that no ray meets at the same place are drawn one after the other ([`order`]);
//!   others are put together by their extinctions ([`sweep`]), the same in any order of drawing.
//! - Numbers at the vertices of a mesh are integrated cell by cell, without a lattice ([`mesh`]).

pub mod action;
pub mod bent;
pub mod bounds;
pub mod carve;
pub mod check;
pub mod classify;
pub mod direct;
pub mod dispatch;
pub mod fetch;
pub mod flat;
pub mod integrals;
pub mod limits;
pub mod medium;
pub mod mesh;
pub mod method;
pub mod options;
pub mod order;
pub mod over;
pub mod packet;
pub mod part;
pub mod picture;
pub mod plan;
pub mod power;
pub mod preintegrate;
pub mod reduce;
pub mod resources;
pub mod shaded;
pub mod sharp;
pub mod shear;
pub mod simd;
pub mod slopes;
pub mod stretches;
pub mod surface;
pub mod sweep;
pub mod walk;

use std::sync::Arc;

use volact_core::{Registry, registry::RegisterError};

/// Registers the action.
///
/// # Errors
/// If the name is taken.
pub fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    let factory = |context: &_, options: &_| {
        let action: Box<dyn volact_core::RenderAction> = Box::new(action::CpuAction::new(context, options)?);
        Ok(action)
    };
    registry.add_action(options::declaration(), Arc::new(factory))
}
