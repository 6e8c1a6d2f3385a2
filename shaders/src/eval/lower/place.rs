//! Variables, and places in them.

use std::rc::Rc;

use naga::{Expression, Handle, TypeInner};

use super::{Frame, LowerError, Lowered, Lowerer, Mask, Scalar, Value};
use crate::eval::{
    Real,
    code::{Class, Inst, Reg},
    ops::Bits2,
};

/// Numbers of a variable: from `offset` on, plus what the index says at run time.
#[derive(Clone, Debug)]
pub(super) struct Place<F> {
    regs: Rc<[Reg]>,
    offset: usize,
    index: Option<Scalar<F>>,
    size: usize,
}

/// An index within what it indexes: clamped to the last element.
pub(super) enum Index<F> {
    Known(usize),
    Found(Scalar<F>),
}

impl<'p, F: Real> Lowerer<'p, F> {
    /// The place of a whole variable. Its registers are zero where it is first met: there, all
    /// samples are meant, since none has seen it before.
    pub(super) fn variable(&mut self, frame: &Frame<'p, F>, local: Handle<naga::LocalVariable>) -> Lowered<Place<F>> {
        let regs = frame.locals.get(local.index()).cloned().flatten();
        let regs = regs.ok_or_else(|| LowerError::new("a variable without a place"))?;
        let size = regs.len();
        Ok(Place { regs, offset: 0, index: None, size })
    }

    /// Registers for a function's variables, with their first values.
    pub(super) fn variables(&mut self, frame: &mut Frame<'p, F>) -> Lowered<()> {
        let function = frame.function;
        for (handle, variable) in function.local_variables.iter() {
            let initial = match variable.init {
                Some(init) => self.data(frame, init)?,
                None => self.zero(variable.ty).into(),
            };
            let mut regs = Vec::with_capacity(initial.len());
            for scalar in initial.iter() {
                let class = self.class(*scalar);
                let reg = self.new_reg(class);
                self.assign(reg, *scalar, Mask::All)?;
                regs.push(reg);
            }
            frame.locals[handle.index()] = Some(regs.into());
        }
        Ok(())
    }

    /// An element of what `inner` is: where it begins, how long it is, and how many there are.
    pub(super) fn element(&self, inner: &TypeInner, index: u32) -> Lowered<(usize, usize, usize)> {
        let index = index as usize;
        Ok(match inner {
            TypeInner::Struct { members, .. } => {
                let member = members.get(index).ok_or_else(|| LowerError::new("no such member"))?;
                let offset = members[..index].iter().map(|m| self.sizes[m.ty.index()]).sum();
                (offset, self.sizes[member.ty.index()], members.len())
            }
            TypeInner::Vector { size, .. } => (index, 1, *size as usize),
            TypeInner::ValuePointer { size: Some(size), .. } => (index, 1, *size as usize),
            TypeInner::Matrix { columns, rows, .. } => (index * *rows as usize, *rows as usize, *columns as usize),
            TypeInner::Array { base, size: naga::ArraySize::Constant(n), .. } => {
                let size = self.sizes[base.index()];
                (index * size, size, n.get() as usize)
            }
            _ => return Err(LowerError::new("an index into what has no elements")),
        })
    }

    /// What a pointer points to, or the type itself.
    pub(super) fn pointee(&self, inner: &'p TypeInner) -> &'p TypeInner {
        match inner {
            TypeInner::Pointer { base, .. } => &self.program.module().types[*base].inner,
            other => other,
        }
    }

    pub(super) fn index(
        &mut self,
        frame: &mut Frame<'p, F>,
        index: Handle<Expression>,
        count: usize,
    ) -> Lowered<Index<F>> {
        let last = count.saturating_sub(1) as u32;
        let index = self.scalar(frame, index)?;
        // As an unsigned number: what is negative is beyond the end, too.
        Ok(match self.b2(Bits2::MinUnsigned, index, Scalar::Bits(last))? {
            Scalar::Bits(known) => Index::Known(known as usize),
            found => Index::Found(found),
        })
    }

    /// The place of an element of a place.
    pub(super) fn part(&mut self, place: &Place<F>, begin: usize, size: usize) -> Lowered<Place<F>> {
        let offset = place.offset + begin;
        if offset + size > place.regs.len() {
            return Err(LowerError::new("an element outside of its variable"));
        }
        Ok(Place { offset, size, ..place.clone() })
    }

    /// The place of an element that is found at run time.
    pub(super) fn part_at(&mut self, place: &Place<F>, index: Scalar<F>, size: usize) -> Lowered<Place<F>> {
        let step = self.b2(Bits2::Multiply, index, Scalar::Bits(size as u32))?;
        let index = match place.index {
            Some(before) => self.b2(Bits2::Add, before, step)?,
            None => step,
        };
        Ok(Place { index: Some(index), size, ..place.clone() })
    }

    pub(super) fn load(&mut self, place: &Place<F>) -> Lowered<Value<F>> {
        let mut data = Vec::with_capacity(place.size);
        for k in place.offset..place.offset + place.size {
            let class = self.classes[place.regs[k] as usize];
            let to = self.new_reg(class);
            match place.index {
                None => self.emit(Inst::Copy { class, to, from: place.regs[k] })?,
                Some(index) => {
                    let from = self.same_class(place, k);
                    let index = self.bits(index)?;
                    self.emit(Inst::Gather { class, to, index, from })?;
                }
            }
            data.push(Scalar::Row(to));
        }
        Ok(Value::Data(data.into()))
    }

    pub(super) fn store(&mut self, place: &Place<F>, value: &[Scalar<F>], mask: Mask) -> Lowered<()> {
        if value.len() != place.size {
            return Err(LowerError::new("a value that does not fit its variable"));
        }
        for (k, scalar) in (place.offset..).zip(value) {
            match (place.index, mask) {
                (_, Mask::Dead) => {}
                (None, mask) => self.assign(place.regs[k], *scalar, mask)?,
                (Some(index), mask) => {
                    let class = self.classes[place.regs[k] as usize];
                    let to = self.same_class(place, k);
                    let (index, from) = (self.bits(index)?, self.row(*scalar)?);
                    let mask = if let Mask::Some(reg) = mask { Some(reg) } else { None };
                    self.emit(Inst::Scatter { class, to, index, mask, from })?;
                }
            }
        }
        Ok(())
    }

    /// The registers that an index from the `k`-th on can reach, up to the variable's end. Those
    /// of another class (other members of a struct in an array) are never picked, since indices
    /// are multiples of the element's size; the first stands in for them.
    fn same_class(&self, place: &Place<F>, k: usize) -> Box<[Reg]> {
        let class: Class = self.classes[place.regs[k] as usize];
        let fits = |reg: &Reg| if self.classes[*reg as usize] == class { *reg } else { place.regs[k] };
        place.regs[k..].iter().map(fits).collect()
    }
}
