//! What must not change the picture: order, splitting, resampling, units, placement, types.

use proptest::prelude::*;
use volact_core::{
    Aabb, Appearance, Block, Camera, Filter, FrameDesc, Roi, ScalarType, Shape, TableInterpolation, View, Volume,
    VolumeDesc, VolumeTexture,
    camera::DepthRange,
    glam::{DAffine3, DMat3, DMat4, DVec3},
};
use volact_cpu::reference::{ReferenceOptions, ReferencePicture, integrate};

use super::common::{
    along_z, certify, enclose, lut, lut_of, one_ray, picture, point, resolve, table, truth, volume, volume_of,
};

fn hills(dims: [usize; 3], seed: f64) -> Volume {
    volume_of(dims, |[x, y, z]| 0.5 + 0.5 * (seed + 1.3 * x as f64 + 2.1 * y as f64 + 0.7 * (z * z) as f64).sin())
}

fn layers() -> volact_core::LookupTable {
    table(&[
        point(0.1, [0.0, 0.2, 0.9], 0.0),
        point(0.3, [0.9, 0.2, 0.1], 0.6),
        point(0.5, [0.2, 0.8, 0.3], 0.05),
        point(0.9, [0.7, 0.7, 0.2], 0.999),
    ])
}

/// Both pictures enclose the same truth, so every pair of enclosures meets, and all are narrow.
#[track_caller]
fn agree(a: &ReferencePicture, b: &ReferencePicture) {
    assert_eq!((a.not_certified, b.not_certified), (0, 0), "widest {:e} {:e}", a.widest, b.widest);
    for i in 0..a.color.len() {
        for c in 0..4 {
            let apart = (a.color[i][c] - b.color[i][c]).abs();
            let reach = 0.5 * (a.upper[i][c] - a.lower[i][c] + b.upper[i][c] - b.lower[i][c]);
            assert!(apart <= reach + 2e-15, "pixel {i}, channel {c}: {:?} {:?}", a.color[i], b.color[i]);
        }
        let (d, e) = (a.depth[i], b.depth[i]);
        assert!(d == e || (d - e).abs() < 1e-8 * d.abs(), "pixel {i}: depth {d} {e}");
    }
}

fn view(shapes: &[Shape]) -> FrameDesc {
    FrameDesc::fit_all(shapes, View::Iso, 12, 10)
}

#[test]
fn overlapped_shapes_do_not_depend_on_the_order() {
    let a = lut(&hills([4, 5, 6], 0.0), layers(), 0.7);
    let b = lut(&hills([5, 4, 5], 2.0), layers(), 1.3);
    b.set_transform(DAffine3::from_translation(DVec3::new(0.3, -0.4, 0.7)));
    let c = lut(&hills([3, 3, 3], 4.0), layers(), 0.4);
    c.set_transform(DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 2.0, 1.5),
        volact_core::glam::DQuat::from_rotation_y(0.4),
        DVec3::new(0.5, 0.1, 0.2),
    ));
    let frame = view(&[a.clone(), b.clone(), c.clone()]);
    let first = picture(&[a.clone(), b.clone(), c.clone()], &frame);
    agree(&first, &picture(&[c, a, b], &frame));
}

#[test]
fn shape_over_itself_is_the_shape_in_half_the_unit() {
    let data = hills([5, 4, 6], 1.0);
    let twice = [lut(&data, layers(), 1.0), lut(&data, layers(), 1.0)];
    let once = [lut(&data, layers(), 0.5)];
    let frame = view(&once);
    agree(&picture(&twice, &frame), &picture(&once, &frame));
}

#[test]
fn infinite_extinctions_weigh_the_same() {
    let flat = |color| lut(&volume_of([2; 3], |_| 0.0), table(&[point(0.0, color, 1.0)]), 1.0);
    let thin = lut(&volume_of([2; 3], |_| 0.0), table(&[point(0.0, [0.0, 0.0, 9.0], 0.9)]), 1.0);
    let shapes = [flat([1.0, 0.0, 0.0]), thin, flat([0.0, 1.0, 0.0])];
    certify(&shapes, &along_z(0.3, 0.4), [0.5, 0.5, 0.0, 1.0]);
}

