//! A shape's program, ready to be asked, and the samples that it is asked for.

use std::sync::OnceLock;

use volact_core::{
    ActionError, Compositing, LookupTable, ParameterType, ParameterValue, VolumeTexture,
    glam::{DAffine3, DVec3},
    parameter::ParameterMap,
    resolve::ResolvedShape,
};
use volact_shaders::{
    Entry, Kernel, Machine, Program,
    eval::{BATCH, Field, Function, Input, Overrun, Uniforms},
    plain::Plain,
};

use super::{cuts::Grids, wrong};
use crate::reference::{dd::Dd, line::map_point};

/// Straight colour and extinction.
pub(in crate::reference) type Medium = [f64; 4];

/// A shape's program with the parameters that are the same for every sample.
pub(in crate::reference) struct Source {
    shape: String,
    program: Program,
    shade: Kernel<f64>,
    value: Option<Kernel<f64>>,
    segment: Option<Kernel<f64>>,
    parameters: ParameterMap,
    /// Local to object space, as [`Plain`] takes it: the other way round.
    local: DAffine3,
    /// The point of the world that is the origin of local space.
    pub origin: DVec3,
    pub compositing: Compositing,
    /// World length over which opacity is the fraction absorbed, where the shader declares it.
    pub unit: Option<f64>,
    /// The values whose crossings are surfaces.
    pub crossed: Vec<f64>,
    /// Where the volumes that it reads change their cells.
    pub grids: Grids,
    failed: OnceLock<Overrun>,
}

/// A sample on a course: its place, the length that it stands for, and what a compositing made.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::reference) struct Sample {
    /// Counted from the course's anchor.
    pub t: f64,
    pub step: f64,
    pub value: f64,
}

/// A ray in a shape's local space.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct Course {
    /// Where it is at the anchor.
    pub at: DVec3,
    /// Of length 1.
    pub direction: DVec3,
    /// The anchor's distance from where depth is counted.
    pub depth: f64,
}

impl Course {
    fn number(&self, field: Field, s: &Sample) -> f64 {
        let axis = |a: u8| usize::from(a.min(2));
        match field {
            Field::Position(a) => self.at[axis(a)] + self.direction[axis(a)] * s.t,
            Field::Direction(a) => self.direction[axis(a)],
            Field::View(a) => -self.direction[axis(a)],
            Field::Step => s.step,
            Field::Depth => self.depth + s.t,
            Field::Value => s.value,
            // Shapes with attributes are refused.
            Field::Attribute(_) | Field::AttributeComponent(..) => f64::NAN,
        }
    }
}

impl Source {
    /// Compiles the program of a shape that is not refused.
    ///
    /// # Errors
    /// [`ActionError::Shader`] if it is too large with these parameters.
    pub fn new(shape: &ResolvedShape, program: Program) -> Result<Self, ActionError> {
        let origin = shape.world_block().center();
        let uniforms = Uniforms { parameters: &shape.parameters, object_to_world: shape.state.transform, origin };
        let kernel = |entry| Kernel::<f64>::new(&program, entry, &uniforms).map_err(|error| wrong(shape, error));
        let optional = |entry| program.has(entry).then(|| kernel(entry)).transpose();
        let (shade, value, segment) = (kernel(Entry::Shade)?, optional(Entry::Value)?, optional(Entry::Segment)?);
        // The origin is carried in double-double, so that a distant scene costs no digits.
        let center = map_point(&shape.to_object, origin.to_array().map(Dd::new)).map(|d| d.hi);
        let to_object = DAffine3 { matrix3: shape.to_object.matrix3, translation: DVec3::from_array(center) };
        let functions: Vec<Function> =
            [Some(&shade), value.as_ref()].into_iter().flatten().flat_map(|k| k.functions().to_vec()).collect();
        Ok(Self {
            shape: shape.name.clone(),
            grids: Grids::new(&program, &shape.parameters, &functions, to_object),
            crossed: crossed(shape, &program),
            compositing: program.compositing(),
            unit: program.declaration().parameter("unit_distance").and_then(|_| shape.float("unit_distance")),
            parameters: shape.parameters.clone(),
            local: to_object.inverse(),
            origin,
            program,
            shade,
            value,
            segment,
            failed: OnceLock::new(),
        })
    }

    /// The shape's name.
    pub fn shape(&self) -> &str {
        &self.shape
    }

    /// The first failure of the program, if any sample failed.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        let failed = self.failed.get().map(|overrun| Box::new(overrun.clone()));
        failed.map_or(Ok(()), |source| Err(ActionError::Shader { shape: self.shape.clone(), source }))
    }
}

/// The values of the control points of the first table declared, in rising order.
fn crossed(shape: &ResolvedShape, program: &Program) -> Vec<f64> {
    let declared = &program.declaration().parameters;
    let Some(table) = declared.iter().find(|p| p.types.contains(&ParameterType::Table)) else { return Vec::new() };
    let range = shape.first_volume().map_or([0.0, 1.0], VolumeTexture::range);
    let [a, b] = range;
    let table = match shape.parameters.get(&table.name) {
        Some(ParameterValue::Table(table)) => table.resolve(range),
        _ => LookupTable::grey([a.min(b), a.max(b)]).resolve(range),
    };
    let mut values: Vec<f64> = table.points().iter().map(|p| p.value).filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// A thread's means to ask a program.
pub(in crate::reference) struct Asker<'s> {
    source: &'s Source,
    shade: Runner<'s>,
    value: Option<Runner<'s>>,
    segment: Option<Runner<'s>>,
    /// Samples evaluated.
    pub samples: u64,
}

