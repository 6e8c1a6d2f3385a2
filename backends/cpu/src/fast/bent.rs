//! Rays through a deformed volume: in each tetrahedron sample coordinates are linear along a ray.

use std::ops::ControlFlow;

use volact_core::{Points, geometry::Spans, glam::DVec3};

use super::{
    dispatch,
    fetch::{Base, Voxels},
    mesh::build::Linked,
    over::Job,
    packet::Cuts,
    simd::LANES,
    sweep::gather::{Chunk, Row},
    walk::{CHUNK, Counts},
};

/// How vertices carry a volume along.
#[derive(Clone, Copy, Debug)]
pub struct Bend<'a> {
    /// Texture coordinates of the vertices, 0 to 1 over the data ROI.
    pub texture: &'a Points,
    /// Sample coordinates at texture coordinates 0.
    pub first: DVec3,
    /// How many sample coordinates texture coordinates 0 to 1 are.
    pub size: DVec3,
}

/// A part of a ray on which sample coordinates are linear.
#[derive(Clone, Copy, Debug)]
struct Link {
    t: [f64; 2],
    /// Sample coordinates at its beginning, and their change with `t`.
    from: DVec3,
    slope: DVec3,
}

/// Where sixteen rays are in sample space.
#[derive(Clone, Debug, Default)]
pub struct Bent {
    links: [Vec<Link>; LANES],
}

impl Bent {
    /// Follows a lane's ray, given in object space; returns where it is inside the volume.
    pub fn follow(&mut self, l: usize, mesh: &Linked, bend: &Bend<'_>, ray: [DVec3; 2], span: [f64; 2]) -> Spans {
        let links = &mut self.links[l];
        links.clear();
        mesh.trace(ray[0], ray[1], span, |crossing| {
            let at = crossing.weights.map(|w| {
                let corner = |i: usize| bend.texture.at(crossing.vertices[i] as usize);
                (0..4).map(|i| corner(i) * w[i]).sum::<DVec3>()
            });
            if let Some([a, b]) = inside(at) {
                let [t0, t1] = crossing.span;
                let place = |part: f64| if part >= 1.0 { t1 } else { t0 + part * (t1 - t0) };
                let sample = |part: f64| bend.first + bend.size * (at[0] + (at[1] - at[0]) * part);
                let (t, at) = ([place(a), place(b)], [sample(a), sample(b)]);
                if t[0] < t[1] {
                    links.push(Link { t, from: at[0], slope: (at[1] - at[0]) / (t[1] - t[0]) });
                }
            }
            ControlFlow::Continue(())
        });
        links.sort_by(|a, b| a.t[0].total_cmp(&b.t[0]));
        let joined = |t: f64| 1e-13 * t.abs();
        let mut stretches: Vec<[f64; 2]> = Vec::new();
        for link in links.iter() {
            match stretches.last_mut() {
                Some(last) if link.t[0] <= last[1] + joined(last[1]) => last[1] = last[1].max(link.t[1]),
                _ => stretches.push(link.t),
            }
        }
        Spans::union(stretches)
    }

    /// Sample coordinates of a lane at `t`, which lies on one of its stretches.
    pub fn at(&self, l: usize, t: f64) -> DVec3 {
        let after = self.links[l].partition_point(|link| link.t[0] <= t);
        self.links[l].get(after.saturating_sub(1)).map_or(DVec3::ZERO, |link| link.at(t))
    }

    /// The same, from a link not behind it on; `from` becomes the link.
    fn at_from(&self, l: usize, t: f64, from: &mut usize) -> DVec3 {
        let links = &self.links[l];
        while links.get(*from + 1).is_some_and(|next| next.t[0] <= t) {
            *from += 1;
        }
        links.get(*from).map_or(DVec3::ZERO, |link| link.at(t))
    }
}

impl Link {
    /// Sample coordinates at `t`, or at the nearer end.
    fn at(&self, t: f64) -> DVec3 {
        self.from + self.slope * (t.clamp(self.t[0], self.t[1]) - self.t[0])
    }
}

