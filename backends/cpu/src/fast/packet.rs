//! Packets: sixteen neighbouring rays, four by four pixels, with their intervals in one shape.

use volact_core::{
    Aabb, RayGrid,
    glam::DAffine3,
    lattice::{Lattice, Segment},
    resolve::ResolvedShape,
};

use super::simd::LANES;

/// Pixels of a packet along each side.
pub const SIDE: usize = 4;

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
    /// The place of a shape with a block and a volume.
    pub fn new(shape: &ResolvedShape) -> Option<Self> {
        let to_index = shape.volume("volume")?.object_to_index();
        Some(Self { to_object: shape.to_object, to_index, block: shape.block()? })
    }
}

/// Sixteen rays in a shape's sample space.
#[derive(Clone, Debug)]
pub struct Packet {
    /// Sample coordinates at `t = 0`, by axis and lane.
    pub origin: [[f64; LANES]; 3],
    /// Sample coordinates a world unit, by axis and lane.
    pub direction: [[f64; LANES]; 3],
    /// The interval in `t`, by lane.
    pub span: [[f64; 2]; LANES],
    /// Distance that depth adds to `t`, by lane.
    pub depth_zero: [f64; LANES],
    /// Lanes with an interval of some length.
    pub active: u32,
}

impl Packet {
    /// The rays of pixels `x..x + 4`, `y..y + 4` inside a viewport of `size`.
    pub fn new(grid: &RayGrid, place: &Place, [x, y]: [usize; 2], size: [usize; 2]) -> Self {
        let zero = [0.0; LANES];
        let mut packet =
            Self { origin: [zero; 3], direction: [zero; 3], span: [[0.0; 2]; LANES], depth_zero: zero, active: 0 };
        for l in 0..LANES {
            let (px, py) = (x + l % SIDE, y + l / SIDE);
            if px < size[0] && py < size[1] {
                packet.set(l, grid, place, px as f64 + 0.5, py as f64 + 0.5);
            }
        }
        packet
    }

    fn set(&mut self, l: usize, grid: &RayGrid, place: &Place, x: f64, y: f64) {
        let ray = grid.ray(x, y);
        let origin = place.to_object.transform_point3(ray.origin);
        let direction = place.to_object.transform_vector3(ray.direction);
        let Some([t0, t1]) = place.block.clip_line(origin, direction) else { return };
        let (t0, t1) = (t0.max(ray.near), t1.min(ray.far));
        if !(t0 < t1 && t0.is_finite() && t1.is_finite()) {
            return;
        }
        let (origin, direction) =
            (place.to_index.transform_point3(origin), place.to_index.transform_vector3(direction));
        for a in 0..3 {
            self.origin[a][l] = origin[a];
            self.direction[a][l] = direction[a];
        }
        self.span[l] = [t0, t1];
        self.depth_zero[l] = ray.depth_zero;
        self.active |= 1 << l;
    }

    /// Sample coordinates of a lane at `t`.
    pub fn at(&self, l: usize, t: f64) -> [f64; 3] {
        std::array::from_fn(|a| self.origin[a][l] + self.direction[a][l] * t)
    }

    /// Cuts all intervals by the lattice.
    pub fn split(&self, lattice: &Lattice) -> Cuts {
        let mut cuts = Cuts { first: [None; LANES], last: [None; LANES], from: [0; LANES], to: [0; LANES] };
        for l in (0..LANES).filter(|l| self.active >> l & 1 == 1) {
            let split = lattice.split(self.span[l][0], self.span[l][1]);
            (cuts.first[l], cuts.last[l]) = (split.first, split.last);
            [cuts.from[l], cuts.to[l]] = split.whole;
        }
        cuts
    }
}

/// The intervals of a packet, cut by the lattice.
#[derive(Clone, Debug)]
pub struct Cuts {
    /// Cut segments at the front.
    pub first: [Option<Segment>; LANES],
    /// Cut segments at the back.
    pub last: [Option<Segment>; LANES],
    /// First whole segment.
    pub from: [i64; LANES],
    /// One after the last whole segment.
    pub to: [i64; LANES],
}

impl Cuts {
    /// Whole segments of all lanes together: the first, and one after the last.
    pub fn whole(&self) -> Option<[i64; 2]> {
        let lanes = || (0..LANES).filter(|&l| self.from[l] < self.to[l]);
        Some([lanes().map(|l| self.from[l]).min()?, lanes().map(|l| self.to[l]).max()?])
    }
}
