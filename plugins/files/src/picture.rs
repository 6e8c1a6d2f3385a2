//! Pictures: frames out as PNG, OpenEXR and NumPy, and pictures in to compare with.
//!
//! A file is written beside its place under another name and renamed when it is complete, so that
//! a reader never sees half a picture. No gamma is applied anywhere: numbers go out as they are.

use std::{
    ffi::OsString,
    fs,
    io::{BufReader, BufWriter, Read, Seek, Write},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use exr::prelude as ex;
use volact_core::{Frame, LoadError};

/// The most pixels of a picture that is read: 16384 squared.
const MOST_PIXELS: u64 = 1 << 28;

/// How a PNG is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PngOptions {
    /// Lays the background under the picture; else it is written with straight alpha.
    pub over_background: bool,
    /// Writes 16 bits a channel instead of 8.
    pub sixteen_bit: bool,
}

impl Default for PngOptions {
    fn default() -> Self {
        Self { over_background: true, sixteen_bit: false }
    }
}

/// A picture read from a file: RGBA as the file has it, row by row from the top.
///
/// PNG gives numbers from 0 to 1 with straight alpha; OpenEXR and NumPy files give what was
/// written: [`save_exr`] and [`save_npy`] write premultiplied colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// The pixels.
    pub rgba: Vec<[f32; 4]>,
}

/// Writes a frame as PNG: each channel is clamped to [0, 1], scaled to 255 (or 65535) and rounded.
/// NaN becomes 0.
///
/// # Errors
/// If the file cannot be written or the frame's size does not fit its pixels.
pub fn save_png(path: &Path, frame: &Frame, options: PngOptions) -> Result<(), LoadError> {
    let pixels = if options.over_background { frame.over_background() } else { frame.color.to_vec() };
    write_png(path, frame.width, frame.height, &pixels, options.sixteen_bit)
}

fn write_png(path: &Path, width: usize, height: usize, pixels: &[[f32; 4]], sixteen: bool) -> Result<(), LoadError> {
    let [w, h] = size(path, width, height, pixels)?;
    let mut bytes = Vec::with_capacity(pixels.len() * if sixteen { 8 } else { 4 });
    for pixel in pixels {
        for value in straight(*pixel) {
            if sixteen {
                bytes.extend_from_slice(&((value.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16).to_be_bytes());
            } else {
                bytes.push((value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8);
            }
        }
    }
    replace(path, |file| {
        let mut encoder = png::Encoder::new(BufWriter::new(file), w, h);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(if sixteen { png::BitDepth::Sixteen } else { png::BitDepth::Eight });
        let mut writer = encoder.write_header().map_err(|e| LoadError::write(path, e))?;
        writer.write_image_data(&bytes).map_err(|e| LoadError::write(path, e))?;
        writer.finish().map_err(|e| LoadError::write(path, e))
    })
}

/// Premultiplied to straight. Opaque colours are not touched by rounding.
fn straight([r, g, b, a]: [f32; 4]) -> [f32; 4] {
    if a > 0.0 && a != 1.0 { [r / a, g / a, b / a, a] } else { [r, g, b, a] }
}

/// Writes a frame as OpenEXR, premultiplied 32-bit floats without the background, uncompressed.
///
/// # Errors
/// As [`save_png`].
pub fn save_exr(path: &Path, frame: &Frame) -> Result<(), LoadError> {
    size(path, frame.width, frame.height, &frame.color)?;
    let pixel = |ex::Vec2(x, y): ex::Vec2<usize>| {
        let [r, g, b, a] = frame.color[y * frame.width + x];
        (r, g, b, a)
    };
    let channels = ex::SpecificChannels::rgba(pixel);
    let layer = ex::Layer::new(
        (frame.width, frame.height),
        ex::LayerAttributes::default(),
        ex::Encoding::UNCOMPRESSED,
        channels,
    );
    use ex::WritableImage;
    replace(path, |file| {
        let image = ex::Image::from_layer(layer);
        image.write().non_parallel().to_buffered(BufWriter::new(file)).map_err(|e| LoadError::write(path, e))
    })
}

/// Writes a frame as NumPy file: float32, height × width × 4, premultiplied, without the
/// background.
///
/// # Errors
/// As [`save_png`].
pub fn save_npy(path: &Path, frame: &Frame) -> Result<(), LoadError> {
    size(path, frame.width, frame.height, &frame.color)?;
    let (width, height) = (frame.width, frame.height);
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}, 4), }}");
    // Magic, version and length take ten bytes; the data begin at a multiple of 64.
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    replace(path, |file| {
        let mut out = BufWriter::new(file);
        let mut write = |bytes: &[u8]| out.write_all(bytes).map_err(|e| LoadError::write(path, e));
        write(b"\x93NUMPY\x01\x00")?;
        write(&(header.len() as u16).to_le_bytes())?;
        write(header.as_bytes())?;
        for value in frame.color.iter().flatten() {
            write(&value.to_le_bytes())?;
        }
        out.flush().map_err(|e| LoadError::write(path, e))
    })
}

