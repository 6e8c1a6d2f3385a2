//! The data of the examples, by rule: nothing here was measured on anybody or anything.
//!
//! Lengths are millimetres; values have no unit. Every solid is a signed distance, and its
//! surface is a ramp of two and a half cells, so that the grid does not show.

/// A volume by rule.
pub struct Example {
    /// Where it goes, relative to `examples/`.
    pub path: &'static str,
    /// Samples along x, y, z.
    pub dims: [usize; 3],
    /// Distance between samples.
    pub spacing: f64,
    /// The value at a point, 0 to 255. The origin is the middle of the grid.
    pub value: fn([f64; 3]) -> f64,
}

/// All of them.
pub const EXAMPLES: [Example; 3] = [
    Example { path: "signal/signal.nrrd", dims: [64, 64, 64], spacing: 2.0 / 63.0, value: signal },
    Example { path: "head/head.nrrd", dims: [80, 96, 100], spacing: 2.2, value: head },
    Example { path: "part/part.nrrd", dims: [96, 64, 64], spacing: 1.0, value: part },
];

impl Example {
    /// The voxels, x fastest.
    pub fn voxels(&self) -> Vec<u8> {
        let [nx, ny, nz] = self.dims;
        let place = |i: usize, n: usize| (i as f64 - (n - 1) as f64 / 2.0) * self.spacing;
        let at = |i: usize| [place(i % nx, nx), place(i / nx % ny, ny), place(i / (nx * ny), nz)];
        (0..nx * ny * nz).map(|i| (self.value)(at(i)).clamp(0.0, 255.0).round() as u8).collect()
    }

    /// The whole file: a header of text and the voxels as they are.
    pub fn nrrd(&self) -> Vec<u8> {
        let [nx, ny, nz] = self.dims;
        let s = self.spacing;
        let origin = self.dims.map(|n| -((n - 1) as f64) / 2.0 * s);
        let header = format!(
            "NRRD0004\n# By rule, see examples/generate.rs; MIT OR Apache-2.0\ntype: uint8\ndimension: 3\n\
             space: left-posterior-superior\nsizes: {nx} {ny} {nz}\n\
             space directions: ({s},0,0) (0,{s},0) (0,0,{s})\nspace origin: ({},{},{})\nencoding: raw\n\n",
            origin[0], origin[1], origin[2]
        );
        let mut file = header.into_bytes();
        file.extend(self.voxels());
        file
    }
}

/// The test signal of S. Marschner and R. Lobb, *An evaluation of reconstruction filters for
/// volume rendering*, IEEE Visualization 1994: a chirp whose rings are nearly too fine for the grid.
fn signal([x, y, z]: [f64; 3]) -> f64 {
    use std::f64::consts::PI;
    const FREQUENCY: f64 = 6.0;
    const ALPHA: f64 = 0.25;
    let rings = (2.0 * PI * FREQUENCY * (PI * x.hypot(y) / 2.0).cos()).cos();
    255.0 * ((1.0 - (PI * z / 2.0).sin()) + ALPHA * (1.0 + rings)) / (2.0 * (1.0 + ALPHA))
}

/// A head of ellipsoids in LPS: skin, skull with sockets and teeth, a folded brain, a spine.
fn head(p: [f64; 3]) -> f64 {
    let [x, y, z] = p;
    let side = [x.abs(), y, z];
    let soft = [
        ellipsoid(p, [0.0, 4.0, 28.0], [71.0, 88.0, 76.0]),
        ellipsoid(p, [0.0, -26.0, -34.0], [58.0, 58.0, 64.0]),
        ellipsoid(side, [36.0, -48.0, -20.0], [27.0, 25.0, 20.0]),
        ellipsoid(p, [0.0, -36.0, -68.0], [51.0, 54.0, 24.0]),
        ellipsoid(p, [0.0, -90.0, -10.0], [10.0, 12.0, 20.0]),
        ellipsoid(side, [74.0, 10.0, -4.0], [8.0, 15.0, 24.0]),
        ellipsoid(p, [0.0, -78.0, -52.0], [21.0, 8.0, 9.0]),
        ((x / 46.0).hypot((y - 22.0) / 50.0) - 1.0) * 46.0 + (z - 10.0).max(0.0),
    ];
    let skin = soft.into_iter().reduce(|a, b| blend(a, b, 14.0)).unwrap_or(f64::INFINITY);
    let cranium = ellipsoid(p, [0.0, 4.0, 30.0], [62.0, 79.0, 66.0]);
    let cheeks = ellipsoid(side, [38.0, -50.0, -19.0], [18.0, 17.0, 8.0]);
    let upper_jaw = ellipsoid(p, [0.0, -56.0, -34.0], [29.0, 24.0, 15.0]);
    let arch = ellipsoid(p, [0.0, -36.0, -68.0], [44.0, 46.0, 17.0]);
    let ramus = ellipsoid(side, [45.0, -18.0, -42.0], [6.0, 14.0, 34.0]);
    let jaw = arch.max(-ellipsoid(p, [0.0, -22.0, -62.0], [33.0, 46.0, 30.0])).min(ramus);
    let sockets = ellipsoid(side, [25.0, -72.0, 5.0], [16.0, 22.0, 15.0]);
    let nose = ellipsoid(p, [0.0, -76.0, -18.0], [9.0, 26.0, 13.0]);
    let inside = ellipsoid(p, [0.0, 4.0, 30.0], [55.0, 72.0, 59.0]);
    let face = blend(blend(cranium, cheeks, 10.0), upper_jaw, 8.0);
    let skull = face.max(-inside).max(-sockets).max(-nose).min(jaw);
    let disc = (z / 7.0 * std::f64::consts::PI).sin().abs();
    let spine = (x.hypot(y - 32.0) - 10.0 - 3.0 * disc).max(z + 30.0);
    let row = (x / 24.0).hypot((y + 46.0) / 25.0);
    let gap = ((x.atan2(-(y + 46.0))) * 11.0).cos().abs();
    let teeth = (((row - 1.0).abs() * 24.0 - 4.5) + 2.0 * (1.0 - gap)).max((z + 47.5).abs() - 9.0).max(y + 46.0);
    let folds = 2.4 * ((x * 0.30).sin() + (y * 0.27 + 1.0).sin() + (z * 0.29 + (x * 0.11).cos()).sin());
    let cleft = 2.5 - x.abs() + 0.08 * (70.0 - z).max(0.0);
    let brain = (ellipsoid(p, [0.0, 4.0, 32.0], [50.0, 67.0, 53.0]) + folds.abs()).max(cleft);
    let eyes = ellipsoid(side, [26.0, -70.0, 6.0], [11.0, 11.0, 11.0]);
    let layers =
        [(skin, 78.0), (inside, 62.0), (eyes, 50.0), (brain, 118.0), (skull, 205.0), (spine, 190.0), (teeth, 245.0)];
    layers.into_iter().fold(0.0, |value, (distance, solid)| lay(value, solid, distance, 2.2))
}

