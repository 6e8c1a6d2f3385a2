//! Figures of this machine's actions on GPUs as Markdown: the adapter, what its texture unit and memory reach, and
//! what frames take beside that. `cargo xtask gpu-report` writes them to a file.
//!
//! ```text
//! cargo run --release -p volact-conformance --example gpu_figures -- [SAMPLES ALONG AN EDGE] [PIXELS] [FRAMES]
//! ```

mod probe;

use std::{error::Error, time::Instant};

use volact_core::{
    Appearance, ControlPoint, Frame, FrameDesc, LookupTable, Options, ParameterValue, Registry, RenderAction,
    ScalarType, Shape, View, Volume, VolumeDesc, glam::DVec3,
};

/// Scenes that see much, little, and only the front of a volume.
const SCENES: [&str; 3] = ["haze", "shells", "solid"];

/// Actions and options.
const SETTINGS: [(&str, &[(&str, &str)]); 6] = [
    ("wgpu", &[("method", "rays")]),
    ("wgpu", &[("method", "rays"), ("filter", "hardware")]),
    ("wgpu", &[("method", "rays"), ("filter", "hardware"), ("format", "r16")]),
    ("wgpu", &[("method", "rays"), ("skipping", "false")]),
    ("wgpu", &[("method", "slices")]),
    ("vulkan", &[]),
];

/// Shells around the middle, waved, 8 bits.
fn volume(size: usize) -> Result<Volume, Box<dyn Error>> {
    let value = |i: usize| {
        let at = [i % size, i / size % size, i / size / size].map(|v| v as f64 / (size - 1) as f64 - 0.5);
        let p = DVec3::from_array(at);
        let waves = 0.05 * ((20.0 * p.x).sin() * (17.0 * p.y).cos() + (23.0 * p.z).sin());
        (255.0 * (1.0 - 1.6 * p.length() + waves)).clamp(0.0, 255.0) as u8
    };
    let bytes: Vec<u8> = (0..size * size * size).map(value).collect();
    Ok(Volume::new(VolumeDesc::new([size; 3], ScalarType::U8, 1), bytes)?)
}

fn table(scene: &str) -> Result<LookupTable, Box<dyn Error>> {
    let point = |value: f64, opacity: f64| ControlPoint { value, color: [value / 255.0, 0.5, 0.2], opacity };
    let points = match scene {
        "haze" => vec![point(0.0, 0.0005), point(255.0, 0.004)],
        "shells" => vec![point(150.0, 0.0), point(155.0, 0.02), point(160.0, 0.0), point(254.0, 0.0)],
        _ => vec![point(120.0, 0.0), point(130.0, 0.9), point(255.0, 0.9)],
    };
    Ok(LookupTable::from_points(points)?)
}

fn draw(action: &mut dyn RenderAction, shape: &Shape, desc: &FrameDesc) -> Result<(Frame, f64), Box<dyn Error>> {
    let start = Instant::now();
    action.manage(shape)?;
    action.begin_draw(desc)?;
    action.draw(shape)?;
    let frame = action.end_draw()?;
    Ok((frame, start.elapsed().as_secs_f64() * 1e3))
}

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
