//! What the fuzz targets do: open arbitrary bytes as each format, read them whole and by region,
//! and check what must hold of every file that is accepted.
//!
//! Files lie in memory. Formats whose header names other files find `a`, `b` and `c` beside it.

use std::path::Path;

use volact_core::{LoadOptions, Region, Volume, loader::NoProgress};
use volact_files::{Storage, open_in};

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
