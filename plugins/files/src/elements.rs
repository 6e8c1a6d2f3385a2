//! The data elements of a DICOM file, as far as a volume needs them.
//!
//! This walk is our own because it has to be bounded: it reads headers up to the pixel data only,
//! keeps nothing but the elements asked for, takes no memory on a length's word and does not
//! recurse into nested sequences. The DICOM crates at hand allocate what a length field says and
//! recurse.

use std::{
    collections::BTreeMap,
    io::{BufReader, ErrorKind, Read},
    path::{Path, PathBuf},
};

use volact_core::LoadError;

use crate::storage::{Input, Storage};

/// The longest value kept.
const VALUE_LIMIT: u64 = 1 << 16;
/// Nested deeper than any real file.
const DEPTH_LIMIT: usize = 256;
const UNDEFINED: u32 = u32::MAX;

const ITEM: u32 = 0xfffe_e000;
const ITEM_END: u32 = 0xfffe_e00d;
const SEQUENCE_END: u32 = 0xfffe_e0dd;
const TRANSFER_SYNTAX: u32 = 0x0002_0010;
/// Pixel data.
pub(crate) const PIXELS: u32 = 0x7fe0_0010;

/// What was found in a file.
#[derive(Debug)]
pub(crate) struct Elements {
    path: PathBuf,
    values: BTreeMap<u32, Vec<u8>>,
    /// Whether numbers are big-endian.
    pub(crate) big: bool,
    /// The transfer syntax's UID.
    pub(crate) syntax: String,
    /// Place and length of the pixel data, if there are any; no length if they are encapsulated.
    pub(crate) pixels: Option<(u64, Option<u64>)>,
}

impl Elements {
    /// A text value, white space and padding cut off.
    pub(crate) fn text(&self, tag: u32) -> Option<String> {
        let bytes = self.values.get(&tag)?;
        let text = String::from_utf8_lossy(bytes);
        let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
        (!text.is_empty()).then(|| text.to_owned())
    }

    /// Decimal numbers as text, separated by backslashes.
    pub(crate) fn decimals<const N: usize>(&self, tag: u32, name: &str) -> Result<Option<[f64; N]>, LoadError> {
        let Some(text) = self.text(tag) else { return Ok(None) };
        let numbers: Option<Vec<f64>> =
            text.split('\\').map(|word| word.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
        match numbers.and_then(|list| list.try_into().ok()) {
            Some(array) => Ok(Some(array)),
            None => Err(LoadError::invalid(&self.path, name, format!("{text:?}"), format!("{N} numbers"))),
        }
    }

    /// A 16-bit number.
    pub(crate) fn short(&self, tag: u32) -> Option<u16> {
        let raw: [u8; 2] = self.values.get(&tag)?.get(..2)?.try_into().ok()?;
        Some(if self.big { u16::from_be_bytes(raw) } else { u16::from_le_bytes(raw) })
    }

    /// A 16-bit number that must be there.
    pub(crate) fn need_short(&self, tag: u32, name: &str) -> Result<u16, LoadError> {
        self.short(tag).ok_or_else(|| LoadError::invalid(&self.path, name, "missing", "one"))
    }
}

/// Whether a file's head is that of DICOM.
pub(crate) fn is_dicom(head: &[u8]) -> bool {
    head.get(128..132) == Some(b"DICM")
}

struct Walk<'a> {
    path: &'a Path,
    input: BufReader<Box<dyn Input>>,
    position: u64,
    size: u64,
    implicit: bool,
    big: bool,
}

struct Element {
    tag: u32,
    length: u32,
    /// A sequence whose content is implicit, whatever the file is.
    unknown: bool,
}

/// Reads the wanted elements of a file that [`is_dicom`].
pub(crate) fn read(storage: &Storage, path: &Path, wanted: &[u32]) -> Result<Elements, LoadError> {
    let input = BufReader::new(storage.open(path)?);
    let mut walk = Walk { path, input, position: 0, size: storage.length(path)?, implicit: false, big: false };
    walk.skip(132)?;
    let mut elements =
        Elements { path: path.into(), values: BTreeMap::new(), big: false, syntax: String::new(), pixels: None };
    let mut meta = true;
    while walk.position < walk.size {
        if meta && walk.peek_group()? != 2 {
            meta = false;
            start_data(path, &mut walk, &mut elements)?;
            continue;
        }
        let element = walk.element()?;
        if element.tag == PIXELS {
            let length = (element.length != UNDEFINED).then_some(u64::from(element.length));
            elements.pixels = Some((walk.position, length));
            break;
        }
        if element.length == UNDEFINED {
            walk.pass_sequence(element.unknown)?;
        } else if wanted.contains(&element.tag) || (meta && element.tag == TRANSFER_SYNTAX) {
            let value = walk.value(element.length)?;
            elements.values.insert(element.tag, value);
        } else {
            walk.skip(u64::from(element.length))?;
        }
    }
    Ok(elements)
}

