//! Orders that tests must see: how an error falls with a step or a spacing, and what must not change at all.
//!
//! A case that looks at such a thing says what it [expects](crate::case::Case::expects), and writes down
//! what it measured as a [`Study`]. `volact verify` prints these cases as one table. [`controls`] are
//! rules in f64 of known order, the wrong ones included, put through the same arithmetic: they show that
//! the table would see them.

use serde::{Deserialize, Serialize};

use crate::{
    metrics::order,
    rules::{Rule, march, smooth},
};

/// What is expected of an error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Expected {
    /// It falls as a power.
    Order {
        /// The power.
        power: f64,
        /// The least slope that counts as it: finite steps, noise and f32 bend the line.
        low: f64,
        /// The greatest.
        high: f64,
    },
    /// There is none beyond rounding.
    NoChange,
}

impl Expected {
    /// A power, and what slopes count as it.
    pub const fn order(power: f64, [low, high]: [f64; 2]) -> Self {
        Self::Order { power, low, high }
    }

    /// In words: `2 (1.7 to 2.4)`, `no change`.
    pub fn words(&self) -> String {
        match self {
            Self::Order { power, low, high } => format!("{power} ({low} to {high})"),
            Self::NoChange => "no change".into(),
        }
    }
}

/// An error, measured at several steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// What is varied: `step`, `grid spacing`.
    pub axis: String,
    /// What is varied, and the error there: root of the mean square.
    pub points: Vec<[f64; 2]>,
    /// The slope of log error over log step; `None` where an error is zero or no number.
    pub slope: Option<f64>,
}

impl Study {
    /// The slope of these points, of which there are four at least.
    pub fn of(axis: &str, points: Vec<[f64; 2]>) -> Self {
        let good = points.len() >= 4 && points.iter().all(|p| p[1] > 0.0 && p[1].is_finite());
        let pairs: Vec<_> = points.iter().map(|p| (p[0], p[1])).collect();
        // JSON has no infinity.
        let finite = points.iter().map(|p| [p[0], if p[1].is_finite() { p[1] } else { f64::MAX }]).collect();
        Self { axis: axis.into(), points: finite, slope: good.then(|| order(&pairs)) }
    }

    /// Whether the slope is as expected; never where no slope is.
    pub fn is(&self, expected: &Expected) -> bool {
        match (expected, self.slope) {
            (Expected::Order { low, high, .. }, Some(slope)) => *low <= slope && slope <= *high,
            _ => false,
        }
    }
}

/// A rule of known order on a smooth medium, in f64: what a study sees of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Control {
    /// The rule.
    pub name: &'static str,
    /// Its order.
    pub expected: Expected,
    /// What was measured.
    pub study: Study,
}

/// Segments of the controls' marches.
const SEGMENTS: [usize; 5] = [16, 32, 64, 128, 256];

/// Grey and opacity along the controls' ray, of length 2.
fn wavy(t: f64) -> [f64; 2] {
    [0.5 + 0.4 * (2.0 * t).cos(), 0.5 + 0.35 * (3.0 * t + 0.4).sin()]
}

/// Right rules and wrong ones, each with the order that is known of it.
pub fn controls() -> Vec<Control> {
    let exact = smooth(&wavy, 2.0);
    let control = |(name, rule, expected)| {
        let point = |n: usize| {
            let found = march(rule, &wavy, 2.0, n);
            let off = (found[0] - exact[0]).abs().max((found[1] - exact[1]).abs());
            [2.0 / n as f64, off]
        };
        Control { name, expected, study: Study::of("step", SEGMENTS.map(point).to_vec()) }
    };
    [
        ("left sample", Rule::Left, Expected::order(1.0, [0.9, 1.15])),
        ("midpoint with the exact exponential", Rule::Midpoint, Expected::order(2.0, [1.9, 2.1])),
        ("midpoint with α ≈ τh", Rule::Linearised, Expected::order(1.0, [0.9, 1.15])),
        ("pre-integrated with in-segment attenuation", Rule::PreIntegrated, Expected::order(2.0, [1.9, 2.1])),
        ("pre-integrated without it", Rule::Unattenuated, Expected::order(1.0, [0.9, 1.15])),
    ]
    .map(control)
    .to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_rules_are_seen() {
        for control in controls() {
            assert!(control.study.is(&control.expected), "{control:?}");
        }
    }

    #[test]
    fn no_error_at_all_has_no_order() {
        let study = Study::of("step", vec![[1.0, 0.1], [0.5, 0.0], [0.25, 0.01], [0.125, 0.01]]);
        assert_eq!(study.slope, None);
        assert!(!study.is(&Expected::order(2.0, [0.0, 9.0])) && !study.is(&Expected::NoChange));
        let infinite = Study::of("step", vec![[1.0, f64::INFINITY]; 4]);
        assert!(serde_json::to_string(&infinite).unwrap().contains("null"));
    }
}
