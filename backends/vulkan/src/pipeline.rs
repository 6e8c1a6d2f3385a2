//! Pipelines: SPIR-V from composed shaders, what is bound, and the cache on disk.

use std::{fs, io, path::PathBuf, sync::Arc};

use ash::vk;
use naga::back::spv;
use thiserror::Error;
use volact_shaders::gpu::Composition;

use crate::{
    device::{DeviceError, Gpu},
    memory::{Buffer, Image},
};

/// Bytes of a corner of a run's polygon.
pub const CORNER: u32 = 28;

/// Bindings of group 0 that shaders see as storage buffers.
pub const STORAGE: [u32; 5] = [2, 3, 4, 6, 8];

/// Why a module has no pipeline.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// naga could not write it.
    #[error("no SPIR-V: {why}")]
    Spirv {
        /// Why.
        why: String,
    },
    /// The device refused it.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// A pipeline with the layout of what it binds.
#[derive(Debug)]
pub struct Pipeline {
    gpu: Arc<Gpu>,
    raw: vk::Pipeline,
    layout: vk::PipelineLayout,
    groups: [vk::DescriptorSetLayout; 2],
    textures: u32,
}

/// What is bound for a pipeline.
#[derive(Debug)]
pub struct Bound {
    gpu: Arc<Gpu>,
    pool: vk::DescriptorPool,
    sets: Vec<vk::DescriptorSet>,
}

/// The sampler of all volumes.
#[derive(Debug)]
pub struct Sampler {
    gpu: Arc<Gpu>,
    raw: vk::Sampler,
}

/// Pipelines compiled before, kept on disk where a folder is given.
#[derive(Debug)]
pub struct Cache {
    gpu: Arc<Gpu>,
    raw: vk::PipelineCache,
    file: Option<PathBuf>,
}

/// The words of a module.
///
/// # Errors
/// If naga cannot write it.
fn words(composition: &Composition) -> Result<Vec<u32>, PipelineError> {
    let binding_map = composition.module.global_variables.iter().filter_map(|(_, v)| v.binding).map(|b| {
        let info = spv::BindingInfo { descriptor_set: b.group, binding: b.binding, binding_array_size: None };
        (b, info)
    });
    let policy = naga::proc::BoundsCheckPolicy::Restrict;
    let options = spv::Options {
        lang_version: (1, 3),
        // Vulkan's y points down in clip space, as pixels' does; polygons come in pixels.
        flags: spv::WriterFlags::empty(),
        binding_map: binding_map.collect(),
        bounds_check_policies: naga::proc::BoundsCheckPolicies {
            index: policy,
            buffer: policy,
            image_load: policy,
            binding_array: policy,
        },
        // Loops of shaders have a budget of their own, and those of the framework end.
        force_loop_bounding: false,
        ..spv::Options::default()
    };
    spv::write_vec(&composition.module, &composition.info, &options, None)
        .map_err(|error| PipelineError::Spirv { why: error.to_string() })
}

