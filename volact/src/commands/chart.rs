//! `volact chart`: error against time, of every action over what its options offer.

mod subject;

use std::{
    collections::BTreeSet,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::ExitCode,
    time::{Duration, Instant},
};

use anyhow::{Context as _, bail};
use volact::Registry;
use volact_conformance::{
    chart::{Chart, Measure, VERSION, page, rows::Rows, table},
    report,
};

use super::{
    settings::{Setting, Size},
    source,
};
use subject::Subject;

/// Arguments of `volact chart`.
#[derive(clap::Args)]
#[command(
    after_help = "Steps are combined with every way of sampling and classifying that an action declares; formats, \
    filters, precision, table widths and early ends are varied one at a time. Options set with --option are not varied. \
    Errors are those of f32 frames against the certified reference, whose picture is kept on disk.\n\
    Beside FILE.html are written FILE.svg (FILE-SCENE.svg where there are several), FILE.csv and FILE.json. What is \
    measured is appended to FILE.rows.jsonl until all is: a run that is interrupted, or whose budget ends, goes on \
    when started again.\n\
    A CSV that is joined has a header, and the columns of FILE.csv that it knows: scene, action (the program), \
    median_s and one of rmse, max and p99 are needed; series, settings, step, machine and the others are not."
)]
pub struct Args {
    /// Scenes (.ron), or bare volumes, meshes or surfaces
    #[arg(value_name = "SCENE", required_unless_present = "from")]
    scenes: Vec<PathBuf>,
    /// The page to write; pictures and tables go beside it
    #[arg(short, long, value_name = "FILE.html", default_value = "chart.html")]
    output: PathBuf,
    /// An action to measure; again for further ones [default: all that can draw the scene, but the reference]
    #[arg(short, long = "action", value_name = "NAME")]
    actions: Vec<String>,
    /// Columns and rows [default: as the scene says, but at most 256 on the longer side]
    #[arg(short, long, value_name = "WxH|N")]
    size: Option<Size>,
    /// Sample distances, in smallest voxels of the scene
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = [4.0, 2.0, 1.0, 0.5, 0.25, 0.125])]
    steps: Vec<f64>,
    /// Frames that count, of each setting
    #[arg(short = 'n', long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Frames before those, besides the first
    #[arg(long, default_value_t = 1)]
    warm_up: u32,
    /// Seconds after which nothing more is begun
    #[arg(long, value_name = "SECONDS")]
    budget: Option<f64>,
    /// Seconds of one setting's frames after which no more are drawn of it
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0)]
    each: f64,
    /// Set an option of the actions, which then is not varied
    #[arg(long = "option", value_name = "NAME=VALUE")]
    option: Vec<Setting>,
    /// Set a parameter of all shapes, or of one: SHAPE.NAME=VALUE; values as in scenes
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<Setting>,
    /// Which error the pictures (.svg) show: rmse, max or p99; the page shows each
    #[arg(long, value_name = "ERROR", default_value = "rmse", value_parser = error)]
    error: Measure,
    /// Draw a saved result (FILE.json) again, instead of measuring or with it; again for further machines'
    #[arg(long, value_name = "FILE.json")]
    from: Vec<PathBuf>,
    /// Join points that were measured elsewhere, as of other programs
    #[arg(long, value_name = "FILE.csv")]
    join: Vec<PathBuf>,
    /// What this machine is called in the chart [default: its processor, threads and system]
    #[arg(long, value_name = "NAME")]
    machine: Option<String>,
    /// Measure anew what an interrupted run has measured already
    #[arg(long)]
    fresh: bool,
    /// The folder in which true pictures are kept [default: volact/truth in the user's cache folder]
    #[arg(long, value_name = "FOLDER")]
    cache: Option<PathBuf>,
    /// The folder for paths in scenes that begin with $VOLACT_DATA; else that environment variable
    #[arg(long, value_name = "FOLDER")]
    data_dir: Option<PathBuf>,
    /// Config file (else VOLACT_CONFIG, else the user's)
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

fn error(word: &str) -> Result<Measure, String> {
    Measure::ALL.into_iter().find(|m| m.name() == word).ok_or_else(|| "wanted rmse, max or p99".into())
}

impl Args {
    /// The config file that is named.
    pub fn config(&self) -> Option<PathBuf> {
        self.config.clone()
    }

    /// The scene files that are drawn.
    pub fn scenes(&self) -> impl Iterator<Item = &Path> {
        self.scenes.iter().map(PathBuf::as_path).filter(|path| path.extension().is_some_and(|e| e == "ron"))
    }

    fn check(&self) -> anyhow::Result<()> {
        if let Some(step) = self.steps.iter().find(|h| !(**h > 0.0 && h.is_finite())) {
            bail!("--steps has {step}, wanted numbers of voxels above 0");
        }
        for (name, seconds) in [("--budget", self.budget), ("--each", Some(self.each))] {
            if let Some(seconds) = seconds.filter(|s| !(0.0..=1e9).contains(s)) {
                bail!("{name} is {seconds}, wanted seconds from 0 to 1e9");
            }
        }
        Ok(())
    }

