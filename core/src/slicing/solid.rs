//! What is sliced: a shape's geometry with all that goes along on its polygons.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use crate::{
    Aabb, ActionError, Attribute, Clip, ParameterValue, Tessellation, geometry::ClipRegion, resolve::ResolvedShape,
};

/// Voxels along the diagonal of a shape without any.
const VOXELS_WITHOUT_VOLUME: f64 = 256.0;

/// A shape's geometry, tessellated where it is no block, with its place, region, clip and attributes.
/// An action keeps it while the geometry's version is the same.
#[derive(Clone, Debug)]
pub struct Solid {
    id: u64,
    name: String,
    geometry_version: u64,
    transform: DAffine3,
    to_object: DAffine3,
    body: Body,
    region: Option<ClipRegion>,
    clip: Clip,
    to_texture: DAffine3,
    to_voxels: DMat3,
    attributes: Vec<(String, Attribute)>,
}

/// What holds the volume.
#[derive(Clone, Debug)]
pub enum Body {
    /// A box: geometry ∩ the first volume's geometry ROI.
    Block(Aabb),
    /// Tetrahedra.
    Cells(Arc<Tessellation>),
}

impl Solid {
    /// What is sliced of a shape; `None` where it holds no volume. `earlier` is what was made of it
    /// before: its tessellation is kept where the geometry is the same.
    ///
    /// # Errors
    /// If the geometry is damaged.
    pub fn new(shape: &ResolvedShape, earlier: Option<&Self>) -> Result<Option<Self>, ActionError> {
        let state = &shape.state;
        if state.geometry.as_surface().is_some() {
            return Ok(None);
        }
        let attributes = attributes(shape);
        let kept = earlier.filter(|e| e.id == shape.id && e.geometry_version == state.geometry_version);
        // A block that carries numbers at its corners is cut as cells, like a mesh.
        let body = match (shape.block().filter(|_| attributes.is_empty()), kept.map(|e| &e.body)) {
            (Some(block), _) if block.min.cmplt(block.max).all() => Body::Block(block),
            (Some(_), _) => return Ok(None),
            (None, Some(Body::Cells(made))) => Body::Cells(Arc::clone(made)),
            (None, _) => Body::Cells(Arc::new(tessellate(shape)?)),
        };
        let own_coordinates = match &body {
            Body::Cells(made) if made.tetrahedra.is_empty() => return Ok(None),
            Body::Cells(made) => made.texture_coordinates.is_some(),
            Body::Block(_) => false,
        };
        let texture = shape.first_volume();
        let region = texture.filter(|_| matches!(body, Body::Cells(_)) && !own_coordinates);
        let bounds = state.geometry.bounds();
        let roi = texture.map_or(bounds, |t| t.geometry_roi());
        let to_voxels = match texture {
            Some(texture) => texture.object_to_index().matrix3 * shape.to_object.matrix3,
            None => DMat3::IDENTITY * (VOXELS_WITHOUT_VOLUME / state.world_bounds().size().length()),
        };
        Ok(Some(Self {
            id: shape.id,
            name: shape.name.clone(),
            geometry_version: state.geometry_version,
            transform: state.transform,
            to_object: shape.to_object,
            region: region.map(|t| ClipRegion::crop(t.geometry_roi())),
            clip: state.clip.clone(),
            to_texture: DAffine3::from_scale(1.0 / nonzero(roi.size())) * DAffine3::from_translation(-roi.min),
            to_voxels: whole_rank(to_voxels, &state.transform, bounds),
            attributes,
            body,
        }))
    }

    /// The shape's identity.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// The shape's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What holds the volume.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Object to world space.
    pub fn transform(&self) -> &DAffine3 {
        &self.transform
    }

    /// World to object space.
    pub fn to_object(&self) -> &DAffine3 {
        &self.to_object
    }

    /// World directions to directions in voxels.
    pub fn to_voxels(&self) -> DMat3 {
        self.to_voxels
    }

    /// What cuts it, in object space.
    pub fn clip(&self) -> &Clip {
        &self.clip
    }

    /// The attributes whose numbers polygons carry, by their parameter's name, in order; each has as
    /// many numbers a vertex as components.
    pub fn attributes(&self) -> impl Iterator<Item = (&str, &Attribute)> {
        self.attributes.iter().map(|(name, attribute)| (name.as_str(), attribute))
    }

    /// How many numbers of attributes a vertex has.
    pub fn attribute_numbers(&self) -> usize {
        self.attributes.iter().map(|(_, a)| a.components).sum()
    }

    pub(super) fn region(&self) -> Option<&ClipRegion> {
        self.region.as_ref()
    }

    pub(super) fn texture(&self, object: DVec3) -> DVec3 {
        self.to_texture.transform_point3(object)
    }

    /// The box around it in object space.
    pub(super) fn bounds(&self) -> Aabb {
        match &self.body {
            Body::Block(block) => *block,
            Body::Cells(made) => made.vertices.bounds(),
        }
    }
}

fn tessellate(shape: &ResolvedShape) -> Result<Tessellation, ActionError> {
    let geometry = &shape.state.geometry;
    let made = geometry.tessellate().and_then(|made| made.validate(geometry.name()).map(|()| made));
    made.map_err(|source| ActionError::Geometry { shape: shape.name.clone(), source })
}

fn attributes(shape: &ResolvedShape) -> Vec<(String, Attribute)> {
    let attribute = |(name, value): (&String, &ParameterValue)| match value {
        ParameterValue::Attribute(a) => Some((name.clone(), a.clone())),
        _ => None,
    };
    shape.parameters.iter().filter_map(attribute).collect()
}

/// Lengths by which may be divided.
fn nonzero(size: DVec3) -> DVec3 {
    DVec3::select(size.cmpgt(DVec3::ZERO), size, DVec3::ONE)
}

/// Voxels of a volume that is constant along all axes are its bounds.
fn whole_rank(to_voxels: DMat3, transform: &DAffine3, bounds: Aabb) -> DMat3 {
    if to_voxels == DMat3::ZERO {
        return DMat3::IDENTITY / nonzero(transform.matrix3 * bounds.size()).length();
    }
    to_voxels
}