impl Pipeline {
    /// Compiles a composition of slabs.
    ///
    /// # Errors
    /// If it cannot be written as SPIR-V, or the device refuses it.
    pub fn new(gpu: &Arc<Gpu>, composition: &Composition, cache: &Cache) -> Result<Self, PipelineError> {
        let words = words(composition)?;
        let none = vk::DescriptorSetLayout::null();
        let mut made = Self {
            gpu: Arc::clone(gpu),
            raw: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            groups: [none; 2],
            textures: composition.layout.textures,
        };
        made.groups = [made.group(&frame_bindings())?, made.group(&volume_bindings(made.textures))?];
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&made.groups);
        // SAFETY: the sets' layouts are the device's.
        let layout = unsafe { gpu.device.create_pipeline_layout(&info, None) };
        made.layout = layout.map_err(gpu.failed("vkCreatePipelineLayout"))?;
        let info = vk::ShaderModuleCreateInfo::default().code(&words);
        // SAFETY: naga's validator has passed the module, and its writer's words are SPIR-V.
        let module = unsafe { gpu.device.create_shader_module(&info, None) };
        let module = module.map_err(gpu.failed("vkCreateShaderModule"))?;
        let compiled = made.compile(module, cache);
        // SAFETY: pipelines do not need their modules once they are made.
        unsafe { gpu.device.destroy_shader_module(module, None) };
        made.raw = compiled?;
        Ok(made)
    }

    fn group(&self, bindings: &[(u32, vk::DescriptorType)]) -> Result<vk::DescriptorSetLayout, DeviceError> {
        let binding = |(number, kind): &(u32, vk::DescriptorType)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(*number)
                .descriptor_type(*kind)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::FRAGMENT)
        };
        let bindings: Vec<_> = bindings.iter().map(binding).collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        // SAFETY: destroyed by `drop`.
        let made = unsafe { self.gpu.device.create_descriptor_set_layout(&info, None) };
        made.map_err(self.gpu.failed("vkCreateDescriptorSetLayout"))
    }

    fn compile(&self, module: vk::ShaderModule, cache: &Cache) -> Result<vk::Pipeline, DeviceError> {
        let stage = |stage, name| vk::PipelineShaderStageCreateInfo::default().stage(stage).module(module).name(name);
        let stages = [
            stage(vk::ShaderStageFlags::VERTEX, c"volact_corner"),
            stage(vk::ShaderStageFlags::FRAGMENT, c"volact_run"),
        ];
        let vertices = [vk::VertexInputBindingDescription { binding: 0, stride: CORNER, ..Default::default() }];
        let attribute =
            |location, format, offset| vk::VertexInputAttributeDescription { location, binding: 0, format, offset };
        let attributes = [
            attribute(0, vk::Format::R32G32_SFLOAT, 0),
            attribute(1, vk::Format::R32G32B32A32_SINT, 8),
            attribute(2, vk::Format::R32_SFLOAT, 24),
        ];
        let input = vk::PipelineVertexInputStateCreateInfo::default()
            .vertex_binding_descriptions(&vertices)
            .vertex_attribute_descriptions(&attributes);
        let assembly =
            vk::PipelineInputAssemblyStateCreateInfo::default().topology(vk::PrimitiveTopology::TRIANGLE_STRIP);
        let viewport = vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
        let raster = vk::PipelineRasterizationStateCreateInfo::default().line_width(1.0);
        let samples =
            vk::PipelineMultisampleStateCreateInfo::default().rasterization_samples(vk::SampleCountFlags::TYPE_1);
        let dynamic = [vk::DynamicState::VIEWPORT, vk::DynamicState::SCISSOR];
        let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&dynamic);
        let blend = vk::PipelineColorBlendStateCreateInfo::default();
        // No attachments: light is in a buffer.
        let mut rendering = vk::PipelineRenderingCreateInfo::default();
        let info = vk::GraphicsPipelineCreateInfo::default()
            .stages(&stages)
            .vertex_input_state(&input)
            .input_assembly_state(&assembly)
            .viewport_state(&viewport)
            .rasterization_state(&raster)
            .multisample_state(&samples)
            .color_blend_state(&blend)
            .dynamic_state(&dynamic)
            .layout(self.layout)
            .push_next(&mut rendering);
        // SAFETY: all that the description names is the device's and lives until the call returns.
        let made = unsafe { self.gpu.device.create_graphics_pipelines(cache.raw, &[info], None) };
        let pipelines = made.map_err(|(_, result)| self.gpu.failed("vkCreateGraphicsPipelines")(result))?;
        Ok(pipelines.first().copied().unwrap_or_default())
    }

    pub fn raw(&self) -> vk::Pipeline {
        self.raw
    }

    pub fn layout(&self) -> vk::PipelineLayout {
        self.layout
    }

    /// Binds the frame's buffers, in the order of their bindings, and images.
    ///
    /// # Errors
    /// If the device gives no more.
    pub fn bind(&self, buffers: [&Buffer; 7], sampler: &Sampler, images: &[&Image]) -> Result<Bound, DeviceError> {
        let gpu = &self.gpu;
        let bindings = frame_bindings().into_iter().chain(volume_bindings(self.textures));
        let size = |(_, ty)| vk::DescriptorPoolSize { ty, descriptor_count: 1 };
        let sizes: Vec<_> = bindings.map(size).collect();
        let info = vk::DescriptorPoolCreateInfo::default().max_sets(2).pool_sizes(&sizes);
        // SAFETY: destroyed by `Bound`'s drop, and the sets with it.
        let pool = unsafe { gpu.device.create_descriptor_pool(&info, None) };
        let pool = pool.map_err(gpu.failed("vkCreateDescriptorPool"))?;
        let mut bound = Bound { gpu: Arc::clone(gpu), pool, sets: Vec::new() };
        let info = vk::DescriptorSetAllocateInfo::default().descriptor_pool(pool).set_layouts(&self.groups);
        // SAFETY: the pool was made for these layouts.
        let sets = unsafe { gpu.device.allocate_descriptor_sets(&info) };
        bound.sets = sets.map_err(gpu.failed("vkAllocateDescriptorSets"))?;
        self.write(&bound.sets, buffers, sampler, images);
        Ok(bound)
    }

    fn write(&self, sets: &[vk::DescriptorSet], buffers: [&Buffer; 7], sampler: &Sampler, images: &[&Image]) {
        let buffer = |b: &&Buffer| [vk::DescriptorBufferInfo { buffer: b.raw(), offset: 0, range: vk::WHOLE_SIZE }];
        let buffers: Vec<_> = buffers.iter().map(buffer).collect();
        let sampler = [vk::DescriptorImageInfo { sampler: sampler.raw, ..Default::default() }];
        let image = |i: &&Image| {
            let image_layout = vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL;
            [vk::DescriptorImageInfo { image_view: i.view(), image_layout, ..Default::default() }]
        };
        let images: Vec<_> = images.iter().map(image).collect();
        let write = |set: usize, (binding, kind): (u32, vk::DescriptorType)| {
            vk::WriteDescriptorSet::default().dst_set(sets[set]).dst_binding(binding).descriptor_type(kind)
        };
        let mut writes: Vec<_> =
            frame_bindings().into_iter().zip(&buffers).map(|(b, info)| write(0, b).buffer_info(info)).collect();
        let of_volumes = volume_bindings(self.textures);
        writes.push(write(1, of_volumes[0]).image_info(&sampler));
        writes.extend(of_volumes[1..].iter().zip(&images).map(|(b, info)| write(1, *b).image_info(info)));
        // SAFETY: the sets are in no use yet, and what is written is the device's.
        unsafe { self.gpu.device.update_descriptor_sets(&writes, &[]) };
    }
}

