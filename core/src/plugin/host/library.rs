//! Opens libraries. They stay open until the process ends.

use std::{fs, io::Read as _, mem::ManuallyDrop, path::Path};

use libloading::Library;

use super::{Wanted, find::check_hash};
use crate::plugin::{
    abi::Entry,
    float::FloatState,
    status::{Code, Fault},
};

/// The largest library that is read to be hashed.
const MAX_LIBRARY: u64 = 1 << 32;

/// The entry of a plugin's library.
///
/// # Safety
/// The library's initialisers and its entry do what the boundary demands: the user trusts it.
pub(super) unsafe fn entry_of(path: &Path, wanted: &Wanted) -> Result<Entry, Fault> {
    // Initialisers run now; one of a library built with fast-math turns on flush-to-zero.
    let _state = FloatState::save();
    let library = match &wanted.sha256 {
        // SAFETY: as promised by the caller.
        Some(hash) => unsafe { open_pinned(path, hash) }?,
        // SAFETY: as promised by the caller.
        None => unsafe { open(path) }.map_err(|error| not_a_library(path, &error))?,
    };
    let library = ManuallyDrop::new(library);
    let symbol = format!("volact_plugin_{}", wanted.name.replace('-', "_"));
    // SAFETY: a symbol of this name has this type, which the caller promises.
    let entry = unsafe { library.get::<Entry>(symbol.as_bytes()) };
    let entry =
        entry.map_err(|_| Fault::bad(path.display(), "a library without it", format!("the symbol {symbol}")))?;
    Ok(*entry)
}

fn not_a_library(path: &Path, error: &libloading::Error) -> Fault {
    let mut words = error.to_string();
    if let Some(source) = std::error::Error::source(error) {
        words = format!("{words}: {source}");
    }
    Fault::new(Code::Io, format!("{}: cannot be loaded: {words}", path.display()))
}

/// # Safety
/// As [`entry_of`].
#[cfg(unix)]
unsafe fn open(path: &Path) -> Result<Library, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: as promised by the caller.
    unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map(Into::into)
}

/// # Safety
/// As [`entry_of`].
#[cfg(not(unix))]
unsafe fn open(path: &Path) -> Result<Library, libloading::Error> {
    // SAFETY: as promised by the caller.
    unsafe { Library::new(path) }
}

fn content_of(path: &Path) -> Result<Vec<u8>, Fault> {
    let io = |error: std::io::Error| Fault::new(Code::Io, format!("{}: {error}", path.display()));
    let file = fs::File::open(path).map_err(io)?;
    let length = file.metadata().map_err(io)?.len();
    if length > MAX_LIBRARY {
        return Err(Fault::bad(format!("size of {}", path.display()), length, format!("at most {MAX_LIBRARY} bytes")));
    }
    let mut content = Vec::new();
    file.take(MAX_LIBRARY).read_to_end(&mut content).map_err(io)?;
    Ok(content)
}

/// Loads the very bytes that were hashed: a sealed copy in memory, which nobody can swap.
///
/// # Safety
/// As [`entry_of`].
#[cfg(target_os = "linux")]
unsafe fn open_pinned(path: &Path, hash: &[u8; 32]) -> Result<Library, Fault> {
    use std::{
        io::Write as _,
        os::fd::{AsRawFd as _, IntoRawFd as _},
    };

    use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, memfd_create};
    let content = content_of(path)?;
    check_hash(&content, hash)?;
    let io = |error: std::io::Error| Fault::new(Code::Io, format!("{}: no copy can be made: {error}", path.display()));
    let memory = memfd_create("volact-plugin", MemfdFlags::CLOEXEC | MemfdFlags::ALLOW_SEALING);
    let mut memory = fs::File::from(memory.map_err(|e| io(e.into()))?);
    memory.write_all(&content).map_err(io)?;
    let seals = SealFlags::WRITE | SealFlags::SHRINK | SealFlags::GROW | SealFlags::SEAL;
    fcntl_add_seals(&memory, seals).map_err(|e| io(e.into()))?;
    let place = format!("/proc/self/fd/{}", memory.as_raw_fd());
    // SAFETY: as promised by the caller.
    let library = unsafe { open(Path::new(&place)) }.map_err(|error| not_a_library(path, &error))?;
    // The loader knows a library by its path, so that this number must never be used again.
    _ = memory.into_raw_fd();
    Ok(library)
}

/// Hashes the file and loads it; a swap in between is not noticed on this system.
///
/// # Safety
/// As [`entry_of`].
#[cfg(not(target_os = "linux"))]
unsafe fn open_pinned(path: &Path, hash: &[u8; 32]) -> Result<Library, Fault> {
    check_hash(&content_of(path)?, hash)?;
    // SAFETY: as promised by the caller.
    unsafe { open(path) }.map_err(|error| not_a_library(path, &error))
}
