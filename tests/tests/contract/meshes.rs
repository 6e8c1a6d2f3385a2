//! Meshes: as data, as region of interest, and as what breaks other programs.

use volact_conformance::{
    meshes::{bent, corner, cube, field, look, scalars, scalars_of, tetrahedra, tube},
    metrics::{identical, max_error, outside, within},
    rig::{Setup, truth},
    scene::{along_y, ball, colors, constant, greys, lut, one_ray, square},
};
use volact_core::{
    Aabb, ActionError, Appearance, Block, Camera, Clip, ClipRegion, FrameDesc, Geometry, LookupTable, Mesh, Plane,
    ScalarType, Shape, Tessellation, VolumeTexture,
    geometry::GeometryError,
    glam::{DAffine3, DVec3},
};

fn actions() -> [(&'static str, Setup, f64); 2] {
    // Frames are f32; so are positions and colours of `cpu`.
    [("reference", Setup::exact(), 6e-8), ("cpu", Setup::cpu().with("termination", 0.0), 3e-6)]
}

/// What a constant opacity over a length absorbs.
fn absorbed(opacity: f64, length: f64) -> f64 {
    1.0 - (1.0 - opacity).powf(length)
}

#[test]
fn constant_field_in_a_tetrahedron_absorbs_by_its_chord() {
    // Along y the corner x + y + z < 4 is 4 − x − z long.
    let shape = field(corner(4.0), |_| 1.0, greys(&[(1.0, 0.7, 0.3)]), 1.0);
    for (name, setup, tolerance) in actions() {
        for (x, z) in [(0.5, 0.5), (1.0, 2.0), (0.1, 3.7), (2.0, 0.25)] {
            let alpha = absorbed(0.3, 4.0 - x - z);
            let wanted = [0.7 * alpha, 0.7 * alpha, 0.7 * alpha, alpha];
            within(name, max_error(&[setup.pixel(&shape, &along_y(x, z))], &[wanted]), tolerance);
        }
    }
}

/// With opacity a linear along the ray, ∫ −ln(1 − a) da = (1 − a)·ln(1 − a) + a.
#[test]
fn linear_field_in_a_tetrahedron_has_its_closed_form() {
    let shape = field(corner(4.0), |p| p.y, greys(&[(0.0, 1.0, 0.0), (5.0, 1.0, 1.0)]), 0.7);
    let primitive = |a: f64| (1.0 - a) * (1.0 - a).ln() + a;
    for (name, setup, tolerance) in actions() {
        for (x, z) in [(0.5, 0.5), (1.0, 2.0), (2.9, 1.0)] {
            let length: f64 = 4.0 - x - z;
            let alpha = 1.0 - (-primitive(length / 5.0) * 5.0 / 0.7).exp();
            let found = setup.pixel(&shape, &along_y(x, z));
            // The f32 tables of `cpu` follow a logarithm that ends at infinity.
            within(name, max_error(&[found], &[[alpha; 4]]), tolerance.max(if name == "cpu" { 3e-5 } else { 0.0 }));
        }
    }
}

fn realistic() -> LookupTable {
    colors(&[
        (0.0, [0.1, 0.2, 0.9], 0.0),
        (0.35, [0.2, 0.9, 0.4], 0.02),
        (0.5, [0.9, 0.9, 0.1], 0.4),
        (0.62, [0.9, 0.1, 0.1], 0.1),
        (1.0, [1.0, 0.8, 0.6], 0.7),
    ])
}

fn iso(pixels: usize) -> FrameDesc {
    let eye = DVec3::new(1.9, -2.6, 1.7);
    FrameDesc::new(Camera::perspective(eye, DVec3::splat(0.5), DVec3::Z, 34.0), pixels, pixels)
}

#[test]
fn a_cube_looks_the_same_however_it_is_cut() {
    let linear = |p: DVec3| 0.2 + 0.3 * p.x + 0.1 * p.y + 0.35 * p.z;
    for (name, setup, tolerance) in actions() {
        let draw = |parts| setup.colors(&[field(cube(parts), linear, realistic(), 0.2)], &iso(24));
        let six = draw(6);
        assert!(six.iter().any(|c| c[3] > 0.5));
        for parts in [5, 24] {
            // `cpu` integrates a crossing of several optical depths from tables in f32.
            let tolerance = if name == "cpu" { 2e-5 } else { 2.0 * tolerance };
            within(&format!("{name}, {parts} parts"), max_error(&six, &draw(parts)), tolerance);
        }
        let fine = setup.colors(&[field(bent([4, 3, 5], DVec3::ONE, 0.1), linear, realistic(), 0.2)], &iso(24));
        let tolerance = if name == "cpu" { 2e-5 } else { 4.0 * tolerance };
        within(&format!("{name}, bent grid"), max_error(&six, &fine), tolerance);
    }
}

/// Tetrahedra over each other in one mesh: the corner of edge 4 twice, and smaller ones inside and
/// behind it, seen whole, cut by a plane inside, and until rays end.
#[test]
fn cells_over_each_other_count_each() {
    let corner =
        |at: DVec3, size: f64| [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|axis| (at + axis * size) * 0.25);
    let corners =
        [(0.0, 4.0), (0.0, 4.0), (0.3, 1.5), (0.9, 0.8), (1.2, 2.0)].map(|(at, size)| corner(DVec3::splat(at), size));
    let cells: Vec<[u32; 4]> = (0..corners.len() as u32).map(|i| [0, 1, 2, 3].map(|v| 4 * i + v)).collect();
    let linear = |p: DVec3| 0.3 + 0.2 * p.x + 0.3 * p.y + 0.25 * p.z;
    let faint = colors(&[(0.0, [0.2, 0.4, 0.9], 0.02), (1.0, [1.0, 0.5, 0.2], 0.5)]);
    for (table, termination) in [(faint.clone(), 0.0), (faint, 0.3), (realistic(), 0.0), (realistic(), 0.001)] {
        let shape = field(tetrahedra(corners.concat(), &cells), linear, table, 0.2);
        let cut = Plane::new(DVec3::splat(0.21), DVec3::new(0.3, 1.0, 0.2)).unwrap();
        let kept = Clip::new([ClipRegion::plane(cut)]);
        for clip in [Clip::NONE, kept, Clip::new([ClipRegion::plane(cut).cut()])] {
            let desc = iso(24).with_clip(clip);
            let wanted = Setup::exact().colors(std::slice::from_ref(&shape), &desc);
            assert!(wanted.iter().any(|c| c[3] > 0.2));
            let setup = Setup::cpu().with("termination", termination);
            let found = setup.colors(std::slice::from_ref(&shape), &desc);
            within("cpu", max_error(&found, &wanted), 3e-5 + termination);
        }
    }
}

/// Opaque over any interval of positive length where opacity is 1: also where numbers only touch
/// it because they are all the same, alone and beside others.
#[test]
fn a_constant_that_is_opaque_is_opaque() {
    let table = colors(&[(0.0, [0.0, 0.2, 1.0], 0.0), (1.0, [1.0, 0.5, 0.25], 1.0)]);
    let ones = || field(cube(24), |_| 1.0, table.clone(), 0.7);
    let fog = lut(&constant(1.0, [1, 1, 1]), greys(&[(1.0, 0.5, 0.2)]), 1.0);
    for (name, setup, tolerance) in actions() {
        for shapes in [vec![ones()], vec![ones(), ones()], vec![ones(), fog.clone()]] {
            let found = setup.colors(&shapes, &iso(24));
            let covered = found.iter().filter(|c| c[3] > 0.0);
            let wanted = [1.0, 0.5, 0.25, 1.0];
            let off = covered.clone().flat_map(|c| (0..4).map(|i| (c[i] - wanted[i]).abs())).fold(0.0, f64::max);
            assert!(covered.count() > 100);
            within(&format!("{name}, {} shapes", shapes.len()), off, tolerance);
        }
    }
}

#[test]
fn an_infinite_scalar_makes_its_cells_transparent() {
    for value in [f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        let odd = move |p: DVec3| if p == DVec3::ONE { value } else { p.x };
        let unknown = move |p: DVec3| if p == DVec3::ONE { f64::NAN } else { p.x };
        for (name, setup, tolerance) in actions() {
            let draw = |rule: &dyn Fn(DVec3) -> f64| {
                let shape = field(cube(5), rule, realistic(), 0.2);
                setup.colors(&[shape], &iso(16))
            };
            within(&format!("{name}, {value}"), max_error(&draw(&odd), &draw(&unknown)), tolerance);
        }
    }
}

/// Across a tube of N sectors the ray at x crosses the polygon, whose chord is known.
#[test]
fn tube_of_hexahedra_absorbs_by_its_polygons_chord() {
    let around = 12;
    let shape = field(tube(0.25, [around, 3, 2]), |_| 0.0, greys(&[(0.0, 1.0, 0.4)]), 1.0);
    let half = |radius: f64, x: f64| {
        let apothem = radius * (std::f64::consts::PI / around as f64).cos();
        let faces = (0..around).map(|i| {
            let (ny, nx) = (std::f64::consts::TAU * (i as f64 + 0.5) / around as f64).sin_cos();
            if ny > 1e-9 { (apothem - nx * x) / ny } else { f64::INFINITY }
        });
        faces.fold(f64::INFINITY, f64::min).max(0.0)
    };
    for (name, setup, tolerance) in actions() {
        for x in [0.0, 0.11, -0.2, 0.43, 0.8, -0.93] {
            let length = 2.0 * (half(1.0, x) - half(0.25, x));
            let found = setup.pixel(&shape, &along_y(x, 0.4));
            within(name, max_error(&[found], &[[absorbed(0.4, length); 4]]), tolerance);
        }
    }
}

#[test]
fn cpu_draws_fields_as_the_reference_does() {
    let rule = |p: DVec3| 0.5 + 0.5 * (5.0 * p.x + 2.0 * (3.0 * p.y).sin()).sin() * (4.0 * p.z).cos();
    for (mesh, unit) in [(bent([7, 6, 8], DVec3::ONE, 0.15), 0.1), (bent([3, 3, 2], DVec3::ONE, 0.15), 0.02)] {
        let shape = [field(mesh, rule, realistic(), unit)];
        let truth = truth(&shape, &iso(40));
        assert_eq!(truth.not_certified, 0);
        let found = Setup::cpu().colors(&shape, &iso(40));
        // Coarse cells of some optical depth, whose table is integrated in f32.
        within("cpu", outside(&found, &truth), 2e-5);
    }
}

#[test]
fn a_volume_in_a_mesh_of_its_box_is_the_volume_in_a_block() {
    let data = ball([9, 8, 10], ScalarType::U8);
    let table = || colors(&[(10.0, [0.2, 0.4, 1.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.5), (200.0, [1.0; 3], 0.9)]);
    let block = [lut(&data, table(), 1.0)];
    let desc = square(DVec3::splat(4.0), DVec3::new(4.0, -9.0, 5.0), 14.0, 30);
    let exact = truth(&block, &desc);
    let box_size = DVec3::new(8.0, 7.0, 9.0);
    let six = Mesh::new(
        Block::new(DVec3::ZERO, box_size).unwrap().tessellate().unwrap().vertices,
        volact_core::CellTypes::All(volact_core::CellType::Tetrahedron),
        volact_core::Buffer::from_vec(
            Block::new(DVec3::ZERO, box_size).unwrap().tessellate().unwrap().tetrahedra.concat(),
        ),
    );
    let shapes = [
        Shape::new(six.unwrap(), table_look(&data, table())),
        Shape::new(bent([3, 4, 2], box_size, 0.12), table_look(&data, table())),
        Shape::new(bent([5, 1, 3], box_size, 0.0), table_look(&data, table())),
    ];
    for step in [0.5, 0.21] {
        let wanted = Setup::post(step).colors(&block, &desc);
        for shape in &shapes {
            let shape = std::slice::from_ref(shape);
            within("reference", outside(&truth(shape, &desc).color, &exact), 1e-9);
            within("cpu", max_error(&Setup::post(step).colors(shape, &desc), &wanted), 1e-5);
        }
    }
    for shader in ["mip", "minip", "average", "xray"] {
        let look = |s: Shape| {
            s.set_shader(shader);
            s.set_parameter("unit_distance", 10.0);
            s
        };
        let block = [look(lut(&data, table(), 1.0))];
        let mesh = [look(Shape::new(bent([3, 4, 2], box_size, 0.12), table_look(&data, table())))];
        within(
            shader,
            max_error(&Setup::post(0.3).colors(&mesh, &desc), &Setup::post(0.3).colors(&block, &desc)),
            1e-5,
        );
        within(shader, max_error(&truth(&mesh, &desc).color, &truth(&block, &desc).color), 1e-8);
    }
}

fn table_look(data: &volact_core::Volume, table: LookupTable) -> Appearance {
    volact_conformance::scene::look("lut", table, 1.0).with("volume", VolumeTexture::new(data))
}

/// A mesh deformed by an affine map that keeps its texture coordinates is a transformed block.
#[test]
fn texture_coordinates_carry_the_volume_along() {
    let data = ball([9, 8, 10], ScalarType::F32);
    let table = || colors(&[(10.0, [0.2, 0.4, 1.0], 0.0), (90.0, [1.0, 0.6, 0.1], 0.5), (200.0, [1.0; 3], 0.9)]);
    let map = DAffine3::from_translation(DVec3::new(0.4, -0.2, 0.1))
        * DAffine3::from_axis_angle(DVec3::new(0.3, 1.0, 0.2).normalize(), 0.6)
        * DAffine3::from_mat3(volact_core::glam::DMat3::from_cols(
            DVec3::new(-1.0, 0.2, 0.0),
            DVec3::new(0.1, 0.9, 0.3),
            DVec3::new(0.0, 0.0, 1.2),
        ));
    let block = lut(&data, table(), 1.0);
    block.set_transform(map);
    let straight = bent([3, 2, 4], DVec3::ONE, 0.1);
    let size = DVec3::new(8.0, 7.0, 9.0);
    let moved = straight.points().iter().map(|u| map.transform_point3(u * size)).collect();
    let mesh = volact_core::StructuredMesh::new(straight.dims(), moved).unwrap();
    let mesh = mesh.with_texture_coordinates(straight.points().clone()).unwrap();
    let deformed = [Shape::new(mesh, table_look(&data, table()))];
    let desc = square(map.transform_point3(size / 2.0), DVec3::new(4.0, -9.0, 5.0), 15.0, 30);
    let block = [block];
    within("reference", outside(&truth(&deformed, &desc).color, &truth(&block, &desc)), 1e-8);
    for step in [0.5, 0.21] {
        let wanted = Setup::post(step).colors(&block, &desc);
        within("cpu", max_error(&Setup::post(step).colors(&deformed, &desc), &wanted), 2e-5);
        let lattice = Setup::rays(step).colors(&deformed, &desc);
        within("cpu and lattice", max_error(&Setup::post(step).colors(&deformed, &desc), &lattice), 2e-5);
    }
}

/// Texture coordinates that reach outside show nothing there.
#[test]
fn a_deformed_mesh_ends_where_its_texture_does() {
    let data = constant(1.0, [2, 2, 2]);
    let mesh = cube(6);
    let wide = mesh.points().iter().map(|u| u * 2.0 - 0.5).collect();
    let shape = Shape::new(mesh.with_texture_coordinates(wide).unwrap(), table_look(&data, greys(&[(1.0, 1.0, 0.6)])));
    for (name, setup, tolerance) in [("reference", Setup::exact(), 6e-8), ("cpu", Setup::post(0.05), 3e-6)] {
        for (x, length) in [(0.5, 0.5), (0.3, 0.5), (0.2, 0.0)] {
            let found = setup.pixel(&shape, &along_y(x, 0.4));
            within(name, max_error(&[found], &[[absorbed(0.6, length); 4]]), tolerance);
        }
    }
}

#[test]
fn cutting_a_mesh_into_shapes_changes_only_rounding() {
    let mesh = bent([6, 5, 6], DVec3::ONE, 0.15);
    let rule = |p: DVec3| 0.5 + 0.5 * (5.0 * p.x).sin() * (4.0 * p.z + p.y).cos();
    let made = mesh.tessellate().unwrap();
    let whole = [field(mesh, rule, realistic(), 0.1)];
    // Interleaved parts, so that their boxes overlap and rays go back and forth.
    let part = |keep: &dyn Fn(usize) -> bool| {
        let cells: Vec<_> = made.tetrahedra.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, t)| *t).collect();
        field(tetrahedra(made.vertices.iter().collect(), &cells), rule, realistic(), 0.1)
    };
    let parts = [part(&|i| i % 3 == 0), part(&|i| i % 3 == 1), part(&|i| i % 3 == 2)];
    let reference = truth(&whole, &iso(24));
    within("reference", outside(&truth(&parts, &iso(24)).color, &reference), 1e-9);
    let (one, many) = (Setup::cpu().colors(&whole, &iso(24)), Setup::cpu().colors(&parts, &iso(24)));
    within("cpu against reference", outside(&many, &reference), 1e-4);
    within("cpu", max_error(&one, &many), 1e-4);
    let turned: Vec<_> = parts.iter().rev().cloned().collect();
    for setup in [Setup::cpu(), Setup::exact()] {
        assert!(identical(&setup.draw(&parts, &iso(24)), &setup.draw(&turned, &iso(24))), "{setup:?}");
    }
}

