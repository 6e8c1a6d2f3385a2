//! Where rays enter a mesh: the faces of its boundary that are turned to the eye, sorted into the
//! packets of pixels that they can cover.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use super::{
    super::{
        packet::SIDE,
        simd::{LANES, Simd},
    },
    build::Linked,
    face::{Beside, meet, positive},
    project::{Slopes, View},
};

/// By how many pixels faces are taken to be larger, besides rounding.
const MARGIN: f64 = 0.01;

/// How many times the rounding of one f32 a vertex may be off its place beside a ray.
const ROUNDING: f64 = 8.0 * f32::EPSILON as f64;

/// A face, ready to be met.
#[derive(Clone, Copy, Debug)]
struct Face {
    corners: [[f32; 4]; 3],
    door: u32,
}

/// Faces by packet.
#[derive(Debug, Default)]
pub struct Entries {
    columns: usize,
    faces: Vec<Face>,
    /// Where each packet's list begins in `lists`, and where the last one ends.
    starts: Vec<u32>,
    lists: Vec<u32>,
    /// Faces for all packets: of the cell that holds the eye.
    always: Vec<Face>,
    /// The depth of the mesh.
    reach: f32,
}

/// The packets that a face can cover.
type Area = [[u32; 2]; 2];

impl Entries {
    /// Sorts a mesh's boundary, and faces that every ray may meet, for a viewport of `size`.
    pub fn new(linked: &Linked, vertices: &[[f32; 4]], view: &View, size: [usize; 2], always: &[u32]) -> Self {
        let face = |&door: &u32| Face { corners: linked.face(door).map(|v| vertices[v as usize]), door };
        let columns = size[0].div_ceil(SIDE);
        let packets = columns * size[1].div_ceil(SIDE);
        let (mut faces, mut areas) = (Vec::new(), Vec::new());
        let mut starts = vec![0u32; packets + 1];
        let each = |area: &Area| {
            let [[x0, x1], [y0, y1]] = *area;
            (y0..y1).flat_map(move |y| (x0..x1).map(move |x| y as usize * columns + x as usize))
        };
        for face in linked.boundary.iter().map(face) {
            let Some(area) = area(&face, view, size) else { continue };
            each(&area).for_each(|at| starts[at + 1] += 1);
            faces.push(face);
            areas.push(area);
        }
        for i in 0..packets {
            starts[i + 1] += starts[i];
        }
        let mut lists = vec![0u32; starts[packets] as usize];
        let mut next = starts.clone();
        for (i, area) in areas.iter().enumerate() {
            for at in each(area) {
                lists[next[at] as usize] = i as u32;
                next[at] += 1;
            }
        }
        let depths = vertices.iter().map(|v| v[2]);
        let [near, far] = depths.fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], z| [a.min(z), b.max(z)]);
        Self { columns, faces, starts, lists, always: always.iter().map(face).collect(), reach: (far - near).max(0.0) }
    }

    /// Whether no ray of a packet meets the mesh.
    pub fn is_empty(&self, pixel: [usize; 2]) -> bool {
        let at = pixel[1] / SIDE * self.columns + pixel[0] / SIDE;
        self.always.is_empty() && self.starts[at] == self.starts[at + 1]
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.faces.capacity() * size_of::<Face>() + 4 * (self.starts.capacity() + self.lists.capacity())
    }

    /// Finds where the rays of a packet enter.
    ///
    /// # Safety
    /// Called from a function compiled for `S` on a machine with it.
    #[inline(always)]
    pub unsafe fn find<S: Simd>(&self, pixel: [usize; 2], slopes: &Slopes, active: u32, hits: &mut Hits) {
        let at = pixel[1] / SIDE * self.columns + pixel[0] / SIDE;
        let list = &self.lists[self.starts[at] as usize..self.starts[at + 1] as usize];
        hits.clear(self.reach);
        // SAFETY: the caller's promises.
        unsafe {
            let beside = Beside::<S>::new(slopes);
            for &i in list {
                hits.try_face(&self.faces[i as usize], &beside, active);
            }
            if !self.always.is_empty() {
                let first = hits.list.len();
                self.always.iter().for_each(|face| hits.try_face(face, &beside, active));
                hits.held = hits.list[first..].iter().fold(0, |lanes, h| lanes | 1 << h.lane);
            }
        }
        hits.sort();
    }
}

