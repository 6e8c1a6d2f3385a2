//! A lookup table as programs ask for it: straight colour and opacity, or colour and extinction,
//! by values in data units.

#![expect(unsafe_code, reason = "kernels of a vector unit")]

use volact_core::{
    ControlPoint,
    table::{ENTRY_REACH, ResolvedTable},
};

use super::batch::ROWS;
use crate::fast::{
    classify::aligned,
    power,
    simd::{LANES, Simd},
    sweep::{
        lane::Lane,
        piece::{Run, Sight, cut},
    },
    walk::ALL,
};

/// Most control points that are found by comparing with each of them.
const FEW: usize = 24;
/// Bins between the first and the last control point, where there are more.
const BINS: usize = 1024;

/// A table of which each value's stretch between two control points is found without branches.
#[derive(Debug)]
pub struct Lookup {
    /// Values of the points, rising; after the last one infinity.
    values: Vec<f32>,
    /// By how many points are not above a value: the line of colour and opacity there, as its
    /// numbers at a value and their slopes.
    lines: Vec<[[f32; 4]; 2]>,
    /// The values at which the lines have these numbers.
    anchors: Vec<f32>,
    /// A point not after the one that follows the bin's values.
    bins: Vec<u32>,
    low: f32,
    scale: f32,
    unit: f64,
    seen: [f32; 2],
    baked: Option<Baked>,
}

/// Colour and extinction at equidistant values, where linear interpolation between them is as good
/// as the table itself.
#[derive(Debug)]
struct Baked {
    /// Nodes, the last one twice.
    nodes: Vec<[f32; 4]>,
    /// Node = value · scale + offset.
    scale: f32,
    offset: f32,
}

/// Most nodes, and the error of −ln(1 − a) that they must keep within.
const NODES: usize = 1 << 13;
const ERROR: f64 = 1e-6;
/// Above this opacity the extinction bends too much to be interpolated.
const DENSE: f64 = 0.9;

impl Baked {
    /// `None` for tables with steps, points that are not commensurable, or dense places.
    fn new(table: &ResolvedTable, unit: f64) -> Option<Self> {
        let points = table.points();
        let [first, last] = [points.first()?.value, points.last()?.value];
        let marks: Vec<f64> = points.iter().map(|p| p.value).collect();
        let dense = points.iter().any(|p| p.opacity > DENSE);
        if dense || !(last - first).is_finite() || points.windows(2).any(|p| p[0].value >= p[1].value) {
            return None;
        }
        let mut count = aligned(&marks, [first, last])?;
        let at = |t: f64| {
            let [r, g, b, a] = table.classify(first + (last - first) * t);
            [r, g, b, -(-a).ln_1p()]
        };
        let off = |count: usize, i: usize| {
            let node = |i: f64| at(i / count as f64);
            let (ends, exact) = ([node(i as f64), node((i + 1) as f64)], node(i as f64 + 0.5));
            (0..4).map(|c| (exact[c] - 0.5 * (ends[0][c] + ends[1][c])).abs()).fold(0.0, f64::max)
        };
        while (0..count).any(|i| off(count, i) > ERROR) {
            count *= 2;
            if count > NODES {
                return None;
            }
        }
        let node = |i: usize| {
            let [r, g, b, depth] = at(i.min(count) as f64 / count as f64);
            [r, g, b, depth / unit].map(|v| v as f32)
        };
        let scale = count as f64 / (last - first);
        let (scale, offset) = if last > first { (scale, -first * scale) } else { (0.0, 0.0) };
        let nodes = (0..count + 2).map(node).collect();
        Some(Self { nodes, scale: scale as f32, offset: offset as f32 })
    }

    /// The node before each of sixteen values, and the part of the way to the next; NaN for NaN.
    ///
    /// # Safety
    /// Called from a function compiled for `S` on a machine that has it.
    #[inline(always)]
    unsafe fn place<S: Simd>(&self, value: &[f32; LANES]) -> (S::I, S::F) {
        // SAFETY: the caller's promise.
        unsafe {
            let value = S::load(value);
            let unknown = S::nan_bits(value);
            let most = S::splat((self.nodes.len() - 2) as f32);
            let place = S::fma(value, S::splat(self.scale), S::splat(self.offset));
            let place = S::min(S::max(S::select(unknown, S::splat(0.0), place), S::splat(0.0)), most);
            let whole = S::floor(place);
            (S::to_int(whole), S::select(unknown, S::splat(f32::NAN), S::sub(place, whole)))
        }
    }

