//! Bulk data across the boundary: a [`Buffer`] as a view, and a view as a [`Buffer`]. Nothing is
//! copied either way.

use std::{ffi::c_void, sync::Arc};

use super::{
    abi::{self, ArrayView},
    arena::{Arena, NO_VALUE, Reference},
    status::{Code, Fault, caught},
};
use crate::{Buffer, ScalarType};

/// Whose a view is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Passing {
    /// An argument: borrowed for the call, and retained when kept.
    Lent,
    /// A result: one reference comes with it.
    Given,
}

/// Bytes with the shape that they came with.
#[derive(Debug)]
pub(super) struct Received {
    pub buffer: Buffer,
    pub scalar: u32,
    pub shape: Vec<u64>,
}

const SCALARS: [(u32, ScalarType); 9] = [
    (abi::SCALAR_U8, ScalarType::U8),
    (abi::SCALAR_I8, ScalarType::I8),
    (abi::SCALAR_U16, ScalarType::U16),
    (abi::SCALAR_I16, ScalarType::I16),
    (abi::SCALAR_U32, ScalarType::U32),
    (abi::SCALAR_I32, ScalarType::I32),
    (abi::SCALAR_F16, ScalarType::F16),
    (abi::SCALAR_F32, ScalarType::F32),
    (abi::SCALAR_F64, ScalarType::F64),
];

/// The code of a scalar type.
pub(super) fn scalar_code(scalar: ScalarType) -> u32 {
    SCALARS.iter().find(|(_, s)| *s == scalar).map_or(0, |(code, _)| *code)
}

/// The scalar type of a code.
pub(super) fn scalar_of(code: u32, what: &str) -> Result<ScalarType, Fault> {
    let known = SCALARS.iter().find(|(c, _)| *c == code).map(|(_, s)| *s);
    known.ok_or_else(|| Fault::new(Code::Unsupported, format!("scalar type of {what} is code {code}, wanted 1 to 9")))
}

fn size_of_code(code: u32, what: &str) -> Result<usize, Fault> {
    if code == abi::SCALAR_I64 { Ok(8) } else { scalar_of(code, what).map(ScalarType::size) }
}

/// A view of a buffer that comes with one reference.
pub(super) fn give(kind: u32, scalar: u32, shape: &[u64], buffer: &Buffer) -> ArrayView {
    let owner = Arc::into_raw(Arc::new(buffer.clone()));
    let mut all = [0; 4];
    all[..shape.len()].copy_from_slice(shape);
    ArrayView {
        kind,
        scalar,
        rank: shape.len() as u32,
        shape: all,
        data: buffer.bytes().as_ptr().cast(),
        owner: owner.cast_mut().cast(),
        retain: Some(retain),
        release: Some(release),
        ..NO_VALUE
    }
}

/// A view of a buffer that is valid as long as the arena.
pub(super) fn lend(kind: u32, scalar: u32, shape: &[u64], buffer: &Buffer, arena: &mut Arena) -> ArrayView {
    let view = give(kind, scalar, shape, buffer);
    arena.own(&view);
    view
}

unsafe extern "C" fn retain(owner: *mut c_void) {
    // SAFETY: `owner` is what `give` made, and the caller has a reference to it.
    unsafe { Arc::increment_strong_count(owner.cast::<Buffer>()) };
}

unsafe extern "C" fn release(owner: *mut c_void) {
    // A buffer's owner is the application's; what it does when it is dropped must not unwind.
    let dropped = caught(|| {
        // SAFETY: `owner` is what `give` made, and the caller gives its reference up.
        unsafe { Arc::decrement_strong_count(owner.cast::<Buffer>()) };
        Ok(())
    });
    if let Err(fault) = dropped {
        log::error!("releasing bulk data: {fault}");
    }
}

