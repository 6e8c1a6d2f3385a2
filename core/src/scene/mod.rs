//! Scene files: what to draw, from where, and how, as one RON document.
//!
//! A [`SceneFile`] is the description; [`SceneFile::parse`] reads it from a text without touching
//! anything else, and [`SceneFile::build`] loads its data and makes the [`Scene`]. All problems of
//! a file come at once, each with line and column, path in the document, what was found and what
//! was wanted, and the nearest name for a misspelt one. `docs/scene-format.md` describes the
//! format.
//!
//! ```
//! use volact_core::scene::SceneFile;
//!
//! let text = r#"Scene(
//!     version: 1,
//!     data: {"head": (file: "head.nrrd")},
//!     shapes: [(
//!         shader: "lut",
//!         parameters: {
//!             "volume": Volume(data: "haed"),
//!             "lookup_table": WindowLevel(window: 400, level: 40, opacity: 1.5),
//!         },
//!     )],
//! )"#;
//! let problems = SceneFile::parse(text).unwrap_err();
//! assert_eq!(problems.to_string(), "\
//! 7:36: shapes[0].parameters.volume.data: found \"haed\", wanted a name under `data`: head; did you mean \"head\"?
//! 8:74: shapes[0].parameters.lookup_table.opacity: found 1.5, wanted 0 to 1");
//! ```
//!
//! Nothing in a file can run, and a file that is huge, deeply nested or otherwise hostile ends in
//! an error. Data paths are relative to the scene file; absolute paths and `..` are allowed, since
//! data is no code. What is read from them is only ever read as a volume, a table or an attribute.

mod build;
mod check;
mod document;
mod lexer;
mod parameters;
mod problem;
mod read;
pub(crate) mod reader;
mod values;
mod view;

use std::{collections::BTreeMap, path::PathBuf};

use glam::{DAffine3, DVec3};

use crate::{Aabb, Camera, ControlPoint, Filter, ParameterValue, Registry, Roi, ScalarType, View, Viewport};

pub use build::{Scene, SceneError};
pub use document::{MAX_BYTES, MAX_DEPTH, MAX_NODES};
pub use problem::{Problem, Problems, Spot};
pub use reader::MAX_NAME;

pub(crate) use build::read_text;
pub(crate) use document::parse as parse_document;
pub(crate) use parameters::plain_parameters;
pub(crate) use view::{background, size, view};

/// The version of the scene format that this build reads.
pub const SCENE_VERSION: u32 = 1;

/// A scene as a file describes it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneFile {
    /// The files to read, by the names that shapes use.
    pub data: BTreeMap<String, DataSpec>,
    /// What to draw, in this order.
    pub shapes: Vec<ShapeSpec>,
    /// From where.
    pub camera: CameraSpec,
    /// Into what.
    pub image: ImageSpec,
    /// With which action; whoever draws chooses where `None`.
    pub action: Option<ActionSpec>,
    /// Where everything stood in the text.
    places: Places,
}

/// Places by path. How a description was written is no part of what it describes.
#[derive(Clone, Debug, Default)]
struct Places(BTreeMap<String, Spot>);

impl PartialEq for Places {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

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

impl SceneFile {
    /// Reads a scene from a text, without knowing what is registered.
    ///
    /// # Errors
    /// All problems, in the order of the text.
    pub fn parse(text: &str) -> Result<Self, Problems> {
        read::parse(text, None)
    }

    /// Reads a scene from a text and checks all names and parameters against a registry.
    ///
    /// # Errors
    /// All problems of both kinds, in the order of the text.
    pub fn parse_with(text: &str, registry: &Registry) -> Result<Self, Problems> {
        read::parse(text, Some(registry))
    }

    /// Checks the names and parameters of a description against a registry.
    ///
    /// # Errors
    /// All problems.
    pub fn check(&self, registry: &Registry) -> Result<(), Problems> {
        let problems = check::check(self, registry);
        if problems.is_empty() { Ok(()) } else { Err(Problems::new(problems)) }
    }

    /// The name of a shape in messages and on the command line.
    pub fn shape_name(&self, index: usize) -> String {
        let given = self.shapes.get(index).and_then(|s| s.name.clone());
        given.unwrap_or_else(|| format!("shapes[{index}]"))
    }

    /// Where something stood in the text.
    fn place(&self, path: &str) -> Option<Spot> {
        self.places.0.get(path).copied()
    }

    /// A problem with what has this path.
    fn problem(&self, path: &str, found: impl Into<String>, wanted: impl Into<String>) -> Problem {
        Problem::new(self.place(path), path, found, wanted)
    }
}
