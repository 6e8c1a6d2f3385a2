//! VTK XML image data.
//!
//! # Reads
//! `.vti` with one piece: inline ASCII and base64, appended raw and base64; uncompressed and zlib;
//! `header_type` UInt32 and UInt64; either byte order; `Origin`, `Spacing` and `Direction`. Of
//! compressed arrays only the blocks that a region needs are decoded.
//!
//! # Options
//! `array`: the name of the point array to read; the active scalars by default, else the first.
//!
//! # Limits
//! 64-bit integers, cell data, several pieces, and lz4 and lzma compression are refused.

use std::{
    io::BufReader,
    path::{Path, PathBuf},
};

use base64::{Engine, engine::general_purpose::STANDARD};
use quick_xml::{
    Reader,
    events::{BytesStart, Event},
};
use volact_core::{
    Buffer, LoadError, LoadOptions, Progress, Region, ScalarType, VolumeDesc, VolumeReader, Warning,
    glam::{DMat3, DVec3},
    loader::{Confidence, Probe},
};

use crate::{
    fields,
    format::{Format, confidence, name_of, text},
    payload::{
        ByteOrder, Encoding, GridReader, Part, Payload, check_region, decoder, reserve, runs, swap_bytes, validate,
    },
    storage::{Input, Storage},
    vtk::array_option,
    world,
};

/// The loader.
pub(crate) fn format() -> Format {
    Format::new("vti", "VTK XML image data (.vti)", probe, open).with(array_option())
}

fn probe(probe: &Probe<'_>) -> Confidence {
    let has = |word: &[u8]| probe.head.windows(word.len()).any(|w| w == word);
    confidence(has(b"<VTKFile") && has(b"ImageData"), probe, &[".vti"])
}

/// An array as the XML describes it.
#[derive(Debug)]
struct Array {
    name: String,
    type_name: String,
    components: String,
    format: String,
    offset: Option<String>,
    /// Where the inline text lies in the file.
    inline: (u64, u64),
}

#[derive(Debug, Default)]
struct Image {
    big: bool,
    wide: bool,
    compressor: Option<String>,
    whole: Option<[i64; 6]>,
    piece: Option<[i64; 6]>,
    origin: [f64; 3],
    spacing: Option<[f64; 3]>,
    direction: Option<[f64; 9]>,
    active: Option<String>,
    arrays: Vec<Array>,
    has_cells: bool,
    /// Whether appended data are base64, and where they begin.
    appended: Option<(bool, u64)>,
}

fn attribute(element: &BytesStart<'_>, name: &str) -> Option<String> {
    let mut attributes = element.attributes();
    let found = attributes.with_checks(false).flatten().find(|a| a.key.as_ref() == name)?;
    let raw = found.value.into_owned();
    Some(quick_xml::escape::unescape(&raw).map(|v| v.into_owned()).unwrap_or(raw))
}

