//! Geometry: *where* to draw, in a shape's object space.

use std::{any::Any, fmt};

use glam::DVec3;
use thiserror::Error;

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

/// A geometry cut into tetrahedra, in object space.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tessellation {
    /// Corner positions.
    pub vertices: Vec<DVec3>,
    /// Four vertex indices a tetrahedron, positively oriented:
    /// `(b−a)×(c−a)·(d−a) > 0`.
    pub tetrahedra: Vec<[u32; 4]>,
    /// Cells left out because they hold no volume.
    pub collapsed: usize,
}

/// Why a geometry cannot be drawn.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GeometryError {
    /// A number out of bounds.
    #[error("geometry {geometry:?}: {what} is {found}, wanted {wanted}")]
    Invalid {
        /// The geometry's registered name.
        geometry: String,
        /// Which part.
        what: String,
        /// What was found.
        found: String,
        /// What was wanted.
        wanted: String,
    },
}

/// Where to draw. A geometry of one's own needs its bounds and a tessellation.
pub trait Geometry: fmt::Debug + Send + Sync + 'static {
    /// The name under which it is registered, e.g. `block`.
    fn name(&self) -> &str;

    /// The smallest known box around it, in object space.
    fn bounds(&self) -> Aabb;

    /// The geometry as tetrahedra that neither overlap nor leave gaps.
    ///
    /// # Errors
    /// If the geometry is damaged.
    fn tessellate(&self) -> Result<Tessellation, GeometryError>;

    /// The box that this geometry is, where it is one: a box is never drawn through tetrahedra.
    fn as_block(&self) -> Option<Aabb> {
        None
    }

    /// Access to the concrete type, for actions that know it.
    fn as_any(&self) -> &dyn Any;
}

/// A box in object space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// Lowest corner.
    pub offset: DVec3,
    /// Length along each axis.
    pub dimensions: DVec3,
}

impl Block {
    /// A block from its lowest corner and its lengths.
    ///
    /// # Errors
    /// If a number is not finite or a length not positive.
    pub fn new(offset: DVec3, dimensions: DVec3) -> Result<Self, GeometryError> {
        let invalid = |what: &str, found: DVec3, wanted: &str| GeometryError::Invalid {
            geometry: "block".into(),
            what: what.into(),
            found: found.to_string(),
            wanted: wanted.into(),
        };
        if !offset.is_finite() {
            return Err(invalid("offset", offset, "finite numbers"));
        }
        if !(dimensions.is_finite() && dimensions.min_element() > 0.0) {
            return Err(invalid("dimensions", dimensions, "positive, finite numbers"));
        }
        Ok(Self { offset, dimensions })
    }
}

impl From<Aabb> for Block {
    fn from(bounds: Aabb) -> Self {
        Self { offset: bounds.min, dimensions: bounds.size() }
    }
}

impl Geometry for Block {
    fn name(&self) -> &str {
        "block"
    }

    fn bounds(&self) -> Aabb {
        Aabb::new(self.offset, self.offset + self.dimensions)
    }

    /// Six tetrahedra around the diagonal from the lowest to the highest corner (Kuhn's
    /// subdivision), which agrees from block to block.
    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        let vertices = self.bounds().corners().to_vec();
        let paths = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
        let tetrahedra = paths.map(|[a, b]| [0, a, b, 7]).to_vec();
        Ok(Tessellation { vertices, tetrahedra, collapsed: 0 })
    }

    fn as_block(&self) -> Option<Aabb> {
        Some(self.bounds())
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn block_tessellates_into_its_volume() {
        let block = Block::new(DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 3.0, 5.0)).unwrap();
        let mesh = block.tessellate().unwrap();
        let volume = |t: &[u32; 4]| {
            let [a, b, c, d] = t.map(|i| mesh.vertices[i as usize]);
            (b - a).cross(c - a).dot(d - a) / 6.0
        };
        assert!(mesh.tetrahedra.iter().all(|t| (volume(t) - 5.0).abs() < 1e-12));
    }

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
