//! Depth against closed forms: the distance at which half is absorbed.
//!
//! In the corner x + y + z < 4 rays along z enter at z = 0, 3 from the camera. The same corner drawn
//! twice with twice the unit distance absorbs as much, but is put together as overlapping shapes are.

use std::f64::consts::LN_2;

use volact_core::{
    Attribute, Buffer, Camera, CellType, CellTypes, FrameDesc, LookupTable, Mesh, ScalarType, Shape, glam::DVec3,
};

use super::scenes::{action, cpu, draw, look, table};

fn corner(rule: impl Fn(DVec3) -> f64, table: LookupTable, unit: f64) -> Shape {
    let points = vec![DVec3::ZERO, 4.0 * DVec3::X, 4.0 * DVec3::Y, 4.0 * DVec3::Z];
    let values = points.iter().map(|&p| rule(p)).collect();
    let numbers = Attribute::new("numbers", ScalarType::F64, 1, Buffer::from_vec(values)).unwrap();
    let types = CellTypes::All(CellType::Tetrahedron);
    let mesh = Mesh::new(points.into(), types, Buffer::from_vec(vec![0u32, 1, 2, 3])).unwrap();
    let look = look(table).with("scalars", numbers).with("unit_distance", unit);
    Shape::new(mesh, volact_core::Appearance { shader: "attribute".into(), ..look })
}

/// Compares the depths of all pixels with a rule of x and y, alone and twice at half strength.
fn check(what: &str, rule: fn(DVec3) -> f64, table: impl Fn() -> LookupTable, wanted: impl Fn(f64, f64) -> f64) {
    let eye = DVec3::new(1.0, 1.0, -3.0);
    let pixels = 8;
    let desc = FrameDesc::new(Camera::orthographic(eye, eye + DVec3::Z, DVec3::Y, 1.6), pixels, pixels);
    let grid = desc.camera.rays(&desc.viewport()).unwrap();
    let alone = || vec![corner(rule, table(), 1.0)];
    let twice = || vec![corner(rule, table(), 2.0), corner(rule, table(), 2.0)];
    for (name, bound) in [("reference", 3e-7), ("cpu", 2e-5)] {
        for (how, shapes) in [("alone", alone()), ("twice", twice())] {
            let mut action = match name {
                "cpu" => cpu(0.1, &[("termination", 0.0.into())]),
                _ => action("reference", &[("method", "exact".into())]),
            };
            let frame = draw(&mut *action, &shapes, &desc);
            let mut finite = 0;
            for (i, depth) in frame.depth.iter().enumerate() {
                let at = grid.ray((i % pixels) as f64 + 0.5, (i / pixels) as f64 + 0.5).origin;
                let z = wanted(at.x, at.y);
                let wanted = if z < 4.0 - at.x - at.y { 3.0 + z } else { f64::INFINITY };
                let found = f64::from(*depth);
                finite += usize::from(wanted.is_finite());
                assert!(
                    found == wanted || (found - wanted).abs() < bound * wanted,
                    "{what}, {name} {how}, {at}: {found} {wanted}"
                );
            }
            assert!(finite > 8, "{what}: {finite}");
        }
    }
}

/// With constant extinction σ half is absorbed over ln 2/σ.
#[test]
fn constant_extinction_reaches_half_at_its_length() {
    let look = || table(&[(0.0, [1.0, 0.5, 0.2], 0.4)]);
    check("constant", |_| 7.0, look, |_, _| LN_2 / -0.6f64.ln());
}

/// A table of opacities 1 − e^(−v) makes extinction the number v itself. Along a ray it is
/// g(x, y) + z/2: optical depth is g·z + z²/4.
#[test]
fn linear_extinction_reaches_half_at_the_root_of_a_quadratic() {
    let number = |p: DVec3| 0.1 + 0.05 * p.x + 0.1 * p.y + 0.5 * p.z;
    // Between points extinction is off by (3/2000)²/8.
    let points: Vec<_> = (0..=2000)
        .map(|i| {
            let v = 3.0 * f64::from(i) / 2000.0;
            (v, [1.0, 0.5, 0.2], -(-v).exp_m1())
        })
        .collect();
    check(
        "linear",
        number,
        || table(&points),
        |x, y| {
            let g = 0.1 + 0.05 * x + 0.1 * y;
            2.0 * ((g * g + LN_2).sqrt() - g)
        },
    );
}

/// With opacity a = z/4 optical depth is 4·((1 − a)·ln(1 − a) + a); it is 4 where a is 1.
#[test]
fn linear_opacity_reaches_half_where_its_integral_does() {
    let look = || table(&[(0.0, [0.2, 0.5, 1.0], 0.0), (4.0, [1.0, 0.5, 0.2], 1.0)]);
    let depth = |z: f64| 4.0 * ((1.0 - z / 4.0) * (-z / 4.0).ln_1p() + z / 4.0);
    let (mut low, mut high) = (0.0, 4.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if depth(middle) < LN_2 { low = middle } else { high = middle }
    }
    check("opacity", |p| p.z, look, |_, _| low);
}
