//! NIfTI-1 and NIfTI-2.
//!
//! # Reads
//! `.nii`, `.nii.gz`, and `.hdr` with `.img` (each plain or gzipped); either byte order; 8 to
//! 32-bit integers, float, double, RGB24 and RGBA32. Placement from the sform, else the qform,
//! else `pixdim`, turned from RAS to LPS; oblique and sheared affines are kept. `scl_slope` and
//! `scl_inter` become slope and intercept.
//!
//! # Options
//! `frame`: which volume of a time series to read, from 0.
//!
//! # Limits
//! 64-bit integers, complex and 128-bit types, vectors in the fifth dimension and Analyze 7.5
//! headers are refused. Header extensions and `xyzt_units` are not used.

use std::{
    io::{Cursor, Read},
    path::{Path, PathBuf},
};

use volact_core::{
    LoadError, LoadOptions, ParameterDecl, ParameterType, ParameterValue, ScalarType, VolumeDesc, VolumeReader,
    glam::{DMat3, DQuat, DVec3},
    loader::{Confidence, Probe},
};

use crate::{
    decode::decoder,
    fields,
    format::{Format, confidence, name_of},
    payload::{ByteOrder, Encoding, GridReader, Part, Payload},
    storage::Storage,
    world,
};

const SIZE_1: usize = 348;
const SIZE_2: usize = 540;

/// The loader.
pub(crate) fn format() -> Format {
    let frame = ParameterDecl::new("frame", ParameterType::Int, "which volume of a time series, from 0");
    Format::new("nifti", "NIfTI-1 and NIfTI-2 volumes (.nii, .nii.gz, .hdr with .img)", probe, open)
        .with(frame.default(0i64).bounds(0.0, 1e6))
}

fn probe(probe: &Probe<'_>) -> Confidence {
    let unpacked;
    let mut head = probe.head;
    if is_gzip(head) {
        let mut bytes = Vec::new();
        // The head is cut, so that an error at its end is no surprise.
        _ = flate2::read::GzDecoder::new(head).take(SIZE_2 as u64).read_to_end(&mut bytes);
        unpacked = bytes;
        head = &unpacked;
    }
    confidence(version(head).is_some(), probe, &[".nii", ".nii.gz"])
}

fn is_gzip(head: &[u8]) -> bool {
    head.starts_with(&[0x1f, 0x8b])
}

/// The version, the byte order and whether the data lie in a file of their own.
fn version(head: &[u8]) -> Option<(u8, ByteOrder, bool)> {
    let size: [u8; 4] = head.get(..4)?.try_into().ok()?;
    let order = |wanted: u32| {
        if u32::from_le_bytes(size) == wanted {
            Some(ByteOrder::Little)
        } else {
            (u32::from_be_bytes(size) == wanted).then_some(ByteOrder::Big)
        }
    };
    if let Some(order) = order(SIZE_1 as u32) {
        return match head.get(344..348)? {
            b"n+1\0" => Some((1, order, false)),
            b"ni1\0" => Some((1, order, true)),
            _ => None,
        };
    }
    match head.get(4..12)? {
        b"n+2\0\r\n\x1a\n" => Some((2, order(SIZE_2 as u32)?, false)),
        b"ni2\0\r\n\x1a\n" => Some((2, order(SIZE_2 as u32)?, true)),
        _ => None,
    }
}

/// The header's fields, whichever the version.
#[derive(Debug)]
struct Header {
    order: ByteOrder,
    separate: bool,
    dim: [i64; 8],
    datatype: i16,
    pixdim: [f64; 8],
    vox_offset: f64,
    scl_slope: f64,
    scl_inter: f64,
    qform_code: i32,
    sform_code: i32,
    quatern: [f64; 3],
    qoffset: DVec3,
    srow: [[f64; 4]; 3],
}

struct Fields<'a> {
    bytes: &'a [u8],
    order: ByteOrder,
}

impl Fields<'_> {
    fn get<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut raw = [0; N];
        raw.copy_from_slice(&self.bytes[at..at + N]);
        if self.order == ByteOrder::Big {
            raw.reverse();
        }
        raw
    }

    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.get(at))
    }

    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.get(at))
    }

    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.get(at))
    }

    fn f32(&self, at: usize) -> f64 {
        f64::from(f32::from_le_bytes(self.get(at)))
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.get(at))
    }
}

