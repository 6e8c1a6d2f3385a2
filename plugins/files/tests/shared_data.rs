//! The shared volumes against their oracle: sizes, spacings, probes and the digest of all voxels,
//! computed by somebody else's code.
//!
//! `VOLACT_DATA` names the folder with `manifest.json`.

use std::{
    collections::BTreeMap,
    env, fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use serde_json::Value;
use sha2::{Digest, Sha256};
use volact_core::{
    Loader, ParameterValue, Region, ScalarType, Volume, VolumeReader,
    glam::DVec3,
    loader::{LoadOptions, NoProgress, choose},
};

fn data() -> Option<PathBuf> {
    let folder = env::var_os("VOLACT_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("VOLACT_DATA not set: skipped");
    }
    folder
}

fn options(given: &[(&str, ParameterValue)]) -> LoadOptions {
    given.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect()
}

fn open(path: &Path, options: &LoadOptions) -> Box<dyn VolumeReader> {
    let loaders: Vec<Arc<dyn Loader>> = volact_files::loaders();
    let loader = choose(&loaders, path).unwrap();
    let options = loader.declaration().resolve(options, |_| false).unwrap();
    loader.open(path, &options).unwrap()
}

fn little_endian_digest(volume: &Volume) -> String {
    let mut bytes = volume.data().bytes().to_vec();
    if cfg!(target_endian = "big") {
        bytes.chunks_exact_mut(volume.desc().scalar.size()).for_each(<[u8]>::reverse);
    }
    Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect()
}

fn scalar(name: &str) -> ScalarType {
    match name {
        "uint8" => ScalarType::U8,
        "uint16" => ScalarType::U16,
        "int16" => ScalarType::I16,
        other => panic!("the manifest has a new type: {other}"),
    }
}

/// The arrays of the manifest: folder, entry of the folder, entry of the array.
fn arrays(folder: &Path) -> Vec<(String, Value, Value)> {
    let text = fs::read_to_string(folder.join("manifest.json")).unwrap();
    let manifest: BTreeMap<String, Value> = serde_json::from_str(&text).unwrap();
    let mut found = Vec::new();
    for (name, entry) in manifest {
        let Some(arrays) = entry["arrays"].as_object() else { continue };
        for array in arrays.values().filter(|a| a["decoded_sha256"].is_string()) {
            found.push((name.clone(), entry.clone(), array.clone()));
        }
    }
    found
}

#[test]
fn every_volume_decodes_to_its_digest() {
    let Some(folder) = data() else { return };
    let arrays = arrays(&folder);
    assert_eq!(arrays.len(), 15, "volumes in the manifest");
    for (name, entry, array) in arrays {
        let file = array["file"].as_str().unwrap();
        // The head CT is an uneven stack, whose oracle is the slices as they are stored.
        let (path, given) = match name.as_str() {
            "ge_head_ct" => (folder.join(&name), options(&[("as_stored", true.into())])),
            _ => (folder.join(&name).join(file), options(&[])),
        };
        let mut reader = open(&path, &given);
        let data = reader.read(&NoProgress).unwrap();
        let volume = Volume::new(reader.desc().clone(), data).unwrap();
        let dims: Vec<usize> = array["dimensions_xyz"].as_array().unwrap().iter().map(number).collect();
        assert_eq!(volume.dims().to_vec(), dims, "{name}/{file}");
        assert_eq!(volume.desc().scalar, scalar(array["dtype"].as_str().unwrap()), "{name}/{file}");
        for probe in array["probes"].as_array().unwrap() {
            let place: Vec<usize> = probe["xyz"].as_array().unwrap().iter().map(number).collect();
            let stored = volume.stored([place[0], place[1], place[2]], 0);
            assert_eq!(stored, probe["value"].as_f64().unwrap(), "{name}/{file} at {place:?}");
        }
        let wanted = array["decoded_sha256"].as_str().unwrap();
        assert_eq!(little_endian_digest(&volume), wanted, "{name}/{file}");
        // TIFF has no distance between pages, and the stack of the head CT is uneven.
        if !matches!(name.as_str(), "ge_head_ct" | "nuclei_microscopy") {
            let spacing: Vec<f64> = entry["spacing"].as_array().unwrap().iter().map(|s| s.as_f64().unwrap()).collect();
            let off = (volume.desc().spacing - DVec3::from_slice(&spacing)).abs().max_element();
            assert!(off < 1e-6, "{name}/{file}: {}", volume.desc().spacing);
        }
    }
}

fn number(value: &Value) -> usize {
    usize::try_from(value.as_u64().unwrap()).unwrap()
}

#[test]
fn region_equals_crop_of_the_whole() {
    let Some(folder) = data() else { return };
    for (name, _, array) in arrays(&folder) {
        let (path, given) = match name.as_str() {
            "ge_head_ct" => (folder.join(&name), options(&[("as_stored", true.into())])),
            _ => (folder.join(&name).join(array["file"].as_str().unwrap()), options(&[])),
        };
        let whole = open(&path, &given).read(&NoProgress).unwrap();
        let mut reader = open(&path, &given);
        let [nx, ny, nz] = reader.desc().dims;
        let sample = reader.desc().scalar.size();
        let regions = [
            Region { min: [nx / 3, ny / 4, nz / 2], max: [nx / 2, ny / 2, nz / 2 + 1] },
            Region { min: [0, ny - 2, 0], max: [nx - 1, ny - 1, 1] },
            Region { min: [nx - 1, ny - 1, nz - 1], max: [nx - 1, ny - 1, nz - 1] },
            Region { min: [0, 0, 1], max: [nx - 1, ny - 1, 2] },
        ];
        for region in regions {
            let part = reader.read_region(region, &NoProgress).unwrap();
            let mut wanted = Vec::new();
            for z in region.min[2]..=region.max[2] {
                for y in region.min[1]..=region.max[1] {
                    let row = (z * ny + y) * nx;
                    let (a, b) = (row + region.min[0], row + region.max[0] + 1);
                    wanted.extend_from_slice(&whole.bytes()[a * sample..b * sample]);
                }
            }
            assert_eq!(part.bytes(), wanted, "{name}: {region}");
        }
    }
}

/// The header says 260020 bytes, the stream has 262087: readers that believe it lose voxels.
#[test]
fn frog_with_the_wrong_size_is_read_whole_and_says_so() {
    let Some(folder) = data() else { return };
    let reader = open(&folder.join("frog_tissue/frogtissue.mhd"), &options(&[]));
    let messages: Vec<_> = reader.warnings().iter().map(ToString::to_string).collect();
    assert_eq!(
        messages,
        ["frogtissue.mhd: CompressedDataSize says 260020 bytes, the file has 262087; the whole stream is used \
          [file-content]"]
    );
}

#[test]
fn uneven_head_is_refused_with_its_distances_and_the_cure() {
    let Some(folder) = data() else { return };
    let path = folder.join("ge_head_ct");
    let loaders = volact_files::loaders();
    let loader = choose(&loaders, &path).unwrap();
    let options = loader.declaration().resolve(&LoadOptions::new(), |_| false).unwrap();
    let error = loader.open(&path, &options).err().unwrap().to_string();
    let wanted = "a stack of uneven distances: 4.22 mm (slices 1 to 14), 1.14 mm (slices 14 to 15), 7.38 mm (slices \
                  15 to 28) is not supported; set the option resample to true to interpolate it to an even one";
    assert!(error.ends_with(wanted), "{error}");
}

/// Corners of the volume from DICOM's own formula: position + column·spacing·row direction + …
#[test]
fn resampled_head_keeps_place_shear_and_values() {
    let Some(folder) = data() else { return };
    let path = folder.join("ge_head_ct");
    let stored = open(&path, &options(&[("as_stored", true.into())])).read(&NoProgress).unwrap();
    let mut reader = open(&path.join("03.dcm"), &options(&[("resample", true.into())]));
    let data = reader.read(&NoProgress).unwrap();
    let desc = reader.desc().clone();
    let volume = Volume::new(desc.clone(), data).unwrap();
    // 13 distances of 4.22, one of 1.14 and 13 of 7.38 mm, in steps of 1.14 mm.
    let length = 13.0 * 4.218_0 + 13.0 * 7.381_4 + 1.135;
    let slices = desc.dims[2] as f64;
    assert!((desc.spacing.z * (slices - 1.0) - length).abs() < 0.5, "{} slices of {}", slices, desc.spacing.z);
    assert!((desc.spacing.z - 1.14).abs() < 0.02, "{}", desc.spacing.z);
    assert_eq!(desc.unit, "HU");
    let last = desc.spacing * DVec3::new(511.0, 511.0, 0.0);
    let corner = desc.placement.transform_point3(last);
    let row = DVec3::new(1.0, 0.0, 0.0);
    let column = DVec3::new(0.0, 0.948_323_7, -0.317_304_7);
    let wanted = DVec3::new(-125.0, -123.540_456_9, 5.836_058_6) + (row + column) * (511.0 * 0.488_281_2);
    assert!((corner - wanted).length() < 1e-4, "{corner} instead of {wanted}");
    // The slices lie above each other along z, although their planes are tilted.
    let step = desc.placement.transform_vector3(DVec3::Z);
    assert!((step - DVec3::Z).length() < 1e-3, "{step}");
    // The first and the last slice are the stored ones.
    let slice = 512 * 512 * 2;
    let end = volume.data().len();
    assert_eq!(volume.data().bytes()[..slice], stored.bytes()[..slice]);
    assert_eq!(volume.data().bytes()[end - slice..], stored.bytes()[stored.len() - slice..]);
    // Between the first two slices everything is linear, to the rounding.
    let at = |z: usize, n: usize| ScalarType::I16.read(&stored.bytes()[z * slice..], n);
    let weight = desc.spacing.z / 4.218;
    for n in (0..512 * 512).step_by(1009) {
        let wanted = at(0, n) + weight * (at(1, n) - at(0, n));
        let found = volume.stored([n % 512, n / 512, 1], 0);
        assert!((found - wanted).abs() < 2.0, "sample {n}: {found} instead of {wanted}");
    }
}

/// The affine of stroke_mri is oblique: 18 degrees about x, 6 about y, as its description says.
#[test]
fn oblique_mri_is_placed_as_its_sform_says() {
    let Some(folder) = data() else { return };
    let path = folder.join("stroke_mri/T2.nii.gz");
    let reader = open(&path, &options(&[]));
    let desc = reader.desc();
    // Read here from the file itself: srow at 280, little-endian floats.
    let mut header = Vec::new();
    let file = fs::File::open(&path).unwrap();
    std::io::Read::read_to_end(&mut std::io::Read::take(flate2::read::GzDecoder::new(file), 348), &mut header).unwrap();
    let number = |n: usize| f64::from(f32::from_le_bytes(header[280 + 4 * n..284 + 4 * n].try_into().unwrap()));
    for sample in [[0.0, 0.0, 0.0], [123.0, 0.0, 0.0], [5.0, 159.0, 139.0]] {
        let world = |row: usize| (0..3).map(|n| number(4 * row + n) * sample[n]).sum::<f64>() + number(4 * row + 3);
        let lps = DVec3::new(-world(0), -world(1), world(2));
        let found = desc.placement.transform_point3(desc.spacing * DVec3::from_array(sample));
        assert!((found - lps).length() < 1e-3, "{sample:?}: {found} instead of {lps}");
    }
    assert!((desc.placement.matrix3.z_axis.y.abs() - 18f64.to_radians().sin()).abs() < 0.05, "{:?}", desc.placement);
    assert!((desc.slope - 2.007_843).abs() < 1e-6 && desc.intercept == 0.0, "{}", desc.slope);
}
