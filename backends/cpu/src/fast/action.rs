//! The life cycle of `cpu`.

use std::{collections::BTreeSet, sync::Mutex, time::Instant};

use volact_core::{
    Aabb, ActionError, Caps, Compositing, Context, Declaration, Frame, FrameDesc, LookupTable, Method, Options,
    ParameterValue, RayGrid, RenderAction, Shape, TableInterpolation, Viewport,
    frame::Rebuild,
    lattice::Lattice,
    lifecycle::{Lifecycle, OpenFrame},
    parameter::{ParameterProblem, ProblemKind},
    resolve::ResolvedShape,
    shape::smallest_voxel,
    table::ResolvedTable,
};

use super::{
    classify::Units,
    dispatch, general,
    options::{Classification, Settings, declaration},
    over,
    packet::{Place, Rays, SIDE},
    reduce,
    resources::{Resources, reduction, voxels},
    simd::LANES,
    walk::Counts,
};

const NAME: &str = "cpu";
const SHADERS: [&str; 6] = ["simple", "lut", "mip", "minip", "average", "xray"];
/// Most segments of the lattice along the diagonal of what is drawn.
const MOST_SEGMENTS: f64 = 1e7;

/// The fast action.
#[derive(Debug)]
pub struct CpuAction {
    declaration: Declaration,
    given: Options,
    settings: Settings,
    lifecycle: Lifecycle,
    resources: Resources,
    started: Option<Started>,
    /// Step and way of the last frame: what is managed beside what is drawn does not change them.
    last: Option<Plan>,
    /// Warnings that the process-wide handler has had.
    said: BTreeSet<String>,
}

/// What tables depend on beside their shape.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Plan {
    step: f64,
    general: bool,
}

/// A frame that has begun.
#[derive(Debug)]
struct Started {
    at: Instant,
    plan: Plan,
    rebuilt: Vec<Rebuild>,
}

impl CpuAction {
    /// Makes one from options that are checked and complete.
    ///
    /// # Errors
    /// If a vector unit is asked for that this machine lacks.
    pub fn new(context: &Context, options: &Options) -> Result<Self, ActionError> {
        let settings = read(options)?;
        log::info!("cpu: {}, {} threads", settings.unit.name(), settings.threads);
        Ok(Self {
            declaration: declaration(),
            given: options.clone(),
            settings,
            lifecycle: Lifecycle::new(context.clone()),
            resources: Resources::default(),
            started: None,
            last: None,
            said: BTreeSet::new(),
        })
    }

    /// The sample distance for these shapes.
    fn distance(&self, shapes: &[&ResolvedShape]) -> f64 {
        let voxel = |s: &&ResolvedShape| s.volume("volume").map(|t| smallest_voxel(t, &s.state.transform));
        let smallest = shapes.iter().filter_map(voxel).fold(f64::INFINITY, f64::min);
        self.settings.sample_distance.unwrap_or(if smallest.is_finite() { smallest / 2.0 } else { 1.0 })
    }

    /// The same, unless it is too small for one of them.
    fn step(&self, shapes: &[&ResolvedShape]) -> Result<f64, ActionError> {
        let step = self.distance(shapes);
        for shape in shapes {
            let size = shape.state.world_bounds().size().length();
            if size / step > MOST_SEGMENTS {
                return Err(ActionError::Limit {
                    action: NAME.into(),
                    what: format!("number of samples along a ray of shape {:?}", shape.name),
                    found: format!("{:.3e} (size {size:?}, sample_distance {step:?})", size / step),
                    wanted: format!("at most {MOST_SEGMENTS:.0e}; take a larger sample_distance"),
                });
            }
        }
        Ok(step)
    }
}

fn read(options: &Options) -> Result<Settings, ActionError> {
    Settings::read(options).map_err(|unit| {
        let wanted = format!("a unit of this machine: {} or narrower", super::simd::Unit::detect().name());
        let kind = ProblemKind::Mistyped { found: format!("{unit:?}"), wanted };
        ActionError::Options { action: NAME.into(), problems: vec![ParameterProblem { name: "unit".into(), kind }] }
    })
}

