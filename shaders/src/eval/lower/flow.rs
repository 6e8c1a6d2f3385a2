//! Statements: who goes which way.
//!
//! A block is lowered for the samples of a mask and gives the mask of those that reach its end.
//! Those that break, continue or return are missing there; where they are wanted again, they have
//! been noted: by the loop (who continues), by the switch (who breaks), by the function (who
//! returns from within a loop).

use naga::{Block, Handle, Statement, SwitchCase, SwitchValue};

use super::{Frame, LowerError, Lowered, Lowerer, Mask, Scalar, Value};
use crate::eval::{
    Real,
    code::{Class, Inst, Reg},
    ops::{Bits1, Bits2, TRUE},
};

/// What a function gives back.
pub(super) struct Returns<F> {
    /// One return, at the end: the value is the result.
    only: bool,
    in_loop: bool,
    value: Option<Vec<Scalar<F>>>,
    /// Several: registers of the result.
    regs: Option<Vec<Reg>>,
    /// Who has returned from within a loop.
    gone: Option<Reg>,
}

/// What can be broken out of.
pub(super) enum Breakable {
    Loop { continued: Option<Reg> },
    Switch { broken: Option<Reg> },
}

/// Which jumps lead out of a block.
#[derive(Clone, Copy, Default)]
struct Jumps {
    breaks: bool,
    continues: bool,
    returns: bool,
}

impl Jumps {
    fn of(block: &Block) -> Self {
        block.iter().fold(Self::default(), |sum, statement| sum.and(Self::of_statement(statement)))
    }

    fn of_statement(statement: &Statement) -> Self {
        match statement {
            Statement::Break => Self { breaks: true, ..Self::default() },
            Statement::Continue => Self { continues: true, ..Self::default() },
            Statement::Return { .. } => Self { returns: true, ..Self::default() },
            Statement::Block(block) => Self::of(block),
            Statement::If { accept, reject, .. } => Self::of(accept).and(Self::of(reject)),
            Statement::Switch { cases, .. } => {
                let all = cases.iter().fold(Self::default(), |sum, case| sum.and(Self::of(&case.body)));
                Self { breaks: false, ..all }
            }
            Statement::Loop { body, continuing, .. } => {
                let all = Self::of(body).and(Self::of(continuing));
                Self { returns: all.returns, ..Self::default() }
            }
            _ => Self::default(),
        }
    }

    fn and(self, other: Self) -> Self {
        Self {
            breaks: self.breaks || other.breaks,
            continues: self.continues || other.continues,
            returns: self.returns || other.returns,
        }
    }

    fn any(self) -> bool {
        self.breaks || self.continues || self.returns
    }
}

impl<F> Returns<F> {
    pub(super) fn of(function: &naga::Function) -> Self {
        let body = &function.body;
        let early = body.iter().take(body.len().saturating_sub(1)).any(|s| Jumps::of_statement(s).returns);
        let last = matches!(body.last(), Some(Statement::Return { .. }) | None);
        let in_loop = returns_in_loop(body);
        Self { only: !early && last, in_loop, value: None, regs: None, gone: None }
    }
}

fn returns_in_loop(block: &Block) -> bool {
    block.iter().any(|statement| match statement {
        Statement::Loop { .. } => Jumps::of_statement(statement).returns,
        Statement::Block(block) => returns_in_loop(block),
        Statement::If { accept, reject, .. } => returns_in_loop(accept) || returns_in_loop(reject),
        Statement::Switch { cases, .. } => cases.iter().any(|case| returns_in_loop(&case.body)),
        _ => false,
    })
}

impl<'p, F: Real> Lowerer<'p, F> {
    /// Registers for the result of a function that returns from several places.
    pub(super) fn prepare_returns(&mut self, frame: &mut Frame<'p, F>) -> Lowered<()> {
        if frame.returns.only {
            return Ok(());
        }
        if let Some(result) = &frame.function.result {
            let zero = self.zero(result.ty);
            let regs: Vec<Reg> = zero.iter().map(|s| self.new_reg(self.class(*s))).collect();
            for (reg, zero) in regs.iter().zip(zero) {
                self.assign(*reg, zero, Mask::All)?;
            }
            frame.returns.regs = Some(regs);
        }
        if frame.returns.in_loop {
            frame.returns.gone = Some(self.flags()?);
        }
        Ok(())
    }

