//! Double-double numbers: an unevaluated sum of two f64 with about 106 bits.
//!
//! Used once a ray, to carry an anchor point from world into index space without the cancellation
//! of large coordinates (T. J. Dekker, *A floating-point technique for extending the available
//! precision*, 1971; D. E. Knuth, TAOCP 2, 4.2.2).

/// `hi + lo`, with |lo| at most half a unit in the last place of `hi`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Dd {
    pub hi: f64,
    pub lo: f64,
}

impl Dd {
    /// An f64 as it is.
    pub fn new(value: f64) -> Self {
        Self { hi: value, lo: 0.0 }
    }

    /// `a + b`, exactly (Knuth's two-sum).
    pub fn sum(a: f64, b: f64) -> Self {
        let hi = a + b;
        let other = hi - a;
        Self { hi, lo: (a - (hi - other)) + (b - other) }
    }

    /// `a · b`, exactly.
    pub fn product(a: f64, b: f64) -> Self {
        let hi = a * b;
        Self { hi, lo: a.mul_add(b, -hi) }
    }

    /// `self + other` to a relative 2⁻¹⁰⁴ or so of the larger.
    pub fn add(self, other: Self) -> Self {
        let (high, low) = (Self::sum(self.hi, other.hi), Self::sum(self.lo, other.lo));
        let first = Self::sum(high.hi, high.lo + low.hi);
        Self::sum(first.hi, first.lo + low.lo)
    }

    /// `self · factor`.
    pub fn scale(self, factor: f64) -> Self {
        let high = Self::product(self.hi, factor);
        Self::sum(high.hi, high.lo + self.lo * factor)
    }

    /// `self − value`, rounded to f64.
    pub fn minus(self, value: f64) -> f64 {
        (self.hi - value) + self.lo
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cancellation_of_large_numbers_keeps_the_small_part() {
        let sum = Dd::product(1e8 + 1.0, 1e8 - 1.0).add(Dd::new(-1e16));
        assert_eq!(sum.minus(0.0), -1.0);
        let third = Dd::new(1.0 / 3.0).scale(3.0);
        assert_eq!(third.minus(1.0), -(2f64.powi(-54)));
    }
}
