//! Shaders by their source: those that come with Volact, and those of folders.

use std::path::{Path, PathBuf};

use thiserror::Error;
use volact_core::{Registry, ShaderEntry, parameter::Kind, registry::RegisterError, shader::RefusedShader};
use volact_shaders::{Program, ShaderError};

/// Why a shader of a folder is not registered.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum AddShaderError {
    /// The folder cannot be read, or a shader is wrong.
    #[error(transparent)]
    Shader(#[from] ShaderError),
    /// Its name is taken.
    #[error("{}: a shader {name:?} is there already: {by}; call one of them otherwise", path.display())]
    Taken {
        /// The shader's file.
        path: PathBuf,
        /// Its name.
        name: String,
        /// What has the name.
        by: String,
    },
    /// Its name cannot be used.
    #[error("{}", path.display())]
    Name {
        /// The shader's file.
        path: PathBuf,
        /// Why.
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

/// What is wrong with a shader's source, for [`Registry::set_shader_check`].
///
/// # Errors
/// All that is wrong, at its place in the source.
pub fn check(entry: &ShaderEntry) -> Result<(), String> {
    match entry.source {
        Some(_) => Program::new(entry).map(|_| ()).map_err(|error| error.to_string()),
        None => Ok(()),
    }
}

/// Registers the shaders of a folder: each `name.ron` with its `name.wgsl`. Other documents are passed
/// over. Shaders that are wrong, or whose name is taken, change nothing for others: the registry keeps
/// why they are refused and tells whoever asks for their name, and they are given back by file.
///
/// # Errors
/// If the folder cannot be read.
pub fn add_folder(registry: &mut Registry, folder: &Path) -> Result<Vec<AddShaderError>, AddShaderError> {
    let mut refused = Vec::new();
    for path in volact_shaders::source::announced(folder)? {
        if let Err(error) = add_file(registry, &path) {
            let name = name_of(&path);
            registry.refuse_shader(&name, RefusedShader { file: wgsl(&path), why: chain(&error) });
            refused.push(error);
        }
    }
    Ok(refused)
}

fn add_file(registry: &mut Registry, path: &Path) -> Result<(), AddShaderError> {
    let name = name_of(path);
    let taken = |by| AddShaderError::Taken { path: path.with_extension("wgsl"), name: name.clone(), by };
    if let Some(by) = holder(registry, &name) {
        return Err(taken(by));
    }
    let entry = volact_shaders::load(path)?;
    registry.add_shader(entry).map_err(|source| AddShaderError::Name { path: path.into(), source })
}

/// Who has a name already, in words.
fn holder(registry: &Registry, name: &str) -> Option<String> {
    if let Some(refused) = registry.shaders().refused(name) {
        return Some(refused.file.clone());
    }
    let entry = registry.shaders().get(name)?;
    if let Some(plugin) = registry.origin(Kind::Shader, name) {
        return Some(format!("that of plugin {plugin:?}"));
    }
    let builtin = Registry::with_core().shaders().get(name).is_some() || volact_shaders::is_builtin(name);
    Some(match &entry.source {
        Some(source) if !builtin => source.file.clone(),
        _ => "the one that comes with Volact".into(),
    })
}

fn name_of(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn wgsl(path: &Path) -> String {
    path.with_extension("wgsl").display().to_string()
}

/// An error with its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(&format!(": {error}"));
        cause = error.source();
    }
    text
}
