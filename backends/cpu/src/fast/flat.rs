//! Shapes that are one picture each: composited by maximum, minimum, average or add.

use volact_core::{
    ActionError, Clip, Compositing, LookupTable, lattice::Lattice, mutated, resolve::ResolvedShape,
    table::ResolvedTable,
};

use super::{
    bent::{Bent, local},
    classify::Units,
    dispatch,
    options::Settings,
    over::Pixels,
    packet::{Bundle, Packet, Span},
    part::Region,
    reduce::{self, Reduced},
    resources::{Resources, reduction, voxels},
    shaded::{self, Flattened},
    simd::{LANES, Unit},
    walk::Counts,
};

/// A shape composited by maximum, minimum, average or add.
#[derive(Debug)]
pub enum Flat<'a> {
    /// Drawn by a kernel.
    Voxels(Box<Reduction<'a>>),
    /// By evaluating its shader's source.
    Program(Box<(Region<'a>, Flattened<'a>)>),
}

impl<'a> Flat<'a> {
    /// A resolved shape; `None` where nothing of it can be seen.
    pub fn new(
        shape: &'a ResolvedShape,
        scene: &'a Clip,
        resources: &'a Resources,
        settings: &Settings,
        lattice: Lattice,
    ) -> Option<Self> {
        if shaded::wanted(shape) {
            let region = Region::new(shape, scene, resources)?;
            let program = Flattened::new(shape, resources.shader(shape.id)?, lattice.step, settings.unit)?;
            return Some(Self::Program(Box::new((region, program))));
        }
        Some(Self::Voxels(Box::new(Reduction::new(shape, scene, resources, settings, lattice)?)))
    }

    /// The first failure of its program.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        match self {
            Self::Voxels(_) => Ok(()),
            Self::Program(program) => program.1.check(),
        }
    }

    /// Lays its picture over what sixteen rays have seen; returns those that met it.
    pub fn draw(&self, unit: Unit, bundle: &Bundle, span: &Span, pixels: &mut Pixels, counts: &mut Counts) -> u32 {
        let (region, program) = match self {
            Self::Voxels(reduction) => return reduction.draw(unit, bundle, span, pixels, counts),
            Self::Program(program) => (&program.0, &program.1),
        };
        let Some(aimed) = region.aim(unit, bundle, span) else { return 0 };
        let colors = program.draw(aimed.rays(bundle), aimed.packets().iter(), counts);
        for (pixel, color) in pixels.color.iter_mut().zip(colors) {
            if let Some(color) = color {
                *pixel = lay_over(*pixel, color);
            }
        }
        aimed.stretches.active()
    }
}

/// The voxels of such a shape.
#[derive(Debug)]
pub struct Reduction<'a> {
    job: reduce::Job<'a>,
    region: Region<'a>,
    units: Units,
    table: ResolvedTable,
    unit: f64,
}

impl<'a> Reduction<'a> {
    fn new(
        shape: &'a ResolvedShape,
        scene: &'a Clip,
        resources: &'a Resources,
        settings: &Settings,
        lattice: Lattice,
    ) -> Option<Self> {
        let texture = shape.volume("volume")?;
        let region = Region::new(shape, scene, resources)?;
        let (voxels, units) = voxels(shape, texture);
        let skips = settings.skipping && !voxels.nearest;
        let job = reduce::Job {
            voxels,
            lattice,
            compositing: reduction(shape, units),
            peaks: resources.peaks(shape).filter(|_| skips),
            range: resources.bounds(shape).and_then(|b| b.range).filter(|_| skips),
            empty: resources.zeros(shape).filter(|_| skips),
        };
        let grey = || LookupTable::grey(texture.range());
        let table = shape.table("lookup_table").cloned().unwrap_or_else(grey).resolve(texture.range());
        let unit = shape.float("unit_distance").unwrap_or(1.0);
        Some(Self { job, region, units, table, unit })
    }

    fn draw(&self, unit: Unit, bundle: &Bundle, span: &Span, pixels: &mut Pixels, counts: &mut Counts) -> u32 {
        let Some(aimed) = self.region.aim(unit, bundle, span) else { return 0 };
        let mut reduced = [Reduced::default(); LANES];
        for span in aimed.stretches.spans() {
            let packet = aimed.packet.within(span);
            match &aimed.bent {
                Some(bent) => self.along(unit, bent, &packet, &mut reduced, counts),
                None => dispatch::reduce(unit, &self.job, &packet, &mut reduced, counts),
            }
        }
        for (pixel, r) in pixels.color.iter_mut().zip(reduced) {
            if r.length > 0.0 {
                *pixel = lay_over(*pixel, self.classify(r));
            }
        }
        aimed.stretches.active()
    }

    /// Reduces rays that are not straight in sample space.
    fn along(&self, unit: Unit, bent: &Bent, packet: &Packet, reduced: &mut [Reduced; LANES], counts: &mut Counts) {
        let step = self.job.lattice.step;
        let cuts = packet.split(step);
        let mut take = |segments: &dyn Fn(usize) -> [f64; 2]| {
            let segments: [[f64; 2]; LANES] = std::array::from_fn(segments);
            let live = (0..LANES).fold(0, |w, l| w | u32::from(segments[l][0] < segments[l][1]) << l);
            if live == 0 {
                return;
            }
            counts.samples += u64::from(live.count_ones());
            counts.lattice += u64::from(live.count_ones());
            let middle = |l: usize| 0.5 * (segments[l][0] + segments[l][1]);
            let (base, local) = local(&self.job.voxels, live, |l| bent.at(l, middle(l)));
            let mut number = [0f32; LANES];
            dispatch::numbers(unit, &self.job.voxels, &base, &local, &mut number);
            for l in (0..LANES).filter(|l| live >> l & 1 == 1) {
                let [start, end] = segments[l];
                reduce::merge(&mut reduced[l], self.job.compositing, number[l], end - start);
            }
        };
        take(&|l| cuts.front[l]);
        let [first, last] = cuts.whole().unwrap_or([0, 0]);
        for k in first..last {
            let inside = |l: usize| cuts.from[l] <= k as f64 && (k as f64) < cuts.to[l];
            take(&|l| if inside(l) { [k as f64 * step, (k + 1) as f64 * step] } else { [0.0; 2] });
        }
        take(&|l| cuts.back[l]);
    }

    /// Premultiplied colour of a reduced ray.
    fn classify(&self, reduced: Reduced) -> [f32; 4] {
        let units = self.units;
        let value = match self.job.compositing {
            Compositing::Add if mutated!("sum_without_unit") => {
                reduced.value * units.scale + units.offset * reduced.length
            }
            Compositing::Average if mutated!("average_without_length") => units.data(reduced.value),
            Compositing::Average => units.data(reduced.value / reduced.length),
            Compositing::Add => (reduced.value * units.scale + units.offset * reduced.length) / self.unit,
            _ => units.data(reduced.value),
        };
        let [r, g, b, a] = self.table.classify(value);
        [r * a, g * a, b * a, a].map(|v| v as f32)
    }
}

/// One picture over another.
fn lay_over(below: [f32; 4], above: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|c| above[c] + (1.0 - above[3]) * below[c])
}
