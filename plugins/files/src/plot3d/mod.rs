//! PLOT3D: curvilinear grids, and the solutions that belong to them.
//!
//! # Reads
//! Binary grid files of one block or several: either byte order, 32 or 64 bits, with and without
//! Fortran's record marks, with and without `iblank`. Which of these a file is follows from its
//! size, which must be exactly what its dimensions make of it. A solution (`q`: density, momentum,
//! energy) or function file with the same dimensions is read with it: the one that the option `q`
//! names, else those found beside it: `name.q`, `name.f`, `name.fun`, and `nameq.bin` beside
//! `namexyz.bin`.
//!
//! One block is a structured mesh. Several are one mesh of all their hexahedra, whose coincident
//! vertices are joined; blanked vertices take their cells with them.
//!
//! # Options
//! `q`; `block` (from 0) for one of several; `byte_order`, `precision`, `records`, `multi` and
//! `iblank` to say what a file is. Where all five are given the file may be longer.
//!
//! # Limits
//! Text files, grids of two dimensions, records beyond 2 GiB and OVERFLOW's extended solutions are
//! refused. The free stream's four numbers are not used, and `iblank` tells only 0 from the rest.

mod layout;

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use volact_core::{
    Buffer, CellType, CellTypes, Geometry, LoadError, LoadOptions, Mesh, MeshData, ParameterDecl, ParameterType,
    Points, Progress, ScalarType, Warning,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, beside, int, name_of, text},
    mesh::{Attributes, Blanking, Joined, Meter, Named, check_count, finite_points, hexahedra, note, structured},
    numbers::{NumberType, Numbers},
    payload::ByteOrder,
    storage::Storage,
};
use layout::{Block, Layout, Role, find_beside, find_grid};

const EXTENSIONS: [&str; 6] = [".xyz", ".p3d", ".g", ".grd", ".x", "xyz.bin"];
/// What stands for the end of a grid's name in the names of its solutions.
const SOLUTIONS: [&str; 4] = [".q", ".f", ".fun", ".sol"];

/// The loader.
pub(crate) fn format() -> Format {
    let option = ParameterDecl::new;
    Format::of_meshes("plot3d", "PLOT3D grids with their solutions (.xyz, .p3d, .g, .x)", probe, read)
        .with(option(
            "q",
            ParameterType::Choice,
            "solution or function file, beside the grid unless it is a whole path",
        ))
        .with(option("block", ParameterType::Int, "the one block to read, counted from 0").bounds(0.0, 1e9))
        .with(
            option("byte_order", ParameterType::Choice, "byte order, instead of the one found")
                .choices(&["little", "big"]),
        )
        .with(
            option("precision", ParameterType::Choice, "size of numbers, instead of the one found")
                .choices(&["single", "double"]),
        )
        .with(option("records", ParameterType::Bool, "whether records stand between their lengths"))
        .with(option("multi", ParameterType::Bool, "whether a number of blocks comes first"))
        .with(option("iblank", ParameterType::Bool, "whether each vertex has a flag"))
}

/// The format has no mark: the name says it, and the content must not be text.
fn probe(probe: &Probe<'_>) -> Confidence {
    let name = probe.file_name();
    let binary = probe.head.iter().take(16).any(|b| *b < 9);
    // Exodus II shares an extension.
    let netcdf = probe.head.starts_with(b"CDF") || probe.head.starts_with(b"\x89HDF");
    let named = !netcdf && EXTENSIONS.iter().any(|e| name.ends_with(e));
    if named && binary && !probe.is_dir { Confidence::Extension } else { Confidence::No }
}

