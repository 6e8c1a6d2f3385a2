//! Opacity is the fraction absorbed over the unit distance, and nothing else enters.

use volact_conformance::{
    metrics::{max_error, within},
    rig::{Setup, truth},
    scene::{along_y, ball, cell, colors, constant, greys, lut, placed, square, volume},
};
use volact_core::{
    Camera, FrameDesc, ScalarType, Shape, VolumeDesc, WarningCode,
    glam::{DAffine3, DVec3},
};

/// 1 − (1 − a)^x without cancellation.
fn absorbed(a: f64, x: f64) -> f64 {
    -(x * (-a).ln_1p()).exp_m1()
}

fn relative(found: [f64; 4], wanted: [f64; 4]) -> f64 {
    (0..4).map(|c| (found[c] - wanted[c]).abs() / wanted[c].abs().max(1e-300)).fold(0.0, f64::max)
}

#[test]
fn constant_medium_absorbs_its_share_over_each_unit() {
    let color = [0.9, 0.4, 0.2];
    let (mut cpu, mut exact) = (0f64, 0f64);
    for a in [1e-7, 1e-5, 1e-3, 0.1, 0.5, 0.9, 0.999] {
        for (unit, cells) in [(0.25, 1), (1.0, 1), (1.7, 3), (40.0, 2)] {
            let shape = lut(&constant(0.5, [1, cells, 1]), colors(&[(0.0, color, a)]), unit);
            let alpha = absorbed(a, cells as f64 / unit);
            let wanted = [color[0] * alpha, color[1] * alpha, color[2] * alpha, alpha];
            let desc = along_y(0.4, 0.6);
            exact = exact.max(relative(truth(std::slice::from_ref(&shape), &desc).color[0], wanted));
            for step in [0.03, 0.37] {
                for setup in [Setup::post(step), Setup::pre_integrated(step)] {
                    cpu = cpu.max(relative(setup.pixel(&shape, &desc), wanted));
                }
            }
        }
    }
    // Enclosures are absolute; optical depths down to 5e-9 keep seven digits all the same.
    within("exact, relative", exact, 1e-7);
    // f32: α of a segment and up to a hundred sums, each rounded to 6e-8.
    within("cpu, relative", cpu, 1e-5);
}

/// Open: a cut segment is a power of a whole segment's opacity, which f32 rounds to 1 where the step
/// is far longer than the unit; a ray through a medium of 0.9999 then ends opaque.
#[test]
#[should_panic(expected = "step of twenty units")]
fn steps_far_longer_than_the_unit_absorb_no_more() {
    let shape = lut(&constant(0.5, [1, 1, 1]), greys(&[(0.0, 0.9, 0.9)]), 0.25);
    let found = Setup::post(5.0).pixel(&shape, &along_y(0.4, 0.6));
    within("step of twenty units", (found[3] - absorbed(0.9, 4.0)).abs(), 1e-6);
}

#[test]
fn opacity_over_another_unit_is_the_same_medium() {
    let desc = along_y(0.3, 0.3);
    let mut worst = [0f64; 2];
    for a in [1e-9, 1e-6, 5e-5, 0.02, 0.6] {
        for k in [0.25, 3.0, 17.0] {
            let make = |a: f64, unit: f64| lut(&constant(1.0, [1, 2, 1]), greys(&[(0.0, 0.7, a)]), unit);
            let (one, other) = (make(a, 0.8), make(absorbed(a, k), 0.8 * k));
            for (i, setup) in [Setup::exact(), Setup::post(0.13)].iter().enumerate() {
                worst[i] = worst[i].max(relative(setup.pixel(&one, &desc), setup.pixel(&other, &desc)));
            }
        }
    }
    // Frames are f32: 6e-8 relative.
    within("exact, relative", worst[0], 2e-7);
    within("cpu, relative", worst[1], 1e-5);
}

