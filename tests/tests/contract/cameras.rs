//! Cameras, rays and the lattice that is counted along them.

use volact_conformance::{
    metrics::{identical, max_error, within},
    rig::{Setup, truth},
    scene::{along_y, ball, colors, constant, greys, lut, one_ray, volume},
};
use volact_core::{
    Camera, FrameDesc, Projection, ScalarType, Shape, Viewport,
    camera::DepthRange,
    glam::{DAffine3, DMat3, DMat4, DVec3, DVec4},
};

/// f32 interpolation of values up to 200 through a table as steep as 1 in 60.
const F32: f64 = 1e-5;

fn scene() -> Shape {
    let table = colors(&[(0.0, [0.2, 0.1, 0.3], 0.0), (60.0, [1.0, 0.4, 0.2], 0.2), (200.0, [0.3, 0.9, 1.0], 0.8)]);
    lut(&ball([13, 15, 14], ScalarType::U8), table, 1.0)
}

fn agree(what: &str, shapes: &[Shape], desc: &FrameDesc) {
    let wanted = Setup::rays(0.43).colors(shapes, desc);
    assert!(wanted.iter().any(|c| c[3] > 0.05), "{what} shows nothing");
    within(what, max_error(&Setup::post(0.43).colors(shapes, desc), &wanted), F32);
    let pre = Setup::rays(0.43).with("classification", "pre-integrated").colors(shapes, desc);
    // Values are tabulated in pairs.
    within(
        &format!("{what}, pre-integrated"),
        max_error(&Setup::pre_integrated(0.43).colors(shapes, desc), &pre),
        2e-4,
    );
}

fn look(eye: DVec3, projection: Projection) -> Camera {
    Camera::LookAt { eye, target: DVec3::splat(6.0), up: DVec3::Z, projection, near: 0.0, far: f64::INFINITY }
}

#[test]
fn every_kind_of_camera_agrees_with_the_reference() {
    let eye = DVec3::new(20.0, -25.0, 17.0);
    let shapes = [scene()];
    agree("perspective", &shapes, &FrameDesc::new(look(eye, Projection::Perspective { fov_y: 35.0 }), 18, 13));
    agree("orthographic", &shapes, &FrameDesc::new(look(eye, Projection::Orthographic { height: 19.0 }), 18, 13));
    let view = DMat4::from_mat3(DMat3::from_cols(DVec3::X, -DVec3::Z, DVec3::Y))
        * DMat4::from_translation(-DVec3::new(7.0, -20.0, 5.0));
    // Off-axis: left and right, bottom and top are not opposite. Row-major by eye, so transposed.
    let (l, r, b, t, n, f) = (-0.2, 0.5, -0.3, 0.45, 1.0, 90.0);
    let frustum = |depth: [f64; 2]| {
        DMat4::from_cols(
            DVec4::new(2.0 * n / (r - l), 0.0, 0.0, 0.0),
            DVec4::new(0.0, 2.0 * n / (t - b), 0.0, 0.0),
            DVec4::new((r + l) / (r - l), (t + b) / (t - b), depth[0], -1.0),
            DVec4::new(0.0, 0.0, depth[1], 0.0),
        )
    };
    let gl = frustum([-(f + n) / (f - n), -2.0 * f * n / (f - n)]);
    let dx = frustum([-f / (f - n), -f * n / (f - n)]);
    let desc = |projection, depth| FrameDesc::new(Camera::Matrices { view, projection, depth }, 18, 13);
    let (gl, dx) = (desc(gl, DepthRange::MinusOneToOne), desc(dx, DepthRange::ZeroToOne));
    agree("off-axis", &shapes, &gl);
    let a = Setup::rays(0.43).colors(&shapes, &gl);
    within("both depth ranges", max_error(&a, &Setup::rays(0.43).colors(&shapes, &dx)), 1e-5);
}

