//! Depth: the distance along the ray at which accumulated opacity first reaches the threshold.

use volact_core::{
    Camera, Clip, ClipRegion, FrameDesc, Plane, Shape, VolumeTexture,
    glam::{DAffine3, DVec3},
};

use super::stock::{around, through, warm};
use crate::{
    case::{Case, Need, Topic, Verdict},
    method::{F32, Lattice},
    rig::{How, Rig, Scene},
    scene::{colors, constant, greys, lut, one_ray, volume},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("depth", &[Need::Shader("lut"), Need::Depth]);
    thresholds(&mut topic);
    kinds(&mut topic);
    pictures(&mut topic);
    topic.done()
}

const EYE: DVec3 = DVec3::new(0.5, -7.0, 0.5);

fn fog() -> Shape {
    lut(&constant(1.0, [1, 20, 1]), greys(&[(0.0, 1.0, 0.25)]), 1.0)
}

/// Distances of some twenty in f32, over an extinction of 0.29 whose rounding moves the place.
const NEAR: f64 = 20.0 * 16.0 * F32;

/// One ray's depth.
fn one(rig: &mut Rig<'_>, label: &str, scene: &Scene, how: &How, wanted: f64) -> Verdict {
    let frame = rig.draw(scene, how)?;
    rig.depths(label, scene, &frame, &[wanted], NEAR);
    Ok(())
}

/// −ln(1 − d)/σ into a medium.
fn thresholds(topic: &mut Topic) {
    let perspective = FrameDesc::new(Camera::perspective(EYE, EYE + DVec3::Y, DVec3::Z, 1e-6), 1, 1);
    for (kind, desc) in [("perspective", perspective), ("orthographic", one_ray(EYE, EYE + DVec3::Y))] {
        for (name, threshold) in [("a_tenth", 0.1f32), ("half", 0.5), ("nine_tenths", 0.9)] {
            let about = "−ln(1 − threshold)/σ into a medium, from the eye or its plane";
            let mut desc = desc.clone();
            desc.depth_threshold = threshold;
            topic.case(format!("{name}_in_{kind}"), about, move |rig| {
                let wanted = 7.0 - (1.0 - f64::from(threshold)).ln() / -(0.75f64).ln();
                for step in [0.25, 0.4, 3.0] {
                    one(rig, &format!("step {step}"), &Scene::new([fog()], desc.clone()), &How::step(step), wanted)?;
                }
                Ok(())
            });
        }
    }
    topic.case("never_reached", "infinite where the threshold is never reached", |rig| {
        let mut desc = one_ray(EYE, EYE + DVec3::Y);
        desc.depth_threshold = 0.9999;
        one(rig, "depth", &Scene::new([fog()], desc), &How::step(0.4), f64::INFINITY)
    });
    topic.case("beside_everything", "infinite where nothing is", |rig| {
        let side = EYE + DVec3::X * 9.0;
        let desc = one_ray(side, side + DVec3::Y);
        one(rig, "depth", &Scene::new([fog()], desc), &How::step(0.4), f64::INFINITY)
    });
}

