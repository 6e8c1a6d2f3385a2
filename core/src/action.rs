//! Render actions: *how* to draw.
//!
//! # Life cycle
//! 1. [`manage`](RenderAction::manage) announces a shape (queued; an application may prefetch).
//! 2. [`begin_draw`](RenderAction::begin_draw) validates the frame and does all resource work for
//!    managed shapes: only what changed since the last frame is redone.
//! 3. [`draw`](RenderAction::draw) records a managed shape.
//! 4. [`end_draw`](RenderAction::end_draw) draws what was recorded and gives the [`Frame`].
//! 5. [`unmanage`](RenderAction::unmanage) lets a shape's resources go (queued).
//!
//! # What an implementer promises
//! - The numbers' contract: the same scene gives the same picture, within stated rounding.
//! - Same in, same out: bit-identical for any number of threads.
//! - What it cannot do is an [`ActionError::Unsupported`] that names it, never a wrong picture.
//! - After an error the action is usable again; a failed `begin_draw` leaves no frame open.
//!
//! Checks that need no device are made once, in [`Lifecycle`](crate::lifecycle::Lifecycle), which
//! implementers embed; the `checked` action repeats them around any other action.
//!
//! An action belongs to one thread at a time: it is `Send`, and every call takes `&mut self`.
//!
//! # Example
//! ```
//! use volact_core::{Appearance, FrameDesc, Options, Registry, ScalarType, Shape, View, Volume, VolumeDesc};
//!
//! let registry = Registry::with_core();
//! let volume = Volume::new(VolumeDesc::new([2, 2, 2], ScalarType::U8, 1), vec![255u8; 8])?;
//! let shape = Shape::around(&volume, Appearance::new("simple"));
//! let mut action = registry.action("null", &Options::default())?;
//! action.manage(&shape)?;
//! action.begin_draw(&FrameDesc::fit(&shape, View::Front, 8, 8))?;
//! action.draw(&shape)?;
//! let frame = action.end_draw()?;
//! assert_eq!(frame.pixel(4, 4), [0.0; 4]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::{fmt, sync::Arc};

use thiserror::Error;

use crate::{
    Declaration, Frame, FrameDesc, Shape,
    frame::FrameError,
    geometry::GeometryError,
    parameter::{ParameterMap, ParameterProblem},
    shader::{Compositing, ShaderCatalog, join},
};

/// Options of an action, as it declares them.
pub type Options = ParameterMap;

/// What the host gives to an action when it is made.
#[derive(Clone, Debug, Default)]
pub struct Context {
    /// All shaders known.
    pub shaders: ShaderCatalog,
    /// Hears how far long preparations are.
    pub progress: Watch,
}

/// Hears how far something long is: what is done, how much of it, and of how much. By default
/// nobody hears.
#[derive(Clone, Default)]
pub struct Watch(Option<Arc<Hook>>);

type Hook = dyn Fn(&str, u64, u64) + Send + Sync;

impl Watch {
    /// Calls `hook` with what is being done, how much is done, and how much there is to do; from
    /// any thread.
    pub fn new(hook: impl Fn(&str, u64, u64) + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(hook)))
    }

    /// Tells that `done` of `total` parts of something are done.
    pub fn report(&self, what: &str, done: u64, total: u64) {
        if let Some(hook) = &self.0 {
            hook(what, done, total);
        }
    }
}

impl fmt::Debug for Watch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Watch(heard)" } else { "Watch(unheard)" })
    }
}

/// What an action can do.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Caps {
    /// Names of the shaders that it draws without their source; `None` for any.
    pub shaders: Option<Vec<String>>,
    /// Whether it draws other shaders by their source.
    pub sources: bool,
    /// Names of the geometries that it draws; `None` for any that tessellates.
    pub geometries: Option<Vec<String>>,
    /// The ways of compositing that it draws.
    pub compositing: Vec<Compositing>,
    /// Whether `over` shapes may overlap.
    pub overlap: bool,
    /// Whether frames carry depth.
    pub depth: bool,
    /// What it runs on, e.g. `AVX-512, 2 threads`.
    pub device: String,
}

