//! Axis-aligned boxes.

use glam::DVec3;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lowest corner.
    pub min: DVec3,
    /// Highest corner.
    pub max: DVec3,
}

impl Aabb {
    /// A box from two corners.
    pub fn new(min: DVec3, max: DVec3) -> Self {
        Self { min, max }
    }

    /// The box that holds nothing.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// What both boxes hold; may be empty.
    pub fn intersection(&self, other: &Self) -> Self {
        Self { min: self.min.max(other.min), max: self.max.min(other.max) }
    }

    /// The smallest box that holds both.
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether it holds no point.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The middle.
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) / 2.0
    }

    /// Length along each axis.
    pub fn size(&self) -> DVec3 {
        self.max - self.min
    }

    /// Its eight corners, x changing fastest.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] };
            DVec3::new(pick(0), pick(1), pick(2))
        })
    }

    /// The stretch of the line `origin + t·direction` inside the closed box; `None` if it misses.
    /// May be a single point.
    pub fn clip_line(&self, origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
        if self.is_empty() {
            return None;
        }
        let (mut t0, mut t1) = (f64::NEG_INFINITY, f64::INFINITY);
        for a in 0..3 {
            if direction[a] == 0.0 {
                if origin[a] < self.min[a] || origin[a] > self.max[a] {
                    return None;
                }
                continue;
            }
            let (u, v) = ((self.min[a] - origin[a]) / direction[a], (self.max[a] - origin[a]) / direction[a]);
            t0 = t0.max(u.min(v));
            t1 = t1.min(u.max(v));
        }
        (t0 <= t1).then_some([t0, t1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_misses_an_inverted_box() {
        let inverted = Aabb::new(DVec3::ZERO, DVec3::new(1.0, -1.0, 1.0));
        assert_eq!(inverted.clip_line(DVec3::new(-1.0, -1.0, -1.0), DVec3::ONE), None);
    }

    #[test]
    fn line_in_a_face_counts_as_inside() {
        let unit = Aabb::new(DVec3::ZERO, DVec3::ONE);
        assert_eq!(unit.clip_line(DVec3::new(0.0, 0.5, -1.0), DVec3::Z), Some([1.0, 2.0]));
        assert_eq!(unit.clip_line(DVec3::new(-0.1, 0.5, -1.0), DVec3::Z), None);
    }
}
