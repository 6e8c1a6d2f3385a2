//! Emission and absorption by a shader's source: closed forms, and the certified way of drawing
//! the same.

use proptest::prelude::*;
use volact_core::{
    Appearance, Camera, Compositing, FrameDesc, ParameterType, ScalarType, Shape, Volume, VolumeDesc, VolumeTexture,
    glam::{DAffine3, DVec3},
};
use volact_cpu::reference::{Method, ReferenceOptions};

use super::{
    common::{along_z, lut, one_ray, point, table, volume_of},
    source_common::{alike, block, draw, evaluated, is, lattice, registry, shader},
};

const TO: ParameterType = ParameterType::Float;

fn cube() -> [DVec3; 2] {
    [DVec3::ZERO, DVec3::ONE]
}

fn in_cube(look: Appearance) -> Shape {
    let [min, max] = cube();
    block(min, max, look)
}

#[test]
fn constant_medium_with_a_colour_of_depth() {
    // C = ∫ σ e^{−σs} (d₀ + s) ds with d₀ = 3, the depth at the entry.
    let text = "fn shade(s: Sample) -> Medium { return Medium(vec3(s.depth, 1.0, s.position.z + 0.5), density()); }";
    let all = registry(&[shader("fog", Compositing::Over, &[("density", TO)], text)]);
    for sigma in [1e-9f64, 0.3, 2.0, 50.0, 1e6] {
        let made =
            draw(&all, &[in_cube(Appearance::new("fog").with("density", sigma))], &along_z(0.3, 0.4), &evaluated());
        let alpha = -(-sigma).exp_m1();
        let mean = if sigma < 1e-6 { 0.5 * sigma } else { (1.0 - (1.0 + sigma) * (-sigma).exp()) / sigma };
        is(&made, [3.0 * alpha + mean, alpha, mean, alpha], 1e-10);
        assert_eq!(made.estimated.len(), 1);
    }
}

#[test]
fn opaque_medium_shows_its_entry() {
    let text =
        "fn shade(s: Sample) -> Medium { return Medium(vec3(s.depth, s.position.xy + 0.5), 1.0 / 0.0 * density()); }";
    let text = text
        .replace("1.0 / 0.0 * density()", "1e38 * 1e38 * density()")
        .replace("1e38 * 1e38", "bitcast<f32>(0x7f800000u)");
    let all = registry(&[shader("wall", Compositing::Over, &[("density", TO)], &text)]);
    let made = draw(&all, &[in_cube(Appearance::new("wall").with("density", 1.0))], &along_z(0.25, 0.5), &evaluated());
    is(&made, [3.0, 0.25, 0.5, 1.0], 1e-12);
    assert!((made.depth[0] - 3.0).abs() < 1e-12);
}

#[test]
fn linear_extinction_has_its_closed_form() {
    // σ = 4z, c = 1 − z/2: C = 1 − ½e^{−2} − ½ ∫₀¹ e^{−2z²} dz.
    let text = "fn shade(s: Sample) -> Medium { let z = s.position.z + 0.5; return Medium(vec3(1.0 - 0.5 * z, 1.0, 0.0), rise() * z); }";
    let all = registry(&[shader("rise", Compositing::Over, &[("rise", TO)], text)]);
    let made = draw(&all, &[in_cube(Appearance::new("rise").with("rise", 4.0))], &along_z(0.3, 0.4), &evaluated());
    let (left, integral) = ((-2.0f64).exp(), 0.598_144_006_661_304_5);
    is(&made, [1.0 - 0.5 * left - 0.5 * integral, 1.0 - left, 0.0, 1.0 - left], 1e-11);
    let half = 0.5 * (2.0 * std::f64::consts::LN_2).sqrt();
    assert!((made.depth[0] - 3.0 - half).abs() < 1e-9, "{}", made.depth[0]);
}

