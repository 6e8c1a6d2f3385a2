//! Scenes of meshes, from the text to shapes: what is made, and what is said where the data are of
//! another kind or of another size.

use std::{fs, path::Path, sync::Arc};

use volact_core::{
    Attribute, Buffer, CellType, CellTypes, Declaration, FrameDesc, Geometry, LoadError, LoadOptions, Loader, Mesh,
    MeshData, OpaqueDepth, ParameterValue, Points, Progress, Registry, ScalarType, SliceStyle, Surface, VolumeDesc,
    VolumeReader,
    glam::{DAffine3, DMat3, DVec3},
    loader::{Confidence, Content, NoProgress, Probe},
    parameter::Kind,
    scene::{Folders, Scene, SceneFile},
};

/// Reads files whose name it begins with: `mesh…` as one tetrahedron with numbers at its corners,
/// `surface…` as a triangle.
struct Meshes(Declaration);

impl Loader for Meshes {
    fn declaration(&self) -> &Declaration {
        &self.0
    }

    fn probe(&self, probe: &Probe<'_>) -> Confidence {
        let name = probe.file_name();
        if name.starts_with("mesh") || name.starts_with("surface") { Confidence::Content } else { Confidence::No }
    }

    fn content(&self) -> Content {
        Content::Mesh
    }

    fn open(&self, path: &Path, _: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
        Err(LoadError::invalid(path, "content", "a mesh", "no call of open"))
    }

    fn read_mesh(&self, path: &Path, _: &LoadOptions, _: &dyn Progress) -> Result<MeshData, LoadError> {
        let points =
            Points::new(ScalarType::F32, vec![0f32, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.].into()).unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.starts_with("surface") {
            let geometry = Arc::new(Surface::new(points, vec![0u32, 1, 2].into()).unwrap());
            return Ok(MeshData { name, geometry, attributes: Vec::new(), warnings: Vec::new() });
        }
        let types = CellTypes::All(CellType::Tetrahedron);
        let geometry = Arc::new(Mesh::new(points, types, vec![0u32, 1, 2, 3].into()).unwrap());
        let numbers = |name: &str, components: usize| {
            let values: Vec<f32> = (0..4 * components).map(|i| i as f32).collect();
            Attribute::new(name, ScalarType::F32, components, values.into()).unwrap()
        };
        let attributes = vec![numbers("t", 1), numbers("velocity", 3), numbers("pair", 2)];
        Ok(MeshData { name, geometry, attributes, warnings: Vec::new() })
    }
}

/// Reads files whose name begins with `volume` as 2³ voxels a hand's breadth off the origin.
struct Volumes(Declaration);

struct Voxels(VolumeDesc);

impl VolumeReader for Voxels {
    fn desc(&self) -> &VolumeDesc {
        &self.0
    }

    fn read_region(&mut self, _: volact_core::Region, _: &dyn Progress) -> Result<Buffer, LoadError> {
        Ok(vec![0u8, 1, 2, 3, 4, 5, 6, 7].into())
    }
}

impl Loader for Volumes {
    fn declaration(&self) -> &Declaration {
        &self.0
    }

    fn probe(&self, probe: &Probe<'_>) -> Confidence {
        if probe.file_name().starts_with("volume") { Confidence::Content } else { Confidence::No }
    }

    fn open(&self, _: &Path, _: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
        let mut desc = VolumeDesc::new([2, 2, 2], ScalarType::U8, 1);
        desc.placement = DAffine3::from_translation(DVec3::X * 10.0);
        Ok(Box::new(Voxels(desc)))
    }
}

fn registry() -> Registry {
    let mut registry = Registry::with_core();
    let declaration = |name| Declaration::new(Kind::Loader, name, "1", "for tests");
    registry.add_loader(Arc::new(Meshes(declaration("meshes")))).unwrap();
    registry.add_loader(Arc::new(Volumes(declaration("volumes")))).unwrap();
    registry
}

/// A folder with the files that the loaders above know.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["mesh.x", "surface.x", "volume.x"] {
        fs::write(folder.path().join(name), b"x").unwrap();
    }
    folder
}

