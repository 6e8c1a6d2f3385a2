//! Drawing over an application's picture: into a viewport of its texture, in front of, behind and
//! around what its depth buffer holds. Nothing is cleared, and depth is left as it is.

use std::collections::{HashMap, hash_map::Entry};

use volact_core::{ActionError, Viewport, camera::DepthRange, glam::DMat4};
use volact_shaders::gpu::{
    Anchor, ComposeError, WORKGROUP,
    onto::{DepthNumbers, limits, onto},
};

use crate::{NAME, bands::Band, device::Gpu, draw::group, pipeline::entry};

/// What an application draws into.
#[derive(Clone, Copy, Debug)]
pub struct Onto<'a> {
    /// The colours, premultiplied; of the frame's size. Numbers go to it as they are: a view whose
    /// format says sRGB converts them.
    pub view: &'a wgpu::TextureView,
    /// The format of the view, which can be blended and drawn into.
    pub format: wgpu::TextureFormat,
    /// What the application has drawn already, where volumes go behind of it.
    pub depth: Option<OntoDepth<'a>>,
}

/// A depth buffer that is read and left as it is.
#[derive(Clone, Copy, Debug)]
pub struct OntoDepth<'a> {
    /// The depths alone, 1 where there is nothing; of the frame's size, one sample a pixel, and with the
    /// usage `TEXTURE_BINDING`.
    pub view: &'a wgpu::TextureView,
    /// World to clip space, as it was drawn with.
    pub world_to_clip: DMat4,
    /// What near and far map to in clip space.
    pub range: DepthRange,
}

/// The pipelines, made when they are used first.
#[derive(Debug, Default)]
pub struct Laying {
    limits: Option<(wgpu::ComputePipeline, [wgpu::BindGroupLayout; 2])>,
    covers: HashMap<wgpu::TextureFormat, (wgpu::RenderPipeline, [wgpu::BindGroupLayout; 2])>,
    numbers: Option<[wgpu::Buffer; 2]>,
}

const STAGES: wgpu::ShaderStages = wgpu::ShaderStages::FRAGMENT;

fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

const UNIFORM: wgpu::BufferBindingType = wgpu::BufferBindingType::Uniform;

fn wrong(error: ComposeError) -> ActionError {
    ActionError::Backend { action: NAME.into(), source: Box::new(error) }
}

impl Laying {
    /// Fills `rows` with where rays end at the depths of a buffer.
    ///
    /// # Errors
    /// If the device fails.
    pub fn limit(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        (frame, rows): (&wgpu::Buffer, &wgpu::Buffer),
        depth: &OntoDepth<'_>,
        (anchor, viewport): (&Anchor, &Viewport),
    ) -> Result<(), ActionError> {
        let corner = [viewport.x as u32, viewport.y as u32];
        let numbers = DepthNumbers::new(anchor, &depth.world_to_clip, depth.range, corner);
        let [uniform, _] = self.numbers.get_or_insert_with(|| make_numbers(gpu));
        gpu.queue.write_buffer(uniform, 0, bytemuck::bytes_of(&numbers));
        let (pipeline, layouts) = match &mut self.limits {
            Some(made) => made,
            empty => empty.insert(limits_pipeline(gpu)?),
        };
        let resources =
            vec![uniform.as_entire_binding(), wgpu::BindingResource::TextureView(depth.view), rows.as_entire_binding()];
        let groups = [group(gpu, &layouts[0], vec![frame.as_entire_binding()]), group(gpu, &layouts[1], resources)];
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        groups.iter().zip(0..).for_each(|(group, i)| pass.set_bind_group(i, group, &[]));
        let count = |n: usize| (n as u32).div_ceil(WORKGROUP);
        pass.dispatch_workgroups(count(viewport.width), count(viewport.height), 1);
        drop(pass);
        Ok(gpu.check()?)
    }

