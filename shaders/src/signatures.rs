//! The functions that a shader finds: one table, from which stubs, checks and documentation come.
//!
//! Each declared parameter is a function of its own name, and some types bring derived ones, whose
//! names are the parameter's with an ending. Positions are in *local space*: the world's axes and
//! units, with the origin moved to somewhere near the shape, so that single precision is enough
//! wherever in the world the shape lies. Directions, gradients and lengths are the world's.

use volact_core::{Compositing, Declaration, ParameterDecl, ParameterType};

/// What a parameter's function gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Derived {
    /// A volume's value in data units.
    Value,
    /// A volume's first four components in data units.
    Components,
    /// A volume's value, its range mapped to 0 to 1.
    Normalized,
    /// A volume's components as straight colour and opacity.
    Color,
    /// A volume's gradient.
    Gradient,
    /// A volume's value at the nearest sample.
    Nearest,
    /// Whether a position is inside a volume.
    Inside,
    /// A position in a volume's texture coordinates.
    Coordinates,
    /// A volume's smallest distance between samples.
    Spacing,
    /// A table's medium at a value.
    Medium,
    /// A table's straight colour and opacity at a value.
    TableColor,
    /// A table's straight colour and opacity at the entry of a value.
    Entry,
    /// A table's mean medium over a segment.
    Segment,
    /// The number, vector, matrix or word itself.
    Plain,
    /// A point of the world in local space.
    Local,
    /// Whether the parameter was given.
    Given,
    /// A vertex attribute, interpolated; a function of the sample.
    Attribute,
    /// An attribute's first four components.
    AttributeComponents,
}

/// One function.
#[derive(Clone, Copy, Debug)]
pub struct Signature {
    /// Of parameters of which type; `None` for any that may be left out.
    pub of: Option<ParameterType>,
    /// What it gives.
    pub derived: Derived,
    /// What follows the parameter's name.
    pub ending: &'static str,
    /// Its arguments in WGSL.
    pub arguments: &'static str,
    /// Its result's type in WGSL.
    pub result: &'static str,
    /// What it is, in one sentence.
    pub text: &'static str,
}

const P: &str = "p: vec3<f32>";

const fn row(
    of: ParameterType,
    derived: Derived,
    ending: &'static str,
    arguments: &'static str,
    result: &'static str,
    text: &'static str,
) -> Signature {
    Signature { of: Some(of), derived, ending, arguments, result, text }
}

/// All functions of parameters.
pub const SIGNATURES: &[Signature] = &[
    row(
        ParameterType::Volume,
        Derived::Value,
        "",
        P,
        "f32",
        "the value in data units of the component that the parameter `component` names, else of the first; \
         interpolated as the texture says; NaN where a NaN sample has weight",
    ),
    row(
        ParameterType::Volume,
        Derived::Components,
        "_components",
        P,
        "vec4<f32>",
        "the first four components in data units; 0 where there are fewer",
    ),
    row(
        ParameterType::Volume,
        Derived::Normalized,
        "_normalized",
        P,
        "f32",
        "the value with the texture's range mapped to 0 to 1, not clamped",
    ),
    row(
        ParameterType::Volume,
        Derived::Color,
        "_color",
        P,
        "vec4<f32>",
        "straight colour and opacity as the components mean it, with the range mapped to 0 to 1 and clamped",
    ),
    row(
        ParameterType::Volume,
        Derived::Gradient,
        "_gradient",
        P,
        "vec3<f32>",
        "the gradient of the value in data units per world unit, along the world's axes: central differences \
         over one voxel either way",
    ),
    row(
        ParameterType::Volume,
        Derived::Nearest,
        "_nearest",
        P,
        "f32",
        "the value at the nearest sample, in data units",
    ),
    row(
        ParameterType::Volume,
        Derived::Inside,
        "_inside",
        P,
        "bool",
        "whether the position is inside the volume's region; outside, values are those of its edge",
    ),
    row(
        ParameterType::Volume,
        Derived::Coordinates,
        "_coordinates",
        P,
        "vec3<f32>",
        "the position in texture coordinates: 0 to 1 over the volume's region",
    ),
    row(
        ParameterType::Volume,
        Derived::Spacing,
        "_spacing",
        "",
        "f32",
        "the smallest distance between neighbouring samples, in world units",
    ),
    row(
        ParameterType::Table,
        Derived::Medium,
        "",
        "v: f32",
        "Medium",
        "colour and extinction at a value in data units, by way of the parameter `unit_distance`",
    ),
    row(
        ParameterType::Table,
        Derived::TableColor,
        "_color",
        "v: f32",
        "vec4<f32>",
        "straight colour and opacity at a value in data units",
    ),
    row(
        ParameterType::Table,
        Derived::Entry,
        "_entry",
        "v: f32",
        "vec4<f32>",
        "straight colour and opacity of the control point at that value (the last within 1/1024 of it), never \
         interpolated; transparent black where there is none",
    ),
    row(
        ParameterType::Table,
        Derived::Segment,
        "_segment",
        "front: f32, back: f32, length: f32",
        "Medium",
        "the uniform medium that over a segment of that world length looks as the table does while the value \
         runs evenly from front to back",
    ),
    row(ParameterType::Float, Derived::Plain, "", "", "f32", "the number"),
    row(ParameterType::Int, Derived::Plain, "", "", "i32", "the number"),
    row(ParameterType::Bool, Derived::Plain, "", "", "bool", "the truth value"),
    row(ParameterType::Vec2, Derived::Plain, "", "", "vec2<f32>", "the vector"),
    row(ParameterType::Vec3, Derived::Plain, "", "", "vec3<f32>", "the vector"),
    row(
        ParameterType::Vec3,
        Derived::Local,
        "_local",
        "",
        "vec3<f32>",
        "the vector taken as a point of the world, in local space",
    ),
    row(ParameterType::Vec4, Derived::Plain, "", "", "vec4<f32>", "the vector"),
    row(ParameterType::Color, Derived::Plain, "", "", "vec4<f32>", "straight colour and opacity"),
    row(ParameterType::Matrix, Derived::Plain, "", "", "mat4x4<f32>", "the matrix, which multiplies columns"),
    row(
        ParameterType::Choice,
        Derived::Plain,
        "",
        "",
        "u32",
        "the word's place among the choices; beside it there is a constant `NAME_WORD` for each word",
    ),
    row(
        ParameterType::Attribute,
        Derived::Attribute,
        "",
        "s: Sample",
        "f32",
        "the interpolated number of the component that the parameter `component` names, else of the first",
    ),
    row(
        ParameterType::Attribute,
        Derived::AttributeComponents,
        "_components",
        "s: Sample",
        "vec4<f32>",
        "the first four interpolated components; 0 where there are fewer",
    ),
    Signature {
        of: None,
        derived: Derived::Given,
        ending: "_given",
        arguments: "",
        result: "bool",
        text: "whether the parameter was given",
    },
];

