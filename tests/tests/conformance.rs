//! The suite on the project's own actions: a test a case and action,
//! `[cpu/AVX-512] clipping::plane_oblique`. What the suite skips is ignored with its reason, and
//! the project's own actions may skip nothing but what [`ALLOWED`] lists. Actions on GPUs are tested where
//! there is a device, one case at a time: several devices at once bring down Mesa's software Vulkan now
//! and then.

use std::sync::{Arc, Mutex, PoisonError};

use libtest_mimic::{Arguments, Failed, Trial};
use volact_conformance::{outcome::Status, rig::registry, runner::Suite, subject::Subject};
use volact_core::{ActionError, Options, ParameterValue};

/// The actions, with options beside those that cases wish.
const SUBJECTS: &[(&str, &[(&str, &str)])] = &[
    ("cpu", &[]),
    ("cpu", &[("recognise", "false")]),
    ("reference", &[]),
    ("wgpu", &[]),
    ("wgpu", &[("method", "slices")]),
    ("vulkan", &[]),
];

/// Those that need a device.
const ON_DEVICES: [&str; 2] = ["wgpu", "vulkan"];

/// What may be skipped: action, case, and a part of the reason.
const ALLOWED: &[(&str, &str, &str)] = &[
    ("reference", "sampling::ends_of_rays_are_bounded", "no option \"termination\""),
    ("reference", "sampling::skipping_changes_no_bit", "no option \"skipping\""),
    // Where built-in shaders are evaluated, too.
    ("cpu", "sampling::pre_integration_is_of_second_order", "evaluated in the middle of segments"),
    ("cpu", "sampling::steps_in_tables_pre_integrated_are_of_second_order", "evaluated in the middle of segments"),
    ("cpu", "formats::offset_f64_at_1e7", "evaluated in single precision"),
    ("cpu", "formats::offset_u32_at_4e9", "evaluated in single precision"),
    ("cpu", "tables::pre_interpolated", "pre-interpolated table in shader"),
    ("cpu", "tables::pre_interpolated_is_post_where_linear", "pre-interpolated table in shader"),
    ("cpu", "changes::table_pre_interpolated", "pre-interpolated table in shader"),
];

/// What actions on GPUs do not draw yet, or what they do not have: parts of reasons, of any case.
const NOT_ON_GPUS: &[&str] = &[
    "evaluated in single precision",
    "texture coordinates of the geometry",
    "no option \"classification\"",
    "no option \"threads\"",
    "no option \"skipping\"",
];

fn main() {
    let arguments = Arguments::from_args();
    let mut registry = registry();
    volact_wgpu::register(&mut registry).expect("the name is free");
    volact_vulkan::register(&mut registry).expect("the name is free");
    let suite = Arc::new(Suite::new(&registry).expect("built-in shaders are well named"));
    let mut trials = Vec::new();
    for (action, options) in SUBJECTS {
        let option = |(name, value): &(&str, &str)| {
            let value = value.parse().map_or_else(|_| ParameterValue::Choice((*value).into()), ParameterValue::Bool);
            ((*name).to_owned(), value)
        };
        let options: Options = options.iter().map(option).collect();
        let device = ON_DEVICES.contains(action);
        let subject = match suite.subject(action, &options) {
            Err(ActionError::Backend { source, .. }) if device => {
                eprintln!("{action} is not tested, since there is no device for it: {source}");
                continue;
            }
            subject => Arc::new(subject.expect("the project's own actions can be made")),
        };
        for index in 0..suite.cases().len() {
            let (suite, subject) = (Arc::clone(&suite), Arc::clone(&subject));
            let title = format!("[{}] {}", subject.label(), suite.cases()[index].id());
            trials.push(Trial::test(title, move || {
                static ONE: Mutex<()> = Mutex::new(());
                let _alone = device.then(|| ONE.lock().unwrap_or_else(PoisonError::into_inner));
                judge(&suite, &subject, index)
            }));
        }
    }
    libtest_mimic::run(&arguments, trials).exit();
}

fn judge(suite: &Suite, subject: &Subject, index: usize) -> Result<(), Failed> {
    let case = &suite.cases()[index];
    match suite.case(subject, case).status {
        Status::Passed | Status::ExpectedFailure(_) => Ok(()),
        Status::Failed(why) => Err(why.into()),
        Status::Skipped(why) => {
            let allowed = |(action, id, part): &(&str, &str, &str)| {
                *action == subject.action && *id == case.id() && why.contains(part)
            };
            let on_gpus = ON_DEVICES.contains(&subject.action.as_str());
            if ALLOWED.iter().any(allowed) || on_gpus && NOT_ON_GPUS.iter().any(|part| why.contains(part)) {
                Ok(())
            } else {
                Err(format!("skipped: {why}").into())
            }
        }
    }
}
