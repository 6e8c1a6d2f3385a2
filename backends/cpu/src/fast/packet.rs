//! Packets: sixteen neighbouring rays, four by four pixels, and their intervals.
//!
//! A [`Bundle`] is the rays in world space, made once for all shapes; a [`Packet`] is the same
//! rays in a shape's sample space, with one interval each.

use volact_core::{
    Aabb,
    camera::LinearRays,
    glam::{DAffine3, DMat3, DVec3},
    mutated,
    resolve::ResolvedShape,
};

use super::simd::LANES;

/// Pixels of a packet along each side.
pub const SIDE: usize = 4;

/// Sixteen f64.
pub type Lanes = [f64; LANES];

/// Sixteen vectors, by axis and lane.
pub type Vectors = [Lanes; 3];

/// Where a shape lies.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// World to object space.
    pub to_object: DAffine3,
    /// Object to sample space.
    pub to_index: DAffine3,
    /// The box to draw, in object space.
    pub block: Aabb,
}

impl Place {
    /// The place of a shape with a block and a volume; `None` where nothing of the volume lies in
    /// the block.
    pub fn new(shape: &ResolvedShape) -> Option<Self> {
        let to_index = shape.volume("volume")?.object_to_index();
        let block = shape.block().filter(|b| !b.is_empty())?;
        Some(Self { to_object: shape.to_object, to_index, block })
    }
}

impl Place {
    /// The same place but for a fault that is asked for.
    #[must_use]
    pub fn mutated(self) -> Self {
        let Self { mut to_object, mut to_index, block } = self;
        if mutated!("half_voxel") {
            to_index.translation += DVec3::splat(0.5);
        }
        if mutated!("swapped_axes") {
            to_index = DAffine3::from_mat3(DMat3::from_cols(DVec3::Y, DVec3::X, DVec3::Z)) * to_index;
        }
        if mutated!("positions_in_f32") {
            to_object = DAffine3::from_cols_array(&to_object.to_cols_array().map(|v| f64::from(v as f32)));
        }
        Self { to_object, to_index, block }
    }
}

/// One interval of each of sixteen rays.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Beginnings in `t`.
    pub start: Lanes,
    /// Ends in `t`.
    pub end: Lanes,
    /// Lanes that have one.
    pub active: u32,
}

impl Span {
    /// No interval.
    pub const NONE: Self = Self { start: [0.0; LANES], end: [0.0; LANES], active: 0 };

    /// Ends intervals at the latest at `limit`; those before may stay without end.
    pub fn limit(&mut self, limit: &Lanes) {
        for (l, &limit) in limit.iter().enumerate() {
            self.end[l] = self.end[l].min(limit);
            self.active &= !(u32::from(self.start[l] >= self.end[l]) << l);
        }
    }

    /// The part between two `t` a lane.
    #[inline(always)]
    pub fn between(mut self, from: &Lanes, to: &Lanes) -> Self {
        for (start, &from) in self.start.iter_mut().zip(from) {
            *start = if from > *start { from } else { *start };
        }
        self.limit(to);
        self
    }

    /// Lets go of lanes whose interval has no length or no end.
    #[inline(always)]
    pub fn settle(&mut self) {
        for l in 0..LANES {
            let some = self.start[l] < self.end[l] && (self.end[l] - self.start[l]).is_finite();
            self.active &= !(u32::from(!some) << l);
        }
    }
}

/// Sixteen rays in world space.
#[derive(Clone, Debug)]
pub struct Bundle {
    /// The first pixel, in the viewport.
    pub pixel: [usize; 2],
    /// Points at `t = 0`.
    pub origin: Vectors,
    /// Unit directions.
    pub direction: Vectors,
    /// What the camera sees of them, of the lanes inside the viewport.
    pub span: Span,
    /// Distance that depth adds to `t`.
    pub depth_zero: f64,
}

#[inline(always)]
fn each(f: impl Fn(usize) -> f64) -> Lanes {
    let mut out = [0.0; LANES];
    for (l, o) in out.iter_mut().enumerate() {
        *o = f(l);
    }
    out
}

