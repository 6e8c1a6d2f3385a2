//! How a PLOT3D file is written, found by arithmetic: its size must be exactly what its
//! dimensions make of it.

use std::path::Path;

use volact_core::{LoadError, LoadOptions};

use crate::{
    format::{flag_given, text},
    payload::ByteOrder,
};

/// More blocks than anybody has.
const MOST_BLOCKS: u64 = 1 << 20;

/// The ways in which files differ. Those of a grid and of its solution may differ, too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) order: ByteOrder,
    /// Whether each record stands between its lengths, as Fortran writes them.
    pub(super) records: bool,
    /// Whether a number of blocks comes first.
    pub(super) multi: bool,
    /// Whether numbers are of 64 bits.
    pub(super) double: bool,
    /// Whether each vertex of a grid has a flag that tells whether it counts.
    pub(super) iblank: bool,
}

impl Layout {
    /// All layouts that the options leave open.
    pub(super) fn all(options: &LoadOptions) -> Vec<Self> {
        let either = |given: Option<bool>| given.map_or(vec![false, true], |g| vec![g]);
        let big = either(text(options, "byte_order").map(|w| w == "big"));
        let double = either(text(options, "precision").map(|w| w == "double"));
        let [records, multi, iblank] = ["records", "multi", "iblank"].map(|name| either(flag_given(options, name)));
        let mut all = Vec::new();
        for (&big, &records) in big.iter().flat_map(|b| records.iter().map(move |r| (b, r))) {
            for (&multi, &double) in multi.iter().flat_map(|m| double.iter().map(move |d| (m, d))) {
                let order = ByteOrder::big_if(big);
                all.extend(iblank.iter().map(|&iblank| Self { order, records, multi, double, iblank }));
            }
        }
        all
    }

    /// Bytes of a number.
    pub(super) fn size(self) -> u64 {
        if self.double { 8 } else { 4 }
    }

    /// Bytes of a grid's block of `vertices` vertices, without the lengths around it.
    fn grid_block(self, vertices: u64) -> u64 {
        vertices.saturating_mul(3 * self.size() + if self.iblank { 4 } else { 0 })
    }

    /// The layout in words.
    pub(super) fn describe(self) -> String {
        let order = if self.order == ByteOrder::Big { "big-endian" } else { "little-endian" };
        let blocks = if self.multi { "several blocks" } else { "one block" };
        let records = if self.records { ", with record marks" } else { "" };
        let iblank = if self.iblank { ", with iblank" } else { "" };
        format!("{order} {} of {blocks}{records}{iblank}", if self.double { "f64" } else { "f32" })
    }
}

/// What kind of file it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    /// x, y and z of every vertex.
    Grid,
    /// Density, momentum and energy.
    Solution,
    /// Any number of variables.
    Function,
}

/// A block of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) dims: [u64; 3],
    /// Arrays of numbers, one a vertex each.
    pub(super) variables: u64,
    /// Where the arrays begin.
    pub(super) start: u64,
}

impl Block {
    pub(super) fn vertices(&self) -> u64 {
        self.dims.iter().fold(1u64, |n, d| n.saturating_mul(*d))
    }
}

