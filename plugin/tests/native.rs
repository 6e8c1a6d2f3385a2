//! A plugin in C with one of each kind, loaded and used like built-ins.

mod common;

use std::{
    fs,
    path::Path,
    sync::{
        OnceLock,
        atomic::{AtomicI64, Ordering},
    },
};

use volact_plugin::{
    ActionError, Appearance, Camera, Compositing, FrameDesc, LoadError, LoadOptions, Mesh, Options, ParameterValue,
    Registry, ScalarType, Severity, Shape, View, Volume, VolumeDesc, WarningCode,
    glam::{DAffine3, DVec3},
    loader::{NoProgress, Progress, Region},
    parameter::{Kind, ParameterMap},
};

fn folder() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER
        .get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            common::c_plugin(folder.path(), "kit.c", "kit", &["-std=c99"]);
            folder
        })
        .path()
}

fn registry() -> Registry {
    let mut registry = Registry::with_core();
    let loaded = common::load(folder(), "kit", &mut registry).unwrap();
    assert_eq!((loaded.name.as_str(), loaded.version.as_str()), ("kit", "1.0"));
    let names: Vec<_> = loaded.registered.iter().map(|r| (r.kind, r.name.as_str())).collect();
    let wanted = [(Kind::Action, "zmax"), (Kind::Shader, "tint"), (Kind::Geometry, "octa"), (Kind::Loader, "ramp")];
    assert_eq!(names, wanted);
    registry
}

/// Pieces of memory of the plugin that the host still has.
#[expect(unsafe_code, reason = "reads a counter of the library")]
fn live() -> i64 {
    let path = fs::canonicalize(folder().join(volact_plugin::plugin::host::file_name("kit"))).unwrap();
    // SAFETY: the library is loaded already, and the symbol is an integer that is written atomically.
    unsafe {
        let library = libloading::Library::new(path).unwrap();
        (**library.get::<*const AtomicI64>(b"kit_live").unwrap()).load(Ordering::SeqCst)
    }
}

const DIMS: [usize; 3] = [5, 4, 3];

fn value(x: usize, y: usize, z: usize) -> u8 {
    (7 * x + 31 * y + if z == 1 { 90 } else { 10 * z }) as u8
}

fn volume() -> Volume {
    let [nx, ny, nz] = DIMS;
    let at = |i: usize| value(i % nx, i / nx % ny, i / (nx * ny));
    Volume::new(VolumeDesc::new(DIMS, ScalarType::U8, 1), (0..nx * ny * nz).map(at).collect::<Vec<_>>()).unwrap()
}

/// One pixel for each voxel, seen from above, with a border of one pixel.
fn from_above() -> FrameDesc {
    let middle = DVec3::new(2.0, 1.5, 0.0);
    FrameDesc::new(Camera::orthographic(middle + DVec3::Z * 10.0, middle, DVec3::Y, 6.0), 7, 6)
}

#[test]
fn action_draws_the_maximum_along_z() {
    let registry = registry();
    let volume = volume();
    let shape = Shape::around(&volume, Appearance::new("mip"));
    let mut action = registry.action("zmax", &Options::new()).unwrap();
    assert_eq!(action.caps().compositing, [Compositing::Maximum]);
    assert_eq!(action.caps().shaders, Some(vec!["mip".into()]));
    assert_eq!((action.caps().geometries, action.caps().device.as_str()), (None, "a plugin in C"));
    action.manage(&shape).unwrap();
    for gain in [1.0, 0.5] {
        action.set_option("gain", ParameterValue::Float(gain)).unwrap();
        action.begin_draw(&from_above()).unwrap();
        action.draw(&shape).unwrap();
        let frame = action.end_draw().unwrap();
        for (y, x) in (0..6usize).flat_map(|y| (0..7usize).map(move |x| (y, x))) {
            // Columns to x and rows to −y, from a border of one pixel.
            let (grey, depth) = match x.checked_sub(1).zip(4usize.checked_sub(y)) {
                Some((i, j)) if i < 5 && j < 4 => {
                    (gain as f32 * f32::from((0..3).map(|k| value(i, j, k)).max().unwrap()) / 255.0, 8.0)
                }
                _ => (0.0, f32::INFINITY),
            };
            let alpha = if depth == 8.0 { 1.0 } else { 0.0 };
            let found = frame.pixel(x, y);
            assert!((found[0] - grey).abs() < 1e-6 && found[3] == alpha, "({x}, {y}): {found:?}, wanted {grey}");
            assert_eq!(frame.depth[y * 7 + x], depth, "({x}, {y})");
        }
        assert_eq!((frame.method.sampling.as_str(), frame.statistics.rays), ("voxel by voxel", 42));
        let note = frame.warnings.iter().find(|w| w.message == "seen along z").unwrap();
        assert_eq!((note.severity, note.code, note.subject.as_str()), (Severity::Note, WarningCode::Plugin, "volume"));
        // Neither voxels nor pixels were copied on their way.
        let said = |name: &str| frame.statistics.details.iter().find(|(n, _)| n == name).unwrap().1.clone();
        assert_eq!(said("voxels at"), format!("{:p}", volume.data().bytes().as_ptr()));
        assert_eq!(said("colour at"), format!("{:p}", frame.color.as_ptr()));
    }
    let other = Shape::around(&volume, Appearance::new("mip"));
    assert!(action.draw(&other).unwrap_err().to_string().contains("outside a frame"));
    action.unmanage(&shape).unwrap();
}

