//! How fast an action is on this machine: seconds of a frame by its samples.

use std::collections::BTreeMap;

/// A frame takes an overhead and so much a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rate {
    /// Seconds of a frame without samples.
    pub overhead: f64,
    /// Seconds a sample.
    pub sample: f64,
}

impl Rate {
    /// The time of a frame of so many samples.
    pub fn seconds(&self, samples: f64) -> f64 {
        self.overhead + self.sample * samples
    }

    /// The line through frames, samples and seconds, by least squares of relative errors; its overhead and slope
    /// are not negative. `None` without two different numbers of samples.
    pub fn fit(frames: &[(f64, f64)]) -> Option<Self> {
        // Weights of 1/t² make a millisecond of a short frame count as much as ten of a long one.
        let mut sums = [0.0; 5];
        for &(x, t) in frames.iter().filter(|(x, t)| x.is_finite() && *t > 0.0) {
            let w = 1.0 / (t * t);
            sums = [sums[0] + w, sums[1] + w * x, sums[2] + w * x * x, sums[3] + w * t, sums[4] + w * x * t];
        }
        let [w, x, xx, t, xt] = sums;
        let determinant = w * xx - x * x;
        if determinant <= 1e-12 * w * xx || determinant.is_nan() {
            return None;
        }
        let (overhead, sample) = ((xx * t - x * xt) / determinant, (w * xt - x * t) / determinant);
        Some(if overhead < 0.0 {
            Self { overhead: 0.0, sample: xt / xx }
        } else if sample < 0.0 {
            Self { overhead: t / w, sample: 0.0 }
        } else {
            Self { overhead, sample }
        })
    }
}

/// Rates by action and settings in words, as `volact calibrate` measures them.
#[derive(Clone, Debug, PartialEq)]
pub struct Rates(pub BTreeMap<String, Rate>);

impl Default for Rates {
    /// What ships: of one core at 2.6 GHz and of software Vulkan on it; ratios matter more than sizes, since
    /// frames correct them as they are drawn.
    fn default() -> Self {
        let rate = |(name, overhead, sample): (&str, f64, f64)| (name.to_owned(), Rate { overhead, sample });
        let known = [
            ("cpu", 4e-4, 4e-9),
            ("cpu classification=pre-integrated", 6e-4, 5e-9),
            ("reference", 1e-3, 1e-5),
            ("vulkan", 2e-2, 1e-7),
            ("wgpu", 1e-2, 5e-8),
        ];
        Self(known.map(rate).into_iter().collect())
    }
}

impl Rates {
    /// The rate of settings in words: theirs, else that of the longest beginning that is known.
    pub fn of(&self, setting: &str) -> Option<Rate> {
        let begins = |name: &str| setting == name || setting.strip_prefix(name).is_some_and(|r| r.starts_with(' '));
        let known = self.0.iter().filter(|(name, _)| begins(name));
        known.max_by_key(|(name, _)| name.len()).map(|(_, rate)| *rate)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_again() {
        let rate = Rate { overhead: 2e-3, sample: 3e-9 };
        let frames = [1e4, 1e6, 1e8].map(|n| (n, rate.seconds(n)));
        let found = Rate::fit(&frames).unwrap();
        assert!((found.overhead - 2e-3).abs() < 1e-9 && (found.sample - 3e-9).abs() < 1e-15, "{found:?}");
        assert_eq!(Rate::fit(&frames[..1]), None);
        let falling = Rate::fit(&[(1.0, 3.0), (2.0, 2.0)]).unwrap();
        assert!(falling.sample == 0.0 && falling.overhead > 0.0);
        let below = Rate::fit(&[(1.0, 1.0), (2.0, 4.0)]).unwrap();
        assert!(below.overhead == 0.0 && below.sample > 0.0);
    }

    #[test]
    fn the_longest_known_beginning_counts() {
        let rates = Rates::default();
        assert_eq!(rates.of("cpu classification=post"), rates.of("cpu"));
        assert_ne!(rates.of("cpu classification=pre-integrated"), rates.of("cpu"));
        assert_eq!(rates.of("cpus"), None);
    }
}
