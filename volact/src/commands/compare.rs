//! `volact compare`: how much two pictures differ, and whether that is too much.

use std::{
    fmt::Write as _,
    fs::File,
    io::Read as _,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::Context as _;
use serde_json::{Value, json};
use volact::{
    Camera, Frame, FrameDesc, Registry, View,
    core::{Aabb, glam::DVec3},
    metrics::{self, Differences, Image},
};
use volact_files::picture::{self, Picture, PngOptions};

/// Arguments of `volact compare`.
#[derive(clap::Args)]
#[command(after_help = "Pictures are PNG, OpenEXR or NumPy. Without thresholds the pictures are measured and the \
    exit code is 0.\nExit codes: 0 within all thresholds given, 1 past one, 2 not comparable.\n\
    Max, RMSE and PSNR take the numbers as they are, alpha included, for a peak of 1; SSIM and FLIP see \
    the pictures over black, FLIP as sRGB from 67 pixels a degree.")]
pub struct Args {
    /// The picture found
    a: PathBuf,
    /// The picture wanted
    b: PathBuf,
    /// Exit with 1 where a channel differs by more than this (0.004 is about one step of 8 bits)
    #[arg(long, value_name = "DIFFERENCE", value_parser = threshold)]
    max: Option<f64>,
    /// Exit with 1 where the root of the mean square difference is above this
    #[arg(long, value_name = "DIFFERENCE", value_parser = threshold)]
    rmse: Option<f64>,
    /// Exit with 1 where the peak signal-to-noise ratio is below this many decibels
    #[arg(long, value_name = "DB", value_parser = threshold)]
    psnr: Option<f64>,
    /// Exit with 1 where the structural similarity is below this (1 for equal pictures)
    #[arg(long, value_name = "SIMILARITY", value_parser = threshold)]
    ssim: Option<f64>,
    /// Exit with 1 where the mean FLIP is above this (0 for equal pictures)
    #[arg(long, value_name = "FLIP", value_parser = threshold)]
    flip: Option<f64>,
    /// Write a picture of the differences: FLIP, black where none is seen to yellow
    #[arg(long, value_name = "FILE.png")]
    diff: Option<PathBuf>,
    /// In that picture show the largest difference of a pixel's channels instead, pale yellow from this one on
    #[arg(long, value_name = "DIFFERENCE", value_parser = positive, requires = "diff")]
    diff_scale: Option<f64>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Compares and prints; 1 where a threshold given is passed.
///
/// # Errors
/// If a picture cannot be read, or the two differ in size.
pub fn run(args: Args, _: &Registry) -> anyhow::Result<ExitCode> {
    let (a, b) = (read(&args.a)?, read(&args.b)?);
    let found = metrics::compare(&image(&a), &image(&b))
        .with_context(|| format!("cannot compare {} with {}", args.a.display(), args.b.display()))?;
    if let Some(path) = &args.diff {
        let heats = match args.diff_scale {
            Some(scale) => a.rgba.iter().zip(&b.rgba).map(|(a, b)| (apart(*a, *b) / scale) as f32).collect(),
            None => found.flip_map.clone(),
        };
        save_heat(path, &heats, a.width, a.height)?;
    }
    let passed = args.passed(&found);
    let text = if args.json { to_json(&found, &passed) } else { to_text(&found, &passed) };
    super::print(&text)?;
    Ok(ExitCode::from(u8::from(!passed.is_empty())))
}

/// A threshold: a number.
fn threshold(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(v) if !v.is_nan() => Ok(v),
        _ => Err(format!("{text:?} is no number")),
    }
}

/// A number above zero.
fn positive(text: &str) -> Result<f64, String> {
    threshold(text).and_then(|v| if v > 0.0 { Ok(v) } else { Err(format!("{text:?} is not above 0")) })
}

/// The largest difference of two pixels' channels; infinite where one of them is no number.
fn apart(a: [f32; 4], b: [f32; 4]) -> f64 {
    let channel = |c: usize| (f64::from(a[c]) - f64::from(b[c])).abs();
    (0..4).map(channel).fold(0.0, |most, d| if d.is_nan() { f64::INFINITY } else { most.max(d) })
}

/// A difference with digits that tell, however small it is.
fn figure(v: f64) -> String {
    if v != 0.0 && v < 1e-4 { format!("{v:.2e}") } else { format!("{v:.6}") }
}

impl Args {
    /// The thresholds that are passed, in words. What cannot be measured passes its threshold.
    fn passed(&self, found: &Differences) -> Vec<String> {
        let above = [("max", self.max, found.max), ("rmse", self.rmse, found.rmse), ("flip", self.flip, found.flip)];
        let below = [("psnr", self.psnr, found.psnr), ("ssim", self.ssim, found.ssim.unwrap_or(f64::NAN))];
        let mut passed = Vec::new();
        for (name, limit, value) in above {
            passed.extend(
                limit
                    .filter(|l| value.is_nan() || value > *l)
                    .map(|l| format!("{name} is {value:.6}, wanted at most {l}")),
            );
        }
        for (name, limit, value) in below {
            passed.extend(
                limit
                    .filter(|l| value.is_nan() || value < *l)
                    .map(|l| format!("{name} is {value:.6}, wanted at least {l}")),
            );
        }
        passed
    }
}

/// Reads a picture and premultiplies it where the format has straight alpha.
fn read(path: &Path) -> anyhow::Result<Picture> {
    let mut picture = picture::load_picture(path)?;
    let mut head = [0u8; 4];
    File::open(path).and_then(|mut f| f.read_exact(&mut head)).with_context(|| format!("{}", path.display()))?;
    if head == *b"\x89PNG" {
        picture.rgba.iter_mut().for_each(|p| *p = [p[0] * p[3], p[1] * p[3], p[2] * p[3], p[3]]);
    }
    Ok(picture)
}

fn image(picture: &Picture) -> Image<'_> {
    Image { width: picture.width, height: picture.height, rgba: &picture.rgba }
}

