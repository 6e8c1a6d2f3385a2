//! Numbers on meshes: closed forms, and what must not change the picture.

use proptest::prelude::*;
use volact_core::{Appearance, Cylinder, Shape, StructuredMesh, glam::DVec3};

use super::{
    common::{along_z, certify, lut, one_ray, picture, point, table, volume_of},
    mesh_common::{Parts, agree, attribute, cube, field, grid, nasty, views},
};

const RED: [f64; 3] = [1.0, 0.25, 0.0];

fn layers() -> volact_core::LookupTable {
    table(&[
        point(0.1, [0.0, 0.2, 0.9], 0.0),
        point(0.3, [0.9, 0.2, 0.1], 0.6),
        point(0.5, [0.2, 0.8, 0.3], 0.05),
        point(0.9, [0.7, 0.7, 0.2], 0.999),
    ])
}

/// A linear field that the layers' table sees all of.
fn slope(p: DVec3) -> f64 {
    p.dot(DVec3::new(0.3, 0.45, 0.25))
}

fn corner() -> Parts {
    Parts { points: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], tetrahedra: vec![[0, 1, 2, 3]] }
}

/// ∫ −ln(1 − a) over a unit length on which 1 − a goes from p to q. About the middle m, with
/// h = (q − p)/2, this is −ln m + Σ (h/m)²ᵏ/(2k(2k + 1)): where p and q are close, without
/// cancellation.
fn mean_depth(p: f64, q: f64) -> f64 {
    let (m, h) = (0.5 * (p + q), 0.5 * (q - p));
    let x = h / m;
    if x.abs() > 0.3 {
        return 1.0 - (q * q.ln() - p * p.ln()) / (q - p);
    }
    -m.ln() + (1..20).map(|k| x.powi(2 * k) / f64::from(2 * k * (2 * k + 1))).sum::<f64>()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// The ray along z at (x, y) has the chord 1 − x − y.
    #[test]
    fn constant_field_in_a_tetrahedron(a in 0.0..1.0f64, unit in 0.1..10.0f64, x in 0.01..0.49f64, y in 0.01..0.49f64) {
        let absorbed = -((1.0 - x - y) / unit * (-a).ln_1p()).exp_m1();
        let shape = field(&corner(), |_| 7.0, table(&[point(0.0, RED, a)]), unit);
        certify(&[shape], &along_z(x, y), [absorbed, 0.25 * absorbed, 0.0, absorbed]);
    }

    /// Opacity is the value itself.
    #[test]
    fn linear_field_in_a_tetrahedron(
        g in prop::array::uniform3(0.0..0.3f64),
        unit in 0.3..4.0f64,
        x in 0.01..0.49f64,
        y in 0.01..0.49f64,
    ) {
        let f = |p: DVec3| 0.05 + p.dot(DVec3::from(g));
        let table = table(&[point(0.0, RED, 0.0), point(1.0, RED, 1.0)]);
        let length = 1.0 - x - y;
        let (front, back) = (f(DVec3::new(x, y, 0.0)), f(DVec3::new(x, y, length)));
        let absorbed = -(-length / unit * mean_depth(1.0 - front, 1.0 - back)).exp_m1();
        certify(&[field(&corner(), f, table, unit)], &along_z(x, y), [absorbed, 0.25 * absorbed, 0.0, absorbed]);
    }

    /// A peak that touches 1, anywhere in the tetrahedron: ∫₀¹ −ln x dx = 1 on either side.
    #[test]
    fn peak_in_a_tetrahedron(at in 0.05..0.45f64, unit in 0.3..9.0f64, x in 0.01..0.24f64, y in 0.01..0.24f64) {
        let table = table(&[point(0.0, RED, 0.0), point(at, RED, 1.0), point(2.0 * at, RED, 0.0)]);
        let length = 1.0 - x - y;
        // What lies behind the peak's far foot is transparent; before it, a cut triangle.
        let end = length / at - 1.0;
        let back = if end >= 1.0 { 1.0 } else { end - end * end.ln() };
        let absorbed = -(-at / unit * (1.0 + back)).exp_m1();
        certify(&[field(&corner(), |p| p.z, table, unit)], &along_z(x, y), [absorbed, 0.25 * absorbed, 0.0, absorbed]);
    }

    /// A step to opaque: in front of it a constant, then the colour right behind the step.
    #[test]
    fn ray_ends_where_opacity_becomes_one(a in 0.0..0.99f64, at in 0.05..0.45f64, unit in 0.5..3.0f64) {
        let points = [point(0.0, RED, a), point(at, RED, a), point(at, [0.0, 1.0, 0.5], 1.0), point(1.0, [9.0; 3], 1.0)];
        let absorbed = -(at / unit * (-a).ln_1p()).exp_m1();
        let left = 1.0 - absorbed;
        let truth = [absorbed, 0.25 * absorbed + left, 0.5 * left, 1.0];
        certify(&[field(&corner(), |p| p.z, table(&points), unit)], &along_z(0.2, 0.3), truth);
    }

    /// The total length is that of the cube, whatever the cells and the direction: no cell is met
    /// twice, none is left out.
    #[test]
    fn cells_share_out_the_ray(seed in 0..1u64 << 40) {
        let mut dice = super::mesh_common::Dice(seed);
        let parts = nasty(2, 60, seed);
        let (from, to) = (dice.point(), dice.point());
        prop_assume!(from.distance(to) > 0.1);
        let direction = (to - from).normalize();
        let [enter, leave] = volact_core::Aabb::new(DVec3::ZERO, DVec3::ONE).clip_line(from, direction).unwrap();
        let absorbed = -((leave - enter) * (-0.3f64).ln_1p()).exp_m1();
        let shape = field(&parts, |_| 1.0, table(&[point(0.0, RED, 0.3)]), 1.0);
        certify(&[shape], &one_ray(from - 5.0 * direction, from + direction), [absorbed, 0.25 * absorbed, 0.0, absorbed]);
    }
}

