//! Exodus II finite element meshes.
//!
//! # Reads
//! NetCDF of every kind (classic, 64-bit, NetCDF-4): blocks of tetrahedra, hexahedra, wedges and
//! pyramids become one mesh in the order of the blocks; coordinates in one array or in three.
//! Nodal variables become attributes, at one time.
//!
//! # Options
//! `step`: which of the file's times, from 0; the last by default.
//!
//! # Limits
//! Blocks of shells, bars, spheres and the like, and variables of elements, sets and the whole
//! are left out, with a warning. Curved elements and polyhedra are refused. Displacements move
//! nothing. Decoded by the crate netcdf-reader.

use std::{path::Path, sync::Arc};

use netcdf_reader::{NcFile, NcOpenOptions, NcReadable, NcSliceInfo, NcSliceInfoElem, NcType, NcVariable};
use volact_core::{
    Buffer, CellType, LoadError, LoadOptions, MeshData, ParameterDecl, ParameterType, Points, Progress, ScalarType,
    Warning,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, int, name_of},
    mesh::{Attributes, Meter, Named, check_count, finite_points, note},
    numbers::{NumberType, Numbers},
    storage::Storage,
};

/// More blocks than anybody has.
const MOST_BLOCKS: u64 = 1 << 16;
/// The most bytes that a byte of a file becomes: deflate's.
const EXPANSION: usize = 1032;

/// The loader.
pub(crate) fn format() -> Format {
    let step = ParameterDecl::new("step", ParameterType::Int, "which time, from 0; the last by default");
    Format::of_meshes("exodus", "Exodus II finite element meshes (.exo, .ex2, .e)", probe, read)
        .with(step.bounds(0.0, 1e9))
}

/// NetCDF holds many things: the head of a classic file names what only Exodus has, that of an
/// HDF5 file does not.
fn probe(probe: &Probe<'_>) -> Confidence {
    let has = |word: &[u8]| probe.head.windows(word.len()).any(|w| w == word);
    let classic = probe.head.starts_with(b"CDF") && has(b"num_nodes") && has(b"num_el_blk");
    let netcdf = probe.head.starts_with(b"CDF") || probe.head.starts_with(b"\x89HDF");
    let named = confidence(classic, probe, &[".exo", ".ex2", ".exii", ".e", ".g"]);
    if netcdf || probe.head.is_empty() { named } else { Confidence::No }
}

struct Bytes(Buffer);

impl AsRef<[u8]> for Bytes {
    fn as_ref(&self) -> &[u8] {
        self.0.bytes()
    }
}

struct File<'a> {
    path: &'a Path,
    netcdf: NcFile,
}

