//! Asking for an error or a time on the command line and in scenes: `volact plan`, `render` and `calibrate`.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use serde_json::{Value, json};

/// Runs in a folder, which is the user's cache folder, too.
fn volact(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
    command.args(arguments).current_dir(folder).env("VOLACT_CONFIG", "").env_remove("VOLACT_LOG");
    command.env("XDG_CACHE_HOME", folder).env_remove("VOLACT_PLUGIN_PATH").output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn ok(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stdout)
}

fn refused(output: &Output) -> String {
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stdout));
    text(&output.stderr)
}

fn json_of(output: &Output) -> Value {
    serde_json::from_str(&ok(output)).unwrap()
}

fn example() -> String {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../examples/part/scene.ron").to_str().unwrap().to_owned()
}

/// The example with further fields, where its data are.
fn scene_with(folder: &Path, fields: &str) -> String {
    let from = PathBuf::from(example());
    fs::copy(from.with_file_name("part.nrrd"), folder.join("part.nrrd")).unwrap();
    let text = fs::read_to_string(&from).unwrap();
    let whole = text.trim_end().strip_suffix(')').unwrap();
    let path = folder.join("scene.ron");
    fs::write(&path, format!("{whole}\n    {fields}\n)\n")).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_plan_says_what_would_be_drawn_and_a_render_draws_it() {
    let folder = tempfile::tempdir().unwrap();
    let scene = example();
    let asked = [scene.as_str(), "--size", "48", "--action", "cpu", "--max-error", "0.004", "--json"];
    let said = json_of(&volact(folder.path(), &[&["plan"], &asked[..]].concat()));
    let plan = &said["plan"];
    assert_eq!(
        (said["width"].as_u64(), plan["action"].as_str(), plan["kept"].as_bool()),
        (Some(48), Some("cpu"), Some(true))
    );
    assert!(plan["max_error"].as_f64().unwrap() <= 0.004 && plan["expected_ms"].as_f64().unwrap() > 0.0, "{plan}");
    assert_eq!(said["method"]["sample_distance"], plan["step"]);
    assert!(said["resident_bytes"].as_u64().unwrap() > 1000 && !said["method"]["texture_format"].is_null());
    let considered = said["considered"].as_array().unwrap();
    let settings: Vec<_> = considered.iter().map(|c| c["setting"].as_str().unwrap()).collect();
    assert_eq!(settings, ["cpu classification=post", "cpu classification=pre-integrated"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is drawn");
    let drawn = json_of(&volact(folder.path(), &[&["render", "-o", "planned.npy"], &asked[..]].concat()));
    assert_eq!(drawn["plan"]["setting"], plan["setting"]);
    let truth = ["render", scene.as_str(), "--size", "48", "--action", "reference", "-o", "truth.npy"];
    ok(&volact(folder.path(), &truth));
    ok(&volact(folder.path(), &["compare", "planned.npy", "truth.npy", "--max", "0.004"]));
    // For people, the same in words.
    let words = ok(&volact(folder.path(), &["plan", &scene, "--size", "48", "--rmse", "1e-12"]));
    for part in
        ["48 × 48 pixels, asked for a root mean square", "NOT expected to be kept", "memory", "classification=post"]
    {
        assert!(words.contains(part), "wanted {part:?} in\n{words}");
    }
}

#[test]
fn what_is_set_is_kept_and_contradictions_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = example();
    let fixed =
        ["plan", &scene, "--size", "32", "--action", "cpu", "--option", "classification=pre-integrated", "--json"];
    let said = json_of(&volact(folder.path(), &fixed));
    assert_eq!(said["plan"]["options"]["classification"], "pre-integrated");
    assert_eq!(said["considered"].as_array().unwrap().len(), 1);
    for (arguments, wanted) in [
        (&["--max-error", "0.1", "--rmse", "0.1"][..], "cannot be used with"),
        (&["--max-error", "0.1", "--step", "1"], "cannot be used with"),
        (&["--max-error=-1"], "wanted a positive, finite number"),
        (&["--milliseconds", "nan"], "wanted a positive, finite number"),
        (&["--action", "planed", "--rmse", "0.1"], "planned"),
    ] {
        let said = refused(&volact(folder.path(), &[&["plan", scene.as_str()], arguments].concat()));
        assert!(said.contains(wanted), "wanted {wanted:?} in\n{said}");
    }
}

#[test]
fn scenes_ask_for_themselves() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene_with(folder.path(), "accuracy: Rmse(0.002), time: Milliseconds(100000)");
    let render = |more: &[&str]| {
        let all = [&["render", scene.as_str(), "--size", "32", "-o", "a.npy", "--json"], more].concat();
        json_of(&volact(folder.path(), &all))["plan"].clone()
    };
    let plan = render(&[]);
    assert!(plan["kept"].as_bool().unwrap() && plan["rmse"].as_f64().unwrap() <= 0.002, "{plan}");
    assert!(render(&["--rmse", "0.0001"])["step"].as_f64().unwrap() < plan["step"].as_f64().unwrap());
    assert!(render(&["--step", "1"]).is_null(), "a step asks for no error");
    assert_eq!(plan["refining"], false, "the last picture is the one that stays");
    let wrong = scene_with(folder.path(), "accuracy: MaxErr(0.1), time: Milliseconds(0)");
    let said = refused(&volact(folder.path(), &["render", &wrong, "-o", "a.npy"]));
    for part in ["accuracy", "MaxError(error) or Rmse(error)", "time", "above 0 and at most 1e9"] {
        assert!(said.contains(part), "wanted {part:?} in\n{said}");
    }
}

#[test]
fn a_machine_is_calibrated_once_and_plans_use_it() {
    let folder = tempfile::tempdir().unwrap();
    let scene = example();
    let said = ok(&volact(folder.path(), &["calibrate", "--action", "cpu"]));
    assert!(said.contains("cpu classification=post") && said.contains("rates.json"), "{said}");
    let path = folder.path().join("volact/rates.json");
    let mut kept: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    assert!(kept["rates"]["cpu classification=post"]["sample_s"].as_f64().unwrap() > 0.0);
    let seconds = || {
        let asked = ["plan", scene.as_str(), "--size", "32", "--action", "cpu", "--rmse", "0.01", "--json"];
        let output = volact(folder.path(), &asked);
        (json_of(&output)["plan"]["expected_ms"].as_f64().unwrap() * 1e-3, text(&output.stderr))
    };
    // A machine on which every frame takes an hour more.
    let slow = |kept: &mut Value| {
        for rate in kept["rates"].as_object_mut().unwrap().values_mut() {
            rate["overhead_s"] = json!(3600.0);
        }
    };
    slow(&mut kept);
    fs::write(&path, kept.to_string()).unwrap();
    assert!(seconds().0 > 3600.0);
    kept["machine"] = json!("another one");
    fs::write(&path, kept.to_string()).unwrap();
    assert!(seconds().0 < 3600.0, "rates of another machine do not count");
    fs::write(&path, "{").unwrap();
    let (took, said) = seconds();
    assert!(took < 3600.0 && said.contains("rates.json") && said.contains("volact calibrate"), "{said}");
    assert!(refused(&volact(folder.path(), &["calibrate", "--action", "cqu"])).contains("cqu"));
}
