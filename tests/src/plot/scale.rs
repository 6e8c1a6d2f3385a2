//! Logarithmic scales: from numbers to places, ticks, and how they are written.

/// How numbers of an axis are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Powers of ten as such, others as they are.
    Plain,
    /// Times: µs, ms, s.
    Seconds,
}

impl Unit {
    /// A tick's text.
    pub fn tick(self, value: f64) -> String {
        match self {
            Self::Seconds => match value {
                v if v < 0.999e-3 => format!("{} µs", short(v * 1e6)),
                v if v < 0.999 => format!("{} ms", short(v * 1e3)),
                v => format!("{} s", short(v)),
            },
            Self::Plain => {
                let power = value.log10().round();
                if (value / 10f64.powf(power) - 1.0).abs() < 1e-9 && !(-2.0..=3.0).contains(&power) {
                    format!("10{}", raised(power as i32))
                } else {
                    short(value)
                }
            }
        }
    }
}

fn short(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn raised(power: i32) -> String {
    let digit = |c: char| match c {
        '-' => '⁻',
        c => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][c.to_digit(10).unwrap_or(0) as usize],
    };
    power.to_string().chars().map(digit).collect()
}

/// A logarithmic scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Least and greatest number, as logarithms to base 10.
    logs: [f64; 2],
    /// Where these lie.
    places: [f64; 2],
}

impl Scale {
    /// A scale on which all these numbers have room; those that are not above 0 are not looked at.
    pub fn over(numbers: impl Iterator<Item = f64>, places: [f64; 2]) -> Self {
        let logs = numbers.filter(|v| *v > 0.0 && v.is_finite()).map(f64::log10);
        let [lo, hi] = logs.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)]);
        let [lo, hi] = if lo <= hi { [lo, hi] } else { [-1.0, 0.0] };
        let room = (0.06 * (hi - lo)).max(0.08);
        Self { logs: [lo - room, hi + room], places }
    }

    /// Where a number lies; at the lower end where it is not above 0.
    pub fn place(&self, value: f64) -> f64 {
        let [lo, hi] = self.logs;
        let log = if value > 0.0 { value.log10().clamp(lo, hi) } else { lo };
        self.places[0] + (log - lo) / (hi - lo) * (self.places[1] - self.places[0])
    }

    /// Numbers to draw a line at, and whether they are written: powers of ten, and where these are few
    /// also twice and five times these.
    pub fn ticks(&self) -> Vec<(f64, bool)> {
        let [lo, hi] = self.logs;
        let decades = hi - lo;
        let every = ((decades / 8.0).ceil() as i32).max(1);
        let mut ticks = Vec::new();
        for power in lo.floor() as i32..=hi.ceil() as i32 {
            for digit in 1..10 {
                let value = f64::from(digit) * 10f64.powi(power);
                let log = value.log10();
                let strong = match digit {
                    1 => power.rem_euclid(every) == 0,
                    2 | 5 => decades < 1.6,
                    3 => decades < 1.0,
                    _ => decades < 0.5,
                };
                if (lo..=hi).contains(&log) && (strong || decades < 4.0) {
                    ticks.push((value, strong));
                }
            }
        }
        ticks
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_written_in_the_unit_that_suits_them() {
        let texts = [2e-5, 1e-3, 0.05, 1.0, 20.0].map(|v| Unit::Seconds.tick(v));
        assert_eq!(texts, ["20 µs", "1 ms", "50 ms", "1 s", "20 s"]);
        assert_eq!([1e-7, 0.02, 1e12].map(|v| Unit::Plain.tick(v)), ["10⁻⁷", "0.02", "10¹²"]);
    }

    #[test]
    fn numbers_lie_by_their_logarithm() {
        let scale = Scale::over([1.0, 100.0].into_iter(), [0.0, 300.0]);
        let [a, b, c] = [1.0, 10.0, 100.0].map(|v| scale.place(v));
        assert!((b - a - (c - b)).abs() < 1e-9 && a > 0.0 && c < 300.0);
        assert!(scale.place(0.0) == 0.0 && scale.place(f64::NAN) == 0.0);
    }

    #[test]
    fn there_are_ticks_however_narrow_or_wide() {
        for ends in [[1.0, 1.0], [0.9, 1.1], [1e-9, 1e9]] {
            let ticks = Scale::over(ends.into_iter(), [0.0, 1.0]).ticks();
            let written = ticks.iter().filter(|t| t.1).count();
            assert!((1..=20).contains(&written), "{ends:?}: {ticks:?}");
        }
    }
}
