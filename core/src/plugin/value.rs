//! Parameters across the boundary: every type of [`ParameterValue`] as one [`ArrayView`], and back.
//! A new type of parameter is added here, in `KINDS`, `lend_value` and `decode`.

use std::collections::HashMap;

use glam::{DAffine3, DMat4, DVec2, DVec3, DVec4};

use super::{
    abi::{self, ArrayView, Parameter, Parameters},
    arena::{Arena, list_of, str_of},
    array::{Passing, Received, lend, receive, scalar_code, scalar_of, want_kind},
    status::{Code, Fault},
};
use crate::{
    Aabb, Attribute, Buffer, ControlPoint, Filter, LookupTable, ParameterType, ParameterValue, Roi, ScalarType,
    TableInterpolation, Volume, VolumeDesc, VolumeTexture, parameter::ParameterMap, volume::Components,
};

/// The kinds of parameters by type.
pub(super) const KINDS: [(ParameterType, u32); 12] = [
    (ParameterType::Volume, abi::KIND_VOLUME),
    (ParameterType::Table, abi::KIND_TABLE),
    (ParameterType::Float, abi::KIND_FLOAT),
    (ParameterType::Int, abi::KIND_INT),
    (ParameterType::Bool, abi::KIND_BOOL),
    (ParameterType::Vec2, abi::KIND_VEC2),
    (ParameterType::Vec3, abi::KIND_VEC3),
    (ParameterType::Vec4, abi::KIND_VEC4),
    (ParameterType::Color, abi::KIND_COLOR),
    (ParameterType::Matrix, abi::KIND_MATRIX),
    (ParameterType::Choice, abi::KIND_CHOICE),
    (ParameterType::Attribute, abi::KIND_ATTRIBUTE),
];

/// Volumes and tables that came across before, so that the same data stay the same.
#[derive(Debug, Default)]
pub(super) struct Identities {
    now: HashMap<u64, Known>,
    before: HashMap<u64, Known>,
}

#[derive(Clone, Debug)]
enum Known {
    Volume(Volume, u64),
    Table(LookupTable),
}

impl Identities {
    /// Begins a round at whose end everything that was not met in it is forgotten.
    pub fn begin(&mut self) {
        self.before = std::mem::take(&mut self.now);
    }

    /// Ends a round.
    pub fn end(&mut self) {
        self.before.clear();
    }

    fn find(&mut self, id: u64) -> Option<&mut Known> {
        if let Some(known) = self.before.remove(&id) {
            self.now.insert(id, known);
        }
        self.now.get_mut(&id)
    }

    /// The volume of an identity, told where its content has changed since.
    fn volume(&mut self, view: &ArrayView, make: impl FnOnce() -> Result<Volume, Fault>) -> Result<Volume, Fault> {
        if view.id == 0 {
            return make();
        }
        if let Some(Known::Volume(volume, version)) = self.find(view.id) {
            if *version != view.version {
                volume.touch();
                *version = view.version;
            }
            return Ok(volume.clone());
        }
        let made = make()?;
        self.now.insert(view.id, Known::Volume(made.clone(), view.version));
        Ok(made)
    }

    fn table(
        &mut self,
        view: &ArrayView,
        make: impl FnOnce() -> Result<LookupTable, Fault>,
    ) -> Result<LookupTable, Fault> {
        if let Some(Known::Table(table)) = (view.id != 0).then(|| self.find(view.id)).flatten() {
            return Ok(table.clone());
        }
        let made = make()?;
        if view.id != 0 {
            self.now.insert(view.id, Known::Table(made.clone()));
        }
        Ok(made)
    }
}

fn small<T: bytemuck::Pod + Send + Sync>(kind: u32, scalar: u32, values: Vec<T>, arena: &mut Arena) -> ArrayView {
    let shape = [values.len() as u64];
    let shape = if values.len() == 1 { &shape[..0] } else { &shape[..] };
    lend(kind, scalar, shape, &Buffer::from_vec(values), arena)
}

fn floats(kind: u32, values: &[f64], arena: &mut Arena) -> ArrayView {
    small(kind, abi::SCALAR_F64, values.to_vec(), arena)
}

fn word(text: &str, arena: &mut Arena) -> ArrayView {
    let bytes = Buffer::from_vec(text.as_bytes().to_vec());
    lend(abi::KIND_CHOICE, abi::SCALAR_U8, &[text.len() as u64], &bytes, arena)
}

