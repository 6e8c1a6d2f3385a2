//! Emission and absorption of a shape by its shader's program, for the sweep over all shapes.

use volact_core::{ActionError, resolve::ResolvedShape};
use volact_shaders::Entry;

use super::{
    Shader,
    batch::{Evaluator, ROWS, Rays, Row, Worker},
    field::sixteen,
    skip::Skip,
};
use crate::fast::{
    dispatch,
    packet::{Cuts, Lanes, Packet},
    simd::{LANES, Unit},
    sweep::{
        Batches,
        gather::{self, Chunk},
        piece::Hit,
    },
    walk::{CHUNK, Counts},
};

/// A shape's segments as its program shows them.
#[derive(Debug)]
pub struct Dense<'a> {
    /// The medium at a place, or that of a segment by its ends.
    medium: Evaluator<'a>,
    /// The medium at a place, for planes.
    place: Option<Evaluator<'a>>,
    skip: Option<Skip<'a>>,
    step: f64,
    /// The length of which a plane shows the opacity.
    thickness: f64,
    unit: Unit,
}

impl<'a> Dense<'a> {
    /// A shape of which the program was compiled.
    pub fn new(shape: &'a ResolvedShape, shader: &'a Shader, skip: Option<Skip<'a>>, step: f64, unit: Unit) -> Self {
        let of = |entry, kernel| Evaluator::new(shape, shader, (entry, kernel), unit);
        let place = || of(Entry::Shade, &shader.shade);
        let (medium, other) = match &shader.segment {
            Some(segment) => (of(Entry::Segment, segment), Some(place())),
            None => (place(), None),
        };
        let sliced = shape.state.geometry.slices().is_some();
        let thickness = shape.float("unit_distance").unwrap_or(1.0);
        Self { medium, place: other.filter(|_| sliced), skip, step, thickness, unit }
    }

    /// The first failure of the program.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        self.medium.check()?;
        self.place.as_ref().map_or(Ok(()), Evaluator::check)
    }

    /// What planes show that rays meet at places: one of each lane in `live`.
    pub fn planes(&self, rays: Rays<'_>, (t, live): (Lanes, u32), opaque: bool, hits: &mut [Vec<Hit>; LANES]) {
        let at = self.place.as_ref().unwrap_or(&self.medium);
        at.with(|worker| {
            worker.rows.push(Row::new(0, live, t, [self.thickness; LANES]));
            if !at.run(rays, worker) {
                return;
            }
            let medium = [0, 1, 2, 3].map(|i| sixteen(worker.output(i), 0));
            let mut entries = [[0f32; 4]; LANES];
            dispatch::absorb(self.unit, &medium, self.thickness, &mut entries);
            for l in (0..LANES).filter(|l| live >> l & 1 == 1) {
                // Opaque planes have the medium's colour, and their own opacity.
                let [r, g, b, extinction] = medium.map(|row| row[l]);
                let known = ![r, g, b, extinction].iter().any(|v| v.is_nan());
                let color = if opaque && known { [r, g, b, 1.0] } else { entries[l] };
                hits[l].extend((color[3] > 0.0).then_some(Hit { t: t[l], color: color.map(f64::from) }));
            }
        });
    }

    /// What whole segments of the media of a worker's rows add.
    fn entries(&self, rays: Rays<'_>, worker: &mut Worker<'a>, mut take: impl FnMut(&Row, &gather::Row)) {
        if !self.medium.run(rays, worker) {
            return;
        }
        for (i, row) in worker.rows.iter().enumerate() {
            let medium = [0, 1, 2, 3].map(|c| sixteen(worker.output(c), i * LANES));
            let mut entries = [[0f32; 4]; LANES];
            dispatch::absorb(self.unit, &medium, self.step, &mut entries);
            for l in (0..LANES).filter(|l| row.live >> l & 1 == 0) {
                entries[l] = [0.0; 4];
            }
            take(row, &entries);
        }
    }
}

impl Batches for Dense<'_> {
    fn entries(
        &self,
        rays: Rays<'_>,
        cut: &[[f64; 2]; LANES],
        done: u32,
        counts: &mut Counts,
    ) -> (gather::Row, u32) {
        let live = (0..LANES).fold(0, |live, l| live | u32::from(cut[l][0] < cut[l][1]) << l) & !done;
        let mut found = [[0f32; 4]; LANES];
        if live != 0 {
            counts.lattice += u64::from(live.count_ones());
            counts.samples += u64::from(live.count_ones());
            self.medium.with(|worker| {
                let (middle, length) = (cut.map(|[a, b]| 0.5 * (a + b)), cut.map(|[a, b]| b - a));
                worker.rows.push(Row::new(0, live, middle, length));
                self.entries(rays, worker, |_, entries| found = *entries);
            });
        }
        (found, live)
    }

    fn gather(
        &self,
        rays: Rays<'_>,
        (packet, cuts): (&Packet, &Cuts),
        first: i64,
        done: u32,
        chunk: &mut Chunk,
        counts: &mut Counts,
    ) -> i64 {
        self.medium.with(|worker| {
            let mut add = |row: usize, live: u32| {
                let t = (first + row as i64) as f64 + 0.5;
                worker.rows.push(Row::new(row, live, [t * self.step; LANES], [self.step; LANES]));
                counts.samples += u64::from(live.count_ones());
            };
            let next = match &self.skip {
                Some(skip) => skip.rows((packet, cuts), (self.step, first), done, add),
                None => {
                    let from = cuts.from.map(|k| (k as i64 - first).clamp(0, CHUNK as i64) as usize);
                    let to = cuts.to.map(|k| (k as i64 - first).clamp(0, CHUNK as i64) as usize);
                    for row in 0..CHUNK {
                        let inside = |l: usize| from[l] <= row && row < to[l];
                        let live = (0..LANES).fold(0, |live, l| live | u32::from(inside(l)) << l) & !done;
                        if live != 0 {
                            add(row, live);
                        }
                    }
                    let end = first + CHUNK as i64;
                    let more = (0..LANES).any(|l| cuts.from[l] < cuts.to[l] && cuts.to[l] as i64 > end);
                    if more { end } else { i64::MAX }
                }
            };
            debug_assert!(worker.rows.len() <= ROWS);
            self.entries(rays, worker, |row, entries| chunk.put(row.number, entries));
            next
        })
    }
}
