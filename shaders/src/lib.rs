//! Shaders: their sources, what is checked of them, and their evaluation on the CPU.
//!
//! A shader is `name.ron`, its declaration, and `name.wgsl`, in which each declared parameter is a
//! function of its own name. The author writes `fn shade(s: Sample) -> Medium`; `docs/shaders.md`
//! is the reference. This crate
//!
//! 1. reads both files ([`load`], [`load_folder`]) into a [`ShaderEntry`](volact_core::ShaderEntry),
//! 2. checks the text ([`Program`]): what is wrong is shown with the author's file, line and caret,
//! 3. compiles a function of it, with the uniform parameters of a shape, into a [`Kernel`],
//! 4. evaluates that over batches of samples ([`Machine`]), in `f32` or `f64`,
//! 5. or composes it with the framework's own texts for a GPU ([`gpu`]).
//!
//! What the functions of volumes, tables and attributes give is asked of an [`Environment`]: that
//! is the action's part.

pub mod builtin;
pub mod error;
pub mod eval;
pub mod gpu;
mod missing;
pub mod plain;
mod program;
mod programs;
mod refuse;
pub mod signatures;
pub mod source;
mod tokens;
mod unfit;

pub use builtin::{Native, builtin, does, is_builtin, recognise};
pub use error::{ShaderError, SourceError, SourceErrors};
pub use eval::{Environment, Kernel, Machine};
pub use missing::without_entry;
pub use program::{Entry, Program};
pub use programs::Programs;
pub use source::{load, load_folder};
pub use unfit::{blunt, unfit};
