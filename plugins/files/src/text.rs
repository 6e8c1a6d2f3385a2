//! A walk through the bytes of a file that is text, or text and numbers by turns.

use std::path::Path;

use volact_core::LoadError;

use crate::{
    numbers::{NumberType, Numbers, aligned, put_number},
    payload::out_of_memory,
};

/// Where a reader stands in a file's bytes.
pub(crate) struct Scanner<'a> {
    pub(crate) path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Scanner<'a> {
    pub(crate) fn new(path: &'a Path, bytes: &'a [u8]) -> Self {
        Self { path, bytes, at: 0 }
    }

    pub(crate) fn offset(&self) -> usize {
        self.at
    }

    /// The bytes not yet read.
    pub(crate) fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// The rest of the line without its end; `None` at the end of the file.
    pub(crate) fn line(&mut self) -> Option<String> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let end = rest.iter().position(|b| *b == b'\n');
        self.at += end.map_or(rest.len(), |at| at + 1);
        let line = &rest[..end.unwrap_or(rest.len())];
        Some(String::from_utf8_lossy(line.strip_suffix(b"\r").unwrap_or(line)).into_owned())
    }

    /// The next line that is not blank.
    pub(crate) fn filled_line(&mut self) -> Option<String> {
        loop {
            let line = self.line()?;
            if !line.trim().is_empty() {
                return Some(line);
            }
        }
    }

    /// Goes to the next line, unless the reader stands at the start of one.
    pub(crate) fn end_line(&mut self) {
        if self.at > 0 && self.bytes[self.at - 1] != b'\n' {
            self.line();
        }
    }

    /// The next word, up to white space, of which one character is taken; `None` at the end.
    pub(crate) fn word(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest();
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace);
        let end = length.map_or(rest.len(), |n| start + n);
        self.at += (end + 1).min(rest.len());
        Some(&rest[start..end])
    }

    /// The next word, without taking it.
    pub(crate) fn peek(&self) -> Option<&'a [u8]> {
        Self { path: self.path, bytes: self.bytes, at: self.at }.word()
    }

    /// The next `count` bytes, which must be there.
    pub(crate) fn take(&mut self, what: &str, count: u64) -> Result<&'a [u8], LoadError> {
        let rest = self.rest();
        match usize::try_from(count).ok().and_then(|n| rest.get(..n)) {
            Some(taken) => {
                self.at += taken.len();
                Ok(taken)
            }
            None => {
                let (path, what) = (self.path.into(), what.into());
                Err(LoadError::Truncated { path, what, found: rest.len() as u64, wanted: count })
            }
        }
    }

    /// The next `count` numbers, as words.
    pub(crate) fn numbers(&mut self, what: &str, kind: NumberType, count: u64) -> Result<Numbers, LoadError> {
        let bytes = count.saturating_mul(kind.size() as u64);
        // A number is a digit and what separates it from the next.
        let most = (self.rest().len() as u64).div_ceil(2);
        let truncated = |found: u64| LoadError::Truncated {
            path: self.path.into(),
            what: format!("{what}, as text of {most} numbers at most"),
            found: found.saturating_mul(kind.size() as u64),
            wanted: bytes,
        };
        if count > most {
            return Err(truncated(0));
        }
        let mut out = Vec::new();
        out.try_reserve_exact(bytes as usize).map_err(|_| out_of_memory(self.path, bytes as usize))?;
        let path = self.path;
        for n in 0..count {
            let mut probe = Self { path, bytes: self.bytes, at: self.at };
            let Some(word) = probe.word() else { return Err(truncated(n)) };
            let at = probe.at;
            let word = std::str::from_utf8(word).unwrap_or("\u{fffd}");
            if !put_number(word, kind, &mut out) {
                let word: String = word.chars().take(40).collect();
                let wanted = format!("a number of type {}", kind.name());
                return Err(LoadError::invalid(path, format!("number {n} of {what}"), format!("{word:?}"), wanted));
            }
            self.at = at;
        }
        Ok(Numbers { kind, data: aligned(out, kind.size()) })
    }
}
