//! From a description to shapes: loads data, each file once, and makes everything.

use std::{
    collections::BTreeMap,
    error::Error,
    fs,
    io::Read,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{DAffine3, DVec3};
use thiserror::Error as ThisError;

use super::{
    CameraSpec, DataSpec, GeometrySpec, ParameterSpec, Problem, Problems, SceneFile, ShapeSpec, TransformStep,
    VolumeSpec, check, document::MAX_BYTES,
};
use crate::{
    Appearance, Block, FrameDesc, Geometry, Options, ParameterDecl, ParameterValue, Progress, Registry, Shape, Volume,
    VolumeTexture, parameter::ParameterMap,
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

    /// Loads all data that shapes use and makes the scene. Paths are relative to `base`; files
    /// that several shapes use are read once.
    ///
    /// # Errors
    /// All problems: of the description against the registry, else of the files and of what the
    /// description says about them.
    pub fn build(&self, registry: &Registry, base: &Path, progress: &dyn Progress) -> Result<Scene, Problems> {
        let mut problems = check::references(self);
        problems.extend(check::check(self, registry));
        if !problems.is_empty() {
            return Err(Problems::new(problems));
        }
        let mut build = Build { scene: self, registry, base, data: BTreeMap::new(), problems };
        build.load(progress);
        let shapes: Vec<_> = self.shapes.iter().enumerate().filter_map(|(i, s)| build.shape(i, s)).collect();
        let frame = build.frame(&shapes);
        let action = self.action.as_ref().map(|a| (a.name.clone(), plain(&a.options)));
        if build.problems.is_empty() { Ok(Scene { shapes, frame, action }) } else { Err(Problems::new(build.problems)) }
    }
}

impl Scene {
    /// Reads a scene file and everything that it names.
    ///
    /// # Errors
    /// As [`SceneFile::open`] and [`SceneFile::build`].
    pub fn open(path: impl AsRef<Path>, registry: &Registry, progress: &dyn Progress) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let base = path.parent().unwrap_or(Path::new(""));
        let named = |problems: Problems| problems.of_file(path.display().to_string());
        Ok(SceneFile::open(path, registry)?.build(registry, base, progress).map_err(named)?)
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
fn chain(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text.push_str(&format!(": {cause}"));
        source = cause.source();
    }
    text
}

fn plain(options: &BTreeMap<String, ParameterSpec>) -> Options {
    let plain = |(name, value): (&String, &ParameterSpec)| match value {
        ParameterSpec::Value(value) => Some((name.clone(), value.clone())),
        _ => None,
    };
    options.iter().filter_map(plain).collect()
}

struct Build<'a> {
    scene: &'a SceneFile,
    registry: &'a Registry,
    base: &'a Path,
    data: BTreeMap<&'a str, Volume>,
    problems: Vec<Problem>,
}

impl<'a> Build<'a> {
    fn refuse<T>(&mut self, path: &str, found: impl Into<String>, wanted: impl Into<String>) -> Option<T> {
        self.problems.push(self.scene.problem(path, found, wanted));
        None
    }

    /// Reads every file that a shape uses, once.
    fn load(&mut self, progress: &dyn Progress) {
        let mut read: Vec<(&DataSpec, Volume)> = Vec::new();
        let scene = self.scene;
        let used = |name: &str| scene.shapes.iter().any(|shape| shape.uses(name));
        for (name, spec) in scene.data.iter().filter(|(name, _)| used(name)) {
            let same = |s: &DataSpec| s.file == spec.file && s.loader == spec.loader && s.options == spec.options;
            let volume = match read.iter().find(|(s, _)| same(s)) {
                Some((_, volume)) => Some(volume.clone()),
                None => self.read(name, spec, progress),
            };
            let Some(volume) = volume else { continue };
            read.push((spec, volume.clone()));
            if let Some(volume) = self.adjust(name, spec, volume) {
                self.data.insert(name, volume);
            }
        }
    }

    fn read(&mut self, name: &str, spec: &DataSpec, progress: &dyn Progress) -> Option<Volume> {
        let path = self.base.join(&spec.file);
        let options = plain(&spec.options);
        match self.registry.load_with(&path, spec.loader.as_deref(), &options, progress) {
            Ok(volume) => Some(volume),
            Err(error) => self.refuse(&format!("data.{name}.file"), chain(&error), "a volume"),
        }
    }

