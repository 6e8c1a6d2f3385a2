//! Where programs are known to be transparent.

mod common;

use common::{entry, required, uniforms};
use volact_core::{Compositing, ParameterType, ParameterValue, parameter::ParameterMap};
use volact_shaders::{Entry, Kernel, Program, builtin, eval::Uniforms};

fn parameters() -> Vec<volact_core::ParameterDecl> {
    vec![
        required("volume", ParameterType::Volume),
        required("other", ParameterType::Volume),
        required("table", ParameterType::Table),
        required("unit_distance", ParameterType::Float),
        required("gain", ParameterType::Float),
    ]
}

/// The volume and the table that a program is transparent with.
fn found(text: &str) -> Option<[String; 2]> {
    let program = Program::new(&entry(text, Compositing::Over, parameters())).unwrap_or_else(|e| panic!("{e}"));
    let numbers = [("unit_distance", 1.0), ("gain", 0.5)];
    let given: ParameterMap = numbers.map(|(name, v)| (name.to_owned(), ParameterValue::from(v))).into();
    names(&program, &uniforms(&given))
}

fn names(program: &Program, given: &Uniforms<'_>) -> Option<[String; 2]> {
    let kernel = Kernel::<f32>::new(program, Entry::Shade, given).unwrap_or_else(|e| panic!("{e}"));
    let found = kernel.transparent_with();
    // It is the same where values are inputs.
    let kernel = Kernel::<f32>::with_values(program, Entry::Shade, given).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(kernel.transparent_with(), found);
    let (volume, table) = found?;
    Some([volume, table].map(|i| program.declaration().parameters[i].name.clone()))
}

#[test]
fn factors_of_the_extinction_are_found() {
    let wanted = Some(["volume", "table"].map(str::to_owned));
    for body in [
        "return table(volume(s.position));",
        "let m = table(volume(s.position)); return Medium(m.color * s.depth, m.extinction);",
        "let m = table(volume(s.position)); return Medium(m.color, 0.5 * m.extinction * exp(-s.depth));",
        "let m = table(volume(s.position)); return Medium(vec3(1.0), gain() * m.extinction / s.depth);",
        "let m = table(volume(s.position)); if m.extinction == 0.0 { return m; } \
         return Medium(sin(m.color), m.extinction);",
        "let m = table(volume(s.position)); if s.depth > 5.0 { return Medium(vec3(0.0), 0.0); } return m;",
        "let c = table_color(volume(s.position)); return medium(c.rgb, c.a * saturate(s.depth));",
        "let m = table(volume(s.position)); return Medium(m.color, select(m.extinction, 0.0, s.depth > 1.0));",
    ] {
        assert_eq!(found(&format!("fn shade(s: Sample) -> Medium {{ {body} }}")), wanted, "{body}");
    }
}

#[test]
fn what_is_no_factor_of_the_extinction_is_not() {
    for body in [
        "let m = table(volume(s.position)); return Medium(m.color, m.extinction + 0.1);",
        "let m = table(volume(s.position + vec3(0.1))); return m;",
        "let m = table(volume(s.position.zyx)); return m;",
        "let m = table(2.0 * volume(s.position)); return m;",
        "let m = table(volume(s.position)); return Medium(m.color, exp(m.extinction));",
        "let m = table(volume(s.position)); return Medium(m.color, m.color.x);",
        "let m = table(volume(s.position)); if s.depth > 5.0 { return Medium(vec3(0.0), 1.0); } return m;",
        "var m = table(volume(s.position)); if s.depth > 5.0 { m.extinction = s.depth; } return m;",
        "let m = table(volume(s.position)); return Medium(m.color, select(m.extinction, 1.0, s.depth > 1.0));",
        "let a = table(volume(s.position)); let b = table(other(s.position)); \
         return Medium(a.color, a.extinction + b.extinction);",
        "let a = table(volume(s.position)); let b = table(other(s.position)); if s.depth > 1.0 { return a; } return b;",
        "var m = table(volume(s.position)); for (var i = 0; i < 3; i++) { m.extinction += s.depth; } return m;",
        "return Medium(vec3(1.0), volume(s.position));",
    ] {
        assert_eq!(found(&format!("fn shade(s: Sample) -> Medium {{ {body} }}")), None, "{body}");
    }
}

#[test]
fn lit_and_weighted_built_ins_are_skipped_through() {
    let shipped = builtin().unwrap();
    for (name, wanted) in [
        ("lut", Some(["volume", "lookup_table"])),
        ("gradient", Some(["volume", "lookup_table"])),
        ("tangent_space", Some(["volume", "lookup_table"])),
        ("lut2d", Some(["volume", "lookup_table"])),
        ("labels", None),
        ("simple", None),
    ] {
        let entry = shipped.iter().find(|e| e.declaration.name == name).unwrap();
        let mut given = ParameterMap::new();
        for p in &entry.declaration.parameters {
            given.extend(p.default.clone().map(|v| (p.name.clone(), v)));
        }
        given.insert("unit_distance".into(), 1.0.into());
        let program = Program::new(entry).unwrap();
        let found = names(&program, &uniforms(&given));
        assert_eq!(found, wanted.map(|names| names.map(str::to_owned)), "{name}");
    }
}
