//! Memory for what is shown to the other side during one call, and text that comes from there.

use std::{any::Any, ffi::c_void};

use super::{
    abi::{ArrayView, Parameter, Parameters, Text},
    status::{Code, Fault},
};

/// The longest text that is taken from the other side.
const MAX_TEXT: u64 = 1 << 24;

/// The most entries of a list of texts, declarations, shapes and the like.
pub(super) const MAX_LIST: u64 = 1 << 20;

/// Keeps what views point to.
#[derive(Default)]
pub(super) struct Arena(Vec<Box<dyn Any + Send + Sync>>);

impl Arena {
    /// Keeps a text.
    pub fn text(&mut self, text: &str) -> Text {
        self.bytes(text.as_bytes())
    }

    /// Keeps bytes as a text.
    pub fn bytes(&mut self, bytes: &[u8]) -> Text {
        let (data, length) = self.list(bytes.to_vec());
        Text { data, length }
    }

    /// Keeps a list.
    pub fn list<T: 'static>(&mut self, values: Vec<T>) -> (*const T, u64) {
        if values.is_empty() {
            return (std::ptr::null(), 0);
        }
        // A raw pointer from the start: a box says that nobody else points to what it holds.
        let kept = Box::into_raw(values.into_boxed_slice());
        self.0.push(Box::new(Kept(kept)));
        (kept.cast::<T>().cast_const(), kept.len() as u64)
    }

    /// Keeps one value.
    pub fn one<T: 'static>(&mut self, value: T) -> *const T {
        self.list(vec![value]).0
    }

    /// Keeps named values.
    pub fn parameters(&mut self, parameters: Vec<Parameter>) -> Parameters {
        let (data, count) = self.list(parameters);
        Parameters { data, count }
    }

    /// Releases a view's reference when the arena goes.
    pub fn own(&mut self, view: &ArrayView) {
        self.0.push(Box::new(Reference { owner: view.owner, release: view.release }));
    }

    /// Keeps anything.
    pub fn keep(&mut self, value: impl Any + Send + Sync) {
        self.0.push(Box::new(value));
    }
}

/// What a list was made of; only read until it is dropped.
struct Kept<T>(*mut [T]);

impl<T> Drop for Kept<T> {
    fn drop(&mut self) {
        // SAFETY: the pointer is that of a box, and is given up only here.
        drop(unsafe { Box::from_raw(self.0) });
    }
}

// SAFETY: kept values are plain data, only read through the views, and views say for how long.
unsafe impl<T> Send for Kept<T> {}
// SAFETY: as for Send.
unsafe impl<T> Sync for Kept<T> {}

/// One reference to something of the other side, released once.
pub(super) struct Reference {
    pub owner: *mut c_void,
    pub release: Option<unsafe extern "C" fn(*mut c_void)>,
}

// SAFETY: the boundary's rules say that owners can be released from any thread.
unsafe impl Send for Reference {}
// SAFETY: as for Send.
unsafe impl Sync for Reference {}

impl Drop for Reference {
    fn drop(&mut self) {
        if let Some(release) = self.release {
            let _state = super::float::FloatState::save();
            // SAFETY: this reference is one that its owner counted, and it is released only here.
            unsafe { release(self.owner) };
        }
    }
}

/// The bytes of a text.
///
/// # Safety
/// `text.data` is null or valid for `text.length` bytes for `'a`.
pub(super) unsafe fn bytes_of<'a>(text: Text, what: &str) -> Result<&'a [u8], Fault> {
    if text.length == 0 {
        return Ok(&[]);
    }
    if text.data.is_null() {
        return Err(Fault::bad(what, "a null pointer", format!("{} bytes", text.length)));
    }
    if text.length > MAX_TEXT {
        return Err(Fault::bad(format!("length of {what}"), text.length, format!("at most {MAX_TEXT} bytes")));
    }
    // SAFETY: not null, and the caller promises the rest.
    Ok(unsafe { std::slice::from_raw_parts(text.data, text.length as usize) })
}

/// A text that is checked to be UTF-8.
///
/// # Safety
/// As [`bytes_of`].
pub(super) unsafe fn str_of<'a>(text: Text, what: &str) -> Result<&'a str, Fault> {
    // SAFETY: as promised by the caller.
    let bytes = unsafe { bytes_of(text, what)? };
    std::str::from_utf8(bytes).map_err(|_| {
        let message = format!("{what} is \"{}\", wanted UTF-8", bytes[..bytes.len().min(64)].escape_ascii());
        Fault::new(Code::BadName, message)
    })
}

/// A text of its own.
///
/// # Safety
/// As [`bytes_of`].
pub(super) unsafe fn string_of(text: Text, what: &str) -> Result<String, Fault> {
    // SAFETY: as promised by the caller.
    unsafe { str_of(text, what) }.map(str::to_owned)
}

/// A list from the other side.
///
/// # Safety
/// `data` is null or valid for `count` values for `'a`.
pub(super) unsafe fn list_of<'a, T>(data: *const T, count: u64, what: &str) -> Result<&'a [T], Fault> {
    if count == 0 {
        return Ok(&[]);
    }
    if data.is_null() {
        return Err(Fault::bad(what, "a null pointer", format!("{count} of them")));
    }
    if !data.is_aligned() {
        return Err(Fault::bad(format!("address of {what}"), format!("{data:p}"), "an aligned one"));
    }
    if count > MAX_LIST {
        return Err(Fault::bad(format!("number of {what}"), count, format!("at most {MAX_LIST}")));
    }
    // SAFETY: neither null nor out of alignment, and the caller promises the rest.
    Ok(unsafe { std::slice::from_raw_parts(data, count as usize) })
}

/// A view without a value.
pub(super) const NO_VALUE: ArrayView = ArrayView {
    kind: 0,
    scalar: 0,
    rank: 0,
    reserved: 0,
    shape: [0; 4],
    strides: [0; 4],
    data: std::ptr::null(),
    owner: std::ptr::null_mut(),
    retain: None,
    release: None,
    id: 0,
    version: 0,
    fields: std::ptr::null(),
    field_count: 0,
};

/// An empty text.
pub(super) const NO_TEXT: Text = Text { data: std::ptr::null(), length: 0 };

/// Refuses a bool of the other side that is none.
pub(super) fn flag(value: u32, what: &str) -> Result<bool, Fault> {
    match value {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(Fault::bad(what, other, "0 or 1")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damaged_texts_are_refused() {
        let of = |data: *const u8, length| {
            // SAFETY: the lengths that are read are those of the data.
            unsafe { str_of(Text { data, length }, "name") }.map_err(|fault| fault.to_string())
        };
        assert_eq!(of(std::ptr::null(), 0), Ok(""));
        assert_eq!(of(b"ab".as_ptr(), 2), Ok("ab"));
        assert_eq!(of(std::ptr::null(), 3).unwrap_err(), "name is a null pointer, wanted 3 bytes");
        assert_eq!(of(b"a\xff".as_ptr(), 2).unwrap_err(), "name is \"a\\xff\", wanted UTF-8");
        assert!(of(b"a".as_ptr(), u64::MAX).unwrap_err().contains("length of name"));
    }

    #[test]
    fn only_zero_and_one_are_bools() {
        assert_eq!((flag(0, "x"), flag(1, "x")), (Ok(false), Ok(true)));
        assert_eq!(flag(255, "x").unwrap_err().to_string(), "x is 255, wanted 0 or 1");
    }
}
