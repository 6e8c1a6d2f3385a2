//! Bulk data: voxels, tables, vertices. Shared, never copied on the way in.
//!
//! A [`Buffer`] is a counted reference to bytes that somebody owns: a vector handed over, an
//! `Arc` shared with the application, a mapped file, or the application's own memory, released
//! through a callback when the last user goes. A buffer can be a part of another's bytes.

use std::{fmt, ops::Range, sync::Arc};

use bytemuck::Pod;

/// An owner of bytes. Implement it to hand any storage to Volact without a copy.
///
/// `bytes` must give the same address and length at every call.
pub trait Bulk: Send + Sync + 'static {
    /// The bytes owned.
    fn bytes(&self) -> &[u8];
}

/// A shared, immutable view of bytes, cheap to clone.
#[derive(Clone)]
pub struct Buffer {
    owner: Arc<dyn Bulk>,
    range: Range<usize>,
}

impl Buffer {
    /// Takes any owner of bytes as it is.
    pub fn new(owner: impl Bulk) -> Self {
        Self::shared(Arc::new(owner))
    }

    /// Shares an owner that the application keeps, too.
    pub fn shared(owner: Arc<dyn Bulk>) -> Self {
        let range = 0..owner.bytes().len();
        Self { owner, range }
    }

    /// Takes a vector of plain numbers over, without a copy.
    pub fn from_vec<T: Pod + Send + Sync>(values: Vec<T>) -> Self {
        Self::new(Owned(values))
    }

    /// Uses the application's own memory.
    ///
    /// `release` runs once, when the last user of the memory has gone, on whichever thread that is.
    ///
    /// # Safety
    /// - `pointer` is valid for reads of `length` bytes until `release` is called.
    /// - Nobody writes to these bytes while a call of a render action that was given them runs.
    ///   Between calls the application may change them and then says so with
    ///   [`Volume::touch`](crate::Volume::touch).
    #[expect(unsafe_code, reason = "the application's memory comes as a pointer")]
    pub unsafe fn from_raw(pointer: *const u8, length: usize, release: impl FnOnce() + Send + Sync + 'static) -> Self {
        Self::new(Foreign { pointer, length, release: Some(Box::new(release)) })
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.owner.bytes()[self.range.clone()]
    }

    /// The number of bytes.
    pub fn len(&self) -> usize {
        self.range.len()
    }

    /// Whether there are no bytes at all.
    pub fn is_empty(&self) -> bool {
        self.range.is_empty()
    }

    /// A part of this buffer, sharing its owner; `None` if `range` (in bytes) reaches outside.
    pub fn slice(&self, range: Range<usize>) -> Option<Self> {
        let inside = range.start <= range.end && range.end <= self.len();
        inside.then(|| Self {
            owner: Arc::clone(&self.owner),
            range: self.range.start + range.start..self.range.start + range.end,
        })
    }

    /// The bytes as numbers in native byte order; `None` if they are not aligned for `T` or
    /// their length is no multiple of its size.
    pub fn as_slice<T: Pod>(&self) -> Option<&[T]> {
        bytemuck::try_cast_slice(self.bytes()).ok()
    }
}

impl fmt::Debug for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Buffer({} bytes)", self.len())
    }
}

impl<T: Pod + Send + Sync> From<Vec<T>> for Buffer {
    fn from(values: Vec<T>) -> Self {
        Self::from_vec(values)
    }
}

impl<T: Pod + Send + Sync> From<Arc<[T]>> for Buffer {
    fn from(values: Arc<[T]>) -> Self {
        Self::new(Shared(values))
    }
}

struct Owned<T>(Vec<T>);

impl<T: Pod + Send + Sync> Bulk for Owned<T> {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

struct Shared<T>(Arc<[T]>);

impl<T: Pod + Send + Sync> Bulk for Shared<T> {
    fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

struct Foreign {
    pointer: *const u8,
    length: usize,
    release: Option<Box<dyn FnOnce() + Send + Sync>>,
}

// SAFETY: the memory is only read through this type, and the caller of `Buffer::from_raw`
// promises that nobody writes to it meanwhile.
#[expect(unsafe_code, reason = "see above")]
unsafe impl Send for Foreign {}
// SAFETY: as for Send.
#[expect(unsafe_code, reason = "see above")]
unsafe impl Sync for Foreign {}

impl Bulk for Foreign {
    #[expect(unsafe_code, reason = "the application's memory comes as a pointer")]
    fn bytes(&self) -> &[u8] {
        if self.length == 0 {
            return &[];
        }
        // SAFETY: the caller of `Buffer::from_raw` keeps pointer and length valid until release.
        unsafe { std::slice::from_raw_parts(self.pointer, self.length) }
    }
}

impl Drop for Foreign {
    fn drop(&mut self) {
        if let Some(release) = self.release.take() {
            release();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn vector_is_taken_over_without_a_copy() {
        let values = vec![1u16, 2, 3];
        let address = values.as_ptr().cast::<u8>();
        let buffer = Buffer::from_vec(values);
        assert_eq!(buffer.bytes().as_ptr(), address);
        assert_eq!(buffer.as_slice::<u16>().unwrap(), [1, 2, 3]);
    }

    #[test]
    #[expect(unsafe_code, reason = "tests the application's own memory")]
    fn application_memory_is_released_once_by_its_last_user() {
        static RELEASED: AtomicUsize = AtomicUsize::new(0);
        let memory: &'static [u8] = Box::leak(vec![7u8; 16].into_boxed_slice());
        let release = || {
            RELEASED.fetch_add(1, Ordering::SeqCst);
        };
        // SAFETY: leaked memory lives for ever and is never written.
        let buffer = unsafe { Buffer::from_raw(memory.as_ptr(), memory.len(), release) };
        assert_eq!(buffer.bytes().as_ptr(), memory.as_ptr());
        let part = buffer.slice(4..8).unwrap();
        drop(buffer);
        assert_eq!(RELEASED.load(Ordering::SeqCst), 0);
        assert_eq!(part.bytes(), [7; 4]);
        drop(part);
        assert_eq!(RELEASED.load(Ordering::SeqCst), 1);
    }

    #[test]
    #[expect(clippy::reversed_empty_ranges, reason = "what is tested")]
    fn slice_outside_is_refused() {
        let buffer = Buffer::from_vec(vec![0u8; 4]);
        assert!(buffer.slice(0..5).is_none());
        assert!(buffer.slice(3..2).is_none());
        assert!(buffer.slice(4..4).unwrap().is_empty());
    }
}