    /// Colour and extinction at a place.
    ///
    /// # Safety
    /// As [`place`](Self::place), which gave the place.
    #[inline(always)]
    unsafe fn between<S: Simd>(&self, node: &[i32; LANES], part: S::F) -> [S::F; 4] {
        // SAFETY: the caller's promise; nodes are inside, and the last one has another after it.
        unsafe { S::between_rows(self.nodes.as_ptr().cast(), node, part) }
    }

    /// Colour and extinction of rows of values. Places come first, all of them: so the nodes are
    /// loaded by numbers in memory, and their latencies overlap.
    ///
    /// # Safety
    /// As [`place`](Self::place).
    #[inline(always)]
    unsafe fn media<S: Simd>(&self, values: &[f32], out: &mut [&mut [f32]]) {
        let (mut nodes, mut parts) = ([[0i32; LANES]; ROWS], [[0f32; LANES]; ROWS]);
        for (i, some) in values.chunks(ROWS * LANES).enumerate() {
            let rows = some.as_chunks::<LANES>().0;
            for (value, (node, part)) in rows.iter().zip(nodes.iter_mut().zip(&mut parts)) {
                // SAFETY: the caller's promise.
                unsafe {
                    let place = self.place::<S>(value);
                    S::store_int(place.0, node);
                    S::store(place.1, part);
                }
            }
            for (r, (node, part)) in nodes.iter().zip(&parts).take(rows.len()).enumerate() {
                // SAFETY: the caller's promise.
                unsafe { put::<S>(self.between::<S>(node, S::load(part)), i * ROWS + r, out) }
            }
        }
    }
}

/// Stores four numbers in a row of sixteen, as far as they are wanted.
#[inline(always)]
unsafe fn put<S: Simd>(numbers: [S::F; 4], row: usize, out: &mut [&mut [f32]]) {
    for (to, numbers) in out.iter_mut().zip(numbers) {
        if let Some(to) = to.as_chunks_mut::<LANES>().0.get_mut(row) {
            // SAFETY: the caller's promise.
            unsafe { S::store(numbers, to) };
        }
    }
}

/// [`Lookup::seen`].
fn seen(table: &ResolvedTable) -> [f32; 2] {
    let points = table.points();
    let some = |p: &ControlPoint| p.opacity > 0.0;
    let (Some(first), Some(last)) = (points.iter().position(some), points.iter().rposition(some)) else {
        return [f32::INFINITY, f32::NEG_INFINITY];
    };
    let low = first.checked_sub(1).map_or(f32::NEG_INFINITY, |i| points[i].value as f32);
    let high = points.get(last + 1).map_or(f32::INFINITY, |p| p.value as f32);
    [low, high]
}

impl Lookup {
    /// A table with the length over which its opacity is the fraction absorbed.
    pub fn new(table: &ResolvedTable, unit: f64) -> Self {
        let points = table.points();
        let mut values: Vec<f32> = points.iter().map(|p| p.value as f32).collect();
        let rgba = |i: usize| {
            let p = &points[i];
            [p.color[0], p.color[1], p.color[2], p.opacity]
        };
        let last = points.len() - 1;
        let flat = |i: usize| [rgba(i).map(|v| v as f32), [0.0; 4]];
        let line = |i: usize| {
            let (a, b) = (rgba(i), rgba(i + 1));
            let width = f64::from(values[i + 1]) - f64::from(values[i]);
            let slope = [0, 1, 2, 3].map(|c| if width > 0.0 { ((b[c] - a[c]) / width) as f32 } else { 0.0 });
            [a.map(|v| v as f32), slope]
        };
        let mut lines = vec![flat(0)];
        lines.extend((0..last).map(line));
        lines.push(flat(last));
        let mut anchors = vec![values[0]];
        anchors.extend(&values);
        let (low, high) = (values[0], values[last]);
        let scale = BINS as f32 / (high - low);
        let scale = if scale.is_finite() && scale > 0.0 && points.len() > FEW { scale } else { 0.0 };
        let first = |bin: usize| {
            let value = low + bin as f32 / scale;
            values.partition_point(|v| *v < value).saturating_sub(2) as u32
        };
        let bins = if scale > 0.0 { (0..=BINS).map(first).collect() } else { vec![0] };
        values.push(f32::INFINITY);
        let seen = seen(table);
        Self { values, lines, anchors, bins, low, scale, unit, seen, baked: Baked::new(table, unit) }
    }

