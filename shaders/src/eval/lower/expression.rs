//! Expressions.

use std::rc::Rc;

use naga::{BinaryOperator, Expression, Handle, Literal, RelationalFunction, ScalarKind, TypeInner, UnaryOperator};

use super::{Frame, LowerError, Lowered, Lowerer, Scalar, Value, place::Index};
use crate::eval::{
    Real,
    code::Inst,
    ops::{Bits1, Bits2, Compare, Float1, Float2, ToBits, ToFloat, truth},
};

/// How deep constants may refer to one another.
const MAX_CONSTANTS: usize = 256;

type Data<F> = Rc<[Scalar<F>]>;

impl<'p, F: Real> Lowerer<'p, F> {
    /// The value of an expression that is there or needs no evaluation.
    pub(super) fn value(&mut self, frame: &mut Frame<'p, F>, handle: Handle<Expression>) -> Lowered<Value<F>> {
        if let Some(value) = &frame.values[handle.index()] {
            return Ok(value.clone());
        }
        let value = match &frame.function.expressions[handle] {
            Expression::Literal(_) | Expression::Constant(_) | Expression::ZeroValue(_) => {
                Value::Data(self.constant(&frame.function.expressions, handle, 0)?.into())
            }
            Expression::FunctionArgument(i) => {
                let argument = frame.arguments.get(*i as usize).cloned();
                argument.ok_or_else(|| LowerError::new("no such argument"))?
            }
            Expression::LocalVariable(local) => Value::Pointer(self.variable(frame, *local)?),
            // A variable's first value is a constant expression, which no statement evaluates.
            _ => self.evaluate(frame, handle)?,
        };
        frame.values[handle.index()] = Some(value.clone());
        Ok(value)
    }

    pub(super) fn data(&mut self, frame: &mut Frame<'p, F>, handle: Handle<Expression>) -> Lowered<Data<F>> {
        match self.value(frame, handle)? {
            Value::Data(data) => Ok(data),
            Value::Pointer(_) => Err(LowerError::new("a pointer where a value belongs")),
        }
    }

    pub(super) fn scalar(&mut self, frame: &mut Frame<'p, F>, handle: Handle<Expression>) -> Lowered<Scalar<F>> {
        let data = self.data(frame, handle)?;
        data.first().copied().ok_or_else(|| LowerError::new("a value without numbers"))
    }

    /// A constant of the module, or one that stands in a function.
    fn constant(
        &mut self,
        expressions: &'p naga::Arena<Expression>,
        handle: Handle<Expression>,
        depth: usize,
    ) -> Lowered<Vec<Scalar<F>>> {
        if depth > MAX_CONSTANTS {
            return Err(LowerError::new(format!("constants that refer to more than {MAX_CONSTANTS} others in a row")));
        }
        let module = self.program.module();
        match &expressions[handle] {
            Expression::Literal(literal) => Ok(vec![literal_value(*literal)?]),
            Expression::Constant(constant) => {
                self.constant(&module.global_expressions, module.constants[*constant].init, depth + 1)
            }
            Expression::ZeroValue(ty) => Ok(self.zero(*ty)),
            Expression::Compose { components, .. } => {
                let mut all = Vec::new();
                for component in components {
                    all.extend(self.constant(expressions, *component, depth + 1)?);
                }
                Ok(all)
            }
            Expression::Splat { size, value } => {
                let value = self.constant(expressions, *value, depth + 1)?;
                Ok(value.repeat(*size as usize))
            }
            _ => Err(LowerError::new("a constant that is not computed")),
        }
    }

    pub(super) fn zero(&self, ty: Handle<naga::Type>) -> Vec<Scalar<F>> {
        let module = self.program.module();
        match &module.types[ty].inner {
            TypeInner::Array { base, size: naga::ArraySize::Constant(n), .. } => {
                self.zero(*base).repeat(n.get() as usize)
            }
            TypeInner::Struct { members, .. } => members.iter().flat_map(|m| self.zero(m.ty)).collect(),
            other => {
                let float = other.scalar().is_none_or(|s| s.kind == ScalarKind::Float);
                let zero = if float { Scalar::Float(F::from_f32(0.0)) } else { Scalar::Bits(0) };
                vec![zero; self.size(other)]
            }
        }
    }

