#![no_main]

use std::sync::Arc;

use libfuzzer_sys::fuzz_target;
use volact_core::{
    Compositing, Declaration, ParameterDecl, ParameterType, ShaderEntry, ShaderText,
    glam::{DAffine3, DVec3},
    parameter::{Kind, ParameterMap},
};
use volact_shaders::{Entry, Environment, Kernel, Machine, Program, eval::Uniforms};

/// Rounds that loops may go in all: few, so that what never ends does so soon.
const BUDGET: u32 = 50;

struct Numbers;

impl Environment<f32> for Numbers {
    fn call(&mut self, function: usize, arguments: &[&[f32]], results: &mut [&mut [f32]], _: Option<&[u32]>) {
        for (k, row) in results.iter_mut().enumerate() {
            for (i, place) in row.iter_mut().enumerate() {
                *place = arguments.first().map_or(0.5, |row| row[i]) + (k + function) as f32;
            }
        }
    }
}

fuzz_target!(|text: &str| {
    let of = |name, kind| ParameterDecl::new(name, kind, "a parameter");
    let declaration = Declaration::new(Kind::Shader, "fuzz", "0", "a fuzzed shader")
        .with(of("volume", ParameterType::Volume))
        .with(of("lookup_table", ParameterType::Table))
        .with(of("unit_distance", ParameterType::Float))
        .with(of("scalars", ParameterType::Attribute))
        .with(of("mode", ParameterType::Choice).choices(&["warm", "cold"]));
    let source = Some(Arc::new(ShaderText { file: "fuzz.wgsl".into(), text: text.into() }));
    let entry = ShaderEntry { declaration, compositing: Compositing::Over, source };
    let program = match Program::new(&entry) {
        Ok(program) => program,
        Err(error) => {
            assert!(!error.to_string().contains("the parser failed"), "{error}");
            return;
        }
    };
    let parameters = ParameterMap::new();
    let uniforms = Uniforms { parameters: &parameters, object_to_world: DAffine3::IDENTITY, origin: DVec3::ZERO };
    let kernel = Kernel::<f32>::new(&program, Entry::Shade, &uniforms).expect("what was lowered once can be again");
    let rows = vec![[0.0, 1.0, -2.5, f32::NAN, f32::INFINITY, 1e-40, 7.0]; kernel.inputs().len()];
    let rows: Vec<&[f32]> = rows.iter().map(|row| row.as_slice()).collect();
    let mut machine = Machine::new(&kernel).with_loop_budget(BUDGET);
    _ = machine.run(7, &rows, &mut Numbers);
});
