//! Volumes that lie in files slice by slice.

use std::path::PathBuf;

use volact_core::{Buffer, LoadError, Progress, Region, ScalarType, VolumeDesc, VolumeReader, Warning};

use crate::payload::{advance, check_region, crop_slice, reserve};

/// What all slices of a series share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SliceLayout {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) scalar: ScalarType,
    pub(crate) components: usize,
}

impl SliceLayout {
    /// Bytes of a slice. Two 32-bit sizes and a sample of several bytes can be more than 64 bits hold.
    pub(crate) fn bytes(self) -> u64 {
        let pixels = u64::from(self.width) * u64::from(self.height);
        pixels.saturating_mul((self.components * self.scalar.size()) as u64)
    }

    /// The layout in words.
    pub(crate) fn describe(self) -> String {
        format!("{} x {}, {} of {}", self.width, self.height, self.components, self.scalar)
    }
}

/// Decodes single slices.
pub(crate) trait SliceSource: Send {
    /// All samples of slice `z`, in native byte order.
    fn slice(&mut self, z: usize) -> Result<Vec<u8>, LoadError>;
}

/// The reader over a [`SliceSource`]: decodes the slices of a region, one at a time.
pub(crate) struct SliceReader<S> {
    pub(crate) path: PathBuf,
    pub(crate) desc: VolumeDesc,
    pub(crate) warnings: Vec<Warning>,
    pub(crate) source: S,
}

impl<S: SliceSource> VolumeReader for SliceReader<S> {
    fn desc(&self) -> &VolumeDesc {
        &self.desc
    }

    fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    fn read_region(&mut self, region: Region, progress: &dyn Progress) -> Result<Buffer, LoadError> {
        check_region(&self.path, self.desc.dims, region)?;
        let [nx, ny, _] = self.desc.dims;
        let sample = self.desc.components * self.desc.scalar.size();
        let [w, h, depth] = region.dims();
        let total = w * h * depth * sample;
        // Memory grows with what is decoded: the first slice has to arrive before the rest is believed.
        let mut out = Vec::new();
        for z in region.min[2]..=region.max[2] {
            let slice = self.source.slice(z)?;
            if slice.len() != nx * ny * sample {
                let (found, wanted) = (slice.len() as u64, (nx * ny * sample) as u64);
                let what = format!("slice {z}");
                return Err(LoadError::Truncated { path: self.path.clone(), what, found, wanted });
            }
            if out.is_empty() {
                out = reserve(&self.path, total)?;
            }
            crop_slice(&slice, nx, region, sample, &mut out);
            advance(&self.path, progress, out.len() as u64, total as u64)?;
        }
        Ok(out.into())
    }
}
