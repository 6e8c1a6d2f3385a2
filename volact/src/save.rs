//! Pictures out, in the format that the file's name says.

use std::path::{Path, PathBuf};

use thiserror::Error;
use volact_core::{Frame, LoadError};
use volact_files::picture::{self, PngOptions};

/// A picture format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// 8 or 16 bits a channel, over the background or with straight alpha.
    Png,
    /// Premultiplied f32.
    Exr,
    /// A NumPy array of premultiplied f32.
    Npy,
}

/// Why a picture cannot be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SaveError {
    /// The name says no known format.
    #[error("{}: extension is {found}, wanted .png, .exr or .npy", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// Its extension.
        found: String,
    },
    /// The file cannot be written.
    #[error("{}: cannot be written", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<LoadError>,
    },
}

impl PictureFormat {
    /// The format that a file's name says, whatever its case.
    ///
    /// # Errors
    /// If the extension is none of a known format.
    pub fn of(path: &Path) -> Result<Self, SaveError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("png") => Ok(Self::Png),
            Some("exr") => Ok(Self::Exr),
            Some("npy") => Ok(Self::Npy),
            other => {
                let found = other.map_or("missing".into(), |e| format!(".{e}"));
                Err(SaveError::Format { path: path.into(), found })
            }
        }
    }
}

/// What this crate adds to a [`Frame`].
pub trait FrameExt {
    /// Writes the picture in the format that the name says: a PNG of 8 bits over the background,
    /// an OpenEXR or a NumPy file of what is in the frame. The file appears whole or not at all.
    ///
    /// # Errors
    /// If the extension is unknown or the file cannot be written.
    fn save(&self, path: impl AsRef<Path>) -> Result<(), SaveError>;

    /// As [`save`](Self::save), with a choice of what a PNG is.
    ///
    /// # Errors
    /// As [`save`](Self::save).
    fn save_with(&self, path: impl AsRef<Path>, png: PngOptions) -> Result<(), SaveError>;
}

impl FrameExt for Frame {
    fn save(&self, path: impl AsRef<Path>) -> Result<(), SaveError> {
        self.save_with(path, PngOptions::default())
    }

    fn save_with(&self, path: impl AsRef<Path>, png: PngOptions) -> Result<(), SaveError> {
        let path = path.as_ref();
        let written = match PictureFormat::of(path)? {
            PictureFormat::Png => picture::save_png(path, self, png),
            PictureFormat::Exr => picture::save_exr(path, self),
            PictureFormat::Npy => picture::save_npy(path, self),
        };
        written.map_err(|source| SaveError::Write { path: path.into(), source: Box::new(source) })
    }
}
