//! How much two pictures differ: the one place where that is computed.
//!
//! Pictures are premultiplied RGBA numbers, rows from the top. [`Differences`] holds
//!
//! - the largest absolute difference and the root of the mean square, over all four channels as
//!   the numbers stand, and the PSNR that follows for a peak of 1;
//! - SSIM (Z. Wang et al., *Image quality assessment: from error visibility to structural
//!   similarity*, IEEE TIP 13(4), 2004): Gaussian window of 11×11 with σ = 1.5, K₁ = 0.01,
//!   K₂ = 0.03, the mean over all windows that lie wholly inside the picture, on luma (Rec. 601);
//! - FLIP, see [`flip`].
//!
//! SSIM and FLIP see the pictures over black and clamped to 0..1. Volact's colours are plain
//! numbers without a hidden gamma; FLIP needs to know how they are shown, and **assumes sRGB**,
//! which is how a PNG of them is shown.

pub mod flip;

use thiserror::Error;

/// A picture to compare: premultiplied RGBA, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub struct Image<'a> {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width × height` pixels.
    pub rgba: &'a [[f32; 4]],
}

/// Why two pictures cannot be compared.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum MetricError {
    /// They are not of one size.
    #[error("pictures differ in size: {a:?} and {b:?} pixels, wanted two of one size")]
    Sizes {
        /// Columns and rows of the first.
        a: [usize; 2],
        /// Columns and rows of the second.
        b: [usize; 2],
    },
    /// A picture without pixels, or with another number of them than its size says.
    #[error("picture of {width} × {height} has {found} pixels, wanted {}, and at least one", width * height)]
    Pixels {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Pixels given.
        found: usize,
    },
}

/// How two pictures of one size differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Differences {
    /// Largest absolute difference of a channel; infinite where only one of two is finite.
    pub max: f64,
    /// Column and row of the pixel with the largest difference.
    pub worst: [usize; 2],
    /// Number of pixels that differ at all.
    pub differing: usize,
    /// Root of the mean square difference over all channels.
    pub rmse: f64,
    /// −20·log₁₀(rmse): infinite for equal pictures.
    pub psnr: f64,
    /// Mean structural similarity, 1 for equal pictures; `None` below 11 pixels on a side.
    pub ssim: Option<f64>,
    /// Mean FLIP: 0 for equal pictures, at most 1.
    pub flip: f64,
    /// FLIP pixel by pixel.
    pub flip_map: Vec<f32>,
}

/// Compares two pictures by every metric.
///
/// # Errors
/// If they differ in size, or one has not the pixels its size says.
pub fn compare(a: &Image<'_>, b: &Image<'_>) -> Result<Differences, MetricError> {
    check(a, b)?;
    let (mut max, mut worst, mut differing, mut squares) = (0.0f64, 0usize, 0usize, 0.0f64);
    for (i, (p, q)) in a.rgba.iter().zip(b.rgba).enumerate() {
        let channels: [f64; 4] = std::array::from_fn(|c| difference(p[c], q[c]));
        let largest = channels.into_iter().fold(0.0, f64::max);
        differing += usize::from(largest > 0.0);
        if largest > max {
            (max, worst) = (largest, i);
        }
        squares += channels.iter().map(|d| d * d).sum::<f64>();
    }
    let rmse = (squares / (4 * a.rgba.len()) as f64).sqrt();
    let flip_map = flip::map(a, b, flip::PIXELS_PER_DEGREE);
    Ok(Differences {
        max,
        worst: [worst % a.width, worst / a.width],
        differing,
        rmse,
        psnr: -20.0 * rmse.log10(),
        ssim: ssim(a, b),
        flip: flip_map.iter().map(|&v| f64::from(v)).sum::<f64>() / flip_map.len() as f64,
        flip_map,
    })
}

fn check(a: &Image<'_>, b: &Image<'_>) -> Result<(), MetricError> {
    for image in [a, b] {
        let &Image { width, height, rgba } = image;
        if rgba.is_empty() || width.checked_mul(height) != Some(rgba.len()) {
            return Err(MetricError::Pixels { width, height, found: rgba.len() });
        }
    }
    let (a, b) = ([a.width, a.height], [b.width, b.height]);
    if a == b { Ok(()) } else { Err(MetricError::Sizes { a, b }) }
}

/// Zero for two equal numbers, not-a-number twice included; infinite where just one is finite.
fn difference(a: f32, b: f32) -> f64 {
    if a == b || (a.is_nan() && b.is_nan()) {
        return 0.0;
    }
    let d = (f64::from(a) - f64::from(b)).abs();
    if d.is_finite() { d } else { f64::INFINITY }
}

