//! 12: what does not fit, devices that are lost, plugins that fail in the middle.

use volact_core::{Camera, FrameDesc, ScalarType, WarningCode, glam::DVec3};

use super::{
    Answer, Does, Family, Ladder, Method,
    lab::{Lab, ensure, refused_with},
};
use crate::{
    cases::stock::{around, shape, warm},
    metrics::identical,
    rig::{Scene, Setup, draw, draw_managed},
    scene::{lut, volume},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 12,
        title: "What does not fit, lost devices, plugins that fail in the middle",
        about: "A texture longer than a device can hold, a ray of more samples than can be counted, a device that is \
                pulled out, a library that panics while it draws. Volact has no budget of memory that a user sets: \
                volumes are held whole, and what a device cannot hold is refused; what can be bounded is the number \
                of planes of `vulkan`. That a plugin that fails or panics in any call is an error that names it, and \
                the host goes on, is tested in `plugin/tests/broken.rs` and `plugin/tests/rust.rs`; that a device \
                that is lost is one, in `tests/tests/stability.rs`.",
        ladders: vec![long_axis(), fine_step(), few_planes()],
        answers: answers(),
    }
}

fn long_axis() -> Ladder {
    let scene = |count: f64| {
        let n = count as usize;
        let data = volume([n, 2, 2], ScalarType::U8, |p| (p.x * 7.0) % 100.0);
        let target = DVec3::new(0.9 * count, 0.5, 0.5);
        let camera = Camera::orthographic(target - DVec3::new(3.0, 9.0, 2.0), target, DVec3::Z, 0.8);
        Scene::new([lut(&data, warm(), 1.0)], FrameDesc::new(camera, 12, 12))
    };
    let of = move |how: Setup| move |lab: &Lab, count: f64| lab.from_truth(&how, &scene(count));
    Ladder {
        name: "long-axis",
        title: "An axis longer than textures may be",
        knob: "samples along the axis",
        truth: "`reference`",
        rungs: vec![16.0, 256.0, 1024.0, 2048.0, 100_000.0],
        methods: vec![
            Method::holds("cpu", 2e-2, of(Setup::post(0.05))),
            Method::refuses("wgpu", ("100000", 2e-2), of(Setup::new("wgpu").step(0.05))),
            Method::refuses("vulkan", ("100000", 2e-2), of(Setup::new("vulkan").step(0.05))),
        ],
    }
}

fn small() -> Scene {
    let mut scene = around([shape()]);
    (scene.desc.width, scene.desc.height) = (6, 6);
    scene
}

fn fine_step() -> Ladder {
    Ladder {
        name: "fine-step",
        title: "Steps that take more and more samples",
        knob: "step, in voxels",
        truth: "`reference`",
        rungs: vec![0.1, 0.01, 1e-3, 1e-4, 1e-9],
        methods: vec![Method::refuses("cpu", ("larger sample_distance", 5e-3), |lab: &Lab, step| {
            lab.from_truth(&Setup::post(step), &small())
        })],
    }
}

fn bounded(count: f64) -> Setup {
    Setup::new("vulkan").step(0.05).with("max_planes", count as i64)
}

fn few_planes() -> Ladder {
    Ladder {
        name: "few-planes",
        title: "Fewer and fewer planes allowed",
        knob: "`max_planes`, where the step asks for some 200",
        truth: "`reference`",
        rungs: vec![1000.0, 250.0, 100.0, 50.0, 25.0, 10.0, 5.0, 2.0],
        methods: vec![Method::fails("vulkan", (5e-3, [0.1, 1.0]), |lab: &Lab, count| {
            lab.from_truth(&bounded(count), &small())
        })],
    }
}

fn answers() -> Vec<Answer> {
    vec![
        Answer::new(
            Does::Detects,
            "Where `max_planes` holds planes farther apart than the step, the frame warns (`setting-adjusted`) with \
             both distances and gives the one drawn.",
            |lab| {
                for (count, warns) in [(1000.0, false), (10.0, true)] {
                    let Ok(frame) = lab.frame(&bounded(count), &small()) else { return Ok(()) };
                    let found = frame.warnings.iter().any(|w| w.code == WarningCode::SettingAdjusted);
                    let wide = frame.method.sample_distance > 0.05;
                    ensure(found == warns && wide == warns, format!("at {count}: {:?}", frame.warnings))?;
                }
                Ok(())
            },
        ),
        Answer::new(
            Does::Refuses,
            "A picture of more pixels than can be is refused before memory is taken for it.",
            |lab| {
                let mut scene = small();
                (scene.desc.width, scene.desc.height) = (1 << 20, 1 << 20);
                refused_with(lab.frame(&Setup::cpu(), &scene), &["size is 1048576"])
            },
        ),
        Answer::new(
            Does::Avoids,
            "After an error an action is usable again, and draws the same bits as a fresh one.",
            |lab| {
                let mut action = Setup::post(1e-12).action_in(lab.registry());
                let scene = small();
                ensure(draw(&mut *action, &scene.shapes, &scene.desc).is_err(), "drawn in 1e13 samples")?;
                action.set_option("sample_distance", 0.3.into()).map_err(|e| e.to_string())?;
                let found = draw_managed(&mut *action, &scene.shapes, &scene.desc).map_err(|e| e.to_string())?;
                let fresh = lab.frame(&Setup::post(0.3), &scene).map_err(|e| format!("{e:?}"))?;
                ensure(identical(&found, &fresh), "the pictures differ")
            },
        ),
    ]
}
