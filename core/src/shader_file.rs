//! The declaration of a shader, as one RON document beside its WGSL.
//!
//! ```
//! use volact_core::{Compositing, ShaderFile};
//!
//! let file = ShaderFile::parse("glow", r#"Shader(
//!     version: 1,                     // of this format
//!     release: "1.0",                 // of the shader
//!     description: "a value as light",
//!     compositing: Over,
//!     parameters: [
//!         (name: "volume", type: Volume, required: true, description: "the data"),
//!         (name: "gain", type: Float, default: 1, bounds: (0, 10), description: "a factor"),
//!         (name: "mode", type: Choice, choices: ["warm", "cold"], default: "warm", description: "the hue"),
//!     ],
//! )"#)?;
//! assert_eq!(file.entry.compositing, Compositing::Over);
//! assert_eq!(file.entry.declaration.parameters.len(), 3);
//! # Ok::<(), volact_core::scene::Problems>(())
//! ```

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use crate::{
    Compositing, Declaration, ParameterDecl, ParameterType, ShaderEntry,
    parameter::Kind,
    scene::{
        Problem, Problems, SceneError, Spot, coerce, parse_document, plain_value, read_text,
        reader::{At, Fields, Reader},
    },
};

/// The version of the format that this build reads.
pub const SHADER_VERSION: u32 = 1;
/// The most parameters that a shader may declare.
pub const MAX_PARAMETERS: usize = 64;

/// A shader's declaration, and where everything stood in its text.
#[derive(Clone, Debug)]
pub struct ShaderFile {
    /// The declaration; it has no source yet.
    pub entry: ShaderEntry,
    places: BTreeMap<String, Spot>,
}

impl ShaderFile {
    /// Reads the declaration of the shader `name` from a text.
    ///
    /// # Errors
    /// All problems, in the order of the text.
    pub fn parse(name: &str, text: &str) -> Result<Self, Problems> {
        let root = parse_document(text).map_err(|problem| Problems::new(vec![problem]))?;
        let mut reader = Reader::default();
        let at = reader.root(&root);
        let entry = read(&mut reader, &at, name);
        let (places, problems) = reader.finish();
        match entry {
            Some(entry) if problems.is_empty() => Ok(Self { entry, places }),
            _ => Err(Problems::new(problems)),
        }
    }

    /// Reads a declaration from a file; the file's name without extension is the shader's.
    ///
    /// # Errors
    /// If the file cannot be read, or all its problems.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let text = read_text(path)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        Ok(Self::parse(&name, &text).map_err(|problems| problems.of_file(path.display().to_string()))?)
    }

    /// A problem with the name of a parameter.
    pub fn name_problem(&self, parameter: usize, wanted: impl Into<String>) -> Problem {
        let path = format!("parameters[{parameter}].name");
        let name = self.entry.declaration.parameters.get(parameter).map_or("", |p| p.name.as_str());
        Problem::new(self.places.get(&path).copied(), &path, format!("{name:?}"), wanted)
    }
}

fn read(reader: &mut Reader, at: &At, name: &str) -> Option<ShaderEntry> {
    let known = ["version", "release", "description", "compositing", "parameters"];
    let fields = reader.fields(at, &["Shader"], &known)?;
    reader.version(&fields, SHADER_VERSION);
    let release = fields.optional("release").and_then(|at| reader.name(&at)).unwrap_or_else(|| "0".into());
    let description = reader.required(&fields, "description", "one line that says what the shader shows");
    let description = description.and_then(|at| reader.text(&at)).unwrap_or_default();
    let mut declaration = Declaration::new(Kind::Shader, name, &release, description);
    let compositing = reader.required(&fields, "compositing", "how samples are put together, e.g. Over");
    let compositing = compositing.and_then(|at| reader.word(&at, &Compositing::ALL.map(|c| (title(c.name()), c))));
    if let Some(at) = reader.required(&fields, "parameters", "a list of parameters") {
        let items = reader.list(&at, "a list of parameters").unwrap_or_default();
        if items.len() > MAX_PARAMETERS {
            return reader.refuse(&at, format!("at most {MAX_PARAMETERS} parameters"));
        }
        declaration.parameters = items.iter().filter_map(|at| parameter(reader, at)).collect();
        unique(reader, &items, &declaration);
    }
    Some(ShaderEntry { declaration, compositing: compositing?, source: None })
}

