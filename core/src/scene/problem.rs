//! What can be wrong with a document, with its place.

use std::fmt;

use crate::names;

/// Line and column in a text, both from 1; columns count characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Spot {
    /// The line, from 1.
    pub line: u32,
    /// The column in characters, from 1.
    pub column: u32,
}

impl Spot {
    /// The beginning of a text.
    pub const START: Self = Self { line: 1, column: 1 };
}

impl fmt::Display for Spot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.line, self.column)
    }
}

/// One thing that is wrong in a document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// Where in the text; `None` for a description that did not come from a text.
    pub spot: Option<Spot>,
    /// Where in the document, e.g. `shapes[1].parameters.lookup_table.points[3].opacity`; empty
    /// for the document as a whole.
    pub path: String,
    /// What was found.
    pub found: String,
    /// What was wanted.
    pub wanted: String,
    /// For a misspelt name, the nearest that exists.
    pub nearest: Option<String>,
}

impl Problem {
    /// A problem at a place.
    pub fn new(spot: Option<Spot>, path: &str, found: impl Into<String>, wanted: impl Into<String>) -> Self {
        Self { spot, path: path.into(), found: found.into(), wanted: wanted.into(), nearest: None }
    }

    /// Adds the known name nearest to `name`, if one is near.
    pub fn near<'a>(mut self, name: &str, known: impl IntoIterator<Item = &'a str>) -> Self {
        // The distance costs the product of the lengths; no name is that long.
        if name.len() <= 256 {
            self.nearest = names::nearest(name, known).map(str::to_owned);
        }
        self
    }
}

impl std::error::Error for Problem {}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(spot) = self.spot {
            write!(f, "{spot}: ")?;
        }
        if !self.path.is_empty() {
            write!(f, "{}: ", self.path)?;
        }
        write!(f, "found {}, wanted {}", self.found, self.wanted)?;
        self.nearest.as_ref().map_or(Ok(()), |name| write!(f, "; did you mean {name:?}?"))
    }
}

/// Everything that is wrong with a document, in the order of the text. Never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problems {
    /// The document's file name, if it has one.
    pub file: String,
    /// The problems.
    pub problems: Vec<Problem>,
}

impl Problems {
    /// All problems of a document, in the order of its text.
    pub fn new(mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|p| p.spot);
        Self { file: String::new(), problems }
    }

    /// Names the file that the document came from.
    pub fn of_file(mut self, file: impl Into<String>) -> Self {
        self.file = file.into();
        self
    }
}

impl std::error::Error for Problems {}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, problem) in self.problems.iter().enumerate() {
            let end = if i == 0 { "" } else { "\n" };
            let colon = if problem.spot.is_some() { ":" } else { ": " };
            match self.file.as_str() {
                "" => write!(f, "{end}{problem}")?,
                file => write!(f, "{end}{file}{colon}{problem}")?,
            }
        }
        Ok(())
    }
}
