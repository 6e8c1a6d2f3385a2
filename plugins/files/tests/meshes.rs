//! Meshes and surfaces written by the tests' own writers, read back.

mod mesh_samples;

use std::{path::Path, sync::Mutex};

use mesh_samples::{Block, Plot3d, Spec, Xml, block, ply, small, stl_binary, stl_text, tetrahedron, vtk, vtu};
use proptest::prelude::*;
use volact_core::{
    LoadError, LoadOptions, MeshData, Points, Progress, ScalarType, StructuredMesh, Surface,
    geometry::Mesh,
    loader::{Confidence, NoProgress, Probe},
};
use volact_files::{Storage, loaders, read_mesh_in};

fn load(loader: &str, path: &str, files: Vec<(&str, Vec<u8>)>) -> MeshData {
    load_with(loader, path, files, &LoadOptions::new()).unwrap_or_else(|e| panic!("{loader}: {e}"))
}

fn load_with(
    loader: &str,
    path: &str,
    files: Vec<(&str, Vec<u8>)>,
    options: &LoadOptions,
) -> Result<MeshData, LoadError> {
    read_mesh_in(&Storage::memory(files), loader, Path::new(path), options, &NoProgress)
}

fn mesh(data: &MeshData) -> &Mesh {
    data.geometry.as_any().downcast_ref().unwrap()
}

fn surface(data: &MeshData) -> &Surface {
    data.geometry.as_surface().unwrap()
}

fn places(points: &Points) -> Vec<[f64; 3]> {
    points.iter().map(|p| p.to_array()).collect()
}

fn messages(data: &MeshData) -> Vec<&str> {
    data.warnings.iter().map(|w| w.message.as_str()).collect()
}

/// Any mesh whose indices are right, cells of any type that has volume or none.
fn spec() -> impl Strategy<Value = Spec> {
    let number = prop_oneof![-1e3f32..1e3, Just(0.0), Just(1e-30), Just(-7.25e20)];
    (1usize..40).prop_flat_map(move |count| {
        let corner = 0..count as u32;
        let cell = prop_oneof![
            (Just(10u8), prop::collection::vec(corner.clone(), 4)),
            (Just(12u8), prop::collection::vec(corner.clone(), 8)),
            (Just(13u8), prop::collection::vec(corner.clone(), 6)),
            (Just(14u8), prop::collection::vec(corner.clone(), 5)),
            (Just(11u8), prop::collection::vec(corner.clone(), 8)),
            (Just(9u8), prop::collection::vec(corner.clone(), 4)),
            (Just(7u8), prop::collection::vec(corner, 3..9)),
        ];
        let values = |n: usize| prop::collection::vec(number.clone(), n);
        let points = prop::collection::vec(prop::array::uniform3(number.clone()), count);
        (points, prop::collection::vec(cell, 1..30), values(count), values(3 * count)).prop_map(
            |(points, cells, scalar, vector)| Spec {
                points,
                cells,
                attributes: vec![("t %".into(), 1, scalar), ("v".into(), 3, vector)],
            },
        )
    })
}

fn settings() -> impl Strategy<Value = Xml> {
    let flags = (any::<bool>(), any::<bool>(), any::<bool>());
    (0usize..4, 0usize..3, flags, 1usize..200).prop_map(|(mode, compressor, (big, wide_header, wide_ids), block)| Xml {
        mode,
        compressor,
        big,
        wide_header,
        wide_ids,
        block,
    })
}

