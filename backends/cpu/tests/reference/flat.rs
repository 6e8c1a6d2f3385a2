//! Maximum, minimum, mean and line integral against brute force, and how they are laid over.

use proptest::prelude::*;
use volact_core::{Appearance, Shape, Volume, glam::DVec3};

use super::common::{along_z, certify, enclose, lut, one_ray, picture, point, table, volume, volume_of};

fn shape(data: &Volume, shader: &str, unit: Option<f64>) -> Shape {
    let grey = table(&[point(-2.0, [0.0; 3], 0.5), point(6.0, [1.0; 3], 0.5)]);
    let look = Appearance::new(shader).with("lookup_table", grey);
    Shape::around(data, unit.map_or(look.clone(), |u| look.with("unit_distance", u)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn reductions_match_brute_force(
        corner in prop::array::uniform8(-1.0..1.0f64),
        from in prop::array::uniform2(0.02..0.98f64),
        to in prop::array::uniform2(0.02..0.98f64),
    ) {
        let (a, b) = (DVec3::new(from[0], from[1], 0.0), DVec3::new(to[0], to[1], 1.0));
        let value = |s: f64| {
            let f = a + (b - a) * s;
            let weight = |i: usize| (0..3).map(|a| if i >> a & 1 == 1 { f[a] } else { 1.0 - f[a] }).product::<f64>();
            (0..8).map(|i| corner[i] * weight(i)).sum::<f64>()
        };
        let n = 20_000;
        let all: Vec<f64> = (0..=n).map(|i| value(f64::from(i) / f64::from(n))).collect();
        let (least, most) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), &v| (l.min(v), m.max(v)));
        // Simpson's rule is exact for cubics.
        let mean = (value(0.0) + 4.0 * value(0.5) + value(1.0)) / 6.0;
        let data = volume([2; 3], corner.to_vec());
        let frame = one_ray(a - (b - a), b);
        let line = mean * (b - a).length() / 0.5;
        for (shader, unit, truth, error) in
            [("mip", None, most, 1e-7), ("minip", None, least, 1e-7), ("average", None, mean, 0.0), ("xray", Some(0.5), line, 0.0)]
        {
            let grey = (truth + 2.0) / 8.0 * 0.5;
            enclose(&picture(&[shape(&data, shader, unit)], &frame), [grey, grey, grey, 0.5], 1e-12, error);
        }
    }
}

#[test]
fn maximum_inside_a_cell_is_found_exactly() {
    // v = 4·s(1 − s) along the diagonal of a face.
    let data = volume([2; 3], vec![0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 4.0]);
    let corners = volume([2; 3], vec![0.0, 4.0, 4.0, 0.0, 0.0, 4.0, 4.0, 0.0]);
    let ray = one_ray(DVec3::new(-1.0, 2.0, 0.5), DVec3::new(0.5, 0.5, 0.5));
    let grey = |v: f64| (v + 2.0) / 8.0 * 0.5;
    certify(&[shape(&data, "mip", None)], &ray, [grey(1.0), grey(1.0), grey(1.0), 0.5]);
    certify(&[shape(&corners, "minip", None)], &ray, [grey(2.0), grey(2.0), grey(2.0), 0.5]);
}

#[test]
fn default_table_is_grey_over_the_range() {
    let data = volume_of([2, 2, 3], |[_, _, z]| z as f64);
    let shape = Shape::around(&data, Appearance::new("average"));
    certify(&[shape], &along_z(0.3, 0.4), [0.5, 0.5, 0.5, 1.0]);
}

#[test]
fn nan_counts_neither_for_extremes_nor_for_length() {
    let data = volume_of([2, 2, 4], |at| if at == [0, 1, 3] { f64::NAN } else { at[2] as f64 });
    let grey = |v: f64| (v + 2.0) / 8.0 * 0.5;
    for (shader, unit, value) in [("mip", None, 2.0), ("average", None, 1.0), ("xray", Some(1.0), 2.0)] {
        certify(&[shape(&data, shader, unit)], &along_z(0.4, 0.6), [grey(value), grey(value), grey(value), 0.5]);
    }
    let nothing = volume_of([2, 2, 2], |_| f64::NAN);
    certify(&[shape(&nothing, "mip", None)], &along_z(0.4, 0.6), [0.0; 4]);
}

#[test]
fn pictures_are_laid_over_the_rest_in_the_order_of_drawing() {
    let data = volume_of([2, 2, 2], |_| 6.0);
    let low = volume_of([2, 2, 2], |_| -2.0);
    let body = lut(&data, table(&[point(0.0, [1.0, 0.0, 0.0], 0.5)]), 1.0);
    let (white, black) = (shape(&data, "mip", None), shape(&low, "minip", None));
    let ray = along_z(0.4, 0.6);
    certify(&[white.clone(), body.clone(), black.clone()], &ray, [0.375, 0.25, 0.25, 0.875]);
    certify(&[black, white, body], &ray, [0.625, 0.5, 0.5, 0.875]);
}