    /// Everything below the first value and above the second is transparent.
    pub fn seen(&self) -> [f32; 2] {
        self.seen
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        let baked = self.baked.as_ref().map_or(0, |baked| size_of_val(baked.nodes.as_slice()));
        let points = size_of_val(self.lines.as_slice()) + 4 * (self.values.len() + self.anchors.len());
        baked + points + size_of_val(self.bins.as_slice())
    }

    /// How many control points are not above sixteen values.
    ///
    /// # Safety
    /// Called from a function compiled for `S` on a machine that has it.
    #[inline(always)]
    unsafe fn places<S: Simd>(&self, value: &[f32; LANES]) -> S::I {
        let points = &self.values[..self.values.len() - 1];
        // SAFETY: the caller's promise.
        unsafe {
            if points.len() > FEW {
                let mut found = [0f32; LANES];
                for l in 0..LANES {
                    found[l] = self.search(value[l]) as f32;
                }
                return S::to_int(S::load(&found));
            }
            let (value, one, none) = (S::load(value), S::splat_int(1), S::splat_int(0));
            let mut places = none;
            for point in points {
                let below = S::lt_bits(value, S::splat(*point));
                places = S::add_int(places, S::select_int(below, none, one));
            }
            places
        }
    }

    /// The same of one value, from its bin on.
    fn search(&self, value: f32) -> usize {
        let last = self.values.len() - 1;
        let bin = ((value - self.low) * self.scale) as usize;
        let mut after = self.bins[bin.min(self.bins.len() - 1)] as usize;
        while after < last && self.values[after] <= value {
            after += 1;
        }
        after
    }

    /// Straight colour and opacity of the entries at values, not interpolated; transparent black
    /// where there are none. Rows that nobody wants are empty.
    pub fn entries(&self, values: &[f32], out: &mut [&mut [f32]]) {
        let reach = ENTRY_REACH as f32;
        for (i, value) in values.iter().enumerate() {
            // The line after a point begins with the point's own numbers.
            let after = self.search(value + reach);
            let found = after > 0 && value - self.values[after - 1] <= reach;
            let rgba = if found { self.lines[after][0] } else { [0.0; 4] };
            out.iter_mut().zip(rgba).for_each(|(row, v)| row.get_mut(i).into_iter().for_each(|to| *to = v));
        }
    }

    /// Straight colour and opacity of sixteen values; NaN for NaN.
    ///
    /// # Safety
    /// Called from a function compiled for `S` on a machine that has it.
    #[inline(always)]
    unsafe fn classify<S: Simd>(&self, value: &[f32; LANES]) -> [S::F; 4] {
        // SAFETY: the caller's promise; each place has a line of two rows, and an anchor.
        unsafe {
            let places = self.places::<S>(value);
            let (mut first, mut second) = ([0i32; LANES], [0i32; LANES]);
            let twice = S::add_int(places, places);
            S::store_int(twice, &mut first);
            S::store_int(S::add_int(twice, S::splat_int(1)), &mut second);
            let table = self.lines.as_ptr().cast::<u8>();
            let (from, slope) = (S::rows(table, &first), S::rows(table, &second));
            let anchor = S::as_float(S::gather(self.anchors.as_ptr().cast(), S::shl::<2>(places)));
            let value = S::load(value);
            // Infinite values stand beyond the last point, where nothing changes.
            let bounded = S::max(S::min(value, S::splat(f32::MAX)), S::splat(f32::MIN));
            let off = S::sub(bounded, anchor);
            let unknown = S::nan_bits(value);
            let mut rgba = [off; 4];
            for c in 0..4 {
                rgba[c] = S::select(unknown, S::splat(f32::NAN), S::fma(slope[c], off, from[c]));
            }
            rgba
        }
    }