fn check(shape: &ResolvedShape) -> Result<(), ActionError> {
    let unsupported = |what: String, cure: &str| {
        Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure: cure.into() })
    };
    let shader = shape.shader.declaration.name.as_str();
    if !SHADERS.contains(&shader) {
        return unsupported(format!("shader {shader:?}"), &format!("it draws {}", SHADERS.join(", ")));
    }
    if shape.state.geometry.as_block().is_none() {
        return unsupported(format!("geometry {:?}", shape.state.geometry.name()), "it draws blocks");
    }
    if let Some(texture) = shape.volume("volume") {
        let components = texture.volume().desc().components;
        let wanted = shape.int("component").unwrap_or(0);
        if wanted >= components as i64 {
            return unsupported(
                format!("component {wanted} of a volume with {components}"),
                &format!("name one of 0 to {}", components - 1),
            );
        }
    }
    if matches!(shape.compositing(), Compositing::First) {
        return unsupported("compositing first".into(), "it draws over, maximum, minimum, average and add");
    }
    Ok(())
}

impl RenderAction for CpuAction {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        Caps {
            shaders: Some(SHADERS.map(str::to_owned).to_vec()),
            geometries: Some(vec!["block".into()]),
            compositing: vec![
                Compositing::Over,
                Compositing::Maximum,
                Compositing::Minimum,
                Compositing::Average,
                Compositing::Add,
            ],
            overlap: true,
            depth: true,
            device: format!("{}, {} threads", self.settings.unit.name(), self.settings.threads),
        }
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.manage(shape, check)?;
        log::debug!("cpu: manages {:?}", shape.name());
        Ok(())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        let start = Instant::now();
        let open = self.lifecycle.begin(frame, check)?;
        let shapes: Vec<ResolvedShape> = open.shapes.values().cloned().collect();
        let managed: Vec<_> = shapes.iter().collect();
        // What is drawn is not known yet: most likely what was drawn last, else everything.
        // Only a distance that was asked for can be refused already: the one chosen for all may be
        // too small for some, and those not drawn together.
        let asked = self.settings.sample_distance.is_some();
        let step = if asked { self.step(&managed) } else { Ok(self.distance(&managed)) };
        let plan = match step {
            Ok(step) => self.last.unwrap_or(Plan { step, general: uses_general(&managed) }),
            Err(error) => {
                self.lifecycle.abandon();
                return Err(error);
            }
        };
        let mut rebuilt = Vec::new();
        self.resources.retain(shapes.iter());
        self.resources.prepare(shapes.iter(), plan.step, plan.general, &self.settings, &mut rebuilt);
        self.started = Some(Started { at: start, plan, rebuilt });
        Ok(())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let Some(Started { at: start, plan: prepared, mut rebuilt }) = self.started.take() else {
            return Err(ActionError::NotDrawing { call: "end_draw" });
        };
        let drawn: Vec<&ResolvedShape> = open.drawn_shapes().collect();
        // What is managed but not drawn must not change the picture.
        let step = self.step(&drawn)?;
        let plan = Plan { step, general: uses_general(&drawn) };
        if plan != prepared {
            self.resources.prepare(drawn.iter().copied(), step, plan.general, &self.settings, &mut rebuilt);
        }
        self.last = (!drawn.is_empty()).then_some(plan);
        let prepare = start.elapsed();
        let mut frame = Frame::empty(&open.desc);
        let counts = Picture::new(&open, &drawn, &self.resources, &self.settings, step)?.draw(&mut frame);
        frame.warnings = drawn.iter().flat_map(|s| s.warnings.clone()).collect();
        if counts.rays == 0 && !drawn.is_empty() {
            let message = "no ray meets any shape; check camera, near and far, and transforms";
            let code = volact_core::WarningCode::NothingVisible;
            frame.warnings.push(volact_core::Warning::new(code, NAME, message));
        }
        frame.warnings.extend(self.adjusted(&drawn));
        for warning in frame.warnings.iter().filter(|w| w.severity == volact_core::Severity::Warning) {
            if self.said.insert(warning.to_string()) {
                warning.emit();
            }
        }
        frame.method = self.method(&drawn, step);
        let stats = &mut frame.statistics;
        (stats.rays, stats.samples) = (counts.rays, counts.samples);
        stats.skipped = counts.lattice.saturating_sub(counts.samples);
        (stats.prepare, stats.total) = (prepare, start.elapsed());
        stats.render = stats.total - prepare;
        stats.resident_bytes = self.resources.bytes();
        (stats.rebuilt, stats.threads) = (rebuilt, self.settings.threads);
        Ok(frame)
    }

    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        self.lifecycle.outside("set_option")?;
        let mut given = self.given.clone();
        given.insert(name.into(), value);
        let resolved = self.declaration.resolve(&given, |_| false);
        let resolved = resolved.map_err(|problems| ActionError::Options { action: NAME.into(), problems })?;
        self.settings = read(&resolved)?;
        self.given = given;
        self.last = None;
        Ok(())
    }
}