#[test]
fn rays_through_vertices_edges_and_faces_meet_every_point_once() {
    // Orthographic rays exactly along grid lines and cell diagonals of a straight grid.
    let shape = field(bent([4, 4, 4], DVec3::ONE, 0.0), |_| 0.0, greys(&[(0.0, 1.0, 0.4)]), 1.0);
    for (name, setup, tolerance) in actions() {
        for x in [0.25, 0.5, 0.75, 0.3] {
            for z in [0.25, 0.5, 0.625] {
                let found = setup.pixel(&shape, &along_y(x, z));
                within(name, max_error(&[found], &[[absorbed(0.4, 1.0); 4]]), tolerance);
            }
        }
        for (from, to, length) in [
            (DVec3::splat(-1.0), DVec3::splat(2.0), 3f64.sqrt()),
            (DVec3::new(-1.0, -1.0, 0.5), DVec3::new(2.0, 2.0, 0.5), 2f64.sqrt()),
            (DVec3::new(2.0, -1.0, 0.25), DVec3::new(-1.0, 2.0, 0.25), 2f64.sqrt()),
        ] {
            let found = setup.pixel(&shape, &one_ray(from, to));
            within(name, max_error(&[found], &[[absorbed(0.4, length); 4]]), tolerance);
        }
    }
}

