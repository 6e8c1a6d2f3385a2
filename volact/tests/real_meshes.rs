//! Real meshes, which break other programs, drawn by `cpu` and by `reference`: the combustor has
//! cycles of visibility, the fire's room is not convex, the blunt fin has collapsed cells over
//! eight decades of volume, the torso slivers and a boundary that is no manifold, the notch cells
//! of mixed types.
//!
//! The meshes are those in the folder that `VOLACT_DATA` names; without it nothing is tested, and
//! the test says so.

use std::path::PathBuf;

use volact::{
    Options, Registry, RegistryExt,
    core::{
        Appearance, Attribute, Camera, ControlPoint, Frame, FrameDesc, LookupTable, MeshData, Shape,
        glam::{DAffine3, DVec3},
    },
};

const MESHES: [&str; 5] = [
    "utah_torso_tet/utah_torso.vtu",
    "fire_room_hex/fire_ug.vtu",
    "combustor_curvilinear/combustor.vts",
    "blunt_fin_curvilinear/blunt_fin.vts",
    "notch_mixed/notch_stress_fixed.vtk",
];
const PIXELS: usize = 32;

fn meshes(registry: &Registry) -> Vec<(&'static str, MeshData)> {
    let Some(folder) = std::env::var_os("VOLACT_DATA").map(PathBuf::from) else {
        println!("VOLACT_DATA is not set: no mesh is tested");
        return Vec::new();
    };
    let load = |name: &'static str| (name, registry.load_mesh(folder.join(name)).unwrap_or_else(|e| panic!("{e}")));
    MESHES.into_iter().map(load).collect()
}

/// A faint ramp, and a table with a spike, a step and an opaque end; over parts of a range.
fn tables([low, high]: [f64; 2]) -> [LookupTable; 2] {
    let point =
        |part: f64, color: [f64; 3], opacity: f64| ControlPoint { value: low + part * (high - low), color, opacity };
    let (blue, green, red) = ([0.1, 0.2, 1.0], [0.2, 1.0, 0.3], [1.0, 0.3, 0.1]);
    let faint = [point(0.0, blue, 0.0), point(0.4, green, 0.3), point(1.0, red, 0.8)];
    let hard = [
        point(0.2, blue, 0.0),
        point(0.3, green, 0.95),
        point(0.31, red, 0.02),
        point(0.5, blue, 0.02),
        point(0.5, green, 0.6),
        point(0.7, red, 0.9),
        point(0.9, red, 1.0),
    ];
    [LookupTable::from_points(faint), LookupTable::from_points(hard)].map(Result::unwrap)
}

/// The range of nine tenths of the numbers.
fn common(scalars: &Attribute) -> [f64; 2] {
    let mut all: Vec<f64> = (0..scalars.len()).map(|v| scalars.value(v, 0)).filter(|v| !v.is_nan()).collect();
    all.sort_by(f64::total_cmp);
    [all[all.len() / 20], all[all.len() - 1 - all.len() / 20]]
}

/// From outside, from within at a wide angle, along an axis (along faces of cells), and askew from
/// far away.
fn cameras(data: &MeshData) -> Vec<FrameDesc> {
    let bounds = data.geometry.bounds();
    let (center, size) = (bounds.center(), bounds.size().length());
    let aside = DVec3::new(0.6, -0.7, 0.5);
    let cameras = [
        Camera::perspective(center + aside * size, center, DVec3::Z, 40.0),
        Camera::perspective(center + bounds.size() * 0.137, center - aside * size, DVec3::Z, 100.0),
        Camera::orthographic(center + DVec3::X * size, center, DVec3::Z, 0.7 * size),
        Camera::perspective(center + DVec3::new(-0.3, 0.2, 0.9) * size * 20.0, center, DVec3::Y, 3.0),
    ];
    cameras.map(|camera| FrameDesc::new(camera, PIXELS, PIXELS)).into()
}

fn draw(registry: &Registry, action: &str, shape: &Shape, desc: &FrameDesc) -> Frame {
    let mut action = registry.action(action, &Options::default()).unwrap();
    action.manage(shape).unwrap();
    action.begin_draw(desc).unwrap();
    action.draw(shape).unwrap();
    action.end_draw().unwrap()
}

#[test]
fn real_meshes_look_as_in_the_reference() {
    let registry = Registry::with_builtins();
    for (name, data) in meshes(&registry) {
        let scalars = data.attributes.iter().find(|a| a.components == 1).unwrap_or(&data.attributes[0]);
        let range = common(scalars);
        let unit = data.geometry.bounds().size().length() / 10.0;
        for (table, look) in tables(range).into_iter().enumerate() {
            let appearance = Appearance::new("attribute")
                .with("scalars", scalars.clone())
                .with("lookup_table", look)
                .with("unit_distance", unit);
            let shape = Shape::build(name, data.geometry.clone(), appearance, DAffine3::IDENTITY);
            let (mut worst, mut deepest, mut seen) = (0f32, 0f32, 0);
            for desc in cameras(&data) {
                let [cpu, truth] = ["cpu", "reference"].map(|action| draw(&registry, action, &shape, &desc));
                let size = data.geometry.bounds().size().length() as f32;
                for (i, (a, b)) in cpu.color.iter().zip(&truth.color).enumerate() {
                    let off = (0..4).map(|c| (a[c] - b[c]).abs()).fold(0f32, f32::max);
                    worst = worst.max(off);
                    seen += usize::from(b[3] > 0.01);
                    // Where opacity stays near the threshold, a depth says little.
                    let [z, w] = [cpu.depth[i], truth.depth[i]];
                    if z.is_finite() && w.is_finite() {
                        deepest = deepest.max((z - w).abs() / (size + w));
                    }
                }
                let reached = |f: &Frame| f.depth.iter().filter(|d| d.is_finite()).count() as i64;
                assert!((reached(&cpu) - reached(&truth)).abs() <= 2, "{name}: {} {}", reached(&cpu), reached(&truth));
            }
            println!("{name}, table {table}: colours to {worst:.1e}, depths to {deepest:.1e}, {seen} pixels");
            assert!(seen > PIXELS * PIXELS / 2, "{name}: {seen} pixels");
            assert!(worst < 5e-5, "{name}, table {table}: colours differ by {worst:e}");
            assert!(deepest < 1e-4, "{name}, table {table}: depths differ by {deepest:e}");
        }
    }
}
