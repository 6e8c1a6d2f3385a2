//! Makes values from their descriptions and files.

use std::{fs, io::Read, path::Path};

use super::{
    AttributeSpec, AttributeValues, Folders, ParameterSpec, Problem, Problems, TableEntries, TableSpec, check,
    parameters, reader,
};
use crate::{Attribute, Buffer, LookupTable, ParameterDecl, ParameterValue, ScalarType};

/// The longest table or attribute file in bytes.
const MAX_FILE: u64 = 1 << 30;

/// What was found, and what was wanted.
pub(super) type Fault = (String, String);

impl ParameterSpec {
    /// Reads one value as a scene writes it.
    ///
    /// ```
    /// use volact_core::{ParameterValue, scene::ParameterSpec};
    ///
    /// let value = ParameterSpec::parse("(1, 0, 0)")?.to_value(None, std::path::Path::new(""))?;
    /// assert_eq!(value, ParameterValue::Vec3(volact_core::glam::DVec3::X));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// All problems.
    pub fn parse(text: &str) -> Result<Self, Problems> {
        reader::one(text, parameters::parameter)
    }

    /// Makes the value. Where `declared` wants a colour, three or four numbers are one.
    ///
    /// # Errors
    /// If a table or an attribute cannot be made, or the value is a volume or an attribute of the
    /// scene's data, which needs a scene.
    pub fn to_value<'a>(
        &self,
        declared: Option<&ParameterDecl>,
        folders: impl Into<Folders<'a>>,
    ) -> Result<ParameterValue, Problem> {
        let folders = folders.into();
        let wanted = || "a value that needs no data of a scene".to_owned();
        let made = match self {
            Self::Value(value) => Ok(declared.map_or(value.clone(), |decl| check::coerce(value, decl))),
            Self::Table(spec) => table(spec, folders).map(ParameterValue::Table),
            Self::Attribute(spec) => attribute(spec, folders).map(ParameterValue::Attribute),
            Self::Volume(_) => Err(("a volume".into(), wanted())),
            Self::DataAttribute(_) => Err(("an attribute of the scene's data".into(), wanted())),
        };
        made.map_err(|(found, wanted)| Problem::new(None, "", found, wanted))
    }
}

/// A lookup table.
fn table(spec: &TableSpec, folders: Folders) -> Result<LookupTable, Fault> {
    let fault = |error: crate::table::TableError| (error.to_string(), "a lookup table".to_owned());
    let table = match &spec.entries {
        TableEntries::Points(points) => LookupTable::from_points(points.clone()),
        TableEntries::Entries { values, domain } => LookupTable::from_entries(values.clone(), *domain),
        TableEntries::File { file, domain } => {
            let bytes = read(&folders.path(file)?, 16)?;
            LookupTable::from_entries(numbers(&bytes), *domain)
        }
        TableEntries::WindowLevel { window, level, opacity } => LookupTable::window_level(*window, *level, *opacity),
    };
    let table = table.map_err(fault)?;
    Ok(if spec.pre_interpolated { table.pre_interpolated() } else { table })
}

/// Per-vertex numbers.
fn attribute(spec: &AttributeSpec, folders: Folders) -> Result<Attribute, Fault> {
    let size = spec.scalar.size();
    let data = match &spec.values {
        AttributeValues::Inline(values) => {
            if !values.len().is_multiple_of(spec.components) {
                return Err((
                    format!("{} numbers", values.len()),
                    format!("a multiple of {} components", spec.components),
                ));
            }
            let mut bytes = Vec::with_capacity(values.len() * size);
            values.iter().for_each(|v| write(spec.scalar, *v, &mut bytes));
            bytes
        }
        AttributeValues::File(file) => {
            let mut bytes = read(&folders.path(file)?, size.saturating_mul(spec.components))?;
            if cfg!(target_endian = "big") {
                bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
            }
            bytes
        }
    };
    Ok(Attribute {
        name: spec.name.clone(),
        scalar: spec.scalar,
        components: spec.components,
        data: Buffer::from_vec(data),
    })
}

/// Appends a number as that type, in native byte order; integers are rounded and clamped.
fn write(scalar: ScalarType, value: f64, bytes: &mut Vec<u8>) {
    let whole = value.round();
    match scalar {
        ScalarType::U8 => bytes.extend((whole as u8).to_ne_bytes()),
        ScalarType::I8 => bytes.extend((whole as i8).to_ne_bytes()),
        ScalarType::U16 => bytes.extend((whole as u16).to_ne_bytes()),
        ScalarType::I16 => bytes.extend((whole as i16).to_ne_bytes()),
        ScalarType::U32 => bytes.extend((whole as u32).to_ne_bytes()),
        ScalarType::I32 => bytes.extend((whole as i32).to_ne_bytes()),
        ScalarType::F16 => bytes.extend(half::f16::from_f64(value).to_ne_bytes()),
        ScalarType::F32 => bytes.extend((value as f32).to_ne_bytes()),
        ScalarType::F64 => bytes.extend(value.to_ne_bytes()),
    }
}

/// Little-endian `f32`.
pub(super) fn numbers(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// A whole file, which must hold a multiple of `unit` bytes and not be endless.
pub(super) fn read(path: &Path, unit: usize) -> Result<Vec<u8>, Fault> {
    let io = |e: std::io::Error| (format!("{}: cannot be read: {e}", path.display()), "a file of numbers".to_owned());
    let mut bytes = Vec::new();
    fs::File::open(path).map_err(io)?.take(MAX_FILE + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > MAX_FILE || bytes.is_empty() || !bytes.len().is_multiple_of(unit.max(1)) {
        let found = format!("{}: {} bytes", path.display(), bytes.len());
        return Err((found, format!("a multiple of {unit} bytes, at most {MAX_FILE}")));
    }
    Ok(bytes)
}
