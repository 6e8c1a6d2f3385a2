//! What is recognised, what the sources that come along show, what is refused, and what is said of
//! estimates.

use volact_core::{
    Appearance, Block, Compositing, Context, FrameDesc, LookupTable, Options, ParameterType, ParameterValue, Plane,
    RenderAction, ShaderEntry, Shape, SliceStyle, Sliced, Slices, View, WarningCode, glam::DVec3,
};
use volact_cpu::reference::{ReferenceAction, ReferenceOptions, declaration};

use super::{
    common::{along_z, lut, point, table, volume_of},
    source_common::{alike, block, draw, evaluated, is, lattice, registry, shader, told, try_draw},
};

const LUT: [(&str, ParameterType); 3] = [
    ("volume", ParameterType::Volume),
    ("lookup_table", ParameterType::Table),
    ("unit_distance", ParameterType::Float),
];

fn over(name: &str, text: &str) -> ShaderEntry {
    shader(name, Compositing::Over, &LUT, text)
}

/// The same parameters as `lut`, which has a component, too.
fn like_lut(name: &str, text: &str) -> ShaderEntry {
    let shipped = volact_shaders::builtin().unwrap();
    let mut entry = shipped.into_iter().find(|s| s.declaration.name == "lut").unwrap();
    entry.declaration.name = name.into();
    entry.source = over(name, text).source;
    entry
}

fn data() -> volact_core::Volume {
    volume_of([4, 4, 5], |[x, y, z]| ((x * 7 + y * 5 + z * 3) as f64 * 0.7).sin())
}

fn warm() -> LookupTable {
    table(&[point(-1.0, [0.1, 0.2, 0.9], 0.0), point(0.2, [0.9, 0.2, 0.1], 0.5), point(1.0, [1.0; 3], 0.1)])
}

fn by(shape: &Shape, shader: &str) -> Shape {
    let other = shape.named(shader);
    other.set_shader(shader);
    other
}

#[test]
fn a_program_that_does_what_lut_does_is_certified_as_lut() {
    let text = "fn at(p: vec3<f32>) -> f32 { return volume(p); }
                fn shade(s: Sample) -> Medium { let v = at(s.position); return lookup_table(v); }";
    let other = "fn shade(s: Sample) -> Medium { return lookup_table(volume(s.position) * 1.5); }";
    let all = registry(&[like_lut("again", text), like_lut("other", other)]);
    let shape = lut(&data(), warm(), 0.8);
    let frame = FrameDesc::fit(&shape, View::Iso, 6, 6);
    let draw = |name: &str, options: ReferenceOptions| draw(&all, &[by(&shape, name)], &frame, &options);
    let wanted = draw("lut", ReferenceOptions::default());
    assert_eq!(draw("again", ReferenceOptions::default()), wanted);
    assert!(wanted.estimated.is_empty() && wanted.not_certified == 0);
    let found = draw("again", evaluated());
    assert_eq!(found.estimated, ["again"]);
    alike(&found.color, &wanted.color, 1e-9);
    let other = draw("other", ReferenceOptions::default());
    assert!(other.estimated == ["other"] && other.color != wanted.color);
}

#[test]
fn a_frame_says_what_is_an_estimate() {
    let all =
        registry(&[like_lut("own", "fn shade(s: Sample) -> Medium { return lookup_table(volume(s.position)); }")]);
    let shape = by(&lut(&data(), warm(), 0.8), "own");
    let frame = FrameDesc::fit(&shape, View::Iso, 6, 6);
    let draw = |given: &[(&str, ParameterValue)]| {
        let given: Options = given.iter().map(|(n, v)| ((*n).to_owned(), v.clone())).collect();
        let context = Context { shaders: all.shaders().clone(), ..Context::default() };
        let options = declaration().resolve(&given, |_| false).unwrap();
        let mut action = ReferenceAction::new(&context, &options).unwrap();
        assert!(action.caps().sources);
        action.manage(&shape).unwrap();
        action.begin_draw(&frame).unwrap();
        action.draw(&shape).unwrap();
        action.end_draw().unwrap()
    };
    let told = |frame: &volact_core::Frame| {
        let warned =
            frame.warnings.iter().any(|w| w.code == WarningCode::NotCertified && w.to_string().contains("own"));
        let detail = frame.statistics.details.iter().any(|(n, v)| n == "estimated, not certified" && v == "own");
        assert_eq!(warned, detail);
        assert_eq!(warned, frame.method.sampling.contains("adaptive quadrature"));
        warned
    };
    assert!(!told(&draw(&[])));
    assert!(told(&draw(&[("recognise", false.into())])));
    let rays = [("method", "rays".into()), ("sample_distance", 0.3.into()), ("recognise", false.into())];
    assert!(!told(&draw(&rays)));
}

