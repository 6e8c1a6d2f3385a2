//! What is worth knowing about a mesh.

use super::{Aabb, Adjacency, CellType, Geometry, Mesh, StructuredMesh, tessellation::split_cell};

/// How many cells of a type there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellCount {
    /// The type.
    pub cell_type: CellType,
    /// How many.
    pub count: usize,
}

/// A mesh's cells counted and measured.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshReport {
    /// Vertices.
    pub vertices: usize,
    /// Cells by type; types that do not occur are left out.
    pub cells: Vec<CellCount>,
    /// Tetrahedra that the cells make.
    pub tetrahedra: usize,
    /// Cells that are turned inside out. Wedges, which are in use both ways round, do not count.
    pub inverted: usize,
    /// Cells that hold no volume.
    pub collapsed: usize,
    /// Cells that are twisted so far that their tetrahedra overlap.
    pub folded: usize,
    /// Triangles of the boundary.
    pub boundary_faces: usize,
    /// Triangles at which the mesh overlaps itself.
    pub overlapping_faces: usize,
    /// Edges of the boundary at which other than two boundary triangles meet.
    pub non_manifold_edges: usize,
    /// The smallest and largest volume of a cell that is not collapsed, in cubic object units;
    /// `None` where all are.
    pub volumes: Option<[f64; 2]>,
    /// The volume of all cells.
    pub volume: f64,
    /// The box around all vertices.
    pub bounds: Aabb,
}

impl MeshReport {
    /// Looks at a geometry; `None` where it is neither a [`Mesh`] nor a [`StructuredMesh`].
    pub fn new(geometry: &dyn Geometry) -> Option<Self> {
        if let Some(mesh) = geometry.as_any().downcast_ref::<Mesh>() {
            return Some(Self::of(mesh.points(), mesh.cells().map(|(_, t, c)| (t, c)), geometry.bounds()));
        }
        let mesh = geometry.as_any().downcast_ref::<StructuredMesh>()?;
        let cells = mesh.cells().map(|c| (CellType::Hexahedron, c));
        Some(Self::of(mesh.points(), cells, geometry.bounds()))
    }

    fn of(points: &super::Points, cells: impl Iterator<Item = (CellType, [u32; 8])>, bounds: Aabb) -> Self {
        let mut counts = CellType::ALL.map(|cell_type| CellCount { cell_type, count: 0 });
        let mut tetrahedra = Vec::new();
        let (mut inverted, mut collapsed, mut folded) = (0, 0, 0);
        let (mut volumes, mut total) = ([f64::INFINITY, f64::NEG_INFINITY], 0.0);
        for (cell_type, corners) in cells {
            counts.iter_mut().filter(|c| c.cell_type == cell_type).for_each(|c| c.count += 1);
            let mut volume = 0.0;
            let split = split_cell(points, cell_type, &corners, |t| {
                let [a, b, c, d] = t.map(|i| points.at(i as usize));
                volume += (b - a).cross(c - a).dot(d - a) / 6.0;
                tetrahedra.push(t);
            });
            inverted += usize::from(split.inverted && cell_type != CellType::Wedge);
            collapsed += usize::from(split.collapsed);
            folded += usize::from(split.folded);
            if !split.collapsed {
                volumes = [volumes[0].min(volume), volumes[1].max(volume)];
                total += volume;
            }
        }
        let adjacency = Adjacency::new(&tetrahedra);
        Self {
            vertices: points.len(),
            cells: counts.into_iter().filter(|c| c.count > 0).collect(),
            tetrahedra: tetrahedra.len(),
            inverted,
            collapsed,
            folded,
            boundary_faces: adjacency.boundary_faces,
            overlapping_faces: adjacency.overlapping_faces,
            non_manifold_edges: adjacency.non_manifold_edges(&tetrahedra),
            volumes: (volumes[0] <= volumes[1]).then_some(volumes),
            volume: total,
            bounds,
        }
    }
}