fn to_text(found: &Differences, passed: &[String]) -> String {
    let mut text = String::new();
    let [x, y] = found.worst;
    let most = if found.max > 0.0 { format!(" in column {x}, row {y}") } else { String::new() };
    let ssim = found.ssim.map_or("none below 11 pixels on a side".into(), |v| format!("{v:.6}"));
    _ = writeln!(text, "differing  {} of {} pixels", found.differing, found.flip_map.len());
    _ = writeln!(text, "max        {}{most}", figure(found.max));
    _ = writeln!(text, "rmse       {}", figure(found.rmse));
    _ = writeln!(text, "psnr       {:.2} dB", found.psnr);
    _ = writeln!(text, "ssim       {ssim}");
    _ = writeln!(text, "flip       {:.6}", found.flip);
    for threshold in passed {
        _ = writeln!(text, "differs: {threshold}");
    }
    text
}

fn to_json(found: &Differences, passed: &[String]) -> String {
    // JSON has no infinity: equal pictures have the psnr null.
    let number = |v: f64| if v.is_finite() { json!(v) } else { Value::Null };
    let value = json!({
        "pixels": found.flip_map.len(),
        "differing": found.differing,
        "max": number(found.max),
        "worst": found.worst,
        "rmse": number(found.rmse),
        "psnr": number(found.psnr),
        "ssim": found.ssim,
        "flip": found.flip,
        "passed": passed,
    });
    format!("{value:#}\n")
}

fn save_heat(path: &Path, heats: &[f32], width: usize, height: usize) -> anyhow::Result<()> {
    let bounds = Aabb::new(DVec3::ZERO, DVec3::ONE);
    let mut frame = Frame::empty(&FrameDesc::new(Camera::fit(&bounds, View::Front, width, height), width, height));
    frame.color = heats.iter().map(|&v| heat(v)).collect();
    picture::save_png(path, &frame, PngOptions::default())?;
    Ok(())
}

/// From black over violet and orange to pale yellow: lightness rises all the way.
fn heat(v: f32) -> [f32; 4] {
    const STOPS: [[f32; 3]; 6] = [
        [0.0, 0.0, 0.0],
        [0.23, 0.06, 0.44],
        [0.55, 0.16, 0.51],
        [0.87, 0.29, 0.41],
        [0.99, 0.62, 0.43],
        [0.99, 0.99, 0.75],
    ];
    let at = v.clamp(0.0, 1.0) * (STOPS.len() - 1) as f32;
    let below = (at as usize).min(STOPS.len() - 2);
    let t = at - below as f32;
    let channel = |c: usize| STOPS[below][c] * (1.0 - t) + STOPS[below + 1][c] * t;
    [channel(0), channel(1), channel(2), 1.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn args(max: Option<f64>, psnr: Option<f64>) -> Args {
        let (a, b) = ("a.png".into(), "b.png".into());
        Args { a, b, max, rmse: None, psnr, ssim: None, flip: None, diff: None, diff_scale: None, json: false }
    }

    fn differences(value: f32) -> Differences {
        let (a, b) = ([[0.0f32; 4]; 4], [[value; 4]; 4]);
        let image = |rgba| Image { width: 2, height: 2, rgba };
        metrics::compare(&image(&a), &image(&b)).unwrap()
    }

    #[test]
    fn thresholds_are_passed_only_where_given() {
        let found = differences(0.5);
        assert!(args(None, None).passed(&found).is_empty());
        assert!(args(Some(0.5), None).passed(&found).is_empty());
        assert_eq!(args(Some(0.25), None).passed(&found), ["max is 0.500000, wanted at most 0.25"]);
        assert_eq!(args(None, Some(30.0)).passed(&found).len(), 1);
        assert!(args(Some(0.0), Some(99.0)).passed(&differences(0.0)).is_empty());
    }

    #[test]
    fn heat_rises_in_lightness() {
        let lightness = |i: u8| heat(f32::from(i) / 100.0)[..3].iter().sum::<f32>();
        assert!((1..=100).all(|i| lightness(i) > lightness(i - 1)));
    }

    #[test]
    fn json_says_what_text_says() {
        let value: Value = serde_json::from_str(&to_json(&differences(0.0), &[])).unwrap();
        assert_eq!(
            (value["max"].as_f64(), value["psnr"].is_null(), value["pixels"].as_u64()),
            (Some(0.0), true, Some(4))
        );
        assert!(to_text(&differences(0.5), &[]).contains("max        0.500000 in column 0, row 0"));
    }
}
