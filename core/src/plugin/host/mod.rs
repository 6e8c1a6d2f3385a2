//! The host's side: finds and loads plugins and registers what they offer.
//!
//! - [`Search`] names folders and the plugins wanted; [`load`] loads them into a registry and says
//!   what came of each. One that cannot be loaded changes nothing, and the others go on.
//! - [`link`] takes a plugin that is linked statically, through the same entry.
//!
//! A library, once loaded, stays until the process ends.

mod action;
mod find;
mod library;
mod loader;
mod offer;
mod register;

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
};

use super::{
    abi::{self, Text},
    arena::{Arena, bytes_of},
    float::FloatState,
    status::{Code, Fault, caught, clear, result_of},
};

pub use find::{Found, Search, Wanted, file_name, sha256_of};
pub use offer::Registration;
pub use register::{Loaded, Outcome, link, load};

/// Calls a plugin: its panics have become codes, and the floating-point state is restored.
fn call(run: impl FnOnce() -> i32) -> Result<(), Fault> {
    clear();
    let status = {
        let _state = FloatState::save();
        run()
    };
    result_of(status)
}

/// A function that must be there.
fn needed<T>(function: Option<T>, of: &str, name: &str) -> Result<T, Fault> {
    function.ok_or_else(|| Fault::bad(format!("function {name} of {of}"), "null", "a function"))
}

/// A path as it crosses: the system's own bytes on Unix, UTF-8 elsewhere.
fn lend_path(path: &Path, arena: &mut Arena) -> Result<Text, Fault> {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt as _;
        Ok(arena.bytes(path.as_os_str().as_bytes()))
    }
    #[cfg(not(unix))]
    {
        let text = path.to_str().ok_or_else(|| Fault::bad("path", path.display(), "UTF-8"))?;
        Ok(arena.text(text))
    }
}

/// A path that crossed.
///
/// # Safety
/// The text is valid for the call.
pub(super) unsafe fn path_of(text: Text) -> Result<PathBuf, Fault> {
    // SAFETY: as promised by the caller.
    let bytes = unsafe { bytes_of(text, "path") }?;
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt as _;
        Ok(PathBuf::from(std::ffi::OsStr::from_bytes(bytes)))
    }
    #[cfg(not(unix))]
    {
        let text = std::str::from_utf8(bytes).map_err(|_| Fault::bad("path", "odd", "UTF-8"))?;
        Ok(PathBuf::from(text))
    }
}

/// A version of the boundary in words.
fn version_words(version: u32) -> String {
    format!("{}.{}", version >> 16, version & 0xffff)
}

/// The oldest and newest version of the boundary that this build speaks, in words.
pub fn versions() -> Cow<'static, str> {
    let (oldest, newest) = (super::services::HOST.oldest, super::services::HOST.newest);
    if oldest == newest {
        return version_words(newest).into();
    }
    format!("{} to {}", version_words(oldest), version_words(newest)).into()
}

/// Asks a plugin for its table.
///
/// # Safety
/// `entry` is the entry of a plugin that keeps the boundary's rules.
unsafe fn negotiate(entry: abi::Entry) -> Result<&'static abi::Plugin, Fault> {
    let mut answer = abi::Answer { size: size_of::<abi::Answer>() as u32, version: 0, plugin: std::ptr::null() };
    // SAFETY: as promised by the caller; the host's table is static.
    let said = call(|| unsafe { entry(&raw const super::services::HOST, &raw mut answer) });
    let host = &super::services::HOST;
    let outside = answer.version < host.oldest || answer.version > host.newest;
    let refused = said.as_ref().is_err_and(|fault| fault.code == Code::BadVersion);
    if refused || (said.is_ok() && outside) {
        let message =
            format!("speaks version {} of the boundary, wanted {}", version_words(answer.version), versions());
        return Err(Fault::new(Code::BadVersion, message));
    }
    said?;
    // SAFETY: as promised by the caller: null, or valid as long as the process.
    let table = unsafe { answer.plugin.as_ref() };
    let table = table.ok_or_else(|| Fault::bad("table of the plugin", "a null pointer", "an address"))?;
    check_size(table.size, size_of::<abi::Plugin>(), "the plugin")?;
    Ok(table)
}

/// Refuses a table that is shorter than its version says.
fn check_size(found: u32, wanted: usize, what: &str) -> Result<(), Fault> {
    if found as usize >= wanted {
        return Ok(());
    }
    let message = format!("table of {what} is {found} bytes, wanted at least {wanted} in this version of the boundary");
    Err(Fault::new(Code::BadVersion, message))
}

/// Runs something of the host's own that a plugin's data could upset.
fn guarded<T>(run: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    caught(run)
}
