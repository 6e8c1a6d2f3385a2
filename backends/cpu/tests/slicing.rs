//! What a backend would draw with core's slices, pixel by pixel in f64, held to `reference` on planes.

use volact_core::{
    Aabb, Appearance, Clip, ControlPoint, FrameDesc, LookupTable, Mesh, Points, Ray, Registry, Roi, ScalarType, Shape,
    Volume, VolumeDesc, VolumeTexture,
    camera::{Camera, Projection},
    geometry::{CellType, CellTypes, ClipRegion, Plane, Spans},
    glam::{DAffine3, DVec2, DVec3},
    resolve::ResolvedShape,
    slicing::{Body, Levels, Order, Polygons, Rate, Sampling, SamplingMode, Slice, Slicing, Solid},
};
use volact_cpu::reference::{Method, ReferenceOptions, integrate};

const UNIT: f64 = 0.7;

fn table() -> LookupTable {
    let point = |value, color, opacity| ControlPoint { value, color, opacity };
    LookupTable::from_points(vec![
        point(0.0, [0.1, 0.5, 0.9], 0.02),
        point(0.6, [0.9, 0.4, 0.2], 0.3),
        point(1.0, [1.0, 0.9, 0.1], 0.5),
    ])
    .unwrap()
}

fn data() -> Volume {
    let n = 7;
    let place = |i: usize| [i % n, i / n % n, i / n / n].map(|v| v as f64);
    let value = |[x, y, z]: [f64; 3]| 0.5 + 0.3 * (0.8 * x).sin() * (0.6 * y).cos() + 0.15 * (0.9 * z + 0.4 * x).sin();
    let voxels: Vec<f64> = (0..n * n * n).map(|i| value(place(i))).collect();
    Volume::new(VolumeDesc::new([n; 3], ScalarType::F64, 1), voxels).unwrap()
}

fn appearance() -> Appearance {
    Appearance::new("lut").with("lookup_table", table()).with("unit_distance", UNIT)
}

fn block() -> Shape {
    let shape = Shape::around(&data(), appearance());
    shape.set_transform(
        DAffine3::from_rotation_y(0.4)
            * DAffine3::from_scale(DVec3::new(1.2, -0.7, 0.9))
            * DAffine3::from_rotation_z(0.3),
    );
    shape
}

/// Colour and extinction of a shape at a point of the world.
fn medium(texture: &VolumeTexture, solid: &Solid, point: DVec3) -> ([f64; 3], f64) {
    let index = texture.object_to_index().transform_point3(solid.to_object().transform_point3(point));
    let value = texture.sample(index, 0);
    let [r, g, b, a] = table().resolve([0.0, 1.0]).classify(value);
    ([r, g, b], -(-a).ln_1p() / UNIT)
}

/// A pixel: premultiplied colour and what is left of the light.
#[derive(Clone, Copy)]
struct Light {
    color: [f64; 3],
    left: f64,
}

impl Light {
    fn add(&mut self, (color, sigma): ([f64; 3], f64), length: f64) {
        let through = (-sigma * length).exp();
        (0..3).for_each(|c| self.color[c] += self.left * (1.0 - through) * color[c]);
        self.left *= through;
    }
}

/// Whether a convex polygon covers a point, with one rule for both sides of an edge.
fn covers(corners: &[DVec2], point: DVec2) -> bool {
    let mut inside = false;
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        let [low, high] = if (a.y, a.x) <= (b.y, b.x) { [a, b] } else { [b, a] };
        if (low.y <= point.y) != (high.y <= point.y) && (high - low).perp_dot(point - low) > 0.0 {
            inside = !inside;
        }
    }
    inside
}

/// The stretches of a ray that a fragment of a block's slab stands for.
fn stretches(slice: &Slice<'_>, solid: &Solid, frame: &FrameDesc, ray: &Ray) -> Spans {
    let Body::Block(block) = solid.body() else { panic!("a block") };
    let to = solid.to_object();
    let (origin, direction) = (to.transform_point3(ray.origin), to.transform_vector3(ray.direction));
    let Some([a, b]) = block.clip_line(origin, direction) else { return Spans::EMPTY };
    let mut spans = Spans::one(a.max(ray.near), b.min(ray.far));
    solid.clip().apply(origin, direction, &mut spans);
    frame.clip.apply(ray.origin, ray.direction, &mut spans);
    if let Some([a, b]) = slice.levels().cut(ray, slice.slab) {
        spans.keep(a, b);
    }
    spans
}

fn resolve(shapes: &[Shape]) -> Vec<ResolvedShape> {
    let registry = Registry::with_core();
    shapes.iter().map(|s| ResolvedShape::new(s, registry.shaders()).unwrap()).collect()
}