fn parse(storage: &Storage, path: &Path) -> Result<Image, LoadError> {
    let mut xml = Reader::from_reader(BufReader::new(storage.open(path)?));
    let mut image = Image::default();
    let mut buffer = Vec::new();
    // What encloses the reader's place: point data, cell data, an array of point data.
    let (mut in_points, mut in_cells, mut in_array) = (false, false, false);
    let mut is_vtk = false;
    loop {
        buffer.clear();
        let event = xml
            .read_event_into(&mut buffer)
            .map_err(|e| LoadError::Decode { path: path.into(), source: e.to_string().into() })?;
        let empty = matches!(event, Event::Empty(_));
        match event {
            Event::Start(e) | Event::Empty(e) => match e.name().as_ref() {
                "VTKFile" => {
                    is_vtk = true;
                    file_element(path, &e, &mut image)?;
                }
                "ImageData" => image_element(path, &e, &mut image)?,
                "Piece" => {
                    let extent = attribute(&e, "Extent").unwrap_or_default();
                    let extent = fields::array(path, "Piece Extent", &extent, "six whole numbers")?;
                    if image.piece.replace(extent).is_some() {
                        let what = "an image of several pieces".into();
                        let cure = "save it as one piece".into();
                        return Err(LoadError::Unsupported { path: path.into(), what, cure });
                    }
                }
                "PointData" => {
                    in_points = !empty;
                    image.active = attribute(&e, "Scalars");
                }
                "CellData" => in_cells = !empty,
                "DataArray" if in_cells => image.has_cells = true,
                "DataArray" if in_points => {
                    let after = xml.buffer_position();
                    let get = |name, default: &str| attribute(&e, name).unwrap_or_else(|| default.into());
                    image.arrays.push(Array {
                        name: get("Name", ""),
                        type_name: get("type", ""),
                        components: get("NumberOfComponents", "1"),
                        format: get("format", "ascii"),
                        offset: attribute(&e, "offset"),
                        inline: (after, after),
                    });
                    in_array = !empty;
                }
                "AppendedData" => {
                    let encoding = attribute(&e, "encoding").unwrap_or_else(|| "base64".into());
                    let base64 = match encoding.as_str() {
                        "base64" => true,
                        "raw" => false,
                        _ => {
                            let found = format!("{encoding:?}");
                            return Err(LoadError::invalid(path, "AppendedData encoding", found, "raw or base64"));
                        }
                    };
                    image.appended = Some((base64, appended_start(storage, path, xml.buffer_position())?));
                    break;
                }
                _ => {}
            },
            Event::Text(_) if in_array => {
                if let Some(array) = image.arrays.last_mut() {
                    array.inline.1 = xml.buffer_position();
                }
            }
            Event::End(e) => match e.name().as_ref() {
                "PointData" => in_points = false,
                "CellData" => in_cells = false,
                "DataArray" => in_array = false,
                _ => {}
            },
            Event::Eof => break,
            _ => {}
        }
    }
    if !is_vtk {
        return Err(LoadError::invalid(path, "element VTKFile", "missing", "one"));
    }
    Ok(image)
}

fn file_element(path: &Path, e: &BytesStart<'_>, image: &mut Image) -> Result<(), LoadError> {
    let kind = attribute(e, "type").unwrap_or_default();
    if kind != "ImageData" {
        let cure = "only ImageData are volumes".into();
        return Err(LoadError::Unsupported { path: path.into(), what: format!("VTK file type {kind:?}"), cure });
    }
    let one_of = |name: &str, words: [&str; 2], default: &str| {
        let word = attribute(e, name).unwrap_or_else(|| default.into());
        match words.iter().position(|w| *w == word) {
            Some(at) => Ok(at == 1),
            None => Err(LoadError::invalid(path, name, format!("{word:?}"), words.join(" or "))),
        }
    };
    image.big = one_of("byte_order", ["LittleEndian", "BigEndian"], "LittleEndian")?;
    image.wide = one_of("header_type", ["UInt32", "UInt64"], "UInt32")?;
    image.compressor = attribute(e, "compressor").filter(|c| !c.is_empty());
    Ok(())
}

fn image_element(path: &Path, e: &BytesStart<'_>, image: &mut Image) -> Result<(), LoadError> {
    let extent = attribute(e, "WholeExtent").unwrap_or_default();
    image.whole = Some(fields::array(path, "WholeExtent", &extent, "six whole numbers")?);
    if let Some(text) = attribute(e, "Origin") {
        image.origin = fields::array(path, "Origin", &text, "three numbers")?;
    }
    if let Some(text) = attribute(e, "Spacing") {
        image.spacing = Some(fields::array(path, "Spacing", &text, "three numbers")?);
    }
    if let Some(text) = attribute(e, "Direction") {
        image.direction = Some(fields::array(path, "Direction", &text, "nine numbers")?);
    }
    Ok(())
}

