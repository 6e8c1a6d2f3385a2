//! What the voxels of a volume say about it: the numbers from which an appearance is chosen.

use std::collections::{BTreeMap, BTreeSet};

use volact_core::Volume;

/// Voxels looked at, about; more are strided over.
const WANTED: usize = 1_500_000;
/// Bins of the histogram in which modes and thresholds are sought.
pub(crate) const BINS: usize = 256;
/// More distinct values than this are no labels.
const MOST_LABELS: usize = 96;

/// A regular part of a volume's voxels, and what follows from them.
pub(crate) struct Statistics {
    /// Samples along each axis of the part.
    pub dims: [usize; 3],
    /// Voxels from one sample to the next.
    pub stride: usize,
    /// Values, x fastest; not-a-number where there is none or only padding.
    pub values: Vec<f32>,
    /// The finite values without padding, rising.
    pub sorted: Vec<f32>,
    /// The value with which the file fills what was not measured.
    pub padding: Option<f32>,
}

/// What surrounds the subject.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Background {
    /// The commonest value at the volume's faces.
    pub value: f64,
    /// Distance from it to the first value that is no longer background, positive: noise and
    /// whatever else surrounds the subject lie nearer.
    pub margin: f64,
    /// 1 where the subject's values lie above the background, −1 where below.
    pub sign: f64,
}

impl Background {
    /// How far a value lies from the background on the subject's side.
    pub fn distance(&self, value: f64) -> f64 {
        (value - self.value) * self.sign
    }

    /// The value at a distance.
    pub fn at(&self, distance: f64) -> f64 {
        self.value + self.sign * distance
    }
}

impl Statistics {
    /// Looks at a component of a volume. The same volume gives the same answer.
    pub fn new(volume: &Volume, component: usize) -> Self {
        let full = volume.dims();
        let all = full.iter().product::<usize>();
        let stride = (1..).find(|s| all / (s * s * s) <= WANTED).unwrap_or(1);
        let dims = full.map(|n| n.div_ceil(stride));
        let mut values = Vec::with_capacity(dims.iter().product());
        for z in 0..dims[2] {
            for y in 0..dims[1] {
                for x in 0..dims[0] {
                    values.push(volume.value([x * stride, y * stride, z * stride], component) as f32);
                }
            }
        }
        let mut sorted: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
        sorted.sort_by(f32::total_cmp);
        let padding = padding(&sorted);
        if let Some(padding) = padding {
            sorted.drain(..sorted.partition_point(|v| *v <= padding));
        }
        let measured = |v: &mut f32| {
            if !v.is_finite() || Some(*v) == padding {
                *v = f32::NAN;
            }
        };
        values.iter_mut().for_each(measured);
        Self { dims, stride, values, sorted, padding }
    }

    /// The value below which a fraction of the samples lie.
    pub fn percentile(&self, fraction: f64) -> f64 {
        let last = self.sorted.len().saturating_sub(1);
        self.sorted.get((fraction * last as f64).round() as usize).map_or(0.0, |&v| f64::from(v))
    }

    /// The distinct values, where the volume is a segmentation: few whole numbers, each in
    /// regions of its own, and neighbours that jump from any one to any other instead of climbing.
    pub fn labels(&self, volume: &Volume, component: usize) -> Option<BTreeSet<i64>> {
        let mut labels = BTreeSet::new();
        for &v in &self.sorted {
            if v.fract() != 0.0 || labels.len() > MOST_LABELS {
                return None;
            }
            labels.insert(v as i64);
        }
        // Two values are a mask, which has but one kind of step.
        let few = (2..=MOST_LABELS).contains(&labels.len());
        (few && self.in_regions(volume, component) && (labels.len() == 2 || self.jumps(&labels))).then_some(labels)
    }

