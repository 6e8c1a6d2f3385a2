//! Errors across the boundary: stable codes, and a message that belongs to the thread.

use std::{any::Any, cell::RefCell, fmt, panic::AssertUnwindSafe};

use thiserror::Error;

use super::abi::{self, Text};

/// What kind of failure a plugin reports. The numbers are part of the boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[expect(missing_docs, reason = "see the codes of the same names in `abi`")]
pub enum Code {
    BadValue,
    BadName,
    OutOfMemory,
    Unsupported,
    Panicked,
    Io,
    Stopped,
    BadState,
    BadVersion,
    Failed,
    /// A code that this build does not know.
    Unknown(i32),
}

const CODES: [(Code, i32, &str); 10] = [
    (Code::BadValue, abi::BAD_VALUE, "bad value"),
    (Code::BadName, abi::BAD_NAME, "bad name"),
    (Code::OutOfMemory, abi::OUT_OF_MEMORY, "out of memory"),
    (Code::Unsupported, abi::UNSUPPORTED, "unsupported"),
    (Code::Panicked, abi::PANICKED, "panicked"),
    (Code::Io, abi::IO, "input or output"),
    (Code::Stopped, abi::STOPPED, "stopped"),
    (Code::BadState, abi::BAD_STATE, "bad state"),
    (Code::BadVersion, abi::BAD_VERSION, "bad version"),
    (Code::Failed, abi::FAILED, "failed"),
];

impl Code {
    /// The code of a number other than 0.
    pub fn from_number(number: i32) -> Self {
        CODES.iter().find(|(_, n, _)| *n == number).map_or(Self::Unknown(number), |(code, _, _)| *code)
    }

    /// The number that crosses the boundary.
    pub fn number(self) -> i32 {
        match self {
            Self::Unknown(number) => number,
            known => CODES.iter().find(|(code, _, _)| *code == known).map_or(abi::FAILED, |(_, n, _)| *n),
        }
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match CODES.iter().find(|(code, _, _)| code == self) {
            Some((_, _, text)) => f.write_str(text),
            None => write!(f, "unknown code {}", self.number()),
        }
    }
}

/// What a plugin reported.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("plugin {plugin:?}: {message} [{code}]")]
pub struct PluginError {
    /// The plugin's name.
    pub plugin: String,
    /// The stable code.
    pub code: Code,
    /// What happened, in the plugin's words.
    pub message: String,
}

/// A failure on one side of the boundary, before it is known whose it is.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{message}")]
pub struct Fault {
    /// The stable code.
    pub code: Code,
    /// What happened.
    pub message: String,
}

impl Fault {
    /// A failure of a kind.
    pub fn new(code: Code, message: impl Into<String>) -> Self {
        Self { code, message: message.into() }
    }

    /// Something that is not as it should be.
    pub fn bad(what: impl fmt::Display, found: impl fmt::Display, wanted: impl fmt::Display) -> Self {
        Self::new(Code::BadValue, format!("{what} is {found}, wanted {wanted}"))
    }

    /// The failure as that of a plugin.
    pub fn of(self, plugin: &str) -> PluginError {
        PluginError { plugin: plugin.into(), code: self.code, message: self.message }
    }
}

/// An error with all its causes on one line.
pub fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        // A transparent error has its cause's words.
        let words = inner.to_string();
        if !text.ends_with(&words) {
            text = format!("{text}: {words}");
        }
        cause = inner.source();
    }
    text
}

thread_local! {
    /// What a plugin left with `set_error`.
    static FROM_PLUGIN: RefCell<Option<String>> = const { RefCell::new(None) };
    /// What the host's functions leave for `last_error`.
    static FROM_HOST: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Keeps what a plugin says before it returns an error.
pub(super) fn leave(message: String) {
    FROM_PLUGIN.with(|kept| *kept.borrow_mut() = Some(message));
}

/// Forgets what a plugin said, before it is called.
pub(super) fn clear() {
    FROM_PLUGIN.with(|kept| *kept.borrow_mut() = None);
}

/// What a plugin's status means.
pub(super) fn result_of(status: i32) -> Result<(), Fault> {
    if status == abi::OK {
        return Ok(());
    }
    let code = Code::from_number(status);
    let message = FROM_PLUGIN.with(|kept| kept.borrow_mut().take()).or_else(super::services::words_of_host);
    Err(Fault::new(code, message.unwrap_or_else(|| "an error without a message".into())))
}

/// The text of the last failure of a host's function on this thread.
pub(super) fn last_of_host() -> Text {
    FROM_HOST.with(|kept| {
        let kept = kept.borrow();
        Text { data: kept.as_ptr(), length: kept.len() as u64 }
    })
}

/// Keeps the words of a failure for `last_error`.
pub(super) fn keep_for_host(message: &str) {
    FROM_HOST.with(|kept| message.clone_into(&mut kept.borrow_mut()));
}

/// Runs `run`; a panic becomes a fault. The payload is forgotten, since its drop could panic, too.
pub(super) fn caught<T>(run: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    match std::panic::catch_unwind(AssertUnwindSafe(run)) {
        Ok(result) => result,
        Err(payload) => {
            let message = words(payload.as_ref());
            std::mem::forget(payload);
            Err(Fault::new(Code::Panicked, message))
        }
    }
}

/// What a panic says.
fn words(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(|s| (*s).to_owned());
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
    text.map_or_else(|| "it panicked".to_owned(), |text| format!("it panicked: {text}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_what_they_were() {
        let numbers: Vec<_> = CODES.iter().map(|(code, n, _)| (code.number(), *n)).collect();
        assert_eq!(numbers, (1..=10).map(|n| (n, n)).collect::<Vec<_>>());
        assert_eq!(Code::from_number(-7), Code::Unknown(-7));
        assert_eq!(Code::from_number(-7).to_string(), "unknown code -7");
    }

    #[test]
    fn panic_becomes_a_fault_and_its_payload_is_not_dropped() {
        struct Bomb;
        impl Drop for Bomb {
            fn drop(&mut self) {
                panic!("in the payload's drop");
            }
        }
        let fault = caught::<()>(|| std::panic::panic_any(Bomb)).unwrap_err();
        assert_eq!((fault.code, fault.message.as_str()), (Code::Panicked, "it panicked"));
        let fault = caught::<()>(|| panic!("at {}", 7)).unwrap_err();
        assert_eq!(fault.message, "it panicked: at 7");
    }

    #[test]
    fn messages_stay_with_their_thread() {
        leave("here".into());
        std::thread::spawn(|| {
            assert_eq!(result_of(abi::IO).unwrap_err().message, "an error without a message");
        })
        .join()
        .unwrap();
        assert_eq!(result_of(abi::IO).unwrap_err(), Fault::new(Code::Io, "here"));
    }
}