    /// Evaluates an expression when its statement comes.
    pub(super) fn evaluate(&mut self, frame: &mut Frame<'p, F>, handle: Handle<Expression>) -> Lowered<Value<F>> {
        let function = frame.function;
        let data: Vec<Scalar<F>> = match &function.expressions[handle] {
            Expression::Compose { components, .. } => {
                let mut all = Vec::new();
                for component in components {
                    all.extend(self.data(frame, *component)?.iter());
                }
                all
            }
            Expression::Access { base, index } => return self.access(frame, *base, *index),
            Expression::AccessIndex { base, index } => return self.access_index(frame, *base, *index),
            Expression::Splat { size, value } => vec![self.scalar(frame, *value)?; *size as usize],
            Expression::Swizzle { size, vector, pattern } => {
                let vector = self.data(frame, *vector)?;
                let pick = |i: usize| vector.get(pattern[i] as usize).copied();
                (0..*size as usize).map(pick).collect::<Option<_>>().ok_or_else(|| LowerError::new("a swizzle"))?
            }
            Expression::Load { pointer } => match self.value(frame, *pointer)? {
                Value::Pointer(place) => return self.load(&place),
                Value::Data(_) => return Err(LowerError::new("a value where a pointer belongs")),
            },
            Expression::Unary { op, expr } => self.unary(frame, *op, *expr)?,
            Expression::Binary { op, left, right } => self.binary(frame, *op, *left, *right)?,
            Expression::Select { condition, accept, reject } => {
                let condition = self.data(frame, *condition)?;
                let (accept, reject) = (self.data(frame, *accept)?, self.data(frame, *reject)?);
                let count = accept.len();
                self.each(count, |this, i| this.select(pick(&condition, i), pick(&accept, i), pick(&reject, i)))?
            }
            Expression::Relational { fun, argument } => {
                let all = self.data(frame, *argument)?;
                let op = match fun {
                    RelationalFunction::All => Bits2::And,
                    RelationalFunction::Any => Bits2::Or,
                    _ => return Err(LowerError::new("a question that WGSL has not")),
                };
                let mut sum = pick(&all, 0);
                for next in all.iter().skip(1) {
                    sum = self.b2(op, sum, *next)?;
                }
                vec![sum]
            }
            Expression::Math { fun, arg, arg1, arg2, arg3 } => {
                return self.math(frame, *fun, *arg, [*arg1, *arg2, *arg3]).map(|data| Value::Data(data.into()));
            }
            Expression::As { expr, kind, convert } => self.convert(frame, *expr, *kind, convert.is_some())?,
            _ => return Err(LowerError::new("an expression that cannot be evaluated")),
        };
        Ok(Value::Data(data.into()))
    }

    /// `count` numbers, one after the other.
    pub(super) fn each(
        &mut self,
        count: usize,
        mut make: impl FnMut(&mut Self, usize) -> Lowered<Scalar<F>>,
    ) -> Lowered<Vec<Scalar<F>>> {
        (0..count).map(|i| make(self, i)).collect()
    }

    fn access_index(&mut self, frame: &mut Frame<'p, F>, base: Handle<Expression>, index: u32) -> Lowered<Value<F>> {
        let inner = self.type_of(frame, base);
        let inner = self.pointee(inner);
        let (begin, size, count) = self.element(inner, index)?;
        if index as usize >= count {
            return Err(LowerError::new("an index beyond the end"));
        }
        match self.value(frame, base)? {
            Value::Pointer(place) => self.part(&place, begin, size).map(Value::Pointer),
            Value::Data(data) => {
                let part = data.get(begin..begin + size).ok_or_else(|| LowerError::new("an element"))?;
                Ok(Value::Data(part.into()))
            }
        }
    }

    fn access(
        &mut self,
        frame: &mut Frame<'p, F>,
        base: Handle<Expression>,
        index: Handle<Expression>,
    ) -> Lowered<Value<F>> {
        let inner = self.type_of(frame, base);
        let inner = self.pointee(inner);
        let (_, size, count) = self.element(inner, 0)?;
        let found = match self.index(frame, index, count)? {
            Index::Known(known) => return self.access_index(frame, base, known as u32),
            Index::Found(found) => found,
        };
        let data = match self.value(frame, base)? {
            Value::Pointer(place) => return self.part_at(&place, found, size).map(Value::Pointer),
            Value::Data(data) => data,
        };
        let picked = self.each(size, |this, k| {
            let class = this.class(pick(&data, k));
            let of = (0..count).map(|i| this.row(pick(&data, i * size + k))).collect::<Lowered<_>>()?;
            let (to, index) = (this.new_reg(class), this.bits(found)?);
            this.emit(Inst::Gather { class, to, index, from: of })?;
            Ok(Scalar::Row(to))
        })?;
        Ok(Value::Data(picked.into()))
    }

