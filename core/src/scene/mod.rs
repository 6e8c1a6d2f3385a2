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
//! an error. Data paths are relative to the scene file, or to a folder of data that whoever opens
//! the scene names ([`Folders`]); absolute paths and `..` are allowed, since data is no code. What
//! is read from them is only ever read as a volume, a mesh, a table, numbers or a picture.

mod build;
mod check;
mod cuts;
mod data;
mod description;
mod document;
mod files;
mod folders;
mod geometry;
mod kept;
mod lexer;
mod meshes;
mod parameters;
mod problem;
mod read;
pub(crate) mod reader;
mod values;
mod view;

use std::collections::BTreeMap;

use crate::{Clip, Registry, planner::Goals};

pub use build::{Scene, SceneError};
pub use cuts::{parse_plane, parse_region};
pub use description::{
    ActionSpec, AttributeSpec, AttributeValues, CameraSpec, DataAttributeSpec, DataSpec, GeometrySpec, ImageSpec,
    MeshSpec, OpaqueDepthSpec, OpaqueSpec, ParameterSpec, PointsSpec, ShapeSpec, TableEntries, TableSpec,
    TransformStep, VolumeSpec,
};
pub use document::{MAX_BYTES, MAX_DEPTH, MAX_NODES};
pub use files::SceneFiles;
pub use folders::{DATA_PREFIX, Folders};
pub use kept::KeptData;
pub use problem::{Problem, Problems, Spot};
pub use reader::MAX_NAME;

pub(crate) use build::read_text;
pub(crate) use check::coerce;
pub(crate) use document::parse as parse_document;
pub(crate) use parameters::{plain_parameters, value as plain_value};
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
    /// What cuts all shapes, in world space.
    pub clip: Clip,
    /// Opaque pictures among which the shapes lie.
    pub opaque: Option<OpaqueSpec>,
    /// From where; whoever draws chooses where `None`, and nobody else does: from the front.
    pub camera: Option<CameraSpec>,
    /// Into what.
    pub image: ImageSpec,
    /// With which action; whoever draws chooses where `None`.
    pub action: Option<ActionSpec>,
    /// The error or the time that is asked for.
    pub goals: Goals,
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

    /// Sets a parameter of the shape of that name, or of all shapes; how many that were. It no
    /// longer has a place in the text.
    pub fn set_parameter(&mut self, shape: Option<&str>, name: &str, value: &ParameterSpec) -> usize {
        let names: Vec<_> = (0..self.shapes.len()).map(|i| self.shape_name(i)).collect();
        let mut count = 0;
        for (i, spec) in self.shapes.iter_mut().enumerate() {
            if shape.is_none_or(|shape| shape == names[i]) {
                spec.parameters.insert(name.to_owned(), value.clone());
                let path = format!("shapes[{i}].parameters.{name}");
                self.places.0.retain(|place, _| !place.starts_with(&path));
                count += 1;
            }
        }
        count
    }

    /// Where something stood in the text.
    fn place(&self, path: &str) -> Option<Spot> {
        self.places.0.get(path).copied()
    }

    /// A problem with what has this path; what was left out stands where its parent stands.
    fn problem(&self, path: &str, found: impl Into<String>, wanted: impl Into<String>) -> Problem {
        let mut at = path;
        while self.place(at).is_none() && !at.is_empty() {
            at = at.rfind(['.', '[']).map_or("", |end| &at[..end]);
        }
        Problem::new(self.place(at), path, found, wanted)
    }
}
