//! What is refused, and how it is said: the author's file, line and caret, and a reason.

mod common;

use common::{entry, refused, required};
use volact_core::{Compositing, ParameterDecl, ParameterType};
use volact_shaders::{Entry, Program, ShaderError, load, load_folder};

const SHADE: &str = "fn shade(s: Sample) -> Medium { return Medium(); }\n";

fn with_shade(text: &str) -> String {
    refused(&format!("{SHADE}{text}"))
}

#[test]
fn a_parser_error_is_at_the_authors_place() {
    let text = "// a shader\nfn shade(s: Sample) -> Medium {\n    return medum(s);\n}\n";
    let error = refused(text);
    assert!(error.starts_with("test.wgsl:3:12: no definition in scope for identifier: `medum`\n"), "{error}");
    assert!(error.contains("\n 3 |     return medum(s);\n   |            ^^^^^ unknown identifier"), "{error}");
    let error = refused("fn shade(s: Sample) -> Medium { return Medium(");
    assert!(error.starts_with("test.wgsl:1:"), "{error}");
    let error = refused("fn shade(s: Sample) -> Medium {");
    assert!(error.starts_with("test.wgsl:1:"), "{error}");
    // What only the validator finds has a place, too.
    let error = with_shade("fn f(x: f32) -> f32 { if x > 0.0 { return 1.0; } }");
    assert!(error.starts_with("test.wgsl:"), "{error}");
}

#[test]
fn shade_must_be_there_and_of_its_type() {
    assert_eq!(refused(""), "test.wgsl: no function `shade`, wanted `fn shade(s: Sample) -> Medium`");
    let error = refused("fn shde(s: Sample) -> Medium { return Medium(); }");
    assert!(error.starts_with("test.wgsl:1:4: no function `shade`, wanted"), "{error}");
    assert!(error.contains("; is it `shde`?"), "{error}");
    let error = refused("fn shade(p: vec3<f32>) -> vec4<f32> { return vec4(p, 1.0); }");
    let wanted =
        "test.wgsl:1:4: `shade` is `fn shade(p: vec3<f32>) -> vec4<f32>`, wanted `fn shade(s: Sample) -> Medium`";
    assert!(error.starts_with(wanted), "{error}");
    assert!(refused("fn shade(s: Sample) {}").contains("`shade` is `fn shade(s: Sample)`, wanted"));
    let error = with_shade("fn shade_segment(s: Sample) -> Medium { return Medium(); }");
    assert!(error.contains("wanted `fn shade_segment(front: Sample, back: Sample) -> Medium`"), "{error}");
}

#[test]
fn compositing_of_values_wants_a_value() {
    let flat = |text: &str| Program::new(&entry(text, Compositing::Maximum, Vec::new())).unwrap_err().to_string();
    let error = flat(SHADE);
    assert!(error.contains("no function `value`, wanted `fn value(s: Sample) -> f32`"), "{error}");
    assert!(error.contains("compositing `maximum` is of this value"), "{error}");
    // A volume's value stands in for it, but not where a name is nearly that.
    let with_volume =
        |text: &str| Program::new(&entry(text, Compositing::Maximum, vec![required("volume", ParameterType::Volume)]));
    assert!(with_volume(SHADE).unwrap().has(Entry::Value));
    let error = with_volume(&format!("{SHADE}fn valu(s: Sample) -> f32 {{ return 1.0; }}")).unwrap_err().to_string();
    assert!(error.contains("; is it `valu`?"), "{error}");
    let both = format!(
        "{SHADE}fn value(s: Sample) -> f32 {{ return 1.0; }}
        fn shade_segment(front: Sample, back: Sample) -> Medium {{ return Medium(); }}"
    );
    assert!(flat(&both).contains("`shade_segment` has no meaning with the compositing `maximum`"));
}

