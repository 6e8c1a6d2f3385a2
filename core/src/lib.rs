//! The core of Volact: *what* to draw, and the contract of those who draw it.
//!
//! A [`Shape`] is a [`Geometry`], an [`Appearance`] and an affine transform. A
//! [`RenderAction`] draws shapes into a [`Frame`]. Actions, shaders, geometries and loaders are
//! found by name in a [`Registry`], each with its [`Declaration`].
//!
//! This crate knows no backend, no GPU and no file format; everything else depends on it.

pub mod action;
pub mod attribute;
pub mod bulk;
pub mod bvh;
pub mod camera;
pub mod checked;
pub mod config;
pub mod frame;
pub mod geometry;
pub mod lattice;
pub mod lifecycle;
pub mod loader;
pub mod mesh_data;
pub mod mutation;
pub mod names;

pub mod null;
pub mod opaque;
pub mod parameter;
pub mod pixels;
pub mod planner;
#[expect(unsafe_code, reason = "what crosses to plugins is C")]
pub mod plugin;
pub mod registry;
pub mod resolve;
pub mod scene;
pub mod select;
pub mod shader;
pub mod shader_file;
pub mod shape;
pub mod slicing;
pub mod table;
pub mod volume;
pub mod warning;

pub use action::{ActionError, Caps, Context, Options, RenderAction};
pub use attribute::Attribute;
pub use bulk::{Buffer, Bulk};
pub use bvh::Bvh;
pub use camera::{Camera, LinearRays, Projection, Ray, RayGrid, View};
pub use frame::{Frame, FrameDesc, Method, Statistics, Viewport};
pub use geometry::{
    Aabb, Block, CellType, CellTypes, Clip, ClipRegion, Cylinder, Geometry, Mesh, Plane, Points, SliceStyle, Sliced,
    Slices, Sphere, StructuredMesh, Surface, Tessellation,
};
pub use glam;
pub use loader::{LoadError, LoadOptions, Loader, Progress, Region, VolumeReader};
pub use mesh_data::{Data, MeshData};
pub use opaque::{Opaque, OpaqueDepth};
pub use parameter::{Declaration, ParameterDecl, ParameterType, ParameterValue};
pub use pixels::Pixels;
pub use registry::Registry;
pub use shader::{Compositing, ShaderEntry, ShaderText};
pub use shader_file::ShaderFile;
pub use shape::{Appearance, Shape};
pub use table::{ControlPoint, LookupTable, TableInterpolation};
pub use volume::{Filter, Roi, ScalarType, Volume, VolumeDesc, VolumeTexture};
pub use warning::{Severity, Warning, WarningCode};
