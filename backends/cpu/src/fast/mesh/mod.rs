//! Meshes of tetrahedra with numbers at their vertices, drawn cell by cell without a lattice.
//!
//! - [`build`]: tetrahedra linked face to face, once for each mesh.
//! - [`project`], [`entries`]: vertices and the way in, for each camera.
//! - [`walk`], [`face`]: sixteen rays from cell to cell; [`shot`] puts these together.
//! - [`numbers`], [`table`], [`bend`], [`integrate`], [`exact`]: what a stretch of a ray inside a
//!   cell adds.
//! - [`trace`]: one ray in f64, for what the vector kernels do not do.

pub mod bend;
pub mod build;
pub mod entries;
pub mod exact;
pub mod face;
pub mod integrate;
pub mod lengths;
pub mod numbers;
pub mod project;
pub mod shot;
pub mod table;
pub mod trace;
pub mod walk;
