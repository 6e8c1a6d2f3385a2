//! Colour and depth of an application, and everything at once.

use std::sync::Arc;

use volact_core::{
    Appearance, Buffer, Camera, Clip, FrameDesc, Opaque, OpaqueDepth, Plane, Shape, SliceStyle, Sliced, Slices,
    Surface, Viewport,
    camera::DepthRange,
    geometry::ClipRegion,
    glam::{DAffine3, DMat4, DVec3, DVec4, dcamera::rh},
};

use super::common::{along_z, certify, lut, picture, point, table, volume_of};

const GOLD: [f32; 4] = [0.75, 0.5, 0.25, 1.0];

/// A blue slab of 4³ that lets 0.7 through a unit of length.
fn slab() -> Shape {
    lut(&volume_of([5; 3], |_| 0.0), table(&[point(0.0, [0.0, 0.0, 1.0], 0.3)]), 1.0)
}

fn drawn(color: Option<[f32; 4]>, depth: f32, pixels: usize) -> Opaque {
    Opaque { color: color.map(|c| vec![c; pixels].into()), depth: OpaqueDepth::Distance(vec![depth; pixels].into()) }
}

#[test]
fn volume_lies_before_and_around_what_was_drawn() {
    // The eye's plane is at −3, the slab from 0 to 4.
    for (depth, before) in [(2.0, 0.0), (3.0, 0.0), (4.5, 1.5), (7.0, 4.0), (9.0, 4.0), (f32::INFINITY, 4.0)] {
        let left = 0.7f64.powf(before);
        let frame = along_z(0.3, 0.4).with_opaque(drawn(Some(GOLD), depth, 1));
        certify(&[slab()], &frame, [left * 0.75, left * 0.5, 1.0 - left + left * 0.25, 1.0]);
        let alone = along_z(0.3, 0.4).with_opaque(drawn(None, depth, 1));
        certify(&[slab()], &alone, [0.0, 0.0, 1.0 - left, 1.0 - left]);
    }
    // Nothing else drawn: the application's picture as it is, translucent and all.
    let glass = [0.25, 0.125, 0.0, 0.5];
    certify(&[], &along_z(0.3, 0.4).with_opaque(drawn(Some(glass), 4.0, 1)), [0.25, 0.125, 0.0, 0.5]);
}

#[test]
fn translucent_colours_end_the_ray_all_the_same() {
    let left = 0.7f64.powf(1.5);
    let frame = along_z(0.3, 0.4).with_opaque(drawn(Some([0.25, 0.0, 0.0, 0.5]), 4.5, 1));
    let alpha = 1.0 - 0.5 * left;
    certify(&[slab()], &frame, [0.25 * left, 0.0, 1.0 - left, alpha]);
    // Light without opacity is added.
    let glow = along_z(0.3, 0.4).with_opaque(drawn(Some([2.0, 0.0, 0.0, 0.0]), 4.5, 1));
    certify(&[slab()], &glow, [2.0 * left, 0.0, 1.0 - left, 1.0 - left]);
}

#[test]
fn depth_of_the_frame_counts_what_was_drawn() {
    let depth = |opaque: Opaque, threshold: f32| {
        let mut frame = along_z(0.3, 0.4).with_opaque(opaque);
        frame.depth_threshold = threshold;
        picture(&[slab()], &frame).depth[0]
    };
    assert!((depth(drawn(Some(GOLD), 4.5, 1), 0.9) - 4.5).abs() < 1e-14);
    assert_eq!(depth(drawn(None, 4.5, 1), 0.9), f64::INFINITY);
    assert_eq!(depth(drawn(Some(GOLD), f32::INFINITY, 1), 0.9), f64::INFINITY);
    assert!((depth(drawn(Some(GOLD), 4.5, 1), 0.25) - (3.0 + 0.75f64.ln() / 0.7f64.ln())).abs() < 1e-9);
}

#[test]
fn pictures_of_one_value_end_there() {
    let data = volume_of([2, 2, 5], |[_, _, z]| z as f64);
    let grey = || table(&[point(0.0, [0.0; 3], 0.5), point(4.0, [1.0; 3], 0.5)]);
    let look = |shader: &str| Appearance::new(shader).with("lookup_table", grey()).with("unit_distance", 4.0);
    for (shader, value) in [("mip", 2.5), ("minip", 0.0), ("average", 1.25), ("xray", 3.125 / 4.0)] {
        let frame = along_z(0.3, 0.4).with_opaque(drawn(None, 5.5, 1));
        let level = 0.5 * value / 4.0;
        certify(&[Shape::around(&data, look(shader))], &frame, [level, level, level, 0.5]);
    }
}

