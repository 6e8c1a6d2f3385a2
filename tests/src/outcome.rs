//! What was found: checks, cases and runs, as JSON holds them.

use serde::{Deserialize, Serialize};

use crate::study::{Expected, Study};

/// A picture of a check: premultiplied RGBA, row by row from the top.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sheet {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// What was expected.
    #[serde(with = "packed")]
    pub expected: Vec<[f32; 4]>,
    /// What was drawn.
    #[serde(with = "packed")]
    pub actual: Vec<[f32; 4]>,
    /// The tolerance of each pixel.
    #[serde(with = "packed")]
    pub tolerance: Vec<f32>,
}

/// How far pictures lie apart, and how far they may.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Figures {
    /// Largest difference in any channel.
    pub max: f64,
    /// Root of the mean square difference.
    pub rmse: f64,
    /// Tolerance of the pixel that uses most of its own.
    pub max_tolerance: f64,
    /// Tolerance of the root of the mean square.
    pub rmse_tolerance: f64,
    /// Tolerance over difference in the pixel that uses most of it: above 1 is good, above 10 loose.
    pub room: f64,
    /// What set the tolerance: each part with its share where it is largest.
    pub parts: Vec<(String, f64)>,
    /// Why there may be more room than a factor of ten.
    pub reason: Option<String>,
}

/// One thing that was looked at.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// What.
    pub label: String,
    /// Against what: `closed form`, `reference on rays, step 0.25`, `bit for bit`, …
    pub truth: String,
    /// Whether it is as promised.
    pub passed: bool,
    /// What was found and wanted.
    pub message: String,
    /// Figures of a comparison.
    pub figures: Option<Figures>,
    /// Its pictures.
    pub sheet: Option<Sheet>,
    /// How an error falls, where that was looked at.
    #[serde(default)]
    pub study: Option<Study>,
    /// How the frame says it was made.
    pub method: Option<String>,
    /// The scene, in the words of a scene file where it can be one.
    pub scene: Option<String>,
    /// Files that the scene names: the volumes.
    #[serde(skip)]
    pub files: Vec<(String, Vec<u8>)>,
}

/// What a case came to.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "result", content = "why", rename_all = "snake_case")]
pub enum Status {
    /// All is as promised.
    Passed,
    /// Something is not.
    Failed(String),
    /// The action cannot do what the case is about.
    Skipped(String),
    /// It fails as is known of this driver.
    ExpectedFailure(String),
}

impl Status {
    /// In a word.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed(_) => "FAILED",
            Self::Skipped(_) => "skipped",
            Self::ExpectedFailure(_) => "expected failure",
        }
    }

    /// The reason, where there is one.
    pub fn why(&self) -> &str {
        match self {
            Self::Passed => "",
            Self::Failed(why) | Self::Skipped(why) | Self::ExpectedFailure(why) => why,
        }
    }
}

/// A case, run on an action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CaseResult {
    /// The action with options and device.
    pub subject: String,
    /// The topic.
    pub topic: String,
    /// The name in the topic.
    pub name: String,
    /// What is promised.
    pub about: String,
    /// What an action must have.
    pub needs: Vec<String>,
    /// What is expected of an error, where the case is about that.
    #[serde(default)]
    pub expects: Option<Expected>,
    /// What it came to.
    pub status: Status,
    /// What was looked at.
    pub checks: Vec<Check>,
    /// Seconds it took, truth included where nobody had asked for it before.
    pub seconds: f64,
}

impl CaseResult {
    /// `[cpu/AVX-512] clipping::plane_keeps_its_front`.
    pub fn title(&self) -> String {
        format!("[{}] {}::{}", self.subject, self.topic, self.name)
    }

    /// The least room of all its checks: tolerance over difference.
    pub fn room(&self) -> Option<f64> {
        let rooms = self.checks.iter().filter_map(|c| c.figures.as_ref()).map(|f| f.room);
        rooms.fold(None, |least, room| Some(least.map_or(room, |l: f64| l.min(room))))
    }
}

/// All cases that were run on an action.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// The action with options and device.
    pub subject: String,
    /// All of the device's description.
    pub device: String,
    /// The cases, in the catalog's order.
    pub cases: Vec<CaseResult>,
}

impl Run {
    /// Cases by status: passed, failed, skipped, expected failures.
    pub fn counts(&self) -> [usize; 4] {
        let mut counts = [0; 4];
        for case in &self.cases {
            counts[match case.status {
                Status::Passed => 0,
                Status::Failed(_) => 1,
                Status::Skipped(_) => 2,
                Status::ExpectedFailure(_) => 3,
            }] += 1;
        }
        counts
    }

    /// Whether nothing failed and something was looked at.
    pub fn passed(&self) -> bool {
        let [passed, failed, ..] = self.counts();
        failed == 0 && passed > 0
    }

    /// The run in a line.
    pub fn summary(&self) -> String {
        let [passed, failed, skipped, expected] = self.counts();
        let executed = passed + failed + expected;
        let none = if executed == 0 { "; no case was executed, which is a failure" } else { "" };
        format!(
            "[{}] {passed} passed, {failed} failed, {skipped} skipped, {expected} expected failures{none}",
            self.subject
        )
    }
}

/// Numbers as base64 of little-endian f32.
mod packed {
    use base64::{Engine as _, engine::general_purpose::STANDARD};
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    /// What is packed: numbers, or several at once.
    pub trait Numbers: Sized {
        /// How many numbers are one.
        const COUNT: usize;
        /// The numbers of one.
        fn numbers(&self) -> impl Iterator<Item = f32>;
        /// One of its numbers.
        fn from(numbers: &[f32]) -> Self;
    }

    impl Numbers for f32 {
        const COUNT: usize = 1;
        fn numbers(&self) -> impl Iterator<Item = f32> {
            std::iter::once(*self)
        }
        fn from(numbers: &[f32]) -> Self {
            numbers[0]
        }
    }

    impl Numbers for [f32; 4] {
        const COUNT: usize = 4;
        fn numbers(&self) -> impl Iterator<Item = f32> {
            self.iter().copied()
        }
        fn from(numbers: &[f32]) -> Self {
            [numbers[0], numbers[1], numbers[2], numbers[3]]
        }
    }

    pub fn serialize<T: Numbers, S: Serializer>(values: &[T], serializer: S) -> Result<S::Ok, S::Error> {
        let bytes: Vec<u8> = values.iter().flat_map(Numbers::numbers).flat_map(f32::to_le_bytes).collect();
        serializer.serialize_str(&STANDARD.encode(bytes))
    }

    pub fn deserialize<'de, T: Numbers, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<T>, D::Error> {
        let text = String::deserialize(deserializer)?;
        let bytes = STANDARD.decode(text).map_err(D::Error::custom)?;
        if bytes.len() % (4 * T::COUNT) != 0 {
            return Err(D::Error::custom(format!("{} bytes, wanted a multiple of {}", bytes.len(), 4 * T::COUNT)));
        }
        let numbers: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        Ok(numbers.chunks_exact(T::COUNT).map(T::from).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sheets_survive_json() {
        let pixels = vec![[0.5f32, -1.0, f32::INFINITY, 1e-30]; 6];
        let sheet = Sheet { width: 3, height: 2, expected: pixels.clone(), actual: pixels, tolerance: vec![1e-6; 6] };
        let text = serde_json::to_string(&sheet).unwrap();
        assert_eq!(serde_json::from_str::<Sheet>(&text).unwrap(), sheet);
        assert!(serde_json::from_str::<Sheet>(&text.replace("\"expected\":\"", "\"expected\":\"AAAA")).is_err());
    }
}
