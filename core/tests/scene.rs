//! Scene files: every kind of problem with its exact message, hostile texts, and that what can be
//! left out equals what it stands for.

use std::path::Path;

use volact_core::{
    Camera, ClipRegion, Registry, SliceStyle, View,
    camera::DepthRange,
    glam::{DAffine3, DVec3},
    loader::NoProgress,
    scene::{
        AttributeValues, CameraSpec, GeometrySpec, OpaqueDepthSpec, ParameterSpec, Scene, SceneFile, TableEntries,
        TransformStep,
    },
};

/// A scene that is right, into which the tests put what is wrong.
fn scene(part: &str, what: &str) -> String {
    let pick = |name: &str, good: &str| if part == name { what.to_owned() } else { good.to_owned() };
    format!(
        "({} data: {{\"head\": ({})}},\nshapes: [({}shader: {}, parameters: {{\"volume\": Volume({}), \"lookup_table\": {}{}}})],\n{})",
        pick("version", "version: 1,"),
        pick("data", "file: \"head.nrrd\""),
        pick("shape", ""),
        pick("shader", "\"lut\""),
        pick("volume", "data: \"head\""),
        pick("table", "WindowLevel(window: 2, level: 1, opacity: 0.5)"),
        pick("parameter", ""),
        pick("rest", ""),
    )
}

