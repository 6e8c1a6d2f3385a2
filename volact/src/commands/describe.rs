//! `volact describe [NAME]`: what is registered.

use std::process::ExitCode;

use volact::Registry;

/// Arguments of `volact describe`.
#[derive(clap::Args)]
pub struct Args {
    /// The name of an action, shader, geometry or loader; all are listed without one
    name: Option<String>,
}

/// Prints declarations.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    for d in registry.declarations() {
        if args.name.as_ref().is_none_or(|n| *n == d.name) {
            super::print(&format!("{} {} {}: {}\n", d.kind.name(), d.name, d.version, d.description))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}
