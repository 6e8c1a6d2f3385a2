//! `cargo xtask test`, `cargo xtask conformance` and `cargo xtask check`.

use std::{env, path::Path, process::Command};

use anyhow::{Context, Result, bail};

use crate::packages;

/// The whole test suite, after what it needs of the system was installed; tests of real data look for
/// them in the folder that `VOLACT_DATA` names and say so where it is missing.
pub fn test() -> Result<()> {
    if env::var_os("VOLACT_DATA").is_none() {
        println!("VOLACT_DATA is not set: tests of real data files are skipped");
    }
    packages::ensure();
    cargo(&["test", "--workspace", "--no-fail-fast"], &[])
}

/// Everything that continuous integration asks for.
pub fn all() -> Result<()> {
    cargo(&["fmt", "--all", "--check"], &[])?;
    cargo(&["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"], &[])?;
    cargo(&["doc", "--workspace", "--no-deps"], &[("RUSTDOCFLAGS", "-D warnings")])?;
    test()
}

/// The conformance suite on the project's own actions, and on faults made in them.
pub fn conformance() -> Result<()> {
    cargo(&["test", "-p", "volact-conformance", "--test", "conformance"], &[])?;
    let faults = ["--features", "mutations", "--test", "mutations", "--test", "orders", "--", "--nocapture"];
    cargo(&[&["test", "-p", "volact-conformance"][..], &faults].concat(), &[])
}

fn cargo(args: &[&str], variables: &[(&str, &str)]) -> Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(args).current_dir(root).envs(variables.iter().copied());
    println!("cargo {}", args.join(" "));
    let status = command.status().context("cargo cannot be run")?;
    if !status.success() {
        bail!("cargo {} failed: {status}", args.join(" "));
    }
    Ok(())
}
