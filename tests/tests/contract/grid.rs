//! Where samples lie, and what they are worth.
//!
//! The probe is the shader `average` with a grey ramp: the colour of a ray is the mean value.

use volact_conformance::{
    metrics::{max_error, within},
    rig::{Setup, truth},
    scene::{along_y, cell, encode, greys, lut, lut_of, placed, shaded, square, values, volume},
};
use volact_core::{
    Aabb, Appearance, Block, Buffer, Filter, FrameDesc, LookupTable, Roi, ScalarType, Shape, Volume, VolumeDesc,
    VolumeTexture,
    glam::{DAffine3, DVec3},
};

/// f32 of values up to 1: interpolation takes seven roundings.
const F32: f64 = 2e-6;

fn probe(texture: &VolumeTexture) -> Shape {
    shaded("average", texture, LookupTable::grey([0.0, 1.0]), 1.0)
}

/// The mean along y at (x, z), by `cpu` and the reference; `None` where nothing is met.
fn mean(shape: &Shape, x: f64, z: f64) -> Option<f64> {
    let desc = along_y(x, z);
    let one = truth(std::slice::from_ref(shape), &desc).color[0];
    let other = Setup::cpu().step(0.11).pixel(shape, &desc);
    within("cpu against exact", max_error(&[one], &[other]), F32);
    (one[3] > 0.0).then_some(one[0])
}

#[track_caller]
fn is(found: Option<f64>, wanted: f64) {
    within("value", (found.expect("something is met") - wanted).abs(), 1e-9);
}

#[test]
fn first_and_last_voxels_lie_on_the_faces_and_x_runs_fastest() {
    let rule = |p: DVec3| (1.0 + 3.0 * p.x + 7.0 * p.z + 20.0 * p.y) / 100.0;
    let shape = probe(&VolumeTexture::new(&volume([4, 3, 2], ScalarType::F64, rule)));
    let inside = 1e-9;
    // The mean over y of 0, 1, 2 is that of y = 1.
    for (x, z) in [(0.0, 0.0), (3.0, 0.0), (0.0, 1.0), (3.0, 1.0), (1.0, 1.0), (2.0, 0.0), (1.5, 0.25)] {
        let (at_x, at_z) = (f64::clamp(x, inside, 3.0 - inside), f64::clamp(z, inside, 1.0 - inside));
        is(mean(&shape, at_x, at_z), rule(DVec3::new(x, 1.0, z)));
    }
    for (x, z) in [(-1e-6, 0.5), (3.0 + 1e-6, 0.5), (1.0, -1e-6), (1.0, 1.0 + 1e-6)] {
        assert_eq!(mean(&shape, x, z), None, "outside at {x}, {z}");
    }
}

#[test]
fn axis_of_one_sample_is_constant_and_one_spacing_thick() {
    let desc = VolumeDesc { spacing: DVec3::new(1.0, 3.0, 1.0), ..VolumeDesc::new([2, 1, 2], ScalarType::F64, 1) };
    let texture = VolumeTexture::new(&placed(desc, |p| 0.2 + 0.3 * p.x + 0.1 * p.z));
    is(mean(&probe(&texture), 0.5, 0.5), 0.4);
    // The line integral over its thickness of 3, a unit being 10.
    let sum = shaded("xray", &texture, LookupTable::grey([0.0, 1.0]), 10.0);
    is(mean(&sum, 0.5, 0.5), 0.4 * 3.0 / 10.0);
    let bounds = probe(&texture).state().world_bounds();
    assert_eq!((bounds.min.y, bounds.max.y), (-1.5, 1.5));
}

#[test]
fn data_roi_stays_where_it_is_and_carves() {
    let rule = |p: DVec3| (1.0 + p.x * p.x + 5.0 * p.z) / 64.0;
    let whole = VolumeTexture::new(&volume([6, 3, 5], ScalarType::F64, rule));
    let part = whole.clone().with_data_roi(Roi { min: [1, 0, 2], max: [4, 1, 3] }).unwrap();
    let (whole, part) = (probe(&whole), probe(&part));
    for (x, z) in [(1.3, 2.2), (2.5, 2.9), (3.9, 2.5)] {
        is(mean(&part, x, z), mean(&whole, x, z).unwrap());
    }
    for (x, z) in [(0.9, 2.5), (4.1, 2.5), (2.0, 1.9), (2.0, 3.1)] {
        assert_eq!(mean(&part, x, z), None);
        assert!(mean(&whole, x, z).is_some());
    }
    assert!(VolumeTexture::new(&cell()).with_data_roi(Roi { min: [0; 3], max: [2, 1, 1] }).is_err());
    assert!(VolumeTexture::new(&cell()).with_data_roi(Roi { min: [1, 0, 0], max: [0, 1, 1] }).is_err());
}

