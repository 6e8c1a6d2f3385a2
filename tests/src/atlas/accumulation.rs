//! 11: the order of sums, threads, vector units.

use volact_core::{ScalarType, Shape, glam::DAffine3, glam::DVec3};

use super::{
    Answer, Does, Family, Ladder, Measured, Method,
    lab::{Lab, certified, ensure},
    naive::{Mistake, Naive},
};
use crate::{
    cases::stock::{around, shape, through, warm, waves},
    metrics::{identical, max_error, wide},
    rig::{Scene, Setup},
    scene::lut,
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 11,
        title: "Order of drawing, threads, vector units",
        about: "Sums of f32 depend on their order. Where threads or vectors share a sum, or shapes are laid over each \
                other in the order of drawing, the picture depends on what should mean nothing; where shapes overlap, \
                one laid over the other is wrong in either order.",
        ladders: vec![threads(), units(), order()],
        answers: answers(),
    }
}

fn scene() -> Scene {
    through([shape()])
}

fn threads() -> Ladder {
    let one = |lab: &Lab| lab.frame(&Setup::cpu().with("threads", 1i64), &scene());
    Ladder {
        name: "threads",
        title: "The same picture by more and more threads",
        knob: "threads",
        truth: "one thread, bit by bit",
        rungs: vec![1.0, 2.0, 3.0, 5.0, 8.0, 16.0],
        methods: vec![Method::holds("cpu", 0.0, move |lab, count| {
            let frame = lab.frame(&Setup::cpu().with("threads", count as i64), &scene())?;
            Ok(if identical(&frame, &one(lab)?) { 0.0 } else { f64::INFINITY })
        })],
    }
}

fn units() -> Ladder {
    // A long ray of many samples.
    let scene = || {
        let data = waves([7, 6, 8], ScalarType::F32);
        around([lut(&data, warm(), 4.0)])
    };
    let of = move |unit: &'static str| {
        move |lab: &Lab, count: f64| {
            let how = Setup::post(10.0 / count);
            let best = wide(&lab.frame(&how, &scene())?);
            match lab.frame(&how.with("unit", unit), &scene()) {
                Err(super::Missing::Refused(why)) if why.contains(unit) => Err(super::Missing::Skipped(why)),
                other => Ok(max_error(&wide(&other?), &best)),
            }
        }
    };
    Ladder {
        name: "vector-units",
        title: "Vector units against the widest, over more and more samples",
        knob: "samples along the longest rays, about",
        truth: "the widest unit of the machine",
        rungs: vec![16.0, 64.0, 256.0, 1024.0, 4096.0],
        methods: vec![
            Method::holds("cpu, AVX-512", 0.0, of("avx512")),
            Method::holds("cpu, AVX2", 0.0, of("avx2")),
            Method::holds("cpu, plain x86-64", 1e-4, of("plain")),
        ],
    }
}

/// Shapes that overlap, each a voxel farther, turned a little.
fn crowd(count: usize) -> Vec<Shape> {
    let place = |i: usize| {
        let shape = shape();
        let moved = DAffine3::from_translation(DVec3::new(1.1, 0.6, -0.4) * i as f64);
        shape.set_transform(moved * DAffine3::from_rotation_z(0.3 * i as f64));
        shape
    };
    (0..count).map(place).collect()
}

fn order() -> Ladder {
    let scene = |count: f64| {
        let mut scene = around(crowd(count as usize));
        (scene.desc.width, scene.desc.height) = (12, 12);
        scene
    };
    let of = move |how: Setup| {
        move |lab: &Lab, count: f64| -> Measured {
            let scene = scene(count);
            let [a, b] = [&scene, &scene.reversed()].map(|s| lab.frame(&how, s).map(|f| wide(&f)));
            let truth = certified(&scene)?;
            Ok(max_error(&a?, &truth).max(max_error(&b?, &truth)))
        }
    };
    Ladder {
        name: "order",
        title: "Shapes that overlap, drawn forwards and backwards",
        knob: "shapes",
        truth: "`reference`; the worse of the two orders",
        rungs: vec![1.0, 2.0, 3.0, 5.0],
        methods: vec![
            Method::holds("cpu", 5e-3, of(Setup::post(0.1))),
            Method::holds("wgpu", 5e-3, of(Setup::new("wgpu").step(0.1))),
            Method::fails("model: laid over each other as drawn", (5e-3, [0.1, 1.0]), move |_, count| {
                let scene = scene(count);
                let [a, b] = [&scene, &scene.reversed()].map(|s| Naive { step: 0.1, mistake: Mistake::None }.draw(s));
                let truth = certified(&scene)?;
                Ok(max_error(&a?, &truth).max(max_error(&b?, &truth)))
            }),
        ],
    }
}

fn answers() -> Vec<Answer> {
    vec![
        Answer::new(Does::Avoids, "The order of drawing changes no bit of `cpu`'s picture.", |lab| {
            let scene = around(crowd(3));
            let draw = |s: &Scene| lab.frame(&Setup::cpu(), s).map_err(|e| format!("{e:?}"));
            ensure(identical(&draw(&scene)?, &draw(&scene.reversed())?), "the pictures differ")
        }),
        Answer::new(Does::Detects, "The frame says which vector unit or device drew it.", |lab| {
            let method = lab.frame(&Setup::cpu().with("unit", "plain"), &scene()).map_err(|e| format!("{e:?}"))?.method;
            ensure(method.device.contains("plain"), method.device)
        }),
    ]
}
