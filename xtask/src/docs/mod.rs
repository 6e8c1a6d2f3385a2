//! `cargo xtask docs`: writes docs/reference anew, from the declarations of what is registered.
//!
//! The command does it (`volact describe --all --markdown`), so that whoever has plugins can do the
//! same. What it lacks are small files of every format: those are written here, by rule.

mod meshes;
mod volumes;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};

/// A file's name and bytes.
type File = (&'static str, Vec<u8>);

/// Arguments of `cargo xtask docs`.
#[derive(clap::Args)]
pub struct Args {
    /// Leave the pictures as they are
    #[arg(long)]
    text_only: bool,
    /// Only write the files that the pictures show into this folder
    #[arg(long, value_name = "FOLDER")]
    samples: Option<PathBuf>,
}

/// Writes pages and pictures.
///
/// # Errors
/// If the command cannot be built or says that something is wrong.
pub fn run(args: &Args) -> Result<()> {
    if let Some(folder) = &args.samples {
        return write(folder);
    }
    let folder = tempfile::tempdir().context("no folder for the files that the pictures show")?;
    write(folder.path())?;
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("xtask lies in the workspace")?;
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root).args(["run", "--quiet", "--package", "volact", "--"]);
    command.args(["-v", "describe", "--all", "--markdown", "docs/reference", "--sources", "../../shaders/wgsl"]);
    command.arg("--data-dir").arg(folder.path()).env("VOLACT_CONFIG", "");
    if args.text_only {
        command.arg("--text-only");
    }
    let status = command.status().context("cargo cannot be started")?;
    if !status.success() {
        bail!("volact describe: {status}");
    }
    Ok(())
}

/// Writes all files that the pictures show and that are not in the repository.
fn write(folder: &Path) -> Result<()> {
    for (name, bytes) in volumes::files()?.into_iter().chain(meshes::files()) {
        let path = folder.join(name);
        let parent = path.parent().context("a file lies in a folder")?;
        fs::create_dir_all(parent).with_context(|| format!("{} cannot be made", parent.display()))?;
        fs::write(&path, bytes).with_context(|| format!("{} cannot be written", path.display()))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each file is what its format's loader takes it for.
    #[test]
    fn every_sample_is_read() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path()).unwrap();
        let mut registry = volact_core::Registry::with_core();
        volact_files::loaders().into_iter().for_each(|loader| registry.add_loader(loader).unwrap());
        for (name, loader) in [
            ("head", "dicom"),
            ("head.nii", "nifti"),
            ("part.mha", "metaimage"),
            ("slices", "png"),
            ("signal.raw.ron", "raw"),
            ("head.tif", "tiff"),
            ("part.vti", "vti"),
            ("head.vtk", "vtk"),
            ("colour.nrrd", "nrrd"),
            ("labels.nrrd", "nrrd"),
            ("spots.nrrd", "nrrd"),
            ("ring.vtu", "vtu"),
            ("duct.vts", "vts"),
            ("duct.xyz", "plot3d"),
            ("knot.ply", "ply"),
            ("urchin.stl", "stl"),
            ("shell.vtp", "vtp"),
        ] {
            let path = folder.path().join(name);
            let chosen = volact_core::loader::choose(registry.loaders(), &path).unwrap();
            assert_eq!(chosen.declaration().name, loader, "{name}");
            let none = volact_core::LoadOptions::new();
            registry.load_any(&path, None, &none, &volact_core::loader::NoProgress).unwrap();
        }
    }
}