    /// Colour and extinction of sixteen values; NaN for NaN.
    ///
    /// # Safety
    /// Called from a function compiled for `S` on a machine that has it.
    #[inline(always)]
    pub unsafe fn medium<S: Simd>(&self, value: &[f32; LANES]) -> [S::F; 4] {
        // SAFETY: the caller's promise.
        unsafe {
            if let Some(baked) = &self.baked {
                let (node, part) = baked.place::<S>(value);
                let mut nodes = [0i32; LANES];
                S::store_int(node, &mut nodes);
                return baked.between::<S>(&nodes, part);
            }
            let [r, g, b, a] = self.classify::<S>(value);
            [r, g, b, self.extinction::<S>(a)]
        }
    }

    /// Extinctions of opacities: −ln(1 − a) over the unit distance; NaN for NaN.
    ///
    /// ln of the rounded u = 1 − a, and (1 − a − u)/u more
    /// for what was rounded away, so that small opacities keep their digits.
    ///
    /// # Safety
    /// Called from a function compiled for `S` on a machine that has it.
    #[inline(always)]
    unsafe fn extinction<S: Simd>(&self, a: S::F) -> S::F {
        // SAFETY: the caller's promise.
        unsafe {
            let (zero, one) = (S::splat(0.0), S::splat(1.0));
            let u = S::max(S::sub(one, a), S::splat(f32::MIN_POSITIVE));
            let rounded = S::sub(S::sub(one, u), a);
            let log = power::log::<S>(u, S::div(rounded, u));
            let sigma = S::mul(S::sub(zero, log), S::splat((1.0 / self.unit) as f32));
            // Comparisons with NaN hold nowhere.
            let some = S::lt_bits(zero, a);
            let opaque = ALL & !S::lt_bits(a, one) & some;
            let sigma = S::select(some, sigma, S::select(S::nan_bits(a), a, zero));
            S::select(opaque, S::splat(f32::INFINITY), sigma)
        }
    }
}

/// What a table says of values: straight colour with opacity, or with extinction. Rows that nobody
/// wants are empty.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn classified<S: Simd>(table: &Lookup, values: &[f32], out: &mut [&mut [f32]], medium: bool) {
    if let (Some(baked), true) = (&table.baked, medium) {
        // SAFETY: the caller's promise.
        return unsafe { baked.media::<S>(values, out) };
    }
    for (i, value) in values.as_chunks::<LANES>().0.iter().enumerate() {
        // SAFETY: the caller's promise.
        unsafe {
            put::<S>(if medium { table.medium::<S>(value) } else { table.classify::<S>(value) }, i, out);
        }
    }
}

/// A lookup table over segments on which the value runs evenly.
#[derive(Debug)]
pub struct Segments {
    /// The table.
    pub table: ResolvedTable,
    /// The length over which its opacity is the fraction absorbed.
    pub unit: f64,
}

