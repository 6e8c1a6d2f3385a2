//! A shape with a program as a ray meets it.

use volact_core::{
    Clip, Compositing, Ray, SliceStyle,
    glam::{DAffine3, DVec3},
    lattice::Segment,
};

use super::{
    ask::Asker,
    carried::{Lane, Stretch},
    prepare::Prepared,
    program::{Course, Sample},
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
    course: Course<'a>,
    /// Where it is inside: one lane, or several where the cells of a mesh that carries something
    /// overlap.
    pub(super) lanes: Vec<Lane>,
    /// The length of stretches that are too short to be looked at.
    pub grazed: f64,
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
            Place { to_index: DAffine3::IDENTITY, block }.crop(&sight, &mut left);
        }
        let origin = shape.source.origin;
        let at = DVec3::from_array([0, 1, 2].map(|a| sight.world.at[a].minus(origin[a])));
        let depth = sight.anchor - ray.depth_zero;
        let course = Course { at, direction: ray.direction, depth, cells: &[] };
        let mut made = Self { shape, anchor: sight.anchor, course, lanes: Vec::new(), grazed: 0.0 };
        // A lattice's segments are not cut where rounding parts tetrahedra.
        let whole = sampling.counting.is_some();
        match (&shape.mesh, &shape.carried) {
            (Some(mesh), Some(carried)) => made.lanes = carried.lanes(mesh, &sight, &made.course, &left, whole),
            (Some(mesh), None) => {
                left = mesh.trace(&sight).stretches(if whole { GAP } else { 0.0 }).meet(&left);
                made.take(&left);
            }
            (None, _) => made.take(&left),
        }
        made.slices(&sight, &left, asker, hits);
        if shape.compositing() == Compositing::First {
            made.surfaces(sampling, asker, hits);
            made.lanes.clear();
        }
        let drawn = shape.slices.as_ref().is_none_or(|s| s.volume);
        let through = made.lanes.iter().any(|lane| !lane.stretches.is_empty());
        (drawn && (through || made.grazed > 0.0)).then_some(made)
    }

    /// Whether it is a picture of its own.
    pub fn is_flat(&self) -> bool {
        !matches!(self.shape.compositing(), Compositing::Over | Compositing::First)
    }

    /// The ray in a lane.
    pub(super) fn course<'l>(&'l self, lane: &'l Lane) -> Course<'l> {
        Course { cells: &lane.cells, ..self.course }
    }

    fn take(&mut self, left: &Stretches) {
        let mut lane = Lane::default();
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
                lane.stretches.push(Stretch { t, start: ends[0], dt });
            }
        }
        self.lanes.push(lane);
    }

    /// The cuts of a stretch between which the program's volumes are smooth; some in any case.
    pub(super) fn cuts(&self, lane: &Lane, stretch: &Stretch) -> Vec<f64> {
        let cuts = self.shape.source.grids.cuts(&self.course(lane), stretch.t);
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
            let t = mark.from(self.anchor);
            for lane in &self.lanes {
                let held = if lane.cells.is_empty() { left.hold(&mark) } else { lane.holds(t) };
                if held == Some(false) {
                    continue;
                }
                let sample = Sample { t, ..Sample::default() };
                let shade = asker.shades(&self.course(lane), &[sample])[0];
                let [r, g, b, extinction] = shade;
                let nothing = extinction.is_nan() || !(r + g + b).is_finite() || shade == [0.0; 4];
                let alpha = match slices.style {
                    // Where there is nothing an opaque plane is transparent, too.
                    _ if nothing => continue,
                    SliceStyle::Opaque => 1.0,
                    SliceStyle::Blended => -(-extinction.max(0.0) * self.shape.source.unit.unwrap_or(1.0)).exp_m1(),
                };
                let hit = Hit::new(mark, [r, g, b].map(|c| [c, c]), [alpha; 2]);
                hits.push(if held.is_some() { hit } else { hit.doubtful() });
            }
        }
    }

    /// Surfaces: where the value crosses those of the control points.
    fn surfaces(&self, sampling: &Sampling, asker: &mut Asker<'_>, hits: &mut Vec<Hit>) {
        let values = &self.shape.source.crossed;
        let step = sampling.counting.as_ref().map_or(0.0, Counting::step);
        for (lane, stretch) in self.stretches() {
            let course = &self.course(lane);
            let found = match &sampling.counting {
                None => search::crossings(asker, course, &self.cuts(lane, stretch), values),
                Some(counting) => {
                    let segments = counting.segments_of(self.anchor, stretch.t);
                    let places: Vec<_> = std::iter::once(stretch.t[0]).chain(segments.map(|s| s.end)).collect();
                    let at: Vec<_> = places.iter().map(|t| Sample { t: *t, ..Sample::default() }).collect();
                    let known: Vec<_> = places.iter().copied().zip(asker.values(course, &at)).collect();
                    let scale = stretch.t[0].abs().max(stretch.t[1].abs()).max(self.course.at.abs().max_element());
                    search::between(asker, course, &known, values, scale)
                }
            };
            for (t, error, value) in found {
                let error = error + stretch.dt;
                let mark = Mark { t: Dd::new(self.anchor).add(Dd::new(t)), error, fine: false };
                hits.extend(self.surface(asker, course, Sample { t, step, value }, mark, error));
            }
        }
    }

    /// All stretches with their lanes.
    pub(super) fn stretches(&self) -> impl Iterator<Item = (&Lane, &Stretch)> {
        self.lanes.iter().flat_map(|lane| lane.stretches.iter().map(move |stretch| (lane, stretch)))
    }

    fn surface(
        &self,
        asker: &mut Asker<'_>,
        course: &Course<'_>,
        sample: Sample,
        mark: Mark,
        error: f64,
    ) -> Option<Hit> {
        let beside = |by: f64| Sample { t: sample.t + by, ..sample };
        let media = asker.media(course, &[sample, beside(-error), beside(error)]);
        let bounds = |c: usize| {
            let numbers = media.iter().map(|m| if c < 3 { m[c] } else { m[c].clamp(0.0, 1.0) });
            numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)])
        };
        let alpha = bounds(3);
        (alpha[1] > 0.0).then(|| Hit::new(mark, [0, 1, 2].map(bounds), alpha))
    }

    /// The one number of the ray, and what it shows.
    pub fn light(&self, sampling: &Sampling, tolerance: f64, asker: &mut Asker<'_>) -> Light {
        let compositing = self.shape.compositing();
        let mut gathered = Gathered::NONE;
        for (lane, stretch) in self.stretches() {
            let course = &self.course(lane);
            match &sampling.counting {
                None => {
                    let cuts = self.cuts(lane, stretch);
                    gathered.add_stretch(asker, course, &cuts, compositing, Self::share(tolerance));
                }
                Some(counting) => {
                    let segments: Vec<_> = counting.segments_of(self.anchor, stretch.t).collect();
                    sampled(asker, course, &segments, sampling.between_ends, &mut gathered);
                }
            }
        }
        let unit = self.shape.source.unit.unwrap_or(1.0);
        let first = self.stretches().min_by(|a, b| a.1.t[0].total_cmp(&b.1.t[0]));
        let (Some([value, error]), Some((lane, first))) = (gathered.value(compositing, unit), first) else {
            return Light::NONE;
        };
        let step = lane.stretches.iter().map(|s| s.t[1] - s.t[0]).sum();
        reduce::light(asker, &self.course(lane), Sample { t: first.t[0], step, value }, error)
    }

    /// The tolerance of a span.
    pub(super) fn share(tolerance: f64) -> f64 {
        (tolerance * SHARE).max(LEAST)
    }
}

/// Gathers the values of a lattice's segments.
fn sampled(asker: &mut Asker<'_>, course: &Course<'_>, segments: &[Segment], ends: bool, gathered: &mut Gathered) {
    let sample = |t: f64, step: f64| Sample { t, step, value: 0.0 };
    let places = segments.iter().flat_map(|s| {
        let [a, b] = if ends { [s.start, s.end] } else { [s.middle(); 2] };
        [sample(a, s.length()), sample(b, s.length())]
    });
    let places: Vec<_> = places.collect();
    let values = asker.values(course, &places);
    for (s, v) in segments.iter().zip(values.chunks_exact(2)) {
        gathered.add([v[0], v[1]], s.length());
    }
}
