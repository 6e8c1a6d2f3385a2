//! Parameters of every type, and what the environment is asked.

mod common;

use common::{Nothing, Of, entry, required, uniforms};
use volact_core::{
    Compositing, ControlPoint, LookupTable, ParameterDecl, ParameterType, ParameterValue, ScalarType, Volume,
    VolumeDesc, VolumeTexture,
    glam::{DAffine3, DMat4, DVec2, DVec3, DVec4},
    parameter::ParameterMap,
};
use volact_shaders::{
    Entry, Environment, Kernel, Machine, Program,
    eval::{Field, Input, Overrun, Uniforms},
    plain::Plain,
};

fn map(values: &[(&str, ParameterValue)]) -> ParameterMap {
    values.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect()
}

/// What `shade` gives where nothing depends on a sample: the kernel reads nothing and asks nothing.
fn constant(text: &str, parameters: Vec<ParameterDecl>, values: &[(&str, ParameterValue)]) -> [f64; 4] {
    let program = Program::new(&entry(text, Compositing::Over, parameters)).unwrap_or_else(|e| panic!("{e}"));
    let map = map(values);
    let place = DAffine3::from_scale_rotation_translation(
        DVec3::new(2.0, 3.0, 4.0),
        volact_core::glam::DQuat::from_rotation_z(1.0),
        DVec3::new(5.0, 6.0, 7.0),
    );
    let uniforms = Uniforms { parameters: &map, object_to_world: place, origin: DVec3::new(1e8, 0.0, 0.0) };
    let kernel = Kernel::<f64>::new(&program, Entry::Shade, &uniforms).unwrap();
    assert_eq!((kernel.functions().len(), kernel.inputs().len()), (0, 0), "{text}");
    let mut machine = Machine::new(&kernel);
    machine.run(1, &[], &mut Nothing).unwrap();
    std::array::from_fn(|k| machine.output(k)[0])
}

#[test]
fn numbers_of_all_types_are_constants() {
    let shade = |body: &str| format!("fn shade(s: Sample) -> Medium {{ {body} }}");
    let p = |name: &str, kind| vec![required(name, kind)];
    // Parameters keep their double precision.
    let x = 0.1 + 1e-12;
    let text = shade("return Medium(vec3(x()), 2.0 * x());");
    assert_eq!(constant(&text, p("x", ParameterType::Float), &[("x", x.into())]), [x, x, x, 2.0 * x]);
    let text = shade("return Medium(vec3(f32(n()), f32(n() / 2), f32(-n())), 0.0);");
    let found = constant(&text, p("n", ParameterType::Int), &[("n", ParameterValue::Int(-7))]);
    assert_eq!(found, [-7.0, -3.0, 7.0, 0.0]);
    let text = shade("if b() { return Medium(vec3(1.0), 2.0); } return Medium();");
    assert_eq!(constant(&text, p("b", ParameterType::Bool), &[("b", true.into())]), [1.0, 1.0, 1.0, 2.0]);
    assert_eq!(constant(&text, p("b", ParameterType::Bool), &[("b", false.into())]), [0.0; 4]);
    let text = shade("return Medium(vec3(a(), 3.0), a().y);");
    let found = constant(&text, p("a", ParameterType::Vec2), &[("a", DVec2::new(1.0, 2.0).into())]);
    assert_eq!(found, [1.0, 2.0, 3.0, 2.0]);
    let text = shade("return Medium(a(), a_local().x);");
    let found = constant(&text, p("a", ParameterType::Vec3), &[("a", DVec3::new(1e8 + 0.25, 2.0, 3.0).into())]);
    assert_eq!(found, [1e8 + 0.25, 2.0, 3.0, 0.25]);
    let text = shade("return Medium(a().wzy, a().x);");
    let found = constant(&text, p("a", ParameterType::Vec4), &[("a", DVec4::new(1.0, 2.0, 3.0, 4.0).into())]);
    assert_eq!(found, [4.0, 3.0, 2.0, 1.0]);
    let text = shade("return Medium(a().rgb, a().a);");
    let color = ParameterValue::Color([0.1, 0.2, 0.3, 0.4]);
    assert_eq!(constant(&text, p("a", ParameterType::Color), &[("a", color)]), [0.1, 0.2, 0.3, 0.4]);
    let text = shade("let v = m() * vec4(1.0, 2.0, 3.0, 1.0); return Medium(v.xyz, v.w);");
    let m = DMat4::from_cols_array(&std::array::from_fn(|i| (i * i) as f64));
    let wanted = m * DVec4::new(1.0, 2.0, 3.0, 1.0);
    assert_eq!(constant(&text, p("m", ParameterType::Matrix), &[("m", m.into())]), wanted.to_array());
}