/// Appended data begin after an underscore, which only white space may precede.
fn appended_start(storage: &Storage, path: &Path, from: u64) -> Result<u64, LoadError> {
    let length = storage.length(path)?.saturating_sub(from).min(4096);
    let bytes = storage.range(path, from, length)?;
    match bytes.iter().position(|b| !b.is_ascii_whitespace()) {
        Some(at) if bytes[at] == b'_' => Ok(from + at as u64 + 1),
        _ => Err(LoadError::invalid(path, "AppendedData", "without an underscore", "_ before the data")),
    }
}

fn scalar_type(path: &Path, text: &str) -> Result<ScalarType, LoadError> {
    Ok(match text {
        "Int8" => ScalarType::I8,
        "UInt8" => ScalarType::U8,
        "Int16" => ScalarType::I16,
        "UInt16" => ScalarType::U16,
        "Int32" => ScalarType::I32,
        "UInt32" => ScalarType::U32,
        "Float32" => ScalarType::F32,
        "Float64" => ScalarType::F64,
        "Int64" | "UInt64" | "String" | "Bit" => {
            let cure = "convert it to 32-bit integers or to Float64".into();
            return Err(LoadError::Unsupported { path: path.into(), what: format!("array type {text:?}"), cure });
        }
        _ => {
            return Err(LoadError::invalid(path, "array type", format!("{text:?}"), "a type of VTK, e.g. Float32"));
        }
    })
}

fn open(storage: &Storage, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let image = parse(storage, path)?;
    let array = choose(path, &image, text(options, "array"))?;
    let desc = describe(path, &image, array)?;
    match image.compressor.as_deref() {
        None | Some("vtkZLibDataCompressor") => {}
        Some(other) => {
            let cure = "save it with zlib or uncompressed".into();
            return Err(LoadError::Unsupported { path: path.into(), what: format!("compressor {other:?}"), cure });
        }
    }
    let wanted = desc.bytes().map_or(u64::MAX, |n| n as u64);
    let order = ByteOrder::big_if(image.big);
    let grid = |start: u64, encoded: u64, encoding| {
        let part = Part { path: path.into(), start, encoded, skip: 0, length: wanted };
        let payload = Payload {
            storage: storage.clone(),
            parts: vec![part],
            encoding,
            order,
            open_ended: true,
            significant: None,
        };
        GridReader::open(path, desc.clone(), payload, Vec::new())
    };
    let (start, end) = array.inline;
    let source = match (array.format.as_str(), image.appended) {
        ("ascii", _) => return grid(start, end - start, Encoding::Ascii(desc.scalar)),
        ("binary", _) => Source { base64: true, start, end },
        ("appended", Some((base64, first))) => {
            let offset: u64 = fields::value(path, "offset", array.offset.as_deref().unwrap_or(""), "a whole number")?;
            Source { base64, start: first.saturating_add(offset), end: storage.length(path)? }
        }
        ("appended", None) => return Err(LoadError::invalid(path, "element AppendedData", "missing", "one")),
        (other, _) => {
            let wanted = "ascii, binary or appended";
            return Err(LoadError::invalid(path, "array format", format!("{other:?}"), wanted));
        }
    };
    let counter = Counter { wide: image.wide, big: image.big };
    if image.compressor.is_some() {
        return open_blocks(storage, path, desc, &source, counter, order);
    }
    let head = source.bytes(storage, path, Some(counter.size()))?;
    let stated = counter.get(path, &head, 0)?;
    if stated != wanted {
        let what = format!("array {:?}", array.name);
        return Err(LoadError::invalid(path, what, format!("{stated} bytes"), format!("{wanted} bytes")));
    }
    if !source.base64 {
        let start = source.start + counter.size();
        return grid(start, source.end.saturating_sub(start), Encoding::Raw);
    }
    let blob = Blob::Text { source, decoded: None };
    let blocks = Blocks { first: counter.size(), stored: Vec::new(), full: wanted, total: wanted };
    open_reader(storage, path, desc, blob, blocks, order)
}

