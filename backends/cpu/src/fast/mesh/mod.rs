//! Meshes of tetrahedra with numbers at their vertices, drawn cell by cell without a lattice.

pub mod build;
pub mod trace;
