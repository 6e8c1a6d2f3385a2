//! NRRD, versions 1 to 5.
//!
//! # Reads
//! Attached and detached headers; encodings raw, gzip, bzip2, ascii and hex; one data file, a
//! numbered pattern or a `LIST`; `line skip` and `byte skip` (−1 included); either byte order; one
//! to three axes of space, and before them one axis of 1 to 4 components. Placement from `space
//! directions` and `space origin`, else from `spacings`, `axis mins`, `axis maxs` and `centers`;
//! anatomical spaces are turned to LPS.
//!
//! # Options
//! None.
//!
//! # Limits
//! 64-bit integers, blocks, time axes and components that are not the first axis are refused.
//! `space units`, `measurement frame`, `old min` and key/value pairs are not used.

use std::{collections::BTreeMap, path::Path};

use volact_core::{
    LoadError, LoadOptions, ScalarType, VolumeDesc, VolumeReader, Warning, WarningCode,
    glam::DVec3,
    loader::{Confidence, Probe},
};

use crate::{
    fields::{self, Begin, Files},
    format::{Format, beside, confidence, name_of},
    payload::{ByteOrder, Encoding, GridReader, Payload},
    storage::Storage,
    world,
};

/// The loader.
pub(crate) fn format() -> Format {
    Format::new("nrrd", "NRRD volumes, attached or detached (.nrrd, .nhdr)", probe, open)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    confidence(probe.head.starts_with(b"NRRD000"), probe, &[".nrrd", ".nhdr"])
}

/// The fields known, each with the names it may bear.
const FIELDS: [(&str, &[&str]); 30] = [
    ("dimension", &["dimension"]),
    ("type", &["type"]),
    ("sizes", &["sizes"]),
    ("endian", &["endian"]),
    ("encoding", &["encoding"]),
    ("data file", &["data file", "datafile"]),
    ("line skip", &["line skip", "lineskip"]),
    ("byte skip", &["byte skip", "byteskip"]),
    ("spacings", &["spacings"]),
    ("axis mins", &["axis mins", "axismins"]),
    ("axis maxs", &["axis maxs", "axismaxs"]),
    ("centers", &["centers", "centerings"]),
    ("kinds", &["kinds"]),
    ("space", &["space"]),
    ("space dimension", &["space dimension"]),
    ("space directions", &["space directions"]),
    ("space origin", &["space origin"]),
    ("space units", &["space units"]),
    ("sample units", &["sample units", "sampleunits"]),
    ("content", &["content"]),
    ("block size", &["block size", "blocksize"]),
    ("number", &["number"]),
    ("min", &["min"]),
    ("max", &["max"]),
    ("old min", &["old min", "oldmin"]),
    ("old max", &["old max", "oldmax"]),
    ("labels", &["labels"]),
    ("units", &["units"]),
    ("thicknesses", &["thicknesses"]),
    ("measurement frame", &["measurement frame"]),
];

struct Header {
    fields: BTreeMap<&'static str, String>,
    list: Option<Vec<String>>,
    /// Where an attached header's data begin.
    end: u64,
    unknown: Vec<String>,
}

fn read_header(storage: &Storage, path: &Path) -> Result<Header, LoadError> {
    let mut lines = storage.lines(path)?;
    let magic = lines.line()?.unwrap_or_default();
    if !matches!(magic.strip_prefix("NRRD000"), Some("1" | "2" | "3" | "4" | "5")) {
        let found = format!("{:?}", magic.chars().take(16).collect::<String>());
        return Err(LoadError::invalid(path, "first line", found, "NRRD0001 to NRRD0005"));
    }
    let mut header = Header { fields: BTreeMap::new(), list: None, end: 0, unknown: Vec::new() };
    while let Some(line) = lines.line()?.filter(|line| !line.is_empty()) {
        if let Some(list) = &mut header.list {
            list.push(line);
        } else if !line.starts_with('#') && !is_key_value(&line) {
            let Some((name, value)) = line.split_once(": ").or_else(|| line.split_once(':')) else {
                return Err(LoadError::invalid(
                    path,
                    "header line",
                    format!("{line:?}"),
                    "a field, a key or a comment",
                ));
            };
            take_field(path, &mut header, name, value.trim())?;
        }
        if lines.offset() > 1 << 26 {
            return Err(LoadError::invalid(path, "header", "longer", "at most 64 MiB"));
        }
    }
    header.end = lines.offset();
    Ok(header)
}

