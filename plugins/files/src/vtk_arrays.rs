//! Whole arrays of VTK's XML files.

use std::path::Path;

use volact_core::{LoadError, Progress, Warning};

use crate::{
    mesh::{GHOST_CELL, GHOSTS, HIDDEN_POINT, Meter, Named, flags, note},
    numbers::Numbers,
    payload::{ByteOrder, MAP_FROM, reserve},
    storage::Storage,
    text::Scanner,
    vtk_blocks::{Place, locate},
    vtk_xml::{Array, Document, Piece},
};

/// Reads arrays of a document, one after another.
pub(crate) struct ArrayReader<'a> {
    pub(crate) storage: &'a Storage,
    pub(crate) document: &'a Document,
    meter: Meter<'a>,
}

impl<'a> ArrayReader<'a> {
    pub(crate) fn new(
        storage: &'a Storage,
        document: &'a Document,
        progress: &'a dyn Progress,
    ) -> Result<Self, LoadError> {
        let arrays = document.pieces.iter().map(Piece::array_count).sum();
        Ok(Self { storage, document, meter: Meter::new(storage, &document.path, progress, arrays)? })
    }

    fn path(&self) -> &'a Path {
        &self.document.path
    }

    /// The first `count` numbers of an array: as many as it must have.
    pub(crate) fn read(&mut self, array: &Array, count: u64) -> Result<Numbers, LoadError> {
        let path = self.path();
        let kind = array.number_type(path)?;
        let wanted = count.saturating_mul(kind.size() as u64);
        let what = format!("array {:?}", array.name);
        let order = ByteOrder::big_if(self.document.big);
        let numbers = match locate(self.storage, self.document, array, wanted)? {
            Place::Text { start, end } => {
                let text = self.storage.range(path, start, end - start)?;
                Scanner::new(path, &text).numbers(&what, kind, count)?
            }
            Place::Raw { start, available } => {
                if wanted > available {
                    return Err(LoadError::Truncated { path: path.into(), what, found: available, wanted });
                }
                let shared = order == ByteOrder::NATIVE || kind.size() == 1;
                let shared = shared && wanted >= MAP_FROM as u64 && start.is_multiple_of(kind.size() as u64);
                let mapped = if shared { self.storage.map(path, start, wanted as usize)? } else { None };
                match mapped {
                    Some(data) => Numbers { kind, data },
                    None => Numbers::from_bytes(kind, self.storage.range(path, start, wanted)?, order),
                }
            }
            Place::Blocks(mut blocks) => {
                let mut bytes = Vec::new();
                let mut n = 0;
                while (bytes.len() as u64) < wanted {
                    let block = blocks.block(n)?;
                    if n == 0 {
                        bytes = reserve(path, wanted as usize)?;
                    }
                    bytes.extend_from_slice(&block);
                    n += 1;
                    self.meter.tell(bytes.len() as u64, wanted)?;
                }
                Numbers::from_bytes(kind, bytes, order)
            }
        };
        self.meter.step()?;
        Ok(numbers)
    }

    /// The numbers of a piece's points, three each.
    pub(crate) fn points(&mut self, piece: &Piece, count: u64) -> Result<Numbers, LoadError> {
        let Some(array) = piece.arrays("Points").first() else {
            return Err(LoadError::invalid(self.path(), "array of Points", "missing", "one"));
        };
        self.read(array, count.saturating_mul(3))
    }

    /// The length of the connectivity whose cells end at `ends`.
    pub(crate) fn length(&self, ends: &Numbers) -> Result<u64, LoadError> {
        let Some(last) = ends.len().checked_sub(1) else { return Ok(0) };
        let end = ends.integer(last);
        end.and_then(|n| u64::try_from(n).ok()).ok_or_else(|| {
            let found = end.map_or("no whole number".into(), |n| n.to_string());
            LoadError::invalid(self.path(), "last of offsets", found, "the length of connectivity")
        })
    }

    /// The arrays of a piece's point data, as attributes of `vertices` vertices, without those that
    /// hold no numbers.
    pub(crate) fn attributes(
        &mut self,
        piece: &Piece,
        vertices: usize,
        file: &str,
        warnings: &mut Vec<Warning>,
    ) -> Result<Vec<Named>, LoadError> {
        let mut all = Vec::new();
        for array in piece.arrays("PointData").iter().filter(|a| a.name != GHOSTS) {
            if matches!(array.type_name.as_str(), "String" | "Bit") {
                let what = format!("attribute {:?} of type {} is left out", array.name, array.type_name);
                warnings.push(note(file, what));
                continue;
            }
            let components: usize = array.components(self.path(), "a whole number above 0")?;
            if components == 0 {
                let what = format!("NumberOfComponents of {:?}", array.name);
                return Err(LoadError::invalid(self.path(), what, 0, "at least 1"));
            }
            let count = (vertices as u64).saturating_mul(components as u64);
            let numbers = self.read(array, count)?;
            all.push(Named { name: array.name.clone(), components, numbers });
        }
        Ok(all)
    }

    /// Which cells a piece marks as no part of itself.
    pub(crate) fn ghost_cells(&mut self, piece: &Piece, cells: u64) -> Result<Option<Vec<bool>>, LoadError> {
        self.flags(piece, "CellData", cells, GHOST_CELL)
    }

    /// Which points a piece hides.
    pub(crate) fn hidden_points(&mut self, piece: &Piece, points: u64) -> Result<Option<Vec<bool>>, LoadError> {
        self.flags(piece, "PointData", points, HIDDEN_POINT)
    }

    fn flags(&mut self, piece: &Piece, section: &str, count: u64, mask: u8) -> Result<Option<Vec<bool>>, LoadError> {
        let Some(array) = piece.arrays(section).iter().find(|a| a.name == GHOSTS) else { return Ok(None) };
        Ok(flags(&self.read(array, count)?, mask))
    }
}

/// Warns of arrays that belong to cells and are not read.
pub(crate) fn cell_data_left_out(document: &Document, file: &str, warnings: &mut Vec<Warning>) {
    let all = document.pieces.iter().flat_map(|p| p.arrays("CellData")).map(|a| a.name.as_str());
    let mut names: Vec<&str> = all.filter(|name| *name != GHOSTS).collect();
    names.sort_unstable();
    names.dedup();
    if !names.is_empty() {
        warnings.push(note(file, format!("cell data are left out: {names:?}; convert them to point data")));
    }
}
