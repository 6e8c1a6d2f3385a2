//! Tolerances, pixel by pixel: derived from how precisely a frame says it was made, and from how
//! much the true picture changes where the scene is moved a little. Nothing is tuned.
//!
//! With u half a unit in the last place (2⁻²⁴ for f32, relative), N the samples along the longest
//! axis and n the segments along the picture's longest ray, a pixel may be off by the sum of
//!
//! - *the frame*: u·max(1, c), since frames are f32;
//! - *sums*: 4·u·√n, two products and two sums a segment whose roundings are as often up as down
//!   (N. Higham, *Accuracy and Stability of Numerical Algorithms*, 2002, section 2.8), and 12·u for the
//!   lengths and exponentials of the two segments that a shape cuts;
//!   of fixed-point targets half a step a segment, which do not cancel;
//! - *positions*: η/δ·|T(δ) − T(0)|, where T(δ) is the true picture of the scene moved by δ voxels
//!   obliquely. A position of index N rounds by u·N in each of some four operations, the seven
//!   roundings of an interpolation act like a shift of a few u, and a weight of b bits is off by
//!   2⁻⁽ᵇ⁺¹⁾: η = u·(4·N + 16) + weight;
//! - *tables*: linear interpolation between the nodes that the frame reports ([`tables`]);
//! - *cells*: 1.5e-5 where numbers of meshes are `linear in each cell` of f32: the colour of a stretch
//!   is taken as linear in optical depth up to there;
//! - *format of voxels*: what moving voxels by half a step of a format changes that has fewer digits
//!   than they have ([`voxels`](crate::voxels));
//! - *ends*: the transmittance at which rays end, if they do;
//! - *enclosure*: half the width of what the reference encloses, where rounding decides what is seen.
//!
//! Where moving by δ changes a pixel by more than 0.02 it lies on an edge, and rounding decides
//! on which side: all of the change is allowed there. The root of the mean square may be half of
//! that of these tolerances: they hold for each pixel, and the errors of many pixels spread.

use volact_core::{Method, ParameterValue, Shape, shape::smallest_voxel};
use volact_cpu::reference::ReferencePicture;

use crate::{
    method::{F32, Lattice, Precision},
    tables,
};

/// How far pixels may be off, and why.
#[derive(Clone, Debug, Default)]
pub struct Tolerance {
    /// For each pixel.
    pub pixels: Vec<f64>,
    /// The parts, with the most that each allows anywhere.
    pub parts: Vec<(String, f64)>,
}

/// The shift δ in voxels at which the picture's change is taken.
pub const SHIFT: f64 = 1e-4;

/// How wrong the light of a stretch may be whose colour is taken as linear in optical depth.
const CELLS: f64 = 1.5e-5;

/// A change that is an edge and not a slope.
const EDGE: f64 = 0.02;

/// What the sizes of a scene say.
#[derive(Clone, Copy, Debug)]
pub struct Sizes {
    /// Samples along the longest axis of any volume, or cells of any mesh across; at least 2.
    pub samples: f64,
    /// The smallest voxel, or a hundredth of the scene where there is none, in world units.
    pub voxel: f64,
    /// The diagonal of all shapes in world units.
    pub diagonal: f64,
    /// Whether segments are summed up: not on planes alone, and not where a value is looked for.
    pub dense: bool,
}

impl Sizes {
    /// Of these shapes.
    pub fn of(shapes: &[Shape]) -> Self {
        let (mut samples, mut voxel, mut bounds) = (2.0f64, f64::INFINITY, volact_core::Aabb::EMPTY);
        let mut dense = false;
        for shape in shapes {
            let state = shape.state();
            let flat = ["mip", "minip", "average", "xray"].contains(&state.shader.as_str());
            dense |= !flat && state.geometry.slices().is_none_or(|s| s.volume);
            bounds = bounds.union(&state.world_bounds());
            for value in state.parameters.values() {
                if let ParameterValue::Volume(texture) = value {
                    samples = texture.data_roi().dims().into_iter().fold(samples, |n, d| n.max(d as f64));
                    voxel = voxel.min(smallest_voxel(texture, &state.transform));
                }
            }
        }
        let diagonal = if bounds.is_empty() { 1.0 } else { bounds.size().length() };
        let voxel = if voxel.is_finite() && voxel > 0.0 { voxel } else { diagonal / 100.0 };
        Self { samples, voxel, diagonal, dense }
    }

