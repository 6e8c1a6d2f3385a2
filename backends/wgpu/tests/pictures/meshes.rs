//! Volumes in meshes, numbers at vertices and surfaces: the same pictures as the reference on the lattice of rays, and on
//! that of planes.

use std::{any::Any, slice::from_ref};

use volact_conformance::{
    meshes::{bent, cube, tube},
    metrics::within,
    scene::{ball, colors, lut_of, shaded, square},
};
use volact_core::{
    Aabb, Appearance, Camera, Clip, ClipRegion, FrameDesc, Geometry, LookupTable, Plane, ScalarType, Shape, SliceStyle,
    Sliced, Slices, Sphere, Surface, Tessellation, VolumeTexture,
    geometry::GeometryError,
    glam::{DAffine3, DMat3, DVec3},
};

use crate::common::{all_errors, draw_in, rays, registry};

const STEP: f64 = 0.31;

/// Rounding as in `agreement`, for ends of stretches on faces that rays may graze.
const ROUNDING: f64 = 5e-5;

/// Somebody's own geometry: another one's tetrahedra, moved.
#[derive(Debug)]
struct Own(Tessellation);

impl Own {
    fn new(made: &dyn Geometry, map: DAffine3) -> Self {
        let mut made = made.tessellate().unwrap();
        made.vertices = made.vertices.iter().map(|v| map.transform_point3(v)).collect();
        Self(made)
    }

    /// Several in one.
    fn all(parts: Vec<Self>) -> Self {
        let mut vertices: Vec<DVec3> = Vec::new();
        let mut tetrahedra = Vec::new();
        for Self(part) in parts {
            let first = vertices.len() as u32;
            vertices.extend(part.vertices.iter());
            tetrahedra.extend(part.tetrahedra.iter().map(|t| t.map(|v| v + first)));
        }
        Self(Tessellation { vertices: vertices.into(), tetrahedra, ..Tessellation::default() })
    }
}

impl Geometry for Own {
    fn name(&self) -> &str {
        "own"
    }

    fn bounds(&self) -> Aabb {
        self.0.vertices.bounds()
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        Ok(self.0.clone())
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

fn warm() -> LookupTable {
    colors(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (200.0, [1.0; 3], 0.9)])
}

fn a_ball() -> VolumeTexture {
    VolumeTexture::new(&ball([9, 8, 10], ScalarType::U8))
}

fn view() -> FrameDesc {
    square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 24)
}

fn near() -> FrameDesc {
    FrameDesc::new(Camera::perspective(DVec3::new(9.0, -11.0, 7.0), DVec3::splat(4.0), DVec3::Z, 50.0), 24, 20)
}

fn a_tube() -> Own {
    Own::new(
        &tube(0.5, [12, 2, 3]),
        DAffine3::from_scale_rotation_translation(
            DVec3::new(3.4, 3.0, 6.0),
            volact_core::glam::DQuat::from_rotation_x(0.3),
            DVec3::new(4.0, 4.5, 1.0),
        ),
    )
}

/// Nine bars one behind the other, as seen along y: more than are kept at a time.
fn bars() -> Own {
    let bar = |i: usize| {
        let map = DAffine3::from_translation(DVec3::new(1.0, 0.2 + 0.72 * i as f64, 0.5))
            * DAffine3::from_mat3(DMat3::from_cols(DVec3::X * 6.0, DVec3::Y * 0.4, DVec3::new(1.0, 0.3, 7.0)));
        Own::new(&cube(5), map)
    };
    Own::all((0..9).map(bar).collect())
}

fn of(geometry: impl Geometry, shader: &str) -> Shape {
    let shape = shaded(shader, &a_ball(), warm(), 1.0);
    shape.set_geometry(geometry);
    shape
}

fn agree(what: &str, shapes: &[Shape], desc: &FrameDesc) {
    for (method, [color, depth]) in all_errors(shapes, desc, STEP) {
        within(&format!("{what}, {method}, colour"), color, ROUNDING);
        within(&format!("{what}, {method}, depth"), depth, 1e-3);
    }
}

