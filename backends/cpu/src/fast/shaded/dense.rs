//! Emission and absorption of a shape by its shader's program, for the sweep over all shapes.

use volact_core::{ActionError, resolve::ResolvedShape};
use volact_shaders::Entry;

use super::{
    Shader,
    batch::{Evaluator, ROWS, Rays, Worker},
    field::sixteen,
    rows::{Row, Rows},
    skip::{self, Skip},
};
use crate::fast::{
    dispatch,
    over::{Pixels, part_of},
    packet::{Cuts, Lanes, Packet},
    simd::{LANES, Unit},
    sweep::{
        Batches,
        gather::{self, Chunk},
        piece::Hit,
    },
    walk::{ALL, CHUNK, Counts},
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
        let brought = |evaluator: Evaluator<'a>| {
            let evaluator = if shader.is_lit() { evaluator.lit(shader) } else { evaluator };
            match &skip {
                Some(skip) => evaluator.with_values_of(skip.name),
                None => evaluator,
            }
        };
        let (medium, other) = match &shader.segment {
            Some(segment) => (of(Entry::Segment, segment), Some(place())),
            None => (brought(place()), None),
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
            worker.rows.push(Row::new(0, live, t, [self.thickness as f32; LANES]));
            if !at.run(rays, worker) {
                return;
            }
            let medium = [0, 1, 2, 3].map(|i| sixteen(worker.output(i), 0));
            let mut entries = [[0f32; 4]; LANES];
            dispatch::absorb(self.unit, &medium, self.thickness as f32, &mut entries);
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
            dispatch::absorb(self.unit, &medium, self.step as f32, &mut entries);
            for l in (0..LANES).filter(|l| row.live >> l & 1 == 0) {
                entries[l] = [0.0; 4];
            }
            take(row, &entries);
        }
    }

    /// Adds a row of whole segments of the chunk that begins with segment `first`, with values there.
    fn add(&self, rows: &mut Rows, first: i64, row: (usize, u32), value: Option<&[f32; LANES]>) {
        rows.push_even(row, (self.middle(first, row.0), first as f64 * self.step), self.step as f32, value);
    }

    /// The middle of a segment of the chunk that begins with segment `first`.
    fn middle(&self, first: i64, number: usize) -> f64 {
        ((first + number as i64) as f64 + 0.5) * self.step
    }

    /// Calls `add` with the rows of the chunk that begins with segment `first`, and their lanes;
    /// returns the next segment.
    fn all(
        &self,
        at: (&Packet, &Cuts),
        first: i64,
        done: u32,
        counts: &mut Counts,
        mut add: impl FnMut(usize, u32),
    ) -> i64 {
        let (cuts, end) = (at.1, first + CHUNK as i64);
        let place = |k: f64| (k as i64 - first).clamp(0, CHUNK as i64) as usize;
        // Lanes that begin and end at rows.
        let (mut begins, mut ends) = ([0u32; CHUNK + 1], [0u32; CHUNK + 1]);
        for l in (0..LANES).filter(|l| cuts.from[*l] < cuts.to[*l] && done >> l & 1 == 0) {
            begins[place(cuts.from[l])] |= 1 << l;
            ends[place(cuts.to[l])] |= 1 << l;
        }
        let mut live = 0;
        for row in 0..CHUNK {
            live = (live | begins[row]) & !ends[row];
            if live != 0 {
                counts.samples += u64::from(live.count_ones());
                add(row, live);
            }
        }
        let more = (0..LANES).any(|l| cuts.from[l] < cuts.to[l] && cuts.to[l] as i64 > end);
        if more { end } else { i64::MAX }
    }

    /// Draws rays on stretches where nothing else is, behind what they have seen.
    pub fn alone(
        &self,
        rays: Rays<'_>,
        stretches: &[Packet],
        (termination, threshold): (f32, f32),
        pixels: &mut Pixels,
        counts: &mut Counts,
    ) {
        let seen = [0, 1, 2, 3].map(|c| pixels.color.map(|color| color[c]));
        let mut sight = Sight { seen, depth: pixels.depth, threshold };
        let done = |sight: &Sight| (0..LANES).fold(0, |d, l| d | u32::from(1.0 - sight.seen[3][l] < termination) << l);
        self.medium.with(|worker| {
            let mut found = worker.found.take().unwrap_or_default();
            for packet in stretches {
                let cuts = packet.split(self.step);
                counts.lattice += cuts.count();
                self.cut(&cuts.front, done(&sight), worker, counts);
                match &self.skip {
                    Some(skip) => {
                        let before = done(&sight);
                        let values = self.medium.needs_only_values();
                        let mut take = |first: i64, found: &skip::Rows| {
                            if values && worker.rows.is_empty() {
                                self.lay_found(first, found, worker, &mut sight);
                                return done(&sight);
                            }
                            for (number, live, values) in found.iter() {
                                self.push((first, number, live), Some(values), rays, worker, &mut sight);
                            }
                            self.lay(rays, worker, &mut sight);
                            done(&sight)
                        };
                        let to = (&mut *found, &mut take as &mut skip::Take<'_>);
                        dispatch::visit(self.unit, skip, (packet, &cuts), self.step, before, to, counts);
                    }
                    None => self.chunks((packet, &cuts), rays, worker, &mut sight, counts, done),
                }
                self.cut(&cuts.back, done(&sight), worker, counts);
                self.lay(rays, worker, &mut sight);
            }
            worker.found = Some(found);
        });
        for (l, color) in pixels.color.iter_mut().enumerate() {
            *color = sight.seen.map(|row| row[l]);
        }
        pixels.depth = sight.depth;
    }

    /// Draws whole segments, chunk by chunk, all of them.
    fn chunks(
        &self,
        at: (&Packet, &Cuts),
        rays: Rays<'_>,
        worker: &mut Worker<'a>,
        sight: &mut Sight,
        counts: &mut Counts,
        done: impl Fn(&Sight) -> u32,
    ) {
        let [first, last] = at.1.whole().unwrap_or([0, 0]);
        let mut next = first;
        while next < last {
            let chunk = next.div_euclid(CHUNK as i64) * CHUNK as i64;
            next = self.all(at, chunk, done(sight), counts, |row, live| {
                self.push((chunk, row, live), None, rays, worker, sight);
            });
            self.lay(rays, worker, sight);
            if done(sight) & ALL == ALL {
                break;
            }
        }
    }

    /// Adds a row to a worker's, which are laid first where it has no more room.
    fn push(
        &self,
        (first, number, live): (i64, usize, u32),
        values: Option<&[f32; LANES]>,
        rays: Rays<'_>,
        worker: &mut Worker<'a>,
        sight: &mut Sight,
    ) {
        if worker.rows.len() == ROWS {
            self.lay(rays, worker, sight);
        }
        self.add(&mut worker.rows, first, (number, live), values);
    }

    /// Takes a cut segment of each ray that is not done.
    fn cut(&self, cut: &[[f64; 2]; LANES], done: u32, worker: &mut Worker<'a>, counts: &mut Counts) {
        let live = (0..LANES).fold(0, |live, l| live | u32::from(cut[l][0] < cut[l][1]) << l) & !done;
        if live != 0 {
            counts.lattice += u64::from(live.count_ones());
            counts.samples += u64::from(live.count_ones());
            let (middle, length) = (cut.map(|[a, b]| 0.5 * (a + b)), cut.map(|[a, b]| (b - a) as f32));
            worker.rows.push(Row::new(0, live, middle, length));
        }
    }

    /// Lays a worker's rows behind what was seen.
    fn lay(&self, rays: Rays<'_>, worker: &mut Worker<'a>, sight: &mut Sight) {
        if self.medium.run(rays, worker) {
            let (mut alphas, mut strips) = (std::mem::take(&mut worker.alphas), std::mem::take(&mut worker.strips));
            let (live, lengths) = (&mut strips.0, &mut strips.1);
            live.clear();
            lengths.clear();
            live.extend(worker.rows.iter().map(|row| row.live));
            lengths.extend(worker.rows.iter().map(Row::lengths));
            let place = |row: usize, l: usize| (worker.rows[row].t(l), worker.rows[row].length(l));
            self.composite((live, lengths), worker, sight, &mut alphas, place);
            (worker.alphas, worker.strips) = (alphas, strips);
        }
        worker.rows.clear();
    }

    /// Lays what a walk found in the chunk that begins with segment `first`.
    fn lay_found(&self, first: i64, found: &skip::Rows, worker: &mut Worker<'a>, sight: &mut Sight) {
        if self.medium.run_found(found, worker) {
            let mut alphas = std::mem::take(&mut worker.alphas);
            let (length, (live, _)) = (self.step as f32, found.parts());
            let place = |row: usize, _: usize| (self.middle(first, found.number(row)), length);
            self.composite((live, &[[length; LANES]]), worker, sight, &mut alphas, place);
            worker.alphas = alphas;
        }
    }

    /// Lays the media that a worker has; `place` says where a row's sample is in a lane, and for
    /// what length it stands.
    fn composite(
        &self,
        (live, lengths): (&[u32], &[[f32; LANES]]),
        worker: &Worker<'a>,
        sight: &mut Sight,
        alphas: &mut [[f32; LANES]],
        place: impl Fn(usize, usize) -> (f64, f32),
    ) {
        let medium = [0, 1, 2, 3].map(|c| worker.output(c));
        let (before, threshold) = (sight.seen[3], sight.threshold);
        dispatch::composite(self.unit, live, lengths, &medium, &mut sight.seen, alphas);
        for l in (0..LANES).filter(|l| before[*l] < threshold && sight.seen[3][*l] >= threshold) {
            let rows = (0..live.len()).filter(|row| live[*row] >> l & 1 == 1);
            sight.depth[l] = reached(before[l], threshold, rows.map(|row| (place(row, l), alphas[row][l])));
        }
    }
}

