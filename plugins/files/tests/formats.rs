//! Every way of writing that a loader knows, read back.

mod samples;

use std::{path::Path, sync::Mutex};

use samples::{DIMS, Sample, all};
use volact_core::{
    LoadError, ParameterValue, Progress, Region, ScalarType, Volume, VolumeReader,
    glam::DVec3,
    loader::{Confidence, Content, LoadOptions, NoProgress, Probe},
};
use volact_files::{Storage, loaders, open_in};

fn open(sample: &Sample) -> Box<dyn VolumeReader> {
    open_in(&sample.storage(), sample.loader, Path::new(sample.path), &LoadOptions::new())
        .unwrap_or_else(|e| panic!("{}: {e}", sample.name))
}

fn named(name: &str) -> Sample {
    all().into_iter().find(|s| s.name == name).unwrap()
}

#[test]
fn every_sample_has_its_voxels() {
    for sample in all() {
        let mut reader = open(&sample);
        let data = reader.read(&NoProgress).unwrap_or_else(|e| panic!("{}: {e}", sample.name));
        assert_eq!(reader.desc().dims, DIMS, "{}", sample.name);
        assert_eq!(reader.desc().scalar, sample.scalar, "{}", sample.name);
        assert_eq!(reader.desc().components, sample.components, "{}", sample.name);
        assert_eq!(data.bytes(), sample.voxels, "{}", sample.name);
        assert_eq!(reader.warnings(), [], "{}", sample.name);
        Volume::new(reader.desc().clone(), data).unwrap();
    }
}

#[test]
fn every_region_is_the_crop_of_the_whole() {
    for sample in all() {
        let mut reader = open(&sample);
        let size = sample.components * sample.scalar.size();
        let [nx, ny, nz] = DIMS;
        let boxes = |n: usize| (0..n).flat_map(move |a| (a..n).map(move |b| (a, b)));
        for (x0, x1) in boxes(nx) {
            for (y0, y1) in boxes(ny) {
                for (z0, z1) in boxes(nz) {
                    let region = Region { min: [x0, y0, z0], max: [x1, y1, z1] };
                    let mut wanted = Vec::new();
                    for z in z0..=z1 {
                        for y in y0..=y1 {
                            let row = (z * ny + y) * nx;
                            wanted.extend_from_slice(&sample.voxels[(row + x0) * size..(row + x1 + 1) * size]);
                        }
                    }
                    let found = reader.read_region(region, &NoProgress).unwrap();
                    assert_eq!(found.bytes(), wanted, "{}: {region}", sample.name);
                }
            }
        }
    }
}

#[test]
fn region_outside_is_refused_by_every_format() {
    for sample in all() {
        let mut reader = open(&sample);
        for region in [
            Region { min: [0, 0, 0], max: [5, 3, 2] },
            Region { min: [2, 0, 0], max: [1, 3, 2] },
            Region { min: [0, 0, 3], max: [4, 3, 3] },
        ] {
            let error = reader.read_region(region, &NoProgress).err().unwrap();
            assert!(matches!(error, LoadError::Region { .. }), "{}: {error}", sample.name);
        }
    }
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
    for sample in all() {
        let progress = Counting { seen: Mutex::default(), stop: false };
        open(&sample).read(&progress).unwrap();
        let seen = progress.seen.into_inner().unwrap();
        let total = sample.voxels.len() as u64;
        assert_eq!(seen.last(), Some(&(total, total)), "{}", sample.name);
        assert!(seen.is_sorted(), "{}: {seen:?}", sample.name);
        let stopping = Counting { seen: Mutex::default(), stop: true };
        let error = open(&sample).read(&stopping).err().unwrap();
        assert!(matches!(error, LoadError::Stopped { .. }), "{}: {error}", sample.name);
    }
}

