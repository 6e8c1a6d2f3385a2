//! 9: slices along an axis of the data, and the jump where the axis changes.

use volact_core::{Camera, FrameDesc, glam::DVec3};

use super::{
    Answer, Does, Family, Ladder, Measured, Method,
    lab::{Lab, certified, ensure},
    naive::{Mistake, Naive},
};
use crate::{
    cases::stock::shape,
    metrics::{Picture, max_error, wide},
    rig::{Scene, Setup},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 9,
        title: "Slices along an axis of the data: the jump while turning",
        about: "Slices across that axis of the data along which the view looks most lie 1/cosθ farther apart along \
                rays, and as the view turns past 45° all samples move to other places at once: the picture jumps. \
                Volact's core can plan such slices (`SamplingMode::AxisAligned`), but no action of Volact draws \
                them: the slices here are a model.",
        ladders: vec![turning()],
        answers: answers(),
    }
}

/// The usual volume, seen from just before and just after 45°.
fn turned(degrees: f64) -> Scene {
    let center = DVec3::new(3.0, 2.5, 3.5);
    let (y, x) = degrees.to_radians().sin_cos();
    let camera = Camera::orthographic(center + 20.0 * DVec3::new(x, y, 0.31), center, DVec3::Z, 6.0);
    Scene::new([shape()], FrameDesc::new(camera, 24, 24))
}

const SIDES: [f64; 2] = [45.0 - 1e-3, 45.0 + 1e-3];

/// How much more two pictures differ than the true ones do.
fn jump([a, b]: [Picture; 2]) -> Measured {
    let change = |a: &Picture, b: &Picture| -> Picture {
        a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| b[c] - a[c])).collect()
    };
    let [ta, tb] = SIDES.map(|d| certified(&turned(d)));
    Ok(max_error(&change(&a, &b), &change(&ta?, &tb?)))
}

fn turning() -> Ladder {
    let of = |how: fn(f64) -> Setup| {
        move |lab: &Lab, step: f64| {
            let [a, b] = SIDES.map(|d| lab.frame(&how(step), &turned(d)).map(|f| wide(&f)));
            jump([a?, b?])
        }
    };
    Ladder {
        name: "turning",
        title: "The jump between two frames, two thousandths of a degree apart",
        knob: "distance of samples, in voxels",
        truth: "the change of `reference` between the two",
        rungs: vec![0.03, 0.06, 0.125, 0.25, 0.5, 1.0, 2.0],
        methods: vec![
            Method::holds("cpu", 1e-3, of(Setup::post)),
            Method::holds("wgpu, rays", 1e-3, of(|h| Setup::new("wgpu").step(h))),
            Method::holds("wgpu, slices", 1e-3, of(|h| Setup::new("wgpu").with("method", "slices").step(h))),
            Method::holds("vulkan", 1e-3, of(|h| Setup::new("vulkan").step(h))),
            Method::fails("model: slices along an axis of the data", (2e-3, [0.02, 0.5]), |_, step| {
                let [a, b] = SIDES.map(|d| Naive { step, mistake: Mistake::AxisAligned }.draw(&turned(d)));
                jump([a?, b?])
            }),
        ],
    }
}

fn answers() -> Vec<Answer> {
    vec![Answer::new(
        Does::Avoids,
        "No action samples along axes of the data: samples lie on rays, or on planes across the view.",
        |lab| {
            for how in [Setup::cpu(), Setup::new("wgpu").with("method", "slices"), Setup::new("vulkan")] {
                if let Ok(frame) = lab.frame(&how, &turned(45.0)) {
                    let sampling = frame.method.sampling;
                    ensure(
                        !sampling.replace("the view axis", "").contains("axis"),
                        format!("{}: {sampling}", how.name()),
                    )?;
                }
            }
            Ok(())
        },
    )]
}
