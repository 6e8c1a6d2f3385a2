//! Crates outside the workspace, built and tested as their authors would.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

/// The folder into which these tests were built.
pub fn target() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().to_owned()
}

/// The repository.
pub fn repository() -> PathBuf {
    let ours = fs::canonicalize(env!("CARGO_MANIFEST_DIR")).unwrap();
    ours.ancestors().find(|folder| folder.join("Cargo.lock").is_file()).unwrap().to_owned()
}

/// Runs cargo in a crate with the workspace's versions and its way of building, so that what is
/// built already is taken, and nothing is downloaded; what it wrote. Libraries lie in `debug` of
/// [`target`].
pub fn cargo(crate_folder: &Path, task: &str) -> String {
    fs::copy(repository().join("Cargo.lock"), crate_folder.join("Cargo.lock")).unwrap();
    let mut command = Command::new(env!("CARGO"));
    command.current_dir(crate_folder).args([task, "--offline", "--quiet"]);
    command.args(["--config", "profile.dev.opt-level=1", "--config", "profile.dev.package.\"*\".opt-level=1"]);
    // Its kernels take minutes to optimise, and draw a few small pictures here.
    command.args(["--config", "profile.dev.package.volact-cpu.opt-level=0"]);
    // Cargo tells its children about the package under test, which is another one here.
    let ours = env::vars_os().map(|(name, _)| name).filter(|name| name.to_string_lossy().starts_with("CARGO_PKG_"));
    ours.for_each(|name| _ = command.env_remove(name));
    command.env_remove("CARGO_MANIFEST_DIR").env_remove("RUSTFLAGS").env("CARGO_TARGET_DIR", target());
    let output = command.output().unwrap();
    let (out, err) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{}: cargo {task}\n{out}{err}", crate_folder.display());
    out.into_owned()
}
