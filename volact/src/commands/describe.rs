//! `volact describe [NAME]`: what is registered, and what it takes; as pages, see `reference`.

use std::{fmt::Write as _, path::PathBuf, process::ExitCode};

use anyhow::bail;
use volact::{
    Declaration, ParameterDecl, Registry,
    core::{names, parameter::Kind},
};

use super::reference::{self, KINDS, Place};

/// Arguments of `volact describe`.
#[derive(clap::Args)]
pub struct Args {
    /// The name of an action, shader, geometry or loader; all are listed without one
    #[arg(conflicts_with = "all")]
    name: Option<String>,
    /// Describe all in full
    #[arg(long)]
    all: bool,
    /// Write that as pages into a folder, and draw its scenes/KIND-NAME.ron into pictures/
    #[arg(long, value_name = "FOLDER", requires = "all")]
    markdown: Option<PathBuf>,
    /// Draw no pictures for the pages
    #[arg(long, requires = "markdown")]
    text_only: bool,
    /// Link the sources of the shaders that come with Volact as LINK/NAME.wgsl
    #[arg(long, value_name = "LINK", requires = "markdown")]
    sources: Option<String>,
    /// The folder for paths in the pages' scenes that begin with $VOLACT_DATA
    #[arg(long, value_name = "FOLDER", requires = "markdown")]
    data_dir: Option<PathBuf>,
}

/// Prints declarations.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let all = registry.declarations();
    if let Some(folder) = &args.markdown {
        let place = Place { folder, sources: args.sources.as_deref(), data: args.data_dir.as_deref() };
        reference::write(registry, &place, !args.text_only)?;
        return Ok(ExitCode::SUCCESS);
    }
    let text = match &args.name {
        None if args.all => all.iter().map(|d| full(d, registry)).collect::<Vec<_>>().join("\n"),
        None => list(&all) + &refused(registry),
        Some(name) => {
            let found: Vec<_> = all.iter().copied().filter(|d| d.name == *name).collect();
            if let Some(refused) = registry.shaders().refused(name) {
                bail!("shader {name:?} cannot be used: {}", refused.why);
            }
            if found.is_empty() {
                let hint = names::hint(name, all.iter().map(|d| d.name.as_str()));
                bail!("nothing is called {name:?}{hint}; `volact describe` lists all names");
            }
            found.into_iter().map(|d| full(d, registry)).collect::<Vec<_>>().join("\n")
        }
    };
    super::print(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn list(all: &[&Declaration]) -> String {
    let mut text = String::new();
    let width = all.iter().map(|d| d.name.len()).max().unwrap_or(0);
    for (kind, plural) in KINDS {
        let of_kind: Vec<_> = all.iter().filter(|d| d.kind == kind).collect();
        if of_kind.is_empty() {
            continue;
        }
        let gap = if text.is_empty() { "" } else { "\n" };
        _ = writeln!(text, "{gap}{plural}");
        for d in of_kind {
            _ = writeln!(text, "  {:width$}  {}", d.name, d.description);
        }
    }
    text
}

/// Shaders in the folders that cannot be used, and why.
fn refused(registry: &Registry) -> String {
    let mut text = String::new();
    for (name, refused) in registry.shaders().all_refused() {
        let gap = if text.is_empty() { "\nrefused\n" } else { "" };
        _ = writeln!(text, "{gap}  shader {name}: {}", super::plugins::indented(&refused.why));
    }
    text
}

fn full(d: &Declaration, registry: &Registry) -> String {
    let mut text = format!("{} {} {}\n  {}\n", d.kind.name(), d.name, d.version, d.description);
    if let Some(plugin) = registry.origin(d.kind, &d.name) {
        _ = writeln!(text, "  by plugin {plugin}");
    }
    if d.kind == Kind::Action {
        text.push_str(&capabilities(&d.name, registry));
    }
    if let Some(shader) = registry.shaders().get(&d.name).filter(|_| d.kind == Kind::Shader) {
        _ = writeln!(text, "  composited by {}", shader.compositing.name());
    }
    let what = if matches!(d.kind, Kind::Action | Kind::Loader) { "option" } else { "parameter" };
    if d.parameters.is_empty() {
        _ = writeln!(text, "\n  no {what}s");
    } else {
        _ = writeln!(text, "\n  {what}s");
        d.parameters.iter().for_each(|p| text.push_str(&parameter(p)));
    }
    text
}

/// What an action can do, where it can be made with its defaults.
fn capabilities(name: &str, registry: &Registry) -> String {
    let Ok(action) = registry.action(name, &volact::Options::new()) else { return String::new() };
    let caps = action.caps();
    let some = |names: &Option<Vec<String>>| names.as_ref().map_or_else(|| "any".to_owned(), |names| names.join(", "));
    let compositing = caps.compositing.iter().map(|c| c.name()).collect::<Vec<_>>().join(", ");
    let mut text = String::new();
    let others = if caps.sources { "; others by their source" } else { "" };
    _ = writeln!(text, "  shaders: {}{others}", some(&caps.shaders));
    _ = writeln!(text, "  geometries: {}", some(&caps.geometries));
    _ = writeln!(text, "  compositing: {}", if compositing.is_empty() { "none" } else { &compositing });
    let yes = |can: bool| if can { "yes" } else { "no" };
    _ = writeln!(
        text,
        "  overlapping shapes: {}; depth: {}; runs on {}",
        yes(caps.overlap),
        yes(caps.depth),
        caps.device
    );
    text
}

/// `name  types, required or default, bounds or choices, unit` and below it what it does.
fn parameter(p: &ParameterDecl) -> String {
    let mut facts = vec![takes(p)];
    facts.push(match (&p.default, p.required) {
        (Some(value), _) => format!("default {value}"),
        (None, true) => "required".into(),
        (None, false) => "optional".into(),
    });
    facts.extend(allowed(p));
    if !p.unit.is_empty() {
        facts.push(format!("in {}", p.unit));
    }
    format!("    {}: {}\n        {}\n", p.name, facts.join("; "), one_line(&p.description))
}

/// The types that a parameter takes.
pub fn takes(p: &ParameterDecl) -> String {
    p.types.iter().map(|t| t.name()).collect::<Vec<_>>().join(" or ")
}

/// Its bounds or choices.
pub fn allowed(p: &ParameterDecl) -> Option<String> {
    let choices = (!p.choices.is_empty()).then(|| format!("one of {}", p.choices.join(", ")));
    let all: Vec<_> = p.bounds.map(bounds).into_iter().chain(choices).collect();
    (!all.is_empty()).then(|| all.join("; "))
}

/// A description without its line breaks.
pub fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn bounds([lowest, highest]: [f64; 2]) -> String {
    let positive = lowest > 0.0 && lowest < 1e-300;
    match (positive, highest >= f64::MAX) {
        (true, true) => "above 0".into(),
        (true, false) => format!("above 0, at most {highest}"),
        (false, true) => format!("at least {lowest}"),
        (false, false) => format!("{lowest} to {highest}"),
    }
}
