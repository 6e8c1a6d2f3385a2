//! A plugin in Rust, built by cargo apart from the workspace: the same traits on both sides.

mod common;

use std::{fs, path::Path, sync::Mutex};

use volact_plugin::{
    ActionError, Appearance, Compositing, FrameDesc, LoadError, Options, ParameterValue, Registry, ScalarType, Shape,
    View, Volume, VolumeDesc, WarningCode,
    glam::DVec3,
    parameter::ParameterMap,
    plugin::{Code, PluginError},
};

fn registry() -> Registry {
    let mut registry = Registry::with_core();
    let loaded = common::load(common::rust_plugin(), "menagerie", &mut registry).unwrap();
    assert_eq!((loaded.version.as_str(), loaded.registered.len()), ("0.3.0", 5));
    assert_eq!(loaded.description, "One of each kind, and some that panic");
    registry
}

fn choice(word: &str) -> ParameterValue {
    ParameterValue::Choice(word.into())
}

fn mode(word: &str) -> Options {
    Options::from([("mode".to_owned(), choice(word))])
}

fn volume() -> Volume {
    Volume::new(VolumeDesc::new([3; 3], ScalarType::U8, 1), vec![51u8; 27]).unwrap()
}

fn shape(volume: &Volume) -> Shape {
    Shape::around(volume, Appearance::new("mip"))
}

fn draw(registry: &Registry, options: &Options, shape: &Shape) -> Result<volact_plugin::Frame, ActionError> {
    let mut action = registry.action("painter", options)?;
    action.manage(shape)?;
    action.begin_draw(&FrameDesc::fit(shape, View::Front, 8, 6))?;
    action.draw(shape)?;
    action.end_draw()
}

#[test]
fn action_paints_without_copies() {
    let registry = registry();
    let volume = volume();
    let frame = draw(&registry, &Options::new(), &shape(&volume)).unwrap();
    assert_eq!(frame.pixel(4, 3), [0.2, 0.2, 0.2, 1.0]);
    assert_eq!(frame.pixel(0, 0), [0.0; 4]);
    assert!(frame.depth[3 * 8 + 4].is_finite() && frame.depth[0].is_infinite());
    assert_eq!((frame.method.sampling.as_str(), frame.statistics.rays), ("first hit", 7));
    // The note of the shape is the host's, the other is the plugin's.
    let codes: Vec<_> = frame.warnings.iter().map(|w| w.code).collect();
    assert_eq!(codes, [WarningCode::UnitDistanceDefaulted, WarningCode::SettingAdjusted]);
    let said = |name: &str| frame.statistics.details.iter().find(|(n, _)| n == name).unwrap().1.clone();
    assert_eq!(said("voxels at"), format!("{:p}", volume.data().bytes().as_ptr()));
    assert_eq!(said("colour at"), format!("{:p}", frame.color.as_ptr()));
}

#[test]
fn the_same_data_stay_the_same_from_frame_to_frame() {
    let registry = registry();
    let volume = volume();
    let shape = shape(&volume);
    let mut action = registry.action("painter", &Options::new()).unwrap();
    action.manage(&shape).unwrap();
    let mut ids = Vec::new();
    for round in 0..3 {
        shape.set_transform(volact_plugin::glam::DAffine3::from_translation(DVec3::X * f64::from(round)));
        action.begin_draw(&FrameDesc::fit(&shape, View::Front, 4, 4)).unwrap();
        action.draw(&shape).unwrap();
        let frame = action.end_draw().unwrap();
        assert_eq!(frame.pixel(2, 2)[3], 1.0, "the shape moves, and the camera with it");
        ids.push(frame.statistics.details.iter().find(|(n, _)| n == "volume id").unwrap().1.clone());
    }
    assert!(ids.iter().all(|id| *id == ids[0]), "{ids:?}");
}

#[test]
fn caps_and_refusals_come_through() {
    let registry = registry();
    let caps = registry.action("painter", &Options::new()).unwrap().caps();
    assert_eq!(
        (caps.compositing, caps.shaders, caps.device.as_str()),
        (vec![Compositing::Over, Compositing::Maximum], None, "paint")
    );
    assert!(caps.depth && !caps.overlap);
    let error = registry.action("painter", &mode("refused")).err().unwrap();
    let message = "action \"painter\" cannot draw shape \"any\": refused on request; ask for another mode".into();
    let plugin = "menagerie".into();
    assert!(matches!(error, ActionError::Plugin(e) if e == PluginError { plugin, code: Code::Unsupported, message }));
}

