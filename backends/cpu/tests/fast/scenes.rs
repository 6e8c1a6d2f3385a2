//! Scenes by rule, and pictures of them.

use std::sync::Arc;

use volact_core::{
    Aabb, Appearance, Attribute, Block, Buffer, Camera, Clip, ClipRegion, ControlPoint, Filter, Frame, FrameDesc,
    Geometry, LookupTable, Opaque, OpaqueDepth, Options, ParameterValue, Plane, Points, Registry, RenderAction,
    ScalarType, Shape, SliceStyle, Sliced, Slices, Sphere, StructuredMesh, Surface, Volume, VolumeDesc, VolumeTexture,
    glam::{DAffine3, DMat3, DVec3},
};

/// A named scene.
pub struct Scene {
    pub name: &'static str,
    pub shapes: Vec<Shape>,
    pub desc: FrameDesc,
}

pub fn action(name: &str, options: &[(&str, ParameterValue)]) -> Box<dyn RenderAction> {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry).unwrap();
    let options: Options = options.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect();
    registry.action(name, &options).unwrap()
}

pub fn draw(action: &mut dyn RenderAction, shapes: &[Shape], desc: &FrameDesc) -> Frame {
    shapes.iter().for_each(|s| action.manage(s).unwrap_or_else(|e| panic!("{e}")));
    action.begin_draw(desc).unwrap_or_else(|e| panic!("{e}"));
    shapes.iter().for_each(|s| action.draw(s).unwrap());
    action.end_draw().unwrap_or_else(|e| panic!("{e}"))
}

/// `cpu` at a step, classified in the middle of segments.
pub fn cpu(step: f64, more: &[(&str, ParameterValue)]) -> Box<dyn RenderAction> {
    let mut options: Vec<(&str, ParameterValue)> =
        vec![("sample_distance", step.into()), ("classification", "post".into())];
    options.extend(more.iter().cloned());
    action("cpu", &options)
}

pub fn volume(dims: [usize; 3], scalar: ScalarType, rule: impl Fn(DVec3) -> f64) -> Volume {
    let at =
        |i: usize| DVec3::from_array([i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]].map(|v| v as f64));
    let values = (0..dims.iter().product()).map(|i| rule(at(i)));
    let bytes: Vec<u8> = match scalar {
        ScalarType::U8 => values.map(|v| v.round().clamp(0.0, 255.0) as u8).collect(),
        ScalarType::F32 => values.flat_map(|v| (v as f32).to_ne_bytes()).collect(),
        other => panic!("{other}"),
    };
    Volume::new(VolumeDesc::new(dims, scalar, 1), Buffer::from_vec(bytes)).unwrap()
}

/// Mostly nothing: a ball and a rod.
pub fn ball(scalar: ScalarType) -> Volume {
    let size = DVec3::new(22.0, 20.0, 24.0);
    volume([23, 21, 25], scalar, |p| {
        let q = p / size;
        let ball = 200.0 - 600.0 * (q - DVec3::new(0.4, 0.45, 0.55)).length();
        let rod = 120.0 - 2500.0 * ((q.x - 0.8).powi(2) + (q.y - 0.7).powi(2));
        ball.max(rod).max(0.0).floor()
    })
}

pub fn table(points: &[(f64, [f64; 3], f64)]) -> LookupTable {
    let point = |&(value, color, opacity): &(f64, [f64; 3], f64)| ControlPoint { value, color, opacity };
    LookupTable::from_points(points.iter().map(point).collect::<Vec<_>>()).unwrap()
}

pub fn warm() -> LookupTable {
    table(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.12), (200.0, [1.0; 3], 0.3)])
}

pub fn cold() -> LookupTable {
    table(&[(0.0, [0.0, 0.2, 0.5], 0.0), (60.0, [0.1, 0.6, 1.0], 0.2), (200.0, [0.2, 1.0, 0.9], 0.05)])
}

pub fn look(table: LookupTable) -> Appearance {
    Appearance::new("lut").with("lookup_table", table).with("unit_distance", 1.0)
}

