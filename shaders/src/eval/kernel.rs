//! A function of a shader, ready to be evaluated.

use volact_core::{ParameterType, ShaderEntry};

use super::{
    Real, Uniforms,
    code::{Inst, Reg},
};
use crate::{
    Entry, Program, ShaderError,
    signatures::{Derived, kind_of},
};

/// A number of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Field {
    /// Component of the position in local space.
    Position(u8),
    /// Component of the ray's direction, of length 1, along the world's axes.
    Direction(u8),
    /// World length of the segment that the sample stands for.
    Step,
    /// Component of the direction to the eye, of length 1, along the world's axes.
    View(u8),
    /// Distance along the ray from the eye, or from the ray's origin, in world units.
    Depth,
    /// What the compositing made of the values along the ray.
    Value,
    /// The number of an attribute: parameter.
    Attribute(usize),
    /// Component of an attribute: parameter, component.
    AttributeComponent(usize, u8),
    /// The value of a volume at the sample's own position: parameter. Only of kernels
    /// [`with_values`](Kernel::with_values).
    Volume(usize),
}

/// A number that a kernel reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Input {
    /// Which argument: 0, and for `shade_segment` also 1, the back end.
    pub sample: usize,
    /// Which number of it.
    pub field: Field,
}

/// A function that a kernel asks the environment for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Function {
    /// Which parameter of the declaration.
    pub parameter: usize,
    /// What of it.
    pub derived: Derived,
}

/// A function of a shader, lowered to instructions over rows. Shared between threads.
#[derive(Clone, Debug)]
pub struct Kernel<F> {
    pub(super) shader: String,
    pub(super) code: Vec<Inst>,
    pub(super) floats: u32,
    pub(super) bits: u32,
    pub(super) float_constants: Vec<(Reg, F)>,
    pub(super) bits_constants: Vec<(Reg, u32)>,
    pub(super) inputs: Vec<(Input, Reg)>,
    pub(super) outputs: Vec<Reg>,
    pub(super) functions: Vec<Function>,
}

impl<F: Real> Kernel<F> {
    /// Lowers a function of a program with the uniform parameters of a shape.
    ///
    /// # Errors
    /// If the program has no such function, or what is left of it is too large.
    pub fn new(program: &Program, entry: Entry, uniforms: &Uniforms) -> Result<Self, ShaderError> {
        super::lower(program, entry, Some(uniforms), false).map_err(|error| error.of(program))
    }

    /// The same, but the values of volumes at samples' own positions are inputs
    /// ([`Field::Volume`]), where every sample has them: whoever walks along rays can have them at
    /// hand.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_values(program: &Program, entry: Entry, uniforms: &Uniforms) -> Result<Self, ShaderError> {
        super::lower(program, entry, Some(uniforms), true).map_err(|error| error.of(program))
    }

    /// What it reads of each sample, in the order in which [`Machine::run`](super::Machine::run)
    /// wants it.
    pub fn inputs(&self) -> impl ExactSizeIterator<Item = Input> {
        self.inputs.iter().map(|(input, _)| *input)
    }

    /// What it asks the environment for, by the number that the environment is told.
    pub fn functions(&self) -> &[Function] {
        &self.functions
    }

    /// Numbers that it gives: 4 of a medium (red, green, blue, extinction), 1 of a value.
    pub fn outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Instructions, for reports.
    pub fn instructions(&self) -> usize {
        self.code.len()
    }

    /// Rows that a machine holds for it, for reports.
    pub fn rows(&self) -> usize {
        (self.floats + self.bits) as usize
    }

    /// Whether another kernel computes the same in the same way: the same instructions on the
    /// same constants and inputs. The functions, by their numbers, are the caller's to compare.
    pub fn same(&self, other: &Self) -> bool {
        let constants =
            |k: &Self| -> Vec<(Reg, u64)> { k.float_constants.iter().map(|(r, v)| (*r, v.bits())).collect() };
        self.code == other.code
            && constants(self) == constants(other)
            && self.bits_constants == other.bits_constants
            && self.inputs == other.inputs
            && self.outputs == other.outputs
    }
}

/// The numbers of a sample in the order of the struct's members.
pub(super) fn fields(program: &Program) -> Vec<Field> {
    let vector = |make: fn(u8) -> Field| (0..3).map(make);
    let mut fields: Vec<Field> = vector(Field::Position).chain(vector(Field::Direction)).collect();
    fields.push(Field::Step);
    fields.extend(vector(Field::View));
    fields.extend([Field::Depth, Field::Value]);
    for (i, p) in program.declaration().parameters.iter().enumerate() {
        if kind_of(p) == Some(ParameterType::Attribute) {
            fields.push(Field::Attribute(i));
            fields.extend((0..4).map(|c| Field::AttributeComponent(i, c)));
        }
    }
    fields
}

impl Program {
    /// Parses, checks and lowers at once: for callers that keep only the kernel.
    ///
    /// # Errors
    /// As [`Program::new`] and [`Kernel::new`].
    pub fn kernel<F: Real>(entry: &ShaderEntry, of: Entry, uniforms: &Uniforms) -> Result<Kernel<F>, ShaderError> {
        Kernel::new(&Self::new(entry)?, of, uniforms)
    }
}
