//! Cameras: views, perspectives, matrices, near and far, viewports, which way up.

use volact_core::{
    Camera, FrameDesc, LookupTable, Projection, ScalarType, View, Viewport, VolumeDesc,
    camera::DepthRange,
    glam::{DVec3, dcamera::rh},
};

use super::stock::{PIXELS, around, bounds, shape, through};
use crate::{
    case::{Case, Need, Topic},
    rig::{How, Scene},
    scene::{lut, placed},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("cameras", &[Need::Shader("lut")]);
    views(&mut topic);
    perspectives(&mut topic);
    matrices(&mut topic);
    planes(&mut topic);
    frames(&mut topic);
    topic.done()
}

const CENTER: DVec3 = DVec3::new(3.0, 2.5, 3.5);

fn scene(camera: Camera) -> Scene {
    Scene::new([shape()], FrameDesc::new(camera, PIXELS, PIXELS))
}

fn views(topic: &mut Topic) {
    for (name, view) in View::ALL {
        topic.case(format!("view_{name}"), "a named view fits the scene, in perspective", move |rig| {
            let shape = shape();
            let desc = FrameDesc::fit(&shape, view, PIXELS, PIXELS);
            rig.lattice("picture", &Scene::new([shape], desc), &How::step(0.3)).map(|_| ())
        });
        topic.case(format!("orthographic_{name}"), "the same side, orthographic", move |rig| {
            let (towards, up) = view.axes();
            let camera = Camera::orthographic(CENTER + 30.0 * towards, CENTER, up, 11.0);
            rig.lattice("picture", &scene(camera), &How::step(0.3)).map(|_| ())
        });
    }
    topic.case("row_0_is_at_the_top", "row 0 at the top, x to the right, pixel centres at +0.5", |rig| {
        let data = placed(VolumeDesc::new([2, 2, 2], ScalarType::F32, 1), |p| p.x + 2.0 * p.z);
        let camera = Camera::orthographic(DVec3::new(0.5, -5.0, 0.5), DVec3::splat(0.5), DVec3::Z, 1.0);
        let scene = Scene::new([lut(&data, LookupTable::grey([0.0, 3.0]), 1.0)], FrameDesc::new(camera, 2, 2));
        let wanted = [[1.75, 2.25], [0.75, 1.25]];
        let at = |x: usize, y: usize| Some([wanted[y][x] / 3.0, wanted[y][x] / 3.0, wanted[y][x] / 3.0, 1.0]);
        rig.closed("corners", &scene, &How::step(0.25), &at).map(|_| ())
    });
}

fn perspectives(topic: &mut Topic) {
    for (name, fov, distance) in
        [("narrow", 4.0, 160.0), ("usual", 35.0, 17.0), ("wide", 110.0, 7.5), ("fisheye", 150.0, 6.0)]
    {
        topic.case(
            format!("field_of_view_{name}"),
            "perspective by the vertical field of view in degrees",
            move |rig| {
                let eye = CENTER + DVec3::new(0.6, -1.0, 0.45).normalize() * distance;
                rig.lattice("picture", &scene(Camera::perspective(eye, CENTER, DVec3::Z, fov)), &How::step(0.3))
                    .map(|_| ())
            },
        );
    }
    for (name, eye) in [("inside", CENTER + DVec3::new(0.3, -0.2, 0.4)), ("on_a_face", DVec3::new(3.1, 0.0, 3.3))] {
        topic.case(format!("eye_{name}"), "the eye may be in the volume: rays begin there", move |rig| {
            let camera = Camera::perspective(eye, CENTER + DVec3::new(0.4, 2.0, -0.6), DVec3::Z, 80.0);
            rig.lattice("picture", &scene(camera), &How::step(0.3)).map(|_| ())
        });
    }
    topic.case("rolled", "up may point anywhere", |rig| {
        let eye = CENTER + DVec3::new(0.6, -1.0, 0.45).normalize() * 17.0;
        let camera = Camera::perspective(eye, CENTER, DVec3::new(1.0, 0.3, -0.4), 35.0);
        rig.lattice("picture", &scene(camera), &How::step(0.3)).map(|_| ())
    });
    topic.case("orthographic_eye_moved_back", "where an orthographic camera stands changes no bit", |rig| {
        let at = |d: f64| scene(Camera::orthographic(CENTER - DVec3::Y * d, CENTER, DVec3::Z, 11.0));
        let near = rig.draw(&at(32.0), &How::step(0.3))?;
        for d in [64.0, 4096.0] {
            let frame = rig.draw(&at(d), &How::step(0.3))?;
            let same = frame.color == near.color;
            rig.holds(&format!("from {d}"), same, "colours have the same bits");
        }
        Ok(())
    });
}

