//! Shapes that are one picture: the maximum, minimum, mean or line integral of the value along
//! the ray, then classified once. The opacity is taken as it stands.
//!
//! In a cell the value is a cubic: its extremes lie at the ends or where the derivative vanishes,
//! its integral is the antiderivative. Cells with a NaN corner are left out: they count neither
//! for extremes nor for the mean's length nor for the integral.

use volact_core::Compositing;

use super::{
    cells::Grid,
    cubic,
    line::{EPS, Line},
    march::Light,
    medium::{Medium, Voxels},
};

/// A value along a ray, as it is gathered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gather {
    lowest: f64,
    highest: f64,
    integral: f64,
    length: f64,
    /// Bound on the error of the extremes.
    error: f64,
    /// Bound on the error of the integral.
    integral_error: f64,
}

impl Gather {
    /// Nothing yet.
    pub const NONE: Self = Self {
        lowest: f64::INFINITY,
        highest: f64::NEG_INFINITY,
        integral: 0.0,
        length: 0.0,
        error: 0.0,
        integral_error: 0.0,
    };

    /// A stretch on which the value keeps between `lowest` and `highest`, with a mean, and a
    /// bound on the error of all three.
    pub fn add(&mut self, [lowest, highest]: [f64; 2], mean: f64, length: f64, error: f64) {
        self.lowest = self.lowest.min(lowest);
        self.highest = self.highest.max(highest);
        self.integral += mean * length;
        self.length += length;
        self.error = self.error.max(error);
        self.integral_error += length * (error + 2.0 * EPS * mean.abs()) + 2.0 * EPS * self.integral.abs();
    }

    /// Classifies what was gathered.
    pub fn light(&self, compositing: Compositing, medium: &Medium) -> Light {
        let (value, error) = match compositing {
            _ if self.length <= 0.0 => return Light::NONE,
            Compositing::Maximum => (self.highest, self.error),
            Compositing::Minimum => (self.lowest, self.error),
            Compositing::Average => {
                let mean = self.integral / self.length;
                (mean, self.integral_error / self.length + 4.0 * EPS * mean.abs())
            }
            _ => {
                let value = self.integral / medium.unit;
                (value, self.integral_error / medium.unit + 4.0 * EPS * value.abs())
            }
        };
        if value.is_nan() {
            return Light::NONE;
        }
        let (lo, hi) = if value.is_finite() { (value - error, value + error) } else { (value, value) };
        let [r, g, b, a] = medium.fields[0].knots.bounds(lo, hi);
        let mut light = Light::NONE;
        for (c, channel) in [r, g, b].into_iter().enumerate() {
            light.lower[c] = channel[0] * a[0] * (1.0 - 8.0 * EPS);
            light.upper[c] = channel[1] * a[1] * (1.0 + 8.0 * EPS);
        }
        (light.lower[3], light.upper[3]) = (a[0] * (1.0 - 4.0 * EPS), (a[1] * (1.0 + 4.0 * EPS)).min(1.0));
        light
    }
}

/// Gathers the value along a line, exactly. Returns the number of cells.
pub(super) fn gather(gathered: &mut Gather, medium: &Medium, grid: &Grid, voxels: &Voxels<'_>, line: &Line) -> u64 {
    let mut cells = 0;
    grid.walk(line, |cell| {
        cells += 1;
        let Some(corners) = medium.corners(voxels, cell.base, cell.upper) else { return true };
        let corner = &corners[0];
        let [lo, hi] = corner.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| [a.min(v), b.max(v)]);
        let length = cell.t[1] - cell.t[0];
        // The places of both ends of the stretch are uncertain.
        let shift = 2.0 * line.dt * lo.abs().max(hi.abs()) / length;
        if lo == hi {
            gathered.add([lo, lo], lo, length, 0.0);
            gathered.integral_error += length * if shift.is_finite() { shift } else { 0.0 };
            return true;
        }
        let p = cubic::along_line(&corner.map(|v| v - corner[0]), cell.from, cell.step);
        let error =
            (line.dp[0] + line.dp[1] + line.dp[2] + 64.0 * EPS) * (hi - lo) + 4.0 * EPS * lo.abs().max(hi.abs());
        let [least, most] = cubic::range(&p);
        gathered.add([corner[0] + least, corner[0] + most], corner[0] + cubic::integral(&p), length, error);
        gathered.integral_error += length * shift;
        true
    });
    cells
}

/// One picture laid over another: premultiplied, lower and upper bounds.
pub(super) fn over(front: &Light, back: &Light) -> Light {
    let mut made = *back;
    let shown = [1.0 - front.upper[3], 1.0 - front.lower[3]];
    for c in 0..4 {
        made.lower[c] = (front.lower[c] + shown[0] * back.lower[c]) * (1.0 - 4.0 * EPS);
        made.upper[c] = (front.upper[c] + shown[1] * back.upper[c]) * (1.0 + 4.0 * EPS);
    }
    // 1 − (1 − a)(1 − b) rises with both, so that each bound comes from the same bounds.
    made.lower[3] = (front.lower[3] + shown[1] * back.lower[3]) * (1.0 - 4.0 * EPS);
    made.upper[3] = ((front.upper[3] + shown[0] * back.upper[3]) * (1.0 + 4.0 * EPS)).min(1.0);
    made
}
