//! How samples and shapes come together.

use volact_conformance::{
    metrics::{between, identical, max_error, order, rms_error, within},
    rig::{Setup, truth},
    scene::{along_y, ball, cell, colors, constant, greys, lut, shaded, square, volume},
};
use volact_core::{
    Block, FrameDesc, LookupTable, ScalarType, Shape, VolumeTexture,
    glam::{DAffine3, DVec3},
};

/// Values 10 to 30 along the ray over a length of 4; black at 0, white at 100.
fn ramp(shader: &str, unit: f64) -> Shape {
    let data = volume([2, 5, 2], ScalarType::F32, |p| 10.0 + 5.0 * p.y);
    shaded(shader, &VolumeTexture::new(&data), LookupTable::grey([0.0, 100.0]), unit)
}

#[test]
fn extremes_mean_and_sum_of_a_linear_value_are_its_closed_forms() {
    // The line integral of the value is 80.
    for (shader, unit, wanted) in
        [("mip", 1.0, 0.3), ("minip", 1.0, 0.1), ("average", 1.0, 0.2), ("xray", 2.0, 0.4), ("xray", 1.0, 0.8)]
    {
        let shape = ramp(shader, unit);
        let wanted = [[wanted, wanted, wanted, 1.0]];
        let desc = along_y(0.5, 0.5);
        within(shader, max_error(&[truth(std::slice::from_ref(&shape), &desc).color[0]], &wanted), 1e-9);
        for step in [1.0, 0.25, 0.03125] {
            let found = Setup::cpu().step(step).pixel(&shape, &desc);
            // Extremes lie at the ends, and samples half a step inside; means of the midpoint rule
            // are exact here.
            let inside = if shader.starts_with('m') { 0.05 * step / 2.0 } else { 0.0 };
            let error = max_error(&[found], &wanted);
            within(&format!("{shader}, cpu at {step}"), (error - inside).abs(), 2e-6);
        }
    }
}

#[test]
fn whole_pictures_of_every_compositing_agree_with_the_lattice() {
    let desc = square(DVec3::splat(7.0), DVec3::new(4.0, -9.0, 5.0), 19.0, 14);
    for scalar in [ScalarType::U8, ScalarType::I16, ScalarType::F32] {
        let texture = VolumeTexture::new(&ball([15, 16, 14], scalar));
        for shader in ["lut", "mip", "minip", "average", "xray"] {
            let unit = if shader == "xray" { 12.0 } else { 1.0 };
            let table =
                colors(&[(0.0, [0.1, 0.2, 0.0], 0.0), (90.0, [1.0, 0.5, 0.1], 0.3), (200.0, [0.3, 1.0, 0.9], 0.9)]);
            let shape = [shaded(shader, &texture, table, unit)];
            let found = Setup::post(0.37).colors(&shape, &desc);
            let wanted = Setup::rays(0.37).colors(&shape, &desc);
            // f32 interpolation of values of 200, on slopes of up to 1 in 90.
            within(&format!("{shader} of {scalar}"), max_error(&found, &wanted), 1e-5);
        }
    }
}

/// Opacity is taken as it stands: no length in it.
#[test]
fn classified_once_without_length() {
    let data = constant(1.0, [1, 1, 1]);
    let table = || colors(&[(0.0, [0.0; 3], 0.0), (2.0, [1.0, 0.5, 0.2], 0.8)]);
    for shader in ["mip", "minip", "average"] {
        for unit in [0.1, 10.0] {
            for setup in [Setup::exact(), Setup::cpu().step(0.3)] {
                let found = setup.pixel(&shaded(shader, &VolumeTexture::new(&data), table(), unit), &along_y(0.5, 0.5));
                within(shader, max_error(&[found], &[[0.2, 0.1, 0.04, 0.4]]), 1e-6);
            }
        }
    }
}

