//! Actions by name and option, and a picture in one call.

use volact_core::{ActionError, Frame, FrameDesc, Options, ParameterValue, Registry, RenderAction, Shape};
use volact_cpu::reference::{Method, ReferenceOptions, ReferencePicture, integrate};

use crate::metrics::{Picture, wide};

/// A registry that knows core's own actions, `cpu` and `reference`.
///
/// # Panics
/// If a name is taken, which would be a fault of the crates.
pub fn registry() -> Registry {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry).expect("names are free");
    registry
}

/// An action with its options.
#[derive(Clone, Debug)]
pub struct Setup {
    name: String,
    options: Options,
}

impl Setup {
    /// An action as it is by default.
    pub fn new(name: &str) -> Self {
        Self { name: name.into(), options: Options::default() }
    }

    /// `cpu`, on two threads.
    pub fn cpu() -> Self {
        Self::new("cpu").with("threads", 2i64)
    }

    /// `cpu` with this step, classified in the middle of segments, and rays never cut short.
    pub fn post(step: f64) -> Self {
        Self::cpu().step(step).with("classification", "post").with("termination", 0.0)
    }

    /// `cpu` with this step, pre-integrated, and rays never cut short.
    pub fn pre_integrated(step: f64) -> Self {
        Self::cpu().step(step).with("classification", "pre-integrated").with("termination", 0.0)
    }

    /// The certified reference.
    pub fn exact() -> Self {
        Self::new("reference").with("threads", 2i64)
    }

    /// The reference on the lattice of ray casting.
    pub fn rays(step: f64) -> Self {
        Self::exact().with("method", "rays").step(step)
    }

    /// Sets an option.
    pub fn with(mut self, name: &str, value: impl Into<ParameterValue>) -> Self {
        self.options.insert(name.into(), value.into());
        self
    }

    /// Sets the sample distance.
    pub fn step(self, step: f64) -> Self {
        self.with("sample_distance", step)
    }

    /// The action's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its options.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The action.
    ///
    /// # Errors
    /// If it cannot be made here, e.g. for want of a vector unit.
    pub fn try_action(&self) -> Result<Box<dyn RenderAction>, ActionError> {
        registry().action(&self.name, &self.options)
    }

    /// The action.
    ///
    /// # Panics
    /// If it cannot be made.
    pub fn action(&self) -> Box<dyn RenderAction> {
        self.try_action().unwrap_or_else(|e| panic!("{self:?}: {e}"))
    }

    /// The action as another registry makes it, which knows other shaders.
    ///
    /// # Panics
    /// If it cannot be made.
    pub fn action_in(&self, registry: &Registry) -> Box<dyn RenderAction> {
        registry.action(&self.name, &self.options).unwrap_or_else(|e| panic!("{self:?}: {e}"))
    }

    /// One picture of shapes drawn in this order by a fresh action.
    ///
    /// # Panics
    /// If drawing fails.
    pub fn draw(&self, shapes: &[Shape], desc: &FrameDesc) -> Frame {
        draw(&mut *self.action(), shapes, desc).unwrap_or_else(|e| panic!("{self:?}: {e}"))
    }

    /// The colours of [`draw`](Self::draw).
    ///
    /// # Panics
    /// If drawing fails.
    pub fn colors(&self, shapes: &[Shape], desc: &FrameDesc) -> Picture {
        wide(&self.draw(shapes, desc))
    }

    /// The first pixel of a picture of one shape.
    ///
    /// # Panics
    /// If drawing fails.
    pub fn pixel(&self, shape: &Shape, desc: &FrameDesc) -> [f64; 4] {
        self.colors(std::slice::from_ref(shape), desc)[0]
    }
}

/// Manages and draws shapes in this order.
///
/// # Errors
/// Those of the action.
pub fn draw(action: &mut dyn RenderAction, shapes: &[Shape], desc: &FrameDesc) -> Result<Frame, ActionError> {
    shapes.iter().try_for_each(|s| action.manage(s))?;
    draw_managed(action, shapes, desc)
}

/// Draws shapes that are managed already in this order.
///
/// # Errors
/// Those of the action.
pub fn draw_managed(action: &mut dyn RenderAction, shapes: &[Shape], desc: &FrameDesc) -> Result<Frame, ActionError> {
    action.begin_draw(desc)?;
    shapes.iter().try_for_each(|s| action.draw(s))?;
    action.end_draw()
}

/// The certified picture in f64.
///
/// # Panics
/// If a shape or the frame is wrong.
pub fn truth(shapes: &[Shape], desc: &FrameDesc) -> ReferencePicture {
    integrate_with(shapes, desc, &ReferenceOptions { threads: 2, ..ReferenceOptions::default() })
}

/// The reference's picture on the lattice of ray casting, with its enclosure.
///
/// # Panics
/// If a shape or the frame is wrong.
pub fn on_rays(shapes: &[Shape], desc: &FrameDesc, step: f64) -> ReferencePicture {
    let options = ReferenceOptions { method: Method::Rays, sample_distance: step, threads: 2, ..Default::default() };
    integrate_with(shapes, desc, &options)
}

/// Any picture of the reference in f64.
///
/// # Panics
/// If a shape or the frame is wrong.
pub fn integrate_with(shapes: &[Shape], desc: &FrameDesc, options: &ReferenceOptions) -> ReferencePicture {
    let registry = registry();
    let resolve = |s: &Shape| volact_core::resolve::ResolvedShape::new(s, registry.shaders()).expect("a right shape");
    let shapes: Vec<_> = shapes.iter().map(resolve).collect();
    integrate(&shapes, desc, options).expect("a right frame")
}
