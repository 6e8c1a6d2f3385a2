//! Slices: planes through a shape, opaque or blended, with and without the volume around them.

use std::sync::Arc;

use proptest::prelude::*;
use volact_core::{
    ActionError, Appearance, Attribute, Block, Buffer, CellType, CellTypes, Clip, Filter, FrameDesc, Geometry, Mesh,
    Opaque, OpaqueDepth, Plane, ScalarType, Shape, SliceStyle, Sliced, Slices, View, Volume, VolumeDesc, VolumeTexture,
    geometry::ClipRegion,
    glam::{DAffine3, DMat3, DVec3},
    resolve::ResolvedShape,
};
use volact_cpu::reference::{Classification, Method, ReferenceOptions, check, integrate};

use super::common::{
    along_z, certify, enclose, lut, one_ray, picture, point, resolve, table, truth, volume, volume_of,
};

const RED: [f64; 3] = [1.0, 0.0, 0.0];

fn plane(at: [f64; 3], normal: [f64; 3]) -> Plane {
    Plane::new(DVec3::from(at), DVec3::from(normal)).unwrap()
}

fn level(z: f64) -> Plane {
    plane([0.3, 0.9, z], [0.0, 0.0, 1.0])
}

fn sliced(shape: &Shape, planes: Vec<Plane>, style: SliceStyle, volume: bool) -> Shape {
    let made = shape.named("sliced");
    made.set_geometry(Sliced::new(shape.state().geometry, Slices { planes, style, volume }).unwrap());
    made
}

/// The value is the height over 0 to 4; colour goes from black to blue, opacity from 0 to 0.8.
fn ramp() -> Shape {
    let data = volume_of([5; 3], |[_, _, z]| z as f64);
    lut(&data, table(&[point(0.0, [0.0; 3], 0.0), point(4.0, [0.0, 0.0, 1.0], 0.8)]), 1.0)
}

/// A red slab of 4³ that lets 0.7 through a unit of length.
fn slab() -> Shape {
    lut(&volume_of([5; 3], |_| 0.0), table(&[point(0.0, RED, 0.3)]), 1.0)
}

fn moved(shape: &Shape, z: f64) -> Shape {
    let made = shape.named("moved");
    made.set_transform(DAffine3::from_translation(DVec3::new(0.0, 0.0, z)));
    made
}

#[test]
fn opaque_slice_shows_the_value_and_ends_the_ray() {
    for (z, blue) in [(0.0, 0.0), (1.25, 0.3125), (4.0, 1.0)] {
        let shape = sliced(&ramp(), vec![level(z)], SliceStyle::Opaque, false);
        certify(&[shape], &along_z(0.3, 0.4), [0.0, 0.0, blue, 1.0]);
    }
    // The first of several is seen, from either side.
    let both = sliced(&ramp(), vec![level(3.0), level(1.0)], SliceStyle::Opaque, false);
    certify(std::slice::from_ref(&both), &along_z(0.3, 0.4), [0.0, 0.0, 0.25, 1.0]);
    certify(&[both], &one_ray(DVec3::new(0.3, 0.4, 9.0), DVec3::new(0.3, 0.4, 0.0)), [0.0, 0.0, 0.75, 1.0]);
}

#[test]
fn blended_slices_take_opacity_as_it_stands() {
    let shape = sliced(&ramp(), vec![level(3.0), level(1.0), level(2.0)], SliceStyle::Blended, false);
    let mut truth = [0.0, 0.0, 0.0, 0.0];
    for z in [1.0, 2.0, 3.0] {
        let left = 1.0 - truth[3];
        truth[2] += left * 0.2 * z * (0.25 * z);
        truth[3] += left * 0.2 * z;
    }
    certify(std::slice::from_ref(&shape), &along_z(0.3, 0.4), truth);
    // Whatever the unit, and from any direction.
    shape.set_parameter("unit_distance", 0.01);
    certify(std::slice::from_ref(&shape), &one_ray(DVec3::new(-1.0, 1.0, -2.0), DVec3::new(2.0, 2.0, 2.0)), truth);
}