    /// Lays a band of pixels over a viewport of a target.
    ///
    /// # Errors
    /// If the device cannot blend the target's format, or fails.
    pub fn lay(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        (frame, pixels): (&wgpu::Buffer, &wgpu::Buffer),
        target: &Onto<'_>,
        (viewport, band): (&Viewport, Band),
    ) -> Result<(), ActionError> {
        let [_, uniform] = self.numbers.get_or_insert_with(|| make_numbers(gpu));
        gpu.queue.write_buffer(uniform, 0, bytemuck::bytes_of(&[viewport.x as u32, viewport.y as u32, 0, 0]));
        let uniform = uniform.clone();
        let (pipeline, layouts) = match self.covers.entry(target.format) {
            Entry::Occupied(there) => there.into_mut(),
            Entry::Vacant(free) => free.insert(cover_pipeline(gpu, target.format)?),
        };
        let resources = vec![pixels.as_entire_binding(), uniform.as_entire_binding()];
        let groups = [group(gpu, &layouts[0], vec![frame.as_entire_binding()]), group(gpu, &layouts[1], resources)];
        let color = wgpu::RenderPassColorAttachment {
            view: target.view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("volact onto"),
            color_attachments: &[Some(color)],
            ..Default::default()
        });
        pass.set_pipeline(pipeline);
        let [x, y, w, h] = [viewport.x, viewport.y, viewport.width, viewport.height].map(|v| v as f32);
        pass.set_viewport(x, y, w, h, 0.0, 1.0);
        let [left, top] = [viewport.x, viewport.y + band.first].map(|v| v as u32);
        pass.set_scissor_rect(left, top, viewport.width as u32, band.rows as u32);
        groups.iter().zip(0..).for_each(|(group, i)| pass.set_bind_group(i, group, &[]));
        pass.draw(0..3, 0..1);
        drop(pass);
        Ok(gpu.check()?)
    }
}

fn make_numbers(gpu: &Gpu) -> [wgpu::Buffer; 2] {
    [size_of::<DepthNumbers>(), 16].map(|size| {
        gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("volact onto"),
            size: size as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    })
}

fn layouts(gpu: &Gpu, groups: [&[wgpu::BindGroupLayoutEntry]; 2]) -> [wgpu::BindGroupLayout; 2] {
    groups.map(|entries| {
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some("volact onto"), entries };
        gpu.device.create_bind_group_layout(&descriptor)
    })
}

fn pipeline_layout(gpu: &Gpu, groups: &[wgpu::BindGroupLayout; 2]) -> wgpu::PipelineLayout {
    gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("volact onto"),
        bind_group_layouts: &[Some(&groups[0]), Some(&groups[1])],
        immediate_size: 0,
    })
}

fn shader(gpu: &Gpu, module: naga::Module) -> wgpu::ShaderModule {
    let source = wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(module));
    gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("volact onto"), source })
}

fn limits_pipeline(gpu: &Gpu) -> Result<(wgpu::ComputePipeline, [wgpu::BindGroupLayout; 2]), ActionError> {
    let module = shader(gpu, limits().map_err(wrong)?.0);
    let depth = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Depth,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    let storage = buffer(wgpu::BufferBindingType::Storage { read_only: false });
    let own = [entry(0, buffer(UNIFORM)), entry(1, depth), entry(2, storage)];
    let groups = layouts(gpu, [&[entry(0, buffer(UNIFORM))], &own]);
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("volact limits"),
        layout: Some(&pipeline_layout(gpu, &groups)),
        module: &module,
        entry_point: Some("volact_find_limits"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    gpu.check()?;
    Ok((pipeline, groups))
}

fn cover_pipeline(
    gpu: &Gpu,
    format: wgpu::TextureFormat,
) -> Result<(wgpu::RenderPipeline, [wgpu::BindGroupLayout; 2]), ActionError> {
    let module = shader(gpu, onto().map_err(wrong)?.0);
    let seen = |binding, ty| wgpu::BindGroupLayoutEntry { visibility: STAGES, ..entry(binding, ty) };
    let storage = buffer(wgpu::BufferBindingType::Storage { read_only: true });
    let groups = layouts(gpu, [&[seen(0, buffer(UNIFORM))], &[seen(0, storage), seen(1, buffer(UNIFORM))]]);
    let target = wgpu::ColorTargetState {
        format,
        blend: Some(wgpu::BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        write_mask: wgpu::ColorWrites::ALL,
    };
    let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("volact onto"),
        layout: Some(&pipeline_layout(gpu, &groups)),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("volact_cover"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("volact_lay"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(target)],
        }),
        multiview_mask: None,
        cache: None,
    });
    gpu.check()?;
    Ok((pipeline, groups))
}
