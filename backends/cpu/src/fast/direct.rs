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
    simd::{LANES, Unit},
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
    /// For each number of at most 16 bits, by its bits.
    Each(Vec<Rgba>),
    /// By search.
    Found(Found),
}

/// A table whose control points are found by the bin of a value.
#[derive(Clone, Debug)]
struct Found {
    table: ResolvedTable,
    /// A point not after the one that follows the bin's values.
    bins: Vec<u32>,
    low: f64,
    scale: f64,
}

/// Bins between the first and the last control point.
const BINS: usize = 1024;

impl Direct {
    /// A table that applies to voxels, for segments of `length` unit distances.
    pub fn voxels(table: &ResolvedTable, voxels: &Voxels<'_>, units: Units, length: f64) -> Self {
        let classes = match voxels.scalar.limits() {
            Some([lo, _]) if voxels.scalar.size() <= 2 && voxels.stored() => {
                let (signed, bits) = (lo < 0.0, 8 * voxels.scalar.size());
                let number = |raw: i32| if signed && raw >> (bits - 1) == 1 { raw - (1 << bits) } else { raw };
                let classify = |raw| table.classify(units.data(f64::from(number(raw)))).map(|v| v as f32);
                Classes::Each((0..1 << bits).map(classify).collect())
            }
            _ => Classes::Found(Found::new(table)),
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
            Kind::Voxels(Classes::Each(entries)) => size_of_val(entries.as_slice()),
            Kind::Voxels(Classes::Found(found)) => size_of_val(found.table.points()) + 4 * found.bins.len(),
            Kind::Components { .. } => 0,
        }
    }

    /// What whole segments add at sixteen positions, in the lanes of `live`: premultiplied colour
    /// and opacity.
    #[inline(always)]
    pub fn entries(
        &self,
        (unit, voxels): (Unit, &Voxels<'_>),
        base: &Base,
        local: &[[f32; LANES]; 3],
        live: u32,
        out: &mut [Rgba; LANES],
    ) {
        match &self.kind {
            Kind::Components { meaning: meaning @ (Components::Intensity | Components::Luminance), range } => {
                let mut number = [0f32; LANES];
                dispatch::numbers(unit, voxels, base, local, &mut number);
                self.single(*meaning, *range, &number, out);
            }
            Kind::Components { meaning, range } => self.colors(voxels, (base, local), (*meaning, *range), out),
            Kind::Voxels(classes) => self.classified(voxels, (base, local), classes, out),
        }
        let mut opacity = [0f32; LANES];
        for l in 0..LANES {
            let some = live >> l & 1 == 1 && !out[l][3].is_nan();
            opacity[l] = if some { out[l][3] } else { 0.0 };
        }
        let opacity = absorbed(&opacity, self.length);
        for (entry, a) in out.iter_mut().zip(opacity) {
            // A colour that is no number goes with an opacity of nothing.
            *entry = if a > 0.0 { [entry[0] * a, entry[1] * a, entry[2] * a, a] } else { [0.0; 4] };
        }
    }

    #[inline(always)]
    fn single(&self, meaning: Components, range: [f64; 2], number: &[f32; LANES], out: &mut [Rgba; LANES]) {
        let (scale, offset) = self.normalise(range);
        for (rgba, number) in out.iter_mut().zip(number) {
            let value = (number * scale + offset).clamp(0.0, 1.0);
            let opacity = if meaning == Components::Luminance && !value.is_nan() { 1.0 } else { value };
            *rgba = [value, value, value, opacity];
        }
    }

    /// From numbers to parts of a range.
    fn normalise(&self, [lo, hi]: [f64; 2]) -> (f32, f32) {
        let width = hi - lo;
        ((self.units.scale / width) as f32, ((self.units.offset - lo) / width) as f32)
    }

    #[inline(always)]
    fn colors(
        &self,
        voxels: &Voxels<'_>,
        at: (&Base, &[[f32; LANES]; 3]),
        (meaning, range): (Components, [f64; 2]),
        out: &mut [Rgba; LANES],
    ) {
        let n = voxels.components;
        if voxels.scalar == ScalarType::U8 && n == 4 && voxels.stored() {
            let bytes = voxels.bytes;
            interpolate(voxels, at, out, |i| [bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]].map(f32::from));
        } else {
            let number = |i: usize, c: usize| if c < n { voxels.number(i + c) } else { 0.0 };
            interpolate(voxels, at, out, |i| [number(i, 0), number(i, 1), number(i, 2), number(i, 3)]);
        }
        let (scale, offset) = self.normalise(range);
        for rgba in out {
            let [r, g, b, a] = rgba.map(|v| (v * scale + offset).clamp(0.0, 1.0));
            *rgba = match meaning {
                Components::LuminanceAlpha => [r, r, r, g],
                Components::Rgb => [r, g, b, 1.0],
                _ => [r, g, b, a],
            };
            if r.is_nan() || g.is_nan() || b.is_nan() {
                rgba[3] = f32::NAN;
            }
        }
    }

    #[inline(always)]
    fn classified(
        &self,
        voxels: &Voxels<'_>,
        at: (&Base, &[[f32; LANES]; 3]),
        classes: &Classes,
        out: &mut [Rgba; LANES],
    ) {
        let (bytes, c) = (voxels.bytes, voxels.component);
        let two = |i: usize| [bytes[2 * (i + c)], bytes[2 * (i + c) + 1]];
        match classes {
            Classes::Each(entries) => match voxels.scalar {
                // Numbers are looked up by their bits.
                ScalarType::U8 | ScalarType::I8 => {
                    interpolate(voxels, at, out, |i| entries[usize::from(bytes[i + c])]);
                }
                _ => interpolate(voxels, at, out, |i| entries[usize::from(u16::from_ne_bytes(two(i)))]),
            },
            Classes::Found(found) => {
                interpolate(voxels, at, out, |i| found.classify(self.units.data(f64::from(voxels.number(i + c)))));
            }
        }
    }
}