#[test]
fn a_step_within_a_stretch_is_found() {
    // Nothing, then at 0.3141 red of σ = 2, then at 0.7 opaque blue.
    let text = "fn shade(s: Sample) -> Medium {
        let z = s.position.z + 0.5;
        if z < at() { return Medium(vec3(0.0), 0.0); }
        if z > 0.7 { return medium(vec3(0.0, 0.0, 1.0), 1.0); }
        return Medium(vec3(1.0, 0.0, 0.0), 2.0);
    }";
    let all = registry(&[shader("step", Compositing::Over, &[("at", TO), ("unit_distance", TO)], text)]);
    let look = Appearance::new("step").with("at", 0.3141).with("unit_distance", 1.0);
    let made = draw(&all, &[in_cube(look)], &along_z(0.3, 0.4), &evaluated());
    // Numbers in a source are f32.
    let alpha = -(-2.0 * (f64::from(0.7f32) - 0.3141)).exp_m1();
    is(&made, [alpha, 0.0, 1.0 - alpha, 1.0], 1e-10);
}

/// A peak that touches 1 has a finite integral: ∫₀¹ −ln|1 − 2z| dz = 1.
#[test]
fn a_peak_that_touches_one_has_its_finite_integral() {
    let text = "fn shade(s: Sample) -> Medium { return medium(vec3(1.0), 1.0 - abs(2.0 * s.position.z + off())); }";
    let all = registry(&[shader("peak", Compositing::Over, &[("off", TO), ("unit_distance", TO)], text)]);
    let look = Appearance::new("peak").with("off", 0.0).with("unit_distance", 0.5);
    let made = draw(&all, &[in_cube(look)], &along_z(0.3, 0.4), &evaluated());
    let alpha = -(-2.0f64).exp_m1();
    alike(&made.color, &[[alpha; 4]], 1e-8);
}

#[test]
fn nothing_is_drawn_where_a_number_is_none() {
    let text = "fn shade(s: Sample) -> Medium {
        return Medium(vec3(1.0), select(2.0, bitcast<f32>(0x7fc00000u), s.position.z > off()));
    }";
    let all = registry(&[shader("half", Compositing::Over, &[("off", TO)], text)]);
    let made = draw(&all, &[in_cube(Appearance::new("half").with("off", 0.0))], &along_z(0.3, 0.4), &evaluated());
    is(&made, [-(-1.0f64).exp_m1(); 4], 1e-10);
    // A volume with a NaN sample: cells that it belongs to are transparent, as in the certified way.
    let data = volume_of([3, 3, 7], |[x, y, z]| if [x, y, z] == [1, 1, 3] { f64::NAN } else { (x + y + z) as f64 });
    let shape = lut(&data, table(&[point(0.0, [0.2; 3], 0.1), point(9.0, [1.0; 3], 0.8)]), 1.0);
    let all = registry(&[]);
    let frame = one_ray(DVec3::new(0.4, 0.3, -2.0), DVec3::new(1.6, 1.7, 5.0));
    let found = draw(&all, std::slice::from_ref(&shape), &frame, &evaluated());
    let wanted = draw(&all, &[shape], &frame, &Default::default());
    assert!(wanted.not_certified == 0 && wanted.estimated.is_empty());
    alike(&found.color, &wanted.color, 1e-9);
}

