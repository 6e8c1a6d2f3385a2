//! VTK XML structured grids.
//!
//! # Reads
//! `.vts` with one piece, in all the ways that `vtu` does. All point data become attributes. Points
//! that `vtkGhostType` hides blank their cells; cells that it hides are left out.
//!
//! # Options
//! None.
//!
//! # Limits
//! Cell data are left out, with a warning. Several pieces, grids of fewer than three dimensions and
//! lzma compression are refused.

use std::path::Path;

use volact_core::{
    LoadError, LoadOptions, MeshData, Progress,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, name_of},
    mesh::{Attributes, Blanking, check_count, finite_points, note, structured},
    storage::Storage,
    vtk_arrays::{ArrayReader, cell_data_left_out},
    vtk_xml,
};

const KIND: &str = "StructuredGrid";

/// The loader.
pub(crate) fn format() -> Format {
    Format::of_meshes("vts", "VTK XML structured grids (.vts)", probe, read)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    confidence(vtk_xml::is_of_type(probe, KIND), probe, &[".vts"])
}

fn read(
    storage: &Storage,
    path: &Path,
    _options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<MeshData, LoadError> {
    let document = vtk_xml::parse(storage, path, KIND, "name the loader for it, or save it as a structured grid")?;
    let piece = match &document.pieces[..] {
        [piece] => piece,
        [] => return Err(LoadError::invalid(path, "element Piece", "missing", "one")),
        _ => {
            let (what, cure) = ("a structured grid of several pieces".into(), "save it as one piece".into());
            return Err(LoadError::Unsupported { path: path.into(), what, cure });
        }
    };
    let name = name_of(path);
    let mut warnings = Vec::new();
    let (own, dims) = vtk_xml::extent(path, "Piece Extent", piece.attributes.get("Extent"))?;
    if let Some(text) = document.grid.as_ref().and_then(|grid| grid.get("WholeExtent")) {
        let (whole, _) = vtk_xml::extent(path, "WholeExtent", Some(text))?;
        if whole != own {
            warnings.push(note(&name, format!("this is the part {own:?} of a grid of {whole:?}")));
        }
    }
    let count = dims.iter().fold(1u64, |n, d| n.saturating_mul(*d as u64));
    let vertices = check_count(path, "number of vertices of Piece Extent", count)?;
    cell_data_left_out(&document, &name, &mut warnings);
    let mut reader = ArrayReader::new(storage, &document, progress)?;
    let numbers = reader.points(piece, count)?;
    let [nx, ny, _] = dims;
    let owner = |v: usize| format!("at {:?} of the grid", [v % nx, v / nx % ny, v / nx / ny]);
    let points = finite_points(path, numbers, owner)?;
    let cells: usize = dims.iter().map(|n| n.saturating_sub(1)).product();
    let visible = |flags: Vec<bool>| flags.into_iter().map(|hidden| !hidden);
    let blanking = Blanking {
        vertices: reader.hidden_points(piece, count)?.map(|f| visible(f).map(u8::from).collect()),
        cells: reader.ghost_cells(piece, cells as u64)?.map(|f| visible(f).collect()),
    };
    let mut attributes = Attributes::new(path, &name);
    for named in reader.attributes(piece, vertices, &name, &mut warnings)? {
        attributes.add(named, vertices, &mut warnings)?;
    }
    let attributes = attributes.finish();
    let geometry = structured(path, dims, points, blanking)?;
    Ok(MeshData { name, geometry, attributes, warnings })
}
