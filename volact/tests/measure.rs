//! `volact info`, `compare` and `bench`, from outside: what they print and how they exit.

use std::{path::PathBuf, process::Command};

use serde_json::Value;

struct Run {
    code: i32,
    out: String,
    err: String,
}

fn volact(arguments: &[&str]) -> Run {
    let examples = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../examples");
    let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
    let output = command.current_dir(examples).env("VOLACT_CONFIG", "").args(arguments).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Run { code: output.status.code().unwrap(), out: text(output.stdout), err: text(output.stderr) }
}

fn json(arguments: &[&str]) -> Value {
    let run = volact(arguments);
    assert_eq!(run.code, 0, "{}", run.err);
    serde_json::from_str(&run.out).unwrap()
}

#[test]
fn compare_exits_with_1_only_past_a_threshold_given() {
    let (a, b) = ("volumizer/tables.png", "volumizer/roi.png");
    assert_eq!(volact(&["compare", a, a, "--max", "0", "--flip", "0", "--ssim", "1"]).code, 0);
    assert_eq!(volact(&["compare", a, b]).code, 0);
    let past = volact(&["compare", a, b, "--rmse", "0.001", "--psnr", "1"]);
    assert_eq!(past.code, 1);
    assert_eq!(past.out.lines().filter(|l| l.starts_with("differs: rmse is")).count(), 1);
    assert_eq!(past.out.lines().filter(|l| l.starts_with("differs:")).count(), 1);
}

#[test]
fn compare_exits_with_2_where_it_cannot_compare() {
    let sizes = volact(&["compare", "volumizer/tables.png", "volumizer/whole.png"]);
    assert_eq!(sizes.code, 2);
    assert!(sizes.err.contains("[384, 208] and [256, 256] pixels"), "{}", sizes.err);
    assert_eq!(volact(&["compare", "volumizer/tables.png", "nowhere.png"]).code, 2);
    assert_eq!(volact(&["compare", "volumizer/tables.png", "head/head.nrrd"]).code, 2);
}

#[test]
fn compare_draws_the_difference() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("difference.png");
    let file = path.to_str().unwrap();
    let found = json(&["compare", "volumizer/tables.png", "volumizer/roi.png", "--diff", file, "--json"]);
    let picture = volact_files::picture::load_picture(&path).unwrap();
    assert_eq!([picture.width, picture.height], [384, 208]);
    let lit = picture.rgba.iter().filter(|p| p[0] > 0.0).count() as u64;
    assert!(lit > 1000 && lit >= found["differing"].as_u64().unwrap() / 2);
    let same = json(&["compare", "volumizer/tables.png", "volumizer/tables.png", "--diff", file, "--json"]);
    assert_eq!((same["max"].as_f64(), same["flip"].as_f64(), same["ssim"].as_f64()), (Some(0.0), Some(0.0), Some(1.0)));
    let black = volact_files::picture::load_picture(&path).unwrap();
    assert!(black.rgba.iter().all(|p| *p == [0.0, 0.0, 0.0, 1.0]));
    // Of a scale the user chooses: from the largest difference on the brightest colour, twice as much of half of it.
    let pair = ["compare", "volumizer/tables.png", "volumizer/roi.png", "--diff", file];
    let most = found["max"].as_f64().unwrap();
    let brightest = |scale: f64| {
        assert_eq!(volact(&[&pair[..], &["--diff-scale", &scale.to_string()]].concat()).code, 0);
        let drawn = volact_files::picture::load_picture(&path).unwrap();
        drawn.rgba.iter().filter(|p| p[0] > 0.985 && p[1] > 0.985).count()
    };
    assert_eq!(brightest(4.0 * most), 0);
    assert!(brightest(most) >= 1 && brightest(most / 2.0) > brightest(most));
    assert_eq!(volact(&[&pair[..], &["--diff-scale", "0"]].concat()).code, 2);
    assert_eq!(volact(&["compare", pair[1], pair[2], "--diff-scale", "1"]).code, 2, "there is nothing to scale");
}

#[test]
fn info_tells_the_facts_and_draws_the_histogram() {
    let run = volact(&["info", "part/part.nrrd", "--log", "--bins", "40"]);
    assert_eq!(run.code, 0, "{}", run.err);
    for fact in ["dimensions  96 × 64 × 64", "type        1 × u8", "range       0 to 225", "lut, from iso"] {
        assert!(run.out.contains(fact), "{fact}: {}", run.out);
    }
    let chart: Vec<_> = run.out.lines().rev().take(9).collect();
    assert!(chart[0].starts_with("0 (log)") && chart[0].ends_with("225"));
    assert!(chart[1..].iter().all(|l| l.chars().all(|c| " .#".contains(c)) && l.len() <= 40));
}

#[test]
fn info_is_json_on_request() {
    let info = json(&["info", "head/head.nrrd", "--json", "--bins", "8"]);
    assert_eq!(info["dimensions"], serde_json::json!([80, 96, 100]));
    let counted: u64 = info["histogram"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(counted, 80 * 96 * 100);
    let header = json(&["info", "head/head.nrrd", "--json", "--header"]);
    assert!(header.get("histogram").is_none());
    assert_eq!(volact(&["info", "head/head.nrrd", "--component", "1"]).code, 2);
    assert_eq!(volact(&["info", "README.md"]).code, 2);
}

#[test]
fn bench_relates_actions_to_the_first() {
    let arguments = ["bench", "part/scene.ron", "-n", "3", "--warm-up", "0", "--size", "12x8", "--json"];
    let bench = json(&[&arguments[..], &["-a", "cpu", "-a", "reference"]].concat());
    let actions = bench["actions"].as_array().unwrap();
    assert_eq!([&actions[0]["action"], &actions[1]["action"]], ["cpu", "reference"]);
    assert_eq!(actions[0]["ratio"], 1.0);
    for action in actions {
        let seconds = |name: &str| action[name].as_f64().unwrap();
        assert!(0.0 < seconds("least_s") && seconds("least_s") <= seconds("median_s"));
        assert!(seconds("median_s") <= seconds("most_s"));
    }
}

#[test]
fn bench_takes_what_render_takes() {
    let arguments = ["bench", "part/scene.ron", "-n", "1", "--warm-up", "0", "--size", "9", "--view", "top", "--json"];
    let more = ["--step", "0.5", "--set", "unit_distance=2", "-a", "cpu", "-a", "null"];
    let bench = json(&[&arguments[..], &more[..]].concat());
    assert_eq!(bench["size"], serde_json::json!([9, 9]));
    let samples = |step: &str| {
        let bench = json(&[&arguments[..], &["--step", step, "-a", "cpu"]].concat());
        bench["actions"][0]["samples"].as_f64().unwrap()
    };
    let ratio = samples("0.25") / samples("1");
    assert!((3.0..5.0).contains(&ratio), "{ratio}");
    assert_eq!(volact(&["bench", "part/scene.ron", "-a", "null", "--step", "1"]).code, 2, "nobody takes a step");
}

#[test]
fn bench_draws_bare_volumes() {
    let run = volact(&["bench", "part/part.nrrd", "-n", "1", "--warm-up", "0", "--size", "8x8"]);
    assert_eq!(run.code, 0, "{}", run.err);
    assert!(run.out.contains("8 × 8, 1 frames") && run.out.contains("\ncpu "));
    assert_eq!(volact(&["bench", "part/part.nrrd", "-a", "no-such"]).code, 2);
}
