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
    carried::{self, Cells, Part},
    flat::{self, Gather},
    hit::{self, Hit},
    lattice::{self, Counting},
    line::{EPS, Lines},
    march::{Light, March},
    mark::{Mark, Stretches},
    medium::Voxels,
    options::{Classification, Method, ReferenceOptions},
    overlap::{self, Along, Track},
    piece::{Cutter, Piece},
    prepare::{Body, GridBody, Prepared, check, prepare},
    sight::Sight,
    slices, surfaces,
};

/// Stretches of a mesh that are no further apart than this part of the distances on the ray are
/// one to a lattice.
const GAP: f64 = 1e-13;

/// All that is drawn, and for whom.
pub(super) struct Scene<'a> {
    frame: &'a FrameDesc,
    options: &'a ReferenceOptions,
    /// In the order of drawing.
    shapes: Vec<Prepared>,
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

/// A shape as a ray meets it.
struct Met<'a> {
    shape: &'a Prepared,
    anchor: f64,
    way: Way<'a>,
}

/// How a ray goes through a body.
enum Way<'a> {
    /// Along stretches of a block.
    Grid(&'a GridBody, Lines),
    /// Through tetrahedra.
    Cells(&'a Cells, carried::Way),
}

/// Where a part of a way begins.
#[derive(Clone, Copy)]
struct Start {
    t: f64,
    mark: Mark,
    dt: f64,
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
        shapes.iter().try_for_each(check)?;
        let mut surfaces: Vec<_> = shapes.iter().filter_map(surfaces::prepare).collect();
        surfaces.sort_by_key(|s| s.id);
        let shapes = prepare(shapes, options)?;
        let colors = shapes.iter().map(|s| s.brightest).chain(surfaces.iter().map(|s| s.brightest()));
        let brightest = colors.fold(1.0, f64::max);
        Ok(Self { frame, options, shapes, surfaces, rays, viewport, limits, brightest })
    }

    /// All rows of the viewport, shared out to threads row by row.
    pub fn rows(&self) -> Vec<Vec<Pixel>> {
        let all = thread::available_parallelism().map_or(1, NonZero::get);
        let threads = if self.options.threads == 0 { all } else { self.options.threads };
        let next = AtomicUsize::new(0);
        let done = Mutex::new(vec![Vec::new(); self.viewport.height]);
        let work = || {
            let mut cutter = Cutter::default();
            loop {
                let y = next.fetch_add(1, Ordering::Relaxed);
                if y >= self.viewport.height {
                    return;
                }
                let row = (0..self.viewport.width).map(|x| self.pixel(x, y, &mut cutter)).collect();
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

    fn pixel(&self, x: usize, y: usize, cutter: &mut Cutter) -> Pixel {
        let ray = self.rays.ray(x as f64 + 0.5, y as f64 + 0.5);
        let (drawn, [darkest, brightest]) = self.drawn_by_application(x, y);
        let range = [darkest, self.brightest + brightest];
        let mut pixel = Pixel { light: Light::NONE, samples: 0, met: false };
        let limit = drawn.map_or(f64::INFINITY, |d| d.mark.t.hi);
        let mut seen = Stretches::between(Mark::exact(ray.near), Mark::exact(ray.far.min(limit)));
        let mut hits = Vec::new();
        self.surfaces.iter().for_each(|s| s.hits(&ray, &self.frame.clip, &seen, &mut hits));
        // Surfaces end what lies behind them, also where it is a picture of its own.
        let end = hits.iter().filter(|h| h.is_opaque()).map(|h| h.mark).min_by(Mark::order);
        if let Some(end) = end {
            seen.keep(Mark::exact(f64::NEG_INFINITY), end);
        }
        let open = hits.iter().any(|h| !h.is_opaque());
        let (mut over, mut flat) = (Vec::new(), Vec::new());
        for shape in &self.shapes {
            let Some(met) = self.meet(shape, &ray, &seen, &mut hits) else { continue };
            if shape.compositing == Compositing::Over { over.push(met) } else { flat.push(met) }
        }
        over.sort_by_key(|m| m.shape.id);
        let mut doubt = Doubt { whole: open && !flat.is_empty(), width: 0.0 };
        over.iter().chain(&flat).for_each(|met| doubt.add(met, range[1]));
        pixel.met = !(hits.is_empty() && over.is_empty() && flat.is_empty());
        over.retain(Met::is_through);
        hits.extend(drawn);
        if !over.is_empty() || !hits.is_empty() {
            (pixel.light, pixel.samples) = self.over(&ray, &over, hit::in_order(hits), range, cutter);
            pixel.light.depth -= ray.depth_zero;
        }
        for met in flat.iter().filter(|m| m.is_through()) {
            let (light, samples) = self.flat(&ray, met);
            pixel.light = flat::over(&light, &pixel.light);
            pixel.samples += samples;
        }
        doubt.widen(&mut pixel.light, range);
        pixel
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

    /// A shape on a ray, where anything of it is left by all that cuts it; and its slices' hits.
    fn meet<'s>(&'s self, shape: &'s Prepared, ray: &Ray, seen: &Stretches, hits: &mut Vec<Hit>) -> Option<Met<'s>> {
        let sight = Sight::new(ray, &shape.to_object, shape.center)?;
        let mut stretches = seen.clone();
        sight.clip(&shape.clip, &self.frame.clip, &mut stretches);
        // A lattice's segments are not cut where rounding parts tetrahedra.
        let gap = if self.options.method == Method::Exact { 0.0 } else { GAP };
        let way = match &shape.body {
            Body::Grid(body) => {
                body.place.crop(&sight, &mut stretches);
                slices::of_grid(shape, body, &sight, &stretches, hits);
                Way::Grid(body, body.place.lines(&sight, &stretches))
            }
            Body::Carved(mesh, body) => {
                body.place.crop(&sight, &mut stretches);
                let inside = mesh.trace(&sight).stretches(gap).meet(&stretches);
                slices::of_grid(shape, body, &sight, &inside, hits);
                Way::Grid(body, body.place.lines(&sight, &inside))
            }
            Body::Cells(cells) => {
                let way = cells.meet(&shape.medium, &sight, gap, &stretches);
                slices::of_cells(shape, cells, &sight, &way, hits);
                Way::Cells(cells, way)
            }
        };
        let met = Met { shape, anchor: sight.anchor, way };
        let drawn = shape.slices.as_ref().is_none_or(|s| s.volume);
        (drawn && (met.is_through() || met.grazed() > 0.0)).then_some(met)
    }

    fn counting(&self, ray: &Ray) -> Option<Counting> {
        let step = self.options.sample_distance;
        match self.options.method {
            Method::Exact => None,
            Method::Rays => Some(Counting::rays(step)),
            Method::Planes => Some(Counting::planes(step, ray, self.rays.axis(), self.rays.eye())),
        }
    }

    fn flat(&self, ray: &Ray, met: &Met<'_>) -> (Light, u64) {
        let (shape, counting) = (met.shape, self.counting(ray));
        let ends = self.options.classification == Classification::PreIntegrated;
        let (mut gathered, mut samples) = (Gather::NONE, 0);
        match &met.way {
            Way::Grid(body, met) => {
                let voxels = Voxels::new(&body.texture);
                for line in &met.lines {
                    samples += match &counting {
                        None => flat::gather(&mut gathered, &shape.medium, &body.grid, &voxels, line),
                        Some(counting) => lattice::gather(&mut gathered, &shape.medium, &voxels, line, counting, ends),
                    };
                }
            }
            Way::Cells(cells, way) => {
                samples += match &counting {
                    None => way.gather(&mut gathered, cells, &shape.medium),
                    Some(counting) => way.gather_samples(&mut gathered, cells, &shape.medium, counting, ends),
                };
            }
        }
        (gathered.light(shape.compositing, &shape.medium), samples)
    }

    /// The depth-composited shapes of a ray, and hits in order.
    fn over(
        &self,
        ray: &Ray,
        shapes: &[Met<'_>],
        hits: Vec<Hit>,
        range: [f64; 2],
        cutter: &mut Cutter,
    ) -> (Light, u64) {
        let counting = self.counting(ray);
        let mut march = March::new(f64::from(self.frame.depth_threshold), range);
        let first = hits.first().map(|h| h.mark.t.hi).filter(|t| t.is_finite());
        let zero = shapes.first().map(|m| m.anchor).or(first).unwrap_or(0.0);
        if let [met] = shapes
            && met.track_count() == 1
            && hits.is_empty()
        {
            self.pieces(met, 0, counting.as_ref(), cutter, |piece, _| march.advance(std::slice::from_ref(piece)));
        } else {
            let mut along = self.along(shapes, zero, counting.as_ref(), cutter);
            along.add_hits(hits, zero);
            overlap::sweep(&along, &mut march);
        }
        let samples = march.stretches;
        let mut light = march.finish();
        light.depth += zero;
        (light, samples)
    }

    /// Visits the pieces of one of a shape's tracks in order, each with the start of what it is a
    /// piece of, until `visit` says false.
    fn pieces(
        &self,
        met: &Met<'_>,
        track: usize,
        counting: Option<&Counting>,
        cutter: &mut Cutter,
        mut visit: impl FnMut(&Piece, Start) -> bool,
    ) {
        let medium = &met.shape.medium;
        let post = self.options.classification == Classification::Post;
        let mut goes_on = true;
        match &met.way {
            Way::Grid(body, met) => {
                let voxels = Voxels::new(&body.texture);
                for line in &met.lines {
                    let start = Start { t: line.t[0], mark: line.ends[0], dt: line.dt };
                    let mut visit = |piece: &Piece| {
                        goes_on = visit(piece, start);
                        goes_on
                    };
                    match counting {
                        None => body.grid.walk(line, |cell| cutter.cut(medium, &voxels, line, cell, &mut visit)),
                        Some(counting) if post => lattice::post(medium, &voxels, line, counting, &mut visit),
                        Some(counting) => lattice::pre_integrated(medium, &voxels, line, counting, cutter, &mut visit),
                    }
                    if !goes_on {
                        return;
                    }
                }
            }
            Way::Cells(cells, way) => {
                let track = &way.tracks[track];
                let start = |part: &Part| Start { t: part.t[0], mark: part.ends[0], dt: part.dt };
                match (counting, track.first().map(start)) {
                    (None, _) => way.pieces(track, cells, medium, cutter, |piece, part| visit(piece, start(part))),
                    (Some(counting), Some(first)) => {
                        way.samples(track, cells, medium, (counting, !post), cutter, |piece| visit(piece, first));
                    }
                    _ => {}
                }
            }
        }
    }

    /// All shapes' pieces, counted from one zero.
    fn along(&self, shapes: &[Met<'_>], zero: f64, counting: Option<&Counting>, cutter: &mut Cutter) -> Along {
        let mut along = Along::default();
        for met in shapes {
            let shift = met.anchor - zero;
            let around = 8.0 * EPS * (met.anchor.abs() + zero.abs() + shift.abs());
            for number in 0..met.track_count() {
                let mut track = Track::new();
                self.pieces(met, number, counting, cutter, |piece, start| {
                    along.snap = along.snap.max(2.0 * start.dt + around);
                    let entry = (piece.t[0] == start.t).then(|| number_of(&mut along.starts, start.mark));
                    track.push(Piece { t: piece.t.map(|t| t + shift), entry, ..*piece });
                    true
                });
                along.tracks.push(track);
            }
        }
        along
    }
}

/// The number of a place among those that are known already; a new one if it is not the same as
/// any of them.
fn number_of(known: &mut Vec<Mark>, mark: Mark) -> usize {
    let same = |m: &Mark| m.compare(&mark).is_some_and(|order| order.is_eq());
    known.iter().position(same).unwrap_or_else(|| {
        known.push(mark);
        known.len() - 1
    })
}

impl Met<'_> {
    fn is_through(&self) -> bool {
        match &self.way {
            Way::Grid(_, met) => !met.lines.is_empty(),
            Way::Cells(_, way) => !way.tracks.is_empty(),
        }
    }

    /// Tracks whose pieces may overlap.
    fn track_count(&self) -> usize {
        match &self.way {
            Way::Grid(..) => 1,
            Way::Cells(_, way) => way.tracks.len(),
        }
    }

    /// The length of stretches that are too short to be integrated.
    fn grazed(&self) -> f64 {
        match &self.way {
            Way::Grid(_, met) => met.grazed,
            Way::Cells(_, way) => way.grazed,
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
