//! 1: wide views, an eye inside, a near plane that cuts.

use volact_core::{Camera, FrameDesc, Projection, glam::DAffine3, glam::DVec3};

use super::{
    Answer, Does, Family, Ladder, Measured, Method,
    lab::{Lab, ensure, refused_with},
    naive::{Mistake, Naive},
};
use crate::{
    cases::stock::{absorbed, shape},
    metrics::{Picture, max_error},
    rig::{Scene, Setup},
    scene::{constant, greys, lut},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 1,
        title: "Wide perspective, an eye inside, a near plane that cuts",
        about: "Slices across the view axis are h apart along the axis, and h/cosθ apart along a ray beside it. One \
                opacity for a whole slice is too thin beside the middle of the picture, the more so the wider the \
                view. Rasterisers need a near plane, and lose what lies before it when the eye is inside; and slices \
                that are drawn whole or not at all move the cut by up to a slice.",
        ladders: vec![wide(), inside(), cut()],
        answers: answers(),
    }
}

const PIXELS: usize = 16;

/// A wall a unit thick and 4000 wide, seen head on from half a unit before it.
fn wall(fov: f64) -> Scene {
    let shape = lut(&constant(1.0, [2, 1, 2]), greys(&[(1.0, 0.8, 0.2)]), 1.0);
    let place = DVec3::new(-2000.0, 0.0, -2000.0);
    shape.set_transform(DAffine3::from_translation(place) * DAffine3::from_scale(DVec3::new(2000.0, 1.0, 2000.0)));
    let camera = Camera::perspective(DVec3::new(0.0, -0.5, 0.0), DVec3::ZERO, DVec3::Z, fov);
    Scene::new([shape], FrameDesc::new(camera, PIXELS, PIXELS))
}

/// 1 − (1 − a)^(1/cosθ) of every pixel.
fn through_wall(fov: f64) -> Picture {
    let half = (0.5 * fov).to_radians().tan();
    let at = |i: usize| ((i as f64 + 0.5) / PIXELS as f64 * 2.0 - 1.0) * half;
    let pixel = |i: usize| {
        let alpha = absorbed(0.2, (1.0 + at(i % PIXELS).powi(2) + at(i / PIXELS).powi(2)).sqrt());
        [0.8 * alpha, 0.8 * alpha, 0.8 * alpha, alpha]
    };
    (0..PIXELS * PIXELS).map(pixel).collect()
}

fn wide() -> Ladder {
    let with = |how: Setup| move |lab: &Lab, fov: f64| lab.error(&how, &wall(fov), &through_wall(fov));
    Ladder {
        name: "field-of-view",
        title: "A wall of constant opacity through wider and wider views",
        knob: "vertical field of view in degrees",
        truth: "closed form, 1 − (1 − a)^(1/cosθ)",
        rungs: vec![4.0, 30.0, 60.0, 90.0, 120.0, 150.0, 170.0, 179.0],
        methods: vec![
            Method::holds("cpu", 1e-5, with(Setup::post(0.25))),
            Method::holds("wgpu, slices", 1e-4, with(Setup::new("wgpu").with("method", "slices").step(0.25))),
            Method::holds("vulkan", 1e-4, with(Setup::new("vulkan").step(0.25))),
            Method::fails("model: slices of one opacity", (1e-3, [0.5, 0.9]), |_, fov| {
                let found = Naive { step: 0.25, mistake: Mistake::NoCosine }.draw(&wall(fov))?;
                Ok(max_error(&found, &through_wall(fov)))
            }),
        ],
    }
}

const CENTER: DVec3 = DVec3::new(3.0, 2.5, 3.5);

/// The usual volume, 5 voxels deep, from an eye so far before its back face.
fn within(distance: f64, near: f64) -> Scene {
    let eye = DVec3::new(3.1, 5.0 - distance, 3.3);
    let projection = Projection::Perspective { fov_y: 80.0 };
    let target = eye + DVec3::new(0.3, 2.0, -0.4);
    let camera = Camera::LookAt { eye, target, up: DVec3::Z, projection, near, far: f64::INFINITY };
    Scene::new([shape()], FrameDesc::new(camera, PIXELS, PIXELS))
}