    /// Whether most values mostly have their own kind beside them. Where surfaces are smooth, the
    /// values between two materials have not.
    fn in_regions(&self, volume: &Volume, component: usize) -> bool {
        let [nx, ny, _] = self.dims;
        let mut kinds: BTreeMap<i64, [usize; 2]> = BTreeMap::new();
        for (i, &value) in self.values.iter().enumerate().filter(|(_, v)| !v.is_nan()) {
            let at = [i % nx, i / nx % ny, i / (nx * ny)].map(|n| n * self.stride);
            let beside = if at[0] + 1 < volume.dims()[0] { at[0] + 1 } else { at[0].saturating_sub(1) };
            let same = volume.value([beside, at[1], at[2]], component) as f32 == value;
            let [all, alike] = kinds.entry(value as i64).or_default();
            *all += 1;
            *alike += usize::from(same);
        }
        let regions = kinds.values().filter(|[all, alike]| alike * 2 >= *all).count();
        regions * 10 >= kinds.len() * 7
    }

    /// Whether a fair part of the steps between neighbours leave out values that lie between.
    fn jumps(&self, labels: &BTreeSet<i64>) -> bool {
        let ranks: BTreeMap<i64, i64> = labels.iter().zip(0..).map(|(v, rank)| (*v, rank)).collect();
        let rank = |v: f32| ranks.get(&(v as i64)).copied();
        let (mut steps, mut jumps) = (0usize, 0usize);
        for row in self.values.chunks_exact(self.dims[0]) {
            for (a, b) in row.iter().zip(&row[1..]).filter(|(a, b)| a != b) {
                if let (Some(a), Some(b)) = (rank(*a), rank(*b)) {
                    steps += 1;
                    jumps += usize::from((a - b).abs() > 1);
                }
            }
        }
        jumps * 4 > steps
    }

    /// What surrounds the subject, from the samples on the volume's faces.
    pub fn background(&self) -> Background {
        let ends = |part: f64| [self.percentile(part), self.percentile(1.0 - part)];
        // Of a volume that is nearly all background only the extremes show that there is a subject.
        let [lo, hi] = Some(ends(0.001)).filter(|[lo, hi]| lo < hi).unwrap_or(ends(0.0));
        let border = Histogram::of(self.border(), lo, hi);
        // Noise may put the fullest bin anywhere in a broad peak; its median is its middle.
        let peak = border.mode();
        let mut around: Vec<f64> = self.border().filter(|v| (v - peak).abs() < 0.15 * (hi - lo)).collect();
        around.sort_by(f64::total_cmp);
        let mode = around.get(around.len() / 2).copied().unwrap_or(peak);
        // Noise is as wide above the mode as below; below nothing else is mixed in.
        let spread = |sign: f64| {
            let beyond = self.sorted.iter().map(|&v| (mode - f64::from(v)) * sign).filter(|d| *d >= 0.0);
            let mut beyond: Vec<f64> = beyond.collect();
            beyond.sort_by(f64::total_cmp);
            beyond.get(beyond.len() * 2 / 3).copied().unwrap_or(0.0)
        };
        let share = |side: f64| {
            let far = 0.1 * (hi - lo);
            self.sorted.iter().filter(|&&v| (f64::from(v) - mode) * side > far).count()
        };
        let sign = if share(1.0) >= share(-1.0) { 1.0 } else { -1.0 };
        let margin = (3.5 * spread(sign)).max(0.02 * (hi - lo)).min(0.3 * (hi - lo));
        let far = |v: f64| (v - mode) * sign;
        let all = self.sorted.iter().map(|&v| far(f64::from(v)).max(0.0));
        let split = Histogram::of(all, 0.0, far(lo).max(far(hi))).otsu();
        let margin = margin.max(0.85 * self.surroundings(far, split) + 0.15 * split);
        Background { value: mode, margin, sign }
    }

