//! What `cargo xtask new-plugin` makes: a crate outside the workspace that builds alone, passes its
//! own tests, draws, and whose library loads.

#[path = "../../plugin/tests/common/alone.rs"]
mod alone;

use std::{fs, path::Path, process::Command};

use alone::{cargo, repository, target};

use volact_core::{
    ParameterValue, Registry,
    plugin::host::{self, Loaded, Search, Wanted},
};

/// The pixels of a PNG that are not black.
fn bright_pixels(path: &Path) -> usize {
    let picture = volact_files::picture::load_picture(path).unwrap();
    picture.rgba.iter().filter(|p| p[..3].iter().any(|v| *v > 0.0)).count()
}

/// Loads the library of a crate as a host does.
fn load(name: &str) -> Loaded {
    load_into(name, &mut Registry::with_core())
}

#[expect(unsafe_code, reason = "loading a library runs its code")]
fn load_into(name: &str, registry: &mut Registry) -> Loaded {
    let wanted = vec![Wanted { name: name.into(), sha256: None }];
    let search = Search { folders: vec![target().join("debug")], wanted, ..Search::default() };
    // SAFETY: the library is the one that this test has just made of the repository's own templates.
    unsafe { host::load(&search, registry) }.remove(0).result.unwrap()
}

/// What lies in a text from the first line that begins with `from` to the first one after it that is `to`.
fn part<'a>(text: &'a str, from: &str, to: &str) -> &'a str {
    let start = text.find(&format!("\n{from}")).unwrap_or_else(|| panic!("{from:?} is in the crate")) + 1;
    let end = start + text[start..].find(to).unwrap_or_else(|| panic!("{to:?} follows {from:?}")) + to.len();
    &text[start..end]
}

/// The section in Rust of docs/tutorial.md: the crate that it makes, changed as it says, passes its tests and
/// gives a double pyramid of any number of sides.
#[test]
fn the_tutorials_edits_compile_and_do_as_told() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_xtask"));
    let made =
        command.args(["new-plugin", "geometry", "double-pyramid", "--into"]).arg(folder.path()).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let crate_folder = folder.path().join("double-pyramid");
    let tutorial = fs::read_to_string(repository().join("docs/tutorial.md")).unwrap();
    let section = tutorial.split("\n## A geometry in Rust\n").nth(1).unwrap().split("\n## ").next().unwrap();
    let edits: Vec<&str> = section.split("```rust\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    let ends = [
        ("struct Bipyramid {", "\n}\n"),
        ("    fn tessellate(", "\n    }\n"),
        ("    Ok(Arc::new(Bipyramid {", "\n"),
        ("        .with(length(\"height\"", "\n"),
    ];
    assert_eq!(edits.len(), ends.len());
    let source = crate_folder.join("src/lib.rs");
    let mut text = fs::read_to_string(&source).unwrap();
    for (edit, (from, to)) in edits.iter().zip(ends) {
        let old = part(&text, from, to).to_owned();
        text = text.replacen(&old, edit, 1);
    }
    fs::write(&source, text).unwrap();
    let said = cargo(&crate_folder, "test");
    assert!(said.contains("1 passed"), "{said}");
    cargo(&crate_folder, "build");
    let mut registry = Registry::with_core();
    assert_eq!(load_into("double-pyramid", &mut registry).registered.len(), 1);
    for sides in [3, 4, 5, 100] {
        let given = [("radius", 2.0.into()), ("height", 3.0.into()), ("sides", i64::from(sides).into())];
        let given = given.map(|(name, value): (&str, ParameterValue)| (name.to_owned(), value)).into();
        let cut = registry.geometry("double-pyramid", &given).unwrap().tessellate().unwrap();
        let volume: f64 = (0..cut.tetrahedra.len()).map(|t| cut.volume(t)).sum();
        // Twice a third of the height times the area of a regular polygon: n/2·r²·sin(2π/n).
        let n = f64::from(sides);
        let wanted = 2.0 * 3.0 / 3.0 * n / 2.0 * 4.0 * (std::f64::consts::TAU / n).sin();
        assert!((volume - wanted).abs() < 1e-12 * wanted, "{sides} sides: {volume}, not {wanted}");
    }
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
