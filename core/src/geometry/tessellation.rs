//! What every geometry comes down to: tetrahedra.

use glam::DVec3;

use super::{CellType, GeometryError, Points};

/// A geometry cut into tetrahedra, in object space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tessellation {
    /// Corner positions; the geometry's own vertices first, in their order.
    pub vertices: Points,
    /// Four vertex indices a tetrahedron, positively oriented:
    /// `(b−a)×(c−a)·(d−a) > 0`.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Texture coordinates of the vertices, 0 to 1 over the data ROI; where there are none, a
    /// volume is read by position.
    pub texture_coordinates: Option<Points>,
    /// Cells left out because they hold no volume.
    pub collapsed: usize,
    /// Cells that were turned because they were inverted; wedges, which are in use both ways
    /// round, do not count.
    pub inverted: usize,
    /// Cells that are twisted so far that their tetrahedra overlap.
    pub folded: usize,
}

impl Tessellation {
    /// The corners of a tetrahedron.
    ///
    /// # Panics
    /// If there is no such tetrahedron, or it names vertices that are not there.
    pub fn corners(&self, index: usize) -> [DVec3; 4] {
        self.tetrahedra[index].map(|i| self.vertices.at(i as usize))
    }

    /// The volume of a tetrahedron, negative where it is inverted.
    ///
    /// # Panics
    /// As [`corners`](Self::corners).
    pub fn volume(&self, index: usize) -> f64 {
        let [a, b, c, d] = self.corners(index);
        (b - a).cross(c - a).dot(d - a) / 6.0
    }

    /// Checks what a geometry of somebody's own made.
    ///
    /// # Errors
    /// If a vertex is not finite or not there, a tetrahedron has no positive volume, or texture
    /// coordinates do not go with the vertices.
    pub fn validate(&self, geometry: &str) -> Result<(), GeometryError> {
        let count = self.vertices.len();
        if let Some((i, p)) = self.vertices.iter().enumerate().find(|(_, p)| !p.is_finite()) {
            return Err(GeometryError::invalid(geometry, format!("vertex {i}"), p, "three finite numbers"));
        }
        let texture = self.texture_coordinates.as_ref().map(Points::len);
        if let Some(found) = texture.filter(|&n| n != count) {
            let wanted = format!("{count}, one a vertex");
            return Err(GeometryError::invalid(geometry, "number of texture coordinates", found, wanted));
        }
        for (i, t) in self.tetrahedra.iter().enumerate() {
            if let Some(index) = t.iter().find(|&&v| v as usize >= count) {
                let what = format!("vertex index of tetrahedron {i}");
                return Err(GeometryError::invalid(geometry, what, index, format!("below {count}")));
            }
            let volume = self.volume(i);
            if volume.is_nan() || volume < 0.0 {
                let what = format!("volume of tetrahedron {i}");
                return Err(GeometryError::invalid(geometry, what, volume, "a positive number"));
            }
        }
        Ok(())
    }
}

/// How cells were taken apart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Split {
    /// It holds no volume.
    pub collapsed: bool,
    /// Its signed volume is negative.
    pub inverted: bool,
    /// Some of its tetrahedra point one way and some the other.
    pub folded: bool,
}

impl Tessellation {
    /// Cuts cells into tetrahedra.
    ///
    /// A cell's lowest vertex is joined to the triangles of all faces that do not touch it; a
    /// quadrilateral is split from its lowest vertex, too. Both cells at a face see the same
    /// indices, so that they agree on its diagonal (J. Dompierre et al., *How to subdivide
    /// pyramids, prisms and hexahedra into tetrahedra*, 1999). Tetrahedra without volume are left
    /// out, inverted ones turned.
    pub(super) fn of_cells(points: &Points, cells: impl Iterator<Item = (CellType, [u32; 8])>, count: usize) -> Self {
        let mut made = Self { vertices: points.clone(), ..Self::default() };
        made.tetrahedra.reserve(count);
        for (cell_type, corners) in cells {
            let split = split_cell(points, cell_type, &corners, |t| made.tetrahedra.push(t));
            made.collapsed += usize::from(split.collapsed);
            made.inverted += usize::from(split.inverted && cell_type != CellType::Wedge);
            made.folded += usize::from(split.folded);
        }
        made
    }
}