#[test]
fn what_is_not_for_shaders_is_refused_by_name() {
    for (text, wanted) in [
        ("@compute @workgroup_size(1) fn main() {}", "`@compute`: a shader has no entry point of its own"),
        ("@fragment fn main() -> @location(0) vec4<f32> { return vec4(0.0); }", "`@fragment`: a shader has no entry"),
        ("@group(0) @binding(0) var<uniform> x: f32;", "`@group`: a binding; data comes through"),
        ("var<uniform> x: f32;", "a binding: data comes through the functions"),
        ("var<storage, read> x: array<f32>;", "a binding: data comes through the functions"),
        ("var<private> x: f32;", "a private variable: nothing is kept from sample to sample"),
        ("var<workgroup> x: f32;", "a workgroup variable: samples share no memory"),
        ("override x: f32 = 1.0;", "`override`: a parameter of the declaration does this"),
        ("@id(1) override x: f32 = 1.0;", "attribute `@id` has no meaning"),
        ("struct S { @location(0) x: f32 }", "attribute `@location` has no meaning"),
        ("fn f() { discard; }", "`discard`: a sample is left out"),
        ("fn f(x: f32) -> f32 { return dpdx(x); }", "`dpdx` is not for shaders: a sample has no neighbours"),
        ("fn f(x: f32) -> f32 { return fwidthFine(x); }", "`fwidthFine` is not for shaders"),
        ("fn f(t: texture_3d<f32>) {}", "`texture_3d` is not for shaders: textures are read through"),
        ("fn f(t: sampler) {}", "`sampler` is not for shaders"),
        ("fn f() { workgroupBarrier(); }", "`workgroupBarrier` is not for shaders: samples share no memory"),
        ("fn f() { storageBarrier(); }", "`storageBarrier` is not for shaders"),
        ("struct S { a: atomic<u32> }", "`atomic` is not for shaders: samples share no memory"),
        ("fn f(p: ptr<function, u32>) { atomicAdd(p, 1u); }", "`atomicAdd` is not for shaders"),
        ("fn f(x: u32) -> u32 { return subgroupAdd(x); }", "`subgroupAdd` is not for shaders"),
        ("fn f(x: vec4<f32>) -> u32 { return pack4x8unorm(x); }", "`pack4x8unorm` is not for shaders: packed"),
        ("fn f(x: u32) -> vec4<f32> { return unpack4x8unorm(x); }", "`unpack4x8unorm` is not for shaders"),
        ("fn f(x: f32) -> f32 { return quantizeToF16(x); }", "`quantizeToF16` is not for shaders"),
        ("fn f(x: f16) {}", "`f16` is not for shaders: numbers are f32, i32, u32 or bool"),
        ("fn f(x: f64) {}", "`f64` is not for shaders"),
        ("fn f(x: vec3h) {}", "`vec3h` is not for shaders"),
        ("fn f(x: ptr<private, f32>) -> f32 { return *x; }", "a pointer to anything but a function's variable"),
        ("fn f(x: array<f32>) {}", ""),
        ("struct A { x: array<array<vec4<f32>, 100>, 100> } fn f(a: A) {}", "of 40000 numbers (at most 1024)"),
        ("fn f() { f(); }", "recursive"),
        ("fn f() { let x = 1.0lf; }", "Using `f64` values"),
    ] {
        let error = with_shade(text);
        assert!(error.contains(wanted) && !error.starts_with("accepted"), "{text}\n{error}");
        assert!(error.starts_with("test.wgsl"), "{text}\n{error}");
    }
}

#[test]
fn directives_are_refused() {
    for text in
        ["enable f16;", "requires readonly_and_readwrite_storage_textures;", "diagnostic(off, derivative_uniformity);"]
    {
        let error = refused(&format!("{text}\n{SHADE}"));
        assert!(error.starts_with("test.wgsl:1:1: directive `"), "{error}");
    }
}

