//! Shaders by their source: WGSL evaluated over batches of samples.

use std::{error::Error, sync::Arc};

use volact_conformance::{
    metrics::{Picture, identical, max_error, wide, within},
    rig::{Setup, draw, registry},
    scene::{along_y, ball, colors, constant, greys, lut, placed, square},
};
use volact_core::{
    Appearance, Block, Compositing, Declaration, Frame, FrameDesc, ParameterDecl, ParameterType, ParameterValue,
    Registry, ScalarType, ShaderEntry, ShaderText, Shape, SliceStyle, Volume, VolumeDesc, VolumeTexture,
    glam::{DAffine3, DMat3, DVec3},
    parameter::Kind,
};

/// A registry that knows shaders of these names, parameters and texts, too.
fn with(shaders: &[(&str, Vec<ParameterDecl>, &str)]) -> Registry {
    with_compositing(shaders, Compositing::Over)
}

fn with_compositing(shaders: &[(&str, Vec<ParameterDecl>, &str)], compositing: Compositing) -> Registry {
    let mut all = registry();
    for (name, parameters, text) in shaders {
        let declaration =
            Declaration { parameters: parameters.clone(), ..Declaration::new(Kind::Shader, name, "0", "a test") };
        let source = Some(Arc::new(ShaderText { file: format!("{name}.wgsl"), text: (*text).into() }));
        all.add_shader(ShaderEntry { declaration, compositing, source }).unwrap();
    }
    all
}

fn needs(name: &str, kind: ParameterType) -> ParameterDecl {
    ParameterDecl::new(name, kind, "a parameter").required()
}

fn classified() -> Vec<ParameterDecl> {
    vec![
        needs("volume", ParameterType::Volume),
        needs("lookup_table", ParameterType::Table),
        needs("unit_distance", ParameterType::Float),
    ]
}

const OWN: &str = "fn shade(s: Sample) -> Medium { return lookup_table(volume(s.position)); }";

fn own() -> Registry {
    with(&[("own", classified(), OWN)])
}

fn picture(registry: &Registry, setup: &Setup, shapes: &[Shape], desc: &FrameDesc) -> Frame {
    draw(&mut *setup.action_in(registry), shapes, desc).unwrap_or_else(|e| panic!("{}", told(&e)))
}

/// An error with its causes.
fn told(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}

fn warm() -> volact_core::LookupTable {
    colors(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (99.0, [0.2; 3], 0.8), (200.0, [1.0; 3], 1.0)])
}

fn view() -> FrameDesc {
    square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 24)
}

/// The same shape through the source.
fn by_source(shape: &Shape, shader: &str) -> Shape {
    let other = shape.named("by source");
    other.set_shader(shader);
    other
}

#[test]
fn the_source_of_lut_draws_what_lut_draws() {
    let place = [
        DAffine3::IDENTITY,
        DAffine3::from_scale(DVec3::new(1.0, -0.5, 1.3)) * DAffine3::from_rotation_z(0.4),
        DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::new(0.3, 1.0, 0.2), DVec3::Z)),
    ];
    for scalar in [ScalarType::U8, ScalarType::I16, ScalarType::F32, ScalarType::F64] {
        for transform in place {
            for offset in [0.0, 1e6] {
                let shape = lut(&ball([9, 8, 10], scalar), warm(), 1.0);
                let shift = DAffine3::from_translation(DVec3::splat(offset));
                shape.set_transform(shift * transform);
                let mut desc = view();
                let eye = DVec3::new(4.0, -9.0, 5.0);
                let target = transform.transform_point3(DVec3::splat(4.0)) + offset;
                desc.camera = volact_core::Camera::perspective(target + eye, target, DVec3::Z, 60.0);
                let wanted = Setup::post(0.1).draw(std::slice::from_ref(&shape), &desc);
                let found = picture(&own(), &Setup::post(0.1), &[by_source(&shape, "own")], &desc);
                assert!(found.color.iter().any(|c| c[3] > 0.5));
                within(&format!("{scalar} at {offset}"), max_error(&wide(&found), &wide(&wanted)), 4e-5);
            }
        }
    }
}

