//! The box.

use std::any::Any;

use glam::DVec3;

use super::{Aabb, Geometry, GeometryError, Tessellation};

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
        let vertices = self.bounds().corners().into_iter().collect();
        let paths = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
        let tetrahedra = paths.map(|[a, b]| [0, a, b, 7]).to_vec();
        Ok(Tessellation { vertices, tetrahedra, ..Tessellation::default() })
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
        assert!((0..6).all(|t| (mesh.volume(t) - 5.0).abs() < 1e-12));
    }
}
