//! What the action keeps from frame to frame: value bounds of volumes, tables and emptiness, and
//! geometries made ready, each made anew only when what it depends on changed, and shared by all
//! shapes for which it is the same.

mod solids;
mod tables;

use std::{
    collections::{BTreeMap, btree_map::Entry},
    sync::{Arc, Mutex, PoisonError, Weak},
};

use volact_core::{
    ActionError, Compositing, Geometry, Roi, ScalarType, VolumeTexture,
    action::Watch,
    frame::Rebuild,
    glam::{DAffine3, DVec3},
    mutated,
    resolve::ResolvedShape,
    volume::Components,
};

use super::{
    bounds::{Emptiness, Peaks, ValueBounds},
    classify::Units,
    fetch::Voxels,
    mesh::numbers::Numbers,
    options::{Classification, Settings},
    plan::Plan,
    shaded::{self, Shader, Skip},
    simd::Unit,
};

pub use solids::{Prepared, Solid};
use tables::TableKey;
pub use tables::Tables;

/// What identifies the bounds of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BoundsKey {
    volume: u64,
    version: u64,
    component: usize,
    roi: [usize; 6],
    /// Bits of the voxels' origin and gain, in which bounds are counted.
    units: [u64; 2],
}

/// Everything kept.
#[derive(Debug, Default)]
pub struct Resources {
    bounds: BTreeMap<BoundsKey, Arc<ValueBounds>>,
    /// By shape; the same for shapes of the same data and table.
    tables: BTreeMap<u64, Arc<Tables>>,
    /// By data: blocks of zeros, which add nothing to a sum.
    zeros: BTreeMap<BoundsKey, Emptiness>,
    /// By data, and whether of the maximum.
    peaks: BTreeMap<(BoundsKey, bool), Peaks>,
    /// By geometry.
    geometries: BTreeMap<usize, Kept>,
    /// By shape.
    numbers: BTreeMap<u64, Numbers>,
    /// By shape.
    shaders: BTreeMap<u64, Shader>,
    /// By shape.
    vacant: BTreeMap<u64, Vacant>,
}

/// Bounds that some action of this process has.
static MADE: Mutex<BTreeMap<BoundsKey, Weak<ValueBounds>>> = Mutex::new(BTreeMap::new());

/// The share of empty blocks from which on they are looked at by programs.
const WORTH: f64 = 0.05;

/// Where a program is transparent.
#[derive(Debug)]
struct Vacant {
    key: VacantKey,
    empty: Option<Emptiness>,
}

/// What that depends on.
#[derive(Clone, Debug, PartialEq)]
struct VacantKey {
    bounds: BoundsKey,
    table: u64,
    range: [f64; 2],
}

/// A geometry made ready. While it is kept, no other has its address.
#[derive(Debug)]
struct Kept {
    geometry: Arc<dyn Geometry>,
    prepared: Prepared,
}

impl Kept {
    fn address(geometry: &Arc<dyn Geometry>) -> usize {
        Arc::as_ptr(geometry).cast::<()>() as usize
    }
}

/// The component that a shape reads, or that says how opaque it is.
pub fn component(shape: &ResolvedShape) -> usize {
    match (shape.int("component"), shape.volume("volume").map(VolumeTexture::meaning)) {
        (Some(named), _) => named as usize,
        (None, Some(Components::LuminanceAlpha)) => 1,
        (None, Some(Components::Rgba)) => 3,
        _ => 0,
    }
}

/// The voxels of a texture's component as a program reads them, and their units.
pub fn plain_voxels(texture: &VolumeTexture, component: usize) -> (Voxels<'_>, Units) {
    let desc = texture.volume().desc();
    let mut voxels = Voxels::new(texture, component);
    let mut units = Units { scale: desc.slope, offset: desc.intercept };
    if matches!(desc.scalar, ScalarType::F64 | ScalarType::U32 | ScalarType::I32) {
        // f32 cannot hold these: fetch them relative to those that occur.
        let [lo, hi] = texture.volume().value_range().unwrap_or([0.0, 1.0]);
        let (a, b) = ((lo - desc.intercept) / desc.slope, (hi - desc.intercept) / desc.slope);
        voxels.origin = a;
        voxels.gain = if a == b { 1.0 } else { 1.0 / (b - a) };
        units = Units { scale: desc.slope / voxels.gain, offset: lo };
    }
    (voxels, units)
}

