//! From a description to shapes and a frame. `data` loads what they need, `meshes` makes geometries.

use std::{
    collections::BTreeMap,
    error::Error,
    fs,
    io::Read,
    path::{Path, PathBuf},
};

use glam::{DAffine3, DVec3};
use thiserror::Error as ThisError;

use super::{
    CameraSpec, Folders, KeptData, OpaqueDepthSpec, OpaqueSpec, ParameterSpec, Problem, Problems, SceneFile, ShapeSpec,
    TransformStep, check, document::MAX_BYTES, values,
};
use crate::{
    Appearance, Data, FrameDesc, Geometry, Opaque, OpaqueDepth, Options, ParameterDecl, ParameterValue, Progress,
    Registry, Shape, frame::MAX_PIXELS, parameter::ParameterMap, planner::Goals,
};

/// A scene that can be drawn.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What to draw, in this order.
    pub shapes: Vec<Shape>,
    /// Into what and from where.
    pub frame: FrameDesc,
    /// With which action, if the file says so.
    pub action: Option<(String, Options)>,
    /// The error or the time that is asked for, if the file says so.
    pub goals: Goals,
}

/// Why a scene cannot be had.
#[derive(Debug, ThisError)]
#[non_exhaustive]
pub enum SceneError {
    /// The operating system refused.
    #[error("{}: cannot be read", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The document is wrong, or what it names cannot be loaded.
    #[error(transparent)]
    Problems(#[from] Problems),
}

impl SceneFile {
    /// Reads a scene file and checks it against a registry.
    ///
    /// # Errors
    /// If the file cannot be read, or all its problems.
    pub fn open(path: impl AsRef<Path>, registry: &Registry) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let text = read_text(path)?;
        let named = |problems: Problems| problems.of_file(path.display().to_string());
        Ok(Self::parse_with(&text, registry).map_err(named)?)
    }

    /// Loads all data that shapes use and makes the scene. Files that several shapes use are read
    /// once.
    ///
    /// # Errors
    /// All problems: of the description against the registry, else of the files and of what the
    /// description says about them.
    pub fn build<'a>(
        &self,
        registry: &Registry,
        folders: impl Into<Folders<'a>>,
        progress: &dyn Progress,
    ) -> Result<Scene, Problems> {
        self.build_keeping(registry, folders, progress, &mut KeptData::default())
    }

    /// As [`build`](Self::build), with what was read for an earlier version of the scene, which is
    /// not read again. What this version does not use is forgotten.
    ///
    /// # Errors
    /// As [`build`](Self::build); nothing is forgotten then.
    pub fn build_keeping<'a>(
        &self,
        registry: &Registry,
        folders: impl Into<Folders<'a>>,
        progress: &dyn Progress,
        kept: &mut KeptData,
    ) -> Result<Scene, Problems> {
        let mut problems = check::references(self);
        problems.extend(check::check(self, registry));
        if !problems.is_empty() {
            return Err(Problems::new(problems));
        }
        let mut build = Build { scene: self, registry, folders: folders.into(), data: BTreeMap::new(), problems };
        build.load(progress, kept);
        let shapes: Vec<_> = self.shapes.iter().enumerate().filter_map(|(i, s)| build.shape(i, s)).collect();
        let frame = build.frame(&shapes);
        let action = self.action.as_ref().map(|a| (a.name.clone(), plain(&a.options)));
        if !build.problems.is_empty() {
            return Err(Problems::new(build.problems));
        }
        kept.retain_used();
        Ok(Scene { shapes, frame, action, goals: self.goals })
    }
}

impl Scene {
    /// Reads a scene file and everything that it names beside itself.
    ///
    /// # Errors
    /// As [`SceneFile::open`] and [`SceneFile::build`].
    pub fn open(path: impl AsRef<Path>, registry: &Registry, progress: &dyn Progress) -> Result<Self, SceneError> {
        Self::open_with(path, None, registry, progress)
    }

    /// As [`open`](Self::open), with a folder for paths that begin with
    /// [`$VOLACT_DATA`](super::DATA_PREFIX).
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn open_with(
        path: impl AsRef<Path>,
        data: Option<&Path>,
        registry: &Registry,
        progress: &dyn Progress,
    ) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let folders = Folders { base: path.parent().unwrap_or(Path::new("")), data };
        let named = |problems: Problems| problems.of_file(path.display().to_string());
        Ok(SceneFile::open(path, registry)?.build(registry, folders, progress).map_err(named)?)
    }
}

