//! Lookup tables: from a value to a straight colour and an opacity.
//!
//! Between neighbouring points both are linear; outside the ends they are clamped. Opacity is the
//! fraction absorbed over the shader's `unit_distance`.

use thiserror::Error;

use crate::{Buffer, volume::next_version};

/// One point of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPoint {
    /// Value in data units.
    pub value: f64,
    /// Straight colour: red, green, blue.
    pub color: [f64; 3],
    /// Opacity over one unit distance, 0 to 1.
    pub opacity: f64,
}

/// How far a value may be from that of an entry and still mean it: places of equidistant entries
/// are rounded.
pub const ENTRY_REACH: f64 = 1.0 / 1024.0;

/// Whether the table applies after or before interpolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum TableInterpolation {
    /// Samples are interpolated, then classified.
    #[default]
    Post,
    /// Voxels are classified; colour and opacity are interpolated, each on its own.
    Pre,
}

/// Why a table cannot be.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum TableError {
    /// No entries.
    #[error("lookup table: no entries, wanted at least one")]
    Empty,
    /// A number out of bounds.
    #[error("lookup table: entry {entry}: {what} is {found}, wanted {wanted}")]
    Entry {
        /// Index of the entry.
        entry: usize,
        /// Which number.
        what: &'static str,
        /// What was found.
        found: f64,
        /// What was wanted.
        wanted: &'static str,
    },
    /// A buffer that holds no whole number of entries.
    #[error("lookup table: {found} bytes, wanted a multiple of 16 (four f32 an entry), aligned to 4")]
    Length {
        /// Bytes given.
        found: usize,
    },
    /// A domain without extent.
    #[error("lookup table: domain {found:?}, wanted two finite values that rise")]
    Domain {
        /// The domain.
        found: [f64; 2],
    },
}

#[derive(Clone, Debug)]
enum Entries {
    Points(std::sync::Arc<[ControlPoint]>),
    /// RGBA f32, equidistant over the domain.
    Uniform {
        data: Buffer,
        domain: Option<[f64; 2]>,
    },
}

/// A lookup table: shared by reference, cheap to clone, immutable.
#[derive(Clone, Debug)]
pub struct LookupTable {
    id: u64,
    entries: Entries,
    interpolation: TableInterpolation,
}

impl LookupTable {
    /// A table of control points at any positions, sorted here by value. Two points at one value
    /// make a step: below it the first holds, from it on the second.
    ///
    /// # Errors
    /// If there are none, or a number is not finite, or an opacity lies outside 0 to 1.
    pub fn from_points(points: impl Into<Vec<ControlPoint>>) -> Result<Self, TableError> {
        let mut points = points.into();
        if points.is_empty() {
            return Err(TableError::Empty);
        }
        for (entry, p) in points.iter().enumerate() {
            check(entry, "value", p.value, p.value.is_finite(), "a finite number")?;
            check_rgba(entry, [p.color[0], p.color[1], p.color[2], p.opacity])?;
        }
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
        Ok(Self::with_entries(Entries::Points(points.into())))
    }

    /// A table of equidistant RGBA entries (four f32 each, straight colour and opacity), any
    /// number of them, over `domain`, ends included; over the texture's range where that is
    /// `None`. The entries are shared, not copied.
    ///
    /// # Errors
    /// As [`from_points`](Self::from_points), or if the buffer has not whole, aligned entries.
    pub fn from_entries(data: impl Into<Buffer>, domain: Option<[f64; 2]>) -> Result<Self, TableError> {
        let data = data.into();
        let length = TableError::Length { found: data.len() };
        let entries = data.as_slice::<[f32; 4]>().ok_or(length)?;
        if entries.is_empty() {
            return Err(TableError::Empty);
        }
        for (entry, rgba) in entries.iter().enumerate() {
            check_rgba(entry, rgba.map(f64::from))?;
        }
        if let Some(found) = domain
            && !(found[0].is_finite() && found[1].is_finite() && found[0] < found[1])
        {
            return Err(TableError::Domain { found });
        }
        Ok(Self::with_entries(Entries::Uniform { data, domain }))
    }

    /// A grey ramp by window: black and transparent at `level − window/2`, white with `opacity`
    /// at `level + window/2`, as radiologists set it.
    ///
    /// # Errors
    /// If `window` is not positive or a number is not finite.
    pub fn window_level(window: f64, level: f64, opacity: f64) -> Result<Self, TableError> {
        check(0, "window", window, window > 0.0 && window.is_finite(), "a positive number")?;
        Self::from_points([
            ControlPoint { value: level - window / 2.0, color: [0.0; 3], opacity: 0.0 },
            ControlPoint { value: level + window / 2.0, color: [1.0; 3], opacity },
        ])
    }

