//! `cargo xtask scaling`: how the time of `cpu` grows with rays, with the volume, and with threads,
//! and what ways of drawing cost beside the plain one.

use std::time::Instant;

use anyhow::Result;
use volact_core::{
    Aabb, Appearance, Clip, ClipRegion, ControlPoint, FrameDesc, LookupTable, Options, Plane, Registry, ScalarType,
    Shape, Sphere, View, Volume, VolumeDesc,
    glam::{DAffine3, DVec3},
};

use crate::peers::median;

/// Frames timed; the median counts.
const FRAMES: usize = 9;

/// What a frame costs.
struct Cost {
    ms: f64,
    rays: u64,
    samples: u64,
}

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
    ways(&registry)
}

/// The same 256 world units, with `n` samples along each side, one sample of a ray a world unit.
fn row(registry: &Registry, size: usize, n: usize, threads: i64) -> Result<()> {
    let options = Options::from([("sample_distance".into(), 1.0.into()), ("threads".into(), threads.into())]);
    let Cost { ms, rays, samples } = time(registry, &options, &[ripples(n)?], size)?;
    let threads = if threads == 0 { "all".to_owned() } else { threads.to_string() };
    let (ray, rate) = (ms * 1e6 / rays as f64, samples as f64 / ms / 1e3);
    println!("| {size}² | {n}³ | {threads} | {ms:.1} | {ray:.0} | {rate:.0} |");
    Ok(())
}

/// The same volume by other ways.
fn ways(registry: &Registry) -> Result<()> {
    println!("\n| drawn | ms | times the first | million samples a second |\n|---|---|---|---|");
    let shape = ripples(128)?;
    let other = || -> Result<Shape> {
        let other = shape.named("other");
        other.set_transform(DAffine3::from_translation(DVec3::new(128.0, 0.0, 0.0)));
        Ok(other)
    };
    let apart = shape.named("apart");
    apart.set_transform(DAffine3::from_translation(DVec3::new(256.0, 0.0, 0.0)));
    let pre = shape.named("pre-interpolated");
    pre.set_parameter("lookup_table", table()?.pre_interpolated());
    let simple = shape.named("simple");
    simple.set_shader("simple");
    simple.set_parameter("unit_distance", 100.0);
    let middle = DVec3::splat(128.0);
    let clipped = |name: &str, region: ClipRegion| {
        let clipped = shape.named(name);
        clipped.set_clip(Clip::new([region]));
        clipped
    };
    let plane = clipped("plane", ClipRegion::plane(Plane::new(middle, DVec3::ONE)?));
    let hole = clipped("hole", ClipRegion::crop(Aabb::new(middle * 0.6, middle * 1.4)).cut());
    let ball = shape.named("ball");
    ball.set_geometry(Sphere::new(middle, 110.0, 32)?);
    let scenes = [
        ("one shape", vec![shape.clone()]),
        ("the same, classified in the middle of segments", vec![shape.clone()]),
        ("two shapes apart", vec![shape.clone(), apart]),
        ("two shapes that overlap by half", vec![shape.clone(), other()?]),
        ("three in the same place", vec![shape.clone(), shape.named("second"), shape.named("third")]),
        ("one shape behind a plane", vec![plane]),
        ("one shape with a hole", vec![hole]),
        ("one shape carved by a ball of flat faces", vec![ball]),
        ("one shape, pre-interpolated table", vec![pre]),
        ("one shape, shader `simple`", vec![simple]),
    ];
    let mut first = None;
    for (i, (name, shapes)) in scenes.iter().enumerate() {
        let mut options = Options::from([("sample_distance".into(), 1.0.into())]);
        if i == 1 {
            options.insert("classification".into(), "post".into());
        }
        let Cost { ms, samples, .. } = time(registry, &options, shapes, 512)?;
        let times = ms / *first.get_or_insert(ms);
        println!("| {name} | {ms:.1} | {times:.2} | {:.0} |", samples as f64 / ms / 1e3);
    }
    Ok(())
}

fn time(registry: &Registry, options: &Options, shapes: &[Shape], size: usize) -> Result<Cost> {
    let mut action = registry.action("cpu", options)?;
    shapes.iter().try_for_each(|shape| action.manage(shape))?;
    let desc = FrameDesc::fit_all(shapes, View::Iso, size, size);
    let mut times = Vec::new();
    let (mut samples, mut rays) = (0, 0);
    for frame in 0..=FRAMES {
        let start = Instant::now();
        action.begin_draw(&desc)?;
        shapes.iter().try_for_each(|shape| action.draw(shape))?;
        let drawn = action.end_draw()?;
        if frame > 0 {
            times.push(start.elapsed().as_secs_f64() * 1e3);
        }
        (samples, rays) = (drawn.statistics.samples, drawn.statistics.rays);
    }
    Ok(Cost { ms: median(&times), rays, samples })
}

/// A smooth field that is semi-transparent everywhere, so that nothing is skipped.
pub fn ripples(n: usize) -> Result<Shape> {
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
    let appearance = Appearance::new("lut").with("lookup_table", table()?).with("unit_distance", 1.0);
    Ok(Shape::around(&Volume::new(desc, voxels)?, appearance))
}

fn table() -> Result<LookupTable> {
    let point = |value, grey, opacity| ControlPoint { value, color: [grey; 3], opacity };
    Ok(LookupTable::from_points([point(0.0, 0.2, 0.001), point(255.0, 1.0, 0.01)])?)
}
