//! 7: scenes far away, tiny, huge, mirrored, sheared, and all but flat.

use volact_core::{
    FrameDesc, WarningCode,
    glam::{DAffine3, DMat3, DVec3},
};

use super::{
    Answer, Does, Family, Ladder, Method,
    lab::{Lab, certified, ensure, refused_with},
    naive::{Mistake, Naive},
};
use crate::{
    cases::stock::{absorbed, around, shape, usual, warm},
    metrics::max_error,
    rig::{Scene, Setup},
    scene::{along_y, constant, greys, lut},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 7,
        title: "Places: far away, tiny, huge, sheared, all but flat",
        about: "A position in the world of 32 bits has steps of half a unit at 1e7: samples fall on few places, and \
                the volume becomes a staircase. Numbers that are compared with a fixed small one go wrong at some \
                size. A sheared transform brings layers of samples nearer each other than any two samples of a row are, \
                and a step of half a voxel no longer sees them all.",
        ladders: vec![far(), sizes(), sheared(), flat()],
        answers: answers(),
    }
}

fn moved(distance: f64) -> Scene {
    let shape = shape();
    shape.set_transform(DAffine3::from_translation(DVec3::new(1.0, -0.7, 0.4) * distance));
    small(around([shape]))
}

fn small(mut scene: Scene) -> Scene {
    (scene.desc.width, scene.desc.height) = (16, 16);
    scene
}

fn far() -> Ladder {
    let of = |how: Setup| move |lab: &Lab, d: f64| lab.from_truth(&how, &moved(d));
    Ladder {
        name: "far-away",
        title: "A volume farther and farther from the world's origin",
        knob: "distance in voxels",
        truth: "`reference`",
        rungs: (0..=7).map(|e| 10f64.powi(e)).collect(),
        methods: vec![
            Method::holds("cpu", 5e-3, of(Setup::post(0.1))),
            Method::holds("wgpu", 5e-3, of(Setup::new("wgpu").step(0.1))),
            Method::holds("wgpu, slices", 5e-3, of(Setup::new("wgpu").with("method", "slices").step(0.1))),
            Method::fails("model: positions in f32 in the world", (5e-3, [0.1, 1.0]), |_, d| {
                let found = Naive { step: 0.1, mistake: Mistake::WorldF32 }.draw(&moved(d))?;
                Ok(max_error(&found, &certified(&moved(d))?))
            }),
        ],
    }
}

fn sizes() -> Ladder {
    let scene = |scale: f64| {
        let shape = lut(&usual(), warm(), scale);
        shape.set_transform(DAffine3::from_scale(DVec3::splat(scale)));
        small(around([shape]))
    };
    // What is true at size 1 is true at every size: the certified integral of the plain scene.
    let of = move |how: fn(f64) -> Setup| {
        move |lab: &Lab, scale: f64| lab.error(&how(0.1 * scale), &scene(scale), &certified(&scene(1.0))?)
    };
    Ladder {
        name: "sizes",
        title: "Scene, unit and step scaled together",
        knob: "scale",
        truth: "`reference` at scale 1",
        rungs: (-9..=9).rev().map(|e| 10f64.powi(e)).collect(),
        methods: vec![
            Method::holds("cpu", 5e-3, of(Setup::post)),
            Method::holds("wgpu", 5e-3, of(|h| Setup::new("wgpu").step(h))),
            Method::holds("vulkan", 5e-3, of(|h| Setup::new("vulkan").step(h))),
            Method::fails("model: less than a millionth is nothing", (5e-3, [0.1, 1.0]), move |_, scale| {
                let found = Naive { step: 0.1 * scale, mistake: Mistake::Small }.draw(&scene(scale))?;
                Ok(max_error(&found, &certified(&scene(1.0))?))
            }),
        ],
    }
}

/// The usual volume, mirrored and sheared, from across.
fn leaning(by: f64) -> Scene {
    let shape = shape();
    let columns = DMat3::from_cols(-DVec3::X, DVec3::new(by, 1.0, 0.0), DVec3::Z);
    shape.set_transform(DAffine3::from_mat3(columns));
    let mut scene = small(around([shape]));
    // The middle of the volume, however far it is drawn out.
    let target = DVec3::new(-3.0 + 2.5 * by, 2.5, 3.5);
    scene.desc.camera = volact_core::Camera::orthographic(target + DVec3::new(5.0, -9.0, 6.0), target, DVec3::Z, 6.0);
    scene
}

