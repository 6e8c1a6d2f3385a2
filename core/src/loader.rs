//! Loaders: from files to volumes, whole or region by region, and to meshes and surfaces.
//!
//! A [`Loader`] is found by name or chosen by content: [`Loader::probe`] looks at the first bytes
//! and at the path. [`Loader::open`] reads headers only and checks sizes against the files before
//! any memory is taken; the [`VolumeReader`] it returns then reads any region.
//!
//! World space of medical formats is LPS (x to the patient's left, y to the back, z to the head),
//! as in DICOM and ITK; loaders of formats that use RAS turn it.

use std::{
    fs,
    io::Read,
    path::{Path, PathBuf},
    sync::Arc,
};

use thiserror::Error;

use crate::{Buffer, Declaration, MeshData, Roi, Volume, VolumeDesc, Warning, parameter::ParameterMap};

/// Options of a load, as the loader declares them.
pub type LoadOptions = ParameterMap;

/// A box of samples to read.
pub type Region = Roi;

/// Bytes of a file's head that loaders see when probed.
pub const PROBE_BYTES: usize = 4096;

/// How sure a loader is that a file is its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Confidence {
    /// Not this format.
    No,
    /// The extension says so, the content does not contradict.
    Extension,
    /// The content says so.
    Content,
}

/// What a loader sees of a path before it opens it.
#[derive(Debug)]
pub struct Probe<'a> {
    /// The path: a file, or a directory of a series.
    pub path: &'a Path,
    /// The first bytes of the file; empty for a directory.
    pub head: &'a [u8],
    /// Whether the path is a directory.
    pub is_dir: bool,
}

impl Probe<'_> {
    /// The file's name in lower case.
    pub fn file_name(&self) -> String {
        self.path.file_name().map(|n| n.to_string_lossy().to_lowercase()).unwrap_or_default()
    }
}

/// Receives the progress of a long read and may stop it.
pub trait Progress: Sync {
    /// `done` of `total` bytes are read; `false` asks to stop.
    fn advance(&self, done: u64, total: u64) -> bool;
}

/// Progress that nobody watches.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProgress;

impl Progress for NoProgress {
    fn advance(&self, _: u64, _: u64) -> bool {
        true
    }
}

/// Why a file cannot be read, or a picture not be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LoadError {
    /// The operating system refused.
    #[error("{}: cannot be read", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error("{}: cannot be written", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// No loader knows the format.
    #[error("{}: no loader knows this format (starts with {head}); known: {known}", path.display())]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// The first bytes, printable.
        head: String,
        /// The names of all loaders.
        known: String,
    },
    /// No loader has that name.
    #[error("no loader is called {name:?}{hint}; known: {known}")]
    UnknownLoader {
        /// The name asked for.
        name: String,
        /// The nearest name, as a question.
        hint: String,
        /// All names.
        known: String,
    },
    /// The file contradicts its format.
    #[error("{}: {what} is {found}, wanted {wanted}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Which part: a header field, a slice, a tag.
        what: String,
        /// What was found.
        found: String,
        /// What was wanted.
        wanted: String,
    },
    /// The file is right but uses something that is not supported.
    #[error("{}: {what} is not supported; {cure}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it uses.
        what: String,
        /// What the user can do.
        cure: String,
    },
    /// Fewer bytes than the header promises.
    #[error("{}: holds {found} bytes of {what}, wanted {wanted}", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Of what.
        what: String,
        /// Bytes there.
        found: u64,
        /// Bytes that the header promises.
        wanted: u64,
    },
    /// A part of the data that does not exist was asked for.
    #[error("{}: region {region} asked for, wanted a part of {dims:?}", path.display())]
    Region {
        /// The file.
        path: PathBuf,
        /// The region.
        region: Region,
        /// The dimensions.
        dims: [usize; 3],
    },
    /// Options of the load are wrong.
    #[error("loader {loader:?}: {problem}")]
    Options {
        /// The loader.
        loader: String,
        /// All problems.
        problem: String,
    },
    /// The reader's progress was told to stop.
    #[error("{}: stopped", path.display())]
    Stopped {
        /// The file.
        path: PathBuf,
    },
    /// A decoder failed.
    #[error("{}: cannot be decoded", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// A plugin failed.
    #[error("{}: cannot be read", path.display())]
    Plugin {
        /// The file.
        path: PathBuf,
        /// Why.
        source: crate::plugin::PluginError,
    },
    /// The volume that the header describes cannot be.
    #[error("{}: describes no volume", path.display())]
    Volume {
        /// The file.
        path: PathBuf,
        /// Why.
        source: crate::volume::VolumeError,
    },
    /// The mesh that the file describes cannot be.
    #[error("{}: describes no mesh", path.display())]
    Geometry {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<crate::geometry::GeometryError>,
    },
    /// Numbers that do not go with the mesh's vertices.
    #[error("{}: holds an attribute that cannot be", path.display())]
    Attribute {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<crate::attribute::AttributeError>,
    },
}

impl LoadError {
    /// An I/O error about a path.
    pub fn io(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }

    /// What a decoder says about a file.
    pub fn decode(path: &Path, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Decode { path: path.into(), source: Box::new(source) }
    }

    /// An error about a file that is being written.
    pub fn write(path: &Path, source: impl std::error::Error + Send + Sync + 'static) -> Self {
        Self::Write { path: path.into(), source: Box::new(source) }
    }

    /// What a file describes is no mesh.
    pub fn geometry(path: &Path, source: crate::geometry::GeometryError) -> Self {
        Self::Geometry { path: path.into(), source: Box::new(source) }
    }