/// The voxels that a shape reads, and their units.
pub fn voxels<'a>(shape: &ResolvedShape, texture: &'a VolumeTexture) -> (Voxels<'a>, Units) {
    let desc = texture.volume().desc();
    let mut voxels = Voxels::new(texture, component(shape));
    let mut units = Units { scale: desc.slope, offset: desc.intercept };
    if mutated!("forgotten_slope") {
        units = Units { scale: 1.0, offset: 0.0 };
    }
    let wide = matches!(desc.scalar, ScalarType::F64 | ScalarType::U32 | ScalarType::I32);
    if wide || desc.scalar.is_float() {
        // f32 cannot hold these: fetch them relative to the values that the table tells apart,
        // whatever else there may be, or else to those that occur. Nor can it place floats of
        // extreme size on a table.
        let points = shape.table("lookup_table").map(|t| t.points(texture.range()));
        let span = points.and_then(|p| Some([p.first()?.value, p.last()?.value])).filter(|[a, b]| a < b);
        let [lo, hi] = span.or_else(|| texture.volume().value_range()).unwrap_or([0.0, 1.0]);
        let (a, b) = ((lo - desc.intercept) / desc.slope, (hi - desc.intercept) / desc.slope);
        if wide || !(1e-30..1e30).contains(&(b - a).abs()) {
            voxels.origin = a;
            voxels.gain = if a == b { 1.0 } else { 1.0 / (b - a) };
            units = Units { scale: desc.slope / voxels.gain, offset: lo };
        }
    }
    (voxels, units)
}

fn bounds_key(shape: &ResolvedShape, texture: &VolumeTexture) -> BoundsKey {
    key_of(texture, &voxels(shape, texture).0)
}

/// The same of voxels as programs read them.
fn plain_key(shape: &ResolvedShape, texture: &VolumeTexture) -> BoundsKey {
    key_of(texture, &plain_voxels(texture, shaded::component(shape)).0)
}

fn key_of(texture: &VolumeTexture, voxels: &Voxels<'_>) -> BoundsKey {
    let Roi { min, max } = texture.data_roi();
    let volume = texture.volume();
    let roi = [min[0], min[1], min[2], max[0], max[1], max[2]];
    let units = [voxels.origin.to_bits(), voxels.gain.to_bits()];
    let version = if mutated!("stale_data") { 0 } else { volume.version() };
    BoundsKey { volume: volume.id(), version, component: voxels.component, roi, units }
}

/// How a shape's numbers are reduced: a map to data units that falls makes a maximum of the
/// values a minimum of the numbers.
pub fn reduction(shape: &ResolvedShape, units: Units) -> Compositing {
    match shape.compositing() {
        Compositing::Maximum if units.scale < 0.0 => Compositing::Minimum,
        Compositing::Minimum if units.scale < 0.0 => Compositing::Maximum,
        other => other,
    }
}

/// Samples a world unit along each axis of the data.
fn density(shape: &ResolvedShape, texture: &VolumeTexture) -> DVec3 {
    let to_index: DAffine3 = texture.object_to_index() * shape.to_object;
    let row = |a: usize| to_index.matrix3.transpose().col(a).length();
    DVec3::new(row(0), row(1), row(2))
}

