//! Cells of unstructured grids as VTK describes them: types, connectivity, and where each cell's
//! corners lie in it.
//!
//! Cells without volume (vertices, lines, triangles, quadrilaterals and the like) are left out and
//! counted; voxels become hexahedra; any other type is an error that names the cell.

use std::{collections::BTreeMap, ops::Range, path::Path};

use volact_core::{Buffer, CellType, CellTypes, LoadError, Mesh, Points, ScalarType, Warning};

use super::note;
use crate::numbers::{NumberType, Numbers};

const VOXEL: u8 = 11;
/// Corners of a voxel in the order of a hexahedron.
const VOXEL_TO_HEXAHEDRON: [usize; 8] = [0, 1, 3, 2, 4, 5, 7, 6];

/// Types that have no volume.
const FLAT: [(u8, &str); 26] = [
    (0, "empty"),
    (1, "vertex"),
    (2, "poly-vertex"),
    (3, "line"),
    (4, "poly-line"),
    (5, "triangle"),
    (6, "triangle strip"),
    (7, "polygon"),
    (8, "pixel"),
    (9, "quadrilateral"),
    (21, "quadratic edge"),
    (22, "quadratic triangle"),
    (23, "quadratic quadrilateral"),
    (28, "biquadratic quadrilateral"),
    (30, "quadratic linear quadrilateral"),
    (34, "biquadratic triangle"),
    (35, "cubic line"),
    (36, "quadratic polygon"),
    (60, "higher-order edge"),
    (61, "higher-order triangle"),
    (62, "higher-order quadrilateral"),
    (68, "Lagrange curve"),
    (69, "Lagrange triangle"),
    (70, "Lagrange quadrilateral"),
    (75, "Bézier curve"),
    (76, "Bézier triangle"),
];

/// Types that have volume and are not read.
const CURVED: [(u8, &str); 27] = [
    (15, "pentagonal prism"),
    (16, "hexagonal prism"),
    (24, "quadratic tetrahedron"),
    (25, "quadratic hexahedron"),
    (26, "quadratic wedge"),
    (27, "quadratic pyramid"),
    (29, "triquadratic hexahedron"),
    (31, "quadratic linear wedge"),
    (32, "biquadratic quadratic wedge"),
    (33, "biquadratic quadratic hexahedron"),
    (37, "triquadratic pyramid"),
    (41, "convex point set"),
    (42, "polyhedron"),
    (53, "parametric tetrahedron region"),
    (55, "parametric hexahedron region"),
    (64, "higher-order tetrahedron"),
    (65, "higher-order wedge"),
    (66, "higher-order pyramid"),
    (67, "higher-order hexahedron"),
    (71, "Lagrange tetrahedron"),
    (72, "Lagrange hexahedron"),
    (73, "Lagrange wedge"),
    (74, "Lagrange pyramid"),
    (78, "Bézier tetrahedron"),
    (79, "Bézier hexahedron"),
    (80, "Bézier wedge"),
    (81, "Bézier pyramid"),
];

