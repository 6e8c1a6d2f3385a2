//! What is no number, and what is infinite.

use volact_core::{Filter, LookupTable, ScalarType, VolumeTexture, glam::DVec3};

use super::stock::{AXES, absorbed, around, rule, warm};
use crate::{
    case::{Case, Need, Stop, Topic},
    meshes::{bent, field},
    rig::{How, Scene},
    scene::{along_y, greys, lut, lut_of, one_ray, shaded, volume},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("nan", &[]);
    holes(&mut topic);
    pictures(&mut topic);
    flat(&mut topic);
    infinite(&mut topic);
    topic.done()
}

const LUT: &[Need] = &[Need::Shader("lut")];

fn holes(topic: &mut Topic) {
    for scalar in [ScalarType::F16, ScalarType::F32, ScalarType::F64] {
        for (axis, (name, direction)) in AXES.into_iter().enumerate() {
            let about = "a sample that is no number is transparent wherever it has weight: one voxel either way";
            topic.needing(LUT, format!("plane_of_{scalar}_across_{name}"), about, move |rig| {
                let mut dims = [2; 3];
                dims[axis] = 6;
                let data = volume(dims, scalar, |p| if p[axis] == 3.0 { f64::NAN } else { 1.0 });
                let mut from = DVec3::splat(0.5);
                from[axis] = -50.0;
                let scene = Scene::new([lut(&data, greys(&[(0.0, 1.0, 0.3)]), 1.0)], one_ray(from, from + direction));
                // 5 long, 2 of them beside the plane.
                let alpha = absorbed(0.3, 3.0);
                rig.pixel("hole", &scene, &How::step(0.25), [alpha; 4]).map(|_| ())
            });
        }
    }
    topic.needing(LUT, "no_weight_no_harm", "where its weight is 0 a NaN does no harm", |rig| {
        let data = volume([3, 3, 2], ScalarType::F32, |p| if p.x == 2.0 { f64::NAN } else { 1.0 });
        let shape = lut(&data, greys(&[(0.0, 1.0, 0.3)]), 1.0);
        for (label, x, length) in [("beside", 0.4, 2.0), ("with weight", 1.6, 0.0), ("at the next sample", 1.0, 2.0)] {
            let alpha = absorbed(0.3, length);
            rig.pixel(label, &Scene::new([shape.clone()], along_y(x, 0.5)), &How::step(0.25), [alpha; 4])?;
        }
        Ok(())
    });
    topic.needing(LUT, "nothing_but_nan", "a volume of nothing but NaN draws nothing", |rig| {
        let data = volume([4, 4, 4], ScalarType::F32, |_| f64::NAN);
        let scene = around([lut(&data, greys(&[(0.0, 1.0, 0.9)]), 1.0)]);
        rig.closed("nothing", &scene, &How::step(0.3), &|_, _| Some([0.0; 4])).map(|_| ())
    });
}

fn spoilt(p: DVec3) -> f64 {
    let spoilt = p == DVec3::new(2.0, 1.0, 3.0) || (p.x == 5.0 && p.y == 4.0) || p.z == 7.0;
    if spoilt { f64::NAN } else { rule(p) }
}

fn pictures(topic: &mut Topic) {
    let about = "a picture of data with a point, a line and a face of NaN agrees with the lattice";
    for scalar in [ScalarType::F16, ScalarType::F32, ScalarType::F64] {
        topic.needing(LUT, format!("picture_of_{scalar}"), about, move |rig| {
            let scene = around([lut(&volume([7, 6, 8], scalar, spoilt), warm(), 1.0)]);
            rig.lattice("picture", &scene, &How::step(0.3)).map(|_| ())
        });
    }
    topic.needing(LUT, "picture_by_nearest", about, |rig| {
        let texture = VolumeTexture::new(&volume([7, 6, 8], ScalarType::F32, spoilt)).with_filter(Filter::Nearest);
        rig.lattice("picture", &around([lut_of(&texture, warm(), 1.0)]), &How::step(0.37)).map(|_| ())
    });
    topic.needing(&[Need::Shader("gradient")], "lit_picture", about, |rig| {
        let texture = VolumeTexture::new(&volume([7, 6, 8], ScalarType::F32, spoilt));
        rig.because("beside a NaN moving the scene changes what has weight, and the tolerance with it");
        rig.lattice("picture", &around([shaded("gradient", &texture, warm(), 1.0)]), &How::step(0.3)).map(|_| ())
    });
    let needs = [Need::Shader("attribute"), Need::Geometry("structured_mesh")];
    topic.needing(&needs[..1], "vertex_of_a_mesh", "cells of a vertex without a number are transparent", |rig| {
        let odd = |p: DVec3| if p.distance(DVec3::splat(0.5)) < 0.2 { f64::NAN } else { 100.0 * p.x };
        let shape = field(bent([4, 4, 4], DVec3::ONE, 0.0), odd, warm(), 0.3);
        rig.lattice("picture", &around([shape]), &How::default()).map(|_| ())
    });
}

