//! Built-in functions.

use std::rc::Rc;

use naga::{Expression, Handle, MathFunction, ScalarKind, TypeInner};

use super::{Frame, LowerError, Lowered, Lowerer, Scalar, expression::pick};
use crate::eval::{
    Real,
    ops::{Bits1, Bits2, Bits3, Compare, Float1, Float2, Float3, ToBits},
};

type Data<F> = Rc<[Scalar<F>]>;

impl<'p, F: Real> Lowerer<'p, F> {
    pub(super) fn math(
        &mut self,
        frame: &mut Frame<'p, F>,
        fun: MathFunction,
        first: Handle<Expression>,
        more: [Option<Handle<Expression>>; 3],
    ) -> Lowered<Vec<Scalar<F>>> {
        let kind = self.kind(frame, first);
        let inner = self.type_of(frame, first);
        let mut args: Vec<Data<F>> = vec![self.data(frame, first)?];
        for argument in more.into_iter().flatten() {
            args.push(self.data(frame, argument)?);
        }
        if let Some(done) = self.geometry(fun, kind, inner, &args)? {
            return Ok(done);
        }
        let count = args.iter().map(|a| a.len()).max().unwrap_or(1);
        let arg = |k: usize, i: usize| args.get(k).map_or(Scalar::Bits(0), |a| pick(a, i));
        self.each(count, |this, i| {
            let (a, b, c) = (arg(0, i), arg(1, i), arg(2, i));
            match kind {
                ScalarKind::Float => this.float_math(fun, a, b, c),
                _ => this.int_math(fun, kind == ScalarKind::Sint, [a, b, c, arg(3, i)]),
            }
        })
    }

    fn float_math(&mut self, fun: MathFunction, a: Scalar<F>, b: Scalar<F>, c: Scalar<F>) -> Lowered<Scalar<F>> {
        use MathFunction as M;
        if let Some(op) = float1(fun) {
            return self.f1(op, a);
        }
        match fun {
            M::Min => self.f2(Float2::Min, a, b),
            M::Max => self.f2(Float2::Max, a, b),
            M::Pow => self.f2(Float2::Pow, a, b),
            M::Atan2 => self.f2(Float2::Atan2, a, b),
            M::Step => self.f2(Float2::Step, a, b),
            M::Clamp => self.f3(Float3::Clamp, a, b, c),
            M::Fma => self.f3(Float3::Fma, a, b, c),
            M::Mix => self.f3(Float3::Mix, a, b, c),
            M::SmoothStep => self.f3(Float3::SmoothStep, a, b, c),
            M::Ldexp => self.ldexp(a, b),
            _ => Err(LowerError::new("a built-in function that is not supported")),
        }
    }

    fn int_math(&mut self, fun: MathFunction, signed: bool, [a, b, c, d]: [Scalar<F>; 4]) -> Lowered<Scalar<F>> {
        use MathFunction as M;
        let by_sign = |yes, no| if signed { yes } else { no };
        match fun {
            M::Abs if signed => self.b1(Bits1::Abs, a),
            M::Abs => Ok(a),
            M::Sign => self.b1(Bits1::Sign, a),
            M::Min => self.b2(by_sign(Bits2::MinSigned, Bits2::MinUnsigned), a, b),
            M::Max => self.b2(by_sign(Bits2::MaxSigned, Bits2::MaxUnsigned), a, b),
            M::Clamp => {
                let low = self.b2(by_sign(Bits2::MaxSigned, Bits2::MaxUnsigned), a, b)?;
                self.b2(by_sign(Bits2::MinSigned, Bits2::MinUnsigned), low, c)
            }
            M::CountOneBits => self.b1(Bits1::CountOnes, a),
            M::CountLeadingZeros => self.b1(Bits1::LeadingZeros, a),
            M::CountTrailingZeros => self.b1(Bits1::TrailingZeros, a),
            M::ReverseBits => self.b1(Bits1::Reverse, a),
            M::FirstTrailingBit => self.b1(Bits1::FirstTrailing, a),
            M::FirstLeadingBit if signed => self.b1(Bits1::FirstLeadingSigned, a),
            M::FirstLeadingBit => self.b1(Bits1::FirstLeadingUnsigned, a),
            M::ExtractBits if signed => self.b3(Bits3::ExtractSigned, a, b, c),
            M::ExtractBits => self.b3(Bits3::ExtractUnsigned, a, b, c),
            M::InsertBits => {
                // insertBits(e, newbits, offset, count): the field of the one, the rest of the other.
                let mask = self.b2(Bits2::FieldMask, c, d)?;
                let rest = self.b2(Bits2::AndNot, a, mask)?;
                let moved = self.b2(Bits2::ShiftLeft, b, c)?;
                let field = self.b2(Bits2::And, moved, mask)?;
                self.b2(Bits2::Or, rest, field)
            }
            _ => Err(LowerError::new("a built-in function that is not supported")),
        }
    }

