//! Surfaces: opaque, lit triangles among volumes.

use proptest::prelude::*;
use volact_core::{
    ActionError, Appearance, Buffer, Clip, FrameDesc, Plane, Shape, Surface, View,
    geometry::ClipRegion,
    glam::{DAffine3, DMat3, DVec3},
};
use volact_cpu::reference::{Method, ReferenceOptions, check, integrate};

use super::common::{along_z, certify, enclose, lut, one_ray, picture, point, resolve, table, volume_of};

const GREEN: [f64; 3] = [0.25, 1.0, 0.5];

fn surface(points: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Surface {
    Surface::new(points.into(), Buffer::from_vec(triangles)).unwrap()
}

/// A square of side 8 in the plane z, in two triangles.
fn square(z: f64) -> Surface {
    let at = |x, y| DVec3::new(x, y, z);
    surface(vec![at(-4.0, -4.0), at(4.0, -4.0), at(4.0, 4.0), at(-4.0, 4.0)], vec![[0, 1, 2], [0, 2, 3]])
}

fn painted(surface: Surface, color: [f64; 3]) -> Shape {
    let [r, g, b] = color;
    Shape::new(surface, Appearance::new("surface").with("color", volact_core::ParameterValue::Color([r, g, b, 1.0])))
}

/// A red slab of 4³ that lets 0.7 through a unit of length.
fn slab() -> Shape {
    lut(&volume_of([5; 3], |_| 0.0), table(&[point(0.0, [1.0, 0.0, 0.0], 0.3)]), 1.0)
}

fn shade(light: f64) -> [f64; 4] {
    let s = 0.2 + 0.8 * light;
    [s * GREEN[0], s * GREEN[1], s * GREEN[2], 1.0]
}

#[test]
fn light_falls_from_the_eye_by_default_and_on_both_sides() {
    let shape = painted(square(1.0), GREEN);
    certify(std::slice::from_ref(&shape), &along_z(0.3, 0.4), shade(1.0));
    let back = one_ray(DVec3::new(0.3, 0.4, 7.0), DVec3::new(0.3, 0.4, 0.0));
    certify(std::slice::from_ref(&shape), &back, shade(1.0));
    // At 60 degrees to the normal.
    let from = DVec3::new(3f64.sqrt() * 2.0, 0.1, 3.0);
    certify(&[shape], &one_ray(from, DVec3::new(0.0, 0.1, 1.0)), shade(0.5));
}

#[test]
fn light_has_a_direction_in_the_world() {
    let shape = painted(square(1.0), GREEN);
    shape.set_parameter("lightdir", DVec3::new(0.0, 3.0, -4.0));
    certify(std::slice::from_ref(&shape), &along_z(0.3, 0.4), shade(0.8));
    shape.set_parameter("ambient", 0.5);
    let s = 0.5 + 0.5 * 0.8;
    certify(std::slice::from_ref(&shape), &along_z(0.3, 0.4), [s * GREEN[0], s * GREEN[1], s * GREEN[2], 1.0]);
    // Turned to stand upright, the square is edge-on to a light from above and lit from its side.
    shape.set_parameter("ambient", 0.2);
    shape.set_transform(DAffine3::from_rotation_x(1.0));
    let (sine, cosine) = 1f64.sin_cos();
    let ray = one_ray(DVec3::new(0.3, 0.4, -9.0), DVec3::new(0.3, 0.4, 0.0));
    // The normal (0, 0, 1) turns to (0, −sin 1, cos 1).
    enclose(&picture(&[shape], &ray), shade((-sine * 0.6 - cosine * 0.8).abs()), 1e-12, 1e-15);
}

#[test]
fn normals_go_by_the_inverse_transpose() {
    // A shear that keeps the square in its plane keeps its normal, too; a mirror turns nothing.
    let shape = painted(square(1.0), GREEN);
    shape.set_transform(DAffine3::from_mat3(DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.5, -2.0, 0.0, 0.0, 0.0, 1.0])));
    certify(std::slice::from_ref(&shape), &along_z(0.3, 0.4), shade(1.0));
    // Sheared along the ray, the plane z = 1 becomes z = 1 + y: its normal is (0, −1, 1)/√2.
    shape.set_transform(DAffine3::from_mat3(DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0])));
    certify(&[shape], &along_z(0.3, 0.4), shade(0.5f64.sqrt()));
}

#[test]
fn normals_of_vertices_are_interpolated() {
    let tilted = [DVec3::Z, DVec3::new(0.0, 1.0, 1.0), DVec3::new(0.0, 1.0, 1.0), DVec3::Z];
    let made = square(1.0).with_normals(tilted.to_vec().into()).unwrap();
    // At (0, 0), in the middle of the edge between the first and the third: (0, ½, 1).
    certify(&[painted(made, GREEN)], &along_z(0.0, 0.0), shade(1.0 / 1.25f64.sqrt()));
    // Without length they are of no use: the triangle's own counts.
    let none = square(1.0).with_normals(vec![DVec3::ZERO; 4].into()).unwrap();
    certify(&[painted(none, GREEN)], &along_z(0.3, 0.4), shade(1.0));
}

