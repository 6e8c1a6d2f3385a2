//! Meshes as rows of a buffer: the boundary's faces under a tree of boxes, as `meshes.wgsl` reads them, and
//! where cells carry numbers, the cells (`cells.wgsl`) and the numbers of their vertices (`vertices.wgsl`).
//! Surfaces lie among them ([`surface`]).
//!
//! A mesh is packed once for each version of its geometry, in the space of its own box, so that a shape's
//! transform moves none of it.

mod numbers;
mod packed;
pub mod surface;
mod tree;

use std::collections::BTreeMap;

use volact_core::{
    Aabb, ActionError, Attribute, ParameterType, Tessellation,
    geometry::GeometryError,
    glam::{DAffine3, DVec3},
    parameter::{ParameterProblem, ProblemKind},
    resolve::ResolvedShape,
};

use super::pack::Row;
use numbers::Numbers;
use packed::packed;

/// Cells of one mesh, or triangles of a surface, at most, so that four faces of each can be numbered eightfold.
const MOST: usize = 1 << 26;

/// Whether a shape is drawn as a mesh: whatever is no block, and blocks that carry numbers.
pub fn is_mesh(shape: &ResolvedShape) -> bool {
    shape.state.geometry.as_block().is_none() || carries(shape)
}

/// Whether there are numbers at a shape's vertices.
pub fn carries(shape: &ResolvedShape) -> bool {
    shape.parameters.values().any(|v| v.kind() == ParameterType::Attribute)
}

/// Where a mesh lies among the rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// Its first row.
    pub row: u32,
    /// Object space to its own, in which its box is from -1 to 1.
    pub unit: DAffine3,
}

/// The meshes of shapes, packed.
#[derive(Debug, Default)]
pub struct Meshes {
    held: BTreeMap<u64, Held>,
    /// Counts what was packed.
    packs: u64,
    /// What was packed last when the rows were laid out, by shape.
    laid: Option<Vec<[u64; 2]>>,
}

/// One mesh.
#[derive(Debug)]
struct Held {
    /// The geometry's version, and whether cells are there.
    made_of: (u64, bool),
    pack: u64,
    rows: Vec<Row>,
    bounds: Aabb,
    vertices: usize,
    /// Its first row.
    row: u32,
    numbers: Vec<Numbers>,
}

impl Meshes {
    /// Packs a shape's mesh and its numbers, unless they are there; gives the bytes of what was packed.
    ///
    /// # Errors
    /// If the geometry is damaged or holds no volume, or an attribute does not go with its vertices.
    pub fn prepare(&mut self, action: &str, shape: &ResolvedShape) -> Result<Option<usize>, ActionError> {
        if !is_mesh(shape) {
            return Ok(None);
        }
        let made_of = (shape.state.geometry_version, carries(shape));
        let mut bytes = 0;
        if self.held.get(&shape.id).is_none_or(|h| h.made_of != made_of) {
            let (rows, bounds, vertices) = rows_of(action, shape, made_of.1)?;
            bytes += size_of_val::<[Row]>(&rows);
            self.packs += 1;
            let numbers = Vec::new();
            self.held.insert(shape.id, Held { made_of, pack: self.packs, rows, bounds, vertices, row: 0, numbers });
        }
        let Some(held) = self.held.get_mut(&shape.id) else { return Ok(None) };
        check_attributes(shape, held.vertices)?;
        let changed = numbers::update(&mut held.numbers, shape, held.vertices);
        if changed > 0 {
            self.packs += 1;
            held.pack = self.packs;
        }
        bytes += changed;
        Ok((bytes > 0).then_some(bytes))
    }

