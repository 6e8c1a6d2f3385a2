//! One file format as a [`Loader`].

use std::path::Path;

use volact_core::{
    Declaration, LoadError, LoadOptions, Loader, MeshData, ParameterDecl, ParameterType, ParameterValue, Progress,
    VolumeReader,
    glam::DVec3,
    loader::{Confidence, Content, Probe},
    parameter::Kind,
};

use crate::storage::Storage;

type Recognise = fn(&Probe<'_>) -> Confidence;
type Open = fn(&Storage, &Path, &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError>;
type ReadMesh = fn(&Storage, &Path, &LoadOptions, &dyn Progress) -> Result<MeshData, LoadError>;

enum Read {
    Volume(Open),
    Mesh(ReadMesh),
}

/// A loader made of a declaration and two functions.
pub(crate) struct Format {
    declaration: Declaration,
    probe: Recognise,
    read: Read,
}

impl Format {
    /// A format of volumes.
    pub(crate) fn new(name: &str, description: &str, probe: Recognise, open: Open) -> Self {
        Self::of(name, description, probe, Read::Volume(open))
    }

    /// A format of meshes or surfaces.
    pub(crate) fn of_meshes(name: &str, description: &str, probe: Recognise, read: ReadMesh) -> Self {
        Self::of(name, description, probe, Read::Mesh(read))
    }

    fn of(name: &str, description: &str, probe: Recognise, read: Read) -> Self {
        let declaration = Declaration::new(Kind::Loader, name, env!("CARGO_PKG_VERSION"), description);
        Self { declaration, probe, read }
    }

    pub(crate) fn with(mut self, option: ParameterDecl) -> Self {
        self.declaration = self.declaration.with(option);
        self
    }

    pub(crate) fn name(&self) -> &str {
        &self.declaration.name
    }

    pub(crate) fn open_in(
        &self,
        storage: &Storage,
        path: &Path,
        options: &LoadOptions,
    ) -> Result<Box<dyn VolumeReader>, LoadError> {
        match self.read {
            Read::Volume(open) => open(storage, path, options),
            Read::Mesh(_) => {
                let (what, cure) = (format!("a volume by loader {:?}", self.name()), "it reads meshes".into());
                Err(LoadError::Unsupported { path: path.into(), what, cure })
            }
        }
    }

    pub(crate) fn read_mesh_in(
        &self,
        storage: &Storage,
        path: &Path,
        options: &LoadOptions,
        progress: &dyn Progress,
    ) -> Result<MeshData, LoadError> {
        match self.read {
            Read::Mesh(read) => read(storage, path, options, progress),
            Read::Volume(_) => {
                let (what, cure) = (format!("a mesh by loader {:?}", self.name()), "it reads volumes".into());
                Err(LoadError::Unsupported { path: path.into(), what, cure })
            }
        }
    }
}

impl Loader for Format {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn probe(&self, probe: &Probe<'_>) -> Confidence {
        (self.probe)(probe)
    }

    fn open(&self, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
        self.open_in(&Storage::Disk, path, options)
    }

    fn content(&self) -> Content {
        match self.read {
            Read::Volume(_) => Content::Volume,
            Read::Mesh(_) => Content::Mesh,
        }
    }

    fn read_mesh(&self, path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<MeshData, LoadError> {
        self.read_mesh_in(&Storage::Disk, path, options, progress)
    }
}

/// The answer of a loader that knows its files by content or, failing that, by extension.
pub(crate) fn confidence(content: bool, probe: &Probe<'_>, extensions: &[&str]) -> Confidence {
    let name = probe.file_name();
    if content {
        Confidence::Content
    } else if !probe.is_dir && extensions.iter().any(|e| name.ends_with(e)) {
        Confidence::Extension
    } else {
        Confidence::No
    }
}

/// The option that gives a spacing to formats that carry none.
pub(crate) fn spacing_option() -> ParameterDecl {
    ParameterDecl::new("spacing", ParameterType::Vec3, "distance between samples along x, y, z, instead of the file's")
}

pub(crate) fn spacing_given(options: &LoadOptions) -> Option<DVec3> {
    match options.get("spacing") {
        Some(ParameterValue::Vec3(spacing)) => Some(*spacing),
        _ => None,
    }
}

pub(crate) fn flag(options: &LoadOptions, name: &str) -> bool {
    matches!(options.get(name), Some(ParameterValue::Bool(true)))
}

/// A flag that may be left open.
pub(crate) fn flag_given(options: &LoadOptions, name: &str) -> Option<bool> {
    match options.get(name) {
        Some(ParameterValue::Bool(value)) => Some(*value),
        _ => None,
    }
}

pub(crate) fn int(options: &LoadOptions, name: &str) -> Option<i64> {
    match options.get(name) {
        Some(ParameterValue::Int(value)) => Some(*value),
        _ => None,
    }
}

pub(crate) fn text<'a>(options: &'a LoadOptions, name: &str) -> Option<&'a str> {
    match options.get(name) {
        Some(ParameterValue::Choice(word)) => Some(word),
        _ => None,
    }
}

/// The name of a volume: its file's.
pub(crate) fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// A file beside another.
pub(crate) fn beside(path: &Path, name: &str) -> std::path::PathBuf {
    path.parent().unwrap_or(Path::new("")).join(name)
}