/// Reads a document's text; one that is too long or not UTF-8 is a problem.
pub(crate) fn read_text(path: &Path) -> Result<String, SceneError> {
    let io = |source| SceneError::Io { path: path.into(), source };
    let mut bytes = Vec::new();
    fs::File::open(path).map_err(io)?.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(io)?;
    let wrong = |found: String, wanted: String| {
        let problem = Problem::new(None, "", found, wanted);
        Problems::new(vec![problem]).of_file(path.display().to_string())
    };
    if bytes.len() > MAX_BYTES {
        return Err(wrong("a longer text".into(), format!("at most {MAX_BYTES} bytes")).into());
    }
    String::from_utf8(bytes).map_err(|error| {
        let line = error.as_bytes()[..error.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count() + 1;
        wrong(format!("bytes in line {line} that are no UTF-8"), "a text".into()).into()
    })
}

/// An error with all its causes in one line.
pub(super) fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(&format!(": {cause}"));
        source = cause.source();
    }
    text
}

pub(super) fn plain(options: &BTreeMap<String, ParameterSpec>) -> Options {
    let plain = |(name, value): (&String, &ParameterSpec)| match value {
        ParameterSpec::Value(value) => Some((name.clone(), value.clone())),
        _ => None,
    };
    options.iter().filter_map(plain).collect()
}

/// A scene on its way from the description.
pub(super) struct Build<'a> {
    pub scene: &'a SceneFile,
    pub registry: &'a Registry,
    pub folders: Folders<'a>,
    /// What was loaded, by name.
    pub data: BTreeMap<&'a str, Data>,
    pub problems: Vec<Problem>,
}

impl<'a> Build<'a> {
    pub fn refuse<T>(&mut self, path: &str, found: impl Into<String>, wanted: impl Into<String>) -> Option<T> {
        self.problems.push(self.scene.problem(path, found, wanted));
        None
    }

    fn shape(&mut self, index: usize, spec: &ShapeSpec) -> Option<Shape> {
        let path = format!("shapes[{index}]");
        let shaders = self.registry.shaders().clone();
        let own = shaders.get(&spec.shader).cloned();
        let declared = |name: &str| {
            let all = own.iter().chain(shaders.iter());
            all.filter_map(|s| s.declaration.parameter(name)).next().cloned()
        };
        let parameters = self.parameters(&format!("{path}.parameters"), &spec.parameters, declared);
        let volume = spec.volume().and_then(|(name, _)| match parameters.get(name) {
            Some(ParameterValue::Volume(texture)) => Some(texture.clone()),
            _ => None,
        });
        if spec.volume().is_some() && volume.is_none() {
            return None;
        }
        let geometry = self.geometry(&path, spec, volume.as_ref())?;
        self.attributes_fit(&path, geometry.as_ref(), &parameters)?;
        let placement = volume.map_or(DAffine3::IDENTITY, |v| v.volume().desc().placement);
        let transform = spec.transform.as_deref().map_or(placement, |steps| compose(steps, placement));
        let appearance = Appearance { shader: spec.shader.clone(), parameters };
        let shape = Shape::build(self.scene.shape_name(index), geometry, appearance, transform);
        shape.set_clip(spec.clip.clone());
        Some(shape)
    }

    /// Per-vertex numbers must be as many as the geometry's vertices, where it knows them.
    fn attributes_fit(&mut self, path: &str, geometry: &dyn Geometry, parameters: &ParameterMap) -> Option<()> {
        let Some(vertices) = geometry.vertex_count() else { return Some(()) };
        let mut good = Some(());
        for (name, value) in parameters {
            if let ParameterValue::Attribute(attribute) = value
                && attribute.len() != vertices
            {
                let found = format!("attribute {:?} of {} vertices", attribute.name, attribute.len());
                let wanted = format!("one of {vertices}, the vertices of the shape's geometry");
                good = self.refuse(&format!("{path}.parameters.{name}"), found, wanted);
            }
        }
        good
    }

