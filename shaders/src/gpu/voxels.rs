//! How voxels lie in a texture: its format, what its numbers mean, and the bytes.

use std::borrow::Cow;

use volact_core::{ActionError, ScalarType, Volume, mutated, volume::VolumeDesc};

/// The type of a texture's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Texel {
    /// 8 bits for 0 to 1.
    Unorm8,
    /// 16 bits for 0 to 1.
    Unorm16,
    /// Half precision.
    Float16,
    /// Single precision.
    Float32,
}

impl Texel {
    /// Bytes of one number.
    pub fn size(self) -> usize {
        match self {
            Self::Unorm8 => 1,
            Self::Unorm16 | Self::Float16 => 2,
            Self::Float32 => 4,
        }
    }
}

/// What is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wanted {
    /// The smallest that holds the data's numbers to the bit, or single precision.
    #[default]
    Exact,
    /// This one, whatever it loses.
    Texel(Texel),
}

impl Wanted {
    /// Words that name what can be asked for: the choices of an action's option.
    pub const WORDS: [&str; 5] = ["auto", "r8", "r16", "r16f", "r32f"];

    /// What a word asks for.
    pub fn named(word: &str) -> Self {
        match word {
            "r8" => Self::Texel(Texel::Unorm8),
            "r16" => Self::Texel(Texel::Unorm16),
            "r16f" => Self::Texel(Texel::Float16),
            "r32f" => Self::Texel(Texel::Float32),
            _ => Self::Exact,
        }
    }
}

/// What a texture's numbers are in data units: number × scale + offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// See above.
    pub scale: f64,
    /// See above.
    pub offset: f64,
}

/// How a volume lies in a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoding {
    /// The numbers' type.
    pub texel: Texel,
    /// Channels: 1, 2 or 4.
    pub channels: usize,
    /// What they mean.
    pub units: Units,
    code: Code,
}

/// How stored numbers become a texture's.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Code {
    /// As they are.
    Same,
    /// Signed whole numbers from their lowest on, so that small ones keep their digits in f32.
    Lifted { lowest: i32 },
    /// The lowest and the highest that occur become 0 and 1.
    Spread { low: f64, width: f64 },
}

impl Encoding {
    /// The encoding of a volume; `unorm16` tells whether the device has 16-bit formats of whole numbers.
    pub fn new(volume: &Volume, wanted: Wanted, unorm16: bool) -> Self {
        let desc = volume.desc();
        let channels = if desc.components == 3 { 4 } else { desc.components };
        let native = native(desc, unorm16);
        let plain = |texel, code, steps: f64, lowest: f64| {
            if mutated!("forgotten_slope") {
                return Self { texel, channels, units: Units { scale: steps, offset: lowest }, code };
            }
            let units = Units { scale: steps * desc.slope, offset: lowest * desc.slope + desc.intercept };
            Self { texel, channels, units, code }
        };
        let lifted = |texel, steps| {
            let lowest = lowest(volume);
            plain(texel, Code::Lifted { lowest }, steps, f64::from(lowest))
        };
        let chosen = match wanted {
            Wanted::Exact => native,
            Wanted::Texel(texel) => native.filter(|n| *n == texel),
        };
        match (chosen, desc.scalar) {
            (Some(texel), ScalarType::U8) => plain(texel, Code::Same, 255.0, 0.0),
            (Some(texel), ScalarType::I8) => lifted(texel, 255.0),
            (Some(texel), ScalarType::U16) => plain(texel, Code::Same, 65535.0, 0.0),
            (Some(texel), ScalarType::I16) => lifted(texel, 65535.0),
            (Some(texel), _) => plain(texel, Code::Same, 1.0, 0.0),
            (None, _) => {
                let texel = match wanted {
                    Wanted::Texel(Texel::Unorm16) if !unorm16 => Texel::Float32,
                    Wanted::Texel(texel) => texel,
                    Wanted::Exact => Texel::Float32,
                };
                let [low, high] = volume.value_range().unwrap_or([0.0, 1.0]);
                let width = if high > low { high - low } else { 1.0 };
                let units = Units { scale: width, offset: low };
                Self { texel, channels, units, code: Code::Spread { low, width } }
            }
        }
    }

    /// Whether the texture's numbers are the stored ones to the bit.
    pub fn is_exact(&self) -> bool {
        !matches!(self.code, Code::Spread { .. })
    }

