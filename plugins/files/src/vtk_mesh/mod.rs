//! Legacy VTK files of meshes and surfaces.
//!
//! # Reads
//! Versions 1 to 5, ASCII and BINARY (big-endian): `UNSTRUCTURED_GRID` (cells as counted lists or as
//! `OFFSETS` and `CONNECTIVITY`), `STRUCTURED_GRID` (with `BLANKING`) and, as surfaces, `POLYDATA`.
//! All point data become attributes, except the normals of surfaces: `SCALARS`, `COLOR_SCALARS`,
//! `VECTORS`, `NORMALS`, `TENSORS`, `TEXTURE_COORDINATES`, identifiers, flags and the arrays of a
//! `FIELD`. Percent-encoded names are decoded, `METADATA` passed over. 64-bit integers become
//! 32-bit ones, or doubles where they do not fit. Cells that `vtkGhostType` marks are left out.
//!
//! # Options
//! None.
//!
//! # Limits
//! Cells without volume (in grids), vertices and lines (in surfaces), cell data, bits and strings
//! are left out, with a warning where they carry something. Curved cells, polyhedra, rectilinear
//! grids and fields alone are refused.

mod parts;

use std::path::Path;

use volact_core::{
    LoadError, LoadOptions, MeshData, Progress, ScalarType,
    loader::{Confidence, Probe},
};

use crate::{
    fields,
    format::{Format, name_of},
    mesh::{CellLayout, GHOST_CELL, GHOSTS, HIDDEN_POINT, Meter, Named, check_count, flags, note},
    numbers::{NumberType, Numbers},
    storage::Storage,
    vtk_legacy::{Kind, Legacy, dataset, kind, unescape},
};
use parts::{Owner, Parts};

/// The datasets that are meshes or surfaces.
pub(crate) const MESHES: [&str; 3] = ["UNSTRUCTURED_GRID", "STRUCTURED_GRID", "POLYDATA"];

/// Sections of surfaces, each with whether its cells are strips; `None` for what has no area.
const FACES: [(&str, Option<bool>); 4] =
    [("VERTICES", None), ("LINES", None), ("POLYGONS", Some(false)), ("TRIANGLE_STRIPS", Some(true))];

/// The loader.
pub(crate) fn format() -> Format {
    Format::of_meshes("vtk-mesh", "legacy VTK unstructured and structured grids, and surfaces (.vtk)", probe, read)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    match dataset(probe.head) {
        Some(kind) if MESHES.contains(&kind.as_str()) => Confidence::Content,
        _ => Confidence::No,
    }
}

fn read(
    storage: &Storage,
    path: &Path,
    _options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<MeshData, LoadError> {
    let contents = storage.contents(path)?;
    let mut reader = Reader {
        file: Legacy::open(path, contents.bytes())?,
        parts: Parts::default(),
        owner: Owner::Dataset,
        meter: Meter::new(storage, path, progress, 1)?,
    };
    reader.sections()?;
    let (parts, mut meter) = (reader.parts, reader.meter);
    let name = name_of(path);
    let mut warnings = Vec::new();
    if !parts.cell_data.is_empty() {
        let names = &parts.cell_data;
        warnings.push(note(&name, format!("cell data are left out: {names:?}; convert them to point data")));
    }
    if !parts.left_out.is_empty() {
        let names = &parts.left_out;
        warnings.push(note(&name, format!("attributes that are no numbers are left out: {names:?}")));
    }
    let made = parts.build(path, name, warnings)?;
    meter.step()?;
    Ok(made)
}

struct Reader<'a> {
    file: Legacy<'a>,
    parts: Parts,
    owner: Owner,
    meter: Meter<'a>,
}

