//! Shapes that overlap: extinctions add, so the order of drawing means nothing.
//!
//! The pieces of all shapes are cut to the stretches that they share. Ends that lie within
//! rounding of each other are taken as one; what that moves is in the pieces' bounds.

use super::{
    cubic,
    line::EPS,
    piece::{Kind, Piece},
};

/// The pieces of one shape along a ray, in order.
pub(super) type Track = Vec<Piece>;

/// Visits all stretches between ends of pieces in order, with the pieces on them, until `visit`
/// says false. `snap` is the distance within which ends are one.
pub(super) fn sweep(tracks: &[Track], snap: f64, mut visit: impl FnMut(&[Piece]) -> bool) {
    let mut next = vec![0usize; tracks.len()];
    let mut active = Vec::with_capacity(tracks.len());
    let mut at = f64::NEG_INFINITY;
    loop {
        skip_passed(tracks, &mut next, at + snap);
        let heads = || tracks.iter().zip(&next).filter_map(|(track, &n)| track.get(n));
        let Some(start) = heads().map(|p| p.t[0].max(at)).min_by(f64::total_cmp) else { return };
        let ends = heads().map(|p| if p.t[0] > start + snap { p.t[0] } else { p.t[1] });
        let Some(end) = ends.min_by(f64::total_cmp) else { return };
        active.clear();
        active.extend(heads().filter(|p| p.t[0] <= start + snap).map(|p| part(p, [start, end], snap)));
        if !visit(&active) {
            return;
        }
        at = end;
    }
}

fn skip_passed(tracks: &[Track], next: &mut [usize], at: f64) {
    for (track, n) in tracks.iter().zip(next) {
        while track.get(*n).is_some_and(|p| p.t[1] <= at) {
            *n += 1;
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
    made.opacity_error += moved(&p.rest);
    if p.kind == Kind::Smooth {
        let least = [-1.0, 0.0, 1.0].map(|y| cubic::eval(&made.rest, y)).into_iter().fold(1.0, f64::min);
        let zone = (2.0 * snap / (t[1] - t[0])).min(2.0);
        let log = if least > 1e-12 { -least.ln() + 0.7 } else { 3.0 * (8.0 / zone).ln() + 40.0 };
        made.edge = p.edge / half.max(1e-300) + zone * log;
        made.edge_color = p.edge_color / half.max(1e-300);
    }
    if t[0] > p.t[0] + snap {
        made.entry = None;
    }
    made.doubt = p.doubt && t[1] >= p.t[1] - snap;
    made
}