#[test]
fn cube_is_the_same_however_it_is_cut() {
    let whole = lut(&volume_of([2; 3], |[x, y, z]| slope(DVec3::new(x as f64, y as f64, z as f64))), layers(), 0.2);
    for frame in views() {
        let truth = picture(std::slice::from_ref(&whole), &frame);
        for parts in [5, 6, 24] {
            agree(&picture(&[field(&cube(parts), slope, layers(), 0.2)], &frame), &truth);
        }
    }
}

#[test]
fn linear_field_is_the_same_on_any_mesh() {
    let whole = lut(&volume_of([2; 3], |[x, y, z]| slope(DVec3::new(x as f64, y as f64, z as f64))), layers(), 0.2);
    for frame in views() {
        let truth = picture(std::slice::from_ref(&whole), &frame);
        for parts in [grid(4, 0.0, 0), grid(3, 0.35, 7), nasty(3, 300, 8)] {
            agree(&picture(&[field(&parts, slope, layers(), 0.2)], &frame), &truth);
        }
    }
}

#[test]
fn mesh_in_two_shapes_is_the_mesh() {
    let wave = |p: DVec3| 0.5 + 0.5 * (9.0 * p.x + 5.0 * p.y * p.z).sin();
    let whole = nasty(3, 200, 3);
    let mut dice = super::mesh_common::Dice(11);
    let halves = whole.split(|_| dice.roll() < 0.5);
    let shape = |parts: &Parts| field(parts, wave, layers(), 0.1);
    for frame in views() {
        agree(&picture(&halves.each_ref().map(shape), &frame), &picture(&[shape(&whole)], &frame));
    }
}

