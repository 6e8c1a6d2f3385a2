//! A frame's plan: levels, lattices, and which slabs meet which shape.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::{
    Body, Levels, Order, PixelMap, Sampling, SamplingSpace, Slabs, SlicingError, Solid, Step, Sweep,
    block::{BlockCorners, facets},
    cells::{Cells, Run},
    choice::{clusters, in_order, levels},
    hull::hull,
    order::{Depths, Sight, Solidly},
};
use crate::{Clip, FrameDesc, LinearRays, Plane, geometry::ClipRegion};

/// The most slabs of a shape.
const MOST_PLANES: f64 = 1e6;

/// The highest number of a slab that is told from its neighbour.
const HIGHEST: f64 = 1e12;

/// How a frame is sliced. See the [module](super).
#[derive(Debug)]
pub struct Slicing<'a> {
    pub(super) parts: Vec<Part<'a>>,
    /// Shapes that are swept together, from front to back.
    pub(super) clusters: Vec<Vec<usize>>,
    /// Places of shapes from front to back, for slabs of even and of odd number, and groups.
    pub(super) depths: Depths,
    pub(super) map: PixelMap,
    pub(super) clip: Clip,
    pub(super) ends: Option<ClipRegion>,
    perspective: bool,
    step: Step,
}

/// A shape in the plan.
#[derive(Debug)]
pub(super) struct Part<'a> {
    pub solid: &'a Solid,
    pub levels: Levels,
    pub slabs: Slabs,
    pub shape: Form<'a>,
    /// Slabs that lie beyond the eye as levels rise, and as they fall.
    pub runs: [Run; 2],
}

