//! What is built in behaves the same behind the plugin boundary; pictures survive plugins.

#[path = "../../plugin/tests/common/mod.rs"]
mod common;
#[path = "../../plugin/tests/common/library.rs"]
mod library;

use std::{
    fs,
    path::Path,
    sync::{Mutex, OnceLock},
    time::Duration,
};

use volact::{
    Attribute, Clip, ClipRegion, ControlPoint, Frame, FrameDesc, Opaque, OpaqueDepth, Plane, SliceStyle, Sliced,
    Slices,
    core::{
        geometry::{CellType, CellTypes},
        loader::NoProgress,
        plugin::host,
        scene::{Folders, SceneFile},
    },
    prelude::*,
};

/// Everything built in, behind the boundary.
#[expect(unsafe_code, reason = "links plugins through their entries")]
fn linked() -> Registry {
    let mut registry = Registry::with_core();
    let entries = [
        volact_cpu_plugin::volact_plugin,
        volact_files_plugin::volact_plugin,
        volact_wgpu_plugin::volact_plugin,
        volact_vulkan_plugin::volact_plugin,
    ];
    // SAFETY: all entries are made by the macro.
    let loaded = entries.map(|entry| unsafe { host::link(entry, &mut registry) });
    let [cpu, files, wgpu, vulkan] = loaded.map(Result::unwrap);
    assert_eq!((cpu.name.as_str(), cpu.registered.len()), ("volact_cpu_plugin", 2));
    assert_eq!((files.name.as_str(), files.registered.len()), ("volact_files_plugin", volact_files::loaders().len()));
    assert_eq!((wgpu.name.as_str(), wgpu.registered.len()), ("volact_wgpu_plugin", 1));
    assert_eq!((vulkan.name.as_str(), vulkan.registered.len()), ("volact_vulkan_plugin", 1));
    registry
}

/// The same of libraries that are loaded.
fn loaded() -> Registry {
    let mut registry = Registry::with_core();
    ["volact-cpu-plugin", "volact-files-plugin", "volact-wgpu-plugin", "volact-vulkan-plugin"]
        .iter()
        .for_each(|package| library::load_library(package, &mut registry));
    registry
}

/// Both ways behind the boundary, with the shaders that come with Volact as sources.
fn behind() -> &'static [(&'static str, Registry); 2] {
    static BOTH: OnceLock<[(&str, Registry); 2]> = OnceLock::new();
    BOTH.get_or_init(|| {
        let mut both = [("linked", linked()), ("loaded", loaded())];
        both.iter_mut().for_each(|(_, registry)| volact::shaders::add_builtin(registry).unwrap());
        both
    })
}

fn draw(registry: &Registry, action: &str, shapes: &[Shape], desc: &FrameDesc) -> Result<Frame, ActionError> {
    let mut action = registry.action(action, &Options::from([("threads".into(), 2i64.into())]))?;
    shapes.iter().try_for_each(|shape| action.manage(shape))?;
    action.begin_draw(desc)?;
    shapes.iter().try_for_each(|shape| action.draw(shape))?;
    action.end_draw()
}

fn bits(frame: &Frame) -> (Vec<u32>, Vec<u32>) {
    let color = frame.color.iter().flatten().map(|v| v.to_bits()).collect();
    (color, frame.depth.iter().map(|v| v.to_bits()).collect())
}

fn same(name: &str, shapes: &[Shape], desc: &FrameDesc) {
    let direct = Registry::with_builtins();
    for action in ["cpu", "reference"] {
        let wanted = draw(&direct, action, shapes, desc).unwrap();
        assert!(wanted.color.iter().any(|c| c[3] > 0.0), "{name}, {action}: an empty picture");
        for (way, registry) in behind() {
            let found = draw(registry, action, shapes, desc).unwrap();
            assert_same(&format!("{name}, {action}, {way}"), &wanted, &found);
        }
    }
}

