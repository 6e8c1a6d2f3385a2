//! Parameters: named, typed values, and the declarations that say which are expected.

use std::{collections::BTreeMap, fmt};

use glam::{DMat4, DVec2, DVec3, DVec4};

use crate::{Attribute, LookupTable, Volume, VolumeTexture};

/// The kinds of value that a parameter can take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ParameterType {
    /// A volume texture.
    Volume,
    /// A lookup table.
    Table,
    /// A real number.
    Float,
    /// A whole number.
    Int,
    /// True or false.
    Bool,
    /// Two real numbers.
    Vec2,
    /// Three real numbers.
    Vec3,
    /// Four real numbers.
    Vec4,
    /// Straight red, green, blue and opacity.
    Color,
    /// A 4×4 matrix.
    Matrix,
    /// One of the declared words.
    Choice,
    /// One value for each vertex of the geometry.
    Attribute,
}

impl ParameterType {
    /// The name as documents write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Volume => "volume",
            Self::Table => "lookup table",
            Self::Float => "float",
            Self::Int => "int",
            Self::Bool => "bool",
            Self::Vec2 => "vec2",
            Self::Vec3 => "vec3",
            Self::Vec4 => "vec4",
            Self::Color => "color",
            Self::Matrix => "matrix",
            Self::Choice => "choice",
            Self::Attribute => "attribute",
        }
    }
}

impl fmt::Display for ParameterType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The value of a parameter. Cheap to clone.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
#[expect(missing_docs, reason = "see ParameterType")]
pub enum ParameterValue {
    Volume(VolumeTexture),
    Table(LookupTable),
    Float(f64),
    Int(i64),
    Bool(bool),
    Vec2(DVec2),
    Vec3(DVec3),
    Vec4(DVec4),
    Color([f64; 4]),
    Matrix(DMat4),
    Choice(String),
    Attribute(Attribute),
}

impl ParameterValue {
    /// The type of the value.
    pub fn kind(&self) -> ParameterType {
        match self {
            Self::Volume(_) => ParameterType::Volume,
            Self::Table(_) => ParameterType::Table,
            Self::Float(_) => ParameterType::Float,
            Self::Int(_) => ParameterType::Int,
            Self::Bool(_) => ParameterType::Bool,
            Self::Vec2(_) => ParameterType::Vec2,
            Self::Vec3(_) => ParameterType::Vec3,
            Self::Vec4(_) => ParameterType::Vec4,
            Self::Color(_) => ParameterType::Color,
            Self::Matrix(_) => ParameterType::Matrix,
            Self::Choice(_) => ParameterType::Choice,
            Self::Attribute(_) => ParameterType::Attribute,
        }
    }

    /// What changes when the value's content does: the data's version for volumes, the content's
    /// identity for tables.
    pub fn content_version(&self) -> u64 {
        match self {
            Self::Volume(texture) => texture.volume().version(),
            Self::Table(table) => table.id(),
            _ => 0,
        }
    }

    /// The value as a real number, where it is one (a whole number counts).
    pub fn as_float(&self) -> Option<f64> {
        match self {
            Self::Float(v) => Some(*v),
            Self::Int(v) => Some(*v as f64),
            _ => None,
        }
    }
}

impl fmt::Display for ParameterValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Volume(v) => write!(f, "volume {:?}", v.volume().name()),
            Self::Table(t) => write!(f, "table of {} entries", t.len()),
            Self::Float(v) => write!(f, "{v:?}"),
            Self::Int(v) => write!(f, "{v}"),
            Self::Bool(v) => write!(f, "{v}"),
            Self::Vec2(v) => write!(f, "{v}"),
            Self::Vec3(v) => write!(f, "{v}"),
            Self::Vec4(v) => write!(f, "{v}"),
            Self::Color(v) => write!(f, "{v:?}"),
            Self::Matrix(v) => write!(f, "{v}"),
            Self::Choice(v) => write!(f, "{v:?}"),
            Self::Attribute(v) => write!(f, "attribute {:?}", v.name),
        }
    }
}

