//! Plugins for Volact, in Rust: implement the traits that built-ins implement, register what you
//! have in a function, and end with [`export!`].
//!
//! ```
//! use volact_plugin::{
//!     Block, Declaration, ParameterDecl, ParameterType, ParameterValue, Registry,
//!     glam::DVec3, parameter::{Kind, ParameterMap}, registry::RegisterError,
//! };
//!
//! fn register(registry: &mut Registry) -> Result<(), RegisterError> {
//!     let edge = ParameterDecl::new("edge", ParameterType::Float, "its length").default(1.0);
//!     let cube = Declaration::new(Kind::Geometry, "cube", "0.1.0", "a cube at the origin").with(edge);
//!     registry.add_geometry(cube, std::sync::Arc::new(|parameters: &ParameterMap| {
//!         let edge = parameters["edge"].as_float().unwrap_or(1.0);
//!         Ok(std::sync::Arc::new(Block::new(DVec3::ZERO, DVec3::splat(edge))?) as _)
//!     }))
//! }
//!
//! volact_plugin::export!(register);
//! # fn main() {
//! #     let mut registry = Registry::new();
//! #     // SAFETY: the entry is one of the macro.
//! #     let loaded = unsafe { volact_plugin::plugin::host::link(volact_plugin, &mut registry) }.unwrap();
//! #     assert_eq!(loaded.registered[0].name, "cube");
//! #     let cube = registry.geometry("cube", &ParameterMap::from([("edge".into(), ParameterValue::Float(2.0))]));
//! #     assert_eq!(cube.unwrap().bounds().size(), DVec3::splat(2.0));
//! # }
//! ```
//!
//! The crate is a `cdylib`, and an `rlib` too where it shall also be linked statically. A plugin in C
//! uses `include/volact.h`. What the boundary promises is in `docs/plugins.md`.

pub use volact_core::{plugin::parallel_for, *};

/// Exports a plugin: takes the function `fn(&mut Registry) -> Result<(), RegisterError>` that
/// registers everything. Call it once, at the crate's root, as the last line.
///
/// It makes the symbol `volact_plugin_<crate>`, which a host looks for in the library, and the Rust
/// function `volact_plugin` for hosts that link the crate
/// (see [`plugin::host::link`](volact_core::plugin::host::link)). Name, version and description are
/// the crate's.
///
/// A crate built with `panic = "abort"` is refused, since a panic would end the host.
#[macro_export]
macro_rules! export {
    ($register:path $(,)?) => {
        #[cfg(panic = "abort")]
        ::core::compile_error!("a Volact plugin cannot be built with panic = \"abort\": a panic would end its host");

        /// The plugin's entry, for hosts that load or link it.
        ///
        /// # Safety
        /// Both pointers are null or point to tables of the boundary whose sizes are true; the
        /// host's lives as long as the process.
        #[unsafe(export_name = ::core::concat!("volact_plugin_", ::core::env!("CARGO_CRATE_NAME")))]
        pub unsafe extern "C" fn volact_plugin(
            host: *const $crate::plugin::abi::Host,
            answer: *mut $crate::plugin::abi::Answer,
        ) -> i32 {
            static EXPORT: $crate::plugin::guest::Export = $crate::plugin::guest::Export::new(
                ::core::env!("CARGO_CRATE_NAME"),
                ::core::env!("CARGO_PKG_VERSION"),
                ::core::env!("CARGO_PKG_DESCRIPTION"),
                $register,
            );
            // SAFETY: as promised by the caller.
            unsafe { EXPORT.enter(host, answer) }
        }
    };
}
