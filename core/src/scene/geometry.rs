//! Reads the geometry of a shape.

use glam::DVec3;

use super::{
    GeometrySpec, MeshSpec, PointsSpec,
    document::Kind,
    parameters::{head, parameters},
    reader::{At, Fields, Reader},
};

const KNOWN: [&str; 7] = ["Around", "Block", "Mesh", "StructuredMesh", "Sphere", "Cylinder", "Geometry"];
/// Flat faces around a round solid that does not say.
const SEGMENTS: u32 = 64;

pub(super) fn geometry(reader: &mut Reader, at: &At) -> Option<GeometrySpec> {
    match head(at) {
        "Around" if matches!(&at.node.kind, Kind::Tuple { items, .. } if items.is_empty()) => {
            Some(GeometrySpec::Around)
        }
        "Block" => {
            let fields = reader.fields(at, &["Block"], &["offset", "dimensions"])?;
            let offset = required_vec3(reader, &fields, "offset", "the lowest corner (x, y, z)");
            let dimensions = reader.required(&fields, "dimensions", "the lengths (x, y, z)");
            let positive = |r: &mut Reader, at: &At| r.float_where(at, |v| v > 0.0, "a positive, finite number");
            let dimensions = dimensions.and_then(|at| reader.array(&at, "three numbers (x, y, z)", positive));
            Some(GeometrySpec::Block { offset: offset?, dimensions: DVec3::from_array(dimensions?) })
        }
        "Mesh" => mesh(reader, at),
        "StructuredMesh" => structured(reader, at),
        "Sphere" => {
            let fields = reader.fields(at, &["Sphere"], &["center", "radius", "segments"])?;
            let center = required_vec3(reader, &fields, "center", "the centre (x, y, z)");
            let (radius, segments) = round(reader, &fields);
            Some(GeometrySpec::Sphere { center: center?, radius: radius?, segments: segments? })
        }
        "Cylinder" => {
            let fields = reader.fields(at, &["Cylinder"], &["start", "end", "radius", "segments"])?;
            let start = required_vec3(reader, &fields, "start", "one end of the axis (x, y, z)");
            let end = required_vec3(reader, &fields, "end", "the other end of the axis (x, y, z)");
            if let (Some(start), Some(end), Some(at)) = (start, end, fields.optional("end"))
                && start == end
            {
                return reader.refuse(&at, "another end than `start`");
            }
            let (radius, segments) = round(reader, &fields);
            Some(GeometrySpec::Cylinder { ends: [start?, end?], radius: radius?, segments: segments? })
        }
        "Geometry" => {
            let fields = reader.fields(at, &["Geometry"], &["name", "parameters"])?;
            let name = reader.required(&fields, "name", "a geometry's name").and_then(|at| reader.name(&at));
            let parameters = fields.optional("parameters").map(|at| parameters(reader, &at)).unwrap_or_default();
            Some(GeometrySpec::Named { name: name?, parameters })
        }
        other => reader.unknown(at, other, "one of ", &KNOWN),
    }
}

fn required_vec3(reader: &mut Reader, fields: &Fields, name: &str, wanted: &str) -> Option<DVec3> {
    let at = reader.required(fields, name, wanted)?;
    reader.vec3(&at)
}

fn round(reader: &mut Reader, fields: &Fields) -> (Option<f64>, Option<u32>) {
    let radius = reader.required(fields, "radius", "the radius");
    let radius = radius.and_then(|at| reader.float_where(&at, |v| v > 0.0, "a positive, finite number"));
    let segments = fields.optional("segments").map_or(Some(SEGMENTS), |at| match at.node.kind {
        Kind::Number { whole: Some(v @ 3..=1024), .. } => Some(v as u32),
        _ => reader.refuse(&at, "a whole number from 3 to 1024"),
    });
    (radius, segments)
}

/// A mesh or surface of a file, or one that is written out.
fn mesh(reader: &mut Reader, at: &At) -> Option<GeometrySpec> {
    let known = ["data", "texture_coordinates", "points", "tetrahedra", "hexahedra", "wedges", "pyramids", "triangles"];
    let fields = reader.fields(at, &["Mesh"], &known)?;
    match fields.optional("data") {
        Some(data) => {
            let written = &known[2..];
            if let Some(at) = written.iter().find_map(|name| fields.optional(name)) {
                return reader.refuse(&at, "nothing: `data` gives the whole mesh");
            }
            let coordinates = fields.optional("texture_coordinates").map(|at| reader.name(&at));
            let data = reader.name(&data);
            Some(GeometrySpec::Data {
                data: data?,
                texture_coordinates: coordinates.map_or(Some(None), |n| n.map(Some))?,
            })
        }
        None => written_mesh(reader, at, &fields),
    }
}

