//! Tetrahedra linked face to face, so that a ray can walk from one to the next.
//!
//! A [`Door`] leads into a tetrahedron through one of its faces. It names the vertex that is new
//! behind the face, and the doors through which the other three faces lead on: all that a step of
//! a walk reads besides that vertex (cf. A. Aman, S. Demirci, U. Güdükbay, *Compact
//! tetrahedralization-based acceleration structures for ray tracing*, 2022). Doors depend on the
//! tetrahedra alone: neither on positions nor on a camera.

use std::sync::OnceLock;

use bytemuck::{Pod, Zeroable};
use volact_core::{Aabb, Points, Tessellation, bvh::Bvh};

/// In place of a link: the mesh ends there.
pub const OUTSIDE: u32 = u32::MAX;

/// Tetrahedra at most: links have 32 bits, of which two tell the turn and two the corner.
pub const MOST: usize = (1 << 28) - 1;

/// The corners of the face opposite each corner, turned outward in a positive tetrahedron.
pub const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// A way into a tetrahedron. Door `4·t + c` leads into tetrahedron `t` through the face opposite
/// corner `c`, whose vertices are those at [`FACES`]`[c]`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct Door {
    /// The vertex opposite the face: corner `c`.
    pub apex: u32,
    /// What lies behind the faces opposite the first, second and third vertex of the face:
    /// `4·door + turn`, or [`OUTSIDE`]. With the apex put in place of that vertex, the triple's
    /// first vertex is number `turn` of the next door's face.
    pub next: [u32; 3],
}

/// A face while neighbours are looked for: its middle and highest vertex, and its door.
#[derive(Clone, Copy)]
struct Found {
    key: [u32; 2],
    door: u32,
    /// Whether the rising order of its vertices turns outward.
    front: bool,
}

/// Tetrahedra that know their neighbours.
#[derive(Debug)]
pub struct Linked {
    /// Four a tetrahedron.
    pub doors: Vec<Door>,
    /// Doors that lead in from outside.
    pub boundary: Vec<u32>,
    /// The vertices.
    pub vertices: Points,
    tree: OnceLock<Bvh>,
}

impl Linked {
    /// Links tetrahedra, in time and memory linear in their number; `None` where there are more
    /// than [`MOST`]. `progress` gets the vertices done and their number, now and then.
    ///
    /// As in [`Adjacency`](volact_core::geometry::Adjacency): two tetrahedra are linked where
    /// they share a face and lie on either side of it; where more than two share one, they are
    /// paired as far as that goes, in the order of their numbers.
    pub fn new(mesh: &Tessellation, progress: impl Fn(u64, u64)) -> Option<Self> {
        if mesh.tetrahedra.len() > MOST {
            return None;
        }
        let tetrahedra = &mesh.tetrahedra;
        let mut doors: Vec<Door> = tetrahedra.iter().flatten().map(|&apex| Door { apex, next: [OUTSIDE; 3] }).collect();
        let vertices = tetrahedra.iter().flatten().max().map_or(0, |&v| v as usize + 1);
        // Faces by their lowest vertex, as chains through `links`.
        let (mut heads, mut links) = (vec![OUTSIDE; vertices], vec![OUTSIDE; doors.len()]);
        for door in (0..doors.len() as u32).rev() {
            let lowest = corners(&doors, door).into_iter().min().unwrap_or(0) as usize;
            links[door as usize] = std::mem::replace(&mut heads[lowest], door);
        }
        let mut boundary = Vec::new();
        let mut found = Vec::new();
        for (v, &head) in heads.iter().enumerate() {
            found.clear();
            let mut door = head;
            while door != OUTSIDE {
                found.push(sorted(&doors, door));
                door = links[door as usize];
            }
            found.sort_unstable_by_key(|f| (f.key, f.door));
            found.chunk_by(|a, b| a.key == b.key).for_each(|shared| join(&mut doors, &mut boundary, shared));
            if v % 65536 == 65535 {
                progress(v as u64 + 1, vertices as u64);
            }
        }
        progress(vertices as u64, vertices as u64);
        boundary.sort_unstable();
        Some(Self { doors, boundary, vertices: mesh.vertices.clone(), tree: OnceLock::new() })
    }

    /// The number of tetrahedra.
    pub fn len(&self) -> usize {
        self.doors.len() / 4
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.doors.is_empty()
    }

    /// The vertices of a tetrahedron.
    pub fn tetrahedron(&self, index: usize) -> [u32; 4] {
        [0, 1, 2, 3].map(|c| self.doors[4 * index + c].apex)
    }

    /// The vertices of a door's face, turned towards who enters.
    pub fn face(&self, door: u32) -> [u32; 3] {
        corners(&self.doors, door)
    }