    /// Functions whose result is not made number by number.
    fn geometry(
        &mut self,
        fun: MathFunction,
        kind: ScalarKind,
        inner: &TypeInner,
        args: &[Data<F>],
    ) -> Lowered<Option<Vec<Scalar<F>>>> {
        use MathFunction as M;
        let a = &args[0];
        let b = args.get(1).unwrap_or(a);
        Ok(Some(match fun {
            M::Dot if kind != ScalarKind::Float => vec![self.int_dot(a, b)?],
            M::Dot => vec![self.dot(a, b)?],
            M::Cross => self.cross(a, b)?,
            M::Length => vec![self.length(a)?],
            M::Distance => {
                let difference = self.each(a.len(), |this, i| this.f2(Float2::Subtract, a[i], pick(b, i)))?;
                vec![self.length(&difference)?]
            }
            M::Normalize => {
                let length = self.length(a)?;
                self.each(a.len(), |this, i| this.f2(Float2::Divide, a[i], length))?
            }
            M::FaceForward => self.face_forward(a, b, args.get(2).unwrap_or(a))?,
            M::Reflect => self.reflect(a, b)?,
            M::Refract => self.refract(a, b, args.get(2).unwrap_or(a))?,
            M::Transpose => {
                let TypeInner::Matrix { columns, rows, .. } = inner else { return Ok(None) };
                let (columns, rows) = (*columns as usize, *rows as usize);
                (0..a.len()).map(|i| pick(a, (i % columns) * rows + i / columns)).collect()
            }
            M::Determinant => vec![self.determinant(a)?],
            M::Modf => {
                // The fraction has the number's sign, and so has the whole part.
                let whole = self.each(a.len(), |this, i| this.f1(Float1::Trunc, a[i]))?;
                let mut both = self.each(a.len(), |this, i| this.f2(Float2::Subtract, a[i], whole[i]))?;
                both.extend(whole);
                both
            }
            M::Frexp => {
                let mut both = self.each(a.len(), |this, i| this.f1(Float1::Frexp, a[i]))?;
                both.extend(self.each(a.len(), |this, i| this.bits_of(ToBits::Exponent, a[i]))?);
                both
            }
            _ => return Ok(None),
        }))
    }

    fn dot(&mut self, a: &[Scalar<F>], b: &[Scalar<F>]) -> Lowered<Scalar<F>> {
        self.sum_of_products(a.len(), |k| (a[k], pick(b, k)))
    }

    fn int_dot(&mut self, a: &[Scalar<F>], b: &[Scalar<F>]) -> Lowered<Scalar<F>> {
        let mut sum = Scalar::Bits(0);
        for (x, y) in a.iter().zip(b) {
            let product = self.b2(Bits2::Multiply, *x, *y)?;
            sum = self.b2(Bits2::Add, sum, product)?;
        }
        Ok(sum)
    }

    fn length(&mut self, a: &[Scalar<F>]) -> Lowered<Scalar<F>> {
        if let [single] = a {
            return self.f1(Float1::Abs, *single);
        }
        let square = self.dot(a, a)?;
        self.f1(Float1::Sqrt, square)
    }

