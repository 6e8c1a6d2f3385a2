//! The action `cpu`: f32 ray casting on all cores.
//!
//! - Midpoint lattice and exact exponential, or pre-integration where the table is too sharp for
//!   the step and the data ([`sharp`]).
//! - Sixteen rays at once on the widest vector unit found ([`simd`]); the same bits on every
//!   unit with fused multiply-add, and for any number of threads.
//! - Transparent space is skipped ([`bounds`]) and rays end when nothing is left to see; neither
//!   skipping nor its absence changes a bit.
//! - What the vector kernels do not do (overlapping shapes, pre-interpolated tables, `simple`) is
//!   drawn ray by ray in f64 ([`general`]).
//!
//! Geometries other than blocks are not drawn yet: an error says so.

pub mod action;
pub mod bent;
pub mod bounds;
pub mod check;
pub mod classify;
pub mod direct;
pub mod dispatch;
pub mod fetch;
pub mod flat;
pub mod limits;
pub mod medium;
pub mod method;
pub mod mesh;
pub mod options;
pub mod order;
pub mod over;
pub mod packet;
pub mod part;
pub mod picture;
pub mod plan;
pub mod preintegrate;
pub mod reduce;
pub mod resources;
pub mod sharp;
pub mod simd;
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