/// Names that the framework itself declares.
pub const FRAMEWORK: [&str; 3] = ["Sample", "Medium", "medium"];

/// Beginning of the names that the framework keeps for itself.
pub const RESERVED_PREFIX: &str = "volact_";

/// The functions of a parameter, for a shader of that declaration and compositing.
pub fn signatures_of<'a>(
    parameter: &'a ParameterDecl,
    declaration: &'a Declaration,
    compositing: Compositing,
) -> impl Iterator<Item = &'static Signature> + 'a {
    let optional = !parameter.required && parameter.default.is_none();
    let kind = kind_of(parameter);
    let lengths = has_lengths(declaration, compositing);
    SIGNATURES.iter().filter(move |s| match (s.of, s.derived) {
        (None, _) => optional,
        (of, Derived::Segment) => of == kind && lengths && compositing == Compositing::Over,
        (of, Derived::Medium) => of == kind && lengths,
        (of, _) => of == kind,
    })
}

/// The type by which a parameter's functions go: a float that also accepts whole numbers is one.
pub fn kind_of(parameter: &ParameterDecl) -> Option<ParameterType> {
    match parameter.types.as_slice() {
        [one] => Some(*one),
        [ParameterType::Float, ParameterType::Int] | [ParameterType::Int, ParameterType::Float] => {
            Some(ParameterType::Float)
        }
        _ => None,
    }
}

/// Whether opacity can become extinction: with a unit distance, or where no length counts.
pub fn has_lengths(declaration: &Declaration, compositing: Compositing) -> bool {
    compositing != Compositing::Over || declaration.parameter("unit_distance").is_some()
}

/// The name of the constant for a word of a choice.
pub fn word_name(parameter: &str, word: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    format!("{parameter}_{}", word.chars().map(plain).collect::<String>())
}

/// What stands before the author's text: types, and functions without meaning of their own.
pub fn prelude(declaration: &Declaration, compositing: Compositing) -> String {
    let mut text = String::from("struct Medium { color: vec3<f32>, extinction: f32 }\n");
    text.push_str("struct Sample { position: vec3<f32>, direction: vec3<f32>, step: f32, view: vec3<f32>, ");
    text.push_str("depth: f32, value: f32");
    let attributes = declaration.parameters.iter().filter(|p| kind_of(p) == Some(ParameterType::Attribute));
    for p in attributes {
        let name = &p.name;
        text.push_str(&format!(", volact_{name}: f32, volact_{name}_components: vec4<f32>"));
    }
    text.push_str(" }\n");
    if has_lengths(declaration, compositing) {
        text.push_str("fn medium(color: vec3<f32>, opacity: f32) -> Medium { return Medium(); }\n");
    }
    for p in &declaration.parameters {
        for s in signatures_of(p, declaration, compositing) {
            let name = format!("{}{}", p.name, s.ending);
            let body = match s.derived {
                Derived::Attribute | Derived::AttributeComponents => format!("s.volact_{name}"),
                _ => format!("{}()", s.result),
            };
            text.push_str(&format!("fn {name}({}) -> {} {{ return {body}; }}\n", s.arguments, s.result));
        }
        for (i, word) in p.choices.iter().enumerate() {
            text.push_str(&format!("const {} = {i}u;\n", word_name(&p.name, word)));
        }
    }
    text
}

/// The function `value` of a shader that has none of its own: the value of the first volume declared,
/// else the number of the first attribute; empty where there is neither.
pub fn plain_value(declaration: &Declaration) -> String {
    let first = |wanted| declaration.parameters.iter().find(|p| kind_of(p) == Some(wanted)).map(|p| &p.name);
    let read = first(ParameterType::Volume).map(|name| format!("{name}(s.position)"));
    let read = read.or_else(|| first(ParameterType::Attribute).map(|name| format!("{name}(s)")));
    read.map_or_else(String::new, |read| format!("fn value(s: Sample) -> f32 {{ return {read}; }}\n"))
}

/// Every name that a shader's declaration takes, with the parameter that takes it.
pub fn names<'a>(declaration: &'a Declaration, compositing: Compositing) -> Vec<(String, usize)> {
    let of = |(i, p): (usize, &'a ParameterDecl)| {
        let functions = signatures_of(p, declaration, compositing).map(|s| format!("{}{}", p.name, s.ending));
        let words = p.choices.iter().map(|w| word_name(&p.name, w));
        functions.chain(words).map(move |name| (name, i)).collect::<Vec<_>>()
    };
    declaration.parameters.iter().enumerate().flat_map(of).collect()
}