fn read(storage: &Storage, path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<MeshData, LoadError> {
    let contents = storage.contents(path)?;
    let most = contents.len().saturating_mul(EXPANSION);
    let settings = NcOpenOptions { max_read_bytes: most, max_chunk_bytes: most, ..NcOpenOptions::default() };
    let netcdf = NcFile::from_owner(Bytes(contents), settings).map_err(|e| LoadError::decode(path, e))?;
    let file = File { path, netcdf };
    let name = name_of(path);
    let mut warnings = Vec::new();
    let nodes = file.size("num_nodes")?;
    let count = check_count(path, "num_nodes", nodes)?;
    let blocks = file.size("num_el_blk")?;
    if blocks > MOST_BLOCKS {
        return Err(file.invalid("num_el_blk", blocks, format!("at most {MOST_BLOCKS}")));
    }
    let nodal = file.names("name_nod_var")?;
    let steps = usize::try_from(blocks).unwrap_or(usize::MAX).saturating_add(nodal.len()).saturating_add(1);
    let mut meter = Meter::new(storage, path, progress, steps)?;
    let mut elements = Elements::default();
    for block in 1..=blocks {
        file.block(block, nodes, &mut elements)?;
        meter.step()?;
    }
    let points = file.points(count, &elements)?;
    meter.step()?;
    let mut attributes = Attributes::new(path, &name);
    if let Some(step) = file.step(int(options, "step"), !nodal.is_empty(), &name, &mut warnings)? {
        for (n, variable) in nodal.into_iter().enumerate() {
            let numbers = file.nodal(n, step)?;
            attributes.add(Named { name: variable, components: 1, numbers }, count, &mut warnings)?;
            meter.step()?;
        }
    }
    let others = [("name_elem_var", "of elements"), ("name_glo_var", "of the whole")];
    for (list, what) in others {
        let names = file.names(list)?;
        if !names.is_empty() {
            warnings.push(note(&name, format!("variables {what} are left out: {names:?}")));
        }
    }
    elements.warn(&name, &mut warnings);
    let mesh = elements.mesh(path, points)?;
    let attributes = attributes.finish();
    Ok(MeshData { name, geometry: Arc::new(mesh), attributes, warnings })
}

/// Elements that hold volume, and what was left out.
#[derive(Default)]
struct Elements {
    types: Vec<u8>,
    connectivity: Vec<u32>,
    seen: u64,
    flat: Vec<(String, u64)>,
}

impl Elements {
    fn warn(&self, file: &str, warnings: &mut Vec<Warning>) {
        if !self.flat.is_empty() {
            let total: u64 = self.flat.iter().map(|(_, n)| n).sum();
            let kinds: Vec<_> = self.flat.iter().map(|(kind, n)| format!("{n} {kind}")).collect();
            warnings.push(note(file, format!("{total} elements without volume are left out: {}", kinds.join(", "))));
        }
    }

    fn mesh(self, path: &Path, points: Points) -> Result<volact_core::Mesh, LoadError> {
        if self.types.is_empty() {
            let what = format!("number of elements that hold volume (of {})", self.seen);
            return Err(LoadError::invalid(path, what, 0, "at least 1"));
        }
        crate::mesh::mesh_of(path, points, Buffer::from_vec(self.types), Buffer::from_vec(self.connectivity))
    }

    fn owner(&self, vertex: usize) -> String {
        let mut at = 0;
        for (element, code) in self.types.iter().enumerate() {
            let corners = CellType::from_code(*code).map_or(0, CellType::corners);
            if self.connectivity[at..at + corners].contains(&(vertex as u32)) {
                return format!("of volume element {element}");
            }
            at += corners;
        }
        "of no element".into()
    }
}

impl File<'_> {
    fn decode(&self, error: netcdf_reader::Error) -> LoadError {
        LoadError::Decode { path: self.path.into(), source: Box::new(error) }
    }

    fn invalid(&self, what: impl Into<String>, found: impl ToString, wanted: impl Into<String>) -> LoadError {
        LoadError::invalid(self.path, what, found, wanted)
    }

    /// A dimension's size.
    fn size(&self, name: &str) -> Result<u64, LoadError> {
        match self.netcdf.dimension(name) {
            Ok(dimension) => Ok(dimension.size),
            Err(_) => Err(self.invalid(format!("dimension {name}"), "missing", "one, as Exodus II has")),
        }
    }

    fn variable(&self, name: &str) -> Option<&NcVariable> {
        self.netcdf.variable(name).ok()
    }

    /// The strings of a variable of characters; none if it is missing.
    fn names(&self, name: &str) -> Result<Vec<String>, LoadError> {
        if self.variable(name).is_none() {
            return Ok(Vec::new());
        }
        let names = self.netcdf.read_variable_as_strings(name).map_err(|e| self.decode(e))?;
        Ok(names.into_iter().map(|n| n.trim_end_matches(['\0', ' ']).to_owned()).collect())
    }

    /// The numbers of a variable of any type that Exodus has; one row of the first dimension, if
    /// asked for.
    fn numbers(&self, name: &str, row: Option<u64>, wanted: &[u64]) -> Result<Numbers, LoadError> {
        let variable = self.variable(name).ok_or_else(|| self.invalid(format!("variable {name}"), "missing", "one"))?;
        let shape = variable.shape();
        let own = if row.is_some() { shape.get(1..).unwrap_or_default() } else { &shape[..] };
        if own != wanted {
            return Err(self.invalid(format!("shape of variable {name}"), format!("{own:?}"), format!("{wanted:?}")));
        }
        let info = NcSliceInfo {
            selections: shape
                .iter()
                .enumerate()
                .map(|(axis, _)| match row {
                    Some(row) if axis == 0 => NcSliceInfoElem::Index(row),
                    _ => NcSliceInfoElem::Slice { start: 0, end: u64::MAX, step: 1 },
                })
                .collect(),
        };
        use NumberType::Scalar;
        match variable.dtype() {
            NcType::Float => self.typed::<f32>(name, &info, Scalar(ScalarType::F32)),
            NcType::Double => self.typed::<f64>(name, &info, Scalar(ScalarType::F64)),
            NcType::Int => self.typed::<i32>(name, &info, Scalar(ScalarType::I32)),
            NcType::UInt => self.typed::<u32>(name, &info, Scalar(ScalarType::U32)),
            NcType::Int64 => self.typed::<i64>(name, &info, NumberType::I64),
            NcType::UInt64 => self.typed::<u64>(name, &info, NumberType::U64),
            other => Err(self.invalid(format!("type of variable {name}"), format!("{other:?}"), "a type of numbers")),
        }
    }

    fn typed<T>(&self, name: &str, info: &NcSliceInfo, kind: NumberType) -> Result<Numbers, LoadError>
    where
        T: NcReadable + bytemuck::Pod + Send + Sync,
    {
        let array = self.netcdf.read_variable_slice::<T>(name, info).map_err(|e| self.decode(e))?;
        let values: Vec<T> = array.iter().copied().collect();
        Ok(Numbers { kind, data: Buffer::from_vec(values) })
    }

    /// Takes a block's elements.
    fn block(&self, block: u64, nodes: u64, out: &mut Elements) -> Result<(), LoadError> {
        let count = match self.netcdf.dimension(&format!("num_el_in_blk{block}")) {
            Ok(dimension) if dimension.size > 0 => dimension.size,
            // A block without elements has no size.
            _ => return Ok(()),
        };
        let name = format!("connect{block}");
        let Some(variable) = self.variable(&name) else {
            let cure = "cut its elements into tetrahedra, hexahedra, wedges or pyramids".into();
            let what = format!("block {block} of {count} polygons or polyhedra");
            return Err(LoadError::Unsupported { path: self.path.into(), what, cure });
        };
        let kind = variable.attribute("elem_type").and_then(|a| a.value.as_string()).unwrap_or_default();
        let kind = kind.trim_end_matches(['\0', ' ']).to_uppercase();
        let shape = variable.shape();
        let &[_, corners] = &shape[..] else {
            return Err(self.invalid(format!("shape of variable {name}"), format!("{shape:?}"), "elements and nodes"));
        };
        let first = out.seen;
        out.seen = first.saturating_add(count);
        let Some(cell_type) = self.cell_type(block, &kind, corners)? else {
            out.flat.push((kind, count));
            return Ok(());
        };
        let numbers = self.numbers(&name, None, &[count, corners])?;
        let corners = cell_type.corners();
        out.types.resize(out.types.len() + count as usize, cell_type as u8);
        out.connectivity.reserve(numbers.len());
        for i in 0..numbers.len() {
            let node = numbers.integer(i);
            match node.filter(|n| (1..=nodes as i64).contains(n)) {
                Some(node) => out.connectivity.push((node - 1) as u32),
                None => {
                    let found = node.map_or("no whole number".into(), |n| n.to_string());
                    let what = format!("node of element {} (block {block})", first as usize + i / corners);
                    return Err(self.invalid(what, found, format!("1 to {nodes}")));
                }
            }
        }
        Ok(())
    }

    /// The type of a block's cells; `None` if they hold no volume.
    fn cell_type(&self, block: u64, kind: &str, corners: u64) -> Result<Option<CellType>, LoadError> {
        let family = kind.trim_end_matches(|c: char| c.is_ascii_digit());
        let cell_type = match family {
            "TETRA" | "TET" => CellType::Tetrahedron,
            "HEX" | "HEXAHEDRON" => CellType::Hexahedron,
            "WEDGE" | "PENTA" | "PRISM" => CellType::Wedge,
            "PYRAMID" | "PYRA" => CellType::Pyramid,
            "SPHERE" | "CIRCLE" | "POINT" | "TRUSS" | "BEAM" | "BAR" | "EDGE" | "LINE" | "TRIANGLE" | "TRI"
            | "TRISHELL" | "QUAD" | "SHELL" | "SHEL" | "NSIDED" => return Ok(None),
            _ => {
                let (what, cure) = (format!("elements {kind:?} of block {block}"), "cut them into linear cells".into());
                return Err(LoadError::Unsupported { path: self.path.into(), what, cure });
            }
        };
        if corners != cell_type.corners() as u64 {
            let what = format!("elements {kind:?} of {corners} nodes in block {block}");
            let cure = format!("cut them into linear cells; a {} has {}", cell_type.name(), cell_type.corners());
            return Err(LoadError::Unsupported { path: self.path.into(), what, cure });
        }
        Ok(Some(cell_type))
    }

    /// The nodes: `coord`, or `coordx`, `coordy` and `coordz`.
    fn points(&self, count: usize, elements: &Elements) -> Result<Points, LoadError> {
        let dimensions = self.size("num_dim")?;
        if dimensions != 3 {
            return Err(self.invalid("num_dim", dimensions, "3"));
        }
        let nodes = count as u64;
        let axes = if self.variable("coord").is_some() {
            let all = self.numbers("coord", None, &[3, nodes])?;
            let size = all.data.len() / 3;
            let part = |a: usize| all.data.slice(a * size..(a + 1) * size).unwrap_or_else(|| all.data.clone());
            [0, 1, 2].map(|a| Numbers { kind: all.kind, data: part(a) })
        } else {
            let axis = |name| self.numbers(name, None, &[nodes]);
            [axis("coordx")?, axis("coordy")?, axis("coordz")?]
        };
        let kind = axes[0].kind;
        if axes.iter().any(|axis| axis.kind != kind) {
            return Err(self.invalid("types of coordx, coordy and coordz", "different", "one type"));
        }
        let size = kind.size();
        let mut bytes = Vec::with_capacity(3 * axes[0].data.len());
        for node in 0..count {
            axes.iter().for_each(|axis| bytes.extend_from_slice(&axis.data.bytes()[node * size..(node + 1) * size]));
        }
        finite_points(self.path, Numbers::from_native(kind, bytes), |vertex| elements.owner(vertex))
    }

    /// The time to read; `None` if there is none.
    fn step(
        &self,
        asked: Option<i64>,
        nodal: bool,
        file: &str,
        warnings: &mut Vec<Warning>,
    ) -> Result<Option<u64>, LoadError> {
        let count = self.netcdf.dimension("time_step").map_or(0, |dimension| dimension.size);
        let asked = asked.map(|n| u64::try_from(n).unwrap_or(u64::MAX));
        if let Some(step) = asked.filter(|n| *n >= count) {
            return Err(self.invalid("option step", step, format!("below {count}")));
        }
        let Some(last) = count.checked_sub(1) else { return Ok(None) };
        if asked.is_none() && last > 0 && nodal {
            warnings.push(note(file, format!("the last of {count} times is read; the option step takes another")));
        }
        Ok(asked.or(Some(last)))
    }

    /// Nodal variable `n` at a time: `vals_nod_var` of all, or one array for each.
    fn nodal(&self, n: usize, step: u64) -> Result<Numbers, LoadError> {
        let nodes = self.size("num_nodes")?;
        if self.variable("vals_nod_var").is_none() {
            return self.numbers(&format!("vals_nod_var{}", n + 1), Some(step), &[nodes]);
        }
        let count = self.size("num_nod_var")?;
        let all = self.numbers("vals_nod_var", Some(step), &[count, nodes])?;
        let size = nodes as usize * all.kind.size();
        let data = all.data.slice(n * size..(n + 1) * size);
        let data = data.ok_or_else(|| self.invalid("number of nodal variables", n + 1, format!("at most {count}")))?;
        Ok(Numbers { kind: all.kind, data })
    }
}
