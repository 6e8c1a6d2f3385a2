//! `volact calibrate`: measures how fast actions are here, for the planner; and the file of it.

use std::{collections::BTreeMap, fmt::Write as _, fs, path::PathBuf, process::ExitCode};

use anyhow::{Context as _, bail};
use serde_json::{Value, json};
use volact::{
    Registry,
    core::{
        parameter::Kind,
        planner::{self, Rate, Rates},
    },
};
use volact_conformance::{chart::machine, report};

use super::{progress::Line, settings};

/// Arguments of `volact calibrate`.
#[derive(clap::Args)]
#[command(
    after_help = "What is measured is kept in the user's cache folder, as volact/rates.json, and used by every plan \
    on this machine from then on. Without it, plans begin with the rates of another machine, and correct them as \
    frames are drawn."
)]
pub struct Args {
    /// An action to measure; again for further ones [default: all that can be made, but `reference`]
    #[arg(short, long = "action", value_name = "NAME")]
    actions: Vec<String>,
    /// Write to this file instead
    #[arg(short, long, value_name = "FILE.json")]
    output: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Config file (else VOLACT_CONFIG, else the user's)
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

impl Args {
    /// The config file that is named.
    pub fn config(&self) -> Option<PathBuf> {
        self.config.clone()
    }
}

/// Measures, prints and keeps.
///
/// # Errors
/// If an action is not known or fails, or the file cannot be written.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let Some(output) = args.output.clone().or_else(file) else {
        bail!("there is no cache folder (XDG_CACHE_HOME, HOME); name a file with --output");
    };
    let names = match args.actions.as_slice() {
        [] => all(registry),
        named => named.to_vec(),
    };
    for name in &names {
        registry.action(name, &volact::Options::new()).map(drop).or_else(|e| match args.actions.is_empty() {
            true => Ok(()),
            false => Err(e),
        })?;
    }
    let line = Line::new("calibrating");
    let rates = planner::calibrate(registry, &names, |setting| log::info!("calibrating {setting}"))?;
    drop(line);
    if rates.0.is_empty() {
        bail!("nothing was measured: {} cannot be made here or count no samples", names.join(", "));
    }
    let kept = json!({"version": 1, "machine": machine::name(), "rates": to_json(&rates)});
    if let Some(folder) = output.parent().filter(|f| !f.as_os_str().is_empty()) {
        fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    }
    report::write(&output, format!("{kept:#}\n").as_bytes())?;
    match args.json {
        true => super::print(&format!("{kept:#}\n"))?,
        false => super::print(&(to_text(&rates) + &format!("kept in {}\n", output.display())))?,
    }
    Ok(ExitCode::SUCCESS)
}

/// All actions that draw by themselves and are no measure of others.
fn all(registry: &Registry) -> Vec<String> {
    let reference = volact_cpu::reference::declaration().name;
    let actions = registry.declarations().into_iter().filter(|d| d.kind == Kind::Action);
    let drawing = actions.filter(|d| d.parameter("of").is_none() && d.name != reference && d.name != "null");
    drawing.map(|d| d.name.clone()).collect()
}

fn to_json(rates: &Rates) -> Value {
    let rate = |r: &Rate| json!({"overhead_s": r.overhead, "sample_s": r.sample});
    rates.0.iter().map(|(name, r)| (name.clone(), rate(r))).collect::<serde_json::Map<_, _>>().into()
}

fn to_text(rates: &Rates) -> String {
    let mut text = String::from("frame, ms  samples, M/s  setting\n");
    for (name, rate) in &rates.0 {
        _ = writeln!(text, "{:9.3}  {:12.1}  {name}", 1e3 * rate.overhead, 1e-6 / rate.sample.max(1e-15));
    }
    text
}

fn file() -> Option<PathBuf> {
    Some(settings::cache()?.join("rates.json"))
}

/// Takes the rates that were measured on this machine, if they were; others stay.
pub fn recall(registry: &mut Registry) {
    let Some(path) = file() else { return };
    let Ok(bytes) = fs::read(&path) else { return };
    let kept = serde_json::from_slice::<Value>(&bytes).ok().filter(|kept| kept["version"] == 1);
    let Some((kept, rates)) = kept.and_then(|kept| Some((kept.clone(), read(&kept)?))) else {
        log::warn!("{}: holds no rates of actions; `volact calibrate` measures them anew", path.display());
        return;
    };
    if kept["machine"] == machine::name() {
        let mut known = Rates::default();
        known.0.extend(rates);
        registry.set_rates(known);
    } else {
        log::info!("{}: is of another machine, {}", path.display(), kept["machine"]);
    }
}

fn read(kept: &Value) -> Option<BTreeMap<String, Rate>> {
    let number = |value: &Value| value.as_f64().filter(|v| *v >= 0.0 && v.is_finite());
    let rate = |(name, r): (&String, &Value)| {
        let rate = Rate { overhead: number(&r["overhead_s"])?, sample: number(&r["sample_s"])? };
        Some((name.clone(), rate))
    };
    kept["rates"].as_object()?.iter().map(rate).collect()
}