#[test]
fn slice_before_inside_and_behind_a_slab() {
    // The slab lies from 0 to 4, the slice of another shape at heights −1, 2.5 and 5.
    for (z, before) in [(-1.0, 0.0f64), (2.5, 2.5), (5.0, 4.0)] {
        let other = moved(&sliced(&ramp(), vec![level(3.0)], SliceStyle::Opaque, false), z - 3.0);
        let left = 0.7f64.powf(before);
        certify(&[slab(), other], &along_z(0.3, 0.4), [1.0 - left, 0.0, left * 0.75, 1.0]);
        let other = moved(&sliced(&ramp(), vec![level(3.0)], SliceStyle::Blended, false), z - 3.0);
        let behind = 0.7f64.powf(4.0 - before);
        let red = 1.0 - left + left * 0.4 * (1.0 - behind);
        let truth = [red, 0.0, left * 0.6 * 0.75, 1.0 - left * 0.4 * behind];
        certify(&[other, slab()], &along_z(0.3, 0.4), truth);
    }
}

#[test]
fn volume_is_drawn_around_its_slices() {
    // Opacity is 0.3 everywhere, for the slices as it stands.
    let shape = sliced(&slab(), vec![level(1.0), level(2.5)], SliceStyle::Blended, true);
    let a = 1.0 - 0.7f64.powi(6);
    certify(&[shape], &along_z(0.3, 0.4), [a, 0.0, 0.0, a]);
    let shape = sliced(&slab(), vec![level(1.0)], SliceStyle::Opaque, true);
    certify(&[shape], &along_z(0.3, 0.4), [1.0, 0.0, 0.0, 1.0]);
}

#[test]
fn simple_slices_show_the_samples_themselves() {
    let voxels: Vec<u8> = (0..8).flat_map(|i| [i * 10, 100, 255 - i, 51]).collect();
    let mut desc = VolumeDesc::new([2; 3], ScalarType::U8, 4);
    desc.name = "rgba".into();
    let shape = Shape::around(&Volume::new(desc, voxels).unwrap(), Appearance::new("simple"));
    let made = sliced(&shape, vec![level(0.5)], SliceStyle::Blended, false);
    // The middle of the cell: components are means of the corners.
    let truth = [0.2 * 35.0 / 255.0, 0.2 * 100.0 / 255.0, 0.2 * 251.5 / 255.0, 0.2];
    certify(&[made], &along_z(0.5, 0.5), truth);
    let made = sliced(&shape, vec![level(0.5)], SliceStyle::Opaque, false);
    certify(&[made], &along_z(0.5, 0.5), [35.0 / 255.0, 100.0 / 255.0, 251.5 / 255.0, 1.0]);
}

#[test]
fn slice_is_transparent_where_a_sample_is_nan() {
    let data = volume_of([5; 3], |[x, _, z]| if x > 2 { f64::NAN } else { z as f64 });
    let shape = lut(&data, table(&[point(0.0, [0.0; 3], 0.5), point(4.0, [1.0; 3], 0.5)]), 1.0);
    let shape = sliced(&shape, vec![level(2.0)], SliceStyle::Opaque, false);
    certify(std::slice::from_ref(&shape), &along_z(1.5, 0.4), [0.5, 0.5, 0.5, 1.0]);
    certify(std::slice::from_ref(&shape), &along_z(2.5, 0.4), [0.0; 4]);
    // In the face of the last good samples the others have no weight.
    certify(&[shape], &along_z(2.0, 0.4), [0.5, 0.5, 0.5, 1.0]);
}

#[test]
fn nearest_slices_show_the_nearest_sample() {
    let data = volume_of([5; 3], |[_, _, z]| z as f64);
    let texture = VolumeTexture::new(&data).with_filter(Filter::Nearest);
    let look = Appearance::new("lut")
        .with("lookup_table", table(&[point(0.0, [0.0; 3], 0.5), point(4.0, [1.0; 3], 0.5)]))
        .with("unit_distance", 1.0);
    let shape = Shape::around_texture(&texture, look);
    for (z, value) in [(1.4, 1.0), (1.6, 2.0), (1.5, 2.0)] {
        let grey = value / 4.0;
        let made = sliced(&shape, vec![level(z)], SliceStyle::Opaque, false);
        certify(&[made], &along_z(0.3, 0.4), [grey, grey, grey, 1.0]);
    }
}

