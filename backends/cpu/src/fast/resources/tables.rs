//! What whole segments of a shape add, and where nothing of it can be seen.

use volact_core::{
    TableInterpolation, VolumeTexture, glam::DVec3, mutated, resolve::ResolvedShape, table::ResolvedTable,
    volume::Components,
};

use super::{BoundsKey, density, voxels};
use crate::fast::{
    bounds::{Emptiness, ValueBounds, number_range},
    classify::{SegmentTable, Units},
    direct::Direct,
    fetch::Voxels,
    options::{Classification, Settings},
    over::Classes,
    preintegrate::SegmentPairs,
    sharp,
};

/// What a shape's tables depend on.
#[derive(Clone, Debug, PartialEq)]
pub struct TableKey {
    /// The table's identity; 0 where components are the colour.
    table: u64,
    range: [f64; 2],
    bounds: BoundsKey,
    nearest: bool,
    meaning: Components,
    unit: f64,
    step: f64,
    /// Samples a world unit along each axis, where the classification depends on them.
    density: DVec3,
    classification: Classification,
    skipping: bool,
}

impl TableKey {
    /// What the tables of an `over` shape depend on.
    pub fn new(
        shape: &ResolvedShape,
        texture: &VolumeTexture,
        bounds: BoundsKey,
        step: f64,
        settings: &Settings,
    ) -> Option<Self> {
        let post = settings.classification == Classification::Post;
        Some(Self {
            table: if mutated!("stale_table") { 0 } else { shape.table("lookup_table").map_or(0, |t| t.id()) },
            range: texture.range(),
            bounds,
            nearest: texture.filter() == volact_core::Filter::Nearest,
            meaning: texture.meaning(),
            unit: shape.float("unit_distance")?,
            step,
            density: if post { DVec3::ZERO } else { density(shape, texture) },
            classification: settings.classification,
            skipping: settings.skipping,
        })
    }
}

/// Tables of a shape.
#[derive(Debug)]
pub struct Tables {
    /// What they depend on.
    pub key: TableKey,
    made: Made,
    /// What can be skipped.
    pub empty: Option<Emptiness>,
}

#[derive(Debug)]
enum Made {
    Table { table: SegmentTable, pairs: Option<SegmentPairs> },
    Direct(Direct),
}

impl Tables {
    /// Makes them; says what was made.
    pub fn new(
        key: TableKey,
        shape: &ResolvedShape,
        texture: &VolumeTexture,
        bounds: Option<&ValueBounds>,
        settings: &Settings,
        say: &mut impl FnMut(&str, usize),
    ) -> Self {
        let (voxels, units) = voxels(shape, texture);
        let length = key.step / key.unit;
        let range = if mutated!("entries_from_0_to_1") { [0.0, 1.0] } else { key.range };
        let resolved = shape.table("lookup_table").map(|t| (t.interpolation(), t.resolve(range)));
        let bounds = bounds.filter(|_| settings.skipping);
        let (made, empty) = match resolved {
            None => {
                let direct = Direct::components(key.meaning, key.range, units, length);
                let seen = |lo, hi| opaque_components(key.meaning, key.range, units, [lo, hi]);
                (Made::Direct(direct), bounds.map(|b| b.emptiness(seen)))
            }
            Some((TableInterpolation::Pre, table)) => {
                let direct = Direct::voxels(&table, &voxels, units, length);
                (Made::Direct(direct), bounds.map(|b| b.emptiness(opaque(&table, units))))
            }
            Some((TableInterpolation::Post, table)) => {
                // The same with and without skipping, so that tables and picture are the same.
                let range = bounds.map_or_else(|| number_range(&voxels, settings.threads), |b| b.range);
                let step = key.density * key.step;
                let (table, pairs) = classification(&table, (&voxels, units), range, (length, step), settings);
                let seen = |lo, hi| visible(&table, pairs.as_ref(), lo, hi);
                let empty = bounds.map(|b| b.emptiness(seen));
                say("classification", table.bytes());
                (Made::Table { table, pairs }, empty)
            }
        };
        match &made {
            Made::Table { pairs: Some(pairs), .. } => say("pre-integration", pairs.bytes()),
            Made::Direct(direct) => say("classification", direct.bytes()),
            Made::Table { .. } => {}
        }
        let empty = empty.filter(Emptiness::any);
        if let Some(empty) = &empty {
            say("occupancy", empty.bytes());
        }
        Self { key, made, empty }
    }

