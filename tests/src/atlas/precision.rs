//! 3: few bits: of what is accumulated, and of the weights of interpolation.

use volact_core::{Camera, FrameDesc, ScalarType, glam::DVec3};

use super::{
    Answer, Does, Family, Ladder, Measured, Method,
    lab::{Lab, ensure},
    naive::{Mistake, Naive},
};
use crate::{
    metrics::max_error,
    rig::{Scene, Setup},
    scene::{along_y, constant, greys, lut, volume},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 3,
        title: "Few bits: 8-bit and 16-bit accumulation, 8-bit filter weights",
        about: "What is blended slice by slice into 8 bits is rounded at every slice, and a slice that adds less than \
                half a step adds nothing: at 512 slices nothing at all is left. 16 bits, fixed or floating, put it \
                off to some thousand slices. Samplers of GPUs interpolate with weights of 8 bits, which a steep table \
                shows as steps. Volact has no target of fewer bits than f32; the 8-bit ones here are models.",
        ladders: vec![slices(), weights()],
        answers: answers(),
    }
}

/// A slab of half opacity, 4 long, in so many segments.
fn slab() -> Scene {
    Scene::new([lut(&constant(1.0, [1, 4, 1]), greys(&[(1.0, 0.5, 0.5)]), 4.0)], along_y(0.5, 0.5))
}

const SLAB: [f64; 4] = [0.25, 0.25, 0.25, 0.5];

fn slices() -> Ladder {
    let step = |count: f64| 4.0 / count;
    let of = move |how: fn(f64) -> Setup| move |lab: &Lab, n: f64| lab.error(&how(step(n)), &slab(), &[SLAB]);
    let model = move |mistake: Mistake| {
        move |_: &Lab, n: f64| -> Measured { Ok(max_error(&Naive { step: step(n), mistake }.draw(&slab())?, &[SLAB])) }
    };
    Ladder {
        name: "slices",
        title: "A slab of half opacity in more and more slices",
        knob: "slices",
        truth: "closed form, 0.5",
        rungs: vec![2.0, 16.0, 64.0, 128.0, 256.0, 512.0, 1024.0, 2048.0, 4096.0],
        methods: vec![
            Method::holds("cpu", 2e-5, of(Setup::post)),
            Method::holds("wgpu, rays", 1e-4, of(|h| Setup::new("wgpu").step(h))),
            Method::holds("wgpu, slices", 1e-4, of(|h| Setup::new("wgpu").with("method", "slices").step(h))),
            Method::holds("vulkan", 1e-4, of(|h| Setup::new("vulkan").step(h))),
            Method::fails("model: 8-bit target", (5e-3, [0.499, 0.501]), model(Mistake::Fixed(8))),
            Method::fails("model: 16-bit target", (1e-4, [1e-3, 0.1]), model(Mistake::Fixed(16))),
            Method::fails("model: f16 target", (1e-3, [0.05, 0.5]), model(Mistake::Half)),
        ],
    }
}

/// The width of a pixel: a window has some 19 of them, which meet no eighth bit together.
fn pixel(contrast: f64) -> f64 {
    1.0 / (19.3 * contrast)
}

/// One cell, whose values from 0 to 1 are seen through a window that is so many times narrower.
fn magnified(contrast: f64) -> Scene {
    let data = volume([2, 2, 2], ScalarType::F32, |p| p.x);
    let half = 0.5 / contrast;
    let table = greys(&[(0.5 - half, 0.0, 0.99), (0.5 + half, 1.0, 0.99)]);
    let camera = Camera::orthographic(DVec3::new(0.5, -9.0, 0.5), DVec3::new(0.5, 0.0, 0.5), DVec3::Z, pixel(contrast));
    Scene::new([lut(&data, table, 0.25)], FrameDesc::new(camera, 33, 1))
}

/// The grey is the place within the window: one row of 33 pixels.
fn window(contrast: f64) -> Vec<[f64; 4]> {
    let alpha = 1.0 - 0.01f64.powi(4);
    let color = |i: usize| {
        let x = 0.5 + (i as f64 - 16.0) * pixel(contrast);
        let grey = ((x - 0.5) * contrast + 0.5).clamp(0.0, 1.0);
        let a = if (0.0..=1.0).contains(&x) { alpha } else { 0.0 };
        [grey * a, grey * a, grey * a, a]
    };
    (0..33).map(color).collect()
}

fn weights() -> Ladder {
    let of = |how: Setup| move |lab: &Lab, contrast: f64| lab.error(&how, &magnified(contrast), &window(contrast));
    Ladder {
        name: "filter-weights",
        title: "One cell through a narrower and narrower window",
        knob: "values of the cell, in widths of the window",
        truth: "closed form, a ramp",
        rungs: vec![1.0, 4.0, 16.0, 64.0, 128.0, 256.0, 512.0, 1024.0],
        methods: vec![
            Method::holds("cpu", 1e-3, of(Setup::post(0.25))),
            Method::holds("wgpu", 1e-3, of(Setup::new("wgpu").step(0.25))),
            Method::holds("vulkan", 1e-3, of(Setup::new("vulkan").step(0.25))),
            Method::fails("model: weights of 8 bits", (2e-3, [0.3, 1.0]), |_, contrast| {
                let found = Naive { step: 0.25, mistake: Mistake::Weights(8) }.draw(&magnified(contrast))?;
                Ok(max_error(&found, &window(contrast)))
            }),
        ],
    }
}

fn answers() -> Vec<Answer> {
    let said = |lab: &Lab, how: &Setup| match lab.frame(how, &slab()) {
        Ok(frame) => Ok(Some(frame.method)),
        Err(super::Missing::Skipped(_)) => Ok(None),
        Err(e) => Err(format!("{e:?}")),
    };
    let actions =
        || [Setup::cpu(), Setup::new("wgpu"), Setup::new("wgpu").with("method", "slices"), Setup::new("vulkan")];
    vec![
        Answer::new(Does::Avoids, "Every action accumulates in f32, and every frame says so.", move |lab| {
            for how in actions() {
                if let Some(method) = said(lab, &how)? {
                    ensure(method.blend.contains("f32"), format!("{}: {:?}", how.name(), method.blend))?;
                }
            }
            Ok(())
        }),
        Answer::new(
            Does::Avoids,
            "By default values are interpolated in f32 by the shader itself; the device's sampler is taken only where \
             `filter: \"hardware\"` asks for it, and the frame says so.",
            move |lab| {
                for how in actions() {
                    if let Some(method) = said(lab, &how)? {
                        ensure(!method.filter.contains("hardware"), format!("{}: {:?}", how.name(), method.filter))?;
                    }
                }
                let hardware = said(lab, &Setup::new("wgpu").with("filter", "hardware"))?;
                ensure(hardware.is_none_or(|m| m.filter.contains("hardware")), "it does not say hardware")
            },
        ),
    ]
}
