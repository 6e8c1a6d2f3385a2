//! Double-double numbers: an unevaluated sum of two f64 with about 106 bits.
//!
//! Used once a ray, to carry an anchor point from world into index space without the cancellation
//! of large coordinates (T. J. Dekker, *A floating-point technique for extending the available
//! precision*, 1971; D. E. Knuth, TAOCP 2, 4.2.2).

/// The sign of `a·d − b·c`, exactly: 1, 0 or −1. The numbers must not be so small or large that
/// products of their parts leave the range of f64.
pub(super) fn sign_of_determinant([a, b]: [Dd; 2], [c, d]: [Dd; 2]) -> f64 {
    let (p, q) = (a.hi * d.hi, b.hi * c.hi);
    // Four roundings in each product, one in the difference.
    if (p - q).abs() > 4.0 * f64::EPSILON * (p.abs() + q.abs()) {
        return (p - q).signum();
    }
    let mut parts = [0.0; 16];
    let mut count = 0;
    for (u, v, sign) in [(a, d, 1.0), (b, c, -1.0)] {
        for (x, y) in [(u.lo, v.lo), (u.lo, v.hi), (u.hi, v.lo), (u.hi, v.hi)] {
            let product = Dd::product(x, sign * y);
            grow(&mut parts, &mut count, product.lo);
            grow(&mut parts, &mut count, product.hi);
        }
    }
    parts[..count].iter().rev().find(|v| **v != 0.0).map_or(0.0, |v| v.signum())
}

/// Adds a number to an expansion of parts that do not overlap, exactly (J. R. Shewchuk, *Adaptive
/// precision floating-point arithmetic and fast robust geometric predicates*, 1997, grow-expansion).
fn grow(parts: &mut [f64; 16], count: &mut usize, value: f64) {
    let mut carried = value;
    for part in &mut parts[..*count] {
        let sum = Dd::sum(carried, *part);
        (*part, carried) = (sum.lo, sum.hi);
    }
    parts[*count] = carried;
    *count += 1;
}

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

    /// `self · other` to a relative 2⁻¹⁰² or so.
    pub fn times(self, other: Self) -> Self {
        let high = Self::product(self.hi, other.hi);
        Self::sum(high.hi, high.lo + (self.hi * other.lo + self.lo * other.hi))
    }

    /// `self / other` to a relative 2⁻¹⁰⁰ or so, by three steps of long division.
    pub fn over(self, other: Self) -> Self {
        let first = self.hi / other.hi;
        let rest = self.add(other.scale(-first));
        let second = rest.hi / other.hi;
        let rest = rest.add(other.scale(-second));
        Self::sum(first, second).add(Self::new(rest.hi / other.hi))
    }

    /// `−self`.
    pub fn negate(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }

    /// The sign of `self − other`, exactly: 1, 0 or −1.
    pub fn sign_from(self, other: Self) -> f64 {
        let sign = |d: f64| if d == 0.0 { 0.0 } else { d.signum() };
        let high = sign(self.hi - other.hi);
        if high == 0.0 { sign(self.lo - other.lo) } else { high }
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
    fn products_and_quotients_undo_each_other() {
        let (a, b) = (Dd::sum(1.0 / 3.0, 1e-18), Dd::sum(-7.1e5, 3e-12));
        let back = a.over(b).times(b).add(a.negate());
        assert!(back.hi.abs() < 1e-30, "{back:?}");
        let exact = Dd::new(2.0).over(Dd::new(3.0)).scale(3.0).add(Dd::new(-2.0));
        assert!(exact.hi.abs() < 1e-31, "{exact:?}");
    }

    #[test]
    fn determinants_have_their_exact_sign() {
        // (1 + e)·1 − 1·(1 + e) with e far below what a product of f64 can tell.
        let (one, more) = (Dd::new(1.0), Dd { hi: 1.0, lo: 1e-30 });
        assert_eq!(sign_of_determinant([more, one], [one, one]), 1.0);
        assert_eq!(sign_of_determinant([one, more], [one, one]), -1.0);
        assert_eq!(sign_of_determinant([more, more], [one, one]), 0.0);
        assert_eq!(sign_of_determinant([more, more], [more, more]), 0.0);
        // more² − (1 + 2e)·1 = e².
        assert_eq!(sign_of_determinant([more, Dd { hi: 1.0, lo: 2e-30 }], [one, more]), 1.0);
        assert_eq!(sign_of_determinant([Dd::default(), one], [Dd::default(), one]), 0.0);
        assert_eq!([more.sign_from(one), one.sign_from(more), one.sign_from(one)], [1.0, -1.0, 0.0]);
    }

    #[test]
    fn cancellation_of_large_numbers_keeps_the_small_part() {
        let sum = Dd::product(1e8 + 1.0, 1e8 - 1.0).add(Dd::new(-1e16));
        assert_eq!(sum.minus(0.0), -1.0);
        let third = Dd::new(1.0 / 3.0).scale(3.0);
        assert_eq!(third.minus(1.0), -(2f64.powi(-54)));
    }
}