fn sheared() -> Ladder {
    let of = move |how: fn(f64) -> Setup| move |lab: &Lab, by: f64| lab.from_truth(&how(by), &leaning(by));
    Ladder {
        name: "sheared",
        title: "A mirrored volume, sheared more and more",
        knob: "shear of y along x",
        truth: "`reference`",
        rungs: vec![0.01, 0.1, 1.0, 3.0, 10.0, 30.0, 100.0],
        methods: vec![
            Method::holds("cpu, a tenth of the layers' distance", 5e-3, of(|by| Setup::post(0.1 / by.hypot(1.0)))),
            Method::holds("wgpu, the same", 5e-3, of(|by| Setup::new("wgpu").step(0.1 / by.hypot(1.0)))),
            Method::fails("cpu, as it is by default", (2e-2, [0.03, 1.0]), of(|_| Setup::cpu())),
        ],
    }
}

/// A volume all but flat along y, whose unit is as thin.
fn thin(height: f64) -> Scene {
    let shape = lut(&constant(1.0, [2, 2, 2]), greys(&[(1.0, 1.0, 0.5)]), height);
    shape.set_transform(DAffine3::from_scale(DVec3::new(1.0, height, 1.0)));
    Scene::new([shape], FrameDesc { width: 3, height: 3, ..along_y(1.0, 1.0) })
}

fn flat() -> Ladder {
    let wanted = [[absorbed(0.5, 2.0); 4]; 9];
    let of = move |how: fn(f64) -> Setup| move |lab: &Lab, h: f64| lab.error(&how(0.3 * h), &thin(h), &wanted);
    Ladder {
        name: "all-but-flat",
        title: "A volume of constant opacity pressed flat, with its unit",
        knob: "height of a voxel; its width is 1",
        truth: "closed form, 0.75",
        rungs: vec![1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8],
        methods: vec![
            Method::refuses("cpu", ("larger sample_distance", 1e-5), of(Setup::post)),
            Method::refuses("wgpu", ("larger sample_distance", 1e-5), of(|h| Setup::new("wgpu").step(h))),
        ],
    }
}

fn answers() -> Vec<Answer> {
    vec![
        Answer::new(
            Does::Refuses,
            "A transform without an inverse, or with a number that is none, is an error that names the shape.",
            |lab| {
                for map in [DVec3::new(1.0, 0.0, 1.0), DVec3::splat(f64::NAN), DVec3::splat(1e-200)] {
                    let shape = shape().named("pressed");
                    shape.set_transform(DAffine3::from_scale(map));
                    let scene = Scene::new([shape], along_y(1.0, 1.0));
                    refused_with(lab.frame(&Setup::cpu(), &scene), &["pressed", "transform"])?;
                }
                Ok(())
            },
        ),
        Answer::new(
            Does::Detects,
            "Where a transform shears layers of samples nearer each other than half of the smallest voxel, and the \
             step is longer than that, the frame warns of it (`coarse-sampling`), with the distance.",
            |lab| {
                for (by, warns) in [(0.7, false), (10.0, true)] {
                    for how in [Setup::cpu(), Setup::new("wgpu"), Setup::new("vulkan").step(0.5)] {
                        let Ok(frame) = lab.frame(&how, &leaning(by)) else { continue };
                        let found = frame.warnings.iter().any(|w| w.code == WarningCode::CoarseSampling);
                        ensure(found == warns, format!("{} at {by}: {:?}", how.name(), frame.warnings))?;
                    }
                }
                Ok(())
            },
        ),
        Answer::new(
            Does::Adapts,
            "`vulkan`, left to itself, takes its planes as near each other as the layers that the transform shears, \
             and the frame says how near.",
            |lab| {
                let Ok(frame) = lab.frame(&Setup::new("vulkan"), &leaning(10.0)) else { return Ok(()) };
                let (step, layers) = (frame.method.sample_distance, 1.0 / 10f64.hypot(1.0));
                ensure(step <= layers, format!("planes {step} apart, layers {layers}"))
            },
        ),
        Answer::new(
            Does::Refuses,
            "A step that would take more than 1e7 samples along a ray is an error with the cure, at once.",
            |lab| refused_with(lab.frame(&Setup::post(1e-12), &thin(1.0)), &["larger sample_distance"]),
        ),
    ]
}
