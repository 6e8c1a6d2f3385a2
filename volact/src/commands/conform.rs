//! `volact conform`: whether an action keeps the contract.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::{Context as _, bail};
use volact::{Registry, core::names};
use volact_conformance::{
    catalog::TOPICS,
    outcome::{CaseResult, Run, Status},
    report,
    runner::{Filter, Suite},
};

use super::settings::{self, Setting};

/// Arguments of `volact conform`.
#[derive(clap::Args)]
#[command(after_help = "An action is whatever the config can find: built in, or of a plugin. What it says that it \
    cannot do is skipped with the reason.\nExit codes: 0 all cases passed or were skipped, 1 a case failed, \
    2 no case was executed, or something went wrong.")]
pub struct Args {
    /// An action to hold to the contract; again for further ones
    #[arg(short, long = "action", value_name = "NAME", required_unless_present = "list")]
    actions: Vec<String>,
    /// Only the cases of a topic; again for further ones
    #[arg(short, long = "topic", value_name = "TOPIC")]
    topics: Vec<String>,
    /// Only cases whose name, as topic::name, has this in it; again for further ones
    #[arg(short = 'C', long = "case", value_name = "CASE")]
    cases: Vec<String>,
    /// Set an option of the actions, which then no case changes
    #[arg(long = "option", value_name = "NAME=VALUE")]
    option: Vec<Setting>,
    /// Write a page with the matrix, the pictures and the scenes
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Write a JSON a case, and its scenes, into a folder
    #[arg(long, value_name = "FOLDER")]
    json: Option<PathBuf>,
    /// List the cases instead, with what they need
    #[arg(long)]
    list: bool,
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

/// Runs the suite and prints what came of it.
///
/// # Errors
/// If an action cannot be made, no case is meant or executed, or a file cannot be written.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let suite = Suite::new(registry).context("the shaders that come with Volact cannot be registered")?;
    let filter = args.filter()?;
    if !suite.cases().iter().any(|case| filter.takes(case)) {
        bail!("no case is meant by {:?}; volact conform --list lists them", args.cases);
    }
    if args.list {
        super::print(&list(&suite, &filter))?;
        return Ok(ExitCode::SUCCESS);
    }
    let mut runs = Vec::new();
    for action in &args.actions {
        runs.push(one(&suite, &filter, action, &args)?);
    }
    if let Some(path) = &args.report {
        report::write_html(path, &runs)?;
    }
    summary(&runs, args.report.as_deref())?;
    if let Some(run) = runs.iter().find(|run| executed(run) == 0) {
        bail!("[{}] no case was executed: {} were skipped", run.subject, run.cases.len());
    }
    Ok(ExitCode::from(u8::from(!runs.iter().all(Run::passed))))
}

impl Args {
    fn filter(&self) -> anyhow::Result<Filter> {
        let known = || TOPICS.iter().map(|(name, _)| *name);
        for topic in &self.topics {
            if !known().any(|name| name == topic) {
                let (hint, all) = (names::hint(topic, known()), known().collect::<Vec<_>>().join(", "));
                bail!("no topic is called {topic:?}{hint}; known: {all}");
            }
        }
        Ok(Filter { topics: self.topics.clone(), cases: self.cases.clone(), studies: false })
    }
}

/// Runs the cases on one action, each told as it ends.
fn one(suite: &Suite, filter: &Filter, action: &str, args: &Args) -> anyhow::Result<Run> {
    let options = settings::options(&args.option)?;
    let subject = suite.subject(action, &options).with_context(|| format!("action {action:?} cannot be tested"))?;
    let mut problem = None;
    let run = suite.run(&subject, filter, |case| {
        let told = tell(case);
        let written = args.json.as_deref().map_or(Ok(()), |folder| report::write_case(folder, case));
        if problem.is_none() {
            problem = told.and(written.map_err(Into::into)).err();
        }
    });
    problem.map_or(Ok(run), Err)
}

fn tell(case: &CaseResult) -> anyhow::Result<()> {
    let (word, title) = (case.status.word(), case.title());
    match &case.status {
        Status::Passed if super::quiet() => Ok(()),
        Status::Passed => super::print(&format!("{title} ... {word}\n")),
        Status::Failed(why) | Status::Skipped(why) | Status::ExpectedFailure(why) => {
            super::print(&format!("{title} ... {word}: {why}\n"))
        }
    }
}

fn executed(run: &Run) -> usize {
    let [passed, failed, _, expected] = run.counts();
    passed + failed + expected
}

fn summary(runs: &[Run], page: Option<&Path>) -> anyhow::Result<()> {
    let mut text = String::from("\n");
    for run in runs {
        _ = writeln!(text, "{}", run.summary());
        let loose = report::loose(run);
        for (case, check, room) in &loose {
            _ = writeln!(text, "  {case}, {check}: the tolerance is {room:.0} times the difference, without a reason");
        }
    }
    if let Some(page) = page {
        _ = writeln!(text, "report: {}", page.display());
    }
    super::print(&text)
}

fn list(suite: &Suite, filter: &Filter) -> String {
    let mut text = String::new();
    for case in suite.cases().iter().filter(|case| filter.takes(case)) {
        let needs: Vec<_> = case.needs.iter().map(|need| need.name()).collect();
        _ = writeln!(text, "{}\n    {}\n    needs {}", case.id(), case.about, needs.join(", "));
    }
    text
}
