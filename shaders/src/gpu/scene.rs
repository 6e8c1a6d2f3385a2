//! The shapes of a frame as any GPU action draws them: what a pipeline depends on, and the rows of
//! numbers and tables.

use std::sync::Arc;

use thiserror::Error;
use volact_core::{
    Aabb, ActionError, Clip, FrameDesc, Opaque, ParameterDecl, ParameterType, ParameterValue, RayGrid,
    TableInterpolation, Viewport, Volume,
    frame::FrameError,
    glam::DVec3,
    resolve::ResolvedShape,
    volume::{Filter, VolumeTexture},
};

use super::{
    Anchor, FrameNumbers, Layout, Recipe, VolumeUse,
    mesh::{Meshes, carries, is_mesh, surface},
    pack::{self, Row},
    skip::Cells,
    table,
    voxels::Encoding,
};
use crate::{Program, blunt, eval::LOOP_BUDGET, signatures::kind_of};

/// The most stretches that clips may leave of a ray.
pub const SPANS: u32 = 16;

/// The shader for which tables apply before interpolation, too.
const LUT: &str = include_str!("../../wgsl/lut.wgsl");

/// The least rows of a table, so that one a little longer needs no other place.
const LEAST_ROWS: usize = 64;

/// A shape to be drawn, with its shader.
#[derive(Debug)]
pub struct Item<'a> {
    /// The shape.
    pub shape: &'a ResolvedShape,
    /// Its shader.
    pub program: Program,
}

impl<'a> Item<'a> {
    /// For each declared parameter its volume, where it has one.
    fn textures(&self) -> impl Iterator<Item = Option<&'a VolumeTexture>> {
        let shape = self.shape;
        self.program.declaration().parameters.iter().map(move |p| shape.volume(&p.name))
    }

    /// Its volumes in the order of the declaration.
    pub fn volumes(&self) -> impl Iterator<Item = &'a Volume> {
        self.textures().flatten().map(VolumeTexture::volume)
    }

    /// What of it a module depends on. `held` says how a volume is encoded on the device, and whether the
    /// device's sampler may interpolate it; `hardware` that it is wanted to.
    pub fn recipe(&self, hardware: bool, held: impl Fn(&Volume) -> Option<(Encoding, bool)>) -> Recipe {
        let volume = |texture: &VolumeTexture| {
            let (encoding, filterable) = held(texture.volume())?;
            Some(VolumeUse {
                channels: encoding.channels as u32,
                nearest: texture.filter() == Filter::Nearest,
                hardware: hardware && filterable,
            })
        };
        let volumes = self.textures().map(|texture| texture.and_then(volume)).collect();
        let (mesh, carries) = (is_mesh(self.shape), carries(self.shape));
        Recipe { program: self.program.clone(), volumes, mesh, carries, pre: pre(self.shape) }
    }
}