    /// Lets go of the meshes of other shapes.
    pub fn retain<'a>(&mut self, shapes: impl Iterator<Item = &'a ResolvedShape>) {
        let ids: Vec<u64> = shapes.filter(|s| is_mesh(s)).map(|s| s.id).collect();
        self.held.retain(|id, _| ids.contains(id));
    }

    /// Has the rows of all meshes that are held set where they belong, unless they are what was set last; some
    /// in any case. Gives what `set` gives, which is bytes.
    ///
    /// # Errors
    /// Those of `set`, after which they are set anew.
    pub fn lay<E>(&mut self, set: impl FnOnce(Vec<Row>) -> Result<usize, E>) -> Result<usize, E> {
        let laid: Vec<_> = self.held.iter().map(|(id, held)| [*id, held.pack]).collect();
        if self.laid.as_ref() == Some(&laid) {
            return Ok(0);
        }
        self.laid = None;
        let bytes = set(self.rows())?;
        self.laid = Some(laid);
        Ok(bytes)
    }

    fn rows(&mut self) -> Vec<Row> {
        let mut rows = Vec::new();
        for held in self.held.values_mut() {
            held.row = rows.len() as u32;
            rows.extend_from_slice(&held.rows);
            held.numbers.iter_mut().for_each(|numbers| numbers.lay(&mut rows));
        }
        if rows.is_empty() {
            rows.push([0; 4]);
        }
        rows
    }

    /// Where a shape's mesh lies, once it was packed and the rows were laid out.
    pub fn placed(&self, shape: &ResolvedShape) -> Option<Placed> {
        let held = self.held.get(&shape.id).filter(|_| is_mesh(shape))?;
        Some(Placed { row: held.row, unit: unit(&held.bounds) })
    }

    /// The row by which an attribute is found: where its numbers lie, and that it was given.
    pub fn attribute(&self, shape: &ResolvedShape, parameter: &str) -> Option<Row> {
        let numbers = &self.held.get(&shape.id)?.numbers;
        Some(numbers.iter().find(|n| n.parameter == parameter)?.row())
    }

    /// The box around a shape's mesh in object space, once it was packed.
    pub fn bounds(&self, shape: &ResolvedShape) -> Option<Aabb> {
        self.held.get(&shape.id).map(|held| held.bounds)
    }
}

/// A shape's rows, the box around it, and how many vertices it has.
fn rows_of(action: &str, shape: &ResolvedShape, cells: bool) -> Result<(Vec<Row>, Aabb, usize), ActionError> {
    if let Some(surface) = shape.state.geometry.as_surface() {
        limit(action, shape, "triangles", surface.triangles().len())?;
        let bounds = surface.points().bounds();
        return Ok((surface::packed(surface, &unit(&bounds)), bounds, surface.points().len()));
    }
    let made = tessellated(action, shape)?;
    let bounds = made.vertices.bounds();
    Ok((packed(&made, &unit(&bounds), cells), bounds, made.vertices.len()))
}

/// A shape's tetrahedra, checked.
fn tessellated(action: &str, shape: &ResolvedShape) -> Result<Tessellation, ActionError> {
    let geometry = &shape.state.geometry;
    let made = geometry.tessellate().and_then(|made| made.validate(geometry.name()).map(|()| made));
    let made = made.map_err(|source: GeometryError| ActionError::Geometry { shape: shape.name.clone(), source })?;
    limit(action, shape, "tetrahedra", made.tetrahedra.len())?;
    if made.texture_coordinates.is_some() && shape.first_volume().is_some() {
        return Err(ActionError::Unsupported {
            action: action.into(),
            shape: shape.name.clone(),
            what: format!("texture coordinates of the geometry {:?}", geometry.name()),
            cure: "draw it with the action cpu, or leave them out".into(),
        });
    }
    Ok(made)
}

/// Refuses more of something than can be numbered.
fn limit(action: &str, shape: &ResolvedShape, of: &str, found: usize) -> Result<(), ActionError> {
    if found < MOST {
        return Ok(());
    }
    Err(ActionError::Limit {
        action: action.into(),
        what: format!("number of {of} of shape {:?}", shape.name),
        found: found.to_string(),
        wanted: format!("fewer than {MOST}"),
    })
}

/// Refuses attributes that have not a number for each vertex.
fn check_attributes(shape: &ResolvedShape, vertices: usize) -> Result<(), ActionError> {
    let wanted = shape.state.geometry.vertex_count().unwrap_or(vertices);
    let attributes = shape.parameters.keys().filter_map(|name| Some((name, shape.attribute(name)?)));
    let wrong = |(_, a): &(&String, &Attribute)| a.len() != wanted;
    let problem = |(name, a): (&String, &Attribute)| {
        let found = format!("attribute {:?} of {} vertices", a.name, a.len());
        let kind = ProblemKind::Mistyped { found, wanted: format!("one of {wanted}, the geometry's") };
        ParameterProblem { name: name.clone(), kind }
    };
    let problems: Vec<_> = attributes.filter(wrong).map(problem).collect();
    if problems.is_empty() {
        return Ok(());
    }
    Err(ActionError::Parameters { shape: shape.name.clone(), shader: shape.state.shader.clone(), problems })
}

/// The map that takes a box to one from -1 to 1. Where it has no extent there is nothing to tell apart.
fn unit(bounds: &Aabb) -> DAffine3 {
    if bounds.is_empty() {
        return DAffine3::IDENTITY;
    }
    let half = bounds.max / 2.0 - bounds.min / 2.0;
    let half = DVec3::select(half.cmpgt(DVec3::ZERO), half, DVec3::ONE);
    let middle = bounds.max / 2.0 + bounds.min / 2.0;
    DAffine3::from_scale(half.recip()) * DAffine3::from_translation(-middle)
}
