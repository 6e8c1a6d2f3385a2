//! Vertices: as many as 32 bits can name, all of them finite.

use std::{collections::HashMap, path::Path};

use volact_core::{Buffer, LoadError, Points, ScalarType, glam::DVec3};

use crate::numbers::{NumberType, Numbers};

/// The most vertices that indices of 32 bits can name.
const MOST_VERTICES: u64 = u32::MAX as u64;

/// Refuses more vertices than can be named.
pub(crate) fn check_count(path: &Path, what: &str, count: u64) -> Result<usize, LoadError> {
    if count <= MOST_VERTICES {
        return Ok(count as usize);
    }
    Err(LoadError::invalid(path, what, count, format!("at most {MOST_VERTICES}")))
}

/// Three numbers a vertex as points, shared where they are floats. `owner` says what a vertex
/// belongs to, for the error if a number is not finite.
pub(crate) fn finite_points(
    path: &Path,
    numbers: Numbers,
    owner: impl FnOnce(usize) -> String,
) -> Result<Points, LoadError> {
    let (scalar, data) = match numbers.kind {
        NumberType::Scalar(scalar @ (ScalarType::F32 | ScalarType::F64)) => (scalar, numbers.data),
        kind => {
            let value = |i| match kind {
                NumberType::Scalar(scalar) => scalar.read(numbers.data.bytes(), i),
                _ => numbers.integer(i).map_or(f64::NAN, |v| v as f64),
            };
            (ScalarType::F64, Buffer::from_vec((0..numbers.len()).map(value).collect::<Vec<f64>>()))
        }
    };
    let bad = match scalar {
        ScalarType::F32 => not_finite(data.as_slice::<f32>(), |v| v.is_finite()),
        _ => not_finite(data.as_slice::<f64>(), |v| v.is_finite()),
    };
    if let Some(at) = bad {
        let vertex = at / 3;
        let found: Vec<f64> = (3 * vertex..3 * vertex + 3).map(|i| scalar.read(data.bytes(), i)).collect();
        let what = format!("vertex {vertex} ({})", owner(vertex));
        return Err(LoadError::invalid(path, what, format!("{found:?}"), "three finite numbers"));
    }
    Points::new(scalar, data).map_err(|source| LoadError::geometry(path, source))
}

fn not_finite<T>(values: Option<&[T]>, finite: impl Fn(&T) -> bool) -> Option<usize> {
    values.and_then(|v| v.iter().position(|v| !finite(v)))
}

/// Vertices of several parts of a mesh, of which those in the same place are one.
#[derive(Default)]
pub(crate) struct Joined {
    first: HashMap<[u64; 3], u32>,
    count: u32,
}

impl Joined {
    /// The numbers of the next part's vertices.
    pub(crate) fn places(&mut self, path: &Path, points: &Points) -> Result<Vec<u32>, LoadError> {
        check_count(path, "number of vertices of all parts", u64::from(self.count) + points.len() as u64)?;
        let place = |(i, p): (usize, DVec3)| {
            // Adding zero makes one of both zeros.
            let key = p.to_array().map(|v| (v + 0.0).to_bits());
            *self.first.entry(key).or_insert(self.count + i as u32)
        };
        let places = points.iter().enumerate().map(place).collect();
        self.count += points.len() as u32;
        Ok(places)
    }
}
