//! From shapes to a picture: rays, threads, and what is certified.

use std::{
    num::NonZero,
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use volact_core::{ActionError, Compositing, FrameDesc, Ray, RayGrid, Viewport, VolumeTexture, resolve::ResolvedShape};

use super::{
    cells::Grid,
    flat,
    lattice::{self, Counting},
    line::{EPS, Hit, Line, Place},
    march::{Light, March},
    medium::{Medium, Voxels},
    options::{Classification, Method, NAME, ReferenceOptions},
    overlap::{self, Track},
    piece::{Cutter, Piece},
};

/// A picture with an enclosure for each pixel: premultiplied RGBA, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferencePicture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// No channel is below this. For a lattice the same as `color`, but for rounding.
    pub lower: Vec<[f64; 4]>,
    /// No channel is above this.
    pub upper: Vec<[f64; 4]>,
    /// The middle of the enclosure.
    pub color: Vec<[f64; 4]>,
    /// World distance along the ray at which accumulated opacity reaches the threshold; infinite
    /// where it never does. Not enclosed.
    pub depth: Vec<f64>,
    /// Pixels with a channel whose enclosure is wider than the tolerance.
    pub not_certified: usize,
    /// The widest enclosure of all certified pixels and channels.
    pub widest_certified: f64,
    /// The widest enclosure of all.
    pub widest: f64,
    /// Rays that met a shape.
    pub rays: u64,
    /// Stretches integrated, cells gathered, or samples taken.
    pub samples: u64,
}

/// A shape made ready.
struct Prepared {
    medium: Medium,
    texture: VolumeTexture,
    grid: Grid,
    place: Place,
    /// Shapes with the same number have the same place.
    place_number: usize,
    compositing: Compositing,
}

/// The most samples along the diagonal of a block.
const MAX_SAMPLES: f64 = 1e9;

/// Refuses what cannot be drawn.
///
/// # Errors
/// If the geometry is no block, the shader is not known here or reads a component that is not
/// there.
pub fn check(shape: &ResolvedShape) -> Result<(), ActionError> {
    let refuse = |what: String, cure: &str| {
        Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure: cure.into() })
    };
    let Some(texture) = shape.volume("volume") else {
        return refuse(format!("shader {:?} without a volume", shape.state.shader), "use a shader that reads a volume");
    };
    if shape.block().is_none() {
        return refuse(format!("geometry {:?}", shape.state.geometry.name()), "use a block");
    }
    let (count, component) = (texture.volume().desc().components, shape.int("component").unwrap_or(0));
    if component >= count as i64 {
        return refuse(format!("component {component} of a volume that has {count}"), "name a component that is there");
    }
    match Medium::new(shape) {
        Some(_) => Ok(()),
        None => refuse(format!("shader {:?}", shape.state.shader), "use simple, lut, mip, minip, average or xray"),
    }
}

/// Integrates a picture of shapes, in the order in which they were drawn.
///
/// # Errors
/// If the frame cannot be, a shape is refused by [`check`], or a lattice is too fine.
pub fn integrate(
    shapes: &[ResolvedShape],
    frame: &FrameDesc,
    options: &ReferenceOptions,
) -> Result<ReferencePicture, ActionError> {
    frame.validate()?;
    let viewport = frame.viewport();
    let rays = frame.camera.rays(&viewport).map_err(volact_core::frame::FrameError::from)?;
    let prepared = prepare(shapes, options)?;
    let scene = Scene { shapes: &prepared, rays, viewport, threshold: f64::from(frame.depth_threshold), options };
    let rows = scene.rows();
    Ok(gather(rows, frame, viewport, options))
}

