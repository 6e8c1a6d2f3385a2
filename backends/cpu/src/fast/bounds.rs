//! Value bounds of blocks of voxels, and what can be skipped because of them.
//!
//! A block covers 4³ cells; its bounds include the one-voxel rim, so that every interpolated
//! value inside lies within them. Bounds are kept in 8 bits, rounded outward over the data's
//! range: at most two bytes for 64 voxels. From them and a table follows, for each block, how far
//! (in blocks, any direction) everything is transparent.

use super::fetch::Voxels;
use volact_core::ScalarType;

/// Cells of a block along each axis.
pub const BLOCK: usize = 4;

/// Bounds of all blocks.
#[derive(Clone, Debug)]
pub struct ValueBounds {
    /// Blocks along each axis.
    pub blocks: [usize; 3],
    /// Lowest and highest finite number of the data ROI, as `Voxels::at` gives them; `None` if
    /// there is none.
    pub range: Option<[f32; 2]>,
    /// Lower and upper bound of each block in steps of `range`/255, rounded outward; `[255, 0]`
    /// where a block holds no number.
    quantised: Vec<[u8; 2]>,
    /// Whether numbers may be infinite: then the outermost steps have no outer end.
    float: bool,
}

/// How far around each block nothing can be seen, in blocks: 0 where the block itself may be seen.
#[derive(Clone, Debug)]
pub struct Emptiness {
    /// Blocks along each axis.
    pub blocks: [usize; 3],
    /// Chebyshev distance to the nearest block that may be seen, at most 255; padded by 4 bytes.
    pub distance: Vec<u8>,
}

impl ValueBounds {
    /// Reads all voxels of the data ROI once, on `threads` threads.
    pub fn new(voxels: &Voxels<'_>, threads: usize) -> Self {
        let cells: [usize; 3] = std::array::from_fn(|a| (voxels.max[a] - voxels.min[a]).max(1));
        let blocks = cells.map(|n| n.div_ceil(BLOCK));
        let slab = blocks[0] * blocks[1];
        let float = voxels.scalar.is_float();
        // One more, so that four bytes can be read at the last.
        let quantised = vec![[255u8, 0]; slab * blocks[2] + 1];
        let mut bounds = Self { blocks, range: None, quantised, float };
        bounds.range = number_range(voxels, threads);
        let Some(range) = bounds.range else { return bounds };
        let per_thread = blocks[2].div_ceil(threads.max(1));
        std::thread::scope(|scope| {
            for (i, part) in bounds.quantised[..slab * blocks[2]].chunks_mut(per_thread * slab).enumerate() {
                scope.spawn(move || {
                    for (j, layer) in part.chunks_mut(slab).enumerate() {
                        bound_layer(voxels, blocks, i * per_thread + j, range, layer);
                    }
                });
            }
        });
        bounds
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.quantised.len() * 2
    }

    /// The highest steps near each block, of the maximum or (counted down from 255) the minimum.
    pub fn peaks(&self, maximum: bool) -> Peaks {
        let own = |&[lo, hi]: &[u8; 2]| if maximum { hi } else { 255 - lo };
        let own: Vec<u8> = self.quantised[..self.quantised.len() - 1].iter().map(own).collect();
        let mut near = widen(&own, self.blocks, Peaks::NEAR - 1);
        let mut far = widen(&own, self.blocks, Peaks::FAR - 1);
        near.extend([0; 4]);
        far.extend([0; 4]);
        let [lo, hi] = self.range.unwrap_or([0.0, 0.0]);
        let start = if maximum { lo } else { -hi };
        Peaks { blocks: self.blocks, near, far, start, step: (hi - lo) * (1.0 / 255.0), open: self.float }
    }

    /// The value of a step.
    fn value(&self, step: u8) -> f32 {
        let [lo, hi] = self.range.unwrap_or([0.0, 0.0]);
        if step == 255 { hi } else { lo + (hi - lo) * (f32::from(step) / 255.0) }
    }

    /// The lowest and highest value of a block of these steps. Floats may be infinite, but nothing
    /// else lies below the first step or above the last.
    fn values(&self, [lo, hi]: [u8; 2]) -> [f32; 2] {
        let low = if self.float && lo == 0 { f32::NEG_INFINITY } else { self.value(lo) };
        let high = if self.float && hi == 255 { f32::INFINITY } else { self.value(hi) };
        [low, high]
    }