fn choose<'a>(path: &Path, image: &'a Image, wanted: Option<&str>) -> Result<&'a Array, LoadError> {
    let by_name = |name: &str| image.arrays.iter().find(|a| a.name == name);
    let names = || image.arrays.iter().map(|a| a.name.as_str()).collect::<Vec<_>>();
    if let Some(name) = wanted {
        let missing =
            || LoadError::invalid(path, "array", format!("among {:?}", names()), format!("one called {name:?}"));
        return by_name(name).ok_or_else(missing);
    }
    let active = image.active.as_deref().and_then(by_name);
    match active.or(image.arrays.first()) {
        Some(array) => Ok(array),
        None if image.has_cells => {
            let cure = "convert it to point data".into();
            Err(LoadError::Unsupported { path: path.into(), what: "cell data".into(), cure })
        }
        None => Err(LoadError::invalid(path, "array", "missing", "point data")),
    }
}

fn describe(path: &Path, image: &Image, array: &Array) -> Result<VolumeDesc, LoadError> {
    let whole = image.whole.ok_or_else(|| LoadError::invalid(path, "element ImageData", "missing", "one"))?;
    let piece = image.piece.ok_or_else(|| LoadError::invalid(path, "element Piece", "missing", "one"))?;
    if whole != piece {
        let wanted = format!("the whole, {whole:?}");
        return Err(LoadError::invalid(path, "Piece Extent", format!("{piece:?}"), wanted));
    }
    let mut sizes = [0; 3];
    for (a, size) in sizes.iter_mut().enumerate() {
        let length = whole[2 * a + 1].checked_sub(whole[2 * a]).and_then(|n| n.checked_add(1));
        *size = length.and_then(|n| u64::try_from(n).ok()).unwrap_or(0);
    }
    let dims = fields::dimensions(path, "WholeExtent", &sizes)?;
    let scalar = scalar_type(path, &array.type_name)?;
    let components = fields::value(path, "NumberOfComponents", &array.components, "1 to 4")?;
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, scalar, components) };
    let spacing = image.spacing.unwrap_or([1.0; 3]);
    // Written row by row.
    let matrix = image.direction.map_or(DMat3::IDENTITY, |d| DMat3::from_cols_array(&d).transpose());
    let directions = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let first = DVec3::new(whole[0] as f64, whole[2] as f64, whole[4] as f64);
    let origin = DVec3::from_array(image.origin) + matrix * (first * DVec3::from_array(spacing));
    world::place_spaced(path, "Direction", &mut desc, directions, spacing, origin)?;
    validate(path, &desc)?;
    Ok(desc)
}

/// The numbers before the data: UInt32 or UInt64.
#[derive(Clone, Copy)]
struct Counter {
    wide: bool,
    big: bool,
}

impl Counter {
    fn size(self) -> u64 {
        if self.wide { 8 } else { 4 }
    }

    fn get(self, path: &Path, bytes: &[u8], index: usize) -> Result<u64, LoadError> {
        let size = self.size() as usize;
        let Some(raw) = bytes.get(index * size..(index + 1) * size) else {
            let (what, found) = ("array header".into(), bytes.len() as u64);
            return Err(LoadError::Truncated { path: path.into(), what, found, wanted: ((index + 1) * size) as u64 });
        };
        let digits = |n: u64, b: &u8| n << 8 | u64::from(*b);
        Ok(if self.big { raw.iter().fold(0, digits) } else { raw.iter().rev().fold(0, digits) })
    }
}

/// Where an array's bytes lie in the file, as they are or as base64.
#[derive(Clone, Debug)]
struct Source {
    base64: bool,
    start: u64,
    end: u64,
}

impl Source {
    /// The first `limit` bytes, or all.
    fn bytes(&self, storage: &Storage, path: &Path, limit: Option<u64>) -> Result<Vec<u8>, LoadError> {
        let size = storage.length(path)?;
        let available = self.end.min(size).saturating_sub(self.start);
        if !self.base64 {
            return storage.range(path, self.start, limit.unwrap_or(u64::MAX).min(available));
        }
        // White space before and between the groups is not known: a prefix is read generously.
        let text = limit.map_or(available, |n| available.min(n.saturating_mul(2).saturating_add(4096)));
        let text = storage.range(path, self.start, text)?;
        let mut bytes = decode_base64(path, text, limit.is_some())?;
        if let Some(limit) = limit {
            bytes.truncate(limit as usize);
        }
        Ok(bytes)
    }
}