fn prepare(shapes: &[ResolvedShape], options: &ReferenceOptions) -> Result<Vec<Prepared>, ActionError> {
    let mut prepared: Vec<Prepared> = Vec::new();
    for shape in shapes {
        check(shape)?;
        let (Some(medium), Some(block)) = (Medium::new(shape), shape.block()) else { continue };
        let Some(texture) = shape.volume("volume").cloned() else { continue };
        let compositing = shape.compositing();
        let exact = options.method == Method::Exact;
        if !exact {
            let size = shape.state.transform.matrix3 * block.size();
            let count = size.length() / options.sample_distance;
            if !(options.sample_distance > 0.0 && count <= MAX_SAMPLES) {
                let wanted = format!("at most {MAX_SAMPLES:e}; raise sample_distance");
                let what = format!("samples a ray through shape {:?}", shape.name);
                return Err(ActionError::Limit { action: NAME.into(), what, found: format!("{count:e}"), wanted });
            }
        }
        let grid = Grid::new(&medium, &Voxels::new(&texture), exact && compositing == Compositing::Over);
        let place = Place { to_object: shape.to_object, to_index: texture.object_to_index(), block };
        let same = |p: &&Prepared| p.place.to_object == place.to_object && p.place.block == block;
        let place_number = prepared.iter().find(same).map_or(prepared.len(), |p| p.place_number);
        prepared.push(Prepared { medium, texture, grid, place, place_number, compositing });
    }
    Ok(prepared)
}

struct Scene<'a> {
    shapes: &'a [Prepared],
    rays: RayGrid,
    viewport: Viewport,
    threshold: f64,
    options: &'a ReferenceOptions,
}

/// What came of one ray.
#[derive(Clone, Copy)]
struct Pixel {
    light: Light,
    samples: u64,
    met: bool,
}

impl Scene<'_> {
    /// All rows of the viewport, shared out to threads row by row.
    fn rows(&self) -> Vec<Vec<Pixel>> {
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
        let mut pixel = Pixel { light: Light::NONE, samples: 0, met: false };
        let mut through = Vec::new();
        let mut grazed = None;
        for shape in self.shapes {
            match shape.place.meet(&ray) {
                Hit::Miss => {}
                // What is nowhere opaque adds nothing over no length.
                Hit::Graze if shape.compositing == Compositing::Over && !shape.medium.can_be_opaque() => {}
                Hit::Graze => {
                    pixel.met = true;
                    grazed = Some(shape.medium.brightest().max(grazed.unwrap_or(0.0)));
                }
                Hit::Through(line) => through.push((shape, line)),
            }
        }
        pixel.met |= !through.is_empty();
        let (over, flat): (Vec<_>, Vec<_>) = through.iter().partition(|(s, _)| s.compositing == Compositing::Over);
        if !over.is_empty() {
            let (light, samples) = self.over(&ray, &over, cutter);
            (pixel.light, pixel.samples) = (light, samples);
            pixel.light.depth -= ray.depth_zero;
        }
        for (shape, line) in flat {
            let (light, samples) = self.flat(&ray, shape, line);
            pixel.light = flat::over(&light, &pixel.light);
            pixel.samples += samples;
        }
        if let Some(brightest) = grazed {
            pixel.light.lower = [0.0; 4];
            pixel.light.upper = [brightest, brightest, brightest, 1.0];
        }
        pixel
    }

    fn counting(&self, ray: &Ray) -> Option<Counting> {
        let step = self.options.sample_distance;
        match self.options.method {
            Method::Exact => None,
            Method::Rays => Some(Counting::rays(step)),
            Method::Planes => Some(Counting::planes(step, ray, self.rays.axis(), self.rays.eye())),
        }
    }

    fn flat(&self, ray: &Ray, shape: &Prepared, line: &Line) -> (Light, u64) {
        let voxels = Voxels::new(&shape.texture);
        let (gathered, samples) = match self.counting(ray) {
            None => flat::gather(&shape.medium, &shape.grid, &voxels, line),
            Some(counting) => {
                let ends = self.options.classification == Classification::PreIntegrated;
                lattice::gather(&shape.medium, &voxels, line, &counting, ends)
            }
        };
        (gathered.light(shape.compositing, &shape.medium), samples)
    }

    /// The depth-composited shapes of a ray.
    fn over(&self, ray: &Ray, shapes: &[&(&Prepared, Line)], cutter: &mut Cutter) -> (Light, u64) {
        let counting = self.counting(ray);
        let zero = shapes[0].1.anchor;
        let brightest = shapes.iter().map(|(s, _)| s.medium.brightest()).fold(1.0, f64::max);
        let mut march = March::new(self.threshold, brightest);
        if let [(shape, line)] = shapes {
            self.pieces(shape, line, counting.as_ref(), cutter, |piece| march.advance(std::slice::from_ref(piece)));
        } else {
            let (tracks, snap) = self.tracks(shapes, zero, counting.as_ref(), cutter);
            overlap::sweep(&tracks, snap, |pieces| march.advance(pieces));
        }
        let samples = march.stretches;
        let mut light = march.finish();
        light.depth += zero;
        (light, samples)
    }

    /// Visits a shape's pieces along a line.
    fn pieces(
        &self,
        shape: &Prepared,
        line: &Line,
        counting: Option<&Counting>,
        cutter: &mut Cutter,
        mut visit: impl FnMut(&Piece) -> bool,
    ) {
        let voxels = Voxels::new(&shape.texture);
        match counting {
            None => shape.grid.walk(line, |cell| cutter.cut(&shape.medium, &voxels, line, cell, &mut visit)),
            Some(counting) if self.options.classification == Classification::Post => {
                lattice::post(&shape.medium, &voxels, line, counting, visit);
            }
            Some(counting) => lattice::pre_integrated(&shape.medium, &voxels, line, counting, cutter, visit),
        }
    }

    /// All shapes' pieces, counted from one zero, and the distance within which ends are one.
    fn tracks(
        &self,
        shapes: &[&(&Prepared, Line)],
        zero: f64,
        counting: Option<&Counting>,
        cutter: &mut Cutter,
    ) -> (Vec<Track>, f64) {
        let mut snap = 0f64;
        let mut tracks = Vec::with_capacity(shapes.len());
        for (shape, line) in shapes {
            let shift = line.anchor - zero;
            snap = snap.max(2.0 * line.dt + 8.0 * EPS * (line.anchor.abs() + zero.abs() + shift.abs()));
            let mut track = Track::new();
            self.pieces(shape, line, counting, cutter, |piece| {
                let entry = (piece.t[0] == line.t[0]).then_some(shape.place_number);
                track.push(Piece { t: piece.t.map(|t| t + shift), entry, ..*piece });
                true
            });
            tracks.push(track);
        }
        (tracks, snap)
    }
}

