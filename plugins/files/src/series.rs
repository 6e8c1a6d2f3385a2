//! Numbered files: patterns such as `slice%03d.png`, and folders of them.

use std::path::{Path, PathBuf};

use volact_core::LoadError;

use crate::storage::Storage;

/// Puts a number into a pattern with one `%d`, `%3d` or `%03d`; `%%` is a percent sign. `None` if
/// the pattern is none or the field is wider than 64.
pub(crate) fn expand(pattern: &str, number: i64) -> Option<String> {
    let mut out = String::new();
    let mut rest = pattern;
    let mut done = false;
    while let Some(at) = rest.find('%') {
        out.push_str(&rest[..at]);
        rest = &rest[at + 1..];
        if let Some(after) = rest.strip_prefix('%') {
            out.push('%');
            rest = after;
            continue;
        }
        let end = rest.find(|c: char| !c.is_ascii_digit())?;
        let (digits, kind) = rest.split_at(end);
        let width: usize = if digits.is_empty() { 0 } else { digits.parse().ok()? };
        if done || width > 64 {
            return None;
        }
        rest = kind.strip_prefix(['d', 'i', 'u'])?;
        match digits.starts_with('0') {
            true => out.push_str(&format!("{number:0width$}")),
            false => out.push_str(&format!("{number:width$}")),
        }
        done = true;
    }
    out.push_str(rest);
    done.then_some(out)
}

/// A file name around its last number.
#[derive(Debug, PartialEq, Eq)]
struct Numbered<'a> {
    before: &'a str,
    number: u64,
    after: &'a str,
}

fn split(name: &str) -> Option<Numbered<'_>> {
    let end = name.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = name[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |at| {
        // The character before may take several bytes.
        at + name[at..].chars().next().map_or(1, char::len_utf8)
    });
    let number = name[start..end].parse().ok()?;
    Some(Numbered { before: &name[..start], number, after: &name[end..] })
}

/// The files that `path` stands for, in the order of their numbers.
///
/// - A file stands for itself; with `series`, for all files of its folder whose names differ from
///   its own in their last number only.
/// - A folder stands for its files with one of the `extensions`, which must be one numbered series
///   (a single file needs no number).
/// - A name with `%d` stands for all files that fit it.
///
/// The numbers may begin anywhere and go in any even step; a gap is an error.
pub(crate) fn find(
    storage: &Storage,
    path: &Path,
    extensions: &[&str],
    series: bool,
) -> Result<Vec<PathBuf>, LoadError> {
    let name = file_name(path);
    if storage.is_file(path) {
        if !series {
            return Ok(vec![path.into()]);
        }
        let Some(own) = split(&name) else {
            return Err(LoadError::invalid(path, "file name", format!("{name:?}"), "a number in it, for a series"));
        };
        let folder = path.parent().unwrap_or(Path::new(""));
        let fits = |p: &PathBuf| split(&file_name(p)).is_some_and(|n| n.before == own.before && n.after == own.after);
        return in_order(path, storage.list(folder)?.into_iter().filter(fits).collect());
    }
    if storage.is_dir(path) {
        let fits = |p: &PathBuf| has_extension(p, extensions);
        let found: Vec<_> = storage.list(path)?.into_iter().filter(fits).collect();
        if found.is_empty() {
            let wanted = extensions.join(" or ");
            return Err(LoadError::invalid(path, "folder", "without such files", format!("files ending in {wanted}")));
        }
        return if found.len() == 1 { Ok(found) } else { in_order(path, found) };
    }
    if name.contains('%') {
        let folder = path.parent().unwrap_or(Path::new(""));
        let fits = |p: &PathBuf| {
            let file = file_name(p);
            split(&file).is_some_and(|n| {
                i64::try_from(n.number).is_ok_and(|number| expand(&name, number).as_deref() == Some(&file))
            })
        };
        let found: Vec<_> = storage.list(folder)?.into_iter().filter(fits).collect();
        if found.is_empty() {
            return Err(LoadError::invalid(path, "pattern", format!("{name:?}"), "at least one file that fits it"));
        }
        return in_order(path, found);
    }
    storage.length(path).map(|_| vec![path.into()])
}

