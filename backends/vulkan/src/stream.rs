//! Recording commands, handing them to a queue, and waiting.

use std::sync::Arc;

use ash::vk;
use volact_shaders::gpu::runs::Polygon;

use crate::{
    device::{DeviceError, Gpu, Queue},
    memory::{Buffer, Image, whole},
    pipeline::{Bound, Pipeline},
};

/// Commands in flight at a time.
pub const SLOTS: usize = 2;

/// A queue with commands and a timeline that counts submissions.
#[derive(Debug)]
pub struct Stream {
    gpu: Arc<Gpu>,
    queue: Queue,
    pool: vk::CommandPool,
    semaphore: vk::Semaphore,
    /// Commands, with the submission that used them last.
    slots: Vec<(vk::CommandBuffer, u64)>,
    last: u64,
}

/// A submission of a stream: when it is done, what it wrote is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Point {
    semaphore: vk::Semaphore,
    value: u64,
}

/// Records commands. What they name has to live until they are done.
#[derive(Debug)]
pub struct Recorder<'a> {
    gpu: &'a Gpu,
    commands: vk::CommandBuffer,
}

/// Who wrote, and who reads: stages with their accesses.
pub type Access = (vk::PipelineStageFlags2, vk::AccessFlags2);

pub const COPY_WRITE: Access = (vk::PipelineStageFlags2::ALL_TRANSFER, vk::AccessFlags2::TRANSFER_WRITE);
pub const COPY_READ: Access = (vk::PipelineStageFlags2::ALL_TRANSFER, vk::AccessFlags2::TRANSFER_READ);
pub const HOST_READ: Access = (vk::PipelineStageFlags2::HOST, vk::AccessFlags2::HOST_READ);
const STORAGE: vk::AccessFlags2 = vk::AccessFlags2::from_raw(
    vk::AccessFlags2::SHADER_STORAGE_READ.as_raw() | vk::AccessFlags2::SHADER_STORAGE_WRITE.as_raw(),
);
pub const FRAGMENTS: Access = (vk::PipelineStageFlags2::FRAGMENT_SHADER, STORAGE);

impl Stream {
    /// A stream of a queue.
    ///
    /// # Errors
    /// If the device gives nothing more.
    pub fn new(gpu: &Arc<Gpu>, queue: Queue) -> Result<Self, DeviceError> {
        let (pool, semaphore) = (vk::CommandPool::null(), vk::Semaphore::null());
        let mut made = Self { gpu: Arc::clone(gpu), queue, pool, semaphore, slots: Vec::new(), last: 0 };
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(queue.family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        let mut timeline = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
        let semaphore = vk::SemaphoreCreateInfo::default().push_next(&mut timeline);
        // SAFETY: the family is the device's; pool and semaphore are destroyed by `drop`.
        unsafe {
            made.pool = gpu.device.create_command_pool(&info, None).map_err(gpu.failed("vkCreateCommandPool"))?;
            made.semaphore = gpu.device.create_semaphore(&semaphore, None).map_err(gpu.failed("vkCreateSemaphore"))?;
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(made.pool).command_buffer_count(SLOTS as u32);
            let buffers = gpu.device.allocate_command_buffers(&info).map_err(gpu.failed("vkAllocateCommandBuffers"))?;
            made.slots = buffers.into_iter().map(|b| (b, 0)).collect();
        }
        Ok(made)
    }

    /// The slot that is used next, once what it was used for is done.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn next_slot(&self) -> Result<usize, DeviceError> {
        let slot = self.last as usize % SLOTS;
        self.wait_for(self.slots[slot].1)?;
        Ok(slot)
    }

    /// Records commands and hands them over, to begin after `after`.
    ///
    /// # Errors
    /// If the device is lost or out of memory.
    pub fn submit(&mut self, after: Option<Point>, record: impl FnOnce(&Recorder<'_>)) -> Result<Point, DeviceError> {
        let slot = self.next_slot()?;
        let (gpu, commands) = (&self.gpu, self.slots[slot].0);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: `next_slot` has waited for the last use of these commands.
        unsafe { gpu.device.begin_command_buffer(commands, &begin) }.map_err(gpu.failed("vkBeginCommandBuffer"))?;
        record(&Recorder { gpu, commands });
        // SAFETY: recording began above.
        unsafe { gpu.device.end_command_buffer(commands) }.map_err(gpu.failed("vkEndCommandBuffer"))?;
        let point = Point { semaphore: self.semaphore, value: self.last + 1 };
        let info = |p: &Point| {
            vk::SemaphoreSubmitInfo::default()
                .semaphore(p.semaphore)
                .value(p.value)
                .stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
        };
        let waits: Vec<_> = after.iter().map(info).collect();
        let signals = [info(&point)];
        let commands = [vk::CommandBufferSubmitInfo::default().command_buffer(commands)];
        let submission = vk::SubmitInfo2::default()
            .wait_semaphore_infos(&waits)
            .command_buffer_infos(&commands)
            .signal_semaphore_infos(&signals);
        // SAFETY: queues are used by one thread at a time, since actions are; all else lives until done.
        let sent = unsafe { gpu.device.queue_submit2(self.queue.raw, &[submission], vk::Fence::null()) };
        sent.map_err(gpu.failed("vkQueueSubmit2"))?;
        self.last += 1;
        self.slots[slot].1 = self.last;
        Ok(point)
    }

    /// Waits until everything handed over is done.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn wait(&self) -> Result<(), DeviceError> {
        self.wait_for(self.last)
    }

