//! What is the same for every sample of a shape.

use volact_core::{
    ParameterType, ParameterValue,
    glam::{DAffine3, DVec3},
    parameter::ParameterMap,
};

use super::kernel::Function;
use crate::{
    Program,
    signatures::{Derived, kind_of},
};

/// The values of a shape's parameters, and its place in the world.
#[derive(Clone, Copy, Debug)]
pub struct Uniforms<'a> {
    /// The parameters, with defaults filled in.
    pub parameters: &'a ParameterMap,
    /// Object space to world space.
    pub object_to_world: DAffine3,
    /// The point of the world that is the origin of local space.
    pub origin: DVec3,
}

/// A uniform value: floats, or a single whole number or truth value.
pub(crate) enum Uniform {
    Floats(Vec<f64>),
    Int(i64),
    Bool(bool),
}

impl Uniforms<'_> {
    /// The value of a function that depends on no sample; `None` for one that does.
    pub(crate) fn value(&self, program: &Program, function: Function) -> Option<Uniform> {
        let parameter = program.declaration().parameters.get(function.parameter)?;
        let given = self.parameters.get(&parameter.name);
        let kind = kind_of(parameter);
        Some(match function.derived {
            Derived::Given => Uniform::Bool(given.is_some()),
            Derived::Spacing => Uniform::Floats(vec![given.map_or(0.0, |v| self.spacing(v))]),
            Derived::Local => match given {
                Some(ParameterValue::Vec3(v)) => Uniform::Floats((*v - self.origin).to_array().to_vec()),
                _ => Uniform::Floats(vec![0.0; 3]),
            },
            Derived::Plain => match (given, kind) {
                (Some(ParameterValue::Int(v)), Some(ParameterType::Float)) => Uniform::Floats(vec![*v as f64]),
                (Some(ParameterValue::Float(v)), _) => Uniform::Floats(vec![*v]),
                (Some(ParameterValue::Int(v)), _) => Uniform::Int(*v),
                (Some(ParameterValue::Bool(v)), _) => Uniform::Bool(*v),
                (Some(ParameterValue::Vec2(v)), _) => Uniform::Floats(v.to_array().to_vec()),
                (Some(ParameterValue::Vec3(v)), _) => Uniform::Floats(v.to_array().to_vec()),
                (Some(ParameterValue::Vec4(v)), _) => Uniform::Floats(v.to_array().to_vec()),
                (Some(ParameterValue::Color(v)), _) => Uniform::Floats(v.to_vec()),
                (Some(ParameterValue::Matrix(m)), _) => Uniform::Floats(m.to_cols_array().to_vec()),
                (Some(ParameterValue::Choice(word)), _) => {
                    Uniform::Int(parameter.choices.iter().position(|w| w == word).unwrap_or(0) as i64)
                }
                (_, Some(ParameterType::Int | ParameterType::Choice)) => Uniform::Int(0),
                (_, Some(ParameterType::Bool)) => Uniform::Bool(false),
                // As many as any type has; what is too many is not looked at.
                _ => Uniform::Floats(vec![0.0; 16]),
            },
            _ => return None,
        })
    }

    /// The smallest distance between neighbouring samples in the world.
    fn spacing(&self, value: &ParameterValue) -> f64 {
        let ParameterValue::Volume(texture) = value else { return 0.0 };
        let size = texture.voxel_size();
        let lengths = DVec3::AXES.map(|axis| self.object_to_world.transform_vector3(axis * size).length());
        lengths.into_iter().fold(f64::INFINITY, f64::min)
    }
}
