//! Small valid files of every format, written here by code that shares nothing with the readers.
//!
//! All hold the same 5 × 4 × 3 grid; [`grid`] says which numbers.

#![expect(dead_code, reason = "each test file uses a part of this")]

use std::{io::Write, path::PathBuf};

use base64::{Engine, engine::general_purpose::STANDARD};
use volact_core::ScalarType;
use volact_files::Storage;

/// Samples along x, y, z.
pub const DIMS: [usize; 3] = [5, 4, 3];

/// One valid file, with the files that belong to it.
pub struct Sample {
    pub name: &'static str,
    pub loader: &'static str,
    pub path: &'static str,
    pub files: Vec<(String, Vec<u8>)>,
    pub scalar: ScalarType,
    pub components: usize,
    /// All voxels in native byte order.
    pub voxels: Vec<u8>,
}

impl Sample {
    pub fn storage(&self) -> Storage {
        Storage::memory(self.files.iter().map(|(path, bytes)| (PathBuf::from(path), bytes.clone())))
    }

    /// The same files with one of them replaced.
    pub fn with(&self, index: usize, bytes: Vec<u8>) -> Storage {
        let mut files = self.files.clone();
        files[index].1 = bytes;
        Storage::memory(files)
    }
}

/// The numbers: 60 of them for one component, no two neighbours alike.
pub fn grid(components: usize) -> Vec<i32> {
    (0..60 * components as i32).map(|n| (n * 37 + n / 7) % 251).collect()
}

fn bytes_of(values: &[i32], scalar: ScalarType, big: bool) -> Vec<u8> {
    let mut out = Vec::new();
    for v in values {
        let mut raw = match scalar {
            ScalarType::U8 => vec![*v as u8],
            ScalarType::I16 => (*v as i16).to_le_bytes().to_vec(),
            ScalarType::U16 => (*v as u16).to_le_bytes().to_vec(),
            ScalarType::F32 => (*v as f32).to_le_bytes().to_vec(),
            ScalarType::I32 => v.to_le_bytes().to_vec(),
            other => panic!("no sample has {other}"),
        };
        if big {
            raw.reverse();
        }
        out.extend(raw);
    }
    out
}

pub fn native(values: &[i32], scalar: ScalarType) -> Vec<u8> {
    bytes_of(values, scalar, cfg!(target_endian = "big"))
}

pub fn little(values: &[i32], scalar: ScalarType) -> Vec<u8> {
    bytes_of(values, scalar, false)
}

pub fn big(values: &[i32], scalar: ScalarType) -> Vec<u8> {
    bytes_of(values, scalar, true)
}

pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub fn bzip2(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

pub fn join(head: &str, tail: &[u8]) -> Vec<u8> {
    [head.as_bytes(), tail].concat()
}

fn words(values: &[i32]) -> String {
    values.iter().map(|v| v.to_string()).collect::<Vec<_>>().join(" ")
}

fn sample(
    name: &'static str,
    loader: &'static str,
    scalar: ScalarType,
    components: usize,
    files: Vec<(&str, Vec<u8>)>,
) -> Sample {
    let path = Box::leak(files[0].0.to_owned().into_boxed_str());
    let files = files.into_iter().map(|(path, bytes)| (path.to_owned(), bytes)).collect();
    let voxels = native(&grid(components), scalar);
    Sample { name, loader, path, files, scalar, components, voxels }
}

const RAW: &str = "RawVolume(file: \"v.raw\", dims: (5, 4, 3), scalar: \"u16\", byte_order: \"big\", skip: 4, \
                   spacing: (1.0, 2.0, 3.0), origin: (7.0, 8.0, 9.0), slope: 2.0, intercept: -1.0, unit: \"HU\")";

fn raw() -> Vec<Sample> {
    use ScalarType::{I16, U16};
    let values = grid(1);
    let mut series = vec![(
        "v.raw.ron",
        b"(file: \"s %02d.raw\", numbers: (8, 10), dims: (5, 4, 3), scalar: \"i16\", byte_order: \"little\")".to_vec(),
    )];
    for (n, path) in ["s 08.raw", "s 09.raw", "s 10.raw"].into_iter().enumerate() {
        series.push((path, little(&values[n * 20..n * 20 + 20], I16)));
    }
    vec![
        sample("raw", "raw", U16, 1, vec![("v.raw.ron", RAW.into()), ("v.raw", join("skip", &big(&values, U16)))]),
        sample("raw series", "raw", I16, 1, series),
    ]
}

/// An NRRD header without its end.
pub fn nrrd_header(kind: &str, encoding: &str, more: &str) -> String {
    format!("NRRD0004\n# made by a test\ntype: {kind}\ndimension: 3\nsizes: 5 4 3\nencoding: {encoding}\n{more}")
}

fn nrrd() -> Vec<Sample> {
    use ScalarType::{F32, I16, U8, U16};
    let values = grid(1);
    let one = |name, scalar, header: String, data: &[u8]| {
        sample(name, "nrrd", scalar, 1, vec![("v.nrrd", join(&(header + "\n"), data))])
    };
    let placed = "endian: little\nspace: right-anterior-superior\nspace origin: (10,20,30)\nspace directions: (2,0,0) \
                  (0,3,0) (0,1,4)\n";
    let hex: String = big(&values, U16).iter().map(|b| format!("{b:02x}\n")).collect();
    let slices: Vec<_> = (0..3).map(|z| little(&values[z * 20..z * 20 + 20], I16)).collect();
    let list = nrrd_header("short", "raw", "endian: little\ndata file: LIST\na\nb\nc\n");
    let pattern = nrrd_header("short", "gzip", "endian: little\ndata file: q.%d 9 11 1\n");
    let vector = "NRRD0005\ntype: uchar\ndimension: 4\nsizes: 3 5 4 3\nkinds: vector domain domain domain\nencoding: \
                  raw\n\n";
    vec![
        one("nrrd raw", I16, nrrd_header("short", "raw", placed), &little(&values, I16)),
        one("nrrd gzip", U16, nrrd_header("uint16", "gzip", "endian: big\n"), &gzip(&big(&values, U16))),
        one("nrrd bzip2", F32, nrrd_header("float", "bz2", "endian: little\n"), &bzip2(&little(&values, F32))),
        one("nrrd text", U8, nrrd_header("uchar", "ascii", "spacings: 1 2 3\n"), words(&values).as_bytes()),
        one("nrrd hex", U16, nrrd_header("ushort", "hex", "endian: big\n"), hex.as_bytes()),
        sample("nrrd vector", "nrrd", U8, 3, vec![("v.nrrd", join(vector, &little(&grid(3), U8)))]),
        sample(
            "nrrd list",
            "nrrd",
            I16,
            1,
            vec![
                ("v.nhdr", list.into_bytes()),
                ("a", slices[0].clone()),
                ("b", slices[1].clone()),
                ("c", slices[2].clone()),
            ],
        ),
        sample(
            "nrrd pattern",
            "nrrd",
            I16,
            1,
            vec![
                ("v.nhdr", pattern.into_bytes()),
                ("q.9", gzip(&slices[0])),
                ("q.10", gzip(&slices[1])),
                ("q.11", gzip(&slices[2])),
            ],
        ),
        sample(
            "nrrd skips",
            "nrrd",
            I16,
            1,
            vec![
                (
                    "v.nhdr",
                    nrrd_header("short", "gzip", "endian: little\nline skip: 1\nbyte skip: 2\ndata file: d\n").into(),
                ),
                ("d", join("a line\n", &gzip(&join("xx", &little(&values, I16))))),
            ],
        ),
        sample(
            "nrrd from the end",
            "nrrd",
            I16,
            1,
            vec![
                ("v.nhdr", nrrd_header("short", "raw", "endian: little\nbyte skip: -1\ndata file: d\n").into()),
                ("d", join("anything at all", &little(&values, I16))),
            ],
        ),
    ]
}

pub fn meta_header(kind: &str, more: &str) -> String {
    format!("ObjectType = Image\nNDims = 3\nDimSize = 5 4 3\nElementType = {kind}\n{more}")
}

fn metaimage() -> Vec<Sample> {
    use ScalarType::{I16, U8, U16};
    let values = grid(1);
    let local =
        "ElementSpacing = 1 2 3\nOffset = 4 5 6\nTransformMatrix = 0 1 0 -1 0 0 0 0 1\nElementDataFile = LOCAL\n";
    let packed = zlib(&big(&values, U16));
    let zlib_header = format!(
        "CompressedData = True\nCompressedDataSize = {}\nBinaryDataByteOrderMSB = True\nElementDataFile = v.zraw\n",
        packed.len()
    );
    let rgb = "ElementNumberOfChannels = 3\nElementDataFile = LOCAL\n";
    let list = "HeaderSize = 2\nElementDataFile = LIST\na\nb\nc\n";
    let slice = |z: usize| join("hi", &little(&values[z * 20..z * 20 + 20], I16));
    vec![
        sample(
            "metaimage raw",
            "metaimage",
            I16,
            1,
            vec![("v.mha", join(&meta_header("MET_SHORT", local), &little(&values, I16)))],
        ),
        sample(
            "metaimage zlib",
            "metaimage",
            U16,
            1,
            vec![("v.mhd", meta_header("MET_USHORT", &zlib_header).into()), ("v.zraw", packed)],
        ),
        sample(
            "metaimage text",
            "metaimage",
            U8,
            1,
            vec![(
                "v.mha",
                join(
                    &meta_header("MET_UCHAR", "BinaryData = False\nElementDataFile = LOCAL\n"),
                    words(&values).as_bytes(),
                ),
            )],
        ),
        sample(
            "metaimage colour",
            "metaimage",
            U8,
            3,
            vec![("v.mha", join(&meta_header("MET_UCHAR", rgb), &little(&grid(3), U8)))],
        ),
        sample(
            "metaimage list",
            "metaimage",
            I16,
            1,
            vec![("v.mhd", meta_header("MET_SHORT", list).into()), ("a", slice(0)), ("b", slice(1)), ("c", slice(2))],
        ),
    ]
}

/// A NIfTI-1 header: little-endian unless `big`, `datatype` 4 (i16) and so on.
pub fn nifti1(datatype: i16, bits: i16, magic: &[u8; 4], big: bool) -> Vec<u8> {
    let mut h = vec![0u8; 348];
    let mut put = |at: usize, bytes: &[u8]| {
        let mut bytes = bytes.to_vec();
        if big {
            bytes.reverse();
        }
        h[at..at + bytes.len()].copy_from_slice(&bytes);
    };
    put(0, &348i32.to_le_bytes());
    for (n, v) in [3i16, 5, 4, 3, 1, 1, 1, 1].iter().enumerate() {
        put(40 + 2 * n, &v.to_le_bytes());
    }
    put(70, &datatype.to_le_bytes());
    put(72, &bits.to_le_bytes());
    for (n, v) in [1f32, 2.0, 3.0, 4.0].iter().enumerate() {
        put(76 + 4 * n, &v.to_le_bytes());
    }
    put(108, &352f32.to_le_bytes());
    put(112, &2f32.to_le_bytes());
    put(116, &(-1024f32).to_le_bytes());
    put(254, &1i16.to_le_bytes());
    let rows = [[2f32, 0.0, 0.0, -10.0], [0.0, 3.0, 0.5, -20.0], [0.0, 0.0, 4.0, 30.0]];
    for (n, v) in rows.iter().flatten().enumerate() {
        put(280 + 4 * n, &v.to_le_bytes());
    }
    h[344..348].copy_from_slice(magic);
    h
}

fn nifti2() -> Vec<u8> {
    let mut h = vec![0u8; 540];
    h[0..4].copy_from_slice(&540i32.to_le_bytes());
    h[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
    h[12..14].copy_from_slice(&512i16.to_le_bytes());
    for (n, v) in [3i64, 5, 4, 3, 1, 1, 1, 1].iter().enumerate() {
        h[16 + 8 * n..24 + 8 * n].copy_from_slice(&v.to_le_bytes());
    }
    for (n, v) in [-1f64, 2.0, 3.0, 4.0].iter().enumerate() {
        h[104 + 8 * n..112 + 8 * n].copy_from_slice(&v.to_le_bytes());
    }
    h[168..176].copy_from_slice(&544i64.to_le_bytes());
    h[344..348].copy_from_slice(&1i32.to_le_bytes());
    // A quarter turn about z.
    h[368..376].copy_from_slice(&0.5f64.sqrt().to_le_bytes());
    h[376..384].copy_from_slice(&7f64.to_le_bytes());
    h
}

fn nifti() -> Vec<Sample> {
    use ScalarType::{F32, I16, U8, U16};
    let values = grid(1);
    let one = |header: Vec<u8>, data: Vec<u8>| [header, vec![0; 4], data].concat();
    let little_file = one(nifti1(4, 16, b"n+1\0", false), little(&values, I16));
    let mut pair = nifti1(16, 32, b"ni1\0", false);
    pair[108..112].copy_from_slice(&0f32.to_le_bytes());
    vec![
        sample("nifti", "nifti", I16, 1, vec![("v.nii", little_file.clone())]),
        sample("nifti gzip", "nifti", I16, 1, vec![("v.nii.gz", gzip(&little_file))]),
        sample("nifti big", "nifti", I16, 1, vec![("v.nii", one(nifti1(4, 16, b"n+1\0", true), big(&values, I16)))]),
        sample("nifti 2", "nifti", U16, 1, vec![("v.nii", one(nifti2(), little(&values, U16)))]),
        sample("nifti pair", "nifti", F32, 1, vec![("v.hdr", pair), ("v.img", little(&values, F32))]),
        sample(
            "nifti colour",
            "nifti",
            U8,
            3,
            vec![("v.nii", one(nifti1(128, 24, b"n+1\0", false), little(&grid(3), U8)))],
        ),
    ]
}

/// A little-endian baseline TIFF of pages of one strip each.
pub fn tiff_plain(pages: &[Vec<u8>], width: u32, height: u32, bits: u16, format: u16) -> Vec<u8> {
    let mut out = b"II*\0\0\0\0\0".to_vec();
    let mut link = 4;
    for page in pages {
        let data = out.len() as u32;
        out.extend(page);
        if out.len() % 2 == 1 {
            out.push(0);
        }
        let at = out.len() as u32;
        out[link..link + 4].copy_from_slice(&at.to_le_bytes());
        let entries: [(u16, u16, u32); 9] = [
            (256, 4, width),
            (257, 4, height),
            (258, 3, u32::from(bits)),
            (259, 3, 1),
            (262, 3, 1),
            (273, 4, data),
            (278, 4, height),
            (279, 4, page.len() as u32),
            (339, 3, u32::from(format)),
        ];
        out.extend((entries.len() as u16).to_le_bytes());
        for (tag, kind, value) in entries {
            out.extend(tag.to_le_bytes());
            out.extend(kind.to_le_bytes());
            out.extend(1u32.to_le_bytes());
            out.extend(value.to_le_bytes());
        }
        link = out.len();
        out.extend([0; 4]);
    }
    out
}

/// Written by the encoder of the tiff crate.
fn tiff_packed(compression: tiff::encoder::Compression) -> Vec<u8> {
    use tiff::encoder::{TiffEncoder, colortype::Gray16};
    let mut out = std::io::Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut out).unwrap().with_compression(compression);
    for slice in grid(1).chunks(20) {
        let data: Vec<u16> = slice.iter().map(|v| *v as u16).collect();
        encoder.write_image::<Gray16>(5, 4, &data).unwrap();
    }
    out.into_inner()
}

fn tiffs() -> Vec<Sample> {
    use ScalarType::{F32, I16, U8, U16};
    let values = grid(1);
    let page = |z: usize, scalar| little(&values[z * 20..z * 20 + 20], scalar);
    let pages = |scalar| [page(0, scalar), page(1, scalar), page(2, scalar)];
    let single = |z| tiff_plain(&[page(z, U8)], 5, 4, 8, 1);
    vec![
        sample("tiff", "tiff", I16, 1, vec![("v.tif", tiff_plain(&pages(I16), 5, 4, 16, 2))]),
        sample("tiff float", "tiff", F32, 1, vec![("v.tif", tiff_plain(&pages(F32), 5, 4, 32, 3))]),
        sample("tiff lzw", "tiff", U16, 1, vec![("v.tif", tiff_packed(tiff::encoder::Compression::Lzw))]),
        sample(
            "tiff deflate",
            "tiff",
            U16,
            1,
            vec![("v.tif", tiff_packed(tiff::encoder::Compression::Deflate(tiff::encoder::DeflateLevel::Balanced)))],
        ),
        Sample {
            path: "t/s%d.tif",
            ..sample(
                "tiff series",
                "tiff",
                U8,
                1,
                vec![("t/s9.tif", single(0)), ("t/s10.tif", single(1)), ("t/s11.tif", single(2))],
            )
        },
    ]
}

/// Written by the encoder of the png crate.
pub fn png_slice(data: &[u8], color: png::ColorType, depth: png::BitDepth) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, 5, 4);
    encoder.set_color(color);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(data).unwrap();
    writer.finish().unwrap();
    out
}