    /// What says how a scene is opened.
    fn source(&self, input: &Path) -> source::Args {
        source::Args {
            input: input.into(),
            size: self.size,
            option: self.option.clone(),
            set: self.set.clone(),
            data_dir: self.data_dir.clone(),
            config: self.config.clone(),
            ..source::Args::default()
        }
    }
}

/// Measures, or reads what was measured, and writes.
///
/// # Errors
/// If a scene cannot be read, no action draws it, a saved result is none, or a file cannot be written.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    args.check()?;
    let mut chart = Chart { version: VERSION, scenes: Vec::new() };
    let done = measured(&args, registry, &mut chart)?;
    for path in &args.from {
        let text = fs::read_to_string(path).with_context(|| format!("{}: cannot be read", path.display()))?;
        let other = serde_json::from_str(&text).with_context(|| format!("{}: no result of a chart", path.display()))?;
        chart.merge(other).with_context(|| format!("{}: cannot be added", path.display()))?;
    }
    for path in &args.join {
        let joined = table::join(&mut chart, path)?;
        log::info!("{}: {joined} points", path.display());
    }
    let written = write(&args, &chart)?;
    if done && !args.scenes.is_empty() {
        // All is in the result; until here an interruption loses nothing.
        _ = fs::remove_file(rows_path(&args.output));
    }
    super::print(&summary(&chart, &written, done))?;
    Ok(ExitCode::SUCCESS)
}

fn rows_path(output: &Path) -> PathBuf {
    output.with_extension("rows.jsonl")
}

/// Measures all scenes. Returns whether there was time for all.
fn measured(args: &Args, registry: &Registry, chart: &mut Chart) -> anyhow::Result<bool> {
    if args.scenes.is_empty() {
        return Ok(true);
    }
    let path = rows_path(&args.output);
    if args.fresh {
        _ = fs::remove_file(&path);
    }
    let mut rows = Rows::open(&path)?;
    let began = Instant::now();
    let mut all = true;
    for (i, (input, name)) in args.scenes.iter().zip(names(&args.scenes)).enumerate() {
        // What is left of the budget is shared by the scenes that are left.
        let deadline = args.budget.map(|budget| {
            let left = (budget - began.elapsed().as_secs_f64()).max(0.0);
            Instant::now() + Duration::from_secs_f64(left / (args.scenes.len() - i) as f64)
        });
        let subject = Subject::open(args, input, name, registry)?;
        let (scene, done) = subject.measure(args, registry, &mut rows, deadline)?;
        chart.scenes.push(scene);
        all &= done;
    }
    Ok(all)
}

/// Scenes by their file's name, or their folder's where that is `scene`; by path where two would be alike.
fn names(inputs: &[PathBuf]) -> Vec<String> {
    let short = |path: &PathBuf| {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let folder = path.parent().and_then(Path::file_name).map(|f| f.to_string_lossy().into_owned());
        folder.filter(|_| stem == "scene").unwrap_or(stem)
    };
    let all: Vec<_> = inputs.iter().map(short).collect();
    let unique = all.iter().collect::<BTreeSet<_>>().len() == all.len();
    if unique { all } else { inputs.iter().map(|path| path.display().to_string()).collect() }
}

/// Writes the page, the pictures and the tables.
fn write(args: &Args, chart: &Chart) -> anyhow::Result<Vec<PathBuf>> {
    let mut written = vec![args.output.clone()];
    report::write(&args.output, page::html(chart).as_bytes())?;
    let several = chart.machines().iter().filter(|m| !m.is_empty()).count() > 1;
    for scene in &chart.scenes {
        let path = if chart.scenes.len() == 1 {
            args.output.with_extension("svg")
        } else {
            let stem = args.output.file_stem().unwrap_or_default().to_string_lossy();
            args.output.with_file_name(format!("{stem}-{}.svg", report::slug(&scene.name)))
        };
        report::write(&path, page::svg(scene, args.error, several).as_bytes())?;
        written.push(path);
    }
    let (csv, json) = (args.output.with_extension("csv"), args.output.with_extension("json"));
    report::write(&csv, table::csv(chart).as_bytes())?;
    report::write(&json, &serde_json::to_vec_pretty(chart).context("the result cannot be said in JSON")?)?;
    written.extend([csv, json]);
    Ok(written)
}

fn summary(chart: &Chart, written: &[PathBuf], done: bool) -> String {
    let mut text = String::new();
    for scene in &chart.scenes {
        let waiting = scene.left_out.iter().filter(|[.., why]| why == "the budget ended").count();
        let others = scene.left_out.len() - waiting;
        let left = if waiting == 0 { String::new() } else { format!(", {waiting} not measured yet") };
        let (name, points) = (&scene.name, scene.points.len());
        _ = writeln!(text, "{name}: {points} points, {others} left out with the reasons{left}");
    }
    if !done {
        _ = writeln!(text, "the budget ended; the same command goes on");
    }
    for path in written {
        _ = writeln!(text, "{}", path.display());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_called_by_file_or_folder() {
        let of = |paths: &[&str]| names(&paths.iter().map(PathBuf::from).collect::<Vec<_>>());
        assert_eq!(of(&["examples/part/scene.ron", "head.nrrd", "scene.ron"]), ["part", "head", "scene"]);
        assert_eq!(of(&["a/x.ron", "b/x.ron"]), ["a/x.ron", "b/x.ron"]);
    }
}