fn is_key_value(line: &str) -> bool {
    line.find(":=").is_some_and(|at| line.find(": ").is_none_or(|field| at < field))
}

fn take_field(path: &Path, header: &mut Header, name: &str, value: &str) -> Result<(), LoadError> {
    let lower = name.trim().to_lowercase();
    let Some((field, _)) = FIELDS.iter().find(|(_, names)| names.contains(&lower.as_str())) else {
        header.unknown.push(lower);
        return Ok(());
    };
    if header.fields.insert(field, value.to_owned()).is_some() {
        return Err(LoadError::invalid(path, format!("field {field:?}"), "given twice", "once"));
    }
    if *field == "data file" && value.split_whitespace().next() == Some("LIST") {
        header.list = Some(Vec::new());
    }
    Ok(())
}

impl Header {
    fn get(&self, field: &str) -> Option<&str> {
        self.fields.get(field).map(String::as_str)
    }

    fn need(&self, path: &Path, field: &'static str) -> Result<&str, LoadError> {
        self.get(field).ok_or_else(|| LoadError::invalid(path, format!("field {field:?}"), "missing", "one"))
    }
}

fn open(storage: &Storage, path: &Path, _: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let header = read_header(storage, path)?;
    let scalar = scalar_type(path, header.need(path, "type")?)?;
    let sizes: Vec<u64> = fields::values(path, "sizes", header.need(path, "sizes")?, "whole numbers")?;
    let dimension: usize = fields::value(path, "dimension", header.need(path, "dimension")?, "a whole number")?;
    if sizes.len() != dimension {
        let found = format!("{} sizes for dimension {dimension}", sizes.len());
        return Err(LoadError::invalid(path, "sizes", found, "one for each axis"));
    }
    let skip = component_axis(path, &header, &sizes)?;
    let components = if skip == 1 { sizes[0] as usize } else { 1 };
    let dims = fields::dimensions(path, "sizes", &sizes[skip..])?;
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, scalar, components) };
    desc.unit = header.get("sample units").unwrap_or_default().trim_matches('"').to_owned();
    place(path, &header, &mut desc, skip, sizes.len())?;
    let encoding = encoding(path, header.need(path, "encoding")?, scalar)?;
    let order = byte_order(path, &header, scalar, encoding)?;
    let payload = payload(storage, path, &header, &desc, encoding, order)?;
    let mut warnings = Vec::new();
    for field in &header.unknown {
        let message = format!("field {field:?} is unknown and not used");
        warnings.push(Warning::new(WarningCode::FileContent, &desc.name, message));
    }
    GridReader::open(path, desc, payload, warnings)
}

fn scalar_type(path: &Path, text: &str) -> Result<ScalarType, LoadError> {
    Ok(match text {
        "signed char" | "int8" | "int8_t" => ScalarType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => ScalarType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => ScalarType::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => ScalarType::U16,
        "int" | "signed int" | "int32" | "int32_t" => ScalarType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => ScalarType::U32,
        "float" => ScalarType::F32,
        "double" => ScalarType::F64,
        "block"
        | "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t"
        | "ulonglong"
        | "unsigned long long"
        | "unsigned long long int"
        | "uint64"
        | "uint64_t" => {
            let what = format!("type {text:?}");
            let cure = "convert it to 32-bit integers or to double".into();
            return Err(LoadError::Unsupported { path: path.into(), what, cure });
        }
        other => return Err(LoadError::invalid(path, "type", format!("{other:?}"), "a type of NRRD, e.g. \"short\"")),
    })
}

fn encoding(path: &Path, text: &str, scalar: ScalarType) -> Result<Encoding, LoadError> {
    match text.to_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "gz" | "gzip" => Ok(Encoding::Gzip),
        "bz2" | "bzip2" => Ok(Encoding::Bzip2),
        "txt" | "text" | "ascii" => Ok(Encoding::Ascii(scalar)),
        "hex" => Ok(Encoding::Hex),
        other => {
            let wanted = "raw, gzip, bzip2, ascii or hex";
            Err(LoadError::invalid(path, "encoding", format!("{other:?}"), wanted))
        }
    }
}

