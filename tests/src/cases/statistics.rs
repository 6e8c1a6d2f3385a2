//! Statistics: what a frame says of how it was made and what it cost.

use std::time::Duration;

use volact_core::{Appearance, Shape, WarningCode};

use super::stock::{PIXELS, around, shape, through, usual, warm};
use crate::{
    case::{Case, Need, Stop, Topic},
    method::{Lattice, Precision},
    rig::{How, Scene, draw_managed, stop},
    scene::{along_y, greys, lut},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("statistics", &[Need::Shader("lut")]);
    sizes(&mut topic);
    methods(&mut topic);
    costs(&mut topic);
    warnings(&mut topic);
    topic.done()
}

fn sizes(topic: &mut Topic) {
    topic.case("frame_is_as_asked", "size, background, and a depth for every pixel", |rig| {
        let mut scene = around([shape()]);
        (scene.desc.width, scene.desc.height) = (23, 17);
        scene.desc.background = [0.1, 0.2, 0.3, 0.4];
        let frame = rig.draw(&scene, &How::step(0.3))?;
        rig.holds("size", (frame.width, frame.height) == (23, 17), &format!("{} × {}", frame.width, frame.height));
        let lengths = (frame.color.len(), frame.depth.len());
        rig.holds("pixels", lengths == (23 * 17, 23 * 17), &format!("{lengths:?} colours and depths"));
        rig.holds("background", frame.background == scene.desc.background, "the background asked for");
        Ok(())
    });
    topic.case(
        "numbers_are_sound",
        "no channel is negative or not finite, no opacity above 1, no depth negative",
        |rig| {
            let frame = rig.draw(&through([shape()]), &How::step(0.3))?;
            let sound = |c: &[f32; 4]| c.iter().all(|v| v.is_finite() && *v >= 0.0) && c[3] <= 1.0;
            rig.holds("colours", frame.color.iter().all(sound), "finite and from 0");
            rig.holds("depths", frame.depth.iter().all(|d| *d >= 0.0), "no negative or NaN depth");
            Ok(())
        },
    );
}

fn methods(topic: &mut Topic) {
    topic.case("method_can_be_read", "the frame says on which lattice it was drawn, in the contract's words", |rig| {
        let frame = rig.draw(&around([shape()]), &How::step(0.3))?;
        let lattice = Lattice::of(&frame.method);
        let m = &frame.method;
        let repeatable =
            lattice.is_ok() || ["axis-aligned", "object", "primitive"].iter().any(|w| m.sampling.contains(w));
        rig.holds("lattice", repeatable, &format!("{lattice:?} of {:?}", m.sampling));
        for (what, text) in [
            ("classification", &m.classification),
            ("format", &m.texture_format),
            ("filter", &m.filter),
            ("blend", &m.blend),
            ("device", &m.device),
        ] {
            rig.holds(what, !text.is_empty(), &format!("{what} is {text:?}"));
        }
        let precision = Precision::of(m);
        rig.holds("termination", (0.0..=1.0).contains(&precision.termination), &format!("{}", precision.termination));
        Ok(())
    });
    topic.needing(
        &[Need::Option("sample_distance")],
        "step_is_reported",
        "the step asked for is the step reported",
        |rig| {
            if rig.subject().options.contains_key("sample_distance") {
                return Err(Stop::Skip("set by the user".into()));
            }
            for step in [0.2, 0.7] {
                let found = rig.draw(&around([shape()]), &How::step(step))?.method.sample_distance;
                rig.holds(&format!("{step}"), found == step || found == 0.0, &format!("{found}, asked for {step}"));
            }
            Ok(())
        },
    );
    topic.case("device_is_that_of_the_action", "the frame names the device that the action does", |rig| {
        let frame = rig.draw(&around([shape()]), &How::step(0.3))?;
        let caps = rig.action(&How::default())?.caps().device;
        rig.holds("device", frame.method.device == caps, &format!("{:?} and {caps:?}", frame.method.device));
        Ok(())
    });
}

