//! What an action holds besides the volumes.

use volact_conformance::{
    rig::{Setup, draw},
    scene::{colors, lut},
};
use volact_core::{FrameDesc, ScalarType, Shape, View, Volume, VolumeDesc};

fn check(volume: &Volume) {
    let steep = colors(&[
        (0.0, [0.1; 3], 0.0),
        (90.0, [0.9, 0.5, 0.1], 0.1),
        (90.0, [0.2, 0.5, 0.9], 0.9),
        (255.0, [1.0; 3], 1.0),
    ]);
    let shape = lut(volume, steep, 1.0);
    let desc = FrameDesc::fit(&shape, View::Iso, 8, 8);
    let bound = (volume.data().len() * 15 / 100).max(4 << 20);
    for classification in ["post", "pre-integrated", "auto"] {
        let mut action = Setup::cpu().with("classification", classification).action();
        let frame = draw(&mut *action, std::slice::from_ref(&shape), &desc).unwrap();
        let held = frame.statistics.resident_bytes;
        println!("{classification} of {}: {held} of {bound} bytes", volume.desc().scalar);
        assert!(held > 0 && held <= bound, "{classification}: {held} bytes, wanted at most {bound}");
        action.unmanage(&shape).unwrap();
        action.begin_draw(&desc).unwrap();
        assert_eq!(action.end_draw().unwrap().statistics.resident_bytes, 0, "all let go");
    }
    // Another shader of the same data holds no more.
    for shader in ["mip", "average", "xray"] {
        let other: Shape = lut(volume, volact_core::LookupTable::grey([0.0, 255.0]), 1.0);
        other.set_shader(shader);
        assert!(Setup::cpu().draw(&[other], &desc).statistics.resident_bytes <= bound);
    }
}

#[test]
fn a_volume_of_bytes_costs_little_beside_itself() {
    let n = 256usize;
    let bytes: Vec<u8> = (0..n * n * n).map(|i| (((i / n) % 251) ^ (i % n / 3)) as u8).collect();
    check(&Volume::new(VolumeDesc::new([n; 3], ScalarType::U8, 1), bytes).unwrap());
}

#[test]
fn a_volume_of_floats_costs_little_beside_itself() {
    let n = 128usize;
    let numbers: Vec<f32> = (0..n * n * n).map(|i| ((i / n) % 251) as f32 + (i % n) as f32 / 90.0).collect();
    check(&Volume::new(VolumeDesc::new([n; 3], ScalarType::F32, 1), numbers).unwrap());
}