#[test]
fn no_opacity_is_exactly_transparent() {
    let shape = |v| lut(&constant(v, [4, 4, 4]), greys(&[(0.0, 0.9, 0.0), (1.0, 1.0, 0.0), (2.0, 0.5, 1.0)]), 1.0);
    let desc = square(DVec3::splat(2.0), DVec3::new(3.0, -9.0, 4.0), 9.0, 16);
    for setup in [Setup::exact(), Setup::rays(0.3), Setup::cpu(), Setup::post(0.3), Setup::pre_integrated(0.3)] {
        let frame = setup.draw(&[shape(0.7)], &desc);
        assert!(frame.color.iter().all(|c| *c == [0.0; 4]), "{setup:?}");
        assert!(frame.depth.iter().all(|d| *d == f32::INFINITY), "{setup:?}");
    }
}

/// The value runs along the ray, so that colour tells where the ray ended.
#[test]
fn opaque_over_a_length_ends_the_ray_at_its_start() {
    let data = volume([2, 5, 2], ScalarType::F32, |p| p.y);
    let table = colors(&[
        (1.0, [0.0, 0.0, 1.0], 0.0),
        (1.0, [1.0, 0.0, 0.0], 1.0),
        (3.0, [0.0, 1.0, 0.0], 1.0),
        (3.0, [0.0, 0.0, 1.0], 0.0),
    ]);
    let shape = lut(&data, table, 1.0);
    let found = truth(std::slice::from_ref(&shape), &along_y(0.5, 0.5)).color[0];
    within("exact", max_error(&[found], &[[1.0, 0.0, 0.0, 1.0]]), 1e-9);
    for n in [1.0, 4.0, 16.0] {
        // A lattice sees the first opaque segment in its middle, at most h/2 on; colours change by
        // a half a unit.
        let h = 1.0 / n;
        for setup in [Setup::rays(h), Setup::post(h), Setup::pre_integrated(h)] {
            let found = setup.pixel(&shape, &along_y(0.5, 0.5));
            within("lattice", max_error(&[found], &[[1.0, 0.0, 0.0, 1.0]]), h / 4.0 + 1e-5);
        }
    }
}

/// A peak of 1 touched in a point: ∫ −ln|2x − 1| dx over 0 to 1 is 1, so a finite opacity.
#[test]
fn point_contact_with_opaque_has_its_finite_integral() {
    let length = 2.0;
    let data = volume([2, 3, 2], ScalarType::F64, |p| p.y / length);
    for unit in [0.5, 2.0, 8.0] {
        let shape = lut(&data, greys(&[(0.0, 1.0, 0.0), (0.5, 1.0, 1.0), (1.0, 1.0, 0.0)]), unit);
        let wanted = [-(-length / unit).exp_m1(); 4];
        let found = truth(std::slice::from_ref(&shape), &along_y(0.5, 0.5)).color[0];
        within("exact", max_error(&[found], &[wanted]), 1e-9);
        let h = length / 256.0;
        let found = Setup::post(h).pixel(&shape, &along_y(0.5, 0.5));
        // The midpoint rule on a logarithm: h·ln 2 of optical depth over 2·unit either side.
        let tolerance = (h / unit) * (-length / unit).exp() + 1e-5;
        within("cpu, midpoint", max_error(&[found], &[wanted]), tolerance);
    }
}

