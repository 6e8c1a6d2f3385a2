//! Samples a second of the evaluator, on one thread.
//!
//! The environment is a formula of a few operations, so that the evaluator is measured and not
//! voxels: a table lookup, a lit table, and noise of eight octaves in a loop.

use std::{collections::BTreeMap, hint::black_box, sync::Arc};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use volact_core::{
    Compositing, Declaration, ParameterValue, ShaderEntry, ShaderText,
    glam::{DAffine3, DVec3},
    parameter::{Kind, ParameterMap},
};
use volact_shaders::{
    Entry, Environment, Kernel, Machine, Program, builtin,
    eval::{BATCH, Function, Real, Uniforms},
    signatures::Derived,
};

/// Volumes are x·y + z, gradients (y, x, 1), tables grey with an extinction of the value.
struct Formula(Vec<Function>);

impl<F: Real> Environment<F> for Formula {
    fn call(&mut self, function: usize, arguments: &[&[F]], results: &mut [&mut [F]], _: Option<&[u32]>) {
        let (a, half) = (arguments, F::from_f32(0.5));
        match self.0[function].derived {
            Derived::Value => {
                let n = results[0].len();
                let (x, y, z) = (&a[0][..n], &a[1][..n], &a[2][..n]);
                (0..n).for_each(|i| results[0][i] = x[i] * y[i] + z[i]);
            }
            Derived::Gradient => {
                results[0].copy_from_slice(a[1]);
                results[1].copy_from_slice(a[0]);
                results[2].fill(half);
            }
            _ => {
                results[..3].iter_mut().for_each(|row| row.fill(half));
                results[3].copy_from_slice(a[0]);
            }
        }
    }
}

const NOISE: &str = "fn hash(c: vec3<i32>) -> f32 {
    let h = u32(c.x) * 374761393u + u32(c.y) * 668265263u + u32(c.z) * 2147483647u;
    let k = (h ^ (h >> 13u)) * 1274126177u;
    return f32(k ^ (k >> 16u)) / 4294967296.0;
}
fn noise(p: vec3<f32>) -> f32 {
    let c = vec3<i32>(floor(p));
    let t = smoothstep(vec3(0.0), vec3(1.0), fract(p));
    var sum = 0.0;
    for (var i = 0; i < 8; i++) {
        let corner = vec3(i & 1, (i >> 1) & 1, i >> 2);
        let w = select(vec3(1.0) - t, t, corner == vec3(1));
        sum += w.x * w.y * w.z * hash(c + corner);
    }
    return sum;
}
fn shade(s: Sample) -> Medium {
    var sum = 0.0;
    var size = 0.5;
    var p = s.position;
    for (var octave = 0; octave < 8; octave++) {
        sum += size * noise(p);
        p *= 2.0;
        size *= 0.5;
    }
    return Medium(vec3(sum), sum);
}";

fn entries() -> Vec<(&'static str, ShaderEntry)> {
    let shipped = builtin().expect("the shipped shaders");
    let named = |name: &str| shipped.iter().find(|s| s.declaration.name == name).cloned().expect("a shipped shader");
    let source = Some(Arc::new(ShaderText { file: "noise.wgsl".into(), text: NOISE.into() }));
    let declaration = Declaration::new(Kind::Shader, "noise", "0", "noise");
    let noise = ShaderEntry { declaration, compositing: Compositing::Over, source };
    vec![("lut", named("lut")), ("gradient", named("gradient")), ("noise", noise)]
}

fn measure<F: Real>(c: &mut Criterion, precision: &str) {
    let mut group = c.benchmark_group(precision);
    group.throughput(Throughput::Elements(BATCH as u64));
    for (name, entry) in entries() {
        let program = Program::new(&entry).expect("a program");
        let defaults = entry.declaration.parameters.iter().filter_map(|p| Some((p.name.clone(), p.default.clone()?)));
        let mut parameters: ParameterMap = defaults.collect::<BTreeMap<_, _>>();
        parameters.insert("unit_distance".into(), ParameterValue::Float(1.0));
        let uniforms = Uniforms { parameters: &parameters, object_to_world: DAffine3::IDENTITY, origin: DVec3::ZERO };
        let kernel = Kernel::<F>::new(&program, Entry::Shade, &uniforms).expect("a kernel");
        let rows: Vec<Vec<F>> = (0..kernel.inputs().len())
            .map(|k| (0..BATCH).map(|i| F::from_f64(0.1 + ((i * 31 + k * 17) % 97) as f64 / 97.0)).collect())
            .collect();
        let rows: Vec<&[F]> = rows.iter().map(Vec::as_slice).collect();
        let (mut machine, mut formula) = (Machine::new(&kernel), Formula(kernel.functions().to_vec()));
        println!("{name}: {} instructions, {} rows", kernel.instructions(), kernel.rows());
        group.bench_function(name, |b| {
            b.iter(|| {
                machine.run(BATCH, black_box(&rows), &mut formula).expect("loops that end");
                black_box(machine.output(3)[7])
            });
        });
    }
    group.finish();
}

fn benches(c: &mut Criterion) {
    measure::<f32>(c, "f32");
    measure::<f64>(c, "f64");
}

criterion_group!(evaluate, benches);
criterion_main!(evaluate);