fn byte_order(path: &Path, header: &Header, scalar: ScalarType, encoding: Encoding) -> Result<ByteOrder, LoadError> {
    match header.get("endian") {
        Some("little") => Ok(ByteOrder::Little),
        Some("big") => Ok(ByteOrder::Big),
        None if scalar.size() == 1 || matches!(encoding, Encoding::Ascii(_)) => Ok(ByteOrder::NATIVE),
        found => {
            let found = found.map_or("missing".into(), |f| format!("{f:?}"));
            Err(LoadError::invalid(path, "field \"endian\"", found, "little or big"))
        }
    }
}

/// Whether the first axis holds components (1) or space (0).
fn component_axis(path: &Path, header: &Header, sizes: &[u64]) -> Result<usize, LoadError> {
    let kinds: Vec<_> = header.get("kinds").unwrap_or_default().split_whitespace().collect();
    let directions = match header.get("space directions") {
        Some(text) => vectors(path, "space directions", text)?,
        None => Vec::new(),
    };
    let spatial = |axis: usize| match (directions.get(axis), kinds.get(axis)) {
        (Some(direction), _) => direction.is_some(),
        (None, Some(kind)) => matches!(*kind, "domain" | "space" | "???" | "none"),
        (None, None) => axis > 0 || sizes.len() < 4,
    };
    if let Some(axis) = (1..sizes.len()).find(|a| !spatial(*a)) {
        let what = format!("axis {} (of {}) that is not of space", axis + 1, sizes.len());
        let cure = "make components the first axis and split time into files".into();
        return Err(LoadError::Unsupported { path: path.into(), what, cure });
    }
    if spatial(0) {
        return Ok(0);
    }
    if sizes.len() < 2 || !(1..=4).contains(&sizes[0]) {
        return Err(LoadError::invalid(path, "components", format!("{sizes:?}"), "1 to 4, then axes of space"));
    }
    Ok(1)
}

/// `(1,0,0) none (0,1,0)`
fn vectors(path: &Path, field: &str, text: &str) -> Result<Vec<Option<DVec3>>, LoadError> {
    let mut out = Vec::new();
    let mut rest = text.trim();
    let wanted = "vectors of up to three numbers, e.g. (1,0,0) (0,1,0) (0,0,1)";
    let bad = || LoadError::invalid(path, field, format!("{text:?}"), wanted);
    while !rest.is_empty() {
        if let Some(after) = rest.strip_prefix("none") {
            out.push(None);
            rest = after.trim_start();
            continue;
        }
        let (inside, after) = rest.strip_prefix('(').and_then(|r| r.split_once(')')).ok_or_else(bad)?;
        let numbers: Vec<f64> =
            inside.split(',').map(|word| word.trim().parse().map_err(|_| bad())).collect::<Result<_, _>>()?;
        if numbers.len() > 3 {
            return Err(bad());
        }
        out.push(Some(DVec3::from_array(std::array::from_fn(|a| numbers.get(a).copied().unwrap_or(0.0)))));
        rest = after.trim_start();
    }
    Ok(out)
}

/// What turns a vector of the named space into LPS.
fn to_lps(path: &Path, space: &str) -> Result<DVec3, LoadError> {
    let signs = match space.to_lowercase().as_str() {
        "left-posterior-superior" | "lps" => [1.0, 1.0, 1.0],
        "right-anterior-superior" | "ras" => [-1.0, -1.0, 1.0],
        "left-anterior-superior" | "las" => [1.0, -1.0, 1.0],
        "" | "scanner-xyz" | "3d-right-handed" | "3d-left-handed" => [1.0, 1.0, 1.0],
        _ => {
            let cure = "use left-posterior-superior, right-anterior-superior or left-anterior-superior".into();
            return Err(LoadError::Unsupported { path: path.into(), what: format!("space {space:?}"), cure });
        }
    };
    Ok(DVec3::from_array(signs))
}

