//! Draws a scene again after edits, and redoes only what depends on them.
//!
//! Data files that did not change are not read again. As long as action, options and shaders stay,
//! so does the action, and its shapes become those of the edited scene part by part: what did not
//! change keeps its identity, so that the action prepares nothing for it. Otherwise, and where that
//! fails, everything is as in a fresh run, errors included.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
    sync::Arc,
};

use anyhow::Context as _;
use volact::{
    Frame, Geometry, Options, ParameterValue, Registry, ShaderEntry, Shape, Sliced,
    config::Config,
    core::{parameter::ParameterMap, planner::Goals, scene::KeptData, select},
};

use super::{super::settings, files::Root};
use crate::commands::{
    progress::Line,
    render::Args,
    shader_folders,
    source::{Opened, Source},
};

/// What an action was chosen by.
#[derive(Clone, PartialEq)]
struct Chosen {
    config: Config,
    name: Option<String>,
    options: Options,
    goals: Goals,
    /// The shader of each shape, as it was registered.
    shaders: Vec<Option<Arc<ShaderEntry>>>,
}

/// What stays from picture to picture.
pub struct Session<'a> {
    args: &'a Args,
    /// Without the shaders of folders.
    registry: &'a Registry,
    kept: KeptData,
    drawn: Option<(Source, Chosen)>,
    picture: bool,
    /// The plugins are those of this config.
    config: Option<Config>,
    /// As of the last scene that could be read.
    roots: BTreeSet<Root>,
}

impl<'a> Session<'a> {
    /// Nothing is drawn yet.
    pub fn new(args: &'a Args, registry: &'a Registry) -> Self {
        Self {
            args,
            registry,
            kept: KeptData::default(),
            drawn: None,
            picture: false,
            config: None,
            roots: BTreeSet::new(),
        }
    }

    /// What the command line says.
    pub fn args(&self) -> &Args {
        self.args
    }

    /// Whether there is a picture.
    pub fn drawn(&self) -> bool {
        self.picture
    }

    /// What was drawn last.
    pub fn source(&self) -> Option<&Source> {
        self.drawn.as_ref().map(|(source, _)| source)
    }

    /// All that the picture depends on. While the scene cannot be read, it is what it was.
    pub fn roots(&mut self) -> BTreeSet<Root> {
        let source = &self.args.source;
        let mut roots = BTreeSet::new();
        if source.is_scene() {
            roots.insert(Root::File(source.input.clone()));
            let files = fs::read_to_string(&source.input).ok().and_then(|text| source.files(&text));
            match files {
                Some(files) => {
                    roots.extend(files.data.into_iter().map(Root::Data));
                    roots.extend(files.others.into_iter().map(Root::File));
                }
                None => roots.extend(self.roots.iter().cloned()),
            }
        } else {
            roots.insert(Root::Data(source.input.clone()));
        }
        roots.extend(settings::config_file(source.config.clone()).map(Root::File));
        match settings::config(source.config.clone()) {
            Ok(config) => {
                roots.extend(shader_folders(&config, &Vec::from_iter(self.args.scene())).into_iter().map(Root::Shaders))
            }
            Err(_) => roots.extend(self.roots.iter().filter(|root| matches!(root, Root::Shaders(_))).cloned()),
        }
        self.roots = roots;
        self.roots.clone()
    }