/// Part of the scene, what is put there, and all of the message.
#[rustfmt::skip]
const WRONG: &[(&str, &str, &str)] = &[
    ("version", "", "1:1: version: found nothing, wanted 1, the version of the format that this build reads"),
    ("version", "version: 2,", "1:11: version: found 2, wanted 1, the version of the format that this build reads"),
    ("version", "version: \"1\",", "1:11: version: found \"1\", wanted 1, the version of the format that this build reads"),
    ("version", "version: 1, version: 1,", "1:14: version: found this field a second time, wanted it once"),
    ("data", "", "1:29: data.head.file: found nothing, wanted a path relative to the scene file"),
    ("data", "file: 3", "1:36: data.head.file: found 3, wanted a text in quotation marks"),
    ("data", "file: \"a\", laoder: \"nrrd\"", "1:41: data.head: found field `laoder`, wanted file, loader, options, spacing, placement, slope, intercept, unit; did you mean \"loader\"?"),
    ("data", "file: \"a\", loader: \"nrrd\"", "1:49: data.head.loader: found \"nrrd\", wanted a registered loader: none is"),
    ("data", "file: \"a\", spacing: (1, 0, 1)", "1:54: data.head.spacing[1]: found 0, wanted a positive, finite number"),
    ("data", "file: \"a\", spacing: (1, 1)", "1:50: data.head.spacing: found a tuple of 2 values, wanted three numbers (x, y, z)"),
    ("data", "file: \"a\", slope: 0", "1:48: data.head.slope: found 0, wanted a finite number other than 0"),
    ("data", "file: \"a\", intercept: NaN", "1:52: data.head.intercept: found NaN, wanted a finite number"),
    ("shader", "\"lit\"", "2:19: shapes[0].shader: found \"lit\", wanted a registered shader: attribute, average, lut, minip, mip, simple, surface, xray; did you mean \"lut\"?"),
    ("shader", "lut", "2:19: shapes[0].shader: found `lut`, wanted a name of 1 to 128 characters in quotation marks"),
    ("volume", "data: \"haed\"", "2:62: shapes[0].parameters.volume.data: found \"haed\", wanted a name under `data`: head; did you mean \"head\"?"),
    ("volume", "data: \"head\", filter: Nearst", "2:78: shapes[0].parameters.volume.filter: found `Nearst`, wanted one of Linear, Nearest; did you mean \"Nearest\"?"),
    ("volume", "data: \"head\", range: (1, 1)", "2:77: shapes[0].parameters.volume.range: found [1.0, 1.0], wanted two numbers that differ"),
    ("volume", "data: \"head\", data_roi: ((0,0,0), (1,1,-1))", "2:95: shapes[0].parameters.volume.data_roi[1][2]: found -1, wanted a whole number from 0 on"),
    ("volume", "data: \"head\", data_roi: ((2,0,0), (1,1,1))", "2:80: shapes[0].parameters.volume.data_roi: found a tuple of 2 values, wanted a first sample not beyond the last along any axis"),
    ("volume", "data: \"head\", luminance: 1", "2:81: shapes[0].parameters.volume.luminance: found 1, wanted true or false"),
    ("table", "Table(points: [(0, (0, 0, 0), 0), (1, (1, 1, 1), 1.5)])", "2:136: shapes[0].parameters.lookup_table.points[1].opacity: found 1.5, wanted 0 to 1"),
    ("table", "Table(points: [])", "2:101: shapes[0].parameters.lookup_table.points: found a list of 0 values, wanted at least one control point"),
    ("table", "Table(points: [(0, (0, -1, 0), 0)])", "2:110: shapes[0].parameters.lookup_table.points[0].color[1]: found -1, wanted a finite number of at least 0"),
    ("table", "Entries(values: [(0, 0, 0, 0)], domain: (1, 0))", "2:127: shapes[0].parameters.lookup_table.domain: found [1.0, 0.0], wanted two numbers that rise"),
    ("table", "WindowLevel(window: 0, level: 0, opacity: 1)", "2:107: shapes[0].parameters.lookup_table.window: found 0, wanted a positive, finite number"),
    ("table", "Tabel(points: [])", "2:87: shapes[0].parameters.lookup_table: found `Tabel(…)`, wanted a value: a number, (x, y, …), \"word\", true, false or one of Volume, Table, Entries, WindowLevel, Attribute, Color, Matrix; did you mean \"Table\"?"),
    ("table", "3", "2:87: shapes[0].parameters.lookup_table: found int 3, wanted lookup table"),
    ("parameter", ", \"component\": 7", "2:148: shapes[0].parameters.component: found int 7, wanted 0 to 3"),
    ("parameter", ", \"componnet\": 0", "2:148: shapes[0].parameters.componnet: found a parameter that nobody declares, wanted a parameter of shader \"lut\": volume, lookup_table, unit_distance, component; did you mean \"component\"?"),
    ("parameter", ", \"volume\": 0", "2:135: shapes[0].parameters: found \"volume\", wanted each name once"),
    ("parameter", ", 3: 0", "2:135: shapes[0].parameters: found 3, wanted a name in quotation marks"),
    ("shape", "name: \"\", ", "2:17: shapes[0].name: found \"\", wanted a name of 1 to 128 characters in quotation marks"),
    ("shape", "geometry: Block(offset: (0, 0, 0), dimensions: (1, 1, -1)), ", "2:65: shapes[0].geometry.dimensions[2]: found -1, wanted a positive, finite number"),
    ("shape", "geometry: Geometry(name: \"blok\"), ", "2:36: shapes[0].geometry.name: found \"blok\", wanted a registered geometry: block, cylinder, sphere; did you mean \"block\"?"),
    ("shape", "geometry: Geometry(name: \"block\", parameters: {\"offset\": (0, 0, 0)}), ", "2:57: shapes[0].geometry.parameters.dimensions: found nothing, wanted vec3: its lengths"),
    ("shape", "transform: Rotate(axis: (0, 0, 0), degrees: 1), ", "2:35: shapes[0].transform.axis: found a tuple of 3 values, wanted a direction with a length"),
    ("shape", "transform: [Translate(1, 2)], ", "2:23: shapes[0].transform[0]: found `Translate(…)`, wanted Translate(x, y, z)"),
    ("shape", "transform: Scale(0), ", "2:28: shapes[0].transform[0]: found 0, wanted a finite number other than 0"),
    ("shape", "transform: Matrix((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 0), (0, 0, 0, 1)), ", "2:22: shapes[0].transform: found `Matrix(…)`, wanted a matrix that can be inverted"),
    ("shape", "transform: Matrix((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 1, 1)), ", "2:22: shapes[0].transform: found `Matrix(…)`, wanted an affine map: a last row of (0, 0, 0, 1)"),
    ("shape", "geometry: Blok(), ", "2:21: shapes[0].geometry: found `Blok`, wanted one of Around, Block, Mesh, StructuredMesh, Sphere, Cylinder, Geometry; did you mean \"Block\"?"),
    ("shape", "geometry: Mesh(data: \"haed\"), ", "2:32: shapes[0].geometry.data: found \"haed\", wanted a name under `data`: head; did you mean \"head\"?"),
    ("shape", "geometry: Mesh(data: \"head\", points: []), ", "2:48: shapes[0].geometry.points: found a list of 0 values, wanted nothing: `data` gives the whole mesh"),
    ("shape", "geometry: Mesh(tetrahedra: []), ", "2:21: shapes[0].geometry.points: found nothing, wanted the vertices, [(x, y, z), …], or the name of `data` that has them"),
    ("shape", "geometry: Mesh(points: [(0, 0, 0), (1, 0, 0)]), ", "2:21: shapes[0].geometry: found `Mesh(…)`, wanted cells: `tetrahedra`, `hexahedra`, `wedges`, `pyramids`, or `triangles`"),
    ("shape", "geometry: Mesh(points: [(0, 0, 0), (1, 0, inf)], tetrahedra: []), ", "2:53: shapes[0].geometry.points[1][2]: found inf, wanted a finite number"),
    ("shape", "geometry: Mesh(points: [(0, 0, 0), (1, 0, 0)], tetrahedra: [[0, 1, 2, 1]]), ", "2:78: shapes[0].geometry.tetrahedra[0][2]: found 2, wanted the index of one of the 2 points, from 0 on"),
    ("shape", "geometry: Mesh(points: [], tetrahedra: [[0, 1, 2, 3]]), ", "2:52: shapes[0].geometry.tetrahedra[0][0]: found 0, wanted the index of one of the 0 points, from 0 on\n2:55: shapes[0].geometry.tetrahedra[0][1]: found 1, wanted the index of one of the 0 points, from 0 on\n2:58: shapes[0].geometry.tetrahedra[0][2]: found 2, wanted the index of one of the 0 points, from 0 on\n2:61: shapes[0].geometry.tetrahedra[0][3]: found 3, wanted the index of one of the 0 points, from 0 on"),
    ("shape", "geometry: Mesh(points: File(\"a\"), hexahedra: [[0, 1, 2, -1, 4, 5, 6, 7]]), ", "2:67: shapes[0].geometry.hexahedra[0][3]: found -1, wanted the index of a vertex"),
    ("shape", "geometry: Mesh(points: File(\"a\"), wedges: [[0, 1, 2]]), ", "2:54: shapes[0].geometry.wedges[0]: found a list of 3 values, wanted the indices of 6 vertices, [index, …]"),
    ("shape", "geometry: Mesh(points: File(\"a\"), pyramids: [(0, 1, 2, 3, 4)]), ", "2:56: shapes[0].geometry.pyramids[0]: found a tuple of 5 values, wanted the indices of 5 vertices, [index, …]"),
    ("shape", "geometry: Mesh(points: File(\"a\"), tetrahedra: [[0, 1, 2, 3]], triangles: [[0, 1, 2]]), ", "2:21: shapes[0].geometry: found `Mesh(…)`, wanted triangles by themselves, without cells and texture coordinates: a surface holds no volume"),
    ("shape", "geometry: Mesh(points: [(0, 0, 0)], texture_coordinates: [], tetrahedra: [[0, 0, 0, 0]]), ", "2:68: shapes[0].geometry.texture_coordinates: found a list of 0 values, wanted 1 points, one for each vertex"),
    ("shape", "geometry: StructuredMesh(dims: (2, 2, 1), points: File(\"a\")), ", "2:49: shapes[0].geometry.dims[2]: found 1, wanted a whole number from 2 on"),
    ("shape", "geometry: StructuredMesh(dims: (4294967296, 4294967296, 2), points: File(\"a\")), ", "2:42: shapes[0].geometry.dims: found a tuple of 3 values, wanted at most 4294967295 vertices"),
    ("shape", "geometry: StructuredMesh(dims: (2, 2, 2), points: [(0, 0, 0)]), ", "2:61: shapes[0].geometry.points: found a list of 1 value, wanted 8 points, one for each vertex of the grid"),
    ("shape", "geometry: StructuredMesh(dims: (2, 2, 2), points: File(3)), ", "2:66: shapes[0].geometry.points[0]: found 3, wanted a text in quotation marks"),
    ("shape", "geometry: Sphere(center: (0, 0, 0), radius: 0), ", "2:55: shapes[0].geometry.radius: found 0, wanted a positive, finite number"),
    ("shape", "geometry: Sphere(center: (0, 0, 0), radius: 1, segments: 2), ", "2:68: shapes[0].geometry.segments: found 2, wanted a whole number from 3 to 1024"),
    ("shape", "geometry: Cylinder(start: (0, 0, 1), end: (0, 0, 1), radius: 1), ", "2:53: shapes[0].geometry.end: found a tuple of 3 values, wanted another end than `start`"),
    ("shape", "slices: (planes: []), ", "2:28: shapes[0].slices.planes: found a list of 0 values, wanted at least one plane"),
    ("shape", "slices: (planes: [Plane(point: (0, 0, 0), normal: (0, 0, 0))]), ", "2:61: shapes[0].slices.planes[0].normal: found a tuple of 3 values, wanted a direction with a length"),
    ("shape", "slices: (planes: [Plane(point: (0, 0, 0), normal: (0, 0, 1))], style: Opaqe), ", "2:81: shapes[0].slices.style: found `Opaqe`, wanted one of Opaque, Blended; did you mean \"Opaque\"?"),
    ("shape", "slices: (style: Opaque), ", "2:19: shapes[0].slices.planes: found nothing, wanted planes, [Plane(point: (x, y, z), normal: (x, y, z)), …]"),
    ("shape", "clip: Plane(point: (0, 0, 0), normal: (1, 0, 0)), ", "2:17: shapes[0].clip: found `Plane(…)`, wanted a list of Plane(…), Planes([…]), Box(…) or Cut(…)"),
    ("shape", "clip: [Sphere(center: (0, 0, 0), radius: 1)], ", "2:18: shapes[0].clip[0]: found `Sphere(…)`, wanted one of Plane, Planes, Box, Cut"),
    ("shape", "clip: [Cut(Box(min: (0, 0, 0), max: (1, 0, 1)))], ", "2:22: shapes[0].clip[0][0]: found `Box(…)`, wanted `min` below `max` along each axis"),
    ("parameter", ", \"scalars\": Attribute(data: \"haed\", name: \"t\")", "2:162: shapes[0].parameters.scalars.data: found \"haed\", wanted a name under `data`: head; did you mean \"head\"?"),
    ("parameter", ", \"scalars\": Attribute(data: \"head\", name: \"t\", values: [1])", "2:189: shapes[0].parameters.scalars.values: found a list of 1 value, wanted nothing: `data` gives the numbers"),
    ("parameter", ", \"scalars\": Attribute(name: \"t\", values: [1], component: 0)", "2:191: shapes[0].parameters.scalars.component: found 0, wanted nothing: `component` picks from the numbers of `data`"),
    ("rest", "clip: [Planes([])]", "3:15: clip[0][0]: found a list of 0 values, wanted at least one plane"),
    ("rest", "opaque: (color: \"a\")", "3:9: opaque: found a struct without a name, wanted `depth`, a file of distances, or a `depth_buffer`"),
    ("rest", "opaque: (depth: 3)", "3:17: opaque.depth: found 3, wanted a text in quotation marks"),
    ("rest", "opaque: (depth_buffer: (file: \"a\"))", "3:24: opaque.depth_buffer.world_to_clip: found nothing, wanted four rows of four numbers, ((a, b, c, d), …)"),
    ("rest", "opaque: (depth_buffer: (file: \"a\", world_to_clip: ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 0), (0, 0, 0, 1))))", "3:51: opaque.depth_buffer.world_to_clip: found a tuple of 4 values, wanted a matrix that can be inverted"),
    ("rest", "camera: View(\"izo\")", "3:14: camera[0]: found \"izo\", wanted one of front, back, left, right, top, bottom, iso; did you mean \"iso\"?"),
    ("rest", "camera: Perspectiv(eye: (0, 0, 0))", "3:9: camera: found `Perspectiv(…)`, wanted one of View, Perspective, Orthographic, Matrices; did you mean \"Perspective\"?"),
    ("rest", "camera: Perspective(eye: (0, -1, 0), target: (0, 0, 0), fov_y: 180)", "3:64: camera.fov_y: found 180, wanted above 0 and below 180 degrees"),
    ("rest", "camera: Perspective(eye: (0, 0, -1), target: (0, 0, 0), fov_y: 30)", "3:9: camera: found up [0, 0, 1], wanted a direction off the view axis"),
    ("rest", "camera: Orthographic(eye: (0, -1, 0), target: (0, 0, 0))", "3:9: camera.height: found nothing, wanted the height of the view in world units"),
    ("rest", "image: (size: (70000, 70000))", "3:15: image.size: found 70000 × 70000 pixels, wanted at most 268435456 pixels"),
    ("rest", "image: (size: (0, 4))", "3:16: image.size[0]: found 0, wanted a whole number from 1 on"),
    ("rest", "image: (size: (8, 8), viewport: (x: 4, y: 0, width: 5, height: 8))", "3:33: image.viewport: found 5 × 8 pixels from (4, 0), wanted a part of 8 × 8 pixels"),
    ("rest", "image: (background: (0, 0, 0, 2))", "3:31: image.background[3]: found 2, wanted 0 to 1"),
    ("rest", "image: (depth_threshold: 0)", "3:26: image.depth_threshold: found 0, wanted above 0 and at most 1"),
    ("rest", "action: \"nul\"", "3:9: action.name: found \"nul\", wanted a registered action: checked, null, planned; did you mean \"null\"?"),
    ("rest", "action: (name: \"null\", options: {\"threads\": 2})", "3:45: action.options.threads: found a parameter that nobody declares, wanted no parameters, for action \"null\" has none"),
    ("rest", "action: (name: \"planned\", options: {\"of\": \"nul null\"})", "3:43: action.options.of: found \"nul\", wanted a registered action: checked, null, planned; did you mean \"null\"?"),
    ("rest", "action: (name: \"planned\", options: {\"of\": \"null\", \"rmse\": -1})", "3:59: action.options.rmse: found float -1.0, wanted a number above 0"),
    ("rest", "action: (name: \"planned\", options: {\"of\": \"null\", \"threads\": 2})", "3:62: action.options.threads: found a parameter that nobody declares, wanted no parameters, for action \"null\" has none"),
    ("rest", "accuracy: MaxError(0)", "3:20: accuracy[0]: found 0, wanted a positive, finite number"),
    ("rest", "accuracy: Exact(1)", "3:11: accuracy: found `Exact(…)`, wanted MaxError(error) or Rmse(error)"),
    ("rest", "time: Milliseconds(-1)", "3:20: time[0]: found -1, wanted above 0 and at most 1e9"),
    ("rest", "actoin: \"null\"", "3:1: found field `actoin`, wanted version, data, shapes, clip, opaque, camera, image, action, accuracy, time; did you mean \"action\"?"),
    ("rest", "camera: (", "3:11: found the end of the text, wanted `,` or `)`"),
];