#[test]
fn names_that_would_hide_others_are_refused() {
    let parameters = || {
        vec![
            required("volume", ParameterType::Volume),
            ParameterDecl::new("mode", ParameterType::Choice, "m").choices(&["warm", "cold-blue"]).default("warm"),
        ]
    };
    for (text, wanted) in [
        (
            "fn volume_gradient(p: vec3<f32>) {}",
            "`volume_gradient` would hide the function of that name of the parameter `volume`",
        ),
        ("fn f(p: vec3<f32>) { let volume = 1.0; }", "`volume` would hide the function"),
        ("fn f(mode: f32) {}", "`mode` would hide the function"),
        ("const mode_cold_blue = 1;", "`mode_cold_blue` would hide the function"),
        ("struct Sample { x: f32 }", "`Sample` would hide what the framework calls so"),
        ("alias Medium = f32;", "`Medium` would hide what the framework calls so"),
        ("fn f() { var<function> volume: f32; }", "`volume` would hide the function"),
        ("fn exp(x: f32) -> f32 { return x; }", "`exp` would hide what WGSL itself calls so"),
        ("const step = 1.0;", "`step` would hide what WGSL itself calls so"),
        ("struct vec3f { x: f32 }", "`vec3f` would hide what WGSL itself calls so"),
        ("fn volact_f() {}", "names that begin with `volact_` are the framework's"),
    ] {
        let error = Program::new(&entry(&format!("{SHADE}{text}"), Compositing::Over, parameters()));
        let error = error.expect_err(text).to_string();
        assert!(error.contains(wanted), "{text}\n{error}");
        assert!(error.starts_with("test.wgsl:2:"), "{error}");
    }
    // Arrows and comparisons after a `var<…>` declare nothing.
    let text = format!(
        "fn f(p: vec3<f32>) -> f32 {{ var<function> x = 1.0; if x > volume(p) {{ x = 2.0; }} return x; }} {SHADE}"
    );
    Program::new(&entry(&text, Compositing::Over, parameters())).unwrap();
    assert_eq!(refused(&format!("var<private> x: f32; {SHADE}")).matches("test.wgsl:").count(), 1);
    // Inside a function built-ins may be hidden, as WGSL has it, and members have names of their own.
    let text = format!(
        "{SHADE}struct S {{ volume: f32, exp: f32 }} fn f(x: S) -> f32 {{ let step = x.volume; return step; }}"
    );
    Program::new(&entry(&text, Compositing::Over, parameters())).unwrap();
}

#[test]
fn parameters_are_wgsl_names() {
    for (name, wanted) in [
        ("attribute", "`attribute` is a reserved word of WGSL"),
        ("filter", "`filter` is a reserved word of WGSL"),
        ("fn", "`fn` is a reserved word of WGSL"),
        ("exp", "`exp` is a built-in function or type of WGSL"),
        ("step", "`step` is a built-in function or type of WGSL"),
        ("vec3f", "`vec3f` is a built-in function or type of WGSL"),
        ("texture_3d", "`texture_3d` is a built-in function or type of WGSL"),
        ("medium", "`medium` is a name of the framework"),
        ("shade", "`shade` is a name of the framework"),
        ("volact_x", "`volact_…` are the framework's"),
        ("3d", "a WGSL identifier"),
        ("a-b", "a WGSL identifier"),
        ("__x", "a WGSL identifier"),
        ("_", "a WGSL identifier"),
    ] {
        let shader = entry(SHADE, Compositing::Over, vec![required(name, ParameterType::Float)]);
        let error = Program::new(&shader).expect_err(name).to_string();
        assert!(error.contains(wanted), "{name}: {error}");
    }
}

