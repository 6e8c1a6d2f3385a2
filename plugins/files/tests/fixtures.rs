//! Files written by VTK and by netCDF's own library, against what these say is in them.
//!
//! `fixtures/write.py` made them. `VOLACT_FIXTURES` names a folder with more, see there.

use std::{collections::BTreeMap, env, fs, path::PathBuf};

use serde_json::Value;
use volact_core::{
    Geometry, LoadOptions, MeshData, Points, ScalarType, StructuredMesh, Surface, Volume,
    geometry::Mesh,
    loader::{NoProgress, choose, load, load_mesh},
};

fn folders() -> Vec<PathBuf> {
    let own = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    [Some(own), env::var_os("VOLACT_FIXTURES").map(PathBuf::from)].into_iter().flatten().collect()
}

fn expected(folder: &std::path::Path) -> BTreeMap<String, Value> {
    serde_json::from_str(&fs::read_to_string(folder.join("expected.json")).unwrap()).unwrap()
}

fn floats(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Equal but for the digits that a text may leave out.
fn near(found: f64, wanted: f64, what: &str) {
    assert!((found - wanted).abs() <= 1e-6 * wanted.abs().max(1e-3), "{what}: {found} instead of {wanted}");
}

fn points(geometry: &dyn Geometry) -> &Points {
    let any = geometry.as_any();
    let mesh = any.downcast_ref::<Mesh>().map(Mesh::points);
    let structured = || any.downcast_ref::<StructuredMesh>().map(StructuredMesh::points);
    let surface = || any.downcast_ref::<Surface>().map(Surface::points);
    mesh.or_else(structured).or_else(surface).unwrap()
}

/// Every cell's code and corners.
fn cells(geometry: &dyn Geometry) -> Vec<Vec<u64>> {
    let any = geometry.as_any();
    if let Some(mesh) = any.downcast_ref::<Mesh>() {
        let cell = |(_, t, corners): (usize, volact_core::CellType, [u32; 8])| {
            let own = corners[..t.corners()].iter().map(|i| u64::from(*i));
            std::iter::once(u64::from(t as u8)).chain(own).collect()
        };
        return mesh.cells().map(cell).collect();
    }
    let cells = any.downcast_ref::<StructuredMesh>().unwrap().cells();
    cells.map(|c| std::iter::once(12).chain(c.map(u64::from)).collect()).collect()
}

fn area(surface: &Surface) -> f64 {
    let triangle = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| surface.points().at(i as usize));
        (b - a).cross(c - a).length() / 2.0
    };
    surface.triangles().iter().map(triangle).sum()
}

fn check(name: &str, mesh: &MeshData, wanted: &Value) {
    let geometry = mesh.geometry.as_ref();
    // STL has no shared corners, so that they come in another order.
    let ordered = !name.ends_with(".stl");
    if ordered {
        let all = points(geometry);
        let places = wanted["points"].as_array().unwrap();
        let split = name.ends_with(".obj");
        assert!(all.len() == places.len() || split, "{name}: {} points", all.len());
        for (n, place) in places.iter().enumerate().filter(|_| !split) {
            for (found, wanted) in all.at(n).to_array().into_iter().zip(floats(place)) {
                near(found, wanted, &format!("{name}: point {n}"));
            }
        }
    }
    if let Some(surface) = geometry.as_surface() {
        near(area(surface), wanted["area"].as_f64().unwrap(), &format!("{name}: area"));
        let normals = wanted["attributes"].get("Normals");
        if let Some(normals) = normals.filter(|_| ordered && !name.ends_with(".obj")) {
            let found = surface.normals().unwrap_or_else(|| panic!("{name}: no normals"));
            let found: Vec<f64> = found.iter().flat_map(|n| n.to_array()).collect();
            let pairs = found.iter().zip(floats(&normals["values"]));
            pairs.for_each(|(f, w)| near(*f, w, &format!("{name}: normals")));
        }
    } else {
        let found = cells(geometry);
        let wanted: Vec<Vec<u64>> = serde_json::from_value(wanted["cells"].clone()).unwrap();
        assert_eq!(found, wanted, "{name}: cells");
    }
    check_attributes(name, mesh, wanted);
}

fn check_attributes(name: &str, mesh: &MeshData, wanted: &Value) {
    for (attribute, wanted) in wanted["attributes"].as_object().unwrap() {
        if ["Normals", "vtkGhostType"].contains(&attribute.as_str()) || name.ends_with(".stl") || name.ends_with(".obj")
        {
            continue;
        }
        let what = format!("{name}: {attribute}");
        let found = mesh.attribute(attribute).unwrap_or_else(|| panic!("{what} missing: {:?}", mesh.attributes));
        assert_eq!(found.components as u64, wanted["components"].as_u64().unwrap(), "{what}");
        let values = floats(&wanted["values"]);
        assert_eq!(found.len() * found.components, values.len(), "{what}");
        for (n, value) in values.into_iter().enumerate() {
            near(found.value(n / found.components, n % found.components), value, &what);
        }
    }
}