/// World places of three samples, computed by hand from what the headers say.
#[test]
fn placement_follows_each_header() {
    let at = |name: &str, sample: [f64; 3]| {
        let reader = open(&named(name));
        let desc = reader.desc();
        desc.placement.transform_point3(desc.spacing * DVec3::from_array(sample))
    };
    let near = |a: DVec3, b: [f64; 3]| assert!((a - DVec3::from_array(b)).length() < 1e-5, "{a} instead of {b:?}");
    near(at("raw", [1.0, 1.0, 1.0]), [8.0, 10.0, 12.0]);
    // RAS (10,20,30) is LPS (-10,-20,30); the third direction is sheared.
    near(at("nrrd raw", [0.0, 0.0, 0.0]), [-10.0, -20.0, 30.0]);
    near(at("nrrd raw", [1.0, 1.0, 1.0]), [-12.0, -24.0, 34.0]);
    near(at("nrrd text", [1.0, 1.0, 1.0]), [1.0, 2.0, 3.0]);
    // The first row of the matrix is the direction of the first axis.
    near(at("metaimage raw", [1.0, 0.0, 0.0]), [4.0, 6.0, 6.0]);
    near(at("metaimage raw", [0.0, 1.0, 1.0]), [2.0, 5.0, 9.0]);
    near(at("nifti", [0.0, 0.0, 0.0]), [10.0, 20.0, 30.0]);
    near(at("nifti", [1.0, 1.0, 1.0]), [8.0, 16.5, 34.0]);
    near(at("nifti big", [1.0, 1.0, 1.0]), [8.0, 16.5, 34.0]);
    // qform: a quarter turn about z takes x to y and y to -x; qfac -1 turns z over; then RAS to LPS.
    near(at("nifti 2", [1.0, 0.0, 0.0]), [-7.0, -2.0, 0.0]);
    near(at("nifti 2", [0.0, 1.0, 0.0]), [-4.0, 0.0, 0.0]);
    near(at("nifti 2", [0.0, 0.0, 1.0]), [-7.0, 0.0, -4.0]);
    // PixelSpacing gives rows first: 0.5 between rows (y), 0.25 between columns (x).
    near(at("dicom explicit", [1.0, 1.0, 0.0]), [10.25, 20.5, 30.0]);
    near(at("dicom explicit", [0.0, 0.0, 2.0]), [10.0, 22.0, 34.0]);
    near(at("vtk binary", [1.0, 1.0, 1.0]), [5.0, 7.0, 9.0]);
    // The extent begins at 2: the first sample lies two spacings from the origin.
    near(at("vti text", [0.0, 0.0, 0.0]), [2.0, 2.0, 3.0]);
    near(at("vti text", [1.0, 1.0, 1.0]), [2.5, 4.0, 6.0]);
}

#[test]
fn slope_intercept_and_unit_are_carried() {
    let map = |name: &str| {
        let reader = open(&named(name));
        (reader.desc().slope, reader.desc().intercept, reader.desc().unit.clone())
    };
    assert_eq!(map("raw"), (2.0, -1.0, "HU".into()));
    assert_eq!(map("nifti gzip"), (2.0, -1024.0, String::new()));
    assert_eq!(map("dicom implicit"), (2.0, -1024.0, "HU".into()));
    assert_eq!(map("nrrd raw"), (1.0, 0.0, String::new()));
}

proptest::proptest! {
    /// Any numbers in any small grid, in each encoding and byte order, come back as they were.
    #[test]
    fn nrrd_round_trips(
        dims in [1usize..6, 1usize..6, 1usize..6],
        seed in proptest::collection::vec(proptest::num::i32::ANY, 125),
        kind in 0usize..4,
        encoding in 0usize..5,
        big in proptest::bool::ANY,
    ) {
        let scalar = [ScalarType::U8, ScalarType::I16, ScalarType::U16, ScalarType::I32][kind];
        let word = ["uchar", "short", "ushort", "int"][kind];
        let count = dims.iter().product::<usize>();
        let [low, high] = scalar.limits().unwrap();
        let values: Vec<i32> = seed[..count].iter().map(|v| low as i32 + v.rem_euclid((high - low).min(2e9) as i32)).collect();
        let bytes = if big { samples::big(&values, scalar) } else { samples::little(&values, scalar) };
        let (name, data) = match encoding {
            0 => ("raw", bytes),
            1 => ("gzip", samples::gzip(&bytes)),
            2 => ("bzip2", samples::bzip2(&bytes)),
            3 => ("hex", bytes.iter().map(|b| format!("{b:02X}")).collect::<String>().into_bytes()),
            _ => ("ascii", values.iter().map(|v| format!("{v}\n")).collect::<String>().into_bytes()),
        };
        let header = format!(
            "NRRD0003\r\ntype: {word}\r\ndimension: 3\r\nsizes: {} {} {}\r\nencoding: {name}\r\nendian: {}\r\n\r\n",
            dims[0], dims[1], dims[2], if big { "big" } else { "little" },
        );
        let storage = Storage::memory([("v.nrrd", samples::join(&header, &data))]);
        let mut reader = open_in(&storage, "nrrd", Path::new("v.nrrd"), &LoadOptions::new()).unwrap();
        proptest::prop_assert_eq!(reader.desc().dims, dims);
        let read = reader.read(&NoProgress).unwrap();
        proptest::prop_assert_eq!(read.bytes(), samples::native(&values, scalar));
    }
}

