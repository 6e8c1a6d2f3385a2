//! Opacity and colour: what a medium absorbs over a length, and how frames are premultiplied.

use volact_core::{
    FrameDesc,
    glam::{DAffine3, DVec3},
};

use super::stock::{absorbed, around, laid, over, usual};
use crate::{
    case::{Case, Need, Topic},
    method::F32,
    rig::{How, Scene},
    scene::{along_y, colors, constant, greys, lut},
    study::Expected,
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("opacity", &[Need::Shader("lut")]);
    slabs(&mut topic);
    opaque(&mut topic);
    frames(&mut topic);
    variants(&mut topic);
    topic.done()
}

const COLOR: [f64; 3] = [0.9, 0.5, 0.2];

fn slab(opacity: f64, cells: usize, unit: f64) -> Scene {
    let shape = lut(&constant(1.0, [1, cells, 1]), colors(&[(1.0, COLOR, opacity)]), unit);
    Scene::new([shape], along_y(0.5, 0.5))
}

/// Transmittance over constant σ is (1 − a)^(L/unit).
fn slabs(topic: &mut Topic) {
    let about = "transmittance over constant extinction is (1 − a)^(L/unit), exact at any step";
    for (name, opacity, cells, unit) in [
        ("hint", 1e-4, 3, 1.0),
        ("faint", 0.01, 3, 1.0),
        ("half", 0.5, 1, 1.0),
        ("half_over_ten", 0.5, 10, 1.0),
        ("dense", 0.9, 2, 1.0),
        ("nearly_opaque", 0.999, 1, 1.0),
        ("short_unit", 0.1, 2, 0.1),
        ("long_unit", 0.9, 5, 20.0),
        ("odd_unit", 0.35, 4, 1.7),
    ] {
        topic.case(format!("slab_{name}"), about, move |rig| {
            let scene = slab(opacity, cells, unit);
            let wanted = laid(COLOR, absorbed(opacity, cells as f64 / unit));
            for step in [0.25, 0.3, 2.0] {
                // A segment that the shape cuts takes the power L/h of what a whole one lets through, which
                // is known to u: off by u·(L/h)·(1 − a)^((L − h)/unit).
                let (length, whole) = (cells as f64, absorbed(opacity, step / unit));
                let lost =
                    if step > length { F32 * (length / step) * (1.0 - whole).powf(length / step - 1.0) } else { 0.0 };
                rig.allow("a cut segment as a power of a whole one", lost);
                rig.pixel(&format!("step {step}"), &scene, &How::step(step), wanted)?;
            }
            Ok(())
        });
    }
    topic.case("slab_obliquely", "the length is that of the ray in the world", |rig| {
        let shape = lut(&constant(1.0, [2, 2, 2]), colors(&[(1.0, COLOR, 0.4)]), 1.0);
        shape.set_transform(DAffine3::from_scale(DVec3::new(1.0, 3.0, 1.0)));
        let scene = Scene::new([shape], along_y(0.5, 0.5));
        rig.pixel("stretched", &scene, &How::step(0.4), laid(COLOR, absorbed(0.4, 6.0))).map(|_| ())
    });
}

