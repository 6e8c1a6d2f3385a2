//! Reads values out of a document's tree and collects every problem on the way.

use std::{collections::BTreeMap, fmt::Display};

use glam::DVec3;

use super::{
    document::{self, Kind, Node},
    lexer::show_text,
    problem::{Problem, Problems, Spot},
};

/// The longest name that a document may give to something.
pub const MAX_NAME: usize = 128;
/// Problems listed of one document; further ones are counted.
const MAX_PROBLEMS: usize = 200;

/// A node with its path in the document.
#[derive(Clone, Debug)]
pub(crate) struct At<'a> {
    pub(crate) node: &'a Node,
    pub(crate) path: String,
}

/// The fields of a struct.
pub(crate) struct Fields<'a> {
    spot: Spot,
    path: String,
    fields: BTreeMap<&'a str, At<'a>>,
}

impl<'a> Fields<'a> {
    /// A field that may be left out; `None` counts as left out.
    pub(crate) fn optional(&self, name: &str) -> Option<At<'a>> {
        self.fields.get(name).cloned()
    }

    /// The path of a field, whether it is there or not.
    fn path(&self, name: &str) -> String {
        join(&self.path, name)
    }
}

/// Collects problems and the places of everything that was looked at.
#[derive(Default)]
pub(crate) struct Reader {
    problems: Vec<Problem>,
    more: usize,
    places: BTreeMap<String, Spot>,
}

/// Reads a text that is one value.
pub(crate) fn one<T>(text: &str, read: fn(&mut Reader, &At) -> Option<T>) -> Result<T, Problems> {
    let root = document::parse(text).map_err(|problem| Problems::new(vec![problem]))?;
    let mut reader = Reader::default();
    let at = reader.root(&root);
    let value = read(&mut reader, &at);
    reader.done()?;
    value.ok_or_else(|| Problems::new(vec![Problem::new(None, "", "nothing", "a value")]))
}

/// The path of a field inside a path.
pub(crate) fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}

