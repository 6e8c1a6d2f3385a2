//! Errors: the right error is part of conforming. Each names the thing, what was found, what was wanted.

use volact_core::{
    ActionError, Appearance, Block, Camera, Clip, FrameDesc, Opaque, OpaqueDepth, ParameterValue, Shape, Viewport,
    glam::{DAffine3, DMat4, DVec3},
};

use super::stock::{around, shape, usual, warm};
use crate::{
    case::{Case, Need, Stop, Topic},
    rig::{How, Rig, draw, stop},
    scene::{look, lut},
};

/// Lists them.
pub fn cases() -> Vec<Case> {
    let mut topic = Topic::new("errors", &[Need::Shader("lut")]);
    orders(&mut topic);
    late(&mut topic);
    shapes(&mut topic);
    frames(&mut topic);
    options(&mut topic);
    topic.done()
}

fn ok<T>(result: Result<T, ActionError>) -> Result<T, Stop> {
    result.map_err(|e| stop(&e))
}

fn desc() -> FrameDesc {
    around([shape()]).desc
}

fn orders(topic: &mut Topic) {
    topic.case("draw_outside_a_frame", "calls out of order are refused by name and cure", |rig| {
        let mut action = rig.action(&How::default())?;
        let wanted = |e: &ActionError| matches!(e, ActionError::NotDrawing { call: "draw" });
        rig.refused("draw", action.draw(&shape()), wanted, &["draw", "begin_draw"]);
        let wanted = |e: &ActionError| matches!(e, ActionError::NotDrawing { call: "end_draw" });
        rig.refused("end_draw", action.end_draw(), wanted, &["end_draw", "begin_draw"]);
        Ok(())
    });
    topic.case("calls_inside_a_frame", "what does not belong inside a frame is refused", |rig| {
        let mut action = rig.action(&How::default())?;
        let shape = shape();
        ok(action.manage(&shape))?;
        ok(action.begin_draw(&desc()))?;
        let inside = |e: &ActionError| matches!(e, ActionError::Drawing { .. });
        rig.refused("begin_draw", action.begin_draw(&desc()), inside, &["begin_draw", "end_draw"]);
        rig.refused("unmanage", action.unmanage(&shape), inside, &["unmanage", "end_draw"]);
        let option = rig.subject().declaration.parameters.first().cloned();
        if let Some(option) = option {
            let set = action.set_option(&option.name, option.default.unwrap_or(ParameterValue::Float(0.5)));
            rig.refused("set_option", set, inside, &["set_option", "end_draw"]);
        }
        ok(action.end_draw())?;
        Ok(())
    });
    topic.case("unmanage_what_is_not_managed", "named", |rig| {
        let mut action = rig.action(&How::default())?;
        let wanted = |e: &ActionError| matches!(e, ActionError::NotManaged { .. });
        rig.refused("unmanage", action.unmanage(&shape().named("head")), wanted, &["head"]);
        Ok(())
    });
    topic.case("draw_what_is_not_managed", "drawing an unmanaged shape is an error, with the cure", |rig| {
        let mut action = rig.action(&How::default())?;
        ok(action.begin_draw(&desc()))?;
        let wanted = |e: &ActionError| matches!(e, ActionError::NotManaged { .. });
        rig.refused("draw", action.draw(&shape().named("head")), wanted, &["head", "manage"]);
        ok(action.end_draw())?;
        Ok(())
    });
    topic.case("draw_what_is_managed_late", "managed after begin_draw", |rig| {
        let mut action = rig.action(&How::default())?;
        let late = shape().named("late");
        ok(action.begin_draw(&desc()))?;
        ok(action.manage(&late))?;
        let wanted = |e: &ActionError| matches!(e, ActionError::ManagedLate { .. });
        rig.refused("draw", action.draw(&late), wanted, &["late", "begin_draw"]);
        ok(action.end_draw())?;
        Ok(())
    });
    topic.case("draw_twice", "a shape is drawn once a frame", |rig| {
        let mut action = rig.action(&How::default())?;
        let shape = shape().named("head");
        ok(action.manage(&shape))?;
        ok(action.begin_draw(&desc()))?;
        ok(action.draw(&shape))?;
        rig.refused("draw", action.draw(&shape), |e| matches!(e, ActionError::DrawnTwice { .. }), &["head", "twice"]);
        ok(action.end_draw())?;
        Ok(())
    });
}