#[test]
fn every_problem_has_its_place_and_words() {
    let registry = Registry::with_core();
    assert!(SceneFile::parse_with(&scene("", ""), &registry).is_ok());
    let mut wrong = Vec::new();
    for (part, what, expected) in WRONG {
        let found = match SceneFile::parse_with(&scene(part, what), &registry) {
            Ok(_) => "no problem".to_owned(),
            Err(problems) => problems.to_string(),
        };
        if found != *expected {
            wrong.push(format!("{what}\n  found    {found}\n  expected {expected}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn problems_come_all_at_once_in_the_order_of_the_text() {
    let text = "(version: 3,\n shapes: [\n(shader: \"lit\", parameters: {}),\n(shader: \"lut\", parameters: {\"volume\": 1}, geometri: Around)],\n camera: View(\"x\"))";
    let problems = SceneFile::parse_with(text, &Registry::with_core()).unwrap_err();
    let lines: Vec<_> = problems.problems.iter().map(|p| (p.spot.map_or(0, |s| s.line), p.path.as_str())).collect();
    let expected = [
        (1, "version"),
        (3, "shapes[0]"),
        (3, "shapes[0].shader"),
        (4, "shapes[1].parameters.lookup_table"),
        (4, "shapes[1].parameters.volume"),
        (4, "shapes[1]"),
        (5, "camera[0]"),
    ];
    assert_eq!(lines, expected, "{problems}");
}

#[test]
fn a_shape_without_a_volume_needs_a_geometry() {
    let problem = |text: &str| SceneFile::parse(text).unwrap_err().to_string();
    let text = "(version: 1, shapes: [(shader: \"lut\")])";
    let expected = "1:23: shapes[0]: found a shape without a volume, wanted a parameter with a volume, or a `geometry`";
    assert_eq!(problem(text), expected);
    let text = "(version: 1, shapes: [(shader: \"a\", transform: Placement, geometry: Block(offset: (0,0,0), dimensions: (1,1,1)))])";
    assert!(problem(text).contains("shapes[0].transform: found `Placement` in a shape without a volume"));
}

#[test]
fn two_shapes_need_two_names() {
    let shape = "(name: \"a\", shader: \"s\", geometry: Block(offset: (0,0,0), dimensions: (1,1,1)))";
    let text = format!("(version: 1, shapes: [{shape}, {shape}])");
    let problems = SceneFile::parse(&text).unwrap_err().to_string();
    assert!(problems.ends_with("found a second shape called \"a\", wanted a name of its own for each shape"));
}

#[test]
fn hostile_texts_end_in_errors() {
    let deep = format!("(version: 1, shapes: {}{})", "[".repeat(5000), "]".repeat(5000));
    assert!(SceneFile::parse(&deep).unwrap_err().to_string().contains("brackets 65 deep"));
    let long = format!("(version: 1, data: {{\"{}\": (file: \"x\")}}, shapes: [])", "n".repeat(100_000));
    let message = SceneFile::parse(&long).unwrap_err().to_string();
    assert!(message.len() < 400 && message.contains("a name of 1 to 128 characters"), "{message}");
    let many = format!("(version: 1, shapes: [{}])", "1,".repeat(100_000));
    let problems = SceneFile::parse(&many).unwrap_err().problems;
    assert!(problems.len() < 300 && problems.iter().any(|p| p.found == "99800 more problems"));
    let key = "k".repeat(120);
    let wide: String = (0..20_000).map(|i| format!("\"{key}{i}\": (1,),")).collect();
    let wide = format!("(version: 1, shapes: [(shader: \"lut\", parameters: {{{}}})])", &wide[..900_000]);
    assert!(SceneFile::parse(&wide).is_err());
    assert!(SceneFile::parse("(version: 1, shapes: [], image: (size: (9999999999999999999, 1)))").is_err());
}

#[test]
fn defaults_stated_equal_defaults_left_out() {
    let short = r#"(version: 1, data: {"a": (file: "a")}, shapes: [(shader: "lut", parameters: {
        "volume": Volume(data: "a"), "lookup_table": Table(points: [(0, (0, 0, 0), 0)])})])"#;
    let long = r#"Scene(version: 1, data: {"a": Data(file: "a", loader: None, options: {}, spacing: None, placement: None,
        slope: None, intercept: None, unit: None)},
        shapes: [Shape(name: None, geometry: Around, shader: "lut", transform: None, slices: None, clip: [], parameters: {
        "volume": Volume(data: Some("a"), data_roi: None, geometry_roi: None, range: None, filter: Linear, luminance: false),
        "lookup_table": Table(points: [(value: 0, color: (0, 0, 0), opacity: 0)], pre_interpolated: false)})],
        clip: [], opaque: None, camera: None, image: Image(size: None, viewport: None, background: None, depth_threshold: None), action: None)"#;
    assert_eq!(SceneFile::parse(short).unwrap(), SceneFile::parse(long).unwrap());
}

