//! An action that a planner sets and draws with.

use std::collections::BTreeMap;

use super::knobs;
use crate::{ActionError, Declaration, Frame, FrameDesc, Options, ParameterValue, RenderAction, Shape};

/// An action by its name, with what is set of it.
pub struct Actor {
    /// The registered name.
    pub name: String,
    /// What it declares.
    pub declaration: Declaration,
    /// The options that its user gave, which no planner changes.
    pub given: Options,
    pub(super) action: Box<dyn RenderAction>,
    applied: Options,
    /// The shapes that it does not draw, by id, with the reasons.
    refused: BTreeMap<u64, String>,
}

impl Actor {
    /// An action that was made with options.
    pub fn new(name: &str, action: Box<dyn RenderAction>, given: Options) -> Self {
        let declaration = action.declaration().clone();
        Self { name: name.into(), declaration, given, action, applied: Options::new(), refused: BTreeMap::new() }
    }

    /// Manages a shape, or remembers why not.
    pub(super) fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.refused.remove(&shape.id());
        self.action.manage(shape).inspect_err(|e| {
            log::info!("planned: {} does not draw shape {:?}: {e}", self.name, shape.name());
            self.refused.insert(shape.id(), e.to_string());
        })
    }

    /// Lets a shape go.
    pub(super) fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        match self.refused.remove(&shape.id()) {
            Some(_) => Ok(()),
            None => self.action.unmanage(shape),
        }
    }

    /// Why it does not draw one of the shapes; `None` where it draws all.
    pub(super) fn refusal(&self, shapes: &[Shape]) -> Option<&String> {
        shapes.iter().find_map(|shape| self.refused.get(&shape.id()))
    }

    /// Sets an option for good, if it is declared.
    pub(super) fn give(&mut self, name: &str, value: &ParameterValue) -> Result<bool, ActionError> {
        if self.declaration.parameter(name).is_none() {
            return Ok(false);
        }
        self.action.set_option(name, value.clone())?;
        self.given.insert(name.into(), value.clone());
        Ok(true)
    }

    /// Sets choices and, where there is one to set, the distance of samples.
    pub(super) fn apply(&mut self, choices: &Options, step: Option<f64>) -> Result<(), ActionError> {
        let mut wanted = choices.clone();
        if let Some(step) = step.filter(|_| knobs::has_step(&self.declaration, &self.given)) {
            wanted.insert(knobs::STEP.into(), ParameterValue::Float(step));
        }
        for (name, value) in wanted {
            if self.applied.get(&name) != Some(&value) {
                self.action.set_option(&name, value.clone())?;
                self.applied.insert(name, value);
            }
        }
        Ok(())
    }

    /// Draws one frame.
    pub(super) fn draw(&mut self, desc: &FrameDesc, shapes: &[Shape]) -> Result<Frame, ActionError> {
        self.action.begin_draw(desc)?;
        let drawn = shapes.iter().try_for_each(|shape| self.action.draw(shape));
        let frame = self.action.end_draw();
        drawn.and(frame).inspect(|frame| {
            let (s, of) = (&frame.statistics, [frame.width, frame.height]);
            log::trace!("planned: {} {of:?} took {:?}, {:?} preparing {:?}", self.name, s.total, s.prepare, s.rebuilt);
        })
    }
}
