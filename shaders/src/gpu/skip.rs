//! What of a shape can be skipped, and the module that finds it.

use naga::valid::ModuleInfo;
use volact_core::{VolumeTexture, resolve::ResolvedShape};

use super::{
    ComposeError,
    compose::{parse, validate},
};
use crate::{Entry, Kernel, Program, eval::Uniforms, signatures::Derived};

/// Samples of a cell along each axis.
pub const CELL: usize = 8;

/// Invocations of a workgroup along each axis.
pub const WORKGROUP: u32 = 4;

/// Where a shape's cells are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cells {
    /// The number of the first.
    pub base: u32,
    /// How many along each axis.
    pub count: [u32; 3],
    /// The declared parameter that is their volume.
    pub volume: usize,
    /// The declared parameter that is their table.
    pub table: usize,
}

impl Cells {
    /// How many altogether.
    pub fn len(&self) -> usize {
        self.count.iter().map(|n| *n as usize).product()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// The cells of a texture's volume along each axis.
pub fn count(texture: &VolumeTexture) -> [u32; 3] {
    texture.volume().dims().map(|n| n.saturating_sub(1).div_ceil(CELL).max(1) as u32)
}

/// The declared parameters, a volume and a table, such that a shape is transparent wherever the table
/// is at the volume's values; `None` where none are known.
pub fn transparent_with(shape: &ResolvedShape, program: &Program) -> Option<[usize; 2]> {
    if program.compositing() != volact_core::Compositing::Over {
        return None;
    }
    let block = shape.world_block();
    let origin = 0.5 * (block.min + block.max);
    let uniforms = Uniforms { parameters: &shape.parameters, object_to_world: shape.state.transform, origin };
    let kernel = Kernel::<f32>::new(program, Entry::Shade, &uniforms).ok()?;
    let (volume, table) = kernel.transparent_with()?;
    let [volume, table] = [kernel.functions().get(volume)?, kernel.functions().get(table)?];
    let parameters = &program.declaration().parameters;
    // Rays are inside of the first volume's region, and so of its data.
    let own = shape.volume(&parameters.get(volume.parameter)?.name)?;
    let first = shape.first_volume().is_some_and(|first| std::ptr::eq(first, own));
    (first && volume.derived == Derived::Value && table.derived == Derived::Medium)
        .then_some([volume.parameter, table.parameter])
}

/// The module of the passes, by their entry points: `volact_find_bounds`, `volact_find_empty` and
/// `volact_spread`.
///
/// # Errors
/// Never: a test composes it.
pub fn module() -> Result<(naga::Module, ModuleInfo), ComposeError> {
    let module = parse("", &[include_str!("../../wgsl/gpu/skip.wgsl")])?;
    let info = validate(&module)?;
    Ok((module, info))
}