const DATA: &str = r#"version: 1, data: {"m": (file: "mesh.x"), "s": (file: "surface.x"), "v": (file: "volume.x")}, image: (size: (4, 2))"#;
const LOOK: &str = r#""lookup_table": WindowLevel(window: 2, level: 1, opacity: 0.5), "unit_distance": 1"#;

fn build(folder: &Path, shape: &str, rest: &str) -> Result<Scene, String> {
    let text = format!("({DATA}, shapes: [({shape})], {rest})").replace("LOOK", LOOK);
    let scene = SceneFile::parse_with(&text, &registry()).map_err(|p| p.to_string())?;
    scene.build(&registry(), folder, &NoProgress).map_err(|p| p.to_string())
}

fn geometry(scene: &Scene) -> Arc<dyn Geometry> {
    scene.shapes[0].state().geometry
}

/// All of it is drawable as far as checks go that need no device.
fn manage(scene: &Scene) {
    let mut action = registry().action("null", &Default::default()).unwrap();
    scene.shapes.iter().for_each(|shape| action.manage(shape).unwrap());
    action.begin_draw(&scene.frame).unwrap();
    scene.shapes.iter().for_each(|shape| action.draw(shape).unwrap());
    action.end_draw().unwrap();
}

#[test]
fn a_file_gives_geometry_and_attributes() {
    let folder = folder();
    let shape = r#"geometry: Mesh(data: "m"), shader: "attribute", parameters: {LOOK,
        "scalars": Attribute(data: "m", name: "t"),
        "opacity_scalars": Attribute(data: "m", name: "velocity", component: 1)}"#;
    let scene = build(folder.path(), shape, "").unwrap();
    assert_eq!(geometry(&scene).vertex_count(), Some(4));
    let state = scene.shapes[0].state();
    let ParameterValue::Attribute(opacity) = &state.parameters["opacity_scalars"] else { panic!("an attribute") };
    assert_eq!((opacity.components, opacity.range(0)), (1, Some([1.0, 10.0])));
    manage(&scene);
    // Without a geometry, the mesh of the attribute is meant.
    let short = shape.replace(r#"geometry: Mesh(data: "m"), "#, "");
    assert!(build(folder.path(), &short, "").is_ok_and(|s| geometry(&s).vertex_count() == Some(4)));
}

#[test]
fn a_surface_is_a_geometry_too() {
    let folder = folder();
    for surface in [r#"Mesh(data: "s")"#, "Mesh(points: [(0, 0, 0), (1, 0, 0), (0, 1, 0)], triangles: [[0, 1, 2]])"] {
        let scene = build(folder.path(), &format!(r#"geometry: {surface}, shader: "surface""#), "").unwrap();
        assert_eq!(geometry(&scene).as_surface().unwrap().triangles().len(), 1);
    }
}

#[test]
fn texture_coordinates_come_from_the_file_or_the_scene() {
    let folder = folder();
    let shape = r#"geometry: Mesh(data: "m", texture_coordinates: "velocity"), shader: "lut",
        parameters: {LOOK, "volume": Volume(data: "v")}"#;
    let scene = build(folder.path(), shape, "").unwrap();
    let tessellation = geometry(&scene).tessellate().unwrap();
    assert_eq!(tessellation.texture_coordinates.unwrap().at(1), DVec3::new(3.0, 4.0, 5.0));
    assert_eq!(scene.shapes[0].state().transform.translation, DVec3::X * 10.0, "the volume's place");
    let cube = "[(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1), (1, 1, 2)]";
    let shape = format!(
        r#"geometry: StructuredMesh(dims: (2, 2, 2), points: File("points.f32"), texture_coordinates: {cube}),
        shader: "lut", parameters: {{LOOK, "volume": Volume(data: "v")}}, transform: []"#
    );
    let numbers: Vec<u8> = (0..24).flat_map(|i| ((i % 3 * (i / 3)) as f32).to_le_bytes()).collect();
    fs::write(folder.path().join("points.f32"), &numbers).unwrap();
    let scene = build(folder.path(), &shape, "").unwrap();
    let mesh = geometry(&scene).tessellate().unwrap();
    assert_eq!(
        (mesh.vertices.at(7), mesh.texture_coordinates.unwrap().at(7)),
        (DVec3::new(0.0, 7.0, 14.0), DVec3::new(1.0, 1.0, 2.0))
    );
    fs::write(folder.path().join("points.f32"), &numbers[12..]).unwrap();
    let message = build(folder.path(), &shape, "").unwrap_err();
    assert!(
        message.contains("shapes[0].geometry: found geometry \"structured_mesh\": number of vertices is 7"),
        "{message}"
    );
}

#[test]
fn cells_of_all_types_are_one_mesh() {
    let folder = folder();
    let shape = r#"shader: "lut", parameters: {LOOK, "volume": Volume(data: "v")}, geometry: Mesh(
        points: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1),
            (0.5, 0.5, 2), (2, 0.5, 0), (2, 0.5, 1), (3, 0, 0)],
        pyramids: [[4, 5, 6, 7, 8]], hexahedra: [[0, 1, 2, 3, 4, 5, 6, 7]], wedges: [[1, 2, 9, 5, 6, 10]],
        tetrahedra: [[1, 9, 10, 11]])"#;
    let scene = build(folder.path(), shape, "").unwrap();
    let mesh = geometry(&scene).tessellate().unwrap();
    let volume: f64 = (0..mesh.tetrahedra.len()).map(|t| mesh.volume(t)).sum();
    let exact = 1.0 + 1.0 / 3.0 + 0.5 + mesh.volume(0);
    assert!((volume - exact).abs() < 1e-12, "{volume} {exact}");
}

