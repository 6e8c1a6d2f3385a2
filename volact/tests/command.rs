//! The built command: what it prints, writes and exits with.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

/// Runs `volact` in a folder, without the user's config or environment.
fn volact(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
    command.current_dir(folder).args(arguments).env("VOLACT_CONFIG", "").env_remove("VOLACT_LOG");
    command.output().expect("the command starts")
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap_or(-1)
}

fn out(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A folder with a ball of 12³ voxels.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut file = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 12 12 12\nencoding: raw\n\n".to_vec();
    for i in 0..12 * 12 * 12 {
        let at = [i % 12, i / 12 % 12, i / 144].map(|v| f64::from(v) - 5.5);
        let r = at.iter().map(|v| v * v).sum::<f64>().sqrt();
        file.push((255.0 * (1.0 - r / 6.0)).clamp(0.0, 255.0) as u8);
    }
    fs::write(folder.path().join("ball.nrrd"), file).unwrap();
    folder
}

const SCENE: &str = r#"Scene(
    version: 1,
    data: {"ball": (file: "ball.nrrd")},
    shapes: [(
        name: "ball",
        shader: "lut",
        parameters: {
            "volume": Volume(data: "ball"),
            "lookup_table": Table(points: [(20, (1, 0, 0), 0), (255, (1, 1, 1), 0.4)]),
            "unit_distance": 1,
        },
    )],
    image: (size: (40, 30)),
)"#;

#[test]
fn help_and_version_read_well() {
    let folder = tempfile::tempdir().unwrap();
    let help = volact(folder.path(), &["--help"]);
    assert_eq!(code(&help), 0);
    for word in ["render", "info", "describe", "compare", "bench", "completions", "Exit codes", "VOLACT_LOG"] {
        assert!(out(&help).contains(word), "{word} in {}", out(&help));
    }
    let version = volact(folder.path(), &["--version"]);
    assert_eq!(out(&version), concat!("volact ", env!("CARGO_PKG_VERSION"), "\n"));
    let render = out(&volact(folder.path(), &["render", "--help"]));
    for word in
        ["--action", "--size", "--view", "--step", "--threads", "--set", "--option", "--clip", "--slice", "Examples"]
    {
        assert!(render.contains(word), "{word} in {render}");
    }
}

#[test]
fn wrong_usage_fails_with_two() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(code(&volact(folder.path(), &[])), 2);
    assert_eq!(code(&volact(folder.path(), &["rendr"])), 2);
    let size = volact(folder.path(), &["render", "x.ron", "--size", "0x3"]);
    assert!(code(&size) == 2 && err(&size).contains("wanted 640x480 or 512"), "{}", err(&size));
    let view = volact(folder.path(), &["render", "x.ron", "--view", "frnt"]);
    assert!(err(&view).contains("did you mean \"front\"?"), "{}", err(&view));
    let set = volact(folder.path(), &["render", "x.ron", "--set", "a"]);
    assert!(err(&set).contains("wanted NAME=VALUE"), "{}", err(&set));
}

#[test]
fn bare_volume_just_works() {
    let folder = folder();
    let output = volact(folder.path(), &["render", "ball.nrrd", "--size", "32", "--action", "cpu"]);
    assert_eq!(code(&output), 0, "{}", err(&output));
    assert!(out(&output).starts_with("ball.png: 32 × 32 pixels\n"), "{}", out(&output));
    for word in ["drawn   ball", "how     cpu: ", "speed   "] {
        assert!(out(&output).contains(word), "{word} in {}", out(&output));
    }
    let picture = volact_files::picture::load_picture(&folder.path().join("ball.png")).unwrap();
    assert_eq!((picture.width, picture.height), (32, 32));
    let lit = picture.rgba.iter().filter(|p| p[0] + p[1] + p[2] > 0.1).count();
    assert!((50..1000).contains(&lit), "{lit} pixels show the ball");
}

