//! The parts of legacy VTK files: words, arrays, fields and what is passed over.

use std::path::Path;

use volact_core::{LoadError, ScalarType};

use crate::{
    numbers::{NumberType, Numbers},
    payload::ByteOrder,
    text::Scanner,
};

/// The numbers of an array, readable or not.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kind {
    pub(crate) number: Option<NumberType>,
    pub(crate) bits: u64,
}

/// The type of that name.
pub(crate) fn kind(path: &Path, text: &str) -> Result<Kind, LoadError> {
    use NumberType::{I64, Scalar, U64};
    let (number, bits) = match text.to_lowercase().as_str() {
        "unsigned_char" | "vtktypeuint8" => (Some(Scalar(ScalarType::U8)), 8),
        "char" | "signed_char" | "vtktypeint8" => (Some(Scalar(ScalarType::I8)), 8),
        "unsigned_short" | "vtktypeuint16" => (Some(Scalar(ScalarType::U16)), 16),
        "short" | "vtktypeint16" => (Some(Scalar(ScalarType::I16)), 16),
        "unsigned_int" | "vtktypeuint32" => (Some(Scalar(ScalarType::U32)), 32),
        // Identifiers are written as if they were of 32 bits.
        "int" | "vtktypeint32" | "vtkidtype" => (Some(Scalar(ScalarType::I32)), 32),
        "float" => (Some(Scalar(ScalarType::F32)), 32),
        "double" => (Some(Scalar(ScalarType::F64)), 64),
        "long" | "vtktypeint64" => (Some(I64), 64),
        "unsigned_long" | "vtktypeuint64" => (Some(U64), 64),
        "bit" => (None, 1),
        _ => return Err(LoadError::invalid(path, "data type", format!("{text:?}"), "a type of VTK, e.g. float")),
    };
    Ok(Kind { number, bits })
}

/// The dataset that a head names, in upper case; `None` if it is no legacy VTK file or names none.
pub(crate) fn dataset(head: &[u8]) -> Option<String> {
    if !head.starts_with(b"# vtk DataFile") {
        return None;
    }
    let mut lines = head.split(|b| *b == b'\n').skip(2).filter(|line| !line.trim_ascii().is_empty());
    let line = String::from_utf8_lossy(lines.nth(1)?).to_uppercase();
    let mut words = line.split_whitespace();
    (words.next() == Some("DATASET")).then(|| words.next().map(str::to_owned)).flatten()
}

/// `Nodal%20Stress` is `Nodal Stress`.
pub(crate) fn unescape(name: &str) -> String {
    let bytes = name.as_bytes();
    let mut out = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let hex = if bytes[at] == b'%' { name.get(at + 1..at + 3) } else { None };
        match hex.and_then(|hex| u8::from_str_radix(hex, 16).ok()) {
            Some(code) => {
                out.push(code);
                at += 3;
            }
            None => {
                out.push(bytes[at]);
                at += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

/// A walk through a legacy file.
pub(crate) struct Legacy<'a> {
    pub(crate) scan: Scanner<'a>,
    pub(crate) ascii: bool,
}

impl<'a> Legacy<'a> {
    /// Reads the three lines of a head.
    pub(crate) fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self, LoadError> {
        let mut scan = Scanner::new(path, bytes);
        let magic = scan.line().unwrap_or_default();
        let version = magic.strip_prefix("# vtk DataFile Version ");
        let version = version.and_then(|v| v.trim().split('.').next()?.parse().ok());
        if !matches!(version, Some(1u32..=5)) {
            let found = format!("{:?}", magic.chars().take(40).collect::<String>());
            return Err(LoadError::invalid(path, "first line", found, "# vtk DataFile Version 1.0 to 5.x"));
        }
        scan.line();
        let coding = scan.filled_line().unwrap_or_default();
        let ascii = match coding.trim().to_uppercase().as_str() {
            "ASCII" => true,
            "BINARY" => false,
            _ => {
                let found: String = coding.chars().take(40).collect();
                return Err(LoadError::invalid(path, "coding", format!("{found:?}"), "ASCII or BINARY"));
            }
        };
        Ok(Self { scan, ascii })
    }

    pub(crate) fn path(&self) -> &'a Path {
        self.scan.path
    }

    /// The next `count` numbers, which begin in a new line where they are binary.
    pub(crate) fn numbers(&mut self, what: &str, kind: Kind, count: u64) -> Result<Option<Numbers>, LoadError> {
        if self.ascii {
            // Bits are written as numbers, too.
            let number = kind.number.unwrap_or(NumberType::Scalar(ScalarType::U8));
            let numbers = self.scan.numbers(what, number, count)?;
            return Ok(kind.number.map(|_| numbers));
        }
        self.scan.end_line();
        let bytes = self.scan.take(what, count.saturating_mul(kind.bits).div_ceil(8))?;
        Ok(kind.number.map(|number| Numbers::from_bytes(number, bytes.to_vec(), ByteOrder::Big)))
    }

    /// Passes `count` strings.
    pub(crate) fn pass_strings(&mut self, what: &str, count: u64) -> Result<(), LoadError> {
        self.scan.end_line();
        for _ in 0..count {
            if self.ascii {
                if self.scan.line().is_none() {
                    self.scan.take(what, 1)?;
                }
                continue;
            }
            // The two highest bits of the first byte say how many bytes the length has.
            let first = self.scan.take(what, 1)?[0];
            let more = [7, 3, 1, 0][usize::from(first >> 6)];
            let low = self.scan.take(what, more)?.iter().fold(u64::from(first & 63), |n, b| n << 8 | u64::from(*b));
            self.scan.take(what, low)?;
        }
        Ok(())
    }

    /// Metadata go to the next blank line.
    pub(crate) fn pass_metadata(&mut self) {
        self.scan.end_line();
        while self.scan.line().is_some_and(|line| !line.trim().is_empty()) {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unescaped() {
        assert_eq!(unescape("Nodal%20Stress-0"), "Nodal Stress-0");
        assert_eq!(unescape("100%"), "100%");
        assert_eq!(unescape("%c3%bc%zz"), "ü%zz");
    }

    #[test]
    fn dataset_is_found_after_any_title() {
        let head =
            |title: &str| format!("# vtk DataFile Version 5.1\n{title}\nBINARY\n\nDataset unstructured_grid \nx");
        assert_eq!(dataset(head("t").as_bytes()).as_deref(), Some("UNSTRUCTURED_GRID"));
        assert_eq!(dataset(head("").as_bytes()).as_deref(), Some("UNSTRUCTURED_GRID"));
        assert_eq!(dataset(b"# vtk DataFile Version 5.1\n\nASCII\nFIELD a 0\n"), None);
        assert_eq!(dataset(b"DATASET UNSTRUCTURED_GRID"), None);
    }
}
