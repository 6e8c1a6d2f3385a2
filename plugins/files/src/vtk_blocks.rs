//! Where the numbers of an array of VTK's XML files lie, and their bytes.
//!
//! An array is text, bytes as they are, or blocks: base64, compressed, or both. A block is decoded
//! at a time, so that a region needs no more of them than it touches.

use std::{
    io::{BufReader, Cursor, Read},
    path::{Path, PathBuf},
};

use base64::{Engine, engine::general_purpose::STANDARD};
use volact_core::LoadError;

use crate::{
    decode::decoder,
    payload::Encoding,
    storage::{Input, Storage},
    vtk_xml::{Array, Document},
};

/// How blocks are compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Compressor {
    Zlib,
    Lz4,
}

impl Compressor {
    pub(crate) fn parse(path: &Path, name: &str) -> Result<Option<Self>, LoadError> {
        match name {
            "" => Ok(None),
            "vtkZLibDataCompressor" => Ok(Some(Self::Zlib)),
            "vtkLZ4DataCompressor" => Ok(Some(Self::Lz4)),
            other => {
                let cure = "save it with zlib, with LZ4 or uncompressed".into();
                Err(LoadError::Unsupported { path: path.into(), what: format!("compressor {other:?}"), cure })
            }
        }
    }

    /// The most bytes that `stored` bytes can become.
    fn most(self, stored: u64) -> u64 {
        match self {
            Self::Zlib => Encoding::Zlib.most(stored),
            // A byte more of a match's length stands for 255 bytes.
            Self::Lz4 => stored.saturating_mul(255).saturating_add(64),
        }
    }

    /// Decodes a block that should have `wanted` bytes. The result may be shorter, or one longer.
    fn decode(self, path: &Path, stored: Vec<u8>, wanted: u64) -> Result<Vec<u8>, LoadError> {
        let mut out = Vec::new();
        match self {
            Self::Zlib => {
                let input: Box<dyn Input> = Box::new(Cursor::new(stored));
                let mut limited = decoder(Encoding::Zlib, BufReader::new(input)).take(wanted + 1);
                limited.read_to_end(&mut out).map_err(|e| LoadError::decode(path, e))?;
            }
            Self::Lz4 => {
                out.resize(wanted as usize, 0);
                let length =
                    lz4_flex::block::decompress_into(&stored, &mut out).map_err(|e| LoadError::decode(path, e))?;
                out.truncate(length);
            }
        }
        Ok(out)
    }
}

/// Where an array's numbers are.
pub(crate) enum Place {
    /// As text, between two bytes of the file.
    Text {
        start: u64,
        end: u64,
    },
    /// As they are, from a byte of the file on.
    Raw {
        start: u64,
        available: u64,
    },
    Blocks(Blocks),
}

/// Finds an array's `wanted` bytes. They are compared with what the file says and could hold.
pub(crate) fn locate(storage: &Storage, document: &Document, array: &Array, wanted: u64) -> Result<Place, LoadError> {
    let path = document.path.as_path();
    let (start, end) = array.inline;
    let source = match (array.format.as_str(), document.appended) {
        ("ascii", _) => return Ok(Place::Text { start, end }),
        ("binary", _) => Source { base64: true, start, end },
        ("appended", Some((base64, first))) => {
            let offset: u64 =
                crate::fields::value(path, "offset", array.attributes.get("offset").unwrap_or(""), "a whole number")?;
            Source { base64, start: first.saturating_add(offset), end: storage.length(path)? }
        }
        ("appended", None) => return Err(LoadError::invalid(path, "element AppendedData", "missing", "one")),
        (other, _) => {
            let wanted = "ascii, binary or appended";
            return Err(LoadError::invalid(path, "array format", format!("{other:?}"), wanted));
        }
    };
    let counter = Counter { wide: document.wide, big: document.big };
    if let Some(compressor) = document.compressor {
        return compressed(storage, path, &source, counter, compressor, wanted).map(Place::Blocks);
    }
    let head = source.bytes(storage, path, Some(counter.size()))?;
    let stated = counter.get(path, &head, 0)?;
    if stated != wanted {
        let what = format!("array {:?}", array.name);
        return Err(LoadError::invalid(path, what, format!("{stated} bytes"), format!("{wanted} bytes")));
    }
    if !source.base64 {
        let start = source.start.saturating_add(counter.size());
        return Ok(Place::Raw { start, available: source.end.saturating_sub(start) });
    }
    let blob = Blob::Text { source, decoded: None, limit: counter.size().saturating_add(wanted) };
    let first = counter.size();
    let (storage, path) = (storage.clone(), path.into());
    Ok(Place::Blocks(Blocks {
        storage,
        path,
        blob,
        first,
        stored: Vec::new(),
        compressor: None,
        full: wanted,
        total: wanted,
    }))
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
        let whole = text == available;
        let mut bytes = decode_base64(path, storage.range(path, self.start, text)?, !whole || limit.is_some())?;
        let Some(limit) = limit else { return Ok(bytes) };
        if (bytes.len() as u64) < limit && !whole {
            bytes = decode_base64(path, storage.range(path, self.start, available)?, true)?;
        }
        bytes.truncate(limit as usize);
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
        STANDARD.decode_vec(stream, &mut bytes).map_err(|e| LoadError::decode(path, e))?;
        rest = after;
    }
    Ok(bytes)
}

