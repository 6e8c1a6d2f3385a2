//! The built-in sources against closed forms, on fields and tables given by formulas.

mod common;

use common::{Of, uniforms};
use volact_core::{
    ParameterValue, ShaderEntry, Volume, VolumeDesc, VolumeTexture,
    glam::{DAffine3, DQuat, DVec3},
    parameter::ParameterMap,
};
use volact_shaders::{
    Entry, Kernel, Machine, Native, Program, builtin,
    eval::{Field, Function, Real, Uniforms},
    plain::Plain,
    recognise,
    signatures::Derived,
};

fn shipped(name: &str) -> ShaderEntry {
    builtin().unwrap().into_iter().find(|s| s.declaration.name == name).unwrap()
}

/// The parameters given, with defaults for the others.
fn parameters(entry: &ShaderEntry, given: &[(&str, ParameterValue)]) -> ParameterMap {
    let defaults = entry.declaration.parameters.iter().filter_map(|p| Some((p.name.clone(), p.default.clone()?)));
    let mut map: ParameterMap = defaults.collect();
    map.extend(given.iter().map(|(name, value)| ((*name).to_owned(), value.clone())));
    map
}

/// A sample: its numbers by field.
#[derive(Clone, Copy, Debug)]
struct At {
    position: DVec3,
    direction: DVec3,
    value: f64,
    attribute: [f64; 4],
}

impl At {
    fn new(x: f64, y: f64, z: f64) -> Self {
        let direction = DVec3::new(0.3, -0.5, 0.9).normalize();
        Self { position: DVec3::new(x, y, z), direction, value: 0.0, attribute: [0.0; 4] }
    }

    fn field(&self, field: Field) -> f64 {
        match field {
            Field::Position(i) => self.position[i as usize],
            Field::Direction(i) => self.direction[i as usize],
            Field::View(i) => -self.direction[i as usize],
            Field::Value => self.value,
            Field::Attribute(0) => self.attribute[0],
            Field::AttributeComponent(_, i) => self.attribute[i as usize],
            _ => f64::NAN,
        }
    }
}

/// What a function of an entry gives for one sample.
fn evaluate<F: Real>(
    entry: &ShaderEntry,
    of: Entry,
    map: &ParameterMap,
    at: At,
    asked: impl FnMut(&str, Derived, &[f64]) -> Vec<f64>,
) -> Vec<f64> {
    let program = Program::new(entry).unwrap_or_else(|error| panic!("{error}"));
    let kernel = Kernel::<F>::new(&program, of, &uniforms(map)).unwrap();
    let rows: Vec<[F; 1]> = kernel.inputs().map(|input| [F::from_f64(at.field(input.field))]).collect();
    let rows: Vec<&[F]> = rows.iter().map(|row| row.as_slice()).collect();
    let names: Vec<String> = entry.declaration.parameters.iter().map(|p| p.name.clone()).collect();
    let mut asked = asked;
    let asked = |f: Function, a: &[f64]| asked(&names[f.parameter], f.derived, a);
    let mut machine = Machine::new(&kernel);
    machine.run(1, &rows, &mut Of(kernel.functions().to_vec(), asked)).unwrap();
    (0..kernel.outputs()).map(|k| machine.output(k)[0].to_f64()).collect()
}

/// The same in `f32` and `f64`, each to its rounding.
fn check(
    entry: &ShaderEntry,
    given: &[(&str, ParameterValue)],
    at: At,
    asked: impl Fn(&str, Derived, &[f64]) -> Vec<f64>,
    wanted: [f64; 4],
) {
    let map = parameters(entry, given);
    let near = |found: Vec<f64>, tolerance: f64| {
        for (found, wanted) in found.iter().zip(wanted) {
            let same = found == &wanted || (found - wanted).abs() <= tolerance * (1.0 + wanted.abs());
            assert!(same, "{} at {at:?}: {found}, wanted {wanted}", entry.declaration.name);
        }
    };
    near(evaluate::<f64>(entry, Entry::Shade, &map, at, &asked), 1e-7);
    near(evaluate::<f32>(entry, Entry::Shade, &map, at, &asked), 2e-5);
}

const PLACES: [[f64; 3]; 4] = [[0.1, 0.2, 0.3], [-0.4, 0.9, 0.05], [1.2, -0.7, 0.6], [0.0, 0.0, 0.0]];

fn f(p: DVec3) -> f64 {
    p.x * p.x + 2.0 * p.y - 0.5 * p.z
}