/// After the file's meta group, the transfer syntax rules.
fn start_data(path: &Path, walk: &mut Walk<'_>, elements: &mut Elements) -> Result<(), LoadError> {
    elements.syntax = elements.text(TRANSFER_SYNTAX).unwrap_or_default();
    match elements.syntax.as_str() {
        "1.2.840.10008.1.2" => walk.implicit = true,
        "1.2.840.10008.1.2.2" => walk.big = true,
        "" => return Err(LoadError::invalid(path, "transfer syntax", "missing", "one")),
        "1.2.840.10008.1.2.1.99" => {
            let cure = "save it uncompressed (explicit VR little endian)".into();
            return Err(LoadError::Unsupported { path: path.into(), what: "a deflated data set".into(), cure });
        }
        // All others are explicit and little-endian up to their pixels.
        _ => {}
    }
    elements.big = walk.big;
    Ok(())
}

impl Walk<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], LoadError> {
        let mut raw = [0; N];
        match self.input.read_exact(&mut raw) {
            Ok(()) => {
                self.position += N as u64;
                Ok(raw)
            }
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => Err(self.truncated(N as u64)),
            Err(e) => Err(LoadError::io(self.path, e)),
        }
    }

    fn truncated(&self, more: u64) -> LoadError {
        let wanted = self.position.saturating_add(more);
        LoadError::Truncated { path: self.path.into(), what: "DICOM elements".into(), found: self.size, wanted }
    }

    fn skip(&mut self, bytes: u64) -> Result<(), LoadError> {
        if bytes > self.size.saturating_sub(self.position) {
            return Err(self.truncated(bytes));
        }
        self.input.seek_relative(bytes as i64).map_err(|e| LoadError::io(self.path, e))?;
        self.position += bytes;
        Ok(())
    }

    fn value(&mut self, length: u32) -> Result<Vec<u8>, LoadError> {
        let length = u64::from(length);
        if length > self.size.saturating_sub(self.position) {
            return Err(self.truncated(length));
        }
        let mut bytes = Vec::new();
        let kept = length.min(VALUE_LIMIT);
        (&mut self.input).take(kept).read_to_end(&mut bytes).map_err(|e| LoadError::io(self.path, e))?;
        self.position += kept;
        self.skip(length - kept)?;
        Ok(bytes)
    }

    fn u16(&mut self) -> Result<u16, LoadError> {
        let raw = self.take()?;
        Ok(if self.big { u16::from_be_bytes(raw) } else { u16::from_le_bytes(raw) })
    }

    fn u32(&mut self) -> Result<u32, LoadError> {
        let raw = self.take()?;
        Ok(if self.big { u32::from_be_bytes(raw) } else { u32::from_le_bytes(raw) })
    }

    fn peek_group(&mut self) -> Result<u16, LoadError> {
        let group = self.u16()?;
        self.input.seek_relative(-2).map_err(|e| LoadError::io(self.path, e))?;
        self.position -= 2;
        Ok(group)
    }

    fn element(&mut self) -> Result<Element, LoadError> {
        let tag = u32::from(self.u16()?) << 16 | u32::from(self.u16()?);
        if self.implicit || matches!(tag, ITEM | ITEM_END | SEQUENCE_END) {
            return Ok(Element { tag, length: self.u32()?, unknown: false });
        }
        let kind: [u8; 2] = self.take()?;
        let length = match &kind {
            b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"SV" | b"UC" | b"UN" | b"UR" | b"UT" | b"UV" => {
                self.skip(2)?;
                self.u32()?
            }
            _ if kind.iter().all(u8::is_ascii_uppercase) => u32::from(self.u16()?),
            _ => {
                let what = format!("value representation of element ({:04x},{:04x})", tag >> 16, tag & 0xffff);
                let found = format!("\"{}\"", kind.escape_ascii());
                return Err(LoadError::invalid(self.path, what, found, "two capital letters"));
            }
        };
        Ok(Element { tag, length, unknown: &kind == b"UN" })
    }

    /// Passes a sequence of undefined length with everything nested in it.
    fn pass_sequence(&mut self, implicit: bool) -> Result<(), LoadError> {
        let before = self.implicit;
        self.implicit |= implicit;
        // True: in a sequence, before an item. False: in an item, before an element.
        let mut nested = vec![true];
        while let Some(&in_sequence) = nested.last() {
            if nested.len() > DEPTH_LIMIT {
                let wanted = format!("at most {DEPTH_LIMIT} deep");
                return Err(LoadError::invalid(self.path, "sequences", "nested deeper", wanted));
            }
            let element = self.element()?;
            match (in_sequence, element.tag) {
                (true, SEQUENCE_END) | (false, ITEM_END) => _ = nested.pop(),
                (true, ITEM) if element.length == UNDEFINED => nested.push(false),
                (false, _) if element.length == UNDEFINED => nested.push(true),
                (true, ITEM) | (false, _) => self.skip(u64::from(element.length))?,
                (true, tag) => {
                    let found = format!("({:04x},{:04x})", tag >> 16, tag & 0xffff);
                    return Err(LoadError::invalid(self.path, "sequence", found, "an item or its end"));
                }
            }
        }
        self.implicit = before;
        Ok(())
    }
}
