//! How far from linear in optical depth a table's colours are, over stretches of any width.
//!
//! Along a stretch of optical depth τ let x be the part of it that has been passed, c̄ the mean
//! colour and c₀, c₁ those at the ends. The colour taken is m(x) = c̄ + (c₁ − c₀)·(x − ½). What is
//! seen differs from the truth by ∫ (c − m)·τ·e^(−τx) dx. With D(x) = ∫₀ˣ (c − m) dx, which is 0
//! at both ends, that is by parts τ·∫ D·τ·e^(−τx) dx: at most τ·(1 − e^(−τ))·max |D|.
//!
//! The largest |D| is found for stretches of widths that are powers of two, and three quarters of
//! those, at many places; a stretch is looked up by its width and place.

/// Places looked at within a stretch, at most.
const PLACES: usize = 128;

/// The largest |D| of stretches.
#[derive(Clone, Debug)]
pub struct Bends {
    /// Level k has stretches of up to 2ᵏ intervals, by where they begin in blocks of 2ᵏ.
    levels: Vec<Vec<f32>>,
    /// The largest of all.
    pub most: f32,
    /// No stretch has more than this times its width in intervals.
    pub steep: f32,
    /// Whether anything is absorbed before the first and behind the last interval.
    beyond: [bool; 2],
    /// Where the last interval ends.
    end: f32,
}

/// Integrals up to a node: of extinction, and of it times each colour.
type Sums = [f64; 4];

impl Bends {
    /// From the integrals over intervals and their mean colours. Stretches that can never add
    /// `wrong` over a length of `diagonal` count as linear.
    pub fn new(intervals: &[(Sums, [f64; 3])], diagonal: f64, wrong: f64) -> Self {
        let mut sums = vec![[0.0; 4]];
        for (add, _) in intervals {
            let last = sums[sums.len() - 1];
            sums.push([0, 1, 2, 3].map(|c| last[c] + add[c]));
        }
        let count = intervals.len();
        let mut made = Self {
            levels: vec![vec![0.0; count]],
            most: 0.0,
            steep: 0.0,
            beyond: [0, count - 1].map(|i| intervals[i].0[0] > 0.0),
            end: count as f32,
        };
        for level in 1..=count.ilog2() + 1 {
            let block = 1usize << level;
            let mut worst = vec![0f32; count / block + 1];
            for width in [block, (3 * block).div_ceil(4)] {
                for start in (0..count).step_by((block / 4).max(1)) {
                    let end = (start + width).min(count);
                    let bend = bend(&sums, intervals, [start, end]);
                    let depth = diagonal * (sums[end][0] - sums[start][0]) / (end - start) as f64;
                    if depth * depth.min(1.0) * bend > wrong {
                        // One that begins a block is near what ends the block before, too.
                        for worst in &mut worst[start.saturating_sub(1) / block..=start / block] {
                            *worst = worst.max(bend as f32);
                        }
                    }
                }
            }
            let most = worst.iter().copied().fold(0.0, f32::max);
            made.most = made.most.max(most);
            made.steep = made.steep.max(most / (block / 2) as f32);
            made.levels.push(worst);
        }
        made
    }

    /// The largest |D| of stretches like the one between two numbers, counted in intervals.
    pub fn at(&self, numbers: [f32; 2]) -> f32 {
        let (low, high) = (numbers[0].min(numbers[1]), numbers[0].max(numbers[1]));
        if high <= 0.0 || low >= self.end {
            return 0.0;
        }
        // What goes on beyond with the look at the end is on no level.
        if low < -1.0 && self.beyond[0] || high > self.end + 1.0 && self.beyond[1] {
            return self.most;
        }
        let (low, high) = (low.max(0.0), high.min(self.end));
        // The next power of two, by the exponent.
        let level = ((high - low).max(1.0).to_bits() >> 23) as usize - 126;
        let level = level.min(self.levels.len() - 1);
        self.levels[level].get(low as usize >> level).copied().unwrap_or(0.0)
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.levels.iter().map(|l| size_of_val(l.as_slice())).sum()
    }
}

/// The largest |D| between two nodes, at some nodes in between.
fn bend(sums: &[Sums], intervals: &[(Sums, [f64; 3])], [start, end]: [usize; 2]) -> f64 {
    let first = sums[start];
    let whole = [0, 1, 2, 3].map(|c| sums[end][c] - first[c]);
    if whole[0] <= 0.0 {
        return 0.0;
    }
    let inverse = whole[0].recip();
    let (from, to) = (&intervals[start].1, &intervals[end - 1].1);
    let mut worst = 0f64;
    for here in sums[start..end].iter().step_by((end - start).div_ceil(PLACES)).skip(1) {
        let x = (here[0] - first[0]) * inverse;
        let curve = 0.5 * (x * x - x);
        for c in 0..3 {
            let taken = whole[c + 1] * inverse * x + (to[c] - from[c]) * curve;
            worst = worst.max(((here[c + 1] - first[c + 1]) * inverse - taken).abs());
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Intervals of even extinction, whose grey is a function of the place from 0 to 1.
    fn even(count: usize, sigma: f64, grey: impl Fn(f64) -> f64) -> Bends {
        let interval = |i: usize| {
            let grey = grey((i as f64 + 0.5) / count as f64);
            ([sigma, sigma * grey, sigma * grey, sigma * grey], [grey; 3])
        };
        Bends::new(&(0..count).map(interval).collect::<Vec<_>>(), 1.0, 1e-9)
    }

    #[test]
    fn colours_linear_in_depth_do_not_bend() {
        let bends = even(1024, 2.0, |x| 0.3 + 0.5 * x);
        // The colours at the ends are those in the middle of intervals.
        assert!(bends.most < 0.1, "{}", bends.most);
        assert!(bends.at([3.0, 1000.0]) < 1e-3 && bends.at([400.0, 300.0]) < 2e-3);
    }

    /// c = sin 2πx has the mean 0 and equal ends: D = (1 − cos 2πx)/2π, at most 1/π.
    #[test]
    fn a_wave_bends_by_its_integral() {
        let bends = even(1024, 2.0, |x| (std::f64::consts::TAU * x).sin());
        let whole = bends.at([0.0, 1024.0]);
        assert!((f64::from(whole) - std::f64::consts::FRAC_1_PI).abs() < 0.01, "{whole}");
        assert!(bends.at([0.0, 64.0]) < 0.01 && bends.at([1e9, 2e9]) == 0.0);
        assert!(bends.at([500.0, 1e9]) == bends.most && bends.steep * 1024.0 >= whole);
    }

    #[test]
    fn what_absorbs_nothing_does_not_bend() {
        assert_eq!(even(64, 0.0, |x| (9.0 * x).sin()).most, 0.0);
    }
}
