//! The structure of VTK's XML files: grids, pieces, sections and arrays, as the elements say.
//!
//! Elements are read one after another and appended data are not looked at, so that memory grows
//! with the elements only.

use std::{
    collections::BTreeMap,
    io::BufReader,
    path::{Path, PathBuf},
};

use quick_xml::{
    Reader,
    events::{BytesStart, Event},
};
use volact_core::{LoadError, ScalarType, loader::Probe};

use crate::{fields, numbers::NumberType, storage::Storage, vtk_blocks::Compressor};

/// The sections of a piece that hold arrays.
const SECTIONS: [&str; 9] =
    ["PointData", "CellData", "Points", "Cells", "Coordinates", "Verts", "Lines", "Strips", "Polys"];

/// A file's elements.
#[derive(Debug, Default)]
pub(crate) struct Document {
    pub(crate) path: PathBuf,
    pub(crate) big: bool,
    /// Whether the numbers before data are of 64 bits.
    pub(crate) wide: bool,
    pub(crate) compressor: Option<Compressor>,
    /// Attributes of the grid's element, named as the file's type; `None` if it is missing.
    pub(crate) grid: Option<Attributes>,
    pub(crate) pieces: Vec<Piece>,
    /// Whether appended data are base64, and where they begin.
    pub(crate) appended: Option<(bool, u64)>,
}

/// The attributes of an element.
#[derive(Clone, Debug, Default)]
pub(crate) struct Attributes(Vec<(String, String)>);

impl Attributes {
    fn new(element: &BytesStart<'_>) -> Self {
        let mut attributes = element.attributes();
        let text = |raw: String| quick_xml::escape::unescape(&raw).map(|v| v.into_owned()).unwrap_or(raw);
        let pairs = attributes.with_checks(false).flatten();
        Self(pairs.map(|a| (a.key.as_ref().to_owned(), text(a.value.into_owned()))).collect())
    }

    pub(crate) fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }
}

/// A part of a grid.
#[derive(Debug, Default)]
pub(crate) struct Piece {
    pub(crate) attributes: Attributes,
    sections: BTreeMap<String, Section>,
}

/// Arrays that belong together.
#[derive(Debug, Default)]
pub(crate) struct Section {
    pub(crate) attributes: Attributes,
    pub(crate) arrays: Vec<Array>,
}

/// An array as the XML describes it.
#[derive(Debug)]
pub(crate) struct Array {
    pub(crate) name: String,
    pub(crate) type_name: String,
    pub(crate) format: String,
    pub(crate) attributes: Attributes,
    /// Where the inline text lies in the file.
    pub(crate) inline: (u64, u64),
}

impl Piece {
    /// A section's arrays; none if it is missing.
    pub(crate) fn arrays(&self, section: &str) -> &[Array] {
        self.sections.get(section).map_or(&[], |s| &s.arrays)
    }

    /// The number of arrays in all sections.
    pub(crate) fn array_count(&self) -> usize {
        self.sections.values().map(|s| s.arrays.len()).sum()
    }

    pub(crate) fn section(&self, section: &str) -> Option<&Section> {
        self.sections.get(section)
    }

    /// The array of that name in a section.
    pub(crate) fn array(&self, path: &Path, section: &str, name: &str) -> Result<&Array, LoadError> {
        let found = self.arrays(section).iter().find(|a| a.name == name);
        found.ok_or_else(|| LoadError::invalid(path, format!("array {name:?} of {section}"), "missing", "one"))
    }

    /// A whole number among the piece's attributes.
    pub(crate) fn count(&self, path: &Path, name: &str) -> Result<u64, LoadError> {
        fields::value(path, name, self.attributes.get(name).unwrap_or(""), "a whole number")
    }
}

