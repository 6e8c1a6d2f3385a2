//! Meshes, numbers at vertices and surfaces, held to `reference` on planes.

use volact_core::{
    Attribute, Block, Buffer, Geometry, SliceStyle, Sliced, Slices, StructuredMesh, Surface, glam::DMat3,
};

use super::{compositing::agree, *};

const STEP: f64 = 0.31;

/// A bent grid of 5 × 4 × 6 cells over the volume, of which those at every 11th vertex are missing: hollow, torn, and with cells that
/// touch at edges only.
fn torn() -> StructuredMesh {
    let mut points = Vec::new();
    for z in 0..=6 {
        for y in 0..=4 {
            for x in 0..=5 {
                let u = DVec3::new(f64::from(x) / 5.0, f64::from(y) / 4.0, f64::from(z) / 6.0);
                let bend = 0.5 * DVec3::new((7.0 * u.y).sin(), (9.0 * u.z).cos(), (8.0 * u.x).sin());
                points.push(DVec3::splat(0.7) + 9.6 * u + bend);
            }
        }
    }
    let visible: Vec<u8> = (0..6 * 5 * 7).map(|i| u8::from(i % 11 != 0)).collect();
    StructuredMesh::new([6, 5, 7], points.into()).unwrap().with_blanking(Buffer::from_vec(visible)).unwrap()
}

fn of(geometry: impl Geometry, shader: &str) -> Shape {
    let name = if shader == "isosurface" { "surfaces" } else { "lookup_table" };
    let mut look = Appearance::new(shader).with(name, table()).with("volume", &data(ScalarType::U8));
    if matches!(shader, "lut" | "xray") {
        look = look.with("unit_distance", if shader == "lut" { 1.5 } else { 9.0 });
    }
    let shape = Shape::new(geometry, look);
    shape.set_transform(block(ScalarType::U8).state().transform);
    shape
}

#[test]
fn volumes_in_meshes_of_any_form() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", STEP.into())]) else { return };
    let shear = DMat3::from_cols(DVec3::new(0.9, 0.2, 0.0), DVec3::new(-0.3, 0.8, 0.1), DVec3::new(0.2, 0.0, 1.1));
    for (number, frame) in views().into_iter().enumerate().step_by(2) {
        let sphere = Sphere::new(DVec3::splat(5.5), 5.0, 10).unwrap();
        agree(&mut *action, &format!("sphere, view {number}"), &[of(sphere, "lut")], &frame, 0.3);
        agree(&mut *action, &format!("torn, view {number}"), &[of(torn(), "lut")], &frame, 0.3);
        let sheared = of(torn(), "lut");
        sheared.set_transform(DAffine3::from_mat3(shear) * sheared.state().transform);
        agree(&mut *action, &format!("sheared, view {number}"), &[sheared], &frame, 0.3);
    }
}

#[test]
fn meshes_of_all_compositings_overlap_and_are_sliced() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", STEP.into())]) else { return };
    for (number, frame) in views().into_iter().enumerate().step_by(4) {
        for name in ["mip", "average", "isosurface"] {
            let several = [of(torn(), name), block(ScalarType::U8)];
            agree(&mut *action, &format!("{name}, view {number}"), &several, &frame, 0.3);
        }
        let moved = of(torn(), "lut");
        moved.set_transform(DAffine3::from_translation(DVec3::new(1.0, 0.5, -0.7)) * moved.state().transform);
        agree(&mut *action, &format!("overlap, view {number}"), &[of(torn(), "lut"), moved], &frame, 0.3);
        let planes = [(DVec3::Y, 5.3), (DVec3::X, 6.7)].map(|(n, at)| Plane::new(n * at, n).unwrap());
        let slices = Slices { planes: planes.to_vec(), style: SliceStyle::Opaque, volume: true };
        let sliced = Sliced::new(Arc::new(torn()), slices).unwrap();
        agree(&mut *action, &format!("slices, view {number}"), &[of(sliced, "lut")], &frame, 0.3);
    }
}

/// Numbers by rule at the vertices of a geometry.
fn field(geometry: impl Geometry) -> Shape {
    let made = geometry.tessellate().unwrap();
    let rule = |p: DVec3| 90.0 + 60.0 * (0.7 * p.x).sin() + 50.0 * (0.5 * p.y + 0.3 * p.z).cos();
    let numbers: Vec<f64> = made.vertices.iter().map(rule).collect();
    let scalars = Attribute::new("rule", ScalarType::F64, 1, Buffer::from_vec(numbers)).unwrap();
    let look = Appearance::new("attribute").with("scalars", scalars).with("lookup_table", table());
    let shape = Shape::new(geometry, look.with("unit_distance", 1.5));
    shape.set_transform(block(ScalarType::U8).state().transform);
    shape
}

#[test]
fn numbers_at_vertices() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", STEP.into())]) else { return };
    for (number, frame) in views().into_iter().enumerate().step_by(2) {
        agree(&mut *action, &format!("torn, view {number}"), &[field(torn())], &frame, 0.3);
        let block = Block::new(DVec3::ZERO, DVec3::new(9.0, 8.0, 10.0)).unwrap();
        agree(&mut *action, &format!("block, view {number}"), &[field(block)], &frame, 0.3);
    }
}

/// The boundary of a sphere's tetrahedra.
fn skin(smooth: bool) -> Shape {
    let made = Sphere::new(DVec3::splat(5.5), 4.0, 6).unwrap().tessellate().unwrap();
    let adjacency = volact_core::geometry::Adjacency::new(&made.tetrahedra);
    let triangles: Vec<u32> = adjacency.boundary(&made.tetrahedra).flatten().collect();
    let normals: Vec<DVec3> = made.vertices.iter().map(|p| (p - DVec3::splat(5.5)) * 0.7 + DVec3::X * 1e-3).collect();
    let mut surface = Surface::new(made.vertices, Buffer::from_vec(triangles)).unwrap();
    if smooth {
        surface = surface.with_normals(normals.into()).unwrap();
    }
    let look = Appearance::new("surface").with("lightdir", DVec3::new(0.3, -1.0, 0.5));
    let shape = Shape::new(surface, look);
    shape.set_transform(block(ScalarType::U8).state().transform);
    shape
}

#[test]
fn surfaces_end_what_lies_behind_them() {
    let _alone = alone();
    let Some(mut action) = action(&[("sample_distance", STEP.into())]) else { return };
    for (number, frame) in views().into_iter().enumerate().step_by(2) {
        for smooth in [false, true] {
            let what = format!("surface {smooth}, view {number}");
            agree(&mut *action, &what, &[skin(smooth)], &frame, 0.9);
            let several = [skin(smooth), block(ScalarType::U8), of(torn(), "mip")];
            agree(&mut *action, &format!("{what}, with others"), &several, &frame, 0.9);
        }
    }
}