/// Decodes base64 that may consist of several padded streams, up to a `<`. Of a `prefix` the last,
/// incomplete group is left out.
fn decode_base64(path: &Path, mut text: Vec<u8>, prefix: bool) -> Result<Vec<u8>, LoadError> {
    if let Some(end) = text.iter().position(|b| *b == b'<') {
        text.truncate(end);
    }
    text.retain(|b| !b.is_ascii_whitespace());
    if prefix {
        text.truncate(text.len() / 4 * 4);
    }
    let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
    let mut rest = &text[..];
    while !rest.is_empty() {
        let end = rest.iter().position(|b| *b == b'=').map_or(rest.len(), |at| (at / 4 + 1) * 4).min(rest.len());
        let (stream, after) = rest.split_at(end);
        STANDARD
            .decode_vec(stream, &mut bytes)
            .map_err(|e| LoadError::Decode { path: path.into(), source: Box::new(e) })?;
        rest = after;
    }
    Ok(bytes)
}

/// The table before compressed data: number of blocks, bytes of each, bytes of the last if it is
/// shorter (else 0), and the compressed bytes of each.
fn open_blocks(
    storage: &Storage,
    path: &Path,
    desc: VolumeDesc,
    source: &Source,
    counter: Counter,
    order: ByteOrder,
) -> Result<Box<dyn VolumeReader>, LoadError> {
    let head = source.bytes(storage, path, Some(3 * counter.size()))?;
    let get = |n| counter.get(path, &head, n);
    let (count, full, last) = (get(0)?, get(1)?, get(2)?);
    let wanted = desc.bytes().map_or(u64::MAX, |n| n as u64);
    let stated = match count.checked_sub(1) {
        None => Some(0),
        Some(others) => others.checked_mul(full).and_then(|n| n.checked_add(if last == 0 { full } else { last })),
    };
    if stated != Some(wanted) || last > full {
        let found = format!("{count} of {full} bytes, the last of {last}");
        return Err(LoadError::invalid(path, "compressed blocks", found, format!("{wanted} bytes altogether")));
    }
    let table = count.saturating_add(3).saturating_mul(counter.size());
    let available = source.end.saturating_sub(source.start);
    if table > available {
        let what = "table of compressed blocks".into();
        return Err(LoadError::Truncated { path: path.into(), what, found: available, wanted: table });
    }
    let head = source.bytes(storage, path, Some(table))?;
    let mut at = table;
    let mut stored = Vec::with_capacity(count as usize);
    for n in 0..count as usize {
        let length = counter.get(path, &head, n + 3)?;
        stored.push((at, length));
        let own = if n as u64 == count - 1 { wanted - full * n as u64 } else { full };
        at = at.saturating_add(length);
        if own > Encoding::Zlib.most(length) || at > available {
            let what = format!("block {n}, from byte {}, of {own} decoded", at - length);
            return Err(LoadError::Truncated { path: path.into(), what, found: available, wanted: at });
        }
    }
    let blocks = Blocks { first: 0, stored, full, total: wanted };
    let blob = if source.base64 {
        Blob::Text { source: source.clone(), decoded: None }
    } else {
        Blob::File { start: source.start }
    };
    open_reader(storage, path, desc, blob, blocks, order)
}

fn open_reader(
    storage: &Storage,
    path: &Path,
    desc: VolumeDesc,
    blob: Blob,
    blocks: Blocks,
    order: ByteOrder,
) -> Result<Box<dyn VolumeReader>, LoadError> {
    Ok(Box::new(BlockReader { storage: storage.clone(), path: path.into(), desc, blob, blocks, order }))
}

