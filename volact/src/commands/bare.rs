//! Bare data: a volume, mesh or surface without a scene, drawn with a look that suits it.

use std::{path::Path, sync::Arc};

use anyhow::{Context as _, bail, ensure};
use volact::{
    Appearance, Data, LookupTable, MeshData, ParameterDecl, Registry, Shape, SliceStyle, Sliced, Slices, Volume,
    VolumeTexture,
    config::Config,
    core::{
        Compositing,
        glam::DVec3,
        planner::Goals,
        scene::{DataSpec, KeptData, ParameterSpec, Scene},
    },
    transfer,
};

use super::{
    cuts,
    progress::Line,
    settings::{self, Size},
    source::Args,
};

/// Reads the data and chooses how to show them; what was chosen, in words.
pub fn open(
    args: &Args,
    registry: &Registry,
    config: &Config,
    kept: &mut KeptData,
) -> anyhow::Result<(Scene, Vec<String>)> {
    let Size([width, height]) = args.size.unwrap_or(Size(config.size));
    let up = args.up.unwrap_or(DVec3::Z);
    let (shape, frame, notes) = match load(args, registry, kept)? {
        Data::Volume(volume) => {
            ensure!(args.attribute.is_none(), "--attribute is for meshes; {} holds a volume", args.input.display());
            let automatic = transfer::automatic(&volume);
            let (shape, notes) = volume_shape(args, &volume, &automatic, registry);
            (shape, automatic.frame_upright(up, args.view, width, height), notes)
        }
        Data::Mesh(data) => {
            let automatic = transfer::automatic_mesh(&data, args.attribute.as_deref())
                .with_context(|| format!("{}: cannot be drawn", args.input.display()))?;
            let (shape, notes) = mesh_shape(args, &data, &automatic);
            (shape, automatic.frame_upright(up, args.view, width, height), notes)
        }
    };
    change(args, &shape, registry)?;
    slice(args, &shape)?;
    let frame = frame.with_background(args.background.unwrap_or(config.background));
    Ok((Scene { shapes: vec![shape], frame, action: None, goals: Goals::default() }, notes))
}

fn load(args: &Args, registry: &Registry, kept: &mut KeptData) -> anyhow::Result<Data> {
    let options = settings::options(&args.load)?.into_iter();
    let options = options.map(|(name, value)| (name, ParameterSpec::Value(value))).collect();
    let spec = DataSpec { file: args.input.clone(), loader: args.loader.clone(), options, ..Default::default() };
    let line = Line::new(format!("reading {}", args.input.display()));
    let cannot = || format!("{}: cannot be drawn", args.input.display());
    kept.load(registry, &args.input, &spec, &line).with_context(cannot)
}

fn volume_shape(
    args: &Args,
    volume: &Volume,
    automatic: &transfer::Automatic,
    registry: &Registry,
) -> (Shape, Vec<String>) {
    let (appearance, notes) = match &args.shader {
        Some(shader) if *shader != automatic.shader => own_look(shader, volume, automatic, registry),
        _ => (automatic.appearance(), automatic.notes.clone()),
    };
    let texture: VolumeTexture = automatic.texture(volume);
    (Shape::around_texture(&texture, appearance), notes)
}

/// A shader of the user's choice: one that looks into a volume gets the table that suits it, one that
/// makes one value of each ray shows the volume's own range in grey.
fn own_look(
    shader: &str,
    volume: &Volume,
    automatic: &transfer::Automatic,
    registry: &Registry,
) -> (Appearance, Vec<String>) {
    let appearance = Appearance::new(shader);
    let Some(entry) = registry.shaders().get(shader).filter(|s| s.declaration.parameter("lookup_table").is_some())
    else {
        return (appearance, Vec::new());
    };
    if let (Compositing::Over, Some(table)) = (entry.compositing, &automatic.table) {
        return (appearance.with("lookup_table", table.clone()), automatic.notes.clone());
    }
    let range = volume.value_range().unwrap_or([0.0, 1.0]);
    (appearance.with("lookup_table", LookupTable::grey(range)), vec![format!("grey from {} to {}", range[0], range[1])])
}

/// A shader of the user's choice gets the same attribute and table.
fn mesh_shape(args: &Args, data: &MeshData, automatic: &transfer::AutomaticMesh) -> (Shape, Vec<String>) {
    let shape = automatic.shape(data);
    if let Some(shader) = &args.shader {
        shape.set_shader(shader);
    }
    let mut notes = automatic.notes.clone();
    let others: Vec<_> = data.attributes.iter().map(|a| a.name.as_str()).collect();
    if args.attribute.is_none() && others.len() > 1 {
        notes.push(format!("--attribute NAME shows another of {}", others.join(", ")));
    }
    (shape, notes)
}

/// Changes the parameters as `--set` says.
fn change(args: &Args, shape: &Shape, registry: &Registry) -> anyhow::Result<()> {
    for setting in &args.set {
        let (_, parameter) = settings::shape_of(&setting.name, &[shape.name().to_owned()])?;
        let shader = shape.state().shader;
        let declared: Option<&ParameterDecl> =
            registry.shaders().get(&shader).and_then(|s| s.declaration.parameter(parameter));
        let value = setting.value.to_value(declared, Path::new(""));
        shape.set_parameter(parameter, value.with_context(|| format!("parameter {parameter:?}"))?);
    }
    Ok(())
}

/// Draws the shape on planes as `--slice` says.
fn slice(args: &Args, shape: &Shape) -> anyhow::Result<()> {
    if args.slice.is_empty() {
        return Ok(());
    }
    let state = shape.state();
    if state.geometry.as_surface().is_some() {
        bail!("--slice is for volumes and meshes; {} holds a surface", args.input.display());
    }
    let (bounds, to_object) = (state.world_bounds(), state.transform.inverse());
    let planes: Result<Vec<_>, _> =
        args.slice.iter().map(|slice| cuts::to_object(slice.plane(&bounds)?, &to_object)).collect();
    let slices = Slices { planes: planes?, style: SliceStyle::Opaque, volume: args.around_slices };
    shape.set_geometry(Sliced::new(Arc::clone(&state.geometry), slices)?);
    Ok(())
}
