//! Rays through all shapes: stretches found, integrated, put together; shared out to threads.

use std::{
    num::NonZero,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use volact_core::{
    ActionError, Compositing, FrameDesc, Ray, RayGrid, Viewport, frame::FrameError, resolve::ResolvedShape,
};

use super::{
    flat,
    hit::{self, Hit},
    lattice::Counting,
    march::{Light, March},
    mark::{Mark, Stretches},
    met::{self, Met, Sampling},
    options::{Classification, Method, ReferenceOptions},
    overlap,
    piece::Cutter,
    prepare::{Prepared, Ready, check_with, prepare},
    source::{self, Asker},
    surfaces,
};

/// All that is drawn, and for whom.
pub(super) struct Scene<'a> {
    frame: &'a FrameDesc,
    options: &'a ReferenceOptions,
    /// In the order of drawing.
    shapes: Vec<Prepared>,
    sources: Vec<source::Prepared>,
    surfaces: Vec<surfaces::Prepared>,
    rays: RayGrid,
    viewport: Viewport,
    /// Where rays end, pixel by pixel, if something opaque was given.
    limits: Option<Vec<f64>>,
    /// The highest number of any colour channel of anything.
    brightest: f64,
}

/// What came of one ray.
#[derive(Clone, Copy)]
pub(super) struct Pixel {
    pub light: Light,
    pub samples: u64,
    pub met: bool,
}

/// What a thread keeps from ray to ray.
struct Tools<'s> {
    cutter: Cutter,
    /// One for each shape with a program.
    askers: Vec<Asker<'s>>,
}

/// A shape that is one picture, on a ray.
enum Flat<'a> {
    Table(Met<'a>),
    /// With its number among the shapes with a program.
    Source(usize, source::Met<'a>),
}

/// The depth-composited shapes of a ray, and hits in order.
struct Shapes<'r, 'a> {
    tables: &'r [Met<'a>],
    sources: &'r [(usize, source::Met<'a>)],
    hits: Vec<Hit>,
}

/// What rounding leaves open.
#[derive(Clone, Copy, Default)]
struct Doubt {
    /// All of the pixel.
    whole: bool,
    /// No more than this in each channel.
    width: f64,
}

impl<'a> Scene<'a> {
    /// Makes shapes ready for a frame.
    ///
    /// # Errors
    /// If the camera cannot be, a shape is refused, or a lattice is too fine.
    pub fn new(
        shapes: &[ResolvedShape],
        frame: &'a FrameDesc,
        options: &'a ReferenceOptions,
    ) -> Result<Self, ActionError> {
        let viewport = frame.viewport();
        let rays = frame.camera.rays(&viewport).map_err(FrameError::from)?;
        let limits = frame.opaque.as_ref().map(|o| o.limits(&rays, &viewport, frame.width));
        shapes.iter().try_for_each(|shape| check_with(shape, options.recognise))?;
        let mut surfaces: Vec<_> = shapes.iter().filter_map(surfaces::prepare).collect();
        surfaces.sort_by_key(|s| s.id);
        let Ready { shapes, sources } = prepare(shapes, options)?;
        let colors = shapes.iter().map(|s| s.brightest).chain(surfaces.iter().map(|s| s.brightest()));
        let brightest = colors.fold(1.0, f64::max);
        Ok(Self { frame, options, shapes, sources, surfaces, rays, viewport, limits, brightest })
    }

    /// All rows of the viewport, shared out to threads row by row.
    pub fn rows(&self) -> Vec<Vec<Pixel>> {
        let all = thread::available_parallelism().map_or(1, NonZero::get);
        let threads = if self.options.threads == 0 { all } else { self.options.threads };
        let next = AtomicUsize::new(0);
        let done = Mutex::new(vec![Vec::new(); self.viewport.height]);
        let work = || {
            let mut tools = Tools::new(&self.sources);
            loop {
                let y = next.fetch_add(1, Ordering::Relaxed);
                if y >= self.viewport.height {
                    return;
                }
                let row = (0..self.viewport.width).map(|x| self.pixel(x, y, &mut tools)).collect();
                done.lock().unwrap_or_else(|e| e.into_inner())[y] = row;
            }
        };
        thread::scope(|scope| {
            for _ in 1..threads.min(self.viewport.height) {
                scope.spawn(work);
            }
            work();
        });
        done.into_inner().unwrap_or_else(|e| e.into_inner())
    }