impl Bundle {
    /// The rays of pixels `x..x + 4`, `y..y + 4` inside a viewport of `size`: what
    /// [`RayGrid::ray`] gives, sixteen at once.
    ///
    /// [`RayGrid::ray`]: volact_core::RayGrid::ray
    #[inline(always)]
    pub fn new(w: &LinearRays, [x, y]: [usize; 2], size: [usize; 2]) -> Self {
        let half = if mutated!("pixel_corners") { 0.0 } else { 0.5 };
        let px = each(|l| (x + l % SIDE) as f64 + half);
        let py = each(|l| (y + l / SIDE) as f64 + 0.5);
        let plane = |a: usize| each(|l| w.corner[a] + w.dx[a] * px[l] + w.dy[a] * py[l]);
        let plane = [plane(0), plane(1), plane(2)];
        let (origin, direction) = match w.eye {
            Some(eye) => {
                let scale = each(|l| {
                    1.0 / (plane[0][l] * plane[0][l] + plane[1][l] * plane[1][l] + plane[2][l] * plane[2][l]).sqrt()
                });
                let unit = |a: usize| each(|l| plane[a][l] * scale[l]);
                ([[eye.x; LANES], [eye.y; LANES], [eye.z; LANES]], [unit(0), unit(1), unit(2)])
            }
            None => {
                let d = w.direction;
                let along = each(|l| plane[0][l] * d.x + plane[1][l] * d.y + plane[2][l] * d.z);
                let point = |a: usize| each(|l| plane[a][l] - d[a] * along[l]);
                ([point(0), point(1), point(2)], [[d.x; LANES], [d.y; LANES], [d.z; LANES]])
            }
        };
        let slope = each(|l| w.axis.x * direction[0][l] + w.axis.y * direction[1][l] + w.axis.z * direction[2][l]);
        let base = each(|l| w.axis.x * origin[0][l] + w.axis.y * origin[1][l] + w.axis.z * origin[2][l]);
        let at = |plane: f64| each(|l| if plane.is_finite() { (plane - base[l]) / slope[l] } else { plane });
        let (mut start, end) = (at(w.near), at(w.far));
        if w.eye.is_some() {
            start = each(|l| if start[l] > 0.0 { start[l] } else { 0.0 });
        }
        let mut active = 0;
        for l in 0..LANES {
            active |= u32::from(x + l % SIDE < size[0] && y + l / SIDE < size[1]) << l;
        }
        let span = Span { start, end, active };
        Self { pixel: [x, y], origin, direction, span, depth_zero: w.depth_zero }
    }

    /// The rays' points at `t = 0` and directions, seen through a map.
    #[inline(always)]
    pub fn through(&self, map: &DAffine3) -> [Vectors; 2] {
        [transform(map, &self.origin, map.translation), transform(map, &self.direction, DVec3::ZERO)]
    }

    /// A lane's ray.
    pub fn ray(&self, l: usize) -> [DVec3; 2] {
        [&self.origin, &self.direction].map(|v| DVec3::new(v[0][l], v[1][l], v[2][l]))
    }
}

/// What is left of intervals inside a box, which may have no length.
#[inline(always)]
pub fn clip_box(block: &Aabb, [point, vector]: &[Vectors; 2], span: &Span) -> Span {
    let Span { mut start, mut end, active } = *span;
    let mut misses = [false; LANES];
    for a in 0..3 {
        let (lo, hi) = (block.min[a], block.max[a]);
        for l in 0..LANES {
            let (o, d) = (point[a][l], vector[a][l]);
            let (u, v) = ((lo - o) / d, (hi - o) / d);
            let (near, far) = if u < v { (u, v) } else { (v, u) };
            let across = d != 0.0;
            start[l] = if across && near > start[l] { near } else { start[l] };
            end[l] = if across && far < end[l] { far } else { end[l] };
            misses[l] |= !across && (o < lo || o > hi);
        }
    }
    let mut missed = 0;
    for (l, miss) in misses.into_iter().enumerate() {
        missed |= u32::from(miss) << l;
    }
    let mut left = Span { start, end, active: active & !missed };
    left.settle();
    left
}

/// Sixteen rays in a shape's sample space.
#[derive(Clone, Debug)]
pub struct Packet {
    /// Sample coordinates at `t = 0`, by axis and lane.
    pub origin: Vectors,
    /// Sample coordinates a world unit, by axis and lane.
    pub direction: Vectors,
    /// Beginnings of the intervals in `t`.
    pub start: Lanes,
    /// Ends of the intervals in `t`.
    pub end: Lanes,
    /// Lanes with an interval of some length.
    pub active: u32,
}

impl Packet {
    /// The rays of a bundle inside a shape's box, where `span` holds them.
    #[inline(always)]
    pub fn new(bundle: &Bundle, span: &Span, place: &Place) -> Self {
        let seen = bundle.through(&place.to_object);
        let Span { start, end, active } = clip_box(&place.block, &seen, span);
        let [point, vector] = &seen;
        Self {
            origin: transform(&place.to_index, point, place.to_index.translation),
            direction: transform(&place.to_index, vector, DVec3::ZERO),
            start,
            end,
            active,
        }
    }

    /// The same rays with other intervals.
    pub fn within(&self, span: &Span) -> Self {
        Self { start: span.start, end: span.end, active: span.active, ..*self }
    }

    /// Their intervals.
    pub fn span(&self) -> Span {
        Span { start: self.start, end: self.end, active: self.active }
    }

    /// Sample coordinates of a lane at `t`.
    #[inline(always)]
    pub fn at(&self, l: usize, t: f64) -> [f64; 3] {
        [0, 1, 2].map(|a| self.origin[a][l] + self.direction[a][l] * t)
    }

