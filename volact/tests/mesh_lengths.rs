//! A ray meets every point of a mesh exactly once: on real meshes, from 200 directions, by the
//! traversal that draws.
//!
//! The truth knows nothing of cells: along a line, the length inside is the sum of where it leaves
//! through the boundary less the sum of where it enters. (Where cells overlap, each counts; so
//! does this.) The drawn picture tells the length, too: a field of constant opacity absorbs
//! 1 − (1 − a)^(L/unit).
//!
//! The meshes are those in the folder that `VOLACT_DATA` names; without it nothing is tested, and
//! the test says so.

use std::{f64::consts::PI, ops::ControlFlow, path::PathBuf};

use volact::{
    Options, Registry, RegistryExt,
    core::{
        Aabb, Appearance, Attribute, Buffer, Camera, ControlPoint, FrameDesc, LookupTable, MeshData, RayGrid,
        ScalarType, Shape, Tessellation, bvh::Bvh, geometry::Adjacency, glam::DVec3,
    },
};
use volact_cpu::fast::mesh::build::Linked;

const DIRECTIONS: usize = 200;
const PIXELS: usize = 24;

const MESHES: [&str; 5] = [
    "utah_torso_tet/utah_torso.vtu",
    "fire_room_hex/fire_ug.vtu",
    "combustor_curvilinear/combustor.vts",
    "blunt_fin_curvilinear/blunt_fin.vts",
    "notch_mixed/notch_stress_fixed.vtk",
];

fn meshes() -> Vec<(&'static str, MeshData)> {
    let Some(folder) = std::env::var_os("VOLACT_DATA").map(PathBuf::from) else {
        println!("VOLACT_DATA is not set: no mesh is tested");
        return Vec::new();
    };
    let registry = Registry::with_builtins();
    let load = |name: &'static str| (name, registry.load_mesh(folder.join(name)).unwrap_or_else(|e| panic!("{e}")));
    MESHES.into_iter().map(load).collect()
}

/// Directions spread evenly over the sphere (a Fibonacci lattice), none along an axis.
fn directions() -> impl Iterator<Item = DVec3> {
    (0..DIRECTIONS).map(|i| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / DIRECTIONS as f64;
        let (y, x) = (PI * (3.0 - 5f64.sqrt()) * (i as f64 + 0.37)).sin_cos();
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * x, r * y, z)
    })
}

/// The boundary, turned outward.
struct Boundary {
    triangles: Vec<[DVec3; 3]>,
    tree: Bvh,
}

impl Boundary {
    fn new(mesh: &Tessellation) -> Self {
        let adjacency = Adjacency::new(&mesh.tetrahedra);
        let at = |i: u32| mesh.vertices.at(i as usize);
        let triangles: Vec<_> = adjacency.boundary(&mesh.tetrahedra).map(|t| t.map(at)).collect();
        let around = |t: &[DVec3; 3]| t.iter().fold(Aabb::EMPTY, |b, &p| b.union(&Aabb::new(p, p)));
        let tree = Bvh::new(&triangles.iter().map(around).collect::<Vec<_>>());
        Self { triangles, tree }
    }

    /// The length of a line inside (T. Möller, B. Trumbore, *Fast, minimum storage ray/triangle
    /// intersection*, 1997).
    fn length(&self, origin: DVec3, direction: DVec3) -> f64 {
        let mut sum = 0.0;
        self.tree.line(origin, direction, [f64::NEG_INFINITY, f64::INFINITY], |i| {
            let [a, b, c] = self.triangles[i];
            let (u, v, s) = (b - a, c - a, origin - a);
            let (p, q) = (direction.cross(v), s.cross(u));
            let det = u.dot(p);
            let (x, y) = (s.dot(p) / det, direction.dot(q) / det);
            if det != 0.0 && x >= 0.0 && y >= 0.0 && x + y <= 1.0 {
                // The normal u × v points outward: the line leaves where it goes along.
                sum += v.dot(q) / det * -det.signum();
            }
        });
        sum
    }
}

