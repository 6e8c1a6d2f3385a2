//! Frames: what to draw into, and what came of it.

use std::time::Duration;

use glam::DVec3;
use thiserror::Error;

use crate::{Aabb, Camera, Clip, Opaque, Pixels, Shape, View, Warning, camera::CameraError, planner::Plan};

/// A rectangle of pixels; row 0 is at the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Viewport {
    /// Left column.
    pub x: usize,
    /// Top row.
    pub y: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// What a frame shall be.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameDesc {
    /// Columns of the picture.
    pub width: usize,
    /// Rows of the picture.
    pub height: usize,
    /// The part of the picture that the camera fills; all of it where `None`.
    pub viewport: Option<Viewport>,
    /// The camera.
    pub camera: Camera,
    /// What lies behind everything: straight red, green, blue and opacity.
    pub background: [f32; 4],
    /// Accumulated opacity at which depth is taken, above 0 and at most 1.
    pub depth_threshold: f32,
    /// What cuts all shapes, in world space.
    pub clip: Clip,
    /// What the application has drawn already and volumes lie before, behind and around.
    pub opaque: Option<Opaque>,
}

/// The most pixels of a frame.
pub const MAX_PIXELS: usize = 1 << 28;

/// Why a frame cannot be drawn.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum FrameError {
    /// A picture without pixels or with too many.
    #[error("frame: size is {width} × {height}, wanted 1 to {MAX_PIXELS} pixels")]
    Size {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// A viewport that is empty or reaches outside.
    #[error("frame: viewport is {viewport:?}, wanted a part of {width} × {height} pixels")]
    Viewport {
        /// The viewport.
        viewport: Viewport,
        /// Columns of the picture.
        width: usize,
        /// Rows of the picture.
        height: usize,
    },
    /// A number out of bounds.
    #[error("frame: {what} is {found}, wanted {wanted}")]
    Number {
        /// Which number.
        what: &'static str,
        /// What was found.
        found: String,
        /// What was wanted.
        wanted: &'static str,
    },
    /// The camera is unusable.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

impl FrameDesc {
    /// A picture over black through a camera.
    pub fn new(camera: Camera, width: usize, height: usize) -> Self {
        let background = [0.0, 0.0, 0.0, 1.0];
        Self { width, height, viewport: None, camera, background, depth_threshold: 0.5, clip: Clip::NONE, opaque: None }
    }

    /// A picture over black that shows the whole shape.
    pub fn fit(shape: &Shape, view: View, width: usize, height: usize) -> Self {
        Self::fit_all([shape], view, width, height)
    }

    /// A picture over black that shows all shapes.
    pub fn fit_all<'a>(shapes: impl IntoIterator<Item = &'a Shape>, view: View, width: usize, height: usize) -> Self {
        let bounds = shapes.into_iter().fold(Aabb::EMPTY, |b, s| b.union(&s.state().world_bounds()));
        let bounds = if bounds.is_empty() { Aabb::new(-DVec3::ONE, DVec3::ONE) } else { bounds };
        Self::new(Camera::fit(&bounds, view, width, height), width, height)
    }

    /// Sets the background: straight red, green, blue and opacity.
    pub fn with_background(mut self, background: [f32; 4]) -> Self {
        self.background = background;
        self
    }

    /// Sets what cuts all shapes, in world space.
    pub fn with_clip(mut self, clip: Clip) -> Self {
        self.clip = clip;
        self
    }

    /// Sets what the application has drawn already.
    pub fn with_opaque(mut self, opaque: Opaque) -> Self {
        self.opaque = Some(opaque);
        self
    }

    /// The viewport in force.
    pub fn viewport(&self) -> Viewport {
        self.viewport.unwrap_or(Viewport { x: 0, y: 0, width: self.width, height: self.height })
    }

    /// Checks everything that needs no device.
    ///
    /// # Errors
    /// See [`FrameError`].
    pub fn validate(&self) -> Result<(), FrameError> {
        let (width, height) = (self.width, self.height);
        if !(1..=MAX_PIXELS).contains(&width.saturating_mul(height)) {
            return Err(FrameError::Size { width, height });
        }
        let v = self.viewport();
        let fits = |at: usize, n: usize, all: usize| n > 0 && at.checked_add(n).is_some_and(|end| end <= all);
        if !fits(v.x, v.width, width) || !fits(v.y, v.height, height) {
            return Err(FrameError::Viewport { viewport: v, width, height });
        }
        if !(self.depth_threshold > 0.0 && self.depth_threshold <= 1.0) {
            let found = self.depth_threshold.to_string();
            return Err(FrameError::Number { what: "depth threshold", found, wanted: "above 0 and at most 1" });
        }
        let [r, g, b, a] = self.background;
        if ![r, g, b].iter().all(|v| v.is_finite() && *v >= 0.0) || !(0.0..=1.0).contains(&a) {
            let found = format!("{:?}", self.background);
            return Err(FrameError::Number {
                what: "background",
                found,
                wanted: "finite colours of at least 0, and an opacity of 0 to 1",
            });
        }
        self.camera.rays(&v)?;
        self.opaque.as_ref().map_or(Ok(()), |opaque| opaque.validate(width, height))
    }
}

