//! `volact chart`: what it measures, writes, takes up again, draws again and joins.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use serde_json::Value;

/// Runs in a folder, with true pictures kept there.
fn chart(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
    command.arg("chart").args(arguments).current_dir(folder).env("VOLACT_CONFIG", "");
    command.env("XDG_CACHE_HOME", folder).env_remove("VOLACT_PLUGIN_PATH").output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn ok(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

fn scene(name: &str) -> String {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../examples").join(name).to_str().unwrap().to_owned()
}

fn result(folder: &Path, name: &str) -> Value {
    serde_json::from_slice(&fs::read(folder.join(name)).unwrap()).unwrap()
}

const FEW: [&str; 8] = ["--size", "24", "--steps", "2,1,0.5", "-n", "2", "--action", "cpu"];

#[test]
fn a_scene_is_charted_over_what_options_offer() {
    let folder = tempfile::tempdir().unwrap();
    let part = scene("part/scene.ron");
    let said = ok(&chart(folder.path(), &[&[part.as_str(), "-o", "a.html"], &FEW[..]].concat()));
    let mut files: Vec<_> = said.lines().skip(1).collect();
    files.sort_unstable();
    assert_eq!(files, ["a.csv", "a.html", "a.json", "a.svg"], "{said}");
    assert!(!folder.path().join("a.rows.jsonl").exists(), "all is measured");
    let result = result(folder.path(), "a.json");
    let scene = &result["scenes"][0];
    assert_eq!((scene["name"].as_str(), scene["width"].as_u64()), (Some("part"), Some(24)));
    let points = scene["points"].as_array().unwrap();
    let of = |series: &str| -> Vec<f64> {
        points.iter().filter(|p| p["series"] == series).map(|p| p["rmse"].as_f64().unwrap()).collect()
    };
    // One of the two classifications is what the action takes by itself, and is not measured twice.
    let (post, pre) = (of("cpu classification=post"), of("cpu classification=pre-integrated"));
    assert_eq!((of("cpu").len(), post.len() + pre.len() >= 3), (3, true), "left out: {}", scene["left_out"]);
    for errors in [of("cpu"), post, pre].iter().filter(|errors| errors.len() == 3) {
        assert!(errors[2] < errors[0], "finer is nearer: {errors:?}");
    }
    let again =
        scene["left_out"].as_array().unwrap().iter().filter(|row| row[2].as_str().unwrap().contains("the same bits"));
    assert!(again.count() >= 1, "{}", scene["left_out"]);
    assert!(points.iter().any(|p| p["settings"]["termination"] == "0.05"), "an early end is a point of the chart");
    for point in points {
        let seconds = |name: &str| point[name].as_f64().unwrap();
        assert!(0.0 < seconds("least_s") && seconds("least_s") <= seconds("median_s"));
        assert!(point["picture"].as_str().unwrap().starts_with("data:image/png;base64,"));
        assert!(point["rmse"].as_f64() <= point["max"].as_f64() && point["p99"].as_f64() <= point["max"].as_f64());
    }
    let page = fs::read_to_string(folder.path().join("a.html")).unwrap();
    let svg = fs::read_to_string(folder.path().join("a.svg")).unwrap();
    assert_eq!(svg.matches("class=\"mark\"").count(), points.len());
    assert!(svg.contains("Pareto front") && page.contains("Pareto front"));
    assert!(!page.replace("http://www.w3.org/2000/svg", "").contains("http"), "nothing is loaded");
    let csv = fs::read_to_string(folder.path().join("a.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + points.len());
    assert_eq!(fs::read_dir(folder.path().join("volact/truth")).unwrap().count(), 1, "the truth is kept");
}

#[test]
fn a_run_whose_budget_ends_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let part = scene("part/scene.ron");
    let base = [&[part.as_str(), "-o", "a.html"], &FEW[..]].concat();
    let said = ok(&chart(folder.path(), &[&base[..], &["--budget", "0"]].concat()));
    assert!(said.contains("part: 0 points") && said.contains("the same command goes on"), "{said}");
    let none = result(folder.path(), "a.json");
    let waiting = none["scenes"][0]["left_out"].as_array().unwrap();
    assert!(!waiting.is_empty() && waiting.iter().all(|row| row[2] == "the budget ended"));
    // As a run leaves it that was killed while it wrote.
    ok(&chart(folder.path(), &base));
    let first = result(folder.path(), "a.json");
    let point = first["scenes"][0]["points"][0].clone();
    let row = format!("{}\n{{\"point\":{{\"ke", serde_json::json!({ "point": point }));
    fs::write(folder.path().join("a.rows.jsonl"), row).unwrap();
    ok(&chart(folder.path(), &base));
    let again = result(folder.path(), "a.json");
    assert_eq!(again["scenes"][0]["points"][0], point, "what was measured is not measured again");
    let count = |result: &Value| result["scenes"][0]["points"].as_array().unwrap().len();
    assert_eq!(count(&again), count(&first));
}

#[test]
fn a_result_is_drawn_again_compared_and_joined() {
    let folder = tempfile::tempdir().unwrap();
    let part = scene("part/scene.ron");
    for machine in ["here", "there"] {
        let output = format!("{machine}.html");
        let arguments = [part.as_str(), "-o", &output, "--machine", machine, "--option", "classification=post"];
        ok(&chart(folder.path(), &[&arguments[..], &FEW[..]].concat()));
    }
    let header = "scene,action,series,step,median_s,rmse\n";
    fs::write(folder.path().join("peers.csv"), format!("{header}part,vtk,vtk gpu,1,0.04,2e-3\n")).unwrap();
    let both = ["--from", "here.json", "--from", "there.json", "--join", "peers.csv", "-o", "both.html"];
    ok(&chart(folder.path(), &both));
    let result = result(folder.path(), "both.json");
    let points = result["scenes"][0]["points"].as_array().unwrap();
    let on = |machine: &str| points.iter().filter(|p| p["machine"] == machine).count();
    assert!(on("here") == on("there") && on("here") >= 3, "{points:?}");
    assert!(points.iter().any(|p| p["series"] == "vtk gpu" && p["rmse"] == 2e-3 && p["picture"].is_null()));
    let svg = fs::read_to_string(folder.path().join("both.svg")).unwrap();
    assert!(["cpu on here", "cpu on there", "vtk gpu"].iter().all(|name| svg.contains(name)), "{svg}");
    // The same numbers give the same picture.
    ok(&chart(folder.path(), &["--from", "both.json", "-o", "again.html"]));
    assert_eq!(fs::read_to_string(folder.path().join("again.svg")).unwrap(), svg);
    // Another size is another picture, and times do not compare.
    let other = [part.as_str(), "-o", "other.html", "--size", "12", "-n", "1", "--steps", "2", "--action", "cpu"];
    ok(&chart(folder.path(), &other));
    let refused = chart(folder.path(), &["--from", "here.json", "--from", "other.json"]);
    let why = text(&refused.stderr);
    assert_eq!(refused.status.code(), Some(2));
    assert!(why.contains("other.json") && why.contains("24 × 24") && why.contains("12 × 12"), "{why}");
}

#[test]
fn what_cannot_be_charted_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let part = scene("part/scene.ron");
    fs::write(folder.path().join("odd.json"), "{}").unwrap();
    fs::write(folder.path().join("bad.rows.jsonl"), "{}\n").unwrap();
    let cases: [(&[&str], &[&str]); 8] = [
        (&[], &["SCENE"]),
        (&["nowhere.ron"], &["nowhere.ron"]),
        (&[&part, "--action", "cpuu"], &["cpuu", "did you mean \"cpu\"?"]),
        (&[&part, "--action", "null"], &["null", "does not composite"]),
        (&[&part, "--steps", "1,0"], &["--steps has 0"]),
        (&[&part, "--option", "nothing=1"], &["nothing"]),
        (&["--from", "odd.json"], &["odd.json", "version"]),
        (&[&part, "--action", "cpu", "--size", "8", "-o", "bad.html"], &["bad.rows.jsonl", "line 1"]),
    ];
    for (arguments, words) in cases {
        let output = chart(folder.path(), arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)), "{arguments:?}: {said}");
    }
    assert!(!folder.path().join("chart.html").exists());
}
