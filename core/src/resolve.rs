//! Shapes with everything looked up and checked, as actions draw them.

use glam::DAffine3;

use crate::{
    Aabb, ActionError, Attribute, Compositing, LookupTable, ParameterValue, ShaderEntry, Shape, VolumeTexture, Warning,
    WarningCode,
    geometry::GeometryError,
    parameter::{ParameterMap, ParameterProblem, ProblemKind},
    shader::ShaderCatalog,
    shape::{ShapeState, smallest_voxel, thinnest_layer},
};
use std::sync::Arc;

/// A shape at the moment of `begin_draw`: shader found, parameters checked, defaults filled in.
#[derive(Clone, Debug)]
pub struct ResolvedShape {
    /// The shape's identity.
    pub id: u64,
    /// The shape's name.
    pub name: String,
    /// Its state.
    pub state: ShapeState,
    /// Its shader.
    pub shader: Arc<ShaderEntry>,
    /// Parameters as the shader declares them, defaults filled in.
    pub parameters: ParameterMap,
    /// World space to object space.
    pub to_object: DAffine3,
    /// Warnings about it.
    pub warnings: Vec<Warning>,
}

impl ResolvedShape {
    /// Looks everything up.
    ///
    /// # Errors
    /// If shader, parameters or transform are wrong; all problems of the parameters at once.
    pub fn new(shape: &Shape, shaders: &ShaderCatalog) -> Result<Self, ActionError> {
        let state = shape.state();
        let name = shape.name().to_owned();
        if let Some(refused) = shaders.refused(&state.shader) {
            return Err(ActionError::Shader { shape: name, source: refused.why.clone().into() });
        }
        let shader = shaders.get(&state.shader).ok_or_else(|| ActionError::UnknownShader {
            shape: name.clone(),
            shader: state.shader.clone(),
            hint: crate::names::hint(&state.shader, shaders.iter().map(|s| s.declaration.name.as_str())),
            known: shaders.iter().map(|s| s.declaration.name.as_str()).collect::<Vec<_>>().join(", "),
        })?;
        let shader = Arc::clone(shader);
        let parameters = shader.declaration.resolve(&state.parameters, |n| shaders.declares(n));
        let parameters = parameters.map_err(|mut problems| {
            improve_hints(&mut problems, &shader, shaders);
            ActionError::Parameters { shape: name.clone(), shader: state.shader.clone(), problems }
        })?;
        check_geometry(&name, &state)?;
        check_attributes(&name, &state, &parameters)?;
        let to_object = state.transform.inverse();
        let finite = state.transform.is_finite() && to_object.is_finite();
        if !finite || state.transform.matrix3.determinant() == 0.0 {
            return Err(ActionError::Transform { shape: name, found: format!("{:?}", state.transform) });
        }
        let mut warnings = shape.notes().to_vec();
        let unused = state.parameters.keys().filter(|n| {
            // Every shape carries a unit distance; that a shader needs none is no surprise.
            shader.declaration.parameter(n).is_none() && *n != "unit_distance"
        });
        warnings.extend(unused.map(|n| {
            let message = format!("parameter {n:?} is kept but shader {:?} does not use it", state.shader);
            Warning::new(WarningCode::UnusedParameter, &name, message)
        }));
        Ok(Self { id: shape.id(), name, state, shader, parameters, to_object, warnings })
    }

    /// How its samples are put together.
    pub fn compositing(&self) -> Compositing {
        self.shader.compositing
    }

    /// A volume parameter.
    pub fn volume(&self, name: &str) -> Option<&VolumeTexture> {
        match self.parameters.get(name) {
            Some(ParameterValue::Volume(v)) => Some(v),
            _ => None,
        }
    }

    /// A warning where the transform shears layers of samples so near each other that samples this far
    /// apart, in the world, may pass some by.
    pub fn coarse_for_shear(&self, step: f64) -> Option<Warning> {
        let texture = self.first_volume()?;
        let transform = &self.state.transform;
        let (voxel, layer) = (smallest_voxel(texture, transform), thinnest_layer(texture, transform));
        let message = || {
            format!(
                "sample_distance {step:?} is longer than the {layer:?} between layers of samples, which the \
                 transform shears so near each other; take a shorter one"
            )
        };
        (layer < 0.49 * voxel && step > layer).then(|| Warning::new(WarningCode::CoarseSampling, &self.name, message()))
    }

