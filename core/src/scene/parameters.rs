//! Reads the values of parameters: numbers, vectors, words, volumes, tables, attributes.

use std::{collections::BTreeMap, path::PathBuf};

use glam::{DMat4, DVec2, DVec3, DVec4};

use super::{
    AttributeSpec, AttributeValues, DataAttributeSpec, ParameterSpec, TableEntries, TableSpec, VolumeSpec,
    document::Kind,
    reader::{At, Fields, Reader},
};
use crate::{Aabb, ControlPoint, Filter, ParameterValue, Roi, ScalarType};

/// A map of parameters by name. What cannot be read is left out, after a problem.
pub(crate) fn parameters(reader: &mut Reader, at: &At) -> BTreeMap<String, ParameterSpec> {
    let entries = reader.map(at, "a map of parameters by name, {\"name\": value}");
    let read = |(name, at): (&str, At)| Some((name.to_owned(), parameter(reader, &at)?));
    entries.into_iter().filter_map(read).collect()
}

/// As [`parameters`], for options that can be no volume, table or attribute.
pub(crate) fn plain_parameters(reader: &mut Reader, at: &At) -> BTreeMap<String, ParameterSpec> {
    let entries = reader.map(at, "a map of options by name, {\"name\": value}");
    let read = |(name, at): (&str, At)| Some((name.to_owned(), ParameterSpec::Value(value(reader, &at)?)));
    entries.into_iter().filter_map(read).collect()
}

/// One value of any kind.
pub(super) fn parameter(reader: &mut Reader, at: &At) -> Option<ParameterSpec> {
    match head(at) {
        "Volume" => volume(reader, at).map(ParameterSpec::Volume),
        "Table" | "Entries" | "WindowLevel" => table(reader, at).map(ParameterSpec::Table),
        "Attribute" => attribute(reader, at),
        _ => value(reader, at).map(ParameterSpec::Value),
    }
}

/// The name before the parenthesis.
pub(super) fn head<'a>(at: &At<'a>) -> &'a str {
    match &at.node.kind {
        Kind::Struct { name, .. } | Kind::Tuple { name, .. } => name,
        _ => "",
    }
}

const VALUES: [&str; 7] = ["Volume", "Table", "Entries", "WindowLevel", "Attribute", "Color", "Matrix"];

/// One value that needs no file.
pub(crate) fn value(reader: &mut Reader, at: &At) -> Option<ParameterValue> {
    Some(match &at.node.kind {
        Kind::Bool(v) => ParameterValue::Bool(*v),
        Kind::Text(word) => ParameterValue::Choice(word.clone()),
        Kind::Number { whole: Some(v), .. } => ParameterValue::Int(*v),
        Kind::Number { .. } => ParameterValue::Float(reader.float(at)?),
        Kind::Tuple { name, .. } if name == "Color" => ParameterValue::Color(color(reader, at)?),
        Kind::Tuple { name, .. } if name == "Matrix" => ParameterValue::Matrix(matrix(reader, at, "Matrix")?),
        Kind::Tuple { name, items } if name.is_empty() => match items.len() {
            2 => ParameterValue::Vec2(DVec2::from_array(reader.array(at, "", Reader::float)?)),
            3 => ParameterValue::Vec3(DVec3::from_array(reader.array(at, "", Reader::float)?)),
            4 => ParameterValue::Vec4(DVec4::from_array(reader.array(at, "", Reader::float)?)),
            _ => return reader.refuse(at, "2, 3 or 4 numbers"),
        },
        Kind::Struct { name, .. } | Kind::Tuple { name, .. } if !name.is_empty() => {
            return reader.unknown(at, name, "a value: a number, (x, y, …), \"word\", true, false or one of ", &VALUES);
        }
        _ => return reader.refuse(at, "a value: a number, (x, y, …), \"word\", true or false"),
    })
}

/// `Color(r, g, b)` or `Color(r, g, b, a)`: straight, opaque unless told.
fn color(reader: &mut Reader, at: &At) -> Option<[f64; 4]> {
    let Some(items) = reader.tuple(at, "Color").filter(|i| matches!(i.len(), 3 | 4)) else {
        return reader.refuse(at, "Color(red, green, blue) or Color(red, green, blue, opacity)");
    };
    let mut color = [0.0, 0.0, 0.0, 1.0];
    let mut good = true;
    for (i, at) in items.iter().enumerate() {
        let read = if i == 3 { unit(reader, at) } else { light(reader, at) };
        good &= read.is_some();
        color[i] = read.unwrap_or_default();
    }
    good.then_some(color)
}

pub(super) fn unit(reader: &mut Reader, at: &At) -> Option<f64> {
    reader.float_where(at, |v| (0.0..=1.0).contains(&v), "0 to 1")
}

pub(super) fn light(reader: &mut Reader, at: &At) -> Option<f64> {
    reader.float_where(at, |v| v >= 0.0, "a finite number of at least 0")
}