#[test]
fn geometry_roi_moves_and_scales_the_texture_and_meets_the_block() {
    let rule = |p: DVec3| (1.0 + p.x) / 8.0;
    let texture = VolumeTexture::new(&volume([5, 2, 2], ScalarType::F64, rule));
    let carved = texture.clone().with_data_roi(Roi { min: [1, 0, 0], max: [3, 1, 1] }).unwrap();
    let (lo, hi) = (DVec3::new(10.0, 0.0, -2.0), DVec3::new(14.0, 3.0, 2.0));
    let moved = carved.with_geometry_roi(Aabb::new(lo, hi)).unwrap();
    let block = Block::new(DVec3::new(11.0, -5.0, -9.0), DVec3::new(20.0, 20.0, 20.0)).unwrap();
    let grey = LookupTable::grey([0.0, 1.0]);
    let look = Appearance::new("average").with("lookup_table", grey).with("volume", moved.clone());
    let cut = Shape::new(block, look);
    let whole = probe(&moved);
    // Samples 1 to 3 over 10 to 14: two world units a sample.
    for x in [10.1, 11.5, 12.0, 13.9] {
        is(mean(&whole, x, 0.3), (1.0 + 1.0 + (x - 10.0) / 2.0) / 8.0);
    }
    is(mean(&cut, 12.0, 0.3), 3.0 / 8.0);
    assert_eq!(mean(&cut, 10.9, 0.3), None, "outside the block");
    assert_eq!(mean(&cut, 14.1, 0.3), None, "outside the region");
    assert_eq!(mean(&cut, 12.0, 2.1), None, "outside the region");
    // Resizing the region scales, and its transform comes on top.
    cut.set_transform(DAffine3::from_translation(DVec3::new(100.0, 0.0, 0.0)));
    is(mean(&cut, 112.0, 0.3), 3.0 / 8.0);
}

#[test]
fn block_and_region_that_do_not_meet_show_nothing() {
    let texture = VolumeTexture::new(&cell());
    let table = greys(&[(0.0, 1.0, 0.5)]);
    for shader in ["lut", "mip", "average", "xray"] {
        let block = Block::new(DVec3::splat(1.5), DVec3::ONE).unwrap();
        let look = volact_conformance::scene::look(shader, table.clone(), 1.0).with("volume", texture.clone());
        let shape = Shape::new(block, look);
        for setup in [Setup::exact(), Setup::rays(0.3), Setup::post(0.3)] {
            let found = setup.colors(std::slice::from_ref(&shape), &oblique(12));
            assert!(found.iter().all(|c| *c == [0.0; 4]), "{shader}, {setup:?}");
        }
    }
}

#[test]
fn nearest_takes_the_nearest_sample() {
    let rule = |p: DVec3| (1.0 + p.x + 4.0 * p.z) / 32.0;
    let shape = probe(
        &VolumeTexture::new(&volume([4, 2, 3], ScalarType::U8, |p| 255.0 * rule(p))).with_filter(Filter::Nearest),
    );
    let stored = |p: DVec3| (255.0 * rule(p)).round();
    for (x, z) in [(0.49, 0.1), (0.51, 0.1), (1.4, 1.6), (2.9, 1.4), (2.51, 0.51)] {
        let wanted = stored(DVec3::new(f64::round(x), 0.0, f64::round(z)));
        let found = mean(&shape, x, z);
        // The table is a ramp over 0 to 1, and the values are 8 to 96.
        assert_eq!(found, Some(1.0_f64.min(wanted)), "{x}, {z}");
    }
    let table = LookupTable::grey([0.0, 255.0]);
    let texture =
        VolumeTexture::new(&volume([4, 2, 3], ScalarType::U8, |p| 255.0 * rule(p))).with_filter(Filter::Nearest);
    let shape = shaded("average", &texture, table, 1.0);
    for (x, z) in [(0.49, 0.1), (0.51, 0.1), (1.4, 1.6), (2.9, 1.4), (2.51, 0.51)] {
        is(mean(&shape, x, z), stored(DVec3::new(f64::round(x), 0.0, f64::round(z))) / 255.0);
    }
}