fn confidences(path: &str, head: &[u8]) -> Vec<(String, Confidence)> {
    let probe = Probe { path: Path::new(path), head, is_dir: false };
    let all = loaders();
    let named = all.iter().map(|l| (l.declaration().name.clone(), l.probe(&probe)));
    named.filter(|(_, c)| *c != Confidence::No).collect()
}

#[test]
fn content_rules_and_the_extension_only_helps() {
    for sample in all().iter().filter(|s| !s.path.contains('%') && s.files.iter().any(|f| f.0 == s.path)) {
        let head = &sample.files[0].1[..sample.files[0].1.len().min(4096)];
        // The header of the raw series has no name before its parenthesis: its extension has to do.
        let wanted = if sample.name == "raw series" { Confidence::Extension } else { Confidence::Content };
        assert_eq!(confidences(sample.path, head), [(sample.loader.to_owned(), wanted)], "{}", sample.name);
        if wanted == Confidence::Content {
            assert_eq!(confidences("nameless", head), [(sample.loader.to_owned(), wanted)], "{}", sample.name);
        }
    }
    assert_eq!(confidences("a.nii", b"nothing"), [("nifti".to_owned(), Confidence::Extension)]);
    assert_eq!(confidences("a.txt", b"nothing"), []);
}

fn options(given: &[(&str, ParameterValue)]) -> LoadOptions {
    given.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect()
}

fn open_with(sample: &Sample, given: &[(&str, ParameterValue)]) -> Result<Box<dyn VolumeReader>, LoadError> {
    open_in(&sample.storage(), sample.loader, Path::new(sample.path), &options(given))
}

#[test]
fn spacing_option_stands_for_what_tiff_and_png_lack() {
    for name in ["tiff", "png"] {
        let reader = open_with(&named(name), &[("spacing", DVec3::new(0.25, 0.5, 2.0).into())]).unwrap();
        assert_eq!(reader.desc().spacing, DVec3::new(0.25, 0.5, 2.0), "{name}");
        assert_eq!(open(&named(name)).desc().spacing, DVec3::ONE, "{name}");
    }
}

#[test]
fn series_option_gathers_the_neighbours_of_a_file() {
    let sample = named("png");
    let path = Path::new("p/s9.png");
    let alone = open_in(&sample.storage(), "png", path, &LoadOptions::new()).unwrap();
    assert_eq!(alone.desc().dims, [5, 4, 1]);
    let given = options(&[("series", true.into())]);
    let mut together = open_in(&sample.storage(), "png", path, &given).unwrap();
    assert_eq!(together.read(&NoProgress).unwrap().bytes(), sample.voxels);
}

#[test]
fn array_option_picks_by_name() {
    let data = "SCALARS first unsigned_char\nLOOKUP_TABLE default\n";
    let head = samples::vtk_header("3.0", "BINARY", data);
    let second = "\nSCALARS second short\nLOOKUP_TABLE default\n";
    let values = samples::grid(1);
    let file = [head.as_bytes(), &[9; 60], second.as_bytes(), &samples::big(&values, ScalarType::I16)];
    let storage = Storage::memory([("v.vtk", file.concat())]);
    let read = |given: &[(&str, ParameterValue)]| {
        let mut reader = open_in(&storage, "vtk", Path::new("v.vtk"), &options(given)).unwrap();
        reader.read(&NoProgress).unwrap().bytes().to_vec()
    };
    assert_eq!(read(&[]), [9; 60]);
    assert_eq!(read(&[("array", "second".into())]), samples::native(&values, ScalarType::I16));
}

#[test]
fn frame_option_reads_a_later_volume() {
    let values = samples::grid(1);
    let mut header = samples::nifti1(2, 8, b"n+1\0", false);
    header[40..50].copy_from_slice(&[4, 0, 5, 0, 4, 0, 3, 0, 2, 0]);
    let second = samples::little(&values, ScalarType::U8);
    let plain = [&header[..], &[0; 4], &[7; 60], &second].concat();
    for bytes in [plain.clone(), samples::gzip(&plain)] {
        let storage = Storage::memory([("v.nii", bytes)]);
        let read = |frame: i64| {
            let given = options(&[("frame", frame.into())]);
            let mut reader = open_in(&storage, "nifti", Path::new("v.nii"), &given).unwrap();
            reader.read(&NoProgress).unwrap().bytes().to_vec()
        };
        assert_eq!(read(0), [7; 60]);
        assert_eq!(read(1), second);
    }
}