impl Segments {
    /// The uniform medium that looks like a segment with values from `front` to `back` over a
    /// `length`: colour and extinction. NaN where a number is.
    pub fn medium(&self, [front, back, length]: [f32; 3]) -> [f32; 4] {
        let [front, back, length] = [front, back, length].map(f64::from);
        if front.is_nan() || back.is_nan() || length.is_nan() || length <= 0.0 {
            return [f32::NAN; 4];
        }
        let (mut lane, mut cuts) = (Lane::default(), Vec::new());
        let run = Run { value: [front, back], table: &self.table };
        cut([0.0, length], run, None, self.unit, &mut cuts, &mut lane.pieces);
        let mut sight = Sight { color: [0.0; 4], depth: f64::INFINITY, threshold: 2.0 };
        lane.pass(&[], 0.0, &mut sight);
        let [r, g, b, a] = sight.color;
        if a > 0.0 {
            return [r / a, g / a, b / a, -(-a.min(1.0)).ln_1p() / length].map(|v| v as f32);
        }
        let [r, g, b, _] = self.table.classify(front);
        [r, g, b, 0.0].map(|v| v as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fast::{dispatch, simd::Unit};
    use volact_core::LookupTable;

    #[test]
    fn what_is_looked_up_is_the_table() {
        let point = |value: f64, opacity: f64| ControlPoint { value, color: [opacity, 0.5, 1.0 - opacity], opacity };
        let few = vec![point(-3.0, 0.0), point(0.0, 0.4), point(0.0, 0.9), point(0.01, 0.2), point(90.0, 1.0)];
        let mut many: Vec<_> = (0..60).map(|i| point(f64::from(i), f64::from(i % 7) / 7.0)).collect();
        many.insert(30, point(30.0, 1.0));
        let faint = vec![point(0.0, 0.0), point(1.0, 1e-6), point(2.0, 1e-3), point(3.0, 0.999), point(4.0, 0.4)];
        let soft = vec![point(-2.0, 0.0), point(0.0, 0.0), point(10.0, 0.1), point(20.0, 0.3), point(62.0, 0.0)];
        assert!([&few, &many, &faint].iter().all(|points| {
            Baked::new(&LookupTable::from_points((*points).clone()).unwrap().resolve([0.0, 1.0]), 2.5).is_none()
        }));
        assert!(Baked::new(&LookupTable::from_points(soft.clone()).unwrap().resolve([0.0, 1.0]), 2.5).is_some());
        for unit in [Unit::Plain, Unit::Avx2, Unit::Avx512].into_iter().filter(|u| u.available()) {
            let look = |lookup: &Lookup, value: f32, medium: bool| {
                let mut rows = [[0f32; LANES]; 4];
                let mut out = rows.each_mut().map(|row| row.as_mut_slice());
                dispatch::classified(unit, lookup, &[value; LANES], &mut out, medium);
                rows.map(|row| f64::from(row[LANES - 1]))
            };
            for points in [few.clone(), many.clone(), faint.clone(), soft.clone()] {
                let table = LookupTable::from_points(points.clone()).unwrap().resolve([0.0, 1.0]);
                let lookup = Lookup::new(&table, 2.5);
                let extremes = [f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, f32::MAX, 0.0];
                let values: Vec<f32> = (-400..10_000).map(|i| i as f32 * 0.01).chain(extremes).collect();
                for value in values {
                    let (found, wanted) = (look(&lookup, value, false), table.classify(f64::from(value)));
                    assert!((0..4).all(|c| (found[c] - wanted[c]).abs() < 2e-4), "{value}: {found:?}");
                    let (sigma, a) = (look(&lookup, value, true)[3], found[3]);
                    let wanted = if a >= 1.0 { f64::INFINITY } else { -(-a).ln_1p() / 2.5 };
                    let close = sigma == wanted || (sigma - wanted).abs() <= 4e-7 * wanted + 2e-6;
                    assert!(close, "{unit:?}: opacity {a} has {sigma}, not {wanted}");
                }
                let places = points.iter().flat_map(|p| [-0.5, -0.0011, 0.0, 0.0005, 0.5].map(|d| p.value + d));
                let names: Vec<f32> = places.map(|v| v as f32).chain(extremes).chain([f32::NAN]).collect();
                let mut rows = vec![vec![0f32; names.len()]; 4];
                lookup.entries(&names, &mut rows.iter_mut().map(Vec::as_mut_slice).collect::<Vec<_>>());
                for (i, value) in names.into_iter().enumerate() {
                    let wanted = table.entry(f64::from(value)).map(|v| v as f32);
                    assert_eq!([0, 1, 2, 3].map(|c: usize| rows[c][i]), wanted, "the entry of {value}");
                }
                assert!(look(&lookup, f32::NAN, true).iter().all(|v| v.is_nan()));
            }
            let one = LookupTable::from_points([point(7.0, 0.3)]).unwrap().resolve([0.0, 1.0]);
            assert!((look(&Lookup::new(&one, 1.0), 1e30, false)[3] - 0.3).abs() < 1e-7);
        }
    }
}
