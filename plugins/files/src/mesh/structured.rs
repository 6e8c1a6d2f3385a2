//! Structured grids with parts left out.

use std::{path::Path, sync::Arc};

use volact_core::{Buffer, CellType, CellTypes, Geometry, LoadError, Mesh, Points, StructuredMesh};

use crate::numbers::Numbers;

/// The array of flags that marks what is no part of a grid.
pub(crate) const GHOSTS: &str = "vtkGhostType";
/// Cells that belong to another piece, are refined elsewhere, lie outside or are hidden
/// (`vtkDataSetAttributes::CellGhostTypes`).
pub(crate) const GHOST_CELL: u8 = 1 | 8 | 16 | 32;
/// Points that are hidden (`vtkDataSetAttributes::PointGhostTypes`).
pub(crate) const HIDDEN_POINT: u8 = 2;

/// Which numbers have one of the mask's bits; `None` if none has.
pub(crate) fn flags(numbers: &Numbers, mask: u8) -> Option<Vec<bool>> {
    let set = |i| numbers.integer(i).is_some_and(|v| v & i64::from(mask) != 0);
    let set: Vec<bool> = (0..numbers.len()).map(set).collect();
    set.contains(&true).then_some(set)
}

/// What a structured grid leaves out: flags of its vertices and of its cells, `false` for what is
/// left out.
#[derive(Default)]
pub(crate) struct Blanking {
    pub(crate) vertices: Option<Vec<u8>>,
    pub(crate) cells: Option<Vec<bool>>,
}

/// The hexahedra of a grid of `dims` vertices, x fastest.
pub(crate) fn hexahedra(dims: [usize; 3]) -> impl Iterator<Item = [u32; 8]> {
    let [nx, ny, nz] = dims;
    let at = move |x: usize, y: usize, z: usize| ((z * ny + y) * nx + x) as u32;
    let rows = (0..nz.saturating_sub(1)).flat_map(move |z| (0..ny.saturating_sub(1)).map(move |y| (y, z)));
    rows.flat_map(move |(y, z)| {
        (0..nx.saturating_sub(1)).map(move |x| {
            let around = |z| [at(x, y, z), at(x + 1, y, z), at(x + 1, y + 1, z), at(x, y + 1, z)];
            let ([a, b, c, d], [e, f, g, h]) = (around(z), around(z + 1));
            [a, b, c, d, e, f, g, h]
        })
    })
}

/// A structured mesh; an unstructured one where single cells are left out.
pub(crate) fn structured(
    path: &Path,
    dims: [usize; 3],
    points: Points,
    blanking: Blanking,
) -> Result<Arc<dyn Geometry>, LoadError> {
    let wrong = |source| LoadError::geometry(path, source);
    let Some(cells) = blanking.cells else {
        let mut mesh = StructuredMesh::new(dims, points).map_err(wrong)?;
        if let Some(visible) = blanking.vertices {
            mesh = mesh.with_blanking(Buffer::from_vec(visible)).map_err(wrong)?;
        }
        if mesh.cells().next().is_none() {
            return Err(LoadError::invalid(path, "number of cells that are not blanked", 0, "at least 1"));
        }
        return Ok(Arc::new(mesh));
    };
    let seen = |corners: &[u32; 8]| {
        blanking.vertices.as_ref().is_none_or(|v| corners.iter().all(|&i| v.get(i as usize) != Some(&0)))
    };
    let kept = hexahedra(dims).zip(cells).filter(|(corners, visible)| *visible && seen(corners));
    let connectivity: Vec<u32> = kept.flat_map(|(corners, _)| corners).collect();
    if connectivity.is_empty() {
        return Err(LoadError::invalid(path, "number of cells that are not blanked", 0, "at least 1"));
    }
    let mesh = Mesh::new(points, CellTypes::All(CellType::Hexahedron), Buffer::from_vec(connectivity));
    Ok(Arc::new(mesh.map_err(wrong)?))
}