    fn pixel(&self, x: usize, y: usize, tools: &mut Tools<'_>) -> Pixel {
        let ray = self.rays.ray(x as f64 + 0.5, y as f64 + 0.5);
        let (drawn, [darkest, brightest]) = self.drawn_by_application(x, y);
        let mut range = [darkest, self.brightest + brightest];
        let mut pixel = Pixel { light: Light::NONE, samples: 0, met: false };
        let limit = drawn.map_or(f64::INFINITY, |d| d.mark.t.hi);
        let mut seen = Stretches::between(Mark::exact(ray.near), Mark::exact(ray.far.min(limit)));
        let (mut hits, sampling) = (Vec::new(), self.sampling(&ray));
        self.surfaces.iter().for_each(|s| s.hits(&ray, &self.frame.clip, &seen, &mut hits));
        // Surfaces end what lies behind them, also where it is a picture of its own.
        let end = hits.iter().filter(|h| h.is_opaque()).map(|h| h.mark).min_by(Mark::order);
        if let Some(end) = end {
            seen.keep(Mark::exact(f64::NEG_INFINITY), end);
        }
        let open = hits.iter().any(|h| !h.is_opaque());
        let (mut over, mut flat) = (Vec::new(), Vec::new());
        for shape in &self.shapes {
            let Some(met) = Met::new(shape, &ray, &self.frame.clip, &sampling, &seen, &mut hits) else { continue };
            if shape.compositing == Compositing::Over { over.push(met) } else { flat.push(Flat::Table(met)) }
        }
        let mut sources = self.meet_sources(&ray, &sampling, &seen, tools, &mut hits);
        flat.extend(sources.extract_if(.., |(_, met)| met.is_flat()).map(|(i, met)| Flat::Source(i, met)));
        flat.sort_by_key(Flat::order);
        over.sort_by_key(|m| m.shape.id);
        sources.sort_by_key(|(_, m)| m.shape.id);
        hits.iter().for_each(|hit| hit.widen(&mut range));
        let mut doubt = Doubt { whole: open && !flat.is_empty(), width: 0.0 };
        over.iter().for_each(|met| doubt.add(met, range[1]));
        sources.iter().for_each(|(_, met)| doubt.whole |= met.grazed > 0.0);
        flat.iter().for_each(|flat| flat.doubt(&mut doubt, range[1]));
        pixel.met = !(hits.is_empty() && over.is_empty() && sources.is_empty() && flat.is_empty());
        over.retain(Met::is_through);
        hits.extend(drawn);
        if !over.is_empty() || !sources.is_empty() || !hits.is_empty() {
            let shapes = Shapes { tables: &over, sources: &sources, hits: hit::in_order(hits) };
            (pixel.light, pixel.samples) = self.over(&sampling, shapes, &mut range, tools);
            pixel.light.depth -= ray.depth_zero;
        }
        for flat in &flat {
            let (light, samples) = flat.light(&sampling, self.options.tolerance, tools);
            pixel.light = flat::over(&light, &pixel.light);
            pixel.samples += samples;
        }
        pixel.samples += tools.samples();
        doubt.widen(&mut pixel.light, range);
        pixel
    }

    /// Shapes with a program, with their numbers; slices and surfaces of theirs go to `hits`.
    fn meet_sources(
        &self,
        ray: &Ray,
        sampling: &Sampling,
        seen: &Stretches,
        tools: &mut Tools<'_>,
        hits: &mut Vec<Hit>,
    ) -> Vec<(usize, source::Met<'_>)> {
        let mut all = Vec::new();
        for (number, shape) in self.sources.iter().enumerate() {
            let means = (&mut tools.askers[number], &mut *hits);
            all.extend(source::Met::new(shape, ray, &self.frame.clip, sampling, seen, means).map(|met| (number, met)));
        }
        all
    }