/// What has no number counts neither for extremes nor for the mean's length.
fn flat(topic: &mut Topic) {
    // Values 10 to 30 over 4, without those between 1 and 3.
    let data = |odd: f64| volume([2, 5, 2], ScalarType::F32, move |p| if p.y == 2.0 { odd } else { 10.0 + 5.0 * p.y });
    for (shader, wanted, error) in [("mip", 0.3, 0.5), ("minip", 0.1, 0.5), ("average", 0.2, 0.0)] {
        let about = "NaN counts neither for extremes nor for the mean's length";
        topic.needing(&[Need::Shader(shader)], format!("hole_in_{shader}"), about, move |rig| {
            let shape = shaded(shader, &VolumeTexture::new(&data(f64::NAN)), LookupTable::grey([0.0, 100.0]), 1.0);
            let step = 1.0 / 64.0;
            // Extremes lie at the ends, and samples half a step inside.
            rig.allow("half a step of a slope of 0.05", error * 0.05 * step);
            let scene = Scene::new([shape], along_y(0.5, 0.5));
            rig.pixel("value", &scene, &How::step(step), [wanted, wanted, wanted, 1.0]).map(|_| ())
        });
    }
    for shader in ["mip", "minip", "average"] {
        topic.needing(
            &[Need::Shader(shader)],
            format!("nothing_but_nan_in_{shader}"),
            "without a value there is nothing",
            move |rig| {
                let nothing = volume([2, 5, 2], ScalarType::F32, |_| f64::NAN);
                let shape = shaded(shader, &VolumeTexture::new(&nothing), LookupTable::grey([0.0, 100.0]), 1.0);
                let scene = Scene::new([shape], along_y(0.5, 0.5));
                rig.pixel("nothing", &scene, &How::step(0.25), [0.0; 4]).map(|_| ())
            },
        );
    }
}

/// What an infinite sample is worth is not said; that it spoils nothing beyond its cells is.
fn infinite(topic: &mut Topic) {
    for (name, value) in [("positive", f64::INFINITY), ("negative", f64::NEG_INFINITY)] {
        let about = "an infinite sample harms nothing beyond its cells, and no pixel becomes NaN";
        topic.needing(LUT, format!("{name}_infinity"), about, move |rig| {
            let middle = DVec3::splat(3.0);
            let data = |odd| volume([7, 7, 7], ScalarType::F32, move |p| if p == middle { odd } else { rule(p) });
            let (spoilt, plain) = (around([lut(&data(value), warm(), 1.0)]), around([lut(&data(50.0), warm(), 1.0)]));
            let (found, wanted) = (rig.draw(&spoilt, &How::step(0.3))?, rig.draw(&plain, &How::step(0.3))?);
            let rays = plain.desc.camera.rays(&plain.desc.viewport()).map_err(|e| Stop::Fail(e.to_string()))?;
            // A ray within √3 of the sample may meet its cells.
            let far = |i: usize| {
                let ray = rays.ray((i % found.width) as f64 + 0.5, (i / found.width) as f64 + 0.5);
                (middle - ray.origin).cross(ray.direction).length() > 1.75
            };
            let differ = (0..found.color.len()).filter(|&i| far(i) && found.color[i] != wanted.color[i]).count();
            rig.holds("elsewhere", differ == 0, &format!("{differ} pixels differ that do not see it"));
            rig.holds("finite", found.color.iter().flatten().all(|v| v.is_finite()), "every channel is finite");
            Ok(())
        });
    }
}