#[test]
fn mirrored_sheared_and_flattened_shapes_agree() {
    let camera = look(DVec3::new(20.0, -25.0, 17.0), Projection::Perspective { fov_y: 45.0 });
    let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.5, 1.0, 0.2), DVec3::new(-0.3, 0.4, 1.0));
    let maps = [
        (
            "mirrored",
            DAffine3::from_translation(DVec3::new(13.0, 0.0, 0.0)) * DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)),
        ),
        ("sheared", DAffine3::from_mat3(shear)),
        ("flattened", DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.2))),
        ("turned", DAffine3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7)),
    ];
    for (what, map) in maps {
        let shape = scene();
        shape.set_transform(map);
        agree(what, &[shape], &FrameDesc::new(camera, 14, 14));
    }
}

/// A mirrored shape is the mirror image, whatever the handedness of its map.
#[test]
fn mirroring_the_shape_mirrors_the_picture() {
    let camera = Camera::orthographic(DVec3::new(0.0, -50.0, 7.0), DVec3::new(0.0, 0.0, 7.0), DVec3::Z, 30.0);
    let desc = FrameDesc::new(camera, 16, 16);
    for setup in [Setup::rays(0.4), Setup::post(0.4)] {
        let shape = scene();
        let plain = setup.colors(std::slice::from_ref(&shape), &desc);
        shape.set_transform(DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
        let mirrored = setup.colors(&[shape], &desc);
        let turned: Vec<_> = mirrored.chunks(16).flat_map(|row| row.iter().rev().copied()).collect();
        within("mirror", max_error(&plain, &turned), 1e-6);
    }
}

#[test]
fn viewport_is_the_picture_in_a_part_of_the_frame() {
    let camera = look(DVec3::new(20.0, -25.0, 17.0), Projection::Perspective { fov_y: 35.0 });
    let viewport = Viewport { x: 3, y: 5, width: 10, height: 9 };
    let small = FrameDesc::new(camera, 10, 9);
    let large = FrameDesc { viewport: Some(viewport), ..FrameDesc::new(camera, 17, 23) };
    for setup in [Setup::rays(0.4), Setup::post(0.4), Setup::cpu().with("threads", 3i64)] {
        let (a, b) = (setup.draw(&[scene()], &small), setup.draw(&[scene()], &large));
        for (y, x) in (0..23).flat_map(|y| (0..17).map(move |x| (y, x))) {
            let inside = (3..13).contains(&x) && (5..14).contains(&y);
            let wanted = if inside { a.pixel(x - 3, y - 5) } else { [0.0; 4] };
            assert_eq!(b.pixel(x, y), wanted, "{setup:?} at ({x}, {y})");
        }
    }
    let outside = FrameDesc { viewport: Some(Viewport { x: 9, ..viewport }), ..FrameDesc::new(camera, 17, 23) };
    assert!(Setup::cpu().action().begin_draw(&outside).unwrap_err().to_string().contains("viewport"));
}

#[test]
fn near_and_far_cut_the_ray() {
    let shape = lut(&constant(1.0, [1, 8, 1]), greys(&[(0.0, 1.0, 0.2)]), 1.0);
    let camera = |near, far| Camera::LookAt {
        eye: DVec3::new(0.5, -10.0, 0.5),
        target: DVec3::new(0.5, 0.0, 0.5),
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: 1e-6 },
        near,
        far,
    };
    for (near, far, length) in [
        (0.0, f64::INFINITY, 8.0),
        (12.5, f64::INFINITY, 5.5),
        (0.0, 13.0, 3.0),
        (11.0, 11.25, 0.25),
        (18.5, 30.0, 0.0),
        (0.0, 9.0, 0.0),
    ] {
        let wanted = [[1.0 - 0.8f64.powf(length); 4]];
        let desc = FrameDesc::new(camera(near, far), 1, 1);
        within("exact", max_error(&truth(std::slice::from_ref(&shape), &desc).color, &wanted), 1e-9);
        for step in [0.3, 3.0] {
            for setup in [Setup::post(step), Setup::pre_integrated(step), Setup::rays(step)] {
                within("step", max_error(&[setup.pixel(&shape, &desc)], &wanted), 4e-6);
            }
        }
        // The plane, not the ray, is what near and far measure: oblique rays go farther.
    }
    let wide = Camera::LookAt {
        eye: DVec3::ZERO,
        target: DVec3::Y,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: 90.0 },
        near: 2.0,
        far: 5.0,
    };
    let huge = lut(&constant(1.0, [1, 1, 1]), greys(&[(0.0, 1.0, 0.1)]), 1.0);
    huge.set_transform(DAffine3::from_translation(DVec3::splat(-50.0)) * DAffine3::from_scale(DVec3::splat(100.0)));
    let desc = FrameDesc::new(wide, 4, 4);
    let wanted: Vec<_> = (0..16)
        .map(|i| {
            let tan = |n: usize| (n as f64 + 0.5) / 2.0 - 1.0;
            let oblique = (1.0 + tan(i % 4).powi(2) + tan(i / 4).powi(2)).sqrt();
            [1.0 - 0.9f64.powf(3.0 * oblique); 4]
        })
        .collect();
    for setup in [Setup::exact(), Setup::rays(0.4), Setup::post(0.4)] {
        within("planes", max_error(&setup.colors(std::slice::from_ref(&huge), &desc), &wanted), 4e-6);
    }
}