fn boolean(value: bool, arena: &mut Arena) -> ArrayView {
    small(abi::KIND_BOOL, abi::SCALAR_U8, vec![u8::from(value)], arena)
}

/// A value as a view that is valid as long as the arena.
pub(super) fn lend_value(value: &ParameterValue, arena: &mut Arena) -> ArrayView {
    match value {
        ParameterValue::Volume(texture) => lend_volume(texture, arena),
        ParameterValue::Table(table) => lend_table(table, arena),
        ParameterValue::Attribute(attribute) => lend_attribute(attribute, arena),
        ParameterValue::Float(v) => floats(abi::KIND_FLOAT, &[*v], arena),
        ParameterValue::Int(v) => small(abi::KIND_INT, abi::SCALAR_I64, vec![*v], arena),
        ParameterValue::Bool(v) => boolean(*v, arena),
        ParameterValue::Vec2(v) => floats(abi::KIND_VEC2, &v.to_array(), arena),
        ParameterValue::Vec3(v) => floats(abi::KIND_VEC3, &v.to_array(), arena),
        ParameterValue::Vec4(v) => floats(abi::KIND_VEC4, &v.to_array(), arena),
        ParameterValue::Color(v) => floats(abi::KIND_COLOR, v, arena),
        ParameterValue::Matrix(v) => floats(abi::KIND_MATRIX, &v.to_cols_array(), arena),
        ParameterValue::Choice(v) => word(v, arena),
    }
}

/// Named values as views.
pub(super) fn lend_map<'a>(
    values: impl IntoIterator<Item = (&'a String, &'a ParameterValue)>,
    arena: &mut Arena,
) -> Parameters {
    let mut all = Vec::new();
    for (name, value) in values {
        let name = arena.text(name);
        all.push(Parameter { name, value: lend_value(value, arena) });
    }
    arena.parameters(all)
}

fn with_fields(mut view: ArrayView, fields: Vec<(&str, ArrayView)>, arena: &mut Arena) -> ArrayView {
    let fields = fields.into_iter().map(|(name, value)| Parameter { name: arena.text(name), value }).collect();
    let fields = arena.parameters(fields);
    (view.fields, view.field_count) = (fields.data, fields.count);
    view
}

fn lend_volume(texture: &VolumeTexture, arena: &mut Arena) -> ArrayView {
    let volume = texture.volume();
    let desc = volume.desc();
    let [x, y, z] = desc.dims.map(|n| n as u64);
    let shape = [desc.components as u64, x, y, z];
    let mut view = lend(abi::KIND_VOLUME, scalar_code(desc.scalar), &shape, volume.data(), arena);
    (view.id, view.version) = (volume.id(), volume.version());
    let array = abi::KIND_ARRAY;
    let roi = texture.data_roi();
    let region = roi.min.iter().chain(&roi.max).map(|&n| n as i64).collect();
    let place = texture.geometry_roi();
    let corners = [place.min.to_array(), place.max.to_array()].concat();
    let mut fields = vec![
        ("name", word(&desc.name, arena)),
        ("spacing", floats(array, &desc.spacing.to_array(), arena)),
        ("placement", floats(array, &desc.placement.to_cols_array(), arena)),
        ("slope", floats(abi::KIND_FLOAT, &[desc.slope], arena)),
        ("intercept", floats(abi::KIND_FLOAT, &[desc.intercept], arena)),
        ("unit", word(&desc.unit, arena)),
        ("data_roi", small(array, abi::SCALAR_I64, region, arena)),
        ("geometry_roi", floats(array, &corners, arena)),
        ("filter", word(if texture.filter() == Filter::Nearest { "nearest" } else { "linear" }, arena)),
        ("luminance", boolean(texture.meaning() == Components::Luminance, arena)),
    ];
    if let Some(range) = texture.known_range() {
        fields.push(("range", floats(array, &range, arena)));
    }
    with_fields(view, fields, arena)
}