    /// What whole segments add.
    pub fn classes(&self) -> Classes<'_> {
        match &self.made {
            Made::Table { pairs: Some(pairs), .. } => Classes::Ends(pairs),
            Made::Table { table, pairs: None } => Classes::Middle(table),
            Made::Direct(direct) => Classes::Direct(direct),
        }
    }

    /// Whether they are pre-integrated.
    pub fn pre_integrated(&self) -> bool {
        matches!(self.made, Made::Table { pairs: Some(_), .. })
    }

    /// Whether parts of segments cannot be told from whole ones: see [`SegmentTable::saturated`].
    pub fn saturated(&self) -> bool {
        matches!(&self.made, Made::Table { table, .. } if table.saturated)
    }

    /// Whether a spike of the table is between its entries: see [`SegmentTable::lost`].
    pub fn loses_spikes(&self) -> bool {
        matches!(&self.made, Made::Table { table, pairs: None } if table.lost)
    }

    /// Entries along an axis; 0 where nothing is tabulated.
    pub fn width(&self) -> usize {
        match &self.made {
            Made::Table { table, pairs } => pairs.as_ref().map_or(table.nodes, |p| p.nodes),
            Made::Direct(_) => 0,
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let made = match &self.made {
            Made::Table { table, pairs } => table.bytes() + pairs.as_ref().map_or(0, SegmentPairs::bytes),
            Made::Direct(direct) => direct.bytes(),
        };
        made + self.empty.as_ref().map_or(0, Emptiness::bytes)
    }
}

/// Whether a table is opaque anywhere between two numbers.
pub fn opaque(table: &ResolvedTable, units: Units) -> impl Fn(f32, f32) -> bool {
    move |lo, hi| {
        let [a, b] = [lo, hi].map(|v| units.data(f64::from(v)));
        // A little more, for what rounding of numbers may let in.
        let wide = 1e-6 * [a, b].iter().filter(|v| v.is_finite()).map(|v| v.abs()).sum::<f64>();
        table.max_opacity(a.min(b) - wide, a.max(b) + wide) > 0.0
    }
}

/// Whether components of these numbers may be opaque at all.
fn opaque_components(meaning: Components, [low, high]: [f64; 2], units: Units, numbers: [f32; 2]) -> bool {
    let by_opacity = matches!(meaning, Components::Intensity | Components::LuminanceAlpha | Components::Rgba);
    // A little more than nothing, for what rounding may make of it.
    let opaque = |number: f32| (units.data(f64::from(number)) - low) / (high - low) > -1e-6;
    !by_opacity || numbers.into_iter().any(opaque)
}

/// The table of whole segments, and pairs where they are asked for and better.
fn classification(
    resolved: &ResolvedTable,
    (voxels, units): (&Voxels<'_>, Units),
    range: Option<[f32; 2]>,
    (h, step): (f64, DVec3),
    settings: &Settings,
) -> (SegmentTable, Option<SegmentPairs>) {
    let range = range.map(|r| r.map(f64::from));
    // Floats may be infinite: then the table's own ends count.
    let occurring = range.filter(|_| !voxels.scalar.is_float());
    let segments = SegmentTable::new(resolved, units, occurring, h);
    let estimate = |pairs: Option<&SegmentPairs>| sharp::estimate(voxels, resolved, (&segments, pairs), units, h, step);
    let asked = !voxels.nearest && settings.classification != Classification::Post;
    let first = if asked { estimate(None) } else { sharp::Estimate::default() };
    let forced = settings.classification == Classification::PreIntegrated;
    let wanted = asked && (forced || first.matters());
    // As far beyond the table's own values as a segment reaches; farther would cost nodes.
    let reach = |[a, b]: [f64; 2]| {
        let whole = [a, b].iter().chain(&segments.domain).all(|v| v.fract() == 0.0);
        let change = if whole { (1.5 * first.change).ceil() } else { 1.5 * first.change };
        [a.max(segments.domain[0] - change), b.min(segments.domain[1] + change)]
    };
    let range = range.map(reach).filter(|[a, b]| a <= b);
    let budget = (voxels.bytes.len() / 10).max(5 << 19);
    let most = SegmentPairs::most_nodes(budget).min(1024);
    let pairs = wanted
        .then(|| SegmentPairs::new(resolved, units, (&segments, range), h, most, settings.threads))
        .filter(|pairs| forced || estimate(Some(pairs)).helps());
    (segments, pairs)
}

/// Whether any number of an interval can be seen.
fn visible(segments: &SegmentTable, pairs: Option<&SegmentPairs>, lo: f32, hi: f32) -> bool {
    let Some(pairs) = pairs else { return segments.sees(lo, hi) };
    if let Some(end) = segments.beyond(lo, hi) {
        return end;
    }
    // The coarser grid of pairs reaches farther around a value.
    let node = |v: f32| (v * pairs.scale + pairs.offset).clamp(0.0, (pairs.nodes - 1) as f32);
    let (a, b) = ((node(lo) - 1.001).floor().max(0.0), (node(hi) + 1.001).ceil().min((pairs.nodes - 1) as f32));
    let number = |n: f32| (n - pairs.offset) / pairs.scale;
    segments.sees(number(a).min(lo), number(b).max(hi))
}
