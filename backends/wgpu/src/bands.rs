//! Bands: rows of a picture that are drawn by one submission.
//!
//! Drivers end a submission that takes too long (two seconds on Windows, some ten on Linux) and the device
//! is lost with it. How long it takes is not known before; how many samples it can take at most is.

use volact_core::Viewport;
use volact_shaders::gpu::WORKGROUP;

/// Samples that one submission takes at most: a second of a slow integrated GPU, some hundredths of a fast one.
pub const MOST_SAMPLES: f64 = (1u64 << 28) as f64;

/// Rows of workgroups.
const EACH: usize = WORKGROUP as usize;

/// Rows that are drawn together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Band {
    /// The first row of the viewport.
    pub first: usize,
    /// How many.
    pub rows: usize,
}

/// How many rows the bands of a picture have, where a ray takes at most so many samples and a submission
/// `most`: whole rows of workgroups, and no more than there are.
pub fn height(viewport: &Viewport, samples: f64, most: f64) -> usize {
    let by_work = (most / (samples.max(1.0) * viewport.width.max(1) as f64)) as usize;
    let rows = by_work / EACH * EACH;
    rows.max(EACH).min(viewport.height.max(1))
}

/// The bands of a picture, from top to bottom.
pub fn bands(viewport: &Viewport, height: usize) -> impl Iterator<Item = Band> {
    let rows = viewport.height;
    (0..rows).step_by(height.max(1)).map(move |first| Band { first, rows: height.min(rows - first) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn bands_cover_a_picture_once_and_keep_their_bounds(
            width in 1usize..5000, rows in 1usize..3000, samples in 0.0..1e6f64, most in 1.0..1e10f64,
        ) {
            let viewport = Viewport { x: 0, y: 0, width, height: rows };
            let height = height(&viewport, samples, most);
            let mut next = 0;
            for band in bands(&viewport, height) {
                prop_assert_eq!(band.first, next);
                prop_assert!(band.rows > 0 && band.rows <= height);
                // A row of workgroups is the least that is drawn.
                let least = band.rows <= EACH;
                prop_assert!(least || (band.rows * width) as f64 * samples.max(1.0) <= most);
                prop_assert!(band.first % EACH == 0);
                next += band.rows;
            }
            prop_assert_eq!(next, rows);
        }
    }
}
