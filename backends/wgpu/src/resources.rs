//! What the device holds from frame to frame: volumes as textures, and rows of numbers of which only
//! those that changed are moved.

use std::collections::BTreeMap;

use volact_core::{ActionError, ParameterValue, Volume, frame::Rebuild, mutated, resolve::ResolvedShape};
use volact_shaders::gpu::{
    pack::Row,
    voxels::{Encoding, Texel, Wanted},
};

use crate::{NAME, device::Gpu, options::Settings};

/// Bytes of voxels that are handed over at a time.
const SLAB: usize = 64 << 20;

/// Volumes on the device.
#[derive(Debug, Default)]
pub struct Volumes {
    held: BTreeMap<u64, Held>,
    /// Counts textures made, so that what binds them can tell.
    generation: u64,
}

/// One volume.
#[derive(Debug)]
pub struct Held {
    /// How its voxels lie.
    pub encoding: Encoding,
    /// The texture as shaders see it.
    pub view: wgpu::TextureView,
    /// Whether the device's sampler may interpolate it.
    pub filterable: bool,
    /// Differs from that of every other texture there was.
    pub generation: u64,
    texture: wgpu::Texture,
    wanted: Wanted,
    version: u64,
    bytes: usize,
}

impl Volumes {
    /// Brings all volumes of a shape to the device; gives the bytes that were moved.
    ///
    /// # Errors
    /// If a volume is larger than a texture can be, or has no place in the format asked for.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
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
            let encoding = Encoding::new(volume, settings.format, gpu.has(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM));
            let device = (gpu.name(), gpu.limits.max_texture_dimension_3d);
            encoding.check((NAME, &shape.name), volume, device)?;
            let mut held = match self.held.remove(&volume.id()).filter(|h| fits(h, &encoding)) {
                Some(held) => held,
                None => {
                    self.generation += 1;
                    make(gpu, volume, &encoding, self.generation)
                }
            };
            (held.encoding, held.wanted, held.version) = (encoding, settings.format, volume.version());
            let bytes = upload(gpu, volume, &held)?;
            rebuilt.push(Rebuild { shape: shape.name.clone(), what: "texture".into(), bytes });
            moved += bytes;
            self.held.insert(volume.id(), held);
        }
        Ok(moved)
    }

    /// Lets go of volumes that none of these shapes show.
    pub fn retain<'a>(&mut self, shapes: impl Iterator<Item = &'a ResolvedShape>) {
        let mut ids = Vec::new();
        for value in shapes.flat_map(|s| s.parameters.values()) {
            if let ParameterValue::Volume(texture) = value {
                ids.push(texture.volume().id());
            }
        }
        self.held.retain(|id, _| ids.contains(id));
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

fn fits(held: &Held, encoding: &Encoding) -> bool {
    held.encoding.texel == encoding.texel && held.encoding.channels == encoding.channels
}

fn format(encoding: &Encoding) -> wgpu::TextureFormat {
    use wgpu::TextureFormat as F;
    match (encoding.texel, encoding.channels) {
        (Texel::Unorm8, 1) => F::R8Unorm,
        (Texel::Unorm8, 2) => F::Rg8Unorm,
        (Texel::Unorm8, _) => F::Rgba8Unorm,
        (Texel::Unorm16, 1) => F::R16Unorm,
        (Texel::Unorm16, 2) => F::Rg16Unorm,
        (Texel::Unorm16, _) => F::Rgba16Unorm,
        (Texel::Float16, 1) => F::R16Float,
        (Texel::Float16, 2) => F::Rg16Float,
        (Texel::Float16, _) => F::Rgba16Float,
        (Texel::Float32, 1) => F::R32Float,
        (Texel::Float32, 2) => F::Rg32Float,
        (Texel::Float32, _) => F::Rgba32Float,
    }
}

fn size(volume: &Volume) -> wgpu::Extent3d {
    let [width, height, depth] = volume.dims().map(|n| n as u32);
    wgpu::Extent3d { width, height, depth_or_array_layers: depth }
}

fn make(gpu: &Gpu, volume: &Volume, encoding: &Encoding, generation: u64) -> Held {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(volume.name()),
        size: size(volume),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D3,
        format: format(encoding),
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
    let filterable = encoding.texel != Texel::Float32 || gpu.has(wgpu::Features::FLOAT32_FILTERABLE);
    let bytes = volume.desc().samples().unwrap_or(0) * encoding.sample_bytes();
    Held { encoding: *encoding, view, filterable, generation, texture, wanted: Wanted::Exact, version: 0, bytes }
}

/// Moves all voxels, some slices at a time so that little is held twice.
fn upload(gpu: &Gpu, volume: &Volume, held: &Held) -> Result<usize, ActionError> {
    gpu.check()?;
    let [nx, ny, nz] = volume.dims();
    let slice = nx * ny * held.encoding.sample_bytes();
    let each = (SLAB / slice).clamp(1, nz);
    for first in (0..nz).step_by(each) {
        let some = first..(first + each).min(nz);
        let bytes = held.encoding.slices(volume, some.clone());
        let place = wgpu::TexelCopyTextureInfo {
            texture: &held.texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z: first as u32 },
            aspect: wgpu::TextureAspect::All,
        };
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some((nx * held.encoding.sample_bytes()) as u32),
            rows_per_image: Some(ny as u32),
        };
        let extent = wgpu::Extent3d { depth_or_array_layers: some.len() as u32, ..size(volume) };
        gpu.queue.write_texture(place, &bytes, layout, extent);
        if each < nz {
            gpu.queue.submit([]);
        }
        gpu.check()?;
    }
    Ok(slice * nz)
}

