//! `docs/stability.md` and its charts, written from the families and from what was measured.

use std::fmt::Write as _;

use super::{Bound, Curve, Family, Ladder, Measured, Missing};
use crate::plot::{Mark, Plot, Series, Unit};

/// What stands above the families.
pub const HEAD: &str = include_str!("head.md");

/// Errors below this are drawn there.
const FLOOR: f64 = 1e-9;

/// The document: families with, for each ladder, what was measured.
pub fn markdown(measured: &[(Family, Vec<Vec<Curve>>)]) -> String {
    let mut out = format!("{HEAD}\n");
    for (family, _) in measured {
        _ = writeln!(out, "- [{}](#{})", heading(family), anchor(&heading(family)));
    }
    for (family, ladders) in measured {
        _ = write!(out, "\n## {}\n\n{}\n", heading(family), family.about);
        for (ladder, curves) in family.ladders.iter().zip(ladders) {
            section(&mut out, ladder, curves);
        }
        _ = write!(out, "\n### What Volact does about {}\n\n", family.number);
        for line in answers(family) {
            out.push_str(&line);
            out.push('\n');
        }
    }
    out
}

/// A family's heading.
pub fn heading(family: &Family) -> String {
    format!("{}. {}", family.number, family.title)
}

/// What Volact does, a line each.
pub fn answers(family: &Family) -> Vec<String> {
    family.answers.iter().map(|a| format!("- **{}**: {}", a.does.word(), a.what)).collect()
}

/// What is said of a method: the first columns of its row.
pub fn statement(name: &str, bound: &Bound) -> String {
    let words = match bound {
        Bound::Holds(0.0) => "holds: no difference".into(),
        Bound::Holds(most) => format!("holds: at most {most:e}"),
        Bound::Fails { worst: [low, high], easy } => {
            format!("**fails**: {low:e} to {high:e}; at the easy end at most {easy:e}")
        }
        Bound::Refuses { words, error } => format!("**refuses** in the end (“{words}”); before, at most {error:e}"),
    };
    format!("| {name} | {words} |")
}

/// What a ladder's chart shows.
pub fn caption(ladder: &Ladder) -> String {
    format!("Knob: {}. Truth: {}.", ladder.knob, ladder.truth)
}

fn anchor(heading: &str) -> String {
    let kept = heading.to_lowercase().chars().filter(|c| c.is_alphanumeric() || " -".contains(*c)).collect::<String>();
    kept.replace(' ', "-")
}

fn section(out: &mut String, ladder: &Ladder, curves: &[Curve]) {
    _ = write!(
        out,
        "\n### {}\n\n![{}](stability/{}.svg)\n\n{}\n\n| method | bounds |",
        ladder.title,
        ladder.title,
        ladder.name,
        caption(ladder)
    );
    for at in &ladder.rungs {
        _ = write!(out, " {} |", short(*at));
    }
    _ = writeln!(out, "\n|---|---|{}", "---|".repeat(ladder.rungs.len()));
    for curve in curves {
        _ = write!(out, "{}", statement(curve.name, &curve.bound));
        for error in &curve.errors {
            _ = write!(out, " {} |", cell(error));
        }
        out.push('\n');
    }
}

fn cell(error: &Measured) -> String {
    match error {
        Ok(e) if e.is_nan() || e.is_infinite() => "∞".into(),
        Ok(0.0) => "0".into(),
        Ok(e) => format!("{e:.0e}"),
        Err(Missing::Skipped(_)) => "–".into(),
        Err(Missing::Refused(_)) => "refused".into(),
    }
}

/// A knob's number: short as it is, or with an exponent.
fn short(value: f64) -> String {
    let plain = value.to_string();
    let near = (1e-3..1e6).contains(&value) && plain.len() <= 8;
    if near { plain } else { format!("{value:e}") }
}

/// The chart of a ladder.
pub fn chart(ladder: &Ladder, curves: &[Curve]) -> Plot {
    let series = curves.iter().enumerate().map(|(i, curve)| {
        let marks = ladder.rungs.iter().zip(&curve.errors).filter_map(|(at, error)| {
            let error = *error.as_ref().ok()?;
            let title = format!("{}: {} at {}", curve.name, cell(&Ok(error)), short(*at));
            let up = if error.is_nan() { f64::INFINITY } else { error };
            Some(Mark { at: [*at, up.clamp(FLOOR, 10.0)], spread: None, number: None, title })
        });
        let form = if matches!(curve.bound, Bound::Fails { .. }) { 3 } else { i % 3 };
        Series { name: curve.name.into(), marks: marks.collect(), form, guide: false }
    });
    Plot {
        title: ladder.title.into(),
        axes: [(ladder.knob.into(), Unit::Plain), ("largest error".into(), Unit::Plain)],
        series: series.collect(),
        front: Vec::new(),
        field: [420.0, 260.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.5, 1e-9, 65_536.0, 4.999_999, 1e-300].map(short), ["0.5", "1e-9", "65536", "4.999999", "1e-300"]);
        assert_eq!(cell(&Ok(0.012)), "1e-2");
        assert_eq!(cell(&Ok(f64::NAN)), "∞");
    }

    #[test]
    fn statements_give_both_sides() {
        let fails = Bound::Fails { worst: [0.1, 0.5], easy: 0.01 };
        assert_eq!(statement("m", &fails), "| m | **fails**: 1e-1 to 5e-1; at the easy end at most 1e-2 |");
    }
}
