//! Whatever a text is, it is refused with its place or evaluated; nothing panics.

mod common;

use common::{Of, entry, required, uniforms};
use proptest::prelude::*;
use volact_core::{Compositing, ParameterDecl, ParameterType, parameter::ParameterMap};
use volact_shaders::{Entry, Kernel, Machine, Program, builtin, eval::Real};

fn parameters() -> Vec<ParameterDecl> {
    vec![
        required("volume", ParameterType::Volume),
        required("lookup_table", ParameterType::Table),
        required("unit_distance", ParameterType::Float),
        ParameterDecl::new("scalars", ParameterType::Attribute, "a parameter"),
    ]
}

fn run<F: Real>(program: &Program) {
    let map = ParameterMap::new();
    let kernel = Kernel::<F>::new(program, Entry::Shade, &uniforms(&map)).unwrap();
    let row = [0.0, 1.5, -1.0, f64::NAN, f64::INFINITY].map(F::from_f64);
    let rows = vec![row.as_slice(); kernel.inputs().len()];
    let mut environment = Of(kernel.functions().to_vec(), |_, a: &[f64]| vec![a.first().copied().unwrap_or(0.5); 16]);
    _ = Machine::new(&kernel).with_loop_budget(40).run(5, &rows, &mut environment);
}

fn judge(text: &str) -> Result<(), TestCaseError> {
    match Program::new(&entry(text, Compositing::Over, parameters())) {
        Ok(program) => {
            run::<f32>(&program);
            run::<f64>(&program);
        }
        Err(error) => {
            let error = error.to_string();
            prop_assert!(error.starts_with("test.wgsl:") && !error.contains("the parser failed"), "{text}\n{error}");
        }
    }
    Ok(())
}

const PIECES: [&str; 44] = [
    "fn ",
    "shade",
    "(",
    "s: Sample",
    ")",
    " -> ",
    "Medium",
    "{",
    "}",
    "return ",
    ";",
    "var x = ",
    "let y = ",
    "x",
    "y",
    " = ",
    " + ",
    " * ",
    "1.0",
    "2",
    "vec3(",
    "f32(",
    "if ",
    "else ",
    "loop ",
    "for (",
    "while ",
    "break;",
    "continue;",
    "switch ",
    "case 1: ",
    "default: ",
    "volume(s.position)",
    "lookup_table(",
    "scalars(s)",
    "[",
    "]",
    "array<f32, 3>",
    "ptr<function, f32>",
    "&",
    "< ",
    "> ",
    ".x",
    ", ",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn changed_sources_are_judged(which in 0usize..13, at in 0.0..1.0f64, cut in 0usize..12, piece in 0..PIECES.len()) {
        let text = builtin().unwrap()[which].source.as_ref().unwrap().text.clone();
        let begin = text.floor_char_boundary((at * text.len() as f64) as usize);
        let end = text.ceil_char_boundary((begin + cut).min(text.len()));
        judge(&format!("{}{}{}", &text[..begin], PIECES[piece], &text[end..]))?;
    }

    #[test]
    fn pieces_of_programs_are_judged(pieces in prop::collection::vec(0..PIECES.len(), 0..30)) {
        let body: String = pieces.iter().map(|i| PIECES[*i]).collect();
        judge(&format!("fn shade(s: Sample) -> Medium {{ {body} return Medium(); }}"))?;
        judge(&body)?;
    }

    #[test]
    fn any_characters_are_judged(text in "\\PC{0,60}") {
        judge(&text)?;
    }
}
