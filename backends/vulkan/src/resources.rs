//! What the device holds from frame to frame: volumes as images, and rows of numbers.

use std::{collections::BTreeMap, sync::Arc};

use ash::vk;
use volact_core::{ActionError, ParameterValue, Volume, frame::Rebuild, mutated, resolve::ResolvedShape};
use volact_shaders::gpu::{
    pack::Row,
    voxels::{Encoding, Texel, Wanted},
};

use crate::{
    check::{NAME, limit},
    device::{DeviceError, Gpu},
    memory::{Buffer, Image, Place},
    options::Settings,
    stream::{Point, SLOTS, Stream},
};

/// Bytes of voxels that are handed over at a time.
const SLAB: usize = 16 << 20;

/// Volumes on the device, filled by the queue that moves data.
#[derive(Debug)]
pub struct Volumes {
    held: BTreeMap<u64, Held>,
    stream: Stream,
    staging: [Option<Buffer>; SLOTS],
    /// When all that was handed over is there.
    arrived: Option<Point>,
    /// Counts images made.
    generation: u64,
}

/// One volume.
#[derive(Debug)]
pub struct Held {
    pub encoding: Encoding,
    pub image: Image,
    /// Whether the device's sampler may interpolate it.
    pub filterable: bool,
    /// Differs from that of every other image there was.
    pub generation: u64,
    wanted: Wanted,
    version: u64,
    bytes: usize,
}

