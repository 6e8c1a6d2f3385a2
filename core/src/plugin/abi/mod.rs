//! The binary interface between a host and its plugins, as plain data.
//!
//! Only what is here crosses: integers and floats of fixed width, pointers with a length, opaque
//! handles, functions and status codes. The C header is generated from these files.
//!
//! # Rules
//! - **Tables grow at their end only.** Each begins with its own `size` in bytes. A reader takes
//!   what it knows and refuses a table that is shorter than the agreed version says. What has no
//!   `size` stays as it is for as long as the major version does.
//! - **Whoever allocates frees.** What comes as an *argument* is borrowed for the call; an
//!   [`ArrayView`] is kept longer by calling its `retain`, and let go by `release`. What comes as a
//!   *result* is handed over with one reference, which the receiver releases once. A view without
//!   `release` lives as long as the library.
//! - **A call returns a status**: [`OK`] or one of the codes below. The message belongs to the
//!   thread: a plugin leaves it with [`Host::set_error`] before it returns.
//! - **Nothing unwinds** out of a function of either side.
//! - **Bools** are `u32`; anything but 0 and 1 is refused. Text is UTF-8 with a length, without a
//!   zero at its end.
//! - **A null function** is allowed only where its documentation says so.

mod action;
mod array;
mod geometry;
mod loader;

pub use action::*;
pub use array::*;
pub use geometry::*;
pub use loader::*;

use std::ffi::c_void;

/// The version of the boundary: major in the upper 16 bits, minor in the lower. A minor version
/// only adds at the end of tables.
pub const VERSION: u32 = 0x0001_0000;

/// Done.
pub const OK: i32 = 0;
/// A number, a parameter or data that cannot be.
pub const BAD_VALUE: i32 = 1;
/// A name that nobody knows, or that cannot be one.
pub const BAD_NAME: i32 = 2;
/// Memory ran out, or a limit of memory would be passed.
pub const OUT_OF_MEMORY: i32 = 3;
/// The one who was asked cannot do this.
pub const UNSUPPORTED: i32 = 4;
/// The plugin's code panicked; the panic went no further.
pub const PANICKED: i32 = 5;
/// A file cannot be read or written.
pub const IO: i32 = 6;
/// The one who watches the progress asked to stop.
pub const STOPPED: i32 = 7;
/// A call out of order.
pub const BAD_STATE: i32 = 8;
/// The versions of host and plugin do not go together.
pub const BAD_VERSION: i32 = 9;
/// Any other failure.
pub const FAILED: i32 = 10;

/// A message about something that went wrong.
pub const LOG_ERROR: u32 = 1;
/// A message about something odd.
pub const LOG_WARN: u32 = 2;
/// A message about something done.
pub const LOG_INFO: u32 = 3;
/// A message about settings.
pub const LOG_DEBUG: u32 = 4;
/// A message about everything else.
pub const LOG_TRACE: u32 = 5;

/// UTF-8 text; `data` may be null where `length` is 0. Paths are the system's own bytes on Unix.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Text {
    /// The bytes.
    pub data: *const u8,
    /// How many.
    pub length: u64,
}

/// What a host offers. Valid as long as the process.
#[repr(C)]
pub struct Host {
    /// Bytes of this table.
    pub size: u32,
    /// The oldest version of the boundary that the host speaks.
    pub oldest: u32,
    /// The newest version of the boundary that the host speaks.
    pub newest: u32,
    /// 0.
    pub reserved: u32,
    /// Leaves the message of the error that this thread is about to return. The text is copied.
    pub set_error: Option<unsafe extern "C" fn(message: Text)>,
    /// The message of the last function of the host that failed on this thread; valid until the
    /// next such failure.
    pub last_error: Option<unsafe extern "C" fn() -> Text>,
    /// Logs a message at a level (`LOG_…`) for a target, e.g. the plugin's name.
    pub log: Option<unsafe extern "C" fn(level: u32, target: Text, message: Text)>,
    /// The most detailed level that is logged at present.
    pub log_level: Option<unsafe extern "C" fn() -> u32>,
    /// Calls `task(user, i)` for each `i` below `count`, from up to `threads` threads at once (0:
    /// as many as there are processors), and returns when all are done. Tasks must not unwind.
    pub parallel_for: Option<
        unsafe extern "C" fn(
            threads: u32,
            count: u64,
            task: Option<unsafe extern "C" fn(user: *mut c_void, index: u64)>,
            user: *mut c_void,
        ) -> i32,
    >,
}

