//! Values in text headers: numbers, lists, and what is wrong with them.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
};

use volact_core::LoadError;

use crate::{
    format::beside,
    payload::{Encoding, Part, Payload},
    series,
    storage::Storage,
};

/// More files or entries than anybody means.
const MOST_FILES: u64 = 1 << 20;

/// A whole text field as a value.
pub(crate) fn value<T: FromStr>(path: &Path, field: &str, text: &str, wanted: &str) -> Result<T, LoadError> {
    text.trim().parse().map_err(|_| LoadError::invalid(path, field, format!("{text:?}"), wanted))
}

/// Values separated by white space.
pub(crate) fn values<T: FromStr>(path: &Path, field: &str, text: &str, wanted: &str) -> Result<Vec<T>, LoadError> {
    text.split_whitespace().map(|word| value(path, field, word, wanted)).collect()
}

/// Exactly `N` values separated by white space.
pub(crate) fn array<T: FromStr, const N: usize>(
    path: &Path,
    field: &str,
    text: &str,
    wanted: &str,
) -> Result<[T; N], LoadError> {
    let list = values(path, field, text, wanted)?;
    list.try_into().map_err(|_| LoadError::invalid(path, field, format!("{text:?}"), wanted))
}

/// Two or three dimensions, the third 1 if left out, none zero and none beyond 2^31.
pub(crate) fn dimensions(path: &Path, field: &str, sizes: &[u64]) -> Result<[usize; 3], LoadError> {
    let bad = |wanted: &str| Err(LoadError::invalid(path, field, format!("{sizes:?}"), wanted));
    if !(1..=3).contains(&sizes.len()) {
        return bad("one to three sizes");
    }
    if sizes.iter().any(|n| !(1..=1 << 31).contains(n)) {
        return bad("sizes from 1 to 2147483648");
    }
    let total = sizes.iter().try_fold(1u64, |n, s| n.checked_mul(*s));
    if total.is_none_or(|n| n > 1 << 56) {
        return bad("a grid that memory can hold");
    }
    Ok(std::array::from_fn(|a| sizes.get(a).map_or(1, |n| *n as usize)))
}

/// The data files that a header names.
pub(crate) enum Files {
    /// One file.
    One(PathBuf),
    /// Several that hold equal shares.
    Many(Vec<PathBuf>),
}

impl Files {
    /// `name`, or `pattern first last step [dimension]`, all beside the header.
    pub(crate) fn parse(path: &Path, field: &str, text: &str) -> Result<Self, LoadError> {
        let words: Vec<_> = text.split_whitespace().collect();
        let pattern = words.first().copied().unwrap_or_default();
        if !(4..=5).contains(&words.len()) || !pattern.contains('%') {
            return Ok(Self::One(beside(path, text.trim())));
        }
        let number = |word| value::<i64>(path, field, word, "a pattern, the first number, the last and the step");
        Self::numbered(path, field, pattern, [number(words[1])?, number(words[2])?, number(words[3])?])
    }

    /// The files of a pattern from the first number to the last in steps.
    pub(crate) fn numbered(
        path: &Path,
        field: &str,
        pattern: &str,
        [first, last, step]: [i64; 3],
    ) -> Result<Self, LoadError> {
        let bad = || {
            let found = format!("\"{pattern} {first} {last} {step}\"");
            LoadError::invalid(path, field, found, "a pattern with one %d, the first number, the last and the step")
        };
        if step == 0 || (first != last && (last < first) != (step < 0)) {
            return Err(bad());
        }
        let count = first.abs_diff(last) / step.unsigned_abs() + 1;
        if count > MOST_FILES {
            return Err(LoadError::invalid(path, field, format!("{count} files"), "at most 1048576"));
        }
        let expand = |n| series::expand(pattern, n).map(|name| beside(path, &name)).ok_or_else(bad);
        (0..count as i64).map(|n| expand(first + n * step)).collect::<Result<_, _>>().map(Self::Many)
    }

    /// Files from the lines after a `LIST`.
    pub(crate) fn list(path: &Path, field: &str, names: &[String]) -> Result<Self, LoadError> {
        if names.is_empty() || names.len() as u64 > MOST_FILES {
            return Err(LoadError::invalid(path, field, format!("a list of {}", names.len()), "1 to 1048576 files"));
        }
        Ok(Self::Many(names.iter().map(|name| beside(path, name)).collect()))
    }
}

/// Where in each data file the voxels begin.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Begin {
    /// After so many lines, then so many bytes (of decoded data, where it is encoded).
    After { lines: u64, bytes: u64 },
    /// At the end: the voxels are the last bytes of the file.
    End,
}

/// Builds the payload of `total` bytes that lies in `files`.
pub(crate) fn payload(
    storage: &Storage,
    header: &Path,
    files: Files,
    total: u64,
    begin: Begin,
    encoding: Encoding,
    order: crate::payload::ByteOrder,
) -> Result<Payload, LoadError> {
    let paths = match files {
        Files::One(path) => vec![path],
        Files::Many(paths) => paths,
    };
    let count = paths.len() as u64;
    if !total.is_multiple_of(count) {
        let found = format!("{count} files");
        return Err(LoadError::invalid(header, "data files", found, format!("equal shares of {total} bytes")));
    }
    let part = |path| part(storage, path, 0, total / count, begin, encoding);
    let parts = paths.into_iter().map(part).collect::<Result<_, _>>()?;
    Ok(Payload { storage: storage.clone(), parts, encoding, order, open_ended: false, significant: None })
}

/// The part of a payload that a file holds from byte `from` on.
pub(crate) fn part(
    storage: &Storage,
    path: PathBuf,
    from: u64,
    length: u64,
    begin: Begin,
    encoding: Encoding,
) -> Result<Part, LoadError> {
    let size = storage.length(&path)?;
    let (start, skip) = match begin {
        Begin::End => (size.saturating_sub(length).max(from), 0),
        Begin::After { lines: 0, bytes } if encoding == Encoding::Raw => (from.saturating_add(bytes), 0),
        Begin::After { lines: 0, bytes } => (from, bytes),
        Begin::After { lines, bytes } => {
            let mut reader = storage.lines(&path)?;
            reader.seek(from)?;
            for n in 0..lines {
                if reader.line()?.is_none() {
                    return Err(LoadError::invalid(
                        &path,
                        "lines to skip",
                        lines,
                        format!("at most the {n} there are"),
                    ));
                }
            }
            let raw = encoding == Encoding::Raw;
            (reader.offset().saturating_add(if raw { bytes } else { 0 }), if raw { 0 } else { bytes })
        }
    };
    Ok(Part { encoded: size.saturating_sub(start), path, start, skip, length })
}
