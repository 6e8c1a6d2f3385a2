//! Pipelines, each made once for the shaders that it draws and how it reads their volumes.

use std::{collections::HashMap, sync::Arc};

use volact_core::ActionError;
use volact_shaders::gpu::{ComposeError, Layout, Recipe, VolumeUse, compose, compose_slices, runs::Corner, scene::Key};

use crate::{NAME, device::Gpu, slabs};

/// Pipelines that are kept.
const MOST: usize = 64;

/// How pictures are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// By rays, in a compute stage.
    Rays,
    /// By slabs, in a fragment stage.
    Slabs {
        /// Whether shapes are drawn together.
        together: bool,
    },
}

/// What a pipeline depends on.
type Known = (Key, Stage);

/// A pipeline.
#[derive(Debug)]
pub enum Stages {
    /// Of rays.
    Rays(wgpu::ComputePipeline),
    /// Of slabs.
    Slabs(wgpu::RenderPipeline),
}

/// A pipeline with its bindings.
#[derive(Debug)]
pub struct Pipeline {
    /// The pipeline.
    pub stages: Stages,
    /// The layouts of groups 0 and 1.
    pub groups: [wgpu::BindGroupLayout; 2],
    /// Where numbers lie.
    pub layout: Layout,
    /// Differs from that of every other pipeline there was.
    pub generation: u64,
}

/// All pipelines.
#[derive(Debug, Default)]
pub struct Pipelines {
    known: HashMap<Known, Arc<Pipeline>>,
    generation: u64,
}

impl Pipelines {
    /// The pipeline for a key, and whether it was made just now.
    ///
    /// # Errors
    /// If the device cannot bind as much as the shapes need, or refuses the module.
    pub fn get(&mut self, gpu: &Gpu, key: Known, recipes: &[Recipe]) -> Result<(Arc<Pipeline>, bool), ActionError> {
        if let Some(known) = self.known.get(&key) {
            return Ok((Arc::clone(known), false));
        }
        if self.known.len() >= MOST {
            self.known.clear();
        }
        self.generation += 1;
        let made = Arc::new(make(gpu, &key, recipes, self.generation)?);
        self.known.insert(key, Arc::clone(&made));
        Ok((made, true))
    }
}

fn make(gpu: &Gpu, (key, stage): &Known, recipes: &[Recipe], generation: u64) -> Result<Pipeline, ActionError> {
    let wrong = |error: ComposeError| ActionError::Backend { action: NAME.into(), source: Box::new(error) };
    let (watched, has) = (gpu.cuts_loops(), (key.planes, key.surfaces));
    let made = match stage {
        Stage::Rays => compose(recipes, key.spans, has, watched),
        Stage::Slabs { together } => compose_slices(recipes, key.spans, has, (key.planes || *together, true), watched),
    };
    let made = made.map_err(wrong)?;
    check(gpu, &made.layout, *stage)?;
    let device = &gpu.device;
    let module = shader_module(device, made.module);
    let seen = match stage {
        Stage::Rays => wgpu::ShaderStages::COMPUTE,
        Stage::Slabs { .. } => wgpu::ShaderStages::FRAGMENT,
    };
    let groups = [frame_group(device, seen), volume_group(device, seen, &key.shapes)];
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("volact picture"),
        bind_group_layouts: &[Some(&groups[0]), Some(&groups[1])],
        immediate_size: 0,
    });
    let stages = match stage {
        Stage::Rays => Stages::Rays(rays(device, &layout, &module)),
        Stage::Slabs { .. } => Stages::Slabs(runs(device, &layout, &module)),
    };
    gpu.check()?;
    log::debug!("wgpu: a pipeline for {} shapes", key.shapes.len());
    Ok(Pipeline { stages, groups, layout: made.layout, generation })
}

