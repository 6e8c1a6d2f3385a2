//! FLIP: what a person sees when two pictures are shown in turns.
//!
//! P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild, *FLIP: a
//! difference evaluator for alternating images*, Proc. ACM Comput. Graph. Interact. Tech. 3(2),
//! 2020, in its form for pictures of low dynamic range. The numbers below are those of the paper.
//! Pictures are taken to be sRGB, clamped to 0..1, over black.

use super::{Image, convolve, shown};

/// The usual viewing condition: a picture 0.7 m away on a screen 0.7 m and 3840 pixels wide.
pub const PIXELS_PER_DEGREE: f64 = 67.0;

/// Exponent of the colour difference.
const QC: f64 = 0.7;
/// Where the colour difference bends, as a fraction of its greatest.
const PC: f64 = 0.4;
/// What the bend is mapped to.
const PT: f64 = 0.95;
/// Exponent of the feature difference.
const QF: f64 = 0.5;
/// Width of the feature detectors in degrees.
const FEATURE_WIDTH: f64 = 0.082;

/// Contrast sensitivity: Gaussians of amplitude a and scale b, for each opponent channel.
const SENSITIVITY: [&[[f64; 2]]; 3] = [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];
/// The widest of the scales above, which sets the filters' radius.
const WIDEST: f64 = 0.04;

/// FLIP for each pixel, 0 for what looks the same to 1, at a viewing distance in pixels a degree.
/// Both pictures are of one size.
pub fn map(a: &Image<'_>, b: &Image<'_>, pixels_per_degree: f64) -> Vec<f32> {
    let opponent = |image: &Image<'_>| -> Vec<[f64; 3]> {
        image.rgba.iter().map(|&p| xyz_to_ycxcz(rgb_to_xyz(shown(p).map(linear)))).collect()
    };
    let (p, q) = (opponent(a), opponent(b));
    let (width, height) = (a.width, a.height);
    let color = color_difference(&p, &q, width, height, pixels_per_degree);
    let feature = feature_difference(&p, &q, width, height, pixels_per_degree);
    color.iter().zip(&feature).map(|(c, f)| c.powf(1.0 - f) as f32).collect()
}

fn color_difference(p: &[[f64; 3]], q: &[[f64; 3]], width: usize, height: usize, ppd: f64) -> Vec<f64> {
    let perceived = |image: &[[f64; 3]]| -> Vec<[f64; 3]> {
        let channels: [Vec<f64>; 3] = std::array::from_fn(|c| {
            let channel: Vec<_> = image.iter().map(|p| p[c]).collect();
            blur(&channel, width, height, SENSITIVITY[c], ppd)
        });
        let at = |i: usize| channels.each_ref().map(|c| c[i]);
        let back = |i: usize| xyz_to_rgb(ycxcz_to_xyz(at(i))).map(|v| v.clamp(0.0, 1.0));
        (0..image.len()).map(|i| hunt(back(i))).collect()
    };
    let most = hyab(hunt([0.0, 1.0, 0.0]), hunt([0.0, 0.0, 1.0])).powf(QC);
    let bend = PC * most;
    let spread = |e: f64| if e < bend { PT / bend * e } else { PT + (e - bend) / (most - bend) * (1.0 - PT) };
    perceived(p).into_iter().zip(perceived(q)).map(|(p, q)| spread(hyab(p, q).powf(QC))).collect()
}

/// A sum of Gaussians whose weights add up to 1.
fn blur(channel: &[f64], width: usize, height: usize, gaussians: &[[f64; 2]], ppd: f64) -> Vec<f64> {
    use std::f64::consts::PI;
    let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * ppd).ceil() as usize;
    let kernels: Vec<(f64, Vec<f64>)> = gaussians
        .iter()
        .map(|&[a, b]| {
            let weight = |i: usize| (-PI * PI * ((i as f64 - radius as f64) / ppd).powi(2) / b).exp();
            let weights: Vec<_> = (0..=2 * radius).map(weight).collect();
            let sum: f64 = weights.iter().sum();
            (a * (PI / b).sqrt() * sum * sum, weights.into_iter().map(|w| w / sum).collect())
        })
        .collect();
    let total: f64 = kernels.iter().map(|(share, _)| share).sum();
    let mut result = vec![0.0; channel.len()];
    for (share, kernel) in &kernels {
        let part = convolve(channel, width, height, kernel, kernel);
        result.iter_mut().zip(part).for_each(|(r, v)| *r += share / total * v);
    }
    result
}

