//! A picture: bands of rows to threads, packets of sixteen rays, and for each packet the shapes
//! that its rays meet.

use std::sync::Mutex;

use volact_core::{
    ActionError, Compositing, Frame, LookupTable, RayGrid, Viewport, camera::LinearRays, lattice::Lattice,
    lifecycle::OpenFrame, resolve::ResolvedShape, table::ResolvedTable,
};

use super::{
    classify::Units,
    dispatch, general,
    options::Settings,
    order,
    over::{self, Pixels},
    packet::{Bundle, Place, SIDE},
    plan::Plan,
    reduce::{self, Reduced},
    resources::{Resources, reduction, voxels},
    simd::LANES,
    walk::Counts,
};

/// A shape composited by maximum, minimum, average or add.
struct Reduction<'a> {
    job: reduce::Job<'a>,
    place: Place,
    units: Units,
    table: ResolvedTable,
    unit: f64,
}

/// A picture to draw.
pub struct Picture<'a> {
    grid: RayGrid,
    rays: LinearRays,
    viewport: Viewport,
    /// The `over` shapes.
    parts: Vec<order::Part<'a>>,
    /// The same, for the plain way.
    layers: Vec<general::Layer<'a>>,
    reductions: Vec<Reduction<'a>>,
    settings: Settings,
    general: bool,
    lattice: Lattice,
    threshold: f32,
}

impl<'a> Picture<'a> {
    /// Puts together what is needed to draw these shapes.
    ///
    /// # Errors
    /// If the camera is unusable.
    pub fn new(
        open: &'a OpenFrame,
        drawn: &[&'a ResolvedShape],
        resources: &'a Resources,
        settings: &Settings,
        plan: &Plan,
    ) -> Result<Self, ActionError> {
        let viewport = open.desc.viewport();
        let grid = open.desc.camera.rays(&viewport).map_err(volact_core::frame::FrameError::from)?;
        let mut picture = Self {
            rays: grid.linear(),
            grid,
            viewport,
            parts: Vec::new(),
            layers: Vec::new(),
            reductions: Vec::new(),
            settings: *settings,
            general: plan.general,
            lattice: Lattice { step: plan.step },
            threshold: open.desc.depth_threshold,
        };
        let empty = |id| resources.tables(id).and_then(|t| t.empty.as_ref());
        for shape in drawn.iter().copied() {
            if shape.compositing() != Compositing::Over {
                picture.reductions.extend(picture.reduction(shape, resources));
            } else if picture.general {
                picture.layers.extend(general::Layer::new(shape, empty(shape.id)));
            } else {
                picture.parts.extend(picture.part(shape, resources));
            }
        }
        Ok(picture)
    }

    fn part(&self, shape: &'a ResolvedShape, resources: &'a Resources) -> Option<order::Part<'a>> {
        let (texture, tables) = (shape.volume("volume")?, resources.tables(shape.id)?);
        let job = over::Job {
            voxels: voxels(shape, texture).0,
            lattice: self.lattice,
            table: &tables.table,
            pairs: tables.pairs.as_ref(),
            empty: tables.empty.as_ref(),
            termination: self.settings.termination as f32,
            threshold: self.threshold,
        };
        Some(order::Part { job, place: Place::new(shape)? })
    }

