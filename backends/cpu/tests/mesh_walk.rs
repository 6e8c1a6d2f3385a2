//! The walk through meshes against every tetrahedron cut by planes in f64.

use std::ops::ControlFlow;

use proptest::prelude::*;
use volact_core::{
    Aabb, Buffer, Camera, ControlPoint, Cylinder, Geometry, LookupTable, Sphere, StructuredMesh, Tessellation,
    Viewport,
    glam::{DAffine3, DVec3},
};
use volact_cpu::fast::{
    mesh::{
        build::Linked,
        exact::{Light, Look},
        integrate::Job,
        shot::{Drawn, Shot},
        table::Table,
    },
    over::Pixels,
    packet::Span,
    simd::{LANES, Unit},
};

const SIZE: [usize; 2] = [20, 12];

/// A grid of cells, bent by `bend`.
fn grid(dims: [usize; 3], bend: impl Fn(DVec3) -> DVec3) -> StructuredMesh {
    let [nx, ny, nz] = dims;
    let at = |i: usize, n: usize| i as f64 / (n - 1) as f64;
    let points = (0..nx * ny * nz).map(|v| bend(DVec3::new(at(v % nx, nx), at(v / nx % ny, ny), at(v / nx / ny, nz))));
    StructuredMesh::new(dims, points.collect()).unwrap()
}

fn random(seed: usize) -> f64 {
    let mixed = (seed as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 11) as f64 / (1u64 << 53) as f64
}

/// Meshes that break programs.
fn nasty() -> Vec<(&'static str, Tessellation)> {
    let tessellate = |g: &dyn Geometry| g.tessellate().unwrap();
    // Cells that collapse on an axis, and get ever thinner towards a wall.
    let fin = grid([9, 8, 6], |p| {
        let (angle, r) = (1.5 * p.x, p.y.powi(6));
        DVec3::new(r * angle.cos(), r * angle.sin(), p.z)
    });
    // A hole, and cells that only touch in edges and vertices.
    let dims = [7, 6, 5];
    let holes = (0..dims.iter().product::<usize>()).map(|v| u8::from(random(v + 3) > 0.12)).collect::<Vec<_>>();
    let holed = grid(dims, |p| p + 0.04 * DVec3::new((9.0 * p.y).sin(), (7.0 * p.z).cos(), (8.0 * p.x).sin()));
    let holed = holed.with_blanking(Buffer::from_vec(holes)).unwrap();
    // A spiral, whose cells hide one another in a ring from many sides.
    let spiral = grid([40, 4, 4], |p| {
        let (angle, r) = (9.0 * p.x, 0.5 + 0.2 * p.y);
        DVec3::new(r * angle.cos(), r * angle.sin(), 0.8 * p.x + 0.2 * p.z + 0.1 * p.y)
    });
    let slivers =
        grid([6, 6, 6], |p| DVec3::new(p.x, p.y, 1e-5 * (p.z + 0.3 * random((p.x * 99.0 + p.y * 999.0) as usize))));
    let regular = grid([5, 5, 5], |p| p);
    let tiny = grid([30, 30, 6], |p| p * DVec3::new(1.0, 1.0, 0.3));
    vec![
        ("fin", tessellate(&fin)),
        ("holed", tessellate(&holed)),
        ("spiral", tessellate(&spiral)),
        ("slivers", tessellate(&slivers)),
        ("regular", tessellate(&regular)),
        ("tiny", tessellate(&tiny)),
        ("ball", tessellate(&Sphere::new(DVec3::splat(0.5), 0.5, 18).unwrap())),
        ("cylinder", tessellate(&Cylinder::new([DVec3::ZERO, DVec3::ONE], 0.4, 13).unwrap())),
    ]
}

/// Where a line is inside a tetrahedron: in front of its four planes.
fn inside(corners: [DVec3; 4], origin: DVec3, direction: DVec3) -> Option<[f64; 2]> {
    let (mut t0, mut t1) = (f64::NEG_INFINITY, f64::INFINITY);
    for [a, b, c, d] in [[0, 1, 2, 3], [1, 0, 3, 2], [2, 3, 0, 1], [3, 2, 1, 0]].map(|i| i.map(|i| corners[i])) {
        let normal = (b - a).cross(c - a);
        let normal = normal * (d - a).dot(normal).signum();
        let (slope, height) = (normal.dot(direction), normal.dot(origin - a));
        if slope > 0.0 {
            t0 = t0.max(-height / slope);
        } else if slope < 0.0 {
            t1 = t1.min(-height / slope);
        } else if height < 0.0 {
            return None;
        }
    }
    (t0 < t1).then_some([t0, t1])
}

