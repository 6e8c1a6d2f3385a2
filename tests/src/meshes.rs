//! Meshes by rule: boxes cut in several ways, bent grids, cylinders, and fields on them.

use std::f64::consts::TAU;

use volact_core::{
    Appearance, Attribute, Block, Buffer, CellType, CellTypes, Geometry, LookupTable, Mesh, Points, ScalarType, Shape,
    StructuredMesh, glam::DVec3,
};

/// A mesh of tetrahedra.
///
/// # Panics
/// If an index is out of range.
pub fn tetrahedra(points: Vec<DVec3>, cells: &[[u32; 4]]) -> Mesh {
    Mesh::new(points.into(), CellTypes::All(CellType::Tetrahedron), Buffer::from_vec(cells.concat())).expect("a mesh")
}

/// One tetrahedron: the corner of a cube of edge `size` at the origin.
pub fn corner(size: f64) -> Mesh {
    tetrahedra(vec![DVec3::ZERO, DVec3::X * size, DVec3::Y * size, DVec3::Z * size], &[[0, 1, 2, 3]])
}

/// The unit cube as 5, 6 or 24 tetrahedra.
///
/// # Panics
/// For any other number.
pub fn cube(parts: usize) -> Mesh {
    let block = Block::new(DVec3::ZERO, DVec3::ONE).expect("a block");
    let mut points = block.bounds().corners().to_vec();
    match parts {
        5 => tetrahedra(points, &[[0, 1, 2, 4], [3, 1, 2, 7], [5, 1, 4, 7], [6, 2, 4, 7], [1, 2, 4, 7]]),
        6 => tetrahedra(points, &block.tessellate().expect("a block").tetrahedra),
        24 => {
            // A vertex in the middle of each face and of the cube.
            let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
            points.push(DVec3::splat(0.5));
            let mut cells = Vec::new();
            for face in faces {
                let middle = points.len() as u32;
                points.push(face.iter().map(|&i: &usize| points[i]).sum::<DVec3>() / 4.0);
                cells.extend((0..4).map(|i| [8, middle, face[i] as u32, face[(i + 1) % 4] as u32]));
            }
            tetrahedra(points, &cells)
        }
        other => panic!("a cube in {other} parts"),
    }
}

/// The box from 0 to `size` as a grid of `n` cells an axis, bent inside by `strength` (0 for
/// straight; up to 0.15 leaves every cell the right way round).
///
/// # Panics
/// If there is no cell.
pub fn bent(n: [usize; 3], size: DVec3, strength: f64) -> StructuredMesh {
    let mut points = Vec::new();
    for z in 0..=n[2] {
        for y in 0..=n[1] {
            for x in 0..=n[0] {
                let cells = DVec3::from_array(n.map(|n| n as f64));
                let u = DVec3::new(x as f64, y as f64, z as f64) / cells;
                let inside = (u * (1.0 - u) * 4.0).to_array().into_iter().product::<f64>();
                let wave = DVec3::new((7.0 * u.y).sin(), (9.0 * u.z).cos(), (8.0 * u.x).sin());
                points.push(size * (u + strength * inside * wave / cells));
            }
        }
    }
    StructuredMesh::new(n.map(|n| n + 1), points.into()).expect("a grid")
}

/// A ring of hexahedra around the z axis, from radius `inner` to 1 and from z = 0 to 1, in
/// `around` sectors, `rings` rings and `layers` layers.
///
/// # Panics
/// If there is no cell.
pub fn tube(inner: f64, [around, rings, layers]: [usize; 3]) -> Mesh {
    let mut points = Vec::new();
    for k in 0..=layers {
        for j in 0..=rings {
            let r = inner + (1.0 - inner) * j as f64 / rings as f64;
            points.extend((0..around).map(|i| {
                let (y, x) = (TAU * i as f64 / around as f64).sin_cos();
                DVec3::new(r * x, r * y, k as f64 / layers as f64)
            }));
        }
    }
    let at = |i: usize, j: usize, k: usize| ((k * (rings + 1) + j) * around + i % around) as u32;
    let mut cells: Vec<u32> = Vec::new();
    for k in 0..layers {
        for j in 0..rings {
            for i in 0..around {
                let face = |k| [at(i, j, k), at(i, j + 1, k), at(i + 1, j + 1, k), at(i + 1, j, k)];
                cells.extend([face(k), face(k + 1)].concat());
            }
        }
    }
    Mesh::new(points.into(), CellTypes::All(CellType::Hexahedron), Buffer::from_vec(cells)).expect("a tube")
}

/// Scalars at points by rule, as `f64`.
///
/// # Panics
/// If there is no point.
pub fn scalars(points: &Points, rule: impl Fn(DVec3) -> f64) -> Attribute {
    let values: Vec<f64> = points.iter().map(rule).collect();
    Attribute::new("scalars", ScalarType::F64, 1, Buffer::from_vec(values)).expect("numbers")
}

/// The scalars of a rule at the vertices of what a geometry tessellates into.
///
/// # Panics
/// If it does not.
pub fn scalars_of(geometry: &dyn Geometry, rule: impl Fn(DVec3) -> f64) -> Attribute {
    scalars(&geometry.tessellate().expect("a geometry").vertices, rule)
}

/// A mesh whose own scalars, by rule, go through a table.
///
/// # Panics
/// If the geometry does not tessellate.
pub fn field(geometry: impl Geometry, rule: impl Fn(DVec3) -> f64, table: LookupTable, unit: f64) -> Shape {
    let scalars = scalars_of(&geometry, rule);
    Shape::new(geometry, look(scalars, table, unit))
}

/// The shader `attribute`.
pub fn look(scalars: Attribute, table: LookupTable, unit: f64) -> Appearance {
    crate::scene::look("attribute", table, unit).with("scalars", scalars)
}