    pub(super) fn kind(&self, frame: &Frame<'p, F>, handle: Handle<Expression>) -> ScalarKind {
        self.type_of(frame, handle).scalar().map_or(ScalarKind::Float, |s| s.kind)
    }

    fn unary(
        &mut self,
        frame: &mut Frame<'p, F>,
        op: UnaryOperator,
        expr: Handle<Expression>,
    ) -> Lowered<Vec<Scalar<F>>> {
        let float = self.kind(frame, expr) == ScalarKind::Float;
        let data = self.data(frame, expr)?;
        self.each(data.len(), |this, i| match op {
            UnaryOperator::Negate if float => this.f1(Float1::Negate, data[i]),
            UnaryOperator::Negate => this.b1(Bits1::Negate, data[i]),
            UnaryOperator::LogicalNot | UnaryOperator::BitwiseNot => this.b1(Bits1::Not, data[i]),
        })
    }

    fn binary(
        &mut self,
        frame: &mut Frame<'p, F>,
        op: BinaryOperator,
        left: Handle<Expression>,
        right: Handle<Expression>,
    ) -> Lowered<Vec<Scalar<F>>> {
        let (left_type, right_type) = (self.type_of(frame, left), self.type_of(frame, right));
        let kind = self.kind(frame, left);
        let (a, b) = (self.data(frame, left)?, self.data(frame, right)?);
        if op == BinaryOperator::Multiply
            && let Some(product) = self.product(left_type, right_type, &a, &b)?
        {
            return Ok(product);
        }
        let count = a.len().max(b.len());
        self.each(count, |this, i| this.operate(op, kind, pick(&a, i), pick(&b, i)))
    }

    /// One operation on two numbers of a kind.
    fn operate(&mut self, op: BinaryOperator, kind: ScalarKind, a: Scalar<F>, b: Scalar<F>) -> Lowered<Scalar<F>> {
        use BinaryOperator as O;
        if kind == ScalarKind::Float {
            return match op {
                O::Add => self.f2(Float2::Add, a, b),
                O::Subtract => self.f2(Float2::Subtract, a, b),
                O::Multiply => self.f2(Float2::Multiply, a, b),
                O::Divide => self.f2(Float2::Divide, a, b),
                O::Modulo => self.f2(Float2::Remainder, a, b),
                O::Equal => self.compare(Compare::Equal, a, b),
                O::NotEqual => self.compare(Compare::NotEqual, a, b),
                O::Less => self.compare(Compare::Less, a, b),
                O::LessEqual => self.compare(Compare::LessEqual, a, b),
                O::Greater => self.compare(Compare::Less, b, a),
                O::GreaterEqual => self.compare(Compare::LessEqual, b, a),
                _ => Err(LowerError::new("bits of a float")),
            };
        }
        let signed = kind == ScalarKind::Sint;
        let by_sign = |yes, no| if signed { yes } else { no };
        let (op, a, b) = match op {
            O::Add => (Bits2::Add, a, b),
            O::Subtract => (Bits2::Subtract, a, b),
            O::Multiply => (Bits2::Multiply, a, b),
            O::Divide => (by_sign(Bits2::DivideSigned, Bits2::DivideUnsigned), a, b),
            O::Modulo => (by_sign(Bits2::RemainderSigned, Bits2::RemainderUnsigned), a, b),
            O::Equal => (Bits2::Equal, a, b),
            O::NotEqual => (Bits2::NotEqual, a, b),
            O::Less => (by_sign(Bits2::LessSigned, Bits2::LessUnsigned), a, b),
            O::LessEqual => (by_sign(Bits2::LessEqualSigned, Bits2::LessEqualUnsigned), a, b),
            O::Greater => (by_sign(Bits2::LessSigned, Bits2::LessUnsigned), b, a),
            O::GreaterEqual => (by_sign(Bits2::LessEqualSigned, Bits2::LessEqualUnsigned), b, a),
            O::And | O::LogicalAnd => (Bits2::And, a, b),
            O::InclusiveOr | O::LogicalOr => (Bits2::Or, a, b),
            O::ExclusiveOr => (Bits2::Xor, a, b),
            O::ShiftLeft => (Bits2::ShiftLeft, a, b),
            O::ShiftRight => (by_sign(Bits2::ShiftRightSigned, Bits2::ShiftRightUnsigned), a, b),
        };
        self.b2(op, a, b)
    }