fn pngs() -> Vec<Sample> {
    use ScalarType::{U8, U16};
    let names = ["p/s8.png", "p/s9.png", "p/s10.png"];
    let grey = |z: usize| {
        let data = big(&grid(1)[z * 20..z * 20 + 20], U16);
        (names[z], png_slice(&data, png::ColorType::Grayscale, png::BitDepth::Sixteen))
    };
    let colour = |z: usize| {
        let data = little(&grid(3)[z * 60..z * 60 + 60], U8);
        (names[z], png_slice(&data, png::ColorType::Rgb, png::BitDepth::Eight))
    };
    vec![
        Sample { path: "p", ..sample("png", "png", U16, 1, (0..3).map(grey).collect()) },
        Sample { path: "p/s%d.png", ..sample("png colour", "png", U8, 3, (0..3).map(colour).collect()) },
    ]
}

/// A DICOM writer: elements in the order given.
pub struct Dicom {
    pub out: Vec<u8>,
    pub implicit: bool,
    pub big: bool,
}

impl Dicom {
    pub fn new(syntax: &str) -> Self {
        let mut out = vec![0; 128];
        out.extend(b"DICM");
        let mut file = Self { out, implicit: false, big: false };
        file.put(0x0002_0010, b"UI", syntax.as_bytes());
        file.implicit = syntax == "1.2.840.10008.1.2";
        file.big = syntax == "1.2.840.10008.1.2.2";
        file
    }