#[test]
fn constant_media_that_overlap_mix_by_extinction() {
    let flat = |color, a| lut(&volume_of([2; 3], |_| 0.0), table(&[point(0.0, color, a)]), 1.0);
    let shapes = [flat([1.0, 0.0, 0.0], 0.5), flat([0.0, 1.0, 0.0], 0.75)];
    // σ is ln 2 and 2 ln 2; together an eighth passes.
    certify(&shapes, &along_z(0.3, 0.4), [0.875 / 3.0, 1.75 / 3.0, 0.0, 0.875]);
}

#[test]
fn block_cut_in_two_is_the_block() {
    let data = hills([6, 5, 7], 3.0);
    let whole = lut(&data, layers(), 0.8);
    let part = |min: DVec3, max: DVec3| {
        let part = whole.named("part");
        part.set_geometry(Block::from(Aabb::new(min, max)));
        part
    };
    let parts =
        [part(DVec3::ZERO, DVec3::new(2.3, 4.0, 6.0)), part(DVec3::new(2.3, 0.0, 0.0), DVec3::new(5.0, 4.0, 6.0))];
    let frame = view(std::slice::from_ref(&whole));
    agree(&picture(&[whole], &frame), &picture(&parts, &frame));
}

#[test]
fn one_cell_supersampled_is_the_cell() {
    let corner: [f64; 8] = std::array::from_fn(|i| (0.3 + 0.17 * (i * i) as f64).fract());
    let fine = volume_of([17; 3], |at| {
        let f = at.map(|v| v as f64 / 16.0);
        let weight = |i: usize| (0..3).map(|a| if i >> a & 1 == 1 { f[a] } else { 1.0 - f[a] }).product::<f64>();
        (0..8).map(|i| corner[i] * weight(i)).sum()
    });
    let roi = Aabb::new(DVec3::ZERO, DVec3::ONE);
    let shape = |v: &Volume| lut_of(&VolumeTexture::new(v).with_geometry_roi(roi).unwrap(), layers(), 0.3);
    let (coarse, fine) = (shape(&volume([2; 3], corner.to_vec())), shape(&fine));
    let frame = view(std::slice::from_ref(&coarse));
    let (coarse, fine) = (picture(&[coarse], &frame), picture(&[fine], &frame));
    assert_eq!((coarse.not_certified, fine.not_certified), (0, 0));
    // The samples of the fine grid are rounded themselves.
    for (a, b) in coarse.color.iter().flatten().zip(fine.color.iter().flatten()) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn scene_scaled_with_its_unit_is_the_scene(power in -9..9i32) {
        let scale = 4f64.powi(power);
        let data = hills([4, 4, 5], 0.5);
        let plain = lut(&data, layers(), 0.6);
        let scaled = lut(&data, layers(), 0.6 * scale);
        scaled.set_transform(DAffine3::from_scale(DVec3::splat(scale)));
        let (a, b) = (view(std::slice::from_ref(&plain)), view(std::slice::from_ref(&scaled)));
        let (a, mut b) = (picture(&[plain], &a), picture(&[scaled], &b));
        b.depth.iter_mut().for_each(|d| *d /= scale);
        agree(&a, &b);
    }

    #[test]
    fn opacity_over_another_unit_is_the_same(a in prop_oneof![0.0..1.0f64, 1e-9..1e-4f64], k in 0.2..5.0f64) {
        let data = volume_of([2, 2, 3], |_| 0.0);
        let other = -(k * (-a).ln_1p()).exp_m1();
        let one = picture(&[lut(&data, table(&[point(0.0, [0.5; 3], a)]), 1.0)], &along_z(0.2, 0.7));
        let two = picture(&[lut(&data, table(&[point(0.0, [0.5; 3], other)]), k)], &along_z(0.2, 0.7));
        // `other` is rounded, and so is what it leaves.
        let slack = 1e-15 / (1.0 - other).max(1e-12);
        for c in 0..4 {
            prop_assert!((one.color[0][c] - two.color[0][c]).abs() < 1e-14 + slack * (1.0 - one.color[0][3]) * 4.0);
        }
    }

    /// Any affine: the truth is integrated in the cell, with the length in the world.
    #[test]
    fn oblique_sheared_and_mirrored_cells(
        corner in prop::array::uniform8(0.0..1.0f64),
        matrix in prop::array::uniform9(-2.0..2.0f64),
        shift in prop::array::uniform3(-1e4..1e4f64),
        from in prop::array::uniform2(0.1..0.9f64),
        to in prop::array::uniform2(0.1..0.9f64),
    ) {
        let matrix = DMat3::from_cols_array(&matrix);
        prop_assume!(matrix.determinant().abs() > 0.5);
        let transform = DAffine3::from_mat3_translation(matrix, DVec3::from_array(shift));
        let (a, b) = (DVec3::new(from[0], from[1], 0.0), DVec3::new(to[0], to[1], 1.0));
        let points = [point(0.1, [0.1, 0.9, 0.3], 0.0), point(0.5, [0.9, 0.2, 0.1], 0.9), point(0.8, [0.0; 3], 0.2)];
        let length = matrix.mul_vec3(b - a).length();
        let expected = truth(&corner, a.to_array(), b.to_array(), length, 0.7, &points);
        let shape = lut(&volume([2; 3], corner.to_vec()), table(&points), 0.7);
        shape.set_transform(transform);
        let place = |p| transform.transform_point3(p);
        let frame = one_ray(place(a - (b - a)), place(b));
        // The camera's own rounding at that distance from the origin moves the ray.
        enclose(&picture(&[shape], &frame), expected, 1e-9, 4e-11);
    }
}

