//! `volact verify`: what it prints, writes and answers.

#[path = "../../plugin/tests/common/mod.rs"]
mod common;

use std::{
    fs,
    process::{Command, Output},
};

use serde_json::Value;

fn verify(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
    command.arg("verify").args(arguments).env("VOLACT_CONFIG", "").env_remove("VOLACT_PLUGIN_PATH");
    command.output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn orders_are_printed_and_plotted() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("orders.html");
    let output = verify(&["--action", "cpu", "--json", "--output", page.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    let said: Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = said["runs"][0]["rows"].as_array().unwrap();
    let slope = |name: &str| {
        let row = rows.iter().find(|row| row["name"] == name).unwrap();
        assert_eq!(row["result"], "ok", "{row}");
        row["study"]["slope"].as_f64().unwrap()
    };
    for name in
        ["sampling::midpoint_is_of_second_order", "sampling::pictures_converge", "grids::refinement_is_of_second_order"]
    {
        assert!((1.7..2.4).contains(&slope(name)), "{name}: {}", slope(name));
    }
    assert!((0.6..1.5).contains(&slope("sampling::steps_in_tables_are_of_first_order")));
    let unchanged = rows.iter().filter(|row| row["expected"] == "no_change").count();
    assert!(unchanged >= 7, "{unchanged} rows of what must not change");
    let wrong = said["controls"].as_array().unwrap().iter().find(|row| row["name"] == "midpoint with α ≈ τh").unwrap();
    assert!((wrong["study"]["slope"].as_f64().unwrap() - 1.0).abs() < 0.15);
    let page = fs::read_to_string(&page).unwrap();
    assert!(page.matches("<svg").count() >= 10 && page.contains("sampling::midpoint_is_of_second_order"));
    assert!(!page.replace("http://www.w3.org/2000/svg", "").contains("http"));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing unfinished is left");
}

/// The plugin in C draws one shader that has no order: all is skipped with the reason, and that is no success.
#[test]
fn a_strangers_plugin_is_studied() {
    let folder = tempfile::tempdir().unwrap();
    common::c_plugin(folder.path(), "kit.c", "kit", &["-std=c99"]);
    let config = folder.path().join("config.ron");
    fs::write(&config, "Config(version: 1, plugins: [(name: \"kit\")], plugin_folders: [\".\"])").unwrap();
    let output = verify(&["--config", config.to_str().unwrap(), "--action", "zmax"]);
    let (said, error) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(2), "{said}{error}");
    assert!(said.contains("sampling::midpoint_is_of_second_order") && said.contains("does not draw shader \"lut\""));
    assert!(error.contains("[zmax/a plugin in C] no order was looked at"), "{error}");
}

#[test]
fn what_cannot_be_studied_is_an_error() {
    for (arguments, words) in [
        (&["--action", "cpuu"][..], &["cpuu", "did you mean \"cpu\"?"][..]),
        (&["--action", "cpu", "--option", "sample_distance=0"], &["sample_distance"]),
        (&["--action", "null"], &["no order was looked at"]),
    ] {
        let output = verify(arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)), "{arguments:?}: {said}");
    }
}
