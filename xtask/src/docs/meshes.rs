//! Small meshes and surfaces in the formats of which the examples have none, by rule.

use std::f64::consts::{PI, TAU};

use super::File;

/// All files.
pub fn files() -> Vec<File> {
    let [grid, solution] = plot3d();
    vec![
        ("ring.vtu", vtu()),
        ("duct.vts", vts()),
        ("duct.xyz", grid),
        ("duct.q", solution),
        ("knot.ply", ply(&knot())),
        ("urchin.stl", stl(&urchin())),
        ("shell.vtp", vtp(&shell())),
    ]
}

fn words<T: ToString>(values: impl IntoIterator<Item = T>) -> String {
    values.into_iter().map(|v| v.to_string()).collect::<Vec<_>>().join(" ")
}

fn decimals(values: impl IntoIterator<Item = f64>) -> String {
    words(values.into_iter().map(|v| format!("{v:.4}")))
}

/// Vertices of the duct along its bend, across and up.
const DUCT: [usize; 3] = [33, 9, 9];

/// A duct that bends by three quarters of a circle and widens; with each vertex's heat.
fn duct() -> Vec<([f64; 3], f64)> {
    let [nu, nv, nw] = DUCT;
    let vertex = |i: usize| {
        let [u, v, w] = [i % nu, i / nu % nv, i / (nu * nv)];
        let [u, v, w] = [(u, nu), (v, nv), (w, nw)].map(|(i, n)| i as f64 / (n - 1) as f64);
        let (turn, wide) = (1.5 * PI * u, 0.5 + 0.7 * u);
        let radius = 2.0 + wide * (v - 0.5);
        let across = (2.0 * (v - 0.5)).hypot(2.0 * (w - 0.5));
        let heat = (1.0 - 0.75 * across) * (0.6 + 0.4 * (12.0 * u).cos());
        ([radius * turn.cos(), radius * turn.sin(), wide * (w - 0.5)], heat)
    };
    (0..nu * nv * nw).map(vertex).collect()
}

fn vts() -> Vec<u8> {
    let extent = DUCT.map(|n| format!("0 {}", n - 1)).join(" ");
    let points = duct();
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"StructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
         <StructuredGrid WholeExtent=\"{extent}\">\n<Piece Extent=\"{extent}\">\n<PointData>\n<DataArray type=\"Float32\" \
         Name=\"heat\" format=\"ascii\">\n{}\n</DataArray>\n</PointData>\n<Points>\n<DataArray type=\"Float32\" \
         NumberOfComponents=\"3\" format=\"ascii\">\n{}\n</DataArray>\n</Points>\n</Piece>\n</StructuredGrid>\n</VTKFile>\n",
        decimals(points.iter().map(|p| p.1)),
        decimals(points.iter().flat_map(|p| p.0)),
    )
    .into_bytes()
}

/// The duct as a grid and a solution whose density is the heat.
fn plot3d() -> [Vec<u8>; 2] {
    let points = duct();
    let dims: Vec<u8> = DUCT.iter().flat_map(|n| (*n as i32).to_le_bytes()).collect();
    let floats = |values: Vec<f64>| values.into_iter().flat_map(|v| (v as f32).to_le_bytes()).collect::<Vec<_>>();
    let places = (0..3).flat_map(|axis| points.iter().map(move |p| p.0[axis])).collect();
    let density = points.iter().map(|p| 1.0 + p.1);
    let others = std::iter::repeat_n(1.0, 4 * points.len());
    let solution = [0.5, 0.0, 1.0, 0.0].into_iter().chain(density).chain(others).collect();
    [[dims.clone(), floats(places)].concat(), [dims, floats(solution)].concat()]
}

/// A ring of hexahedra with the height of a wave around it.
fn vtu() -> Vec<u8> {
    let (around, across) = (48usize, 4usize);
    let side = across + 1;
    let mut points = Vec::new();
    let mut waves = Vec::new();
    for (a, v, w) in (0..around).flat_map(|a| (0..side * side).map(move |i| (a, i % side, i / side))) {
        let turn = TAU * a as f64 / around as f64;
        let [v, w] = [v, w].map(|i| i as f64 / across as f64 - 0.5);
        // The cross section turns by a quarter on the way round.
        let (sin, cos) = (turn / 4.0).sin_cos();
        let [out, up] = [v * cos - w * sin, v * sin + w * cos];
        let radius = 2.0 + 1.1 * out;
        points.extend([radius * turn.cos(), radius * turn.sin(), 1.1 * up]);
        waves.push((5.0 * turn).sin() * (1.0 - 1.2 * v.hypot(w)));
    }
    // The last ring meets the first turned by a quarter.
    let corner = |a: usize, v: usize, w: usize| match a {
        a if a < around => a * side * side + w * side + v,
        _ => v * side + across - w,
    };
    let mut cells = Vec::new();
    for (a, v, w) in (0..around).flat_map(|a| (0..across * across).map(move |i| (a, i % across, i / across))) {
        for a in [a, a + 1] {
            cells.extend([corner(a, v, w), corner(a, v + 1, w), corner(a, v + 1, w + 1), corner(a, v, w + 1)]);
        }
    }
    let count = cells.len() / 8;
    let array = |kind: &str, name: &str, more: &str, words: String| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\"{more} format=\"ascii\">\n{words}\n</DataArray>\n")
    };
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\">\n\
         <UnstructuredGrid>\n<Piece NumberOfPoints=\"{}\" NumberOfCells=\"{count}\">\n<PointData>\n{}</PointData>\n<Points>\n\
         {}</Points>\n<Cells>\n{}{}{}</Cells>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
        waves.len(),
        array("Float32", "wave", "", decimals(waves.iter().copied())),
        array("Float32", "Points", " NumberOfComponents=\"3\"", decimals(points)),
        array("Int32", "connectivity", "", words(cells)),
        array("Int32", "offsets", "", words((1..=count).map(|n| 8 * n))),
        array("UInt8", "types", "", words(std::iter::repeat_n(12, count))),
    )
    .into_bytes()
}

