//! The parts of a scene as a file describes them.

use std::{collections::BTreeMap, path::PathBuf};

use glam::{DAffine3, DMat4, DVec3};

use crate::{
    Aabb, Camera, Clip, ControlPoint, Filter, ParameterValue, Roi, ScalarType, Slices, View, Viewport,
    camera::DepthRange,
};

/// A file to read: a volume, a mesh or a surface, as its loader says. What is changed about it
/// (`spacing` and below) is for volumes only.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DataSpec {
    /// The file or the directory of a series; see [`Folders`](super::Folders).
    pub file: PathBuf,
    /// The loader; chosen by content where `None`.
    pub loader: Option<String>,
    /// The loader's options.
    pub options: BTreeMap<String, ParameterSpec>,
    /// Replaces the distance between samples.
    pub spacing: Option<DVec3>,
    /// Replaces the map from object to world space; [`TransformStep::Placement`] is the file's own.
    pub placement: Option<Vec<TransformStep>>,
    /// Replaces the factor from stored numbers to values.
    pub slope: Option<f64>,
    /// Replaces the offset from stored numbers to values.
    pub intercept: Option<f64>,
    /// Replaces the values' unit.
    pub unit: Option<String>,
}

/// A shape.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShapeSpec {
    /// What to call it in messages and on the command line; `shapes[0]` and so on where `None`.
    pub name: Option<String>,
    /// Where to draw, in object space.
    pub geometry: GeometrySpec,
    /// The shader's name.
    pub shader: String,
    /// The shader's parameters.
    pub parameters: BTreeMap<String, ParameterSpec>,
    /// From object to world space, step by step; where `None`, the place of the shape's volume,
    /// or the world's origin where there is none.
    pub transform: Option<Vec<TransformStep>>,
    /// The planes on which it is drawn, in object space.
    pub slices: Option<Slices>,
    /// What cuts it, in object space.
    pub clip: Clip,
}

/// A geometry.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum GeometrySpec {
    /// The block that the shape's volume fills; in a shape without a volume, the mesh to whose
    /// vertices its attribute belongs.
    #[default]
    Around,
    /// A block.
    Block {
        /// Its lowest corner.
        offset: DVec3,
        /// Its lengths.
        dimensions: DVec3,
    },
    /// Any registered geometry.
    Named {
        /// Its registered name.
        name: String,
        /// Its parameters.
        parameters: BTreeMap<String, ParameterSpec>,
    },
    /// The mesh or surface of a file.
    Data {
        /// The name of the data.
        data: String,
        /// The attribute that holds its texture coordinates, if it shall have any.
        texture_coordinates: Option<String>,
    },
    /// An unstructured mesh.
    Mesh(MeshSpec),
    /// A grid of hexahedra.
    StructuredMesh {
        /// Vertices along each axis.
        dims: [usize; 3],
        /// The vertices, x fastest.
        points: PointsSpec,
        /// Their texture coordinates.
        texture_coordinates: Option<PointsSpec>,
    },
    /// Opaque triangles.
    Surface {
        /// The vertices.
        points: PointsSpec,
        /// Three vertices each.
        triangles: Vec<[u32; 3]>,
    },
    /// A ball.
    Sphere {
        /// Its centre.
        center: DVec3,
        /// Its radius.
        radius: f64,
        /// Flat faces around its axis.
        segments: u32,
    },
    /// A cylinder.
    Cylinder {
        /// The ends of its axis.
        ends: [DVec3; 2],
        /// Its radius.
        radius: f64,
        /// Flat faces around its axis.
        segments: u32,
    },
}

/// An unstructured mesh that is written out: cells by type, corners in the order of
/// [`CellType`](crate::CellType).
#[derive(Clone, Debug, PartialEq)]
pub struct MeshSpec {
    /// The vertices.
    pub points: PointsSpec,
    /// Their texture coordinates.
    pub texture_coordinates: Option<PointsSpec>,
    /// Cells of four corners.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Cells of eight corners.
    pub hexahedra: Vec<[u32; 8]>,
    /// Cells of six corners.
    pub wedges: Vec<[u32; 6]>,
    /// Cells of five corners.
    pub pyramids: Vec<[u32; 5]>,
}

/// Positions, written out or from a file.
#[derive(Clone, Debug, PartialEq)]
pub enum PointsSpec {
    /// Written out.
    Inline(Vec<DVec3>),
    /// A file of little-endian `f32`, three a point.
    File(PathBuf),
}

/// One step of a transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TransformStep {
    /// The place that the shape's volume brings along.
    Placement,
    /// Any affine map.
    Matrix(DAffine3),
    /// A shift.
    Translate(DVec3),
    /// A right-handed turn around an axis through the origin.
    Rotate {
        /// The axis, of any length but zero.
        axis: DVec3,
        /// The angle.
        degrees: f64,
    },
    /// A factor for each axis.
    Scale(DVec3),
}

