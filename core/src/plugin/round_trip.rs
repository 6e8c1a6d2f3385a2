//! A plugin of this very crate, linked through its entry: every kind once, there and back. Plain code
//! on both sides, so that miri can watch all of the boundary's pointers.

use std::{any::Any, fs, path::Path, sync::Arc};

use glam::DVec3;

use super::{abi, guest::Export, host};
use crate::{
    Aabb, ActionError, Appearance, Attribute, Block, Buffer, Caps, Compositing, Context, Declaration, Frame, FrameDesc,
    Geometry, LoadError, LoadOptions, Loader, Mesh, MeshData, Options, ParameterDecl, ParameterType, ParameterValue,
    Points, Progress, Region, Registry, RenderAction, ScalarType, ShaderEntry, Shape, Tessellation, View, Volume,
    VolumeDesc, VolumeReader, Warning, WarningCode,
    geometry::{CellType, CellTypes, GeometryError},
    lifecycle::Lifecycle,
    loader::{Confidence, Content, NoProgress, Probe},
    parameter::{Kind, ParameterMap},
    registry::RegisterError,
};

static EXPORT: Export = Export::new("trip", "0.2.0", "one of each kind", register);

unsafe extern "C" fn entry(from: *const abi::Host, answer: *mut abi::Answer) -> i32 {
    // SAFETY: as promised by the caller.
    unsafe { EXPORT.enter(from, answer) }
}

fn linked() -> Registry {
    let mut registry = Registry::with_core();
    // SAFETY: the entry is that of an `Export`.
    let loaded = unsafe { host::link(entry, &mut registry) }.unwrap();
    assert_eq!((loaded.name.as_str(), loaded.registered.len()), ("trip", 5));
    registry
}

/// Paints every pixel with the sum of a shape's voxels, through `gain`.
struct Sum {
    lifecycle: Lifecycle,
    gain: f64,
}

fn sum_declaration() -> Declaration {
    Declaration::new(Kind::Action, "sum", "1", "sums voxels")
        .with(ParameterDecl::new("gain", ParameterType::Float, "a factor").default(1.0))
}

impl RenderAction for Sum {
    fn declaration(&self) -> &Declaration {
        unreachable!("the host keeps it")
    }

    fn caps(&self) -> Caps {
        let shaders = Some(vec!["lut".into(), "attribute".into()]);
        Caps { shaders, compositing: vec![Compositing::Over], device: "words".into(), ..Caps::default() }
    }

    fn manage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.manage(shape, |_| Ok(())).map(|_| ())
    }

    fn unmanage(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.unmanage(shape)
    }

    fn begin_draw(&mut self, frame: &FrameDesc) -> Result<(), ActionError> {
        self.lifecycle.context().progress.report("sums", 1, 2);
        self.lifecycle.begin(frame, |_| Ok(())).map(|_| ())
    }

    fn draw(&mut self, shape: &Shape) -> Result<(), ActionError> {
        self.lifecycle.draw(shape)
    }

    fn end_draw(&mut self) -> Result<Frame, ActionError> {
        let open = self.lifecycle.end()?;
        let mut frame = Frame::empty(&open.desc);
        for shape in open.drawn_shapes() {
            let bytes = shape.first_volume().map_or(&[][..], |v| v.volume().data().bytes());
            let numbers = shape.attribute("scalars").map_or(0, Attribute::len);
            let cells = shape.state.geometry.tessellate().map_or(0, |cut| cut.tetrahedra.len());
            let sum = bytes.iter().map(|b| f64::from(*b)).sum::<f64>() + (numbers + cells) as f64;
            frame.color.iter_mut().for_each(|c| c[0] += (self.gain * sum) as f32);
            frame.warnings.extend(shape.warnings.clone());
            frame.warnings.push(Warning::note(WarningCode::SettingAdjusted, &shape.name, "is summed"));
        }
        frame.statistics.details.push(("what".into(), "a sum".into()));
        frame.method.sampling = "none".into();
        Ok(frame)
    }

    fn set_option(&mut self, _: &str, value: ParameterValue) -> Result<(), ActionError> {
        self.gain = value.as_float().unwrap_or(0.0);
        Ok(())
    }
}

