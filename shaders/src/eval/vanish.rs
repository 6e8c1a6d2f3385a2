//! Where a medium is certainly transparent: what of the extinction is a factor of it.
//!
//! Often the extinction is that of a lookup table at a volume's value, perhaps times something
//! else. Then nothing can be seen where the table is transparent at all values around, and whoever
//! knows bounds of the values need not evaluate the program there.

use std::collections::BTreeMap;

use super::{
    Kernel, Real,
    code::{Class, Inst, Reg, Touch, touches},
    kernel::Field,
    ops::{Float1, Float2},
};
use crate::signatures::Derived;

/// What is known of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    /// Zero.
    Zero,
    /// A component of the sample's own position.
    Position(u8),
    /// The value of a volume at the sample's own position, by parameter.
    Value(usize),
    /// Zero, or not a number, wherever that table (the second) is transparent at that volume's value.
    Vanishes(usize, usize),
}

impl<F: Real> Kernel<F> {
    /// The parameters of a volume and a table such that this medium's extinction is zero, or not a
    /// number, wherever the table's is zero at the volume's value at the sample's position. `None`
    /// where none are known.
    pub fn transparent_with(&self) -> Option<(usize, usize)> {
        let mut known: BTreeMap<Reg, Known> = BTreeMap::new();
        known
            .extend(self.float_constants.iter().filter(|(_, v)| v.to_f64() == 0.0).map(|(reg, _)| (*reg, Known::Zero)));
        known.extend(self.inputs.iter().filter_map(|(input, reg)| match input.field {
            Field::Position(axis) if input.sample == 0 => Some((*reg, Known::Position(axis))),
            Field::Volume(parameter) if input.sample == 0 => Some((*reg, Known::Value(parameter))),
            _ => None,
        }));
        // What may be jumped over leaves rows as they were; in loops nothing is followed.
        let mut skipped = 0;
        for (at, inst) in self.code.iter().enumerate() {
            match inst {
                Inst::Back { .. } | Inst::Head { .. } => return None,
                Inst::Skip { to, .. } => skipped = skipped.max(*to as usize),
                _ => {}
            }
            let (before, result) = (known.clone(), self.follow(inst, &known));
            for (touch, class, reg) in touches(inst) {
                if class == Class::Float && touch != Touch::Read {
                    known.remove(&reg);
                }
            }
            for (reg, new) in result {
                let kept = if at < skipped { before.get(&reg).and_then(|old| both(*old, new)) } else { Some(new) };
                known.extend(kept.map(|kept| (reg, kept)));
            }
        }
        match known.get(self.outputs.get(3)?)? {
            Known::Vanishes(value, table) => Some((*value, *table)),
            _ => None,
        }
    }

    /// What an instruction's results are known to be.
    fn follow(&self, inst: &Inst, known: &BTreeMap<Reg, Known>) -> Vec<(Reg, Known)> {
        let of = |reg: &Reg| known.get(reg).copied();
        let one = |reg: &Reg, known: Option<Known>| known.map(|known| (*reg, known)).into_iter().collect();
        match inst {
            Inst::Float2(Float2::Multiply, to, [a, b]) => {
                let factor = |v: Option<Known>| v.filter(|v| matches!(v, Known::Zero | Known::Vanishes(..)));
                one(to, factor(of(a)).or(factor(of(b))))
            }
            Inst::Float2(Float2::Divide, to, [a, _])
            | Inst::Float1(
                Float1::Negate | Float1::Abs | Float1::Sqrt | Float1::Saturate | Float1::Absorption,
                to,
                a,
            ) => one(to, of(a).filter(|v| matches!(v, Known::Zero | Known::Vanishes(..)))),
            Inst::Copy { class: Class::Float, to, from } => one(to, of(from)),
            Inst::Select { class: Class::Float, to, accept, reject, .. } => {
                one(to, of(accept).zip(of(reject)).and_then(|(a, b)| both(a, b)))
            }
            Inst::Blend { class: Class::Float, to, from, .. } => {
                one(to, of(to).zip(of(from)).and_then(|(a, b)| both(a, b)))
            }
            Inst::Call { function, arguments, results, mask: None } => self.called(*function, arguments, results, &of),
            _ => Vec::new(),
        }
    }

    fn called(
        &self,
        function: u32,
        arguments: &[Reg],
        results: &[Option<Reg>],
        of: &dyn Fn(&Reg) -> Option<Known>,
    ) -> Vec<(Reg, Known)> {
        let asked = self.functions.get(function as usize);
        let here = arguments.len() == 3 && (0..3u8).zip(arguments).all(|(a, reg)| of(reg) == Some(Known::Position(a)));
        let value = |i: usize| match arguments.get(i).and_then(of) {
            Some(Known::Value(value)) => Some(value),
            _ => None,
        };
        let place = |i: usize, known| results.get(i).copied().flatten().map(|reg| (reg, known)).into_iter().collect();
        match asked.map(|f| (f.derived, f.parameter)) {
            Some((Derived::Value, volume)) if here => place(0, Known::Value(volume)),
            Some((Derived::Medium | Derived::TableColor, table)) => {
                value(0).map_or_else(Vec::new, |value| place(3, Known::Vanishes(value, table)))
            }
            _ => Vec::new(),
        }
    }
}

/// What is known of a row that is either of two.
fn both(a: Known, b: Known) -> Option<Known> {
    match (a, b) {
        (a, b) if a == b => Some(a),
        (Known::Zero, other @ Known::Vanishes(..)) | (other @ Known::Vanishes(..), Known::Zero) => Some(other),
        _ => None,
    }
}
