//! An even stack in place of an uneven one.

use std::collections::BTreeMap;

use volact_core::{LoadError, Region, ScalarType, VolumeReader, loader::NoProgress};

use crate::slices::SliceSource;

/// An even stack interpolated from an uneven one.
pub(super) struct Resampled {
    pub(super) inner: Box<dyn VolumeReader>,
    pub(super) places: Vec<f64>,
    pub(super) count: usize,
    /// Stored slices in use: at most two.
    pub(super) slices: BTreeMap<usize, Vec<u8>>,
}

impl Resampled {
    fn load(&mut self, n: usize) -> Result<(), LoadError> {
        if !self.slices.contains_key(&n) {
            let [nx, ny, _] = self.inner.desc().dims;
            let region = Region { min: [0, 0, n], max: [nx - 1, ny - 1, n] };
            let bytes = self.inner.read_region(region, &NoProgress)?.bytes().to_vec();
            self.slices.insert(n, bytes);
        }
        Ok(())
    }
}

impl SliceSource for Resampled {
    fn slice(&mut self, z: usize) -> Result<Vec<u8>, LoadError> {
        let last = self.places.len() - 1;
        let at = self.places[last] * z as f64 / (self.count - 1) as f64;
        let n = self.places.partition_point(|place| *place <= at).clamp(1, last) - 1;
        let weight = ((at - self.places[n]) / (self.places[n + 1] - self.places[n])).clamp(0.0, 1.0);
        self.slices.retain(|kept, _| *kept == n || *kept == n + 1);
        self.load(n)?;
        self.load(n + 1)?;
        let scalar = self.inner.desc().scalar;
        let (a, b) = (&self.slices[&n], &self.slices[&(n + 1)]);
        let mut out = Vec::with_capacity(a.len());
        for index in 0..a.len() / scalar.size() {
            let (a, b) = (scalar.read(a, index), scalar.read(b, index));
            let value = (a + weight * (b - a)).round();
            match scalar {
                ScalarType::U8 => out.push(value as u8),
                ScalarType::I8 => out.push(value as i8 as u8),
                ScalarType::U16 => out.extend_from_slice(&(value as u16).to_ne_bytes()),
                ScalarType::I16 => out.extend_from_slice(&(value as i16).to_ne_bytes()),
                ScalarType::U32 => out.extend_from_slice(&(value as u32).to_ne_bytes()),
                _ => out.extend_from_slice(&(value as i32).to_ne_bytes()),
            }
        }
        Ok(out)
    }
}
