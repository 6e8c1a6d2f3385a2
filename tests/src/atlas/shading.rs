//! 10: jitter, gradients at flat places and at the border, surfaces that are thin or touch.

use volact_core::{Appearance, Block, ScalarType, Shape, VolumeTexture, glam::DVec3, parameter::Kind};

use super::{
    Answer, Does, Family, Ladder, Measured, Method,
    lab::{Lab, ensure, unwarned},
};
use crate::{
    cases::stock::absorbed,
    rig::{Scene, Setup},
    scene::{along_y, colors, greys, look, volume},
};

/// The family.
pub fn family() -> Family {
    Family {
        number: 10,
        title: "Jitter, gradients at flat places and at the border, thin isosurfaces",
        about: "Jitter trades steps for noise. No action of Volact offers it, so there is nothing to measure. A \
                gradient of flat data is the difference of what formats and rounding left, and its direction is \
                noise; at the border a difference has only one side, and counts half. An isosurface that is entered and \
                left between two samples is missed, and so is the second of two that lie between them.",
        ladders: vec![flat(), border(), thin(), near()],
        answers: answers(),
    }
}

/// A ramp of this slope, lit from the side, away from the border, where the neighbour of a sample is the
/// sample itself.
fn ramp(slope: f64) -> Scene {
    between(slope, [1.0, 4.0])
}

/// The ramp between two depths.
fn between(slope: f64, [front, back]: [f64; 2]) -> Scene {
    let along = DVec3::new(0.6, -0.8, 0.0);
    // Two corners span the range, as data do that are flat in places only.
    let rule = |p: DVec3| match p.to_array() {
        [0.0, 0.0, 0.0] => 0.0,
        [5.0, 5.0, 5.0] => 1.0,
        _ => 0.4 + slope * along.dot(p - 2.5),
    };
    let data = volume([6, 6, 6], ScalarType::F32, rule);
    let texture = VolumeTexture::new(&data).with_range([0.0, 1.0]).expect("a range");
    let look = look("gradient", greys(&[(0.0, 1.0, 0.5), (1.0, 1.0, 0.5)]), 1.0)
        .with("light", "directional")
        .with("lightdir", DVec3::new(0.0, -1.0, 0.0))
        .with("ambient", 0.0)
        .with("diffuse", 1.0)
        .with("specular", 0.0);
    let size = DVec3::new(3.0, back - front, 3.0);
    let block = Block::new(DVec3::new(1.0, front, 1.0), size).expect("a block");
    Scene::new([Shape::new(block, look.with("volume", texture))], along_y(2.3, 2.7))
}

fn flat() -> Ladder {
    // n·l is 0.8 everywhere, whatever the slope.
    let light = 0.8 * absorbed(0.5, 3.0);
    let wanted = [light, light, light, absorbed(0.5, 3.0)];
    let of = move |how: Setup| move |lab: &Lab, slope: f64| lab.error(&how, &ramp(slope), &[wanted]);
    Ladder {
        name: "flat-gradients",
        title: "A lit ramp, flatter and flatter",
        knob: "slope a voxel, as a part of the data's range",
        truth: "closed form: the light is that of any slope",
        rungs: vec![0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5],
        methods: vec![
            Method::holds("cpu", 5e-3, of(Setup::post(0.25))),
            Method::holds("wgpu", 5e-3, of(Setup::new("wgpu").step(0.25))),
            Method::fails(
                "wgpu, `format: \"r8\"`",
                (0.05, [0.3, 1.0]),
                of(Setup::new("wgpu").with("format", "r8").step(0.25)),
            ),
        ],
    }
}

/// A tenth of a voxel of the ramp, nearer and nearer to the front.
fn border() -> Ladder {
    let alpha = absorbed(0.5, 0.1);
    let of = move |how: Setup| {
        move |lab: &Lab, depth: f64| {
            let frame = lab.frame(&how, &between(0.05, [depth, depth + 0.1]))?;
            Ok((0..3).map(|c| (f64::from(frame.color[0][c]) / alpha - 0.8).abs()).fold(0.0, f64::max))
        }
    };
    Ladder {
        name: "border",
        title: "The light of a ramp near the border of the data",
        knob: "distance from the border, in voxels",
        truth: "closed form: the light is that of anywhere; as a part of what is absorbed",
        rungs: vec![2.0, 1.5, 1.0, 0.75, 0.5, 0.25, 0.1, 0.01],
        methods: vec![
            Method::fails("cpu, as the contract has it", (1e-4, [0.2, 0.3]), of(Setup::post(0.25))),
            Method::fails("reference, the same", (1e-4, [0.2, 0.3]), of(Setup::rays(0.25))),
            Method::fails("wgpu, the same", (1e-4, [0.2, 0.3]), of(Setup::new("wgpu").step(0.25))),
        ],
    }
}

/// A ridge of one voxel, of which what is above the level is so thick, in voxels.
fn shell(thickness: f64) -> Scene {
    let data = volume([3, 8, 3], ScalarType::F32, |p| if p.y == 4.0 { 1.0 } else { 0.0 });
    let levels = colors(&[(1.0 - 0.5 * thickness, [1.0; 3], 0.4)]);
    let look = Appearance::new("isosurface").with("volume", VolumeTexture::new(&data)).with("surfaces", levels);
    Scene::new([Shape::around(&data, look)], along_y(1.2, 1.3))
}

/// Front and back, 0.4 each.
const BOTH: f64 = 1.0 - 0.6 * 0.6;

fn off(lab: &Lab, how: &Setup, thickness: f64) -> Measured {
    Ok((f64::from(lab.frame(how, &shell(thickness))?.color[0][3]) - BOTH).abs())
}

