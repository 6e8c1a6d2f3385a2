//! What naga accepts and a shading function cannot have: the last word after the refusals of the
//! text, so that everything that passes can be evaluated.

use naga::{
    AddressSpace, ArraySize, Block, Expression, Function, Handle, MathFunction, Module, Scalar, ScalarKind, Span,
    Statement, TypeInner,
};

use crate::{error::SourceError, program::place};

/// The most numbers that a value may have: a struct's or an array's, altogether.
pub const MAX_SCALARS: usize = 1024;
/// How deep the blocks of a function may nest in the parsed form.
const MAX_BLOCKS: usize = 512;

/// Everything that cannot be evaluated. Byte `start` of the module's text is the author's first.
pub fn check(module: &Module, skip: impl Fn(Handle<Function>) -> bool, start: usize) -> Vec<SourceError> {
    let mut found = Found { errors: Vec::new(), start };
    if !module.entry_points.is_empty() || !module.global_variables.is_empty() || !module.overrides.is_empty() {
        found.errors.push(SourceError::whole("entry points, module variables and overrides are not for shaders"));
    }
    found.types(module);
    for (handle, function) in module.functions.iter().filter(|(handle, _)| !skip(*handle)) {
        for (expression, e) in function.expressions.iter() {
            if let Some(what) = unsupported(e) {
                found.add(function.expressions.get_span(expression), what);
            }
        }
        found.block(&function.body, 0);
        _ = handle;
    }
    found.errors
}

struct Found {
    errors: Vec<SourceError>,
    start: usize,
}

impl Found {
    fn add(&mut self, span: Span, what: &str) {
        let message = format!("{what} cannot be used in a shader");
        self.errors.push(match place(span, self.start) {
            Some(range) => SourceError::at(range, message),
            None => SourceError::whole(message),
        });
    }

    fn types(&mut self, module: &Module) {
        for (handle, ty) in module.types.iter() {
            let span = module.types.get_span(handle);
            let name = ty.name.as_deref().map_or(String::new(), |name| format!(" `{name}`"));
            match &ty.inner {
                TypeInner::Scalar(s) | TypeInner::Vector { scalar: s, .. } | TypeInner::Matrix { scalar: s, .. } => {
                    if !supported(*s) {
                        self.add(span, &format!("a number of {} bits", s.width * 8));
                    }
                }
                TypeInner::Array { size: ArraySize::Constant(_), .. } | TypeInner::Struct { .. } => {}
                TypeInner::Pointer { space, .. } | TypeInner::ValuePointer { space, .. } => {
                    if *space != AddressSpace::Function {
                        self.add(span, "a pointer to anything but a function's variable");
                    }
                }
                _ => self.add(span, &format!("the type{name}")),
            }
        }
        if self.errors.is_empty() {
            self.sizes(module);
        }
    }

    fn sizes(&mut self, module: &Module) {
        let sizes = sizes(module);
        if let Some((handle, ty)) = module.types.iter().find(|(h, _)| sizes[h.index()] > MAX_SCALARS) {
            let name = ty.name.as_deref().map_or("an array".into(), |name| format!("`{name}`"));
            let what = format!("{name} of {} numbers (at most {MAX_SCALARS})", sizes[handle.index()]);
            self.add(module.types.get_span(handle), &what);
        }
    }

    fn block(&mut self, block: &Block, depth: usize) {
        if depth > MAX_BLOCKS {
            return self.errors.push(SourceError::whole(format!("blocks nest deeper than {MAX_BLOCKS}")));
        }
        for (statement, span) in block.span_iter() {
            match statement {
                Statement::Block(inner) => self.block(inner, depth + 1),
                Statement::If { accept, reject, .. } => {
                    self.block(accept, depth + 1);
                    self.block(reject, depth + 1);
                }
                Statement::Switch { cases, .. } => cases.iter().for_each(|case| self.block(&case.body, depth + 1)),
                Statement::Loop { body, continuing, .. } => {
                    self.block(body, depth + 1);
                    self.block(continuing, depth + 1);
                }
                Statement::Emit(_)
                | Statement::Break
                | Statement::Continue
                | Statement::Return { .. }
                | Statement::Store { .. }
                | Statement::Call { .. } => {}
                _ => self.add(*span, "this statement"),
            }
        }
    }
}

/// Numbers in a value of each type; types stand behind those that they are made of.
pub fn sizes(module: &Module) -> Vec<usize> {
    let mut sizes: Vec<usize> = Vec::with_capacity(module.types.len());
    for (_, ty) in module.types.iter() {
        let of = |handle: &Handle<naga::Type>| sizes.get(handle.index()).copied().unwrap_or(usize::MAX);
        sizes.push(match &ty.inner {
            TypeInner::Vector { size, .. } => *size as usize,
            TypeInner::Matrix { columns, rows, .. } => *columns as usize * *rows as usize,
            TypeInner::Array { base, size: ArraySize::Constant(n), .. } => of(base).saturating_mul(n.get() as usize),
            TypeInner::Struct { members, .. } => {
                members.iter().fold(0, |sum: usize, member| sum.saturating_add(of(&member.ty)))
            }
            _ => 1,
        });
    }
    sizes
}

fn supported(scalar: Scalar) -> bool {
    match scalar.kind {
        ScalarKind::Sint | ScalarKind::Uint | ScalarKind::Float => scalar.width == 4,
        ScalarKind::Bool => true,
        // Of constants that no code uses.
        ScalarKind::AbstractInt | ScalarKind::AbstractFloat => true,
    }
}

fn unsupported(expression: &Expression) -> Option<&'static str> {
    use Expression as E;
    match expression {
        E::Literal(_)
        | E::Constant(_)
        | E::ZeroValue(_)
        | E::Compose { .. }
        | E::Access { .. }
        | E::AccessIndex { .. }
        | E::Splat { .. }
        | E::Swizzle { .. }
        | E::FunctionArgument(_)
        | E::LocalVariable(_)
        | E::Load { .. }
        | E::Unary { .. }
        | E::Binary { .. }
        | E::Select { .. }
        | E::Relational { .. }
        | E::As { .. }
        | E::CallResult(_) => None,
        E::Math { fun, .. } if math(*fun) => None,
        E::Math { .. } => Some("this built-in function"),
        E::Derivative { .. } => Some("a derivative on the screen"),
        E::ImageSample { .. } | E::ImageLoad { .. } | E::ImageQuery { .. } => Some("a texture"),
        E::GlobalVariable(_) => Some("a module's variable"),
        _ => Some("this expression"),
    }
}

/// Whether a built-in function is supported.
fn math(fun: MathFunction) -> bool {
    use MathFunction as M;
    !matches!(
        fun,
        M::Dot4I8Packed
            | M::Dot4U8Packed
            | M::Outer
            | M::Inverse
            | M::QuantizeToF16
            | M::Pack4x8snorm
            | M::Pack4x8unorm
            | M::Pack2x16snorm
            | M::Pack2x16unorm
            | M::Pack2x16float
            | M::Pack4xI8
            | M::Pack4xU8
            | M::Pack4xI8Clamp
            | M::Pack4xU8Clamp
            | M::Unpack4x8snorm
            | M::Unpack4x8unorm
            | M::Unpack2x16snorm
            | M::Unpack2x16unorm
            | M::Unpack2x16float
            | M::Unpack4xI8
            | M::Unpack4xU8
    )
}
