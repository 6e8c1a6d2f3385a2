//! The harness of the conformance tests: a rig to draw with, scenes by rule, and metrics.
//!
//! The tests themselves are plain functions in `tests/contract/`, one file a topic. Truth in
//! order: closed form, then the certified `reference`, then `reference` on the action's own
//! lattice. A tolerance says next to it what sets it.

pub mod meshes;
pub mod metrics;
pub mod rig;
pub mod rules;
pub mod scene;