fn thin() -> Ladder {
    let of = |how: Setup| move |lab: &Lab, thickness: f64| off(lab, &how, thickness);
    Ladder {
        name: "thin-isosurface",
        title: "The two sides of a ridge, nearer and nearer each other",
        knob: "distance of the two, in voxels",
        truth: "closed form, 1 − 0.6²",
        rungs: vec![1.9, 1.3, 0.7, 0.3, 0.1, 0.03, 1e-2, 1e-3],
        methods: vec![
            Method::holds("reference", 1e-6, of(Setup::exact())),
            Method::fails("cpu", (1e-6, [0.63, 0.65]), of(Setup::cpu().step(0.37))),
            Method::fails("wgpu", (1e-6, [0.63, 0.65]), of(Setup::new("wgpu").step(0.37))),
            Method::fails("model: the sign at samples", (1e-6, [0.63, 0.65]), |_, thickness| {
                Ok((signs(thickness, 0.37) - BOTH).abs())
            }),
        ],
    }
}

/// What is seen of the ridge where a surface is a change of sign from sample to sample.
fn signs(thickness: f64, step: f64) -> f64 {
    let above = |k: usize| 1.0 - ((k as f64 + 0.5) * step - 4.0).abs() > 1.0 - 0.5 * thickness;
    let changes = (1..(7.0 / step) as usize).filter(|&k| above(k) != above(k - 1)).count();
    1.0 - 0.6f64.powi(changes as i32)
}

/// Two levels of a ramp, red and green, so far apart.
fn layers(apart: f64) -> Scene {
    let data = volume([3, 8, 3], ScalarType::F32, |p| p.y);
    let levels = colors(&[(LEVEL, [1.0, 0.0, 0.0], 0.4), (LEVEL + apart, [0.0, 1.0, 0.0], 0.4)]);
    let look = Appearance::new("isosurface").with("volume", VolumeTexture::new(&data)).with("surfaces", levels);
    Scene::new(
        [Shape::around(&data, look.with("ambient", 1.0).with("diffuse", 0.0).with("specular", 0.0))],
        along_y(1.2, 1.3),
    )
}

const LEVEL: f64 = 3.3;

fn near() -> Ladder {
    let wanted = [0.4, 0.6 * 0.4, 0.0, BOTH];
    let of = move |how: Setup| move |lab: &Lab, apart: f64| lab.error(&how, &layers(apart), &[wanted]);
    Ladder {
        name: "near-isosurfaces",
        title: "Two isosurfaces of a ramp, nearer and nearer each other",
        knob: "distance of the two, in voxels",
        truth: "closed form, the first over the second",
        rungs: vec![1.0, 0.3, 0.1, 0.03, 1e-2, 1e-3, 1e-4, 1e-5],
        methods: vec![
            Method::holds("reference", 1e-6, of(Setup::exact())),
            Method::refuses("cpu", ("single precision", 1e-5), of(Setup::cpu().step(0.37))),
            Method::refuses("wgpu", ("single precision", 1e-5), of(Setup::new("wgpu").step(0.37))),
            Method::fails("model: one crossing a segment", (1e-6, [0.23, 0.25]), |_, apart| {
                let segment = |level: f64| (level / 0.37).floor();
                Ok(if segment(LEVEL) == segment(LEVEL + apart) { BOTH - 0.4 } else { 0.0 })
            }),
        ],
    }
}

fn answers() -> Vec<Answer> {
    vec![
        Answer::new(Does::Avoids, "No action declares jitter: there is no random number in a picture.", |lab| {
            let jitters = |d: &&volact_core::Declaration| {
                d.kind == Kind::Action && d.parameters.iter().any(|p| p.name.contains("jitter"))
            };
            let found: Vec<_> = lab.registry().declarations().into_iter().filter(jitters).map(|d| &d.name).collect();
            ensure(found.is_empty(), format!("{found:?}"))
        }),
        Answer::new(
            Does::Silent,
            "`cpu` and `wgpu` look for crossings between the ends of segments: a surface that is entered and left \
             within one is missed. `reference` finds it; else take a smaller `sample_distance`.",
            |lab| {
                for how in [Setup::cpu().step(0.37), Setup::new("wgpu").step(0.37)] {
                    unwarned(lab.frame(&how, &shell(1e-3)))?;
                }
                Ok(())
            },
        ),
        Answer::new(
            Does::Silent,
            "Within a voxel of the border of the data a gradient has one neighbour only, and by the contract counts \
             half: light is off by up to a quarter there, on every action alike. Take data with a rim.",
            |lab| {
                for how in [Setup::post(0.25), Setup::new("wgpu").step(0.25)] {
                    unwarned(lab.frame(&how, &between(0.05, [0.01, 0.11])))?;
                }
                Ok(())
            },
        ),
        Answer::new(
            Does::Silent,
            "`format: \"r8\"` keeps 256 values, and gradients of data that are flat for these are noise; the frame \
             names the format, which nobody gets who does not ask for it.",
            |lab| {
                let found = lab.frame(&Setup::new("wgpu").with("format", "r8").step(0.25), &ramp(1e-4));
                if let Ok(frame) = &found {
                    ensure(frame.method.texture_format.contains("r8"), frame.method.texture_format.clone())?;
                }
                unwarned(found)
            },
        ),
        Answer::new(
            Does::Avoids,
            "Where there is no gradient at all, in constant data, light is finite, on every action.",
            |lab| {
                for how in [Setup::cpu(), Setup::exact(), Setup::new("wgpu")] {
                    if let Ok(frame) = lab.frame(&how, &ramp(0.0)) {
                        let color = frame.color[0];
                        let fine = color.iter().all(|v| v.is_finite() && *v >= 0.0 && *v <= 1.0);
                        ensure(fine, format!("{}: {color:?}", how.name()))?;
                    }
                }
                Ok(())
            },
        ),
    ]
}
