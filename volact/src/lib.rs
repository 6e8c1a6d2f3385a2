//! Volact with everything built in: one crate to depend on, and the `volact` command.

pub mod metrics;
pub mod transfer;

pub use volact_core as core;
pub use volact_core::*;

/// A registry of everything that comes with Volact: core, the CPU actions and all loaders.
pub fn with_builtins() -> Registry {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry).expect("built-in names are free");
    for loader in volact_files::loaders() {
        registry.add_loader(loader).expect("built-in names are free");
    }
    registry
}
