//! Shapes that overlap, and hits among them: extinctions add, so the order of drawing means
//! nothing.
//!
//! The pieces of all shapes are cut to the stretches that they share, and at hits. Ends that lie
//! within rounding of each other are taken as one; what that moves is in the pieces' bounds.

use super::{
    cubic,
    hit::Hit,
    line::EPS,
    march::March,
    mark::Mark,
    piece::{Kind, Piece},
};

/// The pieces of one shape along a ray, in order.
pub(super) type Track = Vec<Piece>;

/// All that there is on a ray, with `t` counted from one zero.
#[derive(Clone, Debug, Default)]
pub(super) struct Along {
    pub tracks: Vec<Track>,
    /// In order and apart, each with its `t`.
    pub hits: Vec<(f64, Hit)>,
    /// The places that pieces name as their entries.
    pub starts: Vec<Mark>,
    /// The distance within which ends are one.
    pub snap: f64,
}

impl Along {
    /// Adds hits in order, with `t` counted from `zero`.
    pub fn add_hits(&mut self, hits: Vec<Hit>, zero: f64) {
        for hit in hits {
            let t = hit.mark.from(zero);
            if t.is_finite() {
                self.snap = self.snap.max(2.0 * (hit.mark.error + EPS * t.abs()));
            }
            self.hits.push((t, hit));
        }
    }
}

/// How far a sweep has come.
struct Sweep<'a> {
    along: &'a Along,
    /// The piece of each track that is next.
    next: Vec<usize>,
    hit: usize,
    /// The last stretch.
    last: [f64; 2],
}

/// Marches over all stretches between ends of pieces in order, with the pieces on them, and over
/// hits, until nothing behind can be seen.
pub(super) fn sweep(along: &Along, march: &mut March) {
    let next = vec![0; along.tracks.len()];
    let mut at = Sweep { along, next, hit: 0, last: [f64::NEG_INFINITY; 2] };
    let mut active = Vec::with_capacity(along.tracks.len());
    while at.step(march, &mut active) {}
}

impl Sweep<'_> {
    /// Goes over one stretch, or a hit in a gap; `false` at the end.
    fn step(&mut self, march: &mut March, active: &mut Vec<Piece>) -> bool {
        self.skip_passed(march);
        let snap = self.along.snap;
        let mut start = self.start();
        while start.is_some_and(|start| self.skip_short(march, start)) {
            start = self.start();
        }
        active.clear();
        if let Some((t, hit)) = self.along.hits.get(self.hit)
            && start.is_none_or(|start| *t < start - snap)
        {
            self.hit += 1;
            return march.meet(hit, *t, active, &self.along.starts);
        }
        let Some(start) = start else { return false };
        let here = self.along.hits[self.hit..].iter().take_while(|(t, _)| *t <= start + snap).count();
        let here = &self.along.hits[self.hit..self.hit + here];
        self.hit += here.len();
        let ends = self.heads().map(|p| if p.t[0] > start + snap { p.t[0] } else { p.t[1] });
        let cut = self.along.hits.get(self.hit).map(|(t, _)| *t);
        let Some(end) = ends.chain(cut).min_by(f64::total_cmp) else { return false };
        active.extend(self.heads().filter(|p| p.t[0] <= start + snap).map(|p| part(p, [start, end], snap)));
        self.last = [start, end];
        here.iter().all(|(t, hit)| march.meet(hit, *t, active, &self.along.starts)) && march.advance(active)
    }

    /// Where the next stretch begins.
    fn start(&self) -> Option<f64> {
        self.heads().map(|p| p.t[0].max(self.last[1])).min_by(f64::total_cmp)
    }

    /// Passes over pieces that end within the error of places; `false` where there is none.
    fn skip_short(&mut self, march: &mut March, start: f64) -> bool {
        let mut skipped = false;
        for (track, n) in self.along.tracks.iter().zip(&mut self.next) {
            while let Some(p) = track.get(*n).filter(|p| p.t[1] <= start + self.along.snap) {
                march.skip(p);
                *n += 1;
                skipped = true;
            }
        }
        skipped
    }

    fn heads(&self) -> impl Iterator<Item = &Piece> {
        self.along.tracks.iter().zip(&self.next).filter_map(|(track, &n)| track.get(n))
    }

    fn skip_passed(&mut self, march: &mut March) {
        let (snap, [start, end]) = (self.along.snap, self.last);
        for (track, n) in self.along.tracks.iter().zip(&mut self.next) {
            while let Some(p) = track.get(*n).filter(|p| p.t[1] <= end + snap) {
                if p.t[0] > start + snap {
                    march.skip(p);
                }
                *n += 1;
            }
        }
    }
}

/// A part of a piece.
fn part(p: &Piece, t: [f64; 2], snap: f64) -> Piece {
    let length = p.t[1] - p.t[0];
    let y = |t: f64| ((t - p.t[0]) / length * 2.0 - 1.0).clamp(-1.0, 1.0);
    let (a, b) = (y(t[0]), y(t[1]));
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    let restrict = |c: &[f64; 4]| if c[1..] == [0.0; 3] { *c } else { cubic::restrict(c, middle, half) };
    // How far y may be wrong, and with it what depends on it.
    let loose = 4.0 * snap / length + 16.0 * EPS;
    let moved = |c: &[f64; 4]| loose * (c[1].abs() + 2.0 * c[2].abs() + 3.0 * c[3].abs());
    let mut made = Piece { t, opacity: restrict(&p.opacity), rest: restrict(&p.rest), ..*p };
    made.color = p.color.each_ref().map(restrict);
    made.color_error += p.color.iter().map(moved).fold(0.0, f64::max);
    // Opacity keeps its course along the piece: its ends are what may be elsewhere.
    if p.kind == Kind::Smooth {
        let least = [-1.0, 0.0, 1.0].map(|y| cubic::eval(&made.rest, y)).into_iter().fold(1.0, f64::min);
        let zone = (4.0 * snap / (t[1] - t[0])).min(2.0);
        let log = if least > 1e-12 { -least.ln() + 3.0 } else { 3.0 * (8.0 / zone).ln() + 40.0 };
        made.edge = p.edge / half.max(1e-300) + zone * log;
        made.edge_color = p.edge_color / half.max(1e-300);
    }
    if t[0] > p.t[0] + snap {
        made.entry = None;
    }
    made.doubt = p.doubt && t[1] >= p.t[1] - snap;
    made
}
