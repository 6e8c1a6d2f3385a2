//! What is decided for a frame before anything is prepared: the step, and which shapes may meet.

use volact_core::{Aabb, ActionError, Compositing, resolve::ResolvedShape, shape::smallest_voxel};

use super::{check::NAME, options::Settings, shaded};

/// Most segments of the lattice along the diagonal of what is drawn.
const MOST_SEGMENTS: f64 = 1e7;

/// Segments along the diagonal of a shape without voxels that a shader's source draws.
const PARTS: f64 = 512.0;

/// What tables depend on beside their shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// World distance between samples.
    pub step: f64,
    /// Shapes that may meet others, in rising order of their identities.
    mixed: Vec<u64>,
}

impl Plan {
    /// The plan for these shapes, whatever their size.
    pub fn guess(shapes: &[&ResolvedShape], settings: &Settings) -> Self {
        Self { step: distance(shapes, settings), mixed: mixed(shapes) }
    }

    /// Whether a shape may meet another, so that extinctions add.
    pub fn mixes(&self, id: u64) -> bool {
        self.mixed.binary_search(&id).is_ok()
    }

    /// The plan for these shapes.
    ///
    /// # Errors
    /// If the step is too small for one of them.
    pub fn new(shapes: &[&ResolvedShape], settings: &Settings) -> Result<Self, ActionError> {
        let plan = Self::guess(shapes, settings);
        for shape in shapes.iter().filter(|s| s.first_volume().is_some() || shaded::wanted(s)) {
            let size = shape.state.world_bounds().size().length();
            if size / plan.step > MOST_SEGMENTS {
                return Err(ActionError::Limit {
                    action: NAME.into(),
                    what: format!("number of samples along a ray of shape {:?}", shape.name),
                    found: format!("{:.3e} (size {size:?}, sample_distance {:?})", size / plan.step, plan.step),
                    wanted: format!("at most {MOST_SEGMENTS:.0e}; take a larger sample_distance"),
                });
            }
        }
        Ok(plan)
    }
}

fn distance(shapes: &[&ResolvedShape], settings: &Settings) -> f64 {
    let voxel = |s: &&ResolvedShape| s.first_volume().map(|t| smallest_voxel(t, &s.state.transform));
    let size = |s: &ResolvedShape| s.state.world_bounds().size().length();
    // A source without a volume says nothing of how fine it is.
    let part = |s: &&ResolvedShape| shaded::wanted(s).then(|| 2.0 * size(s) / PARTS);
    let smallest = shapes.iter().filter_map(|s| voxel(s).or_else(|| part(s)));
    let smallest = smallest.filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
    settings.sample_distance.unwrap_or(if smallest.is_finite() { smallest / 2.0 } else { 1.0 })
}

/// The `over` shapes whose boxes overlap that of another.
fn mixed(drawn: &[&ResolvedShape]) -> Vec<u64> {
    let dense = |s: &&&ResolvedShape| {
        s.compositing() == Compositing::Over && s.state.geometry.slices().is_none_or(|slices| slices.volume)
    };
    let boxes: Vec<(u64, Aabb)> = drawn.iter().filter(dense).map(|s| (s.id, s.world_block())).collect();
    let apart = |a: &Aabb, b: &Aabb| (0..3).any(|i| a.max[i] <= b.min[i] || b.max[i] <= a.min[i]);
    let meets = |(id, own): &(u64, Aabb)| boxes.iter().any(|(other, b)| other != id && !apart(own, b));
    let mut mixed: Vec<u64> = boxes.iter().filter(|b| meets(b)).map(|(id, _)| *id).collect();
    mixed.sort_unstable();
    mixed
}
