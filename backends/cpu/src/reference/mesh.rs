//! Meshes: the tetrahedra that a ray crosses, put in order.
//!
//! Each tetrahedron near the ray is met on its own ([`tetra`](super::tetra)); the tree only says
//! which are near. Sorted by where they begin, crossings make *tracks* that do not overlap: one
//! where the mesh is sound, several where its cells overlap, which then count each.
//!
//! # Where crossings meet
//! Neighbours have their common face's crossing to the bit. Where the field goes on there, nothing
//! depends on its exact place, since both sides say the same. Elsewhere (at the border, at cells
//! without a value, where faces do not match) the ends are *loose*: their uncertain place is
//! counted. A crossing without length is left out; what it would have shown is `hidden`.
//!
//! # Rays in faces
//! A ray in a face or an edge is taken on that side of it on which most of the mesh lies, so
//! that the border belongs to the mesh, as it does with blocks.

use std::cmp::Ordering;

use volact_core::{Aabb, Bvh, Tessellation, glam::DVec3};

use super::{
    dd::Dd,
    line::EPS,
    mark::{FINE, Mark, Stretches},
    sight::Sight,
    tetra::{LEANS, Lean, Meeting, Pass, Sheared},
};

/// Tetrahedra ready to be crossed.
#[derive(Clone, Debug)]
pub(super) struct Mesh {
    vertices: Vec<DVec3>,
    /// Corners in rising order, so that all that share a face see it in the same order.
    tetrahedra: Vec<[u32; 4]>,
    tree: Bvh,
    bounds: Aabb,
}

/// A tetrahedron that a ray crosses.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    /// Its vertices.
    pub corners: [u32; 4],
    /// The ray's way in and out.
    pub passes: [Pass; 2],
    /// Where they are.
    pub ends: [Mark; 2],
    /// The same, counted from the trace's anchor.
    pub t: [f64; 2],
}

/// All that a ray crosses, sorted by where it begins.
#[derive(Clone, Debug)]
pub(super) struct Trace {
    pub crossings: Vec<Crossing>,
    /// The ray's `t` from which `t` is counted.
    pub anchor: f64,
    /// The largest |t|.
    pub reach: f64,
    /// Bound on the error of any end.
    pub dt: f64,
}

impl Mesh {
    /// From a tessellation.
    pub fn new(made: &Tessellation) -> Self {
        let vertices: Vec<_> = made.vertices.iter().collect();
        let mut tetrahedra = made.tetrahedra.clone();
        tetrahedra.iter_mut().for_each(|t| t.sort_unstable());
        let around = |t: &[u32; 4]| {
            let corners = t.map(|i| vertices[i as usize]);
            corners.iter().fold(Aabb::EMPTY, |b, &p| b.union(&Aabb::new(p, p)))
        };
        let boxes: Vec<_> = tetrahedra.iter().map(around).collect();
        let bounds = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b));
        Self { tree: Bvh::new(&boxes), vertices, tetrahedra, bounds }
    }

    /// The box around all tetrahedra; empty where there is none.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// What a ray crosses.
    pub fn trace(&self, sight: &Sight) -> Trace {
        let path = &sight.object;
        let sheared = Sheared::new(path, self.bounds.size().max_element());
        let high = |v: [Dd; 3]| DVec3::from_array(v.map(|d| d.hi));
        let mut near = Vec::new();
        let all = [f64::NEG_INFINITY, f64::INFINITY];
        self.tree.line(high(path.at), high(path.step), all, |tetrahedron| near.push(tetrahedron));
        let mut tie = false;
        let mut crossings = self.cross(sight, &sheared, &near, LEANS[0], &mut tie);
        if tie {
            self.take_the_longest(sight, &sheared, &near, &mut crossings);
        }
        let reach = crossings.iter().flat_map(|c| c.t).fold(0.0, |m: f64, t| m.max(t.abs()));
        let error = crossings.iter().flat_map(|c| c.ends).fold(0.0, |m: f64, end| m.max(end.error));
        Trace { crossings, anchor: sight.anchor, reach, dt: 16.0 * EPS * reach + error }
    }

    fn cross(&self, sight: &Sight, ray: &Sheared, near: &[usize], lean: Lean, tie: &mut bool) -> Vec<Crossing> {
        let mut found = Vec::new();
        for &tetrahedron in near {
            let corners = self.tetrahedra[tetrahedron];
            let seen = corners.map(|i| ray.corner(self.vertices[i as usize]));
            if let Meeting::Through(passes) = ray.meet(&seen, lean, tie) {
                let ends = passes.each_ref().map(|p| mark(sight.anchor, p));
                found.push(Crossing { corners, passes, ends, t: ends.map(|m| m.from(sight.anchor)) });
            }
        }
        found.sort_by(|a, b| {
            let order = a.ends[0].order(&b.ends[0]).then(a.ends[1].order(&b.ends[1]));
            order.then(a.corners.cmp(&b.corners))
        });
        found
    }

    fn take_the_longest(&self, sight: &Sight, ray: &Sheared, near: &[usize], crossings: &mut Vec<Crossing>) {
        let length = |all: &[Crossing]| all.iter().map(|c| c.t[1] - c.t[0]).sum::<f64>();
        for lean in &LEANS[1..] {
            let other = self.cross(sight, ray, near, *lean, &mut false);
            // By more than rounding, so that the usual side is kept where both are the same.
            if length(&other) > length(crossings) * (1.0 + 1e-9) {
                *crossings = other;
            }
        }
    }
}

