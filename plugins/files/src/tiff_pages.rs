//! TIFF: the pages of a file, or numbered files, as slices.
//!
//! # Reads
//! Baseline and BigTIFF, strips and tiles; uncompressed, PackBits, Deflate and LZW with their
//! predictors; 8, 16 and 32-bit integers, signed or not, and 16, 32 and 64-bit floats; 1 to 4
//! interleaved samples. A file stands for its pages; a folder or a pattern such as `slice%03d.tif`
//! for files of one page each, sorted by number. ImageJ's `spacing` and the resolution give the
//! spacing, where both are there in the same unit.
//!
//! # Options
//! `series`: read all files of the folder that differ from the one given in their last number.
//! `spacing`: distance between samples, instead of the file's.
//!
//! # Limits
//! Palettes, YCbCr, planar samples, JPEG and fax compression, 64-bit integers, ImageJ's
//! hyperstacks and its stacks of a single page are refused. The orientation tag is not used.
//! White-is-zero images are inverted, as their numbers mean.

use std::{
    io::{BufReader, ErrorKind},
    path::{Path, PathBuf},
};

use tiff::{
    TiffError,
    decoder::{Decoder, DecodingResult, DecodingSampleType, Limits},
    tags::Tag,
};
use volact_core::{
    LoadError, LoadOptions, ScalarType, VolumeDesc, VolumeReader,
    glam::DVec3,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, flag, name_of, spacing_given, spacing_option},
    payload::validate,
    png_series::{folder_confidence, series_option},
    series,
    slices::{SliceLayout, SliceReader, SliceSource},
    storage::{Input, Storage},
    world,
};

const EXTENSIONS: [&str; 2] = [".tif", ".tiff"];
/// LZW makes at most 4096 bytes of one code of 12 bits.
const MOST_RATIO: u64 = 4096;

/// The loader.
pub(crate) fn format() -> Format {
    Format::new("tiff", "TIFF: the pages of a file, or a numbered series of files, as slices", probe, open)
        .with(series_option())
        .with(spacing_option())
}

fn probe(probe: &Probe<'_>) -> Confidence {
    if probe.is_dir {
        return folder_confidence(probe, &EXTENSIONS);
    }
    let magic: [&[u8]; 4] = [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"];
    confidence(magic.iter().any(|m| probe.head.starts_with(m)), probe, &EXTENSIONS)
}

type Pages = Decoder<BufReader<Box<dyn Input>>>;

fn failed(path: &Path, error: TiffError) -> LoadError {
    let message = match &error {
        TiffError::IoError(e) if e.kind() == ErrorKind::UnexpectedEof => "the file ends too early".into(),
        // The source repeats the message, so that a chain would say it twice.
        other => other.to_string(),
    };
    LoadError::Decode { path: path.into(), source: message.into() }
}

fn decoder(storage: &Storage, path: &Path) -> Result<Pages, LoadError> {
    let size = storage.length(path)?;
    let decoder = Decoder::new(BufReader::new(storage.open(path)?)).map_err(|e| failed(path, e))?;
    let mut limits = Limits::default();
    limits.decoding_buffer_size = usize::try_from(size.saturating_mul(MOST_RATIO)).unwrap_or(usize::MAX);
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    limits.ifd_value_size = usize::try_from(size).unwrap_or(usize::MAX).min(1 << 28);
    Ok(decoder.with_limits(limits))
}

fn layout(path: &Path, size: u64, pages: &mut Pages) -> Result<SliceLayout, LoadError> {
    let fail = |e| failed(path, e);
    let unsupported =
        |what: String, cure: &str| Err(LoadError::Unsupported { path: path.into(), what, cure: cure.into() });
    let (width, height) = pages.dimensions().map_err(fail)?;
    let color = pages.colortype().map_err(fail)?;
    use tiff::ColorType as C;
    let components = match color {
        C::Gray(_) => 1,
        C::GrayA(_) => 2,
        C::RGB(_) => 3,
        C::RGBA(_) => 4,
        C::Multiband { num_samples, .. } => usize::from(num_samples),
        other => return unsupported(format!("colour type {other:?}"), "save it as grey or RGB"),
    };
    if components > 1 && pages.find_tag_unsigned::<u16>(Tag::PlanarConfiguration).map_err(fail)? == Some(2) {
        return unsupported("planar samples".into(), "save it with interleaved samples");
    }
    let bits = color.bit_depth();
    let scalar = match pages.image_buffer_layout().map_err(fail)?.sample_type {
        _ if ![8, 16, 32, 64].contains(&bits) => None,
        Some(DecodingSampleType::U8) => Some(ScalarType::U8),
        Some(DecodingSampleType::I8) => Some(ScalarType::I8),
        Some(DecodingSampleType::U16) => Some(ScalarType::U16),
        Some(DecodingSampleType::I16) => Some(ScalarType::I16),
        Some(DecodingSampleType::U32) => Some(ScalarType::U32),
        Some(DecodingSampleType::I32) => Some(ScalarType::I32),
        Some(DecodingSampleType::F16) => Some(ScalarType::F16),
        Some(DecodingSampleType::F32) => Some(ScalarType::F32),
        Some(DecodingSampleType::F64) => Some(ScalarType::F64),
        _ => None,
    };
    let Some(scalar) = scalar else {
        return unsupported(format!("a sample of {bits} bits"), "save it with 8, 16 or 32 bits");
    };
    let layout = SliceLayout { width, height, scalar, components };
    if layout.bytes() > size.saturating_mul(MOST_RATIO) {
        let what = format!("TIFF, enough for at most {} bytes of pixels", size.saturating_mul(MOST_RATIO));
        return Err(LoadError::Truncated { path: path.into(), what, found: size, wanted: layout.bytes() });
    }
    Ok(layout)
}

fn open(storage: &Storage, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let files = series::find(storage, path, &EXTENSIONS, flag(options, "series"))?;
    let mut first: Option<SliceLayout> = None;
    let mut count = 0;
    let mut spacing = DVec3::ONE;
    for file in &files {
        let size = storage.length(file)?;
        let mut pages = decoder(storage, file)?;
        let mut page = 0;
        loop {
            let own = layout(file, size, &mut pages)?;
            let shared = *first.get_or_insert(own);
            if own != shared {
                let what = format!("page {page}");
                return Err(LoadError::invalid(
                    file,
                    what,
                    own.describe(),
                    format!("{} as the first", shared.describe()),
                ));
            }
            if count == 0 {
                spacing = imagej(file, &mut pages)?;
            }
            page += 1;
            count += 1;
            if !pages.more_images() {
                break;
            }
            pages.next_image().map_err(|e| failed(file, e))?;
        }
        if files.len() > 1 && page > 1 {
            let found = format!("{page} pages");
            return Err(LoadError::invalid(file, "file of a series", found, "one page in each"));
        }
        if shared_bytes(first, page) > size.saturating_mul(MOST_RATIO) {
            let what = format!("TIFF, enough for at most {} bytes of pixels", size.saturating_mul(MOST_RATIO));
            return Err(LoadError::Truncated {
                path: file.clone(),
                what,
                found: size,
                wanted: shared_bytes(first, page),
            });
        }
    }
    let Some(layout) = first else {
        return Err(LoadError::invalid(path, "pages", 0, "at least one"));
    };
    let dims = [layout.width as usize, layout.height as usize, count];
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, layout.scalar, layout.components) };
    let spacing = spacing_given(options).unwrap_or(spacing);
    world::place_spaced(path, "spacing", &mut desc, world::AXES, spacing.to_array(), DVec3::ZERO)?;
    validate(path, &desc)?;
    let source = Stack { storage: storage.clone(), files, layout, open: None };
    Ok(Box::new(SliceReader { path: path.into(), desc, warnings: Vec::new(), source }))
}