#[test]
fn a_scene_far_away_looks_as_it_does_here() {
    let data = hills([5, 4, 6], 1.0);
    let (here, there) = (lut(&data, layers(), 0.8), lut(&data, layers(), 0.8));
    // Multiples of powers of two, so that nothing is rounded in moving the scene.
    let far = DVec3::new(8388608.0, -16777216.0, 33554432.0);
    there.set_transform(DAffine3::from_translation(far));
    let frame = |by: DVec3| {
        let (eye, target) = (DVec3::new(2.0, -9.0, 3.0), DVec3::new(2.0, 1.5, 2.5));
        FrameDesc::new(Camera::perspective(eye + by, target + by, DVec3::Z, 40.0), 9, 9)
    };
    agree(&picture(&[here], &frame(DVec3::ZERO)), &picture(&[there], &frame(far)));
}

#[test]
fn cameras_agree_where_their_rays_do() {
    let shape = lut(&hills([5, 4, 6], 1.0), layers(), 0.8);
    let (eye, target) = (DVec3::new(1.0, -8.0, 3.0), DVec3::new(2.0, 1.5, 2.5));
    let frame = |camera| FrameDesc::new(camera, 1, 1);
    let perspective = picture(std::slice::from_ref(&shape), &frame(Camera::perspective(eye, target, DVec3::Z, 40.0)));
    let orthographic = Camera::orthographic(eye, target, DVec3::Z, 1.0);
    let orthographic = picture(std::slice::from_ref(&shape), &frame(orthographic));
    let view = DMat4::from_cols_array(&glam_look_at(eye, target));
    let (near, far) = (0.1, 100.0);
    let depth = [0.0, 0.0, far / (near - far), -1.0, 0.0, 0.0, near * far / (near - far), 0.0];
    let scale = [2.5, 0.0, 0.0, 0.0, 0.0, 2.5, 0.0, 0.0];
    let projection = DMat4::from_cols_array(&std::array::from_fn(|i| if i < 8 { scale[i] } else { depth[i - 8] }));
    let matrices = Camera::Matrices { view, projection, depth: DepthRange::ZeroToOne };
    let matrices = picture(&[shape], &frame(matrices));
    for other in [orthographic, matrices] {
        for c in 0..4 {
            assert!((perspective.color[0][c] - other.color[0][c]).abs() < 1e-11);
        }
    }
}

fn glam_look_at(eye: DVec3, target: DVec3) -> [f64; 16] {
    let back = (eye - target).normalize();
    let right = DVec3::Z.cross(back).normalize();
    let up = back.cross(right);
    let rotation = DMat3::from_cols(right, up, back).transpose();
    DMat4::from(DAffine3::from_mat3_translation(rotation, -(rotation * eye))).to_cols_array()
}

#[test]
fn near_and_far_cut_the_ray() {
    let shape = lut(&volume_of([2, 2, 5], |_| 0.0), table(&[point(0.0, [1.0; 3], 0.5)]), 1.0);
    let mut frame = along_z(0.5, 0.5);
    if let Camera::LookAt { near, far, .. } = &mut frame.camera {
        (*near, *far) = (4.0, 5.5);
    }
    let absorbed = 1.0 - 0.5f64.powf(1.5);
    certify(&[shape], &frame, [absorbed; 4]);
}

