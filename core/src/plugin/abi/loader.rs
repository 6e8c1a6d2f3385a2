//! Loaders: volumes by regions, and meshes.

use std::ffi::c_void;

use super::{ArrayView, DeclarationView, GeometryView, Parameter, Parameters, Text, WarningSink};

/// Not this format.
pub const CONFIDENCE_NO: u32 = 0;
/// The extension says so, the content does not contradict.
pub const CONFIDENCE_EXTENSION: u32 = 1;
/// The content says so.
pub const CONFIDENCE_CONTENT: u32 = 2;

/// The files hold voxels.
pub const CONTENT_VOLUME: u32 = 0;
/// The files hold meshes or surfaces.
pub const CONTENT_MESH: u32 = 1;

/// What a file's voxels are. The host fills in zeros, its size and the neutral values.
#[repr(C)]
pub struct VolumeView {
    /// Bytes of this table.
    pub size: u32,
    /// Type of each number, `SCALAR_…`.
    pub scalar: u32,
    /// Numbers a sample: 1 to 4.
    pub components: u32,
    /// 0.
    pub reserved: u32,
    /// Samples along x, y, z.
    pub dims: [u64; 3],
    /// Distance between samples; 1 unless set.
    pub spacing: [f64; 3],
    /// Object to world: three columns of the matrix, then the translation; the identity unless set.
    pub placement: [f64; 12],
    /// Data unit = stored number × slope + intercept; 1 and 0 unless set.
    pub slope: f64,
    /// See `slope`.
    pub intercept: f64,
    /// What to call it; the file's name where this is empty. Valid until the reader's next call.
    pub name: Text,
    /// The unit of the values, or empty. Valid until the reader's next call.
    pub unit: Text,
}

/// A box of samples, both ends included.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct RegionView {
    /// First sample.
    pub min: [u64; 3],
    /// Last sample.
    pub max: [u64; 3],
}

/// Hears how far a read is, and may stop it. Valid during the call that it is given to.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct ProgressView {
    /// What `advance` is called with.
    pub user: *mut c_void,
    /// `done` of `total` bytes are read; 0 asks to stop: return `STOPPED`. From any thread.
    pub advance: Option<unsafe extern "C" fn(user: *mut c_void, done: u64, total: u64) -> u32>,
}

/// What a file of a mesh holds. The host fills in zeros and the size.
#[repr(C)]
pub struct MeshView {
    /// Bytes of this table.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// What to call it; the file's name where this is empty. Valid until the thread's next call.
    pub name: Text,
    /// Where to put the mesh or surface, which is handed over: all zeros and its size.
    pub geometry: *mut GeometryView,
    /// Numbers of its vertices (kind `KIND_ATTRIBUTE`), handed over; the list is valid until the
    /// thread's next call.
    pub attributes: *const Parameter,
    /// See `attributes`.
    pub attribute_count: u64,
}

/// A file format. All functions but those of a reader may be called from any thread.
#[repr(C)]
pub struct LoaderTable {
    /// Bytes of this table.
    pub size: u32,
    /// What its files hold: `CONTENT_…`.
    pub content: u32,
    /// Name, version and options.
    pub declaration: DeclarationView,
    /// What the functions are called with.
    pub user: *mut c_void,
    /// How sure it is that a file is its own, `CONFIDENCE_…`, from the first bytes (none for a
    /// folder) and the path alone.
    pub probe: Option<
        unsafe extern "C" fn(user: *mut c_void, path: Text, head: *const u8, head_length: u64, is_folder: u32) -> u32,
    >,
    /// Reads the headers of a volume. Needed where `content` is `CONTENT_VOLUME`, as are
    /// `read_region` and `close`.
    pub open: Option<
        unsafe extern "C" fn(
            user: *mut c_void,
            path: Text,
            options: Parameters,
            volume: *mut VolumeView,
            reader: *mut *mut c_void,
        ) -> i32,
    >,
    /// Reads a box of samples: dense, x fastest, components interleaved, in native byte order.
    pub read_region: Option<
        unsafe extern "C" fn(
            reader: *mut c_void,
            region: *const RegionView,
            progress: *const ProgressView,
            voxels: *mut ArrayView,
        ) -> i32,
    >,
    /// Reads everything, where that is simpler than by region. May be null.
    pub read_all:
        Option<unsafe extern "C" fn(reader: *mut c_void, progress: *const ProgressView, voxels: *mut ArrayView) -> i32>,
    /// Tells what is worth knowing about the file. May be null.
    pub warnings: Option<unsafe extern "C" fn(reader: *mut c_void, sink: *const WarningSink) -> i32>,
    /// Ends a reader.
    pub close: Option<unsafe extern "C" fn(reader: *mut c_void)>,
    /// Reads a mesh. Needed where `content` is `CONTENT_MESH`.
    pub read_mesh: Option<
        unsafe extern "C" fn(
            user: *mut c_void,
            path: Text,
            options: Parameters,
            progress: *const ProgressView,
            warnings: *const WarningSink,
            mesh: *mut MeshView,
        ) -> i32,
    >,
}
