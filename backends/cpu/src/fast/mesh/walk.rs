//! Sixteen rays at once through linked tetrahedra, each on its own way.
//!
//! A ray has reached a triangle with itself on the left of all three edges. Behind it is one new
//! vertex; the sides of the three edges to it tell the one other face through which the ray
//! leaves, and that face has the ray on the left of its edges again once the new vertex has taken
//! the place of the one left behind (cf. M. Maria, S. Horna, L. Aveneau, *Efficient ray traversal
//! of constrained Delaunay tetrahedralization*, 2017). Sides are those of [`face`](super::face):
//! every step leads out of exactly one face, and no two ways meet, so that a way which begins at
//! the boundary ends there.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use super::{
    super::simd::{LANES, Simd},
    build::{Linked, OUTSIDE},
    entries::Hits,
    face::{Beside, Corner, meet, positive},
    project::Slopes,
};

/// All lanes.
const ALL: u32 = 0xffff;

/// How far ways may overlap by rounding, as a part of the depth of the mesh.
const ROUNDING: f32 = 1e-5;

/// A mesh in the space of a picture's rays.
#[derive(Clone, Copy, Debug)]
pub struct Cells<'a> {
    /// The tetrahedra.
    pub linked: &'a Linked,
    /// Position and number of every vertex.
    pub vertices: &'a [[f32; 4]],
}

/// What is done along the ways.
pub trait Along<S: Simd> {
    /// Begins stretches in these lanes, at these numbers.
    ///
    /// # Safety
    /// As for all functions here: called from a function compiled for `S` on a machine with it.
    unsafe fn start(&mut self, lanes: u32, number: S::F);

    /// Goes on in these lanes between two depths, over which the number is linear; the first is
    /// where the last stretch ended. Returns the lanes that need not go on.
    ///
    /// # Safety
    /// As above.
    unsafe fn take(&mut self, lanes: u32, depth: [S::F; 2], number: [S::F; 2]) -> u32;
}

/// Intervals of depth in which something is done, in order.
#[derive(Clone, Debug, Default)]
pub struct Limits {
    /// Beginnings and ends; the end lies before the beginning where a lane has no more.
    pub spans: Vec<[[f32; LANES]; 2]>,
}

/// What came of a walk.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Stretches taken.
    pub crossings: u64,
    /// Lanes whose ways overlap: what was done there is wrong.
    pub overlap: u32,
}

/// Where the rays are.
struct Front<S: Simd> {
    corners: [Corner<S>; 3],
    /// The next doors and turns.
    link: S::I,
    depth: S::F,
    number: S::F,
}

/// Walks all ways that begin at `hits`.
///
/// # Safety
/// As above.
#[inline(always)]
pub unsafe fn walk<S: Simd, A: Along<S>>(
    cells: &Cells<'_>,
    slopes: &Slopes,
    limits: &Limits,
    hits: &mut Hits,
    along: &mut A,
) -> Tally {
    // SAFETY: the caller's promises; links lead to doors, and doors to vertices.
    unsafe {
        let beside = Beside::<S>::new(slopes);
        let zero = S::splat(0.0);
        let nowhere = Corner { x: zero, y: zero, z: zero, number: zero };
        let mut front = Front::<S> { corners: [nowhere; 3], link: S::splat_int(0), depth: zero, number: zero };
        let mut live = hits.begin();
        let mut window = Window::<S>::new(limits);
        let mut tally = Tally::default();
        front.enter(cells, &beside, live, hits);
        along.start(live, front.number);
        // No way is longer than there are doors; this only guards against broken links.
        let mut steps = cells.linked.doors.len() as u64 + 1;
        while live != 0 {
            let before = [front.depth, front.number];
            let ended = front.step(cells, &beside, live);
            let (depth, number) = ([before[0], front.depth], [before[1], front.number]);
            let was = live;
            let outside = S::lt_bits(before[0], window.from) | S::lt_bits(window.to, front.depth);
            if outside & live == 0 {
                tally.crossings += u64::from(live.count_ones());
                live &= !along.take(live, depth, number);
            } else {
                live &= !window.cut(along, live, depth, number, &mut tally.crossings);
            }
            steps -= 1;
            if was & !live != 0 {
                tally.overlap |= front.passes_others(was & !live, hits);
            }
            if ended & live != 0 {
                live = front.leave(cells, &beside, live, ended & live, hits, &mut tally.overlap);
                along.start(live & ended, front.number);
                steps = cells.linked.doors.len() as u64 + 1;
            }
            if steps == 0 {
                tally.overlap |= live;
                break;
            }
        }
        tally
    }
}