/// The blocks of a file in a layout, and where the last ends; `None` if its head contradicts the
/// layout. The bytes of the blocks need not be there.
pub(super) fn blocks(bytes: &[u8], layout: Layout, role: Role) -> Option<(Vec<Block>, u64)> {
    let mut cursor = Cursor { bytes, at: 0, layout };
    let count = if layout.multi { cursor.record(4)?.first().copied()? } else { 1 };
    if count == 0 || count > MOST_BLOCKS {
        return None;
    }
    let columns = if role == Role::Function { 4 } else { 3 };
    let sizes = cursor.record(count.checked_mul(4 * columns)?)?;
    let mut all = Vec::with_capacity(sizes.len() / columns as usize);
    for row in sizes.chunks_exact(columns as usize) {
        if row.iter().any(|n| !(1..=i32::MAX as u64).contains(n)) {
            return None;
        }
        let variables = match role {
            Role::Grid => 3,
            Role::Solution => 5,
            Role::Function => row[3],
        };
        all.push(Block { dims: [row[0], row[1], row[2]], variables, start: 0 });
    }
    for block in &mut all {
        if role == Role::Solution {
            // Mach number, angle of attack, Reynolds number and time.
            cursor.pass(4 * layout.size())?;
        }
        let bytes = match role {
            Role::Grid => layout.grid_block(block.vertices()),
            _ => block.vertices().saturating_mul(block.variables).saturating_mul(layout.size()),
        };
        block.start = cursor.at + if layout.records { 4 } else { 0 };
        cursor.pass(bytes)?;
    }
    Some((all, cursor.at))
}

/// A walk through a file's records. Beyond the end of the file, lengths are believed.
struct Cursor<'a> {
    bytes: &'a [u8],
    at: u64,
    layout: Layout,
}

impl Cursor<'_> {
    fn integer(&self, at: u64) -> Option<u64> {
        let raw = self.bytes.get(usize::try_from(at).ok()?..)?.get(..4)?.try_into().ok()?;
        Some(u64::from(match self.layout.order {
            ByteOrder::Big => u32::from_be_bytes(raw),
            ByteOrder::Little => u32::from_le_bytes(raw),
        }))
    }

    /// The integers of a record of so many bytes.
    fn record(&mut self, bytes: u64) -> Option<Vec<u64>> {
        let start = self.at + if self.layout.records { 4 } else { 0 };
        if start.checked_add(bytes)? > self.bytes.len() as u64 {
            return None;
        }
        let values = (0..bytes / 4).map(|n| self.integer(start + 4 * n)).collect();
        self.pass(bytes)?;
        values
    }

    /// Passes a record of so many bytes; `None` if the lengths around it are others.
    fn pass(&mut self, bytes: u64) -> Option<()> {
        if !self.layout.records {
            self.at = self.at.checked_add(bytes)?;
            return Some(());
        }
        let after = self.at.checked_add(4)?.checked_add(bytes)?;
        for mark in [self.at, after] {
            if mark + 4 <= self.bytes.len() as u64 && self.integer(mark) != Some(bytes) {
                return None;
            }
        }
        self.at = after.checked_add(4)?;
        Some(())
    }
}

/// The one layout in which a grid has exactly the size of its file.
///
/// # Errors
/// If there is none, or more than one.
pub(super) fn find_grid(
    path: &Path,
    bytes: &[u8],
    options: &LoadOptions,
) -> Result<(Layout, Vec<Block>, u64), LoadError> {
    let length = bytes.len() as u64;
    let open = Layout::all(options);
    let fits = |l: &Layout| blocks(bytes, *l, Role::Grid).map(|(b, end)| (*l, b, end));
    let mut known: Vec<_> = open.iter().filter_map(fits).collect();
    // Lengths around records that are right are no chance. Without them, the length of the first
    // record and what stands in it can pass for dimensions.
    if known.iter().any(|(layout, ..)| layout.records) {
        known.retain(|(layout, ..)| layout.records);
    }
    let mut exact: Vec<_> = known.iter().filter(|(_, _, end)| *end == length).cloned().collect();
    match exact.len() {
        1 => return Ok(exact.remove(0)),
        0 => {}
        _ => {
            let found: Vec<_> = exact.iter().map(|(layout, ..)| layout.describe()).collect();
            let wanted = "one of them; name it with byte_order, precision, records, multi or iblank";
            return Err(LoadError::invalid(path, "layout", format!("any of {}", found.join("; ")), wanted));
        }
    }
    // Named in full, a layout may leave bytes over.
    if let ([_], Some(only)) = (&open[..], known.iter().find(|(_, _, end)| *end <= length)) {
        return Ok(only.clone());
    }
    let plausible = |b: &[Block]| b.iter().all(|b| b.dims.iter().all(|n| *n <= 1 << 16));
    let close: Vec<_> = known.iter().filter(|(_, b, _)| plausible(b)).collect();
    let wanted = if close.is_empty() {
        "a grid of PLOT3D: dimensions, then x, y and z of all vertices".to_owned()
    } else {
        let sizes = close.iter().take(8).map(|(layout, b, end)| {
            let dims: Vec<_> = b.iter().take(3).map(|b| format!("{:?}", b.dims)).collect();
            format!("{end} for {} of {}", dims.join(", "), layout.describe())
        });
        sizes.collect::<Vec<_>>().join("; ")
    };
    Err(LoadError::invalid(path, "size", format!("{length} bytes"), wanted))
}