/// Opaque over any interval of positive length where a = 1.
fn opaque(topic: &mut Topic) {
    topic.case("opaque_ends_at_its_start", "where a = 1 the ray ends at its start with the colour there", |rig| {
        let rest = |y: f64| {
            let shape = lut(&constant(1.0, [1, 1, 1]), greys(&[(1.0, 0.3, 0.5)]), 1.0);
            shape.set_transform(DAffine3::from_translation(DVec3::Y * y));
            shape
        };
        let wall = lut(&constant(1.0, [1, 1, 1]), colors(&[(1.0, COLOR, 1.0)]), 1.0);
        wall.set_transform(DAffine3::from_translation(DVec3::Y * 2.0));
        let scene = Scene::new([rest(0.0), wall, rest(4.0)], along_y(0.5, 0.5));
        let wanted = over(laid([0.3; 3], 0.5), laid(COLOR, 1.0));
        rig.pixel("colour", &scene, &How::step(0.25), wanted).map(|_| ())
    });
    topic.case("opaque_however_thin", "opaque over any interval of positive length", |rig| {
        let shape = lut(&constant(1.0, [1, 1, 1]), colors(&[(1.0, COLOR, 1.0)]), 1.0);
        shape.set_transform(DAffine3::from_scale(DVec3::new(1.0, 1e-3, 1.0)));
        let scene = Scene::new([shape], along_y(0.5, 0.5));
        rig.pixel("colour", &scene, &How::step(0.25), laid(COLOR, 1.0)).map(|_| ())
    });
}

fn frames(topic: &mut Topic) {
    topic.case("background_is_not_in_the_frame", "frames are without background; it goes under at the end", |rig| {
        let scene = slab(0.5, 1, 1.0);
        let plain = rig.draw(&scene, &How::step(0.25))?;
        let background = [0.2, 0.4, 0.6, 0.5];
        let behind = scene.seen(scene.desc.clone().with_background(background));
        let frame = rig.draw(&behind, &How::step(0.25))?;
        rig.same("bits", &behind, &frame, &plain);
        rig.holds("background", frame.background == background, "the frame carries the background asked for");
        let under = frame.over_background()[0];
        rig.figure("laid under", f64::from(under[2]), 0.5 * 0.2 + 0.5 * 0.6 * 0.5, 1e-6);
        Ok(())
    });
    topic.case("nothing_is_all_zero", "where nothing is, a pixel is zero in every channel", |rig| {
        let shape = lut(&usual(), greys(&[(0.0, 1.0, 0.5)]), 1.0);
        let mut scene = around([shape]);
        scene.desc = FrameDesc { camera: along_y(50.0, 50.0).camera, ..scene.desc };
        rig.closed("nothing", &scene, &How::step(0.3), &|_, _| Some([0.0; 4])).map(|_| ())
    });
    topic.case("emission_is_colour_times_extinction", "dC = T·σ·c·ds: each of two media by its own light", |rig| {
        let make = |y: f64, color, a| {
            let shape = lut(&constant(1.0, [1, 2, 1]), colors(&[(1.0, color, a)]), 1.0);
            shape.set_transform(DAffine3::from_translation(DVec3::Y * y));
            shape
        };
        let (front, back) = ([1.0, 0.1, 0.0], [0.0, 0.3, 1.0]);
        let scene = Scene::new([make(0.0, front, 0.3), make(2.0, back, 0.6)], along_y(0.5, 0.5));
        let wanted = over(laid(front, absorbed(0.3, 2.0)), laid(back, absorbed(0.6, 2.0)));
        rig.pixel("colour", &scene, &How::step(0.25), wanted).map(|_| ())
    });
}

/// (a, u) → (1 − (1 − a)^k, k·u) means the same.
fn variants(topic: &mut Topic) {
    for (name, opacity, k) in [("faint_doubled", 1e-5, 2.0), ("usual_tripled", 0.2, 3.0), ("dense_halved", 0.95, 0.5)] {
        let about = "constant opacity (a, u) → (1 − (1 − a)^k, k·u) changes nothing, also below a = 1e-4";
        topic.case(format!("unit_{name}"), about, move |rig| {
            let make = |a: f64, unit: f64| around([lut(&constant(1.0, [3, 3, 3]), colors(&[(1.0, COLOR, a)]), unit)]);
            let (plain, other) = (make(opacity, 1.0), make(absorbed(opacity, k), k));
            let (a, b) = (rig.draw(&other, &How::step(0.4))?, rig.draw(&plain, &How::step(0.4))?);
            rig.alike("variant", &other, &a, &b)
        });
        topic.expects(Expected::NoChange);
    }
}