impl<S: Simd> Front<S> {
    /// Puts lanes at their next hits.
    #[inline(always)]
    unsafe fn enter(&mut self, cells: &Cells<'_>, beside: &Beside<S>, lanes: u32, hits: &Hits) {
        let mut faces = [[0i32; LANES]; 3];
        let mut links = [0f32; LANES];
        for l in (0..LANES).filter(|l| lanes >> l & 1 == 1) {
            let door = hits.door(l);
            links[l] = f32::from_bits(4 * door);
            let face = cells.linked.face(door);
            (0..3).for_each(|i| faces[i][l] = face[i] as i32);
        }
        // SAFETY: the caller's promises; doors' faces are made of vertices.
        unsafe {
            self.link = S::select_int(lanes, S::as_int(S::load(&links)), self.link);
            for (corner, face) in self.corners.iter_mut().zip(&faces) {
                let new = beside.place(S::rows(cells.vertices.as_ptr().cast(), face));
                *corner = select(lanes, &new, corner);
            }
            let [depth, number] = meet(&self.corners, [self.corners[0].z, self.corners[0].number]);
            self.depth = S::select(lanes, depth, self.depth);
            self.number = S::select(lanes, number, self.number);
        }
    }

    /// Crosses the tetrahedra behind the faces; returns the lanes that leave the mesh.
    #[inline(always)]
    unsafe fn step(&mut self, cells: &Cells<'_>, beside: &Beside<S>, live: u32) -> u32 {
        let mut index = [0i32; LANES];
        // SAFETY: the caller's promises.
        unsafe {
            S::store_int(S::shr::<2>(self.link), &mut index);
            let [apex, first, second, third] = S::rows(cells.linked.doors.as_ptr().cast(), &index);
            S::store_int(S::as_int(apex), &mut index);
            let apex = beside.place(S::rows(cells.vertices.as_ptr().cast(), &index));
            let [a, b, c] = &self.corners;
            let (a, b, c) = (positive(live, &apex, a), positive(live, &apex, b), positive(live, &apex, c));
            // Out between + and −; the vertex that is not of that edge goes.
            let (out_a, out_b) = (b & !c, c & !a);
            let out_c = ALL & !(out_a | out_b);
            let turn = S::and_int(self.link, S::splat_int(3));
            let (one, two) = (S::eq_int_bits(turn, S::splat_int(1)), S::eq_int_bits(turn, S::splat_int(2)));
            let none = !(one | two);
            let slot_0 = out_a & none | out_c & one | out_b & two;
            let slot_1 = out_b & none | out_a & one | out_c & two;
            let other = S::select_int(slot_1, S::as_int(second), S::as_int(third));
            let next = S::select_int(slot_0, S::as_int(first), other);
            let ended = S::eq_int_bits(next, S::splat_int(OUTSIDE as i32));
            // Turns add up, modulo three.
            let sum = S::add_int(S::add_int(S::and_int(next, S::splat_int(3)), turn), S::splat_int(-3));
            let sum = S::add_int(sum, S::and_int(S::sar::<31>(sum), S::splat_int(3)));
            let link = S::add_int(S::and_int(next, S::splat_int(!3)), sum);
            self.link = S::select_int(live & !ended, link, S::splat_int(0));
            self.corners[0] = select(out_a, &apex, &self.corners[0]);
            self.corners[1] = select(out_b, &apex, &self.corners[1]);
            self.corners[2] = select(out_c, &apex, &self.corners[2]);
            let [depth, number] = meet(&self.corners, [self.depth, self.number]);
            self.depth = S::max(depth, self.depth);
            self.number = number;
            ended
        }
    }

    /// Lanes that are done while they are past the beginning of another way: ways overlap there.
    #[cold]
    #[inline(never)]
    unsafe fn passes_others(&self, lanes: u32, hits: &Hits) -> u32 {
        let mut depth = [0f32; LANES];
        // SAFETY: the caller's promises.
        unsafe { S::store(self.depth, &mut depth) };
        let past = |l: usize| hits.begins_before(l, depth[l] - ROUNDING * hits.reach);
        (0..LANES).filter(|l| lanes >> l & 1 == 1 && past(*l)).fold(0, |bits, l| bits | 1 << l)
    }

