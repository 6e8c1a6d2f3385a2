//! Where files lie: on disk, or in memory for archives, tests and fuzzing.

use std::{
    collections::BTreeMap,
    fmt, fs,
    io::{self, BufRead, BufReader, Cursor, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
    sync::Arc,
};

use volact_core::{Buffer, Bulk, LoadError};

use crate::payload::MAP_FROM;

/// The longest line that a text header may have.
const LINE_LIMIT: u64 = 1 << 20;

/// Where a loader finds its files.
#[derive(Clone, Default)]
pub enum Storage {
    /// The file system.
    #[default]
    Disk,
    /// Files by path, in memory. Nothing else is looked at.
    Memory(Arc<BTreeMap<PathBuf, Arc<[u8]>>>),
}

/// Something to read from that can be sought in.
pub(crate) trait Input: Read + Seek + Send {}
impl<T: Read + Seek + Send> Input for T {}

impl Storage {
    /// Files in memory.
    pub fn memory<P: Into<PathBuf>>(files: impl IntoIterator<Item = (P, Vec<u8>)>) -> Self {
        Self::Memory(Arc::new(files.into_iter().map(|(path, bytes)| (path.into(), bytes.into())).collect()))
    }

    /// Opens a regular file.
    pub(crate) fn open(&self, path: &Path) -> Result<Box<dyn Input>, LoadError> {
        self.length(path)?;
        match self {
            Self::Disk => Ok(Box::new(fs::File::open(path).map_err(|e| LoadError::io(path, e))?)),
            Self::Memory(files) => Ok(Box::new(Cursor::new(Arc::clone(&files[path])))),
        }
    }

    /// Bytes of a regular file. Pipes and devices, which could block or never end, are refused.
    pub(crate) fn length(&self, path: &Path) -> Result<u64, LoadError> {
        match self {
            Self::Disk => {
                let metadata = fs::metadata(path).map_err(|e| LoadError::io(path, e))?;
                if !metadata.is_file() {
                    let found = if metadata.is_dir() { "a directory" } else { "a device or pipe" };
                    return Err(LoadError::invalid(path, "path", found, "a regular file"));
                }
                Ok(metadata.len())
            }
            Self::Memory(files) => match files.get(path) {
                Some(bytes) => Ok(bytes.len() as u64),
                None => Err(LoadError::io(path, io::ErrorKind::NotFound.into())),
            },
        }
    }

    pub(crate) fn is_file(&self, path: &Path) -> bool {
        match self {
            Self::Disk => path.is_file(),
            Self::Memory(files) => files.contains_key(path),
        }
    }

    pub(crate) fn is_dir(&self, path: &Path) -> bool {
        match self {
            Self::Disk => path.is_dir(),
            Self::Memory(files) => !files.contains_key(path) && files.keys().any(|p| p.parent() == Some(path)),
        }
    }

    /// The regular files in a directory, by name.
    pub(crate) fn list(&self, directory: &Path) -> Result<Vec<PathBuf>, LoadError> {
        match self {
            Self::Disk => {
                let directory = if directory.as_os_str().is_empty() { Path::new(".") } else { directory };
                let mut found = Vec::new();
                for entry in fs::read_dir(directory).map_err(|e| LoadError::io(directory, e))? {
                    let path = entry.map_err(|e| LoadError::io(directory, e))?.path();
                    if path.is_file() {
                        found.push(path);
                    }
                }
                found.sort();
                Ok(found)
            }
            Self::Memory(files) => Ok(files.keys().filter(|p| p.parent() == Some(directory)).cloned().collect()),
        }
    }

    /// The first bytes of a file, at most `limit`.
    pub(crate) fn head(&self, path: &Path, limit: u64) -> Result<Vec<u8>, LoadError> {
        let mut bytes = Vec::new();
        self.open(path)?.take(limit).read_to_end(&mut bytes).map_err(|e| LoadError::io(path, e))?;
        Ok(bytes)
    }

    /// Bytes `start..start + length` of a file, which must have them.
    pub(crate) fn range(&self, path: &Path, start: u64, length: u64) -> Result<Vec<u8>, LoadError> {
        let mut input = self.open(path)?;
        input.seek(SeekFrom::Start(start)).map_err(|e| LoadError::io(path, e))?;
        let mut bytes = Vec::new();
        input.take(length).read_to_end(&mut bytes).map_err(|e| LoadError::io(path, e))?;
        if bytes.len() as u64 != length {
            let (what, found) = ("data".into(), bytes.len() as u64);
            return Err(LoadError::Truncated { path: path.into(), what, found, wanted: length });
        }
        Ok(bytes)
    }

    /// All bytes of a file: mapped if they are many and on disk, shared if they are in memory.
    pub(crate) fn contents(&self, path: &Path) -> Result<Buffer, LoadError> {
        let length = self.length(path)?;
        if let Self::Memory(files) = self {
            return Ok(Buffer::from(Arc::clone(&files[path])));
        }
        if length >= MAP_FROM as u64
            && let Some(mapped) = self.map(path, 0, usize::try_from(length).unwrap_or(usize::MAX))?
        {
            return Ok(mapped);
        }
        self.range(path, 0, length).map(Buffer::from_vec)
    }

    /// Bytes `start..start + length` of a file on disk, mapped; `None` in memory.
    pub(crate) fn map(&self, path: &Path, start: u64, length: usize) -> Result<Option<Buffer>, LoadError> {
        let Self::Disk = self else { return Ok(None) };
        let file = fs::File::open(path).map_err(|e| LoadError::io(path, e))?;
        let mapped = map_file(&file, start, length).map_err(|e| LoadError::io(path, e))?;
        Ok(Some(Buffer::new(Mapped(mapped))))
    }

    /// A text header, line by line.
    pub(crate) fn lines(&self, path: &Path) -> Result<Lines, LoadError> {
        Ok(Lines { path: path.into(), input: BufReader::new(self.open(path)?), offset: 0 })
    }
}

impl fmt::Debug for Storage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Disk => f.write_str("Disk"),
            Self::Memory(files) => write!(f, "Memory({} files)", files.len()),
        }
    }
}

