//! What to draw: a scene file, or a bare volume with a look of its own.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use volact::{
    Appearance, Frame, FrameDesc, LoadOptions, LookupTable, Options, ParameterDecl, Registry, Shape, View, Volume,
    config::Config,
    core::{
        scene::{CameraSpec, Scene, SceneFile},
        select::{self, Choice},
    },
    transfer,
};

use super::{
    progress::Line,
    settings::{self, Setting, Size},
};

/// Arguments that say what to draw and how; shared by commands that draw.
#[derive(clap::Args)]
#[group(skip)]
pub struct Args {
    /// A scene (.ron), or a volume: a file, or a folder with a series
    #[arg(value_name = "SCENE.ron | VOLUME")]
    pub input: PathBuf,
    /// The action that draws; the scene's, else the first preferred one that can
    #[arg(short, long, value_name = "NAME")]
    pub action: Option<String>,
    /// Columns and rows
    #[arg(short, long, value_name = "WxH|N")]
    pub size: Option<Size>,
    /// Look from: front, back, left, right, top, bottom or iso
    #[arg(long, value_name = "VIEW", value_parser = settings::view)]
    pub view: Option<View>,
    /// Distance between samples in world units (the action's option `sample_distance`)
    #[arg(long, value_name = "DISTANCE")]
    pub step: Option<f64>,
    /// Threads (the action's option `threads`)
    #[arg(long, value_name = "N")]
    pub threads: Option<u32>,
    /// Set a parameter of all shapes, or of one: SHAPE.NAME=VALUE; values as in scenes
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub set: Vec<Setting>,
    /// Set an option of the action
    #[arg(long = "option", value_name = "NAME=VALUE")]
    pub option: Vec<Setting>,
    /// Draw a bare volume with this shader instead of the one that suits it
    #[arg(long, value_name = "NAME")]
    pub shader: Option<String>,
    /// Read a bare volume with this loader instead of the one that knows it
    #[arg(long, value_name = "NAME")]
    pub loader: Option<String>,
    /// An option of that loader, e.g. those of raw files: dims=(64, 64, 64)
    #[arg(long = "load", value_name = "NAME=VALUE")]
    pub load: Vec<Setting>,
    /// Background: r,g,b[,opacity] or #rrggbb
    #[arg(long, value_name = "COLOR", value_parser = settings::background)]
    pub background: Option<[f32; 4]>,
    /// The config file; else VOLACT_CONFIG, else the user's volact/config.ron
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
}

/// Something that can be drawn, with the action that will.
pub struct Source {
    /// The shapes, in order.
    pub shapes: Vec<Shape>,
    /// The frame.
    pub frame: FrameDesc,
    /// The action, which manages all shapes.
    pub choice: Choice,
    /// What was chosen for the user, in words.
    pub notes: Vec<String>,
}

impl Source {
    /// Reads everything and chooses an action.
    pub fn open(args: &Args, registry: &Registry) -> anyhow::Result<Self> {
        let config = settings::config(args.config.clone())?;
        let given = args.options()?;
        let (scene, notes) = match args.is_scene() {
            true => (args.scene(registry, &config)?, Vec::new()),
            false => args.volume(registry, &config)?,
        };
        let (name, mut options) = match (&args.action, scene.action) {
            (Some(name), Some((of, options))) if *name == of => (Some(of), options),
            (Some(name), _) => (Some(name.clone()), Options::new()),
            (None, Some((name, options))) => (Some(name), options),
            (None, None) => (None, Options::new()),
        };
        options.extend(given);
        let choice = select::select(registry, &config, name.as_deref(), &options, &scene.shapes)?;
        Ok(Self { shapes: scene.shapes, frame: scene.frame, choice, notes })
    }

    /// Draws one frame.
    pub fn draw(&mut self) -> anyhow::Result<Frame> {
        let action = &mut self.choice.action;
        action.begin_draw(&self.frame)?;
        self.shapes.iter().try_for_each(|shape| action.draw(shape))?;
        Ok(action.end_draw()?)
    }
}

impl Args {
    /// Whether the input is a scene: `.ron`, but not the `.raw.ron` that describes raw voxels.
    fn is_scene(&self) -> bool {
        let name = self.input.file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default();
        name.ends_with(".ron") && !name.ends_with(".raw.ron")
    }

