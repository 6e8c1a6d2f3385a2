//! The suite must be able to fail: faults made in the shipped actions, each of which must be caught. In `cpu`
//! every topic must catch one that no other does; on GPUs, where a whole run for each fault would take hours on
//! software, each topic that is said to catch a fault must.
//!
//! Needs the feature `mutations`, without which nothing of the faults is compiled:
//! `cargo test -p volact-conformance --features mutations --test mutations`, or
//! `cargo xtask conformance`.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::{Mutex, PoisonError},
};

use volact_conformance::{
    case::Case,
    catalog::TOPICS,
    outcome::Status,
    rig::registry,
    runner::{Filter, Suite},
    subject::Subject,
};
use volact_core::{ActionError, Options, mutation};

/// A fault is made for the whole process: one test at a time.
static ONE: Mutex<()> = Mutex::new(());

/// A fault by name, what it is, and the topics that catch it, among others where several are listed.
type Mutation = (&'static str, &'static str, &'static [&'static str]);

/// All of them. A topic that stands alone is the only one that catches the fault.
const MUTATIONS: &[Mutation] = &[
    ("opacity_exponent", "opacity over a unit taken for that over a segment", &["opacity", "sampling"]),
    ("linear_opacity", "α ≈ τh instead of the exponential", &["opacity", "sampling"]),
    ("straight_colour", "colour not premultiplied", &["opacity", "tables"]),
    ("half_voxel", "samples half a voxel off", &["grids", "transforms"]),
    ("swapped_axes", "x and y of the data swapped", &["grids", "transforms"]),
    ("forgotten_roi", "a block not cut by the geometry ROI", &["grids"]),
    ("positions_in_f32", "transforms rounded to f32", &["transforms"]),
    ("forgotten_slope", "slope and intercept forgotten", &["formats"]),
    ("nan_is_a_number", "NaN looked up like a number", &["nan"]),
    ("pixel_corners", "rays through the corners of pixels", &["cameras", "grids"]),
    ("viewport_to_the_left", "the viewport's first column forgotten", &["cameras"]),
    ("entries_from_0_to_1", "entries without a domain taken from 0 to 1", &["tables"]),
    ("background_in_the_frame", "the background laid under in the frame", &["opacity"]),
    ("eight_bit_target", "colours of eight bits", &["opacity", "sampling", "shaders"]),
    ("upside_down_colours", "red and blue swapped", &["tables", "overlap"]),
    ("maximum_from_zero", "a maximum that begins at zero", &["shaders"]),
    ("sum_without_unit", "the line integral not divided by the unit", &["shaders"]),
    ("average_without_length", "the mean not divided by the length", &["shaders", "clipping"]),
    ("first_in_last_out", "a mesh as one interval from first in to last out", &["geometry"]),
    ("early_termination", "rays that end at a fifth, whatever was declared", &["sampling"]),
    ("uncut_ends", "the first segment not cut by the shape", &["sampling"]),
    ("forgotten_clip", "a shape's own clip forgotten", &["clipping"]),
    ("forgotten_frame_clip", "the frame's clip forgotten", &["clipping", "depth"]),
    ("second_clip_region", "only the first region of a clip looked at", &["clipping"]),
    ("thin_slices", "opaque slices drawn with their opacity", &["slices"]),
    ("overlap_unweighted", "colours of overlapping shapes added, not weighted", &["overlap"]),
    ("order_of_drawing", "overlapping shapes summed in the order of drawing", &["overlap"]),
    ("forgotten_opaque_depth", "the application's depth not looked at", &["opaque"]),
    ("forgotten_backdrop", "the application's colour behind everything forgotten", &["opaque"]),
    ("normals_not_transposed", "normals of surfaces through the inverse, not its transpose", &["opaque"]),
    ("depth_threshold", "depth at another opacity", &["depth"]),
    ("depth_from_the_origin", "depth counted from the lattice's zero", &["depth"]),
    ("stale_table", "a table changed, and the old one drawn", &["changes"]),
    ("stale_data", "data touched, and old bounds kept", &["changes"]),
    ("empty_frame_is_black", "a frame without shapes is opaque black", &["life"]),
    ("component_unchecked", "a component that is not there accepted", &["errors"]),
    ("uncounted_samples", "samples not counted", &["statistics"]),
    ("threads_matter", "three threads draw other bits than two", &["determinism"]),
];

