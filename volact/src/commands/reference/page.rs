//! One page: all that is registered of a kind, as Markdown.

use std::{fmt::Write as _, path::Path};

use volact::{
    Declaration, Options, ParameterDecl, ParameterValue, Registry, ShaderEntry,
    core::{
        loader::{Confidence, Content, Probe},
        parameter::Kind,
    },
};

use super::{Place, scene};
use crate::commands::describe::{allowed, one_line, takes};

/// Extensions that loaders are asked about.
const EXTENSIONS: [&str; 40] = [
    "nrrd", "nhdr", "mha", "mhd", "nii", "nii.gz", "hdr", "img", "dcm", "ima", "tif", "tiff", "png", "vtk", "vti",
    "vtu", "vts", "vtp", "vtr", "pvtu", "raw", "raw.ron", "dat", "bin", "xyz", "x", "g", "p3d", "p3dfmt", "q", "f",
    "ex2", "exo", "e", "obj", "ply", "stl", "mrc", "h5", "nc",
];

/// The page of a kind.
pub fn page(kind: Kind, plural: &str, registry: &Registry, place: &Place) -> String {
    let title = plural[..1].to_uppercase() + &plural[1..];
    let mut text = format!(
        "# {title}\n\n<!-- Written by `volact describe --all --markdown`; what is changed here is lost. -->\n\n{}\n\n",
        about(kind)
    );
    let all = registry.declarations();
    let of_kind: Vec<_> = all.into_iter().filter(|d| d.kind == kind).collect();
    let links: Vec<_> = of_kind.iter().map(|d| format!("[`{0}`](#{0})", d.name)).collect();
    _ = writeln!(text, "{}", links.join(" · "));
    for d in of_kind {
        _ = write!(text, "\n## {}\n\n", d.name);
        if scene(place.folder, d).is_file() {
            let name = format!("{}-{}", d.kind.name(), d.name);
            _ = write!(text, "[![{0}](pictures/{name}.png)](scenes/{name}.ron)\n\n", cell(&one_line(&d.description)));
        }
        _ = write!(text, "{}.\n\n", sentence(&d.description));
        facts(d, registry, place).into_iter().for_each(|fact| _ = writeln!(text, "- {fact}"));
        parameters(&mut text, d);
    }
    text
}

fn about(kind: Kind) -> &'static str {
    match kind {
        Kind::Action => {
            "An action draws scenes. A scene or `--action` names one; else the first preferred one is taken that can \
             draw the scene. All pictures here are of the same scene."
        }
        Kind::Shader => {
            "A shader turns samples into colour and extinction. Shapes name one, with its parameters. Each picture is \
             linked with the scene that it shows."
        }
        Kind::Geometry => {
            "A geometry says where a shape is drawn; these are made by name. Each picture is linked with the scene that \
             it shows."
        }
        Kind::Loader => {
            "A loader reads data files. It is chosen by the file's content, then by its name, or named under `data` in a \
             scene or by `--loader`. Each picture is linked with the scene that it shows, of a small file of the format."
        }
    }
}

/// What there is to say of one besides its parameters.
fn facts(d: &Declaration, registry: &Registry, place: &Place) -> Vec<String> {
    let mut facts = vec![format!("version {}", d.version)];
    if let Some(plugin) = registry.origin(d.kind, &d.name) {
        facts.push(format!("by plugin `{plugin}`"));
    }
    match d.kind {
        Kind::Action => facts.extend(of_action(&d.name, registry)),
        Kind::Shader => {
            facts.extend(registry.shaders().get(&d.name).into_iter().flat_map(|entry| of_shader(entry, place)));
        }
        Kind::Loader => facts.extend(of_loader(&d.name, registry)),
        Kind::Geometry => {}
    }
    facts
}

/// What an action can do, as far as it does not depend on the machine.
fn of_action(name: &str, registry: &Registry) -> Vec<String> {
    let Ok(action) = registry.action(name, &Options::new()) else { return Vec::new() };
    let caps = action.caps();
    let names = |names: &Option<Vec<String>>| match names {
        None => "any".to_owned(),
        Some(names) if names.is_empty() => "none".to_owned(),
        Some(names) => names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", "),
    };
    let others = if caps.sources { "; others by their source" } else { "" };
    let compositing: Vec<_> = caps.compositing.iter().map(|c| c.name()).collect();
    let yes = |can: bool| if can { "yes" } else { "no" };
    vec![
        format!("shaders: {}{others}", names(&caps.shaders)),
        format!("geometries: {}", names(&caps.geometries)),
        format!("compositing: {}", if compositing.is_empty() { "none".into() } else { compositing.join(", ") }),
        format!("overlapping shapes: {}; depth: {}", yes(caps.overlap), yes(caps.depth)),
    ]
}

