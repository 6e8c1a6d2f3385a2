//! Sampling modes and spaces, the order of slices, and the length of segments.

use volact_core::{
    Camera, FrameDesc, Shape,
    glam::{DAffine3, DVec2, DVec3},
    slicing::{Levels, Order, Rate, Sampling, SamplingMode, SamplingSpace, Slicing, SlicingError},
};

use super::common::{along, bent, covers, cube, from_eye, solids};

const MODES: [SamplingMode; 4] =
    [SamplingMode::Auto, SamplingMode::ViewportAligned, SamplingMode::AxisAligned, SamplingMode::SphericalShells];
const SPACES: [SamplingSpace; 3] = [SamplingSpace::ViewVolume, SamplingSpace::Object, SamplingSpace::Primitive];

fn slabs(shapes: &[Shape], frame: &FrameDesc, sampling: &Sampling, order: Order) -> Vec<(usize, i64, [f64; 2])> {
    let solids = solids(shapes);
    let slicing = Slicing::new(solids.iter().collect(), frame, sampling).unwrap();
    let (mut sweep, mut made) = (slicing.sweep(order), Vec::new());
    while let Some(slice) = sweep.next_slice() {
        made.push((slice.shape, slice.number, slice.slab));
    }
    made
}

/// Every ray finds its whole way through a block in slabs, in order, whatever mode, space and eye,
/// and each slab's hull covers its part of the ray.
#[test]
fn slabs_hold_all_of_a_ray_in_order() {
    let shape = cube(5);
    shape.set_transform(bent());
    let center = bent().transform_point3(DVec3::splat(2.0));
    let frames = [
        along(DVec3::new(0.3, 1.0, -0.4)),
        from_eye(center + DVec3::new(5.0, -9.0, 4.0), center),
        from_eye(center + DVec3::new(0.1, -0.3, 0.2), center + DVec3::X),
        FrameDesc::new(
            Camera::LookAt {
                eye: center + DVec3::new(3.0, -6.0, 1.0),
                target: center,
                up: DVec3::Z,
                projection: volact_core::Projection::Perspective { fov_y: 50.0 },
                near: 5.5,
                far: 8.0,
            },
            64,
            64,
        ),
    ];
    let solids = solids(&[shape]);
    for frame in &frames {
        let rays = frame.camera.rays(&frame.viewport()).unwrap();
        for (mode, space) in MODES.into_iter().flat_map(|m| SPACES.map(|s| (m, s))) {
            let sampling = Sampling { mode, space, rate: Rate::Distance(0.23), ..Sampling::default() };
            let slicing = Slicing::new(solids.iter().collect(), frame, &sampling).unwrap();
            for (order, pixel) in
                [Order::FrontToBack, Order::BackToFront].into_iter().flat_map(|o| (0..20).map(move |i| (o, i)))
            {
                let pixel = DVec2::new((7 * pixel % 64) as f64 + 0.5, (11 * pixel % 64) as f64 + 0.5);
                let ray = rays.ray(pixel.x, pixel.y);
                let to_object = solids[0].to_object();
                let (o, d) = (to_object.transform_point3(ray.origin), to_object.transform_vector3(ray.direction));
                let inside = volact_core::Aabb::new(DVec3::ZERO, DVec3::splat(4.0)).clip_line(o, d);
                let Some([a, b]) = inside.map(|[a, b]| [a.max(ray.near), b.min(ray.far)]).filter(|[a, b]| a < b) else {
                    continue;
                };
                let (mut sweep, mut hull, mut found) = (slicing.sweep(order), Vec::new(), Vec::new());
                while let Some(mut slice) = sweep.next_slice() {
                    let Some(t) = slice.levels().cut(&ray, slice.slab) else { continue };
                    let t = [t[0].max(a), t[1].min(b)];
                    if t[0] < t[1] {
                        slice.hull(&mut hull);
                        assert!(t[1] - t[0] < 1e-9 || covers(&hull, pixel), "{mode:?} {space:?} {pixel} {t:?}");
                        found.push(t);
                    }
                }
                if order == Order::BackToFront {
                    found.reverse();
                }
                assert!(!found.is_empty());
                let ends = [found[0][0], found[found.len() - 1][1]];
                assert!(
                    (ends[0] - a).abs() < 1e-9 && (ends[1] - b).abs() < 1e-9,
                    "{mode:?} {space:?} {ends:?} {a} {b}"
                );
                assert!(found.windows(2).all(|w| (w[0][1] - w[1][0]).abs() < 1e-9), "{mode:?} {space:?} {found:?}");
            }
        }
    }
}

#[test]
fn back_to_front_is_front_to_back_reversed() {
    let other = cube(5);
    other.set_transform(DAffine3::from_translation(DVec3::new(1.5, 0.4, -0.7)) * bent());
    let shapes = [cube(5), other];
    for mode in [SamplingMode::Auto, SamplingMode::SphericalShells] {
        for space in SPACES {
            let sampling = Sampling { mode, space, ..Sampling::default() };
            let frame = from_eye(DVec3::new(1.0, -4.0, 2.0), DVec3::splat(2.0));
            let front = slabs(&shapes, &frame, &sampling, Order::FrontToBack);
            let mut back = slabs(&shapes, &frame, &sampling, Order::BackToFront);
            back.reverse();
            assert_eq!(front, back);
            assert!(front.len() > 20);
        }
    }
}

