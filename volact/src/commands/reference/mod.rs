//! `volact describe --all --markdown DIR`: a page for each kind of what is registered, with pictures.
//!
//! The text comes from the declarations. The pictures come from `DIR/scenes/KIND-NAME.ron`, which
//! are drawn into `DIR/pictures/KIND-NAME.png`: what has no scene there has no picture.

mod page;
mod pictures;

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::Context as _;
use volact::{Declaration, Registry, core::parameter::Kind};

/// Where things are, seen from the pages.
pub struct Place<'a> {
    /// The folder of the pages.
    pub folder: &'a Path,
    /// What links to the sources of the shaders that come with Volact begin with.
    pub sources: Option<&'a str>,
    /// The folder for paths in scenes that begin with `$VOLACT_DATA`.
    pub data: Option<&'a Path>,
}

/// The kinds, each with its plural, which is its page.
pub const KINDS: [(Kind, &str); 4] =
    [(Kind::Action, "actions"), (Kind::Shader, "shaders"), (Kind::Geometry, "geometries"), (Kind::Loader, "loaders")];

/// Writes the pages, and draws the pictures if they are wanted.
///
/// # Errors
/// If a file cannot be written or a scene not drawn; all pages are written before.
pub fn write(registry: &Registry, place: &Place, draw: bool) -> anyhow::Result<()> {
    let cannot = |path: &Path| format!("{}: cannot be written", path.display());
    fs::create_dir_all(place.folder).with_context(|| cannot(place.folder))?;
    for (kind, plural) in KINDS {
        let path = place.folder.join(plural).with_extension("md");
        replace(&path, &page::page(kind, plural, registry, place)).with_context(|| cannot(&path))?;
    }
    if draw { pictures::draw(registry, place) } else { Ok(()) }
}

/// Writes a text under another name and renames it.
fn replace(path: &Path, text: &str) -> std::io::Result<()> {
    let aside = path.with_extension("md.new");
    fs::write(&aside, text)?;
    fs::rename(aside, path)
}

/// The scene of something registered.
fn scene(folder: &Path, d: &Declaration) -> PathBuf {
    folder.join("scenes").join(format!("{}-{}.ron", d.kind.name(), d.name))
}