impl Array {
    /// The type of its numbers.
    pub(crate) fn number_type(&self, path: &Path) -> Result<NumberType, LoadError> {
        use NumberType::Scalar;
        Ok(match self.type_name.as_str() {
            "Int8" => Scalar(ScalarType::I8),
            "UInt8" => Scalar(ScalarType::U8),
            "Int16" => Scalar(ScalarType::I16),
            "UInt16" => Scalar(ScalarType::U16),
            "Int32" => Scalar(ScalarType::I32),
            "UInt32" => Scalar(ScalarType::U32),
            "Float32" => Scalar(ScalarType::F32),
            "Float64" => Scalar(ScalarType::F64),
            "Int64" => NumberType::I64,
            "UInt64" => NumberType::U64,
            other => {
                return Err(LoadError::invalid(
                    path,
                    "array type",
                    format!("{other:?}"),
                    "a type of VTK, e.g. Float32",
                ));
            }
        })
    }

    /// Numbers a tuple.
    pub(crate) fn components<T: std::str::FromStr>(&self, path: &Path, wanted: &str) -> Result<T, LoadError> {
        fields::value(path, "NumberOfComponents", self.attributes.get("NumberOfComponents").unwrap_or("1"), wanted)
    }
}

/// Whether a file's head says that it is VTK's XML of that type.
pub(crate) fn is_of_type(probe: &Probe<'_>, kind: &str) -> bool {
    let head = String::from_utf8_lossy(probe.head);
    let Some(at) = head.find("<VTKFile") else { return false };
    let element = head[at..].split('>').next().unwrap_or_default();
    [format!("type=\"{kind}\""), format!("type='{kind}'")].iter().any(|t| element.contains(t))
}

/// Reads the elements of a file that should be of type `kind`; `cure` says what to do if it is not.
pub(crate) fn parse(storage: &Storage, path: &Path, kind: &str, cure: &str) -> Result<Document, LoadError> {
    let mut xml = Reader::from_reader(BufReader::new(storage.open(path)?));
    let mut document = Document { path: path.into(), ..Document::default() };
    let mut state = State::default();
    let mut buffer = Vec::new();
    let (mut is_vtk, mut closed) = (false, false);
    loop {
        buffer.clear();
        let before = xml.buffer_position();
        let event = xml
            .read_event_into(&mut buffer)
            .map_err(|e| LoadError::Decode { path: path.into(), source: e.to_string().into() })?;
        match event {
            Event::Start(e) if e.name().as_ref() == "VTKFile" => {
                is_vtk = true;
                file_element(&mut document, &Attributes::new(&e), kind, cure)?;
            }
            Event::Start(e) | Event::Empty(e) if e.name().as_ref() == "AppendedData" => {
                let encoding = Attributes::new(&e);
                let base64 = match encoding.get("encoding").unwrap_or("base64") {
                    "base64" => true,
                    "raw" => false,
                    other => {
                        let found = format!("{other:?}");
                        return Err(LoadError::invalid(path, "AppendedData encoding", found, "raw or base64"));
                    }
                };
                document.appended = Some((base64, appended_start(storage, path, xml.buffer_position())?));
                closed = true;
                break;
            }
            Event::Start(e) => state.start(&mut document, kind, &e, xml.buffer_position(), false),
            Event::Empty(e) => state.start(&mut document, kind, &e, xml.buffer_position(), true),
            Event::Text(text) => state.text(&mut document, &text, (before, xml.buffer_position())),
            Event::End(e) => {
                closed |= e.name().as_ref() == "VTKFile";
                state.end(e.name().as_ref());
            }
            Event::Eof => break,
            _ => {}
        }
    }
    if !is_vtk {
        return Err(LoadError::invalid(path, "element VTKFile", "missing", "one"));
    }
    if !closed {
        return Err(LoadError::invalid(path, "end of the file", "inside its elements", "</VTKFile>"));
    }
    Ok(document)
}