/// Visits the positively oriented tetrahedra of a cell.
pub(super) fn split_cell(
    points: &Points,
    cell_type: CellType,
    corners: &[u32; 8],
    mut visit: impl FnMut([u32; 4]),
) -> Split {
    let faces: &[&[usize]] = match cell_type {
        CellType::Tetrahedron => &[&[0, 2, 1], &[0, 1, 3], &[1, 2, 3], &[2, 0, 3]],
        CellType::Hexahedron => {
            &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]]
        }
        CellType::Wedge => &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]],
        CellType::Pyramid => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
    };
    let lowest = corners[..cell_type.corners()].iter().copied().min().unwrap_or(0);
    let (mut up, mut down, mut sum) = (false, false, 0.0);
    let mut join = |triangle: [u32; 3]| {
        // Faces turn outward, so that the apex lies behind them.
        let mut t = [triangle[0], triangle[2], triangle[1], lowest];
        let volume = signed_volume(&t.map(|i| points.at(i as usize)));
        if volume == 0.0 {
            return;
        }
        sum += volume;
        if volume < 0.0 {
            t.swap(0, 1);
        }
        (up, down) = (up || volume > 0.0, down || volume < 0.0);
        visit(t);
    };
    for face in faces {
        let face: &[usize] = face;
        if face.iter().any(|&i| corners[i] == lowest) {
            continue;
        }
        let at = |i: usize| corners[face[i % face.len()]];
        let first = (0..face.len()).min_by_key(|&i| at(i)).unwrap_or(0);
        for i in 1..face.len() - 1 {
            join([at(first), at(first + i), at(first + i + 1)]);
        }
    }
    Split { collapsed: !up && !down, inverted: sum < 0.0, folded: up && down }
}

/// Six times the volume of a tetrahedron; 0 where rounding could have made it up.
fn signed_volume([a, b, c, d]: &[DVec3; 4]) -> f64 {
    let (u, v, w) = (*b - *a, *c - *a, *d - *a);
    let volume = u.cross(v).dot(w);
    let noise = 8.0 * f64::EPSILON * u.length() * v.length() * w.length();
    if volume.abs() <= noise { 0.0 } else { volume }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Adjacency;
    use proptest::prelude::*;

    const CUBE: [DVec3; 8] = [
        DVec3::new(0.0, 0.0, 0.0),
        DVec3::new(1.0, 0.0, 0.0),
        DVec3::new(1.0, 1.0, 0.0),
        DVec3::new(0.0, 1.0, 0.0),
        DVec3::new(0.0, 0.0, 1.0),
        DVec3::new(1.0, 0.0, 1.0),
        DVec3::new(1.0, 1.0, 1.0),
        DVec3::new(0.0, 1.0, 1.0),
    ];

    fn check(cell_type: CellType, corners: &[DVec3], volume: f64, faces: usize, order: &[u32]) {
        let n = corners.len();
        let mut points = vec![DVec3::ZERO; n];
        let mut indices = [0; 8];
        for i in 0..n {
            points[order[i] as usize] = corners[i];
            indices[i] = order[i];
        }
        let made = Tessellation::of_cells(&points.into(), std::iter::once((cell_type, indices)), 1);
        let total: f64 = (0..made.tetrahedra.len()).map(|t| made.volume(t)).sum();
        assert!((total - volume).abs() < 1e-12, "{cell_type:?} {order:?} {total}");
        assert_eq!((made.collapsed, made.inverted, made.folded), (0, 0, 0), "{cell_type:?}");
        assert_eq!(Adjacency::new(&made.tetrahedra).boundary_faces, faces, "{cell_type:?}");
    }

    proptest! {
        #[test]
        fn cells_fill_their_volume_whatever_their_numbering(order in Just((0..8u32).collect::<Vec<_>>()).prop_shuffle()) {
            let rank = |n: u32| order.iter().copied().filter(|&i| i < n).collect::<Vec<_>>();
            let c = CUBE;
            check(CellType::Hexahedron, &c, 1.0, 12, &order);
            check(CellType::Wedge, &[c[0], c[3], c[1], c[4], c[7], c[5]], 0.5, 8, &rank(6));
            check(CellType::Pyramid, &[c[0], c[1], c[2], c[3], c[6]], 1.0 / 3.0, 6, &rank(5));
            check(CellType::Tetrahedron, &[c[0], c[1], c[3], c[4]], 1.0 / 6.0, 4, &rank(4));
        }
    }

    #[test]
    fn inverted_cells_are_turned_and_flat_ones_dropped() {
        let points: Points = CUBE.into_iter().collect();
        let cells = [[1, 0, 3, 4, 0, 0, 0, 0], [0, 1, 2, 3, 0, 0, 0, 0]].map(|c| (CellType::Tetrahedron, c));
        let made = Tessellation::of_cells(&points, cells.into_iter(), 2);
        assert_eq!((made.tetrahedra.len(), made.collapsed, made.inverted), (1, 1, 1));
        assert!(made.volume(0) > 0.0);
        assert_eq!(made.validate("test"), Ok(()));
    }
}
