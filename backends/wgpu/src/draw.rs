//! One picture: what is drawn becomes rows of numbers, bindings and submissions, one for each band of rows.

use std::sync::Arc;

use volact_core::{
    ActionError, FrameDesc, Viewport, Volume, frame::Rebuild, mutated, resolve::ResolvedShape, slicing::Step,
};
use volact_shaders::gpu::{
    Anchor, FrameNumbers, MOST_ROWS, Recipe, WORKGROUP,
    mesh::Meshes,
    pack::Row,
    scene::{self, Item, Key, Limited, Seen},
    skip::Cells,
};

use crate::{
    NAME,
    bands::{self, Band, bands},
    device::Gpu,
    onto::{Laying, Onto},
    options::Settings,
    pipeline::{Pipeline, Pipelines, Stages},
    plan::{self, Planned},
    readback::Target,
    resources::{Rows, Volumes, too_large},
    skip::Skipping,
    slabs::{Groups, Slabs},
};

/// What draws, and what it keeps.
#[derive(Debug)]
pub struct Drawing {
    pipelines: Pipelines,
    /// Volumes on the device.
    pub volumes: Volumes,
    /// Meshes, packed.
    pub meshes: Meshes,
    frame: Rows,
    numbers: Rows,
    tables: Rows,
    mesh_rows: Rows,
    limits: Rows,
    limited: Option<Limited>,
    skipping: Skipping,
    laying: Laying,
    slabs: Slabs,
    target: Option<Target>,
    targets: u64,
    sampler: Option<wgpu::Sampler>,
    bound: Option<Bound>,
}

/// Bind groups, and what they were made of.
#[derive(Debug)]
struct Bound {
    made_of: Vec<u64>,
    groups: [wgpu::BindGroup; 2],
    /// For what finishes slabs.
    finish: Option<[wgpu::BindGroup; 2]>,
}

/// A picture on its way.
#[derive(Debug)]
pub struct Drawn {
    /// From where depths are counted on the device.
    pub shift: f64,
    /// Bytes moved to the device.
    pub uploaded: usize,
    /// Shapes in the order of the module.
    pub order: Vec<String>,
    /// World distance between samples.
    pub step: f64,
    /// Planes, and draws of them, where it is made of slices.
    pub planes: Option<(Step, usize)>,
    /// Submissions that it is made by.
    pub bands: usize,
}

impl Default for Drawing {
    fn default() -> Self {
        Self {
            pipelines: Pipelines::default(),
            volumes: Volumes::default(),
            meshes: Meshes::default(),
            frame: Rows::uniform("volact frame", size_of::<FrameNumbers>() / size_of::<Row>()),
            numbers: Rows::uniform("volact numbers", MOST_ROWS),
            tables: Rows::storage("volact tables"),
            mesh_rows: Rows::storage("volact meshes"),
            limits: Rows::storage("volact limits"),
            limited: None,
            skipping: Skipping::default(),
            laying: Laying::default(),
            slabs: Slabs::default(),
            target: None,
            targets: 0,
            sampler: None,
            bound: None,
        }
    }
}