/// One function of a program.
struct Runner<'s> {
    inputs: Vec<Input>,
    machine: Machine<'s, f64>,
    plain: Plain,
    rows: Vec<Vec<f64>>,
}

impl<'s> Runner<'s> {
    fn new(source: &'s Source, kernel: &'s Kernel<f64>) -> Self {
        let uniforms = Uniforms { parameters: &source.parameters, object_to_world: source.local, origin: DVec3::ZERO };
        let inputs: Vec<Input> = kernel.inputs().collect();
        Self {
            rows: vec![Vec::with_capacity(BATCH); inputs.len()],
            inputs,
            machine: Machine::new(kernel),
            plain: Plain::new(&source.program, kernel, &uniforms),
        }
    }

    /// Evaluates `count` samples, of which `number` gives the numbers; `take` is told each
    /// sample's index and, by output, its numbers.
    fn run<const N: usize>(
        &mut self,
        count: usize,
        number: impl Fn(usize, Input) -> f64,
        mut take: impl FnMut([f64; N]),
    ) -> Result<(), Overrun> {
        for first in (0..count).step_by(BATCH) {
            let batch = first..(first + BATCH).min(count);
            for (input, row) in self.inputs.iter().zip(&mut self.rows) {
                row.clear();
                row.extend(batch.clone().map(|i| number(i, *input)));
            }
            let rows: Vec<&[f64]> = self.rows.iter().map(Vec::as_slice).collect();
            self.machine.run(batch.len(), &rows, &mut self.plain)?;
            (0..batch.len()).for_each(|i| take(std::array::from_fn(|k| self.machine.output(k)[i])));
        }
        Ok(())
    }
}

impl<'s> Asker<'s> {
    /// Means to ask a program.
    pub fn new(source: &'s Source) -> Self {
        let runner = |kernel| Runner::new(source, kernel);
        Self {
            source,
            shade: runner(&source.shade),
            value: source.value.as_ref().map(runner),
            segment: source.segment.as_ref().map(runner),
            samples: 0,
        }
    }

    /// The media at samples; nothing once the program has failed.
    pub fn media(&mut self, course: &Course, samples: &[Sample]) -> Vec<Medium> {
        let mut media = Vec::with_capacity(samples.len());
        self.samples += samples.len() as u64;
        let number = |i: usize, input: Input| course.number(input.field, &samples[i]);
        if self.goes_on() {
            let done = self.shade.run(samples.len(), number, |m: Medium| media.push(clean(m)));
            self.note(done);
        }
        media.resize(samples.len(), [0.0; 4]);
        media
    }

    /// The media of segments by their ends; by their middles where the program has no word on it.
    pub fn segments(&mut self, course: &Course, ends: &[[f64; 2]]) -> Vec<Medium> {
        let goes_on = self.goes_on();
        let Some(runner) = self.segment.as_mut().filter(|_| goes_on) else { return self.middles(course, ends) };
        let sample = |t: f64, [a, b]: [f64; 2]| Sample { t, step: b - a, value: 0.0 };
        let mut media = Vec::with_capacity(ends.len());
        let number = |i: usize, input: Input| {
            let at = ends[i][usize::from(input.sample == 1)];
            course.number(input.field, &sample(at, ends[i]))
        };
        let done = runner.run(ends.len(), number, |m: Medium| media.push(clean(m)));
        self.samples += 2 * ends.len() as u64;
        self.note(done);
        media.resize(ends.len(), [0.0; 4]);
        media
    }

    /// The media in the middles of segments.
    pub fn middles(&mut self, course: &Course, ends: &[[f64; 2]]) -> Vec<Medium> {
        let middle = |[a, b]: &[f64; 2]| Sample { t: 0.5 * (a + b), step: b - a, value: 0.0 };
        self.media(course, &ends.iter().map(middle).collect::<Vec<_>>())
    }

    /// What the compositing takes at samples; NaN where there is nothing.
    pub fn values(&mut self, course: &Course, samples: &[Sample]) -> Vec<f64> {
        let mut values = Vec::with_capacity(samples.len());
        self.samples += samples.len() as u64;
        let number = |i: usize, input: Input| course.number(input.field, &samples[i]);
        let goes_on = self.goes_on();
        if let Some(runner) = self.value.as_mut().filter(|_| goes_on) {
            let done = runner.run(samples.len(), number, |[v]: [f64; 1]| values.push(v));
            self.note(done);
        }
        values.resize(samples.len(), f64::NAN);
        values
    }

    fn goes_on(&self) -> bool {
        self.source.failed.get().is_none()
    }

    /// The first failure is told; which one that is does not matter.
    fn note(&self, done: Result<(), Overrun>) {
        if let Err(overrun) = done {
            let _ = self.source.failed.set(overrun);
        }
    }
}

/// A medium that is one: transparent where anything is no number.
fn clean([r, g, b, extinction]: Medium) -> Medium {
    let usable = r.is_finite() && g.is_finite() && b.is_finite() && extinction > 0.0;
    if usable { [r, g, b, extinction] } else { [0.0; 4] }
}