fn lend_table(table: &LookupTable, arena: &mut Arena) -> ArrayView {
    let before = boolean(table.interpolation() == TableInterpolation::Pre, arena);
    let mut fields = vec![("before", before)];
    let mut view = match table.uniform() {
        Some((data, domain)) => {
            if let Some(domain) = domain {
                fields.push(("domain", floats(abi::KIND_ARRAY, &domain, arena)));
            }
            lend(abi::KIND_TABLE, abi::SCALAR_F32, &[4, table.len() as u64], data, arena)
        }
        None => {
            let points = table.points([0.0, 1.0]);
            let row = |p: &ControlPoint| [p.value, p.color[0], p.color[1], p.color[2], p.opacity];
            let rows = Buffer::from_vec(points.iter().map(row).collect::<Vec<[f64; 5]>>());
            lend(abi::KIND_TABLE, abi::SCALAR_F64, &[5, points.len() as u64], &rows, arena)
        }
    };
    view.id = table.id();
    with_fields(view, fields, arena)
}

/// Numbers of vertices as a view.
pub(super) fn lend_attribute(attribute: &Attribute, arena: &mut Arena) -> ArrayView {
    let shape = [attribute.components as u64, attribute.len() as u64];
    let view = lend(abi::KIND_ATTRIBUTE, scalar_code(attribute.scalar), &shape, &attribute.data, arena);
    let name = word(&attribute.name, arena);
    with_fields(view, vec![("name", name)], arena)
}

/// Named values of the other side.
///
/// # Safety
/// What the views say is true.
pub(super) unsafe fn decode_map(parameters: Parameters, known: &mut Identities) -> Result<ParameterMap, Fault> {
    let mut map = ParameterMap::new();
    // SAFETY: as promised by the caller.
    for parameter in unsafe { list_of(parameters.data, parameters.count, "parameters") }? {
        // SAFETY: as promised by the caller.
        let (name, value) = unsafe { decode_named(parameter, known) }?;
        map.insert(name, value);
    }
    Ok(map)
}

/// A named value of the other side.
///
/// # Safety
/// What the view says is true.
pub(super) unsafe fn decode_named(
    parameter: &Parameter,
    known: &mut Identities,
) -> Result<(String, ParameterValue), Fault> {
    // SAFETY: as promised by the caller.
    let name = unsafe { str_of(parameter.name, "name of a parameter") }?;
    // SAFETY: as promised by the caller.
    let value = unsafe { decode(&parameter.value, known, name, Passing::Lent) }?;
    Ok((name.to_owned(), value))
}

/// A value of the other side.
///
/// # Safety
/// What the view says is true.
pub(super) unsafe fn decode(
    view: &ArrayView,
    known: &mut Identities,
    name: &str,
    passing: Passing,
) -> Result<ParameterValue, Fault> {
    let what = format!("parameter {name:?}");
    // SAFETY: as promised by the caller.
    let got = unsafe { receive(view, &what, passing) }?;
    // SAFETY: as promised by the caller.
    let fields = unsafe { Fields::of(view, &what) }?;
    Ok(match view.kind {
        abi::KIND_VOLUME => ParameterValue::Volume(volume(view, got, &fields, known, &what)?),
        abi::KIND_TABLE => ParameterValue::Table(known.table(view, || table(&got, &fields, &what))?),
        abi::KIND_ATTRIBUTE => ParameterValue::Attribute(attribute(got, &fields, &what)?),
        abi::KIND_FLOAT => ParameterValue::Float(numbers::<1>(&got, &what)?[0]),
        abi::KIND_INT => ParameterValue::Int(integers::<1>(&got, &what)?[0]),
        abi::KIND_BOOL => ParameterValue::Bool(truth(&got, &what)?),
        abi::KIND_VEC2 => ParameterValue::Vec2(DVec2::from_array(numbers(&got, &what)?)),
        abi::KIND_VEC3 => ParameterValue::Vec3(DVec3::from_array(numbers(&got, &what)?)),
        abi::KIND_VEC4 => ParameterValue::Vec4(DVec4::from_array(numbers(&got, &what)?)),
        abi::KIND_COLOR => ParameterValue::Color(numbers(&got, &what)?),
        abi::KIND_MATRIX => ParameterValue::Matrix(DMat4::from_cols_array(&numbers(&got, &what)?)),
        abi::KIND_CHOICE => ParameterValue::Choice(text(&got, &what)?),
        other => return Err(Fault::new(Code::Unsupported, format!("kind of {what} is {other}, which nobody knows"))),
    })
}

/// The fields of a view.
struct Fields<'a>(&'a [Parameter], &'a str);