/// Changed between begin_draw and draw, in each of the ways.
fn late(topic: &mut Topic) {
    type Change = fn(&Shape);
    let changes: Vec<(&str, Change)> = vec![
        ("transform", |s| s.set_transform(DAffine3::from_translation(DVec3::X))),
        ("table", |s| s.set_parameter("lookup_table", warm())),
        ("shader", |s| s.set_shader("simple")),
        ("geometry", |s| s.set_geometry(Block::new(DVec3::ZERO, DVec3::ONE).expect("a block"))),
        ("data", |s| s.state().volume().expect("a volume").volume().touch()),
        ("clip", |s| {
            let plane = volact_core::Plane::new(DVec3::ONE, DVec3::X).expect("a plane");
            s.set_clip(Clip::new([volact_core::ClipRegion::plane(plane)]));
        }),
    ];
    for (name, change) in changes {
        topic.case(format!("changed_late_{name}"), "a shape must be what it was at begin_draw", move |rig| {
            let mut action = rig.action(&How::default())?;
            let shape = shape().named("head");
            ok(action.manage(&shape))?;
            ok(action.begin_draw(&desc()))?;
            change(&shape);
            let wanted = |e: &ActionError| matches!(e, ActionError::ChangedLate { .. });
            rig.refused("draw", action.draw(&shape), wanted, &["head", "begin_draw"]);
            ok(action.end_draw())?;
            Ok(())
        });
    }
}

fn good() -> Appearance {
    look("lut", warm(), 1.0)
}

fn refuses(rig: &mut Rig<'_>, shape: &Shape, kind: fn(&ActionError) -> bool, words: &[&str]) -> Result<(), Stop> {
    let mut action = rig.action(&How::default())?;
    rig.refused("manage", action.manage(shape), kind, words);
    Ok(())
}

