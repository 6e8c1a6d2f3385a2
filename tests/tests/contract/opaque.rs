//! Opaque neighbours: surfaces, and what the application has drawn already.

use volact_conformance::{
    meshes::{bent, field},
    metrics::{identical, max_error, wide, within},
    rig::Setup,
    scene::{along_y, ball, colors, constant, greys, lut, square},
};
use volact_core::{
    Appearance, Buffer, Camera, FrameDesc, Opaque, OpaqueDepth, ParameterValue, ScalarType, Shape, Surface,
    camera::DepthRange,
    glam::{DMat4, DVec3, DVec4, dcamera::rh},
};

fn actions() -> [(&'static str, Setup, f64); 2] {
    [("reference", Setup::exact(), 6e-8), ("cpu", Setup::post(0.1), 3e-6)]
}

/// A wall at y, facing the ray along y.
fn wall(y: f64) -> Surface {
    let at = |x: f64, z: f64| DVec3::new(x, y, z);
    let points = vec![at(-9.0, -9.0), at(9.0, -9.0), at(9.0, 9.0), at(-9.0, 9.0)];
    Surface::new(points.into(), Buffer::from_vec(vec![0u32, 1, 2, 0, 2, 3])).unwrap()
}

fn painted(surface: Surface, color: [f64; 3]) -> Shape {
    let [r, g, b] = color;
    Shape::new(surface, Appearance::new("surface").with("color", ParameterValue::Color([r, g, b, 1.0])))
}

fn absorbed(length: f64) -> f64 {
    1.0 - 0.6f64.powf(length)
}

/// A medium of length 4 in front of, around and behind a wall.
#[test]
fn the_medium_before_a_wall_is_seen_and_that_behind_is_not() {
    for (name, setup, tolerance) in actions() {
        for medium in [
            lut(&constant(1.0, [4, 4, 4]), greys(&[(1.0, 1.0, 0.4)]), 1.0),
            field(bent([4, 3, 5], DVec3::splat(4.0), 0.1), |_| 1.0, greys(&[(1.0, 1.0, 0.4)]), 1.0),
        ] {
            for (y, before) in [(-1.0, 0.0), (1.7, 1.7), (3.0, 3.0), (6.0, 4.0)] {
                let alpha = absorbed(before);
                let left = 1.0 - alpha;
                let wanted = [alpha + 0.5 * left, alpha + 0.25 * left, alpha, 1.0];
                let wall = painted(wall(y), [0.5, 0.25, 0.0]);
                for shapes in [[wall.clone(), medium.clone()], [medium.clone(), wall.clone()]] {
                    let frame = setup.draw(&shapes, &along_y(1.3, 2.1));
                    within(&format!("{name}, wall at {y}"), max_error(&wide(&frame), &[wanted]), tolerance);
                    // 1.3572 is where 0.6 to the power of the length falls to one half.
                    let depth = 100.0 + if before >= 1.3572 { 0.5f64.ln() / 0.6f64.ln() } else { y };
                    within("depth", (f64::from(frame.depth[0]) - depth).abs(), 1e-4);
                }
            }
        }
    }
}

#[test]
fn walls_are_lit_from_both_sides_and_by_their_own_light() {
    for (name, setup, tolerance) in actions() {
        let slope = |color| {
            let points = vec![DVec3::new(-9.0, -9.0, -9.0), DVec3::new(9.0, 9.0, -9.0), DVec3::new(0.0, 0.0, 9.0)];
            painted(Surface::new(points.into(), Buffer::from_vec(vec![0u32, 1, 2])).unwrap(), color)
        };
        // The light is at the eye: 0.2 + 0.8·cos 45°.
        let lit = 0.2 + 0.8 * 0.5f64.sqrt();
        let found = setup.pixel(&slope([1.0, 0.5, 0.0]), &along_y(0.0, 0.0));
        within(name, max_error(&[found], &[[lit, 0.5 * lit, 0.0, 1.0]]), tolerance);
        let shape = slope([1.0, 0.5, 0.0]);
        shape.set_parameter("lightdir", DVec3::new(0.0, 0.0, 3.0));
        shape.set_parameter("ambient", 0.4);
        let found = setup.pixel(&shape, &along_y(0.0, 0.0));
        within(name, max_error(&[found], &[[0.4, 0.2, 0.0, 1.0]]), tolerance);
    }
}

#[test]
fn flat_pictures_end_at_the_wall_too() {
    let data = volact_conformance::scene::volume([2, 5, 2], ScalarType::F32, |p| 10.0 * p.y);
    for (shader, wanted) in [("mip", 0.2), ("average", 0.1)] {
        let shape = lut(&data, greys(&[(0.0, 0.0, 1.0), (100.0, 1.0, 1.0)]), 1.0);
        shape.set_shader(shader);
        for (name, setup, tolerance) in [("reference", Setup::exact(), 6e-8), ("cpu", Setup::post(0.01), 6e-4)] {
            let found = setup.colors(&[painted(wall(2.0), [1.0, 0.0, 0.0]), shape.clone()], &along_y(0.5, 0.5));
            within(&format!("{name} {shader}"), max_error(&found, &[[wanted, wanted, wanted, 1.0]]), tolerance);
        }
    }
}

fn scene() -> Vec<Shape> {
    let table = colors(&[(10.0, [0.2, 0.4, 1.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (200.0, [1.0; 3], 0.6)]);
    vec![lut(&ball([8, 9, 10], ScalarType::U8), table, 1.0)]
}

/// A surface with a shape: a folded sheet through the volume.
fn sheet() -> Shape {
    let n = 12;
    let at = |i: usize, j: usize| {
        let (u, v) = (i as f64 / n as f64, j as f64 / n as f64);
        DVec3::new(1.0 + 5.0 * u, 4.0 + 2.0 * (6.0 * u).sin() * v, 1.0 + 7.0 * v)
    };
    let points: Vec<_> = (0..=n).flat_map(|j| (0..=n).map(move |i| at(i, j))).collect();
    let index = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            triangles.extend([a, b, c, a, c, d]);
        }
    }
    painted(Surface::new(points.into(), Buffer::from_vec(triangles)).unwrap(), [0.3, 0.9, 0.4])
}

fn cameras() -> [(Camera, DMat4, DepthRange); 3] {
    let (eye, target) = (DVec3::new(9.0, -14.0, 10.0), DVec3::new(3.5, 4.0, 4.5));
    let view = rh::view::look_at_mat4(eye, target, DVec3::Z);
    let gl = rh::proj::opengl::perspective(0.6, 1.0, 2.0, 60.0);
    let ortho = rh::proj::directx::orthographic(-7.0, 7.0, -7.0, 7.0, 1.0, 50.0);
    let off = rh::proj::directx::frustum(-0.5, 0.7, -0.4, 0.8, 2.0, 60.0);
    [(gl, DepthRange::MinusOneToOne), (ortho, DepthRange::ZeroToOne), (off, DepthRange::ZeroToOne)]
        .map(|(projection, depth)| (Camera::Matrices { view, projection, depth }, projection * view, depth))
}

/// What an action draws of a surface alone is what an application would hand over.
#[test]
fn an_applications_picture_is_a_surface() {
    let pixels = 20;
    for (camera, clip, range) in cameras() {
        let desc = FrameDesc::new(camera, pixels, pixels);
        for (name, setup, _) in actions() {
            let alone = setup.draw(&[sheet()], &desc);
            assert!(alone.depth.iter().any(|d| d.is_finite()), "{name}: the sheet is seen");
            let mut both = scene();
            both.push(sheet());
            let wanted = setup.colors(&both, &desc);
            let grid = desc.camera.rays(&desc.viewport()).unwrap();
            let buffer: Vec<f32> = (0..pixels * pixels)
                .map(|i| {
                    let ray = grid.ray((i % pixels) as f64 + 0.5, (i / pixels) as f64 + 0.5);
                    let p = clip * DVec4::from((ray.at(f64::from(alone.depth[i]) + ray.depth_zero), 1.0));
                    if alone.depth[i].is_finite() { (p.z / p.w) as f32 } else { 1.0 }
                })
                .collect();
            let color = Some(alone.color.clone().into());
            let distance = Opaque { color: color.clone(), depth: OpaqueDepth::Distance(alone.depth.clone().into()) };
            let depth = OpaqueDepth::Buffer { values: buffer.into(), range, world_to_clip: clip };
            for opaque in [distance, Opaque { color, depth }] {
                let found = setup.colors(&scene(), &desc.clone().with_opaque(opaque));
                // Depths in f32 at a distance of 20; in a depth buffer some 1e-6 of 20²/2.
                within(name, max_error(&found, &wanted), 2e-3);
            }
        }
    }
}

#[test]
fn without_colour_rays_end_in_nothing() {
    let desc = along_y(1.3, 2.1);
    let opaque = Opaque { color: None, depth: OpaqueDepth::Distance(vec![101.5].into()) };
    let medium = [lut(&constant(1.0, [4, 4, 4]), greys(&[(1.0, 1.0, 0.4)]), 1.0)];
    for (name, setup, tolerance) in actions() {
        let frame = setup.draw(&medium, &desc.clone().with_opaque(opaque.clone()));
        within(name, max_error(&wide(&frame), &[[absorbed(1.5); 4]]), tolerance);
        let behind = Opaque {
            color: Some(vec![[0.2, 0.1, 0.0, 1.0]].into()),
            depth: OpaqueDepth::Distance(vec![f32::INFINITY].into()),
        };
        let found = setup.colors(&medium, &desc.clone().with_opaque(behind));
        let left = 1.0 - absorbed(4.0);
        let wanted = [absorbed(4.0) + 0.2 * left, absorbed(4.0) + 0.1 * left, absorbed(4.0), 1.0];
        within(name, max_error(&found, &[wanted]), tolerance);
    }
}

#[test]
fn cpu_draws_surfaces_in_volumes_as_the_reference_does() {
    let desc = square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 40);
    let mut shapes = scene();
    shapes.push(sheet());
    let (found, wanted) = (Setup::post(0.23).draw(&shapes, &desc), Setup::rays(0.23).draw(&shapes, &desc));
    // A ray at the sheet's very edge may meet it here and miss it there.
    let far =
        wide(&found).iter().zip(wide(&wanted)).filter(|(a, b)| (0..4).any(|c| (a[c] - b[c]).abs() > 1e-5)).count();
    assert!(far <= 2, "{far} pixels differ");
    shapes.reverse();
    assert!(identical(&found, &Setup::post(0.23).draw(&shapes, &desc)));
}

#[test]
fn surfaces_and_volumes_are_not_taken_for_each_other() {
    for (name, setup, _) in actions() {
        let volume = lut(&constant(1.0, [4, 4, 4]), greys(&[(1.0, 1.0, 0.4)]), 1.0);
        volume.set_shader("surface");
        let error = setup.action().manage(&volume).expect_err(name).to_string();
        assert!(error.contains("surface") && error.contains("block"), "{name}: {error}");
        let sheet = sheet();
        sheet.set_parameter("lookup_table", greys(&[(1.0, 1.0, 0.4)]));
        sheet.set_parameter("volume", &constant(1.0, [4, 4, 4]));
        sheet.set_shader("lut");
        let error = setup.action().manage(&sheet).expect_err(name).to_string();
        assert!(error.contains("surface") && error.contains("lut"), "{name}: {error}");
    }
}