fn read(storage: &Storage, path: &Path, options: &LoadOptions, progress: &dyn Progress) -> Result<MeshData, LoadError> {
    let contents = storage.contents(path)?;
    let (layout, blocks, end) = find_grid(path, contents.bytes(), options)?;
    let name = name_of(path);
    let mut warnings = Vec::new();
    if end < contents.len() as u64 {
        warnings.push(note(&name, format!("{} bytes after the grid are not read", contents.len() as u64 - end)));
    }
    let total = blocks.iter().fold(0u64, |n, b| n.saturating_add(b.vertices()));
    check_count(path, "number of vertices of all blocks", total)?;
    let wanted = int(options, "block").map(|n| usize::try_from(n).unwrap_or(usize::MAX));
    if let Some(block) = wanted.filter(|n| *n >= blocks.len()) {
        return Err(LoadError::invalid(path, "option block", block, format!("below {}", blocks.len())));
    }
    let chosen: Vec<usize> = wanted.map_or((0..blocks.len()).collect(), |n| vec![n]);
    let solutions = solutions(storage, path, text(options, "q"), layout, &blocks, &mut warnings)?;
    let mut meter = Meter::new(storage, path, progress, chosen.len() + solutions.len())?;
    let mut grids = Vec::new();
    for &n in &chosen {
        grids.push(grid_block(path, &contents, layout, &blocks[n], n)?);
        meter.step()?;
    }
    let counts: Vec<usize> = grids.iter().map(|g| g.points.len()).collect();
    let geometry = if let [grid] = &mut grids[..] {
        let blanking = Blanking { vertices: grid.visible.take(), cells: None };
        structured(path, grid.dims, grid.points.clone(), blanking)?
    } else {
        joined(path, &grids)?
    };
    let mut attributes = Attributes::new(path, &name);
    for solution in &solutions {
        for named in solution.attributes(&chosen) {
            attributes.add(named, counts.iter().sum(), &mut warnings)?;
        }
        meter.step()?;
    }
    let attributes = attributes.finish();
    Ok(MeshData { name, geometry, attributes, warnings })
}

struct Grid {
    dims: [usize; 3],
    points: Points,
    visible: Option<Vec<u8>>,
}

fn grid_block(path: &Path, contents: &Buffer, layout: Layout, block: &Block, number: usize) -> Result<Grid, LoadError> {
    let n = block.vertices() as usize;
    let dims = block.dims.map(|d| d as usize);
    let points = interleave(contents, layout, block, 0, 3);
    let [nx, ny, _] = dims;
    let owner = |v: usize| format!("at {:?} of block {number}", [v % nx, v / nx % ny, v / nx / ny]);
    let points = finite_points(path, points, owner)?;
    let flags = layout.iblank.then(|| {
        let start = block.start + 3 * n as u64 * layout.size();
        let raw = &contents.bytes()[start as usize..start as usize + 4 * n];
        raw.chunks_exact(4).map(|word| u8::from(word != [0; 4])).collect::<Vec<u8>>()
    });
    Ok(Grid { dims, points, visible: flags.filter(|f| f.contains(&0)) })
}

/// Arrays `first..first + count` of a block, each vertex's numbers together, shared where there is
/// nothing to be done.
fn interleave(contents: &Buffer, layout: Layout, block: &Block, first: u64, count: usize) -> Numbers {
    let n = block.vertices() as usize;
    let size = layout.size() as usize;
    let kind = NumberType::Scalar(if layout.double { ScalarType::F64 } else { ScalarType::F32 });
    let start = block.start as usize + first as usize * n * size;
    if count == 1
        && layout.order == ByteOrder::NATIVE
        && let Some(data) = contents.slice(start..start + n * size)
        && data.bytes().as_ptr().addr().is_multiple_of(size)
    {
        return Numbers { kind, data };
    }
    let bytes = contents.bytes();
    let mut out = Vec::with_capacity(count * n * size);
    for vertex in 0..n {
        for array in 0..count {
            let at = start + (array * n + vertex) * size;
            out.extend_from_slice(&bytes[at..at + size]);
        }
    }
    Numbers::from_bytes(kind, out, layout.order)
}

/// One mesh of the hexahedra of several blocks.
fn joined(path: &Path, grids: &[Grid]) -> Result<Arc<dyn Geometry>, LoadError> {
    let mut joined = Joined::default();
    let mut connectivity: Vec<u32> = Vec::new();
    for grid in grids {
        let places = joined.places(path, &grid.points)?;
        let seen = |corners: &[u32; 8]| {
            grid.visible.as_ref().is_none_or(|flags| corners.iter().all(|&i| flags[i as usize] != 0))
        };
        let cells = hexahedra(grid.dims).filter(seen);
        connectivity.extend(cells.flatten().map(|i| places[i as usize]));
    }
    if connectivity.is_empty() {
        return Err(LoadError::invalid(path, "number of cells that are not blanked", 0, "at least 1"));
    }
    let points = grids.iter().flat_map(|grid| grid.points.iter()).collect();
    let mesh = Mesh::new(points, CellTypes::All(CellType::Hexahedron), Buffer::from_vec(connectivity));
    Ok(Arc::new(mesh.map_err(|source| LoadError::geometry(path, source))?))
}