fn slope(p: DVec3) -> DVec3 {
    DVec3::new(2.0 * p.x, 2.0, -0.5)
}

/// Straight colour and opacity of a table, by a formula.
fn table(v: f64) -> [f64; 4] {
    [0.5 + 0.1 * v, 0.25, (0.2 * v).abs(), 0.3 + 0.05 * v]
}

fn extinction(opacity: f64, unit: f64) -> f64 {
    -(1.0 - opacity).ln() / unit
}

/// Volumes are `f`, tables are `table`, by way of a unit of 0.5.
fn world(_: &str, derived: Derived, a: &[f64]) -> Vec<f64> {
    let p = || DVec3::new(a[0], a[1], a[2]);
    match derived {
        Derived::Value => vec![f(p())],
        Derived::Nearest => vec![f(p()).round()],
        Derived::Gradient => slope(p()).to_array().to_vec(),
        Derived::Inside => vec![1.0],
        Derived::TableColor | Derived::Entry => table(a[0]).to_vec(),
        Derived::Medium => {
            let [r, g, b, a] = table(a[0]);
            vec![r, g, b, extinction(a, 0.5)]
        }
        Derived::Color => vec![0.1, 0.2, 0.3, 0.4],
        other => panic!("{other:?} is asked for"),
    }
}

fn unit() -> (&'static str, ParameterValue) {
    ("unit_distance", ParameterValue::Float(0.5))
}

#[test]
fn all_sources_are_right_and_small() {
    for entry in builtin().unwrap() {
        let name = &entry.declaration.name;
        let program = Program::new(&entry).unwrap_or_else(|error| panic!("{error}"));
        let map = parameters(&entry, &[]);
        let kernel = Kernel::<f32>::new(&program, Entry::Shade, &uniforms(&map)).unwrap();
        assert!(
            kernel.instructions() < 150 && kernel.rows() < 64,
            "{name}: {} {}",
            kernel.instructions(),
            kernel.rows()
        );
        Kernel::<f64>::new(&program, Entry::Shade, &uniforms(&map)).unwrap();
        let text = &entry.source.as_ref().unwrap().text;
        assert!(text.starts_with(&format!("// {name}: ")), "{name} has a header");
        // What is computed has a source, with its year; `tangent_space` follows a product.
        let header: String = text.lines().take_while(|line| line.starts_with("//")).collect();
        let year = |word: &str| word.len() == 4 && (word.starts_with("19") || word.starts_with("20"));
        let cited = header.split(|c: char| !c.is_ascii_digit()).any(year);
        assert!(cited || header.contains("OpenGL Volumizer"), "{name} cites no source");
    }
}

#[test]
fn declarations_are_those_of_core() {
    let mut compared = 0;
    for own in volact_core::shader::builtin() {
        let Some(shipped) = builtin().unwrap().into_iter().find(|s| s.declaration.name == own.declaration.name) else {
            assert_eq!(own.declaration.name, "surface");
            continue;
        };
        assert_eq!(shipped.declaration, own.declaration);
        assert_eq!(shipped.compositing, own.compositing);
        compared += 1;
    }
    assert_eq!(compared, 7);
}

#[test]
fn tables_and_colours_are_passed_on() {
    for [x, y, z] in PLACES {
        let at = At::new(x, y, z);
        let [r, g, b, a] = table(f(at.position));
        check(&shipped("lut"), &[unit()], at, world, [r, g, b, extinction(a, 0.5)]);
        check(&shipped("simple"), &[unit()], at, world, [0.1, 0.2, 0.3, extinction(0.4, 0.5)]);
        let flat = At { value: 1.7, ..at };
        for name in ["mip", "minip", "average", "xray"] {
            check(&shipped(name), &[unit()], flat, world, table(1.7));
            let entry = shipped(name);
            let map = parameters(&entry, &[]);
            assert_eq!(evaluate::<f64>(&entry, Entry::Value, &map, at, world), [f(at.position)]);
        }
    }
}

/// An opacity so small that 1 − a loses it, and one that ends the ray.
#[test]
fn opacity_becomes_extinction_without_loss() {
    for opacity in [0.0, 1e-7, 0.5, 1.0] {
        let entry = shipped("simple");
        let map = parameters(&entry, &[unit()]);
        let color = |_: &str, _: Derived, _: &[f64]| vec![0.0, 0.0, 0.0, opacity];
        let found = evaluate::<f32>(&entry, Entry::Shade, &map, At::new(0.0, 0.0, 0.0), color)[3];
        let wanted = -(-opacity).ln_1p() / 0.5;
        assert!(found == wanted || (found / wanted - 1.0).abs() < 1e-6, "{opacity}: {found} {wanted}");
    }
}

