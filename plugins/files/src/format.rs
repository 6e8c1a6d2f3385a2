//! One file format as a [`Loader`].

use std::path::Path;

use volact_core::{
    Declaration, LoadError, LoadOptions, Loader, ParameterDecl, ParameterType, ParameterValue, VolumeReader,
    glam::DVec3,
    loader::{Confidence, Probe},
    parameter::Kind,
};

use crate::storage::Storage;

type Open = fn(&Storage, &Path, &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError>;

/// A loader made of a declaration and two functions.
pub(crate) struct Format {
    declaration: Declaration,
    probe: fn(&Probe<'_>) -> Confidence,
    open: Open,
}

impl Format {
    pub(crate) fn new(name: &str, description: &str, probe: fn(&Probe<'_>) -> Confidence, open: Open) -> Self {
        let declaration = Declaration::new(Kind::Loader, name, env!("CARGO_PKG_VERSION"), description);
        Self { declaration, probe, open }
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
        (self.open)(storage, path, options)
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
        (self.open)(&Storage::Disk, path, options)
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
