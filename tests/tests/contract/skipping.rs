//! Skipping, stopping, threads, vector units: none of them may change a bit.

use volact_conformance::{
    metrics::{identical, max_error, wide, within},
    rig::{Setup, draw, draw_managed},
    scene::{ball, colors, greys, lut, lut_of, shaded, square, volume},
};
use volact_core::{
    Appearance, Filter, FrameDesc, ParameterValue, ScalarType, Shape, View, VolumeTexture,
    glam::{DAffine3, DVec3},
};

fn sparse() -> volact_core::LookupTable {
    colors(&[
        (60.0, [0.9, 0.2, 0.1], 0.0),
        (80.0, [0.2, 0.9, 0.3], 0.5),
        (90.0, [0.1, 0.2, 1.0], 0.0),
        (190.0, [1.0; 3], 0.0),
        (200.0, [1.0; 3], 1.0),
    ])
}

/// For the lowest value, which is 0 along most rays.
fn dark() -> volact_core::LookupTable {
    greys(&[(0.0, 0.3, 0.4), (90.0, 1.0, 0.9), (200.0, 0.1, 0.0)])
}

/// A volume of f32 with holes, empty for the most part.
fn holes() -> volact_core::Volume {
    let whole = ball([37, 29, 33], ScalarType::F32);
    volume([37, 29, 33], ScalarType::F32, |p| {
        let v = whole.value(p.to_array().map(|c| c as usize), 0);
        if (p - DVec3::new(12.0, 13.0, 20.0)).length() < 2.0 { f64::NAN } else { v }
    })
}

/// Scenes by name, with all ways of compositing, types and filters.
fn scenes() -> Vec<(String, Vec<Shape>)> {
    let mut all = Vec::new();
    let table = |shader: &str| if shader == "minip" { dark() } else { sparse() };
    for scalar in [ScalarType::U8, ScalarType::I16, ScalarType::F32] {
        let texture = VolumeTexture::new(&ball([37, 29, 33], scalar));
        for shader in ["lut", "mip", "minip", "average", "xray"] {
            all.push((format!("{shader} of {scalar}"), vec![shaded(shader, &texture, table(shader), 2.0)]));
        }
    }
    for shader in ["lut", "mip", "minip", "average", "xray"] {
        let texture = VolumeTexture::new(&holes());
        all.push((format!("{shader} with holes"), vec![shaded(shader, &texture, table(shader), 2.0)]));
    }
    // What is clamped lies at the ends of the table: neither may be skipped where it is seen.
    let ends = greys(&[
        (-9.0, 0.1, 0.0),
        (0.0, 0.5, 0.01),
        (50.0, 0.1, 0.0),
        (150.0, 0.1, 0.0),
        (200.0, 1.0, 0.7),
        (300.0, 1.0, 0.0),
    ]);
    for scalar in [ScalarType::U16, ScalarType::F16, ScalarType::F32] {
        all.push((format!("ends of {scalar}"), vec![lut(&ball([37, 29, 33], scalar), ends.clone(), 2.0)]));
    }
    let texture = VolumeTexture::new(&ball([37, 29, 33], ScalarType::U8));
    all.push(("nearest".into(), vec![lut_of(&texture.clone().with_filter(Filter::Nearest), sparse(), 1.0)]));
    all.push(("pre-interpolated".into(), vec![lut_of(&texture, sparse().pre_interpolated(), 1.0)]));
    let other = lut(&ball([20, 30, 20], ScalarType::U8), sparse(), 1.0);
    other.set_transform(DAffine3::from_translation(DVec3::splat(5.0)));
    all.push(("overlap".into(), vec![lut_of(&texture, sparse(), 2.0), other]));
    let simple = Shape::around_texture(&texture, Appearance::new("simple").with("unit_distance", 9.0));
    all.push(("simple".into(), vec![simple]));
    all
}

fn views(shapes: &[Shape]) -> [FrameDesc; 2] {
    let ortho = square(DVec3::new(18.0, 14.0, 16.0), DVec3::new(20.0, -60.0, 35.0), 50.0, 23);
    [FrameDesc::fit_all(shapes, View::Iso, 29, 21), ortho]
}

fn classifications() -> [Setup; 2] {
    let cpu = || Setup::cpu().step(0.61);
    [cpu().with("classification", "post"), cpu().with("classification", "pre-integrated")]
}

