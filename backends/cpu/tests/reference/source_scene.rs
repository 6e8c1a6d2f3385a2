//! Shapes with a shader's source among others: overlaps, clips, meshes, slices, opaque things.

use volact_core::{
    Appearance, Block, Camera, Clip, Compositing, FrameDesc, Opaque, OpaqueDepth, ParameterType, Plane, Shape,
    SliceStyle, Sliced, Slices, Volume,
    geometry::ClipRegion,
    glam::{DAffine3, DVec3},
};
use volact_cpu::reference::{Method, ReferenceOptions};

use super::{
    common::{along_z, lut, point, table, volume_of},
    mesh_common::cube,
    source_common::{alike, block, draw, evaluated, is, lattice, registry, shader},
};

const OWN: &str = "fn shade(s: Sample) -> Medium { return lookup_table(volume(s.position) + 0.0 * s.depth); }";

fn all() -> volact_core::Registry {
    let types = [
        ("volume", ParameterType::Volume),
        ("lookup_table", ParameterType::Table),
        ("unit_distance", ParameterType::Float),
    ];
    let fog = "fn shade(s: Sample) -> Medium { return Medium(vec3(red(), 1.0, s.position.z), density()); }";
    let fog =
        shader("fog", Compositing::Over, &[("red", ParameterType::Float), ("density", ParameterType::Float)], fog);
    registry(&[shader("own", Compositing::Over, &types, OWN), fog])
}

fn data() -> Volume {
    volume_of([4, 4, 5], |[x, y, z]| ((x * 7 + y * 5 + z * 3) as f64 * 0.7).sin())
}

fn points() -> Vec<volact_core::ControlPoint> {
    vec![point(-1.0, [0.1, 0.2, 0.9], 0.0), point(0.2, [0.9, 0.2, 0.1], 0.5), point(1.0, [1.0; 3], 0.1)]
}

fn own(shape: &Shape) -> Shape {
    let other = shape.named("own");
    other.set_shader("own");
    other
}

fn views() -> [FrameDesc; 2] {
    let (eye, target) = (DVec3::new(7.0, -6.0, 9.0), DVec3::new(1.5, 1.5, 2.0));
    [
        FrameDesc::new(Camera::perspective(eye, target, DVec3::Z, 30.0), 5, 5),
        FrameDesc::new(Camera::orthographic(eye, target, DVec3::Z, 5.0), 5, 5),
    ]
}

#[test]
fn sources_mix_with_each_other_and_with_tables() {
    let (a, b) = (lut(&data(), table(&points()), 0.7), lut(&data(), table(&points()), 1.3));
    b.set_transform(DAffine3::from_translation(DVec3::new(0.7, -0.4, 0.9)) * DAffine3::from_rotation_x(0.4));
    let all = all();
    for frame in views() {
        let wanted = draw(&all, &[a.clone(), b.clone()], &frame, &ReferenceOptions::default());
        assert_eq!(wanted.not_certified, 0);
        for shapes in [[own(&a), own(&b)], [own(&a), b.clone()], [b.clone(), own(&a)], [a.clone(), own(&b)]] {
            let found = draw(&all, &shapes, &frame, &ReferenceOptions::default());
            alike(&found.color, &wanted.color, 3e-9);
            let mut other = shapes.to_vec();
            other.reverse();
            let again = draw(&all, &other, &frame, &ReferenceOptions::default());
            assert_eq!(found.color, again.color, "the order of drawing changes bits");
            let threads = ReferenceOptions { threads: 3, ..Default::default() };
            assert_eq!(found, draw(&all, &shapes, &frame, &threads), "threads change bits");
        }
        let wanted = draw(&all, &[a.clone(), b.clone()], &frame, &ReferenceOptions { recognise: true, ..lattice(0.3) });
        let found = draw(&all, &[own(&a), b.clone()], &frame, &lattice(0.3));
        alike(&found.color, &wanted.color, 1e-11);
    }
}

