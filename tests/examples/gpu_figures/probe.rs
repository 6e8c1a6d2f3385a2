//! What an adapter reaches: trilinear samples a second where its caches hold the texture, and bytes a second copied.

use std::{error::Error, fmt::Write as _, time::Instant};

use wgpu::util::DeviceExt as _;

/// Samples that an invocation takes.
const EACH: u32 = 64;
/// Invocations, as 8 × 8 groups along an edge.
const GROUPS: u32 = 128;
/// Bytes that are copied at a time.
const COPIED: u64 = 64 << 20;
/// Runs of which the best counts.
const RUNS: usize = 5;

/// Neighbouring invocations read neighbouring places of a texture that fits any cache.
const SHADER: &str = "
@group(0) @binding(0) var volume: texture_3d<f32>;
@group(0) @binding(1) var linear: sampler;
@group(0) @binding(2) var<storage, read_write> sums: array<f32>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    var at = vec3<f32>(vec2<f32>(id.xy) / 1024.0, 0.013);
    var sum = 0.0;
    for (var i = 0u; i < EACH; i += 1u) {
        sum += textureSampleLevel(volume, linear, at, 0.0).x;
        at.z += 0.0147;
    }
    sums[id.y * 1024u + id.x] = sum;
}";

/// The adapter, and what it reaches, as Markdown.
pub fn report() -> Result<String, Box<dyn Error>> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let wanted =
        wgpu::RequestAdapterOptions { power_preference: wgpu::PowerPreference::HighPerformance, ..Default::default() };
    let adapter = pollster::block_on(instance.request_adapter(&wanted))?;
    let info = adapter.get_info();
    let features =
        adapter.features() & (wgpu::Features::FLOAT32_FILTERABLE | wgpu::Features::TEXTURE_FORMAT_16BIT_NORM);
    let limits = adapter.limits();
    let asked =
        wgpu::DeviceDescriptor { required_features: features, required_limits: limits.clone(), ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&asked))?;
    let mut text = format!(
        "## Adapter\n\n{}, {:?}, {:?}; driver {} {}; 3D textures to {}, buffers to {} MiB.\n\n## Limits, as measured\n\n",
        info.name,
        info.device_type,
        info.backend,
        info.driver,
        info.driver_info,
        limits.max_texture_dimension_3d,
        limits.max_buffer_size >> 20,
    );
    let formats = [
        (wgpu::TextureFormat::R8Unorm, 1, true),
        (wgpu::TextureFormat::R16Unorm, 2, features.contains(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM)),
        (wgpu::TextureFormat::R16Float, 2, true),
        (wgpu::TextureFormat::R32Float, 4, features.contains(wgpu::Features::FLOAT32_FILTERABLE)),
    ];
    text.push_str("| what | reached |\n|---|---|\n");
    for (format, bytes, there) in formats {
        if there {
            let rate = sampled(&device, &queue, format, bytes)?;
            let _ = writeln!(text, "| trilinear samples of {format:?} from the cache | {:.0} M/s |", rate * 1e-6);
        }
    }
    let _ = writeln!(text, "| memory, read and written by copies | {:.1} GB/s |", copied(&device, &queue)? * 1e-9);
    Ok(text)
}

/// Seconds of the best of some runs.
fn best(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    record: impl Fn(&mut wgpu::CommandEncoder),
) -> Result<f64, Box<dyn Error>> {
    let mut best = f64::INFINITY;
    for _ in 0..RUNS {
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        record(&mut encoder);
        let start = Instant::now();
        queue.submit([encoder.finish()]);
        device.poll(wgpu::PollType::wait_indefinitely())?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(best)
}

fn sampled(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    format: wgpu::TextureFormat,
    bytes: usize,
) -> Result<f64, Box<dyn Error>> {
    let edge = 16;
    let texture = device.create_texture_with_data(
        queue,
        &wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: edge, height: edge, depth_or_array_layers: edge },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D3,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        &vec![60u8; (edge * edge * edge) as usize * bytes],
    );
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(SHADER.replace("EACH", &format!("{EACH}u")).into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: None,
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    });
    let linear = wgpu::FilterMode::Linear;
    let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
        mag_filter: linear,
        min_filter: linear,
        ..Default::default()
    });
    let invocations = u64::from(64 * GROUPS * GROUPS);
    let sums = buffer(device, 4 * invocations, wgpu::BufferUsages::STORAGE);
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let resources =
        [wgpu::BindingResource::TextureView(&view), wgpu::BindingResource::Sampler(&sampler), sums.as_entire_binding()];
    let entries: Vec<_> = resources
        .into_iter()
        .enumerate()
        .map(|(i, resource)| wgpu::BindGroupEntry { binding: i as u32, resource })
        .collect();
    let layout = pipeline.get_bind_group_layout(0);
    let group =
        device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries });
    let seconds = best(device, queue, |encoder| {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.dispatch_workgroups(GROUPS, GROUPS, 1);
    })?;
    Ok((invocations * u64::from(EACH)) as f64 / seconds)
}

/// Bytes a second, those read and those written.
fn copied(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<f64, Box<dyn Error>> {
    let [from, to] = [wgpu::BufferUsages::COPY_SRC, wgpu::BufferUsages::COPY_DST].map(|u| buffer(device, COPIED, u));
    let seconds = best(device, queue, |encoder| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, COPIED))?;
    Ok(2.0 * COPIED as f64 / seconds)
}

fn buffer(device: &wgpu::Device, size: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
}