#[test]
fn convex_and_hollow_and_torn_meshes() {
    let sphere = Sphere::new(DVec3::new(4.0, 3.6, 4.4), 3.3, 12).unwrap();
    let bent = bent([5, 4, 6], DVec3::new(8.0, 7.0, 9.0), 0.1);
    // The cells at every 11th vertex are gone: cavities, and cells that touch at edges only.
    let visible: Vec<u8> = (0..6 * 5 * 7).map(|i| u8::from(i % 11 != 0)).collect();
    let torn = bent.clone().with_blanking(volact_core::Buffer::from_vec(visible)).unwrap();
    for desc in [view(), near()] {
        agree("sphere", &[of(sphere, "lut")], &desc);
        agree("bent grid", &[of(bent.clone(), "lut")], &desc);
        agree("torn grid", &[of(torn.clone(), "lut")], &desc);
        agree("tube", &[of(a_tube(), "lut")], &desc);
        agree("bars", &[of(bars(), "lut")], &desc);
    }
    let along = square(DVec3::splat(4.0), DVec3::new(0.05, -9.0, 0.1), 10.0, 32);
    agree("bars in a row", &[of(bars(), "lut")], &along);
    let inside = Camera::perspective(DVec3::new(4.0, 4.5, 4.0), DVec3::new(0.0, 9.0, 5.0), DVec3::Z, 80.0);
    agree("from inside", &[of(torn, "lut")], &FrameDesc::new(inside, 24, 24));
}

#[test]
fn sheared_and_mirrored_meshes() {
    let shear = DMat3::from_cols(DVec3::new(0.9, 0.2, 0.0), DVec3::new(-0.3, 0.8, 0.1), DVec3::new(0.2, 0.0, 1.1));
    for (what, linear) in [("sheared", shear), ("mirrored", shear * DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0)))] {
        let middle = DVec3::splat(4.0);
        let shape = of(a_tube(), "lut");
        shape.set_transform(
            DAffine3::from_translation(middle) * DAffine3::from_mat3(linear) * DAffine3::from_translation(-middle),
        );
        agree(what, &[shape], &near());
    }
}

#[test]
fn every_compositing() {
    for name in ["gradient", "mip", "minip", "average"] {
        agree(name, &[of(bars(), name)], &near());
    }
    let texture = a_ball();
    let surfaces = colors(&[(30.0, [1.0, 0.4, 0.1], 0.4), (90.0, [0.3, 0.8, 0.2], 0.7)]);
    let shape = Shape::around_texture(&texture, Appearance::new("isosurface").with("surfaces", surfaces));
    shape.set_geometry(bars());
    agree("isosurface", from_ref(&shape), &near());
    let haze = lut_of(&texture, colors(&[(0.0, [0.0, 0.2, 0.5], 0.0), (9.0, [1.0; 3], 0.05)]), 4.0);
    agree("isosurface in a block's haze", &[shape, haze], &view());
    let along = square(DVec3::splat(4.0), DVec3::new(0.05, -9.0, 0.1), 10.0, 24);
    agree(
        "a sum",
        &[{
            let shape = shaded("xray", &texture, warm(), 9.0);
            shape.set_geometry(bars());
            shape
        }],
        &along,
    );
}

#[test]
fn overlaps_regions_clips_and_slices() {
    let other = of(bars(), "lut");
    other.set_transform(DAffine3::from_translation(DVec3::new(0.7, 0.4, -0.5)) * DAffine3::from_rotation_z(0.2));
    agree("two that overlap", &[of(a_tube(), "lut"), other], &view());
    let moved = a_ball().with_geometry_roi(Aabb::new(DVec3::ZERO, DVec3::new(5.0, 6.0, 7.0))).unwrap();
    let cropped = lut_of(&moved, warm(), 1.0);
    cropped.set_geometry(a_tube());
    agree("geometry region", &[cropped], &view());
    let plane = ClipRegion::plane(Plane::new(DVec3::splat(4.0), DVec3::new(1.0, -0.3, 0.4)).unwrap());
    let hole = ClipRegion::crop(Aabb::new(DVec3::splat(2.0), DVec3::new(5.0, 4.3, 6.0))).cut();
    let clipped = of(bars(), "lut");
    clipped.set_clip(Clip::new([hole.clone()]));
    agree("clipped", &[clipped], &near().with_clip(Clip::new([plane])));
    for style in [SliceStyle::Opaque, SliceStyle::Blended] {
        for volume in [false, true] {
            let planes = [(DVec3::Y, 3.3), (DVec3::X, 4.7)].map(|(n, at)| Plane::new(n * at, n).unwrap());
            let slices = Slices { planes: planes.to_vec(), style, volume };
            let shape = lut_of(&a_ball(), warm(), 1.0);
            shape.set_geometry(Sliced::new(std::sync::Arc::new(bars()), slices).unwrap());
            agree(&format!("slices {style:?} {volume}"), &[shape], &near());
        }
    }
}