#[test]
fn action_refuses_what_it_cannot_draw_and_goes_on() {
    let registry = registry();
    let words = registry.action("zmax", &Options::from([("gain".into(), 9.0.into())])).err().unwrap().to_string();
    assert!(words.contains("gain") && words.contains("0 to 4"), "{words}");
    let mut action = registry.action("zmax", &Options::new()).unwrap();
    let ball = registry.geometry(
        "sphere",
        &ParameterMap::from([("center".into(), DVec3::ZERO.into()), ("radius".into(), 1.0.into())]),
    );
    let round =
        Shape::build("round", ball.unwrap(), Appearance::new("mip").with("volume", &volume()), DAffine3::IDENTITY);
    let error = action.manage(&round).unwrap_err();
    assert_eq!(error.to_string(), "plugin \"kit\": zmax draws blocks only [unsupported]");
    let shape = Shape::around(&volume(), Appearance::new("mip"));
    action.manage(&shape).unwrap();
    let error = action.begin_draw(&FrameDesc::fit(&shape, View::Top, 4, 4)).unwrap_err();
    assert!(matches!(&error, ActionError::Plugin(e) if e.message == "zmax draws parallel views only"), "{error}");
    action.begin_draw(&from_above()).unwrap();
    action.draw(&shape).unwrap();
    assert!(action.end_draw().unwrap().pixel(1, 4)[3] == 1.0);
}

#[test]
fn geometry_is_a_mesh_over_the_plugins_memory() {
    let registry = registry();
    let before = live();
    let octa = registry.geometry("octa", &ParameterMap::from([("radius".into(), 3.0.into())])).unwrap();
    assert_eq!((octa.name(), octa.vertex_count(), live()), ("octa", Some(6), before + 1));
    let mesh = octa.tessellate().unwrap();
    let total: f64 = (0..mesh.tetrahedra.len()).map(|t| mesh.volume(t)).sum();
    // The volume of an octahedron of radius r is 4/3 r³.
    assert!((total - 36.0).abs() < 1e-12, "{total}");
    let inner: &Mesh = octa.as_any().downcast_ref().unwrap();
    assert_eq!(mesh.vertices.data().bytes().as_ptr(), inner.points().data().bytes().as_ptr());
    drop(octa);
    assert_eq!(live(), before + 1, "the tessellation still uses the vertices");
    drop(mesh);
    assert_eq!(live(), before);
    let error = registry.geometry("octa", &ParameterMap::new()).unwrap_err();
    assert!(error.to_string().contains("\"radius\" is missing"), "{error}");
}

struct Stop;

impl Progress for Stop {
    fn advance(&self, _: u64, _: u64) -> bool {
        false
    }
}

#[test]
fn loader_reads_regions_without_a_copy() {
    let registry = registry();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("data.any");
    let bytes: Vec<u8> = (0..24).collect();
    fs::write(&path, [b"RAMP 4 3 2\n", &bytes[..]].concat()).unwrap();
    let volume = registry.load(&path).unwrap();
    assert_eq!((volume.dims(), volume.desc().unit.as_str(), volume.name()), ([4, 3, 2], "grey", "data.any"));
    assert_eq!((volume.data().bytes(), volume.desc().spacing), (&bytes[..], DVec3::new(1.0, 1.0, 2.0)));
    let loader = registry.loaders().iter().find(|l| l.declaration().name == "ramp").unwrap();
    let mut reader = loader.open(&path, &LoadOptions::new()).unwrap();
    assert_eq!(reader.warnings()[0].message, "has no units");
    let part = reader.read_region(Region { min: [1, 1, 0], max: [2, 2, 1] }, &NoProgress).unwrap();
    assert_eq!(part.bytes(), [5, 6, 9, 10, 17, 18, 21, 22]);
    let outside = Region { min: [0; 3], max: [4, 0, 0] };
    assert!(matches!(reader.read_region(outside, &NoProgress), Err(LoadError::Region { .. })));
    assert!(matches!(reader.read(&Stop), Err(LoadError::Stopped { .. })));
}

