//! A histogram in text.

/// Rows of the chart.
const ROWS: usize = 8;
/// From an eighth of a row to all of it.
const EIGHTHS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// How bars are drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Unicode blocks, eight steps a row.
    Blocks,
    /// `#`, for files and pipes.
    Plain,
}

/// A histogram, one column a bin.
pub struct Chart<'a> {
    /// What was counted.
    pub counts: &'a [u64],
    /// The values at the left and right ends.
    pub range: [f64; 2],
    /// Heights by the logarithm of 1 + count.
    pub log: bool,
    /// How bars are drawn.
    pub style: Style,
}

impl Chart<'_> {
    /// The chart with the range under it; lines end in a newline and carry no trailing blanks.
    pub fn draw(&self) -> String {
        let height = |n: u64| if self.log { (n as f64).ln_1p() } else { n as f64 };
        let highest = self.counts.iter().map(|&n| height(n)).fold(0.0, f64::max);
        // What is there shows at least as the smallest mark.
        let eighths = |n: u64| match n {
            0 => 0,
            _ => ((height(n) / highest * (8 * ROWS) as f64).round() as usize).max(1),
        };
        let bars: Vec<usize> = self.counts.iter().map(|&n| eighths(n)).collect();
        let mut text = String::new();
        for row in (0..ROWS).rev() {
            let line: String = bars.iter().map(|bar| self.mark(bar.saturating_sub(8 * row).min(8))).collect();
            text.push_str(line.trim_end());
            text.push('\n');
        }
        text + &self.axis() + "\n"
    }

    fn mark(&self, eighths: usize) -> char {
        match self.style {
            Style::Blocks => EIGHTHS[eighths],
            Style::Plain if eighths >= 4 => '#',
            Style::Plain if eighths > 0 => '.',
            Style::Plain => ' ',
        }
    }

    fn axis(&self) -> String {
        let [left, right] = self.range.map(super::number);
        let middle = if self.log { " (log)" } else { "" };
        let gap = self.counts.len().saturating_sub(left.len() + middle.len() + right.len()).max(1);
        format!("{left}{middle}{}{right}", " ".repeat(gap))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_as_high_as_counts() {
        let counts = [64, 32, 0, 1, 8];
        let chart = Chart { counts: &counts, range: [0.0, 4.0], log: false, style: Style::Blocks };
        let text = chart.draw();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines, ["█", "█", "█", "█", "██", "██", "██", "██ ▁█", "0   4"]);
    }

    #[test]
    fn plain_charts_are_ascii() {
        let counts = [1000, 1, 30];
        let chart = Chart { counts: &counts, range: [-1.5, 2.0], log: true, style: Style::Plain };
        let text = chart.draw();
        assert!(text.is_ascii());
        assert_eq!(text.lines().filter(|l| l.starts_with('#')).count(), ROWS);
        assert!(text.ends_with("-1.5 (log) 2\n"));
    }

    #[test]
    fn nothing_counted_draws_nothing() {
        let chart = Chart { counts: &[0, 0], range: [0.0; 2], log: true, style: Style::Blocks };
        assert!(chart.draw().lines().take(ROWS).all(str::is_empty));
    }
}
