//! Geometries: one view, whichever side made it.

use std::ffi::c_void;

use super::{ArrayView, DeclarationView, Parameters, Text};

/// Known by bounds and `tessellate` only.
pub const GEOMETRY_OTHER: u32 = 0;
/// The box `bounds`.
pub const GEOMETRY_BLOCK: u32 = 1;
/// Opaque triangles: `vertices`, `cells` (three indices each), optional `normals`.
pub const GEOMETRY_SURFACE: u32 = 2;
/// Cells between `vertices`: `cells`, and `types` or `cell_type`; optional `texture_coordinates`.
pub const GEOMETRY_MESH: u32 = 3;
/// A curvilinear grid of `dims` `vertices`; optional `blanked` and `texture_coordinates`.
pub const GEOMETRY_STRUCTURED: u32 = 4;

/// A cell of four corners.
pub const CELL_TETRAHEDRON: u32 = 10;
/// A cell of eight corners, as in VTK.
pub const CELL_HEXAHEDRON: u32 = 12;
/// A cell of six corners, as in VTK.
pub const CELL_WEDGE: u32 = 13;
/// A cell of five corners, as in VTK.
pub const CELL_PYRAMID: u32 = 14;

/// A geometry in object space. Set `size` and `kind`, and what the kind needs; the rest is zeros.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct GeometryView {
    /// Bytes of this table.
    pub size: u32,
    /// `GEOMETRY_…`.
    pub kind: u32,
    /// The name under which it is registered.
    pub name: Text,
    /// Lowest corner, then highest; needed by kinds 0 and 1.
    pub bounds: [f64; 6],
    /// Vertices along each axis of a structured grid.
    pub dims: [u64; 3],
    /// The number of vertices that have attributes, where it is known; else all ones.
    pub vertex_count: u64,
    /// Positions: f32 or f64, shape `[3, n]`.
    pub vertices: ArrayView,
    /// Indices of corners: u32, one cell after another.
    pub cells: ArrayView,
    /// The type of each cell: u8 of `CELL_…`; none where all are `cell_type`.
    pub types: ArrayView,
    /// Normals of the vertices, as the positions.
    pub normals: ArrayView,
    /// Texture coordinates of the vertices, as the positions: 0 to 1 over a volume's data ROI.
    pub texture_coordinates: ArrayView,
    /// One u8 a vertex of a structured grid; cells with a 0 are left out.
    pub blanked: ArrayView,
    /// The type of all cells where there are no `types`.
    pub cell_type: u32,
    /// How the planes are drawn: 0 opaque, 1 blended.
    pub slice_style: u32,
    /// Whether the volume around the planes is drawn, too.
    pub slice_volume: u32,
    /// 0.
    pub reserved: u32,
    /// Planes on which it is drawn: unit normal and offset, four numbers each.
    pub planes: *const f64,
    /// The number of planes; 0 where it is not drawn on planes.
    pub plane_count: u64,
    /// What `retain`, `release` and `tessellate` are called with.
    pub owner: *mut c_void,
    /// As for an [`ArrayView`].
    pub retain: Option<unsafe extern "C" fn(owner: *mut c_void)>,
    /// As for an [`ArrayView`].
    pub release: Option<unsafe extern "C" fn(owner: *mut c_void)>,
    /// Cuts it into tetrahedra, the same at every call, from any thread. Needed by kind 0.
    pub tessellate: Option<unsafe extern "C" fn(owner: *mut c_void, made: *mut TessellationView) -> i32>,
}

/// A geometry cut into positively oriented tetrahedra.
#[repr(C)]
pub struct TessellationView {
    /// Bytes of this table; set by the caller.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Positions: f32 or f64, shape `[3, n]`.
    pub vertices: ArrayView,
    /// Four u32 each: shape `[4, n]`.
    pub tetrahedra: ArrayView,
    /// Texture coordinates of the vertices, or none.
    pub texture_coordinates: ArrayView,
    /// Cells left out because they hold no volume.
    pub collapsed: u64,
    /// Cells that were turned.
    pub inverted: u64,
    /// Cells that are twisted into themselves.
    pub folded: u64,
}

/// A geometry that is made by name.
#[repr(C)]
pub struct GeometryTable {
    /// Bytes of this table.
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Name, version and parameters.
    pub declaration: DeclarationView,
    /// What `make` is called with.
    pub user: *mut c_void,
    /// Makes one from parameters that were checked against the declaration, defaults filled in.
    /// The host fills `made` with zeros and its size. From any thread.
    pub make: Option<unsafe extern "C" fn(user: *mut c_void, parameters: Parameters, made: *mut GeometryView) -> i32>,
}