fn matrices(topic: &mut Topic) {
    let (eye, target) = (CENTER + DVec3::new(9.0, -14.0, 7.0), CENTER);
    let view = rh::view::look_at_mat4(eye, target, DVec3::Z);
    let gl = rh::proj::opengl::perspective(0.6, 1.0, 2.0, 60.0);
    let dx = rh::proj::directx::perspective(0.6, 1.0, 2.0, 60.0);
    let off = rh::proj::directx::frustum(-0.5, 0.7, -0.4, 0.8, 2.0, 60.0);
    let flat = rh::proj::directx::orthographic(-7.0, 7.0, -6.0, 8.0, 1.0, 50.0);
    let infinite = rh::proj::directx::perspective_infinite(0.6, 1.0, 0.5);
    for (name, projection, depth) in [
        ("opengl", gl, DepthRange::MinusOneToOne),
        ("directx", dx, DepthRange::ZeroToOne),
        ("off_axis", off, DepthRange::ZeroToOne),
        ("orthographic", flat, DepthRange::ZeroToOne),
        ("infinite_far", infinite, DepthRange::ZeroToOne),
    ] {
        topic.case(format!("matrices_{name}"), "any view and projection matrix, off-axis ones included", move |rig| {
            rig.lattice("picture", &scene(Camera::Matrices { view, projection, depth }), &How::step(0.3)).map(|_| ())
        });
    }
}

/// Near and far cut, along the view axis.
fn planes(topic: &mut Topic) {
    let eye = CENTER + DVec3::new(0.6, -1.0, 0.45).normalize() * 17.0;
    for (name, projection) in [
        ("perspective", Projection::Perspective { fov_y: 35.0 }),
        ("orthographic", Projection::Orthographic { height: 11.0 }),
    ] {
        for (which, near, far) in [("near", 16.2, f64::INFINITY), ("far", 0.0, 17.4), ("both", 15.7, 18.1)] {
            topic.case(format!("{which}_in_{name}"), "a ray's interval is cut by near and far", move |rig| {
                let camera = Camera::LookAt { eye, target: CENTER, up: DVec3::Z, projection, near, far };
                rig.lattice("picture", &scene(camera), &How::step(0.3)).map(|_| ())
            });
        }
    }
}

fn frames(topic: &mut Topic) {
    for (name, width, height) in [("wide", 45, 17), ("tall", 13, 41), ("one_column", 1, 29), ("odd", 33, 31)] {
        topic.case(format!("size_{name}"), "a picture of any size", move |rig| {
            let mut scene = through([shape()]);
            (scene.desc.width, scene.desc.height) = (width, height);
            rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
        });
    }
    topic.case("viewport", "a viewport is a part of the picture; beside it there is nothing", |rig| {
        let mut scene = around([shape()]);
        (scene.desc.width, scene.desc.height) = (37, 29);
        let v = Viewport { x: 5, y: 3, width: 21, height: 19 };
        scene.desc.viewport = Some(v);
        let frame = rig.lattice("picture", &scene, &How::step(0.3))?;
        let beside = |i: usize| !(v.x..v.x + v.width).contains(&(i % 37)) || !(v.y..v.y + v.height).contains(&(i / 37));
        let clean =
            (0..37 * 29).filter(|&i| beside(i)).all(|i| frame.color[i] == [0.0; 4] && frame.depth[i] == f32::INFINITY);
        rig.holds("beside", clean, "pixels beside the viewport are empty");
        Ok(())
    });
    topic.case("looking_away", "behind the eye there is nothing", |rig| {
        let box_ = bounds(&[shape()]);
        let eye = box_.center() - DVec3::Y * 20.0;
        let scene = scene(Camera::perspective(eye, eye - DVec3::Y, DVec3::Z, 60.0));
        rig.closed("nothing", &scene, &How::step(0.3), &|_, _| Some([0.0; 4])).map(|_| ())
    });
}