/// Four rows of four numbers, as matrices are written on paper.
pub(super) fn matrix(reader: &mut Reader, at: &At, name: &str) -> Option<DMat4> {
    let wanted = format!("{name}((a, b, c, d), …): four rows of four numbers");
    let Some(rows) = reader.tuple(at, name).filter(|rows| rows.len() == 4) else {
        return reader.refuse(at, wanted);
    };
    let read: Vec<_> = rows.iter().map(|row| reader.array::<f64, 4>(row, "four numbers", Reader::float)).collect();
    let rows: Vec<DVec4> = read.into_iter().map(|r| r.map(DVec4::from_array)).collect::<Option<_>>()?;
    Some(DMat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose())
}

fn volume(reader: &mut Reader, at: &At) -> Option<VolumeSpec> {
    let known = ["data", "data_roi", "geometry_roi", "range", "filter", "luminance"];
    let fields = reader.fields(at, &["Volume"], &known)?;
    let data = reader.required(&fields, "data", "the name of an entry under `data`");
    let filters = [("Linear", Filter::Linear), ("Nearest", Filter::Nearest)];
    Some(VolumeSpec {
        data: data.and_then(|at| reader.name(&at)).unwrap_or_default(),
        data_roi: fields.optional("data_roi").and_then(|at| data_roi(reader, &at)),
        geometry_roi: fields.optional("geometry_roi").and_then(|at| geometry_roi(reader, &at)),
        range: fields.optional("range").and_then(|at| range(reader, &at)),
        filter: fields.optional("filter").and_then(|at| reader.word(&at, &filters)).unwrap_or_default(),
        luminance: fields.optional("luminance").and_then(|at| reader.bool(&at)).unwrap_or_default(),
    })
}

fn data_roi(reader: &mut Reader, at: &At) -> Option<Roi> {
    let wanted = "first and last sample, ((x, y, z), (x, y, z)), whole numbers";
    let index = |r: &mut Reader, at: &At| r.array::<usize, 3>(at, "three whole numbers", |r, at| r.count(at, 0));
    let [min, max] = reader.array(at, wanted, index)?;
    if (0..3).any(|a| min[a] > max[a]) {
        return reader.refuse(at, "a first sample not beyond the last along any axis");
    }
    Some(Roi { min, max })
}

fn geometry_roi(reader: &mut Reader, at: &At) -> Option<Aabb> {
    let [min, max] = reader.array(at, "two corners, ((x, y, z), (x, y, z))", Reader::vec3)?;
    if !min.cmplt(max).all() {
        return reader.refuse(at, "the first corner below the second along each axis");
    }
    Some(Aabb { min, max })
}

fn range(reader: &mut Reader, at: &At) -> Option<[f64; 2]> {
    let range = reader.array(at, "two numbers (low, high)", Reader::float)?;
    if range[0] == range[1] {
        reader.fault(at, format!("{range:?}"), "two numbers that differ");
        return None;
    }
    Some(range)
}

fn domain(reader: &mut Reader, at: &At) -> Option<[f64; 2]> {
    let domain = reader.array(at, "two numbers (low, high)", Reader::float)?;
    if domain[0] >= domain[1] {
        reader.fault(at, format!("{domain:?}"), "two numbers that rise");
        return None;
    }
    Some(domain)
}

fn table(reader: &mut Reader, at: &At) -> Option<TableSpec> {
    let (fields, entries);
    match head(at) {
        "Table" => {
            fields = reader.fields(at, &["Table"], &["points", "pre_interpolated"])?;
            let wanted = "control points, [(value, (red, green, blue), opacity), …]";
            let list = reader.required(&fields, "points", wanted);
            entries = list.and_then(|at| points(reader, &at, wanted)).map(TableEntries::Points);
        }
        "Entries" => {
            fields = reader.fields(at, &["Entries"], &["values", "file", "domain", "pre_interpolated"])?;
            let domain = fields.optional("domain").and_then(|at| domain(reader, &at));
            entries = match fields.optional("file") {
                Some(file) => {
                    let file = reader.text(&file).map(PathBuf::from);
                    file.map(|file| TableEntries::File { file, domain })
                }
                None => {
                    let wanted = "entries, [(red, green, blue, opacity), …], or a `file` of them";
                    let list = reader.required(&fields, "values", wanted);
                    let values = list.and_then(|at| rgba_entries(reader, &at, wanted));
                    values.map(|values| TableEntries::Entries { values, domain })
                }
            };
        }
        _ => {
            fields = reader.fields(at, &["WindowLevel"], &["window", "level", "opacity", "pre_interpolated"])?;
            let window = reader.required(&fields, "window", "the ramp's width in data units");
            let level = reader.required(&fields, "level", "the ramp's middle in data units");
            let opacity = reader.required(&fields, "opacity", "the opacity at the ramp's upper end");
            let window = window.and_then(|at| reader.float_where(&at, |v| v > 0.0, "a positive, finite number"));
            let level = level.and_then(|at| reader.float(&at));
            let opacity = opacity.and_then(|at| unit(reader, &at));
            entries = window.zip(level).zip(opacity).map(|((window, level), opacity)| TableEntries::WindowLevel {
                window,
                level,
                opacity,
            });
        }
    }
    let pre = fields.optional("pre_interpolated").and_then(|at| reader.bool(&at)).unwrap_or_default();
    Some(TableSpec { entries: entries?, pre_interpolated: pre })
}

