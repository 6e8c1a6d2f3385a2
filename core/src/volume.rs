//! Volumes: voxels with a type, a size, a place and a meaning.
//!
//! A [`Volume`] is data: `dims` samples (x fastest in memory, then y, then z), one to four
//! interleaved components of one scalar type in native byte order, a linear map to the data's own
//! units, a spacing and an affine to the world. A [`VolumeTexture`] is what a shader's parameter
//! takes: a volume seen through regions of interest, a value range and a filter.
//!
//! The grid is vertex-centred: sample *i* of *N* along an axis of the data ROI lies at
//! *i*/(*N*−1) of the geometry ROI's extent.

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

/// A new number for something whose changes are tracked; never zero, never the same twice.
pub fn next_version() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(1);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// The type of a stored number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names say it")]
pub enum ScalarType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F16,
    F32,
    F64,
}

impl ScalarType {
    /// All scalar types.
    pub const ALL: [Self; 9] =
        [Self::U8, Self::I8, Self::U16, Self::I16, Self::U32, Self::I32, Self::F16, Self::F32, Self::F64];

    /// Bytes of one number.
    pub fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The name, e.g. `u16`.
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::F16 => "f16",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The type of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.name() == name)
    }

    /// Whether the type holds fractions.
    pub fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    /// Lowest and highest number of an integer type; `None` for floats.
    pub fn limits(self) -> Option<[f64; 2]> {
        Some(match self {
            Self::U8 => [0.0, 255.0],
            Self::I8 => [-128.0, 127.0],
            Self::U16 => [0.0, 65535.0],
            Self::I16 => [-32768.0, 32767.0],
            Self::U32 => [0.0, f64::from(u32::MAX)],
            Self::I32 => [f64::from(i32::MIN), f64::from(i32::MAX)],
            Self::F16 | Self::F32 | Self::F64 => return None,
        })
    }

    /// Reads number `index` of `bytes`, which are in native byte order and need no alignment.
    ///
    /// # Panics
    /// If `bytes` has no such number.
    #[inline]
    pub fn read(self, bytes: &[u8], index: usize) -> f64 {
        macro_rules! get {
            ($t:ty, $n:literal) => {{
                let at = index * $n;
                let raw: [u8; $n] = bytes[at..at + $n].try_into().expect("slice of that length");
                <$t>::from_ne_bytes(raw)
            }};
        }
        match self {
            Self::U8 => f64::from(bytes[index]),
            Self::I8 => f64::from(bytes[index] as i8),
            Self::U16 => f64::from(get!(u16, 2)),
            Self::I16 => f64::from(get!(i16, 2)),
            Self::U32 => f64::from(get!(u32, 4)),
            Self::I32 => f64::from(get!(i32, 4)),
            Self::F16 => get!(half::f16, 2).to_f64(),
            Self::F32 => f64::from(get!(f32, 4)),
            Self::F64 => get!(f64, 8),
        }
    }
}

impl fmt::Display for ScalarType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
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
        Ok(Self(Arc::new(Inner { id, version, desc, data, range: Default::default() })))
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

/// A box of samples, both ends included: `min..=max` along each axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Roi {
    /// First sample.
    pub min: [usize; 3],
    /// Last sample, included.
    pub max: [usize; 3],
}

impl Roi {
    /// All samples of a grid.
    pub fn whole(dims: [usize; 3]) -> Self {
        Self { min: [0; 3], max: dims.map(|n| n.saturating_sub(1)) }
    }

    /// Samples along each axis.
    pub fn dims(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.max[a] + 1 - self.min[a])
    }
}

impl fmt::Display for Roi {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}..={:?}", self.min, self.max)
    }
}

/// How values between samples arise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Filter {
    /// Trilinear interpolation.
    #[default]
    Linear,
    /// The nearest sample.
    Nearest,
}

/// What the components of a sample mean to a shader without a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Components {
    /// One: grey and opacity alike.
    Intensity,
    /// One: opaque grey.
    Luminance,
    /// Two: grey and opacity.
    LuminanceAlpha,
    /// Three: colour, opaque.
    Rgb,
    /// Four: colour and opacity.
    Rgba,
}