    /// Draws the files as they are. Data are read again unless they are the `same` as the last time.
    ///
    /// # Errors
    /// What a fresh run would say.
    pub fn draw(&mut self, same: impl Fn(&Path) -> bool) -> anyhow::Result<Frame> {
        self.kept.retain(same);
        let registry = self.registry()?;
        let opened = self.args.source.open_keeping(&registry, &mut self.kept)?;
        let (name, options) = opened.action(self.args.action.as_deref());
        let goals = self.args.source.goals(&opened.scene);
        let Opened { scene, notes, config, .. } = opened;
        let catalog = registry.shaders();
        let shaders = scene.shapes.iter().map(|shape| catalog.get(&shape.state().shader).cloned()).collect();
        self.warn_of_plugins(&config);
        let chosen = Chosen { config, name, options, goals, shaders };
        if let Some((mut source, _)) = self.drawn.take().filter(|(_, before)| *before == chosen) {
            (source.frame, source.notes) = (scene.frame.clone(), notes.clone());
            let _line = Line::new(format!("drawing with {}", source.choice.name));
            match become_those(&mut source, &scene.shapes).and_then(|()| source.draw()) {
                Ok(frame) => {
                    self.drawn = Some((source, chosen));
                    return Ok(frame);
                }
                Err(error) => log::debug!("chosen anew: {error:#}"),
            }
        }
        let Chosen { config, name, options, .. } = &chosen;
        let choice = select::select_for(&registry, config, name.as_deref(), options, (&chosen.goals, &scene.shapes))?;
        let mut source = Source { shapes: scene.shapes, frame: scene.frame, choice, notes };
        let line = Line::new(format!("drawing with {}", source.choice.name));
        let frame = source.draw()?;
        drop(line);
        (self.drawn, self.picture) = (Some((source, chosen)), true);
        Ok(frame)
    }

    /// The next finer picture of what has not changed.
    ///
    /// # Errors
    /// If it cannot be drawn.
    pub fn refine(&mut self) -> anyhow::Result<Option<Frame>> {
        self.drawn.as_mut().map(|(source, _)| source.draw()).transpose()
    }

    /// With the shaders of all folders, as they are now.
    fn registry(&self) -> anyhow::Result<Registry> {
        let mut registry = self.registry.clone();
        let config = settings::config(self.args.config())?;
        for folder in shader_folders(&config, &Vec::from_iter(self.args.scene())) {
            volact::shaders::add_folder(&mut registry, &folder)?;
        }
        Ok(registry)
    }

    /// Libraries stay loaded, so others are not taken while the program runs.
    fn warn_of_plugins(&mut self, config: &Config) {
        let before = self.config.replace(config.clone());
        let of = |c: &Config| (c.plugins.clone(), c.plugin_folders.clone(), c.names.clone());
        if before.is_some_and(|before| of(config) != of(&before)) {
            log::warn!("plugins are loaded at the start only; start again to have those of the config");
        }
    }
}

/// Makes the shapes that are managed those of another scene.
fn become_those(source: &mut Source, wanted: &[Shape]) -> anyhow::Result<()> {
    let action = &mut source.choice.action;
    let mut before: BTreeMap<String, Vec<Shape>> = BTreeMap::new();
    for shape in source.shapes.drain(..).rev() {
        before.entry(shape.name().to_owned()).or_default().push(shape);
    }
    for shape in wanted {
        let there = before.get_mut(shape.name()).and_then(Vec::pop);
        source.shapes.push(match there {
            Some(there) if same_geometry(&there.state().geometry, &shape.state().geometry) => {
                update(&there, shape);
                there
            }
            there => {
                there.iter().try_for_each(|there| action.unmanage(there))?;
                action.manage(shape)?;
                shape.clone()
            }
        });
    }
    let gone = before.into_values().flatten().try_for_each(|shape| action.unmanage(&shape));
    gone.context("a shape that is gone")
}

/// Gives a shape everything of another but its geometry, which is the same.
fn update(shape: &Shape, wanted: &Shape) {
    let (before, wanted) = (shape.state(), wanted.state());
    shape.set_shader(wanted.shader);
    shape.set_transform(wanted.transform);
    shape.set_clip(wanted.clip);
    let gone = |name: &&String| !wanted.parameters.contains_key(*name);
    before.parameters.keys().filter(gone).for_each(|name| _ = shape.remove_parameter(name));
    for (name, value) in changed(&before.parameters, &wanted.parameters) {
        shape.set_parameter(name, value.clone());
    }
}