/// Everything but times is the same.
fn assert_same(name: &str, wanted: &Frame, found: &Frame) {
    assert!(bits(wanted) == bits(found), "{name}: another picture");
    assert_eq!((&wanted.method, wanted.background), (&found.method, found.background), "{name}");
    assert_eq!(wanted.warnings, found.warnings, "{name}");
    let timeless = |frame: &Frame| {
        let zero = Duration::ZERO;
        volact::Statistics { total: zero, prepare: zero, render: zero, ..frame.statistics.clone() }
    };
    assert_eq!(timeless(wanted), timeless(found), "{name}");
    let [wanted, found] = [wanted, found].map(|f| [f.statistics.total, f.statistics.render]);
    assert_eq!(wanted.map(|t| t > Duration::ZERO), found.map(|t| t > Duration::ZERO), "{name}");
}

fn table() -> LookupTable {
    let point = |value, grey: f64, opacity| ControlPoint { value, color: [grey, 1.0 - grey, 0.3], opacity };
    LookupTable::from_points([point(20.0, 0.0, 0.0), point(120.0, 0.6, 0.2), point(250.0, 1.0, 0.7)]).unwrap()
}

fn volume() -> Volume {
    let mut desc = VolumeDesc::new([9, 8, 7], ScalarType::U8, 1);
    desc.spacing = DVec3::new(0.7, 0.9, 1.3);
    let values: Vec<u8> = (0..9 * 8 * 7).map(|i: usize| (i * 37 % 251) as u8).collect();
    Volume::new(desc, values).unwrap()
}

fn block() -> Shape {
    Shape::around(&volume(), Appearance::new("lut").with("lookup_table", table()))
}

#[test]
fn blocks_are_the_same() {
    let shape = block();
    let desc = FrameDesc::fit(&shape, View::Iso, 24, 20);
    same("table", std::slice::from_ref(&shape), &desc);
    let mip = Shape::around(&volume(), Appearance::new("mip"));
    same("two shapes", &[shape.clone(), mip], &desc);
    let plane = Plane::new(DVec3::new(2.0, 2.1, 2.2), DVec3::new(0.3, -1.0, 0.4)).unwrap();
    shape.set_clip(Clip::new([ClipRegion::plane(plane)]));
    shape.set_transform(DAffine3::from_rotation_z(0.4));
    let opaque = Opaque {
        color: Some(vec![[0.1, 0.2, 0.3, 1.0]; 480].into()),
        depth: OpaqueDepth::Distance(vec![25.0; 480].into()),
    };
    let clip = Clip::new([ClipRegion::plane(Plane::new(DVec3::ONE, DVec3::X).unwrap()).cut()]);
    same("clipped", &[shape], &desc.with_clip(clip).with_opaque(opaque));
}

#[test]
fn meshes_surfaces_and_slices_are_the_same() {
    let points: Vec<DVec3> = block().state().geometry.tessellate().unwrap().vertices.iter().collect();
    let cells: Vec<u32> = block().state().geometry.tessellate().unwrap().tetrahedra.concat();
    let mesh = volact::Mesh::new(points.into(), CellTypes::All(CellType::Tetrahedron), cells.into()).unwrap();
    let heat =
        Attribute::new("heat", ScalarType::F32, 1, vec![10f32, 60.0, 110.0, 160.0, 210.0, 30.0, 90.0, 240.0].into());
    let look = Appearance::new("attribute")
        .with("scalars", heat.unwrap())
        .with("lookup_table", table())
        .with("unit_distance", 1.5);
    let shape = Shape::new(mesh, look);
    let desc = FrameDesc::fit(&shape, View::Iso, 20, 16);
    same("mesh", &[shape], &desc);

    let registry = Registry::with_builtins();
    let ball = [
        ("center".to_owned(), DVec3::new(3.0, 3.0, 4.0).into()),
        ("radius".to_owned(), 2.5.into()),
        ("segments".to_owned(), 8i64.into()),
    ];
    let ball = registry.geometry("sphere", &ball.into()).unwrap();
    let look = Appearance::new("lut").with("lookup_table", table()).with("volume", &volume());
    same("ball", &[Shape::build("ball", ball, look.clone(), DAffine3::IDENTITY)], &desc);

    let plane = Plane::new(DVec3::new(2.0, 3.0, 3.1), DVec3::new(0.2, 1.0, 0.3)).unwrap();
    let slices = Slices { planes: vec![plane], style: SliceStyle::Blended, volume: true };
    let sliced = Sliced::new(block().state().geometry, slices).unwrap();
    same("slices", &[Shape::build("cut", std::sync::Arc::new(sliced), look, DAffine3::IDENTITY)], &desc);
}

