//! What meshes tell a shader's source: numbers of vertices, and volumes that are deformed.

use volact_core::{
    Aabb, Appearance, Block, Compositing, LookupTable, ParameterType, Points, Shape, VolumeTexture,
    glam::{DAffine3, DVec3},
};
use volact_cpu::reference::{Classification, Method, ReferenceOptions};

use super::{
    common::{along_z, point, table, volume_of},
    mesh_common::{Parts, attribute, cube, field, grid, views},
    source_common::{alike, draw, evaluated, is, registry, shader, told, try_draw},
};

fn layers() -> LookupTable {
    table(&[
        point(0.1, [0.0, 0.2, 0.9], 0.0),
        point(0.3, [0.9, 0.2, 0.1], 0.6),
        point(0.5, [0.2, 0.8, 0.3], 0.05),
        point(0.9, [0.7, 0.7, 0.2], 0.99),
    ])
}

/// A texture that fills the unit cube.
fn hills() -> VolumeTexture {
    let made =
        volume_of([5, 4, 6], |[x, y, z]| 0.5 + 0.5 * (1.3 * x as f64 + 2.1 * y as f64 + 0.7 * (z * z) as f64).sin());
    VolumeTexture::new(&made).with_geometry_roi(Aabb::new(DVec3::ZERO, DVec3::ONE)).unwrap()
}

/// A bent mesh that carries the unit cube's volume.
fn deformed(parts: &Parts) -> volact_core::Mesh {
    let coordinates: Points = parts.points.clone().into();
    let bend = |p: DVec3| DVec3::new(p.x + 0.3 * p.y * p.z, 0.8 * p.y - 0.2 * p.x * p.x, p.z + 0.1 * p.x);
    parts.moved(bend).mesh().with_texture_coordinates(coordinates).unwrap()
}

fn ways() -> Vec<ReferenceOptions> {
    let rays = ReferenceOptions { method: Method::Rays, sample_distance: 0.03, ..ReferenceOptions::default() };
    let ends = ReferenceOptions { classification: Classification::PreIntegrated, ..rays };
    vec![ReferenceOptions::default(), rays, ends]
}

#[test]
fn numbers_of_vertices_are_those_of_tables() {
    let all = registry(&[]);
    let f = |p: DVec3| 0.5 + 0.4 * (5.0 * p.x + 3.0 * p.y - 4.0 * p.z).sin();
    for parts in [cube(24), grid(3, 0.35, 1)] {
        let plain = field(&parts, f, layers(), 0.3);
        let other = plain.named("other");
        other.set_parameter("opacity_scalars", attribute(parts.points.iter().map(|p| p.x * p.y).collect()));
        other.set_parameter("opacity_table", table(&[point(0.0, [0.0; 3], 0.7), point(0.6, [0.0; 3], 0.1)]));
        for (shape, frame) in [&plain, &other].into_iter().flat_map(|s| [0, 5].map(|i| (s, views()[i].clone()))) {
            for options in &ways()[..2] {
                let wanted = draw(&all, std::slice::from_ref(shape), &frame, options);
                let evaluated = ReferenceOptions { recognise: false, ..*options };
                let found = draw(&all, std::slice::from_ref(shape), &frame, &evaluated);
                assert!(found.estimated.len() == 1 && wanted.estimated.is_empty());
                alike(&found.color, &wanted.color, 3e-9);
            }
        }
    }
}

#[test]
fn deformed_volumes_are_those_of_tables() {
    let all = registry(&[]);
    for (i, name) in ["lut", "mip", "average", "xray"].into_iter().enumerate() {
        let look = Appearance::new(name).with("volume", hills()).with("lookup_table", layers());
        let look = if name == "mip" || name == "average" { look } else { look.with("unit_distance", 0.3) };
        for parts in [cube(24), grid(3, 0.35, 1)] {
            let shape = Shape::new(deformed(&parts), look.clone());
            let frame = views()[[0, 5][i % 2]].clone();
            for options in ways().iter().filter(|o| name != "lut" || o.classification == Classification::Post) {
                let wanted = draw(&all, std::slice::from_ref(&shape), &frame, options);
                let evaluated = ReferenceOptions { recognise: false, ..*options };
                let found = draw(&all, std::slice::from_ref(&shape), &frame, &evaluated);
                alike(&found.color, &wanted.color, 3e-9);
                assert!(wanted.color.iter().any(|c| c[3] > 0.1));
            }
        }
    }
}

