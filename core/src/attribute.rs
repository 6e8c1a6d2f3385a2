//! Numbers that belong to the vertices of a geometry.

use thiserror::Error;

use crate::{Buffer, ScalarType};

/// Per-vertex numbers, shared with their owner, never copied; cheap to clone.
#[derive(Clone, Debug)]
pub struct Attribute {
    /// The name, e.g. `temperature`.
    pub name: String,
    /// Type of each number.
    pub scalar: ScalarType,
    /// Numbers a vertex.
    pub components: usize,
    /// The numbers, vertex by vertex, in native byte order.
    pub data: Buffer,
}

/// Why numbers are no attribute.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("attribute {name:?}: {what} is {found}, wanted {wanted}")]
pub struct AttributeError {
    /// The attribute's name.
    pub name: String,
    /// Which part.
    pub what: &'static str,
    /// What was found.
    pub found: String,
    /// What was wanted.
    pub wanted: String,
}

impl Attribute {
    /// The largest number that counts: products of two have to be finite.
    pub const LARGEST: f64 = 1e150;

    /// Numbers of a type, so many a vertex.
    ///
    /// # Errors
    /// If there are no numbers, or the bytes make no whole vertices.
    pub fn new(
        name: impl Into<String>,
        scalar: ScalarType,
        components: usize,
        data: Buffer,
    ) -> Result<Self, AttributeError> {
        let name = name.into();
        let vertex = components.checked_mul(scalar.size()).filter(|&n| n > 0);
        let Some(vertex) = vertex else {
            let (found, wanted) = (components.to_string(), "at least 1".to_owned());
            return Err(AttributeError { name, what: "number of components", found, wanted });
        };
        if data.is_empty() || !data.len().is_multiple_of(vertex) {
            let (found, wanted) = (data.len().to_string(), format!("a multiple of {vertex} above 0"));
            return Err(AttributeError { name, what: "number of bytes", found, wanted });
        }
        Ok(Self { name, scalar, components, data })
    }

    /// The number of vertices.
    pub fn len(&self) -> usize {
        self.data.len() / (self.components * self.scalar.size()).max(1)
    }

    /// Whether there are no numbers.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number of a component at a vertex; NaN where there is none, and for what nothing can be
    /// interpolated with: infinities and numbers beyond ±[`LARGEST`](Self::LARGEST).
    pub fn value(&self, vertex: usize, component: usize) -> f64 {
        if component >= self.components || vertex >= self.len() {
            return f64::NAN;
        }
        let value = self.scalar.read(self.data.bytes(), vertex * self.components + component);
        if value.abs() <= Self::LARGEST { value } else { f64::NAN }
    }

    /// The lowest and highest finite number of a component; `None` where there is none.
    pub fn range(&self, component: usize) -> Option<[f64; 2]> {
        let values = (0..self.len()).map(|v| self.value(v, component)).filter(|v| v.is_finite());
        values.fold(None, |range, v| {
            let [lo, hi] = range.unwrap_or([v, v]);
            Some([lo.min(v), hi.max(v)])
        })
    }
}

/// The same numbers in the same place.
impl PartialEq for Attribute {
    fn eq(&self, other: &Self) -> bool {
        let place = |a: &Self| (a.data.bytes().as_ptr(), a.data.len());
        (&self.name, self.scalar, self.components, place(self))
            == (&other.name, other.scalar, other.components, place(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attribute_reads_its_components() {
        let data = Buffer::from_vec(vec![1f32, 10.0, 2.0, 20.0, f32::NAN, 30.0]);
        let attribute = Attribute::new("t", ScalarType::F32, 2, data).unwrap();
        assert_eq!((attribute.len(), attribute.value(1, 1)), (3, 20.0));
        assert_eq!(attribute.range(0), Some([1.0, 2.0]));
        assert!(attribute.value(3, 0).is_nan() && attribute.value(0, 2).is_nan());
    }

    #[test]
    fn bytes_that_make_no_vertices_are_refused() {
        for (components, bytes) in [(0, 12), (3, 10), (1, 0), (usize::MAX, 8)] {
            let made = Attribute::new("t", ScalarType::F32, components, Buffer::from_vec(vec![0u8; bytes]));
            assert!(made.is_err(), "{components} {bytes}");
        }
    }
}