#[test]
fn everything_can_be_said() {
    let text = include_str!("full_scene.ron");
    let scene = SceneFile::parse(text).unwrap_or_else(|p| panic!("{p}"));
    assert_eq!(scene.shapes.len(), 9);
    let Some(CameraSpec::Camera(Camera::Matrices { view, .. })) = scene.camera else { panic!("{:?}", scene.camera) };
    assert_eq!(view.w_axis.z, -5.0);
    assert_eq!(scene.shapes[1].transform.as_ref().unwrap()[1], TransformStep::Scale(DVec3::splat(2.0)));
    let named = matches!(&scene.shapes[2].geometry, GeometrySpec::Named { name, .. } if name == "block");
    assert!(named);
    let ParameterSpec::Table(table) = &scene.shapes[1].parameters["lookup_table"] else { panic!("a table") };
    assert!(
        table.pre_interpolated && matches!(&table.entries, TableEntries::Entries { values, .. } if values.len() == 2)
    );
    let ParameterSpec::Attribute(attribute) = &scene.shapes[2].parameters["temperature"] else {
        panic!("an attribute")
    };
    assert_eq!(attribute.values, AttributeValues::Inline(vec![1.0, 2.0, 3.0, 4.0]));
    let slices = scene.shapes[3].slices.as_ref().unwrap();
    assert_eq!((slices.planes.len(), slices.style, slices.volume), (2, SliceStyle::Blended, true));
    let clip = &scene.shapes[3].clip;
    assert_eq!(clip.regions().iter().map(|r| r.bounding_planes().len()).collect::<Vec<_>>(), [1, 2, 6, 1]);
    assert_eq!(clip.regions().iter().map(ClipRegion::keeps_inside).collect::<Vec<_>>(), [true, true, true, false]);
    let GeometrySpec::Mesh(mesh) = &scene.shapes[4].geometry else { panic!("a mesh") };
    assert_eq!((mesh.tetrahedra.len(), mesh.pyramids.len(), mesh.wedges.len(), mesh.hexahedra.len()), (1, 1, 1, 1));
    assert!(matches!(&scene.shapes[7].geometry, GeometrySpec::Surface { triangles, .. } if triangles.len() == 1));
    assert!(matches!(&scene.opaque.unwrap().depth, OpaqueDepthSpec::Buffer { range: DepthRange::MinusOneToOne, .. }));
}