#[test]
fn one_action_follows_changes_from_frame_to_frame() {
    let direct = Registry::with_builtins();
    for (way, behind) in behind() {
        let shape = block();
        let other = Shape::around(&volume(), Appearance::new("gradient").with("lookup_table", table()));
        let desc = FrameDesc::fit(&shape, View::Front, 16, 12);
        let mut actions = [&direct, behind].map(|registry| registry.action("cpu", &Options::new()).unwrap());
        let frames = |actions: &mut [Box<dyn RenderAction>; 2], shapes: &[&Shape]| {
            let [wanted, found] = actions.each_mut().map(|action| {
                action.begin_draw(&desc).unwrap();
                shapes.iter().for_each(|shape| action.draw(shape).unwrap());
                action.end_draw().unwrap()
            });
            // Nothing is prepared anew that is not without the boundary.
            assert_same(way, &wanted, &found);
            wanted.statistics.rebuilt.len()
        };
        actions.iter_mut().for_each(|action| action.manage(&shape).unwrap());
        assert!(frames(&mut actions, &[&shape]) > 0);
        assert_eq!(frames(&mut actions, &[&shape]), 0);
        shape.set_parameter("lookup_table", LookupTable::window_level(200.0, 100.0, 0.4).unwrap());
        frames(&mut actions, &[&shape]);
        shape.set_transform(DAffine3::from_rotation_z(0.3));
        frames(&mut actions, &[&shape]);
        shape.set_geometry(Block::new(DVec3::ONE, DVec3::splat(2.5)).unwrap());
        frames(&mut actions, &[&shape]);
        shape.state().volume().unwrap().volume().touch();
        assert!(frames(&mut actions, &[&shape]) > 0);
        shape.set_shader("mip");
        frames(&mut actions, &[&shape]);
        actions.iter_mut().for_each(|action| action.manage(&other).unwrap());
        frames(&mut actions, &[&shape, &other]);
        actions.iter_mut().for_each(|action| action.set_option("skipping", false.into()).unwrap());
        frames(&mut actions, &[&other, &shape]);
        actions.iter_mut().for_each(|action| action.unmanage(&shape).unwrap());
        frames(&mut actions, &[&other]);
        let caps = actions.each_ref().map(|action| action.caps());
        assert_eq!(caps[0], caps[1], "{way}");
    }
}

/// Where there is no GPU and no software for one, the errors have the same words.
#[test]
fn pictures_of_gpus_are_the_same() {
    let direct = Registry::with_builtins();
    let shape = block();
    let desc = FrameDesc::fit(&shape, View::Iso, 24, 20);
    for action in ["wgpu", "vulkan"] {
        let drawn = |registry: &Registry| -> Result<Frame, ActionError> {
            let mut action = registry.action(action, &Options::new())?;
            action.manage(&shape)?;
            action.begin_draw(&desc)?;
            action.draw(&shape)?;
            action.end_draw()
        };
        let wanted = drawn(&direct).map_err(|e| said(&e));
        for (way, registry) in behind() {
            match (&wanted, drawn(registry).map_err(|e| said(&e))) {
                (Ok(wanted), Ok(found)) => {
                    assert!(bits(wanted) == bits(&found), "{action}, {way}: another picture");
                    assert_eq!((&wanted.method, &wanted.warnings), (&found.method, &found.warnings), "{action}, {way}");
                    assert!(wanted.color.iter().any(|c| c[3] > 0.0), "{action}: an empty picture");
                }
                (wanted, found) => {
                    assert_eq!(wanted.as_ref().err(), found.as_ref().err(), "{action}, {way}");
                    println!("skipped {action}: {found:?}");
                }
            }
        }
    }
}

