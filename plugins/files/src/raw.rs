//! Raw voxels with a small RON header.
//!
//! # Reads
//! A text file such as `tooth.raw.ron`:
//!
//! ```ron
//! RawVolume(
//!     file: "tooth.raw",         // or a series: "slice%03d.raw"
//!     numbers: (1, 161),         // first and last of a series
//!     dims: (103, 94, 161),
//!     scalar: "u16",             // u8 i8 u16 i16 u32 i32 f16 f32 f64
//!     components: 1,
//!     byte_order: "big",         // or "little"; needed where a number has several bytes
//!     skip: 0,                   // bytes before the voxels, in each file
//!     spacing: (1.0, 1.0, 1.0),
//!     origin: (0.0, 0.0, 0.0),
//!     axes: ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
//!     slope: 1.0, intercept: 0.0, unit: "HU",
//! )
//! ```
//!
//! Only `file`, `dims` and `scalar` are required. A series has equal shares of the voxels.
//!
//! # Options
//! None.
//!
//! # Limits
//! Nothing is guessed: a file longer than the header says is read with a warning, a shorter one
//! is refused.

use std::path::Path;

use serde::Deserialize;
use volact_core::{
    LoadError, LoadOptions, ScalarType, VolumeDesc, VolumeReader,
    glam::DVec3,
    loader::{Confidence, Probe},
};

use crate::{
    fields::{self, Begin, Files},
    format::{Format, beside, confidence, name_of},
    payload::{ByteOrder, Encoding, GridReader},
    storage::Storage,
    world,
};

const HEADER_LIMIT: u64 = 1 << 16;

/// The loader.
pub(crate) fn format() -> Format {
    Format::new("raw", "raw voxels described by a RON header (.raw.ron)", probe, open)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    let marked = probe.head.windows(10).any(|w| w == b"RawVolume(");
    confidence(marked, probe, &[".raw.ron"])
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawVolume {
    file: String,
    numbers: Option<(i64, i64)>,
    dims: (u64, u64, u64),
    scalar: String,
    #[serde(default = "one")]
    components: usize,
    byte_order: Option<String>,
    #[serde(default)]
    skip: u64,
    spacing: Option<[f64; 3]>,
    #[serde(default)]
    origin: [f64; 3],
    axes: Option<[[f64; 3]; 3]>,
    slope: Option<f64>,
    intercept: Option<f64>,
    #[serde(default)]
    unit: String,
}

fn one() -> usize {
    1
}

fn open(storage: &Storage, path: &Path, _: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let bytes = storage.head(path, HEADER_LIMIT + 1)?;
    if bytes.len() as u64 > HEADER_LIMIT {
        return Err(LoadError::invalid(path, "header", "longer", format!("at most {HEADER_LIMIT} bytes")));
    }
    let parser = ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
    let header: RawVolume = parser.from_bytes(&bytes).map_err(|e| LoadError::decode(path, e))?;
    let (x, y, z) = header.dims;
    let dims = fields::dimensions(path, "dims", &[x, y, z])?;
    let Some(scalar) = ScalarType::from_name(&header.scalar) else {
        let wanted = ScalarType::ALL.map(ScalarType::name).join(", ");
        return Err(LoadError::invalid(path, "scalar", format!("{:?}", header.scalar), format!("one of {wanted}")));
    };
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, scalar, header.components) };
    desc.slope = header.slope.unwrap_or(1.0);
    desc.intercept = header.intercept.unwrap_or(0.0);
    desc.unit = header.unit.clone();
    let axes = header.axes.map_or(world::AXES, |axes| axes.map(DVec3::from_array));
    let spacing = header.spacing.unwrap_or([1.0; 3]);
    world::place_spaced(path, "axes", &mut desc, axes, spacing, DVec3::from_array(header.origin))?;
    let order = match header.byte_order.as_deref() {
        Some("big") => ByteOrder::Big,
        Some("little") => ByteOrder::Little,
        None if scalar.size() == 1 => ByteOrder::NATIVE,
        found => {
            let found = found.map_or("missing".into(), |f| format!("{f:?}"));
            return Err(LoadError::invalid(path, "byte_order", found, "\"little\" or \"big\""));
        }
    };
    let files = match header.numbers {
        Some((first, last)) => {
            let step = if last < first { -1 } else { 1 };
            Files::numbered(path, "file", &header.file, [first, last, step])?
        }
        None => Files::One(beside(path, &header.file)),
    };
    let total = desc.bytes().map_or(u64::MAX, |n| n as u64);
    let begin = Begin::After { lines: 0, bytes: header.skip };
    let payload = fields::payload(storage, path, files, total, begin, Encoding::Raw, order)?;
    GridReader::open(path, desc, payload, Vec::new())
}
