//! PLY surfaces.
//!
//! # Reads
//! Text and binary of either byte order: the elements `vertex` and `face` (`vertex_indices` or
//! `vertex_index`, polygons of any number of corners) or `tristrips`. `nx`, `ny` and `nz` are the
//! surface's normals; every other number of a vertex is an attribute of the type it has in the
//! file.
//!
//! # Options
//! None.
//!
//! # Limits
//! Lists of vertices, numbers of faces and other elements are left out, with a warning.
//! Decoded by the crate ply-rs-bw, some rows at a time.

use std::{io::Cursor, path::Path, sync::Arc};

use ply_rs_bw::{
    parser::{Parser, Reader},
    ply::{
        ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType as Ply,
    },
};
use volact_core::{
    LoadError, LoadOptions, MeshData, Points, Progress, ScalarType, Warning,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, name_of},
    mesh::{Attributes, Meter, Named, Triangles, check_count, finite_points, note},
    numbers::{NumberType, Numbers},
    storage::Storage,
};

/// Rows decoded at once.
const ROWS: usize = 4096;

/// The loader.
pub(crate) fn format() -> Format {
    Format::of_meshes("ply", "PLY surfaces (.ply)", probe, read)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    let content = probe.head.starts_with(b"ply\n") || probe.head.starts_with(b"ply\r");
    confidence(content, probe, &[".ply"])
}

/// The plain numbers of an element, in the order of the header.
struct Row(Vec<f64>);

impl PropertyAccess for Row {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, _: &str, property: Property) -> PropertyAccessResult {
        let value = match property {
            Property::Char(v) => f64::from(v),
            Property::UChar(v) => f64::from(v),
            Property::Short(v) => f64::from(v),
            Property::UShort(v) => f64::from(v),
            Property::Int(v) => f64::from(v),
            Property::UInt(v) => f64::from(v),
            Property::Float(v) => f64::from(v),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0.push(value);
        PropertyAccessResult::Set
    }
}

/// The corners of a face.
struct Corners(Vec<i64>);