    fn wait_for(&self, value: u64) -> Result<(), DeviceError> {
        let (semaphores, values) = ([self.semaphore], [value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is this stream's timeline, and a submission will reach the value or has.
        let waited = unsafe { self.gpu.device.wait_semaphores(&info, u64::MAX) };
        waited.map_err(self.gpu.failed("vkWaitSemaphores"))
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        if self.wait().is_err() {
            log::warn!("vulkan: {} did not finish", self.gpu.name());
        }
        // SAFETY: nothing is in flight any more; both are the device's or null. Mesa's threads (22.3) still
        // touch a timeline just after they have signalled it, so that waiting for it is not enough: what is
        // handed to the queue after that comes after they are done with it.
        unsafe {
            _ = self.gpu.device.queue_wait_idle(self.queue.raw);
            self.gpu.device.destroy_semaphore(self.semaphore, None);
            self.gpu.device.destroy_command_pool(self.pool, None);
        }
    }
}

impl Recorder<'_> {
    /// What is written before is seen after.
    pub fn barrier(&self, before: Access, after: Access) {
        let barriers = [vk::MemoryBarrier2::default()
            .src_stage_mask(before.0)
            .src_access_mask(before.1)
            .dst_stage_mask(after.0)
            .dst_access_mask(after.1)];
        let info = vk::DependencyInfo::default().memory_barriers(&barriers);
        // SAFETY: recording, outside of rendering.
        unsafe { self.gpu.device.cmd_pipeline_barrier2(self.commands, &info) };
    }

    /// Makes an image ready to be written, whatever it held; or, after that, to be sampled by whoever
    /// waits for this submission.
    pub fn transition(&self, image: &Image, to_be_sampled: bool) {
        let barrier = vk::ImageMemoryBarrier2::default()
            .image(image.raw())
            .subresource_range(whole())
            .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
            .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED);
        let barrier = if to_be_sampled {
            barrier
                .src_stage_mask(COPY_WRITE.0)
                .src_access_mask(COPY_WRITE.1)
                .dst_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
                .dst_access_mask(vk::AccessFlags2::MEMORY_READ)
                .old_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
                .new_layout(vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL)
        } else {
            barrier
                .src_stage_mask(vk::PipelineStageFlags2::ALL_COMMANDS)
                .dst_stage_mask(COPY_WRITE.0)
                .dst_access_mask(COPY_WRITE.1)
                .old_layout(vk::ImageLayout::UNDEFINED)
                .new_layout(vk::ImageLayout::TRANSFER_DST_OPTIMAL)
        };
        let barriers = [barrier];
        let info = vk::DependencyInfo::default().image_memory_barriers(&barriers);
        // SAFETY: recording, outside of rendering; the image is the device's.
        unsafe { self.gpu.device.cmd_pipeline_barrier2(self.commands, &info) };
    }

    /// Copies the beginning of a buffer to whole slices of an image.
    pub fn fill_slices(&self, from: &Buffer, to: &Image, slices: std::ops::Range<usize>) {
        let layers = vk::ImageSubresourceLayers::default().aspect_mask(vk::ImageAspectFlags::COLOR).layer_count(1);
        let region = vk::BufferImageCopy::default()
            .image_subresource(layers)
            .image_offset(vk::Offset3D { x: 0, y: 0, z: slices.start as i32 })
            .image_extent(vk::Extent3D { depth: slices.len() as u32, ..to.extent() });
        let layout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
        // SAFETY: recording, outside of rendering; the image was made ready to be written.
        unsafe { self.gpu.device.cmd_copy_buffer_to_image(self.commands, from.raw(), to.raw(), layout, &[region]) };
    }

    /// Writes zeros to the first bytes of a buffer.
    pub fn clear(&self, buffer: &Buffer, bytes: u64) {
        // SAFETY: recording, outside of rendering.
        unsafe { self.gpu.device.cmd_fill_buffer(self.commands, buffer.raw(), 0, bytes.min(buffer.size()), 0) };
    }

    /// Copies the first bytes of a buffer to a place in another.
    pub fn copy(&self, from: &Buffer, to: &Buffer, place: u64, bytes: u64) {
        let region = vk::BufferCopy::default().dst_offset(place).size(bytes);
        // SAFETY: recording, outside of rendering; both hold as much.
        unsafe { self.gpu.device.cmd_copy_buffer(self.commands, from.raw(), to.raw(), &[region]) };
    }

    /// Draws runs one after another, each seeing what the one before has written.
    pub fn draw(&self, pipeline: &Pipeline, bound: &Bound, vertices: &Buffer, size: [u32; 2], runs: &[Polygon]) {
        let (device, commands) = (&self.gpu.device, self.commands);
        let area =
            vk::Rect2D { offset: vk::Offset2D::default(), extent: vk::Extent2D { width: size[0], height: size[1] } };
        let viewport =
            vk::Viewport { width: size[0] as f32, height: size[1] as f32, max_depth: 1.0, ..Default::default() };
        let rendering = vk::RenderingInfo::default().render_area(area).layer_count(1);
        // SAFETY: recording; pipeline, sets and vertices are the device's, and each polygon lies within the
        // vertices.
        unsafe {
            device.cmd_bind_pipeline(commands, vk::PipelineBindPoint::GRAPHICS, pipeline.raw());
            device.cmd_set_viewport(commands, 0, &[viewport]);
            device.cmd_set_scissor(commands, 0, &[area]);
            let point = vk::PipelineBindPoint::GRAPHICS;
            device.cmd_bind_descriptor_sets(commands, point, pipeline.layout(), 0, bound.sets(), &[]);
            device.cmd_bind_vertex_buffers(commands, 0, &[vertices.raw()], &[0]);
            for polygon in runs {
                device.cmd_begin_rendering(commands, &rendering);
                device.cmd_draw(commands, polygon.count, 1, polygon.first, 0);
                device.cmd_end_rendering(commands);
                self.barrier(FRAGMENTS, FRAGMENTS);
            }
        }
    }
}
