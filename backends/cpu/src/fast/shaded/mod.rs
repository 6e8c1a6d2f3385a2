//! Shapes whose shader is a text: its program is evaluated over batches of samples.
//!
//! The samples of sixteen rays in one chunk of the lattice, at most 512, are one batch. Positions
//! are made in f64 and are local from then on. The program asks its `surroundings` for what
//! volumes and tables say, sixteen positions at once; what it gives, colour and extinction, is
//! taken over a whole segment by the exact exponential, and put together with the rest of the
//! scene by the [`sweep`](super::sweep).

mod lookup;
mod surroundings;

use std::sync::{Mutex, OnceLock, PoisonError};

use volact_core::{
    ActionError, Compositing, ParameterType, ParameterValue, TableInterpolation,
    glam::{DAffine3, DVec3},
    parameter::ParameterMap,
    resolve::ResolvedShape,
};
use volact_shaders::{
    Entry, Kernel, Machine, Program,
    eval::{BATCH, Field, Input, Overrun, Uniforms},
};

use super::{
    check::SHADERS,
    direct::exp,
    packet::{Bundle, Cuts},
    simd::{LANES, Unit},
    sweep::{
        Batches,
        gather::{Chunk, Row},
    },
    walk::{CHUNK, Counts},
};
use surroundings::Surroundings;

/// Whether a shape is drawn by evaluating its shader's source.
pub fn wanted(shape: &ResolvedShape) -> bool {
    shape.shader.source.is_some() && !SHADERS.contains(&shape.shader.declaration.name.as_str())
}

/// What of a shape with such a shader is not drawn, and what its user can do.
pub fn refused(shape: &ResolvedShape) -> Option<(String, &'static str)> {
    let (name, compositing) = (&shape.shader.declaration.name, shape.compositing());
    let geometry = &shape.state.geometry;
    if compositing != Compositing::Over {
        let what = format!("shader {name:?} of compositing {}", compositing.name());
        return Some((what, "of shaders with a source it draws those of compositing over"));
    }
    if geometry.as_surface().is_some() {
        return Some((format!("a surface with shader {name:?}"), "draw it with the shader \"surface\""));
    }
    if geometry.slices().is_some() {
        return Some((format!("slice planes with shader {name:?}"), "draw them with a built-in shader, such as lut"));
    }
    let before =
        |v: &ParameterValue| matches!(v, ParameterValue::Table(t) if t.interpolation() == TableInterpolation::Pre);
    if shape.parameters.values().any(before) {
        return Some((format!("a pre-interpolated table in shader {name:?}"), "let it apply after interpolation"));
    }
    if shape.parameters.values().any(|v| v.kind() == ParameterType::Attribute) {
        let what = format!("attributes of vertices in shader {name:?}");
        return Some((what, "draw them with the shader \"attribute\""));
    }
    let bent =
        geometry.as_block().is_none() && geometry.tessellate().is_ok_and(|mesh| mesh.texture_coordinates.is_some());
    bent.then(|| {
        let what = format!("texture coordinates of a mesh with shader {name:?}");
        (what, "leave them out, or draw it with the shader \"lut\"")
    })
}

/// A shape's shader, ready to be evaluated.
#[derive(Debug)]
pub struct Shader {
    kernel: Kernel<f32>,
    /// The point of the world that is the origin of local space.
    origin: DVec3,
    entry: std::sync::Arc<volact_core::ShaderEntry>,
    uniforms: ParameterMap,
    transform: DAffine3,
    /// What voxels depend on: distances between samples are uniform, too.
    volumes: Vec<u64>,
}

/// The parameters that are the same for every sample.
fn uniforms(shape: &ResolvedShape) -> ParameterMap {
    let bulky = |v: &ParameterValue| matches!(v.kind(), ParameterType::Volume | ParameterType::Table);
    shape.parameters.iter().filter(|(_, v)| !bulky(v)).map(|(n, v)| (n.clone(), v.clone())).collect()
}

fn volumes(shape: &ResolvedShape) -> Vec<u64> {
    let volume = |v: &ParameterValue| match v {
        ParameterValue::Volume(texture) => Some(texture.volume().id()),
        _ => None,
    };
    shape.parameters.values().filter_map(volume).collect()
}

