//! Buffers and images with their memory.

use std::sync::Arc;

use ash::vk;
use gpu_allocator::{
    MemoryLocation,
    vulkan::{Allocation, AllocationCreateDesc, AllocationScheme},
};

use crate::device::{DeviceError, Gpu};

/// A buffer, freed when it is dropped. Its user makes sure that the device is done with it.
#[derive(Debug)]
pub struct Buffer {
    gpu: Arc<Gpu>,
    raw: vk::Buffer,
    allocation: Option<Allocation>,
    size: u64,
}

/// An image in three dimensions with its view, freed when it is dropped, as buffers are.
#[derive(Debug)]
pub struct Image {
    gpu: Arc<Gpu>,
    raw: vk::Image,
    view: vk::ImageView,
    allocation: Option<Allocation>,
    extent: vk::Extent3D,
}

/// Where memory lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// On the device.
    Device,
    /// Where the host writes and the device reads.
    Upload,
    /// Where the device writes and the host reads.
    Readback,
}

impl Place {
    fn location(self) -> MemoryLocation {
        match self {
            Self::Device => MemoryLocation::GpuOnly,
            Self::Upload => MemoryLocation::CpuToGpu,
            Self::Readback => MemoryLocation::GpuToCpu,
        }
    }
}

/// Takes memory.
fn allocate(
    gpu: &Gpu,
    what: &str,
    requirements: vk::MemoryRequirements,
    place: Place,
    linear: bool,
) -> Result<Allocation, DeviceError> {
    let description = AllocationCreateDesc {
        name: what,
        requirements,
        location: place.location(),
        linear,
        allocation_scheme: AllocationScheme::GpuAllocatorManaged,
    };
    let refused = |why: String| DeviceError::Memory {
        adapter: gpu.name().into(),
        what: what.into(),
        bytes: requirements.size,
        why,
    };
    let made = gpu.allocator(|a| a.allocate(&description)).ok_or_else(|| refused("there is no allocator".into()))?;
    made.map_err(|error| refused(error.to_string()))
}

fn free(gpu: &Gpu, allocation: &mut Option<Allocation>) {
    if let Some(allocation) = allocation.take()
        && let Some(Err(error)) = gpu.allocator(|a| a.free(allocation))
    {
        log::warn!("vulkan: memory could not be freed: {error}");
    }
}

impl Buffer {
    /// A buffer of so many bytes, at least 16.
    ///
    /// # Errors
    /// If there is no memory.
    pub fn new(
        gpu: &Arc<Gpu>,
        what: &str,
        size: u64,
        usage: vk::BufferUsageFlags,
        place: Place,
    ) -> Result<Self, DeviceError> {
        let size = size.max(16);
        let families = gpu.families();
        let mut info = vk::BufferCreateInfo::default().size(size).usage(usage);
        if families.len() > 1 {
            info = info.sharing_mode(vk::SharingMode::CONCURRENT).queue_family_indices(&families);
        }
        // SAFETY: the families are the device's; the buffer is destroyed by `drop`.
        let raw = unsafe { gpu.device.create_buffer(&info, None) }.map_err(gpu.failed("vkCreateBuffer"))?;
        let mut made = Self { gpu: Arc::clone(gpu), raw, allocation: None, size };
        // SAFETY: the buffer is the device's.
        let requirements = unsafe { gpu.device.get_buffer_memory_requirements(raw) };
        let allocation = allocate(gpu, what, requirements, place, true)?;
        // SAFETY: the memory was allocated for this buffer, which has none yet; it is freed after it.
        let bound = unsafe { gpu.device.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) };
        made.allocation = Some(allocation);
        bound.map_err(gpu.failed("vkBindBufferMemory"))?;
        Ok(made)
    }

    pub fn raw(&self) -> vk::Buffer {
        self.raw
    }

    pub fn size(&self) -> u64 {
        self.size
    }

    /// Writes bytes where the host can; what reaches beyond is left out. The device must not be reading.
    pub fn write(&mut self, offset: usize, bytes: &[u8]) {
        let mapped = self.allocation.as_mut().and_then(Allocation::mapped_slice_mut);
        if let Some(to) = mapped.and_then(|all| all.get_mut(offset..)) {
            let count = to.len().min(bytes.len());
            to[..count].copy_from_slice(&bytes[..count]);
        }
    }

    /// The bytes, where the host can read them.
    pub fn bytes(&self) -> &[u8] {
        let mapped = self.allocation.as_ref().and_then(Allocation::mapped_slice).unwrap_or_default();
        &mapped[..mapped.len().min(self.size as usize)]
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: the buffer is the device's, and whoever drops it has waited for what uses it.
        unsafe { self.gpu.device.destroy_buffer(self.raw, None) };
        free(&self.gpu, &mut self.allocation);
    }
}

impl Image {
    /// An image that is filled by copies and sampled.
    ///
    /// # Errors
    /// If there is no memory.
    pub fn new(gpu: &Arc<Gpu>, what: &str, format: vk::Format, extent: vk::Extent3D) -> Result<Self, DeviceError> {
        let families = gpu.families();
        let mut info = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_3D)
            .format(format)
            .extent(extent)
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::TRANSFER_DST);
        if families.len() > 1 {
            info = info.sharing_mode(vk::SharingMode::CONCURRENT).queue_family_indices(&families);
        }
        // SAFETY: format and extent were checked against the device; the image is destroyed by `drop`.
        let raw = unsafe { gpu.device.create_image(&info, None) }.map_err(gpu.failed("vkCreateImage"))?;
        let mut made = Self { gpu: Arc::clone(gpu), raw, view: vk::ImageView::null(), allocation: None, extent };
        // SAFETY: the image is the device's.
        let requirements = unsafe { gpu.device.get_image_memory_requirements(raw) };
        let allocation = allocate(gpu, what, requirements, Place::Device, false)?;
        // SAFETY: the memory was allocated for this image, which has none yet; it is freed after it.
        let bound = unsafe { gpu.device.bind_image_memory(raw, allocation.memory(), allocation.offset()) };
        made.allocation = Some(allocation);
        bound.map_err(gpu.failed("vkBindImageMemory"))?;
        let view = vk::ImageViewCreateInfo::default()
            .image(raw)
            .view_type(vk::ImageViewType::TYPE_3D)
            .format(format)
            .subresource_range(whole());
        // SAFETY: the image has its memory, and the format is its own.
        made.view = unsafe { gpu.device.create_image_view(&view, None) }.map_err(gpu.failed("vkCreateImageView"))?;
        Ok(made)
    }

    pub fn raw(&self) -> vk::Image {
        self.raw
    }

    pub fn view(&self) -> vk::ImageView {
        self.view
    }

    pub fn extent(&self) -> vk::Extent3D {
        self.extent
    }
}

/// All of an image's colour.
pub fn whole() -> vk::ImageSubresourceRange {
    vk::ImageSubresourceRange::default().aspect_mask(vk::ImageAspectFlags::COLOR).level_count(1).layer_count(1)
}

impl Drop for Image {
    fn drop(&mut self) {
        // SAFETY: view and image are the device's or null, and whoever drops them has waited for what uses
        // them.
        unsafe {
            self.gpu.device.destroy_image_view(self.view, None);
            self.gpu.device.destroy_image(self.raw, None);
        }
        free(&self.gpu, &mut self.allocation);
    }
}