#[test]
fn faces_are_met_and_planes_along_the_ray_are_not() {
    // Both faces of the block, the first exactly where its medium begins.
    let faces = vec![level(0.0), plane([0.0, 0.0, 4.0], [0.0, 0.0, -1.0])];
    let shape = sliced(&slab(), faces, SliceStyle::Blended, true);
    let a = 1.0 - 0.7f64.powi(6);
    certify(&[shape], &along_z(0.3, 0.4), [a, 0.0, 0.0, a]);
    // Outside it, along the ray, and in the ray's plane: not.
    let none =
        vec![level(4.0f64.next_up()), plane([0.3, 0.0, 0.0], [1.0, 0.0, 0.0]), plane([0.2, 0.0, 0.0], [1.0, 0.0, 0.0])];
    certify(&[sliced(&slab(), none, SliceStyle::Opaque, false)], &along_z(0.3, 0.4), [0.0; 4]);
    // What begins opaque at the plane lies behind it.
    let wall = moved(&lut(&volume_of([5; 3], |_| 0.0), table(&[point(0.0, RED, 1.0)]), 1.0), 2.0);
    let shape = sliced(&ramp(), vec![level(2.0)], SliceStyle::Blended, false);
    certify(&[wall, shape], &along_z(0.3, 0.4), [0.6, 0.0, 0.4 * 0.5, 1.0]);
}

