//! The study of orders: cases that expect something of an error, as rows of a table, and a page with plots.

use std::path::Path;

use serde_json::{Value, json};

use super::{ReportError, filled, write};
use crate::{
    outcome::{CaseResult, Check, Run},
    plot::{Mark, Plot, Series, Unit},
    study::{Expected, Study, controls},
};

const TEMPLATE: &str = include_str!("orders.html");

/// What was expected and seen, in words, for a table.
#[derive(Clone, Debug, PartialEq)]
pub struct OrderRow {
    /// The case: `topic::name`; a control's own name.
    pub name: String,
    /// What is promised.
    pub about: String,
    /// The order, with the slopes that count as it.
    pub expected: String,
    /// The slope, or the largest change; empty where nothing was measured.
    pub observed: String,
    /// In a word.
    pub result: &'static str,
    /// Why, where it did not pass.
    pub why: String,
    /// What was measured of its slope.
    pub study: Option<Study>,
    /// What is expected of it.
    pub expects: Option<Expected>,
}

/// The rows of a run; cases that expect nothing of an error have none.
pub fn orders(run: &Run) -> Vec<OrderRow> {
    let row = |case: &CaseResult| {
        let expects = case.expects?;
        let study = case.checks.iter().find_map(|c| c.study.clone());
        Some(OrderRow {
            name: format!("{}::{}", case.topic, case.name),
            about: case.about.clone(),
            expected: expects.words(),
            observed: observed(&expects, study.as_ref(), &case.checks),
            result: case.status.word(),
            why: case.status.why().to_owned(),
            study,
            expects: Some(expects),
        })
    };
    run.cases.iter().filter_map(row).collect()
}

fn observed(expects: &Expected, study: Option<&Study>, checks: &[Check]) -> String {
    match (expects, study) {
        (_, Some(study)) => study.slope.map_or("none".into(), |slope| format!("{slope:.2}")),
        (Expected::NoChange, None) => {
            let figures = checks.iter().filter_map(|c| c.figures.as_ref());
            let worst = figures.min_by(|a, b| a.room.total_cmp(&b.room));
            worst.map_or(String::new(), |f| {
                let found = if f.max == 0.0 { "0".into() } else { format!("{:.1e}", f.max) };
                format!("{found} of {:.1e}", f.max_tolerance)
            })
        }
        // Without a lattice: what was looked at is in the message.
        (Expected::Order { .. }, None) => if checks.is_empty() { "" } else { "exact" }.into(),
    }
}

/// Rules of known order, as rows.
pub fn control_rows() -> Vec<OrderRow> {
    let row = |control: crate::study::Control| {
        let passed = control.study.is(&control.expected);
        OrderRow {
            name: control.name.into(),
            about: "a rule in f64, through the same arithmetic".into(),
            expected: control.expected.words(),
            observed: observed(&control.expected, Some(&control.study), &[]),
            result: if passed { "ok" } else { "FAILED" },
            why: String::new(),
            study: Some(control.study),
            expects: Some(control.expected),
        }
    };
    controls().into_iter().map(row).collect()
}

/// Writes the page of some runs, with the controls.
///
/// # Errors
/// If it cannot be written.
pub fn write_orders(path: &Path, runs: &[Run]) -> Result<(), ReportError> {
    write(path, html(runs).as_bytes())
}

fn html(runs: &[Run]) -> String {
    let mut parts: Vec<Value> = runs.iter().map(|run| part(&run.subject, &run.device, &orders(run))).collect();
    parts.push(part("controls", "", &control_rows()));
    filled(TEMPLATE, &json!({ "runs": parts }))
}

fn part(title: &str, device: &str, rows: &[OrderRow]) -> Value {
    let row = |row: &OrderRow| {
        json!({
            "name": row.name, "about": row.about, "expected": row.expected, "observed": row.observed,
            "result": row.result, "why": row.why, "plot": plot(row),
        })
    };
    json!({ "title": title, "device": device, "rows": rows.iter().map(row).collect::<Vec<_>>() })
}

/// Error over step, with a line of the order expected through the coarsest point.
fn plot(row: &OrderRow) -> Option<String> {
    let (study, Some(Expected::Order { power, .. })) = (row.study.as_ref()?, row.expects) else { return None };
    let mark = |p: &[f64; 2]| Mark { at: *p, spread: None, number: None, title: format!("{:.3e} at {}", p[1], p[0]) };
    let coarsest = study.points.iter().copied().reduce(|a, b| if b[0] > a[0] { b } else { a })?;
    let ideal = |p: &[f64; 2]| mark(&[p[0], coarsest[1] * (p[0] / coarsest[0]).powf(power)]);
    let series = |name: String, marks, guide| Series { name, marks, form: 0, guide };
    let slope = study.slope.map_or("no slope".into(), |s| format!("slope {s:.2}"));
    let plot = Plot {
        title: row.name.clone(),
        axes: [(study.axis.clone(), Unit::Plain), ("error".into(), Unit::Plain)],
        series: vec![
            series(slope, study.points.iter().map(mark).collect(), false),
            series(format!("order {power}"), study.points.iter().map(ideal).collect(), true),
        ],
        front: Vec::new(),
        field: [300.0, 210.0],
    };
    Some(plot.svg())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Status;

    #[test]
    fn page_has_plots_and_asks_for_nothing_from_outside() {
        let study = Study::of("step", [1.0, 0.5, 0.25, 0.125].map(|h: f64| [h, 0.1 * h * h]).to_vec());
        let check = Check { label: "order".into(), passed: true, study: Some(study), ..Check::default() };
        let case = |expects, checks, status| CaseResult {
            subject: "a/b".into(),
            topic: "sampling".into(),
            name: "one".into(),
            about: "</script>".into(),
            needs: Vec::new(),
            expects,
            status,
            checks,
            seconds: 0.0,
        };
        let second = Some(Expected::order(2.0, [1.7, 2.4]));
        let skipped = Status::Skipped("no option \"classification\"".into());
        let cases = vec![
            case(second, vec![check], Status::Passed),
            case(second, vec![], skipped),
            case(None, vec![], Status::Passed),
        ];
        let run = Run { subject: "a/b".into(), device: "b".into(), cases };
        let rows = orders(&run);
        assert_eq!(rows.len(), 2);
        assert_eq!((rows[0].expected.as_str(), rows[0].observed.as_str()), ("2 (1.7 to 2.4)", "2.00"));
        assert_eq!((rows[1].observed.as_str(), rows[1].result), ("", "skipped"));
        let page = html(&[run]);
        assert_eq!(page.matches("<svg").count(), 1 + controls().len());
        assert_eq!(page.matches("</script>").count(), TEMPLATE.matches("</script>").count());
        let outside = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!outside.contains("http") && !page.contains("/*DATA*/") && !page.contains("/*STYLE*/"));
    }
}
