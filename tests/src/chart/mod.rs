//! Time against true error: what actions make of a scene over all that their options offer, charted.
//!
//! - [`axes`] turns the options that an action declares into [`axes::Setting`]s to measure;
//! - [`truth`] is `reference`'s picture, kept on disk;
//! - [`measure`] draws in turns, and appends each point to a file as it is measured, so that a run that is
//!   interrupted goes on;
//! - [`Chart`] is what JSON holds; [`table`] is the same as CSV, and reads points measured elsewhere;
//! - [`page`] draws it: SVG, and one HTML file that opens offline.

pub mod axes;
pub mod machine;
pub mod measure;
pub mod page;
pub mod rows;
pub mod table;
pub mod truth;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Version of the JSON.
pub const VERSION: u32 = 1;

/// A chart of one or more scenes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// [`VERSION`].
    pub version: u32,
    /// The scenes.
    pub scenes: Vec<SceneChart>,
}

/// A scene and what was measured of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneChart {
    /// Its name.
    pub name: String,
    /// What its picture depends on, as a hash: two results are of one scene where this is the same.
    pub key: String,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// What is known of the truth.
    pub truth: TruthNote,
    /// What was measured.
    pub points: Vec<Point>,
    /// What was not, and why: action, settings, reason.
    pub left_out: Vec<[String; 3]>,
}

/// What is known of the truth.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TruthNote {
    /// The widest enclosure of any channel of any pixel; errors below are not told apart.
    pub widest: f64,
    /// Pixels without a certificate.
    pub not_certified: usize,
    /// Shapes that were drawn by quadrature, whose enclosures are estimates.
    pub estimated: Vec<String>,
}

/// One setting of one action, measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// What it is a measurement of, as a hash; empty for one that was measured elsewhere.
    pub key: String,
    /// Scene, method and bits of its frame, as a hash; empty for one that was measured elsewhere.
    #[serde(default)]
    pub content: String,
    /// The machine.
    pub machine: String,
    /// The action, or another program.
    pub action: String,
    /// Action and settings without the step.
    pub series: String,
    /// All settings, in words.
    pub settings: BTreeMap<String, String>,
    /// World distance of samples that was asked for.
    pub step: Option<f64>,
    /// Median seconds of a frame.
    pub median_s: f64,
    /// First and third quartile.
    pub quartiles_s: [f64; 2],
    /// The fastest frame.
    pub least_s: f64,
    /// The first frame, preparations included.
    pub first_s: f64,
    /// Frames that count.
    pub frames: usize,
    /// Largest error of any channel of any pixel.
    pub max: Option<f64>,
    /// Root of the mean square of the errors.
    pub rmse: Option<f64>,
    /// Error that 99 of 100 pixels keep, in their worst channel.
    pub p99: Option<f64>,
    /// Samples taken.
    pub samples: u64,
    /// Bytes held.
    pub resident_bytes: usize,
    /// How the frame says it was made.
    pub method: String,
    /// The device.
    pub device: String,
    /// Over black, as a data URL.
    pub picture: Option<String>,
    /// The error by powers of ten, as a data URL.
    pub difference: Option<String>,
}

/// Which figure is the error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Measure {
    /// Root of the mean square.
    Rmse,
    /// The largest.
    Max,
    /// What 99 of 100 pixels keep.
    P99,
}

impl Measure {
    /// All, the usual first.
    pub const ALL: [Self; 3] = [Self::Rmse, Self::Max, Self::P99];

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rmse => "rmse",
            Self::Max => "max",
            Self::P99 => "p99",
        }
    }

    /// Of a point.
    pub fn of(self, point: &Point) -> Option<f64> {
        match self {
            Self::Rmse => point.rmse,
            Self::Max => point.max,
            Self::P99 => point.p99,
        }
    }
}

/// Why charts cannot be put together.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum ChartError {
    /// A file of another version.
    #[error("the chart is of version {found}, wanted {VERSION}")]
    Version {
        /// Its version.
        found: u32,
    },
    /// One name, two scenes.
    #[error("scene {name:?} is not the same in both charts: {}, wanted one scene seen alike", which.join(" and "))]
    Scene {
        /// The name.
        name: String,
        /// Size and key of each.
        which: [String; 2],
    },
}

impl Chart {
    /// Adds the points of another chart; scenes of one name must be the same.
    ///
    /// # Errors
    /// If they are not, or the chart is of another version.
    pub fn merge(&mut self, other: Chart) -> Result<(), ChartError> {
        if other.version != VERSION {
            return Err(ChartError::Version { found: other.version });
        }
        for scene in other.scenes {
            let Some(own) = self.scenes.iter_mut().find(|s| s.name == scene.name) else {
                self.scenes.push(scene);
                continue;
            };
            let which = |s: &SceneChart| format!("{} × {} of {:.8}", s.width, s.height, s.key);
            if (own.width, own.height, &own.key) != (scene.width, scene.height, &scene.key) {
                return Err(ChartError::Scene { name: scene.name.clone(), which: [which(own), which(&scene)] });
            }
            for point in scene.points {
                if !own.points.contains(&point) {
                    own.points.push(point);
                }
            }
            own.left_out.extend(scene.left_out);
        }
        Ok(())
    }

    /// The machines that points were measured on.
    pub fn machines(&self) -> Vec<String> {
        let mut all: Vec<_> = self.scenes.iter().flat_map(|s| &s.points).map(|p| p.machine.clone()).collect();
        all.sort();
        all.dedup();
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(key: &str, action: &str) -> Chart {
        let point = Point { action: action.into(), machine: action.into(), median_s: 0.1, ..Point::default() };
        let scene = SceneChart {
            name: "a".into(),
            key: key.into(),
            width: 4,
            height: 3,
            truth: TruthNote::default(),
            points: vec![point],
            left_out: Vec::new(),
        };
        Chart { version: VERSION, scenes: vec![scene] }
    }

    #[test]
    fn charts_of_one_scene_are_put_together() {
        let mut both = chart("k", "here");
        both.merge(chart("k", "there")).unwrap();
        both.merge(chart("k", "there")).unwrap();
        assert_eq!((both.scenes.len(), both.scenes[0].points.len()), (1, 2), "what is there already is not added");
        assert_eq!(both.machines(), ["here", "there"]);
        let message = both.merge(chart("other", "x")).unwrap_err().to_string();
        assert!(message.contains("\"a\" is not the same") && message.contains("4 × 3 of other"), "{message}");
        assert_eq!(both.merge(Chart { version: 9, scenes: vec![] }), Err(ChartError::Version { found: 9 }));
    }
}
