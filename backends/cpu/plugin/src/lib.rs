//! The actions `cpu` and `reference` as a plugin.
//!
//! `cargo build --release -p volact-cpu-plugin` makes the library; a host that links this crate hands
//! [`volact_plugin()`] to [`link`](volact_plugin::plugin::host::link). Where the actions are built in, too, the
//! config says whose are taken: `names: {"cpu": "volact-cpu-plugin", "reference": "volact-cpu-plugin"}`.

volact_plugin::export!(volact_cpu::register);
