//! DICOM series.
//!
//! # Reads
//! A folder, or any file of it, of single-frame images in implicit or explicit VR, little or big
//! endian, uncompressed: 8, 16 or 32 bits, grey or interleaved RGB, `BitsStored` and
//! `PixelRepresentation` honoured. Slices are sorted along the normal of their planes. A tilted
//! gantry becomes a shear of the placement. Rescale slope and intercept become slope and
//! intercept, in HU for CT. World space is DICOM's own, LPS.
//!
//! # Options
//! `series`: the SeriesInstanceUID to read, where a folder holds several.
//! `resample`: brings a stack of uneven distances to an even one, by linear interpolation along
//! the stack, rounded to the stored type. The distance is the smallest one of the stack, so that
//! no slice is lost, but no more than eight times as many slices are made as there were; the first
//! and the last slice stay where they are.
//! `as_stored`: gives the slices as they are, evenly spaced although they are not, with a warning.
//!
//! # Limits
//! Compressed and deflated transfer syntaxes, multi-frame objects, palettes, planar RGB, and
//! slices that differ in size, orientation, pixel spacing or rescaling are refused. An uneven
//! stack is refused unless one of the options above is set: even means that every slice lies
//! within a hundredth of the distance from where an even stack has it.

mod resampled;
mod stack;

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use volact_core::{
    LoadError, LoadOptions, ParameterDecl, ParameterType, ScalarType, VolumeDesc, VolumeReader, Warning, WarningCode,
    glam::DVec3,
    loader::{Confidence, Probe},
};

use resampled::Resampled;
use stack::{Stack, consistent};

use crate::{
    elements::{self, Elements},
    fields,
    format::{Format, flag, name_of, text},
    payload::{ByteOrder, Encoding, GridReader, Part, Payload, Significant, validate},
    slices::SliceReader,
    storage::Storage,
    world,
};

/// The loader.
pub(crate) fn format() -> Format {
    let series = ParameterDecl::new("series", ParameterType::Choice, "SeriesInstanceUID, where there are several");
    let resample = "interpolate a stack of uneven distances to an even one";
    let as_stored = "take the slices as evenly spaced although they are not";
    Format::new("dicom", "DICOM series: a folder, or any file of it", probe, open)
        .with(series)
        .with(ParameterDecl::new("resample", ParameterType::Bool, resample).default(false))
        .with(ParameterDecl::new("as_stored", ParameterType::Bool, as_stored).default(false))
}

fn probe(probe: &Probe<'_>) -> Confidence {
    let found = if probe.is_dir {
        let files = Storage::Disk.list(probe.path).unwrap_or_default();
        files.iter().take(64).any(|f| Storage::Disk.head(f, 132).is_ok_and(|head| elements::is_dicom(&head)))
    } else {
        elements::is_dicom(probe.head)
    };
    crate::format::confidence(found, probe, &[".dcm"])
}

mod tag {
    pub(super) const MODALITY: u32 = 0x0008_0060;
    pub(super) const THICKNESS: u32 = 0x0018_0050;
    pub(super) const SERIES: u32 = 0x0020_000e;
    pub(super) const POSITION: u32 = 0x0020_0032;
    pub(super) const ORIENTATION: u32 = 0x0020_0037;
    pub(super) const SAMPLES: u32 = 0x0028_0002;
    pub(super) const PHOTOMETRIC: u32 = 0x0028_0004;
    pub(super) const PLANAR: u32 = 0x0028_0006;
    pub(super) const FRAMES: u32 = 0x0028_0008;
    pub(super) const ROWS: u32 = 0x0028_0010;
    pub(super) const COLUMNS: u32 = 0x0028_0011;
    pub(super) const PIXEL_SPACING: u32 = 0x0028_0030;
    pub(super) const ALLOCATED: u32 = 0x0028_0100;
    pub(super) const STORED: u32 = 0x0028_0101;
    pub(super) const HIGH: u32 = 0x0028_0102;
    pub(super) const SIGNED: u32 = 0x0028_0103;
    pub(super) const INTERCEPT: u32 = 0x0028_1052;
    pub(super) const SLOPE: u32 = 0x0028_1053;
    pub(super) const RESCALE_TYPE: u32 = 0x0028_1054;
    pub(super) const ALL: [u32; 19] = [
        MODALITY,
        THICKNESS,
        SERIES,
        POSITION,
        ORIENTATION,
        SAMPLES,
        PHOTOMETRIC,
        PLANAR,
        FRAMES,
        ROWS,
        COLUMNS,
        PIXEL_SPACING,
        ALLOCATED,
        STORED,
        HIGH,
        SIGNED,
        INTERCEPT,
        SLOPE,
        RESCALE_TYPE,
    ];
}