    /// The first failure of any program.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        self.sources.iter().try_for_each(|shape| shape.source.check())
    }

    /// The names of shapes with a program.
    pub fn estimated(&self) -> Vec<String> {
        self.sources.iter().map(|shape| shape.source.shape().to_owned()).collect()
    }

    /// What the application has drawn at a pixel of the viewport, and what its colour takes the
    /// lowest and highest number of all colours beyond 0 and what they are.
    fn drawn_by_application(&self, x: usize, y: usize) -> (Option<Hit>, [f64; 2]) {
        let (Some(opaque), Some(limits)) = (&self.frame.opaque, &self.limits) else { return (None, [0.0; 2]) };
        let Viewport { x: left, y: top, width, .. } = self.viewport;
        let [r, g, b, a] = opaque.color_at((top + y) * self.frame.width + left + x).map(f64::from);
        let mark = Mark::exact(limits[y * width + x]);
        let hit = Hit { mark, light: [r, g, b].map(|c| [c; 2]), alpha: [a.clamp(0.0, 1.0); 2] };
        let (lowest, highest) = (r.min(g).min(b), r.max(g).max(b));
        // Premultiplied colours up to the opacity are no brighter than white.
        (Some(hit), [lowest.min(0.0), if highest <= a { 0.0 } else { highest.max(0.0) }])
    }

    fn sampling(&self, ray: &Ray) -> Sampling {
        let step = self.options.sample_distance;
        let counting = match self.options.method {
            Method::Exact => None,
            Method::Rays => Some(Counting::rays(step)),
            Method::Planes => Some(Counting::planes(step, ray, self.rays.axis(), self.rays.eye())),
        };
        Sampling { counting, between_ends: self.options.classification == Classification::PreIntegrated }
    }

    /// What depth-composited shapes and hits show; `range` is widened by the colours of programs.
    fn over(
        &self,
        sampling: &Sampling,
        Shapes { tables, sources, hits }: Shapes<'_, '_>,
        range: &mut [f64; 2],
        tools: &mut Tools<'_>,
    ) -> (Light, u64) {
        let first = hits.first().map(|h| h.mark.t.hi).filter(|t| t.is_finite());
        let anchors = tables.iter().map(|m| m.anchor).chain(sources.iter().map(|(_, m)| m.anchor));
        let zero = anchors.chain(first).next().unwrap_or(0.0);
        let threshold = f64::from(self.frame.depth_threshold);
        let mut march = March::new(threshold, *range);
        let alone = tables.len() + sources.len() == 1 && hits.is_empty();
        if let ([met], true) = (tables, alone)
            && met.track_count() == 1
        {
            met.pieces(0, sampling, &mut tools.cutter, |piece, _| march.advance(std::slice::from_ref(piece)));
        } else {
            let mut along = met::along(tables, zero, sampling, &mut tools.cutter);
            for (number, met) in sources {
                let asker = &mut tools.askers[*number];
                met.add_to(&mut along, zero, sampling, self.options.tolerance, asker, range);
            }
            march = March::new(threshold, *range);
            if let ([track], true) = (&along.tracks[..], alone) {
                track.iter().all(|piece| march.advance(std::slice::from_ref(piece)));
            } else {
                along.add_hits(hits, zero);
                overlap::sweep(&along, &mut march);
            }
        }
        let samples = march.stretches;
        let mut light = march.finish();
        light.depth += zero;
        (light, samples)
    }
}

impl<'s> Tools<'s> {
    fn new(sources: &'s [source::Prepared]) -> Self {
        Self { cutter: Cutter::default(), askers: sources.iter().map(|s| Asker::new(&s.source)).collect() }
    }

    /// The samples evaluated since this was asked last.
    fn samples(&mut self) -> u64 {
        self.askers.iter_mut().map(|asker| std::mem::take(&mut asker.samples)).sum()
    }
}

impl Flat<'_> {
    fn order(&self) -> usize {
        match self {
            Self::Table(met) => met.shape.order,
            Self::Source(_, met) => met.shape.order,
        }
    }

    fn doubt(&self, doubt: &mut Doubt, brightest: f64) {
        match self {
            Self::Table(met) => doubt.add(met, brightest),
            Self::Source(_, met) => doubt.whole |= met.grazed > 0.0,
        }
    }

    /// What it shows, and how many cells or samples that took.
    fn light(&self, sampling: &Sampling, tolerance: f64, tools: &mut Tools<'_>) -> (Light, u64) {
        match self {
            Self::Table(met) if !met.is_through() => (Light::NONE, 0),
            Self::Table(met) => {
                let (gathered, samples) = met.gather(sampling);
                (gathered.light(met.shape.compositing, &met.shape.medium), samples)
            }
            Self::Source(number, met) => (met.light(sampling, tolerance, &mut tools.askers[*number]), 0),
        }
    }
}

impl Doubt {
    /// Counts what short stretches may show: of a depth τ at most τ times the brightest, behind
    /// and before them.
    fn add(&mut self, met: &Met<'_>, brightest: f64) {
        let (shape, length) = (met.shape, met.grazed());
        if length > 0.0 {
            let thin = shape.compositing == Compositing::Over && shape.max_opacity < 1.0;
            self.whole |= !thin;
            self.width += -(-shape.max_opacity).ln_1p() * length / shape.medium.unit * brightest * 1.01;
        }
    }

    fn widen(&self, light: &mut Light, [darkest, brightest]: [f64; 2]) {
        if self.whole || self.width >= brightest {
            light.lower = [darkest, darkest, darkest, 0.0];
            light.upper = [brightest, brightest, brightest, 1.0];
        } else if self.width > 0.0 {
            let [color @ .., alpha] = &mut light.lower;
            color.iter_mut().for_each(|v| *v = (*v - self.width).max(darkest));
            *alpha = (*alpha - self.width).max(0.0);
            light.upper.iter_mut().for_each(|v| *v += self.width);
            light.upper[3] = light.upper[3].min(1.0);
        }
    }
}
