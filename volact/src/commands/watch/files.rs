//! What a picture depends on, and what that looked like at one moment.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    io::Read as _,
    path::{Path, PathBuf},
    time::SystemTime,
};

/// A file is compared by content up to this many bytes.
const SMALL: u64 = 1 << 20;
/// A data file up to this many bytes may be a header that names others.
const HEADER: u64 = 1 << 18;

/// Something that the picture depends on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Root {
    /// A file.
    File(PathBuf),
    /// All shaders of a folder.
    Shaders(PathBuf),
    /// A file or folder that a loader reads, with what it may read beside it.
    Data(PathBuf),
}

/// What a file looks like.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Stamp {
    Missing,
    /// Of a small file.
    Content(u64),
    /// Of a large one, or a folder.
    Place {
        bytes: u64,
        modified: Option<SystemTime>,
        number: u64,
    },
}

impl Stamp {
    fn of(path: &Path) -> Self {
        let Ok(data) = fs::metadata(path) else { return Self::Missing };
        if data.is_file()
            && data.len() <= SMALL
            && let Some(bytes) = read(path, SMALL)
        {
            let mut hasher = DefaultHasher::new();
            bytes.hash(&mut hasher);
            return Self::Content(hasher.finish());
        }
        if data.is_dir() {
            return Self::Place { bytes: 0, modified: None, number: 0 };
        }
        Self::Place { bytes: data.len(), modified: data.modified().ok(), number: number(&data) }
    }
}

/// What tells a file from another of the same length and time.
#[cfg(unix)]
fn number(data: &fs::Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(data)
}

#[cfg(not(unix))]
fn number(_: &fs::Metadata) -> u64 {
    0
}

fn read(path: &Path, most: u64) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    fs::File::open(path).ok()?.take(most).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// All files of some roots at one moment.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Snapshot(BTreeMap<Root, BTreeMap<PathBuf, Stamp>>);

impl Snapshot {
    /// Looks at all files but the picture.
    pub fn take(roots: &BTreeSet<Root>, output: &Path) -> Self {
        let look = |root: &Root| {
            let stamps = root.files(output).into_iter().map(|path| (Stamp::of(&path), path));
            (root.clone(), stamps.map(|(stamp, path)| (path, stamp)).collect())
        };
        Self(roots.iter().map(look).collect())
    }

    /// The files that are not as they were.
    pub fn changes(&self, before: &Self) -> Vec<PathBuf> {
        let (now, before) = (self.flat(), before.flat());
        let gone = before.keys().filter(|path| !now.contains_key(*path));
        let other = now.iter().filter(|(path, stamp)| before.get(*path) != Some(stamp)).map(|(path, _)| path);
        other.chain(gone).map(|path| path.to_path_buf()).collect()
    }

    /// Whether data are as they were, with all that belongs to them.
    pub fn same(&self, before: &Self, data: &Path) -> bool {
        let root = Root::Data(data.into());
        self.0.get(&root).is_some_and(|files| before.0.get(&root) == Some(files))
    }

    /// Whether a file that was there is missing.
    pub fn lost(&self, before: &Self) -> bool {
        let now = self.flat();
        let missing = |path: &Path| now.get(path).is_none_or(|stamp| **stamp == Stamp::Missing);
        before.flat().into_iter().any(|(path, stamp)| *stamp != Stamp::Missing && missing(path))
    }

    /// Whether a picture of that name would be drawn from itself.
    pub fn holds(&self, output: &Path) -> bool {
        let place = |path: &Path| path.canonicalize().ok();
        let named = |root: &Root| matches!(root, Root::File(path) | Root::Data(path) if place(path) == place(output));
        output.exists() && self.0.keys().any(named)
    }

    /// The folders in which all files are.
    pub fn folders(&self) -> BTreeSet<PathBuf> {
        let parent = |path: &Path| match path.parent() {
            Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
            Some(parent) => parent.into(),
            None => path.into(),
        };
        let mut folders: BTreeSet<_> = self.flat().into_keys().map(parent).collect();
        folders.extend(self.0.keys().filter_map(|root| match root {
            Root::Shaders(folder) => Some(folder.clone()),
            Root::Data(folder) if folder.is_dir() => Some(folder.clone()),
            _ => None,
        }));
        folders.into_iter().filter(|folder| folder.is_dir()).collect()
    }

    /// How many files and folders there are, in words.
    pub fn summary(&self) -> String {
        let count = |n: usize, one: &str| if n == 1 { format!("1 {one}") } else { format!("{n} {one}s") };
        let there = self.flat().into_values().filter(|stamp| **stamp != Stamp::Missing).count();
        format!("{} in {}", count(there, "file"), count(self.folders().len(), "folder"))
    }

    fn flat(&self) -> BTreeMap<&Path, &Stamp> {
        self.0.values().flatten().map(|(path, stamp)| (path.as_path(), stamp)).collect()
    }
}

impl Root {
    /// The files that are there, and those that should be.
    fn files(&self, output: &Path) -> Vec<PathBuf> {
        match self {
            Self::File(path) => vec![path.clone()],
            Self::Shaders(folder) => {
                let sources = entries(folder).into_iter().filter(|path| path.extension().is_some_and(|e| e == "wgsl"));
                sources.flat_map(|path| [path.with_extension("ron"), path]).collect()
            }
            Self::Data(path) => {
                let output = output.canonicalize().ok();
                let mut files = vec![path.clone()];
                files.extend(beside(path).into_iter().filter(|p| output.is_none() || p.canonicalize().ok() != output));
                files
            }
        }
    }
}

