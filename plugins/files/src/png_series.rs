//! PNG files as slices.
//!
//! # Reads
//! One file (a volume of one slice), a folder of numbered files, or a pattern such as
//! `slice%03d.png`, sorted by number. Grey, grey with alpha, RGB and RGBA of 8 or 16 bits, as
//! stored.
//!
//! # Options
//! `series`: read all files of the folder that differ from the one given in their last number.
//! `spacing`: distance between samples; 1 by default, as PNG has no distance between slices.
//!
//! # Limits
//! Palettes and 1, 2 or 4 bits are refused. Gamma and colour profiles are not used; animations
//! give their first frame.

use std::{
    io::BufReader,
    path::{Path, PathBuf},
};

use png::{BitDepth, ColorType, Decoder, Limits, Transformations};
use volact_core::{
    LoadError, LoadOptions, ParameterDecl, ParameterType, ScalarType, VolumeDesc, VolumeReader,
    glam::DVec3,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, flag, name_of, spacing_given, spacing_option},
    payload::{ByteOrder, Encoding, swap_bytes, validate},
    series,
    slices::{SliceLayout, SliceReader, SliceSource},
    storage::{Input, Storage},
    world,
};

const EXTENSIONS: [&str; 1] = [".png"];
/// Bytes for what is not pixels: text, profiles.
const SIDE_LIMIT: usize = 16 << 20;

/// The loader.
pub(crate) fn format() -> Format {
    Format::new("png", "PNG files as slices: one, a numbered series, or a folder of them", probe, open)
        .with(series_option())
        .with(spacing_option())
}

pub(crate) fn series_option() -> ParameterDecl {
    let text = "read all files of the folder that differ from this one in their last number only";
    ParameterDecl::new("series", ParameterType::Bool, text).default(false)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    if probe.is_dir {
        return folder_confidence(probe, &EXTENSIONS);
    }
    confidence(probe.head.starts_with(b"\x89PNG\r\n\x1a\n"), probe, &EXTENSIONS)
}

/// A folder is taken for a series where it holds a file with the extension.
pub(crate) fn folder_confidence(probe: &Probe<'_>, extensions: &[&str]) -> Confidence {
    let files = Storage::Disk.list(probe.path).unwrap_or_default();
    if files.iter().any(|f| series::has_extension(f, extensions)) { Confidence::Extension } else { Confidence::No }
}

type Input0 = BufReader<Box<dyn Input>>;

fn decoder(storage: &Storage, path: &Path, pixels: u64) -> Result<Decoder<Input0>, LoadError> {
    let limits = Limits { bytes: SIDE_LIMIT.saturating_add(pixels as usize) };
    let mut decoder = Decoder::new_with_limits(BufReader::new(storage.open(path)?), limits);
    decoder.set_transformations(Transformations::IDENTITY);
    Ok(decoder)
}

fn failed(path: &Path, error: png::DecodingError) -> LoadError {
    LoadError::Decode { path: path.into(), source: Box::new(error) }
}

/// Reads a file's first chunk and checks that the file could hold its pixels.
fn layout(storage: &Storage, path: &Path) -> Result<SliceLayout, LoadError> {
    let mut decoder = decoder(storage, path, 0)?;
    let info = decoder.read_header_info().map_err(|e| failed(path, e))?;
    let scalar = match info.bit_depth {
        BitDepth::Eight => ScalarType::U8,
        BitDepth::Sixteen => ScalarType::U16,
        other => {
            let cure = "save it with 8 or 16 bits".into();
            return Err(LoadError::Unsupported { path: path.into(), what: format!("{} bits", other as u8), cure });
        }
    };
    let components = match info.color_type {
        ColorType::Grayscale => 1,
        ColorType::GrayscaleAlpha => 2,
        ColorType::Rgb => 3,
        ColorType::Rgba => 4,
        ColorType::Indexed => {
            let cure = "save it as grey or RGB".into();
            return Err(LoadError::Unsupported { path: path.into(), what: "a palette".into(), cure });
        }
    };
    let layout = SliceLayout { width: info.width, height: info.height, scalar, components };
    let size = storage.length(path)?;
    if layout.bytes() > Encoding::Zlib.most(size) {
        let what = format!("PNG, enough for at most {} bytes of pixels", Encoding::Zlib.most(size));
        return Err(LoadError::Truncated { path: path.into(), what, found: size, wanted: layout.bytes() });
    }
    Ok(layout)
}

fn open(storage: &Storage, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let files = series::find(storage, path, &EXTENSIONS, flag(options, "series"))?;
    let first = layout(storage, &files[0])?;
    for file in &files[1..] {
        let other = layout(storage, file)?;
        if other != first {
            let name = name_of(&files[0]);
            return Err(LoadError::invalid(file, "slice", other.describe(), format!("{} as {name}", first.describe())));
        }
    }
    let dims = [first.width as usize, first.height as usize, files.len()];
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, first.scalar, first.components) };
    let spacing = spacing_given(options).unwrap_or(DVec3::ONE);
    world::place_spaced(path, "spacing", &mut desc, world::AXES, spacing.to_array(), DVec3::ZERO)?;
    validate(path, &desc)?;
    let source = Files { storage: storage.clone(), files, layout: first };
    Ok(Box::new(SliceReader { path: path.into(), desc, warnings: Vec::new(), source }))
}

struct Files {
    storage: Storage,
    files: Vec<PathBuf>,
    layout: SliceLayout,
}

impl SliceSource for Files {
    fn slice(&mut self, z: usize) -> Result<Vec<u8>, LoadError> {
        let path = &self.files[z];
        let decoder = decoder(&self.storage, path, self.layout.bytes())?;
        let mut reader = decoder.read_info().map_err(|e| failed(path, e))?;
        let size = reader.output_buffer_size().unwrap_or(usize::MAX);
        if size as u64 != self.layout.bytes() {
            return Err(LoadError::invalid(path, "slice", format!("{size} bytes"), self.layout.describe()));
        }
        let mut bytes = vec![0; size];
        reader.next_frame(&mut bytes).map_err(|e| failed(path, e))?;
        if self.layout.scalar == ScalarType::U16 && ByteOrder::NATIVE == ByteOrder::Little {
            swap_bytes(&mut bytes, 2);
        }
        Ok(bytes)
    }
}
