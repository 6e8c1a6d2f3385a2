//! Scenes by rule: volumes from formulas, tables from points, cameras of few pixels.

use volact_core::{
    Appearance, Buffer, Camera, ControlPoint, FrameDesc, LookupTable, ScalarType, Shape, Volume, VolumeDesc,
    VolumeTexture, glam::DVec3,
};

/// Numbers as bytes of a scalar type, rounded where it holds no fractions.
pub fn encode(scalar: ScalarType, values: &[f64]) -> Vec<u8> {
    macro_rules! all {
        ($t:ty) => {
            values.iter().flat_map(|v| (v.round() as $t).to_ne_bytes()).collect()
        };
    }
    match scalar {
        ScalarType::U8 => all!(u8),
        ScalarType::I8 => all!(i8),
        ScalarType::U16 => all!(u16),
        ScalarType::I16 => all!(i16),
        ScalarType::U32 => all!(u32),
        ScalarType::I32 => all!(i32),
        ScalarType::F16 => values.iter().flat_map(|v| half::f16::from_f64(*v).to_ne_bytes()).collect(),
        ScalarType::F32 => values.iter().flat_map(|v| (*v as f32).to_ne_bytes()).collect(),
        ScalarType::F64 => values.iter().flat_map(|v| v.to_ne_bytes()).collect(),
    }
}

/// The values of a rule at the samples of a grid, x fastest.
pub fn values(dims: [usize; 3], rule: impl Fn(DVec3) -> f64) -> Vec<f64> {
    let at = |i: usize| [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])];
    let n = dims.iter().product();
    (0..n).map(|i| rule(DVec3::from_array(at(i).map(|v| v as f64)))).collect()
}

/// A volume of spacing 1 whose samples are a rule of their indices.
///
/// # Panics
/// If the dimensions are no volume's.
pub fn volume(dims: [usize; 3], scalar: ScalarType, rule: impl Fn(DVec3) -> f64) -> Volume {
    placed(VolumeDesc::new(dims, scalar, 1), rule)
}

/// A volume of one component as described, whose stored samples are a rule of their indices.
///
/// # Panics
/// If the description is wrong.
pub fn placed(desc: VolumeDesc, rule: impl Fn(DVec3) -> f64) -> Volume {
    let bytes = encode(desc.scalar, &values(desc.dims, rule));
    Volume::new(desc, Buffer::from_vec(bytes)).expect("a right volume")
}

/// A volume of one value everywhere, `cells` long along each axis.
pub fn constant(value: f64, cells: [usize; 3]) -> Volume {
    volume(cells.map(|n| n + 1), ScalarType::F32, |_| value)
}

/// A table of (value, grey, opacity).
///
/// # Panics
/// If a number is out of bounds.
pub fn greys(points: &[(f64, f64, f64)]) -> LookupTable {
    let point = |&(value, grey, opacity): &(f64, f64, f64)| ControlPoint { value, color: [grey; 3], opacity };
    LookupTable::from_points(points.iter().map(point).collect::<Vec<_>>()).expect("a right table")
}

/// A table of (value, colour, opacity).
///
/// # Panics
/// If a number is out of bounds.
pub fn colors(points: &[(f64, [f64; 3], f64)]) -> LookupTable {
    let point = |&(value, color, opacity): &(f64, [f64; 3], f64)| ControlPoint { value, color, opacity };
    LookupTable::from_points(points.iter().map(point).collect::<Vec<_>>()).expect("a right table")
}

/// A volume through a table.
pub fn lut(volume: &Volume, table: LookupTable, unit: f64) -> Shape {
    lut_of(&VolumeTexture::new(volume), table, unit)
}

/// A texture through a table.
pub fn lut_of(texture: &VolumeTexture, table: LookupTable, unit: f64) -> Shape {
    Shape::around_texture(texture, look("lut", table, unit))
}

/// A texture through any shader with a table.
pub fn shaded(shader: &str, texture: &VolumeTexture, table: LookupTable, unit: f64) -> Shape {
    Shape::around_texture(texture, look(shader, table, unit))
}

/// A shader with table and unit distance.
pub fn look(shader: &str, table: LookupTable, unit: f64) -> Appearance {
    Appearance::new(shader).with("lookup_table", table).with("unit_distance", unit)
}

/// A ray along +y through (x, z): one pixel, orthographic.
pub fn along_y(x: f64, z: f64) -> FrameDesc {
    one_ray(DVec3::new(x, -100.0, z), DVec3::new(x, 0.0, z))
}

/// A ray from one point towards another: one pixel, orthographic, seen from the first on.
pub fn one_ray(from: DVec3, to: DVec3) -> FrameDesc {
    let up = if (to - from).normalize().z.abs() < 0.9 { DVec3::Z } else { DVec3::X };
    FrameDesc::new(Camera::orthographic(from, to, up, 1e-6), 1, 1)
}

/// A square orthographic picture from a direction, `height` high around `target`.
pub fn square(target: DVec3, towards_eye: DVec3, height: f64, pixels: usize) -> FrameDesc {
    FrameDesc::new(Camera::orthographic(target + towards_eye, target, DVec3::Z, height), pixels, pixels)
}

/// A volume mostly of nothing: a ball and a rod, 0 to 200.
pub fn ball(dims: [usize; 3], scalar: ScalarType) -> Volume {
    let size = DVec3::from_array(dims.map(|n| n as f64));
    volume(dims, scalar, |p| {
        let q = p / size;
        let ball = 200.0 - 900.0 * (q - DVec3::new(0.35, 0.4, 0.6)).length();
        let rod = 120.0 - 2500.0 * ((q.x - 0.8).powi(2) + (q.y - 0.7).powi(2));
        ball.max(rod).max(0.0).floor()
    })
}

/// A single trilinear cell with a cubic along its diagonals, values in 0.1 to 0.9.
pub fn cell() -> Volume {
    let corners = [0.1, 0.5, 0.35, 0.2, 0.6, 0.25, 0.15, 0.9];
    volume([2, 2, 2], ScalarType::F32, |p| corners[(p.x + 2.0 * p.y + 4.0 * p.z) as usize])
}