/// A shader that looks into the volume is not given a table that makes a black box of it.
#[test]
fn bare_volume_is_seen_with_a_shader_of_the_users_choice() {
    let folder = folder();
    for shader in ["gradient", "tangent_space", "mip"] {
        let output = volact(folder.path(), &["render", "ball.nrrd", "--shader", shader, "--size", "32", "-o", "b.npy"]);
        assert_eq!(code(&output), 0, "{}", err(&output));
        let picture = volact_files::picture::load_picture(&folder.path().join("b.npy")).unwrap();
        let [corner, middle] = [0, 16 * 32 + 16].map(|i| picture.rgba[i]);
        assert!(middle[..3].iter().any(|c| *c > 0.2), "{shader}: {middle:?}");
        assert!(corner[..3].iter().all(|c| *c < 0.02), "{shader}: {corner:?}");
    }
}

#[test]
fn scene_is_drawn_by_the_first_preferred_action_that_can() {
    let folder = folder();
    fs::write(folder.path().join("scene.ron"), SCENE).unwrap();
    fs::write(folder.path().join("config.ron"), r#"(version: 1, prefer: ["null", "vulkn", "cpu"])"#).unwrap();
    let output = volact(folder.path(), &["render", "scene.ron", "--config", "config.ron", "-o", "a.npy", "--json"]);
    assert_eq!(code(&output), 0, "{}", err(&output));
    let report: serde_json::Value = serde_json::from_str(&out(&output)).unwrap();
    assert_eq!(report["action"], "cpu");
    assert_eq!(report["refused"][0]["why"], "does not composite by \"over\" (shape \"ball\")");
    assert_eq!(report["refused"][1]["why"], "not registered");
    assert_eq!((report["width"].as_u64(), report["height"].as_u64()), (Some(40), Some(30)));
    let picture = volact_files::picture::load_picture(&folder.path().join("a.npy")).unwrap();
    assert_eq!(picture.rgba.len(), 1200);
}

#[test]
fn settings_change_the_picture_and_stated_defaults_do_not() {
    let folder = folder();
    fs::write(folder.path().join("scene.ron"), SCENE).unwrap();
    let draw = |name: &str, more: &[&str]| {
        let mut arguments = vec!["render", "scene.ron", "--action", "cpu", "-q", "-o", name];
        arguments.extend(more);
        let output = volact(folder.path(), &arguments);
        assert_eq!((code(&output), out(&output)), (0, String::new()), "{}", err(&output));
        fs::read(folder.path().join(name)).unwrap()
    };
    let plain = draw("plain.npy", &[]);
    let stated = ["--threads", "1", "--set", "unit_distance=1", "--set", "ball.component=0", "--view", "front"];
    assert!(plain == draw("stated.npy", &stated), "defaults stated change nothing");
    assert!(plain != draw("unit.npy", &["--set", "unit_distance=3"]));
    assert!(plain != draw("step.npy", &["--step", "2", "--option", "classification=post"]));
    assert!(plain != draw("mip.npy", &["--view", "iso"]));
}

#[test]
fn errors_name_their_causes_and_leave_no_picture() {
    let folder = folder();
    let wrong = SCENE.replace("\"lut\"", "\"lit\"").replace("version: 1", "version: 9");
    fs::write(folder.path().join("wrong.ron"), wrong).unwrap();
    let output = volact(folder.path(), &["render", "wrong.ron"]);
    assert_eq!(code(&output), 2);
    let expected = "error: wrong.ron: cannot be drawn\n  \
        because: wrong.ron:2:14: version: found 9, wanted 1, the version of the format that this build reads\n\
        wrong.ron:6:17: shapes[0].shader: found \"lit\", wanted a registered shader: ";
    assert!(err(&output).starts_with(expected), "{}", err(&output));
    let missing = volact(folder.path(), &["render", "nowhere.nrrd"]);
    assert!(code(&missing) == 2 && err(&missing).contains("  because: nowhere.nrrd: cannot be read\n"));
    let format = volact(folder.path(), &["render", "ball.nrrd", "-o", "a.jpg"]);
    assert_eq!(err(&format), "error: a.jpg: extension is .jpg, wanted .png, .exr or .npy\n");
    let place = volact(folder.path(), &["render", "ball.nrrd", "-o", "no/a.png"]);
    assert_eq!(err(&place), "error: no/a.png: the folder no is not there\n");
    let action = volact(folder.path(), &["render", "ball.nrrd", "--action", "cpuu"]);
    assert!(err(&action).contains("did you mean \"cpu\"?"), "{}", err(&action));
    let option = volact(folder.path(), &["render", "ball.nrrd", "--action", "cpu", "--option", "thraeds=2"]);
    assert!(err(&option).contains("did you mean \"threads\"?"), "{}", err(&option));
    let shape = volact(folder.path(), &["render", "ball.nrrd", "--set", "bal.unit_distance=2"]);
    assert!(code(&shape) == 2 && err(&shape).contains("no shape is called \"bal\""), "{}", err(&shape));
    let parameter = volact(folder.path(), &["render", "ball.nrrd", "--set", "unit_distanse=2"]);
    assert!(err(&parameter).contains("did you mean \"unit_distance\"?"), "{}", err(&parameter));
    let pictures = fs::read_dir(folder.path()).unwrap().filter_map(Result::ok);
    let names: Vec<_> = pictures.map(|e| e.file_name().into_string().unwrap()).collect();
    assert!(names.iter().all(|n| n == "ball.nrrd" || n == "wrong.ron"), "{names:?}");
}

#[test]
fn wrong_config_is_an_error_with_its_place() {
    let folder = folder();
    fs::write(folder.path().join("config.ron"), "(version: 1, prefer: [])").unwrap();
    let output = volact(folder.path(), &["render", "ball.nrrd", "--config", "config.ron"]);
    assert_eq!(code(&output), 2);
    let expected = "error: the config cannot be used\n  because: config.ron:1:22: prefer: found a list of 0 values, \
        wanted at least one action's name\n";
    assert_eq!(err(&output), expected);
}

#[test]
fn describe_lists_and_tells_in_full() {
    let folder = tempfile::tempdir().unwrap();
    let list = out(&volact(folder.path(), &["describe"]));
    for word in [
        "actions\n",
        "\nshaders\n",
        "\ngeometries\n",
        "\nloaders\n",
        "  cpu ",
        "  lut ",
        "  block ",
        "  nrrd ",
        "  attribute ",
        "  surface ",
        "  sphere ",
        "  cylinder ",
        "  vtu ",
        "  stl ",
    ] {
        assert!(list.contains(word), "{word:?} in {list}");
    }
    let lut = out(&volact(folder.path(), &["describe", "lut"]));
    for word in [
        "composited by over",
        "unit_distance: float; required; above 0; in world units",
        "component: int; default 0; 0 to 3",
    ] {
        assert!(lut.contains(word), "{word:?} in {lut}");
    }
    let cpu = out(&volact(folder.path(), &["describe", "cpu"]));
    assert!(cpu.contains("attribute, surface; others by their source\n"), "{cpu}");
    let none = volact(folder.path(), &["describe", "ltu"]);
    assert!(code(&none) == 2 && err(&none).contains("nothing is called \"ltu\"; did you mean \"lut\"?"));
}

#[test]
fn completions_know_the_commands() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = volact(folder.path(), &["completions", shell]);
        assert!(code(&script) == 0 && out(&script).contains("straight-alpha"), "{shell}");
    }
}