/// All crossings, found tetrahedron by tetrahedron.
fn brute(mesh: &Tessellation, origin: DVec3, direction: DVec3, [start, end]: [f64; 2]) -> Vec<(usize, [f64; 2])> {
    let cut = |i: usize| {
        let [a, b] = inside(mesh.corners(i), origin, direction)?;
        let span = [a.max(start), b.min(end)];
        (span[0] < span[1]).then_some((i, span))
    };
    (0..mesh.tetrahedra.len()).filter_map(cut).collect()
}

fn length(crossings: &[(usize, [f64; 2])]) -> f64 {
    crossings.iter().map(|(_, [a, b])| b - a).sum()
}

fn bounds(mesh: &Tessellation) -> Aabb {
    mesh.vertices.bounds()
}

fn cameras(mesh: &Tessellation, seed: usize) -> Vec<Camera> {
    let at = |i: usize| DVec3::new(random(seed + i), random(seed + i + 1), random(seed + i + 2));
    let all = bounds(mesh);
    let (center, reach) = (all.center(), all.size().length());
    let far = center + (at(0) - 0.5).normalize() * reach * 1.7;
    let inner = all.min + all.size() * at(10);
    let up = (at(20) - 0.5).normalize();
    vec![
        Camera::perspective(far, center + 0.1 * reach * at(30), up, 35.0),
        Camera::orthographic(far, center, up, reach),
        // The eye inside, and straight along cells' faces, edges and vertices.
        Camera::perspective(inner, inner + at(40) - 0.5, up, 100.0),
        Camera::orthographic(center - DVec3::Z * reach, center, DVec3::Y, 1.2 * all.size().y),
        Camera::perspective(center + DVec3::X * reach * 2.0, center, DVec3::Z, 30.0),
        // From a thousand diagonals away.
        Camera::perspective(center + (far - center) * 1000.0, center, up, 0.05),
    ]
}

fn linked(mesh: &Tessellation) -> Linked {
    Linked::new(mesh, |_, _| {}).unwrap()
}

/// Visits the packets of a picture.
fn packets(mut visit: impl FnMut([usize; 2], u32)) {
    for y in (0..SIZE[1]).step_by(4) {
        (0..SIZE[0]).step_by(4).for_each(|x| visit([x, y], 0xffff));
    }
}

fn spans(rays: &[volact_core::Ray; LANES], active: u32) -> Span {
    let (mut start, mut end) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        (start[l], end[l]) = (rays[l].near, rays[l].far);
    }
    Span { start, end, active }
}

fn rays(grid: &volact_core::RayGrid, [x, y]: [usize; 2]) -> [volact_core::Ray; LANES] {
    std::array::from_fn(|l| grid.ray((x + l % 4) as f64 + 0.5, (y + l / 4) as f64 + 0.5))
}

const VIEWPORT: Viewport = Viewport { x: 0, y: 0, width: SIZE[0], height: SIZE[1] };