    /// Segments that are summed up along the longest ray.
    pub fn segments(&self, lattice: Lattice) -> f64 {
        let all = lattice.step().map_or(4.0 * self.samples, |h| self.diagonal / h).max(1.0);
        if self.dense { all } else { 1.0 }
    }

    /// By how much the scene is moved, in world units.
    pub fn shift(&self) -> volact_core::glam::DVec3 {
        volact_core::glam::DVec3::new(0.619, -0.481, 0.621) * (SHIFT * self.voxel)
    }
}

/// The true picture, and that of the scene moved by [`Sizes::shift`].
#[derive(Clone, Copy, Debug)]
pub struct Pair<'a> {
    /// The true picture.
    pub truth: &'a ReferencePicture,
    /// That of the scene moved.
    pub moved: &'a ReferencePicture,
}

impl Tolerance {
    /// The same for all pixels, for one stated reason.
    pub fn flat(pixels: usize, what: &str, value: f64) -> Self {
        Self { pixels: vec![value; pixels], parts: vec![(what.into(), value)] }
    }

    /// What rounding, filter and blending allow.
    pub fn derive(pair: Pair<'_>, shapes: &[Shape], method: &Method, lattice: Lattice) -> Self {
        let (sizes, precision) = (Sizes::of(shapes), Precision::of(method));
        let table = tables::tabulated(shapes, method, lattice);
        let cells = if method.classification.contains("linear in each cell") { CELLS } else { 0.0 };
        let segments = sizes.segments(lattice);
        let sums = if precision.fixed {
            precision.blend * segments
        } else {
            precision.arithmetic.max(precision.blend) * (4.0 * segments.sqrt() + 12.0)
        };
        let eta = precision.arithmetic * (4.0 * sizes.samples + 16.0) + precision.weight;
        let mut most = [0.0f64; 7];
        let pixel = |i: usize| {
            let (color, moved) = (pair.truth.color[i], pair.moved.color[i]);
            let change = (0..4).map(|c| (color[c] - moved[c]).abs()).fold(0.0, f64::max);
            let wide = (0..4).map(|c| pair.truth.upper[i][c] - pair.truth.lower[i][c]).fold(0.0, f64::max);
            let nothing = color == [0.0; 4] && moved == [0.0; 4] && wide == 0.0;
            let parts = [
                F32 * color.into_iter().fold(1.0, f64::max),
                if nothing { 0.0 } else { sums },
                if change > EDGE { change } else { change * eta / SHIFT },
                if nothing { 0.0 } else { table },
                if nothing { 0.0 } else { cells },
                if nothing { 0.0 } else { precision.termination },
                0.5 * wide,
            ];
            parts.into_iter().zip(&mut most).for_each(|(p, m)| *m = m.max(p));
            parts.into_iter().sum()
        };
        let pixels = (0..pair.truth.color.len()).map(pixel).collect();
        let names = ["frame", "sums", "positions", "tables", "cells", "ends of rays", "enclosure"];
        let parts = names.into_iter().zip(most).filter(|(_, m)| *m > 0.0).map(|(n, m)| (n.to_owned(), m)).collect();
        Self { pixels, parts }
    }

    /// Allows more everywhere, for a stated reason.
    pub fn and(mut self, what: &str, value: f64) -> Self {
        if value > 0.0 {
            self.pixels.iter_mut().for_each(|t| *t += value);
            self.parts.push((what.into(), value));
        }
        self
    }

    /// What the root of the mean square may be.
    pub fn rmse(&self) -> f64 {
        let squares: f64 = self.pixels.iter().map(|t| t * t).sum();
        let spread = if self.pixels.len() >= 256 { 0.5 } else { 1.0 };
        spread * (squares / self.pixels.len().max(1) as f64).sqrt()
    }
}
