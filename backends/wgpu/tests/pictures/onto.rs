//! Drawing over an application's picture, on its own device.

use volact_conformance::scene::{ball, colors, lut};
use volact_core::{
    Camera, Context, Frame, FrameDesc, Opaque, OpaqueDepth, RenderAction, ScalarType, Shape, Viewport,
    camera::DepthRange,
    glam::{DMat4, DVec3, dcamera::rh},
    parameter::ParameterMap,
};
use volact_wgpu::{Onto, OntoDepth, WgpuAction};

const SIZE: u32 = 32;
const METHODS: [&str; 2] = ["rays", "slices"];
const BACK: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// An application with a device, a picture of one colour, and a depth buffer of one depth.
struct Application {
    device: wgpu::Device,
    queue: wgpu::Queue,
    color: wgpu::Texture,
    depth: wgpu::Texture,
}

impl Application {
    fn new(depth: f32) -> Self {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())).unwrap();
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor::default())).unwrap();
        let texture = |format, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width: SIZE, height: SIZE, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let color_texture = texture(wgpu::TextureFormat::Rgba8Unorm, wgpu::TextureUsages::COPY_SRC);
        let depth_texture = texture(wgpu::TextureFormat::Depth32Float, wgpu::TextureUsages::TEXTURE_BINDING);
        let made = Self { color: color_texture, depth: depth_texture, device, queue };
        made.clear(depth);
        made
    }

    fn views(&self) -> [wgpu::TextureView; 2] {
        [&self.color, &self.depth].map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()))
    }

    fn clear(&self, depth: f32) {
        let [color, depth_view] = self.views();
        let [r, g, b, a] = BACK;
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &color,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth_view,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(depth), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        self.queue.submit([encoder.finish()]);
    }

    fn picture(&self) -> Vec<[u8; 4]> {
        // Rows of copies are multiples of 256 bytes.
        let row = (4 * SIZE).next_multiple_of(256);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(row * SIZE),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(self.color.as_image_copy(), to, self.color.size());
        self.queue.submit([encoder.finish()]);
        buffer.slice(..).map_async(wgpu::MapMode::Read, |result| result.unwrap());
        self.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None }).unwrap();
        let bytes = buffer.slice(..).get_mapped_range().unwrap();
        let rows = bytes.chunks_exact(row as usize);
        rows.flat_map(|row| row[..4 * SIZE as usize].as_chunks::<4>().0.to_vec()).collect()
    }
}

/// An action of some method, which draws the picture in some bands.
fn action(application: &Application, method: &str) -> WgpuAction {
    let given = ParameterMap::from([
        ("sample_distance".to_owned(), 0.3.into()),
        ("method".to_owned(), method.into()),
        ("submission".to_owned(), 2e4.into()),
    ]);
    let options = volact_wgpu::declaration().resolve(&given, |_| false).unwrap();
    let (device, queue) = (application.device.clone(), application.queue.clone());
    WgpuAction::with_device(
        &Context { shaders: crate::common::registry().shaders().clone(), ..Default::default() },
        &options,
        device,
        queue,
    )
}

