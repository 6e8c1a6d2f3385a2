//! Finds libraries by name, in folders and nowhere else.

use std::{
    fs,
    path::{Path, PathBuf},
};

use sha2::{Digest as _, Sha256};

use crate::plugin::status::{Code, Fault};

/// A plugin that is wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wanted {
    /// Its name: letters, digits, `_` and `-`.
    pub name: String,
    /// The SHA-256 of its file, where only that file will do.
    pub sha256: Option<[u8; 32]>,
}

/// Where plugins are looked for, and which.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Search {
    /// Folders, in the order in which they are searched; the first that has a name is taken.
    pub folders: Vec<PathBuf>,
    /// The plugins to load, in this order.
    pub wanted: Vec<Wanted>,
    /// For a registered name that several claim: the plugin whose registration is taken.
    pub names: std::collections::BTreeMap<String, String>,
}

/// A library that lies in one of the folders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// The name under which it would be loaded.
    pub name: String,
    /// Its file.
    pub path: PathBuf,
    /// Whether a library of the same name in an earlier folder is taken instead.
    pub hidden: bool,
}

/// The file name of a plugin's library on this system, e.g. `libring.so`.
pub fn file_name(name: &str) -> String {
    use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
    format!("{DLL_PREFIX}{}{DLL_SUFFIX}", name.replace('-', "_"))
}

/// The longest name.
const MAX_NAME: usize = 64;

/// Refuses a name that is no plain name; so no name leads out of a folder.
pub(super) fn check_name(name: &str) -> Result<(), Fault> {
    let plain = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    if plain && name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.len() <= MAX_NAME {
        return Ok(());
    }
    let wanted = format!("up to {MAX_NAME} letters, digits, '_' and '-', starting with a letter");
    Err(Fault::new(Code::BadName, format!("name of the plugin is {name:?}, wanted {wanted}")))
}

impl Search {
    /// The file of a plugin.
    pub(super) fn find(&self, name: &str) -> Result<PathBuf, Fault> {
        check_name(name)?;
        let file = file_name(name);
        for folder in &self.folders {
            let path = folder.join(&file);
            if fs::symlink_metadata(&path).is_ok() {
                return inside(folder, &path);
            }
        }
        let folders: Vec<_> = self.folders.iter().map(|f| f.display().to_string()).collect();
        let places = if folders.is_empty() { "no folder, since none is named".into() } else { folders.join(", ") };
        Err(Fault::new(Code::BadName, format!("{file} is in none of the folders; looked in {places}")))
    }

    /// Every library in the folders, by folder and name. Nothing is loaded.
    pub fn found(&self) -> Vec<Found> {
        let mut all: Vec<Found> = Vec::new();
        for folder in &self.folders {
            let Ok(entries) = fs::read_dir(folder) else { continue };
            let mut here: Vec<_> = entries.flatten().filter_map(|entry| named(&entry.path())).collect();
            here.sort_by(|a, b| a.name.cmp(&b.name));
            for mut found in here {
                found.hidden = all.iter().any(|earlier| earlier.name == found.name);
                all.push(found);
            }
        }
        all
    }
}

/// The plugin that a file would be.
fn named(path: &Path) -> Option<Found> {
    use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
    let name = path.file_name()?.to_str()?.strip_prefix(DLL_PREFIX)?.strip_suffix(DLL_SUFFIX)?;
    check_name(name).ok()?;
    Some(Found { name: name.into(), path: path.into(), hidden: false })
}

/// The true path of a file that must not lead out of its folder.
fn inside(folder: &Path, path: &Path) -> Result<PathBuf, Fault> {
    let io = |error: std::io::Error| Fault::new(Code::Io, format!("{}: {error}", path.display()));
    let (root, real) = (fs::canonicalize(folder).map_err(io)?, fs::canonicalize(path).map_err(io)?);
    if !real.starts_with(&root) {
        let message =
            format!("{} leads to {}, wanted a file inside {}", path.display(), real.display(), root.display());
        return Err(Fault::new(Code::BadName, message));
    }
    let kind = fs::metadata(&real).map_err(io)?;
    if kind.is_dir() {
        return Err(Fault::bad(path.display(), "a folder", "a library"));
    }
    if !kind.is_file() {
        return Err(Fault::bad(path.display(), "no plain file", "a library"));
    }
    Ok(real)
}

