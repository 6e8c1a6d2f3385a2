//! Shapes with a program made ready.

use volact_core::{
    Aabb, ActionError, Clip, Compositing, Slices,
    glam::{DAffine3, DVec3},
    resolve::ResolvedShape,
};
use volact_shaders::Program;

use super::{carried::Carried, program::Source, refused::has_attributes};
use crate::reference::{
    mesh::Mesh,
    prepare::{check_attributes, tessellate},
};

/// A shape made ready.
pub(in crate::reference) struct Prepared {
    /// What identifies the shape.
    pub id: u64,
    /// Its number among all that are drawn.
    pub order: usize,
    pub source: Source,
    /// The tetrahedra that it fills, where it is no block.
    pub mesh: Option<Mesh>,
    /// What they tell the program, if that is anything.
    pub carried: Option<Carried>,
    /// The box that holds it, in object space.
    pub block: Option<Aabb>,
    pub to_object: DAffine3,
    /// About the middle, in object space.
    pub center: DVec3,
    /// What cuts it, in object space.
    pub clip: Clip,
    /// The planes on which it is drawn, where it is.
    pub slices: Option<Slices>,
}

impl Prepared {
    /// How it is put together with others.
    pub fn compositing(&self) -> Compositing {
        self.source.compositing
    }
}

/// Makes a shape ready that is not refused; `None` where there is nothing of it.
///
/// # Errors
/// If its geometry cannot be tessellated or its program is too large.
pub(in crate::reference) fn prepare(
    shape: &ResolvedShape,
    program: Program,
    order: usize,
) -> Result<Option<Prepared>, ActionError> {
    let source = Source::new(shape, program.clone())?;
    let (mut mesh, mut carried) = (None, None);
    // The geometry and the region of the first volume say where it is.
    let mut block = shape.block();
    if has_attributes(shape) || shape.state.geometry.as_block().is_none() {
        let made = tessellate(shape)?;
        check_attributes(shape, &made)?;
        if made.tetrahedra.is_empty() {
            return Ok(None);
        }
        mesh = Some(Mesh::new(&made));
        carried = Carried::new(shape, &program, &source, &made);
        let placed = made.texture_coordinates.is_none();
        block = shape.first_volume().filter(|_| placed).map(|texture| texture.geometry_roi());
    }
    if block.is_some_and(|block| block.is_empty()) {
        return Ok(None);
    }
    let bounds = mesh.as_ref().map(Mesh::bounds).or(block).unwrap_or(Aabb::EMPTY);
    Ok(Some(Prepared {
        id: shape.id,
        order,
        source,
        mesh,
        carried,
        block,
        to_object: shape.to_object,
        center: bounds.center(),
        clip: shape.state.clip.clone(),
        slices: shape.state.geometry.slices().cloned(),
    }))
}
