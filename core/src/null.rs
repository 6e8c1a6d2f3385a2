//! The `null` action: keeps the life cycle and draws nothing. For tests, and a template.

use crate::{
    ActionError, Caps, Context, Declaration, Frame, FrameDesc, Options, ParameterValue, RenderAction, Shape,
    lifecycle::Lifecycle, parameter::Kind,
};

/// Draws nothing, correctly.
#[derive(Debug)]
pub struct NullAction {
    declaration: Declaration,
    lifecycle: Lifecycle,
}

/// What `null` says of itself.
pub fn declaration() -> Declaration {
    Declaration::new(Kind::Action, "null", env!("CARGO_PKG_VERSION"), "draws nothing; for tests")
}

impl NullAction {
    /// Makes one.
    pub fn new(context: &Context) -> Self {
        Self { declaration: declaration(), lifecycle: Lifecycle::new(context.clone()) }
    }
}

impl RenderAction for NullAction {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn caps(&self) -> Caps {
        Caps { overlap: true, device: "none".into(), ..Caps::default() }
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.manage(shape, |_| Ok(())).map(|_| ())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        self.lifecycle.begin(frame, |_| Ok(())).map(|_| ())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let mut frame = Frame::empty(&open.desc);
        frame.warnings = open.drawn_shapes().flat_map(|s| s.warnings.clone()).collect();
        Ok(frame)
    }

    fn set_option(&mut self, name: &str, value: ParameterValue) -> Result<(), ActionError> {
        let given = Options::from([(name.to_owned(), value)]);
        let refused = self.declaration.resolve(&given, |_| false).err();
        self.lifecycle.outside("set_option")?;
        match refused {
            Some(problems) => Err(ActionError::Options { action: "null".into(), problems }),
            None => Ok(()),
        }
    }
}
