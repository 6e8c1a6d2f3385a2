//! Unstructured meshes: tetrahedra, hexahedra, wedges and pyramids, also mixed.

use std::any::Any;

use super::{Aabb, Geometry, GeometryError, Points, Tessellation};
use crate::Buffer;

const NAME: &str = "mesh";

/// The type of a cell. Corners are numbered as in VTK; the codes are VTK's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum CellType {
    /// Four corners.
    Tetrahedron = 10,
    /// Eight corners: a quadrilateral, then the one opposite in the same turn.
    Hexahedron = 12,
    /// Six corners: a triangle, then the one opposite in the same turn.
    Wedge = 13,
    /// Five corners: a quadrilateral, then the apex.
    Pyramid = 14,
}

impl CellType {
    /// All cell types.
    pub const ALL: [Self; 4] = [Self::Tetrahedron, Self::Hexahedron, Self::Wedge, Self::Pyramid];

    /// The type of a code.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|t| *t as u8 == code)
    }

    /// The number of corners.
    pub fn corners(self) -> usize {
        match self {
            Self::Tetrahedron => 4,
            Self::Hexahedron => 8,
            Self::Wedge => 6,
            Self::Pyramid => 5,
        }
    }

    /// The name, e.g. `wedge`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tetrahedron => "tetrahedron",
            Self::Hexahedron => "hexahedron",
            Self::Wedge => "wedge",
            Self::Pyramid => "pyramid",
        }
    }
}

/// The types of a mesh's cells.
#[derive(Clone, Debug)]
pub enum CellTypes {
    /// All of one type.
    All(CellType),
    /// One code a cell, as `u8`: see [`CellType`].
    Each(Buffer),
}

/// An unstructured mesh. Vertices, indices and types are shared, never copied; cheap to clone.
#[derive(Clone, Debug)]
pub struct Mesh {
    points: Points,
    types: CellTypes,
    connectivity: Buffer,
    cells: usize,
    texture_coordinates: Option<Points>,
    bounds: Aabb,
}

impl Mesh {
    /// A mesh of points and cells; `connectivity` holds the corners of one cell after another, as
    /// `u32` in native byte order.
    ///
    /// # Errors
    /// If there is no cell, a type is unknown, an index is out of range, or the indices do not
    /// make whole cells. Nothing is allocated.
    pub fn new(points: Points, types: CellTypes, connectivity: Buffer) -> Result<Self, GeometryError> {
        let invalid = |what: String, found: String, wanted: String| GeometryError::invalid(NAME, what, found, wanted);
        let Some(indices) = connectivity.as_slice::<u32>() else {
            let found = format!("{} bytes", connectivity.len());
            return Err(invalid("connectivity".into(), found, "aligned indices of 32 bits".into()));
        };
        let (cells, wanted) = match &types {
            CellTypes::All(t) => {
                (indices.len().div_ceil(t.corners()), indices.len().div_ceil(t.corners()) * t.corners())
            }
            CellTypes::Each(codes) => {
                let mut wanted = 0usize;
                for (cell, &code) in codes.bytes().iter().enumerate() {
                    let Some(t) = CellType::from_code(code) else {
                        let known: Vec<_> =
                            CellType::ALL.iter().map(|t| format!("{} ({})", *t as u8, t.name())).collect();
                        return Err(invalid(
                            format!("type of cell {cell}"),
                            code.to_string(),
                            format!("one of {}", known.join(", ")),
                        ));
                    };
                    wanted += t.corners();
                }
                (codes.len(), wanted)
            }
        };
        if cells == 0 {
            return Err(invalid("number of cells".into(), "0".into(), "at least 1".into()));
        }
        if indices.len() != wanted {
            return Err(invalid(
                "number of indices".into(),
                indices.len().to_string(),
                format!("{wanted} for {cells} cells"),
            ));
        }
        let count = points.len();
        let made = Self { bounds: points.bounds(), points, types, connectivity, cells, texture_coordinates: None };
        if let Some((cell, _, index)) = made.cells().find_map(|(c, t, corners)| {
            corners[..t.corners()].iter().find(|&&i| i as usize >= count).map(|&i| (c, t, i))
        }) {
            return Err(invalid(format!("vertex index of cell {cell}"), index.to_string(), format!("below {count}")));
        }
        Ok(made)
    }

    /// The same mesh with texture coordinates for its vertices: 0 to 1 over a volume's data ROI.
    ///
    /// # Errors
    /// If there are not as many as vertices.
    pub fn with_texture_coordinates(mut self, coordinates: Points) -> Result<Self, GeometryError> {
        if coordinates.len() != self.points.len() {
            let wanted = format!("{}, one a vertex", self.points.len());
            return Err(GeometryError::invalid(NAME, "number of texture coordinates", coordinates.len(), wanted));
        }
        self.texture_coordinates = Some(coordinates);
        Ok(self)
    }

    /// The vertices.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// The types of the cells.
    pub fn types(&self) -> &CellTypes {
        &self.types
    }

    /// The indices of all cells' corners, as `u32`.
    pub fn connectivity(&self) -> &Buffer {
        &self.connectivity
    }

    /// The texture coordinates.
    pub fn texture_coordinates(&self) -> Option<&Points> {
        self.texture_coordinates.as_ref()
    }

    /// The number of cells.
    pub fn cell_count(&self) -> usize {
        self.cells
    }

    /// All cells: number, type and corners, of which the first `CellType::corners` count.
    pub fn cells(&self) -> impl Iterator<Item = (usize, CellType, [u32; 8])> {
        let indices: &[u32] = self.connectivity.as_slice().unwrap_or_default();
        let mut at = 0;
        (0..self.cells).map(move |cell| {
            let cell_type = match &self.types {
                CellTypes::All(t) => *t,
                CellTypes::Each(codes) => CellType::from_code(codes.bytes()[cell]).unwrap_or(CellType::Tetrahedron),
            };
            let n = cell_type.corners();
            let mut corners = [0; 8];
            corners[..n].copy_from_slice(&indices[at..at + n]);
            at += n;
            (cell, cell_type, corners)
        })
    }
}

impl Geometry for Mesh {
    fn name(&self) -> &str {
        NAME
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        let mut made = Tessellation::of_cells(&self.points, self.cells().map(|(_, t, c)| (t, c)), self.cells);
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
