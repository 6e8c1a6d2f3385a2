//! `volact bench`: how fast actions draw a scene, warm, taken in turns.

use std::{
    fmt::Write as _,
    path::{Path, PathBuf},
    process::ExitCode,
    time::{Duration, Instant},
};

use anyhow::Context as _;
use serde_json::{Value, json};
use volact::{
    Frame, Options, Registry, RenderAction,
    core::{parameter::Kind, planner::Goals, scene::Scene},
};

use super::source::{self, Opened};

/// Arguments of `volact bench`.
#[derive(clap::Args)]
#[command(after_help = "Each action draws its first frame, then the warm-up frames, none of which count. The frames \
    that count are drawn in turns, one of each action, so that what disturbs the machine disturbs all alike. \
    The spread is from the first to the third quartile. Options that an action does not take are left out for it.")]
pub struct Args {
    #[command(flatten)]
    source: source::Args,
    /// An action to measure; again for further ones, which are related to the first
    #[arg(short, long = "action", value_name = "NAME")]
    actions: Vec<String>,
    /// Frames that count, of each action
    #[arg(short = 'n', long, default_value_t = 11, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Frames before those, of each action
    #[arg(long, default_value_t = 2)]
    warm_up: u32,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The config file that is named.
    pub fn config(&self) -> Option<PathBuf> {
        self.source.config.clone()
    }

    /// The scene file, if it is one that is drawn.
    pub fn scene(&self) -> Option<&Path> {
        self.source.scene_file()
    }
}

/// What a table or a JSON says above its rows.
struct Head {
    scene: String,
    size: [usize; 2],
    frames: u32,
    warm_up: u32,
}

/// Measures and prints.
///
/// # Errors
/// If the scene cannot be read, or an action cannot be made or draw it.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let subject = args.source.open(registry)?;
    let names = actions(&subject, &args.actions);
    let goals = args.source.goals(&subject.scene);
    let mut runs = Vec::new();
    for name in &names {
        let options = options(&subject, name, &names, registry)?;
        runs.push(Run::start(name, (&options, &goals), &subject.scene, registry)?);
    }
    for _ in 0..args.warm_up {
        runs.iter_mut().try_for_each(|run| run.draw(&subject.scene).map(drop))?;
    }
    for _ in 0..args.frames {
        for run in &mut runs {
            let (time, frame) = run.draw(&subject.scene)?;
            run.times.push(time);
            run.last = frame;
        }
    }
    let rows: Vec<Row> = runs.iter().map(Run::row).collect();
    let head = Head {
        scene: args.source.input.display().to_string(),
        size: [subject.scene.frame.width, subject.scene.frame.height],
        frames: args.frames,
        warm_up: args.warm_up,
    };
    super::print(&if args.json { to_json(&rows, &head) } else { to_text(&rows, &head) })?;
    Ok(ExitCode::SUCCESS)
}

/// The actions asked for, else the scene's own, else `cpu`.
fn actions(subject: &Opened, asked: &[String]) -> Vec<String> {
    match (&subject.scene.action, asked) {
        (Some((name, _)), []) => vec![name.clone()],
        (None, []) => vec!["cpu".into()],
        _ => asked.to_vec(),
    }
}

/// The options of one of several actions: those that it takes. One that none of them takes is left
/// in, so that making the action says so.
fn options(subject: &Opened, name: &str, all: &[String], registry: &Registry) -> anyhow::Result<Options> {
    let (_, given) = subject.action(Some(name));
    let declarations = registry.declarations();
    let takes = |action: &str, option: &str| {
        let declared = declarations.iter().filter(|d| d.kind == Kind::Action && d.name == action);
        ["checked", "planned"].contains(&action) || declared.into_iter().any(|d| d.parameter(option).is_some())
    };
    let known = |option: &str| all.iter().any(|action| takes(action, option));
    let of_command = |option: &String| subject.options.contains_key(option);
    let kept = given.into_iter().filter(|(o, _)| takes(name, o) || !of_command(o) || !known(o)).collect();
    Ok(subject.config.options_of(name, &kept))
}

/// One action on its way.
struct Run {
    name: String,
    action: Box<dyn RenderAction>,
    first: Duration,
    times: Vec<Duration>,
    last: Frame,
}

impl Run {
    fn start(
        name: &str,
        (options, goals): (&Options, &Goals),
        subject: &Scene,
        registry: &Registry,
    ) -> anyhow::Result<Self> {
        let mut action = registry.action_for(name, options, goals)?;
        for shape in &subject.shapes {
            action.manage(shape)?;
        }
        let last = Frame::empty(&subject.frame);
        let mut run = Self { name: name.into(), action, first: Duration::ZERO, times: Vec::new(), last };
        (run.first, run.last) = run.draw(subject)?;
        Ok(run)
    }

    fn draw(&mut self, subject: &Scene) -> anyhow::Result<(Duration, Frame)> {
        let start = Instant::now();
        self.action.begin_draw(&subject.frame)?;
        for shape in &subject.shapes {
            self.action.draw(shape)?;
        }
        let frame = self.action.end_draw().with_context(|| format!("action {:?}", self.name))?;
        Ok((start.elapsed(), frame))
    }

