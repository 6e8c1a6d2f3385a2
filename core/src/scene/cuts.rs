//! Reads what cuts a shape or a scene: slices, clips, and opaque pictures.

use std::path::PathBuf;

use super::{
    OpaqueDepthSpec, OpaqueSpec, Problems,
    parameters::{head, matrix},
    reader::{self, At, Reader},
};
use crate::{Aabb, Clip, ClipRegion, Plane, SliceStyle, Slices, camera::DepthRange};

/// Planes through a shape.
pub(super) fn slices(reader: &mut Reader, at: &At) -> Option<Slices> {
    let fields = reader.fields(at, &["Slices"], &["planes", "style", "volume"])?;
    let list = reader.required(&fields, "planes", "planes, [Plane(point: (x, y, z), normal: (x, y, z)), …]");
    let styles = [("Opaque", SliceStyle::Opaque), ("Blended", SliceStyle::Blended)];
    let style = fields.optional("style").map_or(Some(SliceStyle::Opaque), |at| reader.word(&at, &styles));
    let volume = fields.optional("volume").map_or(Some(false), |at| reader.bool(&at));
    let planes = list.and_then(|at| planes(reader, &at));
    Some(Slices { planes: planes?, style: style?, volume: volume? })
}

/// A list of planes with at least one in it.
fn planes(reader: &mut Reader, at: &At) -> Option<Vec<Plane>> {
    let wanted = "planes, [Plane(point: (x, y, z), normal: (x, y, z)), …]";
    let items = reader.list(at, wanted)?;
    if items.is_empty() {
        return reader.refuse(at, "at least one plane");
    }
    let read: Vec<_> = items.iter().map(|at| plane(reader, at)).collect();
    read.into_iter().collect()
}

fn plane(reader: &mut Reader, at: &At) -> Option<Plane> {
    let fields = reader.fields(at, &["Plane"], &["point", "normal"])?;
    let point = reader.required(&fields, "point", "a point of the plane (x, y, z)");
    let normal = reader.required(&fields, "normal", "the direction to its front (x, y, z)");
    let point = point.and_then(|at| reader.vec3(&at));
    let normal = normal.and_then(|at| {
        let normal = reader.vec3(&at)?;
        if normal.try_normalize().is_some() { Some(normal) } else { reader.refuse(&at, "a direction with a length") }
    });
    match Plane::new(point?, normal?) {
        Ok(plane) => Some(plane),
        Err(error) => {
            reader.fault(at, error, "a plane");
            None
        }
    }
}

/// Reads one region as `clip` has it, e.g. `Cut(Box(min: (0, 0, 0), max: (1, 1, 1)))`.
///
/// # Errors
/// All problems.
pub fn parse_region(text: &str) -> Result<ClipRegion, Problems> {
    reader::one(text, region)
}

/// Reads one plane as `slices` have it, e.g. `Plane(point: (0, 0, 1), normal: (0, 0, 1))`.
///
/// # Errors
/// All problems.
pub fn parse_plane(text: &str) -> Result<Plane, Problems> {
    reader::one(text, plane)
}

/// A list of regions, all of which must keep a point.
pub(super) fn clip(reader: &mut Reader, at: &At) -> Option<Clip> {
    let items = reader.list(at, "a list of Plane(…), Planes([…]), Box(…) or Cut(…)")?;
    let read: Vec<_> = items.iter().map(|at| region(reader, at)).collect();
    read.into_iter().collect::<Option<Vec<_>>>().map(Clip::new)
}

fn region(reader: &mut Reader, at: &At) -> Option<ClipRegion> {
    match head(at) {
        "Plane" => plane(reader, at).map(ClipRegion::plane),
        "Planes" => match reader.tuple(at, "Planes").as_deref() {
            Some([list]) => planes(reader, list).map(ClipRegion::planes),
            _ => reader.refuse(at, "Planes([Plane(…), …])"),
        },
        "Box" => {
            let fields = reader.fields(at, &["Box"], &["min", "max"])?;
            let min = reader.required(&fields, "min", "the lowest corner (x, y, z)");
            let max = reader.required(&fields, "max", "the highest corner (x, y, z)");
            let (min, max) = (min.and_then(|at| reader.vec3(&at)), max.and_then(|at| reader.vec3(&at)));
            let (min, max) = (min?, max?);
            if !min.cmplt(max).all() {
                return reader.refuse(at, "`min` below `max` along each axis");
            }
            Some(ClipRegion::crop(Aabb::new(min, max)))
        }
        "Cut" => match reader.tuple(at, "Cut").as_deref() {
            Some([inner]) => region(reader, inner).map(ClipRegion::cut),
            _ => reader.refuse(at, "Cut(Plane(…)), Cut(Planes([…])) or Cut(Box(…))"),
        },
        other => reader.unknown(at, other, "one of ", &["Plane", "Planes", "Box", "Cut"]),
    }
}

/// What an application has drawn already.
pub(super) fn opaque(reader: &mut Reader, at: &At) -> Option<OpaqueSpec> {
    let fields = reader.fields(at, &["Opaque"], &["color", "depth", "depth_buffer"])?;
    let color = fields.optional("color").map_or(Some(None), |at| file(reader, &at).map(Some));
    let depth = match (fields.optional("depth"), fields.optional("depth_buffer")) {
        (Some(at), None) => file(reader, &at).map(OpaqueDepthSpec::Distance),
        (None, Some(at)) => depth_buffer(reader, &at),
        (Some(_), Some(at)) => reader.refuse(&at, "either `depth` or `depth_buffer`"),
        (None, None) => reader.refuse(at, "`depth`, a file of distances, or a `depth_buffer`"),
    };
    Some(OpaqueSpec { color: color?, depth: depth? })
}

fn file(reader: &mut Reader, at: &At) -> Option<PathBuf> {
    reader.text(at).map(PathBuf::from)
}

fn depth_buffer(reader: &mut Reader, at: &At) -> Option<OpaqueDepthSpec> {
    let fields = reader.fields(at, &["DepthBuffer"], &["file", "range", "world_to_clip"])?;
    let path = reader.required(&fields, "file", "a file of little-endian f32, one a pixel");
    let rows = "four rows of four numbers, ((a, b, c, d), …)";
    let projection = reader.required(&fields, "world_to_clip", rows);
    let ranges = [("ZeroToOne", DepthRange::ZeroToOne), ("MinusOneToOne", DepthRange::MinusOneToOne)];
    let range = fields.optional("range").map_or(Some(DepthRange::default()), |at| reader.word(&at, &ranges));
    let path = path.and_then(|at| file(reader, &at));
    let world_to_clip = projection.and_then(|at| {
        let matrix = matrix(reader, &at, "")?;
        if matrix.inverse().is_finite() { Some(matrix) } else { reader.refuse(&at, "a matrix that can be inverted") }
    });
    Some(OpaqueDepthSpec::Buffer { file: path?, range: range?, world_to_clip: world_to_clip? })
}
