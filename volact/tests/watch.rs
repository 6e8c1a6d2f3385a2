//! `volact render --watch` as a process: files are edited, and pictures and messages waited for.

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use volact_files::picture;

/// Nobody waits longer than this for anything.
const PATIENCE: Duration = Duration::from_secs(120);

const RON: &str = r#"Shader(
    version: 1,
    description: "a test",
    compositing: Over,
    parameters: [
        (name: "volume", type: Volume, required: true, description: "the data"),
        (name: "lookup_table", type: Table, required: true, description: "the table"),
        (name: "unit_distance", type: Float, required: true, positive: true, description: "the unit"),
    ],
)"#;

fn wgsl(color: &str) -> String {
    format!(
        "fn shade(s: Sample) -> Medium {{\n    let m = lookup_table(volume(s.position));\n    return Medium({color}, m.extinction);\n}}\n"
    )
}

fn scene(shader: &str, background: &str) -> String {
    format!(
        "Scene(version: 1, data: {{\"ball\": (file: \"ball.nhdr\")}}, shapes: [(shader: \"{shader}\", parameters: {{\
         \"volume\": Volume(data: \"ball\"), \"lookup_table\": Entries(file: \"table.f32\", domain: (0, 255)), \
         \"unit_distance\": 1}})], image: (size: (24, 24), background: {background}))"
    )
}

/// Two entries: nothing, and a colour with an opacity.
fn table(entry: [f32; 4]) -> Vec<u8> {
    [[0.0; 4], entry].iter().flatten().flat_map(|v: &f32| v.to_le_bytes()).collect()
}

/// A ball of voxels behind a header, a scene, a table and a shader.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 12 12 12\nencoding: raw\ndata file: voxels.u8\n";
    fs::write(place("ball.nhdr"), header).unwrap();
    fs::write(place("voxels.u8"), voxels(255.0)).unwrap();
    fs::write(place("scene.ron"), scene("own", "(0, 0, 0, 1)")).unwrap();
    fs::write(place("table.f32"), table([1.0, 1.0, 1.0, 0.9])).unwrap();
    fs::write(place("own.ron"), RON).unwrap();
    fs::write(place("own.wgsl"), wgsl("vec3<f32>(1.0, 0.0, 0.0)")).unwrap();
    folder
}

fn voxels(top: f64) -> Vec<u8> {
    let value = |i: usize| {
        let at = [i % 12, i / 12 % 12, i / 144].map(|v| v as f64 - 5.5);
        let r = at.iter().map(|v| v * v).sum::<f64>().sqrt();
        (top * (1.0 - r / 6.0)).clamp(0.0, 255.0) as u8
    };
    (0..12 * 12 * 12).map(value).collect()
}

/// A running command, ended when dropped.
struct Watching {
    child: Child,
    folder: PathBuf,
}

impl Watching {
    fn start(folder: &Path, arguments: &[&str]) -> Self {
        let file = |name: &str| Stdio::from(fs::File::create(folder.join(name)).unwrap());
        let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
        command.args(["render", "--watch", "--action", "cpu", "-o", "picture.npy"]).args(arguments);
        command.current_dir(folder).env("VOLACT_CONFIG", "").env_remove("VOLACT_LOG");
        command.stdout(file("out.txt")).stderr(file("err.txt"));
        Self { child: command.spawn().expect("the command starts"), folder: folder.into() }
    }

