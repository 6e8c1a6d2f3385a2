//! What programs ask for: volumes at places in local space, and tables.

use volact_core::{ParameterValue, glam::DAffine3, resolve::ResolvedShape, volume::Components};
use volact_shaders::{Environment, eval::Function, signatures::Derived};

use super::{
    Shader,
    field::{Field, Places},
    lookup::{Lookup, Segments},
    table_of,
};
use crate::fast::{dispatch, simd::Unit};

/// Everything that a shape's program may ask for.
#[derive(Debug)]
pub struct Surroundings<'a> {
    unit: Unit,
    answers: Vec<Answer<'a>>,
}

#[derive(Debug)]
enum Answer<'a> {
    Value(Field<'a>),
    Normalized(Field<'a>, [f32; 2]),
    Components(Vec<Field<'a>>),
    Color(Vec<Field<'a>>, Components, [f32; 2]),
    Gradient(Field<'a>),
    Inside(Field<'a>),
    Coordinates(Field<'a>),
    Medium(&'a Lookup),
    Color4(&'a Lookup),
    Entry(&'a Lookup),
    /// The table in f64, and its unit distance.
    Segment(Segments),
    /// A volume that was left out.
    Nothing,
}

impl<'a> Surroundings<'a> {
    /// What a shape's program asks for.
    pub fn new(shape: &'a ResolvedShape, shader: &'a Shader, functions: &[Function], unit: Unit) -> Self {
        let local = shape.to_object * DAffine3::from_translation(shader.origin);
        let answers = functions.iter().map(|f| answer(shape, shader, *f, &local, unit)).collect();
        Self { unit, answers }
    }

    /// The same as asked by one batch, whose samples have these maps to texture coordinates.
    pub fn asked<'s>(&'s self, maps: &'s [DAffine3]) -> Asked<'s, 'a> {
        Asked { of: self, maps }
    }
}

/// What one batch asks.
#[derive(Debug)]
pub struct Asked<'s, 'a> {
    of: &'s Surroundings<'a>,
    maps: &'s [DAffine3],
}

fn answer<'a>(
    shape: &'a ResolvedShape,
    shader: &'a Shader,
    function: Function,
    local: &DAffine3,
    unit: Unit,
) -> Answer<'a> {
    let parameter = shape.shader.declaration.parameters.get(function.parameter);
    match parameter.and_then(|p| shape.parameters.get(&p.name)) {
        Some(ParameterValue::Volume(texture)) => {
            let component = shape.int("component").unwrap_or(0).clamp(0, 3) as usize;
            let field = |c| Field::new(texture, c, local, unit);
            let all = || (0..texture.volume().desc().components.min(4)).map(field).collect();
            let range = texture.range().map(|v| v as f32);
            match function.derived {
                Derived::Value => Answer::Value(field(component)),
                Derived::Normalized => Answer::Normalized(field(component), range),
                Derived::Components => Answer::Components(all()),
                Derived::Color => Answer::Color(all(), texture.meaning(), range),
                Derived::Gradient => Answer::Gradient(field(component)),
                Derived::Inside => Answer::Inside(field(0)),
                Derived::Coordinates => Answer::Coordinates(field(0)),
                Derived::Nearest => Answer::Value(field(component).nearest()),
                _ => Answer::Nothing,
            }
        }
        _ => parameter.and_then(|p| classified(shape, shader, &p.name, function.derived)).unwrap_or(Answer::Nothing),
    }
}

/// The values of a parameter's volume; `None` where it was left out.
pub fn value<'a>(shape: &'a ResolvedShape, shader: &'a Shader, parameter: usize, unit: Unit) -> Option<Field<'a>> {
    let local = shape.to_object * DAffine3::from_translation(shader.origin);
    match answer(shape, shader, Function { parameter, derived: Derived::Value }, &local, unit) {
        Answer::Value(field) => Some(field),
        _ => None,
    }
}

/// What a table says; `None` for what is no table's function.
fn classified<'a>(shape: &ResolvedShape, shader: &'a Shader, name: &str, derived: Derived) -> Option<Answer<'a>> {
    match derived {
        Derived::Medium => shader.lookup(name).map(Answer::Medium),
        Derived::TableColor => shader.lookup(name).map(Answer::Color4),
        Derived::Entry => shader.lookup(name).map(Answer::Entry),
        Derived::Segment => {
            let (table, range) = table_of(shape, name);
            let unit = shape.float("unit_distance").unwrap_or(1.0);
            Some(Answer::Segment(Segments { table: table.resolve(range), unit }))
        }
        _ => None,
    }
}

impl Environment<f32> for Asked<'_, '_> {
    fn call(&mut self, function: usize, p: &[&[f32]], out: &mut [&mut [f32]], live: Option<&[u32]>) {
        let n = out.iter().map(|row| row.len()).max().unwrap_or(0);
        let (unit, rows) = (self.of.unit, p);
        let p = Places { p, maps: self.maps };
        match &self.of.answers[function] {
            Answer::Value(field) => field.values(p, out[0]),
            Answer::Normalized(field, [low, high]) => {
                field.values(p, out[0]);
                let scale = 1.0 / (high - low);
                out[0].iter_mut().for_each(|v| *v = (*v - low) * scale);
            }
            Answer::Components(fields) => {
                for (c, row) in out.iter_mut().enumerate() {
                    match fields.get(c) {
                        Some(field) => field.values(p, row),
                        None => row.fill(0.0),
                    }
                }
            }
            Answer::Color(fields, meaning, range) => colors(fields, (*meaning, *range), p, out),
            Answer::Gradient(field) => field.gradients(p, out),
            Answer::Inside(field) => field.each(p, n, |i, at| {
                let [low, high] = field.roi();
                let inside = at.cmpge(low).all() && at.cmple(high).all();
                out[0][i] = f32::from(u8::from(inside));
            }),
            Answer::Coordinates(field) => field.each(p, n, |i, at| {
                let [low, high] = field.roi();
                let size = high - low;
                for (a, row) in out.iter_mut().enumerate().filter(|(_, row)| !row.is_empty()) {
                    row[i] = if size[a] > 0.0 { (at[a] - low[a]) / size[a] } else { 0.0 };
                }
            }),
            Answer::Segment(segments) => {
                for i in (0..n).filter(|i| live.is_none_or(|live| live[*i] != 0)) {
                    let medium = segments.medium([rows[0][i], rows[1][i], rows[2][i]]);
                    out.iter_mut().zip(medium).for_each(|(row, v)| row.get_mut(i).into_iter().for_each(|to| *to = v));
                }
            }
            Answer::Medium(table) => dispatch::classified(unit, table, rows[0], out, true),
            Answer::Color4(table) => dispatch::classified(unit, table, rows[0], out, false),
            Answer::Entry(table) => table.entries(rows[0], out),
            Answer::Nothing => out.iter_mut().for_each(|row| row.fill(0.0)),
        }
    }
}

/// Components as straight colour and opacity.
fn colors(fields: &[Field<'_>], (meaning, [low, high]): (Components, [f32; 2]), p: Places<'_>, out: &mut [&mut [f32]]) {
    let n = out.iter().map(|row| row.len()).max().unwrap_or(0);
    let mut numbers: [Vec<f32>; 4] = Default::default();
    for (row, field) in numbers.iter_mut().zip(fields) {
        row.resize(n, 0.0);
        field.values(p, row);
        row.iter_mut().for_each(|v| *v = ((*v - low) / (high - low)).clamp(0.0, 1.0));
    }
    let of = |c: usize, i: usize| numbers[c].get(i).copied().unwrap_or(1.0);
    for i in 0..n {
        let rgba = match meaning {
            Components::Intensity => [of(0, i); 4],
            Components::Luminance => [of(0, i), of(0, i), of(0, i), 1.0],
            Components::LuminanceAlpha => [of(0, i), of(0, i), of(0, i), of(1, i)],
            Components::Rgb => [of(0, i), of(1, i), of(2, i), 1.0],
            Components::Rgba => [of(0, i), of(1, i), of(2, i), of(3, i)],
        };
        // A NaN anywhere is transparent.
        let unknown = rgba.iter().any(|v| v.is_nan());
        for (row, value) in out.iter_mut().zip(rgba) {
            if let Some(place) = row.get_mut(i) {
                *place = if unknown { f32::NAN } else { value };
            }
        }
    }
}