/// Depth of each kind of thing.
fn kinds(topic: &mut Topic) {
    let ray = || one_ray(EYE, EYE + DVec3::Y);
    topic.case("opaque_face", "at the face of what is opaque", move |rig| {
        let shape = lut(&constant(1.0, [1, 3, 1]), greys(&[(0.0, 1.0, 1.0)]), 1.0);
        one(rig, "depth", &Scene::new([shape], ray()), &How::step(0.4), 7.0)
    });
    topic.case("behind_a_clip", "from where a clip lets the medium begin", move |rig| {
        let mut desc = ray();
        desc.clip = Clip::new([ClipRegion::plane(Plane::new(DVec3::Y * 4.0, DVec3::Y).expect("a plane"))]);
        one(rig, "depth", &Scene::new([fog()], desc), &How::step(0.4), 11.0 + 0.5f64.ln() / 0.75f64.ln())
    });
    topic.needing(&[Need::Overlap], "of_overlapping_shapes", "the extinctions of all shapes count", move |rig| {
        let scene = Scene::new([fog(), fog()], ray());
        one(rig, "depth", &scene, &How::step(0.4), 7.0 + 0.5 * 0.5f64.ln() / 0.75f64.ln())
    });
    topic.case("of_two_shapes_apart", "accumulated opacity counts from the eye on, over all shapes", move |rig| {
        let slab = |y: f64| {
            let shape = lut(&constant(1.0, [1, 1, 1]), greys(&[(0.0, 1.0, 0.25)]), 1.0);
            shape.set_transform(DAffine3::from_translation(DVec3::Y * y));
            shape
        };
        // After three slabs 1 − 0.75³ = 0.58 is reached; half lies in the third, at y = 9.
        let scene = Scene::new([slab(9.0), slab(0.0), slab(4.0)], ray());
        one(rig, "depth", &scene, &How::step(0.4), 7.0 + 9.0 + 0.5f64.ln() / 0.75f64.ln() - 2.0)
    });
    topic.needing(
        &[Need::Shader("isosurface")],
        "isosurface",
        "at the surface that reaches the threshold",
        move |rig| {
            let data = volume([3, 9, 3], volact_core::ScalarType::F32, |p| p.y);
            let levels = colors(&[(2.5, [1.0; 3], 0.3), (5.25, [1.0; 3], 0.5)]);
            let look = volact_core::Appearance::new("isosurface").with("volume", VolumeTexture::new(&data));
            let scene = Scene::new([Shape::around(&data, look.with("surfaces", levels))], ray());
            one(rig, "depth", &scene, &How::step(0.4), 12.25)
        },
    );
    topic.needing(&[Need::Shader("surface")], "surface", "at an opaque surface", move |rig| {
        let points = vec![DVec3::new(-9.0, 3.5, -9.0), DVec3::new(9.0, 3.5, -9.0), DVec3::new(0.5, 3.5, 9.0)];
        let surface = volact_core::Surface::new(points.into(), volact_core::Buffer::from_vec(vec![0u32, 1, 2]));
        let shape = Shape::new(surface.expect("a triangle"), volact_core::Appearance::new("surface"));
        one(rig, "depth", &Scene::new([shape], ray()), &How::step(0.4), 10.5)
    });
    topic.needing(&[Need::Shader("attribute")], "mesh", "in the numbers of a mesh", move |rig| {
        let mesh = crate::meshes::field(crate::meshes::corner(40.0), |_| 0.0, greys(&[(0.0, 1.0, 0.25)]), 1.0);
        one(rig, "depth", &Scene::new([mesh], ray()), &How::step(0.4), 7.0 + 0.5f64.ln() / 0.75f64.ln())
    });
    topic.needing(
        &[Need::Shader("mip")],
        "pictures_of_values_have_none",
        "shapes that are one picture leave depth alone",
        move |rig| {
            let shape =
                Shape::around(&constant(1.0, [1, 3, 1]), crate::scene::look("mip", greys(&[(0.0, 1.0, 1.0)]), 1.0));
            one(rig, "depth", &Scene::new([shape], ray()), &How::step(0.4), f64::INFINITY)
        },
    );
}

/// Whole pictures against the lattice: a ray's depth moves as much as rounding of T over its slope.
fn pictures(topic: &mut Topic) {
    for threshold in [0.2f32, 0.5, 0.8] {
        let name = format!("picture_at_{}", (threshold * 10.0).round());
        topic.case(name, "depth of a picture agrees with the lattice", move |rig| {
            let table = colors(&[(0.0, [0.2, 0.4, 0.9], 0.1), (100.0, [1.0, 0.6, 0.2], 0.5)]);
            for (label, mut scene) in [
                ("orthographic", around([lut(&super::stock::usual(), table.clone(), 1.0)])),
                ("perspective", through([lut(&super::stock::usual(), table, 1.0)])),
            ] {
                scene.desc.depth_threshold = threshold;
                let frame = rig.draw(&scene, &How::step(0.3))?;
                let lattice = Lattice::of(&frame.method).map_err(crate::case::Stop::Skip)?;
                let truth = rig.truth(label, &scene, lattice, &crate::truth::Change::default())?;
                let wanted: Vec<f64> = (0..truth.depth.len())
                    .map(|i| {
                        // Where the ray's opacity only just reaches the threshold, rounding decides.
                        let near = (truth.color[i][3] - f64::from(threshold)).abs() < 1e-5;
                        if near { f64::from(frame.depth[i]) } else { truth.depth[i] }
                    })
                    .collect();
                // Opacity rises by at least 0.1·(1 − threshold) a unit where it is reached.
                let slope = 0.1 * (1.0 - f64::from(threshold));
                rig.depths(label, &scene, &frame, &wanted, 32.0 * F32 + 32.0 * F32 / slope);
            }
            Ok(())
        });
    }
    topic.case("colour_is_the_same_at_any_threshold", "the threshold changes no colour", |rig| {
        let scene = around([lut(&super::stock::usual(), warm(), 1.0)]);
        let mut other = scene.clone();
        other.desc.depth_threshold = 0.05;
        let (a, b) = (rig.draw(&scene, &How::step(0.3))?, rig.draw(&other, &How::step(0.3))?);
        rig.holds("colours", a.color == b.color, "colours have the same bits");
        rig.holds("depths", a.depth != b.depth, "depths differ");
        Ok(())
    });
}
