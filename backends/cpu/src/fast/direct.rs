//! What whole segments add where no table of one number says so: the volume's own components as
//! colour, and tables that apply to voxels instead of samples.
//!
//! Colour and opacity are found for sixteen positions at once and taken to the length of a whole
//! segment. Whatever else computes colours in batches can stand in this place.

use volact_core::{ScalarType, table::ResolvedTable, volume::Components};

use super::{
    classify::Units,
    dispatch,
    fetch::{Base, Voxels, cell_of},
    simd::{LANES, Unit, fused},
};

/// Straight colour and opacity.
type Rgba = [f32; 4];

/// How positions are classified.
#[derive(Clone, Debug)]
pub struct Direct {
    kind: Kind,
    units: Units,
    /// Length of a whole segment in unit distances.
    length: f64,
}

#[derive(Clone, Debug)]
enum Kind {
    /// Voxels are classified, then colour and opacity interpolated.
    Voxels(Classes),
    /// The components over a range.
    Components { meaning: Components, range: [f64; 2] },
}

/// A table for voxels.
#[derive(Clone, Debug)]
enum Classes {
    /// For each whole number from the first on.
    Each { first: i32, entries: Vec<Rgba> },
    /// By search.
    Found(ResolvedTable),
}

impl Direct {
    /// A table that applies to voxels, for segments of `length` unit distances.
    pub fn voxels(table: &ResolvedTable, voxels: &Voxels<'_>, units: Units, length: f64) -> Self {
        let classes = match voxels.scalar.limits() {
            Some([lo, hi]) if voxels.scalar.size() <= 2 && voxels.stored() => {
                let classify = |v: i32| table.classify(units.data(f64::from(v))).map(|v| v as f32);
                Classes::Each { first: lo as i32, entries: (lo as i32..=hi as i32).map(classify).collect() }
            }
            _ => Classes::Found(table.clone()),
        };
        Self { kind: Kind::Voxels(classes), units, length }
    }

    /// The components of a texture as they are meant, over its range.
    pub fn components(meaning: Components, range: [f64; 2], units: Units, length: f64) -> Self {
        Self { kind: Kind::Components { meaning, range }, units, length }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        match &self.kind {
            Kind::Voxels(Classes::Each { entries, .. }) => entries.len() * size_of::<Rgba>(),
            Kind::Voxels(Classes::Found(table)) => size_of_val(table.points()),
            Kind::Components { .. } => 0,
        }
    }