    /// Which blocks can be skipped, where `seen(lo, hi)` says whether any value of that interval
    /// can be seen.
    pub fn emptiness(&self, seen: impl Fn(f32, f32) -> bool) -> Emptiness {
        // 256 × 256 intervals at most, found once each.
        let mut known = vec![0u8; 1 << 16];
        let mut distance = vec![0u8; self.quantised.len() - 1];
        for (d, &[lo, hi]) in distance.iter_mut().zip(&self.quantised) {
            let slot = &mut known[usize::from(lo) << 8 | usize::from(hi)];
            if *slot == 0 {
                let [low, high] = self.values([lo, hi]);
                *slot = if lo <= hi && seen(low, high) { 1 } else { 2 };
            }
            *d = if *slot == 1 { 0 } else { 255 };
        }
        spread(&mut distance, self.blocks);
        distance.extend([0; 4]);
        Emptiness { blocks: self.blocks, distance }
    }
}

/// The best that blocks and those around them hold, for a maximum or a minimum.
#[derive(Clone, Debug)]
pub struct Peaks {
    /// Blocks along each axis.
    pub blocks: [usize; 3],
    /// The highest step of all blocks nearer than `NEAR`, by Chebyshev distance; padded by 4 bytes.
    pub near: Vec<u8>,
    /// The same nearer than `FAR`.
    pub far: Vec<u8>,
    /// The number (negated for a minimum) of step 0.
    pub start: f32,
    /// The size of a step.
    pub step: f32,
    /// Whether step 255 may hold an infinity.
    pub open: bool,
}

impl Peaks {
    /// Blocks that `near` looks around, counting its own.
    pub const NEAR: usize = 2;
    /// Blocks that `far` looks around, counting its own.
    pub const FAR: usize = 4;

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.near.len() + self.far.len()
    }
}

/// The maximum over a cube of blocks `radius` either way, one axis at a time.
fn widen(values: &[u8], [nx, ny, nz]: [usize; 3], radius: usize) -> Vec<u8> {
    let mut from = values.to_vec();
    for (stride, count) in [(1, nx), (nx, ny), (nx * ny, nz)] {
        let mut to = from.clone();
        for shift in 1..=radius.min(count.saturating_sub(1)) {
            // Runs along the axis are `stride · count` long; a shift stays inside its run.
            for (run, other) in to.chunks_mut(stride * count).zip(from.chunks(stride * count)) {
                let by = stride * shift;
                let kept = run.len() - by;
                run[..kept].iter_mut().zip(&other[by..]).for_each(|(r, o)| *r = (*r).max(*o));
                run[by..].iter_mut().zip(&other[..kept]).for_each(|(r, o)| *r = (*r).max(*o));
            }
        }
        from = to;
    }
    from
}

impl Emptiness {
    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.distance.len()
    }

    /// Whether there is anything to skip.
    pub fn any(&self) -> bool {
        self.distance.iter().any(|&d| d > 0)
    }

    /// The share of blocks that can be skipped.
    pub fn share(&self) -> f64 {
        let blocks = self.blocks.iter().product::<usize>().max(1);
        self.distance.iter().filter(|&&d| d > 0).count() as f64 / blocks as f64
    }
}

/// Chebyshev distance transform by a forward and a backward sweep of 1 + minimum over the 26
/// neighbours, exact for this metric (Borgefors 1986), row by row.
fn spread(distance: &mut [u8], [nx, ny, nz]: [usize; 3]) {
    let rows = ny * nz;
    for i in 0..rows {
        let (before, rest) = distance.split_at_mut(i * nx);
        let row = &mut rest[..nx];
        let (y, z) = (i % ny, i / ny);
        let mut near = |y: usize, z: usize| lower(row, &before[(z * ny + y) * nx..][..nx]);
        if y > 0 {
            near(y - 1, z);
        }
        if z > 0 {
            (y.saturating_sub(1)..(y + 2).min(ny)).for_each(|y| near(y, z - 1));
        }
        for x in 1..nx {
            row[x] = row[x].min(row[x - 1].saturating_add(1));
        }
    }
    for i in (0..rows).rev() {
        let (head, after) = distance.split_at_mut((i + 1) * nx);
        let row = &mut head[i * nx..];
        let (y, z) = (i % ny, i / ny);
        let mut near = |y: usize, z: usize| lower(row, &after[(z * ny + y - i - 1) * nx..][..nx]);
        if y + 1 < ny {
            near(y + 1, z);
        }
        if z + 1 < nz {
            (y.saturating_sub(1)..(y + 2).min(ny)).for_each(|y| near(y, z + 1));
        }
        for x in (1..nx).rev() {
            row[x - 1] = row[x - 1].min(row[x].saturating_add(1));
        }
    }
}

