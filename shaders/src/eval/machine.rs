//! The evaluation itself: instructions over the rows of a batch.

use std::mem::take;

use thiserror::Error;

use super::{
    Kernel, Real,
    code::{Class, Inst, Reg},
    ops::{
        Bits1, Bits2, Bits3, Compare, Float1, Float2, Float3, ToBits, ToFloat, bits1, bits2, bits3, compare, float1,
        float2, float3, to_bits, to_float,
    },
};

/// Most samples of a batch.
pub const BATCH: usize = 512;

/// How often all loops of a shader together may go round for one sample.
pub const LOOP_BUDGET: u32 = 65_536;

/// Most arguments of a function of the framework: two vectors.
const MAX_ARGUMENTS: usize = 8;
/// Most numbers that one gives: a matrix.
const MAX_RESULTS: usize = 16;

/// What gives the values of volumes, tables and attributes.
pub trait Environment<F> {
    /// Evaluates [`Kernel::functions`]`[function]` for a batch: one row a number of the arguments,
    /// one a number of the result; those that nobody wants are empty. A truth value is 0 or 1.
    /// Samples whose entry in `live` is 0 may be left out.
    fn call(&mut self, function: usize, arguments: &[&[F]], results: &mut [&mut [F]], live: Option<&[u32]>);
}

/// Why a batch was not evaluated.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum Overrun {
    /// A sample's loops went round too often.
    #[error("shader {shader:?}: the loops of one sample go round more than {budget} times; the shader may never end")]
    Loops {
        /// The shader.
        shader: String,
        /// The budget of a sample.
        budget: u32,
    },
    /// The rows given are not those that the kernel reads.
    #[error(
        "shader {shader:?}: {found} input rows for {samples} samples, wanted {wanted} of that length, at most {BATCH}"
    )]
    Inputs {
        /// The shader.
        shader: String,
        /// Rows given.
        found: usize,
        /// Rows that the kernel reads.
        wanted: usize,
        /// Samples asked for.
        samples: usize,
    },
}

/// Rows to evaluate a kernel in: one a thread.
#[derive(Debug)]
pub struct Machine<'k, F> {
    kernel: &'k Kernel<F>,
    floats: Vec<Vec<F>>,
    bits: Vec<Vec<u32>>,
    counts: Vec<u32>,
    budget: u32,
    samples: usize,
}

impl<'k, F: Real> Machine<'k, F> {
    /// A machine for a kernel.
    pub fn new(kernel: &'k Kernel<F>) -> Self {
        let mut floats = vec![vec![F::default(); BATCH]; kernel.floats as usize];
        let mut bits = vec![vec![0; BATCH]; kernel.bits as usize];
        kernel.float_constants.iter().for_each(|(reg, value)| floats[*reg as usize].fill(*value));
        kernel.bits_constants.iter().for_each(|(reg, value)| bits[*reg as usize].fill(*value));
        Self { kernel, floats, bits, counts: vec![0; BATCH], budget: LOOP_BUDGET, samples: 0 }
    }

    /// Sets another budget for the loops of a sample.
    pub fn with_loop_budget(mut self, budget: u32) -> Self {
        self.budget = budget;
        self
    }

    /// Evaluates a batch of `samples`, given the rows that [`Kernel::inputs`] names.
    ///
    /// # Errors
    /// If a sample's loops exceed the budget, or the rows are not those.
    pub fn run(
        &mut self,
        samples: usize,
        inputs: &[&[F]],
        environment: &mut dyn Environment<F>,
    ) -> Result<(), Overrun> {
        let wanted = self.kernel.inputs.len();
        if inputs.len() != wanted || samples > BATCH || inputs.iter().any(|row| row.len() != samples) {
            let shader = self.kernel.shader.clone();
            return Err(Overrun::Inputs { shader, found: inputs.len(), wanted, samples });
        }
        for ((_, reg), row) in self.kernel.inputs.iter().zip(inputs) {
            self.floats[*reg as usize][..samples].copy_from_slice(row);
        }
        self.run_in_place(samples, environment)
    }

