//! Shaders: what turns a sample into colour and extinction, known by name.
//!
//! A [`ShaderEntry`] is the declaration, how the shader's samples are put together, and its source
//! where it has one. The source is plain text here: whoever runs it reads it (`volact-shaders`).
//! An action without that asks for the shaders that it knows by name.

use std::{collections::BTreeMap, sync::Arc};

use crate::{
    Declaration, ParameterDecl, ParameterType, ParameterValue,
    parameter::{Kind, ParameterProblem},
};

/// How a shader's samples along a ray become one colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Compositing {
    /// Emission and absorption in depth order.
    Over,
    /// The highest value of the interval, then classified.
    Maximum,
    /// The lowest value of the interval, then classified.
    Minimum,
    /// The mean value by length, then classified.
    Average,
    /// The line integral of the value divided by the unit distance, then classified.
    Add,
    /// Crossings of given values, each a surface.
    First,
}

impl Compositing {
    /// All of them.
    pub const ALL: [Self; 6] = [Self::Over, Self::Maximum, Self::Minimum, Self::Average, Self::Add, Self::First];

    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Over => "over",
            Self::Maximum => "maximum",
            Self::Minimum => "minimum",
            Self::Average => "average",
            Self::Add => "add",
            Self::First => "first",
        }
    }
}

/// A shader's WGSL.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShaderText {
    /// The file that it came from, as messages name it.
    pub file: String,
    /// The text.
    pub text: String,
}

/// A registered shader.
#[derive(Clone, Debug, PartialEq)]
pub struct ShaderEntry {
    /// Name and parameters.
    pub declaration: Declaration,
    /// How its samples are put together.
    pub compositing: Compositing,
    /// Its source; `None` for one that only native code draws.
    pub source: Option<Arc<ShaderText>>,
}

/// A shader that was found but cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RefusedShader {
    /// The file that it came from.
    pub file: String,
    /// Why, with the file's name.
    pub why: String,
}

/// All shaders known, by name. Shared by reference.
#[derive(Clone, Debug, Default)]
pub struct ShaderCatalog {
    known: Arc<BTreeMap<String, Arc<ShaderEntry>>>,
    refused: Arc<BTreeMap<String, RefusedShader>>,
}

impl ShaderCatalog {
    /// Adds a shader; `false` if the name is taken.
    pub fn insert(&mut self, entry: ShaderEntry) -> bool {
        let map = Arc::make_mut(&mut self.known);
        let name = entry.declaration.name.clone();
        if map.contains_key(&name) {
            return false;
        }
        map.insert(name, Arc::new(entry));
        true
    }

    pub(crate) fn remove(&mut self, name: &str) {
        Arc::make_mut(&mut self.known).remove(name);
    }

    /// Remembers why a name cannot be used. A shape that asks for it is refused with these words,
    /// also where another shader has the name.
    pub fn refuse(&mut self, name: &str, refused: RefusedShader) {
        Arc::make_mut(&mut self.refused).insert(name.into(), refused);
    }

    /// Why a name cannot be used.
    pub fn refused(&self, name: &str) -> Option<&RefusedShader> {
        self.refused.get(name)
    }

    /// All that cannot be used, by name.
    pub fn all_refused(&self) -> impl Iterator<Item = (&str, &RefusedShader)> {
        self.refused.iter().map(|(name, refused)| (name.as_str(), refused))
    }

    /// The shader of that name.
    pub fn get(&self, name: &str) -> Option<&Arc<ShaderEntry>> {
        self.known.get(name)
    }

    /// All shaders in order of their names.
    pub fn iter(&self) -> impl Iterator<Item = &Arc<ShaderEntry>> {
        self.known.values()
    }

    /// Whether any shader declares a parameter of that name.
    pub fn declares(&self, parameter: &str) -> bool {
        self.iter().any(|s| s.declaration.parameter(parameter).is_some())
    }

