//! The system packages that tests of the actions on GPUs need: software Vulkan, its loader, and the
//! validation layers.

use std::process::{Command, Stdio};

/// Their names on Debian.
const PACKAGES: [&str; 3] = ["mesa-vulkan-drivers", "libvulkan1", "vulkan-validationlayers"];

/// Installs on Debian and its kin what is missing; says so where that cannot be.
pub fn ensure() {
    if !cfg!(target_os = "linux") {
        return;
    }
    if said("dpkg-query", &["--version"]).is_none() {
        println!(
            "not Debian: tests of wgpu and vulkan need a Vulkan driver, its loader and the Khronos validation layers"
        );
        return;
    }
    let wanted = missing();
    if wanted.is_empty() {
        return;
    }
    println!("installing {}", wanted.join(" "));
    let install = [&["apt-get", "install", "-y", "--no-install-recommends"], &wanted[..]].concat();
    if !(as_root(&install) || as_root(&["apt-get", "update"]) && as_root(&install)) {
        println!("cannot be installed; tests of wgpu and vulkan need: apt-get install {}", missing().join(" "));
    }
}

fn missing() -> Vec<&'static str> {
    let installed = |package: &&str| {
        said("dpkg-query", &["-W", "-f=${Status}", package]).is_some_and(|status| status.contains("ok installed"))
    };
    PACKAGES.into_iter().filter(|package| !installed(package)).collect()
}

/// Runs a command as root, by `sudo` without a password where this is another user.
fn as_root(command: &[&str]) -> bool {
    let root = said("id", &["-u"]).is_some_and(|id| id.trim() == "0");
    let command = if root { command.to_vec() } else { [&["sudo", "-n"], command].concat() };
    let mut process = Command::new(command[0]);
    process.args(&command[1..]).env("DEBIAN_FRONTEND", "noninteractive").stdin(Stdio::null());
    process.status().is_ok_and(|status| status.success())
}

/// What a command prints, if it succeeds.
fn said(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    output.status.success().then(|| String::from_utf8_lossy(&output.stdout).into_owned())
}