/// What an error says; of one that came across the boundary, what the plugin said.
fn said(error: &ActionError) -> String {
    match error {
        ActionError::Plugin(inside) => inside.message.clone(),
        other => library::words(other),
    }
}

#[test]
fn refusals_have_the_same_words() {
    let direct = Registry::with_builtins();
    let desc = FrameDesc::fit(&block(), View::Front, 4, 4);
    let broken = |source: &str| {
        let mut registry = Registry::with_builtins();
        let declaration = registry.shaders().get("simple").unwrap().declaration.clone();
        let declaration = volact::Declaration { name: "broken".into(), ..declaration };
        let entry = volact::ShaderEntry { declaration, compositing: volact::Compositing::Over, source: None };
        registry.add_shader_source(entry.clone(), source).unwrap();
        (entry, source.to_owned(), registry)
    };
    let wrong = [
        Shape::around(&volume(), Appearance::new("surface")),
        Shape::around(&volume(), Appearance::new("lut")),
        Shape::around(&volume(), Appearance::new("lutt")),
        Shape::new(
            volact::Surface::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y].into(), vec![0u32, 1, 2].into()).unwrap(),
            Appearance::new("simple").with("volume", &volume()),
        ),
    ];
    for (way, behind) in behind() {
        for shape in &wrong {
            for action in ["cpu", "reference"] {
                let [wanted, found] =
                    [&direct, behind].map(|registry| draw(registry, action, std::slice::from_ref(shape), &desc));
                let [wanted, found] = [wanted, found].map(|drawn| drawn.map(|_| ()).map_err(|e| said(&e)));
                assert_eq!(wanted, found, "{way}, {action}, {:?}", shape.state().shader);
                assert!(wanted.is_err(), "{action} draws {:?}", shape.state().shader);
            }
        }
        for options in [("thread", 2i64), ("threads", -1)] {
            let options = Options::from([(options.0.into(), options.1.into())]);
            let words = |registry: &Registry| said(&registry.action("cpu", &options).err().unwrap());
            assert_eq!(words(&direct), words(behind), "{way}");
        }
        for change in [("thread", 2i64), ("threads", -1)] {
            let words = |registry: &Registry| {
                let mut action = registry.action("cpu", &Options::new()).unwrap();
                said(&action.set_option(change.0, change.1.into()).unwrap_err())
            };
            assert_eq!(words(&direct), words(behind), "{way}");
        }
        assert_eq!(format!("{:?}", direct.declarations()), format!("{:?}", behind.declarations()), "{way}");
        // A shader's mistake is shown at the author's file, line and caret.
        let (entry, source, with_broken) = broken("fn shade(s: Sample) -> Medium {\n    return nobody(s);\n}\n");
        let mut behind = behind.clone();
        behind.add_shader_source(entry, source).unwrap();
        let shape = Shape::around(&volume(), Appearance::new("broken"));
        let words =
            [&with_broken, &behind].map(|r| said(&draw(r, "cpu", std::slice::from_ref(&shape), &desc).unwrap_err()));
        assert!(words[0] == words[1] && words[0].contains("broken.wgsl:2"), "{way}: {words:?}");
    }
}

