//! What is built in behaves the same behind the plugin boundary; pictures survive plugins.

#[path = "../../plugin/tests/common/mod.rs"]
mod common;

use std::{fs, path::Path};

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
    // SAFETY: both entries are made by the macro.
    let loaded = unsafe {
        [host::link(volact_cpu::volact_plugin, &mut registry), host::link(volact_files::volact_plugin, &mut registry)]
    };
    let [cpu, files] = loaded.map(Result::unwrap);
    assert_eq!((cpu.name.as_str(), cpu.registered.len()), ("volact_cpu", 2));
    assert_eq!((files.name.as_str(), files.registered.len()), ("volact_files", volact_files::loaders().len()));
    registry
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
    let (direct, behind) = (Registry::with_builtins(), linked());
    for action in ["cpu", "reference"] {
        let wanted = draw(&direct, action, shapes, desc).unwrap();
        let found = draw(&behind, action, shapes, desc).unwrap();
        assert!(bits(&wanted) == bits(&found), "{name}, {action}: another picture");
        assert!(wanted.color.iter().any(|c| c[3] > 0.0), "{name}, {action}: an empty picture");
        assert_eq!((&wanted.method, wanted.background), (&found.method, found.background), "{name}, {action}");
        assert_eq!(wanted.warnings, found.warnings, "{name}, {action}");
        let counts = |f: &Frame| (f.statistics.rays, f.statistics.samples, f.statistics.skipped, f.statistics.threads);
        assert_eq!(counts(&wanted), counts(&found), "{name}, {action}");
    }
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
    let (direct, behind) = (Registry::with_builtins(), linked());
    let shape = block();
    let desc = FrameDesc::fit(&shape, View::Front, 16, 12);
    let mut actions = [&direct, &behind].map(|registry| registry.action("cpu", &Options::new()).unwrap());
    let frames = |actions: &mut [Box<dyn RenderAction>; 2]| {
        let [wanted, found] = actions.each_mut().map(|action| {
            action.begin_draw(&desc).unwrap();
            action.draw(&shape).unwrap();
            action.end_draw().unwrap()
        });
        assert!(bits(&wanted) == bits(&found));
        // Nothing is prepared anew that is not without the boundary.
        assert_eq!(wanted.statistics.rebuilt, found.statistics.rebuilt);
        wanted.statistics.rebuilt.len()
    };
    actions.iter_mut().for_each(|action| action.manage(&shape).unwrap());
    assert!(frames(&mut actions) > 0);
    assert_eq!(frames(&mut actions), 0);
    shape.set_parameter("lookup_table", LookupTable::window_level(200.0, 100.0, 0.4).unwrap());
    frames(&mut actions);
    shape.set_transform(DAffine3::from_rotation_z(0.3));
    frames(&mut actions);
    shape.set_geometry(Block::new(DVec3::ONE, DVec3::splat(2.5)).unwrap());
    frames(&mut actions);
    shape.state().volume().unwrap().volume().touch();
    assert!(frames(&mut actions) > 0);
    shape.set_shader("mip");
    frames(&mut actions);
}

#[test]
fn refusals_have_the_same_words() {
    let (direct, behind) = (Registry::with_builtins(), linked());
    let shape = Shape::around(&volume(), Appearance::new("surface"));
    let desc = FrameDesc::fit(&block(), View::Front, 4, 4);
    let [wanted, found] = [&direct, &behind].map(|registry| {
        let error = draw(registry, "cpu", std::slice::from_ref(&shape), &desc).unwrap_err();
        let mut words = error.to_string();
        let mut cause = std::error::Error::source(&error);
        while let Some(inner) = cause {
            words = format!("{words}: {inner}");
            cause = inner.source();
        }
        words
    });
    assert!(found.contains(&wanted), "{found}, wanted {wanted}");
    for registry in [&direct, &behind] {
        let options = Options::from([("thread".into(), 2i64.into())]);
        let words = registry.action("cpu", &options).err().unwrap().to_string();
        assert!(words.contains("did you mean \"threads\"?"), "{words}");
    }
    let declarations = |registry: &Registry| format!("{:?}", registry.declarations());
    assert_eq!(declarations(&direct), declarations(&behind));
}

#[test]
fn example_files_load_the_same() {
    let (direct, behind) = (Registry::with_builtins(), linked());
    let examples = common::root().join("examples");
    for name in ["head/head.nrrd", "part/part.nrrd", "signal/signal.nrrd"] {
        let [wanted, found] = [&direct, &behind].map(|registry| registry.load(examples.join(name)).unwrap());
        assert_eq!(wanted.desc(), found.desc(), "{name}");
        assert!(wanted.data().bytes() == found.data().bytes(), "{name}");
    }
    let fixtures = common::root().join("plugins/files/tests/fixtures");
    for name in ["mixed_raw_none_le_h64_i32.vtu", "curved_raw_none_le_h64_i32.vts", "surface_le.ply", "blanked.vts"] {
        let [wanted, found] = [&direct, &behind].map(|registry| registry.load_mesh(fixtures.join(name)).unwrap());
        assert_eq!((&wanted.name, wanted.geometry.name()), (&found.name, found.geometry.name()), "{name}");
        assert_eq!(wanted.geometry.bounds(), found.geometry.bounds(), "{name}");
        assert_eq!(wanted.geometry.tessellate().ok(), found.geometry.tessellate().ok(), "{name}");
        let numbers = |mesh: &volact::MeshData| {
            mesh.attributes
                .iter()
                .map(|a| (a.name.clone(), a.scalar, a.components, a.data.bytes().to_vec()))
                .collect::<Vec<_>>()
        };
        assert_eq!(numbers(&wanted), numbers(&found), "{name}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.nrrd");
    fs::write(&path, "NRRD0004\ntype: nonsense\n\n").unwrap();
    let [wanted, found] = [&direct, &behind].map(|registry| registry.load(&path).unwrap_err());
    let cause = std::error::Error::source(&found).unwrap().to_string();
    assert!(cause.contains(&wanted.to_string()), "{cause}, wanted {wanted}");
}

#[test]
fn a_scene_is_the_same_through_loaders_and_action() {
    let path = common::root().join("examples/part/scene.ron");
    let draw_scene = |registry: &Registry| {
        let mut file = SceneFile::open(&path, registry).unwrap();
        file.image.size = Some([48, 36]);
        let folders = Folders { base: path.parent().unwrap(), data: None };
        let scene = file.build(registry, folders, &NoProgress).unwrap();
        bits(&draw(registry, "cpu", &scene.shapes, &scene.frame).unwrap())
    };
    assert!(draw_scene(&Registry::with_builtins()) == draw_scene(&linked()));
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
