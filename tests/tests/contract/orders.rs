//! How fast errors fall with the step, and that the wrong rules would be seen.

use volact_conformance::{
    metrics::{between, max_error, order, rms_error, within},
    rig::{Setup, truth},
    rules::{Rule, march, smooth},
    scene::{along_y, cell, greys, lut, placed, square, volume},
};
use volact_core::{FrameDesc, LookupTable, ScalarType, Shape, VolumeDesc, glam::DVec3};

const STEPS: [f64; 5] = [0.32, 0.16, 0.08, 0.04, 0.02];

/// Inside one trilinear cell the value is a cubic along any ray, and this table is linear over it.
fn smooth_scene() -> ([Shape; 1], FrameDesc) {
    let table = greys(&[(0.0, 0.2, 0.02), (1.0, 0.9, 0.9)]);
    ([lut(&cell(), table, 0.4)], square(DVec3::splat(0.5), DVec3::new(5.0, -9.0, 6.0), 1.2, 16))
}

/// The value rises along every ray of this view, so that each crosses the step once and none grazes.
fn stepped_scene() -> ([Shape; 1], FrameDesc) {
    let table = greys(&[(0.0, 0.3, 0.1), (0.4, 0.3, 0.1), (0.4, 0.9, 0.8), (1.0, 0.9, 0.8)]);
    let rising = volume([2, 2, 2], ScalarType::F32, |p| {
        let (x, z) = (1.0 - p.x, 1.0 - p.z);
        0.1 + 0.3 * p.y + 0.35 * x * p.y * z + 0.1 * x + 0.1 * z
    });
    ([lut(&rising, table, 0.4)], square(DVec3::splat(0.5), DVec3::new(5.0, -9.0, 6.0), 1.2, 24))
}

fn errors((shapes, desc): &([Shape; 1], FrameDesc), setup: impl Fn(f64) -> Setup) -> Vec<(f64, f64)> {
    let exact = truth(shapes, desc).color;
    let errors = STEPS.map(|h| (h, rms_error(&setup(h).colors(shapes, desc), &exact)));
    println!("{errors:?}");
    errors.to_vec()
}

#[test]
fn midpoint_with_the_exact_exponential_is_of_second_order() {
    between("cpu", order(&errors(&smooth_scene(), Setup::post)), [1.8, 2.2]);
    between("rays", order(&errors(&smooth_scene(), Setup::rays)), [1.8, 2.2]);
}

#[test]
fn pre_integration_is_of_second_order_on_a_smooth_field() {
    between("cpu", order(&errors(&smooth_scene(), Setup::pre_integrated)), [1.8, 2.2]);
    let rays = |h| Setup::rays(h).with("classification", "pre-integrated");
    between("rays", order(&errors(&smooth_scene(), rays)), [1.8, 2.2]);
}

#[test]
fn step_table_is_of_first_order_by_midpoints_and_of_second_pre_integrated() {
    let scene = stepped_scene();
    between("midpoint", order(&errors(&scene, Setup::post)), [0.75, 1.35]);
    between("midpoint in f64", order(&errors(&scene, Setup::rays)), [0.75, 1.35]);
    let rays = |h| Setup::rays(h).with("classification", "pre-integrated");
    let found = errors(&scene, rays);
    between("pre-integrated in f64", order(&found), [1.7, 2.3]);
    let post = errors(&scene, Setup::rays);
    assert!(found.iter().zip(&post).all(|(pre, post)| pre.1 < 0.5 * post.1), "{found:?} {post:?}");
}

/// Open: `cpu` tabulates pairs of values, and smears a step over one node of its table, all to one
/// side. Below that width the error no longer falls.
#[test]
#[should_panic(expected = "pre-integrated order")]
fn step_table_pre_integrated_by_cpu_is_of_second_order() {
    between("pre-integrated order", order(&errors(&stepped_scene(), Setup::pre_integrated)), [1.7, 2.3]);
}