    /// Takes lanes that have left the mesh to where they enter it again; returns the live lanes.
    #[inline(always)]
    unsafe fn leave(
        &mut self,
        cells: &Cells<'_>,
        beside: &Beside<S>,
        live: u32,
        ended: u32,
        hits: &mut Hits,
        overlap: &mut u32,
    ) -> u32 {
        let mut left = [0f32; LANES];
        // SAFETY: the caller's promises.
        unsafe {
            S::store(self.depth, &mut left);
            let mut again = 0;
            for (l, &left) in left.iter().enumerate().filter(|(l, _)| ended >> l & 1 == 1) {
                if let Some(depth) = hits.advance(l) {
                    again |= 1 << l;
                    *overlap |= u32::from(depth < left - ROUNDING * hits.reach) << l;
                }
            }
            self.enter(cells, beside, again, hits);
            live & !ended | again & !*overlap
        }
    }
}

/// A corner in some lanes, another in the rest.
#[inline(always)]
unsafe fn select<S: Simd>(lanes: u32, a: &Corner<S>, b: &Corner<S>) -> Corner<S> {
    // SAFETY: the caller's promises.
    unsafe {
        Corner {
            x: S::select(lanes, a.x, b.x),
            y: S::select(lanes, a.y, b.y),
            z: S::select(lanes, a.z, b.z),
            number: S::select(lanes, a.number, b.number),
        }
    }
}

/// The interval of depth that each lane is in, or comes to next.
struct Window<'a, S: Simd> {
    limits: &'a Limits,
    at: [usize; LANES],
    from: S::F,
    to: S::F,
}

impl<'a, S: Simd> Window<'a, S> {
    #[inline(always)]
    unsafe fn new(limits: &'a Limits) -> Self {
        // SAFETY: the caller's promises.
        unsafe {
            let (from, to) = match limits.spans.first() {
                Some([from, to]) => (S::load(from), S::load(to)),
                None => (S::splat(f32::INFINITY), S::splat(f32::NEG_INFINITY)),
            };
            Self { limits, at: [0; LANES], from, to }
        }
    }

    /// Takes what lies in the intervals; returns the lanes that need not go on.
    #[inline(always)]
    unsafe fn cut<A: Along<S>>(
        &mut self,
        along: &mut A,
        live: u32,
        depth: [S::F; 2],
        number: [S::F; 2],
        crossings: &mut u64,
    ) -> u32 {
        let mut done = 0;
        // Lanes in whose interval nothing has been taken yet.
        let mut fresh = live;
        // SAFETY: the caller's promises.
        unsafe {
            loop {
                let [from, to] = [S::max(depth[0], self.from), S::min(depth[1], self.to)];
                let some = S::lt_bits(from, to) & fresh & !done;
                if some != 0 {
                    let by = S::div(S::sub(number[1], number[0]), S::sub(depth[1], depth[0]));
                    let at = |d: S::F| S::fma(S::sub(d, depth[0]), by, number[0]);
                    let (whole_0, whole_1) = (S::eq_bits(from, depth[0]), S::eq_bits(to, depth[1]));
                    let ends = [S::select(whole_0, number[0], at(from)), S::select(whole_1, number[1], at(to))];
                    along.start(some & !whole_0, ends[0]);
                    *crossings += u64::from(some.count_ones());
                    done |= along.take(some, [from, to], ends) & some;
                }
                let over = S::lt_bits(self.to, depth[1]) & live & !done;
                let (mut next_from, mut next_to) = ([0f32; LANES], [0f32; LANES]);
                S::store(self.from, &mut next_from);
                S::store(self.to, &mut next_to);
                let mut again = 0;
                for l in (0..LANES).filter(|l| over >> l & 1 == 1) {
                    self.at[l] += 1;
                    match self.limits.spans.get(self.at[l]) {
                        Some([from, to]) if from[l] < to[l] => {
                            (next_from[l], next_to[l]) = (from[l], to[l]);
                            again |= 1 << l;
                        }
                        _ => done |= 1 << l,
                    }
                }
                (self.from, self.to) = (S::load(&next_from), S::load(&next_to));
                if again == 0 {
                    // What follows goes on from the end of the whole.
                    along.start(live & !done, number[1]);
                    return done;
                }
                fresh = again;
            }
        }
    }
}