#[test]
fn scene_without_data_is_built() {
    let text = r#"(version: 1, shapes: [(name: "box", shader: "lut",
        geometry: Block(offset: (1, 0, 0), dimensions: (1, 2, 4)),
        parameters: {"unit_distance": 2, "volume": Volume(data: "a")},
        transform: [Translate(1, 0, 0), Rotate(axis: (0, 0, 1), degrees: 90), Scale(2)])],
        data: {"a": (file: "nowhere.nrrd")}, camera: View("top"), image: (size: (30, 20)))"#;
    let problems = SceneFile::parse(text).unwrap().build(&Registry::with_core(), Path::new("/nowhere"), &NoProgress);
    let message = problems.unwrap_err().to_string();
    assert!(
        message.starts_with("3:21: shapes[0].parameters.lookup_table: found nothing, wanted lookup table"),
        "{message}"
    );
    let text = text.replace(
        "\"volume\": Volume",
        "\"lookup_table\": WindowLevel(window: 1, level: 0, opacity: 1), \"volume\": Volume",
    );
    let problems = SceneFile::parse(&text).unwrap().build(&Registry::with_core(), Path::new("/nowhere"), &NoProgress);
    let message = problems.unwrap_err().to_string();
    assert!(message.starts_with("5:28: data.a.file: found /nowhere/nowhere.nrrd: cannot be read: "), "{message}");
}

