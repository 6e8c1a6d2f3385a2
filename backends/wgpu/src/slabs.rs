//! Drawing by slices: runs of slabs as polygons, whose fragments hand their light from run to run.
//!
//! See `volact_shaders::gpu::runs`, and `slices.wgsl` for what a fragment does. A pass cannot be without
//! an attachment here, so there is one of a byte a pixel that nothing is written to; what is
//! drawn lies in a buffer, which a last pass turns into pixels.

use volact_core::{ActionError, Viewport};
use volact_shaders::gpu::{
    ComposeError, WORKGROUP, finish,
    runs::{Corner, Polygon},
};

use crate::{
    NAME,
    bands::Band,
    device::Gpu,
    draw::group,
    pipeline::{entry, frame_group},
    readback::Times,
    resources::too_large,
};

/// The attachment's format.
pub const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;

/// Bytes of a pixel's light.
const LIGHT: u64 = 32;

/// What drawing slabs needs besides rays' things.
#[derive(Debug, Default)]
pub struct Slabs {
    corners: Option<wgpu::Buffer>,
    content: Vec<Corner>,
    polygons: Vec<Polygon>,
    light: Option<wgpu::Buffer>,
    attachment: Option<wgpu::Texture>,
    finishing: Option<Finishing>,
    /// Changes with the light's buffer.
    pub generation: u64,
}

#[derive(Debug)]
struct Finishing {
    pipeline: wgpu::ComputePipeline,
    groups: [wgpu::BindGroupLayout; 2],
}

/// What is bound, for the runs and for what finishes them.
#[derive(Clone, Copy, Debug)]
pub struct Groups<'a> {
    /// Frame and volumes.
    pub runs: &'a [wgpu::BindGroup; 2],
    /// Frame and light.
    pub finish: &'a [wgpu::BindGroup; 2],
}

