//! Classification as a piecewise linear function: a table's control points as segments.

use volact_core::table::ControlPoint;

/// A stretch of values on which red, green, blue and opacity are linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Segment {
    /// Lowest value; −∞ below the first point.
    pub lo: f64,
    /// Highest value; ∞ above the last point.
    pub hi: f64,
    /// The value from which the line is counted.
    pub base: f64,
    /// Red, green, blue, opacity at `base`.
    pub at_base: [f64; 4],
    /// The same at `hi`, to the bit that of the control point.
    pub at_end: [f64; 4],
    /// Their change for one unit of value.
    pub slope: [f64; 4],
}

impl Segment {
    /// One channel at a value.
    pub fn at(&self, channel: usize, value: f64) -> f64 {
        self.at_base[channel] + self.slope[channel] * (value - self.base)
    }

    /// Whether nothing is absorbed anywhere in it.
    pub fn is_transparent(&self) -> bool {
        self.at_base[3] == 0.0 && self.slope[3] == 0.0
    }

    /// Whether everything is absorbed everywhere in it.
    pub fn is_opaque(&self) -> bool {
        self.at_base[3] == 1.0 && self.slope[3] == 0.0
    }
}

/// A piecewise linear classification.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Knots {
    points: Vec<ControlPoint>,
    /// Segment `j` ends at point `j`; one more than there are points.
    segments: Vec<Segment>,
}

impl Knots {
    /// From control points in rising order, at least one; clamped outside.
    pub fn new(points: Vec<ControlPoint>) -> Self {
        let mut segments = Vec::with_capacity(points.len() + 1);
        let flat = |lo, hi, p: &ControlPoint| Segment {
            lo,
            hi,
            base: p.value,
            at_base: rgba(p),
            at_end: rgba(p),
            slope: [0.0; 4],
        };
        if let (Some(first), Some(last)) = (points.first(), points.last()) {
            segments.push(flat(f64::NEG_INFINITY, first.value, first));
            segments.extend(points.windows(2).map(|w| between(&w[0], &w[1])));
            segments.push(flat(last.value, f64::INFINITY, last));
        }
        Self { points, segments }
    }

    /// The identity for one channel: the value is the channel already.
    pub fn identity(channel: usize) -> Self {
        let mut slope = [0.0; 4];
        slope[channel] = 1.0;
        let all =
            Segment { lo: f64::NEG_INFINITY, hi: f64::INFINITY, base: 0.0, at_base: [0.0; 4], at_end: [0.0; 4], slope };
        Self { points: Vec::new(), segments: vec![all] }
    }

    /// Number of the segment of a value; a value at a point belongs to the segment above it.
    pub fn segment_of(&self, value: f64) -> usize {
        self.points.partition_point(|p| p.value <= value)
    }

    /// A segment by number.
    pub fn segment(&self, number: usize) -> &Segment {
        &self.segments[number]
    }

    /// The points strictly between two values.
    pub fn between(&self, lo: f64, hi: f64) -> &[ControlPoint] {
        let (first, last) = (self.segment_of(lo), self.points.partition_point(|p| p.value < hi));
        &self.points[first..last.max(first)]
    }

    /// The nearest segment of positive width on the far side of a segment's end.
    pub fn neighbour(&self, number: usize, upward: bool) -> Option<&Segment> {
        let wide = |s: &&Segment| s.lo < s.hi;
        match upward {
            true => self.segments[number + 1..].iter().find(wide),
            false => self.segments[..number].iter().rev().find(wide),
        }
    }

    /// Lowest and highest of each channel over the values `lo..=hi`; of a single value, its own.
    pub fn bounds(&self, lo: f64, hi: f64) -> [[f64; 2]; 4] {
        let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 4];
        let mut take = |rgba: [f64; 4]| {
            for (b, v) in bounds.iter_mut().zip(rgba) {
                *b = [b[0].min(v), b[1].max(v)];
            }
        };
        for value in [lo, hi] {
            let s = self.segment(self.segment_of(value));
            take([0, 1, 2, 3].map(|c| if s.slope[c] == 0.0 { s.at_base[c] } else { s.at(c, value) }));
        }
        if lo < hi {
            let first = self.points.partition_point(|p| p.value < lo);
            let last = self.points.partition_point(|p| p.value <= hi);
            self.points[first..last.max(first)].iter().for_each(|p| take(rgba(p)));
        }
        bounds
    }
}

fn rgba(p: &ControlPoint) -> [f64; 4] {
    [p.color[0], p.color[1], p.color[2], p.opacity]
}

fn between(a: &ControlPoint, b: &ControlPoint) -> Segment {
    let (ya, yb) = (rgba(a), rgba(b));
    let width = b.value - a.value;
    let slope = [0, 1, 2, 3].map(|c| if width > 0.0 { (yb[c] - ya[c]) / width } else { 0.0 });
    Segment { lo: a.value, hi: b.value, base: a.value, at_base: ya, at_end: yb, slope }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(value: f64, opacity: f64) -> ControlPoint {
        ControlPoint { value, color: [opacity; 3], opacity }
    }

    #[test]
    fn segments_follow_the_points_and_clamp_outside() {
        let knots = Knots::new(vec![point(1.0, 0.0), point(3.0, 1.0), point(3.0, 0.5)]);
        let at = |v: f64| knots.segment(knots.segment_of(v)).at(3, v);
        assert_eq!([at(0.0), at(2.0), at(3.0), at(9.0)], [0.0, 0.5, 0.5, 0.5]);
        assert_eq!(knots.neighbour(1, true).map(|s| s.at_base[3]), Some(0.5));
        assert!(knots.segment(0).is_transparent());
        assert_eq!(knots.between(0.0, 3.0).len(), 1);
        assert_eq!(knots.bounds(2.0, 4.0)[3], [0.5, 1.0]);
    }
}