/// Distances and depth buffers of three projections, one off-axis, mean the same.
#[test]
fn depth_buffers_and_distances_give_the_same_picture() {
    let view = rh::view::look_at_mat4(DVec3::new(9.0, -7.0, 6.0), DVec3::splat(2.0), DVec3::Z);
    let off_axis = DMat4::from_translation(DVec3::new(0.15, -0.1, 0.0));
    for (projection, range) in [
        (rh::proj::directx::perspective(0.6, 1.25, 1.0, 60.0), DepthRange::ZeroToOne),
        (off_axis * rh::proj::opengl::perspective(0.6, 1.25, 1.0, 60.0), DepthRange::MinusOneToOne),
        (rh::proj::directx::orthographic(-4.0, 4.0, -3.2, 3.2, 0.5, 40.0), DepthRange::ZeroToOne),
    ] {
        let camera = Camera::Matrices { view, projection, depth: range };
        let mut frame = FrameDesc::new(camera, 12, 10);
        frame.viewport = Some(Viewport { x: 1, y: 2, width: 10, height: 8 });
        let grid = camera.rays(&frame.viewport()).unwrap();
        let clip = projection * view;
        // A tilted wall through the slab, as its depth and as its distance.
        let wall = Plane::new(DVec3::splat(2.0), DVec3::new(0.4, -1.0, 0.3)).unwrap();
        let (mut buffer, mut distance) = (vec![1f32; 120], vec![f32::INFINITY; 120]);
        for y in 0..8 {
            for x in 0..10 {
                let ray = grid.ray(x as f64 + 0.5, y as f64 + 0.5);
                let t = wall.meets(ray.origin, ray.direction).unwrap();
                let p = clip * DVec4::from((ray.at(t), 1.0));
                let at = (y + 2) * 12 + x + 1;
                buffer[at] = (p.z / p.w) as f32;
                distance[at] = (t - ray.depth_zero) as f32;
            }
        }
        let color: Option<Arc<[[f32; 4]]>> = Some(vec![GOLD; 120].into());
        let as_buffer = Opaque {
            color: color.clone(),
            depth: OpaqueDepth::Buffer { values: buffer.into(), range, world_to_clip: clip },
        };
        let as_distance = Opaque { color, depth: OpaqueDepth::Distance(distance.into()) };
        let [a, b] = [as_buffer, as_distance].map(|o| picture(&[slab()], &frame.clone().with_opaque(o)));
        assert_eq!((a.not_certified, b.not_certified), (0, 0));
        assert!(a.color.iter().any(|c| c[2] > 0.4 && c[0] > 0.1));
        for (a, b) in a.color.iter().flatten().zip(b.color.iter().flatten()) {
            // A depth buffer in f32 has steps of up to 1e-4 here.
            assert!((a - b).abs() < 2e-4, "{a} {b}");
        }
    }
}

/// All that there is, drawn in every order: the same bits.
#[test]
fn order_of_drawing_changes_no_bit() {
    let shapes = everything();
    let frame = scene();
    let first = picture(&shapes, &frame);
    assert_eq!(first.not_certified, 0, "widest {:e}", first.widest);
    for turn in 1..shapes.len() {
        let mut other = shapes.clone();
        other.rotate_left(turn);
        other.swap(0, 2);
        assert_eq!(picture(&other, &frame), first, "turned by {turn}");
    }
}

fn everything() -> Vec<Shape> {
    let hills = |seed: f64| {
        let data = volume_of([5; 3], |[x, y, z]| {
            0.5 + 0.5 * (seed + 1.3 * x as f64 + 2.1 * y as f64 + 0.7 * (z * z) as f64).sin()
        });
        let look = table(&[
            point(0.1, [0.0, 0.2, 0.9], 0.0),
            point(0.6, [0.9, 0.2, 0.1], 0.5),
            point(0.9, [0.7, 0.7, 0.2], 0.9),
        ]);
        lut(&data, look, 0.9)
    };
    let (coincident, turned, cut) = (hills(1.0), hills(2.0), hills(3.0));
    turned.set_transform(DAffine3::from_translation(DVec3::new(0.7, -0.5, 1.1)) * DAffine3::from_rotation_z(0.4));
    cut.set_clip(
        Clip::NONE.with(ClipRegion::plane(Plane::new(DVec3::splat(2.0), DVec3::new(1.0, 0.2, 0.1)).unwrap()).cut()),
    );
    let planes = vec![Plane::new(DVec3::splat(1.5), DVec3::new(0.2, 0.1, 1.0)).unwrap()];
    let sliced = hills(4.0);
    let slices = |volume| Slices { planes: planes.clone(), style: SliceStyle::Blended, volume };
    sliced.set_geometry(Sliced::new(sliced.state().geometry, slices(true)).unwrap());
    let again = hills(5.0);
    again.set_geometry(Sliced::new(again.state().geometry, slices(false)).unwrap());
    let wall = |color: f64| {
        let corners = vec![DVec3::new(-9.0, 3.1, -9.0), DVec3::new(9.0, 3.6, -9.0), DVec3::new(0.0, 3.3, 14.0)];
        let surface = Surface::new(corners.into(), Buffer::from_vec(vec![[0u32, 1, 2]])).unwrap();
        let color = volact_core::ParameterValue::Color([color, 0.5, 0.5, 1.0]);
        Shape::new(surface, Appearance::new("surface").with("color", color))
    };
    vec![hills(0.0), coincident, turned, cut, sliced, again, wall(0.2), wall(0.9)]
}

fn scene() -> FrameDesc {
    let camera = Camera::perspective(DVec3::new(7.0, -9.0, 6.0), DVec3::splat(2.0), DVec3::Z, 35.0);
    let clip = Clip::NONE.with(ClipRegion::plane(Plane::new(DVec3::new(2.0, 2.0, 3.7), -DVec3::Z).unwrap()));
    let depth = (0..120).map(|i| if i % 3 == 0 { f32::INFINITY } else { 11.0 + 0.01 * i as f32 }).collect::<Vec<_>>();
    let opaque = Opaque { color: Some(vec![GOLD; 120].into()), depth: OpaqueDepth::Distance(depth.into()) };
    FrameDesc::new(camera, 12, 10).with_clip(clip).with_opaque(opaque)
}