#[test]
fn data_region_stays_where_it_is() {
    let data = hills([6, 6, 6], 3.0);
    let roi = Roi { min: [1, 2, 1], max: [4, 5, 3] };
    let part = lut_of(&VolumeTexture::new(&data).with_data_roi(roi).unwrap(), layers(), 0.8);
    let whole = lut(&data, layers(), 0.8);
    whole.set_geometry(Block::from(Aabb::new(DVec3::new(1.0, 2.0, 1.0), DVec3::new(4.0, 5.0, 3.0))));
    let frame = view(std::slice::from_ref(&part));
    agree(&picture(&[part], &frame), &picture(&[whole], &frame));
}

#[test]
fn empty_bricks_leave_no_trace() {
    // A small hill in a large plain, against the hill alone.
    let n = 40;
    let data = volume_of([n; 3], |at| {
        let r = at.iter().map(|&v| (v as f64 - 21.0).powi(2)).sum::<f64>().sqrt();
        (1.0 - r / 5.0).max(0.0)
    });
    let roi = Roi { min: [14; 3], max: [28; 3] };
    let whole = lut(&data, layers(), 0.9);
    let part = lut_of(&VolumeTexture::new(&data).with_data_roi(roi).unwrap(), layers(), 0.9);
    let frame = FrameDesc::fit(&part, View::Iso, 16, 16);
    agree(&picture(&[whole], &frame), &picture(&[part], &frame));
}

#[test]
fn scalar_types_that_hold_the_same_numbers_show_the_same() {
    let numbers: Vec<u8> = (0..60).map(|i| (i * 37 % 101) as u8).collect();
    let table = table(&[point(10.0, [0.1, 0.5, 0.9], 0.0), point(90.0, [0.9, 0.5, 0.1], 0.8)]);
    let shape = |scalar: ScalarType, slope: f64| {
        let bytes: Vec<u8> = numbers
            .iter()
            .flat_map(|&n| match scalar {
                ScalarType::U8 | ScalarType::I8 => vec![n],
                ScalarType::U16 | ScalarType::I16 => u16::from(n).to_ne_bytes().to_vec(),
                ScalarType::U32 | ScalarType::I32 => u32::from(n).to_ne_bytes().to_vec(),
                ScalarType::F16 => half::f16::from_f64(f64::from(n)).to_ne_bytes().to_vec(),
                ScalarType::F32 => f32::from(n).to_ne_bytes().to_vec(),
                ScalarType::F64 => f64::from(n).to_ne_bytes().to_vec(),
            })
            .collect();
        let desc = VolumeDesc { slope, ..VolumeDesc::new([3, 4, 5], scalar, 1) };
        lut(&Volume::new(desc, bytes).unwrap(), table.clone(), 1.0)
    };
    let first = shape(ScalarType::U8, 1.0);
    let frame = view(std::slice::from_ref(&first));
    let first = picture(&[first], &frame);
    for scalar in ScalarType::ALL {
        assert_eq!(picture(&[shape(scalar, 1.0)], &frame), first, "{scalar}");
    }
    assert_ne!(picture(&[shape(ScalarType::U8, 0.5)], &frame), first);
}

#[test]
fn nearest_filter_gives_every_sample_its_cell() {
    // Samples at 0, 1, 2, 3 along z hold the stretches ½, 1, 1, ½.
    let data = volume_of([2, 2, 4], |[_, _, z]| z as f64);
    let texture = VolumeTexture::new(&data).with_filter(Filter::Nearest);
    let points: Vec<_> =
        (0..4).map(|i| point(f64::from(i), [f64::from(i) / 3.0; 3], 0.2 + 0.1 * f64::from(i))).collect();
    let (mut left, mut grey) = (1.0, 0.0);
    for (i, length) in [0.5, 1.0, 1.0, 0.5].into_iter().enumerate() {
        let absorbed = 1.0 - (0.8 - 0.1 * i as f64).powf(length);
        grey += left * absorbed * i as f64 / 3.0;
        left *= 1.0 - absorbed;
    }
    certify(&[lut_of(&texture, table(&points), 1.0)], &along_z(0.3, 0.4), [grey, grey, grey, 1.0 - left]);
}