/// The picture of core's slices.
fn sliced(shapes: &[Shape], frame: &FrameDesc, sampling: &Sampling) -> Vec<[f64; 4]> {
    let resolved = resolve(shapes);
    let solids: Vec<Solid> = resolved.iter().map(|s| Solid::new(s, None).unwrap().unwrap()).collect();
    let slicing = Slicing::new(solids.iter().collect(), frame, sampling).unwrap();
    let rays = frame.camera.rays(&frame.viewport()).unwrap();
    let mut picture = vec![Light { color: [0.0; 3], left: 1.0 }; frame.width * frame.height];
    let (mut sweep, mut hull, mut polygons) = (slicing.sweep(Order::FrontToBack), Vec::new(), Polygons::new());
    while let Some(mut slice) = sweep.next_slice() {
        let (solid, texture) = (&solids[slice.shape], resolved[slice.shape].first_volume().unwrap());
        let step = slicing.slabs(slice.shape).step;
        let outlines: Vec<(Vec<DVec2>, DVec3, DVec3)> = if slice.is_block() {
            slice.hull(&mut hull);
            vec![(hull.clone(), DVec3::ZERO, DVec3::ZERO)]
        } else {
            slice.polygons(&mut polygons);
            let pixel = |p: DVec3| slicing.pixel_map().pixel(p).unwrap();
            let of = |f| {
                (
                    polygons.vertices(f).map(|v| pixel(v.position)).collect(),
                    polygons.vertex(f.first).position,
                    f.gradient,
                )
            };
            polygons.faces().iter().map(of).collect()
        };
        for (i, light) in picture.iter_mut().enumerate() {
            let center = DVec2::new((i % frame.width) as f64 + 0.5, (i / frame.width) as f64 + 0.5);
            let ray = rays.ray(center.x, center.y);
            for (outline, on, gradient) in outlines.iter().filter(|o| covers(&o.0, center)) {
                if slice.is_block() {
                    for [a, b] in stretches(&slice, solid, frame, &ray).as_slice() {
                        light.add(medium(texture, solid, ray.at(a.midpoint(*b))), b - a);
                    }
                } else {
                    let t = gradient.dot(*on - ray.origin) / gradient.dot(ray.direction);
                    let length = Levels::length(step, *gradient, ray.direction);
                    light.add(medium(texture, solid, ray.at(t)), length);
                }
                assert!(outline.len() >= 3);
            }
        }
    }
    picture.into_iter().map(|l| [l.color[0], l.color[1], l.color[2], 1.0 - l.left]).collect()
}

fn reference(shapes: &[Shape], frame: &FrameDesc, method: Method, step: f64) -> Vec<[f64; 4]> {
    let options = ReferenceOptions { method, sample_distance: step, ..ReferenceOptions::default() };
    integrate(&resolve(shapes), frame, &options).unwrap().color
}

fn worst(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn mean_square(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    let sum: f64 = a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).powi(2)).sum();
    (sum / a.len() as f64).sqrt()
}

fn at(step: f64, mode: SamplingMode) -> Sampling {
    Sampling { mode, rate: Rate::Distance(step), ..Sampling::default() }
}

fn views() -> Vec<FrameDesc> {
    let target = block().state().world_bounds().center();
    let eye = target + DVec3::new(7.0, -9.0, 5.0);
    let with = |near, far, fov_y| Camera::LookAt {
        eye,
        target,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y },
        near,
        far,
    };
    vec![
        FrameDesc::new(with(0.0, f64::INFINITY, 45.0), 14, 12),
        FrameDesc::new(with(11.0, 13.5, 45.0), 14, 12),
        FrameDesc::new(Camera::orthographic(eye, target, DVec3::Z, 8.0), 14, 12),
        // From within.
        FrameDesc::new(Camera::perspective(target, target + DVec3::X, DVec3::Z, 80.0), 14, 12),
    ]
}

/// A slice stands for a slab: blocks are ray casting on planes, and on shells ray casting along rays, to
/// rounding, with near and far planes, clips of both kinds, and an eye inside.
#[test]
fn blocks_are_ray_casting_to_rounding() {
    let plane = |p: [f64; 3], n: [f64; 3]| Plane::new(p.into(), n.into()).unwrap();
    let inner = Aabb::new(DVec3::splat(2.0), DVec3::new(4.5, 3.5, 5.0));
    for frame in views() {
        let frame = frame.with_clip(Clip::new([ClipRegion::plane(plane([0.0, 0.0, 4.0], [0.3, 0.1, -1.0]))]));
        for clip in [Clip::NONE, Clip::new([ClipRegion::crop(inner).cut()])] {
            let shape = block();
            shape.set_clip(clip);
            let shapes = [shape];
            for step in [0.31, 2.7] {
                let planes = reference(&shapes, &frame, Method::Planes, step);
                let error = worst(&sliced(&shapes, &frame, &at(step, SamplingMode::Auto)), &planes);
                assert!(error < 1e-9, "planes, {step}: {error:e}");
                assert!(planes.iter().any(|p| p[3] > 0.3));
                let rays = reference(&shapes, &frame, Method::Rays, step);
                let error = worst(&sliced(&shapes, &frame, &at(step, SamplingMode::SphericalShells)), &rays);
                let parallel = frame.camera.rays(&frame.viewport()).unwrap().eye().is_none();
                assert!(error < 1e-9, "shells, {step}, parallel {parallel}: {error:e}");
            }
        }
    }
}

