//! `cargo xtask new-plugin KIND NAME`: a crate that builds, tests itself and draws something.

use std::{
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Context, Result, bail};

/// What the crate registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// A render action.
    Action,
    /// A shader.
    Shader,
    /// A geometry.
    Geometry,
    /// A loader of volumes.
    Loader,
}

/// Arguments of `cargo xtask new-plugin`.
#[derive(clap::Args)]
pub struct Args {
    /// What it registers
    kind: Kind,
    /// Its name: lower-case letters, digits and '-' or '_'
    name: String,
    /// Where to make the folder NAME
    #[arg(long, default_value = ".")]
    into: PathBuf,
}

const MANIFEST: &str = include_str!("../templates/Cargo.toml.txt");
const CONFIG: &str = include_str!("../templates/config.ron.txt");
const README: &str = include_str!("../templates/README.md.txt");
const TEST: &str = include_str!("../templates/test.rs.txt");

/// The source of the crate, and what its test does with a registry that has it.
fn template(kind: Kind) -> [&'static str; 2] {
    match kind {
        Kind::Action => [include_str!("../templates/action.rs.txt"), include_str!("../templates/action_test.rs.txt")],
        Kind::Shader => [include_str!("../templates/shader.rs.txt"), include_str!("../templates/shader_test.rs.txt")],
        Kind::Geometry => {
            [include_str!("../templates/geometry.rs.txt"), include_str!("../templates/geometry_test.rs.txt")]
        }
        Kind::Loader => [include_str!("../templates/loader.rs.txt"), include_str!("../templates/loader_test.rs.txt")],
    }
}

/// Makes the crate.
///
/// # Errors
/// If the name is no name, the folder is there already, or it cannot be written.
pub fn run(args: &Args) -> Result<()> {
    let folder = make(args.kind, &args.name, &args.into)?;
    println!("{}: now `cargo test` in it, and see its README", folder.display());
    Ok(())
}

fn make(kind: Kind, name: &str, into: &Path) -> Result<PathBuf> {
    let plain = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-' || c == '_');
    if !plain || !name.starts_with(|c: char| c.is_ascii_lowercase()) || name.len() > 64 {
        bail!("name is {name:?}, wanted up to 64 lower-case letters, digits, '-' and '_', starting with a letter");
    }
    let folder = into.join(name);
    if folder.exists() {
        bail!("{} is there already, wanted a new folder", folder.display());
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    let root = root.to_str().context("the path of the repository is not UTF-8")?;
    let fill = |text: &str| {
        let text = text.replace("{{name}}", name).replace("{{crate}}", &name.replace('-', "_"));
        text.replace("{{volact}}", root).replace("{{kind}}", &format!("{kind:?}").to_lowercase())
    };
    let [source, check] = template(kind);
    let mut files = vec![
        ("Cargo.toml", fill(MANIFEST)),
        ("config.ron", fill(CONFIG)),
        ("README.md", fill(README)),
        ("src/lib.rs", fill(source)),
        ("tests/plugin.rs", fill(&TEST.replace("{{check}}", check))),
    ];
    if kind == Kind::Shader {
        files.push(("src/shader.wgsl", fill(include_str!("../templates/shader.wgsl.txt"))));
    }
    for (path, text) in files {
        let path = folder.join(path);
        let parent = path.parent().context("a file lies in a folder")?;
        fs::create_dir_all(parent).with_context(|| format!("{} cannot be made", parent.display()))?;
        fs::write(&path, text).with_context(|| format!("{} cannot be written", path.display()))?;
    }
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_is_filled_in() {
        let folder = tempfile::tempdir().unwrap();
        for kind in [Kind::Action, Kind::Shader, Kind::Geometry, Kind::Loader] {
            let made = make(kind, &format!("a-{kind:?}").to_lowercase(), folder.path()).unwrap();
            for file in ["Cargo.toml", "config.ron", "README.md", "src/lib.rs", "tests/plugin.rs"] {
                let text = fs::read_to_string(made.join(file)).unwrap();
                assert!(!text.contains("{{") && !text.contains("A action"), "{kind:?} {file}");
            }
            assert!(
                make(kind, &format!("a-{kind:?}").to_lowercase(), folder.path()).is_err(),
                "nothing is overwritten"
            );
        }
        for name in ["", "Up", "../x", "1a", "a b"] {
            assert!(make(Kind::Shader, name, folder.path()).is_err(), "{name:?}");
        }
    }
}
