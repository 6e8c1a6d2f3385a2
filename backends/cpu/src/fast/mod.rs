//! The action `cpu`.

use volact_core::{Registry, registry::RegisterError};

/// Registers the action.
///
/// # Errors
/// If the name is taken.
pub fn register(_registry: &mut Registry) -> Result<(), RegisterError> {
    Ok(())
}