    /// Where several things surround the subject (air, and what was not scanned), the volume's
    /// faces show them all: how far from the background nine tenths of a face reach, at the
    /// middle one of the faces, of what is no subject.
    fn surroundings(&self, far: impl Fn(f64) -> f64, subject: f64) -> f64 {
        let mut reach = Vec::new();
        for face in (0..6).filter(|f| self.dims[f / 2] > 1) {
            let values = self.face(face / 2, face % 2).into_iter().map(f64::from).map(&far);
            let mut values: Vec<f64> = values.filter(|d| *d < subject).collect();
            values.sort_by(f64::total_cmp);
            reach.extend(values.get(values.len() * 9 / 10).map(|v| v.max(0.0)));
        }
        reach.sort_by(f64::total_cmp);
        reach.get(reach.len() / 2).copied().unwrap_or(0.0)
    }

    /// The values of the first or last layer along an axis.
    fn face(&self, axis: usize, side: usize) -> Vec<f32> {
        let [nx, ny, _] = self.dims;
        let layer = side * (self.dims[axis] - 1);
        let at = |i: usize| [i % nx, i / nx % ny, i / (nx * ny)][axis];
        let found = self.values.iter().enumerate().filter(|(i, v)| at(*i) == layer && !v.is_nan());
        found.map(|(_, v)| *v).collect()
    }

    fn border(&self) -> impl Iterator<Item = f64> {
        let [nx, ny, nz] = self.dims;
        let outer = |i: usize, n: usize| n > 1 && (i == 0 || i == n - 1);
        let on_face = move |i: usize| outer(i % nx, nx) || outer(i / nx % ny, ny) || outer(i / (nx * ny), nz);
        let found = self.values.iter().enumerate().filter(move |(i, v)| on_face(*i) && !v.is_nan());
        found.map(|(_, v)| f64::from(*v))
    }

    /// How long a line along an axis runs inside the samples that `inside` accepts, in samples:
    /// the median of the lines that meet any.
    pub fn chord(&self, axis: usize, inside: impl Fn(f64) -> bool) -> f64 {
        let [nx, ny, nz] = self.dims;
        let step = [1, nx, nx * ny][axis];
        let (a, b) = [(1, 2), (0, 2), (0, 1)][axis];
        let strides = [1, nx, nx * ny];
        let counts = [nx, ny, nz];
        let mut chords = Vec::new();
        for j in 0..counts[b] {
            for i in 0..counts[a] {
                let start = i * strides[a] + j * strides[b];
                let line = (0..counts[axis]).map(|k| f64::from(self.values[start + k * step]));
                chords.push(line.filter(|v| inside(*v)).count());
            }
        }
        chords.retain(|n| *n > 0);
        chords.sort_unstable();
        chords.get(chords.len() / 2).map_or(0.0, |n| *n as f64)
    }

    /// The box of the samples that `inside` accepts, first and last along each axis, leaving
    /// out stray samples: one in ten thousand at either end.
    pub fn extent(&self, inside: impl Fn(f64) -> bool) -> Option<[[usize; 2]; 3]> {
        let [nx, ny, _] = self.dims;
        let mut counts = self.dims.map(|n| vec![0usize; n]);
        for (i, _) in self.values.iter().enumerate().filter(|(_, v)| inside(f64::from(**v))) {
            let at = [i % nx, i / nx % ny, i / (nx * ny)];
            (0..3).for_each(|a| counts[a][at[a]] += 1);
        }
        let all: usize = counts[0].iter().sum();
        let range = |counts: &Vec<usize>| {
            let mut sum = 0;
            let sums: Vec<_> = counts
                .iter()
                .map(|n| {
                    sum += n;
                    sum
                })
                .collect();
            let at = |part: f64| sums.partition_point(|s| (*s as f64) <= part * all as f64).min(counts.len() - 1);
            [at(0.0001), at(0.9999)]
        };
        (all > 0).then(|| counts.each_ref().map(range))
    }
}

