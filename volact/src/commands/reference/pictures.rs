//! The small pictures of the pages.

use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

use anyhow::{Context as _, bail};
use volact::{
    FrameExt as _, Options, Registry,
    config::Config,
    core::{loader::NoProgress, scene::Scene, select},
};

use super::{Place, scene};
use crate::commands::{progress::Line, report::time};

/// Draws every scene of what is registered.
///
/// # Errors
/// With all scenes that cannot be drawn.
pub fn draw(registry: &Registry, place: &Place) -> anyhow::Result<()> {
    let pictures = place.folder.join("pictures");
    let mut wrong = Vec::new();
    for declaration in registry.declarations() {
        let scene = scene(place.folder, declaration);
        if !scene.is_file() {
            continue;
        }
        fs::create_dir_all(&pictures).with_context(|| format!("{}: cannot be made", pictures.display()))?;
        let name = scene.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        match one(registry, &scene, place.data, &pictures.join(&name).with_extension("png")) {
            Ok(took) => log::info!("{name}: drawn in {}", time(took)),
            Err(error) => wrong.push(format!("{error:#}")),
        }
    }
    if !wrong.is_empty() {
        bail!("{} scenes cannot be drawn:\n{}", wrong.len(), wrong.join("\n"));
    }
    Ok(())
}

/// Draws a scene as it stands, without anybody's config.
fn one(registry: &Registry, path: &Path, data: Option<&Path>, picture: &Path) -> anyhow::Result<Duration> {
    let cannot = || format!("{}: cannot be drawn", path.display());
    let start = Instant::now();
    let _line = Line::new(format!("drawing {}", path.display()));
    let scene = Scene::open_with(path, data, registry, &NoProgress).with_context(cannot)?;
    let (name, options) = scene.action.clone().map_or((None, Options::new()), |(name, options)| (Some(name), options));
    let choice = select::select(registry, &Config::default(), name.as_deref(), &options, &scene.shapes);
    let mut action = choice.with_context(cannot)?.action;
    let mut draw = || {
        action.begin_draw(&scene.frame)?;
        scene.shapes.iter().try_for_each(|shape| action.draw(shape))?;
        action.end_draw()
    };
    draw().with_context(cannot)?.save(picture)?;
    Ok(start.elapsed())
}
