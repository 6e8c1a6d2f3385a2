//! The plain way, ray by ray in f64, for what the vector kernels do not do: shapes that overlap,
//! pre-interpolated tables, and the volume's own components as colour.
//!
//! Where shapes overlap, extinctions add: σ = Σσᵢ and c = Σσᵢcᵢ/Σσᵢ, so that the order of
//! drawing means nothing.

use volact_core::{
    TableInterpolation, VolumeTexture,
    glam::DVec3,
    lattice::{Lattice, Segment},
    resolve::ResolvedShape,
    table::ResolvedTable,
    volume::Components,
};

use super::{
    bounds::{BLOCK, Emptiness},
    packet::Place,
    walk::{CHUNK, Counts},
};

/// Optical depth that counts as opaque.
const OPAQUE: f64 = 1e4;

/// How a layer makes colour and opacity of a position.
#[derive(Debug)]
pub enum Source {
    /// Interpolate, then classify.
    Post(ResolvedTable),
    /// Classify the voxels, then interpolate.
    Pre(ResolvedTable),
    /// The components themselves over the texture's range.
    Components,
}

/// One shape among several.
#[derive(Debug)]
pub struct Layer<'a> {
    place: Place,
    texture: &'a VolumeTexture,
    component: usize,
    source: Source,
    unit: f64,
    range: [f64; 2],
    empty: Option<&'a Emptiness>,
}

impl<'a> Layer<'a> {
    /// A layer of a resolved `over` shape; `None` if it lacks volume or block.
    pub fn new(shape: &'a ResolvedShape, empty: Option<&'a Emptiness>) -> Option<Self> {
        let texture = shape.volume("volume")?;
        let range = texture.range();
        let source = match shape.table("lookup_table") {
            Some(table) if table.interpolation() == TableInterpolation::Pre => Source::Pre(table.resolve(range)),
            Some(table) => Source::Post(table.resolve(range)),
            None => Source::Components,
        };
        Some(Self {
            place: Place::new(shape)?,
            texture,
            component: shape.int("component").unwrap_or(0) as usize,
            source,
            unit: shape.float("unit_distance")?,
            range,
            empty,
        })
    }

    /// Straight colour and opacity over one unit distance.
    fn medium(&self, at: DVec3) -> [f64; 4] {
        match &self.source {
            Source::Post(table) => table.classify(self.texture.sample(at, self.component)),
            Source::Pre(table) => interpolated(self.texture, at, |voxel| {
                let value = self.texture.volume().value(voxel, self.component);
                if value.is_nan() { [f64::NAN; 4] } else { table.classify(value) }
            }),
            Source::Components => self.components(at),
        }
    }

    fn components(&self, at: DVec3) -> [f64; 4] {
        let [lo, hi] = self.range;
        let value = |c| ((self.texture.sample(at, c) - lo) / (hi - lo)).clamp(0.0, 1.0);
        let rgba = match self.texture.meaning() {
            Components::Intensity => [value(0), value(0), value(0), value(0)],
            Components::Luminance => [value(0), value(0), value(0), 1.0],
            Components::LuminanceAlpha => [value(0), value(0), value(0), value(1)],
            Components::Rgb => [value(0), value(1), value(2), 1.0],
            Components::Rgba => [value(0), value(1), value(2), value(3)],
        };
        if rgba.iter().any(|v| v.is_nan()) { [0.0; 4] } else { rgba }
    }
}

/// Trilinear interpolation of what `classify` makes of voxels; transparent where a NaN has weight.
fn interpolated(texture: &VolumeTexture, at: DVec3, classify: impl Fn([usize; 3]) -> [f64; 4]) -> [f64; 4] {
    let roi = texture.data_roi();
    let nearest = texture.filter() == volact_core::Filter::Nearest;
    let mut cell = [[0usize; 2]; 3];
    let mut f = [0f64; 3];
    for a in 0..3 {
        let x = at[a].clamp(roi.min[a] as f64, roi.max[a] as f64);
        let low = if nearest { (x + 0.5) as usize } else { (x as usize).min(roi.max[a].saturating_sub(1)) };
        let low = low.clamp(roi.min[a], roi.max[a]);
        cell[a] = [low, (low + 1).min(roi.max[a])];
        f[a] = if nearest { 0.0 } else { x - low as f64 };
    }
    let mut out = [0f64; 4];
    for i in 0..8usize {
        let pick = |a: usize| i >> a & 1;
        let weight = (0..3).map(|a| if pick(a) == 1 { f[a] } else { 1.0 - f[a] }).product::<f64>();
        if weight > 0.0 {
            let voxel = classify([cell[0][pick(0)], cell[1][pick(1)], cell[2][pick(2)]]);
            out = std::array::from_fn(|c| out[c] + weight * voxel[c]);
        }
    }
    if out[3].is_nan() { [0.0; 4] } else { out }
}

