//! Legacy VTK files, structured points.
//!
//! # Reads
//! Versions 1 to 5, ASCII and BINARY (big-endian); `SPACING` or `ASPECT_RATIO`, `ORIGIN`; point
//! data as `SCALARS`, `COLOR_SCALARS`, `VECTORS`, `NORMALS`, `TEXTURE_COORDINATES` or in a
//! `FIELD`. `METADATA` is passed over.
//!
//! # Options
//! `array`: the name of the array to read; the first one by default.
//!
//! # Limits
//! 64-bit integers, bits, cell data and datasets other than structured points are refused.

use std::path::Path;

use volact_core::{
    LoadError, LoadOptions, ParameterDecl, ParameterType, VolumeDesc, VolumeReader,
    glam::DVec3,
    loader::{Confidence, Probe},
};

use crate::{
    fields,
    format::{Format, confidence, name_of, text},
    numbers::NumberType,
    payload::{ByteOrder, Encoding, GridReader, Part, Payload},
    storage::{Lines, Storage},
    vtk_legacy::{Kind, dataset, kind, unescape},
    vtk_mesh::MESHES,
    world,
};

/// The loader.
pub(crate) fn format() -> Format {
    Format::new("vtk", "legacy VTK structured points (.vtk)", probe, open).with(array_option())
}

pub(crate) fn array_option() -> ParameterDecl {
    ParameterDecl::new("array", ParameterType::Choice, "name of the array to read instead of the default one")
}

fn probe(probe: &Probe<'_>) -> Confidence {
    // Meshes of the same format have a loader of their own.
    match dataset(probe.head) {
        Some(kind) if MESHES.contains(&kind.as_str()) => Confidence::No,
        _ => confidence(probe.head.starts_with(b"# vtk DataFile"), probe, &[".vtk"]),
    }
}

/// An array found: its name, type, components and place in the file.
struct Array {
    name: String,
    type_name: String,
    kind: Kind,
    components: u64,
    start: u64,
}

struct Scan<'a> {
    path: &'a Path,
    lines: Lines,
    size: u64,
    ascii: bool,
    dims: Option<[usize; 3]>,
    spacing: [f64; 3],
    origin: [f64; 3],
    wanted: Option<&'a str>,
    passed: Vec<String>,
}

fn open(storage: &Storage, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let mut lines = storage.lines(path)?;
    let magic = lines.line()?.unwrap_or_default();
    let version = magic.strip_prefix("# vtk DataFile Version ").and_then(|v| v.trim().split('.').next()?.parse().ok());
    if !matches!(version, Some(1u32..=5)) {
        let found = format!("{:?}", magic.chars().take(40).collect::<String>());
        return Err(LoadError::invalid(path, "first line", found, "# vtk DataFile Version 1.0 to 5.x"));
    }
    lines.line()?;
    let coding = next_line(&mut lines)?.unwrap_or_default();
    let ascii = match coding.trim().to_uppercase().as_str() {
        "ASCII" => true,
        "BINARY" => false,
        _ => return Err(LoadError::invalid(path, "coding", format!("{coding:?}"), "ASCII or BINARY")),
    };
    let mut scan = Scan {
        path,
        lines,
        size: storage.length(path)?,
        ascii,
        dims: None,
        spacing: [1.0; 3],
        origin: [0.0; 3],
        wanted: text(options, "array"),
        passed: Vec::new(),
    };
    let array = scan.find()?;
    let dims = scan.dims.ok_or_else(|| LoadError::invalid(path, "DIMENSIONS", "missing", "three sizes"))?;
    let Some(NumberType::Scalar(scalar)) = array.kind.number else {
        let what = format!("data type {:?}", array.type_name);
        let cure = "convert it to 32-bit integers or to double".into();
        return Err(LoadError::Unsupported { path: path.into(), what, cure });
    };
    let components = array.components as usize;
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, scalar, components) };
    let origin = DVec3::from_array(scan.origin);
    world::place_spaced(path, "grid", &mut desc, world::AXES, scan.spacing, origin)?;
    crate::payload::validate(path, &desc)?;
    let length = desc.bytes().map_or(u64::MAX, |n| n as u64);
    let encoded = scan.size.saturating_sub(array.start);
    let part = Part { path: path.into(), start: array.start, encoded, skip: 0, length };
    let encoding = if ascii { Encoding::Ascii(scalar) } else { Encoding::Raw };
    let storage = storage.clone();
    let payload =
        Payload { storage, parts: vec![part], encoding, order: ByteOrder::Big, open_ended: true, significant: None };
    GridReader::open(path, desc, payload, Vec::new())
}

