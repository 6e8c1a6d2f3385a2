//! MetaImage, `.mhd` with its data beside it and `.mha` in one file.
//!
//! # Reads
//! Two or three dimensions, 1 to 4 channels; raw, text and zlib (or gzip) data; `LOCAL`, a file, a
//! numbered pattern or a `LIST`; `HeaderSize` (−1 included); either byte order. Placement from
//! `Offset`, `TransformMatrix` (rows are the axes' directions, as ITK has them) and
//! `ElementSpacing`, in LPS.
//!
//! # Options
//! None.
//!
//! # Limits
//! 64-bit integers are refused. `CompressedDataSize` is compared with the file, and where it is
//! wrong the whole stream is used, with a warning. `AnatomicalOrientation` and `CenterOfRotation`
//! are not used.

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
    Format::new("metaimage", "MetaImage volumes (.mhd, .mha)", probe, open)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    let has = |word: &[u8]| probe.head.windows(word.len()).any(|w| w == word);
    let starts = probe.head.starts_with(b"ObjectType") || probe.head.starts_with(b"NDims");
    confidence(starts && has(b"DimSize"), probe, &[".mhd", ".mha"])
}

struct Header {
    path: std::path::PathBuf,
    fields: BTreeMap<String, String>,
    list: Vec<String>,
    end: u64,
}

fn read_header(storage: &Storage, path: &Path) -> Result<Header, LoadError> {
    let mut lines = storage.lines(path)?;
    let mut header = Header { path: path.into(), fields: BTreeMap::new(), list: Vec::new(), end: 0 };
    while let Some(line) = lines.line()? {
        if line.trim().is_empty() {
            continue;
        }
        let Some((key, value)) = line.split_once('=') else {
            let found: String = line.chars().take(40).collect();
            return Err(LoadError::invalid(path, "header line", format!("{found:?}"), "Key = Value"));
        };
        let (key, value) = (key.trim(), value.trim());
        if header.fields.insert(key.to_lowercase(), value.to_owned()).is_some() {
            return Err(LoadError::invalid(path, format!("field {key:?}"), "given twice", "once"));
        }
        if key.eq_ignore_ascii_case("ElementDataFile") {
            break;
        }
        if lines.offset() > 1 << 26 {
            return Err(LoadError::invalid(path, "header", "longer", "at most 64 MiB"));
        }
    }
    header.end = lines.offset();
    let file = header.need("ElementDataFile")?;
    if file.split_whitespace().next() == Some("LIST") {
        while let Some(line) = lines.line()? {
            if !line.trim().is_empty() {
                header.list.push(line.trim().to_owned());
            }
            if lines.offset() > 1 << 26 {
                return Err(LoadError::invalid(path, "header", "longer", "at most 64 MiB"));
            }
        }
    }
    Ok(header)
}

impl Header {
    fn get(&self, field: &str) -> Option<&str> {
        self.fields.get(&field.to_lowercase()).map(String::as_str)
    }

    fn need(&self, field: &str) -> Result<&str, LoadError> {
        self.get(field).ok_or_else(|| LoadError::invalid(&self.path, format!("field {field:?}"), "missing", "one"))
    }

    fn first_of<'a>(&self, names: &[&'a str]) -> Option<(&'a str, &str)> {
        names.iter().find_map(|name| self.get(name).map(|value| (*name, value)))
    }

    fn flag(&self, names: &[&str], default: bool) -> Result<bool, LoadError> {
        let Some((name, value)) = self.first_of(names) else { return Ok(default) };
        match value.to_lowercase().as_str() {
            "true" | "1" | "yes" | "t" => Ok(true),
            "false" | "0" | "no" | "f" => Ok(false),
            _ => Err(LoadError::invalid(&self.path, name, format!("{value:?}"), "True or False")),
        }
    }
}

fn open(storage: &Storage, path: &Path, _: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let header = read_header(storage, path)?;
    if let Some(kind) = header.get("ObjectType").filter(|kind| !kind.eq_ignore_ascii_case("image")) {
        let cure = "only images are read".into();
        return Err(LoadError::Unsupported { path: path.into(), what: format!("object type {kind:?}"), cure });
    }
    let axes: usize = fields::value(path, "NDims", header.need("NDims")?, "2 or 3")?;
    let sizes: Vec<u64> = fields::values(path, "DimSize", header.need("DimSize")?, "whole numbers")?;
    if sizes.len() != axes {
        let found = format!("{} sizes for {axes} dimensions", sizes.len());
        return Err(LoadError::invalid(path, "DimSize", found, "one for each dimension"));
    }
    let dims = fields::dimensions(path, "DimSize", &sizes)?;
    let scalar = scalar_type(path, header.need("ElementType")?)?;
    let components = match header.get("ElementNumberOfChannels") {
        Some(text) => fields::value(path, "ElementNumberOfChannels", text, "1 to 4")?,
        None => 1,
    };
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, scalar, components) };
    place(path, &header, &mut desc, axes)?;
    let mut warnings = Vec::new();
    let payload = payload(storage, path, &header, &desc, &mut warnings)?;
    GridReader::open(path, desc, payload, warnings)
}

