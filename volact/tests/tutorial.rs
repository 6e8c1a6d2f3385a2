//! Runs docs/tutorial.md as it is written: its files, its commands, what they print and draw.
//!
//! A block whose first line is a comment with a file's name is that file. Lines of `sh` blocks are
//! commands of one session in one shell; `sh fails` blocks must fail. A `text` block after them is
//! what they print. `sh interactive` blocks need somebody to look, and `sh rust` blocks a new
//! crate: these are passed over, with the files that belong to them (`xtask/tests/new_plugin.rs` makes the crate).

#![cfg(unix)]

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

use volact_files::picture;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

/// A block of code: what is behind the three marks, and its lines.
struct Block {
    kind: String,
    text: String,
}

/// The blocks of a section, by its title.
fn section(title: &str) -> Vec<Block> {
    let tutorial = fs::read_to_string(repository().join("docs/tutorial.md")).unwrap();
    let (_, rest) = tutorial.split_once(&format!("\n## {title}\n")).unwrap_or_else(|| panic!("no section {title:?}"));
    let own = rest.split("\n## ").next().unwrap();
    let parts: Vec<_> = own.split("\n```").collect();
    assert!(parts.len() % 2 == 1, "a block of {title:?} has no end");
    let block = |part: &&str| {
        let (kind, text) = part.split_once('\n').unwrap();
        Block { kind: kind.into(), text: format!("{text}\n") }
    };
    parts.iter().skip(1).step_by(2).map(block).collect()
}

/// The name that the first line of a file's block says.
fn file_name(text: &str) -> Option<&str> {
    let name = text.lines().next()?.strip_prefix("// ")?;
    name.split(':').next().filter(|name| name.contains('.') && !name.contains(' '))
}

/// A session in a folder of its own; `cd` lasts.
struct Session {
    folder: tempfile::TempDir,
    place: PathBuf,
}

impl Session {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self { place: folder.path().to_owned(), folder }
    }

    /// Runs lines, and finds out where they end.
    fn run(&mut self, lines: &str) -> Output {
        let program = Path::new(env!("CARGO_BIN_EXE_volact")).parent().unwrap();
        let others = env::var_os("PATH").unwrap_or_default();
        let path = env::join_paths([program.to_owned()].into_iter().chain(env::split_paths(&others))).unwrap();
        let said = self.folder.path().join(".place");
        let mut command = Command::new("sh");
        command.arg("-c").arg(format!("set -e\n{lines}\npwd > {}", said.display()));
        command.current_dir(&self.place).env("PATH", path).env("VOLACT", repository());
        command.env("VOLACT_CONFIG", "").env_remove("VOLACT_LOG").env_remove("VOLACT_PLUGIN_PATH");
        let output = command.output().unwrap();
        if output.status.success() {
            self.place = fs::read_to_string(said).unwrap().trim_end().into();
        }
        output
    }

    /// Follows all blocks; what was printed last is compared with the `text` blocks.
    fn follow(&mut self, blocks: &[Block]) {
        let mut printed = String::new();
        let mut ran = 0;
        for Block { kind, text } in blocks {
            match kind.as_str() {
                "sh" | "sh fails" => {
                    let output = self.run(text);
                    printed = [output.stdout, output.stderr].map(|b| String::from_utf8_lossy(&b).into_owned()).concat();
                    assert_eq!(output.status.success(), kind == "sh", "{text}{printed}");
                    ran += 1;
                }
                "text" => assert!(printed.contains(text.trim_end()), "wanted:\n{text}found:\n{printed}"),
                "sh interactive" => {}
                _ => {
                    let name = file_name(text).unwrap_or_else(|| panic!("a block of {kind} has no name:\n{text}"));
                    fs::write(self.place.join(name), text).unwrap();
                }
            }
        }
        assert!(ran > 2, "{ran} blocks were run");
    }

    /// A picture that was drawn is the one that the tutorial shows.
    fn shows(&self, name: &str) {
        let shown = repository().join("docs/tutorial").join(name);
        let [found, wanted] = [self.place.join(name), shown].map(|path| picture::load_picture(&path).unwrap());
        assert_eq!([found.width, found.height], [wanted.width, wanted.height], "{name}");
        let off = found.rgba.iter().flatten().zip(wanted.rgba.iter().flatten()).map(|(a, b)| (a - b).abs());
        let worst = off.fold(0f32, f32::max);
        // Vector units with and without fused multiply-add round differently.
        assert!(worst < 2.5 / 255.0, "{name}: {worst}");
    }
}

#[test]
fn the_shader_is_written_as_told() {
    let mut session = Session::new();
    session.follow(&section("A shader in ten minutes"));
    ["first.png", "lines.png", "ink.png", "fine.png"].iter().for_each(|name| session.shows(name));
    assert!(!session.place.join("never.png").exists());
}

#[test]
fn the_geometry_in_c_is_written_as_told() {
    let mut session = Session::new();
    session.follow(&section("A geometry in C"));
    session.shows("gem.png");
    assert!(!session.place.join("never.png").exists());
}

/// What the part in Rust changes is there to be changed, in the crate that `new-plugin` makes.
#[test]
fn the_part_in_rust_is_about_the_crate_that_is_made() {
    let template = fs::read_to_string(repository().join("xtask/templates/geometry.rs.txt")).unwrap();
    for part in [
        "struct Bipyramid {\n    radius: f64,\n    height: f64,\n}",
        "    fn tessellate(&self) -> Result<Tessellation, GeometryError> {\n",
        "    Ok(Arc::new(Bipyramid { radius: number(\"radius\"), height: number(\"height\") }))\n",
        "        .with(length(\"height\", \"from its middle to its tips\"));\n",
        "volact_plugin::export!(register);",
    ] {
        assert!(template.contains(part), "{part}");
    }
    let blocks = section("A geometry in Rust");
    assert_eq!(blocks.iter().filter(|b| b.kind == "rust").count(), 4);
    assert!(blocks.iter().any(|b| b.kind == "sh rust" && b.text.contains("cargo xtask new-plugin geometry")));
    let config = fs::read_to_string(repository().join("xtask/templates/config.ron.txt")).unwrap();
    assert!(config.contains("target/debug"), "where `cargo build` puts the library");
    // The picture that it shows was drawn by hand.
    assert!(picture::load_picture(&repository().join("docs/tutorial/pyramid.png")).is_ok());
}