/// Every call, with a panic of words and one whose payload panics when it is dropped.
#[test]
fn panics_come_back_as_errors_and_the_host_goes_on() {
    let registry = registry();
    let shape = shape(&volume());
    for place in ["create", "manage", "begin_draw", "draw", "end_draw"] {
        let error = draw(&registry, &mode(place), &shape).unwrap_err().to_string();
        assert_eq!(error, format!("plugin \"menagerie\": it panicked: in {place} [panicked]"));
        let error = draw(&registry, &mode(&format!("{place}-bomb")), &shape).unwrap_err().to_string();
        assert_eq!(error, "plugin \"menagerie\": it panicked [panicked]", "{place}");
    }
    for end in ["", "-bomb"] {
        // These have no error to return: nothing is promised, and nothing breaks.
        let caps = registry.action("painter", &mode(&format!("caps{end}"))).unwrap().caps();
        assert_eq!(caps, volact_plugin::Caps::default());
        drop(registry.action("painter", &mode(&format!("drop{end}"))).unwrap());
        let mut action = registry.action("painter", &Options::new()).unwrap();
        action.manage(&shape).unwrap();
        action.set_option("mode", choice(&format!("set_option{end}"))).unwrap();
        assert!(action.set_option("mode", choice("nothing")).unwrap_err().to_string().contains("panicked"));
        let mut action = registry.action("painter", &mode(&format!("unmanage{end}"))).unwrap();
        action.manage(&shape).unwrap();
        assert!(action.unmanage(&shape).unwrap_err().to_string().contains("panicked"));
    }
    assert_eq!(draw(&registry, &Options::new(), &shape).unwrap().pixel(4, 3)[3], 1.0);
}

#[test]
fn geometry_is_cut_by_its_maker() {
    let registry = registry();
    let make = |height: f64, word: &str| {
        registry
            .geometry("pyramid", &ParameterMap::from([("height".into(), height.into()), ("mode".into(), choice(word))]))
    };
    let pyramid = make(3.0, "nothing").unwrap();
    let cut = pyramid.tessellate().unwrap();
    let total: f64 = (0..cut.tetrahedra.len()).map(|t| cut.volume(t)).sum();
    assert!((total - 1.0).abs() < 1e-12, "a third of height times base");
    assert_eq!((pyramid.vertex_count(), pyramid.bounds().max), (Some(5), DVec3::new(1.0, 1.0, 3.0)));
    let words = make(-1.0, "nothing").unwrap_err().to_string();
    let wanted = "plugin \"menagerie\": geometry \"pyramid\": height is -1, wanted a positive number [bad value]";
    assert_eq!(words, wanted);
    for (word, wanted) in
        [("damaged", "mode is damaged"), ("tessellate", "in tessellate [panicked]"), ("tessellate-bomb", "[panicked]")]
    {
        let words = make(1.0, word).unwrap().tessellate().unwrap_err().to_string();
        assert!(words.contains(wanted), "{words}");
    }
    for word in ["make", "make-bomb", "bounds", "bounds-bomb"] {
        assert!(make(1.0, word).unwrap_err().to_string().contains("[panicked]"), "{word}");
    }
}

/// A plugin that panics while it registers what it has; in a process of its own, which is this test
/// again, since that is told by the environment.
#[test]
fn panic_while_registering_is_an_error() {
    if let Ok(wanted) = std::env::var("WANTED") {
        let mut registry = Registry::with_core();
        let before = format!("{registry:?}");
        let error = common::load(common::rust_plugin(), "menagerie", &mut registry).unwrap_err();
        assert_eq!((error.code, error.message), (Code::Panicked, wanted));
        assert_eq!(format!("{registry:?}"), before);
        return;
    }
    for (mode, wanted) in [("register", "it panicked: in register"), ("register-bomb", "it panicked")] {
        let mut command = std::process::Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "panic_while_registering_is_an_error"]);
        let output = command.env("MENAGERIE", mode).env("WANTED", wanted).output().unwrap();
        assert!(output.status.success(), "{mode}: {}", String::from_utf8_lossy(&output.stdout));
        assert!(String::from_utf8_lossy(&output.stdout).contains("1 passed"));
    }
}

/// The crate that the other tests build and load is refused by the compiler where panics abort.
#[test]
fn a_crate_whose_panics_abort_does_not_compile() {
    common::rust_plugin();
    let mut command = std::process::Command::new(env!("CARGO"));
    command.args(["check", "--offline", "--quiet", "--config", "profile.dev.panic='abort'", "--manifest-path"]);
    command.arg(common::root().join("tests/plugins/rust/Cargo.toml"));
    command.arg("--target-dir").arg(Path::new(env!("CARGO_TARGET_TMPDIR")).join("plugins"));
    let output = command.env_remove("RUSTFLAGS").env_remove("CARGO_TARGET_DIR").output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{said}");
    let wanted = "error: a Volact plugin cannot be built with panic = \"abort\": a panic would end its host";
    assert!(said.contains(wanted) && said.contains("src/lib.rs"), "{said}");
}

