//! Plugins: libraries built apart, found by name, behind an interface in C.
//!
//! - [`abi`] is the interface, as plain data: the C header is generated from it.
//! - [`host`] finds and loads libraries and wraps what they register as core's own traits, so that
//!   nobody downstream sees a difference.
//! - [`guest`] is the other side: it makes the tables out of implementations of the same traits.
//!   Authors use it through the crate `volact-plugin`.
//!
//! Both sides share how values cross: `value` (parameters), `array` (bulk data), `declare`,
//! `geometry`, `shape` (shapes and frames), `picture` (what comes back). Bulk data is shared and
//! never copied; a panic stops at the side where it arose; the floating-point state is restored
//! after every call. What cannot be survived is an abort, a stack overflow and memory that a
//! plugin damages.

pub mod abi;
mod arena;
mod array;
mod declare;
mod float;
mod geometry;
pub mod guest;
pub mod host;
mod picture;
#[cfg(test)]
mod round_trip;
mod services;
mod shape;
mod status;
mod value;

pub use float::FloatState;
pub use services::parallel_for;
pub use status::{Code, Fault, PluginError};
