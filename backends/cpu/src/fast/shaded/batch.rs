//! A function of a shader over batches of samples of sixteen rays.

use std::sync::{Mutex, OnceLock, PoisonError};

use volact_core::{
    ActionError, Attribute, ParameterValue,
    glam::{DAffine3, DVec3},
    resolve::ResolvedShape,
};
use volact_shaders::{
    Entry, Kernel, Machine,
    eval::{BATCH, Field, Input, Overrun},
};

use super::{Shader, surroundings::Surroundings, trail::Trail};
use crate::fast::{
    dispatch,
    packet::{Bundle, Lanes},
    simd::{LANES, Unit},
    walk::ALL,
};

/// Rows of sixteen samples in a batch.
pub const ROWS: usize = BATCH / LANES;

/// A sample of each of sixteen rays.
#[derive(Clone, Debug)]
pub struct Row {
    /// What the caller calls it.
    pub number: usize,
    /// Lanes that count. The others are evaluated at the place of one of these.
    pub live: u32,
    /// Where they are on their rays.
    pub t: Lanes,
    /// World lengths that they stand for.
    pub length: [f32; LANES],
    /// What the compositing made of values.
    pub value: [f32; LANES],
    /// Where all lanes have one `t` and length: a `t` a little before, from which on positions are
    /// made in single precision. It must not depend on what is skipped. Else NaN.
    pub base: f64,
}

impl Row {
    /// Samples at `t` for lengths, in some lanes.
    pub fn new(number: usize, live: u32, t: Lanes, length: [f32; LANES]) -> Self {
        Self { number, live, t, length, value: [0.0; LANES], base: f64::NAN }
    }

    /// A function of the lanes, the idle ones like the first live one: nothing may come of where
    /// they are, not even an endless loop.
    fn lanes(&self) -> [usize; LANES] {
        let lead = (self.live.trailing_zeros() as usize).min(LANES - 1);
        std::array::from_fn(|l| if self.live >> l & 1 == 1 { l } else { lead })
    }
}

/// Sixteen rays as programs see them.
#[derive(Clone, Copy, Debug)]
pub struct Rays<'r> {
    /// The rays in world space.
    pub bundle: &'r Bundle,
    /// The cells that they pass, where those matter.
    pub trail: Option<&'r Trail<'r>>,
}

/// A function of a shape's shader, with what it asks for.
#[derive(Debug)]
pub struct Evaluator<'a> {
    shape: &'a ResolvedShape,
    kernel: &'a Kernel<f32>,
    inputs: Vec<Input>,
    origin: DVec3,
    surroundings: Surroundings<'a>,
    /// Vertex numbers by parameter.
    attributes: Vec<Option<&'a Attribute>>,
    component: usize,
    /// Whether it is a function of both ends of a segment.
    of_segments: bool,
    unit: Unit,
    /// Those that no thread uses at the moment.
    workers: Mutex<Vec<Worker<'a>>>,
    failed: OnceLock<Overrun>,
}

/// What a thread needs to evaluate batches.
#[derive(Debug)]
pub struct Worker<'a> {
    machine: Machine<'a, f32>,
    /// The batch.
    pub rows: Vec<Row>,
    inputs: Vec<Vec<f32>>,
    maps: Vec<DAffine3>,
}

impl Worker<'_> {
    /// The numbers that the last batch gave, sixteen a row.
    pub fn output(&self, index: usize) -> &[f32] {
        self.machine.output(index)
    }
}