    /// Evaluates a batch of `samples`, at most [`BATCH`], whose numbers were written into
    /// [`inputs`](Self::inputs) since the last batch: rows are used again for what is computed.
    ///
    /// # Errors
    /// If a sample's loops exceed the budget.
    pub fn run_in_place(&mut self, samples: usize, environment: &mut dyn Environment<F>) -> Result<(), Overrun> {
        self.samples = samples.min(BATCH);
        self.counts[..self.samples].fill(0);
        dispatch(self, environment)
    }

    /// Rows of [`BATCH`] numbers of inputs, by their place in [`Kernel::inputs`]; `None` where one is
    /// not there, or there twice.
    pub fn inputs<const N: usize>(&mut self, at: [usize; N]) -> Option<[&mut [F]; N]> {
        let mut rows = [0; N];
        for (row, at) in rows.iter_mut().zip(at) {
            *row = self.kernel.inputs.get(at)?.1 as usize;
        }
        self.floats.get_disjoint_mut(rows).ok().map(|rows| rows.map(Vec::as_mut_slice))
    }

    /// The numbers that the last batch gave: of a medium red, green, blue and extinction.
    ///
    /// # Panics
    /// If there is no such output.
    pub fn output(&self, index: usize) -> &[F] {
        &self.floats[self.kernel.outputs[index] as usize][..self.samples]
    }
}

