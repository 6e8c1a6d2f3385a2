//! A picture: bands of rows to threads, packets of sixteen rays, and for each packet the shapes
//! that its rays meet.

use std::sync::Mutex;

use volact_core::{
    ActionError, Compositing, Frame, Viewport, camera::LinearRays, frame::FrameError, lattice::Lattice,
    lifecycle::OpenFrame, mutated, resolve::ResolvedShape,
};

use super::{
    dispatch,
    flat::Flat,
    limits::Limits,
    options::Settings,
    order::Over,
    over::{Pixels, under},
    packet::{Bundle, SIDE},
    part::{Eyes, Part},
    plan::Plan,
    resources::Resources,
    simd::LANES,
    walk::Counts,
};

/// A picture to draw.
#[derive(Debug)]
pub struct Picture<'a> {
    rays: LinearRays,
    viewport: Viewport,
    settings: Settings,
    limits: Limits<'a>,
    over: Over<'a>,
    /// In the order of drawing.
    flat: Vec<Flat<'a>>,
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
        let (desc, viewport) = (&open.desc, open.desc.viewport());
        let grid = desc.camera.rays(&viewport).map_err(FrameError::from)?;
        let threshold =
            if mutated!("depth_threshold") { 1.0 - 0.9 * desc.depth_threshold } else { desc.depth_threshold };
        let lattice = Lattice { step: plan.step };
        let rays = grid.linear();
        let eyes = Eyes { rays: &rays, size: [viewport.width, viewport.height], settings, threshold };
        let part = |shape| Part::new(shape, &desc.clip, resources, lattice, &eyes);
        let flat = |shape| Flat::new(shape, &desc.clip, resources, settings, lattice);
        let of = |compositing: &'static dyn Fn(Compositing) -> bool| {
            drawn.iter().copied().filter(move |s| compositing(s.compositing()))
        };
        let mut parts: Vec<Part<'a>> =
            of(&|c| matches!(c, Compositing::Over | Compositing::First)).filter_map(part).collect();
        if !mutated!("order_of_drawing") {
            parts.sort_by_key(|part| part.id);
        }
        let early = mutated!("early_termination") && settings.termination > 0.0;
        let termination = if early { 0.2 } else { settings.termination as f32 };
        Ok(Self {
            rays,
            viewport,
            settings: *settings,
            limits: Limits::new(drawn, desc, resources, (&grid, viewport)),
            over: Over { parts, unit: settings.unit, lattice, termination, threshold },
            flat: of(&|c| !matches!(c, Compositing::Over | Compositing::First)).filter_map(flat).collect(),
        })
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
                        let left = if mutated!("viewport_to_the_left") { 0 } else { self.viewport.x };
                        let at = py * width + left + px;
                        color[at] = self.mutated(pixels.color[l]);
                        depth[at] = (pixels.depth[l] - bundle.depth_zero) as f32;
                        if mutated!("depth_from_the_origin") {
                            depth[at] = pixels.depth[l] as f32;
                        }
                    }
                }
            }
        }
    }

    /// The same colour but for a fault that is asked for.
    fn mutated(&self, color: [f32; 4]) -> [f32; 4] {
        if mutated!("eight_bit_target") {
            return color.map(|v| (v * 255.0).round() / 255.0);
        }
        if mutated!("threads_matter") && self.settings.threads == 3 {
            return color.map(|v| v * (1.0 - f32::EPSILON));
        }
        if mutated!("upside_down_colours") {
            return [color[2], color[1], color[0], color[3]];
        }
        color
    }

    /// The first failure of a shader's program, if there was one.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        self.over.parts.iter().try_for_each(Part::check)?;
        self.flat.iter().try_for_each(Flat::check)
    }

    /// Draws sixteen rays; returns those that met something.
    fn packet(&self, bundle: &Bundle, pixels: &mut Pixels, counts: &mut Counts) -> u32 {
        let mut span = bundle.span;
        let ends = (!self.limits.is_none()).then(|| self.limits.find(bundle));
        let behind = ends.as_ref().map(|ends| {
            span.limit(&ends.t);
            ends.behind
        });
        let mut met = self.over.draw(bundle, &span, ends, pixels, counts);
        for (pixel, behind) in pixels.color.iter_mut().zip(behind.iter().flatten()) {
            *pixel = under(*pixel, *behind);
        }
        for flat in &self.flat {
            met |= flat.draw(self.settings.unit, bundle, &span, pixels, counts);
        }
        met
    }
}