    fn options(&self) -> anyhow::Result<Options> {
        let mut options = settings::options(&self.option)?;
        if let Some(step) = self.step {
            options.insert("sample_distance".into(), step.into());
        }
        if let Some(threads) = self.threads {
            options.insert("threads".into(), i64::from(threads).into());
        }
        Ok(options)
    }

    fn scene(&self, registry: &Registry, config: &Config) -> anyhow::Result<Scene> {
        if self.shader.is_some() || self.loader.is_some() || !self.load.is_empty() {
            bail!("--shader, --loader and --load are for bare volumes; a scene says these things itself");
        }
        let cannot = || format!("{}: cannot be drawn", self.input.display());
        let mut file = SceneFile::open(&self.input, registry).with_context(cannot)?;
        let names: Vec<_> = (0..file.shapes.len()).map(|i| file.shape_name(i)).collect();
        for setting in &self.set {
            let (shape, parameter) = settings::shape_of(&setting.name, &names)?;
            file.set_parameter(shape, parameter, &setting.value);
        }
        let view = self.view.map(CameraSpec::View);
        file.camera = view.or(file.camera).or(Some(CameraSpec::View(config.view)));
        let Size(size) = self.size.unwrap_or(Size(file.image.size.unwrap_or(config.size)));
        file.image.size = Some(size);
        file.image.background = self.background.or(file.image.background).or(Some(config.background));
        let base = self.input.parent().unwrap_or(Path::new(""));
        let line = Line::new("reading");
        file.build(registry, base, &line)
            .map_err(|problems| problems.of_file(self.input.display().to_string()))
            .with_context(cannot)
    }

    fn volume(&self, registry: &Registry, config: &Config) -> anyhow::Result<(Scene, Vec<String>)> {
        let volume = self.load(registry)?;
        let automatic = transfer::automatic(&volume);
        let mut notes = automatic.notes.clone();
        let texture = automatic.texture(&volume);
        let appearance = match &self.shader {
            Some(shader) if *shader != automatic.shader => self.other_look(shader, &volume, registry, &mut notes),
            _ => automatic.appearance(),
        };
        let shape = Shape::around_texture(&texture, appearance);
        self.change(&shape, registry)?;
        let Size([width, height]) = self.size.unwrap_or(Size(config.size));
        let frame = match self.view {
            Some(view) => automatic.frame_from(view, width, height),
            None => automatic.frame(width, height),
        };
        let frame = frame.with_background(self.background.unwrap_or(config.background));
        Ok((Scene { shapes: vec![shape], frame, action: None }, notes))
    }

    fn load(&self, registry: &Registry) -> anyhow::Result<Volume> {
        let options: LoadOptions = settings::options(&self.load)?;
        let line = Line::new(format!("reading {}", self.input.display()));
        let cannot = || format!("{}: cannot be drawn", self.input.display());
        registry.load_with(&self.input, self.loader.as_deref(), &options, &line).with_context(cannot)
    }

    /// A shader of the user's choice shows the data's own range in grey.
    fn other_look(&self, shader: &str, volume: &Volume, registry: &Registry, notes: &mut Vec<String>) -> Appearance {
        let known =
            |name: &str| registry.shaders().get(shader).is_some_and(|s| s.declaration.parameter(name).is_some());
        let range = volume.value_range().unwrap_or([0.0, 1.0]);
        notes.clear();
        let mut appearance = Appearance::new(shader);
        if known("lookup_table") {
            notes.push(format!("grey from {} to {}", range[0], range[1]));
            appearance = appearance.with("lookup_table", LookupTable::grey(range));
        }
        appearance
    }

    /// Changes a bare volume's parameters as `--set` says.
    fn change(&self, shape: &Shape, registry: &Registry) -> anyhow::Result<()> {
        for setting in &self.set {
            let (_, parameter) = settings::shape_of(&setting.name, &[shape.name().to_owned()])?;
            let shader = shape.state().shader;
            let declared: Option<&ParameterDecl> =
                registry.shaders().get(&shader).and_then(|s| s.declaration.parameter(parameter));
            let value = setting.value.to_value(declared, Path::new(""));
            shape.set_parameter(parameter, value.with_context(|| format!("parameter {parameter:?}"))?);
        }
        Ok(())
    }
}
