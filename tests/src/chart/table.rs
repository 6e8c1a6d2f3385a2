//! Points as CSV, and points that were measured elsewhere, as other programs' are.
//!
//! | column | needed | means |
//! |---|---|---|
//! | `scene` | yes | the scene's name in the chart |
//! | `action` | yes | action, or another program |
//! | `series` | | points that are joined by a line; the action unless given |
//! | `settings` | | in words |
//! | `step` | | world distance of samples |
//! | `median_s` | yes | seconds of a frame |
//! | `q1_s`, `q3_s`, `least_s`, `first_s`, `frames` | | quartiles, fastest and first frame, how many counted |
//! | `max`, `rmse`, `p99` | one | errors against the same truth, in numbers from 0 to 1 |
//! | `samples`, `resident_bytes` | | samples taken, bytes held |
//! | `machine`, `device`, `method` | | where, on what and how |
//!
//! Columns are found by name, in any order; one that is not known is an error.

use std::{collections::BTreeMap, path::Path};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{Chart, Point};

/// A row of the table.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    scene: String,
    action: String,
    #[serde(default)]
    series: String,
    #[serde(default)]
    settings: String,
    #[serde(default)]
    step: Option<f64>,
    median_s: f64,
    #[serde(default)]
    q1_s: Option<f64>,
    #[serde(default)]
    q3_s: Option<f64>,
    #[serde(default)]
    least_s: Option<f64>,
    #[serde(default)]
    first_s: Option<f64>,
    #[serde(default)]
    frames: Option<usize>,
    #[serde(default)]
    max: Option<f64>,
    #[serde(default)]
    rmse: Option<f64>,
    #[serde(default)]
    p99: Option<f64>,
    #[serde(default)]
    samples: Option<u64>,
    #[serde(default)]
    resident_bytes: Option<usize>,
    #[serde(default)]
    machine: String,
    #[serde(default)]
    device: String,
    #[serde(default)]
    method: String,
}

/// Why a table cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TableError {
    /// It is no table of points.
    #[error("{path}: no table of points")]
    Csv {
        /// The file.
        path: String,
        /// Why, with the line.
        source: csv::Error,
    },
    /// A number makes no sense.
    #[error("{path}, line {line}: {what}")]
    Value {
        /// The file.
        path: String,
        /// From 1, the header included.
        line: usize,
        /// What was found and wanted.
        what: String,
    },
}

/// All points of a chart.
///
/// # Errors
/// If they cannot be written, which memory always can.
pub fn csv(chart: &Chart) -> Result<String, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for scene in &chart.scenes {
        for p in &scene.points {
            let words = p.settings.iter().map(|(name, value)| format!("{name}={value}"));
            writer.serialize(Line {
                scene: scene.name.clone(),
                action: p.action.clone(),
                series: p.series.clone(),
                settings: words.collect::<Vec<_>>().join(" "),
                step: p.step,
                median_s: p.median_s,
                q1_s: Some(p.quartiles_s[0]),
                q3_s: Some(p.quartiles_s[1]),
                least_s: Some(p.least_s),
                first_s: Some(p.first_s),
                frames: Some(p.frames),
                max: p.max,
                rmse: p.rmse,
                p99: p.p99,
                samples: Some(p.samples),
                resident_bytes: Some(p.resident_bytes),
                machine: p.machine.clone(),
                device: p.device.clone(),
                method: p.method.clone(),
            })?;
        }
    }
    let bytes = writer.into_inner().map_err(|e| e.into_error())?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Joins the points of a table to the scenes of a chart. Returns how many.
///
/// # Errors
/// If it cannot be read, a number is none, or a scene is not in the chart.
pub fn join(chart: &mut Chart, path: &Path) -> Result<usize, TableError> {
    let name = path.display().to_string();
    let failed = |source| TableError::Csv { path: name.clone(), source };
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(failed)?;
    let mut joined = 0;
    for (i, line) in reader.deserialize().enumerate() {
        let line: Line = line.map_err(failed)?;
        let wrong = |what| TableError::Value { path: name.clone(), line: i + 2, what };
        check(&line).map_err(wrong)?;
        let known = chart.scenes.iter().map(|s| s.name.clone()).collect::<Vec<_>>().join(", ");
        let Some(scene) = chart.scenes.iter_mut().find(|s| s.name == line.scene) else {
            return Err(wrong(format!("scene is {:?}, wanted one of the chart: {known}", line.scene)));
        };
        scene.points.push(point(line));
        joined += 1;
    }
    Ok(joined)
}

