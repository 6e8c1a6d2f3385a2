//! The action `wgpu`: Vulkan, Metal or Direct3D 12 through one interface.
//!
//! # How core's words map to the device's
//! | word | here |
//! |---|---|
//! | volume | a 3D texture of the whole data, one for all shapes that show it ([`resources`]) |
//! | lookup table | rows of a storage buffer, control points at any places, found by buckets |
//! | shader | the author's functions merged into one module ([`volact_shaders::gpu`], [`pipeline`]) |
//! | mesh | rows of one storage buffer: the boundary's faces under a tree, cells where they carry numbers |
//! | frame | a submission for each band of rows ([`bands`]), of one invocation a pixel, summed in f32 registers ([`draw`], [`readback`]), or of runs of slabs ([`slabs`]) |
//!
//! Everything that a frame needs is kept and compared with what is there at `begin_draw`: voxels by
//! identity and version, rows of numbers and tables by content. A changed table moves its own rows, a
//! changed shader makes a pipeline and moves no voxel, and a frame like the last creates nothing.
//!
//! # Rays or slices
//! Option `method`: `rays` casts rays in a compute stage, `slices` draws runs of slabs in a fragment stage, which is what
//! the action `vulkan` does. Both draw everything that is drawn here, sum in f32 and skip empty space; their lattices
//! differ in perspective, as those of `reference` by rays and on planes do. `auto` is to be the faster one, and
//! that was `rays` wherever both were measured, on software and for all classes of scenes; data-centre GPUs can be
//! 30 times slower in fragment stages than in compute stages. So it is `rays` on every adapter.
//! The example `methods` measures both.
//!
//! # Precision
//! Places are counted in f32 from an anchor that the host finds in f64 ([`volact_shaders::gpu::Anchor`]).
//! A sample's place has an error of some 2⁻²² of the scene's size, wherever in the world it lies and
//! however far away the eye is. Shapes of one frame that lie some 10⁶ times their size apart along a ray
//! lose digits. Interpolation has exact weights unless the option `filter` says `hardware`.
//!
//! # Known gaps
//! Volumes that meshes carry by texture coordinates, and pre-interpolated tables of shaders other than `lut`, are refused by
//! name; so are, once they are seen, meshes whose cells carry numbers and overlap. A submission is bounded by how many
//! samples it takes ([`bands`]), not by how long they take.

mod action;
pub mod bands;
pub mod device;
pub mod draw;
mod method;
pub mod onto;
mod options;
pub mod pipeline;
mod plan;
pub mod readback;
pub mod resources;
mod skip;
pub mod slabs;

pub use action::WgpuAction;
pub use onto::{Onto, OntoDepth};
pub use options::declaration;

use std::sync::Arc;

use volact_core::{Registry, registry::RegisterError};

/// The action's name.
pub const NAME: &str = "wgpu";

/// Registers the action.
///
/// # Errors
/// If its name is taken.
pub fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    registry.add_action(declaration(), Arc::new(|context, options| Ok(Box::new(WgpuAction::new(context, options)?))))
}