fn gather(
    rows: Vec<Vec<Pixel>>,
    frame: &FrameDesc,
    viewport: Viewport,
    options: &ReferenceOptions,
) -> ReferencePicture {
    let pixels = frame.width * frame.height;
    let mut picture = ReferencePicture {
        width: frame.width,
        height: frame.height,
        lower: vec![[0.0; 4]; pixels],
        upper: vec![[0.0; 4]; pixels],
        color: vec![[0.0; 4]; pixels],
        depth: vec![f64::INFINITY; pixels],
        not_certified: 0,
        widest_certified: 0.0,
        widest: 0.0,
        rays: 0,
        samples: 0,
    };
    for (y, row) in rows.into_iter().enumerate() {
        for (x, Pixel { light, samples, met }) in row.into_iter().enumerate() {
            let at = (viewport.y + y) * frame.width + viewport.x + x;
            let width = (0..4).map(|c| light.upper[c] - light.lower[c]).fold(0.0, f64::max);
            if width <= options.tolerance {
                picture.widest_certified = picture.widest_certified.max(width);
            } else {
                picture.not_certified += 1;
            }
            picture.widest = picture.widest.max(width);
            picture.color[at] = [0, 1, 2, 3].map(|c| 0.5 * (light.lower[c] + light.upper[c]));
            (picture.lower[at], picture.upper[at]) = (light.lower, light.upper);
            picture.depth[at] = light.depth;
            picture.rays += u64::from(met);
            picture.samples += samples;
        }
    }
    picture
}
