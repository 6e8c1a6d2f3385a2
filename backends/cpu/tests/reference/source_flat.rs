//! Maximum, minimum, mean, integral and surfaces by a shader's source.

use proptest::prelude::*;
use volact_core::{
    Appearance, Camera, Compositing, FrameDesc, ParameterType, Shape, Volume,
    glam::{DAffine3, DVec3},
};
use volact_cpu::reference::{Method, ReferenceOptions};

use super::{
    common::{along_z, lut, one_ray, point, table, volume_of},
    source_common::{alike, block, draw, evaluated, is, lattice, registry, shader},
};

const SHADERS: [&str; 4] = ["mip", "minip", "average", "xray"];

fn shape(data: &Volume, shader: &str, unit: f64) -> Shape {
    let look = Appearance::new(shader).with(
        "lookup_table",
        table(&[point(-2.0, [0.0, 1.0, 0.3], 0.2), point(0.1, [0.4; 3], 0.9), point(3.0, [1.0; 3], 0.5)]),
    );
    Shape::around(data, if shader == "xray" { look.with("unit_distance", unit) } else { look })
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

    #[test]
    fn reductions_by_their_sources_are_the_certified_ones(seed in prop::array::uniform16(-1.0..1.0f64), unit in 0.5..4.0f64) {
        let data = volume_of([4, 4, 5], |[x, y, z]| seed[(x * 7 + y * 5 + z * 3 + x * y * z) % 16]);
        let all = registry(&[]);
        for (name, frame) in SHADERS.iter().flat_map(|name| views().map(|f| (name, f))) {
            let shapes = [shape(&data, name, unit)];
            shapes[0].set_transform(DAffine3::from_rotation_x(0.3));
            let [found, wanted] = [evaluated(), ReferenceOptions::default()].map(|o| draw(&all, &shapes, &frame, &o));
            prop_assert!(wanted.not_certified == 0 && wanted.estimated.is_empty() && found.estimated.len() == 1);
            alike(&found.color, &wanted.color, 1e-9);
            for pre in [false, true] {
                let classification = if pre {
                    volact_cpu::reference::Classification::PreIntegrated
                } else {
                    volact_cpu::reference::Classification::Post
                };
                let options = ReferenceOptions { classification, ..lattice(0.3) };
                let native = ReferenceOptions { recognise: true, ..options };
                let [found, wanted] = [options, native].map(|o| draw(&all, &shapes, &frame, &o));
                alike(&found.color, &wanted.color, 1e-12);
            }
        }
    }
}

#[test]
fn values_that_are_none_do_not_count() {
    let data = volume_of([3, 3, 7], |[x, y, z]| if [x, y, z] == [1, 1, 3] { f64::NAN } else { (x + y + z) as f64 });
    let all = registry(&[]);
    let frame = one_ray(DVec3::new(0.4, 0.3, -2.0), DVec3::new(1.6, 1.7, 5.0));
    for name in SHADERS {
        let shapes = [shape(&data, name, 2.0)];
        let [found, wanted] = [evaluated(), ReferenceOptions::default()].map(|o| draw(&all, &shapes, &frame, &o));
        alike(&found.color, &wanted.color, 1e-9);
    }
    let nothing = [shape(&volume_of([2; 3], |_| f64::NAN), "mip", 1.0)];
    assert_eq!(draw(&all, &nothing, &along_z(0.4, 0.4), &evaluated()).color[0], [0.0; 4]);
}

