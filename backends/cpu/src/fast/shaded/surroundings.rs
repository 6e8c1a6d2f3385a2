//! What programs ask for: volumes at places in local space, and tables.
#![expect(clippy::needless_range_loop, reason = "a lane or axis indexes several arrays")]

use volact_core::{
    ParameterValue, Roi, VolumeTexture,
    glam::{DAffine3, DVec3, Mat3, Vec3},
    resolve::ResolvedShape,
    volume::Components,
};
use volact_shaders::{Environment, eval::Function, signatures::Derived};

use super::lookup::Lookup;
use crate::fast::{
    classify::Units,
    dispatch,
    fetch::{Base, Voxels},
    resources::plain_voxels,
    simd::{LANES, Unit},
};

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
    Medium(Lookup),
    Color4(Lookup),
    /// A volume or table that was left out.
    Nothing,
}

/// One component of a volume, in local space.
#[derive(Debug)]
struct Field<'a> {
    voxels: Voxels<'a>,
    base: Base,
    /// From local space to samples, relative to the base.
    linear: Mat3,
    offset: Vec3,
    units: Units,
    /// Ends of the data ROI, relative to the base.
    roi: [Vec3; 2],
    /// Ends of the data, relative to the base.
    data: Base,
    whole: Voxels<'a>,
}

impl<'a> Field<'a> {
    fn new(texture: &'a VolumeTexture, component: usize, local: &DAffine3) -> Self {
        let component = component.min(texture.volume().desc().components - 1);
        let (voxels, units) = plain_voxels(texture, component);
        let to_index = texture.object_to_index() * *local;
        let base = Base::new(&voxels, to_index.translation.to_array());
        let offset = to_index.translation - DVec3::from_array(base.at.map(f64::from));
        let Roi { min, max } = texture.data_roi();
        let relative =
            |v: [usize; 3]| Vec3::from_array([0, 1, 2].map(|a| (v[a] as f64 - f64::from(base.at[a])) as f32));
        let dims = voxels.dims;
        let whole = Voxels { min: [0; 3], max: dims.map(|n| n - 1), ..voxels };
        let data = Base { at: base.at, lo: relative([0; 3]).to_array(), hi: relative(dims.map(|n| n - 1)).to_array() };
        Self {
            voxels,
            base,
            linear: to_index.matrix3.as_mat3(),
            offset: offset.as_vec3(),
            units,
            roi: [relative(min), relative(max)],
            data,
            whole,
        }
    }

    /// Sixteen positions relative to the base, of those that begin at `first`; the last one again
    /// where there are no more.
    #[inline(always)]
    fn at(&self, p: &[&[f32]], first: usize) -> [[f32; LANES]; 3] {
        let mut out = [[0f32; LANES]; 3];
        let n = p[0].len() - first;
        let (m, o) = (self.linear, self.offset);
        for l in 0..LANES {
            let i = first + l.min(n - 1);
            let (x, y, z) = (p[0][i], p[1][i], p[2][i]);
            for a in 0..3 {
                out[a][l] = m.x_axis[a] * x + (m.y_axis[a] * y + (m.z_axis[a] * z + o[a]));
            }
        }
        out
    }

    /// Values in data units.
    fn values(&self, unit: Unit, p: &[&[f32]], out: &mut [f32]) {
        let (scale, offset) = (self.units.scale, self.units.offset);
        let plain = scale == 1.0 && offset == 0.0;
        for first in (0..out.len()).step_by(LANES) {
            let mut number = [0f32; LANES];
            dispatch::numbers(unit, &self.voxels, &self.base, &self.at(p, first), &mut number);
            let out = &mut out[first..];
            for (out, number) in out.iter_mut().zip(number) {
                *out = if plain { number } else { (f64::from(number) * scale + offset) as f32 };
            }
        }
    }

    /// Gradients of the value in data units a world unit.
    fn gradients(&self, unit: Unit, p: &[&[f32]], out: &mut [&mut [f32]]) {
        let n = out.iter().map(|row| row.len()).max().unwrap_or(0);
        let half = 0.5 * self.units.scale as f32;
        for first in (0..n).step_by(LANES) {
            let mut local = self.at(p, first);
            for a in 0..3 {
                local[a].iter_mut().for_each(|v| *v = v.max(self.roi[0][a]).min(self.roi[1][a]));
            }
            // Along each axis of the data, over one voxel either way, up to the data's edge.
            let mut along = [[0f32; LANES]; 3];
            for (a, along) in along.iter_mut().enumerate() {
                let ends = [1.0, -1.0].map(|way: f32| {
                    let mut moved = local;
                    moved[a].iter_mut().for_each(|v| *v += way);
                    let mut number = [0f32; LANES];
                    dispatch::numbers(unit, &self.whole, &self.data, &moved, &mut number);
                    number
                });
                (0..LANES).for_each(|l| along[l] = half * (ends[0][l] - ends[1][l]));
            }
            for (c, row) in out.iter_mut().enumerate() {
                // The transpose of the map to samples.
                let column = self.linear.col(c);
                for (l, value) in row.iter_mut().skip(first).take(LANES).enumerate() {
                    *value = column.x * along[0][l] + column.y * along[1][l] + column.z * along[2][l];
                }
            }
        }
    }

