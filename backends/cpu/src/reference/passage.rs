//! A ray's way through a mesh as pieces, samples and gathered values.
//!
//! Exactly, each part is cut on its own. On another action's lattice, segments are those of the
//! mesh's stretches: faces between tetrahedra cut none, and a sample is taken from the tetrahedron
//! that holds it, from each of them where they overlap.

use volact_core::lattice::Segment;

use super::{
    carried::{Carried, Cells, Part, Way, What},
    cells::Cell,
    flat::{self, Gather},
    lattice::{self, Counting},
    line::EPS,
    medium::{Medium, Voxels},
    piece::{Cutter, Linear, Piece, Stretch},
};

impl Way {
    /// Visits the pieces of a track in order, each with the part that it is of, until `visit` says
    /// false.
    pub fn pieces(
        &self,
        track: &[Part],
        cells: &Cells,
        medium: &Medium,
        cutter: &mut Cutter,
        mut visit: impl FnMut(&Piece, &Part) -> bool,
    ) {
        let brightest = medium.brightest();
        let mut goes_on = true;
        for part in track {
            let mut visit = |mut piece: Piece| {
                part.cover(&mut piece, brightest);
                goes_on = visit(&piece, part);
                goes_on
            };
            match (&part.what, &cells.carried) {
                (What::Volume(line), Carried::Volume(volume)) => {
                    let voxels = Voxels::new(&volume.texture);
                    volume.grid.walk(line, |cell| {
                        let ends = [0, 1].map(|i| cell.ends[i] && part.loose[i]);
                        cutter.cut(medium, &voxels, line, &Cell { ends, ..*cell }, |piece| {
                            let mut piece = Piece { t: piece.t.map(|t| part.place(t, line)), ..*piece };
                            piece.stretch(part.rounding());
                            visit(piece)
                        })
                    });
                }
                (What::Numbers(linear), _) => {
                    cutter.cut_linear(medium, &part.stretch(), linear, |piece| visit(*piece));
                }
                _ => {}
            }
            if !goes_on {
                return;
            }
        }
    }

    /// Visits the segments of a lattice in order as pieces of a track: constant, as the sample in
    /// the middle says, or with `between_ends` linear between the samples at their ends.
    pub fn samples(
        &self,
        track: &[Part],
        cells: &Cells,
        medium: &Medium,
        (counting, between_ends): (&Counting, bool),
        cutter: &mut Cutter,
        mut visit: impl FnMut(&Piece) -> bool,
    ) {
        let at = |t: f64| value(track, cells, medium, t, self.loose(t));
        for s in self.segments(counting) {
            let goes_on = if between_ends {
                let (Some(a), Some(b)) = (at(s.start), at(s.end)) else { continue };
                let linear = [0, 1, 2, 3].map(|i| {
                    let (a, b) = (a[i], b[i]);
                    Linear { values: [a, b], range: [a.min(b), a.max(b)], error: 0.0 }
                });
                let stretch = Stretch { t: [s.start, s.end], dt: 0.0, loose: [false; 2], apart: false, stretched: 0.0 };
                cutter.cut_linear(medium, &stretch, &linear, &mut visit)
            } else {
                let Some(values) = at(s.middle()) else { continue };
                visit(&Piece::constant([s.start, s.end], lattice::classify(medium, &values), medium.unit))
            };
            if !goes_on {
                return;
            }
        }
    }

    fn segments(&self, counting: &Counting) -> impl Iterator<Item = Segment> {
        let of = |t: &[f64; 2]| counting.segments_of(self.anchor, *t);
        self.stretches.iter().flat_map(of).filter(|s| s.length() > 0.0)
    }

    fn loose(&self, t: f64) -> f64 {
        64.0 * EPS * (self.anchor.abs() + t.abs())
    }

    /// Gathers a volume's value along all tracks, exactly. Returns the number of cells.
    pub fn gather(&self, gathered: &mut Gather, cells: &Cells, medium: &Medium) -> u64 {
        let mut count = 0;
        for part in self.tracks.iter().flatten() {
            if let (What::Volume(line), Carried::Volume(volume)) = (&part.what, &cells.carried) {
                let voxels = Voxels::new(&volume.texture);
                count += flat::gather(gathered, medium, &volume.grid, &voxels, line);
            }
        }
        count
    }

    /// Gathers the value on a lattice: at middles, or linear between ends. Returns the number of
    /// samples.
    pub fn gather_samples(
        &self,
        gathered: &mut Gather,
        cells: &Cells,
        medium: &Medium,
        counting: &Counting,
        between_ends: bool,
    ) -> u64 {
        let mut count = 0;
        for track in &self.tracks {
            for s in self.segments(counting) {
                count += 1;
                let at = |t: f64| value(track, cells, medium, t, self.loose(t)).map(|v| v[0]);
                let (first, last) = if between_ends { (s.start, s.end) } else { (s.middle(), s.middle()) };
                if let (Some(a), Some(b)) = (at(first), at(last)) {
                    gathered.add([a.min(b), a.max(b)], 0.5 * (a + b), s.length(), 0.0);
                }
            }
        }
        count
    }
}

/// The fields' values at a place on a track; `None` where it has none. Within `loose` of a part's
/// ends is in it: a lattice's places are rounded with the whole ray's `t`.
fn value(track: &[Part], cells: &Cells, medium: &Medium, t: f64, loose: f64) -> Option<[f64; 4]> {
    let after = track.partition_point(|p| p.t[1] < t);
    let held = |p: &&Part| p.t[0] - loose <= t && t <= p.t[1] + loose;
    let before = after.checked_sub(1).and_then(|i| track.get(i));
    let part = track.get(after).filter(held).or(before.filter(held))?;
    let t = t.clamp(part.t[0], part.t[1]) - part.t[0];
    match (&part.what, &cells.carried) {
        (What::Volume(line), Carried::Volume(volume)) => {
            lattice::sample(medium, &Voxels::new(&volume.texture), line.point(t))
        }
        (What::Numbers(linear), _) => {
            let along = t / (part.t[1] - part.t[0]);
            Some(linear.map(|l| l.values[0] + (l.values[1] - l.values[0]) * along))
        }
        _ => None,
    }
}