fn shape() -> Shape {
    let table = colors(&[(10.0, [0.5, 0.1, 0.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.3), (200.0, [1.0; 3], 0.6)]);
    lut(&ball([9, 8, 10], ScalarType::U8), table, 1.0)
}

/// A camera of matrices, and its map to clip space.
fn camera() -> (Camera, DMat4) {
    let view = rh::view::look_at_mat4(DVec3::new(9.0, -11.0, 7.0), DVec3::splat(4.0), DVec3::Z);
    let projection = rh::proj::directx::perspective(0.7, 1.0, 1.0, 60.0);
    (Camera::Matrices { view, projection, depth: DepthRange::ZeroToOne }, projection * view)
}

fn begin(action: &mut WgpuAction, shape: &Shape, desc: &FrameDesc) {
    action.manage(shape).unwrap();
    action.begin_draw(desc).unwrap();
    action.draw(shape).unwrap();
}

/// Bytes over the application's colour, rounded as the device does.
fn over(frame: &Frame, inside: Viewport) -> Vec<[f64; 4]> {
    let pixel = |i: usize| {
        let (x, y) = (i % frame.width, i / frame.width);
        let seen =
            (inside.x..inside.x + inside.width).contains(&x) && (inside.y..inside.y + inside.height).contains(&y);
        let color = if seen { frame.color[i].map(f64::from) } else { [0.0; 4] };
        [0, 1, 2, 3].map(|c| 255.0 * (color[c] + (1.0 - color[3]) * BACK[c]))
    };
    (0..frame.color.len()).map(pixel).collect()
}

fn same(found: &[[u8; 4]], wanted: &[[f64; 4]]) {
    // Half a step of the target's 8 bits each for the background, the colour, what is left, and the sum.
    let near = |(a, b): (&[u8; 4], &[f64; 4])| (0..4).all(|c| (f64::from(a[c]) - b[c]).abs() <= 2.01);
    let wrong = found.iter().zip(wanted).filter(|pair| !near((pair.0, pair.1))).count();
    assert_eq!((wrong, found.len()), (0, wanted.len()));
}

#[test]
fn a_picture_is_laid_over_a_viewport() {
    METHODS.into_iter().for_each(lays_over_a_viewport);
}

fn lays_over_a_viewport(method: &str) {
    let application = Application::new(1.0);
    let (mut action, shape) = (action(&application, method), shape());
    let viewport = Viewport { x: 5, y: 3, width: 20, height: 24 };
    let desc = FrameDesc { viewport: Some(viewport), ..FrameDesc::new(camera().0, SIZE as usize, SIZE as usize) };
    begin(&mut action, &shape, &desc);
    let wanted = over(&action.end_draw().unwrap(), viewport);
    begin(&mut action, &shape, &desc);
    let [view, _] = application.views();
    let target = Onto { view: &view, format: application.color.format(), depth: None };
    let frame = action.end_draw_onto(&target).unwrap();
    assert!(frame.statistics.samples > 1000 && frame.color.iter().all(|c| *c == [0.0; 4]));
    let found = application.picture();
    assert!(found.iter().any(|c| c[0] > 120), "something is drawn");
    same(&found, &wanted);
}

#[test]
fn an_application_s_depth_hides_what_lies_behind() {
    METHODS.into_iter().for_each(hides_what_lies_behind);
}

fn hides_what_lies_behind(method: &str) {
    let (camera, world_to_clip) = camera();
    // The depth of the plane through the scene's middle.
    let middle = world_to_clip.project_point3(DVec3::splat(4.0)).z as f32;
    let application = Application::new(middle);
    let (mut action, shape) = (action(&application, method), shape());
    let desc = FrameDesc::new(camera, SIZE as usize, SIZE as usize);
    let values = vec![middle; (SIZE * SIZE) as usize];
    let depth = OpaqueDepth::Buffer { values: values.into(), range: DepthRange::ZeroToOne, world_to_clip };
    begin(&mut action, &shape, &desc.clone().with_opaque(Opaque { color: None, depth }));
    let cut = action.end_draw().unwrap();
    begin(&mut action, &shape, &desc);
    let whole = action.end_draw().unwrap();
    let samples = |frame: &Frame| frame.statistics.samples;
    assert!(samples(&cut) < samples(&whole) * 3 / 4, "{} of {}", samples(&cut), samples(&whole));
    begin(&mut action, &shape, &desc);
    let [view, depth] = application.views();
    let depth = OntoDepth { view: &depth, world_to_clip, range: DepthRange::ZeroToOne };
    let target = Onto { view: &view, format: application.color.format(), depth: Some(depth) };
    action.end_draw_onto(&target).unwrap();
    same(&application.picture(), &over(&cut, desc.viewport()));
    // And what the device has found is forgotten where it is not asked for again.
    begin(&mut action, &shape, &desc);
    assert_eq!(action.end_draw().unwrap().color, whole.color);
}

#[test]
fn formats_that_cannot_be_blended_are_an_error_and_no_more() {
    METHODS.into_iter().for_each(goes_on_after_a_wrong_format);
}

fn goes_on_after_a_wrong_format(method: &str) {
    let application = Application::new(1.0);
    let (mut action, shape) = (action(&application, method), shape());
    let desc = FrameDesc::new(camera().0, SIZE as usize, SIZE as usize);
    begin(&mut action, &shape, &desc);
    let [view, _] = application.views();
    let target = Onto { view: &view, format: wgpu::TextureFormat::R32Uint, depth: None };
    assert!(action.end_draw_onto(&target).is_err());
    begin(&mut action, &shape, &desc);
    assert!(action.end_draw().unwrap().statistics.samples > 1000);
}