/// The next line that is not blank.
fn next_line(lines: &mut Lines) -> Result<Option<String>, LoadError> {
    while let Some(line) = lines.line()? {
        if !line.trim().is_empty() {
            return Ok(Some(line));
        }
    }
    Ok(None)
}

impl Scan<'_> {
    /// Reads on until the wanted array begins.
    fn find(&mut self) -> Result<Array, LoadError> {
        let path = self.path;
        let mut points = None;
        while let Some(line) = next_line(&mut self.lines)? {
            let words: Vec<&str> = line.split_whitespace().collect();
            let rest = line.trim_start()[words[0].len()..].trim();
            match words[0].to_uppercase().as_str() {
                "DATASET" if rest.eq_ignore_ascii_case("STRUCTURED_POINTS") => {}
                "DATASET" => {
                    let cure = "only STRUCTURED_POINTS are volumes; meshes are read by the loader vtk-mesh".into();
                    return Err(LoadError::Unsupported { path: path.into(), what: format!("dataset {rest}"), cure });
                }
                "DIMENSIONS" => {
                    let sizes: [u64; 3] = fields::array(path, "DIMENSIONS", rest, "three sizes")?;
                    self.dims = Some(fields::dimensions(path, "DIMENSIONS", &sizes)?);
                }
                word @ ("SPACING" | "ASPECT_RATIO") => {
                    self.spacing = fields::array(path, word, rest, "three numbers")?;
                }
                "ORIGIN" => self.origin = fields::array(path, "ORIGIN", rest, "three numbers")?,
                "POINT_DATA" => points = Some(self.point_count(rest)?),
                "CELL_DATA" => {
                    let cure = "convert it to point data".into();
                    return Err(LoadError::Unsupported { path: path.into(), what: "cell data".into(), cure });
                }
                "METADATA" => self.pass_metadata()?,
                "FIELD" => {
                    if let Some(array) = self.field(&words, points)? {
                        return Ok(array);
                    }
                }
                word => {
                    if let Some(array) = self.attribute(word, &words, points)? {
                        return Ok(array);
                    }
                }
            }
        }
        let found = if self.passed.is_empty() { "missing".into() } else { format!("among {:?}", self.passed) };
        let wanted = self.wanted.map_or("point data".into(), |name| format!("an array called {name:?}"));
        Err(LoadError::invalid(path, "array", found, wanted))
    }

    fn point_count(&self, text: &str) -> Result<u64, LoadError> {
        let path = self.path;
        let count: u64 = fields::value(path, "POINT_DATA", text, "a whole number")?;
        let dims = self.dims.ok_or_else(|| LoadError::invalid(path, "DIMENSIONS", "missing", "three sizes"))?;
        let wanted = dims.iter().map(|n| *n as u64).product::<u64>();
        if count != wanted {
            let wanted = format!("{wanted}, the product of DIMENSIONS");
            return Err(LoadError::invalid(path, "POINT_DATA", count, wanted));
        }
        Ok(count)
    }

    /// An attribute other than a field; `None` if it is not the one wanted.
    fn attribute(&mut self, word: &str, words: &[&str], points: Option<u64>) -> Result<Option<Array>, LoadError> {
        let path = self.path;
        let arg = |n: usize| {
            words.get(n).copied().ok_or_else(|| LoadError::invalid(path, word, format!("{words:?}"), "more words"))
        };
        let number = |n: usize| fields::value::<u64>(path, word, arg(n)?, "a whole number");
        let (type_name, components) = match word {
            "SCALARS" => (arg(2)?, if words.len() > 3 { number(3)? } else { 1 }),
            "COLOR_SCALARS" => (if self.ascii { "float" } else { "unsigned_char" }, number(2)?),
            "VECTORS" | "NORMALS" => (arg(2)?, 3),
            "TEXTURE_COORDINATES" => (arg(3)?, number(2)?),
            "TENSORS" => (arg(2)?, 9),
            "LOOKUP_TABLE" => {
                let entries = number(2)?;
                let size = Kind { number: None, bits: 8 };
                return self.pass(size, entries.saturating_mul(4)).map(|()| None);
            }
            _ => {
                let found = format!("{:?}", words[0].chars().take(40).collect::<String>());
                return Err(LoadError::invalid(path, "keyword", found, "a keyword of structured points"));
            }
        };
        let Some(points) = points else {
            return Err(LoadError::invalid(path, "POINT_DATA", format!("missing before {word}"), "one"));
        };
        let (name, type_name) = (unescape(arg(1)?), type_name.to_owned());
        let kind = kind(path, &type_name)?;
        if word == "SCALARS" {
            let line = next_line(&mut self.lines)?.unwrap_or_default();
            if !line.trim_start().to_uppercase().starts_with("LOOKUP_TABLE") {
                let found: String = line.chars().take(12).collect();
                return Err(LoadError::invalid(path, "line after SCALARS", format!("{found:?}"), "LOOKUP_TABLE"));
            }
        }
        self.take(Array { name, type_name, kind, components, start: self.lines.offset() }, points)
    }

    /// The arrays of a field; `None` if none of them is wanted.
    fn field(&mut self, words: &[&str], points: Option<u64>) -> Result<Option<Array>, LoadError> {
        let path = self.path;
        let count: u64 = fields::value(path, "FIELD", words.get(2).unwrap_or(&""), "a number of arrays")?;
        for _ in 0..count {
            let mut line = next_line(&mut self.lines)?.unwrap_or_default();
            if line.trim() == "METADATA" {
                self.pass_metadata()?;
                line = next_line(&mut self.lines)?.unwrap_or_default();
            }
            let words: Vec<_> = line.split_whitespace().collect();
            let &[name, components, tuples, type_name] = &words[..] else {
                let found: String = line.chars().take(40).collect();
                let wanted = "name, components, tuples and type";
                return Err(LoadError::invalid(path, "field array", format!("{found:?}"), wanted));
            };
            let components: u64 = fields::value(path, "field array", components, "a number of components")?;
            let tuples: u64 = fields::value(path, "field array", tuples, "a number of tuples")?;
            let kind = kind(path, type_name)?;
            let (name, type_name) = (unescape(name), type_name.to_owned());
            let array = Array { name, type_name, kind, components, start: self.lines.offset() };
            if let Some(points) = points {
                if tuples != points {
                    let what = format!("tuples of {:?}", array.name);
                    return Err(LoadError::invalid(path, what, tuples, format!("{points}, one for each point")));
                }
                if let Some(found) = self.take(array, tuples)? {
                    return Ok(Some(found));
                }
            } else {
                self.pass(kind, components.saturating_mul(tuples))?;
            }
        }
        Ok(None)
    }

    /// Gives the array back if it is wanted, else passes its data.
    fn take(&mut self, array: Array, tuples: u64) -> Result<Option<Array>, LoadError> {
        if self.wanted.is_none_or(|name| name == array.name) {
            return Ok(Some(array));
        }
        self.pass(array.kind, array.components.saturating_mul(tuples))?;
        self.passed.push(array.name);
        Ok(None)
    }

    fn pass(&mut self, kind: Kind, numbers: u64) -> Result<(), LoadError> {
        let start = self.lines.offset();
        let truncated = |found, wanted| {
            Err(LoadError::Truncated { path: self.path.into(), what: "an array passed over".into(), found, wanted })
        };
        if self.ascii {
            for n in 0..numbers {
                if self.lines.word()?.is_none() {
                    return truncated(n, numbers);
                }
            }
            return Ok(());
        }
        let bytes = numbers.saturating_mul(kind.bits).div_ceil(8);
        if bytes > self.size.saturating_sub(start) {
            return truncated(self.size.saturating_sub(start), bytes);
        }
        self.lines.seek(start + bytes)
    }

    /// Metadata go to the next blank line.
    fn pass_metadata(&mut self) -> Result<(), LoadError> {
        while self.lines.line()?.is_some_and(|line| !line.trim().is_empty()) {}
        Ok(())
    }
}
