//! The loaders behind the plugin boundary, linked and loaded as a library: the same volumes, regions,
//! meshes, warnings, progress and errors as the ones that are called directly.

mod mesh_samples;
mod samples;

#[path = "../../../plugin/tests/common/library.rs"]
mod library;

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, OnceLock},
};

use library::words;
use volact_core::{
    Attribute, LoadError, LoadOptions, Loader, MeshData, ParameterValue, Progress, Region, Registry, VolumeDesc,
    Warning,
    glam::DVec3,
    loader::{Confidence, Content, NoProgress, Probe},
    plugin::host,
};

/// The loaders as they are, linked through their entry, and of the library.
struct Three {
    direct: Vec<Arc<dyn Loader>>,
    behind: [(&'static str, Registry); 2],
}

#[expect(unsafe_code, reason = "links a plugin through its entry")]
fn three() -> &'static Three {
    static THREE: OnceLock<Three> = OnceLock::new();
    THREE.get_or_init(|| {
        let (mut linked, mut loaded) = (Registry::new(), Registry::new());
        // SAFETY: the entry is made by the macro.
        unsafe { host::link(volact_files_plugin::volact_plugin, &mut linked) }.unwrap();
        library::load_library("volact-files-plugin", &mut loaded);
        Three { direct: volact_files::loaders(), behind: [("linked", linked), ("loaded", loaded)] }
    })
}

/// Hears everything and stops after so many calls.
struct Heard {
    calls: Mutex<Vec<(u64, u64)>>,
    stop_after: usize,
}

impl Heard {
    fn new(stop_after: usize) -> Self {
        Self { calls: Mutex::default(), stop_after }
    }
}

impl Progress for Heard {
    fn advance(&self, done: u64, total: u64) -> bool {
        let mut calls = self.calls.lock().unwrap();
        calls.push((done, total));
        calls.len() <= self.stop_after
    }
}

/// What an error says; of one that came across the boundary, what the plugin said.
fn said(error: &LoadError) -> String {
    match error {
        LoadError::Plugin { source, .. } => source.message.clone(),
        other => words(other),
    }
}

/// All that a volume's file gives.
#[derive(Debug, PartialEq)]
struct Seen {
    desc: VolumeDesc,
    warnings: Vec<Warning>,
    whole: Result<Vec<u8>, String>,
    regions: Vec<Result<Vec<u8>, String>>,
    outside: Result<Vec<u8>, String>,
    progress: Vec<(u64, u64)>,
    stopped: Result<Vec<u8>, String>,
    warnings_after: Vec<Warning>,
}

fn regions(dims: [usize; 3]) -> Vec<Region> {
    let last = dims.map(|n| n - 1);
    let third = dims.map(|n| n / 3);
    let middle = Region { min: third, max: [0, 1, 2].map(|a| (2 * dims[a] / 3).clamp(third[a], last[a])) };
    let row = Region { min: [0, last[1], last[2]], max: last };
    vec![middle, row, Region { min: last, max: last }, Region { min: [0; 3], max: [last[0], 0, last[2]] }]
}

fn volume(loader: &dyn Loader, path: &Path, options: &LoadOptions) -> Result<Seen, String> {
    let mut reader = loader.open(path, options).map_err(|e| said(&e))?;
    let (desc, warnings) = (reader.desc().clone(), reader.warnings().to_vec());
    let heard = Heard::new(usize::MAX);
    let mut read = |region: Option<Region>, progress: &dyn Progress| {
        let got = match region {
            Some(region) => reader.read_region(region, progress),
            None => reader.read(progress),
        };
        got.map(|data| data.bytes().to_vec()).map_err(|e| said(&e))
    };
    let whole = read(None, &heard);
    let each = regions(desc.dims).into_iter().map(|region| read(Some(region), &NoProgress)).collect();
    let outside = read(Some(Region { min: [0; 3], max: desc.dims }), &NoProgress);
    let stopped = read(None, &Heard::new(0));
    let warnings_after = reader.warnings().to_vec();
    let progress = heard.calls.into_inner().unwrap();
    Ok(Seen { desc, warnings, whole, regions: each, outside, progress, stopped, warnings_after })
}

/// All that a mesh's file gives, as text: geometry with its arrays, numbers of vertices, warnings.
fn mesh(loader: &dyn Loader, path: &Path, options: &LoadOptions) -> Result<String, String> {
    let MeshData { name, geometry, attributes, warnings } =
        loader.read_mesh(path, options, &NoProgress).map_err(|e| said(&e))?;
    let bytes = |a: &Attribute| (a.name.clone(), a.scalar, a.components, a.data.bytes().to_vec());
    let attributes: Vec<_> = attributes.iter().map(bytes).collect();
    let cut = geometry.tessellate().map_err(|e| words(&e));
    let about = (
        geometry.name(),
        geometry.bounds(),
        geometry.vertex_count(),
        geometry.as_surface().map(|s| {
            let corners = s.triangles().to_vec();
            (s.points().iter().collect::<Vec<_>>(), corners, s.normals().map(|n| n.iter().collect::<Vec<_>>()))
        }),
    );
    Ok(format!("{name} {about:?} {cut:?} {attributes:?} {warnings:?}"))
}

/// Compares a file through all three; whether it could be read.
fn same(name: &str, loader: &str, path: &Path, options: &LoadOptions) -> bool {
    let three = three();
    let direct = three.direct.iter().find(|l| l.declaration().name == loader).unwrap();
    let options = direct.declaration().resolve(options, |_| false).unwrap();
    let mut good = false;
    for (way, registry) in &three.behind {
        let other = registry.loaders().iter().find(|l| l.declaration().name == loader).unwrap();
        match direct.content() {
            Content::Volume => {
                let (wanted, found) = (volume(&**direct, path, &options), volume(&**other, path, &options));
                assert!(wanted == found, "{name}, {way}: {found:?}, wanted {wanted:?}");
                good = wanted.is_ok();
            }
            Content::Mesh => {
                let (wanted, found) = (mesh(&**direct, path, &options), mesh(&**other, path, &options));
                assert!(wanted == found, "{name}, {way}: {found:?}, wanted {wanted:?}");
                good = wanted.is_ok();
            }
        }
    }
    good
}

fn put(folder: &Path, files: &[(impl AsRef<str>, Vec<u8>)]) {
    for (path, bytes) in files {
        let path = folder.join(path.as_ref());
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
}

#[test]
fn every_format_of_volumes_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mut formats = std::collections::BTreeSet::new();
    for (i, sample) in samples::all().into_iter().enumerate() {
        let here = folder.path().join(i.to_string());
        put(&here, &sample.files);
        let read = same(sample.name, sample.loader, &here.join(sample.path), &LoadOptions::new());
        assert!(read, "{} cannot be read", sample.name);
        formats.insert(sample.loader);
    }
    let volumes: Vec<_> = three().direct.iter().filter(|l| l.content() == Content::Volume).collect();
    assert_eq!(formats.len(), volumes.len(), "{formats:?}");
}

#[test]
fn every_format_of_meshes_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    for (i, (loader, path, files)) in mesh_samples::all().into_iter().enumerate() {
        let here = folder.path().join(i.to_string());
        put(&here, &files);
        assert!(same(&format!("{loader} {i}"), loader, &here.join(path), &LoadOptions::new()), "{loader} {i}");
    }
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let mut read = 0;
    for path in fs::read_dir(fixtures).unwrap().map(|e| e.unwrap().path()) {
        if let Some(loader) = chosen(&path) {
            read += usize::from(same(&path.display().to_string(), &loader, &path, &LoadOptions::new()));
        }
    }
    assert!(read >= 35, "{read} fixtures");
}