    fn u16(&mut self, v: u16) {
        self.out.extend(if self.big { v.to_be_bytes() } else { v.to_le_bytes() });
    }

    fn u32(&mut self, v: u32) {
        self.out.extend(if self.big { v.to_be_bytes() } else { v.to_le_bytes() });
    }

    pub fn put(&mut self, tag: u32, kind: &[u8; 2], value: &[u8]) {
        let mut value = value.to_vec();
        if value.len() % 2 == 1 {
            value.push(if kind == b"UI" { 0 } else { b' ' });
        }
        self.head(tag, kind, value.len() as u32);
        self.out.extend(value);
    }

    pub fn head(&mut self, tag: u32, kind: &[u8; 2], length: u32) {
        self.u16((tag >> 16) as u16);
        self.u16(tag as u16);
        if self.implicit {
            return self.u32(length);
        }
        self.out.extend(kind);
        if matches!(kind, b"OB" | b"OW" | b"SQ" | b"UN") {
            self.out.extend([0, 0]);
            self.u32(length);
        } else {
            self.u16(length as u16);
        }
    }

    pub fn short(&mut self, tag: u32, v: u16) {
        let bytes = if self.big { v.to_be_bytes() } else { v.to_le_bytes() };
        self.put(tag, b"US", &bytes);
    }
}