fn name_in(table: &[(u8, &'static str)], code: u8) -> Option<&'static str> {
    table.iter().find(|(c, _)| *c == code).map(|(_, name)| *name)
}

/// Cells as a file has them.
pub(crate) struct CellArrays {
    /// A code of VTK a cell.
    pub(crate) types: Buffer,
    pub(crate) connectivity: Numbers,
    pub(crate) layout: CellLayout,
}

/// Where in the connectivity a cell's corners lie.
pub(crate) enum CellLayout {
    /// Where each cell ends; the first begins at 0.
    Ends(Numbers),
    /// Where each cell begins, and where the last ends.
    Bounds(Numbers),
    /// Before each cell's corners stands how many they are.
    Counted,
}

impl CellLayout {
    /// Where a cell's corners begin and end, if the cell before it ends at `at`; -1 for what is no
    /// number.
    pub(super) fn bounds(&self, connectivity: &Numbers, cell: usize, at: usize) -> [i64; 2] {
        let number = |numbers: &Numbers, i: usize| numbers.integer(i).unwrap_or(-1);
        match self {
            Self::Ends(ends) => [at as i64, number(ends, cell)],
            Self::Bounds(bounds) => [number(bounds, cell), number(bounds, cell + 1)],
            Self::Counted => {
                let count = number(connectivity, at);
                let start = at as i64 + 1;
                [start, if count < 0 { -1 } else { start.saturating_add(count) }]
            }
        }
    }

    /// As [`bounds`](Self::bounds), inside the connectivity; `at` moves on.
    pub(super) fn range(
        &self,
        path: &Path,
        what: &dyn Fn() -> String,
        connectivity: &Numbers,
        cell: usize,
        at: &mut usize,
    ) -> Result<Range<usize>, LoadError> {
        let length = connectivity.len();
        let [start, end] = self.bounds(connectivity, cell, *at);
        if start < *at as i64 || end < start || end > length as i64 {
            let found = format!("numbers {start} to {end}");
            let wanted = format!("between {at} and the {length} numbers of the connectivity");
            return Err(LoadError::invalid(path, format!("place of the corners of {}", what()), found, wanted));
        }
        *at = end as usize;
        Ok(start as usize..*at)
    }
}

/// Types as codes of 8 bits, shared where they are such.
pub(crate) fn codes(path: &Path, types: &Numbers) -> Result<Buffer, LoadError> {
    if matches!(types.kind, NumberType::Scalar(ScalarType::U8 | ScalarType::I8)) {
        return Ok(types.data.clone());
    }
    let code = |cell: usize| {
        let code = types.integer(cell);
        let found = || code.map_or_else(|| format!("of type {}", types.kind.name()), |v| v.to_string());
        let narrow = code.and_then(|v| u8::try_from(v).ok());
        narrow.ok_or_else(|| LoadError::invalid(path, format!("type of cell {cell}"), found(), "0 to 255"))
    };
    let codes: Result<Vec<u8>, LoadError> = (0..types.len()).map(code).collect();
    Ok(Buffer::from_vec(codes?))
}

/// A mesh of cells of the types given, of which there is at least one.
pub(crate) fn mesh_of(path: &Path, points: Points, types: Buffer, connectivity: Buffer) -> Result<Mesh, LoadError> {
    let first = types.bytes().first().copied().unwrap_or(0);
    let types = match CellType::from_code(first).filter(|_| types.bytes().iter().all(|t| *t == first)) {
        Some(all) => CellTypes::All(all),
        None => CellTypes::Each(types),
    };
    Mesh::new(points, types, connectivity).map_err(|source| LoadError::geometry(path, source))
}

impl CellArrays {
    /// The first cell that has a vertex, in words.
    pub(crate) fn owner(&self, vertex: usize) -> String {
        let mut at = 0;
        for cell in 0..self.types.len() {
            let [start, end] = self.layout.bounds(&self.connectivity, cell, at);
            if start < 0 || end < start || end > self.connectivity.len() as i64 {
                break;
            }
            at = end as usize;
            if (start as usize..at).any(|i| self.connectivity.integer(i) == Some(vertex as i64)) {
                return format!("of cell {cell}");
            }
        }
        "of no cell".into()
    }
}

/// The cells that hold volume, gathered from the pieces of a file.
pub(crate) struct Cells<'a> {
    path: &'a Path,
    several: bool,
    /// The number of the piece at hand, and of cells in all before it.
    piece: usize,
    seen: usize,
    types: Vec<u8>,
    connectivity: Vec<u32>,
    left_out: BTreeMap<u8, usize>,
    hidden: usize,
    /// The arrays of a file of one piece, where they need no change.
    shared: Option<(Buffer, Buffer)>,
}

/// What becomes of a cell.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Kept(CellType),
    Voxel,
    Flat,
    Hidden,
}

impl<'a> Cells<'a> {
    /// Cells of a file of so many pieces.
    pub(crate) fn new(path: &'a Path, pieces: usize) -> Self {
        Self {
            path,
            several: pieces > 1,
            piece: 0,
            seen: 0,
            types: Vec::new(),
            connectivity: Vec::new(),
            left_out: BTreeMap::new(),
            hidden: 0,
            shared: None,
        }
    }

    /// Takes the next piece's cells between `vertices` vertices, except those that are `hidden`.
    /// `place` gives the mesh's number of a vertex of the piece.
    ///
    /// # Errors
    /// If a cell's corners are not where the connectivity has them, are not as many as its type
    /// has, name vertices that are not there, or its type is not known.
    pub(crate) fn add(
        &mut self,
        cells: &CellArrays,
        vertices: usize,
        hidden: impl Fn(usize) -> bool,
        place: impl Fn(u32) -> u32,
    ) -> Result<(), LoadError> {
        let Some(buffer) = cells.connectivity.indices() else {
            let found = format!("of type {}", cells.connectivity.kind.name());
            return Err(LoadError::invalid(self.path, "connectivity", found, "whole numbers"));
        };
        let indices: &[u32] = buffer.as_slice().unwrap_or_default();
        let types = cells.types.bytes();
        let (mut at, mut as_is, mut kept) = (0, !self.several, 0);
        for (cell, &code) in types.iter().enumerate() {
            let corners = self.corners(cells, cell, code, &mut at)?;
            let fate = self.fate(cell, code, hidden(cell))?;
            let bad = matches!(fate, Fate::Kept(_) | Fate::Voxel)
                .then(|| corners.clone().find(|&i| indices[i] as usize >= vertices));
            if let Some(bad) = bad.flatten() {
                let found = cells.connectivity.integer(bad).map_or("beyond 64 bits".into(), |v| v.to_string());
                let what = format!("vertex index of {}", self.name(cell));
                return Err(LoadError::invalid(self.path, what, found, format!("from 0, below {vertices}")));
            }
            as_is &= matches!(fate, Fate::Kept(_)) && corners.start == kept;
            kept += corners.len();
        }
        self.count(types, &hidden);
        if as_is && kept == indices.len() {
            self.shared = Some((cells.types.clone(), buffer));
        } else {
            self.copy(cells, indices, hidden, place)?;
        }
        (self.piece, self.seen) = (self.piece + 1, self.seen + types.len());
        Ok(())
    }

    /// The mesh of all cells taken, and warnings about those left out.
    pub(crate) fn finish(self, file: &str, points: Points, warnings: &mut Vec<Warning>) -> Result<Mesh, LoadError> {
        if !self.left_out.is_empty() {
            let total: usize = self.left_out.values().sum();
            let counts: Vec<_> = self
                .left_out
                .iter()
                .map(|(code, n)| format!("{n} of type {code} ({})", name_in(&FLAT, *code).unwrap_or("unknown")))
                .collect();
            warnings.push(note(file, format!("{total} cells without volume are left out: {}", counts.join(", "))));
        }
        if self.hidden > 0 {
            warnings.push(note(file, format!("{} cells that the file marks as ghosts are left out", self.hidden)));
        }
        let (types, connectivity) =
            self.shared.unwrap_or_else(|| (Buffer::from_vec(self.types), Buffer::from_vec(self.connectivity)));
        if types.is_empty() {
            let what = format!("number of cells that hold volume (of {})", self.seen);
            return Err(LoadError::invalid(self.path, what, 0, "at least 1"));
        }
        mesh_of(self.path, points, types, connectivity)
    }

    fn name(&self, cell: usize) -> String {
        if self.several { format!("cell {cell} of piece {}", self.piece) } else { format!("cell {cell}") }
    }

    /// Where a cell's corners lie in the connectivity.
    fn corners(&self, cells: &CellArrays, cell: usize, code: u8, at: &mut usize) -> Result<Range<usize>, LoadError> {
        let range = cells.layout.range(self.path, &|| self.name(cell), &cells.connectivity, cell, at)?;
        let wanted = if code == VOXEL { Some(8) } else { CellType::from_code(code).map(CellType::corners) };
        if let Some(wanted) = wanted.filter(|w| *w != range.len()) {
            let what = format!("number of corners of {}", self.name(cell));
            return Err(LoadError::invalid(self.path, what, range.len(), format!("{wanted} for its type {code}")));
        }
        Ok(range)
    }

    fn fate(&self, cell: usize, code: u8, hidden: bool) -> Result<Fate, LoadError> {
        if let Some(cell_type) = CellType::from_code(code) {
            return Ok(if hidden { Fate::Hidden } else { Fate::Kept(cell_type) });
        }
        if code == VOXEL {
            return Ok(if hidden { Fate::Hidden } else { Fate::Voxel });
        }
        if name_in(&FLAT, code).is_some() {
            return Ok(Fate::Flat);
        }
        let Some(name) = name_in(&CURVED, code) else {
            let known: Vec<_> = CellType::ALL.iter().map(|t| format!("{} ({})", *t as u8, t.name())).collect();
            let wanted = format!("a type of VTK, e.g. {}", known.join(", "));
            return Err(LoadError::invalid(self.path, format!("type of {}", self.name(cell)), code, wanted));
        };
        let what = format!("{} of type {code} ({name})", self.name(cell));
        let cure = "cut it into tetrahedra, hexahedra, wedges or pyramids".into();
        Err(LoadError::Unsupported { path: self.path.into(), what, cure })
    }

    fn count(&mut self, types: &[u8], hidden: &impl Fn(usize) -> bool) {
        for (cell, code) in types.iter().enumerate() {
            if name_in(&FLAT, *code).is_some() {
                *self.left_out.entry(*code).or_default() += 1;
            } else {
                self.hidden += usize::from(hidden(cell));
            }
        }
    }

    fn copy(
        &mut self,
        cells: &CellArrays,
        indices: &[u32],
        hidden: impl Fn(usize) -> bool,
        place: impl Fn(u32) -> u32,
    ) -> Result<(), LoadError> {
        let mut at = 0;
        for (cell, &code) in cells.types.bytes().iter().enumerate() {
            let corners = &indices[self.corners(cells, cell, code, &mut at)?];
            match self.fate(cell, code, hidden(cell))? {
                Fate::Kept(cell_type) => {
                    self.types.push(cell_type as u8);
                    self.connectivity.extend(corners.iter().map(|&i| place(i)));
                }
                Fate::Voxel => {
                    self.types.push(CellType::Hexahedron as u8);
                    self.connectivity.extend(VOXEL_TO_HEXAHEDRON.iter().map(|&i| place(corners[i])));
                }
                Fate::Flat | Fate::Hidden => {}
            }
        }
        Ok(())
    }
}
