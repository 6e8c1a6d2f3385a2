//! How `vulkan` is called, and the error of a limit.

use volact_core::ActionError;

/// The action's name.
pub const NAME: &str = "vulkan";

/// The error of a limit that is passed.
pub fn limit(what: String, found: String, wanted: String) -> ActionError {
    ActionError::Limit { action: NAME.into(), what, found, wanted }
}