#[test]
fn log_level_comes_from_the_flag_and_the_environment() {
    let folder = folder();
    let draw = |more: &[&str], log: Option<&str>| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
        command.current_dir(folder.path()).args(["render", "ball.nrrd", "--action", "null", "--size", "4"]).args(more);
        command.env("VOLACT_CONFIG", "").env_remove("VOLACT_LOG").envs(log.map(|level| ("VOLACT_LOG", level)));
        err(&command.output().unwrap())
    };
    assert_eq!(draw(&[], None), "");
    assert!(draw(&["-v"], None).contains("[unit-distance-defaulted]"));
    assert!(draw(&[], Some("debug")).contains("read by loader nrrd"));
}

/// A mesh of two hexahedra side by side, with numbers that rise along x, and a pyramid of
/// triangles.
fn meshes() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let points: Vec<String> = (0..12).map(|i| format!("{} {} {}", i % 3, i / 3 % 2, i / 6)).collect();
    let numbers = |f: fn(usize) -> f64| (0..12).map(|i| f(i).to_string()).collect::<Vec<_>>().join(" ");
    let array = |name: &str, components: usize, text: String| {
        format!(
            "<DataArray type=\"Float64\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"ascii\">{text}</DataArray>\n"
        )
    };
    let indices = |name: &str, text: &str| {
        format!("<DataArray type=\"Int64\" Name=\"{name}\" format=\"ascii\">{text}</DataArray>\n")
    };
    let flow = (0..36).map(|i| (i % 3).to_string()).collect::<Vec<_>>().join(" ");
    let vtu = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
         <UnstructuredGrid><Piece NumberOfPoints=\"12\" NumberOfCells=\"2\">\n<PointData>\n{}{}{}</PointData>\n\
         <Points>\n{}</Points>\n<Cells>\n{}{}{}</Cells>\n</Piece></UnstructuredGrid></VTKFile>\n",
        array("flow", 3, flow),
        array("heat", 1, numbers(|i| (i % 3) as f64)),
        array("height", 1, numbers(|i| (i / 6) as f64)),
        array("Points", 3, points.join(" ")),
        indices("connectivity", "0 1 4 3 6 7 10 9 1 2 5 4 7 8 11 10"),
        indices("offsets", "8 16"),
        "<DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">12 12</DataArray>\n",
    );
    fs::write(folder.path().join("room.vtu"), vtu).unwrap();
    let [a, b, c, d] = ["0 0 0", "1 0 0", "0 1 0", "0.3 0.3 1"];
    let facet = |p: [&str; 3]| {
        let corners: String = p.iter().map(|p| format!("    vertex {p}\n")).collect();
        format!("  facet normal 0 0 0\n   outer loop\n{corners}   endloop\n  endfacet\n")
    };
    let facets: String = [[a, c, b], [a, b, d], [b, c, d], [c, a, d]].map(facet).concat();
    fs::write(folder.path().join("part.stl"), format!("solid part\n{facets}endsolid part\n")).unwrap();
    folder
}

