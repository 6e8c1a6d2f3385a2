//! From the device's light to a frame.

use std::sync::Arc;

use ash::vk;
use volact_core::{ActionError, Frame, Viewport, mutated};
use volact_shaders::gpu::{CUT_FLAG, FLAGS, OVERLAP_FLAG, pack::Row};

use crate::{
    device::Gpu,
    memory::{Buffer, Place},
    resources::within,
    stream::{COPY_READ, COPY_WRITE, FRAGMENTS, HOST_READ, Recorder},
};

/// Bytes of a pixel's light: colour; then what is left, depth, state and number of samples.
const LIGHT: u64 = 32;

/// The state of a pixel over which pictures of their own were laid.
const LAID: f32 = 3.0;

const FLAG_BYTES: u64 = 4 * FLAGS as u64;

/// The buffers that a picture is drawn into, and one from which it is read.
#[derive(Debug)]
pub struct Target {
    /// See [`LIGHT`].
    pub light: Buffer,
    /// What went wrong.
    pub flags: Buffer,
    /// Differs from that of every other target there was.
    pub generation: u64,
    staging: Buffer,
    count: usize,
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
    /// Rays that took one.
    pub rays: u64,
}

impl Target {
    /// Buffers for that many pixels.
    ///
    /// # Errors
    /// If there is no memory, or the device cannot bind as much.
    pub fn new(gpu: &Arc<Gpu>, count: usize, generation: u64) -> Result<Self, ActionError> {
        use vk::BufferUsageFlags as U;
        let bytes = LIGHT * count as u64;
        within(gpu, "the picture", (bytes, 0))?;
        let usage = U::STORAGE_BUFFER | U::TRANSFER_SRC | U::TRANSFER_DST;
        Ok(Self {
            light: Buffer::new(gpu, "volact light", bytes, usage, Place::Device)?,
            flags: Buffer::new(gpu, "volact flags", FLAG_BYTES, usage, Place::Device)?,
            staging: Buffer::new(gpu, "volact picture", bytes + FLAG_BYTES, U::TRANSFER_DST, Place::Readback)?,
            generation,
            count,
        })
    }

    /// Pixels that there is room for.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        (self.light.size() + self.flags.size() + self.staging.size()) as usize
    }

    /// Makes that many pixels dark.
    pub fn clear(&self, record: &Recorder<'_>, count: usize) {
        record.clear(&self.light, LIGHT * count as u64);
        record.clear(&self.flags, FLAG_BYTES);
        record.barrier(COPY_WRITE, FRAGMENTS);
    }

    /// Has everything copied to where it is read.
    pub fn copy(&self, record: &Recorder<'_>, count: usize) {
        record.barrier(FRAGMENTS, COPY_READ);
        let bytes = LIGHT * count as u64;
        record.copy(&self.light, &self.staging, 0, bytes);
        record.copy(&self.flags, &self.staging, bytes, FLAG_BYTES);
        record.barrier(COPY_WRITE, HOST_READ);
    }

    /// Writes the viewport of a frame, once the device is done. `shift` is what depths on the device lack;
    /// `limits` are the rows of what the application has drawn, or one.
    pub fn read(&self, frame: &mut Frame, view: &Viewport, shift: f64, threshold: f32, limits: &[Row]) -> Counts {
        let bytes = self.staging.bytes();
        let count = view.width * view.height;
        let word = |i: usize| bytes.get(4 * i..4 * i + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_ne_bytes);
        let four = |i: usize| [0, 1, 2, 3].map(|c| f32::from_bits(word(4 * i + c)));
        let flag = |i: usize| word(8 * count + i);
        let shape = |i: usize| (flag(i) as usize).checked_sub(1);
        let (overrun, overlapping, cut) = (shape(0), shape(OVERLAP_FLAG), flag(CUT_FLAG) != 0);
        let mut counts = Counts { overrun, overlapping, cut, ..Counts::default() };
        for i in 0..count {
            let mut color = four(2 * i);
            let [mut left, mut depth, state, samples] = four(2 * i + 1);
            if state == 0.0 {
                (color, left, depth) = ([0.0; 4], 1.0, f32::INFINITY);
            }
            counts.samples += samples as u64;
            counts.rays += u64::from(samples > 0.0);
            // Where pictures of their own were laid over, what is behind is there already.
            if state != LAID
                && let Some([behind, place]) = limits.get(2 * i..2 * i + 2).and_then(|r| <[Row; 2]>::try_from(r).ok())
            {
                let behind = if mutated!("forgotten_backdrop") { [0.0; 4] } else { behind.map(f32::from_bits) };
                let rest = left * (1.0 - behind[3]);
                let wanted = 1.0 - threshold;
                if rest <= wanted && left > wanted {
                    depth = f32::from_bits(place[0]);
                }
                (0..4).for_each(|c| color[c] += left * behind[c]);
            }
            let to = (view.y + i / view.width) * frame.width + view.x + i % view.width;
            frame.color[to] = color;
            frame.depth[to] = (f64::from(depth) + shift) as f32;
        }
        counts
    }
}
