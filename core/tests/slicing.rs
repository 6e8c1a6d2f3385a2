//! Slicing as backends and applications use it: planes counted, polygons summed, covers and shares.

#[path = "slicing/common.rs"]
mod common;

#[path = "slicing/bad_input.rs"]
mod bad_input;
#[path = "slicing/bricks.rs"]
mod bricks;
#[path = "slicing/cells.rs"]
mod cells;
#[path = "slicing/modes.rs"]
mod modes;
#[path = "slicing/rate.rs"]
mod rate;