/// The table before compressed data: number of blocks, bytes of each, bytes of the last if it is
/// shorter (else 0), and the compressed bytes of each.
fn compressed(
    storage: &Storage,
    path: &Path,
    source: &Source,
    counter: Counter,
    compressor: Compressor,
    wanted: u64,
) -> Result<Blocks, LoadError> {
    let head = source.bytes(storage, path, Some(3 * counter.size()))?;
    // An array of nothing may have no more than a number of blocks.
    if wanted == 0 && counter.get(path, &head, 0)? == 0 {
        let (storage, path, blob) = (storage.clone(), path.into(), Blob::File { start: source.start });
        return Ok(Blocks { storage, path, blob, first: 0, stored: Vec::new(), compressor: None, full: 0, total: 0 });
    }
    let get = |n| counter.get(path, &head, n);
    let (count, full, last) = (get(0)?, get(1)?, get(2)?);
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
        if own > compressor.most(length) || at > available {
            let what = format!("block {n}, from byte {}, of {own} decoded", at - length);
            return Err(LoadError::Truncated { path: path.into(), what, found: available, wanted: at });
        }
    }
    let blob = if source.base64 {
        Blob::Text { source: source.clone(), decoded: None, limit: at }
    } else {
        Blob::File { start: source.start }
    };
    let (storage, path, compressor) = (storage.clone(), path.into(), Some(compressor));
    Ok(Blocks { storage, path, blob, first: 0, stored, compressor, full, total: wanted })
}

/// The bytes that the table's offsets count in.
enum Blob {
    File { start: u64 },
    Text { source: Source, decoded: Option<Vec<u8>>, limit: u64 },
}

/// Data in blocks of equal length, the last of which may be shorter.
pub(crate) struct Blocks {
    storage: Storage,
    path: PathBuf,
    blob: Blob,
    /// Where uncompressed data begin.
    first: u64,
    /// Place and length of each compressed block; empty if there is no compression.
    stored: Vec<(u64, u64)>,
    compressor: Option<Compressor>,
    /// Bytes of a block.
    pub(crate) full: u64,
    /// Bytes altogether.
    pub(crate) total: u64,
}

impl Blocks {
    fn stored(&mut self, start: u64, length: u64) -> Result<Vec<u8>, LoadError> {
        match &mut self.blob {
            Blob::File { start: first } => self.storage.range(&self.path, first.saturating_add(start), length),
            Blob::Text { source, decoded, limit } => {
                let bytes = match decoded {
                    Some(bytes) => bytes,
                    None => decoded.insert(source.bytes(&self.storage, &self.path, Some(*limit))?),
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
    pub(crate) fn block(&mut self, n: u64) -> Result<Vec<u8>, LoadError> {
        let wanted = (self.total - n * self.full).min(self.full);
        let (Some(compressor), Some(&(start, length))) = (self.compressor, self.stored.get(n as usize)) else {
            return self.stored(self.first, self.total);
        };
        let stored = self.stored(start, length)?;
        let out = compressor.decode(&self.path, stored, wanted)?;
        if out.len() as u64 != wanted {
            let found = format!("{} bytes{}", out.len(), if out.len() as u64 > wanted { " or more" } else { "" });
            return Err(LoadError::invalid(&self.path, format!("block {n}"), found, format!("{wanted} bytes")));
        }
        Ok(out)
    }
}
