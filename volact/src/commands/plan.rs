//! `volact plan`: what would be chosen for a scene on this machine, and why.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    process::ExitCode,
    time::Duration,
};

use serde_json::{Value, json};
use volact::{
    Frame, Registry,
    core::{
        planner::{Bound, Considered, Goals, Plan},
        select,
    },
};

use super::{
    progress::Line,
    report::{self, count, time},
    source::{self, Opened},
};

/// Arguments of `volact plan`.
#[derive(clap::Args)]
#[command(
    after_help = "Without --max-error, --rmse and --milliseconds the scene's own goals count, and where it has none, \
    an error of half an 8-bit step. --action and --option fix what shall not be chosen. `volact render` with the \
    same arguments draws as planned."
)]
pub struct Args {
    #[command(flatten)]
    source: source::Args,
    /// Plan for this action only; the scene's, else all preferred ones that can draw it
    #[arg(short, long, value_name = "NAME")]
    action: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The config file that is named.
    pub fn config(&self) -> Option<PathBuf> {
        self.source.config.clone()
    }

    /// The scene file, if it is one that is planned for.
    pub fn scene(&self) -> Option<&Path> {
        self.source.scene_file()
    }
}

/// Plans and prints.
///
/// # Errors
/// If the scene cannot be read, or no action can draw it.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let opened = args.source.open(registry)?;
    let (name, options) = opened.action(args.action.as_deref());
    let goals = match args.source.goals(&opened.scene) {
        none if none == Goals::default() => Goals { bound: Some(Goals::BOUND), time: None },
        goals => goals,
    };
    let Opened { scene, config, .. } = opened;
    let mut choice = select::select_planned(registry, &config, name.as_deref(), &options, (&goals, &scene.shapes))?;
    let line = Line::new("planning");
    let (plan, sparse) = choice.action.plan(&scene.frame, &scene.shapes)?;
    drop(line);
    let viewport = scene.frame.viewport();
    let size = [viewport.width, viewport.height];
    let told = Told { goals: &goals, plan: &plan, sparse: &sparse, size, refused: &choice.refused };
    super::print(&if args.json { format!("{:#}\n", told.to_json()) } else { told.to_text() })?;
    Ok(ExitCode::SUCCESS)
}

/// What is said of a plan.
struct Told<'a> {
    goals: &'a Goals,
    plan: &'a Plan,
    sparse: &'a Frame,
    size: [usize; 2],
    refused: &'a [(String, String)],
}

impl Told<'_> {
    fn to_text(&self) -> String {
        let (plan, [width, height]) = (self.plan, self.size);
        let mut text = format!("{width} × {height} pixels, {}\n", goals(self.goals));
        _ = writeln!(text, "  plan    {}", report::plan(plan));
        _ = writeln!(text, "  how     {}", report::method(&self.sparse.method));
        _ = writeln!(text, "  memory  {}B", count(self.sparse.statistics.resident_bytes as f64));
        _ = writeln!(text, "\n    error  expected    step  setting");
        for c in &plan.considered {
            _ = writeln!(text, "{}", considered(c));
        }
        for (name, why) in self.refused {
            _ = writeln!(text, "  not by  {name}: {why}");
        }
        text
    }

    fn to_json(&self) -> Value {
        let (m, s) = (&self.sparse.method, &self.sparse.statistics);
        let considered = |c: &Considered| {
            json!({
                "setting": c.setting, "step": c.step, "error": c.error, "seconds": c.seconds, "refused": c.refused,
            })
        };
        json!({
            "width": self.size[0],
            "height": self.size[1],
            "asked": goals(self.goals),
            "plan": report::plan_json(self.plan),
            "method": report::method_json(m),
            "resident_bytes": s.resident_bytes,
            "considered": self.plan.considered.iter().map(considered).collect::<Vec<_>>(),
            "refused": self.refused.iter().map(|(n, why)| json!({"action": n, "why": why})).collect::<Vec<_>>(),
        })
    }
}

fn considered(c: &Considered) -> String {
    let step = c.step.map_or_else(|| "-".into(), |h| format!("{h:.4}"));
    match &c.refused {
        Some(why) => format!("        -         -       -  {}: {why}", c.setting),
        None => {
            let seconds = time(Duration::try_from_secs_f64(c.seconds).unwrap_or_default());
            format!("{:9.1e}  {seconds:>8}  {step:>6}  {}", c.error, c.setting)
        }
    }
}

/// Goals in words.
fn goals(goals: &Goals) -> String {
    let bound = goals.bound.map(|bound| match bound {
        Bound::MaxError(e) => format!("no error above {e:.2e}"),
        Bound::Rmse(e) => format!("a root mean square of errors of at most {e:.2e}"),
    });
    let time = goals.time.map(|t| format!("{} a frame", time(t)));
    format!("asked for {}", bound.into_iter().chain(time).collect::<Vec<_>>().join(", first in "))
}
