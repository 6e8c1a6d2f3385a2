//! The cases, a file a topic. [`crate::catalog`] lists them; `stock` is what they share;
//! `orders` lists into the topics whose promise it is.

pub mod cameras;
pub mod changes;
pub mod clipping;
pub mod depth;
pub mod determinism;
pub mod errors;
pub mod formats;
pub mod geometry;
pub mod grids;
pub mod life;
pub mod nan;
pub mod opacity;
pub mod opaque;
pub mod orders;
pub mod overlap;
pub mod sampling;
pub mod shaders;
pub mod slices;
pub mod statistics;
pub mod stock;
pub mod tables;
pub mod transforms;
