//! A chart as pictures and as one page.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::{Chart, Measure, Point, SceneChart};
use crate::{
    plot::{Mark, Plot, Series, Unit, front},
    report::filled,
};

const TEMPLATE: &str = include_str!("chart.html");

/// Errors below this are drawn here: a logarithm has no zero, and f32 frames are no nearer.
const FLOOR: f64 = 1e-9;

/// One HTML file that needs no other.
pub fn html(chart: &Chart) -> String {
    let several = chart.machines().iter().filter(|m| !m.is_empty()).count() > 1;
    let scene = |scene: &SceneChart| {
        let plots: Vec<Value> = Measure::ALL
            .iter()
            .map(|m| json!({ "measure": m.name(), "svg": svg(scene, *m, several), "front": beaten_by_none(scene, *m) }))
            .collect();
        json!({
            "name": scene.name, "width": scene.width, "height": scene.height, "truth": scene.truth,
            "points": scene.points, "left_out": scene.left_out, "plots": plots,
        })
    };
    let scenes: Vec<_> = chart.scenes.iter().map(scene).collect();
    filled(TEMPLATE, &json!({ "scenes": scenes, "machines": chart.machines() }))
}

/// A scene's points as a picture: error against time, one series a method, with the Pareto front.
/// `machines`: whether series of several machines are told apart.
pub fn svg(scene: &SceneChart, measure: Measure, machines: bool) -> String {
    plot(scene, measure, machines).svg()
}

fn place(point: &Point, measure: Measure) -> Option<[f64; 2]> {
    Some([point.median_s, measure.of(point)?.max(FLOOR)])
}

/// Numbers of the points on the front.
fn beaten_by_none(scene: &SceneChart, measure: Measure) -> Vec<usize> {
    let placed: Vec<_> = (0..scene.points.len()).filter(|&i| place(&scene.points[i], measure).is_some()).collect();
    let places: Vec<_> = placed.iter().filter_map(|&i| place(&scene.points[i], measure)).collect();
    front(&places).into_iter().map(|i| placed[i]).collect()
}

/// Points by their number and place.
type Members = Vec<(usize, [f64; 2])>;

fn plot(scene: &SceneChart, measure: Measure, machines: bool) -> Plot {
    let mut actions: Vec<&str> = Vec::new();
    let mut groups: BTreeMap<(usize, String), Members> = BTreeMap::new();
    for (i, point) in scene.points.iter().enumerate() {
        let Some(at) = place(point, measure) else { continue };
        let form = actions.iter().position(|a| *a == point.action).unwrap_or_else(|| {
            actions.push(&point.action);
            actions.len() - 1
        });
        let on = if machines && !point.machine.is_empty() { format!(" on {}", point.machine) } else { String::new() };
        groups.entry((form, format!("{}{on}", point.series))).or_default().push((i, at));
    }
    let series = groups.into_iter().map(|((form, name), mut members)| {
        // Along the step, where there is one; else by time.
        let step = |i: usize| scene.points[i].step.unwrap_or(0.0);
        members.sort_by(|a, b| step(b.0).total_cmp(&step(a.0)).then(a.1[0].total_cmp(&b.1[0])));
        let marks = members.into_iter().map(|(i, at)| mark(&scene.points[i], i, at)).collect();
        Series { name, marks, form, guide: false }
    });
    let error = match measure {
        Measure::Rmse => "error: root of the mean square",
        Measure::Max => "error: largest of any pixel",
        Measure::P99 => "error: 99 of 100 pixels are nearer",
    };
    let places = |i: usize| place(&scene.points[i], measure);
    Plot {
        title: format!("{}, {} × {}", scene.name, scene.width, scene.height),
        axes: [("time of a frame, median".into(), Unit::Seconds), (error.into(), Unit::Plain)],
        series: series.collect(),
        front: beaten_by_none(scene, measure).into_iter().filter_map(places).collect(),
        field: [640.0, 440.0],
    }
}

fn mark(point: &Point, number: usize, at: [f64; 2]) -> Mark {
    let step = point.step.map_or(String::new(), |h| format!(", step {h:.4}"));
    let title = format!("{}{step}: {:.3} ms, error {:.2e}", point.series, at[0] * 1e3, at[1]);
    Mark { at, spread: Some(point.quartiles_s), number: Some(number), title }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::{TruthNote, VERSION};

    fn chart() -> Chart {
        let point = |series: &str, step, median_s, rmse: f64| Point {
            action: series.split(' ').next().unwrap().into(),
            series: series.into(),
            step,
            median_s,
            quartiles_s: [median_s; 2],
            rmse: Some(rmse),
            picture: Some("data:image/png;base64,AAAA".into()),
            ..Point::default()
        };
        let points = vec![
            point("a", Some(1.0), 0.01, 1e-2),
            point("a", Some(0.5), 0.02, 2.5e-3),
            point("a filter=</script>", Some(0.5), 0.03, 1e-2),
            point("b", None, 0.5, 0.0),
        ];
        let scene = SceneChart {
            name: "x".into(),
            key: "k".into(),
            width: 4,
            height: 3,
            truth: TruthNote::default(),
            points,
            left_out: vec![["c".into(), "c".into(), "it does not".into()]],
        };
        Chart { version: VERSION, scenes: vec![scene] }
    }

    #[test]
    fn each_point_is_drawn_once_and_the_front_has_what_none_beats() {
        let chart = chart();
        let svg = svg(&chart.scenes[0], Measure::Rmse, false);
        for i in 0..4 {
            assert_eq!(svg.matches(&format!("data-i=\"{i}\"")).count(), 1);
        }
        assert_eq!(svg.matches("class=\"series\"").count(), 3);
        assert_eq!(beaten_by_none(&chart.scenes[0], Measure::Rmse), [0, 1, 3]);
        assert!(beaten_by_none(&chart.scenes[0], Measure::Max).is_empty(), "nobody said");
    }

    #[test]
    fn the_page_is_whole_and_asks_for_nothing_from_outside() {
        let page = html(&chart());
        assert_eq!(page.matches("</script>").count(), TEMPLATE.matches("</script>").count());
        assert!(!page.contains("/*DATA*/") && !page.contains("/*STYLE*/"));
        assert!(!page.replace("http://www.w3.org/2000/svg", "").contains("http"));
    }
}
