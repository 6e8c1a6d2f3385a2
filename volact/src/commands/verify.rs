//! `volact verify`: the order of accuracy of an action, expected against observed.

use std::{fmt::Write as _, path::PathBuf, process::ExitCode};

use anyhow::{Context as _, bail};
use serde_json::{Value, json};
use volact::Registry;
use volact_conformance::{
    outcome::Run,
    report::{self, OrderRow},
    runner::{Filter, Suite},
};

use super::{
    progress::Line,
    settings::{self, Setting},
};

/// Arguments of `volact verify`.
#[derive(clap::Args)]
#[command(
    after_help = "An action is whatever the config can find: built in, or of a plugin. The rows are the cases of \
    `volact conform` that expect an order of the error, or that nothing changes; what an action has no option for, or \
    says that it cannot do, is skipped with the reason. Truth is a closed form or the certified integral, never a \
    picture of the action. The controls are rules in f64 of known order, wrong ones too: they show what would be seen.\n\
    Exit codes: 0 all orders are as expected or were skipped, 1 one is not, 2 no order was looked at, or something \
    went wrong."
)]
pub struct Args {
    /// An action to study; again for further ones
    #[arg(short, long = "action", value_name = "NAME", required = true)]
    actions: Vec<String>,
    /// Set an option of the actions, which then no study changes
    #[arg(long = "option", value_name = "NAME=VALUE")]
    option: Vec<Setting>,
    /// Write a page with the table and a log-log plot of each order
    #[arg(short, long, value_name = "FILE.html")]
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

/// Studies actions and prints what came of it.
///
/// # Errors
/// If an action cannot be made, nothing of it can be studied, or a file cannot be written.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let suite = Suite::new(registry).context("the shaders that come with Volact cannot be registered")?;
    let options = settings::options(&args.option)?;
    let filter = Filter { studies: true, ..Filter::default() };
    let mut runs = Vec::new();
    for action in &args.actions {
        let subject =
            suite.subject(action, &options).with_context(|| format!("action {action:?} cannot be studied"))?;
        let _line = Line::new(format!("studying {}", subject.label()));
        runs.push(suite.run(&subject, &filter, |case| log::info!("{}: {}", case.title(), case.status.word())));
    }
    if let Some(path) = &args.output {
        report::write_orders(path, &runs)?;
    }
    super::print(&if args.json { to_json(&runs) } else { to_text(&runs) })?;
    for run in &runs {
        let [passed, failed, _, expected] = run.counts();
        if passed + failed + expected == 0 {
            bail!("[{}] no order was looked at: {} were skipped", run.subject, run.cases.len());
        }
    }
    Ok(ExitCode::from(u8::from(!runs.iter().all(Run::passed))))
}

fn to_text(runs: &[Run]) -> String {
    let mut text = String::new();
    for run in runs {
        table(&mut text, &run.subject, &report::orders(run));
        _ = writeln!(text, "{}\n", run.summary());
    }
    table(&mut text, "controls", &report::control_rows());
    text
}

fn table(text: &mut String, title: &str, rows: &[OrderRow]) {
    let wide = rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0);
    _ = writeln!(text, "{title}\n{:<wide$}  {:<16}  {:<18}  result", "", "expected", "observed");
    for row in rows {
        let OrderRow { name, expected, observed, result, why, .. } = row;
        let why = if why.is_empty() { String::new() } else { format!(": {why}") };
        _ = writeln!(text, "{name:<wide$}  {expected:<16}  {observed:<18}  {result}{why}");
    }
}

fn to_json(runs: &[Run]) -> String {
    let run = |run: &Run| {
        let rows: Vec<_> = report::orders(run).iter().map(row).collect();
        json!({ "subject": run.subject, "device": run.device, "passed": run.passed(), "rows": rows })
    };
    let controls: Vec<_> = report::control_rows().iter().map(row).collect();
    let value = json!({ "runs": runs.iter().map(run).collect::<Vec<_>>(), "controls": controls });
    format!("{value:#}\n")
}

fn row(row: &OrderRow) -> Value {
    json!({
        "name": row.name, "about": row.about, "expected": row.expects, "expected_words": row.expected,
        "observed": row.observed, "study": row.study, "result": row.result, "why": row.why,
    })
}
