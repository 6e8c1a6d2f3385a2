//! What is decided for a frame: rays or slices, the order of shapes, and the step.

use volact_core::{
    ActionError, Compositing, FrameDesc,
    resolve::ResolvedShape,
    shape::smallest_voxel,
    slicing::{Slicing, Step},
};
use volact_shaders::gpu::{
    is_deep,
    mesh::Meshes,
    runs::{Corner, Polygon, Sliced, Upward, border, corners},
    scene::{Item, Seen},
};

use crate::{
    NAME,
    options::{Means, Settings},
    pipeline::Stage,
};

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

/// Shapes in the order of their module.
pub enum Planned<'a> {
    /// To be drawn by rays, with the step.
    Rays(Vec<Item<'a>>, f64),
    /// To be drawn by slices.
    Slices(Sliced<'a>),
}

/// How samples of a frame lie.
pub struct Lattice<'a> {
    /// World distance between them.
    pub step: f64,
    /// What is known of planes, where there are some.
    pub planes: Option<Step>,
    slabs: Option<(Slicing<'a>, Vec<[usize; 2]>)>,
}

impl<'a> Planned<'a> {
    /// Decides for the shapes of a frame, whose meshes are packed.
    ///
    /// # Errors
    /// If the step is too small, or there are no slices of them.
    pub fn new(
        desc: &FrameDesc,
        (mut items, meshes): (Vec<Item<'a>>, &Meshes),
        settings: &Settings,
    ) -> Result<Self, ActionError> {
        if settings.means == Means::Slices {
            return Ok(Self::Slices(Sliced::new(NAME, (items, meshes), desc, &settings.sampling())?));
        }
        let step = step(&items.iter().map(|i| i.shape).collect::<Vec<_>>(), settings)?;
        // Those composited in depth come first, in an order that does not depend on that of drawing.
        items.sort_by_key(|i| if is_deep(i.program.compositing()) { (0, i.shape.id) } else { (1, 0) });
        Ok(Self::Rays(items, step))
    }

    /// The shapes.
    pub fn items(&self) -> &[Item<'a>] {
        match self {
            Self::Rays(items, _) => items,
            Self::Slices(sliced) => &sliced.items,
        }
    }

    /// Where their samples lie.
    ///
    /// # Errors
    /// If there are too many planes.
    pub fn lattice(&self, desc: &FrameDesc, settings: &Settings) -> Result<Lattice<'_>, ActionError> {
        match self {
            Self::Rays(_, step) => Ok(Lattice { step: *step, planes: None, slabs: None }),
            Self::Slices(sliced) => {
                let slicing = sliced.slicing(NAME, desc, &settings.sampling())?;
                let (planes, groups) = (*slicing.step(), sliced.groups(&slicing));
                // Without shapes there is no step, and nothing that needs one.
                let step = if planes.distance > 0.0 { planes.distance } else { 1.0 };
                Ok(Lattice { step, planes: Some(planes), slabs: Some((slicing, groups)) })
            }
        }
    }
}

impl Lattice<'_> {
    /// The stage that draws these shapes.
    pub fn stage(&self, items: &[Item<'_>]) -> Stage {
        let crossings = || items.iter().any(|i| i.program.compositing() == Compositing::First);
        match &self.slabs {
            None => Stage::Rays,
            Some((_, groups)) => Stage::Slabs { together: groups.iter().any(|g| g[1] - g[0] > 1) || crossings() },
        }
    }

    /// The polygons of slabs, and where there are `surfaces`, of these.
    pub fn corners(&self, seen: &Seen, surfaces: bool) -> Option<(Vec<Corner>, Vec<Polygon>)> {
        let (slicing, groups) = self.slabs.as_ref()?;
        Some(corners(slicing, groups, border(seen, self.step), surfaces, Upward::Yes))
    }
}

/// The most samples that a ray takes of shapes.
pub fn samples(items: &[Item<'_>], step: f64) -> f64 {
    items.iter().map(|i| i.shape.state.world_bounds().size().length()).sum::<f64>() / step
}
