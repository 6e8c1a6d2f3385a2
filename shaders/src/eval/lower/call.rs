//! Calls: of the author's functions, which are inlined, and of the framework's.

use naga::{Handle, ScalarKind, TypeInner};

use super::{Frame, LowerError, Lowered, Lowerer, Mask, Scalar, Value, expression::pick, flow::Returns};
use crate::{
    eval::{
        Real,
        code::{Class, Inst, Reg},
        kernel::{Field, Function, Input},
        ops::{Float1, Float2, ToBits, truth},
        uniforms::Uniform,
    },
    program::Stub,
    signatures::Derived,
};
use volact_core::Compositing;

impl<'p, F: Real> Lowerer<'p, F> {
    /// The result of a function for arguments, where the mask holds.
    pub(super) fn inline(
        &mut self,
        handle: Handle<naga::Function>,
        arguments: Vec<Value<F>>,
        mask: Mask,
    ) -> Lowered<Vec<Scalar<F>>> {
        let program: &'p crate::Program = self.program;
        let function = &program.module().functions[handle];
        let mut frame = Frame {
            handle,
            function,
            values: vec![None; function.expressions.len()],
            arguments,
            locals: vec![None; function.local_variables.len()],
            returns: Returns::of(function),
            breakable: Vec::new(),
            loops: 0,
        };
        self.variables(&mut frame)?;
        self.prepare_returns(&mut frame)?;
        self.block(&mut frame, &function.body, mask)?;
        self.returned(frame)
    }

    pub(super) fn call(
        &mut self,
        handle: Handle<naga::Function>,
        arguments: Vec<Value<F>>,
        mask: Mask,
    ) -> Lowered<Vec<Scalar<F>>> {
        match self.program.stub(handle) {
            None => self.inline(handle, arguments, mask),
            Some(Stub::Medium) => self.medium(&numbers(&arguments)?),
            Some(Stub::Parameter { parameter, derived }) => {
                let function = Function { parameter, derived };
                if let Some(known) = self.uniforms.and_then(|u| u.value(self.program, function)) {
                    return self.known(handle, &known);
                }
                let arguments = numbers(&arguments)?;
                if let Some(sample) = self.own_place(function, &arguments).filter(|_| mask == Mask::All) {
                    return Ok(vec![Scalar::Row(self.input(Input { sample, field: Field::Volume(parameter) }))]);
                }
                self.ask(handle, function, &arguments, mask)
            }
        }
    }

    /// The sample of which a volume's value is asked for at its own position, where that is an input.
    fn own_place(&self, function: Function, arguments: &[Scalar<F>]) -> Option<usize> {
        let wanted = self.values && function.derived == Derived::Value && arguments.len() == 3;
        let input = |reg: Reg| self.inputs.iter().find(|(_, known)| *known == reg).map(|(input, _)| *input);
        let sample = |axis: u8| match *arguments.get(usize::from(axis))? {
            Scalar::Row(reg) => input(reg).filter(|i| i.field == Field::Position(axis)).map(|i| i.sample),
            _ => None,
        };
        let first = sample(0).filter(|_| wanted)?;
        (1..3).all(|axis| sample(axis) == Some(first)).then_some(first)
    }

    /// `medium(color, opacity)`: σ = −ln(1 − a)/unit; where no length counts, the opacity itself.
    fn medium(&mut self, arguments: &[Scalar<F>]) -> Lowered<Vec<Scalar<F>>> {
        let mut medium: Vec<_> = (0..3).map(|i| pick(arguments, i)).collect();
        let opacity = pick(arguments, 3);
        let unit = self.program.declaration().parameters.iter().position(|p| p.name == "unit_distance");
        medium.push(match unit {
            Some(parameter) if self.program.compositing() == Compositing::Over => {
                let depth = self.f1(Float1::Saturate, opacity)?;
                let depth = self.f1(Float1::Absorption, depth)?;
                let function = Function { parameter, derived: Derived::Plain };
                let unit = match self.uniforms.and_then(|u| u.value(self.program, function)) {
                    Some(Uniform::Floats(v)) => Scalar::Float(F::from_f64(v.first().copied().unwrap_or(f64::NAN))),
                    _ => self.results(function, &[], 1, Mask::All)?[0],
                };
                self.f2(Float2::Divide, depth, unit)?
            }
            _ => opacity,
        });
        Ok(medium)
    }