/// Rows of numbers, and of tables, of all shapes that are drawn with a layout from an anchor. `cells`
/// are those that can be skipped, `meshes` are placed. Behind them are surfaces, whose numbers come last.
pub fn rows(
    (items, recipes, surfaces): (&[Item<'_>], &[Recipe], &[&ResolvedShape]),
    (layout, anchor): (&Layout, &Anchor),
    clip: &Clip,
    (cells, meshes): (&[Option<Cells>], &Meshes),
    held: impl Fn(&Volume) -> Option<(Encoding, bool)>,
) -> (Vec<Row>, Vec<Row>, [u32; 2]) {
    let mut tables: Vec<Row> = Vec::new();
    let mut places: Vec<Vec<u32>> = Vec::new();
    for item in items {
        let place = |p| {
            if kind_of(p) != Some(ParameterType::Table) {
                return 0;
            }
            let base = tables.len();
            tables.extend(table::rows(&pack::points(item.shape, &p.name)));
            tables.resize(base + (tables.len() - base).next_power_of_two().max(LEAST_ROWS), [0; 4]);
            base as u32
        };
        places.push(item.program.declaration().parameters.iter().map(place).collect());
    }
    let units = |t: Option<&VolumeTexture>| t.and_then(|t| held(t.volume())).map(|(encoding, _)| encoding.units);
    let units: Vec<Vec<_>> = items.iter().map(|item| item.textures().map(units).collect()).collect();
    let attribute = |item: &Item<'_>, name: &str| meshes.attribute(item.shape, name).unwrap_or_default();
    let attributes = |item: &Item<'_>| {
        item.program.declaration().parameters.iter().map(|p| attribute(item, &p.name)).collect::<Vec<_>>()
    };
    let attributes: Vec<_> = items.iter().map(attributes).collect();
    let shape = |number: usize| pack::Shape {
        shape: items[number].shape,
        recipe: &recipes[number],
        number,
        units: &units[number],
        tables: &places[number],
        cells: cells.get(number).copied().flatten(),
        mesh: meshes.placed(items[number].shape),
        attributes: &attributes[number],
    };
    let shapes: Vec<_> = (0..items.len()).map(shape).collect();
    let mut rows = pack::write(layout, anchor, clip, &shapes);
    let surfaces = surface::write(&mut rows, surfaces, anchor, clip, meshes);
    (rows, tables, surfaces)
}

/// The declared volume and table of a shape whose table applies at the voxels, before interpolation: of the
/// shader `lut`, as it comes with Volact.
fn pre(shape: &ResolvedShape) -> Option<[usize; 2]> {
    let before = |p: &ParameterDecl| shape.table(&p.name).is_some_and(|t| t.interpolation() == TableInterpolation::Pre);
    let own = shape.shader.source.as_ref().is_none_or(|s| s.text == LUT);
    let declaration = &shape.shader.declaration;
    let table = declaration.parameters.iter().position(before).filter(|_| declaration.name == "lut" && own)?;
    let volume = declaration.parameters.iter().position(|p| kind_of(p) == Some(ParameterType::Volume))?;
    Some([volume, table])
}

/// What of a shape actions on GPUs cannot draw, and the cure: what does not go with its shader's source, detail
/// that single precision has no digits for, and a table before interpolation where nobody can do that.
pub fn unfit(shape: &ResolvedShape) -> Option<(String, String)> {
    early(shape).or_else(|| crate::unfit(shape)).or_else(|| blunt(shape))
}

fn early(shape: &ResolvedShape) -> Option<(String, String)> {
    let before =
        |v: &ParameterValue| matches!(v, ParameterValue::Table(t) if t.interpolation() == TableInterpolation::Pre);
    let (name, _) = shape.parameters.iter().find(|(_, v)| before(v)).filter(|_| pre(shape).is_none())?;
    let cure = "let it apply after interpolation, or use the shader lut";
    Some((format!("the pre-interpolated table {name:?}"), cure.into()))
}

/// What a pipeline depends on.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Key {
    /// For each shape its shader, by address, and how its volumes are read.
    pub shapes: Vec<(usize, Vec<Option<VolumeUse>>)>,
    /// The stretches that clips may leave.
    pub spans: u32,
    /// Whether a shape has slice planes.
    pub planes: bool,
    /// For each shape whether it is a mesh, whether that carries numbers, and whether its table applies at the
    /// voxels.
    pub kinds: Vec<[bool; 3]>,
    /// Whether there are surfaces.
    pub surfaces: bool,
}

