//! `cargo xtask peers`: other renderers on the same scenes against one ground truth, interleaved
//! with Volact, by the driver of the peers' folder (`VOLACT_PEERS`).

use std::{
    collections::BTreeMap,
    env,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};
use serde_json::Value;

/// The scenes that are unlit, and where their tables go.
const UNLIT: [&str; 4] = ["marschner_lobb_256_u8", "blob_cloud_256_u8", "ct_like_u16", "ct_mip_u16"];
const UNLIT_MARKS: [&str; 2] = ["<!-- peers: begin -->", "<!-- peers: end -->"];
/// The same of the scene lit by its gradient.
const LIT: [&str; 1] = ["ct_shaded_phong_u16"];
const LIT_MARKS: [&str; 2] = ["<!-- lit peers: begin -->", "<!-- lit peers: end -->"];

/// Where the tables of actions on GPUs go.
const GPU_MARKS: [&str; 2] = ["<!-- gpu peers: begin -->", "<!-- gpu peers: end -->"];
/// Peers that draw through a GPU's interface.
const GPU_PEERS: [&str; 3] = ["vtk-gpu", "vispy", "pygfx"];

/// Arguments of `peers`.
#[derive(clap::Args)]
pub struct Args {
    /// The python of the peers' virtual environment (its setup.sh makes it).
    #[arg(long)]
    python: PathBuf,
    /// Only tables, from an earlier run's rows.
    #[arg(long)]
    tables: bool,
    /// Where the rows go: a JSON line each.
    #[arg(long, default_value = "target/peers.jsonl")]
    log: PathBuf,
    /// The document whose marked part is replaced.
    #[arg(long, default_value = "docs/performance.md")]
    report: PathBuf,
    /// Rounds.
    #[arg(long, default_value_t = 1)]
    rounds: usize,
    /// The lit scene instead of the unlit ones.
    #[arg(long)]
    lit: bool,
    /// The actions on GPUs beside peers on GPUs (built with the feature `gpu`).
    #[arg(long, conflicts_with = "lit")]
    gpu: bool,
}

impl Args {
    fn scenes(&self) -> (&'static [&'static str], [&'static str; 2]) {
        match (self.lit, self.gpu) {
            (true, _) => (&LIT, LIT_MARKS),
            (_, true) => (&UNLIT, GPU_MARKS),
            _ => (&UNLIT, UNLIT_MARKS),
        }
    }
}

/// Runs the comparison and writes the tables.
pub fn run(args: &Args) -> Result<()> {
    if !args.tables {
        measure(args)?;
    }
    let text = fs::read_to_string(&args.log).with_context(|| format!("{}: cannot be read", args.log.display()))?;
    let rows: Vec<Value> = text.lines().filter_map(|l| serde_json::from_str(l).ok()).collect();
    let tables = if args.gpu { gpu_tables(&rows) } else { tables(&rows) };
    replace(&args.report, args.scenes().1, &tables)
}

/// Puts text between two marks of a document.
pub fn replace(path: &Path, [begin, end]: [&str; 2], text: &str) -> Result<()> {
    let document = fs::read_to_string(path).unwrap_or_else(|_| format!("{begin}\n{end}\n"));
    let (Some(from), Some(to)) = (document.find(begin), document.find(end)) else {
        bail!("{}: has no lines {begin:?} and {end:?}", path.display());
    };
    let written = format!("{}{begin}\n{text}{}", &document[..from], &document[to..]);
    let temporary = path.with_extension("tmp");
    fs::write(&temporary, written).with_context(|| format!("{}: cannot be written", temporary.display()))?;
    fs::rename(&temporary, path)?;
    println!("{}: tables written", path.display());
    Ok(())
}