fn points(reader: &mut Reader, at: &At, wanted: &str) -> Option<Vec<ControlPoint>> {
    let items = reader.list(at, wanted)?;
    if items.is_empty() {
        return reader.refuse(at, "at least one control point");
    }
    let read: Vec<_> = items.iter().map(|at| point(reader, at)).collect();
    read.into_iter().collect()
}

/// `(value, (red, green, blue), opacity)`, or the same with names.
fn point(reader: &mut Reader, at: &At) -> Option<ControlPoint> {
    let named = matches!(at.node.kind, Kind::Struct { .. });
    let parts: [Option<At>; 3] = if named {
        let fields = reader.fields(at, &[], &["value", "color", "opacity"])?;
        let mut field = |name, wanted| reader.required(&fields, name, wanted);
        [field("value", "a number in data units"), field("color", "(red, green, blue)"), field("opacity", "0 to 1")]
    } else {
        let Some(items) = reader.tuple(at, "").filter(|items| items.len() == 3) else {
            return reader.refuse(at, "a control point, (value, (red, green, blue), opacity)");
        };
        let names = ["value", "color", "opacity"];
        std::array::from_fn(|i| Some(At { node: items[i].node, path: super::reader::join(&at.path, names[i]) }))
    };
    let [value, color, opacity] = parts;
    let value = value.and_then(|at| reader.float(&at));
    let color = color.and_then(|at| reader.array(&at, "(red, green, blue)", light));
    let opacity = opacity.and_then(|at| unit(reader, &at));
    Some(ControlPoint { value: value?, color: color?, opacity: opacity? })
}

fn rgba_entries(reader: &mut Reader, at: &At, wanted: &str) -> Option<Vec<[f32; 4]>> {
    let items = reader.list(at, wanted)?;
    if items.is_empty() {
        return reader.refuse(at, "at least one entry");
    }
    let read: Vec<_> = items.iter().map(|at| rgba(reader, at, "(red, green, blue, opacity)")).collect();
    read.into_iter().collect()
}

/// A straight colour with its opacity.
pub(super) fn rgba(reader: &mut Reader, at: &At, wanted: &str) -> Option<[f32; 4]> {
    let last = format!("{}[3]", at.path);
    let channel = |r: &mut Reader, at: &At| if at.path == last { unit(r, at) } else { light(r, at) };
    reader.array(at, wanted, channel).map(|c| c.map(|v| v as f32))
}

/// Numbers of a mesh's file, where `data` names one, else the scene's own.
fn attribute(reader: &mut Reader, at: &At) -> Option<ParameterSpec> {
    let known = ["data", "name", "component", "components", "scalar", "values", "file"];
    let fields = reader.fields(at, &["Attribute"], &known)?;
    let name = reader.required(&fields, "name", "the attribute's name").and_then(|at| reader.name(&at));
    let own = ["components", "scalar", "values", "file"];
    if let Some(data) = fields.optional("data") {
        let data = reader.name(&data);
        let component = fields.optional("component").map_or(Some(None), |at| reader.count(&at, 0).map(Some));
        if let Some(at) = own.iter().find_map(|name| fields.optional(name)) {
            return reader.refuse(&at, "nothing: `data` gives the numbers");
        }
        return Some(ParameterSpec::DataAttribute(DataAttributeSpec {
            data: data?,
            name: name?,
            component: component?,
        }));
    }
    if let Some(at) = fields.optional("component") {
        return reader.refuse(&at, "nothing: `component` picks from the numbers of `data`");
    }
    own_attribute(reader, &fields, name).map(ParameterSpec::Attribute)
}

fn own_attribute(reader: &mut Reader, fields: &Fields, name: Option<String>) -> Option<AttributeSpec> {
    let scalars = ScalarType::ALL.map(|t| (t.name(), t));
    let components = fields.optional("components").map_or(Some(1), |at| reader.count(&at, 1));
    let scalar = fields.optional("scalar").map_or(Some(ScalarType::F32), |at| reader.word(&at, &scalars));
    let values = match fields.optional("file") {
        Some(file) => reader.text(&file).map(|file| AttributeValues::File(file.into())),
        None => {
            let wanted = "numbers, vertex by vertex, or a `file` of them, or the name of `data` that has them";
            let list = reader.required(fields, "values", wanted);
            let items = list.and_then(|at| reader.list(&at, wanted));
            let read: Option<Vec<_>> = items.map(|items| items.iter().map(|at| reader.float(at)).collect());
            read.and_then(|read| read.into_iter().collect()).map(AttributeValues::Inline)
        }
    };
    Some(AttributeSpec { name: name?, components: components?, scalar: scalar?, values: values? })
}
