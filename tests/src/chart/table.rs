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
//! | `size` | | columns x rows of the picture, which must be the chart's |
//!
//! Columns are found by name, in any order; one that is not known is an error.

use std::{collections::BTreeMap, fs, io, path::Path};

use csv::{ReaderBuilder, Trim, Writer};
use thiserror::Error;

use super::{Chart, Point};

/// The columns, in the order in which they are written.
const COLUMNS: [&str; 20] = [
    "scene",
    "action",
    "series",
    "settings",
    "step",
    "median_s",
    "q1_s",
    "q3_s",
    "least_s",
    "first_s",
    "frames",
    "max",
    "rmse",
    "p99",
    "samples",
    "resident_bytes",
    "machine",
    "device",
    "method",
    "size",
];

/// Why a table cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TableError {
    /// The file.
    #[error("{path}: cannot be read")]
    File {
        /// Its path.
        path: String,
        /// Why.
        source: io::Error,
    },
    /// A line, or a number in it.
    #[error("{path}, line {line}: {what}")]
    Line {
        /// The file.
        path: String,
        /// From 1, the header included.
        line: usize,
        /// What was found and wanted.
        what: String,
    },
}

/// All points of a chart.
pub fn csv(chart: &Chart) -> String {
    let mut writer = Writer::from_writer(Vec::new());
    _ = writer.write_record(COLUMNS);
    for scene in &chart.scenes {
        let size = format!("{}x{}", scene.width, scene.height);
        for p in &scene.points {
            let words: Vec<_> = p.settings.iter().map(|(name, value)| format!("{name}={value}")).collect();
            let number = |v: Option<f64>| v.map_or(String::new(), |v| v.to_string());
            let cells = [
                scene.name.clone(),
                p.action.clone(),
                p.series.clone(),
                words.join(" "),
                number(p.step),
                p.median_s.to_string(),
                p.quartiles_s[0].to_string(),
                p.quartiles_s[1].to_string(),
                p.least_s.to_string(),
                p.first_s.to_string(),
                p.frames.to_string(),
                number(p.max),
                number(p.rmse),
                number(p.p99),
                p.samples.to_string(),
                p.resident_bytes.to_string(),
                p.machine.clone(),
                p.device.clone(),
                p.method.clone(),
                size.clone(),
            ];
            // Into memory, where nothing fails.
            _ = writer.write_record(cells);
        }
    }
    writer.into_inner().map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).unwrap_or_default()
}

/// A line's number and cells.
type Line = (usize, Vec<String>);

/// The lines of a table, each with its number and its cells (RFC 4180; blanks around cells do not count).
fn lines_of(text: &str) -> Result<Vec<Line>, (usize, String)> {
    let mut reader =
        ReaderBuilder::new().has_headers(false).flexible(true).trim(Trim::All).from_reader(text.as_bytes());
    let mut lines = Vec::new();
    // A record begins with the empty lines before it.
    let empty = |at: u64| {
        let rest = text.as_bytes().get(at as usize..).unwrap_or_default();
        rest.iter().take_while(|b| b"\r\n".contains(b)).filter(|b| **b == b'\n').count()
    };
    let line = |p: Option<&csv::Position>| p.map_or(1, |p| p.line() as usize + empty(p.byte()));
    for record in reader.records() {
        let record = record.map_err(|error| (line(error.position()), error.to_string()))?;
        lines.push((line(record.position()), record.iter().map(str::to_owned).collect()));
    }
    Ok(lines)
}

/// Joins the points of a table to the scenes of a chart. Returns how many.
///
/// # Errors
/// If it cannot be read, a column is not known, a number is none, or a scene is not in the chart.
pub fn join(chart: &mut Chart, path: &Path) -> Result<usize, TableError> {
    let name = path.display().to_string();
    let text = fs::read_to_string(path).map_err(|source| TableError::File { path: name.clone(), source })?;
    let wrong = |line, what| TableError::Line { path: name.clone(), line, what };
    let lines = lines_of(&text).map_err(|(line, what)| wrong(line, what))?;
    let Some(((at, header), rest)) = lines.split_first() else {
        return Err(wrong(1, "there is no header, wanted names of columns".into()));
    };
    check_header(header).map_err(|what| wrong(*at, what))?;
    for (at, cells) in rest {
        let joined = Cells::new(header, cells).and_then(|line| line.join(chart));
        joined.map_err(|what| wrong(*at, what))?;
    }
    Ok(rest.len())
}

fn check_header(header: &[String]) -> Result<(), String> {
    if let Some(odd) = header.iter().find(|name| !COLUMNS.contains(&name.as_str())) {
        let hint = volact_core::names::hint(odd, COLUMNS);
        return Err(format!("no column is called {odd:?}{hint}; known: {}", COLUMNS.join(", ")));
    }
    if let Some(twice) = header.iter().enumerate().find(|(i, name)| header[..*i].contains(name)) {
        return Err(format!("column {:?} is there twice", twice.1));
    }
    match ["scene", "action", "median_s"].iter().find(|name| !header.iter().any(|h| h == *name)) {
        Some(missing) => Err(format!("there is no column {missing:?}, which is needed")),
        None => Ok(()),
    }
}

/// A line, by the names of its columns.
struct Cells<'a>(BTreeMap<&'a str, &'a str>);

impl<'a> Cells<'a> {
    fn new(header: &'a [String], cells: &'a [String]) -> Result<Self, String> {
        if cells.len() != header.len() {
            return Err(format!("{} cells, wanted {} as in the header", cells.len(), header.len()));
        }
        let pairs = header.iter().map(String::as_str).zip(cells.iter().map(String::as_str));
        Ok(Self(pairs.filter(|(_, cell)| !cell.is_empty()).collect()))
    }