/// Why a call of an action failed.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ActionError {
    /// A shape is used that is not managed.
    #[error("shape {shape:?} is not managed; call manage before begin_draw")]
    NotManaged {
        /// The shape's name.
        shape: String,
    },
    /// A call belongs between `begin_draw` and `end_draw`.
    #[error("{call} outside a frame; call begin_draw first")]
    NotDrawing {
        /// The call.
        call: &'static str,
    },
    /// A call does not belong inside a frame.
    #[error("{call} inside a frame; call end_draw first")]
    Drawing {
        /// The call.
        call: &'static str,
    },
    /// A shape was managed after the frame began.
    #[error("shape {shape:?} was managed after begin_draw; manage it before, or draw it in the next frame")]
    ManagedLate {
        /// The shape's name.
        shape: String,
    },
    /// A shape changed between `begin_draw` and `draw`.
    #[error("shape {shape:?} changed after begin_draw; change it before, or draw it in the next frame")]
    ChangedLate {
        /// The shape's name.
        shape: String,
    },
    /// A shape was drawn twice in a frame.
    #[error("shape {shape:?} is drawn twice in one frame; draw it once, or make a second shape of the same data")]
    DrawnTwice {
        /// The shape's name.
        shape: String,
    },
    /// A shape names a shader that nobody registered.
    #[error("shape {shape:?}: no shader is called {shader:?}{hint}; known: {known}")]
    UnknownShader {
        /// The shape's name.
        shape: String,
        /// The shader's name.
        shader: String,
        /// The nearest name, as a question.
        hint: String,
        /// All names.
        known: String,
    },
    /// Parameters of a shape are missing, mistyped or unknown.
    #[error("shape {shape:?}, shader {shader:?}: {}", join(problems))]
    Parameters {
        /// The shape's name.
        shape: String,
        /// The shader's name.
        shader: String,
        /// All problems.
        problems: Vec<ParameterProblem>,
    },
    /// The shape's transform cannot be inverted.
    #[error("shape {shape:?}: transform is {found}, wanted a finite, invertible affine map")]
    Transform {
        /// The shape's name.
        shape: String,
        /// What was found.
        found: String,
    },
    /// The shape's geometry is damaged.
    #[error("shape {shape:?}")]
    Geometry {
        /// The shape's name.
        shape: String,
        /// Why.
        source: GeometryError,
    },
    /// A shader's source is wrong, or fails on some sample.
    #[error("shape {shape:?}")]
    Shader {
        /// The shape's name.
        shape: String,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The action cannot do what the scene asks.
    #[error("action {action:?} cannot draw shape {shape:?}: {what}; {cure}")]
    Unsupported {
        /// The action's name.
        action: String,
        /// The shape's name.
        shape: String,
        /// What is missing.
        what: String,
        /// What the user can do.
        cure: String,
    },
    /// The frame asked for cannot be.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// No action of that name.
    #[error("no action is called {name:?}{hint}; known: {known}")]
    UnknownAction {
        /// The name.
        name: String,
        /// The nearest name, as a question.
        hint: String,
        /// All names.
        known: String,
    },
    /// Options of an action are wrong.
    #[error("action {action:?}: {}", join(problems))]
    Options {
        /// The action's name.
        action: String,
        /// All problems.
        problems: Vec<ParameterProblem>,
    },
    /// A limit of memory or work would be passed.
    #[error("action {action:?}: {what} is {found}, wanted {wanted}")]
    Limit {
        /// The action's name.
        action: String,
        /// Which limit.
        what: String,
        /// What the scene needs.
        found: String,
        /// What there is, and the cure.
        wanted: String,
    },
    /// A plugin failed.
    #[error(transparent)]
    Plugin(#[from] crate::plugin::PluginError),
    /// The backend failed.
    #[error("action {action:?} failed")]
    Backend {
        /// The action's name.
        action: String,
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// Draws managed shapes. See the [module](self) for the life cycle and the promises.
pub trait RenderAction: Send {
    /// Name, version, options.
    fn declaration(&self) -> &Declaration;

    /// What it can do.
    fn caps(&self) -> Caps;

    /// Announces a shape. Managing one twice changes nothing.
    ///
    /// # Errors
    /// If its shader, parameters, geometry or transform are wrong or not supported.
    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError>;

    /// Lets a shape go.
    ///
    /// # Errors
    /// If it is not managed, or a frame is open.
    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError>;

    /// Opens a frame and prepares all managed shapes.
    ///
    /// # Errors
    /// If a frame is open, the frame cannot be, or a managed shape cannot be drawn.
    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError>;

    /// Records a shape.
    ///
    /// # Errors
    /// If no frame is open, or the shape is not managed, was changed since, or is drawn already.
    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError>;

    /// Draws what was recorded and closes the frame.
    ///
    /// # Errors
    /// If no frame is open, or drawing fails; the frame is closed in any case.
    fn end_draw(&mut self) -> Result<Frame, ActionError>;

    /// Changes an option for the frames to come.
    ///
    /// # Errors
    /// If the action does not declare it, the value does not fit, or a frame is open.
    fn set_option(&mut self, name: &str, value: crate::ParameterValue) -> Result<(), ActionError>;
}
