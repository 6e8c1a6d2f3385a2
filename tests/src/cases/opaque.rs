//! Opaque things: surfaces in volumes, and what an application has drawn already.

use volact_core::{
    Buffer, Camera, FrameDesc, Opaque, OpaqueDepth, ParameterValue, Shape, Surface,
    camera::DepthRange,
    glam::{DAffine3, DMat4, DVec3, DVec4, dcamera::rh},
};

use super::stock::{PIXELS, absorbed, around, shape, through};
use crate::{
    case::{Case, Need, Topic},
    rig::{How, Scene},
    scene::{along_y, constant, greys, lut, shaded},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("opaque", &[Need::Shader("lut")]);
    walls(&mut topic);
    lit(&mut topic);
    sheets(&mut topic);
    handed(&mut topic);
    topic.done()
}

const SURFACE: &[Need] = &[Need::Shader("surface")];

fn painted(points: Vec<DVec3>, triangles: Vec<u32>, color: [f64; 3]) -> Shape {
    let [r, g, b] = color;
    let surface = Surface::new(points.into(), Buffer::from_vec(triangles)).expect("a surface");
    Shape::new(surface, volact_core::Appearance::new("surface").with("color", ParameterValue::Color([r, g, b, 1.0])))
}

fn wall(y: f64, color: [f64; 3]) -> Shape {
    let corner = |x: f64, z: f64| DVec3::new(x, y, z);
    painted(
        vec![corner(-9.0, -9.0), corner(20.0, -9.0), corner(-9.0, 20.0), corner(20.0, 20.0)],
        vec![0, 1, 2, 1, 3, 2],
        color,
    )
}

fn medium() -> Shape {
    lut(&constant(1.0, [4, 4, 4]), greys(&[(1.0, 1.0, 0.4)]), 1.0)
}

/// A medium of length 4 in front of, around and behind a wall.
fn walls(topic: &mut Topic) {
    for (name, y, before) in [("before", -1.0, 0.0), ("inside", 1.5, 1.5), ("behind", 7.0, 4.0)] {
        let about = "the medium before a wall is seen, and what is behind it is not";
        topic.needing(SURFACE, format!("wall_{name}"), about, move |rig| {
            let scene = Scene::new([wall(y, [0.5, 0.25, 0.0]), medium()], along_y(1.3, 2.1));
            let alpha = absorbed(0.4, before);
            let left = 1.0 - alpha;
            let wanted = [alpha + 0.5 * left, alpha + 0.25 * left, alpha, 1.0];
            let frame = rig.pixel("colour", &scene, &How::step(0.25), wanted)?;
            let turned = rig.draw(&scene.reversed(), &How::step(0.25))?;
            rig.same("in the other order", &scene, &turned, &frame);
            Ok(())
        });
    }
    topic.needing(SURFACE, "nearest_of_two_walls", "of two walls the nearer is seen", |rig| {
        let scene = Scene::new([wall(3.0, [1.0, 0.0, 0.0]), wall(2.0, [0.0, 1.0, 0.0]), medium()], along_y(1.3, 2.1));
        let alpha = absorbed(0.4, 2.0);
        rig.pixel("colour", &scene, &How::step(0.25), [alpha, 1.0, alpha, 1.0]).map(|_| ())
    });
    for shader in ["mip", "average"] {
        topic.needing(
            &[Need::Shader("surface"), Need::Shader(shader)],
            format!("wall_in_{shader}"),
            "pictures of values end at the wall",
            move |rig| {
                let data = crate::scene::volume([2, 5, 2], volact_core::ScalarType::F32, |p| 10.0 * p.y);
                let table = greys(&[(0.0, 0.0, 1.0), (100.0, 1.0, 1.0)]);
                let shape = shaded(shader, &volact_core::VolumeTexture::new(&data), table, 1.0);
                let scene = Scene::new([wall(2.0, [1.0, 0.0, 0.0]), shape], along_y(0.5, 0.5));
                let wanted = if shader == "mip" { 0.2 } else { 0.1 };
                rig.allow("half a step of a slope of 0.1", if shader == "mip" { 0.1 / 128.0 } else { 0.0 });
                rig.pixel("value", &scene, &How::step(1.0 / 64.0), [wanted, wanted, wanted, 1.0]).map(|_| ())
            },
        );
    }
}

