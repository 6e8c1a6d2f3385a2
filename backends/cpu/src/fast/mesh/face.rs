//! A triangle for each of sixteen rays, as a ray sees it: where its vertices lie beside the ray.
//!
//! On which side of an edge a ray passes is the sign of x₁·y₂ − x₂·y₁. Products are rounded, but
//! rounding keeps order: where the rounded products differ, their order is right. Where they are
//! equal, they are compared exactly, and where that is zero, too, the ray counts as moved by an
//! infinitesimal (δ, δ²), as in [`trace`](super::trace). So all tetrahedra at an edge see a ray on
//! the same side of it.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use super::super::simd::{LANES, Simd};
use super::project::Slopes;

/// A vertex beside each ray.
#[derive(Clone, Copy)]
pub struct Corner<S: Simd> {
    /// Columns to the right of the ray, times depth in a perspective view.
    pub x: S::F,
    /// Rows, likewise.
    pub y: S::F,
    /// Depth.
    pub z: S::F,
    /// The number there.
    pub number: S::F,
}

/// Where sixteen rays pass.
#[derive(Clone, Copy)]
pub struct Beside<S: Simd> {
    slope: [S::F; 2],
    shift: [S::F; 2],
}

impl<S: Simd> Beside<S> {
    /// For these rays.
    ///
    /// # Safety
    /// As for all functions here: called from a function compiled for `S` on a machine with it.
    #[inline(always)]
    pub unsafe fn new(slopes: &Slopes) -> Self {
        // SAFETY: the caller's promises.
        unsafe {
            Self {
                slope: [S::load(&slopes.slope[0]), S::load(&slopes.slope[1])],
                shift: [S::load(&slopes.shift[0]), S::load(&slopes.shift[1])],
            }
        }
    }

    /// Vertices in the space of rays, one a ray, beside the rays.
    ///
    /// # Safety
    /// As above.
    #[inline(always)]
    pub unsafe fn place(&self, [x, y, z, number]: [S::F; 4]) -> Corner<S> {
        // SAFETY: the caller's promises.
        unsafe {
            Corner {
                x: S::fma(self.slope[0], z, S::add(x, self.shift[0])),
                y: S::fma(self.slope[1], z, S::add(y, self.shift[1])),
                z,
                number,
            }
        }
    }
}

/// The lanes of `lanes` in which the edge from `a` to `b` has the ray on its left.
///
/// # Safety
/// As above.
#[inline(always)]
pub unsafe fn positive<S: Simd>(lanes: u32, a: &Corner<S>, b: &Corner<S>) -> u32 {
    // SAFETY: the caller's promises.
    unsafe {
        let (m, n) = (S::mul(a.x, b.y), S::mul(b.x, a.y));
        let ties = S::eq_bits(m, n) & lanes;
        let sure = S::lt_bits(n, m) & lanes;
        if ties == 0 { sure } else { sure | tied(ties, a, b) }
    }
}

/// The same where rounded products are equal.
#[cold]
#[inline(never)]
unsafe fn tied<S: Simd>(ties: u32, a: &Corner<S>, b: &Corner<S>) -> u32 {
    let [mut ax, mut ay, mut bx, mut by] = [[0f32; LANES]; 4];
    // SAFETY: the caller's promises.
    unsafe {
        S::store(a.x, &mut ax);
        S::store(a.y, &mut ay);
        S::store(b.x, &mut bx);
        S::store(b.y, &mut by);
    }
    let side = |l: usize| {
        // Products of two f32 are exact in f64.
        let (m, n) = (f64::from(ax[l]) * f64::from(by[l]), f64::from(bx[l]) * f64::from(ay[l]));
        if m != n {
            return m > n;
        }
        if ay[l] != by[l] { by[l] < ay[l] } else { bx[l] > ax[l] }
    };
    (0..LANES).filter(|l| ties >> l & 1 == 1).fold(0, |bits, l| bits | u32::from(side(l)) << l)
}

/// Depth and number where rays meet triangles; `edge_on` where a triangle is seen so. Numbers are
/// never outside of the corners', so that they are the same wherever those are.
///
/// # Safety
/// As above.
#[inline(always)]
pub unsafe fn meet<S: Simd>([a, b, c]: &[Corner<S>; 3], edge_on: [S::F; 2]) -> [S::F; 2] {
    // SAFETY: the caller's promises.
    unsafe {
        let weights = [area(b, c), area(c, a), area(a, b)];
        let sum = S::add(S::add(weights[0], weights[1]), weights[2]);
        let by = S::div(S::splat(1.0), sum);
        let some = S::lt_bits(S::splat(0.0), sum);
        let depth = S::mul(weigh::<S>(weights, [a.z, b.z, c.z]), by);
        let number = S::mul(weigh::<S>(weights, [a.number, b.number, c.number]), by);
        // In this order a NaN stays one.
        let low = S::min(S::min(a.number, b.number), c.number);
        let high = S::max(S::max(a.number, b.number), c.number);
        let number = S::min(high, S::max(low, number));
        [S::select(some, depth, edge_on[0]), S::select(some, number, edge_on[1])]
    }
}

/// x₁·y₂ − x₂·y₁.
#[inline(always)]
unsafe fn area<S: Simd>(a: &Corner<S>, b: &Corner<S>) -> S::F {
    // SAFETY: the caller's promises.
    unsafe { S::sub(S::mul(a.x, b.y), S::mul(b.x, a.y)) }
}

#[inline(always)]
unsafe fn weigh<S: Simd>([u, v, w]: [S::F; 3], [a, b, c]: [S::F; 3]) -> S::F {
    // SAFETY: the caller's promises.
    unsafe { S::fma(u, a, S::fma(v, b, S::mul(w, c))) }
}
