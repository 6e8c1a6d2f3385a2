//! Damaged meshes: every sample and fixture with bits flipped, bytes replaced, inserted and cut.
//! Nothing may panic, hang, or give a mesh that contradicts itself.
//!
//! The same check as in `fuzz/`, without its tools: a fixed seed, a few seconds.

mod mesh_samples;

use std::{fs, path::Path, time::Instant};

use volact_core::{
    Geometry, LoadOptions, MeshData,
    geometry::{Mesh, StructuredMesh},
    loader::{NoProgress, Probe},
};
use volact_files::{Storage, loaders, read_mesh_in};

/// Loader, path and files.
type Sample = (String, String, Vec<(String, Vec<u8>)>);

fn samples() -> Vec<Sample> {
    let own = mesh_samples::all().into_iter().map(|(loader, path, files)| {
        (loader.to_owned(), path.to_owned(), files.into_iter().map(|(p, b)| (p.to_owned(), b)).collect())
    });
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let mut names: Vec<_> = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    let fixtures = names.into_iter().filter_map(|name| {
        let (name, bytes) = (name.to_string_lossy().into_owned(), fs::read(folder.join(&name)).unwrap());
        let probe = Probe { path: Path::new(&name), head: &bytes[..bytes.len().min(4096)], is_dir: false };
        let sure = loaders().into_iter().max_by_key(|l| l.probe(&probe)).unwrap();
        let skip = [".json", ".py", ".vti"].iter().any(|end| name.ends_with(end));
        (!skip).then(|| (sure.declaration().name.clone(), name.clone(), vec![(name, bytes)]))
    });
    own.chain(fixtures).collect()
}

/// A small generator of numbers that never changes: xorshift64*.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % limit.max(1)
    }
}

fn damage(bytes: &mut Vec<u8>, numbers: &mut Numbers) {
    let at = numbers.below(bytes.len());
    match numbers.below(7) {
        0 => bytes[at] ^= 1 << numbers.below(8),
        1 => bytes[at] = numbers.below(256) as u8,
        2 => bytes[at] = [0, 0xff, 0x7f, 0x80, b'9', b'-', b' ', b'\n'][numbers.below(8)],
        3 => bytes.truncate(at),
        4 => bytes.insert(at, b"0123456789-\n %"[numbers.below(14)]),
        5 => {
            let end = (at + 1 + numbers.below(8)).min(bytes.len());
            bytes.drain(at..end);
        }
        _ => {
            let end = (at + 4).min(bytes.len());
            let fill = [0, 0xff][numbers.below(2)];
            bytes[at..end].fill(fill);
        }
    }
}

/// What must hold of every mesh that is accepted.
fn check(data: &MeshData, what: &str) {
    let vertices = data.geometry.vertex_count().unwrap();
    for attribute in &data.attributes {
        assert_eq!(attribute.len(), vertices, "{what}: {}", attribute.name);
    }
    if let Some(surface) = data.geometry.as_surface() {
        assert!(surface.triangles().iter().flatten().all(|i| (*i as usize) < vertices), "{what}");
        assert!(surface.points().iter().all(|p| p.is_finite()), "{what}");
        return;
    }
    let any = data.geometry.as_any();
    let cells = any.downcast_ref::<Mesh>().map(Mesh::cell_count);
    let cells = cells.or_else(|| any.downcast_ref::<StructuredMesh>().map(|m| m.cells().count()));
    assert!(cells.unwrap() > 0, "{what}");
    let made = data.geometry.tessellate().unwrap();
    assert!(made.tetrahedra.iter().flatten().all(|i| (*i as usize) < made.vertices.len()), "{what}");
    assert!(made.vertices.iter().all(|p| p.is_finite()), "{what}");
}

fn read(loader: &str, path: &str, files: &[(String, Vec<u8>)]) -> Option<MeshData> {
    let storage = Storage::memory(files.to_vec());
    read_mesh_in(&storage, loader, Path::new(path), &LoadOptions::new(), &NoProgress).ok()
}

