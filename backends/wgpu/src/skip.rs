//! Finds on the device where nothing can be seen: bounds of values once for each volume, and what is
//! empty again whenever a table changes, so that such a change moves the table and nothing else.

use std::collections::BTreeMap;

use volact_core::{ActionError, VolumeTexture, frame::Rebuild, resolve::ResolvedShape};
use volact_shaders::{
    Program,
    gpu::{
        ComposeError, Layout,
        pack::{self, Row},
        skip::{Cells, WORKGROUP, count, module, transparent_with},
        table,
    },
};

use crate::{
    NAME,
    device::Gpu,
    resources::{Held, Volumes},
};

/// What is skipped, and what it was found from.
#[derive(Debug, Default)]
pub struct Skipping {
    passes: Option<Passes>,
    /// By volume and component.
    bounds: BTreeMap<(u64, u32), Bounds>,
    /// By shape: what its program says.
    known: BTreeMap<u64, (ResolvedShape, Option<[usize; 2]>)>,
    empties: Option<wgpu::Buffer>,
    scratch: Option<[wgpu::Buffer; 2]>,
    /// What the cells were found for.
    found: Vec<Found>,
    /// Changes with the buffer of cells.
    pub generation: u64,
}

#[derive(Debug)]
struct Passes {
    groups: [wgpu::BindGroupLayout; 2],
    bounds: wgpu::ComputePipeline,
    empty: wgpu::ComputePipeline,
    spread: wgpu::ComputePipeline,
}

#[derive(Debug)]
struct Bounds {
    buffer: wgpu::Buffer,
    made_of: [u64; 2],
}

/// A shape's cells, and what they depend on.
#[derive(Clone, Debug, PartialEq)]
struct Found {
    cells: Cells,
    volume: (u64, u32),
    made_of: [u64; 2],
    units: [u64; 2],
    table: Vec<Row>,
}

/// One pass over the cells, with the numbers that it reads (`VolactCells`).
struct Pass<'a> {
    pipeline: &'a wgpu::ComputePipeline,
    numbers: [u32; 8],
    from: &'a wgpu::Buffer,
    to: &'a wgpu::Buffer,
}

impl Skipping {
    /// Which cells each shape has.
    pub fn cells(&mut self, items: &[(&ResolvedShape, &Program)]) -> Vec<Option<Cells>> {
        self.known.retain(|id, _| items.iter().any(|(shape, _)| shape.id == *id));
        let mut base = 0;
        let mut place = |(shape, program): &(&ResolvedShape, &Program)| {
            let known = self.known.get(&shape.id).filter(|(last, _)| last.same_content(shape));
            let found = match known {
                Some((_, found)) => *found,
                None => {
                    let found = transparent_with(shape, program);
                    self.known.insert(shape.id, ((*shape).clone(), found));
                    found
                }
            };
            let [volume, table] = found?;
            let texture = shape.first_volume()?;
            let cells = Cells { base, count: count(texture), volume, table };
            base += cells.len() as u32;
            Some(cells)
        };
        items.iter().map(&mut place).collect()
    }

    /// Makes room for cells; some where there are none.
    ///
    /// # Errors
    /// If the device fails.
    pub fn buffer(&mut self, gpu: &Gpu, cells: &[Option<Cells>]) -> Result<(), ActionError> {
        let wanted = 4 * cells.iter().flatten().map(Cells::len).sum::<usize>().max(4) as u64;
        let buffer = |label| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: wanted,
                usage: wgpu::BufferUsages::STORAGE,
                mapped_at_creation: false,
            })
        };
        let old = self.empties.take().filter(|b| b.size() >= wanted);
        if old.is_none() {
            self.generation += 1;
            self.found.clear();
            self.scratch = Some([buffer("volact scratch"), buffer("volact scratch")]);
        }
        self.empties = Some(old.unwrap_or_else(|| buffer("volact cells")));
        Ok(gpu.check()?)
    }

    /// The buffer of cells, once there was room made.
    pub fn held(&self) -> Option<&wgpu::Buffer> {
        self.empties.as_ref()
    }

    /// Finds what is empty, where what it depends on has changed; `rows` are the buffers of numbers and
    /// tables, which hold what is drawn.
    ///
    /// # Errors
    /// If the device fails.
    pub fn find(
        &mut self,
        gpu: &Gpu,
        items: &[(&ResolvedShape, &Program, Option<Cells>)],
        (volumes, layout, rows): (&Volumes, &Layout, [&wgpu::Buffer; 3]),
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<(), ActionError> {
        let wanted: Vec<_> = items.iter().enumerate().filter_map(|(i, item)| found(i, item, volumes)).collect();
        self.bounds.retain(|key, _| wanted.iter().any(|(_, _, f)| f.volume == *key));
        let changed = wanted.iter().filter(|(_, _, f)| !self.found.contains(f));
        let changed: Vec<_> = changed.map(|(i, held, found)| (*i, *held, found.clone())).collect();
        if changed.is_empty() {
            return Ok(());
        }
        if self.passes.is_none() {
            self.passes = Some(passes(gpu)?);
        }
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: None });
        for (number, held, found) in changed {
            let slots = &layout.slots[number];
            let row = slots[found.cells.volume].row;
            let anew = self.make_bounds(gpu, &found);
            let (Some(passes), Some(bounds)) = (&self.passes, self.bounds.get(&found.volume)) else { continue };
            let (Some(scratch), Some(empties)) = (&self.scratch, &self.empties) else { continue };
            let numbers = |base: u32, axis: u32| {
                let [x, y, z] = found.cells.count;
                [x, y, z, row, base, slots[found.cells.table].row, axis, 0]
            };
            let [a, b] = scratch;
            let pass = |pipeline, base, axis, from, to| Pass { pipeline, numbers: numbers(base, axis), from, to };
            let all = [
                anew.then(|| pass(&passes.bounds, 0, 0, b, a)),
                Some(pass(&passes.empty, 0, 0, b, a)),
                Some(pass(&passes.spread, 0, 0, a, b)),
                Some(pass(&passes.spread, 0, 1, b, a)),
                Some(pass(&passes.spread, found.cells.base, 2, a, empties)),
            ];
            for pass in all.into_iter().flatten() {
                encode(gpu, &mut encoder, passes, rows, &pass, (held, &bounds.buffer));
            }
            let shape = items[number].0.name.clone();
            rebuilt.push(Rebuild { shape, what: "occupancy".into(), bytes: 4 * found.cells.len() });
        }
        gpu.queue.submit([encoder.finish()]);
        gpu.check()?;
        self.found = wanted.into_iter().map(|(_, _, found)| found).collect();
        Ok(())
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        let buffers = self.empties.iter().chain(self.scratch.iter().flatten());
        buffers.chain(self.bounds.values().map(|b| &b.buffer)).map(|b| b.size() as usize).sum()
    }

    /// Room for bounds, and whether they have to be found.
    fn make_bounds(&mut self, gpu: &Gpu, found: &Found) -> bool {
        let known = self.bounds.get(&found.volume);
        if known.is_some_and(|b| b.made_of == found.made_of) {
            return false;
        }
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("volact bounds"),
            size: 8 * found.cells.len() as u64,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        self.bounds.insert(found.volume, Bounds { buffer, made_of: found.made_of });
        true
    }
}