#[test]
fn volume_lies_before_behind_and_around() {
    // The slab is from 0 to 4.
    for (z, before) in [(-1.0, 0.0), (0.0, 0.0), (1.5, 1.5), (4.0, 4.0), (5.0, 4.0)] {
        let left = 0.7f64.powf(before);
        let truth = [1.0 - left + left * GREEN[0], left * GREEN[1], left * GREEN[2], 1.0];
        certify(&[slab(), painted(square(z), GREEN)], &along_z(0.3, 0.4), truth);
    }
}

#[test]
fn the_nearest_of_several_is_seen() {
    let both = [painted(square(2.0), [0.0, 0.0, 1.0]), painted(square(1.0), GREEN)];
    certify(&both, &along_z(0.3, 0.4), shade(1.0));
    // Two at one place mix.
    let both = [painted(square(1.0), [0.0, 0.0, 1.0]), painted(square(1.0), GREEN)];
    certify(&both, &along_z(0.3, 0.4), [0.125, 0.5, 0.75, 1.0]);
    let swapped = [both[1].clone(), both[0].clone()];
    assert_eq!(picture(&swapped, &along_z(0.3, 0.4)), picture(&both, &along_z(0.3, 0.4)));
}

#[test]
fn clips_open_surfaces() {
    let shape = painted(square(1.0), GREEN);
    let clip = |x: f64| Clip::NONE.with(ClipRegion::plane(Plane::new(DVec3::X * x, DVec3::X).unwrap()));
    shape.set_clip(clip(0.2));
    certify(std::slice::from_ref(&shape), &along_z(0.3, 0.4), shade(1.0));
    certify(std::slice::from_ref(&shape), &along_z(0.1, 0.4), [0.0; 4]);
    certify(std::slice::from_ref(&shape), &along_z(0.3, 0.4).with_clip(clip(0.4)), [0.0; 4]);
    // In the clip's plane itself it is kept, and what lies in its hole is seen.
    shape.set_clip(Clip::NONE.with(ClipRegion::plane(Plane::new(DVec3::Z, DVec3::Z).unwrap())));
    certify(std::slice::from_ref(&shape), &along_z(0.3, 0.4), shade(1.0));
    shape.set_clip(clip(0.2));
    let a = 1.0 - 0.7f64.powi(4);
    certify(&[slab(), shape], &along_z(0.1, 0.4), [a, 0.0, 0.0, a]);
}

#[test]
fn surfaces_end_pictures_of_one_value() {
    let data = volume_of([2, 2, 5], |[_, _, z]| z as f64);
    let grey = table(&[point(0.0, [0.0; 3], 0.5), point(4.0, [1.0; 3], 0.5)]);
    let mip = Shape::around(&data, Appearance::new("mip").with("lookup_table", grey));
    let made = [mip, painted(square(3.0), GREEN)];
    let level = 0.5 * 0.75;
    let truth = [level + 0.5 * GREEN[0], level + 0.5 * GREEN[1], level + 0.5 * GREEN[2], 1.0];
    certify(&made, &along_z(0.3, 0.4), truth);
}

#[test]
fn depth_is_that_of_the_surface() {
    let made = picture(&[slab(), painted(square(0.25), GREEN)], &along_z(0.3, 0.4));
    assert!((made.depth[0] - 3.25).abs() < 1e-14);
    // Half is absorbed before.
    let made = picture(&[slab(), painted(square(3.5), GREEN)], &along_z(0.3, 0.4));
    assert!((made.depth[0] - (3.0 + 0.5f64.ln() / 0.7f64.ln())).abs() < 1e-9);
}

#[test]
fn lattices_end_at_surfaces() {
    let shapes = [slab(), painted(square(1.5), GREEN)];
    let exact = picture(&shapes, &along_z(0.3, 0.4)).color[0];
    let options = ReferenceOptions { method: Method::Rays, sample_distance: 0.4, ..ReferenceOptions::default() };
    let made = integrate(&resolve(&shapes), &along_z(0.3, 0.4), &options).unwrap().color[0];
    (0..4).for_each(|c| assert!((made[c] - exact[c]).abs() < 1e-12));
}

