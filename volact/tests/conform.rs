//! `volact conform`: what it prints, writes and answers, for what is built in and for a stranger's plugin.

#[path = "../../plugin/tests/common/mod.rs"]
mod common;

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use serde_json::Value;

fn conform(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
    command.arg("conform").args(arguments).env("VOLACT_CONFIG", "").env_remove("VOLACT_PLUGIN_PATH");
    command.output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Files of a folder whose names end so, in all folders below.
fn files(folder: &Path, end: &str) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, end));
        } else if path.to_string_lossy().ends_with(end) {
            found.push(path);
        }
    }
    found
}

#[test]
fn a_topic_passes_and_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (page, json) = (folder.path().join("report.html"), folder.path().join("json"));
    let arguments = ["--action", "cpu", "--topic", "opacity", "--report", page.to_str().unwrap()];
    let output = conform(&[&arguments[..], &["--json", json.to_str().unwrap()]].concat());
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{said}{}", text(&output.stderr));
    assert!(said.contains("] opacity::slab_half ... ok") && said.contains(" 0 failed, 0 skipped"), "{said}");
    let page = fs::read_to_string(page).unwrap();
    assert!(page.contains("opacity") && page.contains("data:image/png;base64,") && !page.contains("http"));
    let results = files(&json, ".json");
    assert_eq!(results.len(), said.matches(" ... ok").count());
    let one: Value = serde_json::from_slice(&fs::read(&results[0]).unwrap()).unwrap();
    assert_eq!((one["topic"].as_str(), one["status"]["result"].as_str()), (Some("opacity"), Some("passed")));
    assert!(files(folder.path(), ".part").is_empty(), "nothing unfinished is left");
}

/// What a case wrote draws with `volact render`, and is the case's picture.
#[test]
fn a_scene_that_is_written_can_be_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("json");
    let case = "transforms::skewed";
    let output = conform(&["--action", "cpu", "--case", case, "--json", json.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
    let result: Value = serde_json::from_slice(&fs::read(&files(&json, ".json")[0]).unwrap()).unwrap();
    let scene = files(&json, "scene.ron").remove(0);
    let picture = folder.path().join("picture.npy");
    let mut render = Command::new(env!("CARGO_BIN_EXE_volact"));
    render.arg("render").arg(&scene).arg("-o").arg(&picture).env("VOLACT_CONFIG", "");
    render.args(["--action", "cpu", "--option", "sample_distance=0.3", "--option", "termination=0.0"]);
    let output = render.args(["--option", "classification=post"]).output().unwrap();
    assert!(output.status.success(), "{}", text(&output.stderr));
    let drawn = volact_files::picture::load_picture(&picture).unwrap();
    let (width, height) = (drawn.width as u64, drawn.height as u64);
    let sheet = &result["checks"][0]["sheet"];
    assert_eq!((sheet["width"].as_u64(), sheet["height"].as_u64()), (Some(width), Some(height)));
    let case: volact_conformance::outcome::CaseResult = serde_json::from_value(result).unwrap();
    let actual = &case.checks[0].sheet.as_ref().unwrap().actual;
    let differ = drawn.rgba.iter().zip(actual).filter(|(a, b)| a[..3] != b[..3]).count();
    assert_eq!(differ, 0, "pixels that differ");
}

#[test]
fn what_cannot_be_run_is_an_error() {
    let cases: [(&[&str], &[&str]); 5] = [
        (&["--action", "cpuu"], &["cpuu", "did you mean \"cpu\"?"]),
        (&["--action", "cpu", "--topic", "grid"], &["grid", "did you mean \"grids\"?"]),
        (&["--action", "cpu", "--case", "no such case"], &["no such case", "--list"]),
        (&["--action", "cpu", "--option", "sample_distance=0"], &["sample_distance"]),
        (&["--action", "null", "--topic", "tables"], &["no case was executed"]),
    ];
    for (arguments, words) in cases {
        let output = conform(arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)), "{arguments:?}: {said}");
    }
}

#[test]
fn cases_are_listed_with_what_they_need() {
    let output = conform(&["--list", "--topic", "overlap"]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(0));
    assert!(said.contains("overlap::two_coincide\n") && said.contains("needs shader lut, overlap"), "{said}");
}

/// The action of the plugin in C draws one shader, seen along one axis: nearly everything is skipped with
/// its reason, what is executed is judged, and what it does wrong is found.
#[test]
fn a_strangers_plugin_is_held_to_the_contract() {
    let folder = tempfile::tempdir().unwrap();
    common::c_plugin(folder.path(), "kit.c", "kit", &["-std=c99"]);
    let config = folder.path().join("config.ron");
    fs::write(&config, "Config(version: 1, plugins: [(name: \"kit\")], plugin_folders: [\".\"])").unwrap();
    let page = folder.path().join("report.html");
    let config = config.to_str().unwrap();
    let output = conform(&["--config", config, "--action", "zmax", "--report", page.to_str().unwrap()]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(1), "{said}{}", text(&output.stderr));
    assert!(
        said.contains("[zmax/a plugin in C] tables::one_point ... skipped: it does not draw shader \"lut\""),
        "{said}"
    );
    let skipped = said.lines().filter(|line| line.contains("... skipped: ")).count();
    assert!(skipped > 200, "{skipped} skipped");
    assert!(said.contains("FAILED"), "it takes the highest of voxels and not of what lies between: {said}");
    assert!(fs::read_to_string(page).unwrap().contains("a plugin in C"));
}

/// `cpu` behind the boundary of plugins keeps the contract as it does without.
#[test]
fn a_plugin_that_keeps_the_contract_passes() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("config.ron");
    let program = Path::new(env!("CARGO_BIN_EXE_volact")).parent().unwrap().join("deps");
    let folders = format!("{:?}", program.to_str().unwrap());
    let wanted = "(name: \"volact-cpu-plugin\")";
    let names = "{\"cpu\": \"volact-cpu-plugin\"}";
    let text_of = format!("Config(version: 1, plugins: [{wanted}], plugin_folders: [{folders}], names: {names})");
    fs::write(&config, text_of).unwrap();
    let output = conform(&["--config", config.to_str().unwrap(), "--action", "cpu", "--topic", "clipping"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stdout));
}
