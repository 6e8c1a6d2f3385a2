//! What is decided for a frame before anything is prepared: the step.

use volact_core::{ActionError, resolve::ResolvedShape, shape::smallest_voxel};

use crate::{check::NAME, options::Settings};

/// Most segments of the lattice along the diagonal of what is drawn: their numbers are exact in f32.
const MOST_SEGMENTS: f64 = 1e7;

/// Segments along the diagonal of a shape without voxels.
const PARTS: f64 = 512.0;

/// World distance between the samples of these shapes.
///
/// # Errors
/// If it is too small for one of them.
pub fn step(shapes: &[&ResolvedShape], settings: &Settings) -> Result<f64, ActionError> {
    let size = |s: &ResolvedShape| s.state.world_bounds().size().length();
    let voxel = |s: &ResolvedShape| s.first_volume().map(|t| smallest_voxel(t, &s.state.transform));
    let smallest = shapes.iter().map(|s| voxel(s).unwrap_or(2.0 * size(s) / PARTS)).filter(|v| *v > 0.0);
    let smallest = smallest.fold(f64::INFINITY, f64::min);
    let step = settings.sample_distance.unwrap_or(if smallest.is_finite() { smallest / 2.0 } else { 1.0 });
    for shape in shapes {
        let size = size(shape);
        if size / step > MOST_SEGMENTS {
            return Err(ActionError::Limit {
                action: NAME.into(),
                what: format!("number of samples along a ray of shape {:?}", shape.name),
                found: format!("{:.3e} (size {size:?}, sample_distance {step:?})", size / step),
                wanted: format!("at most {MOST_SEGMENTS:.0e}; take a larger sample_distance"),
            });
        }
    }
    Ok(step)
}
