//! Volact with everything built in: one crate to depend on, and the `volact` command.
//!
//! The first page:
//!
//! ```
//! use volact::prelude::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # std::env::set_current_dir(&folder)?;
//! # let header = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n\x00\x40\x80\xff\x00\x40\x80\xff";
//! # std::fs::write("head.nrrd", header)?;
//! # let table = LookupTable::window_level(400.0, 40.0, 0.5)?;
//! let registry = Registry::with_builtins();
//! let volume = registry.load("head.nrrd")?;
//! let shape = Shape::around(&volume, Appearance::new("lut").with("lookup_table", table));
//! let mut action = registry.action("cpu", &Options::default())?;
//! action.manage(&shape)?;
//! action.begin_draw(&FrameDesc::fit(&shape, View::Front, 512, 512))?;
//! action.draw(&shape)?;
//! action.end_draw()?.save("head.png")?;
//! # assert!(std::fs::metadata("head.png")?.len() > 0);
//! # Ok(())
//! # }
//! ```
//!
//! Everything of [`volact_core`] is here under its own name, too. A scene file is drawn with
//! [`scene::Scene::open`] and [`select::select`]; no config is read unless one is asked for.

pub mod metrics;
pub mod save;
pub mod shaders;
pub mod transfer;

pub use volact_core as core;
pub use volact_core::*;

pub use save::{FrameExt, SaveError};

/// What most programs use.
pub mod prelude {
    pub use volact_core::{
        ActionError, Appearance, Block, Camera, ControlPoint, Filter, Frame, FrameDesc, Geometry, LookupTable, Options,
        ParameterValue, Registry, RenderAction, ScalarType, Shape, View, Volume, VolumeDesc, VolumeTexture,
        glam::{DAffine3, DMat4, DVec2, DVec3, DVec4},
    };

    pub use crate::{FrameExt as _, RegistryExt as _};
}

/// What this crate adds to a [`Registry`].
pub trait RegistryExt {
    /// A registry of everything that comes with Volact.
    fn with_builtins() -> Registry;
}

impl RegistryExt for Registry {
    fn with_builtins() -> Registry {
        with_builtins()
    }
}

/// A registry of everything that comes with Volact: core, the CPU actions, with the features `wgpu`
/// and `vulkan` those on GPUs, all loaders, and shaders by their source.
pub fn with_builtins() -> Registry {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry).expect("the names of built-ins are free");
    #[cfg(feature = "wgpu")]
    volact_wgpu::register(&mut registry).expect("the names of built-ins are free");
    #[cfg(feature = "vulkan")]
    volact_vulkan::register(&mut registry).expect("the names of built-ins are free");
    for loader in volact_files::loaders() {
        registry.add_loader(loader).expect("the names of built-ins are free");
    }
    registry.set_shader_check(std::sync::Arc::new(shaders::check));
    shaders::add_builtin(&mut registry).expect("the names of built-ins are free");
    registry
}