/// Reads a PNG, OpenEXR or NumPy picture, known by its first bytes.
///
/// # Errors
/// If the file is none of these, is damaged, or has more than 2^28 pixels.
pub fn load_picture(path: &Path) -> Result<Picture, LoadError> {
    let mut file = fs::File::open(path).map_err(|e| LoadError::io(path, e))?;
    let mut head = Vec::new();
    (&mut file).take(8).read_to_end(&mut head).map_err(|e| LoadError::io(path, e))?;
    file.rewind().map_err(|e| LoadError::io(path, e))?;
    let file = BufReader::new(file);
    if head == b"\x89PNG\r\n\x1a\n" {
        read_png(path, file)
    } else if head.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        read_exr(path, file)
    } else if head.starts_with(b"\x93NUMPY") {
        read_npy(path, file)
    } else {
        let found = format!("\"{}\"", head.escape_ascii());
        Err(LoadError::invalid(path, "first bytes", found, "those of PNG, OpenEXR or NumPy"))
    }
}

fn read_png(path: &Path, file: BufReader<fs::File>) -> Result<Picture, LoadError> {
    let mut decoder = png::Decoder::new_with_limits(file, png::Limits { bytes: MOST_PIXELS as usize * 8 });
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::ALPHA);
    let mut reader = decoder.read_info().map_err(|e| LoadError::decode(path, e))?;
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    check_pixels(path, width as u64, height as u64)?;
    let bytes = reader.output_buffer_size().unwrap_or(usize::MAX);
    let mut data = crate::payload::reserve(path, bytes)?;
    data.resize(bytes, 0u8);
    let info = reader.next_frame(&mut data).map_err(|e| LoadError::decode(path, e))?;
    let values: Vec<f32> = match info.bit_depth {
        png::BitDepth::Sixteen => {
            data.chunks_exact(2).map(|b| f32::from(u16::from_be_bytes([b[0], b[1]])) / 65535.0).collect()
        }
        _ => data.iter().map(|b| f32::from(*b) / 255.0).collect(),
    };
    let rgba = match info.color_type {
        png::ColorType::GrayscaleAlpha => values.chunks_exact(2).map(|p| [p[0], p[0], p[0], p[1]]).collect(),
        _ => values.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect(),
    };
    Ok(Picture { width, height, rgba })
}

fn read_exr(path: &Path, file: BufReader<fs::File>) -> Result<Picture, LoadError> {
    use ex::{ReadChannels, ReadLayers};
    // The decoder asks for the pixels' memory after its headers; too many leave it empty.
    let create = |size: ex::Vec2<usize>, _: &ex::RgbaChannels| {
        let many = size.width() as u64 * size.height() as u64 > MOST_PIXELS;
        let rgba = if many { Vec::new() } else { vec![[0.0f32; 4]; size.width() * size.height()] };
        Picture { width: size.width(), height: size.height(), rgba }
    };
    let set = |picture: &mut Picture, at: ex::Vec2<usize>, (r, g, b, a): (f32, f32, f32, f32)| {
        if let Some(pixel) = picture.rgba.get_mut(at.y() * picture.width + at.x()) {
            *pixel = [r, g, b, a];
        }
    };
    let image = ex::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(create, set)
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(file)
        .map_err(|e| LoadError::decode(path, e))?;
    let picture = image.layer_data.channel_data.pixels;
    check_pixels(path, picture.width as u64, picture.height as u64)?;
    Ok(picture)
}