/// Vertices and triangles.
struct Surface {
    points: Vec<[f64; 3]>,
    triangles: Vec<[usize; 3]>,
}

/// The surface of a rule over a grid that closes around, and along where told.
fn surface(along: usize, around: usize, closed: bool, at: impl Fn(f64, f64) -> [f64; 3]) -> Surface {
    let rings = if closed { along } else { along + 1 };
    let part = |i: usize, n: usize| i as f64 / n as f64;
    let points = (0..rings * around).map(|i| at(part(i / around, along), part(i % around, around))).collect();
    let vertex = |l: usize, a: usize| l % rings * around + a % around;
    let quads = (0..along * around).map(|i| (i / around, i % around));
    let triangles = quads.flat_map(|(l, a)| {
        let [p, q, r, s] = [vertex(l, a), vertex(l, a + 1), vertex(l + 1, a + 1), vertex(l + 1, a)];
        [[p, q, r], [p, r, s]]
    });
    Surface { points, triangles: triangles.collect() }
}

/// A trefoil of round section.
fn knot() -> Surface {
    let curve = |t: f64| {
        let t = TAU * t;
        [t.sin() + 2.0 * (2.0 * t).sin(), t.cos() - 2.0 * (2.0 * t).cos(), -(3.0 * t).sin()]
    };
    surface(160, 20, true, |l, a| {
        let (middle, ahead) = (curve(l), curve(l + 1e-4));
        let tangent = unit(std::array::from_fn(|i| ahead[i] - middle[i]));
        let side = unit(cross(tangent, [0.0, 0.0, 1.0]));
        let up = cross(side, tangent);
        let (sin, cos) = (TAU * a).sin_cos();
        std::array::from_fn(|i| middle[i] + 0.55 * (cos * side[i] + sin * up[i]))
    })
}

/// A ball with bumps.
fn urchin() -> Surface {
    surface(72, 144, false, |l, a| {
        let (polar, turn) = (PI * l, TAU * a);
        let radius = 1.0 + 0.22 * (8.0 * turn).cos() * polar.sin().powi(2) * (8.0 * polar).cos();
        [radius * polar.sin() * turn.cos(), radius * polar.sin() * turn.sin(), radius * polar.cos()]
    })
}

/// A sea shell: a circle that grows on its way around and down.
fn shell() -> Surface {
    surface(180, 28, false, |l, a| {
        let (turn, grown) = (3.2 * TAU * l, (2.6 * (l - 1.0)).exp());
        let (sin, cos) = (TAU * a).sin_cos();
        let radius = grown * (1.15 + cos);
        [radius * turn.cos(), radius * turn.sin(), grown * (sin - 2.2)]
    })
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
}

fn unit(a: [f64; 3]) -> [f64; 3] {
    let length = a.iter().map(|v| v * v).sum::<f64>().sqrt();
    a.map(|v| v / length)
}

fn ply(surface: &Surface) -> Vec<u8> {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\nelement face {}\n\
         property list uchar int vertex_indices\nend_header\n",
        surface.points.len(),
        surface.triangles.len()
    );
    surface.points.iter().for_each(|p| text += &(decimals(*p) + "\n"));
    surface.triangles.iter().for_each(|t| text += &format!("3 {}\n", words(t)));
    text.into_bytes()
}

fn stl(surface: &Surface) -> Vec<u8> {
    let mut out = vec![b' '; 80];
    out.extend((surface.triangles.len() as u32).to_le_bytes());
    for triangle in &surface.triangles {
        out.extend([0; 12]);
        let corners = triangle.iter().flat_map(|v| surface.points[*v]);
        out.extend(corners.flat_map(|v| (v as f32).to_le_bytes()));
        out.extend([0; 2]);
    }
    out
}

fn vtp(surface: &Surface) -> Vec<u8> {
    let count = surface.triangles.len();
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\">\n<PolyData>\n\
         <Piece NumberOfPoints=\"{}\" NumberOfPolys=\"{count}\">\n<Points>\n<DataArray type=\"Float32\" \
         NumberOfComponents=\"3\" format=\"ascii\">\n{}\n</DataArray>\n</Points>\n<Polys>\n<DataArray type=\"Int32\" \
         Name=\"connectivity\" format=\"ascii\">\n{}\n</DataArray>\n<DataArray type=\"Int32\" Name=\"offsets\" \
         format=\"ascii\">\n{}\n</DataArray>\n</Polys>\n</Piece>\n</PolyData>\n</VTKFile>\n",
        surface.points.len(),
        decimals(surface.points.iter().flatten().copied()),
        words(surface.triangles.iter().flatten()),
        words((1..=count).map(|n| 3 * n)),
    )
    .into_bytes()
}