#[test]
fn constant_media_absorb_by_their_length_and_reach_depths() {
    // Extinction ln 2 over a block of 3: half is left after each 1.
    let text = "fn shade(s: Sample) -> Medium { return Medium(vec3<f32>(1.0, 0.5, 0.25), density()); }";
    let all = with(&[("fog", vec![needs("density", ParameterType::Float)], text)]);
    let look = Appearance::new("fog").with("density", std::f64::consts::LN_2);
    let shape = Shape::new(Block::new(DVec3::ZERO, DVec3::new(1.0, 3.0, 1.0)).unwrap(), look);
    let frame = picture(&all, &Setup::post(0.23), &[shape], &along_y(0.5, 0.5));
    let alpha = 0.875;
    within("fog", max_error(&wide(&frame), &[[alpha, 0.5 * alpha, 0.25 * alpha, alpha]]), 1e-6);
    let kernel = lut(&constant(1.0, [1, 3, 1]), greys(&[(1.0, 1.0, 0.5)]), 1.0);
    let wanted = Setup::exact().draw(&[kernel], &along_y(0.5, 0.5));
    within("depth", f64::from((frame.depth[0] - wanted.depth[0]).abs()), 1e-4);
}

/// The gradient of a linear field is the same wherever the volume stands: A⁻ᵀ times that of the
/// data.
#[test]
fn gradients_are_those_of_the_world() {
    // Only where all neighbours are: at the rim they are clamped to the data's edge.
    let text = "fn shade(s: Sample) -> Medium { let c = abs(volume_coordinates(s.position) - 0.5); \
                let near = max(c.x, max(c.y, c.z)) < 0.2; \
                return Medium(0.1 * volume_gradient(s.position) + 0.5, select(0.0, 2.0, near)); }";
    let all = with(&[("slope", vec![needs("volume", ParameterType::Volume)], text)]);
    let spacing = DVec3::new(0.5, 2.0, 1.0);
    let desc = VolumeDesc { spacing, ..VolumeDesc::new([9, 5, 6], ScalarType::F32, 1) };
    let data = DVec3::new(1.0, -0.7, 0.4);
    let volume: Volume = placed(desc, |index| data.dot(index * spacing));
    for linear in [DMat3::IDENTITY, DMat3::from_cols(DVec3::Y * 2.0, DVec3::new(-1.0, 0.4, 0.0), DVec3::Z * 0.5)] {
        let shape = Shape::around(&volume, Appearance::new("slope"));
        shape.set_transform(DAffine3::from_mat3(linear));
        let center = shape.state().transform.transform_point3(DVec3::new(2.0, 4.0, 2.5));
        let desc = FrameDesc::new(
            volact_core::Camera::orthographic(center - DVec3::new(3.0, 20.0, 1.0), center, DVec3::Z, 0.01),
            1,
            1,
        );
        let frame = picture(&all, &Setup::post(0.05), &[shape], &desc);
        let gradient = linear.inverse().transpose() * data;
        let [r, g, b, a] = wide(&frame)[0];
        let found = (DVec3::new(r, g, b) / a - 0.5) * 10.0;
        assert!(a > 0.5 && (found - gradient).length() < 1e-5, "{found}, wanted {gradient}; opacity {a}");
    }
}

#[test]
fn sources_mix_with_each_other_and_with_kernels() {
    let ball = ball([9, 8, 10], ScalarType::U8);
    let kernel = [lut(&ball, warm(), 1.0), lut(&ball, greys(&[(0.0, 0.3, 0.05), (200.0, 1.0, 0.2)]), 0.5)];
    kernel[1].set_transform(DAffine3::from_translation(DVec3::new(2.0, 1.0, 0.5)));
    let wanted = Setup::post(0.1).draw(&kernel, &view());
    let mixed = |sources: [bool; 2]| -> Vec<Shape> {
        let shape = |i: usize| if sources[i] { by_source(&kernel[i], "own") } else { kernel[i].clone() };
        vec![shape(0), shape(1)]
    };
    for sources in [[true, true], [true, false], [false, true]] {
        let mut shapes = mixed(sources);
        let found = picture(&own(), &Setup::post(0.1), &shapes, &view());
        within(&format!("{sources:?}"), max_error(&wide(&found), &wide(&wanted)), 4e-5);
        shapes.reverse();
        assert!(identical(&found, &picture(&own(), &Setup::post(0.1), &shapes, &view())), "{sources:?}");
    }
}