    /// A tree over the faces of the [`boundary`](Self::boundary), made when first asked for.
    pub fn tree(&self) -> &Bvh {
        self.tree.get_or_init(|| {
            let around = |&door: &u32| {
                let corners = self.face(door).map(|v| self.vertices.at(v as usize));
                corners.iter().fold(Aabb::EMPTY, |b, &p| Aabb { min: b.min.min(p), max: b.max.max(p) })
            };
            Bvh::new(&self.boundary.iter().map(around).collect::<Vec<_>>())
        })
    }

    /// Bytes held besides the vertices.
    pub fn bytes(&self) -> usize {
        self.doors.capacity() * size_of::<Door>()
            + self.boundary.capacity() * size_of::<u32>()
            + self.tree.get().map_or(0, Bvh::bytes)
    }
}

/// The vertices of a door's face.
fn corners(doors: &[Door], door: u32) -> [u32; 3] {
    let first = (door & !3) as usize;
    FACES[(door & 3) as usize].map(|c| doors[first + c].apex)
}

fn sorted(doors: &[Door], door: u32) -> Found {
    let [mut a, mut b, mut c] = corners(doors, door);
    let mut front = true;
    for swap in [0, 1, 0] {
        let (x, y) = if swap == 0 { (&mut a, &mut b) } else { (&mut b, &mut c) };
        if x > y {
            std::mem::swap(x, y);
            front = !front;
        }
    }
    Found { key: [b, c], door, front }
}

fn join(doors: &mut [Door], boundary: &mut Vec<u32>, shared: &[Found]) {
    if let [a, b] = shared
        && a.front != b.front
    {
        link(doors, a.door, b.door);
        link(doors, b.door, a.door);
        return;
    }
    let side = |front| shared.iter().filter(move |f| f.front == front);
    let pairs = side(true).count().min(side(false).count());
    for (a, b) in side(true).zip(side(false)) {
        link(doors, a.door, b.door);
        link(doors, b.door, a.door);
    }
    boundary.extend(side(true).skip(pairs).chain(side(false).skip(pairs)).map(|f| f.door));
}

/// Has the other doors of `from`'s tetrahedron lead through `from`'s face to the door `to`.
fn link(doors: &mut [Door], from: u32, to: u32) {
    let (first, leaving) = ((from & !3) as usize, (from & 3) as usize);
    let behind = corners(doors, to);
    for entering in (0..4).filter(|&c| c != leaving) {
        let apex = doors[first + entering].apex;
        let replaced = FACES[entering].iter().position(|&c| c == leaving).unwrap_or(0);
        let lead = if replaced == 0 { apex } else { doors[first + FACES[entering][0]].apex };
        let turn = behind.iter().position(|&v| v == lead).unwrap_or(0);
        doors[first + entering].next[replaced] = 4 * to + turn as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{Block, Geometry, Sphere, geometry::Adjacency, glam::DVec3};

    fn check(mesh: &Tessellation) {
        let linked = Linked::new(mesh, |_, _| {}).unwrap();
        let adjacency = Adjacency::new(&mesh.tetrahedra);
        assert_eq!(linked.boundary.len(), adjacency.boundary_faces);
        for (t, corners) in mesh.tetrahedra.iter().enumerate() {
            assert_eq!(linked.tetrahedron(t), *corners);
            for (entering, face) in FACES.iter().enumerate() {
                let door = linked.doors[4 * t + entering];
                for (slot, &leaving) in face.iter().enumerate() {
                    let next = door.next[slot];
                    let neighbour = adjacency.neighbours[t][leaving];
                    assert_eq!(next == OUTSIDE, neighbour == u32::MAX);
                    if next == OUTSIDE {
                        continue;
                    }
                    assert_eq!(next / 16, neighbour);
                    let mut triple = linked.face((4 * t + entering) as u32);
                    triple[slot] = door.apex;
                    let (behind, turn) = (linked.face(next / 4), (next % 4) as usize);
                    assert_eq!(triple, [0, 1, 2].map(|i| behind[(i + turn) % 3]));
                }
            }
        }
    }

    #[test]
    fn doors_lead_to_the_neighbours_with_the_same_triangle() {
        check(&Block::new(DVec3::ZERO, DVec3::ONE).unwrap().tessellate().unwrap());
        check(&Sphere::new(DVec3::ZERO, 1.0, 24).unwrap().tessellate().unwrap());
    }

    #[test]
    fn tetrahedra_on_the_same_side_of_a_face_are_not_linked() {
        let points = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
        let mesh = Tessellation {
            vertices: points.into_iter().collect(),
            tetrahedra: vec![[0, 1, 2, 3], [0, 1, 2, 4]],
            ..Tessellation::default()
        };
        assert_eq!(Linked::new(&mesh, |_, _| {}).unwrap().boundary.len(), 8);
        check(&mesh);
    }
}