/// Colour over black, clamped to 0..1; what is no number counts as 0.
fn shown([r, g, b, _]: [f32; 4]) -> [f64; 3] {
    [r, g, b].map(|v| if v.is_nan() { 0.0 } else { f64::from(v).clamp(0.0, 1.0) })
}

/// Half the width of the SSIM window without its middle.
const SSIM_RADIUS: usize = 5;
const SSIM_SIGMA: f64 = 1.5;

fn ssim(a: &Image<'_>, b: &Image<'_>) -> Option<f64> {
    let window = 2 * SSIM_RADIUS + 1;
    if a.width < window || a.height < window {
        return None;
    }
    let luma = |image: &Image<'_>| -> Vec<f64> {
        let weigh = |[r, g, b]: [f64; 3]| 0.299 * r + 0.587 * g + 0.114 * b;
        image.rgba.iter().map(|&p| weigh(shown(p))).collect()
    };
    let (x, y) = (luma(a), luma(b));
    let product = |p: &[f64], q: &[f64]| -> Vec<f64> { p.iter().zip(q).map(|(p, q)| p * q).collect() };
    let kernel = gaussian(SSIM_RADIUS, SSIM_SIGMA);
    let smooth = |p: &[f64]| convolve(p, a.width, a.height, &kernel, &kernel);
    let [mx, my] = [smooth(&x), smooth(&y)];
    let [xx, yy, xy] = [smooth(&product(&x, &x)), smooth(&product(&y, &y)), smooth(&product(&x, &y))];
    let [c1, c2] = [0.01f64.powi(2), 0.03f64.powi(2)];
    let mut sum = 0.0;
    for row in SSIM_RADIUS..a.height - SSIM_RADIUS {
        for column in SSIM_RADIUS..a.width - SSIM_RADIUS {
            let i = row * a.width + column;
            let (m, n) = (mx[i], my[i]);
            let (vx, vy, cov) = (xx[i] - m * m, yy[i] - n * n, xy[i] - m * n);
            sum += ((2.0 * m * n + c1) * (2.0 * cov + c2)) / ((m * m + n * n + c1) * (vx + vy + c2));
        }
    }
    Some(sum / ((a.width - 2 * SSIM_RADIUS) * (a.height - 2 * SSIM_RADIUS)) as f64)
}

/// Weights of a Gaussian from −radius to radius that add up to 1.
fn gaussian(radius: usize, sigma: f64) -> Vec<f64> {
    let weight = |i: usize| (-(i as f64 - radius as f64).powi(2) / (2.0 * sigma * sigma)).exp();
    let weights: Vec<_> = (0..=2 * radius).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|w| w / sum).collect()
}

