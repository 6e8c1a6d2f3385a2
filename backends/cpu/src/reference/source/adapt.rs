//! Spans halved until halves say what the whole says.
//!
//! Level by level, so that the program is asked for many samples at once. Spans count by the light
//! that reaches them: what lies behind something dense need not be known.

use super::{
    ask::Asker,
    fit::{ALL, Span, places},
    program::{Course, Medium, Sample},
};
use crate::reference::line::EPS;

/// Spans are halved at least this often, so that what is narrow is not overlooked at once.
const LEAST: u8 = 1;
/// And at most this often.
const MOST: u8 = 60;
/// The most spans of a stretch beyond some for each cut; then all are taken as they are, with their
/// errors.
const SPANS: usize = 1 << 14;
/// The spans for each cut.
const EACH: usize = 16;
/// The light below which nothing is looked at.
const DARK: f64 = 1e-14;
/// The relative error of transmittance from which on it is no longer small.
const ROUGH: f64 = 1e-3;

/// The spans of a stretch that is cut at `cuts`, until their errors are below `tolerance` each.
/// `seen` is the light that comes so far.
pub(super) fn spans(asker: &mut Asker<'_>, course: &Course<'_>, cuts: &[f64], tolerance: f64, seen: f64) -> Vec<Span> {
    let whole: Vec<_> = cuts.windows(2).map(|w| ([w[0], w[1]], 0)).collect();
    let mut spans = evaluate(asker, course, &whole);
    let scale = cuts.iter().fold(course.at.abs().max_element(), |m, t| m.max(t.abs()));
    while spans.iter().any(|s| !s.done) {
        let halves: Vec<_> = spans.iter().filter(|s| !s.done).flat_map(halves).collect();
        let mut made = evaluate(asker, course, &halves).into_iter();
        let crowded = spans.len() + halves.len() > SPANS + EACH * cuts.len();
        let mut next = Vec::with_capacity(spans.len() + halves.len());
        let mut left = seen;
        for span in spans {
            if span.done {
                left *= (-span.depth.max(0.0)).exp();
                next.push(span);
                continue;
            }
            let (Some(a), Some(b)) = (made.next(), made.next()) else { break };
            let short = span.t[1] - span.t[0] <= 128.0 * EPS * scale;
            let end = if short {
                End::Point
            } else if crowded || span.level >= MOST {
                End::Late
            } else {
                End::Open
            };
            next.extend(judge(&span, [a, b], left, tolerance, end));
            left *= (-span.depth.max(0.0)).exp();
        }
        spans = next;
    }
    spans
}

/// Whether a span is halved no further.
#[derive(Clone, Copy, PartialEq)]
enum End {
    /// It may be.
    Open,
    /// It has been halved too often.
    Late,
    /// It is a place, to rounding.
    Point,
}

fn halves(span: &Span) -> [([f64; 2], u8); 2] {
    let [start, end] = span.t;
    let middle = 0.5 * (start + end);
    [([start, middle], span.level + 1), ([middle, end], span.level + 1)]
}

fn evaluate(asker: &mut Asker<'_>, course: &Course<'_>, parts: &[([f64; 2], u8)]) -> Vec<Span> {
    let at = |t: f64| Sample { t, ..Sample::default() };
    let samples: Vec<Sample> = parts.iter().flat_map(|(t, _)| places(*t)).map(at).collect();
    let media = asker.media(course, &samples);
    let all = |m: &[Medium]| std::array::from_fn(|k| m[k]);
    parts.iter().zip(media.chunks_exact(ALL)).map(|((t, level), m)| Span::new(*t, *level, all(m))).collect()
}

/// The halves of a span, done if they say what it says or if it is at its end.
fn judge(whole: &Span, [mut a, mut b]: [Span; 2], front: f64, tolerance: f64, end: End) -> [Span; 2] {
    let mixed = whole.is_mixed() || a.is_mixed() || b.is_mixed();
    let (one, two) = ((-whole.depth).exp(), (-a.depth - b.depth).exp());
    let through = (-a.depth).exp();
    let light = |c: usize| (whole.light[c] - (a.light[c] + through * b.light[c])).abs();
    let (faded, light) = ((one - two).abs(), light(0).max(light(1)).max(light(2)));
    let relative = if one == two { 0.0 } else { (whole.depth - a.depth - b.depth).abs() };
    let gone = front * one.max(two) <= 0.01 * tolerance;
    // A step next to an end is not missed less by a half.
    let miss = a.miss.max(b.miss);
    let smooth = miss <= 0.25 * whole.miss || front * miss <= tolerance || gone;
    let known = !mixed && smooth && front * faded.max(light) <= tolerance && (relative <= ROUGH || gone);
    let dark = front <= DARK;
    if dark || end != End::Open || known && whole.level >= LEAST {
        let error = match end {
            _ if dark || mixed && end == End::Point => [0.0; 2],
            _ if mixed => [1.0; 2],
            // Where next to nothing is left, how much is does not matter.
            _ if gone => [0.0, light + faded],
            _ => [relative.min(1.0), light],
        };
        (a.error, b.error) = (error.map(|e| 0.5 * e), error.map(|e| 0.5 * e));
        (a.done, b.done) = (true, true);
    }
    [a, b]
}
