//! `cargo xtask scaling`: how the time of `cpu` grows with rays, with the volume, and with threads.

use std::time::Instant;

use anyhow::Result;
use volact_core::{
    Appearance, ControlPoint, FrameDesc, LookupTable, Options, Registry, ScalarType, Shape, View, Volume, VolumeDesc,
    glam::DVec3,
};

/// Frames timed; the median counts.
const FRAMES: usize = 9;

/// Runs it and prints tables.
pub fn run() -> Result<()> {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry)?;
    println!("| picture | volume | threads | ms | ns a ray | million samples a second |\n|---|---|---|---|---|---|");
    for size in [128, 256, 512, 1024] {
        row(&registry, size, 256, 0)?;
    }
    for samples in [64, 128, 256, 512] {
        row(&registry, 512, samples, 0)?;
    }
    for threads in [1, 2] {
        row(&registry, 512, 256, threads)?;
    }
    Ok(())
}

/// The same 256 world units, with `n` samples along each side, one sample of a ray a world unit.
fn row(registry: &Registry, size: usize, n: usize, threads: i64) -> Result<()> {
    let shape = ripples(n)?;
    let options = Options::from([("sample_distance".into(), 1.0.into()), ("threads".into(), threads.into())]);
    let mut action = registry.action("cpu", &options)?;
    action.manage(&shape)?;
    let desc = FrameDesc::fit(&shape, View::Iso, size, size);
    let mut times = Vec::new();
    let mut samples = 0;
    let mut rays = 0;
    for frame in 0..=FRAMES {
        let start = Instant::now();
        action.begin_draw(&desc)?;
        action.draw(&shape)?;
        let drawn = action.end_draw()?;
        if frame > 0 {
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        (samples, rays) = (drawn.statistics.samples, drawn.statistics.rays);
    }
    times.sort_by(f64::total_cmp);
    let ms = times[FRAMES / 2];
    let threads = if threads == 0 { "all".to_owned() } else { threads.to_string() };
    let (ray, rate) = (ms * 1e6 / rays as f64, samples as f64 / ms / 1e3);
    println!("| {size}² | {n}³ | {threads} | {ms:.1} | {ray:.0} | {rate:.0} |");
    Ok(())
}

/// A smooth field that is semi-transparent everywhere, so that nothing is skipped.
fn ripples(n: usize) -> Result<Shape> {
    let mut voxels = Vec::with_capacity(n * n * n);
    let at = |i: usize| i as f64 / (n - 1) as f64 * 12.0;
    for z in 0..n {
        for y in 0..n {
            for x in 0..n {
                let v = at(x).sin() + (0.7 * at(y)).cos() + (1.3 * at(z)).sin();
                voxels.push((127.5 + 40.0 * v) as u8);
            }
        }
    }
    let spacing = DVec3::splat(256.0 / (n - 1) as f64);
    let desc = VolumeDesc { spacing, ..VolumeDesc::new([n; 3], ScalarType::U8, 1) };
    let point = |value, grey, opacity| ControlPoint { value, color: [grey; 3], opacity };
    let table = LookupTable::from_points([point(0.0, 0.2, 0.001), point(255.0, 1.0, 0.01)])?;
    let appearance = Appearance::new("lut").with("lookup_table", table).with("unit_distance", 1.0);
    Ok(Shape::around(&Volume::new(desc, voxels)?, appearance))
}