fn scalar_type(path: &Path, text: &str) -> Result<ScalarType, LoadError> {
    Ok(match text.trim_end_matches("_ARRAY") {
        "MET_CHAR" => ScalarType::I8,
        "MET_UCHAR" => ScalarType::U8,
        "MET_SHORT" => ScalarType::I16,
        "MET_USHORT" => ScalarType::U16,
        "MET_INT" => ScalarType::I32,
        "MET_UINT" => ScalarType::U32,
        "MET_FLOAT" => ScalarType::F32,
        "MET_DOUBLE" => ScalarType::F64,
        "MET_LONG" | "MET_ULONG" | "MET_LONG_LONG" | "MET_ULONG_LONG" => {
            let cure = "convert it to MET_INT or MET_DOUBLE".into();
            return Err(LoadError::Unsupported { path: path.into(), what: format!("element type {text:?}"), cure });
        }
        _ => {
            let wanted = "a type of MetaImage, e.g. MET_SHORT";
            return Err(LoadError::invalid(path, "ElementType", format!("{text:?}"), wanted));
        }
    })
}

fn place(path: &Path, header: &Header, desc: &mut VolumeDesc, axes: usize) -> Result<(), LoadError> {
    let numbers = |names: &[&str], count: usize| -> Result<Option<Vec<f64>>, LoadError> {
        let Some((name, text)) = header.first_of(names) else { return Ok(None) };
        let wanted = format!("{count} numbers");
        let list: Vec<f64> = fields::values(path, name, text, &wanted)?;
        if list.len() != count {
            return Err(LoadError::invalid(path, name, format!("{text:?}"), wanted));
        }
        Ok(Some(list))
    };
    let mut spacing = [1.0; 3];
    let mut origin = DVec3::ZERO;
    let mut directions = world::AXES;
    if let Some(list) = numbers(&["ElementSpacing", "ElementSize"], axes)? {
        spacing[..axes].copy_from_slice(&list);
    }
    if let Some(list) = numbers(&["Offset", "Position", "Origin"], axes)? {
        (0..axes).for_each(|a| origin[a] = list[a]);
    }
    if let Some(list) = numbers(&["TransformMatrix", "Rotation", "Orientation"], axes * axes)? {
        for (a, direction) in directions.iter_mut().enumerate().take(axes) {
            (0..axes).for_each(|b| direction[b] = list[a * axes + b]);
        }
    }
    world::place_spaced(path, "TransformMatrix", desc, directions, spacing, origin)
}

fn payload(
    storage: &Storage,
    path: &Path,
    header: &Header,
    desc: &VolumeDesc,
    warnings: &mut Vec<Warning>,
) -> Result<Payload, LoadError> {
    let total = desc.bytes().map_or(u64::MAX, |n| n as u64);
    let big = header.flag(&["BinaryDataByteOrderMSB", "ElementByteOrderMSB"], false)?;
    let compressed = header.flag(&["CompressedData"], false)?;
    let text = header.need("ElementDataFile")?;
    let local = matches!(text, "LOCAL" | "Local" | "local");
    let files = match text {
        _ if local => Files::One(path.into()),
        "" => return Err(LoadError::invalid(path, "ElementDataFile", "empty", "a name, a pattern, LIST or LOCAL")),
        _ if text.split_whitespace().next() == Some("LIST") => Files::list(path, "ElementDataFile", &header.list)?,
        _ if beside(path, text) == path => {
            return Err(LoadError::invalid(path, "ElementDataFile", "the header itself", "LOCAL or another file"));
        }
        _ => Files::parse(path, "ElementDataFile", text)?,
    };
    let from = if local { header.end } else { 0 };
    let encoding = if !header.flag(&["BinaryData"], true)? {
        Encoding::Ascii(desc.scalar)
    } else if compressed {
        let Files::One(file) = &files else {
            let cure = "join the files into one stream".into();
            return Err(LoadError::Unsupported { path: path.into(), what: "compressed file lists".into(), cure });
        };
        let gzip = storage.length(file)? >= from + 2 && storage.range(file, from, 2)? == [0x1f, 0x8b];
        compressed_size(storage, header, file, from, desc, warnings)?;
        if gzip { Encoding::Gzip } else { Encoding::Zlib }
    } else {
        Encoding::Raw
    };
    let begin = match header.get("HeaderSize") {
        Some("-1") => Begin::End,
        Some(text) => {
            Begin::After { lines: 0, bytes: fields::value(path, "HeaderSize", text, "a whole number, or -1")? }
        }
        None => Begin::After { lines: 0, bytes: 0 },
    };
    let order = ByteOrder::big_if(big);
    if local {
        let part = fields::part(storage, path.into(), from, total, begin, encoding)?;
        return Ok(Payload {
            storage: storage.clone(),
            parts: vec![part],
            encoding,
            order,
            open_ended: false,
            significant: None,
        });
    }
    fields::payload(storage, path, files, total, begin, encoding, order)
}

/// Compares the size stated with the file's. The stream itself says where it ends, so a wrong
/// number is no reason to stop early, as others do.
fn compressed_size(
    storage: &Storage,
    header: &Header,
    file: &Path,
    from: u64,
    desc: &VolumeDesc,
    warnings: &mut Vec<Warning>,
) -> Result<(), LoadError> {
    let Some(text) = header.get("CompressedDataSize") else { return Ok(()) };
    let stated: u64 = fields::value(&header.path, "CompressedDataSize", text, "a whole number")?;
    let found = storage.length(file)?.saturating_sub(from);
    if stated != found {
        let message = format!("CompressedDataSize says {stated} bytes, the file has {found}; the whole stream is used");
        warnings.push(Warning::new(WarningCode::FileContent, &desc.name, message));
    }
    Ok(())
}