/// Correlates with a separable kernel, the edge pixels repeated outside.
fn convolve(image: &[f64], width: usize, height: usize, across: &[f64], down: &[f64]) -> Vec<f64> {
    let at = |i: usize, k: usize, radius: usize, n: usize| (i + k).saturating_sub(radius).min(n - 1);
    let mut rows = vec![0.0; image.len()];
    for (out, line) in rows.chunks_exact_mut(width).zip(image.chunks_exact(width)) {
        for (x, out) in out.iter_mut().enumerate() {
            *out = across.iter().enumerate().map(|(k, w)| w * line[at(x, k, across.len() / 2, width)]).sum();
        }
    }
    let mut result = vec![0.0; image.len()];
    for (y, out) in result.chunks_exact_mut(width).enumerate() {
        for (k, w) in down.iter().enumerate() {
            let line = at(y, k, down.len() / 2, height) * width;
            out.iter_mut().zip(&rows[line..line + width]).for_each(|(out, v)| *out += w * v);
        }
    }
    result
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Two pictures by a rule that Python repeats: rings, and the same shifted and tinted.
    pub(crate) fn pair(width: usize, height: usize) -> [Vec<[f32; 4]>; 2] {
        let byte = |v: f64| (v.clamp(0.0, 1.0) * 255.0).round() as f32 / 255.0;
        let pixel = |x: f64, y: f64, tint: f64| {
            let d = (x - 20.0).hypot(y - 17.0);
            let ring = 0.5 + 0.5 * (d * 0.55).cos();
            [byte(ring * (1.0 - tint)), byte(0.3 + 0.02 * x), byte(0.9 - 0.6 * ring + tint), 1.0]
        };
        let image = |shift: f64, tint: f64| {
            let at = |i: usize| pixel((i % width) as f64 + shift, (i / width) as f64, tint);
            (0..width * height).map(at).collect()
        };
        [image(0.0, 0.0), image(1.5, 0.1)]
    }

    pub(crate) fn image(rgba: &[[f32; 4]], width: usize) -> Image<'_> {
        Image { width, height: rgba.len() / width, rgba }
    }

    #[test]
    fn equal_pictures_do_not_differ() {
        let [a, _] = pair(40, 32);
        let d = compare(&image(&a, 40), &image(&a, 40)).unwrap();
        assert_eq!((d.max, d.rmse, d.psnr, d.differing, d.flip), (0.0, 0.0, f64::INFINITY, 0, 0.0));
        assert!((d.ssim.unwrap() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn one_channel_off_has_a_closed_form() {
        let a = vec![[0.5f32, 0.5, 0.5, 1.0]; 12];
        let mut b = a.clone();
        b[7][1] = 0.75;
        let d = compare(&image(&a, 4), &image(&b, 4)).unwrap();
        assert_eq!((d.max, d.worst, d.differing), (0.25, [3, 1], 1));
        assert!((d.rmse - 0.25 / 48f64.sqrt()).abs() < 1e-15);
        assert!((d.psnr - 20.0 * (48f64.sqrt() / 0.25).log10()).abs() < 1e-12);
        assert_eq!(d.ssim, None);
    }

    #[test]
    fn ssim_of_flat_pictures_has_a_closed_form() {
        let [a, b] = [0.2f32, 0.6].map(|g| vec![[g, g, g, 1.0]; 144]);
        let d = compare(&image(&a, 12), &image(&b, 12)).unwrap();
        let (m, n) = (f64::from(0.2f32), f64::from(0.6f32));
        let want = (2.0 * m * n + 1e-4) / (m * m + n * n + 1e-4);
        assert!((d.ssim.unwrap() - want).abs() < 1e-9);
    }

    #[test]
    fn all_metrics_are_symmetric() {
        let [a, b] = pair(40, 32);
        let there = compare(&image(&a, 40), &image(&b, 40)).unwrap();
        let back = compare(&image(&b, 40), &image(&a, 40)).unwrap();
        assert_eq!((there.max, there.rmse, there.ssim, there.flip), (back.max, back.rmse, back.ssim, back.flip));
    }

    #[test]
    fn what_is_no_number_differs_from_what_is() {
        let a = [[0.5f32, f32::NAN, 0.5, 1.0]];
        let b = [[0.5f32; 4]];
        assert_eq!(compare(&image(&a, 1), &image(&b, 1)).unwrap().max, f64::INFINITY);
        assert_eq!(compare(&image(&a, 1), &image(&a, 1)).unwrap().max, 0.0);
    }

    /// scikit-image 0.26.0, `structural_similarity` with the same window, and flip-evaluator 1.7
    /// (single precision), on the same two pictures.
    #[test]
    fn others_find_the_same_numbers() {
        let [a, b] = pair(40, 32);
        let d = compare(&image(&a, 40), &image(&b, 40)).unwrap();
        assert!((d.max - 0.431_372_553).abs() < 1e-8);
        assert!((d.rmse - 0.134_668_437).abs() < 1e-8);
        assert!((d.ssim.unwrap() - 0.805_985_267_540).abs() < 1e-8);
        assert!((d.flip - 0.390_443_742).abs() < 2e-5, "{}", d.flip);
        assert!((d.flip_map[17 * 40 + 20] - 0.473_853_05).abs() < 1e-4);
        assert!((d.flip_map[0] - 0.443_905_03).abs() < 1e-4);
        assert!((d.flip_map[31 * 40 + 39] - 0.591_482_76).abs() < 1e-4);
        let nearer = flip::map(&image(&a, 40), &image(&b, 40), 30.0);
        let mean = nearer.iter().map(|v| f64::from(*v)).sum::<f64>() / nearer.len() as f64;
        assert!((mean - 0.442_294_747).abs() < 2e-5, "{mean}");
    }

    /// flip-evaluator 1.7 gives 0.967392 for black and white, and 1 for the farthest hues.
    #[test]
    fn flip_of_flat_pictures() {
        let flat = |rgb: [f32; 3]| vec![[rgb[0], rgb[1], rgb[2], 1.0]; 256];
        let flip = |a, b| compare(&image(&flat(a), 16), &image(&flat(b), 16)).unwrap().flip;
        let found = flip([0.0; 3], [1.0; 3]);
        assert!((found - 0.967_392).abs() < 2e-5, "{found}");
        assert!((flip([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn sizes_must_agree() {
        let a = [[0.0f32; 4]; 6];
        let error = compare(&image(&a, 2), &image(&a, 3)).unwrap_err();
        assert_eq!(error.to_string(), "pictures differ in size: [2, 3] and [3, 2] pixels, wanted two of one size");
        let short = Image { width: 2, height: 2, rgba: &a };
        assert!(matches!(compare(&short, &short), Err(MetricError::Pixels { found: 6, .. })));
    }
}
