//! What the action keeps from frame to frame: value bounds of volumes, and tables and emptiness
//! of shapes, each made anew only when what it depends on changed.

use std::{collections::BTreeMap, sync::Arc};

use volact_core::{
    Compositing, Roi, TableInterpolation, VolumeTexture,
    frame::Rebuild,
    glam::{DAffine3, DVec3},
    resolve::ResolvedShape,
};

use super::{
    bounds::{Emptiness, Peaks, ValueBounds, number_range},
    classify::{SegmentTable, Units},
    fetch::Voxels,
    options::{Classification, Settings},
    preintegrate::SegmentPairs,
    sharp,
};

/// What identifies the bounds of a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct BoundsKey {
    volume: u64,
    version: u64,
    component: usize,
    roi: [usize; 6],
}

/// What a shape's emptiness depends on: its table (0 for none), its data, and how it is composited.
type EmptyKey = (u64, BoundsKey, u64);

/// What a shape's tables depend on.
#[derive(Clone, Debug, PartialEq)]
struct TableKey {
    table: u64,
    range: [f64; 2],
    bounds: BoundsKey,
    unit: f64,
    step: f64,
    /// Samples a world unit along each axis.
    density: DVec3,
    classification: Classification,
    skipping: bool,
}

/// Tables of a shape drawn by the vector kernels.
#[derive(Debug)]
pub struct Tables {
    key: TableKey,
    /// What segments add.
    pub table: SegmentTable,
    /// The same by pairs of values, where pre-integrated.
    pub pairs: Option<SegmentPairs>,
}

/// Everything kept.
#[derive(Debug, Default)]
pub struct Resources {
    bounds: BTreeMap<BoundsKey, Arc<ValueBounds>>,
    tables: BTreeMap<u64, Tables>,
    /// By shape: what it depends on, and what can be skipped.
    empty: BTreeMap<u64, (EmptyKey, Arc<Emptiness>)>,
    /// By data, and whether of the maximum.
    peaks: BTreeMap<(BoundsKey, bool), Peaks>,
}

/// The component that a shape reads.
pub fn component(shape: &ResolvedShape) -> usize {
    shape.int("component").unwrap_or(0) as usize
}

/// The voxels that a shape reads, and their units.
pub fn voxels<'a>(shape: &ResolvedShape, texture: &'a VolumeTexture) -> (Voxels<'a>, Units) {
    let desc = texture.volume().desc();
    let mut voxels = Voxels::new(texture, component(shape));
    let mut units = Units { scale: desc.slope, offset: desc.intercept };
    let wide = matches!(desc.scalar, volact_core::ScalarType::F64)
        || matches!(desc.scalar, volact_core::ScalarType::U32 | volact_core::ScalarType::I32);
    if wide {
        // f32 cannot hold these: fetch them relative to the range of the data instead. Not of the
        // texture: an integer's is that of its type, in which data of a few hundreds is lost, and
        // bounds are shared by all textures of a volume.
        let [lo, hi] = texture.volume().value_range().unwrap_or([0.0, 1.0]);
        let (a, b) = ((lo - desc.intercept) / desc.slope, (hi - desc.intercept) / desc.slope);
        voxels.origin = a;
        voxels.gain = if a == b { 1.0 } else { 1.0 / (b - a) };
        units = Units { scale: desc.slope / voxels.gain, offset: lo };
    }
    (voxels, units)
}

fn bounds_key(texture: &VolumeTexture, component: usize) -> BoundsKey {
    let Roi { min, max } = texture.data_roi();
    let volume = texture.volume();
    let roi = [min[0], min[1], min[2], max[0], max[1], max[2]];
    BoundsKey { volume: volume.id(), version: volume.version(), component, roi }
}

/// Samples a world unit along each axis of the data.
fn density(shape: &ResolvedShape, texture: &VolumeTexture) -> DVec3 {
    let to_index: DAffine3 = texture.object_to_index() * shape.to_object;
    let row = |a: usize| to_index.matrix3.transpose().col(a).length();
    DVec3::new(row(0), row(1), row(2))
}