impl Shader {
    /// Compiles the shader of a shape.
    ///
    /// # Errors
    /// [`ActionError::Shader`] if its source is wrong.
    pub fn new(shape: &ResolvedShape) -> Result<Self, ActionError> {
        let wrong =
            |e: volact_shaders::ShaderError| ActionError::Shader { shape: shape.name.clone(), source: e.into() };
        let program = Program::new(&shape.shader).map_err(wrong)?;
        let (transform, bounds) = (shape.state.transform, shape.world_block());
        let origin = bounds.center();
        let given = Uniforms { parameters: &shape.parameters, object_to_world: transform, origin };
        let kernel = Kernel::new(&program, Entry::Shade, &given).map_err(wrong)?;
        let entry = std::sync::Arc::clone(&shape.shader);
        Ok(Self { kernel, origin, entry, uniforms: uniforms(shape), transform, volumes: volumes(shape) })
    }

    /// Whether it is still what the shape needs.
    pub fn serves(&self, shape: &ResolvedShape) -> bool {
        self.entry == shape.shader
            && self.transform == shape.state.transform
            && self.origin == shape.world_block().center()
            && self.uniforms == uniforms(shape)
            && self.volumes == volumes(shape)
    }

    /// Bytes held, about.
    pub fn bytes(&self) -> usize {
        self.kernel.instructions() * 32
    }
}

/// A shape as its program shows it.
#[derive(Debug)]
pub struct Shaded<'a> {
    shape: &'a ResolvedShape,
    inputs: Vec<Input>,
    origin: DVec3,
    step: f64,
    surroundings: Surroundings<'a>,
    kernel: &'a Kernel<f32>,
    /// Those that no thread uses at the moment.
    workers: Mutex<Vec<Worker<'a>>>,
    failed: OnceLock<Overrun>,
}

/// One sample: where it goes, the place on its ray, and the length that it stands for.
#[derive(Clone, Copy, Debug)]
struct Sample {
    row: u8,
    lane: u8,
    t: f64,
    length: f64,
}

/// What a thread needs to evaluate batches.
#[derive(Debug)]
struct Worker<'a> {
    machine: Machine<'a, f32>,
    samples: Vec<Sample>,
    rows: Vec<Vec<f32>>,
    out: Vec<[f32; 4]>,
}

impl<'a> Shaded<'a> {
    /// A shape of which the program was compiled.
    pub fn new(shape: &'a ResolvedShape, shader: &'a Shader, step: f64, unit: Unit) -> Self {
        let kernel = &shader.kernel;
        Self {
            shape,
            inputs: kernel.inputs().collect(),
            origin: shader.origin,
            step,
            surroundings: Surroundings::new(shape, kernel.functions(), shader.origin, unit),
            kernel,
            workers: Mutex::default(),
            failed: OnceLock::new(),
        }
    }