/// One tetrahedron, cut by hand.
#[derive(Debug)]
struct Corner(f64);

impl Geometry for Corner {
    fn name(&self) -> &str {
        "corner"
    }

    fn bounds(&self) -> Aabb {
        Aabb::new(DVec3::ZERO, DVec3::splat(self.0))
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        let vertices = Points::from(vec![DVec3::ZERO, DVec3::X * self.0, DVec3::Y * self.0, DVec3::Z * self.0]);
        Ok(Tessellation { vertices, tetrahedra: vec![[0, 1, 2, 3]], ..Tessellation::default() })
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}

struct Format(Declaration, Content);

struct Reader(VolumeDesc);

impl VolumeReader for Reader {
    fn desc(&self) -> &VolumeDesc {
        &self.0
    }

    fn read_region(&mut self, region: Region, progress: &dyn Progress) -> Result<Buffer, LoadError> {
        if !progress.advance(0, 8) {
            return Err(LoadError::Stopped { path: "trip".into() });
        }
        let count: usize = region.dims().iter().product();
        Ok((0..count as u16).collect::<Vec<_>>().into())
    }
}

impl Loader for Format {
    fn declaration(&self) -> &Declaration {
        &self.0
    }

    fn content(&self) -> Content {
        self.1
    }

    fn probe(&self, probe: &Probe<'_>) -> Confidence {
        let ours = probe.head.starts_with(self.0.name.as_bytes());
        if ours { Confidence::Content } else { Confidence::No }
    }

    fn open(&self, path: &Path, _: &LoadOptions) -> Result<Box<dyn VolumeReader>, LoadError> {
        let length = fs::metadata(path).map_err(|e| LoadError::io(path, e))?.len();
        if length > 100 {
            return Err(LoadError::invalid(path, "length", length, "less"));
        }
        Ok(Box::new(Reader(VolumeDesc::new([2; 3], ScalarType::U16, 1))))
    }

    fn read_mesh(&self, _: &Path, _: &LoadOptions, _: &dyn Progress) -> Result<MeshData, LoadError> {
        let points = Points::from(vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]);
        let mesh = Mesh::new(points, CellTypes::All(CellType::Tetrahedron), Buffer::from_vec(vec![0u32, 1, 2, 3]));
        let heat = Attribute::new("heat", ScalarType::F32, 1, Buffer::from_vec(vec![1f32, 2.0, 3.0, 4.0]));
        let warnings = vec![Warning::new(WarningCode::FileContent, "mesh", "is made up")];
        let geometry = Arc::new(mesh.map_err(|e| LoadError::geometry(Path::new("trip"), e))?);
        Ok(MeshData { name: "made".into(), geometry, attributes: heat.into_iter().collect(), warnings })
    }
}

fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    let make = |context: &Context, options: &Options| {
        let gain = options["gain"].as_float().unwrap_or(0.0);
        Ok(Box::new(Sum { lifecycle: Lifecycle::new(context.clone()), gain }) as Box<dyn RenderAction>)
    };
    registry.add_action(sum_declaration(), Arc::new(make))?;
    let edge = ParameterDecl::new("edge", ParameterType::Float, "its edge").required();
    let corner = |p: &ParameterMap| Ok(Arc::new(Corner(p["edge"].as_float().unwrap_or(0.0))) as Arc<dyn Geometry>);
    registry.add_geometry(Declaration::new(Kind::Geometry, "corner", "1", "a corner").with(edge), Arc::new(corner))?;
    let declaration = Declaration::new(Kind::Shader, "tint", "1", "tints");
    registry
        .add_shader_source(ShaderEntry { declaration, compositing: Compositing::Over, source: None }, "fn shade")?;
    let format = |name, content| Arc::new(Format(Declaration::new(Kind::Loader, name, "1", "files"), content));
    registry.add_loader(format("voxels", Content::Volume))?;
    registry.add_loader(format("cells", Content::Mesh))
}

