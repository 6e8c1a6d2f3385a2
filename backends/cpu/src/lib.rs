//! Two render actions on the CPU.
//!
//! - [`mod@reference`]: f64, cell by cell, with an enclosure for each pixel. Slow, plain and right.
//! - [`fast`]: the action `cpu`: f32, all cores, the widest vector unit found.
//!
//! `volact-cpu-plugin`, beside this crate, is both as a plugin: a library to load, and an entry to link.

pub mod fast;
pub mod reference;

use volact_core::{Registry, registry::RegisterError};

/// Registers both actions.
///
/// # Errors
/// If a name is taken.
pub fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    reference::register(registry)?;
    fast::register(registry)
}
