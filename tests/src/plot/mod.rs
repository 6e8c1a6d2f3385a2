//! Log-log plots as SVG, by themselves or within a page.
//!
//! A picture of its own says all that it needs (fonts by family, colours by name); within a page its ink
//! and paper are the page's, `--ink` and `--paper`. Marks carry the number that their maker gave them
//! (`data-i`), so that a page can answer for each.

mod scale;

use std::fmt::Write as _;

pub use scale::{Scale, Unit};

/// Colours that are told apart also by those who see fewer (M. Okabe and K. Ito, *Color Universal Design*,
/// 2008), and three more.
const COLORS: [&str; 10] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c564b", "#7f7f7f", "#9467bd", "#a6a400"];

/// Forms of marks.
const FORMS: usize = 6;

/// A point.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Along and up; both above 0.
    pub at: [f64; 2],
    /// How far it may lie to the left and right: first and third quartile.
    pub spread: Option<[f64; 2]>,
    /// Its maker's number.
    pub number: Option<usize>,
    /// What it says of itself without a page.
    pub title: String,
}

/// Points that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// The points, joined in this order.
    pub marks: Vec<Mark>,
    /// Which form marks have; series of one kind share one.
    pub form: usize,
    /// Whether it is a line only, thin and broken: a guide.
    pub guide: bool,
}

/// A line through the lower left corner of some marks: the Pareto front.
pub type Front = Vec<[f64; 2]>;

/// A log-log plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Above it.
    pub title: String,
    /// Along and up: what, and in which unit.
    pub axes: [(String, Unit); 2],
    /// The series, in the legend's order.
    pub series: Vec<Series>,
    /// Its front, where it has one.
    pub front: Front,
    /// Width and height of the field, without legend and labels.
    pub field: [f64; 2],
}

const LEFT: f64 = 74.0;
const TOP: f64 = 34.0;
const BELOW: f64 = 52.0;
const ROW: f64 = 17.0;

impl Plot {
    /// The picture.
    pub fn svg(&self) -> String {
        let scales = self.scales();
        let [w, h] = self.field;
        let legend = self.legend_width();
        let rows = self.series.len() + usize::from(!self.front.is_empty());
        let height = (TOP + h + BELOW).max(TOP + ROW * rows as f64 + 12.0);
        // Bold letters of 14 px are some 8.6 wide.
        let width = (LEFT + w + 16.0 + legend).max(LEFT + 8.6 * self.title.chars().count() as f64);
        let mut out = String::new();
        _ = writeln!(
            out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" role=\"img\" font-family=\"system-ui, sans-serif\" font-size=\"12\">\n\
             <title>{0}</title>\n<rect width=\"100%\" height=\"100%\" style=\"fill:var(--paper,#fff)\"/>\n\
             <text x=\"{LEFT}\" y=\"20\" font-size=\"14\" font-weight=\"600\" style=\"fill:var(--ink,#1c2330)\">{0}</text>",
            escape(&self.title)
        );
        self.grid(&mut out, &scales);
        _ = writeln!(out, "<g transform=\"translate({LEFT},{TOP})\">");
        if !self.front.is_empty() {
            self.front(&mut out, &scales);
        }
        for (i, series) in self.series.iter().enumerate() {
            self.series(&mut out, series, COLORS[i % COLORS.len()], &scales);
        }
        out.push_str("</g>\n");
        self.legend(&mut out);
        out.push_str("</svg>\n");
        out
    }

    fn scales(&self) -> [Scale; 2] {
        [0, 1].map(|axis| {
            let marks = self.series.iter().flat_map(|s| &s.marks).map(move |m| m.at[axis]);
            Scale::over(marks, if axis == 0 { [0.0, self.field[0]] } else { [self.field[1], 0.0] })
        })
    }