#[test]
fn choices_pick_their_branch() {
    let text = "fn shade(s: Sample) -> Medium {
        switch mode() {
            case mode_warm: { return Medium(vec3(1.0), 0.0); }
            case mode_cold_blue: { return Medium(vec3(2.0), 0.0); }
            default: { return Medium(s.position, 0.0); }
        }
    }";
    let mode = || vec![ParameterDecl::new("mode", ParameterType::Choice, "m").choices(&["warm", "cold-blue", "own"])];
    assert_eq!(constant(text, mode(), &[("mode", "warm".into())])[0], 1.0);
    assert_eq!(constant(text, mode(), &[("mode", "cold-blue".into())])[0], 2.0);
    let program = Program::new(&entry(text, Compositing::Over, mode())).unwrap();
    let own = map(&[("mode", "own".into())]);
    let kernel = Kernel::<f32>::new(&program, Entry::Shade, &uniforms(&own)).unwrap();
    let wanted = [0, 1, 2].map(|i| Input { sample: 0, field: Field::Position(i) });
    assert!(kernel.inputs().eq(wanted));
}

#[test]
fn optional_parameters_say_whether_they_are_given() {
    let text = "fn shade(s: Sample) -> Medium {
        if x_given() { return Medium(vec3(x()), v_spacing()); } return Medium(vec3(-1.0), x());
    }";
    let x = || vec![ParameterDecl::new("x", ParameterType::Float, "x"), required("v", ParameterType::Volume)];
    let mut desc = VolumeDesc::new([2, 2, 2], ScalarType::U8, 1);
    desc.spacing = DVec3::new(1.0, 0.5, 0.25);
    let volume = ParameterValue::from(&Volume::new(desc, vec![0u8; 8]).unwrap());
    // Scaled by 2, 3 and 4.
    let found = constant(text, x(), &[("x", 3.0.into()), ("v", volume.clone())]);
    assert!((found[3] - 1.0).abs() < 1e-12 && found[0] == 3.0, "{found:?}");
    assert_eq!(constant(text, x(), &[("v", volume)]), [-1.0, -1.0, -1.0, 0.0]);
}

/// Asks are recorded: which results are wanted, and for which samples.
struct Recorder(Vec<(Vec<bool>, Option<Vec<bool>>)>);

impl Environment<f32> for Recorder {
    fn call(&mut self, _: usize, arguments: &[&[f32]], results: &mut [&mut [f32]], live: Option<&[u32]>) {
        let wanted = results.iter().map(|row| !row.is_empty()).collect();
        self.0.push((wanted, live.map(|live| live.iter().map(|l| *l != 0).collect())));
        results.iter_mut().filter(|row| !row.is_empty()).for_each(|row| row.copy_from_slice(arguments[0]));
    }
}

#[test]
fn only_what_is_needed_is_asked_for() {
    let text = "fn shade(s: Sample) -> Medium {
        let unused = v_gradient(s.position);
        let c = v_components(s.position);
        var e = 0.0;
        if s.position.x > 1.0 { e = v(s.position); }
        if s.position.x > 99.0 { e = v_nearest(s.position); }
        return Medium(vec3(c.y), e);
    }";
    let parameters = vec![required("v", ParameterType::Volume)];
    let program = Program::new(&entry(text, Compositing::Over, parameters)).unwrap();
    let empty = ParameterMap::new();
    let kernel = Kernel::<f32>::new(&program, Entry::Shade, &uniforms(&empty)).unwrap();
    let (x, other) = ([0.0f32, 2.0, 3.0, 1.0], [0.0f32; 4]);
    let mut recorder = Recorder(Vec::new());
    let mut machine = Machine::new(&kernel);
    machine.run(4, &[&x, &other, &other], &mut recorder).unwrap();
    let live = vec![false, true, true, false];
    assert_eq!(recorder.0, [(vec![false, true, false, false], None), (vec![true], Some(live))]);
    assert_eq!(machine.output(3), [0.0, 2.0, 3.0, 0.0]);
}

#[test]
fn rows_that_are_not_those_wanted_are_refused() {
    let text = "fn shade(s: Sample) -> Medium { return Medium(s.position, 0.0); }";
    let program = common::program(text).unwrap();
    let empty = ParameterMap::new();
    let kernel = Kernel::<f32>::new(&program, Entry::Shade, &uniforms(&empty)).unwrap();
    let mut machine = Machine::new(&kernel);
    let row = [0f32; 600];
    for (samples, rows) in [(2, vec![&row[..2]; 2]), (2, vec![&row[..3]; 3]), (600, vec![&row[..]; 3])] {
        let error = machine.run(samples, &rows, &mut Nothing).unwrap_err();
        assert!(matches!(error, Overrun::Inputs { wanted: 3, .. }), "{error}");
    }
    machine.run(0, &[&row[..0]; 3], &mut Nothing).unwrap();
    assert!(machine.output(0).is_empty());
}