pub fn lut(volume: &Volume, table: LookupTable) -> Shape {
    Shape::around(volume, look(table))
}

fn placed(shape: Shape, map: DAffine3) -> Shape {
    shape.set_transform(map);
    shape
}

fn plane(point: DVec3, normal: DVec3) -> Plane {
    Plane::new(point, normal).unwrap()
}

const SIZE: DVec3 = DVec3::new(22.0, 20.0, 24.0);

fn view(pixels: usize) -> FrameDesc {
    let target = SIZE / 2.0;
    FrameDesc::new(Camera::orthographic(target + DVec3::new(14.0, -30.0, 17.0), target, DVec3::Z, 36.0), pixels, pixels)
}

fn inside(pixels: usize) -> FrameDesc {
    FrameDesc::new(Camera::perspective(SIZE * 0.4, SIZE, DVec3::Z, 80.0), pixels, pixels)
}

/// A grid of cells over the box from 0 to `size`, bent by a wave of this strength.
pub fn grid(n: usize, size: DVec3, strength: f64) -> (Vec<DVec3>, Vec<DVec3>) {
    let unit = |i: usize| DVec3::from_array([i % n, i / n % n, i / n / n].map(|v| v as f64 / (n - 1) as f64));
    let units: Vec<DVec3> = (0..n * n * n).map(unit).collect();
    let wave = |u: &DVec3| DVec3::new((5.0 * u.y).sin(), (4.0 * u.z).cos(), (6.0 * u.x).sin()) * strength;
    (units.iter().map(|u| size * (*u + wave(u))).collect(), units)
}

/// A mesh whose vertices carry numbers by rule of their grid place.
pub fn field(n: usize, rule: impl Fn(DVec3) -> f64, table: LookupTable) -> Shape {
    let (points, units) = grid(n, SIZE, 0.04);
    let values: Vec<f64> = units.into_iter().map(rule).collect();
    let numbers = Attribute::new("numbers", ScalarType::F64, 1, Buffer::from_vec(values)).unwrap();
    let look = look(table).with("scalars", numbers);
    Shape::new(StructuredMesh::new([n; 3], points.into()).unwrap(), Appearance { shader: "attribute".into(), ..look })
}

fn waves(u: DVec3) -> f64 {
    100.0 + 90.0 * (5.0 * u.x).sin() * (4.0 * u.y + u.z).cos()
}

/// A volume carried along by a bent mesh.
fn deformed(volume: &Volume, table: LookupTable) -> Shape {
    let (points, units) = grid(6, SIZE, 0.05);
    let mesh = StructuredMesh::new([6; 3], points.into()).unwrap();
    Shape::new(mesh.with_texture_coordinates(units.into()).unwrap(), look(table).with("volume", volume))
}

/// A ring around the volume's axis: rays enter it twice.
fn ring() -> StructuredMesh {
    let around = 25;
    let point = |i: usize| {
        let (a, r, z) = (i % around, i / around % 2, i / around / 2);
        let (s, c) = (std::f64::consts::TAU * a as f64 / (around - 1) as f64).sin_cos();
        let radius = 5.0 + 4.0 * r as f64;
        SIZE / 2.0 + DVec3::new(radius * c, radius * s, -9.0 + 18.0 * z as f64)
    };
    StructuredMesh::new([around, 2, 2], (0..around * 4).map(point).collect()).unwrap()
}

fn sliced(geometry: impl Geometry, style: SliceStyle, volume: bool) -> Sliced {
    let planes =
        vec![plane(SIZE * 0.5, DVec3::new(0.3, 1.0, 0.2)), plane(SIZE * 0.4, DVec3::X), plane(SIZE * 0.6, -DVec3::Z)];
    Sliced::new(Arc::new(geometry), Slices { planes, style, volume }).unwrap()
}

/// An octahedron in the middle.
fn wall() -> Shape {
    let vertices: Points = [DVec3::X, DVec3::Y, -DVec3::X, -DVec3::Y, DVec3::Z, -DVec3::Z]
        .into_iter()
        .map(|v| SIZE / 2.0 + v * 6.0)
        .collect();
    let triangles: Vec<u32> = (0..4u32).flat_map(|i| [i, (i + 1) % 4, 4, (i + 1) % 4, i, 5]).collect();
    Shape::new(Surface::new(vertices, Buffer::from_vec(triangles)).unwrap(), Appearance::new("surface"))
}