/// The lowest value, where it is a fill value: common, and far below all others.
fn padding(sorted: &[f32]) -> Option<f32> {
    let (&lowest, &highest) = (sorted.first()?, sorted.last()?);
    let filled = sorted.partition_point(|v| *v <= lowest);
    let next = *sorted.get(filled)?;
    let common = filled * 200 > sorted.len();
    let apart = f64::from(next) - f64::from(lowest) > 0.08 * (f64::from(highest) - f64::from(next));
    (common && apart && lowest < 0.0).then_some(lowest)
}

/// Counts over equal bins.
pub(crate) struct Histogram {
    pub lo: f64,
    pub hi: f64,
    pub counts: Vec<f64>,
}

impl Histogram {
    /// Counts values; those outside fall into the first and last bin.
    pub fn of(values: impl Iterator<Item = f64>, lo: f64, hi: f64) -> Self {
        let mut counts = vec![0.0; BINS];
        let scale = BINS as f64 / (hi - lo).max(f64::MIN_POSITIVE);
        for v in values {
            let bin = ((v - lo) * scale).clamp(0.0, (BINS - 1) as f64);
            counts[bin as usize] += 1.0;
        }
        Self { lo, hi, counts }
    }

    /// The middle of a bin.
    pub fn value(&self, bin: usize) -> f64 {
        self.lo + (bin as f64 + 0.5) / BINS as f64 * (self.hi - self.lo)
    }

    /// The commonest value.
    pub fn mode(&self) -> f64 {
        let (first, last) = (self.counts[0], self.counts[BINS - 1]);
        let bin = (0..BINS).max_by(|a, b| self.counts[*a].total_cmp(&self.counts[*b])).unwrap_or(0);
        match bin {
            0 if first > 0.0 => self.lo,
            b if b == BINS - 1 && last > 0.0 => self.hi,
            b => self.value(b),
        }
    }

    /// The value that best splits the counts in two (N. Otsu, *A threshold selection method from
    /// gray-level histograms*, IEEE Trans. SMC 9(1), 1979): the variance between the two classes
    /// is greatest.
    pub fn otsu(&self) -> f64 {
        let total = self.counts.iter().sum::<f64>().max(1.0);
        let mean = (0..BINS).map(|b| b as f64 * self.counts[b]).sum::<f64>() / total;
        let (mut below, mut sum, mut best) = (0.0, 0.0, (BINS / 2, 0.0));
        for b in 0..BINS - 1 {
            below += self.counts[b] / total;
            sum += b as f64 * self.counts[b] / total;
            if below > 0.0 && below < 1.0 {
                let between = (mean * below - sum).powi(2) / (below * (1.0 - below));
                if between > best.1 {
                    best = (b + 1, between);
                }
            }
        }
        self.lo + best.0 as f64 / BINS as f64 * (self.hi - self.lo)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn otsu_splits_two_heaps_between_them() {
        let values = (0..900).map(|i| 10.0 + f64::from(i % 5)).chain((0..100).map(|i| 80.0 + f64::from(i % 9)));
        let split = Histogram::of(values, 0.0, 100.0).otsu();
        assert!((14.0..80.0).contains(&split), "{split}");
    }

    #[test]
    fn mode_is_the_end_where_most_lie_there() {
        let values = [0.0, 0.0, 0.0, 0.4, 0.5, 1.0];
        assert_eq!(Histogram::of(values.into_iter(), 0.0, 1.0).mode(), 0.0);
    }

    #[test]
    fn padding_is_common_and_far_below() {
        let scan: Vec<f32> = (0..1000).map(|i| -1000.0 + 2.0 * i as f32).collect();
        let with = |low: f32, n: usize| [vec![low; n], scan.clone()].concat();
        assert_eq!(padding(&with(-1500.0, 100)), Some(-1500.0));
        assert_eq!(padding(&with(-1500.0, 1)), None);
        assert_eq!(padding(&with(-1001.0, 100)), None);
        assert_eq!(padding(&[]), None);
    }
}
