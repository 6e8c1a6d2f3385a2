//! Faults made on purpose, to see that tests see them.
//!
//! A site in an action asks [`mutated!`](crate::mutated) for a fault by name. Without the feature
//! `mutations` the answer is a constant `false`, and nothing of it is compiled. With it one fault at
//! a time can be `set` for the whole process; a build with the feature is for the suite's own
//! test, and for nothing else.

/// A fault's name as a number, at compile time: FNV-1a (<http://www.isthe.com/chongo/tech/comp/fnv>).
pub const fn key(name: &str) -> u64 {
    let (bytes, mut hash, mut i) = (name.as_bytes(), 0xcbf2_9ce4_8422_2325u64, 0);
    while i < bytes.len() {
        hash = (hash ^ bytes[i] as u64).wrapping_mul(0x0000_0100_0000_01b3);
        i += 1;
    }
    hash
}

#[cfg(feature = "mutations")]
mod active {
    use std::sync::atomic::{AtomicU64, Ordering};

    static ACTIVE: AtomicU64 = AtomicU64::new(0);

    /// Makes one fault, or none.
    pub fn set(name: Option<&str>) {
        ACTIVE.store(name.map_or(0, super::key), Ordering::Relaxed);
    }

    /// Whether this fault is made.
    #[inline]
    pub fn is(key: u64) -> bool {
        ACTIVE.load(Ordering::Relaxed) == key
    }
}

#[cfg(feature = "mutations")]
pub use active::{is, set};

/// Whether this fault is made: never.
#[cfg(not(feature = "mutations"))]
#[inline(always)]
pub const fn is(_: u64) -> bool {
    false
}

/// Whether the fault of this name is made; a constant `false` without the feature `mutations`.
/// ```
/// assert!(!volact_core::mutated!("half_voxel"));
/// ```
#[macro_export]
macro_rules! mutated {
    ($name:literal) => {
        $crate::mutation::is(const { $crate::mutation::key($name) })
    };
}

#[cfg(all(test, feature = "mutations"))]
mod tests {
    #[test]
    fn one_fault_at_a_time() {
        super::set(Some("one"));
        assert!(mutated!("one") && !mutated!("two"));
        super::set(None);
        assert!(!mutated!("one"));
    }
}
