//! Slices of a block and of a mesh, all of a frame.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use volact_core::{
    Appearance, Attribute, Buffer, FrameDesc, Geometry, LookupTable, Mesh, Registry, ScalarType, Shape, View, Volume,
    VolumeDesc,
    geometry::{CellType, CellTypes},
    glam::DVec3,
    resolve::ResolvedShape,
    slicing::{Order, Polygons, Rate, Sampling, Slicing, Solid},
};

fn block() -> Shape {
    let volume = Volume::new(VolumeDesc::new([256; 3], ScalarType::U8, 1), vec![0u8; 1 << 24]).expect("a volume");
    Shape::around(&volume, Appearance::new("simple"))
}

/// `n`³ hexahedra: six tetrahedra each.
fn mesh(n: u32) -> Shape {
    let m = n + 1;
    let points: Vec<DVec3> =
        (0..m * m * m).map(|i| DVec3::new((i % m).into(), (i / m % m).into(), (i / m / m).into())).collect();
    let mut cells = Vec::new();
    for i in (0..m * m * m).filter(|i| [1, m, m * m].iter().all(|s| i / s % m < n)) {
        cells.extend([0, 1, m + 1, m].map(|c| i + c));
        cells.extend([0, 1, m + 1, m].map(|c| i + c + m * m));
    }
    let types = CellTypes::All(CellType::Hexahedron);
    let mesh = Mesh::new(points.into(), types, Buffer::from_vec(cells)).expect("a mesh");
    let numbers = vec![0.5f32; mesh.vertex_count().unwrap_or(0)];
    let scalars = Attribute::new("t", ScalarType::F32, 1, Buffer::from_vec(numbers)).expect("numbers");
    let table = LookupTable::window_level(1.0, 0.5, 0.5).expect("a table");
    Shape::new(mesh, Appearance::new("attribute").with("scalars", scalars).with("lookup_table", table))
}

fn solid(shape: &Shape) -> Solid {
    let resolved = ResolvedShape::new(shape, Registry::with_core().shaders()).expect("a shape that can be drawn");
    Solid::new(&resolved, None).expect("a geometry that is whole").expect("a shape that holds volume")
}

fn benches(criterion: &mut Criterion) {
    for (name, shape, planes) in
        [("block of 512 planes", block(), 512), ("162,000 tetrahedra, 256 planes", mesh(30), 256)]
    {
        let (solid, frame) = (solid(&shape), FrameDesc::fit(&shape, View::Iso, 512, 512));
        let sampling = Sampling { rate: Rate::Period([0.1; 3]), most_planes: Some(planes), ..Sampling::default() };
        criterion.bench_function(name, |bencher| {
            let sweep = || {
                let slicing = Slicing::new(vec![&solid], &frame, &sampling).expect("a plan");
                let (mut sweep, mut hull, mut polygons) =
                    (slicing.sweep(Order::BackToFront), Vec::new(), Polygons::new());
                let mut corners = 0;
                while let Some(mut slice) = sweep.next_slice() {
                    if slice.is_block() {
                        slice.hull(&mut hull);
                        corners += hull.len();
                    } else {
                        slice.polygons(&mut polygons);
                        corners += polygons.vertex_count();
                    }
                }
                corners
            };
            bencher.iter_batched(|| (), |()| sweep(), BatchSize::LargeInput);
        });
    }
}

criterion_group!(slicing, benches);
criterion_main!(slicing);
