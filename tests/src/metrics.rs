//! How far pictures lie apart, and how fast errors fall.

use volact_core::Frame;
use volact_cpu::reference::ReferencePicture;

/// Premultiplied RGBA in f64, row by row from the top.
pub type Picture = Vec<[f64; 4]>;

/// A frame's colours in f64.
pub fn wide(frame: &Frame) -> Picture {
    frame.color.iter().map(|c| c.map(f64::from)).collect()
}

fn differences<'a>(a: &'a [[f64; 4]], b: &'a [[f64; 4]]) -> impl Iterator<Item = f64> + 'a {
    assert_eq!(a.len(), b.len(), "pictures of one size");
    a.iter().zip(b).flat_map(|(a, b)| (0..4).map(|c| (a[c] - b[c]).abs()))
}

/// The largest difference in any channel of any pixel; infinite where one is not a number.
pub fn max_error(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    differences(a, b).fold(0.0, |m, d| if d.is_nan() { f64::INFINITY } else { m.max(d) })
}

/// How far any channel of any pixel lies outside what the reference encloses. Where rounding
/// decides what a ray meets, as at a block's edge, the enclosure is wide and says nothing.
pub fn outside(found: &[[f64; 4]], enclosure: &ReferencePicture) -> f64 {
    assert_eq!(found.len(), enclosure.color.len(), "pictures of one size");
    let channel = |i: usize, c: usize| {
        let v = found[i][c];
        if v.is_nan() { f64::INFINITY } else { (enclosure.lower[i][c] - v).max(v - enclosure.upper[i][c]).max(0.0) }
    };
    let all = (0..found.len()).flat_map(|i| (0..4).map(move |c| (i, c)));
    all.map(|(i, c)| channel(i, c)).fold(0.0, f64::max)
}

/// The root of the mean square of the differences.
pub fn rms_error(a: &[[f64; 4]], b: &[[f64; 4]]) -> f64 {
    let n = 4 * a.len();
    (differences(a, b).map(|d| d * d).sum::<f64>() / n as f64).sqrt()
}

/// The difference that a part of all pixels keeps, each in its worst channel.
pub fn percentile_error(a: &[[f64; 4]], b: &[[f64; 4]], part: f64) -> f64 {
    let each: Vec<f64> = differences(a, b).collect();
    let worst = |d: &[f64; 4]| d.iter().fold(0.0, |m: f64, v| if v.is_nan() { f64::INFINITY } else { m.max(*v) });
    let mut pixels: Vec<f64> = each.as_chunks::<4>().0.iter().map(worst).collect();
    pixels.sort_by(f64::total_cmp);
    let last = pixels.len().saturating_sub(1);
    let at = ((part * pixels.len() as f64).ceil() as usize).saturating_sub(1).min(last);
    pixels.get(at).copied().unwrap_or(0.0)
}

/// Whether two frames agree bit by bit, depth included.
pub fn identical(a: &Frame, b: &Frame) -> bool {
    let bits = |f: &Frame| {
        let color: Vec<_> = f.color.iter().flatten().map(|v| v.to_bits()).collect();
        (f.width, f.height, color, f.depth.iter().map(|d| d.to_bits()).collect::<Vec<_>>())
    };
    bits(a) == bits(b)
}

/// The order of convergence: the slope of log error over log step by least squares.
///
/// # Panics
/// If there are fewer than four steps, or an error is zero: then there is no order to see.
pub fn order(errors: &[(f64, f64)]) -> f64 {
    assert!(errors.len() >= 4, "at least four steps, found {}", errors.len());
    assert!(errors.iter().all(|e| e.1 > 0.0 && e.1.is_finite()), "errors without an order: {errors:?}");
    let n = errors.len() as f64;
    let logs: Vec<_> = errors.iter().map(|(h, e)| (h.ln(), e.ln())).collect();
    let (mx, my) = (logs.iter().map(|l| l.0).sum::<f64>() / n, logs.iter().map(|l| l.1).sum::<f64>() / n);
    let covariance: f64 = logs.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    covariance / logs.iter().map(|(x, _)| (x - mx).powi(2)).sum::<f64>()
}

/// Holds a figure to a tolerance, and prints both, so that a run with `--nocapture` reports how
/// much room there is.
///
/// # Panics
/// If the figure is larger or no number.
#[track_caller]
pub fn within(what: &str, observed: f64, tolerance: f64) {
    println!("{what}: {observed:.1e} of {tolerance:.1e}");
    assert!(observed <= tolerance, "{what}: {observed:e}, tolerance {tolerance:e}");
}

/// Holds a figure between two bounds, and prints all three.
///
/// # Panics
/// If the figure lies outside or is no number.
#[track_caller]
pub fn between(what: &str, observed: f64, [lo, hi]: [f64; 2]) {
    println!("{what}: {observed:.3} in {lo} to {hi}");
    assert!(lo <= observed && observed <= hi, "{what}: {observed}, wanted {lo} to {hi}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_of_a_power_is_its_exponent() {
        let errors = [1.0, 0.5, 0.25, 0.125].map(|h: f64| (h, 3.0 * h.powf(1.5)));
        assert!((order(&errors) - 1.5).abs() < 1e-12);
    }

    #[test]
    fn a_percentile_is_kept_by_its_part_of_the_pixels() {
        let zero = vec![[0.0; 4]; 200];
        let found: Vec<_> = (0..200).map(|i| [0.0, f64::from(i), 0.0, 0.5]).collect();
        assert_eq!(percentile_error(&found, &zero, 0.99), 197.0);
        assert_eq!(percentile_error(&found, &zero, 1.0), 199.0);
        assert_eq!(percentile_error(&found[..1], &zero[..1], 0.99), 0.5);
    }

    #[test]
    fn a_number_that_is_none_is_an_infinite_error() {
        assert_eq!(max_error(&[[0.0, f64::NAN, 0.0, 0.0]], &[[0.0; 4]]), f64::INFINITY);
    }
}