    fn cross(&mut self, a: &[Scalar<F>], b: &[Scalar<F>]) -> Lowered<Vec<Scalar<F>>> {
        self.each(3, |this, i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let left = this.f2(Float2::Multiply, pick(a, j), pick(b, k))?;
            let right = this.f2(Float2::Multiply, pick(a, k), pick(b, j))?;
            this.f2(Float2::Subtract, left, right)
        })
    }

    /// `faceForward(e1, e2, e3)`: e1 where dot(e2, e3) < 0, else −e1.
    fn face_forward(&mut self, e1: &[Scalar<F>], e2: &[Scalar<F>], e3: &[Scalar<F>]) -> Lowered<Vec<Scalar<F>>> {
        let dot = self.dot(e2, e3)?;
        let against = self.compare(Compare::Less, dot, Scalar::Float(F::from_f32(0.0)))?;
        self.each(e1.len(), |this, i| {
            let turned = this.f1(Float1::Negate, e1[i])?;
            this.select(against, e1[i], turned)
        })
    }

    /// `reflect(e1, e2)` = e1 − 2·dot(e2, e1)·e2.
    fn reflect(&mut self, e1: &[Scalar<F>], e2: &[Scalar<F>]) -> Lowered<Vec<Scalar<F>>> {
        let dot = self.dot(e2, e1)?;
        let twice = self.f2(Float2::Multiply, Scalar::Float(F::from_f32(2.0)), dot)?;
        self.each(e1.len(), |this, i| {
            let along = this.f2(Float2::Multiply, twice, pick(e2, i))?;
            this.f2(Float2::Subtract, e1[i], along)
        })
    }

    /// `refract(e1, e2, r)`: k = 1 − r²(1 − dot(e2, e1)²); where k < 0 zero, else
    /// r·e1 − (r·dot(e2, e1) + √k)·e2.
    fn refract(&mut self, e1: &[Scalar<F>], e2: &[Scalar<F>], ratio: &[Scalar<F>]) -> Lowered<Vec<Scalar<F>>> {
        let (zero, one) = (Scalar::Float(F::from_f32(0.0)), Scalar::Float(F::from_f32(1.0)));
        let r = pick(ratio, 0);
        let dot = self.dot(e2, e1)?;
        let square = self.f2(Float2::Multiply, dot, dot)?;
        let rest = self.f2(Float2::Subtract, one, square)?;
        let scale = self.f2(Float2::Multiply, r, r)?;
        let scaled = self.f2(Float2::Multiply, scale, rest)?;
        let k = self.f2(Float2::Subtract, one, scaled)?;
        let total = self.compare(Compare::Less, k, zero)?;
        let root = self.f1(Float1::Sqrt, k)?;
        let along = self.f2(Float2::Multiply, r, dot)?;
        let factor = self.f2(Float2::Add, along, root)?;
        self.each(e1.len(), |this, i| {
            let first = this.f2(Float2::Multiply, r, e1[i])?;
            let second = this.f2(Float2::Multiply, factor, pick(e2, i))?;
            let bent = this.f2(Float2::Subtract, first, second)?;
            this.select(total, zero, bent)
        })
    }

    /// By the first row; columns lie one after the other.
    fn determinant(&mut self, m: &[Scalar<F>]) -> Lowered<Scalar<F>> {
        let n = match m.len() {
            4 => 2,
            9 => 3,
            16 => 4,
            _ => return m.first().copied().ok_or_else(|| LowerError::new("a matrix without numbers")),
        };
        let mut sum = Scalar::Float(F::from_f32(0.0));
        for column in 0..n {
            let keep = |i: &usize| i / n != column && !i.is_multiple_of(n);
            let minor: Vec<_> = (0..n * n).filter(keep).map(|i| m[i]).collect();
            let minor = self.determinant(&minor)?;
            let product = self.f2(Float2::Multiply, m[column * n], minor)?;
            let op = if column % 2 == 0 { Float2::Add } else { Float2::Subtract };
            sum = if column == 0 { product } else { self.f2(op, sum, product)? };
        }
        Ok(sum)
    }
}

fn float1(fun: MathFunction) -> Option<Float1> {
    use MathFunction as M;
    Some(match fun {
        M::Abs => Float1::Abs,
        M::Saturate => Float1::Saturate,
        M::Cos => Float1::Cos,
        M::Cosh => Float1::Cosh,
        M::Sin => Float1::Sin,
        M::Sinh => Float1::Sinh,
        M::Tan => Float1::Tan,
        M::Tanh => Float1::Tanh,
        M::Acos => Float1::Acos,
        M::Asin => Float1::Asin,
        M::Atan => Float1::Atan,
        M::Asinh => Float1::Asinh,
        M::Acosh => Float1::Acosh,
        M::Atanh => Float1::Atanh,
        M::Radians => Float1::Radians,
        M::Degrees => Float1::Degrees,
        M::Ceil => Float1::Ceil,
        M::Floor => Float1::Floor,
        M::Round => Float1::Round,
        M::Fract => Float1::Fract,
        M::Trunc => Float1::Trunc,
        M::Exp => Float1::Exp,
        M::Exp2 => Float1::Exp2,
        M::Log => Float1::Log,
        M::Log2 => Float1::Log2,
        M::Sqrt => Float1::Sqrt,
        M::InverseSqrt => Float1::InverseSqrt,
        M::Sign => Float1::Sign,
        _ => return None,
    })
}
