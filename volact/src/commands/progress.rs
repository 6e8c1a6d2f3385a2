//! Shows on a terminal that something is going on; elsewhere, nothing.

use std::{
    io::IsTerminal,
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use indicatif::{ProgressBar, ProgressStyle};
use volact::{Progress, core::action::Watch};

/// The line that is shown, if one is, with its own message.
static SHOWN: Mutex<Option<(ProgressBar, String)>> = Mutex::new(None);

/// A line that shows the progress of a load, of an action's preparations or, where there is no
/// measure of it, the time of a render. It goes away when dropped; there is one at a time.
pub struct Line(());

impl Line {
    /// A line, if standard error is a terminal and the user wants to hear.
    pub fn new(message: impl Into<String>) -> Self {
        let shown = std::io::stderr().is_terminal() && !super::quiet();
        *lock() = shown.then(|| {
            let message = message.into();
            let bar = ProgressBar::new_spinner().with_message(message.clone());
            bar.set_style(style("{spinner} {msg} {elapsed}"));
            bar.enable_steady_tick(Duration::from_millis(120));
            (bar, message)
        });
        Self(())
    }
}

impl Line {
    /// Shows what is done now, and how many of how many were.
    pub fn count(&self, what: &str, done: u64, total: u64) {
        if let Some((bar, message)) = lock().as_mut() {
            what.clone_into(message);
            bar.set_message(message.clone());
            measure(bar, done, total, "{spinner} {msg} {bar:30} {pos} of {len}, {eta} left");
        }
    }
}

impl Progress for Line {
    fn advance(&self, done: u64, total: u64) -> bool {
        if let Some((bar, _)) = lock().as_ref() {
            measure(bar, done, total, "{spinner} {msg} {bar:30} {bytes} of {total_bytes}, {eta} left");
        }
        true
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        if let Some((bar, _)) = lock().take() {
            bar.finish_and_clear();
        }
    }
}

/// Shows an action's long preparations on the line that there is.
pub fn watch() -> Watch {
    Watch::new(|what, done, total| {
        let shown = lock();
        let Some((bar, message)) = shown.as_ref() else { return };
        if done >= total {
            bar.set_message(message.clone());
            bar.set_style(style("{spinner} {msg} {elapsed}"));
            bar.unset_length();
        } else {
            bar.set_message(what.to_owned());
            measure(bar, done, total, "{spinner} {msg} {bar:30} {percent} %, {eta} left");
        }
    })
}

fn lock() -> MutexGuard<'static, Option<(ProgressBar, String)>> {
    SHOWN.lock().unwrap_or_else(PoisonError::into_inner)
}

fn measure(bar: &ProgressBar, done: u64, total: u64, template: &str) {
    if bar.length() != Some(total) {
        bar.set_length(total);
        bar.set_style(style(template));
    }
    bar.set_position(done);
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_spinner())
}