#[test]
fn the_eye_inside_a_cell_sees_what_is_before_it() {
    let shape = field(bent([3, 4, 3], DVec3::ONE, 0.1), |_| 0.0, greys(&[(0.0, 1.0, 0.4)]), 1.0);
    for (name, setup, tolerance) in actions() {
        for eye in [DVec3::splat(0.5), DVec3::new(0.31, 0.77, 0.4), DVec3::new(0.9, 0.05, 0.5)] {
            let desc = FrameDesc::new(Camera::perspective(eye, DVec3::new(0.2, 3.0, 0.7), DVec3::Z, 100.0), 9, 9);
            let grid = desc.camera.rays(&desc.viewport()).unwrap();
            let found = setup.colors(std::slice::from_ref(&shape), &desc);
            for (i, found) in found.iter().enumerate() {
                let ray = grid.ray((i % 9) as f64 + 0.5, (i / 9) as f64 + 0.5);
                let ends = Aabb::new(DVec3::ZERO, DVec3::ONE).clip_line(ray.origin, ray.direction).unwrap();
                within(name, max_error(&[*found], &[[absorbed(0.4, ends[1]); 4]]), tolerance);
            }
        }
    }
}

#[test]
fn inverted_and_collapsed_cells_draw_as_the_sound_mesh_does() {
    let sound = bent([3, 3, 3], DVec3::ONE, 0.1);
    let made = sound.tessellate().unwrap();
    let rule = |p: DVec3| p.x * 0.6 + 0.4 * p.z;
    let mut cells = made.tetrahedra.clone();
    cells.iter_mut().step_by(2).for_each(|t| t.swap(0, 1));
    cells.extend([[0, 1, 2, 3], [5, 5, 9, 20]]);
    let broken = [field(tetrahedra(made.vertices.iter().collect(), &cells), rule, realistic(), 0.2)];
    let sound = [field(sound, rule, realistic(), 0.2)];
    for (name, setup, _) in actions() {
        within(name, max_error(&setup.colors(&broken, &iso(20)), &setup.colors(&sound, &iso(20))), 1e-6);
    }
}

