//! The life cycle of `vulkan`.

use std::{collections::BTreeSet, sync::Arc, time::Instant};

use volact_core::{
    ActionError, Caps, Context, Declaration, Frame, FrameDesc, Method, Options, ParameterValue, RenderAction, Severity,
    Shape, Warning, WarningCode, frame::Rebuild, lifecycle::Lifecycle, resolve::ResolvedShape,
};
use volact_shaders::{
    Programs,
    gpu::{
        action,
        mesh::surface::is_surface,
        scene::{Item, cut_short, overlapping, overrun},
    },
    without_entry,
};

use crate::{
    check::NAME,
    device::Gpu,
    draw::{Drawing, Drawn},
    options::{Settings, declaration},
};

/// Draws on a GPU through Vulkan.
#[derive(Debug)]
pub struct VulkanAction {
    declaration: Declaration,
    given: Options,
    settings: Settings,
    lifecycle: Lifecycle,
    programs: Programs,
    // Before the device, which it waits for.
    drawing: Drawing,
    gpu: Arc<Gpu>,
    /// What was uploaded since the last frame.
    fetched: Fetched,
    started: Option<Instant>,
    /// Warnings that the process-wide handler has had.
    said: BTreeSet<String>,
}

#[derive(Debug, Default)]
struct Fetched {
    bytes: usize,
    rebuilt: Vec<Rebuild>,
}

impl VulkanAction {
    /// Makes one with a device of its own, from options that are checked and complete.
    ///
    /// # Errors
    /// If there is no such adapter, or validation is asked for and cannot be had.
    pub fn new(context: &Context, options: &Options) -> Result<Self, ActionError> {
        let settings = Settings::read(options);
        let gpu = Gpu::open(&settings.adapter, settings.validation)?;
        Ok(Self {
            declaration: declaration(),
            given: options.clone(),
            lifecycle: Lifecycle::new(context.clone()),
            programs: Programs::new(NAME),
            drawing: Drawing::new(&gpu, &settings)?,
            settings,
            gpu,
            fetched: Fetched::default(),
            started: None,
            said: BTreeSet::new(),
        })
    }

    fn fetch(&mut self, shape: &ResolvedShape) -> Result<(), ActionError> {
        let Fetched { bytes, rebuilt } = &mut self.fetched;
        *bytes += self.drawing.volumes.prepare(&self.gpu, shape, &self.settings, rebuilt)?;
        if let Some(bytes) = self.drawing.meshes.prepare(NAME, shape)? {
            rebuilt.push(Rebuild { shape: shape.name.clone(), what: "mesh".into(), bytes });
        }
        Ok(())
    }

    fn picture(&mut self, desc: &FrameDesc, drawn: &[&ResolvedShape]) -> Result<Frame, ActionError> {
        let (surfaces, solid): (Vec<_>, Vec<_>) = drawn.iter().copied().partition(|s| is_surface(s));
        let item = |shape| Ok(Item { shape, program: self.programs.of(shape)? });
        let items = solid.into_iter().map(item).collect::<Result<Vec<_>, ActionError>>()?;
        let Fetched { bytes, mut rebuilt } = std::mem::take(&mut self.fetched);
        let made = self.drawing.draw(&self.gpu, desc, (items, &surfaces), &self.settings, &mut rebuilt)?;
        let mut frame = Frame::empty(desc);
        if let Some((target, limits)) = self.drawing.target() {
            let counts = target.read(&mut frame, &desc.viewport(), made.shift, desc.depth_threshold, limits);
            if let Some(number) = counts.overrun {
                return Err(overrun(made.order.get(number), drawn, self.gpu.cuts_loops()));
            }
            if let Some(number) = counts.overlapping {
                return Err(overlapping(NAME, made.order.get(number)));
            }
            if counts.cut {
                return Err(cut_short(NAME, self.gpu.name(), made.step.distance));
            }
            (frame.statistics.rays, frame.statistics.samples) = (counts.rays, counts.samples);
            frame.statistics.resident_bytes = self.drawing.bytes() + target.bytes();
        }
        frame.statistics.uploaded_bytes = bytes + made.uploaded;
        frame.statistics.rebuilt = rebuilt;
        frame.statistics.threads = 1;
        let details = &mut frame.statistics.details;
        details.push(("planes".into(), made.step.planes.to_string()));
        details.push(("runs of planes".into(), made.runs.to_string()));
        details.push(("textures".into(), format!("{:.3} MB", self.drawing.volumes.bytes() as f64 * 1e-6)));
        frame.warnings = self.warnings(&frame, &made, drawn);
        frame.method = self.method(&made, drawn);
        Ok(frame)
    }