/// One layer along one ray.
struct Track<'a> {
    layer: &'a Layer<'a>,
    origin: DVec3,
    direction: DVec3,
    span: [f64; 2],
    /// Segments before this one are known to be transparent.
    skip: i64,
}

impl<'a> Track<'a> {
    fn new(layer: &'a Layer<'a>, ray: &volact_core::Ray) -> Option<Self> {
        let place = &layer.place;
        let origin = place.to_object.transform_point3(ray.origin);
        let direction = place.to_object.transform_vector3(ray.direction);
        let [t0, t1] = place.block.clip_line(origin, direction)?;
        let span = [t0.max(ray.near), t1.min(ray.far)];
        if !(span[0] < span[1] && span[0].is_finite() && span[1].is_finite()) {
            return None;
        }
        let (origin, direction) =
            (place.to_index.transform_point3(origin), place.to_index.transform_vector3(direction));
        Some(Self { layer, origin, direction, span, skip: i64::MIN })
    }

    /// The part of segment `k` inside this layer.
    fn piece(&self, k: i64, step: f64) -> Option<Segment> {
        let (start, end) = (k as f64 * step, (k + 1) as f64 * step);
        let (start, end) = (start.max(self.span[0]), end.min(self.span[1]));
        (start < end).then_some(Segment { k, start, end })
    }

    /// Extinction times one world unit and straight colour at `t`.
    fn density(&self, t: f64) -> [f64; 4] {
        let [r, g, b, a] = self.layer.medium(self.origin + self.direction * t);
        let sigma = if a >= 1.0 { f64::INFINITY } else { -(-a).ln_1p() / self.layer.unit };
        [r, g, b, sigma]
    }

    /// Whether segment `k` is known to be transparent; looks ahead where it is.
    fn transparent(&mut self, k: i64, step: f64) -> bool {
        if k < self.skip {
            return true;
        }
        let Some(empty) = self.layer.empty else { return false };
        let t = (k as f64 * step).max(self.span[0]);
        let roi = self.layer.texture.data_roi();
        let mut index = [0usize; 3];
        let mut q = [0f64; 3];
        for a in 0..3 {
            let at = self.origin[a] + self.direction[a] * t;
            q[a] = (at - roi.min[a] as f64).clamp(0.0, (roi.max[a] - roi.min[a]) as f64);
            index[a] = (q[a] / BLOCK as f64).min((empty.blocks[a] - 1) as f64) as usize;
        }
        let distance = empty.distance[(index[2] * empty.blocks[1] + index[1]) * empty.blocks[0] + index[0]];
        if distance == 0 {
            return false;
        }
        let mut ahead = f64::INFINITY;
        for a in 0..3 {
            let (b, d, size) = (index[a] as f64, f64::from(distance), BLOCK as f64);
            let edge = if self.direction[a] > 0.0 { (b + d) * size - 1e-3 } else { (b + 1.0 - d) * size + 1e-3 };
            if self.direction[a] != 0.0 {
                ahead = ahead.min((edge - q[a]) / self.direction[a]);
            }
        }
        // Segments that end before the region does.
        let until = ((t + ahead.max(0.0)) / step).floor();
        self.skip = if until.is_finite() { until as i64 } else { i64::MAX };
        k < self.skip
    }
}

/// What came of a ray.
#[derive(Clone, Copy, Debug)]
pub struct RayResult {
    /// Premultiplied RGBA.
    pub color: [f64; 4],
    /// `t` at which the threshold is reached.
    pub depth: f64,
}