/// How many pixels of a picture are not black.
fn lit(path: &Path) -> usize {
    let picture = volact_files::picture::load_picture(path).unwrap();
    picture.rgba.iter().filter(|p| p[0] + p[1] + p[2] > 0.02).count()
}

#[test]
fn bare_meshes_just_work() {
    let folder = meshes();
    let draw = |more: &[&str]| {
        let arguments = [&["render", "room.vtu", "--size", "40", "--action", "cpu"], more].concat();
        let output = volact(folder.path(), &arguments);
        assert_eq!(code(&output), 0, "{}", err(&output));
        (out(&output), lit(&folder.path().join("room.png")))
    };
    let (text, whole) = draw(&["--view", "front"]);
    for word in ["attribute \"heat\", ", "--attribute NAME shows another of flow, heat, height", "mesh of 12 vertices"]
    {
        assert!(text.contains(word), "{word:?} in {text}");
    }
    assert!((400..1000).contains(&whole), "{whole} pixels");
    assert!(draw(&["--attribute", "flow[1]"]).0.contains("component 1 of attribute \"flow\""));
    let (_, half) = draw(&["--view", "front", "--clip", "x<50%"]);
    assert!(half.abs_diff(whole / 2) < whole / 10, "{half} of {whole}");
    let (text, plane) = draw(&["--view", "front", "--slice", "y=50%"]);
    assert!(text.contains("1 slice planes") && (whole / 2..whole).contains(&plane), "{plane} of {whole}\n{text}");
    assert_eq!(draw(&["--view", "front", "--slice", "y=7"]).1, 0);
    let upright = |up: &str, view: &str| draw(&["--up", up, "--view", view]).1;
    assert_eq!((upright("z", "front"), upright("-z", "front")), (whole, whole));
    assert!(upright("y", "top").abs_diff(whole) < whole / 50, "{} of {whole}", upright("y", "top"));
    let wrong = volact(folder.path(), &["render", "room.vtu", "--up", "w"]);
    assert!(code(&wrong) == 2 && err(&wrong).contains("wanted x, y, z, -x, -y or -z"), "{}", err(&wrong));
    let wrong = volact(folder.path(), &["render", "room.vtu", "--attribute", "heta"]);
    assert!(code(&wrong) == 2 && err(&wrong).contains("did you mean \"heat\"?"), "{}", err(&wrong));
}

