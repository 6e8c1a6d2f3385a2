//! How fast errors fall with the step, where `cpu` and `reference` have more to say than the suite asks
//! (`cases/orders.rs`), and that it is the right rule.

use volact_conformance::{
    metrics::{between, max_error, order, rms_error, within},
    rig::{Setup, truth},
    rules::{Rule, march},
    scene::{along_y, cell, greys, lut, placed, square, volume},
};
use volact_core::{FrameDesc, ScalarType, Shape, VolumeDesc, glam::DVec3};

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
