//! The subcommands, one module each, and what they share: `source` (what to draw; `bare`, `cuts`),
//! `settings`, `progress`, `report`; `watch` draws again and again.

pub mod bare;
pub mod bench;
pub mod calibrate;
pub mod chart;
pub mod compare;
pub mod completions;
pub mod conform;
pub mod cuts;
pub mod describe;
pub mod info;
pub mod plan;
pub mod plugins;
pub mod progress;
pub mod reference;
pub mod render;
pub mod report;
pub mod settings;
pub mod source;
pub mod verify;
pub mod watch;

use std::{
    collections::BTreeSet,
    io::Write,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use clap::Subcommand;
use volact::config::Config;

/// What the user asks for.
#[derive(Subcommand)]
pub enum Command {
    /// Draw a scene, or a bare volume, mesh or surface, into a picture
    Render(render::Args),
    /// Say what a file holds
    Info(info::Args),
    /// List all actions, shaders, geometries and loaders, or describe one in full
    Describe(describe::Args),
    /// List the plugins that are found, what they register, and what was refused and why
    Plugins(plugins::Args),
    /// Compare two pictures; exits with 1 where they differ by more than a threshold
    Compare(compare::Args),
    /// Hold an action to the contract, with a report
    Conform(conform::Args),
    /// Compare expected and observed orders of accuracy of an action
    Verify(verify::Args),
    /// Measure how fast a scene is drawn
    Bench(bench::Args),
    /// Say what would be chosen for a scene to keep an error or a time, and draw nothing
    Plan(plan::Args),
    /// Measure how fast actions are on this machine, for the planner
    Calibrate(calibrate::Args),
    /// Chart error against time, of every action over what its options offer
    Chart(chart::Args),
    /// Print completions for a shell
    Completions(completions::Args),
}

impl Command {
    /// Does it.
    pub fn run(self) -> anyhow::Result<ExitCode> {
        report::listen();
        leave_nothing_half_done();
        let mut registry = volact::with_builtins();
        registry.set_progress(progress::watch());
        let plugins = self.load_plugins(&mut registry)?;
        if matches!(self, Self::Render(_) | Self::Plan(_) | Self::Bench(_)) {
            calibrate::recall(&mut registry);
        }
        if let Self::Render(args) = &self
            && args.watch
        {
            return watch::run(args, &registry);
        }
        self.load_shaders(&mut registry)?;
        match self {
            Self::Render(args) => render::run(args, &registry),
            Self::Info(args) => info::run(args, &registry),
            Self::Describe(args) => describe::run(args, &registry),
            Self::Plugins(args) => match plugins {
                Some(plugins) => plugins::run(args, &plugins),
                None => Ok(ExitCode::SUCCESS),
            },
            Self::Compare(args) => compare::run(args, &registry),
            Self::Conform(args) => conform::run(args, &registry),
            Self::Verify(args) => verify::run(args, &registry),
            Self::Bench(args) => bench::run(args, &registry),
            Self::Plan(args) => plan::run(args, &registry),
            Self::Calibrate(args) => calibrate::run(args, &registry),
            Self::Chart(args) => chart::run(args, &registry),
            Self::Completions(args) => completions::run(args, &registry),
        }
    }
}

impl Command {
    /// Registers the shaders of the config's folders, and those beside the scene.
    fn load_shaders(&self, registry: &mut volact::Registry) -> anyhow::Result<()> {
        let (named, scenes) = match self {
            Self::Render(args) => (args.config(), Vec::from_iter(args.scene())),
            Self::Bench(args) => (args.config(), Vec::from_iter(args.scene())),
            Self::Plan(args) => (args.config(), Vec::from_iter(args.scene())),
            Self::Chart(args) => (args.config(), args.scenes().collect()),
            Self::Describe(_) => (None, Vec::new()),
            _ => return Ok(()),
        };
        for folder in shader_folders(&settings::config(named)?, &scenes) {
            let refused = volact::shaders::add_folder(registry, &folder)?;
            log::debug!("{}: {} shaders refused", folder.display(), refused.len());
        }
        Ok(())
    }

    /// Loads the plugins of the config in force, for commands that could use them.
    fn load_plugins(&self, registry: &mut volact::Registry) -> anyhow::Result<Option<plugins::Plugins>> {
        let named = match self {
            Self::Render(args) => args.config(),
            Self::Bench(args) => args.config(),
            Self::Plan(args) => args.config(),
            Self::Calibrate(args) => args.config(),
            Self::Conform(args) => args.config(),
            Self::Verify(args) => args.config(),
            Self::Chart(args) => args.config(),
            Self::Info(_) | Self::Describe(_) | Self::Plugins(_) => None,
            Self::Compare(_) | Self::Completions(_) => return Ok(None),
        };
        let loudly = !matches!(self, Self::Plugins(_));
        plugins::Plugins::load(named, registry, loudly).map(Some)
    }
}

/// Where shaders are: the config's folders, and those of the scenes.
fn shader_folders(config: &Config, scenes: &[&Path]) -> Vec<PathBuf> {
    let beside = scenes.iter().filter_map(|scene| scene.parent());
    let beside = beside.map(|beside| if beside.as_os_str().is_empty() { Path::new(".") } else { beside });
    let beside = beside.filter(|folder| folder.is_dir()).map(Path::to_owned);
    // A folder that is named twice, in whatever way, is searched once.
    let mut known = BTreeSet::new();
    let place = |folder: &PathBuf| std::fs::canonicalize(folder).unwrap_or_else(|_| folder.clone());
    config.shader_folders.iter().cloned().chain(beside).filter(|folder| known.insert(place(folder))).collect()
}

/// Warns, once each, of shaders in the folders that cannot be used.
fn warn_of_shaders(registry: &volact::Registry) {
    static SAID: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    for (name, refused) in registry.shaders().all_refused() {
        if SAID.lock().unwrap_or_else(PoisonError::into_inner).insert(refused.why.clone()) {
            log::warn!("shader {name:?} cannot be used: {}", refused.why);
        }
    }
}

/// Where the user or the system ends the command, no part of a picture stays behind.
fn leave_nothing_half_done() {
    let told = ctrlc::set_handler(|| {
        volact_files::picture::discard_unfinished();
        // As shells have it for a command that an interrupt ended.
        std::process::exit(130);
    });
    if let Err(error) = told {
        log::debug!("signals are not heard: {error}");
    }
}

/// Prints an error with all its causes, one a line.
pub fn print_error(error: &anyhow::Error) {
    let mut text = format!("error: {error}\n");
    for cause in error.chain().skip(1) {
        text.push_str(&format!("  because: {cause}\n"));
    }
    // Nobody is left to tell where stderr is closed.
    _ = std::io::stderr().write_all(text.as_bytes());
}

static QUIET: AtomicBool = AtomicBool::new(false);

/// Says whether only errors are to be printed.
pub fn set_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

/// Whether only errors, and what was asked for by name, are to be printed.
pub fn quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Prints to standard output. That the reader has gone (`volact describe | head`) is no error.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    }
}
