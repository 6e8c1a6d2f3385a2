//! The parts of a scene as a file describes them.

use std::{collections::BTreeMap, path::PathBuf};

use glam::{DAffine3, DVec3};

use crate::{Aabb, Camera, ControlPoint, Filter, ParameterValue, Roi, ScalarType, View, Viewport};

/// A volume to read from a file, and what to change about it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DataSpec {
    /// The file or the directory of a series, relative to the scene file.
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
}

/// A geometry.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum GeometrySpec {
    /// The block that the shape's volume fills.
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
    /// Per-vertex numbers.
    Attribute(AttributeSpec),
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
        /// The file, relative to the scene file.
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

/// Where per-vertex numbers come from.
#[derive(Clone, Debug, PartialEq)]
pub enum AttributeValues {
    /// Written out.
    Inline(Vec<f64>),
    /// A file of little-endian numbers, relative to the scene file.
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