impl PropertyAccess for Corners {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !is_corners(name) {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match property {
            Property::ListChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUChar(v) => v.into_iter().map(i64::from).collect(),
            Property::ListShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUShort(v) => v.into_iter().map(i64::from).collect(),
            Property::ListInt(v) => v.into_iter().map(i64::from).collect(),
            Property::ListUInt(v) => v.into_iter().map(i64::from).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

fn is_corners(name: &str) -> bool {
    matches!(name, "vertex_indices" | "vertex_index")
}

/// The numbers of one property, of all vertices.
struct Column {
    name: String,
    kind: ScalarType,
    bytes: Vec<u8>,
}

struct File<'a> {
    path: &'a Path,
    header: Header,
    reader: Reader<Cursor<&'a [u8]>>,
    meter: Meter<'a>,
}

fn decode(path: &Path, error: impl std::fmt::Display) -> LoadError {
    let message = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    // What follows is the grammar's own notation.
    let end = [" Error: ParseError", " Error: error at"].iter().filter_map(|word| message.find(word)).min();
    let short: String = message[..end.unwrap_or(message.len())].chars().take(300).collect();
    LoadError::Decode { path: path.into(), source: short.into() }
}

fn read(
    storage: &Storage,
    path: &Path,
    _options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<MeshData, LoadError> {
    let contents = storage.contents(path)?;
    let mut reader = Reader::new(Cursor::new(contents.bytes()));
    let header = Parser::<Row>::new().read_header(&mut reader).map_err(|e| decode(path, e))?;
    let meter = Meter::new(storage, path, progress, 1)?;
    let mut file = File { path, header, reader, meter };
    let name = name_of(path);
    let mut warnings = Vec::new();
    let (mut columns, mut faces) = (None, Vec::new());
    for element in file.header.elements.values().cloned().collect::<Vec<_>>() {
        file.check(&element, contents.len())?;
        match element.name.as_str() {
            "vertex" => columns = Some(file.columns(&element, &name, &mut warnings)?),
            "face" | "tristrips" => faces.push(file.faces(&element, &name, &mut warnings)?),
            other => {
                warnings.push(note(&name, format!("{} elements {other:?} are left out", element.count)));
                file.rows::<Row>(&element, |_, _| ())?;
            }
        }
    }
    let columns = columns.ok_or_else(|| LoadError::invalid(path, "element vertex", "missing", "one"))?;
    let mut meter = file.meter;
    let made = build(path, name, columns, faces, warnings)?;
    meter.step()?;
    Ok(made)
}

impl File<'_> {
    /// Refuses more elements than the file has bytes for.
    fn check(&self, element: &ElementDef, bytes: usize) -> Result<(), LoadError> {
        let text = self.header.encoding == Encoding::Ascii;
        let least = |p: &PropertyType| match p {
            _ if text => 2,
            PropertyType::Scalar(kind) | PropertyType::List(kind, _) => scalar(kind).size() as u64,
        };
        let row: u64 = element.properties.values().map(|p| least(&p.data_type)).sum();
        let wanted = (element.count as u64).saturating_mul(row.max(1));
        if wanted > bytes as u64 + 1 {
            let what = format!("{} elements {:?}", element.count, element.name);
            return Err(LoadError::Truncated { path: self.path.into(), what, found: bytes as u64, wanted });
        }
        Ok(())
    }

    /// Decodes an element's rows, some at a time.
    fn rows<E: PropertyAccess>(
        &mut self,
        element: &ElementDef,
        mut take: impl FnMut(usize, E),
    ) -> Result<(), LoadError> {
        let parser = Parser::<E>::new();
        let mut some = element.clone();
        let mut done = 0;
        while done < element.count {
            some.count = ROWS.min(element.count - done);
            let rows = parser
                .read_payload_for_element(&mut self.reader, &some, &self.header)
                .map_err(|e| decode(self.path, format!("{} {done} to {}: {e}", element.name, done + some.count - 1)))?;
            rows.into_iter().enumerate().for_each(|(n, row)| take(done + n, row));
            done += some.count;
            self.meter.at(usize::try_from(self.reader.get_ref().position()).unwrap_or(usize::MAX))?;
        }
        Ok(())
    }

    fn columns(
        &mut self,
        element: &ElementDef,
        file: &str,
        warnings: &mut Vec<Warning>,
    ) -> Result<Vec<Column>, LoadError> {
        check_count(self.path, "number of vertices", element.count as u64)?;
        let mut columns = Vec::new();
        for property in element.properties.values() {
            match &property.data_type {
                PropertyType::Scalar(kind) => {
                    columns.push(Column { name: property.name.clone(), kind: scalar(kind), bytes: Vec::new() });
                }
                PropertyType::List(..) => {
                    warnings.push(note(file, format!("the lists {:?} of vertices are left out", property.name)));
                }
            }
        }
        self.rows(element, |_, Row(values)| {
            columns.iter_mut().zip(values).for_each(|(column, value)| put(column, value));
        })?;
        Ok(columns)
    }

    fn faces(&mut self, element: &ElementDef, file: &str, warnings: &mut Vec<Warning>) -> Result<Faces, LoadError> {
        let others: Vec<_> = element.properties.keys().filter(|name| !is_corners(name)).collect();
        if others.len() == element.properties.len() {
            let what = format!("list vertex_indices of {}", element.name);
            return Err(LoadError::invalid(self.path, what, "missing", "one"));
        }
        if !others.is_empty() {
            warnings.push(note(file, format!("numbers of faces are left out: {others:?}")));
        }
        let mut faces = Faces { ends: Vec::new(), corners: Vec::new(), strips: element.name == "tristrips" };
        self.rows(element, |_, Corners(corners)| {
            faces.corners.extend(corners);
            faces.ends.push(faces.corners.len());
        })?;
        Ok(faces)
    }
}

struct Faces {
    ends: Vec<usize>,
    corners: Vec<i64>,
    strips: bool,
}

fn scalar(kind: &Ply) -> ScalarType {
    match kind {
        Ply::Char => ScalarType::I8,
        Ply::UChar => ScalarType::U8,
        Ply::Short => ScalarType::I16,
        Ply::UShort => ScalarType::U16,
        Ply::Int => ScalarType::I32,
        Ply::UInt => ScalarType::U32,
        Ply::Float => ScalarType::F32,
        Ply::Double => ScalarType::F64,
    }
}

/// Appends a number that came from a number of the column's type.
fn put(column: &mut Column, value: f64) {
    match column.kind {
        ScalarType::U8 => column.bytes.push(value as u8),
        ScalarType::I8 => column.bytes.push(value as i8 as u8),
        ScalarType::U16 => column.bytes.extend((value as u16).to_ne_bytes()),
        ScalarType::I16 => column.bytes.extend((value as i16).to_ne_bytes()),
        ScalarType::U32 => column.bytes.extend((value as u32).to_ne_bytes()),
        ScalarType::I32 => column.bytes.extend((value as i32).to_ne_bytes()),
        ScalarType::F32 => column.bytes.extend((value as f32).to_ne_bytes()),
        ScalarType::F16 | ScalarType::F64 => column.bytes.extend(value.to_ne_bytes()),
    }
}

/// Takes three columns as the coordinates of vectors; `None` if one is missing.
fn vectors(columns: &mut Vec<Column>, names: [&str; 3]) -> Option<Numbers> {
    if !names.iter().all(|name| columns.iter().any(|c| c.name == *name)) {
        return None;
    }
    let mut take = |name: &str| columns.iter().position(|c| c.name == name).map(|at| columns.remove(at));
    let [x, y, z] = [take(names[0])?, take(names[1])?, take(names[2])?];
    let single = [&x, &y, &z].iter().all(|c| c.kind == ScalarType::F32);
    let kind = NumberType::Scalar(if single { ScalarType::F32 } else { ScalarType::F64 });
    let mut bytes = Vec::new();
    for n in 0..x.bytes.len() / x.kind.size() {
        for column in [&x, &y, &z] {
            let value = column.kind.read(&column.bytes, n);
            if single {
                bytes.extend((value as f32).to_ne_bytes());
            } else {
                bytes.extend(value.to_ne_bytes());
            }
        }
    }
    Some(Numbers::from_native(kind, bytes))
}

fn build(
    path: &Path,
    name: String,
    mut columns: Vec<Column>,
    faces: Vec<Faces>,
    mut warnings: Vec<Warning>,
) -> Result<MeshData, LoadError> {
    let Some(numbers) = vectors(&mut columns, ["x", "y", "z"]) else {
        return Err(LoadError::invalid(path, "properties x, y and z of vertex", "missing", "all three"));
    };
    let points: Points = finite_points(path, numbers, |_| "of the surface".into())?;
    let normals = vectors(&mut columns, ["nx", "ny", "nz"]);
    let mut triangles = Triangles::new(path, &points);
    for set in &faces {
        let mut start = 0;
        for &end in &set.ends {
            // -1 ends a strip.
            let corners = &set.corners[start..end];
            let parts = corners.split(|c| set.strips && *c == -1);
            for part in parts.filter(|part| !set.strips || !part.is_empty()) {
                triangles.add(part.iter().map(|c| Some(*c)), set.strips, 0..points.len())?;
            }
            start = end;
        }
    }
    let mut surface = triangles.finish(&name, &mut warnings)?;
    if let Some(normals) = normals {
        let normals = finite_points(path, normals, |_| "its normal".into())?;
        surface = surface.with_normals(normals).map_err(|source| LoadError::geometry(path, source))?;
    }
    let mut attributes = Attributes::new(path, &name);
    for Column { name, kind, bytes } in columns {
        let numbers = Numbers::from_native(NumberType::Scalar(kind), bytes);
        attributes.add(Named { name, components: 1, numbers }, points.len(), &mut warnings)?;
    }
    let attributes = attributes.finish();
    Ok(MeshData { name, geometry: Arc::new(surface), attributes, warnings })
}
