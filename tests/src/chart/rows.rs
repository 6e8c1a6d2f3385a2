//! The file to which points are appended as they are measured, a JSON a line, so that a run goes on where
//! it was interrupted.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Write as _},
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Point;

/// A line: a point, or why there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Row {
    /// What was measured.
    Point(Box<Point>),
    /// What was not.
    LeftOut {
        /// What it would be a measurement of.
        key: String,
        /// Action, settings, reason.
        what: [String; 3],
    },
}

impl Row {
    /// What it is about.
    pub fn key(&self) -> &str {
        match self {
            Self::Point(point) => &point.key,
            Self::LeftOut { key, .. } => key,
        }
    }
}

/// Why rows cannot be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RowsError {
    /// The file.
    #[error("{}: rows cannot be read or appended", path.display())]
    File {
        /// The path.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A line that is whole, and no row.
    #[error("{}, line {line}: no row of a chart; remove the file to measure anew", path.display())]
    Line {
        /// The path.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// Why.
        source: serde_json::Error,
    },
}

/// The rows of a run.
#[derive(Debug)]
pub struct Rows {
    path: PathBuf,
    file: File,
    /// Those that are there.
    pub rows: Vec<Row>,
}

impl Rows {
    /// Opens a file, with what an earlier run left. A last line that is cut off is taken away.
    ///
    /// # Errors
    /// If it cannot be read or written, or holds something else.
    pub fn open(path: &Path) -> Result<Self, RowsError> {
        let failed = |source| RowsError::File { path: path.into(), source };
        let text = match fs::read(path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(failed(error)),
        };
        let whole = text.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1);
        let mut rows = Vec::new();
        for (i, line) in text[..whole].split(|b| *b == b'\n').enumerate().filter(|(_, line)| !line.is_empty()) {
            let read = serde_json::from_slice(line);
            rows.push(read.map_err(|source| RowsError::Line { path: path.into(), line: i + 1, source })?);
        }
        let file = OpenOptions::new().create(true).append(true).open(path).map_err(failed)?;
        file.set_len(whole as u64).map_err(failed)?;
        Ok(Self { path: path.into(), file, rows })
    }

    /// Whether there is a row about this.
    pub fn has(&self, key: &str) -> bool {
        self.rows.iter().any(|row| row.key() == key)
    }

    /// Appends a row.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, row: Row) -> Result<(), RowsError> {
        let failed = |source: io::Error| RowsError::File { path: self.path.clone(), source };
        let mut line = serde_json::to_vec(&row).map_err(|e| failed(e.into()))?;
        line.push(b'\n');
        self.file.write_all(&line).and_then(|()| self.file.flush()).map_err(failed)?;
        self.rows.push(row);
        Ok(())
    }

    /// Takes the file away: all is measured.
    pub fn finish(self) {
        // One that stays is read again, and has all rows.
        _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_cut_off_is_forgotten_and_the_rest_is_there() {
        let path = std::env::temp_dir().join(format!("volact-rows-{}.jsonl", std::process::id()));
        let row = |key: &str| Row::Point(Box::new(Point { key: key.into(), rmse: Some(1e-7), ..Point::default() }));
        let mut rows = Rows::open(&path).unwrap();
        rows.add(row("a")).unwrap();
        rows.add(Row::LeftOut { key: "b".into(), what: ["x".into(), "y".into(), "z".into()] }).unwrap();
        drop(rows);
        let mut bytes = fs::read(&path).unwrap();
        let whole = bytes.len();
        bytes.extend(b"{\"point\":{\"key\":\"c");
        fs::write(&path, &bytes).unwrap();
        let mut rows = Rows::open(&path).unwrap();
        assert!(rows.has("a") && rows.has("b") && !rows.has("c") && rows.rows[0] == row("a"));
        assert_eq!(fs::metadata(&path).unwrap().len() as usize, whole);
        rows.add(row("c")).unwrap();
        assert_eq!(Rows::open(&path).unwrap().rows.len(), 3);
        fs::write(&path, "{}\n").unwrap();
        let message = Rows::open(&path).unwrap_err().to_string();
        assert!(message.contains("line 1"), "{message}");
        rows.finish();
        assert!(!path.exists());
    }
}