    /// Products in which a matrix has part; matrices are columns one after the other.
    fn product(
        &mut self,
        left: &TypeInner,
        right: &TypeInner,
        a: &Data<F>,
        b: &Data<F>,
    ) -> Lowered<Option<Vec<Scalar<F>>>> {
        use TypeInner::{Matrix, Vector};
        let size = |s: &naga::VectorSize| *s as usize;
        // Rows and columns of both sides, a vector being one or the other.
        let (rows, inner, columns) = match (left, right) {
            (Matrix { columns: c, rows: r, .. }, Vector { .. }) => (size(r), size(c), 1),
            (Vector { .. }, Matrix { columns: c, rows: r, .. }) => (1, size(r), size(c)),
            (Matrix { columns: c, rows: r, .. }, Matrix { columns, .. }) => (size(r), size(c), size(columns)),
            _ => return Ok(None),
        };
        self.each(rows * columns, |this, i| {
            let (row, column) = (i % rows, i / rows);
            this.sum_of_products(inner, |k| (pick(a, k * rows + row), pick(b, column * inner + k)))
        })
        .map(Some)
    }

    /// a₀b₀ + a₁b₁ + …, from left to right.
    pub(super) fn sum_of_products(
        &mut self,
        count: usize,
        factors: impl Fn(usize) -> (Scalar<F>, Scalar<F>),
    ) -> Lowered<Scalar<F>> {
        let (a, b) = factors(0);
        let mut sum = self.f2(Float2::Multiply, a, b)?;
        for k in 1..count {
            let (a, b) = factors(k);
            let product = self.f2(Float2::Multiply, a, b)?;
            sum = self.f2(Float2::Add, sum, product)?;
        }
        Ok(sum)
    }

    fn convert(
        &mut self,
        frame: &mut Frame<'p, F>,
        expr: Handle<Expression>,
        to: ScalarKind,
        value: bool,
    ) -> Lowered<Vec<Scalar<F>>> {
        use ScalarKind::{Bool, Float, Sint, Uint};
        let from = self.kind(frame, expr);
        let data = self.data(frame, expr)?;
        self.each(data.len(), |this, i| match (from, to, value) {
            (Float, Sint, true) => this.bits_of(ToBits::Signed, data[i]),
            (Float, Uint, true) => this.bits_of(ToBits::Unsigned, data[i]),
            (Float, Bool, true) => this.bits_of(ToBits::Truth, data[i]),
            (Float, Sint | Uint, false) => this.bits_of(ToBits::Pattern, data[i]),
            (Sint, Float, true) => this.float_of(ToFloat::Signed, data[i]),
            (Uint, Float, true) => this.float_of(ToFloat::Unsigned, data[i]),
            (Bool, Float, true) => this.float_of(ToFloat::Truth, data[i]),
            (Sint | Uint, Float, false) => this.float_of(ToFloat::Pattern, data[i]),
            (Bool, Sint | Uint, true) => this.b2(Bits2::And, data[i], Scalar::Bits(1)),
            (Sint | Uint, Bool, true) => this.b2(Bits2::NotEqual, data[i], Scalar::Bits(0)),
            _ => Ok(data[i]),
        })
    }
}

/// The number at a place; a single number stands for all.
pub(super) fn pick<F: Copy>(data: &[Scalar<F>], i: usize) -> Scalar<F> {
    data.get(i).or(data.first()).copied().unwrap_or(Scalar::Bits(0))
}

fn literal_value<F: Real>(literal: Literal) -> Lowered<Scalar<F>> {
    Ok(match literal {
        Literal::F32(v) => Scalar::Float(F::from_f32(v)),
        Literal::I32(v) => Scalar::Bits(v as u32),
        Literal::U32(v) => Scalar::Bits(v),
        Literal::Bool(v) => Scalar::Bits(truth(v)),
        // Of constants without a type, which WGSL takes as these where they are used.
        Literal::AbstractInt(v) => Scalar::Bits(v as i32 as u32),
        Literal::AbstractFloat(v) => Scalar::Float(F::from_f32(v as f32)),
        _ => return Err(LowerError::new("a number of another width than 32 bits")),
    })
}