/// Rays along the edges of a grid and through its vertices, for which signs are ties.
#[test]
fn rays_through_edges_and_vertices_lose_nothing() {
    let straight = bent([8, 7, 9], DVec3::new(8.0, 7.0, 9.0), 0.0);
    let visible: Vec<u8> = (0..9 * 8 * 10).map(|i| u8::from(i % 17 != 0)).collect();
    let torn = straight.with_blanking(volact_core::Buffer::from_vec(visible)).unwrap();
    // One pixel a quarter of a cell, so that the rays of every other one run in faces, or along edges.
    let desc = square(DVec3::new(4.25, 0.0, 4.25), -DVec3::Y, 8.0, 32);
    let block = lut_of(&a_ball(), warm(), 1.0);
    let whole = of(bent([8, 7, 9], DVec3::new(8.0, 7.0, 9.0), 0.0), "lut");
    let [a, b] = [whole, block].map(|s| draw_in(&registry(), &rays(STEP), &[s], &desc));
    let worst = a.color.iter().flatten().zip(b.color.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    within("a grid that fills a block", f64::from(worst), ROUNDING);
    // Where a ray runs in a face, what is on one side of it counts: on the same side as in the reference.
    agree("a torn grid, along faces and edges", &[of(torn, "lut")], &desc);
}

#[test]
fn a_mesh_is_packed_once_and_a_damaged_one_refused() {
    let registry = registry();
    let mut action = rays(STEP).action_in(&registry);
    let shape = of(a_tube(), "lut");
    let mut rebuilt = |shape: &Shape| {
        let frame = volact_conformance::rig::draw(&mut *action, from_ref(shape), &view()).unwrap();
        frame.statistics.rebuilt.iter().filter(|r| r.what == "mesh").count()
    };
    assert_eq!((rebuilt(&shape), rebuilt(&shape)), (1, 0));
    shape.set_transform(DAffine3::from_rotation_z(0.4));
    assert_eq!(rebuilt(&shape), 0);
    shape.set_geometry(bars());
    assert_eq!((rebuilt(&shape), rebuilt(&shape)), (1, 0));
    let mut damaged = a_tube();
    damaged.0.tetrahedra[3][2] = 1_000_000;
    let shape = of(damaged, "lut");
    let error = volact_conformance::rig::draw(&mut *rays(STEP).action_in(&registry), &[shape], &view()).unwrap_err();
    let text = volact_core::ActionError::to_string(&error);
    assert!(matches!(error, volact_core::ActionError::Geometry { .. }), "{text}");
}

/// Numbers by rule at the vertices of a geometry, through a table.
fn field(geometry: impl Geometry) -> Shape {
    let rule = |p: DVec3| 80.0 + 60.0 * (0.7 * p.x).sin() + 50.0 * (0.5 * p.y + 0.3 * p.z).cos();
    volact_conformance::meshes::field(geometry, rule, warm(), 1.0)
}

#[test]
fn numbers_at_vertices() {
    let bent = bent([5, 4, 6], DVec3::new(8.0, 7.0, 9.0), 0.1);
    let visible: Vec<u8> = (0..6 * 5 * 7).map(|i| u8::from(i % 11 != 0)).collect();
    let torn = bent.clone().with_blanking(volact_core::Buffer::from_vec(visible)).unwrap();
    let block = volact_core::Block::new(DVec3::ONE, DVec3::new(6.0, 5.0, 7.0)).unwrap();
    for desc in [view(), near()] {
        agree("bent", &[field(bent.clone())], &desc);
        agree("torn", &[field(torn.clone())], &desc);
        agree("block", &[field(block)], &desc);
        agree("own", &[field(a_tube())], &desc);
        let other = lut_of(&a_ball(), warm(), 3.0);
        agree("across a volume", &[field(bars()), other], &desc);
    }
}

#[test]
fn cells_that_carry_numbers_and_overlap_are_an_error() {
    let shifted = Own::new(&a_tube(), DAffine3::from_translation(DVec3::new(0.3, 0.2, 0.1)));
    let shape = field(Own::all(vec![a_tube(), shifted]));
    let registry = registry();
    let error = volact_conformance::rig::draw(&mut *rays(STEP).action_in(&registry), &[shape], &view()).unwrap_err();
    assert!(error.to_string().contains("overlap"), "{error}");
    // Without numbers they are inside once.
    let shifted = Own::new(&a_tube(), DAffine3::from_translation(DVec3::new(0.3, 0.2, 0.1)));
    agree("overlapping cells", &[of(Own::all(vec![a_tube(), shifted]), "lut")], &view());
}

#[test]
fn numbers_that_change_move_alone() {
    let registry = registry();
    let mut action = rays(STEP).action_in(&registry);
    let shape = field(bars());
    let mut moved = |shape: &Shape| {
        volact_conformance::rig::draw(&mut *action, from_ref(shape), &view()).unwrap().statistics.uploaded_bytes
    };
    let all = moved(&shape);
    assert_eq!(moved(&shape), 0);
    let scalars = volact_conformance::meshes::scalars_of(&bars(), |p| p.x * 9.0);
    shape.set_parameter("scalars", scalars);
    let numbers = 20 * bars().0.vertices.len();
    let changed = moved(&shape);
    assert!((1..=numbers + 64).contains(&changed) && changed < all / 2, "{changed} of {all}, {numbers}");
}

/// The boundary of a geometry's tetrahedra as an opaque surface.
fn skin(geometry: &dyn Geometry, smooth: bool) -> Shape {
    let made = geometry.tessellate().unwrap();
    let adjacency = volact_core::geometry::Adjacency::new(&made.tetrahedra);
    let triangles: Vec<u32> = adjacency.boundary(&made.tetrahedra).flatten().collect();
    let normals: Vec<DVec3> = made.vertices.iter().map(|p| (p - DVec3::splat(4.1)) * (1.0 + p.x)).collect();
    let mut surface = Surface::new(made.vertices, volact_core::Buffer::from_vec(triangles)).unwrap();
    if smooth {
        surface = surface.with_normals(normals.into()).unwrap();
    }
    Shape::new(surface, Appearance::new("surface").with("lightdir", DVec3::new(0.3, -1.0, 0.5)))
}

/// A mesh with a volume in it, one that carries numbers, and a surface.
pub fn of_every_kind() -> Vec<Shape> {
    let sphere = Sphere::new(DVec3::new(4.0, 3.6, 4.4), 2.3, 6).unwrap();
    vec![of(a_tube(), "lut"), field(bars()), skin(&sphere, true)]
}

#[test]
fn surfaces_end_what_lies_behind_them() {
    let sphere = Sphere::new(DVec3::new(4.0, 3.6, 4.4), 2.3, 6).unwrap();
    for desc in [view(), near()] {
        for smooth in [false, true] {
            let shape = skin(&sphere, smooth);
            agree("alone", from_ref(&shape), &desc);
            shape.set_transform(DAffine3::from_scale(DVec3::new(1.0, 1.2, 0.8)) * DAffine3::from_rotation_z(0.3));
            agree("turned", from_ref(&shape), &desc);
            let hole = ClipRegion::crop(Aabb::new(DVec3::splat(-9.0), DVec3::new(5.0, 3.0, 9.0))).cut();
            shape.set_clip(Clip::new([hole]));
            let haze = lut_of(&a_ball(), colors(&[(0.0, [0.0, 0.2, 0.5], 0.0), (9.0, [1.0; 3], 0.05)]), 2.0);
            agree("cut, in a haze", &[shape, haze, of(bars(), "mip"), of(a_tube(), "lut")], &desc);
        }
    }
    let lit = skin(&a_tube(), false).state().geometry.as_surface().unwrap().clone();
    let shape = Shape::new(lit, Appearance::new("surface").with("ambient", 0.1));
    agree("by the eye's light", &[shape], &near());
}
