//! The atlas of failure, measured again: a test a ladder, one for what Volact does about each family, and
//! `docs/stability.md` held to the code. What needs a device is left out where there is none, and said.

use std::sync::Arc;

use libtest_mimic::{Arguments, Failed, Trial};
use volact_conformance::{
    atlas::{Lab, families, page},
    cases::stock::{around, shape},
    rig::{draw, draw_managed, registry},
    truth::chain,
};
use volact_core::{Context, Options};
use volact_wgpu::WgpuAction;

fn main() {
    let arguments = Arguments::from_args();
    let mut registry = registry();
    volact_wgpu::register(&mut registry).expect("the name is free");
    volact_vulkan::register(&mut registry).expect("the name is free");
    let lab = Arc::new(Lab::new(&registry).expect("built-in shaders are well named"));
    let mut trials = vec![
        Trial::test("document_is_that_of_the_code", document),
        Trial::test("12::plugins_that_fail_are_tested_elsewhere", elsewhere),
    ];
    for (f, family) in families().iter().enumerate() {
        for (l, ladder) in family.ladders.iter().enumerate() {
            let lab = Arc::clone(&lab);
            trials.push(Trial::test(format!("{}::{}", family.number, ladder.name), move || climb(&lab, f, l)));
        }
        let lab = Arc::clone(&lab);
        trials.push(Trial::test(format!("{}::answers", family.number), move || answers(&lab, f)));
    }
    trials.push(Trial::test("12::lost_device_is_an_error_that_names_it", lost_device));
    libtest_mimic::run(&arguments, trials).exit();
}

/// A device that goes away between two frames: the next is an error, no crash and no old picture.
fn lost_device() -> Result<(), Failed> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let Ok(adapter) = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())) else {
        println!("skipped: there is no adapter");
        return Ok(());
    };
    let limits = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&limits))?;
    let scene = around([shape()]);
    let options = volact_wgpu::declaration().resolve(&Options::new(), |_| false).map_err(|p| format!("{p:?}"))?;
    let context = Context { shaders: registry().shaders().clone(), ..Context::default() };
    let mut action = WgpuAction::with_device(&context, &options, device.clone(), queue);
    draw(&mut action, &scene.shapes, &scene.desc)?;
    device.destroy();
    match draw_managed(&mut action, &scene.shapes, &scene.desc) {
        Err(error) if chain(&error).contains("adapter") => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}

fn climb(lab: &Lab, family: usize, ladder: usize) -> Result<(), Failed> {
    let family = families().swap_remove(family);
    let curves = family.ladders[ladder].climb(lab);
    for curve in &curves {
        println!("{}: {:?}", curve.name, curve.errors);
        if let Some(why) = curve.skipped() {
            println!("{}: skipped: {why}", curve.name);
        }
    }
    let problems: Vec<String> = curves.iter().flat_map(|c| c.problems()).collect();
    if problems.is_empty() { Ok(()) } else { Err(problems.join("\n").into()) }
}

fn answers(lab: &Lab, family: usize) -> Result<(), Failed> {
    let family = families().swap_remove(family);
    let said = |(what, found): (&str, Result<(), String>)| found.err().map(|why| format!("{what}\n  {why}"));
    let wrong: Vec<String> = family.answers.iter().map(|a| (a.what, a.check(lab))).filter_map(said).collect();
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n").into()) }
}

/// Families, answers and bounds are those of the code, in its order.
fn document() -> Result<(), Failed> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/stability.md");
    let text = std::fs::read_to_string(path)?;
    if !text.starts_with(page::HEAD) {
        return Err("docs/stability.md begins otherwise than tests/src/atlas/head.md; write it anew".into());
    }
    let wanted = families().into_iter().flat_map(|family| {
        let bounds = family.ladders.iter().flat_map(|ladder| {
            let methods = ladder.methods.iter().map(|m| page::statement(m.name, &m.bound));
            let chart = format!("![{}](stability/{}.svg)", ladder.title, ladder.name);
            let above = [format!("### {}", ladder.title), chart, page::caption(ladder)];
            above.into_iter().chain(methods).collect::<Vec<_>>()
        });
        let heading = [format!("## {}", page::heading(&family)), family.about.into()];
        heading.into_iter().chain(bounds).chain(page::answers(&family)).collect::<Vec<_>>()
    });
    let mut lines = text.lines();
    for line in wanted {
        if !lines.any(|l| l.starts_with(&line)) {
            return Err(format!("docs/stability.md lacks, or has elsewhere: {line}; write it anew").into());
        }
    }
    let numbered = |l: &&str| l.strip_prefix("## ").is_some_and(|l| l.starts_with(|c: char| c.is_ascii_digit()));
    let headings = text.lines().filter(numbered).count();
    if headings == families().len() { charts() } else { Err(format!("{headings} families in the document").into()) }
}

/// A chart a ladder, and no other.
fn charts() -> Result<(), Failed> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/stability");
    let file = |entry: std::io::Result<std::fs::DirEntry>| entry.map(|e| e.file_name().to_string_lossy().into_owned());
    let mut found = std::fs::read_dir(folder)?.map(file).collect::<Result<Vec<_>, _>>()?;
    let ladders = families().into_iter().flat_map(|f| f.ladders);
    let mut wanted: Vec<String> = ladders.map(|l| format!("{}.svg", l.name)).collect();
    found.sort();
    wanted.sort();
    if found == wanted { Ok(()) } else { Err(format!("docs/stability holds {found:?}, wanted {wanted:?}").into()) }
}

/// Tests outside this package that the document names.
const ELSEWHERE: [(&str, &str); 3] = [
    ("plugin/tests/rust.rs", "panics_come_back_as_errors_and_the_host_goes_on"),
    ("plugin/tests/broken.rs", "faulty_actions_are_errors_and_can_be_used_again"),
    ("plugin/tests/broken.rs", "faulty_geometries_are_errors_and_leak_nothing"),
];

fn elsewhere() -> Result<(), Failed> {
    for (file, name) in ELSEWHERE {
        let text = std::fs::read_to_string(format!("{}/../{file}", env!("CARGO_MANIFEST_DIR")))?;
        if !text.contains(&format!("#[test]\nfn {name}()")) {
            return Err(format!("no test {name} in {file}").into());
        }
    }
    Ok(())
}
