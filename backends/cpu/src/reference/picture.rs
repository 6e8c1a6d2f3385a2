//! From shapes to a picture, and what of it is certified.

use volact_core::{ActionError, FrameDesc, Viewport, resolve::ResolvedShape};

use super::{
    options::ReferenceOptions,
    scene::{Pixel, Scene},
};

/// A picture with an enclosure for each pixel: premultiplied RGBA, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferencePicture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// No channel is below this. For a lattice the same as `color`, but for rounding.
    pub lower: Vec<[f64; 4]>,
    /// No channel is above this.
    pub upper: Vec<[f64; 4]>,
    /// The middle of the enclosure.
    pub color: Vec<[f64; 4]>,
    /// World distance along the ray at which accumulated opacity reaches the threshold; infinite
    /// where it never does. Not enclosed.
    pub depth: Vec<f64>,
    /// Pixels with a channel whose enclosure is wider than the tolerance.
    pub not_certified: usize,
    /// The widest enclosure of all certified pixels and channels.
    pub widest_certified: f64,
    /// The widest enclosure of all.
    pub widest: f64,
    /// Rays that met a shape.
    pub rays: u64,
    /// Stretches integrated, cells gathered, or samples taken.
    pub samples: u64,
    /// The shapes whose shader was evaluated from its source. Unless on a lattice, what they add to
    /// the width of enclosures is an estimate and no bound.
    pub estimated: Vec<String>,
}

/// Integrates a picture of shapes, in the order in which they were drawn.
///
/// # Errors
/// If the frame cannot be, a shape is refused by [`check`](super::check), a lattice is too fine, or a
/// shader's program fails on a sample.
pub fn integrate(
    shapes: &[ResolvedShape],
    frame: &FrameDesc,
    options: &ReferenceOptions,
) -> Result<ReferencePicture, ActionError> {
    frame.validate()?;
    let scene = Scene::new(shapes, frame, options)?;
    let picture = gather(scene.rows(), frame, frame.viewport(), options);
    scene.check()?;
    Ok(ReferencePicture { estimated: scene.estimated(), ..picture })
}

fn gather(
    rows: Vec<Vec<Pixel>>,
    frame: &FrameDesc,
    viewport: Viewport,
    options: &ReferenceOptions,
) -> ReferencePicture {
    let pixels = frame.width * frame.height;
    let mut picture = ReferencePicture {
        width: frame.width,
        height: frame.height,
        lower: vec![[0.0; 4]; pixels],
        upper: vec![[0.0; 4]; pixels],
        color: vec![[0.0; 4]; pixels],
        depth: vec![f64::INFINITY; pixels],
        not_certified: 0,
        widest_certified: 0.0,
        widest: 0.0,
        rays: 0,
        samples: 0,
        estimated: Vec::new(),
    };
    for (y, row) in rows.into_iter().enumerate() {
        for (x, Pixel { light, samples, met }) in row.into_iter().enumerate() {
            let at = (viewport.y + y) * frame.width + viewport.x + x;
            let width = (0..4).map(|c| light.upper[c] - light.lower[c]).fold(0.0, f64::max);
            if width <= options.tolerance {
                picture.widest_certified = picture.widest_certified.max(width);
            } else {
                picture.not_certified += 1;
            }
            picture.widest = picture.widest.max(width);
            picture.color[at] = [0, 1, 2, 3].map(|c| 0.5 * (light.lower[c] + light.upper[c]));
            (picture.lower[at], picture.upper[at]) = (light.lower, light.upper);
            picture.depth[at] = light.depth;
            picture.rays += u64::from(met);
            picture.samples += samples;
        }
    }
    picture
}