    fn warnings(&self, frame: &Frame, made: &Drawn, drawn: &[&ResolvedShape]) -> Vec<Warning> {
        let mut all: Vec<Warning> = drawn.iter().flat_map(|s| s.warnings.clone()).collect();
        if frame.statistics.rays == 0 && !drawn.is_empty() {
            let message = "no ray meets any shape; check camera, near and far, and transforms";
            all.push(Warning::new(WarningCode::NothingVisible, NAME, message));
        }
        all.extend(drawn.iter().filter_map(|s| s.coarse_for_shear(made.step.distance)));
        if made.step.is_widened() {
            let message = format!(
                "max_planes holds planes {:?} apart instead of {:?}: {} of them",
                made.step.distance, made.step.wanted, made.step.planes
            );
            all.push(Warning::new(WarningCode::SettingAdjusted, NAME, message));
        }
        let unfiltered = |s: &&&ResolvedShape| {
            let held = s.first_volume().and_then(|t| self.drawing.volumes.get(t.volume()));
            self.settings.hardware && held.is_some_and(|h| !h.filterable)
        };
        let warn = |s: &&ResolvedShape| {
            let message = "the adapter's sampler does not interpolate this format; the shader does, exactly";
            Warning::new(WarningCode::SettingAdjusted, &s.name, message)
        };
        all.extend(drawn.iter().filter(unfiltered).map(warn));
        all.extend(without_entry(drawn));
        all
    }

    fn method(&self, made: &Drawn, drawn: &[&ResolvedShape]) -> Method {
        let held = drawn.iter().flat_map(|s| s.parameters.values()).filter_map(|v| match v {
            ParameterValue::Volume(texture) => self.drawing.volumes.get(texture.volume()),
            _ => None,
        });
        Method {
            sampling: action::sampling(drawn, "planes along the view axis, midpoint lattice"),
            sample_distance: made.step.distance,
            classification: "shader evaluated in the middle of segments".into(),
            table_width: 0,
            texture_format: action::formats(held.map(|h| h.encoding.name())),
            filter: if self.settings.hardware { "hardware" } else { "f32, exact weights" }.into(),
            blend: "f32".into(),
            termination: self.settings.termination,
            device: self.gpu.description(),
        }
    }
}

impl RenderAction for VulkanAction {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        action::caps(&self.gpu.description())
    }

    /// Takes a shape in and has its volumes moved to the device already, by the transfer queue.
    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        let programs = &self.programs;
        let mut found = None;
        self.lifecycle.manage(shape, |shape| {
            action::check(NAME, shape, programs)?;
            found = Some(shape.clone());
            Ok(())
        })?;
        log::debug!("{NAME}: manages {:?}", shape.name());
        let fetched = found.map_or(Ok(()), |resolved| self.fetch(&resolved));
        if fetched.is_err() {
            // What cannot be brought to the device is not taken in.
            _ = self.lifecycle.unmanage(shape);
        }
        fetched
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        let started = Instant::now();
        let programs = &self.programs;
        let open = self.lifecycle.begin(frame, |shape| action::check(NAME, shape, programs))?;
        let shapes: Vec<ResolvedShape> = open.shapes.values().cloned().collect();
        self.drawing.meshes.retain(shapes.iter());
        let kept = self.drawing.volumes.retain(shapes.iter()).map_err(ActionError::from);
        if let Err(error) = kept.and_then(|()| shapes.iter().try_for_each(|s| self.fetch(s))) {
            self.lifecycle.abandon();
            return Err(error);
        }
        self.started = Some(started);
        Ok(())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let started = self.started.take().unwrap_or_else(Instant::now);
        let prepare = started.elapsed();
        let drawn: Vec<&ResolvedShape> = open.drawn_shapes().collect();
        let frame = self.picture(&open.desc, &drawn);
        self.gpu.heard()?;
        let mut frame = frame?;
        for warning in frame.warnings.iter().filter(|w| w.severity == Severity::Warning) {
            if self.said.insert(warning.to_string()) {
                warning.emit();
            }
        }
        (frame.statistics.prepare, frame.statistics.total) = (prepare, started.elapsed());
        frame.statistics.render = frame.statistics.total - prepare;
        Ok(frame)
    }

    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        self.lifecycle.outside("set_option")?;
        let mut given = self.given.clone();
        given.insert(name.into(), value);
        let resolved = self.declaration.resolve(&given, |_| false);
        let resolved = resolved.map_err(|problems| ActionError::Options { action: NAME.into(), problems })?;
        let settings = Settings::read(&resolved);
        let device = |s: &Settings| (s.adapter.clone(), s.validation, s.cache.clone());
        if device(&settings) != device(&self.settings) {
            let gpu = Gpu::open(&settings.adapter, settings.validation)?;
            self.drawing = Drawing::new(&gpu, &settings)?;
            self.gpu = gpu;
        }
        (self.settings, self.given) = (settings, given);
        Ok(())
    }
}