#[test]
fn the_same_bits_on_any_number_of_threads_and_after_changes() {
    let shape = by_source(&lut(&ball([9, 8, 10], ScalarType::U16), warm(), 1.0), "own");
    let draw_with = |threads: i64| {
        let setup = Setup::post(0.1).with("threads", threads);
        picture(&own(), &setup, std::slice::from_ref(&shape), &view())
    };
    let one = draw_with(1);
    assert!(identical(&one, &draw_with(3)));
    // A table changed and changed back, a transform likewise.
    let (all, setup) = (own(), Setup::post(0.1));
    let mut action = setup.action_in(&all);
    let shapes = [shape];
    draw(&mut *action, &shapes, &view()).unwrap();
    shapes[0].set_parameter("lookup_table", greys(&[(0.0, 1.0, 0.3)]));
    shapes[0].set_transform(DAffine3::from_rotation_x(0.3));
    let changed = draw(&mut *action, &shapes, &view()).unwrap();
    assert!(!identical(&one, &changed));
    shapes[0].set_parameter("lookup_table", warm());
    shapes[0].set_transform(DAffine3::IDENTITY);
    assert!(identical(&one, &draw(&mut *action, &shapes, &view()).unwrap()));
}

#[test]
fn only_what_changed_is_made_anew() {
    let shape = by_source(&lut(&ball([9, 8, 10], ScalarType::U8), warm(), 1.0), "own");
    let (all, setup) = (own(), Setup::post(0.2));
    let mut action = setup.action_in(&all);
    let shapes = [shape];
    let mut anew = || -> Vec<String> {
        let frame = draw(&mut *action, &shapes, &view()).unwrap();
        frame.statistics.rebuilt.into_iter().map(|made| made.what).collect()
    };
    assert!(anew().contains(&"shader".to_owned()));
    assert_eq!(anew(), Vec::<String>::new());
    shapes[0].set_parameter("lookup_table", greys(&[(0.0, 1.0, 0.3)]));
    assert_eq!(anew(), ["classification"]);
    assert_eq!(anew(), Vec::<String>::new());
    shapes[0].set_transform(DAffine3::from_rotation_x(0.3));
    assert_eq!(anew(), ["shader"]);
}

#[test]
fn what_is_no_number_is_transparent() {
    let text = "fn shade(s: Sample) -> Medium { let v = volume(s.position); return Medium(vec3<f32>(v), 1e3 * v); }";
    let all = with(&[("plain", vec![needs("volume", ParameterType::Volume)], text)]);
    let volume = placed(VolumeDesc::new([2, 6, 2], ScalarType::F32, 1), |p| if p.y < 3.0 { f64::NAN } else { 0.5 });
    let frame =
        picture(&all, &Setup::post(0.1), &[Shape::around(&volume, Appearance::new("plain"))], &along_y(0.5, 0.5));
    within("behind NaN", max_error(&wide(&frame), &[[0.5, 0.5, 0.5, 1.0]]), 1e-6);
}

#[test]
fn a_shader_that_never_ends_is_an_error_and_the_action_goes_on() {
    let text = "fn shade(s: Sample) -> Medium { var x = 1.0; loop { x = x * 1.0001; if x < 0.0 { break; } } \
                return Medium(vec3<f32>(x), 1.0); }";
    let all = with(&[("endless", vec![needs("volume", ParameterType::Volume)], text), ("own", classified(), OWN)]);
    let volume = constant(1.0, [2, 2, 2]);
    let endless = Shape::around(&volume, Appearance::new("endless"));
    let good = by_source(&lut(&volume, greys(&[(1.0, 1.0, 0.5)]), 1.0), "own");
    let setup = Setup::post(0.5);
    let mut action = setup.action_in(&all);
    let error = told(&draw(&mut *action, std::slice::from_ref(&endless), &along_y(0.7, 0.7)).unwrap_err());
    assert!(error.contains("endless") && error.contains("65536"), "{error}");
    action.unmanage(&endless).unwrap();
    let frame = draw(&mut *action, &[good], &along_y(0.7, 0.7)).unwrap();
    within("after it", max_error(&wide(&frame), &[[0.75; 4]]), 1e-6);
}