#[test]
fn lut2d_multiplies_both_tables() {
    for [x, y, z] in PLACES {
        let at = At::new(x, y, z);
        let (a, b) = (table(f(at.position)), table(slope(at.position).length()));
        let wanted = [a[0] * b[0], a[1] * b[1], a[2] * b[2], extinction(a[3] * b[3], 0.5)];
        check(&shipped("lut2d"), &[unit()], at, world, wanted);
    }
}

#[test]
fn labels_take_a_second_volume_where_there_is_one() {
    let volume = Volume::new(VolumeDesc::new([1, 1, 1], volact_core::ScalarType::U8, 1), vec![0u8]).unwrap();
    for [x, y, z] in PLACES {
        let at = At::new(x, y, z);
        let label = table(f(at.position).round());
        check(&shipped("labels"), &[unit()], at, world, [label[0], label[1], label[2], extinction(label[3], 0.5)]);
        let v = table(f(at.position));
        let wanted = [label[0] * v[0], label[1] * v[1], label[2] * v[2], extinction(label[3] * v[3], 0.5)];
        check(&shipped("labels"), &[unit(), ("volume", (&volume).into())], at, world, wanted);
    }
}

#[test]
fn blend2_adds_extinctions() {
    let inf = f64::INFINITY;
    for (a, b, wanted) in [
        ([1.0, 0.0, 0.5, 2.0], [0.0, 1.0, 0.5, 6.0], [0.25, 0.75, 0.5, 8.0]),
        ([1.0, 0.0, 0.5, 0.0], [0.0, 1.0, 0.5, 6.0], [0.0, 1.0, 0.5, 6.0]),
        ([1.0, 0.0, 0.5, 0.0], [0.0, 1.0, 0.5, 0.0], [1.0, 0.0, 0.5, 0.0]),
        ([1.0, 0.0, 0.5, inf], [0.0, 1.0, 0.5, 6.0], [1.0, 0.0, 0.5, inf]),
        ([1.0, 0.0, 0.5, 3.0], [0.0, 1.0, 0.5, inf], [0.0, 1.0, 0.5, inf]),
        ([1.0, 0.0, 0.5, inf], [0.0, 1.0, 0.5, inf], [0.5, 0.5, 0.5, inf]),
    ] {
        for inside in [true, false] {
            let asked = |name: &str, derived: Derived, _: &[f64]| match (name, derived) {
                ("lookup_table", Derived::Medium) => a.to_vec(),
                ("lookup_table2", Derived::Medium) => b.to_vec(),
                (_, Derived::Inside) => vec![f64::from(u8::from(inside))],
                _ => vec![0.0],
            };
            check(&shipped("blend2"), &[unit()], At::new(0.0, 0.0, 0.0), asked, if inside { wanted } else { a });
        }
    }
}

#[test]
fn attributes_are_classified() {
    let entry = shipped("attribute");
    let data = volact_core::Buffer::from_vec(vec![0f32]);
    let attribute = volact_core::Attribute::new("a", volact_core::ScalarType::F32, 1, data).unwrap();
    let other = volact_core::LookupTable::grey([0.0, 1.0]);
    let at = At { attribute: [0.7, -1.0, 2.0, 3.0], ..At::new(0.0, 0.0, 0.0) };
    let asked = |name: &str, _: Derived, a: &[f64]| {
        let [r, g, b, alpha] = table(a[0]);
        if name == "opacity_table" { vec![0.0, 0.0, 0.0, 0.9 - 0.1 * a[0]] } else { vec![r, g, b, alpha] }
    };
    let [r, g, b, a] = table(0.7);
    check(&entry, &[unit()], at, asked, [r, g, b, extinction(a, 0.5)]);
    let table_given = ("opacity_table", ParameterValue::Table(other));
    check(&entry, &[unit(), table_given], at, asked, [r, g, b, extinction(0.9 - 0.07, 0.5)]);
    let scalars_given = ("opacity_scalars", ParameterValue::Attribute(attribute));
    check(&entry, &[unit(), scalars_given], at, asked, [r, g, b, extinction(a, 0.5)]);
}