#[test]
fn slices_and_clips_reach_shape_and_frame() {
    let folder = folder();
    let shape = r#"geometry: Mesh(data: "m"), shader: "attribute",
        parameters: {LOOK, "scalars": Attribute(data: "m", name: "t")},
        slices: (planes: [Plane(point: (0, 0, 0.25), normal: (0, 0, 2))]),
        clip: [Box(min: (0, 0, 0), max: (1, 1, 0.5))]"#;
    let scene = build(folder.path(), shape, "clip: [Cut(Plane(point: (0.5, 0, 0), normal: (1, 0, 0)))]").unwrap();
    let geometry = geometry(&scene);
    let slices = geometry.slices().unwrap();
    assert_eq!((slices.style, slices.volume, slices.planes[0].offset()), (SliceStyle::Opaque, false, 0.25));
    let kept = |p| scene.shapes[0].state().clip.contains(p) && scene.frame.clip.contains(p);
    assert!(kept(DVec3::splat(0.4)) && !kept(DVec3::new(0.6, 0.4, 0.4)) && !kept(DVec3::new(0.4, 0.4, 0.6)));
    manage(&scene);
}

#[test]
fn opaque_pictures_are_read_for_the_pixels_of_the_picture() {
    let folder = folder();
    let shape = r#"shader: "lut", parameters: {LOOK, "volume": Volume(data: "v")}"#;
    let write = |name: &str, n: usize| {
        let numbers: Vec<u8> = (0..n).flat_map(|i| (i as f32 / 32.0).to_le_bytes()).collect();
        fs::write(folder.path().join(name), numbers).unwrap();
    };
    write("color.f32", 32);
    write("depth.f32", 8);
    let opaque = r#"opaque: (color: "color.f32", depth: "depth.f32")"#;
    let frame: FrameDesc = build(folder.path(), shape, opaque).unwrap().frame;
    let found = frame.opaque.unwrap();
    assert_eq!(found.color_at(7), [28.0 / 32.0, 29.0 / 32.0, 30.0 / 32.0, 31.0 / 32.0]);
    assert!(matches!(found.depth, OpaqueDepth::Distance(d) if d[7] == 7.0 / 32.0));
    let buffer = r#"opaque: (depth_buffer: (file: "depth.f32", range: MinusOneToOne,
        world_to_clip: ((1, 0, 0, 0), (0, 1, 0, 0), (0, 0, -1, 3), (0, 0, 0, 1))))"#;
    let frame = build(folder.path(), shape, buffer).unwrap().frame;
    assert!(
        matches!(frame.opaque.unwrap().depth, OpaqueDepth::Buffer { world_to_clip, .. } if world_to_clip.w_axis.z == 3.0)
    );
    write("color.f32", 31);
    write("depth.f32", 9);
    let message = build(folder.path(), shape, opaque).unwrap_err();
    assert!(message.contains("opaque.color: found color.f32: 31 numbers, wanted 32 of little-endian f32"), "{message}");
    assert!(message.contains("opaque.depth: found depth.f32: 9 numbers, wanted 8 of little-endian f32"), "{message}");
    fs::remove_file(folder.path().join("depth.f32")).unwrap();
    assert!(build(folder.path(), shape, opaque).unwrap_err().contains("depth.f32: cannot be read"));
}