    fn reduction(&self, shape: &'a ResolvedShape, resources: &'a Resources) -> Option<Reduction<'a>> {
        let (texture, place) = (shape.volume("volume")?, Place::new(shape)?);
        let (voxels, units) = voxels(shape, texture);
        let skips = self.settings.skipping && !voxels.nearest;
        let job = reduce::Job {
            voxels,
            lattice: self.lattice,
            compositing: reduction(shape, units),
            peaks: resources.peaks(shape).filter(|_| skips),
            range: resources.bounds(shape).and_then(|b| b.range).filter(|_| skips),
            empty: resources.zeros(shape).filter(|_| skips),
        };
        let grey = || LookupTable::grey(texture.range());
        let table = shape.table("lookup_table").cloned().unwrap_or_else(grey).resolve(texture.range());
        let unit = shape.float("unit_distance").unwrap_or(1.0);
        Some(Reduction { job, place, units, table, unit })
    }

    /// Draws into a frame.
    pub fn draw(&self, frame: &mut Frame) -> Counts {
        let Viewport { y, height, .. } = self.viewport;
        let width = frame.width;
        let rows = y * width..(y + height) * width;
        let band = 4 * SIDE;
        let bands = frame.color[rows.clone()].chunks_mut(band * width).zip(frame.depth[rows].chunks_mut(band * width));
        let queue = Mutex::new(bands.enumerate());
        let work = || {
            let mut counts = Counts::default();
            loop {
                let next = queue.lock().unwrap_or_else(|e| e.into_inner()).next();
                let Some((i, (color, depth))) = next else { return counts };
                self.band(i * band, width, color, depth, &mut counts);
            }
        };
        let mut total = Counts::default();
        std::thread::scope(|scope| {
            let others: Vec<_> =
                (1..self.settings.threads.min(height.div_ceil(band))).map(|_| scope.spawn(work)).collect();
            total.add(work());
            for other in others {
                match other.join() {
                    Ok(counts) => total.add(counts),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
        });
        total
    }

    fn band(&self, first: usize, width: usize, color: &mut [[f32; 4]], depth: &mut [f32], counts: &mut Counts) {
        let rows = color.len() / width;
        let size = [self.viewport.width, self.viewport.height];
        for y in (0..rows).step_by(SIDE) {
            for x in (0..self.viewport.width).step_by(SIDE) {
                let bundle = dispatch::bundle(self.settings.unit, &self.rays, [x, first + y], size);
                let mut pixels = Pixels::default();
                counts.rays += u64::from(self.packet(&bundle, &mut pixels, counts).count_ones());
                for l in 0..LANES {
                    let (px, py) = (x + l % SIDE, y + l / SIDE);
                    if px < self.viewport.width && py < rows {
                        let at = py * width + self.viewport.x + px;
                        color[at] = pixels.color[l];
                        depth[at] = (pixels.depth[l] - bundle.depth_zero) as f32;
                    }
                }
            }
        }
    }

    /// Draws sixteen rays; returns those that met something.
    fn packet(&self, bundle: &Bundle, pixels: &mut Pixels, counts: &mut Counts) -> u32 {
        let unit = self.settings.unit;
        let mut met = if self.general {
            (0..LANES).fold(0, |met, l| met | u32::from(self.general(bundle, l, pixels, counts)) << l)
        } else {
            order::draw(unit, &self.parts, bundle, pixels, counts)
        };
        for reduction in &self.reductions {
            let packet = dispatch::aim(unit, bundle, &bundle.span, &reduction.place);
            if packet.active == 0 {
                continue;
            }
            met |= packet.active;
            let mut reduced = [Reduced::default(); LANES];
            dispatch::reduce(unit, &reduction.job, &packet, &mut reduced, counts);
            for (pixel, r) in pixels.color.iter_mut().zip(reduced) {
                if r.length > 0.0 {
                    *pixel = lay_over(*pixel, reduction.classify(r));
                }
            }
        }
        met
    }

    /// Draws one lane the plain way; whether it met anything.
    fn general(&self, bundle: &Bundle, l: usize, pixels: &mut Pixels, counts: &mut Counts) -> bool {
        if bundle.span.active >> l & 1 == 0 {
            return false;
        }
        let [x, y] = [bundle.pixel[0] + l % SIDE, bundle.pixel[1] + l / SIDE];
        let ray = self.grid.ray(x as f64 + 0.5, y as f64 + 0.5);
        let (end, threshold) = (self.settings.termination, f64::from(self.threshold));
        let before = counts.rays;
        let result = general::draw(&self.layers, &ray, &self.lattice, end, threshold, counts);
        let met = counts.rays > before;
        counts.rays = before;
        pixels.color[l] = result.color.map(|v| v as f32);
        pixels.depth[l] = result.depth;
        met
    }
}

impl Reduction<'_> {
    /// Premultiplied colour of a reduced ray.
    fn classify(&self, reduced: Reduced) -> [f32; 4] {
        let units = self.units;
        let value = match self.job.compositing {
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
