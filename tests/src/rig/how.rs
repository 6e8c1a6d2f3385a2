//! What a case wishes of an action: options that it takes if it has them.

use volact_core::{FrameDesc, ParameterValue, Shape};

/// Wishes for options. By default rays are never cut short, tables are applied in the middle of
/// segments, and two threads draw.
#[derive(Clone, Debug)]
pub struct How {
    wishes: Vec<(String, ParameterValue)>,
}

impl Default for How {
    fn default() -> Self {
        Self::bare().with("termination", 0.0).with("classification", "post").with("threads", 2i64)
    }
}

impl How {
    /// No wish: the action as it is by default.
    pub fn bare() -> Self {
        Self { wishes: Vec::new() }
    }

    /// The usual wishes, and a world distance between samples.
    pub fn step(step: f64) -> Self {
        Self::default().with("sample_distance", step)
    }

    /// The usual wishes, pre-integrated, and a world distance between samples.
    pub fn segments(step: f64) -> Self {
        Self::step(step).with("classification", "pre-integrated")
    }

    /// Wishes for an option; the last wish counts.
    pub fn with(mut self, name: &str, value: impl Into<ParameterValue>) -> Self {
        self.wishes.retain(|(n, _)| n != name);
        self.wishes.push((name.into(), value.into()));
        self
    }

    /// All wishes.
    pub fn wishes(&self) -> &[(String, ParameterValue)] {
        &self.wishes
    }
}

/// Shapes, in the order of drawing, and what is to be drawn of them.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The shapes.
    pub shapes: Vec<Shape>,
    /// The frame.
    pub desc: FrameDesc,
}

impl Scene {
    /// A scene.
    pub fn new(shapes: impl IntoIterator<Item = Shape>, desc: FrameDesc) -> Self {
        Self { shapes: shapes.into_iter().collect(), desc }
    }

    /// The shapes in another order.
    pub fn reversed(&self) -> Self {
        Self { shapes: self.shapes.iter().rev().cloned().collect(), desc: self.desc.clone() }
    }

    /// The same shapes in another frame.
    pub fn seen(&self, desc: FrameDesc) -> Self {
        Self { shapes: self.shapes.clone(), desc }
    }
}