    fn row(&self) -> Row {
        let mut seconds: Vec<f64> = self.times.iter().map(Duration::as_secs_f64).collect();
        seconds.sort_by(f64::total_cmp);
        let statistics = &self.last.statistics;
        let quartiles = [0.0, 0.25, 0.5, 0.75, 1.0].map(|q| quantile(&seconds, q));
        Row {
            action: self.name.clone(),
            device: self.last.method.device.clone(),
            threads: statistics.threads,
            first: self.first.as_secs_f64(),
            quartiles,
            samples: statistics.samples,
            skipped: statistics.skipped,
            resident: statistics.resident_bytes,
        }
    }
}

/// Linear between the two nearest of some rising numbers, of which there is one at least.
fn quantile(rising: &[f64], q: f64) -> f64 {
    let at = q * (rising.len() - 1) as f64;
    let below = at as usize;
    let above = (below + 1).min(rising.len() - 1);
    rising[below] + (rising[above] - rising[below]) * at.fract()
}

/// What was measured of an action; times in seconds.
struct Row {
    action: String,
    device: String,
    threads: usize,
    first: f64,
    /// Least, first quartile, median, third quartile, most.
    quartiles: [f64; 5],
    samples: u64,
    skipped: u64,
    resident: usize,
}

impl Row {
    fn median(&self) -> f64 {
        self.quartiles[2]
    }

    fn rate(&self) -> f64 {
        self.samples as f64 / self.median() / 1e6
    }
}

fn to_text(rows: &[Row], head: &Head) -> String {
    let mut text = String::new();
    let [width, height] = head.size;
    _ = writeln!(text, "{}, {width} × {height}, {} frames", head.scene, head.frames);
    _ = writeln!(
        text,
        "{:<12}{:>10}{:>10}{:>10}{:>10}{:>10}{:>12}{:>8}  times in ms",
        "action", "first", "median", "spread", "least", "most", "Msamples/s", "ratio"
    );
    for row in rows {
        let [least, q1, median, q3, most] = row.quartiles.map(|s| s * 1e3);
        let (first, spread, ratio) = (row.first * 1e3, q3 - q1, row.median() / rows[0].median());
        _ = writeln!(
            text,
            "{:<12}{first:>10.2}{median:>10.2}{spread:>10.2}{least:>10.2}{most:>10.2}{:>12.1}{ratio:>8.2}  {}",
            row.action,
            row.rate(),
            row.device
        );
    }
    text
}

fn to_json(rows: &[Row], head: &Head) -> String {
    let row = |row: &Row| {
        let [least, q1, median, q3, most] = row.quartiles;
        json!({
            "action": row.action,
            "device": row.device,
            "threads": row.threads,
            "first_s": row.first,
            "median_s": median,
            "quartiles_s": [q1, q3],
            "least_s": least,
            "most_s": most,
            "samples": row.samples,
            "skipped": row.skipped,
            "samples_per_s": row.rate() * 1e6,
            "resident_bytes": row.resident,
            "ratio": median / rows[0].median(),
        })
    };
    let value = json!({
        "scene": head.scene,
        "size": head.size,
        "frames": head.frames,
        "warm_up": head.warm_up,
        "actions": rows.iter().map(row).collect::<Vec<Value>>(),
    });
    format!("{value:#}\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact::{Camera, FrameDesc, config::Config, core::glam::DVec3};

    fn row(action: &str, median: f64) -> Row {
        let quartiles = [0.9, 0.95, 1.0, 1.1, 2.0].map(|f| f * median);
        let device = "here".into();
        Row {
            action: action.into(),
            device,
            threads: 2,
            first: 0.5,
            quartiles,
            samples: 4_000_000,
            skipped: 7,
            resident: 9,
        }
    }

    fn head() -> Head {
        Head { scene: "a.ron".into(), size: [8, 4], frames: 3, warm_up: 1 }
    }

    #[test]
    fn quantiles_are_linear_between_ranks() {
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(|q| quantile(&[1.0, 2.0, 4.0], q)), [1.0, 1.5, 2.0, 4.0]);
        assert_eq!(quantile(&[3.0], 0.75), 3.0);
    }

    #[test]
    fn ratios_are_to_the_first() {
        let text = to_json(&[row("cpu", 0.02), row("other", 0.05)], &head());
        let value: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value["actions"][1]["ratio"], json!(2.5));
        assert_eq!(value["actions"][0]["samples_per_s"], json!(2e8));
        assert!(to_text(&[row("cpu", 0.02), row("other", 0.05)], &head()).contains("2.50  here"));
    }

    #[test]
    fn the_scene_chooses_unless_told() {
        let subject = |action| Opened {
            scene: Scene {
                shapes: vec![],
                frame: FrameDesc::new(Camera::perspective(DVec3::ONE, DVec3::ZERO, DVec3::Z, 30.0), 4, 4),
                action,
                goals: Goals::default(),
            },
            notes: vec![],
            config: Config::default(),
            options: Options::from([("threads".to_owned(), 2i64.into()), ("sample_distance".to_owned(), 0.5.into())]),
        };
        assert_eq!(actions(&subject(None), &[]), ["cpu"]);
        assert_eq!(actions(&subject(Some(("reference".into(), Options::new()))), &[]), ["reference"]);
        assert_eq!(actions(&subject(None), &["a".into(), "b".into()]), ["a", "b"]);
        let registry = volact::with_builtins();
        let both = ["cpu".to_owned(), "null".to_owned()];
        let taken = |name: &str, all: &[String]| options(&subject(None), name, all, &registry).unwrap().len();
        assert_eq!([taken("cpu", &both), taken("null", &both), taken("null", &both[1..])], [2, 0, 2]);
    }
}