fn oblique(pixels: usize) -> FrameDesc {
    square(DVec3::new(2.0, 2.5, 3.0), DVec3::new(7.0, -20.0, 9.0), 9.0, pixels)
}

#[test]
fn every_scalar_type_draws_the_same_values_alike() {
    let rule = |p: DVec3| (9.0 + 40.0 * ((p.x * 1.3).sin() + (p.y + p.z).cos())).round().clamp(0.0, 100.0);
    let table = greys(&[(3.0, 0.1, 0.0), (40.0, 0.9, 0.2), (90.0, 0.5, 0.7)]);
    let shape = |scalar| [lut(&volume([5, 6, 7], scalar, rule), table.clone(), 1.5)];
    let exact = truth(&shape(ScalarType::F64), &oblique(12)).color;
    let lattice = Setup::rays(0.25).colors(&shape(ScalarType::F64), &oblique(12));
    for scalar in ScalarType::ALL {
        within(&format!("{scalar}, exact"), max_error(&truth(&shape(scalar), &oblique(12)).color, &exact), 1e-9);
        let found = Setup::post(0.25).colors(&shape(scalar), &oblique(12));
        // f32 values of 100 and a table as steep as 1/40: 1e-5 of a value is 2e-7 of opacity.
        within(&format!("{scalar}, cpu"), max_error(&found, &lattice), 1e-5);
    }
}

#[test]
fn slope_and_intercept_make_data_units() {
    let rule = |p: DVec3| 20.0 + 5.0 * p.x + 3.0 * p.y * p.z;
    let plain = lut(&volume([4, 4, 4], ScalarType::F64, rule), greys(&[(20.0, 0.1, 0.0), (60.0, 0.9, 0.6)]), 1.0);
    for scalar in ScalarType::ALL {
        let desc = VolumeDesc { slope: -0.5, intercept: 70.0, ..VolumeDesc::new([4, 4, 4], scalar, 1) };
        let data = placed(desc, |p| (rule(p) - 70.0) / -0.5);
        let shape = lut(&data, greys(&[(20.0, 0.1, 0.0), (60.0, 0.9, 0.6)]), 1.0);
        let a = Setup::exact().colors(std::slice::from_ref(&shape), &oblique(8));
        let b = Setup::exact().colors(std::slice::from_ref(&plain), &oblique(8));
        within(&format!("{scalar}, exact"), max_error(&a, &b), 1e-6);
        let a = Setup::post(0.2).colors(&[shape], &oblique(8));
        let b = Setup::rays(0.2).colors(std::slice::from_ref(&plain), &oblique(8));
        within(&format!("{scalar}, cpu"), max_error(&a, &b), 1e-5);
    }
}

#[test]
fn table_reads_the_component_named() {
    let one = |p: DVec3| (10.0 * p.x + 3.0 * p.y).round();
    let two = |p: DVec3| (50.0 - 9.0 * p.z).round();
    let dims = [4, 4, 4];
    let pairs: Vec<_> = values(dims, one).into_iter().zip(values(dims, two)).flat_map(|(a, b)| [a, b]).collect();
    let data = Volume::new(VolumeDesc::new(dims, ScalarType::I16, 2), encode(ScalarType::I16, &pairs)).unwrap();
    let table = || greys(&[(0.0, 0.1, 0.0), (60.0, 0.9, 0.5)]);
    for (component, alone) in [(0i64, volume(dims, ScalarType::I16, one)), (1, volume(dims, ScalarType::I16, two))] {
        let shape = lut(&data, table(), 1.0);
        shape.set_parameter("component", component);
        for setup in [Setup::post(0.3), Setup::rays(0.3)] {
            let found = setup.colors(std::slice::from_ref(&shape), &oblique(8));
            let wanted = setup.colors(&[lut(&alone, table(), 1.0)], &oblique(8));
            within("component", max_error(&found, &wanted), 1e-6);
        }
    }
    let shape = lut(&data, table(), 1.0);
    shape.set_parameter("component", 2i64);
    let error = Setup::cpu().action().manage(&shape).unwrap_err().to_string();
    assert!(error.contains("component 2") && error.contains("0 to 1"), "{error}");
}

