//! Lookup tables: any number of entries, anywhere, clamped, before or after interpolation.

use volact_conformance::{
    metrics::{max_error, within},
    rig::{Setup, truth},
    scene::{along_y, ball, colors, constant, greys, lut, lut_of, square, volume},
};
use volact_core::{ControlPoint, FrameDesc, LookupTable, ScalarType, VolumeTexture, glam::DVec3};

fn oblique() -> FrameDesc {
    square(DVec3::splat(4.5), DVec3::new(7.0, -20.0, 9.0), 13.0, 10)
}

fn smooth() -> volact_core::Volume {
    volume([10, 10, 10], ScalarType::F32, |p| 50.0 + 40.0 * (0.5 * p.x + 0.3 * p.y).sin() * (0.4 * p.z).cos())
}

/// Entries by rule: never two alike next to each other.
fn entries(n: usize) -> Vec<[f32; 4]> {
    let wave = |i: usize, f: f32| 0.5 + 0.5 * (f * i as f32).sin();
    (0..n).map(|i| [wave(i, 0.7), wave(i, 1.1), wave(i, 1.9), 0.4 * wave(i, 0.37)]).collect()
}

#[test]
fn tables_of_any_number_of_entries_equal_their_points() {
    [1usize, 2, 3, 7, 255, 256].into_iter().for_each(entries_equal_their_points);
}

/// Each of thousands of entries differs wholly from the next: `cpu` needs as many nodes, and more.
#[test]
fn jagged_table_of_thousands_of_entries() {
    entries_equal_their_points(4097);
}

fn entries_equal_their_points(n: usize) {
    let domain = [5.0, 97.0];
    let table = LookupTable::from_entries(entries(n), Some(domain)).unwrap();
    let place = |i: usize| domain[0] + (domain[1] - domain[0]) * i as f64 / (n - 1).max(1) as f64;
    let point = |(i, e): (usize, &[f32; 4])| {
        let [r, g, b, opacity] = e.map(f64::from);
        ControlPoint { value: place(i), color: [r, g, b], opacity }
    };
    let points = LookupTable::from_points(entries(n).iter().enumerate().map(point).collect::<Vec<_>>()).unwrap();
    assert_eq!((table.len(), points.len()), (n, n));
    let data = smooth();
    for setup in [Setup::rays(0.25), Setup::post(0.25)] {
        let found = setup.colors(&[lut(&data, table.clone(), 2.0)], &oblique());
        let wanted = setup.colors(&[lut(&data, points.clone(), 2.0)], &oblique());
        within(&format!("{n} entries against points"), max_error(&found, &wanted), 1e-6);
    }
    let found = Setup::post(0.25).colors(&[lut(&data, table.clone(), 2.0)], &oblique());
    let wanted = Setup::rays(0.25).colors(&[lut(&data, table, 2.0)], &oblique());
    // f32 data of 100 resolves a value to 4e-6; an entry of 4097 spans 0.02 of it and changes
    // by up to 1: 2e-4 of a sample's colour, of which each adds its share.
    let tolerance = 1e-5 + 4e-8 * n as f64;
    within(&format!("{n} entries, cpu against rays"), max_error(&found, &wanted), tolerance);
}

#[test]
fn entries_without_a_domain_span_the_range_of_the_texture() {
    let data = volume([4, 4, 4], ScalarType::U8, |p| 30.0 * p.x + 10.0 * p.y);
    let free = LookupTable::from_entries(entries(9), None).unwrap();
    let bound = |d| LookupTable::from_entries(entries(9), Some(d)).unwrap();
    let narrow = VolumeTexture::new(&data).with_range([20.0, 120.0]).unwrap();
    for setup in [Setup::rays(0.3), Setup::post(0.3)] {
        let free_on = |t: &VolumeTexture| setup.colors(&[lut_of(t, free.clone(), 1.0)], &oblique());
        let bound_on = |d| setup.colors(&[lut(&data, bound(d), 1.0)], &oblique());
        assert_eq!(free_on(&VolumeTexture::new(&data)), bound_on([0.0, 255.0]));
        within("range", max_error(&free_on(&narrow), &bound_on([20.0, 120.0])), 1e-6);
        assert_ne!(free_on(&narrow), free_on(&VolumeTexture::new(&data)));
    }
}

/// The colour and opacity of a value, seen through a unit of it.
fn at(value: f64, table: &LookupTable, setup: &Setup) -> [f64; 4] {
    setup.pixel(&lut(&constant(value, [1, 1, 1]), table.clone(), 1.0), &along_y(0.5, 0.5))
}

