//! Programs asked for many samples at once.

use volact_core::glam::{DAffine3, DVec3};
use volact_shaders::{
    Kernel, Machine,
    eval::{BATCH, Input, Overrun, Uniforms},
    plain::Plain,
};

use super::{
    bent::Bent,
    program::{Course, Medium, Sample, Source},
};

/// The extinction from which on nothing is let through: over any length that there is.
const OPAQUE: f64 = 1e100;

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
    kernel: &'s Kernel<f64>,
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
            kernel,
            rows: vec![Vec::with_capacity(BATCH); inputs.len()],
            inputs,
            machine: Machine::new(kernel),
            plain: Plain::new(&source.program, kernel, &uniforms),
        }
    }

    /// Evaluates `count` samples, of which `number` gives the numbers; `take` is told those of each
    /// output in turn. Volumes are read where `bent` and `unbent` take positions.
    fn run<const N: usize>(
        &mut self,
        count: usize,
        (bent, unbent): (Option<DAffine3>, &[Option<DAffine3>]),
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
            match bent {
                None => self.machine.run(batch.len(), &rows, &mut self.plain)?,
                Some(map) => {
                    let mut bent = Bent::new(&mut self.plain, self.kernel.functions(), unbent, map);
                    self.machine.run(batch.len(), &rows, &mut bent)?;
                }
            }
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
    pub fn media(&mut self, course: &Course<'_>, samples: &[Sample]) -> Vec<Medium> {
        self.shades(course, samples).into_iter().map(clean).collect()
    }

    /// The same as the program has it.
    pub fn shades(&mut self, course: &Course<'_>, samples: &[Sample]) -> Vec<Medium> {
        let mut media = Vec::with_capacity(samples.len());
        self.samples += samples.len() as u64;
        for (some, bent) in runs(course, samples) {
            let number = |i: usize, input: Input| course.number(input.field, &some[i]);
            if let (Some(bent), true) = (bent, self.goes_on()) {
                let maps = (bent, self.source.unbent.as_slice());
                let done = self.shade.run(some.len(), maps, number, |m: Medium| media.push(m));
                self.note(done);
            } else {
                media.resize(media.len() + some.len(), [0.0; 4]);
            }
        }
        media.resize(samples.len(), [0.0; 4]);
        media
    }

    /// The media of segments by their ends; by their middles where the program has no word on it, or
    /// where the ends may lie in two tetrahedra.
    pub fn segments(&mut self, course: &Course<'_>, ends: &[[f64; 2]]) -> Vec<Medium> {
        let alone = self.goes_on() && course.cells.is_empty();
        let Some(runner) = self.segment.as_mut().filter(|_| alone) else { return self.middles(course, ends) };
        let sample = |t: f64, [a, b]: [f64; 2]| Sample { t, step: b - a, value: 0.0 };
        let mut media = Vec::with_capacity(ends.len());
        let number = |i: usize, input: Input| {
            let at = ends[i][usize::from(input.sample == 1)];
            course.number(input.field, &sample(at, ends[i]))
        };
        let done = runner.run(ends.len(), (None, &[]), number, |m: Medium| media.push(clean(m)));
        self.samples += 2 * ends.len() as u64;
        self.note(done);
        media.resize(ends.len(), [0.0; 4]);
        media
    }

    /// The media in the middles of segments.
    pub fn middles(&mut self, course: &Course<'_>, ends: &[[f64; 2]]) -> Vec<Medium> {
        let middle = |[a, b]: &[f64; 2]| Sample { t: 0.5 * (a + b), step: b - a, value: 0.0 };
        self.media(course, &ends.iter().map(middle).collect::<Vec<_>>())
    }

    /// What the compositing takes at samples; NaN where there is nothing.
    pub fn values(&mut self, course: &Course<'_>, samples: &[Sample]) -> Vec<f64> {
        let mut values = Vec::with_capacity(samples.len());
        self.samples += samples.len() as u64;
        for (some, bent) in runs(course, samples) {
            let number = |i: usize, input: Input| course.number(input.field, &some[i]);
            let goes_on = self.goes_on();
            if let (Some(runner), Some(bent), true) = (&mut self.value, bent, goes_on) {
                let maps = (bent, self.source.unbent.as_slice());
                let done = runner.run(some.len(), maps, number, |[v]: [f64; 1]| values.push(v));
                self.note(done);
            } else {
                values.resize(values.len() + some.len(), f64::NAN);
            }
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

/// Samples with one map of positions each; without one where no tetrahedron holds them.
fn runs<'a>(
    course: &'a Course<'_>,
    samples: &'a [Sample],
) -> impl Iterator<Item = (&'a [Sample], Option<Option<DAffine3>>)> {
    let map = |s: &Sample| match course.cells {
        [] => Some(None),
        _ => course.cell(s.t).map(|cell| cell.bent),
    };
    samples.chunk_by(move |a, b| course.cells.is_empty() || map(a) == map(b)).map(move |some| (some, map(&some[0])))
}

/// A medium that is one: transparent where anything is no number.
fn clean([r, g, b, extinction]: Medium) -> Medium {
    let usable = r.is_finite() && g.is_finite() && b.is_finite() && extinction > 0.0;
    let extinction = if extinction < OPAQUE { extinction } else { f64::INFINITY };
    if usable { [r, g, b, extinction] } else { [0.0; 4] }
}