/// A slice of the grid with a tilted stack: each slice 2 mm higher and 1 mm to the back.
pub fn dicom_slice(syntax: &str, z: usize, position: [f64; 3]) -> Vec<u8> {
    let mut d = Dicom::new(syntax);
    d.put(0x0008_0060, b"CS", b"CT");
    // A sequence of undefined length with a nested one, to be passed over.
    d.head(0x0008_1140, b"SQ", u32::MAX);
    d.u16(0xfffe);
    d.u16(0xe000);
    d.u32(u32::MAX);
    d.put(0x0008_1150, b"UI", b"1.2.3");
    d.u16(0xfffe);
    d.u16(0xe00d);
    d.u32(0);
    d.u16(0xfffe);
    d.u16(0xe0dd);
    d.u32(0);
    d.put(0x0020_000e, b"UI", b"1.2.3.4");
    let place = position.map(|v| v.to_string()).join("\\");
    d.put(0x0020_0032, b"DS", place.as_bytes());
    d.put(0x0020_0037, b"DS", b"1\\0\\0\\0\\1\\0");
    d.short(0x0028_0002, 1);
    d.put(0x0028_0004, b"CS", b"MONOCHROME2");
    d.short(0x0028_0010, 4);
    d.short(0x0028_0011, 5);
    d.put(0x0028_0030, b"DS", b"0.5\\0.25");
    d.short(0x0028_0100, 16);
    d.short(0x0028_0101, 12);
    d.short(0x0028_0102, 11);
    d.short(0x0028_0103, 1);
    d.put(0x0028_1052, b"DS", b"-1024");
    d.put(0x0028_1053, b"DS", b"2");
    // The four highest bits hold something else, which does not count.
    let mut pixels = Vec::new();
    for v in &grid(1)[z * 20..z * 20 + 20] {
        let v = (*v as u16) | 0xa000;
        pixels.extend(if d.big { v.to_be_bytes() } else { v.to_le_bytes() });
    }
    d.put(0x7fe0_0010, b"OW", &pixels);
    d.out
}