fn shared_bytes(layout: Option<SliceLayout>, pages: u64) -> u64 {
    layout.map_or(0, |l| l.bytes().saturating_mul(pages))
}

/// The spacing that ImageJ writes: pixels per unit as resolution, `spacing=` in the description.
fn imagej(path: &Path, pages: &mut Pages) -> Result<DVec3, LoadError> {
    let description = pages.get_tag_ascii_string(Tag::ImageDescription).unwrap_or_default();
    if !description.starts_with("ImageJ=") {
        return Ok(DVec3::ONE);
    }
    let get = |key: &str| description.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    for key in ["channels", "frames"] {
        if let Some(n) = get(key).filter(|n| *n != "1") {
            let cure = "save each channel and frame as its own stack".into();
            return Err(LoadError::Unsupported { path: path.into(), what: format!("a hyperstack of {n} {key}"), cure });
        }
    }
    if let Some(n) = get("images").filter(|n| *n != "1" && !pages.more_images()) {
        let cure = "save it as pages".into();
        return Err(LoadError::Unsupported {
            path: path.into(),
            what: format!("a stack of {n} images in one page"),
            cure,
        });
    }
    let mut per_unit = |tag| pages.get_tag_f64(tag).ok().filter(|r| r.is_finite() && *r > 0.0);
    let z: Option<f64> =
        get("spacing").and_then(|s| s.trim().parse().ok()).filter(|s: &f64| s.is_finite() && *s != 0.0);
    Ok(match (per_unit(Tag::XResolution), per_unit(Tag::YResolution), z) {
        (Some(x), Some(y), Some(z)) => DVec3::new(1.0 / x, 1.0 / y, z.abs()),
        _ => DVec3::ONE,
    })
}

struct Stack {
    storage: Storage,
    files: Vec<PathBuf>,
    layout: SliceLayout,
    /// The decoder of the one file, if there is only one.
    open: Option<Pages>,
}

impl SliceSource for Stack {
    fn slice(&mut self, z: usize) -> Result<Vec<u8>, LoadError> {
        let single = self.files.len() == 1;
        let path = if single { &self.files[0] } else { &self.files[z] };
        let fail = |e| failed(path, e);
        let mut pages = match self.open.take() {
            Some(pages) => pages,
            None => decoder(&self.storage, path)?,
        };
        if single {
            pages.seek_to_image(z).map_err(fail)?;
        }
        let own = layout(path, self.storage.length(path)?, &mut pages)?;
        if own != self.layout {
            return Err(LoadError::invalid(path, format!("page {z}"), own.describe(), self.layout.describe()));
        }
        let bytes = native(pages.read_image().map_err(fail)?);
        if single {
            self.open = Some(pages);
        }
        Ok(bytes)
    }
}

fn native(result: DecodingResult) -> Vec<u8> {
    use bytemuck::cast_slice;
    match result {
        DecodingResult::U8(v) => v,
        DecodingResult::U16(v) => cast_slice(&v).to_vec(),
        DecodingResult::U32(v) => cast_slice(&v).to_vec(),
        DecodingResult::U64(v) => cast_slice(&v).to_vec(),
        DecodingResult::F16(v) => v.iter().flat_map(|h| h.to_bits().to_ne_bytes()).collect(),
        DecodingResult::F32(v) => cast_slice(&v).to_vec(),
        DecodingResult::F64(v) => cast_slice(&v).to_vec(),
        DecodingResult::I8(v) => cast_slice(&v).to_vec(),
        DecodingResult::I16(v) => cast_slice(&v).to_vec(),
        DecodingResult::I32(v) => cast_slice(&v).to_vec(),
        DecodingResult::I64(v) => cast_slice(&v).to_vec(),
    }
}
