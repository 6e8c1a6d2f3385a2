//! Cells cut into smooth pieces: opacity and colour as cubics, with bounds on their errors.
//!
//! In a cell a field is a cubic v(s). It is cut where it is extreme and where it meets a control
//! point, so that on each piece v is monotone and the classification linear: opacity a and colour
//! c are cubics, too, written in y = −1 to 1.
//!
//! # What is wrong with a piece
//! The true value differs from the computed one by at most ε: rounding of the polynomial, and
//! the rounded position times the gradient. Classification is piecewise linear, so away from the
//! ends of its segment a is wrong by |slope|·ε; [`border`](super::border) sees to the ends.

use super::{
    border::{depth_inside, log_bound, look_across},
    cells::Cell,
    cubic::{self, Cubic},
    knots::Segment,
    line::{EPS, Line},
    medium::{Field, Medium, Voxels},
};

/// A stretch of a ray on which every field is one polynomial.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// Where it begins and ends.
    pub t: [f64; 2],
    /// Bound on the error of an end that counts as loose.
    pub dt: f64,
    /// Whether something else begins at the ends, so that their place matters.
    pub loose: [bool; 2],
    /// Whether all ends of pieces are loose, too: between cells of the nearest filter.
    pub apart: bool,
    /// Bound on the error of its pieces' lengths, with values that keep their places on them.
    pub stretched: f64,
}

/// A field that is linear on a stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linear {
    /// At both ends.
    pub values: [f64; 2],
    /// What bounds it, beyond the stretch, too.
    pub range: [f64; 2],
    /// Bound on its error.
    pub error: f64,
}

/// What a piece absorbs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Nothing.
    Transparent,
    /// Some of the light.
    Smooth,
    /// All light; `certain` unless rounding may have made it up.
    Opaque { certain: bool },
}

/// A stretch on which opacity and colour are cubics of y = −1 to 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece {
    /// Where it begins and ends, in the ray's `t` less the sweep's own zero.
    pub t: [f64; 2],
    pub kind: Kind,
    pub opacity: Cubic,
    /// 1 − opacity, without cancellation next to 1.
    pub rest: Cubic,
    pub color: [Cubic; 3],
    /// Bound on the error of `opacity` and `rest` beyond a few roundings of themselves.
    pub opacity_error: f64,
    /// Bound on the error of any `color`.
    pub color_error: f64,
    /// Bound on ∫ |error of ln(1 − a)| dy near the ends, where `opacity_error` does not hold.
    pub edge: f64,
    /// Bound on ∫ |ln(1 − a)|·|error of c| dy there.
    pub edge_color: f64,
    /// How much flatter 1 − a may rise from a zero than this piece says.
    pub ratio: f64,
    /// What 1 − a may be where the next segment is flat; 1 where none is near.
    pub floor: f64,
    /// Whether an opaque stretch that is not seen here may follow.
    pub doubt: bool,
    /// World length over which opacity is the fraction absorbed.
    pub unit: f64,
    /// Which place's face it begins at, if it is one; for shapes that share a place.
    pub entry: Option<usize>,
}

impl Piece {
    /// A piece of constant colour and opacity, without error.
    pub fn constant(t: [f64; 2], [r, g, b, a]: [f64; 4], unit: f64) -> Self {
        let flat = |v: f64| [v, 0.0, 0.0, 0.0];
        let kind = match a {
            0.0 => Kind::Transparent,
            1.0 => Kind::Opaque { certain: true },
            _ => Kind::Smooth,
        };
        Self {
            t,
            kind,
            opacity: flat(a),
            rest: flat(1.0 - a),
            color: [flat(r), flat(g), flat(b)],
            opacity_error: 0.0,
            color_error: 0.0,
            edge: 0.0,
            edge_color: 0.0,
            ratio: 1.0,
            floor: 1.0,
            doubt: false,
            unit,
            entry: None,
        }
    }

    /// Accounts for an uncertain length, with opacity and colour that keep their places on it:
    /// the optical depth is wrong by the same part.
    pub fn stretch(&mut self, error: f64) {
        let length = self.t[1] - self.t[0];
        if self.kind != Kind::Smooth || error <= 0.0 || length <= 0.0 {
            return;
        }
        let ends = [cubic::eval(&self.rest, -1.0), cubic::eval(&self.rest, 1.0)];
        let (least, most) = (ends[0].min(ends[1]) - self.opacity_error, ends[0].max(ends[1]));
        let depth = if least > 0.1 * most { -2.0 * least.ln() } else { log_bound(2.0, most) };
        self.edge += error / length * depth.max(0.0);
    }
}