/// The loader that is surest of a file, after all three agree on how sure each is.
fn chosen(path: &Path) -> Option<String> {
    let head: Vec<u8> = fs::read(path).unwrap().into_iter().take(4096).collect();
    let probe = Probe { path, head: &head, is_dir: false };
    let three = three();
    let sure = |loaders: &[Arc<dyn Loader>]| loaders.iter().map(|l| l.probe(&probe)).collect::<Vec<Confidence>>();
    let wanted = sure(&three.direct);
    three.behind.iter().for_each(|(way, registry)| assert_eq!(sure(registry.loaders()), wanted, "{way} {path:?}"));
    let best = wanted.iter().max()?;
    let at = wanted.iter().position(|c| c == best)?;
    (*best > Confidence::No).then(|| three.direct[at].declaration().name.clone())
}

#[test]
fn damaged_files_are_refused_with_the_same_words() {
    let folder = tempfile::tempdir().unwrap();
    let mut refused = 0;
    for (i, sample) in samples::all().into_iter().enumerate() {
        for (kind, cut) in [("cut", 0), ("flipped", 1)] {
            let here = folder.path().join(format!("{i}-{kind}"));
            let mut files = sample.files.clone();
            let bytes = &mut files[0].1;
            let (length, middle) = (bytes.len() * 2 / 3, bytes.len() / 4);
            if cut == 0 {
                bytes.truncate(length)
            } else {
                bytes[middle] ^= 0x15
            }
            put(&here, &files);
            let read =
                same(&format!("{} {kind}", sample.name), sample.loader, &here.join(sample.path), &LoadOptions::new());
            refused += usize::from(!read);
        }
    }
    assert!(refused > 10, "{refused}");
    for loader in ["nrrd", "vtu", "dicom"] {
        assert!(!same(loader, loader, &folder.path().join("absent"), &LoadOptions::new()));
    }
}

