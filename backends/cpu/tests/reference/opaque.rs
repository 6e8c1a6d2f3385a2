//! Colour and depth of an application, and everything at once.

use std::sync::Arc;

use proptest::prelude::*;
use volact_core::{
    Aabb, Appearance, Block, Buffer, Camera, Clip, FrameDesc, Opaque, OpaqueDepth, Plane, Shape, SliceStyle, Sliced,
    Slices, Surface, Viewport,
    camera::DepthRange,
    geometry::ClipRegion,
    glam::{DAffine3, DMat3, DMat4, DVec3, DVec4, dcamera::rh},
};
use volact_cpu::reference::{Method, ReferenceOptions, integrate};

use super::common::{along_z, certify, enclose, lut, one_ray, picture, point, resolve, table, volume_of};

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

/// A block of constant medium with a clip and a slice, and what a ray sees of it by the definition.
#[derive(Clone, Debug)]
struct Part {
    shape: Shape,
    color: [f64; 3],
    opacity: f64,
    bounds: Aabb,
    to_object: DAffine3,
    cut: Plane,
    keep: bool,
    slice: Plane,
}

type Numbers = ([f64; 9], [f64; 3], [f64; 6], [f64; 4], bool);

fn part((columns, offset, place, look, keep): Numbers) -> Option<Part> {
    let matrix = DMat3::from_cols_array(&columns);
    let color = [look[0], look[1], look[2]];
    let bounds = Aabb::new(DVec3::ZERO, DVec3::new(3.0, 2.0, 4.0));
    let shape = lut(&volume_of([4, 3, 5], |_| 0.0), table(&[point(0.0, color, look[3])]), 1.5);
    let transform = DAffine3::from_mat3_translation(matrix, DVec3::from(offset));
    shape.set_transform(transform);
    let [nx, ny, nz, px, py, pz] = place;
    let at = DVec3::new(px, py, pz) * bounds.size();
    let cut = Plane::new(at, DVec3::new(nx, ny, nz)).ok()?;
    let slice = Plane::new(at * 0.7, DVec3::new(nz, 0.3, nx)).ok()?;
    let region = ClipRegion::plane(cut);
    shape.set_clip(Clip::NONE.with(if keep { region } else { region.cut() }));
    let slices = Slices { planes: vec![slice], style: SliceStyle::Blended, volume: true };
    shape.set_geometry(Sliced::new(Arc::new(Block::from(bounds)), slices).unwrap());
    let good = matrix.determinant().abs() > 0.3;
    good.then(|| Part { shape, color, opacity: look[3], bounds, to_object: transform.inverse(), cut, keep, slice })
}