fn parse(path: &Path, bytes: &[u8]) -> Result<Header, LoadError> {
    let Some((version, order, separate)) = version(bytes) else {
        if bytes.len() < SIZE_1 {
            let (what, found) = ("header".into(), bytes.len() as u64);
            return Err(LoadError::Truncated { path: path.into(), what, found, wanted: SIZE_1 as u64 });
        }
        let found = bytes[344..348].escape_ascii().to_string();
        let wanted = "n+1 or ni1 (n+2 or ni2 at byte 4), with sizeof_hdr 348 (540)";
        return Err(LoadError::invalid(path, "magic", format!("\"{found}\""), wanted));
    };
    let wanted = if version == 1 { SIZE_1 } else { SIZE_2 };
    if bytes.len() < wanted {
        let (what, found) = ("header".into(), bytes.len() as u64);
        return Err(LoadError::Truncated { path: path.into(), what, found, wanted: wanted as u64 });
    }
    let f = Fields { bytes, order };
    use std::array::from_fn;
    Ok(if version == 1 {
        Header {
            order,
            separate,
            dim: from_fn(|n| i64::from(f.i16(40 + 2 * n))),
            datatype: f.i16(70),
            pixdim: from_fn(|n| f.f32(76 + 4 * n)),
            vox_offset: f.f32(108),
            scl_slope: f.f32(112),
            scl_inter: f.f32(116),
            qform_code: i32::from(f.i16(252)),
            sform_code: i32::from(f.i16(254)),
            quatern: from_fn(|n| f.f32(256 + 4 * n)),
            qoffset: DVec3::from_array(from_fn(|n| f.f32(268 + 4 * n))),
            srow: from_fn(|r| from_fn(|n| f.f32(280 + 16 * r + 4 * n))),
        }
    } else {
        Header {
            order,
            separate,
            dim: from_fn(|n| f.i64(16 + 8 * n)),
            datatype: f.i16(12),
            pixdim: from_fn(|n| f.f64(104 + 8 * n)),
            vox_offset: f.i64(168) as f64,
            scl_slope: f.f64(176),
            scl_inter: f.f64(184),
            qform_code: f.i32(344),
            sform_code: f.i32(348),
            quatern: from_fn(|n| f.f64(352 + 8 * n)),
            qoffset: DVec3::from_array(from_fn(|n| f.f64(376 + 8 * n))),
            srow: from_fn(|r| from_fn(|n| f.f64(400 + 32 * r + 8 * n))),
        }
    })
}

fn open(storage: &Storage, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let head = storage.head(path, 1 << 16)?;
    let bytes = if is_gzip(&head) {
        let mut bytes = Vec::new();
        // What cannot be unpacked is missed when the header is parsed or the voxels are read.
        _ = decoder(Encoding::Gzip, Cursor::new(head)).take(SIZE_2 as u64).read_to_end(&mut bytes);
        bytes
    } else {
        head
    };
    let header = parse(path, &bytes)?;
    let frame = match options.get("frame") {
        Some(ParameterValue::Int(frame)) => *frame,
        _ => 0,
    };
    let (dims, frame) = dimensions(path, &header, frame)?;
    let (scalar, components) = data_type(path, header.datatype)?;
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, scalar, components) };
    if header.scl_slope.is_finite() && header.scl_slope != 0.0 && header.scl_inter.is_finite() && components == 1 {
        desc.slope = header.scl_slope;
        desc.intercept = header.scl_inter;
    }
    place(path, &header, &mut desc)?;
    let payload = payload(storage, path, &header, &desc, frame)?;
    GridReader::open(path, desc, payload, Vec::new())
}

/// The grid, and the frame checked.
fn dimensions(path: &Path, header: &Header, frame: i64) -> Result<([usize; 3], u64), LoadError> {
    let count = header.dim[0];
    if !(1..=7).contains(&count) {
        return Err(LoadError::invalid(path, "dim[0]", count, "1 to 7 dimensions"));
    }
    let sizes = &header.dim[1..=count as usize];
    if let Some(bad) = sizes.iter().find(|n| **n < 1) {
        return Err(LoadError::invalid(path, "dim", format!("{sizes:?}"), format!("sizes of at least 1, not {bad}")));
    }
    if sizes.iter().skip(4).any(|n| *n != 1) {
        let what = format!("a fifth or higher dimension ({sizes:?})");
        let cure = "store components as RGB24 or RGBA32, or one file each".into();
        return Err(LoadError::Unsupported { path: path.into(), what, cure });
    }
    let frames = sizes.get(3).copied().unwrap_or(1);
    if frame >= frames {
        return Err(LoadError::invalid(path, "option \"frame\"", frame, format!("less than {frames}")));
    }
    let spatial: Vec<u64> = sizes.iter().take(3).map(|n| *n as u64).collect();
    Ok((fields::dimensions(path, "dim", &spatial)?, frame as u64))
}

