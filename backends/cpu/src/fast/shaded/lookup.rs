//! A lookup table as programs ask for it: straight colour and opacity, or colour and extinction,
//! by values in data units.

use volact_core::table::ResolvedTable;

use crate::fast::direct::ln;

/// Bins between the first and the last control point.
const BINS: usize = 1024;

/// A table whose control points are found by the bin of a value.
#[derive(Debug)]
pub struct Lookup {
    values: Vec<f32>,
    rgba: Vec<[f32; 4]>,
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
        let values: Vec<f32> = points.iter().map(|p| p.value as f32).collect();
        let rgba = points.iter().map(|p| [p.color[0], p.color[1], p.color[2], p.opacity].map(|v| v as f32)).collect();
        let (low, high) = (values[0], values[values.len() - 1]);
        let scale = BINS as f32 / (high - low);
        let scale = if scale.is_finite() && scale > 0.0 { scale } else { 0.0 };
        let first = |bin: usize| {
            let value = low + bin as f32 / scale;
            values.partition_point(|v| *v < value).saturating_sub(2) as u32
        };
        let bins = if scale > 0.0 { (0..=BINS).map(first).collect() } else { vec![0] };
        Self { values, rgba, bins, low, scale, unit }
    }

    /// Straight colour and opacity; NaN for NaN.
    #[inline(always)]
    pub fn classify(&self, value: f32) -> [f32; 4] {
        if value.is_nan() {
            return [f32::NAN; 4];
        }
        let bin = ((value - self.low) * self.scale) as usize;
        let mut after = self.bins[bin.min(self.bins.len() - 1)] as usize;
        while after < self.values.len() && self.values[after] <= value {
            after += 1;
        }
        if after == 0 || after == self.values.len() {
            return self.rgba[after.min(self.values.len() - 1)];
        }
        let (a, b) = (self.rgba[after - 1], self.rgba[after]);
        let (from, to) = (self.values[after - 1], self.values[after]);
        let t = (value - from) / (to - from);
        [0, 1, 2, 3].map(|c| a[c] + t * (b[c] - a[c]))
    }

    /// Extinction of an opacity: −ln(1 − a) over the unit distance; none for NaN.
    #[inline(always)]
    pub fn extinction(&self, opacity: f32) -> f32 {
        let a = f64::from(opacity);
        if a >= 1.0 {
            f32::INFINITY
        } else if a > 0.0 {
            (-ln(1.0 - a) / self.unit) as f32
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{ControlPoint, LookupTable};

    #[test]
    fn what_is_looked_up_is_the_table() {
        let point = |value: f64, opacity: f64| ControlPoint { value, color: [opacity, 0.5, 1.0 - opacity], opacity };
        let points = [point(-3.0, 0.0), point(0.0, 0.4), point(0.0, 0.9), point(0.01, 0.2), point(90.0, 1.0)];
        let table = LookupTable::from_points(points).unwrap().resolve([0.0, 1.0]);
        let lookup = Lookup::new(&table, 2.5);
        for i in -400..10_000 {
            let value = i as f32 * 0.01;
            let (found, wanted) = (lookup.classify(value), table.classify(f64::from(value)));
            assert!((0..4).all(|c| (f64::from(found[c]) - wanted[c]).abs() < 2e-4 && !found[c].is_nan()), "{value}");
            let (sigma, a) = (f64::from(lookup.extinction(found[3])), f64::from(found[3]));
            let wanted = if a >= 1.0 { f64::INFINITY } else { -(-a).ln_1p() / 2.5 };
            assert!(sigma == wanted || (sigma - wanted).abs() <= 2e-7 * wanted, "{value}: {sigma}, wanted {wanted}");
        }
        assert!(lookup.classify(f32::NAN)[3].is_nan());
        assert_eq!(lookup.extinction(f32::NAN), 0.0);
        let one = LookupTable::from_points([point(7.0, 0.3)]).unwrap().resolve([0.0, 1.0]);
        assert_eq!(Lookup::new(&one, 1.0).classify(1e30)[3], 0.3);
    }
}
