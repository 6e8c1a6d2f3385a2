//! `cargo xtask gpu-report`: what the actions on GPUs do on this machine, as one file: adapter and driver, figures,
//! and what the conformance suite finds.

use std::{
    env,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};

/// Arguments of `gpu-report`.
#[derive(clap::Args)]
pub struct Args {
    /// Where the report goes.
    #[arg(short, long, default_value = "target/gpu-report.md")]
    out: PathBuf,
    /// Samples along an edge of the volume that is timed.
    #[arg(long, default_value_t = 256)]
    samples: usize,
    /// Pixels along an edge of the picture.
    #[arg(long, default_value_t = 512)]
    pixels: usize,
    /// Frames of each setting.
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    /// Only figures, without the suite.
    #[arg(long)]
    without_suite: bool,
}

/// Actions and options that the suite holds.
const HELD: [(&str, &[&str]); 3] = [("wgpu", &[]), ("wgpu", &["method=slices"]), ("vulkan", &[])];

/// Measures, and writes the file.
pub fn run(args: &Args) -> Result<()> {
    let mut text = String::from("# Actions on GPUs\n\n");
    let _ = writeln!(text, "Written by `cargo xtask gpu-report`; Volact {}.\n", env!("CARGO_PKG_VERSION"));
    let _ = writeln!(text, "{}", figures(args)?);
    if !args.without_suite {
        text.push_str("## The conformance suite\n\nWhat did not simply pass, and how many did.\n");
        for (action, options) in HELD {
            let _ = writeln!(text, "\n```text\n{}\n```", suite(action, options)?);
        }
    }
    if let Some(folder) = args.out.parent() {
        fs::create_dir_all(folder).with_context(|| format!("{}: cannot be made", folder.display()))?;
    }
    let temporary = args.out.with_extension("tmp");
    fs::write(&temporary, &text).with_context(|| format!("{}: cannot be written", temporary.display()))?;
    fs::rename(&temporary, &args.out)?;
    println!("{}: written", args.out.display());
    Ok(())
}

fn cargo() -> Command {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or_else(|| Path::new("."));
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root);
    command
}

/// What the example of `volact-wgpu` prints: times of all settings, and the adapter's limits.
fn figures(args: &Args) -> Result<String> {
    let numbers = [args.samples, args.pixels, args.rounds].map(|n| n.to_string());
    let mut command = cargo();
    command
        .args(["run", "--release", "--quiet", "-p", "volact-conformance", "--example", "gpu_figures", "--"])
        .args(numbers);
    let output = command.output().context("cargo cannot be run")?;
    if !output.status.success() {
        bail!("the figures cannot be had: {}", String::from_utf8_lossy(&output.stderr));
    }
    String::from_utf8(output.stdout).context("the figures are no text")
}

/// What the suite says that did not pass, and its last line.
fn suite(action: &str, options: &[&str]) -> Result<String> {
    let mut command = cargo();
    command.args(["run", "--release", "--quiet", "--", "conform", "--quiet", "--action", action]);
    options.iter().for_each(|o| _ = command.args(["--option", o]));
    println!("the suite on {action} {}", options.join(" "));
    let output = command.output().context("cargo cannot be run")?;
    let said = if output.stdout.is_empty() { &output.stderr } else { &output.stdout };
    Ok(String::from_utf8_lossy(said).trim().to_owned())
}
