//! `volact render`: draws a scene or bare data into a picture.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::bail;
use volact::{FrameExt as _, Registry, save::PictureFormat};
use volact_files::picture::PngOptions;

use super::{progress::Line, report::Report, source, source::Source};

/// Arguments of `volact render`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    volact render head.nrrd                       a look that suits the data, into head.png\n  \
    volact render head.nrrd --shader mip --view front --size 800x600 -o mip.png\n  \
    volact render scene.ron --set unit_distance=2 --set 'skin.lookup_table=WindowLevel(window: 400, level: 40, opacity: 0.1)'\n  \
    volact render scene.ron --action cpu --option classification=post --step 0.25 -o exact.exr\n  \
    volact render room.vtu --up y --attribute t --slice z=50% --slice x=1.5 --around-slices\n  \
    volact render part.stl --clip 'y>0'\n  \
    volact render scene.ron --watch               and again after each edit of its files\n\
    Existing pictures are replaced; a picture appears whole or not at all. `volact describe` lists what names mean.")]
pub struct Args {
    #[command(flatten)]
    pub source: source::Args,
    /// The action that draws; the scene's, else the first preferred one that can
    #[arg(short, long, value_name = "NAME")]
    pub action: Option<String>,
    /// The picture: .png, .exr or .npy [default: the input's name with .png, in the current folder]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write a PNG without background, with straight alpha
    #[arg(long)]
    straight_alpha: bool,
    /// Write a PNG of 16 bits a channel
    #[arg(long)]
    sixteen_bit: bool,
    /// Print the summary as JSON
    #[arg(long)]
    pub json: bool,
    /// Stay, and draw anew whenever a file changes that the picture depends on; Ctrl-C ends it
    #[arg(long)]
    pub watch: bool,
}

/// Draws, writes and prints a summary.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let output = args.output()?;
    let png = args.png(&output)?;
    let mut source = Source::open(&args.source, args.action.as_deref(), registry)?;
    let line = Line::new(format!("drawing with {}", source.choice.name));
    let mut frame = source.draw()?;
    frame.save_with(&output, png)?;
    // A picture in the time asked for, and finer ones until the error is kept.
    while frame.plan.as_ref().is_some_and(|plan| plan.refining) {
        frame = source.draw()?;
        frame.save_with(&output, png)?;
    }
    drop(line);
    let report = Report { source: &source, frame: &frame, output: &output };
    report.warn();
    match args.json {
        true => super::print(&format!("{:#}\n", report.to_json()))?,
        false if super::quiet() => {}
        false => super::print(&report.to_text())?,
    }
    Ok(ExitCode::SUCCESS)
}

impl Args {
    /// The config file that is named.
    pub fn config(&self) -> Option<PathBuf> {
        self.source.config.clone()
    }

    /// The scene file, if it is one that is drawn.
    pub fn scene(&self) -> Option<&Path> {
        self.source.scene_file()
    }

    /// The picture's file.
    pub fn output(&self) -> anyhow::Result<PathBuf> {
        self.output.clone().map_or_else(|| default_output(&self.source.input), Ok)
    }

    /// What a PNG shall be; all that can be said before drawing is said here.
    pub fn png(&self, output: &Path) -> anyhow::Result<PngOptions> {
        let format = PictureFormat::of(output)?;
        if format != PictureFormat::Png && (self.straight_alpha || self.sixteen_bit) {
            bail!(
                "{}: --straight-alpha and --sixteen-bit are for .png; the others hold what was drawn",
                output.display()
            );
        }
        let folder = output.parent().filter(|p| !p.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|p| !p.is_dir()) {
            bail!("{}: the folder {} is not there", output.display(), folder.display());
        }
        if output.is_dir() {
            bail!("{}: is a folder, wanted a file for the picture", output.display());
        }
        if overwrites(&self.source.input, output) {
            bail!("{}: is what is drawn from; give the picture another name with -o", output.display());
        }
        Ok(PngOptions { over_background: !self.straight_alpha, sixteen_bit: self.sixteen_bit })
    }
}

/// Whether an output is the input, or one of its series.
fn overwrites(input: &Path, output: &Path) -> bool {
    let (Ok(input), Ok(output)) = (input.canonicalize(), output.canonicalize()) else { return false };
    output == input || (input.is_dir() && output.parent() == Some(&input))
}

/// Extensions of inputs, those of compressed files first.
const ENDINGS: [&str; 22] = [
    ".gz", ".ron", ".nrrd", ".nhdr", ".nii", ".mha", ".mhd", ".tif", ".tiff", ".vti", ".vtk", ".vtu", ".vts", ".raw",
    ".dcm", ".stl", ".ply", ".obj", ".xyz", ".p3d", ".q", ".bin",
];

/// The input's name without its extension, as `.png` in the current folder.
fn default_output(input: &Path) -> anyhow::Result<PathBuf> {
    let name = input.file_name().map(|name| name.to_string_lossy().into_owned());
    let Some(mut stem) = name else {
        bail!("{}: has no name to call the picture by; give one with -o", input.display())
    };
    for ending in ENDINGS {
        stem = stem.strip_suffix(ending).filter(|s| !s.is_empty()).map_or(stem.clone(), str::to_owned);
    }
    Ok(PathBuf::from(stem + ".png"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn picture_is_called_like_its_input() {
        let name = |input: &str| default_output(Path::new(input)).map(|p| p.display().to_string()).unwrap();
        assert_eq!(name("scans/head.nrrd"), "head.png");
        assert_eq!(name("brain.nii.gz"), "brain.png");
        assert_eq!(name("series/"), "series.png");
        assert_eq!(name("v1.2.raw"), "v1.2.png");
        assert_eq!(name("meshes/room.vtu"), "room.png");
        assert!(default_output(Path::new("..")).is_err());
    }
}