fn costs(topic: &mut Topic) {
    topic.case("rays_that_meet_something", "rays counts those that met a shape", |rig| {
        let frame = rig.draw(&around([shape()]), &How::step(0.3))?;
        let seen = frame.color.iter().filter(|c| c[3] > 0.0).count() as u64;
        let (rays, all) = (frame.statistics.rays, (PIXELS * PIXELS) as u64);
        rig.holds("rays", (seen..=all).contains(&rays), &format!("{rays} rays, {seen} pixels seen of {all}"));
        rig.holds("not all", rays < all, "rays that pass beside are not counted");
        Ok(())
    });
    topic.case("samples_are_counted", "samples grow as the step shrinks", |rig| {
        let mut samples = Vec::new();
        for step in [0.8, 0.4, 0.2] {
            let frame = rig.draw(&around([shape()]), &How::step(step))?;
            if frame.method.sample_distance != step {
                rig.holds("counted", frame.statistics.samples > 0, "samples are counted");
                return Ok(());
            }
            let (taken, skipped) = (frame.statistics.samples, frame.statistics.skipped);
            rig.holds(&format!("taken at {step}"), taken > 0, &format!("{taken} samples taken, {skipped} skipped"));
            samples.push(taken + skipped);
        }
        let doubles = samples.windows(2).all(|w| (1.6..2.4).contains(&(w[1] as f64 / w[0] as f64)));
        rig.holds("twice as many", doubles, &format!("{samples:?} at 0.8, 0.4, 0.2"));
        Ok(())
    });
    topic.case("nothing_costs_nothing", "a frame that meets nothing counts no ray and no sample", |rig| {
        let scene = around([shape()]).seen(along_y(50.0, 50.0));
        let frame = rig.draw(&scene, &How::step(0.3))?;
        let s = &frame.statistics;
        rig.holds("none", s.rays == 0 && s.samples == 0, &format!("{} rays, {} samples", s.rays, s.samples));
        Ok(())
    });
    topic.case("times_add_up", "total is at least what prepared and what drew", |rig| {
        let s = rig.draw(&around([shape()]), &How::step(0.3))?.statistics;
        rig.holds("some", s.total > Duration::ZERO, &format!("{:?}", s.total));
        rig.holds(
            "sum",
            s.prepare + s.render <= s.total + Duration::from_micros(1),
            &format!("{:?} + {:?} of {:?}", s.prepare, s.render, s.total),
        );
        Ok(())
    });
    topic.case("second_frame_prepares_nothing", "nothing is prepared or moved anew where nothing changed", |rig| {
        let scene = around([shape()]);
        let mut action = rig.action(&How::step(0.3))?;
        rig.draw_with(&mut *action, &scene)?;
        let turned = through(scene.shapes.clone());
        let frame = rig.draw_with(&mut *action, &turned)?;
        let s = &frame.statistics;
        rig.holds("rebuilt", s.rebuilt.is_empty(), &format!("{:?}", s.rebuilt));
        rig.holds("uploaded", s.uploaded_bytes <= 4096, &format!("{} bytes moved for a camera", s.uploaded_bytes));
        Ok(())
    });
    topic.case("table_moves_the_table_only", "a table change moves the table's bytes only", |rig| {
        let data = crate::scene::ball([40, 40, 40], volact_core::ScalarType::U8);
        let shape = lut(&data, warm(), 1.0);
        let scene = around([shape.clone()]);
        let mut action = rig.action(&How::step(1.5))?;
        rig.draw_with(&mut *action, &scene)?;
        shape.set_parameter("lookup_table", greys(&[(30.0, 0.2, 0.0), (150.0, 0.8, 0.5)]));
        let frame = rig.draw_with(&mut *action, &scene)?;
        let moved = frame.statistics.uploaded_bytes;
        rig.holds(
            "uploaded",
            moved < data.data().len() / 2,
            &format!("{moved} bytes moved of a volume of {}", data.data().len()),
        );
        Ok(())
    });
}

fn warnings(topic: &mut Topic) {
    topic.case("nothing_visible", "a camera that sees nothing is a warning", |rig| {
        let scene = around([shape()]).seen(along_y(50.0, 50.0));
        let frame = rig.draw(&scene, &How::step(0.3))?;
        let said = frame.warnings.iter().any(|w| w.code == WarningCode::NothingVisible);
        // The reference draws what it is asked for without a guess at what was meant.
        let reference = rig.subject().action == "reference";
        rig.holds("said", said || reference, &format!("{:?}", frame.warnings));
        Ok(())
    });
    topic.case("unused_parameter", "a parameter that another shader declares is kept, with a warning", |rig| {
        let simple = Need::Shader("simple");
        let subject = rig.subject();
        let (caps, declaration) = (subject.caps.clone(), subject.declaration.clone());
        if let Some(reason) = simple.missing(&caps, &declaration, rig.registry()) {
            return Err(Stop::Skip(reason));
        }
        let appearance = Appearance::new("simple").with("lookup_table", warm()).with("unit_distance", 1.0);
        let frame = rig.draw(&around([Shape::around(&usual(), appearance)]), &How::step(0.3))?;
        let said =
            frame.warnings.iter().any(|w| w.code == WarningCode::UnusedParameter && w.message.contains("lookup_table"));
        rig.holds("said", said, &format!("{:?}", frame.warnings));
        Ok(())
    });
    topic.case("unit_distance_chosen", "a unit distance that was left out is chosen once, and said", |rig| {
        let chosen = Shape::around(&usual(), Appearance::new("lut").with("lookup_table", warm()));
        let scene = around([chosen.clone()]);
        let frame = rig.draw(&scene, &How::step(0.3))?;
        let said = frame.warnings.iter().any(|w| w.code == WarningCode::UnitDistanceDefaulted);
        rig.holds("said", said, &format!("{:?}", frame.warnings));
        let stated = Scene::new([lut(&usual(), warm(), 1.0)], scene.desc.clone());
        let wanted = rig.draw(&stated, &How::step(0.3))?;
        rig.same("the smallest voxel", &scene, &frame, &wanted);
        let clean = wanted.warnings.is_empty();
        rig.holds("no warning without need", clean, &format!("{:?}", wanted.warnings));
        Ok(())
    });
    topic.case("frame_without_shapes_says_how", "also a frame without shapes says its method", |rig| {
        let mut action = rig.action(&How::step(0.3))?;
        let frame = draw_managed(&mut *action, &[], &around([shape()]).desc).map_err(|e| stop(&e))?;
        rig.holds("method", !frame.method.sampling.is_empty(), &format!("{:?}", frame.method));

        rig.holds("cost", frame.statistics.samples == 0, "no sample");
        Ok(())
    });
}