impl Volumes {
    /// No volumes yet.
    ///
    /// # Errors
    /// If the device gives no more.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Self, DeviceError> {
        let stream = Stream::new(gpu, gpu.transfer)?;
        Ok(Self { held: BTreeMap::new(), stream, staging: [None, None], arrived: None, generation: 0 })
    }

    /// Brings all volumes of a shape on their way to the device, unless they are there; gives the bytes that
    /// are moved. Does not wait: who draws begins after [`arrived`](Self::arrived).
    ///
    /// # Errors
    /// If a volume is larger than an image can be, or has no place in the format asked for.
    pub fn prepare(
        &mut self,
        gpu: &Arc<Gpu>,
        shape: &ResolvedShape,
        settings: &Settings,
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<usize, ActionError> {
        let mut moved = 0;
        for value in shape.parameters.values() {
            let ParameterValue::Volume(texture) = value else { continue };
            let volume = texture.volume();
            let held = self.held.get(&volume.id()).filter(|h| h.wanted == settings.format);
            if held.is_some_and(|h| h.version == volume.version() || mutated!("stale_data")) {
                continue;
            }
            let bytes = self.fetch(gpu, shape, volume, settings.format)?;
            rebuilt.push(Rebuild { shape: shape.name.clone(), what: "texture".into(), bytes });
            moved += bytes;
        }
        Ok(moved)
    }

    fn fetch(
        &mut self,
        gpu: &Arc<Gpu>,
        shape: &ResolvedShape,
        volume: &Volume,
        wanted: Wanted,
    ) -> Result<usize, ActionError> {
        let unorm16 = gpu.samples(vk::Format::R16_UNORM, false) && gpu.samples(vk::Format::R16G16B16A16_UNORM, false);
        let encoding = Encoding::new(volume, wanted, unorm16);
        let format = format(&encoding);
        check(gpu, shape, volume, &encoding, format)?;
        let fits = |h: &Held| h.encoding.texel == encoding.texel && h.encoding.channels == encoding.channels;
        let earlier = self.held.remove(&volume.id());
        if earlier.as_ref().is_some_and(|h| !fits(h)) {
            // It may still be on its way.
            self.stream.wait()?;
        }
        let mut held = match earlier.filter(fits) {
            Some(held) => held,
            None => {
                self.generation += 1;
                let [width, height, depth] = volume.dims().map(|n| n as u32);
                let image = Image::new(gpu, volume.name(), format, vk::Extent3D { width, height, depth })?;
                let filterable = gpu.samples(format, true);
                let bytes = volume.desc().samples().unwrap_or(0) * encoding.sample_bytes();
                Held { encoding, image, filterable, generation: self.generation, wanted, version: 0, bytes }
            }
        };
        (held.encoding, held.wanted, held.version) = (encoding, wanted, volume.version());
        let moved = self.upload(gpu, volume, &held);
        // Kept in any case: it may be in flight.
        if moved.is_err() {
            held.version = 0;
        }
        self.held.insert(volume.id(), held);
        Ok(moved?)
    }

    /// Moves all voxels, some slices at a time so that little is held twice.
    fn upload(&mut self, gpu: &Arc<Gpu>, volume: &Volume, held: &Held) -> Result<usize, DeviceError> {
        let [nx, ny, nz] = volume.dims();
        let slice = nx * ny * held.encoding.sample_bytes();
        let each = (SLAB / slice).clamp(1, nz);
        for first in (0..nz).step_by(each) {
            let some = first..(first + each).min(nz);
            let bytes = held.encoding.slices(volume, some.clone());
            let slot = self.stream.next_slot()?;
            let room = &mut self.staging[slot];
            let staging = match room.take().filter(|b| b.size() >= bytes.len() as u64) {
                Some(buffer) => room.insert(buffer),
                None => {
                    let usage = vk::BufferUsageFlags::TRANSFER_SRC;
                    room.insert(Buffer::new(gpu, "volact staging", bytes.len() as u64, usage, Place::Upload)?)
                }
            };
            staging.write(0, &bytes);
            let (begins, ends) = (first == 0, some.end == nz);
            let point = self.stream.submit(None, |record| {
                if begins {
                    record.transition(&held.image, false);
                } else {
                    record.barrier(crate::stream::COPY_WRITE, crate::stream::COPY_WRITE);
                }
                record.fill_slices(staging, &held.image, some.clone());
                if ends {
                    record.transition(&held.image, true);
                }
            })?;
            self.arrived = Some(point);
        }
        Ok(slice * nz)
    }

    /// What whoever samples has to begin after.
    pub fn arrived(&self) -> Option<Point> {
        self.arrived
    }

    /// Lets go of volumes that none of these shapes show. Nothing may be in flight but uploads.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn retain<'a>(&mut self, shapes: impl Iterator<Item = &'a ResolvedShape>) -> Result<(), DeviceError> {
        let mut ids = Vec::new();
        for value in shapes.flat_map(|s| s.parameters.values()) {
            if let ParameterValue::Volume(texture) = value {
                ids.push(texture.volume().id());
            }
        }
        if self.held.keys().any(|id| !ids.contains(id)) {
            self.stream.wait()?;
            self.held.retain(|id, _| ids.contains(id));
        }
        Ok(())
    }

    /// How a volume that was prepared is encoded, and whether the device's sampler may interpolate it.
    pub fn held(&self, volume: &Volume) -> Option<(Encoding, bool)> {
        self.get(volume).map(|held| (held.encoding, held.filterable))
    }

    /// A volume that was prepared.
    pub fn get(&self, volume: &Volume) -> Option<&Held> {
        self.held.get(&volume.id())
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        self.held.values().map(|h| h.bytes).sum()
    }
}

impl Drop for Volumes {
    fn drop(&mut self) {
        if self.stream.wait().is_err() {
            log::warn!("{NAME}: uploads did not finish");
        }
    }
}

fn format(encoding: &Encoding) -> vk::Format {
    use vk::Format as F;
    match (encoding.texel, encoding.channels) {
        (Texel::Unorm8, 1) => F::R8_UNORM,
        (Texel::Unorm8, 2) => F::R8G8_UNORM,
        (Texel::Unorm8, _) => F::R8G8B8A8_UNORM,
        (Texel::Unorm16, 1) => F::R16_UNORM,
        (Texel::Unorm16, 2) => F::R16G16_UNORM,
        (Texel::Unorm16, _) => F::R16G16B16A16_UNORM,
        (Texel::Float16, 1) => F::R16_SFLOAT,
        (Texel::Float16, 2) => F::R16G16_SFLOAT,
        (Texel::Float16, _) => F::R16G16B16A16_SFLOAT,
        (Texel::Float32, 1) => F::R32_SFLOAT,
        (Texel::Float32, 2) => F::R32G32_SFLOAT,
        (Texel::Float32, _) => F::R32G32B32A32_SFLOAT,
    }
}