/// What all slices of a stack share.
#[derive(Clone, Debug, PartialEq)]
struct Layout {
    columns: usize,
    rows: usize,
    components: usize,
    scalar: ScalarType,
    /// Bits that count, where they are fewer than there are.
    significant: Option<u32>,
    big: bool,
    slope: f64,
    intercept: f64,
    unit: String,
    inverted: bool,
}

#[derive(Debug)]
struct Slice {
    path: PathBuf,
    layout: Layout,
    position: DVec3,
    row: DVec3,
    column: DVec3,
    /// Between columns, between rows.
    spacing: [f64; 2],
    thickness: Option<f64>,
    start: u64,
    length: u64,
}

fn open(storage: &Storage, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let (resample, as_stored) = (flag(options, "resample"), flag(options, "as_stored"));
    if resample && as_stored {
        let problem = "resample and as_stored exclude each other".into();
        return Err(LoadError::Options { loader: "dicom".into(), problem });
    }
    let mut warnings = Vec::new();
    let mut slices = gather(storage, path, text(options, "series"), &mut warnings)?;
    let normal = consistent(&slices)?;
    slices.sort_by(|a, b| a.position.dot(normal).total_cmp(&b.position.dot(normal)));
    let stack = Stack::of(&slices, normal)?;
    if slices[0].layout.inverted {
        let message = "MONOCHROME1: low numbers mean white; the numbers are given as stored";
        warnings.push(Warning::note(WarningCode::FileContent, name_of(path), message));
    }
    if let (Some(uneven), false) = (&stack.uneven, resample) {
        if !as_stored {
            return Err(LoadError::Unsupported {
                path: path.into(),
                what: format!("a stack of uneven distances: {uneven}"),
                cure: "set the option resample to true to interpolate it to an even one".into(),
            });
        }
        let message = format!("uneven distances are taken as even: {uneven}");
        warnings.push(Warning::new(WarningCode::FileContent, name_of(path), message));
    }
    let count = if resample && stack.uneven.is_some() { stack.even_count() } else { slices.len() };
    let step = stack.step(count);
    let stored = grid(storage, path, &slices, stack.step(slices.len()), warnings)?;
    if count == slices.len() && !(resample && stack.uneven.is_some()) {
        return Ok(stored);
    }
    let desc = describe(path, &slices, count, step)?;
    let source = Resampled { inner: stored, places: stack.places, count, slices: BTreeMap::new() };
    let warnings = source.inner.warnings().to_vec();
    Ok(Box::new(SliceReader { path: path.into(), desc, warnings, source }))
}