    /// A mask that is filled in bit by bit.
    fn flags(&mut self) -> Lowered<Reg> {
        let reg = self.new_reg(Class::Bits);
        self.assign(reg, Scalar::Bits(0), Mask::All)?;
        Ok(reg)
    }

    /// Adds samples to such a mask.
    fn note(&mut self, flags: Reg, mask: Mask) -> Lowered<()> {
        if mask == Mask::Dead {
            return Ok(());
        }
        let mask = self.mask(mask);
        let both = self.b2(Bits2::Or, Scalar::Row(flags), mask)?;
        self.assign(flags, both, Mask::All)
    }

    /// The result of a function after its body.
    pub(super) fn returned(&mut self, frame: Frame<'p, F>) -> Lowered<Vec<Scalar<F>>> {
        match (frame.returns.value, frame.returns.regs) {
            (Some(value), _) => Ok(value),
            (None, Some(regs)) => Ok(regs.into_iter().map(Scalar::Row).collect()),
            // The body was not entered, or there is no result.
            (None, None) => Ok(frame.function.result.as_ref().map_or(Vec::new(), |r| self.zero(r.ty))),
        }
    }

    pub(super) fn block(&mut self, frame: &mut Frame<'p, F>, block: &'p Block, mut mask: Mask) -> Lowered<Mask> {
        for (statement, span) in block.span_iter() {
            if mask == Mask::Dead {
                break;
            }
            mask = self.statement(frame, statement, mask).map_err(|mut error| {
                error.span = error.span.or(Some(*span));
                error
            })?;
        }
        Ok(mask)
    }

    fn statement(&mut self, frame: &mut Frame<'p, F>, statement: &'p Statement, mask: Mask) -> Lowered<Mask> {
        match statement {
            Statement::Emit(range) => {
                for handle in range.clone() {
                    let value = self.evaluate(frame, handle)?;
                    frame.values[handle.index()] = Some(value);
                }
            }
            Statement::Block(block) => return self.block(frame, block, mask),
            Statement::If { condition, accept, reject } => {
                let condition = self.scalar(frame, *condition)?;
                return self.branch(frame, condition, accept, reject, mask);
            }
            Statement::Switch { selector, cases } => {
                let selector = self.scalar(frame, *selector)?;
                return self.switch(frame, selector, cases, mask);
            }
            Statement::Loop { body, continuing, break_if } => {
                return self.repeat(frame, body, continuing, *break_if, mask);
            }
            Statement::Break => return self.break_out(frame, mask),
            Statement::Continue => return self.go_on(frame, mask),
            Statement::Return { value } => return self.give_back(frame, *value, mask),
            Statement::Store { pointer, value } => {
                let value = self.data(frame, *value)?;
                match self.value(frame, *pointer)? {
                    Value::Pointer(place) => self.store(&place, &value, mask)?,
                    Value::Data(_) => return Err(LowerError::new("a value where a pointer belongs")),
                }
            }
            Statement::Call { function, arguments, result } => {
                let arguments = arguments.iter().map(|a| self.value(frame, *a)).collect::<Lowered<Vec<_>>>()?;
                let value = self.call(*function, arguments, mask)?;
                if let Some(result) = result {
                    frame.values[result.index()] = Some(Value::Data(value.into()));
                }
            }
            _ => return Err(LowerError::new("a statement that cannot be evaluated")),
        }
        Ok(mask)
    }

    fn break_out(&mut self, frame: &mut Frame<'p, F>, mask: Mask) -> Lowered<Mask> {
        if let Some(Breakable::Switch { broken: Some(broken) }) = frame.breakable.last() {
            let broken = *broken;
            self.note(broken, mask)?;
        }
        Ok(Mask::Dead)
    }

    fn go_on(&mut self, frame: &mut Frame<'p, F>, mask: Mask) -> Lowered<Mask> {
        let innermost = frame.breakable.iter().rev().find_map(|b| match b {
            Breakable::Loop { continued } => Some(*continued),
            Breakable::Switch { .. } => None,
        });
        match innermost.flatten() {
            Some(continued) => self.note(continued, mask)?,
            None => return Err(LowerError::new("`continue` outside of a loop")),
        }
        Ok(Mask::Dead)
    }