/// Faults of the actions on GPUs, most of them in the texts of the stages that both draw with; where only one of
/// them has the fault, it is named.
const ON_GPUS: &[(&str, &str, &str, &[&str])] = &[
    ("opacity_exponent", "opacity over the unit distance taken for that over 1", "", &["opacity", "sampling"]),
    ("linear_opacity", "α ≈ τh instead of the exponential", "", &["opacity", "sampling"]),
    ("straight_colour", "colour not premultiplied", "", &["opacity", "tables"]),
    ("half_voxel", "samples half a voxel off", "", &["grids", "transforms"]),
    ("swapped_axes", "x and y of the data swapped", "", &["grids", "transforms"]),
    ("forgotten_roi", "a block not cut by the geometry ROI", "", &["grids"]),
    ("positions_in_f32", "the anchor's place rounded to f32", "", &["transforms"]),
    ("forgotten_slope", "slope and intercept forgotten", "", &["formats"]),
    ("nan_is_a_number", "NaN looked up like a number", "", &["nan"]),
    ("pixel_corners", "rays through the corners of pixels", "", &["cameras", "grids"]),
    ("anchor_off", "rays in perspective that begin at the anchor", "", &["cameras"]),
    ("stepped_table", "no interpolation between a table's points", "", &["tables"]),
    ("eight_bit_target", "colours of eight bits", "", &["opacity", "sampling"]),
    ("upside_down_colours", "red and blue swapped", "", &["tables", "overlap"]),
    ("maximum_from_zero", "a maximum that begins at zero", "", &["shaders"]),
    ("sum_without_unit", "the line integral not divided by the unit", "", &["shaders"]),
    ("average_without_length", "the mean not divided by the length", "", &["shaders", "clipping"]),
    ("first_in_last_out", "a mesh as one interval from first in to last out", "", &["geometry"]),
    ("early_termination", "rays that end at a fifth, whatever was declared", "", &["sampling"]),
    ("uncut_ends", "the first segment not cut by the shape", "", &["sampling"]),
    ("missing_cosine", "slabs as far apart along a ray as along the axis", "vulkan", &["cameras"]),
    ("forgotten_clip", "all clips forgotten", "", &["clipping", "depth"]),
    ("second_clip_region", "only the first region of a clip looked at", "", &["clipping"]),
    ("thin_slices", "opaque slices drawn with their opacity", "", &["slices"]),
    ("overlap_unweighted", "colours of overlapping shapes added, not weighted", "", &["overlap"]),
    ("forgotten_opaque_depth", "the application's depth not looked at", "", &["opaque"]),
    ("forgotten_backdrop", "the application's colour behind everything forgotten", "", &["opaque"]),
    ("depth_threshold", "depth at another opacity", "", &["depth"]),
    ("depth_from_the_origin", "the depth that shaders see counted from the anchor", "", &["shaders"]),
    ("gradient_in_voxels", "the gradient along x in voxels", "", &["shaders"]),
    ("unrefined_crossings", "surfaces of values looked for once, not closed in on", "", &["shaders"]),
    ("stale_table", "a table changed, and the old one drawn", "", &["changes"]),
    ("stale_data", "data touched, and old voxels kept", "", &["changes"]),
    ("component_unchecked", "a component that is not there accepted", "", &["errors"]),
    ("uncounted_samples", "samples not counted", "", &["statistics"]),
    ("unordered", "a sum whose order is left to the device", "wgpu", &["determinism"]),
];