    /// The first volume that the shader declares and the shape has: with the geometry it says
    /// where the shape is.
    pub fn first_volume(&self) -> Option<&VolumeTexture> {
        self.shader.declaration.parameters.iter().find_map(|p| self.volume(&p.name))
    }

    /// A table parameter.
    pub fn table(&self, name: &str) -> Option<&LookupTable> {
        match self.parameters.get(name) {
            Some(ParameterValue::Table(t)) => Some(t),
            _ => None,
        }
    }

    /// An attribute parameter.
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        match self.parameters.get(name) {
            Some(ParameterValue::Attribute(a)) => Some(a),
            _ => None,
        }
    }

    /// A number.
    pub fn float(&self, name: &str) -> Option<f64> {
        self.parameters.get(name).and_then(ParameterValue::as_float)
    }

    /// A whole number.
    pub fn int(&self, name: &str) -> Option<i64> {
        match self.parameters.get(name) {
            Some(ParameterValue::Int(v)) => Some(*v),
            _ => None,
        }
    }

    /// The box to draw in object space: the geometry's block ∩ the first volume's geometry ROI; `None`
    /// where the geometry is no block.
    pub fn block(&self) -> Option<Aabb> {
        let block = self.state.geometry.as_block()?;
        Some(self.first_volume().map_or(block, |v| block.intersection(&v.geometry_roi())))
    }

    /// The world box around what [`block`](Self::block) holds, or around the geometry's bounds.
    pub fn world_block(&self) -> Aabb {
        let corners = self.block().unwrap_or_else(|| self.state.geometry.bounds()).corners();
        let world = corners.map(|c| self.state.transform.transform_point3(c));
        world.iter().fold(Aabb::EMPTY, |b, &c| Aabb { min: b.min.min(c), max: b.max.max(c) })
    }

    /// Whether nothing that a picture depends on differs from an earlier resolution.
    pub fn same_content(&self, other: &Self) -> bool {
        let versions = |r: &Self| r.parameters.values().map(ParameterValue::content_version).collect::<Vec<_>>();
        self.state.geometry_version == other.state.geometry_version
            && self.state.shader == other.state.shader
            && self.state.transform == other.state.transform
            && self.state.clip == other.state.clip
            && self.parameters == other.parameters
            && versions(self) == versions(other)
    }
}

/// Refuses bounds that no geometry can have.
fn check_geometry(shape: &str, state: &ShapeState) -> Result<(), ActionError> {
    let bounds = state.geometry.bounds();
    if bounds.min.is_finite() && bounds.max.is_finite() && !bounds.is_empty() {
        return Ok(());
    }
    let source = GeometryError::Invalid {
        geometry: state.geometry.name().into(),
        what: "bounds".into(),
        found: format!("{} to {}", bounds.min, bounds.max),
        wanted: "finite corners, none below the other".into(),
    };
    Err(ActionError::Geometry { shape: shape.into(), source })
}

/// Refuses attributes that do not go with the geometry's vertices.
fn check_attributes(shape: &str, state: &ShapeState, parameters: &ParameterMap) -> Result<(), ActionError> {
    let Some(vertices) = state.geometry.vertex_count() else { return Ok(()) };
    for (name, value) in parameters {
        let ParameterValue::Attribute(attribute) = value else { continue };
        if attribute.len() != vertices {
            let kind = ProblemKind::Mistyped {
                found: format!("attribute {:?} of {} vertices", attribute.name, attribute.len()),
                wanted: format!("one of {vertices}, the geometry's"),
            };
            let problems = vec![ParameterProblem { name: name.clone(), kind }];
            return Err(ActionError::Parameters { shape: shape.into(), shader: state.shader.clone(), problems });
        }
    }
    Ok(())
}

fn improve_hints(problems: &mut [ParameterProblem], shader: &ShaderEntry, shaders: &ShaderCatalog) {
    for problem in problems {
        if let ProblemKind::Unknown { nearest } = &mut problem.kind {
            *nearest = shaders.nearest_parameter(shader, &problem.name);
        }
    }
}
