//! Data that were read for a scene, so that the next version of the scene need not read them again.

use std::path::{Path, PathBuf};

use super::{DataSpec, build::plain};
use crate::{Data, LoadError, Progress, Registry};

/// What [`SceneFile::build_keeping`](super::SceneFile::build_keeping) has read. It does not look at
/// files: whoever knows that one has changed says so ([`retain`](Self::retain)).
#[derive(Debug, Default)]
pub struct KeptData(Vec<Entry>);

#[derive(Debug)]
struct Entry {
    path: PathBuf,
    spec: DataSpec,
    /// As the file has it.
    read: Data,
    /// With what the description changes about it.
    adjusted: Option<Data>,
    /// Whether the build at hand uses it.
    used: bool,
}

impl KeptData {
    /// Reads what a file holds, unless it is here already, from the same place by the same loader
    /// with the same options.
    ///
    /// # Errors
    /// As [`Registry::load_any`].
    pub fn load(
        &mut self,
        registry: &Registry,
        path: &Path,
        spec: &DataSpec,
        progress: &dyn Progress,
    ) -> Result<Data, LoadError> {
        let same = |e: &&mut Entry| e.path == path && e.spec.loader == spec.loader && e.spec.options == spec.options;
        let there = self.0.iter_mut().find(same).map(|entry| entry.read.clone());
        if let Some(entry) = self.entry(path, spec) {
            entry.used = true;
            return Ok(entry.read.clone());
        }
        let read = match there {
            Some(read) => read,
            None => registry.load_any(path, spec.loader.as_deref(), &plain(&spec.options), progress)?,
        };
        let entry = Entry { path: path.into(), spec: spec.clone(), read: read.clone(), adjusted: None, used: true };
        self.0.push(entry);
        Ok(read)
    }

    /// Forgets the files for which `keep` is false.
    pub fn retain(&mut self, mut keep: impl FnMut(&Path) -> bool) {
        self.0.retain(|entry| keep(&entry.path));
    }

    /// Forgets what nobody has asked for since the last call.
    pub fn retain_used(&mut self) {
        self.0.retain_mut(|entry| std::mem::take(&mut entry.used));
    }

    pub(super) fn adjusted(&mut self, path: &Path, spec: &DataSpec) -> Option<Data> {
        self.entry(path, spec)?.adjusted.clone()
    }

    pub(super) fn set_adjusted(&mut self, path: &Path, spec: &DataSpec, data: &Data) {
        if let Some(entry) = self.entry(path, spec) {
            entry.adjusted = Some(data.clone());
        }
    }

    fn entry(&mut self, path: &Path, spec: &DataSpec) -> Option<&mut Entry> {
        self.0.iter_mut().find(|entry| entry.path == path && entry.spec == *spec)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        loader::NoProgress,
        scene::{Folders, SceneFile},
    };

    /// There is no loader here, so reading is an error: what succeeds was kept.
    #[test]
    fn what_is_forgotten_is_read_again() {
        use crate::{ScalarType, Volume, VolumeDesc};
        let volume = Volume::new(VolumeDesc::new([2; 3], ScalarType::U8, 1), vec![0u8; 8]).unwrap();
        let text = r#"(version: 1, data: {"a": (file: "a.nrrd", spacing: (1, 1, 2))}, shapes: [(shader: "simple",
            parameters: {"volume": Volume(data: "a")})])"#;
        let registry = Registry::with_core();
        let file = SceneFile::parse_with(text, &registry).unwrap();
        let folders = Folders::from(Path::new("place"));
        let mut kept = KeptData::default();
        assert!(file.build_keeping(&registry, folders, &NoProgress, &mut kept).is_err(), "nobody can read it");
        let spec = file.data["a"].clone();
        let path = Path::new("place").join("a.nrrd");
        let read = Data::Volume(volume);
        kept.0.push(Entry { path, spec, read, adjusted: None, used: false });
        let mut ids = (0..2).map(|_| {
            let scene = file.build_keeping(&registry, folders, &NoProgress, &mut kept).unwrap();
            let texture = scene.shapes[0].state().volume().unwrap().clone();
            assert_eq!(texture.volume().desc().spacing.z, 2.0);
            texture.volume().id()
        });
        assert_eq!(ids.next(), ids.next(), "also what was adjusted is the same");
        kept.retain(|path| !path.ends_with("a.nrrd"));
        assert!(file.build_keeping(&registry, folders, &NoProgress, &mut kept).is_err());
    }
}
