//! Shaders on disk: `name.ron` and `name.wgsl` side by side.

use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
    sync::Arc,
};

use volact_core::{ShaderEntry, ShaderFile, ShaderText};

use crate::{Program, ShaderError, refuse::MAX_TEXT, tokens::tokens};

/// Reads and checks the shader of a `.ron` or `.wgsl` file and its other half beside it.
///
/// # Errors
/// If one of the two cannot be read or is wrong.
pub fn load(path: impl AsRef<Path>) -> Result<ShaderEntry, ShaderError> {
    let (ron, wgsl) = (path.as_ref().with_extension("ron"), path.as_ref().with_extension("wgsl"));
    match (ron.is_file(), wgsl.is_file()) {
        (true, false) => return Err(ShaderError::Half { there: ron, missing: wgsl }),
        (false, true) => return Err(ShaderError::Half { there: wgsl, missing: ron }),
        _ => {}
    }
    let file = ShaderFile::open(&ron)?;
    let source = ShaderText { file: wgsl.display().to_string(), text: read(&wgsl)? };
    with_source(&file, &ron.display().to_string(), source)
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

/// The shaders of a folder that may hold other documents too, as `.ron` files that [`load`] takes: each
/// that has a `.wgsl`, and each that is a `Shader` by its first word or its fields.
///
/// # Errors
/// If the folder cannot be read.
pub fn announced(folder: impl AsRef<Path>) -> Result<Vec<PathBuf>, ShaderError> {
    let folder = folder.as_ref();
    let io = |source| ShaderError::Io { path: folder.into(), source };
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in fs::read_dir(folder).map_err(io)? {
        let file = entry.map_err(io)?.path();
        let is = |extension: &str| file.extension().is_some_and(|e| e == extension);
        if file.is_file() && (is("wgsl") || is("ron") && read(&file).is_ok_and(|text| is_shader(&text))) {
            files.push(file.with_extension("ron"));
        }
    }
    files.sort();
    files.dedup();
    Ok(files)
}

/// Whether a document says that it is a shader, or is a right one without saying so.
fn is_shader(text: &str) -> bool {
    let first = tokens(text).into_iter().next();
    match first.and_then(|token| text.get(token.range)) {
        Some("Shader") => true,
        Some("(") => ShaderFile::parse("nameless", text).is_ok(),
        _ => false,
    }
}

/// A text file, not read beyond what a shader can have, without a mark of its byte order.
fn read(path: &Path) -> Result<String, ShaderError> {
    let io = |source| ShaderError::Io { path: path.into(), source };
    let mut bytes = Vec::new();
    fs::File::open(path).map_err(io)?.take(MAX_TEXT as u64 + 1).read_to_end(&mut bytes).map_err(io)?;
    let text = String::from_utf8(bytes);
    let text = text.map_err(|error| io(std::io::Error::new(std::io::ErrorKind::InvalidData, error)))?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}
