//! What `cargo xtask new-plugin` makes: a crate outside the workspace that builds alone, passes its
//! own tests, draws, and whose library loads.

#[path = "../../plugin/tests/common/alone.rs"]
mod alone;

use std::{fs, path::Path, process::Command};

use alone::{cargo, repository, target};

use volact_core::{
    Registry,
    plugin::host::{self, Loaded, Search, Wanted},
};

/// The pixels of a PNG that are not black.
fn bright_pixels(path: &Path) -> usize {
    let picture = volact_files::picture::load_picture(path).unwrap();
    picture.rgba.iter().filter(|p| p[..3].iter().any(|v| *v > 0.0)).count()
}

/// Loads the library of a crate as a host does.
#[expect(unsafe_code, reason = "loading a library runs its code")]
fn load(name: &str) -> Loaded {
    let wanted = vec![Wanted { name: name.into(), sha256: None }];
    let search = Search { folders: vec![target().join("debug")], wanted, ..Search::default() };
    // SAFETY: the library is the one that this test has just made of the repository's own templates.
    unsafe { host::load(&search, &mut Registry::with_core()) }.remove(0).result.unwrap()
}

/// One crate of each kind, made as its author would, tested by its own tests.
#[test]
fn each_kind_builds_alone_tests_itself_and_draws() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["action", "shader", "geometry", "loader"] {
        let name = format!("made-{kind}");
        let mut command = Command::new(env!("CARGO_BIN_EXE_xtask"));
        let made = command.args(["new-plugin", kind, &name, "--into"]).arg(folder.path()).output().unwrap();
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        let crate_folder = folder.path().join(&name);
        let said = cargo(&crate_folder, "test");
        assert!(said.contains("1 passed"), "{name}:\n{said}");
        assert!(bright_pixels(&crate_folder.join("picture.png")) > 1000, "{name} draws next to nothing");
        cargo(&crate_folder, "build");
        let registered = load(&name).registered;
        assert_eq!((registered[0].kind.name(), registered[0].name.as_str()), (kind, name.as_str()));
        let manifest = fs::read_to_string(crate_folder.join("Cargo.toml")).unwrap();
        let depends = manifest.split("[dependencies]").nth(1).unwrap().split('[').next().unwrap();
        let depends: Vec<_> = depends.lines().filter(|line| line.contains('=')).collect();
        let plugin = format!("volact-plugin = {{ path = \"{}/plugin\" }}", repository().display());
        assert_eq!(depends, [plugin], "{name}");
    }
}