/// What sixteen rays have seen, by number and lane.
struct Sight {
    seen: [[f32; LANES]; 4],
    depth: Lanes,
    threshold: f32,
}

/// Where a lane reached the threshold among rows, given by place, length and opacity; at the end of
/// the last one where rounding tells otherwise.
fn reached(mut opacity: f32, threshold: f32, rows: impl Iterator<Item = ((f64, f32), f32)>) -> f64 {
    let mut end = f64::INFINITY;
    for ((t, length), alpha) in rows {
        let (length, after) = (f64::from(length), opacity + (1.0 - opacity) * alpha);
        let start = t - 0.5 * length;
        if after >= threshold {
            return start + f64::from(part_of(opacity, alpha, threshold)) * length;
        }
        (opacity, end) = (after, start + length);
    }
    end
}

impl Batches for Dense<'_> {
    fn entries(&self, rays: Rays<'_>, cut: &[[f64; 2]; LANES], done: u32, counts: &mut Counts) -> (gather::Row, u32) {
        let (mut found, mut live) = ([[0f32; 4]; LANES], 0);
        self.medium.with(|worker| {
            self.cut(cut, done, worker, counts);
            live = worker.rows.first().map_or(0, |row| row.live);
            self.entries(rays, worker, |_, entries| found = *entries);
        });
        (found, live)
    }

    fn gather(
        &self,
        rays: Rays<'_>,
        at: (&Packet, &Cuts),
        first: i64,
        done: u32,
        chunk: &mut Chunk,
        counts: &mut Counts,
    ) -> i64 {
        self.medium.with(|worker| {
            let next = match &self.skip {
                Some(skip) => {
                    let mut found = worker.found.take().unwrap_or_default();
                    let next = dispatch::visible(self.unit, skip, at, (self.step, first), done, &mut found, counts);
                    for (number, live, values) in found.iter() {
                        self.add(&mut worker.rows, first, (number, live), Some(values));
                    }
                    worker.found = Some(found);
                    next
                }
                None => self.all(at, first, done, counts, |number, live| {
                    self.add(&mut worker.rows, first, (number, live), None);
                }),
            };
            debug_assert!(worker.rows.len() <= ROWS);
            self.entries(rays, worker, |row, entries| chunk.put(row.number, entries));
            next
        })
    }
}
