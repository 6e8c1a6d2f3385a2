//! Shaders by their source, as users meet them: beside a scene, in the config's folders, built in.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use volact::{
    Appearance, ControlPoint, FrameDesc, FrameExt as _, LookupTable, Options, Registry, RegistryExt as _, ScalarType,
    Shape, View, Volume, VolumeDesc,
    core::{loader::NoProgress, scene::Scene},
    shaders,
};
use volact_files::picture;

fn volact(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
    command.current_dir(folder).args(arguments).env("VOLACT_CONFIG", "").env_remove("VOLACT_LOG");
    command.output().expect("the command starts")
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

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
const WGSL: &str = "fn shade(s: Sample) -> Medium {\n    return lookup_table(volume(s.position));\n}\n";

/// A folder with a ramp of voxels, a scene of the shader `own`, and that shader in a folder of it.
fn folder(shaders: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut file = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n\n".to_vec();
    file.extend((0..64u8).map(|i| 4 * i));
    fs::write(folder.path().join("ramp.nrrd"), file).unwrap();
    let scene = |shader: &str| {
        format!(
            "Scene(version: 1, data: {{\"ramp\": (file: \"ramp.nrrd\")}}, shapes: [(shader: \"{shader}\", parameters: {{\
             \"volume\": Volume(data: \"ramp\"), \"lookup_table\": Table(points: [(0, (0, 0, 1), 0), (252, (1, 1, 0), 0.6)]), \
             \"unit_distance\": 1}})], image: (size: (24, 20)))"
        )
    };
    fs::write(folder.path().join("own.scene.ron"), scene("own")).unwrap();
    fs::write(folder.path().join("lut.scene.ron"), scene("lut")).unwrap();
    let place = folder.path().join(shaders);
    fs::create_dir_all(&place).unwrap();
    fs::write(place.join("own.ron"), RON).unwrap();
    fs::write(place.join("own.wgsl"), WGSL).unwrap();
    folder
}

fn draw(folder: &Path, scene: &str, more: &[&str]) -> Output {
    let all = ["render", scene, "-a", "cpu", "--step", "0.1", "--option", "classification=\"post\"", "-o", "out.npy"];
    volact(folder, &[&all, more].concat())
}

#[test]
fn a_shader_beside_the_scene_or_in_the_configs_folder_is_drawn() {
    for (place, config) in [("", ""), ("looks", "(version: 1, shader_folders: [\"looks\"])")] {
        let folder = folder(place);
        let path = folder.path();
        fs::write(path.join("config.ron"), config).unwrap();
        let more: &[&str] = if config.is_empty() { &[] } else { &["--config", "config.ron"] };
        let mut pictures = ["own.scene.ron", "lut.scene.ron"].map(|scene| {
            let output = draw(path, scene, more);
            assert!(output.status.success(), "{}", err(&output));
            picture::load_picture(&path.join("out.npy")).unwrap().rgba
        });
        let [own, lut] = &mut pictures;
        assert!(lut.iter().any(|c| c[3] > 0.3));
        let off = own.iter().flatten().zip(lut.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0f32, f32::max);
        assert!(off < 1e-5, "{off}");
    }
}

#[test]
fn a_wrong_shader_is_shown_at_its_place_and_nothing_is_written() {
    let folder = folder("");
    let path = folder.path();
    let wrong = [
        (
            "own.wgsl",
            "fn shade(s: Sample) -> Medium {\n    return lookup_table(volum(s.position));\n}\n",
            "own.wgsl:2:25",
        ),
        ("own.wgsl", "fn shad(s: Sample) -> Medium { return lookup_table(0.0); }", "fn shade(s: Sample) -> Medium"),
        ("own.ron", &RON.replace("Table,", "Tabel,"), "own.ron"),
        ("own.ron", &RON.replace("\"volume\"", "\"exp\""), "exp"),
    ];
    for (file, text, wanted) in wrong {
        let before = fs::read_to_string(path.join(file)).unwrap();
        fs::write(path.join(file), text).unwrap();
        let output = draw(path, "own.scene.ron", &[]);
        assert_eq!(output.status.code(), Some(2));
        assert!(err(&output).contains(wanted), "{wanted}: {}", err(&output));
        assert!(!path.join("out.npy").exists());
        fs::write(path.join(file), before).unwrap();
    }
    assert!(draw(path, "own.scene.ron", &[]).status.success());
    // A name that a built-in has.
    for extension in ["ron", "wgsl"] {
        fs::rename(path.join("own").with_extension(extension), path.join("lut").with_extension(extension)).unwrap();
    }
    let output = draw(path, "lut.scene.ron", &[]);
    assert!(!output.status.success() && err(&output).contains("lut"), "{}", err(&output));
}

/// A config's folder with a broken shader made every picture fail.
#[test]
fn a_wrong_shader_that_nobody_asks_for_is_a_warning() {
    let folder = folder("looks");
    let path = folder.path();
    fs::write(path.join("config.ron"), "(version: 1, shader_folders: [\"looks\"])").unwrap();
    fs::write(
        path.join("looks/own.wgsl"),
        "fn shade(s: Sample) -> Medium {\n    return lookup_table(volum(s.position));\n}\n",
    )
    .unwrap();
    let config = ["--config", "config.ron"];
    let shown = "own.wgsl:2:25: no definition in scope for identifier: `volum`\n 2 |     return lookup_table(volum(s.position));\n   |                         ^^^^^";
    let output = draw(path, "lut.scene.ron", &config);
    assert!(output.status.success(), "{}", err(&output));
    assert!(path.join("out.npy").exists());
    let told = ["shader \"own\" cannot be used", shown.lines().next().unwrap(), "^^^^^ unknown identifier"];
    assert!(told.iter().all(|words| err(&output).contains(words)), "{}", err(&output));
    // naga's own line in the log tells nothing more.
    assert!(!err(&output).contains("ERROR"), "{}", err(&output));
    fs::remove_file(path.join("out.npy")).unwrap();
    let output = draw(path, "own.scene.ron", &config);
    assert_eq!(output.status.code(), Some(2));
    assert!(err(&output).contains("own.scene.ron:1:") && err(&output).contains(shown), "{}", err(&output));
    assert!(!path.join("out.npy").exists());
    let describe = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
        let command = command.current_dir(path).env("VOLACT_CONFIG", "config.ron").arg("describe").args(more);
        command.output().unwrap()
    };
    let list = describe(&[]);
    let text = String::from_utf8_lossy(&list.stdout).into_owned();
    assert!(
        list.status.success() && text.contains("\nrefused\n  shader own: ") && text.contains("own.wgsl:2:25"),
        "{text}"
    );
    let one = describe(&["own"]);
    assert!(one.status.code() == Some(2) && err(&one).contains(shown), "{}", err(&one));
    assert!(describe(&["lut"]).status.success());
}

