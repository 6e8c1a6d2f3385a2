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

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use volact_core::{
    LoadError, LoadOptions, ParameterDecl, ParameterType, Region, ScalarType, VolumeDesc, VolumeReader, Warning,
    WarningCode,
    glam::DVec3,
    loader::{Confidence, NoProgress, Probe},
};

use crate::{
    elements::{self, Elements},
    fields,
    format::{Format, flag, name_of, text},
    payload::{ByteOrder, Encoding, GridReader, Part, Payload, Significant, validate},
    slices::{SliceReader, SliceSource},
    storage::Storage,
    world,
};

/// How far from its even place a slice may lie, in slice distances.
const EVEN: f64 = 0.01;
/// How many times more slices resampling may make.
const MOST_GROWTH: usize = 8;

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

/// Checks that the slices make one stack; returns the planes' normal.
fn consistent(slices: &[Slice]) -> Result<DVec3, LoadError> {
    let first = &slices[0];
    for other in &slices[1..] {
        let differs = |what: &str, found: String, wanted: String| {
            let wanted = format!("{wanted} as in {}", name_of(&first.path));
            Err(LoadError::invalid(&other.path, what, found, wanted))
        };
        let (a, b) = (&first.layout, &other.layout);
        if (a.rows, a.columns, a.components, a.scalar) != (b.rows, b.columns, b.components, b.scalar) {
            let size = |l: &Layout| format!("{} x {}, {} of {}", l.columns, l.rows, l.components, l.scalar);
            return differs("slice", size(b), size(a));
        }
        if (a.slope, a.intercept) != (b.slope, b.intercept) {
            let map = |l: &Layout| format!("{} and {}", l.slope, l.intercept);
            return differs("rescale slope and intercept", map(b), map(a));
        }
        if a != b {
            return differs("pixel format", format!("{b:?}"), format!("{a:?}"));
        }
        if first.row.distance(other.row) > 1e-4 || first.column.distance(other.column) > 1e-4 {
            let axes = |s: &Slice| format!("{} {}", s.row, s.column);
            return differs("ImageOrientationPatient", axes(other), axes(first));
        }
        if (0..2).any(|n| (first.spacing[n] - other.spacing[n]).abs() > 1e-4 * first.spacing[n].abs()) {
            return differs("PixelSpacing", format!("{:?}", other.spacing), format!("{:?}", first.spacing));
        }
    }
    Ok(first.row.cross(first.column).normalize())
}

/// The slices' places along the line that their first samples lie on.
struct Stack {
    /// Distance of each slice from the first.
    places: Vec<f64>,
    direction: DVec3,
    /// The distances in words, if they are not even.
    uneven: Option<String>,
}

impl Stack {
    fn of(slices: &[Slice], normal: DVec3) -> Result<Self, LoadError> {
        let (first, last) = (&slices[0], &slices[slices.len() - 1]);
        if slices.len() == 1 {
            let thickness = first.thickness.filter(|t| *t > 0.0).unwrap_or(1.0);
            return Ok(Self { places: vec![0.0], direction: normal * thickness, uneven: None });
        }
        let span = last.position - first.position;
        let length = span.length();
        let direction = span / length;
        let places: Vec<f64> = slices.iter().map(|s| (s.position - first.position).dot(direction)).collect();
        for (n, pair) in places.windows(2).enumerate() {
            let along = (slices[n + 1].position - slices[n].position).dot(normal);
            if !(pair[1] - pair[0] > 1e-6 && along > 1e-6) {
                let found = format!("{} of two slices", slices[n + 1].position);
                let wanted = format!("another than that of {}", name_of(&slices[n].path));
                return Err(LoadError::invalid(&slices[n + 1].path, "ImagePositionPatient", found, wanted));
            }
        }
        let pixel = first.spacing[0].min(first.spacing[1]);
        for (slice, place) in slices.iter().zip(&places) {
            let beside = (first.position + direction * place).distance(slice.position);
            if beside > EVEN * pixel.max(length / (slices.len() - 1) as f64) {
                let found = format!("{beside:.4} mm beside the line from the first slice to the last");
                return Err(LoadError::invalid(&slice.path, "ImagePositionPatient", found, "all slices on one line"));
            }
        }
        let even = length / (slices.len() - 1) as f64;
        let off = places.iter().enumerate().any(|(n, place)| (place - n as f64 * even).abs() > EVEN * even);
        Ok(Self { uneven: off.then(|| distances(&places)), places, direction })
    }

