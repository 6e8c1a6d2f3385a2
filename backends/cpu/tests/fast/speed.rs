//! How long overlaps and stretches take beside plain shapes. Figures, not a judgement: machines
//! and their neighbours differ.
//!
//!     cargo test --release -p volact-cpu --test fast -- --ignored --nocapture speed

use std::{sync::Arc, time::Instant};

use volact_core::{
    Aabb, Appearance, Block, Camera, Clip, ClipRegion, FrameDesc, Plane, ScalarType, Shape, SliceStyle, Sliced, Slices,
    Sphere, Volume,
    glam::{DAffine3, DVec3},
};

use super::scenes::{cpu, draw, look, table, volume};

const N: usize = 160;

fn cloud() -> Volume {
    let half = N as f64 / 2.0;
    volume([N; 3], ScalarType::U8, |p| {
        let q = (p - half) / half;
        (1.0 - q.length()) * 300.0 + 20.0 * (q.x * 9.0).sin() * (q.y * 7.0).cos() + (p.x * 7.0 + p.y * 13.0) % 6.0
    })
}

fn shape(volume: &Volume, at: DVec3) -> Shape {
    let ramp = table(&[(40.0, [0.0; 3], 0.0), (90.0, [0.8, 0.3, 0.2], 0.02), (230.0, [1.0; 3], 0.06)]);
    let shape = Shape::around(volume, look(ramp));
    shape.set_transform(DAffine3::from_translation(at));
    shape
}

fn milliseconds(name: &str, shapes: &[Shape], middle: DVec3, height: f64) -> f64 {
    let eye = middle + DVec3::new(2.0, -5.0, 3.0) * 100.0;
    let desc = FrameDesc::new(Camera::orthographic(eye, middle, DVec3::Z, height), 512, 512);
    let mut action = cpu(0.5, &[]);
    draw(&mut *action, shapes, &desc);
    let time = |_| {
        let start = Instant::now();
        draw(&mut *action, shapes, &desc);
        start.elapsed().as_secs_f64() * 1e3
    };
    let least = (0..7).map(time).fold(f64::INFINITY, f64::min);
    println!("{name:32} {least:8.1} ms");
    least
}

#[test]
#[ignore = "prints figures of a release build"]
fn speed_of_overlaps_and_stretches() {
    let (a, b) = (cloud(), cloud());
    let (middle, far) = (DVec3::splat(N as f64 / 2.0), DVec3::X * 2.0 * N as f64);
    let span = 1.5 * N as f64;
    let one = |at| shape(&a, at);
    let single = milliseconds("one volume", &[one(DVec3::ZERO)], middle, span);
    let apart =
        milliseconds("two apart, half as large", &[one(DVec3::ZERO), shape(&b, far)], middle + far / 2.0, 2.0 * span);
    println!("{:32} {:8.1} ms", "two apart, twice one volume", 2.0 * single);
    let both = milliseconds("two in one place", &[one(DVec3::ZERO), shape(&b, DVec3::ZERO)], middle, span);
    println!("{:32} {:8.2}", "the same beside two apart", both / (2.0 * single));
    assert!(apart > 0.0);
    milliseconds(
        "two by half through each other",
        &[one(DVec3::ZERO), shape(&b, DVec3::X * 80.0)],
        middle + 40.0,
        span,
    );
    let clipped = |region: ClipRegion| {
        let shape = one(DVec3::ZERO);
        shape.set_clip(Clip::new([region]));
        shape
    };
    milliseconds("a plane", &[clipped(ClipRegion::plane(Plane::new(middle, DVec3::ONE).unwrap()))], middle, span);
    let hole = Aabb::new(middle * 0.6, middle * 1.4);
    milliseconds("a hole", &[clipped(ClipRegion::crop(hole).cut())], middle, span);
    let carve = |volume: &Volume| look(table(&[(40.0, [0.0; 3], 0.0), (230.0, [1.0; 3], 0.06)])).with("volume", volume);
    milliseconds(
        "a ball of 1024 cells",
        &[Shape::new(Sphere::new(middle, 66.0, 32).unwrap(), carve(&a))],
        middle,
        span,
    );
    for (name, style) in [("opaque slices", SliceStyle::Opaque), ("blended slices", SliceStyle::Blended)] {
        let planes =
            vec![Plane::new(middle, DVec3::X).unwrap(), Plane::new(middle, DVec3::new(0.3, 1.0, 0.2)).unwrap()];
        let block = Block::new(DVec3::ZERO, middle * 2.0 - 1.0).unwrap();
        let geometry = Sliced::new(Arc::new(block), Slices { planes, style, volume: true }).unwrap();
        milliseconds(&format!("{name} in the volume"), &[Shape::new(geometry, carve(&a))], middle, span);
    }
    let simple = Appearance::new("simple").with("unit_distance", 30.0);
    milliseconds("components as colour", &[Shape::around(&a, simple)], middle, span);
    let pre = table(&[(40.0, [0.0; 3], 0.0), (230.0, [1.0; 3], 0.06)]).pre_interpolated();
    milliseconds("classified voxels", &[Shape::around(&a, look(pre))], middle, span);
}