fn lit(topic: &mut Topic) {
    let slope = || {
        painted(
            vec![DVec3::new(-9.0, -9.0, -9.0), DVec3::new(9.0, 9.0, -9.0), DVec3::new(0.0, 0.0, 9.0)],
            vec![0, 1, 2],
            [1.0, 0.5, 0.0],
        )
    };
    for (name, light, ambient) in [
        ("from_the_eye", None, 0.2),
        ("from_aside", Some(DVec3::new(1.0, 0.0, 0.0)), 0.1),
        ("from_behind", Some(DVec3::new(-0.3, 1.0, 0.2)), 0.2),
        ("along_it", Some(DVec3::Z), 0.4),
    ] {
        let about = "color × (ambient + (1 − ambient)·|n·l|), light in world space";
        topic.needing(SURFACE, format!("lit_{name}"), about, move |rig| {
            let shape = slope();
            shape.set_parameter("ambient", ambient);
            if let Some(light) = light {
                shape.set_parameter("lightdir", light);
            }
            // The normal of a plane through three points with x = y.
            let normal = DVec3::new(1.0, -1.0, 0.0).normalize();
            let cosine = normal.dot(light.unwrap_or(-DVec3::Y).normalize()).abs();
            let shade = ambient + (1.0 - ambient) * cosine;
            let scene = Scene::new([shape], along_y(0.0, 0.0));
            rig.pixel("shade", &scene, &How::step(0.25), [shade, 0.5 * shade, 0.0, 1.0]).map(|_| ())
        });
    }
    topic.needing(
        SURFACE,
        "lit_under_a_transform",
        "normals go to the world through the inverse transpose",
        move |rig| {
            let shape = slope();
            shape.set_parameter("lightdir", DVec3::new(0.4, -0.7, 0.3));
            shape.set_transform(DAffine3::from_rotation_z(0.3) * DAffine3::from_scale(DVec3::new(0.4, 1.7, 0.9)));
            rig.lattice("picture", &around([shape]), &How::default()).map(|_| ())
        },
    );
}