impl Resources {
    /// Prepares the shapes for a sample distance; says what was made anew.
    pub fn prepare<'a>(
        &mut self,
        shapes: impl Iterator<Item = &'a ResolvedShape>,
        step: f64,
        settings: &Settings,
        rebuilt: &mut Vec<Rebuild>,
    ) {
        for shape in shapes {
            let Some(texture) = shape.volume("volume") else { continue };
            self.prepare_shape(shape, texture, step, settings, rebuilt);
        }
    }

    /// Forgets what no managed shape uses.
    pub fn retain<'a>(&mut self, shapes: impl Iterator<Item = &'a ResolvedShape>) {
        let mut keys = Vec::new();
        let mut ids = Vec::new();
        for shape in shapes {
            ids.push(shape.id);
            keys.extend(shape.volume("volume").map(|t| bounds_key(t, component(shape))));
        }
        self.bounds.retain(|key, _| keys.contains(key));
        self.peaks.retain(|(key, _), _| keys.contains(key));
        self.tables.retain(|id, _| ids.contains(id));
        self.empty.retain(|id, _| ids.contains(id));
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let tables = |t: &Tables| t.table.bytes() + t.pairs.as_ref().map_or(0, SegmentPairs::bytes);
        self.bounds.values().map(|b| b.bytes()).sum::<usize>()
            + self.tables.values().map(tables).sum::<usize>()
            + self.empty.values().map(|(_, e)| e.bytes()).sum::<usize>()
            + self.peaks.values().map(Peaks::bytes).sum::<usize>()
    }

    /// Tables of a shape.
    pub fn tables(&self, id: u64) -> Option<&Tables> {
        self.tables.get(&id)
    }

    /// What a shape can skip.
    pub fn empty(&self, id: u64) -> Option<&Emptiness> {
        self.empty.get(&id).map(|(_, e)| e.as_ref())
    }

    /// Bounds of a shape's volume, where they were made.
    pub fn bounds(&self, shape: &ResolvedShape) -> Option<&ValueBounds> {
        let texture = shape.volume("volume")?;
        self.bounds.get(&bounds_key(texture, component(shape))).map(Arc::as_ref)
    }

    /// The best that blocks of a shape's volume hold, where that was made.
    pub fn peaks(&self, shape: &ResolvedShape) -> Option<&Peaks> {
        let texture = shape.volume("volume")?;
        self.peaks.get(&(bounds_key(texture, component(shape)), shape.compositing() == Compositing::Maximum))
    }

    fn prepare_shape(
        &mut self,
        shape: &ResolvedShape,
        texture: &VolumeTexture,
        step: f64,
        settings: &Settings,
        rebuilt: &mut Vec<Rebuild>,
    ) {
        let mut say = |what: &str, bytes| {
            log::debug!("{}: {what} made anew, {bytes} bytes", shape.name);
            rebuilt.push(Rebuild { shape: shape.name.clone(), what: what.into(), bytes });
        };
        let key = bounds_key(texture, component(shape));
        let (voxels, units) = voxels(shape, texture);
        let compositing = shape.compositing();
        let table = shape.table("lookup_table");
        let skips = settings.skipping
            && (table.is_some() || compositing != Compositing::Over)
            && !(voxels.scalar.is_float() && matches!(compositing, Compositing::Add | Compositing::Average));
        let bounds = match self.bounds.get(&key) {
            Some(bounds) => Some(Arc::clone(bounds)),
            None if skips => {
                let bounds = Arc::new(ValueBounds::new(&voxels, settings.threads));
                say("value bounds", bounds.bytes());
                self.bounds.insert(key, Arc::clone(&bounds));
                Some(bounds)
            }
            None => None,
        };
        if compositing != Compositing::Over {
            let maximum = compositing == Compositing::Maximum;
            if let (Some(bounds), true) = (&bounds, maximum || compositing == Compositing::Minimum)
                && !self.peaks.contains_key(&(key, maximum))
            {
                let peaks = bounds.peaks(maximum);
                say("peaks", peaks.bytes());
                self.peaks.insert((key, maximum), peaks);
            }
            if matches!(compositing, Compositing::Add | Compositing::Average) {
                let zero = units.number(0.0) as f32;
                let same = |k: &EmptyKey| *k == (0, key, 0);
                match (&bounds, self.empty.get(&shape.id)) {
                    (Some(_), Some((k, _))) if same(k) => {}
                    (Some(bounds), _) if skips && zero == 0.0 => {
                        let empty = bounds.emptiness(|lo, hi| lo != 0.0 || hi != 0.0);
                        say("occupancy", empty.bytes());
                        self.empty.insert(shape.id, ((0, key, 0), Arc::new(empty)));
                    }
                    _ => _ = self.empty.remove(&shape.id),
                }
            }
            return;
        }
        let (Some(table), Some(unit)) = (table, shape.float("unit_distance")) else {
            self.tables.remove(&shape.id);
            self.empty.remove(&shape.id);
            return;
        };
        let density = density(shape, texture);
        let wanted = TableKey {
            table: table.id(),
            range: texture.range(),
            bounds: key,
            unit,
            step,
            density,
            classification: settings.classification,
            skipping: settings.skipping,
        };
        if self.tables.get(&shape.id).is_some_and(|t| t.key == wanted) {
            return;
        }
        let resolved = table.resolve(texture.range());
        let occurring = match &bounds {
            Some(b) => b.range.map(|r| r.map(f64::from)).filter(|_| !voxels.scalar.is_float()),
            // The same without skipping, so that tables and picture are the same.
            None if voxels.scalar.is_float() => None,
            None => number_range(&voxels, settings.threads).map(|r| r.map(f64::from)),
        };
        let h = step / unit;
        let segments = SegmentTable::new(&resolved, units, occurring, h);
        say("classification", segments.bytes());
        let fits = table.interpolation() == TableInterpolation::Post && !voxels.nearest;
        let sharp = || sharp::estimate(&voxels, &resolved, &segments, units, h, density * step);
        let pre = fits
            && match settings.classification {
                Classification::Post => false,
                Classification::PreIntegrated => true,
                Classification::Auto => {
                    let estimate = sharp();
                    log::debug!("{}: estimated errors by classification {estimate:?}", shape.name);
                    estimate.too_sharp()
                }
            };
        let pairs = pre.then(|| {
            let budget = (voxels.bytes.len() / 10).max(5 << 19);
            let pairs = SegmentPairs::new(
                &resolved,
                units,
                &segments,
                h,
                SegmentPairs::most_nodes(budget).min(1024),
                settings.threads,
            );
            say("pre-integration", pairs.bytes());
            pairs
        });
        let transparent = |lo: f32, hi: f32| match &pairs {
            // The coarser grid of pairs reaches farther around a value.
            Some(pairs) => {
                if let Some(end) = segments.beyond(lo, hi) {
                    return !end;
                }
                let node = |v: f32| (v * pairs.scale + pairs.offset).clamp(0.0, (pairs.nodes - 1) as f32);
                let (a, b) =
                    ((node(lo) - 1.001).floor().max(0.0), (node(hi) + 1.001).ceil().min((pairs.nodes - 1) as f32));
                let number = |n: f32| (n - pairs.offset) / pairs.scale;
                !segments.sees(number(a).min(lo), number(b).max(hi))
            }
            None => !segments.sees(lo, hi),
        };
        let empty = bounds.filter(|_| settings.skipping).map(|b| b.emptiness(|lo, hi| !transparent(lo, hi)));
        match empty.filter(Emptiness::any) {
            Some(empty) => {
                say("occupancy", empty.bytes());
                self.empty.insert(shape.id, ((table.id(), key, 1), Arc::new(empty)));
            }
            None => _ = self.empty.remove(&shape.id),
        }
        self.tables.insert(shape.id, Tables { key: wanted, table: segments, pairs });
    }
}