/// What is cut.
#[derive(Debug)]
pub(super) enum Form<'a> {
    Block(BlockCorners),
    /// A block on shells: its corners along the view axis, and cut into cells in which shells are flat.
    Shelled(BlockCorners, Cells<'a>),
    Cells(Cells<'a>),
}

impl<'a> Slicing<'a> {
    /// Plans a frame of these shapes, which are known by their place in `solids` from here on.
    ///
    /// # Errors
    /// If the camera or the sampling is unusable, there are too many planes, or axis-aligned planes of
    /// overlapping shapes differ.
    pub fn new(solids: Vec<&'a Solid>, frame: &FrameDesc, sampling: &Sampling) -> Result<Self, SlicingError> {
        sampling.validate()?;
        let viewport = frame.viewport();
        let rays = frame.camera.rays(&viewport)?;
        let linear = rays.linear();
        let map = PixelMap::new(&rays, &viewport).ok_or_else(|| SlicingError::Number {
            what: "field of view",
            found: "without extent".into(),
            wanted: "rays that span space",
        })?;
        let boxes: Vec<_> = solids.iter().map(|s| Solidly::new(s.bounds(), s.transform())).collect();
        let sight = linear.eye.map_or(Sight::Along(linear.direction), Sight::Eye);
        let levels = levels(&solids, &boxes, sampling.mode, &linear);
        let clusters = clusters(&solids, &boxes, &levels, sight)?;
        let ids: Vec<u64> = solids.iter().map(|s| s.id()).collect();
        let depths = Depths::new(&boxes, &ids, sight);
        let follows = levels.iter().all(|l| matches!(l, Levels::Planes { normal, .. } if *normal == linear.axis));
        let mut made = Self {
            parts: Vec::with_capacity(solids.len()),
            clusters: in_order(clusters, &depths.ranks[0]),
            depths,
            map,
            clip: frame.clip.clone(),
            ends: if follows { None } else { ends(&linear) },
            perspective: linear.eye.is_some(),
            step: Step::default(),
        };
        let limits = if follows { limits(&linear) } else { [f64::NEG_INFINITY, f64::INFINITY] };
        let forms = solids.iter().zip(&levels).map(|(s, l)| form(s, l, linear.axis)).collect();
        made.place(&solids, &levels, forms, sampling, limits)?;
        Ok(made)
    }

    /// Finds steps, anchors and runs.
    fn place(
        &mut self,
        solids: &[&'a Solid],
        levels: &[Levels],
        forms: Vec<Form<'a>>,
        sampling: &Sampling,
        limits: [f64; 2],
    ) -> Result<(), SlicingError> {
        let range = |i: usize| within(forms[i].range(&levels[i], solids[i]), limits);
        let ranges: Vec<[f64; 2]> = (0..forms.len()).map(range).collect();
        let steps = self.steps(solids, levels, sampling, &ranges)?;
        for (i, form) in forms.into_iter().enumerate() {
            let anchor = match sampling.space {
                SamplingSpace::ViewVolume => 0.0,
                SamplingSpace::Object => levels[i].at(solids[i].transform().translation),
                SamplingSpace::Primitive => {
                    levels[i].at(solids[i].transform().transform_point3(solids[i].bounds().center()))
                }
            };
            let slabs = Slabs { anchor, step: steps[i] };
            check(solids[i], &slabs, ranges[i])?;
            let cells = matches!(form, Form::Cells(_));
            let runs = self.runs(&slabs, ranges[i], cells, limits);
            self.parts.push(Part { solid: solids[i], levels: levels[i], slabs, shape: form, runs });
        }
        self.step.planes = self.count(sampling.space);
        Ok(())
    }

    /// The step of each shape.
    fn steps(
        &mut self,
        solids: &[&Solid],
        levels: &[Levels],
        sampling: &Sampling,
        ranges: &[[f64; 2]],
    ) -> Result<Vec<f64>, SlicingError> {
        let alone = sampling.space != SamplingSpace::ViewVolume;
        let mut wanted = Vec::with_capacity(solids.len());
        for i in 0..solids.len() {
            let normal = levels[i].gradient(solids[i].transform().transform_point3(solids[i].bounds().center()));
            wanted.push(sampling.wanted(if alone { &solids[i..=i] } else { solids }, &levels[i], normal)?);
        }
        let smallest = |steps: &[f64]| steps.iter().copied().fold(f64::INFINITY, f64::min);
        if !alone {
            let step = smallest(&wanted);
            wanted.fill(step);
        }
        let mut steps = wanted.clone();
        let slab = |range: &[f64; 2], step: f64, anchor: f64| {
            let [a, b] = Slabs { anchor, step }.touched(range[0], range[1]);
            usize::try_from(b.saturating_sub(a)).unwrap_or(0)
        };
        if alone {
            // Wherever the lattice begins.
            for (step, range) in steps.iter_mut().zip(ranges) {
                let extent = (range[1] - range[0]).max(0.0);
                *step = sampling.widened(*step, extent, |h| ((extent / h).ceil() as usize).saturating_add(1));
            }
        } else if let Some(&step) = steps.first() {
            let unions = unions(levels, ranges);
            let extent = unions.iter().map(|r| (r[1] - r[0]).max(0.0)).sum();
            let count = |h| unions.iter().map(|r| slab(r, h, 0.0)).fold(0, usize::saturating_add);
            steps.fill(sampling.widened(step, extent, count));
        }
        if !steps.is_empty() {
            self.step = Step { distance: smallest(&steps), wanted: smallest(&wanted), planes: 0 };
        }
        Ok(steps)
    }

    /// The slabs before the eye as levels rise, and as they fall.
    fn runs(&self, slabs: &Slabs, range: [f64; 2], cells: bool, limits: [f64; 2]) -> [Run; 2] {
        let zero = if self.perspective { 0.0 } else { f64::NEG_INFINITY };
        let rising = within(range, [zero, f64::INFINITY]);
        let falling = within(range, [f64::NEG_INFINITY, zero]);
        let numbers = |[low, high]: [f64; 2]| {
            if low > high {
                [0, 0]
            } else if !cells {
                slabs.touched(low, high)
            } else {
                // A plane is drawn where its own level is; a plane at 0 belongs to those above.
                let low = if low == zero || low == limits[0] { low.next_down() } else { low };
                slabs.cutting(low, if high == zero { high.next_down() } else { high })
            }
        };
        let falling = if self.perspective { numbers(falling) } else { [0, 0] };
        [Run::new(numbers(rising), true), Run::new(falling, false)]
    }

    /// How many surfaces meet the shapes.
    fn count(&self, space: SamplingSpace) -> usize {
        let runs = |p: &Part<'_>| p.runs.map(|r| r.count).iter().sum::<usize>();
        if space != SamplingSpace::ViewVolume {
            // A slab that holds the eye is in both runs.
            let twice = |p: &&Part<'_>| {
                let [a, b] = p.runs;
                a.count > 0 && b.count > 0 && a.number(0) == b.number(0)
            };
            return self.parts.iter().map(runs).sum::<usize>() - self.parts.iter().filter(twice).count();
        }
        let mut met: Vec<(DVec3, i64, i64)> = Vec::new();
        for part in &self.parts {
            for run in part.runs.iter().filter(|r| r.count > 0) {
                let ends = [run.number(0), run.number(run.count - 1)];
                met.push((part.levels.gradient(DVec3::ZERO), ends[0].min(ends[1]), ends[0].max(ends[1]) + 1));
            }
        }
        let key = |m: &(DVec3, i64, i64)| (m.0.to_array().map(f64::to_bits), m.1);
        met.sort_by_key(key);
        let (mut total, mut last) = (0, None);
        for (normal, start, end) in met {
            let from = match last {
                Some((n, reached)) if n == normal => start.max(reached),
                _ => start,
            };
            total += (end - from).max(0) as usize;
            last = Some((normal, if matches!(last, Some((n, _)) if n == normal) { end.max(from) } else { end }));
        }
        total
    }

    /// The distance between surfaces, what was asked for, and how many there are.
    pub fn step(&self) -> &Step {
        &self.step
    }

    /// The surfaces that cut a shape.
    ///
    /// # Panics
    /// If there is no such shape.
    pub fn levels(&self, shape: usize) -> &Levels {
        &self.parts[shape].levels
    }

    /// The slabs of a shape.
    ///
    /// # Panics
    /// If there is no such shape.
    pub fn slabs(&self, shape: usize) -> &Slabs {
        &self.parts[shape].slabs
    }

    /// What is sliced, as it was given.
    pub fn solids(&self) -> impl ExactSizeIterator<Item = &'a Solid> {
        self.parts.iter().map(|p| p.solid)
    }

    /// Where points of the world lie in the picture.
    pub fn pixel_map(&self) -> &PixelMap {
        &self.map
    }

    /// Shapes in groups from front to back: each group lies wholly before the next. The shapes of one
    /// overlap, or hide one another in a circle.
    pub fn groups(&self) -> &[Vec<usize>] {
        &self.depths.groups
    }

    /// Goes through all slices in an order of depth.
    pub fn sweep(&self, order: Order) -> Sweep<'_> {
        Sweep::new(self, order)
    }

    /// Writes what a block's part between two levels covers: as [`Slice::hull`](super::Slice::hull), for
    /// more than one slab.
    ///
    /// # Panics
    /// If there is no such shape.
    pub fn cover(&self, shape: usize, levels: [f64; 2], out: &mut Vec<DVec2>) {
        out.clear();
        let mut corners = Vec::new();
        self.parts[shape].cover(&self.map, levels, &mut corners, out);
    }

    /// Whether slabs are counted from an eye, so that those of negative level lie on its other side.
    pub(super) fn has_eye(&self) -> bool {
        self.perspective
    }
}