/// Wrong shapes, refused when they are managed.
fn shapes(topic: &mut Topic) {
    let parameters: fn(&ActionError) -> bool = |e| matches!(e, ActionError::Parameters { .. });
    let around = |a: Appearance| Shape::around(&usual(), a).named("head");
    type Make = Box<dyn Fn() -> Shape + Send + Sync>;
    let cases: Vec<(&str, Make, &[&str])> = vec![
        ("missing_parameter", Box::new(move || around(Appearance::new("lut"))), &["head", "lookup_table", "missing"]),
        (
            "misspelt_parameter",
            Box::new(move || around(good().with("lokup_table", warm()))),
            &["head", "lokup_table", "did you mean \"lookup_table\"?"],
        ),
        (
            "mistyped_parameter",
            Box::new(move || around(good().with("lookup_table", 3.0))),
            &["head", "lookup_table", "float", "lookup table"],
        ),
        ("out_of_bounds", Box::new(move || around(good().with("component", 9i64))), &["head", "component", "0 to 3"]),
        ("unit_of_zero", Box::new(move || around(good().with("unit_distance", 0.0))), &["head", "unit_distance"]),
        ("unit_negative", Box::new(move || around(good().with("unit_distance", -1.0))), &["head", "unit_distance"]),
        (
            "unit_not_a_number",
            Box::new(move || around(good().with("unit_distance", f64::NAN))),
            &["head", "unit_distance"],
        ),
        (
            "no_volume",
            Box::new(|| Shape::new(Block::new(DVec3::ZERO, DVec3::ONE).expect("a block"), good()).named("head")),
            &["head", "volume", "missing"],
        ),
    ];
    for (name, make, words) in cases {
        let words = words.to_vec();
        topic.case(name, "an error names the shape, the parameter, what was wanted and the nearest name", move |rig| {
            refuses(rig, &make(), parameters, &words)
        });
    }
    topic.case("several_at_once", "all problems of a shape's parameters come at once", move |rig| {
        let shape = around(Appearance::new("lut").with("lokup_table", warm()).with("component", 9i64));
        refuses(rig, &shape, parameters, &["lokup_table", "lookup_table", "component"])
    });
    topic.case("unknown_shader", "an unknown shader is named, with the nearest and all known", move |rig| {
        let unknown: fn(&ActionError) -> bool = |e| matches!(e, ActionError::UnknownShader { .. });
        refuses(rig, &around(Appearance { shader: "mipp".into(), ..good() }), unknown, &["head", "mipp", "mip", "lut"])
    });
    let singular: Vec<(&str, DAffine3)> = vec![
        ("transform_singular", DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0))),
        ("transform_not_finite", DAffine3::from_translation(DVec3::new(f64::NAN, 0.0, 0.0))),
        ("transform_infinite", DAffine3::from_translation(DVec3::new(f64::INFINITY, 0.0, 0.0))),
    ];
    for (name, map) in singular {
        topic.case(name, "a transform must be finite and have an inverse", move |rig| {
            let shape = around(good());
            shape.set_transform(map);
            // Bounds that are not finite may be what is named.
            let kind: fn(&ActionError) -> bool =
                |e| matches!(e, ActionError::Transform { .. } | ActionError::Geometry { .. });
            refuses(rig, &shape, kind, &["head"])
        });
    }
    topic.case("component_that_is_not_there", "a component beyond those of the data", move |rig| {
        let unsupported: fn(&ActionError) -> bool =
            |e| matches!(e, ActionError::Unsupported { .. } | ActionError::Parameters { .. });
        refuses(rig, &around(good().with("component", 2i64)), unsupported, &["head", "component 2"])
    });
    topic.case("wrong_in_a_managed_shape", "a managed shape that is wrong at begin_draw is refused there", |rig| {
        let mut action = rig.action(&How::default())?;
        let shape = shape().named("head");
        ok(action.manage(&shape))?;
        shape.set_parameter("component", 9i64);
        let wanted = |e: &ActionError| matches!(e, ActionError::Parameters { .. });
        rig.refused("begin_draw", action.begin_draw(&desc()), wanted, &["head", "component"]);
        let outside = |e: &ActionError| matches!(e, ActionError::NotDrawing { .. });
        rig.refused("no frame is open", action.end_draw(), outside, &[]);
        Ok(())
    });
}