/// Reads a text header and knows where it is, for the data that follow.
pub(crate) struct Lines {
    path: PathBuf,
    input: BufReader<Box<dyn Input>>,
    offset: u64,
}

impl Lines {
    /// Bytes read so far.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }

    /// The next line without its end; `None` at the end of the file.
    pub(crate) fn line(&mut self) -> Result<Option<String>, LoadError> {
        let mut bytes = Vec::new();
        let mut limited = (&mut self.input).take(LINE_LIMIT);
        limited.read_until(b'\n', &mut bytes).map_err(|e| LoadError::io(&self.path, e))?;
        if bytes.is_empty() {
            return Ok(None);
        }
        self.offset += bytes.len() as u64;
        if bytes.len() as u64 == LINE_LIMIT && bytes.last() != Some(&b'\n') {
            let wanted = format!("at most {LINE_LIMIT}");
            return Err(LoadError::invalid(&self.path, "header line", "longer", wanted + " bytes"));
        }
        while matches!(bytes.last(), Some(b'\n' | b'\r')) {
            bytes.pop();
        }
        Ok(Some(String::from_utf8_lossy(&bytes).into_owned()))
    }

    /// The next word, up to white space, of which one character is taken; `None` at the end.
    pub(crate) fn word(&mut self) -> Result<Option<String>, LoadError> {
        let mut word = Vec::new();
        loop {
            let buffer = self.input.fill_buf().map_err(|e| LoadError::io(&self.path, e))?;
            let Some(&byte) = buffer.first() else { break };
            self.input.consume(1);
            self.offset += 1;
            if !byte.is_ascii_whitespace() {
                word.push(byte);
                if word.len() as u64 > LINE_LIMIT {
                    return Err(LoadError::invalid(&self.path, "word", "longer", "at most 1 MiB"));
                }
            } else if !word.is_empty() {
                break;
            }
        }
        Ok((!word.is_empty()).then(|| String::from_utf8_lossy(&word).into_owned()))
    }

    /// Goes to a byte of the file.
    pub(crate) fn seek(&mut self, offset: u64) -> Result<(), LoadError> {
        self.input.seek(SeekFrom::Start(offset)).map_err(|e| LoadError::io(&self.path, e))?;
        self.offset = offset;
        Ok(())
    }
}

struct Mapped(memmap2::Mmap);

impl Bulk for Mapped {
    fn bytes(&self) -> &[u8] {
        &self.0
    }
}

#[expect(unsafe_code, reason = "mapping a file needs it")]
fn map_file(file: &fs::File, start: u64, length: usize) -> io::Result<memmap2::Mmap> {
    // SAFETY: the mapping is read only. That nobody changes or cuts the file while it is mapped is
    // the user's part, stated in this crate's documentation.
    unsafe { memmap2::MmapOptions::new().offset(start).len(length).map(file) }
}
