//! Voxels as bytes in files: encodings, byte order, regions.
//!
//! A [`Payload`] is one logical run of bytes, held by one or more parts of files, each encoded for
//! itself. Sizes are checked when it is made; a compressed part is refused where its encoding
//! could not possibly hold what the header promises, and memory grows with what is really decoded.

use std::{
    io::{self, BufReader, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use volact_core::{Buffer, LoadError, Progress, Region, ScalarType, VolumeDesc, VolumeReader, Warning, WarningCode};

use crate::{
    decode::decoder,
    storage::{Input, Storage},
};

/// Raw files of at least that many bytes are mapped instead of read.
pub(crate) const MAP_FROM: usize = 1 << 20;
/// Bytes between two calls of progress.
const CHUNK: usize = 1 << 20;

/// How a part's bytes are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    Raw,
    Gzip,
    Zlib,
    Bzip2,
    /// Numbers as text, of the type given.
    Ascii(ScalarType),
    Hex,
}

impl Encoding {
    /// The most bytes that `encoded` bytes can become.
    pub(crate) fn most(self, encoded: u64) -> u64 {
        match self {
            Self::Raw => encoded,
            // 258 bytes from a length and a distance code of one bit each.
            Self::Gzip | Self::Zlib => encoded.saturating_mul(1032),
            // A block of 900 kB, each 5 of them 259 bytes, in no less than 32 bytes.
            Self::Bzip2 => (encoded / 32 + 1).saturating_mul(900_000 / 5 * 259),
            Self::Ascii(scalar) => encoded.div_ceil(2).saturating_mul(scalar.size() as u64),
            Self::Hex => encoded / 2,
        }
    }
}

/// The order of a number's bytes in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByteOrder {
    Little,
    Big,
}

impl ByteOrder {
    pub(crate) const NATIVE: Self = if cfg!(target_endian = "big") { Self::Big } else { Self::Little };

    pub(crate) fn big_if(big: bool) -> Self {
        if big { Self::Big } else { Self::Little }
    }
}

/// Reverses the bytes of each number of `size` bytes.
pub(crate) fn swap_bytes(bytes: &mut [u8], size: usize) {
    if size > 1 {
        bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
    }
}

/// A piece of a file that holds a piece of the data.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) path: PathBuf,
    /// Where in the file the encoded bytes begin.
    pub(crate) start: u64,
    /// How many encoded bytes there are.
    pub(crate) encoded: u64,
    /// Decoded bytes before the data.
    pub(crate) skip: u64,
    /// Decoded bytes of data.
    pub(crate) length: u64,
}

/// All the data of a volume.
#[derive(Debug)]
pub(crate) struct Payload {
    pub(crate) storage: Storage,
    pub(crate) parts: Vec<Part>,
    pub(crate) encoding: Encoding,
    pub(crate) order: ByteOrder,
    /// Whether something else may follow the voxels.
    pub(crate) open_ended: bool,
    /// Which bits of an integer count, if not all.
    pub(crate) significant: Option<Significant>,
}

/// The lowest bits of an integer, of which the highest is a sign if it is `signed`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Significant {
    pub(crate) bits: u32,
    pub(crate) signed: bool,
}

impl Significant {
    /// Clears the other bits of native integers of `size` bytes, or extends the sign into them.
    fn apply(self, bytes: &mut [u8], size: usize) {
        macro_rules! each {
            ($signed:ty, $unsigned:ty) => {
                for raw in bytes.chunks_exact_mut(size) {
                    let shift = <$unsigned>::BITS.saturating_sub(self.bits);
                    let mut value = [0; size_of::<$unsigned>()];
                    value.copy_from_slice(raw);
                    let up = <$unsigned>::from_ne_bytes(value) << shift;
                    let down = if self.signed { (up as $signed >> shift) as $unsigned } else { up >> shift };
                    raw.copy_from_slice(&down.to_ne_bytes());
                }
            };
        }
        match size {
            1 => each!(i8, u8),
            2 => each!(i16, u16),
            4 => each!(i32, u32),
            _ => {}
        }
    }
}