/// The formula of the header, written once more.
fn lit(color: [f64; 3], gradient: DVec3, at: At, light: DVec3, phong: bool) -> [f64; 3] {
    let normal = gradient.normalize();
    let normal = if normal.dot(at.direction) < 0.0 { normal } else { -normal };
    let cosine = normal.dot(light);
    let mirrored = match phong {
        false => normal.dot((light - at.direction).normalize()),
        true => (2.0 * cosine * normal - light).dot(-at.direction),
    };
    let highlight = 0.2 * mirrored.max(0.0).powf(10.0);
    color.map(|c| if cosine > 0.0 { (c * (0.2 + 0.7 * cosine) + highlight).min(1.0) } else { c * 0.2 })
}

#[test]
fn gradients_light_in_world_space() {
    let place = DVec3::new(2.0, 3.0, -4.0);
    for model in ["blinn_phong", "phong"] {
        for light in ["head", "directional", "positional"] {
            for [x, y, z] in PLACES {
                let at = At::new(x, y, z);
                let l = match light {
                    "head" => -at.direction,
                    "directional" => DVec3::X,
                    _ => (place - at.position).normalize(),
                };
                let [r, g, b, a] = table(f(at.position));
                let [r, g, b] = lit([r, g, b], slope(at.position), at, l, model == "phong");
                let given = [
                    unit(),
                    ("model", ParameterValue::Choice(model.into())),
                    ("light", ParameterValue::Choice(light.into())),
                    ("light_position", ParameterValue::Vec3(place)),
                ];
                check(&shipped("gradient"), &given, at, world, [r, g, b, extinction(a, 0.5)]);
                // On a surface of a value the opacity has no length.
                let on = At { value: 0.8, ..at };
                let [r, g, b, a] = table(0.8);
                let [r, g, b] = lit([r, g, b], slope(at.position), at, l, model == "phong");
                check(&shipped("isosurface"), &given, on, world, [r, g, b, a]);
            }
        }
    }
    let even =
        |name: &str, d: Derived, a: &[f64]| if d == Derived::Gradient { vec![0.0; 3] } else { world(name, d, a) };
    let at = At::new(0.1, 0.2, 0.3);
    let [r, g, b, a] = table(f(at.position));
    check(&shipped("gradient"), &[unit()], at, even, [0.2 * r, 0.2 * g, 0.2 * b, extinction(a, 0.5)]);
}

/// The header's limit: (f(x + εl) − f(x))/ε goes to ∇f·l, with an error that halves with ε.
#[test]
fn tangent_space_tends_to_the_derivative_along_the_light() {
    let entry = shipped("tangent_space");
    let volume = Volume::new(VolumeDesc::new([2, 2, 2], volact_core::ScalarType::U8, 1), vec![0u8; 8]).unwrap();
    let light = DVec3::new(-1.0, -2.0, 0.5);
    let at = At::new(0.3, 0.2, 0.1);
    let brightness = |offset: f64| {
        let given = [
            unit(),
            ("volume", ParameterValue::from(&volume)),
            ("lightdir", ParameterValue::Vec3(light)),
            ("offset", ParameterValue::Float(offset)),
            ("contrast", ParameterValue::Float(0.1)),
            ("ambient", ParameterValue::Float(0.0)),
            ("diffuse", ParameterValue::Float(1.0)),
        ];
        let asked = |name: &str, derived: Derived, a: &[f64]| match derived {
            Derived::Normalized => vec![f(DVec3::new(a[0], a[1], a[2]))],
            Derived::Medium => vec![1.0, 1.0, 1.0, 1.0],
            _ => world(name, derived, a),
        };
        evaluate::<f64>(&entry, Entry::Shade, &parameters(&entry, &given), at, asked)[0]
    };
    // The grid has a spacing of 1.
    let limit = -0.1f32 as f64 * slope(at.position).dot(light.normalize());
    let limit = limit.clamp(0.0, 1.0);
    assert!(limit > 0.1, "{limit}");
    let errors: Vec<f64> = (1..6).map(|k| (brightness(0.5f64.powi(k)) - limit).abs()).collect();
    assert!(errors[0] > 1e-3, "{errors:?}");
    for pair in errors.windows(2) {
        assert!((pair[0] / pair[1] - 2.0).abs() < 0.01, "{errors:?}");
    }
}

