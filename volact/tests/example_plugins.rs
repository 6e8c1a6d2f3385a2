//! The plugins of `examples/plugins` build alone, load, and draw their pictures.

#[path = "../../plugin/tests/common/alone.rs"]
mod alone;
#[path = "../../plugin/tests/common/mod.rs"]
mod common;

use std::{
    fs,
    path::{Path, PathBuf},
};

use volact::{
    Frame, Options, Registry, RegistryExt as _,
    core::{loader::NoProgress, parameter::Kind, plugin::host::Loaded, scene::Scene},
    metrics::{self, Image},
};
use volact_files::picture::load_picture;

fn example(name: &str) -> PathBuf {
    common::root().join("examples/plugins").join(name)
}

fn load(folder: &Path, name: &str) -> (Registry, Loaded) {
    let mut registry = Registry::with_builtins();
    let loaded = common::load(folder, name, &mut registry).unwrap();
    (registry, loaded)
}

fn draw(scene: &Scene, action: &str, options: &Options, registry: &Registry) -> Frame {
    let mut action = registry.action(action, options).unwrap();
    scene.shapes.iter().for_each(|shape| action.manage(shape).unwrap());
    action.begin_draw(&scene.frame).unwrap();
    scene.shapes.iter().for_each(|shape| action.draw(shape).unwrap());
    action.end_draw().unwrap()
}

/// The largest difference of a frame over its background from a picture of its size.
fn difference(frame: &Frame, other: &[[f32; 4]]) -> f64 {
    let image = |rgba| Image { width: frame.width, height: frame.height, rgba };
    metrics::compare(&image(&frame.over_background()), &image(other)).unwrap().max
}

/// The stored picture is what `cpu` draws with a fine step, and `reference` agrees.
fn check(name: &str, registry: &Registry) {
    let mut scene = Scene::open_with(example(name).join("scene.ron"), None, registry, &NoProgress).unwrap();
    let unit = scene.shapes[0].state().parameters["unit_distance"].as_float().unwrap();
    let step = |part: f64| Options::from([("sample_distance".to_owned(), (unit / part).into())]);
    let stored = load_picture(&example(name).join("picture.png")).unwrap();
    let found = difference(&draw(&scene, "cpu", &step(16.0), registry), &stored.rgba);
    assert!(found < 1.01 / 255.0, "{name}: {found} from the stored picture");
    (scene.frame.width, scene.frame.height) = (24, 24);
    // Without light, which not every action draws.
    scene.shapes[0].set_shader("lut");
    let truth = draw(&scene, "reference", &Options::new(), registry).over_background();
    // The tables are sharp: a sixteenth is 0.022 away, this 0.003.
    let found = difference(&draw(&scene, "cpu", &step(64.0), registry), &truth);
    assert!(found < 0.01, "{name}: {found} from the reference");
    assert!(truth.iter().filter(|p| p[0] > 0.2).count() > 60, "{name} shows next to nothing");
}

/// A copy of the crate, so that it cannot lean on where it lies.
#[test]
fn rust_crate_outside_the_workspace_builds_alone_and_draws() {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("torus-knot");
    for file in ["Cargo.toml", "src/lib.rs", "tests/plugin.rs"] {
        let text = fs::read_to_string(example("torus_knot").join(file)).unwrap();
        let text = text.replace("../../../plugin", &alone::repository().join("plugin").display().to_string());
        fs::create_dir_all(copy.join(file).parent().unwrap()).unwrap();
        fs::write(copy.join(file), text).unwrap();
    }
    let said = alone::cargo(&copy, "test");
    assert!(said.contains("2 passed"), "{said}");
    alone::cargo(&copy, "build");
    let (registry, loaded) = load(&alone::target().join("debug"), "torus-knot");
    assert_eq!((loaded.registered[0].kind, loaded.registered[0].name.as_str()), (Kind::Geometry, "torus-knot"));
    check("torus_knot", &registry);
}

#[test]
fn c_example_builds_in_one_line_and_draws() {
    let folder = tempfile::tempdir().unwrap();
    let library = folder.path().join(volact_plugin::plugin::host::file_name("gyroid"));
    common::compile(&example("gyroid").join("gyroid.c"), &library, &["-std=c99", "-pedantic", "-Wno-unused-function"]);
    let (registry, loaded) = load(folder.path(), "gyroid");
    assert_eq!((loaded.registered[0].kind, loaded.registered[0].name.as_str()), (Kind::Loader, "gyroid"));
    let volume = registry.load(example("gyroid").join("three.gyroid")).unwrap();
    let value = |at: [usize; 3]| {
        let [x, y, z] = at.map(|n| std::f64::consts::TAU * 3.0 * n as f64 / 95.0);
        x.sin() * y.cos() + y.sin() * z.cos() + z.sin() * x.cos()
    };
    for at in [[0, 0, 0], [95, 95, 95], [10, 20, 30], [7, 80, 51]] {
        assert!((volume.value(at, 0) - value(at)).abs() < 1e-6, "{at:?}");
    }
    for (line, wanted) in
        [("GYROID 1 3", "2 to 2048 samples"), ("GYROID 9 0", "the periods"), ("GYROID", "the line is not")]
    {
        let path = folder.path().join("bad.gyroid");
        fs::write(&path, format!("{line} \n")).unwrap();
        let error = registry.load(&path).unwrap_err();
        assert!(std::error::Error::source(&error).unwrap().to_string().contains(wanted), "{line}: {error}");
    }
    check("gyroid", &registry);
}