    /// The first failure of the program.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        let source = |e: &Overrun| Box::new(e.clone());
        let failed = self.failed.get().map(source);
        failed.map_or(Ok(()), |source| Err(ActionError::Shader { shape: self.shape.name.clone(), source }))
    }

    /// Lends a worker.
    fn with(&self, work: impl FnOnce(&mut Worker<'a>)) {
        let free = || self.workers.lock().unwrap_or_else(PoisonError::into_inner);
        let mut worker = free().pop().unwrap_or_else(|| Worker {
            machine: Machine::new(self.kernel),
            samples: Vec::with_capacity(BATCH),
            rows: vec![Vec::with_capacity(BATCH); self.inputs.len()],
            out: Vec::with_capacity(BATCH),
        });
        work(&mut worker);
        free().push(worker);
    }

    /// Evaluates a worker's samples: what whole segments of their media add.
    fn evaluate(&self, bundle: &Bundle, worker: &mut Worker<'a>, counts: &mut Counts) {
        let Worker { machine, samples, rows, out } = worker;
        out.clear();
        out.resize(samples.len(), [0.0; 4]);
        if samples.is_empty() || self.failed.get().is_some() {
            return;
        }
        counts.samples += samples.len() as u64;
        for (input, row) in self.inputs.iter().zip(rows.iter_mut()) {
            row.clear();
            row.extend(samples.iter().map(|s| self.number(bundle, input.field, s)));
        }
        let inputs: Vec<&[f32]> = rows.iter().map(Vec::as_slice).collect();
        if let Err(overrun) = machine.run(samples.len(), &inputs, &mut &self.surroundings) {
            // The first one is told; which one that is does not matter.
            let _ = self.failed.set(overrun);
            return;
        }
        let [r, g, b, extinction] = [0, 1, 2, 3].map(|i| machine.output(i));
        for (i, out) in out.iter_mut().enumerate() {
            let alpha = absorbed(extinction[i], self.step);
            if alpha > 0.0 {
                *out = [r[i] * alpha, g[i] * alpha, b[i] * alpha, alpha];
            }
            if out.iter().any(|v| v.is_nan()) {
                *out = [0.0; 4];
            }
        }
    }

    /// A number of a sample, in local space.
    #[inline(always)]
    fn number(&self, bundle: &Bundle, field: Field, s: &Sample) -> f32 {
        let l = usize::from(s.lane);
        let number = match field {
            Field::Position(a) => {
                let a = usize::from(a.min(2));
                bundle.origin[a][l] - self.origin[a] + bundle.direction[a][l] * s.t
            }
            Field::Direction(a) => bundle.direction[usize::from(a.min(2))][l],
            Field::View(a) => -bundle.direction[usize::from(a.min(2))][l],
            Field::Step => s.length,
            Field::Depth => s.t - bundle.depth_zero,
            // Only compositings other than over have one, and only meshes have attributes.
            Field::Value | Field::Attribute(_) | Field::AttributeComponent(..) => 0.0,
        };
        number as f32
    }
}

impl Batches for Shaded<'_> {
    fn entries(&self, bundle: &Bundle, cut: &[[f64; 2]; LANES], done: u32, counts: &mut Counts) -> (Row, u32) {
        let (mut entries, mut wanted) = ([[0f32; 4]; LANES], 0);
        self.with(|worker| {
            worker.samples.clear();
            for (l, [a, b]) in cut.iter().enumerate().filter(|(l, [a, b])| a < b && done >> l & 1 == 0) {
                wanted |= 1 << l;
                worker.samples.push(Sample { row: 0, lane: l as u8, t: 0.5 * (a + b), length: b - a });
            }
            counts.lattice += worker.samples.len() as u64;
            self.evaluate(bundle, worker, counts);
            for (sample, entry) in worker.samples.iter().zip(&worker.out) {
                entries[usize::from(sample.lane)] = *entry;
            }
        });
        (entries, wanted)
    }

    fn gather(
        &self,
        bundle: &Bundle,
        cuts: &Cuts,
        first: i64,
        done: u32,
        chunk: &mut Chunk,
        counts: &mut Counts,
    ) -> i64 {
        let end = first + CHUNK as i64;
        let span = |l: usize| (cuts.from[l] as i64).max(first)..(cuts.to[l] as i64).min(end);
        self.with(|worker| {
            worker.samples.clear();
            for row in 0..CHUNK {
                let k = first + row as i64;
                let t = (k as f64 + 0.5) * self.step;
                let lanes = (0..LANES).filter(|l| done >> l & 1 == 0 && span(*l).contains(&k));
                let sample = |l: usize| Sample { row: row as u8, lane: l as u8, t, length: self.step };
                worker.samples.extend(lanes.map(sample));
            }
            self.evaluate(bundle, worker, counts);
            for row in worker.samples.iter().zip(&worker.out).collect::<Vec<_>>().chunk_by(|a, b| a.0.row == b.0.row) {
                let mut entries = [[0f32; 4]; LANES];
                row.iter().for_each(|(sample, entry)| entries[usize::from(sample.lane)] = **entry);
                chunk.put(usize::from(row[0].0.row), &entries);
            }
        });
        let more = (0..LANES).any(|l| cuts.from[l] < cuts.to[l] && cuts.to[l] as i64 > end);
        if more { end } else { i64::MAX }
    }
}

/// 1 − e^(−σ·length); nothing where σ is no number or not positive.
#[inline(always)]
fn absorbed(extinction: f32, length: f64) -> f32 {
    let depth = f64::from(extinction) * length;
    if depth > 700.0 {
        1.0
    } else if depth > 0.0 {
        (1.0 - exp(-depth)) as f32
    } else {
        0.0
    }
}