/// The words of a document begin with a capital letter.
fn title(name: &'static str) -> &'static str {
    match name {
        "over" => "Over",
        "maximum" => "Maximum",
        "minimum" => "Minimum",
        "average" => "Average",
        "add" => "Add",
        _ => "First",
    }
}

fn unique(reader: &mut Reader, items: &[At], declaration: &Declaration) {
    let mut names = BTreeSet::new();
    if items.len() != declaration.parameters.len() {
        return; // some have other problems, which are told
    }
    for (at, parameter) in items.iter().zip(&declaration.parameters) {
        if !names.insert(&parameter.name) {
            reader.fault(at, format!("a second parameter {:?}", parameter.name), "each name once");
        }
    }
}

const TYPES: [(&str, ParameterType); 12] = [
    ("Volume", ParameterType::Volume),
    ("Table", ParameterType::Table),
    ("Float", ParameterType::Float),
    ("Int", ParameterType::Int),
    ("Bool", ParameterType::Bool),
    ("Vec2", ParameterType::Vec2),
    ("Vec3", ParameterType::Vec3),
    ("Vec4", ParameterType::Vec4),
    ("Color", ParameterType::Color),
    ("Matrix", ParameterType::Matrix),
    ("Choice", ParameterType::Choice),
    ("Attribute", ParameterType::Attribute),
];

fn parameter(reader: &mut Reader, at: &At) -> Option<ParameterDecl> {
    let known = ["name", "type", "required", "default", "bounds", "positive", "choices", "unit", "description"];
    let fields = reader.fields(at, &[], &known)?;
    let name = reader.required(&fields, "name", "the parameter's name").and_then(|at| reader.name(&at));
    let kind = reader.required(&fields, "type", "the parameter's type, e.g. Float");
    let kind = kind.and_then(|at| reader.word(&at, &TYPES));
    let text = reader.required(&fields, "description", "one line that says what it does");
    let text = text.and_then(|at| reader.text(&at)).unwrap_or_default();
    let mut decl = ParameterDecl::new(&name?, kind?, text);
    decl.unit = fields.optional("unit").and_then(|at| reader.name(&at)).unwrap_or_default();
    decl.required = fields.optional("required").and_then(|at| reader.bool(&at)).unwrap_or_default();
    decl.bounds = bounds(reader, &fields, decl.types[0]);
    choices(reader, at, &fields, &mut decl);
    default(reader, &fields, &mut decl);
    Some(decl)
}

fn bounds(reader: &mut Reader, fields: &Fields, kind: ParameterType) -> Option<[f64; 2]> {
    let at = fields.optional("bounds").or_else(|| fields.optional("positive"))?;
    if !matches!(kind, ParameterType::Float | ParameterType::Int) {
        reader.fault(&at, format!("bounds of a {kind}"), "bounds of a float or an int only");
        return None;
    }
    if let Some(positive) = fields.optional("positive") {
        if fields.optional("bounds").is_some() {
            return reader.refuse(&positive, "either `positive` or `bounds`");
        }
        return reader.bool(&positive).filter(|p| *p).map(|_| [f64::MIN_POSITIVE, f64::MAX]);
    }
    let [low, high] = reader.array(&at, "the lowest and the highest number, (low, high)", Reader::number)?;
    if low > high {
        return reader.refuse(&at, "the lowest number before the highest");
    }
    Some([low.max(f64::MIN), high.min(f64::MAX)])
}

fn choices(reader: &mut Reader, at: &At, fields: &Fields, decl: &mut ParameterDecl) {
    let is_choice = decl.types == [ParameterType::Choice];
    match fields.optional("choices") {
        Some(at) if is_choice => {
            let words = reader.list(&at, "a list of words").unwrap_or_default();
            decl.choices = words.iter().filter_map(|at| reader.name(at)).collect();
            let unique: BTreeSet<_> = decl.choices.iter().collect();
            if words.is_empty() || unique.len() < decl.choices.len() {
                reader.refuse::<()>(&at, "at least one word, and each once");
            }
        }
        Some(at) => reader.fault(&at, format!("choices of a {}", decl.types[0]), "choices of a Choice only"),
        None if is_choice => reader.fault(at, "a choice without `choices`", "choices: [\"word\", …]"),
        None => {}
    }
}

fn default(reader: &mut Reader, fields: &Fields, decl: &mut ParameterDecl) {
    let Some(at) = fields.optional("default") else { return };
    if decl.required {
        return reader.fault(&at, "a default of what is required", "either `required` or a default");
    }
    let Some(value) = plain_value(reader, &at) else { return };
    match decl.accept(&coerce(&value, decl)) {
        Ok(value) => decl.default = Some(value),
        Err(problem) => reader.fault(&at, at.node.show(), format!("a default that is accepted: {problem}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ParameterValue;

    #[test]
    fn all_problems_come_at_once_with_their_lines() {
        let text = r#"Shader(
  version: 1,
  descripton: "x",
  compositing: Ovr,
  parameters: [
    (name: "a", type: Flaot, description: "a"),
    (name: "b", type: Choice, description: "b"),
    (name: "c", type: Float, default: 3, bounds: (0, 1), description: "c"),
    (name: "d", type: Bool, bounds: (0, 1), description: "d"),
    (name: "e", type: Int, required: true, default: 1),
  ],
)"#;
        let expected = "\
1:1: description: found nothing, wanted one line that says what the shader shows
3:3: found field `descripton`, wanted version, release, description, compositing, parameters; did you mean \"description\"?
4:16: compositing: found `Ovr`, wanted one of Over, Maximum, Minimum, Average, Add, First; did you mean \"Over\"?
6:23: parameters[0].type: found `Flaot`, wanted one of Volume, Table, Float, Int, Bool, Vec2, Vec3, Vec4, Color, Matrix, Choice, Attribute; did you mean \"Float\"?
7:5: parameters[1]: found a choice without `choices`, wanted choices: [\"word\", …]
8:39: parameters[2].default: found 3, wanted a default that is accepted: parameter \"c\" is float 3.0, wanted 0 to 1
9:37: parameters[3].bounds: found bounds of a bool, wanted bounds of a float or an int only
10:5: parameters[4].description: found nothing, wanted one line that says what it does
10:53: parameters[4].default: found a default of what is required, wanted either `required` or a default";
        assert_eq!(ShaderFile::parse("x", text).unwrap_err().to_string(), expected);
    }

    #[test]
    fn a_declaration_is_what_the_builder_makes() {
        let text = r#"(version: 1, release: "2", description: "d", compositing: First, parameters: [
            (name: "unit", type: Float, positive: true, unit: "world units", required: true, description: "u"),
            (name: "color", type: Color, default: (1, 0, 0), description: "c"),
            (name: "least", type: Int, bounds: (0, inf), default: 2, description: "l")])"#;
        let file = ShaderFile::parse("s", text).unwrap();
        let expected = Declaration::new(Kind::Shader, "s", "2", "d")
            .with(
                ParameterDecl::new("unit", ParameterType::Float, "u")
                    .bounds(f64::MIN_POSITIVE, f64::MAX)
                    .unit("world units")
                    .required(),
            )
            .with(
                ParameterDecl::new("color", ParameterType::Color, "c")
                    .default(ParameterValue::Color([1.0, 0.0, 0.0, 1.0])),
            )
            .with(ParameterDecl::new("least", ParameterType::Int, "l").bounds(0.0, f64::MAX).default(2i64));
        assert_eq!(file.entry.declaration, expected);
        let problem = file.name_problem(1, "another name");
        assert_eq!(problem.to_string(), "3:20: parameters[1].name: found \"color\", wanted another name");
    }

    #[test]
    fn a_name_is_there_once() {
        let text = r#"(version: 1, description: "d", compositing: Over, parameters: [
            (name: "a", type: Int, description: "u"), (name: "a", type: Float, description: "u")])"#;
        let error = ShaderFile::parse("s", text).unwrap_err().to_string();
        assert_eq!(error, "2:55: parameters[1]: found a second parameter \"a\", wanted each name once");
    }
}