/// The bytes that the table's offsets count in.
enum Blob {
    File { start: u64 },
    Text { source: Source, decoded: Option<Vec<u8>> },
}

struct Blocks {
    /// Where uncompressed data begin.
    first: u64,
    /// Place and length of each compressed block; empty if there is no compression.
    stored: Vec<(u64, u64)>,
    full: u64,
    total: u64,
}

struct BlockReader {
    storage: Storage,
    path: PathBuf,
    desc: VolumeDesc,
    blob: Blob,
    blocks: Blocks,
    order: ByteOrder,
}

impl BlockReader {
    fn stored(&mut self, start: u64, length: u64) -> Result<Vec<u8>, LoadError> {
        match &mut self.blob {
            Blob::File { start: first } => self.storage.range(&self.path, first.saturating_add(start), length),
            Blob::Text { source, decoded } => {
                let bytes = match decoded {
                    Some(bytes) => bytes,
                    None => decoded.insert(source.bytes(&self.storage, &self.path, None)?),
                };
                let end = start.saturating_add(length);
                match bytes.get(start as usize..end as usize) {
                    Some(part) => Ok(part.to_vec()),
                    None => {
                        let (path, what) = (self.path.clone(), "base64 data".into());
                        Err(LoadError::Truncated { path, what, found: bytes.len() as u64, wanted: end })
                    }
                }
            }
        }
    }

    /// The decoded bytes of block `n`.
    fn block(&mut self, n: u64) -> Result<Vec<u8>, LoadError> {
        let wanted = (self.blocks.total - n * self.blocks.full).min(self.blocks.full);
        let Some(&(start, length)) = self.blocks.stored.get(n as usize) else {
            return self.stored(self.blocks.first, self.blocks.total);
        };
        let stored = self.stored(start, length)?;
        let mut out = Vec::new();
        let input: Box<dyn Input> = Box::new(std::io::Cursor::new(stored));
        let mut limited = std::io::Read::take(decoder(Encoding::Zlib, BufReader::new(input)), wanted + 1);
        std::io::Read::read_to_end(&mut limited, &mut out)
            .map_err(|e| LoadError::Decode { path: self.path.clone(), source: Box::new(e) })?;
        if out.len() as u64 != wanted {
            let found = format!("{} bytes{}", out.len(), if out.len() as u64 > wanted { " or more" } else { "" });
            return Err(LoadError::invalid(&self.path, format!("block {n}"), found, format!("{wanted} bytes")));
        }
        Ok(out)
    }
}

impl VolumeReader for BlockReader {
    fn desc(&self) -> &VolumeDesc {
        &self.desc
    }

    fn warnings(&self) -> &[Warning] {
        &[]
    }

    fn read_region(&mut self, region: Region, progress: &dyn Progress) -> Result<Buffer, LoadError> {
        check_region(&self.path, self.desc.dims, region)?;
        let sample = self.desc.components * self.desc.scalar.size();
        let total = region.dims().iter().product::<usize>() * sample;
        let mut out = Vec::new();
        let mut current: Option<(u64, Vec<u8>)> = None;
        for (mut start, length) in runs(self.desc.dims, region, sample) {
            let end = start + length as u64;
            while start < end {
                let n = start / self.blocks.full;
                let block = match current.take() {
                    Some((at, block)) if at == n => block,
                    _ => self.block(n)?,
                };
                if out.is_empty() {
                    out = reserve(&self.path, total)?;
                }
                let from = start - n * self.blocks.full;
                let take = (block.len() as u64 - from).min(end - start);
                out.extend_from_slice(&block[from as usize..(from + take) as usize]);
                start += take;
                current = Some((n, block));
                if !progress.advance(out.len() as u64, total as u64) {
                    return Err(LoadError::Stopped { path: self.path.clone() });
                }
            }
        }
        if self.order != ByteOrder::NATIVE {
            swap_bytes(&mut out, self.desc.scalar.size());
        }
        Ok(out.into())
    }
}