#[test]
fn cells_smaller_than_a_pixel_count_in_full() {
    // 13,824 cells on a few pixels.
    let rule = |p: DVec3| 0.5 + 0.4 * (3.0 * p.x).sin() * p.z;
    let fine = [field(bent([24, 24, 24], DVec3::ONE, 0.1), rule, realistic(), 0.3)];
    let truth = truth(&fine, &iso(5));
    within("cpu", outside(&Setup::cpu().colors(&fine, &iso(5)), &truth), 2e-5);
}

#[test]
fn a_scalar_that_is_no_number_makes_its_cells_transparent() {
    let mesh = cube(24);
    // The vertex in the middle of the face x = 0 belongs to four tetrahedra.
    let nan = |p: DVec3| if p == DVec3::new(0.0, 0.5, 0.5) { f64::NAN } else { 1.0 };
    let shape = field(mesh, nan, greys(&[(1.0, 1.0, 0.5)]), 1.0);
    for (name, setup, tolerance) in actions() {
        // At height z = 0.5 the four fill x < y and x < 1 − y.
        let found = setup.pixel(&shape, &along_y(0.3, 0.5));
        within(name, max_error(&[found], &[[absorbed(0.5, 0.6); 4]]), tolerance);
    }
}

#[test]
fn opacity_may_come_from_other_scalars_than_colour() {
    let mesh = bent([2, 2, 2], DVec3::ONE, 0.1);
    let (height, side) = (scalars(mesh.points(), |p| p.z), scalars(mesh.points(), |_| 0.25));
    let table = colors(&[(0.0, [1.0, 0.0, 0.0], 0.9), (1.0, [0.0, 1.0, 0.0], 0.9)]);
    let opacity = greys(&[(0.0, 0.0, 0.0), (1.0, 0.0, 1.0)]);
    let look = look(height, table, 1.0).with("opacity_scalars", side).with("opacity_table", opacity);
    let shape = Shape::new(mesh, look);
    for (name, setup, tolerance) in actions() {
        let alpha = absorbed(0.25, 1.0);
        let found = setup.pixel(&shape, &along_y(0.4, 0.3));
        within(name, max_error(&[found], &[[0.7 * alpha, 0.3 * alpha, 0.0, alpha]]), tolerance.max(2e-9));
    }
}