fn views() -> [FrameDesc; 2] {
    let (eye, target) = (DVec3::new(7.0, -6.0, 9.0), DVec3::new(1.5, 1.5, 2.0));
    [
        FrameDesc::new(Camera::perspective(eye, target, DVec3::Z, 30.0), 5, 5),
        FrameDesc::new(Camera::orthographic(eye, target, DVec3::Z, 5.0), 5, 5),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// The source of `lut` against the certified integral of the same.
    #[test]
    fn lut_by_its_source_is_lut(
        seed in prop::array::uniform16(-1.0..1.0f64),
        opacity in prop::array::uniform4(0.0..1.0f64),
        color in prop::array::uniform4(0.0..1.0f64),
        at in prop::array::uniform2(-0.6..0.6f64),
        unit in 0.3..3.0f64,
        tilt in -0.5..0.5f64,
    ) {
        let data = volume_of([4, 4, 5], |[x, y, z]| seed[(x * 7 + y * 5 + z * 3 + x * y * z) % 16]);
        let (low, high) = (at[0].min(at[1]), at[0].max(at[1]));
        let points: Vec<_> = [-1.0, low, high, 1.0].iter().zip(opacity).zip(color)
            .map(|((v, a), c)| point(*v, [c, 1.0 - c, 0.5], a)).collect();
        let shape = lut(&data, table(&points), unit);
        shape.set_transform(DAffine3::from_rotation_z(tilt) * DAffine3::from_scale(DVec3::new(1.0, 0.8, -1.2)));
        shape.set_transform(DAffine3::from_translation(DVec3::new(0.0, 0.0, 4.0)) * shape.state().transform);
        let all = registry(&[]);
        for frame in views() {
            let wanted = draw(&all, std::slice::from_ref(&shape), &frame, &Default::default());
            let found = draw(&all, std::slice::from_ref(&shape), &frame, &evaluated());
            prop_assert_eq!(wanted.not_certified, 0);
            alike(&found.color, &wanted.color, 2e-9);
            for (a, b) in found.depth.iter().zip(&wanted.depth) {
                prop_assert!(a == b || (a - b).abs() < 1e-6, "{} {}", a, b);
            }
            // On a lattice there is no doubt but rounding.
            for method in [Method::Rays, Method::Planes] {
                let options = ReferenceOptions { method, ..lattice(0.3) };
                let native = ReferenceOptions { recognise: true, ..options };
                let [found, wanted] = [options, native].map(|o| draw(&all, std::slice::from_ref(&shape), &frame, &o));
                alike(&found.color, &wanted.color, 1e-12);
            }
        }
    }
}

/// The same far away: local space keeps the digits.
#[test]
fn a_distant_scene_keeps_its_digits() {
    let data = volume_of([4, 4, 5], |[x, y, z]| ((x * 7 + y * 5 + z * 3) as f64 * 0.7).sin());
    let points = [point(-1.0, [0.1, 0.2, 0.9], 0.0), point(0.2, [0.9, 0.2, 0.1], 0.6), point(1.0, [1.0; 3], 0.1)];
    let all = registry(&[]);
    for offset in [0.0, 1e7] {
        let offset = DVec3::new(offset, -3.0 * offset, 2.0 * offset);
        let shape = lut(&data, table(&points), 0.7);
        shape.set_transform(DAffine3::from_translation(offset));
        let frame = one_ray(offset + DVec3::new(0.25, 0.5, -2.0), offset + DVec3::new(1.5, 2.25, 3.0));
        let [found, wanted] =
            [evaluated(), Default::default()].map(|o| draw(&all, std::slice::from_ref(&shape), &frame, &o));
        alike(&found.color, &wanted.color, 1e-9);
    }
}

#[test]
fn nearest_samples_are_cut_between_them() {
    let data = volume_of([4, 4, 5], |[x, y, z]| ((x * 7 + y * 5 + z * 3) as f64 * 0.7).sin());
    let points = [point(-1.0, [0.1, 0.2, 0.9], 0.0), point(0.2, [0.9, 0.2, 0.1], 0.6), point(1.0, [1.0; 3], 0.1)];
    let texture = VolumeTexture::new(&data).with_filter(volact_core::Filter::Nearest);
    let shape = super::common::lut_of(&texture, table(&points), 0.7);
    let all = registry(&[]);
    for frame in views() {
        let [found, wanted] =
            [evaluated(), Default::default()].map(|o| draw(&all, std::slice::from_ref(&shape), &frame, &o));
        alike(&found.color, &wanted.color, 1e-9);
    }
}

/// Components by meaning are clamped, which bends them.
#[test]
fn simple_by_its_source_is_simple() {
    let all = registry(&[]);
    for components in 1..=4 {
        let number = |i: usize| ((i * 7 + i / 3) as f64 * 0.9).sin();
        let desc = VolumeDesc::new([3, 4, 4], ScalarType::F64, components);
        let data = Volume::new(desc, (0..48 * components).map(number).collect::<Vec<_>>()).unwrap();
        let texture = VolumeTexture::new(&data).with_range([-0.5, 0.7]).unwrap();
        let shape = Shape::around_texture(&texture, Appearance::new("simple").with("unit_distance", 2.0));
        for frame in views() {
            let [found, wanted] =
                [evaluated(), Default::default()].map(|o| draw(&all, std::slice::from_ref(&shape), &frame, &o));
            alike(&found.color, &wanted.color, 2e-9);
            assert!(wanted.color.iter().any(|c| c[3] > 0.1));
        }
    }
}

/// The lattice and the quadrature have nothing in common but the samples: one goes to the other by
/// the square of the step.
#[test]
fn lattices_of_lit_sources_go_to_the_integral() {
    let data = volume_of([6, 6, 6], |[x, y, z]| {
        (0.5 * x as f64 + 0.3).sin() * (0.4 * y as f64).cos() + 0.4 * (0.6 * z as f64).sin()
    });
    let all = registry(&[]);
    for name in ["gradient", "tangent_space"] {
        let look = Appearance::new(name)
            .with("lookup_table", table(&[point(-1.0, [0.1, 0.4, 0.9], 0.05), point(1.5, [0.9, 0.5, 0.1], 0.6)]))
            .with("unit_distance", 1.0);
        let shape = Shape::around(&data, look);
        // Inside of where gradients end at the data's edge.
        shape.set_geometry(volact_core::Block::new(DVec3::splat(1.0), DVec3::splat(3.0)).unwrap());
        let frame =
            FrameDesc::new(Camera::perspective(DVec3::new(9.0, -7.0, 10.0), DVec3::splat(2.5), DVec3::Z, 12.0), 5, 5);
        let exact = draw(&all, std::slice::from_ref(&shape), &frame, &evaluated());
        assert_eq!(exact.not_certified, 0);
        let error = |step: f64| {
            let made = draw(&all, std::slice::from_ref(&shape), &frame, &lattice(step));
            let wrong = made.color.iter().flatten().zip(exact.color.iter().flatten()).map(|(a, b)| (a - b).powi(2));
            wrong.sum::<f64>().sqrt()
        };
        let (coarse, fine) = (error(0.2), error(0.0125));
        let order = (coarse / fine).log2() / 4.0;
        assert!((1.8..2.3).contains(&order) && fine < 1e-3, "{name}: {order}, {fine:e}");
        // A looser tolerance is honoured, too.
        let loose =
            draw(&all, std::slice::from_ref(&shape), &frame, &ReferenceOptions { tolerance: 1e-5, ..evaluated() });
        alike(&loose.color, &exact.color, 1e-5);
        assert!(loose.samples < exact.samples);
    }
}

/// Bounded where nothing converges: an estimate that says so, and no end that never comes.
#[test]
fn noise_ends_with_a_wide_estimate() {
    let text = "fn shade(s: Sample) -> Medium {
        let k = bitcast<u32>(s.position.z) * 2654435769u;
        return Medium(vec3(1.0), density() * f32(k >> 8u) / 16777216.0);
    }";
    let all = registry(&[shader("noise", Compositing::Over, &[("density", TO)], text)]);
    let made = draw(&all, &[in_cube(Appearance::new("noise").with("density", 4.0))], &along_z(0.3, 0.4), &evaluated());
    let alpha = -(-2.0f64).exp_m1();
    assert!((made.color[0][3] - alpha).abs() < 0.02, "{:?}", made.color[0]);
    assert!(made.not_certified == 1 && made.samples < 1_000_000, "{} {}", made.widest, made.samples);
}

/// What is narrow in a table is narrow on the ray: a peak of a millionth of the range is found.
#[test]
fn narrow_peaks_of_tables_are_not_overlooked() {
    let data = volume_of([4, 4, 5], |[x, y, z]| ((x * 7 + y * 5 + z * 3) as f64 * 0.7).sin());
    let all = registry(&[]);
    for width in [1e-2, 1e-4, 1e-6] {
        let red = [1.0, 0.2, 0.1];
        let points = [point(0.3 - width, red, 0.0), point(0.3, red, 0.9), point(0.3 + width, [0.0, 1.0, 0.0], 0.0)];
        let shape = lut(&data, table(&points), 0.5 * width);
        for frame in views() {
            let [found, wanted] =
                [evaluated(), Default::default()].map(|o| draw(&all, std::slice::from_ref(&shape), &frame, &o));
            assert!(wanted.color.iter().any(|c| c[3] > 0.1));
            alike(&found.color, &wanted.color, 1e-7);
        }
    }
}