fn opaque(pixels: usize) -> Opaque {
    let depth: Vec<f32> =
        (0..pixels * pixels).map(|i| if i % 7 == 0 { f32::INFINITY } else { 30.0 + (i % 13) as f32 }).collect();
    let color: Vec<[f32; 4]> =
        (0..pixels * pixels).map(|i| [0.1 * (i % 3) as f32, 0.2, 0.1, 0.5 + 0.5 * (i % 2) as f32]).collect();
    Opaque { color: Some(color.into()), depth: OpaqueDepth::Distance(depth.into()) }
}

fn cuts() -> Clip {
    let eight = (0..8).map(|i| {
        let (s, c) = (0.8 * f64::from(i)).sin_cos();
        let normal = DVec3::new(c, s, 0.3);
        plane(SIZE / 2.0 - normal * 9.0, normal)
    });
    let middle = Aabb::new(SIZE * 0.4, SIZE * 0.62);
    Clip::new([ClipRegion::planes(eight), ClipRegion::crop(middle).cut()])
}

fn many(volume: &Volume) -> Vec<Shape> {
    (0..10)
        .map(|i| {
            let color = [0.1 * f64::from(i), 1.0 - 0.1 * f64::from(i), 0.5];
            let shape = lut(volume, table(&[(20.0, color, 0.0), (200.0, color, 0.03 * f64::from(i % 4))]));
            placed(shape, DAffine3::from_translation(DVec3::new(0.3, 0.2, -0.4) * f64::from(i)))
        })
        .collect()
}

fn rgba() -> Volume {
    let n = [9usize, 8, 10];
    let byte = |i: usize| ((i * 37) % 200 + i % 4 * 10) as u8;
    let bytes: Vec<u8> = (0..4 * n.iter().product::<usize>()).map(byte).collect();
    let mut desc = VolumeDesc::new(n, ScalarType::U8, 4);
    desc.spacing = DVec3::splat(2.4);
    Volume::new(desc, bytes).unwrap()
}