fn file(folder: &Path, content: &str) -> std::path::PathBuf {
    let path = folder.join("file");
    fs::write(&path, content).unwrap();
    path
}

#[test]
fn loaders_of_volumes_and_meshes_come_through() {
    let registry = registry();
    let folder = tempfile::tempdir().unwrap();
    let volume = registry.load(file(folder.path(), "GRID")).unwrap();
    assert_eq!((volume.dims(), volume.desc().unit.as_str(), volume.value([3, 2, 1], 0)), ([4, 3, 2], "steps", 123.0));
    assert_eq!(volume.desc().spacing, DVec3::new(1.0, 2.0, 3.0));
    let mesh = registry.load_mesh(file(folder.path(), "WEDGE")).unwrap();
    assert_eq!((mesh.name.as_str(), mesh.geometry.name(), mesh.warnings.len()), ("wedge", "mesh", 1));
    assert_eq!(mesh.attribute("heat").unwrap().range(0), Some([1.0, 4.0]));
    assert!((mesh.geometry.tessellate().unwrap().volume(0) - 1.0 / 6.0).abs() < 1e-15);
}

#[test]
fn loaders_that_fail_or_panic_are_errors() {
    let registry = registry();
    let folder = tempfile::tempdir().unwrap();
    let cause = |error: LoadError| std::error::Error::source(&error).unwrap().to_string();
    for place in ["open", "read", "warnings"] {
        let error = registry.load(file(folder.path(), &format!("GRID {place}"))).unwrap_err();
        assert_eq!(cause(error), format!("plugin \"menagerie\": it panicked: in {place} [panicked]"));
        let error = registry.load(file(folder.path(), &format!("GRID {place}-bomb"))).unwrap_err();
        assert_eq!(cause(error), "plugin \"menagerie\": it panicked [panicked]");
    }
    assert!(registry.load(file(folder.path(), "GRID close")).is_ok(), "a reader that panics as it goes");
    assert!(registry.load(file(folder.path(), "GRID close-bomb")).is_ok());
    for mode in ["release", "release-bomb"] {
        let volume = registry.load(file(folder.path(), &format!("GRID {mode}"))).unwrap();
        assert_eq!(volume.value([3, 2, 1], 0), 123.0);
        drop(volume);
    }
    for mode in ["probe", "probe-bomb"] {
        let error = registry.load(file(folder.path(), &format!("GRID {mode}"))).unwrap_err();
        assert!(matches!(error, LoadError::UnknownFormat { .. }), "{error}");
        // Loaders after the one that panicked are asked.
        let mesh = registry.load_mesh(file(folder.path(), &format!("WEDGE {mode}"))).unwrap();
        assert_eq!(mesh.name, "wedge");
    }
    let error = cause(registry.load(file(folder.path(), "GRID invalid")).unwrap_err());
    assert!(error.contains("mode is invalid, wanted another [bad value]"), "{error}");
    let error = cause(registry.load_mesh(file(folder.path(), "WEDGE read_mesh")).unwrap_err());
    assert_eq!(error, "plugin \"menagerie\": it panicked: in read_mesh [panicked]");
    let error = cause(registry.load_mesh(file(folder.path(), "WEDGE read_mesh-bomb")).unwrap_err());
    assert_eq!(error, "plugin \"menagerie\": it panicked [panicked]");
    assert!(registry.load_mesh(file(folder.path(), "WEDGE")).is_ok(), "the host goes on");
}

#[test]
fn shader_comes_with_its_source() {
    let registry = registry();
    assert_eq!(registry.shaders().get("glow").unwrap().compositing, Compositing::Maximum);
    assert!(registry.shader_source("glow").unwrap().contains("fn shade(s: Sample)"));
}

static LINES: Mutex<Vec<String>> = Mutex::new(Vec::new());

struct Keep;

impl log::Log for Keep {
    fn enabled(&self, _: &log::Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &log::Record<'_>) {
        LINES.lock().unwrap().push(format!("{} {}: {}", record.level(), record.target(), record.args()));
    }

    fn flush(&self) {}
}

#[test]
fn the_plugins_log_is_the_hosts() {
    log::set_logger(&Keep).unwrap();
    log::set_max_level(log::LevelFilter::Debug);
    draw(&registry(), &Options::new(), &shape(&volume())).unwrap();
    let lines = LINES.lock().unwrap();
    assert!(lines.iter().any(|l| l == "INFO menagerie::action: a frame of 8 × 6"), "{lines:?}");
}
