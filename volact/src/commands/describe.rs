//! `volact describe [NAME]`: what is registered, and what it takes.

use std::{fmt::Write as _, process::ExitCode};

use anyhow::bail;
use volact::{
    Declaration, ParameterDecl, Registry,
    core::{names, parameter::Kind},
};

/// Arguments of `volact describe`.
#[derive(clap::Args)]
pub struct Args {
    /// The name of an action, shader, geometry or loader; all are listed without one
    name: Option<String>,
}

/// Prints declarations.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let all = registry.declarations();
    let text = match &args.name {
        None => list(&all),
        Some(name) => {
            let found: Vec<_> = all.iter().copied().filter(|d| d.name == *name).collect();
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
    for kind in [Kind::Action, Kind::Shader, Kind::Geometry, Kind::Loader] {
        let of_kind: Vec<_> = all.iter().filter(|d| d.kind == kind).collect();
        if of_kind.is_empty() {
            continue;
        }
        let gap = if text.is_empty() { "" } else { "\n" };
        let plural = if kind == Kind::Geometry { "geometries".into() } else { format!("{}s", kind.name()) };
        _ = writeln!(text, "{gap}{plural}");
        for d in of_kind {
            _ = writeln!(text, "  {:width$}  {}", d.name, d.description);
        }
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
    _ = writeln!(text, "  shaders: {}", some(&caps.shaders));
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
    let types = p.types.iter().map(|t| t.name()).collect::<Vec<_>>().join(" or ");
    let mut facts = vec![types];
    facts.push(match (&p.default, p.required) {
        (Some(value), _) => format!("default {value}"),
        (None, true) => "required".into(),
        (None, false) => "optional".into(),
    });
    facts.extend(p.bounds.map(bounds));
    if !p.choices.is_empty() {
        facts.push(format!("one of {}", p.choices.join(", ")));
    }
    if !p.unit.is_empty() {
        facts.push(format!("in {}", p.unit));
    }
    let description = p.description.split_whitespace().collect::<Vec<_>>().join(" ");
    format!("    {}: {}\n        {description}\n", p.name, facts.join("; "))
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
