//! Random cubic cells against an independent integration, opacities near 1 included.

use proptest::prelude::*;
use volact_core::{ControlPoint, glam::DVec3};

use super::common::{enclose, lut, one_ray, picture, table, truth, volume};

fn tables() -> impl Strategy<Value = Vec<ControlPoint>> {
    let opacity = prop_oneof![0.0..1.0f64, Just(0.0), Just(1.0), Just(0.999_999), Just(1.0 - 1e-12), 0.98..1.0f64];
    let entry = (-1.0..2.0f64, prop::array::uniform3(0.0..1.0f64), opacity);
    prop::collection::vec(entry, 1..7).prop_map(|entries| {
        let point = |(value, color, opacity)| ControlPoint { value, color, opacity };
        let mut points: Vec<_> = entries.into_iter().map(point).collect();
        points.sort_by(|a, b| a.value.total_cmp(&b.value));
        points
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn enclosure_holds_the_truth(
        corner in prop::array::uniform8(-0.5..1.5f64),
        from in prop::array::uniform2(0.02..0.98f64),
        to in prop::array::uniform2(0.02..0.98f64),
        points in tables(),
        unit in 0.2..5.0f64,
    ) {
        let (a, b) = (DVec3::new(from[0], from[1], 0.0), DVec3::new(to[0], to[1], 1.0));
        let expected =
            truth(&corner, a.to_array(), b.to_array(), (b - a).length(), unit, &points);
        let shape = lut(&volume([2; 3], corner.to_vec()), table(&points), unit);
        // The quadrature's own error.
        enclose(&picture(&[shape], &one_ray(a - (b - a), b)), expected, 1e-9, 1e-12);
    }
}
