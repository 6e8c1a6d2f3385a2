//! Pictures out and in again. What a PNG holds is checked with the png crate's own decoder.

use std::{fs, path::Path};

use volact_core::{Camera, Frame, FrameDesc, glam::DVec3};
use volact_files::picture::{PngOptions, load_picture, save_exr, save_npy, save_png};

fn frame(color: Vec<[f32; 4]>, width: usize, background: [f32; 4]) -> Frame {
    let camera = Camera::orthographic(DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0);
    let height = color.len() / width;
    let mut frame = Frame::empty(&FrameDesc::new(camera, width, height).with_background(background));
    frame.color = color.into();
    frame
}

fn decoded(path: &Path) -> (Vec<u8>, png::OutputInfo) {
    let decoder = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    (bytes, info)
}

/// Half-covered red over opaque green is half of each: 0.5·255 + 0.5 cut off is 128.
#[test]
fn png_lays_the_background_under_without_gamma() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let frame = frame(vec![[0.5, 0.0, 0.0, 0.5], [2.0, -1.0, f32::NAN, 1.0]], 2, [0.0, 1.0, 0.0, 1.0]);
    save_png(&path, &frame, PngOptions::default()).unwrap();
    let (bytes, info) = decoded(&path);
    assert_eq!((info.width, info.height), (2, 1));
    assert_eq!(bytes, [128, 128, 0, 255, 255, 0, 0, 255]);
}

#[test]
fn png_has_straight_alpha_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let frame = frame(vec![[0.25, 0.0, 0.125, 0.5], [0.0; 4]], 1, [0.0, 1.0, 0.0, 1.0]);
    let options = PngOptions { over_background: false, sixteen_bit: true };
    save_png(&path, &frame, options).unwrap();
    let (bytes, info) = decoded(&path);
    assert_eq!((info.width, info.height, info.bit_depth), (1, 2, png::BitDepth::Sixteen));
    let words: Vec<u16> = bytes.chunks_exact(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
    assert_eq!(words, [32768, 0, 16384, 32768, 0, 0, 0, 0]);
    let picture = load_picture(&path).unwrap();
    assert_eq!(picture.rgba[0][0], 32768.0 / 65535.0);
}

#[test]
fn exr_and_npy_keep_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let color: Vec<[f32; 4]> =
        (0..15).map(|n| [n as f32 * 0.1, 1e-20, -3.5e10 * n as f32, 1.0 / (n + 1) as f32]).collect();
    let frame = frame(color.clone(), 5, [1.0; 4]);
    for (name, save) in [("a.exr", save_exr as fn(&Path, &Frame) -> _), ("a.npy", save_npy)] {
        let path = folder.path().join(name);
        save(&path, &frame).unwrap();
        let picture = load_picture(&path).unwrap();
        assert_eq!((picture.width, picture.height), (5, 3), "{name}");
        assert_eq!(picture.rgba, color, "{name}");
    }
}

/// NumPy's own description of its format: magic, version, length, dictionary, data at a multiple
/// of 64.
#[test]
fn npy_is_laid_out_as_numpy_says() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    save_npy(&path, &frame(vec![[1.0, 2.0, 3.0, 4.0]; 6], 3, [0.0; 4])).unwrap();
    let bytes = fs::read(&path).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!((10 + length) % 64, 0);
    let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
    assert_eq!(header.trim_end(), "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, 4), }");
    assert!(header.ends_with('\n'));
    assert_eq!(bytes.len(), 10 + length + 6 * 16);
    assert_eq!(bytes[10 + length..14 + length], 1f32.to_le_bytes());
    // Other programs write three channels: an opaque picture.
    let mut three = bytes[..10 + length].to_vec();
    let at = three.windows(2).position(|w| w == b"4)").unwrap();
    three[at] = b'3';
    three.extend([1.0f32, 2.0, 3.0].repeat(6).iter().flat_map(|v| v.to_le_bytes()));
    fs::write(&path, three).unwrap();
    assert_eq!(load_picture(&path).unwrap().rgba, [[1.0, 2.0, 3.0, 1.0]; 6]);
}

#[test]
fn failed_writing_leaves_nothing_behind_and_success_only_the_picture() {
    let folder = tempfile::tempdir().unwrap();
    let good = frame(vec![[1.0; 4]; 4], 2, [0.0; 4]);
    save_png(&folder.path().join("a.png"), &good, PngOptions::default()).unwrap();
    save_exr(&folder.path().join("a.exr"), &good).unwrap();
    let mut bad = good.clone();
    bad.width = 3;
    let path = folder.path().join("b.png");
    let error = save_png(&path, &bad, PngOptions::default()).unwrap_err().to_string();
    assert!(error.ends_with("picture is 3 x 2 with 4 pixels, wanted as many pixels as its size says, at least one"));
    // A folder in the way of the picture: the rename fails.
    fs::create_dir(folder.path().join("c.exr")).unwrap();
    fs::write(folder.path().join("c.exr/x"), "").unwrap();
    let error = save_exr(&folder.path().join("c.exr"), &good).unwrap_err().to_string();
    assert!(error.ends_with("c.exr: cannot be written"), "{error}");
    let error = save_png(&folder.path().join("nowhere/d.png"), &good, PngOptions::default()).unwrap_err().to_string();
    assert!(error.ends_with(": cannot be written"), "{error}");
    let mut names: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["a.exr", "a.png", "c.exr"]);
}

#[test]
fn other_files_and_damaged_pictures_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    fs::write(&path, "hello world").unwrap();
    let error = load_picture(&path).unwrap_err().to_string();
    assert!(error.ends_with("first bytes is \"hello wo\", wanted those of PNG, OpenEXR or NumPy"), "{error}");
    let good = frame(vec![[0.5; 4]; 64], 8, [0.0; 4]);
    for (name, save) in [("a.exr", save_exr as fn(&Path, &Frame) -> _), ("a.npy", save_npy)] {
        let path = folder.path().join(name);
        save(&path, &good).unwrap();
        let whole = fs::read(&path).unwrap();
        for length in [8, 9, 40, whole.len() - 1] {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(load_picture(&path).is_err(), "{name} cut at {length}");
        }
    }
    let huge = "{'descr': '<f4', 'fortran_order': False, 'shape': (1048576, 1048576, 4), }";
    let bytes = [b"\x93NUMPY\x01\x00", &(huge.len() as u16).to_le_bytes()[..], huge.as_bytes()].concat();
    fs::write(&path, bytes).unwrap();
    let error = load_picture(&path).unwrap_err().to_string();
    assert!(error.ends_with("picture is 1048576 x 1048576, wanted 1 to 268435456 pixels"), "{error}");
}