/// What is written, and what the message must contain.
#[rustfmt::skip]
const WRONG: &[(&str, &str)] = &[
    (r#"shader: "lut", parameters: {LOOK, "volume": Volume(data: "m")}"#,
        "shapes[0].parameters.volume.data: found \"m\", which is a mesh, wanted data that is a volume; a mesh is used by `Mesh(data: \"m\")`"),
    (r#"shader: "lut", parameters: {LOOK, "volume": Volume(data: "s")}"#,
        "shapes[0].parameters.volume.data: found \"s\", which is a surface, wanted data that is a volume"),
    (r#"shader: "lut", geometry: Mesh(data: "v"), parameters: {LOOK, "volume": Volume(data: "v")}"#,
        "shapes[0].geometry.data: found \"v\", which is a volume, wanted data that is a mesh; a volume is used by `Volume(data: \"v\")`"),
    (r#"shader: "attribute", geometry: Mesh(data: "m"), parameters: {LOOK, "scalars": Attribute(data: "v", name: "t")}"#,
        "shapes[0].parameters.scalars.data: found \"v\", which is a volume, wanted data that is a mesh"),
    (r#"shader: "attribute", geometry: Mesh(data: "m"), parameters: {LOOK, "scalars": Attribute(data: "m", name: "velocty")}"#,
        "shapes[0].parameters.scalars.name: found \"velocty\", wanted an attribute of the file's vertices: t, velocity, pair; did you mean \"velocity\"?"),
    (r#"shader: "attribute", geometry: Mesh(data: "m"), parameters: {LOOK, "scalars": Attribute(data: "s", name: "t")}"#,
        "shapes[0].parameters.scalars.name: found \"t\", wanted an attribute of the file's vertices, which have none"),
    (r#"shader: "attribute", geometry: Mesh(data: "m"), parameters: {LOOK, "scalars": Attribute(data: "m", name: "velocity", component: 3)}"#,
        "shapes[0].parameters.scalars.component: found 3, wanted less than 3, the components of \"velocity\""),
    (r#"shader: "attribute", geometry: Mesh(data: "m"), parameters: {LOOK, "scalars": Attribute(name: "own", values: [1, 2, 3])}"#,
        "shapes[0].parameters.scalars: found attribute \"own\" of 3 vertices, wanted one of 4, the vertices of the shape's geometry"),
    (r#"shader: "lut", geometry: Mesh(data: "m", texture_coordinates: "pair"), parameters: {LOOK, "volume": Volume(data: "v")}"#,
        "shapes[0].geometry.texture_coordinates: found \"pair\" of 2 components, wanted an attribute of 3 components"),
    (r#"shader: "lut", geometry: Mesh(data: "m", texture_coordinates: "place"), parameters: {LOOK, "volume": Volume(data: "v")}"#,
        "shapes[0].geometry.texture_coordinates: found \"place\", wanted an attribute of the file's vertices: t, velocity, pair"),
    (r#"shader: "surface", geometry: Mesh(data: "s"), slices: (planes: [Plane(point: (0, 0, 0), normal: (0, 0, 1))])"#,
        "shapes[0].slices: found geometry \"surface\": slice planes is given, wanted none: a surface holds no volume"),
    (r#"shader: "lut", geometry: StructuredMesh(dims: (2, 2, 2), points: File("none.f32")), parameters: {LOOK, "volume": Volume(data: "v")}"#,
        "shapes[0].geometry.points: found "),
];