#[test]
fn overlapping_shapes_alternate_from_slab_to_slab_whatever_the_order_of_drawing() {
    let other = cube(5);
    other.set_transform(DAffine3::from_translation(DVec3::splat(0.5)));
    let shapes = [cube(5), other];
    let frame = along(DVec3::new(0.2, 1.0, 0.1));
    let made = slabs(&shapes, &frame, &Sampling::default(), Order::FrontToBack);
    let swapped = slabs(&[shapes[1].clone(), shapes[0].clone()], &frame, &Sampling::default(), Order::FrontToBack);
    assert!(made.iter().zip(&swapped).all(|(a, b)| a.0 == 1 - b.0 && a.1 == b.1));
    let both: Vec<_> = made.windows(2).filter(|w| w[0].1 == w[1].1).collect();
    assert!(both.len() > 5);
    assert!(both.windows(2).all(|w| w[0][0].0 != w[1][0].0));
}

#[test]
fn axis_aligned_planes_lie_along_faces_and_overlapping_shapes_must_agree() {
    let turned = cube(5);
    turned.set_transform(DAffine3::from_rotation_x(0.6));
    let frame = along(DVec3::new(0.1, 1.0, 0.2));
    let axis = Sampling { mode: SamplingMode::AxisAligned, ..Sampling::default() };
    let both = solids(&[cube(5), turned.clone()]);
    let error = Slicing::new(both.iter().collect(), &frame, &axis).unwrap_err();
    assert!(matches!(error, SlicingError::Axes { .. }) && error.to_string().contains("overlap"), "{error}");
    // Of which one is the other's copy, or which lie apart, may be.
    let moved = turned.named("moved");
    moved.set_transform(DAffine3::from_translation(DVec3::new(0.0, 9.0, 0.0)) * DAffine3::from_rotation_x(0.6));
    let three = solids(&[cube(5), moved.clone(), moved.named("copy")]);
    let slicing = Slicing::new(three.iter().collect(), &frame, &axis).unwrap();
    let Levels::Planes { normal, .. } = slicing.levels(0) else { panic!("no planes") };
    assert_eq!(*normal, DVec3::Y);
    assert_eq!(slicing.levels(1), slicing.levels(2));
    // What lies apart comes whole, the nearer first.
    let order = slabs(&[moved, cube(5)], &frame, &axis, Order::FrontToBack);
    assert!(order.is_sorted_by_key(|s| 1 - s.0));
}

#[test]
fn object_space_moves_with_the_object_and_primitives_have_their_own() {
    let frame = along(DVec3::Y);
    let first = |space, by: f64, sized: usize| {
        let shape = cube(sized);
        shape.set_transform(DAffine3::from_translation(DVec3::Y * by));
        let sampling = Sampling { space, rate: Rate::Distance(0.5), ..Sampling::default() };
        slabs(&[shape], &frame, &sampling, Order::FrontToBack)[0].2[0] - by
    };
    let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
    assert!(!close(first(SamplingSpace::ViewVolume, 0.0, 5), first(SamplingSpace::ViewVolume, 0.3, 5)));
    assert!(close(first(SamplingSpace::Object, 0.0, 5), first(SamplingSpace::Object, 0.3, 5)));
    assert!(close(first(SamplingSpace::Primitive, 0.0, 4), first(SamplingSpace::Primitive, 0.3, 4)));
    // From the origin of object space, or from the middle: 2 and 1.5 away from the face.
    assert!(close(first(SamplingSpace::Object, 0.3, 5), 0.0));
    let odd = |space| {
        let sampling = Sampling { space, rate: Rate::Distance(0.7), ..Sampling::default() };
        slabs(&[cube(5)], &frame, &sampling, Order::FrontToBack)[0].2[0]
    };
    assert!(close(odd(SamplingSpace::Object), 0.0) && close(odd(SamplingSpace::Primitive), 2.0 - 3.0 * 0.7));
}

/// 1/cosθ on planes in perspective, none on shells.
#[test]
fn segments_on_planes_are_longer_beside_the_axis_and_on_shells_are_not() {
    let frame = from_eye(DVec3::new(2.0, -6.0, 2.0), DVec3::splat(2.0));
    let rays = frame.camera.rays(&frame.viewport()).unwrap();
    let solids = solids(&[cube(5)]);
    for mode in [SamplingMode::ViewportAligned, SamplingMode::SphericalShells] {
        let sampling = Sampling { mode, rate: Rate::Distance(0.1), ..Sampling::default() };
        let slicing = Slicing::new(solids.iter().collect(), &frame, &sampling).unwrap();
        for pixel in [[32.0, 32.0], [0.5, 0.5], [63.5, 20.0]] {
            let ray = rays.ray(pixel[0], pixel[1]);
            let levels = slicing.levels(0);
            let [a, b] = levels.cut(&ray, slicing.slabs(0).slab(60)).unwrap();
            let cosine = ray.direction.dot(rays.axis());
            let wanted = if mode == SamplingMode::ViewportAligned { 0.1 / cosine } else { 0.1 };
            assert!((b - a - wanted).abs() < 1e-12);
            let gradient = levels.gradient(ray.at(a));
            assert!((Levels::length(0.1, gradient, ray.direction) - wanted).abs() < 1e-12);
        }
    }
}