#[test]
fn a_loop_without_end_is_an_error_that_names_the_shader() {
    let text = "fn shade(s: Sample) -> Medium {
        var v = volume(s.position);
        while v < 1e9 { v = v * 0.5; }
        return lookup_table(v);
    }";
    let all = registry(&[over("endless", text)]);
    let shape = by(&lut(&data(), warm(), 1.0), "endless");
    for options in [evaluated(), lattice(0.5)] {
        let error = told(&try_draw(&all, std::slice::from_ref(&shape), &along_z(0.3, 0.4), &options).unwrap_err());
        assert!(error.contains("\"endless\"") && error.contains("65536"), "{error}");
    }
}

#[test]
fn what_is_not_drawn_is_refused_by_name() {
    let peak = "fn value(s: Sample) -> f32 { return volume(s.position); }
                fn shade(s: Sample) -> Medium { return lookup_table(s.value); }";
    let bare = "fn shade(s: Sample) -> Medium { return Medium(vec3(1.0), volume(s.position)); }";
    let edge = "fn value(s: Sample) -> f32 { return volume(s.position); }
                fn shade(s: Sample) -> Medium { return Medium(vec3(1.0), 0.5); }";
    let own = "fn shade(s: Sample) -> Medium { return lookup_table(volume(s.position) * 0.5); }";
    let typo = "fn shade(s: Sample) -> Medium {\n  return lookup_tabel(0.5);\n}";
    let mut wrong = over("typo", own);
    wrong.source = over("typo", typo).source;
    let all = registry(&[
        shader("peak", Compositing::Maximum, &LUT, peak),
        shader("bare", Compositing::Over, &LUT[..1], bare),
        shader("edge", Compositing::First, &LUT[..1], edge),
        over("own", own),
        wrong,
    ]);
    let refused = |shape: &Shape, options: &ReferenceOptions, words: &[&str]| {
        let error = told(&try_draw(&all, std::slice::from_ref(shape), &along_z(0.3, 0.4), options).unwrap_err());
        words.iter().for_each(|word| assert!(error.contains(word), "{word:?} is not in {error}"));
    };
    let shape = lut(&data(), warm(), 1.0);
    let default = ReferenceOptions::default();
    refused(&by(&shape, "typo"), &default, &["typo.wgsl:2:", "lookup_tabel", "^"]);
    refused(&by(&shape, "edge"), &default, &["\"edge\"", "first", "table"]);
    let pre = by(&shape, "own");
    pre.set_parameter("lookup_table", warm().pre_interpolated());
    refused(&pre, &default, &["pre-interpolated", "\"own\""]);
    let pre = by(&pre, "lut");
    assert!(try_draw(&all, std::slice::from_ref(&pre), &along_z(0.3, 0.4), &default).is_ok());
    refused(&pre, &evaluated(), &["pre-interpolated", "\"lut\"", "recognise"]);
    let sliced = |name: &str, style| {
        let planes = vec![Plane::new(DVec3::splat(1.5), DVec3::Z).unwrap()];
        let block = Block::new(DVec3::ZERO, DVec3::splat(3.0)).unwrap();
        let shape = by(&shape, name);
        let made = Sliced::new(std::sync::Arc::new(block), Slices { planes, style, volume: false });
        shape.set_geometry(made.unwrap());
        shape
    };
    refused(&sliced("peak", SliceStyle::Opaque), &default, &["slice planes", "\"peak\"", "maximum"]);
    refused(&sliced("bare", SliceStyle::Blended), &default, &["slice planes", "\"bare\"", "unit_distance"]);
    let made = draw(&all, &[sliced("bare", SliceStyle::Opaque)], &along_z(0.3, 0.4), &default);
    is(&made, [1.0; 4], 1e-12);
    refused(&sliced("mip", SliceStyle::Opaque), &default, &["slices", "mip"]);
}

