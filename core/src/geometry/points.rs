//! Positions, shared with their owner.

use glam::DVec3;

use super::{Aabb, GeometryError};
use crate::{Buffer, ScalarType};

/// Positions in space: `x, y, z` of `f32` or `f64` in native byte order, one point after another.
/// Shared, never copied; cheap to clone.
#[derive(Clone, Debug)]
pub struct Points {
    scalar: ScalarType,
    data: Buffer,
}

impl Points {
    /// Points in a buffer of `f32` or `f64`.
    ///
    /// # Errors
    /// If the type is another, the bytes are not aligned for it or make no whole points, or a
    /// number is not finite.
    pub fn new(scalar: ScalarType, data: Buffer) -> Result<Self, GeometryError> {
        let wrong = |found: String, wanted: &str| Err(GeometryError::invalid("points", "data", found, wanted));
        let finite = match scalar {
            ScalarType::F32 => {
                data.as_slice::<[f32; 3]>().map(|p| p.iter().position(|p| !p.iter().all(|v| v.is_finite())))
            }
            ScalarType::F64 => {
                data.as_slice::<[f64; 3]>().map(|p| p.iter().position(|p| !p.iter().all(|v| v.is_finite())))
            }
            other => return wrong(format!("of type {other}"), "f32 or f64"),
        };
        let points = Self { scalar, data };
        match finite {
            None => wrong(format!("{} bytes", points.data.len()), "aligned triples of numbers"),
            Some(Some(at)) => {
                let wanted = "three finite numbers";
                Err(GeometryError::invalid("points", format!("point {at}"), points.raw(at), wanted))
            }
            Some(None) => Ok(points),
        }
    }

    /// The number of points.
    pub fn len(&self) -> usize {
        self.data.len() / (3 * self.scalar.size())
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The type of the numbers.
    pub fn scalar(&self) -> ScalarType {
        self.scalar
    }

    /// The bytes.
    pub fn data(&self) -> &Buffer {
        &self.data
    }

    /// A point.
    ///
    /// # Panics
    /// If there is no such point.
    pub fn at(&self, index: usize) -> DVec3 {
        self.raw(index)
    }

    fn raw(&self, index: usize) -> DVec3 {
        match self.scalar {
            ScalarType::F32 => {
                let points: &[[f32; 3]] = self.data.as_slice().unwrap_or_default();
                DVec3::from_array(points[index].map(f64::from))
            }
            _ => DVec3::from_array(self.data.as_slice::<[f64; 3]>().unwrap_or_default()[index]),
        }
    }

    /// All points in order.
    pub fn iter(&self) -> impl Iterator<Item = DVec3> {
        (0..self.len()).map(|i| self.raw(i))
    }

    /// The smallest box around all of them; empty where there is none.
    pub fn bounds(&self) -> Aabb {
        self.iter().fold(Aabb::EMPTY, |b, p| Aabb { min: b.min.min(p), max: b.max.max(p) })
    }
}

impl Default for Points {
    fn default() -> Self {
        std::iter::empty().collect()
    }
}

impl PartialEq for Points {
    fn eq(&self, other: &Self) -> bool {
        self.scalar == other.scalar && self.data.bytes() == other.data.bytes()
    }
}

/// Takes the positions as they are; numbers that are not finite are found by
/// [`Tessellation::validate`](super::Tessellation::validate).
impl FromIterator<DVec3> for Points {
    fn from_iter<I: IntoIterator<Item = DVec3>>(points: I) -> Self {
        let numbers: Vec<f64> = points.into_iter().flat_map(|p| p.to_array()).collect();
        Self { scalar: ScalarType::F64, data: Buffer::from_vec(numbers) }
    }
}

impl From<Vec<DVec3>> for Points {
    fn from(points: Vec<DVec3>) -> Self {
        points.into_iter().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_share_their_bytes() {
        let numbers = vec![0f32, 1.0, 2.0, 3.0, 4.0, 5.0];
        let address = numbers.as_ptr().cast::<u8>();
        let points = Points::new(ScalarType::F32, Buffer::from_vec(numbers)).unwrap();
        assert_eq!(points.data().bytes().as_ptr(), address);
        assert_eq!((points.len(), points.at(1)), (2, DVec3::new(3.0, 4.0, 5.0)));
        assert_eq!(points.bounds(), Aabb::new(DVec3::new(0.0, 1.0, 2.0), DVec3::new(3.0, 4.0, 5.0)));
    }

    #[test]
    fn points_that_are_not_finite_are_named() {
        let numbers = Buffer::from_vec(vec![0f64, 0.0, 0.0, 1.0, f64::NAN, 0.0]);
        let error = Points::new(ScalarType::F64, numbers).unwrap_err().to_string();
        assert!(error.contains("point 1"), "{error}");
        assert!(Points::new(ScalarType::F32, Buffer::from_vec(vec![0f32; 4])).is_err());
        assert!(Points::new(ScalarType::U8, Buffer::from_vec(vec![0u8; 3])).is_err());
    }
}
