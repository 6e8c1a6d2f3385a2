//! 2: spikes and steps in tables, many entries, opacity from nothing to all.

use volact_core::{ControlPoint, LookupTable, ScalarType, WarningCode, glam::DVec3};

use super::{
    Answer, Does, Family, Ladder, Measured, Method, Missing,
    lab::{Lab, ensure, refused_with, relative, unwarned},
    naive::{Mistake, Naive},
};
use crate::{
    cases::stock::absorbed,
    metrics::max_error,
    rig::{Scene, Setup},
    scene::{along_y, constant, greys, lut, volume},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 2,
        title: "Tables: spikes, many entries, opacity from nothing to all",
        about: "A sample sees one value. A spike in the table that is narrower than what the value changes from sample \
                to sample lies between two of them, and what it should show is missed or counted many times. A table \
                of 256 entries loses what is narrower than one, opacities of 8 bits lose those below 1/510, and \
                α ≈ τh is wrong where a segment absorbs much.",
        ladders: vec![spike(), step(), entries(), opacity(), depth()],
        answers: answers(),
    }
}

/// A ramp of 8 voxels through a triangle of this width, which absorbs the same however wide it is.
fn spiked(width: f64) -> Scene {
    let ramp = volume([2, 9, 2], ScalarType::F32, |p| p.y / 8.0);
    // Not at a sample.
    let at = 0.537;
    let table = greys(&[(at - 0.5 * width, 1.0, 0.0), (at, 1.0, 0.9), (at + 0.5 * width, 1.0, 0.0)]);
    Scene::new([lut(&ramp, table, 4.0 * width)], along_y(0.5, 0.5))
}

/// ∫ −ln(1 − a·t) dt over 0..1 is 1 + (1 − a)/a·ln(1 − a): the optical depth of each flank, in its length.
fn through_spike() -> f64 {
    let a: f64 = 0.9;
    let mean = 1.0 + (1.0 - a) / a * (1.0 - a).ln();
    // 8·width voxels long, of a unit of 4·width.
    -(-2.0 * mean).exp_m1()
}

fn spike() -> Ladder {
    let of = |how: Setup| {
        move |lab: &Lab, width: f64| {
            let frame = lab.frame(&how, &spiked(width))?;
            Ok((f64::from(frame.color[0][3]) - through_spike()).abs())
        }
    };
    Ladder {
        name: "spike",
        title: "A spike in the table, narrower and narrower, that absorbs the same",
        knob: "width of the spike, as a part of the values along the ray",
        truth: "closed form",
        rungs: vec![0.5, 0.2, 0.1, 0.03, 0.01, 1e-3, 1e-4, 1e-5],
        methods: vec![
            Method::holds("cpu, pre-integrated", 2e-3, of(Setup::pre_integrated(0.5))),
            Method::holds("cpu, as it is by default", 2e-2, of(Setup::cpu())),
            Method::fails("cpu, post-classified", (0.03, [0.7, 0.9]), of(Setup::post(0.5))),
            Method::fails("wgpu", (0.03, [0.7, 0.9]), of(Setup::new("wgpu").step(0.5))),
            Method::fails("vulkan", (0.03, [0.7, 0.9]), of(Setup::new("vulkan").step(0.5))),
        ],
    }
}

/// The ramp through a table that steps from nothing to half opacity at 0.537.
fn step() -> Ladder {
    let scene = || {
        let ramp = volume([2, 9, 2], ScalarType::F32, |p| p.y / 8.0);
        let table = greys(&[(0.0, 1.0, 0.0), (0.537, 1.0, 0.0), (0.537, 1.0, 0.5), (1.0, 1.0, 0.5)]);
        Scene::new([lut(&ramp, table, 2.0)], along_y(0.5, 0.5))
    };
    let exact = absorbed(0.5, (1.0 - 0.537) * 8.0 / 2.0);
    let of = move |how: fn(f64) -> Setup| move |lab: &Lab, h: f64| Ok((alpha(lab, &how(h), &scene())? - exact).abs());
    Ladder {
        name: "step",
        title: "A step in the table, and coarser and coarser samples",
        knob: "distance of samples, in voxels",
        truth: "closed form",
        rungs: vec![1e-3, 0.01, 0.03, 0.1, 0.3, 0.7, 1.0, 1.9],
        methods: vec![
            Method::holds("cpu, pre-integrated", 5e-3, of(Setup::pre_integrated)),
            Method::holds("cpu, as it is by default", 5e-3, of(|h| Setup::cpu().step(h))),
            Method::fails("cpu, post-classified", (1e-3, [0.03, 0.3]), of(Setup::post)),
            Method::fails("wgpu", (1e-3, [0.03, 0.3]), of(|h| Setup::new("wgpu").step(h))),
        ],
    }
}

