//! The shared meshes against their oracle: counts, bounds, volumes, ranges and probes, computed by
//! somebody else's code.
//!
//! `VOLACT_DATA` names the folder with `manifest.json`.

use std::{
    collections::BTreeMap,
    env, fs,
    path::{Path, PathBuf},
};

use serde_json::Value;
use volact_core::{
    LoadOptions, MeshData, Points, ScalarType, StructuredMesh,
    geometry::{Mesh, MeshReport},
    loader::{NoProgress, choose, load_mesh},
};

fn data() -> Option<PathBuf> {
    let folder = env::var_os("VOLACT_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("VOLACT_DATA not set: skipped");
    }
    folder
}

fn load(path: &Path) -> MeshData {
    let loaders = volact_files::loaders();
    let loader = choose(&loaders, path).unwrap();
    load_mesh(loader.as_ref(), path, &LoadOptions::new(), &NoProgress).unwrap_or_else(|e| panic!("{e}"))
}

fn manifest(folder: &Path) -> BTreeMap<String, Value> {
    let text = fs::read_to_string(folder.join("manifest.json")).unwrap();
    let all: BTreeMap<String, Value> = serde_json::from_str(&text).unwrap();
    all.into_iter().filter(|(_, entry)| entry["kind"] == "mesh").collect()
}

fn points(mesh: &MeshData) -> &Points {
    let any = mesh.geometry.as_any();
    match any.downcast_ref::<Mesh>() {
        Some(mesh) => mesh.points(),
        None => any.downcast_ref::<StructuredMesh>().unwrap().points(),
    }
}

fn floats(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// Equal to the seven digits that the manifest has.
fn near(found: f64, wanted: f64, what: &str) {
    assert!((found - wanted).abs() <= 2e-6 * wanted.abs() + 1e-12, "{what}: {found} instead of {wanted}");
}

fn scalar(entry: &Value) -> ScalarType {
    match entry.as_str().unwrap() {
        "float32" => ScalarType::F32,
        "float64" => ScalarType::F64,
        other => panic!("the manifest has a new type: {other}"),
    }
}

fn check(name: &str, file: &str, entry: &Value, mesh: &MeshData) {
    let points = points(mesh);
    assert_eq!(points.len() as u64, entry["points"].as_u64().unwrap(), "{name}");
    assert_eq!(points.scalar(), scalar(&entry["point_dtype"]), "{name}");
    let bounds = mesh.geometry.bounds();
    for (found, wanted) in [bounds.min, bounds.max].iter().zip(entry["bounds"].as_array().unwrap()) {
        let off = floats(wanted).iter().zip(found.to_array()).map(|(w, f)| (w - f).abs()).fold(0.0, f64::max);
        assert!(off <= 1e-6 * (bounds.max - bounds.min).length(), "{name}: {found} instead of {wanted}");
    }
    let report = MeshReport::new(mesh.geometry.as_ref()).unwrap();
    let short = |name: &str| name.replace("tetrahedron", "tet").replace("hexahedron", "hex");
    let cells: BTreeMap<_, _> = report.cells.iter().map(|c| (short(c.cell_type.name()), c.count as u64)).collect();
    let wanted = entry["cells"].as_object().unwrap();
    let wanted: BTreeMap<_, _> = wanted.iter().map(|(k, v)| (k.clone(), v.as_u64().unwrap())).collect();
    assert_eq!(cells, wanted, "{name}");
    let volume: f64 = entry["signed_volume"].as_object().unwrap().values().map(|v| v.as_f64().unwrap().abs()).sum();
    // Faces that are not plane enclose another volume when they are cut along a diagonal.
    let slack = if entry["dims"].is_array() { 2e-3 } else { 1e-6 };
    assert!((report.volume / volume - 1.0).abs() < slack, "{name}: {} instead of {volume}", report.volume);
    assert!(mesh.warnings.is_empty(), "{name}/{file}: {:?}", mesh.warnings);
}

fn check_attributes(name: &str, entry: &Value, mesh: &MeshData) {
    let points = points(mesh);
    let wanted = entry["point_scalars"].as_object().unwrap();
    assert_eq!(mesh.attributes.len(), wanted.len(), "{name}: {:?}", mesh.attributes);
    for (attribute, wanted) in wanted {
        let what = format!("{name}/{attribute}");
        let found = mesh.attribute(attribute).unwrap_or_else(|| panic!("{what}: missing"));
        assert_eq!(found.scalar, scalar(&wanted["dtype"]), "{what}");
        assert_eq!(found.components as u64, wanted["components"].as_u64().unwrap(), "{what}");
        assert_eq!(found.len(), points.len(), "{what}");
        let magnitude = wanted["of"] == "magnitude";
        let value = |i: usize| {
            let values = || (0..found.components).map(|c| found.value(i, c));
            if magnitude { values().map(|v| v * v).sum::<f64>().sqrt() } else { found.value(i, 0) }
        };
        let (lo, hi) = (0..found.len()).map(value).fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        near(lo, wanted["min"].as_f64().unwrap(), &what);
        near(hi, wanted["max"].as_f64().unwrap(), &what);
        for probe in wanted["probes"].as_array().unwrap() {
            let point = usize::try_from(probe["point"].as_u64().unwrap()).unwrap();
            for (found, wanted) in points.at(point).to_array().into_iter().zip(floats(&probe["xyz"])) {
                near(found, wanted, &what);
            }
            for (component, wanted) in floats(&probe["value"]).into_iter().enumerate() {
                near(found.value(point, component), wanted, &what);
            }
        }
    }
}

#[test]
fn every_mesh_is_as_its_oracle_says() {
    let Some(folder) = data() else { return };
    let manifest = manifest(&folder);
    assert_eq!(manifest.len(), 5, "meshes in the manifest");
    for (name, entry) in manifest {
        let files = entry["files"].as_object().unwrap().keys();
        let mut known = files.filter(|f| [".vtu", ".vts", ".vtk"].iter().any(|e| f.ends_with(e)));
        let file = known.next_back().unwrap();
        let mesh = load(&folder.join(&name).join(file));
        check(&name, file, &entry, &mesh);
        check_attributes(&name, &entry, &mesh);
    }
}

/// Both files hold the same numbers, so that whatever is drawn of one is drawn of the other.
#[test]
fn structured_grids_equal_their_plot3d_originals() {
    let Some(folder) = data() else { return };
    let pairs = [
        ("blunt_fin_curvilinear", "bluntfinxyz.bin", "blunt_fin.vts"),
        ("combustor_curvilinear", "combxyz.bin", "combustor.vts"),
    ];
    for (name, plot3d, vts) in pairs {
        let original = load(&folder.join(name).join(plot3d));
        let derived = load(&folder.join(name).join(vts));
        check(name, plot3d, &manifest(&folder)[name], &original);
        check_attributes(name, &manifest(&folder)[name], &original);
        assert_eq!(points(&original), points(&derived), "{name}");
        let dims = |mesh: &MeshData| mesh.geometry.as_any().downcast_ref::<StructuredMesh>().unwrap().dims();
        assert_eq!(dims(&original), dims(&derived), "{name}");
        for attribute in &derived.attributes {
            let other = original.attribute(&attribute.name).unwrap();
            assert_eq!(other.data.bytes(), attribute.data.bytes(), "{name}/{}", attribute.name);
        }
    }
}