fn view(bounds: &Aabb, toward: DVec3) -> FrameDesc {
    let size = bounds.size().length();
    let camera =
        Camera::orthographic(bounds.center() + toward * size, bounds.center(), DVec3::new(0.1, 0.2, 0.97), size);
    FrameDesc::new(camera, PIXELS, PIXELS)
}

fn rays(grid: &RayGrid) -> impl Iterator<Item = (DVec3, DVec3)> {
    (0..PIXELS * PIXELS).map(|i| {
        let ray = grid.ray((i % PIXELS) as f64 + 0.5, (i / PIXELS) as f64 + 0.5);
        (ray.origin, ray.direction)
    })
}

#[test]
fn lengths_in_cells_add_up_to_the_length_inside() {
    for (name, data) in meshes() {
        let mesh = data.geometry.tessellate().unwrap();
        let (linked, boundary) = (Linked::new(&mesh, |_, _| {}).unwrap(), Boundary::new(&mesh));
        let bounds = data.geometry.bounds();
        let size = bounds.size().length();
        let (mut worst, mut crossings, mut met) = (0f64, 0usize, 0usize);
        for toward in directions() {
            let desc = view(&bounds, toward);
            for (origin, direction) in rays(&desc.camera.rays(&desc.viewport()).unwrap()) {
                let mut sum = 0.0;
                linked.trace(origin, direction, [f64::NEG_INFINITY, f64::INFINITY], |c| {
                    sum += c.span[1] - c.span[0];
                    crossings += 1;
                    ControlFlow::Continue(())
                });
                met += usize::from(sum > 0.0);
                worst = worst.max((sum - boundary.length(origin, direction)).abs() / size);
            }
        }
        println!("{name}: {met} rays, {crossings} cells met; largest difference {worst:.1e} of the diagonal");
        assert!(met > DIRECTIONS * PIXELS && crossings > 10 * met, "{name}");
        assert!(worst < 1e-11, "{name}: {worst:e} of the diagonal");
    }
}

#[test]
fn drawn_lengths_are_the_lengths_inside() {
    let registry = Registry::with_builtins();
    for (name, data) in meshes() {
        let mesh = data.geometry.tessellate().unwrap();
        let (boundary, bounds) = (Boundary::new(&mesh), data.geometry.bounds());
        let size = bounds.size().length();
        let ones = Buffer::from_vec(vec![1f32; mesh.vertices.len()]);
        let ones = Attribute::new("one", ScalarType::F32, 1, ones).unwrap();
        let table = LookupTable::from_points([ControlPoint { value: 1.0, color: [1.0; 3], opacity: 0.5 }]).unwrap();
        let look = Appearance::new("attribute")
            .with("scalars", ones)
            .with("lookup_table", table)
            .with("unit_distance", size / 4.0);
        let shape = Shape::build(name, data.geometry.clone(), look, Default::default());
        let mut action = registry.action("cpu", &Options::default()).unwrap();
        action.set_option("termination", 0.0.into()).unwrap();
        action.manage(&shape).unwrap();
        let mut differences = Vec::new();
        for toward in directions() {
            let desc = view(&bounds, toward);
            action.begin_draw(&desc).unwrap();
            action.draw(&shape).unwrap();
            let frame = action.end_draw().unwrap();
            let grid = desc.camera.rays(&desc.viewport()).unwrap();
            for ((origin, direction), color) in rays(&grid).zip(&frame.color) {
                let drawn = (1.0 - f64::from(color[3])).log2() * -size / 4.0;
                differences.push((drawn - boundary.length(origin, direction)).abs() / size);
            }
        }
        differences.sort_by(f64::total_cmp);
        let (all, far) = (differences.len(), differences.iter().filter(|d| **d > 1e-5).count());
        println!("{name}: largest {:.1e}, {far} of {all} above 1e-5 of the diagonal", differences[all - 1]);
        // Positions of 32 bits decide otherwise where a ray runs within 1e-7 of the diagonal from a
        // silhouette.
        assert!(far * 50_000 <= all, "{name}: {far} of {all} rays, up to {:e}", differences[all - 1]);
    }
}