/// The lattice is counted from the plane through the world's origin.
#[test]
fn orthographic_eye_moved_back_changes_no_bit() {
    let direction = DVec3::new(3.0, -8.0, 4.0);
    let at = |d: f64| {
        let target = DVec3::splat(6.0);
        FrameDesc::new(Camera::orthographic(target + direction * d, target, DVec3::Z, 22.0), 16, 16)
    };
    let straight = |d: f64| {
        let target = DVec3::new(6.0, 0.0, 6.0);
        FrameDesc::new(Camera::orthographic(target - DVec3::Y * d, target, DVec3::Z, 22.0), 16, 16)
    };
    for setup in [Setup::cpu().step(0.7), Setup::pre_integrated(0.7), Setup::rays(0.7)] {
        let plain = setup.colors(&[scene()], &straight(32.0));
        for d in [64.0, 4096.0, 33.0] {
            assert_eq!(setup.colors(&[scene()], &straight(d)), plain, "{setup:?} from {d}");
        }
        // Obliquely the positions of eyes round, in the last places of f64.
        let plain = setup.colors(&[scene()], &at(4.0));
        within("obliquely", max_error(&setup.colors(&[scene()], &at(16.0)), &plain), 1e-6);
    }
}

/// Segments begin at multiples of the step from the eye, or from the plane through the origin.
#[test]
fn lattice_is_counted_from_the_eye_or_the_origin() {
    // Red up to y = 5, then green: the colour of a segment tells where its middle lies.
    let data = volume([2, 11, 2], ScalarType::F32, |p| p.y);
    let table = colors(&[
        (0.0, [1.0, 0.0, 0.0], 0.2),
        (5.0, [1.0, 0.0, 0.0], 0.2),
        (5.0, [0.0, 1.0, 0.0], 0.2),
        (10.0, [0.0, 1.0, 0.0], 0.2),
    ]);
    let shape = lut(&data, table, 1.0);
    let green = |n: [f64; 2]| 0.8f64.powf(n[0]) - 0.8f64.powf(n[1]);
    // Step 4: segments 0–4, 4–8, 8–10 from the origin; the middle of the second is green.
    let ortho = along_y(0.5, 0.5);
    // From an eye at −1 they begin at −1, 3, 7: 0–3 red, 3–7 has its middle at 5, 7–10.
    let eye = |y: f64| {
        let camera = Camera::perspective(DVec3::new(0.5, y, 0.5), DVec3::new(0.5, 0.0, 0.5), DVec3::Z, 1e-6);
        FrameDesc::new(camera, 1, 1)
    };
    for (desc, from) in [(ortho, 4.0), (eye(-1.5), 6.5), (eye(-3.0), 5.0)] {
        for setup in [Setup::post(4.0), Setup::rays(4.0)] {
            let found = setup.pixel(&shape, &desc);
            within("green begins", (found[1] - green([from, 10.0])).abs(), 2e-6);
            within("all", (found[3] - (1.0 - 0.8f64.powi(10))).abs(), 2e-6);
        }
    }
}

