//! How long rays are inside cells: the walk that draws, measured.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use super::{
    super::simd::{LANES, Simd},
    project::Slopes,
    walk::Along,
};

/// Sums of lengths.
#[derive(Debug)]
pub struct Lengths<'a> {
    slopes: &'a Slopes,
    depth: [f64; LANES],
}

impl<'a> Lengths<'a> {
    /// Nothing yet.
    pub fn new(slopes: &'a Slopes) -> Self {
        Self { slopes, depth: [0.0; LANES] }
    }

    /// World lengths.
    pub fn lengths(&self) -> [f64; LANES] {
        std::array::from_fn(|l| self.depth[l] * self.slopes.length[l])
    }
}

impl<S: Simd> Along<S> for Lengths<'_> {
    #[inline(always)]
    unsafe fn start(&mut self, _: u32, _: S::F) {}

    #[inline(always)]
    unsafe fn take(&mut self, lanes: u32, depth: [S::F; 2], _: [S::F; 2]) -> u32 {
        let mut ends = [[0f32; LANES]; 2];
        // SAFETY: the caller's promises.
        unsafe {
            S::store(depth[0], &mut ends[0]);
            S::store(depth[1], &mut ends[1]);
        }
        for l in (0..LANES).filter(|l| lanes >> l & 1 == 1) {
            self.depth[l] += f64::from(ends[1][l]) - f64::from(ends[0][l]);
        }
        0
    }
}
