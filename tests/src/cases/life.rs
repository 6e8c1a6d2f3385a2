//! The life of an action: manage, begin, draw, end, unmanage, in any order that the contract allows.

use volact_core::{FrameDesc, ParameterValue, RenderAction, Shape, glam::DAffine3, glam::DVec3};

use super::stock::{around, shape, through, warm};
use crate::{
    case::{Case, Need, Stop, Topic},
    rig::{How, Scene, draw_managed, stop},
    scene::lut,
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("life", &[Need::Shader("lut")]);
    managing(&mut topic);
    frames(&mut topic);
    recovery(&mut topic);
    topic.done()
}

fn ok<T>(result: Result<T, volact_core::ActionError>) -> Result<T, Stop> {
    result.map_err(|e| stop(&e))
}

fn empty(frame: &volact_core::Frame) -> bool {
    frame.color.iter().all(|c| *c == [0.0; 4]) && frame.depth.iter().all(|d| *d == f32::INFINITY)
}

fn managing(topic: &mut Topic) {
    topic.case("managing_twice", "managing a shape twice changes nothing", |rig| {
        let scene = around([shape()]);
        let wanted = rig.draw(&scene, &How::step(0.4))?;
        let mut action = rig.action(&How::step(0.4))?;
        ok(action.manage(&scene.shapes[0]))?;
        let found = rig.draw_with(&mut *action, &scene)?;
        rig.same("bits", &scene, &found, &wanted);
        ok(action.unmanage(&scene.shapes[0]))?;
        rig.refused(
            "unmanaged once",
            action.unmanage(&scene.shapes[0]),
            |e| matches!(e, volact_core::ActionError::NotManaged { .. }),
            &[],
        );
        Ok(())
    });
    topic.case("managed_and_not_drawn", "managing without drawing is how an application prefetches", |rig| {
        let scene = around([shape()]);
        let wanted = rig.draw(&scene, &How::step(0.4))?;
        let mut action = rig.action(&How::step(0.4))?;
        let other = shape();
        other.set_transform(DAffine3::from_translation(DVec3::ONE));
        ok(action.manage(&other))?;
        let found = rig.draw_with(&mut *action, &scene)?;
        rig.same("bits", &scene, &found, &wanted);
        Ok(())
    });
    topic.case("unmanaged_and_managed_again", "a shape may go and come back", |rig| {
        let scene = around([shape()]);
        let mut action = rig.action(&How::step(0.4))?;
        let first = rig.draw_with(&mut *action, &scene)?;
        ok(action.unmanage(&scene.shapes[0]))?;
        let nothing = ok(draw_managed(&mut *action, &[], &scene.desc))?;
        rig.holds("gone", empty(&nothing), "a frame without shapes is empty");
        let again = rig.draw_with(&mut *action, &scene)?;
        rig.same("back", &scene, &again, &first);
        Ok(())
    });
    topic.case("shape_dropped_while_managed", "an action keeps what it manages alive", |rig| {
        let scene = around([shape()]);
        let mut action = rig.action(&How::step(0.4))?;
        for _ in 0..3 {
            ok(action.manage(&lut(&super::stock::usual(), warm(), 1.0)))?;
        }
        let found = rig.draw_with(&mut *action, &scene)?;
        let wanted = rig.draw(&scene, &How::step(0.4))?;
        rig.same("bits", &scene, &found, &wanted);
        Ok(())
    });
    topic.case("order_of_managing_means_nothing", "shapes may be managed in any order", |rig| {
        let far = shape();
        far.set_transform(DAffine3::from_translation(DVec3::Y * 9.0));
        let scene = around([shape(), far]);
        let wanted = rig.draw(&scene, &How::step(0.4))?;
        let mut action = rig.action(&How::step(0.4))?;
        scene.shapes.iter().rev().try_for_each(|s| ok(action.manage(s)))?;
        let found = ok(draw_managed(&mut *action, &scene.shapes, &scene.desc))?;
        rig.same("bits", &scene, &found, &wanted);
        Ok(())
    });
}