    /// What whole segments add at sixteen positions, in the lanes of `live`: premultiplied colour
    /// and opacity.
    pub fn entries(
        &self,
        (unit, voxels): (Unit, &Voxels<'_>),
        base: &Base,
        local: &[[f32; LANES]; 3],
        live: u32,
        out: &mut [Rgba; LANES],
    ) {
        let mut planes = [[0f32; LANES]; 4];
        match &self.kind {
            Kind::Components { meaning: meaning @ (Components::Intensity | Components::Luminance), range } => {
                let mut number = [0f32; LANES];
                dispatch::numbers(unit, voxels, base, local, &mut number);
                self.single(*meaning, *range, &number, &mut planes);
            }
            _ => self.lane_by_lane(voxels, base, local, live, &mut planes),
        }
        for (l, opacity) in planes[3].iter_mut().enumerate() {
            let some = live >> l & 1 == 1 && !opacity.is_nan();
            *opacity = if some { *opacity } else { 0.0 };
        }
        let mut opacity = [0f32; LANES];
        dispatch::absorbed(unit, &planes[3], self.length, &mut opacity);
        for (l, entry) in out.iter_mut().enumerate() {
            let a = opacity[l];
            // A colour that is no number goes with an opacity of nothing.
            *entry = if a > 0.0 { [planes[0][l] * a, planes[1][l] * a, planes[2][l] * a, a] } else { [0.0; 4] };
        }
    }

    fn single(&self, meaning: Components, range: [f64; 2], number: &[f32; LANES], planes: &mut [[f32; LANES]; 4]) {
        let (scale, offset) = self.normalise(range);
        for l in 0..LANES {
            let value = (number[l] * scale + offset).clamp(0.0, 1.0);
            let opacity = if meaning == Components::Luminance && !value.is_nan() { 1.0 } else { value };
            for (c, plane) in planes.iter_mut().enumerate() {
                plane[l] = if c == 3 { opacity } else { value };
            }
        }
    }

    /// From numbers to parts of a range.
    fn normalise(&self, [lo, hi]: [f64; 2]) -> (f32, f32) {
        let width = hi - lo;
        ((self.units.scale / width) as f32, ((self.units.offset - lo) / width) as f32)
    }

    fn lane_by_lane(
        &self,
        voxels: &Voxels<'_>,
        base: &Base,
        local: &[[f32; LANES]; 3],
        live: u32,
        planes: &mut [[f32; LANES]; 4],
    ) {
        for l in (0..LANES).filter(|l| live >> l & 1 == 1) {
            let at = [local[0][l], local[1][l], local[2][l]];
            let rgba = match &self.kind {
                Kind::Voxels(classes) => {
                    interpolate(voxels, base, at, |v| classes.classify(voxels.at(v[0], v[1], v[2]), self.units))
                }
                Kind::Components { meaning, range } => self.colour(voxels, base, at, *meaning, *range),
            };
            (0..4).for_each(|c| planes[c][l] = rgba[c]);
        }
    }

    fn colour(&self, voxels: &Voxels<'_>, base: &Base, at: [f32; 3], meaning: Components, range: [f64; 2]) -> Rgba {
        let (scale, offset) = self.normalise(range);
        let n = voxels.components;
        let raw = interpolate(voxels, base, at, |v| {
            let index = voxels.index(v[0], v[1], v[2]);
            if voxels.scalar == ScalarType::U8 {
                let bytes = &voxels.bytes[index..index + n];
                std::array::from_fn(|c| bytes.get(c).map_or(0.0, |&b| f32::from(b)))
            } else {
                std::array::from_fn(|c| if c < n { voxels.number(index + c) } else { 0.0 })
            }
        });
        let [r, g, b, a] = raw.map(|v| (v * scale + offset).clamp(0.0, 1.0));
        let [r, g, b, a] = match meaning {
            Components::LuminanceAlpha => [r, r, r, g],
            Components::Rgb => [r, g, b, 1.0],
            _ => [r, g, b, a],
        };
        if r.is_nan() || g.is_nan() || b.is_nan() { [f32::NAN; 4] } else { [r, g, b, a] }
    }
}

impl Classes {
    fn classify(&self, number: f32, units: Units) -> Rgba {
        match self {
            Self::Each { first, entries } => entries[(number as i32 - first) as usize],
            Self::Found(_) if number.is_nan() => [f32::NAN; 4],
            Self::Found(table) => table.classify(units.data(f64::from(number))).map(|v| v as f32),
        }
    }
}

/// Trilinear interpolation of what voxels are made into; NaN where one has weight.
#[inline(always)]
fn interpolate(voxels: &Voxels<'_>, base: &Base, local: [f32; 3], make: impl Fn([usize; 3]) -> Rgba) -> Rgba {
    let (low, step, f) = cell_of(voxels, base, local);
    let mix = |a: Rgba, b: Rgba, t: f32| -> Rgba { [0, 1, 2, 3].map(|c| fused(t, b[c] - a[c], a[c])) };
    let line = |y: usize, z: usize| {
        let a = make([low[0], y, z]);
        if f[0] == 0.0 { a } else { mix(a, make([low[0] + step[0], y, z]), f[0]) }
    };
    let plane = |z: usize| {
        let a = line(low[1], z);
        if f[1] == 0.0 { a } else { mix(a, line(low[1] + step[1], z), f[1]) }
    };
    let a = plane(low[2]);
    if f[2] == 0.0 { a } else { mix(a, plane(low[2] + step[2]), f[2]) }
}

/// 1 − (1 − a)^length, in f64: `ln` by the series of the inverse hyperbolic tangent, `exp` by
/// Taylor's; both to 1e-13, on plain arithmetic that compilers vectorise.
#[inline(always)]
pub fn absorbed(opacity: &[f32; LANES], length: f64, out: &mut [f32; LANES]) {
    for (out, &a) in out.iter_mut().zip(opacity) {
        let left = (1.0 - f64::from(a)).max(f64::MIN_POSITIVE);
        let y = (length * ln(left)).max(-700.0);
        let absorbed = 1.0 - exp(y);
        *out = if a >= 1.0 { 1.0 } else { absorbed as f32 };
    }
}

/// The natural logarithm of a positive, normal number.
#[inline(always)]
fn ln(x: f64) -> f64 {
    // As a power of two times a number between √½ and √2.
    let shifted = x.to_bits().wrapping_sub(std::f64::consts::FRAC_1_SQRT_2.to_bits());
    let power = (shifted as i64) >> 52;
    let m = f64::from_bits(x.to_bits().wrapping_sub((power << 52) as u64));
    let s = (m - 1.0) / (m + 1.0);
    let q = s * s;
    let mut sum = 1.0 / 15.0;
    for odd in [13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0] {
        sum = sum * q + 1.0 / odd;
    }
    2.0 * s * sum + power as f64 * std::f64::consts::LN_2
}

/// The exponential of a number between −700 and 0.
#[inline(always)]
fn exp(y: f64) -> f64 {
    // Adding 1.5·2⁵² rounds to whole numbers.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let n = y * std::f64::consts::LOG2_E + ROUND - ROUND;
    let r = y - n * std::f64::consts::LN_2;
    let mut sum = 1.0;
    for k in [12.0, 11.0, 10.0, 9.0, 8.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.0] {
        sum = 1.0 + sum * r / k;
    }
    sum * f64::from_bits(((n as i64 + 1023) << 52) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absorption_is_the_power() {
        for length in [1e-3, 0.5, 1.0, 7.3] {
            let a: [f32; LANES] = std::array::from_fn(|l| [0.0, 1e-7, 1e-3, 0.2, 0.5, 0.9, 0.999_999, 1.0][l % 8]);
            let mut found = [0f32; LANES];
            absorbed(&a, length, &mut found);
            for (found, a) in found.into_iter().zip(a) {
                let wanted = if a >= 1.0 { 1.0 } else { -(length * (-f64::from(a)).ln_1p()).exp_m1() };
                let error = (f64::from(found) - wanted).abs();
                assert!(error <= 1e-7 * wanted, "{a} over {length}: {found}, wanted {wanted}");
            }
        }
    }
}