#[test]
fn an_action_draws_blocks_and_foreign_geometries_frame_after_frame() {
    let registry = linked();
    let volume = Volume::new(VolumeDesc::new([2; 3], ScalarType::U8, 1), (1..=8u8).collect::<Vec<_>>()).unwrap();
    let table = crate::LookupTable::window_level(10.0, 5.0, 0.5).unwrap();
    let look = Appearance::new("lut").with("lookup_table", table).with("unit_distance", 1.0);
    let block = Shape::around(&volume, look.clone());
    let corner = registry.geometry("corner", &[("edge".to_owned(), 2.0.into())].into()).unwrap();
    let corner = Shape::build("corner", corner, look.with("volume", &volume), glam::DAffine3::IDENTITY);
    let mut action = registry.action("sum", &Options::new()).unwrap();
    assert_eq!((action.caps().shaders.unwrap().len(), action.caps().device.as_str()), (2, "words"));
    action.manage(&block).unwrap();
    action.manage(&corner).unwrap();
    let desc = FrameDesc::fit(&block, View::Front, 3, 2);
    // A block is five or six tetrahedra, the corner one; each has the volume, whose voxels sum to 36.
    let cells = block.state().geometry.tessellate().unwrap().tetrahedra.len();
    for gain in [1.0, 0.5] {
        action.set_option("gain", gain.into()).unwrap();
        action.begin_draw(&desc).unwrap();
        action.draw(&block).unwrap();
        action.draw(&corner).unwrap();
        let frame = action.end_draw().unwrap();
        assert_eq!(frame.pixel(2, 1)[0], (gain * (72 + cells + 1) as f64) as f32);
        assert_eq!((frame.method.sampling.as_str(), frame.warnings.len()), ("none", 2));
        assert_eq!(frame.statistics.details, [("what".to_owned(), "a sum".to_owned())]);
    }
    block.set_geometry(Block::new(DVec3::ZERO, DVec3::splat(0.5)).unwrap());
    volume.touch();
    action.begin_draw(&desc).unwrap();
    action.draw(&block).unwrap();
    assert!(action.draw(&block).is_err());
    action.end_draw().unwrap();
    action.unmanage(&block).unwrap();
    assert!(action.unmanage(&block).is_err());
}

#[test]
fn loaders_read_volumes_by_regions_and_meshes() {
    let registry = linked();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("file");
    fs::write(&path, "voxels").unwrap();
    let volume = registry.load(&path).unwrap();
    assert_eq!((volume.dims(), volume.value([1, 1, 1], 0)), ([2; 3], 7.0));
    let loader = registry.loaders().iter().find(|l| l.declaration().name == "voxels").unwrap();
    let mut reader = loader.open(&path, &LoadOptions::new()).unwrap();
    let part = reader.read_region(Region { min: [1, 0, 0], max: [1, 1, 1] }, &NoProgress).unwrap();
    drop(reader);
    assert_eq!(part.as_slice::<u16>().unwrap(), [0, 1, 2, 3], "lives longer than its reader");
    fs::write(&path, format!("voxels{}", "!".repeat(100))).unwrap();
    let error = registry.load(&path).unwrap_err();
    assert!(std::error::Error::source(&error).unwrap().to_string().contains("length is 106, wanted less"));

    fs::write(&path, "cells").unwrap();
    let mesh = registry.load_mesh(&path).unwrap();
    assert_eq!((mesh.name.as_str(), mesh.warnings.len()), ("made", 1));
    let heat = mesh.attribute("heat").unwrap().clone();
    let look = Appearance::new("attribute").with("scalars", heat).with("unit_distance", 1.0);
    let look = look.with("lookup_table", crate::LookupTable::window_level(4.0, 2.0, 0.5).unwrap());
    let shape = Shape::build("mesh", mesh.geometry, look, glam::DAffine3::IDENTITY);
    let mut action = registry.action("sum", &Options::new()).unwrap();
    action.manage(&shape).unwrap();
    action.begin_draw(&FrameDesc::fit(&shape, View::Front, 1, 1)).unwrap();
    action.draw(&shape).unwrap();
    assert_eq!(action.end_draw().unwrap().pixel(0, 0)[0], 5.0, "four numbers and one cell");
}