fn check(
    gpu: &Gpu,
    shape: &ResolvedShape,
    volume: &Volume,
    encoding: &Encoding,
    format: vk::Format,
) -> Result<(), ActionError> {
    encoding.check((NAME, &shape.name), volume, (gpu.name(), gpu.limits.max_image_dimension3_d))?;
    if gpu.samples(format, false) {
        return Ok(());
    }
    Err(ActionError::Unsupported {
        action: NAME.into(),
        shape: shape.name.clone(),
        what: format!("images of format {format:?} on adapter {:?}", gpu.name()),
        cure: "set the option format to another".into(),
    })
}

/// Rows on the device and what they hold.
#[derive(Debug)]
pub struct Rows {
    what: &'static str,
    usage: vk::BufferUsageFlags,
    /// Bytes that are bound in any case; 0 where as many are as there are.
    least: u64,
    buffer: Option<Buffer>,
    content: Vec<Row>,
    /// Changes with the buffer.
    pub generation: u64,
}

impl Rows {
    /// No rows yet.
    pub fn new(what: &'static str, usage: vk::BufferUsageFlags) -> Self {
        Self { what, usage, least: 0, buffer: None, content: Vec::new(), generation: 0 }
    }

    /// No rows yet; a uniform buffer that is bound with just so much room.
    pub fn uniform(what: &'static str, rows: usize) -> Self {
        let least = (rows * size_of::<Row>()) as u64;
        Self { least, ..Self::new(what, vk::BufferUsageFlags::UNIFORM_BUFFER) }
    }

    /// Makes the device hold these rows; gives the bytes that were moved. The device must not be drawing.
    ///
    /// # Errors
    /// If there are more than the device can bind.
    pub fn set(&mut self, gpu: &Arc<Gpu>, rows: Vec<Row>) -> Result<usize, ActionError> {
        let wanted = (size_of_val::<[Row]>(&rows) as u64).max(self.least);
        within(gpu, self.what, (wanted, self.least))?;
        if self.buffer.as_ref().is_none_or(|b| b.size() < wanted) {
            self.buffer = None;
            let room = wanted.next_power_of_two();
            self.buffer = Some(Buffer::new(gpu, self.what, room, self.usage, Place::Upload)?);
            self.generation += 1;
            self.content.clear();
        }
        let Some(buffer) = &mut self.buffer else { return Ok(0) };
        let start = rows.iter().zip(&self.content).take_while(|(a, b)| a == b).count();
        let bytes: &[u8] = bytemuck::cast_slice(&rows[start..]);
        let same = rows.len() == self.content.len() && start == rows.len();
        if !same {
            buffer.write(start * size_of::<Row>(), bytes);
        }
        let moved = bytes.len();
        self.content = rows;
        Ok(moved)
    }

    /// The buffer, once rows were set.
    pub fn buffer(&self) -> Option<&Buffer> {
        self.buffer.as_ref()
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        self.buffer.as_ref().map_or(0, |b| b.size() as usize)
    }
}

/// Refuses what the device cannot bind as one buffer, or what has more than its room, where that is
/// given.
///
/// # Errors
/// By name, with what the device can.
pub fn within(gpu: &Gpu, what: &str, (bytes, room): (u64, u64)) -> Result<(), ActionError> {
    let most = if room > 0 { room } else { u64::from(gpu.limits.max_storage_buffer_range) };
    if bytes <= most {
        return Ok(());
    }
    let wanted = format!("at most {most} on adapter {:?}; draw a smaller picture or fewer shapes", gpu.name());
    Err(limit(format!("size of {what}"), format!("{bytes} bytes"), wanted))
}
