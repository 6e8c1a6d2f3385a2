//! The planner keeps what is asked of it, measured against the certified reference; says so where it cannot;
//! does not flicker; refines; and lets every choice be overridden.

use std::time::Duration;

use volact_conformance::{
    metrics::{max_error, rms_error, wide},
    rig::{self, draw_managed},
    scene::{colors, lut, shaded, volume},
};
use volact_core::{
    ActionError, Camera, Frame, FrameDesc, Options, ParameterValue, Registry, RenderAction, ScalarType, Shape,
    VolumeTexture, WarningCode,
    glam::DVec3,
    planner::{Bound, Goals, Plan, Rate, Rates},
};

const SIZE: [usize; 2] = [56, 48];

/// With the shaders that ship, too.
fn registry() -> Registry {
    let mut registry = rig::registry();
    for entry in volact_shaders::builtin().unwrap() {
        // Those that need no source are known already.
        _ = registry.add_shader(entry);
    }
    registry
}

/// Three waves through a cube of 24 samples, each with another table: a ramp, a fog, peaks of two widths.
fn scenes() -> Vec<(&'static str, Shape)> {
    let waves = |x: f64, y: f64, z: f64| {
        volume([24; 3], ScalarType::U8, move |p| 127.5 + 120.0 * (p.x / x).sin() * (p.y / y).cos() * (p.z / z).sin())
    };
    let (slow, fast) = (waves(6.0, 5.0, 7.0), waves(3.0, 2.5, 4.0));
    let ramp = || colors(&[(60.0, [0.9, 0.4, 0.1], 0.0), (200.0, [0.2, 0.6, 1.0], 0.4)]);
    let fog = colors(&[(0.0, [1.0, 0.9, 0.6], 0.01), (255.0, [0.3, 0.3, 1.0], 0.06)]);
    let peaks = colors(&[
        (70.0, [1.0, 0.2, 0.0], 0.0),
        (80.0, [1.0, 0.2, 0.0], 0.5),
        (90.0, [1.0, 0.2, 0.0], 0.0),
        (160.0, [0.0, 0.8, 0.4], 0.0),
        (190.0, [0.0, 0.8, 0.4], 0.3),
        (220.0, [0.0, 0.8, 0.4], 0.0),
    ]);
    vec![
        ("ramp", lut(&slow, ramp(), 1.0)),
        ("fog", lut(&fast, fog, 1.0)),
        ("peaks", lut(&slow, peaks, 1.0)),
        ("lit", shaded("gradient", &VolumeTexture::new(&slow), ramp(), 1.0)),
    ]
}

/// A view of the cube from an angle.
fn seen(degrees: f64) -> FrameDesc {
    let (middle, turn) = (DVec3::splat(11.5), degrees.to_radians());
    let from = middle + DVec3::new(60.0 * turn.cos(), 60.0 * turn.sin(), 25.0);
    FrameDesc::new(Camera::perspective(from, middle, DVec3::Z, 30.0), SIZE[0], SIZE[1])
}

fn planned(options: &[(&str, ParameterValue)], shape: &Shape) -> Box<dyn RenderAction> {
    try_planned(&registry(), options, shape).unwrap()
}

fn try_planned(
    registry: &Registry,
    options: &[(&str, ParameterValue)],
    shape: &Shape,
) -> Result<Box<dyn RenderAction>, ActionError> {
    let options: Options = options.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect();
    let mut action = registry.action("planned", &options)?;
    action.manage(shape)?;
    Ok(action)
}

fn draw(action: &mut dyn RenderAction, shape: &Shape, desc: &FrameDesc) -> Frame {
    draw_managed(action, std::slice::from_ref(shape), desc).unwrap()
}

fn plan(frame: &Frame) -> &Plan {
    frame.plan.as_ref().expect("a planned frame says its plan")
}

/// Errors of a frame against the certified picture: the largest, and the root of the mean square.
fn errors(frame: &Frame, shape: &Shape, desc: &FrameDesc) -> [f64; 2] {
    let mut reference = registry().action("reference", &Options::new()).unwrap();
    reference.manage(shape).unwrap();
    let wanted = wide(&draw(reference.as_mut(), shape, desc));
    [max_error(&wide(frame), &wanted), rms_error(&wide(frame), &wanted)]
}

