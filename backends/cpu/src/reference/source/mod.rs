//! Shapes whose shader is a text: its program evaluated in f64 wherever it is wanted.
//!
//! Nothing is known of such a shader but what it gives at a sample. So the integral is found by
//! adaptive quadrature ([`adapt`], [`reduce`]) and surfaces by search ([`search`]): each
//! stretch of a ray is cut where a volume that the program reads changes its cell ([`cuts`]), and
//! parts are halved until two rules agree. What they differ by is the *estimate* of the error. It
//! is carried in the same enclosures as the certificate of tables, but it is no bound: what lies
//! between all samples of a rule is not seen. Another action's lattice has no such doubt.
//!
//! A program that does what a shader with a certificate does is drawn as that one, unless the
//! option `recognise` says otherwise ([`look`]).
//!
//! # What a sample is told
//! Positions are local, as docs/shaders.md has it. `s.step` is the length of the segment on a
//! lattice, and 0 for the integral, which is the limit of ever shorter segments. Where `shade` is
//! asked once a ray, it is told the place where the ray enters the shape, and the whole length
//! inside as the step. NaN in any number of a medium makes it transparent, and so does an infinite
//! colour.

mod adapt;
mod ask;
mod bent;
mod carried;
mod cuts;
mod fit;
mod met;
mod over;
mod prepare;
mod program;
mod reduce;
mod refused;
mod search;

use volact_core::{ActionError, ShaderEntry, resolve::ResolvedShape};
use volact_shaders::{Native, Program, builtin, recognise};

use super::{options::NAME, surfaces};

pub(super) use ask::Asker;
pub(super) use met::Met;
pub(super) use prepare::{Prepared, prepare};
pub(super) use refused::check;

/// How a shape is drawn.
pub(super) enum Look {
    /// By what this action knows of a shader of that name, with a certificate.
    Native(&'static str),
    /// As a surface of triangles.
    Surface,
    /// By its program.
    Source(Program),
}

/// The shaders of compositing with a certificate.
const NATIVE: [&str; 7] = ["simple", "lut", "mip", "minip", "average", "xray", "attribute"];

/// How a shape is to be drawn; with `recognised`, programs that do what is known are drawn by that.
///
/// # Errors
/// If the shader is not known here and has no source, or one that is wrong.
pub(super) fn look(shape: &ResolvedShape, recognised: bool) -> Result<Look, ActionError> {
    let name = shape.shader.declaration.name.as_str();
    let known = NATIVE.into_iter().find(|n| *n == name);
    match (&shape.shader.source, known) {
        _ if surfaces::is_surface(shape) => Ok(Look::Surface),
        (Some(_), _) => {
            let program = compile(shape, &shape.shader)?;
            let native = recognise(&program, recognised).map(native_name);
            Ok(native.map_or(Look::Source(program), Look::Native))
        }
        (None, Some(name)) if recognised => Ok(Look::Native(name)),
        (None, Some(name)) => {
            let shipped = builtin().map_err(|problems| wrong(shape, problems))?;
            let entry = shipped.into_iter().find(|entry| entry.declaration.name == name);
            entry.map_or(Ok(Look::Native(name)), |entry| Ok(Look::Source(compile(shape, &entry)?)))
        }
        (None, None) => Err(ActionError::Unsupported {
            action: NAME.into(),
            shape: shape.name.clone(),
            what: format!("shader {name:?}"),
            cure: "use simple, lut, mip, minip, average, xray or attribute, or a shader with a source".into(),
        }),
    }
}

fn compile(shape: &ResolvedShape, entry: &ShaderEntry) -> Result<Program, ActionError> {
    Program::new(entry).map_err(|error| wrong(shape, error))
}

/// An error of a shape's shader.
fn wrong(shape: &ResolvedShape, error: impl std::error::Error + Send + Sync + 'static) -> ActionError {
    ActionError::Shader { shape: shape.name.clone(), source: Box::new(error) }
}

fn native_name(native: Native) -> &'static str {
    match native {
        Native::Simple => "simple",
        Native::Lut => "lut",
        Native::Mip => "mip",
        Native::Minip => "minip",
        Native::Average => "average",
        Native::Xray => "xray",
        Native::Attribute => "attribute",
    }
}
