//! A shape with a program as a ray meets it.

use volact_core::{Clip, Compositing, Ray, SliceStyle, glam::DVec3};

use super::{
    prepare::Prepared,
    program::{Asker, Course, Sample},
    reduce::{self, Gathered},
    search,
};
use crate::reference::{
    dd::Dd,
    hit::Hit,
    lattice::Counting,
    line::{EPS, Place},
    march::Light,
    mark::{Mark, Stretches},
    met::{GAP, Sampling},
    sight::{Crossing, Sight},
};

/// The part of the tolerance that one span of a ray may be wrong by.
const SHARE: f64 = 1.0 / 512.0;
/// The parts that a stretch is cut into at least.
const PARTS: usize = 16;
/// What is not told from rounding.
const LEAST: f64 = 1e-14;

/// A shape on a ray.
pub(in crate::reference) struct Met<'a> {
    pub shape: &'a Prepared,
    /// The ray's `t` from which `t` is counted.
    pub anchor: f64,
    pub(super) course: Course,
    /// Where it is inside, in order.
    pub(super) stretches: Vec<Stretch>,
    /// The length of stretches that are too short to be looked at.
    pub grazed: f64,
}

/// A stretch inside a shape.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    pub t: [f64; 2],
    /// Where it begins on the ray.
    pub start: Mark,
    /// Bound on the error of its ends.
    pub dt: f64,
}