/// Extinctions add where two volumes lie: the certified picture of two shapes is that of `blend2`.
#[test]
fn blend2_is_two_shapes_in_one_place() {
    let second = volume_of([3, 3, 4], |[x, y, z]| ((x * 5 + y * 3 + z * 11) as f64 * 0.6).cos());
    let table2 = table(&[point(-0.6, [0.0, 0.8, 0.2], 0.0), point(0.7, [0.6, 0.1, 0.9], 0.6)]);
    let look = Appearance::new("blend2")
        .with("lookup_table", warm())
        .with("volume2", volact_core::VolumeTexture::new(&second))
        .with("lookup_table2", table2.clone())
        .with("unit_distance", 0.8);
    let both = Shape::around(&data(), look);
    let frame = FrameDesc::fit(&both, View::Iso, 6, 6);
    let all = registry(&[]);
    let wanted =
        draw(&all, &[lut(&data(), warm(), 0.8), lut(&second, table2, 0.8)], &frame, &ReferenceOptions::default());
    assert_eq!(wanted.not_certified, 0);
    alike(&draw(&all, &[both], &frame, &ReferenceOptions::default()).color, &wanted.color, 3e-9);
}

/// Labels are those of the nearest sample: `lut` with the nearest filter shows the same.
#[test]
fn labels_are_the_nearest_ones() {
    let labels = volume_of([4, 4, 5], |[x, y, z]| ((x * 7 + y * 5 + z * 3) % 4) as f64);
    let parts = |i: usize| point(i as f64, [0.3 * i as f64, 1.0 - 0.2 * i as f64, 0.5], [0.0, 0.3, 0.9, 0.5][i]);
    let names = table(&[parts(0), parts(1), parts(2), parts(3)]);
    let look = |name: &str, volume: &str, table: &str, filter| {
        let texture = volact_core::VolumeTexture::new(&labels).with_filter(filter);
        let look = Appearance::new(name).with(volume, texture).with(table, names.clone()).with("unit_distance", 0.8);
        block(DVec3::ZERO, DVec3::new(3.0, 3.0, 4.0), look)
    };
    let nearest = look("lut", "volume", "lookup_table", volact_core::Filter::Nearest);
    let by_label = look("labels", "labels", "label_table", volact_core::Filter::Linear);
    let frame = FrameDesc::fit(&nearest, View::Iso, 6, 6);
    let all = registry(&[]);
    let wanted = draw(&all, &[nearest], &frame, &ReferenceOptions::default());
    alike(&draw(&all, &[by_label], &frame, &ReferenceOptions::default()).color, &wanted.color, 1e-8);
}

/// On a linear field the light of `gradient` is the same everywhere.
#[test]
fn gradient_is_lit_by_the_slope() {
    let data = volume_of([6, 6, 6], |[x, y, z]| x as f64 + 2.0 * y as f64 - 2.0 * z as f64);
    let look = Appearance::new("gradient")
        .with("lookup_table", table(&[point(0.0, [0.8, 0.4, 0.2], 0.5)]))
        .with("unit_distance", 2.0)
        .with("ambient", 0.25)
        .with("diffuse", 0.5)
        .with("specular", 0.125)
        .with("shininess", 2.0);
    // Between the outermost samples, where neighbours are there on both sides.
    let inner = Block::new(DVec3::splat(1.0), DVec3::splat(3.0)).unwrap();
    let shape = Shape::around(&data, look);
    shape.set_geometry(inner);
    let made = draw(&registry(&[]), &[shape], &along_z(2.3, 2.4), &ReferenceOptions::default());
    // Head light: n·l = 2/3, mirrored half vector the same.
    let cosine = 2.0f64 / 3.0;
    let alpha = 1.0 - 0.5f64.powf(3.0 / 2.0);
    let lit = |c: f64| (c * (0.25 + 0.5 * cosine) + 0.125 * cosine.powi(2)) * alpha;
    is(&made, [lit(0.8), lit(0.4), lit(0.2), alpha], 1e-9);
}
