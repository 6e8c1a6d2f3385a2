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

use super::{
    Lit, Shader,
    field::{self, Places},
    rows::{Row, Rows, lanes},
    skip,
    surroundings::{self, Surroundings},
    trail::Trail,
};
use crate::fast::{
    dispatch,
    packet::{Bundle, Lanes},
    simd::{LANES, Unit},
    walk::ALL,
};

/// Rows of sixteen samples in a batch.
pub const ROWS: usize = BATCH / LANES;

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
    /// The volumes of which values at samples' own positions are wanted, by input.
    values: Vec<Option<field::Field<'a>>>,
    /// The input that rows bring with them.
    brought: Option<usize>,
    /// What computes the same without the program, where a mesh carries nothing along.
    lit: Option<Native<'a>>,
    /// Whether it is a function of both ends of a segment.
    of_segments: bool,
    unit: Unit,
    /// Those that no thread uses at the moment.
    workers: Mutex<Vec<Worker<'a>>>,
    failed: OnceLock<Overrun>,
}

/// What needs only positions and one volume's values: by input.
#[derive(Debug)]
struct Native<'a> {
    lit: Lit<'a>,
    places: [usize; 3],
    value: usize,
}

/// What a thread needs to evaluate batches.
#[derive(Debug)]
pub struct Worker<'a> {
    machine: Machine<'a, f32>,
    /// What was computed without the machine, where that was done last.
    media: [Vec<f32>; 4],
    natively: bool,
    /// The batch.
    pub rows: Rows,
    /// Positions, of those that values of volumes are wanted at.
    places: [Vec<f32>; 3],
    maps: Vec<DAffine3>,
    /// Opacities of the rows that were composited last.
    pub alphas: Vec<[f32; LANES]>,
    /// Lanes that count, and lengths, of rows that are composited.
    pub strips: (Vec<u32>, Vec<[f32; LANES]>),
    /// Room for what a walk finds.
    pub found: Option<Box<skip::Rows>>,
}

