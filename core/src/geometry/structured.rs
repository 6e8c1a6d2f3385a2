//! Structured hexahedral meshes: curvilinear grids.

use std::any::Any;

use super::{Aabb, CellType, Geometry, GeometryError, Points, Tessellation};
use crate::Buffer;

const NAME: &str = "structured_mesh";

/// A grid of hexahedra whose vertices lie anywhere. Shared, never copied; cheap to clone.
#[derive(Clone, Debug)]
pub struct StructuredMesh {
    dims: [usize; 3],
    points: Points,
    blanked: Option<Buffer>,
    texture_coordinates: Option<Points>,
    bounds: Aabb,
}

impl StructuredMesh {
    /// A grid of `dims` vertices, x fastest.
    ///
    /// # Errors
    /// If an axis has fewer than two vertices, or there are not as many points.
    pub fn new(dims: [usize; 3], points: Points) -> Result<Self, GeometryError> {
        let [x, y, z] = dims;
        if dims.iter().any(|&n| n < 2) {
            return Err(GeometryError::invalid(NAME, "dimensions", format!("{dims:?}"), "at least 2 vertices an axis"));
        }
        let count = x.checked_mul(y).and_then(|n| n.checked_mul(z)).filter(|&n| n <= u32::MAX as usize);
        if count != Some(points.len()) {
            let wanted = format!("{x} × {y} × {z}");
            return Err(GeometryError::invalid(NAME, "number of vertices", points.len(), wanted));
        }
        let bounds = points.bounds();
        Ok(Self { dims, points, blanked: None, texture_coordinates: None, bounds })
    }

    /// Leaves out every cell that has a blanked vertex: one `u8` a vertex, 0 for blanked
    /// (PLOT3D's IBLANK).
    ///
    /// # Errors
    /// If there are not as many numbers as vertices.
    pub fn with_blanking(mut self, visible: Buffer) -> Result<Self, GeometryError> {
        self.same_number("number of blanking flags", visible.len())?;
        self.blanked = Some(visible);
        Ok(self)
    }

    /// The same mesh with texture coordinates for its vertices: 0 to 1 over a volume's data ROI.
    ///
    /// # Errors
    /// If there are not as many as vertices.
    pub fn with_texture_coordinates(mut self, coordinates: Points) -> Result<Self, GeometryError> {
        self.same_number("number of texture coordinates", coordinates.len())?;
        self.texture_coordinates = Some(coordinates);
        Ok(self)
    }

    fn same_number(&self, what: &str, found: usize) -> Result<(), GeometryError> {
        if found == self.points.len() {
            return Ok(());
        }
        Err(GeometryError::invalid(NAME, what, found, format!("{}, one a vertex", self.points.len())))
    }

    /// Vertices along each axis.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// The vertices, x fastest.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// The blanking flags, one a vertex.
    pub fn blanked(&self) -> Option<&Buffer> {
        self.blanked.as_ref()
    }

    /// The texture coordinates.
    pub fn texture_coordinates(&self) -> Option<&Points> {
        self.texture_coordinates.as_ref()
    }

    /// All cells that are not blanked: their corners in the order of
    /// [`CellType::Hexahedron`].
    pub fn cells(&self) -> impl Iterator<Item = [u32; 8]> {
        let [nx, ny, nz] = self.dims;
        let visible = |corners: &[u32; 8]| match &self.blanked {
            Some(flags) => corners.iter().all(|&i| flags.bytes()[i as usize] != 0),
            None => true,
        };
        let corners = move |x: usize, y: usize, z: usize| {
            let at = |dx: usize, dy: usize, dz: usize| (((z + dz) * ny + y + dy) * nx + x + dx) as u32;
            [at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0), at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)]
        };
        let rows = (0..nz - 1).flat_map(move |z| (0..ny - 1).map(move |y| (y, z)));
        rows.flat_map(move |(y, z)| (0..nx - 1).map(move |x| corners(x, y, z))).filter(visible)
    }
}

impl Geometry for StructuredMesh {
    fn name(&self) -> &str {
        NAME
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        let cells: usize = self.dims.iter().map(|n| n - 1).product();
        let hexahedra = self.cells().map(|c| (CellType::Hexahedron, c));
        let mut made = Tessellation::of_cells(&self.points, hexahedra, cells);
        made.texture_coordinates = self.texture_coordinates.clone();
        Ok(made)
    }

    fn vertex_count(&self) -> Option<usize> {
        Some(self.points.len())
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
