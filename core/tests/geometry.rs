//! Meshes at the boundary that users see: whatever goes in, tetrahedra come out that fill the
//! mesh once, or one clear error.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use glam::DVec3;
use proptest::prelude::*;
use volact_core::{
    Appearance, Attribute, Block, Buffer, Bulk, CellType, CellTypes, Geometry, Mesh, Points, ScalarType, Shape,
    SliceStyle, Sliced, Slices, StructuredMesh, Surface, Tessellation,
    geometry::{Adjacency, GeometryError, MeshReport},
};

/// Corners of a unit cell of a grid, numbered as a hexahedron's.
const CORNERS: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];

/// A bent and twisted grid whose outer faces stay flat: its volume is that of the box.
fn bent(n: [usize; 3], strength: f64) -> Vec<DVec3> {
    let mut points = Vec::new();
    for z in 0..n[2] {
        for y in 0..n[1] {
            for x in 0..n[0] {
                let u = DVec3::new(x as f64, y as f64, z as f64) / DVec3::from_array(n.map(|n| (n - 1) as f64));
                let edge = (u * (1.0 - u) * 4.0).to_array().into_iter().product::<f64>();
                let wave = DVec3::new((7.0 * u.y).sin(), (9.0 * u.z).cos(), (8.0 * u.x).sin());
                points.push(u + strength * edge * wave / DVec3::from_array(n.map(|n| n as f64)));
            }
        }
    }
    points
}

fn volume(mesh: &Tessellation) -> f64 {
    (0..mesh.tetrahedra.len()).map(|t| mesh.volume(t)).sum()
}

/// Cells of a grid as a mixture of types: hexahedra, two wedges each, or six pyramids around a
/// new vertex in the middle.
fn mixed(n: [usize; 3], kinds: &[u8], rename: &[u32], strength: f64) -> (Vec<DVec3>, Vec<u8>, Vec<u32>) {
    let grid = bent(n, strength);
    let mut points = grid.clone();
    let (mut types, mut indices) = (Vec::new(), Vec::new());
    let mut cell = 0;
    let mut push = |t: CellType, corners: &[usize]| {
        types.push(t as u8);
        indices.extend(corners.iter().map(|&c| c as u32));
    };
    for z in 0..n[2] - 1 {
        for y in 0..n[1] - 1 {
            for x in 0..n[0] - 1 {
                let at = CORNERS.map(|[i, j, k]| ((z + k) * n[1] + y + j) * n[0] + x + i);
                match kinds[cell % kinds.len()] % 3 {
                    // Wedges agree with their neighbours only where a face's diagonal is the one
                    // from the lowest vertex; theirs is a face of their own, so any will do.
                    1 => {
                        push(CellType::Wedge, &[at[0], at[1], at[2], at[4], at[5], at[6]]);
                        push(CellType::Wedge, &[at[0], at[2], at[3], at[4], at[6], at[7]]);
                    }
                    2 => {
                        let apex = points.len();
                        points.push(at.iter().map(|&i| points[i]).sum::<DVec3>() / 8.0);
                        for f in [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]] {
                            let [a, b, c, d] = f.map(|i: usize| at[i]);
                            push(CellType::Pyramid, &[d, c, b, a, apex]);
                        }
                    }
                    _ => push(CellType::Hexahedron, &at),
                }
                cell += 1;
            }
        }
    }
    // Any numbering of the grid's vertices must do.
    let name = |i: usize| if i < rename.len() && rename.len() == grid.len() { rename[i] as usize } else { i };
    let mut named = points.clone();
    (0..points.len()).for_each(|i| named[name(i)] = points[i]);
    let indices = indices.into_iter().map(|i| name(i as usize) as u32).collect();
    (named, types, indices)
}