    fn grid(&self, out: &mut String, scales: &[Scale; 2]) {
        let [w, h] = self.field;
        let (ink, soft) = ("style=\"fill:var(--ink,#1c2330)\"", "style=\"fill:var(--soft,#5c6675)\"");
        _ = writeln!(out, "<g transform=\"translate({LEFT},{TOP})\">");
        for (tick, strong) in scales[0].ticks() {
            let x = scales[0].place(tick);
            line(out, [x, 0.0, x, h], strong);
            if strong {
                let text = self.axes[0].1.tick(tick);
                _ = writeln!(
                    out,
                    "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\" {soft}>{text}</text>",
                    h + 17.0
                );
            }
        }
        for (tick, strong) in scales[1].ticks() {
            let y = scales[1].place(tick);
            line(out, [0.0, y, w, y], strong);
            if strong {
                let text = self.axes[1].1.tick(tick);
                _ = writeln!(out, "<text x=\"-7\" y=\"{:.1}\" text-anchor=\"end\" {soft}>{text}</text>", y + 4.0);
            }
        }
        _ = writeln!(
            out,
            "<rect width=\"{w}\" height=\"{h}\" fill=\"none\" style=\"stroke:var(--soft,#5c6675)\" stroke-width=\"1\"/>\n\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" {ink}>{}</text>\n\
             <text transform=\"translate(-56,{:.1}) rotate(-90)\" text-anchor=\"middle\" {ink}>{}</text>\n</g>",
            w / 2.0,
            h + 40.0,
            escape(&self.axes[0].0),
            h / 2.0,
            escape(&self.axes[1].0),
        );
    }

    fn front(&self, out: &mut String, scales: &[Scale; 2]) {
        let mut path = String::new();
        for (i, point) in self.front.iter().enumerate() {
            let [x, y] = [0, 1].map(|a| scales[a].place(point[a]));
            // To the right at the same error, then down to the next: what is above is beaten.
            _ = if i == 0 { write!(path, "M{x:.1} {y:.1}") } else { write!(path, "H{x:.1}V{y:.1}") };
        }
        _ = writeln!(
            out,
            "<path class=\"front\" d=\"{path}\" fill=\"none\" style=\"stroke:var(--ink,#1c2330)\" stroke-width=\"5\" \
             opacity=\"0.22\" stroke-linejoin=\"round\"/>"
        );
    }

    fn series(&self, out: &mut String, series: &Series, color: &str, scales: &[Scale; 2]) {
        let places: Vec<[f64; 2]> =
            series.marks.iter().map(|m| [0, 1].map(|axis| scales[axis].place(m.at[axis]))).collect();
        let path: Vec<_> = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let dash = if series.guide { " stroke-dasharray=\"4 4\"" } else { "" };
        _ = writeln!(
            out,
            "<g class=\"series\" data-series=\"{}\"><polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" \
             stroke-width=\"1.3\" opacity=\"0.75\"{dash}/>",
            escape(&series.name),
            path.join(" ")
        );
        for (mark, [x, y]) in series.marks.iter().zip(places).filter(|_| !series.guide) {
            if let Some(spread) = mark.spread {
                let [a, b] = spread.map(|v| scales[0].place(v));
                _ = writeln!(out, "<path d=\"M{a:.1} {y:.1}H{b:.1}\" stroke=\"{color}\" stroke-width=\"1\"/>");
            }
            let number = mark.number.map_or(String::new(), |n| format!(" data-i=\"{n}\" tabindex=\"0\""));
            let title = escape(&mark.title);
            _ = writeln!(
                out,
                "<path class=\"mark\"{number} transform=\"translate({x:.1},{y:.1})\" d=\"{}\" fill=\"{color}\" \
                 style=\"stroke:var(--paper,#fff)\" stroke-width=\"0.8\"><title>{title}</title></path>",
                form(series.form)
            );
        }
        out.push_str("</g>\n");
    }