macro_rules! from {
    ($($t:ty => $variant:ident),* $(,)?) => {
        $(impl From<$t> for ParameterValue {
            fn from(value: $t) -> Self {
                Self::$variant(value.into())
            }
        })*
    };
}
from!(VolumeTexture => Volume, &Volume => Volume, LookupTable => Table, f64 => Float, f32 => Float,
    i64 => Int, i32 => Int, bool => Bool, DVec2 => Vec2, DVec3 => Vec3, DVec4 => Vec4, DMat4 => Matrix,
    String => Choice, &str => Choice, Attribute => Attribute);

/// Parameters by name.
pub type ParameterMap = BTreeMap<String, ParameterValue>;

/// One parameter that somebody expects.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterDecl {
    /// The name.
    pub name: String,
    /// The types accepted. `Float` also accepts an `Int`.
    pub types: Vec<ParameterType>,
    /// Whether there must be one.
    pub required: bool,
    /// What stands in where it is left out; bit-identical to leaving it out.
    pub default: Option<ParameterValue>,
    /// Lowest and highest number allowed, ends included.
    pub bounds: Option<[f64; 2]>,
    /// The words allowed for a choice.
    pub choices: Vec<String>,
    /// The unit of a number, e.g. `world units`.
    pub unit: String,
    /// One line that says what it does.
    pub description: String,
}

impl ParameterDecl {
    /// An optional parameter of one type.
    pub fn new(name: &str, kind: ParameterType, description: &str) -> Self {
        Self {
            name: name.into(),
            types: vec![kind],
            required: false,
            default: None,
            bounds: None,
            choices: Vec::new(),
            unit: String::new(),
            description: description.into(),
        }
    }

    /// Must be given.
    pub fn required(mut self) -> Self {
        self.required = true;
        self
    }

    /// Accepts another type, too.
    pub fn or(mut self, kind: ParameterType) -> Self {
        self.types.push(kind);
        self
    }

    /// Sets the default.
    pub fn default(mut self, value: impl Into<ParameterValue>) -> Self {
        self.default = Some(value.into());
        self
    }

    /// Sets the bounds, ends included.
    pub fn bounds(mut self, lowest: f64, highest: f64) -> Self {
        self.bounds = Some([lowest, highest]);
        self
    }

    /// Sets the words of a choice.
    pub fn choices(mut self, words: &[&str]) -> Self {
        self.choices = words.iter().map(|w| (*w).to_owned()).collect();
        self
    }

    /// Sets the unit.
    pub fn unit(mut self, unit: &str) -> Self {
        self.unit = unit.into();
        self
    }

    /// Checks a value against type, bounds and choices, and converts an int where a float is
    /// wanted.
    pub fn accept(&self, value: &ParameterValue) -> Result<ParameterValue, ParameterProblem> {
        let value = match value {
            ParameterValue::Int(v) if !self.takes(ParameterType::Int) && self.takes(ParameterType::Float) => {
                ParameterValue::Float(*v as f64)
            }
            other => other.clone(),
        };
        let problem = |wanted| ParameterProblem {
            name: self.name.clone(),
            kind: ProblemKind::Mistyped { found: format!("{} {value}", value.kind()), wanted },
        };
        if !self.takes(value.kind()) {
            let types: Vec<_> = self.types.iter().map(|t| t.name()).collect();
            return Err(problem(types.join(" or ")));
        }
        if let (Some([lo, hi]), Some(v)) = (self.bounds, value.as_float())
            && !(lo <= v && v <= hi)
        {
            return Err(problem(range(lo, hi)));
        }
        if let ParameterValue::Choice(word) = &value
            && !self.choices.is_empty()
            && !self.choices.contains(word)
        {
            let hint = crate::names::hint(word, self.choices.iter().map(String::as_str));
            return Err(problem(format!("one of {}{hint}", self.choices.join(", "))));
        }
        Ok(value)
    }

    fn takes(&self, kind: ParameterType) -> bool {
        self.types.contains(&kind)
    }
}

/// Bounds in words: the smallest and largest numbers stand for none.
pub fn range(lo: f64, hi: f64) -> String {
    match (lo == f64::MIN_POSITIVE, hi == f64::MAX) {
        (true, true) => "a number above 0".to_owned(),
        (true, false) => format!("above 0 and at most {hi}"),
        (false, true) => format!("at least {lo}"),
        (false, false) => format!("{lo} to {hi}"),
    }
}