/// An octahedron split four-fold, on whole numbers, so that rays go through vertices and edges.
fn ball() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let n = 4i32;
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for sign in 0..8 {
        let flip =
            |p: [i32; 3]| DVec3::from([0, 1, 2].map(|a| f64::from(if sign >> a & 1 == 1 { -p[a] } else { p[a] })));
        let mut add = |corners: [[i32; 3]; 3]| {
            let first = points.len() as u32;
            points.extend(corners.map(flip));
            triangles.push([first, first + 1, first + 2]);
        };
        for i in 0..n {
            for j in 0..n - i {
                let at = |i: i32, j: i32| [i, j, n - i - j];
                add([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j < n - 1 {
                    add([at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]);
                }
            }
        }
    }
    (points, triangles)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    /// No ray slips through an edge, whether triangles share vertices or only their places.
    #[test]
    fn closed_surfaces_are_tight(
        from in prop::array::uniform3(-9..10i32),
        weights in prop::array::uniform3(0..3u32),
        triangle in 0usize..128,
        columns in prop::array::uniform9(-1.5..1.5f64),
        plain in any::<bool>(),
    ) {
        let (points, triangles) = ball();
        let matrix = if plain { DMat3::IDENTITY } else { DMat3::from_cols_array(&columns) };
        prop_assume!(matrix.determinant().abs() > 0.1 && weights.iter().sum::<u32>() > 0);
        let corners = triangles[triangle % triangles.len()].map(|i| points[i as usize]);
        let total = f64::from(weights.iter().sum::<u32>());
        let target: DVec3 = (0..3).map(|i| corners[i] * f64::from(weights[i]) / total).sum();
        let from = DVec3::from(from.map(f64::from));
        // From outside, to a point of the near side that is not at the silhouette.
        let outside = from.abs().element_sum() > 4.5;
        let near = corners.iter().all(|_| {
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let outward = if normal.dot(corners[0]) < 0.0 { -normal } else { normal };
            outward.normalize().dot((from - target).normalize()) > 0.1
        });
        prop_assume!(outside && near && target.abs().min_element() > 0.0);
        let shape = painted(surface(points, triangles), GREEN);
        shape.set_transform(DAffine3::from_mat3(matrix));
        let made = picture(&[shape], &one_ray(matrix * from, matrix * target));
        prop_assert!(made.lower[0][3] > 1.0 - 1e-14, "{:?} {:?}", made.lower[0], made.upper[0]);
    }
}

/// A whole picture of a closed surface, through every vertex from the axis: no holes inside.
#[test]
fn picture_of_a_closed_surface_has_no_holes() {
    let (points, triangles) = ball();
    let shape = painted(surface(points, triangles), GREEN);
    let frame = FrameDesc::new(
        volact_core::Camera::orthographic(DVec3::new(0.0, 0.0, 20.0), DVec3::ZERO, DVec3::Y, 10.0),
        20,
        20,
    );
    let made = picture(&[shape], &frame);
    for (i, color) in made.color.iter().enumerate() {
        let at = [i % 20, i / 20].map(|v| (v as f64 + 0.5) / 2.0 - 5.0);
        let inside = at[0].abs() + at[1].abs();
        if inside < 4.0 - 1e-9 {
            assert!(color[3] == 1.0 || color[3] > 1.0 - 1e-14, "pixel {i}: {color:?}");
        } else if inside > 4.0 + 1e-9 {
            assert_eq!(*color, [0.0; 4]);
        }
    }
}

/// At an edge one of two triangles is seen: the enclosure holds both colours.
#[test]
fn edge_between_two_shades_is_not_certified() {
    let roof = surface(
        vec![
            DVec3::new(-4.0, 0.0, 1.0),
            DVec3::new(4.0, 0.0, 1.0),
            DVec3::new(0.0, 4.0, 2.0),
            DVec3::new(0.0, -4.0, 5.0),
        ],
        vec![[0, 1, 2], [1, 0, 3]],
    );
    let made = picture(&[painted(roof, GREEN)], &along_z(0.3, 0.0));
    assert_eq!(made.not_certified, 1);
    let flat = |rise: f64| 0.2 + 0.8 * (4.0 / (16.0 + rise * rise).sqrt());
    for light in [flat(1.0), flat(4.0)] {
        assert!(made.lower[0][1] <= light && light <= made.upper[0][1], "{:?}", made.color[0]);
    }
    assert!(made.lower[0][3] > 1.0 - 1e-14);
}

#[test]
fn shaders_and_surfaces_belong_together() {
    let volume = slab();
    volume.set_shader("surface");
    let error = check(&resolve(&[volume])[0]).unwrap_err();
    assert!(matches!(error, ActionError::Unsupported { .. }));
    let message = error.to_string();
    assert!(message.contains("shader \"surface\" on the geometry \"block\""), "{message}");
    let shape = slab();
    shape.set_geometry(square(1.0));
    let message = check(&resolve(&[shape])[0]).unwrap_err().to_string();
    assert!(message.contains("shader \"lut\" on the geometry \"surface\""), "{message}");
    let dark = painted(square(1.0), GREEN);
    dark.set_parameter("lightdir", DVec3::ZERO);
    let message = check(&resolve(&[dark])[0]).unwrap_err().to_string();
    assert!(message.contains("lightdir"), "{message}");
}

#[test]
fn surface_in_a_fitted_view_is_certified() {
    let (points, triangles) = ball();
    let shape = painted(surface(points, triangles), GREEN);
    let frame = FrameDesc::fit(&shape, View::Iso, 24, 24);
    let made = picture(&[slab(), shape], &frame);
    assert_eq!(made.not_certified, 0);
    assert!(made.color.iter().filter(|c| c[3] > 0.999).count() > 60);
}
