//! `volact info`: what a file holds, and how its values are spread.

mod chart;
mod mesh;
mod values;

use std::{
    fmt::Write as _,
    io::IsTerminal as _,
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::Context as _;
use serde_json::{Value, json};
use volact::{
    Aabb, LoadError, LoadOptions, Loader, Registry, Volume, VolumeDesc, VolumeReader,
    core::{
        glam::DVec3,
        loader::{self, Content, NoProgress},
        volume::Components,
    },
    transfer,
};

use super::{
    progress::Line,
    settings::{self, Setting},
};
use chart::{Chart, Style};
use values::{PERCENTILES, Values};

/// Arguments of `volact info`.
#[derive(clap::Args)]
pub struct Args {
    /// The file, or the directory of a series
    file: PathBuf,
    /// Read with this loader instead of the one that knows the content
    #[arg(long, value_name = "NAME")]
    loader: Option<String>,
    /// An option of the loader, e.g. those of raw files: dims=(64, 64, 64)
    #[arg(long = "load", value_name = "NAME=VALUE")]
    load: Vec<Setting>,
    /// Look at the header only: no values, no histogram
    #[arg(long)]
    header: bool,
    /// The component of a volume whose values are shown
    #[arg(long, default_value_t = 0, value_name = "NUMBER")]
    component: usize,
    /// The attribute of a mesh whose values are shown: NAME, or NAME[2] for one of its components
    #[arg(long, value_name = "NAME")]
    attribute: Option<String>,
    /// Draw the histogram on a logarithmic scale
    #[arg(long)]
    log: bool,
    /// Columns of the histogram; as wide as the terminal unless told
    #[arg(long, value_name = "COLUMNS")]
    bins: Option<usize>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Reads a file and prints what it holds.
///
/// # Errors
/// If the file cannot be read, or has no such component.
pub fn run(args: Args, registry: &Registry) -> anyhow::Result<ExitCode> {
    let loader = choose(registry, &args)?;
    if loader.content() == Content::Mesh {
        return mesh_info(&args, loader.as_ref());
    }
    anyhow::ensure!(args.attribute.is_none(), "--attribute is for meshes; {} holds a volume", args.file.display());
    let mut reader = open(loader.as_ref(), &args.file, &settings::options(&args.load)?)?;
    let desc = reader.desc().clone();
    anyhow::ensure!(
        args.component < desc.components,
        "{}: component is {}, wanted less than {}",
        args.file.display(),
        args.component,
        desc.components
    );
    let volume = match args.header {
        true => None,
        false => Some(Volume::new(desc.clone(), reader.read(&NoProgress)?).context("the data make no volume")?),
    };
    let warnings: Vec<String> = reader.warnings().iter().map(ToString::to_string).collect();
    let facts = Facts::new(&args.file, &loader.declaration().name, &desc, warnings);
    let values = volume.as_ref().map(|v| (Values::new(v, args.component), transfer::automatic(v)));
    let text = if args.json {
        facts.to_json(values.as_ref(), args.bins.unwrap_or(64))
    } else {
        facts.to_text(values.as_ref(), &args)
    };
    super::print(&text)?;
    Ok(ExitCode::SUCCESS)
}

/// Reads a mesh and prints what it holds.
fn mesh_info(args: &Args, loader: &dyn Loader) -> anyhow::Result<ExitCode> {
    let line = Line::new(format!("reading {}", args.file.display()));
    let data = loader::load_mesh(loader, &args.file, &settings::options(&args.load)?, &line)?;
    drop(line);
    let facts = mesh::Facts::new(&args.file, &loader.declaration().name, &data, args)?;
    let text = if args.json { facts.to_json(args.bins.unwrap_or(64)) } else { facts.to_text(args) };
    super::print(&text)?;
    Ok(ExitCode::SUCCESS)
}

fn choose(registry: &Registry, args: &Args) -> anyhow::Result<std::sync::Arc<dyn Loader>> {
    let loaders = registry.loaders();
    let Some(name) = &args.loader else { return Ok(loader::choose(loaders, &args.file)?.clone()) };
    let known: Vec<_> = loaders.iter().map(|l| l.declaration().name.as_str()).collect();
    loaders.iter().find(|l| l.declaration().name == *name).cloned().with_context(|| {
        let hint = volact::core::names::hint(name, known.iter().copied());
        format!("no loader is called {name:?}{hint}; known: {}", known.join(", "))
    })
}

fn open(loader: &dyn Loader, path: &Path, options: &LoadOptions) -> anyhow::Result<Box<dyn VolumeReader>> {
    let declaration = loader.declaration();
    let options = declaration.resolve(options, |_| false).map_err(|problems| LoadError::Options {
        loader: declaration.name.clone(),
        problem: problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
    })?;
    Ok(loader.open(path, &options)?)
}

/// What the header says.
struct Facts {
    file: PathBuf,
    loader: String,
    desc: VolumeDesc,
    bounds: Aabb,
    warnings: Vec<String>,
}

type Found = (Values, transfer::Automatic);

impl Facts {
    fn new(file: &Path, loader: &str, desc: &VolumeDesc, warnings: Vec<String>) -> Self {
        let corners = desc.extent().corners().map(|c| desc.placement.transform_point3(c));
        let bounds = corners.iter().fold(Aabb::EMPTY, |b, &c| Aabb::new(b.min.min(c), b.max.max(c)));
        Self { file: file.into(), loader: loader.into(), desc: desc.clone(), bounds, warnings }
    }

    fn rows(&self) -> Vec<(&'static str, String)> {
        let desc = &self.desc;
        let [x, y, z] = desc.dims;
        let mut rows = vec![
            ("file", self.file.display().to_string()),
            ("loader", self.loader.clone()),
            ("dimensions", format!("{x} × {y} × {z}")),
            ("type", format!("{} × {}", desc.components, desc.scalar)),
            ("components", meaning(desc.components).into()),
            ("bytes", size(desc.bytes().unwrap_or(usize::MAX))),
            ("spacing", vector(desc.spacing)),
            ("extent", vector(desc.extent().size())),
            ("world", format!("{} to {}", vector(self.bounds.min), vector(self.bounds.max))),
        ];
        let axes = desc.placement.matrix3;
        if axes != volact::core::glam::DMat3::IDENTITY {
            let names = ["x axis", "y axis", "z axis"];
            rows.extend(names.into_iter().zip([axes.x_axis, axes.y_axis, axes.z_axis]).map(|(n, a)| (n, vector(a))));
        }
        if (desc.slope, desc.intercept) != (1.0, 0.0) {
            rows.push(("value", format!("stored × {} + {}", number(desc.slope), number(desc.intercept))));
        }
        if !desc.unit.is_empty() {
            rows.push(("unit", desc.unit.clone()));
        }
        rows
    }

    fn to_text(&self, found: Option<&Found>, args: &Args) -> String {
        let mut rows = self.rows();
        if let Some((values, automatic)) = found {
            rows.extend(values.rows());
            let (view, _) =
                volact::View::ALL.iter().find(|(_, v)| *v == automatic.view).unwrap_or(&("front", volact::View::Front));
            rows.push(("shown as", format!("{}, from {view}", automatic.shader)));
            rows.extend(automatic.notes.iter().map(|n| ("", n.clone())));
        }
        rows.extend(self.warnings.iter().map(|w| ("warning", w.clone())));
        let mut text = String::new();
        for (name, value) in rows {
            _ = writeln!(text, "{name:<12}{value}");
        }
        if let Some((values, _)) = found {
            text.push_str(&draw_chart(values, args));
        }
        text
    }

    fn to_json(&self, found: Option<&Found>, bins: usize) -> String {
        let desc = &self.desc;
        let placement: Vec<f64> = desc.placement.to_cols_array().to_vec();
        let mut value = json!({
            "file": self.file.display().to_string(),
            "loader": self.loader,
            "dimensions": desc.dims,
            "type": desc.scalar.name(),
            "components": desc.components,
            "meaning": meaning(desc.components),
            "bytes": desc.bytes(),
            "spacing": desc.spacing.to_array(),
            "extent": desc.extent().size().to_array(),
            "world": [self.bounds.min.to_array(), self.bounds.max.to_array()],
            "placement": placement,
            "slope": desc.slope,
            "intercept": desc.intercept,
            "unit": desc.unit,
            "warnings": self.warnings,
        });
        if let (Some((values, automatic)), Value::Object(map)) = (found, &mut value) {
            let percentiles = PERCENTILES.iter().zip(&values.percentiles).map(|(p, v)| (p.to_string(), json!(v)));
            map.insert("range".into(), json!(values.range));
            map.insert("mean".into(), json!(values.mean));
            map.insert("percentiles".into(), Value::Object(percentiles.collect()));
            map.insert("not_finite".into(), json!(values.not_finite));
            map.insert("histogram".into(), json!(values.histogram(bins.clamp(1, 65536))));
            map.insert("notes".into(), json!(automatic.notes));
        }
        format!("{value:#}\n")
    }
}

/// The histogram as text, as wide as the user wants it.
fn draw_chart(values: &Values, args: &Args) -> String {
    let terminal = std::io::stdout().is_terminal();
    let style = if terminal { Style::Blocks } else { Style::Plain };
    let width = args.bins.unwrap_or_else(|| terminal_width(terminal)).clamp(8, 400);
    Chart { counts: &values.histogram(width), range: values.range, log: args.log, style }.draw()
}

fn terminal_width(terminal: bool) -> usize {
    let columns = terminal.then(terminal_size::terminal_size).flatten().map(|(w, _)| usize::from(w.0));
    columns.unwrap_or(80)
}

fn meaning(components: usize) -> &'static str {
    match Components::usual(components) {
        Components::Intensity => "intensity",
        Components::Luminance => "luminance",
        Components::LuminanceAlpha => "luminance, opacity",
        Components::Rgb => "red, green, blue",
        Components::Rgba => "red, green, blue, opacity",
    }
}

/// A number with at most seven digits that matter.
fn number(v: f64) -> String {
    let short = format!("{v:.6e}").parse::<f64>().unwrap_or(v);
    format!("{short}")
}

fn vector(v: DVec3) -> String {
    format!("{}, {}, {}", number(v.x), number(v.y), number(v.z))
}

fn size(bytes: usize) -> String {
    match bytes {
        0..10_000 => format!("{bytes}"),
        _ => format!("{bytes} ({:.1} MiB)", bytes as f64 / 1_048_576.0),
    }
}

#[cfg(test)]
impl Args {
    fn for_tests() -> Self {
        let (loader, load, attribute, bins) = (None, Vec::new(), None, None);
        let file = PathBuf::new();
        Self { file, loader, load, header: false, component: 0, attribute, log: false, bins, json: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact::ScalarType;

    fn desc() -> VolumeDesc {
        let mut desc = VolumeDesc::new([3, 2, 1], ScalarType::U8, 1);
        desc.spacing = DVec3::new(0.5, 1.0, 2.0);
        (desc.slope, desc.unit) = (2.0, "HU".into());
        desc
    }

    fn found() -> Found {
        let volume = Volume::new(desc(), vec![0u8, 1, 2, 3, 4, 100]).unwrap();
        (Values::new(&volume, 0), transfer::automatic(&volume))
    }

    #[test]
    fn json_has_the_facts_in_data_units() {
        let facts = Facts::new(Path::new("a.nrrd"), "nrrd", &desc(), vec!["odd".into()]);
        let value: Value = serde_json::from_str(&facts.to_json(Some(&found()), 4)).unwrap();
        assert_eq!(value["dimensions"], json!([3, 2, 1]));
        assert_eq!(value["range"], json!([0.0, 200.0]));
        assert_eq!(value["percentiles"]["50"], json!(4.0));
        assert_eq!(value["histogram"], json!([5, 0, 0, 1]));
        assert_eq!(value["warnings"], json!(["odd"]));
    }

    #[test]
    fn rows_name_what_is_not_plain() {
        let rows = Facts::new(Path::new("a.nrrd"), "nrrd", &desc(), vec![]).rows();
        let row = |name: &str| rows.iter().find(|(n, _)| *n == name).map(|(_, v)| v.as_str());
        assert_eq!(row("value"), Some("stored × 2 + 0"));
        assert_eq!(row("unit"), Some("HU"));
        assert_eq!(row("extent"), Some("1, 1, 2"));
        assert_eq!(row("x axis"), None);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.4882812, 7.380000114440918, 1e-9].map(number), ["0.4882812", "7.38", "0.000000001"]);
    }
}