fn inside() -> Ladder {
    let with = |how: Setup| move |lab: &Lab, distance: f64| lab.from_truth(&how, &within(distance, 0.0));
    Ladder {
        name: "eye-inside",
        title: "An eye that moves through the front face into the volume",
        knob: "distance of the eye from the back face, in voxels; the front face is at 5",
        truth: "`reference`",
        rungs: vec![10.0, 7.0, 5.6, 5.1, 5.0, 5.0 - 1e-6, 4.9, 4.0, 2.0, 1.0],
        methods: vec![
            Method::holds("cpu", 2e-3, with(Setup::post(0.05))),
            Method::holds("wgpu, slices", 2e-3, with(Setup::new("wgpu").with("method", "slices").step(0.05))),
            Method::holds("vulkan", 2e-3, with(Setup::new("vulkan").step(0.05))),
            Method::fails(
                "model: a near plane of half a voxel, as rasterisers have",
                (2e-3, [0.02, 0.5]),
                |lab, distance| {
                    let truth = super::lab::certified(&within(distance, 0.0))?;
                    lab.error(&Setup::post(0.05), &within(distance, 0.5), &truth)
                },
            ),
        ],
    }
}

/// A near plane within the volume.
fn cut() -> Ladder {
    let scene = || {
        let eye = CENTER + DVec3::new(0.6, -1.0, 0.45).normalize() * 12.0;
        let projection = Projection::Perspective { fov_y: 30.0 };
        let camera = Camera::LookAt { eye, target: CENTER, up: DVec3::Z, projection, near: 10.61, far: f64::INFINITY };
        Scene::new([shape()], FrameDesc::new(camera, PIXELS, PIXELS))
    };
    let with = move |how: fn(f64) -> Setup| move |lab: &Lab, step: f64| lab.from_truth(&how(step), &scene());
    Ladder {
        name: "near-plane",
        title: "A near plane within the volume, and coarser and coarser steps",
        knob: "distance of samples, in voxels",
        truth: "`reference`",
        rungs: vec![0.01, 0.03, 0.1, 0.2, 0.4, 0.8],
        methods: vec![
            Method::holds("cpu", 3e-2, with(Setup::post)),
            Method::holds("wgpu, slices", 3e-2, with(|h| Setup::new("wgpu").with("method", "slices").step(h))),
            Method::holds("vulkan", 3e-2, with(|h| Setup::new("vulkan").step(h))),
            Method::fails("model: slices drawn whole or not at all", (1e-2, [0.05, 0.5]), move |_, step| {
                let found = Naive { step, mistake: Mistake::Whole }.draw(&scene())?;
                Ok(max_error(&found, &super::lab::certified(&scene())?))
            }),
        ],
    }
}

fn draws(lab: &Lab, fov: f64) -> Measured {
    lab.error(&Setup::post(0.25), &wall(fov), &through_wall(fov))
}

fn answers() -> Vec<Answer> {
    vec![
        Answer::new(
            Does::Avoids,
            "Rays carry their own lengths, and slices stand for slabs that every fragment cuts for itself: both are \
             right to rounding at 179°.",
            |lab| draws(lab, 179.0).map_err(|e| format!("{e:?}")).and_then(|e| ensure(e < 1e-5, format!("error {e}"))),
        ),
        Answer::new(Does::Refuses, "A field of view of 180° or more is an error that names it.", |lab| {
            refused_with(draws(lab, 180.0), &["field of view"])
        }),
        Answer::new(
            Does::Refuses,
            "A near plane behind the far plane, and an eye at its own target, are errors.",
            |lab| {
                let mut scene = within(1.0, 2.0);
                if let Camera::LookAt { far, .. } = &mut scene.desc.camera {
                    *far = 1.0;
                }
                refused_with(lab.frame(&Setup::cpu(), &scene), &["far"])?;
                if let Camera::LookAt { eye, target, far, .. } = &mut scene.desc.camera {
                    (*target, *far) = (*eye, f64::INFINITY);
                }
                refused_with(lab.frame(&Setup::cpu(), &scene), &["target"])
            },
        ),
    ]
}
