//! Pictures of a check as PNG in a data URL: as they are over black, and what differs as heat.

use base64::{Engine as _, engine::general_purpose::STANDARD};

use super::ReportError;
use crate::outcome::Sheet;

/// Expected, actual and heat.
pub fn all(sheet: &Sheet) -> Result<[String; 3], ReportError> {
    let plain = |pixels: &[[f32; 4]]| pixels.iter().flat_map(|p| shown(*p)).collect::<Vec<u8>>();
    let heat: Vec<u8> = (0..sheet.expected.len()).flat_map(|i| heat(ratio(sheet, i))).collect();
    let encode = |rgb: Vec<u8>| encode(sheet.width, sheet.height, &rgb);
    Ok([encode(plain(&sheet.expected))?, encode(plain(&sheet.actual))?, encode(heat)?])
}

/// A premultiplied colour as it looks over black.
fn shown([r, g, b, _]: [f32; 4]) -> [u8; 3] {
    // NaN is magenta: nothing else is.
    if [r, g, b].iter().any(|v| v.is_nan()) {
        return [255, 0, 255];
    }
    [r, g, b].map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)
}

/// A premultiplied picture over black, as a data URL.
///
/// # Errors
/// If it cannot be encoded.
pub fn over_black(width: usize, height: usize, pixels: &[[f32; 4]]) -> Result<String, ReportError> {
    encode(width, height, &pixels.iter().flat_map(|p| shown(*p)).collect::<Vec<u8>>())
}

/// Powers of ten of an error that have a colour: from black to white.
const DECADES: [f64; 2] = [-7.0, 0.0];

/// How far two pictures lie apart, pixel by pixel in the worst channel, by powers of ten from 1e-7 to 1.
///
/// # Errors
/// If it cannot be encoded.
pub fn decades(width: usize, height: usize, a: &[[f64; 4]], b: &[[f64; 4]]) -> Result<String, ReportError> {
    let color = |(a, b): (&[f64; 4], &[f64; 4])| {
        let off = (0..4).map(|c| (a[c] - b[c]).abs());
        let off = off.fold(0.0f64, |m, d| if d.is_nan() { f64::INFINITY } else { m.max(d) });
        ramp(((off.max(1e-300).log10() - DECADES[0]) / (DECADES[1] - DECADES[0])).clamp(0.0, 1.0))
    };
    encode(width, height, &a.iter().zip(b).flat_map(color).collect::<Vec<u8>>())
}

/// Black, blue, teal, orange, white.
fn ramp(t: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 5] =
        [[0.0, 0.0, 0.0], [20.0, 40.0, 120.0], [40.0, 160.0, 170.0], [240.0, 110.0, 20.0], [255.0, 255.0, 230.0]];
    let at = t * (STOPS.len() - 1) as f64;
    let i = (at as usize).min(STOPS.len() - 2);
    [0, 1, 2].map(|c| (STOPS[i][c] + (at - i as f64) * (STOPS[i + 1][c] - STOPS[i][c])).round() as u8)
}

/// Difference over tolerance of a pixel.
fn ratio(sheet: &Sheet, i: usize) -> f32 {
    let (a, b) = (sheet.expected[i], sheet.actual[i]);
    let off =
        (0..4).map(|c| (a[c] - b[c]).abs()).fold(0.0f32, |m, d| if d.is_nan() { f32::INFINITY } else { m.max(d) });
    if off == 0.0 { 0.0 } else { off / sheet.tolerance[i].max(f32::MIN_POSITIVE) }
}

/// Black where nothing differs; blue to teal up to the tolerance; orange to white beyond, by powers of ten.
fn heat(ratio: f32) -> [u8; 3] {
    let mix = |a: [f32; 3], b: [f32; 3], t: f32| [0, 1, 2].map(|c| (a[c] + t.clamp(0.0, 1.0) * (b[c] - a[c])) as u8);
    if ratio <= 0.0 {
        [0, 0, 0]
    } else if ratio <= 1.0 {
        // From a thousandth of the tolerance on.
        mix([12.0, 14.0, 40.0], [40.0, 160.0, 170.0], 1.0 + ratio.log10() / 3.0)
    } else {
        mix([240.0, 110.0, 20.0], [255.0, 255.0, 230.0], ratio.log10() / 4.0)
    }
}

/// A data URL of a PNG of RGB bytes.
fn encode(width: usize, height: usize, rgb: &[u8]) -> Result<String, ReportError> {
    let failed = |source| ReportError::Picture { width, height, source };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(rgb).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(bytes)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heat_tells_within_from_beyond() {
        assert_eq!(heat(0.0), [0, 0, 0]);
        let [r, _, b] = heat(0.9);
        assert!(b > r, "within is blue");
        let [r, _, b] = heat(1.1);
        assert!(r > b, "beyond is orange");
        assert!(heat(1e6).iter().map(|v| u32::from(*v)).sum::<u32>() > heat(2.0).iter().map(|v| u32::from(*v)).sum());
    }
}