#[test]
fn declarations_and_options_are_the_same() {
    let three = three();
    let wanted: Vec<_> = three.direct.iter().map(|l| (l.declaration().clone(), l.content())).collect();
    for (way, registry) in &three.behind {
        let found: Vec<_> = registry.loaders().iter().map(|l| (l.declaration().clone(), l.content())).collect();
        assert_eq!(found, wanted, "{way}");
    }
    let folder = tempfile::tempdir().unwrap();
    let cases: [(&str, LoadOptions); 4] = [
        ("dicom", LoadOptions::from([("as_stored".to_owned(), true.into())])),
        ("dicom", LoadOptions::from([("resample".to_owned(), true.into())])),
        ("png", LoadOptions::from([("spacing".to_owned(), DVec3::new(0.5, 0.25, 2.0).into())])),
        ("vtk", LoadOptions::from([("array".to_owned(), ParameterValue::Choice("nobody".into()))])),
    ];
    for (i, (loader, options)) in cases.iter().enumerate() {
        let sample = samples::all().into_iter().find(|s| s.loader == *loader).unwrap();
        let here = folder.path().join(i.to_string());
        put(&here, &sample.files);
        let read = same(&format!("{options:?}"), loader, &here.join(sample.path), options);
        assert_eq!(read, *loader != "vtk", "{options:?}");
    }
}

/// The real files that the folder of `VOLACT_DATA` holds.
#[test]
fn real_files_are_the_same() {
    let Some(data) = std::env::var_os("VOLACT_DATA").map(PathBuf::from) else {
        println!("skipped: VOLACT_DATA is not set");
        return;
    };
    let names = [
        "fuel_sim/fuel.nii.gz",
        "frog_tissue/frog_tissues.vti",
        "fire_room_hex/fire_ug.vtu",
        "head_mr/HeadMRVolume.mhd",
    ];
    for name in names {
        let path = data.join(name);
        let loader = chosen(&path).unwrap_or_else(|| panic!("{name}: no loader"));
        assert!(same(name, &loader, &path, &LoadOptions::new()), "{name}");
    }
}