impl Part<'_> {
    /// Writes the hull of a block's part between two levels; nothing for meshes.
    pub fn cover(&self, map: &PixelMap, levels: [f64; 2], corners: &mut Vec<DVec3>, out: &mut Vec<DVec2>) {
        out.clear();
        match &self.shape {
            Form::Block(block) => block.between(levels, corners),
            // Along the view axis the points of a shell are at most as far away as on the ray.
            Form::Shelled(block, _) => block.between([levels[0] * map.least_cosine(), levels[1]], corners),
            Form::Cells(_) => return,
        }
        hull(map, corners, out);
    }
}

impl Form<'_> {
    /// The levels that a shape reaches.
    fn range(&self, levels: &Levels, solid: &Solid) -> [f64; 2] {
        match self {
            Form::Block(corners) => corners.range(),
            // Shells bulge: the nearest point may be any, but is not nearer than the box around.
            Form::Shelled(_, cells) => {
                let world = Solidly::new(solid.bounds(), solid.transform()).around();
                let eye = levels.origin();
                [eye.distance(eye.clamp(world.min, world.max)), cells.range()[1]]
            }
            Form::Cells(cells) => cells.range(),
        }
    }
}

fn form<'a>(solid: &'a Solid, levels: &Levels, axis: DVec3) -> Form<'a> {
    match (solid.body(), levels) {
        (Body::Block(block), Levels::Planes { .. }) => {
            Form::Block(BlockCorners::new(*block, solid.transform(), levels))
        }
        (Body::Block(block), Levels::Shells { center }) => {
            let along = Levels::Planes { normal: axis, origin: *center };
            let corners = BlockCorners::new(*block, solid.transform(), &along);
            Form::Shelled(corners, Cells::new(solid, Arc::new(facets(*block)), levels))
        }
        (Body::Cells(mesh), _) => Form::Cells(Cells::new(solid, Arc::clone(mesh), levels)),
    }
}

