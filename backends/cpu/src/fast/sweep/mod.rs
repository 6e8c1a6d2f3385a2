//! Shapes that rays meet at the same place, and hits inside them.
//!
//! Chunk by chunk of the lattice each shape's segments are classified for all rays at once, as if
//! it were alone ([`gather`]), and put together ([`merge`]). Segments that are cut, or in which
//! there is a hit, are put together ray by ray in f64 ([`lane`]), as are the cells of meshes that
//! carry numbers, which know no lattice. Shapes are taken by their identity and not in the order
//! of drawing, and rays end only at the ends of chunks.

pub mod gather;
pub mod lane;
pub mod merge;
pub mod piece;

use super::{
    bent::Bent,
    dispatch,
    over::{Job, Pixels, entries},
    packet::{Cuts, Packet},
    shaded::batch::Rays,
    simd::{LANES, Unit},
    stretches::Stretches,
    walk::{ALL, CHUNK, Counts},
};
use gather::{Chunk, Row};
use lane::Lane;
use merge::{Rows, Sights};
use piece::{Hit, Piece, Sight};

/// A shape on the lattice along sixteen rays.
#[derive(Clone, Copy, Debug)]
pub struct Layer<'a> {
    /// What is seen of it.
    pub look: Look<'a>,
    /// The rays in sample space.
    pub packet: &'a Packet,
    /// Where they are inside.
    pub stretches: &'a Stretches,
}

/// What is seen of a shape.
#[derive(Clone, Copy, Debug)]
pub enum Look<'a> {
    /// Voxels through a table.
    Voxels {
        /// What its kernel needs.
        job: &'a Job<'a>,
        /// The way through sample space, where it is not straight.
        bent: Option<&'a Bent>,
    },
    /// What is evaluated in batches.
    Shaded {
        /// What evaluates.
        shaded: &'a (dyn Batches + 'a),
        /// The rays as programs see them.
        rays: Rays<'a>,
    },
}

/// What gives segments' colour and opacity at places of the world, a batch at once.
pub trait Batches: std::fmt::Debug {
    /// What whole segments would add by what cut segments hold, and the lanes in which there is
    /// one to take.
    fn entries(&self, rays: Rays<'_>, cut: &[[f64; 2]; LANES], done: u32, counts: &mut Counts) -> (Row, u32);

    /// Gathers the whole segments of one stretch in the chunk that begins with segment `first`;
    /// returns the next segment in which there may be something.
    fn gather(
        &self,
        rays: Rays<'_>,
        at: (&Packet, &Cuts),
        first: i64,
        done: u32,
        chunk: &mut Chunk,
        counts: &mut Counts,
    ) -> i64;
}

/// What sixteen rays meet.
#[derive(Debug)]
pub struct Scene<'a> {
    /// Voxels on the lattice, in the order in which sums are made.
    pub layers: Vec<Layer<'a>>,
    /// Pieces of meshes, by lane, in order of their beginnings.
    pub pieces: &'a [Vec<Piece>; LANES],
    /// Hits by lane, in order.
    pub hits: &'a [Vec<Hit>; LANES],
    /// Lanes to draw.
    pub active: u32,
    /// The lattice's step.
    pub step: f64,
    /// Rays end where less than this is left to see.
    pub termination: f32,
    /// The opacity at which depth is taken.
    pub threshold: f32,
}

/// One stretch of each ray through a layer.
struct Walk {
    layer: usize,
    packet: Packet,
    cuts: Cuts,
    /// The next segment in which there may be something.
    next: i64,
}

/// A cut segment at the end of a stretch.
#[derive(Clone, Copy)]
struct Cut {
    k: i64,
    piece: Piece,
}

/// What is left of each lane's lists.
#[derive(Default)]
struct Left {
    cuts: usize,
    pieces: usize,
    hits: usize,
}

/// Draws sixteen rays behind what they have seen.
pub fn draw(unit: Unit, scene: &Scene<'_>, pixels: &mut Pixels, counts: &mut Counts) {
    let mut sweep = Sweep::new(unit, scene, pixels, counts);
    let mut behind = f64::NEG_INFINITY;
    for [first, last] in sweep.ranges() {
        let [start, end] = [first, last].map(|chunk| (chunk * CHUNK as i64) as f64 * scene.step);
        sweep.outside(behind, start);
        behind = end;
        for chunk in first..last {
            if sweep.done | !scene.active & ALL == ALL {
                break;
            }
            sweep.chunk(chunk * CHUNK as i64, counts);
        }
    }
    sweep.outside(behind, f64::INFINITY);
    sweep.finish(pixels);
}

struct Sweep<'a> {
    unit: Unit,
    scene: &'a Scene<'a>,
    walks: Vec<Walk>,
    chunks: Vec<Chunk>,
    cuts: [Vec<Cut>; LANES],
    left: [Left; LANES],
    sights: Sights,
    done: u32,
    lane: Lane,
}

