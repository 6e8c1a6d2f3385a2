//! What the fuzz targets do: open arbitrary bytes as each format, read volumes whole and by region
//! and meshes whole, and check what must hold of every file that is accepted; `slicing` cuts meshes of arbitrary
//! numbers.
//!
//! Files lie in memory. Formats whose header names other files find `a`, `b` and `c` beside it.

use std::path::Path;

use volact_core::{
    Appearance, Attribute, Buffer, Camera, Clip, ClipRegion, FrameDesc, LoadOptions, LookupTable, Mesh, Plane, Region,
    Registry, ScalarType, Shape, StructuredMesh, Volume,
    geometry::{CellType, CellTypes},
    glam::DVec3,
    loader::NoProgress,
    resolve::ResolvedShape,
    slicing::{Order, Polygons, Rate, Sampling, SamplingMode, SamplingSpace, Slicing, Solid},
};
use volact_files::{Storage, open_in, read_mesh_in};

/// Volumes beyond are opened, but not read.
const READ_LIMIT: usize = 16 << 20;

/// Opens `path` of `storage` and checks the promises of a reader.
fn check(loader: &str, storage: &Storage, path: &str, options: &LoadOptions) {
    let Ok(mut reader) = open_in(storage, loader, Path::new(path), options) else { return };
    let desc = reader.desc().clone();
    desc.validate().expect("an accepted description is valid");
    let bytes = desc.bytes().expect("a valid description has a size");
    if bytes > READ_LIMIT {
        return;
    }
    let Ok(whole) = reader.read(&NoProgress) else { return };
    assert_eq!(whole.len(), bytes);
    let [nx, ny, nz] = desc.dims;
    let region = Region { min: [nx / 3, ny / 2, nz / 3], max: [nx / 2, ny - 1, nz / 2] };
    let part = reader.read_region(region, &NoProgress).expect("a part of what was read can be read");
    let sample = desc.components * desc.scalar.size();
    let mut at = 0;
    for z in region.min[2]..=region.max[2] {
        for y in region.min[1]..=region.max[1] {
            let row = (z * ny + y) * nx;
            let wanted = &whole.bytes()[(row + region.min[0]) * sample..(row + region.max[0] + 1) * sample];
            assert_eq!(&part.bytes()[at..at + wanted.len()], wanted);
            at += wanted.len();
        }
    }
    assert_eq!(at, part.len());
    Volume::new(desc, whole).expect("what was read is a volume");
}

/// Reads `path` of `storage` as a mesh and checks what must hold of it.
fn check_mesh(loader: &str, storage: &Storage, path: &str, options: &LoadOptions) {
    let Ok(data) = read_mesh_in(storage, loader, Path::new(path), options, &NoProgress) else { return };
    let vertices = data.geometry.vertex_count().expect("a mesh from a file knows its vertices");
    for attribute in &data.attributes {
        assert_eq!(attribute.len(), vertices);
        assert_eq!(attribute.data.bytes().as_ptr().addr() % attribute.scalar.size(), 0);
        attribute.value(vertices - 1, attribute.components - 1);
    }
    if let Some(surface) = data.geometry.as_surface() {
        assert!(!surface.triangles().is_empty());
        assert!(surface.triangles().iter().flatten().all(|i| (*i as usize) < vertices));
        assert!(surface.points().iter().all(|p| p.is_finite()));
        assert!(surface.normals().is_none_or(|n| n.len() == vertices && n.iter().all(|n| n.is_finite())));
        return;
    }
    let any = data.geometry.as_any();
    let cells = any.downcast_ref::<Mesh>().map(Mesh::cell_count);
    let cells = cells.or_else(|| any.downcast_ref::<StructuredMesh>().map(|m| m.cells().count()));
    assert!(cells.expect("a mesh is one of these") > 0);
    let bounds = data.geometry.bounds();
    assert!(bounds.min.is_finite() && bounds.max.is_finite());
    let made = data.geometry.tessellate().expect("a mesh that was accepted can be cut");
    assert!(made.tetrahedra.iter().flatten().all(|i| (*i as usize) < made.vertices.len()));
    assert!(made.vertices.len() >= vertices);
}