/// Slices at 0, 1 and 3 mm: an even stack of 1 mm has four, the third halfway between two.
#[test]
fn uneven_dicom_is_interpolated_on_request() {
    let slice = |z: usize, height: f64| samples::dicom_slice("1.2.840.10008.1.2.1", z, [0.0, 0.0, height]);
    let storage = Storage::memory([("d/1", slice(0, 0.0)), ("d/2", slice(1, 1.0)), ("d/3", slice(2, 3.0))]);
    let open = |given: &[(&str, ParameterValue)]| open_in(&storage, "dicom", Path::new("d"), &options(given));
    assert_eq!(
        open(&[]).err().unwrap().to_string(),
        "d: a stack of uneven distances: 1.00 mm (slices 1 to 2), 2.00 mm (slices 2 to 3) is not supported; set the \
         option resample to true to interpolate it to an even one"
    );
    let mut reader = open(&[("resample", true.into())]).unwrap();
    assert_eq!(reader.desc().dims, [5, 4, 4]);
    assert_eq!(reader.desc().spacing, DVec3::new(0.25, 0.5, 1.0));
    let data = reader.read(&NoProgress).unwrap();
    let found = data.as_slice::<i16>().unwrap();
    let values = samples::grid(1);
    for n in 0..20 {
        let half = f64::from(values[20 + n] + values[40 + n]) / 2.0;
        let wanted = [values[n] as i16, values[20 + n] as i16, half.round() as i16, values[40 + n] as i16];
        assert_eq!([found[n], found[20 + n], found[40 + n], found[60 + n]], wanted, "sample {n}");
    }
}

#[test]
fn surplus_bytes_are_warned_of() {
    let mut sample = named("nrrd raw");
    sample.files[0].1.extend([1, 2, 3]);
    let messages: Vec<_> = open(&sample).warnings().iter().map(ToString::to_string).collect();
    assert_eq!(messages, ["v.nrrd: 3 bytes after the voxels are not read [file-content]"]);
    let mut packed = named("nrrd gzip");
    let header = samples::nrrd_header("uint16", "gzip", "endian: big\n") + "\n";
    packed.files[0].1 = samples::join(&header, &samples::gzip(&[7; 122]));
    let mut reader = open(&packed);
    reader.read(&NoProgress).unwrap();
    let messages: Vec<_> = reader.warnings().iter().map(ToString::to_string).collect();
    assert_eq!(messages, ["v.nrrd: the encoded data go on after the voxels; the rest is not read [file-content]"]);
}

/// Files of at least 1 MiB in native order are mapped.
#[test]
fn large_raw_file_on_disk_is_mapped() {
    let folder = tempfile::tempdir().unwrap();
    let voxels: Vec<u8> = (0..1u32 << 20).map(|n| (n * 7 + n / 256) as u8).collect();
    std::fs::write(folder.path().join("v.raw"), &voxels).unwrap();
    let header = folder.path().join("v.raw.ron");
    std::fs::write(&header, "RawVolume(file: \"v.raw\", dims: (256, 64, 64), scalar: \"u8\")").unwrap();
    let all = loaders();
    let volume = volact_core::loader::load(
        volact_core::loader::choose(&all, &header).unwrap().as_ref(),
        &header,
        &LoadOptions::new(),
        &NoProgress,
    )
    .unwrap();
    assert_eq!(volume.data().bytes(), voxels);
    // A mapped file keeps its bytes when its name has gone.
    std::fs::remove_file(folder.path().join("v.raw")).unwrap();
    assert_eq!(volume.data().bytes(), voxels);
}

#[test]
fn directories_and_missing_files_are_errors_not_hangs() {
    let folder = tempfile::tempdir().unwrap();
    for loader in loaders() {
        let open = |path: &Path| match loader.content() {
            Content::Volume => loader.open(path, &LoadOptions::new()).map(drop),
            Content::Mesh => loader.read_mesh(path, &LoadOptions::new(), &NoProgress).map(drop),
        };
        let error = open(&folder.path().join("missing")).err().unwrap();
        assert!(error.to_string().ends_with("missing: cannot be read"), "{error}");
        assert!(open(folder.path()).is_err());
    }
}
