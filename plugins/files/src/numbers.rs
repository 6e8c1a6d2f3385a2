//! Arrays of numbers as the mesh formats have them, in native byte order.

use std::path::Path;

use volact_core::{Attribute, Buffer, LoadError, ScalarType, Warning, WarningCode};

use crate::{
    decode::parse_number,
    payload::{ByteOrder, swap_bytes},
};

/// The type of a stored number: one that the engine knows, or an integer of 64 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberType {
    Scalar(ScalarType),
    I64,
    U64,
}

impl NumberType {
    /// Bytes of one number.
    pub(crate) fn size(self) -> usize {
        match self {
            Self::Scalar(scalar) => scalar.size(),
            Self::I64 | Self::U64 => 8,
        }
    }

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Scalar(scalar) => scalar.name(),
            Self::I64 => "i64",
            Self::U64 => "u64",
        }
    }
}

/// An array of numbers.
#[derive(Clone, Debug)]
pub(crate) struct Numbers {
    pub(crate) kind: NumberType,
    pub(crate) data: Buffer,
}

impl Numbers {
    /// Bytes from a file as numbers; turned where its order is another.
    pub(crate) fn from_bytes(kind: NumberType, mut bytes: Vec<u8>, order: ByteOrder) -> Self {
        if order != ByteOrder::NATIVE {
            swap_bytes(&mut bytes, kind.size());
        }
        Self::from_native(kind, bytes)
    }

    /// Bytes in native order as numbers.
    pub(crate) fn from_native(kind: NumberType, bytes: Vec<u8>) -> Self {
        Self { kind, data: aligned(bytes, kind.size()) }
    }

    pub(crate) fn len(&self) -> usize {
        self.data.len() / self.kind.size()
    }

    /// A number, if it is an integer that 64 bits with a sign hold.
    pub(crate) fn integer(&self, index: usize) -> Option<i64> {
        let long = || self.data.bytes().get(index * 8..)?.get(..8)?.try_into().ok();
        match self.kind {
            NumberType::I64 => long().map(i64::from_ne_bytes),
            NumberType::U64 => long().and_then(|raw| i64::try_from(u64::from_ne_bytes(raw)).ok()),
            NumberType::Scalar(scalar) if !scalar.is_float() && index < self.len() => {
                Some(scalar.read(self.data.bytes(), index) as i64)
            }
            NumberType::Scalar(_) => None,
        }
    }

    /// Integers as indices of 32 bits, shared where they are such; what is none becomes the
    /// highest. `None` for fractions.
    pub(crate) fn indices(&self) -> Option<Buffer> {
        match self.kind {
            NumberType::Scalar(ScalarType::U32) => return Some(self.data.clone()),
            NumberType::Scalar(ScalarType::I32) => {
                let values: &[i32] = self.data.as_slice()?;
                if values.iter().all(|v| *v >= 0) {
                    return Some(self.data.clone());
                }
            }
            NumberType::Scalar(scalar) if scalar.is_float() => return None,
            _ => {}
        }
        let index = |i| self.integer(i).and_then(|v| u32::try_from(v).ok()).unwrap_or(u32::MAX);
        Some(Buffer::from_vec((0..self.len()).map(index).collect::<Vec<u32>>()))
    }

    /// The same numbers of a type that the engine knows. Integers of 64 bits become such of 32
    /// where all of them fit, else doubles; the second value counts those that are not exact.
    fn scalars(self) -> (ScalarType, Buffer, usize) {
        if let NumberType::Scalar(scalar) = self.kind {
            return (scalar, self.data, 0);
        }
        let all = |fits: fn(i64) -> bool| (0..self.len()).all(|i| self.integer(i).is_some_and(fits));
        let values = || (0..self.len()).map(|i| self.integer(i).unwrap_or(0));
        if all(|v| i32::try_from(v).is_ok()) {
            return (ScalarType::I32, Buffer::from_vec(values().map(|v| v as i32).collect::<Vec<_>>()), 0);
        }
        if all(|v| u32::try_from(v).is_ok()) {
            return (ScalarType::U32, Buffer::from_vec(values().map(|v| v as u32).collect::<Vec<_>>()), 0);
        }
        let mut rounded = 0;
        let mut double = |raw: &[u8]| {
            let raw: [u8; 8] = raw.try_into().unwrap_or_default();
            let (value, exact) = match self.kind {
                NumberType::U64 => {
                    let v = u64::from_ne_bytes(raw);
                    (v as f64, (v as f64) as u128 == u128::from(v))
                }
                _ => {
                    let v = i64::from_ne_bytes(raw);
                    (v as f64, (v as f64) as i128 == i128::from(v))
                }
            };
            rounded += usize::from(!exact);
            value
        };
        let doubles: Vec<f64> = self.data.bytes().chunks_exact(8).map(&mut double).collect();
        (ScalarType::F64, Buffer::from_vec(doubles), rounded)
    }

    /// The numbers as an attribute of that name, and what is worth knowing about it.
    pub(crate) fn attribute(
        self,
        path: &Path,
        file: &str,
        name: &str,
        components: usize,
        warnings: &mut Vec<Warning>,
    ) -> Result<Attribute, LoadError> {
        let (scalar, data, rounded) = self.scalars();
        if rounded > 0 {
            let message = format!("{rounded} integers of attribute {name:?} are rounded to doubles");
            warnings.push(Warning::new(WarningCode::FileContent, file, message));
        }
        Attribute::new(name, scalar, components, data)
            .map_err(|source| LoadError::Attribute { path: path.into(), source: Box::new(source) })
    }
}

/// A buffer that numbers of `size` bytes can be read from as such.
pub(crate) fn aligned(bytes: Vec<u8>, size: usize) -> Buffer {
    if bytes.as_ptr().addr().is_multiple_of(size) {
        return Buffer::from_vec(bytes);
    }
    let mut words = vec![0u64; bytes.len().div_ceil(8)];
    let length = bytes.len();
    bytemuck::cast_slice_mut(&mut words)[..length].copy_from_slice(&bytes);
    let buffer = Buffer::from_vec(words);
    buffer.slice(0..length).unwrap_or(buffer)
}

/// Appends a number given as text in native byte order; `false` if it is none of that type.
pub(crate) fn put_number(word: &str, kind: NumberType, out: &mut Vec<u8>) -> bool {
    match kind {
        NumberType::Scalar(scalar) => parse_number(word, scalar, out),
        NumberType::I64 => word.parse::<i64>().map(|v| out.extend_from_slice(&v.to_ne_bytes())).is_ok(),
        NumberType::U64 => word.parse::<u64>().map(|v| out.extend_from_slice(&v.to_ne_bytes())).is_ok(),
    }
}