impl Payload {
    /// Refuses what the files cannot hold; warns of what they hold beyond.
    fn check(&self, name: &str, warnings: &mut Vec<Warning>) -> Result<(), LoadError> {
        for part in &self.parts {
            let wanted = part.length.saturating_add(part.skip);
            let most = self.encoding.most(part.encoded);
            if wanted > most {
                let what = if self.encoding == Encoding::Raw {
                    "voxels".into()
                } else {
                    format!("{} voxels, enough for at most {most}", self.encoding_name())
                };
                return Err(LoadError::Truncated { path: part.path.clone(), what, found: part.encoded, wanted });
            }
            if self.encoding == Encoding::Raw && wanted < part.encoded && !self.open_ended {
                warnings.push(surplus(name, part.encoded - wanted));
            }
        }
        Ok(())
    }

    fn encoding_name(&self) -> &'static str {
        match self.encoding {
            Encoding::Raw => "raw",
            Encoding::Gzip => "gzip",
            Encoding::Zlib => "zlib",
            Encoding::Bzip2 => "bzip2",
            Encoding::Ascii(_) => "text",
            Encoding::Hex => "hexadecimal",
        }
    }

    fn open(&self, part: &Part) -> Result<Stream, LoadError> {
        let mut input = self.storage.open(&part.path)?;
        input.seek(SeekFrom::Start(part.start)).map_err(|e| LoadError::io(&part.path, e))?;
        if self.encoding == Encoding::Raw {
            return Ok(Stream::Raw(input));
        }
        let input = BufReader::with_capacity(1 << 16, input.take(part.encoded));
        Ok(Stream::Decoded(decoder(self.encoding, input)))
    }
}

enum Stream {
    Raw(Box<dyn Input>),
    Decoded(Box<dyn Read + Send>),
}

/// The contiguous runs of bytes that make up a region, in order.
pub(crate) fn runs(dims: [usize; 3], region: Region, sample: usize) -> impl Iterator<Item = (u64, usize)> {
    let [nx, ny, _] = dims;
    let size = region.dims();
    let full_rows = size[0] == nx;
    let full_slices = full_rows && size[1] == ny;
    let (slices, rows, length) = match (full_slices, full_rows) {
        (true, _) => (1, 1, size[0] * size[1] * size[2]),
        (_, true) => (size[2], 1, size[0] * size[1]),
        _ => (size[2], size[1], size[0]),
    };
    (0..slices).flat_map(move |z| {
        (0..rows).map(move |y| {
            let first = ((region.min[2] + z) * ny + region.min[1] + y) * nx + region.min[0];
            ((first * sample) as u64, length * sample)
        })
    })
}

/// Refuses a region that is empty or reaches outside.
pub(crate) fn check_region(path: &Path, dims: [usize; 3], region: Region) -> Result<(), LoadError> {
    if (0..3).any(|a| region.min[a] > region.max[a] || region.max[a] >= dims[a]) {
        return Err(LoadError::Region { path: path.into(), region, dims });
    }
    Ok(())
}

/// Copies a region's part of one slice, given whole, to the end of `out`.
pub(crate) fn crop_slice(slice: &[u8], nx: usize, region: Region, sample: usize, out: &mut Vec<u8>) {
    for y in region.min[1]..=region.max[1] {
        let row = y * nx;
        out.extend_from_slice(&slice[(row + region.min[0]) * sample..(row + region.max[0] + 1) * sample]);
    }
}

/// Room for `bytes`, or an error.
pub(crate) fn reserve(path: &Path, bytes: usize) -> Result<Vec<u8>, LoadError> {
    let mut out = Vec::new();
    out.try_reserve_exact(bytes).map_err(|_| out_of_memory(path, bytes))?;
    Ok(out)
}

pub(crate) fn out_of_memory(path: &Path, bytes: usize) -> LoadError {
    let cure = "read it region by region".into();
    LoadError::Unsupported { path: path.into(), what: format!("a region of {bytes} bytes in this memory"), cure }
}

/// Tells progress; an error if it asks to stop.
pub(crate) fn advance(path: &Path, progress: &dyn Progress, done: u64, total: u64) -> Result<(), LoadError> {
    if progress.advance(done, total) { Ok(()) } else { Err(LoadError::Stopped { path: path.into() }) }
}

/// The warning about bytes beyond the voxels.
pub(crate) fn surplus(name: &str, bytes: u64) -> Warning {
    let message = format!("{bytes} bytes after the voxels are not read");
    Warning::new(WarningCode::FileContent, name, message)
}