fn single_mesh(loader: &str, path: &str, data: &[u8]) {
    check_mesh(loader, &Storage::memory([(path, data.to_vec())]), path, &LoadOptions::new());
}

/// A header with the files it may name.
fn with_neighbours(path: &str, data: &[u8]) -> Storage {
    let filler: Vec<u8> = (0..256u32).map(|n| (n * 7) as u8).collect();
    Storage::memory([(path, data.to_vec()), ("a", filler.clone()), ("b", filler.clone()), ("c", filler)])
}

fn single(loader: &str, path: &str, data: &[u8]) {
    check(loader, &with_neighbours(path, data), path, &LoadOptions::new());
}

/// NRRD: the bytes are a header, with its data attached or beside it.
pub fn nrrd(data: &[u8]) {
    single("nrrd", "v.nrrd", data);
}

/// MetaImage: as NRRD.
pub fn metaimage(data: &[u8]) {
    single("metaimage", "v.mha", data);
}

/// NIfTI: one file.
pub fn nifti(data: &[u8]) {
    single("nifti", "v.nii", data);
}

/// TIFF: one file.
pub fn tiff(data: &[u8]) {
    single("tiff", "v.tif", data);
}

/// PNG: one file.
pub fn png(data: &[u8]) {
    single("png", "v.png", data);
}

/// Legacy VTK: one file, its first array and another by name.
pub fn vtk(data: &[u8]) {
    single("vtk", "v.vtk", data);
    let named = LoadOptions::from([("array".to_owned(), "s".into())]);
    check("vtk", &with_neighbours("v.vtk", data), "v.vtk", &named);
}

/// VTK XML: one file.
pub fn vti(data: &[u8]) {
    single("vti", "v.vti", data);
}

/// The RON header of raw files.
pub fn raw(data: &[u8]) {
    single("raw", "v.raw.ron", data);
}

/// DICOM: a folder of one to three files of equal length, read in each of the three ways.
pub fn dicom(data: &[u8]) {
    let Some((first, rest)) = data.split_first() else { return };
    let count = usize::from(first % 3) + 1;
    let size = rest.len() / count;
    let file = |n: usize| (format!("d/{n}.dcm"), rest[n * size..(n + 1) * size].to_vec());
    let storage = Storage::memory((0..count).map(file));
    for option in ["", "resample", "as_stored"] {
        let mut options = LoadOptions::new();
        if !option.is_empty() {
            options.insert(option.to_owned(), true.into());
        }
        check("dicom", &storage, "d", &options);
    }
}

/// VTK XML unstructured grids, structured grids and surfaces, by what the bytes say they are.
pub fn vtk_xml(data: &[u8]) {
    ["vtu", "vts", "vtp"].iter().for_each(|loader| single_mesh(loader, "m.xml", data));
}

/// Legacy VTK meshes and surfaces.
pub fn vtk_mesh(data: &[u8]) {
    single_mesh("vtk-mesh", "m.vtk", data);
}

/// PLOT3D: a grid, and beside it the rest of the bytes as a solution.
pub fn plot3d(data: &[u8]) {
    let Some((head, rest)) = data.split_first_chunk::<2>() else { return };
    let (grid, solution) = rest.split_at(usize::from(u16::from_le_bytes(*head)).min(rest.len()));
    let storage = Storage::memory([("m.xyz", grid.to_vec()), ("m.q", solution.to_vec())]);
    check_mesh("plot3d", &storage, "m.xyz", &LoadOptions::new());
    let one = LoadOptions::from([("block".to_owned(), 1i64.into())]);
    check_mesh("plot3d", &storage, "m.xyz", &one);
}

/// Exodus II, its last time and its first.
pub fn exodus(data: &[u8]) {
    single_mesh("exodus", "m.exo", data);
    let first = LoadOptions::from([("step".to_owned(), 0i64.into())]);
    check_mesh("exodus", &Storage::memory([("m.exo", data.to_vec())]), "m.exo", &first);
}

/// Wavefront OBJ.
pub fn obj(data: &[u8]) {
    single_mesh("obj", "m.obj", data);
}