#[test]
fn built_in_shaders_are_recognised_by_what_they_do() {
    let of = |entry: &ShaderEntry| recognise(&Program::new(entry).unwrap(), true);
    for entry in builtin().unwrap() {
        let wanted = match entry.declaration.name.as_str() {
            "simple" => Some(Native::Simple),
            "lut" => Some(Native::Lut),
            "mip" => Some(Native::Mip),
            "minip" => Some(Native::Minip),
            "average" => Some(Native::Average),
            "xray" => Some(Native::Xray),
            "attribute" => Some(Native::Attribute),
            _ => None,
        };
        assert_eq!(of(&entry), wanted, "{}", entry.declaration.name);
        assert_eq!(recognise(&Program::new(&entry).unwrap(), false), None);
    }
    // What the compositing takes is that of the volume, whether it is written or not.
    for name in ["mip", "minip", "average", "xray"] {
        let mut entry = shipped(name);
        let mut text = (*entry.source.unwrap()).clone();
        text.text = text.text.replace("fn value(s: Sample) -> f32 { return volume(s.position); }", "");
        assert!(!text.text.contains("fn value"));
        entry.source = Some(text.into());
        assert_eq!(of(&entry).map(Native::name), Some(name));
    }
    let with = |text: &str| {
        let mut entry = shipped("lut");
        entry.declaration.name = "mine".into();
        entry.source = Some(std::sync::Arc::new(volact_core::ShaderText { file: "mine".into(), text: text.into() }));
        of(&entry)
    };
    let same = "fn v(p: vec3f) -> f32 { return volume(p); }
        fn shade(here: Sample) -> Medium { let p = here.position; let x = v(p); return lookup_table(x); }";
    assert_eq!(with(same), Some(Native::Lut));
    assert_eq!(with("fn shade(s: Sample) -> Medium { return lookup_table(volume(s.position) + 1.0); }"), None);
    assert_eq!(with("fn shade(s: Sample) -> Medium { return lookup_table(volume_nearest(s.position)); }"), None);
}

/// A linear field is its own interpolation, and its gradient is known in any placement.
#[test]
fn plain_gives_a_linear_field_in_the_world() {
    let (dims, slope, base) = ([5usize, 6, 7], DVec3::new(0.7, -1.3, 2.1), 4.0);
    let mut voxels = Vec::new();
    for z in 0..7 {
        for y in 0..6 {
            for x in 0..5 {
                voxels.push((base + slope.dot(DVec3::new(f64::from(x), f64::from(y), f64::from(z)))) as f32);
            }
        }
    }
    let mut desc = VolumeDesc::new(dims, volact_core::ScalarType::F32, 1);
    desc.spacing = DVec3::new(0.5, 2.0, 1.25);
    let volume = Volume::new(desc.clone(), voxels).unwrap();
    let object_to_world = DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 3.0, 0.5),
        DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-0.4),
        DVec3::new(1e7, -3.0, 12.0),
    );
    let text = "fn shade(s: Sample) -> Medium { return Medium(volume_gradient(s.position), volume(s.position)); }";
    let parameters = vec![common::required("volume", volact_core::ParameterType::Volume)];
    let program = Program::new(&common::entry(text, volact_core::Compositing::Over, parameters)).unwrap();
    let map = ParameterMap::from([("volume".to_owned(), ParameterValue::Volume(VolumeTexture::new(&volume)))]);
    let uniforms = Uniforms { parameters: &map, object_to_world, origin: DVec3::new(1e7, 0.0, 0.0) };
    let kernel = Kernel::<f64>::new(&program, Entry::Shade, &uniforms).unwrap();
    let mut machine = Machine::new(&kernel);
    for index in [DVec3::new(1.5, 2.25, 3.75), DVec3::new(3.0, 4.0, 1.0)] {
        let position = object_to_world.transform_point3(index * desc.spacing) - uniforms.origin;
        let rows: Vec<[f64; 1]> = position.to_array().map(|x| [x]).to_vec();
        let rows: Vec<&[f64]> = rows.iter().map(|r| r.as_slice()).collect();
        machine.run(1, &rows, &mut Plain::new(&program, &kernel, &uniforms)).unwrap();
        let found = DVec3::new(machine.output(0)[0], machine.output(1)[0], machine.output(2)[0]);
        let to_index = (object_to_world.matrix3 * volact_core::glam::DMat3::from_diagonal(desc.spacing)).inverse();
        let wanted = to_index.transpose() * slope;
        assert!((found - wanted).length() < 1e-5 * wanted.length(), "{found} {wanted}");
        assert!((machine.output(3)[0] - (base + slope.dot(index))).abs() < 1e-6);
    }
}