fn feature_difference(p: &[[f64; 3]], q: &[[f64; 3]], width: usize, height: usize, ppd: f64) -> Vec<f64> {
    let sigma = 0.5 * FEATURE_WIDTH * ppd;
    let radius = (3.0 * sigma).ceil() as usize;
    let offsets: Vec<f64> = (0..=2 * radius).map(|i| i as f64 - radius as f64).collect();
    let bell = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
    let smooth = super::gaussian(radius, sigma);
    let edge = balanced(offsets.iter().map(|&x| -x * bell(x)).collect());
    let point = balanced(offsets.iter().map(|&x| (x * x / (sigma * sigma) - 1.0) * bell(x)).collect());
    let luminance = |image: &[[f64; 3]]| -> Vec<f64> { image.iter().map(|p| (p[0] + 16.0) / 116.0).collect() };
    let (p, q) = (luminance(p), luminance(q));
    let magnitude = |image: &[f64], kernel: &[f64]| -> Vec<f64> {
        let across = convolve(image, width, height, kernel, &smooth);
        let down = convolve(image, width, height, &smooth, kernel);
        across.iter().zip(down).map(|(a, d)| a.hypot(d)).collect()
    };
    let difference = |kernel: &[f64]| -> Vec<f64> {
        magnitude(&p, kernel).into_iter().zip(magnitude(&q, kernel)).map(|(p, q)| (p - q).abs()).collect()
    };
    let strength = |(e, p): (f64, f64)| (e.max(p) / 2f64.sqrt()).powf(QF);
    difference(&edge).into_iter().zip(difference(&point)).map(strength).collect()
}

/// Scales the negative weights to a sum of −1 and the positive ones to 1.
fn balanced(weights: Vec<f64>) -> Vec<f64> {
    let positive: f64 = weights.iter().filter(|w| **w > 0.0).sum();
    let negative: f64 = -weights.iter().filter(|w| **w < 0.0).sum::<f64>();
    weights.into_iter().map(|w| if w < 0.0 { w / negative } else { w / positive }).collect()
}

/// The distance of Abasi and Fairchild: city-block in lightness, Euclidean in colour.
fn hyab(p: [f64; 3], q: [f64; 3]) -> f64 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
}

/// CIELAB of linear RGB with colourfulness growing with lightness (the Hunt effect).
fn hunt(rgb: [f64; 3]) -> [f64; 3] {
    let f = |t: f64| {
        let limit: f64 = 6.0 / 29.0;
        if t > limit.powi(3) { t.cbrt() } else { t / (3.0 * limit * limit) + 4.0 / 29.0 }
    };
    let xyz = rgb_to_xyz(rgb);
    let [x, y, z] = std::array::from_fn(|i| f(xyz[i] / WHITE[i]));
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// The sRGB curve undone (IEC 61966-2-1).
fn linear(v: f64) -> f64 {
    if v > 0.04045 { ((v + 0.055) / 1.055).powf(2.4) } else { v / 12.92 }
}

/// Linear sRGB to XYZ, rows; D65.
const TO_XYZ: [[f64; 3]; 3] = [
    [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
    [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
    [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
];

/// The white of that space.
const WHITE: [f64; 3] = [0.950428545, 1.0, 1.088900371];

fn rgb_to_xyz(rgb: [f64; 3]) -> [f64; 3] {
    TO_XYZ.map(|row| row[0] * rgb[0] + row[1] * rgb[1] + row[2] * rgb[2])
}

fn xyz_to_rgb(xyz: [f64; 3]) -> [f64; 3] {
    use volact_core::glam::{DMat3, DVec3};
    let inverse = DMat3::from_cols_array_2d(&TO_XYZ).transpose().inverse();
    (inverse * DVec3::from_array(xyz)).to_array()
}

/// The linear opponent space of the contrast sensitivity filters.
fn xyz_to_ycxcz(xyz: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = std::array::from_fn(|i| xyz[i] / WHITE[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn ycxcz_to_xyz([l, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (l + 16.0) / 116.0;
    [(y + cx / 500.0) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]]
}