/// A field in a cell.
#[derive(Clone, Copy)]
pub(super) struct Local<'a> {
    pub field: &'a Field,
    /// The value less `origin`.
    value: Cubic,
    pub origin: f64,
    /// Lowest and highest corner.
    pub range: [f64; 2],
    /// Bound on the error of `value`.
    pub error: f64,
    /// The one segment of the whole cell, if there is but one.
    segment: Option<usize>,
}

/// Cuts cells into pieces; keeps its scratch memory from cell to cell.
#[derive(Default)]
pub(super) struct Cutter {
    cuts: Vec<f64>,
}

impl Cutter {
    /// Visits the pieces of a cell in order until `visit` says false, which is passed on.
    pub fn cut(
        &mut self,
        medium: &Medium,
        voxels: &Voxels<'_>,
        line: &Line,
        cell: &Cell,
        mut visit: impl FnMut(&Piece) -> bool,
    ) -> bool {
        let Some(corners) = medium.corners(voxels, cell.base, cell.upper) else { return true };
        let count = medium.fields.len();
        let mut locals = [None; 4];
        for (i, field) in medium.fields.iter().enumerate() {
            locals[i] = Some(local(field, &corners[i], line, cell));
        }
        let stretch = Stretch { t: cell.t, dt: line.dt, loose: cell.ends, apart: voxels.nearest, stretched: 0.0 };
        self.visit_pieces(medium, &locals[..count], &stretch, &mut visit)
    }

    /// Visits the pieces of a stretch on which every field is linear; one for each of the medium's
    /// fields is looked at.
    pub fn cut_linear(
        &mut self,
        medium: &Medium,
        stretch: &Stretch,
        linear: &[Linear],
        mut visit: impl FnMut(&Piece) -> bool,
    ) -> bool {
        let mut locals = [None; 4];
        for (i, (field, linear)) in medium.fields.iter().zip(linear).enumerate() {
            let Linear { values: [a, b], range, error } = *linear;
            let (low, high) = (field.knots.segment_of(range[0]), field.knots.segment_of(range[1]));
            let (value, segment) = ([0.0, b - a, 0.0, 0.0], (low == high).then_some(low));
            let error = error + 4.0 * EPS * (b - a).abs();
            locals[i] = Some(Local { field, value, origin: a, range, error, segment });
        }
        self.visit_pieces(medium, &locals[..medium.fields.len()], stretch, &mut visit)
    }

    fn visit_pieces(
        &mut self,
        medium: &Medium,
        locals: &[Option<Local<'_>>],
        stretch: &Stretch,
        visit: &mut impl FnMut(&Piece) -> bool,
    ) -> bool {
        self.find_cuts(locals);
        for i in 1..self.cuts.len() {
            let (a, b) = (self.cuts[i - 1], self.cuts[i]);
            if b > a && !visit(&piece(medium, locals, stretch, [a, b])) {
                return false;
            }
        }
        true
    }

    fn find_cuts(&mut self, locals: &[Option<Local<'_>>]) {
        self.cuts.clear();
        self.cuts.push(0.0);
        for local in locals.iter().flatten().filter(|l| l.segment.is_none()) {
            let critical = cubic::critical_points(&local.value);
            let bends = [0.0, critical[0], critical[1], 1.0].into_iter().filter(|s| !s.is_nan());
            let mut from = 0.0;
            for to in bends.skip(1) {
                self.cut_monotone(local, from, to);
                self.cuts.push(to);
                from = to;
            }
        }
        self.cuts.push(1.0);
        self.cuts.sort_by(f64::total_cmp);
        self.cuts.dedup();
    }

    fn cut_monotone(&mut self, local: &Local<'_>, a: f64, b: f64) {
        let at = |s| cubic::eval(&local.value, s) + local.origin;
        let (va, vb) = (at(a), at(b));
        let (lo, hi) = (va.min(vb), va.max(vb));
        for point in local.field.knots.between(lo, hi) {
            let value = point.value - local.origin;
            self.cuts.push(cubic::crossing(&local.value, value, a, b));
        }
    }
}

fn local<'a>(field: &'a Field, corner: &[f64; 8], line: &Line, cell: &Cell) -> Local<'a> {
    let range = corner.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], &v| [lo.min(v), hi.max(v)]);
    let origin = corner[0];
    let knots = &field.knots;
    if range[0] == range[1] {
        let segment = Some(knots.segment_of(origin));
        return Local { field, value: [0.0; 4], origin, range, error: 0.0, segment };
    }
    let value = cubic::along_line(&corner.map(|v| v - origin), cell.from, cell.step);
    let (spread, most) = (range[1] - range[0], range[0].abs().max(range[1].abs()));
    let error = (line.dp[0] + line.dp[1] + line.dp[2] + 64.0 * EPS) * spread + 4.0 * EPS * most;
    let low = knots.segment_of(range[0]);
    let segment = (low == knots.segment_of(range[1])).then_some(low);
    Local { field, value, origin, range, error, segment }
}

