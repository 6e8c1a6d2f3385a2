//! Geometry: *where* to draw, in a shape's object space.
//!
//! A [`Geometry`] of one's own needs bounds and a tessellation. [`Block`], [`Mesh`],
//! [`StructuredMesh`], [`Sphere`] and [`Cylinder`] hold volume; a [`Surface`] is opaque triangles.
//! [`Sliced`] draws any of them on planes, and a [`Clip`] cuts shapes and scenes.

mod aabb;
mod adjacency;
mod block;
mod builtin;
mod clip;
mod mesh;
mod points;
mod report;
mod slices;
mod solids;
mod structured;
mod surface;
mod tessellation;

use std::{any::Any, fmt};

use thiserror::Error;

pub use aabb::Aabb;
pub use adjacency::{Adjacency, BOUNDARY};
pub use block::Block;
pub(crate) use builtin::builtin;
pub use clip::{Clip, ClipRegion, Plane, Spans};
pub use mesh::{CellType, CellTypes, Mesh};
pub use points::Points;
pub use report::{CellCount, MeshReport};
pub use slices::{SliceStyle, Sliced, Slices};
pub use solids::{Cylinder, Sphere};
pub use structured::StructuredMesh;
pub use surface::Surface;
pub use tessellation::Tessellation;

/// Why a geometry cannot be drawn.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GeometryError {
    /// A plugin failed.
    #[error(transparent)]
    Plugin(#[from] crate::plugin::PluginError),
    /// A number out of bounds.
    #[error("geometry {geometry:?}: {what} is {found}, wanted {wanted}")]
    Invalid {
        /// The geometry's registered name.
        geometry: String,
        /// Which part.
        what: String,
        /// What was found.
        found: String,
        /// What was wanted.
        wanted: String,
    },
}

impl GeometryError {
    /// A part of a geometry that is not what it should be.
    pub fn invalid(geometry: &str, what: impl Into<String>, found: impl ToString, wanted: impl Into<String>) -> Self {
        Self::Invalid { geometry: geometry.into(), what: what.into(), found: found.to_string(), wanted: wanted.into() }
    }
}

/// Where to draw. A geometry of one's own needs its bounds and a tessellation.
pub trait Geometry: fmt::Debug + Send + Sync + 'static {
    /// The name under which it is registered, e.g. `block`.
    fn name(&self) -> &str;

    /// The smallest known box around it, in object space.
    fn bounds(&self) -> Aabb;

    /// The geometry as tetrahedra that neither overlap nor leave gaps.
    ///
    /// The same at every call. Actions call it once for each version of a shape's geometry.
    ///
    /// # Errors
    /// If the geometry is damaged, or holds no volume.
    fn tessellate(&self) -> Result<Tessellation, GeometryError>;

    /// The box that this geometry is, where it is one: a box is never drawn through tetrahedra.
    fn as_block(&self) -> Option<Aabb> {
        None
    }

    /// The triangles that this geometry is, where it is an opaque surface and holds no volume.
    fn as_surface(&self) -> Option<&Surface> {
        None
    }

    /// The planes on which it is drawn, where it is.
    fn slices(&self) -> Option<&Slices> {
        None
    }

    /// The number of vertices for which a per-vertex attribute must have numbers, where it is
    /// known without a tessellation. The tessellation's first vertices are these, in this order.
    fn vertex_count(&self) -> Option<usize> {
        None
    }

    /// Access to the concrete type, for actions that know it.
    fn as_any(&self) -> &dyn Any;
}
