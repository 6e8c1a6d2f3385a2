//! What is prepared of geometries: tetrahedra that know their neighbours, trees over triangles.

use std::{any::Any, sync::Arc};

use volact_core::{
    ActionError, Block, Cylinder, Geometry, Mesh, Points, Sliced, Sphere, StructuredMesh,
    action::Watch,
    geometry::GeometryError,
    parameter::{ParameterProblem, ProblemKind},
    resolve::ResolvedShape,
};

use crate::fast::{
    check::NAME,
    mesh::build::{Linked, MOST},
    shaded,
    surface::Skin,
};

/// A geometry made ready.
#[derive(Debug)]
pub enum Prepared {
    /// A mesh.
    Solid(Solid),
    /// Opaque triangles.
    Skin(Skin),
}

/// A mesh made ready.
#[derive(Debug)]
pub struct Solid {
    /// Its tetrahedra.
    pub linked: Linked,
    /// Texture coordinates of its vertices.
    pub texture: Option<Points>,
    /// Number of its vertices.
    vertices: usize,
}

impl Prepared {
    /// Bytes held besides what the geometry itself holds.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Solid(solid) => solid.linked.bytes(),
            Self::Skin(skin) => skin.bytes(),
        }
    }

    /// What it is, in a word.
    pub fn what(&self) -> &'static str {
        match self {
            Self::Solid(_) => "tetrahedra",
            Self::Skin(_) => "triangles",
        }
    }
}

/// The geometry of a shape without planes through it: what is prepared does not depend on them.
pub fn whole(shape: &ResolvedShape) -> &Arc<dyn Geometry> {
    let mut geometry = &shape.state.geometry;
    while let Some(sliced) = geometry.as_any().downcast_ref::<Sliced>() {
        geometry = sliced.geometry();
    }
    geometry
}

/// Whether a shape is drawn through its tetrahedra or triangles.
pub fn wanted(shape: &ResolvedShape) -> bool {
    let cells = if shaded::wanted(shape) { shaded::by_cells(shape) } else { shape.first_volume().is_none() };
    cells || shape.state.geometry.as_block().is_none()
}

/// Makes a geometry ready.
///
/// # Errors
/// If it is damaged, or larger than can be drawn.
pub fn prepare(shape: &ResolvedShape, progress: &Watch) -> Result<Prepared, ActionError> {
    let geometry = whole(shape);
    if let Some(surface) = geometry.as_surface() {
        return Ok(Prepared::Skin(Skin::new(surface)));
    }
    let failed = |source: GeometryError| ActionError::Geometry { shape: shape.name.clone(), source };
    let mesh = geometry.tessellate().map_err(failed)?;
    if !is_core(geometry.as_any()) {
        mesh.validate(geometry.name()).map_err(failed)?;
    }
    let what = format!("tetrahedra of {}", shape.name);
    let linked = Linked::new(&mesh, |done, total| progress.report(&what, done, total));
    let linked = linked.ok_or_else(|| ActionError::Limit {
        action: NAME.into(),
        what: format!("number of tetrahedra of shape {:?}", shape.name),
        found: mesh.tetrahedra.len().to_string(),
        wanted: format!("at most {MOST}"),
    })?;
    Ok(Prepared::Solid(Solid { linked, texture: mesh.texture_coordinates, vertices: mesh.vertices.len() }))
}

/// Whether a geometry is one of core's, which need no check.
fn is_core(geometry: &dyn Any) -> bool {
    geometry.is::<Block>()
        || geometry.is::<Mesh>()
        || geometry.is::<StructuredMesh>()
        || geometry.is::<Sphere>()
        || geometry.is::<Cylinder>()
}

/// Refuses attributes that do not go with a mesh's vertices.
///
/// # Errors
/// [`ActionError::Parameters`], with all such attributes.
pub fn check_attributes(shape: &ResolvedShape, solid: &Solid) -> Result<(), ActionError> {
    // A geometry that says how many vertices it has may have more in its tessellation.
    if shape.state.geometry.vertex_count().is_some() {
        return Ok(());
    }
    let attributes = shape.parameters.keys().filter_map(|name| Some((name, shape.attribute(name)?)));
    let wrong = attributes.filter(|(_, a)| a.len() != solid.vertices);
    let problems: Vec<_> = wrong
        .map(|(name, a)| ParameterProblem {
            name: name.clone(),
            kind: ProblemKind::Mistyped {
                found: format!("attribute {:?} of {} vertices", a.name, a.len()),
                wanted: format!("one of {}, the geometry's", solid.vertices),
            },
        })
        .collect();
    if problems.is_empty() {
        return Ok(());
    }
    Err(ActionError::Parameters { shape: shape.name.clone(), shader: shape.state.shader.clone(), problems })
}
