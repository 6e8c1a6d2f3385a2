//! Which samples of a program may be seen, as far as values tell, and the values there.
#![expect(unsafe_code, reason = "a kernel of a vector unit")]

use std::marker::PhantomData;

use crate::fast::{
    bounds::Emptiness,
    classify::Units,
    fetch::{Fetch, Voxels},
    over::clear_around,
    packet::{Cuts, Packet},
    simd::{LANES, Simd, Unit},
    walk::{ALL, CHUNK, Counts, Kernel, Positions, walk, walk_chunk},
};

/// A volume along which rays are followed, for a program that depends on its values.
#[derive(Clone, Copy, Debug)]
pub struct Skip<'a> {
    /// The volume's parameter.
    pub name: &'a str,
    /// The volume.
    pub voxels: Voxels<'a>,
    /// From what is stored to data units.
    pub units: Units,
    /// Its blocks in which the program is transparent.
    pub empty: Option<&'a Emptiness>,
    /// Values in data units below the first and above the second of which it is.
    pub seen: [f32; 2],
    /// The vector unit.
    pub unit: Unit,
}

/// Takes the rows of the chunk that begins with a segment; returns the lanes that are done.
pub type Take<'t> = dyn FnMut(i64, &Rows) -> u32 + 't;

/// Rows of a chunk, with the lanes that count and their values.
#[derive(Debug)]
pub struct Rows {
    count: usize,
    rows: [u8; CHUNK],
    live: [u32; CHUNK],
    values: [[f32; LANES]; CHUNK],
}

impl Default for Rows {
    fn default() -> Self {
        Self { count: 0, rows: [0; CHUNK], live: [0; CHUNK], values: [[0.0; LANES]; CHUNK] }
    }
}

impl Rows {
    /// By row: the lanes that count, and values.
    pub fn parts(&self) -> (&[u32], &[[f32; LANES]]) {
        (&self.live[..self.count], &self.values[..self.count])
    }

    /// Which row of the chunk is the one of an index.
    pub fn number(&self, index: usize) -> usize {
        usize::from(self.rows[index])
    }

    /// The rows, their lanes, and values there.
    pub fn iter(&self) -> impl Iterator<Item = (usize, u32, &[f32; LANES])> {
        let rows = self.rows[..self.count].iter().zip(&self.live).zip(&self.values);
        rows.map(|((row, live), values)| (usize::from(*row), *live, values))
    }
}

/// Visits the rows of a packet that may be seen, chunk by chunk.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it; `F` is the voxels' access.
#[inline(always)]
pub unsafe fn visit<S: Simd, F: Fetch>(
    skip: &Skip<'_>,
    (packet, cuts): (&Packet, &Cuts),
    step: f64,
    done: u32,
    (found, take): (&mut Rows, &mut Take<'_>),
    counts: &mut Counts,
) {
    found.count = 0;
    let mut kernel = Collect { voxels: PhantomData::<F>, skip, found, done, fresh: true, take: Some(take) };
    let at = (&skip.voxels, packet, cuts);
    // SAFETY: the caller's promises.
    unsafe { walk::<S, _>(&mut kernel, at, step, skip.empty.map(|e| e.blocks), done, counts) }
}

/// Finds the rows of a chunk that may be seen.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it; `F` is the voxels' access.
#[inline(always)]
pub unsafe fn visible<S: Simd, F: Fetch>(
    skip: &Skip<'_>,
    (packet, cuts): (&Packet, &Cuts),
    place: (f64, i64),
    done: u32,
    found: &mut Rows,
    counts: &mut Counts,
) -> i64 {
    found.count = 0;
    let mut kernel = Collect { voxels: PhantomData::<F>, skip, found, done, fresh: true, take: None };
    let at = (&skip.voxels, packet, cuts);
    // SAFETY: the caller's promises.
    unsafe { walk_chunk::<S, _>(&mut kernel, at, place, skip.empty.map(|e| e.blocks), done, counts) }
}

struct Collect<'a, 't, F> {
    voxels: PhantomData<F>,
    skip: &'a Skip<'a>,
    found: &'a mut Rows,
    done: u32,
    /// Whether no chunk has ended.
    fresh: bool,
    /// Whom the rows of each chunk go to.
    take: Option<&'a mut Take<'t>>,
}

impl<S: Simd, F: Fetch> Kernel<S> for Collect<'_, '_, F> {
    const AT: f64 = 0.5;

    #[inline(always)]
    unsafe fn start(&mut self, _: Positions<'_, S>) {}

    #[inline(always)]
    unsafe fn take(&mut self, (base, p): Positions<'_, S>, live: u32, row: usize) {
        let (skip, found) = (self.skip, &mut *self.found);
        let to = found.count;
        // SAFETY: the caller's promises.
        unsafe {
            let mut value = F::fetch::<S>(&skip.voxels, base, p);
            if !skip.units.are_stored() {
                S::store(value, &mut found.values[to]);
                skip.units.apply(&mut found.values[to]);
                value = S::load(&found.values[to]);
            }
            let [low, high] = skip.seen;
            let dark = S::lt_bits(value, S::splat(low)) | S::lt_bits(S::splat(high), value);
            if (dark | !live) & ALL == ALL {
                return;
            }
            S::store(value, &mut found.values[to]);
        }
        (found.rows[to], found.live[to]) = (row as u8, live);
        found.count += 1;
    }

    #[inline(always)]
    unsafe fn end(&mut self, first: i64) -> u32 {
        // What the caller had before counts from the first chunk's end on, whatever is skipped.
        if let Some(take) = self.take.as_mut().filter(|_| self.found.count > 0 || self.fresh) {
            self.done = take(first, self.found);
            (self.found.count, self.fresh) = (0, false);
        }
        self.done
    }

    #[inline(always)]
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]) {
        // SAFETY: the caller's promises.
        unsafe { clear_around::<S>(self.skip.empty, block, index) }
    }
}