    fn give_back(
        &mut self,
        frame: &mut Frame<'p, F>,
        value: Option<Handle<naga::Expression>>,
        mask: Mask,
    ) -> Lowered<Mask> {
        if let Some(value) = value {
            let value = self.data(frame, value)?;
            match &frame.returns.regs {
                Some(regs) => {
                    let regs = regs.clone();
                    for (reg, scalar) in regs.iter().zip(value.iter()) {
                        self.assign(*reg, *scalar, mask)?;
                    }
                }
                None => frame.returns.value = Some(value.to_vec()),
            }
        }
        if frame.loops > 0
            && let Some(gone) = frame.returns.gone
        {
            self.note(gone, mask)?;
        }
        Ok(Mask::Dead)
    }

    /// Lowers what only the samples of a mask do, and leaves it out where there are none.
    fn region(&mut self, mask: Mask, inside: impl FnOnce(&mut Self) -> Lowered<Mask>) -> Lowered<Mask> {
        let Mask::Some(reg) = mask else { return inside(self) };
        let at = self.code.len();
        self.emit(Inst::Skip { mask: reg, to: 0 })?;
        let end = inside(self)?;
        let to = self.code.len();
        match &mut self.code[at] {
            // Nothing to leave out: no instruction either, and nobody jumps to behind it.
            Inst::Skip { .. } if to == at + 1 => _ = self.code.pop(),
            Inst::Skip { to: target, .. } => *target = to as u32,
            _ => return Err(LowerError::new("a skip that is none")),
        }
        Ok(end)
    }

    fn branch(
        &mut self,
        frame: &mut Frame<'p, F>,
        condition: Scalar<F>,
        accept: &'p Block,
        reject: &'p Block,
        mask: Mask,
    ) -> Lowered<Mask> {
        if let Scalar::Bits(known) = condition {
            return self.block(frame, if known != 0 { accept } else { reject }, mask);
        }
        let all = self.mask(mask);
        let yes = self.b2(Bits2::And, all, condition)?;
        let no = self.b2(Bits2::AndNot, all, condition)?;
        let (yes, no) = (self.as_mask(yes)?, self.as_mask(no)?);
        let (jumps_yes, jumps_no) = (Jumps::of(accept), Jumps::of(reject));
        if !jumps_yes.any() && !jumps_no.any() {
            self.region(yes, |this| this.block(frame, accept, yes))?;
            self.region(no, |this| this.block(frame, reject, no))?;
            return Ok(mask);
        }
        // Who reaches the end of either: noted within, since a region may be left out. Where one
        // ends in a jump for all and the other has none, there is nothing to note.
        let simple = |jumps: Jumps, block: &Block| !jumps.any() || ends_in_jump(block);
        if simple(jumps_yes, accept) && simple(jumps_no, reject) {
            let end_yes = self.region(yes, |this| this.block(frame, accept, yes))?;
            let end_no = self.region(no, |this| this.block(frame, reject, no))?;
            return Ok(match (end_yes, end_no) {
                (Mask::Dead, end) | (end, Mask::Dead) => end,
                _ => mask,
            });
        }
        let end = self.flags()?;
        for (part, block) in [(yes, accept), (no, reject)] {
            self.region(part, |this| {
                let reached = this.block(frame, block, part)?;
                this.note(end, reached)?;
                Ok(reached)
            })?;
        }
        Ok(Mask::Some(end))
    }

