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
    Frame, FrameDesc, Options, Registry, RenderAction, Shape, core::loader::NoProgress, core::scene::Scene, transfer,
};

/// Arguments of `volact bench`.
#[derive(clap::Args)]
#[command(after_help = "Each action draws its first frame, then the warm-up frames, none of which count. The frames \
    that count are drawn in turns, one of each action, so that what disturbs the machine disturbs all alike. \
    The spread is from the first to the third quartile.")]
pub struct Args {
    /// A scene (.ron) or a bare volume
    scene: PathBuf,
    /// An action to measure; again for further ones, which are related to the first
    #[arg(short, long = "action", value_name = "NAME")]
    actions: Vec<String>,
    /// Frames that count, of each action
    #[arg(short = 'n', long, default_value_t = 11, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Frames before those, of each action
    #[arg(long, default_value_t = 2)]
    warm_up: u32,
    /// Size of the picture instead of the scene's own, e.g. 1024x768
    #[arg(short, long, value_name = "WIDTHxHEIGHT", value_parser = parse_size)]
    size: Option<[usize; 2]>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Measures and prints.
///
/// # Errors
/// If the scene cannot be read, or an action cannot be made or draw it.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let mut subject = Subject::open(&args.scene, registry)?;
    if let Some([width, height]) = args.size {
        anyhow::ensure!(subject.frame.viewport.is_none(), "the scene sets a viewport; its size cannot be changed here");
        (subject.frame.width, subject.frame.height) = (width, height);
    }
    let mut runs = Vec::new();
    for name in subject.actions(&args.actions) {
        runs.push(Run::start(&name, &subject, registry)?);
    }
    for _ in 0..args.warm_up {
        runs.iter_mut().try_for_each(|run| run.draw(&subject).map(drop))?;
    }
    for _ in 0..args.frames {
        for run in &mut runs {
            let (time, frame) = run.draw(&subject)?;
            run.times.push(time);
            run.last = frame;
        }
    }
    let rows: Vec<Row> = runs.iter().map(Run::row).collect();
    let size = [subject.frame.width, subject.frame.height];
    let text = if args.json { to_json(&rows, size, &args) } else { to_text(&rows, size, &args) };
    super::print(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn parse_size(text: &str) -> Result<[usize; 2], String> {
    let parts: Option<Vec<usize>> = text.split('x').map(|n| n.parse().ok().filter(|n| *n > 0)).collect();
    parts.and_then(|p| p.try_into().ok()).ok_or_else(|| format!("{text:?}, wanted two numbers as in 1024x768"))
}

/// What is drawn.
struct Subject {
    shapes: Vec<Shape>,
    frame: FrameDesc,
    action: Option<(String, Options)>,
}

impl Subject {
    fn open(path: &Path, registry: &Registry) -> anyhow::Result<Self> {
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ron")) {
            let Scene { shapes, frame, action } = Scene::open(path, registry, &NoProgress)?;
            return Ok(Self { shapes, frame, action });
        }
        let volume = registry.load(path)?;
        let look = transfer::automatic(&volume);
        Ok(Self { shapes: vec![look.shape(&volume)], frame: look.frame(512, 512), action: None })
    }

    /// The actions asked for, else the scene's own, else `cpu`.
    fn actions(&self, asked: &[String]) -> Vec<String> {
        match (&self.action, asked) {
            (Some((name, _)), []) => vec![name.clone()],
            (None, []) => vec!["cpu".into()],
            _ => asked.to_vec(),
        }
    }

    /// The scene's options, for the action that it names.
    fn options(&self, name: &str) -> Options {
        self.action.as_ref().filter(|(own, _)| own == name).map(|(_, o)| o.clone()).unwrap_or_default()
    }
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
    fn start(name: &str, subject: &Subject, registry: &Registry) -> anyhow::Result<Self> {
        let mut action = registry.action(name, &subject.options(name))?;
        for shape in &subject.shapes {
            action.manage(shape)?;
        }
        let last = Frame::empty(&subject.frame);
        let mut run = Self { name: name.into(), action, first: Duration::ZERO, times: Vec::new(), last };
        (run.first, run.last) = run.draw(subject)?;
        Ok(run)
    }

    fn draw(&mut self, subject: &Subject) -> anyhow::Result<(Duration, Frame)> {
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

fn to_text(rows: &[Row], [width, height]: [usize; 2], args: &Args) -> String {
    let mut text = String::new();
    _ = writeln!(text, "{}, {width} × {height}, {} frames", args.scene.display(), args.frames);
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

fn to_json(rows: &[Row], size: [usize; 2], args: &Args) -> String {
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
        "scene": args.scene.display().to_string(),
        "size": size,
        "frames": args.frames,
        "warm_up": args.warm_up,
        "actions": rows.iter().map(row).collect::<Vec<Value>>(),
    });
    format!("{value:#}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

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

    fn args() -> Args {
        Args { scene: "a.ron".into(), actions: vec![], frames: 3, warm_up: 1, size: None, json: true }
    }

    #[test]
    fn quantiles_are_linear_between_ranks() {
        assert_eq!([0.0, 0.25, 0.5, 1.0].map(|q| quantile(&[1.0, 2.0, 4.0], q)), [1.0, 1.5, 2.0, 4.0]);
        assert_eq!(quantile(&[3.0], 0.75), 3.0);
    }

    #[test]
    fn ratios_are_to_the_first() {
        let text = to_json(&[row("cpu", 0.02), row("other", 0.05)], [8, 4], &args());
        let value: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value["actions"][1]["ratio"], json!(2.5));
        assert_eq!(value["actions"][0]["samples_per_s"], json!(2e8));
        assert!(to_text(&[row("cpu", 0.02), row("other", 0.05)], [8, 4], &args()).contains("2.50  here"));
    }

    #[test]
    fn sizes_are_two_numbers() {
        assert_eq!(parse_size("640x480"), Ok([640, 480]));
        assert!(["640", "0x4", "4x4x4", "ax2", ""].iter().all(|t| parse_size(t).is_err()));
    }

    #[test]
    fn the_scene_chooses_unless_told() {
        let subject = |action| Subject {
            shapes: vec![],
            frame: FrameDesc::new(
                volact::Camera::perspective(
                    volact::core::glam::DVec3::ONE,
                    volact::core::glam::DVec3::ZERO,
                    volact::core::glam::DVec3::Z,
                    30.0,
                ),
                4,
                4,
            ),
            action,
        };
        assert_eq!(subject(None).actions(&[]), ["cpu"]);
        assert_eq!(subject(Some(("reference".into(), Options::new()))).actions(&[]), ["reference"]);
        assert_eq!(subject(None).actions(&["a".into(), "b".into()]), ["a", "b"]);
    }
}