impl<'a> Evaluator<'a> {
    /// A function of a shape's shader.
    pub fn new(
        shape: &'a ResolvedShape,
        shader: &'a Shader,
        (entry, kernel): (Entry, &'a Kernel<f32>),
        unit: Unit,
    ) -> Self {
        let attribute = |name: &str| match shape.parameters.get(name) {
            Some(ParameterValue::Attribute(attribute)) => Some(attribute),
            _ => None,
        };
        let parameters = &shape.shader.declaration.parameters;
        Self {
            shape,
            kernel,
            inputs: kernel.inputs().collect(),
            origin: shader.origin,
            surroundings: Surroundings::new(shape, shader, kernel.functions(), unit),
            attributes: parameters.iter().map(|p| attribute(&p.name)).collect(),
            component: super::component(shape),
            of_segments: entry == Entry::Segment,
            unit,
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

    /// Lends a worker without rows.
    pub fn with<R>(&self, work: impl FnOnce(&mut Worker<'a>) -> R) -> R {
        let free = || self.workers.lock().unwrap_or_else(PoisonError::into_inner);
        let lent = free().pop();
        let mut worker = lent.unwrap_or_else(|| Worker {
            machine: Machine::new(self.kernel),
            rows: Vec::with_capacity(ROWS),
            inputs: vec![Vec::with_capacity(BATCH); self.inputs.len()],
            maps: Vec::new(),
        });
        worker.rows.clear();
        let result = work(&mut worker);
        free().push(worker);
        result
    }

    /// Evaluates a worker's rows; `false` where nothing came of it, since the program failed or
    /// there are none.
    pub fn run(&self, rays: Rays<'_>, worker: &mut Worker<'a>) -> bool {
        let Worker { machine, rows, inputs, maps } = worker;
        if rows.is_empty() || self.failed.get().is_some() {
            return false;
        }
        let local = rays.bundle.local(self.origin);
        for numbers in inputs.iter_mut() {
            numbers.resize(rows.len() * LANES, 0.0);
        }
        let lines = std::array::from_fn(|a| [&local[a], &rays.bundle.direction[a]]);
        // Positions come as three inputs in a row, or fewer where some are not wanted.
        let mut at = 0;
        while let Some(input) = self.inputs.get(at) {
            let shift = self.shift(*input);
            let position = |n: usize| {
                matches!(self.inputs.get(at + n), Some(Input { field: Field::Position(a), sample })
                if *sample == input.sample && usize::from(*a) == n)
            };
            if position(0) && position(1) && position(2) {
                if let [x, y, z, ..] = &mut inputs[at..] {
                    dispatch::places(self.unit, &lines, rows, shift, [x, y, z]);
                }
                at += 3;
                continue;
            }
            for (row, to) in rows.iter().zip(inputs[at].as_chunks_mut().0) {
                self.numbers(*input, rays, shift, row, to);
            }
            at += 1;
        }
        self.idle(rows, inputs);
        maps.clear();
        if let Some(trail) = rays.trail.filter(|trail| trail.is_bent()) {
            for row in rows.iter() {
                maps.extend(row.lanes().map(|l| trail.map(l, row.t[l], self.origin)));
            }
        }
        let mut lent: [&[f32]; 64] = [&[]; 64];
        let many: Vec<&[f32]>;
        let given = if inputs.len() <= lent.len() {
            lent.iter_mut().zip(inputs.iter()).for_each(|(to, from)| *to = from);
            &lent[..inputs.len()]
        } else {
            many = inputs.iter().map(Vec::as_slice).collect();
            &many
        };
        let mut asked = self.surroundings.asked(maps);
        let result = machine.run(rows.len() * LANES, given, &mut asked);
        // The first one is told; which one that is does not matter.
        result.map_err(|overrun| self.failed.set(overrun)).is_ok()
    }

    /// Where an input is taken, from the middle of a segment on, in its lengths: functions of
    /// segments take both ends.
    fn shift(&self, input: Input) -> f64 {
        match (self.of_segments, input.sample) {
            (false, _) => 0.0,
            (true, 0) => -0.5,
            (true, _) => 0.5,
        }
    }

    /// Puts idle lanes where a live one is.
    fn idle(&self, rows: &[Row], inputs: &mut [Vec<f32>]) {
        for (i, row) in rows.iter().enumerate().filter(|(_, row)| row.live != ALL) {
            let lanes = row.lanes();
            for to in inputs.iter_mut().filter_map(|numbers| numbers.as_chunks_mut::<LANES>().0.get_mut(i)) {
                let numbers = *to;
                *to = lanes.map(|l| numbers[l]);
            }
        }
    }

    /// A number of a row of samples.
    fn numbers(&self, input: Input, rays: Rays<'_>, shift: f64, row: &Row, to: &mut [f32; LANES]) {
        let at = |l: usize| row.t[l] + shift * f64::from(row.length[l]);
        match input.field {
            Field::Position(a) => {
                let (a, eye) = (usize::from(a), self.origin[usize::from(a)]);
                let (from, along) = (&rays.bundle.origin[a], &rays.bundle.direction[a]);
                (0..LANES).for_each(|l| to[l] = (from[l] - eye + along[l] * at(l)) as f32);
            }
            Field::Direction(a) => *to = rays.bundle.direction[usize::from(a)].map(|d| d as f32),
            Field::View(a) => *to = rays.bundle.direction[usize::from(a)].map(|d| -d as f32),
            Field::Step => *to = row.length,
            Field::Depth => (0..LANES).for_each(|l| to[l] = (at(l) - rays.bundle.depth_zero) as f32),
            Field::Value => *to = row.value,
            Field::Attribute(p) => self.attribute(rays, (p, self.component), &at, row, to),
            Field::AttributeComponent(p, c) => self.attribute(rays, (p, usize::from(c)), &at, row, to),
        }
    }

    fn attribute(
        &self,
        rays: Rays<'_>,
        (parameter, component): (usize, usize),
        at: &dyn Fn(usize) -> f64,
        row: &Row,
        to: &mut [f32; LANES],
    ) {
        let attribute = self.attributes.get(parameter).copied().flatten().filter(|a| component < a.components);
        let (Some(attribute), Some(trail)) = (attribute, rays.trail) else { return to.fill(0.0) };
        for l in (0..LANES).filter(|l| row.live >> l & 1 == 1) {
            to[l] = trail.number(l, at(l), |vertex| attribute.value(vertex, component)) as f32;
        }
    }
}

/// The positions of rows of samples: `from + along·t`, as far as `shift` of their lengths from their
/// middle.
#[inline(always)]
pub fn places(lines: &[[&Lanes; 2]; 3], rows: &[Row], shift: f64, out: [&mut [f32]; 3]) {
    let [x, y, z] = out;
    let out =
        x.as_chunks_mut::<LANES>().0.iter_mut().zip(y.as_chunks_mut::<LANES>().0).zip(z.as_chunks_mut::<LANES>().0);
    let lines = lines.map(|[from, along]| [*from, *along]);
    let along = lines.map(|[_, along]| along.map(|d| d as f32));
    let (mut base, mut start) = (f64::NAN, [[0f32; LANES]; 3]);
    for (row, ((x, y), z)) in rows.iter().zip(out) {
        // In places of its own, so that the compiler makes vectors of it.
        let mut at = [[0f32; LANES]; 3];
        if row.base.is_nan() {
            for a in 0..3 {
                for l in 0..LANES {
                    let t = row.t[l] + shift * f64::from(row.length[l]);
                    at[a][l] = (lines[a][0][l] + lines[a][1][l] * t) as f32;
                }
            }
        } else {
            if row.base != base {
                base = row.base;
                for a in 0..3 {
                    for l in 0..LANES {
                        start[a][l] = (lines[a][0][l] + lines[a][1][l] * base) as f32;
                    }
                }
            }
            let off = (row.t[0] - base) as f32 + shift as f32 * row.length[0];
            for a in 0..3 {
                for l in 0..LANES {
                    at[a][l] = start[a][l] + along[a][l] * off;
                }
            }
        }
        (*x, *y, *z) = (at[0], at[1], at[2]);
    }
}
