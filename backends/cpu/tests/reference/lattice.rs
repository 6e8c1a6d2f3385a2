//! Lattices in f64: their slopes towards the certified integral.

use volact_core::{Camera, FrameDesc, Shape, glam::DVec3};
use volact_cpu::reference::{Classification, Method, ReferenceOptions, integrate};

use super::common::{along_z, lut, one_ray, picture, point, resolve, table, volume_of};

fn smooth() -> Shape {
    let data = volume_of([5, 5, 9], |[x, y, z]| {
        0.5 + 0.2 * (0.9 * x as f64 + 0.3).sin() * (0.7 * y as f64).cos() + 0.25 * (0.8 * z as f64).sin()
    });
    lut(&data, table(&[point(0.0, [0.1, 0.4, 0.9], 0.02), point(1.0, [0.9, 0.5, 0.1], 0.7)]), 1.0)
}

fn on_lattice(shapes: &[Shape], frame: &FrameDesc, method: Method, step: f64, pre: bool) -> Vec<[f64; 4]> {
    let classification = if pre { Classification::PreIntegrated } else { Classification::Post };
    let options = ReferenceOptions { method, classification, sample_distance: step, ..ReferenceOptions::default() };
    integrate(&resolve(shapes), frame, &options).unwrap().color
}

/// Slope of the mean error from one step to a sixteenth of it.
fn slope(shapes: &[Shape], frame: &FrameDesc, method: Method, pre: bool) -> f64 {
    let exact = picture(shapes, frame);
    assert_eq!(exact.not_certified, 0);
    let error = |step: f64| {
        let made = on_lattice(shapes, frame, method, step, pre);
        let wrong = made.iter().flatten().zip(exact.color.iter().flatten()).map(|(a, b)| (a - b).powi(2));
        (wrong.sum::<f64>() / made.len() as f64).sqrt()
    };
    (error(0.2) / error(0.0125)).log2() / 4.0
}

fn views() -> [FrameDesc; 2] {
    let (eye, target) = (DVec3::new(9.0, -8.0, 12.0), DVec3::new(2.0, 2.0, 4.0));
    [
        FrameDesc::new(Camera::perspective(eye, target, DVec3::Z, 35.0), 8, 8),
        FrameDesc::new(Camera::orthographic(eye, target, DVec3::Z, 6.0), 8, 8),
    ]
}

#[test]
fn midpoint_and_pre_integration_are_of_second_order() {
    for frame in views() {
        for method in [Method::Rays, Method::Planes] {
            for pre in [false, true] {
                let order = slope(&[smooth()], &frame, method, pre);
                assert!((1.85..2.2).contains(&order), "{method:?}, pre-integrated {pre}: {order}");
            }
        }
    }
}

#[test]
fn overlapped_shapes_are_of_second_order() {
    let other = smooth();
    other.set_transform(volact_core::glam::DAffine3::from_translation(DVec3::new(0.6, 0.3, -0.8)));
    let order = slope(&[smooth(), other], &views()[0], Method::Rays, false);
    assert!((1.8..2.3).contains(&order), "{order}");
}

/// A linear value is what pre-integration supposes: exact at any step.
#[test]
fn pre_integration_is_exact_where_the_value_is_linear() {
    let data = volume_of([2, 2, 5], |[_, _, z]| z as f64 / 4.0);
    let spikes = table(&[
        point(0.2, [0.2; 3], 0.0),
        point(0.21, [0.9; 3], 0.9),
        point(0.22, [0.1; 3], 0.0),
        point(0.7, [0.5; 3], 0.0),
        point(0.9, [0.3; 3], 1.0),
        point(1.0, [0.3; 3], 0.5),
    ]);
    let shapes = [lut(&data, spikes, 1.0)];
    let frame = along_z(0.3, 0.4);
    let exact = picture(&shapes, &frame).color[0];
    for step in [0.05, 0.7, 3.0, 50.0] {
        let made = on_lattice(&shapes, &frame, Method::Rays, step, true)[0];
        (0..4).for_each(|c| assert!((made[c] - exact[c]).abs() < 1e-10, "{step}: {made:?} {exact:?}"));
    }
}

/// One segment holds the whole block: its middle, its length, the exact exponential.
#[test]
fn cut_segments_count_their_length_and_have_their_own_middle() {
    let data = volume_of([2, 2, 2], |[_, _, z]| z as f64);
    let shape = lut(&data, table(&[point(0.0, [0.0; 3], 0.0), point(1.0, [1.0; 3], 1.0)]), 2.0);
    let made = on_lattice(&[shape], &along_z(0.3, 0.4), Method::Rays, 100.0, false)[0];
    let absorbed = 1.0 - 0.5f64.powf(0.5);
    let truth = [0.5 * absorbed, 0.5 * absorbed, 0.5 * absorbed, absorbed];
    (0..4).for_each(|c| assert!((made[c] - truth[c]).abs() < 1e-14));
}

/// Orthographic rays meet planes at right angles; a perspective's middle ray, too.
#[test]
fn planes_and_rays_are_one_where_rays_follow_the_axis() {
    let ray = one_ray(DVec3::new(9.0, -8.0, 12.0), DVec3::new(2.0, 2.0, 4.0));
    for frame in [views()[1].clone(), ray] {
        let [a, b] = [Method::Rays, Method::Planes].map(|m| on_lattice(&[smooth()], &frame, m, 0.3, false));
        for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
            assert!((a - b).abs() < 1e-12);
        }
    }
    let [a, b] = [Method::Rays, Method::Planes].map(|m| on_lattice(&[smooth()], &views()[0], m, 0.3, false));
    assert_ne!(a, b);
}