    fn place(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The messages so far.
    fn said(&self) -> String {
        fs::read_to_string(self.place("err.txt")).unwrap()
    }

    fn wait(&mut self, what: &str, mut there: impl FnMut(&Self) -> bool) {
        let start = Instant::now();
        while !there(self) {
            let ended = self.child.try_wait().unwrap();
            assert!(ended.is_none(), "{what}: ended with {ended:?}: {}", self.said());
            assert!(start.elapsed() < PATIENCE, "{what} never came: {}", self.said());
            thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits for words in what is said from now on, while something is done.
    fn hear(&mut self, words: &str, act: impl FnOnce(&Path)) -> String {
        let before = self.said().len();
        act(&self.folder);
        self.wait(words, |w| w.said()[before..].contains(words) && w.said().ends_with('\n'));
        self.said()[before..].to_owned()
    }

    /// The pixel in the middle of the picture.
    fn middle(&self) -> Option<[f32; 4]> {
        let picture = picture::load_picture(&self.place("picture.npy")).ok()?;
        Some(picture.rgba[12 * 24 + 12])
    }

    /// Waits until the middle of the picture is as wanted.
    fn see(&mut self, what: &str, good: impl Fn([f32; 4]) -> bool) {
        self.wait(what, |w| w.middle().is_some_and(&good));
    }
}

impl Drop for Watching {
    fn drop(&mut self) {
        _ = self.child.kill();
        _ = self.child.wait();
    }
}

fn red([r, g, b, _]: [f32; 4]) -> bool {
    r > 0.3 && g < 0.01 && b < 0.01
}

fn green([r, g, b, _]: [f32; 4]) -> bool {
    g > 0.3 && r < 0.01 && b < 0.01
}

/// As editors do that write another file and rename it.
fn replace(path: &Path, text: impl AsRef<[u8]>) {
    let aside = path.with_extension("aside");
    fs::write(&aside, text).unwrap();
    fs::rename(aside, path).unwrap();
}

#[test]
fn edits_of_shader_table_scene_and_data_are_drawn() {
    let folder = folder();
    let mut w = Watching::start(folder.path(), &["scene.ron"]);
    w.wait("the start", |w| w.said().contains("Ctrl-C ends"));
    w.see("the first picture", red);
    // The scene, the shader's two files, the table, header and voxels.
    assert!(w.said().contains("watching 6 files in 1 folder"), "{}", w.said());
    let green_text = wgsl("vec3<f32>(0.0, 1.0, 0.0)");
    let said = w.hear("drawn in", |place| fs::write(place.join("own.wgsl"), &green_text).unwrap());
    assert!(said.contains("own.wgsl changed") && said.contains("anew: shader"), "{said}");
    w.see("the edited shader", green);

    // A broken edit: its place, and the picture as it was.
    let picture = fs::read(w.place("picture.npy")).unwrap();
    let broken = green_text.replace("volume(", "volum(");
    let said = w.hear("the last picture stays", |place| fs::write(place.join("own.wgsl"), broken).unwrap());
    assert!(said.contains("own.wgsl:2:26") && said.contains('^'), "{said}");
    assert_eq!(fs::read(w.place("picture.npy")).unwrap(), picture);
    // Mended as editors do that rename, and in another colour.
    w.hear("drawn in", |place| replace(&place.join("own.wgsl"), wgsl("vec3<f32>(1.0, 0.0, 0.0)")));
    w.see("the mended shader", red);
    w.hear("drawn in", |place| replace(&place.join("own.wgsl"), &green_text));
    w.see("a file that was replaced before", green);

    // A table that lets nearly all light through.
    let said = w.hear("drawn in", |place| fs::write(place.join("table.f32"), table([1.0, 1.0, 1.0, 0.01])).unwrap());
    assert!(said.contains("table.f32 changed") && !said.contains("ball"), "{said}");
    w.see("the edited table", |c| c[1] > 0.0 && c[1] < 0.2);
    // The scene, in its shader: the kernel's own, which keeps the table's white.
    w.hear("drawn in", |place| fs::write(place.join("scene.ron"), scene("lut", "(0, 0, 0, 1)")).unwrap());
    w.see("the edited scene", |[r, g, b, _]| r > 0.0 && r == g && g == b);
    // The voxels that the header names: nothing is left of the ball.
    w.hear("voxels.u8 changed", |place| fs::write(place.join("voxels.u8"), voxels(0.0)).unwrap());
    w.see("the edited voxels", |c| c[3] == 0.0);
}

#[test]
fn only_what_depends_on_an_edit_is_made_anew() {
    let folder = folder();
    fs::write(folder.path().join("scene.ron"), scene("lut", "(0, 0, 0, 1)")).unwrap();
    let mut w = Watching::start(folder.path(), &["scene.ron", "--json"]);
    w.wait("the start", |w| w.said().contains("Ctrl-C ends"));
    let lines =
        |w: &Watching| fs::read_to_string(w.place("out.txt")).unwrap().lines().map(str::to_owned).collect::<Vec<_>>();
    let mut anew = |edit: &dyn Fn(&Path)| {
        let before = lines(&w).len();
        edit(&w.folder);
        w.wait("another line", |w| lines(w).len() > before);
        let line = serde_line(&lines(&w)[before]);
        line["statistics"]["rebuilt"].as_array().unwrap().iter().map(|r| r["what"].to_string()).collect::<Vec<_>>()
    };
    let of_table = anew(&|place| fs::write(place.join("table.f32"), table([0.0, 0.0, 1.0, 0.5])).unwrap());
    assert!(!of_table.is_empty() && !of_table.iter().any(|what| what.contains("bounds")), "{of_table:?}");
    let of_background = anew(&|place| fs::write(place.join("scene.ron"), scene("lut", "(1, 1, 1, 1)")).unwrap());
    assert!(of_background.is_empty(), "{of_background:?}");
    let of_voxels = anew(&|place| fs::write(place.join("voxels.u8"), voxels(120.0)).unwrap());
    assert!(of_voxels.iter().any(|what| what.contains("bounds")), "{of_voxels:?}");
}

fn serde_line(line: &str) -> serde_json::Value {
    serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"))
}

#[test]
fn files_that_vanish_and_return_and_bursts_are_taken_as_they_are() {
    let folder = folder();
    let mut w = Watching::start(folder.path(), &["scene.ron"]);
    w.wait("the start", |w| w.said().contains("Ctrl-C ends"));
    w.see("the first picture", red);
    let said = w.hear("the last picture stays", |place| fs::remove_file(place.join("table.f32")).unwrap());
    assert!(said.contains("table.f32"), "{said}");
    assert!(w.middle().is_some_and(red));
    w.hear("drawn in", |place| fs::write(place.join("table.f32"), table([1.0, 1.0, 1.0, 0.9])).unwrap());
    let said = w.hear("the last picture stays", |place| fs::remove_file(place.join("scene.ron")).unwrap());
    assert!(said.contains("scene.ron"), "{said}");
    // While the scene is away, the table changes: both come at once.
    let said = w.hear("drawn in", |place| {
        fs::write(place.join("table.f32"), table([1.0, 1.0, 1.0, 0.5])).unwrap();
        fs::write(place.join("own.wgsl"), wgsl("vec3<f32>(0.0, 1.0, 0.0)")).unwrap();
        fs::write(place.join("scene.ron"), scene("own", "(0, 0, 0, 1)")).unwrap();
    });
    w.see("all edits", green);
    let last = said.lines().last().unwrap();
    assert!(last.contains("scene.ron") || last.contains("own.wgsl"), "{said}");
    // What changes nothing is not drawn: the next message is about the edit after it.
    let same = fs::read(w.place("own.wgsl")).unwrap();
    let said = w.hear("drawn in", |place| {
        replace(&place.join("own.wgsl"), same);
        fs::write(place.join("notes.txt"), "nothing of the picture").unwrap();
        thread::sleep(Duration::from_millis(300));
        replace(&place.join("scene.ron"), scene("own", "(0, 0, 1, 1)"));
    });
    assert_eq!(said.matches("drawn in").count(), 1, "{said}");
}

#[test]
fn what_is_broken_at_the_start_is_waited_for_and_what_is_wrong_for_good_refused() {
    let folder = folder();
    let place = folder.path();
    fs::write(place.join("own.wgsl"), "fn shade(").unwrap();
    let mut w = Watching::start(place, &["scene.ron"]);
    w.wait("the start", |w| w.said().contains("Ctrl-C ends"));
    assert!(w.said().contains("own.wgsl:1") && w.said().contains("waiting for a change"), "{}", w.said());
    w.hear("drawn in", |place| fs::write(place.join("own.wgsl"), wgsl("vec3<f32>(1.0, 0.0, 0.0)")).unwrap());
    w.see("the first picture", red);
    drop(w);

    let refused = |arguments: &[&str]| -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
        command.current_dir(place).env("VOLACT_CONFIG", "").args(["render", "--watch"]).args(arguments);
        command.output().unwrap()
    };
    for (arguments, wanted) in [
        (&["nothing.ron", "-o", "a.png"][..], "nothing.ron: is not there"),
        (&["scene.ron", "-o", "-"], "extension is missing"),
        (&["scene.ron", "-o", "none/a.png"], "the folder none is not there"),
        (&["scene.ron", "--view", "front", "--view", "iso"], "--view"),
    ] {
        let output = refused(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(said.contains(wanted), "{arguments:?}: {said}");
    }
}

/// An interrupt ends the command as it ends others, and leaves the picture whole.
#[cfg(unix)]
#[test]
fn an_interrupt_ends_it_with_the_usual_status() {
    let folder = folder();
    let mut w = Watching::start(folder.path(), &["scene.ron"]);
    w.wait("the start", |w| w.said().contains("Ctrl-C ends"));
    let told = Command::new("kill").args(["-INT", &w.child.id().to_string()]).status().unwrap();
    assert!(told.success());
    assert_eq!(w.child.wait().unwrap().code(), Some(130));
    assert!(w.middle().is_some_and(red));
    let left =
        fs::read_dir(folder.path()).unwrap().flatten().filter(|e| e.file_name().to_string_lossy().starts_with('.'));
    assert_eq!(left.count(), 0);
}

/// Bare data are watched, too, and a picture beside them is no part of them.
#[test]
fn bare_data_are_drawn_again() {
    let folder = folder();
    let mut w = Watching::start(folder.path(), &["ball.nhdr", "--size", "24", "--shader", "mip"]);
    w.wait("the start", |w| w.said().contains("Ctrl-C ends"));
    w.see("the first picture", |c| c[0] > 0.9);
    let said = w.hear("drawn in", |place| fs::write(place.join("voxels.u8"), vec![7; 12 * 12 * 12]).unwrap());
    assert_eq!(said.matches("drawn in").count(), 1, "{said}");
}