impl Slabs {
    /// Has the device hold the polygons of runs; gives the bytes that were moved.
    ///
    /// # Errors
    /// If the device fails.
    pub fn set(&mut self, gpu: &Gpu, corners: Vec<Corner>, polygons: Vec<Polygon>) -> Result<usize, ActionError> {
        self.polygons = polygons;
        let bytes: &[u8] = bytemuck::cast_slice(&corners);
        let wanted = bytes.len().max(size_of::<Corner>()) as u64;
        if wanted > gpu.limits.max_buffer_size {
            return Err(too_large("polygons", wanted, gpu.limits.max_buffer_size));
        }
        if self.corners.as_ref().is_none_or(|b| b.size() < wanted) {
            self.content.clear();
            self.corners = Some(gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("volact corners"),
                size: wanted.next_power_of_two().min(gpu.limits.max_buffer_size),
                usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
            gpu.check()?;
        }
        if self.content == corners {
            return Ok(0);
        }
        if let Some(buffer) = &self.corners {
            gpu.queue.write_buffer(buffer, 0, bytes);
        }
        let moved = bytes.len();
        self.content = corners;
        Ok(moved)
    }

    /// Draws of runs.
    pub fn runs(&self) -> usize {
        self.polygons.len()
    }

    /// Makes room for the light of so many pixels, and for what is drawn of a viewport.
    ///
    /// # Errors
    /// If the device has no such room.
    pub fn reserve(&mut self, gpu: &Gpu, pixels: usize, viewport: &Viewport) -> Result<(), ActionError> {
        let wanted = LIGHT * pixels as u64;
        let most = gpu.limits.max_storage_buffer_binding_size;
        if wanted > most {
            return Err(too_large("the picture", wanted, most));
        }
        if self.light.as_ref().is_none_or(|l| l.size() < wanted) {
            self.generation += 1;
            self.light = Some(gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("volact light"),
                size: wanted,
                usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        self.reserve_attachment(gpu, viewport)?;
        if self.finishing.is_none() {
            self.finishing = Some(finishing(gpu)?);
        }
        Ok(gpu.check()?)
    }

    fn reserve_attachment(&mut self, gpu: &Gpu, viewport: &Viewport) -> Result<(), ActionError> {
        let [width, height] = [viewport.width.max(1) as u32, viewport.height.max(1) as u32];
        let most = gpu.limits.max_texture_dimension_2d;
        if width.max(height) > most {
            return Err(ActionError::Limit {
                action: NAME.into(),
                what: "size of a picture by slices".into(),
                found: format!("{width} × {height} pixels"),
                wanted: format!("at most {most} along an edge on adapter {:?}, or method rays", gpu.name()),
            });
        }
        if self.attachment.as_ref().is_none_or(|a| a.width() < width || a.height() < height) {
            self.attachment = Some(gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("volact runs"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: FORMAT,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            }));
        }
        Ok(())
    }

    /// The light of pixels, once there was room made.
    pub fn light(&self) -> Option<&wgpu::Buffer> {
        self.light.as_ref()
    }

    /// Binds what finishes: the frame's buffers in the order of their bindings, and light.
    pub fn bind(&self, gpu: &Gpu, frame: Vec<wgpu::BindingResource<'_>>) -> Option<[wgpu::BindGroup; 2]> {
        let (finishing, light) = (self.finishing.as_ref()?, self.light.as_ref()?);
        let [first, second] = &finishing.groups;
        Some([group(gpu, first, frame), group(gpu, second, vec![light.as_entire_binding()])])
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        let buffers = self.corners.iter().chain(&self.light).map(|b| b.size() as usize).sum::<usize>();
        buffers + self.attachment.as_ref().map_or(0, |a| (a.width() * a.height()) as usize)
    }

    /// Draws a band of rows: every run, then pixels of the light. `times` are of the first pass and of the
    /// last.
    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipeline: &wgpu::RenderPipeline,
        groups: Groups<'_>,
        (viewport, band): (&Viewport, Band),
        times: Times<'_>,
    ) {
        let (Some(corners), Some(light)) = (&self.corners, &self.light) else { return };
        let (Some(attachment), Some(finishing)) = (&self.attachment, &self.finishing) else { return };
        let [width, rows] = [viewport.width as u32, band.rows as u32];
        encoder.clear_buffer(light, 0, Some(LIGHT * u64::from(width * rows)));
        let view = attachment.create_view(&wgpu::TextureViewDescriptor::default());
        let color = wgpu::RenderPassColorAttachment {
            view: &view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Load, store: wgpu::StoreOp::Store },
        };
        for (number, polygon) in self.polygons.iter().enumerate() {
            // One pass each: the next run reads what this one has written.
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("volact run"),
                color_attachments: &[Some(color.clone())],
                timestamp_writes: times.render(number == 0),
                ..Default::default()
            });
            pass.set_pipeline(pipeline);
            pass.set_viewport(0.0, 0.0, viewport.width as f32, viewport.height as f32, 0.0, 1.0);
            pass.set_scissor_rect(0, band.first as u32, width, rows);
            pass.set_vertex_buffer(0, corners.slice(..));
            groups.runs.iter().zip(0..).for_each(|(group, i)| pass.set_bind_group(i, group, &[]));
            pass.draw(polygon.first..polygon.first + polygon.count, 0..1);
        }
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("volact finish"),
            timestamp_writes: times.compute(self.polygons.is_empty(), true),
        });
        pass.set_pipeline(&finishing.pipeline);
        groups.finish.iter().zip(0..).for_each(|(group, i)| pass.set_bind_group(i, group, &[]));
        pass.dispatch_workgroups(width.div_ceil(WORKGROUP), rows.div_ceil(WORKGROUP), 1);
    }
}

fn finishing(gpu: &Gpu) -> Result<Finishing, ActionError> {
    let wrong = |error: ComposeError| ActionError::Backend { action: NAME.into(), source: Box::new(error) };
    let source = wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(finish().map_err(wrong)?.0));
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("volact finish"), source });
    let ty = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only: true },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let light = gpu.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("volact light"),
        entries: &[entry(0, ty)],
    });
    let groups = [frame_group(&gpu.device, wgpu::ShaderStages::COMPUTE), light];
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("volact finish"),
        bind_group_layouts: &[Some(&groups[0]), Some(&groups[1])],
        immediate_size: 0,
    });
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("volact finish"),
        layout: Some(&layout),
        module: &module,
        entry_point: Some("volact_finish"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    gpu.check()?;
    Ok(Finishing { pipeline, groups })
}