/// The middle of some numbers; not a number where there are none.
pub fn median(numbers: &[f64]) -> f64 {
    let mut sorted = numbers.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

fn measure(args: &Args) -> Result<()> {
    let peers = env::var_os("VOLACT_PEERS").context("VOLACT_PEERS is not set: the folder of the peers' driver")?;
    let own = env::current_exe()?;
    let log = env::current_dir()?.join(&args.log);
    if log.exists() {
        fs::remove_file(&log)?;
    }
    let with = |name: &str, step: &str, more: &str| {
        format!(
            "{name}={} peer --scene {{scene}} --data {{data}} --view {{view}} --step {step} --size {{size}} --out {{out}}{more}",
            own.display()
        )
    };
    // Beside the same distance, one for each peer that another setting must answer.
    let others = [
        with("volact", "{step}", ""),
        with("volact-1-thread", "{step}", " --option threads=1"),
        with("volact-step-2", "2", ""),
        with("volact-step-4", "4", ""),
        with("volact-step-0.25", "0.25", ""),
    ];
    let on_gpus = [
        with("wgpu", "{step}", " --action wgpu"),
        with("wgpu-2", "2", " --action wgpu"),
        with("wgpu-4", "4", " --action wgpu"),
        with("wgpu-slices", "{step}", " --action wgpu --option method=slices"),
        with("vulkan", "{step}", " --action vulkan"),
    ];
    let mut command = Command::new(&args.python);
    command.current_dir(&peers).arg("run_all.py").arg("--scenes").args(args.scenes().0);
    command
        .args(["--budget", "1.2", "--rounds", &args.rounds.to_string(), "--log"])
        .arg(&log)
        .arg("--with")
        .args(if args.gpu { &on_gpus } else { &others });
    if args.gpu {
        command.arg("--peers").args(GPU_PEERS);
    }
    let status = command.status().with_context(|| format!("{}: cannot be run", args.python.display()))?;
    if !status.success() {
        bail!("the peers' driver failed: {status}");
    }
    Ok(())
}

/// One measurement: milliseconds and error.
#[derive(Clone, Copy)]
struct Point {
    ms: f64,
    rmse: f64,
}

type Key = (String, String, String);

/// The best of all rounds, by scene, view and distance, and there by program.
fn points(rows: &[Value]) -> BTreeMap<Key, BTreeMap<String, Point>> {
    let mut points: BTreeMap<Key, BTreeMap<String, Point>> = BTreeMap::new();
    for row in rows {
        let text = |k: &str| row[k].as_str().unwrap_or_default().to_owned();
        let (Some(ms), Some(rmse)) = (row["ms"].as_f64(), row["rmse"].as_f64()) else { continue };
        let key = (text("scene"), text("view"), format!("{}", row["step"].as_f64().unwrap_or(0.0)));
        let place = points.entry(key).or_default().entry(text("peer")).or_insert(Point { ms, rmse });
        if ms < place.ms {
            *place = Point { ms, rmse };
        }
    }
    points
}

fn tables(rows: &[Value]) -> String {
    let points = points(rows);
    let mut out = String::new();
    same_distance(&points, &mut out);
    dominated(&points, &mut out);
    scaling(&points, &mut out);
    out
}

/// For each point of a peer on a GPU the fastest setting of `wgpu` with no more error; slices of the one action
/// beside those of the other; the first frame and the memory.
fn gpu_tables(rows: &[Value]) -> String {
    let points = points(rows);
    let mut out = String::from(
        "\n| scene | view | peer | distance | ms / RMSE | wgpu, with no more error | ms / RMSE | times the peer's time |\n\
         |---|---|---|---|---|---|---|---|\n",
    );
    for ((scene, view, step), by_peer) in &points {
        for (peer, p) in by_peer.iter().filter(|(n, _)| GPU_PEERS.contains(&n.as_str())) {
            let there = points.iter().filter(|((s, v, _), _)| s == scene && v == view);
            let settings = there.flat_map(|((.., step), all)| all.iter().map(move |(n, q)| (step, n, *q)));
            let ours = settings.filter(|(_, n, q)| n.starts_with("wgpu") && q.rmse <= p.rmse);
            let best = ours.min_by(|a, b| a.2.ms.total_cmp(&b.2.ms));
            let (by, figures, ratio) = match best {
                Some((s, n, q)) => (
                    n.strip_prefix("wgpu-")
                        .filter(|n| *n != "slices")
                        .map_or_else(|| format!("{n} at {s}"), |d| format!("wgpu at {d}")),
                    format!("{:.0} / {:.5}", q.ms, q.rmse),
                    format!("{:.2}", q.ms / p.ms),
                ),
                None => ("**none**".to_owned(), String::new(), String::new()),
            };
            let _ = writeln!(
                out,
                "| {scene} | {view} | {peer} | {step} | {:.0} / {:.5} | {by} | {figures} | {ratio} |",
                p.ms, p.rmse
            );
        }
    }
    slices(&points, &mut out);
    first_frames(rows, &mut out);
    out
}

fn slices(points: &BTreeMap<Key, BTreeMap<String, Point>>, out: &mut String) {
    out.push_str(
        "\n| scene | view | distance | `wgpu` rays, ms | `wgpu` slices, ms | `vulkan` slices, ms | vulkan / wgpu slices |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for ((scene, view, step), by) in points {
        let [Some(rays), Some(slices), Some(vulkan)] = ["wgpu", "wgpu-slices", "vulkan"].map(|n| by.get(n)) else {
            continue;
        };
        let _ = writeln!(
            out,
            "| {scene} | {view} | {step} | {:.0} | {:.0} | {:.0} | {:.2} |",
            rays.ms,
            slices.ms,
            vulkan.ms,
            vulkan.ms / slices.ms
        );
    }
}

fn first_frames(rows: &[Value], out: &mut String) {
    out.push_str(
        "\n| scene | view | action | first frame / warm one | memory beside the volume / volume |\n|---|---|---|---|---|\n",
    );
    let mine = ["wgpu", "wgpu-slices", "vulkan"];
    for row in rows.iter().filter(|r| r["step"] == 1.0 && r["peer"].as_str().is_some_and(|p| mine.contains(&p))) {
        let text = |k: &str| row[k].as_str().unwrap_or_default().to_owned();
        let number = |k: &str| row[k].as_f64().unwrap_or(f64::NAN);
        let _ = writeln!(
            out,
            "| {} | {} | {} | {:.1} | {:.0} % |",
            text("scene"),
            text("view"),
            text("peer"),
            number("first_ms") / number("ms"),
            100.0 * (number("resident_bytes") / number("volume_bytes") - 1.0)
        );
    }
}

fn own(name: &str) -> bool {
    name.starts_with("volact")
}

fn same_distance(points: &BTreeMap<Key, BTreeMap<String, Point>>, out: &mut String) {
    let _ = writeln!(
        out,
        "\n### At equal sample distance\n\nMilliseconds a frame / RMSE; how many times as fast as VTK's CPU mapper; the best peer's RMSE.\n"
    );
    let _ = writeln!(
        out,
        "| scene | view | distance | volact | vtk-cpu | times as fast | best peer's RMSE | volact no worse |\n|---|---|---|---|---|---|---|---|"
    );
    for ((scene, view, step), by_peer) in points {
        let (Some(mine), Some(vtk)) = (by_peer.get("volact"), by_peer.get("vtk-cpu")) else { continue };
        let best = by_peer.iter().filter(|(n, _)| !own(n)).min_by(|a, b| a.1.rmse.total_cmp(&b.1.rmse));
        let (name, best) = best.map_or(("", f64::NAN), |(n, p)| (n.as_str(), p.rmse));
        let _ = writeln!(
            out,
            "| {scene} | {view} | {step} | {:.0} / {:.5} | {:.0} / {:.4} | {:.1} | {best:.5} ({name}) | {} |",
            mine.ms,
            mine.rmse,
            vtk.ms,
            vtk.rmse,
            vtk.ms / mine.ms,
            if mine.rmse <= best { "yes" } else { "**no**" }
        );
    }
}

fn dominated(points: &BTreeMap<Key, BTreeMap<String, Point>>, out: &mut String) {
    let _ = writeln!(out, "\n### For every peer's point, a setting with less time and less error\n");
    let _ = writeln!(
        out,
        "| scene | view | peer | distance | ms / RMSE | answered by | ms / RMSE |\n|---|---|---|---|---|---|---|"
    );
    for ((scene, view, step), by_peer) in points {
        for (peer, p) in by_peer.iter().filter(|(n, _)| !own(n)) {
            let settings = points
                .iter()
                .filter(|((s, v, _), _)| s == scene && v == view)
                .flat_map(|((_, _, step), all)| all.iter().filter(|(n, _)| own(n)).map(move |(n, p)| (step, n, *p)));
            let better = settings.filter(|(_, _, q)| q.ms < p.ms && q.rmse < p.rmse);
            let best = better.min_by(|a, b| a.2.ms.total_cmp(&b.2.ms));
            let (by, figures) = match best {
                Some((s, n, q)) => (format!("{n} at {s}"), format!("{:.0} / {:.5}", q.ms, q.rmse)),
                None => ("**none**".to_owned(), String::new()),
            };
            let _ = writeln!(
                out,
                "| {scene} | {view} | {peer} | {step} | {:.0} / {:.5} | {by} | {figures} |",
                p.ms, p.rmse
            );
        }
    }
}

fn scaling(points: &BTreeMap<Key, BTreeMap<String, Point>>, out: &mut String) {
    let _ = writeln!(
        out,
        "\n### One thread and all\n\n| scene | view | distance | one thread, ms | all, ms | ratio |\n|---|---|---|---|---|---|"
    );
    for ((scene, view, step), by_peer) in points {
        if let (Some(one), Some(all)) = (by_peer.get("volact-1-thread"), by_peer.get("volact")) {
            let _ =
                writeln!(out, "| {scene} | {view} | {step} | {:.0} | {:.0} | {:.2} |", one.ms, all.ms, one.ms / all.ms);
        }
    }
}
