//! The page: a template with the results as data.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::{FLOOR, LOOSE, ReportError, picture};
use crate::outcome::{Check, Run};

const TEMPLATE: &str = include_str!("page.html");

/// What all pages have: colours by day and night, texts and tables.
const STYLE: &str = include_str!("style.css");

/// A page out of its template, with the style of all pages and its data. The data come last: what they
/// hold is not looked at for places.
pub fn filled(template: &str, data: &Value) -> String {
    // `</script>` in a text would end the data.
    let data = data.to_string().replace("</", "<\\/");
    template.replacen("/*STYLE*/", STYLE, 1).replacen("/*DATA*/", &data, 1)
}

/// One HTML file that needs no other.
///
/// # Errors
/// If a picture cannot be encoded.
pub fn html(runs: &[Run]) -> Result<String, ReportError> {
    let runs = runs.iter().map(run).collect::<Result<Vec<_>, _>>()?;
    let data = json!({ "loose": LOOSE, "floor": FLOOR, "runs": runs });
    Ok(filled(TEMPLATE, &data))
}

fn run(run: &Run) -> Result<Value, ReportError> {
    let mut cases = Vec::new();
    for case in &run.cases {
        let checks = case.checks.iter().map(check).collect::<Result<Vec<_>, _>>()?;
        cases.push(json!({
            "topic": case.topic,
            "name": case.name,
            "about": case.about,
            "needs": case.needs,
            "status": case.status.word(),
            "why": case.status.why(),
            "room": case.room(),
            "seconds": case.seconds,
            "checks": checks,
        }));
    }
    Ok(json!({ "subject": run.subject, "device": run.device, "summary": run.summary(), "cases": cases }))
}

fn check(check: &Check) -> Result<Value, ReportError> {
    let sheet = match &check.sheet {
        Some(sheet) => {
            let [expected, actual, heat] = picture::all(sheet)?;
            let few = sheet.width * sheet.height <= 4;
            let numbers = few.then(|| numbers(&sheet.expected, &sheet.actual));
            json!({ "width": sheet.width, "height": sheet.height, "expected": expected, "actual": actual, "heat": heat,
                "numbers": numbers })
        }
        None => Value::Null,
    };
    Ok(json!({
        "label": check.label,
        "truth": check.truth,
        "passed": check.passed,
        "message": check.message,
        "figures": check.figures,
        "method": check.method,
        "scene": check.scene,
        "sheet": sheet,
    }))
}

/// The numbers of pictures of a pixel or few.
fn numbers(expected: &[[f32; 4]], actual: &[[f32; 4]]) -> String {
    let mut out = String::new();
    for (e, a) in expected.iter().zip(actual) {
        _ = writeln!(out, "expected {e:?}\nactual   {a:?}");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::{CaseResult, Status};

    #[test]
    fn the_page_is_whole_and_asks_for_nothing_from_outside() {
        let case = CaseResult {
            subject: "cpu/x".into(),
            topic: "tables".into(),
            name: "one".into(),
            about: "a </script> in a text".into(),
            needs: vec!["shader lut".into()],
            expects: None,
            status: Status::Passed,
            checks: Vec::new(),
            seconds: 0.1,
        };
        let page = html(&[Run { subject: "cpu/x".into(), device: "x".into(), cases: vec![case] }]).unwrap();
        assert_eq!(page.matches("</script>").count(), TEMPLATE.matches("</script>").count());
        assert!(page.contains("\"topic\":\"tables\"") && !page.contains("/*DATA*/"));
        assert!(!page.contains("http://") && !page.contains("https://"), "nothing is loaded");
    }
}
