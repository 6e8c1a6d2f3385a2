//! What the application draws itself: an opaque ring around the scene, into colour and depth.

use volact::{
    Aabb,
    core::glam::{DMat4, Vec3},
};

/// Pieces of the ring.
const PIECES: u32 = 128;

/// The format of the depth buffer.
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// The ring's pipeline.
pub struct Ring {
    pipeline: wgpu::RenderPipeline,
    numbers: wgpu::Buffer,
    group: wgpu::BindGroup,
}

impl Ring {
    /// A ring for targets of a format.
    pub fn new(device: &wgpu::Device, format: wgpu::TextureFormat) -> Self {
        let module = device.create_shader_module(wgpu::include_wgsl!("ring.wgsl"));
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("ring"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: None,
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState {
                topology: wgpu::PrimitiveTopology::TriangleStrip,
                ..wgpu::PrimitiveState::default()
            },
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Less),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: None,
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let numbers = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("ring"),
            size: 96,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("ring"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: numbers.as_entire_binding() }],
        });
        Self { pipeline, numbers, group }
    }

    /// Draws it around world bounds, over a clear colour and depth.
    pub fn draw(
        &self,
        (device, queue): (&wgpu::Device, &wgpu::Queue),
        [color, depth]: [&wgpu::TextureView; 2],
        bounds: &Aabb,
        world_to_clip: DMat4,
    ) {
        let center = bounds.center().as_vec3();
        let outer = 0.62 * bounds.size().max_element() as f32;
        let radii = Vec3::new(0.72 * outer, outer, 0.0);
        let mut numbers = world_to_clip.as_mat4().to_cols_array().to_vec();
        numbers.extend(center.extend(PIECES as f32).to_array());
        numbers.extend(radii.extend(0.0).to_array());
        queue.write_buffer(&self.numbers, 0, bytemuck::cast_slice(&numbers));
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("ring"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: color,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r: 0.06, g: 0.07, b: 0.10, a: 1.0 }),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..2 * PIECES + 2, 0..1);
        drop(pass);
        queue.submit([encoder.finish()]);
    }
}