/// Of a table with constant opacity the mean medium is that medium; where the extinction rises
/// evenly, its depth is the integral.
#[test]
fn segments_have_the_integral_of_their_table() {
    let text = "fn shade(s: Sample) -> Medium { return Medium(); }
        fn shade_segment(front: Sample, back: Sample) -> Medium {
            return t_segment(front.position.x, back.position.x, front.step);
        }";
    let parameters = vec![required("t", ParameterType::Table), required("unit_distance", ParameterType::Float)];
    let program = Program::new(&entry(text, Compositing::Over, parameters)).unwrap();
    let segment = |opacity: [f64; 2], ends: [f64; 2], length: f64| -> [f64; 4] {
        let point = |value, opacity| ControlPoint { value, color: [value, 1.0 - value, 0.5], opacity };
        let table = LookupTable::from_points([point(0.0, opacity[0]), point(1.0, opacity[1])]).unwrap();
        let map = map(&[("t", table.into()), ("unit_distance", 2.0.into())]);
        let uniforms = uniforms(&map);
        let kernel = Kernel::<f64>::new(&program, Entry::Segment, &uniforms).unwrap();
        let row = |input: Input| match input.field {
            Field::Step => [length],
            _ => [ends[input.sample]],
        };
        let rows: Vec<[f64; 1]> = kernel.inputs().map(row).collect();
        let rows: Vec<&[f64]> = rows.iter().map(|r| r.as_slice()).collect();
        let mut machine = Machine::new(&kernel);
        machine.run(1, &rows, &mut Plain::new(&program, &kernel, &uniforms)).unwrap();
        std::array::from_fn(|k| machine.output(k)[0])
    };
    let even = segment([0.5, 0.5], [0.25, 0.25], 3.0);
    let wanted = [0.25, 0.75, 0.5, -(0.5f64).ln() / 2.0];
    assert!(even.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12), "{even:?}");
    // ∫₀¹ −ln(1 − a·v)/2 dv with a = 0.8: ((1 − a)·ln(1 − a) + a)/(2a), by parts.
    let rising = segment([0.0, 0.8], [0.0, 1.0], 3.0);
    let wanted = (0.2 * 0.2f64.ln() + 0.8) / 1.6;
    assert!((rising[3] - wanted).abs() < 1e-4, "{rising:?} {wanted}");
    // The same way back has the same depth, and more of the colour that is now in front.
    let falling = segment([0.0, 0.8], [1.0, 0.0], 3.0);
    assert!((falling[3] - rising[3]).abs() < 1e-9 && falling[0] > rising[0], "{falling:?}");
    // A segment that does nothing but cross the table's end is clamped there.
    assert_eq!(segment([0.0, 0.0], [5.0, 6.0], 1.0)[3], 0.0);
}

#[test]
fn a_table_left_out_is_grey_over_the_range() {
    let shipped = volact_shaders::builtin().unwrap();
    let mip = shipped.iter().find(|s| s.declaration.name == "mip").unwrap();
    let program = Program::new(mip).unwrap();
    let volume = Volume::new(VolumeDesc::new([2, 1, 1], ScalarType::U8, 1), vec![0u8, 200]).unwrap();
    let texture = VolumeTexture::new(&volume).with_range([100.0, 200.0]).unwrap();
    let map = map(&[("volume", ParameterValue::Volume(texture)), ("component", ParameterValue::Int(0))]);
    let uniforms = uniforms(&map);
    let kernel = Kernel::<f64>::new(&program, Entry::Shade, &uniforms).unwrap();
    let mut machine = Machine::new(&kernel);
    machine.run(1, &[&[125.0]], &mut Plain::new(&program, &kernel, &uniforms)).unwrap();
    assert_eq!(std::array::from_fn::<f64, 4, _>(|k| machine.output(k)[0]), [0.25, 0.25, 0.25, 1.0]);
    let value = Kernel::<f64>::new(&program, Entry::Value, &uniforms).unwrap();
    let mut machine = Machine::new(&value);
    let rows = [[0.75], [0.0], [0.0]];
    let rows: Vec<&[f64]> = rows.iter().map(|r| r.as_slice()).collect();
    machine.run(1, &rows, &mut Of(value.functions().to_vec(), |_, a: &[f64]| vec![a[0] * 2.0])).unwrap();
    assert_eq!(machine.output(0), [1.5]);
    machine.run(1, &rows, &mut Plain::new(&program, &value, &uniforms)).unwrap();
    assert_eq!(machine.output(0), [150.0]);
}

