//! `cargo xtask peer`: one of the peers' scenes, drawn and timed by one action.

use std::{
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::{Result, bail};
use serde_json::json;
use volact_core::{Frame, Options, ParameterValue, Registry};
use volact_files::picture::{self, PngOptions};

use crate::peer_scene::PeerScene;

/// Arguments of `peer`.
#[derive(clap::Args)]
pub struct Args {
    /// The scene's JSON file.
    #[arg(long)]
    scene: PathBuf,
    /// The folder of the raw volumes.
    #[arg(long)]
    data: PathBuf,
    /// The view: ortho or persp.
    #[arg(long, default_value = "ortho")]
    view: String,
    /// Sample distance in world units.
    #[arg(long, default_value_t = 1.0)]
    step: f64,
    /// Rows and columns of the picture.
    #[arg(long, default_value_t = 512)]
    size: usize,
    /// The action.
    #[arg(long, default_value = "cpu")]
    action: String,
    /// Where the picture goes: .npy, .png or .exr.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Frames to time.
    #[arg(long, default_value_t = 15)]
    frames: usize,
    /// Options of the action: name=value.
    #[arg(long = "option", value_name = "NAME=VALUE")]
    options: Vec<String>,
}

/// Runs it.
pub fn run(args: &Args) -> Result<()> {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry)?;
    #[cfg(feature = "gpu")]
    {
        volact_wgpu::register(&mut registry)?;
        volact_vulkan::register(&mut registry)?;
    }
    for entry in volact_shaders::builtin().map_err(|problems| anyhow::anyhow!("{problems}"))? {
        if registry.shaders().get(&entry.declaration.name).is_none() {
            registry.add_shader(entry)?;
        }
    }
    let scene = PeerScene::read(&args.scene)?;
    let shape = scene.shape(&args.data)?;
    let desc = scene.frame(&args.view, args.size)?;
    let mut options = Options::from([("sample_distance".into(), args.step.into())]);
    for option in &args.options {
        let Some((name, value)) = option.split_once('=') else { bail!("option is {option:?}, wanted NAME=VALUE") };
        options.insert(name.into(), value_of(value));
    }
    let mut action = registry.action(&args.action, &options)?;
    action.manage(&shape)?;
    let mut draw = || -> Result<(Frame, f64)> {
        let start = Instant::now();
        action.begin_draw(&desc)?;
        action.draw(&shape)?;
        let frame = action.end_draw()?;
        Ok((frame, start.elapsed().as_secs_f64() * 1e3))
    };
    let (mut frame, first_ms) = draw()?;
    let mut times = Vec::new();
    let (cpu, wall) = (processor_seconds(), Instant::now());
    for _ in 0..args.frames.max(1) {
        let (next, ms) = draw()?;
        frame = next;
        times.push(ms);
    }
    let busy = (processor_seconds() - cpu) / wall.elapsed().as_secs_f64();
    times.sort_by(f64::total_cmp);
    if let Some(out) = &args.out {
        save(out, &frame)?;
    }
    let stats = &frame.statistics;
    let ms = times[times.len() / 2];
    let row = json!({
        "action": args.action, "scene": scene.name, "view": args.view, "step": args.step,
        "size": args.size, "ms": round(ms), "ms_min": round(times[0]), "ms_max": round(times[times.len() - 1]),
        "frames": times.len(), "first_ms": round(first_ms), "cpu": round(busy), "peak_mib": peak_mib(),
        "classification": frame.method.classification, "device": frame.method.device,
        "samples": stats.samples, "skipped": stats.skipped, "resident_bytes": stats.resident_bytes,
        "volume_bytes": shape.state().volume().map(|t| t.volume().data().bytes().len()),
        "msamples_s": round(stats.samples as f64 / ms / 1e3),
    });
    println!("{row}");
    Ok(())
}

fn save(path: &Path, frame: &Frame) -> Result<()> {
    match path.extension().and_then(|e| e.to_str()) {
        Some("npy") => picture::save_npy(path, frame)?,
        Some("exr") => picture::save_exr(path, frame)?,
        Some("png") => picture::save_png(path, frame, PngOptions::default())?,
        _ => bail!("{}: picture format is unknown, wanted .npy, .png or .exr", path.display()),
    }
    Ok(())
}

/// A number, a truth value, or a word.
fn value_of(text: &str) -> ParameterValue {
    if let Ok(v) = text.parse::<i64>() {
        return v.into();
    }
    if let Ok(v) = text.parse::<f64>() {
        return v.into();
    }
    match text {
        "true" => true.into(),
        "false" => false.into(),
        word => word.into(),
    }
}

fn round(v: f64) -> f64 {
    (v * 100.0).round() / 100.0
}

/// Processor time of this process so far.
#[expect(unsafe_code, reason = "the operating system's accounting")]
fn processor_seconds() -> f64 {
    // SAFETY: `rusage` is plain numbers, filled in by the call.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_SELF, &mut usage);
        usage
    };
    let seconds = |t: libc::timeval| t.tv_sec as f64 + t.tv_usec as f64 * 1e-6;
    seconds(usage.ru_utime) + seconds(usage.ru_stime)
}

/// Peak resident memory of this process.
#[expect(unsafe_code, reason = "the operating system's accounting")]
fn peak_mib() -> i64 {
    // SAFETY: as above.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_SELF, &mut usage);
        usage
    };
    usage.ru_maxrss / 1024
}
