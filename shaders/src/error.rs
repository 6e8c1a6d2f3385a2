//! What can be wrong with a shader, shown at its place in the author's file.

use std::{
    fmt, io,
    ops::Range,
    path::{Path, PathBuf},
};

use thiserror::Error;
use volact_core::scene::{Problems, SceneError};

/// Why a shader cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ShaderError {
    /// A file or folder cannot be read.
    #[error("{}: cannot be read", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// One of a shader's two files is not there.
    #[error("{}: {} is missing beside it: a shader is a .ron and a .wgsl", there.display(), file_name(missing))]
    Half {
        /// The file that is there.
        there: PathBuf,
        /// The one that is not.
        missing: PathBuf,
    },
    /// The declaration is wrong, or declares what WGSL cannot have.
    #[error(transparent)]
    Declaration(#[from] Problems),
    /// The WGSL is wrong.
    #[error(transparent)]
    Source(#[from] SourceErrors),
    /// The shader has no source.
    #[error("shader {name:?} has no source: only native code draws it")]
    Native {
        /// The shader's name.
        name: String,
    },
}

/// The last part of a path, as text.
fn file_name(path: &Path) -> std::borrow::Cow<'_, str> {
    path.file_name().unwrap_or_default().to_string_lossy()
}

impl From<SceneError> for ShaderError {
    fn from(error: SceneError) -> Self {
        match error {
            SceneError::Io { path, source } => Self::Io { path, source },
            SceneError::Problems(problems) => Self::Declaration(problems),
            other => Self::Io { path: PathBuf::new(), source: io::Error::other(other.to_string()) },
        }
    }
}

/// Everything that is wrong with a WGSL text. Never empty.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceErrors {
    /// The file's name.
    pub file: String,
    /// Its text.
    pub text: String,
    /// What is wrong, in the order of the text.
    pub errors: Vec<SourceError>,
}

/// One thing that is wrong with a WGSL text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceError {
    /// What.
    pub message: String,
    /// Where, as bytes of the text, and what is there. The first place is the one that matters.
    pub places: Vec<(Range<usize>, String)>,
    /// What else helps.
    pub notes: Vec<String>,
}

impl SourceError {
    /// An error at a place.
    pub fn at(range: Range<usize>, message: impl Into<String>) -> Self {
        Self { message: message.into(), places: vec![(range, String::new())], notes: Vec::new() }
    }

    /// An error of the text as a whole.
    pub fn whole(message: impl Into<String>) -> Self {
        Self { message: message.into(), places: Vec::new(), notes: Vec::new() }
    }

    /// Adds what helps.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }
}

impl SourceErrors {
    /// Line and column, both from 1, in characters, of a byte of the text.
    pub fn spot(&self, at: usize) -> (usize, usize) {
        let before = &self.text[..floor(&self.text, at)];
        let line = before.rfind('\n').map_or(0, |i| i + 1);
        (before.matches('\n').count() + 1, before[line..].chars().count() + 1)
    }

    fn show(&self, f: &mut fmt::Formatter<'_>, error: &SourceError) -> fmt::Result {
        match error.places.first() {
            Some((range, _)) => {
                let (line, column) = self.spot(range.start);
                write!(f, "{}:{line}:{column}: {}", self.file, error.message)?;
            }
            None => write!(f, "{}: {}", self.file, error.message)?,
        }
        for (range, label) in &error.places {
            self.snippet(f, range, label)?;
        }
        error.notes.iter().try_for_each(|note| write!(f, "\n  = {note}"))
    }

    /// The line of a place with carets below it.
    fn snippet(&self, f: &mut fmt::Formatter<'_>, range: &Range<usize>, label: &str) -> fmt::Result {
        let (number, column) = self.spot(range.start);
        let line = self.text.lines().nth(number - 1).unwrap_or("");
        // Lines that no screen can hold are shown around their place.
        let from = column.saturating_sub(80);
        let shown: String = line.chars().skip(from).take(160).map(|c| if c.is_control() { ' ' } else { c }).collect();
        let start = floor(&self.text, range.start);
        let here = &self.text[start..floor(&self.text, range.end).max(start)];
        let width = here.lines().next().unwrap_or("").chars().count().clamp(1, 160);
        let (margin, blank) = (number.to_string(), " ".repeat(column - 1 - from));
        let gap = if label.is_empty() { "" } else { " " };
        write!(f, "\n {margin} | {shown}\n {:>1$} | {blank}{2}{gap}{label}", "", margin.len(), "^".repeat(width))
    }
}

/// The beginning of a character at or before a byte.
fn floor(text: &str, at: usize) -> usize {
    text.floor_char_boundary(at.min(text.len()))
}

impl fmt::Display for SourceErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, error) in self.errors.iter().enumerate() {
            if i > 0 {
                writeln!(f)?;
            }
            self.show(f, error)?;
        }
        Ok(())
    }
}

impl std::error::Error for SourceErrors {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_is_shown_with_line_and_caret() {
        let errors = SourceErrors {
            file: "a.wgsl".into(),
            text: "fn f() {\n  é vloume(p);\n}".into(),
            errors: vec![SourceError::at(14..20, "no `vloume`").note("there is `volume`")],
        };
        let expected = "a.wgsl:2:5: no `vloume`\n 2 |   é vloume(p);\n   |     ^^^^^^\n  = there is `volume`";
        assert_eq!(errors.to_string(), expected);
    }

    #[test]
    fn any_place_can_be_shown() {
        let text = "é\n".to_owned();
        for start in 0..6 {
            for end in 0..6 {
                let errors = vec![SourceError::at(start..end, "x")];
                let shown = SourceErrors { file: "f".into(), text: text.clone(), errors }.to_string();
                assert!(shown.starts_with("f:"));
            }
        }
    }
}