    fn text(&self, name: &str) -> String {
        self.0.get(name).copied().unwrap_or_default().to_owned()
    }

    /// A number above 0, or 0 where that `counts`, too.
    fn number(&self, name: &str, counts: bool) -> Result<Option<f64>, String> {
        let Some(cell) = self.0.get(name) else { return Ok(None) };
        let wanted = if counts { "0 or more" } else { "above 0" };
        let good = |v: &f64| v.is_finite() && (*v > 0.0 || counts && *v == 0.0);
        match cell.parse().ok().filter(good) {
            Some(value) => Ok(Some(value)),
            None => Err(format!("{name} is {cell:?}, wanted a number {wanted}")),
        }
    }

    fn join(&self, chart: &mut Chart) -> Result<(), String> {
        let known = chart.scenes.iter().map(|s| s.name.clone()).collect::<Vec<_>>().join(", ");
        let wanted = self.text("scene");
        let scene = chart.scenes.iter_mut().find(|s| s.name == wanted);
        let scene = scene.ok_or_else(|| format!("scene is {wanted:?}, wanted one of the chart: {known}"))?;
        let (size, found) = (format!("{}x{}", scene.width, scene.height), self.text("size"));
        if !found.is_empty() && found != size {
            return Err(format!("size is {found}, wanted that of the chart, {size}"));
        }
        scene.points.push(self.point()?);
        Ok(())
    }

    fn point(&self) -> Result<Point, String> {
        let median_s = self.number("median_s", false)?.ok_or("there is no median_s, wanted seconds")?;
        let seconds = |name: &str| Ok::<_, String>(self.number(name, false)?.unwrap_or(median_s));
        let count = |name: &str| Ok::<_, String>(self.number(name, true)?.unwrap_or(0.0));
        let (max, rmse, p99) = (self.number("max", true)?, self.number("rmse", true)?, self.number("p99", true)?);
        if max.or(rmse).or(p99).is_none() {
            return Err("there is no error, wanted a number in max, rmse or p99".into());
        }
        let (action, series, settings) = (self.text("action"), self.text("series"), self.text("settings"));
        if action.is_empty() {
            return Err("there is no action, wanted the program's name".into());
        }
        Ok(Point {
            key: String::new(),
            content: String::new(),
            series: if series.is_empty() { action.clone() } else { series },
            action,
            settings: (!settings.is_empty()).then(|| ("settings".to_owned(), settings)).into_iter().collect(),
            step: self.number("step", false)?,
            median_s,
            quartiles_s: [seconds("q1_s")?, seconds("q3_s")?],
            least_s: seconds("least_s")?,
            first_s: seconds("first_s")?,
            frames: count("frames")? as usize,
            max,
            rmse,
            p99,
            samples: count("samples")? as u64,
            resident_bytes: count("resident_bytes")? as usize,
            machine: self.text("machine"),
            device: self.text("device"),
            method: self.text("method"),
            picture: None,
            difference: None,
        })
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
        fs::write(&file, text).unwrap();
        let mut chart = chart(Vec::new());
        let result = join(&mut chart, &file).map_err(|e| crate::truth::chain(&e));
        fs::remove_file(&file).unwrap();
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
        let text = csv(&chart(vec![point.clone()]));
        assert_eq!(joined(&text).unwrap().scenes[0].points, [point]);
    }

    #[test]
    fn cells_in_quotation_marks_may_hold_anything() {
        let found = lines_of("a, b \n\"x, \"\"y\"\"\nz\",2\r\n\n3,4").unwrap();
        let of = |cells: [&str; 2]| cells.map(str::to_owned).to_vec();
        assert_eq!(found, [(1, of(["a", "b"])), (2, of(["x, \"y\"\nz", "2"])), (5, of(["3", "4"]))]);
    }

    #[test]
    fn few_columns_suffice_and_what_is_wrong_is_named() {
        let other = joined("scene,action,median_s,rmse\nhead, vtk ,0.04,1e-3\n").unwrap();
        let point = &other.scenes[0].points[0];
        assert_eq!((point.action.as_str(), point.series.as_str(), point.quartiles_s), ("vtk", "vtk", [0.04; 2]));
        let base = "scene,action,median_s,rmse\n";
        for (text, words) in [
            (format!("{base}hed,vtk,0.04,1e-3\n"), ["line 2", "\"hed\"", "head"]),
            (format!("{base}head,vtk,1,1\n\nhead,vtk,-1,1e-3\n"), ["line 4", "median_s", "-1"]),
            (format!("{base}head,vtk,1,NaN\n"), ["line 2", "rmse", "NaN"]),
            (format!("{base}head,vtk,1,\n"), ["line 2", "no error", "p99"]),
            (format!("{base}head,vtk\n"), ["line 2", "2 cells", "wanted 4"]),
            (format!("{base}head,\"vtk,1,1\n"), ["line 2", "2 cells", "wanted 4"]),
            ("scene,action,time,rmse\nhead,vtk,1,1\n".into(), ["line 1", "\"time\"", "known: scene"]),
            ("scene,action,rmse\nhead,vtk,1\n".into(), ["line 1", "\"median_s\"", "needed"]),
            ("scene,scene,action,median_s\n".into(), ["line 1", "\"scene\"", "twice"]),
            ("scene,action,median_s,rmse,size\nhead,vtk,1,1,8x8\n".into(), ["line 2", "8x8", "2x2"]),
            (String::new(), ["line 1", "no header", ""]),
        ] {
            let message = joined(&text).unwrap_err();
            assert!(words.iter().all(|w| message.contains(w)), "{text:?}: {message}");
        }
    }
}
