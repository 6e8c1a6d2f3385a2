//! Times of rays and of slices on this machine's adapter, in turns, with what a first frame takes more.
//!
//! ```text
//! cargo run --release -p volact-wgpu --example methods -- [SAMPLES ALONG AN EDGE] [PIXELS] [ROUNDS] [OPTION=VALUE …]
//! ```

use std::error::Error;

use volact_conformance::timed::{SCENES, draw, table, volume};
use volact_core::{Appearance, Frame, FrameDesc, Options, ParameterValue, Registry, Shape, View};

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
