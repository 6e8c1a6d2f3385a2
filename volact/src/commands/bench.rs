//! `volact bench`.

use std::process::ExitCode;

use volact::Registry;

/// Arguments of `volact bench`.
#[derive(clap::Args)]
pub struct Args {}

/// Runs it.
pub fn run(_: Args, _: &Registry) -> anyhow::Result<ExitCode> {
    Ok(ExitCode::SUCCESS)
}