fn file_element(document: &mut Document, attributes: &Attributes, kind: &str, cure: &str) -> Result<(), LoadError> {
    let path = document.path.clone();
    let found = attributes.get("type").unwrap_or_default();
    if found != kind {
        return Err(LoadError::Unsupported { path, what: format!("VTK file type {found:?}"), cure: cure.into() });
    }
    let one_of = |name: &str, words: [&str; 2], default: &str| {
        let word = attributes.get(name).unwrap_or(default);
        match words.iter().position(|w| *w == word) {
            Some(at) => Ok(at == 1),
            None => Err(LoadError::invalid(&path, name, format!("{word:?}"), words.join(" or "))),
        }
    };
    document.big = one_of("byte_order", ["LittleEndian", "BigEndian"], "LittleEndian")?;
    document.wide = one_of("header_type", ["UInt32", "UInt64"], "UInt32")?;
    document.compressor = Compressor::parse(&path, attributes.get("compressor").unwrap_or(""))?;
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

/// An extent, first and last index along each axis, and the numbers of samples that it makes.
pub(crate) fn extent(path: &Path, what: &str, text: Option<&str>) -> Result<([i64; 6], [usize; 3]), LoadError> {
    let extent: [i64; 6] = fields::array(path, what, text.unwrap_or(""), "six whole numbers")?;
    let mut sizes = [0; 3];
    for (a, size) in sizes.iter_mut().enumerate() {
        let length = extent[2 * a + 1].checked_sub(extent[2 * a]).and_then(|n| n.checked_add(1));
        *size = length.and_then(|n| u64::try_from(n).ok()).unwrap_or(0);
    }
    Ok((extent, fields::dimensions(path, what, &sizes)?))
}

/// What encloses the reader's place.
#[derive(Default)]
struct State {
    in_piece: bool,
    section: Option<String>,
    /// In an array of a section: how deep in its own elements.
    in_array: Option<usize>,
}

impl State {
    fn start(&mut self, document: &mut Document, kind: &str, e: &BytesStart<'_>, after: u64, empty: bool) {
        let name = e.name();
        let name = name.as_ref();
        if let Some(depth) = &mut self.in_array {
            *depth += usize::from(!empty);
            return;
        }
        if name == kind {
            document.grid = Some(Attributes::new(e));
        } else if name == "Piece" {
            document.pieces.push(Piece { attributes: Attributes::new(e), ..Piece::default() });
            self.in_piece = !empty;
        } else if self.in_piece && SECTIONS.contains(&name) {
            if let Some(piece) = document.pieces.last_mut() {
                piece.sections.entry(name.into()).or_default().attributes = Attributes::new(e);
            }
            self.section = (!empty).then(|| name.to_owned());
        } else if name == "DataArray" || name == "Array" {
            let section = self.section.as_ref().filter(|_| self.in_piece);
            let piece = document.pieces.last_mut();
            if let Some(section) = section.and_then(|s| piece.and_then(|p| p.sections.get_mut(s))) {
                let attributes = Attributes::new(e);
                let get = |name, default: &str| attributes.get(name).unwrap_or(default).to_owned();
                let unnamed = if self.section.as_deref() == Some("Points") { "Points" } else { "" };
                section.arrays.push(Array {
                    name: get("Name", unnamed),
                    type_name: get("type", ""),
                    format: get("format", "ascii"),
                    inline: (after, after),
                    attributes,
                });
                self.in_array = (!empty).then_some(0);
            }
        }
    }

    /// The first text of an array itself is its data.
    fn text(&mut self, document: &mut Document, text: &str, place: (u64, u64)) {
        let (Some(0), Some(section)) = (self.in_array, &self.section) else { return };
        let piece = document.pieces.last_mut();
        let array = piece.and_then(|p| p.sections.get_mut(section)).and_then(|s| s.arrays.last_mut());
        if let Some(array) = array.filter(|a| a.inline.0 == a.inline.1)
            && !text.trim_ascii().is_empty()
        {
            array.inline = place;
        }
    }

    fn end(&mut self, name: &str) {
        match &mut self.in_array {
            Some(0) => self.in_array = None,
            Some(depth) => *depth -= 1,
            None if name == "Piece" => (self.in_piece, self.section) = (false, None),
            None if self.section.as_deref() == Some(name) => self.section = None,
            None => {}
        }
    }
}