/// A topic in which a case fails, with the first that does; `None` where all are as they should be.
fn caught_in(suite: &Suite, subject: &Subject, topic: &str) -> Option<String> {
    let failed = |case: &&Case| matches!(suite.case(subject, case).status, Status::Failed(_));
    suite.cases().iter().filter(|c| c.topic == topic).find(failed).map(Case::id)
}

/// Topics in which at least one case fails, each with the first that does.
fn caught(suite: &Suite, subject: &Subject) -> BTreeMap<&'static str, String> {
    let mut found = BTreeMap::new();
    for case in suite.cases() {
        if !found.contains_key(case.topic)
            && let Status::Failed(_) = suite.case(subject, case).status
        {
            found.insert(case.topic, case.name.clone());
        }
    }
    found
}

#[test]
fn every_fault_is_caught_and_every_topic_catches_one_alone() {
    let _alone = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let suite = Suite::new(&registry()).expect("built-in shaders are well named");
    let subject = suite.subject("cpu", &Options::default()).expect("cpu can be made");
    // Without a fault all is well; from here on truths are kept.
    let run = suite.run(&subject, &Filter::default(), |_| ());
    assert!(run.passed(), "{}", run.summary());
    // Faults make actions panic, which is as good as failing.
    std::panic::set_hook(Box::new(|_| ()));
    let (mut alone, mut wrong) = (BTreeSet::new(), Vec::new());
    println!("| fault | what | caught by |\n|---|---|---|");
    for (name, what, topics) in MUTATIONS {
        mutation::set(Some(name));
        let found = caught(&suite, &subject);
        mutation::set(None);
        let listed: Vec<_> = found.iter().map(|(topic, case)| format!("{topic}::{case}")).collect();
        println!("| {name} | {what} | {} |", listed.join(", "));
        if let ([topic], 1) = (topics, found.len()) {
            alone.extend(found.contains_key(topic).then_some(*topic));
        }
        let missed: Vec<_> = topics.iter().filter(|topic| !found.contains_key(*topic)).collect();
        if found.is_empty() || !missed.is_empty() {
            wrong.push(format!("{name}: not caught by {missed:?}; caught by {:?}", found.keys()));
        }
    }
    _ = std::panic::take_hook();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let none: Vec<_> = TOPICS.iter().map(|(topic, _)| topic).filter(|topic| !alone.contains(*topic)).collect();
    assert!(none.is_empty(), "topics that catch nothing that no other does: {none:?}");
}

/// The same in the actions on GPUs, held to the topics that are said to catch a fault. That they draw all cases
/// of these topics as they should without one is what the test `conformance` sees.
#[test]
fn every_fault_on_a_gpu_is_caught() {
    let mut registry = registry();
    volact_wgpu::register(&mut registry).expect("the name is free");
    volact_vulkan::register(&mut registry).expect("the name is free");
    let suite = Suite::new(&registry).expect("built-in shaders are well named");
    let _alone = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut wrong = Vec::new();
    for action in ["wgpu", "vulkan"] {
        let subject = match suite.subject(action, &Options::default()) {
            Err(ActionError::Backend { source, .. }) => {
                eprintln!("{action} is not tested, since there is no device for it: {source}");
                continue;
            }
            subject => subject.expect("the project's own actions can be made"),
        };
        println!("{action}\n\n| fault | what | caught by |\n|---|---|---|");
        for (name, what, _, topics) in ON_GPUS.iter().filter(|(.., of, _)| of.is_empty() || of == &action) {
            mutation::set(Some(name));
            let found: Vec<_> = topics.iter().map(|topic| caught_in(&suite, &subject, topic)).collect();
            mutation::set(None);
            let by: Vec<_> = found.iter().flatten().map(String::as_str).collect();
            println!("| {name} | {what} | {} |", by.join(", "));
            let missed = topics.iter().zip(&found).filter(|(_, found)| found.is_none()).map(|(topic, _)| *topic);
            let missed: Vec<_> = missed.collect();
            if !missed.is_empty() {
                wrong.push(format!("{action}, {name}: not caught by {missed:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