/// Rows on the device and what they hold.
#[derive(Debug)]
pub struct Rows {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
    content: Vec<Row>,
    least: u64,
    /// Changes with the buffer.
    pub generation: u64,
}

impl Rows {
    /// No rows yet; a storage buffer for any number of them.
    pub fn storage(label: &'static str) -> Self {
        Self::new(label, wgpu::BufferUsages::STORAGE, 0)
    }

    /// No rows yet; a uniform buffer that is bound with just so much room.
    pub fn uniform(label: &'static str, rows: usize) -> Self {
        Self::new(label, wgpu::BufferUsages::UNIFORM, rows)
    }

    fn new(label: &'static str, usage: wgpu::BufferUsages, rows: usize) -> Self {
        let (usage, least) = (usage | wgpu::BufferUsages::COPY_DST, (rows * size_of::<Row>()) as u64);
        Self { label, usage, buffer: None, content: Vec::new(), least, generation: 0 }
    }

    /// Bytes that can be bound.
    fn most(&self, gpu: &Gpu) -> u64 {
        if self.least > 0 { self.least } else { gpu.limits.max_storage_buffer_binding_size }
    }

    /// Makes the device hold these rows; gives the bytes that were moved.
    ///
    /// # Errors
    /// If there are more than the device can bind.
    pub fn set(&mut self, gpu: &Gpu, rows: Vec<Row>) -> Result<usize, ActionError> {
        self.make_room(gpu, rows.len())?;
        let Some(buffer) = &self.buffer else { return Ok(0) };
        let same = |(a, b): (&Row, &Row)| a == b;
        let start = rows.iter().zip(&self.content).take_while(|(a, b)| same((a, b))).count();
        let behind = if rows.len() <= self.content.len() {
            let tail = rows[start..].iter().rev().zip(self.content[start..rows.len()].iter().rev());
            tail.take_while(|(a, b)| same((a, b))).count()
        } else {
            0
        };
        let changed = &rows[start..rows.len() - behind];
        let bytes: &[u8] = bytemuck::cast_slice(changed);
        if !bytes.is_empty() {
            gpu.queue.write_buffer(buffer, (start * size_of::<Row>()) as u64, bytes);
        }
        let moved = bytes.len();
        self.content = rows;
        Ok(moved)
    }

    /// Makes room for so many rows, which the device is to write itself.
    ///
    /// # Errors
    /// If there are more than the device can bind.
    pub fn reserve(&mut self, gpu: &Gpu, count: usize) -> Result<(), ActionError> {
        self.content.clear();
        self.make_room(gpu, count)
    }

    fn make_room(&mut self, gpu: &Gpu, count: usize) -> Result<(), ActionError> {
        let wanted = (count.max(1) * size_of::<Row>()) as u64;
        let most = self.most(gpu);
        if wanted > most {
            return Err(too_large(self.label, wanted, most));
        }
        if self.buffer.as_ref().is_none_or(|b| b.size() < wanted) {
            let size = wanted.max(self.least).next_power_of_two().min(most);
            self.buffer = Some(gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(self.label),
                size,
                usage: self.usage,
                mapped_at_creation: false,
            }));
            self.generation += 1;
            self.content.clear();
            gpu.check()?;
        }
        Ok(())
    }

    /// The buffer, once rows were set.
    pub fn buffer(&self) -> Option<&wgpu::Buffer> {
        self.buffer.as_ref()
    }

    /// Bytes on the device.
    pub fn bytes(&self) -> usize {
        self.buffer.as_ref().map_or(0, |b| b.size() as usize)
    }
}

/// More than the device can bind.
pub fn too_large(what: &str, found: u64, most: u64) -> ActionError {
    ActionError::Limit {
        action: NAME.into(),
        what: format!("size of {what}"),
        found: format!("{found} bytes"),
        wanted: format!("at most {most}; draw a smaller picture or fewer shapes"),
    }
}
