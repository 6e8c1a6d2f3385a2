//! Hits on a ray's way.

use std::cmp::Ordering;

use super::{DARK, March};
use crate::reference::{
    border::log_bound,
    cubic,
    hit::Hit,
    line::EPS,
    mark::Mark,
    piece::{Kind, Piece},
};

impl March {
    /// Goes on past a hit at `t`, before which `after` does not begin. `starts` are the places
    /// that pieces name as their entries. `false` when nothing behind can be seen.
    ///
    /// C += T·α·c and T *= 1 − α make D = C + k·T grow by T·(α·c − α·k), with k the colour in D.
    pub fn meet(&mut self, hit: &Hit, t: f64, after: &[Piece], starts: &[Mark]) -> bool {
        if self.pending {
            self.t[0] = 0.0;
            self.pending = false;
        }
        // The hit may lie somewhat inside of what follows.
        self.loosen(after);
        let mut hit = *hit;
        for piece in after {
            let Kind::Opaque { certain } = piece.kind else { continue };
            match piece.entry.and_then(|e| hit.mark.compare(&starts[e])) {
                Some(Ordering::Less | Ordering::Equal) => {}
                Some(Ordering::Greater) if certain => return true,
                _ => hit = hit.doubtful(),
            }
        }
        let (middle, half) = (0.5 * (self.t[0] + self.t[1]), 0.5 * (self.t[1] - self.t[0]));
        for (c, light) in hit.light.iter().enumerate() {
            let color = self.color[c];
            let (low, high) = (light[0] - hit.alpha[1] * color, light[1] - hit.alpha[0] * color);
            let (gain, spread) = (0.5 * (low + high), 0.5 * (high - low));
            self.d[c] += middle * gain;
            let size = light[0].abs().max(light[1].abs()) + hit.alpha[1] * color.abs();
            self.error[c] += middle * spread + half * (gain.abs() + spread);
            self.error[c] += 8.0 * EPS * (self.d[c].abs() + self.t[1] * size);
        }
        self.t = [self.t[0] * (1.0 - hit.alpha[1]) * (1.0 - 2.0 * EPS), self.t[1] * (1.0 - hit.alpha[0])];
        self.t[1] = (self.t[1] * (1.0 + 2.0 * EPS)).min(1.0);
        self.likely *= 1.0 - 0.5 * (hit.alpha[0] + hit.alpha[1]);
        if self.depth.is_infinite() && self.likely <= self.threshold {
            self.depth = t;
        }
        self.t[1] * self.brightest.max(1.0) >= DARK
    }

    /// Passes over a piece so short that it is not integrated.
    pub fn skip(&mut self, piece: &Piece) {
        let depth = match piece.kind {
            Kind::Transparent => return,
            Kind::Opaque { .. } => f64::INFINITY,
            Kind::Smooth => {
                let most = [-1.0, 0.0, 1.0].map(|y| cubic::eval(&piece.rest, y)).into_iter().fold(0.0, f64::max);
                let bound = log_bound(2.0, most * piece.ratio) - 2.0 * piece.floor.ln();
                0.5 * (piece.t[1] - piece.t[0]) / piece.unit * (bound + piece.edge)
            }
        };
        self.add_error(self.t[1] * depth.min(1.0) * self.brightest);
        self.t[0] *= (-depth).exp();
    }
}