#[test]
fn window_and_level_make_a_ramp_clamped_outside() {
    let table = LookupTable::window_level(80.0, 40.0, 0.5).unwrap();
    for setup in [Setup::exact(), Setup::post(0.3), Setup::pre_integrated(0.3)] {
        for (value, t) in [(-1000.0, 0.0), (0.0, 0.0), (20.0, 0.25), (40.0, 0.5), (80.0, 1.0), (3000.0, 1.0)] {
            let a = 0.5 * t;
            within(
                &format!("value {value}"),
                max_error(&[at(value, &table, &setup)], &[[t * a, t * a, t * a, a]]),
                2e-6,
            );
        }
    }
    assert!(LookupTable::window_level(0.0, 40.0, 0.5).is_err());
}

#[test]
fn values_outside_a_table_take_its_ends() {
    let table = colors(&[(10.0, [0.2, 0.4, 0.6], 0.3), (20.0, [0.9, 0.1, 0.5], 0.8)]);
    for setup in [Setup::exact(), Setup::post(0.3), Setup::pre_integrated(0.3)] {
        for value in [-1e6, 9.0, 10.0] {
            within("below", max_error(&[at(value, &table, &setup)], &[[0.06, 0.12, 0.18, 0.3]]), 2e-6);
        }
        for value in [20.0, 21.0, 1e6] {
            within("above", max_error(&[at(value, &table, &setup)], &[[0.72, 0.08, 0.4, 0.8]]), 2e-6);
        }
    }
}

#[test]
fn two_points_at_one_value_are_a_step_that_belongs_to_the_second() {
    let table = greys(&[(0.0, 0.2, 0.1), (5.0, 0.2, 0.1), (5.0, 1.0, 0.7), (9.0, 1.0, 0.7)]);
    for setup in [Setup::exact(), Setup::rays(0.3), Setup::post(0.3)] {
        for (value, grey, a) in [(4.9, 0.2, 0.1), (5.0, 1.0, 0.7), (5.1, 1.0, 0.7)] {
            let wanted = [grey * a, grey * a, grey * a, a];
            within(&format!("{setup:?} at {value}"), max_error(&[at(value, &table, &setup)], &[wanted]), 2e-6);
        }
    }
    // Integers right on the step, too: these are what segmentations are made of.
    let data = volume([2, 2, 2], ScalarType::U8, |_| 5.0);
    let found = Setup::post(0.3).pixel(&lut(&data, table, 1.0), &along_y(0.5, 0.5));
    within("u8 on the step", max_error(&[found], &[[0.7; 4]]), 2e-6);
}

#[test]
fn pre_interpolation_equals_post_where_the_table_is_linear() {
    let linear = greys(&[(0.0, 0.1, 0.0), (100.0, 0.9, 0.5)]);
    let desc = oblique();
    for setup in [Setup::rays(0.25), Setup::cpu().step(0.25).with("termination", 0.0)] {
        let post = setup.colors(&[lut(&smooth(), linear.clone(), 2.0)], &desc);
        let pre = setup.colors(&[lut(&smooth(), linear.clone().pre_interpolated(), 2.0)], &desc);
        within("linear table", max_error(&post, &pre), 1e-5);
    }
    let post = truth(&[lut(&smooth(), linear.clone(), 2.0)], &desc).color;
    let pre = truth(&[lut(&smooth(), linear.pre_interpolated(), 2.0)], &desc).color;
    within("linear table, exact", max_error(&post, &pre), 2e-9);
}

/// Two voxels of opacity 0 with a peak between: interpolated values see it, voxels do not.
#[test]
fn pre_interpolation_differs_where_the_table_bends() {
    let data = volume([2, 2, 2], ScalarType::F32, |p| p.x);
    let tent = greys(&[(0.0, 1.0, 0.0), (0.5, 1.0, 0.6), (1.0, 1.0, 0.2)]);
    for setup in [Setup::exact(), Setup::rays(0.3), Setup::cpu().step(0.3)] {
        for (x, post, pre) in [(0.5, 0.6, 0.1), (0.25, 0.3, 0.05), (0.75, 0.4, 0.15)] {
            let found = setup.pixel(&lut(&data, tent.clone(), 1.0), &along_y(x, 0.5));
            within("after", max_error(&[found], &[[post; 4]]), 4e-6);
            let found = setup.pixel(&lut(&data, tent.clone().pre_interpolated(), 1.0), &along_y(x, 0.5));
            within("before", max_error(&[found], &[[pre; 4]]), 4e-6);
        }
    }
}

#[test]
fn pre_interpolated_tables_agree_with_the_reference() {
    let bent = greys(&[(20.0, 0.1, 0.0), (90.0, 0.9, 0.4), (91.0, 0.3, 0.0), (200.0, 0.6, 0.9)]).pre_interpolated();
    let shape = [lut(&ball([11, 12, 10], ScalarType::U8), bent, 2.0)];
    let found = Setup::cpu().step(0.3).with("termination", 0.0).colors(&shape, &oblique());
    within("cpu", max_error(&found, &Setup::rays(0.3).colors(&shape, &oblique())), 1e-6);
}