impl Components {
    /// The usual meaning of that many components.
    pub fn usual(count: usize) -> Self {
        match count {
            2 => Self::LuminanceAlpha,
            3 => Self::Rgb,
            4 => Self::Rgba,
            _ => Self::Intensity,
        }
    }
}

/// A volume as a shader's parameter: data seen through regions of interest, a range and a filter.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeTexture {
    volume: Volume,
    data_roi: Roi,
    geometry_roi: Option<Aabb>,
    range: Option<[f64; 2]>,
    filter: Filter,
    meaning: Components,
}

impl VolumeTexture {
    /// The whole volume over its own extent, filtered linearly.
    pub fn new(volume: &Volume) -> Self {
        Self {
            volume: volume.clone(),
            data_roi: Roi::whole(volume.dims()),
            geometry_roi: None,
            range: None,
            filter: Filter::Linear,
            meaning: Components::usual(volume.desc().components),
        }
    }

    /// Uses a part of the data. Unless a geometry ROI is set, the part stays where it is.
    ///
    /// # Errors
    /// If the region is empty or reaches outside the data.
    pub fn with_data_roi(mut self, roi: Roi) -> Result<Self, VolumeError> {
        let dims = self.volume.dims();
        if (0..3).any(|a| roi.min[a] > roi.max[a] || roi.max[a] >= dims[a]) {
            return Err(VolumeError::Roi { volume: self.volume.name().into(), roi, dims });
        }
        self.data_roi = roi;
        Ok(self)
    }

    /// Places the data ROI into a box of the shape's object space: its first and last voxels lie
    /// on the box's faces. Moving the box shifts the texture, resizing it scales.
    ///
    /// # Errors
    /// If the box is not finite or has no volume.
    pub fn with_geometry_roi(mut self, roi: Aabb) -> Result<Self, VolumeError> {
        if !(roi.min.is_finite() && roi.max.is_finite() && roi.min.cmplt(roi.max).all()) {
            return Err(VolumeError::Description {
                volume: self.volume.name().into(),
                what: "geometry region",
                found: format!("{} to {}", roi.min, roi.max),
                wanted: "a finite box with min below max along each axis",
            });
        }
        self.geometry_roi = Some(roi);
        Ok(self)
    }

    /// Sets the values, in data units, that a shader sees as 0 and 1.
    ///
    /// # Errors
    /// If the two are equal or not finite.
    pub fn with_range(mut self, range: [f64; 2]) -> Result<Self, VolumeError> {
        if !(range[0].is_finite() && range[1].is_finite() && range[0] != range[1]) {
            return Err(VolumeError::Description {
                volume: self.volume.name().into(),
                what: "value range",
                found: format!("{range:?}"),
                wanted: "two finite values that differ",
            });
        }
        self.range = Some(range);
        Ok(self)
    }

    /// Sets the filter.
    pub fn with_filter(mut self, filter: Filter) -> Self {
        self.filter = filter;
        self
    }

    /// Takes a single component as opaque grey instead of intensity.
    pub fn as_luminance(mut self) -> Self {
        if self.meaning == Components::Intensity {
            self.meaning = Components::Luminance;
        }
        self
    }

    /// The data.
    pub fn volume(&self) -> &Volume {
        &self.volume
    }

    /// The part of the data in use.
    pub fn data_roi(&self) -> Roi {
        self.data_roi
    }

    /// The filter.
    pub fn filter(&self) -> Filter {
        self.filter
    }

    /// What the components mean.
    pub fn meaning(&self) -> Components {
        self.meaning
    }

    /// Where the data ROI lies in the shape's object space.
    pub fn geometry_roi(&self) -> Aabb {
        self.geometry_roi.unwrap_or_else(|| roi_extent(&self.data_roi, self.volume.desc().spacing))
    }

    /// The range where it is known without a look at the voxels.
    pub(crate) fn known_range(&self) -> Option<[f64; 2]> {
        let known = self.range.is_some() || self.volume.desc().scalar.limits().is_some();
        known.then(|| self.range())
    }