fn mesh_of(points: Vec<DVec3>, types: Vec<u8>, indices: Vec<u32>) -> Result<Mesh, GeometryError> {
    Mesh::new(points.into(), CellTypes::Each(Buffer::from_vec(types)), Buffer::from_vec(indices))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn bent_grids_fill_their_box_without_cracks(n in prop::array::uniform3(2usize..7), strength in 0.0..0.15f64) {
        let mesh = StructuredMesh::new(n, bent(n, strength).into()).unwrap().tessellate().unwrap();
        let [x, y, z] = n.map(|n| n - 1);
        prop_assert_eq!(mesh.tetrahedra.len(), 6 * x * y * z);
        prop_assert!((volume(&mesh) - 1.0).abs() < 1e-12);
        let adjacency = Adjacency::new(&mesh.tetrahedra);
        prop_assert_eq!(adjacency.boundary_faces, 4 * (x * y + y * z + z * x));
        prop_assert_eq!((adjacency.overlapping_faces, adjacency.non_manifold_edges(&mesh.tetrahedra)), (0, 0));
    }

    #[test]
    fn hexahedra_and_pyramids_conform_whatever_their_numbering(
        kinds in prop::collection::vec(prop::sample::select(vec![0u8, 2]), 1..27),
        rename in Just((0..64u32).collect::<Vec<_>>()).prop_shuffle(),
        strength in 0.0..0.1f64,
    ) {
        let (points, types, indices) = mixed([4; 3], &kinds, &rename, strength);
        let mesh = mesh_of(points, types, indices).unwrap().tessellate().unwrap();
        prop_assert_eq!((mesh.collapsed, mesh.inverted, mesh.folded), (0, 0, 0));
        prop_assert!((volume(&mesh) - 1.0).abs() < 1e-12, "{}", volume(&mesh));
        let adjacency = Adjacency::new(&mesh.tetrahedra);
        prop_assert_eq!((adjacency.boundary_faces, adjacency.overlapping_faces), (6 * 9 * 2, 0));
    }

    #[test]
    fn stacks_of_wedges_conform(layers in 1usize..5, rename in Just((0..36u32).collect::<Vec<_>>()).prop_shuffle()) {
        // Triangles of one grid, extruded: quadrilaterals are shared between wedges only.
        let n = [3, 3, layers + 1];
        let used: Vec<u32> = if layers == 3 { rename } else { Vec::new() };
        let (points, types, indices) = mixed(n, &[1], &used, 0.05);
        let mesh = mesh_of(points, types, indices).unwrap().tessellate().unwrap();
        prop_assert_eq!(mesh.tetrahedra.len(), 6 * 4 * layers);
        prop_assert!((volume(&mesh) - 1.0).abs() < 1e-12);
        let adjacency = Adjacency::new(&mesh.tetrahedra);
        prop_assert_eq!((adjacency.boundary_faces, adjacency.overlapping_faces), (16 + 16 * layers, 0));
    }

    #[test]
    fn any_indices_make_a_mesh_or_an_error(
        types in prop::collection::vec(prop::sample::select(vec![10u8, 12, 13, 14, 14, 10, 11, 0, 42, 255]), 0..12),
        indices in prop::collection::vec(0u32..14, 0..80),
        points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 0..14),
    ) {
        let points: Vec<_> = points.into_iter().map(DVec3::from_array).collect();
        let count = points.len();
        match mesh_of(points, types, indices) {
            Err(error) => prop_assert!(error.to_string().contains("wanted"), "{error}"),
            Ok(mesh) => {
                prop_assert_eq!(mesh.vertex_count(), Some(count));
                let made = mesh.tessellate().unwrap();
                prop_assert_eq!(made.validate("mesh"), Ok(()));
                let adjacency = Adjacency::new(&made.tetrahedra);
                prop_assert_eq!(adjacency.boundary(&made.tetrahedra).count(), adjacency.boundary_faces);
                let report = MeshReport::new(&mesh).unwrap();
                prop_assert_eq!(report.cells.iter().map(|c| c.count).sum::<usize>(), mesh.cell_count());
                prop_assert!(report.volume >= 0.0);
            }
        }
    }

    #[test]
    fn neighbours_of_any_tetrahedra_are_mutual(tetrahedra in prop::collection::vec(prop::array::uniform4(0u32..12), 0..60)) {
        let adjacency = Adjacency::new(&tetrahedra);
        for (t, around) in adjacency.neighbours.iter().enumerate() {
            for &other in around.iter().filter(|&&n| n != volact_core::geometry::BOUNDARY) {
                prop_assert!(adjacency.neighbours[other as usize].contains(&(t as u32)));
            }
        }
    }
}