impl Resources {
    /// Prepares the shapes for a plan; says what was made anew.
    ///
    /// # Errors
    /// If a geometry is damaged or too large, or an attribute does not go with it.
    pub fn prepare<'a>(
        &mut self,
        shapes: impl Iterator<Item = &'a ResolvedShape>,
        plan: &Plan,
        (settings, progress): (&Settings, &Watch),
        rebuilt: &mut Vec<Rebuild>,
    ) -> Result<(), ActionError> {
        // Extinctions that add are those of samples; where they lie on no line, there are no ends.
        let post = Settings { classification: Classification::Post, ..*settings };
        for shape in shapes {
            let mut say = |what: &str, bytes| {
                log::debug!("{}: {what} made anew, {bytes} bytes", shape.name);
                rebuilt.push(Rebuild { shape: shape.name.clone(), what: what.into(), bytes });
            };
            let bent = self.prepare_geometry(shape, progress, &mut say)?;
            if shaded::wanted(shape) {
                let settings = if bent || plan.mixes(shape.id) { &post } else { settings };
                self.prepare_shader(shape, settings, &mut say)?;
                continue;
            }
            let Some(texture) = shape.volume("volume") else {
                self.prepare_numbers(shape, &mut say);
                continue;
            };
            let settings = if bent || plan.mixes(shape.id) { &post } else { settings };
            self.prepare_volume(shape, texture, plan.step, settings, &mut say);
        }
        Ok(())
    }

    /// Forgets what no managed shape uses.
    pub fn retain<'a>(&mut self, shapes: impl Iterator<Item = &'a ResolvedShape>) {
        let mut keys = Vec::new();
        let mut ids = Vec::new();
        let mut geometries = Vec::new();
        for shape in shapes {
            ids.push(shape.id);
            if shaded::wanted(shape) {
                keys.extend(shape.first_volume().map(|t| plain_key(shape, t)));
            } else {
                keys.extend(shape.volume("volume").map(|t| bounds_key(shape, t)));
            }
            geometries.push(Kept::address(solids::whole(shape)));
        }
        self.bounds.retain(|key, _| keys.contains(key));
        self.peaks.retain(|(key, _), _| keys.contains(key));
        self.tables.retain(|id, _| ids.contains(id));
        self.zeros.retain(|key, _| keys.contains(key));
        self.geometries.retain(|address, _| geometries.contains(address));
        self.numbers.retain(|id, _| ids.contains(id));
        self.shaders.retain(|id, _| ids.contains(id));
        self.vacant.retain(|id, _| ids.contains(id));
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let mut tables: Vec<_> = self.tables.values().collect();
        tables.sort_by_key(|t| Arc::as_ptr(t));
        tables.dedup_by_key(|t| Arc::as_ptr(t));
        self.bounds.values().map(|b| b.bytes()).sum::<usize>()
            + tables.into_iter().map(|t| t.bytes()).sum::<usize>()
            + self.zeros.values().map(Emptiness::bytes).sum::<usize>()
            + self.peaks.values().map(Peaks::bytes).sum::<usize>()
            + self.geometries.values().map(|kept| kept.prepared.bytes()).sum::<usize>()
            + self.numbers.values().map(Numbers::bytes).sum::<usize>()
            + self.shaders.values().map(Shader::bytes).sum::<usize>()
            + self.vacant.values().filter_map(|v| v.empty.as_ref()).map(Emptiness::bytes).sum::<usize>()
    }

    /// Tables of a shape.
    pub fn tables(&self, id: u64) -> Option<&Tables> {
        self.tables.get(&id).map(Arc::as_ref)
    }

    /// The numbers of a shape's vertices, where they have one table for colour and opacity.
    pub fn numbers(&self, id: u64) -> Option<&Numbers> {
        self.numbers.get(&id)
    }

    /// The program of a shape's shader, where that is evaluated.
    pub fn shader(&self, id: u64) -> Option<&Shader> {
        self.shaders.get(&id)
    }

    /// What the first volume says along rays, where a shape's program depends on it, and what of it
    /// can be skipped.
    pub fn skip<'a>(&'a self, shape: &'a ResolvedShape, unit: Unit) -> Option<Skip<'a>> {
        let (shader, texture) = (self.shader(shape.id)?, shape.first_volume()?);
        let mut volumes = shape.shader.declaration.parameters.iter().map(|p| p.name.as_str());
        let name = volumes.find(|name| shape.volume(name).is_some_and(|t| std::ptr::eq(t, texture)))?;
        if !shader.wants_values_of(name) {
            return None;
        }
        let (voxels, units) = plain_voxels(texture, shaded::component(shape));
        let empty = self.vacant.get(&shape.id).and_then(|vacant| vacant.empty.as_ref());
        Some(Skip { name, voxels, units, empty, seen: shader.seen_of(name), unit })
    }

    /// The geometry of a shape as it was made ready; `None` where it is a box.
    pub fn prepared(&self, shape: &ResolvedShape) -> Option<&Prepared> {
        let kept = solids::wanted(shape).then(|| self.geometries.get(&Kept::address(solids::whole(shape))));
        kept.flatten().map(|kept| &kept.prepared)
    }

    /// Blocks of zeros of a shape's data.
    pub fn zeros(&self, shape: &ResolvedShape) -> Option<&Emptiness> {
        self.zeros.get(&bounds_key(shape, shape.volume("volume")?))
    }

    /// Bounds of a shape's volume, where they were made.
    pub fn bounds(&self, shape: &ResolvedShape) -> Option<&ValueBounds> {
        let texture = shape.volume("volume")?;
        self.bounds.get(&bounds_key(shape, texture)).map(Arc::as_ref)
    }

    /// The best that blocks of a shape's volume hold, where that was made.
    pub fn peaks(&self, shape: &ResolvedShape) -> Option<&Peaks> {
        let texture = shape.volume("volume")?;
        let reduction = reduction(shape, voxels(shape, texture).1);
        self.peaks.get(&(bounds_key(shape, texture), reduction == Compositing::Maximum))
    }

    /// Makes a shape's geometry ready; whether it carries a volume along.
    fn prepare_geometry(
        &mut self,
        shape: &ResolvedShape,
        progress: &Watch,
        say: &mut impl FnMut(&str, usize),
    ) -> Result<bool, ActionError> {
        if !solids::wanted(shape) {
            return Ok(false);
        }
        let geometry = solids::whole(shape);
        let address = Kept::address(geometry);
        let kept = match self.geometries.entry(address) {
            Entry::Occupied(there) => there.into_mut(),
            Entry::Vacant(free) => {
                let prepared = solids::prepare(shape, progress)?;
                say(prepared.what(), prepared.bytes());
                free.insert(Kept { geometry: Arc::clone(geometry), prepared })
            }
        };
        debug_assert!(Arc::ptr_eq(&kept.geometry, geometry));
        let Prepared::Solid(solid) = &kept.prepared else { return Ok(false) };
        solids::check_attributes(shape, solid)?;
        Ok(solid.texture.is_some())
    }

    fn prepare_numbers(&mut self, shape: &ResolvedShape, say: &mut impl FnMut(&str, usize)) {
        let (last, mut anew) = (self.numbers.remove(&shape.id), false);
        if let Some(numbers) = Numbers::new(shape, last, &mut anew) {
            if anew {
                say("classification", numbers.bytes());
            }
            self.numbers.insert(shape.id, numbers);
        }
    }

    fn prepare_shader(
        &mut self,
        shape: &ResolvedShape,
        settings: &Settings,
        say: &mut impl FnMut(&str, usize),
    ) -> Result<(), ActionError> {
        let mut shader = match self.shaders.remove(&shape.id) {
            Some(kept) if kept.serves(shape, settings) => kept,
            last => {
                let made = Shader::new(shape, settings, last)?;
                say("shader", made.bytes());
                made
            }
        };
        shader.prepare_tables(shape, &mut *say);
        self.prepare_vacant(shape, &shader, settings, say);
        self.shaders.insert(shape.id, shader);
        Ok(())
    }

    /// Finds where a shape's program is transparent, as far as values tell.
    fn prepare_vacant(
        &mut self,
        shape: &ResolvedShape,
        shader: &Shader,
        settings: &Settings,
        say: &mut impl FnMut(&str, usize),
    ) {
        let found = shader.transparent_with().filter(|_| settings.skipping).and_then(|[volume, table]| {
            // Rays are followed in the samples of the first volume.
            let texture = shape.volume(volume).filter(|t| shape.first_volume().is_some_and(|f| std::ptr::eq(*t, f)))?;
            Some((texture, shape.table(table)?))
        });
        let Some((texture, table)) = found else {
            self.vacant.remove(&shape.id);
            return;
        };
        let (voxels, units) = plain_voxels(texture, shaded::component(shape));
        let key = VacantKey { bounds: plain_key(shape, texture), table: table.id(), range: texture.range() };
        if self.vacant.get(&shape.id).is_some_and(|v| v.key == key) {
            return;
        }
        let bounds = match self.bounds.get(&key.bounds) {
            Some(bounds) => Arc::clone(bounds),
            None => self.make_bounds(key.bounds, &voxels, settings, say),
        };
        let empty = bounds.emptiness(tables::opaque(&table.resolve(texture.range()), units));
        // Looking where to skip costs more than a few samples.
        let empty = Some(empty).filter(|empty| empty.share() > WORTH);
        if let Some(empty) = &empty {
            say("occupancy", empty.bytes());
        }
        self.vacant.insert(shape.id, Vacant { key, empty });
    }

    /// Bounds of values, those of another action of this process if it has them.
    fn make_bounds(
        &mut self,
        key: BoundsKey,
        voxels: &Voxels<'_>,
        settings: &Settings,
        say: &mut impl FnMut(&str, usize),
    ) -> Arc<ValueBounds> {
        let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
        made.retain(|_, bounds| bounds.strong_count() > 0);
        let bounds = made.get(&key).and_then(Weak::upgrade).unwrap_or_else(|| {
            let bounds = Arc::new(ValueBounds::new(voxels, settings.threads));
            say("value bounds", bounds.bytes());
            made.insert(key, Arc::downgrade(&bounds));
            bounds
        });
        self.bounds.insert(key, Arc::clone(&bounds));
        bounds
    }

    fn prepare_volume(
        &mut self,
        shape: &ResolvedShape,
        texture: &VolumeTexture,
        step: f64,
        settings: &Settings,
        say: &mut impl FnMut(&str, usize),
    ) {
        let key = bounds_key(shape, texture);
        let (voxels, units) = voxels(shape, texture);
        let compositing = shape.compositing();
        let sums = matches!(compositing, Compositing::Add | Compositing::Average);
        let skips = settings.skipping && may_skip(shape, texture) && !(voxels.scalar.is_float() && sums);
        let bounds = match self.bounds.get(&key) {
            Some(bounds) => Some(Arc::clone(bounds)),
            None if skips => Some(self.make_bounds(key, &voxels, settings, say)),
            None => None,
        };
        if compositing == Compositing::Over {
            self.prepare_tables(shape, texture, bounds.as_deref(), step, settings, say);
            return;
        }
        let Some(bounds) = bounds else { return };
        let reduction = reduction(shape, units);
        let maximum = reduction == Compositing::Maximum;
        let extreme = maximum || reduction == Compositing::Minimum;
        if extreme && !self.peaks.contains_key(&(key, maximum)) {
            let peaks = bounds.peaks(maximum);
            say("peaks", peaks.bytes());
            self.peaks.insert((key, maximum), peaks);
        }
        if !extreme && voxels.origin == 0.0 && !self.zeros.contains_key(&key) {
            let zeros = bounds.emptiness(|lo, hi| lo != 0.0 || hi != 0.0);
            say("occupancy", zeros.bytes());
            self.zeros.insert(key, zeros);
        }
    }

    fn prepare_tables(
        &mut self,
        shape: &ResolvedShape,
        texture: &VolumeTexture,
        bounds: Option<&ValueBounds>,
        step: f64,
        settings: &Settings,
        say: &mut impl FnMut(&str, usize),
    ) {
        let Some(wanted) = TableKey::new(shape, texture, bounds_key(shape, texture), step, settings) else {
            self.tables.remove(&shape.id);
            return;
        };
        if self.tables.get(&shape.id).is_some_and(|t| t.key == wanted) {
            return;
        }
        let same = self.tables.values().find(|t| t.key == wanted).map(Arc::clone);
        let tables = same.unwrap_or_else(|| Arc::new(Tables::new(wanted, shape, texture, bounds, settings, say)));
        self.tables.insert(shape.id, tables);
    }
}

/// Whether anything of a shape may be known to be transparent, or not to count, by its values.
fn may_skip(shape: &ResolvedShape, texture: &VolumeTexture) -> bool {
    let by_opacity = matches!(texture.meaning(), Components::Intensity | Components::LuminanceAlpha | Components::Rgba);
    shape.compositing() != Compositing::Over || shape.table("lookup_table").is_some() || by_opacity
}