fn frame_bindings() -> Vec<(u32, vk::DescriptorType)> {
    let storage = STORAGE.iter().map(|b| (*b, vk::DescriptorType::STORAGE_BUFFER));
    [0, 1].map(|b| (b, vk::DescriptorType::UNIFORM_BUFFER)).into_iter().chain(storage).collect()
}

fn volume_bindings(textures: u32) -> Vec<(u32, vk::DescriptorType)> {
    let images = (1..=textures).map(|b| (b, vk::DescriptorType::SAMPLED_IMAGE));
    std::iter::once((0, vk::DescriptorType::SAMPLER)).chain(images).collect()
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        // SAFETY: whoever drops it has waited for what uses it; all are the device's or null.
        unsafe {
            self.gpu.device.destroy_pipeline(self.raw, None);
            self.gpu.device.destroy_pipeline_layout(self.layout, None);
            self.groups.iter().for_each(|g| self.gpu.device.destroy_descriptor_set_layout(*g, None));
        }
    }
}

impl Bound {
    pub fn sets(&self) -> &[vk::DescriptorSet] {
        &self.sets
    }
}

impl Drop for Bound {
    fn drop(&mut self) {
        // SAFETY: whoever drops it has waited for what uses it.
        unsafe { self.gpu.device.destroy_descriptor_pool(self.pool, None) };
    }
}

impl Sampler {
    /// A sampler that interpolates.
    ///
    /// # Errors
    /// If the device gives no more.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self, DeviceError> {
        let edge = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        let info = vk::SamplerCreateInfo::default()
            .mag_filter(vk::Filter::LINEAR)
            .min_filter(vk::Filter::LINEAR)
            .address_mode_u(edge)
            .address_mode_v(edge)
            .address_mode_w(edge);
        // SAFETY: destroyed by `drop`.
        let raw = unsafe { gpu.device.create_sampler(&info, None) }.map_err(gpu.failed("vkCreateSampler"))?;
        Ok(Self { gpu: Arc::clone(gpu), raw })
    }
}

impl Drop for Sampler {
    fn drop(&mut self) {
        // SAFETY: whoever drops it has waited for what uses it.
        unsafe { self.gpu.device.destroy_sampler(self.raw, None) };
    }
}

impl Cache {
    /// The cache of this device in a folder, which is made where it is not there; without one nothing is
    /// kept. A file that is not this device's is left aside.
    ///
    /// # Errors
    /// If the device gives no more.
    pub fn new(gpu: &Arc<Gpu>, folder: Option<PathBuf>) -> Result<Self, DeviceError> {
        let id: String = gpu.properties.pipeline_cache_uuid.iter().map(|b| format!("{b:02x}")).collect();
        let file = folder.map(|f| f.join(format!("volact-vulkan-{id}.bin")));
        let held = file.as_ref().and_then(|f| fs::read(f).ok()).filter(|bytes| own(gpu, bytes)).unwrap_or_default();
        let info = vk::PipelineCacheCreateInfo::default().initial_data(&held);
        // SAFETY: the bytes begin with the header of this device and driver; destroyed by `drop`.
        let raw = unsafe { gpu.device.create_pipeline_cache(&info, None) };
        let raw = raw.map_err(gpu.failed("vkCreatePipelineCache"))?;
        Ok(Self { gpu: Arc::clone(gpu), raw, file })
    }

    /// Writes what was compiled, if a folder was given.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self) -> io::Result<()> {
        let Some(file) = &self.file else { return Ok(()) };
        // SAFETY: the cache is the device's.
        let bytes = unsafe { self.gpu.device.get_pipeline_cache_data(self.raw) }.map_err(io::Error::other)?;
        if let Some(folder) = file.parent() {
            fs::create_dir_all(folder)?;
        }
        let unfinished = file.with_extension(format!("{}.part", std::process::id()));
        fs::write(&unfinished, bytes)?;
        fs::rename(&unfinished, file)
    }
}

impl Drop for Cache {
    fn drop(&mut self) {
        // SAFETY: nothing is being compiled.
        unsafe { self.gpu.device.destroy_pipeline_cache(self.raw, None) };
    }
}

/// Whether a cache's header (`VkPipelineCacheHeaderVersionOne`) is that of this device.
fn own(gpu: &Gpu, bytes: &[u8]) -> bool {
    let word = |i: usize| bytes.get(4 * i..4 * i + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    let wanted =
        [32, vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32, gpu.properties.vendor_id, gpu.properties.device_id];
    wanted.iter().enumerate().all(|(i, w)| word(i) == Some(*w))
        && bytes.get(16..32) == Some(&gpu.properties.pipeline_cache_uuid)
}
