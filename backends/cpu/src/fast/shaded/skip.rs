//! Which samples of a program may be seen, where that is known from values alone.
#![expect(unsafe_code, reason = "a kernel of a vector unit")]

use crate::fast::{
    bounds::Emptiness,
    dispatch,
    fetch::Voxels,
    over::clear_around,
    packet::{Cuts, Packet},
    simd::{Simd, Unit},
    walk::{Counts, Kernel, Positions, walk_chunk},
};

/// Blocks of a volume in which a program is transparent.
#[derive(Clone, Copy, Debug)]
pub struct Skip<'a> {
    /// The volume.
    pub voxels: Voxels<'a>,
    /// Its blocks.
    pub empty: &'a Emptiness,
    /// The vector unit.
    pub unit: Unit,
}

impl Skip<'_> {
    /// Calls `add` with the rows of the chunk that begins with segment `first`, and their lanes, in
    /// which there may be something; returns the next segment in which there may be something.
    pub fn rows(
        &self,
        at: (&Packet, &Cuts),
        (step, first): (f64, i64),
        done: u32,
        mut add: impl FnMut(usize, u32),
    ) -> i64 {
        let mut found = Rows::default();
        let next = dispatch::visible(self.unit, self, at, (step, first), done, &mut found);
        found.list.iter().take(found.count).for_each(|(row, live)| add(usize::from(*row), *live));
        next
    }
}

/// Rows of a chunk, with the lanes that count.
#[derive(Debug, Default)]
pub struct Rows {
    count: usize,
    list: [(u8, u32); crate::fast::walk::CHUNK],
}

/// Finds the rows of a chunk that may be seen.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn visible<S: Simd>(
    skip: &Skip<'_>,
    (packet, cuts): (&Packet, &Cuts),
    place: (f64, i64),
    done: u32,
    found: &mut Rows,
) -> i64 {
    let mut counts = Counts::default();
    let mut kernel = Collect { empty: skip.empty, found };
    let at = (&skip.voxels, packet, cuts);
    // SAFETY: the caller's promises.
    unsafe { walk_chunk::<S, _>(&mut kernel, at, place, Some(skip.empty.blocks), done, &mut counts) }
}

struct Collect<'a> {
    empty: &'a Emptiness,
    found: &'a mut Rows,
}

impl<S: Simd> Kernel<S> for Collect<'_> {
    const AT: f64 = 0.5;

    #[inline(always)]
    unsafe fn start(&mut self, _: Positions<'_, S>) {}

    #[inline(always)]
    unsafe fn take(&mut self, _: Positions<'_, S>, live: u32, row: usize) {
        if live != 0 {
            self.found.list[self.found.count] = (row as u8, live);
            self.found.count += 1;
        }
    }

    #[inline(always)]
    unsafe fn end(&mut self, _: i64) -> u32 {
        0
    }

    #[inline(always)]
    unsafe fn clear(&self, block: [S::F; 3], index: S::I) -> (u32, [S::F; 3], [S::F; 3]) {
        // SAFETY: the caller's promises.
        unsafe { clear_around::<S>(Some(self.empty), block, index) }
    }
}
