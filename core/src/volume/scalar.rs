//! The types of stored numbers.

use std::fmt;

/// The type of a stored number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names say it")]
pub enum ScalarType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    F16,
    F32,
    F64,
}

impl ScalarType {
    /// All scalar types.
    pub const ALL: [Self; 9] =
        [Self::U8, Self::I8, Self::U16, Self::I16, Self::U32, Self::I32, Self::F16, Self::F32, Self::F64];

    /// Bytes of one number.
    pub fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The name, e.g. `u16`.
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::F16 => "f16",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The type of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.name() == name)
    }

    /// Whether the type holds fractions.
    pub fn is_float(self) -> bool {
        matches!(self, Self::F16 | Self::F32 | Self::F64)
    }

    /// Lowest and highest number of an integer type; `None` for floats.
    pub fn limits(self) -> Option<[f64; 2]> {
        Some(match self {
            Self::U8 => [0.0, 255.0],
            Self::I8 => [-128.0, 127.0],
            Self::U16 => [0.0, 65535.0],
            Self::I16 => [-32768.0, 32767.0],
            Self::U32 => [0.0, f64::from(u32::MAX)],
            Self::I32 => [f64::from(i32::MIN), f64::from(i32::MAX)],
            Self::F16 | Self::F32 | Self::F64 => return None,
        })
    }

    /// Reads number `index` of `bytes`, which are in native byte order and need no alignment.
    ///
    /// # Panics
    /// If `bytes` has no such number.
    #[inline]
    pub fn read(self, bytes: &[u8], index: usize) -> f64 {
        macro_rules! get {
            ($t:ty, $n:literal) => {{
                let at = index * $n;
                let raw: [u8; $n] = bytes[at..at + $n].try_into().expect("slice of that length");
                <$t>::from_ne_bytes(raw)
            }};
        }
        match self {
            Self::U8 => f64::from(bytes[index]),
            Self::I8 => f64::from(bytes[index] as i8),
            Self::U16 => f64::from(get!(u16, 2)),
            Self::I16 => f64::from(get!(i16, 2)),
            Self::U32 => f64::from(get!(u32, 4)),
            Self::I32 => f64::from(get!(i32, 4)),
            Self::F16 => get!(half::f16, 2).to_f64(),
            Self::F32 => f64::from(get!(f32, 4)),
            Self::F64 => get!(f64, 8),
        }
    }
}

impl fmt::Display for ScalarType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