fn rays(device: &wgpu::Device, layout: &wgpu::PipelineLayout, module: &wgpu::ShaderModule) -> wgpu::ComputePipeline {
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("volact rays"),
        layout: Some(layout),
        module,
        entry_point: Some("volact_picture"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

fn runs(device: &wgpu::Device, layout: &wgpu::PipelineLayout, module: &wgpu::ShaderModule) -> wgpu::RenderPipeline {
    let corner = wgpu::VertexBufferLayout {
        array_stride: size_of::<Corner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x2, 1 => Sint32x4, 2 => Float32],
    };
    // Nothing is written to the attachment.
    let target = wgpu::ColorTargetState { format: slabs::FORMAT, blend: None, write_mask: wgpu::ColorWrites::empty() };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("volact runs"),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("volact_corner"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[Some(corner)],
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::TriangleStrip,
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("volact_run"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(target)],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// A module whose loops nobody need bound.
#[expect(unsafe_code, reason = "the other way adds a counter of 64 bits to every loop of the march")]
fn shader_module(device: &wgpu::Device, module: naga::Module) -> wgpu::ShaderModule {
    let descriptor = wgpu::ShaderModuleDescriptor {
        label: Some("volact rays"),
        source: wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(module)),
    };
    let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..wgpu::ShaderRuntimeChecks::checked() };
    // SAFETY: no loop goes on for ever, which is all that the missing check asks for: `compose` gives
    // authors' loops a budget, and those of the framework advance along a ray or count to a number.
    unsafe { device.create_shader_module_trusted(descriptor, checks) }
}

/// What the shapes need against what the adapter has.
fn check(gpu: &Gpu, layout: &Layout, stage: Stage) -> Result<(), ActionError> {
    let limits = &gpu.limits;
    if stage != Stage::Rays && gpu.stores_from_fragments() == Some(false) {
        return Err(ActionError::Limit {
            action: NAME.into(),
            what: "stores from fragment stages".into(),
            found: format!("none on adapter {:?}", gpu.name()),
            wanted: "an adapter that has them, or method rays".into(),
        });
    }
    let needs = [
        ("number of volumes in one picture", layout.textures, limits.max_sampled_textures_per_shader_stage),
        ("number of bound buffers", BUFFERS, limits.max_storage_buffers_per_shader_stage),
    ];
    for (what, found, most) in needs {
        if found > most {
            return Err(ActionError::Limit {
                action: NAME.into(),
                what: what.into(),
                found: found.to_string(),
                wanted: format!("at most {most} on adapter {:?}; draw fewer shapes, or take cpu", gpu.name()),
            });
        }
    }
    Ok(())
}

/// Storage buffers of group 0.
const BUFFERS: u32 = 7;

/// A binding of a compute stage.
pub fn entry(binding: u32, ty: wgpu::BindingType) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None }
}

/// The bindings of group 0, as some stage sees them.
pub fn frame_group(device: &wgpu::Device, seen: wgpu::ShaderStages) -> wgpu::BindGroupLayout {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let storage = |read_only| buffer(wgpu::BufferBindingType::Storage { read_only });
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry { visibility: seen, ..entry(binding, ty) };
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("volact frame"),
        entries: &[
            entry(0, buffer(wgpu::BufferBindingType::Uniform)),
            entry(1, buffer(wgpu::BufferBindingType::Uniform)),
            entry(2, storage(true)),
            entry(3, storage(true)),
            entry(4, storage(false)),
            entry(5, storage(false)),
            entry(6, storage(false)),
            entry(7, storage(true)),
            entry(8, storage(true)),
        ],
    })
}

fn volume_group(
    device: &wgpu::Device,
    seen: wgpu::ShaderStages,
    shapes: &[(usize, Vec<Option<VolumeUse>>)],
) -> wgpu::BindGroupLayout {
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry { visibility: seen, ..entry(binding, ty) };
    let texture = |volume: &VolumeUse| wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: volume.hardware },
        view_dimension: wgpu::TextureViewDimension::D3,
        multisampled: false,
    };
    let mut entries = vec![entry(0, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering))];
    for volume in shapes.iter().flat_map(|(_, volumes)| volumes.iter().flatten()) {
        entries.push(entry(entries.len() as u32, texture(volume)));
    }
    device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("volact volumes"), entries: &entries })
}