/// What no table does: the mean of exp(−z) on 0 to 1, the integral with the source's own unit, the
/// highest sin.
#[test]
fn values_by_formula_have_their_closed_forms() {
    let unit = [("unit_distance", ParameterType::Float)];
    let show = "fn shade(s: Sample) -> Medium { return Medium(vec3(s.value, 1.0, s.depth), 0.5); }";
    let fall = format!("fn value(s: Sample) -> f32 {{ return exp(-(s.position.z + 0.5)); }} {show}");
    let wave = format!("fn value(s: Sample) -> f32 {{ return sin(5.0 * (s.position.z + 0.5)); }} {show}");
    let all = registry(&[
        shader("mean", Compositing::Average, &unit, &fall),
        shader("sum", Compositing::Add, &unit, &fall),
        shader("high", Compositing::Maximum, &unit, &wave),
        shader("low", Compositing::Minimum, &unit, &wave),
    ]);
    let integral = 1.0 - (-1.0f64).exp();
    for (name, value) in [("mean", integral), ("sum", integral / 0.25), ("high", 1.0), ("low", -1.0)] {
        let look = Appearance::new(name).with("unit_distance", 0.25);
        let made = draw(&all, &[block(DVec3::ZERO, DVec3::ONE, look)], &along_z(0.3, 0.4), &evaluated());
        // The last is the depth at which the ray enters.
        is(&made, [0.5 * value, 0.5, 1.5, 0.5], 1e-9);
        assert_eq!(made.depth[0], f64::INFINITY);
    }
}

#[test]
fn pictures_are_laid_over_in_the_order_of_drawing_whatever_draws_them() {
    let data = volume_of([2; 3], |_| 6.0);
    let flat = |name: &str, color| {
        Shape::around(&data, Appearance::new(name).with("lookup_table", table(&[point(0.0, color, 0.5)])))
    };
    let show = "fn value(s: Sample) -> f32 { return volume(s.position) * 2.0; } \
                fn shade(s: Sample) -> Medium { return lookup_table(s.value); }";
    let types = [("volume", ParameterType::Volume), ("lookup_table", ParameterType::Table)];
    let all = registry(&[shader("own", Compositing::Maximum, &types, show)]);
    let body = lut(&data, table(&[point(0.0, [0.0, 0.0, 1.0], 0.5)]), 1.0);
    let (red, green) = (flat("own", [1.0, 0.0, 0.0]), flat("mip", [0.0, 1.0, 0.0]));
    let ray = along_z(0.4, 0.6);
    let draw = |shapes: &[Shape]| draw(&all, shapes, &ray, &ReferenceOptions::default());
    is(&draw(&[red.clone(), body.clone(), green.clone()]), [0.25, 0.5, 0.125, 0.875], 1e-12);
    is(&draw(&[green, red, body]), [0.5, 0.25, 0.125, 0.875], 1e-12);
}

fn surfaces(data: &Volume, points: &[(f64, [f64; 3], f64)]) -> Shape {
    let points: Vec<_> = points.iter().map(|(v, c, a)| point(*v, *c, *a)).collect();
    let look = Appearance::new("isosurface").with("surfaces", table(&points));
    Shape::around(data, look.with("ambient", 0.25).with("diffuse", 0.5).with("specular", 0.0))
}

/// Surfaces of a linear field are planes: their place, order, opacity and light are known.
#[test]
fn surfaces_of_a_linear_field_are_planes() {
    let data = volume_of([5, 5, 9], |[x, _, z]| z as f64 + 0.5 * x as f64);
    let shape = surfaces(&data, &[(2.25, [1.0, 0.0, 0.0], 0.5), (5.5, [0.0, 1.0, 0.0], 0.25), (40.0, [1.0; 3], 1.0)]);
    let all = registry(&[]);
    let frame = one_ray(DVec3::new(1.0, 1.5, -2.0), DVec3::new(2.0, 1.5, 6.0));
    let way = DVec3::new(1.0, 0.0, 8.0).normalize();
    let cosine = way.dot(DVec3::new(0.5, 0.0, 1.0).normalize()).abs();
    let lit = 0.25 + 0.5 * cosine;
    let truth = [0.5 * lit, 0.5 * 0.25 * lit, 0.0, 1.0 - 0.5 * 0.75];
    let steps =
        [evaluated(), lattice(0.37), lattice(0.01), ReferenceOptions { method: Method::Planes, ..lattice(0.2) }];
    for options in steps {
        // The lit colour comes from numbers of the source that are f32.
        is(&draw(&all, std::slice::from_ref(&shape), &frame, &options), truth, 1e-9);
    }
    // z + x/2 = v where −2 + 8t + (1 + t)/2 = v in units of the two points' distance.
    let t = (2.25 + 1.5) / 8.5 * way.z.recip() * 8.0;
    let made = draw(&all, &[surfaces(&data, &[(2.25, [1.0; 3], 0.75)])], &frame, &evaluated());
    assert!((made.depth[0] - t).abs() < 1e-12, "{} {t}", made.depth[0]);
}