fn written_mesh(reader: &mut Reader, at: &At, fields: &Fields) -> Option<GeometrySpec> {
    let source = reader.required(fields, "points", "the vertices, [(x, y, z), …], or the name of `data` that has them");
    let points = source.and_then(|at| points(reader, &at));
    let count = match &points {
        Some(PointsSpec::Inline(points)) => points.len(),
        _ => usize::MAX,
    };
    let coordinates = texture_coordinates(reader, fields, count);
    let tetrahedra = cells(reader, fields, "tetrahedra", count);
    let hexahedra = cells(reader, fields, "hexahedra", count);
    let wedges = cells(reader, fields, "wedges", count);
    let pyramids = cells(reader, fields, "pyramids", count);
    let triangles = cells(reader, fields, "triangles", count);
    let mesh = MeshSpec {
        points: points?,
        texture_coordinates: coordinates?,
        tetrahedra: tetrahedra?,
        hexahedra: hexahedra?,
        wedges: wedges?,
        pyramids: pyramids?,
    };
    let triangles = triangles?;
    let empty =
        mesh.tetrahedra.is_empty() && mesh.hexahedra.is_empty() && mesh.wedges.is_empty() && mesh.pyramids.is_empty();
    match (empty, triangles.is_empty()) {
        (true, true) => reader.refuse(at, "cells: `tetrahedra`, `hexahedra`, `wedges`, `pyramids`, or `triangles`"),
        (false, true) => Some(GeometrySpec::Mesh(mesh)),
        (true, false) if mesh.texture_coordinates.is_none() => {
            Some(GeometrySpec::Surface { points: mesh.points, triangles })
        }
        _ => reader
            .refuse(at, "triangles by themselves, without cells and texture coordinates: a surface holds no volume"),
    }
}

fn structured(reader: &mut Reader, at: &At) -> Option<GeometrySpec> {
    let fields = reader.fields(at, &["StructuredMesh"], &["dims", "points", "texture_coordinates"])?;
    let dims = reader.required(&fields, "dims", "vertices along each axis, (x, y, z)");
    let dims = dims.and_then(|at| {
        let wanted = "vertices along each axis, (x, y, z)";
        let dims = reader.array::<usize, 3>(&at, wanted, |r, at| r.count(at, 2))?;
        let fits = dims[0].saturating_mul(dims[1]).saturating_mul(dims[2]) <= u32::MAX as usize;
        if fits { Some(dims) } else { reader.refuse(&at, "at most 4294967295 vertices") }
    });
    let count = dims.map_or(usize::MAX, |d| d[0] * d[1] * d[2]);
    let source = reader.required(&fields, "points", "the vertices, [(x, y, z), …], x fastest, or File(\"…\")");
    let points = source.and_then(|at| {
        let points = points(reader, &at)?;
        same_number(reader, &at, points, count, "one for each vertex of the grid")
    });
    let coordinates = texture_coordinates(reader, &fields, count);
    Some(GeometrySpec::StructuredMesh { dims: dims?, points: points?, texture_coordinates: coordinates? })
}

/// `[(x, y, z), …]`, or `File("…")`.
fn points(reader: &mut Reader, at: &At) -> Option<PointsSpec> {
    let wanted = "points, [(x, y, z), …], or File(\"…\") of little-endian f32";
    if head(at) == "File" {
        return match reader.tuple(at, "File").as_deref() {
            Some([file]) => reader.text(file).map(|file| PointsSpec::File(file.into())),
            _ => reader.refuse(at, "File(\"…\")"),
        };
    }
    let items = reader.list(at, wanted)?;
    let read: Vec<_> = items.iter().map(|at| reader.vec3(at)).collect();
    read.into_iter().collect::<Option<_>>().map(PointsSpec::Inline)
}

/// `Some(None)` where there are none.
fn texture_coordinates(reader: &mut Reader, fields: &Fields, count: usize) -> Option<Option<PointsSpec>> {
    let Some(at) = fields.optional("texture_coordinates") else { return Some(None) };
    let coordinates = points(reader, &at)?;
    same_number(reader, &at, coordinates, count, "one for each vertex").map(Some)
}

/// Points that are written out are counted now; `usize::MAX` stands for any number.
fn same_number(reader: &mut Reader, at: &At, points: PointsSpec, count: usize, each: &str) -> Option<PointsSpec> {
    match &points {
        PointsSpec::Inline(list) if list.len() != count && count != usize::MAX => {
            reader.refuse(at, format!("{count} points, {each}"))
        }
        _ => Some(points),
    }
}

/// Lists of `N` indices below `count`; none where the field is left out.
fn cells<const N: usize>(reader: &mut Reader, fields: &Fields, name: &str, count: usize) -> Option<Vec<[u32; N]>> {
    let Some(at) = fields.optional(name) else { return Some(Vec::new()) };
    let wanted = format!("cells of {N} vertices, [[index, …], …]");
    let read: Vec<_> = reader.list(&at, &wanted)?.iter().map(|at| cell(reader, at, count)).collect();
    read.into_iter().collect()
}

fn cell<const N: usize>(reader: &mut Reader, at: &At, count: usize) -> Option<[u32; N]> {
    let wanted = format!("the indices of {N} vertices, [index, …]");
    let items = reader.list(at, &wanted)?;
    if items.len() != N {
        return reader.refuse(at, wanted);
    }
    let last = u32::try_from(count.saturating_sub(1)).unwrap_or(u32::MAX);
    let mut index = |at: &At| match at.node.kind {
        Kind::Number { whole: Some(v), .. } if (0..=i64::from(last)).contains(&v) && count > 0 => Some(v as u32),
        _ if count == usize::MAX => reader.refuse(at, "the index of a vertex"),
        _ => reader.refuse(at, format!("the index of one of the {count} points, from 0 on")),
    };
    let read: Vec<_> = items.iter().map(&mut index).collect();
    read.into_iter().collect::<Option<Vec<u32>>>()?.try_into().ok()
}
