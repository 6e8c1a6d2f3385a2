//! The sampling lattice: one for all shapes of a frame.
//!
//! Segment *k* covers `[k·h, (k+1)·h]` in a ray's `t`. A shape's interval cuts the segments at
//! its ends; a cut segment counts its true length and has its sample at its own midpoint.

/// The lattice of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// World distance between samples, positive.
    pub step: f64,
}

/// One segment of a ray inside a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Its number.
    pub k: i64,
    /// Where it begins in `t`.
    pub start: f64,
    /// Where it ends in `t`.
    pub end: f64,
}

impl Segment {
    /// Where its sample lies.
    pub fn middle(&self) -> f64 {
        0.5 * (self.start + self.end)
    }

    /// Its length.
    pub fn length(&self) -> f64 {
        self.end - self.start
    }
}

/// The segments of an interval: the cut ones at its ends, and the run of whole ones between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// A cut segment at the front.
    pub first: Option<Segment>,
    /// Numbers of the first whole segment and of the one after the last.
    pub whole: [i64; 2],
    /// A cut segment at the back.
    pub last: Option<Segment>,
}

impl Lattice {
    /// Cuts the interval `[t0, t1]` into segments. An interval without length has none.
    pub fn split(&self, t0: f64, t1: f64) -> Split {
        if t0 >= t1 || !(t0.is_finite() && t1.is_finite()) {
            return Split { first: None, whole: [0, 0], last: None };
        }
        let h = self.step;
        let (k0, k1) = ((t0 / h).ceil() as i64, (t1 / h).floor() as i64);
        if k0 > k1 {
            let inside = Segment { k: k1, start: t0, end: t1 };
            return Split { first: Some(inside), whole: [k0, k0], last: None };
        }
        let (front, back) = (k0 as f64 * h, k1 as f64 * h);
        let first = (front > t0).then_some(Segment { k: k0 - 1, start: t0, end: front });
        let last = (back < t1).then_some(Segment { k: k1, start: back, end: t1 });
        Split { first, whole: [k0, k1], last }
    }

    /// Numbers of the first segment that reaches into `[low, high]`, and of the one after the last. An
    /// interval without length has none.
    pub fn touched(&self, low: f64, high: f64) -> [i64; 2] {
        let first = (low / self.step).floor() as i64;
        if low < high { [first, (high / self.step).ceil() as i64] } else { [first; 2] }
    }

    /// All segments of an interval in order.
    pub fn segments(&self, t0: f64, t1: f64) -> impl Iterator<Item = Segment> {
        let split = self.split(t0, t1);
        let h = self.step;
        let whole =
            (split.whole[0]..split.whole[1]).map(move |k| Segment { k, start: k as f64 * h, end: (k + 1) as f64 * h });
        split.first.into_iter().chain(whole).chain(split.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn segments_cover_the_interval_without_gaps(t0 in -50.0..50.0f64, length in 0.0..40.0f64, step in 0.01..7.0f64) {
            let segments: Vec<_> = Lattice { step }.segments(t0, t0 + length).collect();
            let mut at = t0;
            for s in &segments {
                prop_assert!((s.start - at).abs() < 1e-9 && s.length() <= step * (1.0 + 1e-9));
                prop_assert!(s.middle() >= s.k as f64 * step - 1e-9);
                prop_assert!(s.middle() <= (s.k + 1) as f64 * step + 1e-9);
                at = s.end;
            }
            prop_assert!((at - (t0 + length)).abs() < 1e-9);
        }

        #[test]
        fn touched_segments_are_those_of_the_interval(t0 in -9.0..9.0f64, length in 0.0..5.0f64, step in 0.1..2.0f64) {
            let lattice = Lattice { step };
            let [first, end] = lattice.touched(t0, t0 + length);
            prop_assert!(lattice.segments(t0, t0 + length).map(|s| s.k).eq(first..end));
        }

        #[test]
        fn whole_segments_do_not_depend_on_the_interval(t0 in -9.0..9.0f64, step in 0.1..2.0f64) {
            let lattice = Lattice { step };
            let all: Vec<_> = lattice.segments(-10.0, 20.0).collect();
            for s in lattice.segments(t0, t0 + 5.0).filter(|s| s.length() == step) {
                prop_assert!(all.contains(&s));
            }
        }
    }

    #[test]
    fn empty_intervals_have_no_segments() {
        let lattice = Lattice { step: 1.0 };
        assert_eq!(lattice.segments(2.0, 2.0).count(), 0);
        assert_eq!(lattice.segments(3.0, 2.0).count(), 0);
        assert_eq!(lattice.segments(0.0, f64::INFINITY).count(), 0);
        assert_eq!(lattice.segments(2.2, 2.6).count(), 1);
        assert_eq!(lattice.segments(2.0, 3.0).count(), 1);
    }
}
