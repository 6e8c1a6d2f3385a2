//! Which tetrahedra meet at a face.

/// In place of a neighbour: there is none.
pub const BOUNDARY: u32 = u32::MAX;

/// The corners of the face opposite each corner, turned outward in a positive tetrahedron.
const OUTWARD: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// The neighbours of tetrahedra.
///
/// Two tetrahedra are neighbours where they share a face and lie on either side of it. Where more
/// than two share one, they are paired as far as that goes, in the order of their numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Adjacency {
    /// For each tetrahedron the neighbour across the face opposite each corner, or [`BOUNDARY`].
    pub neighbours: Vec<[u32; 4]>,
    /// Faces with a tetrahedron on one side only.
    pub boundary_faces: usize,
    /// Faces that more than two tetrahedra share, or two on the same side: there the mesh
    /// overlaps itself.
    pub overlapping_faces: usize,
}

/// A face as seen from one tetrahedron: its middle and highest vertex, the tetrahedron's number
/// times four plus the corner opposite, and the side on which the tetrahedron lies.
#[derive(Clone, Copy)]
struct Side {
    key: [u32; 2],
    from: u64,
    front: bool,
}

impl Adjacency {
    /// Finds all neighbours, in time and memory linear in the number of tetrahedra: faces are put
    /// into buckets by their lowest vertex.
    ///
    /// # Panics
    /// If there are 2³² tetrahedra or more.
    pub fn new(tetrahedra: &[[u32; 4]]) -> Self {
        assert!(tetrahedra.len() < BOUNDARY as usize, "{} tetrahedra", tetrahedra.len());
        let vertices = tetrahedra.iter().flatten().max().map_or(0, |&v| v as usize + 1);
        let mut starts = vec![0u32; vertices + 1];
        for t in tetrahedra {
            (0..4).for_each(|corner| starts[face(t, corner).0[0] as usize + 1] += 1);
        }
        for v in 0..vertices {
            starts[v + 1] += starts[v];
        }
        let mut sides = vec![Side { key: [0; 2], from: 0, front: false }; 4 * tetrahedra.len()];
        let mut next = starts.clone();
        for (i, t) in tetrahedra.iter().enumerate() {
            for corner in 0..4 {
                let ([low, middle, high], front) = face(t, corner);
                let at = &mut next[low as usize];
                sides[*at as usize] = Side { key: [middle, high], from: 4 * i as u64 + corner as u64, front };
                *at += 1;
            }
        }
        let mut made = Self { neighbours: vec![[BOUNDARY; 4]; tetrahedra.len()], ..Self::default() };
        for v in 0..vertices {
            let bucket = &mut sides[starts[v] as usize..starts[v + 1] as usize];
            bucket.sort_unstable_by_key(|s| (s.key, s.from));
            bucket.chunk_by(|a, b| a.key == b.key).for_each(|shared| made.join(shared));
        }
        made
    }

    /// The triangles of the boundary, turned outward.
    pub fn boundary<'a>(&'a self, tetrahedra: &'a [[u32; 4]]) -> impl Iterator<Item = [u32; 3]> + 'a {
        let around = tetrahedra.iter().zip(&self.neighbours);
        around.flat_map(|(t, n)| (0..4).filter(|&c| n[c] == BOUNDARY).map(|c| OUTWARD[c].map(|i| t[i])))
    }

    /// Edges of the boundary at which other than two boundary triangles meet.
    pub fn non_manifold_edges(&self, tetrahedra: &[[u32; 4]]) -> usize {
        let edges = self.boundary(tetrahedra).flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]]);
        let mut edges: Vec<[u32; 2]> = edges.map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        edges.chunk_by(|a, b| a == b).filter(|same| same.len() != 2).count()
    }

    fn join(&mut self, shared: &[Side]) {
        match shared {
            [_] => self.boundary_faces += 1,
            [a, b] if a.front != b.front => self.pair(a, b),
            several => {
                self.overlapping_faces += 1;
                let side = |front| several.iter().filter(move |s| s.front == front);
                side(true).zip(side(false)).for_each(|(a, b)| self.pair(a, b));
                self.boundary_faces += side(true).count().abs_diff(side(false).count());
            }
        }
    }

    fn pair(&mut self, a: &Side, b: &Side) {
        self.neighbours[(a.from / 4) as usize][(a.from % 4) as usize] = (b.from / 4) as u32;
        self.neighbours[(b.from / 4) as usize][(b.from % 4) as usize] = (a.from / 4) as u32;
    }
}

/// The face opposite a corner: its vertices in rising order, and whether that order turns
/// outward.
fn face(t: &[u32; 4], corner: usize) -> ([u32; 3], bool) {
    let [mut a, mut b, mut c] = OUTWARD[corner].map(|i| t[i]);
    let mut outward = true;
    if a > b {
        std::mem::swap(&mut a, &mut b);
        outward = !outward;
    }
    if b > c {
        std::mem::swap(&mut b, &mut c);
        outward = !outward;
    }
    if a > b {
        std::mem::swap(&mut a, &mut b);
        outward = !outward;
    }
    ([a, b, c], outward)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Block, Geometry};
    use glam::DVec3;

    #[test]
    fn tetrahedra_of_a_box_know_each_other() {
        let mesh = Block::new(DVec3::ZERO, DVec3::ONE).unwrap().tessellate().unwrap();
        let adjacency = Adjacency::new(&mesh.tetrahedra);
        assert_eq!((adjacency.boundary_faces, adjacency.overlapping_faces), (12, 0));
        for (t, around) in adjacency.neighbours.iter().enumerate() {
            for (corner, &other) in around.iter().enumerate().filter(|(_, n)| **n != BOUNDARY) {
                assert!(adjacency.neighbours[other as usize].contains(&(t as u32)));
                let shared = mesh.tetrahedra[t].iter().filter(|v| mesh.tetrahedra[other as usize].contains(v));
                assert_eq!(shared.count(), 3, "{t} {corner}");
                assert!(!mesh.tetrahedra[other as usize].contains(&mesh.tetrahedra[t][corner]));
            }
        }
    }

    #[test]
    fn tetrahedra_on_the_same_side_of_a_face_are_no_neighbours() {
        let adjacency = Adjacency::new(&[[0, 1, 2, 3], [0, 1, 2, 4]]);
        assert_eq!(adjacency.overlapping_faces, 1);
        assert_eq!(adjacency.boundary_faces, 8);
        let apart = Adjacency::new(&[[0, 1, 2, 3], [1, 0, 2, 4]]);
        assert_eq!((apart.boundary_faces, apart.neighbours[0]), (6, [BOUNDARY, BOUNDARY, BOUNDARY, 1]));
    }
}