    /// A contradiction in a file.
    pub fn invalid(path: &Path, what: impl Into<String>, found: impl ToString, wanted: impl Into<String>) -> Self {
        Self::Invalid { path: path.into(), what: what.into(), found: found.to_string(), wanted: wanted.into() }
    }
}

/// An opened file: headers read, voxels not yet.
pub trait VolumeReader: Send {
    /// What the file holds.
    fn desc(&self) -> &VolumeDesc;

    /// What is worth knowing about the file: fields ignored, defects repaired.
    fn warnings(&self) -> &[Warning] {
        &[]
    }

    /// Reads a box of samples, x fastest, components interleaved, native byte order.
    ///
    /// # Errors
    /// If the region reaches outside, the file is damaged or shorter than promised, or
    /// `progress` asks to stop.
    fn read_region(&mut self, region: Region, progress: &dyn Progress) -> Result<Buffer, LoadError>;

    /// Reads everything. Formats that can, map the file instead of copying it.
    fn read(&mut self, progress: &dyn Progress) -> Result<Buffer, LoadError> {
        self.read_region(Roi::whole(self.desc().dims), progress)
    }
}

/// A file format.
pub trait Loader: Send + Sync + 'static {
    /// Name, version, options.
    fn declaration(&self) -> &Declaration;

    /// How sure it is that a file is its own, from the first bytes and the path alone.
    fn probe(&self, probe: &Probe<'_>) -> Confidence;

    /// What its files hold.
    fn content(&self) -> Content {
        Content::Volume
    }

    /// Reads the headers of a volume. `options` are checked against the declaration, defaults filled in.
    ///
    /// # Errors
    /// If the file is damaged, unsupported, or its parts have not the promised sizes.
    fn open(&self, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError>;

    /// Reads a mesh or surface. `options` are checked against the declaration, defaults filled in.
    ///
    /// # Errors
    /// If the file is damaged, unsupported or shorter than promised, what it describes is no mesh,
    /// or `progress` asks to stop.
    fn read_mesh(&self, path: &Path, _options: &LoadOptions, _progress: &dyn Progress) -> Result<MeshData, LoadError> {
        let what = format!("a mesh by loader {:?}", self.declaration().name);
        Err(LoadError::Unsupported { path: path.into(), what, cure: "it reads volumes".into() })
    }
}

/// What a loader's files hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Content {
    /// Voxels: [`Loader::open`] reads them.
    #[default]
    Volume,
    /// Meshes or surfaces: [`Loader::read_mesh`] reads them.
    Mesh,
}

/// Opens `path` with the loader that is surest of it. A tie goes to the first registered.
///
/// # Errors
/// If the path cannot be read or no loader knows it.
pub fn choose<'a>(loaders: &'a [Arc<dyn Loader>], path: &Path) -> Result<&'a Arc<dyn Loader>, LoadError> {
    let metadata = fs::metadata(path).map_err(|e| LoadError::io(path, e))?;
    let mut head = Vec::new();
    if !metadata.is_dir() {
        let file = fs::File::open(path).map_err(|e| LoadError::io(path, e))?;
        file.take(PROBE_BYTES as u64).read_to_end(&mut head).map_err(|e| LoadError::io(path, e))?;
    }
    let probe = Probe { path, head: &head, is_dir: metadata.is_dir() };
    let mut best: Option<(Confidence, &Arc<dyn Loader>)> = None;
    for loader in loaders {
        let confidence = loader.probe(&probe);
        if confidence > best.map_or(Confidence::No, |(c, _)| c) {
            best = Some((confidence, loader));
        }
    }
    best.map(|(_, loader)| loader).ok_or_else(|| LoadError::UnknownFormat {
        path: path.into(),
        head: if head.is_empty() { "nothing".into() } else { head[..head.len().min(8)].escape_ascii().to_string() },
        known: loaders.iter().map(|l| l.declaration().name.clone()).collect::<Vec<_>>().join(", "),
    })
}

/// Reads a whole volume with a given loader.
///
/// # Errors
/// As [`Loader::open`] and [`VolumeReader::read`].
pub fn load(
    loader: &dyn Loader,
    path: &Path,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<Volume, LoadError> {
    if loader.content() == Content::Mesh {
        let cure = "use it as the geometry of a shape, or load it with load_mesh".into();
        return Err(LoadError::Unsupported { path: path.into(), what: "a mesh in place of a volume".into(), cure });
    }
    let options = resolve(loader, options)?;
    let mut reader = loader.open(path, &options)?;
    let data = reader.read(progress)?;
    for warning in reader.warnings() {
        warning.emit();
    }
    Volume::new(reader.desc().clone(), data).map_err(|source| LoadError::Volume { path: path.into(), source })
}

/// Reads a mesh or surface with a given loader.
///
/// # Errors
/// As [`Loader::read_mesh`], and if the loader reads volumes.
pub fn load_mesh(
    loader: &dyn Loader,
    path: &Path,
    options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<MeshData, LoadError> {
    if loader.content() == Content::Volume {
        let cure = "use it as a volume".into();
        return Err(LoadError::Unsupported { path: path.into(), what: "a volume in place of a mesh".into(), cure });
    }
    let options = resolve(loader, options)?;
    let data = loader.read_mesh(path, &options, progress)?;
    data.warnings.iter().for_each(Warning::emit);
    Ok(data)
}

fn resolve(loader: &dyn Loader, options: &LoadOptions) -> Result<LoadOptions, LoadError> {
    let declaration = loader.declaration();
    declaration.resolve(options, |_| false).map_err(|problems| LoadError::Options {
        loader: declaration.name.clone(),
        problem: problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
    })
}