/// The SHA-256 of 64 hexadecimal digits.
pub fn sha256_of(text: &str) -> Option<[u8; 32]> {
    let digits: Option<Vec<u8>> = text.chars().map(|c| c.to_digit(16).map(|d| d as u8)).collect();
    let bytes: Vec<u8> = digits?.chunks(2).map(|pair| pair.iter().fold(0, |n, d| n << 4 | d)).collect();
    (text.len() == 64).then(|| bytes.try_into().ok()).flatten()
}

/// Refuses content whose hash is another.
pub(super) fn check_hash(content: &[u8], wanted: &[u8; 32]) -> Result<(), Fault> {
    let found: [u8; 32] = Sha256::digest(content).into();
    if found == *wanted {
        return Ok(());
    }
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    Err(Fault::bad("SHA-256 of the library", hex(&found), format!("{}, as pinned", hex(wanted))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_nowhere_else() {
        let folder = tempfile::tempdir().unwrap();
        let search = Search { folders: vec![folder.path().into()], ..Search::default() };
        for name in ["../x", "a/b", "a\\b", "..", "", "/etc/x", "a.b", "1a", "a\0b", "ä", &"a".repeat(65)] {
            let error = search.find(name).unwrap_err();
            assert_eq!(error.code, Code::BadName, "{name:?}");
            assert!(error.message.contains("wanted up to 64 letters"), "{error}");
        }
        assert!(search.find("absent").unwrap_err().message.contains("in none of the folders; looked in"));
    }

    #[test]
    #[cfg(unix)]
    fn links_out_of_the_folder_are_refused() {
        let (folder, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let target = outside.path().join("any.so");
        fs::write(&target, "x").unwrap();
        std::os::unix::fs::symlink(&target, folder.path().join(file_name("out"))).unwrap();
        fs::write(folder.path().join("real.so"), "x").unwrap();
        std::os::unix::fs::symlink("real.so", folder.path().join(file_name("in"))).unwrap();
        fs::create_dir(folder.path().join(file_name("folder"))).unwrap();
        let search = Search { folders: vec![folder.path().into()], ..Search::default() };
        assert!(search.find("out").unwrap_err().message.contains("wanted a file inside"));
        assert!(search.find("in").unwrap().ends_with("real.so"));
        assert!(search.find("folder").unwrap_err().message.contains("is a folder"));
    }

    #[test]
    fn earlier_folders_hide_later_ones() {
        let folders: Vec<_> = (0..2).map(|_| tempfile::tempdir().unwrap()).collect();
        for (folder, name) in [(0, "b"), (1, "b"), (1, "a"), (0, "Not a name")] {
            fs::write(folders[folder].path().join(file_name(name)), "x").unwrap();
        }
        let search = Search { folders: folders.iter().map(|f| f.path().into()).collect(), ..Search::default() };
        let found: Vec<_> = search.found().into_iter().map(|f| (f.name, f.hidden)).collect();
        assert_eq!(found, [("b".into(), false), ("a".into(), false), ("b".into(), true)]);
        assert!(search.find("b").unwrap().starts_with(fs::canonicalize(folders[0].path()).unwrap()));
    }

    #[test]
    fn hashes_are_read_and_compared() {
        // The SHA-256 of "abc": FIPS 180-4, appendix of examples.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let wanted = sha256_of(abc).unwrap();
        assert_eq!(check_hash(b"abc", &wanted), Ok(()));
        assert!(check_hash(b"abd", &wanted).unwrap_err().message.ends_with(&format!("{abc}, as pinned")));
        assert!(sha256_of("ba78").is_none() && sha256_of(&"g".repeat(64)).is_none());
    }
}
