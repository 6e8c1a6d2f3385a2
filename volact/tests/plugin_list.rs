//! `volact plugins` as users read it: what is found in which order, what it registers, what is refused
//! and why; and that nothing but the config has native code loaded.

#![cfg(unix)]

#[path = "../../plugin/tests/common/mod.rs"]
mod common;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use volact_plugin::plugin::host::file_name;

/// The command beside which there is nothing but what a test puts there; a link to the one that was built.
fn program(folder: &Path) -> PathBuf {
    let place = folder.join("volact");
    fs::hard_link(env!("CARGO_BIN_EXE_volact"), &place).unwrap();
    place
}

/// A folder in which the command can be linked to: of the file system that it was built in.
fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap()
}

fn run(program: &Path, place: &Path, config: &str, arguments: &[&str]) -> Output {
    let mut command = Command::new(program);
    command.current_dir(place).env("VOLACT_CONFIG", config).env_remove("VOLACT_LOG").args(arguments);
    command.output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The folders in which a plugin can lie, in the order in which they are searched: two of the config, two of
/// the environment, the program's own. Its library is in all; each time it is taken from the first that has it.
#[test]
fn folders_are_searched_in_their_order() {
    let folder = folder();
    let root = fs::canonicalize(folder.path()).unwrap();
    let places = ["config/b", "config/a", "path/d", "path/c", "bin"].map(|name| root.join(name));
    places.iter().for_each(|place| fs::create_dir_all(place).unwrap());
    let program = program(&places[4]);
    let library = common::c_plugin(&places[0], "kit.c", "kit", &[]);
    places[1..].iter().for_each(|place| _ = fs::copy(&library, place.join(file_name("kit"))).unwrap());
    let config = root.join("config/config.ron");
    fs::write(&config, "(version: 1, plugins: [(name: \"kit\")], plugin_folders: [\"b\", \"a\"])").unwrap();
    for first in 0..=places.len() {
        let mut command = Command::new(&program);
        command.arg("plugins").env("VOLACT_CONFIG", &config).env_remove("VOLACT_LOG");
        command.env("VOLACT_PLUGIN_PATH", env::join_paths([&places[2], &places[3]]).unwrap());
        let output = command.output().unwrap();
        let said = text(&output.stdout);
        let mut wanted = "boundary 1.0; folders, in order\n".to_owned();
        places.iter().for_each(|place| wanted += &format!("  {}\n", place.display()));
        match places.get(first) {
            Some(place) => {
                wanted += &format!(
                    "\nkit 1.0\n  one of each kind, in C\n  from {}\n",
                    place.join(file_name("kit")).display()
                );
                wanted += "  action zmax 1.0\n  shader tint 1.0\n  geometry octa 1.0\n  loader ramp 1.0\n";
            }
            None => {
                let all: Vec<_> = places.iter().map(|place| place.display().to_string()).collect();
                let why = format!("{} is in none of the folders; looked in {}", file_name("kit"), all.join(", "));
                wanted += &format!("\nkit\n  refused: {why} [bad name]\n");
            }
        }
        let hidden = places.iter().skip(first + 1);
        let hidden = hidden.map(|place| {
            format!("  {}: an earlier folder has one of this name\n", place.join(file_name("kit")).display())
        });
        let hidden: String = hidden.collect();
        if !hidden.is_empty() {
            wanted += &format!("\nnot loaded\n{hidden}");
        }
        assert_eq!(said, wanted);
        assert_eq!(output.status.code(), Some(if first < places.len() { 0 } else { 2 }));
        places.get(first).into_iter().for_each(|place| fs::remove_file(place.join(file_name("kit"))).unwrap());
    }
}

/// What is refused, and why: by a shader's text, by its table, by its hash, by the file's content. What is
/// not named, and a registration that the config gives to another.
#[test]
fn what_is_refused_is_listed_with_its_reason() {
    let folder = folder();
    let root = fs::canonicalize(folder.path()).unwrap();
    let program = program(&root);
    let place = root.join("plugins");
    fs::create_dir(&place).unwrap();
    common::c_plugin(&place, "kit.c", "kit", &[]);
    common::c_plugin(&place, "kit.c", "kat", &["-Dvolact_plugin_kit=volact_plugin_kat", "-DKIT_NAME=kat"]);
    for (case, name) in [("-DCASE=30", "shady"), ("-DCASE=4", "short")] {
        let name_of = format!("-DNAME={name}");
        common::c_plugin(&place, "broken.c", name, &[case, &name_of, "-Wno-unused-variable", "-Wno-unused-function"]);
    }
    fs::write(place.join(file_name("text")), "no library").unwrap();
    fs::write(place.join(file_name("other")), "nobody asks").unwrap();
    let pinned = "0".repeat(64);
    let config = format!(
        "(version: 1, plugin_folders: [\"plugins\"], names: {{\"zmax\": \"kat\", \"tint\": \"kit\", \"octa\": \"kat\", \"ramp\": \"kit\"}}, \
         plugins: [(name: \"kit\"), (name: \"kat\"), (name: \"shady\"), (name: \"short\"), (name: \"text\"), (name: \"other\", sha256: \"{pinned}\")])"
    );
    fs::write(root.join("config.ron"), config).unwrap();
    let output = run(&program, &root, "config.ron", &["plugins"]);
    assert_eq!(output.status.code(), Some(2));
    let said = text(&output.stdout);
    for wanted in [
        "  shader tint 1.0\n  loader ramp 1.0\n  action zmax 1.0, not taken: see names in the config\n",
        "  action zmax 1.0\n  geometry octa 1.0\n  shader tint 1.0, not taken: see names in the config\n",
        "\nshady\n  refused: shader \"shine\" cannot be used: shady: shine.wgsl:1:3: expected identifier, found \"\"\n    ",
        "\nshort\n  refused: table of the plugin is 40 bytes, wanted at least ",
        "\ntext\n  refused: ",
        "cannot be loaded",
        "\nother\n  refused: SHA-256 of the library is ",
        "000, as pinned [bad value]\n",
    ] {
        assert!(said.contains(wanted), "wanted\n{wanted}\nin\n{said}");
    }
    assert!(!said.contains("not loaded"), "{said}");
    // Other commands say it once and go on.
    let output = run(&program, &root, "config.ron", &["describe", "octa"]);
    assert!(output.status.success() && text(&output.stdout).contains("by plugin kat"), "{}", text(&output.stdout));
    assert!(
        text(&output.stderr).contains("plugin \"shady\": shader \"shine\" cannot be used"),
        "{}",
        text(&output.stderr)
    );
    let output = run(&program, &root, "", &["plugins"]);
    assert_eq!((output.status.code(), text(&output.stdout).contains("refused")), (Some(0), false));
}

/// A library with the names of plugins, scenes and data lies beside a scene and its data, and the scene asks for
/// what it has. Only a config that names it has its code run.
#[test]
fn native_code_beside_a_scene_or_a_data_file_is_never_loaded() {
    let folder = folder();
    let root = fs::canonicalize(folder.path()).unwrap();
    let (place, mark) = (root.join("work"), root.join("mark"));
    fs::create_dir_all(place.join("data")).unwrap();
    fs::create_dir(root.join("bin")).unwrap();
    let program = program(&root.join("bin"));
    let library = common::c_plugin(&place, "mark.c", "kit", &[&format!("-DMARK=\"{}\"", mark.display())]);
    for name in
        ["data/libkit.so", "scene.so", "libscene.so", "ramp.so", "data/libramp.so", "libzmax.so", "tint.so", "octa.so"]
    {
        _ = fs::copy(&library, place.join(name)).unwrap();
    }
    let mut voxels = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n\n".to_vec();
    voxels.extend(0..64u8);
    fs::write(place.join("data/ramp.nrrd"), voxels).unwrap();
    fs::write(place.join("data/ramp.any"), b"RAMP 2 2 2\n01234567").unwrap();
    let scene = |more: &str, shader: &str| {
        format!(
            "Scene(version: 1, data: {{\"ramp\": (file: \"data/ramp.nrrd\")}}, {more} shapes: [(shader: \"{shader}\", \
             parameters: {{\"volume\": Volume(data: \"ramp\")}})], image: (size: (8, 8)))"
        )
    };
    let geometry =
        scene("", "mip").replace("shader:", "geometry: Geometry(name: \"octa\", parameters: {\"radius\": 1}), shader:");
    let scenes = [
        ("right", scene("", "mip"), true),
        ("action", scene("action: (name: \"zmax\"),", "mip"), false),
        ("shader", scene("", "tint"), false),
        ("geometry", geometry, false),
        ("plugins", scene("plugins: [(name: \"kit\")],", "mip"), false),
        ("folders", scene("plugin_folders: [\".\"],", "mip"), false),
    ];
    for (name, text, _) in &scenes {
        fs::write(place.join(name).with_extension("ron"), text).unwrap();
    }
    let config = root.join("config.ron");
    for content in [
        "(version: 1)",
        "(version: 1, plugin_folders: [\"work\", \"work/data\"])",
        "(version: 1, plugins: [(name: \"kit\")])",
    ] {
        fs::write(&config, content).unwrap();
        for (name, _, right) in &scenes {
            let file = format!("{name}.ron");
            let output = run(&program, &place, config.to_str().unwrap(), &["render", &file, "-o", "out.npy"]);
            assert_eq!(output.status.success(), *right, "{name}: {}", text(&output.stderr));
        }
        for arguments in [
            &["render", "data/ramp.nrrd", "-o", "out.npy"][..],
            &["render", "data/ramp.any", "-o", "out.npy"],
            &["info", "data/ramp.nrrd"],
            &["info", "data/ramp.any"],
            &["info", "data/libkit.so"],
            &["render", "data/libkit.so", "-o", "out.npy"],
            &["describe"],
            &["plugins"],
        ] {
            run(&program, &place, config.to_str().unwrap(), arguments);
            assert!(!mark.exists(), "{arguments:?} with {content}");
        }
    }
    // That its code would have been noticed.
    fs::write(&config, "(version: 1, plugins: [(name: \"kit\")], plugin_folders: [\"work\"])").unwrap();
    let output = run(&program, &place, config.to_str().unwrap(), &["info", "data/ramp.any"]);
    assert!(output.status.success() && mark.exists(), "{}", text(&output.stderr));
}
