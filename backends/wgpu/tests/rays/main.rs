//! The action `wgpu`, casting rays: against closed forms and the reference on the same lattice.

mod agreement;
mod common;
mod life;
mod meshes;
mod onto;