#[test]
fn lengths_in_cells_are_those_of_tetrahedra_cut_by_planes() {
    let unit = Unit::detect();
    let (mut compared, mut within) = (0, 0);
    for (name, mesh) in nasty() {
        let (linked, all) = (linked(&mesh), bounds(&mesh));
        let numbers = vec![0.0; mesh.vertices.len()];
        let reach = all.size().length();
        for (i, camera) in cameras(&mesh, 7).into_iter().enumerate() {
            let grid = camera.rays(&VIEWPORT).unwrap();
            let shot = Shot::new(&linked, &numbers, &DAffine3::IDENTITY, &all, (&grid.linear(), SIZE), 1).unwrap();
            packets(|pixel, active| {
                let rays = rays(&grid, pixel);
                let (found, drawn) = shot.lengths(unit, pixel, &[spans(&rays, active)]);
                for (l, ray) in rays.iter().enumerate().filter(|(l, _)| drawn.left >> l & 1 == 0) {
                    // What rounding to f32 can move a ray by, it may change.
                    let near = |dx: f64, dy: f64| {
                        let (x, y) = ((pixel[0] + l % 4) as f64 + 0.5, (pixel[1] + l / 4) as f64 + 0.5);
                        let ray = grid.ray(x + dx, y + dy);
                        length(&brute(&mesh, ray.origin, ray.direction, [ray.near, ray.far]))
                    };
                    compared += 1;
                    let wanted = near(0.0, 0.0);
                    if (found[l] - wanted).abs() < 2e-6 * reach {
                        within += 1;
                        continue;
                    }
                    let e = 2e-5;
                    let around = [near(e, 0.0), near(-e, 0.0), near(0.0, e), near(0.0, -e)];
                    let low = around.into_iter().fold(wanted, f64::min);
                    let high = around.into_iter().fold(wanted, f64::max);
                    let good = found[l] >= low - 2e-6 * reach && found[l] <= high + 2e-6 * reach;
                    assert!(good, "{name}, camera {i}, {pixel:?} {l}: {} {wanted} {around:?} {ray:?}", found[l]);
                }
            });
        }
    }
    assert!(compared > 8000 && within as f64 > 0.995 * f64::from(compared as u32), "{within} of {compared}");
}

fn looks() -> Vec<LookupTable> {
    let table = |points: &[[f64; 3]]| {
        let point = |&[value, hue, opacity]: &[f64; 3]| {
            let color = [hue, 1.0 - hue, (3.0 * hue).fract()];
            ControlPoint { value, color, opacity }
        };
        LookupTable::from_points(points.iter().map(point).collect::<Vec<_>>()).unwrap()
    };
    vec![
        table(&[[0.0, 0.0, 0.0], [0.3, 0.5, 0.2], [1.0, 1.0, 0.8]]),
        // Thin spikes and steps.
        table(&[
            [0.0, 0.3, 0.01],
            [0.5, 0.3, 0.01],
            [0.5005, 0.9, 0.99],
            [0.501, 0.3, 0.01],
            [0.8, 0.3, 0.01],
            [0.8, 1.0, 0.6],
            [2.0, 0.0, 0.6],
        ]),
        // Opaque from somewhere on.
        table(&[[0.0, 0.0, 0.0], [0.4, 1.0, 0.3], [0.6, 0.2, 1.0], [0.7, 0.5, 1.0], [0.7, 0.0, 0.0], [1.0, 1.0, 0.5]]),
        table(&[[0.4, 0.2, 0.4]]),
    ]
}

/// Some smooth numbers, a few of them unknown.
fn values(mesh: &Tessellation, unknown: bool) -> Vec<f64> {
    let all = bounds(mesh);
    let value = |(i, p): (usize, DVec3)| {
        let p = (p - all.min) / all.size();
        let value = 0.5 + 0.5 * (2.0 * p.x + 3.0 * p.y).sin() * (1.0 + p.z).cos() + 0.05 * random(i);
        if unknown && random(i + 77) < 0.02 { f64::NAN } else { value }
    };
    mesh.vertices.iter().enumerate().map(value).collect()
}

struct Picture {
    color: Vec<[f32; 4]>,
    depth: Vec<f64>,
    left: u32,
}

struct Scene<'a> {
    linked: &'a Linked,
    mesh: &'a Tessellation,
    values: &'a [f64],
    table: &'a Table,
    camera: Camera,
}

