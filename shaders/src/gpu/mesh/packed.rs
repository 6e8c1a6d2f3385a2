//! A tessellation as rows.

use volact_core::{
    Tessellation,
    bvh::Bvh,
    geometry::{Adjacency, BOUNDARY},
    glam::{DAffine3, DMat3, DVec3},
};

use super::{
    Row,
    tree::{self, row},
};

/// A mesh's rows, in the space of `unit`, with its cells where they carry something.
pub fn packed(made: &Tessellation, unit: &DAffine3, cells: bool) -> Vec<Row> {
    let adjacency = Adjacency::new(&made.tetrahedra);
    let place = |v: u32| unit.transform_point3(made.vertices.at(v as usize)).as_vec3().to_array();
    let mut vertices = Numbered { numbers: vec![u32::MAX; made.vertices.len()], places: Vec::new() };
    let boundary = adjacency.boundary(&made.tetrahedra);
    let faces: Vec<_> = boundary.map(|corners| corners.map(|v| vertices.number(v, place))).collect();
    let mut rows = tree::triangles(&faces, &vertices.places);
    if cells {
        add_cells(made, &adjacency, unit, &mut rows);
    }
    rows
}

/// Adds cells and their tree.
fn add_cells(made: &Tessellation, adjacency: &Adjacency, unit: &DAffine3, rows: &mut Vec<Row>) {
    let corners = |cell: usize| made.corners(cell).map(|v| unit.transform_point3(v));
    let around = |cell: usize| tree::around(&corners(cell).map(|v| v.as_vec3().to_array()));
    let tree = Bvh::new(&(0..made.tetrahedra.len()).map(around).collect::<Vec<_>>());
    let first = rows.len() as u32;
    let nodes = tree::rows(&tree);
    rows[1] = [nodes.len() as u32 / 2, first, first + nodes.len() as u32, 0];
    rows.extend(nodes);
    // Cells lie in the order of the tree's leaves.
    let mut numbers = vec![BOUNDARY; made.tetrahedra.len()];
    tree.items().iter().zip(0..).for_each(|(cell, number)| numbers[*cell as usize] = number);
    for cell in tree.items().iter().map(|cell| *cell as usize) {
        rows.extend(weights(corners(cell)));
        rows.push(made.tetrahedra[cell]);
        rows.push(adjacency.neighbours[cell].map(|n| if n == BOUNDARY { BOUNDARY } else { numbers[n as usize] }));
    }
}

/// What vertices 1 to 3 of a cell count for: slopes, and the place of vertex 0.
fn weights([a, b, c, d]: [DVec3; 4]) -> [Row; 3] {
    let slopes = DMat3::from_cols(b - a, c - a, d - a).inverse();
    let single = slopes.is_finite() && slopes.to_cols_array().iter().all(|v| v.abs() < 1e30);
    [0, 1, 2].map(|i| {
        if single {
            row(slopes.row(i).as_vec3().to_array(), (a[i] as f32).to_bits())
        } else {
            // A cell without extent holds no place: all are far outside of it.
            row([-1.0; 3], 1e30f32.to_bits())
        }
    })
}

/// Vertices as they come to be used.
struct Numbered {
    numbers: Vec<u32>,
    places: Vec<[f32; 3]>,
}

impl Numbered {
    fn number(&mut self, vertex: u32, place: impl Fn(u32) -> [f32; 3]) -> u32 {
        let number = &mut self.numbers[vertex as usize];
        if *number == u32::MAX {
            *number = self.places.len() as u32;
            self.places.push(place(vertex));
        }
        *number
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{Geometry, Sphere};

    fn float(rows: &[Row], row: u32) -> [f32; 4] {
        rows[row as usize].map(f32::from_bits)
    }

    /// What `volact_weights_at` of cells.wgsl gives.
    fn weights_at(rows: &[Row], cell: u32, p: [f32; 3]) -> [f32; 4] {
        let first = rows[1][2] + 5 * cell;
        let three = [0, 1, 2].map(|i| float(rows, first + i));
        let q = [0, 1, 2].map(|a| p[a] - three[a][3]);
        let rest = three.map(|s| s[0] * q[0] + s[1] * q[1] + s[2] * q[2]);
        [1.0 - (rest[0] + rest[1] + rest[2]), rest[0], rest[1], rest[2]]
    }

    #[test]
    fn weights_are_one_at_a_vertex_and_nothing_at_the_others() {
        let made = Sphere::new(DVec3::new(3.0, -2.0, 9.0), 4.0, 5).unwrap().tessellate().unwrap();
        let unit = DAffine3::from_scale(DVec3::splat(0.25)) * DAffine3::from_translation(-DVec3::new(3.0, -2.0, 9.0));
        let rows = packed(&made, &unit, true);
        for cell in 0..made.tetrahedra.len() as u32 {
            let [vertices, behind] = [3, 4].map(|i| rows[(rows[1][2] + 5 * cell + i) as usize]);
            for (i, v) in vertices.into_iter().enumerate() {
                let place = unit.transform_point3(made.vertices.at(v as usize)).as_vec3().to_array();
                let found = weights_at(&rows, cell, place);
                for (k, w) in found.into_iter().enumerate() {
                    assert!((w - f32::from(u8::from(i == k))).abs() < 2e-5, "{cell} {i}: {found:?}");
                }
                // The cell behind the face opposite to a vertex has the other three, and knows this one.
                let other = behind[i];
                if other != BOUNDARY {
                    let [theirs, back] = [3, 4].map(|i| rows[(rows[1][2] + 5 * other + i) as usize]);
                    assert!(back.contains(&cell) && !theirs.contains(&v));
                    assert_eq!(theirs.iter().filter(|t| vertices.contains(t)).count(), 3);
                }
            }
        }
    }

    #[test]
    fn cells_without_extent_hold_no_place() {
        let rows = weights([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.5, 0.5, 0.0)]);
        let mut all = vec![[0; 4], [0, 0, 2, 0]];
        all.extend(rows);
        for p in [[0.1, 0.1, 0.0], [1.0; 3], [-1.0; 3]] {
            assert!(weights_at(&all, 0, p).into_iter().fold(f32::INFINITY, f32::min) < -1e20);
        }
    }
}