impl Reader {
    /// The document itself.
    pub(crate) fn root<'a>(&mut self, node: &'a Node) -> At<'a> {
        self.visit(node, String::new())
    }

    /// All places by path, or all problems.
    pub(crate) fn finish(self) -> (BTreeMap<String, Spot>, Vec<Problem>) {
        let mut problems = self.problems;
        if self.more > 0 {
            problems.push(Problem::new(None, "", format!("{} more problems", self.more), "none"));
        }
        (self.places, problems)
    }

    /// The places, or an error with all problems.
    pub(crate) fn done(self) -> Result<(), Problems> {
        let (_, problems) = self.finish();
        if problems.is_empty() { Ok(()) } else { Err(Problems::new(problems)) }
    }

    /// Adds a problem.
    pub(crate) fn add(&mut self, problem: Problem) {
        if self.problems.len() < MAX_PROBLEMS {
            self.problems.push(problem);
        } else {
            self.more += 1;
        }
    }

    /// Adds a problem with a node: it is not what was wanted.
    pub(crate) fn refuse<T>(&mut self, at: &At, wanted: impl Into<String>) -> Option<T> {
        self.add(Problem::new(Some(at.node.spot), &at.path, at.node.show(), wanted));
        None
    }

    /// Adds a problem with a name, and the nearest known one.
    pub(crate) fn unknown<T>(&mut self, at: &At, name: &str, what: &str, known: &[&str]) -> Option<T> {
        let wanted = format!("{what}{}", known.join(", "));
        let problem = Problem::new(Some(at.node.spot), &at.path, at.node.show(), wanted);
        self.add(problem.near(name, known.iter().copied()));
        None
    }

    fn visit<'a>(&mut self, node: &'a Node, path: String) -> At<'a> {
        self.places.insert(path.clone(), node.spot);
        At { node, path }
    }

    /// Opens a struct that has one of these names or, if `""` is among them, none; only `known`
    /// fields may be in it.
    pub(crate) fn fields<'a>(&mut self, at: &At<'a>, names: &[&str], known: &[&str]) -> Option<Fields<'a>> {
        let mut opened = Fields { spot: at.node.spot, path: at.path.clone(), fields: BTreeMap::new() };
        let wanted = || {
            let name = names.iter().find(|n| !n.is_empty()).map_or(String::new(), |n| format!("`{n}(…)` "));
            format!("a struct {name}with the fields {}", known.join(", "))
        };
        let (name, fields) = match &at.node.kind {
            Kind::Struct { name, fields } => (name, fields.as_slice()),
            // A struct without fields looks like a tuple without items.
            Kind::Tuple { name, items } if items.is_empty() => (name, &[][..]),
            _ => return self.refuse(at, wanted()),
        };
        if !names.contains(&name.as_str()) && !name.is_empty() {
            return self.refuse(at, wanted());
        }
        for (spot, field, value) in fields {
            if !known.contains(&field.as_str()) {
                let problem =
                    Problem::new(Some(*spot), &at.path, format!("field {}", show_name(field)), known.join(", "));
                self.add(problem.near(field, known.iter().copied()));
            } else if opened.fields.contains_key(field.as_str()) {
                self.add(Problem::new(Some(*spot), &opened.path(field), "this field a second time", "it once"));
            } else if let Some(value) = value.present() {
                let at = self.visit(value, opened.path(field));
                opened.fields.insert(field, at);
            }
        }
        Some(opened)
    }

    /// A field that must be there.
    pub(crate) fn required<'a>(&mut self, fields: &Fields<'a>, name: &str, wanted: &str) -> Option<At<'a>> {
        let found = fields.optional(name);
        if found.is_none() {
            self.add(Problem::new(Some(fields.spot), &fields.path(name), "nothing", wanted));
        }
        found
    }

    /// The entries of a map whose keys are strings, with paths below the map's own.
    pub(crate) fn map<'a>(&mut self, at: &At<'a>, wanted: &str) -> Vec<(&'a str, At<'a>)> {
        let Kind::Map(entries) = &at.node.kind else {
            self.refuse::<()>(at, wanted);
            return Vec::new();
        };
        let mut read: BTreeMap<&str, At> = BTreeMap::new();
        for (key, value) in entries {
            let key_at = At { node: key, path: at.path.clone() };
            match &key.kind {
                Kind::Text(name) if name.is_empty() || name.chars().count() > MAX_NAME => {
                    self.refuse::<()>(&key_at, format!("a name of 1 to {MAX_NAME} characters"));
                }
                Kind::Text(name) if read.contains_key(name.as_str()) => {
                    self.refuse::<()>(&key_at, "each name once");
                }
                Kind::Text(name) => {
                    let value = self.visit(value, join(&at.path, name));
                    read.insert(name, value);
                }
                _ => _ = self.refuse::<()>(&key_at, "a name in quotation marks"),
            }
        }
        read.into_iter().collect()
    }

    /// The items of a list.
    pub(crate) fn list<'a>(&mut self, at: &At<'a>, wanted: &str) -> Option<Vec<At<'a>>> {
        let Kind::List(items) = &at.node.kind else { return self.refuse(at, wanted) };
        Some(items.iter().enumerate().map(|(i, item)| self.visit(item, format!("{}[{i}]", at.path))).collect())
    }

    /// The items of a tuple of a name, or without one.
    pub(crate) fn tuple<'a>(&mut self, at: &At<'a>, name: &str) -> Option<Vec<At<'a>>> {
        match &at.node.kind {
            Kind::Tuple { name: n, items } if n == name && !items.is_empty() => {
                Some(items.iter().enumerate().map(|(i, item)| self.visit(item, format!("{}[{i}]", at.path))).collect())
            }
            _ => None,
        }
    }

    /// Any number, not finite ones included, but no NaN.
    pub(crate) fn number(&mut self, at: &At) -> Option<f64> {
        match at.node.kind {
            Kind::Number { value, .. } if !value.is_nan() => Some(value),
            _ => self.refuse(at, "a number"),
        }
    }

    /// A finite number for which `good` holds.
    pub(crate) fn float_where(&mut self, at: &At, good: impl Fn(f64) -> bool, wanted: &str) -> Option<f64> {
        match at.node.kind {
            Kind::Number { value, .. } if value.is_finite() && good(value) => Some(value),
            _ => self.refuse(at, wanted),
        }
    }

    /// A finite number.
    pub(crate) fn float(&mut self, at: &At) -> Option<f64> {
        self.float_where(at, |_| true, "a finite number")
    }

    /// A whole number from `least` on.
    pub(crate) fn count(&mut self, at: &At, least: usize) -> Option<usize> {
        match at.node.kind {
            Kind::Number { whole: Some(v), .. } if usize::try_from(v).is_ok_and(|v| v >= least) => Some(v as usize),
            _ => self.refuse(at, format!("a whole number from {least} on")),
        }
    }

    /// `N` values of one kind in a tuple.
    pub(crate) fn array<T: Copy, const N: usize>(
        &mut self,
        at: &At,
        wanted: &str,
        mut item: impl FnMut(&mut Self, &At) -> Option<T>,
    ) -> Option<[T; N]> {
        let Some(items) = self.tuple(at, "").filter(|items| items.len() == N) else {
            return self.refuse(at, wanted);
        };
        let read: Vec<Option<T>> = items.iter().map(|at| item(self, at)).collect();
        read.into_iter().collect::<Option<Vec<T>>>()?.try_into().ok()
    }

    /// Three finite numbers.
    pub(crate) fn vec3(&mut self, at: &At) -> Option<DVec3> {
        self.array(at, "three numbers (x, y, z)", Self::float).map(DVec3::from_array)
    }

    /// A string.
    pub(crate) fn text<'a>(&mut self, at: &At<'a>) -> Option<&'a str> {
        match &at.node.kind {
            Kind::Text(text) if !text.is_empty() => Some(text),
            _ => self.refuse(at, "a text in quotation marks"),
        }
    }

    /// A string short enough to be a name.
    pub(crate) fn name(&mut self, at: &At) -> Option<String> {
        match &at.node.kind {
            Kind::Text(text) if (1..=MAX_NAME).contains(&text.chars().count()) => Some(text.clone()),
            _ => self.refuse(at, format!("a name of 1 to {MAX_NAME} characters in quotation marks")),
        }
    }

    /// `true` or `false`.
    pub(crate) fn bool(&mut self, at: &At) -> Option<bool> {
        match at.node.kind {
            Kind::Bool(v) => Some(v),
            _ => self.refuse(at, "true or false"),
        }
    }

    /// One of several bare words.
    pub(crate) fn word<T: Copy>(&mut self, at: &At, words: &[(&str, T)]) -> Option<T> {
        let known: Vec<_> = words.iter().map(|(w, _)| *w).collect();
        match &at.node.kind {
            Kind::Tuple { name, items } if items.is_empty() => match words.iter().find(|(w, _)| w == name) {
                Some((_, value)) => Some(*value),
                None => self.unknown(at, name, "one of ", &known),
            },
            _ => self.refuse(at, format!("one of {}", known.join(", "))),
        }
    }

    /// The document's version, which must be the one that this build reads.
    pub(crate) fn version(&mut self, fields: &Fields, current: u32) {
        let wanted = format!("{current}, the version of the format that this build reads");
        if let Some(at) = self.required(fields, "version", &wanted)
            && !matches!(at.node.kind, Kind::Number { whole: Some(v), .. } if v == i64::from(current))
        {
            self.refuse::<()>(&at, wanted);
        }
    }

    /// Takes an error of a check made elsewhere as a problem with a node.
    pub(crate) fn fault(&mut self, at: &At, found: impl Display, wanted: impl Display) {
        self.add(Problem::new(Some(at.node.spot), &at.path, found.to_string(), wanted.to_string()));
    }
}

fn show_name(name: &str) -> String {
    show_text(name).replace('"', "`")
}