    /// A name of the format, e.g. `rg16f`.
    pub fn name(&self) -> String {
        let channels = ["", "r", "rg", "rgb", "rgba"][self.channels];
        let texel = match self.texel {
            Texel::Unorm8 => "8",
            Texel::Unorm16 => "16",
            Texel::Float16 => "16f",
            Texel::Float32 => "32f",
        };
        format!("{channels}{texel}")
    }

    /// Refuses a volume of a shape that has no place in the format, or more samples along an axis than
    /// `most`, which an adapter has room for.
    ///
    /// # Errors
    /// [`ActionError::Limit`] or [`ActionError::Unsupported`] of an action.
    pub fn check(
        &self,
        (action, shape): (&str, &str),
        volume: &Volume,
        (adapter, most): (&str, u32),
    ) -> Result<(), ActionError> {
        let dims = volume.dims();
        if dims.iter().any(|n| *n > most as usize) {
            return Err(ActionError::Limit {
                action: action.into(),
                what: format!("size of volume {:?}", volume.name()),
                found: format!("{} × {} × {}", dims[0], dims[1], dims[2]),
                wanted: format!("at most {most} samples along an axis on adapter {adapter:?}; reduce it, or take cpu"),
            });
        }
        let (scalar, bytes) = (volume.desc().scalar, volume.data().bytes());
        let all_numbers = || (0..bytes.len() / scalar.size()).all(|i| scalar.read(bytes, i).is_finite());
        if scalar.is_float() && !self.holds_nan() && !all_numbers() {
            return Err(ActionError::Unsupported {
                action: action.into(),
                shape: shape.into(),
                what: format!("samples of volume {:?} that are no numbers in a format of whole numbers", volume.name()),
                cure: "set the option format to auto or r32f".into(),
            });
        }
        Ok(())
    }

    /// Whether a sample that is not a number could be told: whole numbers cannot.
    pub fn holds_nan(&self) -> bool {
        matches!(self.texel, Texel::Float16 | Texel::Float32)
    }

    /// Bytes of one sample.
    pub fn sample_bytes(&self) -> usize {
        self.channels * self.texel.size()
    }

    /// The texture's bytes of some whole slices of a volume.
    pub fn slices<'a>(&self, volume: &'a Volume, slices: std::ops::Range<usize>) -> Cow<'a, [u8]> {
        let desc = volume.desc();
        let numbers = desc.dims[0] * desc.dims[1] * desc.components;
        let stored = numbers * desc.scalar.size();
        let bytes = &volume.data().bytes()[slices.start * stored..slices.end * stored];
        if self.code == Code::Same && self.channels == desc.components {
            return Cow::Borrowed(bytes);
        }
        let samples = slices.len() * desc.dims[0] * desc.dims[1];
        let mut made = Vec::with_capacity(samples * self.sample_bytes());
        for sample in bytes.chunks_exact(desc.components * desc.scalar.size()) {
            for c in 0..self.channels {
                if c < desc.components {
                    self.push(&mut made, sample, c, desc);
                } else {
                    made.extend(std::iter::repeat_n(0, self.texel.size()));
                }
            }
        }
        Cow::Owned(made)
    }

    fn push(&self, made: &mut Vec<u8>, sample: &[u8], c: usize, desc: &VolumeDesc) {
        let size = desc.scalar.size();
        let own = &sample[c * size..(c + 1) * size];
        match self.code {
            Code::Same => made.extend_from_slice(own),
            Code::Lifted { lowest } => {
                let number = desc.scalar.read(sample, c) as i32 - lowest;
                match self.texel {
                    Texel::Unorm8 => made.push(number as u8),
                    _ => made.extend_from_slice(&(number as u16).to_ne_bytes()),
                }
            }
            Code::Spread { low, width } => {
                let value = desc.scalar.read(sample, c) * desc.slope + desc.intercept;
                let part = (value - low) / width;
                match self.texel {
                    Texel::Unorm8 => made.push((part.clamp(0.0, 1.0) * 255.0).round() as u8),
                    Texel::Unorm16 => {
                        made.extend_from_slice(&((part.clamp(0.0, 1.0) * 65535.0).round() as u16).to_ne_bytes());
                    }
                    Texel::Float16 => made.extend_from_slice(&half::f16::from_f64(part).to_ne_bytes()),
                    Texel::Float32 => made.extend_from_slice(&(part as f32).to_ne_bytes()),
                }
            }
        }
    }
}

