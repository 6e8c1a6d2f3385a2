//! Lookup tables as rows of a buffer: control points at any places, found by buckets.

use volact_core::ControlPoint;

/// The most buckets of a table.
const MOST: usize = 4096;

/// A table's rows as `table.wgsl` reads them. Points are in rising order; there is at least one.
pub fn rows(points: &[ControlPoint]) -> Vec<[u32; 4]> {
    let value = |p: &ControlPoint| p.value as f32;
    let (first, last) = (points.first().map_or(0.0, value), points.last().map_or(0.0, value));
    let wanted = (4 * points.len()).next_power_of_two().clamp(4, MOST);
    let span = f64::from(last) - f64::from(first);
    // Where one bucket is all there is, or values are too close for more, it holds everything.
    let scale = (wanted as f64 / span) as f32;
    let (buckets, scale) = if scale.is_finite() && scale > 0.0 { (wanted, scale) } else { (1, 0.0) };
    let mut rows = Vec::with_capacity(2 + buckets.div_ceil(4) + 2 * points.len());
    rows.push([first.to_bits(), last.to_bits(), scale.to_bits(), points.len() as u32]);
    rows.push([buckets as u32, 0, 0, 0]);
    let below = |b: usize| {
        // A little below where it begins, since a value's bucket is found in f32.
        let start = if b == 0 { f64::NEG_INFINITY } else { f64::from(first) + (b as f64 - 0.01) / f64::from(scale) };
        points.partition_point(|p| f64::from(value(p)) <= start).saturating_sub(1) as u32
    };
    let all: Vec<u32> = (0..buckets.next_multiple_of(4)).map(below).collect();
    rows.extend(all.chunks_exact(4).map(|four| [four[0], four[1], four[2], four[3]]));
    for (i, p) in points.iter().enumerate() {
        let next = points.get(i + 1).map_or(f32::INFINITY, value);
        let part = 1.0 / (next - value(p));
        let part = if part.is_finite() { part } else { 0.0 };
        let [r, g, b] = p.color;
        rows.push([value(p).to_bits(), part.to_bits(), 0, 0]);
        rows.push([r, g, b, p.opacity].map(|v| (v as f32).to_bits()));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use volact_core::LookupTable;

    /// What `table.wgsl` does, in f32.
    fn lookup(rows: &[[u32; 4]], v: f32) -> [f32; 4] {
        let cell = |row: usize| rows[row].map(f32::from_bits);
        let (head, count) = (cell(0), rows[0][3] as usize);
        let points = 2 + (rows[1][0] as usize).div_ceil(4);
        if v >= head[1] {
            return cell(points + 2 * count - 1);
        }
        if v < head[0] {
            return cell(points + 1);
        }
        let bucket = (((v - head[0]) * head[2]).max(0.0) as usize).min(rows[1][0] as usize - 1);
        let mut i = (rows[2 + bucket / 4][bucket % 4] as usize).min(count - 1);
        while i + 1 < count && cell(points + 2 * (i + 1))[0] <= v {
            i += 1;
        }
        let (place, a, b) = (cell(points + 2 * i), cell(points + 2 * i + 1), cell(points + 2 * i + 3));
        assert!(place[0] <= v && v < cell(points + 2 * i + 2)[0]);
        std::array::from_fn(|c| a[c] + (v - place[0]) * place[1] * (b[c] - a[c]))
    }

    proptest! {
        #[test]
        fn lookups_are_linear_between_points(
            points in prop::collection::vec((-1000.0..1000.0f32, 0.0..1.0f64), 1..40),
            steps in prop::collection::vec(0usize..40, 0..4),
            values in prop::collection::vec(-1100.0..1100.0f32, 20),
        ) {
            let point = |&(value, x): &(f32, f64)| {
                ControlPoint { value: f64::from(value), color: [x, 1.0 - x, 0.5], opacity: x }
            };
            let mut all: Vec<_> = points.iter().map(point).collect();
            // Steps: two points at one value.
            all.extend(steps.iter().filter_map(|i| points.get(*i)).map(|(v, x)| point(&(*v, 1.0 - x))));
            let table = LookupTable::from_points(all).unwrap().resolve([0.0, 1.0]);
            let rows = rows(table.points());
            let at_points = points.iter().map(|p| p.0);
            for v in values.into_iter().chain(at_points) {
                let (found, wanted) = (lookup(&rows, v), table.classify(f64::from(v)));
                for (a, b) in found.into_iter().zip(wanted) {
                    prop_assert!((f64::from(a) - b).abs() < 1e-6, "{v}: {found:?} {wanted:?}");
                }
            }
        }
    }
}