    fn switch(
        &mut self,
        frame: &mut Frame<'p, F>,
        selector: Scalar<F>,
        cases: &'p [SwitchCase],
        mask: Mask,
    ) -> Lowered<Mask> {
        let jumps = cases.iter().fold(Jumps::default(), |sum, case| sum.and(Jumps::of(&case.body)));
        let leaves = jumps.continues || jumps.returns;
        let end = if leaves { Some(self.flags()?) } else { None };
        frame.breakable.push(Breakable::Switch { broken: end });
        let all = self.mask(mask);
        let mut taken = Scalar::Bits(0);
        let mut parts: Vec<(Option<Scalar<F>>, &'p Block)> = Vec::new();
        let mut group = Some(Scalar::Bits(0));
        for case in cases {
            let condition = match case.value {
                SwitchValue::I32(v) => Some(self.b2(Bits2::Equal, selector, Scalar::Bits(v as u32))?),
                SwitchValue::U32(v) => Some(self.b2(Bits2::Equal, selector, Scalar::Bits(v))?),
                SwitchValue::Default => None,
            };
            if let Some(condition) = condition {
                taken = self.or(taken, condition)?;
            }
            group = match (group, condition) {
                (Some(sum), Some(condition)) => Some(self.or(sum, condition)?),
                _ => None,
            };
            if !case.fall_through {
                parts.push((group, &case.body));
                group = Some(Scalar::Bits(0));
            } else if !case.body.is_empty() {
                return Err(LowerError::new("a case that falls through"));
            }
        }
        for (condition, body) in parts {
            let part = match condition {
                Some(condition) => self.b2(Bits2::And, all, condition)?,
                None => self.b2(Bits2::AndNot, all, taken)?,
            };
            let part = self.as_mask(part)?;
            if part == Mask::Dead {
                continue;
            }
            self.region(part, |this| {
                let reached = this.block(frame, body, part)?;
                end.map_or(Ok(()), |end| this.note(end, reached))?;
                Ok(reached)
            })?;
        }
        frame.breakable.pop();
        Ok(end.map_or(mask, Mask::Some))
    }

    fn or(&mut self, a: Scalar<F>, b: Scalar<F>) -> Lowered<Scalar<F>> {
        match (a, b) {
            (Scalar::Bits(TRUE), _) | (_, Scalar::Bits(TRUE)) => Ok(Scalar::Bits(TRUE)),
            _ => self.b2(Bits2::Or, a, b),
        }
    }

    fn repeat(
        &mut self,
        frame: &mut Frame<'p, F>,
        body: &'p Block,
        continuing: &'p Block,
        break_if: Option<Handle<naga::Expression>>,
        mask: Mask,
    ) -> Lowered<Mask> {
        let jumps = Jumps::of(body);
        let live = self.new_reg(Class::Bits);
        let first = self.mask(mask);
        self.assign(live, first, Mask::All)?;
        let head = self.code.len();
        self.emit(Inst::Head { mask: live, exit: 0 })?;
        let continued = if jumps.continues { Some(self.flags()?) } else { None };
        frame.breakable.push(Breakable::Loop { continued });
        frame.loops += 1;
        let end = self.block(frame, body, Mask::Some(live))?;
        let end = self.mask(end);
        let next = match continued {
            Some(continued) => self.b2(Bits2::Or, end, Scalar::Row(continued))?,
            None => end,
        };
        if next != Scalar::Row(live) {
            self.assign(live, next, Mask::All)?;
        }
        self.block(frame, continuing, Mask::Some(live))?;
        if let Some(condition) = break_if {
            let condition = self.scalar(frame, condition)?;
            let stay = self.b2(Bits2::AndNot, Scalar::Row(live), condition)?;
            self.assign(live, stay, Mask::All)?;
        }
        frame.loops -= 1;
        frame.breakable.pop();
        self.emit(Inst::Back { to: head as u32 })?;
        let exit = self.code.len() as u32;
        if let Inst::Head { exit: target, .. } = &mut self.code[head] {
            *target = exit;
        }
        match frame.returns.gone.filter(|_| jumps.returns) {
            Some(gone) => {
                let gone = self.b1(Bits1::Not, Scalar::Row(gone))?;
                let before = self.mask(mask);
                let left = self.b2(Bits2::And, before, gone)?;
                self.as_mask(left)
            }
            None => Ok(mask),
        }
    }
}

/// Whether everybody who enters a block leaves it by its last statement, a jump, and by no other.
fn ends_in_jump(block: &Block) -> bool {
    let jump = |s: &Statement| matches!(s, Statement::Break | Statement::Continue | Statement::Return { .. });
    let (Some(last), before) = (block.last(), block.iter().take(block.len().saturating_sub(1))) else { return false };
    jump(last) && before.into_iter().all(|s| !Jumps::of_statement(s).any())
}