/// All scenes; `pixels` wide and high.
pub fn all(pixels: usize) -> Vec<Scene> {
    let (bytes, floats) = (ball(ScalarType::U8), ball(ScalarType::F32));
    let shift = DAffine3::from_translation(DVec3::new(5.0, -3.0, 2.0)) * DAffine3::from_rotation_z(0.4);
    let mirrored = DAffine3::from_translation(DVec3::new(23.0, 2.0, 1.0))
        * DAffine3::from_rotation_x(0.3)
        * DAffine3::from_mat3(DMat3::from_cols(
            DVec3::new(-1.0, 0.2, 0.0),
            DVec3::new(0.1, 0.9, 0.3),
            DVec3::new(0.0, 0.1, 1.1),
        ))
        * DAffine3::from_scale(DVec3::new(1.1, 0.7, 0.8));
    let two = || vec![lut(&bytes, warm()), placed(lut(&floats, cold()), shift)];
    let clipped = |shape: Shape| {
        shape.set_clip(cuts());
        shape
    };
    let block = || Block::new(DVec3::ZERO, SIZE).unwrap();
    let voxels = |geometry: Sliced| Shape::new(geometry, look(warm()).with("volume", &bytes));
    let sphere = || Shape::new(Sphere::new(SIZE / 2.0, 8.0, 16).unwrap(), look(warm()).with("volume", &bytes));
    let nearest = VolumeTexture::new(&bytes).with_filter(Filter::Nearest);
    let scene = |name, shapes, desc| Scene { name, shapes, desc };
    let plain = view(pixels);
    vec![
        scene("two volumes through each other", two(), plain.clone()),
        scene("two volumes through each other, from inside", two(), inside(pixels)),
        scene(
            "three coincident blocks",
            vec![lut(&bytes, warm()), lut(&bytes, cold()), lut(&bytes, warm())],
            plain.clone(),
        ),
        scene("ten volumes", many(&bytes), plain.clone()),
        scene("mirrored and sheared", vec![lut(&bytes, warm()), placed(lut(&floats, cold()), mirrored)], plain.clone()),
        scene("a volume in a mesh", vec![field(5, waves, cold()), lut(&bytes, warm())], plain.clone()),
        scene("two meshes", vec![field(5, waves, cold()), field(4, |u| 150.0 * u.z, warm())], plain.clone()),
        scene("carved", vec![sphere()], plain.clone()),
        scene("carved into a ring", vec![Shape::new(ring(), look(warm()).with("volume", &bytes))], plain.clone()),
        scene("carved beside another", vec![sphere(), placed(lut(&floats, cold()), shift)], inside(pixels)),
        scene("deformed", vec![deformed(&bytes, warm())], plain.clone()),
        scene("deformed among others", vec![deformed(&floats, cold()), lut(&bytes, warm())], plain.clone()),
        scene("clipped", vec![clipped(lut(&bytes, warm()))], plain.clone()),
        scene("clipped scene", two(), plain.clone().with_clip(cuts())),
        scene("two clipped", two().into_iter().map(clipped).collect(), inside(pixels)),
        scene("clipped mesh", vec![clipped(field(5, waves, cold()))], plain.clone()),
        scene("opaque slices", vec![voxels(sliced(block(), SliceStyle::Opaque, false))], plain.clone()),
        scene("blended slices in the volume", vec![voxels(sliced(block(), SliceStyle::Blended, true))], plain.clone()),
        scene(
            "slices beside a volume",
            vec![voxels(sliced(block(), SliceStyle::Blended, true)), placed(lut(&floats, cold()), shift)],
            plain.clone(),
        ),
        scene("slices of a ring", vec![voxels(sliced(ring(), SliceStyle::Opaque, true))], plain.clone()),
        scene(
            "a wall in two volumes",
            vec![lut(&bytes, warm()), wall(), placed(lut(&floats, cold()), shift)],
            plain.clone(),
        ),
        scene("a clipped wall", vec![lut(&bytes, warm()), clipped(wall())], plain.clone()),
        scene("an application's picture", two(), plain.clone().with_opaque(opaque(pixels))),
        scene("a wall in a mesh", vec![field(5, waves, cold()), wall()], plain.clone().with_opaque(opaque(pixels))),
        scene(
            "components and classified voxels",
            vec![
                Shape::around(&rgba(), Appearance::new("simple").with("unit_distance", 9.0)),
                placed(lut(&floats, cold().pre_interpolated()), shift),
            ],
            plain.clone(),
        ),
        scene(
            "components alone",
            vec![Shape::around(&bytes, Appearance::new("simple").with("unit_distance", 9.0))],
            plain.clone(),
        ),
        scene("classified voxels alone", vec![lut(&bytes, cold().pre_interpolated())], plain.clone()),
        scene(
            "nearest among others",
            vec![Shape::around_texture(&nearest, look(warm())), placed(lut(&floats, cold()), shift)],
            plain.clone(),
        ),
        scene("flat pictures of meshes", flat(&bytes, clipped), plain.with_opaque(opaque(pixels))),
    ]
}

fn flat(bytes: &Volume, clipped: impl Fn(Shape) -> Shape) -> Vec<Shape> {
    let table = || table(&[(0.0, [0.2, 0.4, 0.6], 0.1), (150.0, [1.0, 0.5, 0.2], 0.6)]);
    let shader = |shape: Shape, name: &str| {
        shape.set_shader(name);
        shape
    };
    let ring = Shape::new(ring(), look(table()).with("volume", bytes));
    vec![
        shader(ring, "mip"),
        shader(deformed(bytes, table()), "average"),
        shader(clipped(lut(bytes, table())), "minip"),
        shader(
            Shape::new(
                Sphere::new(SIZE / 2.0, 8.0, 12).unwrap(),
                look(table()).with("volume", bytes).with("unit_distance", 30.0),
            ),
            "xray",
        ),
    ]
}