/// A view's numbers as a buffer that shares them.
///
/// # Safety
/// What the view says is true: its data are readable and stay as they are until its release, and
/// its functions do what the boundary demands.
pub(super) unsafe fn receive(view: &ArrayView, what: &str, passing: Passing) -> Result<Received, Fault> {
    if passing == Passing::Lent
        && let Some(retain) = view.retain
    {
        // SAFETY: the view is valid during the call that it was lent for.
        unsafe { retain(view.owner) };
    }
    let held = passing == Passing::Given || view.retain.is_some();
    // From here on a refusal releases, too.
    let reference = Reference { owner: view.owner, release: view.release.filter(|_| held) };
    let size = size_of_code(view.scalar, what)?;
    let shape = shape_of(view, size, what)?;
    let numbers = shape.iter().try_fold(1u64, |n, &s| n.checked_mul(s));
    let length = numbers.and_then(|n| n.checked_mul(size as u64)).filter(|&n| n <= isize::MAX as u64);
    let Some(length) = length else {
        return Err(Fault::bad(format!("shape of {what}"), format!("{shape:?}"), "a size that memory can hold"));
    };
    if length > 0 && view.data.is_null() {
        return Err(Fault::bad(format!("data of {what}"), "a null pointer", format!("{length} bytes")));
    }
    if length > 0 && !view.data.addr().is_multiple_of(size) {
        let found = format!("at {:p}", view.data);
        return Err(Fault::bad(format!("data of {what}"), found, format!("an address that is a multiple of {size}")));
    }
    // SAFETY: the data are not null, and the other side keeps them until `reference` is dropped.
    let buffer = unsafe { Buffer::from_raw(view.data.cast(), length as usize, move || drop(reference)) };
    Ok(Received { buffer, scalar: view.scalar, shape })
}

/// The shape, where it is one and the strides are those of dense numbers.
fn shape_of(view: &ArrayView, size: usize, what: &str) -> Result<Vec<u64>, Fault> {
    if view.rank > 4 {
        return Err(Fault::bad(format!("rank of {what}"), view.rank, "0 to 4"));
    }
    let shape = view.shape[..view.rank as usize].to_vec();
    let strides = &view.strides[..view.rank as usize];
    if strides.iter().all(|s| *s == 0) {
        return Ok(shape);
    }
    let mut dense = size as u64;
    for (axis, (&n, &stride)) in shape.iter().zip(strides).enumerate() {
        if n > 1 && u64::try_from(stride) != Ok(dense) {
            let message = format!("stride {axis} of {what} is {stride} bytes, wanted {dense}: numbers without gaps");
            return Err(Fault::new(Code::Unsupported, message));
        }
        dense = dense.saturating_mul(n);
    }
    Ok(shape)
}

/// A view that must have a kind, or none at all.
pub(super) fn is_none(view: &ArrayView) -> bool {
    view.kind == abi::KIND_NONE
}

/// Refuses another kind.
pub(super) fn want_kind(view: &ArrayView, kind: u32, what: &str) -> Result<(), Fault> {
    if view.kind == kind { Ok(()) } else { Err(Fault::bad(format!("kind of {what}"), view.kind, kind)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_cross_without_a_copy_and_are_released_once() {
        let mut arena = Arena::default();
        let buffer = Buffer::from_vec(vec![1u16, 2, 3, 4, 5, 6]);
        let address = buffer.bytes().as_ptr();
        let view = lend(abi::KIND_ARRAY, abi::SCALAR_U16, &[2, 3], &buffer, &mut arena);
        // SAFETY: the view is one of this module.
        let received = unsafe { receive(&view, "data", Passing::Lent) }.unwrap();
        drop((arena, buffer));
        assert_eq!(received.buffer.bytes().as_ptr(), address);
        assert_eq!((received.buffer.as_slice::<u16>().unwrap()[5], received.shape), (6, vec![2, 3]));
    }

    #[test]
    fn damaged_views_are_refused_and_still_released() {
        type Damage = fn(&mut ArrayView);
        let damages: [(Damage, &str); 7] = [
            (|v| v.scalar = 77, "scalar type"),
            (|v| v.rank = 5, "rank"),
            (|v| v.shape = [u64::MAX, 3, 0, 0], "shape"),
            (|v| v.shape = [u64::MAX / 2, 1, 0, 0], "shape"),
            (|v| v.data = std::ptr::null(), "null"),
            (|v| v.data = v.data.wrapping_byte_add(1), "multiple of 2"),
            (|v| v.strides = [2, 8, 0, 0], "stride 1"),
        ];
        for (damage, wanted) in damages {
            let owner = Arc::new(());
            let kept = Arc::clone(&owner);
            static BYTES: [u16; 6] = [0; 6];
            // SAFETY: the bytes are static.
            let buffer = unsafe { Buffer::from_raw(BYTES.as_ptr().cast(), 12, move || drop(kept)) };
            let mut view = give(abi::KIND_ARRAY, abi::SCALAR_U16, &[2, 3], &buffer);
            drop(buffer);
            damage(&mut view);
            // SAFETY: refused before anything is read.
            let error = unsafe { receive(&view, "data", Passing::Given) }.unwrap_err().to_string();
            assert!(error.contains(wanted), "{error}");
            assert_eq!(Arc::strong_count(&owner), 1, "{wanted}: released");
        }
    }
}
