//! `cargo xtask evaluator`: what shaders cost that are drawn by evaluating their sources, beside the
//! kernel of `lut`, frame by frame in turn.

use std::{fmt::Write, path::PathBuf, time::Instant};

use anyhow::{Context, Result};
use volact_core::{FrameDesc, Options, Registry, RenderAction, Shape, View};

use crate::{
    peers::{median, replace},
    scaling::ripples,
};

const MARKS: [&str; 2] = ["<!-- evaluator: begin -->", "<!-- evaluator: end -->"];
/// Samples along each side of the volume.
const VOXELS: usize = 256;
/// Rows and columns of the picture.
const PIXELS: usize = 512;

/// Arguments of `evaluator`.
#[derive(clap::Args)]
pub struct Args {
    /// Frames of each, in turn; the median counts.
    #[arg(long, default_value_t = 9)]
    frames: usize,
    /// Only those whose name contains this, beside the kernel.
    #[arg(long)]
    only: Option<String>,
    /// The document whose marked part is replaced; without, the table is printed.
    #[arg(long)]
    report: Option<PathBuf>,
}

/// A way of drawing.
struct Case {
    name: &'static str,
    shape: Shape,
    action: Box<dyn RenderAction>,
    times: Vec<f64>,
    samples: u64,
}

impl Args {
    fn names(&self, case: &Case) -> bool {
        self.only.as_ref().is_none_or(|part| case.name.contains(part.as_str()))
    }
}

/// Runs it.
pub fn run(args: &Args) -> Result<()> {
    let registry = registry()?;
    let shape = ripples(VOXELS)?;
    let case = |name: &'static str, shader: &str, recognise: bool| -> Result<Case> {
        let shape = shape.named(name);
        shape.set_shader(shader);
        let options =
            [("sample_distance", 1.0.into()), ("classification", "post".into()), ("recognise", recognise.into())];
        let options: Options = options.map(|(name, value)| (name.to_owned(), value)).into();
        let action = registry.action("cpu", &options)?;
        Ok(Case { name, shape, action, times: Vec::new(), samples: 0 })
    };
    let cases = [
        case("kernel of `lut`", "lut", true)?,
        case("source of `lut`", "lut", false)?,
        case("`tangent_space`", "tangent_space", true)?,
        case("`gradient`", "gradient", true)?,
        case("own: depth cue", "depth_cue", true)?,
        case("own: edges", "edges", true)?,
        case("own: four octaves of noise", "marble", true)?,
    ];
    let mut cases: Vec<Case> =
        cases.into_iter().enumerate().filter(|(i, c)| *i == 0 || args.names(c)).map(|(_, c)| c).collect();
    for case in &mut cases {
        case.action.manage(&case.shape)?;
    }
    for frame in 0..=args.frames {
        for case in &mut cases {
            let desc = FrameDesc::fit_all(std::slice::from_ref(&case.shape), View::Iso, PIXELS, PIXELS);
            let start = Instant::now();
            case.action.begin_draw(&desc)?;
            case.action.draw(&case.shape)?;
            let drawn = case.action.end_draw()?;
            if frame > 0 {
                case.times.push(start.elapsed().as_secs_f64() * 1e3);
            }
            case.samples = drawn.statistics.samples;
        }
    }
    let text = table(&cases)?;
    match &args.report {
        Some(report) => replace(report, MARKS, &text),
        None => {
            print!("{text}");
            Ok(())
        }
    }
}

/// A registry with the shaders that come with Volact, and those of this measurement.
fn registry() -> Result<Registry> {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry)?;
    let mut entries = volact_shaders::builtin().map_err(|problems| anyhow::anyhow!("{problems}"))?;
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    for file in ["shaders/depth_cue.ron", "shaders/marble.ron", "../examples/own_shader/edges.ron"] {
        entries.push(volact_shaders::load(root.join(file)).with_context(|| file.to_owned())?);
    }
    for entry in entries {
        if registry.shaders().get(&entry.declaration.name).is_none() {
            registry.add_shader(entry)?;
        }
    }
    Ok(registry)
}

fn table(cases: &[Case]) -> Result<String> {
    let mut out = String::new();
    writeln!(out, "\n| drawn by | ms | million samples a second | times the kernel |\n|---|---|---|---|")?;
    let first = median(&cases[0].times);
    for case in cases {
        let ms = median(&case.times);
        let rate = case.samples as f64 / ms / 1e3;
        writeln!(out, "| {} | {ms:.0} | {rate:.0} | {:.2} |", case.name, ms / first)?;
    }
    Ok(out)
}