#[test]
fn half_a_shader_says_which_file_is_missing() {
    for (gone, there) in [("own.wgsl", "own.ron"), ("own.ron", "own.wgsl")] {
        let folder = folder("");
        fs::remove_file(folder.path().join(gone)).unwrap();
        let output = draw(folder.path(), "own.scene.ron", &[]);
        assert_eq!(output.status.code(), Some(2));
        let wanted = format!("{there}: {gone} is missing beside it");
        assert!(err(&output).contains(&wanted), "{wanted}: {}", err(&output));
        assert!(draw(folder.path(), "lut.scene.ron", &[]).status.success());
    }
}

#[test]
fn two_shaders_of_one_name_are_an_error_with_both_files_where_they_are_asked_for() {
    let folder = folder("looks");
    let path = folder.path();
    for file in ["own.ron", "own.wgsl"] {
        fs::copy(path.join("looks").join(file), path.join(file)).unwrap();
    }
    fs::write(path.join("config.ron"), "(version: 1, shader_folders: [\"looks\"])").unwrap();
    let config = ["--config", "config.ron"];
    let output = draw(path, "own.scene.ron", &config);
    assert_eq!(output.status.code(), Some(2));
    let both = ["./own.wgsl: a shader \"own\" is there already: ", "looks/own.wgsl"];
    assert!(both.iter().all(|file| err(&output).contains(file)), "{}", err(&output));
    assert!(draw(path, "lut.scene.ron", &config).status.success());
    // The scene's own folder in the config, however it is written, is the same folder.
    fs::write(path.join("config.ron"), "(version: 1, shader_folders: [\"looks/..\"])").unwrap();
    assert!(draw(path, "own.scene.ron", &config).status.success());
}