    /// An opaque grey ramp over a range: the default of shaders that need no opacity.
    pub fn grey(range: [f64; 2]) -> Self {
        let point = |value, grey| ControlPoint { value, color: [grey; 3], opacity: 1.0 };
        let points = [point(range[0], 0.0), point(range[1], 1.0)];
        Self::with_entries(Entries::Points(points.into()))
    }

    /// Applies the table to voxels instead of samples.
    pub fn pre_interpolated(mut self) -> Self {
        self.interpolation = TableInterpolation::Pre;
        self.id = next_version();
        self
    }

    fn with_entries(entries: Entries) -> Self {
        Self { id: next_version(), entries, interpolation: TableInterpolation::Post }
    }

    /// What identifies the table's content.
    pub fn id(&self) -> u64 {
        self.id
    }

    /// Whether it applies after or before interpolation.
    pub fn interpolation(&self) -> TableInterpolation {
        self.interpolation
    }

    /// Number of entries or control points.
    pub fn len(&self) -> usize {
        match &self.entries {
            Entries::Points(points) => points.len(),
            Entries::Uniform { data, .. } => data.len() / 16,
        }
    }

    /// Never true.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Bytes of the entries.
    pub fn bytes(&self) -> usize {
        match &self.entries {
            Entries::Points(points) => size_of_val::<[ControlPoint]>(points),
            Entries::Uniform { data, .. } => data.len(),
        }
    }

    /// The equidistant entries and their domain, where the table has such.
    pub(crate) fn uniform(&self) -> Option<(&Buffer, Option<[f64; 2]>)> {
        match &self.entries {
            Entries::Uniform { data, domain } => Some((data, *domain)),
            Entries::Points(_) => None,
        }
    }

    /// The table as control points in rising order, for a texture of this value `range`.
    pub fn points(&self, range: [f64; 2]) -> Vec<ControlPoint> {
        match &self.entries {
            Entries::Points(points) => points.to_vec(),
            Entries::Uniform { data, domain } => {
                let entries = data.as_slice::<[f32; 4]>().unwrap_or(&[]);
                let [lo, hi] = domain.unwrap_or([range[0].min(range[1]), range[0].max(range[1])]);
                let last = entries.len().saturating_sub(1).max(1) as f64;
                let place = |(i, rgba): (usize, &[f32; 4])| {
                    let [r, g, b, opacity] = rgba.map(f64::from);
                    let t = i as f64 / last;
                    ControlPoint { value: lo * (1.0 - t) + hi * t, color: [r, g, b], opacity }
                };
                entries.iter().enumerate().map(place).collect()
            }
        }
    }

    /// Prepares the table for lookups, for a texture of this value `range`.
    pub fn resolve(&self, range: [f64; 2]) -> ResolvedTable {
        ResolvedTable { points: self.points(range) }
    }
}

/// Equal when they have the same content by identity.
impl PartialEq for LookupTable {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

/// A table whose points all have a value: the plain definition of classification.
#[derive(Clone, Debug, PartialEq)]
pub struct ResolvedTable {
    points: Vec<ControlPoint>,
}

impl ResolvedTable {
    /// The control points, in rising order.
    pub fn points(&self) -> &[ControlPoint] {
        &self.points
    }

    /// Straight colour and opacity at a value in data units: linear between points, clamped
    /// outside, transparent black at NaN.
    pub fn classify(&self, value: f64) -> [f64; 4] {
        if value.is_nan() {
            return [0.0; 4];
        }
        let after = self.points.partition_point(|p| p.value <= value);
        let rgba = |p: &ControlPoint| [p.color[0], p.color[1], p.color[2], p.opacity];
        let Some(b) = self.points.get(after) else { return rgba(&self.points[after - 1]) };
        let Some(a) = after.checked_sub(1).map(|i| &self.points[i]) else { return rgba(b) };
        let t = (value - a.value) / (b.value - a.value);
        let (a, b) = (rgba(a), rgba(b));
        std::array::from_fn(|c| a[c] * (1.0 - t) + b[c] * t)
    }

    /// Straight colour and opacity of the entry at a value: of the last control point within
    /// [`ENTRY_REACH`] of it; transparent black where there is none. Nothing is interpolated, for
    /// values that are names, like labels.
    pub fn entry(&self, value: f64) -> [f64; 4] {
        let after = self.points.partition_point(|p| p.value <= value + ENTRY_REACH);
        let found = after.checked_sub(1).map(|i| &self.points[i]);
        let found = found.filter(|p| value - p.value <= ENTRY_REACH);
        found.map_or([0.0; 4], |p| [p.color[0], p.color[1], p.color[2], p.opacity])
    }

    /// Whether there is an entry at a value, as [`entry`](Self::entry) finds it.
    pub fn has_entry(&self, value: f64) -> bool {
        self.points.iter().any(|p| (value - p.value).abs() <= ENTRY_REACH)
    }

