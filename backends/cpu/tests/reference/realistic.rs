//! What it certifies on data like that of use.

use volact_core::{Appearance, FrameDesc, ScalarType, Shape, View, Volume, VolumeDesc};

use super::common::{picture, point, table};

/// A noisy ball of n³ voxels of u8, brighter inside.
fn ball(n: usize) -> Volume {
    let mut noise = 1u32;
    let mut voxels = Vec::with_capacity(n * n * n);
    for i in 0..n * n * n {
        let at = [i % n, i / n % n, i / (n * n)].map(|v| 2.0 * v as f64 / (n - 1) as f64 - 1.0);
        let r = at.iter().map(|v| v * v).sum::<f64>().sqrt();
        noise = noise.wrapping_mul(1664525).wrapping_add(1013904223);
        let rough = f64::from(noise >> 24) / 255.0 * 12.0;
        voxels.push(((1.0 - r) * 300.0 + rough).clamp(0.0, 255.0) as u8);
    }
    let mut desc = VolumeDesc::new([n; 3], ScalarType::U8, 1);
    desc.spacing = volact_core::glam::DVec3::splat(1.0 / n as f64);
    Volume::new(desc, voxels).unwrap()
}

#[test]
fn realistic_scene_is_certified() {
    let table = table(&[
        point(30.0, [0.0; 3], 0.0),
        point(60.0, [0.8, 0.3, 0.2], 0.03),
        point(90.0, [0.8, 0.3, 0.2], 0.0),
        point(150.0, [0.9, 0.9, 0.8], 0.0),
        point(200.0, [1.0, 0.9, 0.8], 0.7),
        point(230.0, [1.0, 1.0, 1.0], 1.0),
    ]);
    let shape = Shape::around(&ball(48), Appearance::new("lut").with("lookup_table", table));
    let frame = FrameDesc::fit(&shape, View::Iso, 40, 40);
    let made = picture(&[shape], &frame);
    assert!(made.not_certified <= 2, "{} not certified, widest {:e}", made.not_certified, made.widest);
    assert!(made.widest_certified <= 1e-9);
}
