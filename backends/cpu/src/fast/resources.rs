//! What the action keeps from frame to frame: value bounds of volumes, and tables and emptiness
//! of shapes, each made anew only when what it depends on changed.

use std::{collections::BTreeMap, sync::Arc};

use volact_core::{
    Compositing, Roi, ScalarType, TableInterpolation, VolumeTexture,
    frame::Rebuild,
    glam::{DAffine3, DVec3},
    resolve::ResolvedShape,
};

use super::{
    bounds::{Emptiness, Peaks, ValueBounds, number_range},
    classify::{SegmentTable, Units},
    fetch::Voxels,
    options::{Classification, Settings},
    plan::Plan,
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
    /// Bits of the voxels' origin and gain, in which bounds are counted.
    units: [u64; 2],
}

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
    /// What can be skipped.
    pub empty: Option<Emptiness>,
}

/// Everything kept.
#[derive(Debug, Default)]
pub struct Resources {
    bounds: BTreeMap<BoundsKey, Arc<ValueBounds>>,
    tables: BTreeMap<u64, Tables>,
    /// By data: blocks of zeros, which add nothing to a sum.
    zeros: BTreeMap<BoundsKey, Emptiness>,
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
    let Roi { min, max } = texture.data_roi();
    let volume = texture.volume();
    let roi = [min[0], min[1], min[2], max[0], max[1], max[2]];
    let voxels = voxels(shape, texture).0;
    let units = [voxels.origin.to_bits(), voxels.gain.to_bits()];
    BoundsKey { volume: volume.id(), version: volume.version(), component: component(shape), roi, units }
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
    pub fn prepare<'a>(
        &mut self,
        shapes: impl Iterator<Item = &'a ResolvedShape>,
        plan: &Plan,
        settings: &Settings,
        rebuilt: &mut Vec<Rebuild>,
    ) {
        // The plain way classifies by itself.
        let post = Settings { classification: Classification::Post, ..*settings };
        for shape in shapes {
            let Some(texture) = shape.volume("volume") else { continue };
            let over = shape.compositing() == Compositing::Over;
            let settings = if plan.general && over { &post } else { settings };
            self.prepare_shape(shape, texture, plan.step, settings, rebuilt);
        }
    }

    /// Forgets what no managed shape uses.
    pub fn retain<'a>(&mut self, shapes: impl Iterator<Item = &'a ResolvedShape>) {
        let mut keys = Vec::new();
        let mut ids = Vec::new();
        for shape in shapes {
            ids.push(shape.id);
            keys.extend(shape.volume("volume").map(|t| bounds_key(shape, t)));
        }
        self.bounds.retain(|key, _| keys.contains(key));
        self.peaks.retain(|(key, _), _| keys.contains(key));
        self.tables.retain(|id, _| ids.contains(id));
        self.zeros.retain(|key, _| keys.contains(key));
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let pairs = |t: &Tables| t.pairs.as_ref().map_or(0, SegmentPairs::bytes);
        let empty = |t: &Tables| t.empty.as_ref().map_or(0, Emptiness::bytes);
        let tables = |t: &Tables| t.table.bytes() + pairs(t) + empty(t);
        self.bounds.values().map(|b| b.bytes()).sum::<usize>()
            + self.tables.values().map(tables).sum::<usize>()
            + self.zeros.values().map(Emptiness::bytes).sum::<usize>()
            + self.peaks.values().map(Peaks::bytes).sum::<usize>()
    }

    /// Tables of a shape.
    pub fn tables(&self, id: u64) -> Option<&Tables> {
        self.tables.get(&id)
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
        let key = bounds_key(shape, texture);
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
            let reduction = reduction(shape, units);
            let maximum = reduction == Compositing::Maximum;
            let extreme = maximum || reduction == Compositing::Minimum;
            if let Some(bounds) = bounds {
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
            return;
        }
        let (Some(table), Some(unit)) = (table, shape.float("unit_distance")) else {
            self.tables.remove(&shape.id);
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
        // The same with and without skipping, so that tables and picture are the same.
        let range = bounds.as_ref().map_or_else(|| number_range(&voxels, settings.threads), |b| b.range);
        let range = range.map(|r| r.map(f64::from));
        // Floats may be infinite: then the table's own ends count.
        let occurring = range.filter(|_| !voxels.scalar.is_float());
        let h = step / unit;
        let segments = SegmentTable::new(&resolved, units, occurring, h);
        say("classification", segments.bytes());
        let fits = table.interpolation() == TableInterpolation::Post && !voxels.nearest;
        let estimate = |pairs: Option<&SegmentPairs>| {
            sharp::estimate(&voxels, &resolved, (&segments, pairs), units, h, density * step)
        };
        let asked = fits && settings.classification != Classification::Post;
        let first = if asked { estimate(None) } else { sharp::Estimate::default() };
        let forced = settings.classification == Classification::PreIntegrated;
        let wanted_pairs = asked && (forced || first.matters());
        // As far beyond the table's own values as a segment reaches; farther would cost nodes.
        let reach = |[a, b]: [f64; 2]| {
            let whole = [a, b].iter().chain(&segments.domain).all(|v| v.fract() == 0.0);
            let change = if whole { (1.5 * first.change).ceil() } else { 1.5 * first.change };
            [a.max(segments.domain[0] - change), b.min(segments.domain[1] + change)]
        };
        let range = range.map(reach).filter(|[a, b]| a <= b);
        let budget = (voxels.bytes.len() / 10).max(5 << 19);
        let most = SegmentPairs::most_nodes(budget).min(1024);
        let pairs = wanted_pairs
            .then(|| SegmentPairs::new(&resolved, units, (&segments, range), h, most, settings.threads))
            .filter(|pairs| forced || estimate(Some(pairs)).helps());
        if let Some(pairs) = &pairs {
            say("pre-integration", pairs.bytes());
        }
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
        let empty = empty.filter(Emptiness::any);
        if let Some(empty) = &empty {
            say("occupancy", empty.bytes());
        }
        self.tables.insert(shape.id, Tables { key: wanted, table: segments, pairs, empty });
    }
}
