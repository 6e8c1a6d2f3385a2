//! Where the numbers of shapes and their parameters lie, and which texture is bound where.

use volact_core::{Compositing, ParameterType};

use super::SHAPE_ROWS;
use crate::{Program, signatures::kind_of};

/// How a volume is read: what a module depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VolumeUse {
    /// Channels of the texture: 1, 2 or 4.
    pub channels: u32,
    /// The nearest sample instead of interpolation.
    pub nearest: bool,
    /// Interpolation by the device's sampler instead of exact weights.
    pub hardware: bool,
}

/// What of a shape a module depends on.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// The shader.
    pub program: Program,
    /// For each declared parameter how its volume is read; `None` where it is none, or left out.
    pub volumes: Vec<Option<VolumeUse>>,
    /// Whether it is a mesh.
    pub mesh: bool,
    /// Whether there are numbers at its vertices.
    pub carries: bool,
    /// The declared volume and table of a shape whose table applies at the voxels, before interpolation.
    pub pre: Option<[usize; 2]>,
}

/// The place of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// First row of its numbers.
    pub row: u32,
    /// The row that says whether it was given.
    pub given: u32,
    /// The texture's binding in group 1, where it has one.
    pub texture: Option<u32>,
}

/// The places of all parameters of all shapes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// By shape, then by declared parameter.
    pub slots: Vec<Vec<Slot>>,
    /// Rows altogether; what is longer for some frames lies behind.
    pub rows: u32,
    /// Textures altogether; their bindings begin at 1.
    pub textures: u32,
}

impl Layout {
    /// The layout for shapes in this order.
    pub fn new(recipes: &[Recipe]) -> Self {
        let mut row = SHAPE_ROWS * recipes.len() as u32;
        let mut textures = 0;
        let mut place = |recipe: &Recipe| {
            let parameters = &recipe.program.declaration().parameters;
            let slot = |(parameter, volume): (_, &Option<VolumeUse>)| {
                let rows = rows_of(kind_of(parameter));
                let first = row;
                row += rows + 1;
                let texture = volume.map(|_| {
                    textures += 1;
                    textures
                });
                Slot { row: first, given: first + rows, texture }
            };
            parameters.iter().zip(&recipe.volumes).map(slot).collect()
        };
        let slots = recipes.iter().map(&mut place).collect();
        Self { slots, rows: row, textures }
    }
}

/// Rows of a parameter of that type.
pub(super) fn rows_of(kind: Option<ParameterType>) -> u32 {
    match kind {
        Some(ParameterType::Volume) => 11,
        Some(ParameterType::Matrix) => 4,
        Some(ParameterType::Vec3) => 2,
        None => 0,
        Some(_) => 1,
    }
}

/// Whether a shape is composited in depth, and so is no picture of its own.
pub fn is_deep(compositing: Compositing) -> bool {
    matches!(compositing, Compositing::Over | Compositing::First)
}