#[test]
fn pictures_of_extremes_are_laid_over_in_the_order_of_drawing() {
    let data = VolumeTexture::new(&constant(1.0, [1, 1, 1]));
    let red = shaded("mip", &data, colors(&[(0.0, [1.0, 0.0, 0.0], 0.5)]), 1.0);
    let green = shaded("average", &data, colors(&[(0.0, [0.0, 1.0, 0.0], 0.25)]), 1.0);
    let blue = lut(data.volume(), colors(&[(0.0, [0.0, 0.0, 1.0], 0.5)]), 1.0);
    // Nearer or farther makes no difference to these, and `over` is always below.
    green.set_transform(DAffine3::from_translation(DVec3::Y * 7.0));
    let desc = along_y(0.5, 0.5);
    for setup in [Setup::exact(), Setup::rays(0.3), Setup::cpu().step(0.3)] {
        let drawn = |shapes: &[&Shape]| {
            let shapes: Vec<_> = shapes.iter().map(|s| (*s).clone()).collect();
            setup.colors(&shapes, &desc)[0]
        };
        let over = |below: [f64; 4], c: [f64; 3], a: f64| -> [f64; 4] {
            std::array::from_fn(|i| c.get(i).map_or(a, |c| c * a) + (1.0 - a) * below[i])
        };
        let base = [0.0, 0.0, 0.5, 0.5];
        let wanted = over(over(base, [1.0, 0.0, 0.0], 0.5), [0.0, 1.0, 0.0], 0.25);
        for order in [[&blue, &red, &green], [&red, &blue, &green], [&red, &green, &blue]] {
            within("red, then green", max_error(&[drawn(&order)], &[wanted]), 1e-6);
        }
        let wanted = over(over(base, [0.0, 1.0, 0.0], 0.25), [1.0, 0.0, 0.0], 0.5);
        within("green, then red", max_error(&[drawn(&[&green, &blue, &red])], &[wanted]), 1e-6);
    }
}

#[test]
fn overlap_adds_extinctions_and_mixes_colours_by_them() {
    let make = |color, a, unit| lut(&constant(1.0, [2, 2, 2]), colors(&[(0.0, color, a)]), unit);
    let (one, other) = (make([1.0, 0.2, 0.0], 0.3, 1.0), make([0.0, 0.6, 1.0], 0.5, 2.0));
    other.set_transform(DAffine3::from_translation(DVec3::new(0.0, 0.7, 0.0)));
    let (s1, s2) = (-(0.7f64).ln(), -(0.5f64).ln() / 2.0);
    let mut wanted = [0.0; 4];
    for (length, s1, s2) in [(0.7, s1, 0.0), (1.3, s1, s2), (0.7, 0.0, s2)] {
        let share = (1.0 - wanted[3]) * -(-(s1 + s2) * length).exp_m1();
        let c = [s1 / (s1 + s2), (0.2 * s1 + 0.6 * s2) / (s1 + s2), s2 / (s1 + s2)];
        wanted = [wanted[0] + share * c[0], wanted[1] + share * c[1], wanted[2] + share * c[2], wanted[3] + share];
    }
    let desc = along_y(0.5, 0.5);
    let shapes = [one.clone(), other.clone()];
    within("exact", max_error(&[truth(&shapes, &desc).color[0]], &[wanted]), 1e-9);
    for step in [0.23, 1.0, 5.0] {
        for setup in [Setup::rays(step), Setup::cpu().step(step)] {
            within(&format!("at {step}"), max_error(&setup.colors(&shapes, &desc), &[wanted]), 4e-6);
        }
    }
}

/// Equal weights where several are opaque.
#[test]
fn overlapping_opaque_shapes_share_the_colour() {
    let make = |color| lut(&constant(1.0, [1, 1, 1]), colors(&[(0.0, color, 1.0)]), 1.0);
    let shapes = [make([1.0, 0.0, 0.0]), make([0.0, 1.0, 0.0]), make([0.0, 0.0, 1.0])];
    let wanted = [[1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 1.0]];
    for setup in [Setup::exact(), Setup::rays(0.3), Setup::cpu().step(0.3)] {
        within("opaque", max_error(&setup.colors(&shapes, &along_y(0.5, 0.5)), &wanted), 1e-6);
    }
}