/// What a shape's cells depend on.
fn found<'a>(
    number: usize,
    (shape, program, cells): &(&ResolvedShape, &Program, Option<Cells>),
    volumes: &'a Volumes,
) -> Option<(usize, &'a Held, Found)> {
    let cells = (*cells)?;
    let volume = shape.first_volume().map(VolumeTexture::volume)?;
    let held = volumes.get(volume)?;
    let component = shape.int("component").unwrap_or(0).clamp(0, 3) as u32;
    let table = program.declaration().parameters.get(cells.table)?;
    let found = Found {
        cells,
        volume: (volume.id(), component),
        made_of: [held.generation, volume.version()],
        units: [held.encoding.units.scale.to_bits(), held.encoding.units.offset.to_bits()],
        table: table::rows(&pack::points(shape, &table.name)),
    };
    Some((number, held, found))
}

fn encode(
    gpu: &Gpu,
    encoder: &mut wgpu::CommandEncoder,
    passes: &Passes,
    [frame, numbers, tables]: [&wgpu::Buffer; 3],
    pass: &Pass<'_>,
    (held, bounds): (&Held, &wgpu::Buffer),
) {
    let uniform = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("volact cells"),
        size: size_of_val(&pass.numbers) as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue.write_buffer(&uniform, 0, bytemuck::cast_slice(&pass.numbers));
    let shared = [frame, numbers, tables].map(wgpu::Buffer::as_entire_binding);
    let own = [
        uniform.as_entire_binding(),
        wgpu::BindingResource::TextureView(&held.view),
        bounds.as_entire_binding(),
        pass.from.as_entire_binding(),
        pass.to.as_entire_binding(),
    ];
    let groups = [
        crate::draw::group(gpu, &passes.groups[0], shared.into()),
        crate::draw::group(gpu, &passes.groups[1], own.into()),
    ];
    let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    compute.set_pipeline(pass.pipeline);
    groups.iter().zip(0..).for_each(|(group, i)| compute.set_bind_group(i, group, &[]));
    let [x, y, z] = [0, 1, 2].map(|a| pass.numbers[a].div_ceil(WORKGROUP));
    compute.dispatch_workgroups(x, y, z);
}

fn passes(gpu: &Gpu) -> Result<Passes, ActionError> {
    let wrong = |error: ComposeError| ActionError::Backend { action: NAME.into(), source: Box::new(error) };
    let (module, _) = module().map_err(wrong)?;
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("volact skipping"),
        source: wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(module)),
    });
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let uniform = buffer(wgpu::BufferBindingType::Uniform);
    let storage = |read_only| buffer(wgpu::BufferBindingType::Storage { read_only });
    let texture = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: false },
        view_dimension: wgpu::TextureViewDimension::D3,
        multisampled: false,
    };
    let layout = |types: &[wgpu::BindingType]| {
        let entries: Vec<_> = types.iter().zip(0..).map(|(ty, i)| crate::pipeline::entry(i, *ty)).collect();
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some("volact skipping"), entries: &entries };
        gpu.device.create_bind_group_layout(&descriptor)
    };
    let groups = [
        layout(&[uniform, uniform, storage(true)]),
        layout(&[uniform, texture, storage(false), storage(false), storage(false)]),
    ];
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("volact skipping"),
        bind_group_layouts: &[Some(&groups[0]), Some(&groups[1])],
        immediate_size: 0,
    });
    let pipeline = |entry| {
        gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        })
    };
    let (bounds, empty) = (pipeline("volact_find_bounds"), pipeline("volact_find_empty"));
    let spread = pipeline("volact_spread");
    gpu.check()?;
    Ok(Passes { groups, bounds, empty, spread })
}
