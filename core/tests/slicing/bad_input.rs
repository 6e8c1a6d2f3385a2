//! What cannot be sliced is an error or nothing, never a panic, an endless loop or a wrong picture.

use proptest::prelude::*;
use volact_core::{
    glam::{DAffine3, DVec3},
    slicing::{Order, Planner, Rate, Sampling, SamplingMode, SamplingSpace, Slicing},
};

use super::common::{along, carrying, cube, each, from_eye, mesh, solids};

fn refused(sampling: Sampling) -> String {
    let solids = solids(&[cube(5)]);
    Slicing::new(solids.iter().collect(), &along(DVec3::Y), &sampling).unwrap_err().to_string()
}

#[test]
fn numbers_out_of_bounds_are_named() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let text = refused(Sampling { rate: Rate::Period([1.0, bad, 1.0]), ..Sampling::default() });
        assert!(text.contains("sampling period"), "{text}");
        let text = refused(Sampling { rate: Rate::Distance(bad), ..Sampling::default() });
        assert!(text.contains("distance of planes"), "{text}");
        let planner = Planner::new(move |_, _| bad);
        let text = refused(Sampling { rate: Rate::Accuracy(planner), ..Sampling::default() });
        assert!(text.contains("distance of planes"), "{text}");
    }
    let text = refused(Sampling { most_planes: Some(1), ..Sampling::default() });
    assert!(text.contains("at least 2"), "{text}");
    let text = refused(Sampling { rate: Rate::Distance(1e-9), ..Sampling::default() });
    assert!(text.contains("needs 4.000e9 planes"), "{text}");
}

#[test]
fn what_lies_too_far_from_the_lattice_is_refused() {
    let far = cube(5);
    far.set_transform(DAffine3::from_translation(DVec3::Y * 1e14));
    let far = solids(&[far]);
    let error = Slicing::new(far.iter().collect(), &along(DVec3::Y), &Sampling::default()).unwrap_err();
    assert!(error.to_string().contains("counted from"), "{error}");
}

#[test]
fn nothing_to_draw_is_no_slice() {
    let sampling = Sampling::default();
    let nobody = Slicing::new(Vec::new(), &along(DVec3::Y), &sampling).unwrap();
    assert!(nobody.sweep(Order::default()).next_slice().is_none());
    assert_eq!(nobody.step().planes, 0);
    // Behind the eye.
    let behind = solids(&[cube(5)]);
    let frame = from_eye(DVec3::Y * 10.0, DVec3::Y * 20.0);
    let slicing = Slicing::new(behind.iter().collect(), &frame, &sampling).unwrap();
    assert!(slicing.sweep(Order::default()).next_slice().is_none());
}

proptest! {
    /// Numbers of any size: an answer, and polygons of finite numbers where there are any.
    #[test]
    fn any_numbers_have_an_answer(
        points in prop::collection::vec(prop::array::uniform3(prop_oneof![9 => -2.0..2.0f64, 1 => Just(0.0), 1 => Just(1e-300), 1 => Just(1e100)]), 6),
        scale in prop::sample::select(vec![1.0, 1e-100, 1e9, 1e101]),
        eye in prop::array::uniform3(-9.0..9.0f64),
        mode in 0usize..3, space in 0usize..3, distance in prop_oneof![0.1..2.0f64, 1e90..1e110f64],
    ) {
        let points: Vec<DVec3> = points.into_iter().map(|p| DVec3::from(p) * scale).collect();
        let made = mesh(&points, &[[0, 1, 2, 3], [2, 3, 4, 5], [1, 0, 4, 2]]);
        prop_assume!(volact_core::Geometry::tessellate(&made).is_ok_and(|m| !m.tetrahedra.is_empty() && m.validate("mesh").is_ok()));
        let shape = carrying(made);
        shape.set_parameter("unit_distance", 1.0);
        let sampling = Sampling {
            mode: [SamplingMode::Auto, SamplingMode::AxisAligned, SamplingMode::SphericalShells][mode],
            space: [SamplingSpace::ViewVolume, SamplingSpace::Object, SamplingSpace::Primitive][space],
            rate: Rate::Distance(distance),
            most_planes: Some(100),
        };
        let mut slices = 0;
        let outcome = each(&[shape], &from_eye(DVec3::from(eye), DVec3::splat(30.0)), &sampling, Order::FrontToBack, |_, _, p| {
            slices += 1;
            for v in p.faces().iter().flat_map(|f| p.vertices(f)) {
                assert!(!v.object.is_nan());
            }
        });
        prop_assert!(outcome.is_err() || slices <= 100);
    }
}
