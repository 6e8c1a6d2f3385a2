//! Volumes: voxels with a type, a size, a place and a meaning.
//!
//! A [`Volume`] is data: `dims` samples (x fastest in memory, then y, then z), one to four
//! interleaved components of one scalar type in native byte order, a linear map to the data's own
//! units, a spacing and an affine to the world. A [`VolumeTexture`] is what a shader's parameter
//! takes: a volume seen through regions of interest, a value range and a filter.
//!
//! The grid is vertex-centred: sample *i* of *N* along an axis of the data ROI lies at
//! *i*/(*N*−1) of the geometry ROI's extent.

mod labels;
mod scalar;
mod texture;

use std::{
    fmt,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
};

use glam::{DAffine3, DVec3};
use thiserror::Error;

use crate::{Aabb, Buffer};
pub use labels::Labels;
pub use scalar::ScalarType;
use texture::roi_extent;
pub use texture::{Components, Filter, Roi, VolumeTexture};

/// A new number for something whose changes are tracked; never zero, never the same twice.
pub fn next_version() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// What a volume is, without its voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeDesc {
    /// What to call it in messages: usually the file's name.
    pub name: String,
    /// Samples along x, y and z, each at least one.
    pub dims: [usize; 3],
    /// Type of each number.
    pub scalar: ScalarType,
    /// Numbers a sample: 1 to 4.
    pub components: usize,
    /// Distance between samples in object space along x, y, z; positive.
    pub spacing: DVec3,
    /// Object space to world space. Object space has its origin at the first sample and its axes
    /// along the grid's; rotation, mirroring, shear and the origin's place are in here.
    pub placement: DAffine3,
    /// Data unit = stored number × slope + intercept.
    pub slope: f64,
    /// See `slope`.
    pub intercept: f64,
    /// The unit of the data's values, if known, e.g. `HU`.
    pub unit: String,
}

impl VolumeDesc {
    /// A description with spacing 1 at the world's origin and values as stored.
    pub fn new(dims: [usize; 3], scalar: ScalarType, components: usize) -> Self {
        Self {
            name: "volume".into(),
            dims,
            scalar,
            components,
            spacing: DVec3::ONE,
            placement: DAffine3::IDENTITY,
            slope: 1.0,
            intercept: 0.0,
            unit: String::new(),
        }
    }

    /// Samples altogether; `None` where that overflows.
    pub fn samples(&self) -> Option<usize> {
        self.dims.iter().try_fold(1usize, |n, &d| n.checked_mul(d))
    }

    /// Bytes of all voxels; `None` where that overflows.
    pub fn bytes(&self) -> Option<usize> {
        self.samples()?.checked_mul(self.components)?.checked_mul(self.scalar.size())
    }

    /// The box of the whole grid in object space: spacing × (N−1) along each axis. An axis of one
    /// sample, which is constant, is one spacing thick, centred on its sample.
    pub fn extent(&self) -> Aabb {
        roi_extent(&Roi::whole(self.dims), self.spacing)
    }

    /// Checks everything that can be checked without voxels.
    pub fn validate(&self) -> Result<(), VolumeError> {
        let bad = |what, found: String, wanted| {
            Err(VolumeError::Description { volume: self.name.clone(), what, found, wanted })
        };
        if self.dims.contains(&0) {
            return bad("dimensions", format!("{:?}", self.dims), "at least one sample along each axis");
        }
        if !(1..=4).contains(&self.components) {
            return bad("components", self.components.to_string(), "1 to 4");
        }
        if !(self.spacing.is_finite() && self.spacing.min_element() > 0.0) {
            return bad("spacing", self.spacing.to_string(), "positive and finite");
        }
        if !self.placement.is_finite() || self.placement.matrix3.determinant() == 0.0 {
            return bad("placement", format!("{:?}", self.placement), "finite and invertible");
        }
        if !(self.slope.is_finite() && self.intercept.is_finite() && self.slope != 0.0) {
            let found = format!("slope {}, intercept {}", self.slope, self.intercept);
            return bad("value map", found, "finite, with a slope other than 0");
        }
        if self.bytes().is_none() {
            return bad("dimensions", format!("{:?}", self.dims), "a size that memory can hold");
        }
        Ok(())
    }
}

/// Why a volume cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum VolumeError {
    /// The description contradicts itself.
    #[error("volume {volume:?}: {what} is {found}, wanted {wanted}")]
    Description {
        /// The volume's name.
        volume: String,
        /// Which part.
        what: &'static str,
        /// What was found.
        found: String,
        /// What was wanted.
        wanted: &'static str,
    },
    /// The buffer is not as long as the description says.
    #[error("volume {volume:?}: {found} bytes of voxels, wanted {wanted}")]
    Length {
        /// The volume's name.
        volume: String,
        /// Bytes given.
        found: usize,
        /// Bytes that dimensions, components and type need.
        wanted: usize,
    },
    /// A region of interest reaches outside the data.
    #[error("volume {volume:?}: data region {roi}, wanted a part of {dims:?}")]
    Roi {
        /// The volume's name.
        volume: String,
        /// The region.
        roi: Roi,
        /// The volume's dimensions.
        dims: [usize; 3],
    },
}