impl Scene<'_> {
    fn draw(&self, unit: Unit, termination: f32) -> Picture {
        let grid = self.camera.rays(&VIEWPORT).unwrap();
        let numbers: Vec<f32> = self.values.iter().map(|&v| self.table.number(v)).collect();
        let all = bounds(self.mesh);
        let shot = Shot::new(self.linked, &numbers, &DAffine3::IDENTITY, &all, (&grid.linear(), SIZE), 1).unwrap();
        let mut made = Picture { color: vec![[0.0; 4]; 240], depth: vec![0.0; 240], left: 0 };
        let job = Job { table: self.table, termination, threshold: 0.5 };
        packets(|pixel, active| {
            let mut pixels = Pixels::default();
            let span = spans(&rays(&grid, pixel), active);
            let Drawn { left, .. } = shot.draw(unit, pixel, &[span], &job, &mut pixels);
            made.left += left.count_ones();
            for l in 0..LANES {
                let at = (pixel[1] + l / 4) * SIZE[0] + pixel[0] + l % 4;
                (made.color[at], made.depth[at]) = (pixels.color[l], pixels.depth[l]);
            }
        });
        made
    }

    /// By every tetrahedron cut by planes, sorted.
    fn brute(&self, x: f64, y: f64) -> (Light, f64) {
        let ray = self.camera.rays(&VIEWPORT).unwrap().ray(x + 0.5, y + 0.5);
        let mut crossings = brute(self.mesh, ray.origin, ray.direction, [ray.near, ray.far]);
        crossings.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]));
        let (mut light, mut depth) = (Light::default(), f64::INFINITY);
        for (i, span) in crossings {
            let v = span.map(|t| value_at(self.mesh, i, self.values, ray.at(t)));
            let part = self.table.look.add(&mut light, v, v, span[1] - span[0], 0.5);
            depth = part.map_or(depth, |part| span[0] + (span[1] - span[0]) * part);
        }
        (light, depth)
    }
}

/// The number at a point of a tetrahedron.
fn value_at(mesh: &Tessellation, i: usize, values: &[f64], p: DVec3) -> f64 {
    let [a, b, c, d] = mesh.corners(i);
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
    let whole = volume(a, b, c, d);
    let weights = [volume(p, b, c, d), volume(a, p, c, d), volume(a, b, p, d), volume(a, b, c, p)];
    (0..4).map(|k| weights[k] / whole * values[mesh.tetrahedra[i][k] as usize]).sum()
}

#[test]
fn pictures_are_those_of_tetrahedra_cut_by_planes() {
    let (mut worst, mut squares, mut count) = (0f64, 0.0, 0u32);
    for (name, mesh) in nasty().into_iter().filter(|(name, _)| *name != "slivers") {
        let linked = linked(&mesh);
        for (i, lut) in looks().into_iter().enumerate() {
            let values = values(&mesh, i == 0);
            let diagonal = bounds(&mesh).size().length();
            let look = Look::new(&lut.resolve([0.0, 1.0]), None, 0.1 * diagonal);
            let table = Table::new(look, [-0.1, 1.1], 0.5, diagonal);
            for (c, camera) in cameras(&mesh, i).into_iter().enumerate() {
                let scene = Scene { linked: &linked, mesh: &mesh, values: &values, table: &table, camera };
                let picture = scene.draw(Unit::detect(), 0.0);
                assert_eq!(picture.left, 0, "{name} {c}");
                for (x, y) in (0..24).map(|k| (k * 7 % SIZE[0], k % SIZE[1])) {
                    let found = picture.color[y * SIZE[0] + x];
                    let error = |light: &Light| {
                        let [r, g, b] = light.color;
                        let wanted = [r, g, b, 1.0 - light.left];
                        (0..4).map(|k| (f64::from(found[k]) - wanted[k]).abs()).fold(0.0, f64::max)
                    };
                    let (mut light, mut depth) = scene.brute(x as f64, y as f64);
                    // A ray along faces is on either side of them.
                    let e = 1e-6;
                    for [dx, dy] in [[e, e], [e, -e], [-e, e], [-e, -e]] {
                        if error(&light) > 1e-4 {
                            let beside = scene.brute(x as f64 + dx, y as f64 + dy);
                            (light, depth) = if error(&beside.0) < error(&light) { beside } else { (light, depth) };
                        }
                    }
                    let error = error(&light);
                    worst = worst.max(error);
                    squares += error * error;
                    count += 1;
                    assert!(error < 3e-3, "{name}, table {i}, camera {c}, ({x}, {y}): {found:?} {light:?}");
                    let at = picture.depth[y * SIZE[0] + x];
                    let near = at == depth || (at - depth).abs() < 1e-3 * diagonal;
                    assert!(near || (light.left - 0.5).abs() < 1e-4, "{name} {i} {c} ({x}, {y}) {at} {depth}");
                }
            }
        }
    }
    let mean = (squares / f64::from(count)).sqrt();
    assert!(mean < 3e-5, "root mean square error {mean:.2e}, worst {worst:.2e} of {count}");
}

