//! Shapes that overlap: extinctions add, and the order of drawing means nothing.

use volact_conformance::{
    meshes::{bent, corner, field},
    metrics::{identical, max_error, order, outside, within},
    rig::{Setup, truth},
    scene::{along_y, ball, colors, constant, greys, look, lut, square, volume},
};
use volact_core::{
    Block, FrameDesc, ScalarType, Shape, Sphere, VolumeTexture,
    glam::{DAffine3, DVec3},
};

fn actions() -> [(&'static str, Setup, f64); 2] {
    [("reference", Setup::exact(), 6e-8), ("cpu", Setup::post(0.1), 3e-6)]
}

fn view() -> FrameDesc {
    square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 24)
}

fn two() -> [Shape; 2] {
    let warm = colors(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (200.0, [1.0; 3], 0.6)]);
    let cold = colors(&[(0.0, [0.0, 0.2, 0.5], 0.0), (4.0, [0.1, 0.6, 1.0], 0.4), (9.0, [1.0; 3], 0.1)]);
    let other = volume([6, 7, 8], ScalarType::F32, |p| (p - DVec3::splat(3.0)).length());
    let turned = lut(&other, cold, 0.7);
    turned.set_transform(DAffine3::from_translation(DVec3::new(2.0, 1.0, 1.5)) * DAffine3::from_rotation_x(0.5));
    [lut(&ball([9, 8, 10], ScalarType::U8), warm, 1.0), turned]
}

/// σ = Σσᵢ and c = Σσᵢcᵢ/Σσᵢ.
fn mixed(shares: &[([f64; 3], f64)], length: f64) -> [f64; 4] {
    let sigma: f64 = shares.iter().map(|(_, a)| -(-a).ln_1p()).sum();
    let alpha = -(-sigma * length).exp_m1();
    let channel = |c: usize| shares.iter().map(|(color, a)| color[c] * -(-a).ln_1p()).sum::<f64>() / sigma * alpha;
    [channel(0), channel(1), channel(2), alpha]
}

const RED: ([f64; 3], f64) = ([1.0, 0.0, 0.0], 0.2);
const GREEN: ([f64; 3], f64) = ([0.0, 1.0, 0.0], 0.5);
const BLUE: ([f64; 3], f64) = ([0.0, 0.0, 1.0], 0.35);

#[test]
fn three_coincident_blocks_mix_by_extinction() {
    let slab = |(color, a)| lut(&constant(1.0, [2, 2, 2]), colors(&[(1.0, color, a)]), 1.0);
    let shapes = [RED, GREEN, BLUE].map(slab);
    for (name, setup, tolerance) in actions() {
        let found = setup.colors(&shapes, &along_y(0.7, 0.7));
        within(name, max_error(&found, &[mixed(&[RED, GREEN, BLUE], 2.0)]), tolerance);
    }
}

#[test]
fn a_volume_inside_a_mesh_mixes_where_both_are() {
    // The corner is 3 long along y at (0.5, 0.5), the block lies at y = 1 to 2 in it.
    let corner = field(corner(4.0), |_| 0.0, colors(&[(0.0, RED.0, RED.1)]), 1.0);
    let block = lut(&constant(1.0, [1, 1, 1]), colors(&[(1.0, GREEN.0, GREEN.1)]), 1.0);
    block.set_transform(DAffine3::from_translation(DVec3::Y));
    let over = |front: [f64; 4], back: [f64; 4]| std::array::from_fn(|c| front[c] + (1.0 - front[3]) * back[c]);
    let wanted = over(over(mixed(&[RED], 1.0), mixed(&[RED, GREEN], 1.0)), mixed(&[RED], 1.0));
    for (name, setup, tolerance) in actions() {
        for shapes in [[corner.clone(), block.clone()], [block.clone(), corner.clone()]] {
            within(name, max_error(&setup.colors(&shapes, &along_y(0.5, 0.5)), &[wanted]), tolerance);
        }
    }
}