/// What the plugin answers to the host; the host fills in `size` and zeros.
#[repr(C)]
pub struct Answer {
    /// Bytes of this table.
    pub size: u32,
    /// The version in which the plugin will speak: not above the host's newest, not below its
    /// oldest. Where there is none, the plugin's own newest, and the status is [`BAD_VERSION`].
    pub version: u32,
    /// The plugin; valid as long as the process.
    pub plugin: *const Plugin,
}

/// The type of the one symbol that a plugin exports, `volact_plugin_<crate>`.
pub type Entry = unsafe extern "C" fn(host: *const Host, answer: *mut Answer) -> i32;

/// What a plugin offers. The tables pointed to live as long as the process.
#[repr(C)]
pub struct Plugin {
    /// Bytes of this table.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Its name: that of the crate or library.
    pub name: Text,
    /// Its version.
    pub version: Text,
    /// One line that says what it is.
    pub description: Text,
    /// Its render actions: as many pointers as `action_count`.
    pub actions: *const *const ActionTable,
    /// See `actions`.
    pub action_count: u64,
    /// Its shaders.
    pub shaders: *const *const ShaderTable,
    /// See `shaders`.
    pub shader_count: u64,
    /// Its geometries.
    pub geometries: *const *const GeometryTable,
    /// See `geometries`.
    pub geometry_count: u64,
    /// Its loaders.
    pub loaders: *const *const LoaderTable,
    /// See `loaders`.
    pub loader_count: u64,
}

/// A shader: its declaration and its text. See the documentation of shaders for the language.
#[repr(C)]
pub struct ShaderTable {
    /// Bytes of this table.
    pub size: u32,
    /// How samples are put together: `COMPOSITE_…`.
    pub compositing: u32,
    /// Name, version and parameters.
    pub declaration: DeclarationView,
    /// The source in WGSL.
    pub source: Text,
}

/// Samples are composited by emission and absorption.
pub const COMPOSITE_OVER: u32 = 1;
/// The highest value of the interval.
pub const COMPOSITE_MAXIMUM: u32 = 2;
/// The lowest value of the interval.
pub const COMPOSITE_MINIMUM: u32 = 3;
/// The mean value by length.
pub const COMPOSITE_AVERAGE: u32 = 4;
/// The line integral of the value.
pub const COMPOSITE_ADD: u32 = 5;
/// Crossings of given values.
pub const COMPOSITE_FIRST: u32 = 6;

/// What a registration says of itself.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct DeclarationView {
    /// The name under which it is found: lower-case letters, digits, `_` and `-`.
    pub name: Text,
    /// Its version.
    pub version: Text,
    /// One line that says what it does.
    pub description: Text,
    /// The parameters that it expects.
    pub parameters: *const ParameterDeclView,
    /// See `parameters`.
    pub parameter_count: u64,
}

/// One parameter that somebody expects.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct ParameterDeclView {
    /// The name.
    pub name: Text,
    /// One line that says what it does.
    pub description: Text,
    /// The unit of a number, or empty.
    pub unit: Text,
    /// The kinds accepted, `KIND_…`: bit `1 << kind` for each.
    pub kinds: u64,
    /// Whether there must be one.
    pub required: u32,
    /// Whether `bounds` holds.
    pub bounded: u32,
    /// Lowest and highest number allowed, ends included.
    pub bounds: [f64; 2],
    /// What stands in where it is left out; kind 0 for nothing.
    pub default: ArrayView,
    /// The words allowed for a choice.
    pub choices: *const Text,
    /// See `choices`.
    pub choice_count: u64,
}
