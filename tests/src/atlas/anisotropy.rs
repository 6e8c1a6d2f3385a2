//! 6: voxels that are long, axes of few samples, sizes that are no powers of two, pictures of one row.

use volact_core::{Camera, FrameDesc, ScalarType, VolumeDesc, WarningCode, glam::DVec3};

use super::{
    Answer, Does, Family, Ladder, Method,
    lab::{Lab, certified, ensure, unwarned},
    naive::{Mistake, Naive},
};
use crate::{
    cases::stock::{rule, warm},
    metrics::max_error,
    rig::{Scene, Setup},
    scene::{lut, placed, volume},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 6,
        title: "Anisotropy, axes of one and two samples, odd sizes, pictures of one row",
        about: "A step of half the longest voxel misses what the shortest show. Where the first sample of an axis is \
                taken to lie half a voxel inside, as texel centres do, everything is off by up to half a voxel, and \
                an axis of two samples is mostly clamped border.",
        ladders: vec![long(), few(), row()],
        answers: answers(),
    }
}

/// 9 × 9 × 9 samples whose voxels are so long along z.
fn drawn_out(by: f64) -> Scene {
    let desc = VolumeDesc { spacing: DVec3::new(1.0, 1.0, by), ..VolumeDesc::new([9, 9, 9], ScalarType::F32, 1) };
    let target = DVec3::new(4.0, 4.0, 4.0 * by);
    let camera = Camera::orthographic(target + DVec3::new(6.0, -9.0, 4.0), target, DVec3::Z, 8.0);
    Scene::new([lut(&placed(desc, rule), warm(), 1.0)], FrameDesc::new(camera, 16, 16))
}

fn long() -> Ladder {
    let of = |how: fn(f64) -> Setup| move |lab: &Lab, by: f64| lab.from_truth(&how(by), &drawn_out(by));
    Ladder {
        name: "anisotropy",
        title: "Voxels of 1 × 1 × 1 to 1 × 1 × 1000",
        knob: "length of a voxel; its width is 1",
        truth: "`reference`",
        rungs: vec![1.0, 2.0, 5.0, 10.0, 30.0, 100.0, 300.0, 1000.0],
        methods: vec![
            Method::holds("cpu, as it is by default", 2e-2, of(|_| Setup::cpu())),
            Method::holds("wgpu, as it is by default", 2e-2, of(|_| Setup::new("wgpu"))),
            Method::holds(
                "wgpu, slices, as it is by default",
                4e-2,
                of(|_| Setup::new("wgpu").with("method", "slices")),
            ),
            Method::fails("cpu, a step of half the longest voxel", (2e-2, [0.05, 1.0]), of(|by| Setup::post(0.5 * by))),
        ],
    }
}

/// A ramp along x over 0..100, in so many samples, from the side.
fn few() -> Ladder {
    let scene = |count: f64| {
        let n = count as usize;
        let top = (n.max(2) - 1) as f64;
        let desc =
            VolumeDesc { spacing: DVec3::new(8.0 / top, 4.0, 4.0), ..VolumeDesc::new([n, 2, 2], ScalarType::F32, 1) };
        let shape = lut(&placed(desc, move |p| 100.0 * p.x / top), warm(), 2.0);
        let bounds = shape.state().world_bounds();
        let camera = Camera::orthographic(bounds.center() - DVec3::Y * 20.0, bounds.center(), DVec3::Z, 7.0);
        Scene::new([shape], FrameDesc::new(camera, 16, 16))
    };
    let of = move |how: Setup| move |lab: &Lab, count: f64| lab.from_truth(&how, &scene(count));
    Ladder {
        name: "samples-of-an-axis",
        title: "A ramp in fewer and fewer samples",
        knob: "samples along the axis",
        truth: "`reference`",
        rungs: vec![513.0, 512.0, 129.0, 127.0, 65.0, 33.0, 17.0, 7.0, 5.0, 3.0, 2.0, 1.0],
        methods: vec![
            Method::holds("cpu", 1e-5, of(Setup::post(0.5))),
            Method::holds("wgpu", 1e-5, of(Setup::new("wgpu").step(0.5))),
            Method::fails("model: samples at texel centres", (1e-2, [0.1, 1.0]), move |_, count| {
                let found = Naive { step: 0.5, mistake: Mistake::TexelCentres }.draw(&scene(count))?;
                Ok(max_error(&found, &certified(&scene(count))?))
            }),
        ],
    }
}

/// One row of pixels over a volume, from one to 8192.
fn across(count: f64) -> Scene {
    let data = volume([33, 3, 3], ScalarType::F32, rule);
    // All of its length, whatever the number of pixels.
    let camera = Camera::orthographic(DVec3::new(16.0, -9.0, 1.0), DVec3::new(16.0, 0.0, 1.0), DVec3::Z, 31.7 / count);
    Scene::new([lut(&data, warm(), 1.0)], FrameDesc::new(camera, count as usize, 1))
}

/// One column of pixels over a volume that stands.
fn down(count: f64) -> Scene {
    let data = volume([3, 3, 33], ScalarType::F32, |p| rule(DVec3::new(p.z, p.y, p.x)));
    let camera = Camera::orthographic(DVec3::new(1.0, -9.0, 16.0), DVec3::new(1.0, 0.0, 16.0), DVec3::Z, 31.7);
    Scene::new([lut(&data, warm(), 1.0)], FrameDesc::new(camera, 1, count as usize))
}

fn row() -> Ladder {
    let of = |how: Setup, scene: fn(f64) -> Scene| move |lab: &Lab, count: f64| lab.from_truth(&how, &scene(count));
    Ladder {
        name: "one-row",
        title: "Pictures of 1 × 1 to 8192 × 1 and 1 × 8192",
        knob: "pixels",
        truth: "`reference`",
        rungs: vec![1.0, 2.0, 3.0, 15.0, 17.0, 257.0, 8192.0],
        methods: vec![
            Method::holds("cpu, a row", 2e-3, of(Setup::post(0.05), across)),
            Method::holds("cpu, a column", 2e-3, of(Setup::post(0.05), down)),
            Method::holds("wgpu, a row", 2e-3, of(Setup::new("wgpu").step(0.05), across)),
            Method::holds("wgpu, a column", 2e-3, of(Setup::new("wgpu").step(0.05), down)),
            Method::holds("vulkan, a row", 2e-3, of(Setup::new("vulkan").step(0.05), across)),
            Method::holds("vulkan, a column", 2e-3, of(Setup::new("vulkan").step(0.05), down)),
        ],
    }
}

fn answers() -> Vec<Answer> {
    let adapts = Answer::new(
        Does::Adapts,
        "The step by default is half of the smallest voxel in the world, and the frame says which it was.",
        |lab| {
            let step =
                lab.frame(&Setup::cpu(), &drawn_out(1000.0)).map_err(|e| format!("{e:?}"))?.method.sample_distance;
            ensure(step == 0.5, format!("step {step}"))
        },
    );
    let silent = Answer::new(
        Does::Silent,
        "A step far above a voxel is taken as asked for; it is warned of only where segments are so long that they \
         hide how dense they are (`coarse-sampling`).",
        |lab| {
            unwarned(lab.frame(&Setup::post(5.0), &drawn_out(10.0)))?;
            let frame = lab.frame(&Setup::post(500.0), &drawn_out(1000.0)).map_err(|e| format!("{e:?}"))?;
            let warned = frame.warnings.iter().any(|w| w.code == WarningCode::CoarseSampling);
            ensure(warned, format!("no warning among {:?}", frame.warnings))
        },
    );
    vec![adapts, silent]
}
