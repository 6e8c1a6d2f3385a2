//! The life cycle of `cpu`.

use std::{collections::BTreeSet, time::Instant};

use volact_core::{
    ActionError, Caps, Context, Declaration, Frame, FrameDesc, Options, ParameterValue, RenderAction, Severity, Shape,
    Warning, WarningCode,
    frame::Rebuild,
    lifecycle::Lifecycle,
    mutated,
    parameter::{ParameterProblem, ProblemKind},
    resolve::ResolvedShape,
};
use volact_shaders::without_entry;

use super::{
    check::{self, NAME, check},
    method,
    options::{Settings, declaration},
    picture::Picture,
    plan::Plan,
    resources::Resources,
    shaded::Chosen,
};

/// The fast action.
#[derive(Debug)]
pub struct CpuAction {
    declaration: Declaration,
    given: Options,
    settings: Settings,
    lifecycle: Lifecycle,
    resources: Resources,
    chosen: Chosen,
    started: Option<Started>,
    /// Step and way of the last frame: what is managed beside what is drawn does not change them.
    last: Option<Plan>,
    /// Warnings that the process-wide handler has had.
    said: BTreeSet<String>,
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
            chosen: Chosen::default(),
            started: None,
            last: None,
            said: BTreeSet::new(),
        })
    }
}

fn read(options: &Options) -> Result<Settings, ActionError> {
    Settings::read(options).map_err(|unit| {
        let wanted = format!("a unit of this machine: {} or narrower", super::simd::Unit::detect().name());
        let kind = ProblemKind::Mistyped { found: format!("{unit:?}"), wanted };
        ActionError::Options { action: NAME.into(), problems: vec![ParameterProblem { name: "unit".into(), kind }] }
    })
}

impl RenderAction for CpuAction {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        check::caps(&self.settings)
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        let (chosen, recognise) = (&self.chosen, self.settings.recognise);
        self.lifecycle.manage(shape, |shape| check(&chosen.of(shape, recognise)))?;
        log::debug!("cpu: manages {:?}", shape.name());
        Ok(())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        let start = Instant::now();
        let (chosen, recognise) = (&self.chosen, self.settings.recognise);
        let open = self.lifecycle.begin(frame, |shape| check(&chosen.of(shape, recognise)))?;
        let shapes: Vec<ResolvedShape> = open.shapes.values().map(|s| chosen.of(s, recognise)).collect();
        let managed: Vec<_> = shapes.iter().collect();
        // What is drawn is not known yet: most likely what was drawn last, else everything.
        // Only a distance that was asked for can be refused already: the one chosen for all may be
        // too small for some, and those not drawn together.
        let asked = self.settings.sample_distance.is_some();
        let guess = || Ok(Plan::guess(&managed, &self.settings));
        let plan = if asked { Plan::new(&managed, &self.settings) } else { guess() };
        let plan = match plan {
            Ok(plan) => self.last.clone().unwrap_or(plan),
            Err(error) => {
                self.lifecycle.abandon();
                return Err(error);
            }
        };
        let mut rebuilt = Vec::new();
        self.resources.retain(shapes.iter());
        let how = (&self.settings, &self.lifecycle.context().progress);
        if let Err(error) = self.resources.prepare(shapes.iter(), &plan, how, &mut rebuilt) {
            self.lifecycle.abandon();
            return Err(error);
        }
        self.started = Some(Started { at: start, plan, rebuilt });
        Ok(())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let mut open = self.lifecycle.end()?;
        open.shapes.values_mut().for_each(|shape| self.chosen.apply(shape, self.settings.recognise));
        let Some(Started { at: start, plan: prepared, mut rebuilt }) = self.started.take() else {
            return Err(ActionError::NotDrawing { call: "end_draw" });
        };
        let drawn: Vec<&ResolvedShape> = open.drawn_shapes().collect();
        // What is managed but not drawn must not change the picture.
        let plan = Plan::new(&drawn, &self.settings)?;
        if plan != prepared {
            let how = (&self.settings, &self.lifecycle.context().progress);
            self.resources.prepare(drawn.iter().copied(), &plan, how, &mut rebuilt)?;
        }
        self.last = (!drawn.is_empty()).then(|| plan.clone());
        let prepare = start.elapsed();
        let mut frame = Frame::empty(&open.desc);
        let picture = Picture::new(&open, &drawn, &self.resources, &self.settings, &plan)?;
        let mut counts = picture.draw(&mut frame);
        picture.check()?;
        if mutated!("uncounted_samples") {
            counts.samples = 0;
        }
        if mutated!("empty_frame_is_black") && drawn.is_empty() {
            frame.color = frame.color.iter().map(|_| [0.0, 0.0, 0.0, 1.0]).collect();
        }
        if mutated!("background_in_the_frame") {
            frame.color =
                frame.over_background().iter().zip(frame.color.iter()).map(|(c, a)| [c[0], c[1], c[2], a[3]]).collect();
        }
        frame.warnings = drawn.iter().flat_map(|s| s.warnings.clone()).collect();
        if counts.rays == 0 && !drawn.is_empty() {
            let message = "no ray meets any shape; check camera, near and far, and transforms";
            frame.warnings.push(Warning::new(WarningCode::NothingVisible, NAME, message));
        }
        frame.warnings.extend(method::coarse(&drawn, plan.step, &self.resources));
        frame.warnings.extend(method::lost(&drawn, &self.resources));
        frame.warnings.extend(drawn.iter().filter_map(|s| s.coarse_for_shear(plan.step)));
        frame.warnings.extend(method::adjusted(&drawn, &self.resources, &self.settings));
        frame.warnings.extend(without_entry(&drawn));
        for warning in frame.warnings.iter().filter(|w| w.severity == Severity::Warning) {
            if self.said.insert(warning.to_string()) {
                warning.emit();
            }
        }
        frame.method = method::method(&drawn, &plan, &self.resources, &self.settings);
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