#[test]
fn planes_at_one_place_add_up_whatever_the_order() {
    let green = |a: f64| lut(&volume_of([5; 3], |_| 0.0), table(&[point(0.0, [0.0, 1.0, 0.0], a)]), 1.0);
    let blue = |a: f64| lut(&volume_of([5; 3], |_| 0.0), table(&[point(0.0, [0.0, 0.0, 1.0], a)]), 1.0);
    let cut = |shape: &Shape, style| sliced(shape, vec![level(1.0)], style, false);
    let shapes = [
        cut(&slab(), SliceStyle::Blended),
        cut(&green(0.5), SliceStyle::Blended),
        cut(&blue(0.2), SliceStyle::Blended),
    ];
    let (alpha, sum) = (1.0 - 0.7 * 0.5 * 0.8, 0.3 + 0.5 + 0.2);
    let truth = [0.3 / sum * alpha, 0.5 / sum * alpha, 0.2 / sum * alpha, alpha];
    let ray = along_z(0.3, 0.4);
    certify(&shapes, &ray, truth);
    let first = picture(&shapes, &ray);
    for order in [[0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        assert_eq!(picture(&order.map(|i| shapes[i].clone()), &ray), first);
    }
    // The same plane twice, also if given from its other side, counts twice.
    let twice = vec![level(1.0), plane([0.0, 0.0, 1.0], [0.0, 0.0, -3.0])];
    let a = 1.0 - 0.49;
    certify(&[sliced(&slab(), twice, SliceStyle::Blended, false)], &ray, [a, 0.0, 0.0, a]);
    // An opaque one beside blended ones is opaque, and mixes with them.
    let mixed = [cut(&slab(), SliceStyle::Opaque), cut(&green(0.5), SliceStyle::Blended)];
    certify(&mixed, &ray, [1.0 / 1.5, 0.5 / 1.5, 0.0, 1.0]);
}

#[test]
fn clips_cut_slices_and_leave_those_on_them() {
    let shape = |z: f64| {
        let made = sliced(&ramp(), vec![level(2.0)], SliceStyle::Opaque, false);
        made.set_clip(Clip::NONE.with(ClipRegion::plane(plane([0.0, 0.0, z], [0.0, 0.0, 1.0]))));
        made
    };
    let seen = [0.0, 0.0, 0.5, 1.0];
    for (z, truth) in [(1.0, seen), (2.0, seen), (3.0, [0.0; 4])] {
        certify(&[shape(z)], &along_z(0.3, 0.4), truth);
    }
    let scene = Clip::NONE.with(ClipRegion::plane(plane([0.0, 0.0, 2.5], [0.0, 0.0, 1.0])));
    certify(&[shape(1.0)], &along_z(0.3, 0.4).with_clip(scene), [0.0; 4]);
}

/// Only what the shapes' geometry and the volume's region share is there to be sliced.
#[test]
fn geometry_bounds_its_slices() {
    let shape = ramp();
    shape.set_geometry(Block::new(DVec3::new(0.0, 0.0, 1.0), DVec3::new(4.0, 4.0, 9.0)).unwrap());
    for (z, alpha) in [(0.5, 0.0), (1.0, 1.0), (4.0, 1.0), (4.5, 0.0)] {
        let made = picture(&[sliced(&shape, vec![level(z)], SliceStyle::Opaque, false)], &along_z(0.3, 0.4));
        assert_eq!(made.not_certified, 0);
        assert!((made.color[0][3] - alpha).abs() < 1e-14, "{z}");
    }
}

#[test]
fn slices_of_values_are_refused() {
    for shader in ["mip", "minip", "average", "xray"] {
        let shape = sliced(&ramp(), vec![level(1.0)], SliceStyle::Opaque, true);
        shape.set_shader(shader);
        let error = check(&resolve(&[shape])[0]).unwrap_err();
        let message = error.to_string();
        assert!(matches!(error, ActionError::Unsupported { .. }), "{message}");
        assert!(message.contains("slices with the shader") && message.contains(shader), "{message}");
    }
}

#[test]
fn depth_counts_slices_where_they_are() {
    let shape = sliced(&ramp(), vec![level(1.0), level(2.0), level(4.0)], SliceStyle::Blended, false);
    // Accumulated: 0.2, 0.52, 0.904.
    for (threshold, depth) in [(0.1, 4.0), (0.5, 5.0), (0.53, 7.0), (0.95, f64::INFINITY)] {
        let mut frame = along_z(0.3, 0.4);
        frame.depth_threshold = threshold;
        let made = picture(std::slice::from_ref(&shape), &frame).depth[0];
        assert!(made == depth || (made - depth).abs() < 1e-12, "{threshold}: {made}");
    }
}

#[test]
fn lattice_leaves_slices_where_they_are() {
    // Constant media: any step is exact, cut by the slice in the middle of a segment.
    let shapes = [slab(), moved(&sliced(&ramp(), vec![level(3.0)], SliceStyle::Blended, false), -0.7)];
    let exact = picture(&shapes, &along_z(0.3, 0.4)).color[0];
    for classification in [Classification::Post, Classification::PreIntegrated] {
        for method in [Method::Rays, Method::Planes] {
            let options =
                ReferenceOptions { method, classification, sample_distance: 0.9, ..ReferenceOptions::default() };
            let made = integrate(&resolve(&shapes), &along_z(0.3, 0.4), &options).unwrap().color[0];
            (0..4).for_each(|c| assert!((made[c] - exact[c]).abs() < 1e-12, "{method:?}: {made:?} {exact:?}"));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Any plane, any ray, any transform: the value is that of the trilinear field at the point.
    #[test]
    fn oblique_slices_show_the_field(
        columns in prop::array::uniform9(-1.5..1.5f64),
        at in prop::array::uniform3(0.1..2.9f64),
        normal in prop::array::uniform3(-1.0..1.0f64),
        from in prop::array::uniform3(-9.0..9.0f64),
        seed in 0.0..6.0f64,
    ) {
        let transform = DAffine3::from_mat3_translation(DMat3::from_cols_array(&columns), DVec3::new(5.0, -3.0, 2.0));
        let at = DVec3::from(at);
        let target = transform.transform_point3(at);
        let (direction, normal) = ((target - DVec3::from(from)).normalize_or_zero(), DVec3::from(normal));
        prop_assume!(transform.matrix3.determinant().abs() > 0.2 && normal.length() > 0.1);
        let seen = transform.inverse().transform_vector3(direction);
        prop_assume!(normal.normalize().dot(seen.normalize_or_zero()).abs() > 0.05);
        let field = |[x, y, z]: [usize; 3]| (seed + 1.3 * x as f64 + 2.1 * y as f64 + 0.7 * (z * z) as f64).sin();
        let shape = lut(&volume_of([4; 3], field), table(&[point(-1.0, [0.0; 3], 0.1), point(1.0, [1.0; 3], 0.9)]), 1.0);
        shape.set_transform(transform);
        let slices = Slices { planes: vec![Plane::new(at, normal).unwrap()], style: SliceStyle::Blended, volume: false };
        shape.set_geometry(Sliced::new(shape.state().geometry, slices).unwrap());
        let base = at.to_array().map(|v| (v.floor() as usize).min(2));
        let f = [0, 1, 2].map(|a| at[a] - base[a] as f64);
        let value: f64 = (0..8usize).map(|i| {
            let bit = |a: usize| i >> a & 1;
            let weight: f64 = (0..3).map(|a| if bit(a) == 1 { f[a] } else { 1.0 - f[a] }).product();
            weight * field([0, 1, 2].map(|a| base[a] + bit(a)))
        }).sum();
        let (grey, alpha) = (0.5 * (value + 1.0), 0.1 + 0.4 * (value + 1.0));
        // The pixel's centre is off the target by what the camera rounds.
        let made = picture(&[shape], &one_ray(DVec3::from(from), target));
        enclose(&made, [alpha * grey, alpha * grey, alpha * grey, alpha], 1e-12, 1e-12);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// In a cell whose opacity is a cubic along the ray: the part before, the slice, the part
    /// behind, each integrated on its own.
    #[test]
    fn slice_in_a_curved_medium_has_both_parts_around_it(
        corner in prop::array::uniform8(0.0..1.0f64),
        from in prop::array::uniform2(0.05..0.95f64),
        to in prop::array::uniform2(0.05..0.95f64),
        place in 0.05..0.95f64,
        unit in 0.05..2.0f64,
        walled in any::<bool>(),
    ) {
        let points = [
            point(0.1, [0.1, 0.4, 0.9], 0.0),
            point(0.4, [0.9, 0.5, 0.1], 0.6),
            point(0.6, [0.2, 0.8, 0.3], 0.05),
            point(1.0, [0.7, 0.7, 0.2], 0.95),
        ];
        let (from, to) = ([from[0], from[1], 0.0], [to[0], to[1], 1.0]);
        let middle = [0, 1, 2].map(|a| from[a] + (to[a] - from[a]) * place);
        let length = (DVec3::from(to) - DVec3::from(from)).length();
        let before = truth(&corner, from, middle, length * place, unit, &points);
        let behind = truth(&corner, middle, to, length * (1.0 - place), unit, &points);
        let weight = |i: usize| (0..3).map(|a| if i >> a & 1 == 1 { middle[a] } else { 1.0 - middle[a] }).product::<f64>();
        let value = (0..8).map(|i| corner[i] * weight(i)).sum::<f64>();
        let look = table(&points).resolve([0.0, 1.0]).classify(value);
        let shape = lut(&volume([2; 3], corner.to_vec()), table(&points), unit);
        let made = sliced(&shape, vec![level(middle[2])], SliceStyle::Blended, true);
        let direction = (DVec3::from(to) - DVec3::from(from)).normalize();
        let eye = DVec3::from(from) - 2.0 * direction;
        let mut frame = one_ray(eye, DVec3::from(to) + direction);
        let mut expected = [0.0; 4];
        for (c, expected) in expected.iter_mut().enumerate() {
            let light = if c < 3 { look[c] * look[3] } else { look[3] };
            // An application's wall right behind the slice hides the part behind it.
            let rest = if walled { 0.0 } else { behind[c] };
            *expected = before[c] + (1.0 - before[3]) * (light + (1.0 - look[3]) * rest);
        }
        if walled {
            let distance = (2.0 + length * place) as f32;
            let after = f64::from(distance) - 2.0 - length * place;
            prop_assume!(after >= 0.0);
            let depth = OpaqueDepth::Distance(vec![distance].into());
            frame = frame.with_opaque(Opaque { color: None, depth });
            // What is between, at most 2e-7, is all that the truth leaves out.
            enclose(&picture(&[made], &frame), expected, 1e-9, after / unit * 3.0 + 1e-10);
        } else {
            enclose(&picture(&[made], &frame), expected, 1e-9, 1e-10);
        }
    }
}

/// The box of [`slab`] in six tetrahedra, and the function z/4 + y/40 on its corners.
fn tetrahedra() -> (Mesh, Attribute) {
    let block = Block::new(DVec3::ZERO, DVec3::splat(4.0)).unwrap().tessellate().unwrap();
    let corners: Vec<u32> = block.tetrahedra.iter().flatten().copied().collect();
    let types = CellTypes::All(CellType::Tetrahedron);
    let mesh = Mesh::new(block.vertices.clone(), types, Buffer::from_vec(corners)).unwrap();
    let numbers: Vec<f64> = block.vertices.iter().map(|p| p.z / 4.0 + p.y / 40.0).collect();
    (mesh, Attribute::new("height", ScalarType::F64, 1, Buffer::from_vec(numbers)).unwrap())
}

#[test]
fn meshes_are_sliced_by_what_they_carry() {
    let (mesh, attribute) = tetrahedra();
    let look = Appearance::new("attribute")
        .with("scalars", attribute)
        .with("lookup_table", table(&[point(0.0, [0.0; 3], 0.0), point(1.0, [1.0, 0.5, 0.0], 0.8)]))
        .with("unit_distance", 1.0);
    let shape = Shape::new(mesh, look);
    let made = sliced(&shape, vec![level(1.25), level(3.0), level(5.0)], SliceStyle::Blended, false);
    let mut truth = [0.0; 4];
    for z in [1.25, 3.0] {
        let (value, left) = (z / 4.0 + 0.01, 1.0 - truth[3]);
        truth[0] += left * 0.8 * value * value;
        truth[1] += left * 0.8 * value * value * 0.5;
        truth[3] += left * 0.8 * value;
    }
    certify(&[made], &along_z(0.3, 0.4), truth);
    // On a face of the mesh, where the medium begins, and with it around.
    let made = sliced(&shape, vec![level(0.0)], SliceStyle::Opaque, true);
    certify(&[made], &along_z(0.3, 0.4), [0.01, 0.005, 0.0, 1.0]);
}

#[test]
fn carved_volume_is_sliced_as_its_block() {
    let data = volume_of([5; 3], |[x, y, z]| (1.3 * x as f64 + 2.1 * y as f64 + 0.7 * (z * z) as f64).sin());
    let block = lut(&data, table(&[point(-1.0, [0.0; 3], 0.1), point(1.0, [1.0; 3], 0.9)]), 1.0);
    let carved = block.named("carved");
    carved.set_geometry(tetrahedra().0);
    let planes = vec![plane([2.0, 1.0, 2.2], [0.3, -0.2, 1.0]), plane([1.0, 2.0, 3.0], [-1.0, 0.5, 0.4])];
    let frame = FrameDesc::fit(&block, View::Iso, 12, 10);
    for (style, volume) in [(SliceStyle::Opaque, false), (SliceStyle::Blended, false), (SliceStyle::Blended, true)] {
        let [a, b] = [&block, &carved].map(|s| picture(&[sliced(s, planes.clone(), style, volume)], &frame));
        assert_eq!((a.not_certified, b.not_certified), (0, 0), "{style:?} {volume}");
        assert!(a.color.iter().any(|c| c[3] > 0.3));
        for (a, b) in a.color.iter().flatten().zip(b.color.iter().flatten()) {
            assert!((a - b).abs() < 1e-11, "{style:?} {volume}: {a} {b}");
        }
    }
}

/// A geometry of one's own need not know of slices to be sliced.
#[test]
fn sliced_geometries_keep_their_name_and_bounds() {
    let block = Arc::new(Block::new(DVec3::ZERO, DVec3::ONE).unwrap());
    let made =
        Sliced::new(block, Slices { planes: vec![level(0.5)], style: SliceStyle::Opaque, volume: true }).unwrap();
    let shape = Shape::new(made, Appearance::new("lut"));
    assert_eq!(shape.state().geometry.name(), "block");
    let registry = volact_core::Registry::with_core();
    assert!(ResolvedShape::new(&shape, registry.shaders()).is_err(), "a table is missing");
}