fn within(range: [f64; 2], limits: [f64; 2]) -> [f64; 2] {
    [range[0].max(limits[0]), range[1].min(limits[1])]
}

/// The levels along the view axis between which there is something to see.
fn limits(linear: &LinearRays) -> [f64; 2] {
    let start = linear.eye.map_or(0.0, |eye| linear.axis.dot(eye));
    let low = linear.near - start;
    [if linear.eye.is_some() { low.max(0.0) } else { low }, linear.far - start]
}

/// The near and far planes as a clip.
fn ends(linear: &LinearRays) -> Option<ClipRegion> {
    let plane = |offset: f64, sign: f64| {
        let there = offset.is_finite().then_some(linear.axis * offset)?;
        Plane::new(there, linear.axis * sign).ok()
    };
    let planes: Vec<Plane> = plane(linear.near, 1.0).into_iter().chain(plane(linear.far, -1.0)).collect();
    (!planes.is_empty()).then(|| ClipRegion::planes(planes))
}

/// What shapes reach together, by their kind of planes.
fn unions(levels: &[Levels], ranges: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut made: Vec<(Levels, [f64; 2])> = Vec::new();
    for (level, range) in levels.iter().zip(ranges).filter(|(_, r)| r[0] <= r[1]) {
        match made.iter_mut().find(|(l, _)| l == level) {
            Some((_, union)) => *union = [union[0].min(range[0]), union[1].max(range[1])],
            None => made.push((*level, *range)),
        }
    }
    made.into_iter().map(|(_, range)| range).collect()
}

fn check(solid: &Solid, slabs: &Slabs, [low, high]: [f64; 2]) -> Result<(), SlicingError> {
    if low > high {
        return Ok(());
    }
    let count = (high - low) / slabs.step;
    let farthest = (low - slabs.anchor).abs().max((high - slabs.anchor).abs()) / slabs.step;
    let too_many = if count.is_nan() || count > MOST_PLANES {
        Some((count, MOST_PLANES))
    } else if farthest.is_nan() || farthest > HIGHEST {
        Some((farthest, HIGHEST))
    } else {
        None
    };
    too_many.map_or(Ok(()), |(found, wanted)| {
        let (found, wanted) = (format!("{found:.3e}"), format!("{wanted:e}, counted from the lattice's origin"));
        Err(SlicingError::TooMany { shape: solid.name().into(), found, wanted })
    })
}