/// The layout in which a file beside a grid has its dimensions: exactly as long as its blocks, or
/// else longer. The grid's own layout comes first.
pub(super) fn find_beside(bytes: &[u8], grid: Layout, dims: &[[u64; 3]]) -> Option<(Role, Layout, Vec<Block>, u64)> {
    let mut layouts = Layout::all(&LoadOptions::new());
    layouts.retain(|l| !l.iblank);
    layouts.sort_by_key(|l| Layout { iblank: grid.iblank, ..*l } != grid);
    let fits = |role| {
        let layouts = layouts.clone();
        layouts.into_iter().filter_map(move |layout| {
            let (all, end) = blocks(bytes, layout, role)?;
            let same = all.iter().map(|b| b.dims).eq(dims.iter().copied());
            (same && end <= bytes.len() as u64).then_some((role, layout, all, end))
        })
    };
    let all: Vec<_> = fits(Role::Solution).chain(fits(Role::Function)).collect();
    let exact = all.iter().position(|(.., end)| *end == bytes.len() as u64);
    all.into_iter().nth(exact.unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(layout: Layout, dims: &[[u32; 3]]) -> Vec<u8> {
        let mut out = Vec::new();
        let record = |body: Vec<u8>, out: &mut Vec<u8>| {
            let mark = match layout.order {
                ByteOrder::Big => (body.len() as u32).to_be_bytes(),
                ByteOrder::Little => (body.len() as u32).to_le_bytes(),
            };
            let marks: &[u8] = if layout.records { &mark } else { &[] };
            out.extend([marks, &body, marks].concat());
        };
        let word = |n: u32| match layout.order {
            ByteOrder::Big => n.to_be_bytes(),
            ByteOrder::Little => n.to_le_bytes(),
        };
        if layout.multi {
            record(word(dims.len() as u32).to_vec(), &mut out);
        }
        record(dims.iter().flatten().flat_map(|n| word(*n)).collect(), &mut out);
        for d in dims {
            let n = d.iter().product::<u32>() as usize;
            record(vec![7; n * (3 * layout.size() as usize + if layout.iblank { 4 } else { 0 })], &mut out);
        }
        out
    }

    /// Every layout is told from all others by the size alone.
    #[test]
    fn every_layout_is_found() {
        for layout in Layout::all(&LoadOptions::new()) {
            let dims: &[[u32; 3]] = if layout.multi { &[[5, 4, 3], [2, 3, 4]] } else { &[[5, 4, 3]] };
            let bytes = grid(layout, dims);
            let (found, blocks, end) = find_grid(Path::new("g"), &bytes, &LoadOptions::new()).unwrap();
            assert_eq!((found, end), (layout, bytes.len() as u64));
            let sizes: Vec<_> = dims.iter().map(|d| d.map(u64::from)).collect();
            assert_eq!(blocks.iter().map(|b| b.dims).collect::<Vec<_>>(), sizes);
            let error = find_grid(Path::new("g"), &bytes[..bytes.len() - 1], &LoadOptions::new()).unwrap_err();
            let error = error.to_string();
            assert!(error.contains(&format!("{} for [5, 4, 3]", bytes.len())), "{error}");
        }
    }
}