/// Runs the code compiled for the widest vectors of this machine. The same operations in the same
/// order give the same bits for all of them.
#[cfg(target_arch = "x86_64")]
#[expect(unsafe_code, reason = "functions compiled for vector units that were found to be there")]
fn dispatch<F: Real>(machine: &mut Machine<F>, environment: &mut dyn Environment<F>) -> Result<(), Overrun> {
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma")]
    fn avx512<F: Real>(machine: &mut Machine<F>, environment: &mut dyn Environment<F>) -> Result<(), Overrun> {
        execute(machine, environment)
    }
    #[target_feature(enable = "avx2,fma")]
    fn avx2<F: Real>(machine: &mut Machine<F>, environment: &mut dyn Environment<F>) -> Result<(), Overrun> {
        execute(machine, environment)
    }
    let two = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
    let wide = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl");
    if two && wide {
        // SAFETY: all features that it is compiled for were just found.
        unsafe { avx512(machine, environment) }
    } else if two {
        // SAFETY: as above.
        unsafe { avx2(machine, environment) }
    } else {
        execute(machine, environment)
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn dispatch<F: Real>(machine: &mut Machine<F>, environment: &mut dyn Environment<F>) -> Result<(), Overrun> {
    execute(machine, environment)
}

/// A match over all operations, so that each has a loop of its own.
macro_rules! each {
    ($ty:ident, $op:expr, [$($name:ident)*], |$known:ident| $body:expr) => {
        match $op {
            $($ty::$name => {
                #[expect(non_upper_case_globals, reason = "named like the variable that it stands for")]
                const $known: $ty = $ty::$name;
                $body
            })*
        }
    };
}

#[inline(always)]
fn execute<F: Real>(machine: &mut Machine<F>, environment: &mut dyn Environment<F>) -> Result<(), Overrun> {
    let Machine { kernel, floats, bits, counts, budget, samples } = machine;
    let (n, code) = (*samples, kernel.code.as_slice());
    let mut rounds = 0u64;
    let mut at = 0;
    while let Some(inst) = code.get(at) {
        at += 1;
        match inst {
            Inst::Skip { mask, to } => {
                if none(&bits[*mask as usize][..n]) {
                    at = *to as usize;
                }
            }
            Inst::Head { mask, exit } => {
                let live = &bits[*mask as usize][..n];
                if none(live) {
                    at = *exit as usize;
                    continue;
                }
                rounds += 1;
                counts[..n].iter_mut().zip(live).for_each(|(count, live)| *count += live & 1);
                // Only then can one sample have gone round so often.
                if rounds > u64::from(*budget) && counts[..n].iter().any(|count| count > budget) {
                    return Err(Overrun::Loops { shader: kernel.shader.clone(), budget: *budget });
                }
            }
            Inst::Back { to } => at = *to as usize,
            Inst::Call { function, arguments, results, mask } => {
                call(floats, bits, n, *function as usize, arguments, results, *mask, environment);
            }
            other => step(other, floats, bits, n),
        }
    }
    Ok(())
}

#[inline(always)]
fn none(mask: &[u32]) -> bool {
    mask.iter().fold(0, |sum, m| sum | m) == 0
}

/// One instruction on all samples.
#[inline(always)]
fn step<F: Real>(inst: &Inst, floats: &mut [Vec<F>], bits: &mut [Vec<u32>], n: usize) {
    match inst {
        Inst::Float1(op, to, a) => each!(Float1, *op, [
            Negate Abs Floor Ceil Round Trunc Fract Sqrt InverseSqrt Sin Cos Tan Asin Acos Atan Sinh Cosh Tanh Asinh
            Acosh Atanh Exp Exp2 Log Log2 Sign Saturate Radians Degrees Frexp Absorption
        ], |op| map1(floats, n, *to, *a, |x| float1(op, x))),
        Inst::Float2(op, to, from) => each!(Float2, *op, [
            Add Subtract Multiply Divide Remainder Min Max Pow Atan2 Step
        ], |op| map2(floats, n, *to, *from, |x, y| float2(op, x, y))),
        Inst::Float3(op, to, from) => each!(Float3, *op, [Fma Clamp Mix SmoothStep],
            |op| map3(floats, n, *to, *from, |x, y, z| float3(op, x, y, z))),
        Inst::Bits1(op, to, a) => each!(Bits1, *op, [
            Negate Not Abs Sign CountOnes LeadingZeros TrailingZeros Reverse FirstLeadingSigned FirstLeadingUnsigned
            FirstTrailing
        ], |op| map1(bits, n, *to, *a, |x| bits1(op, x))),
        Inst::Bits2(op, to, from) => each!(Bits2, *op, [
            Add Subtract Multiply DivideSigned DivideUnsigned RemainderSigned RemainderUnsigned And Or Xor AndNot
            ShiftLeft ShiftRightSigned ShiftRightUnsigned MinSigned MaxSigned MinUnsigned MaxUnsigned Equal NotEqual
            LessSigned LessUnsigned LessEqualSigned LessEqualUnsigned FieldMask
        ], |op| map2(bits, n, *to, *from, |x, y| bits2(op, x, y))),
        Inst::Bits3(op, to, from) => each!(Bits3, *op, [ExtractSigned ExtractUnsigned],
            |op| map3(bits, n, *to, *from, |x, y, z| bits3(op, x, y, z))),
        Inst::Compare(op, to, [a, b]) => each!(Compare, *op, [Equal NotEqual Less LessEqual],
            |op| zip(&mut bits[*to as usize][..n], &floats[*a as usize][..n], &floats[*b as usize][..n],
                |x, y| compare(op, x, y))),
        Inst::ToBits(op, to, a) => each!(ToBits, *op, [Signed Unsigned Truth Pattern Exponent],
            |op| apply(&mut bits[*to as usize][..n], &floats[*a as usize][..n], |x| to_bits(op, x))),
        Inst::ToFloat(op, to, a) => each!(ToFloat, *op, [Signed Unsigned Truth Pattern],
            |op| apply(&mut floats[*to as usize][..n], &bits[*a as usize][..n], |x| to_float(op, x))),
        Inst::Ldexp { to, value, exponent } => {
            let mut row = take(&mut floats[*to as usize]);
            let exponent = &bits[*exponent as usize][..n];
            zip(&mut row[..n], &floats[*value as usize][..n], exponent, |x: F, e: u32| x.ldexp(e as i32));
            floats[*to as usize] = row;
        }
        Inst::Select { class: Class::Float, to, condition, accept, reject } => {
            choose(floats, &bits[*condition as usize][..n], n, *to, *accept, *reject);
        }
        Inst::Select { class: Class::Bits, to, condition, accept, reject } => {
            map3(bits, n, *to, [*condition, *accept, *reject], choose_bits);
        }
        Inst::Copy { class: Class::Float, to, from } => map1(floats, n, *to, *from, |x| x),
        Inst::Copy { class: Class::Bits, to, from } => map1(bits, n, *to, *from, |x| x),
        Inst::Blend { class: Class::Float, to, mask, from } => {
            let mut row = take(&mut floats[*to as usize]);
            blend(&mut row[..n], &bits[*mask as usize][..n], &floats[*from as usize][..n], F::choose);
            floats[*to as usize] = row;
        }
        Inst::Blend { class: Class::Bits, to, mask, from } => {
            let mut row = take(&mut bits[*to as usize]);
            blend(&mut row[..n], &bits[*mask as usize][..n], &bits[*from as usize][..n], choose_bits);
            bits[*to as usize] = row;
        }
        Inst::Gather { class: Class::Float, to, index, from } => {
            let mut row = take(&mut floats[*to as usize]);
            gather(&mut row[..n], &bits[*index as usize][..n], from, floats);
            floats[*to as usize] = row;
        }
        Inst::Gather { class: Class::Bits, to, index, from } => {
            let mut row = take(&mut bits[*to as usize]);
            gather(&mut row[..n], &bits[*index as usize][..n], from, bits);
            bits[*to as usize] = row;
        }
        Inst::Scatter { class, to, index, mask, from } => {
            // Out of the registers for the while: neither is among those written.
            let picked = take(&mut bits[*index as usize]);
            let live = mask.map(|mask| take(&mut bits[mask as usize]));
            let lanes = live.as_ref().map(|live| &live[..n]);
            match class {
                Class::Float => {
                    let row = take(&mut floats[*from as usize]);
                    scatter(floats, to, &picked[..n], lanes, &row[..n]);
                    floats[*from as usize] = row;
                }
                // The value may be the index or the mask itself.
                Class::Bits => {
                    let row = if from == index {
                        picked.clone()
                    } else if Some(*from) == *mask {
                        live.clone().unwrap_or_default()
                    } else {
                        bits[*from as usize].clone()
                    };
                    scatter(bits, to, &picked[..n], lanes, &row[..n]);
                }
            }
            bits[*index as usize] = picked;
            if let (Some(mask), Some(live)) = (mask, live) {
                bits[*mask as usize] = live;
            }
        }
        Inst::Skip { .. } | Inst::Head { .. } | Inst::Back { .. } | Inst::Call { .. } => {}
    }
}

#[inline(always)]
fn apply<T: Copy, U>(to: &mut [U], a: &[T], f: impl Fn(T) -> U) {
    to.iter_mut().zip(a).for_each(|(to, a)| *to = f(*a));
}

#[inline(always)]
fn zip<T: Copy, S: Copy, U>(to: &mut [U], a: &[T], b: &[S], f: impl Fn(T, S) -> U) {
    to.iter_mut().zip(a).zip(b).for_each(|((to, a), b)| *to = f(*a, *b));
}

#[inline(always)]
fn map1<T: Copy>(rows: &mut [Vec<T>], n: usize, to: Reg, a: Reg, f: impl Fn(T) -> T) {
    let mut row = take(&mut rows[to as usize]);
    apply(&mut row[..n], &rows[a as usize][..n], f);
    rows[to as usize] = row;
}

#[inline(always)]
fn map2<T: Copy>(rows: &mut [Vec<T>], n: usize, to: Reg, [a, b]: [Reg; 2], f: impl Fn(T, T) -> T) {
    let mut row = take(&mut rows[to as usize]);
    zip(&mut row[..n], &rows[a as usize][..n], &rows[b as usize][..n], f);
    rows[to as usize] = row;
}

#[inline(always)]
fn map3<T: Copy>(rows: &mut [Vec<T>], n: usize, to: Reg, [a, b, c]: [Reg; 3], f: impl Fn(T, T, T) -> T) {
    let mut row = take(&mut rows[to as usize]);
    let (a, b, c) = (&rows[a as usize][..n], &rows[b as usize][..n], &rows[c as usize][..n]);
    row[..n].iter_mut().zip(a).zip(b).zip(c).for_each(|(((to, a), b), c)| *to = f(*a, *b, *c));
    rows[to as usize] = row;
}

#[inline(always)]
fn choose<F: Real>(floats: &mut [Vec<F>], condition: &[u32], n: usize, to: Reg, accept: Reg, reject: Reg) {
    let mut row = take(&mut floats[to as usize]);
    let (a, b) = (&floats[accept as usize][..n], &floats[reject as usize][..n]);
    let lanes = row[..n].iter_mut().zip(condition).zip(a).zip(b);
    lanes.for_each(|(((to, c), a), b)| *to = F::choose(*c, *a, *b));
    floats[to as usize] = row;
}

#[inline(always)]
fn blend<T: Copy>(to: &mut [T], mask: &[u32], from: &[T], choose: impl Fn(u32, T, T) -> T) {
    to.iter_mut().zip(mask).zip(from).for_each(|((to, m), from)| *to = choose(*m, *from, *to));
}

/// As [`Real::choose`] for integers and truth values.
#[inline(always)]
fn choose_bits(mask: u32, accept: u32, reject: u32) -> u32 {
    (accept & mask) | (reject & !mask)
}

fn gather<T: Copy>(to: &mut [T], index: &[u32], from: &[Reg], rows: &[Vec<T>]) {
    let last = from.len().saturating_sub(1);
    for (lane, (to, index)) in to.iter_mut().zip(index).enumerate() {
        let row = from.get((*index as usize).min(last)).and_then(|reg| rows.get(*reg as usize));
        if let Some(value) = row.and_then(|row| row.get(lane)) {
            *to = *value;
        }
    }
}

fn scatter<T: Copy>(rows: &mut [Vec<T>], to: &[Reg], index: &[u32], mask: Option<&[u32]>, from: &[T]) {
    let last = to.len().saturating_sub(1);
    for (lane, (value, index)) in from.iter().zip(index).enumerate() {
        if mask.is_some_and(|mask| mask[lane] == 0) {
            continue;
        }
        let row = to.get((*index as usize).min(last)).and_then(|reg| rows.get_mut(*reg as usize));
        if let Some(place) = row.and_then(|row| row.get_mut(lane)) {
            *place = *value;
        }
    }
}

#[expect(clippy::too_many_arguments, reason = "the parts of one instruction and of the machine")]
fn call<F: Real>(
    floats: &mut [Vec<F>],
    bits: &[Vec<u32>],
    n: usize,
    function: usize,
    arguments: &[Reg],
    results: &[Option<Reg>],
    mask: Option<Reg>,
    environment: &mut dyn Environment<F>,
) {
    // Out of the registers for the call: results never share a row with arguments.
    let mut taken: [Vec<F>; MAX_RESULTS] = std::array::from_fn(|_| Vec::new());
    for (row, reg) in taken.iter_mut().zip(results) {
        *row = reg.map_or_else(Vec::new, |reg| take(&mut floats[reg as usize]));
    }
    let mut rows: [&[F]; MAX_ARGUMENTS] = [&[]; MAX_ARGUMENTS];
    for (row, reg) in rows.iter_mut().zip(arguments) {
        *row = &floats[*reg as usize][..n];
    }
    let live = mask.map(|mask| &bits[mask as usize][..n]);
    let wanted = |row: &Vec<F>| n.min(row.len());
    let mut out = taken.each_mut().map(|row| {
        let length = wanted(row);
        &mut row[..length]
    });
    let (arguments, count) = (&rows[..arguments.len().min(MAX_ARGUMENTS)], results.len().min(MAX_RESULTS));
    environment.call(function, arguments, &mut out[..count], live);
    for (row, reg) in taken.iter_mut().zip(results) {
        if let Some(reg) = reg {
            floats[*reg as usize] = take(row);
        }
    }
}