impl CpuAction {
    /// Settings asked for that a shape's way of drawing has no use for.
    fn adjusted(&self, drawn: &[&ResolvedShape]) -> Vec<volact_core::Warning> {
        let asked = self.settings.classification == Classification::PreIntegrated;
        let tabled = |s: &&&ResolvedShape| s.compositing() == Compositing::Over && s.table("lookup_table").is_some();
        let without = |s: &&&ResolvedShape| self.resources.tables(s.id).is_none_or(|t| t.pairs.is_none());
        let warn = |s: &&ResolvedShape| {
            let message = "classification pre-integrated is not done for overlapping shapes, \
                           pre-interpolated tables and the nearest filter; it is drawn without";
            volact_core::Warning::new(volact_core::WarningCode::SettingAdjusted, &s.name, message)
        };
        drawn.iter().filter(|_| asked).filter(tabled).filter(without).map(warn).collect()
    }

    fn method(&self, drawn: &[&ResolvedShape], step: f64) -> Method {
        let mut classification: Vec<&str> = Vec::new();
        let mut width = 0;
        let mut formats: Vec<String> = Vec::new();
        for shape in drawn {
            let tables = self.resources.tables(shape.id);
            let general = uses_general(drawn) && shape.compositing() == Compositing::Over;
            let word = match (shape.compositing(), shape.table("lookup_table").map(LookupTable::interpolation)) {
                (Compositing::Over, Some(TableInterpolation::Pre)) => "pre-interpolated",
                (Compositing::Over, None) => "components",
                (Compositing::Over, _) if !general && tables.is_some_and(|t| t.pairs.is_some()) => "pre-integrated",
                _ => "post-interpolated",
            };
            classification.push(word);
            if let Some(t) = tables.filter(|_| !general) {
                width = width.max(t.pairs.as_ref().map_or(t.table.nodes, |p| p.nodes));
            }
            formats.extend(shape.volume("volume").map(|v| v.volume().desc().scalar.to_string()));
        }
        classification.dedup();
        formats.dedup();
        Method {
            sampling: "ray casting, midpoint lattice".into(),
            sample_distance: step,
            classification: classification.join(", "),
            table_width: width,
            texture_format: formats.join(", "),
            filter: "f32, exact weights".into(),
            blend: if uses_general(drawn) { "f64" } else { "f32" }.into(),
            termination: self.settings.termination,
            device: self.caps().device,
        }
    }
}

/// Whether the `over` shapes need the plain way: they may overlap, or are no plain tables.
fn uses_general(drawn: &[&ResolvedShape]) -> bool {
    let over: Vec<_> = drawn.iter().filter(|s| s.compositing() == Compositing::Over).collect();
    let plain = |s: &ResolvedShape| match s.table("lookup_table") {
        Some(table) => table.interpolation() == TableInterpolation::Pre,
        None => true,
    };
    let bounds: Vec<_> = over.iter().map(|s| s.world_block()).collect();
    let apart = |a: &Aabb, b: &Aabb| (0..3).any(|i| a.max[i] <= b.min[i] || b.max[i] <= a.min[i]);
    let overlap = bounds.iter().enumerate().any(|(i, a)| bounds[..i].iter().any(|b| !apart(a, b)));
    overlap || over.iter().any(|s| plain(s))
}