#[test]
fn bounds_are_kept_and_estimates_are_near_the_truth() {
    let bounds =
        [Bound::MaxError(4.0 / 255.0), Bound::MaxError(0.5 / 255.0), Bound::Rmse(0.5 / 255.0), Bound::Rmse(3e-4)];
    let (mut missed, mut steps) = (Vec::new(), Vec::new());
    for (name, shape) in scenes() {
        for bound in bounds {
            let goals = Goals { bound: Some(bound), time: None }.options();
            let mut action = registry().action("planned", &goals).unwrap();
            action.manage(&shape).unwrap();
            let frame = draw(action.as_mut(), &shape, &seen(35.0));
            let [max, rmse] = errors(&frame, &shape, &seen(35.0));
            let plan = plan(&frame);
            let (error, expected) = match bound {
                Bound::MaxError(_) => (max, plan.max_error),
                Bound::Rmse(_) => (rmse, plan.rmse),
            };
            let told = format!("{name}, {bound}: {error:.2e}, {expected:.2e} expected, {}", plan.setting);
            assert!(plan.kept, "{told}");
            assert!((0.2..5.0).contains(&(error / expected)), "{told}");
            steps.push((name, bound.value(), plan.step.unwrap()));
            missed.extend((error > bound.value()).then_some(told));
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
    // A narrower bound is never met by a coarser step, and one is met by a finer one somewhere.
    let finer = |a: usize, b: usize| steps.chunks(4).map(move |s| (s[a], s[b])).collect::<Vec<_>>();
    let pairs = [finer(0, 1), finer(2, 3)].concat();
    assert!(pairs.iter().all(|(a, b)| a.0 == b.0 && b.2 <= a.2), "{pairs:?}");
    assert!(pairs.iter().any(|(a, b)| b.2 < a.2), "{pairs:?}");
}

#[test]
fn a_bound_that_cannot_be_kept_is_said_with_the_best_that_was_found() {
    let (_, shape) = scenes().remove(0);
    let mut action = planned(&[("max_error", 1e-12.into())], &shape);
    let frame = draw(action.as_mut(), &shape, &seen(35.0));
    assert!(!plan(&frame).kept);
    let said = frame.warnings.iter().find(|w| w.subject == "planned").expect("a warning");
    assert_eq!(said.code, WarningCode::SettingAdjusted);
    for part in ["max_error 1e-12 is not expected to be kept", "sample_distance=", "(max)"] {
        assert!(said.message.contains(part), "{}", said.message);
    }
    // What was found is much nearer than by default all the same.
    let default = registry().action("cpu", &Options::new()).map(|mut cpu| {
        cpu.manage(&shape).unwrap();
        draw(cpu.as_mut(), &shape, &seen(35.0))
    });
    let [planned, default] = [frame, default.unwrap()].map(|f| errors(&f, &shape, &seen(35.0))[0]);
    assert!(planned < 0.1 * default, "{planned:e} {default:e}");
}

/// Rates that are set make the expected time a matter of samples alone.
fn timed() -> Registry {
    let mut registry = registry();
    let rate = Rate { overhead: 1e-4, sample: 1e-6 };
    registry.set_rates(Rates([("cpu".to_owned(), rate)].into_iter().collect()));
    registry
}

#[test]
fn a_time_takes_the_finest_step_within_it() {
    let (_, shape) = scenes().remove(1);
    let mut before = f64::INFINITY;
    for milliseconds in [5.0, 20.0, 80.0, 320.0] {
        let mut action = try_planned(&timed(), &[("milliseconds", milliseconds.into())], &shape).unwrap();
        let frame = draw(action.as_mut(), &shape, &seen(35.0));
        let plan = plan(&frame);
        let by_samples = 1e3 * (1e-4 + 1e-6 * frame.statistics.samples as f64);
        assert!(plan.kept, "{plan:?}");
        assert!((0.5..1.1).contains(&(by_samples / milliseconds)), "{by_samples} of {milliseconds}: {}", plan.setting);
        assert!(plan.max_error < before, "more time, less error");
        before = plan.max_error;
    }
    let mut action = try_planned(&timed(), &[("milliseconds", 1e-3.into())], &shape).unwrap();
    assert!(!plan(&draw(action.as_mut(), &shape, &seen(35.0))).kept, "a microsecond is too short");
}

#[test]
fn with_both_goals_pictures_are_refined_until_the_error_is_kept_or_something_moves() {
    let (_, shape) = scenes().remove(0);
    // A time that no machine keeps, so that the first is the coarsest on all.
    let goals = [("max_error", (1.0 / 255.0).into()), ("milliseconds", 1e-4.into())];
    let mut action = planned(&goals, &shape);
    let mut frames = vec![draw(action.as_mut(), &shape, &seen(35.0))];
    while plan(&frames[frames.len() - 1]).refining {
        assert!(frames.len() < 20, "it ends");
        frames.push(draw(action.as_mut(), &shape, &seen(35.0)));
    }
    let steps: Vec<f64> = frames.iter().map(|f| plan(f).step.unwrap()).collect();
    assert!(steps.len() > 2 && steps.windows(2).all(|s| s[1] < s[0]), "{steps:?}");
    let errors: Vec<f64> = frames.iter().map(|f| errors(f, &shape, &seen(35.0))[0]).collect();
    assert!(errors[0] > 1.0 / 255.0 && errors[errors.len() - 1] <= 1.0 / 255.0, "{errors:?}");
    assert_eq!(steps[0], 8.0, "at once as coarse as it goes");
    // What is good enough stays as it is.
    let again = draw(action.as_mut(), &shape, &seen(35.0));
    assert_eq!(again.color, frames[frames.len() - 1].color);
    let moved = draw(action.as_mut(), &shape, &seen(40.0));
    assert!(plan(&moved).step.unwrap() == 8.0 && plan(&moved).refining, "at once again");
}

#[test]
fn settings_do_not_flicker_while_the_camera_turns() {
    for (name, shape) in scenes() {
        let mut action = planned(&[("rmse", (0.5 / 255.0).into())], &shape);
        let (mut settings, mut far) = (Vec::new(), 0);
        for frame in 0..60 {
            let desc = seen(f64::from(frame) * 1.5);
            let drawn = draw(action.as_mut(), &shape, &desc);
            settings.push(plan(&drawn).setting.clone());
            if frame % 20 == 10 {
                far += usize::from(errors(&drawn, &shape, &desc)[1] > 0.5 / 255.0);
            }
        }
        let changes = settings.windows(2).filter(|s| s[0] != s[1]).count();
        assert!(changes <= 4, "{name}: {changes} of {settings:?}");
        assert!(settings.windows(3).all(|s| s[0] == s[1] || s[0] != s[2]), "{name}: back and forth");
        assert_eq!(far, 0, "{name}");
    }
}

#[test]
fn what_is_given_is_kept() {
    let (_, shape) = scenes().remove(0);
    for (name, value) in [("sample_distance", 0.75.into()), ("classification", ParameterValue::from("post"))] {
        let mut action = planned(&[("max_error", (0.5 / 255.0).into()), (name, value.clone())], &shape);
        let frame = draw(action.as_mut(), &shape, &seen(35.0));
        assert_eq!(plan(&frame).options.get(name), Some(&value));
        let method = [frame.method.sample_distance.to_string(), frame.method.classification.clone()];
        assert!(method.iter().any(|m| *m == "0.75" || m.starts_with("post")), "{method:?}");
        // Also where it is set later.
        action.set_option("sample_distance", 0.3.into()).unwrap();
        assert_eq!(plan(&draw(action.as_mut(), &shape, &seen(35.0))).step.unwrap_or(0.3), 0.3);
    }
}

#[test]
fn several_actions_are_planned_for_and_who_cannot_draw_is_left_out() {
    let shape = scenes().remove(0).1;
    let of = ("of", ParameterValue::from("null reference cpu"));
    let mut action = planned(&[of, ("max_error", (2.0 / 255.0).into())], &shape);
    let frame = draw(action.as_mut(), &shape, &seen(35.0));
    let plan = plan(&frame);
    assert_eq!(plan.action, "cpu", "{plan:?}");
    for name in ["null", "reference", "cpu"] {
        assert!(plan.considered.iter().any(|c| c.setting.starts_with(name)), "{name}: {plan:?}");
    }
}

#[test]
fn wrong_wishes_are_refused_by_name() {
    let shape = scenes().remove(0).1;
    let refused = |options: &[(&str, ParameterValue)]| {
        let error = try_planned(&registry(), options, &shape).err().expect("an error");
        let mut text = error.to_string();
        let mut cause = std::error::Error::source(&error);
        while let Some(next) = cause {
            text += &format!(": {next}");
            cause = next.source();
        }
        text
    };
    let both = refused(&[("max_error", 0.1.into()), ("rmse", 0.1.into())]);
    assert!(both.contains("rmse") && both.contains("max_error"), "{both}");
    assert!(refused(&[("max_error", (-1.0).into())]).contains("max_error"));
    assert!(refused(&[("step_size", 1.0.into())]).contains("step_size"));
    assert!(refused(&[("of", ParameterValue::from("cpu planned"))]).contains("planned of planned"));
    assert!(refused(&[("of", ParameterValue::from("cqu"))]).contains("cqu"));
    assert!(refused(&[("of", ParameterValue::from(" "))]).contains("\" \""));
}

#[test]
fn a_plan_alone_draws_nothing_but_few_pixels() {
    let (_, shape) = scenes().remove(2);
    let registry = registry();
    let goals = Goals { bound: Some(Bound::Rmse(1e-3)), time: Some(Duration::from_secs(1)) };
    let mut action = registry.planned(&goals.options()).unwrap();
    action.manage(&shape).unwrap();
    let mut desc = seen(35.0);
    (desc.width, desc.height) = (800, 600);
    let (plan, sparse) = action.plan(&desc, std::slice::from_ref(&shape)).unwrap();
    // About one of a hundred.
    assert!(sparse.width * sparse.height < 6000 && plan.sparse < 6000, "{plan:?}");
    assert!(plan.kept && !plan.considered.is_empty());
    assert_eq!(Some(sparse.method.sample_distance), plan.step);
    // Drawing then takes what was planned.
    let frame = draw(&mut action, &shape, &desc);
    assert_eq!(frame.plan.unwrap().setting, plan.setting);
}