pub(crate) fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let name = file_name(path).to_lowercase();
    extensions.iter().any(|e| name.ends_with(e))
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

fn in_order(path: &Path, files: Vec<PathBuf>) -> Result<Vec<PathBuf>, LoadError> {
    let mut numbered: Vec<(u64, PathBuf)> = Vec::with_capacity(files.len());
    let mut first: Option<(String, String)> = None;
    for file in files {
        let name = file_name(&file);
        let wanted = "one series of names that differ in their last number only";
        let Some(parts) = split(&name) else {
            return Err(LoadError::invalid(path, "series", format!("{name:?}, without a number"), wanted));
        };
        let own = (parts.before.to_owned(), parts.after.to_owned());
        if let Some((before, after)) = first.as_ref().filter(|f| **f != own) {
            let found = format!("{name:?} beside {before:?} number {after:?}");
            return Err(LoadError::invalid(path, "series", found, wanted));
        }
        numbered.push((parts.number, file));
        first = Some(own);
    }
    numbered.sort();
    let steps: Vec<_> = numbered.windows(2).map(|w| (w[0].0, w[1].0)).collect();
    let step = steps.iter().map(|(a, b)| b - a).min().unwrap_or(1);
    if let Some((a, b)) = steps.iter().find(|(a, b)| b - a != step || step == 0) {
        let found = format!("{a} followed by {b}");
        return Err(LoadError::invalid(
            path,
            "series",
            found,
            format!("numbers in even steps, here of {}", step.max(1)),
        ));
    }
    Ok(numbered.into_iter().map(|(_, file)| file).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pattern_takes_one_number() {
        assert_eq!(expand("quarter.%d", 93).as_deref(), Some("quarter.93"));
        assert_eq!(expand("a%03d.png", 7).as_deref(), Some("a007.png"));
        assert_eq!(expand("100%%_%2d", 7).as_deref(), Some("100%_ 7"));
        for bad in ["plain", "%d%d", "%s", "%", "%99999999d", "%65d", "%.3d"] {
            assert_eq!(expand(bad, 1), None, "{bad}");
        }
    }

    fn found(names: &[&str], path: &str, series: bool) -> Result<Vec<String>, String> {
        let storage = Storage::memory(names.iter().map(|n| (format!("dir/{n}"), vec![0u8])));
        find(&storage, Path::new(path), &[".png"], series)
            .map(|files| files.iter().map(|f| file_name(f)).collect())
            .map_err(|e| e.to_string())
    }

    #[test]
    fn series_is_sorted_by_number_not_by_text() {
        let names = ["s10.png", "s9.png", "s11.png", "notes.txt"];
        let wanted = Ok(vec!["s9.png".to_owned(), "s10.png".into(), "s11.png".into()]);
        assert_eq!(found(&names, "dir", false), wanted);
        assert_eq!(found(&names, "dir/s%d.png", false), wanted);
        assert_eq!(found(&names, "dir/s10.png", true), wanted);
        assert_eq!(found(&names, "dir/s10.png", false), Ok(vec!["s10.png".into()]));
    }

    #[test]
    fn gap_and_mixture_are_refused() {
        assert_eq!(
            found(&["s1.png", "s2.png", "s4.png"], "dir", false).unwrap_err(),
            "dir: series is 2 followed by 4, wanted numbers in even steps, here of 1"
        );
        assert_eq!(
            found(&["a1.png", "b2.png"], "dir", false).unwrap_err(),
            "dir: series is \"b2.png\" beside \"a\" number \".png\", wanted one series of names that differ in their \
             last number only"
        );
        assert_eq!(
            found(&["s1.png", "s01.png"], "dir", false).unwrap_err(),
            "dir: series is 1 followed by 1, wanted numbers in even steps, here of 1"
        );
    }
}