pub fn tilted(z: usize) -> [f64; 3] {
    [10.0, 20.0 + z as f64, 30.0 + 2.0 * z as f64]
}

fn dicoms() -> Vec<Sample> {
    let stack = |name, syntax: &str| {
        // Listed in another order than they lie.
        let files = vec![
            ("d/a.dcm", dicom_slice(syntax, 2, tilted(2))),
            ("d/b.dcm", dicom_slice(syntax, 0, tilted(0))),
            ("d/c.dcm", dicom_slice(syntax, 1, tilted(1))),
        ];
        Sample { path: "d", ..sample(name, "dicom", ScalarType::I16, 1, files) }
    };
    vec![
        stack("dicom explicit", "1.2.840.10008.1.2.1"),
        stack("dicom implicit", "1.2.840.10008.1.2"),
        stack("dicom big", "1.2.840.10008.1.2.2"),
    ]
}

pub fn vtk_header(version: &str, coding: &str, data: &str) -> String {
    format!(
        "# vtk DataFile Version {version}\ntitle\n{coding}\nDATASET STRUCTURED_POINTS\nDIMENSIONS 5 4 3\nSPACING 1 2 \
         3\nORIGIN 4 5 6\nPOINT_DATA 60\n{data}"
    )
}

fn vtks() -> Vec<Sample> {
    use ScalarType::{F32, I16, U8};
    let values = grid(1);
    let scalars = "SCALARS my%20data short 1\nLOOKUP_TABLE default\n";
    let mut metadata =
        join(&vtk_header("5.1", "BINARY", "SCALARS d float\nLOOKUP_TABLE default\n"), &big(&values, F32));
    metadata.extend(b"\nMETADATA\nINFORMATION 0\n\n");
    let field = vtk_header("3.0", "BINARY", "FIELD FieldData 1\nrgb 3 60 unsigned_char\n");
    vec![
        sample(
            "vtk binary",
            "vtk",
            I16,
            1,
            vec![("v.vtk", join(&vtk_header("2.0", "BINARY", scalars), &big(&values, I16)))],
        ),
        sample(
            "vtk text",
            "vtk",
            I16,
            1,
            vec![(
                "v.vtk",
                join(&vtk_header("3.0", "ASCII", scalars), format!("{}\nMETADATA\n", words(&values)).as_bytes()),
            )],
        ),
        sample("vtk 5", "vtk", F32, 1, vec![("v.vtk", metadata)]),
        sample("vtk field", "vtk", U8, 3, vec![("v.vtk", join(&field, &little(&grid(3), U8)))]),
    ]
}