    fn legend(&self, out: &mut String) {
        let x = LEFT + self.field[0] + 18.0;
        let text = "style=\"fill:var(--ink,#1c2330)\"";
        for (i, series) in self.series.iter().enumerate() {
            let (y, color) = (TOP + 8.0 + ROW * i as f64, COLORS[i % COLORS.len()]);
            let name = escape(&series.name);
            let sign = if series.guide {
                format!("<path d=\"M-6 0H6\" stroke=\"{color}\" stroke-dasharray=\"4 4\"/>")
            } else {
                format!("<path d=\"{}\" fill=\"{color}\"/>", form(series.form))
            };
            _ = writeln!(
                out,
                "<g class=\"key\" data-series=\"{name}\" transform=\"translate({x:.1},{y:.1})\">{sign}\
                 <text x=\"12\" y=\"4\" {text}>{name}</text></g>"
            );
        }
        if !self.front.is_empty() {
            let y = TOP + 8.0 + ROW * self.series.len() as f64;
            _ = writeln!(
                out,
                "<g transform=\"translate({x:.1},{y:.1})\"><path d=\"M-6 0H6\" style=\"stroke:var(--ink,#1c2330)\" \
                 stroke-width=\"5\" opacity=\"0.22\"/><text x=\"12\" y=\"4\" {text}>Pareto front</text></g>"
            );
        }
    }

    fn legend_width(&self) -> f64 {
        let longest = self.series.iter().map(|s| s.name.chars().count()).max().unwrap_or(0);
        // Letters of 12 px are some 6.3 wide.
        if longest == 0 { 0.0 } else { 34.0 + 6.4 * longest.max(12) as f64 }
    }
}

fn line(out: &mut String, [x0, y0, x1, y1]: [f64; 4], strong: bool) {
    let opacity = if strong { 1.0 } else { 0.45 };
    _ = writeln!(
        out,
        "<path d=\"M{x0:.1} {y0:.1}L{x1:.1} {y1:.1}\" style=\"stroke:var(--line,#dfe3ea)\" opacity=\"{opacity}\"/>"
    );
}

/// The outline of a mark around (0, 0).
fn form(form: usize) -> &'static str {
    match form % FORMS {
        0 => "M-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0 -9 0z",
        1 => "M-4 -4h8v8h-8z",
        2 => "M0 -5.5L5.2 4H-5.2z",
        3 => "M0 -5.8L5.8 0L0 5.8L-5.8 0z",
        4 => "M0 5.5L5.2 -4H-5.2z",
        _ => "M-1.6 -5h3.2v3.4h3.4v3.2h-3.4v3.4h-3.2v-3.4h-3.4v-3.2h3.4z",
    }
}

/// The points that no other beats in both numbers, from the first to the last along.
pub fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]).then(points[a][1].total_cmp(&points[b][1])));
    let mut least = f64::INFINITY;
    order.retain(|&i| {
        let better = points[i][1] < least;
        least = least.min(points[i][1]);
        better
    });
    order
}

/// Text within markup.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> Plot {
        let mark = |at, number| Mark { at, spread: Some([at[0] * 0.9, at[0] * 1.1]), number, title: "a <b>".into() };
        let series = |name: &str, guide| Series {
            name: name.into(),
            marks: vec![mark([1e-3, 1e-2], Some(7)), mark([1e-1, 1e-6], None)],
            form: 1,
            guide,
        };
        Plot {
            title: "x & y".into(),
            axes: [("time".into(), Unit::Seconds), ("error".into(), Unit::Plain)],
            series: vec![series("one", false), series("order 2", true)],
            front: vec![[1e-3, 1e-2], [1e-1, 1e-6]],
            field: [400.0, 300.0],
        }
    }

    #[test]
    fn marks_carry_their_number_and_texts_are_escaped() {
        let svg = plot().svg();
        assert_eq!(svg.matches("data-i=\"7\"").count(), 1);
        assert_eq!(svg.matches("class=\"mark\"").count(), 2, "guides have no marks");
        assert!(svg.contains("x &amp; y") && svg.contains("a &lt;b&gt;") && svg.contains("Pareto front"));
        assert!(svg.contains(">1 ms<") && svg.contains(">10⁻⁴<"));
    }

    #[test]
    fn front_has_what_none_beats() {
        let points = [[1.0, 5.0], [2.0, 6.0], [3.0, 1.0], [3.0, 0.5], [9.0, 0.5], [0.5, 7.0]];
        assert_eq!(front(&points), [5, 0, 3]);
        assert!(front(&[]).is_empty());
    }

    #[test]
    fn a_plot_without_points_is_still_a_picture() {
        let empty = Plot { series: Vec::new(), front: Vec::new(), ..plot() };
        assert!(empty.svg().ends_with("</svg>\n") && !empty.svg().contains("NaN"));
    }
}
