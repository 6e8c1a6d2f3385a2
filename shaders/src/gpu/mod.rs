//! Shaders composed for GPUs: from checked programs and the texts of a stage to one module that any
//! of naga's backends turns into a device's language.
//!
//! 1. A [`Recipe`] says what of a shape a module depends on: its program, and how its volumes are read.
//! 2. [`Layout`] says where the numbers of each parameter lie, and which texture is bound where.
//! 3. [`compose`] imports the author's functions into one module under a prefix each, with real
//!    functions in place of the stubs of parameters, and a budget for loops.
//! 4. [`pack`] writes a shape's numbers into their rows, [`table`] a lookup table, [`voxels`] says how
//!    voxels lie in a texture, [`skip`] where nothing can be seen, [`mesh`] where meshes are,
//!    [`onto`] how a picture is laid over an application's; [`scene`] does so for all shapes of a frame, and
//!    [`runs`] says what a rasteriser draws of them.
//!
//! # Bindings
//! Group 0: 0 the frame ([`FrameNumbers`], uniform), 1 rows of numbers (uniform), 2 rows of tables, 3 what the
//! application has drawn, 4 pixels, 5 depths, 6 flags: the shape whose loop overran its budget, plus 1;
//! then 64 counts of samples and 64 of rays, whether the device has cut a loop short, 64 counts of what was
//! skipped, and the shape whose cells carry numbers and overlap, plus 1; 7 what can be skipped; 8 rows of
//! meshes. Group 1: 0 a sampler, then the volumes' textures. Slabs have 4 for pixels' light, and no 5.
//!
//! All numbers are f32 in [local space](crate::signatures), the origin near the shape.

pub mod action;
mod compose;
#[cfg(feature = "mutations")]
mod faults;
mod frame;
mod layout;
mod merge;
pub mod mesh;
pub mod onto;
pub mod pack;
pub mod runs;
pub mod scene;
pub mod skip;
pub mod table;
pub mod voxels;

pub use compose::{Composition, compose, compose_slices, finish};
pub use frame::{Anchor, FrameNumbers};
pub use layout::{Layout, Recipe, Slot, VolumeUse, is_deep};

use thiserror::Error;

/// Rows of numbers for each shape, before those of parameters.
pub const SHAPE_ROWS: u32 = 8;

/// Counters of samples, and as many of rays and of what was skipped.
pub const COUNTERS: usize = 64;

/// Words of the flags' buffer.
pub const FLAGS: usize = 3 + 3 * COUNTERS;

/// The flag that is not 0 where the device has cut a loop short.
pub const CUT_FLAG: usize = 1 + 2 * COUNTERS;

/// The flag of the shape, plus 1, whose cells carry numbers and overlap.
pub const OVERLAP_FLAG: usize = 2 + 3 * COUNTERS;

/// Rows of numbers that a module can read.
pub const MOST_ROWS: usize = 4096;

/// Invocations of a workgroup along each axis.
pub const WORKGROUP: u32 = 8;

/// Why shaders cannot be put together.
#[derive(Debug, Error)]
#[error("shaders cannot be composed: {what}")]
pub struct ComposeError {
    what: String,
}

impl ComposeError {
    pub(crate) fn inner(what: impl Into<String>) -> Self {
        Self { what: what.into() }
    }
}