#[test]
fn two_interpenetrating_volumes_agree_with_the_lattice_in_any_order() {
    let [a, b] = two();
    let (one, other) = ([a.clone(), b.clone()], [b, a]);
    for step in [0.5, 0.23] {
        let found = Setup::post(step).draw(&one, &view());
        let wanted = Setup::rays(step).colors(&one, &view());
        within("cpu", max_error(&volact_conformance::metrics::wide(&found), &wanted), 1e-5);
        assert!(identical(&found, &Setup::post(step).draw(&other, &view())));
        let alone = Setup::new("cpu").step(step).with("termination", 0.0).with("classification", "post");
        assert!(
            [1i64, 3].into_iter().all(|n| identical(&found, &alone.clone().with("threads", n).draw(&one, &view())))
        );
        assert!(identical(&found, &Setup::post(step).with("skipping", false).draw(&one, &view())));
    }
}

#[test]
fn overlaps_converge_to_the_reference_in_second_order() {
    let shapes = two();
    let truth = truth(&shapes, &view());
    let errors: Vec<_> = [0.4, 0.2, 0.1, 0.05]
        .map(|h| (h, volact_conformance::metrics::rms_error(&Setup::post(h).colors(&shapes, &view()), &truth.color)))
        .to_vec();
    volact_conformance::metrics::between("order", order(&errors), [1.7, 2.3]);
}

/// A volume cut in two by its user: second order in the step, and nothing to the reference.
#[test]
fn parts_of_a_volume_are_the_volume() {
    let data = ball([9, 8, 10], ScalarType::F32);
    let table = || colors(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (200.0, [1.0; 3], 0.6)]);
    let part = |offset: DVec3, size: DVec3| {
        let look = look("lut", table(), 1.0).with("volume", VolumeTexture::new(&data));
        Shape::new(Block::new(offset, size).unwrap(), look)
    };
    let cut = 3.37;
    let parts = [
        part(DVec3::ZERO, DVec3::new(8.0, cut, 9.0)),
        part(DVec3::new(0.0, cut, 0.0), DVec3::new(8.0, 7.0 - cut, 9.0)),
    ];
    let whole = [lut(&data, table(), 1.0)];
    within("reference", outside(&truth(&parts, &view()).color, &truth(&whole, &view())), 1e-8);
    let errors: Vec<_> = [0.4, 0.2, 0.1, 0.05]
        .map(|h| {
            let (a, b) = (Setup::post(h).colors(&parts, &view()), Setup::post(h).colors(&whole, &view()));
            (h, volact_conformance::metrics::rms_error(&a, &b))
        })
        .to_vec();
    assert!(errors[3].1 < errors[0].1 / 20.0, "{errors:?}");
}

#[test]
fn meshes_and_volumes_through_each_other_agree() {
    let [volume, _] = two();
    let rule = |p: DVec3| 0.5 + 0.5 * (1.3 * p.x).sin() * (0.9 * p.z + p.y).cos();
    let table = colors(&[(0.0, [0.1, 0.2, 0.9], 0.0), (0.5, [0.2, 0.9, 0.4], 0.2), (1.0, [1.0, 0.8, 0.6], 0.5)]);
    let mesh = field(bent([4, 3, 5], DVec3::splat(6.0), 0.12), rule, table, 1.0);
    mesh.set_transform(
        DAffine3::from_translation(DVec3::new(2.0, -1.0, 2.0)) * DAffine3::from_scale(DVec3::new(-0.7, 1.0, 1.1)),
    );
    let ball = Shape::new(
        Sphere::new(DVec3::splat(4.5), 3.0, 16).unwrap(),
        look("lut", greys(&[(0.0, 1.0, 0.0), (150.0, 0.5, 0.3)]), 1.0)
            .with("volume", volume.state().volume().unwrap().clone()),
    );
    let shapes = [volume, mesh, ball];
    let truth = truth(&shapes, &view());
    let fine = Setup::post(0.03).colors(&shapes, &view());
    // The midpoint rule at 0.03 of a unit.
    within("cpu", outside(&fine, &truth), 1e-3);
    let coarse = Setup::post(0.12).colors(&shapes, &view());
    let errors = [max_error(&coarse, &truth.color), max_error(&fine, &truth.color)];
    assert!(errors[1] < errors[0] / 6.0, "second order: {errors:?}");
    for order in [[0, 2, 1], [1, 0, 2], [2, 1, 0]] {
        let turned = order.map(|i: usize| shapes[i].clone());
        assert!(identical(&Setup::post(0.12).draw(&shapes, &view()), &Setup::post(0.12).draw(&turned, &view())));
        assert!(identical(&Setup::exact().draw(&shapes, &view()), &Setup::exact().draw(&turned, &view())));
    }
}
