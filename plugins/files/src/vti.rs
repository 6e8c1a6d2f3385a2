//! VTK XML image data.
//!
//! # Reads
//! `.vti` with one piece: inline ASCII and base64, appended raw and base64; uncompressed, zlib and
//! LZ4; `header_type` UInt32 and UInt64; either byte order; `Origin`, `Spacing` and `Direction`. Of
//! compressed arrays only the blocks that a region needs are decoded.
//!
//! # Options
//! `array`: the name of the point array to read; the active scalars by default, else the first.
//!
//! # Limits
//! 64-bit integers, cell data, several pieces, and lzma compression are refused.

use std::path::{Path, PathBuf};

use volact_core::{
    Buffer, LoadError, LoadOptions, Progress, Region, ScalarType, VolumeDesc, VolumeReader, Warning,
    glam::{DMat3, DVec3},
    loader::{Confidence, Probe},
};

use crate::{
    fields,
    format::{Format, confidence, name_of, text},
    numbers::NumberType,
    payload::{
        ByteOrder, Encoding, GridReader, Part, Payload, advance, check_region, reserve, runs, swap_bytes, validate,
    },
    storage::Storage,
    vtk::array_option,
    vtk_blocks::{Blocks, Place, locate},
    vtk_xml::{self, Array, Attributes, Document, Piece},
    world,
};

/// The loader.
pub(crate) fn format() -> Format {
    Format::new("vti", "VTK XML image data (.vti)", probe, open).with(array_option())
}

fn probe(probe: &Probe<'_>) -> Confidence {
    confidence(vtk_xml::is_of_type(probe, "ImageData"), probe, &[".vti"])
}

fn scalar_type(path: &Path, array: &Array) -> Result<ScalarType, LoadError> {
    let wide = matches!(array.type_name.as_str(), "Int64" | "UInt64" | "String" | "Bit");
    if !wide && let NumberType::Scalar(scalar) = array.number_type(path)? {
        return Ok(scalar);
    }
    let cure = "convert it to 32-bit integers or to Float64".into();
    Err(LoadError::Unsupported { path: path.into(), what: format!("array type {:?}", array.type_name), cure })
}

fn open(storage: &Storage, path: &Path, options: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
    let document = vtk_xml::parse(storage, path, "ImageData", "only ImageData are volumes")?;
    let piece = match &document.pieces[..] {
        [piece] => piece,
        [] => return Err(LoadError::invalid(path, "element Piece", "missing", "one")),
        _ => {
            let (what, cure) = ("an image of several pieces".into(), "save it as one piece".into());
            return Err(LoadError::Unsupported { path: path.into(), what, cure });
        }
    };
    let array = choose(path, piece, text(options, "array"))?;
    let desc = describe(path, &document, piece, array)?;
    let wanted = desc.bytes().map_or(u64::MAX, |n| n as u64);
    let order = ByteOrder::big_if(document.big);
    let grid = |start: u64, encoded: u64, encoding| {
        let part = Part { path: path.into(), start, encoded, skip: 0, length: wanted };
        let payload = Payload {
            storage: storage.clone(),
            parts: vec![part],
            encoding,
            order,
            open_ended: true,
            significant: None,
        };
        GridReader::open(path, desc.clone(), payload, Vec::new())
    };
    match locate(storage, &document, array, wanted)? {
        Place::Text { start, end } => grid(start, end - start, Encoding::Ascii(desc.scalar)),
        Place::Raw { start, available } => grid(start, available, Encoding::Raw),
        Place::Blocks(blocks) => Ok(Box::new(BlockReader { path: path.into(), desc, blocks, order })),
    }
}

