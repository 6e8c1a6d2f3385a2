//! The action `wgpu`, by rays and by slices: against closed forms and the reference on the same lattice.

mod agreement;
mod bands;
mod common;
mod life;
mod meshes;
mod onto;