fn piece(medium: &Medium, locals: &[Option<Local<'_>>], stretch: &Stretch, s: [f64; 2]) -> Piece {
    let [start, end] = stretch.t;
    let at = |s: f64| if s == 1.0 { end } else { start + (end - start) * s };
    let mut made = Piece::constant([at(s[0]), at(s[1])], [0.0, 0.0, 0.0, 1.0], medium.unit);
    for local in locals.iter().flatten() {
        classify(&mut made, local, s);
    }
    let outer = [s[0] == 0.0, s[1] == 1.0];
    let loose = [0, 1].map(|i| outer[i] && (stretch.apart || stretch.loose[i]));
    loosen_ends(&mut made, loose, stretch.dt);
    made.stretch(stretch.stretched);
    made
}

/// Sets the channels that a field drives.
fn classify(made: &mut Piece, local: &Local<'_>, s: [f64; 2]) {
    let value = cubic::restrict(&local.value, 0.5 * (s[0] + s[1]), 0.5 * (s[1] - s[0]));
    let knots = &local.field.knots;
    let number = local.segment.unwrap_or_else(|| knots.segment_of(value[0] + local.origin));
    let segment = knots.segment(number);
    let ends = [cubic::eval(&value, -1.0) + local.origin, cubic::eval(&value, 1.0) + local.origin];
    let [lo, hi] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
    let error = match local.segment {
        Some(_) => local.error,
        None => local.error + (segment.lo - lo).max(0.0) + (hi - segment.hi).max(0.0),
    };
    let offset = local.origin - segment.base;
    for c in (0..4).filter(|&c| local.field.drives[c]) {
        let k = segment.slope[c];
        let constant = if k == 0.0 { segment.at_base[c] } else { segment.at_base[c] + k * (offset + value[0]) };
        let channel = [constant, k * value[1], k * value[2], k * value[3]];
        let size = segment.at_base[c].abs() + k.abs() * (hi - lo).max((offset + value[0]).abs());
        let wrong = k.abs() * error + if k == 0.0 { 0.0 } else { 8.0 * EPS * size };
        if c < 3 {
            made.color[c] = channel;
            made.color_error = made.color_error.max(wrong);
        } else {
            made.opacity = channel;
            made.rest = rest(segment, local.origin, &value);
            made.opacity_error = k.abs() * error;
            made.kind = if segment.is_transparent() {
                Kind::Transparent
            } else if segment.is_opaque() {
                let certain = local.segment.is_some() || depth_inside(local, segment, [lo, hi]) > 4.0 * error;
                Kind::Opaque { certain }
            } else {
                Kind::Smooth
            };
        }
    }
    if local.segment.is_none() {
        for upward in [false, true] {
            look_across(made, local, number, upward, &value, [lo, hi], error);
        }
    }
}

/// 1 − opacity along a value, counted from the end of the segment where it is smaller.
fn rest(segment: &Segment, origin: f64, value: &Cubic) -> Cubic {
    let k = segment.slope[3];
    let constant = match (k == 0.0, segment.at_end[3] > segment.at_base[3]) {
        (true, _) => 1.0 - segment.at_base[3],
        (false, true) => (1.0 - segment.at_end[3]) + k * ((segment.hi - origin) - value[0]),
        (false, false) => (1.0 - segment.at_base[3]) - k * ((origin - segment.base) + value[0]),
    };
    [constant, -k * value[1], -k * value[2], -k * value[3]]
}

/// Accounts for the uncertain place of a piece's ends.
fn loosen_ends(made: &mut Piece, loose: [bool; 2], dt: f64) {
    let length = made.t[1] - made.t[0];
    for (end, _) in [-1.0, 1.0].into_iter().zip(loose).filter(|(_, l)| *l) {
        if let Kind::Opaque { certain } = &mut made.kind {
            *certain &= length > 8.0 * dt;
        } else if made.kind == Kind::Smooth {
            let zone = (4.0 * dt / length).min(1e300);
            let (near, far) = (cubic::eval(&made.rest, end), cubic::eval(&made.rest, -end));
            let (least, most) = (near - made.opacity_error - 16.0 * EPS * near.max(far), near.max(far));
            // A zone that is longer than the piece has the piece's depth as often as it holds it.
            let bound = |most: f64| if zone <= 2.0 { log_bound(zone, most) } else { 0.5 * zone * log_bound(2.0, most) };
            made.edge += if least > 0.5 * near { -2.0 * zone * least.ln() } else { 2.0 * bound(most) };
        }
    }
}
