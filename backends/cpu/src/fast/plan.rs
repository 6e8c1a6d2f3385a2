//! What is decided for a frame before anything is prepared: the step, and which way shapes are
//! drawn.

use volact_core::{Aabb, ActionError, Compositing, TableInterpolation, resolve::ResolvedShape, shape::smallest_voxel};

use super::{check::NAME, options::Settings};

/// Most segments of the lattice along the diagonal of what is drawn.
const MOST_SEGMENTS: f64 = 1e7;

/// What tables depend on beside their shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// World distance between samples.
    pub step: f64,
    /// Whether `over` shapes need the plain way.
    pub general: bool,
}

impl Plan {
    /// The plan for these shapes, whatever their size.
    pub fn guess(shapes: &[&ResolvedShape], settings: &Settings) -> Self {
        Self { step: distance(shapes, settings), general: uses_general(shapes) }
    }

    /// The plan for these shapes.
    ///
    /// # Errors
    /// If the step is too small for one of them.
    pub fn new(shapes: &[&ResolvedShape], settings: &Settings) -> Result<Self, ActionError> {
        let plan = Self::guess(shapes, settings);
        for shape in shapes {
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
    let voxel = |s: &&ResolvedShape| s.volume("volume").map(|t| smallest_voxel(t, &s.state.transform));
    let smallest = shapes.iter().filter_map(voxel).fold(f64::INFINITY, f64::min);
    settings.sample_distance.unwrap_or(if smallest.is_finite() { smallest / 2.0 } else { 1.0 })
}

/// Whether the `over` shapes need the plain way: they may overlap, or are no plain tables.
pub fn uses_general(drawn: &[&ResolvedShape]) -> bool {
    let over: Vec<_> = drawn.iter().filter(|s| s.compositing() == Compositing::Over).collect();
    let plain = |s: &ResolvedShape| match s.table("lookup_table") {
        Some(table) => table.interpolation() == TableInterpolation::Pre,
        None => true,
    };
    let bounds: Vec<_> = over.iter().map(|s| s.world_block()).collect();
    let apart = |a: &Aabb, b: &Aabb| (0..3).any(|i| a.max[i] <= b.min[i] || b.max[i] <= a.min[i]);
    let overlap = bounds.iter().enumerate().any(|(i, a)| bounds[..i].iter().any(|b| !apart(a, b)));
    overlap || over.iter().any(|s| plain(s))
}