/// All slices of the wanted series.
fn gather(
    storage: &Storage,
    path: &Path,
    wanted: Option<&str>,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Slice>, LoadError> {
    let folder = storage.is_dir(path);
    let mut wanted = wanted.map(str::to_owned);
    let files = if folder {
        storage.list(path)?
    } else {
        let own = read_file(storage, path)?;
        let own = own.ok_or_else(|| LoadError::invalid(path, "head", "without DICM at byte 128", "a DICOM file"))?;
        wanted.get_or_insert(own.text(tag::SERIES).unwrap_or_default());
        storage.list(path.parent().unwrap_or(Path::new("")))?
    };
    let mut series: BTreeMap<String, Vec<Elements>> = BTreeMap::new();
    let mut paths: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    let mut others = 0;
    for file in files {
        match read_file(storage, &file)? {
            Some(elements) if elements.pixels.is_some() => {
                let uid = elements.text(tag::SERIES).unwrap_or_default();
                series.entry(uid.clone()).or_default().push(elements);
                paths.entry(uid).or_default().push(file);
            }
            _ => others += 1,
        }
    }
    if others > 0 && folder {
        let message = format!("{others} files that are no DICOM images are not read");
        warnings.push(Warning::note(WarningCode::FileContent, name_of(path), message));
    }
    let list = || series.iter().map(|(uid, f)| format!("{uid} ({} files)", f.len())).collect::<Vec<_>>().join(", ");
    let uid = match wanted {
        Some(uid) if series.contains_key(&uid) => uid,
        Some(uid) => return Err(LoadError::invalid(path, "series", list(), format!("{uid:?} among them"))),
        None if series.is_empty() => return Err(LoadError::invalid(path, "series", "missing", "DICOM images")),
        None if series.len() > 1 => {
            let cure = "name one with the option series".into();
            let what = format!("a folder of several series: {}", list());
            return Err(LoadError::Unsupported { path: path.into(), what, cure });
        }
        None => series.keys().next().cloned().unwrap_or_default(),
    };
    let found = series.remove(&uid).unwrap_or_default();
    let paths = paths.remove(&uid).unwrap_or_default();
    found.iter().zip(paths).map(|(elements, path)| slice(elements, path)).collect()
}

fn read_file(storage: &Storage, path: &Path) -> Result<Option<Elements>, LoadError> {
    if !elements::is_dicom(&storage.head(path, 132)?) {
        return Ok(None);
    }
    elements::read(storage, path, &tag::ALL).map(Some)
}

fn slice(e: &Elements, path: PathBuf) -> Result<Slice, LoadError> {
    let layout = layout(e, &path)?;
    let missing = |name: &str| LoadError::invalid(&path, name, "missing", "one");
    let position: [f64; 3] =
        e.decimals(tag::POSITION, "ImagePositionPatient")?.ok_or_else(|| missing("ImagePositionPatient"))?;
    let orientation: [f64; 6] =
        e.decimals(tag::ORIENTATION, "ImageOrientationPatient")?.ok_or_else(|| missing("ImageOrientationPatient"))?;
    let [between_rows, between_columns]: [f64; 2] =
        e.decimals(tag::PIXEL_SPACING, "PixelSpacing")?.ok_or_else(|| missing("PixelSpacing"))?;
    let thickness = e.decimals::<1>(tag::THICKNESS, "SliceThickness")?.map(|[t]| t);
    let (start, length) = match e.pixels {
        Some((start, Some(length))) => (start, length),
        _ => return Err(LoadError::invalid(&path, "PixelData", "encapsulated", "of defined length")),
    };
    let row = DVec3::from_slice(&orientation[..3]);
    let column = DVec3::from_slice(&orientation[3..]);
    if (row.length() - 1.0).abs() > 1e-3 || (column.length() - 1.0).abs() > 1e-3 || row.dot(column).abs() > 1e-3 {
        let found = format!("{orientation:?}");
        return Err(LoadError::invalid(&path, "ImageOrientationPatient", found, "two perpendicular unit vectors"));
    }
    let (position, spacing) = (DVec3::from_array(position), [between_columns, between_rows]);
    Ok(Slice { path, layout, position, row, column, spacing, thickness, start, length })
}

fn layout(e: &Elements, path: &Path) -> Result<Layout, LoadError> {
    let unsupported = |what: String, cure: &str| LoadError::Unsupported { path: path.into(), what, cure: cure.into() };
    if let Some(name) = compressed(&e.syntax) {
        let what = format!("transfer syntax {} ({name})", e.syntax);
        return Err(unsupported(what, "decompress it, e.g. with dcmdjpeg or gdcmconv --raw"));
    }
    let frames = e.decimals::<1>(tag::FRAMES, "NumberOfFrames")?.map_or(1.0, |[n]| n);
    if frames != 1.0 {
        return Err(unsupported(format!("an object of {frames} frames"), "save it as one file a slice"));
    }
    let components = usize::from(e.short(tag::SAMPLES).unwrap_or(1));
    let photometric = e.text(tag::PHOTOMETRIC).unwrap_or_default();
    match (components, photometric.as_str()) {
        (1, "MONOCHROME1" | "MONOCHROME2" | "") => {}
        (3, "RGB") if e.short(tag::PLANAR).unwrap_or(0) == 0 => {}
        _ => {
            let what = format!("{components} samples of {photometric}");
            return Err(unsupported(what, "save it as MONOCHROME2 or interleaved RGB"));
        }
    }
    let allocated = e.need_short(tag::ALLOCATED, "BitsAllocated")?;
    let stored = e.short(tag::STORED).unwrap_or(allocated);
    let high = e.short(tag::HIGH).unwrap_or(stored.saturating_sub(1));
    let signed = e.short(tag::SIGNED).unwrap_or(0) == 1;
    let scalar = match (allocated, signed) {
        (8, false) => ScalarType::U8,
        (8, true) => ScalarType::I8,
        (16, false) => ScalarType::U16,
        (16, true) => ScalarType::I16,
        (32, false) => ScalarType::U32,
        (32, true) => ScalarType::I32,
        _ => return Err(LoadError::invalid(path, "BitsAllocated", allocated, "8, 16 or 32")),
    };
    if stored == 0 || stored > allocated || high + 1 != stored {
        let found = format!("{stored} with HighBit {high} of {allocated}");
        return Err(LoadError::invalid(path, "BitsStored", found, "the lowest bits of those allocated"));
    }
    if e.big && allocated == 8 {
        return Err(unsupported("8 bits in big-endian words".into(), "save it little-endian"));
    }
    let decimal = |tag, name, default| Ok(e.decimals::<1>(tag, name)?.map_or(default, |[v]| v));
    let ct = e.text(tag::MODALITY).as_deref() == Some("CT");
    Ok(Layout {
        columns: usize::from(e.need_short(tag::COLUMNS, "Columns")?),
        rows: usize::from(e.need_short(tag::ROWS, "Rows")?),
        components,
        scalar,
        significant: (stored < allocated).then_some(u32::from(stored)),
        big: e.big,
        slope: decimal(tag::SLOPE, "RescaleSlope", 1.0)?,
        intercept: decimal(tag::INTERCEPT, "RescaleIntercept", 0.0)?,
        unit: e.text(tag::RESCALE_TYPE).or_else(|| ct.then(|| "HU".into())).unwrap_or_default(),
        inverted: photometric == "MONOCHROME1",
    })
}

/// The name of a transfer syntax whose pixels are compressed.
fn compressed(syntax: &str) -> Option<&'static str> {
    Some(match syntax {
        "1.2.840.10008.1.2" | "1.2.840.10008.1.2.1" | "1.2.840.10008.1.2.2" => return None,
        "1.2.840.10008.1.2.4.50" => "JPEG baseline",
        "1.2.840.10008.1.2.4.51" => "JPEG extended",
        "1.2.840.10008.1.2.4.57" | "1.2.840.10008.1.2.4.70" => "JPEG lossless",
        "1.2.840.10008.1.2.4.80" => "JPEG-LS lossless",
        "1.2.840.10008.1.2.4.81" => "JPEG-LS near-lossless",
        "1.2.840.10008.1.2.4.90" => "JPEG 2000 lossless",
        "1.2.840.10008.1.2.4.91" => "JPEG 2000",
        "1.2.840.10008.1.2.5" => "RLE",
        _ => "not one of the uncompressed ones",
    })
}

