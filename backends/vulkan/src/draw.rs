//! One picture: what is drawn becomes rows of numbers, polygons and a submission.

use std::sync::Arc;

use ash::vk;
use volact_core::{
    Aabb, ActionError, FrameDesc, Opaque, ParameterType, ParameterValue, RayGrid, Viewport,
    frame::{FrameError, Rebuild},
    glam::DVec3,
    resolve::ResolvedShape,
    slicing::{Sampling, Slicing, Solid, Step},
    volume::Filter,
};
use volact_shaders::{
    Program,
    gpu::{
        Anchor, FrameNumbers, Layout, MOST_ROWS, Recipe, VolumeUse, compose_slices,
        pack::{self, Row},
        table,
        voxels::Units,
    },
    signatures::kind_of,
};

use crate::{
    check::{self, NAME, SPANS, limit},
    device::{DeviceError, Gpu},
    memory::{Buffer, Place},
    options::Settings,
    pipeline::{Bound, Cache, Pipeline, Sampler},
    readback::Target,
    resources::{Rows, Volumes},
    runs::{Corner, corners},
    stream::{Polygon, Stream},
};

/// The least rows of a table, so that one a little longer needs no other place.
const LEAST_ROWS: usize = 64;

/// What draws, and what it keeps. The stream is first, so that it is waited for before all else goes.
#[derive(Debug)]
pub struct Drawing {
    stream: Stream,
    pipelines: Vec<(Key, Arc<Pipeline>, Layout)>,
    cache: Cache,
    /// Volumes on the device.
    pub volumes: Volumes,
    frame: Rows,
    numbers: Rows,
    tables: Rows,
    limits: Rows,
    limit_rows: Vec<Row>,
    limited: Option<Limited>,
    vertices: Option<Buffer>,
    target: Option<Target>,
    targets: u64,
    sampler: Sampler,
    bound: Option<(Vec<u64>, Bound)>,
}

/// What a pipeline depends on: shaders by their address, how volumes are read, and stretches of a ray.
#[derive(Clone, Debug, PartialEq)]
struct Key {
    shapes: Vec<(usize, Vec<Option<VolumeUse>>)>,
    spans: u32,
}

/// What the rows of limits were made of.
#[derive(Debug, PartialEq)]
struct Limited {
    opaque: Opaque,
    rays: RayGrid,
    viewport: Viewport,
    anchor: f64,
}

/// A shape to be drawn, with its shader.
#[derive(Debug)]
pub struct Item<'a> {
    /// The shape.
    pub shape: &'a ResolvedShape,
    /// Its shader.
    pub program: Program,
}

/// A picture that is done.
#[derive(Debug)]
pub struct Drawn {
    /// From where depths are counted on the device.
    pub shift: f64,
    /// Bytes moved to the device.
    pub uploaded: usize,
    /// Shapes in the order of the module.
    pub order: Vec<String>,
    /// How far planes are apart.
    pub step: Step,
    /// Draws of runs.
    pub runs: usize,
}

/// Where a frame is seen from, and where it is counted from.
struct Place3 {
    grid: RayGrid,
    viewport: Viewport,
    anchor: Anchor,
}

impl Drawing {
    /// Nothing drawn yet.
    ///
    /// # Errors
    /// If the device gives no more.
    pub fn new(gpu: &Arc<Gpu>, settings: &Settings) -> Result<Self, DeviceError> {
        let storage = |what| Rows::new(what, vk::BufferUsageFlags::STORAGE_BUFFER);
        Ok(Self {
            stream: Stream::new(gpu, gpu.queue)?,
            pipelines: Vec::new(),
            cache: Cache::new(gpu, settings.cache.clone())?,
            volumes: Volumes::new(gpu)?,
            frame: Rows::new("volact frame", vk::BufferUsageFlags::UNIFORM_BUFFER),
            numbers: Rows::uniform("volact numbers", MOST_ROWS),
            tables: storage("volact tables"),
            limits: storage("volact limits"),
            limit_rows: Vec::new(),
            limited: None,
            vertices: None,
            target: None,
            targets: 0,
            sampler: Sampler::new(gpu)?,
            bound: None,
        })
    }