#[test]
fn unit_distance_left_out_is_the_smallest_voxel_once_and_said() {
    let spacing = DVec3::new(3.0, 0.5, 2.0);
    let placement = DAffine3::from_scale(DVec3::splat(4.0));
    let desc = VolumeDesc { spacing, placement, ..VolumeDesc::new([3, 5, 3], ScalarType::F32, 1) };
    let data = placed(desc, |p| p.x + p.y);
    let table = greys(&[(0.0, 0.2, 0.1), (6.0, 0.9, 0.4)]);
    let shape = Shape::around(&data, volact_core::Appearance::new("lut").with("lookup_table", table.clone()));
    let noted = |s: &Shape| s.notes().iter().filter(|n| n.code == WarningCode::UnitDistanceDefaulted).count();
    assert_eq!(noted(&shape), 1);
    assert!(shape.notes()[0].message.contains("2.0"), "{:?}", shape.notes());
    let view = FrameDesc::fit(&shape, volact_core::View::Iso, 12, 12);
    let given = lut(&data, table, 2.0);
    assert_eq!(noted(&given), 0);
    let setup = Setup::cpu().step(0.7);
    assert_eq!(setup.colors(std::slice::from_ref(&shape), &view), setup.colors(&[given], &view));
    let frame = setup.draw(std::slice::from_ref(&shape), &view);
    assert_eq!(frame.warnings.iter().filter(|w| w.code == WarningCode::UnitDistanceDefaulted).count(), 1);
    // Nothing about voxels enters later: a larger shape keeps its unit.
    shape.set_transform(DAffine3::from_scale(DVec3::splat(40.0)));
    assert_eq!(shape.state().parameters["unit_distance"].as_float(), Some(2.0));
}

#[test]
fn unit_not_positive_is_refused() {
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let shape = lut(&cell(), greys(&[(0.0, 1.0, 0.5)]), unit);
        for name in ["cpu", "reference", "null"] {
            let error = Setup::new(name).action().manage(&shape).unwrap_err().to_string();
            assert!(error.contains("unit_distance"), "{name}, {unit}: {error}");
        }
    }
}

fn scaled(scale: f64, offset: DVec3) -> (Shape, Camera) {
    let shape = lut(&ball([14, 12, 13], ScalarType::U8), greys(&[(20.0, 0.1, 0.0), (200.0, 0.9, 0.6)]), 1.3 * scale);
    let turn = DAffine3::from_rotation_z(0.4) * DAffine3::from_rotation_x(0.2);
    let to_world = DAffine3::from_translation(offset) * DAffine3::from_scale(DVec3::splat(scale)) * turn;
    shape.set_transform(to_world);
    let at = |p: DVec3| offset + p * scale;
    let camera = Camera::perspective(at(DVec3::new(9.0, -30.0, 16.0)), at(DVec3::splat(5.0)), DVec3::Z, 30.0);
    (shape, camera)
}

#[test]
fn scene_unit_and_step_of_any_size_and_place_look_the_same() {
    let picture = |scale: f64, offset: DVec3, setup: &dyn Fn(f64) -> Setup| {
        let (shape, camera) = scaled(scale, offset);
        setup(0.45 * scale).colors(&[shape], &FrameDesc::new(camera, 16, 16))
    };
    type Make = &'static dyn Fn(f64) -> Setup;
    let setups: [(&str, Make, f64); 3] = [
        // f32 frames of an f64 picture.
        ("rays", &|h| Setup::rays(h), 1e-6),
        // Positions are local: what is left is f32 interpolation, 1e-7 of a voxel's contrast.
        ("post", &|h| Setup::post(h), 1e-5),
        ("pre-integrated", &|h| Setup::pre_integrated(h), 1e-5),
    ];
    for (name, setup, tolerance) in setups {
        let plain = picture(1.0, DVec3::ZERO, setup);
        assert!(plain.iter().any(|c| c[3] > 0.3));
        for (scale, offset) in [
            (1e-9, DVec3::ZERO),
            (1e7, DVec3::ZERO),
            (1.0, DVec3::new(1e7, -1e7, 3e6)),
            (1e-3, DVec3::splat(1e3)),
            (1e-9, DVec3::splat(-1e-2)),
        ] {
            let found = picture(scale, offset, setup);
            // The rounding of f64 coordinates themselves, in voxels.
            let coordinates = 4.0 * f64::EPSILON * offset.length() / scale;
            within(&format!("{name} at {scale:e}, {offset}"), max_error(&found, &plain), tolerance + coordinates);
        }
    }
}