#[test]
fn damaged_files_are_errors_or_meshes() {
    let mut numbers = Numbers(0x5eed_0f01_ac70_0003);
    let (mut accepted, mut refused) = (0, 0);
    for (loader, path, files) in samples() {
        for _ in 0..150 {
            let mut files = files.clone();
            let index = numbers.below(files.len());
            for _ in 0..=numbers.below(3) {
                if !files[index].1.is_empty() {
                    damage(&mut files[index].1, &mut numbers);
                }
            }
            let start = Instant::now();
            match read(&loader, &path, &files) {
                Some(data) => {
                    check(&data, &format!("{loader} {path}"));
                    accepted += 1;
                }
                None => refused += 1,
            }
            assert!(start.elapsed().as_secs() < 5, "{path}: slow");
        }
    }
    // Both must happen, or the damage misses what it is for.
    assert!(accepted > 1000 && refused > 1000, "{accepted} accepted, {refused} refused");
}

/// Every sample cut at every byte: what is accepted has the same vertices and cells. What legacy
/// files, OBJ and solids of STL have after them cannot be missed, since they do not say that it is
/// there.
#[test]
fn truncated_files_never_give_another_mesh() {
    for (loader, path, files) in samples() {
        let whole = read(&loader, &path, &files).unwrap_or_else(|| panic!("{path}"));
        let step = (files[0].1.len() / 2000).max(1);
        for length in (0..files[0].1.len()).step_by(step) {
            let mut files = files.clone();
            files[0].1.truncate(length);
            let Some(data) = read(&loader, &path, &files) else { continue };
            check(&data, &path);
            let what = format!("{path} cut at {length} of {}", files[0].1.len());
            if data.geometry.as_surface().is_some() {
                let open = matches!(loader.as_str(), "obj" | "stl" | "vtk-mesh");
                assert!(open || data.geometry.bounds() == whole.geometry.bounds(), "{what}");
                assert!(loader != "stl" || !data.warnings.is_empty() || same(&data, &whole), "{what}");
                continue;
            }
            assert!(same(&data, &whole) || digits(&loader, &data, &whole), "{what}");
            let all = data.attributes.len() == whole.attributes.len();
            assert!(all || loader == "vtk-mesh", "{what}: attributes are lost");
        }
    }
}

fn same(data: &MeshData, whole: &MeshData) -> bool {
    let count = |geometry: &dyn Geometry| geometry.tessellate().map(|t| t.tetrahedra).unwrap_or_default();
    data.geometry.vertex_count() == whole.geometry.vertex_count()
        && data.geometry.bounds() == whole.geometry.bounds()
        && count(data.geometry.as_ref()) == count(whole.geometry.as_ref())
}

/// The last number of a text may lose a digit, which nobody can see.
fn digits(loader: &str, data: &MeshData, whole: &MeshData) -> bool {
    loader == "vtk-mesh" && data.geometry.vertex_count() == whole.geometry.vertex_count()
}

/// Writes all samples as a first corpus for `fuzz/`, if `VOLACT_SEEDS` names a folder.
#[test]
fn seeds_are_written_where_asked() {
    let Some(folder) = std::env::var_os("VOLACT_SEEDS") else { return };
    for (n, (loader, path, files)) in samples().into_iter().enumerate() {
        let target = match loader.as_str() {
            "vtu" | "vts" | "vtp" => "vtk_xml",
            "vtk-mesh" => "vtk_mesh",
            other => other,
        };
        let target = Path::new(&folder).join(target);
        fs::create_dir_all(&target).unwrap();
        let mut bytes = files[0].1.clone();
        if loader == "plot3d" {
            bytes.splice(0..0, (files[0].1.len() as u16).to_le_bytes());
            bytes.extend(&files[1].1);
        }
        fs::write(target.join(format!("{n}_{path}")), bytes).unwrap();
    }
}