impl Drawing {
    /// Has the device draw.
    ///
    /// # Errors
    /// If the scene needs more than the device has, or the device fails.
    pub fn submit(
        &mut self,
        gpu: &Gpu,
        desc: &FrameDesc,
        (items, surfaces): (Vec<Item<'_>>, &[&ResolvedShape]),
        (settings, onto): (&Settings, Option<&Onto<'_>>),
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<Drawn, ActionError> {
        let mut uploaded = self.set_meshes(gpu)?;
        let planned = Planned::new(desc, (items, &self.meshes), settings)?;
        let (items, lattice) = (planned.items(), planned.lattice(desc, settings)?);
        let seen = Seen::new(desc, (items, surfaces), lattice.step)?;
        let held = |volume: &Volume| self.volumes.held(volume);
        let recipes: Vec<Recipe> = items.iter().map(|i| i.recipe(settings.hardware, held)).collect();
        let key = (Key::new(NAME, (items, surfaces), &recipes, &desc.clip)?, lattice.stage(items));
        let (pipeline, anew) = self.pipelines.get(gpu, key, &recipes)?;
        if anew {
            rebuilt.push(Rebuild { shape: NAME.into(), what: "pipeline".into(), bytes: 0 });
        }
        let pairs: Vec<_> = items.iter().map(|i| (i.shape, &i.program)).collect();
        let cells = if settings.skipping { self.skipping.cells(&pairs) } else { vec![None; items.len()] };
        let how = (&pipeline.layout, &seen.anchor);
        let all = (items, &recipes[..], surfaces);
        let (numbers, tables, numbered) = scene::rows(all, how, &desc.clip, (&cells, &self.meshes), held);
        uploaded += self.numbers.set(gpu, numbers)?;
        if self.tables.buffer().is_none() || !mutated!("stale_table") {
            uploaded += self.tables.set(gpu, tables)?;
        }
        let depth = onto.and_then(|onto| onto.depth);
        match depth {
            Some(_) => self.reserve_limits(gpu, &seen.viewport)?,
            None => uploaded += self.upload_limits(gpu, seen.limited(desc))?,
        }
        let rows = seen.rows(desc, settings.termination, desc.opaque.is_some() || depth.is_some(), numbered);
        uploaded += self.frame.set(gpu, rows.clone())?;
        let height = bands::height(&seen.viewport, plan::samples(items, lattice.step), settings.submission);
        self.make_target(gpu, &seen.viewport, height)?;
        if let Some((corners, polygons)) = lattice.corners(&seen, !surfaces.is_empty()) {
            uploaded += self.slabs.set(gpu, corners, polygons)?;
            self.slabs.reserve(gpu, height * seen.viewport.width, &seen.viewport)?;
        }
        self.skipping.buffer(gpu, &cells)?;
        self.find_empty(gpu, items, &cells, &pipeline, rebuilt)?;
        self.bind(gpu, items, &pipeline)?;
        let bands: Vec<Band> = bands(&seen.viewport, height).collect();
        uploaded += self.draw_bands(gpu, &pipeline, (&seen.anchor, &seen.viewport), (rows, &bands), onto)?;
        let order = items.iter().map(|i| i.shape.name.clone()).collect();
        let planes = lattice.planes.map(|step| (step, self.slabs.runs()));
        Ok(Drawn { shift: seen.shift(), uploaded, order, step: lattice.step, planes, bands: bands.len() })
    }

    /// Where the picture is read from, once one was submitted.
    pub fn target(&self) -> Option<&Target> {
        self.target.as_ref()
    }

    /// Bytes on the device besides volumes and pictures.
    pub fn bytes(&self) -> usize {
        let rows = [&self.frame, &self.numbers, &self.tables, &self.mesh_rows, &self.limits].map(Rows::bytes);
        rows.iter().sum::<usize>() + self.skipping.bytes() + self.slabs.bytes()
    }

    fn find_empty(
        &mut self,
        gpu: &Gpu,
        items: &[Item<'_>],
        cells: &[Option<Cells>],
        pipeline: &Pipeline,
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<(), ActionError> {
        let rows = [&self.frame, &self.numbers, &self.tables].map(Rows::buffer);
        let [Some(frame), Some(numbers), Some(tables)] = rows else { return Ok(()) };
        let items: Vec<_> = items.iter().zip(cells).map(|(i, cells)| (i.shape, &i.program, *cells)).collect();
        let there = (&self.volumes, &pipeline.layout, [frame, numbers, tables]);
        self.skipping.find(gpu, &items, there, rebuilt)
    }

    /// The rows of meshes, where they have changed.
    fn set_meshes(&mut self, gpu: &Gpu) -> Result<usize, ActionError> {
        let rows = &mut self.mesh_rows;
        self.meshes.lay(|laid| rows.set(gpu, laid))
    }

    /// What the application has drawn, where it has changed.
    fn upload_limits(&mut self, gpu: &Gpu, wanted: Option<Limited>) -> Result<usize, ActionError> {
        if self.limits.buffer().is_some() && (wanted.is_none() || wanted == self.limited) {
            return Ok(0);
        }
        let rows = wanted.as_ref().map_or_else(|| vec![[0; 4]], Limited::rows);
        self.limited = wanted;
        self.limits.set(gpu, rows)
    }

    /// Room for limits that the device finds itself.
    fn reserve_limits(&mut self, gpu: &Gpu, viewport: &Viewport) -> Result<(), ActionError> {
        self.limited = None;
        self.limits.reserve(gpu, 2 * viewport.width * viewport.height)
    }

    fn make_target(&mut self, gpu: &Gpu, viewport: &Viewport, height: usize) -> Result<(), ActionError> {
        let (room, count) = (viewport.width * height, viewport.width * viewport.height);
        let (wanted, most) = (16 * room as u64, gpu.limits.max_storage_buffer_binding_size);
        if wanted > most {
            return Err(too_large("the picture", wanted, most));
        }
        if self.target.as_ref().is_none_or(|t| !t.holds(room, count)) {
            self.target = None;
            self.targets += 1;
            self.target = Some(Target::new(gpu, (room, count), self.targets));
            gpu.check()?;
        }
        Ok(())
    }

    /// Makes bind groups where anything that they bind is another.
    fn bind(&mut self, gpu: &Gpu, items: &[Item<'_>], pipeline: &Arc<Pipeline>) -> Result<(), ActionError> {
        let Some(target) = &self.target else { return Ok(()) };
        let volumes: Vec<_> = items.iter().flat_map(Item::volumes).filter_map(|v| self.volumes.get(v)).collect();
        let rows = [&self.frame, &self.numbers, &self.tables, &self.limits];
        let (Some(empties), Some(meshes)) = (self.skipping.held(), self.mesh_rows.buffer()) else { return Ok(()) };
        let generations = [pipeline.generation, target.generation, self.skipping.generation, self.slabs.generation];
        let mut made_of = generations.to_vec();
        made_of.push(self.mesh_rows.generation);
        made_of.extend(rows.iter().map(|r| r.generation).chain(volumes.iter().map(|v| v.generation)));
        if self.bound.as_ref().is_some_and(|b| b.made_of == made_of) {
            return Ok(());
        }
        let sampler = self.sampler.get_or_insert_with(|| {
            gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("volact volumes"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            })
        });
        let frame = |picture| {
            let buffers = rows.iter().filter_map(|r| r.buffer());
            let buffers = buffers.chain([picture, &target.depths, &target.flags, empties, meshes]);
            buffers.map(wgpu::Buffer::as_entire_binding).collect::<Vec<_>>()
        };
        let slabs = matches!(pipeline.stages, Stages::Slabs(_));
        let picture = self.slabs.light().filter(|_| slabs).unwrap_or(&target.pixels);
        let views = volumes.iter().map(|v| wgpu::BindingResource::TextureView(&v.view));
        let views: Vec<_> = std::iter::once(wgpu::BindingResource::Sampler(sampler)).chain(views).collect();
        let groups = [group(gpu, &pipeline.groups[0], frame(picture)), group(gpu, &pipeline.groups[1], views)];
        let finish = if slabs { self.slabs.bind(gpu, frame(&target.pixels)) } else { None };
        gpu.check()?;
        self.bound = Some(Bound { made_of, groups, finish });
        Ok(())
    }

    /// Draws band after band, and has it copied or laid; gives the bytes that were moved.
    fn draw_bands(
        &mut self,
        gpu: &Gpu,
        pipeline: &Pipeline,
        (anchor, viewport): (&Anchor, &Viewport),
        (mut rows, bands): (Vec<Row>, &[Band]),
        onto: Option<&Onto<'_>>,
    ) -> Result<usize, ActionError> {
        let mut uploaded = 0;
        for (number, band) in bands.iter().enumerate() {
            let (first, last) = (number == 0, number + 1 == bands.len());
            if !first && let [numbers, ..] = bytemuck::cast_slice_mut::<Row, FrameNumbers>(&mut rows) {
                numbers.first_row = band.first as u32;
                uploaded += self.frame.set(gpu, rows.clone())?;
            }
            let (Some(frame), Some(limits)) = (self.frame.buffer(), self.limits.buffer()) else { break };
            let Some(target) = &self.target else { break };
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: None });
            if first {
                encoder.clear_buffer(&target.flags, 0, None);
            }
            if let Some(depth) = onto.and_then(|onto| onto.depth).filter(|_| first) {
                self.laying.limit(gpu, &mut encoder, (frame, limits), &depth, (anchor, viewport))?;
            }
            self.encode(&mut encoder, pipeline, (viewport, *band), (first, last));
            match onto {
                Some(onto) => {
                    self.laying.lay(gpu, &mut encoder, (frame, &target.pixels), onto, (viewport, *band))?;
                }
                None => target.copy_band(&mut encoder, viewport, *band),
            }
            if last {
                let count = if onto.is_some() { 0 } else { viewport.width * viewport.height };
                target.copy_counts(&mut encoder, count);
            }
            gpu.queue.submit([encoder.finish()]);
            gpu.check()?;
        }
        Ok(uploaded)
    }

    fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &Pipeline,
        (viewport, band): (&Viewport, Band),
        (first, last): (bool, bool),
    ) {
        let (Some(target), Some(bound)) = (&self.target, &self.bound) else { return };
        let times = target.times(first, last);
        match (&pipeline.stages, &bound.finish) {
            (Stages::Slabs(pipeline), Some(finish)) => {
                let groups = Groups { runs: &bound.groups, finish };
                self.slabs.encode(encoder, pipeline, groups, (viewport, band), times);
            }
            (Stages::Slabs(_), None) => {}
            (Stages::Rays(pipeline), _) => {
                let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("volact rays"),
                    timestamp_writes: times.compute(true, true),
                });
                pass.set_pipeline(pipeline);
                bound.groups.iter().zip(0..).for_each(|(group, i)| pass.set_bind_group(i, group, &[]));
                let groups = |n: usize| (n as u32).div_ceil(WORKGROUP);
                pass.dispatch_workgroups(groups(viewport.width), groups(band.rows), 1);
            }
        }
    }
}

/// Binds resources in the order of their bindings.
pub fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, resources: Vec<wgpu::BindingResource<'_>>) -> wgpu::BindGroup {
    let numbered = (0..).zip(resources);
    let entries: Vec<_> = numbered.map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
