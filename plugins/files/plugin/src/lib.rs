//! The loaders of `volact-files` as a plugin.
//!
//! `cargo build --release -p volact-files-plugin` makes the library; a host that links this crate hands
//! [`volact_plugin()`] to [`link`](volact_plugin::plugin::host::link). Where the loaders are built in, too, the
//! config says whose are taken: `names: {"nrrd": "volact-files-plugin"}`, and so for each.

volact_plugin::export!(volact_files::register);