/// How a shader is composited, its source, and what its header says.
fn of_shader(entry: &ShaderEntry, place: &Place) -> Vec<String> {
    let mut facts = vec![format!("composited by {}", entry.compositing.name())];
    let name = &entry.declaration.name;
    let shipped = volact_shaders::builtin().unwrap_or_default().into_iter().find(|s| s.declaration.name == *name);
    let shipped = shipped.and_then(|entry| entry.source);
    let own = entry.source.as_ref();
    let Some(source) = own.or(shipped.as_ref()) else { return facts };
    let link = match place.sources {
        Some(link) if own.is_none() || own == shipped.as_ref() => format!("[`{name}.wgsl`]({link}/{name}.wgsl)"),
        _ => format!("`{}`", Path::new(&source.file).file_name().unwrap_or_default().to_string_lossy()),
    };
    let how = if own.is_none() { "kernels of the actions' own do what it says" } else { "evaluated" };
    let header: Vec<_> = source.text.lines().map_while(|line| line.trim_start().strip_prefix("//")).collect();
    facts.push(format!("source: {link}, {how}"));
    if !header.is_empty() {
        let lines: Vec<_> = header.iter().map(|line| format!("  {}", line.strip_prefix(' ').unwrap_or(line))).collect();
        let lines: Vec<_> = lines.iter().map(|line| line.trim_end()).collect();
        facts.push(format!("its header:\n\n  ```text\n{}\n  ```", lines.join("\n")));
    }
    facts
}

/// What a loader's files are called and hold.
fn of_loader(name: &str, registry: &Registry) -> Vec<String> {
    let Some(loader) = registry.loaders().iter().find(|l| l.declaration().name == name) else { return Vec::new() };
    let holds = match loader.content() {
        Content::Volume => "volumes",
        Content::Mesh => "meshes or surfaces",
    };
    let known =
        |file: &str| loader.probe(&Probe { path: Path::new(file), head: &[], is_dir: false }) == Confidence::Extension;
    let names: Vec<_> = EXTENSIONS.iter().filter(|e| known(&format!("file.{e}"))).map(|e| format!("`.{e}`")).collect();
    let told = if names.is_empty() { "content".into() } else { format!("content, else {}", names.join(", ")) };
    vec![format!("holds {holds}"), format!("told by {told}")]
}

fn parameters(text: &mut String, d: &Declaration) {
    let what = if matches!(d.kind, Kind::Action | Kind::Loader) { "option" } else { "parameter" };
    if d.parameters.is_empty() {
        _ = write!(text, "\nNo {what}s.\n");
        return;
    }
    _ = write!(text, "\n| {what} | type | | allowed | unit | what it does |\n|---|---|---|---|---|---|\n");
    for p in &d.parameters {
        let row = [takes(p), need(p), allowed(p).unwrap_or_default(), p.unit.clone(), one_line(&p.description)];
        _ = writeln!(text, "| `{}` | {} |", p.name, row.map(|c| cell(&c)).join(" | "));
    }
}

fn need(p: &ParameterDecl) -> String {
    match (&p.default, p.required) {
        (Some(value), _) => format!("default `{}`", written(value)),
        (None, true) => "required".into(),
        (None, false) => "optional".into(),
    }
}

/// A value as a scene has it.
fn written(value: &ParameterValue) -> String {
    let list = |numbers: &[f64]| format!("({})", numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(", "));
    match value {
        ParameterValue::Vec2(v) => list(&v.to_array()),
        ParameterValue::Vec3(v) => list(&v.to_array()),
        ParameterValue::Vec4(v) => list(&v.to_array()),
        ParameterValue::Color(c) => list(c),
        ParameterValue::Float(v) => v.to_string(),
        other => other.to_string(),
    }
}

/// Text that stays in a table's cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

fn sentence(text: &str) -> String {
    let text = one_line(text);
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().collect::<String>()).unwrap_or_default();
    first + letters.as_str()
}
