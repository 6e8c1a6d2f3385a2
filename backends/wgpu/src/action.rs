//! The life cycle of `wgpu`.

use std::{collections::BTreeSet, time::Instant};

use volact_core::{
    ActionError, Caps, Context, Declaration, Frame, FrameDesc, Options, ParameterValue, RenderAction, Severity, Shape,
    Warning, WarningCode, frame::Rebuild, lifecycle::Lifecycle, resolve::ResolvedShape,
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
    NAME,
    device::{DeviceError, Gpu},
    draw::Drawing,
    method,
    onto::Onto,
    options::{Settings, declaration},
    plan,
};

/// Draws on a GPU.
#[derive(Debug)]
pub struct WgpuAction {
    declaration: Declaration,
    given: Options,
    settings: Settings,
    lifecycle: Lifecycle,
    gpu: Gpu,
    programs: Programs,
    drawing: Drawing,
    started: Option<Started>,
    /// Warnings that the process-wide handler has had.
    said: BTreeSet<String>,
}

/// A frame that has begun.
#[derive(Debug)]
struct Started {
    at: Instant,
    uploaded: usize,
    rebuilt: Vec<Rebuild>,
}

impl WgpuAction {
    /// Makes one with a device of its own, from options that are checked and complete.
    ///
    /// # Errors
    /// If there is no such adapter.
    pub fn new(context: &Context, options: &Options) -> Result<Self, ActionError> {
        let settings = Settings::read(options);
        let gpu = Gpu::open(&settings.adapter)?;
        Ok(Self::on(context, options, settings, gpu))
    }

    /// Makes one that shares the device of an application, from options that are checked and complete:
    /// those that choose an adapter say nothing.
    /// Its errors are caught by scopes, and its handlers left as they are.
    pub fn with_device(context: &Context, options: &Options, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self::on(context, options, Settings::read(options), Gpu::of_application(device, queue))
    }

    fn on(context: &Context, options: &Options, settings: Settings, gpu: Gpu) -> Self {
        Self {
            declaration: declaration(),
            given: options.clone(),
            settings,
            lifecycle: Lifecycle::new(context.clone()),
            gpu,
            programs: Programs::new(NAME),
            drawing: Drawing::default(),
            started: None,
            said: BTreeSet::new(),
        }
    }

    /// In place of `end_draw`: draws what was recorded over a viewport of an application's target, in
    /// front of what is there and, where its depth buffer is given, behind and around it. The target is
    /// not cleared and depth is not written. The frame that comes back has no pixels of its own: its
    /// colours are transparent and its depths infinite.
    ///
    /// # Errors
    /// As `end_draw`, or if the target's format cannot be blended.
    pub fn end_draw_onto(&mut self, target: &Onto<'_>) -> Result<Frame, ActionError> {
        self.finish_scoped(Some(target))
    }

    fn prepare(&mut self, shapes: &[ResolvedShape], started: &mut Started) -> Result<(), ActionError> {
        self.drawing.volumes.retain(shapes.iter());
        self.drawing.meshes.retain(shapes.iter());
        for shape in shapes {
            if let Some(bytes) = self.drawing.meshes.prepare(NAME, shape)? {
                started.rebuilt.push(Rebuild { shape: shape.name.clone(), what: "mesh".into(), bytes });
            }
            let volumes = &mut self.drawing.volumes;
            started.uploaded += volumes.prepare(&self.gpu, shape, &self.settings, &mut started.rebuilt)?;
        }
        if self.settings.sample_distance.is_some() {
            plan::step(&shapes.iter().filter(|s| !is_surface(s)).collect::<Vec<_>>(), &self.settings)?;
        }
        Ok(())
    }

    fn finish_scoped(&mut self, onto: Option<&Onto<'_>>) -> Result<Frame, ActionError> {
        let scopes = self.gpu.scopes();
        let made = self.finish(onto);
        scopes.close(self.gpu.name())?;
        made
    }

