//! Volumes as parameters of shaders: regions of interest, ranges and filters.

use std::fmt;

use glam::{DAffine3, DVec3};

use super::{Volume, VolumeError};
use crate::Aabb;

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

/// The box of a region of samples in object space; an axis of one sample is one spacing thick.
pub(super) fn roi_extent(roi: &Roi, spacing: DVec3) -> Aabb {
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