fn describe(path: &Path, slices: &[Slice], count: usize, step: DVec3) -> Result<VolumeDesc, LoadError> {
    let first = &slices[0];
    let layout = &first.layout;
    let dims =
        fields::dimensions(path, "Columns and Rows", &[layout.columns as u64, layout.rows as u64, count as u64])?;
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, layout.scalar, layout.components) };
    (desc.slope, desc.intercept, desc.unit) = (layout.slope, layout.intercept, layout.unit.clone());
    let depth = step.length();
    let directions = [first.row, first.column, step / depth];
    let spacing = [first.spacing[0], first.spacing[1], depth];
    world::place_spaced(path, "slices", &mut desc, directions, spacing, first.position)?;
    validate(path, &desc)?;
    Ok(desc)
}

/// The reader of the slices as they are stored.
fn grid(
    storage: &Storage,
    path: &Path,
    slices: &[Slice],
    step: DVec3,
    warnings: Vec<Warning>,
) -> Result<Box<dyn VolumeReader>, LoadError> {
    let desc = describe(path, slices, slices.len(), step)?;
    let layout = &slices[0].layout;
    let length = desc.bytes().map_or(u64::MAX, |n| n as u64) / slices.len() as u64;
    let mut parts = Vec::with_capacity(slices.len());
    for slice in slices {
        let there = storage.length(&slice.path)?.saturating_sub(slice.start).min(slice.length);
        // Values have an even length.
        let encoded = if there == length + 1 { length } else { there };
        parts.push(Part { path: slice.path.clone(), start: slice.start, encoded, skip: 0, length });
    }
    let signed = matches!(layout.scalar, ScalarType::I8 | ScalarType::I16 | ScalarType::I32);
    let payload = Payload {
        storage: storage.clone(),
        parts,
        encoding: Encoding::Raw,
        order: ByteOrder::big_if(layout.big),
        open_ended: false,
        significant: layout.significant.map(|bits| Significant { bits, signed }),
    };
    GridReader::open(path, desc, payload, warnings)
}
