//! One ray in f64: pieces of several shapes and hits, from front to back.

use super::piece::{Hit, Piece, Sight};

/// Distance within which places are one, as a part of themselves.
const SNAP: f64 = 1e-13;

/// Room for the pieces of a ray, kept from ray to ray.
#[derive(Debug, Default)]
pub struct Lane {
    /// The pieces to pass, in any order.
    pub pieces: Vec<Piece>,
    active: Vec<Piece>,
    now: Vec<Piece>,
}

impl Lane {
    /// Passes all pieces and hits until less than `stop` is left to see, and forgets the pieces.
    /// Hits are in order. Pieces are cut to common stretches, on which extinctions add; a hit
    /// comes before what begins in its place.
    ///
    /// Pieces of one beginning are taken in the order in which they were put in, which must not
    /// depend on the order of drawing.
    pub fn pass(&mut self, mut hits: &[Hit], stop: f64, sight: &mut Sight) {
        self.pieces.sort_by(|a, b| a.t[0].total_cmp(&b.t[0]));
        self.active.clear();
        let mut waiting = self.pieces.iter().peekable();
        let mut at = f64::NEG_INFINITY;
        while sight.left() > 0.0 && sight.left() >= stop {
            let reach = |t: f64| t + SNAP * t.abs();
            self.active.retain(|p| p.t[1] > reach(at));
            let next = |waiting: &mut std::iter::Peekable<std::slice::Iter<'_, Piece>>, hits: &[Hit]| {
                let piece = waiting.peek().map_or(f64::INFINITY, |p| p.t[0]);
                piece.min(hits.first().map_or(f64::INFINITY, |h| h.t))
            };
            if self.active.is_empty() {
                at = next(&mut waiting, hits).max(at);
                if at == f64::INFINITY {
                    break;
                }
            }
            while let Some(piece) = waiting.next_if(|p| p.t[0] <= reach(at)) {
                if piece.t[1] > reach(at) {
                    self.active.push(*piece);
                }
            }
            let met = hits.partition_point(|h| h.t <= reach(at));
            sight.meet(&hits[..met]);
            hits = &hits[met..];
            if self.active.is_empty() {
                continue;
            }
            let ends = self.active.iter().map(|p| p.t[1]).fold(f64::INFINITY, f64::min);
            let end = next(&mut waiting, hits).min(ends);
            self.now.clear();
            self.now.extend(self.active.iter().map(|p| p.within([at, end])));
            sight.pass(&self.now);
            at = end;
        }
        self.pieces.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(pieces: &[Piece], hits: &[Hit]) -> Sight {
        let mut sight = Sight { color: [0.0; 4], depth: f64::INFINITY, threshold: 0.5 };
        let mut lane = Lane { pieces: pieces.to_vec(), ..Lane::default() };
        lane.pass(hits, 0.0, &mut sight);
        sight
    }

    /// dC = T·Σσc ds by very many steps.
    fn truth(pieces: &[Piece], hits: &[Hit]) -> [f64; 4] {
        let (start, end, n) = (-1.0, 6.0, 700_000);
        let mut color = [0.0; 4];
        let mut hits = hits.iter().peekable();
        for i in 0..n {
            let t = start + (end - start) * (i as f64 + 0.5) / n as f64;
            while let Some(hit) = hits.next_if(|h| h.t < t) {
                let left = 1.0 - color[3];
                (0..4).for_each(|c| color[c] += left * hit.color[c]);
            }
            let (mut sigma, mut light) = (0.0, [0.0; 3]);
            for p in pieces.iter().filter(|p| p.t[0] <= t && t < p.t[1]) {
                let at = (t - p.t[0]) / (p.t[1] - p.t[0]);
                let s = -(-(p.opacity[0] + at * (p.opacity[1] - p.opacity[0]))).ln_1p() / p.unit;
                sigma += s;
                (0..3).for_each(|c| light[c] += s * (p.color[0][c] + at * (p.color[1][c] - p.color[0][c])));
            }
            if sigma > 0.0 {
                let alpha = -(-sigma * (end - start) / n as f64).exp_m1();
                let left = 1.0 - color[3];
                (0..3).for_each(|c| color[c] += left * alpha * light[c] / sigma);
                color[3] += left * alpha;
            }
        }
        color
    }

    fn piece(t: [f64; 2], opacity: [f64; 2], color: [[f64; 3]; 2]) -> Piece {
        Piece { t, opacity, color, unit: 0.7 }
    }

    #[test]
    fn pieces_and_hits_agree_with_small_steps() {
        let (red, blue, dim) = ([1.0, 0.1, 0.0], [0.0, 0.2, 1.0], [0.3; 3]);
        let hit = |t| Hit { t, color: [0.1, 0.2, 0.0, 0.25] };
        let cases: [(&[Piece], &[Hit]); 6] = [
            (&[piece([0.0, 3.0], [0.1, 0.8], [red, blue])], &[]),
            (&[piece([0.0, 2.0], [0.0, 1.0], [red, blue])], &[]),
            (&[piece([0.0, 2.0], [0.3; 2], [dim; 2]), piece([1.0, 3.0], [0.5; 2], [red; 2])], &[hit(1.5), hit(5.0)]),
            (&[piece([0.0, 2.0], [0.0, 0.9], [red, blue]), piece([0.5, 3.0], [0.2; 2], [dim; 2])], &[hit(0.7)]),
            (&[piece([0.0, 2.0], [0.0, 0.3], [red; 2]), piece([0.0, 2.0], [1e-3; 2], [blue; 2])], &[]),
            (&[piece([1.0, 2.0], [0.2, 1.0], [red, dim]), piece([0.0, 4.0], [0.6, 0.1], [blue, red])], &[hit(0.0)]),
        ];
        for (pieces, hits) in cases {
            let (found, wanted) = (run(pieces, hits).color, truth(pieces, hits));
            let error = (0..4).map(|c| (found[c] - wanted[c]).abs()).fold(0.0, f64::max);
            assert!(error < 2e-5, "{pieces:?}: {found:?}, wanted {wanted:?}");
        }
    }

    #[test]
    fn hits_of_one_place_mix_and_come_before_what_begins_there() {
        let solid = Piece::even([1.0, 2.0], 1.0, [0.0, 0.0, 1.0], 1.0);
        let hits = [Hit { t: 1.0, color: [0.5, 0.0, 0.0, 0.5] }, Hit { t: 1.0, color: [0.0, 0.5, 0.0, 0.5] }];
        let found = run(&[solid], &hits);
        assert_eq!(found.color, [0.375, 0.375, 0.25, 1.0]);
        assert_eq!(found.depth, 1.0);
    }

    #[test]
    fn opaque_pieces_share_a_ray_equally() {
        let a = Piece::even([1.0, 2.0], 1.0, [0.0, 0.0, 1.0], 1.0);
        let b = Piece::even([1.0, 3.0], 1.0, [1.0, 0.0, 0.0], 3.0);
        let thin = Piece::even([0.0, 3.0], 0.0, [1.0; 3], 1.0);
        assert_eq!(run(&[thin, a, b], &[]).color, [0.5, 0.0, 0.5, 1.0]);
    }
}