#[test]
fn transform_steps_apply_in_order() {
    let text = r#"(version: 1, shapes: [(name: "box", shader: "none",
        geometry: Block(offset: (0, 0, 0), dimensions: (1, 2, 4)),
        transform: [Translate(1, 0, 0), Rotate(axis: (0, 0, 1), degrees: 90), Scale(2)])])"#;
    let mut scene = SceneFile::parse(text).unwrap();
    let mut registry = Registry::with_core();
    let declaration = volact_core::Declaration::new(volact_core::parameter::Kind::Shader, "none", "1", "nothing");
    registry
        .add_shader(volact_core::ShaderEntry { declaration, compositing: volact_core::Compositing::Over, source: None })
        .unwrap();
    let built: Scene = scene.build(&registry, Path::new(""), &NoProgress).unwrap();
    let transform: DAffine3 = built.shapes[0].state().transform;
    assert!((transform.transform_point3(DVec3::ZERO) - DVec3::new(0.0, 2.0, 0.0)).length() < 1e-12);
    assert_eq!((built.frame.width, built.frame.height), (512, 512));
    scene.camera = Some(CameraSpec::View(View::Front));
    let frame = scene.build(&registry, Path::new(""), &NoProgress).unwrap().frame;
    assert_eq!(frame, built.frame, "the default stated");
    scene.camera = Some(CameraSpec::View(View::Top));
    assert_ne!(scene.build(&registry, Path::new(""), &NoProgress).unwrap().frame.camera, built.frame.camera);
}