    /// For a name that the shader at hand does not declare: the nearest one that it does, else
    /// the nearest of any shader.
    pub fn nearest_parameter(&self, shader: &ShaderEntry, name: &str) -> Option<String> {
        let names = |s: &ShaderEntry| s.declaration.parameters.iter().map(|p| p.name.clone()).collect::<Vec<_>>();
        let own = names(shader);
        let all: Vec<_> = self.iter().flat_map(|s| names(s)).collect();
        let find = |known: &[String]| crate::names::nearest(name, known.iter().map(String::as_str)).map(str::to_owned);
        find(&own).or_else(|| find(&all))
    }
}

/// Several problems on one line.
pub(crate) fn join(problems: &[ParameterProblem]) -> String {
    problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

/// The shaders whose meaning this crate defines.
pub fn builtin() -> Vec<ShaderEntry> {
    let version = env!("CARGO_PKG_VERSION");
    let volume = || ParameterDecl::new("volume", ParameterType::Volume, "the data").required();
    let table = |text| ParameterDecl::new("lookup_table", ParameterType::Table, text);
    let unit = || {
        ParameterDecl::new(
            "unit_distance",
            ParameterType::Float,
            "the world length over which opacity is the fraction absorbed; \
             the smallest voxel spacing unless given when the shape is built",
        )
        .bounds(f64::MIN_POSITIVE, f64::MAX)
        .unit("world units")
        .required()
    };
    let component = || {
        ParameterDecl::new("component", ParameterType::Int, "the component of the volume that is read")
            .default(0i64)
            .bounds(0.0, 3.0)
    };
    let entry = |name: &str, compositing, text: &str, parameters: Vec<ParameterDecl>| ShaderEntry {
        declaration: Declaration { parameters, ..Declaration::new(Kind::Shader, name, version, text) },
        compositing,
        source: None,
    };
    let grey = "from value to colour and opacity; by default an opaque grey ramp over the volume's range";
    let flat =
        |name: &str, compositing, text: &str| entry(name, compositing, text, vec![volume(), table(grey), component()]);
    vec![
        entry("simple", Compositing::Over, "the volume's own components as colour and opacity", vec![volume(), unit()]),
        entry(
            "lut",
            Compositing::Over,
            "a lookup table, emission and absorption",
            vec![volume(), table("from value to colour and opacity").required(), unit(), component()],
        ),
        flat("mip", Compositing::Maximum, "the highest value along the ray, classified"),
        flat("minip", Compositing::Minimum, "the lowest value along the ray, classified"),
        flat("average", Compositing::Average, "the mean value along the ray, classified"),
        entry(
            "xray",
            Compositing::Add,
            "the line integral of the value divided by the unit distance, classified",
            vec![volume(), table(grey), unit(), component()],
        ),
        entry(
            "attribute",
            Compositing::Over,
            "per-vertex numbers of a mesh through a lookup table, emission and absorption",
            vec![
                ParameterDecl::new("scalars", ParameterType::Attribute, "the numbers that are classified").required(),
                ParameterDecl::new(
                    "opacity_scalars",
                    ParameterType::Attribute,
                    "the numbers whose classification gives the opacity; by default the scalars, too",
                ),
                table("from value to colour and opacity").required(),
                ParameterDecl::new(
                    "opacity_table",
                    ParameterType::Table,
                    "the table that gives the opacity; by default the lookup table",
                ),
                unit(),
                ParameterDecl::new("component", ParameterType::Int, "the component of the scalars that is read")
                    .default(0i64)
                    .bounds(0.0, 255.0),
            ],
        ),
        entry(
            "surface",
            Compositing::First,
            "opaque triangles, lit from both sides: color × (ambient + (1 − ambient)·|normal·light|)",
            vec![
                ParameterDecl::new("color", ParameterType::Color, "the colour; surfaces are opaque")
                    .default(ParameterValue::Color([0.8, 0.8, 0.8, 1.0])),
                ParameterDecl::new(
                    "lightdir",
                    ParameterType::Vec3,
                    "the direction to the light in world space; by default the light is at the eye",
                ),
                ParameterDecl::new("ambient", ParameterType::Float, "the part of the light that comes from everywhere")
                    .default(0.2)
                    .bounds(0.0, 1.0),
            ],
        ),
    ]
}