/// A table of wavy entries over 0..1.
fn wavy(count: usize) -> LookupTable {
    // Every second entry of the finest table is a spike: what resampling loses.
    let entry = |i: usize| {
        let t = i as f32 / (count - 1) as f32;
        [t, 1.0 - t, 0.5, if i.is_multiple_of(2) { 0.1 } else { 0.6 }]
    };
    LookupTable::from_entries((0..count).map(entry).collect::<Vec<_>>(), Some([0.0, 1.0])).expect("entries")
}

fn entries() -> Ladder {
    let scene = |count: f64| {
        let values = volume([9, 2, 9], ScalarType::F32, |p| (p.x + 9.0 * p.z) / 80.0);
        let shape = lut(&values, wavy(count as usize), 2.0);
        let camera =
            volact_core::Camera::orthographic(DVec3::new(4.1, -9.0, 4.2), DVec3::new(4.1, 0.0, 4.2), DVec3::Z, 7.0);
        Scene::new([shape], volact_core::FrameDesc::new(camera, 16, 16))
    };
    let of = move |how: Setup| move |lab: &Lab, count: f64| lab.from_truth(&how, &scene(count));
    Ladder {
        name: "entries",
        title: "Tables of more and more entries, every second one high",
        knob: "entries of the table",
        truth: "`reference`",
        rungs: vec![2.0, 3.0, 16.0, 255.0, 256.0, 257.0, 1024.0, 4096.0, 16_384.0, 65_536.0],
        methods: vec![
            Method::holds("cpu", 5e-2, of(Setup::post(0.5))),
            Method::holds("wgpu", 5e-2, of(Setup::new("wgpu").step(0.5))),
            Method::fails("model: the table in 256 entries", (1e-3, [0.1, 0.5]), move |_, count| {
                let found = Naive { step: 0.5, mistake: Mistake::Entries(256) }.draw(&scene(count))?;
                Ok(max_error(&found, &super::lab::certified(&scene(count))?))
            }),
        ],
    }
}

fn slab(opacity: f64, unit: f64) -> Scene {
    Scene::new([lut(&constant(1.0, [1, 3, 1]), greys(&[(1.0, 1.0, opacity)]), unit)], along_y(0.5, 0.5))
}

fn alpha(lab: &Lab, how: &Setup, scene: &Scene) -> Measured {
    Ok(f64::from(lab.frame(how, scene)?.color[0][3]))
}

fn modelled(mistake: Mistake, scene: &Scene) -> Measured {
    let found = Naive { step: 0.25, mistake }.draw(scene)?;
    found.first().map(|c| c[3]).ok_or_else(|| Missing::Refused("no pixel".into()))
}

fn opacity() -> Ladder {
    let of = |how: Setup| move |lab: &Lab, a: f64| Ok(relative(alpha(lab, &how, &slab(a, 1.0))?, absorbed(a, 3.0)));
    Ladder {
        name: "opacity",
        title: "Three units of constant opacity, from all to nothing",
        knob: "opacity over a unit",
        truth: "closed form, 1 − (1 − a)³; the error is relative",
        rungs: vec![1.0, 0.999_999, 0.9, 0.5, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7],
        methods: vec![
            Method::holds("cpu", 1e-5, of(Setup::post(0.25))),
            Method::holds("wgpu", 1e-5, of(Setup::new("wgpu").step(0.25))),
            Method::holds("vulkan", 1e-5, of(Setup::new("vulkan").step(0.25))),
            Method::fails("model: opacities of 8 bits", (1e-6, [0.9, 1.1]), |_, a| {
                let rounded = (a * 255.0).round() / 255.0;
                Ok(relative(modelled(Mistake::None, &slab(rounded, 1.0))?, absorbed(a, 3.0)))
            }),
        ],
    }
}

