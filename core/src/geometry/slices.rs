//! Slice plane sets: cuts through a geometry, drawn as textured planes.

use std::{any::Any, sync::Arc};

use super::{Aabb, Geometry, GeometryError, Plane, Surface, Tessellation};

/// How the cuts are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum SliceStyle {
    /// With the table's colour; its opacity is not looked at.
    #[default]
    Opaque,
    /// With the table's colour and opacity, which is taken as it stands: a plane has no thickness.
    Blended,
}

/// Planes through a geometry, in object space.
#[derive(Clone, Debug, PartialEq)]
pub struct Slices {
    /// The planes, any number.
    pub planes: Vec<Plane>,
    /// How they are drawn.
    pub style: SliceStyle,
    /// Whether the volume around them is drawn, too.
    pub volume: bool,
}

/// Any geometry, drawn on planes.
///
/// Where a ray meets a plane inside the geometry (and the volume's geometry ROI and all clips),
/// the value there is classified once. A ray in a plane does not meet it. Where a sample is NaN a
/// plane is transparent, also an opaque one.
#[derive(Clone, Debug)]
pub struct Sliced {
    geometry: Arc<dyn Geometry>,
    slices: Slices,
}

impl Sliced {
    /// A geometry with planes through it.
    ///
    /// # Errors
    /// If there is no plane, or the geometry holds no volume.
    pub fn new(geometry: Arc<dyn Geometry>, slices: Slices) -> Result<Self, GeometryError> {
        if slices.planes.is_empty() {
            return Err(GeometryError::invalid(geometry.name(), "number of slice planes", 0, "at least 1"));
        }
        if geometry.as_surface().is_some() {
            return Err(GeometryError::invalid(
                geometry.name(),
                "slice planes",
                "given",
                "none: a surface holds no volume",
            ));
        }
        Ok(Self { geometry, slices })
    }

    /// The geometry without the planes.
    pub fn geometry(&self) -> &Arc<dyn Geometry> {
        &self.geometry
    }
}

impl Geometry for Sliced {
    fn name(&self) -> &str {
        self.geometry.name()
    }

    fn bounds(&self) -> Aabb {
        self.geometry.bounds()
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        self.geometry.tessellate()
    }

    fn as_block(&self) -> Option<Aabb> {
        self.geometry.as_block()
    }

    fn as_surface(&self) -> Option<&Surface> {
        self.geometry.as_surface()
    }

    fn slices(&self) -> Option<&Slices> {
        Some(&self.slices)
    }

    fn vertex_count(&self) -> Option<usize> {
        self.geometry.vertex_count()
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