/// A shader of values along the ray needs no `value` of its own where there is something to take.
#[test]
fn value_left_out_is_the_first_volume_else_the_first_attribute() {
    let shade = "fn shade(s: Sample) -> Medium { return medium(vec3(s.value), 1.0); }";
    let flat = |parameters| Program::new(&entry(shade, Compositing::Minimum, parameters)).unwrap();
    let value = |parameters| {
        let (program, map) = (flat(parameters), map(&[]));
        let kernel = Kernel::<f64>::new(&program, Entry::Value, &uniforms(&map)).unwrap();
        let inputs: Vec<Field> = kernel.inputs().map(|input| input.field).collect();
        let rows: Vec<&[f64]> = [[3.0], [4.0], [5.0]].iter().take(inputs.len()).map(|r| r.as_slice()).collect();
        let mut machine = Machine::new(&kernel);
        // A volume's number is the parameter's place and the position.
        let of = |f: volact_shaders::eval::Function, p: &[f64]| vec![1000.0 * f.parameter as f64 + p[0]];
        machine.run(1, &rows, &mut Of(kernel.functions().to_vec(), of)).unwrap();
        (inputs, machine.output(0)[0])
    };
    let number = || required("n", ParameterType::Attribute);
    let volumes = || vec![number(), required("b", ParameterType::Volume), required("a", ParameterType::Volume)];
    assert_eq!(value(volumes()).1, 1003.0);
    let (inputs, of_attribute) = value(vec![required("t", ParameterType::Table), number()]);
    assert!(matches!(inputs.as_slice(), [Field::Attribute(1)]), "{inputs:?}");
    assert_eq!(of_attribute, 3.0);
}

/// Values of volumes where a sample is can be inputs, where every sample has them.
#[test]
fn values_at_own_positions_are_inputs_where_asked_for() {
    let parameters = || vec![required("a", ParameterType::Volume), required("b", ParameterType::Volume)];
    let cases = [
        ("return Medium(vec3(a(s.position)), 1.0);", vec![0]),
        ("let p = s.position; return Medium(vec3(a(p), b(p), a(vec3(p.x, p.y, p.z))), 1.0);", vec![0, 1]),
        ("return Medium(vec3(a(s.position.zyx)), 1.0);", vec![]),
        ("return Medium(vec3(a(s.position + 1.0)), b(s.position));", vec![1]),
        ("if s.position.x > 0.5 { return Medium(vec3(a(s.position)), 2.0); } return Medium(vec3(0.0), 1.0);", vec![]),
        ("var p = s.position; p.x = p.y; return Medium(vec3(a(p)), 1.0);", vec![]),
    ];
    let samples: Vec<[f64; 3]> = (0..40).map(|i| [0.1, 0.37, 0.53].map(|k| (f64::from(i) * k).fract())).collect();
    let field = |volume: usize, p: &[f64]| p[0] + 10.0 * p[1] + 100.0 * p[2] + 1000.0 * volume as f64;
    for (body, wanted) in cases {
        let text = format!("fn shade(s: Sample) -> Medium {{ {body} }}");
        let program = Program::new(&entry(&text, Compositing::Over, parameters())).unwrap_or_else(|e| panic!("{e}"));
        let map = map(&[]);
        let uniforms = uniforms(&map);
        let evaluate = |kernel: &Kernel<f64>| {
            let mut environment = Of(kernel.functions().to_vec(), |f: volact_shaders::eval::Function, p: &[f64]| {
                vec![field(f.parameter, p)]
            });
            let mut machine = Machine::new(kernel);
            for (i, input) in kernel.inputs().enumerate() {
                let [row] = machine.inputs([i]).expect("an input");
                for (to, p) in row.iter_mut().zip(&samples) {
                    *to = match input.field {
                        Field::Position(axis) => p[usize::from(axis)],
                        Field::Volume(volume) => field(volume, p),
                        other => panic!("{other:?}"),
                    };
                }
            }
            machine.run_in_place(samples.len(), &mut environment).unwrap();
            (0..4).map(|k| machine.output(k).to_vec()).collect::<Vec<_>>()
        };
        let asking = Kernel::new(&program, Entry::Shade, &uniforms).unwrap();
        let given = Kernel::with_values(&program, Entry::Shade, &uniforms).unwrap();
        let volumes = given.inputs().filter_map(|input| match input.field {
            Field::Volume(volume) => Some(volume),
            _ => None,
        });
        assert_eq!(volumes.collect::<Vec<_>>(), wanted, "{body}");
        assert!(asking.inputs().all(|input| !matches!(input.field, Field::Volume(_))), "{body}");
        assert_eq!(evaluate(&asking), evaluate(&given), "{body}");
    }
}