    /// Highest opacity over the values `lo..=hi`; zero means that nothing there can be seen.
    pub fn max_opacity(&self, lo: f64, hi: f64) -> f64 {
        let first = self.points.partition_point(|p| p.value < lo);
        let last = self.points.partition_point(|p| p.value <= hi);
        let inner = self.points[first..last.max(first)].iter().map(|p| p.opacity);
        inner.fold(self.classify(lo)[3].max(self.classify(hi)[3]), f64::max)
    }
}

fn check(entry: usize, what: &'static str, found: f64, good: bool, wanted: &'static str) -> Result<(), TableError> {
    if good { Ok(()) } else { Err(TableError::Entry { entry, what, found, wanted }) }
}

fn check_rgba(entry: usize, rgba: [f64; 4]) -> Result<(), TableError> {
    for (what, v) in ["red", "green", "blue"].into_iter().zip(rgba) {
        check(entry, what, v, v.is_finite() && v >= 0.0, "a finite number of at least 0")?;
    }
    check(entry, "opacity", rgba[3], (0.0..=1.0).contains(&rgba[3]), "0 to 1")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(value: f64, grey: f64, opacity: f64) -> ControlPoint {
        ControlPoint { value, color: [grey; 3], opacity }
    }

    #[test]
    fn points_interpolate_and_clamp() {
        let table = LookupTable::from_points([point(10.0, 1.0, 1.0), point(0.0, 0.0, 0.0)]).unwrap();
        let table = table.resolve([0.0, 1.0]);
        assert_eq!(table.classify(5.0), [0.5; 4]);
        assert_eq!(table.classify(-3.0), [0.0; 4]);
        assert_eq!(table.classify(30.0), [1.0; 4]);
        assert_eq!(table.classify(f64::NAN), [0.0; 4]);
    }

    #[test]
    fn two_points_at_one_value_make_a_step() {
        let points = [point(0.0, 0.0, 0.0), point(1.0, 0.0, 0.0), point(1.0, 1.0, 0.5), point(2.0, 1.0, 0.5)];
        let table = LookupTable::from_points(points).unwrap().resolve([0.0, 2.0]);
        assert_eq!(table.classify(1.0 - 1e-9)[3], 0.0);
        assert_eq!(table.classify(1.0)[3], 0.5);
        assert_eq!(table.max_opacity(0.0, 0.9), 0.0);
        assert_eq!(table.max_opacity(0.5, 1.5), 0.5);
    }

    /// Labels are names: what lies between two of them, beyond them, or is no number has no entry.
    #[test]
    fn entries_are_found_and_never_blended() {
        let points = [point(3.0, 0.0, 0.25), point(1.0, 0.5, 0.5), point(3.0, 1.0, 0.75)];
        let table = LookupTable::from_points(points).unwrap().resolve([0.0, 1.0]);
        assert_eq!(table.entry(1.0), [0.5; 4]);
        assert_eq!(table.entry(3.0), [1.0, 1.0, 1.0, 0.75]);
        for value in [-1.0, 0.0, 2.0, 2.99, 3.01, 4.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!((table.entry(value), table.has_entry(value)), ([0.0; 4], false), "{value}");
        }
        // Places of equidistant entries are rounded, and still whole.
        let data: Vec<[f32; 4]> = (0..100).map(|i| [i as f32, 0.0, 0.0, 0.5]).collect();
        let table = LookupTable::from_entries(data, Some([-7.0, 92.0])).unwrap().resolve([0.0, 1.0]);
        assert!((0..100).all(|i| table.entry(f64::from(i) - 7.0) == [f64::from(i), 0.0, 0.0, 0.5]));
    }

    #[test]
    fn entries_span_their_domain_or_the_range() {
        let data = vec![[0f32, 0.0, 0.0, 0.0], [1.0, 1.0, 1.0, 0.25], [0.0, 0.0, 0.0, 1.0]];
        let table = LookupTable::from_entries(data.clone(), None).unwrap();
        assert_eq!(table.resolve([0.0, 200.0]).classify(100.0)[3], 0.25);
        let table = LookupTable::from_entries(data, Some([-1.0, 1.0])).unwrap();
        assert_eq!(table.resolve([0.0, 200.0]).classify(0.0)[3], 0.25);
    }

    #[test]
    fn bad_entries_are_named() {
        let error = LookupTable::from_points([point(0.0, 0.0, 1.5)]).unwrap_err();
        assert_eq!(error.to_string(), "lookup table: entry 0: opacity is 1.5, wanted 0 to 1");
        assert_eq!(LookupTable::from_points([]).unwrap_err(), TableError::Empty);
        assert!(LookupTable::from_entries(vec![1f32; 7], None).is_err());
    }
}