    /// Draws what was recorded, and reads it back where it is nobody's own.
    fn finish(&mut self, onto: Option<&Onto<'_>>) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let Some(Started { at, mut uploaded, mut rebuilt }) = self.started.take() else {
            return Err(ActionError::NotDrawing { call: "end_draw" });
        };
        let drawn: Vec<&ResolvedShape> = open.drawn_shapes().collect();
        let (surfaces, solid): (Vec<_>, Vec<_>) = drawn.iter().copied().partition(|s| is_surface(s));
        let item = |shape| Ok(Item { shape, program: self.programs.of(shape)? });
        let items = solid.into_iter().map(item).collect::<Result<Vec<_>, ActionError>>()?;
        let how = (&self.settings, onto);
        let submitted = self.drawing.submit(&self.gpu, &open.desc, (items, &surfaces), how, &mut rebuilt)?;
        uploaded += submitted.uploaded;
        let prepare = at.elapsed();
        let mut frame = Frame::empty(&open.desc);
        let lost = || DeviceError::Failed { adapter: self.gpu.name().into(), why: "there is no picture".into() };
        let target = self.drawing.target().ok_or_else(lost)?;
        let resident = self.drawing.bytes() + target.bytes();
        let counts = match onto {
            Some(_) => target.wait(&self.gpu)?,
            None => target.read(&self.gpu, &mut frame, &open.desc.viewport(), submitted.shift)?,
        };
        if let Some(number) = counts.overrun {
            return Err(overrun(submitted.order.get(number), &drawn, self.gpu.cuts_loops()));
        }
        if let Some(number) = counts.overlapping {
            return Err(overlapping(NAME, submitted.order.get(number)));
        }
        if counts.cut {
            return Err(cut_short(NAME, self.gpu.name(), submitted.step));
        }
        frame.warnings = drawn.iter().flat_map(|s| s.warnings.clone()).collect();
        if counts.rays == 0 && !drawn.is_empty() {
            let message = "no ray meets any shape; check camera, near and far, and transforms";
            frame.warnings.push(Warning::new(WarningCode::NothingVisible, NAME, message));
        }
        frame.warnings.extend(drawn.iter().filter_map(|s| s.coarse_for_shear(submitted.step)));
        frame.warnings.extend(method::adjusted(&drawn, &self.drawing.volumes, &self.settings));
        frame.warnings.extend(without_entry(&drawn));
        self.emit(&frame);
        frame.method = method::method(&drawn, &self.drawing.volumes, &submitted, &self.settings, &self.gpu);
        let stats = &mut frame.statistics;
        (stats.rays, stats.samples, stats.skipped) = (counts.rays, counts.samples, counts.skipped);
        (stats.prepare, stats.total) = (prepare, at.elapsed());
        stats.render = stats.total - prepare;
        stats.resident_bytes = resident;
        (stats.uploaded_bytes, stats.rebuilt, stats.threads) = (uploaded, rebuilt, 1);
        let megabytes = format!("{:.3} MB", self.drawing.volumes.bytes() as f64 * 1e-6);
        stats.details.push(("textures".into(), megabytes));
        if let Some((planes, runs)) = submitted.planes {
            stats.details.push(("planes".into(), planes.planes.to_string()));
            stats.details.push(("runs of planes".into(), runs.to_string()));
        }
        if submitted.bands > 1 {
            stats.details.push(("submissions".into(), submitted.bands.to_string()));
        }
        if let Some(seconds) = counts.seconds {
            stats.details.push(("GPU time".into(), format!("{:.3} ms", seconds * 1e3)));
        }
        Ok(frame)
    }

    fn emit(&mut self, frame: &Frame) {
        for warning in frame.warnings.iter().filter(|w| w.severity == Severity::Warning) {
            if self.said.insert(warning.to_string()) {
                warning.emit();
            }
        }
    }
}

impl RenderAction for WgpuAction {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        action::caps(self.gpu.description())
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        let programs = &self.programs;
        self.lifecycle.manage(shape, |shape| action::check(NAME, shape, programs))?;
        log::debug!("wgpu: manages {:?}", shape.name());
        Ok(())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        let mut started = Started { at: Instant::now(), uploaded: 0, rebuilt: Vec::new() };
        let programs = &self.programs;
        let open = self.lifecycle.begin(frame, |shape| action::check(NAME, shape, programs))?;
        let shapes: Vec<ResolvedShape> = open.shapes.values().cloned().collect();
        let scopes = self.gpu.scopes();
        let prepared = self.prepare(&shapes, &mut started);
        if let Err(error) = scopes.close(self.gpu.name()).map_err(ActionError::from).and(prepared) {
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
        self.finish_scoped(None)
    }

    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        self.lifecycle.outside("set_option")?;
        let mut given = self.given.clone();
        given.insert(name.into(), value);
        let resolved = self.declaration.resolve(&given, |_| false);
        let resolved = resolved.map_err(|problems| ActionError::Options { action: NAME.into(), problems })?;
        let settings = Settings::read(&resolved);
        if settings.adapter != self.settings.adapter {
            self.gpu = Gpu::open(&settings.adapter)?;
            self.drawing = Drawing::default();
        }
        (self.settings, self.given) = (settings, given);
        Ok(())
    }
}