    /// The volume with what the description changes about it; the voxels are shared.
    fn adjust(&mut self, name: &str, spec: &DataSpec, volume: Volume) -> Option<Volume> {
        let mut desc = volume.desc().clone();
        desc.spacing = spec.spacing.unwrap_or(desc.spacing);
        desc.placement = spec.placement.as_deref().map_or(desc.placement, |steps| compose(steps, desc.placement));
        desc.slope = spec.slope.unwrap_or(desc.slope);
        desc.intercept = spec.intercept.unwrap_or(desc.intercept);
        desc.unit = spec.unit.clone().unwrap_or(desc.unit);
        if desc == *volume.desc() {
            return Some(volume);
        }
        match Volume::new(desc, volume.data().clone()) {
            Ok(volume) => Some(volume),
            Err(error) => self.refuse(&format!("data.{name}"), chain(&error), "changes that make a volume"),
        }
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
        let geometry = self.geometry(&path, &spec.geometry, volume.as_ref())?;
        let placement = volume.map_or(DAffine3::IDENTITY, |v| v.volume().desc().placement);
        let transform = spec.transform.as_deref().map_or(placement, |steps| compose(steps, placement));
        let appearance = Appearance { shader: spec.shader.clone(), parameters };
        Some(Shape::build(self.scene.shape_name(index), geometry, appearance, transform))
    }

    /// All values that can be made; those that cannot are problems.
    fn parameters(
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
                other => match other.to_value(declared(name).as_ref(), self.base) {
                    Ok(value) => Some(value),
                    Err(problem) => self.refuse(&path, problem.found, problem.wanted),
                },
            };
            made.extend(value.map(|value| (name.clone(), value)));
        }
        made
    }

    fn texture(&mut self, path: &str, spec: &VolumeSpec) -> Option<VolumeTexture> {
        // Data that could not be read is a problem already.
        let volume = self.data.get(spec.data.as_str())?.clone();
        let mut texture = VolumeTexture::new(&volume).with_filter(spec.filter);
        if spec.luminance {
            texture = texture.as_luminance();
        }
        if let Some(roi) = spec.data_roi {
            let Ok(cut) = texture.with_data_roi(roi) else {
                let wanted = format!("a part of {:?} samples", volume.dims());
                return self.refuse(&format!("{path}.data_roi"), format!("{:?} to {:?}", roi.min, roi.max), wanted);
            };
            texture = cut;
        }
        let ranged = spec.range.map_or(Ok(texture.clone()), |range| texture.with_range(range));
        match ranged.and_then(|t| spec.geometry_roi.map_or(Ok(t.clone()), |roi| t.with_geometry_roi(roi))) {
            Ok(texture) => Some(texture),
            Err(error) => self.refuse(path, chain(&error), "a volume texture"),
        }
    }

    fn geometry(
        &mut self,
        path: &str,
        spec: &GeometrySpec,
        volume: Option<&VolumeTexture>,
    ) -> Option<Arc<dyn Geometry>> {
        let path = format!("{path}.geometry");
        let made = match spec {
            GeometrySpec::Around => {
                let roi = volume.map(VolumeTexture::geometry_roi);
                return roi.map(|roi| Arc::new(Block::from(roi)) as Arc<dyn Geometry>);
            }
            GeometrySpec::Block { offset, dimensions } => {
                Block::new(*offset, *dimensions).map(|block| Arc::new(block) as Arc<dyn Geometry>)
            }
            GeometrySpec::Named { name, parameters } => {
                let declarations = self.registry.declarations();
                let declaration = declarations.into_iter().find(|d| d.name == *name).cloned();
                let declared = |name: &str| declaration.as_ref()?.parameter(name).cloned();
                let parameters = self.parameters(&format!("{path}.parameters"), parameters, declared);
                self.registry.geometry(name, &parameters)
            }
        };
        match made {
            Ok(geometry) => Some(geometry),
            Err(error) => self.refuse(&path, chain(&error), "a geometry"),
        }
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
        if let Err(error) = frame.validate() {
            self.refuse::<()>("image", chain(&error), "a picture that can be drawn");
        }
        frame
    }
}

/// All steps in order, as one map.
fn compose(steps: &[TransformStep], placement: DAffine3) -> DAffine3 {
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

impl ShapeSpec {
    /// Whether a parameter of the shape or its geometry reads that data.
    fn uses(&self, data: &str) -> bool {
        let of_geometry = match &self.geometry {
            GeometrySpec::Named { parameters, .. } => Some(parameters),
            _ => None,
        };
        let values = self.parameters.values().chain(of_geometry.into_iter().flat_map(|p| p.values()));
        values.into_iter().any(|value| matches!(value, ParameterSpec::Volume(volume) if volume.data == data))
    }
}
