//! Instructions over rows of samples, and the values that they are made of.
//!
//! A register is a row: one number for each sample of a batch. Floats and bits (integers and truth
//! values) have registers of their own, told apart by where they stand in an instruction.

use super::ops::{Bits1, Bits2, Bits3, Compare, Float1, Float2, Float3, ToBits, ToFloat};

/// A register.
pub type Reg = u32;

/// Which kind of row a register is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Class {
    /// Floating-point numbers.
    Float,
    /// Integers and truth values.
    Bits,
}

/// One instruction. What is written stands first; masks are truth values, and where there is none
/// all samples are meant.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "operands in the order of the operation's own")]
pub enum Inst {
    Float1(Float1, Reg, Reg),
    Float2(Float2, Reg, [Reg; 2]),
    Float3(Float3, Reg, [Reg; 3]),
    Bits1(Bits1, Reg, Reg),
    Bits2(Bits2, Reg, [Reg; 2]),
    Bits3(Bits3, Reg, [Reg; 3]),
    Compare(Compare, Reg, [Reg; 2]),
    ToBits(ToBits, Reg, Reg),
    ToFloat(ToFloat, Reg, Reg),
    /// `x · 2^n`.
    Ldexp {
        to: Reg,
        value: Reg,
        exponent: Reg,
    },
    /// The second where the condition holds, else the third.
    Select {
        class: Class,
        to: Reg,
        condition: Reg,
        accept: Reg,
        reject: Reg,
    },
    Copy {
        class: Class,
        to: Reg,
        from: Reg,
    },
    /// Writes only where the mask holds.
    Blend {
        class: Class,
        to: Reg,
        mask: Reg,
        from: Reg,
    },
    /// The register that the index picks, the last one at most.
    Gather {
        class: Class,
        to: Reg,
        index: Reg,
        from: Box<[Reg]>,
    },
    /// Writes the register that the index picks, the last one at most.
    Scatter {
        class: Class,
        to: Box<[Reg]>,
        index: Reg,
        mask: Option<Reg>,
        from: Reg,
    },
    /// Asks the environment. Results that nobody wants have no register.
    Call {
        function: u32,
        arguments: Box<[Reg]>,
        results: Box<[Option<Reg>]>,
        mask: Option<Reg>,
    },
    /// Goes on at `to` where the mask holds nowhere.
    Skip {
        mask: Reg,
        to: u32,
    },
    /// The head of a loop: leaves to `exit` where the mask holds nowhere, else counts.
    Head {
        mask: Reg,
        exit: u32,
    },
    /// Back to the head of a loop.
    Back {
        to: u32,
    },
}

/// How an instruction touches a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Touch {
    /// Reads it.
    Read,
    /// Writes it altogether, without having read it.
    Write,
    /// Changes it in part.
    Change,
}

impl Inst {
    /// Calls `f` with every register and may change it. Reads come before writes.
    pub fn touch(&mut self, mut f: impl FnMut(Touch, Class, &mut Reg)) {
        use Class::{Bits, Float};
        use Touch::{Change, Read, Write};
        let mut all = |class, regs: &mut [Reg]| regs.iter_mut().for_each(|r| f(Read, class, r));
        match self {
            Self::Float1(_, to, a) => {
                f(Read, Float, a);
                f(Write, Float, to);
            }
            Self::Float2(_, to, from) => {
                all(Float, from);
                f(Write, Float, to);
            }
            Self::Float3(_, to, from) => {
                all(Float, from);
                f(Write, Float, to);
            }
            Self::Bits1(_, to, a) => {
                f(Read, Bits, a);
                f(Write, Bits, to);
            }
            Self::Bits2(_, to, from) => {
                all(Bits, from);
                f(Write, Bits, to);
            }
            Self::Bits3(_, to, from) => {
                all(Bits, from);
                f(Write, Bits, to);
            }
            Self::Compare(_, to, from) => {
                all(Float, from);
                f(Write, Bits, to);
            }
            Self::ToBits(_, to, a) => {
                f(Read, Float, a);
                f(Write, Bits, to);
            }
            Self::ToFloat(_, to, a) => {
                f(Read, Bits, a);
                f(Write, Float, to);
            }
            Self::Ldexp { to, value, exponent } => {
                f(Read, Float, value);
                f(Read, Bits, exponent);
                f(Write, Float, to);
            }
            Self::Select { class, to, condition, accept, reject } => {
                f(Read, Bits, condition);
                f(Read, *class, accept);
                f(Read, *class, reject);
                f(Write, *class, to);
            }
            Self::Copy { class, to, from } => {
                f(Read, *class, from);
                f(Write, *class, to);
            }
            Self::Blend { class, to, mask, from } => {
                f(Read, Bits, mask);
                f(Read, *class, from);
                f(Change, *class, to);
            }
            Self::Gather { class, to, index, from } => {
                f(Read, Bits, index);
                from.iter_mut().for_each(|r| f(Read, *class, r));
                f(Write, *class, to);
            }
            Self::Scatter { class, to, index, mask, from } => {
                f(Read, Bits, index);
                mask.iter_mut().for_each(|r| f(Read, Bits, r));
                f(Read, *class, from);
                to.iter_mut().for_each(|r| f(Change, *class, r));
            }
            Self::Call { arguments, results, mask, .. } => {
                mask.iter_mut().for_each(|r| f(Read, Bits, r));
                arguments.iter_mut().for_each(|r| f(Read, Float, r));
                results.iter_mut().flatten().for_each(|r| f(Write, Float, r));
            }
            Self::Skip { mask, .. } | Self::Head { mask, .. } => f(Read, Bits, mask),
            Self::Back { .. } => {}
        }
    }

    /// Where the instruction may go on besides the next one.
    pub fn target(&mut self) -> Option<&mut u32> {
        match self {
            Self::Skip { to, .. } | Self::Back { to } => Some(to),
            Self::Head { exit, .. } => Some(exit),
            _ => None,
        }
    }
}

/// What an instruction reads and writes, copied out of it.
pub fn touches(inst: &Inst) -> Vec<(Touch, Class, Reg)> {
    let mut list = Vec::with_capacity(4);
    inst.clone().touch(|touch, class, reg| list.push((touch, class, *reg)));
    list
}
