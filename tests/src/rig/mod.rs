//! What a case is handed: the action under test, truth, and a book of what was found.
//!
//! A comparison that fails is written down and the case goes on; what cannot be drawn at all ends
//! it ([`Stop`]). An action that answers [`ActionError::Unsupported`] is skipped with its own words.

mod compare;
mod how;
mod orders;
mod setup;

use std::collections::BTreeSet;

use volact_core::{ActionError, Frame, Method, Registry, RenderAction, resolve::ResolvedShape, select::can_draw};

use crate::{
    case::Stop,
    outcome::Check,
    subject::Subject,
    truth::{Truths, chain},
};

pub use compare::{Found, Wanted};
pub use how::{How, Scene};
pub use setup::{Setup, draw, draw_managed, integrate_with, on_rays, registry, truth};

/// What a case is handed.
pub struct Rig<'a> {
    registry: Registry,
    subject: &'a Subject,
    truths: &'a Truths,
    case: String,
    checks: Vec<Check>,
    labels: BTreeSet<String>,
    reason: Option<String>,
    extra: Option<(String, f64)>,
}

impl<'a> Rig<'a> {
    /// A rig for one case.
    pub fn new(registry: &Registry, subject: &'a Subject, truths: &'a Truths, case: &str) -> Self {
        Self {
            registry: registry.clone(),
            subject,
            truths,
            case: case.into(),
            checks: Vec::new(),
            labels: BTreeSet::new(),
            reason: None,
            extra: None,
        }
    }

    /// Who is tested.
    pub fn subject(&self) -> &Subject {
        self.subject
    }

    /// The registry, to which a case may add shaders of its own.
    pub fn registry(&mut self) -> &mut Registry {
        &mut self.registry
    }

    /// What was found.
    pub fn into_checks(self) -> Vec<Check> {
        self.checks
    }

    /// Says why tolerances of the comparisons to come may be more than ten times what is observed.
    pub fn because(&mut self, reason: &str) {
        self.reason = Some(reason.into());
    }

    /// Allows more in the comparisons to come, for a stated and derived reason; nothing where `value` is 0.
    pub fn allow(&mut self, what: &str, value: f64) {
        self.extra = (value > 0.0).then(|| (what.to_owned(), value));
    }

    /// A fresh action.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn action(&self, how: &How) -> Result<Box<dyn RenderAction>, Stop> {
        self.subject.action(&self.registry, how.wishes()).map_err(|e| stop(&e))
    }

    /// A frame by a fresh action.
    ///
    /// # Errors
    /// If the action cannot draw the scene (a skip), or fails.
    pub fn draw(&self, scene: &Scene, how: &How) -> Result<Frame, Stop> {
        self.can_draw(scene)?;
        draw(&mut *self.action(how)?, &scene.shapes, &scene.desc).map_err(|e| stop(&e))
    }

    /// A frame by an action at hand, which manages what it does not yet.
    ///
    /// # Errors
    /// If the action cannot draw the scene (a skip), or fails.
    pub fn draw_with(&self, action: &mut dyn RenderAction, scene: &Scene) -> Result<Frame, Stop> {
        self.can_draw(scene)?;
        draw(action, &scene.shapes, &scene.desc).map_err(|e| stop(&e))
    }

    /// What the action says that it can do, against what the scene needs.
    fn can_draw(&self, scene: &Scene) -> Result<(), Stop> {
        let resolve = |s| ResolvedShape::new(s, self.registry.shaders());
        // A scene that is wrong in itself is the action's to refuse.
        let Ok(shapes) = scene.shapes.iter().map(resolve).collect::<Result<Vec<_>, _>>() else { return Ok(()) };
        can_draw(&self.subject.caps, &shapes).map_err(Stop::Skip)
    }

    /// Writes a finding down.
    ///
    /// # Panics
    /// If another finding of the case has the label: labels are keys of kept truth.
    fn note(&mut self, check: Check) {
        assert!(self.labels.insert(check.label.clone()), "{}: two checks are called {:?}", self.case, check.label);
        self.checks.push(check);
    }
}

/// How an action's error ends a case.
pub fn stop(error: &ActionError) -> Stop {
    match error {
        ActionError::Unsupported { .. } => Stop::Skip(chain(error)),
        _ => Stop::Fail(chain(error)),
    }
}

/// A frame's method on a line.
pub fn line(method: &Method) -> String {
    format!(
        "{}; step {}; {}; table {}; format {}; filter {}; blend {}; termination {:.2e}; {}",
        method.sampling,
        method.sample_distance,
        method.classification,
        method.table_width,
        method.texture_format,
        method.filter,
        method.blend,
        method.termination,
        method.device,
    )
}