    /// The values, in data units, that a shader sees as 0 and 1: as set, else the whole range of
    /// an integer type (after slope and intercept), else the data's own finite range, `[0, 1]`
    /// where that is empty, and one unit wide where it is a single value.
    pub fn range(&self) -> [f64; 2] {
        if let Some(range) = self.range {
            return range;
        }
        let desc = self.volume.desc();
        if let Some(limits) = desc.scalar.limits() {
            let [a, b] = limits.map(|v| v * desc.slope + desc.intercept);
            return [a.min(b), a.max(b)];
        }
        match self.volume.value_range() {
            Some([a, b]) if a < b => [a, b],
            Some([a, _]) => [a, a + 1.0],
            None => [0.0, 1.0],
        }
    }

    /// Object space to sample coordinates: component `a` of the result is `data_roi.min[a]` on
    /// the low face of the geometry ROI and `data_roi.max[a]` on the high one; an axis of one
    /// sample gives that sample everywhere.
    pub fn object_to_index(&self) -> DAffine3 {
        let roi = self.geometry_roi();
        let min = DVec3::from_array(self.data_roi.min.map(|v| v as f64));
        let max = DVec3::from_array(self.data_roi.max.map(|v| v as f64));
        let scale = (max - min) / (roi.max - roi.min);
        DAffine3::from_scale(scale) * DAffine3::from_translation(-roi.min) + DAffine3Offset(min)
    }

    /// Distance between neighbouring samples along each axis in object space.
    pub fn voxel_size(&self) -> DVec3 {
        let size = self.geometry_roi().max - self.geometry_roi().min;
        let cells = self.data_roi.dims().map(|n| n.saturating_sub(1).max(1) as f64);
        size / DVec3::from_array(cells)
    }

    /// The value at sample coordinates (as [`object_to_index`](Self::object_to_index) gives them,
    /// clamped to the data ROI) in data units: the plain definition that backends are held to.
    /// NaN where a NaN sample has weight.
    pub fn sample(&self, at: DVec3, component: usize) -> f64 {
        let mut base = [0usize; 3];
        let mut frac = [0f64; 3];
        for a in 0..3 {
            let (lo, hi) = (self.data_roi.min[a], self.data_roi.max[a]);
            let x = at[a].clamp(lo as f64, hi as f64);
            if self.filter == Filter::Nearest {
                base[a] = ((x + 0.5).floor() as usize).min(hi);
            } else {
                base[a] = (x as usize).min(hi.saturating_sub(1)).max(lo);
                frac[a] = x - base[a] as f64;
            }
        }
        let fetch = |dx, dy, dz| self.volume.value([base[0] + dx, base[1] + dy, base[2] + dz], component);
        let lerp = |a: &dyn Fn() -> f64, b: &dyn Fn() -> f64, t: f64| {
            if t == 0.0 {
                a()
            } else if t == 1.0 {
                b()
            } else {
                let a = a();
                a + t * (b() - a)
            }
        };
        let line = |dy, dz| lerp(&|| fetch(0, dy, dz), &|| fetch(1, dy, dz), frac[0]);
        let plane = |dz| lerp(&|| line(0, dz), &|| line(1, dz), frac[1]);
        lerp(&|| plane(0), &|| plane(1), frac[2])
    }
}

impl From<&Volume> for VolumeTexture {
    fn from(volume: &Volume) -> Self {
        Self::new(volume)
    }
}

/// A translation applied after an affine, to keep `object_to_index` readable.
struct DAffine3Offset(DVec3);

impl std::ops::Add<DAffine3Offset> for DAffine3 {
    type Output = Self;
    fn add(mut self, offset: DAffine3Offset) -> Self {
        self.translation += offset.0;
        self
    }
}

fn roi_extent(roi: &Roi, spacing: DVec3) -> Aabb {
    let mut min = DVec3::from_array(roi.min.map(|v| v as f64)) * spacing;
    let mut max = DVec3::from_array(roi.max.map(|v| v as f64)) * spacing;
    for a in 0..3 {
        if roi.min[a] == roi.max[a] {
            min[a] -= spacing[a] / 2.0;
            max[a] += spacing[a] / 2.0;
        }
    }
    Aabb { min, max }
}