/// The packets whose rays a face can meet from its front; `None` where there is none.
fn area(face: &Face, view: &View, size: [usize; 2]) -> Option<Area> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut flat = [[0f64; 2]; 3];
    let (mut behind, mut close) = (0, 0);
    for (corner, flat) in face.corners.iter().zip(&mut flat) {
        let [x, y, z] = [corner[0], corner[1], corner[2]].map(f64::from);
        let r = view.reference;
        let depth = if view.perspective() { z + r.z } else { 1.0 };
        behind += u32::from(depth <= 0.0);
        close += u32::from(depth <= 1e-6 * (z.abs() + r.z.abs()));
        let offset = [(x + r.x) / depth, (y + r.y) / depth];
        for a in 0..2 {
            let own = [x, y][a];
            let rounding = ROUNDING * (own.abs() + (offset[a] * z).abs()) / depth;
            let sign = if a == 0 { 1.0 } else { view.turn };
            let at = sign * offset[a] + view.middle[a];
            flat[a] = offset[a];
            low[a] = low[a].min(at - MARGIN - rounding);
            high[a] = high[a].max(at + MARGIN + rounding);
        }
    }
    match (behind, close) {
        (3, _) => return None,
        (_, 0) => {
            // Faces that turn their back, by more than rounding.
            let [a, b, c] = flat;
            let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
            let edges = u.iter().chain(&v).map(|e| e.abs()).sum::<f64>();
            if u[0] * v[1] - u[1] * v[0] < -2.0 * MARGIN * edges {
                return None;
            }
        }
        // It passes the eye: anywhere.
        _ => (low, high) = ([f64::NEG_INFINITY; 2], [f64::INFINITY; 2]),
    }
    let side = SIDE as f64;
    let mut area = [[0u32; 2]; 2];
    for a in 0..2 {
        // Pixels whose centres lie within, then packets.
        let (first, last) = ((low[a] - 0.5).ceil().max(0.0), (high[a] - 0.5).floor().min(size[a] as f64 - 1.0));
        if first > last {
            return None;
        }
        area[a] = [(first / side) as u32, (last / side) as u32 + 1];
    }
    Some(area)
}

/// The same vertex in all lanes.
#[inline(always)]
unsafe fn spread<S: Simd>(&[x, y, z, number]: &[f32; 4]) -> [S::F; 4] {
    // SAFETY: the caller's promises.
    unsafe { [S::splat(x), S::splat(y), S::splat(z), S::splat(number)] }
}

/// A way into the mesh.
#[derive(Clone, Copy, Debug)]
struct Hit {
    lane: u32,
    depth: f32,
    door: u32,
}

/// The ways into the mesh of sixteen rays, lane by lane from front to back.
#[derive(Debug, Default)]
pub struct Hits {
    list: Vec<Hit>,
    at: [u32; LANES],
    end: [u32; LANES],
    /// Lanes that enter through a face of the cell that holds the eye.
    pub held: u32,
    /// The depth of the mesh.
    pub reach: f32,
}

impl Hits {
    fn clear(&mut self, reach: f32) {
        self.list.clear();
        (self.held, self.reach) = (0, reach);
    }

    #[inline(always)]
    unsafe fn try_face<S: Simd>(&mut self, face: &Face, beside: &Beside<S>, active: u32) {
        // SAFETY: the caller's promises.
        unsafe {
            let [a, b, c] = &face.corners;
            let corners = [beside.place(spread::<S>(a)), beside.place(spread::<S>(b)), beside.place(spread::<S>(c))];
            let [a, b, c] = &corners;
            let mut lanes = positive(active, a, b);
            if lanes != 0 {
                lanes = positive(lanes, b, c);
            }
            if lanes != 0 {
                lanes = positive(lanes, c, a);
            }
            if lanes == 0 {
                return;
            }
            let [depth, _] = meet(&corners, [a.z, a.number]);
            let mut depths = [0f32; LANES];
            S::store(depth, &mut depths);
            for l in (0..LANES).filter(|l| lanes >> l & 1 == 1) {
                self.list.push(Hit { lane: l as u32, depth: depths[l], door: face.door });
            }
        }
    }

    fn sort(&mut self) {
        let key = |h: &Hit| (h.lane, h.depth, h.door);
        self.list.sort_unstable_by(|a, b| {
            let ((l, d, i), (m, e, j)) = (key(a), key(b));
            l.cmp(&m).then(d.total_cmp(&e)).then(i.cmp(&j))
        });
        // A face of the cell that holds the eye may lie on the boundary, too.
        self.list.dedup_by_key(|h| (h.lane, h.door));
        (self.at, self.end) = ([0; LANES], [0; LANES]);
        for (i, hit) in self.list.iter().enumerate() {
            let l = hit.lane as usize;
            if self.end[l] == 0 {
                self.at[l] = i as u32;
            }
            self.end[l] = i as u32 + 1;
        }
    }

    /// Lets go of ways that begin before a depth, in lanes whose way there is known otherwise.
    pub fn drop_before(&mut self, lanes: u32, keep: &[u32], depth: &[f32; LANES]) {
        self.list.retain(|h| lanes >> h.lane & 1 == 0 || h.depth >= depth[h.lane as usize] || keep.contains(&h.door));
        self.sort();
    }

    /// The lanes that enter at all.
    pub fn begin(&self) -> u32 {
        (0..LANES).fold(0, |lanes, l| lanes | u32::from(self.at[l] < self.end[l]) << l)
    }

    /// The door at which a lane enters next.
    pub fn door(&self, lane: usize) -> u32 {
        self.list[self.at[lane] as usize].door
    }

    /// Whether a lane's next way begins before a depth.
    pub fn begins_before(&self, lane: usize, depth: f32) -> bool {
        let next = self.at[lane] + 1;
        next < self.end[lane] && self.list[next as usize].depth < depth
    }

    /// Goes on to the next way of a lane; returns the depth at which it begins.
    pub fn advance(&mut self, lane: usize) -> Option<f32> {
        self.at[lane] += 1;
        (self.at[lane] < self.end[lane]).then(|| self.list[self.at[lane] as usize].depth)
    }
}