/// How a picture was made, so that an error can be laid at one cause.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Method {
    /// The way of sampling: `ray casting`, `cell by cell`, …
    pub sampling: String,
    /// World distance between samples; 0 where there is no such distance.
    pub sample_distance: f64,
    /// `post-interpolated`, `pre-integrated`, `exact`, …, shape by shape where they differ.
    pub classification: String,
    /// Entries of the tabulated classification; 0 where nothing is tabulated.
    pub table_width: usize,
    /// Format in which voxels are read.
    pub texture_format: String,
    /// Who interpolates, and how exactly.
    pub filter: String,
    /// Precision of accumulation.
    pub blend: String,
    /// The remaining transmittance below which a ray ends; 0 for never.
    pub termination: f64,
    /// Vector unit or device.
    pub device: String,
}

/// Something that was prepared anew because what it depends on changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rebuild {
    /// The shape's name.
    pub shape: String,
    /// What: `value bounds`, `classification`, `occupancy`, …
    pub what: String,
    /// Bytes written.
    pub bytes: usize,
}

/// What a frame cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Statistics {
    /// From `begin_draw` to the end of `end_draw`.
    pub total: Duration,
    /// The part of it that prepared resources.
    pub prepare: Duration,
    /// The part of it that drew.
    pub render: Duration,
    /// Rays that met a shape.
    pub rays: u64,
    /// Samples evaluated.
    pub samples: u64,
    /// Samples of the lattice that were skipped as provably transparent.
    pub skipped: u64,
    /// Bytes that the action holds besides the volumes and the frame.
    pub resident_bytes: usize,
    /// Bytes moved to a device.
    pub uploaded_bytes: usize,
    /// What was prepared anew.
    pub rebuilt: Vec<Rebuild>,
    /// Threads used.
    pub threads: usize,
    /// Further figures by name, as an action wishes to report them.
    pub details: Vec<(String, String)>,
}

/// A picture, and what it took.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Premultiplied RGBA, row by row from the top, background not included.
    pub color: Pixels<[f32; 4]>,
    /// World distance along the ray at which accumulated opacity first reaches the threshold;
    /// infinite where it never does.
    pub depth: Pixels<f32>,
    /// The background to lay under it: straight RGBA.
    pub background: [f32; 4],
    /// Warnings that arose.
    pub warnings: Vec<Warning>,
    /// How it was made.
    pub method: Method,
    /// What it cost.
    pub statistics: Statistics,
    /// How it was planned, where an error or a time was asked for.
    pub plan: Option<Plan>,
}

impl Frame {
    /// A transparent frame.
    pub fn empty(desc: &FrameDesc) -> Self {
        let pixels = desc.width * desc.height;
        Self {
            width: desc.width,
            height: desc.height,
            color: vec![[0.0; 4]; pixels].into(),
            depth: vec![f32::INFINITY; pixels].into(),
            background: desc.background,
            warnings: Vec::new(),
            method: Method::default(),
            statistics: Statistics::default(),
            plan: None,
        }
    }

    /// The pixel in column `x` and row `y`: premultiplied RGBA without background.
    ///
    /// # Panics
    /// If there is no such pixel.
    pub fn pixel(&self, x: usize, y: usize) -> [f32; 4] {
        assert!(x < self.width && y < self.height, "pixel ({x}, {y}) of {} × {}", self.width, self.height);
        self.color[y * self.width + x]
    }

    /// All pixels with the background laid under: premultiplied RGBA.
    pub fn over_background(&self) -> Vec<[f32; 4]> {
        let [r, g, b, a] = self.background;
        let under = [r * a, g * a, b * a, a];
        let blend = |c: &[f32; 4]| std::array::from_fn(|i| c[i] + (1.0 - c[3]) * under[i]);
        self.color.iter().map(blend).collect()
    }
}
