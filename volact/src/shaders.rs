//! Shaders by their source: those that come with Volact, and those of folders.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use thiserror::Error;
use volact_core::{Registry, registry::RegisterError};
use volact_shaders::ShaderError;

/// Why shaders of a folder are not registered.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum AddShaderError {
    /// The folder cannot be read.
    #[error("{}: cannot be read", path.display())]
    Io {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A shader is wrong.
    #[error(transparent)]
    Shader(#[from] ShaderError),
    /// Its name is taken.
    #[error("{}", path.display())]
    Taken {
        /// The shader's file.
        path: PathBuf,
        /// By whom.
        source: RegisterError,
    },
}

/// Registers the shaders that come with Volact as sources, beside those of core.
///
/// # Errors
/// If a name is taken.
pub fn add_builtin(registry: &mut Registry) -> Result<(), RegisterError> {
    let shipped = volact_shaders::builtin().unwrap_or_default();
    for entry in shipped {
        if registry.shaders().get(&entry.declaration.name).is_none() {
            registry.add_shader(entry)?;
        }
    }
    Ok(())
}

/// Registers the shaders of a folder: each `name.wgsl` with its `name.ron`. A folder with neither
/// adds nothing.
///
/// # Errors
/// The first shader that is wrong or whose name is taken; those before it are registered.
pub fn add_folder(registry: &mut Registry, folder: &Path) -> Result<(), AddShaderError> {
    let io = |source| AddShaderError::Io { path: folder.into(), source };
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let file = entry.map_err(io)?.path();
        if file.extension().is_some_and(|e| e == "wgsl") && file.is_file() {
            files.push(file);
        }
    }
    files.sort();
    for path in files {
        let entry = volact_shaders::load(&path)?;
        registry.add_shader(entry).map_err(|source| AddShaderError::Taken { path, source })?;
    }
    Ok(())
}