    /// Has the device draw, and waits for it.
    ///
    /// # Errors
    /// If the scene needs more than the device has, or the device fails.
    pub fn draw(
        &mut self,
        gpu: &Arc<Gpu>,
        desc: &FrameDesc,
        mut items: Vec<Item<'_>>,
        settings: &Settings,
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<Drawn, ActionError> {
        // An order that does not depend on that of drawing.
        items.sort_by_key(|i| i.shape.id);
        let solids = solids(&mut items)?;
        let slicing = plan(&solids, desc, &settings.sampling)?;
        let step = *slicing.step();
        // Without shapes there is no step, and nothing that needs one.
        let distance = if step.distance > 0.0 { step.distance } else { 1.0 };
        let place = place(desc, &items, distance)?;
        let recipes: Vec<Recipe> = items.iter().map(|i| self.recipe(i, settings)).collect();
        let (pipeline, layout) = self.pipeline(gpu, &items, &recipes, desc, rebuilt)?;
        let mut uploaded = self.set_shapes(gpu, desc, &items, &recipes, (&layout, &place.anchor))?;
        uploaded += self.set_limits(gpu, desc, &place)?;
        uploaded += self.set_frame(gpu, desc, settings, &place.anchor)?;
        let (base, rest) = border(&place, distance);
        let (vertices, polygons) = corners(&slicing, base, rest);
        uploaded += self.set_vertices(gpu, &vertices)?;
        self.make_target(gpu, &place.viewport)?;
        self.bind(&items, &pipeline)?;
        self.submit(&pipeline, &place.viewport, &polygons)?;
        let order = items.iter().map(|i| i.shape.name.clone()).collect();
        Ok(Drawn { shift: place.anchor.t - place.anchor.depth_zero, uploaded, order, step, runs: polygons.len() })
    }

    /// Where the picture is read from, and the rows of what was drawn already.
    pub fn target(&self) -> Option<(&Target, &[Row])> {
        Some((self.target.as_ref()?, &self.limit_rows))
    }

    /// Bytes on the device besides volumes and pictures.
    pub fn bytes(&self) -> usize {
        let vertices = self.vertices.as_ref().map_or(0, |v| v.size() as usize);
        self.frame.bytes() + self.numbers.bytes() + self.tables.bytes() + self.limits.bytes() + vertices
    }

    fn recipe(&self, item: &Item<'_>, settings: &Settings) -> Recipe {
        let volume = |name: &str| {
            let texture = item.shape.volume(name)?;
            let held = self.volumes.get(texture.volume())?;
            Some(VolumeUse {
                channels: held.encoding.channels as u32,
                nearest: texture.filter() == Filter::Nearest,
                hardware: settings.hardware && held.filterable,
            })
        };
        let volumes = item.program.declaration().parameters.iter().map(|p| volume(&p.name)).collect();
        Recipe { program: item.program.clone(), volumes }
    }

    /// The pipeline of these shapes, compiled once.
    fn pipeline(
        &mut self,
        gpu: &Arc<Gpu>,
        items: &[Item<'_>],
        recipes: &[Recipe],
        desc: &FrameDesc,
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<(Arc<Pipeline>, Layout), ActionError> {
        let key = key(items, recipes, desc)?;
        if let Some((_, pipeline, layout)) = self.pipelines.iter().find(|(k, ..)| *k == key) {
            return Ok((Arc::clone(pipeline), layout.clone()));
        }
        let backend = |source| ActionError::Backend { action: NAME.into(), source };
        let most = gpu.limits.max_per_stage_descriptor_sampled_images;
        let images = key.shapes.iter().flat_map(|(_, volumes)| volumes).flatten().count();
        if images > most as usize {
            let wanted = format!("at most {most} on adapter {:?}; draw fewer in a frame", gpu.name());
            return Err(limit("number of volumes".into(), images.to_string(), wanted));
        }
        let composition = compose_slices(recipes, key.spans).map_err(|e| backend(Box::new(e)))?;
        let pipeline = Pipeline::new(gpu, &composition, &self.cache).map_err(|e| backend(Box::new(e)))?;
        let (pipeline, layout) = (Arc::new(pipeline), composition.layout);
        if let Err(error) = self.cache.save() {
            log::warn!("{NAME}: the pipeline cache cannot be written: {error}");
        }
        rebuilt.push(Rebuild { shape: NAME.into(), what: "pipeline".into(), bytes: 0 });
        self.pipelines.push((key, Arc::clone(&pipeline), layout.clone()));
        Ok((pipeline, layout))
    }

    /// Numbers and tables of all shapes.
    fn set_shapes(
        &mut self,
        gpu: &Arc<Gpu>,
        desc: &FrameDesc,
        items: &[Item<'_>],
        recipes: &[Recipe],
        (layout, anchor): (&Layout, &Anchor),
    ) -> Result<usize, ActionError> {
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
        let units: Vec<_> = items.iter().map(|i| self.units(i)).collect();
        let shape = |number: usize| pack::Shape {
            shape: items[number].shape,
            recipe: &recipes[number],
            number,
            units: &units[number],
            tables: &places[number],
            cells: None,
        };
        let shapes: Vec<_> = (0..items.len()).map(shape).collect();
        let numbers = pack::write(layout, anchor, &desc.clip, &shapes);
        Ok(self.numbers.set(gpu, numbers)? + self.tables.set(gpu, tables)?)
    }

    fn units(&self, item: &Item<'_>) -> Vec<Option<Units>> {
        let of = |name: &str| self.volumes.get(item.shape.volume(name)?.volume()).map(|held| held.encoding.units);
        item.program.declaration().parameters.iter().map(|p| of(&p.name)).collect()
    }

    /// What the application has drawn, where it has changed.
    fn set_limits(&mut self, gpu: &Arc<Gpu>, desc: &FrameDesc, place: &Place3) -> Result<usize, ActionError> {
        let (rays, viewport, anchor) = (place.grid.clone(), place.viewport, place.anchor.t);
        let wanted = desc.opaque.clone().map(|opaque| Limited { opaque, rays, viewport, anchor });
        if self.limits.buffer().is_some() && wanted == self.limited {
            return Ok(0);
        }
        self.limit_rows = match &desc.opaque {
            None => Vec::new(),
            Some(opaque) => {
                let limits = opaque.limits(&place.grid, &viewport, desc.width);
                let row = |(i, t): (usize, f64)| {
                    let (x, y) = (i % viewport.width, i / viewport.width);
                    let color = opaque.color_at((viewport.y + y) * desc.width + viewport.x + x);
                    pack::limit(color, t - anchor)
                };
                limits.into_iter().enumerate().flat_map(row).collect()
            }
        };
        self.limited = wanted;
        self.limits.set(gpu, self.limit_rows.clone())
    }

    fn set_frame(
        &mut self,
        gpu: &Arc<Gpu>,
        desc: &FrameDesc,
        settings: &Settings,
        anchor: &Anchor,
    ) -> Result<usize, ActionError> {
        let numbers = FrameNumbers {
            limited: u32::from(desc.opaque.is_some()),
            threshold: desc.depth_threshold,
            termination: settings.termination as f32,
            ..anchor.numbers()
        };
        let rows: &[Row] = bytemuck::cast_slice(std::slice::from_ref(&numbers));
        self.frame.set(gpu, rows.to_vec())
    }

    fn set_vertices(&mut self, gpu: &Arc<Gpu>, corners: &[Corner]) -> Result<usize, ActionError> {
        let bytes: &[u8] = bytemuck::cast_slice(corners);
        let wanted = bytes.len() as u64;
        if self.vertices.as_ref().is_none_or(|b| b.size() < wanted) {
            self.vertices = None;
            let (room, usage) = (wanted.next_power_of_two(), vk::BufferUsageFlags::VERTEX_BUFFER);
            self.vertices = Some(Buffer::new(gpu, "volact corners", room, usage, Place::Upload)?);
        }
        if let Some(buffer) = &mut self.vertices {
            buffer.write(0, bytes);
        }
        Ok(bytes.len())
    }

    fn make_target(&mut self, gpu: &Arc<Gpu>, viewport: &Viewport) -> Result<(), ActionError> {
        let count = viewport.width * viewport.height;
        let most = gpu.limits.max_framebuffer_width.min(gpu.limits.max_framebuffer_height) as usize;
        if viewport.width.max(viewport.height) > most {
            let found = format!("{} × {} pixels", viewport.width, viewport.height);
            let wanted = format!("at most {most} along an edge on adapter {:?}", gpu.name());
            return Err(limit("size of the picture".into(), found, wanted));
        }
        if self.target.as_ref().is_none_or(|t| t.len() < count) {
            self.target = None;
            self.targets += 1;
            self.target = Some(Target::new(gpu, count, self.targets)?);
        }
        Ok(())
    }

    /// Binds anew where anything that is bound is another.
    fn bind(&mut self, items: &[Item<'_>], pipeline: &Arc<Pipeline>) -> Result<(), ActionError> {
        let volumes = items.iter().flat_map(|i| {
            i.program.declaration().parameters.iter().filter_map(|p| match i.shape.parameters.get(&p.name) {
                Some(ParameterValue::Volume(texture)) => self.volumes.get(texture.volume()),
                _ => None,
            })
        });
        let volumes: Vec<_> = volumes.collect();
        let rows = [&self.frame, &self.numbers, &self.tables, &self.limits];
        let Some(target) = &self.target else { return Ok(()) };
        let mut made_of = vec![Arc::as_ptr(pipeline) as u64, target.generation];
        made_of.extend(rows.iter().map(|r| r.generation).chain(volumes.iter().map(|v| v.generation)));
        if self.bound.as_ref().is_some_and(|(b, _)| *b == made_of) {
            return Ok(());
        }
        let [Some(frame), Some(numbers), Some(tables), Some(limits)] = rows.map(Rows::buffer) else { return Ok(()) };
        let images: Vec<_> = volumes.iter().map(|v| &v.image).collect();
        let buffers = [frame, numbers, tables, limits, &target.light, &target.flags];
        self.bound = Some((made_of, pipeline.bind(buffers, &self.sampler, &images)?));
        Ok(())
    }

    fn submit(&mut self, pipeline: &Pipeline, viewport: &Viewport, runs: &[Polygon]) -> Result<(), DeviceError> {
        let (Some(target), Some((_, bound)), Some(vertices)) = (&self.target, &self.bound, &self.vertices) else {
            return Ok(());
        };
        let (count, size) = (viewport.width * viewport.height, [viewport.width as u32, viewport.height as u32]);
        self.stream.submit(self.volumes.arrived(), |record| {
            target.clear(record, count);
            record.draw(pipeline, bound, vertices, size, runs);
            target.copy(record, count);
        })?;
        self.stream.wait()
    }
}

/// What is sliced; items of which nothing is there are left out.
fn solids(items: &mut Vec<Item<'_>>) -> Result<Vec<Solid>, ActionError> {
    let mut made = Vec::with_capacity(items.len());
    let mut kept = Vec::with_capacity(items.len());
    for item in items.drain(..) {
        if let Some(solid) = Solid::new(item.shape, None)? {
            made.push(solid);
            kept.push(item);
        }
    }
    *items = kept;
    Ok(made)
}

fn plan<'a>(solids: &'a [Solid], desc: &FrameDesc, sampling: &Sampling) -> Result<Slicing<'a>, ActionError> {
    Slicing::new(solids.iter().collect(), desc, sampling).map_err(check::sliced)
}

fn place(desc: &FrameDesc, items: &[Item<'_>], step: f64) -> Result<Place3, ActionError> {
    let viewport = desc.viewport();
    let grid = desc.camera.rays(&viewport).map_err(FrameError::from)?;
    let bounds = items.iter().fold(Aabb::EMPTY, |b, i| b.union(&i.shape.world_block()));
    let bounds = if bounds.is_empty() { Aabb::new(DVec3::ZERO, DVec3::ZERO) } else { bounds };
    let anchor = Anchor::new(&grid, &viewport, &bounds, step);
    Ok(Place3 { grid, viewport, anchor })
}

/// The slab from which slabs are counted on the device, and its level seen from the anchor.
fn border(place: &Place3, step: f64) -> (i64, f64) {
    let linear = place.grid.linear();
    let level = linear.axis.dot(place.anchor.point - linear.eye.unwrap_or(DVec3::ZERO));
    let base = 32.0 * (level / (32.0 * step)).round();
    (base as i64, base * step - level)
}

/// What the pipeline depends on.
fn key(items: &[Item<'_>], recipes: &[Recipe], desc: &FrameDesc) -> Result<Key, ActionError> {
    let address = |item: &Item<'_>| Arc::as_ptr(&item.shape.shader) as usize;
    let shapes = items.iter().zip(recipes).map(|(i, r)| (address(i), r.volumes.clone())).collect();
    let most = items.iter().max_by_key(|i| pack::spans(i.shape, &desc.clip));
    let spans = most.map_or(1, |i| pack::spans(i.shape, &desc.clip));
    if let Some(item) = most.filter(|_| spans > SPANS) {
        let what = format!("number of clips that cut away from shape {:?}", item.shape.name);
        return Err(limit(
            what,
            (spans - 1).to_string(),
            format!("at most {}; draw it with the action cpu", SPANS - 1),
        ));
    }
    // Few sizes, so that a clip more rarely needs another pipeline.
    Ok(Key { shapes, spans: if spans > 1 { spans.next_power_of_two().max(4) } else { 1 } })
}