#[test]
fn bare_surfaces_are_lit() {
    let folder = meshes();
    let output = volact(folder.path(), &["render", "part.stl", "--size", "40", "--action", "cpu"]);
    assert!(code(&output) == 0 && out(&output).contains("4 triangles"), "{}{}", out(&output), err(&output));
    let picture = volact_files::picture::load_picture(&folder.path().join("part.png")).unwrap();
    let mut shades: Vec<u32> = picture.rgba.iter().filter(|p| p[0] > 0.0).map(|p| (p[0] * 255.0) as u32).collect();
    assert!(shades.len() > 200);
    shades.sort_unstable();
    shades.dedup();
    assert!(shades.len() > 1, "faces differ: {shades:?}");
    for (more, word) in
        [("--slice=z=50%", "--slice is for volumes and meshes"), ("--attribute=t", "shown in one colour")]
    {
        let output = volact(folder.path(), &["render", "part.stl", more]);
        assert!(code(&output) == 2 && err(&output).contains(word), "{}", err(&output));
    }
}

#[test]
fn info_tells_of_cells_and_attributes() {
    let folder = meshes();
    let text = out(&volact(folder.path(), &["info", "room.vtu"]));
    for fact in [
        "kind        unstructured mesh\n",
        "cells       2 hexahedra\n",
        "volume      2, of a cell 1 to 1\n",
        "inverted    0\n",
        "boundary    20 triangles\n",
        "            heat: 1 × f64, 0 to 2\n",
    ] {
        assert!(text.contains(fact), "{fact:?} in {text}");
    }
    let json = out(&volact(folder.path(), &["info", "room.vtu", "--json", "--attribute", "height"]));
    let value: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(value["mesh"]["cells"], serde_json::json!({"hexahedron": 2}));
    assert_eq!(value["mesh"]["cell_volumes"], serde_json::json!([1.0, 1.0]));
    assert_eq!(value["range"], serde_json::json!([0.0, 1.0]));
    let surface = out(&volact(folder.path(), &["info", "part.stl"]));
    assert!(surface.contains("kind        surface\n") && surface.contains("triangles   4"), "{surface}");
}

const ROOM: &str = r#"Scene(
    version: 1,
    data: {"room": (file: "$VOLACT_DATA/room.vtu")},
    shapes: [(
        geometry: Mesh(data: "room"),
        shader: "attribute",
        parameters: {
            "scalars": Attribute(data: "room", name: "heat"),
            "lookup_table": WindowLevel(window: 2, level: 1, opacity: 0.5),
        },
        slices: (planes: [Plane(point: (1, 0, 0), normal: (1, 0, 0))], volume: true),
    )],
    image: (size: (20, 20)),
)"#;

#[test]
fn data_folders_come_from_the_command_line_or_the_environment() {
    let (here, data) = (tempfile::tempdir().unwrap(), meshes());
    fs::write(here.path().join("room.ron"), ROOM).unwrap();
    let run = |arguments: &[&str], variable: Option<&Path>| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_volact"));
        command.current_dir(here.path()).args(["render", "room.ron", "--action", "cpu"]).args(arguments);
        command.env("VOLACT_CONFIG", "").env_remove("VOLACT_DATA").envs(variable.map(|path| ("VOLACT_DATA", path)));
        command.output().unwrap()
    };
    let folder = data.path().to_str().unwrap();
    assert_eq!(code(&run(&["--data-dir", folder], None)), 0);
    assert_eq!(code(&run(&[], Some(data.path()))), 0);
    let none = run(&[], None);
    assert!(code(&none) == 2 && err(&none).contains("wanted a folder in place of $VOLACT_DATA"), "{}", err(&none));
    let slices = run(&["--slice", "x=1"], Some(data.path()));
    assert!(code(&slices) == 2 && err(&slices).contains("are for bare data"), "{}", err(&slices));
}

#[test]
fn actions_that_are_not_there_are_news_only_to_those_who_ask() {
    let folder = folder();
    let draw = |more: &[&str]| out(&volact(folder.path(), &[&["render", "ball.nrrd", "--size", "8"], more].concat()));
    assert!(!draw(&[]).contains("not by"));
    let told = draw(&["-v"]);
    // Where there is a GPU it draws.
    assert!(told.contains("not by  wgpu: no device") || told.contains("how     wgpu:"), "{told}");
}
