//! Shapes, frames and sums.

use volact_core::{
    Aabb, Appearance, Attribute, Block, Buffer, Camera, FrameDesc, Geometry, Mesh, Points, Registry, ScalarType, Shape,
    Volume, VolumeDesc,
    geometry::{CellType, CellTypes},
    glam::{DAffine3, DVec2, DVec3},
    resolve::ResolvedShape,
    slicing::{Order, Polygons, Sampling, Slicing, SlicingError, Solid},
};

/// A volume of so many voxels along each axis, spacing 1.
pub fn cube(n: usize) -> Shape {
    let volume = Volume::new(VolumeDesc::new([n; 3], ScalarType::U8, 1), vec![0u8; n * n * n]).unwrap();
    Shape::around(&volume, Appearance::new("simple"))
}

/// A geometry of its own with the attribute `scalars`: the vertices' x + 2y + 3z.
pub fn carrying(geometry: impl Geometry) -> Shape {
    let made = geometry.tessellate().unwrap();
    let numbers: Vec<f64> = made.vertices.iter().map(|p| p.dot(DVec3::new(1.0, 2.0, 3.0))).collect();
    let scalars = Attribute::new("t", ScalarType::F64, 1, Buffer::from_vec(numbers)).unwrap();
    let table = volact_core::LookupTable::window_level(1.0, 0.5, 0.5).unwrap();
    Shape::new(geometry, Appearance::new("attribute").with("scalars", scalars).with("lookup_table", table))
}

/// Tetrahedra.
pub fn mesh(points: &[DVec3], tetrahedra: &[[u32; 4]]) -> Mesh {
    let connectivity = Buffer::from_vec(tetrahedra.iter().flatten().copied().collect::<Vec<u32>>());
    Mesh::new(Points::from(points.to_vec()), CellTypes::All(CellType::Tetrahedron), connectivity).unwrap()
}

/// A block of `n`³ cells of six tetrahedra each; inner vertices moved by `shift`.
pub fn split_block(n: usize, shift: impl Fn(usize) -> DVec3) -> Mesh {
    let m = n + 1;
    let inner = |i: usize| [1, m, m * m].iter().all(|s| (1..n).contains(&(i / s % m)));
    let place = |i: usize| {
        let p = DVec3::new((i % m) as f64, (i / m % m) as f64, (i / m / m) as f64) / n as f64;
        if inner(i) { p + shift(i) } else { p }
    };
    let points: Vec<DVec3> = (0..m * m * m).map(place).collect();
    let mut cells = Vec::new();
    for i in (0..m * m * m).filter(|i| [1, m, m * m].iter().all(|s| i / s % m < n)) {
        let corner = |c: usize| (i + (c & 1) + (c >> 1 & 1) * m + (c >> 2) * m * m) as u32;
        let paths = [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]];
        cells.extend(paths.map(|[a, b]| [0, a, b, 7].map(corner)));
    }
    mesh(&points, &cells)
}

/// The unit block.
pub fn unit_block() -> Block {
    Block::from(Aabb::new(DVec3::ZERO, DVec3::ONE))
}

/// Shapes made ready.
pub fn solids(shapes: &[Shape]) -> Vec<Solid> {
    let registry = Registry::with_core();
    let solid = |s: &Shape| Solid::new(&ResolvedShape::new(s, registry.shaders()).unwrap(), None).unwrap().unwrap();
    shapes.iter().map(solid).collect()
}

/// What comes of each slice: its shape, its number, and its polygons.
pub fn each(
    shapes: &[Shape],
    frame: &FrameDesc,
    sampling: &Sampling,
    order: Order,
    mut visit: impl FnMut(usize, i64, &Polygons),
) -> Result<(), SlicingError> {
    let solids = solids(shapes);
    let slicing = Slicing::new(solids.iter().collect(), frame, sampling)?;
    let (mut sweep, mut polygons) = (slicing.sweep(order), Polygons::new());
    while let Some(slice) = sweep.next_slice() {
        slice.polygons(&mut polygons);
        visit(slice.shape, slice.number, &polygons);
    }
    Ok(())
}

/// A parallel view along a direction, wide enough for the tests' shapes.
pub fn along(direction: DVec3) -> FrameDesc {
    let up = if direction.normalize().z.abs() < 0.9 { DVec3::Z } else { DVec3::X };
    FrameDesc::new(Camera::orthographic(-500.0 * direction.normalize(), DVec3::ZERO, up, 40.0), 64, 64)
}

/// A view from an eye to a target.
pub fn from_eye(eye: DVec3, target: DVec3) -> FrameDesc {
    FrameDesc::new(Camera::perspective(eye, target, DVec3::new(0.1, 0.2, 1.0), 60.0), 64, 64)
}

/// Whether a point lies in a convex polygon: above its edges as a rasteriser sees them, the same for
/// both polygons at an edge.
pub fn covers(corners: &[DVec2], point: DVec2) -> bool {
    let mut inside = false;
    for (i, &a) in corners.iter().enumerate() {
        let b = corners[(i + 1) % corners.len()];
        // One order of an edge's ends for both sides of it.
        let [low, high] = if (a.y, a.x) <= (b.y, b.x) { [a, b] } else { [b, a] };
        if (low.y <= point.y) != (high.y <= point.y) && (high - low).perp_dot(point - low) > 0.0 {
            inside = !inside;
        }
    }
    inside
}

/// A transform that turns, stretches and mirrors.
pub fn bent() -> DAffine3 {
    DAffine3::from_translation(DVec3::new(0.3, -0.2, 0.4))
        * DAffine3::from_rotation_y(0.7)
        * DAffine3::from_scale(DVec3::new(1.5, -0.8, 1.1))
        * DAffine3::from_rotation_x(0.4)
}