/// Draws one ray through all layers.
pub fn draw(
    layers: &[Layer<'_>],
    ray: &volact_core::Ray,
    lattice: &Lattice,
    termination: f64,
    threshold: f64,
    counts: &mut Counts,
) -> RayResult {
    let mut tracks: Vec<Track<'_>> = layers.iter().filter_map(|l| Track::new(l, ray)).collect();
    let mut out = RayResult { color: [0.0; 4], depth: f64::INFINITY };
    let near = tracks.iter().map(|t| t.span[0]).fold(f64::INFINITY, f64::min);
    let far = tracks.iter().map(|t| t.span[1]).fold(f64::NEG_INFINITY, f64::max);
    if near >= far {
        return out;
    }
    counts.rays += 1;
    let step = lattice.step;
    let (first, last) = ((near / step).floor() as i64, (far / step).ceil() as i64);
    let mut pieces: Vec<(Segment, [f64; 4])> = Vec::with_capacity(tracks.len());
    for k in first..last {
        if k.rem_euclid(CHUNK as i64) == 0 && 1.0 - out.color[3] < termination {
            break;
        }
        pieces.clear();
        for track in &mut tracks {
            let Some(piece) = track.piece(k, step) else { continue };
            counts.lattice += 1;
            if !track.transparent(k, step) {
                counts.samples += 1;
                let density = track.density(piece.middle());
                if density[3] > 0.0 {
                    pieces.push((piece, density));
                }
            }
        }
        blend(&mut out, &mut pieces, threshold);
    }
    out
}

/// Adds the pieces of one segment, cut where any of them begins or ends.
fn blend(out: &mut RayResult, pieces: &mut [(Segment, [f64; 4])], threshold: f64) {
    let Some(mut at) = pieces.iter().map(|(s, _)| s.start).min_by(f64::total_cmp) else { return };
    // A fixed order, so that sums do not depend on the order of drawing.
    pieces.sort_by(|(_, a), (_, b)| {
        a.iter().zip(b).map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
    });
    loop {
        let ahead = |v: f64| if v > at { v } else { f64::INFINITY };
        let next = pieces.iter().map(|(s, _)| ahead(s.start).min(ahead(s.end))).fold(f64::INFINITY, f64::min);
        if next == f64::INFINITY {
            return;
        }
        let covers = |s: &Segment| s.start <= at && s.end >= next;
        let (sigma, color) = mixture(pieces.iter().filter(|(s, _)| covers(s)).map(|(_, d)| d));
        if sigma > 0.0 {
            add(out, color, (sigma * (next - at)).min(OPAQUE), [at, next], threshold);
        }
        at = next;
    }
}

fn mixture<'a>(densities: impl Iterator<Item = &'a [f64; 4]>) -> (f64, [f64; 3]) {
    let mut sum = [0f64; 4];
    let mut infinite = [0f64; 4];
    for d in densities {
        let (into, weight) = if d[3].is_infinite() { (&mut infinite, 1.0) } else { (&mut sum, d[3]) };
        for c in 0..3 {
            into[c] += weight * d[c];
        }
        into[3] += weight;
    }
    let (sigma, by) = if infinite[3] > 0.0 { (f64::INFINITY, infinite) } else { (sum[3], sum) };
    (sigma, [by[0] / by[3], by[1] / by[3], by[2] / by[3]])
}

fn add(out: &mut RayResult, color: [f64; 3], depth: f64, [from, to]: [f64; 2], threshold: f64) {
    let before = out.color[3];
    let alpha = if depth >= OPAQUE { 1.0 } else { -(-depth).exp_m1() };
    let share = (1.0 - before) * alpha;
    for (o, c) in out.color.iter_mut().zip(color) {
        *o += share * c;
    }
    out.color[3] += share;
    if before < threshold && out.color[3] >= threshold {
        let needed = -((1.0 - threshold) / (1.0 - before)).ln();
        let part = if depth >= OPAQUE { 0.0 } else { (needed / depth).clamp(0.0, 1.0) };
        out.depth = from + (to - from) * part;
    }
}