impl Found {
    /// A table for search, over the values of its points.
    fn new(table: &ResolvedTable) -> Self {
        let points = table.points();
        let (low, high) = (points[0].value, points[points.len() - 1].value);
        let scale = if high > low { BINS as f64 / (high - low) } else { 0.0 };
        let first = |bin: usize| {
            let value = low + bin as f64 / scale;
            points.partition_point(|p| p.value < value).saturating_sub(2) as u32
        };
        let bins = if scale > 0.0 && scale.is_finite() { (0..=BINS).map(first).collect() } else { vec![0] };
        Self { table: table.clone(), bins, low, scale }
    }

    fn classify(&self, value: f64) -> Rgba {
        if value.is_nan() {
            return [f32::NAN; 4];
        }
        let points = self.table.points();
        let bin = ((value - self.low) * self.scale) as usize;
        let mut after = self.bins[bin.min(self.bins.len() - 1)] as usize;
        while after < points.len() && points[after].value <= value {
            after += 1;
        }
        let rgba = |i: usize| {
            let p = &points[i];
            [p.color[0], p.color[1], p.color[2], p.opacity]
        };
        if after == 0 || after == points.len() {
            return rgba(after.min(points.len() - 1)).map(|v| v as f32);
        }
        let (a, b) = (rgba(after - 1), rgba(after));
        let t = (value - points[after - 1].value) / (points[after].value - points[after - 1].value);
        [0, 1, 2, 3].map(|c| (a[c] * (1.0 - t) + b[c] * t) as f32)
    }
}

/// Trilinear interpolation of what voxels are made into, given where their first number is; NaN
/// where one has weight.
#[inline(always)]
fn interpolate(
    voxels: &Voxels<'_>,
    (base, local): (&Base, &[[f32; LANES]; 3]),
    out: &mut [Rgba; LANES],
    make: impl Fn(usize) -> Rgba,
) {
    for (l, out) in out.iter_mut().enumerate() {
        let (low, step, f) = cell_of(voxels, base, [local[0][l], local[1][l], local[2][l]]);
        let start = voxels.index(low[0], low[1], low[2]);
        let x = step[0] * voxels.components;
        let y = step[1] * voxels.dims[0] * voxels.components;
        let z = step[2] * voxels.dims[0] * voxels.dims[1] * voxels.components;
        let line = |i: usize| mix(make(i), make(i + x), f[0]);
        let plane = |i: usize| mix(line(i), line(i + y), f[1]);
        *out = mix(plane(start), plane(start + z), f[2]);
    }
}

/// a + t·(b − a); `a` alone where `t` is 0.
#[inline(always)]
fn mix(a: Rgba, b: Rgba, t: f32) -> Rgba {
    if t == 0.0 { a } else { [0, 1, 2, 3].map(|c| a[c] + t * (b[c] - a[c])) }
}

/// 1 − (1 − a)^length, in f64: `ln` by the series of the inverse hyperbolic tangent, `exp` by
/// Taylor's; both to 1e-13, on plain arithmetic that compilers vectorise.
#[inline(always)]
fn absorbed(opacity: &[f32; LANES], length: f64) -> [f32; LANES] {
    let mut out = [0f32; LANES];
    for (out, &a) in out.iter_mut().zip(opacity) {
        let left = (1.0 - f64::from(a)).max(f64::MIN_POSITIVE);
        let y = (length * ln(left)).max(-700.0);
        let absorbed = 1.0 - exp(y);
        *out = if a >= 1.0 { 1.0 } else { absorbed as f32 };
    }
    out
}

/// The natural logarithm of a positive, normal number.
#[inline(always)]
pub fn ln(x: f64) -> f64 {
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
pub fn exp(y: f64) -> f64 {
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
    use volact_core::{ControlPoint, LookupTable};

    #[test]
    fn points_found_by_bins_are_those_found_by_search() {
        let point = |value: f64, opacity: f64| ControlPoint { value, color: [opacity, 0.5, 1.0 - opacity], opacity };
        let mut points: Vec<_> =
            (0..40).map(|i| point((f64::from(i) * 0.37).sin() * 50.0, f64::from(i % 7) / 7.0)).collect();
        points.extend([point(3.0, 0.1), point(3.0, 0.9), point(50.5, 0.2), point(50.5, 0.8)]);
        let table = LookupTable::from_points(points).unwrap().resolve([0.0, 1.0]);
        let found = Found::new(&table);
        let ends = table.points().iter().map(|p| p.value);
        for value in (-1200..1200).map(|i| f64::from(i) * 0.05).chain(ends).chain([-1e300, 1e300, f64::INFINITY]) {
            assert_eq!(found.classify(value), table.classify(value).map(|v| v as f32), "{value}");
        }
        assert!(found.classify(f64::NAN)[3].is_nan());
    }

    #[test]
    fn absorption_is_the_power() {
        for length in [1e-3, 0.5, 1.0, 7.3] {
            let a: [f32; LANES] = std::array::from_fn(|l| [0.0, 1e-7, 1e-3, 0.2, 0.5, 0.9, 0.999_999, 1.0][l % 8]);
            for (found, a) in absorbed(&a, length).into_iter().zip(a) {
                let wanted = if a >= 1.0 { 1.0 } else { -(length * (-f64::from(a)).ln_1p()).exp_m1() };
                let error = (f64::from(found) - wanted).abs();
                assert!(error <= 1e-7 * wanted, "{a} over {length}: {found}, wanted {wanted}");
            }
        }
    }
}
