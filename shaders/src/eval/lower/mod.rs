//! From naga's form of a function to instructions over rows.
//!
//! Every value is a list of numbers, each a constant or a register: a vector's components, a
//! matrix's columns, a struct's members in their order. Functions are inlined (WGSL has no
//! recursion), which makes pointers plain places. What is constant is computed here, with the
//! operations that the machine has.

mod build;
mod call;
mod expression;
mod flow;
mod math;
mod place;

use std::{collections::HashMap, rc::Rc};

use naga::{Expression, FunctionArgument, Handle, Span, TypeInner};

use self::place::Place;
use super::{
    Real, Uniforms, allocate,
    check::sizes,
    code::{Class, Inst, Reg},
    kernel::{Function, Input, Kernel, fields},
    tidy,
};
use crate::{
    Entry, Program, ShaderError,
    error::{SourceError, SourceErrors},
    program::place as place_of,
};

/// The most instructions of a kernel, before what is not needed is taken out.
pub const MAX_CODE: usize = 1 << 16;
/// The most rows of a kernel.
pub const MAX_ROWS: usize = 4096;

/// A number: a constant, or a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scalar<F> {
    Float(F),
    Bits(u32),
    Row(Reg),
}

/// The value of an expression.
#[derive(Clone, Debug)]
enum Value<F> {
    Data(Rc<[Scalar<F>]>),
    Pointer(Place<F>),
}

/// Which samples are meant.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mask {
    All,
    Some(Reg),
    /// Nobody comes here.
    Dead,
}

/// Why a function cannot be lowered.
#[derive(Debug)]
pub(crate) struct LowerError {
    span: Option<Span>,
    message: String,
}

impl LowerError {
    fn new(message: impl Into<String>) -> Self {
        Self { span: None, message: message.into() }
    }

    /// As an error of the author's text, whose first byte is `start` of the whole.
    pub(crate) fn shifted(self, start: usize) -> SourceError {
        match self.span.and_then(|span| place_of(span, start)) {
            Some(range) => SourceError::at(range, self.message),
            None => SourceError::whole(self.message),
        }
    }

    pub(super) fn of(self, program: &Program) -> ShaderError {
        let file = program.declaration().name.clone();
        SourceErrors { file, text: String::new(), errors: vec![SourceError::whole(self.message)] }.into()
    }
}

type Lowered<T> = Result<T, LowerError>;

/// A function being lowered, with its arguments.
struct Frame<'p, F> {
    handle: Handle<naga::Function>,
    function: &'p naga::Function,
    values: Vec<Option<Value<F>>>,
    arguments: Vec<Value<F>>,
    locals: Vec<Option<Rc<[Reg]>>>,
    returns: flow::Returns<F>,
    breakable: Vec<flow::Breakable>,
    loops: usize,
}

struct Lowerer<'p, F> {
    program: &'p Program,
    uniforms: Option<&'p Uniforms<'p>>,
    sizes: Vec<usize>,
    code: Vec<Inst>,
    classes: Vec<Class>,
    constants: HashMap<(Class, u64), Reg>,
    float_constants: Vec<(Reg, F)>,
    bits_constants: Vec<(Reg, u32)>,
    functions: Vec<Function>,
    inputs: Vec<(Input, Reg)>,
    /// Whether values at samples' own positions are inputs.
    values: bool,
}

/// Lowers a function of a program; without uniforms, functions that depend on no sample are asked
/// of the environment like all others. With `values`, those of volumes at samples' own positions are
/// inputs.
pub(crate) fn lower<'p, F: Real>(
    program: &'p Program,
    entry: Entry,
    uniforms: Option<&'p Uniforms<'p>>,
    values: bool,
) -> Lowered<Kernel<F>> {
    let handle = program.entry(entry).ok_or_else(|| LowerError::new(format!("no function `{}`", entry.name())))?;
    let lowerer = Lowerer {
        program,
        uniforms,
        sizes: sizes(program.module()),
        code: Vec::new(),
        classes: Vec::new(),
        constants: HashMap::new(),
        float_constants: Vec::new(),
        bits_constants: Vec::new(),
        functions: Vec::new(),
        inputs: Vec::new(),
        values,
    };
    lowerer.kernel(handle)
}

impl<'p, F: Real> Lowerer<'p, F> {
    fn kernel(mut self, handle: Handle<naga::Function>) -> Lowered<Kernel<F>> {
        let function = &self.program.module().functions[handle];
        let fields = fields(self.program);
        let mut sample = |(sample, _): (usize, &FunctionArgument)| -> Value<F> {
            Value::Data(fields.iter().map(|field| Scalar::Row(self.input(Input { sample, field: *field }))).collect())
        };
        let arguments: Vec<_> = function.arguments.iter().enumerate().map(&mut sample).collect();
        let result = self.inline(handle, arguments, Mask::All)?;
        let outputs = result.iter().map(|s| self.float(*s)).collect::<Lowered<Vec<Reg>>>()?;
        let code = tidy::tidy(self.code, &outputs);
        allocate::allocate(allocate::Unplaced {
            shader: self.program.declaration().name.clone(),
            code,
            float_constants: self.float_constants,
            bits_constants: self.bits_constants,
            inputs: self.inputs,
            outputs,
            functions: self.functions,
        })
        .map_err(LowerError::new)
    }

    /// The row of an input.
    fn input(&mut self, input: Input) -> Reg {
        if let Some((_, reg)) = self.inputs.iter().find(|(known, _)| *known == input) {
            return *reg;
        }
        let reg = self.new_reg(Class::Float);
        self.inputs.push((input, reg));
        reg
    }

    fn type_of(&self, frame: &Frame<'p, F>, expression: Handle<Expression>) -> &'p TypeInner {
        let program: &'p Program = self.program;
        program.info()[frame.handle][expression].ty.inner_with(&program.module().types)
    }

    /// Numbers in a value of a type.
    fn size(&self, ty: &TypeInner) -> usize {
        match ty {
            TypeInner::Vector { size, .. } => *size as usize,
            TypeInner::Matrix { columns, rows, .. } => *columns as usize * *rows as usize,
            TypeInner::Array { base, size: naga::ArraySize::Constant(n), .. } => {
                self.sizes[base.index()].saturating_mul(n.get() as usize)
            }
            TypeInner::Struct { members, .. } => members.iter().map(|m| self.sizes[m.ty.index()]).sum(),
            _ => 1,
        }
    }
}