/// The reader of every format whose voxels are a [`Payload`].
#[derive(Debug)]
pub(crate) struct GridReader {
    path: PathBuf,
    desc: VolumeDesc,
    payload: Payload,
    warnings: Vec<Warning>,
}

impl GridReader {
    /// Checks description and sizes.
    pub(crate) fn open(
        path: &Path,
        desc: VolumeDesc,
        payload: Payload,
        mut warnings: Vec<Warning>,
    ) -> Result<Box<dyn VolumeReader>, LoadError> {
        validate(path, &desc)?;
        payload.check(&desc.name, &mut warnings)?;
        debug_assert_eq!(payload.parts.iter().map(|p| p.length).sum::<u64>(), desc.bytes().unwrap_or(0) as u64);
        Ok(Box::new(Self { path: path.into(), desc, payload, warnings }))
    }

    fn copy(&mut self, region: Region, progress: &dyn Progress) -> Result<Vec<u8>, LoadError> {
        let sample = self.desc.components * self.desc.scalar.size();
        let total = region.dims().iter().product::<usize>() * sample;
        let raw = self.payload.encoding == Encoding::Raw;
        // Raw sizes are known to be true; of decoded ones only what arrives is.
        let mut out = reserve(&self.path, if raw { total } else { total.min(CHUNK) })?;
        let mut walk = Walk { payload: &self.payload, part: 0, first: 0, position: 0, stream: None, extra: None };
        for (start, length) in runs(self.desc.dims, region, sample) {
            walk.read(start, length, &mut out, &mut |done| advance(&self.path, progress, done, total as u64))?;
        }
        walk.finish()?;
        if let Some(extra) = walk.extra
            && !self.warnings.contains(&extra)
        {
            self.warnings.push(extra);
        }
        if self.payload.order != ByteOrder::NATIVE && !matches!(self.payload.encoding, Encoding::Ascii(_)) {
            swap_bytes(&mut out, self.desc.scalar.size());
        }
        if let Some(significant) = self.payload.significant {
            significant.apply(&mut out, self.desc.scalar.size());
        }
        Ok(out)
    }

    fn map(&self) -> Result<Option<Buffer>, LoadError> {
        let whole = self.desc.bytes().unwrap_or(0);
        let native = self.payload.order == ByteOrder::NATIVE || self.desc.scalar.size() == 1;
        let native = native && self.payload.significant.is_none();
        match &self.payload.parts[..] {
            [part] if self.payload.encoding == Encoding::Raw && native && whole >= MAP_FROM => {
                self.payload.storage.map(&part.path, part.start + part.skip, whole)
            }
            _ => Ok(None),
        }
    }
}

/// Checks a description and names the file in the error.
pub(crate) fn validate(path: &Path, desc: &VolumeDesc) -> Result<(), LoadError> {
    desc.validate().map_err(|source| LoadError::Volume { path: path.into(), source })
}

impl VolumeReader for GridReader {
    fn desc(&self) -> &VolumeDesc {
        &self.desc
    }

    fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    fn read_region(&mut self, region: Region, progress: &dyn Progress) -> Result<Buffer, LoadError> {
        check_region(&self.path, self.desc.dims, region)?;
        if region == Region::whole(self.desc.dims)
            && let Some(mapped) = self.map()?
        {
            let bytes = mapped.len() as u64;
            return advance(&self.path, progress, bytes, bytes).map(|()| mapped);
        }
        self.copy(region, progress).map(Buffer::from)
    }
}

/// A walk forward through the parts of a payload.
struct Walk<'a> {
    payload: &'a Payload,
    part: usize,
    /// Where the current part begins in the data.
    first: u64,
    /// Where the stream stands in the data.
    position: u64,
    stream: Option<Stream>,
    extra: Option<Warning>,
}