/// A folded sheet through the volume.
fn sheet() -> Shape {
    let n = 6;
    let at = |i: usize, j: usize| {
        let (u, v) = (i as f64 / n as f64, j as f64 / n as f64);
        DVec3::new(0.5 + 5.0 * u, 2.4 + 1.6 * (6.0 * u).sin() * v, 0.6 + 6.0 * v)
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
    painted(points, triangles, [0.3, 0.9, 0.4])
}

fn sheets(topic: &mut Topic) {
    topic.needing(SURFACE, "folded_sheet", "volume in front, behind and around a folded surface", |rig| {
        rig.because("a ray at an edge between two triangles takes the shade of one of them by rounding");
        rig.lattice("orthographic", &around([shape(), sheet()]), &How::step(0.3))?;
        rig.lattice("perspective", &through([shape(), sheet()]), &How::step(0.3)).map(|_| ())
    });
}

/// What the application has drawn: for each pixel a colour, and a distance or a depth buffer.
fn handed(topic: &mut Topic) {
    let n = PIXELS * PIXELS;
    // A step: near on the left, far on the right, nothing at the top.
    let distance = move |i: usize| match (i % PIXELS, i / PIXELS) {
        (_, 0..5) => f64::INFINITY,
        (0..14, _) => 13.7,
        (_, _) => 16.9,
    };
    let color = move |i: usize| [0.1 + 0.02 * (i % PIXELS) as f32, 0.5, 0.02 * (i / PIXELS) as f32, 1.0];
    let eye = DVec3::new(3.0, 2.5, 3.5) + DVec3::new(0.6, -1.0, 0.45).normalize() * 15.0;
    let view = rh::view::look_at_mat4(eye, DVec3::new(3.0, 2.5, 3.5), DVec3::Z);
    for with_color in [true, false] {
        let name = if with_color { "distances_with_colour" } else { "distances_without_colour" };
        topic.case(
            name,
            "every ray ends at the depth, and the colour lies there; without colour it ends in nothing",
            move |rig| {
                let mut scene = through([shape()]);
                scene.desc.camera = Camera::perspective(eye, DVec3::new(3.0, 2.5, 3.5), DVec3::Z, 36.0);
                let depth = OpaqueDepth::Distance((0..n).map(|i| distance(i) as f32).collect());
                let color = with_color.then(|| (0..n).map(color).collect());
                scene.desc.opaque = Some(Opaque { color, depth });
                rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
            },
        );
    }
    let gl = rh::proj::opengl::perspective(0.62, 1.0, 2.0, 60.0);
    let dx = rh::proj::directx::perspective(0.62, 1.0, 2.0, 60.0);
    let flat = rh::proj::directx::orthographic(-6.0, 6.0, -6.0, 6.0, 1.0, 50.0);
    for (name, projection, range) in [
        ("opengl", gl, DepthRange::MinusOneToOne),
        ("directx", dx, DepthRange::ZeroToOne),
        ("orthographic", flat, DepthRange::ZeroToOne),
    ] {
        topic.case(format!("depth_buffer_{name}"), "a depth buffer with its projection", move |rig| {
            let camera = Camera::Matrices { view, projection, depth: range };
            let desc = FrameDesc::new(camera, PIXELS, PIXELS);
            let opaque = buffer(&desc, projection * view, range, &distance, &color);
            let scene = Scene::new([shape()], desc.with_opaque(opaque));
            rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
        });
    }
    topic.case("colour_behind_everything", "where the depth is infinite the colour lies behind everything", |rig| {
        let opaque = Opaque {
            color: Some(vec![[0.2, 0.1, 0.0, 1.0]].into()),
            depth: OpaqueDepth::Distance(vec![f32::INFINITY].into()),
        };
        let scene = Scene::new([medium()], along_y(1.3, 2.1).with_opaque(opaque));
        let (alpha, left) = (absorbed(0.4, 4.0), 1.0 - absorbed(0.4, 4.0));
        rig.pixel("colour", &scene, &How::step(0.25), [alpha + 0.2 * left, alpha + 0.1 * left, alpha, 1.0]).map(|_| ())
    });
    topic.case("ends_inside_a_segment", "a ray that ends within a segment counts the part before", |rig| {
        let opaque = Opaque { color: None, depth: OpaqueDepth::Distance(vec![101.37].into()) };
        let scene = Scene::new([medium()], along_y(1.3, 2.1).with_opaque(opaque));
        let end = f64::from(101.37f32) - 100.0;
        rig.pixel("colour", &scene, &How::step(0.5), [absorbed(0.4, end); 4]).map(|_| ())
    });
}

fn buffer(
    desc: &FrameDesc,
    world_to_clip: DMat4,
    range: DepthRange,
    distance: &dyn Fn(usize) -> f64,
    color: &dyn Fn(usize) -> [f32; 4],
) -> Opaque {
    let grid = desc.camera.rays(&desc.viewport()).expect("a camera");
    let value = |i: usize| {
        let ray = grid.ray((i % PIXELS) as f64 + 0.5, (i / PIXELS) as f64 + 0.5);
        let p = world_to_clip * DVec4::from((ray.at(distance(i) + ray.depth_zero), 1.0));
        if distance(i).is_finite() { (p.z / p.w) as f32 } else { 1.0 }
    };
    let n = PIXELS * PIXELS;
    let depth = OpaqueDepth::Buffer { values: (0..n).map(value).collect(), range, world_to_clip };
    Opaque { color: Some((0..n).map(color).collect()), depth }
}