fn choose<'a>(path: &Path, piece: &'a Piece, wanted: Option<&str>) -> Result<&'a Array, LoadError> {
    let arrays = piece.arrays("PointData");
    let by_name = |name: &str| arrays.iter().find(|a| a.name == name);
    let names = || arrays.iter().map(|a| a.name.as_str()).collect::<Vec<_>>();
    if let Some(name) = wanted {
        let missing =
            || LoadError::invalid(path, "array", format!("among {:?}", names()), format!("one called {name:?}"));
        return by_name(name).ok_or_else(missing);
    }
    let active = piece.section("PointData").and_then(|s| s.attributes.get("Scalars")).and_then(by_name);
    match active.or(arrays.first()) {
        Some(array) => Ok(array),
        None if !piece.arrays("CellData").is_empty() => {
            let cure = "convert it to point data".into();
            Err(LoadError::Unsupported { path: path.into(), what: "cell data".into(), cure })
        }
        None => Err(LoadError::invalid(path, "array", "missing", "point data")),
    }
}

fn describe(path: &Path, document: &Document, piece: &Piece, array: &Array) -> Result<VolumeDesc, LoadError> {
    let grid = document.grid.as_ref().ok_or_else(|| LoadError::invalid(path, "element ImageData", "missing", "one"))?;
    let (whole, dims) = vtk_xml::extent(path, "WholeExtent", grid.get("WholeExtent"))?;
    let (own, _) = vtk_xml::extent(path, "Piece Extent", piece.attributes.get("Extent"))?;
    if whole != own {
        let wanted = format!("the whole, {whole:?}");
        return Err(LoadError::invalid(path, "Piece Extent", format!("{own:?}"), wanted));
    }
    let scalar = scalar_type(path, array)?;
    let components = array.components(path, "1 to 4")?;
    let mut desc = VolumeDesc { name: name_of(path), ..VolumeDesc::new(dims, scalar, components) };
    let spacing = numbers(path, grid, "Spacing", "three numbers")?.unwrap_or([1.0; 3]);
    let origin = numbers(path, grid, "Origin", "three numbers")?.unwrap_or([0.0; 3]);
    let direction: Option<[f64; 9]> = numbers(path, grid, "Direction", "nine numbers")?;
    // Written row by row.
    let matrix = direction.map_or(DMat3::IDENTITY, |d| DMat3::from_cols_array(&d).transpose());
    let directions = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let first = DVec3::new(whole[0] as f64, whole[2] as f64, whole[4] as f64);
    let origin = DVec3::from_array(origin) + matrix * (first * DVec3::from_array(spacing));
    world::place_spaced(path, "Direction", &mut desc, directions, spacing, origin)?;
    validate(path, &desc)?;
    Ok(desc)
}

fn numbers<const N: usize>(
    path: &Path,
    grid: &Attributes,
    name: &str,
    wanted: &str,
) -> Result<Option<[f64; N]>, LoadError> {
    grid.get(name).map(|text| fields::array(path, name, text, wanted)).transpose()
}

struct BlockReader {
    path: PathBuf,
    desc: VolumeDesc,
    blocks: Blocks,
    order: ByteOrder,
}

impl VolumeReader for BlockReader {
    fn desc(&self) -> &VolumeDesc {
        &self.desc
    }

    fn warnings(&self) -> &[Warning] {
        &[]
    }

    fn read_region(&mut self, region: Region, progress: &dyn Progress) -> Result<Buffer, LoadError> {
        check_region(&self.path, self.desc.dims, region)?;
        let sample = self.desc.components * self.desc.scalar.size();
        let total = region.dims().iter().product::<usize>() * sample;
        let mut out = Vec::new();
        let mut current: Option<(u64, Vec<u8>)> = None;
        for (mut start, length) in runs(self.desc.dims, region, sample) {
            let end = start + length as u64;
            while start < end {
                let n = start / self.blocks.full;
                let block = match current.take() {
                    Some((at, block)) if at == n => block,
                    _ => self.blocks.block(n)?,
                };
                if out.is_empty() {
                    out = reserve(&self.path, total)?;
                }
                let from = start - n * self.blocks.full;
                let take = (block.len() as u64 - from).min(end - start);
                out.extend_from_slice(&block[from as usize..(from + take) as usize]);
                start += take;
                current = Some((n, block));
                advance(&self.path, progress, out.len() as u64, total as u64)?;
            }
        }
        if self.order != ByteOrder::NATIVE {
            swap_bytes(&mut out, self.desc.scalar.size());
        }
        Ok(out.into())
    }
}
