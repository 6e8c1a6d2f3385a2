//! Malformed inputs, each with the one message that it gets.
//!
//! The table in `docs/malformed-inputs.md` is made from the same cases; `VOLACT_BLESS=1` rewrites
//! it.

mod mesh_cases;
mod mesh_samples;
mod samples;

use std::{error::Error, fmt::Write, fs, path::Path};

use samples::{
    dicom_slice, gzip, join, little, meta_header, nifti1, nrrd_header, png_slice, tiff_plain, tilted, vti_text,
    vtk_header, zlib,
};
use volact_core::{
    LoadError, ScalarType,
    loader::{LoadOptions, NoProgress},
};
use volact_files::{Storage, open_in, read_mesh_in};

/// Format, input and message.
const MESSAGES: &[(&str, &str, &str)] = &[
    ("raw", "no data file", "v.raw: cannot be read: entity not found"),
    ("raw", "data file too short", "v.raw: holds 59 bytes of voxels, wanted 60"),
    ("raw", "a dimension of 0", "v.raw.ron: dims is [5, 0, 3], wanted sizes from 1 to 2147483648"),
    (
        "raw",
        "2^60 voxels in 60 bytes",
        "v.raw.ron: dims is [1048576, 1048576, 1048576], wanted a grid that memory can hold",
    ),
    ("raw", "2^55 bytes in 60", "v.raw: holds 60 bytes of voxels, wanted 36028797018963968"),
    (
        "raw",
        "unknown scalar type",
        r#"v.raw.ron: scalar is "u24", wanted one of u8, i8, u16, i16, u32, i32, f16, f32, f64"#,
    ),
    (
        "raw",
        "misspelt field",
        "v.raw.ron: cannot be decoded: 1:26-1:36: Unexpected field named `dimensions` in `RawVolume`, expected one of `file`, `numbers`, `dims`, `scalar`, `components`, `byte_order`, `skip`, `spacing`, `origin`, `axes`, `slope`, `intercept`, or `unit` instead",
    ),
    ("raw", "no byte order", r#"v.raw.ron: byte_order is missing, wanted "little" or "big""#),
    ("raw", "five components", r#"v.raw.ron: describes no volume: volume "v.raw.ron": components is 5, wanted 1 to 4"#),
    ("raw", "a spacing of 0", "v.raw.ron: spacing is [1.0, 0.0, 1.0], wanted positive and finite"),
    ("raw", "an option that nobody declares", r#"loader "raw": parameter "spacings" is declared by nobody"#),
    ("nrrd", "unknown version", r#"v.nrrd: first line is "NRRD0009", wanted NRRD0001 to NRRD0005"#),
    ("nrrd", "no sizes", r#"v.nrrd: field "sizes" is missing, wanted one"#),
    ("nrrd", "sizes do not fit the dimension", "v.nrrd: sizes is 2 sizes for dimension 3, wanted one for each axis"),
    ("nrrd", "a size that is no number", r#"v.nrrd: sizes is "four", wanted whole numbers"#),
    ("nrrd", "64-bit integers", r#"v.nrrd: type "int64" is not supported; convert it to 32-bit integers or to double"#),
    ("nrrd", "unknown encoding", r#"v.nrrd: encoding is "zstd", wanted raw, gzip, bzip2, ascii or hex"#),
    ("nrrd", "no byte order", r#"v.nrrd: field "endian" is missing, wanted little or big"#),
    ("nrrd", "a field given twice", r#"v.nrrd: field "endian" is given twice, wanted once"#),
    (
        "nrrd",
        "gzip: 2^42 voxels in 20 bytes",
        "v.nrrd: holds 20 bytes of gzip voxels, enough for at most 20640, wanted 4398046511104",
    ),
    ("nrrd", "gzip: stream cut", "v.nrrd: holds 0 bytes of decoded voxels, wanted 120"),
    (
        "nrrd",
        "gzip: wrong checksum",
        "v.nrrd: cannot be decoded: corrupt gzip stream does not have a matching checksum",
    ),
    ("nrrd", "bzip2: not bzip2 at all", "v.nrrd: cannot be decoded: bzip2: bz2 header missing"),
    (
        "nrrd",
        "text: number beyond its type",
        r#"v.nrrd: cannot be decoded: number 0 is "300", wanted a number of type u8"#,
    ),
    ("nrrd", "text: too few numbers", "v.nrrd: holds 59 bytes of decoded voxels, wanted 60"),
    ("nrrd", "hex: no digit", "v.nrrd: cannot be decoded: 'g' is no hexadecimal digit"),
    ("nrrd", "a file of the list is missing", "c: cannot be read: entity not found"),
    (
        "nrrd",
        "directions in one plane",
        "v.nrrd: space directions is [1, 0, 0] [0, 1, 0] [1, 1, 0] from [0, 0, 0], wanted three finite, independent directions",
    ),
    (
        "nrrd",
        "a time axis",
        "v.nrrd: axis 4 (of 4) that is not of space is not supported; make components the first axis and split time into files",
    ),
    ("nrrd", "the header as its own data", "v.nrrd: data file is the header itself, wanted another file"),
    ("metaimage", "no data file named", r#"v.mha: field "ElementDataFile" is missing, wanted one"#),
    (
        "metaimage",
        "64-bit integers",
        r#"v.mha: element type "MET_LONG" is not supported; convert it to MET_INT or MET_DOUBLE"#,
    ),
    ("metaimage", "unknown type", r#"v.mha: ElementType is "MET_WORD", wanted a type of MetaImage, e.g. MET_SHORT"#),
    ("metaimage", "a flag that is none", r#"v.mha: CompressedData is "Maybe", wanted True or False"#),
    ("metaimage", "zlib: damaged", "v.mha: cannot be decoded: corrupt deflate stream"),
    ("metaimage", "too few bytes", "v.mha: holds 119 bytes of voxels, wanted 120"),
    (
        "metaimage",
        "a pattern with step 0",
        r#"v.mha: ElementDataFile is "s%d.raw 1 3 0", wanted a pattern with one %d, the first number, the last and the step"#,
    ),
    ("metaimage", "a matrix of the wrong size", r#"v.mha: TransformMatrix is "1 0 0 1", wanted 9 numbers"#),
    ("nifti", "header cut", "v.nii: holds 300 bytes of header, wanted 348"),
    (
        "nifti",
        "no magic",
        r#"v.nii: magic is "xyz\x00", wanted n+1 or ni1 (n+2 or ni2 at byte 4), with sizeof_hdr 348 (540)"#,
    ),
    ("nifti", "nine dimensions", "v.nii: dim[0] is 9, wanted 1 to 7 dimensions"),
    ("nifti", "a negative size", "v.nii: dim is [-1, 4, 3], wanted sizes of at least 1, not -1"),
    (
        "nifti",
        "complex numbers",
        "v.nii: datatype 32 (binary, complex, 64-bit integer or 128-bit) is not supported; convert it to float or to 32-bit integers",
    ),
    ("nifti", "unknown type", "v.nii: datatype is 99, wanted a code of NIfTI"),
    ("nifti", "data begin inside the header", "v.nii: vox_offset is 10, wanted at least 348"),
    ("nifti", "data begin nowhere", "v.nii: vox_offset is NaN, wanted at least 348"),
    ("nifti", "too few voxels", "v.nii: holds 48 bytes of voxels, wanted 120"),
    (
        "nifti",
        "an sform of zeros",
        "v.nii: sform is [0, 0, 0] [0, 0, 0] [0, 0, 0] from [0, 0, 0], wanted three finite, independent directions",
    ),
    (
        "nifti",
        "an infinite origin",
        "v.nii: sform is [-2, 0, 0] [0, -3, 0] [0, -0.5, 4] from [-inf, 20, 30], wanted three finite, independent directions",
    ),
    (
        "nifti",
        "gzip: 2^45 voxels",
        "v.nii: holds 110 bytes of gzip voxels, enough for at most 113520, wanted 70362301923678",
    ),
    ("nifti", "header without its image", "v.img: cannot be read: entity not found"),
    ("dicom", "no DICOM at all", "v.dcm: head is without DICM at byte 128, wanted a DICOM file"),
    ("dicom", "a folder without images", "d: series is missing, wanted DICOM images"),
    (
        "dicom",
        "JPEG 2000",
        "d/1.dcm: transfer syntax 1.2.840.10008.1.2.4.90 (JPEG 2000 lossless) is not supported; decompress it, e.g. with dcmdjpeg or gdcmconv --raw",
    ),
    (
        "dicom",
        "a deflated data set",
        "d/1.dcm: a deflated data set is not supported; save it uncompressed (explicit VR little endian)",
    ),
    (
        "dicom",
        "two series",
        "d: a folder of several series: 1.2.3.4 (1 files), 1.2.3.5 (1 files) is not supported; name one with the option series",
    ),
    ("dicom", "a slice without a place", "d/1.dcm: ImagePositionPatient is missing, wanted one"),
    (
        "dicom",
        "the same place twice",
        "d/3.dcm: ImagePositionPatient is [10, 21, 32] of two slices, wanted another than that of 2.dcm",
    ),
    (
        "dicom",
        "uneven distances",
        "d: a stack of uneven distances: 2.24 mm (slices 1 to 2), 11.18 mm (slices 2 to 3) is not supported; set the option resample to true to interpolate it to an even one",
    ),
    (
        "dicom",
        "a slice off the line",
        "d/2.dcm: ImagePositionPatient is 3.0000 mm beside the line from the first slice to the last, wanted all slices on one line",
    ),
    (
        "dicom",
        "slices that are turned",
        "d/2.dcm: ImageOrientationPatient is [0, 1, 0] [1, 0, 0], wanted [1, 0, 0] [0, 1, 0] as in 1.dcm",
    ),
    ("dicom", "pixels cut", "d/2.dcm: holds 33 bytes of voxels, wanted 40"),
    ("dicom", "cut in its elements", "d/1.dcm: holds 400 bytes of DICOM elements, wanted 402"),
    ("tiff", "nothing after the magic", "v.tif: cannot be decoded: the file ends too early"),
    (
        "tiff",
        "directories in a circle",
        "v.tif: cannot be decoded: format error: file contained a cycle in the list of IFDs",
    ),
    ("tiff", "pages of two sizes", "v.tif: page 1 is 4 x 4, 1 of u8, wanted 5 x 4, 1 of u8 as the first"),
    (
        "tiff",
        "2^40 pixels in 150 bytes",
        "v.tif: holds 142 bytes of TIFF, enough for at most 581632 bytes of pixels, wanted 1099511627776",
    ),
    ("tiff", "pixels outside the file", "v.tif: cannot be decoded: the file ends too early"),
    (
        "tiff",
        "a palette",
        "v.tif: cannot be decoded: unsupported error: Photometric interpretation RGBPalette with bits per sample [8] is unsupported",
    ),
    (
        "tiff",
        "unknown compression",
        "v.tif: cannot be decoded: unsupported error: compression method Unknown(60000) is unsupported",
    ),
    ("png", "cut in its pixels", "v.png: cannot be decoded: unexpected end of file"),
    (
        "png",
        "wrong checksum",
        "v.png: cannot be decoded: CRC error: expected 0x0 have 0x6358aa9c while decoding ChunkType { type: IHDR, critical: true, private: false, reserved: false, safecopy: false } chunk.",
    ),
    (
        "png",
        "2^60 pixels",
        "v.png: holds 45 bytes of PNG, enough for at most 46440 bytes of pixels, wanted 1152921504606846976",
    ),
    ("png", "a palette", "v.png: a palette is not supported; save it as grey or RGB"),
    ("png", "a gap in a series", "p: series is 2 followed by 4, wanted numbers in even steps, here of 1"),
    ("png", "slices of two sizes", "p/s2.png: slice is 5 x 5, 1 of u8, wanted 5 x 4, 1 of u8 as s1.png"),
    (
        "vtk",
        "version 9",
        r##"v.vtk: first line is "# vtk DataFile Version 9.0", wanted # vtk DataFile Version 1.0 to 5.x"##,
    ),
    ("vtk", "neither ASCII nor BINARY", r#"v.vtk: coding is "XML", wanted ASCII or BINARY"#),
    (
        "vtk",
        "a mesh",
        "v.vtk: dataset UNSTRUCTURED_GRID is not supported; only STRUCTURED_POINTS are volumes; meshes are read by the loader vtk-mesh",
    ),
    ("vtk", "points that do not fit", "v.vtk: POINT_DATA is 61, wanted 60, the product of DIMENSIONS"),
    ("vtk", "no lookup table line", r#"v.vtk: line after SCALARS is "\0\0\0\0\0\0\0\0\0\0\0\0", wanted LOOKUP_TABLE"#),
    ("vtk", "unknown type", r#"v.vtk: data type is "word", wanted a type of VTK, e.g. float"#),
    (
        "vtk",
        "64-bit integers",
        r#"v.vtk: data type "vtktypeint64" is not supported; convert it to 32-bit integers or to double"#,
    ),
    ("vtk", "cell data", "v.vtk: cell data is not supported; convert it to point data"),
    ("vtk", "too few bytes", "v.vtk: holds 100 bytes of voxels, wanted 120"),
    (
        "vtk",
        "a word among the numbers",
        r#"v.vtk: cannot be decoded: number 2 is "three1", wanted a number of type i16"#,
    ),
    ("vtk", "no array", "v.vtk: array is missing, wanted point data"),
    (
        "vti",
        "a tag that is not closed",
        "v.vti: cannot be decoded: ill-formed document: expected `</PointData>`, but `</Piece>` was found",
    ),
    ("vti", "another kind of file", r#"v.vti: VTK file type "PolyData" is not supported; only ImageData are volumes"#),
    (
        "vti",
        "64-bit integers",
        r#"v.vti: array type "Int64" is not supported; convert it to 32-bit integers or to Float64"#,
    ),
    ("vti", "no base64", "v.vti: cannot be decoded: Invalid symbol 33, offset 2."),
    ("vti", "fewer bytes than the grid", r#"v.vti: array "s" is 3 bytes, wanted 60 bytes"#),
    ("vti", "base64 cut", "v.vti: holds 6 bytes of base64 data, wanted 64"),
    (
        "vti",
        "lzma",
        r#"v.vti: compressor "vtkLZMADataCompressor" is not supported; save it with zlib, with LZ4 or uncompressed"#,
    ),
    (
        "vti",
        "2^32 blocks",
        "v.vti: compressed blocks is 4294967295 of 1 bytes, the last of 0, wanted 60 bytes altogether",
    ),
    (
        "vti",
        "blocks that do not fit the grid",
        "v.vti: compressed blocks is 2 of 50 bytes, the last of 11, wanted 60 bytes altogether",
    ),
    ("vti", "an empty extent", "v.vti: WholeExtent is [0, 4, 3], wanted sizes from 1 to 2147483648"),
    ("vti", "too few numbers", "v.vti: holds 5 bytes of text voxels, enough for at most 3, wanted 60"),
    ("vti", "appended data missing", "v.vti: element AppendedData is missing, wanted one"),
];

struct Case {
    loader: &'static str,
    what: &'static str,
    path: &'static str,
    files: Vec<(&'static str, Vec<u8>)>,
}

fn case(loader: &'static str, what: &'static str, files: Vec<(&'static str, Vec<u8>)>) -> Case {
    let path = files[0].0;
    let path = if path.contains('/') { path.split_once('/').unwrap().0 } else { path };
    Case { loader, what, path, files }
}

fn message(case: &Case) -> String {
    let storage = Storage::memory(case.files.clone());
    let mut options = LoadOptions::new();
    if case.what.contains("option") {
        options.insert("spacings".into(), 2.0.into());
    }
    let path = Path::new(case.path);
    let mesh = mesh_cases::LOADERS.contains(&case.loader);
    let result = if mesh {
        read_mesh_in(&storage, case.loader, path, &options, &NoProgress).map(|_| ())
    } else {
        open_in(&storage, case.loader, path, &options).and_then(|mut reader| reader.read(&NoProgress).map(|_| ()))
    };
    match result {
        Ok(()) => "accepted".into(),
        Err(error) => chain(&error),
    }
}

fn chain(error: &LoadError) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        write!(text, ": {cause}").unwrap();
        source = cause.source();
    }
    text
}

fn patched(mut bytes: Vec<u8>, at: usize, with: &[u8]) -> Vec<u8> {
    bytes[at..at + with.len()].copy_from_slice(with);
    bytes
}

fn cut(mut bytes: Vec<u8>, length: usize) -> Vec<u8> {
    bytes.truncate(length);
    bytes
}

fn raw_cases() -> Vec<Case> {
    let header = |text: &str| ("v.raw.ron", format!("RawVolume(file: \"v.raw\", {text})").into_bytes());
    let data = |n: usize| ("v.raw", vec![0u8; n]);
    vec![
        case("raw", "no data file", vec![header("dims: (5, 4, 3), scalar: \"u8\"")]),
        case("raw", "data file too short", vec![header("dims: (5, 4, 3), scalar: \"u8\""), data(59)]),
        case("raw", "a dimension of 0", vec![header("dims: (5, 0, 3), scalar: \"u8\""), data(60)]),
        case(
            "raw",
            "2^60 voxels in 60 bytes",
            vec![header("dims: (1048576, 1048576, 1048576), scalar: \"u8\""), data(60)],
        ),
        case("raw", "2^55 bytes in 60", vec![header("dims: (131072, 524288, 524288), scalar: \"u8\""), data(60)]),
        case("raw", "unknown scalar type", vec![header("dims: (5, 4, 3), scalar: \"u24\""), data(180)]),
        case("raw", "misspelt field", vec![header("dimensions: (5, 4, 3), scalar: \"u8\""), data(60)]),
        case("raw", "no byte order", vec![header("dims: (5, 4, 3), scalar: \"u16\""), data(120)]),
        case("raw", "five components", vec![header("dims: (5, 4, 3), scalar: \"u8\", components: 5"), data(300)]),
        case(
            "raw",
            "a spacing of 0",
            vec![header("dims: (5, 4, 3), scalar: \"u8\", spacing: (1.0, 0.0, 1.0)"), data(60)],
        ),
        case("raw", "an option that nobody declares", vec![header("dims: (5, 4, 3), scalar: \"u8\""), data(60)]),
    ]
}

fn nrrd_cases() -> Vec<Case> {
    let one = |what, header: String, data: &[u8]| case("nrrd", what, vec![("v.nrrd", join(&(header + "\n"), data))]);
    let short = |encoding: &str, more: &str| nrrd_header("short", encoding, more);
    let huge = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: 65536 65536 1024\nencoding: gzip\n";
    let packed = gzip(&[7; 120]);
    let mut wrong_sum = packed.clone();
    let end = wrong_sum.len();
    wrong_sum[end - 8] ^= 1;
    let list = short("raw", "endian: little\ndata file: LIST\na\nb\nc\n");
    vec![
        one("unknown version", "NRRD0009\n".into(), &[]),
        one("no sizes", "NRRD0004\ntype: short\ndimension: 3\n".into(), &[]),
        one("sizes do not fit the dimension", short("raw", "").replace("sizes: 5 4 3", "sizes: 5 4"), &[]),
        one("a size that is no number", short("raw", "").replace("sizes: 5 4 3", "sizes: 5 four 3"), &[]),
        one("64-bit integers", nrrd_header("int64", "raw", "endian: little\n"), &[0; 480]),
        one("unknown encoding", short("zstd", "endian: little\n"), &[0; 120]),
        one("no byte order", short("raw", ""), &[0; 120]),
        one("a field given twice", short("raw", "endian: little\nendian: big\n"), &[0; 120]),
        one("gzip: 2^42 voxels in 20 bytes", huge.into(), &[0; 20]),
        one("gzip: stream cut", short("gzip", "endian: little\n"), &packed[..packed.len() / 2]),
        one("gzip: wrong checksum", short("gzip", "endian: little\n"), &wrong_sum),
        one("bzip2: not bzip2 at all", short("bzip2", "endian: little\n"), &[9; 64]),
        one("text: number beyond its type", nrrd_header("uchar", "ascii", ""), "300 ".repeat(60).as_bytes()),
        one("text: too few numbers", nrrd_header("uchar", "ascii", ""), "123 ".repeat(59).as_bytes()),
        one("hex: no digit", nrrd_header("uchar", "hex", ""), "0g".repeat(60).as_bytes()),
        case(
            "nrrd",
            "a file of the list is missing",
            vec![("v.nhdr", list.into_bytes()), ("a", vec![0; 40]), ("b", vec![0; 40])],
        ),
        one(
            "directions in one plane",
            short("raw", "endian: little\nspace directions: (1,0,0) (0,1,0) (1,1,0)\n"),
            &[0; 120],
        ),
        one(
            "a time axis",
            "NRRD0004\ntype: uchar\ndimension: 4\nsizes: 5 4 3 2\nkinds: domain domain domain time\nencoding: raw\n"
                .into(),
            &[0; 120],
        ),
        one("the header as its own data", short("raw", "endian: little\ndata file: v.nrrd\n"), &[0; 120]),
    ]
}

fn metaimage_cases() -> Vec<Case> {
    let one = |what, kind, more: &str, data: &[u8]| {
        case("metaimage", what, vec![("v.mha", join(&meta_header(kind, more), data))])
    };
    let local = "ElementDataFile = LOCAL\n";
    let packed = "CompressedData = True\nElementDataFile = LOCAL\n";
    let mut torn = zlib(&little(&samples::grid(1), ScalarType::I16));
    torn[20] ^= 0xff;
    vec![
        one("no data file named", "MET_SHORT", "", &[]),
        one("64-bit integers", "MET_LONG", local, &[0; 480]),
        one("unknown type", "MET_WORD", local, &[0; 480]),
        one("a flag that is none", "MET_SHORT", "CompressedData = Maybe\nElementDataFile = LOCAL\n", &[]),
        one("zlib: damaged", "MET_SHORT", packed, &torn),
        one("too few bytes", "MET_SHORT", local, &[0; 119]),
        one("a pattern with step 0", "MET_SHORT", "ElementDataFile = s%d.raw 1 3 0\n", &[]),
        one("a matrix of the wrong size", "MET_SHORT", "TransformMatrix = 1 0 0 1\nElementDataFile = LOCAL\n", &[]),
    ]
}

fn nifti_cases() -> Vec<Case> {
    let header = nifti1(4, 16, b"n+1\0", false);
    let whole = [header.clone(), vec![0; 124]].concat();
    let one = |what, bytes: Vec<u8>| case("nifti", what, vec![("v.nii", bytes)]);
    vec![
        one("header cut", cut(header.clone(), 300)),
        one("no magic", patched(whole.clone(), 344, b"xyz\0")),
        one("nine dimensions", patched(whole.clone(), 40, &[9, 0])),
        one("a negative size", patched(whole.clone(), 42, &[0xff, 0xff])),
        one("complex numbers", patched(whole.clone(), 70, &[32, 0])),
        one("unknown type", patched(whole.clone(), 70, &[99, 0])),
        one("data begin inside the header", patched(whole.clone(), 108, &10f32.to_le_bytes())),
        one("data begin nowhere", patched(whole.clone(), 108, &f32::NAN.to_le_bytes())),
        one("too few voxels", cut(whole.clone(), 400)),
        one("an sform of zeros", patched(whole.clone(), 280, &[0; 48])),
        one("an infinite origin", patched(whole.clone(), 292, &f32::INFINITY.to_le_bytes())),
        one("gzip: 2^45 voxels", gzip(&patched(whole, 42, &[0xff, 0x7f, 0xff, 0x7f, 0xff, 0x7f]))),
        case(
            "nifti",
            "header without its image",
            vec![("v.hdr", {
                let mut bytes = nifti1(4, 16, b"ni1\0", false);
                bytes[108..112].fill(0);
                bytes
            })],
        ),
    ]
}

fn tiff_cases() -> Vec<Case> {
    let good = tiff_plain(&[vec![1; 20]], 5, 4, 8, 1);
    let directory = u32::from_le_bytes(good[4..8].try_into().unwrap()) as usize;
    let entry = |n: usize| directory + 2 + 12 * n;
    let mut cycle = good.clone();
    let end = cycle.len();
    cycle[end - 4..].copy_from_slice(&(directory as u32).to_le_bytes());
    let mut pages = tiff_plain(&[vec![1; 20], vec![2; 20]], 5, 4, 8, 1);
    let second = u32::from_le_bytes(good[4..8].try_into().unwrap()) as usize + 2 + 9 * 12 + 4 + 20 + 2 + 8;
    pages[second..second + 4].copy_from_slice(&4u32.to_le_bytes());
    let one = |what, bytes: Vec<u8>| case("tiff", what, vec![("v.tif", bytes)]);
    vec![
        one("nothing after the magic", b"II*\0".to_vec()),
        one("directories in a circle", cycle),
        one("pages of two sizes", pages),
        one("2^40 pixels in 150 bytes", {
            let wide = patched(good.clone(), entry(0) + 8, &(1u32 << 20).to_le_bytes());
            let wide = patched(wide, entry(6) + 8, &(1u32 << 20).to_le_bytes());
            patched(wide, entry(1) + 8, &(1u32 << 20).to_le_bytes())
        }),
        one("pixels outside the file", patched(good.clone(), entry(5) + 8, &9999u32.to_le_bytes())),
        one("a palette", patched(good.clone(), entry(4) + 8, &3u32.to_le_bytes())),
        one("unknown compression", patched(good, entry(3) + 8, &60000u32.to_le_bytes())),
    ]
}

fn png_cases() -> Vec<Case> {
    use png::{BitDepth::Eight, ColorType::Grayscale};
    let good = png_slice(&[1; 20], Grayscale, Eight);
    let taller = {
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, 5, 5);
        encoder.set_color(Grayscale);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&[1; 25]).unwrap();
        writer.finish().unwrap();
        out
    };
    let indexed = {
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, 5, 4);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_palette(vec![0; 30]);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(&[1; 20]).unwrap();
        writer.finish().unwrap();
        out
    };
    let huge = {
        let mut out = Vec::new();
        let mut encoder = png::Encoder::new(&mut out, 1 << 30, 1 << 30);
        encoder.set_color(Grayscale);
        drop(encoder.write_header().unwrap());
        out
    };
    vec![
        case("png", "cut in its pixels", vec![("v.png", cut(good.clone(), good.len() - 20))]),
        case("png", "wrong checksum", vec![("v.png", patched(good.clone(), 29, &[0, 0, 0, 0]))]),
        case("png", "2^60 pixels", vec![("v.png", huge)]),
        case("png", "a palette", vec![("v.png", indexed)]),
        case(
            "png",
            "a gap in a series",
            vec![("p/s1.png", good.clone()), ("p/s2.png", good.clone()), ("p/s4.png", good.clone())],
        ),
        case("png", "slices of two sizes", vec![("p/s1.png", good), ("p/s2.png", taller)]),
    ]
}

fn dicom_cases() -> Vec<Case> {
    let explicit = "1.2.840.10008.1.2.1";
    let slice = |z: usize| dicom_slice(explicit, z, tilted(z));
    let other_series = {
        let bytes = slice(1);
        let at = bytes.windows(8).position(|w| w == b"1.2.3.4\0").unwrap();
        patched(bytes, at, b"1.2.3.5\0")
    };
    let no_position = {
        let bytes = slice(0);
        let at = bytes.windows(6).position(|w| w == b"\x20\0\x32\0DS").unwrap();
        patched(bytes, at + 2, &[0x33])
    };
    let turned = {
        let bytes = slice(1);
        let at = bytes.windows(11).position(|w| w == b"1\\0\\0\\0\\1\\0").unwrap();
        patched(bytes, at, b"0\\1\\0\\1\\0\\0")
    };
    let folder = |what, files: Vec<Vec<u8>>| {
        let names = ["d/1.dcm", "d/2.dcm", "d/3.dcm"];
        case("dicom", what, names.into_iter().zip(files).collect())
    };
    vec![
        case("dicom", "no DICOM at all", vec![("v.dcm", vec![0; 200])]),
        folder("a folder without images", vec![vec![0; 200]]),
        folder("JPEG 2000", vec![dicom_slice("1.2.840.10008.1.2.4.90", 0, tilted(0))]),
        folder("a deflated data set", vec![dicom_slice("1.2.840.10008.1.2.1.99", 0, tilted(0))]),
        folder("two series", vec![slice(0), other_series]),
        folder("a slice without a place", vec![no_position]),
        folder("the same place twice", vec![slice(0), slice(1), dicom_slice(explicit, 2, tilted(1))]),
        folder("uneven distances", vec![slice(0), slice(1), dicom_slice(explicit, 2, [10.0, 26.0, 42.0])]),
        folder("a slice off the line", vec![slice(0), dicom_slice(explicit, 1, [13.0, 21.0, 32.0]), slice(2)]),
        folder("slices that are turned", vec![slice(0), turned]),
        folder("pixels cut", vec![slice(0), cut(slice(1), slice(1).len() - 7)]),
        folder("cut in its elements", vec![cut(slice(0), 400)]),
    ]
}

fn vtk_cases() -> Vec<Case> {
    let one = |what, text: String, data: &[u8]| case("vtk", what, vec![("v.vtk", join(&text, data))]);
    let scalars = "SCALARS s short\nLOOKUP_TABLE default\n";
    let binary = |data: &str| vtk_header("3.0", "BINARY", data);
    let ascii = |data: &str| vtk_header("3.0", "ASCII", data);
    vec![
        one("version 9", vtk_header("9.0", "ASCII", ""), &[]),
        one("neither ASCII nor BINARY", vtk_header("3.0", "XML", ""), &[]),
        one("a mesh", binary("").replace("STRUCTURED_POINTS", "UNSTRUCTURED_GRID"), &[]),
        one("points that do not fit", binary("").replace("POINT_DATA 60", "POINT_DATA 61"), &[]),
        one("no lookup table line", binary("SCALARS s short\n"), &[0; 120]),
        one("unknown type", binary("SCALARS s word\n"), &[0; 120]),
        one("64-bit integers", binary("SCALARS s vtktypeint64\nLOOKUP_TABLE default\n"), &[0; 480]),
        one("cell data", binary("").replace("POINT_DATA", "CELL_DATA"), &[0; 120]),
        one("too few bytes", binary(scalars), &[0; 100]),
        one("a word among the numbers", ascii(scalars), "1 2 three".repeat(60).as_bytes()),
        one("no array", ascii(""), &[]),
    ]
}

fn vti_cases() -> Vec<Case> {
    let order = "byte_order=\"LittleEndian\" header_type=\"UInt32\"";
    let packed = &format!("{order} compressor=\"vtkZLibDataCompressor\"");
    let lzma = &format!("{order} compressor=\"vtkLZMADataCompressor\"");
    let array = |kind: &str, format: &str, body: &str| {
        format!("type=\"{kind}\" Name=\"s\" format=\"{format}\">{body}</DataArray>\n")
    };
    let one = |what, text: String| case("vti", what, vec![("v.vti", text.into_bytes())]);
    let inline = |attributes: &str, body: &str| vti_text(attributes, &array("UInt8", "binary", body), "</VTKFile>");
    let ascii = |body: &str| vti_text(order, &array("UInt8", "ascii", body), "</VTKFile>");
    vec![
        one("a tag that is not closed", ascii("1").replace("</PointData>", "")),
        one("another kind of file", ascii("1").replace("type=\"ImageData\"", "type=\"PolyData\"")),
        one("64-bit integers", vti_text(order, &array("Int64", "ascii", "1"), "</VTKFile>")),
        one("no base64", inline(order, "PA!AAAAA")),
        one("fewer bytes than the grid", inline(order, "AwAAAAECAw==")),
        one("base64 cut", inline(order, "PAAAAAEC")),
        one("lzma", inline(lzma, "AAAA")),
        one("2^32 blocks", inline(packed, "/////wEAAAAAAAAA")),
        one("blocks that do not fit the grid", inline(packed, "AgAAADIAAAALAAAA")),
        one("an empty extent", ascii("1").replace("2 6 0 3 0 2", "6 2 0 3 0 2")),
        one("too few numbers", ascii("1 2 3")),
        one(
            "appended data missing",
            vti_text(order, "type=\"UInt8\" format=\"appended\" offset=\"0\"/>", "</VTKFile>"),
        ),
    ]
}

fn cases() -> Vec<Case> {
    [
        raw_cases(),
        nrrd_cases(),
        metaimage_cases(),
        nifti_cases(),
        dicom_cases(),
        tiff_cases(),
        png_cases(),
        vtk_cases(),
        vti_cases(),
        mesh_cases::cases(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn messages() -> impl Iterator<Item = &'static (&'static str, &'static str, &'static str)> {
    MESSAGES.iter().chain(mesh_cases::MESSAGES)
}

#[test]
fn every_malformed_input_has_its_message() {
    let cases = cases();
    assert!(cases.len() >= 200);
    assert_eq!(cases.len(), messages().count());
    let mut wrong = Vec::new();
    for (case, (loader, what, wanted)) in cases.iter().zip(messages()) {
        assert_eq!((case.loader, case.what), (*loader, *what));
        let found = message(case);
        if found != *wanted {
            wrong.push(format!("{loader} | {what} | {found}"));
        }
    }
    assert!(wrong.is_empty(), "messages that changed:\n{}", wrong.join("\n"));
}

#[test]
fn table_of_malformed_inputs_is_current() {
    let mut text = String::from(
        "# Malformed inputs and their messages\n\nMade by `plugins/files/tests/malformed.rs`, which asserts each; \
         `VOLACT_BLESS=1 cargo test -p volact-files` rewrites it.\n\n| format | input | message |\n| --- | --- | --- |\n",
    );
    for (loader, what, message) in messages() {
        let message = message.replace('|', "\\|").replace('\n', " ");
        writeln!(text, "| {loader} | {what} | `{message}` |").unwrap();
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/malformed-inputs.md");
    if std::env::var_os("VOLACT_BLESS").is_some() {
        fs::write(&path, &text).unwrap();
    }
    assert_eq!(fs::read_to_string(&path).unwrap_or_default(), text, "VOLACT_BLESS=1 rewrites the table");
}
