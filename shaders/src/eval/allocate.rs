//! Rows for registers: as few as there are values in use at a time, so that all of them stay in
//! the processor's nearest memory.
//!
//! A linear scan: a register is in use from where it is first touched to where it is last touched,
//! and through all of a loop into which it reaches from outside. What an instruction writes never
//! shares a row with what it reads.

use std::{cmp::Reverse, collections::BinaryHeap, collections::HashMap};

use super::{
    MAX_ROWS, Real,
    code::{Class, Inst, Reg, touches},
    kernel::{Function, Input, Kernel},
    tidy::{class_of, loops},
};

/// A kernel whose registers have no rows yet.
pub struct Unplaced<F> {
    pub shader: String,
    pub code: Vec<Inst>,
    pub float_constants: Vec<(Reg, F)>,
    pub bits_constants: Vec<(Reg, u32)>,
    pub inputs: Vec<(Input, Reg)>,
    pub outputs: Vec<Reg>,
    pub functions: Vec<Function>,
}

/// From the first to the last instruction, both included; 0 is before the code.
type Span = (usize, usize);

/// Gives rows to registers.
pub fn allocate<F: Real>(unplaced: Unplaced<F>) -> Result<Kernel<F>, String> {
    let Unplaced { shader, mut code, mut float_constants, mut bits_constants, mut inputs, mut outputs, functions } =
        unplaced;
    let spans = spans(&code, &inputs, &outputs);
    float_constants.retain(|(reg, _)| spans.contains_key(reg));
    bits_constants.retain(|(reg, _)| spans.contains_key(reg));
    let mut classes = class_of(&code);
    classes.extend(outputs.iter().map(|reg| (*reg, Class::Float)));
    let mut rows: HashMap<Reg, Reg> = HashMap::new();
    let mut floats = Rows::default();
    let mut bits = Rows::default();
    float_constants.iter().for_each(|(reg, _)| _ = rows.insert(*reg, floats.keep()));
    bits_constants.iter().for_each(|(reg, _)| _ = rows.insert(*reg, bits.keep()));
    inputs.retain(|(_, reg)| spans.get(reg).is_some_and(|span| span.1 > 0));
    let mut order: Vec<(Span, Reg)> = spans
        .iter()
        .map(|(reg, span)| (*span, *reg))
        .filter(|(span, reg)| span.1 > 0 && !rows.contains_key(reg))
        .collect();
    order.sort_unstable();
    for (span, reg) in order {
        let of = if classes.get(&reg) == Some(&Class::Bits) { &mut bits } else { &mut floats };
        rows.insert(reg, of.take(span));
    }
    if (floats.count + bits.count) as usize > MAX_ROWS {
        return Err(format!("more than {MAX_ROWS} numbers a sample at a time"));
    }
    let place = |reg: &mut Reg| *reg = rows.get(reg).copied().unwrap_or(0);
    code.iter_mut().for_each(|inst| inst.touch(|_, _, reg| place(reg)));
    float_constants.iter_mut().for_each(|(reg, _)| place(reg));
    bits_constants.iter_mut().for_each(|(reg, _)| place(reg));
    inputs.iter_mut().for_each(|(_, reg)| place(reg));
    outputs.iter_mut().for_each(place);
    let (floats, bits) = (floats.count, bits.count);
    Ok(Kernel { shader, code, floats, bits, float_constants, bits_constants, inputs, outputs, functions })
}

/// Rows of one class.
#[derive(Default)]
struct Rows {
    count: u32,
    free: Vec<Reg>,
    used: BinaryHeap<Reverse<(usize, Reg)>>,
}

impl Rows {
    /// A row of its own.
    fn keep(&mut self) -> Reg {
        self.count += 1;
        self.count - 1
    }

    /// A row for a while; spans come in the order of their beginnings.
    fn take(&mut self, (begin, end): Span) -> Reg {
        while let Some(Reverse((last, row))) = self.used.peek().copied() {
            if last >= begin {
                break;
            }
            self.used.pop();
            self.free.push(row);
        }
        let row = self.free.pop().unwrap_or_else(|| self.keep());
        self.used.push(Reverse((end, row)));
        row
    }
}

/// Where each register is in use. Instructions count from 1.
fn spans(code: &[Inst], inputs: &[(Input, Reg)], outputs: &[Reg]) -> HashMap<Reg, Span> {
    // Inputs are there before the code, also those that are first met within a loop.
    let mut spans: HashMap<Reg, Span> = inputs.iter().map(|(_, reg)| (*reg, (0, 0))).collect();
    for (i, inst) in code.iter().enumerate() {
        for (_, _, reg) in touches(inst) {
            let span = spans.entry(reg).or_insert((i + 1, i + 1));
            span.1 = i + 1;
        }
    }
    for reg in outputs {
        spans.entry(*reg).or_insert((0, 0)).1 = code.len() + 1;
    }
    let mut spans: Vec<(Reg, Span)> = spans.into_iter().collect();
    // Inner loops end first, so that what they lengthen is seen by the outer ones.
    for (head, back) in loops(code) {
        let (head, back) = (head + 1, back + 1);
        for (_, (begin, end)) in &mut spans {
            if *begin < head && (head..=back).contains(end) {
                *end = back;
            } else if (head..=back).contains(begin) && *end > back {
                *begin = head;
            }
        }
    }
    spans.into_iter().collect()
}
