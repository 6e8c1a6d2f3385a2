//! The shaders that come with Volact, as sources of a few lines.

use std::sync::Arc;

use volact_core::{ShaderEntry, ShaderFile, ShaderText, scene::Problems};

use crate::{
    Program,
    eval::{Function, Kernel, lower},
    program::Entry,
};

macro_rules! shipped {
    ($($name:literal),* $(,)?) => {
        /// Name, declaration and source of each.
        const SHIPPED: &[(&str, &str, &str)] = &[$((
            $name,
            include_str!(concat!("../wgsl/", $name, ".ron")),
            include_str!(concat!("../wgsl/", $name, ".wgsl")),
        )),*];
    };
}

shipped!(
    "simple",
    "lut",
    "tangent_space",
    "gradient",
    "mip",
    "minip",
    "average",
    "xray",
    "isosurface",
    "lut2d",
    "labels",
    "attribute",
    "blend2",
);

/// All of them. Nothing is parsed but the declarations.
///
/// # Errors
/// Never: a test reads them all.
pub fn builtin() -> Result<Vec<ShaderEntry>, Problems> {
    SHIPPED.iter().map(read).collect()
}

/// Whether a shader of that name comes with Volact as a source.
pub fn is_builtin(name: &str) -> bool {
    SHIPPED.iter().any(|(shipped, ..)| *shipped == name)
}

fn read((name, ron, wgsl): &(&str, &str, &str)) -> Result<ShaderEntry, Problems> {
    let mut entry = ShaderFile::parse(name, ron).map_err(|problems| problems.of_file(format!("{name}.ron")))?.entry;
    entry.declaration.version = env!("CARGO_PKG_VERSION").into();
    entry.source = Some(Arc::new(ShaderText { file: format!("{name}.wgsl"), text: (*wgsl).into() }));
    Ok(entry)
}

/// A shader for which actions have kernels of their own, which do not evaluate its source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names are those of the shaders")]
pub enum Native {
    Simple,
    Lut,
    Mip,
    Minip,
    Average,
    Xray,
    Attribute,
}

impl Native {
    /// The name of the built-in shader.
    pub fn name(self) -> &'static str {
        NATIVE.iter().find(|(native, _)| *native == self).map_or("", |(_, name)| name)
    }
}

const NATIVE: [(Native, &str); 7] = [
    (Native::Simple, "simple"),
    (Native::Lut, "lut"),
    (Native::Mip, "mip"),
    (Native::Minip, "minip"),
    (Native::Average, "average"),
    (Native::Xray, "xray"),
    (Native::Attribute, "attribute"),
];

/// Which of these a program is: the same parameters, compositing and instructions, whatever it is
/// called and however it is written. `None` for all others, and where recognition is off.
pub fn recognise(program: &Program, on: bool) -> Option<Native> {
    NATIVE.iter().find(|(_, name)| on && does(program, name)).map(|(native, _)| *native)
}

/// Whether a program does what the built-in shader of a name does: the same parameters, compositing
/// and instructions.
pub fn does(program: &Program, name: &str) -> bool {
    // Most differ by what can be compared without a parser.
    let shipped = SHIPPED.iter().find(|(n, ..)| *n == name).and_then(|shipped| read(shipped).ok());
    let other = shipped.filter(|entry| alike(program, entry)).and_then(|entry| Program::new(&entry).ok());
    let shapes = other.and_then(|other| Some((shape(program)?, shape(&other)?)));
    shapes.is_some_and(|(own, other)| same(&own, &other))
}

fn alike(program: &Program, entry: &ShaderEntry) -> bool {
    let names = |d: &volact_core::Declaration| {
        let mut names: Vec<_> = d.parameters.iter().map(|p| (p.name.clone(), p.types.clone())).collect();
        names.sort();
        names
    };
    program.compositing() == entry.compositing && names(program.declaration()) == names(&entry.declaration)
}

type Shape = Vec<(Entry, Kernel<f32>, Vec<(String, Function)>)>;

/// What a program does, with everything that depends on a shape left open.
fn shape(program: &Program) -> Option<Shape> {
    let entries = [Entry::Shade, Entry::Segment, Entry::Value].into_iter().filter(|entry| program.has(*entry));
    let shape = |entry| {
        let kernel = lower::<f32>(program, entry, None, false).ok()?;
        let name = |f: &Function| program.declaration().parameters.get(f.parameter).map(|p| (p.name.clone(), *f));
        let functions = kernel.functions().iter().map(name).collect::<Option<Vec<_>>>()?;
        Some((entry, kernel, functions))
    };
    entries.map(shape).collect()
}

fn same(own: &Shape, other: &Shape) -> bool {
    let by_name = |(a, b): (&(String, Function), &(String, Function))| a.0 == b.0 && a.1.derived == b.1.derived;
    own.len() == other.len()
        && own.iter().zip(other).all(|((entry, kernel, functions), (other_entry, other_kernel, others))| {
            entry == other_entry
                && kernel.same(other_kernel)
                && functions.len() == others.len()
                && functions.iter().zip(others).all(by_name)
        })
}
