//! Meshes for the tests, made by rule.

use volact_core::{
    Appearance, Attribute, Buffer, CellType, CellTypes, FrameDesc, LookupTable, Mesh, ScalarType, Shape, glam::DVec3,
};
use volact_cpu::reference::ReferencePicture;

/// Numbers that look random, always the same.
pub struct Dice(pub u64);

impl Dice {
    /// Between 0 and 1.
    pub fn roll(&mut self) -> f64 {
        // SplitMix64 (G. Steele, D. Lea, C. Flood, 2014).
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A whole number below `n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.roll() * n as f64) as usize
    }

    /// A point of the unit cube.
    pub fn point(&mut self) -> DVec3 {
        DVec3::new(self.roll(), self.roll(), self.roll())
    }

    /// A direction.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let p = 2.0 * self.point() - 1.0;
            if (0.01..1.0).contains(&p.length_squared()) {
                return p.normalize();
            }
        }
    }
}

/// Points and tetrahedra.
#[derive(Clone, Debug)]
pub struct Parts {
    pub points: Vec<DVec3>,
    pub tetrahedra: Vec<[u32; 4]>,
}

impl Parts {
    /// As a geometry.
    pub fn mesh(&self) -> Mesh {
        let indices: Vec<u32> = self.tetrahedra.iter().flatten().copied().collect();
        let types = CellTypes::All(CellType::Tetrahedron);
        Mesh::new(self.points.clone().into(), types, Buffer::from_vec(indices)).unwrap()
    }

    /// The same with every point moved.
    pub fn moved(&self, f: impl Fn(DVec3) -> DVec3) -> Self {
        Self { points: self.points.iter().map(|&p| f(p)).collect(), ..self.clone() }
    }

    /// The tetrahedra for which a rule says so, and the others.
    pub fn split(&self, mut rule: impl FnMut(usize) -> bool) -> [Self; 2] {
        let (yes, no): (Vec<_>, Vec<_>) = (0..self.tetrahedra.len()).partition(|&i| rule(i));
        [yes, no]
            .map(|chosen| Self { tetrahedra: chosen.into_iter().map(|i| self.tetrahedra[i]).collect(), ..self.clone() })
    }

    /// Puts a point into a tetrahedron and joins it to the four faces.
    pub fn insert(&mut self, tetrahedron: usize, weights: [f64; 4]) {
        let corners = self.tetrahedra[tetrahedron];
        let sum: f64 = weights.iter().sum();
        let place = |i: usize| self.points[corners[i] as usize] * (weights[i] / sum);
        let point = (0..4).map(place).sum();
        let number = self.points.len() as u32;
        self.points.push(point);
        for i in 0..4 {
            let mut part = corners;
            part[i] = number;
            if i == 0 {
                self.tetrahedra[tetrahedron] = part;
            } else {
                self.tetrahedra.push(part);
            }
        }
    }
}

/// The corners of the unit cube, x fastest.
pub fn cube_corners() -> Vec<DVec3> {
    (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2 & 1))).collect()
}

/// The unit cube cut into 5, 6 or 24 tetrahedra.
pub fn cube(parts: usize) -> Parts {
    let mut points = cube_corners();
    let tetrahedra = match parts {
        5 => vec![[0, 1, 2, 4], [3, 1, 2, 7], [5, 1, 4, 7], [6, 2, 4, 7], [1, 2, 4, 7]],
        6 => [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]].map(|[a, b]| [0, a, b, 7]).to_vec(),
        _ => {
            // A pyramid of four over each face, with the middle of the face.
            points.push(DVec3::splat(0.5));
            let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
            let mut tetrahedra = Vec::new();
            for face in faces {
                let middle = points.len() as u32;
                points.push(face.iter().map(|&i: &u32| points[i as usize]).sum::<DVec3>() / 4.0);
                tetrahedra.extend((0..4).map(|i| [face[i], face[(i + 1) % 4], middle, 8]));
            }
            tetrahedra
        }
    };
    Parts { points, tetrahedra }
}

/// The unit cube as n³ cubes of six tetrahedra each, whose inner vertices are moved by up to a
/// part of their distance.
pub fn grid(n: usize, shake: f64, seed: u64) -> Parts {
    let mut dice = Dice(seed);
    let side = n + 1;
    let at = |x: usize, y: usize, z: usize| ((z * side + y) * side + x) as u32;
    let mut points = Vec::new();
    for i in 0..side * side * side {
        let whole = [i % side, i / side % side, i / (side * side)];
        let moved = (2.0 * dice.point() - 1.0) * shake;
        points.push(DVec3::from_array([0, 1, 2].map(|a| {
            let inner = whole[a] > 0 && whole[a] < n;
            (whole[a] as f64 + if inner { moved[a] } else { 0.0 }) / n as f64
        })));
    }
    let mut tetrahedra = Vec::new();
    for i in 0..n * n * n {
        let (x, y, z) = (i % n, i / n % n, i / (n * n));
        let corner = |c: u32| at(x + (c & 1) as usize, y + (c >> 1 & 1) as usize, z + (c >> 2) as usize);
        tetrahedra.extend(cube(6).tetrahedra.iter().map(|t| t.map(corner)));
    }
    Parts { points, tetrahedra }
}

/// The unit cube in a way that breaks programs: shaken, then points put so close to faces, edges
/// and corners of tetrahedra that slivers of all sizes down to 1e-9 arise.
pub fn nasty(n: usize, inserted: usize, seed: u64) -> Parts {
    let mut parts = grid(n, 0.3, seed);
    let mut dice = Dice(seed ^ 0x5eed);
    for _ in 0..inserted {
        let tetrahedron = dice.below(parts.tetrahedra.len());
        let weights = [0; 4].map(|_| 10f64.powf(-9.0 * dice.roll() * dice.roll()));
        parts.insert(tetrahedron, weights);
    }
    parts
}

/// A per-vertex attribute.
pub fn attribute(values: Vec<f64>) -> Attribute {
    Attribute::new("values", ScalarType::F64, 1, Buffer::from_vec(values)).unwrap()
}

/// A mesh whose vertices have the numbers of a function of their places, through a table.
pub fn field(parts: &Parts, f: impl Fn(DVec3) -> f64, table: LookupTable, unit: f64) -> Shape {
    let values = parts.points.iter().map(|&p| f(p)).collect();
    let look = Appearance::new("attribute").with("scalars", attribute(values)).with("lookup_table", table);
    Shape::new(parts.mesh(), look.with("unit_distance", unit))
}

/// Both pictures enclose the same truth, so every pair of enclosures meets, and all are narrow.
#[track_caller]
pub fn agree(a: &ReferencePicture, b: &ReferencePicture) {
    assert_eq!((a.not_certified, b.not_certified), (0, 0), "widest {:e} {:e}", a.widest, b.widest);
    for i in 0..a.color.len() {
        for c in 0..4 {
            let apart = (a.color[i][c] - b.color[i][c]).abs();
            let reach = 0.5 * (a.upper[i][c] - a.lower[i][c] + b.upper[i][c] - b.lower[i][c]);
            let (x, y) = (a.color[i], b.color[i]);
            assert!(apart <= reach + 2e-15, "pixel {i}, channel {c}: {x:?} {y:?}, {apart:e} of {reach:e}");
        }
        let (d, e) = (a.depth[i], b.depth[i]);
        assert!(d == e || (d - e).abs() < 1e-8 * d.abs(), "pixel {i}: depth {d} {e}");
    }
}

/// Frames that look at the unit cube: askew, along an axis with rays through vertices, along
/// faces and along a diagonal, from near and from within.
pub fn views() -> Vec<FrameDesc> {
    use volact_core::{Camera, View};
    let cube = volact_core::Aabb::new(DVec3::ZERO, DVec3::ONE);
    let middle = DVec3::splat(0.5);
    // Nine by nine pixels an eighth apart: the outer ones see the cube's faces from the side.
    let grid =
        |to: DVec3, up: DVec3| FrameDesc::new(Camera::orthographic(middle - 3.0 * to, middle, up, 9.0 / 8.0), 9, 9);
    vec![
        FrameDesc::new(Camera::fit(&cube, View::Iso, 11, 9), 11, 9),
        grid(DVec3::Z, DVec3::Y),
        grid(-DVec3::X, DVec3::Z),
        grid(DVec3::Y, DVec3::X),
        FrameDesc::new(Camera::orthographic(DVec3::splat(-1.0), middle, DVec3::Z, 1.2), 9, 9),
        FrameDesc::new(Camera::perspective(DVec3::new(1.7, 0.2, 0.4), middle, DVec3::Z, 40.0), 9, 9),
        FrameDesc::new(Camera::perspective(DVec3::new(0.3, 0.4, 0.6), DVec3::ONE, DVec3::Z, 80.0), 9, 9),
    ]
}