impl Worker<'_> {
    /// The numbers that the last batch gave, sixteen a row.
    pub fn output(&self, index: usize) -> &[f32] {
        if self.natively { &self.media[index] } else { self.machine.output(index) }
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
        let surroundings = Surroundings::new(shape, shader, kernel.functions(), unit);
        let inputs: Vec<Input> = kernel.inputs().collect();
        let value = |input: &Input| match input.field {
            Field::Volume(p) => surroundings::value(shape, shader, p, unit),
            _ => None,
        };
        Self {
            shape,
            kernel,
            values: inputs.iter().map(value).collect(),
            brought: None,
            lit: None,
            inputs,
            origin: shader.origin,
            surroundings,
            attributes: parameters.iter().map(|p| attribute(&p.name)).collect(),
            component: super::component(shape),
            of_segments: entry == Entry::Segment,
            unit,
            workers: Mutex::default(),
            failed: OnceLock::new(),
        }
    }

    /// Told that rows may bring the value of the shape's first volume with them.
    pub fn with_values_of(mut self, name: &str) -> Self {
        let parameters = &self.shape.shader.declaration.parameters;
        let named = |p: usize| parameters.get(p).is_some_and(|p| p.name == name);
        self.brought = self.inputs.iter().position(|i| matches!(i.field, Field::Volume(p) if named(p)));
        self
    }

    /// Told that the program is that of `gradient`.
    pub fn lit(mut self, shader: &'a Shader) -> Self {
        let at = |field: Field| self.inputs.iter().position(|input| *input == Input { sample: 0, field });
        let place = |axis| at(Field::Position(axis));
        self.lit = self.native(shader, [place(0), place(1), place(2)]);
        self
    }

    fn native(&self, shader: &'a Shader, places: [Option<usize>; 3]) -> Option<Native<'a>> {
        let value = self.inputs.iter().position(|input| matches!(input.field, Field::Volume(_)))?;
        let Field::Volume(parameter) = self.inputs[value].field else { return None };
        let field = surroundings::value(self.shape, shader, parameter, self.unit)?;
        let lit = Lit::new(self.shape, field, shader.lookup("lookup_table")?, self.origin)?;
        let [x, y, z] = places;
        Some(Native { lit, places: [x?, y?, z?], value })
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
            media: [const { Vec::new() }; 4],
            natively: false,
            rows: Rows::default(),
            places: [const { Vec::new() }; 3],
            maps: Vec::new(),
            alphas: vec![[0.0; LANES]; ROWS],
            strips: (Vec::new(), Vec::new()),
            found: None,
        });
        worker.rows.clear();
        let result = work(&mut worker);
        free().push(worker);
        result
    }

    /// Evaluates a worker's rows; `false` where nothing came of it, since the program failed or
    /// there are none.
    pub fn run(&self, rays: Rays<'_>, worker: &mut Worker<'a>) -> bool {
        let Worker { machine, media, natively, rows, places, maps, .. } = worker;
        if rows.is_empty() || self.failed.get().is_some() {
            return false;
        }
        maps.clear();
        if let Some(trail) = rays.trail.filter(|trail| trail.is_bent()) {
            for row in rows.iter() {
                maps.extend(row.lanes().map(|l| trail.map(l, row.t(l), self.origin)));
            }
        }
        let local = rays.bundle.local(self.origin);
        let lines = std::array::from_fn(|a| [&local[a], &rays.bundle.direction[a]]);
        let native = self.lit.as_ref().filter(|_| maps.is_empty());
        *natively = native.is_some();
        // Positions come as three inputs in a row, or fewer where some are not wanted.
        let mut at = 0;
        while let Some(input) = self.inputs.get(at) {
            let shift = self.shift(*input);
            let position = |n: usize| {
                matches!(self.inputs.get(at + n), Some(Input { field: Field::Position(a), sample })
                if *sample == input.sample && usize::from(*a) == n)
            };
            if position(0) && position(1) && position(2) {
                if let Some(to) = machine.inputs([at, at + 1, at + 2]) {
                    dispatch::places(self.unit, &lines, rows, shift, to);
                }
                at += 3;
                continue;
            }
            if let Some([to]) = machine.inputs([at]) {
                match &self.values[at] {
                    Some(field) => {
                        let brought = self.brought == Some(at);
                        self.values(field, (&lines, shift), (rows, maps), brought, places, to);
                    }
                    None => {
                        let wanted = rows.iter().filter(|_| native.is_none());
                        for (row, to) in wanted.zip(to.as_chunks_mut().0) {
                            self.numbers(*input, rays, shift, row, to);
                        }
                    }
                }
            }
            at += 1;
        }
        self.idle(rows, machine);
        if let Some(Native { lit, places: [x, y, z], value }) = native {
            let samples = rows.len() * LANES;
            media.iter_mut().for_each(|row| row.resize(samples, 0.0));
            if let Some([x, y, z, values]) = machine.inputs([*x, *y, *z, *value]) {
                let places = [&x[..samples], &y[..samples], &z[..samples]];
                dispatch::lit(self.unit, lit, &values[..samples], places, &rays.bundle.direction, media);
            }
            return true;
        }
        let mut asked = self.surroundings.asked(maps);
        let result = machine.run_in_place(rows.len() * LANES, &mut asked);
        // The first one is told; which one that is does not matter.
        result.map_err(|overrun| self.failed.set(overrun)).is_ok()
    }

    /// Whether all that it needs of samples is what a walk finds.
    pub fn needs_only_values(&self) -> bool {
        self.inputs.len() == 1 && self.brought == Some(0) && self.lit.is_none()
    }

    /// Evaluates rows that a walk found; as [`run`](Self::run). Only of those that
    /// [need only values](Self::needs_only_values).
    pub fn run_found(&self, found: &skip::Rows, worker: &mut Worker<'a>) -> bool {
        let (live, values) = found.parts();
        let Some([to]) = worker.machine.inputs([0]).filter(|_| self.failed.get().is_none()) else { return false };
        to[..values.len() * LANES].copy_from_slice(values.as_flattened());
        for (live, to) in live.iter().zip(to.as_chunks_mut::<LANES>().0).filter(|(live, _)| **live != ALL) {
            let numbers = *to;
            *to = lanes(*live).map(|l| numbers[l]);
        }
        worker.natively = false;
        let result = worker.machine.run_in_place(values.len() * LANES, &mut self.surroundings.asked(&[]));
        result.map_err(|overrun| self.failed.set(overrun)).is_ok()
    }

    /// Values of a volume at rows of samples, as far as they do not bring them.
    fn values(
        &self,
        field: &field::Field<'_>,
        (lines, shift): (&[[&Lanes; 2]; 3], f64),
        (rows, maps): (&[Row], &[DAffine3]),
        brought: bool,
        places: &mut [Vec<f32>; 3],
        to: &mut [f32],
    ) {
        let mut first = 0;
        for some in rows.chunk_by(|a, b| (brought && a.fetched) == (brought && b.fetched)) {
            let (numbers, begin) = (some.len() * LANES, first * LANES);
            let to = &mut to[begin..begin + numbers];
            if brought && some[0].fetched {
                some.iter().zip(to.as_chunks_mut::<LANES>().0).for_each(|(row, to)| *to = row.value);
            } else {
                places.iter_mut().for_each(|row| row.resize(numbers.max(row.len()), 0.0));
                dispatch::places(self.unit, lines, some, shift, places.each_mut().map(|row| &mut row[..numbers]));
                let p = places.each_ref().map(|row| &row[..numbers]);
                let maps = maps.get(begin..begin + numbers).unwrap_or_default();
                field.values(Places { p: &p, maps }, to);
            }
            first += some.len();
        }
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
    fn idle(&self, rows: &[Row], machine: &mut Machine<'a, f32>) {
        for (i, row) in rows.iter().enumerate().filter(|(_, row)| row.live != ALL) {
            let lanes = row.lanes();
            for input in 0..self.inputs.len() {
                let Some([numbers]) = machine.inputs([input]) else { continue };
                if let Some(to) = numbers.as_chunks_mut::<LANES>().0.get_mut(i) {
                    let numbers = *to;
                    *to = lanes.map(|l| numbers[l]);
                }
            }
        }
    }

    /// A number of a row of samples.
    fn numbers(&self, input: Input, rays: Rays<'_>, shift: f64, row: &Row, to: &mut [f32; LANES]) {
        let at = |l: usize| row.t(l) + shift * f64::from(row.length(l));
        match input.field {
            Field::Position(a) => {
                let (a, eye) = (usize::from(a), self.origin[usize::from(a)]);
                let (from, along) = (&rays.bundle.origin[a], &rays.bundle.direction[a]);
                (0..LANES).for_each(|l| to[l] = (from[l] - eye + along[l] * at(l)) as f32);
            }
            Field::Direction(a) => *to = rays.bundle.direction[usize::from(a)].map(|d| d as f32),
            Field::View(a) => *to = rays.bundle.direction[usize::from(a)].map(|d| -d as f32),
            Field::Step => *to = row.lengths(),
            Field::Depth => (0..LANES).for_each(|l| to[l] = (at(l) - rays.bundle.depth_zero) as f32),
            Field::Value if row.fetched => to.fill(0.0),
            Field::Value => *to = row.value,
            // One that was left out.
            Field::Volume(_) => to.fill(0.0),
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
