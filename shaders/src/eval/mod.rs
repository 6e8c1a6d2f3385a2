//! Evaluation on the CPU, over batches of samples.
//!
//! A function of a [`Program`](crate::Program) is lowered with the uniform parameters of a shape
//! to a [`Kernel`]: all calls are inlined, what depends on no sample is computed once, and what is
//! left is a list of instructions. Each is one loop over a row, an array with one number for each
//! sample of the batch. Where samples take different ways, all ways are gone in turn with a mask
//! of those that go it, and a way that nobody goes is left out. A [`Machine`] holds the rows.
//!
//! Names of the same kind of number: the numbers of a shader's text are `f32` as in naga's form
//! of it, also where the evaluation is in `f64`; parameters are `f64` until then.

mod allocate;
pub(crate) mod check;
pub mod code;
mod kernel;
mod lower;
mod machine;
pub mod ops;
pub mod real;
mod tidy;
mod uniforms;
mod vanish;

pub(crate) use lower::lower;
pub(crate) use uniforms::Uniform;

pub use check::MAX_SCALARS;
pub use kernel::{Field, Function, Input, Kernel};
pub use lower::{MAX_CODE, MAX_ROWS};
pub use machine::{BATCH, Environment, LOOP_BUDGET, Machine, Overrun};
pub use real::Real;
pub use uniforms::Uniforms;
