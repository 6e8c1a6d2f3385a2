//! The `checked` action: wraps any other and verifies order and parameters, both ways.
//!
//! It repeats every check of [`Lifecycle`] around an action that may
//! not make them (a stranger's plugin), and checks what comes back: a frame of the size asked for
//! with finite, premultiplied colours. Name it in a config: `action: "checked", options: {"of": "cpu"}`.

use crate::{
    ActionError, Caps, Context, Declaration, Frame, FrameDesc, ParameterDecl, ParameterType, ParameterValue,
    RenderAction, Shape, lifecycle::Lifecycle, parameter::Kind,
};

/// Verifies another action.
pub struct CheckedAction {
    declaration: Declaration,
    lifecycle: Lifecycle,
    inner: Box<dyn RenderAction>,
}

/// What `checked` says of itself. It passes other options on to the action that it wraps.
pub fn declaration() -> Declaration {
    let text = "wraps another action and verifies the order of calls, parameters and frames";
    Declaration::new(Kind::Action, "checked", env!("CARGO_PKG_VERSION"), text)
        .with(ParameterDecl::new("of", ParameterType::Choice, "the action to wrap").default("cpu"))
}

impl CheckedAction {
    /// Wraps an action.
    pub fn new(context: &Context, inner: Box<dyn RenderAction>) -> Self {
        Self { declaration: declaration(), lifecycle: Lifecycle::new(context.clone()), inner }
    }

    fn fault(&self, what: String) -> ActionError {
        ActionError::Backend { action: self.inner.declaration().name.clone(), source: what.into() }
    }

    fn verify(&self, desc: &FrameDesc, frame: &Frame) -> Result<(), ActionError> {
        let pixels = desc.width * desc.height;
        let found = (frame.width, frame.height, frame.color.len(), frame.depth.len());
        if found != (desc.width, desc.height, pixels, pixels) {
            return Err(self.fault(format!(
                "frame is {found:?} (width, height, colours, depths), wanted {} × {} pixels",
                desc.width, desc.height
            )));
        }
        let bad = frame.color.iter().position(|c| !c.iter().all(|v| v.is_finite() && *v >= 0.0) || c[3] > 1.0 + 1e-5);
        if let Some(i) = bad {
            let (x, y) = (i % desc.width, i / desc.width);
            return Err(self.fault(format!(
                "pixel ({x}, {y}) is {:?}, wanted finite premultiplied colours and an opacity of 0 to 1",
                frame.color[i]
            )));
        }
        match frame.depth.iter().position(|d| d.is_nan()) {
            Some(i) => Err(self.fault(format!("depth of pixel ({}, {}) is NaN", i % desc.width, i / desc.width))),
            None => Ok(()),
        }
    }
}

impl RenderAction for CheckedAction {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        self.inner.caps()
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.inner.manage(shape)?;
        self.lifecycle.manage(shape, |_| Ok(())).map(|_| ())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)?;
        self.inner.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        self.lifecycle.begin(frame, |_| Ok(()))?;
        self.inner.begin_draw(frame).inspect_err(|_| self.lifecycle.abandon())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)?;
        self.inner.draw(shape)
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let frame = self.inner.end_draw()?;
        self.verify(&open.desc, &frame)?;
        Ok(frame)
    }

    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        self.lifecycle.outside("set_option")?;
        self.inner.set_option(name, value)
    }
}
