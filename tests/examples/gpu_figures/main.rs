//! Figures of this machine's actions on GPUs as Markdown: the adapter, what its texture unit and memory reach, and
//! what frames take beside that. `cargo xtask gpu-report` writes them to a file.
//!
//! ```text
//! cargo run --release -p volact-conformance --example gpu_figures -- [SAMPLES ALONG AN EDGE] [PIXELS] [FRAMES]
//! ```

mod probe;

use std::error::Error;

use volact_conformance::timed::{SCENES, draw, table, volume};
use volact_core::{Appearance, Frame, FrameDesc, Options, ParameterValue, Registry, Shape, View};

/// Actions and options.
const SETTINGS: [(&str, &[(&str, &str)]); 6] = [
    ("wgpu", &[("method", "rays")]),
    ("wgpu", &[("method", "rays"), ("filter", "hardware")]),
    ("wgpu", &[("method", "rays"), ("filter", "hardware"), ("format", "r16")]),
    ("wgpu", &[("method", "rays"), ("skipping", "false")]),
    ("wgpu", &[("method", "slices")]),
    ("vulkan", &[]),
];

fn main() -> Result<(), Box<dyn Error>> {
    let numbers: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, usual: usize| numbers.get(i).map_or(Ok(usual), |n| n.parse());
    let (size, pixels, frames) = (number(0, 256)?, number(1, 512)?, number(2, 7)?.max(1));
    if size < 2 || pixels == 0 {
        return Err(format!("{size} samples and {pixels} pixels along an edge, wanted at least 2 and 1").into());
    }
    println!("{}", probe::report()?);
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry)?;
    volact_wgpu::register(&mut registry)?;
    volact_vulkan::register(&mut registry)?;
    let volume = volume(size)?;
    println!("## Frames\n\n{size}³ samples of 8 bits, {pixels}² pixels, medians of {frames} frames after the first.\n");
    println!(
        "| scene | setting | first, ms | warm, ms | on the device, ms | samples, M | M samples/s | memory beside the volume |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for scene in SCENES {
        let look = Appearance::new("lut").with("lookup_table", table(scene)?).with("unit_distance", 1.0);
        let shape = Shape::around(&volume, look);
        let desc = FrameDesc::fit(&shape, View::Iso, pixels, pixels);
        for (name, options) in SETTINGS {
            println!("{}", row(&registry, (scene, name, options), &shape, &desc, (size * size * size, frames)));
        }
    }
    Ok(())
}

/// A row of the table; where an action cannot draw, why.
fn row(
    registry: &Registry,
    (scene, name, options): (&str, &str, &[(&str, &str)]),
    shape: &Shape,
    desc: &FrameDesc,
    (voxels, frames): (usize, usize),
) -> String {
    let words: Vec<String> = options.iter().map(|(n, v)| format!("{n}={v}")).collect();
    let title = format!("| {scene} | {name} {} |", words.join(" "));
    match measured(registry, (name, options), shape, desc, frames) {
        Err(error) => format!("{title} {error} | | | | | |"),
        Ok((first, warm, frame)) => {
            let stats = &frame.statistics;
            let device =
                stats.details.iter().find(|(n, _)| n == "GPU time").map_or("", |(_, t)| t.trim_end_matches(" ms"));
            let samples = stats.samples as f64 * 1e-6;
            let more = stats.resident_bytes as f64 / voxels as f64 - 1.0;
            format!(
                "{title} {first:.0} | {warm:.1} | {device} | {samples:.1} | {:.0} | {:.0} % |",
                samples / warm * 1e3,
                100.0 * more
            )
        }
    }
}

fn measured(
    registry: &Registry,
    (name, options): (&str, &[(&str, &str)]),
    shape: &Shape,
    desc: &FrameDesc,
    frames: usize,
) -> Result<(f64, f64, Frame), Box<dyn Error>> {
    let value = |v: &str| v.parse::<bool>().map_or_else(|_| ParameterValue::from(v), ParameterValue::from);
    let options: Options = options.iter().map(|(n, v)| ((*n).to_owned(), value(v))).collect();
    let mut action = registry.action(name, &options)?;
    let (mut frame, first) = draw(&mut *action, shape, desc)?;
    let mut times = Vec::new();
    for _ in 0..frames {
        let (next, time) = draw(&mut *action, shape, desc)?;
        times.push(time);
        frame = next;
    }
    times.sort_by(f64::total_cmp);
    Ok((first, times[times.len() / 2], frame))
}