fn depth() -> Ladder {
    // One unit of half opacity has an optical depth of ln 2.
    let scene = |tau: f64| slab(0.5, 3.0 * 2f64.ln() / tau);
    let exact = |tau: f64| -(-tau).exp_m1();
    let of = move |how: Setup| move |lab: &Lab, tau: f64| Ok(relative(alpha(lab, &how, &scene(tau))?, exact(tau)));
    Ladder {
        name: "optical-depth",
        title: "A slab of optical depth 1e-9 to 1e9",
        knob: "optical depth",
        truth: "closed form, 1 − exp(−τ); the error is relative",
        rungs: (-9..=9).map(|e| 10f64.powi(e)).collect(),
        methods: vec![
            Method::holds("cpu", 1e-5, of(Setup::post(0.25))),
            Method::holds("wgpu", 1e-5, of(Setup::new("wgpu").step(0.25))),
            Method::holds("vulkan", 1e-5, of(Setup::new("vulkan").step(0.25))),
            Method::fails("model: α = τh", (1e-8, [0.01, 0.6]), move |_, tau| {
                Ok(relative(modelled(Mistake::Linear, &scene(tau))?, exact(tau)))
            }),
        ],
    }
}

fn answers() -> Vec<Answer> {
    let sharp = |lab: &Lab| lab.frame(&Setup::cpu(), &spiked(1e-3)).map_err(|e| format!("{e:?}"));
    vec![
        Answer::new(
            Does::Adapts,
            "`cpu` estimates for every table whether it is too sharp for step and data, and integrates over segments \
             where it is; the frame says `pre-integrated`.",
            move |lab| {
                let classification = sharp(lab)?.method.classification;
                ensure(classification.contains("pre-integrated"), classification)
            },
        ),
        Answer::new(
            Does::Silent,
            "`wgpu` and `vulkan` classify in the middle of segments, always, and `cpu` where it is asked to \
             (`classification: \"post\"`): a spike as narrow as what the value changes over a step is missed, or \
             counted too often. Take a smaller `sample_distance`, or `cpu` as it is.",
            |lab| {
                for how in [Setup::post(0.5), Setup::new("wgpu").step(0.5), Setup::new("vulkan").step(0.5)] {
                    unwarned(lab.frame(&how, &spiked(0.1)))?;
                }
                Ok(())
            },
        ),
        Answer::new(
            Does::Refuses,
            "Where a table has detail that numbers of single precision cannot tell apart, `wgpu` refuses it and \
             names both.",
            |lab| refused_with(lab.frame(&Setup::new("wgpu").step(0.5), &spiked(1e-5)), &["lookup_table", "detail"]),
        ),
        Answer::new(
            Does::Detects,
            "`cpu` tabulates opacity over segments: where nothing runs through a spike that is narrower than the \
             distance of entries, as in a constant volume, it is not seen, and the frame warns (`coarse-sampling`).",
            |lab| {
                let point = |value, opacity| ControlPoint { value, color: [1.0; 3], opacity };
                let thin = [(0.0, 0.0), (0.5, 0.0), (0.5 + 1e-6, 1.0), (0.5 + 2e-6, 0.0), (1.0, 0.0)];
                let table = LookupTable::from_points(thin.map(|(v, a)| point(v, a))).map_err(|e| e.to_string())?;
                let shape = lut(&constant(0.5 + 1e-6, [1, 1, 1]), table, 1.0);
                let frame = lab.frame(&Setup::cpu(), &Scene::new([shape], along_y(0.5, 0.5)));
                let frame = frame.map_err(|e| format!("{e:?}"))?;
                let (alpha, warnings) = (frame.color[0][3], &frame.warnings);
                ensure(alpha == 0.0, format!("a peak a millionth wide is seen with {alpha}: say so"))?;
                let warned = warnings.iter().any(|w| w.code == WarningCode::CoarseSampling);
                ensure(warned, format!("no warning among {warnings:?}"))
            },
        ),
        Answer::new(
            Does::Avoids,
            "An opacity of exactly 0 leaves exactly nothing, and of exactly 1 exactly 1.",
            |lab| {
                for a in [0.0, 1.0] {
                    let found = alpha(lab, &Setup::cpu(), &slab(a, 1.0)).map_err(|e| format!("{e:?}"))?;
                    ensure(found == a, format!("opacity {a} is drawn as {found}"))?;
                }
                Ok(())
            },
        ),
    ]
}