impl Key {
    /// What the pipeline of shapes and surfaces depends on; `action` is whose errors are told.
    ///
    /// # Errors
    /// If more clips cut away from a shape than a pipeline can hold.
    pub fn new(
        action: &str,
        (items, surfaces): (&[Item<'_>], &[&ResolvedShape]),
        recipes: &[Recipe],
        clip: &Clip,
    ) -> Result<Self, ActionError> {
        let address = |item: &Item<'_>| Arc::as_ptr(&item.shape.shader) as usize;
        let shapes = items.iter().zip(recipes).map(|(i, r)| (address(i), r.volumes.clone())).collect();
        let all = items.iter().map(|i| i.shape).chain(surfaces.iter().copied());
        let most = all.max_by_key(|s| pack::spans(s, clip));
        let spans = most.map_or(1, |s| pack::spans(s, clip));
        if let Some(shape) = most.filter(|_| spans > SPANS) {
            return Err(ActionError::Limit {
                action: action.into(),
                what: format!("number of clips that cut away from shape {:?}", shape.name),
                found: (spans - 1).to_string(),
                wanted: format!("at most {}; draw it with the action cpu", SPANS - 1),
            });
        }
        let planes = items.iter().any(|i| i.shape.state.geometry.slices().is_some());
        // Few sizes, so that a clip more rarely needs another pipeline.
        let spans = if spans > 1 { spans.next_power_of_two().max(4) } else { 1 };
        let kinds = recipes.iter().map(|r| [r.mesh, r.carries, r.pre.is_some()]).collect();
        Ok(Self { shapes, spans, planes, kinds, surfaces: !surfaces.is_empty() })
    }
}

/// Where a frame is seen from, and where it is counted from.
#[derive(Debug)]
pub struct Seen {
    /// The rays.
    pub grid: RayGrid,
    /// The pixels that they belong to.
    pub viewport: Viewport,
    /// Where numbers are small.
    pub anchor: Anchor,
}

impl Seen {
    /// A frame of shapes and surfaces, with a world distance between samples.
    ///
    /// # Errors
    /// If the camera is wrong.
    pub fn new(
        desc: &FrameDesc,
        (items, surfaces): (&[Item<'_>], &[&ResolvedShape]),
        step: f64,
    ) -> Result<Self, FrameError> {
        let viewport = desc.viewport();
        let grid = desc.camera.rays(&viewport)?;
        let all = items.iter().map(|i| i.shape).chain(surfaces.iter().copied());
        let bounds = all.fold(Aabb::EMPTY, |b, s| b.union(&s.world_block()));
        let bounds = if bounds.is_empty() { Aabb::new(DVec3::ZERO, DVec3::ZERO) } else { bounds };
        let anchor = Anchor::new(&grid, &viewport, &bounds, step);
        Ok(Self { grid, viewport, anchor })
    }

    /// What depths on the device lack.
    pub fn shift(&self) -> f64 {
        self.anchor.t - self.anchor.depth_zero
    }

    /// The rows of the frame; `limited` tells that something was drawn already, and `surfaces` are numbers of
    /// surfaces, as [`rows`] gives them.
    pub fn rows(&self, desc: &FrameDesc, termination: f64, limited: bool, surfaces: [u32; 2]) -> Vec<Row> {
        let numbers = FrameNumbers {
            surfaces,
            limited: u32::from(limited),
            threshold: desc.depth_threshold,
            termination: termination as f32,
            ..self.anchor.numbers()
        };
        bytemuck::cast_slice(std::slice::from_ref(&numbers)).to_vec()
    }

    /// What the rows of limits are made of; `None` where nothing was drawn already.
    pub fn limited(&self, desc: &FrameDesc) -> Option<Limited> {
        let (rays, viewport, anchor) = (self.grid.clone(), self.viewport, self.anchor.t);
        desc.opaque.clone().map(|opaque| Limited { opaque, rays, viewport, width: desc.width, anchor })
    }
}

/// What an application has drawn already, as rays meet it.
#[derive(Debug, PartialEq)]
pub struct Limited {
    opaque: Opaque,
    rays: RayGrid,
    viewport: Viewport,
    /// Columns of the whole picture.
    width: usize,
    anchor: f64,
}

impl Limited {
    /// Its rows, two a pixel of the viewport.
    pub fn rows(&self) -> Vec<Row> {
        let (viewport, limits) = (&self.viewport, self.opaque.limits(&self.rays, &self.viewport, self.width));
        let row = |(i, t): (usize, f64)| {
            let (x, y) = (i % viewport.width, i / viewport.width);
            let color = self.opaque.color_at((viewport.y + y) * self.width + viewport.x + x);
            pack::limit(color, t - self.anchor)
        };
        limits.into_iter().enumerate().flat_map(row).collect()
    }
}

/// A shader's loop went on for too long.
#[derive(Clone, Debug, Error)]
#[error("shader {shader:?}: a sample took more than {rounds} rounds of loops")]
struct Overrun {
    shader: String,
    rounds: u32,
}

/// The error of a shape, by its name, whose shader's loops overran their budget, among those drawn;
/// `watched` as of [`compose`](super::compose).
pub fn overrun(name: Option<&String>, drawn: &[&ResolvedShape], watched: bool) -> ActionError {
    let shape = name.cloned().unwrap_or_default();
    let shader = drawn.iter().find(|s| s.name == shape).map(|s| s.shader.declaration.name.clone());
    let rounds = if watched { LOOP_BUDGET / 2 } else { LOOP_BUDGET };
    ActionError::Shader { shape, source: Box::new(Overrun { shader: shader.unwrap_or_default(), rounds }) }
}

/// The error of a shape, by its name, whose cells carry numbers and overlap.
pub fn overlapping(action: &str, name: Option<&String>) -> ActionError {
    ActionError::Unsupported {
        action: action.into(),
        shape: name.cloned().unwrap_or_default(),
        what: "a mesh whose cells carry numbers and overlap".into(),
        cure: "mend the mesh, or draw it with the action cpu".into(),
    }
}

/// The error of an adapter that has cut a loop of the framework short.
pub fn cut_short(action: &str, adapter: &str, step: f64) -> ActionError {
    ActionError::Limit {
        action: action.into(),
        what: "number of rounds of loops along a ray".into(),
        found: format!("more than 65535 with a sample_distance of {step:?}"),
        wanted: format!("fewer on adapter {adapter:?}; take a larger sample_distance, or cpu"),
    }
}

/// Whether an adapter ends loops after 65,535 rounds of all loops of an invocation together and says
/// nothing of it, as llvmpipe does (`LP_MAX_TGSI_LOOP_ITERATIONS`).
pub fn cuts_loops(adapter: &str) -> bool {
    adapter.starts_with("llvmpipe")
}
