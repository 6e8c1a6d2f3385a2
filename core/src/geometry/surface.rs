//! Surfaces: opaque triangles.

use std::any::Any;

use super::{Aabb, Geometry, GeometryError, Points, Tessellation};
use crate::Buffer;

const NAME: &str = "surface";

/// Opaque triangles, simply lit. Shared, never copied; cheap to clone.
#[derive(Clone, Debug)]
pub struct Surface {
    points: Points,
    triangles: Buffer,
    normals: Option<Points>,
    bounds: Aabb,
}

impl Surface {
    /// Triangles between points: three `u32` each, in native byte order.
    ///
    /// # Errors
    /// If there is no triangle, an index is out of range, or the indices make no whole triangles.
    pub fn new(points: Points, triangles: Buffer) -> Result<Self, GeometryError> {
        let count = points.len();
        let Some(indices) = triangles.as_slice::<[u32; 3]>() else {
            let found = format!("{} bytes", triangles.len());
            return Err(GeometryError::invalid(NAME, "triangles", found, "aligned triples of indices of 32 bits"));
        };
        if indices.is_empty() {
            return Err(GeometryError::invalid(NAME, "number of triangles", 0, "at least 1"));
        }
        let bad = indices.iter().enumerate().find_map(|(t, v)| Some((t, v.iter().find(|&&i| i as usize >= count)?)));
        if let Some((triangle, index)) = bad {
            let what = format!("vertex index of triangle {triangle}");
            return Err(GeometryError::invalid(NAME, what, index, format!("below {count}")));
        }
        let bounds = points.bounds();
        Ok(Self { points, triangles, normals: None, bounds })
    }

    /// The same surface with a normal for each vertex, in object space, of any length; without,
    /// each triangle is flat.
    ///
    /// # Errors
    /// If there are not as many as vertices.
    pub fn with_normals(mut self, normals: Points) -> Result<Self, GeometryError> {
        if normals.len() != self.points.len() {
            let wanted = format!("{}, one a vertex", self.points.len());
            return Err(GeometryError::invalid(NAME, "number of normals", normals.len(), wanted));
        }
        self.normals = Some(normals);
        Ok(self)
    }

    /// The vertices.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// The triangles.
    pub fn triangles(&self) -> &[[u32; 3]] {
        self.triangles.as_slice().unwrap_or_default()
    }

    /// The triangles as they are kept: three `u32` each.
    pub fn triangle_data(&self) -> &Buffer {
        &self.triangles
    }

    /// The vertices' normals.
    pub fn normals(&self) -> Option<&Points> {
        self.normals.as_ref()
    }
}

impl Geometry for Surface {
    fn name(&self) -> &str {
        NAME
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        Err(GeometryError::invalid(
            NAME,
            "inside",
            "none",
            "a geometry that holds volume; draw it with the shader surface",
        ))
    }

    fn as_surface(&self) -> Option<&Surface> {
        Some(self)
    }

    fn vertex_count(&self) -> Option<usize> {
        Some(self.points.len())
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