#[test]
fn loader_says_what_is_wrong_with_a_file() {
    let registry = registry();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad");
    for (content, wanted) in [
        ("RAMP x\n", "the header is not RAMP and three sizes up to 4096"),
        ("RAMP 4 4 4\nfew", "the file is not as long as its header says"),
    ] {
        fs::write(&path, content).unwrap();
        let error = registry.load(&path).unwrap_err();
        let cause = std::error::Error::source(&error).unwrap().to_string();
        assert_eq!(cause, format!("plugin \"kit\": {wanted} [bad value]"));
    }
}

#[test]
fn shader_is_declared_and_its_text_is_kept() {
    let registry = registry();
    let entry = registry.shaders().get("tint").unwrap();
    assert_eq!((entry.compositing, entry.declaration.parameters.len()), (Compositing::Over, 1));
    assert!(registry.shader_source("tint").unwrap().starts_with("fn shade(s: Sample)"));
    assert_eq!(registry.origin(Kind::Shader, "tint"), Some("kit"));
    assert_eq!(registry.origin(Kind::Shader, "lut"), None);
}

#[test]
fn loading_twice_gives_one_library() {
    let (first, second) = (registry(), registry());
    assert_eq!(first.declarations(), second.declarations());
}

/// The header's codes are checked when it is compiled, the rest by the plugin itself.
#[test]
fn codes_and_messages_are_what_c_callers_are_promised() {
    let folder = tempfile::tempdir().unwrap();
    common::c_plugin(folder.path(), "codes.c", "codes", &["-pthread"]);
    let mut registry = Registry::new();
    common::load(folder.path(), "codes", &mut registry).unwrap();
    assert_eq!(registry.geometry("codes", &ParameterMap::new()).unwrap().bounds().max, DVec3::ONE);
    // What is left before an error belongs to it; the other thread's message does not.
    let fails = ParameterMap::from([("fail".to_owned(), 1i64.into())]);
    let error = registry.geometry("codes", &fails).unwrap_err().to_string();
    assert_eq!(error, "plugin \"codes\": of this thread [bad state]");
}

/// The example of the documentation, as a reader would copy it.
#[test]
fn documented_plugin_compiles_and_loads() {
    let text = fs::read_to_string(common::root().join("docs/plugins.md")).unwrap();
    let code = text.split("```c\n").nth(1).unwrap().split("```").next().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("corner.c");
    fs::write(&source, code).unwrap();
    let library = folder.path().join(volact_plugin::plugin::host::file_name("corner"));
    common::compile(&source, &library, &["-Wno-unused-parameter", "-Wno-missing-field-initializers"]);
    let mut registry = Registry::new();
    common::load(folder.path(), "corner", &mut registry).unwrap();
    let corner = registry.geometry("corner", &ParameterMap::new()).unwrap();
    assert!((corner.tessellate().unwrap().volume(0) - 1.0 / 6.0).abs() < 1e-15);
}

fn denormals_live() -> bool {
    let tiny = std::hint::black_box(f32::MIN_POSITIVE);
    tiny * std::hint::black_box(0.5f32) > 0.0
}

#[test]
#[cfg(target_arch = "x86_64")]
#[expect(unsafe_code, reason = "loads a library without the host, to see what it does")]
fn fast_math_does_not_outlive_loading() {
    let folder = tempfile::tempdir().unwrap();
    let library = common::c_plugin(folder.path(), "kit.c", "kit", &["-ffast-math"]);
    let bare = library.clone();
    // That the library is a danger at all. A thread ends with its state.
    let spoilt = std::thread::spawn(move || {
        // SAFETY: the library's initialisers do nothing but spoil this thread's state.
        let library = unsafe { libloading::Library::new(bare) }.unwrap();
        let spoilt = !denormals_live();
        drop(library);
        spoilt
    });
    assert!(spoilt.join().unwrap(), "this compiler's fast-math does not turn on flush-to-zero");
    std::thread::spawn(move || {
        let mut registry = Registry::with_core();
        common::load(folder.path(), "kit", &mut registry).unwrap();
        assert!(denormals_live());
    })
    .join()
    .unwrap();
}