#[test]
fn pre_interpolated_table_is_the_same_where_it_is_linear() {
    let data = hills([4, 5, 4], 0.2);
    let linear = table(&[point(-1.0, [0.1, 0.9, 0.3], 0.0), point(2.0, [0.7, 0.1, 0.5], 0.9)]);
    assert_eq!(linear.clone().pre_interpolated().interpolation(), TableInterpolation::Pre);
    let shapes = [lut(&data, linear.clone(), 1.0), lut(&data, linear.pre_interpolated(), 1.0)];
    let frame = view(&shapes);
    let (post, pre) = (picture(&shapes[..1], &frame), picture(&shapes[1..], &frame));
    assert_eq!((post.not_certified, pre.not_certified), (0, 0));
    for (a, b) in post.color.iter().flatten().zip(pre.color.iter().flatten()) {
        assert!((a - b).abs() < 1e-13);
    }
    let bent = [lut(&data, layers(), 1.0), lut(&data, layers().pre_interpolated(), 1.0)];
    assert_ne!(picture(&bent[..1], &frame).color, picture(&bent[1..], &frame).color);
}

#[test]
fn cell_with_a_nan_sample_is_transparent() {
    let data = volume_of([2, 2, 5], |at| if at == [1, 0, 3] { f64::NAN } else { 0.5 });
    let shape = lut(&data, table(&[point(0.0, [1.0; 3], 0.5)]), 1.0);
    certify(std::slice::from_ref(&shape), &along_z(0.5, 0.5), [0.75; 4]);
    // Along the edge of samples that are numbers, the other one has no weight.
    certify(&[shape], &along_z(0.0, 0.0), [1.0 - 0.5f64.powi(4); 4]);
}

#[test]
fn infinite_samples_are_clamped() {
    for (infinite, grey) in [(f64::INFINITY, 1.0), (f64::NEG_INFINITY, 0.0)] {
        let data = volume_of([2, 2, 2], |_| infinite);
        let shape = lut(&data, table(&[point(0.0, [0.0; 3], 0.5), point(1.0, [1.0; 3], 0.5)]), 1.0);
        certify(&[shape], &along_z(0.5, 0.5), [0.5 * grey, 0.5 * grey, 0.5 * grey, 0.5]);
    }
}

#[test]
fn axis_of_one_sample_is_constant() {
    let shape = lut(&volume([1, 1, 1], vec![0.5]), table(&[point(0.0, [1.0; 3], 0.25)]), 1.0);
    certify(&[shape], &along_z(0.2, -0.3), [0.25; 4]);
    let flat = lut(
        &volume([2, 2, 1], vec![0.0, 1.0, 0.0, 1.0]),
        table(&[point(0.0, [0.0; 3], 0.0), point(1.0, [1.0; 3], 1.0)]),
        1.0,
    );
    certify(&[flat], &along_z(0.75, 0.5), [0.75 * 0.75, 0.75 * 0.75, 0.75 * 0.75, 0.75]);
}

#[test]
fn components_mean_what_they_say() {
    let simple = |components: usize, voxel: &[f64], luminance: bool| {
        let desc = VolumeDesc::new([2; 3], ScalarType::F64, components);
        let data = Volume::new(desc, voxel.repeat(8)).unwrap();
        let texture = VolumeTexture::new(&data).with_range([10.0, 20.0]).unwrap();
        let texture = if luminance { texture.as_luminance() } else { texture };
        Shape::around_texture(&texture, Appearance::new("simple").with("unit_distance", 1.0))
    };
    let ray = along_z(0.4, 0.3);
    certify(&[simple(1, &[15.0], false)], &ray, [0.25, 0.25, 0.25, 0.5]);
    certify(&[simple(1, &[15.0], true)], &ray, [0.5, 0.5, 0.5, 1.0]);
    certify(&[simple(2, &[12.5, 15.0], false)], &ray, [0.125, 0.125, 0.125, 0.5]);
    certify(&[simple(3, &[12.5, 15.0, 25.0], false)], &ray, [0.25, 0.5, 1.0, 1.0]);
    certify(&[simple(4, &[12.5, 15.0, 0.0, 17.5], false)], &ray, [0.1875, 0.375, 0.0, 0.75]);
}

#[test]
fn threads_change_no_bit() {
    let shapes = [lut(&hills([6, 5, 7], 3.0), layers(), 0.8)];
    let frame = view(&shapes);
    let with = |threads| {
        let options = ReferenceOptions { threads, ..ReferenceOptions::default() };
        integrate(&resolve(&shapes), &frame, &options).unwrap()
    };
    assert_eq!(with(1), with(5));
}
