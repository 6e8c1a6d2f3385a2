//! The numbers' contract, line by line, one module a topic.

mod cameras;
mod clipping;
mod compositing;
mod extremes;
mod grid;
mod life;
mod memory;
mod meshes;
mod opacity;
mod opaque;
mod orders;
mod overlaps;
mod programs;
mod properties;
mod skipping;
mod slices;
mod sources;
mod tables;
