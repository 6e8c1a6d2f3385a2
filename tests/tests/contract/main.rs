//! The numbers' contract, line by line, one module a topic.

mod cameras;
mod compositing;
mod extremes;
mod grid;
mod life;
mod memory;
mod opacity;
mod orders;
mod properties;
mod skipping;
mod tables;
