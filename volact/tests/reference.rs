//! docs/reference: the pages say what is declared now, and the pictures are there.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use volact::{Registry, RegistryExt as _, core::parameter::Kind};
use volact_files::picture;

const PAGES: [&str; 4] = ["actions.md", "shaders.md", "geometries.md", "loaders.md"];
/// A picture is small.
const BYTES: u64 = 25_000;

fn reference() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/reference")
}

/// Writes the pages into a folder that has scenes of these names.
fn describe(folder: &Path, scenes: impl IntoIterator<Item = PathBuf>, more: &[&str]) -> std::process::Output {
    fs::create_dir_all(folder.join("scenes")).unwrap();
    for scene in scenes {
        fs::copy(&scene, folder.join("scenes").join(scene.file_name().unwrap())).unwrap();
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
    command.args(["describe", "--all", "--markdown"]).arg(folder).args(more).env("VOLACT_CONFIG", "");
    command.env_remove("VOLACT_LOG").env_remove("VOLACT_PLUGIN_PATH").output().unwrap()
}

fn scenes() -> Vec<PathBuf> {
    let listed = fs::read_dir(reference().join("scenes")).unwrap();
    listed.map(|entry| entry.unwrap().path()).filter(|path| path.extension().is_some_and(|e| e == "ron")).collect()
}

#[test]
fn the_pages_are_up_to_date() {
    let folder = tempfile::tempdir().unwrap();
    let output = describe(folder.path(), scenes(), &["--text-only", "--sources", "../../shaders/wgsl"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for page in PAGES {
        let [stored, made] = [reference(), folder.path().into()].map(|f| fs::read_to_string(f.join(page)).unwrap());
        let differs = stored.lines().zip(made.lines()).find(|(a, b)| a != b);
        assert!(stored == made, "docs/reference/{page} is out of date; `cargo xtask docs` renews it: {differs:?}");
    }
}

/// Everything that is registered has a scene and a picture that is shown on its page.
#[test]
fn everything_has_a_picture() {
    let registry = Registry::with_builtins();
    let mut names = BTreeSet::new();
    for d in registry.declarations() {
        let name = format!("{}-{}", d.kind.name(), d.name);
        assert!(reference().join("scenes").join(&name).with_extension("ron").is_file(), "{name} has no scene");
        let path = reference().join("pictures").join(&name).with_extension("png");
        let picture = picture::load_picture(&path).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(picture.width <= 192 && picture.height <= 192, "{name}: {} × {}", picture.width, picture.height);
        let bytes = fs::metadata(&path).unwrap().len();
        assert!(bytes < BYTES, "{name}: {bytes} bytes");
        let first = picture.rgba[0];
        let even = picture.rgba.iter().all(|c| *c == first);
        assert_eq!(even, d.kind == Kind::Action && d.name == "null", "{name} shows something");
        names.insert(name);
    }
    let drawn = fs::read_dir(reference().join("pictures")).unwrap();
    let drawn = drawn.map(|entry| entry.unwrap().path().file_stem().unwrap().to_string_lossy().into_owned());
    let stray: Vec<_> = drawn.filter(|name| !names.contains(name)).collect();
    assert!(stray.is_empty(), "pictures of what is not registered: {stray:?}");
}

/// Links lead somewhere.
#[test]
fn links_of_the_pages_lead_somewhere() {
    for page in PAGES {
        let text = fs::read_to_string(reference().join(page)).unwrap();
        let links = text.split("](").skip(1).map(|rest| rest.split(')').next().unwrap());
        for link in links.filter(|link| !link.starts_with('#')) {
            assert!(reference().join(link).is_file(), "{page}: {link}");
        }
    }
}

/// What users have of their own is described, too, and drawn where they have a scene for it.
#[test]
fn shaders_of_ones_own_have_pages_and_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    fs::write(place("config.ron"), "Config(version: 1, shader_folders: [\"looks\"])").unwrap();
    fs::create_dir_all(place("looks")).unwrap();
    fs::write(
        place("looks/own.ron"),
        r#"Shader(version: 1, release: "2.5", description: "a | b", compositing: Over, parameters: [
            (name: "volume", type: Volume, required: true, description: "the data"),
            (name: "mode", type: Choice, choices: ["warm", "cold"], default: "warm", description: "the hue"),
            (name: "unit_distance", type: Float, required: true, positive: true, unit: "world units", description: "u"),
        ])"#,
    )
    .unwrap();
    let source = "// own: one medium.\nfn shade(s: Sample) -> Medium { return medium(vec3<f32>(1.0), 0.5); }\n";
    fs::write(place("looks/own.wgsl"), source).unwrap();
    fs::create_dir_all(place("pages/scenes")).unwrap();
    fs::write(
        place("pages/scenes/shader-own.ron"),
        "Scene(version: 1, data: {\"v\": (file: \"$VOLACT_DATA/v.nrrd\")}, shapes: [(shader: \"own\", parameters: {\
         \"volume\": Volume(data: \"v\")})], image: (size: (20, 10)))",
    )
    .unwrap();
    let voxels =
        [b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n\n".to_vec(), vec![9; 8]].concat();
    fs::write(place("v.nrrd"), voxels).unwrap();
    let run = |config: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
        command.current_dir(&folder).args(["describe", "--all", "--markdown", "pages", "--data-dir", "."]);
        command.env("VOLACT_CONFIG", config).env_remove("VOLACT_LOG").output().unwrap()
    };
    let output = run("config.ron");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let page = fs::read_to_string(place("pages/shaders.md")).unwrap();
    let own = page.split("\n## own\n").nth(1).unwrap().split("\n## ").next().unwrap();
    for wanted in [
        "[![a \\| b](pictures/shader-own.png)](scenes/shader-own.ron)",
        "A | b.",
        "version 2.5",
        "composited by over",
        "`own.wgsl`",
        "own: one medium.",
        "| `mode` | choice | default `\"warm\"` | one of warm, cold |  | the hue |",
        "| `unit_distance` | float | required | above 0 | world units | u |",
    ] {
        assert!(own.contains(wanted), "{wanted:?} in {own}");
    }
    let picture = picture::load_picture(&place("pages/pictures/shader-own.png")).unwrap();
    assert_eq!([picture.width, picture.height], [20, 10]);
    // A scene that cannot be drawn is named; the pages are there all the same.
    fs::remove_file(place("v.nrrd")).unwrap();
    let output = run("config.ron");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("shader-own.ron"));
}

#[test]
fn all_is_described_in_full_or_not_at_all() {
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
        command.arg("describe").args(arguments).env("VOLACT_CONFIG", "").env_remove("VOLACT_LOG").output().unwrap()
    };
    let output = run(&["--all"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    for d in Registry::with_builtins().declarations() {
        let head = format!("{} {} {}\n", d.kind.name(), d.name, d.version);
        assert!(text.contains(&head), "{head}");
        assert!(d.parameters.iter().all(|p| text.contains(&format!("\n    {}: ", p.name))), "{head}");
    }
    for wrong in [&["cpu", "--all"][..], &["--markdown", "pages"], &["--all", "--text-only"]] {
        assert_eq!(run(wrong).status.code(), Some(2), "{wrong:?}");
    }
}