#[test]
fn cells_over_each_other_count_each() {
    let wave = |p: DVec3| 0.5 + 0.5 * (9.0 * p.x + 5.0 * p.y * p.z).sin();
    let once = grid(2, 0.3, 5);
    let mut twice = once.clone();
    twice.tetrahedra.extend(once.tetrahedra.clone());
    for frame in views() {
        let half = picture(&[field(&once, wave, layers(), 0.1)], &frame);
        agree(&picture(&[field(&twice, wave, layers(), 0.2)], &frame), &half);
    }
    // Two cubes, half over each other.
    let parts = cube(6);
    let moved = parts.moved(|p| p + DVec3::new(0.25, 0.5, 0.125));
    let mut both = parts.clone();
    both.tetrahedra.extend(moved.tetrahedra.iter().map(|t| t.map(|v| v + 8)));
    both.points.extend(&moved.points);
    for frame in views() {
        let apart = [&parts, &moved].map(|p| field(p, wave, layers(), 0.1));
        agree(&picture(&[field(&both, wave, layers(), 0.1)], &frame), &picture(&apart, &frame));
    }
}

#[test]
fn colour_and_opacity_come_from_attributes_of_their_own() {
    let parts = grid(2, 0.3, 5);
    let color = table(&[point(0.0, [0.0; 3], 0.7), point(1.0, [1.0, 0.5, 0.25], 0.1)]);
    let opacity = table(&[point(0.0, [9.0; 3], 0.0), point(1.0, [5.0; 3], 0.9)]);
    let values = |f: fn(DVec3) -> f64| attribute(parts.points.iter().map(|&p| f(p)).collect());
    let look = Appearance::new("attribute").with("scalars", values(|p| p.x)).with("unit_distance", 0.5);
    let look = look.with("lookup_table", color).with("opacity_table", opacity).with("opacity_scalars", values(|_| 0.5));
    let shape = Shape::new(parts.mesh(), look);
    // Constant extinction, linear colour: ∫₀ᴸ σ e^{−σs} s/L ds = (1 − e^{−σL}(1 + σL)) / (σL).
    let depth = -(1.0f64 / 0.5) * (-0.45f64).ln_1p();
    let red = (1.0 - (-depth).exp() * (1.0 + depth)) / depth;
    let frame = one_ray(DVec3::new(-2.0, 0.3, 0.6), DVec3::new(1.0, 0.3, 0.6));
    certify(&[shape], &frame, [red, red / 2.0, red / 4.0, -(-depth).exp_m1()]);
}

#[test]
fn cells_without_a_value_are_transparent() {
    let parts = cube(24);
    let lower = |p: DVec3| if p.z > 0.75 { f64::NAN } else { 1.0 };
    let shape = field(&parts, lower, table(&[point(0.0, RED, 0.5)]), 1.0);
    // The pyramid below keeps its height of ½ and the ones beside it have corners above.
    let absorbed = -(0.5f64 * 0.5f64.ln()).exp_m1();
    certify(std::slice::from_ref(&shape), &along_z(0.5, 0.5), [absorbed, 0.25 * absorbed, 0.0, absorbed]);
    // Nothing is linear up to an infinite number: there is no value either.
    let table = table(&[point(0.0, [0.0; 3], 0.0), point(1.0, RED, 0.5)]);
    for other in [f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        let shape = field(&corner(), |p| if p.z > 0.5 { other } else { 0.25 }, table.clone(), 1.0);
        certify(&[shape], &along_z(0.25, 0.25), [0.0; 4]);
    }
    let shape = field(&corner(), |p| (p.x - p.y) * f64::INFINITY, table, 1.0);
    certify(&[shape], &along_z(0.25, 0.25), [0.0; 4]);
}

#[test]
fn inverted_and_collapsed_cells_change_nothing() {
    let parts = nasty(2, 40, 21);
    let mut bad = parts.clone();
    for (i, t) in bad.tetrahedra.iter_mut().enumerate() {
        if i % 3 == 0 {
            t.swap(1, 2);
        }
    }
    bad.tetrahedra.extend([[0, 1, 2, 2], [0, 0, 0, 0], [0, 1, 3, 4]]);
    for frame in views() {
        let shape = |p: &Parts| [field(p, slope, layers(), 0.2)];
        agree(&picture(&shape(&bad), &frame), &picture(&shape(&parts), &frame));
    }
}

