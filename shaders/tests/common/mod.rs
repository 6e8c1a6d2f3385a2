//! What the tests share: shaders made of a text, and their evaluation sample by sample.
#![expect(dead_code, reason = "each test uses a part")]

use std::sync::Arc;

use volact_core::{
    Compositing, Declaration, ParameterDecl, ParameterType, ShaderEntry, ShaderText,
    glam::{DAffine3, DVec3},
    parameter::{Kind, ParameterMap},
};
use volact_shaders::{
    Entry, Environment, Kernel, Machine, Program, ShaderError,
    eval::{Field, Function, Overrun, Real, Uniforms},
};

/// A shader of a text.
pub fn entry(text: &str, compositing: Compositing, parameters: Vec<ParameterDecl>) -> ShaderEntry {
    let declaration = Declaration { parameters, ..Declaration::new(Kind::Shader, "test", "0", "a test") };
    let source = Some(Arc::new(ShaderText { file: "test.wgsl".into(), text: text.into() }));
    ShaderEntry { declaration, compositing, source }
}

/// A parameter that must be given.
pub fn required(name: &str, kind: ParameterType) -> ParameterDecl {
    ParameterDecl::new(name, kind, "a parameter").required()
}

/// What is wrong with a shader without parameters.
pub fn refused(text: &str) -> String {
    match Program::new(&entry(text, Compositing::Over, Vec::new())) {
        Ok(_) => format!("accepted: {text}"),
        Err(error) => error.to_string(),
    }
}

/// A program without parameters.
pub fn program(text: &str) -> Result<Program, ShaderError> {
    Program::new(&entry(text, Compositing::Over, Vec::new()))
}

/// Uniforms in world space.
pub fn uniforms(parameters: &ParameterMap) -> Uniforms<'_> {
    Uniforms { parameters, object_to_world: DAffine3::IDENTITY, origin: DVec3::ZERO }
}

/// An environment that nobody asks.
pub struct Nothing;

impl<F> Environment<F> for Nothing {
    fn call(&mut self, function: usize, _: &[&[F]], _: &mut [&mut [F]], _: Option<&[u32]>) {
        panic!("function {function} is asked for");
    }
}

/// An environment of a closure: a function and its arguments to its results.
pub struct Of<C>(pub Vec<Function>, pub C);

impl<F: Real, C: FnMut(Function, &[f64]) -> Vec<f64>> Environment<F> for Of<C> {
    fn call(&mut self, function: usize, arguments: &[&[F]], results: &mut [&mut [F]], live: Option<&[u32]>) {
        let n = results.iter().map(|r| r.len()).max().unwrap_or(0);
        for i in (0..n).filter(|i| live.is_none_or(|live| live[*i] != 0)) {
            let arguments: Vec<f64> = arguments.iter().map(|a| a[i].to_f64()).collect();
            let values = (self.1)(self.0[function], &arguments);
            for (result, value) in results.iter_mut().zip(values) {
                if let Some(place) = result.get_mut(i) {
                    *place = F::from_f64(value);
                }
            }
        }
    }
}

/// Evaluates `shade` on samples of six numbers: position and direction.
pub fn shade<F: Real>(program: &Program, samples: &[[F; 6]]) -> Result<Vec<[F; 4]>, Overrun> {
    shade_with(program, samples, &ParameterMap::new(), |_, _| panic!("nothing is asked"))
}

/// The same with parameters and an environment.
pub fn shade_with<F: Real>(
    program: &Program,
    samples: &[[F; 6]],
    parameters: &ParameterMap,
    asked: impl FnMut(Function, &[f64]) -> Vec<f64>,
) -> Result<Vec<[F; 4]>, Overrun> {
    let kernel = Kernel::<F>::new(program, Entry::Shade, &uniforms(parameters)).expect("a kernel");
    let mut environment = Of(kernel.functions().to_vec(), asked);
    let mut machine = Machine::new(&kernel);
    let mut out = Vec::new();
    for batch in samples.chunks(512) {
        let column = |field| -> Vec<F> {
            let k = match field {
                Field::Position(i) => i as usize,
                Field::Direction(i) => 3 + i as usize,
                other => panic!("{other:?} is not in these samples"),
            };
            batch.iter().map(|s| s[k]).collect()
        };
        let rows: Vec<Vec<F>> = kernel.inputs().map(|input| column(input.field)).collect();
        let rows: Vec<&[F]> = rows.iter().map(Vec::as_slice).collect();
        machine.run(batch.len(), &rows, &mut environment)?;
        out.extend((0..batch.len()).map(|i| std::array::from_fn(|k| machine.output(k)[i])));
    }
    Ok(out)
}