/// A geometry of somebody's own: bounds and a tessellation.
#[derive(Debug)]
struct Own(Tessellation);

impl Geometry for Own {
    fn name(&self) -> &str {
        "own"
    }

    fn bounds(&self) -> Aabb {
        self.0.vertices.bounds()
    }

    fn tessellate(&self) -> Result<Tessellation, GeometryError> {
        Ok(self.0.clone())
    }

    fn as_any(&self) -> &dyn std::any::Any {
        self
    }
}

#[test]
fn a_geometry_of_ones_own_needs_bounds_and_tessellate_only() {
    let made = cube(5).tessellate().unwrap();
    let numbers = scalars(&made.vertices, |p| p.x);
    let own = [Shape::new(Own(made.clone()), look(numbers, realistic(), 0.2))];
    let mesh = [field(cube(5), |p| p.x, realistic(), 0.2)];
    for (name, setup, _) in actions() {
        within(name, max_error(&setup.colors(&own, &iso(12)), &setup.colors(&mesh, &iso(12))), 1e-12);
    }
}

#[test]
fn damaged_geometries_and_attributes_are_refused_by_name() {
    let mut bad = cube(5).tessellate().unwrap();
    let numbers = scalars(&bad.vertices, |p| p.x);
    let few = scalars_of(&corner(1.0), |p| p.x);
    for (name, setup, _) in actions() {
        let refused = |shape: Shape| {
            let mut action = setup.action();
            let managed = action.manage(&shape).and_then(|()| action.begin_draw(&iso(4)));
            let error = managed.and_then(|()| action.draw(&shape)).and_then(|()| action.end_draw().map(|_| ()));
            let error: ActionError = error.expect_err(name);
            let mut text = error.to_string();
            let mut source = std::error::Error::source(&error);
            while let Some(cause) = source {
                text.push_str(&format!(": {cause}"));
                source = cause.source();
            }
            // The action is usable again.
            let sound = field(cube(5), |p| p.x, realistic(), 0.2);
            let mut other = setup.action();
            assert!(volact_conformance::rig::draw(&mut *other, &[sound], &iso(4)).is_ok());
            text
        };
        let short = refused(Shape::new(cube(5), look(few.clone(), realistic(), 0.2)));
        assert!(short.contains("scalars") && short.contains('4') && short.contains('8'), "{name}: {short}");
        let short = refused(Shape::new(Own(cube(5).tessellate().unwrap()), look(few.clone(), realistic(), 0.2)));
        assert!(short.contains('4') && short.contains('8'), "{name}: {short}");
        bad.tetrahedra[2][1] = 99;
        let index = refused(Shape::new(Own(bad.clone()), look(numbers.clone(), realistic(), 0.2)));
        assert!(index.contains("tetrahedron 2") && index.contains("99"), "{name}: {index}");
        bad.tetrahedra[2] = [0, 1, 4, 2];
        let inside_out = refused(Shape::new(Own(bad.clone()), look(numbers.clone(), realistic(), 0.2)));
        assert!(inside_out.contains("tetrahedron 2"), "{name}: {inside_out}");
        bad = cube(5).tessellate().unwrap();
    }
}