/// Lowers a row to 1 + the minimum over three neighbours in another row.
fn lower(row: &mut [u8], other: &[u8]) {
    let n = row.len();
    for (r, o) in row.iter_mut().zip(other) {
        *r = (*r).min(o.saturating_add(1));
    }
    for (r, o) in row[1..].iter_mut().zip(&other[..n - 1]) {
        *r = (*r).min(o.saturating_add(1));
    }
    for (r, o) in row[..n - 1].iter_mut().zip(&other[1..]) {
        *r = (*r).min(o.saturating_add(1));
    }
}

fn bound_layer(voxels: &Voxels<'_>, blocks: [usize; 3], bz: usize, [lo, hi]: [f32; 2], layer: &mut [[u8; 2]]) {
    let mut raw = vec![[f32::INFINITY, f32::NEG_INFINITY]; layer.len()];
    let span = |b: usize, a: usize| {
        let first = voxels.min[a] + b * BLOCK;
        first..=(first + BLOCK).min(voxels.max[a])
    };
    let n = voxels.max[0] - voxels.min[0] + 1;
    let (mut low, mut high) = (vec![f32::INFINITY; n], vec![f32::NEG_INFINITY; n]);
    for by in 0..blocks[1] {
        low.fill(f32::INFINITY);
        high.fill(f32::NEG_INFINITY);
        for z in span(bz, 2) {
            for y in span(by, 1) {
                bound_row(voxels, y, z, &mut low, &mut high);
            }
        }
        for bx in 0..blocks[0] {
            let part = bx * BLOCK..=(bx * BLOCK + BLOCK).min(n - 1);
            let [a, b] = &mut raw[by * blocks[0] + bx];
            *a = low[part.clone()].iter().fold(*a, |m, &v| if v < m { v } else { m });
            *b = high[part].iter().fold(*b, |m, &v| if v > m { v } else { m });
        }
    }
    let scale = if hi > lo { 255.0 / (f64::from(hi) - f64::from(lo)) } else { 0.0 };
    for (q, [a, b]) in layer.iter_mut().zip(raw) {
        if a <= b {
            // A little wider than exact, so that rounding here or in an interpolation is inside;
            // the ends of the range are exact, and empty air is known as such.
            let steps = |v: f32| (f64::from(v) - f64::from(lo)) * scale;
            let flat = lo >= hi;
            let low = if a >= hi && !flat { 255.0 } else { (steps(a) - 1e-4).floor().max(0.0) };
            let high = if flat {
                255.0
            } else if b <= lo {
                0.0
            } else {
                (steps(b) + 1e-4).ceil().min(255.0)
            };
            *q = [low as u8, high as u8];
        }
    }
}

/// Runs `f` on every number of a row of the data ROI, with its column.
macro_rules! each {
    ($voxels:ident, $y:ident, $z:ident, |$x:ident, $v:ident| $body:expr) => {{
        let v = $voxels;
        let n = v.max[0] - v.min[0] + 1;
        let start = (($z * v.dims[1] + $y) * v.dims[0] + v.min[0]) * v.components;
        macro_rules! typed {
            ($t:ty) => {{
                let size = size_of::<$t>();
                let bytes = &v.bytes[start * size..(start + n * v.components) * size];
                if v.components == 1 {
                    for ($x, raw) in bytes.chunks_exact(size).enumerate() {
                        let $v = f32::from(<$t>::from_ne_bytes(raw.try_into().expect("chunk of that size")));
                        $body
                    }
                } else {
                    for ($x, raw) in bytes.chunks_exact(size * v.components).enumerate() {
                        let raw = &raw[v.component * size..][..size];
                        let $v = f32::from(<$t>::from_ne_bytes(raw.try_into().expect("chunk of that size")));
                        $body
                    }
                }
            }};
        }
        if v.origin == 0.0 && v.gain == 1.0 {
            match v.scalar {
                ScalarType::U8 => typed!(u8),
                ScalarType::I8 => typed!(i8),
                ScalarType::U16 => typed!(u16),
                ScalarType::I16 => typed!(i16),
                ScalarType::F32 => typed!(f32),
                _ => each!(@slow v, n, $y, $z, |$x, $v| $body),
            }
        } else {
            each!(@slow v, n, $y, $z, |$x, $v| $body)
        }
    }};
    (@slow $voxels:ident, $n:ident, $y:ident, $z:ident, |$x:ident, $v:ident| $body:expr) => {
        for $x in 0..$n {
            let $v = $voxels.at($voxels.min[0] + $x, $y, $z);
            $body
        }
    };
}