impl<'a> Fields<'a> {
    /// # Safety
    /// What the view says is true.
    unsafe fn of(view: &'a ArrayView, what: &'a str) -> Result<Self, Fault> {
        // SAFETY: as promised by the caller.
        Ok(Self(unsafe { list_of(view.fields, view.field_count, "fields") }?, what))
    }

    fn get(&self, name: &str) -> Result<Option<Received>, Fault> {
        for field in self.0 {
            // SAFETY: `of` was promised that the view, and so its fields, are what they say.
            if unsafe { str_of(field.name, "name of a field") }? == name {
                let what = format!("{name} of {}", self.1);
                // SAFETY: as above.
                return unsafe { receive(&field.value, &what, Passing::Lent) }.map(Some);
            }
        }
        Ok(None)
    }

    fn numbers<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>, Fault> {
        self.get(name)?.map(|got| numbers(&got, &format!("{name} of {}", self.1))).transpose()
    }

    fn text(&self, name: &str) -> Result<Option<String>, Fault> {
        self.get(name)?.map(|got| text(&got, &format!("{name} of {}", self.1))).transpose()
    }

    fn truth(&self, name: &str) -> Result<bool, Fault> {
        self.get(name)?.map_or(Ok(false), |got| truth(&got, &format!("{name} of {}", self.1)))
    }
}

fn numbers<const N: usize>(got: &Received, what: &str) -> Result<[f64; N], Fault> {
    if got.scalar == abi::SCALAR_I64 {
        return Ok(integers::<N>(got, what)?.map(|n| n as f64));
    }
    let scalar = scalar_of(got.scalar, what)?;
    if got.buffer.len() != N * scalar.size() {
        return Err(Fault::bad(
            format!("length of {what}"),
            format!("{} bytes", got.buffer.len()),
            format!("{N} numbers"),
        ));
    }
    Ok(std::array::from_fn(|i| scalar.read(got.buffer.bytes(), i)))
}

fn integers<const N: usize>(got: &Received, what: &str) -> Result<[i64; N], Fault> {
    let wrong = || {
        let found = format!("{} bytes of scalar type {}", got.buffer.len(), got.scalar);
        Fault::bad(what, found, format!("{N} numbers of type i64 or i32"))
    };
    match got.scalar {
        abi::SCALAR_I64 => got.buffer.as_slice::<i64>().and_then(|v| v.try_into().ok()).ok_or_else(wrong),
        abi::SCALAR_I32 => {
            let values: [i32; N] = got.buffer.as_slice::<i32>().and_then(|v| v.try_into().ok()).ok_or_else(wrong)?;
            Ok(values.map(i64::from))
        }
        _ => Err(wrong()),
    }
}

fn truth(got: &Received, what: &str) -> Result<bool, Fault> {
    match got.buffer.bytes() {
        [0] => Ok(false),
        [1] => Ok(true),
        other => Err(Fault::bad(what, format!("{:?}", &other[..other.len().min(8)]), "one byte that is 0 or 1")),
    }
}

fn text(got: &Received, what: &str) -> Result<String, Fault> {
    let bytes = got.buffer.bytes();
    let text = std::str::from_utf8(bytes).map(str::to_owned);
    text.map_err(|_| Fault::bad(what, format!("\"{}\"", bytes[..bytes.len().min(64)].escape_ascii()), "UTF-8"))
}

