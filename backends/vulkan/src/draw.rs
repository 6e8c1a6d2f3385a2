//! One picture: what is drawn becomes rows of numbers, polygons and a submission.

use std::sync::Arc;

use ash::vk;
use volact_core::{
    ActionError, Compositing, FrameDesc, Viewport, Volume, frame::Rebuild, mutated, resolve::ResolvedShape,
    slicing::Step,
};
use volact_shaders::gpu::{
    Layout, MOST_ROWS, Recipe, compose_slices,
    mesh::Meshes,
    pack::Row,
    runs::{Corner, Polygon, Sliced, Upward, border, corners},
    scene::{self, Item, Key, Limited, Seen},
};

use crate::{
    check::{NAME, limit},
    device::{DeviceError, Gpu},
    memory::{Buffer, Place},
    options::Settings,
    pipeline::{Bound, Cache, Pipeline, Sampler},
    readback::Target,
    resources::{Rows, Volumes},
    stream::Stream,
};

/// Pipelines that are kept.
const MOST: usize = 64;

/// What draws, and what it keeps. The stream is first, so that it is waited for before all else goes.
#[derive(Debug)]
pub struct Drawing {
    stream: Stream,
    pipelines: Vec<((Key, bool), Arc<Pipeline>, Layout)>,
    cache: Cache,
    /// Volumes on the device.
    pub volumes: Volumes,
    /// Meshes, packed.
    pub meshes: Meshes,
    frame: Rows,
    numbers: Rows,
    tables: Rows,
    mesh_rows: Rows,
    limits: Rows,
    limit_rows: Vec<Row>,
    limited: Option<Limited>,
    vertices: Option<Buffer>,
    target: Option<Target>,
    targets: u64,
    sampler: Sampler,
    bound: Option<(Vec<u64>, Bound)>,
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
            meshes: Meshes::default(),
            frame: Rows::new("volact frame", vk::BufferUsageFlags::UNIFORM_BUFFER),
            numbers: Rows::uniform("volact numbers", MOST_ROWS),
            tables: storage("volact tables"),
            mesh_rows: storage("volact meshes"),
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
        (items, surfaces): (Vec<Item<'_>>, &[&ResolvedShape]),
        settings: &Settings,
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<Drawn, ActionError> {
        let sliced = Sliced::new(NAME, (items, &self.meshes), desc, &settings.sampling)?;
        let (items, slicing) = (&sliced.items[..], sliced.slicing(NAME, desc, &settings.sampling)?);
        let groups = sliced.groups(&slicing);
        let step = *slicing.step();
        // Without shapes there is no step, and nothing that needs one.
        let distance = if step.distance > 0.0 { step.distance } else { 1.0 };
        let seen = Seen::new(desc, (items, surfaces), distance)?;
        let held = |volume: &Volume| self.volumes.held(volume);
        let recipes: Vec<Recipe> = items.iter().map(|i| i.recipe(settings.hardware, held)).collect();
        let sweeps = groups.iter().any(|g| g[1] - g[0] > 1);
        let all = (items, &recipes[..], surfaces);
        let (pipeline, layout) = self.pipeline(gpu, all, sweeps, desc, rebuilt)?;
        let mut uploaded = self.set_meshes(gpu)?;
        let held = |volume: &Volume| self.volumes.held(volume);
        let how = (&layout, &seen.anchor);
        let (numbers, tables, numbered) = scene::rows(all, how, &desc.clip, (&[], &self.meshes), held);
        uploaded += self.numbers.set(gpu, numbers)?;
        if self.tables.buffer().is_none() || !mutated!("stale_table") {
            uploaded += self.tables.set(gpu, tables)?;
        }
        uploaded += self.set_limits(gpu, seen.limited(desc))?;
        uploaded += self.frame.set(gpu, seen.rows(desc, settings.termination, desc.opaque.is_some(), numbered))?;
        let border = border(&seen, distance);
        let (vertices, polygons) = corners(&slicing, &groups, border, !surfaces.is_empty(), Upward::No);
        uploaded += self.set_vertices(gpu, &vertices)?;
        self.make_target(gpu, &seen.viewport)?;
        self.bind(items, &pipeline)?;
        self.submit(&pipeline, &seen.viewport, &polygons)?;
        let order = items.iter().map(|i| i.shape.name.clone()).collect();
        Ok(Drawn { shift: seen.shift(), uploaded, order, step, runs: polygons.len() })
    }

    /// Where the picture is read from, and the rows of what was drawn already.
    pub fn target(&self) -> Option<(&Target, &[Row])> {
        Some((self.target.as_ref()?, &self.limit_rows))
    }

    /// Bytes on the device besides volumes and pictures.
    pub fn bytes(&self) -> usize {
        let vertices = self.vertices.as_ref().map_or(0, |v| v.size() as usize);
        let rows = [&self.frame, &self.numbers, &self.tables, &self.mesh_rows, &self.limits];
        rows.map(Rows::bytes).iter().sum::<usize>() + vertices
    }

    /// The pipeline of these shapes, compiled once.
    fn pipeline(
        &mut self,
        gpu: &Arc<Gpu>,
        (items, recipes, surfaces): (&[Item<'_>], &[Recipe], &[&ResolvedShape]),
        together: bool,
        desc: &FrameDesc,
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<(Arc<Pipeline>, Layout), ActionError> {
        let key = Key::new(NAME, (items, surfaces), recipes, &desc.clip)?;
        let crossings = items.iter().any(|i| i.program.compositing() == Compositing::First);
        let sweeps = together || crossings || key.planes;
        let key = (key, sweeps);
        if let Some((_, pipeline, layout)) = self.pipelines.iter().find(|(k, ..)| *k == key) {
            return Ok((Arc::clone(pipeline), layout.clone()));
        }
        let backend = |source| ActionError::Backend { action: NAME.into(), source };
        let most = gpu.limits.max_per_stage_descriptor_sampled_images;
        let images = key.0.shapes.iter().flat_map(|(_, volumes)| volumes).flatten().count();
        if images > most as usize {
            let wanted = format!("at most {most} on adapter {:?}; draw fewer in a frame", gpu.name());
            return Err(limit("number of volumes".into(), images.to_string(), wanted));
        }
        let has = (key.0.planes, key.0.surfaces);
        let composition = compose_slices(recipes, key.0.spans, has, (sweeps, false), gpu.cuts_loops());
        let composition = composition.map_err(|e| backend(Box::new(e)))?;
        let pipeline = Pipeline::new(gpu, &composition, &self.cache).map_err(|e| backend(Box::new(e)))?;
        let (pipeline, layout) = (Arc::new(pipeline), composition.layout);
        if let Err(error) = self.cache.save() {
            log::warn!("{NAME}: the pipeline cache cannot be written: {error}");
        }
        rebuilt.push(Rebuild { shape: NAME.into(), what: "pipeline".into(), bytes: 0 });
        if self.pipelines.len() >= MOST {
            // Nothing is in flight: every frame is waited for. What is bound may be known by an address.
            self.pipelines.clear();
            self.bound = None;
        }
        self.pipelines.push((key, Arc::clone(&pipeline), layout.clone()));
        Ok((pipeline, layout))
    }

    /// The rows of meshes, where they have changed.
    fn set_meshes(&mut self, gpu: &Arc<Gpu>) -> Result<usize, ActionError> {
        let rows = &mut self.mesh_rows;
        self.meshes.lay(|laid| rows.set(gpu, laid))
    }

    /// What the application has drawn, where it has changed.
    fn set_limits(&mut self, gpu: &Arc<Gpu>, wanted: Option<Limited>) -> Result<usize, ActionError> {
        if self.limits.buffer().is_some() && wanted == self.limited {
            return Ok(0);
        }
        self.limit_rows = wanted.as_ref().map_or_else(Vec::new, Limited::rows);
        self.limited = wanted;
        self.limits.set(gpu, self.limit_rows.clone())
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
        let volumes: Vec<_> = items.iter().flat_map(Item::volumes).filter_map(|v| self.volumes.get(v)).collect();
        let rows = [&self.frame, &self.numbers, &self.tables, &self.limits, &self.mesh_rows];
        let Some(target) = &self.target else { return Ok(()) };
        let mut made_of = vec![Arc::as_ptr(pipeline) as u64, target.generation];
        made_of.extend(rows.iter().map(|r| r.generation).chain(volumes.iter().map(|v| v.generation)));
        if self.bound.as_ref().is_some_and(|(b, _)| *b == made_of) {
            return Ok(());
        }
        let [Some(frame), Some(numbers), Some(tables), Some(limits), Some(meshes)] = rows.map(Rows::buffer) else {
            return Ok(());
        };
        let images: Vec<_> = volumes.iter().map(|v| &v.image).collect();
        let buffers = [frame, numbers, tables, limits, &target.light, &target.flags, meshes];
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