/// The slope of the error from one step to an eighth of it.
fn slope(shapes: &[Shape], frame: &FrameDesc, mode: SamplingMode, steps: [f64; 2]) -> f64 {
    let exact = reference(shapes, frame, Method::Exact, 0.0);
    let error = |step: f64| mean_square(&sliced(shapes, frame, &at(step, mode)), &exact);
    (error(steps[0]) / error(steps[1])).log2() / (steps[0] / steps[1]).log2()
}

#[test]
fn blocks_are_of_second_order_in_every_mode() {
    for mode in [SamplingMode::ViewportAligned, SamplingMode::AxisAligned, SamplingMode::SphericalShells] {
        let order = slope(&[block()], &views()[0], mode, [0.4, 0.05]);
        assert!((1.8..2.25).contains(&order), "{mode:?}: {order}");
    }
}

/// Slabs of shapes that overlap alternate, which keeps second order.
#[test]
fn overlapping_blocks_are_of_second_order() {
    let other = block();
    other.set_transform(DAffine3::from_translation(DVec3::new(0.9, -0.6, 0.5)) * other.state().transform);
    let order = slope(&[block(), other], &views()[0], SamplingMode::Auto, [0.2, 0.025]);
    assert!((1.7..2.4).contains(&order), "{order}");
}

/// Bricks that a user cut agree with the whole to second order, in absolute terms far below it.
#[test]
fn bricks_have_no_seam() {
    let (data, whole) = (data(), block());
    let brick = |i: usize| {
        let min = [0, 1, 2].map(|a| 3 * (i >> a & 1));
        let texture = VolumeTexture::new(&data).with_data_roi(Roi { min, max: min.map(|v| v + 3) }).unwrap();
        let shape = Shape::around_texture(&texture, appearance());
        shape.set_transform(whole.state().transform);
        shape
    };
    let bricks: Vec<Shape> = (0..8).map(brick).collect();
    let frame = &views()[0];
    let difference = |step: f64| {
        let one = sliced(std::slice::from_ref(&whole), frame, &at(step, SamplingMode::Auto));
        worst(&one, &sliced(&bricks, frame, &at(step, SamplingMode::Auto)))
    };
    let [coarse, fine] = [0.5, 0.0625].map(difference);
    assert!(coarse < 4e-3 && fine < coarse / 30.0, "{coarse:e} {fine:e}");
}

/// A mesh that carries the volume: hexahedra around a hole.
fn ring() -> Shape {
    let (n, mut cells) = (16u32, Vec::new());
    let rim = [[1.2, 1.0], [2.8, 1.0], [1.2, 4.8], [2.8, 4.8]];
    let place = |i: u32| {
        let turn = DVec2::from_angle(std::f64::consts::TAU * f64::from(i / 4) / f64::from(n));
        (turn * rim[i as usize % 4][0] + 3.0).extend(rim[i as usize % 4][1])
    };
    for i in 0..n {
        let (a, b) = (4 * i, 4 * ((i + 1) % n));
        cells.extend([a, a + 1, b + 1, b, a + 2, a + 3, b + 3, b + 2]);
    }
    let points: Points = (0..4 * n).map(place).collect();
    let mesh = Mesh::new(points, CellTypes::All(CellType::Hexahedron), volact_core::Buffer::from_vec(cells)).unwrap();
    let shape = Shape::new(mesh, appearance().with("volume", &data()));
    shape.set_transform(block().state().transform);
    shape
}

/// At the faces of a mesh slicing cannot cut: first order there, second within.
#[test]
fn meshes_are_of_first_order_at_their_faces() {
    for mode in [SamplingMode::ViewportAligned, SamplingMode::AxisAligned, SamplingMode::SphericalShells] {
        for frame in [&views()[0], &views()[2]] {
            let order = slope(&[ring()], frame, mode, [0.2, 0.0125]);
            assert!((0.8..1.5).contains(&order), "{mode:?}: {order}");
        }
    }
    // A bound: half a slab at each of up to eight faces on a ray, of the greatest extinction.
    let (frame, step) = (&views()[0], 0.02);
    let planes = reference(&[ring()], frame, Method::Planes, step);
    let error = worst(&sliced(&[ring()], frame, &at(step, SamplingMode::Auto)), &planes);
    let sigma = -(0.5f64).ln() / UNIT;
    assert!(error < 8.0 * 0.5 * step / 0.9 * sigma, "{error}");
}