/// What is wrong with a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterProblem {
    /// The parameter's name.
    pub name: String,
    /// What is wrong.
    pub kind: ProblemKind,
}

/// The ways in which a parameter can be wrong.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ProblemKind {
    /// Required and left out.
    Missing {
        /// The types wanted.
        wanted: String,
    },
    /// Of another type, or out of bounds.
    Mistyped {
        /// What was found.
        found: String,
        /// What was wanted.
        wanted: String,
    },
    /// Nobody declares it.
    Unknown {
        /// The nearest declared name.
        nearest: Option<String>,
    },
}

impl fmt::Display for ParameterProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.kind {
            ProblemKind::Missing { wanted } => write!(f, "parameter {:?} is missing, wanted {wanted}", self.name),
            ProblemKind::Mistyped { found, wanted } => {
                write!(f, "parameter {:?} is {found}, wanted {wanted}", self.name)
            }
            ProblemKind::Unknown { nearest } => {
                write!(f, "parameter {:?} is declared by nobody", self.name)?;
                nearest.as_ref().map_or(Ok(()), |n| write!(f, "; did you mean {n:?}?"))
            }
        }
    }
}

/// What kind of thing a registration is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[expect(missing_docs, reason = "the names say it")]
pub enum Kind {
    Action,
    Shader,
    Geometry,
    Loader,
}

impl Kind {
    /// The word for it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Action => "action",
            Self::Shader => "shader",
            Self::Geometry => "geometry",
            Self::Loader => "loader",
        }
    }
}

/// What a registration says of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Declaration {
    /// What it is.
    pub kind: Kind,
    /// The name under which it is found.
    pub name: String,
    /// Its version.
    pub version: String,
    /// One line that says what it does.
    pub description: String,
    /// The parameters it expects.
    pub parameters: Vec<ParameterDecl>,
}

impl Declaration {
    /// A declaration without parameters.
    pub fn new(kind: Kind, name: &str, version: &str, description: &str) -> Self {
        let (name, version, description) = (name.into(), version.into(), description.into());
        Self { kind, name, version, description, parameters: Vec::new() }
    }

    /// Adds a parameter.
    pub fn with(mut self, parameter: ParameterDecl) -> Self {
        self.parameters.push(parameter);
        self
    }

    /// The parameter of that name.
    pub fn parameter(&self, name: &str) -> Option<&ParameterDecl> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// Checks given values, fills in defaults, and returns all problems at once. A name that is
    /// not declared here is a problem unless `elsewhere` knows it; such are left out.
    pub fn resolve(
        &self,
        given: &ParameterMap,
        elsewhere: impl Fn(&str) -> bool,
    ) -> Result<ParameterMap, Vec<ParameterProblem>> {
        let mut resolved = ParameterMap::new();
        let mut problems = Vec::new();
        for decl in &self.parameters {
            match given.get(&decl.name).map(|v| decl.accept(v)) {
                Some(Ok(value)) => _ = resolved.insert(decl.name.clone(), value),
                Some(Err(problem)) => problems.push(problem),
                None => match &decl.default {
                    Some(value) => _ = resolved.insert(decl.name.clone(), value.clone()),
                    None if decl.required => {
                        let types: Vec<_> = decl.types.iter().map(|t| t.name()).collect();
                        let kind = ProblemKind::Missing { wanted: types.join(" or ") };
                        problems.push(ParameterProblem { name: decl.name.clone(), kind });
                    }
                    None => {}
                },
            }
        }
        for name in given.keys().filter(|n| self.parameter(n).is_none() && !elsewhere(n)) {
            let known = self.parameters.iter().map(|p| p.name.as_str());
            let nearest = crate::names::nearest(name, known).map(str::to_owned);
            problems.push(ParameterProblem { name: name.clone(), kind: ProblemKind::Unknown { nearest } });
        }
        if problems.is_empty() { Ok(resolved) } else { Err(problems) }
    }
}