impl<'a> Sweep<'a> {
    fn new(unit: Unit, scene: &'a Scene<'a>, pixels: &Pixels, counts: &mut Counts) -> Self {
        let color = [0, 1, 2, 3].map(|c| pixels.color.map(|p| p[c]));
        let reached = (0..LANES).fold(0, |r, l| r | u32::from(color[3][l] >= scene.threshold) << l);
        let sights = Sights { color, depth: pixels.depth, reached, threshold: scene.threshold };
        let mut sweep = Self {
            unit,
            scene,
            walks: Vec::new(),
            chunks: vec![Chunk::default(); scene.layers.len()],
            cuts: Default::default(),
            left: Default::default(),
            sights,
            done: pixels.done(scene.termination),
            lane: Lane::default(),
        };
        for layer in 0..scene.layers.len() {
            sweep.cut(layer, counts);
        }
        // Shapes come in order, so that a stable sort leaves them so.
        sweep.cuts.iter_mut().for_each(|cuts| cuts.sort_by_key(|c| c.k));
        sweep
    }

    /// Cuts a layer's stretches by the lattice.
    fn cut(&mut self, layer: usize, counts: &mut Counts) {
        let Layer { look, packet, stretches } = self.scene.layers[layer];
        for span in stretches.spans() {
            let packet = packet.within(span);
            let cuts = packet.split(self.scene.step);
            counts.lattice += cuts.count();
            for ends in [&cuts.front, &cuts.back] {
                let (entries, wanted) = match look {
                    Look::Voxels { job, bent: Some(bent) } => bent.entries(job, ends, self.done, counts),
                    Look::Voxels { job, bent: None } => entries(job, &packet, ends, self.done, counts),
                    Look::Shaded { shaded, rays } => shaded.entries(rays, ends, self.done, counts),
                };
                for l in (0..LANES).filter(|l| wanted >> l & 1 == 1 && entries[*l][3] > 0.0) {
                    let k = (0.5 * (ends[l][0] + ends[l][1]) / self.scene.step).floor() as i64;
                    self.cuts[l].push(Cut { k, piece: even(ends[l], &entries[l], self.scene.step) });
                }
            }
            let next = cuts.whole().map_or(i64::MAX, |[first, _]| first);
            self.walks.push(Walk { layer, packet, cuts, next });
        }
    }

    /// Chunks in which layers have segments: runs of them, each from a first one to one after the
    /// last. They do not depend on what is skipped.
    fn ranges(&self) -> Vec<[i64; 2]> {
        let whole = self.walks.iter().filter_map(|w| w.cuts.whole()).map(|[a, b]| [a, b - 1]);
        let cut = self.cuts.iter().flatten().map(|c| [c.k, c.k]);
        let chunk = |k: i64| k.div_euclid(CHUNK as i64);
        let mut runs: Vec<_> = whole.chain(cut).map(|[a, b]| [chunk(a), chunk(b) + 1]).collect();
        runs.sort_unstable();
        runs.dedup_by(|next, last| {
            let joined = next[0] <= last[1];
            last[1] = if joined { last[1].max(next[1]) } else { last[1] };
            joined
        });
        runs
    }

    /// Adds one chunk.
    fn chunk(&mut self, first: i64, counts: &mut Counts) {
        self.gather(first, counts);
        let step = self.scene.step;
        let ends = [first as f64 * step, (first + CHUNK as i64) as f64 * step];
        let live = self.scene.active & !self.done & ALL;
        let mut special = [0u32; CHUNK];
        let mut cells = 0;
        for l in (0..LANES).filter(|l| live >> l & 1 == 1) {
            if !self.waiting(l, ends[1]).is_empty() {
                cells |= 1 << l;
                continue;
            }
            let cuts = self.cuts[l][self.left[l].cuts..].iter().take_while(|c| c.k < first + CHUNK as i64);
            cuts.for_each(|c| special[(c.k - first) as usize] |= 1 << l);
            let hits = self.scene.hits[l][self.left[l].hits..].iter().take_while(|h| h.t < ends[1]);
            hits.for_each(|h| special[row_of(h.t, first, step)] |= 1 << l);
        }
        let lanes = live & !cells;
        let mut start = 0;
        for (row, &special) in special.iter().enumerate().filter(|(_, lanes)| **lanes != 0) {
            self.merge(Rows { rows: [start, row + 1], lanes, first, step }, special);
            for l in (0..LANES).filter(|l| special >> l & 1 == 1) {
                let k = first + row as i64;
                self.segments(l, first, row..row + 1, (k + 1) as f64 * step);
            }
            start = row + 1;
        }
        self.merge(Rows { rows: [start, CHUNK], lanes, first, step }, 0);
        for l in (0..LANES).filter(|l| cells >> l & 1 == 1) {
            self.segments(l, first, 0..CHUNK, ends[1]);
        }
        for l in 0..LANES {
            self.done |= u32::from(1.0 - self.sights.color[3][l] < self.scene.termination) << l;
        }
    }