/// The stable companion of the fuzz targets: whatever is changed in a good scene, reading ends.
#[test]
fn mutated_scenes_end() {
    let seed = include_str!("full_scene.ron").as_bytes();
    let registry = Registry::with_core();
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut next = |n: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state % n as u64) as usize
    };
    for _ in 0..3000 {
        let mut text = seed.to_vec();
        for _ in 0..=next(4) {
            let at = next(text.len());
            match next(4) {
                0 => text[at] = b"(){}[],:\"'\\0.-#/*NS"[next(19)],
                1 => _ = text.drain(at..(at + next(40)).min(text.len())),
                2 => text.truncate(at),
                _ => {
                    let from = next(seed.len());
                    let part = &seed[from..(from + next(60)).min(seed.len())];
                    text.splice(at..at, part.iter().copied());
                }
            }
            if text.is_empty() {
                break;
            }
        }
        if let Ok(text) = std::str::from_utf8(&text) {
            _ = SceneFile::parse_with(text, &registry);
            _ = volact_core::config::Config::parse(text);
            _ = ParameterSpec::parse(text);
        }
    }
}

/// The examples of the format's document are read as they stand there.
#[test]
fn documented_examples_are_right() {
    let text = include_str!("../../docs/scene-format.md");
    let mut read = 0;
    for block in text.split("```ron\n").skip(1).filter_map(|rest| rest.split("```").next()) {
        let read_as = if block.starts_with("Scene") {
            SceneFile::parse(block).map(|_| ())
        } else if block.starts_with("Config") {
            let config = volact_core::config::Config::parse(block);
            config.map(|config| assert_eq!(config.prefer, volact_core::config::PREFERRED))
        } else {
            // Cameras stand by themselves there, and opaque pictures with their field's name.
            let camera = |line: &str| {
                let field = if line.starts_with("opaque: ") { "" } else { "camera: " };
                SceneFile::parse(&format!("(version: 1, shapes: [], {field}{line}\n)")).map(|_| ())
            };
            let row = "((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))";
            let lines = block.lines().map(|line| line.replace("((…), (…), (…), (…))", row));
            lines.into_iter().try_for_each(|line| camera(&line))
        };
        assert_eq!(read_as.map_err(|p| p.to_string()), Ok(()), "{block}");
        read += 1;
    }
    assert_eq!(read, 4);
}