/// Wrong frames, refused when they begin.
fn frames(topic: &mut Topic) {
    let n = super::stock::PIXELS;
    let opaque = |depths: usize, depth: f32| {
        Some(Opaque { color: None, depth: OpaqueDepth::Distance(vec![depth; depths].into()) })
    };
    let camera = |eye: DVec3, fov| Camera::perspective(eye, DVec3::ZERO, DVec3::Z, fov);
    let outside = Viewport { x: 20, y: 0, width: 20, height: 10 };
    let of = |change: &dyn Fn(&mut FrameDesc)| {
        let mut desc = desc();
        change(&mut desc);
        desc
    };
    let singular = Camera::Matrices { view: DMat4::ZERO, projection: DMat4::IDENTITY, depth: Default::default() };
    let cases: Vec<(&str, FrameDesc, &[&str])> = vec![
        ("frame_without_pixels", of(&|d| d.width = 0), &["size", "0"]),
        ("frame_too_large", of(&|d| (d.width, d.height) = (1 << 20, 1 << 20)), &["size"]),
        ("viewport_outside", of(&|d| d.viewport = Some(outside)), &["viewport"]),
        ("threshold_of_zero", of(&|d| d.depth_threshold = 0.0), &["depth threshold", "0"]),
        ("threshold_above_one", of(&|d| d.depth_threshold = 1.5), &["depth threshold", "1.5"]),
        ("background_not_a_number", of(&|d| d.background = [f32::NAN, 0.0, 0.0, 1.0]), &["background", "NaN"]),
        ("background_too_opaque", of(&|d| d.background = [0.0, 0.0, 0.0, 2.0]), &["background", "2"]),
        ("camera_at_its_target", of(&|d| d.camera = camera(DVec3::ZERO, 30.0)), &["camera"]),
        ("camera_of_half_a_turn", of(&|d| d.camera = camera(DVec3::ONE, 180.0)), &["camera", "180"]),
        ("camera_not_finite", of(&|d| d.camera = camera(DVec3::new(f64::NAN, 0.0, 1.0), 30.0)), &["camera"]),
        ("camera_singular", of(&|d| d.camera = singular), &["camera"]),
        ("opaque_of_another_size", of(&|d| d.opaque = opaque(7, 1.0)), &["opaque", "7"]),
        ("opaque_negative", of(&|d| d.opaque = opaque(n * n, -1.0)), &["opaque depth", "-1"]),
    ];
    for (name, wrong, words) in cases {
        let words = words.to_vec();
        topic.case(name, "a frame that cannot be is refused by begin_draw, and none is open", move |rig| {
            let mut action = rig.action(&How::default())?;
            rig.refused("begin_draw", action.begin_draw(&wrong), |e| matches!(e, ActionError::Frame(_)), &words);
            let outside = |e: &ActionError| matches!(e, ActionError::NotDrawing { .. });
            rig.refused("no frame is open", action.end_draw(), outside, &[]);
            let good = around([shape()]);
            let frame = ok(draw(&mut *action, &good.shapes, &good.desc))?;
            rig.holds("usable", frame.color.iter().any(|c| c[3] > 0.1), "the next frame is drawn");
            Ok(())
        });
    }
}

fn options(topic: &mut Topic) {
    topic.case("unknown_option", "an option that the action does not declare", |rig| {
        let mut action = rig.action(&How::default())?;
        let kind = |e: &ActionError| matches!(e, ActionError::Options { .. });
        rig.refused("set_option", action.set_option("no_such_option", 1.0.into()), kind, &["no_such_option"]);
        Ok(())
    });
    topic.needing(&[Need::Option("sample_distance")], "step_of_zero", "a step must be positive", |rig| {
        for (label, step) in
            [("zero", 0.0), ("negative", -1.0), ("not a number", f64::NAN), ("infinite", f64::INFINITY)]
        {
            let mut action = rig.action(&How::default())?;
            let kind = |e: &ActionError| matches!(e, ActionError::Options { .. });
            rig.refused(label, action.set_option("sample_distance", step.into()), kind, &["sample_distance"]);
        }
        Ok(())
    });
    topic.needing(
        &[Need::Option("sample_distance")],
        "step_too_fine",
        "a step so fine that no frame would end",
        |rig| {
            if rig.subject().options.contains_key("sample_distance") {
                return Err(Stop::Skip("set by the user".into()));
            }
            let scene = around([lut(&usual(), warm(), 1.0)]);
            let mut action = rig.action(&How::step(1e-12))?;
            match draw(&mut *action, &scene.shapes, &scene.desc) {
                // An action that has no lattice has no use for a step.
                Ok(frame) if frame.method.sample_distance == 0.0 => {
                    rig.holds("no lattice", true, "there is no lattice")
                }
                found => rig.refused("draw", found, |e| matches!(e, ActionError::Limit { .. }), &["sample"]),
            }
            Ok(())
        },
    );
    topic.case("mistyped_option", "an option of another type", |rig| {
        let declared = rig.subject().declaration.parameters.clone();
        let Some(option) = declared.first() else { return Err(Stop::Skip("it has no option".into())) };
        let mut action = rig.action(&How::default())?;
        let set = action.set_option(&option.name, ParameterValue::Matrix(DMat4::IDENTITY));
        rig.refused("set_option", set, |e| matches!(e, ActionError::Options { .. }), &[option.name.as_str()]);
        Ok(())
    });
}