    /// Gathers what layers add in a chunk.
    fn gather(&mut self, first: i64, counts: &mut Counts) {
        self.chunks.iter_mut().for_each(|c| c.rows = 0);
        for walk in self.walks.iter_mut().filter(|w| w.next < first + CHUNK as i64) {
            let layer = &self.scene.layers[walk.layer];
            let (chunk, at) = (&mut self.chunks[walk.layer], (&walk.packet, &walk.cuts));
            walk.next = match layer.look {
                Look::Voxels { job, bent: Some(bent) } => bent.gather(job, &walk.cuts, first, self.done, chunk, counts),
                Look::Voxels { job, bent: None } => {
                    dispatch::gather(self.unit, job, at, first, self.done, chunk, counts)
                }
                Look::Shaded { shaded, rays } => shaded.gather(rays, at, first, self.done, chunk, counts),
            };
        }
    }

    fn merge(&mut self, rows: Rows, special: u32) {
        let mask = (1u64 << rows.rows[1]) - (1u64 << rows.rows[0]);
        if self.chunks.iter().any(|c| u64::from(c.rows) & mask != 0) {
            let chunks: Vec<&Chunk> = self.chunks.iter().collect();
            dispatch::merge(self.unit, &chunks, rows, special, &mut self.sights);
        }
    }

    /// A lane's pieces of meshes that begin before `end` and are not passed.
    fn waiting(&self, l: usize, end: f64) -> &'a [Piece] {
        let pieces = &self.scene.pieces[l][self.left[l].pieces..];
        &pieces[..pieces.partition_point(|p| p.t[0] < end)]
    }

    /// Adds rows of a chunk in one lane, with all hits and pieces of meshes before `end`.
    fn segments(&mut self, l: usize, first: i64, rows: std::ops::Range<usize>, end: f64) {
        let step = self.scene.step;
        for chunk in &self.chunks {
            for row in rows.clone().filter(|row| chunk.rows >> row & 1 == 1 && chunk.entries[*row][l][3] > 0.0) {
                let k = first + row as i64;
                let t = [k as f64 * step, (k + 1) as f64 * step];
                self.lane.pieces.push(even(t, &chunk.entries[row][l], step));
            }
        }
        let last = first + rows.end as i64;
        let cuts = self.cuts[l][self.left[l].cuts..].iter().take_while(|c| c.k < last);
        let before = self.lane.pieces.len();
        self.lane.pieces.extend(cuts.map(|c| c.piece));
        self.left[l].cuts += self.lane.pieces.len() - before;
        let start = (first + rows.start as i64) as f64 * step;
        self.pass(l, [start, end], 0.0);
    }

    /// Passes the pieces at hand in one lane, with what else there is between two places, until
    /// less than `stop` is left to see.
    fn pass(&mut self, l: usize, [start, end]: [f64; 2], stop: f64) {
        let mut ended = true;
        for piece in self.waiting(l, end) {
            let part = [piece.t[0].max(start), piece.t[1].min(end)];
            if part[0] < part[1] {
                self.lane.pieces.push(piece.within(part));
            }
            ended &= piece.t[1] <= end;
            self.left[l].pieces += usize::from(ended);
        }
        let hits = &self.scene.hits[l][self.left[l].hits..];
        let hits = &hits[..hits.partition_point(|h| h.t < end || end == f64::INFINITY)];
        self.left[l].hits += hits.len();
        let reached = self.sights.reached >> l & 1 == 1;
        let mut sight = Sight {
            color: self.sights.color.map(|plane| f64::from(plane[l])),
            depth: self.sights.depth[l],
            threshold: f64::from(self.scene.threshold),
        };
        self.lane.pass(hits, stop, &mut sight);
        for (plane, value) in self.sights.color.iter_mut().zip(sight.color) {
            plane[l] = value as f32;
        }
        if !reached && self.sights.color[3][l] >= self.scene.threshold {
            self.sights.reached |= 1 << l;
            // Rounding may reach what f64 just misses: then it is at the end.
            self.sights.depth[l] = if sight.depth.is_finite() { sight.depth } else { end };
        }
    }

    /// Adds what lies outside of the lattice's chunks, in lanes that are not done.
    fn outside(&mut self, start: f64, end: f64) {
        let live = self.scene.active & !self.done;
        for l in (0..LANES).filter(|l| live >> l & 1 == 1) {
            let piece = !self.waiting(l, end).is_empty();
            if piece || self.scene.hits[l].get(self.left[l].hits).is_some_and(|h| h.t < end) {
                self.pass(l, [start, end], f64::from(self.scene.termination));
            }
        }
    }

    fn finish(self, pixels: &mut Pixels) {
        for (l, color) in pixels.color.iter_mut().enumerate() {
            *color = self.sights.color.map(|plane| plane[l]);
        }
        pixels.depth = self.sights.depth;
    }
}

/// A piece whose whole segment would add an entry.
fn even(t: [f64; 2], &[r, g, b, a]: &[f32; 4], step: f64) -> Piece {
    let color = [r, g, b].map(|c| f64::from(c) / f64::from(a));
    Piece::even(t, f64::from(a).min(1.0), color, step)
}

/// The row of a chunk in which `t` lies.
fn row_of(t: f64, first: i64, step: f64) -> usize {
    let rows = 0..CHUNK as i64 - 1;
    // By the ends as they are rounded, not by a quotient.
    rows.take_while(|row| t >= (first + row + 1) as f64 * step).count()
}