#[test]
fn a_wrong_source_is_shown_at_its_place() {
    let all = with(&[(
        "typo",
        vec![needs("volume", ParameterType::Volume)],
        "fn shade(s: Sample) -> Medium {\n  return Medum();\n}",
    )]);
    let shape = Shape::around(&constant(1.0, [2, 2, 2]), Appearance::new("typo"));
    let setup = Setup::cpu();
    let error = told(&draw(&mut *setup.action_in(&all), &[shape], &along_y(0.7, 0.7)).unwrap_err());
    assert!(error.contains("typo.wgsl:2:") && error.contains("Medum") && error.contains('^'), "{error}");
}

#[test]
fn what_sources_cannot_do_is_refused_by_name() {
    let shape = by_source(&lut(&constant(1.0, [2, 2, 2]), warm(), 1.0), "own");
    let refused = |shape: &Shape| told(&Setup::cpu().action_in(&own()).manage(shape).unwrap_err());
    shape.set_parameter("lookup_table", warm().pre_interpolated());
    let error = refused(&shape);
    assert!(error.contains("\"own\"") && error.contains("pre-interpolated"), "{error}");
    let text = "fn value(s: Sample) -> f32 { return volume(s.position); }\n\
                fn shade(s: Sample) -> Medium { return lookup_table(s.value); }";
    let all = with_compositing(&[("peak", classified(), text)], Compositing::Maximum);
    let plane = volact_core::Plane::new(DVec3::splat(0.5), DVec3::Y).unwrap();
    let slices = volact_core::Slices { planes: vec![plane], style: SliceStyle::Opaque, volume: false };
    let block = Arc::new(Block::new(DVec3::ZERO, DVec3::ONE).unwrap());
    let sliced = volact_core::Sliced::new(block, slices).unwrap();
    let look = Appearance::new("peak").with("volume", VolumeTexture::new(&constant(1.0, [2, 2, 2])));
    let shape = Shape::new(sliced, look.with("lookup_table", warm()).with("unit_distance", 1.0));
    let error = told(&Setup::cpu().action_in(&all).manage(&shape).unwrap_err());
    assert!(error.contains("slice planes") && error.contains("maximum"), "{error}");
}

#[test]
fn parameters_reach_the_program() {
    let text = "fn shade(s: Sample) -> Medium {\n  var c = tint().rgb * gain();\n  if bright() { c = c + shift(); }\n  \
                if way() == way_flipped { c = c.bgr; }\n  return Medium(c * (turn() * vec4<f32>(1.0)).x, f32(strength()));\n}";
    let mut way = ParameterDecl::new("way", ParameterType::Choice, "a parameter").choices(&["plain", "flipped"]);
    way = way.default("plain");
    let parameters = vec![
        needs("tint", ParameterType::Color),
        needs("gain", ParameterType::Float),
        needs("bright", ParameterType::Bool),
        needs("shift", ParameterType::Vec3),
        needs("turn", ParameterType::Matrix),
        needs("strength", ParameterType::Int),
        way,
    ];
    let all = with(&[("all", parameters, text)]);
    let matrix = volact_core::glam::DMat4::from_scale(DVec3::new(0.5, 1.0, 1.0));
    let look = Appearance::new("all")
        .with("tint", ParameterValue::Color([0.2, 0.4, 0.6, 1.0]))
        .with("gain", 2.0)
        .with("bright", true)
        .with("shift", ParameterValue::Vec3(DVec3::new(0.1, 0.0, 0.2)))
        .with("turn", ParameterValue::Matrix(matrix))
        .with("strength", 1i64)
        .with("way", "flipped");
    let shape = Shape::new(Block::new(DVec3::ZERO, DVec3::ONE).unwrap(), look);
    let found: Picture = wide(&picture(&all, &Setup::post(0.23), &[shape], &along_y(0.5, 0.5)));
    let alpha = 1.0 - (-1f64).exp();
    within("parameters", max_error(&found, &[[0.7 * alpha, 0.4 * alpha, 0.25 * alpha, alpha]]), 1e-6);
}