#[test]
fn a_mark_of_byte_order_is_passed_over() {
    let folder = folder("");
    for (file, text) in [("own.ron", RON), ("own.wgsl", WGSL)] {
        fs::write(folder.path().join(file), format!("\u{feff}{text}")).unwrap();
    }
    let output = draw(folder.path(), "own.scene.ron", &[]);
    assert!(output.status.success(), "{}", err(&output));
}

/// The example's picture is what its scene gives.
#[test]
fn the_example_draws_its_picture() {
    let place = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/own_shader");
    let mut registry = Registry::with_builtins();
    shaders::add_folder(&mut registry, &place).unwrap();
    let scene = Scene::open(place.join("scene.ron"), &registry, &NoProgress).unwrap();
    let mut action = registry.action("cpu", &Options::from([("sample_distance".into(), 0.5.into())])).unwrap();
    scene.shapes.iter().try_for_each(|s| action.manage(s)).unwrap();
    action.begin_draw(&scene.frame).unwrap();
    scene.shapes.iter().try_for_each(|s| action.draw(s)).unwrap();
    let frame = action.end_draw().unwrap();
    let folder = tempfile::tempdir().unwrap();
    frame.save(folder.path().join("found.png")).unwrap();
    let found = picture::load_picture(&folder.path().join("found.png")).unwrap();
    let stored = picture::load_picture(&place.join("picture.png")).unwrap();
    assert_eq!([found.width, found.height], [stored.width, stored.height]);
    let off = found.rgba.iter().flatten().zip(stored.rgba.iter().flatten()).map(|(a, b)| (a - b).abs());
    let worst = off.fold(0f32, f32::max);
    assert!(worst < 1.5 / 255.0, "{worst}");
}

/// A sphere's values by distance, lit from one side: what faces the light is brighter.
#[test]
fn shaders_that_come_as_sources_are_drawn() {
    let registry = Registry::with_builtins();
    let mut voxels = Vec::new();
    for i in 0..16 * 16 * 16 {
        let at = [i % 16, i / 16 % 16, i / 256].map(|v| f64::from(v) - 7.5);
        voxels.push((255.0 - 30.0 * at.iter().map(|v| v * v).sum::<f64>().sqrt()).clamp(0.0, 255.0) as u8);
    }
    let volume = Volume::new(VolumeDesc::new([16; 3], ScalarType::U8, 1), voxels).unwrap();
    let point = |value, opacity| ControlPoint { value, color: [0.8; 3], opacity };
    let table = LookupTable::from_points([point(80.0, 0.0), point(120.0, 0.9)]).unwrap();
    let light = |shader: &str| {
        let look = Appearance::new(shader)
            .with("lookup_table", table.clone())
            .with("lightdir", volact::ParameterValue::Vec3(volact::core::glam::DVec3::new(0.0, 0.0, 1.0)));
        let look = if shader == "gradient" { look.with("light", "directional") } else { look };
        let shape = Shape::around(&volume, look);
        let mut action = registry.action("cpu", &Options::default()).unwrap();
        action.manage(&shape).unwrap();
        action.begin_draw(&FrameDesc::fit(&shape, View::Front, 40, 40)).unwrap();
        action.draw(&shape).unwrap();
        action.end_draw().unwrap()
    };
    for shader in ["gradient", "tangent_space"] {
        let frame = light(shader);
        let sum = |rows: std::ops::Range<usize>| {
            frame.color[40 * rows.start..40 * rows.end].iter().map(|c| c[0]).sum::<f32>()
        };
        let (above, below) = (sum(5..20), sum(20..35));
        assert!(above > 1.3 * below && below > 0.0, "{shader}: {above} above, {below} below");
    }
}