#[test]
fn a_declaration_says_the_line_of_a_bad_name() {
    let folder = tempfile::tempdir().unwrap();
    let ron = folder.path().join("glow.ron");
    let text = "(version: 1, description: \"d\", compositing: Over, parameters: [
        (name: \"filter\", type: Float, description: \"a\"),
        (name: \"v\", type: Volume, description: \"b\"),
        (name: \"v_gradient\", type: Vec3, description: \"c\"),
    ])";
    std::fs::write(&ron, text).unwrap();
    std::fs::write(folder.path().join("glow.wgsl"), SHADE).unwrap();
    let error = load(&ron).unwrap_err().to_string();
    let name = ron.display().to_string();
    let expected = format!(
        "{name}:2:16: parameters[0].name: found \"filter\", wanted another name: `filter` is a reserved word of WGSL\n\
         {name}:4:16: parameters[2].name: found \"v_gradient\", wanted another name: its function `v_gradient` is one of \
         the parameter \"v\", too"
    );
    assert_eq!(error, expected);
}

#[test]
fn a_folder_gives_what_is_right_and_says_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let ron = "(version: 1, description: \"d\", compositing: Over, parameters: [])";
    write("good.ron", ron);
    // As editors on Windows write it.
    write("good.wgsl", &format!("\u{feff}{SHADE}"));
    write("bad.ron", ron);
    write("bad.wgsl", "fn shade(");
    write("half.wgsl", SHADE);
    write("bytes.ron", ron);
    std::fs::write(folder.path().join("bytes.wgsl"), [0xff, 0xfe]).unwrap();
    write("other.txt", "");
    let all = load_folder(folder.path()).unwrap();
    let said: Vec<String> =
        all.iter().map(|r| r.as_ref().map_or_else(ToString::to_string, |e| e.declaration.name.clone())).collect();
    assert_eq!(said.len(), 4, "{said:?}");
    assert!(said[0].contains("bad.wgsl:1:"), "{}", said[0]);
    assert!(said[1].contains("bytes.wgsl: cannot be read"), "{}", said[1]);
    assert_eq!(said[2], "good");
    assert!(said[3].contains("half.wgsl: half.ron is missing beside it"), "{}", said[3]);
    assert!(matches!(load_folder(folder.path().join("none")), Err(ShaderError::Io { .. })));
}

#[test]
fn a_shader_without_source_has_no_program() {
    let native = volact_core::shader::builtin().into_iter().find(|s| s.declaration.name == "surface").unwrap();
    assert!(matches!(Program::new(&native), Err(ShaderError::Native { .. })));
}

/// Texts that make a parser recurse, or memory grow.
#[test]
fn hostile_texts_end_in_errors() {
    let long = |piece: &str, count: usize| piece.repeat(count);
    for (text, wanted) in [
        (long("x", 100_000), "100000 bytes of text, wanted at most 65536".to_owned()),
        (format!("fn f() {{ let x = {}1; }}", long("(", 60_000)), "brackets nest deeper than 64".into()),
        (format!("fn f() {}{}", long("{", 60), long("}", 60)), String::new()),
        (format!("const x = 0{};", long("+1", 30_000)), "more than 512 operators in a row".into()),
        (format!("const x = {}1;", long("-", 30_000)), "more than 512 operators in a row".into()),
        (format!("fn f() {{ if true {{}} {} }}", long("else if true {}", 3000)), "more than 256 `else`".into()),
        ("const a = array<f32, 400000000>(); const b = a[3];".into(), String::new()),
        ("fn f() { var a: array<array<array<f32, 4096>, 4096>, 4096>; }".into(), String::new()),
        ("/*".repeat(30_000), String::new()),
        (long("fn a(){}", 8000), String::new()),
    ] {
        let start: String = text.chars().take(60).collect();
        let error = refused(&text);
        assert!(error.contains(&wanted) && !error.starts_with("accepted"), "{start}: {error}");
    }
    // As deep as is allowed: brackets, each with a chain of operators.
    let chain = format!("{}1.0", "1.0+".repeat(120));
    let deep = (0..50).fold(chain.clone(), |inner, _| format!("({inner}{})", "+1.0".repeat(120)));
    let text = format!("fn shade(s: Sample) -> Medium {{ let x = s.step; return Medium(vec3(x+{deep}), 0.0); }}");
    assert!(text.len() < 1 << 16);
    common::program(&text).unwrap();
}
