//! 8: NaN, infinities, denormals, huge ranges, small differences on large offsets.

use volact_core::{ScalarType, glam::DVec3};

use super::{
    Answer, Does, Family, Ladder, Method, Missing,
    lab::{Lab, certified, ensure, relative},
    naive::{Mistake, Naive},
};
use crate::{
    cases::stock::{absorbed, around, rule, warm},
    metrics::max_error,
    rig::{Scene, Setup},
    scene::{along_y, colors, constant, greys, lut, volume},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 8,
        title: "Numbers: NaN, infinities, denormals, huge ranges, large offsets",
        about: "A value that is no number spreads through every sum that it meets, or is read as 0 and drawn as if it \
                were data. Ranges of 1e30 leave formats of 16 bits, and their squares leave f32. Differences of 1e-7 \
                of the value are lost when it is made f32.",
        ladders: vec![ranges(), offsets(), holes()],
        answers: answers(),
    }
}

fn small(mut scene: Scene) -> Scene {
    (scene.desc.width, scene.desc.height) = (16, 16);
    scene
}

/// The usual field and table, their values times a power of ten.
fn scaled(scale: f64) -> Scene {
    let data = volume([7, 6, 8], ScalarType::F32, |p| scale * rule(p));
    let table = [
        (20.0, [0.1, 0.2, 0.9], 0.0),
        (45.0, [0.2, 0.9, 0.4], 0.08),
        (65.0, [1.0, 0.6, 0.1], 0.35),
        (95.0, [1.0, 0.9, 0.8], 0.7),
    ];
    small(around([lut(&data, colors(&table.map(|(v, c, a)| (scale * v, c, a))), 1.0)]))
}

fn ranges() -> Ladder {
    // The picture is that of values of 0 to 100, whatever they are multiplied with.
    let of = |how: Setup| move |lab: &Lab, scale: f64| lab.error(&how, &scaled(scale), &certified(&scaled(1.0))?);
    Ladder {
        name: "ranges",
        title: "f32 data and their table, times 1 to 1e36",
        knob: "factor of all values, which are 0 to 100",
        truth: "`reference` at factor 1",
        rungs: vec![1.0, 1e3, 1e6, 1e12, 1e20, 1e28, 1e30, 1e36],
        methods: vec![
            Method::holds("cpu", 5e-3, of(Setup::post(0.1))),
            Method::holds("wgpu", 5e-3, of(Setup::new("wgpu").step(0.1))),
            Method::holds("vulkan", 5e-3, of(Setup::new("vulkan").step(0.1))),
            Method::fails("model: values in f16", (1e-2, [0.1, 1.0]), |_, scale| {
                let found = Naive { step: 0.1, mistake: Mistake::ValuesF16 }.draw(&scaled(scale))?;
                Ok(max_error(&found, &certified(&scaled(1.0))?))
            }),
        ],
    }
}

/// f64 data of 0 to 1 on an offset.
fn offset(by: f64) -> Scene {
    let data = volume([7, 6, 8], ScalarType::F64, |p| by + 0.01 * rule(p));
    let table = warm().points([0.0, 1.0]).iter().map(|p| (by + 0.01 * p.value, p.color, p.opacity)).collect::<Vec<_>>();
    small(around([lut(&data, colors(&table), 1.0)]))
}

fn offsets() -> Ladder {
    let of = |how: Setup| move |lab: &Lab, by: f64| lab.error(&how, &offset(by), &certified(&offset(0.0))?);
    Ladder {
        name: "offsets",
        title: "f64 data of 0 to 1 on an offset",
        knob: "offset",
        truth: "`reference` without offset",
        rungs: vec![1.0, 1e2, 1e4, 1e5, 1e6, 1e7, 1e8],
        methods: vec![
            Method::holds("cpu", 5e-3, of(Setup::post(0.1))),
            Method::fails("model: values in f32", (5e-3, [0.1, 1.0]), |_, by| {
                let found = Naive { step: 0.1, mistake: Mistake::ValuesF32 }.draw(&offset(by))?;
                Ok(max_error(&found, &certified(&offset(0.0))?))
            }),
            Method::refuses("wgpu", ("single precision", 5e-3), of(Setup::new("wgpu").step(0.1))),
        ],
    }
}

