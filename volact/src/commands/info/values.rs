//! The values of a volume's component or a mesh's attribute: extremes, percentiles, histogram.

use volact::Volume;

/// The percentiles that are shown.
pub const PERCENTILES: [f64; 7] = [0.1, 1.0, 25.0, 50.0, 75.0, 99.0, 99.9];

/// What all voxels or vertices together say; in data units.
pub struct Values {
    /// Each finite value once, rising, with how many there are of it or, for wide types,
    /// every value with one.
    counts: Vec<(f64, u64)>,
    /// Lowest and highest finite value; zeros if there is none.
    pub range: [f64; 2],
    /// Mean of the finite values.
    pub mean: f64,
    /// The values at [`PERCENTILES`].
    pub percentiles: [f64; 7],
    /// Those that are infinite or no number.
    pub not_finite: u64,
}

impl Values {
    /// Looks at all voxels.
    pub fn new(volume: &Volume, component: usize) -> Self {
        let desc = volume.desc();
        let bytes = volume.data().bytes();
        let stored = (0..desc.samples().unwrap_or(0))
            .map(|sample| desc.scalar.read(bytes, sample * desc.components + component));
        let (counts, not_finite) = match desc.scalar.limits() {
            Some([lo, hi]) if hi - lo < 65536.0 => (count_narrow(stored, lo, hi), 0),
            _ => count_wide(stored),
        };
        let mut counts: Vec<_> = counts.into_iter().map(|(v, n)| (v * desc.slope + desc.intercept, n)).collect();
        if desc.slope < 0.0 {
            counts.reverse();
        }
        Self::from_counts(counts, not_finite)
    }

    /// Looks at numbers of any kind.
    pub fn of(numbers: impl Iterator<Item = f64>) -> Self {
        let (counts, not_finite) = count_wide(numbers);
        Self::from_counts(counts, not_finite)
    }

    fn from_counts(counts: Vec<(f64, u64)>, not_finite: u64) -> Self {
        let total: u64 = counts.iter().map(|(_, n)| n).sum();
        let sum: f64 = counts.iter().map(|(v, n)| v * *n as f64).sum();
        let ends = counts.first().zip(counts.last()).map_or([0.0; 2], |(a, b)| [a.0, b.0]);
        let percentiles = PERCENTILES.map(|p| percentile(&counts, total, p / 100.0));
        Self { counts, range: ends, mean: sum / total.max(1) as f64, percentiles, not_finite }
    }

    /// Counts over equal parts of the range.
    pub fn histogram(&self, bins: usize) -> Vec<u64> {
        let [lo, hi] = self.range;
        let mut histogram = vec![0; bins];
        for (v, n) in &self.counts {
            let bin = if hi > lo { (v - lo) / (hi - lo) * bins as f64 } else { 0.0 };
            histogram[(bin as usize).min(bins - 1)] += n;
        }
        histogram
    }

    /// The facts as rows of a table.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let list: Vec<_> = self.percentiles.iter().map(|v| super::number(*v)).collect();
        let names: Vec<_> = PERCENTILES.iter().map(|p| format!("{p}")).collect();
        let mut rows = vec![
            ("range", format!("{} to {}", super::number(self.range[0]), super::number(self.range[1]))),
            ("mean", super::number(self.mean)),
            ("percentiles", format!("{} at {} %", list.join(", "), names.join(", "))),
        ];
        if self.not_finite > 0 {
            rows.push(("not finite", format!("{} numbers", self.not_finite)));
        }
        rows
    }
}

fn count_narrow(stored: impl Iterator<Item = f64>, lo: f64, hi: f64) -> Vec<(f64, u64)> {
    let mut counts = vec![0u64; (hi - lo) as usize + 1];
    stored.for_each(|v| counts[(v - lo) as usize] += 1);
    counts.into_iter().enumerate().filter(|(_, n)| *n > 0).map(|(i, n)| (lo + i as f64, n)).collect()
}

fn count_wide(stored: impl Iterator<Item = f64>) -> (Vec<(f64, u64)>, u64) {
    let mut not_finite = 0;
    let mut values: Vec<f64> = stored
        .filter(|v| {
            not_finite += u64::from(!v.is_finite());
            v.is_finite()
        })
        .collect();
    values.sort_unstable_by(f64::total_cmp);
    (values.into_iter().map(|v| (v, 1)).collect(), not_finite)
}

/// The lowest value that at least a fraction of all do not exceed (nearest rank).
fn percentile(counts: &[(f64, u64)], total: u64, fraction: f64) -> f64 {
    let rank = ((fraction * total as f64).ceil() as u64).max(1);
    let mut seen = 0;
    let reached = counts.iter().find(|(_, n)| {
        seen += n;
        seen >= rank
    });
    reached.map_or(0.0, |(v, _)| *v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact::{ScalarType, VolumeDesc};

    #[test]
    fn narrow_and_wide_types_agree() {
        let bytes: Vec<u8> = (0..200u8).map(|i| i / 2).collect();
        let floats: Vec<f32> = bytes.iter().map(|&v| f32::from(v)).collect();
        let desc = |scalar| VolumeDesc::new([200, 1, 1], scalar, 1);
        let a = Values::new(&Volume::new(desc(ScalarType::U8), bytes).unwrap(), 0);
        let b = Values::new(&Volume::new(desc(ScalarType::F32), floats).unwrap(), 0);
        assert_eq!((a.range, a.mean, a.percentiles), (b.range, b.mean, b.percentiles));
        assert_eq!(a.histogram(10), b.histogram(10));
        assert_eq!((a.range, a.mean, a.percentiles[3]), ([0.0, 99.0], 49.5, 49.0));
    }

    #[test]
    fn a_negative_slope_keeps_values_rising() {
        let mut desc = VolumeDesc::new([4, 1, 1], ScalarType::U8, 1);
        (desc.slope, desc.intercept) = (-2.0, 10.0);
        let values = Values::new(&Volume::new(desc, vec![1u8, 2, 3, 4]).unwrap(), 0);
        assert_eq!((values.range, values.percentiles[0]), ([2.0, 8.0], 2.0));
    }

    #[test]
    fn what_is_not_finite_is_counted_apart() {
        let desc = VolumeDesc::new([3, 1, 1], ScalarType::F32, 1);
        let values = Values::new(&Volume::new(desc, vec![f32::NAN, 2.0, f32::INFINITY]).unwrap(), 0);
        assert_eq!((values.not_finite, values.range, values.histogram(2)), (2, [2.0, 2.0], vec![1, 0]));
        let desc = VolumeDesc::new([2, 1, 1], ScalarType::F32, 1);
        let values = Values::new(&Volume::new(desc, vec![f32::NAN; 2]).unwrap(), 0);
        assert_eq!((values.range, values.mean), ([0.0; 2], 0.0));
    }
}
