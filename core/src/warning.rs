//! Warnings: things a user should know that are no errors.
//!
//! Each has a stable code. They go to the frame in which they arose and to a process-wide
//! handler, which logs them until the application replaces it with [`set_handler`].

use std::{cell::Cell, fmt, sync::RwLock};

/// How much a warning matters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// A choice was made that the user left open.
    Note,
    /// The picture may not be what the user expects.
    Warning,
}

/// The stable code of a warning, for programs to match on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum WarningCode {
    /// A shape without `unit_distance` got the default one.
    UnitDistanceDefaulted,
    /// A parameter is set that this shape's shader does not declare but another one does.
    UnusedParameter,
    /// The sample distance is coarse against the data or the table.
    CoarseSampling,
    /// The shape lies outside what the camera sees.
    NothingVisible,
    /// A limit changed a setting.
    SettingAdjusted,
    /// The file holds something that was not read.
    FileContent,
    /// Pixels whose certificate is wider than asked.
    NotCertified,
    /// Labels of a segmentation that its table has no entry for.
    LabelWithoutEntry,
    /// What a plugin says under a code of its own.
    Plugin,
}

impl WarningCode {
    /// The code as text, e.g. `unused-parameter`.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::UnitDistanceDefaulted => "unit-distance-defaulted",
            Self::UnusedParameter => "unused-parameter",
            Self::CoarseSampling => "coarse-sampling",
            Self::NothingVisible => "nothing-visible",
            Self::SettingAdjusted => "setting-adjusted",
            Self::FileContent => "file-content",
            Self::NotCertified => "not-certified",
            Self::LabelWithoutEntry => "label-without-entry",
            Self::Plugin => "plugin",
        }
    }
}

/// One warning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// How much it matters.
    pub severity: Severity,
    /// Its stable code.
    pub code: WarningCode,
    /// What it is about: a shape's or a file's name.
    pub subject: String,
    /// What happened, in words.
    pub message: String,
}

impl Warning {
    /// A warning about `subject`.
    pub fn new(code: WarningCode, subject: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, code, subject: subject.into(), message: message.into() }
    }

    /// A note about `subject`.
    pub fn note(code: WarningCode, subject: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Note, ..Self::new(code, subject, message) }
    }

    /// Hands the warning to the process-wide handler.
    pub fn emit(&self) {
        if QUIET.get() {
            return;
        }
        match HANDLER.read().unwrap_or_else(|e| e.into_inner()).as_ref() {
            Some(handler) => handler(self),
            None => log_warning(self),
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} [{}]", self.subject, self.message, self.code.as_str())
    }
}

thread_local! {
    /// Whether somebody else hands on what this thread emits.
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Runs `run`, whose warnings its caller hands on: what this thread emits meanwhile reaches nobody.
pub(crate) fn quietly<T>(run: impl FnOnce() -> T) -> T {
    struct Restore(bool);
    impl Drop for Restore {
        fn drop(&mut self) {
            QUIET.set(self.0);
        }
    }
    let _restore = Restore(QUIET.replace(true));
    run()
}

/// What receives warnings.
pub type Handler = Box<dyn Fn(&Warning) + Send + Sync>;

static HANDLER: RwLock<Option<Handler>> = RwLock::new(None);

/// Replaces the process-wide handler; `None` restores the default, which logs.
pub fn set_handler(handler: Option<Handler>) {
    *HANDLER.write().unwrap_or_else(|e| e.into_inner()) = handler;
}

fn log_warning(warning: &Warning) {
    match warning.severity {
        Severity::Note => log::info!("{warning}"),
        Severity::Warning => log::warn!("{warning}"),
    }
}