/// Clips leave several intervals, which end in different lanes at different places.
#[test]
fn lengths_in_several_intervals_are_those_of_tetrahedra_cut_by_planes() {
    for (name, mesh) in nasty().into_iter().filter(|(name, _)| ["regular", "holed", "tiny"].contains(name)) {
        let (linked, all) = (linked(&mesh), bounds(&mesh));
        let numbers = vec![0.0; mesh.vertices.len()];
        let camera = cameras(&mesh, 3).swap_remove(0);
        let grid = camera.rays(&VIEWPORT).unwrap();
        let reach = all.size().length();
        let shot = Shot::new(&linked, &numbers, &DAffine3::IDENTITY, &all, (&grid.linear(), SIZE), 1).unwrap();
        packets(|pixel, active| {
            let rays = rays(&grid, pixel);
            // Three intervals a ray; every fifth ray has two, and every seventh none.
            let from = 1.7 * reach - 0.6 * reach;
            let ends = |l: usize, i: usize| [0.0, 0.3].map(|e| from + reach * (0.4 * i as f64 + e + 0.01 * l as f64));
            let lanes =
                |i: usize| (0..LANES).filter(|l| l % 7 != 3 && (i < 2 || l % 5 != 1)).fold(0, |m, l| m | 1 << l);
            let spans: Vec<Span> = (0..3)
                .map(|i| {
                    let [start, end] = [0, 1].map(|e| std::array::from_fn(|l| ends(l, i)[e]));
                    Span { start, end, active: active & lanes(i) }
                })
                .collect();
            let (found, drawn) = shot.lengths(Unit::detect(), pixel, &spans);
            for (l, ray) in rays.iter().enumerate().filter(|(l, _)| drawn.left >> l & 1 == 0) {
                let inside = (0..3).filter(|&i| spans[i].active >> l & 1 == 1).map(|i| ends(l, i));
                let wanted: f64 = inside.map(|e| length(&brute(&mesh, ray.origin, ray.direction, e))).sum();
                assert!((found[l] - wanted).abs() < 2e-5 * reach, "{name} {pixel:?} {l}: {} {wanted}", found[l]);
            }
        });
    }
}

/// Numbers that pass several control points within a cell of some optical depth: what tables say of
/// the colour's course within it does not do there.
#[test]
fn coarse_cells_are_those_of_tetrahedra_cut_by_planes() {
    let point = |&[value, hue, opacity]: &[f64; 3]| {
        let color = [hue, 1.0 - hue, (3.0 * hue).fract()];
        ControlPoint { value, color, opacity }
    };
    let waves: Vec<_> =
        (0..24).map(|i| [f64::from(i) / 23.0, f64::from(i % 3) / 2.0, 0.3 + 0.2 * f64::from(i % 2)]).collect();
    let tables: [&[[f64; 3]]; 5] = [
        &[[0.0, 0.1, 0.0], [0.35, 0.3, 0.02], [0.5, 0.9, 0.4], [0.62, 0.1, 0.1], [1.0, 1.0, 0.7]],
        // Even extinction, so that the colour alone bends: up and down around its mean.
        &[[0.0, 0.5, 0.3], [0.4, 0.0, 0.3], [0.6, 1.0, 0.3], [1.0, 0.5, 0.3]],
        &[[0.0, 0.5, 0.3], [0.48, 0.5, 0.3], [0.49, 0.0, 0.3], [0.51, 1.0, 0.3], [0.52, 0.5, 0.3], [1.0, 0.5, 0.3]],
        &[[0.0, 0.0, 0.0], [1.0, 1.0, 0.9]],
        &waves,
    ];
    let mesh = grid([3, 3, 2], |p| p + 0.1 * DVec3::new((3.0 * p.y).sin(), p.z * p.x, p.y * p.y)).tessellate().unwrap();
    let linked = linked(&mesh);
    let values: Vec<f64> = mesh.vertices.iter().map(|p| (0.1 + 0.3 * p.x + 0.15 * p.y + 0.35 * p.z).fract()).collect();
    for (i, points) in tables.iter().enumerate() {
        let points: Vec<_> = points.iter().map(point).collect();
        let lut = LookupTable::from_points(points).unwrap().resolve([0.0, 1.0]);
        for unit in [3.0, 0.3, 0.1, 0.03, 0.01] {
            let table = Table::new(Look::new(&lut, None, unit), [0.0, 1.0], 0.5, bounds(&mesh).size().length());
            // All of it in f64: what is left is the rounding of positions and numbers.
            let mut exact = table.clone();
            exact.entries.iter_mut().for_each(|e| e[1] = f32::NAN);
            let (mut worst, mut rounding) = (0f64, 0f64);
            for camera in cameras(&mesh, 11).into_iter().take(3) {
                let scene = Scene { linked: &linked, mesh: &mesh, values: &values, table: &table, camera };
                let picture = scene.draw(Unit::detect(), 0.0);
                let scene = Scene { table: &exact, ..scene };
                let slow = scene.draw(Unit::detect(), 0.0);
                for (at, (found, slow)) in picture.color.iter().zip(&slow.color).enumerate() {
                    let (light, _) = scene.brute((at % SIZE[0]) as f64, (at / SIZE[0]) as f64);
                    let [r, g, b] = light.color;
                    let wanted = [r, g, b, 1.0 - light.left].map(|v| v as f32);
                    let far = |a: &[f32; 4], b: &[f32; 4]| (0..4).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
                    worst = worst.max(f64::from(far(found, slow)));
                    rounding = rounding.max(f64::from(far(slow, &wanted)));
                }
            }
            println!("table {i}, unit {unit}: {worst:.1e}, rounding {rounding:.1e}");
            assert!(worst < 3e-5 && rounding < 1e-5, "table {i}, unit {unit}: {worst:.1e}, rounding {rounding:.1e}");
        }
    }
}