    /// All values that can be made; those that cannot are problems.
    pub fn parameters(
        &mut self,
        path: &str,
        specs: &BTreeMap<String, ParameterSpec>,
        declared: impl Fn(&str) -> Option<ParameterDecl>,
    ) -> ParameterMap {
        let mut made = ParameterMap::new();
        for (name, spec) in specs {
            let path = format!("{path}.{name}");
            let value = match spec {
                ParameterSpec::Volume(volume) => self.texture(&path, volume).map(ParameterValue::Volume),
                ParameterSpec::DataAttribute(spec) => self.attribute(&path, spec).map(ParameterValue::Attribute),
                other => match other.to_value(declared(name).as_ref(), self.folders) {
                    Ok(value) => Some(value),
                    Err(problem) => self.refuse(&path, problem.found, problem.wanted),
                },
            };
            made.extend(value.map(|value| (name.clone(), value)));
        }
        made
    }

    /// Opaque pictures of that many pixels.
    fn opaque(&mut self, spec: &OpaqueSpec, count: usize) -> Option<Opaque> {
        if count > MAX_PIXELS {
            return None;
        }
        let folders = self.folders;
        let mut read = |path: &str, file: &Path, numbers: usize| match pixels(folders, file, numbers * count) {
            Ok(numbers) => Some(numbers),
            Err((found, wanted)) => self.refuse(path, found, wanted),
        };
        let color = spec.color.as_ref().map(|file| read("opaque.color", file, 4));
        let (values, depth) = match &spec.depth {
            OpaqueDepthSpec::Distance(file) => (read("opaque.depth", file, 1), None),
            OpaqueDepthSpec::Buffer { file, range, world_to_clip } => {
                (read("opaque.depth_buffer.file", file, 1), Some((*range, *world_to_clip)))
            }
        };
        let color = color.map_or(Some(None), |numbers| numbers.map(Some))?;
        let values = values?.into();
        let pixel = |p: &[f32]| [p[0], p[1], p[2], p[3]];
        Some(Opaque {
            color: color.map(|numbers| numbers.chunks_exact(4).map(pixel).collect()),
            depth: match depth {
                None => OpaqueDepth::Distance(values),
                Some((range, world_to_clip)) => OpaqueDepth::Buffer { values, range, world_to_clip },
            },
        })
    }

    fn frame(&mut self, shapes: &[Shape]) -> FrameDesc {
        let image = &self.scene.image;
        let [width, height] = image.size.unwrap_or([512, 512]);
        let (w, h) = image.viewport.map_or((width, height), |v| (v.width, v.height));
        let mut frame = match self.scene.camera.unwrap_or_default() {
            CameraSpec::View(view) => FrameDesc::fit_all(shapes, view, w, h),
            CameraSpec::Camera(camera) => FrameDesc::new(camera, w, h),
        };
        (frame.width, frame.height, frame.viewport) = (width, height, image.viewport);
        frame.background = image.background.unwrap_or(frame.background);
        frame.depth_threshold = image.depth_threshold.unwrap_or(frame.depth_threshold);
        frame.clip = self.scene.clip.clone();
        if let Some(spec) = &self.scene.opaque {
            frame.opaque = self.opaque(spec, width.saturating_mul(height));
        }
        if let Err(error) = frame.validate() {
            self.refuse::<()>("image", chain(&error), "a picture that can be drawn");
        }
        frame
    }
}

/// Numbers of a file, four bytes each.
fn pixels(folders: Folders, file: &Path, count: usize) -> Result<Vec<f32>, values::Fault> {
    let bytes = values::read(&folders.path(file)?, 4)?;
    if bytes.len() == 4 * count {
        return Ok(values::numbers(&bytes));
    }
    let found = format!("{}: {} numbers", file.display(), bytes.len() / 4);
    Err((found, format!("{count} of little-endian f32, for the pixels of the picture")))
}

/// All steps in order, as one map.
pub(super) fn compose(steps: &[TransformStep], placement: DAffine3) -> DAffine3 {
    let one = |step: &TransformStep| match *step {
        TransformStep::Placement => placement,
        TransformStep::Matrix(matrix) => matrix,
        TransformStep::Translate(by) => DAffine3::from_translation(by),
        TransformStep::Rotate { axis, degrees } => {
            DAffine3::from_axis_angle(axis.normalize_or(DVec3::Z), degrees.to_radians())
        }
        TransformStep::Scale(factors) => DAffine3::from_scale(factors),
    };
    steps.iter().fold(DAffine3::IDENTITY, |so_far, step| one(step) * so_far)
}