fn data_type(path: &Path, code: i16) -> Result<(ScalarType, usize), LoadError> {
    Ok(match code {
        2 => (ScalarType::U8, 1),
        4 => (ScalarType::I16, 1),
        8 => (ScalarType::I32, 1),
        16 => (ScalarType::F32, 1),
        64 => (ScalarType::F64, 1),
        128 => (ScalarType::U8, 3),
        256 => (ScalarType::I8, 1),
        512 => (ScalarType::U16, 1),
        768 => (ScalarType::U32, 1),
        2304 => (ScalarType::U8, 4),
        1 | 32 | 1024 | 1280 | 1536 | 1792 | 2048 => {
            let what = format!("datatype {code} (binary, complex, 64-bit integer or 128-bit)");
            let cure = "convert it to float or to 32-bit integers".into();
            return Err(LoadError::Unsupported { path: path.into(), what, cure });
        }
        _ => return Err(LoadError::invalid(path, "datatype", code, "a code of NIfTI")),
    })
}

fn place(path: &Path, header: &Header, desc: &mut VolumeDesc) -> Result<(), LoadError> {
    if header.sform_code > 0 {
        let column = |n: usize| DVec3::new(header.srow[0][n], header.srow[1][n], header.srow[2][n]);
        let steps = [0, 1, 2].map(|n| world::flip_ras(column(n)));
        return world::place(path, "sform", desc, steps, world::flip_ras(column(3)));
    }
    // The sign of pixdim says nothing; a size left out counts as 1, as in the reference code.
    let size = |n: usize| if header.pixdim[n] == 0.0 { 1.0 } else { header.pixdim[n].abs() };
    let spacing = [size(1), size(2), size(3)];
    if header.qform_code > 0 {
        let [b, c, d] = header.quatern;
        let a = (1.0 - (b * b + c * c + d * d)).max(0.0).sqrt();
        let turn = DMat3::from_quat(DQuat::from_xyzw(b, c, d, a).normalize());
        let sign = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
        let directions = [turn.x_axis, turn.y_axis, turn.z_axis * sign].map(world::flip_ras);
        return world::place_spaced(path, "qform", desc, directions, spacing, world::flip_ras(header.qoffset));
    }
    world::place_spaced(path, "pixdim", desc, world::AXES.map(world::flip_ras), spacing, DVec3::ZERO)
}

fn payload(
    storage: &Storage,
    path: &Path,
    header: &Header,
    desc: &VolumeDesc,
    frame: u64,
) -> Result<Payload, LoadError> {
    let length = desc.bytes().map_or(u64::MAX, |n| n as u64);
    let lowest = if header.separate { 0.0 } else { 348.0 };
    if !(header.vox_offset >= lowest && header.vox_offset < 1e15) {
        let wanted = format!("at least {lowest}");
        return Err(LoadError::invalid(path, "vox_offset", header.vox_offset, wanted));
    }
    let skip = frame.saturating_mul(length).saturating_add(header.vox_offset as u64);
    let file = if header.separate { image_beside(storage, path)? } else { path.to_path_buf() };
    let size = storage.length(&file)?;
    let (encoding, part) = if is_gzip(&storage.head(&file, 2)?) {
        (Encoding::Gzip, Part { path: file, start: 0, encoded: size, skip, length })
    } else {
        (Encoding::Raw, Part { path: file, start: skip, encoded: size.saturating_sub(skip), skip: 0, length })
    };
    // Further frames are no surplus.
    let open_ended = header.dim[0] > 3 && header.dim[4] > 1;
    Ok(Payload {
        storage: storage.clone(),
        parts: vec![part],
        encoding,
        order: header.order,
        open_ended,
        significant: None,
    })
}

/// The `.img` of a `.hdr`.
fn image_beside(storage: &Storage, path: &Path) -> Result<PathBuf, LoadError> {
    let name = path.to_string_lossy();
    let stem = name.strip_suffix(".hdr.gz").or_else(|| name.strip_suffix(".hdr"));
    let Some(stem) = stem else {
        return Err(LoadError::invalid(path, "file name", "without .hdr", "a .hdr, as the voxels are in a .img"));
    };
    let plain = PathBuf::from(format!("{stem}.img"));
    let packed = PathBuf::from(format!("{stem}.img.gz"));
    Ok(if !storage.is_file(&plain) && storage.is_file(&packed) { packed } else { plain })
}