fn same(spec: &Spec, read: Result<MeshData, LoadError>) {
    let kept = |(t, c): &(u8, Vec<u32>)| match t {
        7 | 9 => None,
        11 => Some((12, [0, 1, 3, 2, 4, 5, 7, 6].iter().map(|i| c[*i]).collect())),
        _ => Some((*t, c.clone())),
    };
    let wanted: Vec<(u8, Vec<u32>)> = spec.cells.iter().filter_map(kept).collect();
    if wanted.is_empty() {
        let error = read.unwrap_err().to_string();
        let what = format!("number of cells that hold volume (of {}) is 0, wanted at least 1", spec.cells.len());
        assert!(error.ends_with(&what), "{error}");
        return;
    }
    let read = read.unwrap();
    let points = mesh(&read).points();
    assert_eq!(points.scalar(), ScalarType::F32);
    assert_eq!(places(points), spec.points.iter().map(|p| p.map(f64::from)).collect::<Vec<_>>());
    let cells: Vec<_> = mesh(&read).cells().map(|(_, t, c)| (t as u8, c[..t.corners()].to_vec())).collect();
    assert_eq!(cells, wanted);
    assert_eq!(read.attributes.len(), spec.attributes.len());
    for (found, (name, components, values)) in read.attributes.iter().zip(&spec.attributes) {
        assert_eq!((&found.name, found.components, found.scalar), (name, *components, ScalarType::F32));
        assert_eq!(found.data.as_slice::<f32>().unwrap(), values);
    }
    assert_eq!(read.warnings.len(), usize::from(wanted.len() < spec.cells.len()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn unstructured_xml_grids_come_back(spec in spec(), settings in settings()) {
        let spec = Spec { attributes: spec.attributes.into_iter().map(|(n, c, v)| (n.replace('%', "&lt;"), c, v)).collect(), ..spec };
        let file = vtu(&spec, settings);
        let named = Spec { attributes: spec.attributes.iter().map(|(n, c, v)| (n.replace("&lt;", "<"), *c, v.clone())).collect(), ..spec.clone() };
        same(&named, load_with("vtu", "m.vtu", vec![("m.vtu", file)], &LoadOptions::new()));
    }

    #[test]
    fn unstructured_legacy_grids_come_back(spec in spec(), text: bool, offsets: bool) {
        let file = vtk(&spec, text, offsets);
        same(&spec, load_with("vtk-mesh", "m.vtk", vec![("m.vtk", file)], &LoadOptions::new()));
    }

    #[test]
    fn plot3d_grids_come_back(
        dims in prop::collection::vec(prop::array::uniform3(2u32..5), 1..4),
        flags in prop::collection::vec(-1i32..3, 64),
        (big, records, multi, double, iblank) in any::<(bool, bool, bool, bool, bool)>(),
        function: bool,
    ) {
        let layout = Plot3d { big, records, multi, double, iblank };
        let mut blocks: Vec<Block> = dims.iter().enumerate().map(|(n, d)| block(*d, 10.0 * n as f32)).collect();
        if !multi {
            blocks.truncate(1);
        }
        for (_, points, visible) in &mut blocks {
            *visible = flags.iter().cycle().take(points.len()).copied().collect();
        }
        let value = |n: usize, v: usize, k: usize| (1000 * n + 10 * v + k) as f32;
        let data = if function { layout.function(&blocks, 3, value) } else { layout.solution(&blocks, value) };
        let beside = if function { "m.f" } else { "m.q" };
        let files = vec![("m.xyz", layout.grid(&blocks)), (beside, data)];
        check_plot3d(&blocks, layout, function, load_with("plot3d", "m.xyz", files, &LoadOptions::new()));
    }
}

fn check_plot3d(blocks: &[Block], layout: Plot3d, function: bool, read: Result<MeshData, LoadError>) {
    let mut cells = Vec::new();
    let mut first = 0;
    for (dims, points, flags) in blocks {
        let [nx, ny, nz] = *dims;
        let at = |x: u32, y: u32, z: u32| (z * ny + y) * nx + x;
        for (z, y, x) in (0..nz - 1).flat_map(|z| (0..ny - 1).flat_map(move |y| (0..nx - 1).map(move |x| (z, y, x)))) {
            let ring = |z| [at(x, y, z), at(x + 1, y, z), at(x + 1, y + 1, z), at(x, y + 1, z)];
            let corners: Vec<u32> = [ring(z), ring(z + 1)].concat();
            if !layout.iblank || corners.iter().all(|&i| flags[i as usize] != 0) {
                cells.push(corners.iter().map(|i| i + first).collect::<Vec<_>>());
            }
        }
        first += points.len() as u32;
    }
    if cells.is_empty() {
        let error = read.unwrap_err().to_string();
        assert_eq!(error, "m.xyz: number of cells that are not blanked is 0, wanted at least 1");
        return;
    }
    let read = read.unwrap();
    let any = read.geometry.as_any();
    let (points, found): (&Points, Vec<Vec<u32>>) = match any.downcast_ref::<StructuredMesh>() {
        Some(mesh) => (mesh.points(), mesh.cells().map(|c| c.to_vec()).collect()),
        None => (mesh(&read).points(), mesh(&read).cells().map(|(_, _, c)| c.to_vec()).collect()),
    };
    assert_eq!(found, cells);
    let wanted: Vec<_> = blocks.iter().flat_map(|(_, points, _)| points).map(|p| p.map(f64::from)).collect();
    assert_eq!(places(points), wanted);
    let variables: &[(&str, usize, usize)] = if function {
        &[("f0", 0, 1), ("f1", 1, 1), ("f2", 2, 1)]
    } else {
        &[("density", 0, 1), ("momentum", 1, 3), ("energy", 4, 1)]
    };
    assert_eq!(read.attributes.len(), 3);
    for (name, start, components) in variables {
        let attribute = read.attribute(name).unwrap();
        assert_eq!(attribute.scalar, if layout.double { ScalarType::F64 } else { ScalarType::F32 });
        let mut at = 0;
        for (n, (_, points, _)) in blocks.iter().enumerate() {
            for v in 0..points.len() {
                for c in 0..*components {
                    assert_eq!(attribute.value(at + v, c), (1000 * n + 10 * v + start + c) as f64);
                }
            }
            at += points.len();
        }
    }
}

#[test]
fn block_of_several_is_picked() {
    let layout = Plot3d { big: false, records: true, multi: true, double: false, iblank: false };
    let blocks = [block([3, 2, 2], 0.0), block([2, 3, 4], 5.0)];
    let q = layout.solution(&blocks, |n, v, _| (100 * n + v) as f32);
    let files = vec![("a/g.x", layout.grid(&blocks)), ("a/other.sol", q)];
    let options = |block: i64| LoadOptions::from([("block".into(), block.into()), ("q".into(), "other.sol".into())]);
    let read = load_with("plot3d", "a/g.x", files.clone(), &options(1)).unwrap();
    let mesh: &StructuredMesh = read.geometry.as_any().downcast_ref().unwrap();
    assert_eq!((mesh.dims(), mesh.points().at(0).x), ([2, 3, 4], 5.0));
    assert_eq!(read.attribute("density").unwrap().value(23, 0), 123.0);
    let error = load_with("plot3d", "a/g.x", files, &options(2)).unwrap_err().to_string();
    assert_eq!(error, "a/g.x: option block is 2, wanted below 2");
}

/// Blocks that touch are one mesh: their common vertices are joined, so that they split their
/// common faces alike.
#[test]
fn blocks_that_touch_are_joined() {
    let layout = Plot3d { big: true, records: false, multi: true, double: true, iblank: false };
    let mut second = block([2, 3, 2], 2.0);
    // The slope of `block` starts anew; make it go on.
    second.1.iter_mut().for_each(|p| p[1] += 0.2);
    let blocks = [block([3, 3, 2], 0.0), second];
    let read = load("plot3d", "m.xyz", vec![("m.xyz", layout.grid(&blocks))]);
    let mesh = mesh(&read);
    assert_eq!((mesh.points().len(), mesh.cell_count()), (30, 6));
    let report = volact_core::geometry::MeshReport::new(mesh).unwrap();
    // A box of 3 x 2 x 1 cells has 22 outer faces.
    assert_eq!((report.boundary_faces, report.overlapping_faces, report.non_manifold_edges), (44, 0, 0));
}

#[test]
fn solutions_that_do_not_fit_are_named() {
    let layout = Plot3d { big: false, records: false, multi: false, double: false, iblank: false };
    let grid = layout.grid(&[block([3, 2, 2], 0.0)]);
    let other = layout.solution(&[block([3, 2, 3], 0.0)], |_, _, _| 1.0);
    let files = vec![("m.xyz", grid), ("m.q", other)];
    let read = load("plot3d", "m.xyz", files.clone());
    assert_eq!(messages(&read), ["m.q is not read: it is no solution or function file for [3, 2, 2]"]);
    let options = LoadOptions::from([("q".into(), "m.q".into())]);
    let error = load_with("plot3d", "m.xyz", files, &options).unwrap_err().to_string();
    assert!(
        error.starts_with("m.q: content is ") && error.ends_with("a solution or function file for [3, 2, 2]"),
        "{error}"
    );
}

/// A grid padded to whole blocks of a tape is read where all is said about it.
#[test]
fn layout_named_in_full_may_leave_bytes_over() {
    let layout = Plot3d { big: true, records: false, multi: false, double: false, iblank: false };
    let mut grid = layout.grid(&[block([3, 2, 2], 0.0)]);
    grid.extend([0; 100]);
    let files = vec![("m.xyz", grid)];
    assert!(load_with("plot3d", "m.xyz", files.clone(), &LoadOptions::new()).is_err());
    let mut options = LoadOptions::from([("byte_order".into(), "big".into()), ("precision".into(), "single".into())]);
    options.extend(["records", "multi", "iblank"].map(|name| (name.to_owned(), false.into())));
    let read = load_with("plot3d", "m.xyz", files, &options).unwrap();
    assert_eq!(messages(&read), ["100 bytes after the grid are not read"]);
}

#[test]
fn arrays_in_several_pieces_become_one_mesh() {
    let settings = Xml { mode: 0, compressor: 0, big: false, wide_header: false, wide_ids: true, block: 1 };
    let piece = |shift: f32| {
        let mut spec = small();
        spec.points.iter_mut().for_each(|p| p[0] += shift);
        spec.attributes[0].2.iter_mut().for_each(|v| *v += shift);
        String::from_utf8(vtu(&spec, settings)).unwrap()
    };
    let (first, second) = (piece(0.0), piece(1.0));
    let part = &second[second.find("<Piece").unwrap()..second.find("</UnstructuredGrid>").unwrap()];
    let both = first.replace("</UnstructuredGrid>", &format!("{part}</UnstructuredGrid>"));
    let read = load("vtu", "m.vtu", vec![("m.vtu", both.into())]);
    let all = mesh(&read);
    assert_eq!((all.points().len(), all.cell_count()), (16, 6));
    // Vertex 0 of the second piece lies where vertex 1 of the first does.
    let corners: Vec<_> = all.cells().map(|(_, t, c)| c[..t.corners()].to_vec()).collect();
    assert_eq!(corners[3], [1, 9, 3, 5]);
    assert_eq!(read.attribute("s").unwrap().value(8, 0), 0.0);
}

/// Parallel programs write pieces for processes that have nothing.
#[test]
fn empty_pieces_are_passed_over() {
    let empty = Spec {
        attributes: small().attributes.into_iter().map(|(name, n, _)| (name, n, Vec::new())).collect(),
        ..Spec::default()
    };
    for compressor in [0, 1, 2] {
        let settings = Xml { mode: 1, compressor, big: true, wide_header: true, wide_ids: true, block: 32 };
        let text = |spec: &Spec| String::from_utf8(vtu(spec, settings)).unwrap();
        let (whole, nothing) = (text(&small()), text(&empty));
        let part = &nothing[nothing.find("<Piece").unwrap()..nothing.find("</UnstructuredGrid>").unwrap()];
        let both = whole.replace("<UnstructuredGrid>", &format!("<UnstructuredGrid>{part}"));
        let read = load("vtu", "m.vtu", vec![("m.vtu", both.into())]);
        assert_eq!((mesh(&read).points().len(), mesh(&read).cell_count()), (8, 3));
        assert_eq!(read.attributes.len(), 2);
        let error = load_with("vtu", "m.vtu", vec![("m.vtu", nothing.into())], &LoadOptions::new()).unwrap_err();
        let wanted = "m.vtu: number of cells that hold volume (of 0) is 0, wanted at least 1";
        assert_eq!(error.to_string(), wanted);
    }
}

#[test]
fn obj_faces_keep_their_normals_and_flat_ones_get_their_own() {
    let read = load("obj", "m.obj", vec![("m.obj", mesh_samples::OBJ.into())]);
    let surface = surface(&read);
    assert_eq!(surface.triangles().len(), 6);
    let normals = surface.normals().unwrap();
    for (n, triangle) in surface.triangles().iter().enumerate() {
        let [a, b, c] = triangle.map(|i| surface.points().at(i as usize));
        let flat = (b - a).cross(c - a).normalize();
        for corner in triangle {
            let normal = normals.at(*corner as usize);
            assert!((normal - flat).length() < 1e-12, "triangle {n}: {normal} instead of {flat}");
        }
    }
    assert_eq!(messages(&read), ["statements are left out: 1 \"curv\", 1 \"l\", 1 \"p\""]);
    let plain = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\nf 1 3 2\n";
    let read = load("obj", "m.obj", vec![("m.obj", plain.into())]);
    assert_eq!(read.attribute("color").unwrap().value(1, 1), 1.0);
    assert!(read.geometry.as_surface().unwrap().normals().is_none());
    assert_eq!(read.geometry.vertex_count(), Some(3));
}

#[test]
fn ply_is_the_same_in_every_encoding() {
    for encoding in ["ascii", "binary_little_endian", "binary_big_endian"] {
        let read = load("ply", "m.ply", vec![("m.ply", ply(encoding))]);
        let surface = surface(&read);
        assert_eq!(surface.points().at(3).to_array(), [0.25, 0.25, 2.0], "{encoding}");
        assert_eq!(surface.points().scalar(), ScalarType::F32);
        assert_eq!(surface.normals().unwrap().at(2).z, f64::from(1.6f32));
        assert_eq!(surface.triangles(), [[0, 2, 1], [0, 1, 3], [1, 2, 0], [1, 0, 3]], "{encoding}");
        let types: Vec<_> = read.attributes.iter().map(|a| (a.name.as_str(), a.scalar)).collect();
        assert_eq!(types, [("red", ScalarType::U8), ("level", ScalarType::I16)]);
        assert_eq!((read.attributes[0].value(3, 0), read.attributes[1].value(3, 0)), (240.0, -900.0));
        let lists = "the lists \"weights\" of vertices are left out";
        let faces = "numbers of faces are left out: [\"quality\"]";
        assert_eq!(messages(&read), [lists, faces, "1 elements \"edge\" are left out"]);
    }
}

#[test]
fn stl_welds_corners_in_every_form() {
    let triangles = tetrahedron();
    let two = [stl_text(&triangles[..2], "one"), stl_text(&triangles[2..], "two")].concat();
    let shouted = String::from_utf8(stl_text(&triangles, "x")).unwrap().to_uppercase();
    let forms = [
        stl_binary(&triangles, "any head"),
        stl_binary(&triangles, "solid in name only"),
        stl_text(&triangles, "a b c"),
        stl_text(&triangles, ""),
        two,
        shouted.into_bytes(),
    ];
    for (n, file) in forms.into_iter().enumerate() {
        let read = load("stl", "m.stl", vec![("m.stl", file)]);
        let surface = surface(&read);
        assert_eq!(surface.points().len(), 4, "form {n}");
        let found: Vec<_> = surface
            .triangles()
            .iter()
            .map(|t| t.map(|i| surface.points().at(i as usize).as_vec3().to_array()))
            .collect();
        assert_eq!(found, triangles, "form {n}");
        assert_eq!(messages(&read), [""; 0], "form {n}");
    }
    let mut cut = stl_text(&triangles, "");
    cut.truncate(cut.len() - 10);
    let read = load("stl", "m.stl", vec![("m.stl", cut)]);
    assert_eq!(messages(&read), ["the last solid has no end: the file may be cut"]);
}

struct Counting {
    seen: Mutex<Vec<(u64, u64)>>,
    stop: bool,
}

impl Progress for Counting {
    fn advance(&self, done: u64, total: u64) -> bool {
        self.seen.lock().unwrap().push((done, total));
        !self.stop
    }
}

#[test]
fn progress_ends_at_the_total_and_stops_on_request() {
    for (loader, path, files) in mesh_samples::all() {
        let total = files[0].1.len() as u64;
        let storage = Storage::memory(files);
        let read = |progress: &Counting| read_mesh_in(&storage, loader, Path::new(path), &LoadOptions::new(), progress);
        let progress = Counting { seen: Mutex::default(), stop: false };
        read(&progress).unwrap();
        let seen = progress.seen.into_inner().unwrap();
        assert_eq!(seen.last(), Some(&(total, total)), "{loader}");
        assert!(seen.is_sorted(), "{loader}: {seen:?}");
        let stopping = Counting { seen: Mutex::default(), stop: true };
        let error = read(&stopping).unwrap_err();
        assert!(matches!(error, LoadError::Stopped { .. }), "{loader}: {error}");
    }
}

/// Every sample is known by its content or its name, and by one loader only.
#[test]
fn each_file_is_claimed_by_its_loader_alone() {
    for (loader, path, files) in mesh_samples::all() {
        let probe = Probe { path: Path::new(path), head: &files[0].1[..files[0].1.len().min(4096)], is_dir: false };
        let sure = |l: &std::sync::Arc<dyn volact_core::Loader>| l.probe(&probe);
        let mut claims: Vec<_> = loaders().iter().map(|l| (sure(l), l.declaration().name.clone())).collect();
        claims.retain(|(confidence, _)| *confidence != Confidence::No);
        let names: Vec<_> = claims.iter().map(|(_, name)| name.as_str()).collect();
        assert_eq!(names, [loader], "{path}");
    }
    let volume = b"# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\n";
    let probe = Probe { path: Path::new("v.vtk"), head: volume, is_dir: false };
    let claims: Vec<_> =
        loaders().iter().filter(|l| l.probe(&probe) != Confidence::No).map(|l| l.declaration().name.clone()).collect();
    assert_eq!(claims, ["vtk"]);
}

/// Raw arrays of at least 1 MiB, aligned and in native order, are mapped and not copied: the file
/// shows among the process's mappings while the mesh lives.
#[test]
#[cfg(target_os = "linux")]
fn large_raw_arrays_on_disk_are_mapped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mapped-mesh.vtu");
    let count = 1usize << 19;
    let spec = Spec {
        points: (0..count).map(|i| [i as f32, (i * i) as f32, 1.0]).collect(),
        cells: vec![(10, vec![0, 1, 2, 4])],
        attributes: vec![("s".into(), 1, (0..count).map(|i| i as f32).collect())],
    };
    let big = cfg!(target_endian = "big");
    let settings = Xml { mode: 2, compressor: 0, big, wide_header: false, wide_ids: false, block: 1 };
    let file = vtu(&spec, settings);
    // The first array begins four bytes after the underscore; blanks before it align it.
    let at = file.windows(4).position(|w| w == b"   _").unwrap();
    let blanks = vec![b' '; (4 - (at + 4) % 4) % 4];
    let file = [&file[..at], &blanks, &file[at..]].concat();
    std::fs::write(&path, &file).unwrap();
    let mapped = || std::fs::read_to_string("/proc/self/maps").unwrap().contains("mapped-mesh.vtu");
    let read = volact_core::loader::load_mesh(
        loaders().iter().find(|l| l.declaration().name == "vtu").unwrap().as_ref(),
        &path,
        &LoadOptions::new(),
        &NoProgress,
    )
    .unwrap();
    assert_eq!(read.attribute("s").unwrap().data.as_slice::<f32>().unwrap(), spec.attributes[0].2);
    assert_eq!(mesh(&read).points().at(7).y, 49.0);
    assert!(mapped());
    drop(read);
    assert!(!mapped());
}
