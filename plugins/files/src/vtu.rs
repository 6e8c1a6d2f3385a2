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

use std::{collections::HashMap, path::Path, sync::Arc};

use volact_core::{
    LoadError, LoadOptions, MeshData, Points, Progress, Warning,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, name_of},
    mesh::{Attributes, CellArrays, CellLayout, Cells, Named, check_count, codes, finite_points, note},
    numbers::Numbers,
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
    let length = match count.checked_sub(1) {
        Some(last) => ends.integer(last as usize).and_then(|n| u64::try_from(n).ok()),
        None => Some(0),
    };
    let Some(length) = length else {
        return Err(LoadError::invalid(path, "offsets", "no whole number at the end", "the length of connectivity"));
    };
    let connectivity = reader.read(piece.array(path, "Cells", "connectivity")?, length)?;
    let cells = CellArrays { types: codes(path, &types)?, connectivity, layout: CellLayout::Ends(ends) };
    let Some(array) = piece.arrays("Points").first() else {
        return Err(LoadError::invalid(path, "array of Points", "missing", "one"));
    };
    let numbers = reader.read(array, vertices as u64 * 3)?;
    let points = finite_points(path, numbers, |vertex| cells.owner(vertex))?;
    let ghosts = reader.ghost_cells(piece, count)?;
    let attributes = reader.attributes(piece, vertices, file, warnings)?;
    Ok(Part { points, cells, ghosts, attributes })
}

/// Vertices of several pieces, of which those in the same place are one.
#[derive(Default)]
struct Joined {
    first: HashMap<[u64; 3], u32>,
    count: u32,
}

impl Joined {
    /// The numbers of the next piece's vertices.
    fn places(&mut self, path: &Path, points: &Points) -> Result<Vec<u32>, LoadError> {
        check_count(path, "number of points of all pieces", u64::from(self.count) + points.len() as u64)?;
        let place = |(i, p): (usize, volact_core::glam::DVec3)| {
            // Adding zero makes one of both zeros.
            let key = p.to_array().map(|v| (v + 0.0).to_bits());
            *self.first.entry(key).or_insert(self.count + i as u32)
        };
        let places = points.iter().enumerate().map(place).collect();
        self.count += points.len() as u32;
        Ok(places)
    }
}

type Merged = (Points, Vec<volact_core::Attribute>);

/// The vertices and attributes of all pieces, one after another.
fn merge(
    path: &Path,
    file: &str,
    mut parts: Vec<(Points, Vec<Named>)>,
    warnings: &mut Vec<Warning>,
) -> Result<Merged, LoadError> {
    let mut attributes = Attributes::new(path, file);
    if parts.len() == 1 {
        let (points, all) = parts.remove(0);
        for named in all {
            attributes.add(named, points.len(), warnings)?;
        }
        return Ok((points, attributes.finish()));
    }
    let names: Vec<String> = parts[0].1.iter().map(|a| a.name.clone()).collect();
    let vertices = parts.iter().map(|(points, _)| points.len()).sum();
    for name in names {
        let mut joined: Option<Named> = None;
        let mut bytes = Vec::new();
        for (_, all) in &parts {
            let found = all.iter().find(|a| a.name == name);
            let same = |a: &&Named| {
                joined.as_ref().is_none_or(|j| (j.components, j.numbers.kind) == (a.components, a.numbers.kind))
            };
            let Some(found) = found.filter(same) else {
                warnings.push(note(file, format!("attribute {name:?} is left out: not the same in all pieces")));
                joined = None;
                break;
            };
            bytes.extend_from_slice(found.numbers.data.bytes());
            let (name, components, numbers) = (name.clone(), found.components, found.numbers.clone());
            joined = Some(Named { name, components, numbers });
        }
        if let Some(mut joined) = joined {
            joined.numbers = Numbers::from_native(joined.numbers.kind, bytes);
            attributes.add(joined, vertices, warnings)?;
        }
    }
    let points = parts.iter().flat_map(|(points, _)| points.iter()).collect();
    Ok((points, attributes.finish()))
}