fn volume(
    view: &ArrayView,
    got: Received,
    fields: &Fields<'_>,
    known: &mut Identities,
    what: &str,
) -> Result<VolumeTexture, Fault> {
    let wrong = |error: crate::volume::VolumeError| Fault::new(Code::BadValue, error.to_string());
    let [components, dims @ ..] = extents::<4>(&got.shape, what)?;
    let scalar = scalar_of(got.scalar, what)?;
    let mut desc = VolumeDesc::new(dims, scalar, components);
    desc.name = fields.text("name")?.unwrap_or(desc.name);
    desc.unit = fields.text("unit")?.unwrap_or_default();
    desc.spacing = fields.numbers("spacing")?.map_or(desc.spacing, DVec3::from_array);
    desc.placement = fields.numbers("placement")?.map_or(desc.placement, |m| DAffine3::from_cols_array(&m));
    desc.slope = fields.numbers::<1>("slope")?.map_or(1.0, |[v]| v);
    desc.intercept = fields.numbers::<1>("intercept")?.map_or(0.0, |[v]| v);
    let volume = known.volume(view, || Volume::new(desc, got.buffer).map_err(wrong))?;
    let mut texture = VolumeTexture::new(&volume);
    if let Some(region) = fields.get("data_roi")? {
        let found = integers::<6>(&region, what)?;
        let n = |i: usize| usize::try_from(found[i]).unwrap_or(usize::MAX);
        texture = texture.with_data_roi(Roi { min: [n(0), n(1), n(2)], max: [n(3), n(4), n(5)] }).map_err(wrong)?;
    }
    if let Some([a, b, c, d, e, f]) = fields.numbers("geometry_roi")? {
        let roi = Aabb::new(DVec3::new(a, b, c), DVec3::new(d, e, f));
        texture = texture.with_geometry_roi(roi).map_err(wrong)?;
    }
    if let Some(range) = fields.numbers("range")? {
        texture = texture.with_range(range).map_err(wrong)?;
    }
    match fields.text("filter")?.as_deref() {
        None | Some("linear") => {}
        Some("nearest") => texture = texture.with_filter(Filter::Nearest),
        Some(other) => return Err(Fault::bad(format!("filter of {what}"), format!("{other:?}"), "linear or nearest")),
    }
    Ok(if fields.truth("luminance")? { texture.as_luminance() } else { texture })
}

/// A shape of exactly so many axes, as sizes.
pub(super) fn extents<const N: usize>(shape: &[u64], what: &str) -> Result<[usize; N], Fault> {
    let wrong = || Fault::bad(format!("shape of {what}"), format!("{shape:?}"), format!("{N} axes"));
    let shape: [u64; N] = shape.try_into().map_err(|_| wrong())?;
    Ok(shape.map(|n| usize::try_from(n).unwrap_or(usize::MAX)))
}

fn table(got: &Received, fields: &Fields<'_>, what: &str) -> Result<LookupTable, Fault> {
    let wrong = |error: crate::table::TableError| Fault::new(Code::BadValue, format!("{what}: {error}"));
    let [width, _] = extents::<2>(&got.shape, what)?;
    let made = match (width, got.scalar) {
        (5, abi::SCALAR_F64) => {
            let rows: &[[f64; 5]] = got.buffer.as_slice().unwrap_or_default();
            let point = |&[value, r, g, b, opacity]: &[f64; 5]| ControlPoint { value, color: [r, g, b], opacity };
            LookupTable::from_points(rows.iter().map(point).collect::<Vec<_>>()).map_err(wrong)?
        }
        (4, abi::SCALAR_F32) => {
            LookupTable::from_entries(got.buffer.clone(), fields.numbers("domain")?).map_err(wrong)?
        }
        _ => {
            let found = format!("{width} numbers of scalar type {} an entry", got.scalar);
            return Err(Fault::bad(what, found, "five f64, or four f32"));
        }
    };
    Ok(if fields.truth("before")? { made.pre_interpolated() } else { made })
}

fn attribute(got: Received, fields: &Fields<'_>, what: &str) -> Result<Attribute, Fault> {
    let [components, _] = extents::<2>(&got.shape, what)?;
    let scalar: ScalarType = scalar_of(got.scalar, what)?;
    let name = fields.text("name")?.unwrap_or_else(|| what.to_owned());
    Attribute::new(name, scalar, components, got.buffer).map_err(|e| Fault::new(Code::BadValue, e.to_string()))
}

/// An attribute of the other side.
///
/// # Safety
/// What the view says is true.
pub(super) unsafe fn decode_attribute(parameter: &Parameter, passing: Passing) -> Result<Attribute, Fault> {
    let what = "an attribute";
    // SAFETY: as promised by the caller.
    let got = unsafe { receive(&parameter.value, what, passing) }?;
    // SAFETY: as promised by the caller.
    let name = unsafe { str_of(parameter.name, "name of an attribute") }?;
    // SAFETY: as promised by the caller.
    let fields = unsafe { Fields::of(&parameter.value, what) }?;
    want_kind(&parameter.value, abi::KIND_ATTRIBUTE, what)?;
    let mut made = attribute(got, &fields, what)?;
    made.name = name.to_owned();
    Ok(made)
}
