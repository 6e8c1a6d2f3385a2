//! Instructions, emitted or computed at once where all operands are constant.

use super::{LowerError, Lowered, Lowerer, MAX_CODE, Mask, Scalar};
use crate::eval::{
    Real,
    code::{Class, Inst, Reg},
    ops::{self, Bits1, Bits2, Bits3, Compare, Float1, Float2, Float3, TRUE, ToBits, ToFloat},
};

impl<F: Real> Lowerer<'_, F> {
    pub(super) fn new_reg(&mut self, class: Class) -> Reg {
        self.classes.push(class);
        (self.classes.len() - 1) as Reg
    }

    pub(super) fn emit(&mut self, inst: Inst) -> Lowered<()> {
        if self.code.len() >= MAX_CODE {
            let message = format!("with all functions inlined, more than {MAX_CODE} instructions");
            return Err(LowerError::new(message));
        }
        self.code.push(inst);
        Ok(())
    }

    /// The register of a float; constants get a row of their own.
    pub(super) fn float(&mut self, scalar: Scalar<F>) -> Lowered<Reg> {
        match scalar {
            Scalar::Row(reg) if self.classes[reg as usize] == Class::Float => Ok(reg),
            Scalar::Float(value) => Ok(match self.constants.get(&(Class::Float, value.bits())) {
                Some(reg) => *reg,
                None => {
                    let reg = self.new_reg(Class::Float);
                    self.constants.insert((Class::Float, value.bits()), reg);
                    self.float_constants.push((reg, value));
                    reg
                }
            }),
            _ => Err(LowerError::new("an integer where a float belongs")),
        }
    }

    /// The register of an integer or truth value.
    pub(super) fn bits(&mut self, scalar: Scalar<F>) -> Lowered<Reg> {
        match scalar {
            Scalar::Row(reg) if self.classes[reg as usize] == Class::Bits => Ok(reg),
            Scalar::Bits(value) => Ok(match self.constants.get(&(Class::Bits, value.into())) {
                Some(reg) => *reg,
                None => {
                    let reg = self.new_reg(Class::Bits);
                    self.constants.insert((Class::Bits, value.into()), reg);
                    self.bits_constants.push((reg, value));
                    reg
                }
            }),
            _ => Err(LowerError::new("a float where an integer belongs")),
        }
    }

    pub(super) fn class(&self, scalar: Scalar<F>) -> Class {
        match scalar {
            Scalar::Float(_) => Class::Float,
            Scalar::Bits(_) => Class::Bits,
            Scalar::Row(reg) => self.classes[reg as usize],
        }
    }

    pub(super) fn row(&mut self, scalar: Scalar<F>) -> Lowered<Reg> {
        match self.class(scalar) {
            Class::Float => self.float(scalar),
            Class::Bits => self.bits(scalar),
        }
    }

    fn new_row(&mut self, class: Class, inst: impl FnOnce(Reg) -> Inst) -> Lowered<Scalar<F>> {
        let to = self.new_reg(class);
        self.emit(inst(to))?;
        Ok(Scalar::Row(to))
    }

    pub(super) fn f1(&mut self, op: Float1, a: Scalar<F>) -> Lowered<Scalar<F>> {
        if let Scalar::Float(a) = a {
            return Ok(Scalar::Float(ops::float1(op, a)));
        }
        let a = self.float(a)?;
        self.new_row(Class::Float, |to| Inst::Float1(op, to, a))
    }

    pub(super) fn f2(&mut self, op: Float2, a: Scalar<F>, b: Scalar<F>) -> Lowered<Scalar<F>> {
        if let (Scalar::Float(a), Scalar::Float(b)) = (a, b) {
            return Ok(Scalar::Float(ops::float2(op, a, b)));
        }
        let from = [self.float(a)?, self.float(b)?];
        self.new_row(Class::Float, |to| Inst::Float2(op, to, from))
    }

    pub(super) fn f3(&mut self, op: Float3, a: Scalar<F>, b: Scalar<F>, c: Scalar<F>) -> Lowered<Scalar<F>> {
        if let (Scalar::Float(a), Scalar::Float(b), Scalar::Float(c)) = (a, b, c) {
            return Ok(Scalar::Float(ops::float3(op, a, b, c)));
        }
        let from = [self.float(a)?, self.float(b)?, self.float(c)?];
        self.new_row(Class::Float, |to| Inst::Float3(op, to, from))
    }

    pub(super) fn b1(&mut self, op: Bits1, a: Scalar<F>) -> Lowered<Scalar<F>> {
        if let Scalar::Bits(a) = a {
            return Ok(Scalar::Bits(ops::bits1(op, a)));
        }
        let a = self.bits(a)?;
        self.new_row(Class::Bits, |to| Inst::Bits1(op, to, a))
    }

    pub(super) fn b2(&mut self, op: Bits2, a: Scalar<F>, b: Scalar<F>) -> Lowered<Scalar<F>> {
        match (op, a, b) {
            (_, Scalar::Bits(a), Scalar::Bits(b)) => return Ok(Scalar::Bits(ops::bits2(op, a, b))),
            // Masks are mostly all or none.
            (Bits2::And, Scalar::Bits(TRUE), x) | (Bits2::And, x, Scalar::Bits(TRUE)) => return Ok(x),
            (Bits2::Or, Scalar::Bits(0), x) | (Bits2::Or, x, Scalar::Bits(0)) => return Ok(x),
            (Bits2::AndNot, x, Scalar::Bits(0)) => return Ok(x),
            (Bits2::AndNot, Scalar::Bits(TRUE), x) => return self.b1(Bits1::Not, x),
            (Bits2::And, Scalar::Bits(0), _) | (Bits2::And, _, Scalar::Bits(0)) => return Ok(Scalar::Bits(0)),
            _ => {}
        }
        let from = [self.bits(a)?, self.bits(b)?];
        self.new_row(Class::Bits, |to| Inst::Bits2(op, to, from))
    }

    pub(super) fn b3(&mut self, op: Bits3, a: Scalar<F>, b: Scalar<F>, c: Scalar<F>) -> Lowered<Scalar<F>> {
        if let (Scalar::Bits(a), Scalar::Bits(b), Scalar::Bits(c)) = (a, b, c) {
            return Ok(Scalar::Bits(ops::bits3(op, a, b, c)));
        }
        let from = [self.bits(a)?, self.bits(b)?, self.bits(c)?];
        self.new_row(Class::Bits, |to| Inst::Bits3(op, to, from))
    }

    pub(super) fn compare(&mut self, op: Compare, a: Scalar<F>, b: Scalar<F>) -> Lowered<Scalar<F>> {
        if let (Scalar::Float(a), Scalar::Float(b)) = (a, b) {
            return Ok(Scalar::Bits(ops::compare(op, a, b)));
        }
        let from = [self.float(a)?, self.float(b)?];
        self.new_row(Class::Bits, |to| Inst::Compare(op, to, from))
    }

    pub(super) fn bits_of(&mut self, op: ToBits, a: Scalar<F>) -> Lowered<Scalar<F>> {
        if let Scalar::Float(a) = a {
            return Ok(Scalar::Bits(ops::to_bits(op, a)));
        }
        let a = self.float(a)?;
        self.new_row(Class::Bits, |to| Inst::ToBits(op, to, a))
    }

    pub(super) fn float_of(&mut self, op: ToFloat, a: Scalar<F>) -> Lowered<Scalar<F>> {
        if let Scalar::Bits(a) = a {
            return Ok(Scalar::Float(ops::to_float(op, a)));
        }
        let a = self.bits(a)?;
        self.new_row(Class::Float, |to| Inst::ToFloat(op, to, a))
    }

    pub(super) fn ldexp(&mut self, value: Scalar<F>, exponent: Scalar<F>) -> Lowered<Scalar<F>> {
        if let (Scalar::Float(value), Scalar::Bits(exponent)) = (value, exponent) {
            return Ok(Scalar::Float(value.ldexp(exponent as i32)));
        }
        let (value, exponent) = (self.float(value)?, self.bits(exponent)?);
        self.new_row(Class::Float, |to| Inst::Ldexp { to, value, exponent })
    }

    pub(super) fn select(&mut self, c: Scalar<F>, accept: Scalar<F>, reject: Scalar<F>) -> Lowered<Scalar<F>> {
        if let Scalar::Bits(c) = c {
            return Ok(if c != 0 { accept } else { reject });
        }
        let class = self.class(accept);
        let (condition, accept, reject) = (self.bits(c)?, self.row(accept)?, self.row(reject)?);
        self.new_row(class, |to| Inst::Select { class, to, condition, accept, reject })
    }

    /// Copies into a register that is written more than once, where the mask holds.
    pub(super) fn assign(&mut self, to: Reg, from: Scalar<F>, mask: Mask) -> Lowered<()> {
        let class = self.classes[to as usize];
        let from = self.row(from)?;
        match mask {
            Mask::All => self.emit(Inst::Copy { class, to, from }),
            Mask::Some(mask) => self.emit(Inst::Blend { class, to, mask, from }),
            Mask::Dead => Ok(()),
        }
    }

    /// A mask as a truth value.
    pub(super) fn mask(&self, mask: Mask) -> Scalar<F> {
        match mask {
            Mask::All => Scalar::Bits(TRUE),
            Mask::Some(reg) => Scalar::Row(reg),
            Mask::Dead => Scalar::Bits(0),
        }
    }

    /// A truth value as a mask.
    pub(super) fn as_mask(&self, scalar: Scalar<F>) -> Lowered<Mask> {
        match scalar {
            Scalar::Bits(0) => Ok(Mask::Dead),
            Scalar::Bits(_) => Ok(Mask::All),
            Scalar::Row(reg) => Ok(Mask::Some(reg)),
            Scalar::Float(_) => Err(LowerError::new("a float where a truth value belongs")),
        }
    }
}