fn mark(anchor: f64, pass: &Pass) -> Mark {
    let scale = pass.tau.hi.abs() + anchor.abs();
    let error = pass.error + FINE * scale;
    Mark { t: Dd::new(anchor).add(pass.tau), error, fine: error <= 1e-20 * scale }
}

impl Crossing {
    /// A linear field where the ray comes in and goes out, from its numbers at the corners.
    pub fn values(&self, corners: &[f64; 4]) -> [f64; 2] {
        self.passes.each_ref().map(|p| p.value(corners))
    }

    /// How far along it a place is: 0 to 1, to rounding, however short it is.
    pub fn part(&self, place: &Mark) -> f64 {
        let [start, end] = &self.ends;
        if place.order(end).is_eq() {
            return 1.0;
        }
        (distance(start, place) / distance(start, end)).clamp(0.0, 1.0)
    }

    /// Bound on the error of barycentric weights.
    pub fn loose(&self) -> f64 {
        self.passes[0].loose.max(self.passes[1].loose)
    }
}

/// A crossing, or a part of one, as part of a track.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// Its number in the trace.
    pub crossing: usize,
    /// Where it begins and ends.
    pub ends: [Mark; 2],
    /// The same, counted from the trace's anchor.
    pub t: [f64; 2],
    /// Whether the places of the ends matter.
    pub loose: [bool; 2],
    /// A crossing without length, on which the field changes, at its beginning.
    pub hidden: Option<usize>,
}

impl Trace {
    /// The stretches inside any tetrahedron. Those no further apart than `gap` times the distances
    /// on the ray are one.
    pub fn stretches(&self, gap: f64) -> Stretches {
        let mut merged: Vec<[Mark; 2]> = Vec::new();
        for Crossing { ends: [start, end], .. } in &self.crossings {
            match merged.last_mut() {
                Some([_, last])
                    if start.compare(last).is_some_and(Ordering::is_le)
                        || start.from(self.anchor) - last.from(self.anchor) < gap * self.reach =>
                {
                    if end.order(last).is_gt() {
                        *last = *end;
                    }
                }
                _ => merged.push([*start, *end]),
            }
        }
        Stretches::from_ordered(merged)
    }

    /// Crossings shared out to tracks on which they do not overlap. `goes_on` says whether the
    /// field at the end of one crossing is that at the beginning of another, and `changes` whether
    /// it changes on a crossing.
    pub fn tracks(
        &self,
        goes_on: impl Fn(&Crossing, &Crossing) -> bool,
        changes: impl Fn(&Crossing) -> bool,
    ) -> Vec<Vec<Step>> {
        let mut tracks: Vec<Vec<Step>> = Vec::new();
        let mut hidden = None;
        for (number, crossing) in self.crossings.iter().enumerate() {
            let track = self.track_for(&mut tracks, crossing.t[0]);
            let (ends, t) = (crossing.ends, crossing.t);
            let mut step = Step { crossing: number, ends, t, loose: [true; 2], hidden: None };
            let mut last = track.and_then(|i| tracks[i].last_mut());
            if let Some(last) = &mut last
                && hidden.is_none()
                && last.t[1] == t[0]
                && goes_on(&self.crossings[last.crossing], crossing)
            {
                (last.loose[1], step.loose[0]) = (false, false);
            }
            if let Some(last) = last.filter(|last| last.t[1] > t[0]) {
                (step.ends[0], step.t[0]) = (last.ends[1], last.t[1]);
            }
            if step.t[1] <= step.t[0] {
                hidden = if changes(crossing) { Some(number) } else { hidden };
                continue;
            }
            step.hidden = hidden.take();
            match track {
                Some(i) => tracks[i].push(step),
                None => tracks.push(vec![step]),
            }
        }
        // At the end of the mesh there is no next step.
        if let Some(last) = tracks.iter_mut().filter_map(|t| t.last_mut()).next_back() {
            last.hidden = last.hidden.or(hidden);
        }
        tracks
    }

    /// The track that ends last before a place, give or take rounding.
    fn track_for(&self, tracks: &mut [Vec<Step>], start: f64) -> Option<usize> {
        let end = |track: &Vec<Step>| track.last().map_or(f64::INFINITY, |s| s.t[1]);
        let fits = (0..tracks.len()).filter(|&i| end(&tracks[i]) <= start + self.dt);
        fits.max_by(|&a, &b| end(&tracks[a]).total_cmp(&end(&tracks[b])))
    }
}

/// The length between two places, without cancellation.
pub(super) fn distance(from: &Mark, to: &Mark) -> f64 {
    to.t.add(from.t.negate()).hi
}

/// What of a track lies in stretches.
pub(super) fn restrict(track: &[Step], stretches: &Stretches, anchor: f64) -> Vec<Step> {
    let mut parts = Vec::with_capacity(track.len());
    for step in track {
        for [start, end] in stretches.as_slice() {
            let mut part = *step;
            if start.order(&step.ends[0]).is_gt() {
                (part.ends[0], part.t[0]) = (*start, start.from(anchor));
                (part.loose[0], part.hidden) = (true, None);
            }
            if end.order(&step.ends[1]).is_lt() {
                (part.ends[1], part.t[1]) = (*end, end.from(anchor));
                part.loose[1] = true;
            }
            if part.t[0] < part.t[1] {
                parts.push(part);
            }
        }
    }
    parts
}
