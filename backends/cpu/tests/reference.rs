//! The reference against closed forms, an independent integration, and itself.
//!
//! Truth here is either a formula or tanh-sinh quadrature of the definition, written without
//! anything of the reference: see `common/mod.rs`.

#[path = "reference/common.rs"]
mod common;

#[path = "reference/clips.rs"]
mod clips;
#[path = "reference/closed_forms.rs"]
mod closed_forms;
#[path = "reference/cubic_cells.rs"]
mod cubic_cells;
#[path = "reference/flat.rs"]
mod flat;
#[path = "reference/invariance.rs"]
mod invariance;
#[path = "reference/lattice.rs"]
mod lattice;
#[path = "reference/life.rs"]
mod life;
#[path = "reference/mesh.rs"]
mod mesh;
#[path = "reference/mesh_common.rs"]
mod mesh_common;
#[path = "reference/mesh_volume.rs"]
mod mesh_volume;
#[path = "reference/opaque.rs"]
mod opaque;
#[path = "reference/realistic.rs"]
mod realistic;
#[path = "reference/slices.rs"]
mod slices;
#[path = "reference/source_common.rs"]
mod source_common;
#[path = "reference/source_flat.rs"]
mod source_flat;
#[path = "reference/source_mesh.rs"]
mod source_mesh;
#[path = "reference/source_over.rs"]
mod source_over;
#[path = "reference/source_refused.rs"]
mod source_refused;
#[path = "reference/source_scene.rs"]
mod source_scene;
#[path = "reference/surfaces.rs"]
mod surfaces;