    fn result_type(&self, handle: Handle<naga::Function>) -> Lowered<&'p TypeInner> {
        let module = self.program.module();
        let result = module.functions[handle].result.as_ref();
        let result = result.ok_or_else(|| LowerError::new("a function of the framework without result"))?;
        Ok(&module.types[result.ty].inner)
    }

    /// A value that is the same for all samples.
    fn known(&self, handle: Handle<naga::Function>, value: &Uniform) -> Lowered<Vec<Scalar<F>>> {
        let inner = self.result_type(handle)?;
        let count = self.size(inner);
        let kind = inner.scalar().map_or(ScalarKind::Float, |s| s.kind);
        match (kind, value) {
            (ScalarKind::Float, Uniform::Floats(v)) if v.len() >= count => {
                Ok(v[..count].iter().map(|x| Scalar::Float(F::from_f64(*x))).collect())
            }
            (ScalarKind::Sint, Uniform::Int(v)) => {
                let clamped = (*v).clamp(i32::MIN.into(), i32::MAX.into()) as i32;
                Ok(vec![Scalar::Bits(clamped as u32)])
            }
            (ScalarKind::Uint, Uniform::Int(v)) => Ok(vec![Scalar::Bits((*v).clamp(0, u32::MAX.into()) as u32)]),
            (ScalarKind::Bool, Uniform::Bool(v)) => Ok(vec![Scalar::Bits(truth(*v))]),
            _ => Err(LowerError::new("a parameter of another type than declared")),
        }
    }

    /// A value that the environment gives.
    fn ask(
        &mut self,
        handle: Handle<naga::Function>,
        function: Function,
        arguments: &[Scalar<F>],
        mask: Mask,
    ) -> Lowered<Vec<Scalar<F>>> {
        let inner = self.result_type(handle)?;
        let count = self.size(inner);
        let kind = inner.scalar().map_or(ScalarKind::Float, |s| s.kind);
        // Where no length counts, a table's medium is its colour with the opacity as it stands.
        let flat = self.program.compositing() != Compositing::Over;
        let derived = if flat && function.derived == Derived::Medium { Derived::TableColor } else { function.derived };
        let results = self.results(Function { derived, ..function }, arguments, count, mask)?;
        let convert = match kind {
            ScalarKind::Float => return Ok(results),
            ScalarKind::Bool => ToBits::Truth,
            ScalarKind::Uint => ToBits::Unsigned,
            _ => ToBits::Signed,
        };
        self.each(count, |this, i| this.bits_of(convert, results[i]))
    }

    fn results(
        &mut self,
        function: Function,
        arguments: &[Scalar<F>],
        count: usize,
        mask: Mask,
    ) -> Lowered<Vec<Scalar<F>>> {
        let number = match self.functions.iter().position(|f| *f == function) {
            Some(known) => known,
            None => {
                self.functions.push(function);
                self.functions.len() - 1
            }
        };
        let arguments = arguments.iter().map(|a| self.float(*a)).collect::<Lowered<Box<[_]>>>()?;
        let results: Vec<_> = (0..count).map(|_| self.new_reg(Class::Float)).collect();
        let mask = match mask {
            Mask::All => None,
            other => Some(self.bits(self.mask(other))?),
        };
        self.emit(Inst::Call {
            function: number as u32,
            arguments,
            results: results.iter().copied().map(Some).collect(),
            mask,
        })?;
        Ok(results.into_iter().map(Scalar::Row).collect())
    }
}

/// All numbers of the arguments, one after the other.
fn numbers<F: Copy>(arguments: &[Value<F>]) -> Lowered<Vec<Scalar<F>>> {
    let mut all = Vec::new();
    for argument in arguments {
        match argument {
            Value::Data(data) => all.extend(data.iter()),
            Value::Pointer(_) => return Err(LowerError::new("a pointer as argument of the framework")),
        }
    }
    Ok(all)
}
