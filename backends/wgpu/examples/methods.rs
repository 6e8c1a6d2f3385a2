//! Times of rays and of slices on this machine's adapter, in turns, with what a first frame takes more.
//!
//! ```text
//! cargo run --release -p volact-wgpu --example methods -- [SAMPLES ALONG AN EDGE] [PIXELS] [ROUNDS] [OPTION=VALUE …]
//! ```

use std::{error::Error, time::Instant};

use volact_core::{
    Appearance, ControlPoint, Frame, FrameDesc, LookupTable, Options, ParameterValue, Registry, RenderAction,
    ScalarType, Shape, View, Volume, VolumeDesc, glam::DVec3,
};

/// What makes scenes differ: how much of a volume is seen.
const SCENES: [&str; 3] = ["haze", "shells", "solid"];

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
    let (settings, numbers): (Vec<String>, Vec<String>) = std::env::args().skip(1).partition(|a| a.contains('='));
    let number = |i: usize, usual: usize| numbers.get(i).map_or(Ok(usual), |n| n.parse());
    let (size, pixels, rounds) = (number(0, 256)?, number(1, 512)?, number(2, 5)?);
    let mut registry = Registry::with_core();
    volact_wgpu::register(&mut registry)?;
    let volume = volume(size)?;
    println!(
        "{:<8}{:<8}{:>12}{:>12}{:>12}{:>10}{:>14}",
        "scene", "method", "first ms", "warm ms", "GPU ms", "ratio", "resident"
    );
    for scene in SCENES {
        let look = Appearance::new("lut").with("lookup_table", table(scene)?).with("unit_distance", 1.0);
        let shape = Shape::around(&volume, look);
        let desc = FrameDesc::fit(&shape, View::Iso, pixels, pixels);
        let mut runs = Vec::new();
        for method in ["rays", "slices"] {
            let mut options = Options::from([("method".to_owned(), ParameterValue::from(method))]);
            for (name, value) in settings.iter().filter_map(|s| s.split_once('=')) {
                let value = value.parse::<f64>().map_or(ParameterValue::from(value), ParameterValue::from);
                options.insert(name.into(), value);
            }
            let mut action = registry.action("wgpu", &options)?;
            let (_, first) = draw(&mut *action, &shape, &desc)?;
            runs.push((method, action, first, Vec::new(), Frame::empty(&desc)));
        }
        for _ in 0..rounds.max(1) {
            for (_, action, _, times, last) in &mut runs {
                let (frame, time) = draw(&mut **action, &shape, &desc)?;
                times.push(time);
                *last = frame;
            }
        }
        let median = |times: &[f64]| {
            let mut sorted = times.to_vec();
            sorted.sort_by(f64::total_cmp);
            sorted[sorted.len() / 2]
        };
        let rays = median(&runs[0].3);
        for (method, _, first, times, last) in &runs {
            let (warm, resident) = (median(times), last.statistics.resident_bytes);
            let device = last.statistics.details.iter().find(|(n, _)| n == "GPU time").map_or("", |(_, t)| t);
            let device = device.trim_end_matches(" ms");
            println!("{scene:<8}{method:<8}{first:>12.1}{warm:>12.1}{device:>12}{:>10.2}{resident:>14}", warm / rays);
        }
        println!("        {}", runs[0].4.method.device);
    }
    Ok(())
}
