//! One picture: what is drawn becomes rows of numbers, bindings and a dispatch.

use std::sync::Arc;

use volact_core::{
    Aabb, ActionError, FrameDesc, Opaque, ParameterType, ParameterValue, RayGrid, Viewport,
    frame::{FrameError, Rebuild},
    glam::DVec3,
    resolve::ResolvedShape,
    volume::Filter,
};
use volact_shaders::{
    Program,
    gpu::{
        Anchor, FrameNumbers, MOST_ROWS, Recipe, VolumeUse, WORKGROUP, is_deep,
        pack::{self, Row},
        skip::Cells,
        table,
        voxels::Units,
    },
    signatures::kind_of,
};

use crate::{
    check::{NAME, SPANS},
    device::Gpu,
    onto::{Laying, Onto},
    options::Settings,
    pipeline::{Key, Pipeline, Pipelines},
    readback::Target,
    resources::{Rows, Volumes, too_large},
    skip::Skipping,
};

/// The least rows of a table, so that one a little longer needs no other place.
const LEAST_ROWS: usize = 64;

/// What draws, and what it keeps.
#[derive(Debug)]
pub struct Drawing {
    pipelines: Pipelines,
    /// Volumes on the device.
    pub volumes: Volumes,
    frame: Rows,
    numbers: Rows,
    tables: Rows,
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
            frame: Rows::uniform("volact frame", size_of::<FrameNumbers>() / size_of::<Row>()),
            numbers: Rows::uniform("volact numbers", MOST_ROWS),
            tables: Rows::storage("volact tables"),
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
        mut items: Vec<Item<'_>>,
        (step, settings, onto): (f64, &Settings, Option<&Onto<'_>>),
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<Drawn, ActionError> {
        // Those composited in depth come first, in an order that does not depend on that of drawing.
        items.sort_by_key(|i| if is_deep(i.program.compositing()) { (0, i.shape.id) } else { (1, 0) });
        let viewport = desc.viewport();
        let grid = desc.camera.rays(&viewport).map_err(FrameError::from)?;
        let bounds = items.iter().fold(Aabb::EMPTY, |b, i| b.union(&i.shape.world_block()));
        let bounds = if bounds.is_empty() { Aabb::new(DVec3::ZERO, DVec3::ZERO) } else { bounds };
        let anchor = Anchor::new(&grid, &viewport, &bounds, step);
        let recipes: Vec<Recipe> = items.iter().map(|i| self.recipe(i, settings)).collect();
        let key = key(&items, &recipes, desc)?;
        let (pipeline, anew) = self.pipelines.get(gpu, key, &recipes)?;
        if anew {
            rebuilt.push(Rebuild { shape: NAME.into(), what: "pipeline".into(), bytes: 0 });
        }
        let pairs: Vec<_> = items.iter().map(|i| (i.shape, &i.program)).collect();
        let cells = if settings.skipping { self.skipping.cells(&pairs) } else { vec![None; items.len()] };
        let mut uploaded = self.upload_shapes(gpu, desc, &items, (&recipes, &pipeline, &anchor, &cells))?;
        let depth = onto.and_then(|onto| onto.depth);
        match depth {
            Some(_) => self.reserve_limits(gpu, &viewport)?,
            None => uploaded += self.upload_limits(gpu, desc, &grid, &anchor)?,
        }
        let numbers = FrameNumbers {
            limited: u32::from(desc.opaque.is_some() || depth.is_some()),
            threshold: desc.depth_threshold,
            termination: settings.termination as f32,
            ..anchor.numbers()
        };
        let rows: &[Row] = bytemuck::cast_slice(std::slice::from_ref(&numbers));
        uploaded += self.frame.set(gpu, rows.to_vec())?;
        self.make_target(gpu, &viewport)?;
        self.skipping.buffer(gpu, &cells)?;
        self.find_empty(gpu, &items, &cells, &pipeline, rebuilt)?;
        self.bind(gpu, &items, &pipeline)?;
        self.dispatch(gpu, &pipeline, (&anchor, &viewport), onto)?;
        let order = items.iter().map(|i| i.shape.name.clone()).collect();
        Ok(Drawn { shift: anchor.t - anchor.depth_zero, uploaded, order })
    }

    /// Where the picture is read from, once one was submitted.
    pub fn target(&self) -> Option<&Target> {
        self.target.as_ref()
    }

    /// Bytes on the device besides volumes and pictures.
    pub fn bytes(&self) -> usize {
        self.frame.bytes() + self.numbers.bytes() + self.tables.bytes() + self.limits.bytes() + self.skipping.bytes()
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

    /// Numbers and tables of all shapes.
    fn upload_shapes(
        &mut self,
        gpu: &Gpu,
        desc: &FrameDesc,
        items: &[Item<'_>],
        (recipes, pipeline, anchor, cells): (&[Recipe], &Pipeline, &Anchor, &[Option<Cells>]),
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
        let shapes: Vec<_> = (0..items.len())
            .map(|number| pack::Shape {
                shape: items[number].shape,
                recipe: &recipes[number],
                number,
                units: &units[number],
                tables: &places[number],
                cells: cells[number],
            })
            .collect();
        let numbers = pack::write(&pipeline.layout, anchor, &desc.clip, &shapes);
        Ok(self.numbers.set(gpu, numbers)? + self.tables.set(gpu, tables)?)
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

    fn units(&self, item: &Item<'_>) -> Vec<Option<Units>> {
        let of = |name: &str| self.volumes.get(item.shape.volume(name)?.volume()).map(|held| held.encoding.units);
        item.program.declaration().parameters.iter().map(|p| of(&p.name)).collect()
    }

    /// What the application has drawn, where it has changed.
    fn upload_limits(
        &mut self,
        gpu: &Gpu,
        desc: &FrameDesc,
        grid: &RayGrid,
        anchor: &Anchor,
    ) -> Result<usize, ActionError> {
        let viewport = desc.viewport();
        let wanted =
            desc.opaque.clone().map(|opaque| Limited { opaque, rays: grid.clone(), viewport, anchor: anchor.t });
        if self.limits.buffer().is_some() && (wanted.is_none() || wanted == self.limited) {
            return Ok(0);
        }
        let rows = match &desc.opaque {
            None => vec![[0; 4]],
            Some(opaque) => {
                let limits = opaque.limits(grid, &viewport, desc.width);
                let row = |(i, t): (usize, f64)| {
                    let (x, y) = (i % viewport.width, i / viewport.width);
                    let color = opaque.color_at((viewport.y + y) * desc.width + viewport.x + x);
                    pack::limit(color, t - anchor.t)
                };
                limits.into_iter().enumerate().flat_map(row).collect()
            }
        };
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
        let volumes = items.iter().flat_map(|i| {
            let parameters = i.program.declaration().parameters.iter();
            parameters.filter_map(|p| match i.shape.parameters.get(&p.name) {
                Some(ParameterValue::Volume(texture)) => self.volumes.get(texture.volume()),
                _ => None,
            })
        });
        let volumes: Vec<_> = volumes.collect();
        let rows = [&self.frame, &self.numbers, &self.tables, &self.limits];
        let Some(empties) = self.skipping.held() else { return Ok(()) };
        let mut made_of = vec![pipeline.generation, target.generation, self.skipping.generation];
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
        let buffers =
            rows.iter().filter_map(|r| r.buffer()).chain([&target.pixels, &target.depths, &target.flags, empties]);
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

/// What the pipeline depends on.
fn key(items: &[Item<'_>], recipes: &[Recipe], desc: &FrameDesc) -> Result<Key, ActionError> {
    let address = |item: &Item<'_>| Arc::as_ptr(&item.shape.shader) as usize;
    let shapes = items.iter().zip(recipes).map(|(i, r)| (address(i), r.volumes.clone())).collect();
    let most = items.iter().max_by_key(|i| pack::spans(i.shape, &desc.clip));
    let spans = most.map_or(1, |i| pack::spans(i.shape, &desc.clip));
    if let Some(item) = most.filter(|_| spans > SPANS) {
        return Err(ActionError::Limit {
            action: NAME.into(),
            what: format!("number of clips that cut away from shape {:?}", item.shape.name),
            found: (spans - 1).to_string(),
            wanted: format!("at most {}; draw it with the action cpu", SPANS - 1),
        });
    }
    let planes = items.iter().any(|i| i.shape.state.geometry.slices().is_some());
    // Few sizes, so that a clip more rarely needs another pipeline.
    let spans = if spans > 1 { spans.next_power_of_two().max(4) } else { 1 };
    Ok(Key { shapes, spans, planes })
}