/// One component is grey and opacity alike, or opaque grey; two grey and opacity; three an opaque
/// colour; four colour and opacity.
#[test]
fn components_mean_what_their_number_says() {
    let stored = [51.0, 102.0, 153.0, 204.0];
    let v = stored.map(|s| s / 255.0);
    let solid = |n: usize| {
        let all: Vec<_> = (0..8).flat_map(|_| stored[..n].to_vec()).collect();
        VolumeTexture::new(
            &Volume::new(VolumeDesc::new([2; 3], ScalarType::U8, n), Buffer::from_vec(encode(ScalarType::U8, &all)))
                .unwrap(),
        )
    };
    let cases = [
        (solid(1), [v[0], v[0], v[0], v[0]]),
        (solid(1).as_luminance(), [v[0], v[0], v[0], 1.0]),
        (solid(2), [v[0], v[0], v[0], v[1]]),
        (solid(3), [v[0], v[1], v[2], 1.0]),
        (solid(4), [v[0], v[1], v[2], v[3]]),
        // The range says which value is 1.
        (solid(1).with_range([0.0, 102.0]).unwrap(), [0.5; 4]),
        (solid(1).with_range([102.0, 0.0]).unwrap(), [0.5; 4]),
    ];
    for (texture, [r, g, b, a]) in cases {
        let shape = Shape::around_texture(&texture, Appearance::new("simple").with("unit_distance", 1.0));
        for setup in [Setup::exact(), Setup::rays(0.4), Setup::cpu().step(0.4)] {
            let found = setup.pixel(&shape, &along_y(0.5, 0.5));
            // f32 frames, and what is left below the termination of a ray.
            within("simple", max_error(&[found], &[[r * a, g * a, b * a, a]]), 4e-6);
        }
    }
}

/// Interpolation is exact on what it interpolates: the picture of a cell does not change when the
/// cell is sampled more finely.
#[test]
fn supersampling_a_trilinear_cell_changes_nothing() {
    let coarse = VolumeTexture::new(&cell());
    let table = || greys(&[(0.0, 0.1, 0.0), (0.3, 0.9, 0.3), (1.0, 0.4, 0.8)]);
    let desc = square(DVec3::splat(0.5), DVec3::new(3.0, -9.0, 5.0), 1.6, 12);
    let plain = lut_of(&coarse, table(), 0.5);
    for n in [5usize, 33] {
        let fine = |scalar| {
            let spacing = DVec3::splat(1.0 / (n - 1) as f64);
            let desc = VolumeDesc { spacing, ..VolumeDesc::new([n; 3], scalar, 1) };
            [lut(&placed(desc, |p| coarse.sample(p * spacing, 0)), table(), 0.5)]
        };
        let exact = truth(std::slice::from_ref(&plain), &desc).color;
        within(&format!("exact, {n}³"), max_error(&truth(&fine(ScalarType::F64), &desc).color, &exact), 2e-9);
        let wanted = Setup::post(0.02).colors(std::slice::from_ref(&plain), &desc);
        let found = Setup::post(0.02).colors(&fine(ScalarType::F32), &desc);
        within(&format!("cpu, {n}³"), max_error(&found, &wanted), 1e-5);
    }
}

#[test]
fn not_a_number_is_transparent_wherever_it_has_weight() {
    let hole = |p: DVec3| if p.y == 2.0 { f64::NAN } else { 1.0 };
    let wanted = 1.0 - 0.7f64.powf(2.0);
    for scalar in [ScalarType::F16, ScalarType::F32, ScalarType::F64] {
        let shape = lut(&volume([2, 5, 2], scalar, hole), greys(&[(0.0, 1.0, 0.3)]), 1.0);
        let desc = along_y(0.5, 0.5);
        within("exact", max_error(&[truth(std::slice::from_ref(&shape), &desc).color[0]], &[[wanted; 4]]), 1e-9);
        for setup in [Setup::post(0.25), Setup::pre_integrated(0.25), Setup::cpu().step(0.25)] {
            within("cpu", max_error(&[setup.pixel(&shape, &desc)], &[[wanted; 4]]), 5e-6);
        }
        // Without weight it does no harm: rays through the plane of samples x = 0.
        let side = volume([3, 3, 2], scalar, |p| if p.x == 2.0 { f64::NAN } else { 1.0 });
        let shape = lut(&side, greys(&[(0.0, 1.0, 0.3)]), 1.0);
        for (x, wanted) in [(0.4, 1.0 - 0.7f64.powi(2)), (1.6, 0.0)] {
            let found = Setup::post(0.25).pixel(&shape, &along_y(x, 0.5));
            within("cpu beside", max_error(&[found], &[[wanted; 4]]), 5e-6);
        }
    }
}

