//! Where the files of a scene are.

use std::path::{Path, PathBuf};

use super::values::Fault;

/// A path that begins so is relative to [`Folders::data`].
pub const DATA_PREFIX: &str = "$VOLACT_DATA";

/// The folders to which the paths in a scene are relative. A path makes one whose data folder
/// nobody named.
#[derive(Clone, Copy, Debug)]
pub struct Folders<'a> {
    /// The scene file's own, for plain paths.
    pub base: &'a Path,
    /// A folder of data that are not beside the scene, for paths that begin with `$VOLACT_DATA/`.
    /// The library reads no environment variable: whoever opens the scene says which folder.
    pub data: Option<&'a Path>,
}

impl Folders<'_> {
    /// The place of a file.
    pub(super) fn path(&self, file: &Path) -> Result<PathBuf, Fault> {
        let Ok(rest) = file.strip_prefix(DATA_PREFIX) else { return Ok(self.base.join(file)) };
        let wanted = "a folder in place of $VOLACT_DATA, which nobody gave (`volact --data-dir FOLDER`, \
            or the environment variable of that name)";
        self.data
            .map(|data| data.join(rest))
            .ok_or_else(|| (format!("{:?}", file.display().to_string()), wanted.into()))
    }
}

impl<'a> From<&'a Path> for Folders<'a> {
    fn from(base: &'a Path) -> Self {
        Self { base, data: None }
    }
}
