//! Pixels of a picture: a vector, or memory that somebody else owns and shares.

use std::{
    fmt,
    marker::PhantomData,
    ops::{Deref, DerefMut},
    sync::Arc,
};

use bytemuck::Pod;

use crate::Buffer;

/// A picture's numbers, row by row. Reads as a slice. A picture that is shared with its maker is
/// copied when it is first written to, and not before.
#[derive(Clone)]
pub struct Pixels<T>(Store<T>);

#[derive(Clone)]
enum Store<T> {
    Owned(Vec<T>),
    Shared(Buffer, PhantomData<T>),
}

impl<T: Pod> Pixels<T> {
    /// Pixels that stay where they are; `None` if the bytes are not aligned or make no whole pixels.
    pub fn shared(buffer: Buffer) -> Option<Self> {
        buffer.as_slice::<T>()?;
        Some(Self(Store::Shared(buffer, PhantomData)))
    }

    /// The pixels as a vector of their own.
    pub fn into_vec(self) -> Vec<T> {
        match self.0 {
            Store::Owned(pixels) => pixels,
            Store::Shared(..) => self.to_vec(),
        }
    }
}

impl<T: Pod> Deref for Pixels<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.0 {
            Store::Owned(pixels) => pixels,
            Store::Shared(buffer, _) => buffer.as_slice().unwrap_or_default(),
        }
    }
}

impl<T: Pod> DerefMut for Pixels<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        if let Store::Shared(..) = self.0 {
            self.0 = Store::Owned(self.to_vec());
        }
        match &mut self.0 {
            Store::Owned(pixels) => pixels,
            Store::Shared(..) => &mut [],
        }
    }
}

impl<T> From<Vec<T>> for Pixels<T> {
    fn from(pixels: Vec<T>) -> Self {
        Self(Store::Owned(pixels))
    }
}

impl<T> FromIterator<T> for Pixels<T> {
    fn from_iter<I: IntoIterator<Item = T>>(pixels: I) -> Self {
        Self(Store::Owned(pixels.into_iter().collect()))
    }
}

impl<T: Pod> From<Pixels<T>> for Arc<[T]> {
    fn from(pixels: Pixels<T>) -> Self {
        pixels.into_vec().into()
    }
}

impl<T: Pod + Send + Sync> From<Pixels<T>> for Buffer {
    fn from(pixels: Pixels<T>) -> Self {
        match pixels.0 {
            Store::Owned(pixels) => Self::from_vec(pixels),
            Store::Shared(buffer, _) => buffer,
        }
    }
}

impl<'a, T: Pod> IntoIterator for &'a Pixels<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl<T: Pod + PartialEq> PartialEq for Pixels<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: Pod + fmt::Debug> fmt::Debug for Pixels<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_pixels_are_copied_when_written_to() {
        let buffer = Buffer::from_vec(vec![1f32, 2.0, 3.0]);
        let mut pixels = Pixels::<f32>::shared(buffer.clone()).unwrap();
        assert_eq!(pixels.as_ptr().cast::<u8>(), buffer.bytes().as_ptr());
        pixels[1] = 7.0;
        assert_eq!((&pixels[..], buffer.as_slice::<f32>().unwrap()), (&[1.0, 7.0, 3.0][..], &[1.0, 2.0, 3.0][..]));
        assert!(Pixels::<[f32; 4]>::shared(buffer).is_none());
    }
}
