//! The action `reference`: f64, cell by cell, with an enclosure for each pixel.

mod action;
mod cells;
mod cubic;
mod dd;
mod flat;
mod knots;
mod lattice;
mod line;
mod march;
mod medium;
mod options;
mod overlap;
mod picture;
mod piece;
mod series;

use std::sync::Arc;

use volact_core::{Registry, registry::RegisterError};

pub use action::ReferenceAction;
pub use options::{Classification, Method, ReferenceOptions, declaration};
pub use picture::{ReferencePicture, check, integrate};

/// Registers the action.
///
/// # Errors
/// If the name is taken.
pub fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    registry
        .add_action(declaration(), Arc::new(|context, options| Ok(Box::new(ReferenceAction::new(context, options)?))))
}
