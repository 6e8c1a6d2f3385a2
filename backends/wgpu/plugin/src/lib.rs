//! The action `wgpu` as a plugin.
//!
//! `cargo build --release -p volact-wgpu-plugin` makes the library; a host that links this crate hands
//! [`volact_plugin()`] to [`link`](volact_plugin::plugin::host::link). Where the action is built in, too, the
//! config says whose is taken: `names: {"wgpu": "volact-wgpu-plugin"}`.

volact_plugin::export!(volact_wgpu::register);