/// The chord of a regular polygon of n corners around the origin, the first at (r, 0): the stretch
/// in front of all its sides, along y at x.
fn polygon_chord(n: u32, r: f64, x: f64) -> f64 {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for i in 0..n {
        let turn = std::f64::consts::TAU * (f64::from(i) + 0.5) / f64::from(n);
        let apothem = r * (std::f64::consts::PI / f64::from(n)).cos();
        let at = (apothem - x * turn.cos()) / turn.sin();
        if turn.sin() > 0.0 { high = high.min(at) } else { low = low.max(at) }
    }
    (high - low).max(0.0)
}

#[test]
fn cylinder_of_hexahedra_has_the_chord_of_its_polygon() {
    let ring = |n: u32| {
        let mut points = Vec::new();
        for z in 0..3 {
            for i in 0..=n {
                let (y, x) = (std::f64::consts::TAU * f64::from(i % n) / f64::from(n)).sin_cos();
                points.extend([0.25, 0.5, 1.0].map(|r| DVec3::new(r * x, r * y, f64::from(z))));
            }
        }
        StructuredMesh::new([3, n as usize + 1, 3], points.into()).unwrap()
    };
    let table = table(&[point(0.0, RED, 0.5)]);
    for n in [7u32, 24] {
        let values = attribute(vec![1.0; 3 * 3 * (n as usize + 1)]);
        let look = Appearance::new("attribute").with("scalars", values).with("lookup_table", table.clone());
        let shape = Shape::new(ring(n), look.with("unit_distance", 1.0));
        for x in [-0.9, -0.3, -0.1, 0.01, 0.2, 0.6, 0.93] {
            let length = polygon_chord(n, 1.0, x) - polygon_chord(n, 0.25, x);
            let absorbed = -(length * 0.5f64.ln()).exp_m1();
            let frame = one_ray(DVec3::new(x, -4.0, 0.7), DVec3::new(x, 1.0, 0.7));
            super::common::enclose(
                &picture(std::slice::from_ref(&shape), &frame),
                [absorbed, 0.25 * absorbed, 0.0, absorbed],
                1e-9,
                1e-14,
            );
        }
    }
}

#[test]
fn round_cylinder_closes_in_on_its_circle() {
    let look = |n: usize| {
        let values = attribute(vec![1.0; 2 + 2 * n]);
        Appearance::new("attribute").with("scalars", values).with("unit_distance", 1.0)
    };
    let table = table(&[point(0.0, RED, 0.5)]);
    let error = |n: u32| {
        let ends = [DVec3::ZERO, DVec3::new(0.0, 0.0, 2.0)];
        let solid = Cylinder::new(ends, 1.0, n).unwrap();
        let shape = Shape::new(solid, look(n as usize).with("lookup_table", table.clone()));
        // The mean over many chords, so that the place of the corners evens out.
        let mut sum = 0.0;
        for i in 0..64 {
            let x = -0.8 + 1.6 * (f64::from(i) + 0.5) / 64.0;
            let frame = one_ray(DVec3::new(x, -4.0, 0.7), DVec3::new(x, 1.0, 0.7));
            let made = picture(std::slice::from_ref(&shape), &frame);
            let length = (1.0 - made.color[0][3]).ln() / 0.5f64.ln();
            sum += 2.0 * (1.0 - x * x).sqrt() - length;
        }
        sum / 64.0
    };
    let (coarse, fine) = (error(32), error(64));
    assert!(coarse > 0.0 && (fine / coarse - 0.25).abs() < 0.03, "{coarse:e} {fine:e}");
}

#[test]
fn depth_is_where_half_is_absorbed() {
    let shape = field(&cube(6), |_| 1.0, table(&[point(0.0, RED, 0.75)]), 0.5);
    let made = picture(&[shape], &along_z(0.3, 0.6));
    assert!((made.depth[0] - (3.0 + 0.25)).abs() < 1e-12, "{}", made.depth[0]);
}