/// What long preparations say of how far they are, and what the application's handler hears.
#[test]
fn progress_and_warnings_are_heard() {
    static HEARD: Mutex<Vec<(String, u64, u64)>> = Mutex::new(Vec::new());
    static WARNED: Mutex<Vec<String>> = Mutex::new(Vec::new());
    let hear = |warning: &volact::Warning| {
        if warning.subject == "heard" {
            WARNED.lock().unwrap().push(warning.to_string());
        }
    };
    volact::core::warning::set_handler(Some(Box::new(hear)));
    let ball = [
        ("center".to_owned(), DVec3::new(3.0, 3.0, 4.0).into()),
        ("radius".to_owned(), 2.5.into()),
        ("segments".to_owned(), 48i64.into()),
    ];
    let ball = Registry::with_builtins().geometry("sphere", &ball.into()).unwrap();
    let look = Appearance::new("lut").with("lookup_table", table()).with("volume", &volume()).with("shininess", 3.0);
    let shape = Shape::build("heard", ball, look, DAffine3::IDENTITY);
    let desc = FrameDesc::fit(&shape, View::Front, 8, 8);
    let mut all = Vec::new();
    for mut registry in [Registry::with_builtins(), behind()[0].1.clone(), behind()[1].1.clone()] {
        HEARD.lock().unwrap().clear();
        WARNED.lock().unwrap().clear();
        registry.set_progress(volact::core::action::Watch::new(|what, done, total| {
            HEARD.lock().unwrap().push((what.to_owned(), done, total));
        }));
        let mut action = registry.action("cpu", &Options::new()).unwrap();
        action.manage(&shape).unwrap();
        for _ in 0..2 {
            action.begin_draw(&desc).unwrap();
            action.draw(&shape).unwrap();
            action.end_draw().unwrap();
        }
        all.push((HEARD.lock().unwrap().clone(), WARNED.lock().unwrap().clone()));
    }
    volact::core::warning::set_handler(None);
    assert!(!all[0].0.is_empty() && !all[0].1.is_empty(), "{all:?}");
    assert!(all[0] == all[1] && all[0] == all[2], "{all:?}");
}

#[test]
fn example_files_load_the_same() {
    let direct = Registry::with_builtins();
    let examples = common::root().join("examples");
    for (way, behind) in behind() {
        for name in ["head/head.nrrd", "part/part.nrrd", "signal/signal.nrrd"] {
            let [wanted, found] = [&direct, behind].map(|registry| registry.load(examples.join(name)).unwrap());
            assert_eq!(wanted.desc(), found.desc(), "{name}, {way}");
            assert!(wanted.data().bytes() == found.data().bytes(), "{name}, {way}");
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bad.nrrd");
        fs::write(&path, "NRRD0004\ntype: nonsense\n\n").unwrap();
        let [wanted, found] = [&direct, behind].map(|registry| registry.load(&path).unwrap_err());
        let cause = std::error::Error::source(&found).unwrap().to_string();
        assert!(cause.contains(&wanted.to_string()), "{cause}, wanted {wanted}");
    }
}

#[test]
fn scenes_are_the_same_through_loaders_and_action() {
    for name in ["part", "spring", "bent", "carved"] {
        let path = common::root().join("examples").join(name).join("scene.ron");
        let draw_scene = |registry: &Registry| {
            let mut file = SceneFile::open(&path, registry).unwrap();
            file.image.size = Some([48, 36]);
            let folders = Folders { base: path.parent().unwrap(), data: None };
            let scene = file.build(registry, folders, &NoProgress).unwrap();
            draw(registry, "cpu", &scene.shapes, &scene.frame).unwrap()
        };
        let wanted = draw_scene(&Registry::with_builtins());
        behind()
            .iter()
            .for_each(|(way, registry)| assert_same(&format!("{name}, {way}"), &wanted, &draw_scene(registry)));
    }
}

fn tiny(folder: &Path) -> Frame {
    let mut registry = Registry::with_builtins();
    common::load(folder, "kit", &mut registry).unwrap();
    let shape = block();
    // Opacities so small that products with them are denormal.
    let faint = LookupTable::window_level(250.0, 125.0, 1e-37).unwrap();
    shape.set_parameter("lookup_table", faint);
    draw(&registry, "cpu", std::slice::from_ref(&shape), &FrameDesc::fit(&shape, View::Front, 24, 20)).unwrap()
}

#[test]
fn pictures_after_a_fast_math_plugin_are_the_same() {
    let folders = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    common::c_plugin(folders[0].path(), "kit.c", "kit", &[]);
    common::c_plugin(folders[1].path(), "kit.c", "kit", &["-ffast-math"]);
    let [wanted, found] = folders.map(|folder| tiny(folder.path()));
    assert!(bits(&wanted) == bits(&found));
    let denormal = |v: &f32| *v != 0.0 && v.abs() < f32::MIN_POSITIVE;
    assert!(wanted.color.iter().flatten().any(denormal), "the picture has nothing that flushing would change");
}
