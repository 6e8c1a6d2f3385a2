//! What a file of a mesh holds: a geometry and its vertices' attributes.

use std::sync::Arc;

use crate::{Attribute, Geometry, Volume, Warning};

/// A mesh or surface from a file. Cheap to clone.
#[derive(Clone, Debug)]
pub struct MeshData {
    /// The name used in messages.
    pub name: String,
    /// A [`Mesh`](crate::Mesh), [`StructuredMesh`](crate::StructuredMesh) or
    /// [`Surface`](crate::Surface).
    pub geometry: Arc<dyn Geometry>,
    /// Numbers of its vertices, in the file's order.
    pub attributes: Vec<Attribute>,
    /// What is worth knowing about the file: what was left out or repaired.
    pub warnings: Vec<Warning>,
}

impl MeshData {
    /// The attribute of that name.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name)
    }
}

/// What a file can hold.
#[derive(Clone, Debug)]
pub enum Data {
    /// Voxels.
    Volume(Volume),
    /// A mesh or surface.
    Mesh(MeshData),
}
