//! The fast action where shapes are more than one block: clips, meshes, slices, surfaces, opaque
//! pictures and overlaps.
//!
//! Every scene of one list must agree with `reference` on the same lattice, and must not change by
//! a bit with the order of drawing, the number of threads, or what is skipped.

#[path = "fast/scenes.rs"]
mod scenes;

#[path = "fast/agreement.rs"]
mod agreement;
#[path = "fast/depths.rs"]
mod depths;
#[path = "fast/life.rs"]
mod life;