/// Voxels with their description: shared by reference, cheap to clone.
#[derive(Clone)]
pub struct Volume(Arc<Inner>);

struct Inner {
    id: u64,
    version: AtomicU64,
    desc: VolumeDesc,
    data: Buffer,
    range: std::sync::Mutex<Option<(u64, Option<[f64; 2]>)>>,
    labels: labels::Cache,
}

impl Volume {
    /// A volume of `data`, which is shared, not copied.
    ///
    /// # Errors
    /// If the description is inconsistent or `data` has not the length that it says.
    pub fn new(desc: VolumeDesc, data: impl Into<Buffer>) -> Result<Self, VolumeError> {
        desc.validate()?;
        let data = data.into();
        let wanted = desc.bytes().unwrap_or(usize::MAX);
        if data.len() != wanted {
            return Err(VolumeError::Length { volume: desc.name, found: data.len(), wanted });
        }
        let id = next_version();
        let version = AtomicU64::new(next_version());
        Ok(Self(Arc::new(Inner { id, version, desc, data, range: Default::default(), labels: Default::default() })))
    }

    /// What identifies the data: shapes with the same id share one resident copy.
    pub fn id(&self) -> u64 {
        self.0.id
    }

    /// Changes with [`touch`](Self::touch).
    pub fn version(&self) -> u64 {
        self.0.version.load(Ordering::Acquire)
    }

    /// Says that the voxels were changed in place. Dimensions and type never change.
    pub fn touch(&self) {
        self.0.version.store(next_version(), Ordering::Release);
    }

    /// The description.
    pub fn desc(&self) -> &VolumeDesc {
        &self.0.desc
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.0.desc.name
    }

    /// Samples along x, y, z.
    pub fn dims(&self) -> [usize; 3] {
        self.0.desc.dims
    }

    /// The voxels' bytes.
    pub fn data(&self) -> &Buffer {
        &self.0.data
    }

    /// The stored number at a sample.
    ///
    /// # Panics
    /// If the sample or component does not exist.
    #[inline]
    pub fn stored(&self, [x, y, z]: [usize; 3], component: usize) -> f64 {
        let desc = &self.0.desc;
        let [nx, ny, nz] = desc.dims;
        assert!(x < nx && y < ny && z < nz && component < desc.components, "sample outside the volume");
        let index = ((z * ny + y) * nx + x) * desc.components + component;
        desc.scalar.read(self.0.data.bytes(), index)
    }

    /// The value at a sample in the data's own units.
    ///
    /// # Panics
    /// As [`stored`](Self::stored).
    #[inline]
    pub fn value(&self, sample: [usize; 3], component: usize) -> f64 {
        self.stored(sample, component) * self.0.desc.slope + self.0.desc.intercept
    }

    /// Lowest and highest finite value over all samples and components, in the data's units;
    /// `None` if there is none. Reads all voxels once and remembers the answer until
    /// [`touch`](Self::touch).
    pub fn value_range(&self) -> Option<[f64; 2]> {
        let version = self.version();
        let mut cached = self.0.range.lock().unwrap_or_else(|e| e.into_inner());
        match *cached {
            Some((v, range)) if v == version => range,
            _ => {
                let range = self.scan_range();
                *cached = Some((version, range));
                range
            }
        }
    }

    fn scan_range(&self) -> Option<[f64; 2]> {
        let desc = &self.0.desc;
        let bytes = self.0.data.bytes();
        let mut lo = f64::INFINITY;
        let mut hi = f64::NEG_INFINITY;
        macro_rules! integers {
            ($t:ty) => {{
                let (mut a, mut b) = (<$t>::MAX, <$t>::MIN);
                for raw in bytes.chunks_exact(size_of::<$t>()) {
                    let v = <$t>::from_ne_bytes(raw.try_into().expect("chunk of that size"));
                    a = a.min(v);
                    b = b.max(v);
                }
                (lo, hi) = (f64::from(a), f64::from(b));
            }};
        }
        match desc.scalar {
            ScalarType::U8 => integers!(u8),
            ScalarType::I8 => integers!(i8),
            ScalarType::U16 => integers!(u16),
            ScalarType::I16 => integers!(i16),
            ScalarType::U32 => integers!(u32),
            ScalarType::I32 => integers!(i32),
            float => {
                for index in 0..bytes.len() / float.size() {
                    let v = float.read(bytes, index);
                    if v.is_finite() {
                        lo = lo.min(v);
                        hi = hi.max(v);
                    }
                }
            }
        }
        let (a, b) = (lo * desc.slope + desc.intercept, hi * desc.slope + desc.intercept);
        (lo <= hi).then(|| [a.min(b), a.max(b)])
    }
}

impl fmt::Debug for Volume {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Volume").field("id", &self.0.id).field("desc", &self.0.desc).finish()
    }
}

/// Equal when they share their data.
impl PartialEq for Volume {
    fn eq(&self, other: &Self) -> bool {
        self.0.id == other.0.id
    }
}
