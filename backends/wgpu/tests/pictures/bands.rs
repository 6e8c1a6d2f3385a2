//! Pictures that are made by several submissions are those of one.

use volact_conformance::{
    metrics::identical,
    rig::Setup,
    scene::{ball, colors, lut, lut_of, shaded, square},
};
use volact_core::{
    Frame, FrameDesc, Opaque, OpaqueDepth, ScalarType, Shape, Viewport, VolumeTexture,
    glam::{DAffine3, DVec3},
};

use crate::{
    common::{draw, rays, slices},
    meshes,
};

const STEP: f64 = 0.31;

fn warm() -> volact_core::LookupTable {
    colors(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (200.0, [1.0; 3], 0.9)])
}

/// A view of 45 rows, which are no whole number of workgroups, in a part of the picture.
fn view() -> FrameDesc {
    let desc = square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 64);
    let viewport = Viewport { x: 3, y: 7, width: 50, height: 45 };
    let pixels = desc.width * desc.height;
    let distance: Vec<f32> = (0..pixels).map(|i| if i % 7 == 0 { 9.0 } else { f32::INFINITY }).collect();
    let color: Vec<[f32; 4]> = (0..pixels).map(|i| [0.2, 0.1, (i % 5) as f32 * 0.1, 0.8]).collect();
    let opaque = Opaque { color: Some(color.into()), depth: OpaqueDepth::Distance(distance.into()) };
    FrameDesc { viewport: Some(viewport), ..desc }.with_opaque(opaque)
}

fn scenes() -> Vec<Vec<Shape>> {
    let texture = VolumeTexture::new(&ball([9, 8, 10], ScalarType::U8));
    let [a, b] = [lut_of(&texture, warm(), 1.0), lut(&ball([7, 9, 8], ScalarType::F32), warm(), 2.0)];
    b.set_transform(DAffine3::from_translation(DVec3::new(2.0, 1.0, 1.5)) * DAffine3::from_rotation_x(0.5));
    let mip = shaded("mip", &texture, warm(), 1.0);
    vec![vec![a.clone()], vec![a, b, mip], meshes::of_every_kind()]
}

fn submissions(frame: &Frame) -> usize {
    let told = frame.statistics.details.iter().find(|(name, _)| name == "submissions");
    told.map_or(1, |(_, count)| count.parse().unwrap())
}

fn counts(frame: &Frame) -> [u64; 3] {
    [frame.statistics.rays, frame.statistics.samples, frame.statistics.skipped]
}

#[test]
fn bands_change_no_bit() {
    for make in [rays, slices] {
        for shapes in scenes() {
            let drawn = |most: f64| draw(&make(STEP).with("submission", most), &shapes, &view());
            let whole = drawn(1e12);
            assert_eq!(submissions(&whole), 1);
            assert!(whole.statistics.samples > 10_000);
            // A row of workgroups at a time, and some more.
            for (most, wanted) in [(1.0, 6), (whole.statistics.samples as f64, 2)] {
                let cut = drawn(most);
                assert!(submissions(&cut) >= wanted, "{most}: {}", submissions(&cut));
                assert!(identical(&whole, &cut), "{most}");
                assert_eq!(counts(&whole), counts(&cut));
            }
        }
    }
}

/// What one submission left behind means nothing to the next picture.
#[test]
fn pictures_of_other_sizes_follow_one_another() {
    let shapes = &scenes()[0];
    for setup in [Setup::new("wgpu"), Setup::new("wgpu").with("method", "slices")] {
        let registry = crate::common::registry();
        let setup = setup.with("submission", 1e4);
        let mut action = setup.action_in(&registry);
        shapes.iter().for_each(|s| action.manage(s).unwrap());
        let small = square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 17);
        for desc in [view(), small.clone(), view(), small] {
            let again = volact_conformance::rig::draw_managed(&mut *action, shapes, &desc).unwrap();
            assert!(identical(&again, &draw(&setup, shapes, &desc)));
        }
    }
}
