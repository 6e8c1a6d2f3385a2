//! The window's surface and device, and a frame on them.

use std::{path::Path, sync::Arc};

use anyhow::{Context as _, bail};
use volact::{
    Aabb, Camera, FrameDesc,
    core::{Context, Viewport, camera::DepthRange, glam::DMat4, parameter::ParameterMap},
    prelude::*,
};
use volact_wgpu::{Onto, OntoDepth, WgpuAction};
use wgpu::{CurrentSurfaceTexture, TextureUsages};
use winit::{dpi::PhysicalSize, window::Window};

use crate::ring::{DEPTH, Ring};

/// Everything that lives as long as the window.
pub struct Graphics {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    device: wgpu::Device,
    queue: wgpu::Queue,
    depth: wgpu::TextureView,
    ring: Ring,
    action: WgpuAction,
}

impl Graphics {
    /// A device that can draw into the window, and an action that shares it. `readable` says that the
    /// surface will be read.
    pub fn new(window: Arc<Window>, registry: &Registry, readable: bool) -> anyhow::Result<Self> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let surface = instance.create_surface(Arc::clone(&window))?;
        let wanted = wgpu::RequestAdapterOptions { compatible_surface: Some(&surface), ..Default::default() };
        let adapter = pollster::block_on(instance.request_adapter(&wanted)).context("no adapter for this window")?;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default()))?;
        let size = window.inner_size();
        let Some(mut config) = surface.get_default_config(&adapter, size.width.max(1), size.height.max(1)) else {
            bail!("adapter {:?} cannot draw into this window", adapter.get_info().name);
        };
        // Frames are shown as they are: a view that says sRGB would convert them once more.
        config.format = config.format.remove_srgb_suffix();
        if readable {
            let found = surface.get_capabilities(&adapter).usages;
            if !found.contains(TextureUsages::COPY_SRC) {
                bail!("the window's surface can be used as {found:?}, wanted COPY_SRC for a picture");
            }
            config.usage |= TextureUsages::COPY_SRC;
        }
        surface.configure(&device, &config);
        let options = volact_wgpu::declaration().resolve(&ParameterMap::new(), |_| false);
        let options = options.map_err(|problems| anyhow::anyhow!("{problems:?}"))?;
        let context = Context { shaders: registry.shaders().clone(), ..Context::default() };
        let action = WgpuAction::with_device(&context, &options, device.clone(), queue.clone());
        let (depth, ring) = (depth(&device, &config), Ring::new(&device, config.format));
        Ok(Self { window, surface, config, device, queue, depth, ring, action })
    }

    /// Has the action look after shapes.
    pub fn manage(&mut self, shapes: &[Shape]) -> anyhow::Result<()> {
        Ok(shapes.iter().try_for_each(|shape| self.action.manage(shape))?)
    }

    /// Follows the window's size.
    pub fn resize(&mut self, size: PhysicalSize<u32>) {
        (self.config.width, self.config.height) = (size.width.max(1), size.height.max(1));
        self.surface.configure(&self.device, &self.config);
        self.depth = depth(&self.device, &self.config);
        self.again();
    }

    /// Asks for another frame.
    pub fn again(&self) {
        self.window.request_redraw();
    }

    /// Draws the ring, and the shapes over it, seen from an angle; keeps the picture where that is
    /// asked for. Whether the window could be drawn into.
    pub fn draw(
        &mut self,
        shapes: &[Shape],
        bounds: &Aabb,
        angle: f64,
        picture: Option<&Path>,
    ) -> anyhow::Result<bool> {
        let texture = match self.surface.get_current_texture() {
            CurrentSurfaceTexture::Success(texture) | CurrentSurfaceTexture::Suboptimal(texture) => texture,
            CurrentSurfaceTexture::Timeout | CurrentSurfaceTexture::Occluded => return Ok(false),
            CurrentSurfaceTexture::Outdated => {
                self.surface.configure(&self.device, &self.config);
                return Ok(false);
            }
            other => bail!("the window's surface is gone: {other:?}"),
        };
        let view = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let (camera, world_to_clip) = self.camera(bounds, angle);
        self.ring.draw((&self.device, &self.queue), [&view, &self.depth], bounds, world_to_clip);

        let (width, height) = (self.config.width as usize, self.config.height as usize);
        self.action.begin_draw(&FrameDesc::new(camera, width, height))?;
        shapes.iter().try_for_each(|shape| self.action.draw(shape))?;
        let depth = OntoDepth { view: &self.depth, world_to_clip, range: DepthRange::ZeroToOne };
        self.action.end_draw_onto(&Onto { view: &view, format: self.config.format, depth: Some(depth) })?;

        if let Some(path) = picture {
            self.save(&texture.texture, path)?;
        }
        self.window.pre_present_notify();
        self.queue.present(texture);
        Ok(true)
    }

    /// A camera that goes around world bounds, and its map to clip space.
    fn camera(&self, bounds: &Aabb, angle: f64) -> (Camera, DMat4) {
        let size = bounds.size().length();
        let eye = bounds.center() + 1.35 * size * DVec3::new(angle.sin(), -angle.cos(), 0.42);
        let aspect = f64::from(self.config.width) / f64::from(self.config.height);
        let look = Camera::perspective(eye, bounds.center(), DVec3::Z, 40.0);
        let viewport = Viewport { x: 0, y: 0, width: self.config.width as usize, height: self.config.height as usize };
        // A camera around bounds that are not empty is right.
        let view = look.world_to_view(&viewport).map_or(DMat4::IDENTITY, DMat4::from);
        let projection = perspective(40f64.to_radians(), aspect, 0.05 * size, 8.0 * size);
        (Camera::Matrices { view, projection, depth: DepthRange::ZeroToOne }, projection * view)
    }

    /// Writes a texture of 8-bit colours as a picture.
    fn save(&self, texture: &wgpu::Texture, path: &Path) -> anyhow::Result<()> {
        let (width, height) = (texture.width(), texture.height());
        let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size: u64::from(row) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
        self.queue.submit([encoder.finish()]);
        let (tell, told) = std::sync::mpsc::channel();
        buffer.slice(..).map_async(wgpu::MapMode::Read, move |result| tell.send(result).unwrap_or_default());
        self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None })?;
        told.recv()??;
        let bytes = buffer.slice(..).get_mapped_range()?;
        let swapped = match texture.format() {
            wgpu::TextureFormat::Bgra8Unorm => true,
            wgpu::TextureFormat::Rgba8Unorm => false,
            other => bail!("the window's format is {other:?}, wanted one of 8 bits for a picture"),
        };
        let pixel = |bytes: &[u8]| {
            let [a, g, b] = [0, 1, 2].map(|c| f32::from(bytes[c]) / 255.0);
            if swapped { [b, g, a, 1.0] } else { [a, g, b, 1.0] }
        };
        let rows = bytes.chunks_exact(row as usize).flat_map(|r| r[..4 * width as usize].chunks_exact(4).map(pixel));
        let mut frame = Frame::empty(&FrameDesc::new(
            Camera::orthographic(DVec3::Y, DVec3::ZERO, DVec3::Z, 1.0),
            width as usize,
            height as usize,
        ));
        frame.color = rows.collect::<Vec<_>>().into();
        frame.save(path)?;
        Ok(())
    }
}

/// A perspective projection to depths from 0 to 1, as Direct3D and WebGPU have it.
fn perspective(fov_y: f64, aspect: f64, near: f64, far: f64) -> DMat4 {
    let focal = 1.0 / (0.5 * fov_y).tan();
    let depth = far / (near - far);
    DMat4::from_cols_array(&[
        focal / aspect,
        0.0,
        0.0,
        0.0,
        0.0,
        focal,
        0.0,
        0.0,
        0.0,
        0.0,
        depth,
        -1.0,
        0.0,
        0.0,
        near * depth,
        0.0,
    ])
}

fn depth(device: &wgpu::Device, config: &wgpu::SurfaceConfiguration) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("depth"),
        size: wgpu::Extent3d { width: config.width, height: config.height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: DEPTH,
        usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}
