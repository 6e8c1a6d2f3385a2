//! How finely, along what and in which space to sample.

use std::{fmt, sync::Arc};

use glam::DVec3;

use super::{Levels, SlicingError, Solid};

/// Along what sampling surfaces lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SamplingMode {
    /// What suits: viewport-aligned planes.
    #[default]
    Auto,
    /// Planes at right angles to the view axis.
    ViewportAligned,
    /// Planes along the faces of each shape's object space that turn most towards the eye. Shapes
    /// that overlap must agree on them.
    AxisAligned,
    /// Spheres around the eye; planes where rays are parallel. In a mesh they are flat in each cell.
    SphericalShells,
}

/// From where slabs are counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SamplingSpace {
    /// From the eye, or the plane through the world's origin where rays are parallel: the one lattice of
    /// the frame. Only here bricks of a volume have no seams.
    #[default]
    ViewVolume,
    /// From the origin of each shape's object space: the planes move with the object, and shapes of
    /// one transform share them.
    Object,
    /// From the middle of each shape's own geometry.
    Primitive,
}

/// How far apart sampling surfaces are.
#[derive(Clone, Debug, PartialEq)]
pub enum Rate {
    /// By a period in voxels along each axis of the volume: 1 gives N planes head on and √3·N along the
    /// diagonal of a cube of N³ voxels. A shape without a volume counts as 256 voxels along the
    /// diagonal of its bounds. The finest shape decides for all that share a lattice.
    Period([f64; 3]),
    /// By a distance in world units.
    Distance(f64),
    /// By somebody who knows what accuracy it takes.
    Accuracy(Planner),
}

impl Default for Rate {
    /// Half a voxel.
    fn default() -> Self {
        Self::Period([0.5; 3])
    }
}

/// Finds the distance between sampling surfaces, in world units, for shapes cut along levels.
#[derive(Clone)]
pub struct Planner(Arc<Hook>);

type Hook = dyn Fn(&[&Solid], &Levels) -> f64 + Send + Sync;

impl Planner {
    /// Asks `hook` once a frame, or once a shape where each has a lattice of its own.
    pub fn new(hook: impl Fn(&[&Solid], &Levels) -> f64 + Send + Sync + 'static) -> Self {
        Self(Arc::new(hook))
    }
}

impl fmt::Debug for Planner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Planner")
    }
}

/// The same hook.
impl PartialEq for Planner {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// How a frame is sampled.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sampling {
    /// Along what sampling surfaces lie.
    pub mode: SamplingMode,
    /// From where slabs are counted.
    pub space: SamplingSpace,
    /// How far apart they are.
    pub rate: Rate,
    /// The most surfaces, at least 2: through all that shares a lattice. Where the rate asks for more,
    /// the step is widened, and [`Step`] says so.
    pub most_planes: Option<usize>,
}

/// What became of the rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// The distance between sampling surfaces in world units; the smallest, where there are several.
    pub distance: f64,
    /// The distance that the rate asked for.
    pub wanted: f64,
    /// How many surfaces meet the shapes.
    pub planes: usize,
}

impl Step {
    /// Whether the bound on the number of planes widened it.
    pub fn is_widened(&self) -> bool {
        self.distance > self.wanted
    }
}

impl Sampling {
    /// Checks the numbers.
    pub(super) fn validate(&self) -> Result<(), SlicingError> {
        let wrong = |what, found: String, wanted| Err(SlicingError::Number { what, found, wanted });
        let positive = |v: &f64| v.is_finite() && *v > 0.0;
        match &self.rate {
            Rate::Period(p) if !p.iter().all(positive) => {
                wrong("sampling period", format!("{p:?}"), "three positive, finite numbers")
            }
            Rate::Distance(d) if !positive(d) => {
                wrong("distance of planes", d.to_string(), "a positive, finite number")
            }
            _ => match self.most_planes {
                Some(n) if n < 2 => wrong("greatest number of planes", n.to_string(), "at least 2"),
                _ => Ok(()),
            },
        }
    }

    /// The distance that the rate asks for, for shapes that share a lattice.
    pub(super) fn wanted(&self, solids: &[&Solid], levels: &Levels, normal: DVec3) -> Result<f64, SlicingError> {
        let distance = match &self.rate {
            Rate::Distance(distance) => *distance,
            Rate::Accuracy(planner) => (planner.0)(solids, levels),
            Rate::Period(period) => {
                let period = DVec3::from_array(*period);
                let one = |s: &&Solid| 1.0 / ((s.to_voxels() * normal) / period).length();
                solids.iter().map(one).fold(f64::INFINITY, f64::min)
            }
        };
        if distance.is_finite() && distance > 0.0 {
            return Ok(distance);
        }
        let (what, wanted) = ("distance of planes", "a positive, finite number");
        Err(SlicingError::Number { what, found: distance.to_string(), wanted })
    }

    /// The distance that keeps the bound, for what `count` says of a distance.
    pub(super) fn widened(&self, wanted: f64, extent: f64, count: impl Fn(f64) -> usize) -> f64 {
        let Some(most) = self.most_planes else { return wanted };
        if count(wanted) <= most {
            return wanted;
        }
        // That many slabs are as long as the extent; where they begin elsewhere, one less is.
        let mut step = wanted.max(extent / most as f64);
        for _ in 0..64 {
            if count(step) <= most {
                return step;
            }
            step *= 1.0 + 0.25 / most as f64;
        }
        wanted.max(extent / (most - 1) as f64 * (1.0 + 1e-9))
    }
}
