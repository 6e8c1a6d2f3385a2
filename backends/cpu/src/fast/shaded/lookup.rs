//! A lookup table as programs ask for it: straight colour and opacity, or colour and extinction,
//! by values in data units.

#![expect(clippy::needless_range_loop, reason = "a lane indexes several arrays")]

use volact_core::table::ResolvedTable;

use crate::fast::{
    direct::ln,
    simd::LANES,
    sweep::{
        lane::Lane,
        piece::{Run, Sight, cut},
    },
};

/// Most control points that are found by comparing with each of them.
const FEW: usize = 24;
/// Bins between the first and the last control point, where there are more.
const BINS: usize = 1024;

/// A table of which each value's stretch between two control points is found without branches.
#[derive(Debug)]
pub struct Lookup {
    /// Values of the points, rising; after the last one infinity.
    values: Vec<f32>,
    /// By how many points are not above a value: the line of colour and opacity there, as its
    /// numbers at a value and their slopes.
    lines: Vec<[[f32; 4]; 2]>,
    /// The values at which the lines have these numbers.
    anchors: Vec<f32>,
    /// A point not after the one that follows the bin's values.
    bins: Vec<u32>,
    low: f32,
    scale: f32,
    unit: f64,
}

impl Lookup {
    /// A table with the length over which its opacity is the fraction absorbed.
    pub fn new(table: &ResolvedTable, unit: f64) -> Self {
        let points = table.points();
        let mut values: Vec<f32> = points.iter().map(|p| p.value as f32).collect();
        let rgba = |i: usize| {
            let p = &points[i];
            [p.color[0], p.color[1], p.color[2], p.opacity]
        };
        let last = points.len() - 1;
        let flat = |i: usize| [rgba(i).map(|v| v as f32), [0.0; 4]];
        let line = |i: usize| {
            let (a, b) = (rgba(i), rgba(i + 1));
            let width = f64::from(values[i + 1]) - f64::from(values[i]);
            let slope = [0, 1, 2, 3].map(|c| if width > 0.0 { ((b[c] - a[c]) / width) as f32 } else { 0.0 });
            [a.map(|v| v as f32), slope]
        };
        let mut lines = vec![flat(0)];
        lines.extend((0..last).map(line));
        lines.push(flat(last));
        let mut anchors = vec![values[0]];
        anchors.extend(&values);
        let (low, high) = (values[0], values[last]);
        let scale = BINS as f32 / (high - low);
        let scale = if scale.is_finite() && scale > 0.0 && points.len() > FEW { scale } else { 0.0 };
        let first = |bin: usize| {
            let value = low + bin as f32 / scale;
            values.partition_point(|v| *v < value).saturating_sub(2) as u32
        };
        let bins = if scale > 0.0 { (0..=BINS).map(first).collect() } else { vec![0] };
        values.push(f32::INFINITY);
        Self { values, lines, anchors, bins, low, scale, unit }
    }

    /// How many control points are not above sixteen values.
    #[inline(always)]
    fn places(&self, value: &[f32; LANES]) -> [usize; LANES] {
        let points = &self.values[..self.values.len() - 1];
        if points.len() <= FEW {
            let mut places = [0u32; LANES];
            for point in points {
                for l in 0..LANES {
                    places[l] += u32::from(value[l] >= *point);
                }
            }
            return places.map(|p| p as usize);
        }
        value.map(|value| {
            let bin = ((value - self.low) * self.scale) as usize;
            let mut after = self.bins[bin.min(self.bins.len() - 1)] as usize;
            while after < points.len() && points[after] <= value {
                after += 1;
            }
            after
        })
    }

    /// Straight colour and opacity of sixteen values, by number and lane; NaN for NaN.
    #[inline(always)]
    pub fn classify(&self, value: &[f32; LANES]) -> [[f32; LANES]; 4] {
        let places = self.places(value);
        let mut rgba = [[0f32; LANES]; 4];
        for l in 0..LANES {
            let ([from, slope], anchor) = (&self.lines[places[l]], self.anchors[places[l]]);
            // Infinite values stand beyond the last point, where nothing changes.
            let off = value[l].clamp(f32::MIN, f32::MAX) - anchor;
            for c in 0..4 {
                rgba[c][l] = from[c] + slope[c] * off;
            }
        }
        for l in 0..LANES {
            let unknown = value[l].is_nan();
            for row in &mut rgba {
                row[l] = if unknown { f32::NAN } else { row[l] };
            }
        }
        rgba
    }