/// What a loader may read beside a file: what the file names if it is a header, what shares its
/// name, all slices of a series, and all that a folder or a pattern stands for.
fn beside(path: &Path) -> Vec<PathBuf> {
    if path.is_dir() {
        return entries(path);
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if let Some((start, _)) = name.split_once('%').filter(|_| !path.exists()) {
        return entries(folder).into_iter().filter(|p| file_name(p).starts_with(start)).collect();
    }
    let header = fs::metadata(path).is_ok_and(|data| data.len() <= HEADER).then(|| read(path, HEADER)).flatten();
    // Small numbers behind a header are valid text, too, with signs that no header has.
    let is_text = |text: &String| !text.contains(|c: char| c.is_control() && !c.is_whitespace());
    let header = header.and_then(|bytes| String::from_utf8(bytes).ok()).filter(is_text).unwrap_or_default();
    let stem = |name: &str| name.split('.').next().unwrap_or_default().to_owned();
    let ending = |name: &str| Path::new(name).extension().map(|e| e.to_ascii_lowercase());
    let numbered = stem(&name).ends_with(|c: char| c.is_ascii_digit());
    let picture = |name: &str| [".png", ".exr", ".npy"].iter().any(|end| name.ends_with(end));
    let belongs = |other: &str| {
        let series = numbered && ending(other) == ending(&name);
        let alike = stem(other) == stem(&name) || header.contains('%');
        other != name && (header.contains(other) || series || alike && !picture(other) && !written(other))
    };
    entries(folder).into_iter().filter(|p| belongs(&file_name(p))).collect()
}

/// Whether a file is a scene or shader, which are watched for themselves.
fn written(name: &str) -> bool {
    (name.ends_with(".ron") && !name.ends_with(".raw.ron")) || name.ends_with(".wgsl")
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The files of a folder, but for hidden ones and what editors keep aside.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let aside = |name: &str| name.starts_with('.') || name.ends_with('~');
    let Ok(listed) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<_> = listed.flatten().map(|entry| entry.path()).collect();
    paths.retain(|path| !aside(&file_name(path)) && path.is_file());
    paths.sort();
    paths
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        files.iter().for_each(|(name, text)| fs::write(folder.path().join(name), text).unwrap());
        folder
    }

    fn names(folder: &Path, data: &str, output: &str) -> Vec<String> {
        let files = Root::Data(folder.join(data)).files(&folder.join(output));
        files.iter().map(|path| file_name(path)).collect()
    }

    #[test]
    fn what_belongs_to_data_is_found_and_the_picture_is_not() {
        let folder = folder(&[
            ("a.nhdr", "NRRD0004\ndata file: voxels.raw\n"),
            ("voxels.raw", ""),
            ("a.raw.gz", ""),
            ("a.png", ""),
            ("a.ron", ""),
            ("b.raw.ron", "(file: \"s%d.u8\", numbers: (1, 2))"),
            ("s1.u8", ""),
            ("s2.u8", ""),
            ("c01.dcm", "\u{1}"),
            ("c02.dcm", "\u{1}"),
            (".c03.dcm", "\u{1}"),
            ("c04.dcm~", "\u{1}"),
            ("d.nrrd", "NRRD0004\n\n\u{1}%\u{2}"),
        ]);
        let path = folder.path();
        assert_eq!(names(path, "a.nhdr", "a.png"), ["a.nhdr", "a.raw.gz", "voxels.raw"]);
        assert_eq!(names(path, "c01.dcm", "x.png"), ["c01.dcm", "c02.dcm"]);
        assert_eq!(names(path, "c%02d.dcm", "x.png"), ["c%02d.dcm", "c01.dcm", "c02.dcm"]);
        assert_eq!(names(path, "d.nrrd", "x.png"), ["d.nrrd"], "a voxel of 37 is no pattern");
        let of_pattern = names(path, "b.raw.ron", "x.png");
        assert!(of_pattern.contains(&"s1.u8".into()) && of_pattern.contains(&"s2.u8".into()), "{of_pattern:?}");
        assert!(!of_pattern.contains(&"a.png".into()) && !of_pattern.contains(&"a.ron".into()), "{of_pattern:?}");
        assert!(!names(path, ".", "a.png").contains(&"a.png".into()), "a series without its picture");
    }

    #[test]
    fn what_changed_is_named_and_what_is_alike_is_not() {
        let folder = folder(&[("a.nrrd", "1"), ("t.f32", "1"), ("x.wgsl", "1"), ("x.ron", "1"), ("scene.ron", "1")]);
        let place = |name: &str| folder.path().join(name);
        let roots = BTreeSet::from([
            Root::Data(place("a.nrrd")),
            Root::File(place("t.f32")),
            Root::File(place("scene.ron")),
            Root::Shaders(folder.path().into()),
        ]);
        let take = || Snapshot::take(&roots, Path::new("out.png"));
        let before = take();
        assert_eq!(before.folders(), BTreeSet::from([folder.path().to_owned()]));
        fs::write(place("t.f32"), "1").unwrap();
        fs::write(place("notes.txt"), "1").unwrap();
        assert_eq!(take(), before, "a file that is saved as it was");
        fs::write(place("t.f32"), "2").unwrap();
        fs::write(place("y.wgsl"), "1").unwrap();
        let now = take();
        let mut changed = now.changes(&before);
        changed.sort();
        assert_eq!(changed, ["t.f32", "y.ron", "y.wgsl"].map(place));
        assert!(now.same(&before, &place("a.nrrd")) && !now.lost(&before));
        fs::remove_file(place("a.nrrd")).unwrap();
        let gone = take();
        assert!(gone.lost(&now) && !gone.same(&now, &place("a.nrrd")) && !now.lost(&gone));
        fs::write(place("out.png"), "").unwrap();
        assert!(!now.holds(&place("out.png")) && now.holds(&place("t.f32")), "a picture is no source of itself");
    }
}