fn crowd() -> Vec<Shape> {
    let table = |c| colors(&[(0.0, c, 0.0), (60.0, c, 0.2), (61.0, c, 0.0), (200.0, [0.9; 3], 0.7)]);
    let shape = |c, to: DVec3| {
        let shape = lut(&ball([12, 11, 13], ScalarType::U8), table(c), 1.0);
        shape.set_transform(DAffine3::from_translation(to) * DAffine3::from_rotation_z(0.2 * to.x));
        shape
    };
    vec![
        shape([1.0, 0.2, 0.1], DVec3::ZERO),
        shape([0.1, 1.0, 0.2], DVec3::new(3.0, 1.0, -1.0)),
        shape([0.2, 0.1, 1.0], DVec3::new(-2.0, 4.0, 2.0)),
    ]
}

fn view() -> FrameDesc {
    square(DVec3::splat(6.0), DVec3::new(4.0, -9.0, 5.0), 18.0, 12)
}

#[test]
fn order_of_drawing_means_nothing_to_overlapping_shapes() {
    let shapes = crowd();
    for setup in [Setup::cpu().step(0.4), Setup::rays(0.4)] {
        let first = setup.draw(&shapes, &view());
        for [a, b, c] in [[1, 0, 2], [2, 1, 0], [1, 2, 0]] {
            let frame = setup.draw(&[shapes[a].clone(), shapes[b].clone(), shapes[c].clone()], &view());
            assert!(identical(&first, &frame), "{setup:?}");
        }
    }
    let (found, wanted) = (Setup::cpu().step(0.4).with("termination", 0.0), Setup::rays(0.4));
    within("cpu", max_error(&found.colors(&shapes, &view()), &wanted.colors(&shapes, &view())), 1e-6);
}

#[test]
fn three_coincident_blocks_are_one_of_three_times_the_extinction() {
    let data = constant(1.0, [3, 3, 3]);
    let desc = square(DVec3::splat(1.5), DVec3::new(2.0, -5.0, 3.0), 6.0, 8);
    for a in [1e-4, 0.2, 0.8] {
        let make = |a: f64| lut(&data, greys(&[(0.0, 0.6, a)]), 1.0);
        let three = [make(a), make(a), make(a)];
        let one = [make(1.0 - (1.0 - a).powi(3))];
        within("exact", max_error(&truth(&three, &desc).color, &truth(&one, &desc).color), 1e-8);
        let found = Setup::cpu().step(0.4).with("termination", 0.0).colors(&three, &desc);
        // 30 segments in f32 on one side, f64 on the other.
        within("cpu", max_error(&found, &Setup::post(0.4).colors(&one, &desc)), 5e-6);
    }
}

/// A shape that its user cuts in two agrees to second order at least: the cut segments have
/// midpoints of their own. One cut changes one segment, whose own error is of third order.
#[test]
fn shape_cut_in_two_agrees_to_second_order() {
    let texture = VolumeTexture::new(&cell());
    let table = greys(&[(0.0, 0.2, 0.1), (1.0, 0.9, 0.9)]);
    let look = || volact_conformance::scene::look("lut", table.clone(), 0.3).with("volume", texture.clone());
    let block = |x0: f64, x1: f64| {
        Shape::new(Block::new(DVec3::new(x0, 0.0, 0.0), DVec3::new(x1 - x0, 1.0, 1.0)).unwrap(), look())
    };
    let halves = [block(0.0, 0.37), block(0.37, 1.0)];
    let whole = [block(0.0, 1.0)];
    let desc = square(DVec3::splat(0.5), DVec3::new(9.0, -5.0, 3.0), 1.2, 12);
    within("exact", max_error(&truth(&halves, &desc).color, &truth(&whole, &desc).color), 2e-9);
    let errors = [0.3, 0.2, 0.14, 0.1, 0.07, 0.05].map(|h| {
        let setup = Setup::post(h);
        (h, rms_error(&setup.colors(&halves, &desc), &setup.colors(&whole, &desc)))
    });
    println!("{errors:?}");
    assert!(errors[0].1 > 1e-5, "the cut is seen at coarse steps: {errors:?}");
    between("order", order(&errors), [2.0, 3.3]);
}
