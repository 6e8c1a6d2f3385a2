//! Shapes as a ray meets them: which way it goes through each, and what it finds there.

use volact_core::{Clip, Ray};

use super::{
    carried::{self, Cells, Part},
    flat::{self, Gather},
    hit::Hit,
    lattice::{self, Counting},
    line::{EPS, Lines},
    mark::{Mark, Stretches},
    medium::Voxels,
    overlap::{Along, Track},
    piece::{Cutter, Piece},
    prepare::{Body, GridBody, Prepared},
    sight::Sight,
    slices,
};

/// Stretches of a mesh that are no further apart than this part of the distances on the ray are
/// one to a lattice.
pub(super) const GAP: f64 = 1e-13;

/// How a medium is looked at.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sampling {
    /// The lattice's segments; none where the integral is exact.
    pub counting: Option<Counting>,
    /// Whether values are linear between the ends of segments, or those in the middle.
    pub between_ends: bool,
}

/// A shape as a ray meets it.
pub(super) struct Met<'a> {
    pub shape: &'a Prepared,
    /// The ray's `t` from which its pieces are counted.
    pub anchor: f64,
    way: Way<'a>,
}

/// How a ray goes through a body.
enum Way<'a> {
    /// Along stretches of a block.
    Grid(&'a GridBody, Lines),
    /// Through tetrahedra.
    Cells(&'a Cells, carried::Way),
}

/// Where a part of a way begins.
#[derive(Clone, Copy)]
pub(super) struct Start {
    t: f64,
    mark: Mark,
    dt: f64,
}

impl<'a> Met<'a> {
    /// A shape on a ray, where anything of it is left by all that cuts it; and its slices' hits.
    pub fn new(
        shape: &'a Prepared,
        ray: &Ray,
        world_clip: &Clip,
        sampling: &Sampling,
        seen: &Stretches,
        hits: &mut Vec<Hit>,
    ) -> Option<Self> {
        let sight = Sight::new(ray, &shape.to_object, shape.center)?;
        let mut stretches = seen.clone();
        sight.clip(&shape.clip, world_clip, &mut stretches);
        // A lattice's segments are not cut where rounding parts tetrahedra.
        let gap = if sampling.counting.is_none() { 0.0 } else { GAP };
        let way = match &shape.body {
            Body::Grid(body) => {
                body.place.crop(&sight, &mut stretches);
                slices::of_grid(shape, body, &sight, &stretches, hits);
                Way::Grid(body, body.place.lines(&sight, &stretches))
            }
            Body::Carved(mesh, body) => {
                body.place.crop(&sight, &mut stretches);
                let inside = mesh.trace(&sight).stretches(gap).meet(&stretches);
                slices::of_grid(shape, body, &sight, &inside, hits);
                Way::Grid(body, body.place.lines(&sight, &inside))
            }
            Body::Cells(cells) => {
                let way = cells.meet(&shape.medium, &sight, gap, &stretches);
                slices::of_cells(shape, cells, &sight, &way, hits);
                Way::Cells(cells, way)
            }
        };
        let met = Self { shape, anchor: sight.anchor, way };
        let drawn = shape.slices.as_ref().is_none_or(|s| s.volume);
        (drawn && (met.is_through() || met.grazed() > 0.0)).then_some(met)
    }

    /// Whether there is anything to integrate.
    pub fn is_through(&self) -> bool {
        match &self.way {
            Way::Grid(_, met) => !met.lines.is_empty(),
            Way::Cells(_, way) => !way.tracks.is_empty(),
        }
    }

    /// Tracks whose pieces may overlap.
    pub fn track_count(&self) -> usize {
        match &self.way {
            Way::Grid(..) => 1,
            Way::Cells(_, way) => way.tracks.len(),
        }
    }

    /// The length of stretches that are too short to be integrated.
    pub fn grazed(&self) -> f64 {
        match &self.way {
            Way::Grid(_, met) => met.grazed,
            Way::Cells(_, way) => way.grazed,
        }
    }

    /// The value along the ray, and how many cells or samples it took.
    pub fn gather(&self, sampling: &Sampling) -> (Gather, u64) {
        let (medium, ends) = (&self.shape.medium, sampling.between_ends);
        let (mut gathered, mut samples) = (Gather::NONE, 0);
        match &self.way {
            Way::Grid(body, met) => {
                let voxels = Voxels::new(&body.texture);
                for line in &met.lines {
                    samples += match &sampling.counting {
                        None => flat::gather(&mut gathered, medium, &body.grid, &voxels, line),
                        Some(counting) => lattice::gather(&mut gathered, medium, &voxels, line, counting, ends),
                    };
                }
            }
            Way::Cells(cells, way) => {
                samples += match &sampling.counting {
                    None => way.gather(&mut gathered, cells, medium),
                    Some(counting) => way.gather_samples(&mut gathered, cells, medium, counting, ends),
                };
            }
        }
        (gathered, samples)
    }

    /// Visits the pieces of one track in order, each with the start of what it is a piece of, until
    /// `visit` says false.
    pub fn pieces(
        &self,
        track: usize,
        sampling: &Sampling,
        cutter: &mut Cutter,
        mut visit: impl FnMut(&Piece, Start) -> bool,
    ) {
        let (medium, ends) = (&self.shape.medium, sampling.between_ends);
        let mut goes_on = true;
        match &self.way {
            Way::Grid(body, met) => {
                let voxels = Voxels::new(&body.texture);
                for line in &met.lines {
                    let start = Start { t: line.t[0], mark: line.ends[0], dt: line.dt };
                    let mut visit = |piece: &Piece| {
                        goes_on = visit(piece, start);
                        goes_on
                    };
                    match &sampling.counting {
                        None => body.grid.walk(line, |cell| cutter.cut(medium, &voxels, line, cell, &mut visit)),
                        Some(counting) if !ends => lattice::post(medium, &voxels, line, counting, &mut visit),
                        Some(counting) => lattice::pre_integrated(medium, &voxels, line, counting, cutter, &mut visit),
                    }
                    if !goes_on {
                        return;
                    }
                }
            }
            Way::Cells(cells, way) => {
                let track = &way.tracks[track];
                let start = |part: &Part| Start { t: part.t[0], mark: part.ends[0], dt: part.dt };
                match (&sampling.counting, track.first().map(start)) {
                    (None, _) => way.pieces(track, cells, medium, cutter, |piece, part| visit(piece, start(part))),
                    (Some(counting), Some(first)) => {
                        way.samples(track, cells, medium, (counting, ends), cutter, |piece| visit(piece, first));
                    }
                    _ => {}
                }
            }
        }
    }
}

/// All shapes' pieces, counted from one zero.
pub(super) fn along(shapes: &[Met<'_>], zero: f64, sampling: &Sampling, cutter: &mut Cutter) -> Along {
    let mut along = Along::default();
    for met in shapes {
        let shift = met.anchor - zero;
        let around = 8.0 * EPS * (met.anchor.abs() + zero.abs() + shift.abs());
        for number in 0..met.track_count() {
            let mut track = Track::new();
            met.pieces(number, sampling, cutter, |piece, start| {
                along.snap = along.snap.max(2.0 * start.dt + around);
                // A lattice's first segment begins where its stretch does, but for rounding.
                let loose = if sampling.counting.is_some() { start.dt + around } else { 0.0 };
                let first = (piece.t[0] - start.t).abs() <= loose;
                let entry = first.then(|| number_of(&mut along.starts, start.mark));
                track.push(Piece { t: piece.t.map(|t| t + shift), entry, ..*piece });
                true
            });
            along.tracks.push(track);
        }
    }
    along
}

/// The number of a place among those that are known already; a new one if it is not the same as
/// any of them.
pub(super) fn number_of(known: &mut Vec<Mark>, mark: Mark) -> usize {
    let same = |m: &Mark| m.compare(&mark).is_some_and(|order| order.is_eq());
    known.iter().position(same).unwrap_or_else(|| {
        known.push(mark);
        known.len() - 1
    })
}