/// A part of all samples is no number.
fn holes() -> Ladder {
    let scene = |part: f64| {
        let spoilt = move |p: DVec3| (0.5 + p.dot(DVec3::new(0.367_879, 0.754_877_7, 0.569_840_3))).fract() < part;
        let data = volume([7, 6, 8], ScalarType::F32, move |p| if spoilt(p) { f64::NAN } else { rule(p) });
        // Opaque at 0, as the air is not: a hole that is read as 0 is seen.
        let table = greys(&[(0.0, 1.0, 0.5), (40.0, 0.2, 0.05), (100.0, 0.6, 0.4)]);
        small(around([lut(&data, table, 1.0)]))
    };
    let of = move |how: Setup| move |lab: &Lab, part: f64| lab.from_truth(&how, &scene(part));
    Ladder {
        name: "holes",
        title: "Samples that are no numbers",
        knob: "part of all samples",
        truth: "`reference`, where they are transparent",
        rungs: vec![1e-9, 0.004, 0.01, 0.03, 0.1, 0.15],
        methods: vec![
            Method::holds("cpu", 0.03, of(Setup::post(0.02))),
            Method::holds("wgpu", 0.03, of(Setup::new("wgpu").step(0.02))),
            Method::fails("model: NaN is 0", (0.03, [0.1, 1.0]), move |_, part| {
                let found = Naive { step: 0.02, mistake: Mistake::NanIsZero }.draw(&scene(part))?;
                Ok(max_error(&found, &certified(&scene(part))?))
            }),
        ],
    }
}

fn answers() -> Vec<Answer> {
    vec![
        Answer::new(
            Does::Avoids,
            "An infinite sample makes no pixel NaN, and data of denormals are drawn as those of any other range.",
            |lab| {
                let middle = DVec3::splat(3.0);
                for odd in [f64::INFINITY, f64::NEG_INFINITY] {
                    let data = volume([7, 7, 7], ScalarType::F32, |p| if p == middle { odd } else { rule(p) });
                    let scene = small(around([lut(&data, warm(), 1.0)]));
                    for how in [Setup::cpu(), Setup::new("wgpu"), Setup::new("vulkan")] {
                        let frame = match lab.frame(&how, &scene) {
                            Err(Missing::Skipped(_)) => continue,
                            other => other.map_err(|e| format!("{e:?}"))?,
                        };
                        let finite = frame.color.iter().flatten().all(|v| v.is_finite());
                        ensure(finite, format!("{odd} by {}: not finite", how.name()))?;
                    }
                }
                let truth = certified(&scaled(1.0)).map_err(|e| format!("{e:?}"))?;
                let error = lab.error(&Setup::post(0.1), &scaled(1e-42), &truth).map_err(|e| format!("{e:?}"))?;
                // f32 has steps of 1.4e-45 there, a seventieth of a thousandth of the values' range of 1e-40.
                ensure(error < 0.03, format!("denormals are off by {error}"))
            },
        ),
        Answer::new(Does::Avoids, "A constant volume is drawn by its closed form, whatever the constant.", |lab| {
            for value in [0.0, -1e30, 1e30, 1e-40, 255.0] {
                let shape = lut(&constant(value, [2, 2, 2]), greys(&[(value, 1.0, 0.3)]), 1.0);
                let frame = lab.frame(&Setup::post(0.3), &Scene::new([shape], along_y(0.7, 0.7)));
                let alpha = f64::from(frame.map_err(|e| format!("{e:?}"))?.color[0][3]);
                ensure(relative(alpha, absorbed(0.3, 2.0)) < 1e-5, format!("{value}: {alpha}"))?;
            }
            Ok(())
        }),
    ]
}