impl Bent {
    /// What whole segments would add by what lies at positions of lanes.
    fn classify(&self, job: &Job<'_>, live: u32, at: impl FnMut(usize) -> DVec3) -> Row {
        let (base, local) = local(&job.voxels, live, at);
        let mut entries = [[0f32; 4]; LANES];
        dispatch::classify(job.unit, job, &base, &local, live, &mut entries);
        entries
    }

    /// What whole segments would add by what cut segments hold, and the lanes in which there is
    /// one to take.
    pub fn entries(&self, job: &Job<'_>, cut: &[[f64; 2]; LANES], done: u32, counts: &mut Counts) -> (Row, u32) {
        let wanted = (0..LANES).fold(0, |w, l| w | u32::from(cut[l][0] < cut[l][1]) << l) & !done;
        counts.samples += u64::from(wanted.count_ones());
        counts.lattice += u64::from(wanted.count_ones());
        (self.classify(job, wanted, |l| self.at(l, 0.5 * (cut[l][0] + cut[l][1]))), wanted)
    }

    /// Gathers the whole segments of one stretch in the chunk that begins with segment `first`;
    /// returns the next segment in which there may be something.
    pub fn gather(
        &self,
        job: &Job<'_>,
        cuts: &Cuts,
        first: i64,
        done: u32,
        chunk: &mut Chunk,
        counts: &mut Counts,
    ) -> i64 {
        let Some([_, last]) = cuts.whole() else { return i64::MAX };
        let start = first as f64 * job.lattice.step;
        let mut from: [usize; LANES] =
            std::array::from_fn(|l| self.links[l].partition_point(|link| link.t[0] <= start).saturating_sub(1));
        for row in 0..CHUNK {
            let k = first + row as i64;
            let inside = |l: usize| cuts.from[l] <= k as f64 && (k as f64) < cuts.to[l];
            let live = (0..LANES).fold(0, |w, l| w | u32::from(inside(l)) << l) & !done;
            if live != 0 {
                counts.samples += u64::from(live.count_ones());
                let middle = (k as f64 + 0.5) * job.lattice.step;
                chunk.put(row, &self.classify(job, live, |l| self.at_from(l, middle, &mut from[l])));
            }
        }
        let next = first + CHUNK as i64;
        if next >= last { i64::MAX } else { next }
    }
}

/// Positions of lanes relative to a base near the first of them.
pub fn local(voxels: &Voxels<'_>, live: u32, mut at: impl FnMut(usize) -> DVec3) -> (Base, [[f32; LANES]; 3]) {
    let mut places = [DVec3::ZERO; LANES];
    (0..LANES).filter(|l| live >> l & 1 == 1).for_each(|l| places[l] = at(l));
    let base = Base::new(voxels, places[(live.trailing_zeros() as usize).min(LANES - 1)].to_array());
    let mut local = [[0f32; LANES]; 3];
    for a in 0..3 {
        for (local, place) in local[a].iter_mut().zip(&places) {
            *local = (place[a] - f64::from(base.at[a])) as f32;
        }
    }
    (base, local)
}

/// The part, between 0 and 1, of a line from one place to another that lies in the unit cube.
fn inside([a, b]: [DVec3; 2]) -> Option<[f64; 2]> {
    // Places on a face stay there in spite of rounding.
    let (low, high) = (-1e-12, 1.0 + 1e-12);
    let (mut from, mut to) = (0f64, 1f64);
    for axis in 0..3 {
        let (start, change) = (a[axis], b[axis] - a[axis]);
        if start >= low && start <= high && b[axis] >= low && b[axis] <= high {
            continue;
        }
        if change == 0.0 {
            return None;
        }
        let (u, v) = (-start / change, (1.0 - start) / change);
        from = from.max(u.min(v));
        to = to.min(u.max(v));
    }
    (from < to).then_some([from, to])
}
