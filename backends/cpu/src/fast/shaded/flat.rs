//! A shape composited by maximum, minimum, average or add: its program's values along a ray, then
//! its colour, once.

use volact_core::{ActionError, Compositing, resolve::ResolvedShape};
use volact_shaders::Entry;

use super::{
    Shader,
    batch::{Evaluator, ROWS, Rays, Worker},
    rows::Row,
};
use crate::fast::{
    packet::{Lanes, Packet},
    simd::{LANES, Unit},
    walk::Counts,
};

/// The program of such a shape.
#[derive(Debug)]
pub struct Flattened<'a> {
    value: Evaluator<'a>,
    shade: Evaluator<'a>,
    compositing: Compositing,
    step: f64,
    /// What sums of values over lengths are divided by.
    unit: f64,
}

/// What came of a ray: a value, and the length that it holds for.
#[derive(Clone, Copy, Debug, Default)]
struct Reduced {
    value: f64,
    length: f64,
}

impl<'a> Flattened<'a> {
    /// A shape of which the program was compiled; `None` if it has no values.
    pub fn new(shape: &'a ResolvedShape, shader: &'a Shader, step: f64, unit: Unit) -> Option<Self> {
        Some(Self {
            value: Evaluator::new(shape, shader, (Entry::Value, shader.value.as_ref()?), unit),
            shade: Evaluator::new(shape, shader, (Entry::Shade, &shader.shade), unit),
            compositing: shape.compositing(),
            step,
            unit: shape.float("unit_distance").unwrap_or(1.0),
        })
    }

    /// The first failure of the program.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        self.value.check()?;
        self.shade.check()
    }

    /// Premultiplied colours of sixteen rays that pass through stretches; `None` for those that met
    /// no value.
    pub fn draw<'r>(
        &self,
        rays: Rays<'_>,
        stretches: impl Iterator<Item = &'r Packet>,
        counts: &mut Counts,
    ) -> [Option<[f32; 4]>; LANES] {
        let mut reduced = [Reduced::default(); LANES];
        let (mut enters, mut inside) = ([f64::INFINITY; LANES], [0.0; LANES]);
        self.value.with(|worker| {
            for packet in stretches {
                for l in (0..LANES).filter(|l| packet.active >> l & 1 == 1) {
                    enters[l] = packet.start[l].min(enters[l]);
                    inside[l] += packet.end[l] - packet.start[l];
                }
                self.take(packet, &mut reduced, rays, worker, counts);
            }
            self.evaluate(rays, worker, &mut reduced, counts);
        });
        self.colors(rays, &reduced, (enters, inside))
    }

    /// Takes the segments of one stretch, in their order.
    fn take(
        &self,
        packet: &Packet,
        reduced: &mut [Reduced; LANES],
        rays: Rays<'_>,
        worker: &mut Worker<'a>,
        counts: &mut Counts,
    ) {
        let cuts = packet.split(self.step);
        let mut add = |segments: [[f64; 2]; LANES], worker: &mut Worker<'a>| {
            let live = (0..LANES).fold(0, |w, l| w | u32::from(segments[l][0] < segments[l][1]) << l);
            if live == 0 {
                return;
            }
            if worker.rows.len() == ROWS {
                self.evaluate(rays, worker, reduced, counts);
            }
            worker.rows.push(Row::new(
                0,
                live,
                segments.map(|[a, b]| 0.5 * (a + b)),
                segments.map(|[a, b]| (b - a) as f32),
            ));
        };
        add(cuts.front, worker);
        let [first, last] = cuts.whole().unwrap_or([0, 0]);
        for k in first..last {
            let ends = [k as f64 * self.step, (k + 1) as f64 * self.step];
            let inside = |l: usize| cuts.from[l] <= k as f64 && (k as f64) < cuts.to[l];
            add(std::array::from_fn(|l| if inside(l) { ends } else { [0.0; 2] }), worker);
        }
        add(cuts.back, worker);
    }

    /// Evaluates the rows at hand and takes their values.
    fn evaluate(&self, rays: Rays<'_>, worker: &mut Worker<'a>, reduced: &mut [Reduced; LANES], counts: &mut Counts) {
        if self.value.run(rays, worker) {
            for (row, values) in worker.rows.iter().zip(worker.output(0).as_chunks::<LANES>().0) {
                counts.samples += u64::from(row.live.count_ones());
                counts.lattice += u64::from(row.live.count_ones());
                for l in (0..LANES).filter(|l| row.live >> l & 1 == 1 && !values[*l].is_nan()) {
                    self.merge(&mut reduced[l], f64::from(values[l]), f64::from(row.length(l)));
                }
            }
        }
        worker.rows.clear();
    }

    fn merge(&self, into: &mut Reduced, value: f64, length: f64) {
        let first = into.length == 0.0;
        into.value = match self.compositing {
            Compositing::Maximum | Compositing::Minimum if first => value,
            Compositing::Maximum => into.value.max(value),
            Compositing::Minimum => into.value.min(value),
            _ => into.value + value * length,
        };
        into.length += length;
    }

    /// Asks for the colours once, at the places where rays enter, for the lengths that they are inside.
    fn colors(
        &self,
        rays: Rays<'_>,
        reduced: &[Reduced; LANES],
        (enters, inside): (Lanes, Lanes),
    ) -> [Option<[f32; 4]>; LANES] {
        let live = (0..LANES).fold(0, |w, l| w | u32::from(reduced[l].length > 0.0) << l);
        let mut colors = [None; LANES];
        if live == 0 {
            return colors;
        }
        self.shade.with(|worker| {
            let value = reduced.map(|r| match self.compositing {
                Compositing::Average => r.value / r.length,
                Compositing::Add => r.value / self.unit,
                _ => r.value,
            } as f32);
            worker.rows.push(Row::new(0, live, enters, inside.map(|v| v as f32)).with_value(value));
            if !self.shade.run(rays, worker) {
                return;
            }
            for l in (0..LANES).filter(|l| live >> l & 1 == 1) {
                colors[l] = Some(premultiplied([0, 1, 2, 3].map(|c| worker.output(c)[l])));
            }
        });
        colors
    }
}

/// A medium whose extinction is an opacity, as premultiplied colour; nothing where any of it is NaN.
pub fn premultiplied([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    let a = if a > 0.0 { a.min(1.0) } else { 0.0 };
    let color = [r * a, g * a, b * a, a];
    if a > 0.0 && !color.iter().any(|v| v.is_nan()) { color } else { [0.0; 4] }
}