fn read_npy(path: &Path, mut file: BufReader<fs::File>) -> Result<Picture, LoadError> {
    let mut start = [0; 10];
    file.read_exact(&mut start).map_err(|e| LoadError::io(path, e))?;
    let mut header = vec![0; usize::from(u16::from_le_bytes([start[8], start[9]]))];
    file.read_exact(&mut header).map_err(|e| LoadError::io(path, e))?;
    let header = String::from_utf8_lossy(&header).into_owned();
    let wanted = "version 1.0, little-endian float32 in C order, height x width x 3 or 4";
    let bad = || LoadError::invalid(path, "NumPy header", format!("{:?}", header.trim()), wanted);
    let good = start[6..8] == [1, 0] && header.contains("'<f4'") && header.contains("'fortran_order': False");
    let shape = header.split_once("'shape': (").and_then(|(_, rest)| rest.split_once(')')).map(|(inside, _)| inside);
    let shape: Vec<u64> = shape.unwrap_or("").split(',').filter_map(|word| word.trim().parse().ok()).collect();
    let (&[height, width, channels @ (3 | 4)], true) = (&shape[..], good) else { return Err(bad()) };
    let wanted = check_pixels(path, width, height)? * 4 * channels;
    let mut bytes = Vec::new();
    file.take(wanted + 1).read_to_end(&mut bytes).map_err(|e| LoadError::io(path, e))?;
    if bytes.len() as u64 != wanted {
        let (what, found) = ("pixels".into(), bytes.len() as u64);
        return Err(LoadError::Truncated { path: path.into(), what, found, wanted });
    }
    let value = |p: &[u8], n: usize| f32::from_le_bytes([p[4 * n], p[4 * n + 1], p[4 * n + 2], p[4 * n + 3]]);
    // Without a fourth channel the picture is opaque.
    let pixel = |p: &[u8]| std::array::from_fn(|n| if 4 * n < p.len() { value(p, n) } else { 1.0 });
    let rgba = bytes.chunks_exact(4 * channels as usize).map(pixel).collect();
    Ok(Picture { width: width as usize, height: height as usize, rgba })
}

fn check_pixels(path: &Path, width: u64, height: u64) -> Result<u64, LoadError> {
    match width.checked_mul(height).filter(|n| (1..=MOST_PIXELS).contains(n)) {
        Some(pixels) => Ok(pixels),
        None => {
            let wanted = format!("1 to {MOST_PIXELS} pixels");
            Err(LoadError::invalid(path, "picture", format!("{width} x {height}"), wanted))
        }
    }
}

fn size(path: &Path, width: usize, height: usize, pixels: &[[f32; 4]]) -> Result<[u32; 2], LoadError> {
    let fits = width.checked_mul(height) == Some(pixels.len()) && !pixels.is_empty();
    match (u32::try_from(width), u32::try_from(height)) {
        (Ok(w), Ok(h)) if fits => Ok([w, h]),
        _ => {
            let found = format!("{width} x {height} with {} pixels", pixels.len());
            Err(LoadError::invalid(path, "picture", found, "as many pixels as its size says, at least one"))
        }
    }
}

/// The files that pictures are being written to, or `None` when no more may be begun.
static UNFINISHED: Mutex<Option<Vec<PathBuf>>> = Mutex::new(Some(Vec::new()));

/// For a program that is told to end: removes what was written of pictures that are not complete.
/// None can be written after that.
pub fn discard_unfinished() {
    let unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner).take();
    for path in unfinished.into_iter().flatten() {
        _ = fs::remove_file(path);
    }
}

/// Creates a file that [`discard_unfinished`] removes until it is finished.
fn begin(temporary: &Path) -> std::io::Result<fs::File> {
    let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    let Some(unfinished) = unfinished.as_mut() else { return Err(std::io::ErrorKind::Interrupted.into()) };
    let file = fs::File::create(temporary)?;
    unfinished.push(temporary.to_owned());
    Ok(file)
}

fn finish(temporary: &Path) {
    let mut unfinished = UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner);
    unfinished.iter_mut().for_each(|paths| paths.retain(|path| path != temporary));
}

/// Writes a file under a temporary name in the same folder and renames it when it is complete.
fn replace(path: &Path, write: impl FnOnce(&mut fs::File) -> Result<(), LoadError>) -> Result<(), LoadError> {
    let temporary = temporary_name(path);
    let result = begin(&temporary)
        .map_err(|e| LoadError::write(&temporary, e))
        .and_then(|mut file| {
            write(&mut file)?;
            file.sync_all().map_err(|e| LoadError::write(&temporary, e))
        })
        .and_then(|()| fs::rename(&temporary, path).map_err(|e| LoadError::write(path, e)));
    if result.is_err() {
        _ = fs::remove_file(&temporary);
    }
    finish(&temporary);
    result
}

fn temporary_name(path: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.tmp", std::process::id()));
    path.with_file_name(name)
}