fn bound_row(voxels: &Voxels<'_>, y: usize, z: usize, low: &mut [f32], high: &mut [f32]) {
    each!(voxels, y, z, |x, v| {
        // Comparisons are false for NaN, which is transparent and bounds nothing.
        low[x] = if v < low[x] { v } else { low[x] };
        high[x] = if v > high[x] { v } else { high[x] };
    });
}

/// The range over which numbers are taken to occur: all of an 8-bit type, whose numbers are then
/// a step each, else what the data ROI holds.
pub fn number_range(voxels: &Voxels<'_>, threads: usize) -> Option<[f32; 2]> {
    match voxels.scalar.limits() {
        Some([lo, hi]) if voxels.scalar.size() == 1 => Some([lo as f32, hi as f32]),
        _ => data_range(voxels, threads),
    }
}

fn data_range(voxels: &Voxels<'_>, threads: usize) -> Option<[f32; 2]> {
    let layers = voxels.max[2] - voxels.min[2] + 1;
    let per_thread = layers.div_ceil(threads.max(1));
    let part = |first: usize| {
        let mut range = [f32::INFINITY, f32::NEG_INFINITY];
        for z in first..(first + per_thread).min(layers) {
            for y in voxels.min[1]..=voxels.max[1] {
                let z = z + voxels.min[2];
                let [mut a, mut b] = range;
                each!(voxels, y, z, |_x, v| {
                    let finite = v.is_finite();
                    a = if finite && v < a { v } else { a };
                    b = if finite && v > b { v } else { b };
                });
                range = [a, b];
            }
        }
        range
    };
    let range = std::thread::scope(|scope| {
        let part = &part;
        let handles: Vec<_> = (0..layers).step_by(per_thread).map(|first| scope.spawn(move || part(first))).collect();
        handles.into_iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[a, b], h| {
            let [c, d] = h.join().unwrap_or([f32::NEG_INFINITY, f32::INFINITY]);
            [a.min(c), b.max(d)]
        })
    });
    (range[0] <= range[1]).then_some(range)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn widened_is_the_maximum_around() {
        let blocks = [5, 3, 4];
        let values: Vec<u8> = (0..60).map(|i: u32| (i * 97 % 251) as u8).collect();
        let wide = widen(&values, blocks, 2);
        let near = |a: usize, n: usize| a.saturating_sub(2)..(a + 3).min(n);
        for (i, &got) in wide.iter().enumerate() {
            let (x, y, z) = (i % 5, i / 5 % 3, i / 15);
            let around =
                near(z, 4).flat_map(|z| near(y, 3).flat_map(move |y| near(x, 5).map(move |x| (z * 3 + y) * 5 + x)));
            assert_eq!(got, around.map(|j| values[j]).max().unwrap());
        }
    }

    #[test]
    fn distance_is_chebyshev() {
        let blocks = [7, 5, 6];
        let mut distance = vec![255u8; 7 * 5 * 6];
        let seeds = [[1usize, 1, 1], [6, 4, 5]];
        for [x, y, z] in seeds {
            distance[(z * 5 + y) * 7 + x] = 0;
        }
        spread(&mut distance, blocks);
        for z in 0..6usize {
            for y in 0..5usize {
                for x in 0..7usize {
                    let to = |s: [usize; 3]| x.abs_diff(s[0]).max(y.abs_diff(s[1])).max(z.abs_diff(s[2]));
                    let wanted = seeds.map(to).into_iter().min().unwrap();
                    assert_eq!(usize::from(distance[(z * 5 + y) * 7 + x]), wanted, "{x} {y} {z}");
                }
            }
        }
    }
}
