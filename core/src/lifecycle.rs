//! The part of an action's life that is the same for all: who is managed, whether a frame is
//! open, what is drawn in which order, and every check that needs no device.

use std::collections::BTreeMap;

use crate::{ActionError, Context, FrameDesc, Shape, resolve::ResolvedShape};

/// Bookkeeping that an action embeds.
#[derive(Debug, Default)]
pub struct Lifecycle {
    context: Context,
    managed: BTreeMap<u64, Shape>,
    frame: Option<OpenFrame>,
}

/// A frame between `begin_draw` and `end_draw`.
#[derive(Debug)]
pub struct OpenFrame {
    /// What was asked for.
    pub desc: FrameDesc,
    /// All managed shapes as they were at `begin_draw`, by id.
    pub shapes: BTreeMap<u64, ResolvedShape>,
    /// Versions of the shapes' data at `begin_draw`, by id.
    versions: BTreeMap<u64, u64>,
    /// Ids of the shapes drawn, in order.
    pub drawn: Vec<u64>,
}

impl OpenFrame {
    /// The shapes drawn, in order.
    pub fn drawn_shapes(&self) -> impl Iterator<Item = &ResolvedShape> {
        self.drawn.iter().map(|id| &self.shapes[id])
    }
}

impl Lifecycle {
    /// Nobody managed, no frame open.
    pub fn new(context: Context) -> Self {
        Self { context, managed: BTreeMap::new(), frame: None }
    }

    /// What the host gave.
    pub fn context(&self) -> &Context {
        &self.context
    }

    /// Takes a shape in after `check` has accepted it. `false` if it was managed already.
    ///
    /// # Errors
    /// If the shape is wrong in itself, or `check` refuses it.
    pub fn manage(
        &mut self,
        shape: &Shape,
        check: impl FnOnce(&ResolvedShape) -> Result<(), ActionError>,
    ) -> Result<bool, ActionError> {
        check(&ResolvedShape::new(shape, &self.context.shaders)?)?;
        Ok(self.managed.insert(shape.id(), shape.clone()).is_none())
    }

    /// Lets a shape go.
    ///
    /// # Errors
    /// If it is not managed, or a frame is open.
    pub fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.outside("unmanage")?;
        match self.managed.remove(&shape.id()) {
            Some(_) => Ok(()),
            None => Err(ActionError::NotManaged { shape: shape.name().into() }),
        }
    }

    /// Opens a frame: resolves every managed shape and checks it.
    ///
    /// # Errors
    /// If a frame is open already, or `desc` or a shape is wrong; then no frame is open.
    pub fn begin(
        &mut self,
        desc: &FrameDesc,
        check: impl Fn(&ResolvedShape) -> Result<(), ActionError>,
    ) -> Result<&OpenFrame, ActionError> {
        self.outside("begin_draw")?;
        desc.validate()?;
        let mut shapes = BTreeMap::new();
        let mut versions = BTreeMap::new();
        for (&id, shape) in &self.managed {
            let resolved = ResolvedShape::new(shape, &self.context.shaders)?;
            check(&resolved)?;
            versions.insert(id, content_version(&resolved));
            shapes.insert(id, resolved);
        }
        let frame = OpenFrame { desc: desc.clone(), shapes, versions, drawn: Vec::new() };
        Ok(self.frame.insert(frame))
    }

    /// Records a shape.
    ///
    /// # Errors
    /// If no frame is open, or the shape is not managed, was managed or changed since
    /// `begin_draw`, or is drawn already.
    pub fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        let frame = self.frame.as_mut().ok_or(ActionError::NotDrawing { call: "draw" })?;
        let (id, name) = (shape.id(), shape.name());
        let Some(resolved) = frame.shapes.get(&id) else {
            let late = self.managed.contains_key(&id);
            let shape = name.to_owned();
            return Err(if late { ActionError::ManagedLate { shape } } else { ActionError::NotManaged { shape } });
        };
        let now = ResolvedShape::new(shape, &self.context.shaders)?;
        if !now.same_content(resolved) || content_version(&now) != frame.versions[&id] {
            return Err(ActionError::ChangedLate { shape: name.into() });
        }
        if frame.drawn.contains(&id) {
            return Err(ActionError::DrawnTwice { shape: name.into() });
        }
        frame.drawn.push(id);
        Ok(())
    }

    /// Closes the frame and hands it over.
    ///
    /// # Errors
    /// If none is open.
    pub fn end(&mut self) -> Result<OpenFrame, ActionError> {
        self.frame.take().ok_or(ActionError::NotDrawing { call: "end_draw" })
    }

    /// Drops an open frame, for a `begin_draw` that failed after [`begin`](Self::begin).
    pub fn abandon(&mut self) {
        self.frame = None;
    }

    /// The open frame, if there is one.
    pub fn frame(&self) -> Option<&OpenFrame> {
        self.frame.as_ref()
    }

    /// Whether a shape is managed.
    pub fn is_managed(&self, id: u64) -> bool {
        self.managed.contains_key(&id)
    }

    /// Refuses a call inside a frame.
    ///
    /// # Errors
    /// If a frame is open.
    pub fn outside(&self, call: &'static str) -> Result<(), ActionError> {
        if self.frame.is_some() { Err(ActionError::Drawing { call }) } else { Ok(()) }
    }
}

/// The newest version among the data of a shape.
fn content_version(shape: &ResolvedShape) -> u64 {
    shape.parameters.values().map(crate::ParameterValue::content_version).max().unwrap_or(0)
}