/// PLY.
pub fn ply(data: &[u8]) {
    single_mesh("ply", "m.ply", data);
}

/// STL.
pub fn stl(data: &[u8]) {
    single_mesh("stl", "m.stl", data);
}

/// The next number of the bytes: small and whole, or any at all.
fn number(data: &mut &[u8]) -> Option<f64> {
    let (kind, rest) = data.split_first()?;
    if kind % 4 != 0 {
        *data = rest;
        return Some(f64::from(*kind as i8) / 8.0);
    }
    let (bits, rest) = rest.split_first_chunk()?;
    *data = rest;
    Some(f64::from_le_bytes(*bits)).filter(|v| v.is_finite())
}

fn vector(data: &mut &[u8]) -> Option<DVec3> {
    Some(DVec3::new(number(data)?, number(data)?, number(data)?))
}

/// A mesh of tetrahedra, an eye, a clip plane and a way of sampling, all of any numbers.
fn scene(data: &mut &[u8]) -> Option<(Shape, FrameDesc, Sampling)> {
    let (setting, rest) = data.split_first()?;
    *data = rest;
    let frame = FrameDesc::new(Camera::perspective(vector(data)?, vector(data)?, DVec3::Z, 40.0), 16, 16);
    let region = ClipRegion::plane(Plane::new(vector(data)?, vector(data)?).ok()?);
    let mut points = Vec::new();
    while let Some(point) = vector(data) {
        points.push(point);
    }
    let cells: Vec<u32> = (3..points.len() as u32).flat_map(|i| [i - 3, i - 2, i - 1, i]).collect();
    let scalars = Attribute::new(
        "t",
        ScalarType::F64,
        3,
        Buffer::from_vec(points.iter().flat_map(|p| p.to_array()).collect::<Vec<f64>>()),
    )
    .ok()?;
    let mesh = Mesh::new(points.into(), CellTypes::All(CellType::Tetrahedron), Buffer::from_vec(cells)).ok()?;
    let appearance = Appearance::new("attribute").with("scalars", scalars).with("unit_distance", 1.0);
    let shape = Shape::new(mesh, appearance.with("lookup_table", LookupTable::grey([0.0, 1.0])));
    shape.set_clip(Clip::new([if setting & 64 == 0 { region } else { region.cut() }]));
    let modes = [SamplingMode::Auto, SamplingMode::AxisAligned, SamplingMode::SphericalShells, SamplingMode::Auto];
    let spaces =
        [SamplingSpace::ViewVolume, SamplingSpace::Object, SamplingSpace::Primitive, SamplingSpace::ViewVolume];
    let sampling = Sampling {
        mode: modes[usize::from(setting & 3)],
        space: spaces[usize::from(setting >> 2 & 3)],
        rate: Rate::Distance(f64::from(setting >> 4 & 3) + 0.25),
        most_planes: Some(64),
    };
    Some((shape, frame, sampling))
}

/// Meshes of any numbers along any planes: no more planes than asked for, and polygons that are whole.
pub fn slicing(mut data: &[u8]) {
    let Some((shape, frame, sampling)) = scene(&mut data) else { return };
    let registry = Registry::with_core();
    let Ok(resolved) = ResolvedShape::new(&shape, registry.shaders()) else { return };
    let Ok(Some(solid)) = Solid::new(&resolved, None) else { return };
    let Ok(slicing) = Slicing::new(vec![&solid], &frame, &sampling) else { return };
    assert!(slicing.step().planes <= 64);
    let mut polygons = Polygons::new();
    let mut sweep = slicing.sweep(Order::BackToFront);
    while let Some(slice) = sweep.next_slice() {
        slice.polygons(&mut polygons);
        for face in polygons.faces() {
            // A quadrilateral cut by the clip plane and by near and far.
            assert!((3..=7).contains(&face.count));
            assert_eq!(polygons.triangles(face).len() as u32, face.count - 2);
            assert!(polygons.vertices(face).all(|v| !v.object.is_nan() && v.attributes.len() == 3));
        }
    }
}