#[test]
fn what_is_of_another_kind_is_named() {
    let folder = folder();
    for (shape, expected) in WRONG {
        let message = build(folder.path(), shape, "").map(|_| "no problem").unwrap_err();
        assert!(message.contains(expected), "{message}\n  expected {expected}");
    }
    let text = r#"(version: 1, data: {"m": (file: "mesh.x", spacing: (1, 1, 1))},
        shapes: [(geometry: Mesh(data: "m"), shader: "lut", parameters: {LOOK, "volume": Volume(data: "m")})])"#;
    let scene = SceneFile::parse(&text.replace("LOOK", LOOK)).unwrap();
    let message = scene.build(&registry(), folder.path(), &NoProgress).unwrap_err().to_string();
    let expected =
        "1:52: data.m.spacing: found a spacing, wanted none: the file holds a mesh, and a shape's `transform` moves it";
    assert_eq!(message, expected);
}

#[test]
fn data_folders_are_named_by_whoever_opens_the_scene() {
    let (here, data) = (tempfile::tempdir().unwrap(), folder());
    let text = r#"(version: 1, data: {"m": (file: "$VOLACT_DATA/mesh.x")}, shapes: [(geometry: Mesh(data: "m"),
        shader: "attribute", parameters: {LOOK, "scalars": Attribute(data: "m", name: "t")})])"#;
    let scene = SceneFile::parse(&text.replace("LOOK", LOOK)).unwrap();
    let build = |data| scene.build(&registry(), Folders { base: here.path(), data }, &NoProgress);
    assert!(build(Some(data.path())).is_ok());
    let message = build(None).unwrap_err().to_string();
    assert!(
        message.starts_with("1:33: data.m.file: found \"$VOLACT_DATA/mesh.x\", wanted a folder in place of"),
        "{message}"
    );
}

/// Steps apply from the first to the last, mirrored and sheared ones, too, and give what the
/// product of their matrices gives.
#[test]
fn nested_mirrored_and_sheared_transforms_are_the_product_of_their_steps() {
    let folder = folder();
    let shape = r#"geometry: Mesh(data: "m"), shader: "attribute",
        parameters: {LOOK, "scalars": Attribute(data: "m", name: "t")},
        transform: [Scale(1, -2, 1), Matrix((1, 0.5, 0, 0), (0, 1, 0.25, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
            Rotate(axis: (1, 1, 0), degrees: 40), Translate(3, 0, -1), Scale(-1, 1, 1)]"#;
    let scene = build(folder.path(), shape, "").unwrap();
    let shear = DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.25, 1.0]);
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 1.0, 0.0).normalize(), 40f64.to_radians());
    let transform = scene.shapes[0].state().transform;
    for p in [DVec3::ZERO, DVec3::X, DVec3::new(-2.0, 5.0, 0.5)] {
        let moved = turn * (shear * (p * DVec3::new(1.0, -2.0, 1.0))) + DVec3::new(3.0, 0.0, -1.0);
        let expected = moved * DVec3::new(-1.0, 1.0, 1.0);
        assert!((transform.transform_point3(p) - expected).length() < 1e-12);
    }
    assert!(transform.matrix3.determinant() > 0.0, "mirrored twice");
    manage(&scene);
}

#[test]
fn the_same_file_is_read_once() {
    let folder = folder();
    let shape = r#"geometry: Mesh(data: "m"), shader: "attribute", name: "a",
        parameters: {LOOK, "scalars": Attribute(data: "m", name: "t")}), (geometry: Mesh(data: "m"),
        shader: "attribute", name: "b", parameters: {LOOK, "scalars": Attribute(data: "m", name: "t")}"#;
    let scene = build(folder.path(), shape, "").unwrap();
    let [a, b] = [0, 1].map(|i: usize| scene.shapes[i].state());
    assert!(Arc::ptr_eq(&a.geometry, &b.geometry) && a.parameters["scalars"] == b.parameters["scalars"]);
}