#[test]
fn wider_units_give_the_same_bits() {
    if Unit::detect() != Unit::Avx512 {
        eprintln!("skipped: this machine has no AVX-512");
        return;
    }
    for (name, mesh) in nasty() {
        let linked = linked(&mesh);
        let (values, diagonal) = (values(&mesh, true), bounds(&mesh).size().length());
        for lut in looks() {
            let look = Look::new(&lut.resolve([0.0, 1.0]), None, 0.1 * diagonal);
            let table = Table::new(look, [-0.1, 1.1], 0.5, diagonal);
            for camera in cameras(&mesh, 5) {
                let scene = Scene { linked: &linked, mesh: &mesh, values: &values, table: &table, camera };
                let [wide, narrow, plain] = [Unit::Avx512, Unit::Avx2, Unit::Plain].map(|u| scene.draw(u, 1e-5));
                assert!(wide.color == narrow.color && wide.depth == narrow.depth, "{name}");
                let close = |(a, b): (&[f32; 4], &[f32; 4])| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3);
                let far = wide.color.iter().zip(&plain.color).filter(|p| !close(*p)).count();
                assert!(far <= 2, "{name}: {far} pixels differ");
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn single_rays_cross_the_tetrahedra_that_planes_cut(
        which in 0usize..8,
        origin in prop::array::uniform3(-1.0..2.0f64),
        toward in prop::array::uniform3(0.0..1.0f64),
        snap in any::<bool>(),
    ) {
        let (name, mesh) = nasty().swap_remove(which);
        let all = bounds(&mesh);
        // Half of the rays go through a vertex.
        let mut toward = all.min + all.size() * DVec3::from(toward);
        if snap {
            let near = |i: &usize| mesh.vertices.at(*i).distance(toward);
            let nearest = (0..mesh.vertices.len()).min_by(|a, b| near(a).total_cmp(&near(b)));
            toward = mesh.vertices.at(nearest.unwrap());
        }
        let origin = all.min + all.size() * DVec3::from(origin);
        let direction = toward - origin;
        prop_assume!(direction.length() > 1e-6);
        let wanted = brute(&mesh, origin, direction, [-10.0, 10.0]);
        let linked = linked(&mesh);
        let mut found = Vec::new();
        linked.trace(origin, direction, [-10.0, 10.0], |c| {
            found.push((c.tetrahedron, c.span));
            ControlFlow::Continue(())
        });
        prop_assert!((length(&found) - length(&wanted)).abs() < 1e-7, "{name}: {} {}", length(&found), length(&wanted));
        for (i, span) in &found {
            if span[1] - span[0] > 1e-6 {
                let same = wanted.iter().find(|(j, _)| i == j);
                prop_assert!(same.is_some_and(|(_, s)| (s[0] - span[0]).abs() < 1e-7 && (s[1] - span[1]).abs() < 1e-7));
            }
        }
    }
}
