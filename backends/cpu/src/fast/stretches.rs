//! Where sixteen rays are inside a shape: several stretches each, apart and in order.

use volact_core::{Clip, glam::DVec3, mutated};

use super::{
    packet::{Span, Vectors},
    simd::LANES,
};

/// The stretches of sixteen rays: first ones, second ones, …
#[derive(Clone, Debug, Default)]
pub struct Stretches {
    spans: Vec<Span>,
}

impl Stretches {
    /// One stretch a ray.
    pub fn one(span: Span) -> Self {
        Self { spans: if span.active == 0 { Vec::new() } else { vec![span] } }
    }

    /// Sets the stretches of a lane that has none, in order.
    pub fn set(&mut self, l: usize, stretches: &[[f64; 2]]) {
        if self.spans.len() < stretches.len() {
            self.spans.resize(stretches.len(), Span::NONE);
        }
        for (span, &[start, end]) in self.spans.iter_mut().zip(stretches) {
            (span.start[l], span.end[l]) = (start, end);
            span.active |= 1 << l;
        }
    }

    /// The stretches that are first, second, … of their rays.
    pub fn spans(&self) -> &[Span] {
        &self.spans
    }

    /// Lanes with any.
    pub fn active(&self) -> u32 {
        self.spans.first().map_or(0, |s| s.active)
    }

    /// The stretches of a lane.
    pub fn lane(&self, l: usize) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.spans.iter().take_while(move |s| s.active >> l & 1 == 1).map(move |s| [s.start[l], s.end[l]])
    }

    /// The part of a lane's stretches that holds `t`, or nearly so: a hit on a border is one.
    pub fn holds(&self, l: usize, t: f64) -> bool {
        let near = 1e-12 * t.abs();
        self.lane(l).any(|[a, b]| a - near <= t && t <= b + near)
    }

    /// Takes away what a clip cuts from rays of these points at `t = 0` and directions.
    pub fn clip(&mut self, clip: &Clip, rays: &[Vectors; 2]) {
        let regions = if mutated!("second_clip_region") { 1 } else { usize::MAX };
        for region in clip.regions().iter().take(regions) {
            let inside = Inside::new(region.bounding_planes(), rays);
            if region.keeps_inside() {
                self.keep(&inside);
            } else {
                self.cut(&inside);
            }
        }
    }

    fn keep(&mut self, inside: &Inside) {
        for span in &mut self.spans {
            for l in 0..LANES {
                span.start[l] = span.start[l].max(inside.0.start[l]);
                span.end[l] = span.end[l].min(inside.0.end[l]);
            }
            span.active &= inside.0.active;
            span.settle();
        }
        self.gather();
    }

    fn cut(&mut self, inside: &Inside) {
        let Inside(cut) = inside;
        if self.spans.iter().all(|s| s.active & cut.active == 0) {
            return;
        }
        let mut left = Vec::with_capacity(2 * self.spans.len());
        for span in &self.spans {
            let (mut before, mut after) = (*span, *span);
            after.active &= cut.active;
            for l in (0..LANES).filter(|l| cut.active >> l & 1 == 1) {
                before.end[l] = span.end[l].min(cut.start[l]);
                after.start[l] = span.start[l].max(cut.end[l]);
            }
            before.settle();
            after.settle();
            left.extend([before, after]);
        }
        self.spans = left;
        self.gather();
    }

    /// Moves the stretches of each lane to the front.
    fn gather(&mut self) {
        if let [only] = self.spans.as_slice() {
            if only.active == 0 {
                self.spans.clear();
            }
            return;
        }
        let mut gathered: Vec<Span> = Vec::with_capacity(self.spans.len());
        for l in 0..LANES {
            for (next, span) in self.spans.iter().filter(|s| s.active >> l & 1 == 1).enumerate() {
                if next == gathered.len() {
                    gathered.push(Span::NONE);
                }
                (gathered[next].start[l], gathered[next].end[l]) = (span.start[l], span.end[l]);
                gathered[next].active |= 1 << l;
            }
        }
        self.spans = gathered;
    }
}

/// Where rays are in front of all planes of a region: the same as `core` finds ray by ray.
struct Inside(Span);

impl Inside {
    fn new(planes: &[volact_core::Plane], [origin, direction]: &[Vectors; 2]) -> Self {
        let (mut start, mut end) = ([f64::NEG_INFINITY; LANES], [f64::INFINITY; LANES]);
        for plane in planes {
            for l in 0..LANES {
                let ray = [origin, direction].map(|v| DVec3::new(v[0][l], v[1][l], v[2][l]));
                let (slope, distance) = (plane.normal().dot(ray[1]), plane.distance(ray[0]));
                let t = -distance / slope;
                if slope > 0.0 {
                    start[l] = start[l].max(t);
                } else if slope < 0.0 {
                    end[l] = end[l].min(t);
                } else if distance < 0.0 {
                    end[l] = f64::NEG_INFINITY;
                }
            }
        }
        let mut active = 0;
        for l in 0..LANES {
            active |= u32::from(start[l] < end[l]) << l;
        }
        Self(Span { start, end, active })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{Aabb, ClipRegion, Plane, geometry::Spans};

    /// What `core` says, lane by lane.
    #[test]
    fn stretches_are_those_of_core() {
        let mut seed = 7u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1 << 23) - 1.0
        };
        for case in 0..200 {
            let mut clip = Clip::NONE;
            for i in 0..case % 11 {
                let [p, n] = [0, 1].map(|_| DVec3::new(random(), random(), random()));
                let region = match i % 3 {
                    0 => ClipRegion::plane(Plane::new(p, n).unwrap()),
                    1 => ClipRegion::crop(Aabb::new(p.min(n), p.max(n))).cut(),
                    _ => ClipRegion::plane(Plane::new(p * 2.0, DVec3::X).unwrap()).cut(),
                };
                clip = clip.with(region);
            }
            let mut rays: [Vectors; 2] = [[[0.0; LANES]; 3]; 2];
            rays.iter_mut().flatten().flatten().for_each(|v| *v = random());
            // Some run along planes.
            rays[1][0][3] = 0.0;
            let span = Span { start: [-1.5; LANES], end: [1.5; LANES], active: 0xfff7 };
            let mut found = Stretches::one(span);
            found.clip(&clip, &rays);
            for l in 0..LANES {
                let [o, d] = rays.map(|v| DVec3::new(v[0][l], v[1][l], v[2][l]));
                let mut wanted = if l == 3 { Spans::EMPTY } else { Spans::one(-1.5, 1.5) };
                clip.apply(o, d, &mut wanted);
                assert_eq!(found.lane(l).collect::<Vec<_>>(), wanted.as_slice(), "case {case}, lane {l}");
            }
        }
    }
}