#[test]
fn fine_data_on_a_large_offset_keeps_its_detail() {
    let rule = |p: DVec3| 0.5 + 0.4 * (p.x + 0.7 * p.y).sin() * p.z.cos();
    let table = |o: f64| greys(&[(o, 0.1, 0.0), (o + 1.0, 0.9, 0.7)]);
    let wanted =
        Setup::rays(0.2).colors(&[lut(&volume([5, 6, 7], ScalarType::F64, rule), table(0.0), 1.0)], &oblique(10));
    let offset = 1e7;
    let shape = [lut(&volume([5, 6, 7], ScalarType::F64, |p| offset + rule(p)), table(offset), 1.0)];
    // f64 at 1e7 has steps of 2e-9.
    within("reference", max_error(&Setup::rays(0.2).colors(&shape, &oblique(10)), &wanted), 1e-6);
    within("cpu", max_error(&Setup::post(0.2).colors(&shape, &oblique(10)), &wanted), 1e-5);
    let whole = [lut(
        &volume([5, 6, 7], ScalarType::U32, |p| 4e9 + (1000.0 * rule(p)).round()),
        greys(&[(4e9, 0.1, 0.0), (4e9 + 1000.0, 0.9, 0.7)]),
        1.0,
    )];
    let wanted = Setup::rays(0.2).colors(&whole, &oblique(10));
    within("cpu, u32", max_error(&Setup::post(0.2).colors(&whole, &oblique(10)), &wanted), 1e-5);
}

/// What one texture makes of a volume is nothing to another: ranges differ, data is shared.
#[test]
fn textures_of_one_volume_with_ranges_of_their_own_do_not_meddle() {
    let data = volume([9, 10, 11], ScalarType::F64, |p| (p.x - 4.0) * (p.y - 3.0) + p.z);
    let table = || greys(&[(2.0, 0.1, 0.0), (9.0, 0.9, 0.5)]);
    let texture = |range| VolumeTexture::new(&data).with_range(range).unwrap();
    let shapes = [lut_of(&texture([0.0, 1.0]), table(), 1.0), lut_of(&texture([5.0, 4000.0]), table(), 1.0)];
    let mut action = Setup::post(0.3).action();
    shapes.iter().for_each(|s| action.manage(s).unwrap());
    let wanted = Setup::rays(0.3).colors(&shapes[..1], &oblique(10));
    for shape in &shapes {
        let frame = volact_conformance::rig::draw_managed(&mut *action, std::slice::from_ref(shape), &oblique(10));
        let found = volact_conformance::metrics::wide(&frame.unwrap());
        within("own range", max_error(&found, &wanted), 1e-5);
    }
}

/// A fill value far outside must not cost the data its detail.
#[test]
fn fill_values_leave_the_data_its_detail() {
    for scalar in [ScalarType::F32, ScalarType::F64] {
        let rule = |p: DVec3| if p.x == 6.0 { 1e30 } else { 0.5 + 0.4 * (p.x + 0.7 * p.y).sin() * p.z.cos() };
        let table = greys(&[(0.0, 0.1, 0.0), (1.0, 0.9, 0.7), (1.0, 0.0, 0.0)]);
        let shape = [lut(&volume([7, 6, 7], scalar, rule), table, 1.0)];
        let wanted = Setup::rays(0.2).colors(&shape, &oblique(10));
        let found = Setup::post(0.2).colors(&shape, &oblique(10));
        // Samples next to the step between 1 and the fill value lie on one side or the other.
        let wrong = (0..found.len()).filter(|&i| max_error(&found[i..=i], &wanted[i..=i]) > 1e-4).count();
        within(&format!("fill values of {scalar}: pixels"), wrong as f64, 2.0);
    }
}