/// A casting of boxes and cylinders with bores, and a dense bushing pressed into it.
fn part(p: [f64; 3]) -> f64 {
    let [x, y, z] = p;
    let holes = cylinder([(x.abs() - 36.0).hypot(y.abs() - 20.0), z], 4.0, 99.0);
    let base = cuboid(p, [0.0, 0.0, -22.0], [44.0, 27.0, 5.0]).max(-holes);
    let boss = cylinder([x.hypot(y), z], 18.0, 26.0);
    let arm = cylinder([y.hypot(z - 6.0), x - 22.0], 11.0, 20.0);
    let rib = cuboid(p, [-18.0, 0.0, -6.0], [20.0, 3.0, 14.0]).max((x + 40.0) * -0.6 + (z + 8.0) * 0.8);
    let bore = cylinder([x.hypot(y), z], 12.0, 99.0).min(cylinder([y.hypot(z - 6.0), x - 30.0], 6.0, 30.0));
    let casting = base.min(boss).min(arm).min(rib).max(-bore);
    let bushing = cylinder([x.hypot(y), z + 6.0], 12.0, 14.0).max(-cylinder([x.hypot(y), z], 8.5, 99.0));
    let bolts = cylinder([(x.abs() - 36.0).hypot(y.abs() - 20.0), z + 16.0], 3.0, 7.0);
    let layers = [(casting, 130.0), (bushing.min(bolts), 225.0)];
    layers.into_iter().fold(0.0, |value, (distance, solid)| lay(value, solid, distance, 1.0))
}

/// Replaces a value by a solid's inside the solid, with a ramp across its surface.
fn lay(value: f64, solid: f64, distance: f64, cell: f64) -> f64 {
    let share = (0.5 - distance / (2.5 * cell)).clamp(0.0, 1.0);
    value + (solid - value) * share
}

/// About the distance to an ellipsoid: exact at the surface's poles.
fn ellipsoid(p: [f64; 3], middle: [f64; 3], radii: [f64; 3]) -> f64 {
    let unit: [f64; 3] = std::array::from_fn(|a| (p[a] - middle[a]) / radii[a]);
    let steep: [f64; 3] = std::array::from_fn(|a| unit[a] / radii[a]);
    let length = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let k = length(unit);
    if k < 1e-9 { -radii.into_iter().fold(f64::INFINITY, f64::min) } else { k * (k - 1.0) / length(steep) }
}

fn cuboid(p: [f64; 3], middle: [f64; 3], half: [f64; 3]) -> f64 {
    (0..3).map(|a| (p[a] - middle[a]).abs() - half[a]).fold(f64::NEG_INFINITY, f64::max)
}

/// A cylinder from the distance to its axis and the place along it.
fn cylinder([across, along]: [f64; 2], radius: f64, half: f64) -> f64 {
    (across - radius).max(along.abs() - half)
}

/// The union of two solids with a fillet.
fn blend(a: f64, b: f64, fillet: f64) -> f64 {
    let h = (0.5 + 0.5 * (b - a) / fillet).clamp(0.0, 1.0);
    b + (a - b) * h - fillet * h * (1.0 - h)
}
