//! The action `reference`: f64, cell by cell, with an enclosure for each pixel.
//!
//! It is the truth that other actions are measured against, where no closed form is at hand.
//!
//! # Computes
//! `dC = T·σ·c·ds`, `dT = −T·σ·ds`, σ = −ln(1 − a)/unit, along each ray (N. Max, *Optical models
//! for direct volume rendering*, 1995). What geometry, clips, near, far and opaque things leave of a
//! ray are its *stretches* (`mark`, `sight`). They are cut at cell faces, at the extremes of the
//! value and at the table's control points; on each piece opacity and colour are cubics, and the
//! integral is a power series with a bound on its remainder (`series`). Slices, surfaces and the
//! application's picture are *hits* without length among them (`hit`). Bounds on the rounding of
//! positions, values and sums are carried along (`line`, `piece`, `border`, `march`), so that
//! `lower` and `upper` of a [`ReferencePicture`] hold the true colour of every pixel. Maximum,
//! minimum, mean and line integral come from the cubics' extremes and antiderivative.
//!
//! Shapes whose shader is a text are drawn by evaluating it: adaptively, with estimates in place
//! of bounds (`source`).
//!
//! # What the certificate rests on
//! - The scene is the f64 numbers that core hands over: rays, inverse transforms, maps to samples,
//!   voxels after slope and intercept, control points. Their own making is not part of it.
//! - f64 arithmetic rounds to nearest; `exp`, `exp_m1`, `ln` and `ln_1p` are good to four units in
//!   the last place. The bounds count about twice the roundings that there are.
//! - Where a ray lies in a plane or a cell's face to double-double precision, it is in it; where
//!   it meets two planes at one place to that precision, they meet there, and a rule says what
//!   comes first: a hit before the medium that begins there, hits at one place together.
//!   With the nearest filter a ray that runs within rounding along the border between two voxels
//!   takes the one that `VolumeTexture::sample` takes.
//!
//! # Not certified, and counted
//! Pixels where rounding decides what is seen: a stretch of next to no length of what may be
//! opaque; a value that touches an opaque plateau, a step or a peak of 1 without crossing it; media
//! that turn opaque in one place within a cell, there or at a hit; a ray through a surface's
//! silhouette, or through an edge between triangles of different shades. Depth is not enclosed. A
//! lattice's enclosure is that of its sum, given its samples. What sources add to enclosures is an
//! estimate, also in pixels that count as certified; frames with sources say so.
//!
//! # Beyond the contract's words
//! Samples that are ±∞ make their cell infinite, which clamps in the table; where both signs meet
//! a cell is transparent. NaN counts neither for extremes nor for the mean's length. The shapes that
//! are one picture have no place in depth and leave the frame's depth alone.

mod action;
mod border;
mod carried;
mod cells;
mod cubic;
mod dd;
mod flat;
mod hit;
mod knots;
mod lattice;
mod line;
mod march;
mod mark;
mod medium;
mod mesh;
mod met;
mod options;
mod overlap;
mod passage;
mod picture;
mod piece;
mod point;
mod prepare;
mod scene;
mod series;
mod sight;
mod slices;
mod source;
mod surfaces;
mod tetra;

use std::sync::Arc;

use volact_core::{Registry, registry::RegisterError};

pub use action::ReferenceAction;
pub use options::{Classification, Method, ReferenceOptions, declaration};
pub use picture::{ReferencePicture, integrate};
pub use prepare::check;

/// Registers the action.
///
/// # Errors
/// If the name is taken.
pub fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    registry
        .add_action(declaration(), Arc::new(|context, options| Ok(Box::new(ReferenceAction::new(context, options)?))))
}
