//! Shaders on disk: `name.ron` and `name.wgsl` side by side.

use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
    sync::Arc,
};

use volact_core::{ShaderEntry, ShaderFile, ShaderText};

use crate::{Program, ShaderError, refuse::MAX_TEXT};

/// Reads and checks the shader of a `.ron` or `.wgsl` file and its other half beside it.
///
/// # Errors
/// If one of the two cannot be read or is wrong.
pub fn load(path: impl AsRef<Path>) -> Result<ShaderEntry, ShaderError> {
    let path = path.as_ref();
    let file = ShaderFile::open(path.with_extension("ron"))?;
    let wgsl = path.with_extension("wgsl");
    let source = ShaderText { file: wgsl.display().to_string(), text: read(&wgsl)? };
    let name = path.with_extension("ron").display().to_string();
    with_source(&file, &name, source)
}

/// A shader of a declaration and a text.
///
/// # Errors
/// If the declaration takes a name that WGSL cannot have (`file` is its file in messages), or the
/// text is wrong.
pub fn with_source(declared: &ShaderFile, file: &str, source: ShaderText) -> Result<ShaderEntry, ShaderError> {
    let entry = ShaderEntry { source: Some(Arc::new(source)), ..declared.entry.clone() };
    crate::program::check_declaration(declared).map_err(|problems| problems.of_file(file))?;
    Program::new(&entry)?;
    Ok(entry)
}

/// Reads all shaders of a folder, in the order of their names. Each that is wrong is an error of
/// its own beside those that are right.
///
/// # Errors
/// If the folder cannot be read.
pub fn load_folder(path: impl AsRef<Path>) -> Result<Vec<Result<ShaderEntry, ShaderError>>, ShaderError> {
    let path = path.as_ref();
    let io = |source| ShaderError::Io { path: path.into(), source };
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(path).map_err(io)? {
        let file = entry.map_err(io)?.path();
        // Either half announces a shader; the one that is missing is then an error.
        if file.extension().is_some_and(|e| e == "ron" || e == "wgsl") && file.is_file() {
            files.push(file.with_extension("ron"));
        }
    }
    files.sort();
    files.dedup();
    Ok(files.iter().map(load).collect())
}

/// A text file, not read beyond what a shader can have.
fn read(path: &Path) -> Result<String, ShaderError> {
    let io = |source| ShaderError::Io { path: path.into(), source };
    let mut bytes = Vec::new();
    fs::File::open(path).map_err(io)?.take(MAX_TEXT as u64 + 1).read_to_end(&mut bytes).map_err(io)?;
    String::from_utf8(bytes).map_err(|error| io(std::io::Error::new(std::io::ErrorKind::InvalidData, error)))
}