/// What `cpu` decides by itself is never worse than the worse of the two, and good where it counts.
#[test]
fn choosing_by_itself_gets_the_better_classification() {
    let auto = |h: f64| Setup::cpu().step(h).with("termination", 0.0);
    let scene = stepped_scene();
    let (found, pre) = (errors(&scene, auto), errors(&scene, Setup::pre_integrated));
    assert!(found.iter().zip(&pre).all(|(a, b)| a.1 <= 1.01 * b.1), "{found:?} {pre:?}");
    let (shapes, desc) = &scene;
    assert_eq!(auto(0.1).draw(shapes, desc).method.classification, "pre-integrated");
    let (shapes, desc) = &smooth_scene();
    assert_eq!(auto(0.02).draw(shapes, desc).method.classification, "post-interpolated");
}

fn wavy(t: f64) -> [f64; 2] {
    [0.5 + 0.4 * (2.0 * t).cos(), 0.5 + 0.35 * (3.0 * t + 0.4).sin()]
}

/// The rig itself: rules known to be of first order are seen to be so.
#[test]
fn wrong_rules_would_be_seen() {
    let exact = smooth(&wavy, 2.0);
    let slope = |rule| {
        let error = |n: usize| {
            let found = march(rule, &wavy, 2.0, n);
            (2.0 / n as f64, (found[0] - exact[0]).abs().max((found[1] - exact[1]).abs()))
        };
        order(&[16, 32, 64, 128, 256].map(error))
    };
    between("midpoint", slope(Rule::Midpoint), [1.9, 2.1]);
    between("left", slope(Rule::Left), [0.9, 1.1]);
    between("α ≈ τh", slope(Rule::Linearised), [0.9, 1.15]);
}

/// The action's own picture is nearer to the midpoint rule than either wrong rule is.
#[test]
fn cpu_is_the_midpoint_rule_and_no_other() {
    let data = placed(VolumeDesc::new([2, 2, 2], ScalarType::F32, 1), |p| p.y);
    let table = greys(&[(0.0, 0.9, 0.1), (1.0, 0.1, 0.9)]);
    let medium = |t: f64| [0.9 - 0.8 * t, 0.1 + 0.8 * t];
    let shape = lut(&data, table, 1.0);
    for n in [4usize, 16] {
        let found = Setup::post(1.0 / n as f64).pixel(&shape, &along_y(0.5, 0.5));
        let by = |rule| {
            let [grey, a] = march(rule, &medium, 1.0, n);
            max_error(&[found], &[[grey, grey, grey, a]])
        };
        within("midpoint", by(Rule::Midpoint), 2e-6);
        assert!(by(Rule::Left) > 1e-3 && by(Rule::Linearised) > 1e-3);
    }
}

/// Finer grids of a smooth field: linear interpolation is of second order.
#[test]
fn grid_refinement_is_of_second_order() {
    let field = |p: DVec3| 0.5 + 0.4 * (4.0 * p.x + 5.0 * p.y + 0.3).sin() * (3.0 * p.z - 2.0 * p.y).cos();
    let table: LookupTable = greys(&[(0.0, 0.1, 0.05), (1.0, 0.9, 0.85)]);
    let places: Vec<_> =
        (0..5).flat_map(|i| (0..5).map(move |k| (0.13 + 0.17 * f64::from(i), 0.11 + 0.18 * f64::from(k)))).collect();
    let wanted: Vec<_> = places
        .iter()
        .map(|&(x, z)| {
            let medium = |y: f64| {
                let v = field(DVec3::new(x, y, z));
                [0.1 + 0.8 * v, 0.05 + 0.8 * v]
            };
            let [grey, a] = smooth(
                &|t| {
                    let [g, a] = medium(t);
                    [g, 1.0 - (1.0 - a).powf(2.0)]
                },
                1.0,
            );
            [grey, grey, grey, a]
        })
        .collect();
    for (name, setup) in [("exact", Setup::exact()), ("cpu", Setup::post(1.0 / 512.0))] {
        let errors: Vec<_> = [5usize, 9, 17, 33]
            .map(|n| {
                let spacing = DVec3::splat(1.0 / (n - 1) as f64);
                let desc = VolumeDesc { spacing, ..VolumeDesc::new([n; 3], ScalarType::F32, 1) };
                let shape = lut(&placed(desc, |p| field(p * spacing)), table.clone(), 0.5);
                let found: Vec<_> = places.iter().map(|&(x, z)| setup.pixel(&shape, &along_y(x, z))).collect();
                (spacing.x, rms_error(&found, &wanted))
            })
            .to_vec();
        println!("{errors:?}");
        between(name, order(&errors), [1.8, 2.2]);
    }
}
