//! The one way in which parameters and bulk data cross: a tagged view of an array.

use std::ffi::c_void;

use super::Text;

/// No value.
pub const KIND_NONE: u32 = 0;
/// Voxels, shape `[components, x, y, z]`. Fields: `name` text; `spacing` 3 f64; `placement` 12 f64
/// (object to world: three columns of the matrix, then the translation); `slope`, `intercept`
/// float; `unit` text; `data_roi` 6 i64 (first and last sample of x, y, z); `geometry_roi` 6 f64 (lowest
/// and highest corner in object space); `range` 2 f64, where it is set or the type gives it;
/// `filter` `linear` or `nearest`; `luminance` bool.
pub const KIND_VOLUME: u32 = 1;
/// A lookup table: shape `[5, n]` of f64 (value, red, green, blue, opacity), or `[4, n]` of f32
/// (red, green, blue, opacity) at equal distances over the field `domain` (2 f64; the volume's
/// range where there is none). Field `before` bool: applied to voxels instead of samples.
pub const KIND_TABLE: u32 = 2;
/// A real number: one f64 (f32 is taken, too).
pub const KIND_FLOAT: u32 = 3;
/// A whole number: one i64 (i32 is taken, too).
pub const KIND_INT: u32 = 4;
/// True or false: one u8 that is 0 or 1.
pub const KIND_BOOL: u32 = 5;
/// Two f64.
pub const KIND_VEC2: u32 = 6;
/// Three f64.
pub const KIND_VEC3: u32 = 7;
/// Four f64.
pub const KIND_VEC4: u32 = 8;
/// Straight red, green, blue and opacity: four f64.
pub const KIND_COLOR: u32 = 9;
/// A 4×4 matrix, column by column: sixteen f64.
pub const KIND_MATRIX: u32 = 10;
/// A word: UTF-8 bytes.
pub const KIND_CHOICE: u32 = 11;
/// Numbers of vertices: shape `[components, vertices]`. Field `name` text.
pub const KIND_ATTRIBUTE: u32 = 12;
/// Plain numbers that are no parameter: vertices, indices, pixels, voxels of a region.
pub const KIND_ARRAY: u32 = 32;

/// 8 bits without sign.
pub const SCALAR_U8: u32 = 1;
/// 8 bits.
pub const SCALAR_I8: u32 = 2;
/// 16 bits without sign.
pub const SCALAR_U16: u32 = 3;
/// 16 bits.
pub const SCALAR_I16: u32 = 4;
/// 32 bits without sign.
pub const SCALAR_U32: u32 = 5;
/// 32 bits.
pub const SCALAR_I32: u32 = 6;
/// Half precision.
pub const SCALAR_F16: u32 = 7;
/// Single precision.
pub const SCALAR_F32: u32 = 8;
/// Double precision.
pub const SCALAR_F64: u32 = 9;
/// 64 bits; for whole numbers and regions only.
pub const SCALAR_I64: u32 = 10;

/// A view of numbers in native byte order. All zeros is no value.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct ArrayView {
    /// What it is: `KIND_…`.
    pub kind: u32,
    /// The type of each number: `SCALAR_…`.
    pub scalar: u32,
    /// How many numbers of `shape` count, 0 to 4; 0 is one number.
    pub rank: u32,
    /// 0.
    pub reserved: u32,
    /// Numbers along each axis, the one that changes fastest first.
    pub shape: [u64; 4],
    /// Bytes from one to the next along each axis; all zero stands for dense.
    pub strides: [i64; 4],
    /// The first number, aligned for its type.
    pub data: *const c_void,
    /// What `retain` and `release` are called with.
    pub owner: *mut c_void,
    /// Takes one more reference; from any thread. Null where the data live as long as the library.
    pub retain: Option<unsafe extern "C" fn(owner: *mut c_void)>,
    /// Lets one reference go; from any thread.
    pub release: Option<unsafe extern "C" fn(owner: *mut c_void)>,
    /// What identifies the content, where it has an identity; else 0.
    pub id: u64,
    /// Changes when the content of the same identity does.
    pub version: u64,
    /// What else belongs to it, by name: see the kinds. Borrowed with the view.
    pub fields: *const Parameter,
    /// See `fields`.
    pub field_count: u64,
}

/// A named value.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Parameter {
    /// The name.
    pub name: Text,
    /// The value.
    pub value: ArrayView,
}

/// Named values.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Parameters {
    /// The first.
    pub data: *const Parameter,
    /// How many.
    pub count: u64,
}