/// Draws all scenes with `plain` options and with each of the others, and wants the same bits.
fn same(plain: (&str, ParameterValue), others: &[(&str, ParameterValue)]) {
    for (name, shapes) in scenes() {
        for desc in views(&shapes) {
            for setup in classifications() {
                let wanted = setup.clone().with(plain.0, plain.1.clone()).draw(&shapes, &desc);
                assert!(wanted.color.iter().any(|c| c[3] > 0.0), "{name} shows nothing");
                for (option, value) in others {
                    let found = setup.clone().with(option, value.clone()).draw(&shapes, &desc);
                    let error = max_error(&wide(&found), &wide(&wanted));
                    assert!(identical(&found, &wanted), "{name}, {option} {value}, {setup:?}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn skipping_leaves_every_bit() {
    same(("skipping", false.into()), &[("skipping", true.into())]);
}

#[test]
fn skipping_skips() {
    let shape = [lut(&ball([64, 64, 64], ScalarType::U8), sparse(), 2.0)];
    let desc = FrameDesc::fit(&shape[0], View::Iso, 24, 24);
    for setup in [Setup::post(0.5), Setup::pre_integrated(0.5)] {
        let samples = |on: bool| setup.clone().with("skipping", on).draw(&shape, &desc).statistics.samples;
        assert!(2 * samples(true) < samples(false), "{} of {}", samples(true), samples(false));
    }
}

#[test]
fn number_of_threads_leaves_every_bit() {
    let threads = |n: i64| ("threads", ParameterValue::Int(n));
    same(threads(1), &[threads(2), threads(3), threads(8)]);
}

#[test]
fn vector_units_agree() {
    let has = |unit: &str| Setup::cpu().with("unit", unit).try_action().is_ok();
    if !has("avx2") {
        println!("skipped: this machine has no AVX2");
        return;
    }
    if has("avx512") {
        same(("unit", "avx2".into()), &[("unit", "avx512".into())]);
    } else {
        println!("skipped: this machine has no AVX-512");
    }
    for (name, shapes) in scenes() {
        let desc = &views(&shapes)[0];
        let setup = Setup::post(0.61);
        let (a, b) = (setup.clone().with("unit", "avx2"), setup.with("unit", "plain"));
        // Without fused multiply-add interpolation rounds once more, 3e-8 of values of 200.
        within(&name, max_error(&a.colors(&shapes, desc), &b.colors(&shapes, desc)), 1e-5);
    }
}

/// Rays that end early miss no more than the bound says: what is left to see, of colours up to 1.
#[test]
fn early_termination_keeps_its_bound() {
    let dense = greys(&[(0.0, 0.3, 0.05), (200.0, 1.0, 0.6)]);
    let shapes = [lut(&ball([37, 29, 33], ScalarType::U8), dense, 1.0)];
    let both = [shapes[0].clone(), lut(&ball([9, 9, 9], ScalarType::U8), greys(&[(0.0, 0.5, 0.1)]), 1.0)];
    for shapes in [&shapes[..], &both[..]] {
        for desc in views(shapes) {
            for setup in classifications() {
                let whole = setup.clone().with("termination", 0.0).draw(shapes, &desc);
                let mut samples = whole.statistics.samples;
                for bound in [1.0 / 255_000.0, 1e-3, 0.05, 0.3] {
                    let found = setup.clone().with("termination", bound).draw(shapes, &desc);
                    let error = max_error(&wide(&found), &wide(&whole));
                    within(&format!("termination {bound:.0e}"), error, bound + 1e-6);
                    assert!(found.statistics.samples <= samples);
                    samples = found.statistics.samples;
                }
                assert!(samples < whole.statistics.samples, "nothing ended early");
            }
        }
    }
}

/// Termination is tested at places of the lattice, not at counts of samples taken.
#[test]
fn termination_and_skipping_together_leave_every_bit() {
    for (name, shapes) in scenes() {
        let desc = &views(&shapes)[1];
        let setup = Setup::cpu().step(0.3).with("termination", 0.2);
        let (a, b) = (setup.clone().with("skipping", true), setup.with("skipping", false));
        assert!(identical(&a.draw(&shapes, desc), &b.draw(&shapes, desc)), "{name}");
    }
}

#[test]
fn the_same_again_is_the_same() {
    for (name, shapes) in scenes() {
        for setup in classifications() {
            let [desc, other] = views(&shapes);
            let mut action = setup.action();
            let first = draw(&mut *action, &shapes, &desc).unwrap();
            draw_managed(&mut *action, &shapes, &other).unwrap();
            let again = draw_managed(&mut *action, &shapes, &desc).unwrap();
            assert!(identical(&first, &again), "{name}: after another frame");
            assert!(identical(&first, &setup.draw(&shapes, &desc)), "{name}: by another action");
        }
    }
}

/// A shape that is managed but not drawn leaves no trace, not even by its finer voxels.
#[test]
fn managed_but_not_drawn_changes_nothing() {
    let fine = volume([4, 4, 4], ScalarType::F32, |p| p.x);
    let other = lut(&fine, greys(&[(0.0, 1.0, 0.5)]), 1.0);
    other.set_transform(DAffine3::from_scale(DVec3::splat(0.05)));
    for (name, shapes) in scenes() {
        let desc = &views(&shapes)[0];
        for setup in [Setup::cpu(), Setup::rays(0.5)] {
            let alone = setup.draw(&shapes, desc);
            let mut action = setup.action();
            action.manage(&other).unwrap();
            let with = draw(&mut *action, &shapes, desc).unwrap();
            assert!(identical(&alone, &with), "{name}");
            assert_eq!(alone.method.sample_distance, with.method.sample_distance);
            // Frame by frame, with the other one drawn in between.
            action.begin_draw(desc).unwrap();
            action.draw(&other).unwrap();
            action.end_draw().unwrap();
            assert!(identical(&alone, &draw_managed(&mut *action, &shapes, desc).unwrap()), "{name}");
        }
    }
}

/// A shape that is managed and not drawn may be so small that its own voxels would be a step beyond
/// all limits for the one that is drawn.
#[test]
fn managed_but_not_drawn_refuses_nothing() {
    let tiny = lut(&volume([4, 4, 4], ScalarType::F32, |p| p.x), greys(&[(0.0, 1.0, 0.5)]), 1.0);
    tiny.set_transform(DAffine3::from_scale(DVec3::splat(1e-9)));
    let (_, shapes) = scenes().swap_remove(0);
    let desc = &views(&shapes)[0];
    let mut action = Setup::cpu().action();
    action.manage(&tiny).unwrap();
    let found = draw(&mut *action, &shapes, desc).unwrap_or_else(|e| panic!("refused: {e}"));
    assert!(identical(&found, &Setup::cpu().draw(&shapes, desc)));
}