    /// Extinctions of opacities: −ln(1 − a) over the unit distance; none for NaN.
    #[inline(always)]
    pub fn extinction(&self, opacity: &[f32; LANES]) -> [f32; LANES] {
        let mut out = [0f32; LANES];
        for (out, &a) in out.iter_mut().zip(opacity) {
            let a = f64::from(a);
            let sigma = -ln((1.0 - a).max(f64::MIN_POSITIVE)) / self.unit;
            let sigma = if a > 0.0 { sigma as f32 } else { 0.0 };
            *out = if a >= 1.0 { f32::INFINITY } else { sigma };
        }
        out
    }
}

/// What a table says of values: straight colour with opacity, or with extinction. Rows that nobody
/// wants are empty.
#[inline(always)]
pub fn classified(table: &Lookup, values: &[f32], out: &mut [&mut [f32]], medium: bool) {
    for (i, value) in values.as_chunks::<LANES>().0.iter().enumerate() {
        let mut rgba = table.classify(value);
        if medium {
            rgba[3] = table.extinction(&rgba[3]);
        }
        for (row, numbers) in out.iter_mut().zip(&rgba) {
            if let Some(to) = row.as_chunks_mut::<LANES>().0.get_mut(i) {
                *to = *numbers;
            }
        }
    }
}

/// A lookup table over segments on which the value runs evenly.
#[derive(Debug)]
pub struct Segments {
    /// The table.
    pub table: ResolvedTable,
    /// The length over which its opacity is the fraction absorbed.
    pub unit: f64,
}

impl Segments {
    /// The uniform medium that looks like a segment with values from `front` to `back` over a
    /// `length`: colour and extinction. NaN where a number is.
    pub fn medium(&self, [front, back, length]: [f32; 3]) -> [f32; 4] {
        let [front, back, length] = [front, back, length].map(f64::from);
        if front.is_nan() || back.is_nan() || !(length > 0.0) {
            return [f32::NAN; 4];
        }
        let (mut lane, mut cuts) = (Lane::default(), Vec::new());
        let run = Run { value: [front, back], table: &self.table };
        cut([0.0, length], run, None, self.unit, &mut cuts, &mut lane.pieces);
        let mut sight = Sight { color: [0.0; 4], depth: f64::INFINITY, threshold: 2.0 };
        lane.pass(&[], 0.0, &mut sight);
        let [r, g, b, a] = sight.color;
        if a > 0.0 {
            return [r / a, g / a, b / a, -(-a.min(1.0)).ln_1p() / length].map(|v| v as f32);
        }
        let [r, g, b, _] = self.table.classify(front);
        [r, g, b, 0.0].map(|v| v as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{ControlPoint, LookupTable};

    #[test]
    fn what_is_looked_up_is_the_table() {
        let point = |value: f64, opacity: f64| ControlPoint { value, color: [opacity, 0.5, 1.0 - opacity], opacity };
        let few = vec![point(-3.0, 0.0), point(0.0, 0.4), point(0.0, 0.9), point(0.01, 0.2), point(90.0, 1.0)];
        let mut many: Vec<_> = (0..60).map(|i| point(f64::from(i), f64::from(i % 7) / 7.0)).collect();
        many.insert(30, point(30.0, 1.0));
        for points in [few, many] {
            let table = LookupTable::from_points(points).unwrap().resolve([0.0, 1.0]);
            let lookup = Lookup::new(&table, 2.5);
            let extremes = [f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, f32::MAX, 0.0];
            let values: Vec<f32> = (-400..10_000).map(|i| i as f32 * 0.01).chain(extremes).collect();
            for value in values {
                let (found, wanted) = (lookup.classify(&[value; LANES]), table.classify(f64::from(value)));
                let found = found.map(|row| row[3]);
                assert!((0..4).all(|c| (f64::from(found[c]) - wanted[c]).abs() < 2e-4), "{value}: {found:?}");
                let (sigma, a) = (f64::from(lookup.extinction(&[found[3]; LANES])[0]), f64::from(found[3]));
                let wanted = if a >= 1.0 { f64::INFINITY } else { -(-a).ln_1p() / 2.5 };
                assert!(sigma == wanted || (sigma - wanted).abs() <= 2e-7 * wanted, "{value}: {sigma}, not {wanted}");
            }
            assert!(lookup.classify(&[f32::NAN; LANES])[3][0].is_nan());
            assert_eq!(lookup.extinction(&[f32::NAN; LANES])[0], 0.0);
        }
        let one = LookupTable::from_points([point(7.0, 0.3)]).unwrap().resolve([0.0, 1.0]);
        assert_eq!(Lookup::new(&one, 1.0).classify(&[1e30; LANES])[3][0], 0.3);
    }
}
