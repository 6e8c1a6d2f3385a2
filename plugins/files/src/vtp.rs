//! VTK XML polygonal surfaces.
//!
//! # Reads
//! `.vtp` in all the ways that `vtu` does: polygons of any number of corners and strips, cut into
//! triangles; one piece or several. The active normals of the points become the surface's normals,
//! other point data attributes.
//!
//! # Options
//! None.
//!
//! # Limits
//! Vertices, lines and cell data are left out, with a warning. lzma compression is refused.

use std::{path::Path, sync::Arc};

use volact_core::{
    LoadError, LoadOptions, MeshData, Progress,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, name_of},
    mesh::{CellLayout, Named, Triangles, check_count, finite_points, merge, note},
    numbers::Numbers,
    storage::Storage,
    vtk_arrays::{ArrayReader, cell_data_left_out},
    vtk_xml::{self, Piece},
};

const KIND: &str = "PolyData";

/// The loader.
pub(crate) fn format() -> Format {
    Format::of_meshes("vtp", "VTK XML polygonal surfaces (.vtp)", probe, read)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    confidence(vtk_xml::is_of_type(probe, KIND), probe, &[".vtp"])
}

/// The polygons, or strips, of a piece.
struct Faces {
    first_vertex: usize,
    vertices: usize,
    connectivity: Numbers,
    ends: CellLayout,
    count: u64,
    strips: bool,
}

fn read(
    storage: &Storage,
    path: &Path,
    _options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<MeshData, LoadError> {
    let document = vtk_xml::parse(storage, path, KIND, "name the loader for it, or save it as polygons")?;
    if document.pieces.is_empty() {
        return Err(LoadError::invalid(path, "element Piece", "missing", "one"));
    }
    let name = name_of(path);
    let mut warnings = Vec::new();
    cell_data_left_out(&document, &name, &mut warnings);
    let mut reader = ArrayReader::new(storage, &document, progress)?;
    let (mut parts, mut faces, mut first, mut thin) = (Vec::new(), Vec::new(), 0, 0);
    for piece in &document.pieces {
        let vertices = check_count(path, "NumberOfPoints", piece.count(path, "NumberOfPoints")?)?;
        thin += count(path, piece, "NumberOfVerts")? + count(path, piece, "NumberOfLines")?;
        for (section, attribute, strips) in [("Polys", "NumberOfPolys", false), ("Strips", "NumberOfStrips", true)] {
            let count = count(path, piece, attribute)?;
            if count == 0 {
                continue;
            }
            let ends = reader.read(piece.array(path, section, "offsets")?, count)?;
            let length = reader.length(&ends)?;
            let connectivity = reader.read(piece.array(path, section, "connectivity")?, length)?;
            let ends = CellLayout::Ends(ends);
            faces.push(Faces { first_vertex: first, vertices, connectivity, ends, count, strips });
        }
        let points = reader.points(piece, vertices as u64)?;
        let points = finite_points(path, points, |_| "of the surface".into())?;
        parts.push((points, reader.attributes(piece, vertices, &name, &mut warnings)?));
        first += vertices;
    }
    check_count(path, "number of points of all pieces", first as u64)?;
    if thin > 0 {
        warnings.push(note(&name, format!("{thin} vertices and lines are left out of the surface")));
    }
    let normals = take_normals(&document.pieces[0], &mut parts);
    let (points, mut attributes) = merge(path, &name, parts, &mut warnings)?;
    let mut triangles = Triangles::new(path, &points);
    for f in &faces {
        triangles.add_all(&f.connectivity, &f.ends, f.count, f.strips, f.first_vertex..f.first_vertex + f.vertices)?;
    }
    let mut surface = triangles.finish(&name, &mut warnings)?;
    if let Some(at) = normals.and_then(|normals| attributes.iter().position(|a| a.name == normals)) {
        let normals = attributes.remove(at);
        let numbers = Numbers { kind: crate::numbers::NumberType::Scalar(normals.scalar), data: normals.data };
        let normals = finite_points(path, numbers, |_| "a normal".into())?;
        surface = surface.with_normals(normals).map_err(|source| LoadError::geometry(path, source))?;
    }
    Ok(MeshData { name, geometry: Arc::new(surface), attributes, warnings })
}

fn count(path: &Path, piece: &Piece, name: &str) -> Result<u64, LoadError> {
    if piece.attributes.get(name).is_some() { piece.count(path, name) } else { Ok(0) }
}

/// The name of the point data that are the surface's normals: three numbers each.
fn take_normals(piece: &Piece, parts: &mut [(volact_core::Points, Vec<Named>)]) -> Option<String> {
    let section = piece.section("PointData")?;
    let name = section.attributes.get("Normals").unwrap_or("Normals");
    let good = parts.iter().all(|(_, all)| all.iter().any(|a| a.name == name && a.components == 3));
    good.then(|| name.to_owned())
}