/// One way of drawing a band of the picture.
enum Pass<'a> {
    /// Shapes that no ray can meet at the same place.
    Over {
        parts: Vec<(over::Job<'a>, Rays)>,
        layers: Vec<general::Layer<'a>>,
    },
    General {
        layers: Vec<general::Layer<'a>>,
    },
    Reduce(Box<Reduction<'a>>),
}

/// A shape composited by maximum, minimum, average or add.
struct Reduction<'a> {
    job: reduce::Job<'a>,
    rays: Rays,
    units: Units,
    table: ResolvedTable,
    unit: f64,
}

/// A picture to draw.
struct Picture<'a> {
    grid: RayGrid,
    viewport: Viewport,
    passes: Vec<Pass<'a>>,
    settings: Settings,
    lattice: Lattice,
    threshold: f32,
}

impl<'a> Picture<'a> {
    fn new(
        open: &'a OpenFrame,
        drawn: &[&'a ResolvedShape],
        resources: &'a Resources,
        settings: &Settings,
        step: f64,
    ) -> Result<Self, ActionError> {
        let viewport = open.desc.viewport();
        let grid = open.desc.camera.rays(&viewport).map_err(volact_core::frame::FrameError::from)?;
        let lattice = Lattice { step };
        let over: Vec<_> = drawn.iter().copied().filter(|s| s.compositing() == Compositing::Over).collect();
        let mut passes = Vec::new();
        let empty = |id| resources.tables(id).and_then(|t| t.empty.as_ref());
        let layers: Vec<_> = over.iter().filter_map(|s| general::Layer::new(s, empty(s.id))).collect();
        if uses_general(drawn) {
            passes.push(Pass::General { layers });
        } else {
            let mut parts = Vec::new();
            for shape in over {
                let (Some(texture), Some(place), Some(tables)) =
                    (shape.volume("volume"), Place::new(shape), resources.tables(shape.id))
                else {
                    continue;
                };
                let job = over::Job {
                    voxels: voxels(shape, texture).0,
                    lattice,
                    table: &tables.table,
                    pairs: tables.pairs.as_ref(),
                    empty: tables.empty.as_ref(),
                    termination: settings.termination as f32,
                    threshold: open.desc.depth_threshold,
                };
                parts.push((job, Rays::new(&grid, place)));
            }
            passes.push(Pass::Over { parts, layers });
        }
        for shape in drawn.iter().copied().filter(|s| s.compositing() != Compositing::Over) {
            let (Some(texture), Some(place)) = (shape.volume("volume"), Place::new(shape)) else { continue };
            let (voxels, units) = voxels(shape, texture);
            let skips = settings.skipping && !voxels.nearest;
            let peaks = resources.peaks(shape).filter(|_| skips);
            let range = resources.bounds(shape).and_then(|b| b.range).filter(|_| skips);
            let compositing = reduction(shape, units);
            let empty = resources.zeros(shape).filter(|_| skips);
            let job = reduce::Job { voxels, lattice, compositing, peaks, range, empty };
            let grey = || LookupTable::grey(texture.range());
            let table = shape.table("lookup_table").cloned().unwrap_or_else(grey).resolve(texture.range());
            let rays = Rays::new(&grid, place);
            let unit = shape.float("unit_distance").unwrap_or(1.0);
            passes.push(Pass::Reduce(Box::new(Reduction { job, rays, units, table, unit })));
        }
        let threshold = open.desc.depth_threshold;
        Ok(Self { grid, viewport, passes, settings: *settings, lattice, threshold })
    }

    fn draw(&self, frame: &mut Frame) -> Counts {
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
        for y in (0..rows).step_by(SIDE) {
            for x in (0..self.viewport.width).step_by(SIDE) {
                let mut pixels = over::Pixels::default();
                let mut zero = [0f64; LANES];
                for pass in &self.passes {
                    self.pass(pass, [x, first + y], &mut pixels, &mut zero, counts);
                }
                for (l, zero) in zero.into_iter().enumerate() {
                    let (px, py) = (x + l % SIDE, y + l / SIDE);
                    if px < self.viewport.width && py < rows {
                        let at = py * width + self.viewport.x + px;
                        color[at] = pixels.color[l];
                        depth[at] = (pixels.depth[l] - zero) as f32;
                    }
                }
            }
        }
    }

    fn pass(
        &self,
        pass: &Pass<'_>,
        at: [usize; 2],
        pixels: &mut over::Pixels,
        zero: &mut [f64; LANES],
        counts: &mut Counts,
    ) {
        let size = [self.viewport.width, self.viewport.height];
        let unit = self.settings.unit;
        match pass {
            Pass::Over { parts, layers } => {
                *zero = [self.grid.linear().depth_zero; LANES];
                let at = dispatch::At { pixel: at, size };
                let drawn: Vec<_> =
                    parts.iter().filter_map(|(job, rays)| dispatch::draw(unit, job, rays, at, counts)).collect();
                match drawn.as_slice() {
                    [] => {}
                    [one] => *pixels = one.clone(),
                    several => self.in_depth_order(several, layers, at.pixel, pixels, counts),
                }
            }
            Pass::General { layers } => {
                *zero = [self.grid.linear().depth_zero; LANES];
                for l in 0..LANES {
                    self.general(layers, at, l, pixels, counts);
                }
            }
            Pass::Reduce(reduction) => {
                let Reduction { job, rays, units, table, unit: distance } = reduction.as_ref();
                let at = dispatch::At { pixel: at, size };
                let Some(reduced) = dispatch::reduce(unit, job, rays, at, counts) else { return };
                for (pixel, r) in pixels.color.iter_mut().zip(reduced) {
                    if r.length > 0.0 {
                        *pixel = lay_over(*pixel, classify(job.compositing, r, *units, table, *distance));
                    }
                }
            }
        }
    }
}

impl Picture<'_> {
    /// Draws one lane the plain way.
    fn general(
        &self,
        layers: &[general::Layer<'_>],
        at: [usize; 2],
        l: usize,
        pixels: &mut over::Pixels,
        counts: &mut Counts,
    ) {
        let (x, y) = (at[0] + l % SIDE, at[1] + l / SIDE);
        if x < self.viewport.width && y < self.viewport.height {
            let ray = self.grid.ray(x as f64 + 0.5, y as f64 + 0.5);
            let (end, threshold) = (self.settings.termination, f64::from(self.threshold));
            let result = general::draw(layers, &ray, &self.lattice, end, threshold, counts);
            pixels.color[l] = result.color.map(|v| v as f32);
            pixels.depth[l] = result.depth;
        }
    }

    /// Puts shapes that are apart one behind the other along each ray.
    fn in_depth_order(
        &self,
        drawn: &[over::Pixels],
        layers: &[general::Layer<'_>],
        at: [usize; 2],
        pixels: &mut over::Pixels,
        counts: &mut Counts,
    ) {
        for l in 0..LANES {
            let mut order: Vec<&over::Pixels> = drawn.iter().filter(|p| p.start[l] < f64::INFINITY).collect();
            order.sort_by(|a, b| a.start[l].total_cmp(&b.start[l]));
            let (mut color, mut depth) = ([0f32; 4], f64::INFINITY);
            for part in order {
                let before = color[3];
                color = over::under(color, part.color[l]);
                if before < self.threshold && color[3] >= self.threshold {
                    depth = if before == 0.0 { part.depth[l] } else { f64::NAN };
                }
            }
            if depth.is_nan() {
                // Reached inside a shape behind others: where, only the plain way tells.
                let mut found = over::Pixels::default();
                self.general(layers, at, l, &mut found, counts);
                depth = found.depth[l];
            }
            pixels.color[l] = color;
            pixels.depth[l] = depth;
        }
    }
}

/// Premultiplied colour of a reduced ray.
fn classify(
    compositing: Compositing,
    reduced: reduce::Reduced,
    units: Units,
    table: &ResolvedTable,
    distance: f64,
) -> [f32; 4] {
    let value = match compositing {
        Compositing::Average => units.data(reduced.value / reduced.length),
        Compositing::Add => (reduced.value * units.scale + units.offset * reduced.length) / distance,
        _ => units.data(reduced.value),
    };
    let [r, g, b, a] = table.classify(value);
    [r * a, g * a, b * a, a].map(|v| v as f32)
}

/// One picture over another.
fn lay_over(below: [f32; 4], above: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|c| above[c] + (1.0 - above[3]) * below[c])
}