#[test]
fn collapsed_cells_over_eight_decades_are_counted_and_the_rest_kept() {
    // Layers that shrink to 1e-8, and one whose upper and lower vertices fall together.
    let heights = [0.0, 1.0, 1.0 + 1e-3, 1.0 + 1e-3 + 1e-8, 1.0 + 1e-3 + 1e-8, 2.0];
    let points: Vec<_> = heights
        .iter()
        .flat_map(|&z| [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[x, y]| DVec3::new(x, y, z)))
        .collect();
    let mesh = StructuredMesh::new([2, 2, 6], points.into()).unwrap();
    let made = mesh.tessellate().unwrap();
    assert_eq!((made.collapsed, made.tetrahedra.len()), (1, 24));
    assert!((volume(&made) - 2.0).abs() < 1e-12);
    let report = MeshReport::new(&mesh).unwrap();
    assert_eq!(report.collapsed, 1);
    let [low, high] = report.volumes.unwrap();
    assert!((low / 1e-8 - 1.0).abs() < 1e-6 && (high - 1.0).abs() < 1e-12, "{low} {high}");
}

#[test]
fn twisted_and_inverted_cells_are_told_apart() {
    let box_points: Vec<_> = CORNERS.iter().map(|c| DVec3::from_array(c.map(|v| v as f64))).collect();
    let one = |corners: [u32; 8]| {
        let types = CellTypes::All(CellType::Hexahedron);
        Mesh::new(box_points.clone().into(), types, Buffer::from_vec(corners.to_vec())).unwrap().tessellate().unwrap()
    };
    let right = one([0, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!((right.inverted, right.folded), (0, 0));
    let inverted = one([4, 5, 6, 7, 0, 1, 2, 3]);
    assert_eq!((inverted.inverted, inverted.folded), (1, 0));
    assert!((volume(&inverted) - 1.0).abs() < 1e-15);
    let twisted = one([0, 1, 2, 3, 6, 7, 4, 5]);
    assert_eq!(twisted.folded + twisted.collapsed, 1, "{twisted:?}");
}

#[test]
fn wedges_of_both_windings_are_the_same() {
    let points: Vec<_> = CORNERS.iter().map(|c| DVec3::from_array(c.map(|v| v as f64))).collect();
    for wedge in [[0u32, 1, 3, 4, 5, 7], [0, 3, 1, 4, 7, 5]] {
        let types = CellTypes::All(CellType::Wedge);
        let mesh = Mesh::new(points.clone().into(), types, Buffer::from_vec(wedge.to_vec())).unwrap();
        let made = mesh.tessellate().unwrap();
        assert_eq!((made.tetrahedra.len(), made.inverted), (3, 0));
        assert!((volume(&made) - 0.5).abs() < 1e-15);
    }
}

#[test]
fn blanked_vertices_take_their_cells_away() {
    let n = [4, 3, 3];
    let mut visible = vec![1u8; 36];
    visible[0] = 0;
    let mesh = StructuredMesh::new(n, bent(n, 0.0).into()).unwrap();
    let blanked = mesh.clone().with_blanking(Buffer::from_vec(visible)).unwrap();
    assert_eq!((mesh.cells().count(), blanked.cells().count()), (12, 11));
    assert!(mesh.with_blanking(Buffer::from_vec(vec![1u8; 35])).is_err());
}

#[test]
fn damaged_meshes_are_refused_by_name() {
    let points = |n: usize| Points::from(vec![DVec3::ZERO; n]);
    let tets =
        |indices: Vec<u32>| Mesh::new(points(4), CellTypes::All(CellType::Tetrahedron), Buffer::from_vec(indices));
    let text = |e: Result<Mesh, GeometryError>| e.unwrap_err().to_string();
    assert!(text(tets(vec![0, 1, 2, 3, 0, 1, 2, 4])).contains("cell 1 is 4, wanted below 4"));
    assert!(text(tets(vec![0, 1, 2])).contains("3, wanted 4"));
    assert!(text(tets(vec![])).contains("number of cells"));
    let odd = Mesh::new(points(4), CellTypes::All(CellType::Tetrahedron), Buffer::from_vec(vec![0u8; 15]));
    assert!(text(odd).contains("15 bytes"));
    let types = CellTypes::Each(Buffer::from_vec(vec![10u8, 7]));
    let unknown = Mesh::new(points(4), types, Buffer::from_vec(vec![0u32; 8]));
    assert!(text(unknown).contains("type of cell 1 is 7"));
    assert!(StructuredMesh::new([2, 2, 1], points(4)).is_err());
    assert!(StructuredMesh::new([usize::MAX, 2, 2], points(4)).is_err());
    assert!(Surface::new(points(3), Buffer::from_vec(vec![0u32, 1, 3])).is_err());
    assert!(Surface::new(points(3), Buffer::from_vec(Vec::<u32>::new())).is_err());
    let surface = Surface::new(points(3), Buffer::from_vec(vec![0u32, 1, 2])).unwrap();
    let shape = Shape::new(surface.clone(), Appearance::new("surface"));
    assert!(shape.notes().is_empty(), "a surface needs no unit distance: {:?}", shape.notes());
    assert!(surface.tessellate().unwrap_err().to_string().contains("surface"));
    let none = Slices { planes: Vec::new(), style: SliceStyle::Opaque, volume: false };
    assert!(Sliced::new(Arc::new(surface), none).is_err());
}

/// Memory that says when it is let go.
struct Counted<T>(Vec<T>, Arc<AtomicUsize>);

impl<T: bytemuck::Pod + Send + Sync> Bulk for Counted<T> {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

impl<T> Drop for Counted<T> {
    fn drop(&mut self) {
        self.1.fetch_add(1, Ordering::SeqCst);
    }
}

#[test]
fn vertices_indices_and_attributes_are_shared_until_the_last_user_goes() {
    let released = Arc::new(AtomicUsize::new(0));
    let share = || Arc::clone(&released);
    let block = Block::new(DVec3::ZERO, DVec3::ONE).unwrap().tessellate().unwrap();
    let positions: Vec<f64> = block.vertices.iter().flat_map(|p| p.to_array()).collect();
    let at = positions.as_ptr().cast::<u8>();
    let positions = Buffer::new(Counted(positions, share()));
    let indices = Buffer::new(Counted(block.tetrahedra.concat(), share()));
    let scalars = Buffer::new(Counted(vec![0f32; 8], share()));
    let points = Points::new(ScalarType::F64, positions).unwrap();
    let mesh = Mesh::new(points, CellTypes::All(CellType::Tetrahedron), indices).unwrap();
    let attribute = Attribute::new("t", ScalarType::F32, 1, scalars).unwrap();
    let made = mesh.tessellate().unwrap();
    assert_eq!(made.vertices.data().bytes().as_ptr(), at, "positions were copied");
    drop(mesh);
    assert_eq!(released.load(Ordering::SeqCst), 1, "indices go with the mesh");
    drop(attribute);
    drop(made);
    assert_eq!(released.load(Ordering::SeqCst), 3);
}
