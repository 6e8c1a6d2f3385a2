//! `volact plugins`: what lies in the folders, what it registers, and what was refused and why.
//!
//! Only what the config names is loaded. Folders are searched in this order: those of the config,
//! those of `VOLACT_PLUGIN_PATH`, and the program's own.

use std::{collections::BTreeSet, env, fmt::Write as _, path::PathBuf, process::ExitCode};

use volact::{
    Registry,
    config::Config,
    core::plugin::host::{self, Outcome, Registration, Search},
};

use super::settings;

/// Arguments of `volact plugins`.
#[derive(clap::Args)]
pub struct Args {}

/// What came of the plugins that the config names.
pub struct Plugins {
    search: Search,
    outcomes: Vec<Outcome>,
}

/// Where plugins are looked for, and which.
fn search(config: &Config) -> Search {
    let mut folders = config.plugin_folders.clone();
    if let Some(paths) = env::var_os("VOLACT_PLUGIN_PATH") {
        folders.extend(env::split_paths(&paths).filter(|folder| !folder.as_os_str().is_empty()));
    }
    let program = env::current_exe().ok().and_then(|path| path.parent().map(PathBuf::from));
    folders.extend(program);
    let mut known = BTreeSet::new();
    folders.retain(|folder| known.insert(folder.clone()));
    Search { folders, wanted: config.plugins.clone(), names: config.names.clone() }
}

impl Plugins {
    /// Loads what the config names. One that cannot be loaded is a warning, and the rest goes on.
    ///
    /// # Errors
    /// If the config cannot be read.
    pub fn load(config: Option<PathBuf>, registry: &mut Registry, loudly: bool) -> anyhow::Result<Self> {
        let search = search(&settings::config(config)?);
        let outcomes = load(&search, registry);
        if loudly {
            for error in outcomes.iter().filter_map(|outcome| outcome.result.as_ref().err()) {
                log::warn!("{error}");
            }
        }
        Ok(Self { search, outcomes })
    }
}

#[expect(unsafe_code, reason = "loading a library runs its code; the user's config names it")]
fn load(search: &Search, registry: &mut Registry) -> Vec<Outcome> {
    // SAFETY: the names are those of the user's config, which says what is trusted.
    unsafe { host::load(search, registry) }
}

/// Prints the list. The exit code is 2 where a plugin that the config names was refused.
pub fn run(_: Args, plugins: &Plugins) -> anyhow::Result<ExitCode> {
    super::print(&list(plugins))?;
    let refused = plugins.outcomes.iter().any(|outcome| outcome.result.is_err());
    Ok(if refused { ExitCode::from(2) } else { ExitCode::SUCCESS })
}

fn list(plugins: &Plugins) -> String {
    let mut text = format!("boundary {}; folders, in order\n", host::versions());
    for folder in &plugins.search.folders {
        _ = writeln!(text, "  {}{}", folder.display(), if folder.is_dir() { "" } else { " (not there)" });
    }
    for outcome in &plugins.outcomes {
        match &outcome.result {
            Ok(loaded) => {
                _ = writeln!(text, "\n{} {}\n  {}", loaded.name, loaded.version, loaded.description);
                if let Some(path) = &loaded.path {
                    _ = writeln!(text, "  from {}", path.display());
                }
                loaded.registered.iter().for_each(|r| registration(&mut text, r, ""));
                loaded
                    .passed_over
                    .iter()
                    .for_each(|r| registration(&mut text, r, ", not taken: see names in the config"));
            }
            Err(error) => {
                _ = writeln!(text, "\n{}\n  refused: {} [{}]", outcome.name, indented(&error.message), error.code)
            }
        }
    }
    let named = |name: &str| plugins.search.wanted.iter().any(|w| w.name.replace('-', "_") == name);
    let others: Vec<_> = plugins.search.found().into_iter().filter(|f| f.hidden || !named(&f.name)).collect();
    if !others.is_empty() {
        text.push_str("\nnot loaded\n");
    }
    for found in others {
        let why = if found.hidden { "an earlier folder has one of this name" } else { "the config does not name it" };
        _ = writeln!(text, "  {}: {why}", found.path.display());
    }
    text
}

/// A message of several lines below the name that it is about.
pub fn indented(message: &str) -> String {
    message.replace('\n', "\n    ")
}

fn registration(text: &mut String, r: &Registration, note: &str) {
    _ = writeln!(text, "  {} {} {}{note}", r.kind.name(), r.name, r.version);
}