impl Reader<'_> {
    fn invalid(&self, what: &str, found: impl ToString, wanted: &str) -> LoadError {
        LoadError::invalid(self.file.path(), what, found, wanted)
    }

    fn word(&mut self, what: &str) -> Result<String, LoadError> {
        match self.file.scan.word() {
            Some(word) if word.len() <= 4096 => Ok(String::from_utf8_lossy(word).into_owned()),
            Some(_) => Err(self.invalid(what, "longer", "at most 4096 characters")),
            None => Err(self.invalid(what, "missing", "one more word")),
        }
    }

    fn number(&mut self, what: &str) -> Result<u64, LoadError> {
        let word = self.word(what)?;
        fields::value(self.file.path(), what, &word, "a whole number")
    }

    fn kind(&mut self, what: &str) -> Result<Kind, LoadError> {
        let word = self.word(what)?;
        kind(self.file.path(), &word)
    }

    /// Numbers of a type that is none of bits.
    fn numbers(&mut self, what: &str, kind: Kind, count: u64) -> Result<Numbers, LoadError> {
        let numbers = self.file.numbers(what, kind, count)?;
        numbers.ok_or_else(|| self.invalid(&format!("data type of {what}"), "bit", "a type of numbers"))
    }

    fn sections(&mut self) -> Result<(), LoadError> {
        while let Some(word) = self.file.scan.word() {
            let word = String::from_utf8_lossy(&word[..word.len().min(40)]).to_uppercase();
            self.section(&word)?;
            self.meter.at(self.file.scan.offset())?;
        }
        Ok(())
    }

    fn section(&mut self, word: &str) -> Result<(), LoadError> {
        match word {
            "DATASET" => {
                let kind = self.word(word)?.to_uppercase();
                if !MESHES.contains(&kind.as_str()) {
                    let cure = format!("only {} are meshes or surfaces", MESHES.join(", "));
                    let (path, what) = (self.file.path().into(), format!("dataset {kind}"));
                    return Err(LoadError::Unsupported { path, what, cure });
                }
                self.parts.dataset = kind;
            }
            "DIMENSIONS" => {
                let sizes = [self.number(word)?, self.number(word)?, self.number(word)?];
                self.parts.dims = Some(fields::dimensions(self.file.path(), word, &sizes)?);
            }
            "BLANKING" => {
                let (count, kind) = (self.number(word)?, self.kind(word)?);
                let flags = self.numbers(word, kind, count)?;
                let visible = |i| u8::from(flags.integer(i) != Some(0));
                self.parts.visible = Some((0..flags.len()).map(visible).collect());
            }
            "POINTS" => {
                let (count, kind) = (self.number(word)?, self.kind(word)?);
                check_count(self.file.path(), "number of POINTS", count)?;
                self.parts.points = Some(self.numbers("POINTS", kind, count.saturating_mul(3))?);
            }
            "CELLS" => self.parts.cells = Some(self.cells(word)?),
            "CELL_TYPES" => {
                let count = self.number(word)?;
                let int = Kind { number: Some(NumberType::Scalar(ScalarType::I32)), bits: 32 };
                self.parts.types = Some(self.numbers(word, int, count)?);
            }
            "POINT_DATA" => self.owner = Owner::Points(self.number(word)?),
            "CELL_DATA" => self.owner = Owner::Cells(self.number(word)?),
            "METADATA" => self.file.pass_metadata(),
            "FIELD" => self.field()?,
            "LOOKUP_TABLE" => {
                self.word(word)?;
                let entries = self.number(word)?.saturating_mul(4);
                let scalar = if self.file.ascii { ScalarType::F32 } else { ScalarType::U8 };
                let kind = Kind { number: Some(NumberType::Scalar(scalar)), bits: 8 };
                self.file.numbers(word, kind, entries)?;
            }
            _ => match FACES.iter().find(|(name, _)| *name == word) {
                Some((_, strip)) => {
                    let (connectivity, layout, count) = self.cells(word)?;
                    match strip {
                        Some(strip) => self.parts.faces.push((connectivity, layout, count, *strip)),
                        None => self.parts.thin += count,
                    }
                }
                None => self.attribute(word)?,
            },
        }
        Ok(())
    }

    /// Cells as counted lists, or as offsets and connectivity.
    fn cells(&mut self, word: &str) -> Result<(Numbers, CellLayout, u64), LoadError> {
        let (count, size) = (self.number(word)?, self.number(word)?);
        if !self.file.scan.peek().is_some_and(|w| w.eq_ignore_ascii_case(b"OFFSETS")) {
            let int = Kind { number: Some(NumberType::Scalar(ScalarType::I32)), bits: 32 };
            return Ok((self.numbers(word, int, size)?, CellLayout::Counted, count));
        }
        self.word("OFFSETS")?;
        let kind = self.kind("OFFSETS")?;
        let bounds = self.numbers("OFFSETS", kind, count)?;
        let next = self.word("CONNECTIVITY")?;
        if !next.eq_ignore_ascii_case("CONNECTIVITY") {
            let found: String = next.chars().take(40).collect();
            return Err(self.invalid("word after OFFSETS", format!("{found:?}"), "CONNECTIVITY"));
        }
        let kind = self.kind("CONNECTIVITY")?;
        let connectivity = self.numbers("CONNECTIVITY", kind, size)?;
        Ok((connectivity, CellLayout::Bounds(bounds), count.saturating_sub(1)))
    }

    /// An attribute other than a field.
    fn attribute(&mut self, word: &str) -> Result<(), LoadError> {
        let float = if self.file.ascii { "float" } else { "unsigned_char" };
        let known = ["SCALARS", "COLOR_SCALARS", "VECTORS", "NORMALS", "TENSORS", "TENSORS6", "TEXTURE_COORDINATES"];
        let single = ["GLOBAL_IDS", "PEDIGREE_IDS", "EDGE_FLAGS"];
        if !known.contains(&word) && !single.contains(&word) {
            return Err(self.invalid("keyword", format!("{word:?}"), "a keyword of legacy VTK files"));
        }
        let name = unescape(&self.word(word)?);
        let (type_name, components) = match word {
            "COLOR_SCALARS" => (float.to_owned(), self.number(word)?),
            "TEXTURE_COORDINATES" => {
                let components = self.number(word)?;
                (self.word(word)?, components)
            }
            "SCALARS" => {
                let type_name = self.word(word)?;
                let next = self.file.scan.peek().map(<[u8]>::to_ascii_uppercase);
                let components = if next.as_deref() == Some(b"LOOKUP_TABLE") { 1 } else { self.number(word)? };
                let table = self.word("word after SCALARS")?;
                if !table.eq_ignore_ascii_case("LOOKUP_TABLE") {
                    let found: String = table.chars().take(12).collect();
                    return Err(self.invalid("line after SCALARS", format!("{found:?}"), "LOOKUP_TABLE"));
                }
                self.word("LOOKUP_TABLE")?;
                (type_name, components)
            }
            "VECTORS" | "NORMALS" => (self.word(word)?, 3),
            "TENSORS" => (self.word(word)?, 9),
            "TENSORS6" => (self.word(word)?, 6),
            _ => (self.word(word)?, 1),
        };
        let (Owner::Points(tuples) | Owner::Cells(tuples)) = self.owner else {
            return Err(self.invalid("POINT_DATA", format!("missing before {word}"), "one"));
        };
        self.array(name, &type_name, components, tuples, word == "NORMALS")
    }

    /// The arrays of a field.
    fn field(&mut self) -> Result<(), LoadError> {
        self.word("FIELD")?;
        let count = self.number("number of arrays of FIELD")?;
        for _ in 0..count {
            let mut name = self.word("field array")?;
            while name.eq_ignore_ascii_case("METADATA") {
                self.file.pass_metadata();
                name = self.word("field array")?;
            }
            if name == "NULL_ARRAY" {
                continue;
            }
            let components = self.number("components of a field array")?;
            let tuples = self.number("tuples of a field array")?;
            let type_name = self.word("type of a field array")?;
            let name = unescape(&name);
            if let Owner::Points(wanted) | Owner::Cells(wanted) = self.owner
                && tuples != wanted
            {
                return Err(self.invalid(&format!("tuples of {name:?}"), tuples, &format!("{wanted}")));
            }
            self.array(name, &type_name, components, tuples, false)?;
        }
        Ok(())
    }

    /// The numbers of an array, kept if they belong to points.
    fn array(
        &mut self,
        name: String,
        type_name: &str,
        components: u64,
        tuples: u64,
        normals: bool,
    ) -> Result<(), LoadError> {
        let what = format!("array {name:?}");
        let count = components.saturating_mul(tuples);
        if matches!(type_name.to_lowercase().as_str(), "string" | "utf8_string") {
            self.file.pass_strings(&what, count)?;
            self.parts.left_out(self.owner, name);
            return Ok(());
        }
        let kind = kind(self.file.path(), type_name)?;
        let numbers = self.file.numbers(&what, kind, count)?;
        let path = self.file.path();
        match (numbers, self.owner) {
            (Some(numbers), Owner::Points(_)) if name == GHOSTS => {
                self.parts.hidden_points = flags(&numbers, HIDDEN_POINT);
            }
            (Some(numbers), Owner::Cells(_)) if name == GHOSTS => self.parts.ghosts = flags(&numbers, GHOST_CELL),
            (Some(numbers), Owner::Points(_)) => {
                let components = usize::try_from(components).unwrap_or(0);
                if components == 0 {
                    return Err(LoadError::invalid(path, format!("components of {name:?}"), components, "at least 1"));
                }
                if normals && self.parts.dataset == "POLYDATA" && self.parts.normals.is_none() {
                    self.parts.normals = Some(numbers);
                } else {
                    self.parts.attributes.push(Named { name, components, numbers });
                }
            }
            _ => self.parts.left_out(self.owner, name),
        }
        Ok(())
    }
}
