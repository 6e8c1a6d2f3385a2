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
    packet::{Bundle, Lanes, Vectors},
    simd::{LANES, Unit},
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
    pub length: Lanes,
    /// What the compositing made of values.
    pub value: [f32; LANES],
}

impl Row {
    /// Samples at `t` for lengths, in some lanes.
    pub fn new(number: usize, live: u32, t: Lanes, length: Lanes) -> Self {
        Self { number, live, t, length, value: [0.0; LANES] }
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
            surroundings: Surroundings::new(shape, kernel.functions(), shader.origin, unit),
            attributes: parameters.iter().map(|p| attribute(&p.name)).collect(),
            component: super::component(shape),
            of_segments: entry == Entry::Segment,
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
        for (input, numbers) in self.inputs.iter().zip(inputs.iter_mut()) {
            numbers.clear();
            numbers.resize(rows.len() * LANES, 0.0);
            for (row, to) in rows.iter().zip(numbers.as_chunks_mut().0) {
                self.numbers(*input, rays, &local, row, to);
            }
        }
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

    /// A number of a row of samples, in local space.
    #[inline(always)]
    fn numbers(&self, input: Input, rays: Rays<'_>, local: &Vectors, row: &Row, to: &mut [f32; LANES]) {
        let mut t = row.t;
        if self.of_segments {
            let end = if input.sample == 0 { -0.5 } else { 0.5 };
            t.iter_mut().zip(row.length).for_each(|(t, length)| *t += end * length);
        }
        match input.field {
            Field::Position(a) => {
                let (from, along) = (&local[usize::from(a)], &rays.bundle.direction[usize::from(a)]);
                (0..LANES).for_each(|l| to[l] = (from[l] + along[l] * t[l]) as f32);
            }
            Field::Direction(a) => *to = rays.bundle.direction[usize::from(a)].map(|d| d as f32),
            Field::View(a) => *to = rays.bundle.direction[usize::from(a)].map(|d| -d as f32),
            Field::Step => *to = row.length.map(|length| length as f32),
            Field::Depth => *to = t.map(|t| (t - rays.bundle.depth_zero) as f32),
            Field::Value => *to = row.value,
            Field::Attribute(p) => self.attribute(rays, (p, self.component), &t, row, to),
            Field::AttributeComponent(p, c) => self.attribute(rays, (p, usize::from(c)), &t, row, to),
        }
        if row.live != crate::fast::walk::ALL {
            let numbers = *to;
            *to = row.lanes().map(|l| numbers[l]);
        }
    }

    fn attribute(
        &self,
        rays: Rays<'_>,
        (parameter, component): (usize, usize),
        t: &Lanes,
        row: &Row,
        to: &mut [f32; LANES],
    ) {
        let attribute = self.attributes.get(parameter).copied().flatten().filter(|a| component < a.components);
        let (Some(attribute), Some(trail)) = (attribute, rays.trail) else { return to.fill(0.0) };
        for l in (0..LANES).filter(|l| row.live >> l & 1 == 1) {
            to[l] = trail.number(l, t[l], |vertex| attribute.value(vertex, component)) as f32;
        }
    }
}