/// A file of numbers for the vertices of a grid.
struct Solution {
    contents: Buffer,
    role: Role,
    layout: Layout,
    blocks: Vec<Block>,
}

impl Solution {
    fn attributes(&self, chosen: &[usize]) -> Vec<Named> {
        let variables = self.blocks.first().map_or(0, |b| b.variables);
        let arrays: Vec<(String, u64, usize)> = match self.role {
            Role::Solution => vec![("density".into(), 0, 1), ("momentum".into(), 1, 3), ("energy".into(), 4, 1)],
            _ => (0..variables).map(|n| (format!("f{n}"), n, 1)).collect(),
        };
        let numbers = |first, count| {
            let mut parts: Vec<Numbers> = chosen
                .iter()
                .map(|&n| interleave(&self.contents, self.layout, &self.blocks[n], first, count))
                .collect();
            if parts.len() == 1 {
                return parts.remove(0);
            }
            let kind = parts.first().map_or(NumberType::Scalar(ScalarType::F32), |p| p.kind);
            Numbers::from_native(kind, parts.iter().flat_map(|p| p.data.bytes()).copied().collect())
        };
        let named = |(name, first, components)| Named { name, components, numbers: numbers(first, components) };
        arrays.into_iter().map(named).collect()
    }
}

/// The solutions of a grid: the one that is named, or those that are beside it and fit.
fn solutions(
    storage: &Storage,
    path: &Path,
    named: Option<&str>,
    grid: Layout,
    blocks: &[Block],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Solution>, LoadError> {
    let dims: Vec<[u64; 3]> = blocks.iter().map(|b| b.dims).collect();
    let files = match named {
        Some(name) => vec![beside(path, name)],
        None => names_beside(path).into_iter().filter(|file| storage.is_file(file)).collect(),
    };
    let mut found: Vec<Solution> = Vec::new();
    for file in files {
        let contents = storage.contents(&file)?;
        let fit = find_beside(contents.bytes(), grid, &dims).filter(|(_, _, b, _)| {
            // All blocks of a function file must have the same variables to be one set of attributes.
            b.iter().all(|block| block.variables == b[0].variables)
        });
        let Some((role, layout, blocks, end)) = fit else {
            let shown: Vec<_> = dims.iter().take(3).map(|d| format!("{d:?}")).collect();
            let wanted = format!("a solution or function file for {}", shown.join(", "));
            if named.is_some() {
                let found = format!("{} bytes that are none", contents.len());
                return Err(LoadError::invalid(&file, "content", found, wanted));
            }
            warnings.push(note(&name_of(path), format!("{} is not read: it is no {}", name_of(&file), &wanted[2..])));
            continue;
        };
        if end < contents.len() as u64 {
            let surplus = contents.len() as u64 - end;
            let zeros = contents.bytes()[end as usize..].iter().all(|b| *b == 0);
            // Old tapes are padded to whole blocks.
            if !zeros || surplus >= 4096 {
                warnings.push(note(&name_of(&file), format!("{surplus} bytes after the last block are not read")));
            }
        }
        found.push(Solution { contents, role, layout, blocks });
    }
    Ok(found)
}

/// Where the solutions of a grid may be.
fn names_beside(path: &Path) -> Vec<PathBuf> {
    let name = name_of(path);
    let mut names = Vec::new();
    if let Some((stem, _)) = name.rsplit_once('.') {
        names.extend(SOLUTIONS.iter().map(|end| format!("{stem}{end}")));
    }
    if let Some((before, after)) = name.rsplit_once("xyz")
        && !before.is_empty()
        && !before.ends_with('.')
    {
        names.extend(["q", "f"].map(|word| format!("{before}{word}{after}")));
    }
    names.retain(|n| *n != name);
    names.dedup();
    names.into_iter().map(|n| beside(path, &n)).collect()
}