/// Depth is where the accumulated opacity reaches the threshold: −ln(1 − d)/σ into the medium.
#[test]
fn depth_is_where_the_threshold_is_reached() {
    let shape = lut(&constant(1.0, [1, 20, 1]), greys(&[(0.0, 1.0, 0.25)]), 1.0);
    let sigma = -(0.75f64).ln();
    let eye = DVec3::new(0.5, -7.0, 0.5);
    let perspective = FrameDesc::new(Camera::perspective(eye, eye + DVec3::Y, DVec3::Z, 1e-6), 1, 1);
    for mut desc in [perspective, one_ray(eye, eye + DVec3::Y)] {
        for threshold in [0.1f32, 0.5, 0.9] {
            desc.depth_threshold = threshold;
            let wanted = 7.0 - (1.0 - f64::from(threshold)).ln() / sigma;
            for setup in [Setup::exact(), Setup::rays(0.4), Setup::post(0.4), Setup::pre_integrated(0.4)] {
                let found = setup.draw(std::slice::from_ref(&shape), &desc).depth[0];
                // f32 of some twenty.
                within(&format!("{setup:?}"), (f64::from(found) - wanted).abs(), 2e-5);
            }
        }
        desc.depth_threshold = 0.9999;
        for setup in [Setup::exact(), Setup::post(0.4)] {
            assert_eq!(setup.draw(std::slice::from_ref(&shape), &desc).depth[0], f32::INFINITY);
        }
    }
}

#[test]
fn depth_of_a_picture_agrees_with_the_reference() {
    let camera = look(DVec3::new(20.0, -25.0, 17.0), Projection::Perspective { fov_y: 35.0 });
    let desc = FrameDesc::new(camera, 16, 16);
    let (a, b) = (Setup::post(0.4).draw(&[scene()], &desc), Setup::rays(0.4).draw(&[scene()], &desc));
    for (a, b) in a.depth.iter().zip(&b.depth) {
        assert!(a == b || (a - b).abs() < 1e-3, "{a} {b}");
    }
    assert!(a.depth.iter().any(|d| d.is_finite()) && a.depth.iter().any(|d| d.is_infinite()));
    // Overlap takes another way, with the same depth.
    let mut halves = [scene(), scene()];
    for half in &mut halves {
        half.set_parameter("unit_distance", 2.0);
    }
    let c = Setup::cpu().step(0.4).with("termination", 0.0).draw(&halves, &desc);
    for (a, c) in a.depth.iter().zip(&c.depth) {
        assert!(a == c || (a - c).abs() < 1e-3, "{a} {c}");
    }
    assert!(!identical(&a, &Setup::post(0.7).draw(&[scene()], &desc)));
}

/// Row 0 is at the top and x runs to the right, seen from in front along +y with z up.
#[test]
fn picture_is_not_upside_down() {
    let data = volume([2, 2, 2], ScalarType::F32, |p| p.x + 2.0 * p.z);
    let grey = volact_core::LookupTable::grey([0.0, 3.0]);
    let shape = volact_conformance::scene::shaded("average", &(&data).into(), grey, 1.0);
    let desc = FrameDesc::new(Camera::orthographic(DVec3::new(0.5, -5.0, 0.5), DVec3::splat(0.5), DVec3::Z, 1.0), 2, 2);
    for setup in [Setup::exact(), Setup::cpu().step(0.2)] {
        let found = setup.colors(std::slice::from_ref(&shape), &desc);
        let wanted = [1.75, 2.25, 0.75, 1.25].map(|v| [v / 3.0, v / 3.0, v / 3.0, 1.0]);
        within("corners", max_error(&found, &wanted), 1e-6);
    }
}
