//! Volact's action on GPUs through Vulkan 1.3: slicing.
//!
//! # How it draws
//! Core's [slices](volact_core::slicing) are gathered into *runs*: slabs, one behind the other, of shapes
//! that overlap. A run is one draw: a polygon that covers the pixels that see it. Each fragment sweeps its
//! ray between the run's first plane and its last, in registers and in f32, with the functions that ray
//! casting uses: extinctions of shapes that overlap add, and surfaces of values and slice planes come in
//! their depth. From run to run a pixel's light is kept in a buffer. So the picture is that of ray casting on
//! planes, the ray's early end and the depth included, and no fixed-function blending rounds it. A shape
//! that is one picture, as a maximum, is one run behind all others.
//!
//! # Words
//! | Volact | Vulkan |
//! |---|---|
//! | a managed volume | a sampled 3D image, filled by the transfer queue where there is one |
//! | a shader | SPIR-V from naga, in a graphics pipeline of dynamic rendering without attachments |
//! | a mesh | rows of a storage buffer; its slabs are those of the box around it |
//! | a run of slabs | a render pass of one polygon, and a barrier on the light |
//! | a frame | one submission, waited for through a timeline semaphore |
//!
//! # Known gaps
//! Refused by name, see [`check`]: volumes that meshes carry by texture coordinates, pre-interpolated tables of shaders other
//! than `lut`, and what is no number in a volume where the format has nothing for it; and, once they are seen, meshes whose
//! cells carry numbers and overlap.
//!
//! # Unsafe code
//! Calls of Vulkan are unsafe. They are in `device` (instance, adapter, device), `memory` (buffers and
//! images), `stream` (recording and waiting) and `pipeline`; everything else works with what these give.

pub mod action;
pub mod check;
#[expect(unsafe_code, reason = "Vulkan is called")]
mod device;
mod draw;
#[expect(unsafe_code, reason = "Vulkan is called")]
mod memory;
pub mod options;
#[expect(unsafe_code, reason = "Vulkan is called")]
mod pipeline;
mod readback;
mod resources;
#[expect(unsafe_code, reason = "Vulkan is called")]
mod stream;

use std::sync::Arc;

use volact_core::{Registry, registry::RegisterError};

pub use action::VulkanAction;
pub use device::DeviceError;
pub use options::declaration;

/// Registers the action.
///
/// # Errors
/// If the name is taken.
pub fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    let make = |context: &_, options: &_| Ok(Box::new(VulkanAction::new(context, options)?) as _);
    registry.add_action(declaration(), Arc::new(make))
}