fn place(path: &Path, header: &Header, desc: &mut VolumeDesc, skip: usize, axes: usize) -> Result<(), LoadError> {
    if let Some(text) = header.get("space directions") {
        let found = vectors(path, "space directions", text)?;
        if found.len() != axes {
            let found = format!("{} vectors for {axes} axes", found.len());
            return Err(LoadError::invalid(path, "space directions", found, "one for each axis"));
        }
        let mut steps = world::AXES;
        for (step, direction) in steps.iter_mut().zip(found[skip..].iter().flatten()) {
            *step = *direction;
        }
        if axes - skip == 2 {
            steps[2] = steps[0].cross(steps[1]).try_normalize().unwrap_or(DVec3::Z);
        }
        let origin = match header.get("space origin") {
            Some(text) => match vectors(path, "space origin", text)?[..] {
                [Some(origin)] => origin,
                _ => return Err(LoadError::invalid(path, "space origin", format!("{text:?}"), "one vector")),
            },
            None => DVec3::ZERO,
        };
        let turn = to_lps(path, header.get("space").unwrap_or_default())?;
        return world::place(path, "space directions", desc, steps.map(|s| s * turn), origin * turn);
    }
    let numbers = |field: &'static str| -> Result<Option<Vec<f64>>, LoadError> {
        let Some(text) = header.get(field) else { return Ok(None) };
        let list: Vec<f64> = fields::values(path, field, text, "one number for each axis")?;
        if list.len() != axes {
            return Err(LoadError::invalid(path, field, format!("{text:?}"), "one number for each axis"));
        }
        Ok(Some(list))
    };
    let (spacings, mins, maxs) = (numbers("spacings")?, numbers("axis mins")?, numbers("axis maxs")?);
    let cells: Vec<bool> =
        header.get("centers").unwrap_or_default().split_whitespace().map(|word| word == "cell").collect();
    let mut spacing = [1.0; 3];
    let mut origin = DVec3::ZERO;
    for a in 0..axes - skip {
        let axis = a + skip;
        let given = |list: &Option<Vec<f64>>| list.as_ref().map(|l| l[axis]).filter(|v| !v.is_nan());
        let cell = cells.get(axis).copied().unwrap_or(false);
        let intervals = desc.dims[a] - usize::from(!cell);
        spacing[a] = match (given(&spacings), given(&mins), given(&maxs)) {
            (Some(s), ..) => s,
            (None, Some(min), Some(max)) if intervals > 0 => (max - min) / intervals as f64,
            _ => 1.0,
        };
        origin[a] = given(&mins).map_or(0.0, |min| min + if cell { spacing[a] / 2.0 } else { 0.0 });
    }
    world::place_spaced(path, "axes", desc, world::AXES, spacing, origin)
}

fn payload(
    storage: &Storage,
    path: &Path,
    header: &Header,
    desc: &VolumeDesc,
    encoding: Encoding,
    order: ByteOrder,
) -> Result<Payload, LoadError> {
    let total = desc.bytes().map_or(u64::MAX, |n| n as u64);
    let lines = match header.get("line skip") {
        Some(text) => fields::value(path, "line skip", text, "a whole number")?,
        None => 0,
    };
    let begin = match header.get("byte skip").map(str::trim) {
        Some("-1") if encoding == Encoding::Raw => Begin::End,
        Some(text) => {
            Begin::After { lines, bytes: fields::value(path, "byte skip", text, "a whole number, or -1 for raw")? }
        }
        None => Begin::After { lines, bytes: 0 },
    };
    let files = match (&header.list, header.get("data file")) {
        (Some(names), _) => Files::list(path, "data file", names)?,
        (None, Some("")) => return Err(LoadError::invalid(path, "data file", "empty", "a name, a pattern or LIST")),
        (None, Some(text)) if text == name_of(path) || beside(path, text) == path => {
            return Err(LoadError::invalid(path, "data file", "the header itself", "another file"));
        }
        (None, Some(text)) => Files::parse(path, "data file", text)?,
        (None, None) => {
            let part = fields::part(storage, path.into(), header.end, total, begin, encoding)?;
            return Ok(Payload {
                storage: storage.clone(),
                parts: vec![part],
                encoding,
                order,
                open_ended: false,
                significant: None,
            });
        }
    };
    if let Files::Many(paths) = &files {
        share_check(path, header, desc, paths.len())?;
    }
    fields::payload(storage, path, files, total, begin, encoding, order)
}

/// With several files and no dimension given, each holds one slice of the slowest axis.
fn share_check(path: &Path, header: &Header, desc: &VolumeDesc, files: usize) -> Result<(), LoadError> {
    let words: Vec<_> = header.get("data file").unwrap_or_default().split_whitespace().collect();
    let given = if header.list.is_some() { words.len() > 1 } else { words.len() > 4 };
    let slices = desc.dims.iter().rev().find(|n| **n > 1).copied().unwrap_or(1);
    if !given && slices != files && desc.dims[2] != files {
        return Err(LoadError::invalid(path, "data files", files, format!("one for each of {slices} slices")));
    }
    Ok(())
}
