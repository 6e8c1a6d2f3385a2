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

/// A file of another kind, and what is in it.
pub type File = (&'static str, fn() -> Vec<u8>);

/// The meshes and surfaces.
pub const FILES: [File; 3] = [("carved/cells.vtk", cells), ("spring/ring.obj", ring), ("spring/spring.obj", spring)];

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

/// Cells that fill the box of the head but for a part of its shell: in object space of the head.
///
/// Around the middle of the brain a dome of pyramids, just larger than the brain; around that a
/// shell of hexahedra, of which the front left of the upper half is missing; both stand on prisms.
fn cells() -> Vec<u8> {
    const AROUND: usize = 24;
    const UP: usize = 6;
    const MIDDLE: [f64; 3] = [86.9, 108.5, 140.9];
    const BRAIN: [f64; 3] = [52.7, 69.7, 55.8];
    const ALL: [f64; 3] = [95.0, 115.0, 85.0];
    const BOTTOM: f64 = -2.0;
    // The dome's rings from its foot upwards, the shell's, and their feet at the bottom.
    let dome = |l: usize, a: usize| 2 + l * AROUND + a % AROUND;
    let shell = |l: usize, a: usize| dome(UP + l, a);
    let foot = |a: usize| dome(2 * UP, a);
    let wide = |a: usize| dome(2 * UP + 1, a);
    let (middle, deep, top, above) = (0, 1, wide(0) + AROUND, wide(0) + AROUND + 1);
    let on = |radii: [f64; 3], l: usize, a: usize| {
        let [up, turn] =
            [l as f64 / UP as f64 / 4.0, a as f64 / AROUND as f64].map(|part| part * std::f64::consts::TAU);
        let unit = [up.cos() * turn.sin(), -up.cos() * turn.cos(), up.sin()];
        std::array::from_fn(|i| MIDDLE[i] + radii[i] * unit[i])
    };
    let rings = |radii| (0..UP * AROUND).map(move |i| on(radii, i / AROUND, i % AROUND));
    let low = |[x, y, _]: [f64; 3]| [x, y, BOTTOM];
    let mut points: Vec<[f64; 3]> = vec![MIDDLE, low(MIDDLE)];
    points.extend(rings(BRAIN).chain(rings(ALL)));
    points.extend((0..AROUND).map(|a| low(on(BRAIN, 0, a))).chain((0..AROUND).map(|a| low(on(ALL, 0, a)))));
    points.extend([on(BRAIN, UP, 0), on(ALL, UP, 0)]);
    let mut cells: Vec<(u8, Vec<usize>)> = Vec::new();
    for (a, b) in (0..AROUND).map(|a| (a, a + 1)) {
        let missing = !(7..=21).contains(&a);
        cells.push((13, vec![deep, foot(a), foot(b), middle, dome(0, a), dome(0, b)]));
        let base = [foot(a), wide(a), wide(b), foot(b)];
        cells.push((12, [base, [dome(0, a), shell(0, a), shell(0, b), dome(0, b)]].concat()));
        for l in 0..UP - 1 {
            let face = |ring: &dyn Fn(usize, usize) -> usize| [ring(l, a), ring(l, b), ring(l + 1, b), ring(l + 1, a)];
            let [p, q, r, s] = face(&dome);
            cells.push((14, vec![s, r, q, p, middle]));
            cells.extend((!missing).then(|| (12, [face(&dome), face(&shell)].concat())));
        }
        let (inner, outer) = ([dome(UP - 1, a), dome(UP - 1, b), top], [shell(UP - 1, a), shell(UP - 1, b), above]);
        cells.push((10, vec![inner[1], inner[0], top, middle]));
        cells.extend((!missing).then(|| (13, [inner, outer].concat())));
    }
    legacy_vtk(&points, &cells)
}

/// An unstructured grid of cells with the types of VTK, as text.
fn legacy_vtk(points: &[[f64; 3]], cells: &[(u8, Vec<usize>)]) -> Vec<u8> {
    let numbers: usize = cells.iter().map(|(_, corners)| 1 + corners.len()).sum();
    let point = |[x, y, z]: &[f64; 3]| format!("{x:.2} {y:.2} {z:.2}\n");
    let cell = |(_, corners): &(u8, Vec<usize>)| {
        let corners: Vec<_> = corners.iter().map(usize::to_string).collect();
        format!("{} {}\n", corners.len(), corners.join(" "))
    };
    let mut text =
        "# vtk DataFile Version 3.0\nBy rule, see examples/generate.rs; MIT OR Apache-2.0\nASCII\n".to_owned();
    text += &format!("DATASET UNSTRUCTURED_GRID\nPOINTS {} float\n", points.len());
    points.iter().for_each(|p| text += &point(p));
    text += &format!("CELLS {} {numbers}\n", cells.len());
    cells.iter().for_each(|c| text += &cell(c));
    text += &format!("CELL_TYPES {}\n", cells.len());
    cells.iter().for_each(|(kind, _)| text += &format!("{kind}\n"));
    text.into_bytes()
}

/// A ring around the casting's boss, tilted so that it goes through the arm.
fn ring() -> Vec<u8> {
    let at = |t: f64| {
        let (y, x) = (t * std::f64::consts::TAU).sin_cos();
        [28.0 * x, 28.0 * y, 15.0 - 9.0 * x]
    };
    tube(at, 96, 14, 2.6, true)
}

/// A spring in the casting's bore, standing out above it.
fn spring() -> Vec<u8> {
    let at = |t: f64| {
        let (y, x) = (t * 8.0 * std::f64::consts::TAU).sin_cos();
        [5.6 * x, 5.6 * y, -24.0 + 66.0 * t]
    };
    tube(at, 8 * 20, 8, 1.5, false)
}

/// A tube around a curve that is nowhere upright, in quadrilaterals with smooth normals.
fn tube(curve: impl Fn(f64) -> [f64; 3], along: usize, around: usize, radius: f64, closed: bool) -> Vec<u8> {
    let rings = if closed { along } else { along + 1 };
    let mut text = "# By rule, see examples/generate.rs; MIT OR Apache-2.0\n".to_owned();
    for i in 0..rings {
        let t = i as f64 / along as f64;
        let [middle, before, after] = [t, t - 1e-4, t + 1e-4].map(&curve);
        let way = unit(std::array::from_fn(|k| after[k] - before[k]));
        let side = unit(cross(way, [0.0, 0.0, 1.0]));
        let up = cross(side, way);
        for j in 0..around {
            let (s, c) = (j as f64 / around as f64 * std::f64::consts::TAU).sin_cos();
            let normal: [f64; 3] = std::array::from_fn(|k| c * side[k] + s * up[k]);
            let [x, y, z]: [f64; 3] = std::array::from_fn(|k| middle[k] + radius * normal[k]);
            text += &format!("v {x:.2} {y:.2} {z:.2}\nvn {:.2} {:.2} {:.2}\n", normal[0], normal[1], normal[2]);
        }
    }
    let corner = |i: usize, j: usize| 1 + i % rings * around + j % around;
    for (i, j) in (0..along).flat_map(|i| (0..around).map(move |j| (i, j))) {
        let corners = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        let corners: Vec<_> = corners.iter().map(|n| format!("{n}//{n}")).collect();
        text += &format!("f {}\n", corners.join(" "));
    }
    text.into_bytes()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = (a[0] * a[0] + a[1] * a[1] + a[2] * a[2]).sqrt();
    a.map(|v| v / length)
}