fn changed<'a>(before: &ParameterMap, wanted: &'a ParameterMap) -> Vec<(&'a String, &'a ParameterValue)> {
    wanted.iter().filter(|(name, value)| !before.get(*name).is_some_and(|b| same_value(b, value))).collect()
}

/// Whether two values have the same content.
fn same_value(a: &ParameterValue, b: &ParameterValue) -> bool {
    match (a, b) {
        (ParameterValue::Table(a), ParameterValue::Table(b)) => {
            // Tables without values of their own take the volume's range: two tell.
            let ranges = [[0.0, 1.0], [-3.0, 7.0]];
            a == b || a.interpolation() == b.interpolation() && ranges.iter().all(|r| a.points(*r) == b.points(*r))
        }
        (ParameterValue::Attribute(a), ParameterValue::Attribute(b)) => {
            let facts = |a: &volact::Attribute| (a.name.clone(), a.scalar, a.components);
            a == b || facts(a) == facts(b) && a.data.bytes() == b.data.bytes()
        }
        _ => a == b,
    }
}

/// Whether two geometries are known to be the same.
fn same_geometry(a: &Arc<dyn Geometry>, b: &Arc<dyn Geometry>) -> bool {
    if let (Some(a), Some(b)) = (a.as_any().downcast_ref::<Sliced>(), b.as_any().downcast_ref::<Sliced>()) {
        return a.slices() == b.slices() && same_geometry(a.geometry(), b.geometry());
    }
    match (a.as_block(), b.as_block()) {
        (Some(p), Some(q)) => p == q && a.name() == b.name(),
        _ => Arc::ptr_eq(a, b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact::{Appearance, LookupTable, RegistryExt as _, ScalarType, Volume, VolumeDesc};

    fn shape(volume: &Volume, level: f64, unit: f64) -> Shape {
        let table = LookupTable::window_level(100.0, level, 0.5).unwrap();
        Shape::around(volume, Appearance::new("lut").with("lookup_table", table).with("unit_distance", unit))
    }

    /// What each edit makes anew: a table its classification, a camera or nothing at all nothing.
    #[test]
    fn only_what_an_edit_touches_is_made_anew() {
        let volume =
            Volume::new(VolumeDesc::new([8; 3], ScalarType::U8, 1), (0..=255).cycle().take(512).collect::<Vec<u8>>());
        let volume = volume.unwrap();
        let registry = Registry::with_builtins();
        let first = shape(&volume, 60.0, 1.0);
        let choice =
            select::select(&registry, &Config::default(), Some("cpu"), &Options::new(), std::slice::from_ref(&first))
                .unwrap();
        let frame = volact::FrameDesc::fit(&first, volact::View::Front, 24, 24);
        let mut source = Source { shapes: vec![first.clone()], frame, choice, notes: Vec::new() };
        let mut draw = |wanted: &[Shape]| {
            become_those(&mut source, wanted).unwrap();
            let frame = source.draw().unwrap();
            let mut anew: Vec<_> = frame.statistics.rebuilt.iter().map(|r| r.what.clone()).collect();
            anew.dedup();
            (anew, frame.color.to_vec())
        };
        let (anew, picture) = draw(&[first]);
        assert!(anew.contains(&"value bounds".to_owned()));
        assert_eq!(draw(&[shape(&volume, 60.0, 1.0)]), (Vec::new(), picture.clone()), "the same again");
        let (anew, other) = draw(&[shape(&volume, 120.0, 1.0)]);
        assert!(!anew.is_empty() && !anew.contains(&"value bounds".to_owned()), "{anew:?}");
        assert_ne!(other, picture);
        let (anew, _) = draw(&[shape(&volume, 120.0, 1.0), shape(&volume, 60.0, 2.0).named("second")]);
        assert!(!anew.contains(&"value bounds".to_owned()), "{anew:?}");
        assert_eq!(draw(&[shape(&volume, 60.0, 1.0)]).1, picture, "the second is gone, the table back");
    }
}