/// A squared distance by formula: a sphere is met twice, and one that is touched not at all.
#[test]
fn spheres_are_met_where_they_are() {
    let text = "fn value(s: Sample) -> f32 { return dot(s.position, s.position); }
        fn shade(s: Sample) -> Medium { return Medium(vec3(s.depth, s.position.z, s.value), surfaces_color(s.value).a); }";
    let all = registry(&[shader("sphere", Compositing::First, &[("surfaces", ParameterType::Table)], text)]);
    let look =
        |radius: f64, a: f64| Appearance::new("sphere").with("surfaces", table(&[point(radius * radius, [1.0; 3], a)]));
    let ball = |radius, a| block(DVec3::splat(-1.0), DVec3::splat(1.0), look(radius, a));
    for (x, y) in [(0.0, 0.0), (0.3, 0.4), (0.0, 0.7999), (0.0, 0.799_999_999)] {
        let half = (0.64f64 - x * x - y * y).sqrt();
        let made = draw(&all, &[ball(0.8, 0.5)], &along_z(x, y), &evaluated());
        let (near, far) = (3.0 - half, 3.0 + half);
        let truth = [0.5 * near + 0.25 * far, -0.5 * half + 0.25 * half, 0.64 * 0.75, 0.75];
        is(&made, truth, if half > 0.01 { 1e-11 } else { 1e-6 });
        assert!((made.depth[0] - near).abs() < 1e-6);
        let made = draw(&all, &[ball(0.8, 1.0)], &along_z(x, y), &evaluated());
        is(&made, [near, -half, 0.64, 1.0], if half > 0.01 { 1e-11 } else { 1e-6 });
    }
    let missed = draw(&all, &[ball(0.8, 1.0)], &along_z(0.0, 0.800_001), &evaluated());
    assert_eq!((missed.color[0], missed.depth[0]), ([0.0; 4], f64::INFINITY));
}

/// Surfaces are merged with media in depth: half of the medium lies before the plane.
#[test]
fn surfaces_are_merged_with_media_in_depth() {
    let ramp = volume_of([2, 2, 5], |[_, _, z]| z as f64);
    let fog = lut(&volume_of([2, 2, 5], |_| 0.0), table(&[point(0.0, [0.0, 0.0, 1.0], 0.5)]), 2.0);
    let all = registry(&[]);
    let plane = surfaces(&ramp, &[(1.5, [1.0, 0.0, 0.0], 0.5)]);
    let lit = 0.75;
    let left = |length: f64| 0.5f64.powf(length / 2.0);
    let fog_before = 1.0 - left(1.5);
    let fog_behind = 0.5 * left(1.5) * (1.0 - left(2.5));
    let alpha = 1.0 - 0.5 * left(4.0);
    let truth = [left(1.5) * 0.5 * lit, 0.0, fog_before + fog_behind, alpha];
    for shapes in [[fog.clone(), plane.clone()], [plane, fog]] {
        is(&draw(&all, &shapes, &along_z(0.3, 0.4), &evaluated()), truth, 1e-9);
        is(
            &draw(&all, &shapes, &along_z(0.3, 0.4), &ReferenceOptions { recognise: true, ..lattice(0.3) }),
            truth,
            1e-9,
        );
    }
}

/// Values that step where the nearest sample changes cross what lies between.
#[test]
fn a_step_over_a_value_is_a_crossing() {
    let data = volume_of([2, 2, 4], |[_, _, z]| z as f64 * 10.0);
    let texture = volact_core::VolumeTexture::new(&data).with_filter(volact_core::Filter::Nearest);
    let look = Appearance::new("isosurface").with("surfaces", table(&[point(15.0, [1.0; 3], 1.0)]));
    let shape = Shape::around_texture(&texture, look);
    let made = draw(&registry(&[]), &[shape], &along_z(0.3, 0.4), &evaluated());
    assert!(made.color[0][3] > 1.0 - 1e-12 && (made.depth[0] - 4.5).abs() < 1e-9, "{}", made.depth[0]);
}