fn frames(topic: &mut Topic) {
    topic.case("frame_without_shapes", "a frame in which nothing is drawn is empty", |rig| {
        let mut action = rig.action(&How::step(0.4))?;
        let frame = ok(draw_managed(&mut *action, &[], &around([shape()]).desc))?;
        rig.holds("empty", empty(&frame), "no colour, and infinite depth");
        Ok(())
    });
    topic.case("many_frames", "the tenth frame is the first", |rig| {
        let scene = around([shape()]);
        let mut action = rig.action(&How::step(0.4))?;
        let first = rig.draw_with(&mut *action, &scene)?;
        for _ in 0..8 {
            rig.draw_with(&mut *action, &scene)?;
        }
        let last = rig.draw_with(&mut *action, &scene)?;
        rig.same("bits", &scene, &last, &first);
        Ok(())
    });
    topic.case("two_actions_side_by_side", "actions know nothing of each other, with frames open at once", |rig| {
        let (one, other) = (around([shape()]), through([shape()]));
        let wanted = [rig.draw(&one, &How::step(0.4))?, rig.draw(&other, &How::step(0.4))?];
        let mut actions = [rig.action(&How::step(0.4))?, rig.action(&How::step(0.4))?];
        for (action, scene) in actions.iter_mut().zip([&one, &other]) {
            ok(action.manage(&scene.shapes[0]))?;
            ok(action.begin_draw(&scene.desc))?;
            ok(action.draw(&scene.shapes[0]))?;
        }
        let [a, b] = &mut actions;
        let (b, a) = (ok(b.end_draw())?, ok(a.end_draw())?);
        rig.same("one", &one, &a, &wanted[0]);
        rig.same("other", &other, &b, &wanted[1]);
        Ok(())
    });
    topic.case("one_shape_in_two_actions", "a shape belongs to no action", |rig| {
        let scene = around([shape()]);
        let mut actions = [rig.action(&How::step(0.4))?, rig.action(&How::step(0.4))?];
        let frames = actions.iter_mut().map(|a| rig.draw_with(&mut **a, &scene)).collect::<Result<Vec<_>, _>>()?;
        rig.same("bits", &scene, &frames[1], &frames[0]);
        Ok(())
    });
    topic.case("action_on_another_thread", "an action may move to another thread", |rig| {
        let scene = around([shape()]);
        let wanted = rig.draw(&scene, &How::step(0.4))?;
        let mut action: Box<dyn RenderAction> = rig.action(&How::step(0.4))?;
        let (shapes, desc) = (scene.shapes.clone(), scene.desc.clone());
        let drawn = std::thread::spawn(move || crate::rig::draw(&mut *action, &shapes, &desc)).join();
        let frame = ok(drawn.map_err(|_| Stop::Fail("the thread panicked".into()))?)?;
        rig.same("bits", &scene, &frame, &wanted);
        Ok(())
    });
}

/// After an error an action is usable again.
fn recovery(topic: &mut Topic) {
    type Wrong = fn(&mut dyn RenderAction, &Scene) -> bool;
    let wrongs: Vec<(&str, Wrong)> = vec![
        ("a_refused_shape", |action, _| action.manage(&shape_without_a_table()).is_err()),
        ("a_refused_frame", |action, scene| {
            let wrong = FrameDesc { width: 0, ..scene.desc.clone() };
            action.begin_draw(&wrong).is_err()
        }),
        ("a_shape_broken_later", |action, scene| {
            let broken = shape();
            let managed = action.manage(&broken).is_ok();
            broken.set_parameter("lookup_table", 3.0);
            let refused = action.begin_draw(&scene.desc).is_err();
            managed && refused && action.unmanage(&broken).is_ok()
        }),
        ("a_refused_option", |action, _| action.set_option("no_such_option", ParameterValue::Float(1.0)).is_err()),
        ("a_refused_draw", |action, scene| {
            let opened = action.begin_draw(&scene.desc).is_ok();
            let refused = action.draw(&shape()).is_err();
            opened && refused && action.end_draw().is_ok()
        }),
    ];
    for (name, wrong) in wrongs {
        topic.case(
            format!("usable_after_{name}"),
            "after an error an action is usable, and no frame is open",
            move |rig| {
                let scene = around([shape()]);
                let mut action = rig.action(&How::step(0.4))?;
                let before = rig.draw_with(&mut *action, &scene)?;
                rig.holds("refused", wrong(&mut *action, &scene), "the wrong call is refused");
                let after = rig.draw_with(&mut *action, &scene)?;
                rig.same("bits", &scene, &after, &before);
                Ok(())
            },
        );
    }
}

fn shape_without_a_table() -> Shape {
    Shape::around(&super::stock::usual(), volact_core::Appearance::new("lut").with("unit_distance", 1.0))
}