impl Part {
    /// The stretch that is left of a ray, and the slice's `t`.
    fn along(&self, origin: DVec3, direction: DVec3, near: f64, far: f64) -> (Option<[f64; 2]>, Option<f64>) {
        let (o, d) = (self.to_object.transform_point3(origin), self.to_object.transform_vector3(direction));
        let Some([mut a, mut b]) = self.bounds.clip_line(o, d) else { return (None, None) };
        (a, b) = (a.max(near), b.min(far));
        let t = self.cut.meets(o, d).unwrap();
        if (self.cut.normal().dot(d) > 0.0) == self.keep {
            a = a.max(t)
        } else {
            b = b.min(t)
        }
        let slice = self.slice.meets(o, d).filter(|t| a <= *t && *t <= b);
        ((a < b).then_some([a, b]), slice)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Constant media, clipped and sliced, with walls and an application's picture: between ends
    /// all is constant, so that the definition can be followed step by step.
    #[test]
    fn anything_at_all_is_what_the_definition_says(
        parts in prop::collection::vec((
            prop::array::uniform9(-1.2..1.2f64),
            prop::array::uniform3(-2.0..2.0f64),
            (prop::array::uniform3(-1.0..1.0f64), prop::array::uniform3(0.1..0.9f64)).prop_map(|(n, p)| [n[0], n[1], n[2], p[0], p[1], p[2]]),
            prop::array::uniform4(0.0..0.9f64),
            any::<bool>(),
        ), 0..4),
        walls in prop::collection::vec((-4.0..9.0f64, -0.5..0.5f64, prop::array::uniform3(0.0..1.0f64)), 0..2),
        depth in prop::option::of(3.0..14.0f32),
        lattice in any::<bool>(),
    ) {
        let parts: Vec<_> = parts.into_iter().filter_map(part).collect();
        let (from, to) = (DVec3::new(0.4, 0.9, -6.0), DVec3::new(0.7, 1.1, 2.0));
        let mut frame = one_ray(from, to);
        if let Some(depth) = depth {
            frame = frame.with_opaque(drawn(Some(GOLD), depth, 1));
        }
        let ray = frame.camera.rays(&frame.viewport()).unwrap().ray(0.5, 0.5);
        let mut shapes: Vec<_> = parts.iter().map(|p| p.shape.clone()).collect();
        // Hits: t, colour, opacity.
        let mut hits: Vec<(f64, [f64; 3], f64)> = Vec::new();
        let far = depth.map_or(f64::INFINITY, |d| f64::from(d) + ray.depth_zero);
        if depth.is_some() {
            hits.push((far, [0.75, 0.5, 0.25], 1.0));
        }
        for (height, tilt, color) in walls {
            let at = |x: f64, y: f64| DVec3::new(x, y, height + tilt * x);
            let corners = vec![at(-40.0, -40.0), at(40.0, -40.0), at(0.3, 50.0)];
            let surface = Surface::new(corners.into(), Buffer::from_vec(vec![[0u32, 1, 2]])).unwrap();
            let [r, g, b] = color;
            let paint = volact_core::ParameterValue::Color([r, g, b, 1.0]);
            shapes.push(Shape::new(surface, Appearance::new("surface").with("color", paint)));
            let normal = DVec3::new(-tilt, 0.0, 1.0).normalize();
            let t = Plane::new(at(0.0, 0.0), normal).unwrap().meets(ray.origin, ray.direction).unwrap();
            let light = 0.2 + 0.8 * normal.dot(ray.direction).abs();
            if t >= ray.near && t <= far {
                hits.push((t, color.map(|c| c * light), 1.0));
            }
        }
        let mut media = Vec::new();
        for p in &parts {
            let (stretch, slice) = p.along(ray.origin, ray.direction, ray.near, far);
            hits.extend(slice.map(|t| (t, p.color, p.opacity)));
            media.extend(stretch.map(|s| (s, p.color, -(1.0 - p.opacity).ln() / 1.5)));
        }
        hits.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut cuts: Vec<f64> = media.iter().flat_map(|m| m.0).chain(hits.iter().map(|h| h.0)).collect();
        cuts.sort_by(f64::total_cmp);
        // Rounding decides the order of what is that close.
        prop_assume!(cuts.windows(2).all(|w| w[1] - w[0] > 1e-9));
        let (mut light, mut left) = ([0.0; 3], 1.0);
        for (i, &t) in cuts.iter().enumerate() {
            if let Some((_, color, alpha)) = hits.iter().find(|h| h.0 == t) {
                (0..3).for_each(|c| light[c] += left * alpha * color[c]);
                left *= 1.0 - alpha;
            }
            let Some(&next) = cuts.get(i + 1) else { break };
            let here: Vec<_> = media.iter().filter(|m| m.0[0] <= t && next <= m.0[1]).collect();
            let sigma: f64 = here.iter().map(|m| m.2).sum();
            if sigma > 0.0 {
                let absorbed = left * -(-sigma * (next - t)).exp_m1();
                (0..3).for_each(|c| light[c] += absorbed * here.iter().map(|m| m.2 * m.1[c]).sum::<f64>() / sigma);
                left -= absorbed;
            }
        }
        let truth = [light[0], light[1], light[2], 1.0 - left];
        if lattice {
            let options = ReferenceOptions { method: Method::Rays, sample_distance: 0.7, ..ReferenceOptions::default() };
            let made = integrate(&resolve(&shapes), &frame, &options).unwrap().color[0];
            for c in 0..4 {
                prop_assert!((made[c] - truth[c]).abs() < 1e-11, "{:?} {:?}", made, truth);
            }
        } else {
            enclose(&picture(&shapes, &frame), truth, 1e-11, 1e-13);
        }
    }
}
