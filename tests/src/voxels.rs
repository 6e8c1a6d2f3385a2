//! What it does to a picture that an action keeps voxels in a format with fewer digits than they have.
//!
//! Such a format moves each voxel by at most half a step, one way or the other. So the true picture is
//! drawn of volumes whose voxels are moved at random by as much, and twice the most that this changes any
//! pixel is allowed: roundings that all conspired would need more, and do not happen.

use volact_core::{
    Method, ParameterValue, ScalarType, Shape, Volume, VolumeDesc, VolumeTexture, resolve::ResolvedShape,
    volume::Components,
};

/// Volumes that are drawn.
pub const DRAWN: u64 = 3;

/// Half a step of a format.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Half {
    /// Of the way from the lowest to the highest value.
    OfRange(f64),
    /// Of each value.
    OfValue(f64),
}

/// The formats of a frame's textures, with the number that makes the noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    formats: String,
    seed: u64,
}

impl Noise {
    /// What stands for a frame's texture formats; `None` where they hold all digits of the shapes' volumes.
    pub fn of(method: &Method, shapes: &[Shape], seed: u64) -> Option<Self> {
        let noise = Self { formats: method.texture_format.clone(), seed };
        let coarse = |value: &ParameterValue| match value {
            ParameterValue::Volume(texture) => noise.half(texture).is_some(),
            _ => false,
        };
        shapes.iter().any(|s| s.state().parameters.values().any(coarse)).then_some(noise)
    }

    /// Half a step of the coarsest format that has fewer digits than a volume.
    fn half(&self, texture: &VolumeTexture) -> Option<Half> {
        let digits = digits(texture.volume().desc().scalar);
        halves(&self.formats).filter(|(bits, _)| *bits < digits).min_by_key(|(bits, _)| *bits).map(|(_, half)| half)
    }

    /// Moves the voxels of volumes whose type has more digits than the formats.
    pub fn add(&self, shape: &mut ResolvedShape) {
        for value in shape.parameters.values_mut() {
            if let ParameterValue::Volume(texture) = value
                && let Some(moved) = self.moved(texture)
            {
                *texture = moved;
            }
        }
    }

    fn moved(&self, texture: &VolumeTexture) -> Option<VolumeTexture> {
        let volume = texture.volume();
        let desc = volume.desc();
        let half = self.half(texture)?;
        let [low, high] = volume.value_range().unwrap_or([0.0, 1.0]);
        let (mut bytes, mut state) = (Vec::new(), self.seed);
        for index in 0..desc.samples()? * desc.components {
            let value = desc.scalar.read(volume.data().bytes(), index) * desc.slope + desc.intercept;
            let most = match half {
                Half::OfRange(part) => part * (high - low),
                Half::OfValue(part) => part * value.abs(),
            };
            bytes.extend((if up(&mut state) { value + most } else { value - most }).to_ne_bytes());
        }
        let plain = VolumeDesc { scalar: ScalarType::F64, slope: 1.0, intercept: 0.0, ..desc.clone() };
        let made = VolumeTexture::new(&Volume::new(plain, bytes).ok()?).with_data_roi(texture.data_roi()).ok()?;
        let made = made.with_geometry_roi(texture.geometry_roi()).ok()?.with_range(texture.range()).ok()?;
        let made = made.with_filter(texture.filter());
        Some(if texture.meaning() == Components::Luminance { made.as_luminance() } else { made })
    }
}

/// Digits and half steps of formats as frames name them: `r8`, `rgba16f`. Single precision is what
/// arithmetic has, and allowed with it.
fn halves(formats: &str) -> impl Iterator<Item = (u32, Half)> + '_ {
    formats.split(", ").filter_map(|name| match name.trim_start_matches(['r', 'g', 'b', 'a']) {
        "8" => Some((8, Half::OfRange(0.5 / 255.0))),
        "16" => Some((16, Half::OfRange(0.5 / 65_535.0))),
        "16f" => Some((11, Half::OfValue(0.5f64.powi(11)))),
        _ => None,
    })
}

/// Binary digits of a type.
fn digits(scalar: ScalarType) -> u32 {
    match scalar {
        ScalarType::U8 | ScalarType::I8 => 8,
        ScalarType::F16 => 11,
        ScalarType::U16 | ScalarType::I16 => 16,
        ScalarType::F32 => 24,
        ScalarType::U32 | ScalarType::I32 => 32,
        ScalarType::F64 => 53,
    }
}

/// A coin: SplitMix64 (G. Steele, D. Lea and C. Flood, OOPSLA 2014).
fn up(state: &mut u64) -> bool {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ z >> 31) & 1 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_move_by_half_a_step_of_formats_that_hold_fewer_digits() {
        let bytes: Vec<u8> = (0..8).flat_map(|i| (i as f32 * 100.0).to_ne_bytes()).collect();
        let volume = Volume::new(VolumeDesc::new([2, 2, 2], ScalarType::F32, 1), bytes).unwrap();
        let texture = VolumeTexture::new(&volume);
        let noise = |format: &str| Noise { formats: format.into(), seed: 1 }.moved(&texture);
        assert!(noise("r32f").is_none() && noise("").is_none());
        let moved = noise("r8, r16").unwrap();
        assert_eq!((moved.range(), moved.geometry_roi()), (texture.range(), texture.geometry_roi()));
        let off = |i: usize| moved.volume().value([i & 1, i >> 1 & 1, i >> 2], 0) - i as f64 * 100.0;
        assert!((0..8).all(|i| (off(i).abs() - 350.0 / 255.0).abs() < 1e-9));
        assert!((0..8).any(|i| off(i) > 0.0) && (0..8).any(|i| off(i) < 0.0));
        let whole = Volume::new(VolumeDesc::new([2, 1, 1], ScalarType::U8, 1), vec![3u8, 4]).unwrap();
        assert!(Noise { formats: "r8".into(), seed: 1 }.moved(&VolumeTexture::new(&whole)).is_none());
    }
}
