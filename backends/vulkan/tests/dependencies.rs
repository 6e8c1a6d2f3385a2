//! The action goes through Vulkan alone.

use std::{env, process::Command};

/// `wgpu` would be a second way to a GPU in every program that takes this action alone. (`naga`, which comes from
/// the same project, translates shaders and knows no device.)
#[test]
fn no_wgpu_is_among_the_dependencies() {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let arguments = ["tree", "--offline", "--package", "volact-vulkan", "--edges", "normal,build", "--prefix", "none"];
    let output = Command::new(cargo).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let tree = String::from_utf8(output.stdout).unwrap();
    assert!(tree.lines().any(|l| l.starts_with("ash v")), "{tree}");
    let found: Vec<_> = tree.lines().filter(|l| l.starts_with("wgpu")).collect();
    assert!(found.is_empty(), "{found:?}");
}
