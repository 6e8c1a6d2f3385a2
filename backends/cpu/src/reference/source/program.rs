//! A shape's program, ready to be asked, and the samples that it is asked for.

use std::sync::OnceLock;

use volact_core::{
    ActionError, Compositing, LookupTable, ParameterType, ParameterValue, VolumeTexture,
    glam::{DAffine3, DVec3},
    parameter::ParameterMap,
    resolve::ResolvedShape,
};
use volact_shaders::{
    Entry, Kernel, Program,
    eval::{Field, Function, Overrun, Uniforms},
};

use super::{carried::Cell, cuts::Grids, wrong};
use crate::reference::{
    dd::Dd,
    line::{EPS, map_point},
};

/// Straight colour and extinction.
pub(in crate::reference) type Medium = [f64; 4];

/// A shape's program with the parameters that are the same for every sample.
pub(in crate::reference) struct Source {
    shape: String,
    pub(super) program: Program,
    pub(super) shade: Kernel<f64>,
    pub(super) value: Option<Kernel<f64>>,
    pub(super) segment: Option<Kernel<f64>>,
    pub(super) parameters: ParameterMap,
    /// From object to local space.
    pub(super) local: DAffine3,
    /// For each parameter that is a volume, from texture coordinates to local space.
    pub(super) unbent: Vec<Option<DAffine3>>,
    /// The point of the world that is the origin of local space.
    pub origin: DVec3,
    pub compositing: Compositing,
    /// World length over which opacity is the fraction absorbed, where the shader declares it.
    pub unit: Option<f64>,
    /// The values whose crossings are surfaces.
    pub crossed: Vec<f64>,
    /// Where the volumes that it reads change their cells.
    pub grids: Grids,
    pub(super) failed: OnceLock<Overrun>,
}

/// A sample on a course: its place, the length that it stands for, and what a compositing made.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::reference) struct Sample {
    /// Counted from the course's anchor.
    pub t: f64,
    pub step: f64,
    pub value: f64,
}

/// A ray in a shape's local space.
#[derive(Clone, Copy, Debug)]
pub(in crate::reference) struct Course<'c> {
    /// Where it is at the anchor.
    pub at: DVec3,
    /// Of length 1.
    pub direction: DVec3,
    /// The anchor's distance from where depth is counted.
    pub depth: f64,
    /// The tetrahedra that it goes through, in order; none where nothing depends on them.
    pub cells: &'c [Cell],
}

impl<'c> Course<'c> {
    /// The tetrahedron that holds a place, give or take rounding.
    pub fn cell(&self, t: f64) -> Option<&'c Cell> {
        let loose = 64.0 * EPS * (self.depth.abs() + self.at.abs().max_element() + t.abs());
        let after = self.cells.partition_point(|c| c.t[1] < t);
        let held = |c: &&Cell| c.t[0] - loose <= t && t <= c.t[1] + loose;
        let before = after.checked_sub(1).and_then(|i| self.cells.get(i));
        self.cells.get(after).filter(held).or(before.filter(held))
    }

    pub fn number(&self, field: Field, s: &Sample) -> f64 {
        let axis = |a: u8| usize::from(a.min(2));
        match field {
            Field::Position(a) => self.at[axis(a)] + self.direction[axis(a)] * s.t,
            Field::Direction(a) => self.direction[axis(a)],
            Field::View(a) => -self.direction[axis(a)],
            Field::Step => s.step,
            Field::Depth => self.depth + s.t,
            Field::Value => s.value,
            // Kernels of the reference ask for them.
            Field::Volume(_) => f64::NAN,
            Field::Attribute(_) | Field::AttributeComponent(..) => {
                self.cell(s.t).map_or(f64::NAN, |cell| cell.number(field, s.t))
            }
        }
    }
}

impl Source {
    /// Compiles the program of a shape that is not refused.
    ///
    /// # Errors
    /// [`ActionError::Shader`] if it is too large with these parameters.
    pub fn new(shape: &ResolvedShape, program: Program) -> Result<Self, ActionError> {
        let origin = shape.world_block().center();
        let uniforms = Uniforms { parameters: &shape.parameters, object_to_world: shape.state.transform, origin };
        let kernel = |entry| Kernel::<f64>::new(&program, entry, &uniforms).map_err(|error| wrong(shape, error));
        let optional = |entry| program.has(entry).then(|| kernel(entry)).transpose();
        let (shade, value, segment) = (kernel(Entry::Shade)?, optional(Entry::Value)?, optional(Entry::Segment)?);
        // The origin is carried in double-double, so that a distant scene costs no digits.
        let center = map_point(&shape.to_object, origin.to_array().map(Dd::new)).map(|d| d.hi);
        let to_object = DAffine3 { matrix3: shape.to_object.matrix3, translation: DVec3::from_array(center) };
        let functions: Vec<Function> =
            [Some(&shade), value.as_ref()].into_iter().flatten().flat_map(|k| k.functions().to_vec()).collect();
        Ok(Self {
            shape: shape.name.clone(),
            grids: Grids::new(&program, &shape.parameters, &functions, to_object),
            crossed: crossed(shape, &program),
            compositing: program.compositing(),
            unit: program.declaration().parameter("unit_distance").and_then(|_| shape.float("unit_distance")),
            parameters: shape.parameters.clone(),
            unbent: unbent(shape, &program, to_object.inverse()),
            local: to_object.inverse(),
            origin,
            program,
            shade,
            value,
            segment,
            failed: OnceLock::new(),
        })
    }

    /// A place of object space in local space.
    pub fn to_local(&self, p: DVec3) -> DVec3 {
        self.local.transform_point3(p)
    }

    /// The shape's name.
    pub fn shape(&self) -> &str {
        &self.shape
    }

    /// The first failure of the program, if any sample failed.
    ///
    /// # Errors
    /// That.
    pub fn check(&self) -> Result<(), ActionError> {
        let failed = self.failed.get().map(|overrun| Box::new(overrun.clone()));
        failed.map_or(Ok(()), |source| Err(ActionError::Shader { shape: self.shape.clone(), source }))
    }
}

/// From texture coordinates, 0 to 1 over its region, to where a volume lies in local space.
fn unbent(shape: &ResolvedShape, program: &Program, local: DAffine3) -> Vec<Option<DAffine3>> {
    let volume = |name: &str| {
        let roi = shape.volume(name)?.geometry_roi();
        Some(local * DAffine3::from_translation(roi.min) * DAffine3::from_scale(roi.max - roi.min))
    };
    program.declaration().parameters.iter().map(|p| volume(&p.name)).collect()
}

/// The values of the control points of the first table declared, in rising order.
fn crossed(shape: &ResolvedShape, program: &Program) -> Vec<f64> {
    let declared = &program.declaration().parameters;
    let Some(table) = declared.iter().find(|p| p.types.contains(&ParameterType::Table)) else { return Vec::new() };
    let range = shape.first_volume().map_or([0.0, 1.0], VolumeTexture::range);
    let [a, b] = range;
    let table = match shape.parameters.get(&table.name) {
        Some(ParameterValue::Table(table)) => table.resolve(range),
        _ => LookupTable::grey([a.min(b), a.max(b)]).resolve(range),
    };
    let mut values: Vec<f64> = table.points().iter().map(|p| p.value).filter(|v| v.is_finite()).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}
