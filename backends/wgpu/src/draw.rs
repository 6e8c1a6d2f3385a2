//! One picture: what is drawn becomes rows of numbers, bindings and a dispatch.

use std::sync::Arc;

use volact_core::{ActionError, FrameDesc, Viewport, Volume, frame::Rebuild, resolve::ResolvedShape};
use volact_shaders::gpu::{
    Anchor, FrameNumbers, MOST_ROWS, Recipe, WORKGROUP, is_deep,
    mesh::Meshes,
    pack::Row,
    scene::{self, Item, Key, Limited, Seen},
    skip::Cells,
};

use crate::{
    check::NAME,
    device::Gpu,
    onto::{Laying, Onto},
    options::Settings,
    pipeline::{Pipeline, Pipelines},
    readback::Target,
    resources::{Rows, Volumes, too_large},
    skip::Skipping,
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
        (mut items, surfaces): (Vec<Item<'_>>, &[&ResolvedShape]),
        (step, settings, onto): (f64, &Settings, Option<&Onto<'_>>),
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<Drawn, ActionError> {
        // Those composited in depth come first, in an order that does not depend on that of drawing.
        items.sort_by_key(|i| if is_deep(i.program.compositing()) { (0, i.shape.id) } else { (1, 0) });
        let seen = Seen::new(desc, (&items, surfaces), step)?;
        let mut uploaded = self.set_meshes(gpu)?;
        let held = |volume: &Volume| self.volumes.held(volume);
        let recipes: Vec<Recipe> = items.iter().map(|i| i.recipe(settings.hardware, held)).collect();
        let key = Key::new(NAME, (&items, surfaces), &recipes, &desc.clip)?;
        let (pipeline, anew) = self.pipelines.get(gpu, key, &recipes)?;
        if anew {
            rebuilt.push(Rebuild { shape: NAME.into(), what: "pipeline".into(), bytes: 0 });
        }
        let pairs: Vec<_> = items.iter().map(|i| (i.shape, &i.program)).collect();
        let cells = if settings.skipping { self.skipping.cells(&pairs) } else { vec![None; items.len()] };
        let how = (&pipeline.layout, &seen.anchor);
        let all = (&items[..], &recipes[..], surfaces);
        let (numbers, tables, surfaces) = scene::rows(all, how, &desc.clip, (&cells, &self.meshes), held);
        uploaded += self.numbers.set(gpu, numbers)? + self.tables.set(gpu, tables)?;
        let depth = onto.and_then(|onto| onto.depth);
        match depth {
            Some(_) => self.reserve_limits(gpu, &seen.viewport)?,
            None => uploaded += self.upload_limits(gpu, seen.limited(desc))?,
        }
        let limited = desc.opaque.is_some() || depth.is_some();
        uploaded += self.frame.set(gpu, seen.rows(desc, settings.termination, limited, surfaces))?;
        self.make_target(gpu, &seen.viewport)?;
        self.skipping.buffer(gpu, &cells)?;
        self.find_empty(gpu, &items, &cells, &pipeline, rebuilt)?;
        self.bind(gpu, &items, &pipeline)?;
        self.dispatch(gpu, &pipeline, (&seen.anchor, &seen.viewport), onto)?;
        let order = items.iter().map(|i| i.shape.name.clone()).collect();
        Ok(Drawn { shift: seen.shift(), uploaded, order })
    }

    /// Where the picture is read from, once one was submitted.
    pub fn target(&self) -> Option<&Target> {
        self.target.as_ref()
    }

    /// Bytes on the device besides volumes and pictures.
    pub fn bytes(&self) -> usize {
        let rows = [&self.frame, &self.numbers, &self.tables, &self.mesh_rows, &self.limits];
        rows.map(Rows::bytes).iter().sum::<usize>() + self.skipping.bytes()
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
        let Some(rows) = self.meshes.rows() else { return Ok(0) };
        let set = self.mesh_rows.set(gpu, rows);
        if set.is_err() {
            self.meshes.forget();
        }
        set
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

    fn make_target(&mut self, gpu: &Gpu, viewport: &Viewport) -> Result<(), ActionError> {
        let count = viewport.width * viewport.height;
        if 16 * count as u64 > gpu.limits.max_storage_buffer_binding_size {
            return Err(too_large("the picture", 16 * count as u64, gpu.limits.max_storage_buffer_binding_size));
        }
        if self.target.as_ref().is_none_or(|t| t.room() < count) {
            self.target = None;
            self.targets += 1;
            self.target = Some(Target::new(gpu, count, self.targets));
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
        let mut made_of = vec![pipeline.generation, target.generation, self.skipping.generation];
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
        let buffers = rows.iter().filter_map(|r| r.buffer()).chain([
            &target.pixels,
            &target.depths,
            &target.flags,
            empties,
            meshes,
        ]);
        let frame: Vec<_> = buffers.map(wgpu::Buffer::as_entire_binding).collect();
        let views = volumes.iter().map(|v| wgpu::BindingResource::TextureView(&v.view));
        let views: Vec<_> = std::iter::once(wgpu::BindingResource::Sampler(sampler)).chain(views).collect();
        let groups = [group(gpu, &pipeline.groups[0], frame), group(gpu, &pipeline.groups[1], views)];
        gpu.check()?;
        self.bound = Some(Bound { made_of, groups });
        Ok(())
    }

    fn dispatch(
        &mut self,
        gpu: &Gpu,
        pipeline: &Pipeline,
        (anchor, viewport): (&Anchor, &Viewport),
        onto: Option<&Onto<'_>>,
    ) -> Result<(), ActionError> {
        let (Some(target), Some(bound)) = (&self.target, &self.bound) else { return Ok(()) };
        let (Some(frame), Some(limits)) = (self.frame.buffer(), self.limits.buffer()) else { return Ok(()) };
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: None });
        encoder.clear_buffer(&target.flags, 0, None);
        if let Some(depth) = onto.and_then(|onto| onto.depth) {
            self.laying.limit(gpu, &mut encoder, (frame, limits), &depth, (anchor, viewport))?;
        }
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some("volact rays"),
                timestamp_writes: target.timestamps(),
            });
            pass.set_pipeline(&pipeline.pipeline);
            bound.groups.iter().zip(0..).for_each(|(group, i)| pass.set_bind_group(i, group, &[]));
            let groups = |n: usize| (n as u32).div_ceil(WORKGROUP);
            pass.dispatch_workgroups(groups(viewport.width), groups(viewport.height), 1);
        }
        match onto {
            Some(onto) => {
                self.laying.lay(gpu, &mut encoder, (frame, &target.pixels), onto, viewport)?;
                target.copy(&mut encoder, 0);
            }
            None => target.copy(&mut encoder, viewport.width * viewport.height),
        }
        gpu.queue.submit([encoder.finish()]);
        Ok(gpu.check()?)
    }
}

/// Binds resources in the order of their bindings.
pub fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, resources: Vec<wgpu::BindingResource<'_>>) -> wgpu::BindGroup {
    let numbered = (0..).zip(resources);
    let entries: Vec<_> = numbered.map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource }).collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