/// A map that is affine throughout is a transform: everything that a source asks for is the same.
#[test]
fn an_affine_mesh_is_a_transformed_block() {
    let text = "fn shade(s: Sample) -> Medium {
        let inside = select(0.0, 1.0, volume_inside(s.position));
        let c = volume_coordinates(s.position) + volume_gradient(s.position + vec3(0.05, 0.0, 0.02));
        return Medium(c, inside * (1.0 + 2.0 * volume_nearest(s.position) + volume_normalized(s.position)));
    }";
    let all = registry(&[shader("probe", Compositing::Over, &[("volume", ParameterType::Volume)], text)]);
    let map = DAffine3::from_translation(DVec3::new(0.2, -0.1, 0.3))
        * DAffine3::from_rotation_y(0.3)
        * DAffine3::from_scale(DVec3::new(0.9, 0.6, 1.1));
    let look = Appearance::new("probe").with("volume", hills());
    let block = Shape::new(Block::from(Aabb::new(DVec3::ZERO, DVec3::ONE)), look.clone());
    block.set_transform(map);
    let parts = cube(6);
    let coordinates: Points = parts.points.clone().into();
    let mesh = parts.moved(|p| map.transform_point3(p)).mesh().with_texture_coordinates(coordinates).unwrap();
    let mesh = Shape::new(mesh, look);
    for options in [evaluated(), ReferenceOptions { method: Method::Rays, sample_distance: 0.05, ..evaluated() }] {
        for frame in [&views()[0], &views()[5]] {
            let wanted = draw(&all, std::slice::from_ref(&block), frame, &options);
            let found = draw(&all, std::slice::from_ref(&mesh), frame, &options);
            alike(&found.color, &wanted.color, if options.method == Method::Exact { 1e-8 } else { 1e-9 });
            assert!(wanted.color.iter().any(|c| c[3] > 0.5));
        }
    }
}

#[test]
fn surfaces_of_numbers_of_vertices_are_planes() {
    let text = "fn value(s: Sample) -> f32 { return height(s); }
        fn shade(s: Sample) -> Medium { return Medium(vec3(s.depth, height(s), height_components(s).x), surfaces_color(s.value).a); }";
    let types = [("height", ParameterType::Attribute), ("surfaces", ParameterType::Table)];
    let all = registry(&[shader("level", Compositing::First, &types, text)]);
    let parts = grid(3, 0.35, 1);
    let height = |p: DVec3| p.z + 0.5 * p.x;
    let look = Appearance::new("level")
        .with("height", attribute(parts.points.iter().map(|p| height(*p)).collect()))
        .with("surfaces", table(&[point(0.4, [1.0; 3], 0.5), point(0.9, [1.0; 3], 1.0)]));
    let shape = Shape::new(parts.mesh(), look);
    // z = v − x/2 with x = 0.31; the eye is at −3.
    let depth = |v: f64| 3.0 + v - 0.155;
    let truth = [0.5 * depth(0.4) + 0.5 * depth(0.9), 0.5 * 0.4 + 0.5 * 0.9, 0.65, 1.0];
    for options in [evaluated(), ReferenceOptions { method: Method::Rays, sample_distance: 0.02, ..evaluated() }] {
        is(&draw(&all, std::slice::from_ref(&shape), &along_z(0.31, 0.47), &options), truth, 1e-9);
    }
}

#[test]
fn numbers_that_are_not_there_are_refused() {
    let text = "fn shade(s: Sample) -> Medium { return Medium(vec3(1.0), height(s)); }";
    let types = [("height", ParameterType::Attribute), ("component", ParameterType::Int)];
    let all = registry(&[shader("level", Compositing::Over, &types, text)]);
    let parts = cube(6);
    let look = |count: usize, component: i64| {
        Appearance::new("level").with("height", attribute(vec![1.0; count])).with("component", component)
    };
    let error = |shape: Shape| told(&try_draw(&all, &[shape], &along_z(0.31, 0.47), &evaluated()).unwrap_err());
    let missing = error(Shape::new(parts.mesh(), look(8, 3)));
    assert!(missing.contains("component 3") && missing.contains("with 1"), "{missing}");
    let few = error(Shape::new(parts.mesh(), look(7, 0)));
    assert!(few.contains("7 vertices") && few.contains('8'), "{few}");
    let alpha = -(-1.0f64).exp_m1();
    is(&draw(&all, &[Shape::new(parts.mesh(), look(8, 0))], &along_z(0.31, 0.47), &evaluated()), [alpha; 4], 1e-10);
}
