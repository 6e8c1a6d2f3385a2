//! Shows on a terminal that something is going on; elsewhere, nothing.

use std::{io::IsTerminal, sync::Mutex, time::Duration};

use indicatif::{ProgressBar, ProgressStyle};
use volact::Progress;

/// A line that shows the progress of a load or, as there is no measure of it, the time of a
/// render. It goes away when dropped.
pub struct Line(Mutex<Option<ProgressBar>>);

impl Line {
    /// A line, if standard error is a terminal and the user wants to hear.
    pub fn new(message: impl Into<String>) -> Self {
        let shown = std::io::stderr().is_terminal() && !super::quiet();
        let bar = shown.then(|| {
            let bar = ProgressBar::new_spinner().with_message(message.into());
            bar.set_style(style("{spinner} {msg} {elapsed}"));
            bar.enable_steady_tick(Duration::from_millis(120));
            bar
        });
        Self(Mutex::new(bar))
    }
}

impl Progress for Line {
    fn advance(&self, done: u64, total: u64) -> bool {
        let guard = self.0.lock().unwrap_or_else(|e| e.into_inner());
        if let Some(bar) = guard.as_ref() {
            if bar.length() != Some(total) {
                bar.set_length(total);
                bar.set_style(style("{spinner} {msg} {bar:30} {bytes} of {total_bytes}, {eta} left"));
            }
            bar.set_position(done);
        }
        true
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        if let Some(bar) = self.0.get_mut().unwrap_or_else(|e| e.into_inner()).take() {
            bar.finish_and_clear();
        }
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_spinner())
}