fn check(line: &Line) -> Result<(), String> {
    if !(line.median_s > 0.0 && line.median_s.is_finite()) {
        return Err(format!("median_s is {}, wanted seconds above 0", line.median_s));
    }
    let errors = [("max", line.max), ("rmse", line.rmse), ("p99", line.p99)];
    if let Some((name, Some(value))) = errors.iter().find(|(_, v)| v.is_some_and(|v| !(v >= 0.0 && v.is_finite()))) {
        return Err(format!("{name} is {value}, wanted an error of 0 or more"));
    }
    if errors.iter().all(|(_, value)| value.is_none()) {
        return Err("there is no error, wanted a number in max, rmse or p99".into());
    }
    Ok(())
}

fn point(line: Line) -> Point {
    let quartile = |q: Option<f64>| q.filter(|q| *q > 0.0 && q.is_finite()).unwrap_or(line.median_s);
    let settings = if line.settings.is_empty() { None } else { Some(("settings".to_owned(), line.settings.clone())) };
    Point {
        key: String::new(),
        series: if line.series.is_empty() { line.action.clone() } else { line.series },
        action: line.action,
        settings: BTreeMap::from_iter(settings),
        step: line.step,
        median_s: line.median_s,
        quartiles_s: [line.q1_s, line.q3_s].map(quartile),
        least_s: quartile(line.least_s),
        first_s: quartile(line.first_s),
        frames: line.frames.unwrap_or(0),
        max: line.max,
        rmse: line.rmse,
        p99: line.p99,
        samples: line.samples.unwrap_or(0),
        resident_bytes: line.resident_bytes.unwrap_or(0),
        machine: line.machine,
        device: line.device,
        method: line.method,
        picture: None,
        difference: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::{SceneChart, TruthNote, VERSION};

    fn chart(points: Vec<Point>) -> Chart {
        let scene = SceneChart {
            name: "head".into(),
            key: "k".into(),
            width: 2,
            height: 2,
            truth: TruthNote::default(),
            points,
            left_out: Vec::new(),
        };
        Chart { version: VERSION, scenes: vec![scene] }
    }

    fn joined(text: &str) -> Result<Chart, String> {
        let mut file = std::env::temp_dir();
        file.push(format!("volact-join-{}-{:?}.csv", std::process::id(), std::thread::current().id()));
        std::fs::write(&file, text).unwrap();
        let mut chart = chart(Vec::new());
        let result = join(&mut chart, &file).map_err(|e| crate::truth::chain(&e));
        std::fs::remove_file(&file).unwrap();
        result.map(|_| chart)
    }

    #[test]
    fn what_is_written_can_be_joined() {
        let point = Point {
            machine: "a, \"b\"".into(),
            action: "cpu".into(),
            series: "cpu classification=post".into(),
            median_s: 0.25,
            quartiles_s: [0.2, 0.3],
            least_s: 0.1,
            first_s: 1.0,
            frames: 5,
            step: Some(0.5),
            rmse: Some(1e-4),
            max: Some(1e-2),
            p99: Some(1e-3),
            ..Point::default()
        };
        let text = csv(&chart(vec![point.clone()])).unwrap();
        assert_eq!(joined(&text).unwrap().scenes[0].points, [point]);
    }

    #[test]
    fn few_columns_suffice_and_what_is_wrong_is_named() {
        let other = joined("scene,action,median_s,rmse\nhead, vtk ,0.04,1e-3\n").unwrap();
        let point = &other.scenes[0].points[0];
        assert_eq!((point.action.as_str(), point.series.as_str(), point.quartiles_s), ("vtk", "vtk", [0.04; 2]));
        for (text, words) in [
            ("scene,action,median_s,rmse\nhed,vtk,0.04,1e-3\n", ["line 2", "\"hed\"", "head"]),
            ("scene,action,median_s,rmse\nhead,vtk,-1,1e-3\n", ["line 2", "median_s", "-1"]),
            ("scene,action,median_s,rmse\nhead,vtk,1,NaN\n", ["line 2", "rmse", "NaN"]),
            ("scene,action,median_s\nhead,vtk,1\n", ["line 2", "no error", "p99"]),
            ("scene,action,time,rmse\nhead,vtk,1,1\n", ["no table", "time", ""]),
            ("scene,action,median_s,rmse\nhead,vtk\n", ["no table", "line: 2", ""]),
        ] {
            let message = joined(text).unwrap_err();
            assert!(words.iter().all(|w| message.contains(w)), "{text:?}: {message}");
        }
    }
}