/// The value of a parameter or option.
#[derive(Clone, Debug, PartialEq)]
pub enum ParameterSpec {
    /// A number, vector, matrix, truth value or word.
    Value(ParameterValue),
    /// A volume texture.
    Volume(VolumeSpec),
    /// A lookup table.
    Table(TableSpec),
    /// Per-vertex numbers of the scene's own.
    Attribute(AttributeSpec),
    /// Per-vertex numbers of a mesh's file.
    DataAttribute(DataAttributeSpec),
}

/// A volume texture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VolumeSpec {
    /// The name of the data.
    pub data: String,
    /// The part of the data in use; all of it where `None`.
    pub data_roi: Option<Roi>,
    /// Where that part lies in object space; where it is anyway, where `None`.
    pub geometry_roi: Option<Aabb>,
    /// The values that a shader sees as 0 and 1.
    pub range: Option<[f64; 2]>,
    /// The filter.
    pub filter: Filter,
    /// Whether a single component is opaque grey instead of intensity.
    pub luminance: bool,
}

/// A lookup table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableSpec {
    /// What is in it.
    pub entries: TableEntries,
    /// Whether it applies to voxels instead of samples.
    pub pre_interpolated: bool,
}

/// What is in a lookup table.
#[derive(Clone, Debug, PartialEq)]
pub enum TableEntries {
    /// Control points at any positions.
    Points(Vec<ControlPoint>),
    /// Equidistant entries: red, green, blue, opacity.
    Entries {
        /// The entries.
        values: Vec<[f32; 4]>,
        /// The values of the first and the last; the texture's range where `None`.
        domain: Option<[f64; 2]>,
    },
    /// Equidistant entries from a file: four little-endian `f32` each.
    File {
        /// The file.
        file: PathBuf,
        /// The values of the first and the last; the texture's range where `None`.
        domain: Option<[f64; 2]>,
    },
    /// A grey ramp by window and level.
    WindowLevel {
        /// Width of the ramp in data units.
        window: f64,
        /// Middle of the ramp in data units.
        level: f64,
        /// Opacity at its upper end.
        opacity: f64,
    },
}

/// Per-vertex numbers, written out or from a file.
#[derive(Clone, Debug, PartialEq)]
pub struct AttributeSpec {
    /// The name, e.g. `temperature`.
    pub name: String,
    /// Numbers a vertex.
    pub components: usize,
    /// Type of each number; numbers written out are rounded to it.
    pub scalar: ScalarType,
    /// The numbers, vertex by vertex.
    pub values: AttributeValues,
}

/// Per-vertex numbers of a mesh's file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DataAttributeSpec {
    /// The name of the data.
    pub data: String,
    /// The attribute's name in the file.
    pub name: String,
    /// The one component to take out; all of them where `None`.
    pub component: Option<usize>,
}

/// Where per-vertex numbers come from.
#[derive(Clone, Debug, PartialEq)]
pub enum AttributeValues {
    /// Written out.
    Inline(Vec<f64>),
    /// A file of little-endian numbers.
    File(PathBuf),
}

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "there is one in a scene")]
pub enum CameraSpec {
    /// A view that fits the scene.
    View(View),
    /// A camera.
    Camera(Camera),
}

impl Default for CameraSpec {
    fn default() -> Self {
        Self::View(View::Front)
    }
}

/// A picture. What is `None` is left to whoever draws.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ImageSpec {
    /// Columns and rows; 512 × 512 unless told.
    pub size: Option<[usize; 2]>,
    /// The part that the camera fills; all of it where `None`.
    pub viewport: Option<Viewport>,
    /// What lies behind everything, straight RGBA; opaque black unless told.
    pub background: Option<[f32; 4]>,
    /// Accumulated opacity at which depth is taken; 0.5 unless told.
    pub depth_threshold: Option<f32>,
}

/// An action.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ActionSpec {
    /// Its registered name.
    pub name: String,
    /// Its options.
    pub options: BTreeMap<String, ParameterSpec>,
}

/// Opaque pictures that lie in the scene: what [`Opaque`](crate::Opaque) is made of. Files hold
/// little-endian `f32`, row by row from the top, for as many pixels as the picture has.
#[derive(Clone, Debug, PartialEq)]
pub struct OpaqueSpec {
    /// A file of premultiplied red, green, blue and opacity.
    pub color: Option<PathBuf>,
    /// How far away it is.
    pub depth: OpaqueDepthSpec,
}

/// How far away opaque things are.
#[derive(Clone, Debug, PartialEq)]
pub enum OpaqueDepthSpec {
    /// A file of world distances.
    Distance(PathBuf),
    /// A file of a depth buffer.
    Buffer {
        /// The file.
        file: PathBuf,
        /// What near and far map to.
        range: DepthRange,
        /// World to clip space, as it was drawn with.
        world_to_clip: DMat4,
    },
}
