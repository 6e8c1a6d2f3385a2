//! Emission and absorption: a shape's pieces along a ray, to be marched through alone or with
//! those of others.

use volact_core::lattice::Segment;

use super::{adapt, ask::Asker, carried::Lane, fit::Span, met::Met, program::Course};
use crate::reference::{
    cubic,
    line::EPS,
    met::{Sampling, number_of},
    overlap::{Along, Track},
    piece::{Kind, Piece},
};

/// The optical depth behind which nothing is looked at.
const DEEP: f64 = 40.0;

impl Met<'_> {
    /// Adds its pieces to those of others, with `t` counted from `zero`, and widens the range of
    /// all colours by its own.
    pub fn add_to(
        &self,
        along: &mut Along,
        zero: f64,
        sampling: &Sampling,
        tolerance: f64,
        asker: &mut Asker<'_>,
        range: &mut [f64; 2],
    ) {
        for lane in &self.lanes {
            self.add_lane(lane, along, zero, sampling, tolerance, asker, range);
        }
    }

    #[expect(clippy::too_many_arguments, reason = "those of the one who calls it, and the lane")]
    fn add_lane(
        &self,
        lane: &Lane,
        along: &mut Along,
        zero: f64,
        sampling: &Sampling,
        tolerance: f64,
        asker: &mut Asker<'_>,
        range: &mut [f64; 2],
    ) {
        let (shift, course) = (self.anchor - zero, &self.course(lane));
        let around = 8.0 * EPS * (self.anchor.abs() + zero.abs() + shift.abs());
        let (mut track, mut left) = (Track::new(), 1.0);
        for stretch in &lane.stretches {
            if left <= (-DEEP).exp() {
                break;
            }
            along.snap = along.snap.max(2.0 * stretch.dt + around);
            let pieces = match &sampling.counting {
                Some(counting) => {
                    let segments = counting.segments_of(self.anchor, stretch.t);
                    self.segments(course, segments, sampling.between_ends, asker, &mut left)
                }
                None => {
                    let spans = adapt::spans(asker, course, &self.cuts(lane, stretch), Self::share(tolerance), left);
                    left *= spans.iter().map(|s| (-s.depth.max(0.0)).exp()).product::<f64>();
                    tidy(&spans, 2.0 * along.snap)
                }
            };
            for piece in pieces {
                widen(range, &piece);
                let first = (piece.t[0] - stretch.t[0]).abs() <= stretch.dt + around;
                let entry = first.then(|| number_of(&mut along.starts, stretch.start));
                track.push(Piece { t: piece.t.map(|t| t + shift), entry, ..piece });
            }
        }
        along.tracks.push(track);
    }

    /// The segments of a lattice, each of one medium.
    fn segments(
        &self,
        course: &Course<'_>,
        segments: impl Iterator<Item = Segment>,
        by_ends: bool,
        asker: &mut Asker<'_>,
        left: &mut f64,
    ) -> Vec<Piece> {
        let ends: Vec<_> = segments.map(|s| [s.start, s.end]).collect();
        let mut pieces = Vec::new();
        for some in ends.chunks(volact_shaders::eval::BATCH) {
            let media = if by_ends { asker.segments(course, some) } else { asker.middles(course, some) };
            for (t, [r, g, b, extinction]) in some.iter().zip(media).filter(|(t, _)| t[1] > t[0]) {
                // Over a length of this optical depth opacity is ½ to the bit.
                pieces.push(match extinction {
                    0.0 => Piece::constant(*t, [0.0; 4], 1.0),
                    f64::INFINITY => Piece::constant(*t, [r, g, b, 1.0], 1.0),
                    _ => Piece::constant(*t, [r, g, b, 0.5], std::f64::consts::LN_2 / extinction),
                });
                *left *= (-extinction * (t[1] - t[0])).exp();
            }
            if *left <= (-DEEP).exp() {
                break;
            }
        }
        pieces
    }
}

/// Spans as pieces, those shorter than places are known taken into the next one.
fn tidy(spans: &[Span], least: f64) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::with_capacity(spans.len());
    let mut from = None;
    for span in spans {
        let [start, end] = span.t;
        let begin = *from.get_or_insert(start);
        if end - begin <= least {
            continue;
        }
        from = None;
        pieces.push(Piece { t: [begin, end], ..span.piece() });
    }
    match (from, pieces.last_mut(), spans.last()) {
        (Some(_), Some(last), Some(span)) => last.t[1] = span.t[1],
        (Some(begin), None, Some(span)) => pieces.push(Piece { t: [begin, span.t[1]], ..span.piece() }),
        _ => {}
    }
    pieces
}

fn widen([darkest, brightest]: &mut [f64; 2], piece: &Piece) {
    if piece.kind == Kind::Transparent {
        return;
    }
    for color in &piece.color {
        let spread = color[1].abs() + color[2].abs() + color[3].abs();
        *brightest = brightest.max(color[0] + spread);
        if [-1.0, 0.0, 1.0].iter().any(|y| cubic::eval(color, *y) < 0.0) {
            *darkest = darkest.min(color[0] - spread);
        }
    }
}