#[test]
fn two_media_in_one_place_share_the_light() {
    // σ = 1 of red and σ = 3 of none, over 1: α = 1 − e⁻⁴, red a quarter of it.
    let all = all();
    let fog = |red: f64, density: f64| {
        block(DVec3::ZERO, DVec3::ONE, Appearance::new("fog").with("red", red).with("density", density))
    };
    let alpha = -(-4.0f64).exp_m1();
    // ∫ 4e^{−4s} (s − ½) ds
    let blue = (1.0 - 5.0 * (-4.0f64).exp()) / 4.0 - 0.5 * alpha;
    let made = draw(&all, &[fog(1.0, 1.0), fog(0.0, 3.0)], &along_z(0.3, 0.4), &evaluated());
    is(&made, [0.25 * alpha, alpha, blue, alpha], 1e-9);
}

#[test]
fn clips_end_sources() {
    let shape = lut(&data(), table(&points()), 0.7);
    let cut = Plane::new(DVec3::new(1.0, 1.0, 1.9), DVec3::new(0.3, -0.2, 1.0)).unwrap();
    shape.set_clip(Clip::NONE.with(ClipRegion::plane(cut)));
    let all = all();
    for frame in views() {
        let wanted = draw(&all, std::slice::from_ref(&shape), &frame, &ReferenceOptions::default());
        let found = draw(&all, &[own(&shape)], &frame, &ReferenceOptions::default());
        alike(&found.color, &wanted.color, 1e-9);
        assert!(wanted.color.iter().any(|c| c[3] > 0.1));
    }
}

/// A mesh by position with what lies in it, and slices through it and through a block.
#[test]
fn meshes_and_slices_are_those_of_tables() {
    let mesh =
        cube(2).moved(|p| DVec3::new(0.3 + 2.3 * p.x + 0.4 * p.y, 0.2 + 2.4 * p.y, 0.1 + 3.1 * p.z + p.x)).mesh();
    let block = Block::new(DVec3::ZERO, DVec3::new(3.0, 3.0, 4.0)).unwrap();
    let plane = |at: [f64; 3], n: [f64; 3]| Plane::new(DVec3::from(at), DVec3::from(n)).unwrap();
    let planes = vec![plane([1.0, 1.2, 1.4], [0.3, 0.1, 1.0]), plane([1.3, 0.0, 0.0], [1.0, 0.4, -0.2])];
    let all = all();
    for (i, style) in [None, Some(SliceStyle::Opaque), Some(SliceStyle::Blended)].into_iter().enumerate() {
        for in_block in [false, true] {
            let shape = lut(&data(), table(&points()), 0.7);
            if in_block {
                shape.set_geometry(block)
            } else {
                shape.set_geometry(mesh.clone())
            }
            if let Some(style) = style {
                let slices = Slices { planes: planes.clone(), style, volume: !in_block };
                shape.set_geometry(Sliced::new(shape.state().geometry, slices).unwrap());
            }
            for (frame, method) in
                views().into_iter().flat_map(|f| [Method::Exact, Method::Rays].map(|m| (f.clone(), m)))
            {
                let options = ReferenceOptions { method, sample_distance: 0.23, ..Default::default() };
                let wanted = draw(&all, std::slice::from_ref(&shape), &frame, &options);
                let found = draw(&all, &[own(&shape)], &frame, &options);
                alike(&found.color, &wanted.color, 2e-9);
                assert!(wanted.color.iter().any(|c| c[3] > 0.05), "{i}");
            }
        }
    }
}

#[test]
fn opaque_things_end_sources() {
    // What the application has drawn stands at 3.5 in front of the eye: half of the block.
    let all = all();
    let fog =
        block(DVec3::ZERO, DVec3::ONE, Appearance::new("fog").with("red", 0.0).with("density", std::f64::consts::LN_2));
    let mut frame = along_z(0.3, 0.4);
    let depth = OpaqueDepth::Distance(vec![3.5f32].into());
    frame.opaque = Some(Opaque { color: Some(vec![[1.0, 0.0, 0.0, 1.0]].into()), depth });
    // ∫ σ e^{−σs} (s − ½) over the first half.
    let (left, sigma) = (0.5f64.sqrt(), std::f64::consts::LN_2);
    let blue = (1.0 - left * (1.0 + 0.5 * sigma)) / sigma - 0.5 * (1.0 - left);
    let made = draw(&all, &[fog], &frame, &evaluated());
    alike(&made.color, &[[left, 1.0 - left, blue, 1.0]], 1e-9);
}