impl<'a> Met<'a> {
    /// A shape on a ray; what it has no length of, slices and surfaces, goes to `hits`. `None` where
    /// nothing else is left of it.
    pub fn new(
        shape: &'a Prepared,
        ray: &Ray,
        world_clip: &Clip,
        sampling: &Sampling,
        seen: &Stretches,
        (asker, hits): (&mut Asker<'_>, &mut Vec<Hit>),
    ) -> Option<Self> {
        let sight = Sight::new(ray, &shape.to_object, shape.center)?;
        let mut left = seen.clone();
        sight.clip(&shape.clip, world_clip, &mut left);
        if let Some(block) = shape.block {
            Place { to_index: Default::default(), block }.crop(&sight, &mut left);
        }
        if let Some(mesh) = &shape.mesh {
            // A lattice's segments are not cut where rounding parts tetrahedra.
            let gap = if sampling.counting.is_none() { 0.0 } else { GAP };
            left = mesh.trace(&sight).stretches(gap).meet(&left);
        }
        let origin = shape.source.origin;
        let at = [0, 1, 2].map(|a| sight.world.at[a].minus(origin[a]));
        let course =
            Course { at: DVec3::from_array(at), direction: ray.direction, depth: sight.anchor - ray.depth_zero };
        let mut made = Self { shape, anchor: sight.anchor, course, stretches: Vec::new(), grazed: 0.0 };
        made.slices(&sight, &left, asker, hits);
        made.take(&left);
        if shape.compositing() == Compositing::First {
            made.surfaces(sampling, asker, hits);
            made.stretches.clear();
        }
        let drawn = shape.slices.as_ref().is_none_or(|s| s.volume);
        (drawn && (!made.stretches.is_empty() || made.grazed > 0.0)).then_some(made)
    }

    /// Whether it is a picture of its own.
    pub fn is_flat(&self) -> bool {
        !matches!(self.shape.compositing(), Compositing::Over | Compositing::First)
    }

    fn take(&mut self, left: &Stretches) {
        for ends in left.as_slice() {
            let t = ends.map(|m| m.from(self.anchor));
            let reach = t[0].abs().max(t[1].abs());
            if !reach.is_finite() {
                continue;
            }
            let dt = 16.0 * EPS * reach + ends[0].error.max(ends[1].error);
            if t[1] - t[0] <= 8.0 * dt {
                self.grazed += (t[1] - t[0] + 2.0 * dt).max(0.0);
            } else {
                self.stretches.push(Stretch { t, start: ends[0], dt });
            }
        }
    }

    /// The cuts of a stretch between which the program's volumes are smooth; some in any case.
    pub(super) fn cuts(&self, stretch: &Stretch) -> Vec<f64> {
        let cuts = self.shape.source.grids.cuts(&self.course, stretch.t);
        let parts = PARTS.div_ceil(cuts.len() - 1);
        let between = |w: &[f64]| {
            let [a, b] = [w[0], w[1]];
            (0..parts).map(move |k| a + (b - a) * k as f64 / parts as f64)
        };
        cuts.windows(2).flat_map(between).chain([stretch.t[1]]).collect()
    }

    /// Slices: as opaque as the unit distance of what is there, or altogether.
    fn slices(&self, sight: &Sight, left: &Stretches, asker: &mut Asker<'_>, hits: &mut Vec<Hit>) {
        let Some(slices) = &self.shape.slices else { return };
        for plane in &slices.planes {
            let (Crossing::Enter(mark) | Crossing::Leave(mark)) =
                sight.object.meet(sight.anchor, plane.normal(), plane.offset())
            else {
                continue;
            };
            let held = left.hold(&mark);
            if held == Some(false) {
                continue;
            }
            let sample = Sample { t: mark.from(self.anchor), ..Sample::default() };
            let [r, g, b, extinction] = asker.media(&self.course, &[sample])[0];
            let alpha = match slices.style {
                SliceStyle::Opaque => 1.0,
                SliceStyle::Blended => -(-extinction * self.shape.source.unit.unwrap_or(1.0)).exp_m1(),
            };
            let hit = Hit::new(mark, [r, g, b].map(|c| [c, c]), [alpha; 2]);
            hits.push(if held.is_some() { hit } else { hit.doubtful() });
        }
    }

    /// Surfaces: where the value crosses those of the control points.
    fn surfaces(&self, sampling: &Sampling, asker: &mut Asker<'_>, hits: &mut Vec<Hit>) {
        let values = &self.shape.source.crossed;
        for stretch in &self.stretches {
            let found = match &sampling.counting {
                None => search::crossings(asker, &self.course, &self.cuts(stretch), values),
                Some(counting) => {
                    let places = self.places(stretch, counting, sampling.between_ends);
                    let at: Vec<_> = places.iter().map(|t| Sample { t: *t, ..Sample::default() }).collect();
                    let known: Vec<_> = places.iter().copied().zip(asker.values(&self.course, &at)).collect();
                    let scale = stretch.t[0].abs().max(stretch.t[1].abs()).max(self.course.at.abs().max_element());
                    search::between(asker, &self.course, &known, values, scale)
                }
            };
            let step = sampling.counting.as_ref().map_or(0.0, Counting::step);
            for (t, error, value) in found {
                let error = error + stretch.dt;
                let mark = Mark { t: Dd::new(self.anchor).add(Dd::new(t)), error, fine: false };
                hits.extend(self.surface(asker, Sample { t, step, value }, mark, error));
            }
        }
    }

    fn surface(&self, asker: &mut Asker<'_>, sample: Sample, mark: Mark, error: f64) -> Option<Hit> {
        let beside = |by: f64| Sample { t: sample.t + by, ..sample };
        let media = asker.media(&self.course, &[sample, beside(-error), beside(error)]);
        let bounds = |c: usize| {
            let numbers = media.iter().map(|m| if c < 3 { m[c] } else { m[c].clamp(0.0, 1.0) });
            numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
        };
        let alpha = bounds(3);
        (alpha[1] > 0.0).then(|| Hit::new(mark, [0, 1, 2].map(bounds), alpha))
    }

    /// Where a lattice has its samples on a stretch.
    fn places(&self, stretch: &Stretch, counting: &Counting, ends: bool) -> Vec<f64> {
        let segments = counting.segments_of(self.anchor, stretch.t);
        if ends {
            std::iter::once(stretch.t[0]).chain(segments.map(|s| s.end)).collect()
        } else {
            segments.map(|s| s.middle()).collect()
        }
    }

    /// The one number of the ray, and what it shows.
    pub fn light(&self, sampling: &Sampling, tolerance: f64, asker: &mut Asker<'_>) -> Light {
        let compositing = self.shape.compositing();
        let mut gathered = Gathered::NONE;
        for stretch in &self.stretches {
            match &sampling.counting {
                None => {
                    let share = (tolerance * SHARE).max(LEAST);
                    gathered.add_stretch(asker, &self.course, &self.cuts(stretch), compositing, share);
                }
                Some(counting) => self.sampled(stretch, counting, sampling.between_ends, asker, &mut gathered),
            }
        }
        let unit = self.shape.source.unit.unwrap_or(1.0);
        let (Some([value, error]), Some(first)) = (gathered.value(compositing, unit), self.stretches.first()) else {
            return Light::NONE;
        };
        let step = self.stretches.iter().map(|s| s.t[1] - s.t[0]).sum();
        reduce::light(asker, &self.course, Sample { t: first.t[0], step, value }, error)
    }

    fn sampled(
        &self,
        stretch: &Stretch,
        counting: &Counting,
        ends: bool,
        asker: &mut Asker<'_>,
        gathered: &mut Gathered,
    ) {
        let segments: Vec<_> = counting.segments_of(self.anchor, stretch.t).collect();
        let sample = |t: f64, step: f64| Sample { t, step, value: 0.0 };
        let places = segments.iter().flat_map(|s| {
            let [a, b] = if ends { [s.start, s.end] } else { [s.middle(); 2] };
            [sample(a, s.length()), sample(b, s.length())]
        });
        let places: Vec<_> = places.collect();
        let values = asker.values(&self.course, &places);
        for (s, v) in segments.iter().zip(values.chunks_exact(2)) {
            gathered.add([v[0], v[1]], s.length());
        }
    }

    /// The tolerance of a span.
    pub(super) fn share(tolerance: f64) -> f64 {
        (tolerance * SHARE).max(LEAST)
    }
}
