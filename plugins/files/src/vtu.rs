//! VTK XML unstructured grids.
//!
//! # Reads
//! `.vtu`: inline ASCII and base64, appended raw and base64; uncompressed, zlib and LZ4;
//! `header_type` UInt32 and UInt64; either byte order; connectivity and offsets of any integer
//! type; tetrahedra, hexahedra, voxels, wedges (either way round) and pyramids, also mixed; one
//! piece or several, whose coincident vertices are joined. All point data become attributes of the
//! type they have in the file; 64-bit integers become 32-bit ones, or doubles where they do not
//! fit. Cells that `vtkGhostType` marks as ghosts or hidden are left out.
//!
//! # Options
//! None.
//!
//! # Limits
//! Cells without volume and cell data are left out, with a warning. Curved cells, polyhedra and
//! lzma compression are refused. An attribute of a file of several pieces must be in all of them.

use std::{path::Path, sync::Arc};

use volact_core::{
    LoadError, LoadOptions, MeshData, Points, Progress, Warning,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, name_of},
    mesh::{CellArrays, CellLayout, Cells, Joined, Named, check_count, codes, finite_points, merge},
    storage::Storage,
    vtk_arrays::{ArrayReader, cell_data_left_out},
    vtk_xml::{self, Piece},
};

const KIND: &str = "UnstructuredGrid";

/// The loader.
pub(crate) fn format() -> Format {
    Format::of_meshes("vtu", "VTK XML unstructured grids (.vtu)", probe, read)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    confidence(vtk_xml::is_of_type(probe, KIND), probe, &[".vtu"])
}

fn read(
    storage: &Storage,
    path: &Path,
    _options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<MeshData, LoadError> {
    let document = vtk_xml::parse(storage, path, KIND, "name the loader for it, or save it as an unstructured grid")?;
    if document.pieces.is_empty() {
        return Err(LoadError::invalid(path, "element Piece", "missing", "one"));
    }
    let name = name_of(path);
    let mut warnings = Vec::new();
    cell_data_left_out(&document, &name, &mut warnings);
    let mut reader = ArrayReader::new(storage, &document, progress)?;
    let mut cells = Cells::new(path, document.pieces.len());
    let mut parts = Vec::new();
    let mut joined = Joined::default();
    for piece in &document.pieces {
        let part = read_piece(&mut reader, path, piece, &name, &mut warnings)?;
        let hidden = |cell: usize| part.ghosts.as_ref().is_some_and(|g| g[cell]);
        let count = part.points.len();
        if document.pieces.len() == 1 {
            cells.add(&part.cells, count, hidden, |i| i)?;
        } else {
            let places = joined.places(path, &part.points)?;
            cells.add(&part.cells, count, hidden, |i| places[i as usize])?;
        }
        parts.push((part.points, part.attributes));
    }
    let (points, attributes) = merge(path, &name, parts, &mut warnings)?;
    let mesh = cells.finish(&name, points, &mut warnings)?;
    Ok(MeshData { name, geometry: Arc::new(mesh), attributes, warnings })
}

struct Part {
    points: Points,
    cells: CellArrays,
    ghosts: Option<Vec<bool>>,
    attributes: Vec<Named>,
}

fn read_piece(
    reader: &mut ArrayReader<'_>,
    path: &Path,
    piece: &Piece,
    file: &str,
    warnings: &mut Vec<Warning>,
) -> Result<Part, LoadError> {
    let vertices = check_count(path, "NumberOfPoints", piece.count(path, "NumberOfPoints")?)?;
    let count = piece.count(path, "NumberOfCells")?;
    let types = reader.read(piece.array(path, "Cells", "types")?, count)?;
    let ends = reader.read(piece.array(path, "Cells", "offsets")?, count)?;
    let length = reader.length(&ends)?;
    let connectivity = reader.read(piece.array(path, "Cells", "connectivity")?, length)?;
    let cells = CellArrays { types: codes(path, &types)?, connectivity, layout: CellLayout::Ends(ends) };
    let numbers = reader.points(piece, vertices as u64)?;
    let points = finite_points(path, numbers, |vertex| cells.owner(vertex))?;
    let ghosts = reader.ghost_cells(piece, count)?;
    let attributes = reader.attributes(piece, vertices, file, warnings)?;
    Ok(Part { points, cells, ghosts, attributes })
}
