//! From the device's pixels to a frame.

use volact_core::{Frame, Viewport};
use volact_shaders::gpu::{COUNTERS, CUT_FLAG, FLAGS, OVERLAP_FLAG};

use crate::{
    bands::Band,
    device::{DeviceError, Gpu},
};

/// The buffers that a band of a picture is drawn into, and one from which the whole is read.
#[derive(Debug)]
pub struct Target {
    /// Premultiplied colours, 16 bytes a pixel.
    pub pixels: wgpu::Buffer,
    /// Depths, 4 bytes a pixel.
    pub depths: wgpu::Buffer,
    /// What went wrong, and counts.
    pub flags: wgpu::Buffer,
    /// Differs from that of every other target there was.
    pub generation: u64,
    staging: wgpu::Buffer,
    timer: Option<Timer>,
    /// Pixels of the whole picture, and of a band.
    count: usize,
    room: usize,
}

/// When the passes of a picture began and ended: timestamps of its first pass and of its last.
#[derive(Clone, Copy, Debug)]
pub struct Times<'a> {
    queries: Option<&'a wgpu::QuerySet>,
    first: bool,
    last: bool,
}

impl<'a> Times<'a> {
    fn writes(&self, begins: bool, ends: bool) -> Option<(&'a wgpu::QuerySet, Option<u32>, Option<u32>)> {
        let (begin, end) = ((begins && self.first).then_some(0), (ends && self.last).then_some(1));
        self.queries.filter(|_| begin.is_some() || end.is_some()).map(|queries| (queries, begin, end))
    }

    /// Of a compute pass that begins or ends a band.
    pub fn compute(&self, begins: bool, ends: bool) -> Option<wgpu::ComputePassTimestampWrites<'a>> {
        let (query_set, beginning_of_pass_write_index, end_of_pass_write_index) = self.writes(begins, ends)?;
        Some(wgpu::ComputePassTimestampWrites { query_set, beginning_of_pass_write_index, end_of_pass_write_index })
    }

    /// Of a render pass that may begin a band.
    pub fn render(&self, begins: bool) -> Option<wgpu::RenderPassTimestampWrites<'a>> {
        let (query_set, beginning_of_pass_write_index, end_of_pass_write_index) = self.writes(begins, false)?;
        Some(wgpu::RenderPassTimestampWrites { query_set, beginning_of_pass_write_index, end_of_pass_write_index })
    }
}

/// Counts the device's time.
#[derive(Debug)]
struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    /// Nanoseconds of one tick.
    period: f64,
}

/// What a picture cost, and what went wrong.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// The shape whose loop overran its budget.
    pub overrun: Option<usize>,
    /// The shape whose cells carry numbers and overlap.
    pub overlapping: Option<usize>,
    /// Whether the device has cut a loop short.
    pub cut: bool,
    /// Samples.
    pub samples: u64,
    /// Samples known to be empty without having been taken.
    pub skipped: u64,
    /// Rays that took one, or skipped some.
    pub rays: u64,
    /// Seconds on the device, where it counts them.
    pub seconds: Option<f64>,
}

const FLAG_BYTES: u64 = 4 * FLAGS as u64;
/// Bytes of two timestamps; copies go by multiples of 8.
const TIME_BYTES: u64 = 16;