impl Walk<'_> {
    fn read(
        &mut self,
        mut start: u64,
        length: usize,
        out: &mut Vec<u8>,
        report: &mut dyn FnMut(u64) -> Result<(), LoadError>,
    ) -> Result<(), LoadError> {
        let end = start + length as u64;
        while start < end {
            self.go_to(start, &mut || report(out.len() as u64))?;
            let part = &self.payload.parts[self.part];
            let take = (self.first + part.length).min(end) - start;
            let mut left = take;
            while left > 0 {
                let chunk = left.min(CHUNK as u64);
                self.fill(chunk, out)?;
                left -= chunk;
                report(out.len() as u64)?;
            }
            start += take;
        }
        Ok(())
    }

    /// Opens the part that holds `position` and goes there.
    fn go_to(&mut self, position: u64, report: &mut dyn FnMut() -> Result<(), LoadError>) -> Result<(), LoadError> {
        while position >= self.first + self.payload.parts[self.part].length {
            self.finish()?;
            self.first += self.payload.parts[self.part].length;
            self.part += 1;
        }
        let part = &self.payload.parts[self.part];
        if self.stream.is_none() {
            self.stream = Some(self.payload.open(part)?);
            self.position = self.first;
            self.pass(part.skip, report)?;
        }
        self.pass(position - self.position, report)?;
        self.position = position;
        Ok(())
    }

    /// Leaves bytes out: by seeking where that is possible, else by decoding them.
    fn pass(&mut self, bytes: u64, report: &mut dyn FnMut() -> Result<(), LoadError>) -> Result<(), LoadError> {
        let part = &self.payload.parts[self.part];
        match &mut self.stream {
            Some(Stream::Raw(input)) => {
                let bytes = i64::try_from(bytes).unwrap_or(i64::MAX);
                input.seek_relative(bytes).map_err(|e| LoadError::io(&part.path, e))
            }
            Some(Stream::Decoded(input)) => {
                let mut left = bytes;
                while left > 0 {
                    let chunk = left.min(CHUNK as u64);
                    let passed = io::copy(&mut input.take(chunk), &mut io::sink());
                    decoded(part, passed, chunk, part.length + part.skip - left)?;
                    left -= chunk;
                    report()?;
                }
                Ok(())
            }
            None => Ok(()),
        }
    }

    fn fill(&mut self, bytes: u64, out: &mut Vec<u8>) -> Result<(), LoadError> {
        let part = &self.payload.parts[self.part];
        let done = self.position - self.first;
        out.try_reserve(bytes as usize).map_err(|_| out_of_memory(&part.path, out.len() + bytes as usize))?;
        let before = out.len();
        match &mut self.stream {
            Some(Stream::Raw(input)) => {
                input.take(bytes).read_to_end(out).map_err(|e| LoadError::io(&part.path, e))?;
                decoded(part, Ok((out.len() - before) as u64), bytes, done)?;
            }
            Some(Stream::Decoded(input)) => {
                let result = input.take(bytes).read_to_end(out).map(|n| n as u64);
                let result = result.map_err(|e| (e, (out.len() - before) as u64));
                match result {
                    Err((e, got)) if e.kind() == io::ErrorKind::UnexpectedEof => decoded(part, Ok(got), bytes, done)?,
                    Err((e, _)) => decoded(part, Err(e), bytes, done)?,
                    Ok(got) => decoded(part, Ok(got), bytes, done)?,
                }
            }
            None => {}
        }
        self.position += bytes;
        Ok(())
    }

    /// At the end of a part, asks for one byte more: checksums are verified by that, and a stream
    /// that goes on is noticed.
    fn finish(&mut self) -> Result<(), LoadError> {
        let part = &self.payload.parts[self.part];
        let stream = self.stream.take();
        if self.position != self.first + part.length || self.payload.open_ended {
            return Ok(());
        }
        if let Some(Stream::Decoded(mut input)) = stream {
            let mut byte = [0];
            match input.read(&mut byte) {
                Ok(0) => {}
                Ok(_) => {
                    let name = part.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                    let message = "the encoded data go on after the voxels; the rest is not read";
                    self.extra = Some(Warning::new(WarningCode::FileContent, name, message));
                }
                Err(e) => return decoded(part, Err(e), 1, part.length),
            }
        }
        Ok(())
    }
}

/// Turns a short or failed read into the error that names it.
fn decoded(part: &Part, result: io::Result<u64>, wanted: u64, done: u64) -> Result<(), LoadError> {
    match result {
        Ok(got) if got == wanted => Ok(()),
        Ok(got) => Err(LoadError::Truncated {
            path: part.path.clone(),
            what: "decoded voxels".into(),
            found: done + got,
            wanted: part.length + part.skip,
        }),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Err(LoadError::Truncated {
            path: part.path.clone(),
            what: "decoded voxels".into(),
            found: done,
            wanted: part.length + part.skip,
        }),
        Err(e) => Err(LoadError::Decode { path: part.path.clone(), source: Box::new(e) }),
    }
}
