//! Another action's lattice in f64: what it would draw without rounding, formats and filters.
//!
//! Segments are those of [`volact_core::lattice`], counted along the ray or, for planes, along
//! the view axis. Post-interpolated classification takes the value at each segment's middle and
//! the exact exponential of its true length. Pre-integrated classification (K. Engel, M. Kraus,
//! T. Ertl, *High-quality pre-integrated volume rendering*, 2001) takes the value as linear
//! between the segment's ends and integrates the table exactly, attenuation inside included.

use volact_core::{
    Ray,
    glam::DVec3,
    lattice::{Lattice, Segment},
};

use super::{
    cubic,
    flat::Gather,
    line::Line,
    medium::{Medium, Voxels},
    piece::{Cutter, Linear, Piece, Stretch},
};

/// How segments are counted on a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counting {
    lattice: Lattice,
    /// The lattice's coordinate is `offset + scale·t`.
    offset: f64,
    scale: f64,
}

impl Counting {
    /// Along the ray.
    pub fn rays(step: f64) -> Self {
        Self { lattice: Lattice { step }, offset: 0.0, scale: 1.0 }
    }

    /// Along the view axis, from the eye or the plane through the world's origin.
    pub fn planes(step: f64, ray: &Ray, axis: DVec3, eye: Option<DVec3>) -> Self {
        let zero = eye.unwrap_or(DVec3::ZERO);
        let offset = axis.dot(ray.origin - zero);
        Self { lattice: Lattice { step }, offset, scale: axis.dot(ray.direction) }
    }

    /// World distance between the ends of segments, along the ray.
    pub fn step(&self) -> f64 {
        (self.lattice.step / self.scale).abs()
    }

    /// The segments of a line with their ends in the line's own `t`, and their numbers.
    pub fn segments(&self, line: &Line) -> impl Iterator<Item = Segment> {
        self.segments_of(line.anchor, line.t)
    }

    /// The segments of a stretch whose `t` is counted from an anchor.
    pub fn segments_of(&self, anchor: f64, t: [f64; 2]) -> impl Iterator<Item = Segment> {
        let Self { offset, scale, .. } = *self;
        let there = |t: f64| offset + scale * (anchor + t);
        let back = move |z: f64| (z - offset) / scale - anchor;
        let place = move |s: Segment| Segment { k: s.k, start: back(s.start), end: back(s.end) };
        self.lattice.segments(there(t[0]), there(t[1])).map(place)
    }
}

/// The fields' values at a point; `None` where a NaN sample has weight.
pub(super) fn sample(medium: &Medium, voxels: &Voxels<'_>, point: DVec3) -> Option<[f64; 4]> {
    let roi = voxels.roi;
    let (mut base, mut upper, mut from) = (roi.min, [0usize; 3], [0.0; 3]);
    for a in 0..3 {
        let x = point[a].clamp(roi.min[a] as f64, roi.max[a] as f64);
        if voxels.nearest {
            base[a] = ((x + 0.5).floor() as usize).min(roi.max[a]);
        } else {
            base[a] = x.floor() as usize;
            from[a] = x - base[a] as f64;
            upper[a] = usize::from(from[a] > 0.0);
        }
    }
    let corners = medium.corners(voxels, base, upper)?;
    let mut values = [0.0; 4];
    for (value, corner) in values.iter_mut().zip(&corners).take(medium.fields.len()) {
        *value = cubic::along_line(corner, from, [0.0; 3])[0];
    }
    Some(values)
}

/// Colour and opacity of the fields' values.
pub(super) fn classify(medium: &Medium, values: &[f64; 4]) -> [f64; 4] {
    let mut rgba = [0.0, 0.0, 0.0, 1.0];
    for (field, value) in medium.fields.iter().zip(values) {
        let segment = field.knots.segment(field.knots.segment_of(*value));
        for c in (0..4).filter(|&c| field.drives[c]) {
            rgba[c] = if segment.slope[c] == 0.0 { segment.at_base[c] } else { segment.at(c, *value) };
        }
    }
    rgba[3] = rgba[3].clamp(0.0, 1.0);
    rgba
}

/// Visits the segments of a line as pieces of constant opacity and colour: what the value in the
/// middle says. Where shapes overlap, such pieces are cut where any of them begins or ends.
pub(super) fn post(
    medium: &Medium,
    voxels: &Voxels<'_>,
    line: &Line,
    counting: &Counting,
    mut visit: impl FnMut(&Piece) -> bool,
) {
    for s in counting.segments(line) {
        let Some(values) = sample(medium, voxels, line.point(s.middle())) else { continue };
        let rgba = classify(medium, &values);
        if s.length() > 0.0 && !visit(&Piece::constant([s.start, s.end], rgba, medium.unit)) {
            return;
        }
    }
}

/// Visits the pieces of a pre-integrated line in order.
pub(super) fn pre_integrated(
    medium: &Medium,
    voxels: &Voxels<'_>,
    line: &Line,
    counting: &Counting,
    cutter: &mut Cutter,
    mut visit: impl FnMut(&Piece) -> bool,
) {
    let mut last: Option<(f64, Option<[f64; 4]>)> = None;
    for s in counting.segments(line) {
        let start = match last {
            Some((t, values)) if t == s.start => values,
            _ => sample(medium, voxels, line.point(s.start)),
        };
        let end = sample(medium, voxels, line.point(s.end));
        last = Some((s.end, end));
        let (Some(start), Some(end)) = (start, end) else { continue };
        let stretch = Stretch { t: [s.start, s.end], dt: 0.0, loose: [false; 2], apart: false, stretched: 0.0 };
        let linear = [0, 1, 2, 3].map(|i| {
            let (a, b) = (start[i], end[i]);
            Linear { values: [a, b], range: [a.min(b), a.max(b)], error: 0.0 }
        });
        if s.length() > 0.0 && !cutter.cut_linear(medium, &stretch, &linear, &mut visit) {
            return;
        }
    }
}

/// Gathers the value on the lattice: at middles, or linear between ends. Returns the number of
/// samples.
pub(super) fn gather(
    gathered: &mut Gather,
    medium: &Medium,
    voxels: &Voxels<'_>,
    line: &Line,
    counting: &Counting,
    between_ends: bool,
) -> u64 {
    let mut samples = 0;
    for s in counting.segments(line) {
        samples += 1;
        let at = |t: f64| sample(medium, voxels, line.point(t)).map(|v| v[0]);
        let (first, last) = if between_ends { (s.start, s.end) } else { (s.middle(), s.middle()) };
        if let (Some(a), Some(b)) = (at(first), at(last)) {
            gathered.add([a.min(b), a.max(b)], 0.5 * (a + b), s.length(), 0.0);
        }
    }
    samples
}