    /// Cuts all intervals by the lattice of step `h`, as [`Lattice::split`] does.
    ///
    /// [`Lattice::split`]: volact_core::lattice::Lattice::split
    #[inline(always)]
    pub fn split(&self, h: f64) -> Cuts {
        let first = each(|l| (self.start[l] / h).ceil());
        let last = each(|l| (self.end[l] / h).floor());
        let first = if mutated!("uncut_ends") { each(|l| (self.start[l] / h).floor()) } else { first };
        let mut cuts = Cuts { front: [[0.0; 2]; LANES], back: [[0.0; 2]; LANES], from: [0.0; LANES], to: [0.0; LANES] };
        for l in 0..LANES {
            if self.active >> l & 1 == 0 {
                continue;
            }
            let (t0, t1) = (self.start[l], self.end[l]);
            if first[l] > last[l] {
                cuts.front[l] = [t0, t1];
                continue;
            }
            let (a, b) = (first[l] * h, last[l] * h);
            (cuts.from[l], cuts.to[l]) = (first[l], last[l]);
            if a > t0 {
                cuts.front[l] = [t0, a];
            }
            if b < t1 {
                cuts.back[l] = [b, t1];
            }
        }
        cuts
    }
}

#[inline(always)]
fn transform(by: &DAffine3, v: &Vectors, offset: DVec3) -> Vectors {
    let m = &by.matrix3;
    let row = |a: usize| each(|l| m.x_axis[a] * v[0][l] + m.y_axis[a] * v[1][l] + m.z_axis[a] * v[2][l] + offset[a]);
    [row(0), row(1), row(2)]
}

impl Bundle {
    /// Points at `t = 0` from an origin on.
    pub fn local(&self, origin: DVec3) -> Vectors {
        std::array::from_fn(|a| self.origin[a].map(|v| v - origin[a]))
    }
}

/// The intervals of a packet, cut by the lattice.
#[derive(Clone, Debug)]
pub struct Cuts {
    /// Cut segments at the front; without length where there is none.
    pub front: [[f64; 2]; LANES],
    /// Cut segments at the back; without length where there is none.
    pub back: [[f64; 2]; LANES],
    /// First whole segment.
    pub from: Lanes,
    /// One after the last whole segment.
    pub to: Lanes,
}

impl Cuts {
    /// Whole segments of all lanes together: the first, and one after the last.
    #[inline(always)]
    pub fn whole(&self) -> Option<[i64; 2]> {
        let (mut first, mut last) = (f64::INFINITY, f64::NEG_INFINITY);
        for l in 0..LANES {
            if self.from[l] < self.to[l] {
                first = first.min(self.from[l]);
                last = last.max(self.to[l]);
            }
        }
        (first < last).then_some([first as i64, last as i64])
    }

    /// Number of whole segments.
    #[inline(always)]
    pub fn count(&self) -> u64 {
        let mut sum = 0.0;
        for l in 0..LANES {
            sum += self.to[l] - self.from[l];
        }
        sum as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volact_core::{Camera, Viewport, lattice::Lattice};

    #[test]
    fn packets_are_the_rays_and_segments_of_core() {
        let to_object = DAffine3::from_rotation_x(0.3) * DAffine3::from_translation(DVec3::new(0.1, 0.2, -0.3));
        let to_index = DAffine3::from_scale(DVec3::new(3.0, 4.0, 5.0));
        let place = Place { to_object, to_index, block: Aabb::new(-DVec3::ONE, DVec3::ONE) };
        let viewport = Viewport { x: 0, y: 0, width: 9, height: 7 };
        let (eye, up) = (DVec3::new(1.0, -4.0, 2.0), DVec3::Z);
        for camera in [Camera::perspective(eye, DVec3::ZERO, up, 35.0), Camera::orthographic(eye, DVec3::ZERO, up, 3.0)]
        {
            let grid = camera.rays(&viewport).unwrap();
            for (x, y) in [(0, 0), (4, 0), (8, 4)] {
                let bundle = Bundle::new(&grid.linear(), [x, y], [9, 7]);
                let packet = Packet::new(&bundle, &bundle.span, &place);
                let cuts = packet.split(0.3);
                for l in 0..LANES {
                    let (px, py) = (x + l % SIDE, y + l / SIDE);
                    let ray = grid.ray(px as f64 + 0.5, py as f64 + 0.5);
                    let (o, d) = (to_object.transform_point3(ray.origin), to_object.transform_vector3(ray.direction));
                    let span = place.block.clip_line(o, d).map(|[a, b]| [a.max(ray.near), b.min(ray.far)]);
                    let inside = px < 9 && py < 7 && span.is_some_and(|[a, b]| a < b);
                    assert_eq!(packet.active >> l & 1 == 1, inside, "{x} {y} {l}");
                    let Some([a, b]) = span.filter(|_| inside) else { continue };
                    assert!((packet.start[l] - a).abs() < 1e-12 && (packet.end[l] - b).abs() < 1e-12);
                    let at = to_index.transform_point3(o + d * a);
                    let got = packet.at(l, a);
                    assert!((0..3).all(|i| (got[i] - at[i]).abs() < 1e-11));
                    let split = Lattice { step: 0.3 }.split(packet.start[l], packet.end[l]);
                    if split.whole[0] < split.whole[1] {
                        assert_eq!(split.whole.map(|k| k as f64), [cuts.from[l], cuts.to[l]]);
                    }
                    assert_eq!(split.first.map(|s| [s.start, s.end]), Some(cuts.front[l]).filter(|c| c[0] < c[1]));
                }
            }
        }
    }
}