impl Target {
    /// Buffers for the pixels of bands, `room` of them, and of the whole picture.
    pub fn new(gpu: &Gpu, (room, count): (usize, usize), generation: u64) -> Self {
        use wgpu::BufferUsages as U;
        let buffer = |label, size, usage| {
            let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
            gpu.device.create_buffer(&descriptor)
        };
        let pixels = room as u64;
        let timer = gpu.has(wgpu::Features::TIMESTAMP_QUERY).then(|| Timer {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("volact time"),
                ty: wgpu::QueryType::Timestamp,
                count: 2,
            }),
            resolved: buffer("volact time", TIME_BYTES, U::QUERY_RESOLVE | U::COPY_SRC),
            period: f64::from(gpu.queue.get_timestamp_period()),
        });
        Self {
            pixels: buffer("volact pixels", 16 * pixels, U::STORAGE | U::COPY_SRC),
            depths: buffer("volact depths", 4 * pixels, U::STORAGE | U::COPY_SRC),
            flags: buffer("volact flags", FLAG_BYTES, U::STORAGE | U::COPY_SRC | U::COPY_DST),
            staging: buffer("volact staging", Self::staged(count), U::MAP_READ | U::COPY_DST),
            timer,
            count,
            room,
            generation,
        }
    }

    /// Whether there is room for bands of so many pixels, and for that many altogether.
    pub fn holds(&self, room: usize, count: usize) -> bool {
        self.room >= room && self.count >= count
    }

    /// Bytes on the device, with those from which the host reads.
    pub fn bytes(&self) -> usize {
        20 * self.room + Self::staged(self.count) as usize + FLAG_BYTES as usize
    }

    fn staged(count: usize) -> u64 {
        (20 * count as u64).next_multiple_of(8) + FLAG_BYTES.next_multiple_of(8) + TIME_BYTES
    }

    /// The timestamps of a band that is the first, the last, or both.
    pub fn times(&self, first: bool, last: bool) -> Times<'_> {
        Times { queries: self.timer.as_ref().map(|timer| &timer.queries), first, last }
    }

    /// Has a band of the viewport copied to where it is read.
    pub fn copy_band(&self, encoder: &mut wgpu::CommandEncoder, viewport: &Viewport, band: Band) {
        let [first, n] = [band.first, band.rows].map(|rows| (rows * viewport.width) as u64);
        let count = (viewport.width * viewport.height) as u64;
        encoder.copy_buffer_to_buffer(&self.pixels, 0, &self.staging, 16 * first, 16 * n);
        encoder.copy_buffer_to_buffer(&self.depths, 0, &self.staging, 16 * count + 4 * first, 4 * n);
    }

    /// Has what went wrong and counts copied, behind that many pixels.
    pub fn copy_counts(&self, encoder: &mut wgpu::CommandEncoder, count: usize) {
        let at = (20 * count as u64).next_multiple_of(8);
        encoder.copy_buffer_to_buffer(&self.flags, 0, &self.staging, at, FLAG_BYTES);
        if let Some(timer) = &self.timer {
            encoder.resolve_query_set(&timer.queries, 0..2, &timer.resolved, 0);
            let at = at + FLAG_BYTES.next_multiple_of(8);
            encoder.copy_buffer_to_buffer(&timer.resolved, 0, &self.staging, at, TIME_BYTES);
        }
    }

    /// Waits for the device and writes the viewport of a frame. `shift` is what depths on the device
    /// lack.
    ///
    /// # Errors
    /// If the device fails.
    pub fn read(&self, gpu: &Gpu, frame: &mut Frame, view: &Viewport, shift: f64) -> Result<Counts, DeviceError> {
        let count = view.width * view.height;
        self.mapped(gpu, count, |bytes| {
            let colors: &[[f32; 4]] = bytemuck::cast_slice(&bytes[..16 * count]);
            let depths: &[f32] = bytemuck::cast_slice(&bytes[16 * count..20 * count]);
            let width = frame.width;
            for y in 0..view.height {
                let to = (view.y + y) * width + view.x..(view.y + y) * width + view.x + view.width;
                let from = y * view.width..(y + 1) * view.width;
                frame.color[to.clone()].copy_from_slice(&colors[from.clone()]);
                for (to, from) in frame.depth[to].iter_mut().zip(&depths[from]) {
                    *to = (f64::from(*from) + shift) as f32;
                }
            }
        })
    }

    /// Waits for the device; the picture stays there.
    ///
    /// # Errors
    /// If the device fails.
    pub fn wait(&self, gpu: &Gpu) -> Result<Counts, DeviceError> {
        self.mapped(gpu, 0, |_| {})
    }

    /// Waits, shows what was copied for so many pixels, and counts.
    fn mapped(&self, gpu: &Gpu, count: usize, mut show: impl FnMut(&[u8])) -> Result<Counts, DeviceError> {
        let failed = |why: String| DeviceError::Failed { adapter: gpu.name().into(), why };
        let slice = self.staging.slice(0..Self::staged(count));
        let (tell, told) = std::sync::mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| _ = tell.send(result));
        let waited = gpu.device.poll(wgpu::PollType::Wait { submission_index: None, timeout: None });
        gpu.check()?;
        waited.map_err(|error| failed(error.to_string()))?;
        let mapped = told.recv().map_err(|error| failed(error.to_string()))?;
        mapped.map_err(|error| failed(error.to_string()))?;
        let bytes = slice.get_mapped_range().map_err(|error| failed(error.to_string()))?;
        let counts = self.counts(&bytes[(20 * count).next_multiple_of(8)..]);
        show(&bytes);
        drop(bytes);
        self.staging.unmap();
        Ok(counts)
    }

    fn counts(&self, bytes: &[u8]) -> Counts {
        let word = |i: usize| u32::from_ne_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]);
        let sum = |first: usize| (first..first + COUNTERS).map(|i| u64::from(word(i))).sum();
        let time = FLAG_BYTES.next_multiple_of(8) as usize / 4;
        let tick = |i: usize| u64::from(word(time + 2 * i)) | u64::from(word(time + 2 * i + 1)) << 32;
        let seconds = |timer: &Timer| tick(1).saturating_sub(tick(0)) as f64 * timer.period * 1e-9;
        Counts {
            overrun: (word(0) as usize).checked_sub(1),
            overlapping: (word(OVERLAP_FLAG) as usize).checked_sub(1),
            cut: word(CUT_FLAG) != 0,
            samples: sum(1),
            rays: sum(1 + COUNTERS),
            skipped: sum(CUT_FLAG + 1),
            seconds: self.timer.as_ref().map(seconds),
        }
    }
}