    fn length(&self) -> f64 {
        self.places.last().copied().unwrap_or(0.0)
    }

    /// From one of `count` even slices to the next.
    fn step(&self, count: usize) -> DVec3 {
        if count > 1 { self.direction * (self.length() / (count - 1) as f64) } else { self.direction }
    }

    fn even_count(&self) -> usize {
        let smallest = self.places.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        let wanted = (self.length() / smallest).round() + 1.0;
        (wanted as usize).clamp(self.places.len(), self.places.len() * MOST_GROWTH)
    }
}

/// `4.22 mm (slices 1 to 14), 1.14 mm (14 to 15)`
fn distances(places: &[f64]) -> String {
    let mut runs: Vec<(f64, usize, usize)> = Vec::new();
    for (n, pair) in places.windows(2).enumerate() {
        let distance = pair[1] - pair[0];
        match runs.last_mut() {
            Some((d, _, last)) if (*d - distance).abs() <= EVEN * d.abs() => *last = n + 2,
            _ => runs.push((distance, n + 1, n + 2)),
        }
    }
    let shown = runs.iter().take(8).map(|(d, a, b)| format!("{d:.2} mm (slices {a} to {b})")).collect::<Vec<_>>();
    let more = if runs.len() > 8 { format!(" and {} more", runs.len() - 8) } else { String::new() };
    shown.join(", ") + &more
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

/// An even stack interpolated from an uneven one.
struct Resampled {
    inner: Box<dyn VolumeReader>,
    places: Vec<f64>,
    count: usize,
    /// Stored slices in use: at most two.
    slices: BTreeMap<usize, Vec<u8>>,
}

impl Resampled {
    fn load(&mut self, n: usize) -> Result<(), LoadError> {
        if !self.slices.contains_key(&n) {
            let [nx, ny, _] = self.inner.desc().dims;
            let region = Region { min: [0, 0, n], max: [nx - 1, ny - 1, n] };
            let bytes = self.inner.read_region(region, &NoProgress)?.bytes().to_vec();
            self.slices.insert(n, bytes);
        }
        Ok(())
    }
}

impl SliceSource for Resampled {
    fn slice(&mut self, z: usize) -> Result<Vec<u8>, LoadError> {
        let last = self.places.len() - 1;
        let at = self.places[last] * z as f64 / (self.count - 1) as f64;
        let n = self.places.partition_point(|place| *place <= at).clamp(1, last) - 1;
        let weight = ((at - self.places[n]) / (self.places[n + 1] - self.places[n])).clamp(0.0, 1.0);
        self.slices.retain(|kept, _| *kept == n || *kept == n + 1);
        self.load(n)?;
        self.load(n + 1)?;
        let scalar = self.inner.desc().scalar;
        let (a, b) = (&self.slices[&n], &self.slices[&(n + 1)]);
        let mut out = Vec::with_capacity(a.len());
        for index in 0..a.len() / scalar.size() {
            let (a, b) = (scalar.read(a, index), scalar.read(b, index));
            let value = (a + weight * (b - a)).round();
            match scalar {
                ScalarType::U8 => out.push(value as u8),
                ScalarType::I8 => out.push(value as i8 as u8),
                ScalarType::U16 => out.extend_from_slice(&(value as u16).to_ne_bytes()),
                ScalarType::I16 => out.extend_from_slice(&(value as i16).to_ne_bytes()),
                ScalarType::U32 => out.extend_from_slice(&(value as u32).to_ne_bytes()),
                _ => out.extend_from_slice(&(value as i32).to_ne_bytes()),
            }
        }
        Ok(out)
    }
}