    /// Something of each position relative to the base.
    fn each(&self, p: &[&[f32]], n: usize, mut take: impl FnMut(usize, Vec3)) {
        for first in (0..n).step_by(LANES) {
            let at = self.at(p, first);
            (first..n.min(first + LANES)).for_each(|i| take(i, Vec3::from_array([0, 1, 2].map(|a| at[a][i - first]))));
        }
    }
}

impl<'a> Surroundings<'a> {
    /// What a shape's program asks for.
    pub fn new(shape: &'a ResolvedShape, functions: &[Function], origin: DVec3, unit: Unit) -> Self {
        let local = shape.to_object * DAffine3::from_translation(origin);
        let answers = functions.iter().map(|f| answer(shape, *f, &local)).collect();
        Self { unit, answers }
    }
}

fn answer<'a>(shape: &'a ResolvedShape, function: Function, local: &DAffine3) -> Answer<'a> {
    let name = shape.shader.declaration.parameters.get(function.parameter).map(|p| p.name.as_str());
    match name.and_then(|name| shape.parameters.get(name)) {
        Some(ParameterValue::Volume(texture)) => {
            let component = shape.int("component").unwrap_or(0).clamp(0, 3) as usize;
            let field = |c| Field::new(texture, c, local);
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
                Derived::Nearest => {
                    let mut field = field(component);
                    field.voxels.nearest = true;
                    Answer::Value(field)
                }
                _ => Answer::Nothing,
            }
        }
        Some(ParameterValue::Table(table)) => {
            let range = shape.first_volume().map_or([0.0, 1.0], VolumeTexture::range);
            let lookup = Lookup::new(&table.resolve(range), shape.float("unit_distance").unwrap_or(1.0));
            match function.derived {
                Derived::Medium => Answer::Medium(lookup),
                Derived::TableColor => Answer::Color4(lookup),
                _ => Answer::Nothing,
            }
        }
        _ => Answer::Nothing,
    }
}

impl Environment<f32> for &Surroundings<'_> {
    fn call(&mut self, function: usize, p: &[&[f32]], out: &mut [&mut [f32]], _: Option<&[u32]>) {
        let n = out.iter().map(|row| row.len()).max().unwrap_or(0);
        match &self.answers[function] {
            Answer::Value(field) => field.values(self.unit, p, out[0]),
            Answer::Normalized(field, [low, high]) => {
                field.values(self.unit, p, out[0]);
                let scale = 1.0 / (high - low);
                out[0].iter_mut().for_each(|v| *v = (*v - low) * scale);
            }
            Answer::Components(fields) => {
                for (c, row) in out.iter_mut().enumerate() {
                    match fields.get(c) {
                        Some(field) => field.values(self.unit, p, row),
                        None => row.fill(0.0),
                    }
                }
            }
            Answer::Color(fields, meaning, range) => colors(self.unit, fields, (*meaning, *range), p, out),
            Answer::Gradient(field) => field.gradients(self.unit, p, out),
            Answer::Inside(field) => field.each(p, n, |i, at| {
                let inside = at.cmpge(field.roi[0]).all() && at.cmple(field.roi[1]).all();
                out[0][i] = f32::from(u8::from(inside));
            }),
            Answer::Coordinates(field) => field.each(p, n, |i, at| {
                let size = field.roi[1] - field.roi[0];
                for (a, row) in out.iter_mut().enumerate().filter(|(_, row)| !row.is_empty()) {
                    row[i] = if size[a] > 0.0 { (at[a] - field.roi[0][a]) / size[a] } else { 0.0 };
                }
            }),
            Answer::Medium(table) => table_rows(p, n, out, |v| {
                let [r, g, b, a] = table.classify(v);
                [r, g, b, table.extinction(a)]
            }),
            Answer::Color4(table) => table_rows(p, n, out, |v| table.classify(v)),
            Answer::Nothing => out.iter_mut().for_each(|row| row.fill(0.0)),
        }
    }
}

#[inline(always)]
fn table_rows(p: &[&[f32]], n: usize, out: &mut [&mut [f32]], look: impl Fn(f32) -> [f32; 4]) {
    for (i, value) in p[0].iter().enumerate().take(n) {
        let rgba = look(*value);
        for (row, value) in out.iter_mut().zip(rgba) {
            if let Some(place) = row.get_mut(i) {
                *place = value;
            }
        }
    }
}

/// Components as straight colour and opacity.
fn colors(
    unit: Unit,
    fields: &[Field<'_>],
    (meaning, [low, high]): (Components, [f32; 2]),
    p: &[&[f32]],
    out: &mut [&mut [f32]],
) {
    let n = out.iter().map(|row| row.len()).max().unwrap_or(0);
    let mut numbers: [Vec<f32>; 4] = Default::default();
    for (row, field) in numbers.iter_mut().zip(fields) {
        row.resize(n, 0.0);
        field.values(unit, p, row);
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
