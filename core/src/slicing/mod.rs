//! Slicing: proxy geometry, plane by plane, for actions that draw with a rasteriser.
//!
//! A [`Slicing`] is a frame's plan: which sampling surfaces meet which shapes, and how far apart they
//! are. A [`Sweep`] goes through them in depth order and makes the geometry of one shape on one
//! surface at a time; nothing of it is kept. Since it goes surface by surface, visibility cycles and
//! meshes with holes cannot matter.
//!
//! # What a slice stands for
//! A slice is a slab of the frame's lattice: segment *k*, from *k·h* to (*k*+1)·*h* along the view axis
//! (see [`lattice`](crate::lattice)), or along the ray on spherical shells.
//!
//! - A **block** is drawn as [`Slice::hull`]: the convex hull, in pixels, of its part in the slab. Each
//!   fragment cuts its own segment: the ray's stretch in block, region, clips, near and far
//!   planes and whatever is opaque, between the slab's levels ([`Levels::cut`]). It has the segment's true
//!   length and samples at its middle, so that the picture is that of ray casting on planes, to rounding.
//! - A **mesh** is drawn as [`Slice::polygons`]: the polygons in which the slab's middle plane cuts its
//!   tetrahedra. Each fragment has the whole slab's length, [`Levels::length`]: `h/cosθ` on planes, `h` on
//!   shells. At the faces of the mesh, where slicing cannot cut, this is of first order.
//!
//! `polygons` works for blocks, too, for applications that want the slices themselves: positions,
//! texture coordinates, attributes.
//!
//! # Neither cracks nor drawn twice
//! On which side of a plane a vertex lies is a sign that all cells at the vertex see alike; a vertex on
//! a plane lies above it. A vertex that arises on an edge is computed from its ends in one order. So
//! polygons of neighbours share their edges to the last bit, and a rasteriser's rule for shared edges does
//! the rest. (Where a convex region is cut *away*, what is left of a polygon is several; along the
//! lines between these, their corners do not always meet.)
//!
//! # Order
//! Shapes that do not overlap come in their true order in each slab; those that overlap alternate from
//! slab to slab by their identity, whatever the order of drawing, which keeps second order.
//!
//! # Example
//! ```
//! use volact_core::{
//!     Appearance, FrameDesc, Registry, ScalarType, Shape, View, Volume, VolumeDesc,
//!     resolve::ResolvedShape,
//!     slicing::{Order, Polygons, Sampling, Slicing, Solid},
//! };
//!
//! let volume = Volume::new(VolumeDesc::new([9, 9, 9], ScalarType::U8, 1), vec![1u8; 729])?;
//! let shape = Shape::around(&volume, Appearance::new("simple"));
//! let frame = FrameDesc::fit(&shape, View::Iso, 64, 64);
//!
//! let resolved = ResolvedShape::new(&shape, Registry::with_core().shaders())?;
//! let solid = Solid::new(&resolved, None)?.expect("a block holds volume");
//! let slicing = Slicing::new(vec![&solid], &frame, &Sampling::default())?;
//! let mut sweep = slicing.sweep(Order::BackToFront);
//! let (mut polygons, mut volume) = (Polygons::new(), 0.0);
//! while let Some(slice) = sweep.next_slice() {
//!     slice.polygons(&mut polygons);
//!     for face in polygons.faces() {
//!         volume += polygons.area(face) * slicing.step().distance;
//!         for vertex in polygons.vertices(face) {
//!             assert!((vertex.position / 8.0 - vertex.texture).length() < 1e-12);
//!         }
//!     }
//! }
//! assert!((volume / 512.0 - 1.0).abs() < 0.01, "{volume}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod block;
mod cells;
mod choice;
mod hull;
mod levels;
mod order;
mod plan;
mod polygon;
mod sampling;
mod solid;
mod sweep;
mod view;

use thiserror::Error;

pub use hull::MARGIN;
pub use levels::{Levels, Slabs};
pub use plan::Slicing;
pub use polygon::{Face, PolygonVertex, Polygons};
pub use sampling::{Planner, Rate, Sampling, SamplingMode, SamplingSpace, Step};
pub use solid::{Body, Solid};
pub use sweep::{Order, Slice, Sweep};
pub use view::PixelMap;

use crate::camera::CameraError;

/// Why a frame cannot be sliced.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum SlicingError {
    /// A number out of bounds.
    #[error("slicing: {what} is {found}, wanted {wanted}")]
    Number {
        /// Which number.
        what: &'static str,
        /// What was found.
        found: String,
        /// What was wanted.
        wanted: &'static str,
    },
    /// More planes than can be drawn, or counted.
    #[error("slicing: shape {shape:?} needs {found} planes, wanted at most {wanted}; take a larger step")]
    TooMany {
        /// The shape's name.
        shape: String,
        /// How many there were.
        found: String,
        /// How many there may be.
        wanted: String,
    },
    /// Overlapping shapes whose axis-aligned planes would differ.
    #[error(
        "slicing: shapes {first:?} and {second:?} overlap and their axes differ, wanted planes along the same \
         axis; take viewport-aligned planes"
    )]
    Axes {
        /// One shape's name.
        first: String,
        /// The other's.
        second: String,
    },
    /// The camera is unusable.
    #[error(transparent)]
    Camera(#[from] CameraError),
}