#[test]
fn the_same_bits_for_any_number_of_threads() {
    let rule = |p: DVec3| 0.5 + 0.5 * (5.0 * p.x).sin() * (4.0 * p.z + p.y).cos();
    let shape = [field(bent([6, 5, 6], DVec3::ONE, 0.15), rule, realistic(), 0.1)];
    let draw = |threads: i64| Setup::new("cpu").with("threads", threads).draw(&shape, &iso(64));
    let one = draw(1);
    assert!([2, 3, 8].into_iter().all(|n| identical(&one, &draw(n))));
}

#[test]
fn only_what_changed_is_built_anew() {
    let mesh = bent([6, 5, 6], DVec3::ONE, 0.15);
    let shape = field(mesh, |p| p.x, realistic(), 0.1);
    let mut action = Setup::cpu().action();
    action.manage(&shape).unwrap();
    let mut frame = |desc: &FrameDesc| {
        action.begin_draw(desc).unwrap();
        action.draw(&shape).unwrap();
        action.end_draw().unwrap().statistics
    };
    assert!(!frame(&iso(16)).rebuilt.is_empty());
    let mut turned = iso(16);
    turned.camera = Camera::perspective(DVec3::new(3.0, 2.0, 1.0), DVec3::splat(0.5), DVec3::Z, 34.0);
    let second = frame(&turned);
    assert!(second.rebuilt.is_empty(), "a camera rebuilt {:?}", second.rebuilt);
    shape.set_parameter("lookup_table", greys(&[(0.0, 0.0, 0.0), (1.0, 1.0, 0.5)]));
    let third = frame(&turned);
    assert!(third.rebuilt.iter().all(|r| r.what.contains("classification")), "a table rebuilt {:?}", third.rebuilt);
    let tetrahedra = 6 * 6 * 5 * 6;
    assert!(third.resident_bytes < 120 * tetrahedra + 600_000, "{}", third.resident_bytes);
}