#[test]
fn files_of_other_writers_hold_what_these_say() {
    let loaders = volact_files::loaders();
    let mut checked = 0;
    for folder in folders() {
        for (name, wanted) in expected(&folder) {
            let path = folder.join(&name);
            let loader = choose(&loaders, &path).unwrap();
            assert_eq!(loader.declaration().name, wanted["loader"].as_str().unwrap(), "{name}");
            if name.ends_with(".vti") {
                let volume: Volume = load(loader.as_ref(), &path, &LoadOptions::new(), &NoProgress).unwrap();
                let found = (0..volume.data().len() / 2).map(|n| ScalarType::U16.read(volume.data().bytes(), n));
                assert_eq!(found.collect::<Vec<_>>(), floats(&wanted["values"]), "{name}");
            } else {
                let mesh = load_mesh(loader.as_ref(), &path, &LoadOptions::new(), &NoProgress);
                check(
                    &name,
                    &mesh.unwrap_or_else(|e| panic!("{name}: {e}: {:?}", std::error::Error::source(&e))),
                    &wanted,
                );
            }
            checked += 1;
        }
    }
    assert!(checked >= 39, "{checked} files");
}

fn fixture(name: &str, options: &LoadOptions) -> Result<MeshData, String> {
    let path = folders().remove(0).join(name);
    let loaders = volact_files::loaders();
    let loader = choose(&loaders, &path).unwrap();
    load_mesh(loader.as_ref(), &path, options, &NoProgress).map_err(|e| e.to_string())
}

fn warnings(mesh: &MeshData) -> Vec<&str> {
    mesh.warnings.iter().map(|w| w.message.as_str()).collect()
}

#[test]
fn what_is_left_out_is_named() {
    let mixed = "5 cells without volume are left out: 1 of type 1 (vertex), 1 of type 3 (line), 1 of type 5 (triangle), \
                 1 of type 7 (polygon), 1 of type 9 (quadrilateral)";
    let cells = "cell data are left out: [\"of cells\"]; convert them to point data";
    for name in ["mixed_raw_none_le_h64_i32.vtu", "mixed_51_binary.vtk", "mixed_42_text.vtk"] {
        assert_eq!(warnings(&fixture(name, &LoadOptions::new()).unwrap()), [cells, mixed], "{name}");
    }
    let surface = "2 vertices and lines are left out of the surface";
    for name in ["surface_text_none_le_h32_i64.vtp", "poly_51_binary.vtk", "poly_42_text.vtk"] {
        assert_eq!(warnings(&fixture(name, &LoadOptions::new()).unwrap()), [surface], "{name}");
    }
    let exodus = fixture("mesh_hdf5.exo", &LoadOptions::new()).unwrap();
    let times = "the last of 3 times is read; the option step takes another";
    let elements = "variables of elements are left out: [\"stress\"]";
    assert_eq!(warnings(&exodus), [times, elements, "1 elements without volume are left out: 1 SHELL4"]);
}

#[test]
fn attributes_keep_the_type_of_their_file() {
    let types = |name: &str| {
        let mesh = fixture(name, &LoadOptions::new()).unwrap();
        mesh.attributes.iter().map(|a| (a.name.clone(), a.scalar, a.components)).collect::<Vec<_>>()
    };
    let wanted = [
        ("t", ScalarType::F32, 1),
        ("momentum of it", ScalarType::F64, 3),
        ("mark", ScalarType::U8, 1),
        // 64-bit integers that fit 32.
        ("number", ScalarType::I32, 1),
        ("s", ScalarType::I16, 2),
    ];
    let wanted = wanted.map(|(name, scalar, components)| (name.to_owned(), scalar, components));
    for name in ["mixed_raw_zlib_be_h64_i64.vtu", "mixed_51_text.vtk", "mixed_42_binary.vtk"] {
        let mut found = types(name);
        found.sort_by_key(|(name, ..)| wanted.iter().position(|w| w.0 == *name));
        assert_eq!(found, wanted, "{name}");
    }
}

#[test]
fn exodus_reads_the_time_asked_for() {
    for name in ["mesh_classic.exo", "mesh_offset64.exo", "mesh_hdf5.exo"] {
        for (step, factor) in [(0, 1.0), (1, 2.0), (2, 3.0)] {
            let options = LoadOptions::from([("step".to_owned(), i64::from(step).into())]);
            let mesh = fixture(name, &options).unwrap();
            let (t, p) = (mesh.attribute("t").unwrap(), mesh.attribute("p").unwrap());
            assert_eq!((t.value(3, 0), p.value(3, 0)), (304.5 * factor, 9.0 * factor), "{name} {step}");
            assert_eq!(t.scalar, ScalarType::F64);
        }
        let options = LoadOptions::from([("step".to_owned(), 3i64.into())]);
        let error = fixture(name, &options).unwrap_err();
        assert!(error.ends_with("option step is 3, wanted below 3"), "{error}");
    }
}

/// Five of six hexahedra are left: one has a corner that is blanked, one is itself.
#[test]
fn blanked_points_and_cells_are_left_out() {
    let mesh = fixture("blanked.vts", &LoadOptions::new()).unwrap();
    assert_eq!(cells(mesh.geometry.as_ref()).len(), 4);
}
