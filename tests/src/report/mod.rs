//! What a run writes: a JSON a case with its scenes, and one page that opens offline; and what other pages
//! are made with.

mod orders;
mod page;
mod picture;

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use thiserror::Error;

use crate::outcome::{CaseResult, Run};
pub use crate::rig::line as method;

pub use orders::{OrderRow, control_rows, orders, write_orders};
pub use page::{filled, html};
pub use picture::{decades, over_black};

/// Tolerance over difference above which a tolerance needs a reason.
pub const LOOSE: f64 = 10.0;

/// What f32 frames round anyway: tolerances up to here need no reason.
pub const FLOOR: f64 = 40.0 * crate::method::F32;

/// What variants are compared with.
pub const VARIANT: &str = "a variant";

/// Why a report cannot be written or read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A file or folder.
    #[error("{}: cannot be written", path.display())]
    Write {
        /// The path.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A result cannot be said in JSON.
    #[error("case {case}: cannot be written as JSON")]
    Json {
        /// The case.
        case: String,
        /// Why.
        source: serde_json::Error,
    },
    /// A picture cannot be encoded.
    #[error("a picture of {width} × {height} pixels cannot be encoded")]
    Picture {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Why.
        source: png::EncodingError,
    },
}

/// Comparisons whose tolerance is more than ten times the difference, and more than rounding of a frame,
/// without a reason: case, check, tolerance over difference.
///
/// Of pictures only, in which the largest of many differences stands against the tolerance: a pixel or two
/// may be right by chance. Variants that do the same agree to the bit, and say nothing of how loose they are.
pub fn loose(run: &Run) -> Vec<(String, String, f64)> {
    let mut found = Vec::new();
    for case in &run.cases {
        for check in &case.checks {
            let Some(figures) = &check.figures else { continue };
            let many = check.sheet.as_ref().is_some_and(|s| s.width * s.height >= 256);
            let judged = many && check.truth != VARIANT && figures.max > 0.0;
            if judged && figures.room > LOOSE && figures.max_tolerance > FLOOR && figures.reason.is_none() {
                found.push((case.title(), check.label.clone(), figures.room));
            }
        }
    }
    found
}

/// Writes a case's JSON into a folder, and each scene with its data into a folder below it.
///
/// # Errors
/// If a file cannot be written.
pub fn write_case(folder: &Path, case: &CaseResult) -> Result<(), ReportError> {
    let folder = folder.join(slug(&case.subject));
    let name = format!("{}.{}", case.topic, case.name);
    let json = |source| ReportError::Json { case: case.title(), source };
    let text = serde_json::to_vec_pretty(case).map_err(json)?;
    write(&folder.join(format!("{name}.json")), &text)?;
    for check in &case.checks {
        let Some(scene) = &check.scene else { continue };
        let place = folder.join(&name).join(slug(&check.label));
        write(&place.join("scene.ron"), scene.as_bytes())?;
        check.files.iter().try_for_each(|(file, bytes)| write(&place.join(file), bytes))?;
    }
    Ok(())
}

/// Writes the page of some runs.
///
/// # Errors
/// If it cannot be written.
pub fn write_html(path: &Path, runs: &[Run]) -> Result<(), ReportError> {
    write(path, html(runs)?.as_bytes())
}

/// Writes a file whole or not at all.
///
/// # Errors
/// If it cannot be written.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), ReportError> {
    let failed = |source| ReportError::Write { path: path.into(), source };
    if let Some(folder) = path.parent().filter(|p| !p.as_os_str().is_empty()) {
        fs::create_dir_all(folder).map_err(failed)?;
    }
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let part = path.with_file_name(name);
    fs::write(&part, bytes).and_then(|()| fs::rename(&part, path)).map_err(|source| {
        _ = fs::remove_file(&part);
        failed(source)
    })
}

/// A name that any file system takes.
pub fn slug(text: &str) -> String {
    let good = |c: char| if c.is_ascii_alphanumeric() || "._-=".contains(c) { c } else { '_' };
    text.chars().map(good).collect()
}