pub fn vti_text(attributes: &str, array: &str, appended: &str) -> String {
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" {attributes}>\n<ImageData \
         WholeExtent=\"2 6 0 3 0 2\" Origin=\"1 2 3\" Spacing=\"0.5 2 3\">\n<Piece Extent=\"2 6 0 3 0 2\">\n<PointData \
         Scalars=\"s\">\n<DataArray {array}</PointData>\n<CellData>\n</CellData>\n</Piece>\n</ImageData>\n{appended}"
    )
}

/// The blocks of a compressed array: table and data.
fn vti_blocks(data: &[u8], block: usize, word: impl Fn(usize) -> Vec<u8>) -> (Vec<u8>, Vec<u8>) {
    let blocks: Vec<_> = data.chunks(block).map(zlib).collect();
    let mut head = [word(blocks.len()), word(block), word(data.len() % block)].concat();
    blocks.iter().for_each(|b| head.extend(word(b.len())));
    (head, blocks.concat())
}

fn vtis() -> Vec<Sample> {
    use ScalarType::{I16, U8, U16};
    let values = grid(1);
    let le32 = |n: usize| (n as u32).to_le_bytes().to_vec();
    let be64 = |n: usize| (n as u64).to_be_bytes().to_vec();
    let end = "</VTKFile>\n";
    let little_order = "byte_order=\"LittleEndian\" header_type=\"UInt32\"";
    let big_order = "byte_order=\"BigEndian\" header_type=\"UInt64\"";
    let zlib_order = format!("{little_order} compressor=\"vtkZLibDataCompressor\"");
    let zlib_big = format!("{big_order} compressor=\"vtkZLibDataCompressor\"");
    let one = |name, scalar, text: String| sample(name, "vti", scalar, 1, vec![("v.vti", text.into_bytes())]);
    let inline = |kind: &str, format: &str, body: &str| {
        format!("type=\"{kind}\" Name=\"s\" format=\"{format}\">\n  {body}\n</DataArray>\n")
    };
    let appended = |kind: &str| format!("type=\"{kind}\" Name=\"s\" format=\"appended\" offset=\"3\"/>\n");
    let plain = [le32(120), little(&values, I16)].concat();
    let (head, blocks) = vti_blocks(&little(&values, I16), 50, le32);
    let two = format!("{}{}", STANDARD.encode(&head), STANDARD.encode(&blocks));
    let mut raw = vti_text(big_order, &appended("UInt16"), "<AppendedData encoding=\"raw\">\n _abc").into_bytes();
    raw.extend([be64(120), big(&values, U16)].concat());
    raw.extend(b"\n</AppendedData></VTKFile>");
    let (head, blocks) = vti_blocks(&big(&values, U16), 32, be64);
    let mut packed = vti_text(&zlib_big, &appended("UInt16"), "<AppendedData encoding=\"raw\">_abc").into_bytes();
    packed.extend([head.clone(), blocks.clone()].concat());
    packed.extend(b"\n</AppendedData></VTKFile>");
    let text = format!(
        "<AppendedData encoding=\"base64\">_abc{}{}</AppendedData></VTKFile>",
        STANDARD.encode(&head),
        STANDARD.encode(&blocks)
    );
    vec![
        one("vti text", U8, vti_text(little_order, &inline("UInt8", "ascii", &words(&values)), end)),
        one("vti base64", I16, vti_text(little_order, &inline("Int16", "binary", &STANDARD.encode(&plain)), end)),
        one("vti zlib", I16, vti_text(&zlib_order, &inline("Int16", "binary", &two), end)),
        sample("vti raw", "vti", U16, 1, vec![("v.vti", raw)]),
        sample("vti raw zlib", "vti", U16, 1, vec![("v.vti", packed)]),
        one("vti appended base64", U16, vti_text(&zlib_big, &appended("UInt16"), &text)),
    ]
}

/// All samples.
pub fn all() -> Vec<Sample> {
    [raw(), nrrd(), metaimage(), nifti(), dicoms(), tiffs(), pngs(), vtks(), vtis()].into_iter().flatten().collect()
}
