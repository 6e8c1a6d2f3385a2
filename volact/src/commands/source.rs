//! What to draw: a scene file, or a bare volume or mesh with a look of its own (`bare`).

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use anyhow::{Context as _, bail};
use volact::{
    Aabb, Frame, FrameDesc, Options, Registry, Shape, View,
    config::Config,
    core::{
        glam::DVec3,
        planner::{Bound, Goals},
        scene::{CameraSpec, Folders, KeptData, Scene, SceneFile, SceneFiles},
        select::{self, Choice},
    },
};

use super::{
    bare,
    cuts::{Cut, Slice},
    progress::Line,
    settings::{self, Setting, Size},
};

/// Arguments that say what to draw and how; shared by commands that draw.
#[derive(clap::Args, Default)]
#[group(skip)]
pub struct Args {
    /// A scene (.ron), or bare data: a volume (a file, or a folder with a series), mesh or surface
    #[arg(value_name = "SCENE.ron | DATA")]
    pub input: PathBuf,
    /// Columns and rows
    #[arg(short, long, value_name = "WxH|N")]
    pub size: Option<Size>,
    /// Look from: front, back, left, right, top, bottom or iso
    #[arg(long, value_name = "VIEW", value_parser = settings::view)]
    pub view: Option<View>,
    /// What is up in bare data: x, y, z, -x, -y or -z [default: z]
    #[arg(long, value_name = "AXIS", value_parser = settings::up, allow_hyphen_values = true)]
    pub up: Option<DVec3>,
    /// Distance between samples in world units (the action's option `sample_distance`)
    #[arg(long, value_name = "DISTANCE")]
    pub step: Option<f64>,
    /// Ask for an error: the largest difference of any channel, e.g. 0.002; the cheapest settings that keep it are taken
    #[arg(long, value_name = "ERROR", value_parser = settings::positive, conflicts_with_all = ["rmse", "step"])]
    pub max_error: Option<f64>,
    /// Ask for an error: the root of the mean square over all channels
    #[arg(long, value_name = "ERROR", value_parser = settings::positive, conflicts_with = "step")]
    pub rmse: Option<f64>,
    /// Ask for a time: the least error within it
    #[arg(long, value_name = "MS", value_parser = settings::positive, conflicts_with = "step")]
    pub milliseconds: Option<f64>,
    /// Threads (the action's option `threads`)
    #[arg(long, value_name = "N")]
    pub threads: Option<u32>,
    /// Set a parameter of all shapes, or of one: SHAPE.NAME=VALUE; values as in scenes
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub set: Vec<Setting>,
    /// Set an option of the action
    #[arg(long = "option", value_name = "NAME=VALUE")]
    pub option: Vec<Setting>,
    /// Keep only a part, in world space: x<0.5, z>40% (of what is drawn), or a region as in scenes
    #[arg(long, value_name = "CUT")]
    pub clip: Vec<Cut>,
    /// Draw bare data on a plane in world space: x=0.5, z=40%, or Plane(…) as in scenes
    #[arg(long, value_name = "PLANE")]
    pub slice: Vec<Slice>,
    /// Draw what lies around the slices, too
    #[arg(long, requires = "slice")]
    pub around_slices: bool,
    /// Draw bare data with this shader instead of the one that suits it
    #[arg(long, value_name = "NAME")]
    pub shader: Option<String>,
    /// Show this attribute of a bare mesh: NAME, or NAME[2] for one of its components
    #[arg(long, value_name = "NAME")]
    pub attribute: Option<String>,
    /// Read bare data with this loader instead of the one that knows it
    #[arg(long, value_name = "NAME")]
    pub loader: Option<String>,
    /// An option of that loader, e.g. those of raw files: dims=(64, 64, 64)
    #[arg(long = "load", value_name = "NAME=VALUE")]
    pub load: Vec<Setting>,
    /// Background: r,g,b[,opacity] or #rrggbb
    #[arg(long, value_name = "COLOR", value_parser = settings::background)]
    pub background: Option<[f32; 4]>,
    /// The folder for paths in scenes that begin with $VOLACT_DATA; else that environment variable
    #[arg(long, value_name = "FOLDER")]
    pub data_dir: Option<PathBuf>,
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

/// A scene, with what the command line says about it.
pub struct Opened {
    /// What to draw, and how as far as the scene says.
    pub scene: Scene,
    /// What was chosen for the user, in words.
    pub notes: Vec<String>,
    /// The config in force.
    pub config: Config,
    /// Options for actions from the command line.
    pub options: Options,
}

impl Opened {
    /// The action asked for, else the scene's, with its options: the command line's above the
    /// scene's, if they are for the same action.
    pub fn action(&self, asked: Option<&str>) -> (Option<String>, Options) {
        let of_scene = self.scene.action.as_ref().filter(|(name, _)| asked.is_none_or(|asked| asked == name));
        let mut options = of_scene.map(|(_, options)| options.clone()).unwrap_or_default();
        options.extend(self.options.clone());
        (asked.map(str::to_owned).or_else(|| of_scene.map(|(name, _)| name.clone())), options)
    }
}

impl Source {
    /// Reads everything and chooses an action.
    pub fn open(args: &Args, action: Option<&str>, registry: &Registry) -> anyhow::Result<Self> {
        let opened = args.open(registry)?;
        let (name, options) = opened.action(action);
        let goals = args.goals(&opened.scene);
        let Opened { scene, notes, config, .. } = opened;
        let choice = select::select_for(registry, &config, name.as_deref(), &options, (&goals, &scene.shapes))?;
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
    /// Reads everything.
    pub fn open(&self, registry: &Registry) -> anyhow::Result<Opened> {
        self.open_keeping(registry, &mut KeptData::default())
    }

    /// Reads everything but the data that are kept from the last time.
    pub fn open_keeping(&self, registry: &Registry, kept: &mut KeptData) -> anyhow::Result<Opened> {
        let config = settings::config(self.config.clone())?;
        let options = self.options()?;
        let (mut scene, notes) = match self.is_scene() {
            true => (self.scene(registry, &config, kept)?, Vec::new()),
            false => bare::open(self, registry, &config, kept)?,
        };
        super::warn_of_shaders(registry);
        let bounds = bounds(&scene.shapes);
        for cut in &self.clip {
            scene.frame.clip = scene.frame.clip.with(cut.region(&bounds)?);
        }
        Ok(Opened { scene, notes, config, options })
    }

    /// The scene file, if it is one that is drawn.
    pub fn scene_file(&self) -> Option<&Path> {
        Some(self.input.as_path()).filter(|path| path.extension().is_some_and(|e| e == "ron"))
    }

    /// What is asked for: on the command line, else in the scene. A distance of samples there asks for nothing.
    pub fn goals(&self, scene: &Scene) -> Goals {
        let bound = self.max_error.map(Bound::MaxError).or(self.rmse.map(Bound::Rmse));
        let time = self.milliseconds.map(|ms| Duration::from_secs_f64((ms * 1e-3).min(1e6)));
        match (bound, time, self.step) {
            (None, None, Some(_)) => Goals::default(),
            (None, None, None) => scene.goals,
            _ => Goals { bound, time },
        }
    }

    /// Whether the input is a scene: `.ron`, but not the `.raw.ron` that describes raw voxels.
    pub fn is_scene(&self) -> bool {
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

    fn scene(&self, registry: &Registry, config: &Config, kept: &mut KeptData) -> anyhow::Result<Scene> {
        let bare = self.up.is_some() || self.shader.is_some() || self.attribute.is_some() || !self.slice.is_empty();
        if bare || self.loader.is_some() || !self.load.is_empty() {
            bail!(
                "--up, --shader, --attribute, --slice, --loader and --load are for bare data; a scene says these things itself"
            );
        }
        let cannot = || format!("{}: cannot be drawn", self.input.display());
        let mut file = SceneFile::open(&self.input, registry).with_context(cannot)?;
        self.change(&mut file)?;
        let view = self.view.map(CameraSpec::View);
        file.camera = view.or(file.camera).or(Some(CameraSpec::View(config.view)));
        let Size(size) = self.size.unwrap_or(Size(file.image.size.unwrap_or(config.size)));
        file.image.size = Some(size);
        file.image.background = self.background.or(file.image.background).or(Some(config.background));
        let data = self.data_folder();
        let line = Line::new("reading");
        file.build_keeping(registry, self.folders(data.as_deref()), &line, kept)
            .map_err(|problems| problems.of_file(self.input.display().to_string()))
            .with_context(cannot)
    }

    /// Changes parameters as `--set` says.
    fn change(&self, file: &mut SceneFile) -> anyhow::Result<()> {
        let names: Vec<_> = (0..file.shapes.len()).map(|i| file.shape_name(i)).collect();
        for setting in &self.set {
            let (shape, parameter) = settings::shape_of(&setting.name, &names)?;
            file.set_parameter(shape, parameter, &setting.value);
        }
        Ok(())
    }

    /// The files that a scene of this text names; `None` where it is none.
    pub fn files(&self, text: &str) -> Option<SceneFiles> {
        let mut file = SceneFile::parse(text).ok()?;
        self.change(&mut file).ok()?;
        Some(file.files(self.folders(self.data_folder().as_deref())))
    }

    /// The folders to which the paths in a scene are relative.
    fn folders<'a>(&'a self, data: Option<&'a Path>) -> Folders<'a> {
        Folders { base: self.input.parent().unwrap_or(Path::new("")), data }
    }

    /// The folder for paths that begin with `$VOLACT_DATA`.
    fn data_folder(&self) -> Option<PathBuf> {
        let given = self.data_dir.clone();
        given.or_else(|| std::env::var_os("VOLACT_DATA").filter(|folder| !folder.is_empty()).map(PathBuf::from))
    }
}

/// The world box around all shapes.
pub fn bounds(shapes: &[Shape]) -> Aabb {
    shapes.iter().fold(Aabb::EMPTY, |b, shape| b.union(&shape.state().world_bounds()))
}