/// The lowest stored number of a signed type.
fn lowest(volume: &Volume) -> i32 {
    let desc = volume.desc();
    let Some([a, b]) = volume.value_range() else { return 0 };
    let stored = [a, b].map(|v| ((v - desc.intercept) / desc.slope).round());
    stored[0].min(stored[1]) as i32
}

/// The texel that holds a volume's stored numbers to the bit.
fn native(desc: &VolumeDesc, unorm16: bool) -> Option<Texel> {
    match desc.scalar {
        ScalarType::U8 | ScalarType::I8 => Some(Texel::Unorm8),
        ScalarType::U16 | ScalarType::I16 => unorm16.then_some(Texel::Unorm16),
        ScalarType::F16 => Some(Texel::Float16),
        ScalarType::F32 => Some(Texel::Float32),
        ScalarType::U32 | ScalarType::I32 | ScalarType::F64 => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(scalar: ScalarType, components: usize, bytes: Vec<u8>) -> Volume {
        let count = bytes.len() / scalar.size() / components;
        let mut desc = VolumeDesc::new([count, 1, 1], scalar, components);
        (desc.slope, desc.intercept) = (2.0, -3.0);
        Volume::new(desc, bytes).unwrap()
    }

    /// The values that a texture's numbers stand for.
    fn values(volume: &Volume, encoding: &Encoding) -> Vec<f64> {
        let bytes = encoding.slices(volume, 0..1);
        let read = |chunk: &[u8]| match encoding.texel {
            Texel::Unorm8 => f64::from(chunk[0]) / 255.0,
            Texel::Unorm16 => f64::from(u16::from_ne_bytes([chunk[0], chunk[1]])) / 65535.0,
            Texel::Float16 => half::f16::from_ne_bytes([chunk[0], chunk[1]]).to_f64(),
            Texel::Float32 => f64::from(f32::from_ne_bytes(chunk.try_into().unwrap())),
        };
        let all = bytes.chunks_exact(encoding.texel.size()).map(read);
        all.map(|v| v * encoding.units.scale + encoding.units.offset).collect()
    }

    #[test]
    fn every_type_keeps_its_values() {
        for scalar in ScalarType::ALL {
            let bytes: Vec<u8> = match scalar {
                ScalarType::F16 => [-1.5, 0.25, 100.0].map(half::f16::from_f64).map(half::f16::to_ne_bytes).concat(),
                ScalarType::F32 => [-1.5f32, 0.25, 1e7].map(f32::to_ne_bytes).concat(),
                ScalarType::F64 => [-1.5f64, 0.25, 100.0].map(f64::to_ne_bytes).concat(),
                other => (0..3 * other.size()).map(|i| (i * 37 % 251) as u8).collect(),
            };
            let volume = volume(scalar, 1, bytes);
            for unorm16 in [false, true] {
                let encoding = Encoding::new(&volume, Wanted::Exact, unorm16);
                let [low, high] = volume.value_range().unwrap();
                for (i, found) in values(&volume, &encoding).into_iter().enumerate() {
                    let wanted = volume.value([i, 0, 0], 0);
                    let most = if encoding.is_exact() { 1e-12 } else { 6e-8 } * (high - low).max(wanted.abs());
                    assert!((found - wanted).abs() <= most, "{scalar} {i}: {found} {wanted}");
                }
            }
        }
    }

    #[test]
    fn three_components_become_four_channels() {
        let volume = volume(ScalarType::U8, 3, vec![1, 2, 3, 4, 5, 6]);
        let encoding = Encoding::new(&volume, Wanted::Exact, true);
        assert_eq!(&*encoding.slices(&volume, 0..1), [1, 2, 3, 0, 4, 5, 6, 0]);
    }

    #[test]
    fn coarse_formats_spread_over_the_values_that_occur() {
        let volume = volume(ScalarType::F32, 1, [1.0f32, 2.0, 5.0].map(f32::to_ne_bytes).concat());
        let encoding = Encoding::new(&volume, Wanted::Texel(Texel::Unorm8), true);
        for (found, wanted) in values(&volume, &encoding).into_iter().zip([-1.0, 1.0, 7.0]) {
            assert!((found - wanted).abs() <= 0.5 * 8.0 / 255.0, "{found} {wanted}");
        }
        assert!(!encoding.is_exact() && !encoding.holds_nan());
    }
}
