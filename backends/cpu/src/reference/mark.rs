//! Places on a ray in double-double, and the stretches between them.
//!
//! Where a ray crosses a plane is known so well that two crossings within the error of each other
//! are taken as one: then a plane lies in another, a ray runs through an edge, and what comes
//! first is settled by rule and not by rounding. Only places that are known less well, say those
//! of a mesh, can leave the order open.

use std::cmp::Ordering;

use super::{dd::Dd, line::EPS};

/// Relative error of double-double arithmetic as it is used here, with room to spare.
pub(super) const FINE: f64 = EPS * EPS * 1024.0;

/// A place on a ray.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    /// The ray's `t`.
    pub t: Dd,
    /// Bound on its error.
    pub error: f64,
    /// Whether another place within the error is the same one.
    pub fine: bool,
}

impl Mark {
    /// A `t` as it is; may be infinite.
    pub fn exact(t: f64) -> Self {
        Self { t: Dd::new(t), error: 0.0, fine: true }
    }

    /// A `t` in f64 with a bound on its error, beside which others are not the same.
    #[cfg(test)]
    pub fn rough(t: f64, error: f64) -> Self {
        Self { t: Dd::new(t), error, fine: false }
    }

    /// `t` less `zero`.
    pub fn from(&self, zero: f64) -> f64 {
        self.t.minus(zero)
    }

    /// The order of the numbers, whatever their errors.
    pub fn order(&self, other: &Self) -> Ordering {
        let high = self.t.hi.partial_cmp(&other.t.hi).unwrap_or(Ordering::Equal);
        high.then(self.t.lo.partial_cmp(&other.t.lo).unwrap_or(Ordering::Equal))
    }

    /// The order of two places; `None` where rounding decides.
    pub fn compare(&self, other: &Self) -> Option<Ordering> {
        if self.t.hi.is_infinite() || other.t.hi.is_infinite() {
            return Some(self.order(other));
        }
        let apart = self.t.add(Dd { hi: -other.t.hi, lo: -other.t.lo }).hi.abs();
        if apart > self.error + other.error + FINE * self.t.hi.abs().max(other.t.hi.abs()) {
            Some(self.order(other))
        } else {
            (self.fine && other.fine).then_some(Ordering::Equal)
        }
    }

    fn later(self, other: Self) -> Self {
        self.pick(other, Ordering::Greater)
    }

    fn earlier(self, other: Self) -> Self {
        self.pick(other, Ordering::Less)
    }

    fn pick(self, other: Self, wanted: Ordering) -> Self {
        let chosen = if other.order(&self) == wanted { other } else { self };
        match self.compare(&other) {
            // The extreme of both lies within the wider of their errors around the chosen one.
            None => Self { error: 2.0 * self.error.max(other.error), fine: false, ..chosen },
            _ => chosen,
        }
    }
}

/// Stretches of a ray, apart and in order. Those of no length are left out, unless rounding
/// decides whether they have any.
#[derive(Clone, Debug, Default)]
pub(super) struct Stretches(Vec<[Mark; 2]>);

impl Stretches {
    /// The one between two places.
    pub fn between(start: Mark, end: Mark) -> Self {
        let mut made = Self(vec![[start, end]]);
        made.tidy();
        made
    }

    /// From stretches that are apart and in order.
    pub fn from_ordered(stretches: Vec<[Mark; 2]>) -> Self {
        let mut made = Self(stretches);
        made.tidy();
        made
    }

    /// Keeps what lies between two places.
    pub fn keep(&mut self, start: Mark, end: Mark) {
        for s in &mut self.0 {
            *s = [s[0].later(start), s[1].earlier(end)];
        }
        self.tidy();
    }

    /// Cuts away what lies between two places; what lies on them is left.
    pub fn cut(&mut self, start: Mark, end: Mark) {
        if start.compare(&end).is_none_or(Ordering::is_lt) {
            let around = |&[a, b]: &[Mark; 2]| [[a, b.earlier(start)], [a.later(end), b]];
            self.0 = self.0.iter().flat_map(around).collect();
            self.tidy();
        }
    }

    /// Leaves what other stretches hold, too.
    pub fn meet(&self, other: &Self) -> Self {
        let all = self.0.iter().flat_map(|&[a, b]| {
            let mut part = other.clone();
            part.keep(a, b);
            part.0
        });
        Self(all.collect())
    }

    /// Leaves nothing.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// The stretches in order.
    pub fn as_slice(&self) -> &[[Mark; 2]] {
        &self.0
    }

    /// Whether a place lies in one of them, ends included; `None` where rounding decides.
    pub fn hold(&self, mark: &Mark) -> Option<bool> {
        let mut held = Some(false);
        for [a, b] in &self.0 {
            match (a.compare(mark), mark.compare(b)) {
                (Some(Ordering::Greater), _) | (_, Some(Ordering::Greater)) => {}
                (Some(_), Some(_)) => return Some(true),
                _ => held = None,
            }
        }
        held
    }

    fn tidy(&mut self) {
        self.0.retain(|[a, b]| a.compare(b).is_none_or(Ordering::is_lt));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(hi: f64, lo: f64) -> Mark {
        Mark { t: Dd { hi, lo }, error: 1e-30, fine: true }
    }

    #[test]
    fn places_within_double_double_are_one() {
        assert_eq!(mark(1.0, 1e-28).compare(&mark(1.0, 0.0)), Some(Ordering::Greater));
        assert_eq!(mark(1.0, 1e-31).compare(&mark(1.0, 0.0)), Some(Ordering::Equal));
        assert_eq!(Mark::rough(1.0, 1e-15).compare(&mark(1.0, 1e-20)), None);
        assert_eq!(Mark::exact(f64::INFINITY).compare(&Mark::exact(f64::INFINITY)), Some(Ordering::Equal));
    }

    #[test]
    fn stretches_are_kept_cut_and_closed() {
        let exact = Mark::exact;
        let mut made = Stretches::between(exact(f64::NEG_INFINITY), exact(f64::INFINITY));
        made.keep(exact(0.0), exact(9.0));
        made.cut(exact(2.0), exact(3.0));
        made.cut(exact(9.0), exact(10.0));
        made.cut(exact(5.0), exact(4.0));
        let ends: Vec<_> = made.as_slice().iter().map(|s| s.map(|m| m.t.hi)).collect();
        assert_eq!(ends, [[0.0, 2.0], [3.0, 9.0]]);
        let hold = |t| made.hold(&t);
        assert_eq!([0.0, 2.0, 2.5, 9.0, 9.5].map(|t| hold(exact(t)).unwrap()), [true, true, false, true, false]);
        assert_eq!((hold(Mark::rough(2.0, 1e-9)), hold(Mark::rough(1.0, 1e-9))), (None, Some(true)));
        let both = made.meet(&Stretches::between(exact(1.0), exact(4.0)));
        assert_eq!(both.as_slice().len(), 2);
    }
}
